"""A bound of mu close to one."""

import control

import robust


def test_the_slack_is_on_mu_and_not_on_a_norm_near_one():
    """mu(0) = 1 - 1e-7 with a real parameter: below one, and not by the slack that a proof in
    doubles has.
    """
    for below, holds in ((1e-7, False), (1e-4, True)):
        N = control.ss([[-1.0]], [[1.0]], [[1 - below]], [[0.0]])
        assert robust.mu.certify(N, [(1, 1, "real")]).holds == holds
