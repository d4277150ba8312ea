"""The FRF fitted locally over its excited lines: a smoother FRF, and the roughness that is left.

The fit of an FRF serves twice. Its value is the FRF with less scatter. Its residual is a distortion level: random
phases make the stochastic distortion rough over frequency where the FRF itself is smooth (Pintelon & Schoukens,
7.2). It needs no detection lines. The fit is a polynomial, or a rational function where that explains the FRF much
better (a resonance a few lines wide, a steep slope); what neither can follow is read as distortion, so the level may
be too high there, not too low.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from nlfrf.excitation.lines import local_mean
from nlfrf.identification.neighbours import KEPT, Places
from nlfrf.shared.leastsquares import power, two_unknowns
from nlfrf.shared.values import value

__all__ = ["LEAST", "NOISE_LINES", "LocalFit", "fit_locally"]


ORDER = 2
EARNED = 0.25  # the denominator has to earn its place: at 0.5 noise alone was fitted by it in one window of five
POOLED = 9  # neighbouring lines over which it is judged
LEAST_NOISE = 0.5  # share of the known noise that a roughness shows at least
NOISE_LINES = 13  # neighbouring lines over which the noise of a few periods is averaged
SMALLEST = 0.1  # denominator, against that at the line itself: a pole of the fit near the window is no distortion
LEAST = ORDER + 3  # lines that leave two degrees of freedom


@value(copy=False)
class LocalFit:
    """FRFs fitted over their neighbouring lines.

    Fields
    ------
    G : (M, F) complex ndarray
        Fitted value at each line.
    variance : (M, F) ndarray
        Variance of the FRF about the fit.
    dof : (M, F) ndarray
        Complex degrees of freedom behind it.
    """

    G: np.ndarray
    variance: np.ndarray
    dof: np.ndarray


def fit_locally(G: np.ndarray, weight: np.ndarray, where: Places, noise: np.ndarray | None = None) -> LocalFit:
    """Fit each FRF at each line over the nine lines around it.

    Parameters
    ----------
    G : (M, F) complex ndarray
        FRF of each realisation.
    weight : (M, F) ndarray
        |U|: the variance of G is taken as a smooth variance at the output over |U|^2.
    where : Places
        Its excited lines are those of G.
    noise : (M, F) ndarray, optional
        Variance of each G by noise, where it is known: noise need not follow |G| as distortion does.

    Raises
    ------
    ValueError
        Fewer than five excited lines.
    """
    if where.excited.size < LEAST:
        raise ValueError(f"lines must hold at least {LEAST} excited lines for the roughness, got {where.excited.size}")
    window, r, powers = local_powers(where)
    n = window.shape[1]
    w = weight[:, window]
    basis, at_zero = polynomials(r, w)
    spanned, rest = split(basis, (w * G[:, window])[:, :, None, :] * powers)
    value_at_zero = np.matvec(spanned, at_zero)
    fitted = value_at_zero[..., 0]
    variance = power(rest[..., 0, :]) / (n - ORDER - 1)
    dof = np.full(variance.shape, n - ORDER - 1)
    denominator: np.ndarray | float = 1.0
    n_rational = 2 * ORDER + 1  # the two polynomials of this order are written out here
    if n >= n_rational + 3:
        a, remainder = two_unknowns(rest[..., 1, :], rest[..., 2, :], rest[..., 0, :])
        variance_r = power(remainder) / (n - n_rational)
        # at the ends of the band windows are one-sided and the same: there it is as where they are centred
        last = variance.shape[1] - 1
        end = min(n // 2, last // 2)
        earned = local_mean((EARNED * variance - variance_r)[:, end : last - end + 1], POOLED) > 0
        better = earned.take(np.clip(np.arange(last + 1) - end, 0, last - 2 * end), axis=1)
        fitted = np.where(better, fitted - np.vecdot(a.conj(), value_at_zero[..., 1:]), fitted)
        inverse = np.where(better[..., None], np.abs(1 - np.vecmat(a.conj(), powers[:, 1:])), 1.0)
        # the residual under the denominator follows |G|; without it, it is flat: nobody knows which the distortion does
        flat = power(remainder / np.maximum(inverse, SMALLEST)) / (n - n_rational)
        variance = np.where(better, np.maximum(variance_r, flat), variance)
        dof = np.where(better, n - n_rational, dof)
        if noise is not None:
            denominator = np.where(flat[..., None] > variance_r[..., None], 1.0, inverse)
    if noise is not None:
        smooth = local_mean(noise * weight**2, NOISE_LINES)
        # and not far under the noise that is known to be there
        variance = np.maximum(variance * noise_share(variance, denominator, smooth, window), LEAST_NOISE * smooth)
    return LocalFit(G=fitted, variance=variance / weight**2, dof=dof)


@lru_cache(maxsize=KEPT)
def local_powers(where: Places) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Windows of neighbours (F, n), distances r in them (F, n) from -1 to 1, and the columns of the fit (F, 3, n)."""
    window, lines = where.near_excited, where.lines[where.excited]
    r = (lines[window] - lines[:, None]).astype(float)
    r /= np.abs(r).max(axis=1, keepdims=True)
    # b0 + b1 r + b2 r^2 = G, and (1 + a1 r + a2 r^2) G = b0 + b1 r + b2 r^2: the residual of the second is weighted
    # by the denominator, that is by 1/|G| across a resonance, where the distortion follows |G|
    powers = np.stack([np.ones(r.shape), -r, -r * r], axis=1)
    for array in (r, powers):
        array.flags.writeable = False
    return window, r, powers


def noise_share(
    variance: np.ndarray, denominator: np.ndarray | float, smooth: np.ndarray, window: np.ndarray
) -> np.ndarray:
    """Correction (M, F) for smoothed noise that differs over the window, weighted as the residual is."""
    there = np.mean(denominator**2 * smooth[:, window], axis=-1)
    distortion = np.maximum(variance - there, 0.0)
    total = np.maximum(distortion + there, np.finfo(float).tiny)
    return np.asarray((distortion + smooth) / total)


def polynomials(r: np.ndarray, w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The polynomials p of order 0, 1 and 2 that are orthonormal on the points r (F, n) under the weights w^2.

    Returns w p (M, F, 3, n) and p(0) (M, F, 3), by their three-term recurrence (Forsythe, 1957).
    """
    basis = np.empty((*w.shape[:2], ORDER + 1, r.shape[1]))
    at_zero = np.empty((*w.shape[:2], ORDER + 1))
    for k in range(ORDER + 1):
        p, p_0 = (r * basis[..., k - 1, :], np.zeros(w.shape[:2])) if k else (w, np.ones(w.shape[:2]))
        for j in range(max(k - 2, 0), k):
            along = np.vecdot(basis[..., j, :], p)
            p = p - along[..., None] * basis[..., j, :]
            p_0 = p_0 - along * at_zero[..., j]
        scale = 1 / np.sqrt(np.vecdot(p, p))
        basis[..., k, :] = p * scale[..., None]
        at_zero[..., k] = p_0 * scale
    return basis, at_zero


def split(basis: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What the real orthonormal rows of `basis` (..., p, n) span of complex rows (..., c, n), and the rest.

    The first is (..., c, p) coefficients, the second (..., c, n).
    """
    c = rows.shape[-2]
    parts = np.concatenate([rows.real, rows.imag], axis=-2)  # so that the products stay real
    spanned = parts @ np.swapaxes(basis, -1, -2)
    rest = parts - spanned @ basis
    return spanned[..., :c, :] + 1j * spanned[..., c:, :], rest[..., :c, :] + 1j * rest[..., c:, :]
