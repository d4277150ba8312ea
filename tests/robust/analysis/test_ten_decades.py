"""Margins of plants with modes over ten decades and in poor coordinates, held against the loop in
100 digits.
"""

import warnings

import control
import numpy as np
import pytest
from flint import arb, ctx

from robust import UncertaintyModel, check, ncfsyn
from tests.support.precise_loops import BITS, PreciseLoop, unstable_poles
from tests.support.sets import from_roots, set_around

FORMS = ("multiplicative", "additive", "inverse-multiplicative", "inverse-additive")


def mode(w, zeta):
    s = w * (-zeta + 1j * np.sqrt(1 - zeta**2))
    return [s, s.conjugate()]


def roots(rng):
    """Zeros and poles over ten decades, some modes damped by 1e-9 only."""
    poles, zeros = [], []
    for _ in range(int(rng.integers(2, 6))):
        w = 10 ** rng.uniform(-5, 5)
        poles += mode(w, 10 ** rng.uniform(-9, -1)) if rng.random() < 0.6 else [-w]
    for _ in range(int(rng.integers(0, len(poles))) // 2):
        w = 10 ** rng.uniform(-5, 5)
        zeros += mode(w, 10 ** rng.uniform(-3, -0.3))
    if len(zeros) > len(poles) - 1:
        zeros = zeros[: 2 * ((len(poles) - 1) // 2)]
    return np.array(zeros, complex), np.array(poles, complex)


def in_coordinates(G, T):
    back = np.linalg.inv(T)
    return control.StateSpace(T @ G.A @ back, T @ G.B, G.C @ back, G.D, 0)


def loop_of(seed):
    """The plant, its controller, the form, and frequencies [rad/s] of its modes."""
    rng = np.random.default_rng([3, seed])
    zeros, poles = roots(rng)
    num = np.real(np.poly(zeros)) if len(zeros) else [1.0]
    companion = rng.random() < 0.5
    made = control.tf(num, np.real(np.poly(poles))) if companion else from_roots(zeros, poles, 1.0)
    G = set_around(made).nominal
    at = 10 ** rng.uniform(-4, 4)
    if rng.random() < 0.4:
        U, V = (np.linalg.qr(rng.standard_normal((G.nstates,) * 2))[0] for _ in range(2))
        G = in_coordinates(G, U @ np.diag(np.geomspace(1, 10 ** rng.uniform(2, 8), G.nstates)) @ V)
    if rng.random() < 0.3:
        G = in_coordinates(G, np.diag(10 ** rng.uniform(-6, 6, G.nstates)))
    gain = 1 / abs(complex(G(1j * at)))
    G = control.StateSpace(G.A, G.B, G.C * gain, G.D * gain, 0)
    K = (
        ncfsyn(G, 10 ** rng.uniform(-1, 1)).K
        if rng.random() < 0.5
        else control.ss([], [], [], [[10 ** rng.uniform(-3, 1)]])
    )
    places = np.concatenate([zeros, poles, control.feedback(G * K, 1).poles()])
    return (
        G,
        K,
        FORMS[int(rng.integers(4))],
        at,
        np.unique(np.concatenate([np.abs(places), np.abs(places.imag)])),
    )


@pytest.mark.parametrize("seed", [96, 437, 682])
def test_the_margin_is_that_of_the_plant_as_it_is_given(seed):
    """In doubles the response of these is another one: margins of 3.44 for 0.94, 3.33 for 3.03,
    3.44 for 3.40.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # python-control warns of its own poles
        G, K, form, at, places = loop_of(seed)
    w = control.ss([], [], [], [[0.3]])
    lines = np.geomspace(at / 100, at * 100, 20)
    model = UncertaintyModel(G, w, form, lines, np.full(20, 0.3), perturbation="LTI")
    report = check(model, K, certify=False)
    if (
        not report.nominally_stable
    ):  # the design is by floating point, and another one on another machine
        assert unstable_poles(G, K)
        assert np.isnan(report.margins.rs)
        return
    loop = PreciseLoop(G, K, w, form)

    def rs(omega):
        return float(loop.values(float(omega))[0].mid())

    assert 1 / report.margins.rs == pytest.approx(rs(report.margins.omega_rs), rel=1e-6)
    places = places[places > 0]
    looked = np.concatenate([places, np.geomspace(places.min() / 10, places.max() * 10, 100)])
    looked = np.concatenate([looked, report.margins.omega_rs * (1 + np.linspace(-0.02, 0.02, 41))])
    assert max(map(rs, looked)) <= 1.0001 / report.margins.rs


@pytest.mark.parametrize("dt", [0, 0.1])
def test_responses_in_poor_coordinates(dt):
    """Two light modes in coordinates of condition 1e9, against 100 digits."""
    poles = np.array([*mode(1.0, 1e-4), *mode(20.0, 1e-5)])
    poles = np.exp(poles * dt) if dt else poles
    G = control.ss(control.tf([1.0], np.real(np.poly(poles)), dt))
    rng = np.random.default_rng(0)
    U, V = (np.linalg.qr(rng.standard_normal((4, 4)))[0] for _ in range(2))
    T = U @ np.diag(np.geomspace(1, 1e9, 4)) @ V
    poor = control.StateSpace(T @ G.A @ np.linalg.inv(T), T @ G.B, G.C @ np.linalg.inv(T), G.D, dt)
    omega = np.array([0.1, 0.9999, 1.0, 5.0, 19.0, 20.0, 30.0])
    loop = PreciseLoop(
        poor, control.ss([], [], [], [[0.0]], dt), control.ss([], [], [], [[0.0]], dt), "additive"
    )
    with ctx.workprec(BITS):
        exact = np.array([complex(loop.part("G", arb(float(w)))) for w in omega])
    model = UncertaintyModel(poor, 1.0, "additive", omega, np.ones(7), perturbation="LTI")
    curves = check(model, 1e-12, certify=False).curves
    assert curves.G[np.isin(curves.omega, omega)] == pytest.approx(exact, rel=1e-9)
