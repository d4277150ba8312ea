"""The covariance of one experiment's distortion and noise, from detection lines or from the roughness of the matrix."""

from __future__ import annotations

import numpy as np

from nlfrf._base.numbers import SMALL_NORM, power
from nlfrf._base.values import value
from nlfrf.bla.mimo.channels import ChannelSpectra, nearest_places
from nlfrf.bla.mimo.conditions import is_zippered
from nlfrf.bla.mimo.counts import cross_factor
from nlfrf.bla.mimo.local_matrix import fit_matrix, interpolate_matrix
from nlfrf.bla.mimo.matrix_frf import MatrixFrf, hermitian_mean
from nlfrf.signals.lines import LineGrid, local_mean

__all__ = ["MatrixLevel", "level_from_fit", "level_from_lines", "linear_part"]


SHARP = 8.0  # change of |G| within a window [dB] past which no farther line is used
FEWEST = 4
NOISE_LINES = 27  # neighbouring lines over which noise is averaged: its scatter would add to that of the level


@value(copy=False)
class MatrixLevel:
    """Covariance of one experiment's residual V by everything but the BLA, from one source.

    Fields
    ------
    cov : (n_y, n_y, F) complex ndarray
        At each excited line, noise included.
    dof : (F,) ndarray
        Complex degrees of freedom behind it.
    factor : (F,) ndarray
        The calibration of the detection lines that was applied.
    """

    cov: np.ndarray
    dof: np.ndarray
    factor: np.ndarray


def linear_part(spectra: ChannelSpectra, smooth: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What is left on all lines when the linear answer is taken off, its noise row by row, and the matrix there.

    (n_y, M, K) Y - G U; (n_y, K) the variance of one experiment's by noise, over neighbouring lines; (n_y, n_u, K) G.
    """
    G = interpolate_matrix(smooth, spectra.lines[spectra.excited], spectra.lines)
    Yc = spectra.Y - np.einsum("jik,imk->jmk", G, spectra.U)
    if not spectra.dY.shape[2]:
        return Yc, np.zeros((len(Yc), Yc.shape[2])), G
    dV = spectra.dY if not spectra.dU.any() else spectra.dY - np.einsum("jik,imdk->jmdk", G, spectra.dU)
    noise = np.sum(dV.real**2 + dV.imag**2, axis=(1, 2)) / Yc.shape[1]
    return Yc, local_mean(noise, NOISE_LINES), G


def level_from_lines(
    spectra: ChannelSpectra,
    grid: LineGrid,
    part: tuple[np.ndarray, np.ndarray, np.ndarray],
    kind: str,
    n_detection: int,
    n_independent: int,
) -> MatrixLevel:
    """From the "odd" or the "even" lines that were not excited.

    The expected power of row j on line l is q_j = d_j g_j^2 + n_j, g_j^2 = sum_i |G_ji|^2 a_i^2 with a_i the same on
    all lines (in a loop U dips at the resonances, and the distortion does not), d_j by maximum likelihood as for one
    output. Whitened by it, the rows of a window tell their correlation; for one output this is `detected_power`.
    """
    Yc, noise, G = part
    places, here = getattr(spectra, kind), spectra.excited
    near = nearest_places(grid, kind, n_detection)
    window = places[near]
    U = spectra.U[..., here]
    a2 = np.mean(np.abs(U) ** 2, axis=(1, 2))
    gain = np.einsum("jik,i->jk", np.abs(G) ** 2, a2) + SMALL_NORM
    A = gain[:, window] / gain[:, here, None]  # (n_y, F, n)
    used = np.all(narrowed(A), axis=0).astype(float)
    power = np.mean(np.abs(Yc[:, :, window]) ** 2, axis=1)
    expected, d = scoring(power / gain[:, here, None], noise[:, window] / gain[:, here, None], A, used)
    x = Yc[:, :, window] / np.sqrt(gain[:, here, None] * expected)[:, None] * np.sqrt(used)
    n_used = used.sum(axis=1)
    rho = hermitian_mean(np.moveaxis(x, 2, 0), 1) / (n_used * Yc.shape[1])[:, None, None]
    factor = np.ones(here.size)
    if kind == "odd":
        factor = cross_factor(driving(spectra), grid.excited, grid.odd, near)
    s = np.sqrt(factor * d * gain[:, here] + noise[:, here]).T  # (F, n_y)
    cov = np.moveaxis(s[:, :, None] * rho * s[:, None, :], 0, 2)
    return MatrixLevel(cov=cov, dof=n_used * n_independent, factor=factor)


def driving(spectra: ChannelSpectra) -> np.ndarray:
    """(n, F) amplitude spectra that may drive a nonlinearity; zippered inputs share lines out, and act together.

    Each over its own size: of the sum of inputs in their units one alone would be left.
    """
    inputs, outputs = (np.sqrt(np.mean(np.abs(x[..., spectra.excited]) ** 2, axis=1)) for x in (spectra.U, spectra.Y))
    if is_zippered(spectra):
        inputs = np.sqrt(np.sum(inputs**2 / power(inputs)[:, None], axis=0, keepdims=True))
    return np.concatenate([inputs, outputs])


def scoring(power: np.ndarray, noise: np.ndarray, A: np.ndarray, used: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Expected powers (n_y, F, n) and d (n_y, F) of q = d A + n by scoring on exponentially distributed powers."""
    excess, square = A * (power - noise), A * A
    floor = np.maximum(noise, SMALL_NORM)
    weight = used / square
    for _ in range(5):  # the first weighs by |G|^-4, as without noise
        d = np.maximum(np.vecdot(weight, excess) / np.vecdot(weight, square), 0.0)
        expected = A * d[..., None] + floor
        weight = used / (expected * expected)
    return expected, d


def narrowed(gain: np.ndarray) -> np.ndarray:
    """Which lines of a window to use: up to where |G|^2 has changed by SHARP, never under FEWEST."""
    highest = np.maximum(np.maximum.accumulate(gain, axis=-1), 1.0)
    lowest = np.minimum(np.minimum.accumulate(gain, axis=-1), 1.0)
    return np.asarray((highest < 10 ** (SHARP / 10) * lowest) | (np.arange(gain.shape[-1]) < FEWEST))


def level_from_fit(frf: MatrixFrf, grid: LineGrid) -> MatrixLevel:
    """From the roughness of the matrix of each set: C_V = sum E Gamma^-1 E^H over the residuals E of its local fit."""
    n_y, n_u, F = frf.G.shape
    cov, dof = np.zeros((n_y, n_y, F), dtype=complex), np.zeros(F)
    for G, gamma in zip(frf.each, frf.gamma_each, strict=True):
        fit = fit_matrix(G, grid, gamma)
        inverse = np.linalg.inv(np.moveaxis(gamma, 2, 0))
        E = np.moveaxis(fit.residual, 3, 1)  # (F, n, n_y, n_u)
        weighted = E @ inverse[fit.window]
        cov = cov + np.einsum("fnij,fnkj->ikf", weighted, E.conj())
        dof = dof + fit.dof * n_u
    return MatrixLevel(cov=cov / dof, dof=dof, factor=np.ones(F))
