"""Standard deviations of poles, zeros, gain and delay, and the probability of a cost, held against
Monte Carlo.
"""

from dataclasses import replace
from itertools import pairwise

import control
import numpy as np
import pytest
from scipy.stats import chi2

import nlfrf
import robust
from robust.models.fit.fit_uncertainty import estimate_uncertainty
from tests.support.printed import unwrapped
from tests.support.random_rational import random_rational

OMEGA = np.linspace(5, 120, 80)
S = 1j * OMEGA
STD = 0.02


def true(delay=0.0):
    return 2e4 * (S + 60) / ((S + 30) * (S**2 + 4 * S + 60**2)) * np.exp(-S * delay)


def noise(rng, std=STD):
    return (
        std / np.sqrt(2) * (rng.standard_normal(OMEGA.size) + 1j * rng.standard_normal(OMEGA.size))
    )


def fitted(G, **more):
    frd = control.FrequencyResponseData(G, OMEGA)
    return robust.fit_nominal(frd, n_poles=3, n_zeros=1, std=np.full(OMEGA.size, STD), **more)


def inside(fit, name, truth):
    """Which true roots lie within the 95 % ellipses of their covariances; the intervals of real
    ones.
    """
    known, found = fit.uncertainty, []
    pairs = zip(
        getattr(known, name),
        getattr(known, f"cov_{name}"),
        getattr(truth.uncertainty, name),
        strict=True,
    )
    for root, covariance, true_root in pairs:
        away = np.array([(true_root - root).real, (true_root - root).imag])[
            : 1 + bool(true_root.imag)
        ]
        n = away.size
        found.append(away @ np.linalg.solve(covariance[:n, :n], away) < chi2.ppf(0.95, n))
    return found


@pytest.mark.attack(every=2)
@pytest.mark.parametrize("dt", [0, 0.005])
def test_standard_deviations_are_those_of_many_fits(dt):
    rng = np.random.default_rng(0)
    exact = fitted(true(), dt=dt).response  # of the model's own kind, so that only scatter is left
    fits = [fitted(exact + noise(rng), dt=dt) for _ in range(120)]
    truth = fitted(exact, dt=dt)
    for name in ("poles", "zeros"):
        roots = np.array([getattr(fit.uncertainty, name) for fit in fits])
        told = np.sqrt(
            np.mean([getattr(fit.uncertainty, f"std_{name}") ** 2 for fit in fits], axis=0)
        )
        np.testing.assert_allclose(
            np.std(roots, axis=0), told, rtol=0.3
        )  # 120 draws: 4 sigmas are 26 %
        real = getattr(fits[0].uncertainty, name).imag == 0
        held = np.array([inside(fit, name, truth) for fit in fits])
        for these in (real, ~real):  # pairs are one draw: 4 sigmas of 120
            assert not these.any() or abs(held[:, these].mean() - 0.95) < 4 * np.sqrt(
                0.95 * 0.05 / 120
            )
    p = np.array([fit.p_value for fit in fits])
    assert abs(p.mean() - 0.5) < 4 / np.sqrt(12 * len(p))
    assert np.mean(p < 0.05) < 0.14


def test_pairs_share_their_covariance_and_gain_and_delay_have_theirs():
    rng = np.random.default_rng(1)
    delay = 0.004
    fits = [fitted(true(delay) + noise(rng), delay="estimate") for _ in range(16)]
    told = np.array([fit.uncertainty.std_delay for fit in fits])
    seen = np.std([fit.delay for fit in fits])
    assert told.mean() == pytest.approx(seen, rel=0.7)  # 4 sigmas of 16 draws
    gains = [fit.uncertainty.static_gain for fit in fits]
    assert gains == pytest.approx([fit.G.dcgain() for fit in fits], rel=1e-9)
    stated = np.mean([fit.uncertainty.std_static_gain for fit in fits])
    assert np.std(gains) / np.mean(gains) == pytest.approx(stated, rel=0.7)
    known = fits[0].uncertainty
    pair = np.flatnonzero(known.poles.imag)
    np.testing.assert_allclose(
        np.diagonal(known.cov_poles[pair[0]]), np.diagonal(known.cov_poles[pair[1]])
    )
    assert known.cov_poles[pair[0]][0, 1] == -known.cov_poles[pair[1]][0, 1]
    assert np.isnan(fitted(true()).uncertainty.std_delay)


def test_a_model_that_leaves_something_out_is_improbable_and_its_deviations_grow():
    rng = np.random.default_rng(2)
    missing = true() + 0.5 * true()[::-1].conj() / np.abs(true()).max()
    fit = fitted(missing + noise(rng))
    assert fit.p_value < 1e-3
    assert fit.cost > 1.5 * fit.expected_cost
    sound = fitted(true() + noise(rng))
    assert np.all(fit.uncertainty.std_poles[1:] > sound.uncertainty.std_poles[1:] * 0.9)
    assert "(p = " in unwrapped(sound)
    assert "poles rad/s: " in unwrapped(sound)
    assert "(std " in unwrapped(sound)


def test_a_cost_with_estimated_variances_is_judged_by_their_scatter():
    rng = np.random.default_rng(3)
    dof, F = 6, 60
    p = []
    for _ in range(400):  # windows of six lines share a variance
        G = 1e3 + (rng.standard_normal(F) + 1j * rng.standard_normal(F)) / np.sqrt(2)
        var = np.repeat(rng.gamma(dof, 1 / dof, F // dof), dof)
        bla = nlfrf.bla_from_frf(np.arange(1.0, F + 1), G, std=np.sqrt(var))
        p.append(robust.fit_nominal(replace(bla, dof=np.full(F, float(dof))), n_poles=0).p_value)
    assert 0.02 < np.mean(np.array(p) < 0.05) < 0.10
    alone = control.FrequencyResponseData(true(), OMEGA)
    assert np.isnan(robust.fit_nominal(alone, n_poles=3, n_zeros=1).p_value)


def test_a_scan_names_poles_that_the_data_do_not_carry():
    rng = np.random.default_rng(4)
    # half a sample of hold: a scan answers with a pole that it cannot place
    G = 3600 / (S**2 + 4 * S + 3600) * np.exp(-S / 2000)
    frd = control.FrequencyResponseData(G + noise(rng, 1e-3), OMEGA)
    scan = robust.models.scan_orders(frd, n_poles=(2, 3), delay=0.0, std=np.full(OMEGA.size, 1e-3))
    assert "3 poles" in unwrapped(scan).partition("insignificant poles: ")[0]
    assert "poles of" not in unwrapped(
        robust.models.scan_orders(frd, n_poles=(2,), delay=1 / 2000, std=np.full(OMEGA.size, 1e-3))
    )


def scan_of(G, sigma=1e-3, n_poles=range(1, 6)):
    rng = np.random.default_rng(4)
    frd = control.FrequencyResponseData(G + noise(rng, sigma), OMEGA)
    return robust.models.scan_orders(frd, n_poles=n_poles, std=np.full(OMEGA.size, sigma))


def test_a_delay_is_tried_where_the_phase_asks_for_one_and_compared():
    scan = scan_of(3600 / (S**2 + 4 * S + 3600) * np.exp(-S * 5e-3))
    assert scan.best == 2
    assert abs(scan.fit.delay - 5e-3) < 4 * scan.fit.uncertainty.std_delay
    assert list(scan.n_poles) == [1, 1, 2, 2, 3, 3, 4, 4, 5, 5]
    assert scan.criterion[list(scan.fits).index(scan.fit)] < scan.criterion[scan.delay == 0].min()
    assert str(scan).count("(taken)") == 1
    assert f"delay {1e3 * scan.fit.delay:8.4g} ms" in str(scan)


def test_no_delay_is_tried_where_none_is_asked_for():
    scan = scan_of(3600 / (S**2 + 4 * S + 3600))
    assert scan.best == 2
    assert list(scan.n_poles) == [1, 2, 3, 4, 5]
    assert not scan.delay.any()


def doubts_of(scan, n_poles):
    """What the table of a scan says behind the cost of its first fit with so many poles."""
    row = next(row for row in str(scan).splitlines() if row.split()[:2] == [f"{n_poles}", "poles"])
    return row.partition("times scatter")[2].removeprefix(" (taken)").strip()


@pytest.mark.attack
def test_poles_that_the_data_do_not_carry_are_not_recommended():
    """A pole far below the band takes a misfit off a few lines; the criterion alone took it."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        G = 3600 / (S**2 + 4 * S + 3600) + noise(rng, 1e-3)
        frd = control.FrequencyResponseData(G, OMEGA)
        scan = robust.models.scan_orders(frd, n_poles=(2, 3, 5), std=np.full(OMEGA.size, 1e-3))
        assert not doubts_of(scan, scan.best)


@pytest.mark.parametrize("far", [1e3, 1e100, 1e152, 1e170, 1e300])
def test_a_root_far_outside_the_band_is_unknown_and_overflows_nothing(far):
    """Warnings are errors here: the square of its standard deviation was no number."""
    known = {
        "model": 1 / (S + 30),
        "std": np.full(OMEGA.size, STD),
        "zeros": np.zeros(0),
        "gain": 1.0,
        "c": 1.0,
        "dt": 0.0,
    }
    found = estimate_uncertainty(S, OMEGA, **known, poles=np.array([-30.0, -far]), free_delay=False)
    alone = estimate_uncertainty(S, OMEGA, **known, poles=np.array([-30.0]), free_delay=False)
    assert np.isfinite(found.std_poles).all()
    assert found.std_poles[1] > min(far, 1e148)
    assert found.std_poles[0] == pytest.approx(alone.std_poles[0], rel=0.5)


@pytest.mark.filterwarnings("ignore:a nominal model of 0 poles does not fit")
def test_a_variance_of_one_window_does_not_make_every_order_as_good():
    """The mean of |residual|^2 / var is infinite there: two masses were taken for one."""
    ms = nlfrf.multisine("special-odd", fs=1024, n_samples=2048, f_min=2, f_max=200, rms=1.0, rng=1)
    bla = nlfrf.identify(nlfrf.simulate(nlfrf.paper_rig(), ms, n_periods=3, n_discard=2))
    few = replace(bla, dof=np.where(np.arange(bla.f.size) == 0, 0.9, bla.dof))
    fit = robust.fit_nominal(few, n_poles=3)
    assert 0.1 < fit.cost / fit.expected_cost < 10
    costs = [
        robust.fit_nominal(replace(bla, dof=np.full(bla.f.size, dof)), n_poles=0).expected_cost
        for dof in (0.9, 3.0, 11.0)
    ]
    assert costs[0] == pytest.approx(costs[1], rel=1e-12)
    assert costs[1] == pytest.approx(1.5 / 1.1 * costs[2], rel=1e-12)


@pytest.mark.attack(every=18)
@pytest.mark.parametrize("delay", ["auto", "estimate", 0.0])
@pytest.mark.parametrize("seed", range(6))
def test_no_order_costs_more_than_one_below(seed, delay):
    """But for zeros that were left out: each for at most what the criterion takes off for it."""
    plant = random_rational(seed)
    scan = robust.models.scan_orders(plant.frd, n_poles=range(1, 7), delay=delay, std=plant.std)
    for delayed in (False, True):
        fits = [fit for fit, tau in zip(scan.fits, scan.delay, strict=True) if (tau > 0) == delayed]
        for few, more in pairwise(fits):
            left_out = max(few.uncertainty.zeros.size + 1 - more.uncertainty.zeros.size, 0)
            allowed = left_out * np.log(2 * plant.omega.size) / 2
            assert more.unlikelihood < few.unlikelihood + 1e-6 * abs(few.unlikelihood) + allowed


def test_a_pole_and_a_zero_that_cancel_but_for_scatter_are_named_and_not_taken():
    rng = np.random.default_rng(6)
    G = 3600 / (S**2 + 4 * S + 3600) + noise(rng, 1e-3)
    frd = control.FrequencyResponseData(G, OMEGA)
    scan = robust.models.scan_orders(
        frd, n_poles=(2, 4), relative_degree=2, std=np.full(OMEGA.size, 1e-3)
    )
    assert "poles" in doubts_of(scan, 4)
    assert not doubts_of(scan, 2)
    assert robust.models.scan_orders(frd, n_poles=(2, 4), std=np.full(OMEGA.size, 1e-3)).best == 2


@pytest.mark.parametrize(
    ("n", "rel"),  # four sigmas of n draws
    [(16, 0.7), pytest.param(60, 0.4, marks=pytest.mark.attack)],
)
def test_the_separation_of_a_pole_from_a_zero_is_that_of_many_fits(n, rel):
    """A pole and a zero 3 % apart scatter together: their distance is known better than either."""
    rng = np.random.default_rng(7)
    plant = (S**2 + 2 * S + 61.0**2) / (S**2 + 2 * S + 60.0**2) * 30 / (S + 30)
    frd = [control.FrequencyResponseData(plant + noise(rng, 1e-2), OMEGA) for _ in range(n)]
    fits = [
        robust.fit_nominal(one, n_poles=3, n_zeros=2, std=np.full(OMEGA.size, 1e-2)) for one in frd
    ]
    poles, zeros = (
        np.array([getattr(f.uncertainty, name) for f in fits]) for name in ("poles", "zeros")
    )
    light = [int(np.argmax(row.imag)) for row in poles]
    apart = np.array(
        [p[i] - z[np.argmax(z.imag)] for p, z, i in zip(poles, zeros, light, strict=True)]
    )
    told = np.median(
        [abs(a) / f.uncertainty.separation[i] for a, f, i in zip(apart, fits, light, strict=True)]
    )
    assert np.std(apart) == pytest.approx(told, rel=rel)
