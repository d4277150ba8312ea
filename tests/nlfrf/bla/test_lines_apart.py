"""A line that keeps step with a disturbance stands out of its neighbours; nothing else does."""

import warnings

import numpy as np
import pytest

from benchmarks import hum
from nlfrf import DataWarning, identify, record_from_samples
from nlfrf.bla.frf import warn_of_outlier_lines
from nlfrf.bla.line_index import index_lines
from nlfrf.bla.local_models import fit_locally, leave_one_out_residual
from nlfrf.signals import LineGrid

GRID = LineGrid(excited=np.sort(np.concatenate([np.arange(1, 401, 8), np.arange(3, 401, 8)])))
WHERE = index_lines(GRID)


def scattered(G, n, rng, sigma=0.02):
    noise = rng.standard_normal((n, G.size)) + 1j * rng.standard_normal((n, G.size))
    return G * (1 + sigma * noise / np.sqrt(2)), (sigma * np.abs(G)) ** 2


def test_what_neighbours_tell_of_a_parabola_is_the_line_itself():
    k = GRID.excited / 400
    apart, scatter, spread = leave_one_out_residual(1 + 2j * k - 3 * k**2, WHERE)
    np.testing.assert_allclose([np.abs(apart), scatter], 0, atol=1e-12)
    rng = np.random.default_rng(0)
    each, level = scattered(np.ones(k.size, dtype=complex), 3000, rng)
    found = np.array([leave_one_out_residual(G, WHERE)[:2] for G in each])
    np.testing.assert_allclose(np.mean(np.abs(found[:, 0]) ** 2, axis=0), spread * level, rtol=0.12)
    np.testing.assert_allclose(np.mean(found[:, 1].real, axis=0), level, rtol=0.1)


@pytest.mark.parametrize(
    "width", [0.0, 0.3, 1.0, 10.0], ids=lambda w: f"a mode {w:g} pairs of lines wide"
)
def test_chance_and_a_mode_that_lines_show_stand_out_nowhere(width):
    """A level three times too low is no reason: neighbours that scatter as much are."""
    s = 1j * GRID.excited / 199.0
    G = 1 + (0.3 / (s**2 + 4 * width / 199 * s + 1) if width else 0 * s)
    each, level = scattered(G, 500, np.random.default_rng(1))
    fits = fit_locally(each, np.ones(each.shape), index=WHERE).G
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert not any(
            warn_of_outlier_lines(
                one[None],
                fit[None],
                level=level / 3,
                index=WHERE,
                f=GRID.excited * 0.5,
                gamma=np.ones((1, 1)),
            ).any()
            for one, fit in zip(each, fits, strict=True)
        )


def test_hum_of_the_mains_is_named_and_held_and_little_else_changes():
    """20 % of the output at 50 Hz: G was 66 times its bound off there, without a word."""
    ms, us, ys, truth, rng = hum.records_of(lambda u, fs: u + 0.01 * u**3, 1, "special-odd")
    k = int(np.argmin(np.abs(ms.f - 50)))
    assert ms.f[k] == pytest.approx(50)
    u, y = np.tile(us[0], hum.P), np.tile(ys[0], hum.P)
    y = y + 0.003 * np.std(y) * rng.standard_normal(y.size)
    disturbed = y + np.std(y) * hum.hum(0.2, 50.0, rng)
    sound, told = (
        record_from_samples(u=u, y=one, fs=hum.FS, n_samples=hum.N, lines=ms.lines)
        for one in (y, disturbed)
    )
    before = identify(sound)
    with pytest.warns(
        DataWarning, match=r"differs from its neighbours at 50, 150 Hz.* mains of 50 Hz"
    ):
        after = identify(told)
    assert np.abs(after.G - truth)[k] > 20 * before.bound()[k]
    assert np.abs(after.G - truth)[k] < after.bound()[k]
    elsewhere = np.abs(ms.f - 50) > 10
    elsewhere &= np.abs(ms.f - 150) > 10
    # the roughness of windows with such a line is up to half pooled as distortion
    ratio = after.bound()[elsewhere] / before.bound()[elsewhere]
    assert np.median(np.abs(ratio - 1)) < 0.03
    assert np.all((ratio > 0.9) & (ratio < 1.5))


def test_plants_drawn_by_chance():
    """Sound records never; a hum of a fifth of the output in four records of five at least."""
    found = hum.attack(range(2), sizes=(0.2,), frequencies=(50.0,))
    assert not found[0.0, 0.0][:, 0].any()
    assert found[0.2, 50.0][:, 0].mean() >= 0.8


def test_the_first_line_above_the_corner_of_a_viscous_friction_is_no_outlier():
    """Of the belt preset in motion: lines 3, 9, 11, 17, ... of 1/(s (s + c/m)), corner at a quarter
    of the first.
    """
    lines = np.sort(np.concatenate([np.arange(3, 601, 8), np.arange(9, 601, 8)]))
    where, rng = index_lines(LineGrid(excited=lines)), np.random.default_rng(3)
    G, level = scattered(1 / (1j * lines * (1j * lines + 0.75)), 1, rng, sigma=1e-7)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fitted = fit_locally(G, np.ones(G.shape), index=where).G
        found = warn_of_outlier_lines(
            G, fitted, level=level, index=where, f=lines * 0.5, gamma=np.ones((1, 1))
        )
    assert not found.any()


@pytest.mark.parametrize("order", [1, 2])
def test_a_free_mass_stands_out_at_no_line_and_a_disturbed_line_of_it_does(order):
    """On lines 3, 9, 11, 17, ... its first one was 190 times its scatter from what the others
    say.
    """
    lines = np.sort(np.concatenate([np.arange(3, 401, 8), np.arange(9, 401, 8)]))
    where, rng = index_lines(LineGrid(excited=lines)), np.random.default_rng(2)
    G, level = scattered(1 / (1j * lines) ** order, 1, rng, sigma=1e-3)
    disturbed = G * np.where(np.arange(lines.size) == 50, 1.2, 1.0)
    arguments = {"level": level, "index": where, "f": lines * 1.0, "gamma": np.ones((1, 1))}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fitted = fit_locally(G, np.ones(G.shape), index=where).G
        assert not warn_of_outlier_lines(G, fitted, **arguments).any()
    fitted = fit_locally(disturbed, np.ones(G.shape), index=where).G
    with pytest.warns(DataWarning, match=f"neighbours at {lines[50]} Hz"):
        assert np.flatnonzero(warn_of_outlier_lines(disturbed, fitted, **arguments)).tolist() == [
            50
        ]
