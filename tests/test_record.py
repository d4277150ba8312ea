"""Records: checked when made, cut from streams, their lines and period found in the input."""

import numpy as np
import pytest

from nlfrf import LineGrid, Record, multisine, record_from_samples
from nlfrf.excitation import detect_lines, detect_period


def stream(kind="special-odd", *, n_periods=3, snr=None, amplitude=None, fs=1024, n_samples=1024, f_max=300, rng=0):
    rng = np.random.default_rng(rng)
    ms = multisine(kind, fs=fs, n_samples=n_samples, f_min=1, f_max=f_max, amplitude=amplitude, rng=rng)
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


@pytest.mark.parametrize("colour", COLOURS)
@pytest.mark.parametrize("kind", ["full", "odd", "odd-odd", "special-odd"])
@pytest.mark.parametrize("n_periods", [1, 2])
def test_lines_are_found_in_coloured_spectra(kind, colour, n_periods):
    ms, u = stream(kind, amplitude=COLOURS[colour], n_periods=n_periods)
    found = detect_lines(u.reshape(1, n_periods, -1))
    np.testing.assert_array_equal(found.excited, ms.lines.excited)


@pytest.mark.parametrize("kind", ["full", "odd", "odd-odd", "special-odd", "random-odd"])
@pytest.mark.parametrize("n_periods", [1, 2, 5])
def test_lines_are_found_at_20_dB(kind, n_periods):
    ms, u = stream(kind, snr=20, n_periods=n_periods, rng=3)
    np.testing.assert_array_equal(detect_lines(u.reshape(1, n_periods, -1)).excited, ms.lines.excited)


def test_distortion_of_the_input_is_not_taken_for_excitation():
    ms, u = stream(n_periods=2, f_max=100)
    distorted = u + 0.03 * u**3 + 0.03 * u**2  # energy on every line, and beyond the band
    np.testing.assert_array_equal(detect_lines(distorted.reshape(1, 2, -1)).excited, ms.lines.excited)


def test_the_period_is_found():
    for n_samples in (500, 777, 1024):
        _, u = stream(n_samples=n_samples, n_periods=3, snr=20)
        assert abs(detect_period(u) - n_samples) < 0.05
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
        (dict(y=np.ones((1, 1, 1024))), r"y must have the shape of u, \(1, 2, 1024\), got \(1, 1, 1024\)"),
        (dict(u=np.ones((1, 2, 1024))), r"u must vary, got the constant 1 in realisation 0"),
        (dict(y=np.zeros((1, 2, 1024))), r"y must vary, got the constant 0 in realisation 0"),
        (dict(y=with_nan()), r"y must be finite, got 1 nan or infinite numbers, the first at \(0, 1, 5\)"),
        (dict(fs=-1), r"fs must be positive, got -1"),
        (dict(lines=LineGrid(excited=[1, 600])), r"lines must lie below the Nyquist line 512, got line 600"),
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
        ValueError, match=r"at least one period of n_samples = 4096 .* got 2048 samples, .* 0.50 periods"
    ):
        record_from_samples(u, u, fs=1, n_samples=4096)
    with pytest.raises(ValueError, match=r"n_samples must be the period of the input, got 1000: .* points to 1024.0"):
        record_from_samples(u, u, fs=1, n_samples=1000)
    with pytest.raises(ValueError, match=r"u must vary, got the constant 0"):
        record_from_samples(0 * u, u, fs=1, n_samples=1024)
    with pytest.raises(ValueError, match=r"y must hold as many realisations as u, 1, got 2"):
        record_from_samples(u, [u, u], fs=1, n_samples=1024)
    with pytest.raises(ValueError, match=r"u must repeat at least once"):
        record_from_samples(u[:1200], u[:1200], fs=1)
    noise = np.random.default_rng(0).standard_normal(4096)
    with pytest.raises(ValueError, match=r"does not seem to repeat at all"):
        record_from_samples(noise, noise, fs=1, n_samples=1024)
