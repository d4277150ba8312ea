"""Exact counts of a cubic's output on excited and detection lines."""

import itertools

import numpy as np
import pytest

from benchmarks.plants import played, wiener
from nlfrf import multisine
from nlfrf.bla.calibration import (
    crest_correction,
    cubic_variance,
    variance_ratio,
)
from nlfrf.bla.distortion import cubic_count_ratios
from nlfrf.bla.line_index import index_lines
from nlfrf.signals import LineGrid

LINES = np.array([1, 3, 9, 11, 17, 19])


def cubic_bla(amplitude):
    """The best linear approximation of y = u^3 on the excited lines: 3 sigma^2 - 3/4 A_k^2."""
    return 3 * np.sum(amplitude**2) / 2 - 0.75 * amplitude**2


def test_exact_numbers_of_the_special_odd_grid():
    np.testing.assert_allclose(
        cubic_variance(np.ones(6), LINES, LINES),
        [12.9375, 10.1875, 14.125, 12.375, 8.4375, 8.4375],
        rtol=1e-12,
    )
    np.testing.assert_allclose(
        cubic_variance(np.ones(6), LINES, np.array([5, 7, 13, 15])),
        [15.75, 17.4375, 12.9375, 11.25],
        rtol=1e-12,
    )
    np.testing.assert_allclose(cubic_bla(np.ones(6)), 8.25)


def test_counts_equal_brute_force_over_all_triples():
    rng = np.random.default_rng(1)
    excited = np.array([1, 3, 5, 9, 15])
    amplitude = rng.uniform(0.5, 2, excited.size)
    half = dict(zip(excited.tolist(), amplitude / 2, strict=True))
    signed = {s * k: a for k, a in half.items() for s in (1, -1)}
    lines = np.arange(1, 48, 2)  # beyond the band too, up to where there is nothing
    expected = []
    for k in lines:
        # sum the contributions of equal phase (same multiset of signed lines) coherently, then
        # square
        phases: dict[tuple[int, ...], float] = {}
        for triple in itertools.product(signed, repeat=3):
            if sum(triple) == k:
                rest = sorted(triple)
                cancelled = next((j for j in rest if j > 0 and -j in rest), None)
                key = (k,) if cancelled is not None and k in signed else tuple(rest)
                phases[key] = phases.get(key, 0.0) + np.prod([signed[j] for j in triple])
        phases.pop((k,), None)  # the coherent part is the BLA
        expected.append(4 * sum(total**2 for total in phases.values()))
    np.testing.assert_allclose(
        cubic_variance(amplitude, excited, lines), expected, rtol=1e-11, atol=1e-12
    )


def test_narrow_band_special_odd_under_reads_by_three_and_odd_odd_without_limit():
    for kind, factor in (("special-odd", 3.0), ("odd-odd", np.inf)):
        grid = multisine(kind, fs=65536, n_samples=65536, f_min=15000, f_max=15400, rng=0).lines
        where = index_lines(grid)
        ratio = variance_ratio(
            np.ones(grid.excited.size),
            grid.excited,
            detection=where.detection,
            window=where.odd_windows,
        )
        middle = ratio[ratio.size // 3 : -ratio.size // 3]
        np.testing.assert_allclose(middle, factor, rtol=0.05)


def test_random_odd_needs_no_factor():
    grid = multisine("random-odd", fs=4096, n_samples=4096, f_min=1, f_max=1600, rng=0).lines
    where = index_lines(grid)
    ratio = variance_ratio(
        np.ones(grid.excited.size),
        grid.excited,
        detection=where.detection,
        window=where.odd_windows,
    )
    assert abs(10 * np.log10(ratio.mean())) < 0.1


def test_lines_below_the_band_detect_too():
    """One-sided windows read a level that falls with frequency too low on the first lines:

    72 % of a 95 % bound.
    """
    assert index_lines(LineGrid(excited=[9, 11, 17, 19])).detection.tolist() == [5, 7, 13, 15]
    assert index_lines(LineGrid(excited=[3, 9, 11])).detection.tolist() == [
        5,
        7,
    ]  # within an octave
    assert index_lines(LineGrid(excited=[9, 11, 17, 19], odd=[13, 15][1:])).detection.tolist() == [
        15
    ]  # as chosen
    assert index_lines(LineGrid(excited=[9, 11, 13])).detection.tolist() == []
    where = index_lines(LineGrid(excited=[9, 11, 17, 19]))
    assert where.lines[where.odd].tolist() == [13, 15]


def test_a_plant_driven_by_its_output_is_read_as_one():
    """Behind a mode the exact count of a cubic is that of the output's spectrum: within 0.3 dB, not
    9.
    """
    rng = np.random.default_rng(1)
    ms = multisine("special-odd", fs=1024, n_samples=1024, f_min=10, f_max=200, rng=rng)
    u, y = played(ms, wiener, 3000, rng)
    k, where = ms.lines.excited, index_lines(ms.lines)
    U, Y = (np.fft.rfft(x) * 2 / ms.n_samples for x in (u, y))
    G = np.mean(Y[:, k] / U[:, k], axis=0)
    there = np.mean(np.abs(Y[:, k] - G * U[:, k]) ** 2, axis=0)
    detected = np.mean(np.abs(Y[:, where.detection]) ** 2, axis=0)
    amplitude = np.abs(U[0, k])
    by_input, by_output = (
        cubic_count_ratios(drive, where, 12.0) for drive in (amplitude, np.abs(G) * amplitude)
    )
    inside = slice(2, -2)  # but for the clipped ends of the profile
    near = detected[where.odd_windows].T
    told = np.array(
        [factor * np.mean(near / relative, axis=0) for relative, factor in (by_input, by_output)]
    )
    wrong = 10 * np.log10(told / there)[:, inside]
    assert np.median(np.abs(wrong[1])) < 0.3 < 5 < np.median(np.abs(wrong[0]))


def test_the_moments_of_a_sum_of_cosines_are_those_of_many_draws():
    """So that the cube of a realisation is held against those of its own spectrum."""
    rng = np.random.default_rng(2)
    k, amplitude = np.array([3, 5, 9, 10, 15]), np.array([1.0, 0.5, 2.0, 1.5, 1.0])
    U = amplitude * np.exp(2j * np.pi * rng.random((20000, 5)))
    assert crest_correction(U, k, low=False)[0] == pytest.approx(
        1, abs=0.06
    )  # the square of a ratio


@pytest.mark.parametrize(
    ("n", "least", "most"), [(20, 0.6, 6.0), (26, 0.6, 6.0), (27, 1.0, 3.0), (500, 1.0, 3.0)]
)
def test_high_peaks_are_the_most_distorted_and_low_ones_the_least(n, least, most):
    """Of few lines high peaks are chance as low ones are, and a fifth power is allowed for."""
    k = np.arange(n)
    high, low = np.ones((1, n)), np.exp(1j * np.pi * k**2 / n)[None]
    assert crest_correction(high, k + 1, low=False)[0] == least
    assert crest_correction(low, k + 1, low=True)[0] == most


def test_of_few_lines_a_fifth_power_asks_for_what_is_allowed():
    """A fifth power, many times: what scatters of it about its mean gain, over that of the
    realisation at hand.
    """
    rng, k, n = np.random.default_rng(4), np.arange(1, 27), 512

    def left(phase):
        u = np.cos(2 * np.pi * np.outer(np.arange(n) / n, k) + phase).sum(axis=1)
        power, square = u**5, u * u
        return np.mean(power**2) - np.mean(power * u) ** 2 / np.mean(square)

    phases = rng.uniform(0, 2 * np.pi, (400, 26))
    distorts = np.log([left(phase) for phase in phases])
    told = np.log([crest_correction(np.exp(1j * phase)[None], k, low=False)[0] for phase in phases])
    inside = np.abs(told) < 0.5  # away from the limits
    assert np.polyfit(told[inside], distorts[inside], 1)[0] == pytest.approx(-1, abs=0.1)


def test_of_many_lines_the_common_gain_counts_where_peaks_are_low_and_chance_where_they_are_usual():
    k = np.arange(1, 101)
    U = np.exp(1j * np.pi * k**2 / 100 + 0.5j * np.random.default_rng(0).standard_normal((7, 100)))
    chance = 8 / 3 / 100
    assert crest_correction(U, k, low=False) == (1.0, chance)
    typical, common = crest_correction(U, k, low=True)
    assert common > chance
    assert typical > 1
    for phases in U:  # alone they are looked at whatever their peaks, as a cubic asks for it
        once, nothing = crest_correction(phases[None], k, low=False)
        assert nothing == chance
        assert min(once**2, 3) == pytest.approx(crest_correction(phases[None], k, low=True)[0])


def test_the_common_gain_of_many_realisations_is_that_of_a_cube():
    """The gain that phases at hand give a cube on all lines, about that of random phases, told for
    their mean.
    """
    rng, k, n = np.random.default_rng(3), np.arange(1, 33), 512
    t = 2 * np.pi * np.outer(np.arange(n) / n, k)
    drawn = [rng.uniform(0, 2 * np.pi, (5, 32)) for _ in range(7)]
    phase = np.array(
        [min(one, key=lambda x: np.abs(np.cos(t + x).sum(axis=1)).max()) for one in drawn]
    )
    U = np.exp(1j * phase)
    u = np.cos(t + phase[:, None]).sum(axis=2)
    gap = np.mean(np.mean(u**4, axis=1) / np.mean(u**2, axis=1)) - np.mean(cubic_bla(np.ones(32)))
    G = 2 / n * np.fft.rfft(u**3)[:, k] / U
    scatter = np.mean(np.abs(G - G.mean(axis=1, keepdims=True)) ** 2)
    _typical, common = crest_correction(U, k, low=True)
    told = common * scatter / 7 / 1.25  # of the mean; a quarter more is allowed
    assert gap < 0
    assert told == pytest.approx(gap**2, rel=0.25)
    square = np.exp(-1j * np.pi * k**2 / 32)[
        None
    ]  # what is more was chosen: such a BLA is that of the signal
    assert crest_correction(np.repeat(square, 7, axis=0), k, low=True) == (3.0, 1.0)


@pytest.mark.parametrize("at", [[1, 3, 9], [40, 41], [100]])
def test_nearest_lines_are_the_nearest(at):
    lines = (8 * np.arange(20)[:, None] + [5, 7]).ravel()
    where = index_lines(LineGrid(excited=at, odd=lines[~np.isin(lines, at)]))
    for k, window in zip(at, where.odd_windows, strict=True):
        farthest = np.sort(np.abs(where.detection - k))[5]
        assert np.abs(where.detection[window] - k).max() == farthest
        assert np.unique(window).size == 6


@pytest.mark.parametrize("lines", [[1], [5, 7], [5, 9, 11]])
def test_lines_that_no_three_of_them_meet_on_have_a_finite_share(lines):
    """A cubic scatters nothing onto them, and its share was divided by that."""
    k = np.array(lines)
    assert np.all(cubic_variance(np.ones(k.size), k, k) == pytest.approx(0, abs=1e-12))
    ratio, share = crest_correction(np.ones((1, k.size), dtype=complex), k, low=False)
    assert 0.6 <= ratio <= 6
    assert share == 1
