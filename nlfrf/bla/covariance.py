"""Hermitian matrices on every line, the line as last axis: products, inverses, correlations, square
roots.

For one channel each function is a fast scalar operation.
"""

from __future__ import annotations

import numpy as np

from nlfrf._base.numbers import squared_modulus

# share of the largest eigenvalue of a correlation: one nonlinearity alone gives rank one
_MIN_EIGENVALUE = 1e-8


def product(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """Return A B of matrices (..., n, m, F) and (..., m, p, F)."""
    if A.shape[-2] == 1:
        return A * B
    return np.einsum("...jef,...eif->...jif", A, B)


def adjoint(X: np.ndarray) -> np.ndarray:
    """Return the conjugate transposes (..., m, n, F) of matrices (..., n, m, F)."""
    return np.swapaxes(X, -2, -3).conj()


def diagonal(X: np.ndarray) -> np.ndarray:
    """Return the real diagonals (..., n, F) of Hermitian matrices (..., n, n, F)."""
    if X.shape[-2] == 1:
        return X[..., 0, :].real
    return np.einsum("...jjk->...jk", X).real


def inverse(X: np.ndarray) -> np.ndarray:
    """Return the inverses of matrices (..., n, n, F)."""
    if X.shape[-2] == 1:
        return np.asarray(1 / X)
    return np.moveaxis(np.linalg.inv(np.moveaxis(X, -1, -3)), -3, -1)


def sum_outer_products(V: np.ndarray) -> np.ndarray:
    """Return the (n, n, F) sum of v v^H over all vectors v of V (n, ..., F)."""
    V = V.reshape(len(V), -1, V.shape[-1])
    if len(V) == 1:
        return np.asarray(np.add.reduce(squared_modulus(V), axis=1)[None])
    flat = np.ascontiguousarray(np.moveaxis(V, 2, 0))
    return np.moveaxis(flat @ np.swapaxes(flat, 1, 2).conj(), 0, 2)


def to_correlation(cov: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Split a covariance into its correlation (..., n, n, F) and the standard deviations (..., n,
    F) of its channels.

    Eigenvalues are floored or cut on the correlation, because those of a covariance mix units
    (metres and newtons).
    """
    size = np.sqrt(diagonal(cov))
    size = np.where(size > 0, size, 1.0)
    return cov / (size[..., :, None, :] * size[..., None, :, :]), size


def psd_difference(cov: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Return cov - part (n, n, F) with negative eigenvalues set to zero, scaled to the correlation
    of `cov`.
    """
    if len(cov) == 1:
        return np.maximum((cov - part).real, 0.0)
    _, size = to_correlation(cov)
    values, vectors = np.linalg.eigh(np.moveaxis((cov - part) / (size[:, None] * size), 2, 0))
    left = (vectors * np.maximum(values, 0.0)[:, None]) @ np.swapaxes(vectors, 1, 2).conj()
    return np.asarray(np.moveaxis(left, 0, 2) * size[:, None] * size)


def hermitian_sqrt(cov: np.ndarray) -> np.ndarray:
    """Return (n, n, F) square roots L with L L^H = cov, eigenvalues floored so that L can be
    inverted.
    """
    correlation, size = to_correlation(cov)
    values, vectors = np.linalg.eigh(np.moveaxis(correlation, 2, 0))
    values = np.maximum(values, _MIN_EIGENVALUE * values[:, -1:])
    half = (vectors * np.sqrt(values)[:, None]) @ np.swapaxes(vectors, 1, 2).conj()
    return np.asarray(size[:, None] * np.moveaxis(half, 0, 2))
