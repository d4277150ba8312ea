"""Fourier transforms that NumPy does not name; SciPy's would take longer to import than all that they are used for."""

from __future__ import annotations

import os
from functools import lru_cache

import numpy as np

__all__ = ["dct_even", "fast_length", "rfft"]

LONG = 1 << 17  # samples past which threads are worth the import


@lru_cache(maxsize=64)
def fast_length(n: int) -> int:
    """The least 2^a 3^b 5^c that is n or more: a length that the FFT is quick for.

    >>> [fast_length(n) for n in (1, 7, 1000, 1025, 8193)]
    [1, 8, 1000, 1080, 8640]
    """
    best = 1 << max(int(n) - 1, 0).bit_length()
    five = 1
    while five < best:
        three = five
        while three < best:
            twos = 1 << max(-(-n // three) - 1, 0).bit_length()
            best = min(best, three * twos)
            three *= 3
        five *= 5
    return best


def dct_even(half: np.ndarray) -> np.ndarray:
    """(..., n + 1) DFT of a real even sequence of period 2 n, from and to its samples 0 ... n (DCT-I).

    >>> dct_even(np.array([1.0, 0.5, 0.25]))
    array([2.25, 0.75, 0.25])
    """
    n = half.shape[-1] - 1
    whole = np.empty((*half.shape[:-1], 2 * n))
    whole[..., : n + 1], whole[..., n + 1 :] = half, half[..., -2:0:-1]
    return np.ascontiguousarray(np.fft.rfft(whole).real)


def rfft(x: np.ndarray) -> np.ndarray:
    """`numpy.fft.rfft` along the last axis; in several threads where it is long.

    >>> bool(np.array_equal(rfft(np.ones((2, 8))), np.fft.rfft(np.ones((2, 8)))))
    True
    """
    if x.size <= LONG:
        return np.fft.rfft(x)
    from scipy import fft

    return np.asarray(fft.rfft(x, workers=os.cpu_count() or 1))
