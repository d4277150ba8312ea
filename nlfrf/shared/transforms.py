"""Work on long signals: a block at a time, by Fourier transforms that NumPy does not name.

Those of SciPy would take longer to import than all that they are used for.
"""

from __future__ import annotations

import os
from functools import lru_cache

import numpy as np

__all__ = [
    "BLOCK",
    "all_finite",
    "blocks",
    "equal",
    "fast_length",
    "is_constant",
    "repeats",
    "rfft",
    "rfft_at",
]

BLOCK = 1 << 17  # numbers that are worked on together: they stay in the cache
LONG = 1 << 17  # samples past which threads are worth the import
PART = 1 << 16  # samples of a part: its transform stays in the cache
TOGETHER = 8  # parts that are read together: the samples of a line of the cache
FEW = 8  # samples to a line and a part, from which a long transform is put together of parts


def blocks(n: int, size: int = 1) -> list[slice]:
    """n entries of `size` numbers each, as many at a time as stay in the cache.

    >>> blocks(5, BLOCK // 2)
    [slice(0, 2, None), slice(2, 4, None), slice(4, 5, None)]
    """
    step = max(1, BLOCK // size)
    return [slice(first, min(first + step, n)) for first in range(0, n, step)]


def all_finite(x: np.ndarray) -> bool:
    """Whether every number of an array of any shape is finite.

    A nan or an infinite number stays in a sum, which is one pass with nothing beside it; a sum may overflow where no
    number of it does, so only a finite one is believed.
    """
    if x.size > BLOCK:
        with np.errstate(over="ignore", invalid="ignore"):
            if np.isfinite(np.add.reduce(x, axis=None)):
                return True
    return bool(np.isfinite(x).all())


def equal(x: np.ndarray, other: np.ndarray) -> bool:
    """Whether two streams (n,) are the same, number by number; over at the first block that differs."""
    return all(np.array_equal(x[some], other[some]) for some in blocks(x.size))


def repeats(x: np.ndarray) -> bool:
    """Whether the periods of x (M, P, N) are the same in each realisation, number by number."""
    if x[:, 0].size <= BLOCK:
        return bool((x[:, 1:] == x[:, :1]).all())
    return all(equal(one[0], period) for one in x for period in one[1:])


def is_constant(x: np.ndarray) -> bool:
    """Whether all numbers of a stream (n,), or of periods (P, N), are the same; over at the first block that varies."""
    rows = np.atleast_2d(x)
    return all(bool((row[some] == rows[0, 0]).all()) for row in rows for some in blocks(row.size))


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


def rfft(x: np.ndarray) -> np.ndarray:
    """`numpy.fft.rfft` along the last axis; in several threads where it is long.

    >>> bool(np.array_equal(rfft(np.ones((2, 8))), np.fft.rfft(np.ones((2, 8)))))
    True
    """
    if x.size <= LONG:
        return np.fft.rfft(x)
    from scipy import fft

    return np.asarray(fft.rfft(x, workers=os.cpu_count() or 1))


def rfft_at(x: np.ndarray, lines: np.ndarray) -> np.ndarray:
    """(..., K) `rfft` of x (..., n) at some lines; a long one is put together of short ones.

    The samples a, a + A, a + 2 A, ... have a transform X_a of n / A lines, and X[k] is the sum over a of
    X_a[k] exp(-2j pi k a / n), where X_a repeats itself beyond its lines (decimation in time; Cooley & Tukey, 1965).
    Where few lines are wanted this is quicker than the whole transform, and takes no memory of its size.

    >>> x = np.sin(np.arange(1 << 18))
    >>> lines = np.array([0, 1, 70_000, 1 << 17])
    >>> bool(np.allclose(rfft_at(x, lines), np.fft.rfft(x)[lines], rtol=0, atol=1e-9))
    True
    """
    n = x.shape[-1]
    n_parts = parts_of(n, lines.size)
    if n_parts == 1:
        return rfft(x).take(lines, axis=-1)
    size = n // n_parts
    folded = lines % size
    mirrored = folded > size // 2
    at = np.where(mirrored, size - folded, folded)
    sign = np.where(mirrored, -1.0, 1.0)
    spectra = np.zeros((*x.shape[:-1], lines.size), dtype=complex)
    for where in np.ndindex(x.shape[:-1]):
        parts = x[where].reshape(size, n_parts)
        for first in range(0, n_parts, TOGETHER):
            transformed = np.fft.rfft(np.ascontiguousarray(parts[:, first : first + TOGETHER].T)).take(at, axis=1)
            transformed.imag *= sign
            for a, part in enumerate(transformed, first):
                spectra[where] += np.exp(-2j * np.pi / n * (a * lines % n)) * part
    return spectra


@lru_cache(maxsize=64)
def parts_of(n: int, n_lines: int) -> int:
    """Into how many parts a transform of n samples is taken apart for so many lines; 1 where that does not pay."""
    if n <= 2 * LONG:
        return 1
    least = -(-n // PART)
    return next((parts for parts in range(least, 8 * least) if n % parts == 0 and n_lines * parts * FEW <= n), 1)
