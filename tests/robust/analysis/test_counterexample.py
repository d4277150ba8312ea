"""A loop that the distortion disc calls stable and that limit-cycles: the check must never call it
"robust".

v = sat(u, +-0.6745), y = H v, H = z^-5 0.8/(1 - 0.2 z^-1), u = r - 1.06 y. A disc of two standard
deviations of one realisation passes the small-gain test; the loop leaves its equilibrium for a
limit cycle. The gain of the operator, sup |sat(u) - g u|/|g u| = 1, does not pass.
"""

import control
import numpy as np
import pytest

from nlfrf import identify, multisine, record_from_samples
from robust import UncertaintyModel, check, fit_nominal, fit_weight, uncertainty
from tests.support.responses import response

LIMIT, K = 0.6745, 1.06
GAIN = 0.5  # Bussgang: P(|u| < 0.6745) for a normal u
H = control.ss(control.tf([0.8], [1, -0.2, 0, 0, 0, 0], 1.0))


def plant(u):
    """y from u, from rest."""
    v = np.concatenate([np.zeros(5), np.clip(u, -LIMIT, LIMIT)])
    y = np.zeros(u.size)
    last = 0.0
    for k in range(u.size):
        last = 0.2 * last + 0.8 * v[k]
        y[k] = last
    return y


def closed_loop(noise):
    """y of the loop with noise at the reference."""
    n = noise.size
    y, v, last = np.zeros(n), np.zeros(n + 5), 0.0
    for k in range(n):
        last = 0.2 * last + 0.8 * v[k]
        y[k] = last
        v[k + 5] = np.clip(noise[k] - K * last, -LIMIT, LIMIT)
    return y


def measured(kind, n_realizations, seed):
    ms = multisine(
        kind,
        fs=1.0,
        n_samples=4096,
        f_min=1 / 4096,
        f_max=0.45,
        n_realizations=n_realizations,
        rng=seed,
    )
    rows = ms.u
    streams = [np.tile(u, 3) for u in rows]
    record = record_from_samples(
        streams if n_realizations > 1 else streams[0],
        [plant(u) for u in streams] if n_realizations > 1 else plant(streams[0]),
        fs=1.0,
        n_samples=4096,
        lines=ms.lines,
        n_discard=1,
    )
    return identify(record)


def model_of(radius, perturbation):
    """The Bussgang gain times H, with a constant relative radius."""
    nominal = control.StateSpace(H.A, H.B, H.C * GAIN, H.D, 1.0)
    weight = control.StateSpace([], [], [], [[radius]], 1.0)
    omega = np.linspace(0.01, 3.0, 50)
    return UncertaintyModel(
        nominal, weight, "multiplicative", omega, np.full(50, radius), 0.95, perturbation
    )


def test_the_loop_limit_cycles():
    y = closed_loop(1e-3 * np.random.default_rng(0).normal(size=6000))
    assert np.std(y[4000:]) == pytest.approx(0.47, abs=0.02)


def test_numbers_of_the_disc_and_of_the_operator():
    # two standard deviations of one realisation: 2 x 0.440 x 1.014
    report = check(model_of(2 * 0.440, "statistical"), K)
    assert np.max(report.curves.rs) == pytest.approx(0.891, abs=0.002)
    assert report.proofs.robustly_stable
    assert report.verdict == "statistically robust"
    assert "nonlinear plant itself" in report.not_proved
    gain = check(model_of(1.0, "operator"), K)
    assert np.max(gain.curves.rs) == pytest.approx(1.014, abs=0.002)
    assert gain.verdict == "not robust"


def test_operator_gain_is_one():
    u = np.linspace(1e-3, 1000, 100_000)
    assert np.max(np.abs(np.clip(u, -LIMIT, LIMIT) - GAIN * u) / (GAIN * u)) == pytest.approx(
        1.0, abs=0.01
    )


def test_spread_of_one_realisation_and_of_the_mean():
    """On all lines one realisation scatters by 0.44 of the gain, the mean of eight by a third of
    that.
    """
    bla = measured("odd", 8, seed=1)
    relative = np.sqrt(np.median(bla.var_distortion / np.abs(bla.G) ** 2))
    assert relative == pytest.approx(0.442, abs=0.04)
    assert np.sqrt(np.median(bla.var_total / np.abs(bla.G) ** 2)) == pytest.approx(
        0.442 / np.sqrt(8), abs=0.02
    )
    fit = fit_nominal(bla, n_poles=1, n_zeros=0, dt=1.0, delay=4.0)
    model = uncertainty(bla, fit, order=2)
    # sqrt(F_0.95(2, 14)) = 1.93 times the spread of one; from the spread of the mean it would be
    # 0.3
    assert np.median(model.radius) > 1.73 * 0.44


@pytest.mark.parametrize(
    ("kind", "n_realizations"), [("special-odd", 1), ("random-odd", 1), ("special-odd", 4)]
)
def test_from_record_to_verdict_it_is_never_called_robust(kind, n_realizations):
    bla = measured(kind, n_realizations, seed=3)
    gains = np.abs(bla.G) / np.abs(response(H, bla.omega))
    assert np.median(gains) == pytest.approx(GAIN, abs=0.04)
    fit = fit_nominal(bla, n_poles=1, n_zeros=0, dt=1.0, delay=4.0)
    assert fit.G.poles()[0].real == pytest.approx(0.2, abs=0.1)
    for simultaneous in (False, True):
        model = uncertainty(bla, fit, order=2, simultaneous=simultaneous)
        assert model.perturbation == "statistical"
        for controller in (K, 0.5 * K, 0.1):
            report = check(model, controller)
            assert report.verdict in ("statistically robust", "not robust", "not certified")
            if report.verdict == "statistically robust":
                assert "no theorem applies" in report.not_proved


def test_weight_over_the_operator_gain_at_a_smaller_gain_is_robust():
    """The same set is certified where the gain is low enough: the check can also say yes."""
    model = model_of(1.0, "operator")
    report = check(model, 0.9)
    assert report.verdict == "robust"
    assert fit_weight(model.omega, model.radius, order=1, dt=1.0).mean_excess_db < 0.01
