"""Line detection where the actuator distorts, the design as reference, grids that are not those of
the record.
"""

import numpy as np
import pytest

import nlfrf
from nlfrf import DataWarning, Record, identify, load_record, multisine, record_from_samples
from nlfrf.signals import LineGrid

ACTUATORS = {
    "sound": lambda u: u,
    "saturation at 1.3 sigma": lambda u: np.clip(u, -1.3, 1.3),
    "dead zone of 0.3 sigma": lambda u: np.sign(u) * np.maximum(np.abs(u) - 0.3, 0),
    "cube and square of 10 %": lambda u: u + 0.1 * u**3 + 0.1 * u**2,
}


@pytest.mark.filterwarnings("ignore::nlfrf.DataWarning")
@pytest.mark.parametrize("actuator", ACTUATORS)
@pytest.mark.parametrize("kind", ["full", "odd", "odd-odd", "special-odd"])
@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_the_lines_played_are_found_through_a_distorting_actuator(kind, actuator, noise):
    for seed in range(2):
        rng = np.random.default_rng(seed)
        ms = multisine(kind, fs=4096, n_samples=4096, f_min=1, f_max=390, rng=rng)
        u = ACTUATORS[actuator](np.tile(ms.u, (2, 1)))
        u = (u + noise * rng.standard_normal(u.shape)).ravel()
        found = record_from_samples(u, u, fs=4096, n_samples=4096)
        np.testing.assert_array_equal(found.lines.excited, ms.lines.excited)


def test_a_random_odd_grid_that_cannot_be_told_from_distortion_is_warned_of():
    ms = multisine("random-odd", fs=4096, n_samples=4096, f_min=1, f_max=390, rng=0)
    u = np.tile(np.clip(ms.u[0], -0.8, 0.8), 2)
    with pytest.warns(DataWarning) as said:
        found = record_from_samples(u, u, fs=4096, n_samples=4096)
    assert any(
        "lines that were found in the input differ by 4.7 dB from line to line" in str(w.message)
        for w in said
    )
    assert found.lines.excited.size > 200
    with pytest.warns(DataWarning) as said:
        record = record_from_samples(u, u, fs=4096, n_samples=4096, design=ms)
    np.testing.assert_array_equal(record.lines.excited, ms.lines.excited)


@pytest.fixture
def played():
    """Three realisations through a saturating actuator and a resonance, recorded from some sample
    on, with noise.
    """
    rng = np.random.default_rng(5)
    ms = multisine(fs=1024, n_samples=1024, f_min=1, f_max=200, n_realizations=3, rng=rng)
    s = 2j * np.pi * np.arange(513)
    plant = 1 / (1 + 0.05 * s / 250 + (s / 250) ** 2)
    us, ys = [], []
    for m, start in ((2, 100), (0, 723), (1, 311)):
        u = np.clip(ms.u[m], -1.3, 1.3)
        y = np.fft.irfft(np.fft.rfft(u) * plant, 1024)
        us.append(np.tile(np.roll(u, -start), 3) + 1e-3 * rng.standard_normal(3072))
        ys.append(np.tile(np.roll(y, -start), 3) + 1e-3 * rng.standard_normal(3072))
    return ms, plant, us, ys


@pytest.mark.filterwarnings(
    "ignore:u must have random phases"
)  # clipped peaks: a linear plant does not mind
def test_the_design_lies_under_what_was_measured(played, tmp_path):
    ms, plant, us, ys = played
    nlfrf.save(ms, tmp_path / "ms.csv")
    for m, (u, y) in enumerate(zip(us, ys, strict=True)):
        np.savez(tmp_path / f"run{m}.npz", u=u, y=y, fs=1024.0)
    files = [tmp_path / f"run{m}.npz" for m in range(3)]
    record = load_record(files, design=tmp_path / "ms.npz")
    assert record.u.shape == record.r.shape == (3, 3, 1024)
    np.testing.assert_array_equal(record.lines.excited, ms.lines.excited)
    for m, (row, start) in enumerate(((2, 100), (0, 723), (1, 311))):
        np.testing.assert_allclose(
            record.r[m, 1], np.roll(ms.u[row], -start), atol=0.02
        )  # 1/200 of a sample
    bla = identify(record)
    true = plant[ms.lines.excited]
    assert np.mean(np.abs(bla.G - true) < bla.bound(0.95)) > 0.85
    assert np.max(np.abs(bla.G / true - 1)) < 0.02


def test_a_design_that_was_not_played_is_refused(played):
    _, _, us, ys = played
    other = multisine(fs=1024, n_samples=1024, f_min=1, f_max=200, rng=77)
    with pytest.raises(
        ValueError,
        match=r"design must be the one that was played, got a correlation of 0\.\d+ with the input",
    ):
        record_from_samples(us, ys, fs=1024, design=other)
    with pytest.raises(
        ValueError, match=r"fs must make one period of the design, 1 s, a whole number of samples"
    ):
        record_from_samples(us, ys, fs=1000.5, design=other)
    with pytest.raises(ValueError, match=r"design must be of type Multisine, got 'ms\.npz'"):
        record_from_samples(us, ys, fs=1024, design="ms.npz")


@pytest.mark.parametrize("noise", [0.0, 1e-9, 1e-3])
def test_a_wrong_grid_by_hand_is_refused_with_the_lines_that_are_excited(noise):
    rng = np.random.default_rng(0)
    ms = multisine(fs=1024, n_samples=1024, f_min=1, f_max=200, rng=rng)
    u = np.tile(ms.u, (3, 1))[None]
    u = u + noise * rng.standard_normal(u.shape)
    y = u + 1e-3 * rng.standard_normal(u.shape)
    listed = r"lines must be excited by the input.* lines are: 1, 3, 9, 11, 17, 19, \.\.\. 195"
    for wrong in (np.arange(1, 200, 2), np.arange(5, 200, 8), np.append(ms.lines.excited, 251)):
        record = Record(u=u, y=y, fs=1024, lines=LineGrid(excited=wrong))
        with pytest.raises(ValueError, match=listed):
            identify(record)
    identify(Record(u=u, y=y, fs=1024, lines=ms.lines))


def test_an_honest_input_under_noise_is_not_taken_for_a_wrong_grid():
    rng = np.random.default_rng(0)
    ms = multisine(fs=1024, n_samples=1024, f_min=1, f_max=200, rng=rng)
    u = np.tile(ms.u, (4, 1))[None]
    noisy = u + 2.0 * rng.standard_normal(u.shape)
    assert identify(Record(u=noisy, y=noisy, fs=1024, lines=ms.lines)).G.size == ms.f.size


def test_masked_samples_are_refused():
    u = np.ma.masked_greater(multisine(fs=64, n_samples=64, f_min=1, f_max=20, rng=0).u[0], 1.5)
    with pytest.raises(
        ValueError, match=r"u must have no masked numbers, got \d, the first at \d+; cut them out"
    ):
        record_from_samples(u, u.data, fs=64, n_samples=64)
    sound = np.ma.array(u.data)
    assert record_from_samples(sound, u.data, fs=64, n_samples=64).n_samples == 64
