"""Period means and their noise (co)variances on the lines of a record."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from nlfrf.identification.neighbours import Places
from nlfrf.identification.transient import find_treatment, local_fit
from nlfrf.records.record import Record
from nlfrf.shared.leastsquares import power, squared
from nlfrf.shared.transforms import BLOCK, blocks, repeats, rfft, rfft_at
from nlfrf.shared.values import value

__all__ = ["Spectra", "dft", "period_spectra"]


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
        return squared(self.U)

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
    some = blocks(n_realizations, n_periods * n_samples)
    if (x[:, 0, 0] == x[:, -1, 0]).all() and all(repeats(x[m]) for m in some):
        x = x[:, :1]
    spectra = np.empty((n_realizations, x.shape[1], lines.size), dtype=complex)
    if n_samples > BLOCK:  # then what is worked on at a time is a period, or less
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
        for m in blocks(n_realizations, n_periods * n_lines):
            dY = Y[m] - Y_mean[m, None]
            var_Y[m] = scale * np.add.reduce(squared(dY), axis=1)
            if U.shape[1] > 1:
                dU = U[m] - U_mean[m, None]
                var_U[m] = scale * np.add.reduce(squared(dU), axis=1)
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
