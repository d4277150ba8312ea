"""Spectra of every channel on the lines of a record, averaged over periods, and their scatter over periods."""

from __future__ import annotations

import numpy as np

from nlfrf._base.values import value
from nlfrf.bla.spectra import dft, find_treatment, local_fit
from nlfrf.records.several import MultiRecord
from nlfrf.signals.lines import LineGrid

__all__ = ["ChannelSpectra", "channel_spectra", "nearest_lines", "nearest_places"]


@value(copy=False)
class ChannelSpectra:
    """Spectra 2/N rfft of all channels on the excited and detection lines, averaged over periods.

    Fields
    ------
    lines : (K,) int ndarray
        DFT lines, increasing.
    excited, odd, even : (F,), (O,), (E,) int ndarray
        Where each kind stands among them.
    U, Y : (n_u, M, K), (n_y, M, K) complex ndarray
        Mean over periods.
    R : (n_u, M, K) complex ndarray or None
        The same of the references.
    dU, dY : (n_u, M, D, K), (n_y, M, D, K) complex ndarray
        Scatter, scaled so that the sum over D of its products is the covariance of the mean by noise; dU is zero over
        one D where the input repeats exactly. D = 0 for one period.
    n_free : float
        Complex degrees of freedom behind them, of each experiment.
    """

    lines: np.ndarray
    excited: np.ndarray
    odd: np.ndarray
    even: np.ndarray
    U: np.ndarray
    Y: np.ndarray
    R: np.ndarray | None
    dU: np.ndarray
    dY: np.ndarray
    n_free: float


def channel_spectra(record: MultiRecord, transient: str) -> tuple[ChannelSpectra, str]:
    """Spectra of all channels, and what was done about the transient ("auto" decides by the outputs)."""
    if transient in ("discard", "local") and record.n_periods < 2:
        raise ValueError(f'transient="{transient}" must have at least 2 periods to work on, got {record.n_periods}')
    grid = record.lines
    lines = np.sort(np.concatenate([grid.excited, grid.odd, grid.even]))
    U, Y = spectra_of(record.u, lines), spectra_of(record.y, lines)
    R = None if record.r is None else spectra_of(record.r, lines).mean(axis=2)
    if transient == "auto":
        flat = record.y.reshape(-1, *record.y.shape[2:])
        transient = find_treatment(Y.reshape(-1, *Y.shape[2:]), flat, lines)
    if transient == "discard":
        U, Y = (x[:, :, 1:] if x.shape[2] > 1 else x for x in (U, Y))
    n_periods = record.n_periods - (transient == "discard")
    if transient == "local":
        U, dU, _ = without_transient(record.u, U, lines)
        Y, dY, n_free = without_transient(record.y, Y, lines)
    else:
        U, dU = mean_and_scatter(U, n_periods)
        Y, dY = mean_and_scatter(Y, n_periods)
        n_free = n_periods - 1
    excited, odd, even = (np.searchsorted(lines, kind) for kind in (grid.excited, grid.odd, grid.even))
    spectra = ChannelSpectra(
        lines=lines, excited=excited, odd=odd, even=even, U=U, Y=Y, R=R, dU=dU, dY=dY, n_free=float(n_free)
    )
    return spectra, transient


def spectra_of(x: np.ndarray, lines: np.ndarray) -> np.ndarray:
    """(n, M, P or 1, K) amplitudes on the lines of x (n, M, P, N); one period where all periods are the same."""
    return np.stack(alike([dft(channel, lines) for channel in x]))


def alike(channels: list[np.ndarray]) -> list[np.ndarray]:
    """Channels with as many periods as the others."""
    most = max(one.shape[1] for one in channels)
    return [np.repeat(one, most, axis=1) if one.shape[1] < most else one for one in channels]


def mean_and_scatter(X: np.ndarray, n_periods: int) -> tuple[np.ndarray, np.ndarray]:
    """Mean over periods (n, M, K), and the scatter of that mean (n, M, D, K)."""
    mean = X.mean(axis=2)
    if n_periods < 2:
        return mean, X[:, :, :0]
    if X.shape[2] == 1:
        return mean, np.zeros_like(X)
    return mean, (X - mean[:, :, None]) / np.sqrt(n_periods * (n_periods - 1))


def without_transient(x: np.ndarray, X: np.ndarray, lines: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """The same with the transient taken off at every line; the scatter is read between the harmonics."""
    mean = X.mean(axis=2)
    if X.shape[2] == 1:  # repeats exactly: there is none
        return mean, np.zeros_like(X), 0.0
    T, residual, leverage = zip(*(local_fit(channel, lines) for channel in x), strict=True)
    scatter = np.stack(residual) * np.sqrt(1 + np.stack(leverage))[..., None]
    return mean - np.stack(T), np.swapaxes(scatter, 2, 3), float(scatter.shape[-1] - 3)


def nearest_places(grid: LineGrid, kind: str, n: int) -> np.ndarray:
    """(F, n) for each excited line the n nearest lines of a kind, nearest first, as indices into that kind."""
    return nearest_lines(grid.excited, getattr(grid, kind), n)


def nearest_lines(at: np.ndarray, lines: np.ndarray, n: int) -> np.ndarray:
    """(F, n) indices into `lines` of the n lines nearest to each of `at`, nearest first; one-sided at the ends."""
    n = min(n, lines.size)
    reach = min(2 * n, lines.size)
    first = np.clip(np.searchsorted(lines, at) - n, 0, lines.size - reach)
    near = first[:, None] + np.arange(reach)
    order = np.argsort(np.abs(lines[near] - at[:, None]), axis=1, kind="stable")[:, :n]
    return np.asarray(np.take_along_axis(near, order, axis=1))
