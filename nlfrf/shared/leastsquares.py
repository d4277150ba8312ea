"""Small least-squares problems in many windows at once."""

from __future__ import annotations

import numpy as np

__all__ = ["least_squares", "mean_power", "power", "rms", "squared", "two_unknowns"]


def two_unknowns(first: np.ndarray, second: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least squares x1 first + x2 second = b for vectors (..., n) by Gram-Schmidt, and the residual.

    Dependent vectors get zero.
    """
    tiny = np.finfo(float).tiny
    n_first = np.maximum(power(first), tiny)
    along = np.vecdot(first, second) / n_first
    second = second - along[..., None] * first
    n_second = power(second)
    n_second = np.where(n_second > 1e-20 * n_first, n_second, np.inf)
    x_first, x_second = np.vecdot(first, b) / n_first, np.vecdot(second, b) / n_second
    rest = b - x_first[..., None] * first - x_second[..., None] * second
    return np.stack([x_first - along * x_second, x_second], axis=-1), rest


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
