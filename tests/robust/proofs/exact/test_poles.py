"""Loops decided where floating point cannot tell: between two neighbouring doubles, against 450
digits.
"""

import control
import numpy as np
import pytest

from robust.proofs.exact.claim import to_matrices
from robust.proofs.exact.stability import decide_loop_stability, decide_matrix_stability
from tests.support.hard_loops import boundary_gain, hard_loop, margin, with_gain
from tests.support.random_loops import hold_and_delay


def stable(G, K):
    return decide_loop_stability(to_matrices(G), to_matrices(K)).holds


def test_the_boundary_lies_between_two_neighbouring_gains():
    rng, count = np.random.default_rng(5), 0
    while count < 2:
        G, K = hard_loop(rng, most=17)
        edges = boundary_gain(G, K, stable)
        if edges is None:
            continue
        assert np.nextafter(min(edges), np.inf) == max(edges)
        for gain in edges:
            assert (float(margin(G, with_gain(K, gain))) < 0) == stable(G, with_gain(K, gain))
        count += 1


@pytest.mark.parametrize("delay", [0.0, 0.013, 0.05])
def test_held_plants(delay):
    """The limit of the gain as one long matrix exponential sees it, to eleven digits on either
    side.
    """
    G = control.ss(control.tf([20], [1, 3, 20]))
    there = hold_and_delay(G, 0.01, delay)
    low, high = 0.01, 100.0
    while high - low > 1e-13 * high:
        k = (low + high) / 2
        loop = there.A - there.B @ there.C * k
        low, high = (k, high) if np.abs(np.linalg.eigvals(loop)).max() < 1 else (low, k)
    for factor, true in ((1 - 1e-9, True), (1 + 1e-9, False)):
        K = control.ss([], [], [], [[low * factor]], 0.01)
        found = decide_loop_stability(to_matrices(G), to_matrices(K), delay=delay)
        assert found.holds == true
        assert found.outcome != "undecided"


def test_delays_of_continuous_loops():
    """1/s behind pi/2: no double is the limit, its two neighbours lie on either side."""
    G, K = control.ss([[0.0]], [[1.0]], [[1.0]], [[0.0]]), control.ss([], [], [], [[1.0]])
    verdicts = [
        decide_loop_stability(to_matrices(G), to_matrices(K), delay=d).holds
        for d in (np.pi / 2, np.nextafter(np.pi / 2, 2))
    ]
    assert verdicts == [True, False]


def test_matrices():
    assert decide_matrix_stability(np.zeros((0, 0))).holds
    assert not decide_matrix_stability(np.eye(3), discrete=True).holds
    assert decide_matrix_stability(np.eye(3), discrete=True).violated
    assert decide_matrix_stability(
        np.diag([np.nextafter(1, 0), -np.nextafter(1, 0)]), discrete=True
    ).holds
    jordan = -1e-8 * np.eye(12) + np.diag(np.full(11, 1e3), 1)
    assert decide_matrix_stability(jordan).holds
    assert (
        np.linalg.eigvals(jordan + 1e-13 * np.ones((12, 12))).real.max() > 1
    )  # what rounding can make of it
