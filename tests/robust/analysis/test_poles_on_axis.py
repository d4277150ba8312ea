"""Integrators, undamped modes, resonant controllers, fast clocks: curves, margins, worst cases
against polynomials.
"""

import control
import numpy as np
import pytest

import robust
from robust import UncertaintyModel, check, sampled, worst_case
from robust.lti import discretize
from tests.support.forms import FORMS
from tests.support.responses import response

LEAD = ([0.5, 1.0], [0.05, 1.0])
LOOPS = {
    "undamped": (([1.0], [1.0, 0.0, 1.0]), LEAD),
    "undamped, faster": (([1.0], [1.0, 0.0, 4.0]), LEAD),
    "two masses": (([1.0, 0.1, 3.0], [1.0, 0.0, 4.0, 0.0, 0.0]), ([1.0, 0.4], [0.1, 1.0])),
    "resonant controller": (([1.0], [1.0, 1.0]), ([2.0, 1.0, 2.0], [1.0, 0.0, 1.0])),
    "both": (([1.0, 1.0], [1.0, 0.0, 4.0]), ([2.0, 1.0, 2.0], [1.0, 0.0, 1.0])),
}


def closed(loop, omega):
    """S, T, K S, G S as quotients of polynomials: nothing in them is infinite at a pole of G
    or K.
    """
    (n, d), (k, h) = loop
    s = 1j * omega
    n, d, k, h = (np.polyval(p, s) for p in (n, d, k, h))
    all_ = d * h + n * k
    # |[K; 1] S [1, G]|
    both = np.hypot(np.abs(d), np.abs(n)) * np.hypot(np.abs(h), np.abs(k)) / np.abs(all_)
    return {
        "NCF": both,
        "S": d * h / all_,
        "T": n * k / all_,
        "KS": k * d / all_,
        "GS": n * h / all_,
    }


CURVE = {
    "multiplicative": "T",
    "additive": "KS",
    "inverse-multiplicative": "S",
    "inverse-additive": "GS",
    "coprime": "NCF",
}


def the_model(G, form, size, dt=0.0):
    w = control.StateSpace([], [], [], [[size]], dt)
    omega = np.array([0.5, 1.0, 2.0]) if not dt else np.array([0.1, 1.0, 2.0]) * min(1.0, 1 / dt)
    return UncertaintyModel(G, w, form, omega, np.full(3, size), perturbation="LTI")


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", LOOPS)
def test_margins_are_those_of_the_closed_loop(name, form):
    loop = LOOPS[name]
    G, K = control.tf(*loop[0]), control.tf(*loop[1])
    assert np.all(control.feedback(G * K, 1).poles().real < 0)
    omega = np.unique(np.concatenate([np.geomspace(1e-4, 1e4, 200_001), [1.0, 2.0]]))
    wanted = closed(loop, omega)
    peak = np.abs(wanted[CURVE[form]]).max()
    model = the_model(G, form, 0.6 / peak)
    report = check(model, K, w_P=control.tf([0.05], [1]))
    assert report.verdict == "robust", report.reason
    assert 1 / report.margins.rs == pytest.approx(0.6, rel=1e-5)
    exact = closed(loop, report.curves.omega)
    for curve, name_ in ((report.curves.S, "S"), (report.curves.T, "T")):
        assert curve == pytest.approx(exact[name_], rel=1e-6, abs=1e-9)
    assert report.curves.rs == pytest.approx(
        0.6 / peak * np.abs(exact[CURVE[form]]), rel=1e-6, abs=1e-9
    )
    assert np.isfinite(report.curves.rp).all()
    assert report.margins.disk == pytest.approx(1 / np.abs(wanted["S"] - 0.5).max(), rel=1e-4)
    assert report.margins.disk == pytest.approx(robust.margins.disk_margin(G * K).alpha, rel=1e-3)
    too_large = check(the_model(G, form, 1.01 / peak), K)
    assert too_large.verdict == "not robust"
    worst = worst_case(model, K)
    assert worst.stable
    assert worst.achieved == pytest.approx(worst.gain.max(), rel=5e-3)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", ["undamped", "resonant controller"])
def test_the_same_with_a_clock(name, form):
    """With w = 0.03: max rs by brute force on the sampled loop, poles of both on the unit circle.

    Sampled so fast, what folds down adds less than 1e-3 here, 5e-3 of the additive set. That one
    rolls off: else it would have no bound.
    """
    loop, dt = LOOPS[name], 0.02
    G, K = control.ss(control.tf(*loop[0])), discretize(control.tf(*loop[1]), dt)
    at = np.geomspace(1e-3, np.pi / dt * 0.9999, 40_000)
    g, k = response(sampled(G, dt), at), response(K, at)
    S = 1 / (1 + g * k)
    both = np.sqrt((1 + np.abs(g) ** 2) * (1 + np.abs(k) ** 2)) * S
    curve = {"T": 1 - S, "KS": k * S, "S": S, "GS": g * S, "NCF": both}[CURVE[form]]
    model = (
        the_model(sampled(G, dt), form, 0.03, dt) if form == "coprime" else the_model(G, form, 0.03)
    )
    if form == "additive":
        roll_off = control.ss(control.tf([0.03], [0.1, 1]))
        model = UncertaintyModel(
            G, roll_off, form, model.omega, model.radius / 2, perturbation="LTI"
        )
        curve = curve / (0.1j * at + 1)
    report = check(model, K)
    assert report.verdict == "robust", report.reason
    assert 1 / report.margins.rs == pytest.approx(
        0.03 * np.abs(curve).max(), rel=1e-2 if form == "additive" else 1e-3
    )
    assert np.isfinite(report.curves.rs).all()


@pytest.mark.parametrize("dt", [1e-6, 1e-7])
def test_an_integrator_in_a_fast_clock(dt):
    """exp(j w T) rounds to one at the slow end: the integrator of K stands there, T = 1 and S
    = 0.
    """
    G = control.ss(control.tf([1.0], [1.0, 1.0]))
    K = discretize(control.tf([2.0, 1.0], [1.0, 0.0]), dt)
    report = check(the_model(G, "multiplicative", 0.03), K)
    assert report.verdict == "robust", report.reason
    assert 1 / report.margins.rs == pytest.approx(0.03, rel=1e-3)
    slow = report.curves.omega < 1e-3
    assert report.curves.T[slow] == pytest.approx(1.0, abs=2e-3)
    # S = s (s + 1)/(s^2 + 3 s + 1)
    s = 1j * report.curves.omega[slow]
    assert report.curves.S[slow] == pytest.approx(s * (s + 1) / (s * s + 3 * s + 1), rel=1e-4)
