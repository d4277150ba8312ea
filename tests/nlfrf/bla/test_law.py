"""The order of the nonlinearity that the phases of the detection lines show, as `second_opinion`
describes it.
"""

import re
import tracemalloc
from typing import NamedTuple

import numpy as np
import pytest

from benchmarks.plants import PLANTS, mode, played
from nlfrf import Record, identify, multisine, second_opinion
from tests.support.printed import unwrapped

DESIGN = dict(fs=1024, n_samples=1024, f_min=3, f_max=170)
BEFORE, SPRING, BESIDE, BEHIND = (
    "the input, before the dynamics",
    "the output, fed back as by a spring",
    "the input, in parallel with the dynamics",
    "the output, behind the dynamics as by a sensor",
)


class Law(NamedTuple):
    """What `second_opinion` says: 3 a cubic, 5 a fifth power, 1 no power, 0 nothing."""

    order: int
    coherence: float = np.nan  # of a cubic
    source: str = ""


def law_of(u, y, ms, n_periods=1, noise=0.0, rng=None):
    """The law of one record of realisations u and y (M, N)."""
    shape = (len(u), n_periods, u.shape[1])
    y = np.broadcast_to(y[:, None], shape)
    if noise:
        y = y + noise * rng.standard_normal(shape)
    record = Record(u=np.broadcast_to(u[:, None], shape), y=y, fs=ms.fs, lines=ms.lines)
    said = second_opinion(record).law
    cubic = re.fullmatch(r".* is cubic: (\d+) % of it is coherent with the cube of (.*)", said)
    if cubic:
        return Law(3, int(cubic[1]) / 100, cubic[2])
    texts = {"": 0, "fits a fifth power as well as a cube": 5, "saturates, jumps": 1}
    return Law(next(order for text, order in texts.items() if (text in said if text else not said)))


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
    ("plant", "source"),
    [
        (PLANTS["Hammerstein"], BEFORE),
        (PLANTS["Duffing"], SPRING),
        (beside, BESIDE),
        (PLANTS["Wiener"], BEHIND),
        (PLANTS["sensor"], BEHIND),
    ],
    ids=["before a mode", "its spring", "beside it", "behind it", "a sensor that saturates"],
)
def test_one_record_tells_what_drives_a_cubic_and_where_it_stands(plant, source, kind):
    laws = laws_of(plant, kind=kind)
    cubics = [law for law in laws if law.order == 3]
    assert len(cubics) > 0.3 * len(laws)  # of a spring a fifth power has nearly as much
    assert {law.source for law in cubics} == {source}
    assert np.median([law.coherence for law in cubics]) > 0.85
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
    """Of 200 records of noise one in a hundred may agree with something; none counts."""
    laws = laws_of(PLANTS["linear"], n=200, noise=0.1)
    assert sum(law.order != 0 for law in laws) < 6
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
    assert all(law.source == BEHIND for law in laws if law.order == 3)
    if noise < 0.02:
        assert np.median([law.coherence for law in laws]) > 0.9


def test_realisations_tell_it_together():
    one, four = (laws_of(PLANTS["sensor"], M=M, n_periods=1, noise=0.02) for M in (1, 4))
    assert {law.source for law in four if law.order == 3} == {BEHIND}
    count = [sum(law.order == 3 for law in laws) for laws in (one, four)]
    assert count[1] > count[0]


def test_it_does_not_depend_on_units():
    rng = np.random.default_rng(2)
    ms = multisine(**DESIGN, rng=rng)
    u, y = played(ms, PLANTS["Wiener"], 1, rng)
    plain = law_of(u, y, ms)
    for a, b in ((1e-20, 1e20), (1e30, 1e-30), (1e-40, 1e-40), (1e45, 1e45)):
        scaled = law_of(a * u, b * y, ms)
        assert scaled == plain


def opinion_on(plant, n_periods=1):
    ms = multisine(**DESIGN, rng=4)
    u, y = (
        np.repeat(x[:, None], n_periods, axis=1)
        for x in played(ms, plant, 1, np.random.default_rng(4))
    )
    return second_opinion(Record(u=u, y=y, fs=ms.fs, lines=ms.lines))


def test_it_is_said_in_words():
    """With its place where there is one, and with the noise that one period does not tell."""
    wiener = opinion_on(PLANTS["Wiener"])
    assert re.fullmatch(
        r".* cubic: (9\d|100) % of it is coherent with the cube of the output, behind the dynamics"
        r" as by a sensor",
        wiener.law,
    )
    assert wiener.law in unwrapped(wiener)
    assert opinion_on(PLANTS["jump"], 2).law.endswith("saturates, jumps or has a memory")
    assert opinion_on(PLANTS["jump"]).law.endswith("or noise hides its order")


@pytest.mark.parametrize("varies", [False, True])
def test_a_source_is_named_only_where_the_gain_changes_over_the_band(varies):
    """Without dynamics before, behind and beside are the same."""

    def plant(u, fs):
        return (mode(u, fs, 0.1, 40.0) if varies else u) + 0.05 * u**3

    assert opinion_on(plant).law.endswith(BESIDE if varies else "the cube of its drive")


def test_powers_of_long_periods_take_no_more_memory_for_more_realisations():
    """The third and fifth powers of all realisations at once took 35 times the input, not 17."""
    rng = np.random.default_rng(6)
    ms = multisine(fs=65536, n_samples=65536, f_min=3, f_max=65536 / 3, n_log=60, rng=rng)
    u, y = played(ms, PLANTS["Wiener"], 5, rng)
    record = Record(u=u[:, None], y=y[:, None], fs=ms.fs, lines=ms.lines)
    second_opinion(record)
    tracemalloc.start()
    second_opinion(record)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 25 * record.u.nbytes


def test_rounding_on_the_detection_lines_is_no_law():
    ms = multisine(**DESIGN, rng=1)
    assert law_of(ms.u, 2 * ms.u, ms).order != 3


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
