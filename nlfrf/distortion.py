"""Even and odd distortion levels at the output, from the lines that were not excited."""

from __future__ import annotations

import numpy as np

from nlfrf.values import value


@value
class DistortionLevels:
    """What the output holds on each kind of line.

    Fields
    ------
    f_excited, f_odd, f_even : (F,), (O,), (E,) ndarray
        Frequencies of the excited and of the odd and even detection lines [Hz].
    excited, odd, even : (M, F), (M, O), (M, E) complex ndarray
        Output amplitudes of each realisation, averaged over periods [unit of y]. On detection lines the linear
        answer to whatever input energy stood there was taken off, Y - G U. The level is the rms over M.
    noise_excited, noise_odd, noise_even : (F,), (O,), (E,) ndarray
        Standard deviation of those amplitudes by noise [unit of y]; nan where there was one period only.
    """

    f_excited: np.ndarray
    f_odd: np.ndarray
    f_even: np.ndarray
    excited: np.ndarray
    odd: np.ndarray
    even: np.ndarray
    noise_excited: np.ndarray
    noise_odd: np.ndarray
    noise_even: np.ndarray


def nearest_lines(at: np.ndarray, lines: np.ndarray, n: int) -> np.ndarray:
    """(F, n) indices into `lines` of the n lines nearest to each of `at`; one-sided at the ends."""
    n = min(n, lines.size)
    place = np.searchsorted(lines, at)
    starts = np.clip(place[:, None] + np.arange(-n, 1), 0, lines.size - n)
    farthest = np.maximum(np.abs(lines[starts] - at[:, None]), np.abs(lines[starts + n - 1] - at[:, None]))
    first = starts[np.arange(at.size), np.argmin(farthest, axis=1)]
    return np.asarray(first[:, None] + np.arange(n))


def interpolate_frf(G: np.ndarray, excited: np.ndarray, lines: np.ndarray) -> np.ndarray:
    """G between its lines, linear in log magnitude and in phase; held at the ends."""
    log_magnitude = np.interp(lines, excited, np.log(np.maximum(np.abs(G), np.finfo(float).tiny)))
    phase = np.interp(lines, excited, np.unwrap(np.angle(G)))
    return np.asarray(np.exp(log_magnitude + 1j * phase))


def whitened_level(power: np.ndarray, G_lines: np.ndarray, G_excited: np.ndarray, window: np.ndarray) -> np.ndarray:
    """(F,) mean power over each window of lines, divided by |G|^2 before averaging and multiplied back.

    Across a resonance the distortion at the output follows |G|; without the whitening a window there would mix
    lines of very different power.
    """
    return np.asarray(np.abs(G_excited) ** 2 * (power / np.abs(G_lines) ** 2)[window].mean(axis=1))
