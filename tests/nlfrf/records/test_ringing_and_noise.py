"""Sound records that look like faults of the output: it still rings, or is mostly noise; faults beside a transient."""

import warnings

import numpy as np
import pytest

import nlfrf
from benchmarks.sound_records import FS, N, played, without
from nlfrf.records.output_faults import follow


def held(u, y, truth):
    """Share of the lines that the bound holds, without a word of a fault."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        bla = nlfrf.identify(nlfrf.record_from_samples(u, y, fs=FS, n_samples=N))
    return np.mean(np.abs(bla.G - truth(bla.f)) < bla.bound())


@pytest.mark.parametrize("damping", [0.003, 0.01, 0.03])
@pytest.mark.parametrize("n_periods", [2, 3, 4])
def test_an_output_that_still_rings_is_no_clock_and_no_lost_sample(damping, n_periods):
    # of each case 3 to 12 of 15 were refused, for a clock or for periods that do not repeat
    runs = [played(damping, n_periods, seed, settled=False) for seed in range(8)]
    assert np.mean([held(u, y, truth) for _, u, y, truth in runs]) > 0.9


@pytest.mark.parametrize("n_periods", [3, 4, 8, 12])
@pytest.mark.parametrize("noise", [2, 3, 10])
def test_an_output_that_is_mostly_noise_is_not_refused_for_it(n_periods, noise):
    # at ten times the signal, from eight periods on, every record was refused
    runs = [played(0.1, n_periods, seed, settled=True, noise=noise) for seed in range(6)]
    assert np.mean([held(u, y, truth) for _, u, y, truth in runs]) > 0.9


@pytest.mark.parametrize("lost", [1, 5])
@pytest.mark.parametrize("n_periods", [2, 3, 4, 8])
def test_a_gap_is_still_told(lost, n_periods):
    for seed in range(8):
        _, u, y, _ = played(0.1, n_periods, seed, settled=True)
        y = without(y, lost, seed)
        with pytest.raises(ValueError, match="y must stand still against u from period to period"):
            nlfrf.record_from_samples(u, y, fs=FS, n_samples=N)


def test_a_gap_behind_a_transient_is_told_and_cured():
    ms, u, y, truth = played(0.01, 6, 1, settled=False)
    gone = np.delete(y, np.arange(3 * N + 300, 3 * N + 307))
    lag = follow(u[: 5 * N].reshape(5, N), gone[: 5 * N].reshape(5, N), ms.lines.excited)
    assert "7 lost before period 5" in lag.fault
    assert lag.delay[4] == pytest.approx(-7, abs=0.01)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        record = nlfrf.record_from_samples(u[: gone.size], gone, fs=FS, n_samples=N, resample=True)
    bla = nlfrf.identify(record)
    assert np.mean(np.abs(bla.G - truth(bla.f)) < bla.bound()) > 0.85


def test_noise_of_a_delay_is_that_of_the_lines_that_carry_signal():
    # a plant that rolls off leaves most lines to noise, which made the delays look known
    delays, said = [], []
    for seed in range(30):
        ms, u, y, _ = played(0.1, 8, seed, settled=True, noise=0.5)
        lag = follow(u.reshape(8, N), y.reshape(8, N), ms.lines.excited)
        delays.append(lag.delay[1:] - lag.delay[1:].mean())
        said.append(lag.noise)
    assert np.std(delays) == pytest.approx(np.median(said), rel=0.25)


@pytest.mark.parametrize(("lost", "at"), [(1, 769), (5, 530), (5, 963), (7, 700)])
@pytest.mark.parametrize("noise", [1e-3, 0.1])
def test_a_gap_in_the_first_period_is_told_and_cured(lost, at, noise):
    # the first period was taken for a transient: all that follows is early against u, and the bound held 0 %
    _, u, y, truth = played(0.1, 8, 23, settled=True, noise=noise)
    y = np.concatenate([y[:at], y[at + lost :], y[-N : -N + lost]])
    with pytest.raises(ValueError, match=f"{lost} lost before period 2"):
        nlfrf.record_from_samples(u, y, fs=FS, n_samples=N)
    record = nlfrf.record_from_samples(u, y, fs=FS, n_samples=N, resample=True)
    bla = nlfrf.identify(record)
    assert record.n_periods == 7
    assert np.mean(np.abs(bla.G - truth(bla.f)) < bla.bound()) > 0.85
