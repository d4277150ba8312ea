"""One loop before both judges: alone with closed forms in exact arithmetic, and twice side by side
with bounds of mu, which for two equal loops under one full block are the numbers of one.
"""

import control
import numpy as np
import pytest

from robust import UncertaintyModel, check, sampled
from tests.support.forms import UNSCALED
from tests.support.responses import response

T, OMEGA = 1e-2, np.geomspace(0.1, 100, 20)
LAG = control.ss(control.tf([2.0], [0.3, 1]))
RISING = control.ss(control.tf([0.3, 0.2], [0.1, 1]))
W_P = control.ss(control.tf([0.4, 0.1], [1, 1e-3]))
#: Form of one channel -> the same of several.
SEVERAL = {
    "multiplicative": "input",
    "additive": "additive",
    "inverse-multiplicative": "inverse-input",
    "inverse-additive": "inverse-additive",
}


def judged(form, gain, *, size=1.0, dt=0.0, perturbation="LTI", w_P=None):
    """A lag with a rising weight under an integrating controller, continuous or sampled throughout:
    the reports on one, and on two of them.
    """
    G, w = (sampled(LAG, dt), control.StateSpace(*small(RISING), dt)) if dt else (LAG, RISING)
    w = control.StateSpace(w.A, w.B, size * w.C, size * w.D, dt)
    K = control.ss(control.tf([gain, gain], [1, 0]))
    K = control.c2d(K, dt, "tustin") if dt else K
    radius, options = np.abs(response(w, OMEGA)), {"perturbation": perturbation}
    one = UncertaintyModel(G, w, form, OMEGA, radius, **options)
    unit = control.ss([], [], [], [[1.0]], dt)
    two = UncertaintyModel(
        control.append(G, G),
        form=SEVERAL[form],
        left=(w, w),
        right=(unit, unit),
        omega=OMEGA,
        radius=np.array([radius, radius, 0 * OMEGA + 1, 0 * OMEGA + 1]),
        **options,
    )
    return check(one, K, w_P=w_P), check(two, control.append(K, K), w_P=w_P)


def small(w):
    """The matrices of a sampled weight like a continuous one: its bilinear image."""
    found = control.c2d(w, T, "tustin")
    return found.A, found.B, found.C, found.D


@pytest.mark.attack(every=4)
@pytest.mark.parametrize("form", UNSCALED)
@pytest.mark.parametrize("dt", [0.0, T])
def test_both_judges_find_the_same(form, dt):
    """Mu of one full block is the size of what it sees: verdicts, margins, worst cases and curves
    must agree.
    """
    verdicts = set()
    for gain, size in ((0.05, 1.0), (0.5, 0.2), (3.0, 1.0), (60.0, 0.2), (400.0, 0.2)):
        exact, by_mu = judged(form, gain, size=size, dt=dt)
        assert (exact.verdict, exact.nominally_stable) == (by_mu.verdict, by_mu.nominally_stable), (
            gain
        )
        assert exact.proofs.robustly_stable == by_mu.proofs.robustly_stable
        if exact.nominally_stable:
            assert by_mu.margins.rs == pytest.approx(exact.margins.rs, rel=1e-3)
            assert by_mu.margins.broken == pytest.approx(exact.margins.rs, rel=1e-2)
            seen = np.interp(by_mu.curves.omega[1:], exact.curves.omega, exact.curves.rs)
            inside = (by_mu.curves.omega[1:] > exact.curves.omega[0]) & (
                by_mu.curves.omega[1:] < exact.curves.omega[-1]
            )
            np.testing.assert_allclose(by_mu.curves.rs[1:][inside], seen[inside], rtol=2e-2)
        if exact.proofs.robustly_stable:
            assert by_mu.margins.S_worst_lines == 0
            S = exact.margins.S_worst
            assert S * (1 - 1e-6) <= by_mu.margins.S_worst <= S * 1.002
        verdicts.add(exact.verdict)
    assert {"robust", "not robust"} <= verdicts


@pytest.mark.parametrize("perturbation", ["LTI", "statistical", "operator"])
def test_both_judges_agree_on_performance(perturbation):
    """The demand is met in both readings: mu of two blocks below one, and |w_P| max |S_p| below
    one.
    """
    for gain, met in ((0.2, True), (0.6, False), (0.02, False)):
        exact, by_mu = judged("multiplicative", gain, perturbation=perturbation, w_P=W_P)
        assert exact.verdict == by_mu.verdict
        assert exact.proofs.robust_performance == by_mu.proofs.robust_performance == met
        assert (np.nanmax(exact.curves.rp) < 1) == (by_mu.margins.rp > 1) == met


@pytest.mark.parametrize(
    ("dt", "delay", "reason"),
    [
        (0, 0.01, "the delay of a continuous loop"),
        (T, 0.0, "no inequality covers the aliases"),
    ],
)
def test_a_loop_that_is_no_state_space_is_proved_by_no_inequality(dt, delay, reason):
    model = UncertaintyModel(
        LAG, RISING, "multiplicative", OMEGA, np.abs(response(RISING, OMEGA)), perturbation="LTI"
    )
    K = control.ss([], [], [], [[0.5]], dt)
    report = check(model, K, delay=delay, proof="lmi")
    assert not report.proofs.robustly_stable
    assert any(one.reason.startswith(reason) for one in report.proofs.certificates)
