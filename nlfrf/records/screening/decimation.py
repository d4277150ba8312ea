"""Long signals looked at coarsely, where they are smooth: their faults, and their period, show there as well."""

from __future__ import annotations

import numpy as np

_CHUNK_SAMPLES = 1 << 16  # samples by which it is told how smooth a signal is
_SMOOTH_CORRELATION = (
    0.994  # of the autocorrelation that is left after as many samples: their mean then has 99.9 % of the power
)
_MAX_STEP = 1024  # samples looked over at most


def smooth_step(x: np.ndarray) -> int:
    """Over how many samples, a power of two, a signal (n,) changes by little but its noise.

    White noise is gone from the autocorrelation one sample away, so it is held against that.
    """
    first = max(0, (x.size - _CHUNK_SAMPLES) // 2)
    part = x[first : first + _CHUNK_SAMPLES]
    part = part - part.mean()

    def left(lag: int) -> float:
        return float(np.vdot(part[lag:], part[:-lag])) / (part.size - lag)

    step, one = 1, left(1)
    while one > 0 and step < _MAX_STEP and 64 * step < part.size and left(2 * step) > _SMOOTH_CORRELATION * one:
        step *= 2
    return step


def common_smooth_step(signals: list[np.ndarray], n_samples: int) -> int:
    """Over how many samples, a divisor of n_samples, all of some signals (n,) are smooth."""
    step = min(map(smooth_step, signals))
    while n_samples % step:
        step //= 2
    return step


def decimate(x: np.ndarray, step: int) -> np.ndarray:
    """Return (P, N / step) means of x (P, N) over `step` samples each; x itself for one.

    >>> decimate(np.arange(8.0)[None], 4)
    array([[1.5, 5.5]])
    """
    if step == 1:
        return x
    return np.array([one.reshape(-1, step) @ np.full(step, 1 / step) for one in x])
