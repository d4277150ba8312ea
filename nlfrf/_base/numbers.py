"""Small least-squares problems in many windows at once, Fourier transforms of long signals,
quantiles of Roy's largest root.
"""

from __future__ import annotations

import os
from functools import lru_cache

import numpy as np

EPS = float(np.finfo(float).eps)
TINY = float(np.finfo(float).tiny)  # replaces a zero divisor
SMALL_NORM = TINY**0.25  # the same for a divisor that is squared
_PILE_RATIO = (
    4.0  # samples at an extreme over those at the next level: a rounded parabola has at most 2.4
)


def two_unknowns(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Solve x1 first + x2 second = b by least squares (Gram-Schmidt); return x and the residual.

    `rows` (..., 3, n) holds b, first and second; x is (..., 2), zero for dependent vectors.
    """
    first = rows[..., 1:2, :]
    along = np.vecdot(first, rows)
    n_first = np.maximum(along[..., 1].real, TINY)
    along /= n_first[..., None]
    left = rows[..., ::2, :] - along[..., ::2, None] * first
    b, second = left[..., 0, :], left[..., 1, :]
    across, n_second = np.moveaxis(np.vecdot(second[..., None, :], left), -1, 0)
    n_second = np.where(n_second.real > 1e-20 * n_first, n_second.real, np.inf)
    x = np.empty((*n_first.shape, 2), dtype=rows.dtype)
    x_second = np.divide(across, n_second, out=x[..., 1])
    np.subtract(along[..., 0], along[..., 2] * x_second, out=x[..., 0])
    b -= x_second[..., None] * second
    return x, b


def least_squares(A: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Solve A x = b in many windows at once, for the last unknown.

    Parameters
    ----------
    A : (..., n, p) ndarray
    b : (..., n) ndarray

    Returns
    -------
    last : (...) ndarray
        The last unknown: in the QR factors it needs no back substitution.
    residual : (..., n) ndarray
        Residual over the root of its n - p degrees of freedom.
    leverage : (...) ndarray
        Variance of the last unknown over that of b.
    """
    scale = np.sqrt(power(np.swapaxes(A, -1, -2)))
    scale = np.where(scale > 0, scale, 1.0)
    Q, R = np.linalg.qr(A / scale[..., None, :])
    diagonal = np.abs(np.diagonal(R, axis1=-2, axis2=-1))
    projected = (np.swapaxes(Q, -1, -2).conj() @ b[..., None])[..., 0]
    projected = np.where(
        diagonal > 1e-13, projected, 0.0
    )  # a column spanned by the others carries no information
    residual = b - (Q @ projected[..., None])[..., 0]
    pivot = np.where(diagonal[..., -1] > 1e-13, R[..., -1, -1] * scale[..., -1], np.inf)
    return (
        projected[..., -1] / pivot,
        residual / np.sqrt(A.shape[-2] - A.shape[-1]),
        1 / np.abs(pivot) ** 2,
    )


def squared_modulus(x: np.ndarray) -> np.ndarray:
    """Return the squared modulus, without the root of `abs`."""
    return np.asarray(x.real**2 + x.imag**2)


def power(x: np.ndarray) -> np.ndarray:
    """Return the sum of squared moduli over the last axis."""
    return np.asarray(np.vecdot(x, x).real)


def mean_power(x: np.ndarray) -> np.ndarray:
    """Return the mean squared modulus over the first axis, the realisations."""
    return np.asarray(np.add.reduce(squared_modulus(x), axis=0) / x.shape[0])


def rms(x: np.ndarray) -> np.ndarray:
    """Return the root mean square modulus over the first axis, the realisations."""
    return np.sqrt(mean_power(x))


# ---- Work on long signals in blocks, by Fourier transforms that NumPy does not provide.
#
# The import of those of SciPy would take longer than their use.

BLOCK_ENTRIES = 1 << 17  # numbers in a block, which fits into the cache
_LONG_SIGNAL = 1 << 17  # samples above which threads are worth their import
_PART_SAMPLES = 1 << 16  # samples of a part, whose transform fits into the cache
_N_TOGETHER = 8  # parts read at a time: the samples of a cache line
_FEW_PARTS = 8  # samples per line and part, above which a long transform is composed of parts


def iterate_blocks(n: int, size: int = 1) -> list[slice]:
    """Return slices of n entries with `size` numbers each, in blocks that fit into the cache.

    >>> iterate_blocks(5, BLOCK_ENTRIES // 2)
    [slice(0, 2, None), slice(2, 4, None), slice(4, 5, None)]
    """
    step = max(1, BLOCK_ENTRIES // size)
    return [slice(first, min(first + step, n)) for first in range(0, n, step)]


def clipped_share(x: np.ndarray) -> float:
    """Return the share of samples at the largest or smallest value, if they are there in runs
    because of clipping.

    A signal with few levels, as of integers, also has runs at its extremes, but no longer than at
    the next level: smooth peaks have at most `_PILE_RATIO` times as many samples in the highest
    one.

    >>> x = np.sin(np.arange(1000) / 50)
    >>> clipped_share(np.round(10 * x)), clipped_share(np.clip(np.round(10 * x), -7, 7)) > 0.2
    (0.0, True)
    """
    n = 0
    for signed, extreme in ((1.0, float(x.max())), (-1.0, float(x.min()))):
        some_in_a_row, flat_ones, following = False, 0, -np.inf
        for some in iterate_blocks(x.size):
            part = x[max(0, some.start - 2) : some.stop]
            flat = part == extreme  # a run may begin in the block before
            some_in_a_row |= bool(np.any(flat[2:] & flat[1:-1] & flat[:-2]))
            flat_ones += int(np.count_nonzero(flat[min(2, some.start) :]))
            following = max(following, float(np.max(signed * part[~flat], initial=-np.inf)))
        if some_in_a_row:
            costs = sum(
                int(np.count_nonzero(x[some] == signed * following))
                for some in iterate_blocks(x.size)
            )
            n += flat_ones if flat_ones > _PILE_RATIO * costs else 0
    return n / x.size


def all_finite(x: np.ndarray) -> bool:
    """Return whether every number of an array of any shape is finite.

    A nan or an infinite number stays in a sum, which takes one pass. A sum of finite numbers may
    overflow, so only a finite sum decides.
    """
    if x.size > BLOCK_ENTRIES:
        with np.errstate(over="ignore", invalid="ignore"):
            if np.isfinite(np.add.reduce(x, axis=None)):
                return True
    return bool(np.isfinite(x).all())


def streams_equal(x: np.ndarray, other: np.ndarray) -> bool:
    """Return whether two streams (n,) are equal, number by number; stop at the first block that
    differs.
    """
    return all(np.array_equal(x[some], other[some]) for some in iterate_blocks(x.size))


def has_equal_periods(x: np.ndarray) -> bool:
    """Return whether the periods of x (M, P, N) are equal in each realisation, number by number."""
    if x[:, 0].size <= BLOCK_ENTRIES:
        return bool((x[:, 1:] == x[:, :1]).all())
    return all(streams_equal(one[0], period) for one in x for period in one[1:])


def is_constant(x: np.ndarray) -> bool:
    """Return whether all numbers of a stream (n,), or of periods (P, N), are equal; stop at the
    first other block.
    """
    rows = np.atleast_2d(x)
    return all(
        bool((row[some] == rows[0, 0]).all()) for row in rows for some in iterate_blocks(row.size)
    )


def smallest_step(x: np.ndarray) -> float:
    """Return the smallest step between neighbouring samples, as of an encoder; zero for a
    constant.
    """
    x = np.asarray(x)
    steps = np.abs(np.diff(x.ravel()))
    steps = steps[steps > 1e-9 * np.ptp(x)]
    if steps.size:
        return float(steps.min())
    return 0.0


@lru_cache(maxsize=64)
def fast_length(n: int) -> int:
    """Return the smallest 2^a 3^b 5^c that is at least n: a length for a fast FFT.

    >>> [fast_length(n) for n in (1, 7, 1000, 1025, 8193)]
    [1, 8, 1000, 1080, 8640]
    """
    powers = range(n.bit_length())
    odd = (3**b * 5**c for b in powers for c in powers)
    return min(one << max(-(-n // one) - 1, 0).bit_length() for one in odd)


def rfft(x: np.ndarray) -> np.ndarray:
    """Return `numpy.fft.rfft` along the last axis, in several threads for a long one.

    >>> bool(np.array_equal(rfft(np.ones((2, 8))), np.fft.rfft(np.ones((2, 8)))))
    True
    """
    if x.size <= _LONG_SIGNAL:
        return np.fft.rfft(x)
    from scipy import fft

    return np.asarray(fft.rfft(x, workers=os.cpu_count() or 1))


def rfft_at(x: np.ndarray, lines: np.ndarray) -> np.ndarray:
    """Return (..., K) `rfft` of x (..., n) at some lines; a long one is composed of short ones.

    The samples a, a + A, a + 2 A, ... have a transform X_a of n / A lines, and X[k] is the sum over
    a of X_a[k] exp(-2j pi k a / n), where X_a is periodic beyond its lines (decimation in time;
    Cooley & Tukey, 1965). For few lines this is faster than the whole transform, and takes less
    memory.

    >>> x = np.sin(np.arange(1 << 18))
    >>> lines = np.array([0, 1, 70_000, 1 << 17])
    >>> bool(np.allclose(rfft_at(x, lines), np.fft.rfft(x)[lines], rtol=0, atol=1e-9))
    True
    """
    n = x.shape[-1]
    n_parts = _number_of_parts(n, lines.size)
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
        for first in range(0, n_parts, _N_TOGETHER):
            transformed = np.fft.rfft(
                np.ascontiguousarray(parts[:, first : first + _N_TOGETHER].T)
            ).take(at, axis=1)
            transformed.imag *= sign
            for a, part in enumerate(transformed, first):
                spectra[where] += np.exp(-2j * np.pi / n * (a * lines % n)) * part
    return spectra


@lru_cache(maxsize=64)
def _number_of_parts(n: int, n_lines: int) -> int:
    """Return the number of parts of a transform with n samples for `n_lines` lines; 1 if parts do
    not pay.
    """
    if n <= 2 * _LONG_SIGNAL:
        return 1
    least = -(-n // _PART_SAMPLES)
    return next(
        (
            parts
            for parts in range(least, 8 * least)
            if n % parts == 0 and n_lines * parts * _FEW_PARTS <= n
        ),
        1,
    )


# ---- Roy's largest root: the exact law of the largest singular value of a matrix of estimates over
# its own scatter.
#
# Z = C^-1/2 dG Gamma^-1/2, with C = S/L estimated from L complex degrees of freedom. The largest
# root t of det(H - t (H + S)) = 0, H the square of Z, has the law of the largest eigenvalue of a
# Jacobi ensemble:
#
#     P(sigma_max^2 <= x) = det [ integral_0^t p_i p_j w ],  i, j < s,  w = th^a (1 - th)^b,  t = x
#     / (L + x)
#
# with s = min(n_y, n_u), a = |n_u - n_y|, b = L - n_y and p_i orthonormal on [0, 1] under w; for L
# = inf the weight is that of Laguerre. One input: Hotelling. (Khatri 1964; C. G. Khatri, Ann. Math.
# Statist. 35, p. 1807.)

_N_NODES = 200


def _roy_probability(x: float, n_y: int, n_u: int, dof: float) -> float:
    """Return P(sigma_max^2 <= x) for an (n_y, n_u) matrix over a covariance with `dof` complex
    degrees of freedom.

    >>> round(_roy_probability(9.391049, 2, 2, 12.0), 6)
    0.95
    """
    from scipy.special import eval_genlaguerre, eval_jacobi, gammaln

    s, a = min(n_y, n_u), abs(n_u - n_y)
    nodes, weights = _nodes_and_weights()
    i = np.arange(s)[:, None]
    if np.isinf(dof):
        theta = x * nodes
        log_norm = gammaln(i + a + 1) - gammaln(i + 1)
        p = eval_genlaguerre(i, a, theta) * np.exp(a * np.log(theta) / 2 - theta / 2 - log_norm / 2)
        gram = (p * weights * x) @ p.T
    else:
        b = dof - n_y
        t = x / (dof + x)
        theta = t * nodes
        # norm of the Jacobi polynomials P_i^(b, a)(2 theta - 1) on [0, 1]
        log_norm = gammaln(i + a + 1) + gammaln(i + b + 1) - gammaln(i + 1) - gammaln(i + a + b + 1)
        log_norm = log_norm - np.log(2 * i + a + b + 1)
        half = (a * np.log(theta) + b * np.log1p(-theta) - log_norm) / 2
        p = eval_jacobi(i, b, a, 2 * theta - 1) * np.exp(half)
        gram = (p * weights * t) @ p.T
    return float(np.clip(np.linalg.det(gram), 0.0, 1.0))


@lru_cache(maxsize=1)
def _nodes_and_weights() -> tuple[np.ndarray, np.ndarray]:
    """Return Gauss-Legendre nodes and weights on [0, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(_N_NODES)
    return (nodes + 1) / 2, weights / 2


@lru_cache(maxsize=512)
def roy_quantile(p: float, n_y: int, n_u: int, dof: float) -> float:
    """Return the p-quantile of the squared largest singular value; dof > n_y - 1 need not be a
    whole number.

    >>> round(roy_quantile(0.95, 1, 1, 6.0), 6)       # F(2, 12)
    3.885294
    """
    from scipy.optimize import brentq

    if not dof > n_y - 1:
        raise ValueError(
            f"dof must be more than n_y - 1 = {n_y - 1} for a bound on the whole matrix, got"
            f" {dof:g}"
        )
    high = 4.0 * (n_y + n_u)
    while _roy_probability(high, n_y, n_u, dof) < p:
        high *= 2
        if high > 1e12:
            raise ValueError(
                f"dof must be larger for a bound at probability {p:g}, got {dof:g} for {n_y}"
                " outputs"
            )
    return float(
        brentq(lambda x: _roy_probability(x, n_y, n_u, dof) - p, 1e-9, high, xtol=1e-12, rtol=1e-13)
    )


def clip(x: np.ndarray, least: float, most: float) -> np.ndarray:
    """Return `numpy.clip` without its checks of arguments, which dominate for short arrays."""
    return np.minimum(np.maximum(x, least), most)
