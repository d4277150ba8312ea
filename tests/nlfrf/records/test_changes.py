"""A gain that steps between periods, a sign that turns, an output of another rate: told from two
periods on.
"""

import warnings

import numpy as np
import pytest
from scipy import signal

import nlfrf

FS, N = 512.0, 1024


def played(seed, n_periods, noise=1e-3, settle=20, damping=0.05):
    """Input and output of a resonance at 20 Hz."""
    rng = np.random.default_rng(seed)
    w = 2 * np.pi * 20
    b, a, _ = signal.cont2discrete(([w * w], [1, 2 * damping * w, w * w]), 1 / FS)
    u = np.tile(
        nlfrf.multisine(fs=FS, n_samples=N, f_min=0.5, f_max=100, rng=rng).u[0], n_periods + settle
    )
    y = signal.lfilter(b[0], a, u)
    y = y + noise * np.std(y) * rng.standard_normal(y.size)
    return u[settle * N :], y[settle * N :]


def cut(u, y):
    return nlfrf.record_from_samples(u, y, fs=FS, n_samples=N)


def changed(y, factor, n_before):
    return np.where(np.arange(y.size) < n_before * N, y, factor * y)


@pytest.mark.parametrize("factor", [1.1, 0.9, 1.03])
@pytest.mark.parametrize(("n_periods", "n_before"), [(2, 1), (3, 2), (4, 2), (8, 4), (8, 7)])
def test_a_step_of_the_gain_is_told(factor, n_periods, n_before):
    """The bound of what was the gain before it held 0 %, without a word."""
    u, y = played(1, n_periods)
    said = rf"gain from u to y steps by \{100 * (factor - 1):+.2g} % before period {n_before + 1}"
    with pytest.warns(nlfrf.DataWarning, match=said):
        cut(u, changed(y, factor, n_before))


@pytest.mark.parametrize("noise", [1e-3, 0.1])
@pytest.mark.parametrize(("n_periods", "n_before"), [(2, 1), (3, 2), (8, 4), (8, 1)])
@pytest.mark.parametrize("resample", [False, True])
def test_a_sign_that_turns_is_refused(n_periods, n_before, noise, resample):
    """Half of the periods against the others left G at zero, without a word."""
    u, y = played(2, n_periods, noise)
    with pytest.raises(ValueError, match=rf"y changes its sign before period {n_before + 1}"):
        nlfrf.record_from_samples(
            u, changed(y, -1.0, n_before), fs=FS, n_samples=N, resample=resample
        )


@pytest.mark.parametrize("n_periods", [2, 3, 4, 8])
def test_what_rings_or_is_noise_has_no_step(n_periods):
    for seed in range(12):
        for noise, settle, damping in (
            (1e-3, 0, 0.003),
            (1e-3, 0, 0.03),
            (0.1, 0, 0.01),
            (1.0, 9, 0.1),
            (10.0, 9, 0.1),
        ):
            cut(*played(seed, n_periods, noise, settle, damping))


@pytest.mark.filterwarnings("ignore:.* seems clipped")
@pytest.mark.parametrize("n", [2, 4])
def test_an_output_that_is_held_is_told(n):
    u, y = played(3, 3)
    held = np.repeat(y[::n], n)[: y.size]
    with pytest.warns(
        nlfrf.DataWarning, match=rf"y changes at every {n}\w\w sample only: it was sampled at"
    ):
        cut(u, held)
    with warnings.catch_warnings():
        warnings.filterwarnings("error", message=".*changes at every")
        cut(np.repeat(u[::n], n)[: u.size], held)  # both by one clock, recorded by a faster one


def test_what_is_coarse_or_stands_still_is_not_held():
    rng = np.random.default_rng(0)
    smooth = np.cumsum(rng.standard_normal(4000))

    def told(x):
        """Messages about the rate of an output of one period."""
        u = nlfrf.multisine(fs=FS, n_samples=x.size, f_min=0.5, f_max=100, rng=1).u[0]
        with warnings.catch_warnings(record=True) as found:
            warnings.simplefilter("always")
            nlfrf.record_from_samples(u, x, fs=FS, n_samples=x.size)
        return [str(one.message) for one in found if "changes at every" in str(one.message)]

    for x in (
        smooth,
        np.round(smooth),
        np.round(smooth / 10),
        np.append(1.0, np.zeros(3999)),
        np.repeat(rng.standard_normal(40), 100),
    ):
        assert not told(x)
    (message,) = told(np.append([0.0, 0.0], np.repeat(smooth, 4)))  # whatever it begins with
    assert message.startswith("y changes at every 4th sample only")


def test_swapped_channels_are_told():
    """What was played repeats to the last digit, what a sensor says does not."""
    u, y = played(4, 3)
    with pytest.warns(nlfrf.DataWarning) as said:
        nlfrf.record_from_samples(y, u, fs=FS, n_samples=N)
    assert "y repeats exactly and u does not: are they swapped?" in " ".join(
        str(one.message) for one in said
    )
    nlfrf.record_from_samples(u, np.tile(y[:N], 3), fs=FS, n_samples=N)
