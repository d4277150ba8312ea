"""A radius of the user's own: arrays as they are, or a list of plants that the set then holds."""

import control
import numpy as np
import pytest

import robust
from tests.support.forms import DEVIATION, UNSCALED
from tests.support.responses import response

OMEGA = np.geomspace(0.1, 100, 60)
NOMINAL = control.ss(control.tf([2.0], [0.2, 1]))


def plants(n=5):
    """Lags whose gain and time constant are up to 10 % off."""
    rng = np.random.default_rng(3)
    return [
        control.tf([2 * rng.uniform(0.9, 1.1)], [0.2 * rng.uniform(0.9, 1.1), 1]) for _ in range(n)
    ]


@pytest.mark.parametrize("form", UNSCALED)
def test_the_set_holds_every_plant_of_a_list_and_touches_one(form):
    frfs = [control.frd(plant, OMEGA) for plant in plants()]
    model = robust.uncertainty_of_plants(frfs, NOMINAL, form=form, order=3)
    assert all(model.contains(frf) for frf in frfs)
    away = [DEVIATION[form](p(1j * OMEGA), NOMINAL(1j * OMEGA)) for p in plants()]
    assert model.radius == pytest.approx(np.max(away, axis=0), rel=1e-9)
    assert np.isnan(model.confidence)
    assert model.perturbation == "statistical"  # "LTI" is for the user to claim
    assert "5 plants" in model.origin.source


def test_systems_are_taken_at_the_lines_of_the_frfs_beside_them():
    first, *rest = plants()
    model = robust.uncertainty_of_plants(
        [control.frd(first, OMEGA), *rest], NOMINAL, perturbation="LTI", order=3
    )
    assert model.perturbation == "LTI"
    assert all(model.contains(plant) for plant in rest)
    assert robust.check(model, 1.0).verdict == "robust"


def test_frfs_on_other_lines_count_where_they_are():
    low, high = OMEGA[:40], OMEGA[20:]
    one, other = plants(2)
    model = robust.uncertainty_of_plants(
        [control.frd(one, low), control.frd(other, high)], NOMINAL, order=3
    )
    assert model.omega == pytest.approx(OMEGA)
    assert model.contains(control.frd(one, low))
    assert model.contains(control.frd(other, high))


@pytest.mark.parametrize("dt", [0.0, 0.01])
def test_arrays_are_the_radius_as_they_are(dt):
    nominal = robust.sampled(NOMINAL, dt) if dt else NOMINAL
    radius = 0.1 + 0.02 * OMEGA
    model = robust.UncertaintyModel.from_radius(nominal, OMEGA, radius, order=2)
    assert model.radius == pytest.approx(radius)
    assert np.all(np.abs(response(model.weight, OMEGA)) >= radius * (1 - 1e-6))
    assert "given" in model.origin.source


def test_a_fitted_nominal_brings_its_delay_into_the_set():
    frf = control.frd(np.exp(-0.02j * OMEGA) * NOMINAL(1j * OMEGA), OMEGA)
    fit = robust.fit_nominal(frf, n_poles=1, delay="estimate")
    model = robust.UncertaintyModel.from_radius(fit, OMEGA, 0.1 + 0 * OMEGA, order=0, above="flat")
    assert model.origin.delay == pytest.approx(0.02, rel=1e-3)
    assert model.contains(frf)


@pytest.mark.parametrize(
    ("radius", "options", "expected"),
    [
        (-OMEGA, {}, "radius must be positive, one value for each"),
        (OMEGA[1:], {}, "radius"),
        (OMEGA, {"form": "coprime"}, "must not depend on the units"),
        (0.1 + 0 * OMEGA, {"order": 0}, 'mean excess .*above="flat"'),
        (0.1 + 0 * OMEGA, {"form": "input"}, "form must be"),
    ],
)
def test_what_is_no_radius_is_refused(radius, options, expected):
    with pytest.raises(ValueError, match=expected) as refused:
        robust.UncertaintyModel.from_radius(NOMINAL, OMEGA, radius, **options)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("given", "options", "expected"),
    [
        ([control.frd(plants()[0], OMEGA)], {"form": "coprime"}, "must not depend on the units"),
        (
            [control.frd(plants()[0], OMEGA)],
            {"weights": "full"},
            "weights and omega_B must be left",
        ),
        ([control.frd(plants()[0], OMEGA)], {"nominal": None}, "nominal must be given"),
        (plants(), {}, "must contain an FRF, .*UncertaintyModel\\(nominal, weight"),
        ([control.frd(NOMINAL, OMEGA)], {}, "none that differs"),
        ([control.frd(NOMINAL, OMEGA), 3.0], {}, "a list of systems or FRFs, got 3.0"),
        (control.frd(NOMINAL, OMEGA), {}, "plants must be a list of systems or FRFs"),
        ([], {}, "plants must be a list of systems or FRFs"),
    ],
)
def test_what_is_no_list_of_plants_is_refused(given, options, expected):
    with pytest.raises(ValueError, match=expected) as refused:
        robust.uncertainty_of_plants(given, **({"nominal": NOMINAL} | options))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("given", [(OMEGA, OMEGA), [], "bla.npz", control.frd(NOMINAL, OMEGA)])
def test_a_refusal_of_what_is_no_record_names_the_other_ways_to_a_set(given):
    with pytest.raises(
        ValueError,
        match=r"an nlfrf\.Bla or a list of them, got .*bla_from_frf.*uncertainty_of_plants\(plants"
        r".*UncertaintyModel\.from_radius",
    ) as refused:
        robust.uncertainty(given, NOMINAL)
    assert "\n" not in str(refused.value)
