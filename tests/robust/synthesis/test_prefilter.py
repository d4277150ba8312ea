"""Prefilters: exact where a closed form exists, bounded from below, and what the set makes of them by brute force."""

import control
import numpy as np
import pytest

from robust import UncertaintyModel, check, prefilter
from robust.lti.lti import response

LAG, W = control.tf([1], [1, 1]), control.tf([0.3, 0.1], [0.1, 1])
PI = control.tf([2, 2], [1, 0])  # T = 2/(s + 2)
OMEGA = np.geomspace(1e-2, 1e2, 40)


def model(form="multiplicative", G=LAG, w=W):
    radius = 0.99 * np.abs(response(control.ss(w), OMEGA))
    return UncertaintyModel(G, w, form, OMEGA, radius, perturbation="LTI")


@pytest.mark.parametrize(
    "reference", [control.tf([1], [1, 1]), control.tf([0.25], [1, 0.7, 0.25]), control.tf([6], [1, 6])]
)
def test_a_minimum_phase_loop_follows_what_it_is_asked(reference):
    """F = T_ref / T is the answer where effort costs nothing: the error is what effort and left-out states leave."""
    found = prefilter(model(), PI, reference, effort=1e-3)
    assert found.gamma_min <= found.gamma
    assert found.error.max() < 0.03
    assert response(found.F, np.zeros(1))[0] == pytest.approx(1.0, rel=1e-6)
    assert np.all(np.linalg.eigvals(found.F.A).real < 0)
    T = response(control.ss(control.tf([2], [1, 2])), found.omega)
    direct = np.abs(response(control.ss(reference), found.omega) - T * response(found.F, found.omega))
    np.testing.assert_allclose(found.error, direct, atol=1e-9)


def test_no_prefilter_beats_the_bound_of_a_zero_on_the_right():
    """T(1) = 0 at a zero of the plant: |T_ref - T F| >= |T_ref(1)| somewhere, and gamma_min knows it."""
    G, T_ref = control.tf([-1, 1], [1, 3, 2]), control.tf([3], [1, 3])
    found = prefilter(model(G=G, w=control.tf([0.05], [1])), control.tf([0.5], [1, 0]), T_ref)
    assert found.gamma_min >= abs(T_ref(1.0)) * 0.999
    assert found.error.max() >= abs(T_ref(1.0)) * 0.99


@pytest.mark.parametrize("form", ["multiplicative", "additive", "inverse-multiplicative", "inverse-additive"])
def test_the_worst_error_is_that_of_the_set(form):
    """Brute force over the edge of the disc of every frequency."""
    small = control.tf([0.02, 0.04], [0.1, 1])
    made = model(form, w=small)
    found = prefilter(made, PI, control.tf([1], [1, 1]))
    at = found.omega[:: max(1, found.omega.size // 40)]
    g, k, w = (response(control.ss(each), at) for each in (LAG, PI, small))
    f, wanted = response(found.F, at), response(control.ss(control.tf([1], [1, 1])), at)
    delta = np.exp(2j * np.pi * np.arange(360) / 360)[:, None]
    plant = {
        "multiplicative": g * (1 + w * delta),
        "additive": g + w * delta,
        "inverse-multiplicative": g / (1 + w * delta),
        "inverse-additive": g / (1 + w * g * delta),
    }[form]
    worst = np.abs(wanted - plant * k / (1 + plant * k) * f).max(axis=0)
    np.testing.assert_allclose(found.error_worst[:: max(1, found.omega.size // 40)], worst, rtol=1e-3)


def test_sampled_and_outside_of_the_loop():
    K = control.ss(control.tf([2.02, -1.98], [1, -1], 0.02))
    found = prefilter(model(), K, control.tf([1], [1, 1]), delay=0.005)
    assert found.F.dt == 0.02
    assert np.all(np.abs(np.linalg.eigvals(found.F.A)) < 1)
    assert found.error.max() < 0.1
    assert check(model(), K, delay=0.005).verdict == "robust"  # whatever F is


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: prefilter(model(), -5.0, control.tf([1], [1, 1])), "K must make a stable loop"),
        (lambda: prefilter(model(), PI, control.tf([1], [1, -1])), "reference must be stable"),
        (lambda: prefilter(LAG, PI, control.tf([1], [1, 1])), "model must be an UncertaintyModel"),
        (lambda: prefilter(model(), PI, control.tf([1], [1, 1]), effort=0), "effort must be positive"),
    ],
)
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()
