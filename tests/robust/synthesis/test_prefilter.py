"""Prefilters: exact where a closed form exists, bounded from below, and what the set makes of them
by brute force.
"""

import control
import numpy as np
import pytest

from robust import UncertaintyModel, check
from robust.lti import discretize
from robust.synthesis import prefilter
from tests.support.responses import response

LAG, W = control.tf([1], [1, 1]), control.tf([0.3, 0.1], [0.1, 1])
PI = control.tf([2, 2], [1, 0])  # T = 2/(s + 2)
OMEGA = np.geomspace(1e-2, 1e2, 40)


def model(form="multiplicative", G=LAG, w=W):
    radius = 0.99 * np.abs(response(control.ss(w), OMEGA))
    return UncertaintyModel(G, w, form, OMEGA, radius, perturbation="LTI")


@pytest.mark.parametrize(
    "reference",
    [control.tf([1], [1, 1]), control.tf([0.25], [1, 0.7, 0.25]), control.tf([6], [1, 6])],
)
def test_a_minimum_phase_loop_follows_what_it_is_asked(reference):
    """F = T_ref / T is the answer where effort costs nothing: the error is what effort and left-out
    states leave.
    """
    found = prefilter(model(), PI, reference, effort=1e-3)
    assert found.gamma_min <= found.gamma
    assert found.error.max() < 0.03
    assert response(found.F, np.zeros(1))[0] == pytest.approx(1.0, rel=1e-6)
    assert np.all(np.linalg.eigvals(found.F.A).real < 0)
    T = response(control.ss(control.tf([2], [1, 2])), found.omega)
    direct = np.abs(
        response(control.ss(reference), found.omega) - T * response(found.F, found.omega)
    )
    np.testing.assert_allclose(found.error, direct, atol=1e-9)


def test_no_prefilter_beats_the_bound_of_a_zero_on_the_right():
    """T(1) = 0 at a zero of the plant:

    |T_ref - T F| >= |T_ref(1)| somewhere, and gamma_min knows it.
    """
    G, T_ref = control.tf([-1, 1], [1, 3, 2]), control.tf([3], [1, 3])
    found = prefilter(model(G=G, w=control.tf([0.05], [1])), control.tf([0.5], [1, 0]), T_ref)
    assert found.gamma_min >= abs(T_ref(1.0)) * 0.999
    assert found.error.max() >= abs(T_ref(1.0)) * 0.99


@pytest.mark.parametrize(
    "form", ["multiplicative", "additive", "inverse-multiplicative", "inverse-additive"]
)
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
    np.testing.assert_allclose(
        found.error_worst[:: max(1, found.omega.size // 40)], worst, rtol=1e-3
    )


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
        (lambda: prefilter(model(), -5.0, control.tf([1], [1, 1])), "K must stabilise the plant"),
        (lambda: prefilter(model(), PI, control.tf([1], [1, -1])), "reference must be stable"),
        (lambda: prefilter(LAG, PI, control.tf([1], [1, 1])), "model must be an UncertaintyModel"),
        (
            lambda: prefilter(model(), PI, control.tf([1], [1, 1]), effort=0),
            "effort must be positive",
        ),
    ],
)
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def two_equal_channels(weight=0.2):
    """The plant LAG twice, with an additive full block, and what it is for one channel."""
    w = control.ss([], [], [], [[weight]])
    one = control.ss([], [], [], [[1.0]])
    radius = np.concatenate(
        [np.full((2, OMEGA.size), 0.99 * weight), np.full((2, OMEGA.size), 0.99)]
    )
    matrix = UncertaintyModel(
        control.append(control.ss(LAG), control.ss(LAG)),
        form="additive",
        omega=OMEGA,
        radius=radius,
        left=(w, w),
        right=(one, one),
        perturbation="LTI",
    )
    return matrix, UncertaintyModel(LAG, weight, "additive", OMEGA, radius[0], perturbation="LTI")


def test_two_equal_channels_have_the_errors_of_one():
    """Of equal channels T_p F is a Moebius function of Delta, whose norm is that over a disc (von
    Neumann).
    """
    several, one = two_equal_channels()
    K, T_ref = control.append(control.ss(PI), control.ss(PI)), control.tf([1], [1, 1])
    found = prefilter(several, K, T_ref)
    assert (found.F.ninputs, found.F.noutputs) == (2, 2)
    np.testing.assert_allclose(found.F.dcgain(), np.eye(2), atol=1e-6)
    alone = prefilter(one, PI, T_ref)
    assert found.gamma == pytest.approx(alone.gamma, rel=0.02)
    f, omega = found.F, found.omega
    T = response(control.ss(control.tf([2], [1, 2])), omega)
    S = response(control.ss(control.tf([1, 0], [1, 2])), omega)
    wanted, f = response(control.ss(T_ref), omega), f(1j * omega)[0, 0]
    b = 0.2 * np.abs(response(control.ss(PI), omega) * S)
    turns = np.exp(2j * np.pi * np.arange(720) / 720)[:, None]
    K_S = response(control.ss(PI), omega) * S  # T_p = (T + K S w Delta)/(1 + K S w Delta)
    errors = np.abs(wanted - (T + 0.2 * turns * K_S) / (1 + 0.2 * turns * K_S) * f).max(axis=0)
    assert b.max() < 1
    np.testing.assert_allclose(found.error, np.abs(wanted - T * f), atol=1e-3)
    np.testing.assert_allclose(found.error_worst, errors, rtol=5e-3, atol=2e-3)


@pytest.mark.parametrize("at_samples", [False, pytest.param(True, marks=pytest.mark.attack)])
def test_no_plant_of_a_set_of_several_channels_misses_by_more_than_was_said(at_samples):
    """Element by element: 30 plants of the set against the bound; a sampled K has a prefilter of
    its sampling time.
    """
    rng = np.random.default_rng(3)
    G = control.ss(
        [[-1.0, 0.3], [0.0, -2.0]], np.eye(2), [[1.0, 0.2], [0.5, 1.0]], np.zeros((2, 2))
    )
    w = control.tf([0.05], [0.001, 1])
    radius = np.full((4, OMEGA.size), 0.049)
    made = UncertaintyModel(
        G, form="elements", omega=OMEGA, radius=radius, right=(w,) * 4, perturbation="LTI"
    )
    K = control.append(control.ss(PI), control.ss(PI))
    T_ref = control.ss(np.diag([-1.0, -0.5]), np.eye(2), np.diag([1.0, 0.5]), np.zeros((2, 2)))
    found = prefilter(made, K, T_ref)
    wanted, f, k = (np.moveaxis(each(1j * found.omega), 2, 0) for each in (T_ref, found.F, K))
    for plant in made.sample(30, rng):
        L = np.moveaxis(plant(1j * found.omega), 2, 0) @ k
        error = wanted - np.linalg.solve(np.eye(2) + L, L) @ f
        assert np.all(np.linalg.norm(error, 2, axis=(1, 2)) <= found.error_worst * (1 + 1e-9))
    assert np.all(found.error <= found.error_worst)
    if at_samples:
        sampled = prefilter(made, discretize(K, 1e-3), T_ref)
        assert sampled.F.dt == 1e-3
        slow = found.omega < 10
        at = np.interp(found.omega[slow], sampled.omega, sampled.error_worst)
        np.testing.assert_allclose(at, found.error_worst[slow], rtol=0.1, atol=0.01)
    with pytest.raises(ValueError, match="reference must have 2 outputs, as the plant has, got 1"):
        prefilter(made, K, T_ref[:1, :])
    with pytest.raises(ValueError, match="reference must be stable"):
        prefilter(made, K, control.tf([1], [1, -1]))
