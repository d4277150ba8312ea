"""What floating point cannot tell, `check` decides: poles on the boundary and beside it,
ill-conditioned loops.
"""

import control
import numpy as np
import pytest

from robust import UncertaintyModel, check, performance_weight
from tests.support.exact_claims import decided
from tests.support.hard_loops import boundary_gain, hard_loop, margin, with_gain

LINES = np.array([1.0, 2.0])


def model_of(G, size):
    return UncertaintyModel(
        G, size, "multiplicative", LINES, 0.1 * size * np.ones(2), perturbation="LTI"
    )


def test_an_ill_conditioned_loop_beside_the_boundary():
    """Of 15 to 17 states, 1e-7 of the gain to either side: right each time, against 450 digits, and
    proved.
    """
    rng, edges = np.random.default_rng(8), None
    while edges is None:
        G, K = hard_loop(rng, most=17)
        edges = boundary_gain(G, K, lambda G, K: decided(G, K) is True)
    for factor in (1 - 1e-7, 1 + 1e-7):
        beside = with_gain(K, edges[0] * factor)
        report = check(model_of(G, 1e-10), beside)
        stable = float(margin(G, beside)) < 0
        assert report.nominally_stable == stable
        assert report.verdict == ("robust" if stable else "not robust"), report.reason


@pytest.mark.parametrize("dt", [0.0, 0.1])
def test_a_pole_on_the_boundary_is_not_stable_and_its_neighbour_is(dt):
    """1/(s + 1) under -1, and z - 1/2 under 1/2: by one unit in the last place."""
    G = (
        control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]])
        if not dt
        else control.ss([[0.5]], [[1]], [[1]], [[0]], dt)
    )
    limit = -1.0 if not dt else -0.5
    found = check(model_of(G, 1e-17), limit)
    assert (found.nominally_stable, found.verdict) == (False, "not robust")
    assert "on the stability boundary or beyond it" in found.reason
    beside = check(model_of(G, 1e-17), np.nextafter(limit, 0))
    assert (beside.nominally_stable, beside.verdict) == (True, "robust")


def test_a_peak_that_floating_point_leaves_open_is_decided():
    """|w T| reaches w at zero frequency under an integrator: 1 - 1e-10 is below one, 1 is not."""
    G, K = control.ss(control.tf([1], [1, 1])), control.tf([1, 1], [1, 0])
    below = check(model_of(G, 1 - 1e-10), K)
    assert below.verdict == "robust"
    assert below.proofs.certificates[0].method == "exact arithmetic"
    assert "exact arithmetic, proved, rigorous" in " ".join(str(below).split())
    assert check(model_of(G, 1.0), K).verdict == "not robust"


@pytest.mark.parametrize("delay", [0.0, 0.02])
@pytest.mark.parametrize("dt", [0.0, 0.05])
@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_the_one_scaling_of_an_operator_is_found_in_any_units(unit, dt, delay):
    """The best scaling goes as the unit of the plant; |w T| and |w_P S| are what they are in every
    unit.
    """
    G, K = control.ss(control.tf([unit], [1, 1])), control.ss([], [], [], [[2 / unit]], dt)
    w, w_P = control.tf([0.3], [0.05, 1]), performance_weight(0.1, M_S=3, A=0.6)
    model = UncertaintyModel(
        G, w, "multiplicative", np.array([1.0]), np.array([0.1]), perturbation="operator"
    )
    report = check(model, K, w_P=w_P, delay=delay)
    assert [certificate.method for certificate in report.proofs.certificates] == [
        "exact arithmetic"
    ] * 2
    assert report.proofs.certificates[1].verify().verified
    assert report.proofs.robust_performance
    assert not check(model, K, w_P=w_P * 3, delay=delay).proofs.robust_performance


def test_performance_that_is_missed_on_the_grid_is_not_looked_for_with_aliases():
    w, K = control.tf([0.3], [0.05, 1]), control.ss([], [], [], [[2.0]], 0.05)
    model = UncertaintyModel(
        control.tf([1], [1, 1]), w, "additive", np.array([1.0]), np.array([0.1]), perturbation="LTI"
    )
    stability, performance = check(model, K, w_P=control.tf([2.0], [1])).proofs.certificates
    assert stability.holds
    assert not performance.holds
    assert not performance.violated
    assert "rp reaches" in performance.reason
