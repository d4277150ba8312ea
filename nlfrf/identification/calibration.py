"""What a detection line tells about an excited line, grid by grid.

A cubic nonlinearity sends to line k every combination f1 + f2 + f3 of excited lines. How many combinations land on
a detection line and how many on an excited line depends on the grid, so a level that was read on detection lines
has to be scaled before it says anything about excited lines. The counts below are exact for y = u^3 and any
amplitude spectrum; they are convolutions, done by FFT.
"""

from __future__ import annotations

import numpy as np

from nlfrf.shared.transforms import dct_even, fast_length

__all__ = ["LARGEST", "grid_factor", "variance_ratio"]


LARGEST = 3.0  # what a special-odd grid reaches in a narrow band: 4.77 dB


def cubic_variance(amplitude: np.ndarray, excited: np.ndarray, lines: np.ndarray) -> np.ndarray:
    """Variance of the output amplitude of y = u^3 over random phases, on any lines.

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
        E|Y - G U|^2, with G the BLA of the cubic (`cubic_bla`): at detection lines E|Y|^2.

    Notes
    -----
    With p_k = A_k^2 / 4 (two-sided), S3 = p*p*p, S21(k) = sum_{2j+m=k} p_j^2 p_m and S111(k) = sum_{3j=k} p_j^3 the
    variance is 4 (6 S3 - 9 S21 + 4 S111); at an excited line the coherent triples (j, -j, k), which make up the
    BLA, are taken out of S3 and S21 first.

    Examples
    --------
    >>> lines = np.array([1, 3, 9, 11, 17, 19])
    >>> cubic_variance(np.ones(6), lines, np.array([1, 5])).round(9)
    array([12.9375, 15.75  ])
    """
    last = int(max(excited[-1], lines.max()))
    n = fast_length(2 * last + 1)  # terms beyond last alias onto lines outside -last..last
    both = np.zeros((2, *amplitude.shape[:-1], n + 1))
    p, doubled = both
    p[..., excited] = amplitude * amplitude / 4
    np.multiply(p[..., : last + 1], p[..., : last + 1], out=doubled[..., : 2 * last + 1 : 2])
    # the DFT of an even sequence of period 2 n is a DCT of its half
    spectrum, spectrum_doubled = dct_even(both)
    spectrum_doubled *= -9
    spectrum_doubled += 6 * (spectrum * spectrum)
    sums = dct_even(spectrum * spectrum_doubled)
    counts = sums.take(lines, axis=-1) / (2 * n)  # 6 S3 - 9 S21
    tripled = np.zeros((*amplitude.shape[:-1], last + 1))
    tripled[..., ::3] = p[..., : last // 3 + 1]
    p_k, p_third = p.take(lines, axis=-1), tripled.take(lines, axis=-1)
    counts -= 9 * p_k * (4 * np.vecdot(p, p)[..., None] - 3 * p_k * p_k)
    counts += 4 * p_third * p_third * p_third
    return np.maximum(4 * counts, 0.0)


def cubic_bla(amplitude: np.ndarray) -> np.ndarray:
    """(F,) the best linear approximation of y = u^3 on the excited lines: 3 sigma^2 - 3/4 A_k^2.

    >>> cubic_bla(np.ones(6))
    array([8.25, 8.25, 8.25, 8.25, 8.25, 8.25])
    """
    return 3 * np.sum(amplitude**2) / 2 - 0.75 * amplitude**2


def variance_ratio(amplitude: np.ndarray, excited: np.ndarray, detection: np.ndarray, window: np.ndarray) -> np.ndarray:
    """Variance at each excited line over the mean on its window of detection lines, for a cubic.

    Parameters
    ----------
    amplitude : (..., F) ndarray
        Amplitude spectrum of whatever drives the nonlinearity.
    excited, detection : (F,), (O,) int ndarray
        Lines.
    window : (F, n) int ndarray
        For each excited line the indices of the detection lines used.

    Returns
    -------
    (..., F) ndarray
        The ratio; inf where the detection lines of a window hold no combination at all.
    """
    # the convolutions are exact to rounding of the largest count; below that a count is noise
    counts = cubic_variance(amplitude, excited, np.concatenate([excited, detection]))
    at_excited, at_detection = counts[..., : excited.size], counts[..., excited.size :]
    trusted = 1e-9 * counts.max(axis=-1, keepdims=True)
    mean = np.add.reduce(at_detection.take(window, axis=-1), axis=-1) / window.shape[1]
    ratio = np.full(at_excited.shape, np.inf)
    np.divide(at_excited, mean, out=ratio, where=mean > trusted)
    return ratio


def grid_factor(
    amplitude_u: np.ndarray, amplitude_y: np.ndarray, excited: np.ndarray, detection: np.ndarray, window: np.ndarray
) -> np.ndarray:
    """The factor from the level on detection lines to the variance at each excited line, from 1 to 3.

    The nonlinearity may be driven by the input itself, or by the output (friction sees the displacement): the
    larger of the two counts is taken. Arguments as in `variance_ratio`.
    """
    ratio = variance_ratio(np.array([amplitude_u, amplitude_y]), excited, detection, window)
    return np.minimum(np.maximum(np.maximum.reduce(ratio), 1.0), LARGEST)
