"""Decimation of long, smooth signals: means over blocks of samples show faults and period as well."""

from __future__ import annotations

import numpy as np

_CHUNK_SAMPLES = 1 << 16  # samples from which smoothness is estimated
_SMOOTH_CORRELATION = (
    0.994  # least ratio of autocorrelations over a block: its mean then has 99.9 % of the power
)
_MAX_STEP = 1024  # largest block


def smooth_step(x: np.ndarray) -> int:
    """Return the number of samples, a power of two, over which a signal (n,) changes by little more
    than its noise.

    White noise is absent from the autocorrelation at one sample, so this value is the reference.
    """
    first = max(0, (x.size - _CHUNK_SAMPLES) // 2)
    part = x[first : first + _CHUNK_SAMPLES]
    part = part - part.mean()

    def left(lag: int) -> float:
        return float(np.vdot(part[lag:], part[:-lag])) / (part.size - lag)

    step, one = 1, left(1)
    while (
        one > 0
        and step < _MAX_STEP
        and 64 * step < part.size
        and left(2 * step) > _SMOOTH_CORRELATION * one
    ):
        step *= 2
    return step


def common_smooth_step(signals: list[np.ndarray], n_samples: int) -> int:
    """Return the number of samples, a divisor of n_samples, over which all signals (n,) are
    smooth.
    """
    step = min(map(smooth_step, signals))
    while n_samples % step:
        step //= 2
    return step


def decimate(x: np.ndarray, step: int) -> np.ndarray:
    """Return (P, N / step) means of x (P, N) over blocks of `step` samples.

    >>> decimate(np.arange(8.0)[None], 4)
    array([[1.5, 5.5]])
    """
    if step == 1:
        return x
    return np.array([one.reshape(-1, step) @ np.full(step, 1 / step) for one in x])
