"""Whether a plant lies in a set at every frequency, by exact polynomials, against responses on
dense grids.
"""

import control
import numpy as np
import pytest

import robust
from tests.support.forms import FORMS
from tests.support.responses import response_by_channel

LAG = control.tf([1], [1, 1])
MIX = np.array([[1.0, 0.3], [-0.2, 1.0]])


def rotated(G, seed=0):
    """The same plant in coordinates in which nothing is zero any more."""
    T = np.random.default_rng(seed).normal(size=G.A.shape)
    return control.ss(T @ G.A @ np.linalg.inv(T), T @ G.B, G.C @ np.linalg.inv(T), G.D)


def pair(g1, g2, gains=(1.0, 1.0), seed=0):
    """diag(g1, g2) of two channels, mixed at the input."""
    G = control.append(control.ss(g1), control.ss(g2))
    return rotated(control.ss(G.A, G.B @ MIX, np.diag(gains) @ G.C, np.diag(gains) @ G.D), seed)


def zeros_at(w, z):
    return control.tf([1, 2 * z * w, w * w], np.polymul([1, 1], np.polymul([1, 8], [1, 8])))


def around(G, form, size=0.25, other=1.0):
    left, right = ((), (size,) * 4) if form == "elements" else ((size, size), (other, other))
    return robust.UncertaintyModel(
        G, form=form, left=left, right=right, omega=np.geomspace(0.01, 100, 40), perturbation="LTI"
    )


@pytest.mark.parametrize(
    "form",
    [
        "additive",
        "input",
        "output",
        "inverse-additive",
        "inverse-input",
        "inverse-output",
        "elements",
    ],
)
def test_the_largest_delta_is_that_of_a_dense_grid_and_decides(form):
    """A light zero is moved by some of its width; strictly proper plants have no inverse-additive
    deviation.
    """
    lift = control.ss([], [], [], 0.2 * np.eye(2)) if form == "inverse-additive" else 0 * np.eye(2)
    G = control.ss(pair(zeros_at(2.0, 0.01), LAG) + lift)
    G_p = control.ss(pair(zeros_at(2.01, 0.012), LAG, (1.05, 0.95), seed=1) + lift)
    model = around(G, form)
    near = 2.0 * (1 + 0.01 * np.linspace(-8, 8, 4001))
    omega = np.concatenate([near, np.geomspace(1e-4, 1e4, 2000)])
    on = [np.moveaxis(response_by_channel(plant, omega), 2, 0) for plant in (G_p, G)]
    dense = model.normalized_distance(omega, *on).max()
    bounds = [deviation.bound(1.0, 1e-4) for deviation in model.deviations(G_p)]
    assert max(one.upper for one in bounds) == pytest.approx(dense, rel=1e-3)
    assert around(G, form, 0.25 * dense * 1.001).contains(G_p)
    assert not around(G, form, 0.25 * dense * 0.999).contains(G_p)


@pytest.mark.parametrize("form", ["input", "output", "inverse-input", "inverse-output"])
def test_poles_and_zeros_on_the_axis_at_zero_and_at_infinity_are_no_obstacle(form):
    """Integrator, undamped pair and undamped zero in random coordinates: 10 % of gain is 10 %."""
    for one in (
        control.tf([1], [1, 0]),
        control.tf([1], [1, 0, 4]),
        control.tf([1, 0, 4], [1, 3, 3, 1]),
    ):
        G, near, far = (pair(one, LAG, (k, k), seed) for seed, k in enumerate((1.0, 1.1, 1.3)))
        model = around(G, form, 0.12)
        assert model.contains(near)
        assert not model.contains(far)


def test_what_differs_only_far_outside_the_lines_lies_outside():
    G = pair(control.tf([1, 1e-10], [1, 1e-10]), LAG)
    below = pair(control.tf([1, -5e-10], [1, 1e-10]), LAG)  # -5 at zero frequency alone
    above = control.ss(pair(control.tf([1, 1], [1e-9, 1]) * LAG, LAG))  # flat from 1 to 1e9 rad/s
    for form in ("additive", "output"):
        model = around(G, form)
        assert np.all(model.distance(below) < 1e-6)
        assert not model.contains(below)
        assert not around(pair(LAG, LAG), form).contains(above)


def test_a_deviation_may_be_unstable_where_poles_are_as_many():
    G, moved, more = (pair(control.tf([1], [1, a]), LAG) for a in (-1.0, -1.05, 1.0))
    model = around(G, "output")
    assert [np.sum(plant.poles().real > 0) for plant in (G, moved, more)] == [1, 1, 0]
    assert model.contains(moved)
    assert not around(G, "output", 10.0).contains(more)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("dt", [0.0, 0.01])
def test_one_channel_says_what_its_form_says(form, dt):
    """A plant on the rim of the set lies inside, one beyond it or with a resonance between the
    lines does not.
    """
    G, w = control.ss(LAG), control.tf([0.2], [1])
    mode = control.ss(control.tf([0.005 * 25], [1, 2e-4 * 5, 25]))
    if dt:
        G, mode = (control.sample_system(x, dt, "bilinear") for x in (G, mode))
        w = control.ss([], [], [], [[0.2]], dt)
    model = robust.UncertaintyModel(G, w, form, np.array([0.1, 1.0, 3.0, 10.0]), perturbation="LTI")
    inside, beyond = (
        model.perturbed(control.ss([], [], [], [[size]], dt)) for size in (0.999, 1.02)
    )
    assert model.contains(inside)
    assert not model.contains(beyond)
    assert np.all(model.distance(G - mode) < 0.9)
    assert not model.contains(G - mode)


@pytest.mark.parametrize("form", ["multiplicative", "additive"])
def test_a_system_beside_an_frf_is_held_between_the_lines_too(form):
    omega = np.logspace(-1, 2, 30)
    resonant = LAG - control.tf([0.005 * 25], [1, 2e-2 * 5, 25])
    frf = control.frd(1.1 * LAG(1j * omega), omega)
    model = robust.uncertainty_of_plants([frf, resonant], LAG, form=form, perturbation="LTI")
    assert "systems inside at all frequencies, FRFs on their lines" in model.origin.source
    assert model.contains(frf)
    assert model.contains(resonant)
    near = 5 * (1 + 1e-2 * np.linspace(-5, 5, 2001))
    assert model.normalized_distance(near, resonant(1j * near), LAG(1j * near)).max() <= 1
    with pytest.raises(
        ValueError, match="an inverse if the number of poles in the right half plane differs"
    ):
        robust.uncertainty_of_plants([frf, control.tf([1], [1, -1])], LAG, form="multiplicative")


def test_systems_of_several_channels_beside_frfs_are_held_between_their_lines():
    omega = np.geomspace(0.1, 30, 25)
    G = pair(zeros_at(2.0, 0.05), LAG)
    frf = control.frd(pair(zeros_at(2.0, 0.05), LAG, (1.2, 1.1))(1j * omega), omega)
    moved = pair(zeros_at(2.01, 0.04), LAG)
    model = robust.uncertainty_of_plants([moved, frf], G, form="output", perturbation="LTI")
    assert "FRFs at their 25 lines and systems at all frequencies" in model.origin.source
    assert model.contains(moved)
    assert model.contains(frf)


@pytest.mark.parametrize("form", ["multiplicative", "additive", "inverse-multiplicative"])
def test_a_line_on_an_undamped_pole_of_the_nominal_is_compared_next_to_it(form):
    """G_p = 1.01 G and G are infinite at 1 rad/s; their ratio is not."""
    G, omega = control.tf([1.0], [1.0, 0.0, 1.0]), np.array([0.5, 1.0, 2.0])
    model = robust.UncertaintyModel(
        G, control.tf([0.1], [1]), form, omega, np.full(3, 0.05), perturbation="LTI"
    )
    found = model.distance(1.01 * G)
    wanted = {
        "multiplicative": 0.1,
        "inverse-multiplicative": 0.1 / 1.01,
        "additive": 0.1 * np.abs(1 / (1 - omega**2 + [0, 2e-9, 0])),
    }[form]
    np.testing.assert_allclose(found, np.broadcast_to(wanted, 3), rtol=1e-5)
    if form == "multiplicative":
        assert all(model.contains(plant) for plant in model.sample(3, rng=0))
