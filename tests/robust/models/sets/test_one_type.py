"""One type for any number of channels: what holds for one holds for several, in memory and in
files.
"""

from dataclasses import fields, is_dataclass

import control
import numpy as np
import pytest

import nlfrf
import robust
from tests.support.responses import response, response_by_channel

LAG = control.ss(control.tf([2], [0.01, 1]))
G = control.append(LAG, 0.5 * LAG) + control.ss([], [], [], [[0, 0.1], [0.05, 0]])


def record(n_inputs, seed=1):
    """A plant of one or two channels with a weak cube, on a random-odd grid."""
    ms = nlfrf.multisine(
        "random-odd", fs=256, n_samples=512, f_min=2, f_max=60, n_inputs=n_inputs, rng=seed
    )
    u = np.repeat(np.atleast_3d(ms.u).reshape(n_inputs, -1, 1, 512), 2, axis=2)
    plant = G if n_inputs > 1 else LAG
    spectrum = np.fft.rfft(u + 0.03 * u**3)
    frf = response_by_channel(plant, 2 * np.pi * np.arange(257) / 2)
    y = np.fft.irfft(np.einsum("jik,impk->jmpk", frf, spectrum), 512)
    y += 3e-3 * y.std() * np.random.default_rng(seed).standard_normal(y.shape)
    return nlfrf.Record(
        u=u,
        y=y,
        fs=256,
        lines=ms.lines,
        inputs=("Fx", "Fy")[:n_inputs],
        outputs=("x", "y")[:n_inputs],
    )


@pytest.fixture(
    scope="module", params=["multiplicative", "coprime", "elements", "additive", "auto"]
)
def model(request):
    several = request.param in ("elements", "additive", "auto")
    bla = nlfrf.identify(record(2 if several else 1), transient="none")
    return robust.uncertainty(bla, G if several else LAG, form=request.param, order=2)


def test_the_names_of_before_are_names_of_it():
    assert robust.UncertaintyModel is robust.UncertaintyModel
    assert robust.RobustnessReport is robust.RobustnessReport
    assert robust.models.Validation is robust.models.Validation


def equal(one, other):
    """Whether two fields hold the same, to the bit."""
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(equal, one, other))
    if isinstance(one, control.StateSpace):
        return one.dt == other.dt and all(
            np.array_equal(getattr(one, m), getattr(other, m)) for m in "ABCD"
        )
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(
            equal(part, other[name]) for name, part in one.items()
        )
    if is_dataclass(one):
        return all(equal(getattr(one, f.name), getattr(other, f.name)) for f in fields(one))
    if isinstance(one, np.ndarray | float):
        return np.array_equal(one, other, equal_nan=True)
    return one == other


def test_every_field_comes_back_from_a_file(model, tmp_path):
    robust.save(model, tmp_path / "m.json")
    back = robust.load(tmp_path / "m.json")
    different = [
        f.name for f in fields(model) if not equal(getattr(model, f.name), getattr(back, f.name))
    ]
    assert not different
    robust.save(back, tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == (tmp_path / "m.json").read_bytes()


def test_the_budget_adds_up_to_the_radius(model):
    parts = model.budget
    if not parts:
        assert model.form == "additive"  # of a full block no part is known
        return
    assert all(part.shape == model.radius.shape for part in parts.values())
    np.testing.assert_allclose(sum(parts.values()), model.radius, rtol=1e-9)


def test_plants_of_a_set_are_in_it_and_far_ones_are_not(model):
    for plant in model.sample(4, rng=0):
        assert model.contains(plant)
    assert model.distance(model.nominal).max() < 1e-9
    assert not model.contains(3 * model.nominal)
    assert (model.inputs, model.outputs) == (
        ("Fx", "Fy")[: model.n_inputs],
        ("x", "y")[: model.n_outputs],
    )


@pytest.mark.parametrize(
    ("form", "left", "right", "single"),
    [
        ("elements", (), (0.3,), "additive"),
        ("additive", (0.2,), (1.5,), "additive"),
        ("input", (0.2,), (0.5,), "multiplicative"),
    ],
)
def test_a_matrix_of_one_entry_is_a_set_of_one_channel(form, left, right, single):
    """With the plants that it had: G + w_l Delta w_r and G (1 + w_l Delta w_r)."""
    omega, size = np.array([1.0, 5.0]), float(np.prod([*left, *right]))
    weights = {
        side: tuple(control.ss([], [], [], [[x]]) for x in xs)
        for side, xs in (("left", left), ("right", right))
    }
    radius = np.array([[x, x] for x in (*left, *right)])
    one = robust.UncertaintyModel(nominal=LAG, form=form, omega=omega, radius=radius, **weights)
    assert (one.is_single, one.form, one.left, one.right) == (True, single, (), ())
    np.testing.assert_allclose(one.radius, size)
    np.testing.assert_allclose(np.abs(response(one.weight, omega)), size)
    at = LAG(1j)
    wanted = at + size * 0.4 if single == "additive" else at * (1 + size * 0.4)
    np.testing.assert_allclose(one.perturbed(0.4)(1j), wanted)


def test_what_only_several_channels_have_names_what_to_take(model):
    if not model.is_single:
        return
    for call in (model.open_loop, lambda: model.entry_radius(model.omega), lambda: model.loop(1.0)):
        with pytest.raises(
            ValueError, match=r"model must have several channels to .*, got one input"
        ):
            call()


def test_a_record_is_held_against_a_record_of_one_channel_too():
    first, second = (nlfrf.identify(record(1, seed), transient="none") for seed in (1, 2))
    seen = robust.validate(first, second)
    assert np.isnan(seen.distance).all()
    assert seen.p_value > 1e-3
    assert robust.validate(first, first).p_value == 1.0
