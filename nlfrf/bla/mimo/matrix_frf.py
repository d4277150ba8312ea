"""The frequency response matrix, what its estimation makes of a residual, and the residuals.

G = Y Z^H (U Z^H)^-1 with instruments Z: the inputs, or the references where there are any. A residual V = Y - G U of
the experiments moves it by dG = V W, W = Z^H (U Z^H)^-1, noise on the inputs and feedback included, so

    Cov(vec G) = conj(Gamma) kron C_V,    Gamma = W^H W,    C_V: the covariance of ONE experiment's V.

Without a reference several sets are averaged, not fitted at once: noise on the inputs would meet the distortion in a
common residual and be under-read (Pintelon & Schoukens, 2nd ed., 2.7 and 3.7).
"""

from __future__ import annotations

import numpy as np

from nlfrf._base.values import value
from nlfrf.bla.mimo.channels import ChannelSpectra

__all__ = ["MatrixFrf", "adjoint", "hermitian_mean", "lines_last", "matrix_frf", "noise_covariance"]


@value(copy=False)
class MatrixFrf:
    """The matrix on the excited lines.

    Fields
    ------
    G : (n_y, n_u, F) complex ndarray
        The matrix.
    each : (R, n_y, n_u, F) complex ndarray
        That of each set.
    gamma : (n_u, n_u, F) complex ndarray
        What the covariance of one experiment's residual is multiplied by.
    gamma_each : (R, n_u, n_u, F) complex ndarray
        That of each set.
    cov_noise : (n_y, n_y, F) complex ndarray
        Covariance of one experiment's residual by noise; nan for one period.
    cov_scatter : (n_y, n_y, F) complex ndarray
        The same by everything, from the scatter over sets; nan for one set.
    """

    G: np.ndarray
    each: np.ndarray
    gamma: np.ndarray
    gamma_each: np.ndarray
    cov_noise: np.ndarray
    cov_scatter: np.ndarray


def matrix_frf(spectra: ChannelSpectra) -> MatrixFrf:
    """The matrix over all sets, its Gamma, and the covariances that the experiments themselves tell."""
    at = spectra.excited
    n_u, n_y, F = len(spectra.U), len(spectra.Y), at.size
    U, Y = sets(spectra.U[..., at], n_u), sets(spectra.Y[..., at], n_u)  # (R, F, n, n_u)
    R = len(U)
    if spectra.R is None:
        W = np.linalg.inv(U)
        each = Y @ W
        gamma_each = adjoint(W) @ W
        G = each.mean(axis=0)
        gamma = gamma_each.sum(axis=0) / R**2
    else:
        Z = adjoint(sets(spectra.R[..., at], n_u))
        each, gamma_each = instrumental(Y, U, Z)
        Y_all, U_all = (np.concatenate(list(x), axis=-1) for x in (Y, U))
        G, gamma = instrumental(Y_all, U_all, np.concatenate(list(Z), axis=-2))
    scatter = np.full((F, n_y, n_y), np.nan, dtype=complex)
    if R > 1:
        V = Y - G @ U
        scatter = (V @ adjoint(V)).sum(axis=0) / (n_u * (R - 1))
    own = each if spectra.R is None else np.broadcast_to(G, each.shape)
    return MatrixFrf(
        G=lines_last(G),
        each=lines_last(each),
        gamma=lines_last(gamma),
        gamma_each=lines_last(gamma_each),
        cov_noise=lines_last(noise_covariance(spectra, own)),
        cov_scatter=lines_last(scatter),
    )


def instrumental(Y: np.ndarray, U: np.ndarray, Z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Y Z (U Z)^-1 and Gamma for adjoint instruments Z (..., F, M, n_u)."""
    W = Z @ np.linalg.inv(U @ Z)
    return Y @ W, adjoint(W) @ W


def noise_covariance(spectra: ChannelSpectra, own: np.ndarray) -> np.ndarray:
    """(F, n_y, n_y) covariance of one experiment's residual by noise, with the matrix (R, F, n_y, n_u) of its set."""
    at, n_y = spectra.excited, spectra.Y.shape[0]
    if not spectra.dY.shape[2]:
        return np.full((at.size, n_y, n_y), np.nan, dtype=complex)
    dV = np.moveaxis(spectra.dY[..., at], 3, 0)  # (F, n_y, M, D)
    if spectra.dU.any():
        n_u = spectra.U.shape[0]
        per_set = spectra.U.shape[1] // len(own)
        dU = np.moveaxis(spectra.dU[..., at], 3, 0).reshape(at.size, n_u, len(own), per_set, -1)
        dV = dV - np.einsum("rfji,fired->fjred", own, dU, optimize=True).reshape(dV.shape)
    return hermitian_mean(dV, spectra.Y.shape[1])


def hermitian_mean(V: np.ndarray, n: int) -> np.ndarray:
    """(F, n_y, n_y) sum of V V^H over everything but lines and channels, V (F, n_y, ...), over n."""
    flat = V.reshape(*V.shape[:2], -1)
    return flat @ adjoint(flat) / n


def sets(X: np.ndarray, n_u: int) -> np.ndarray:
    """(R, F, n, n_u) one matrix of channels x experiments a set and line, from (n, R n_u, F)."""
    n, _, F = X.shape
    return X.reshape(n, -1, n_u, F).transpose(1, 3, 0, 2)


def adjoint(X: np.ndarray) -> np.ndarray:
    """Conjugate transpose of the last two axes."""
    return np.swapaxes(X, -1, -2).conj()


def lines_last(X: np.ndarray) -> np.ndarray:
    """Lines from the third axis from the end to the last."""
    return np.moveaxis(X, -3, -1)
