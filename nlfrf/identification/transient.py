"""The transient: whether it is there, and taking it off by local fits between the harmonics.

In the DFT of P whole periods the lines that are not multiples of P hold transient and noise only. The transient is
a smooth, rational function of frequency, so it is fitted there and read at the harmonics in between, excited
and not, as T(r) = (t0 + t1 r + t2 r^2) / (1 + a1 r + a2 r^2) (local rational method, LRM), or as a
polynomial (LPM) where noise leaves the denominator undetermined (Pintelon & Schoukens, 7.2.2 and 7.3).
"""

from __future__ import annotations

import numpy as np

from nlfrf.records.ringing import N_POLYNOMIAL, WINDOW, is_transient
from nlfrf.shared.leastsquares import least_squares, power
from nlfrf.shared.transforms import rfft_at

__all__ = ["TREATMENTS", "find_treatment", "local_fit"]


TREATMENTS = ("auto", "none", "discard", "local")  # of what has not died away when the first period begins


SIDE = 6  # lines on either side of a harmonic used for one fit
EARNED = 0.25  # the denominator has to earn its place: fitted to nothing but noise it halves the residual


def find_treatment(Y: np.ndarray, y: np.ndarray, lines: np.ndarray) -> str:
    """What a signal y (M, P, N) and the spectra of its periods (M, P or 1, K) ask for: "none", "discard" or "local"."""
    n_periods = Y.shape[1]

    def settled(first: int) -> bool:
        one, other = Y[:, first], Y[:, -1]
        if is_transient(one, other):
            return False
        rise = (np.add.reduce(y[:, -1], axis=1) - np.add.reduce(y[:, first], axis=1)) / y.shape[2]
        return not is_drift(one, other, rise / (n_periods - 1 - first), lines)

    if n_periods < 2 or settled(0):
        return "none"
    return "discard" if n_periods > 2 and settled(1) else "local"


def is_drift(first: np.ndarray, last: np.ndarray, slope: np.ndarray, lines: np.ndarray) -> bool:
    """Whether the signal drifts by more than noise: each period leaks the same ramp onto its lines, so they agree.

    Parameters
    ----------
    first, last : (M, K) complex ndarray
        Spectra of two periods on neighbouring lines.
    slope : (M,) ndarray
        Change of the mean from period to period.
    lines : (K,) int ndarray
        Those lines: a ramp has the amplitude slope / (pi k) on line k.
    """
    apart = first[:, :WINDOW] - last[:, :WINDOW]
    noise, whole = np.vdot(apart, apart).real / apart.size / 2, np.vdot(last, last).real / last.size
    leaked = np.vdot(slope, slope) / slope.size / (np.pi * lines[0]) ** 2
    return bool(leaked > max(noise, 1e-20 * whole))


def local_fit(x: np.ndarray, lines: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Transient at the harmonics of a record, and what remains around them.

    Parameters
    ----------
    x : (M, P, N) ndarray
        Signal, P >= 2.
    lines : (K,) int ndarray
        Harmonics.

    Returns
    -------
    T : (M, K) complex ndarray
        Transient at each line, an amplitude as of 2/N rfft of the period mean.
    residual : (M, K, 2 SIDE) complex ndarray
        What the fit left on the lines in between, scaled by its degrees of freedom: the sum of squares is the
        variance by noise of the period mean.
    leverage : (M, K) ndarray
        Variance of T over that variance.
    """
    n_realizations, n_periods, n_samples = x.shape
    r = offsets(n_periods)
    n_total = n_periods * n_samples
    where = (lines[:, None] * n_periods + r) % n_total
    mirrored = where > n_total // 2  # beyond 0 and Nyquist a real signal repeats itself, conjugated
    index = np.where(mirrored, n_total - where, where)
    X = np.empty((n_realizations, lines.size, r.size), dtype=complex)
    for m in range(n_realizations):
        X[m] = rfft_at(x[m].reshape(-1), index.ravel()).reshape(index.shape) * (2 / n_total)
    X = np.where(mirrored, X.conj(), X)
    s = r / np.abs(r).max()
    powers = (s[:, None] ** np.arange(N_POLYNOMIAL - 1, -1, -1)).astype(complex)
    T, residual, leverage = least_squares(powers, X)
    polynomial = np.broadcast_to(powers, (*X.shape, N_POLYNOMIAL))
    rational = np.concatenate([-s[:, None] * X[..., None], -(s[:, None] ** 2) * X[..., None], polynomial], axis=-1)
    T_r, residual_r, leverage_r = least_squares(rational, X)
    better = power(residual_r) < EARNED * power(residual)
    return (
        np.where(better, T_r, T),
        np.where(better[..., None], residual_r, residual),
        np.where(better, leverage_r, leverage),
    )


def offsets(n_periods: int) -> np.ndarray:
    """Offsets from a harmonic to the lines nearest to it that are not harmonics, SIDE on either side."""
    right = np.arange(1, SIDE * n_periods + n_periods)
    right = right[right % n_periods != 0][:SIDE]
    return np.concatenate([-right[::-1], right])
