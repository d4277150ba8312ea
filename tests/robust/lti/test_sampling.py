"""Hold, delay, discretisation, Riccati equations: the matrix exponential, closed forms, SciPy."""

from dataclasses import replace
from math import factorial

import control
import numpy as np
import pytest
from scipy.linalg import expm, solve_continuous_are

from robust import check, fit_nominal, sampled
from robust.lti import discretize
from robust.lti.norms import stabilising_riccati
from tests.support.responses import response
from tests.support.sets import set_around

PLANT = control.StateSpace([[0, 1], [-400, -2]], [[0], [400]], [[1, 0]], [[0]], 0)


@pytest.mark.parametrize("delay", [0.0, 0.004, 0.01, 0.0273])
def test_the_step_response_at_the_samples(delay):
    """A step held through the delay: at t = n T the sampled plant gives what the continuous one has
    then.
    """
    dt = 0.01
    G = sampled(PLANT, dt, delay)
    x, out = np.zeros((G.nstates, 1)), []
    for _ in range(60):
        out.append(float((G.C @ x + G.D)[0, 0]))
        x = G.A @ x + G.B
    t = np.arange(60) * dt - delay
    still = np.linalg.solve(PLANT.A, PLANT.B)
    wanted = [
        float((PLANT.C @ (expm(PLANT.A * s) - np.eye(2)) @ still)[0, 0]) if s > 0 else 0.0
        for s in t
    ]
    assert out == pytest.approx(wanted, abs=1e-9)


def test_hold_seen_in_the_frequency_response():
    """G_d(e^{j w T}) = sum over aliases of G(j w_k) (1 - e^{-j w T})/(j w_k T)."""
    dt, omega = 0.01, np.array([5.0, 20.0, 150.0, 310.0])
    k = np.arange(-4000, 4001)
    alias = omega[:, None] + 2 * np.pi * k / dt
    hold = (1 - np.exp(-1j * omega[:, None] * dt)) / (1j * alias * dt)
    wanted = np.sum(response(PLANT, alias.ravel()).reshape(alias.shape) * hold, axis=1)
    assert response(sampled(PLANT, dt), omega) == pytest.approx(wanted, rel=1e-6)


def fit_of(G, delay):
    """A fit of one channel with this plant and this delay."""
    omega = np.linspace(1, 10, 20)
    fit = fit_nominal(control.FrequencyResponseData(1 / (1j * omega + 3), omega), n_poles=1)
    return replace(fit, G=G, delay=delay)


@pytest.mark.parametrize("delay", [0.5, 3e-4])
def test_a_delay_of_a_continuous_plant_is_the_approximation_of_pade(delay):
    """Of equal degrees n: sum (2n-k)!/(k! (n-k)!) (-s delay)^k over the same of s delay."""
    nominal = set_around(fit_of(PLANT, delay)).nominal
    n = nominal.nstates - 2
    omega = np.geomspace(0.1, 30, 40) / delay
    coefficients = [factorial(2 * n - k) / (factorial(k) * factorial(n - k)) for k in range(n + 1)]
    num, den = (
        np.polynomial.Polynomial(coefficients)(sign * 1j * omega * delay) for sign in (-1, 1)
    )
    assert n >= 3
    assert response(nominal, omega) == pytest.approx(response(PLANT, omega) * num / den, rel=1e-9)


def test_a_delay_of_a_discrete_plant_is_whole_samples():
    discrete = sampled(PLANT, 0.01)
    omega = np.array([0.1, 1.0, 3.0, 300.0])
    late = set_around(fit_of(discrete, 0.03)).nominal
    assert response(late, omega) == pytest.approx(
        response(discrete, omega) * np.exp(-0.03j * omega), rel=1e-9
    )
    with pytest.raises(ValueError, match=r"delay must be a whole number of samples of 0\.01 s"):
        check(set_around(discrete), 0.1, delay=0.015)


def test_tustin_is_exact_where_it_is_prewarped():
    K = control.ss(control.tf([1, 10], [1, 0]))
    for prewarp in (0.0, 40.0):
        Kd = discretize(K, 0.01, prewarp=prewarp)
        z = np.exp(0.4j)
        s = 2 / 0.01 * (z - 1) / (z + 1) if not prewarp else 40 / np.tan(0.2) * (z - 1) / (z + 1)
        assert response(Kd, np.array([40.0]))[0] == pytest.approx((s + 10) / s, rel=1e-9)
    assert response(discretize(K, 0.01, prewarp=40.0), np.array([40.0]))[0] == pytest.approx(
        (40j + 10) / 40j, rel=1e-9
    )


def test_riccati_equations():
    rng = np.random.default_rng(1)
    for n in (1, 3, 8):
        A = rng.standard_normal((n, n))
        B = rng.standard_normal((n, 2))
        C = rng.standard_normal((2, n))
        R, S = np.eye(2), np.zeros((n, 2))
        X = stabilising_riccati(A, B, Q=C.T @ C, R=R, S=S)
        assert pytest.approx(solve_continuous_are(A, B, C.T @ C, R), rel=1e-7, abs=1e-9) == X
        assert np.linalg.eigvals(A - B @ B.T @ X).real.max() < 0
    # x' = a x + u: X = a + sqrt(a^2 + q)
    X = stabilising_riccati(
        np.array([[2.0]]),
        np.ones((1, 1)),
        Q=np.array([[5.0]]),
        R=np.ones((1, 1)),
        S=np.zeros((1, 1)),
    )
    assert pytest.approx(5.0) == X
    assert (
        stabilising_riccati(
            np.array([[1.0]]), np.zeros((1, 1)), Q=np.eye(1), R=np.eye(1), S=np.zeros((1, 1))
        )
        is None
    )


@pytest.mark.parametrize("delay", [0.0, 0.4e-3])
def test_a_sum_of_modes_in_companion_form_is_sampled(delay):
    """Its matrix has entries of 1e40: each mode by itself, in two states, is the reference."""
    omega, zeta, dt = 2 * np.pi * np.geomspace(35, 300, 8), 0.01, 1e-3
    s = control.tf("s")
    modes = [1 / (s**2 + 2 * zeta * w * s + w**2) for w in omega]
    whole = control.ss(sum(modes))
    assert np.abs(whole.A).max() > 1e40
    z = np.exp(1j * np.linspace(0.01, 3.1, 40))
    each = [sampled(control.ss(mode), dt, delay)(z) for mode in modes]
    np.testing.assert_allclose(sampled(whole, dt, delay)(z), sum(each), rtol=1e-6)


@pytest.mark.parametrize("delay", [0.0, 0.3])
def test_a_pole_beyond_floating_point_is_refused(delay):
    with pytest.raises(
        ValueError,
        match=r"dt must be so short that exp\(A dt\) stays finite, got 1 s with a pole at 1e\+06",
    ):
        sampled(control.tf([1], [1, -1e6]), 1.0, delay)
