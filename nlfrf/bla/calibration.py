"""Ratio of the distortion variance on excited lines to that on detection lines, for a cubic
nonlinearity; and a correction for the crest factor of the input.

For y = u^3 the output on line k is the sum over all excited lines with f1 + f2 + f3 = k (Pintelon &
Schoukens, 2nd ed., 3.4). The grid decides how many of these terms are on a detection line, and how
many on an excited line. So the variance on excited lines is that on detection lines times a factor.
The numbers of terms are convolutions, computed by FFT, and exact for any amplitude spectrum.
"""

from __future__ import annotations

import numpy as np

from nlfrf._base.numbers import TINY, fast_length, rms, squared_modulus

MAX_SPECIAL_ODD_RATIO = 3.0  # largest ratio on a special-odd grid, in a narrow band: 4.77 dB
#: Times one over the number of lines: the share of the distortion that is one gain on all lines.
#: Neither roughness nor detection lines show it. For the envelope a of a narrow band, with mean
#: |a|^2 fixed, the mean of |a|^4 scatters by 4 / n and the middle lines by 3/2 (for a fifth power
#: the share is 6 / n).
_COHERENT_SHARE = 8 / 3
#: Three windows of nine lines. With fewer lines peaks are chance, and a band does not show how its
#: level varies.
FEW_LINES = 27
_MAX_DISTORTION_RATIO = 3.0  # exceeded by one realisation in a hundred with thirty lines
_MAX_COHERENT_SHARE = (
    1.0  # three standard deviations of the gain of a cubic on thirty lines, with its allowance
)
_NO_SCATTER = 1e-12  # share of the squared gain of a cubic below which its scatter is rounding
_MIN_RATIO_ON_FEW_LINES, _MAX_RATIO_ON_FEW_LINES = 0.6, 6.0
#: Factor on the gain that a cubic puts on all lines: a fifth power needs 9/4, a jump less than one.
_HIGHER_ORDER_ALLOWANCE = 1.25
#: Number of amplitudes in all realisations above which they distort alike, within 17 %, unless
#: their peaks are low.
_ENOUGH_AMPLITUDES = 500


def cubic_variance(amplitude: np.ndarray, excited: np.ndarray, lines: np.ndarray) -> np.ndarray:
    """Return the variance of the output amplitude of y = u^3 over random phases, on any lines.

    Parameters
    ----------
    amplitude : (..., F) ndarray
        Amplitude of the cosine on each excited line.
    excited : (F,) int ndarray
        Excited lines.
    lines : (K,) int ndarray
        Lines to evaluate, in the excited band or outside it.

    Returns
    -------
    (..., K) ndarray
        E|Y - G U|^2, with G the BLA of the cubic, 3 sigma^2 - 3/4 A_k^2: at detection lines E|Y|^2.

    Notes
    -----
    With p_k = A_k^2 / 4 (two-sided), S3 = p*p*p, S21(k) = sum_{2j+m=k} p_j^2 p_m and S111(k) =
    sum_{3j=k} p_j^3 the variance is 4 (6 S3 - 9 S21 + 4 S111). At an excited line the coherent
    triples (j, -j, k), which make up the BLA, are removed from S3 and S21 first.

    Examples
    --------
    >>> lines = np.array([1, 3, 9, 11, 17, 19])
    >>> cubic_variance(np.ones(6), lines, np.array([1, 5])).round(9)
    array([12.9375, 15.75  ])
    """
    last = int(max(excited[-1], lines.max()))
    n = 2 * fast_length(2 * last + 1)  # terms beyond last alias onto lines outside -last..last
    both = np.zeros((2, *amplitude.shape[:-1], n))
    p, doubled = both
    power = amplitude * amplitude
    p[..., excited] = power / 4
    np.multiply(p[..., : last + 1], p[..., : last + 1], out=doubled[..., : 2 * last + 1 : 2])
    # twice the real part is the DFT of the even sequence; this is one half of it
    spectrum, spectrum_doubled = 2 * np.fft.rfft(both).real
    spectrum_doubled *= -9
    spectrum_doubled += 6 * (spectrum * spectrum)
    counts = np.fft.irfft(spectrum * spectrum_doubled, n).take(lines, axis=-1)  # 6 S3 - 9 S21
    tripled = np.zeros((*amplitude.shape[:-1], last + 1))
    tripled[..., ::3] = p[..., : last // 3 + 1]
    p, p_third = p.take(lines, axis=-1), tripled.take(lines, axis=-1)
    counts -= 9 * p * (np.vecdot(power, power)[..., None] / 4 - 3 * p * p)
    counts += 4 * p_third * p_third * p_third
    return np.maximum(4 * counts, 0.0)


def variance_ratio(
    amplitude: np.ndarray, excited: np.ndarray, *, detection: np.ndarray, window: np.ndarray
) -> np.ndarray:
    """Return the variance at each excited line over the mean on its window of detection lines, for
    a cubic.

    Parameters
    ----------
    amplitude : (..., F) ndarray
        Amplitude spectrum of the signal that drives the nonlinearity.
    excited, detection : (F,), (O,) int ndarray
        Lines.
    window : (F, n) int ndarray
        For each excited line the indices of the detection lines used.

    Returns
    -------
    (..., F) ndarray
        The ratio; inf if the detection lines of a window get no combination.
    """
    # the convolutions are exact to rounding of the largest count; below that a count is noise
    counts = cubic_variance(amplitude, excited, np.concatenate([excited, detection]))
    at_excited, at_detection = counts[..., : excited.size], counts[..., excited.size :]
    trusted = 1e-9 * counts.max(axis=-1, keepdims=True)
    mean = np.add.reduce(at_detection.take(window, axis=-1), axis=-1) / window.shape[1]
    ratio = np.full(at_excited.shape, np.inf)
    np.divide(at_excited, mean, out=ratio, where=mean > trusted)
    return ratio


def crest_correction(U: np.ndarray, lines: np.ndarray, low: bool) -> tuple[float, float]:
    """Return the correction of a distortion level for the crest factor of the inputs, and its
    coherent share.

    Low-crest signals excite less distortion. A low crest factor is either luck or the result of
    optimisation; both bias the level low. For a cubic the ratio is known exactly. With few lines,
    or a crest factor lower than usual, its square allows for a fifth power. The ratio is clipped at
    `_MAX_DISTORTION_RATIO`, the share at `_MAX_COHERENT_SHARE`: behind dynamics the crest factor is
    different, and a nearly square input would need a factor without bound.

    Parameters
    ----------
    U : (M, F) complex ndarray
        Input of each realisation.
    lines : (F,) int ndarray
        Excited lines.
    low : bool
        Whether their crest factor is lower than usual (`have_low_crest`).

    Returns
    -------
    distortion_ratio : float
        Expected distortion power with random phases over that with the given phases: at least one;
        with fewer than `FEW_LINES` lines, where high peaks are luck too, it may be below one.
    coherent_share : float
        Power of the distortion that is one gain on all lines, over the power of the scatter about
        it.

    Examples
    --------
    Thirteen lines in phase are one high peak; Schroeder's phases have none. Both gains are far from
    usual.

    >>> k = np.arange(1, 14)
    >>> high, low = np.ones((1, 13)), np.exp(-1j * np.pi * k**2 / 13)[None]
    >>> np.round([crest_correction(high, k, low=False), crest_correction(low, k, low=True)], 1)
    array([[0.6, 4.9],
           [6. , 5.8]])
    """
    n, n_lines = U.shape
    chance, few = _COHERENT_SHARE / n_lines, n_lines < FEW_LINES
    if U.size > _ENOUGH_AMPLITUDES and not low:
        return 1.0, chance
    ratio, gap = _cubic_distortion_ratio(U, lines)
    if few or low:
        typical = ratio * ratio
    else:
        typical = ratio
    if few:
        typical = min(max(typical, _MIN_RATIO_ON_FEW_LINES), _MAX_RATIO_ON_FEW_LINES)
    else:
        typical = min(max(typical, 1.0), _MAX_DISTORTION_RATIO)
    if not (few and n == 1) and not low:
        return typical, chance
    amplitude = rms(U)
    whole = float(np.mean(cubic_variance(amplitude, lines, lines) / (amplitude * amplitude))) / n
    if (
        whole <= _NO_SCATTER * float(np.mean(amplitude * amplitude)) ** 2
    ):  # two or three lines that no triple reaches
        return typical, _MAX_COHERENT_SHARE
    common = _HIGHER_ORDER_ALLOWANCE * gap * gap * (1 + chance) / whole * ratio
    return typical, common if few and n == 1 else min(max(common, chance), _MAX_COHERENT_SHARE)


def _cubic_distortion_ratio(U: np.ndarray, lines: np.ndarray) -> tuple[float, float]:
    """Return the expected distortion power of u^3 over that of an input (M, F), and a gain
    difference.

    The expectation is over random phases. The gain difference is the gain of the linear part of
    u^3, mean u^4 over mean u^2, less its expectation. The expectations are exact, by the cumulants
    of a sum of cosines with independent phases: A^2 / 2, -3 A^4 / 8 and 5 A^6 / 4 for each.
    """
    second, fourth, sixth = _signal_moments(U, lines)
    gain = fourth / second
    left = float(np.add.reduce(sixth - fourth * gain)) / len(U)
    A2 = np.add.reduce(squared_modulus(U)) / len(U)
    k2, k4, k6 = float(A2.sum() / 2), float(-0.375 * (A2 @ A2)), float(1.25 * (A2 * A2 @ A2))
    expected_gain = (k4 + 3 * k2**2) / k2
    expected = k6 + 15 * k4 * k2 + 15 * k2**3 - expected_gain**2 * k2
    return expected / max(left, TINY), float(np.add.reduce(gain)) / len(U) - expected_gain


def _signal_moments(U: np.ndarray, lines: np.ndarray) -> np.ndarray:
    """Return the (3, M) mean square, fourth and sixth power of multisines of amplitudes U (M,
    F).
    """
    n = 2 * fast_length(2 * int(lines[-1]))  # even, so that odd lines have half-wave symmetry
    spectrum = np.zeros((len(U), n // 2 + 1), dtype=complex)
    spectrum[:, lines] = U / 2
    u = np.fft.irfft(spectrum, n, norm="forward")
    if np.bitwise_and.reduce(lines) & 1:
        u = u[:, : n // 2]  # the other half is its negative
    square = u * u
    return np.array([np.vecdot(x, x) for x in (u, square, square * u)]) / u.shape[1]
