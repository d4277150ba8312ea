"""Spectra of every channel on the lines of a record: mean and scatter over periods, transients
subtracted.

In the DFT of P whole periods the lines that are not multiples of P contain transient and noise
only. The transient is a smooth, rational function of frequency, so it is fitted there and evaluated
at the harmonics in between,

    T(r) = (t0 + t1 r + t2 r^2) / (1 + a1 r + a2 r^2),

(local rational method, LRM), or as a polynomial (LPM) if noise leaves the denominator undetermined
(Pintelon & Schoukens, 2nd ed., 7.2.2 and 7.3). This uses all periods; discarding the first costs
1/P of the record.
"""

from __future__ import annotations

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
from nlfrf.bla.line_index import LineIndex
from nlfrf.records.record import Record
from nlfrf.records.screening.transients import N_POLYNOMIAL, WINDOW_LINES, is_transient

TREATMENTS = ("auto", "none", "discard", "local")  # treatments of the transient
_LINES_PER_SIDE = 6  # lines on either side of a harmonic for one fit
_MAX_FOREIGN_AMPLITUDE = (
    0.03  # amplitude of a second input on a line, over the first, up to which it drives one
)
#: Residual power of the rational over the polynomial fit below which it is used: noise alone gives
#: 1/2.
_RATIONAL_POWER_RATIO = 0.25


def _choose_transient_treatment(Y: np.ndarray, y: np.ndarray, lines: np.ndarray) -> str:
    """Choose "none", "discard" or "local" for a signal y (M, P, N) with spectra of its periods (M,
    P or 1, K).
    """
    n_periods = Y.shape[1]

    def is_settled(first: int) -> bool:
        one, other = Y[:, first], Y[:, -1]
        if is_transient(one, other):
            return False
        rise = (np.add.reduce(y[:, -1], axis=1) - np.add.reduce(y[:, first], axis=1)) / y.shape[2]
        return not _has_drift(one, other, slope=rise / (n_periods - 1 - first), lines=lines)

    if n_periods < 2 or is_settled(0):
        return "none"
    if n_periods > 2 and is_settled(1):
        return "discard"
    return "local"


def _has_drift(
    first: np.ndarray, last: np.ndarray, *, slope: np.ndarray, lines: np.ndarray
) -> bool:
    """Return whether the signal drifts by more than noise: periods with the same ramp agree, but
    leak onto the lines.

    Parameters
    ----------
    first, last : (M, K) complex ndarray
        Spectra of two periods on neighbouring lines.
    slope : (M,) ndarray
        Change of the mean from period to period.
    lines : (K,) int ndarray
        These lines: a ramp has the amplitude slope / (pi k) on line k.
    """
    difference = first[:, :WINDOW_LINES] - last[:, :WINDOW_LINES]
    noise = np.vdot(difference, difference).real / difference.size / 2
    whole = np.vdot(last, last).real / last.size
    leaked = np.vdot(slope, slope) / slope.size / (np.pi * lines[0]) ** 2
    return bool(leaked > max(noise, 1e-20 * whole))


def _fit_transient(x: np.ndarray, lines: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fit the transient at the harmonics of a record, from the lines between them.

    Parameters
    ----------
    x : (M, P, N) ndarray
        Signal, P >= 2.
    lines : (K,) int ndarray
        Harmonics.

    Returns
    -------
    T : (M, K) complex ndarray
        Transient at each line, an amplitude as in 2/N rfft of the period mean.
    residual : (M, K, 2 LINES_PER_SIDE) complex ndarray
        Residual of the fit on the lines in between, scaled by its degrees of freedom: its sum of
        squares is the variance of the period mean by noise.
    leverage : (M, K) ndarray
        Variance of T over this variance.
    """
    n_realizations, n_periods, n_samples = x.shape
    r = _nonharmonic_offsets(n_periods)
    n_total = n_periods * n_samples
    at = (lines[:, None] * n_periods + r) % n_total
    mirrored = at > n_total // 2  # beyond 0 and Nyquist the spectrum of a real signal is conjugated
    places = np.where(mirrored, n_total - at, at)
    X = np.empty((n_realizations, lines.size, r.size), dtype=complex)
    for m in range(n_realizations):
        X[m] = rfft_at(x[m].reshape(-1), places.ravel()).reshape(places.shape) * (2 / n_total)
    X = np.where(mirrored, X.conj(), X)
    s = r / np.abs(r).max()
    powers = (s[:, None] ** np.arange(N_POLYNOMIAL - 1, -1, -1)).astype(complex)
    T, residual, leverage = least_squares(powers, X)
    polynomial = np.broadcast_to(powers, (*X.shape, N_POLYNOMIAL))
    rational = np.concatenate(
        [-s[:, None] * X[..., None], -(s[:, None] ** 2) * X[..., None], polynomial], axis=-1
    )
    T_r, residual_r, leverage_r = least_squares(rational, X)
    better = power(residual_r) < _RATIONAL_POWER_RATIO * power(residual)
    return (
        np.where(better, T_r, T),
        np.where(better[..., None], residual_r, residual),
        np.where(better, leverage_r, leverage),
    )


def _nonharmonic_offsets(n_periods: int) -> np.ndarray:
    """Return the offsets from a harmonic to the nearest lines that are no harmonics,
    `_LINES_PER_SIDE` on each side.
    """
    right = np.arange(1, _LINES_PER_SIDE * n_periods + n_periods)
    right = right[right % n_periods != 0][:_LINES_PER_SIDE]
    return np.concatenate([-right[::-1], right])


@value(copy=False)
class Spectra:
    """Spectra 2/N rfft of all channels on chosen lines, averaged over periods."""

    lines: np.ndarray  # (K,) DFT lines, increasing
    # U, Y: (n_u, M, K) or (n_y, M, K) complex mean over periods, so that |U| is the amplitude of
    # the cosine on that line
    U: np.ndarray
    Y: np.ndarray
    R: np.ndarray | None  # (n_u, M, K) complex the same for the references
    # dU, dY: (n_u, M, D, K) or (n_y, M, D, K) complex scatter: its products, summed over D, are the
    # covariance of the mean by noise. A single zero for an input that repeats exactly; D = 0 for
    # one period.
    dU: np.ndarray
    dY: np.ndarray
    n_periods: int  # number of periods in the means
    index: LineIndex  # indices of each kind of line of the grid, with its neighbours

    @cached_property
    def excitation(self) -> np.ndarray:
        """(n_u, M, K) the references if known, else the inputs: the excitation with the least
        noise.
        """
        if self.R is None:
            return self.U
        return self.R

    @cached_property
    def power_U(self) -> np.ndarray:
        """(n_u, M, K) |U|^2."""
        return squared_modulus(self.U)

    @cached_property
    def mean_power_U(self) -> np.ndarray:
        """(n_u, K) mean of |U|^2 over experiments."""
        return np.asarray(np.add.reduce(self.power_U, axis=1) / self.U.shape[1])

    @cached_property
    def amplitude(self) -> np.ndarray:
        """(K,) rms over inputs and experiments of |U|, each input over its own size, because units
        differ.
        """
        each = self.mean_power_U
        if len(each) > 1:
            each = each / each.sum(axis=1, keepdims=True)
        return np.sqrt(np.add.reduce(each))

    @cached_property
    def is_zippered(self) -> bool:
        """True if each line drives one input only."""
        if len(self.U) == 1:
            return False
        size = np.sqrt(np.mean(squared_modulus(self.excitation), axis=1))
        size = np.sort(size / size.max(axis=1, keepdims=True), axis=0)
        return bool(np.mean(size[-2] < _MAX_FOREIGN_AMPLITUDE * size[-1]) > 0.95)

    @cached_property
    def experiments_per_set(self) -> int:
        """Experiments that make one realisation of the matrix."""
        if self.is_zippered:
            return 1
        return len(self.U)

    def select_excited(self) -> Spectra:
        """Return the spectra on the excited lines only."""
        at = self.index.excited
        some = {
            name: getattr(self, name).take(at, axis=-1) for name in ("lines", "U", "Y", "dU", "dY")
        }
        if self.R is None:
            R = None
        else:
            R = self.R.take(at, axis=-1)
        return Spectra(**some, R=R, n_periods=self.n_periods, index=self.index)


def residual_scatter(G: np.ndarray, spectra: Spectra) -> np.ndarray:
    """Return the (n_y, M, D, K) scatter dY - G dU of the residual by noise.

    G is (n_y, n_u, K), or one matrix per set, (R, n_y, n_u, K).
    """
    dU, dY = spectra.dU, spectra.dY
    if not dU.any():  # inputs that repeat exactly
        return dY
    if G.ndim != 4:
        G = G[None]
    dU = dU.reshape(len(dU), len(G), -1, *dU.shape[2:])
    if len(dU) > 1:
        linear = np.einsum("rjik,iredk->jredk", G, dU)
    else:
        linear = np.swapaxes(G, 0, 1)[:, :, :, None] * dU
    return dY - linear.reshape(len(linear), *dY.shape[1:2], *dU.shape[3:])


def period_spectra(
    record: Record, index: LineIndex, *, transient: str = "none", U: np.ndarray | None = None
) -> tuple[Spectra, str]:
    """Return the spectra of a record on all its excited and detection lines, and the treatment of
    the transient.

    Parameters
    ----------
    record : Record
    index : LineIndex
        Index of its grid.
    transient : str
        "none" | "discard" (the first period) | "local" (fits between the harmonics) | "auto":
        "none" if the periods of the outputs agree within noise, "discard" if that leaves periods
        that agree, else "local".
    U : (n_u, M, P or 1, K) complex ndarray, optional
        Spectra of the inputs on those lines (`channel_dft`), if known already.

    Raises
    ------
    ValueError
        One period only, and the transient is to be discarded or fitted.
    """
    n_periods, lines = record.n_periods, index.lines
    if transient in ("discard", "local") and n_periods < 2:
        raise ValueError(
            f'transient="{transient}" must have at least 2 periods to work on, got {n_periods}'
        )
    if U is None:
        U = channel_dft(record.u, lines)
    else:
        U = U.copy()
    Y = channel_dft(record.y, lines)
    if record.r is None:
        R = None
    else:
        R = channel_dft(record.r, lines)
    if transient == "auto":
        y = record.y.reshape(-1, *record.y.shape[-2:])
        transient = _choose_transient_treatment(Y.reshape(-1, *Y.shape[2:]), y, lines)
    if transient == "discard":
        U = _drop_first_period(U)
        Y = _drop_first_period(Y)
        if R is not None:
            R = _drop_first_period(R)
        n_periods -= 1
    if R is not None:
        R = R.mean(axis=2)
    (U, dU), (Y, dY) = (_mean_and_scatter(X, n_periods) for X in (U, Y))
    if transient == "local":
        if dU.shape[2] > 1:
            U, dU = _subtract_transient(record.u, U, lines)
        Y, dY = _subtract_transient(record.y, Y, lines)
    return Spectra(
        lines=lines, U=U, Y=Y, R=R, dU=dU, dY=dY, n_periods=n_periods, index=index
    ), transient


def _drop_first_period(X: np.ndarray) -> np.ndarray:
    """Return X (n, M, P, K) without its first period; a single one, which represents equal periods,
    stays.
    """
    if X.shape[2] > 1:
        return X[:, :, 1:]
    return X


def _mean_and_scatter(X: np.ndarray, n_periods: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean over the periods of X (n, M, P or 1, K), which is overwritten, and the
    scatter of that mean.
    """
    if X.shape[2] == 1:
        mean = X[:, :, 0]
        return mean, X[:, :, :0] if n_periods == 1 else np.zeros_like(X)
    mean = np.add.reduce(X, axis=2) / n_periods
    X -= mean[:, :, None]
    X *= 1 / np.sqrt(n_periods * (n_periods - 1))
    return mean, X


def _subtract_transient(
    x: np.ndarray, mean: np.ndarray, lines: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Subtract the transient of x from the mean (n, M, K) on every line; return the mean with its
    scatter.
    """
    T, residual, leverage = _fit_transient(x.reshape(-1, *x.shape[-2:]), lines)
    scatter = np.swapaxes(residual * np.sqrt(1 + leverage)[..., None], 1, 2)
    return mean - T.reshape(mean.shape), scatter.reshape(*mean.shape[:2], *scatter.shape[1:])


def channel_dft(x: np.ndarray, lines: np.ndarray) -> np.ndarray:
    """Return the (n, M, P or 1, K) `period_dft` of every channel of x ((n,) M, P, N)."""
    X = period_dft(x.reshape(-1, *x.shape[-2:]), lines)
    return X.reshape(-1, x.shape[-3], *X.shape[1:])


def period_dft(x: np.ndarray, lines: np.ndarray) -> np.ndarray:
    """Return the (M, P, K) amplitudes of the lines in each period of x (M, P, N).

    (M, 1, K) if all periods are equal, as for the signal of a generator: one transform suffices.
    """
    n_realizations, n_periods, n_samples = x.shape
    some = iterate_blocks(n_realizations, n_periods * n_samples)
    if (x[:, 0, 0] == x[:, -1, 0]).all() and all(has_equal_periods(x[m]) for m in some):
        x = x[:, :1]
    spectra = np.empty((n_realizations, x.shape[1], lines.size), dtype=complex)
    if n_samples > BLOCK_ENTRIES:  # memory is limited to one period, or less
        for m, p in np.ndindex(x.shape[:2]):
            np.multiply(rfft_at(x[m, p], lines), 2 / n_samples, out=spectra[m, p])
        return spectra
    in_a_row = lines[-1] - lines[0] == lines.size - 1
    for m in some:
        transformed = rfft(x[m])
        if in_a_row:
            part = transformed[..., lines[0] : lines[-1] + 1]
        else:
            part = transformed.take(lines, axis=2)
        np.multiply(part.view(float), 2 / n_samples, out=spectra[m].view(float))
    return spectra
