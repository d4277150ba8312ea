"""Over few lines one rational function tells the roughness of an FRF from its bend."""

import numpy as np
import pytest

from nlfrf.bla.line_index import index_lines
from nlfrf.bla.local_models import fit_locally
from nlfrf.signals import LineGrid

LINES = np.arange(5, 30, 2)  # thirteen
N = 400


def scattered(G, follows, rng, sigma=0.02):
    """(N, F) FRFs that scatter about G by sigma, of |G| or of its rms."""
    scale = np.abs(G) if follows else np.sqrt(np.mean(np.abs(G) ** 2))
    noise = rng.standard_normal((N, G.size)) + 1j * rng.standard_normal((N, G.size))
    return G + sigma * scale * noise / np.sqrt(2), (sigma * scale) ** 2 * np.ones(G.size)


def resonance(zeta, line=17.0):
    s = 1j * LINES / line
    return 1 / (s**2 + 2 * zeta * s + 1)


@pytest.mark.parametrize(
    ("follows", "most"), [(True, 1.2), (False, 1.4)], ids=["follows |G|", "flat"]
)
@pytest.mark.parametrize("zeta", [0.03, 0.1])
def test_a_mode_a_line_wide_is_no_roughness(follows, most, zeta):
    """Windows read a mode as 7 dB of roughness on half of the lines, beside scatter that is flat as
    3 dB.
    """
    each, known = scattered(resonance(zeta), follows, np.random.default_rng(1))
    fit = fit_locally(each, np.ones(each.shape), index=index_lines(LineGrid(excited=LINES)))
    ratio = np.sqrt(np.mean(fit.variance / known, axis=0))
    assert np.all(ratio > 0.85)
    assert np.median(ratio) < most


def test_without_a_mode_the_windows_are_left_as_they_are():
    """What chance alone lets a rational function explain costs the level no more than 3 %."""
    each, known = scattered(np.ones(LINES.size, dtype=complex), True, np.random.default_rng(2))
    fit = fit_locally(each, np.ones(each.shape), index=index_lines(LineGrid(excited=LINES)))
    mean = fit.variance.mean() / known.mean()
    assert 0.97 - 3 / np.sqrt(6 * N) < mean < 1 + 3 / np.sqrt(6 * N)


def test_two_modes_are_found_exactly_and_their_scatter_by_the_degrees_of_freedom_left():
    s = 1j * LINES
    G = 1 / (s**2 + 0.8 * s + 121) + 2 / (s**2 + 1.2 * s + 400)
    where = index_lines(LineGrid(excited=LINES))
    fit = fit_locally(G[None], np.ones((1, G.size)), index=where)
    np.testing.assert_allclose(fit.G[0], G, rtol=1e-6)
    rng = np.random.default_rng(1)
    ratios = []
    for _ in range(3):
        each, known = scattered(G, True, rng, sigma=1e-3)
        ratios.append(fit_locally(each, np.ones(each.shape), index=where).variance / known)
    # nine real coefficients are taken from thirteen complex lines: half a one more or less is 6 %
    assert 0.99 < np.median(ratios) < 1.06


@pytest.mark.parametrize("scale", [1e-60, 1e60])
def test_the_unit_of_an_frf_does_not_matter(scale):
    each, _ = scattered(resonance(0.05), True, np.random.default_rng(3))
    where, ones = index_lines(LineGrid(excited=LINES)), np.ones(each.shape)
    one, other = fit_locally(each, ones, index=where), fit_locally(scale * each, ones, index=where)
    np.testing.assert_allclose(other.variance / scale**2, one.variance, rtol=1e-6)


@pytest.mark.parametrize(
    "G", [np.zeros(13, dtype=complex), np.ones(13, dtype=complex)], ids=["zero", "one"]
)
def test_an_frf_without_dynamics_or_scatter_has_no_roughness(G):
    fit = fit_locally(G[None], np.ones((1, 13)), index=index_lines(LineGrid(excited=LINES)))
    assert np.all(fit.variance < 1e-28)
    np.testing.assert_allclose(fit.G[0], G, atol=1e-14)


def test_two_modes_are_found_exactly_if_they_are_stable():
    """Windows alone do not describe four poles."""
    rng, where = np.random.default_rng(4), index_lines(LineGrid(excited=LINES))
    s = 1j * LINES / np.sqrt(LINES[0] * LINES[-1])
    stable = []
    for given in range(300):
        if given % 2:
            a = rng.uniform(-0.2, 2, 4)
        else:  # each pair of poles may be unstable
            (b, c), (d, e) = rng.uniform([-0.3, 0.2], [1, 2], (2, 2))
            a = np.array([b + d, c + e + b * d, b * e + c * d, c * e])
        G = 1 / (1 + s[:, None] ** np.arange(1, 5) @ a)
        fit = fit_locally(G[None], np.ones((1, G.size)), index=where)
        stable.append(bool((np.roots([*a[::-1], 1.0]).real < 0).all()))
        assert (np.abs(fit.G[0] / G - 1).max() < 1e-12) == stable[-1]
    assert 50 < sum(stable) < 250


@pytest.mark.parametrize(
    "grid", [LINES, np.sort(np.concatenate([np.arange(5, 200, 8), np.arange(7, 200, 8)]))]
)
@pytest.mark.parametrize("noise", [None, 1e-5])
def test_a_spectrum_that_is_flat_is_fitted_as_one_that_hardly_is_not(grid, noise):
    """Of a flat one the grid tells the fits, of any other the weights do: both are the same
    mathematics.
    """
    rng = np.random.default_rng(4)
    where, s = index_lines(LineGrid(excited=grid)), 1j * grid / 60.0
    G = (
        1 / (s**2 + 0.04 * s + 1)
        + 0.01 * rng.standard_normal((3, grid.size, 2)).view(complex)[..., 0]
    )
    known = None if noise is None else np.full(G.shape, noise)
    tilted = 2.5 + 1e-7 * np.linspace(-1, 1, grid.size)
    flat, other = (
        fit_locally(G, np.broadcast_to(w, G.shape), index=where, noise=known)
        for w in (np.full(grid.size, 2.5), tilted)
    )
    np.testing.assert_allclose(flat.G, other.G, rtol=1e-5)
    np.testing.assert_allclose(flat.variance, other.variance, rtol=1e-4)
    np.testing.assert_array_equal(flat.dof, other.dof)
