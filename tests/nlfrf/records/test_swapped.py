"""Input and output that are swapped: the multisine is found in the other channel, and the message
says so.
"""

import warnings

import numpy as np
import pytest

import nlfrf
from tests.support.belt import FS, PERIOD, run, write_log

SWAPPED = {"u": "Position [mm]", "y": "Kraft [N]"}


def noisy(signal, seed):
    """A channel that repeats in no digit."""
    return signal + 1e-3 * signal.std() * np.random.default_rng(seed).standard_normal(signal.size)


@pytest.mark.parametrize("lost", [[], [6507]])
def test_the_channel_with_the_multisine_is_named(tmp_path, lost):
    """4aa289a: "the period of u seems to be 3999.53 samples", and that was all."""
    path = write_log(tmp_path / "belt.csv", lost=lost, time=False)
    said = r"the multisine is found in y \(Kraft\).*not in u \(Position\).*swapped"
    if lost:
        with pytest.raises(ValueError, match=f"{said}.*the period of u seems to be"):
            nlfrf.load_record(path, fs=FS, **SWAPPED)
    else:
        with pytest.warns(nlfrf.DataWarning, match=said):
            nlfrf.load_record(path, fs=FS, **SWAPPED)


def test_a_measured_force_is_recognised_too():
    force, position = run()
    with pytest.warns(nlfrf.DataWarning, match="the multisine is found in y"):
        nlfrf.record_from_samples(position, noisy(force, 1), fs=FS, n_samples=PERIOD)


def test_a_period_that_is_wrong_for_both_is_refused_with_the_hint():
    force, position = run()
    with pytest.raises(
        ValueError, match=r"the multisine is found in y.*n_samples must be the period of the input"
    ):
        nlfrf.record_from_samples(position, noisy(force, 1), fs=FS, n_samples=PERIOD - 40)


@pytest.mark.parametrize("seed", range(6))
def test_the_right_way_round_nothing_is_said(seed):
    """Even lines, lines of a shape, and what a machine that undoes that shape makes of them."""
    rng = np.random.default_rng(seed)
    force, position = run()
    shape = {"rms": 1.0} if seed % 2 else {"amplitude": lambda f: 1 / (1 + (f / 5) ** 2)}
    ms = nlfrf.multisine("odd", fs=FS, n_samples=1000, f_min=1, f_max=100, rng=seed, **shape)
    u = np.tile(ms.u[0], 3)
    f = np.fft.rfftfreq(u.size, 1 / FS)
    undone = np.fft.irfft(np.fft.rfft(u) * (1 + (f / 5) ** 2), u.size)
    undone += (
        1e-2 * undone.std() * np.sign(undone)
    )  # the machine's own distortion, between the lines
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        nlfrf.record_from_samples(noisy(force, seed), position, fs=FS, n_samples=PERIOD)
        nlfrf.record_from_samples(
            u, undone + 1e-3 * rng.standard_normal(u.size), fs=FS, n_samples=1000
        )
