"""Silence, wraps, outliers and hits, found in one signal before it is cut; and sound starts from
rest.
"""

import re
import warnings

import numpy as np
import pytest
from scipy import signal

import nlfrf
from benchmarks import bench_screening
from benchmarks.sound_records import FS, N, played
from nlfrf.records.screening.input import track_input

#: Whole turns, and where a position of that kind starts again.
KINDS = {
    "+-180 deg": (360, -180),
    "0 to 360 deg": (360, 0),
    "0 to 2 pi": (2 * np.pi, 0),
    "-pi to pi": (2 * np.pi, -np.pi),
    "turns": (1, 0),
    "8 bit": (256, 0),
    "8 bit with a sign": (256, -128),
    "12 bit": (4096, 0),
    "16 bit": (65536, 0),
}


def said(u, y, **options):
    """The messages of a record that is taken, and the record."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        record = nlfrf.record_from_samples(u, y, fs=FS, **options)
    return [str(one.message) for one in found], record


def from_rest(seed, n_periods, f=6.0, damping=0.3):
    """Input, output with 1 % noise and FRF of a resonance that starts from rest."""
    rng = np.random.default_rng(seed)
    ms = nlfrf.multisine(fs=FS, n_samples=N, f_min=0.5, f_max=100, rng=rng)
    w = 2 * np.pi * f
    b, a, _ = signal.cont2discrete(([w * w], [1, 2 * damping * w, w * w]), 1 / FS)
    u = np.tile(ms.u[0], n_periods)
    y = signal.lfilter(b[0], a, u)
    return (
        u,
        y + 0.01 * y.std() * rng.standard_normal(y.size),
        signal.freqz(b[0], a, 2 * np.pi * ms.f / FS)[1],
    )


def position(x):
    """A position as it stands in the record of one period that has it as output."""
    u = nlfrf.multisine(fs=FS, n_samples=x.size, f_min=0.5, f_max=100, rng=1).u[0]
    return nlfrf.record_from_samples(u, x, fs=FS, n_samples=x.size).y.ravel()


@pytest.mark.parametrize("seed", [1, 55, 71, 118, 255, 376, 476])
@pytest.mark.parametrize("n_periods", [2, 4])
@pytest.mark.parametrize("resample", [False, True])
def test_a_start_from_rest_is_no_lost_sample(seed, n_periods, resample):
    """20 to 127 lost samples were named; the cure then gave an FRF that was 200 % wrong."""
    u, y, G = from_rest(seed, n_periods)
    messages, record = said(u, y, n_samples=N, resample=resample)
    assert not messages
    bla = nlfrf.identify(record)
    assert np.mean(np.abs(bla.G - G) < bla.bound()) > 0.85
    np.testing.assert_allclose(bla.G[bla.f < 12], G[bla.f < 12], rtol=0.05)


def test_a_first_period_of_another_machine_is_left_out_and_said():
    _, u, y, truth = played(0.1, 4, 3, settled=True)
    rng = np.random.default_rng(0)
    y[200:800] += 0.3 * np.std(y) * rng.standard_normal(600)
    messages, record = said(u, y, n_samples=N)
    assert record.n_periods == 3
    assert len(messages) == 1
    assert messages[0].startswith("y: period 1 differs from the others by more than noise")
    bla = nlfrf.identify(record)
    assert np.mean(np.abs(bla.G - truth(bla.f)) < bla.bound()) > 0.85


@pytest.mark.parametrize("before", [0.25, 0.5, 1.5, 3.3])
@pytest.mark.parametrize("behind", [0.0, 0.6, 1.4])
@pytest.mark.parametrize("noise", [0.0, 1e-3, 0.03])
def test_silence_before_and_behind_is_cut_and_said_once(before, behind, noise):
    _, u, _, _ = played(0.05, 4, 7, settled=True)
    w = 2 * np.pi * 20
    b, a, _ = signal.cont2discrete(([w * w], [1, 0.1 * w, w * w]), 1 / FS)
    ends = int(before * N), int(behind * N)
    u = np.concatenate([np.zeros(ends[0]), u, np.zeros(ends[1])])
    y = signal.lfilter(b[0], a, u)
    rng = np.random.default_rng(1)
    u, y = (x + noise * np.std(x) * rng.standard_normal(x.size) for x in (u, y))
    for options in ({}, {"n_samples": N}, {"n_samples": N, "resample": True}):
        messages, record = said(u, y, **options)
        assert len(messages) == 1
        assert f"{before:.2g} periods) before" in messages[0]
        assert (" after the excitation" in messages[0]) == (behind > 0)
        assert record.n_periods == 4
        bla = nlfrf.identify(record)
        G = signal.freqz(b[0], a, 2 * np.pi * bla.f / FS)[1]
        assert np.mean(np.abs(bla.G - G) < bla.bound()) > 0.85
    assert said(u, y, n_samples=N, n_discard=int(np.ceil(before)))[1].n_periods == 3


def test_a_signal_that_is_silent_in_every_period_is_not_cut():
    burst = np.concatenate([np.zeros(400), np.random.default_rng(1).standard_normal(600)])
    for u in (np.tile(burst, 3), np.tile(np.roll(burst, 300), 3)):
        assert said(u, u, n_samples=1000)[1].n_periods == 3


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("amplitude", "middle"), [(0.06, 0.0), (0.06, 0.5), (0.4, 0.0), (1.5, 0.3)]
)
def test_a_position_that_wraps_is_unwrapped_and_said(kind, amplitude, middle):
    """Hovering about the place where it starts again, and over several turns; the bound held 48 to
    97 %.
    """
    turn, start = KINDS[kind]
    _, u, y, truth = played(0.3, 4, 2, settled=True, noise=1e-4)
    factor = amplitude * turn / np.std(y)
    y = signal.lfilter([0.1], [1, -0.9], y)  # slower
    position = factor * y + (start + middle * turn)
    position = np.round(position) if turn >= 256 else position
    wrapped = (position - start) % turn + start
    assert np.abs(np.diff(wrapped)).max() > turn / 2 or middle
    if np.abs(np.diff(wrapped)).max() > turn / 2:
        messages, record = said(u, wrapped, n_samples=N)
        assert re.match(
            rf"y wraps at a turn of {turn:.6g}: \d+ jumps? by a whole turn", messages[0]
        )
        left = record.y.ravel() - position[-record.y.size :]
        np.testing.assert_allclose(left, left[0], atol=1e-9 * turn)
        bla = nlfrf.identify(record)
        G = factor * truth(bla.f) * signal.freqz([0.1], [1, -0.9], 2 * np.pi * bla.f / FS)[1]
        assert np.mean(np.abs(bla.G - G) < bla.bound()) > 0.85


@pytest.mark.parametrize("kind", KINDS)
def test_a_position_that_turns_too_fast_is_refused(kind):
    turn, start = KINDS[kind]
    y = turn * np.random.default_rng(0).uniform(-0.9, 0.9, 4000).cumsum()
    y = np.round(y) if turn >= 256 else y
    with pytest.raises(
        ValueError, match=r"y must move by less than half a turn from .* or sample faster"
    ):
        position((y - start) % turn + start)
    rough = 0.2 * turn * np.random.default_rng(1).standard_normal(4000) + start
    rough = np.round(rough) if turn >= 256 else rough
    wrapped = (rough - start) % turn + start
    with pytest.warns(
        nlfrf.DataWarning,
        match=r"y has \d+ jumps by a whole turn of .*, and other steps up to .* It is left unchanged",
    ):
        assert np.array_equal(position(wrapped), wrapped)


@pytest.mark.parametrize("kind", KINDS)
def test_what_truly_jumps_is_not_unwrapped(kind):
    turn, start = KINDS[kind]
    whole = turn - 1 if turn >= 256 else turn
    _, _, y, _ = played(0.1, 4, 5, settled=True)
    y, rng = y / np.std(y), np.random.default_rng(3)
    square, gap = np.where(y > 0, 1.0, 0.0), np.sign(y) * np.maximum(np.abs(y), 0.9)
    rough = np.clip(0.02 + 0.96 * square + 0.004 * rng.standard_normal(y.size), 0, 1)
    for looks in (
        square,
        np.clip(y, -0.2, 0.2),
        gap,
        rough,
        rng.standard_normal(y.size),
        np.clip(rough, 0.1, 0.9),
    ):
        x = start + whole * (looks - looks.min()) / np.ptp(looks)
        x = np.round(x) if turn >= 256 else x
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of what is clipped, or repeats its last value
            warnings.filterwarnings("error", message=".*(wraps|turn)")
            assert np.array_equal(position(x), x)


@pytest.mark.parametrize(("n_periods", "size"), [(1, 1e3), (2, 1e3), (4, 1e3), (4, 30.0)])
def test_a_spike_is_said_with_its_place_and_size(n_periods, size):
    _, u, y, _ = played(0.1, n_periods, 4, settled=True)
    y[333] = size
    place = (
        rf"y has 1 outlier, the first of {size:g} at sample 333 \({333 / FS:.6g} s\): no other"
        r" sample is further"
    )
    with pytest.warns(nlfrf.DataWarning, match=place):
        record = nlfrf.record_from_samples(u, y, fs=FS, n_samples=N)
    assert record.n_periods == max(1, n_periods - 1)
    assert (np.abs(record.y).max() < size / 2) == (n_periods > 1)  # the only period stays


def test_a_spike_of_the_input_is_said_too():
    _, u, y, _ = played(0.1, 4, 4, settled=True)
    u[333] = 20.0
    with pytest.warns(
        nlfrf.DataWarning, match="u has a pulse of one sample .* outlier of 20 at sample 333"
    ):
        nlfrf.record_from_samples(u, y, fs=FS, n_samples=N)


def test_marks_of_no_value_are_said():
    _, u, y, _ = played(0.1, 4, 4, settled=True)
    y[[334, 1500, 1501, 3000]] = 999
    with pytest.warns(
        nlfrf.DataWarning,
        match=r"y has 4 outliers, all of 999, as a mark of no value, the first .* 334",
    ):
        nlfrf.record_from_samples(u, y, fs=FS, n_samples=N)


def test_peaks_that_repeat_or_that_the_input_has_are_no_outliers():
    pulses = np.zeros(4 * N)
    pulses[300::N] = 1.0
    _, u, y, _ = played(0.1, 4, 4, settled=True)
    size = np.std(y)
    # one period does not show that a peak repeats, unless the input has it
    cases = [(n, u, y**3) for n in (1, 4)] + [(n, pulses, pulses + 0.02 * y) for n in (1, 4)]
    for n_periods, played_u, looks in [*cases, (4, u, y + 20 * size * pulses)]:
        some = slice(n_periods * N)
        messages, _ = said(played_u[some], looks[some], n_samples=N)
        assert not any("outlier" in one or "hits" in one for one in messages)


def test_hits_of_a_hammer_are_no_periods():
    for seed in range(10):
        force = bench_screening.hit(np.random.default_rng(seed))
        y = signal.lfilter([0.0, 0.1], [1, -1.6, 0.9], force)
        for options in ({}, {"n_samples": 1200}):
            with (
                pytest.raises(ValueError, match="must"),
                pytest.warns(nlfrf.DataWarning, match=r"u looks like \d hits of"),
            ):
                nlfrf.record_from_samples(force, y, fs=FS, **options)


@pytest.mark.parametrize("n", [12, pytest.param(24, marks=pytest.mark.attack)])
def test_random_records_are_screened_rightly(n):
    """A small part of `benchmarks.bench_screening`, which counts the same for thousands of
    records.
    """
    rows = bench_screening.main(["--records", str(n), "--seed", "3"])
    assert not rows["sound, from rest"]["refused"]
    assert set(rows["sound, from rest, resample=True"]) == {"as good"}
    assert rows["samples lost from y, settled"]["refused"] >= 22 / 24 * n
    assert rows["samples lost from y, settled"]["silent"] <= 1
    assert set(rows["silence before and behind"]) == {"right, one warning"}
    assert set(rows["position that wraps, steps up to 0.45 of a turn"]) == {"right"}
    assert set(rows["outliers"]) == set(rows["hits of a hammer"]) == {"found"}
    assert set(rows["sound, false alarms of wraps, outliers, hits"]) == {"none"}


@pytest.mark.parametrize("turn", [2 * np.pi, 360.0])
def test_a_position_that_hovers_at_its_end_is_unwrapped(turn):
    """Every fifth step is a jump there, so that most jumps have others for neighbours."""
    noise = 0.03 * turn * np.random.default_rng(4).standard_normal(2000)
    with pytest.warns(nlfrf.DataWarning, match="wraps at a turn"):
        left = position(noise % turn) - noise
    np.testing.assert_allclose(left, left[0], atol=1e-9 * turn)


def test_periods_of_which_none_is_sound_are_refused_and_have_no_pace():
    shifted = np.tile(np.random.default_rng(1).standard_normal(400), 2)
    shifted[100:260] = shifted[101:261]  # one period of two, but which
    with pytest.raises(ValueError, match="the input does not repeat in period 1, 2 of 2"):
        nlfrf.record_from_samples(shifted, shifted, fs=FS, n_samples=400)
    with pytest.raises(ValueError, match=r"u must hold at least one whole period .* got none"):
        said(shifted, shifted, n_samples=400, resample=True)
    with pytest.raises(
        ValueError,
        match="n_samples must be the period of the input, got 400: no period is without a fault",
    ):
        _ = track_input(shifted, 400).pace
