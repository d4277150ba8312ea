"""Noise excitation: where the local polynomials read the FRF, and which lines a band holds."""

import re

import numpy as np
import pytest

from nlfrf import DataWarning, Record, identify, identify_noise, load, multisine, save


@pytest.mark.parametrize("ratio", [2, 2.5, 8.7])
def test_local_polynomials_read_the_frf_at_the_line_they_name(ratio):
    """A delay of d samples turns the phase by 2 pi d / n a line: a frequency a little off is an FRF
    far off.

    The lines of the whole record lie elsewhere where its length is no multiple of n_samples, and at
    the ends of the band they lie on one side.
    """
    n, d = 400, 12
    u = np.random.default_rng(2).standard_normal(int(ratio * n) + d)
    options = dict(fs=1.0, n_samples=n, f_min=1 / n, f_max=0.4999)
    bla = identify_noise(u[d:], u[:-d], **options)
    turned = np.angle(bla.G * np.exp(2j * np.pi * d * bla.f))
    assert bla.f.size == n // 2 - 1
    assert (
        np.max(np.abs(turned)) < 0.1
    )  # half a line off would be 0.094 in the middle, three lines 0.57 at the ends
    assert np.sqrt(np.mean(turned**2)) < 0.02


@pytest.mark.parametrize(("f_min", "f_max"), [(0.07, 0.29), (0.14, 0.28)])
def test_the_ends_of_the_band_are_lines_whatever_the_rounding(f_min, f_max):
    u = np.random.default_rng(0).standard_normal(1000)
    f = identify_noise(u, u, fs=1.0, n_samples=100, f_min=f_min, f_max=f_max).f
    np.testing.assert_allclose(f[[0, -1]], [f_min, f_max])


def test_coherence_and_level_of_a_line_are_those_of_white_noise():
    """y = 2 u + v with v as strong as 2 u: coherence 1/2, and the power of a line is that of n / 2
    equal ones.
    """
    rng = np.random.default_rng(5)
    n, u = 200, rng.standard_normal(80_000)
    y = 2 * u + 2 * rng.standard_normal(u.size)
    bla = identify_noise(u, y, fs=1.0, n_samples=n, f_min=0.02, f_max=0.48)
    few = np.sqrt(u.size / n * bla.f.size)  # independent spectra behind the averages
    assert abs(bla.coherence.mean() - 0.5) < 4 * 0.6 / few
    power = np.mean(np.abs(bla.levels.excited) ** 2) / 2
    assert abs(power / (8 / (n / 2)) - 1) < 4 * 1.1 / few


def test_a_periodic_record_has_no_coherence_and_older_files_load(tmp_path):
    ms = multisine(fs=128, n_samples=128, f_min=1, f_max=40, rng=1)
    bla = identify(Record(u=ms.u[None], y=ms.u[None], fs=128, lines=ms.lines))
    assert np.isnan(bla.coherence).all()
    assert not bla.coherence.flags.writeable
    save(bla, tmp_path / "bla.npz")
    with np.load(tmp_path / "bla.npz") as stored:
        np.savez(
            tmp_path / "older.npz",
            **{name: stored[name] for name in stored.files if name != "coherence"},
        )
    assert np.isnan(load(tmp_path / "older.npz").coherence).all()


def resonance(u):
    from scipy import signal

    w, z = 2 * np.pi * 60, 0.01
    b, a, _ = signal.cont2discrete(([1.0], [1 / w**2, 2 * z / w, 1]), 1e-3, method="bilinear")
    return signal.lfilter(b.ravel(), a, u)


NOISE = dict(fs=1000, n_samples=500, f_min=20, f_max=120)


def test_chirps_and_bursts_are_no_noise():
    rng = np.random.default_rng(0)
    t = np.arange(60_000) / 1000
    chirp = np.sin(2 * np.pi * (1 + 150 * t / 60) * t)
    burst = rng.standard_normal(t.size) * (np.arange(t.size) // 3000 % 2)
    for u in (chirp, burst):
        with pytest.warns(
            DataWarning, match=r"u must be stationary noise .* varies \d+\.\d times as much"
        ):
            identify_noise(u, resonance(u), **NOISE)


def test_the_band_that_is_proposed_holds_no_line_that_is_refused():
    """A band-stop leaves two bands; from the first to the last good line both of them and the hole
    were proposed.
    """
    U = np.fft.rfft(np.random.default_rng(3).standard_normal(20_000))
    f = np.fft.rfftfreq(20_000, 1e-3)
    u = np.fft.irfft(np.where((f > 55) & (f < 65), 0.0, U), 20_000)
    u += 1e-3 * np.arange(u.size) / u.size  # whose spectrum is smooth
    with pytest.raises(
        ValueError, match=r"ask for a band inside ([\d.]+) to ([\d.]+) Hz, the widest"
    ) as refusal:
        identify_noise(u, resonance(u), **NOISE)
    low, high = map(
        float, re.findall(r"band inside ([\d.]+) to ([\d.]+) Hz", str(refusal.value))[0]
    )
    assert not (low < 60 < high)
    assert high - low > 40
    assert identify_noise(u, resonance(u), **NOISE | dict(f_min=low, f_max=high)).f.size > 20


def test_anything_but_records_is_refused():
    for wrong in (np.ones((2, 3, 4)), "record.mat", [np.ones(5)]):
        with pytest.raises(ValueError, match="record must be a Record or a list of them, got"):
            identify(wrong)
