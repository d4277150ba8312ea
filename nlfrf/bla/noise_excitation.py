"""The BLA from noise excitation: G = S_YU / S_UU, by Welch segments or by local polynomials.

Pintelon & Schoukens, 2nd ed., 2.6 and 7.2.2. An input that never repeats does not separate distortion from noise: the
variances hold both. Local polynomials are the default, because segments leak at a resonance.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from nlfrf._base.arguments import (
    data_warning,
    format_count,
    keep_warnings,
    require_choice,
    require_integer,
    require_positive,
    require_real_array,
)
from nlfrf._base.numbers import TINY, power
from nlfrf.bla.bla import Bla, Covariances, DistortionLevels, Experiment
from nlfrf.signals.lines import LineGrid

HANN_NOISE_BANDWIDTH = 1.5  # lines that the power in one line of a Hann window comes from
LINES_PER_SIDE = 6  # DFT lines on either side that a local polynomial sees
N_RECORD_PARTS = 16  # of the record, over which the power of stationary noise stays
N_BANDS = 8  # of the band that is excited
MAX_POWER_SCATTER = 4.0  # how many times the scatter of noise that power may have from part to part
#: Of the power of an input around a line: of noise a third and more is no transient, by chance a tenth.
MIN_ROUGH_SHARE = 1e-3
MIN_INPUT_AMPLITUDE = 1e-12  # of the largest line of an input, below which there is none
#: In 95 % bounds: how far leakage takes a line at least; by chance some of 265 lines are 2 to 2.5 off.
MIN_LEAKAGE_ERROR = 3.0


@keep_warnings
def identify_noise(
    u: np.ndarray,
    y: np.ndarray,
    *,
    fs: float,
    n_samples: int,
    f_min: float,
    f_max: float,
    method: str = "local",
) -> Bla:
    """BLA from a record of noise excitation, of any length and not periodic.

    Parameters
    ----------
    u, y : (n,) ndarray
        Input and output, n of at least 8 n_samples for "welch", 2 n_samples for "local".
    fs : float
        Sampling frequency [Hz].
    n_samples : int
        The resolution asked for is fs / n_samples.
    f_min, f_max : float
        Band [Hz].
    method : str
        "welch": Hann-windowed half-overlapping segments of n_samples. "local": a quadratic for the FRF and one for
        the transient over the DFT lines around each frequency of the whole record; much less leakage.

    Returns
    -------
    Bla
        With `grid` "noise", `level_source` "coherence" and that `coherence`; distortion contains the noise (var_noise
        is nan). `levels.excited` is the amplitude of a cosine of the power in one line, fs / n_samples wide.

    Raises
    ------
    ValueError
        A record that is too short, a band without lines, numbers out of range; lines on which the input has no power
        distinguishable from a transient, as at the ends of a sweep: G is not determined there.

    Warns
    -----
    DataWarning
        An input that is no stationary noise (a chirp, bursts), for which the bounds do not hold. Segments of "welch"
        that smear a resonance.

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
    u, y = check_signals(u, y, n_samples=n_samples, method=method)
    fs, n_samples = require_positive("fs", fs), require_integer("n_samples", n_samples, least=16)
    lines = band_lines(require_positive("f_min", f_min), require_positive("f_max", f_max), fs=fs, n_samples=n_samples)
    u, y = u - u.mean(), y - y.mean()
    frf = estimate_frf_local(u, y, n=n_samples, lines=lines, fs=fs)
    warn_of_nonstationary_input(u)
    if method == "welch":
        G_local, frf = frf.G, estimate_frf_welch(u, y, n=n_samples, lines=lines)
        warn_of_coarse_segments(lines * fs / n_samples, frf, G_local=G_local)
    return Bla(
        f=lines * fs / n_samples,
        G=frf.G,
        lines=LineGrid(excited=lines),
        fs=fs,
        experiment=Experiment(grid="noise", n_samples=n_samples, transient="local" if method == "local" else "none"),
        cov=Covariances.of_variances(noise=np.full(lines.size, np.nan), total=frf.variance, distortion=frf.variance),
        dof=np.full(lines.size, float(frf.dof)),
        level_source="coherence",
        grid_factor=np.ones(lines.size),
        levels=output_amplitudes(lines * fs / n_samples, frf.output_power),
        coherence=frf.coherence,
    )


class NoiseFrf(NamedTuple):
    """An FRF from noise excitation, line by line.

    Fields
    ------
    G : (F,) complex ndarray
        The FRF.
    variance : (F,) ndarray
        Variance of G by noise and distortion.
    dof : float
        Complex degrees of freedom behind that variance.
    coherence : (F,) ndarray
        Share of the output power that is linear in the input.
    output_power : (F,) ndarray
        Power of the output in one line.
    """

    G: np.ndarray
    variance: np.ndarray
    dof: float
    coherence: np.ndarray
    output_power: np.ndarray


def check_signals(u: np.ndarray, y: np.ndarray, *, n_samples: int, method: str) -> tuple[np.ndarray, np.ndarray]:
    """Return u and y as arrays; refuse unequal lengths and records too short for the resolution."""
    u, y = require_real_array("u", u, ndim=1), require_real_array("y", y, ndim=1)
    if u.size != y.size:
        raise ValueError(f"y must be as long as u, {u.size} samples, got {y.size}")
    require_choice("method", method, ("local", "welch"))
    least = (8 if method == "welch" else 2) * require_integer("n_samples", n_samples, least=16)
    if u.size < least:
        raise ValueError(f"u must hold at least {least} samples for method={method!r}, got {u.size}")
    return u, y


def band_lines(f_min: float, f_max: float, *, fs: float, n_samples: int) -> np.ndarray:
    """Return the (F,) lines of the band, both ends included whatever the rounding of the frequencies."""
    first, last = int(np.ceil(f_min / fs * n_samples - 1e-6)), int(np.floor(f_max / fs * n_samples + 1e-6))
    lines = np.arange(max(1, first), last + 1)
    if lines.size == 0 or 2 * lines[-1] >= n_samples:
        raise ValueError(f"f_min and f_max must hold lines below Nyquist, got {f_min:g} to {f_max:g} Hz")
    return lines


def output_amplitudes(f: np.ndarray, power_y: np.ndarray) -> DistortionLevels:
    """Return the output as amplitudes of cosines with its power in one line; there are no detection lines."""
    nothing = np.empty((1, 0))
    return DistortionLevels(
        f_excited=f,
        f_odd=nothing[0],
        f_even=nothing[0],
        excited=np.sqrt(2 * power_y)[None].astype(complex),
        odd=nothing.astype(complex),
        even=nothing.astype(complex),
        noise_excited=np.full(f.size, np.nan),
        noise_odd=nothing[0],
        noise_even=nothing[0],
    )


def estimate_frf_welch(u: np.ndarray, y: np.ndarray, *, n: int, lines: np.ndarray) -> NoiseFrf:
    """Estimate the FRF on `lines` from half-overlapping Hann segments of n samples."""
    from scipy import signal  # takes a second to import

    options = {"nperseg": n, "noverlap": n // 2, "window": "hann", "detrend": False, "scaling": "spectrum"}
    S_uu = signal.welch(u, **options)[1][lines]
    S_yy = signal.welch(y, **options)[1][lines]
    S_yu = signal.csd(u, y, **options)[1][lines]
    G = S_yu / S_uu
    n_segments = 2 * (u.size // n) - 1
    dof = n_segments / (1 + 2 / 36)  # half-overlapping Hann windows correlate by 1/6: 11 effective of 12
    rest = np.maximum(S_yy - np.abs(S_yu) ** 2 / S_uu, 0.0)
    return NoiseFrf(
        G=G,
        variance=rest / S_uu / (dof - 1),
        dof=dof - 1,
        coherence=1 - rest / np.maximum(S_yy, TINY),
        output_power=S_yy / HANN_NOISE_BANDWIDTH,
    )


def estimate_frf_local(u: np.ndarray, y: np.ndarray, *, n: int, lines: np.ndarray, fs: float) -> NoiseFrf:
    """Estimate the FRF on `lines` by local polynomials over the lines of the whole record around each frequency."""
    ratio = u.size / n
    U, Y = np.fft.rfft(u), np.fft.rfft(y)
    side = max(LINES_PER_SIDE, int(ratio / 2))
    centre = np.clip(np.round(lines * ratio).astype(int), side + 1, U.size - side - 2)
    around = centre[:, None] + np.arange(-side, side + 1)
    # from the frequency that is wanted, which lies between the lines or, at the ends of the band, off the middle
    s = (around - (lines * ratio)[:, None]) / side
    # Y = (g0 + g1 s + g2 s^2) U + t0 + t1 s + t2 s^2, the wanted g0 last
    columns = np.stack([s**2, s, np.ones(s.shape), s**2 * U[around], s * U[around]], axis=-1)
    A = np.concatenate([columns, U[around][..., None]], axis=-1)
    norm = np.sqrt(power(np.swapaxes(A, -1, -2)))
    Q, R = np.linalg.qr(A / norm[:, None, :])
    projected = (np.swapaxes(Q, -1, -2).conj() @ Y[around][..., None])[..., 0]
    pivot = R[:, -1, -1] * norm[:, -1]
    own = np.abs(pivot) ** 2 / np.maximum(norm[:, -1] ** 2, TINY)
    require_determined_lines(lines * fs / n, np.where(norm[:, -1] > MIN_INPUT_AMPLITUDE * np.max(np.abs(U)), own, 0.0))
    rest = Y[around] - (Q @ projected[..., None])[..., 0]
    dof = A.shape[-2] - A.shape[-1]
    S_yy, S_rest = power(Y[around]) / around.shape[1], power(rest) / dof
    coherence = np.clip(1 - S_rest / np.maximum(S_yy, TINY), 0.0, 1.0)
    variance = S_rest / np.abs(pivot) ** 2
    return NoiseFrf(
        G=projected[:, -1] / pivot,
        variance=variance,
        dof=float(dof),
        coherence=coherence,
        output_power=2 * S_yy / (u.size * n),
    )


def require_determined_lines(f: np.ndarray, rough_share: np.ndarray) -> None:
    """Refuse lines whose input power is smooth over frequency but for a share (F,) that is too small.

    At the ends of its band a sweep is smooth over frequency, as transients are. The output does not show which of the
    two it follows, so G is not determined there, and its bound looks narrow.
    """
    bad = rough_share < MIN_ROUGH_SHARE
    if bad.any():
        good = f[~bad]
        cure = f", or ask for a band inside {good[0]:.4g} to {good[-1]:.4g} Hz" if good.size else ""
        at = int(np.argmin(rough_share))
        raise ValueError(
            f"u must have power of its own on every line, got {format_count(int(bad.sum()), 'line')} of {f.size} "
            f"without, worst at {f[at]:.4g} Hz, where u is as smooth over frequency as a transient (the end of a "
            "sweep, a line that was not played) and G is not determined; play noise or a multisine"
            f"{cure}"
        )


def warn_of_nonstationary_input(u: np.ndarray) -> None:
    """Warn of an input (n,) whose power varies over time more than that of stationary noise: chirps, bursts.

    In a band with n lines the power of noise has a relative standard deviation of n^-1/2 from part to part.
    """
    size = u.size // N_RECORD_PARTS
    power = np.abs(np.fft.rfft(u[: N_RECORD_PARTS * size].reshape(N_RECORD_PARTS, size), axis=1)[:, 1:]) ** 2
    mean = power.mean(axis=0)
    share = np.cumsum(mean) / mean.sum()
    edges = np.searchsorted(share, np.linspace(0.005, 0.995, N_BANDS + 1))
    ratios = []
    for first, last in pairwise(edges.tolist()):
        if last - first < 4:
            continue
        band = power[:, first:last].sum(axis=1)
        lines = mean[first:last].sum() ** 2 / np.sum(mean[first:last] ** 2)
        ratios.append(float(np.var(band, ddof=1) / band.mean() ** 2 * lines))
    if ratios and np.mean(ratios) > MAX_POWER_SCATTER:
        data_warning(
            f"u must be stationary noise for its bounds to hold: its power scatters {np.mean(ratios) ** 0.5:.1f} times "
            "as much over time as that of noise, as chirps and bursts do; play a multisine, or noise all the time"
        )


def warn_of_coarse_segments(f: np.ndarray, frf: NoiseFrf, *, G_local: np.ndarray) -> None:
    """Warn where segments smear a resonance: G is further from the local estimate than its variance allows."""
    G, dof, variance = frf.G, frf.dof, frf.variance
    bound = np.sqrt(dof * np.expm1(-np.log(0.05) / dof) * variance)  # as of `Bla.bound`
    far = np.abs(G - G_local) > MIN_LEAKAGE_ERROR * bound
    if far.any():
        at = int(np.argmax(np.where(far, np.abs(G - G_local) / bound, 0.0)))
        data_warning(
            f"n_samples must resolve the resonances: on {far.sum()} of {f.size} lines, worst at {f[at]:g} Hz, leakage "
            'moves G further than its bound; take method="local" or longer segments'
        )
