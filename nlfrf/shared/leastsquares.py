"""Small least-squares problems in many windows at once."""

from __future__ import annotations

import numpy as np

__all__ = ["EPS", "SMALL", "TINY", "least_squares", "mean_power", "power", "rms", "squared", "two_unknowns"]


EPS = float(np.finfo(float).eps)
TINY = float(np.finfo(float).tiny)  # in place of a zero that is divided by
SMALL = TINY**0.25  # the same where its square is


def two_unknowns(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least squares x1 first + x2 second = b by Gram-Schmidt, and the residual; dependent vectors get zero.

    `rows` (..., 3, n) holds b, first and second; x is (..., 2).
    """
    first = rows[..., 1, :]
    along = np.vecdot(first[..., None, :], rows)
    n_first = np.maximum(along[..., 1].real, TINY)
    along /= n_first[..., None]
    b, second = (rows[..., i, :] - along[..., i, None] * first for i in (0, 2))
    n_second = power(second)
    n_second = np.where(n_second > 1e-20 * n_first, n_second, np.inf)
    x = np.empty((*n_first.shape, 2), dtype=rows.dtype)
    x_second = np.divide(np.vecdot(second, b), n_second, out=x[..., 1])
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
        What is left, over the root of its n - p degrees of freedom.
    leverage : (...) ndarray
        Variance of the last unknown over that of b.
    """
    scale = np.sqrt(power(np.swapaxes(A, -1, -2)))
    scale = np.where(scale > 0, scale, 1.0)
    Q, R = np.linalg.qr(A / scale[..., None, :])
    diagonal = np.abs(np.diagonal(R, axis1=-2, axis2=-1))
    projected = (np.swapaxes(Q, -1, -2).conj() @ b[..., None])[..., 0]
    projected = np.where(diagonal > 1e-13, projected, 0.0)  # a column that the others span says nothing
    residual = b - (Q @ projected[..., None])[..., 0]
    pivot = np.where(diagonal[..., -1] > 1e-13, R[..., -1, -1] * scale[..., -1], np.inf)
    return projected[..., -1] / pivot, residual / np.sqrt(A.shape[-2] - A.shape[-1]), 1 / np.abs(pivot) ** 2


def squared(x: np.ndarray) -> np.ndarray:
    """Squared modulus, without the root that `abs` takes."""
    return np.asarray(x.real**2 + x.imag**2)


def power(x: np.ndarray) -> np.ndarray:
    """Sum of squared moduli over the last axis."""
    return np.asarray(np.vecdot(x, x).real)


def mean_power(x: np.ndarray) -> np.ndarray:
    """Mean squared modulus over the first axis, the realisations."""
    return np.asarray(np.add.reduce(squared(x), axis=0) / x.shape[0])


def rms(x: np.ndarray) -> np.ndarray:
    """Root mean square modulus over the first axis, the realisations."""
    return np.sqrt(mean_power(x))
