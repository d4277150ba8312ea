"""Uncertainty models: the radius in closed form, its budget, the four forms, sampling, and another
day's record.
"""

import control
import numpy as np
import pytest

from robust import UncertaintyModel, fit_nominal, frd, uncertainty, validate
from tests.support.bla import make_bla
from tests.support.responses import response

F = np.sort(np.concatenate([8 * np.arange(60) + 1, 8 * np.arange(60) + 3])) * 0.25
OMEGA = 2 * np.pi * F
W0 = 2 * np.pi * 60
FORMS = ("multiplicative", "additive", "inverse-multiplicative", "inverse-additive", "coprime")


def plant(s):
    return 1e4 / (s * s + 30 * s + W0**2)


SIZE = np.abs(plant(1j * OMEGA))
NOMINAL = control.ss(control.tf([1e4], [1, 30, W0**2]))


def exact(**sigmas):
    return make_bla(plant, F, f0=0.25, dof=6.0, **sigmas)


def test_radius_is_f_quantile_times_the_scatter_of_a_new_realisation():
    """sqrt(F_p (var_total + var_distortion)), F_0.95 = 1.97^2 at six degrees of freedom; no misfit,
    by making.
    """
    bla = exact(sigma_distortion=0.1 * SIZE)
    model = uncertainty(bla, NOMINAL, even=False)
    quantile = 6 * (0.05 ** (-1 / 6) - 1)
    assert model.radius == pytest.approx(np.sqrt(quantile * 2) * 0.1, rel=1e-6)
    assert np.sqrt(quantile) == pytest.approx(1.97, abs=0.005)


def test_budget_adds_up_and_shares_by_variance():
    bla = exact(sigma_noise=0.02 * SIZE, sigma_distortion=0.1 * SIZE, sigma_even=0.05 * SIZE)
    model = uncertainty(bla, NOMINAL)
    assert np.sum(list(model.budget.values()), axis=0) == pytest.approx(model.radius, rel=1e-9)
    # noise once (in G), distortion in G and in the new realisation, even once; the split is told to
    # a percent
    variances = np.array([0.02**2, 2 * 0.1**2, 0.05**2])
    for name, share in zip(("noise", "odd", "even"), variances / variances.sum(), strict=True):
        assert model.budget[name] / model.radius == pytest.approx(share, rel=0.015)
    assert np.all(uncertainty(bla, NOMINAL, even=False).radius < model.radius)


@pytest.mark.parametrize("n", [3, pytest.param(10, marks=pytest.mark.attack)])
def test_misfit_is_not_counted_twice_and_not_missed(n):
    """A nominal 20 % too small: the radius is the offset plus the scatter; one that fits adds next
    to nothing.
    """
    wrong = control.ss(control.tf([0.8e4], [1, 30, W0**2]))
    offset, clean = [], []
    for seed in range(n):
        bla = make_bla(plant, F, f0=0.25, sigma_distortion=0.05 * SIZE, rng=seed)
        offset.append(np.median(uncertainty(bla, wrong, order=1).budget["misfit"]))
        clean.append(np.median(uncertainty(bla, NOMINAL, order=1).budget["misfit"]))
    assert np.mean(offset) == pytest.approx(0.25, rel=0.05)  # 0.2/0.8
    assert np.mean(clean) < 0.05


def test_a_narrow_misfit_is_seen():
    two = control.ss(control.tf([1e4], [1, 30, W0**2])) + control.ss(
        control.tf([40.0], [1, 2, (2 * np.pi * 30) ** 2])
    )
    bla = make_bla(response(two, OMEGA), F, f0=0.25, sigma_distortion=0.01 * SIZE, rng=0)
    model = uncertainty(bla, NOMINAL, order=6)
    true_error = np.abs(response(two, OMEGA) - plant(1j * OMEGA)) / SIZE
    assert np.all(model.radius > true_error)


@pytest.mark.parametrize("form", FORMS)
def test_the_weight_covers_and_the_forms_hold_the_disc(form):
    """Every FRF on the rim of the measured disc lies in the set of every form."""
    bla = exact(sigma_distortion=0.08 * SIZE)
    model = uncertainty(bla, NOMINAL, form=form, order=3)
    assert np.all(np.abs(response(model.weight, OMEGA)) >= model.radius)
    disc = np.sqrt(6 * (0.05 ** (-1 / 6) - 1) * 2) * 0.08 * SIZE
    for angle in np.linspace(0, 2 * np.pi, 24):
        rim = control.FrequencyResponseData(plant(1j * OMEGA) + disc * np.exp(1j * angle), OMEGA)
        assert model.contains(rim)
    out = 1.6 if form != "inverse-additive" else 2.0
    far = control.FrequencyResponseData(plant(1j * OMEGA) * (1 - out * 0.4), OMEGA)
    assert not model.contains(far)


@pytest.mark.attack(every=4)
@pytest.mark.parametrize("form", FORMS)
def test_samples_lie_inside_and_some_on_the_rim(form):
    model = uncertainty(exact(sigma_distortion=0.05 * SIZE), NOMINAL, form=form, order=4)
    plants = model.sample(30, rng=1)
    assert len(plants) == 30
    distances = np.array([model.distance(p) for p in plants])
    assert distances.max() <= 1 + 1e-6
    assert np.sum(distances.max(axis=1) > 0.999) > 5
    assert all(model.contains(p) for p in plants)
    again = model.sample(3, rng=1)
    assert response(again[2], OMEGA) == pytest.approx(response(plants[2], OMEGA))


def test_samples_of_an_frf_model_are_frfs():
    bla = exact(sigma_distortion=0.05 * SIZE)
    model = uncertainty(bla, frd(bla))
    assert model.measured_only
    (one,) = model.sample(1, rng=0)
    assert isinstance(one, control.FrequencyResponseData)
    assert model.contains(one)


def test_inverse_forms_are_refused_where_the_radius_reaches_the_gain():
    with pytest.raises(
        ValueError, match="form must be multiplicative or additive if the radius reaches"
    ):
        uncertainty(exact(sigma_distortion=0.5 * SIZE), NOMINAL, form="inverse-multiplicative")


def test_several_levels_take_the_largest_radius_and_say_what_the_level_does():
    low = exact(sigma_distortion=0.02 * SIZE)
    moved = make_bla(lambda s: 1.2 * plant(s), F, f0=0.25, sigma_distortion=0.02 * SIZE)
    model = uncertainty([low, moved], NOMINAL)
    alone = uncertainty(low, NOMINAL)
    assert np.all(model.radius >= alone.radius)
    assert model.budget["level"] == pytest.approx(0.2, abs=0.02)
    for bla in (low, moved):
        assert model.contains(frd(bla))


def test_levels_on_different_bands():
    low = make_bla(plant, F[:80], f0=0.25, sigma_distortion=0.02 * SIZE[:80])
    high = make_bla(plant, F[40:], f0=0.25, sigma_distortion=0.02 * SIZE[40:])
    model = uncertainty([low, high], NOMINAL)
    assert model.omega == pytest.approx(OMEGA)
    assert np.isfinite(model.radius).all()


def test_simultaneous_is_wider_and_systematic_adds():
    bla = exact(sigma_distortion=0.03 * SIZE)
    per_line = uncertainty(bla, NOMINAL)
    assert np.all(uncertainty(bla, NOMINAL, simultaneous=True).radius > 1.4 * per_line.radius)
    added = uncertainty(bla, NOMINAL, systematic=8.0).radius - per_line.radius
    assert added == pytest.approx(10**0.4 * 0.03, rel=1e-6)


def test_extrapolation_rules():
    bla = exact(sigma_distortion=0.05 * SIZE)
    flat = uncertainty(bla, NOMINAL, above="flat", order=2)
    rising = uncertainty(bla, NOMINAL, above=20.0, order=4)
    both = uncertainty(bla, NOMINAL, below=10.0, order=4)
    radius = flat.radius[-1]
    assert np.abs(response(flat.weight, OMEGA[-1:] * 100)) < 1.1 * radius
    for decades in (0.5, 1.0, 2.0):
        assert np.abs(response(rising.weight, OMEGA[-1:] * 10**decades)) >= radius * 10**decades * (
            1 - 1e-9
        )
        assert np.abs(response(both.weight, OMEGA[:1] / 10**decades)) >= radius * 10 ** (
            decades / 2
        ) * (1 - 1e-9)
    assert "rising 20 dB/decade" in rising.origin.extrapolation
    assert np.abs(rising.weight.dcgain()) >= radius


def test_discrete_nominal_has_a_discrete_weight_up_to_nyquist():
    T = 1e-3
    bla = exact(sigma_distortion=0.05 * SIZE)
    fit = fit_nominal(bla, n_poles=2, n_zeros=1, dt=T)
    model = uncertainty(bla, fit)
    assert model.weight.dt == T
    nyquist = np.array([np.pi / T * 0.999])
    assert np.abs(response(model.weight, nyquist)) >= model.radius[-1] * nyquist / OMEGA[-1] * 0.99


def test_the_delay_of_a_fit_goes_into_the_nominal():
    bla = make_bla(lambda s: plant(s) * np.exp(-2e-3 * s), F, f0=0.25, sigma_distortion=0.05 * SIZE)
    fit = fit_nominal(bla, n_poles=2, n_zeros=0, delay=2e-3)
    model = uncertainty(bla, fit, order=3)
    assert model.origin.delay == 2e-3
    assert response(model.nominal, OMEGA) == pytest.approx(fit.response, rel=1e-3)


@pytest.mark.parametrize("n", [6, pytest.param(60, marks=pytest.mark.attack)])
def test_coverage_of_another_realisation(n):
    """Per line at 95 %, over many pairs of records: a new realisation lies in the radius at least
    93 % of the time.

    About a fitted nominal it does so nearly always: the fit averages the scatter of G, which the
    radius still counts.
    """
    inside = []
    for seed in range(n):
        sigma = 0.05 * SIZE
        bla = make_bla(plant, F, f0=0.25, sigma_distortion=sigma, rng=seed)
        model = uncertainty(bla, fit_nominal(bla, n_poles=2, n_zeros=0), even=False, order=1)
        rng = np.random.default_rng(10_000 + seed)
        new = plant(1j * OMEGA) + sigma * (
            rng.normal(size=F.size) + 1j * rng.normal(size=F.size)
        ) / np.sqrt(2)
        deviation = np.abs(new / response(model.nominal, OMEGA) - 1)
        inside.append(np.mean(deviation <= model.radius))
    assert np.mean(inside) > 0.93


def test_validation_knows_the_same_machine_and_another():
    sigma = 0.05 * SIZE
    bla = make_bla(plant, F, f0=0.25, sigma_distortion=sigma, rng=0)
    model = uncertainty(bla, fit_nominal(bla, n_poles=2, n_zeros=0))
    again = validate(model, make_bla(plant, F, f0=0.25, sigma_distortion=sigma, rng=1))
    assert again.p_value > 0.05
    assert again.n_expected == pytest.approx(0.05 * F.size)
    assert again.n_lines == F.size
    other = validate(
        model, make_bla(lambda s: 1.5 * plant(s), F, f0=0.25, sigma_distortion=sigma, rng=1)
    )
    assert other.p_value < 1e-6
    assert other.n_outside == other.omega_outside.size > 20
    with pytest.raises(ValueError, match="bla must have lines inside the band"):
        validate(model, make_bla(plant, F + 1000, f0=0.25))


def test_made_directly_from_its_first_eight_fields():
    omega, radius = np.array([1.0, 10.0]), np.array([0.1, 0.2])
    weight = control.tf([0.3], [1])
    model = UncertaintyModel(NOMINAL, weight, "additive", omega, radius, 0.9, "LTI", True)
    assert model.perturbation == "LTI"
    assert model.budget == {}
    by_name = UncertaintyModel(
        nominal=NOMINAL,
        weight=0.3,
        form="additive",
        omega=omega,
        radius=radius,
        confidence=0.9,
        perturbation="LTI",
        simultaneous=False,
    )
    assert not by_name.simultaneous


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"form": "odd"}, "form must be one of"),
        ({"perturbation": "linear"}, "perturbation must be one of"),
        ({"radius": np.array([0.1, -0.2])}, "radius must be positive"),
        ({"radius": np.array([0.1])}, "radius must have one value per frequency"),
        ({"radius": np.array([0.1, 0.4])}, "weight must cover its radius"),
        ({"omega": np.array([2.0, 1.0])}, "omega must be positive and increasing"),
        ({"confidence": 1.0}, "confidence must lie strictly between 0 and 1"),
        ({"weight": control.tf([1], [1, -1])}, "weight must be stable"),
        ({"weight": control.tf([1, 1], [1])}, "weight must be proper"),
        (
            {"weight": control.tf([1.0], [1, 0.5], 0.1)},
            "weight must have the sampling time of the nominal",
        ),
        ({"nominal": "plant"}, "nominal must be a control.StateSpace"),
        ({"budget": {"odd": np.ones(3)}}, "budget must have one value per frequency in odd"),
    ],
)
def test_refusals(change, message):
    fields = {
        "nominal": NOMINAL,
        "weight": 0.3,
        "form": "multiplicative",
        "omega": np.array([1.0, 10.0]),
        "radius": np.array([0.1, 0.2]),
    }
    with pytest.raises(ValueError, match=message):
        UncertaintyModel(**(fields | change))


@pytest.mark.parametrize(
    ("kwargs", "message"),
    [
        ({"form": "no"}, "form must be one of"),
        ({"confidence": 0.0}, "confidence must lie strictly"),
        ({"above": "steep"}, "above must be one of 'flat'"),
        ({"below": -3.0}, "below must be zero or positive"),
        ({"order": -1}, "order must be a whole number"),
    ],
)
def test_uncertainty_refusals(kwargs, message):
    with pytest.raises(ValueError, match=message):
        uncertainty(exact(sigma_distortion=0.1 * SIZE), NOMINAL, **kwargs)
    with pytest.raises(ValueError, match="bla must be"):
        uncertainty("file", NOMINAL)
