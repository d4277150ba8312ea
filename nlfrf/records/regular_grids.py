"""Regular grids among lines that the actuator itself distorts.

What an actuator adds to a multisine (saturation, dead zone, amplifier) scatters from line to line as noise does, where
a designed spectrum is smooth. So lines that lie in step (every line, every odd one, 4k+1, 8k+1 with 8k+3) and are
smooth were played, and those that jump were not.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from nlfrf.excitation.lines import LineGrid, recognise

__all__ = ["BEYOND", "jumpy_grid", "played_lines"]


JUMPY = 2.5  # [dB] from one line to the next, in the median: noise has 4.8, a spectrum distorted by 20 % has 1.6
BELOW = 6.0  # how far distortion stands under the lines beside it at least [dB]
SHARE = 0.75  # of the power that the lines played must hold
END = 8  # lines in step that are looked at on either side of the end of the band
BEYOND = 4 * END  # lines beyond it
MOST = 0.95  # of the lines in step that must stand out of the noise
FEWEST = 12  # lines from which smooth is told from jumpy


def played_lines(power: np.ndarray, found: np.ndarray, total: float) -> np.ndarray:
    """The lines found, or those of them that were played where the others are the actuator's distortion.

    Parameters
    ----------
    power : (K,) ndarray
        Power of the lines 1 to K, as many beyond those found as tell where the band ends, or all.
    found : (F,) int ndarray
        Lines that stand out of the noise.
    total : float
        Power of all lines.
    """
    level = 10 * np.log10(np.maximum(power, 1e-300))
    for pattern in patterns(level, found):
        if pattern.size < FEWEST:
            continue
        first, last = band(level[pattern - 1])
        played = pattern[first:last]
        if played.size < FEWEST or power[played - 1].sum() < SHARE * total or jumps(level[played - 1]) > JUMPY:
            continue
        if np.isin(played, found, assume_unique=True).mean() < MOST or recognise(played) == "custom":
            continue
        others = np.setdiff1d(np.arange(played[0], played[-1]), played, assume_unique=True)
        if stands_out(level, played, others) and stands_out(level, played, beyond(played, level.size)):
            return played
    return found


def patterns(level: np.ndarray, found: np.ndarray) -> list[np.ndarray]:
    """The lines in step with a regular grid, from the first to the last one found; the sparse grids first."""
    inside = np.arange(found[0], found[-1] + 1)
    special = [inside[np.isin((inside - shift) % 8, (1, 3))] for shift in (0, 2, 4, 6)]
    sparse = [inside[inside % 4 == k] for k in (1, 3)]
    odd = inside[inside % 2 == 1]
    top = sliding_window_view(np.pad(level[odd - 1], 4, mode="edge"), 9).max(axis=1)
    return [*special, *sparse, odd, odd[level[odd - 1] > top - BELOW - 2.0], inside]


def jumps(level: np.ndarray) -> float:
    """How far a level jumps from line to line, in the median [dB]."""
    return float(np.median(np.abs(np.diff(level)))) if level.size > 1 else 0.0


def band(level: np.ndarray) -> tuple[int, int]:
    """Where the smooth stretch of a level begins and ends: its strongest line, and all that is joined to it."""
    strongest = int(np.argmax(np.convolve(level, np.ones(5) / 5, "same")[2:-2])) + 2
    last = edge(level[strongest:]) + strongest
    first = strongest + 1 - edge(level[strongest::-1])
    return first, last


def edge(level: np.ndarray) -> int:
    """How many lines belong to the stretch that the first one begins: up to a fall after which the level jumps."""
    highest = np.full(level.size, -np.inf)  # of the lines before each
    for back in range(1, min(END, level.size - 1) + 1):
        np.maximum(highest[back:], level[:-back], out=highest[back:])
    for k in (np.flatnonzero(level[1:] <= highest[1:] - BELOW) + 1).tolist():
        before, after = level[max(0, k - END) : k], level[k : k + END]
        if max(level[k], float(np.median(after))) > np.median(before) - BELOW:
            continue
        if after.size < 4 or jumps(after) > 0.6 * JUMPY or after.max() < before.min() - BELOW:
            return k
    return level.size


def beyond(played: np.ndarray, n_lines: int) -> np.ndarray:
    """As many lines beyond the band as lie in step inside it."""
    last = int(played[-1])
    return np.arange(last + 1, min(n_lines, last + BEYOND) + 1)


def stands_out(level: np.ndarray, played: np.ndarray, others: np.ndarray) -> bool:
    """Whether other lines stand clearly under the nearest played ones, nearly all of them."""
    if others.size == 0:
        return True
    nearest = played[np.clip(np.searchsorted(played, others), 0, played.size - 1)]
    under = level[nearest - 1] - level[others - 1]
    return bool(np.median(under) > 2 * BELOW or (np.median(under) > BELOW and jumps(level[others - 1]) > JUMPY))


def jumpy_grid(power: np.ndarray, grid: LineGrid) -> float:
    """How far the level of a grid found in the powers (K,) of the lines 1 to K jumps [dB]; 0 where it is smooth."""
    if grid.excited.size < FEWEST:
        return 0.0
    jump = jumps(10 * np.log10(np.maximum(power[grid.excited - 1], 1e-300)))
    return jump if jump > JUMPY else 0.0
