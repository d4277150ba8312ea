"""Records: checked when made, cut from streams, their lines and period found in the input."""

import warnings

import numpy as np
import pytest

from nlfrf import DataWarning, Record, multisine, record_from_samples
from nlfrf.signals import LineGrid


def stream(
    kind="special-odd",
    *,
    n_periods=3,
    snr=None,
    amplitude=None,
    fs=1024,
    n_samples=1024,
    f_max=300,
    rng=0,
):
    rng = np.random.default_rng(rng)
    ms = multisine(
        kind, fs=fs, n_samples=n_samples, f_min=1, f_max=f_max, amplitude=amplitude, rng=rng
    )
    u = np.tile(ms.u[0], n_periods)
    if snr is not None:
        u = u + 10 ** (-snr / 20) * rng.standard_normal(u.size)
    return ms, u


def test_streams_are_cut_into_whole_periods():
    ms, u = stream(n_periods=4)
    record = record_from_samples(u[:-10], 2 * u[:-10], fs=1024, n_samples=1024, n_discard=1)
    assert record.u.shape == record.y.shape == (1, 2, 1024)
    np.testing.assert_array_equal(record.u[0, 0], u[1024:2048])
    np.testing.assert_array_equal(record.lines.excited, ms.lines.excited)
    np.testing.assert_array_equal(record.lines.odd, ms.lines.odd)


def test_realisations_come_as_a_list():
    streams = [stream(rng=m)[1] for m in range(3)]
    record = record_from_samples(streams, [2 * u for u in streams], fs=1024, n_samples=1024)
    assert record.u.shape == (3, 3, 1024)


COLOURS = {
    "flat": None,
    "1/sqrt(f)": lambda f: f**-0.5,
    "60 dB slope": lambda f: 10 ** (-3 * f / 300),
    "notch": lambda f: 1 - 0.99 * np.exp(-(((f - 150) / 20) ** 2)),
}


def found_lines(u, n_periods):
    """The excited lines that are found in one input."""
    return record_from_samples(u, u, fs=1024, n_samples=u.size // n_periods).lines.excited


@pytest.mark.filterwarnings("ignore::nlfrf.DataWarning")
@pytest.mark.parametrize("colour", COLOURS)
@pytest.mark.parametrize("kind", ["full", "odd", "odd-odd", "special-odd"])
@pytest.mark.parametrize("n_periods", [1, 2])
def test_lines_are_found_in_coloured_spectra(kind, colour, n_periods):
    ms, u = stream(kind, amplitude=COLOURS[colour], n_periods=n_periods)
    found = found_lines(u, n_periods)
    np.testing.assert_array_equal(found, ms.lines.excited)


@pytest.mark.filterwarnings("ignore::nlfrf.DataWarning")
@pytest.mark.parametrize("kind", ["full", "odd", "odd-odd", "special-odd", "random-odd"])
@pytest.mark.parametrize("n_periods", [1, 2, 5])
def test_lines_are_found_at_20_dB(kind, n_periods):
    ms, u = stream(kind, snr=20, n_periods=n_periods, rng=3)
    np.testing.assert_array_equal(found_lines(u, n_periods), ms.lines.excited)


@pytest.mark.filterwarnings("ignore::nlfrf.DataWarning")
def test_distortion_of_the_input_is_not_taken_for_excitation():
    ms, u = stream(n_periods=2, f_max=100)
    distorted = u + 0.03 * u**3 + 0.03 * u**2  # energy on every line, and beyond the band
    np.testing.assert_array_equal(found_lines(distorted, 2), ms.lines.excited)


def test_the_period_is_found():
    for n_samples in (500, 777, 1024):
        _, u = stream(n_samples=n_samples, n_periods=3, snr=20)
        assert record_from_samples(u, u, fs=1024).n_samples == n_samples
    _, u = stream(n_periods=3)
    assert record_from_samples(u, u, fs=1024).n_samples == 1024


def good():
    ms, u = stream(n_periods=2)
    return dict(u=u.reshape(1, 2, -1), y=u.reshape(1, 2, -1), fs=1024.0, lines=ms.lines)


def with_nan():
    y = good()["y"].copy()
    y[0, 1, 5] = np.nan
    return y


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (dict(u=np.ones((1, 2048))), r"u must have 3 axes, got shape \(1, 2048\)"),
        (
            dict(y=np.ones((1, 1, 1024))),
            r"y must have the shape of u, \(1, 2, 1024\), got \(1, 1, 1024\)",
        ),
        (dict(u=np.ones((1, 2, 1024))), r"u must vary, got the constant 1 in realisation 0"),
        (dict(y=np.zeros((1, 2, 1024))), r"y must vary, got the constant 0 in realisation 0"),
        (
            dict(y=with_nan()),
            r"y must be finite, got 1 nan or infinite numbers, the first at \(0, 1, 5\)",
        ),
        (dict(fs=-1), r"fs must be positive, got -1"),
        (
            dict(lines=LineGrid(excited=[1, 600])),
            r"lines must lie below the Nyquist line 512, got line 600",
        ),
        (
            dict(lines=LineGrid(excited=[1], even=[512])),
            r"lines must lie below the Nyquist line 512, got line 512",
        ),
        (dict(y=np.full((1, 2, 1024), "a")), r"y must hold real numbers, got dtype"),
    ],
)
def test_record_refusals(change, message):
    with pytest.raises(ValueError, match=message):
        Record(**good() | change)


def test_stream_refusals():
    _, u = stream(n_periods=2)
    with pytest.raises(ValueError, match=r"y must be as long as u, 2048 samples, got 2000"):
        record_from_samples(u, u[:2000], fs=1, n_samples=1024)
    with pytest.raises(
        ValueError,
        match=r"at least one period of n_samples = 4096 .* got 2048 samples, .* 0.50 periods",
    ):
        record_from_samples(u, u, fs=1, n_samples=4096)
    with pytest.raises(
        ValueError, match=r"n_samples must be the period of the input, got 700: .* points to 1024.0"
    ):
        record_from_samples(u, u, fs=1, n_samples=700)
    with pytest.raises(ValueError, match=r"u must vary, got the constant 0"):
        record_from_samples(0 * u, u, fs=1, n_samples=1024)
    with pytest.raises(ValueError, match=r"y must hold as many realisations as u, 1, got 2"):
        record_from_samples(u, [u, u], fs=1, n_samples=1024)
    with pytest.raises(ValueError, match=r"u must repeat at least once"):
        record_from_samples(u[:1200], u[:1200], fs=1)
    noise = np.random.default_rng(0).standard_normal(4096)
    with pytest.raises(ValueError, match=r"does not seem to repeat at all"):
        record_from_samples(noise, noise, fs=1, n_samples=1024)


def test_a_period_in_seconds_is_named():
    """A period of four samples ended in an IndexError."""
    u = np.tile(multisine(fs=1000, n_samples=4000, f_min=1, f_max=60, rng=1).u[0], 3)
    u += 1e-3 * np.random.default_rng(2).standard_normal(u.size)
    with pytest.raises(
        ValueError, match=r"got 4: .* a period counts samples: 4 s at 1000 Hz are 4000$"
    ):
        record_from_samples(u, 2 * u, fs=1000, n_samples=4)
    with pytest.raises(ValueError, match=r"got 40: .* points to 4000.0$"):
        record_from_samples(u, 2 * u, fs=1000, n_samples=40)


# Faults of raw records


def raw(period, *, n_periods=6, drift=0.0, noise=0.0, seed=1):
    """A multisine whose period, in samples, is any number; designed for 2000 samples."""
    rng = np.random.default_rng(seed)
    ms = multisine(fs=1000, n_samples=2000, f_min=0.5, f_max=200, rng=0)
    n = n_periods * 2000
    turns = np.arange(n) / period + drift * (np.arange(n) / n) ** 2
    u = np.zeros(n)
    for k, amplitude, phase in zip(ms.lines.excited, ms.amplitude, ms.phase[0], strict=True):
        u += amplitude * np.cos(2 * np.pi * k * turns + phase)
    return ms, u + noise * rng.standard_normal(n)


def unrepeated(record):
    """Share of the power that does not repeat from period to period."""
    return np.sum((record.u - record.u.mean(axis=1, keepdims=True)) ** 2) / np.sum(record.u**2)


@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_a_period_one_sample_off_is_named(noise):
    _, u = raw(1999, noise=noise)
    with pytest.raises(
        ValueError, match=r"got 2000: the input repeats every 1999 samples; give n_samples=1999"
    ):
        record_from_samples(u, u, fs=1000, n_samples=2000)


@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_a_period_that_is_not_whole_is_named_and_cured(noise):
    ms, u = raw(2000.37, noise=noise)
    with pytest.raises(
        ValueError, match=r"repeats every 2000\.3[67]\d+ samples, not a whole number; resample=True"
    ):
        record_from_samples(u, u, fs=1000, n_samples=2000)
    record = record_from_samples(u, u, fs=1000, n_samples=2000, resample=True)
    assert unrepeated(record) < 1e-7 + 1.2 * noise**2
    assert record.f0 == pytest.approx(
        1000 / 2000.37, rel=1e-7 + 1e-4 * noise
    )  # not 1000 / 2000, four lines in 10 000
    np.testing.assert_array_equal(record.lines.excited, ms.lines.excited)


def test_a_drifting_clock_is_named_and_cured():
    _, u = raw(2000, drift=5e-4, n_periods=12)
    with pytest.raises(
        ValueError,
        match=r"the clock drifts: the periods begin up to 0\.1\d* samples",
    ):
        record_from_samples(u, u, fs=1000, n_samples=2000)
    assert unrepeated(record_from_samples(u, u, fs=1000, n_samples=2000, resample=True)) < 1e-5


def test_lost_and_repeated_samples_are_named_and_cured():
    _, u = raw(2000)
    lost = np.delete(u, slice(4300, 4307))
    with pytest.raises(
        ValueError,
        match=r"7 lost before period 4\); resample=True cuts the periods where the input",
    ):
        record_from_samples(lost, lost, fs=1000, n_samples=2000)
    record = record_from_samples(lost, lost, fs=1000, n_samples=2000, resample=True)
    assert record.n_periods == 4  # of the five that are whole, the one with the gap is gone
    assert unrepeated(record) < 1e-20
    one = np.delete(u, 3100)
    assert unrepeated(record_from_samples(one, one, fs=1000, n_samples=2000, resample=True)) < 1e-20
    repeated = np.insert(u, 2300, u[2300] * np.ones(4))
    with pytest.raises(ValueError, match=r"4 repeated before period 3"):
        record_from_samples(repeated, repeated, fs=1000, n_samples=2000)


def test_a_missing_period_is_named_and_left_out():
    _, u = raw(2000)
    u[6000:8000] = 0.0
    with (
        pytest.raises(ValueError, match=r"the input does not repeat in period 4 of 6"),
        pytest.warns(DataWarning),
    ):
        record_from_samples(u, u + 0, fs=1000, n_samples=2000)
    with pytest.warns(
        DataWarning, match=r"is constant for 2000 samples from sample 6000 on, 1 times the period"
    ):
        record = record_from_samples(u, u, fs=1000, n_samples=2000, resample=True)
    assert record.n_periods == 5


@pytest.mark.parametrize("period", [2000.4, 1999.5, 2000.25])
def test_a_period_that_is_not_whole_is_found_and_not_its_double(period):
    ms, u = raw(period)
    with pytest.raises(
        ValueError,
        match=r"the period of u seems to be (2000\.40|1999\.50|2000\.25) samples, .* resample",
    ):
        record_from_samples(u, u, fs=1000)
    record = record_from_samples(u, u, fs=1000, resample=True)
    assert record.f0 == pytest.approx(1000 / period, rel=1e-6)
    np.testing.assert_array_equal(record.lines.excited, ms.lines.excited)


def test_the_period_is_found_whatever_the_length_of_the_record():
    for n in range(990, 1014):  # the transforms behind it are of odd length for some
        u = multisine(fs=n, n_samples=n, f_min=1, f_max=n / 4, rng=n).u[0]
        assert record_from_samples(np.tile(u, 3), np.tile(u, 3), fs=n).n_samples == n


def test_resampling_on_another_number_of_samples_keeps_the_frequencies():
    ms, u = raw(2000)
    record = record_from_samples(u, u, fs=1000, n_samples=2020, resample=True)
    assert record.f0 == 0.5
    assert record.fs == pytest.approx(1010)
    np.testing.assert_array_equal(record.lines.excited, ms.lines.excited)
    assert record_from_samples(u, u, fs=1000, n_samples=2000, resample=True).fs == 1000


def test_an_input_that_starts_late_is_named_and_cured():
    _, u = raw(2000)
    u[:3000] = 0.0
    for resample in (False, True):
        with pytest.warns(
            DataWarning,
            match=r"u is silent for 3000 samples \(1\.5 periods\) before the excitation",
        ):
            record = record_from_samples(u, u, fs=1000, n_samples=2000, resample=resample)
        assert record.n_periods == 4
        assert unrepeated(record) < 1e-20


def test_clipping_is_named():
    _, u = raw(2000)
    with pytest.warns(DataWarning, match=r"y seems clipped: \d.\d* % of its samples"):
        record_from_samples(u, np.clip(u, -1.7, 1.7), fs=1000, n_samples=2000)


def test_sound_records_pass_without_a_word():
    for seed in range(10):
        _, u = raw(2000, noise=0.1, seed=seed)
        record_from_samples(u, u, fs=1000, n_samples=2000)


def test_a_period_found_from_one_repetition_of_lines_without_a_grid_is_said():
    rng, fs, n = np.random.default_rng(3), 1000.0, 2000
    lines = np.array([3, 7, 8, 14, 31, 50, 77, 78, 120, 151, 200, 263, 300, 317])
    phases = rng.uniform(0, 2 * np.pi, (lines.size, 1))
    u = np.cos(2 * np.pi * np.outer(lines, np.arange(n)) / n + phases).sum(axis=0)
    for n_periods, options in ((2, {}), (3, {}), (2, {"n_samples": n})):
        x = np.tile(u, n_periods)
        with warnings.catch_warnings(record=True) as found:
            warnings.simplefilter("always")
            record = record_from_samples(x, np.roll(x, 3), fs=fs, **options)
        assert record.n_samples == n
        assert any("found from a single repetition" in str(w.message) for w in found) == (
            n_periods == 2 and not options
        )
