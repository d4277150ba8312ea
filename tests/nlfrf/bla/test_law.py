"""The law that the phases of the detection lines tell, and what the bound makes of it."""

import re
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.coverage import measure_hard
from benchmarks.plants import PLANTS, mode, played
from nlfrf import Record, identify, multisine, second_opinion
from nlfrf.bla import detection_lines
from nlfrf.bla.detection_lines import UNTOLD, is_uneven, nonlinear_answer, powers_on, told_law
from nlfrf.bla.distortion_level import level_from_detection, smooth_frf
from nlfrf.bla.frf import average_frf
from nlfrf.bla.neighbours import place_lines
from nlfrf.bla.spectra import period_spectra

DESIGN = dict(fs=1024, n_samples=1024, f_min=3, f_max=170)


def law_of(u, y, ms, n_periods=1, noise=0.0, rng=None):
    """The law of one record of realisations u and y (M, N)."""
    shape = (len(u), n_periods, u.shape[1])
    y = np.broadcast_to(y[:, None], shape)
    if noise:
        y = y + noise * rng.standard_normal(shape)
    record = Record(u=np.broadcast_to(u[:, None], shape), y=y, fs=ms.fs, lines=ms.lines)
    spectra, _ = period_spectra(record, place_lines(ms.lines))
    excited = spectra.on_excited()
    smooth, _fit = smooth_frf(average_frf(excited), excited, rough=False)
    return told_law(excited, nonlinear_answer(spectra, smooth))


def laws_of(plant, n=20, M=1, design=DESIGN, kind="special-odd", **how):
    """The laws of n records of a plant."""
    rng = np.random.default_rng(5)
    ms = multisine(kind, **design, rng=rng)
    u, y = played(ms, plant, n * M, rng)
    return [law_of(u[i : i + M], y[i : i + M], ms, rng=rng, **how) for i in range(0, n * M, M)]


def beside(u, fs):
    """A mode, and beside it a cubic of the input."""
    return mode(u, fs, 0.1, 40.0) + 0.05 * u**3


@pytest.mark.parametrize("kind", ["special-odd", "random-odd"])
@pytest.mark.parametrize(
    ("plant", "reading"),
    [(PLANTS["Hammerstein"], 0), (PLANTS["Duffing"], 1), (beside, 2), (PLANTS["Wiener"], 3), (PLANTS["sensor"], 3)],
    ids=["before a mode", "its spring", "beside it", "behind it", "a sensor that saturates"],
)
def test_one_record_tells_what_drives_a_cubic_and_where_it_stands(plant, reading, kind):
    laws = laws_of(plant, kind=kind)
    assert [law.reading for law in laws] == [reading] * len(laws)
    assert np.median([law.coherence for law in laws]) > 0.85
    assert np.mean([law.share > 0.6 for law in laws]) > 0.3  # of a spring a fifth power has nearly as much
    assert all(law.order != 1 for law in laws)


@pytest.mark.parametrize("plant", ["fifth", "quintic", "behind"])
def test_a_fifth_power_is_no_cubic(plant):
    laws = laws_of(PLANTS[plant])
    assert sum(law.order == 5 for law in laws) >= 18
    assert all(law.share == 0 for law in laws)


@pytest.mark.parametrize("plant", ["jump", "backlash", "slipping", "one-sided", "one way", "between"])
def test_what_is_neither_counts_as_no_cubic(plant):
    laws = laws_of(PLANTS[plant])
    assert np.median([law.share for law in laws]) == 0
    assert max(law.share for law in laws) < 0.35
    assert all(law.order != 5 for law in laws)
    if plant == "jump":
        assert all(law.order == 1 for law in laws)


def test_noise_and_an_even_law_tell_nothing():
    """Of 400 records of noise one in a hundred may agree with something; none counts."""
    laws = laws_of(PLANTS["linear"], n=400, noise=0.1)
    assert sum(law != UNTOLD for law in laws) < 12
    assert all(law.share == 0 for law in laws)
    assert all(law.share == 0 for law in laws_of(lambda u, fs: mode(u, fs, 0.1, 40.0) + u**2, n_periods=2, noise=1e-3))


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.03, 0.08])
def test_noise_that_is_known_makes_no_other_law_of_a_cubic(noise):
    """It may hide it: of 8 % noise at the output most records do not tell it, the others what it is."""
    laws = laws_of(PLANTS["Wiener"], n_periods=4, noise=noise)
    assert all(law.order != 1 for law in laws)
    assert all(law.reading == 3 for law in laws if law.share)
    if noise < 0.02:
        assert np.median([law.share for law in laws]) > 0.85


def test_realisations_tell_it_together():
    one, four = (laws_of(PLANTS["sensor"], M=M, n_periods=1, noise=0.05) for M in (1, 4))
    assert [law.reading for law in four] == [3] * 20
    assert np.std([law.coherence for law in four]) < np.std([law.coherence for law in one])


def test_it_does_not_depend_on_units():
    rng = np.random.default_rng(2)
    ms = multisine(**DESIGN, rng=rng)
    u, y = played(ms, PLANTS["Wiener"], 1, rng)
    plain = law_of(u, y, ms)
    for a, b in ((1e-20, 1e20), (1e30, 1e-30), (1e-40, 1e-40), (1e60, 1e60)):
        scaled = law_of(a * u, b * y, ms)
        assert (scaled.order, scaled.reading) == (plain.order, plain.reading)
        assert scaled.coherence == pytest.approx(plain.coherence, rel=1e-6)


def test_it_is_said_in_words():
    """With its place where there is one, and with the noise that one period does not tell."""
    (wiener,), (jumping,) = laws_of(PLANTS["Wiener"], n=1), laws_of(PLANTS["jump"], n=1)
    said = wiener.said(uneven=True, one_period=True)
    assert re.fullmatch(
        r"(9\d|100) % of .* the phases of the cube of the output, behind the dynamics as by a sensor", said
    )
    assert wiener.said(uneven=False, one_period=True).endswith("the cube of its drive")
    assert jumping.said(uneven=False, one_period=False).endswith("saturates or jumps, or has a memory")
    assert jumping.said(uneven=False, one_period=True).endswith("or much of them is noise")
    assert UNTOLD.said(uneven=True, one_period=True) == ""
    ms = multisine(**DESIGN, rng=4)
    u, y = played(ms, PLANTS["Wiener"], 1, np.random.default_rng(4))
    opinion = second_opinion(Record(u=u[:, None], y=y[:, None], fs=ms.fs, lines=ms.lines))
    assert opinion.law in str(opinion)
    assert "cube of the output, behind the dynamics" in opinion.law


def test_of_long_periods_few_realisations_are_asked(monkeypatch):
    """The third and fifth powers of all of them would take more memory than the record."""
    asked = []

    def noted(lines, drives, excited):
        asked.append(drives[0].shape[0])
        return powers_on(lines, drives, excited)

    monkeypatch.setattr(detection_lines, "powers_on", noted)
    rng = np.random.default_rng(6)
    for n_samples, expected in ((1024, 5), (65536, 1)):
        ms = multisine(fs=n_samples, n_samples=n_samples, f_min=3, f_max=n_samples / 3, n_log=60, rng=rng)
        law_of(*played(ms, PLANTS["Wiener"], 5, rng), ms)
        assert asked.pop() == expected


def test_rounding_on_the_detection_lines_is_no_law():
    ms = multisine(**DESIGN, rng=1)
    assert law_of(ms.u, 2 * ms.u, ms).share == 0


def test_powers_are_those_of_the_samples():
    rng = np.random.default_rng(0)
    ms = multisine("full", fs=256, n_samples=256, f_min=1, f_max=20, n_realizations=3, rng=rng)
    U = 2 / 256 * np.fft.rfft(ms.u)[:, ms.lines.excited]
    (found,) = powers_on(ms.lines.excited, [U], ms.lines.excited)
    size = np.sqrt(np.sum(np.abs(U) ** 2))
    for power, told in zip((3, 5), found, strict=True):
        expected = np.fft.rfft((ms.u / size) ** power)[:, ms.lines.excited]
        ratio = told / expected
        np.testing.assert_allclose(ratio, ratio[0, 0], rtol=1e-9)
        assert abs(ratio[0, 0].imag) < 1e-9 * abs(ratio[0, 0])


@pytest.mark.filterwarnings("ignore::nlfrf.DataWarning")
@pytest.mark.parametrize(
    ("plant", "kind", "change", "before"),
    [
        ("Wiener", "special-odd", dict(f_min=10), "99.7 % and 1.34 times as wide as it has to be"),
        ("Hammerstein", "random-odd", dict(f_min=10), "89 % on the worst line"),
    ],
)
def test_a_bound_from_a_law_that_is_told_is_no_wider_than_it_has_to_be(plant, kind, change, before):
    row = measure_hard("", plant, kind, 1, 1, None, change, 0, 300, np.random.default_rng(1))
    scores = np.array(row[8:16])
    assert 93 <= scores[0] <= 99, before
    assert np.all(scores[[3, 7]] > 90), before
    assert row[16] < 1.22, before


def test_the_bound_is_that_of_the_reading_that_is_told():
    """One cubic of the output, behind a mode and fed back: where |G| is low, the bounds are far apart."""
    rng = np.random.default_rng(3)
    ms = multisine(**DESIGN, rng=rng)
    u, y = played(ms, PLANTS["Wiener"], 200, rng)
    k = ms.lines.excited
    each = np.fft.rfft(y)[:, k] / np.fft.rfft(u)[:, k]
    scatter = np.mean(np.abs(each - each.mean(axis=0)) ** 2, axis=0)
    blas = [identify(Record(u=u[i][None, None], y=y[i][None, None], fs=ms.fs, lines=ms.lines)) for i in range(40)]
    told = np.median([bla.var_bound for bla in blas], axis=0) / scatter
    assert np.all(told[8:-4] > 0.6)
    assert np.all(told[8:-4] < 2.2)


@pytest.mark.filterwarnings("ignore::nlfrf.DataWarning")
def test_nothing_but_rounding_is_worked_out_without_a_warning():
    """A linear machine without noise, at any scale, on few or many lines: scatter and levels are rounding."""
    rng = np.random.default_rng(0)
    for number in range(60):
        n_samples = int(rng.choice([128, 512, 1024]))
        ms = multisine(
            ("special-odd", "random-odd")[number % 2],
            fs=n_samples,
            n_samples=n_samples,
            f_min=1,
            f_max=rng.uniform(0.3, 0.45) * n_samples,
            n_realizations=1 + number % 5,
            rng=rng,
        )
        y = ms.u if number % 3 else mode(ms.u, ms.fs, 0.01, 20.0)
        y = 10.0 ** rng.integers(-40, 40) * y * (1 + 1e-12 * (number % 2) * rng.standard_normal(y.shape))
        bla = identify(Record(u=ms.u[:, None], y=y[:, None], fs=ms.fs, lines=ms.lines))
        assert np.isfinite(bla.bound(of="realization")).all()


def test_what_changes_over_the_band_is_told_from_scatter():
    rng, ones = np.random.default_rng(6), np.ones(100)
    scattered = (1 + 0.06 * rng.standard_normal(100)) ** 2
    assert scattered.max() > 1.5 * scattered.min()
    assert not is_uneven(scattered)
    assert not is_uneven(0 * ones)
    dip, hump = ones.copy(), ones.copy()
    dip[50], hump[45:54] = 0.4, 1.6
    for gain in (dip, hump, np.linspace(1, 1.7, 100)):
        assert is_uneven(gain)


@pytest.mark.parametrize("tilt", [0.0, 1e-6], ids=["flat input", "hardly"])
@pytest.mark.parametrize(("M", "apart"), [(1, 0.6), (7, 0.3)])
def test_where_the_gain_is_even_five_readings_are_one(M, apart, tilt):
    """A static cubic is read within a fraction of a decibel as where all places of the distortion are weighed."""
    rng = np.random.default_rng(7)
    ms = multisine(**DESIGN, n_realizations=M, amplitude=lambda f: 1 + tilt * f, rng=rng)
    u = ms.u[:, None]
    record = Record(u=u, y=u + 0.1 * u**3 + 0.02 * u**2, fs=ms.fs, lines=ms.lines)
    spectra, _ = period_spectra(record, place_lines(ms.lines))
    excited = spectra.on_excited()
    smooth, fit = smooth_frf(average_frf(excited), excited, rough=False)
    answer = nonlinear_answer(spectra, smooth)
    assert not answer.uneven
    one, all_of_them = (level_from_detection(excited, replace(answer, uneven=uneven), fit) for uneven in (False, True))
    for name in ("variance", "cautious", "grid_factor"):
        ratio = 10 * np.log10(getattr(one, name) / getattr(all_of_them, name))
        assert abs(np.median(ratio)) < apart / 3
        assert np.quantile(np.abs(ratio), 0.9) < apart
    np.testing.assert_allclose(one.even, all_of_them.even, rtol=1e-12)
    np.testing.assert_array_equal(one.dof, all_of_them.dof)
