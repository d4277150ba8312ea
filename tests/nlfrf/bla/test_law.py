"""The order of the nonlinearity that the phases of the detection lines show, as `second_opinion`
describes it.
"""

import re

import numpy as np
import pytest

from benchmarks.plants import PLANTS, mode, played
from nlfrf import Record, identify, multisine, second_opinion
from nlfrf.bla.cross_check import UNKNOWN_ORDER, detect_nonlinearity, odd_powers_on_lines
from nlfrf.bla.distortion import smooth_frm
from nlfrf.bla.frf import estimate_frm
from nlfrf.bla.line_index import index_lines
from nlfrf.bla.residual import gain_varies, nonlinear_residual
from nlfrf.bla.spectra import period_spectra
from tests.support.printed import unwrapped

DESIGN = dict(fs=1024, n_samples=1024, f_min=3, f_max=170)


def law_of(u, y, ms, n_periods=1, noise=0.0, rng=None):
    """The law of one record of realisations u and y (M, N)."""
    shape = (len(u), n_periods, u.shape[1])
    y = np.broadcast_to(y[:, None], shape)
    if noise:
        y = y + noise * rng.standard_normal(shape)
    record = Record(u=np.broadcast_to(u[:, None], shape), y=y, fs=ms.fs, lines=ms.lines)
    spectra, _ = period_spectra(record, index_lines(ms.lines))
    excited = spectra.select_excited()
    frm = estimate_frm(excited)
    smooth, _fit = smooth_frm(frm, excited, False)
    return detect_nonlinearity(
        excited, nonlinear_residual(spectra, excited, measured=frm.G, smooth=smooth)
    )


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
    [
        (PLANTS["Hammerstein"], 0),
        (PLANTS["Duffing"], 1),
        (beside, 2),
        (PLANTS["Wiener"], 3),
        (PLANTS["sensor"], 3),
    ],
    ids=["before a mode", "its spring", "beside it", "behind it", "a sensor that saturates"],
)
def test_one_record_tells_what_drives_a_cubic_and_where_it_stands(plant, reading, kind):
    laws = laws_of(plant, kind=kind)
    assert [law.hypothesis for law in laws] == [reading] * len(laws)
    assert np.median([law.coherence for law in laws]) > 0.85
    assert (
        np.mean([law.order == 3 for law in laws]) > 0.3
    )  # of a spring a fifth power has nearly as much
    assert all(law.order != 1 for law in laws)


@pytest.mark.parametrize("plant", ["fifth", "quintic", "behind"])
def test_a_fifth_power_is_no_cubic(plant):
    laws = laws_of(PLANTS[plant])
    assert sum(law.order == 5 for law in laws) >= 18
    assert all(law.order != 3 for law in laws)


@pytest.mark.parametrize(
    "plant", ["jump", "backlash", "slipping", "one-sided", "one way", "between"]
)
def test_what_is_neither_counts_as_no_cubic(plant):
    laws = laws_of(PLANTS[plant])
    assert np.mean([law.order == 3 and law.coherence > 0.6 for law in laws]) <= 0.2
    assert all(law.order != 5 for law in laws)
    if plant == "jump":
        assert all(law.order == 1 for law in laws)


def test_noise_and_an_even_law_tell_nothing():
    """Of 400 records of noise one in a hundred may agree with something; none counts."""
    laws = laws_of(PLANTS["linear"], n=400, noise=0.1)
    assert sum(law != UNKNOWN_ORDER for law in laws) < 12
    assert all(law.order != 3 for law in laws)
    assert all(
        law.order != 3
        for law in laws_of(lambda u, fs: mode(u, fs, 0.1, 40.0) + u**2, n_periods=2, noise=1e-3)
    )


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.03, 0.08])
def test_noise_that_is_known_makes_no_other_law_of_a_cubic(noise):
    """It may hide it: of 8 % noise at the output most records do not tell it, the others what it
    is.
    """
    laws = laws_of(PLANTS["Wiener"], n_periods=4, noise=noise)
    assert all(law.order != 1 for law in laws)
    assert all(law.hypothesis == 3 for law in laws if law.order == 3)
    if noise < 0.02:
        assert np.median([law.coherence for law in laws]) > 0.9


def test_realisations_tell_it_together():
    one, four = (laws_of(PLANTS["sensor"], M=M, n_periods=1, noise=0.05) for M in (1, 4))
    assert [law.hypothesis for law in four] == [3] * 20
    assert np.std([law.coherence for law in four]) < np.std([law.coherence for law in one])


def test_it_does_not_depend_on_units():
    rng = np.random.default_rng(2)
    ms = multisine(**DESIGN, rng=rng)
    u, y = played(ms, PLANTS["Wiener"], 1, rng)
    plain = law_of(u, y, ms)
    for a, b in ((1e-20, 1e20), (1e30, 1e-30), (1e-40, 1e-40), (1e60, 1e60)):
        scaled = law_of(a * u, b * y, ms)
        assert (scaled.order, scaled.hypothesis) == (plain.order, plain.hypothesis)
        assert scaled.coherence == pytest.approx(plain.coherence, rel=1e-6)


def test_it_is_said_in_words():
    """With its place where there is one, and with the noise that one period does not tell."""
    (wiener,), (jumping,) = laws_of(PLANTS["Wiener"], n=1), laws_of(PLANTS["jump"], n=1)
    said = wiener.describe(gain_varies=True, one_period=True)
    assert re.fullmatch(
        r".* cubic: (9\d|100) % of it is coherent with the cube of the output, behind the dynamics"
        r" as by a sensor",
        said,
    )
    assert wiener.describe(gain_varies=False, one_period=True).endswith("the cube of its drive")
    assert jumping.describe(gain_varies=False, one_period=False).endswith(
        "saturates, jumps or has a memory"
    )
    assert jumping.describe(gain_varies=False, one_period=True).endswith("or noise hides its order")
    assert UNKNOWN_ORDER.describe(gain_varies=True, one_period=True) == ""
    ms = multisine(**DESIGN, rng=4)
    u, y = played(ms, PLANTS["Wiener"], 1, np.random.default_rng(4))
    opinion = second_opinion(Record(u=u[:, None], y=y[:, None], fs=ms.fs, lines=ms.lines))
    assert opinion.law in unwrapped(opinion)
    assert "cube of the output, behind the dynamics" in opinion.law


def test_of_long_periods_few_realisations_are_asked(monkeypatch):
    """The third and fifth powers of all of them would take more memory than the record."""
    asked = []

    def noted(lines, drives, excited):
        asked.append(drives[0].shape[0])
        return odd_powers_on_lines(lines, drives, excited)

    monkeypatch.setattr("nlfrf.bla.cross_check.odd_powers_on_lines", noted)
    rng = np.random.default_rng(6)
    for n_samples, expected in ((1024, 5), (65536, 1)):
        ms = multisine(
            fs=n_samples, n_samples=n_samples, f_min=3, f_max=n_samples / 3, n_log=60, rng=rng
        )
        law_of(*played(ms, PLANTS["Wiener"], 5, rng), ms)
        assert asked.pop() == expected


def test_rounding_on_the_detection_lines_is_no_law():
    ms = multisine(**DESIGN, rng=1)
    assert law_of(ms.u, 2 * ms.u, ms).order != 3


def test_powers_are_those_of_the_samples():
    rng = np.random.default_rng(0)
    ms = multisine("full", fs=256, n_samples=256, f_min=1, f_max=20, n_realizations=3, rng=rng)
    U = 2 / 256 * np.fft.rfft(ms.u)[:, ms.lines.excited]
    (found,) = odd_powers_on_lines(ms.lines.excited, [U], ms.lines.excited)
    size = np.sqrt(np.sum(np.abs(U) ** 2))
    for power, told in zip((3, 5), found, strict=True):
        expected = np.fft.rfft((ms.u / size) ** power)[:, ms.lines.excited]
        ratio = told / expected
        np.testing.assert_allclose(ratio, ratio[0, 0], rtol=1e-9)
        assert abs(ratio[0, 0].imag) < 1e-9 * abs(ratio[0, 0])


@pytest.mark.filterwarnings("ignore::nlfrf.DataWarning")
def test_nothing_but_rounding_is_worked_out_without_a_warning():
    """A linear machine without noise, at any scale, on few or many lines: scatter and levels are
    rounding.
    """
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
        y = (
            10.0 ** rng.integers(-40, 40)
            * y
            * (1 + 1e-12 * (number % 2) * rng.standard_normal(y.shape))
        )
        bla = identify(Record(u=ms.u[:, None], y=y[:, None], fs=ms.fs, lines=ms.lines))
        assert np.isfinite(bla.bound(of="realization")).all()


def test_what_changes_over_the_band_is_told_from_scatter():
    rng, ones = np.random.default_rng(6), np.ones(100)
    scattered = (1 + 0.06 * rng.standard_normal(100)) ** 2
    assert scattered.max() > 1.5 * scattered.min()
    assert not gain_varies(scattered)
    assert not gain_varies(0 * ones)
    dip, hump = ones.copy(), ones.copy()
    dip[50], hump[45:54] = 0.4, 1.6
    for gain in (dip, hump, np.linspace(1, 1.7, 100)):
        assert gain_varies(gain)
