"""Period means and their noise (co)variances on the lines of a record."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from nlfrf._base.numbers import (
    BLOCK_ENTRIES,
    has_equal_periods,
    iterate_blocks,
    least_squares,
    power,
    rfft,
    rfft_at,
    squared_modulus,
)
from nlfrf._base.values import value
from nlfrf.bla.neighbours import Places
from nlfrf.records.record import Record
from nlfrf.records.screening.output import N_POLYNOMIAL, WINDOW_LINES, is_transient

__all__ = ["TREATMENTS", "Spectra", "dft", "find_treatment", "local_fit", "period_spectra"]


# ---- The transient: whether it is there, and taking it off by local fits between the harmonics.
#
# In the DFT of P whole periods the lines that are not multiples of P hold transient and noise only. The transient is
# a smooth, rational function of frequency, so it is fitted there and read at the harmonics in between, excited
# and not, as T(r) = (t0 + t1 r + t2 r^2) / (1 + a1 r + a2 r^2) (local rational method, LRM), or as a
# polynomial (LPM) where noise leaves the denominator undetermined (Pintelon & Schoukens, 7.2.2 and 7.3).

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
    apart = first[:, :WINDOW_LINES] - last[:, :WINDOW_LINES]
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


@value(copy=False)
class Spectra:
    """Spectra 2/N rfft of input and output on chosen lines, averaged over periods.

    Fields
    ------
    lines : (K,) int ndarray
        DFT lines, increasing.
    U, Y : (M, K) complex ndarray
        Mean over periods, so that |U| is the amplitude of the cosine on that line.
    R : (M, K) complex ndarray or None
        The same of the reference.
    var_U, var_Y : (M, K) ndarray
        Variance of those means by noise; nan for one period.
    cov_YU : (M, K) complex ndarray
        Covariance E[Y U*] of those means by noise; nan for one period.
    where : Places
        Where each kind of line stands among all lines of the grid, and its neighbours.
    """

    lines: np.ndarray
    U: np.ndarray
    Y: np.ndarray
    R: np.ndarray | None
    var_U: np.ndarray
    var_Y: np.ndarray
    cov_YU: np.ndarray
    where: Places

    @cached_property
    def power_U(self) -> np.ndarray:
        """(M, K) |U|^2."""
        return squared_modulus(self.U)

    @cached_property
    def amplitude(self) -> np.ndarray:
        """(K,) rms of |U| over realisations."""
        return np.sqrt(np.add.reduce(self.power_U) / len(self.power_U))

    def on_excited(self) -> Spectra:
        """The spectra on the excited lines alone."""
        at = self.where.excited
        return Spectra(
            lines=self.lines[at],
            U=self.U.take(at, axis=1),
            Y=self.Y.take(at, axis=1),
            R=None if self.R is None else self.R.take(at, axis=1),
            var_U=self.var_U.take(at, axis=1),
            var_Y=self.var_Y.take(at, axis=1),
            cov_YU=self.cov_YU.take(at, axis=1),
            where=self.where,
        )


def period_spectra(
    record: Record, where: Places, transient: str = "none", U: np.ndarray | None = None
) -> tuple[Spectra, str]:
    """Spectra of a record on all its excited and detection lines, and what was done about the transient.

    Parameters
    ----------
    record : Record
    where : Places
        Of the lines of its grid.
    transient : str
        "none" | "discard" (the first period) | "local" (fits between the harmonics) | "auto": none where the
        periods agree but for noise, discard where that leaves periods that agree, else local.
    U : (M, P or 1, K) complex ndarray, optional
        Spectra of the input on those lines (`dft`), where they are known already.

    Raises
    ------
    ValueError
        One period only, where the transient is to be discarded or fitted.
    """
    n_periods = record.n_periods
    if transient in ("discard", "local") and n_periods < 2:
        raise ValueError(f'transient="{transient}" must have at least 2 periods to work on, got {n_periods}')
    lines = where.lines
    U = dft(record.u, lines) if U is None else U
    Y = dft(record.y, lines)
    R = None if record.r is None else dft(record.r, lines)
    if transient == "auto":
        transient = find_treatment(Y, record.y, lines)
    if transient == "discard":
        U, Y, R = after_first(U), after_first(Y), None if R is None else after_first(R)
        n_periods -= 1
    spectra = average_periods(where, U, Y, None if R is None else R.mean(axis=1), n_periods)
    return (take_off_transient(record, spectra) if transient == "local" else spectra), transient


def after_first(x: np.ndarray) -> np.ndarray:
    """Periods but the first; one that stands for all of them stays."""
    return x[:, 1:] if x.shape[1] > 1 else x


def dft(x: np.ndarray, lines: np.ndarray) -> np.ndarray:
    """(M, P, K) amplitudes of the lines in each period of x (M, P, N); (M, 1, K) where all periods are the same.

    A generator's signal repeats so: its periods need one transform.
    """
    n_realizations, n_periods, n_samples = x.shape
    some = iterate_blocks(n_realizations, n_periods * n_samples)
    if (x[:, 0, 0] == x[:, -1, 0]).all() and all(has_equal_periods(x[m]) for m in some):
        x = x[:, :1]
    spectra = np.empty((n_realizations, x.shape[1], lines.size), dtype=complex)
    if n_samples > BLOCK_ENTRIES:  # then what is worked on at a time is a period, or less
        for m, p in np.ndindex(x.shape[:2]):
            np.multiply(rfft_at(x[m, p], lines), 2 / n_samples, out=spectra[m, p])
        return spectra
    in_a_row = lines[-1] - lines[0] == lines.size - 1
    for m in some:
        transformed = rfft(x[m])
        part = transformed[..., lines[0] : lines[-1] + 1] if in_a_row else transformed.take(lines, axis=2)
        np.multiply(part.view(float), 2 / n_samples, out=spectra[m].view(float))
    return spectra


def average_periods(where: Places, U: np.ndarray, Y: np.ndarray, R: np.ndarray | None, n_periods: int) -> Spectra:
    """Means over the periods of U and Y (M, P or 1, K), and the sample (co)variances of those means."""
    n_realizations, n_lines = Y.shape[0], Y.shape[2]
    U_mean, Y_mean = (x[:, 0] if x.shape[1] == 1 else np.add.reduce(x, axis=1) / n_periods for x in (U, Y))
    shape = (n_realizations, n_lines)
    var_U, var_Y, cov_YU = np.zeros(shape), np.zeros(shape), np.zeros(shape, dtype=complex)
    if n_periods == 1:
        var_U[:], var_Y[:], cov_YU[:] = np.nan, np.nan, np.nan
    else:
        scale = 1 / (n_periods * (n_periods - 1))
        for m in iterate_blocks(n_realizations, n_periods * n_lines):
            dY = Y[m] - Y_mean[m, None]
            var_Y[m] = scale * np.add.reduce(squared_modulus(dY), axis=1)
            if U.shape[1] > 1:
                dU = U[m] - U_mean[m, None]
                var_U[m] = scale * np.add.reduce(squared_modulus(dU), axis=1)
                cov_YU[m] = scale * np.add.reduce(dY * dU.conj(), axis=1)
    return Spectra(lines=where.lines, U=U_mean, Y=Y_mean, R=R, var_U=var_U, var_Y=var_Y, cov_YU=cov_YU, where=where)


def take_off_transient(record: Record, spectra: Spectra) -> Spectra:
    """The same spectra with the transient taken off at every line, and the noise read between the harmonics."""
    T_U, residual_U, leverage_U = local_fit(record.u, spectra.lines)
    T_Y, residual_Y, leverage_Y = local_fit(record.y, spectra.lines)
    cov_YU = np.sum(residual_Y * residual_U.conj(), axis=2)
    return replace(
        spectra,
        U=spectra.U - T_U,
        Y=spectra.Y - T_Y,
        R=spectra.R,
        var_U=(1 + leverage_U) * power(residual_U),
        var_Y=(1 + leverage_Y) * power(residual_Y),
        cov_YU=cov_YU * np.sqrt((1 + leverage_U) * (1 + leverage_Y)),
    )
