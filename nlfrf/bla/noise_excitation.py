"""The BLA from noise excitation by local polynomials, with less leakage at a resonance than
averaged spectra of segments (Welch).

Around each frequency the FRF and the transient are each fitted by a quadratic, over the DFT lines
of the whole record (Pintelon & Schoukens, 2nd ed., 7.2.2). Noise excitation does not repeat, so
distortion and noise cannot be separated. The variances contain both.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from nlfrf._base.arguments import (
    data_warning,
    format_count,
    keep_warnings,
    require_integer,
    require_positive,
    require_real_array,
)
from nlfrf._base.numbers import TINY, least_squares, power
from nlfrf.bla.bla import Bla, Covariances, Experiment, levels_without_detection
from nlfrf.signals.lines import LineGrid
from nlfrf.signals.multisine import band_lines

_LINES_PER_SIDE = 6  # DFT lines on either side for a local polynomial
_N_RECORD_PARTS = 16  # parts of the record, over which the power of stationary noise is constant
_N_BANDS = 8  # parts of the excited band
_MAX_POWER_SCATTER = 4.0  # largest scatter of the power from part to part, over that of noise
#: Least share of the input power around a line that is no transient: a third and more for noise, a
#: tenth by chance.
_MIN_ROUGH_SHARE = 1e-3
_MIN_INPUT_AMPLITUDE = 1e-12  # share of the largest line of an input below which there is no input


@keep_warnings
def identify_noise(
    u: np.ndarray,
    y: np.ndarray,
    *,
    fs: float,
    n_samples: int,
    f_min: float,
    f_max: float,
) -> Bla:
    """Estimate the best linear approximation (BLA) from a record with noise excitation, which is
    not periodic.

    If you can choose the excitation, use a multisine and `identify`: only they separate distortion
    from noise.

    Parameters
    ----------
    u, y : (n,) ndarray
        Input and output; n must be at least 2 n_samples.
    fs : float
        Sampling frequency [Hz].
    n_samples : int
        Sets the frequency resolution, fs / n_samples [Hz].
    f_min, f_max : float
        Band [Hz].

    Returns
    -------
    Bla
        Its `var_distortion` contains the noise, and `var_noise` is nan. `coherence` is the
        estimated coherence. `levels.excited` is the amplitude of a cosine with the output power in
        a band of fs / n_samples. `level_source` is "coherence" and the grid "noise".

    Raises
    ------
    ValueError
        The record is too short; the band has no lines; a number is out of range; or on some lines
        the input power cannot be distinguished from a transient, as at the ends of a sweep, so that
        G is undetermined there.

    Warns
    -----
    DataWarning
        The input is not stationary noise (a chirp or bursts, for example), so the bounds do not
        hold.

    References
    ----------
    Pintelon & Schoukens, 2nd ed., 2.6 (spectral analysis), 7.2.2 (local polynomial method).

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> u = rng.standard_normal(40_000)
    >>> bla = identify_noise(u, u**3, fs=1.0, n_samples=400, f_min=0.01, f_max=0.4)
    >>> bool(abs(bla.G.mean() - 3) < 0.1)
    True
    """
    fs, n_samples = require_positive("fs", fs), require_integer("n_samples", n_samples, least=16)
    u, y = _check_signals(u, y, n_samples)
    first, last = band_lines(
        fs,
        n_samples,
        f_min=require_positive("f_min", f_min),
        f_max=require_positive("f_max", f_max),
    )
    lines = np.arange(first, last + 1)
    f, F = lines * fs / n_samples, lines.size
    G, variance, S_yy, S_rest, dof = _estimate_frf_local(u, y, n=n_samples, lines=lines, f=f)
    _warn_of_nonstationary_input(u)
    cov, nan = variance[None, None], np.full((1, 1, F), np.nan)
    # A band of fs/n_samples has n/n_samples lines of the whole record, n = u.size, each with the
    # power 2 S_yy/n^2. A cosine has the power A^2/2, so A^2 = 4 S_yy/(n n_samples).
    return Bla(
        f=f,
        G=G,
        lines=LineGrid(excited=lines),
        fs=fs,
        experiment=Experiment(grid="noise", n_samples=n_samples, transient="local"),
        cov=Covariances(
            gamma=np.ones((1, 1, F)), noise=nan, total=cov, distortion=cov, even=nan, bound=cov
        ),
        dof=np.full(F, dof),
        level_source="coherence",
        grid_factor=np.ones(F),
        levels=levels_without_detection(f, np.sqrt(4 * S_yy / (u.size * n_samples))),
        # S_rest is per degree of freedom: without a relation of u and y it exceeds S_yy at times
        coherence=np.clip(1 - S_rest / np.maximum(S_yy, TINY), 0.0, 1.0),
    )


def _check_signals(u: np.ndarray, y: np.ndarray, n_samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Return u and y as arrays without their means; refuse unequal lengths and records too short
    for the resolution.
    """
    u, y = require_real_array("u", u, ndim=1), require_real_array("y", y, ndim=1)
    if u.size != y.size:
        raise ValueError(f"y must be as long as u, {u.size} samples, got {y.size}")
    if u.size < 2 * n_samples:
        raise ValueError(
            f"u must hold at least {2 * n_samples} samples, twice n_samples, got {u.size}"
        )
    return u - u.mean(), y - y.mean()


def _estimate_frf_local(
    u: np.ndarray, y: np.ndarray, *, n: int, lines: np.ndarray, f: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]:
    """Estimate the FRF on `lines`, at f [Hz], by local polynomials over the lines of the whole
    record around each.

    Returns G (F,); its variance by noise and distortion; the power of the output around each line
    and of its residual, each per line of the whole record; and the complex degrees of freedom of
    the variance.
    """
    ratio = u.size / n
    U, Y = np.fft.rfft(u), np.fft.rfft(y)
    side = max(_LINES_PER_SIDE, int(ratio / 2))
    centre = np.clip(np.round(lines * ratio).astype(int), side + 1, U.size - side - 2)
    around = centre[:, None] + np.arange(-side, side + 1)
    # distance from the wanted frequency, which lies between lines or, at the ends of the band, off
    # the centre
    s = (around - (lines * ratio)[:, None]) / side
    # Y = (g0 + g1 s + g2 s^2) U + t0 + t1 s + t2 s^2, the wanted g0 last
    A = np.stack([s**2, s, np.ones(s.shape), s**2 * U[around], s * U[around], U[around]], axis=-1)
    G, rest, leverage = least_squares(A, Y[around])
    size = power(U[around])
    known = (leverage > 0) & (size > (_MIN_INPUT_AMPLITUDE * np.max(np.abs(U))) ** 2)
    _require_determined_lines(
        f, np.divide(1.0, leverage * size, out=np.zeros(size.size), where=known)
    )
    left = power(rest)
    return (
        G,
        left * leverage,
        power(Y[around]) / around.shape[1],
        left,
        float(A.shape[-2] - A.shape[-1]),
    )


def _require_determined_lines(f: np.ndarray, rough_share: np.ndarray) -> None:
    """Refuse lines on which too small a share (F,) of the input power is rough over frequency.

    At the ends of its band a sweep is smooth over frequency, as transients are. The output does not
    show which of the two it follows, so G is not determined there, and its bound looks narrow.
    """
    bad = rough_share < _MIN_ROUGH_SHARE
    if bad.any():
        edges = np.flatnonzero(
            np.diff(np.concatenate([[True], bad, [True]]))
        )  # of the runs of good lines, in pairs
        runs = edges.reshape(-1, 2)
        if runs.size:
            first, end = runs[np.argmax(runs[:, 1] - runs[:, 0])]
        else:
            first, end = 0, 0
        if end - first > 1:
            band = f"{f[first]:.6g} to {f[end - 1]:.6g} Hz"
        else:
            band = ""
        if band:
            cure = f", or ask for a band inside {band}, the widest without such a line"
        else:
            cure = ""
        at = int(np.argmin(rough_share))
        raise ValueError(
            "u must have power of its own on every line, got"
            f" {format_count(int(bad.sum()), 'line')} of {f.size} without, worst at {f[at]:.4g} Hz,"
            " where u is as smooth over frequency as a transient (the end of a sweep, a line that"
            f" was not played), so G is not determined; play noise or a multisine{cure}"
        )


def _warn_of_nonstationary_input(u: np.ndarray) -> None:
    """Warn of an input (n,) whose power varies over time more than that of stationary noise:
    chirps, bursts.

    In a band with n lines the power of noise has a relative standard deviation of n^-1/2 from part
    to part.
    """
    size = u.size // _N_RECORD_PARTS
    power = (
        np.abs(
            np.fft.rfft(u[: _N_RECORD_PARTS * size].reshape(_N_RECORD_PARTS, size), axis=1)[:, 1:]
        )
        ** 2
    )
    mean = power.mean(axis=0)
    share = np.cumsum(mean) / mean.sum()
    edges = np.searchsorted(share, np.linspace(0.005, 0.995, _N_BANDS + 1))
    ratios = []
    for first, last in pairwise(edges.tolist()):
        if last - first < 4:
            continue
        band = power[:, first:last].sum(axis=1)
        lines = mean[first:last].sum() ** 2 / np.sum(mean[first:last] ** 2)
        ratios.append(float(np.var(band, ddof=1) / band.mean() ** 2 * lines))
    if ratios and np.mean(ratios) > _MAX_POWER_SCATTER:
        data_warning(
            "u must be stationary noise for the bounds to hold, got a power that varies"
            f" {np.mean(ratios) ** 0.5:.1f} times as much over time as that of noise, as for"
            " chirps and bursts. Play a multisine, or noise all the time"
        )
