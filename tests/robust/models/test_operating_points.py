"""One model from BLAs at several operating points: what lies between the points, what is paired,
what is refused.
"""

import control
import numpy as np
import pytest

import nlfrf
from robust.models import LpvModel, interpolate
from tests.support.responses import response

F = np.geomspace(2, 150, 120)
POINTS = np.array([-0.25, -0.08, 0.08, 0.25])


def gantry(p):
    """Two masses: spring +-30 %, force constant -+20 % over the range."""
    k, force = 4e4 * (1 + 1.2 * p), 1 - 0.8 * p
    A = [[0, 0, 1, 0], [0, 0, 0, 1], [-k / 2 - 50, k / 2, -10, 2], [k, -k - 500, 4, -8]]
    return control.ss(A, [[0], [0], [force / 2], [0]], [[1, 0, 0, 0]], 0)


def measured(plant, seed, noise=0.01):
    G = response(plant, 2 * np.pi * F)
    rng = np.random.default_rng(seed)
    noisy = G * (1 + noise * (rng.normal(size=F.size) + 1j * rng.normal(size=F.size)) / np.sqrt(2))
    return nlfrf.bla_from_frf(F, noisy, std=noise * np.abs(G))


@pytest.fixture(scope="module")
def model():
    blas = [measured(gantry(p), k) for k, p in enumerate(POINTS)]
    return interpolate(blas, at=POINTS, n_poles=4, degree=2, dt=1e-3, over="position", unit="m")


def test_the_plant_between_the_points_is_in_the_set(model):
    """Positions that were not measured: on every line the true plant lies within the weight."""
    omega = 2 * np.pi * F
    W = np.abs(response(model.weight, omega))
    for p in np.linspace(-0.25, 0.25, 21):
        error = np.abs(response(gantry(p), omega) / response(model.at(p), omega) - 1)
        assert np.max(error / W) < 1
    assert np.max(W) < 0.2, "and the set is no larger than the noise makes it"


def test_the_left_out_point_is_printed_in_units_of_the_weight(model):
    assert 0 < model.held_out < 1
    assert f"left-out point: {model.held_out:.2g} of the weight" in str(model)
    assert model.weight.dt == 1e-3
    assert model.dt == 0


def test_a_degree_that_is_too_low_shows_in_the_weight_and_the_left_out_point(model):
    blas = [measured(gantry(p), k) for k, p in enumerate(POINTS)]
    line = interpolate(blas, at=POINTS, n_poles=4, degree=0, dt=1e-3)
    omega = 2 * np.pi * F
    assert np.max(np.abs(response(line.weight, omega))) > 3 * np.max(
        np.abs(response(model.weight, omega))
    )


def test_two_real_poles_are_a_pair_and_one_more_a_section():
    def plant(p):
        slow, fast = 20 + 2 * p, 60 - 5 * p
        return control.ss(
            control.tf([slow * fast], [1, slow + fast, slow * fast])
            * control.tf([300 + 30 * p], [1, 300])
        )

    points = np.linspace(-1, 1, 5)
    blas = [measured(plant(p), k, 1e-3) for k, p in enumerate(points)]
    model = interpolate(blas, at=points, n_poles=3)
    omega = 2 * np.pi * F
    assert model.order == 3
    assert np.max(np.abs(response(plant(0.5), omega) / response(model.at(0.5), omega) - 1)) < 0.01


def test_modes_that_may_cross_are_refused():
    def plant(p):
        first, second = (200 + 120 * p) ** 2, (220 - 120 * p) ** 2
        return control.ss(control.tf([1], [1, 8, first]) + control.tf([1], [1, 8, second]))

    points = [-1.0, 0.0, 1.0]
    blas = [measured(plant(p), k, 1e-4) for k, p in enumerate(points)]
    with pytest.raises(
        ValueError,
        match=r"at must have more operating points between -1 and 0 mm: the modes at .* Hz",
    ):
        interpolate(blas, at=points, n_poles=4, degree=1, unit="mm")


BLAS = [measured(gantry(p), k) for k, p in enumerate(POINTS[:2])]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"at": [0.0]}, "at must be at least two operating points that increase, got one"),
        ({"at": [1.0, 0.0]}, "at must be at least two operating points that increase"),
        ({"at": [0.0, 1.0, 2.0]}, "at must have one operating point for each BLA, got 3 for 2"),
        ({"degree": 2}, "degree must be at most 1 for 2 operating points, got 2"),
        ({"blas": [BLAS[0], gantry(0.0)]}, "blas must be of type Bla"),
        (
            {"blas": [BLAS[0], nlfrf.bla_from_frf(F[:50], np.ones(50, complex), std=0.1)]},
            "blas must have the same lines",
        ),
        ({"over": "level"}, r"over must be a position, .* a BLA at a level is an average"),
        ({"form": "coprime"}, "form must be one of"),
        ({"dt": -1.0}, "dt must be zero or positive"),
    ],
)
def test_what_does_not_fit_is_refused(change, message):
    given = {"blas": BLAS, "at": [0.0, 1.0], "n_poles": 4, "degree": 1} | change
    with pytest.raises(ValueError, match=message):
        interpolate(given.pop("blas"), **given)


def test_the_model_is_an_lpv_model(model):
    assert isinstance(model, LpvModel)
    assert np.all(np.linalg.eigvals(model.at(0.1).A).real < 0)
