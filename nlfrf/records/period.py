"""Find the period of a measured signal: the lag at which the signal is most like itself.

The autocorrelation of a whole record needs several times its memory. So a long record is first
searched for exact repeats, as from a generator. Otherwise it is decimated if it is smooth, and its
last samples are searched for in the rest. The lags found are checked with the whole record.
"""

from __future__ import annotations

import numpy as np

from nlfrf._base.numbers import TINY, fast_length, iterate_blocks, streams_equal
from nlfrf.records.screening.decimation import decimate, smooth_step
from nlfrf.records.screening.input import track_input

LONG_SIGNAL = 1 << 17  # largest number of samples for a whole autocorrelation
_FIRST_SAMPLES = 256  # samples that are searched for bit by bit
_MAX_LAGS = 1000  # tries after which the search for an exact repeat ends
_TEMPLATE_SAMPLES = 1 << 14  # samples at one end of a record that are searched for elsewhere
_CORRELATION_DROP = 0.05  # largest loss of correlation of that end against the whole record
_MAX_CANDIDATES = 64  # lags that are checked against the whole record
_CHUNK_SAMPLES = 1 << 21  # samples that this check uses
_MAX_MOVES = 8  # steps that refine a lag to less than a sample
_MIN_CORRELATION = 0.5  # smallest correlation at the period
_MIN_REPEATED = 0.75  # smallest share of the power that repeats from period to period
_LAG_RESOLUTION = 4  # points per sample of a correlation


def detect_period(u: np.ndarray) -> float:
    """Return the period of a signal in samples, not rounded, from its autocorrelation.

    Parameters
    ----------
    u : (n,) ndarray
        At least two periods.

    Raises
    ------
    ValueError
        The signal does not repeat within its length, or repeats better with its sign changed: half
        a period of an odd multisine is followed by its negative, and behind a resonance a similar
        stretch follows nearby.
    """
    if u.size > LONG_SIGNAL:
        period = _bitwise_period(u) or _period_of_long_signal(u)
        if period:
            return period
    return _period_by_autocorrelation(u)


def detect_repetition(u: np.ndarray) -> float:
    """Return `detect_period` of a signal (n,); refuse a signal that is like itself for a few cycles
    only.
    """
    period = detect_period(u)
    if not is_repeated(u, period):
        raise ValueError(describe_no_repetition(u.size))
    return period


def _period_by_autocorrelation(u: np.ndarray) -> float:
    """Return `detect_period` from the autocorrelation of the whole signal."""
    u = u - u.mean()
    n = u.size
    n_padded = fast_length(2 * n)
    spectrum = np.abs(np.fft.rfft(u, n_padded)) ** 2
    # normalised by the energy of the two overlapping pieces, so that a repetition gives 1 at any
    # lag
    energy = np.concatenate(([0.0], np.cumsum(u**2)))
    lag = np.arange(n // 2 + 1)
    overlap = np.maximum(np.sqrt(energy[n - lag] * (energy[-1] - energy[lag])), TINY)
    rho = np.fft.irfft(spectrum, n_padded)[: lag.size] / overlap
    negative = np.flatnonzero(rho < 0)  # past the main lobe around lag 0
    if negative.size:
        rho[: negative[0]] = 0.0
        top = np.zeros(1)
        if rho.max() > _MIN_CORRELATION:
            top, place = _interpolate_peaks(spectrum, n_padded, overlap)
            top[: negative[0] + 1] = 0.0
        if top.max() > 0 and _is_as_good(top.max(), -rho.min()):
            highest = (top[1:-1] >= top[:-2]) & (top[1:-1] >= top[2:])
            as_good = _is_as_good(top, top.max()) & np.concatenate(([False], highest, [True]))
            peak = int(np.argmax(as_good))
            reach = slice(peak, min(peak + max(3, peak // 100), top.size))
            peak += int(np.argmax(top[reach]))
            return float(place[peak])
    raise ValueError(describe_no_repetition(n))


def describe_no_repetition(n: int) -> str:
    """Return the message for a signal of n samples that contains no period twice."""
    return (
        f"u must repeat at least once within its {n} samples for its period to be found: give"
        f" n_samples={n} if the record is one whole period; else give the design that was played,"
        " or the period"
    )


def is_repeated(u: np.ndarray, period: float) -> bool:
    """Return whether a signal (n,) repeats at a period from its first period to its last.

    A ringing signal is like itself a few cycles later, but no more at the end of the record.

    >>> t = np.arange(1000)
    >>> is_repeated(np.sin(0.1 * np.pi * t), 20.0), is_repeated(np.exp(-t / 100) * np.sin(0.1 * np.pi * t), 20.0)
    (True, False)
    """
    n = int(period)
    starts = np.round(np.arange(int(u.size / period) + 1) * period).astype(int)
    periods = u[starts[starts + n <= u.size, None] + np.arange(n)] - u.mean()
    share = (
        np.vdot(mean := periods.mean(axis=0), mean)
        * len(periods)
        / max(np.vdot(periods, periods), TINY)
    )
    if len(periods) < 2 or share > _MIN_REPEATED:
        return len(periods) > 1
    return (
        track_input(u, round(period)).unexplained < 1 - _MIN_REPEATED
    )  # samples may be lost between


def _interpolate_peaks(
    spectrum: np.ndarray, n: int, norm: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return (L,) the largest correlation within half a sample of each lag, over its norm (L,), and
    its place.

    The spectrum (n // 2 + 1,) gives the correlation between its samples. A parabola through three
    samples would be too low for signals of a wide band: a period of 399.75 samples would seem to be
    one of 1599.
    """
    n_lags = norm.size
    fine = _LAG_RESOLUTION * np.fft.irfft(spectrum, _LAG_RESOLUTION * n)
    fine = np.concatenate((fine[-_LAG_RESOLUTION // 2 - 1 :], fine[: _LAG_RESOLUTION * n_lags + 1]))
    norm = np.append(norm, 2 * norm[-1] - norm[-2])  # the last lag has half a sample behind it, too
    fine /= np.interp(
        (np.arange(fine.size) - _LAG_RESOLUTION // 2 - 1) / _LAG_RESOLUTION,
        np.arange(n_lags + 1),
        norm,
    )
    left, middle, right = fine[:-2], fine[1:-1], fine[2:]
    bend = 2 * middle - left - right
    peak = (middle >= left) & (middle >= right) & (bend > 0)
    slope = np.where(peak, left - right, 0.0)
    bend = np.where(peak, bend, 1.0)
    raised, offset = middle + slope**2 / (8 * bend), -slope / (2 * bend)
    # from half a sample before each lag to half a sample behind it, both ends included
    windows = np.lib.stride_tricks.sliding_window_view(raised, _LAG_RESOLUTION + 1)[
        ::_LAG_RESOLUTION
    ][:n_lags]
    best = np.argmax(windows, axis=1)
    rows = np.arange(n_lags)
    place = (
        rows
        + (best - _LAG_RESOLUTION // 2 + offset[_LAG_RESOLUTION * rows + best]) / _LAG_RESOLUTION
    )
    return windows[rows, best], place


def _parabola_vertex(rho: np.ndarray, peak: int) -> float:
    """Return the offset of the vertex of the parabola through a peak and its neighbours."""
    if not 0 < peak < rho.size - 1:
        return 0.0
    left, top, right = rho[peak - 1 : peak + 2]
    curvature = left - 2 * top + right
    if curvature < 0:
        return float(0.5 * (left - right) / curvature)
    return 0.0


def _bitwise_period(u: np.ndarray) -> float:
    """Return the smallest lag at which a signal repeats bit by bit; 0 if there is none."""
    head = u[:_FIRST_SAMPLES]
    anchor = int(np.argmax(np.abs(head - head.mean())))  # a value that is rare
    tries = 0
    if np.ptp(head) == 0:
        return 0.0
    for some in iterate_blocks(u.size // 2 - 1):
        first = some.start + 1
        for at in np.flatnonzero(
            u[first + anchor : some.stop + 1 + anchor] == head[anchor]
        ).tolist():
            lag = first + at
            tries += 1
            if np.array_equal(u[lag : lag + _FIRST_SAMPLES], head) and streams_equal(
                u[lag:], u[:-lag]
            ):
                return float(lag)
            if tries == _MAX_LAGS:
                return 0.0
    return 0.0


def _period_of_long_signal(u: np.ndarray) -> float:
    """Return the period of a long signal; 0 if only its whole autocorrelation can show it."""
    step = smooth_step(u)
    rough = decimate(u[np.newaxis, : u.size // step * step], step)[0]
    rough = rough - rough.mean()
    found, lowest = _template_lags(rough)
    if not found or not _is_as_good(max(found.values()), -lowest):
        return 0.0
    best = _lagged_correlation(u, round(step * max(found, key=lambda lag: found[lag])))
    for lag in found:
        like = _lagged_correlation(u, step * lag)
        if like > _MIN_CORRELATION and _is_as_good(like, best):
            return _refine_lag(u, step * lag, step)
    return 0.0


def _is_as_good(like: float | np.ndarray, best: float) -> bool | np.ndarray:
    """Return whether correlations are as good as the best one; the first lag with such a
    correlation is the period.
    """
    return like > best - 0.1 * (1 - best) - 0.02


def _template_lags(u: np.ndarray) -> tuple[dict[int, float], float]:
    """Return increasing lags at which the stronger end of a signal (n,) is found again, with their
    correlations.

    The second value is the lowest correlation, which belongs to the signal with its sign changed.
    """
    n, length = u.size, min(_TEMPLATE_SAMPLES, u.size // 8)
    ends = float(np.vdot(u[:length], u[:length])), float(np.vdot(u[-length:], u[-length:]))
    if not (ends[0] >= ends[1]):
        u = u[::-1]
    size = fast_length(8 * length)
    template, energy = np.fft.rfft(u[:length], size).conj(), max(ends)
    found: dict[int, float] = {}
    negative, lowest = False, 0.0  # past the main lobe around lag 0
    for first in range(
        0, n // 2, size - length - 1
    ):  # neighbours overlap so that each peak has both its sides
        part = u[first : first + size]
        spectrum = np.fft.rfft(part, size) * template
        n_lags = min(part.size - length, n // 2 + 1 - first) + 1
        sums = np.concatenate(([0.0], np.cumsum(part**2)))
        sums = (sums[length:] - sums[:-length])[:n_lags]
        norm = np.sqrt(np.maximum(energy * sums, TINY))
        rho = np.fft.irfft(spectrum, size)[:n_lags] / norm
        top = _interpolate_peaks(spectrum, size, norm)[0]
        if not negative:
            below = np.flatnonzero(rho < 0)
            negative = below.size > 0
            rho[: below[0] if negative else rho.size] = 0.0
        lowest = min(lowest, float(rho.min()))
        peaks = (
            np.flatnonzero(
                (rho[1:-1] > _MIN_CORRELATION) & (rho[1:-1] >= rho[:-2]) & (rho[1:-1] > rho[2:])
            )
            + 1
        )
        found |= dict(zip((first + peaks).tolist(), top[peaks].tolist(), strict=True))
        best = max(found.values(), default=0.0)
        kept = [lag for lag, like in found.items() if _is_as_good(like, best - _CORRELATION_DROP)]
        found = {lag: found[lag] for lag in kept[:_MAX_CANDIDATES]}
    return found, lowest


def _lagged_correlation(u: np.ndarray, lag: int) -> float:
    """Return the correlation of a signal with itself `lag` samples later, from at most
    _CHUNK_SAMPLES in its middle.
    """
    first = max(0, (u.size - lag - _CHUNK_SAMPLES) // 2)
    early, late = u[first : u.size - lag][:_CHUNK_SAMPLES], u[first + lag :][:_CHUNK_SAMPLES]
    mean = np.add.reduce(early) / early.size, np.add.reduce(late) / late.size
    power = (
        np.vdot(early, early) / early.size - mean[0] ** 2,
        np.vdot(late, late) / late.size - mean[1] ** 2,
    )
    common = np.vdot(early, late) / early.size - mean[0] * mean[1]
    return float(common / np.sqrt(max(power[0] * power[1], TINY)))


def _refine_lag(u: np.ndarray, lag: int, step: int) -> float:
    """Return the lag near `lag`, to less than a sample, at which a signal smooth over `step` is
    most like itself.
    """
    middle = lag
    for _ in range(_MAX_MOVES):
        like = np.array([_lagged_correlation(u, middle + shift) for shift in (-step, 0, step)])
        offset = step * _parabola_vertex(like, 1)
        if like[1] == like.max() and abs(offset) <= 0.5 * max(1, step // 4):
            return middle + offset
        if like[1] == like.max():
            middle += round(offset)  # to the vertex of the parabola
        else:
            middle += step if like[2] > like[0] else -step
    return float(lag)
