"""What two inputs together send to detection and to excited lines, exactly, as `calibration` has it for one.

For y = u_a^2 u_b with independent phases, p = A^2/4 two-sided and * the convolution (Pintelon & Schoukens, 3.4):

    E|Y(k)|^2 = 4 [2 (p_a * p_a * p_b)(k) - sum_{2j+m=k} p_a(j)^2 p_b(m)],

at an excited line p_a * p_a * p_b less p_b(k) sum_j p_a(j)^2: these triples (j, -j, k) make up the BLA, sigma_a^2 in
column b, exactly. The argument of the grids carries over: special-odd has 3 to 1 in a narrow band for both monomials.
"""

from __future__ import annotations

import numpy as np

from nlfrf.bla.calibration import LARGEST, variance_ratio

__all__ = ["cross_factor", "cross_variance"]


def cross_variance(a: np.ndarray, b: np.ndarray, excited: np.ndarray, lines: np.ndarray) -> np.ndarray:
    """(K,) variance of the output amplitude of y = u_a^2 u_b over random phases, on any lines.

    Parameters
    ----------
    a, b : (F,) ndarray
        Amplitudes of the two inputs on the excited lines.
    excited, lines : (F,), (K,) int ndarray
        Excited lines, and those to evaluate.

    Examples
    --------
    One experiment with amplitudes one: the variance at line 1, and what line 5 detects.

    >>> excited = np.array([1, 3, 9, 11, 17, 19])
    >>> cross_variance(np.ones(6), np.ones(6), excited, np.array([1, 5])).round(9)
    array([7.25, 5.75])
    """
    last = int(max(excited[-1], lines.max()))
    n = int(2 ** np.ceil(np.log2(3 * last + last + 2)))

    def spread(at: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Spectrum of a two-sided even sequence."""
        full = np.zeros(n)
        full[at] = values
        full[-at] = values
        return np.fft.rfft(full).real

    p_a, p_b = a**2 / 4, b**2 / 4
    S_a, S_b = spread(excited, p_a), spread(excited, p_b)
    doubled = np.zeros(n)  # 2j may lie past the end: wrapped around it meets no line that is read
    np.add.at(doubled, (2 * excited) % n, p_a**2)
    np.add.at(doubled, (-2 * excited) % n, p_a**2)
    counts = np.fft.irfft(2 * S_a * S_a * S_b - np.fft.rfft(doubled).real * S_b, n)[lines]
    here = np.zeros(last + 1)
    here[excited] = p_b
    return np.maximum(4 * (counts - 2 * here[lines] * 2 * np.sum(p_a**2)), 0.0)


def cross_factor(spectra: np.ndarray, excited: np.ndarray, detection: np.ndarray, window: np.ndarray) -> np.ndarray:
    """(F,) the factor from the level on detection lines to that at each excited line, from 1 to 3.

    Parameters
    ----------
    spectra : (S, F) ndarray
        Amplitude spectra of what may drive a nonlinearity: the inputs, and the outputs.
    excited, detection : (F,), (O,) int ndarray
        Lines.
    window : (F, n) int ndarray
        Detection lines used, as indices.
    """
    largest = variance_ratio(spectra, excited, detection, window).max(axis=0)
    for one in spectra:
        both = cross_variance(one, one, excited, np.concatenate([excited, detection]))
        at_detection = both[excited.size :][window].mean(axis=1)
        ratio = np.full(excited.size, np.inf)
        np.divide(both[: excited.size], at_detection, out=ratio, where=at_detection > 1e-9 * both.max())
        largest = np.maximum(largest, ratio)
    return np.clip(largest, 1.0, LARGEST)
