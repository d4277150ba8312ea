"""Which of two signals was played and which answers to it, as their lines show.

A machine adds distortion, noise and transients between the lines that are excited, and takes none of it away. So of two
signals that repeat together the one whose detection lines are empty, where those of the other are not, was played.
Where neither shows that, lines of one level were: what a machine makes of them has its resonances in it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from nlfrf._base.numbers import has_equal_periods
from nlfrf.records.excited_lines import SIGNIFICANCE, line_powers, lines_from_powers
from nlfrf.signals.lines import LineGrid, detection_lines

_EVEN, _MIN_UNEVEN = 0.5, 1.0  # dB: standard deviation of lines of one level at most, and of others at least
_MIN_SPREAD_RATIO = 6.0  # of others to that of lines of one level
_MAX_DIRT_RATIO = 0.1  # of what stands between the lines of the other signal: of one that was played
_EMPTY, _FULL = 1e-6, 0.5  # of the power of the lines beside it: a detection line without power, and one like any other
_MIN_LINES = 6  # below which lines are even, or those between them empty, by chance
_MIN_ODD_LINES = 12  # lines that are odd by chance in one of 4096 signals


class SignalLines(NamedTuple):
    """The lines of a periodic signal, found in itself.

    Fields: (K,) power of the lines 1 to K, and its variance by noise; the grid; standard deviation of the excited lines
    [dB]; share of the power inside the band that is in no excited line; whether its periods are equal.
    """

    power: np.ndarray
    noise: np.ndarray
    grid: LineGrid
    spread: float
    dirt: float
    is_exact: bool

    def emptiness(self, excited: np.ndarray) -> float:
        """Return how large the detection lines of a grid are over the lines beside them, in the median; nan of few."""
        detection = detection_lines(excited) if excited.size else excited
        if detection.size < _MIN_LINES:
            return np.nan
        level = np.log(np.maximum(self.power[excited - 1], 1e-300))
        return float(np.median(self.power[detection - 1] / np.exp(np.interp(detection, excited, level))))

    @property
    def is_clean(self) -> bool:
        """Whether nothing speaks against it as what was played: its lines are of one level, and those between empty."""
        return bool(self.spread < _MIN_UNEVEN and not self.emptiness(self.grid.excited) > _EMPTY)

    @property
    def is_one_period(self) -> bool:
        """Whether it is one period of an odd multisine: lines enough, all of them odd, and with no common divisor."""
        excited = self.grid.excited
        odd = excited.size >= _MIN_ODD_LINES and np.all(excited % 2) and np.gcd.reduce(excited) == 1
        return bool(odd and self.emptiness(excited) < _MAX_DIRT_RATIO)


def find_signal_lines(periods: np.ndarray) -> SignalLines | None:
    """Return the lines of a signal (1, P, N); of few ones the spread and what is between them are infinite.

    None where no line stands out of its noise.
    """
    try:
        power, noise = line_powers(periods)
        grid = lines_from_powers(power, noise)
    except ValueError:
        return None
    is_exact = periods.shape[1] > 1 and has_equal_periods(periods)
    steps = np.abs(np.diff(periods[0, -1]))
    quantum = float(steps.min(initial=np.inf, where=steps > 0))  # what is rounded repeats, and is noise all the same
    noise = noise + quantum**2 * periods.shape[-1] / 12
    excited = grid.excited - 1
    if excited.size < _MIN_LINES:
        return SignalLines(power, noise, grid, np.inf, np.inf, is_exact)
    spread = float(np.std(10 * np.log10(np.maximum(power[excited], 1e-300))))
    dirt = float(1 - power[excited].sum() / power[: excited[-1] + 1].sum())
    return SignalLines(power, noise, grid, spread, dirt, is_exact)


def compare_detection_lines(played: SignalLines, other: SignalLines) -> str:
    """Return how much emptier the detection lines of one signal are than those of another; an empty text if not.

    Those of the other have to stand out of its noise: a sensor with more noise is no machine.
    """
    excited = played.grid.excited
    excited = excited[excited <= other.grid.excited[-1]]  # the band that both show
    if played.power.size != other.power.size:
        return ""
    clean, full = played.emptiness(excited), other.emptiness(excited)
    if not (_EMPTY < full < _FULL and clean < _MAX_DIRT_RATIO * full):
        return ""
    detection = detection_lines(excited) - 1
    if other.power[detection].mean() <= SIGNIFICANCE * other.noise[detection].mean():
        return ""
    return (
        f"{-10 * np.log10(max(clean, 1e-30)):.0f} dB under the lines beside them against {-10 * np.log10(full):.0f} dB"
    )


def compare_levels(played: SignalLines, other: SignalLines) -> bool:
    """Return whether the lines of one signal are of one level and those of the other are not."""
    return played.spread < _EVEN and other.spread > max(_MIN_UNEVEN, _MIN_SPREAD_RATIO * played.spread)


def describe_played(played: SignalLines | None, other: SignalLines | None) -> str:
    """Return what shows that a signal was played that counts as an output, and not the other; an empty text if nothing.

    Even lines do so where they are clean as well: a machine may undo the shape that a multisine was given.
    """
    if played is None:
        return ""
    if other is None or (compare_levels(played, other) and played.dirt < _MAX_DIRT_RATIO * other.dirt):
        return f"its lines are even to {played.spread:.2g} dB" if played.spread < _EVEN else ""
    return f"its detection lines are empty, {found}" if (found := compare_detection_lines(played, other)) else ""
