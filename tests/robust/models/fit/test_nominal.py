"""The nominal fit against exact plants, and against the statistics of its cost."""

import control
import numpy as np
import pytest

from nlfrf import Bla, bla_from_frf
from robust import DesignWarning, fit_nominal, frd
from robust.lti.sampling import sampled
from robust.models import scan_orders
from robust.models.fit.rational import fit_numerator
from tests.support.bla import make_bla
from tests.support.random_rational import random_rational
from tests.support.responses import response

F_LINES = np.sort(np.concatenate([8 * np.arange(72) + 1, 8 * np.arange(72) + 3])) * 0.25


def resonance(s, f=59.0, zeta=0.02, delay=0.0):
    w = 2 * np.pi * f
    return np.exp(-s * delay) / (s * s + 2 * zeta * w * s + w * w)


#: Frequencies [Hz] and dampings of a drive with a coupling.
LIGHT = {18.0: 0.35, 301.1: 0.0194, 310.0: 0.02}


def six_modes():
    """Twelve poles over 2.5 decades, ten zeros between them."""
    poles = np.concatenate(
        [[(-0.01 + 1j) * w, (-0.01 - 1j) * w] for w in np.geomspace(10, 3000, 6)]
    )
    zeros = np.concatenate(
        [[(-0.02 + 1j) * w, (-0.02 - 1j) * w] for w in np.geomspace(20, 2000, 5)]
    )
    return lambda s: 1e3 * np.prod(s[:, None] - zeros, axis=1) / np.prod(s[:, None] - poles, axis=1)


@pytest.mark.parametrize(("n_poles", "n_zeros"), [(2, 0), (2, None), (4, 2), (6, None)])
def test_exact_data_give_the_exact_plant_even_with_poles_to_spare(n_poles, n_zeros):
    fit = fit_nominal(make_bla(resonance, F_LINES, f0=0.25), n_poles=n_poles, n_zeros=n_zeros)
    assert np.abs(fit.response / resonance(1j * fit.omega) - 1).max() < 1e-9


def test_twelve_poles_over_many_decades():
    plant = six_modes()
    fit = fit_nominal(make_bla(plant, 3 * F_LINES, f0=0.75), n_poles=12)
    assert np.abs(fit.response / plant(1j * fit.omega) - 1).max() < 1e-9
    assert np.abs(response(fit.G, fit.omega) / fit.response - 1).max() < 1e-8


def test_state_space_and_delay_are_the_response():
    with pytest.warns(
        DesignWarning, match="does not fit the measurement"
    ):  # the plant has no delay
        fit = fit_nominal(make_bla(resonance, F_LINES, f0=0.25), n_poles=2, delay=1e-3)
    assert fit.delay == 1e-3
    assert response(fit.G, fit.omega) * np.exp(-1j * fit.omega * fit.delay) == pytest.approx(
        fit.response, rel=1e-9
    )


def test_cost_is_what_scatter_leaves_and_parameters_take():
    """|residual|^2/var over its estimate is F(2, 2 dof): mean dof/(dof - 1); each parameter takes
    half a line.
    """
    ratios, errors = [], []
    for seed in range(40):
        bla = make_bla(
            resonance,
            F_LINES,
            sigma_distortion=0.03 * np.abs(resonance(2j * np.pi * F_LINES)),
            rng=seed,
            f0=0.25,
        )
        fit = fit_nominal(bla, n_poles=2, n_zeros=0)
        ratios.append(fit.cost / fit.expected_cost)
        errors.append(np.abs(fit.G.poles()[0]) / (2 * np.pi * 59) - 1)
    # one ratio scatters by sqrt(var(F)/n)/mean = 0.11 (dof 6, 144 lines); the mean of 40 by 0.017
    assert np.mean(ratios) == pytest.approx(1, abs=4 * 0.017)
    assert abs(np.mean(errors)) < 4 * np.std(errors) / np.sqrt(40)
    assert np.std(errors) < 1e-3


def test_undermodelling_shows_in_the_cost():
    plant = six_modes()
    bla = make_bla(
        plant,
        3 * F_LINES,
        sigma_distortion=0.01 * np.abs(plant(6j * np.pi * F_LINES)),
        rng=0,
        f0=0.75,
    )
    with pytest.warns(
        DesignWarning,
        match=r"8 poles does not fit the measurement: .* error of the class: .* of \|G\|",
    ):
        few = fit_nominal(bla, n_poles=8)
    assert few.cost > 100 * fit_nominal(bla, n_poles=12).cost
    fit_nominal([bla, bla], n_poles=8)  # of several records the misfit is what is asked for


def test_a_pole_where_nothing_was_measured_is_warned_of():
    omega = np.linspace(1, 20, 40)
    slow, fast = (control.FrequencyResponseData(1 / (1j * omega + p), omega) for p in (0.05, 500.0))
    for measured, at in ((slow, "0.007958"), (fast, "79.58")):
        with pytest.warns(
            DesignWarning, match=rf"a pole where nothing was measured, at {at} Hz; the band is 0.15"
        ):
            fit_nominal(measured, n_poles=1, n_zeros=0)
    discrete = control.FrequencyResponseData(
        1 / (np.exp(1j * omega * 0.01) - np.exp(-0.0005)), omega
    )
    with pytest.warns(DesignWarning, match=r"at 0.00795\d Hz"):
        fit_nominal(discrete, n_poles=1, n_zeros=0, dt=0.01)


@pytest.mark.parametrize("delay", [0.0, 0.0013, 0.0037])
def test_delay_is_estimated(delay):
    def plant(s):
        return resonance(s, delay=delay)

    sigma = 0.01 * np.abs(resonance(2j * np.pi * F_LINES))
    bla = make_bla(plant, F_LINES, sigma_distortion=sigma, rng=1, f0=0.25)
    fit = fit_nominal(bla, n_poles=2, n_zeros=0, delay="estimate")
    assert fit.delay == pytest.approx(delay, abs=3e-5)
    assert fit.cost < 1.5 * fit.expected_cost


def test_discrete_fit_finds_the_sampled_plant_and_its_delay():
    T = 1e-3
    truth = sampled(control.ss(control.tf([1.0], [1, 15, (2 * np.pi * 59) ** 2])), T, 2 * T)
    omega = 2 * np.pi * F_LINES
    bla = make_bla(response(truth, omega), F_LINES, f0=0.25)
    fit = fit_nominal(bla, n_poles=2, n_zeros=1, dt=T, delay="estimate")
    assert fit.delay == pytest.approx(2 * T)
    assert np.abs(fit.response / response(truth, omega) - 1).max() < 1e-7
    assert fit.G.dt == T


def test_stable_option():
    def unstable(s):
        return 100 / (s * s - 4 * s + 400)

    bla = make_bla(unstable, np.linspace(0.2, 20, 100))
    free = fit_nominal(bla, n_poles=2, n_zeros=0, stable=False)
    assert free.G.poles().real == pytest.approx([2, 2], abs=1e-6)
    with pytest.warns(DesignWarning, match="does not fit the measurement"):
        held = fit_nominal(bla, n_poles=2, n_zeros=0)
    assert np.all(held.G.poles().real < 0)
    assert held.cost > 100 * free.cost


def test_integrator():
    fit = fit_nominal(
        make_bla(lambda s: 5 / (s * (s + 30)), np.linspace(0.5, 50, 100)), n_poles=2, n_zeros=0
    )
    assert np.sort(np.abs(fit.G.poles())) == pytest.approx([0, 30], abs=1e-3)


def test_a_family_is_fitted_as_one():
    blas = [
        make_bla(lambda s, f=f: resonance(s, f=f), F_LINES, f0=0.25, sigma_noise=1e-9)
        for f in (57.0, 61.0)
    ]
    fit = fit_nominal(blas, n_poles=2, n_zeros=0)
    assert fit.omega.size == 2 * F_LINES.size
    assert 57 < np.abs(fit.G.poles()[0]) / 2 / np.pi < 61


def test_frequency_response_data_with_standard_deviations():
    omega = np.linspace(1, 100, 80)
    G = 50**2 / ((1j * omega) ** 2 + 4j * omega + 50**2)
    rng = np.random.default_rng(0)
    std = np.where(omega < 60, 1e-3, 1.0)
    noisy = G + std * (rng.normal(size=80) + 1j * rng.normal(size=80)) / np.sqrt(2)
    fit = fit_nominal(control.FrequencyResponseData(noisy, omega), n_poles=2, n_zeros=0, std=std)
    assert np.abs(fit.G.poles()) == pytest.approx([50, 50], abs=0.05)
    assert fit.cost / fit.expected_cost == pytest.approx(1, abs=0.5)
    assert np.isnan(
        fit_nominal(control.FrequencyResponseData(noisy, omega), n_poles=2).expected_cost
    )


def test_scatter_on_a_resonance_does_not_lead_the_start_astray():
    """Distortion as large as half the peak, next to lines known to a tenth: the pair is found in
    every draw.
    """
    f = 0.25 * np.arange(5, 575, 2)
    f = f[np.random.default_rng(0).random(f.size) < 0.75]
    size = np.abs(resonance(2j * np.pi * f, 46.0, 0.05))
    for seed in range(
        35
    ):  # vector fitting alone loses four of these, at fifty times the cost expected
        bla = make_bla(
            lambda s: resonance(s, 46.0, 0.05),
            f,
            f0=0.25,
            sigma_distortion=0.1 * size + 0.5 * size**2 / size.max(),
            rng=seed,
        )
        fit = fit_nominal(bla, n_poles=2)
        assert fit.cost < 2 * fit.expected_cost
        assert np.abs(fit.G.poles()) / 2 / np.pi == pytest.approx(46.0, rel=0.02)


def test_frd_is_the_bla():
    bla = make_bla(resonance, F_LINES, f0=0.25)
    data = frd(bla)
    assert np.array_equal(data.omega, bla.omega)
    assert np.array_equal(data.frdata[0, 0], bla.G)


@pytest.mark.parametrize(
    ("kwargs", "message"),
    [
        ({"n_poles": -1}, "n_poles must be a whole number"),
        ({"n_poles": 2, "n_zeros": 3}, "n_zeros must be at most n_poles = 2, got 3"),
        ({"n_poles": 41}, "n_poles must be at most 40"),
        ({"n_poles": 2, "delay": "guess"}, "delay must be a number"),
        ({"n_poles": 2, "delay": -1.0}, "delay must be zero or positive"),
        ({"n_poles": 2, "dt": 1e-2}, "dt must put the Nyquist frequency above the last line"),
        ({"n_poles": 2, "dt": 1e-3, "delay": 1.5e-3}, "delay must be a whole number of samples"),
        ({"n_poles": 2, "std": np.ones(3)}, "std must only be given with a FrequencyResponseData"),
    ],
)
def test_refusals(kwargs, message):
    with pytest.raises(ValueError, match=message):
        fit_nominal(make_bla(resonance, F_LINES, f0=0.25), **kwargs)


def test_refuses_too_few_lines_and_no_bla():
    with pytest.raises(ValueError, match="twice the number of lines"):
        fit_nominal(make_bla(resonance, np.array([10.0, 20.0])), n_poles=3)
    with pytest.raises(ValueError, match=r"bla must be an nlfrf\.Bla"):
        fit_nominal([], n_poles=2)
    assert isinstance(make_bla(resonance, F_LINES, f0=0.25), Bla)
    with pytest.raises(ValueError, match="std must be given for an FRF that is zero on a line"):
        fit_nominal(control.FrequencyResponseData([1.0, 0.0, 1.0], [1.0, 2.0, 3.0]), n_poles=1)


def test_one_line_that_no_stable_model_reaches():
    fit = fit_nominal(control.FrequencyResponseData([1 + 1j], [1.0]), n_poles=1, n_zeros=0)
    assert np.isfinite(fit.cost)
    assert fit.G.poles().real < 0


@pytest.mark.filterwarnings("ignore")
def test_no_pole_comes_to_stand_on_a_line():
    """An undamped resonance on a line of the data: its pole stays a little damped, and the
    numerator finite.
    """
    s = 2j * np.pi * np.geomspace(0.25, 150, 60)
    for place in (0, 20, 59):
        data = 1 / (s**2 + abs(s[place]) ** 2 * (1 + 1e-14)) + 1e-3 / (s + 30)
        measured = control.FrequencyResponseData(data, np.abs(s))
        fit = fit_nominal(measured, n_poles=3, n_zeros=2, std=np.abs(data))
        poles = fit.uncertainty.poles
        assert np.all(np.abs(poles.real) >= 0.99e-8 * np.abs(poles))
        assert np.isfinite([*fit.uncertainty.zeros, *fit.response]).all()


def test_a_numerator_of_lower_degree_keeps_the_digits_of_its_zeros():
    """Dividing by the last coefficient, rounding alone, lost the small zeros: every start was
    wrong.
    """
    s = 2j * np.pi * F_LINES
    poles = np.concatenate([[(-0.01 + 1j) * w, (-0.01 - 1j) * w] for w in (1.57, 70.0, 370.0)])
    truth = np.concatenate([[(-0.01 + 1j) * w, (-0.01 - 1j) * w] for w in (1.6, 72.0)])
    data = np.prod(s[:, None] - truth, axis=1) / np.prod(s[:, None] - poles, axis=1)
    zeros, gain = fit_numerator(s, data, weight=1 / np.abs(data), poles=poles, n_zeros=5)
    near = zeros[np.argsort(np.abs(zeros))][:4]
    assert np.sort_complex(near) == pytest.approx(np.sort_complex(truth), rel=1e-9)
    assert np.abs(zeros).max() > 1e8
    assert gain * np.prod(s[:, None] - zeros, axis=1) / np.prod(
        s[:, None] - poles, axis=1
    ) == pytest.approx(data, rel=1e-9)


@pytest.mark.parametrize("free_delay", [True, False])
@pytest.mark.parametrize("seed", [21, 34, 55, 64, 70, 108, 118, 157, 161, 180])
def test_the_fit_costs_what_one_from_the_truth_costs(seed, free_delay):
    """Plants on which vector fitting with a full numerator, or steps that run against a bound, end
    in a worse fit.
    """
    plant = random_rational(seed)
    fit = fit_nominal(
        plant.frd,
        n_poles=plant.poles.size,
        n_zeros=plant.zeros.size,
        delay="estimate" if free_delay else plant.delay,
        std=plant.std,
    )
    assert fit.cost < 1.05 * plant.cost_from_truth(free_delay)


@pytest.mark.attack
@pytest.mark.filterwarnings("ignore:the nominal model has a pole where nothing was measured")
def test_random_plants_are_fitted_as_from_the_truth():
    missed = 0
    for seed in range(1000, 1060):
        plant = random_rational(seed)
        orders = {"n_poles": plant.poles.size, "n_zeros": plant.zeros.size}
        fit = fit_nominal(plant.frd, **orders, delay="estimate", std=plant.std)
        missed += fit.cost > 1.05 * plant.cost_from_truth(True)
    assert missed <= 3  # of 60: one in a hundred is missed


@pytest.mark.parametrize("scanned", [False, pytest.param(True, marks=pytest.mark.attack)])
def test_a_light_mode_beside_a_damped_one_behind_a_delay_is_found(scanned):
    """A pole pair that zeros almost cancel moves the FRF little."""
    s = 2j * np.pi * np.geomspace(10, 2000, 120)
    section = {
        w: s**2 + 2 * zeta * 2 * np.pi * w * s + (2 * np.pi * w) ** 2 for w, zeta in LIGHT.items()
    }
    G = 1e4 * section[301.1] / section[18.0] / section[310.0] * np.exp(-2e-4 * s)
    rng = np.random.default_rng(0)
    G = G * (1 + 0.01 / np.sqrt(2) * (rng.standard_normal(120) + 1j * rng.standard_normal(120)))
    measured, std = control.FrequencyResponseData(G, np.abs(s)), 0.01 * np.abs(G)
    fit = fit_nominal(measured, n_poles=4, n_zeros=2, delay="estimate", std=std)
    assert fit.cost < 1.3 * fit.expected_cost
    assert fit.delay == pytest.approx(2e-4, rel=0.02)
    assert np.unique(np.abs(fit.G.poles()).round(6)) / 2 / np.pi == pytest.approx(
        [18.0, 310.0], rel=0.01
    )
    if scanned:
        scan = scan_orders(measured, std=std)
        assert scan.fit.G.nstates == 4
        assert scan.fit.G.zeros().size == 2


def test_one_line_of_scatter_does_not_choose_the_order():
    """On one logarithmic line the scatter alone limits the crossover of every order: four poles
    were taken, at 3e5 times the cost of six.
    """

    def modes(s, *terms):
        return sum(a * w**2 / (s**2 + 2 * z * w * s + w**2) for a, w, z in terms)

    omega = 2 * np.pi * np.geomspace(1, 200, 60)
    stage, small = ((1.0, 12.6, 0.7), (0.02, 188.0, 0.008)), (1e-3, 691.0, 0.05)
    G = modes(1j * omega, *stage, small)
    std = 1e-4 * np.abs(G) + 2e-6
    std[12] = 0.8 * abs(G[12])
    rng = np.random.default_rng(1)
    e = rng.standard_normal(60) + 1j * rng.standard_normal(60)
    bla = bla_from_frf(omega / 2 / np.pi, G + np.sqrt(2) * std * e, std=std)
    scan = scan_orders(bla, n_poles=(4, 6), delay=0.0)
    assert scan.fits[1].p_value < 1e-6  # scatter explains neither
    assert scan.reach[0] == pytest.approx(scan.reach[1], rel=0.05)
    assert scan.cost[0] > 1e4 * scan.cost[1]
    assert scan.best == 6
