"""A matrix at several levels: one nominal, one set that holds what each level asks for."""

import warnings
from functools import cache

import numpy as np
import pytest

import nlfrf
import robust

LOW, HIGH = 1.0, 4.0  # N


@cache
def measured(rms, seed, f_min=2):
    band = {"fs": 512, "n_samples": 1024, "f_min": f_min, "f_max": 100, "n_inputs": 2}
    ms = nlfrf.multisine("random-odd", **band, rms=rms, rng=seed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", nlfrf.DataWarning)
        record = nlfrf.simulate(
            nlfrf.rig.two_axis_stage(), ms, n_periods=2, n_discard=3, oversampling=4, hold="zoh"
        )
        return nlfrf.identify(record)


@cache
def fitted(dt=1 / 512):
    return robust.fit_nominal([measured(LOW, 1), measured(HIGH, 2)], n_poles=4, dt=dt)


@cache
def around(form):
    return robust.uncertainty([measured(LOW, 1), measured(HIGH, 2)], fitted(), form=form)


def test_one_nominal_lies_between_the_levels():
    alone = [robust.fit_nominal(frm, n_poles=4) for frm in (measured(LOW, 1), measured(HIGH, 2))]
    both = fitted(0.0)
    first = [
        np.abs(fit.G.poles()).min() for fit in (alone[1], both, alone[0])
    ]  # friction sticks at the low level
    assert first == sorted(first)
    assert (
        both.response.shape == both.residual.shape == (2, 2, sum(fit.omega.size for fit in alone))
    )
    assert both.hold == "zoh"


def test_the_nominal_of_one_matrix_twice_is_that_of_it_once():
    once, twice = (
        robust.fit_nominal([measured(LOW, 1)] * n, n_poles=4, delay="estimate") for n in (1, 2)
    )
    np.testing.assert_allclose(
        np.sort_complex(twice.G.poles()), np.sort_complex(once.G.poles()), rtol=1e-5
    )
    assert twice.cost == pytest.approx(2 * once.cost, rel=1e-6)


@pytest.mark.attack
def test_the_elements_are_the_widest_of_all_levels():
    alone = [robust.uncertainty(measured(*level), fitted()) for level in ((LOW, 1), (HIGH, 2))]
    both = around("elements")
    for one in alone:
        there = np.isin(both.omega, one.omega)
        assert there.sum() == one.omega.size
        assert np.all(both.radius[:, there] >= one.radius * (1 - 1e-12))
    nearest = np.min(
        [np.interp(both.omega, one.omega, one.radius.max(axis=0)) for one in alone], axis=0
    )
    assert np.median(both.radius.max(axis=0) / nearest) < 5
    assert both.origin.source.count("random-odd multisine") == 2
    assert both.joint.frf == min(both.joint.frf, 1.0) > 0.5


@pytest.mark.attack(every=4)
@pytest.mark.parametrize("form", ["additive", "input"])
@pytest.mark.parametrize("level", [(LOW, 1), (HIGH, 2)])
def test_every_plant_that_one_level_allows_is_in_the_block_of_all(form, level):
    both, rng = around(form), np.random.default_rng(0)
    one = robust.uncertainty(measured(*level), fitted(), form=form)
    omega, radius, n = one.omega, one.radius, len(one.left)
    z = np.exp(1j * omega / 512)
    G = np.moveaxis(np.asarray(one.nominal(z, squeeze=False)), 2, 0)
    draws = rng.standard_normal((omega.size, n, 2)) + 1j * rng.standard_normal((omega.size, n, 2))
    Delta = draws / np.linalg.norm(draws, 2, axis=(1, 2))[:, None, None]
    # on the lines, before any weight
    block = radius[:n].T[:, :, None] * Delta * radius[n:].T[:, None]
    away = block if form == "additive" else G @ block
    assert np.max(both.normalized_distance(omega, (G + away)[None], G)) <= 1 + 1e-9


@pytest.mark.attack(every=3)
@pytest.mark.parametrize("form", ["elements", "additive", "input", "auto"])
def test_new_sets_at_either_level_are_held(form):
    for rms, seed in ((LOW, 11), (HIGH, 12)):
        found = robust.validate(around(form), measured(rms, seed))
        assert found.n_outside_set <= 0.05 * found.n_lines
        assert found.p_value > 1e-3  # held against the level it is of
    strange = robust.validate(
        around(form), measured(2.0, 13)
    )  # a level in between is none that was measured
    assert np.isfinite(strange.p_value)


def test_lines_that_only_one_level_has_are_in_the_set():
    both = robust.uncertainty([measured(LOW, 1), measured(HIGH, 2, 20)], fitted(), order=2)
    assert both.omega[0] == measured(LOW, 1).omega[0]
    assert both.omega.size > measured(HIGH, 2, 20).omega.size
    assert np.isfinite(both.radius).all()


@pytest.mark.parametrize("form", ["elements", "auto"])
def test_it_comes_back_from_its_file(form, tmp_path):
    robust.save(around(form), tmp_path / "m.json")
    back = robust.load(tmp_path / "m.json")
    assert len(back.records) == 2
    frm = measured(HIGH, 12)
    one, other = robust.validate(around(form), frm), robust.validate(back, frm)
    assert (one.p_value, one.change.level) == (other.p_value, other.change.level)


def test_a_picture_shows_both(tmp_path):
    made = robust.plot.plot_set(around("elements"), [measured(LOW, 1), measured(HIGH, 2)])
    labels = [line.get_label() for line in made[0, 0].get_lines()]
    assert {"measured, 95 % bound (1)", "measured, 95 % bound (2)"} <= set(labels)


def test_orders_are_scanned_over_both():
    scan = robust.models.scan_orders([measured(LOW, 1), measured(HIGH, 2)], n_poles=(2, 4))
    assert scan.best == 4


def test_refusals():
    bla = measured(LOW, 1).entry(0, 0)
    with pytest.raises(
        ValueError,
        match=r"bla must be an nlfrf\.Bla of several inputs or outputs, got one of one input",
    ):
        robust.uncertainty([measured(LOW, 1), bla], fitted())
    with pytest.raises(
        ValueError,
        match=r"bla must be an nlfrf\.Bla of several inputs or outputs, got one of one input",
    ):
        robust.fit_nominal([bla, measured(LOW, 1)], n_poles=2)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", nlfrf.DataWarning)
        ms = nlfrf.multisine(
            "random-odd", fs=512, n_samples=512, f_min=2, f_max=100, n_inputs=2, rng=1
        )
        u = np.repeat(ms.u[:, :, None], 2, axis=2)
        other = nlfrf.identify(
            nlfrf.Record(u=u, y=u + 0.1 * u**3, fs=512, lines=ms.lines, inputs=("a", "b"))
        )
    with pytest.raises(
        ValueError, match="bla must be matrices of the same inputs, got Fx, Fy and a, b"
    ):
        robust.fit_nominal([measured(LOW, 1), other], n_poles=2)
