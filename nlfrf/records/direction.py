"""Find which of two signals was played and which is the response, from their lines.

A machine adds distortion, noise and transients on lines without excitation. So if one of two
periodic signals has no power on these lines and the other has, the first was played. If this does
not decide, the signal whose excited lines have equal amplitudes was played: the resonances of a
machine make the amplitudes of a response differ.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from nlfrf._base.numbers import has_equal_periods
from nlfrf.records.excited_lines import SIGNIFICANCE, line_powers, lines_from_powers
from nlfrf.signals.lines import LineGrid, detection_lines

# [dB] largest standard deviation of lines of one level; smallest one of other lines
_EVEN = 0.5
_MIN_UNEVEN = 1.0
# smallest ratio of the standard deviation of other lines to that of lines of one level
_MIN_SPREAD_RATIO = 6.0
# largest power between the lines of a played signal, over that of the other signal
_MAX_DIRT_RATIO = 0.1
# power over that of the neighbouring lines: of an empty detection line, of a usual line
_EMPTY = 1e-6
_FULL = 0.5
_MIN_LINES = 6  # fewer lines are of one level, or empty between them, by chance
_MIN_ODD_LINES = 12  # all lines are odd by chance in one of 4096 signals


class SignalLines(NamedTuple):
    """The lines of a periodic signal, found in the signal itself.

    Fields: (K,) power of the lines 1 to K; its variance by noise; the grid; standard deviation of
    the excited lines [dB]; share of the in-band power that lies outside the excited lines; whether
    its periods are equal.
    """

    power: np.ndarray
    noise: np.ndarray
    grid: LineGrid
    spread: float
    dirt: float
    is_exact: bool

    def emptiness(self, excited: np.ndarray) -> float:
        """Return the median power of the detection lines over that of their neighbours; nan for few
        detection lines.
        """
        if excited.size:
            detection = detection_lines(excited)
        else:
            detection = excited
        if detection.size < _MIN_LINES:
            return np.nan
        level = np.log(np.maximum(self.power[excited - 1], 1e-300))
        return float(
            np.median(self.power[detection - 1] / np.exp(np.interp(detection, excited, level)))
        )

    @property
    def is_clean(self) -> bool:
        """True if the signal may have been played: its lines have one level, and its detection
        lines are empty.
        """
        return bool(self.spread < _MIN_UNEVEN and not self.emptiness(self.grid.excited) > _EMPTY)

    @property
    def is_one_period(self) -> bool:
        """True if the signal is one period of an odd multisine: enough lines, all odd, without a
        common divisor.
        """
        excited = self.grid.excited
        odd = excited.size >= _MIN_ODD_LINES and np.all(excited % 2) and np.gcd.reduce(excited) == 1
        return bool(odd and self.emptiness(excited) < _MAX_DIRT_RATIO)


def find_signal_lines(periods: np.ndarray) -> SignalLines | None:
    """Return the lines of a signal (1, P, N); None if no line stands out of its noise.

    For fewer than six lines `spread` and `dirt` are infinite.
    """
    try:
        power, noise = line_powers(periods)
        grid = lines_from_powers(power, noise)
    except ValueError:
        return None
    is_exact = periods.shape[1] > 1 and has_equal_periods(periods)
    steps = np.abs(np.diff(periods[0, -1]))
    quantum = float(
        steps.min(initial=np.inf, where=steps > 0)
    )  # rounding errors repeat, and count as noise here
    noise = noise + quantum**2 * periods.shape[-1] / 12
    excited = grid.excited - 1
    if excited.size < _MIN_LINES:
        return SignalLines(power, noise, grid, np.inf, np.inf, is_exact)
    spread = float(np.std(10 * np.log10(np.maximum(power[excited], 1e-300))))
    dirt = float(1 - power[excited].sum() / power[: excited[-1] + 1].sum())
    return SignalLines(power, noise, grid, spread, dirt, is_exact)


def compare_detection_lines(played: SignalLines, other: SignalLines) -> str:
    """Describe by how much the detection lines of one signal are emptier than those of another;
    empty text if not.

    The detection lines of the other signal must stand out of its noise: a noisy sensor is no
    machine.
    """
    excited = played.grid.excited
    excited = excited[excited <= other.grid.excited[-1]]  # the common band
    if played.power.size != other.power.size:
        return ""
    clean, full = played.emptiness(excited), other.emptiness(excited)
    if not (_EMPTY < full < _FULL and clean < _MAX_DIRT_RATIO * full):
        return ""
    detection = detection_lines(excited) - 1
    if other.power[detection].mean() <= SIGNIFICANCE * other.noise[detection].mean():
        return ""
    return (
        f"{-10 * np.log10(max(clean, 1e-30)):.0f} dB below the lines beside them, those of the"
        f" other channel {-10 * np.log10(full):.0f} dB"
    )


def compare_levels(played: SignalLines, other: SignalLines) -> bool:
    """Return whether the lines of one signal have one level and those of the other do not."""
    return played.spread < _EVEN and other.spread > max(
        _MIN_UNEVEN, _MIN_SPREAD_RATIO * played.spread
    )


def describe_played(played: SignalLines | None, other: SignalLines | None) -> str:
    """Describe the evidence that a supposed output was played and the other signal was not; empty
    text if none.

    Lines of one level are evidence only if the detection lines are empty, too: a machine may undo
    the spectral shape of a multisine.
    """
    if played is None:
        return ""
    if other is None or (
        compare_levels(played, other) and played.dirt < _MAX_DIRT_RATIO * other.dirt
    ):
        if played.spread < _EVEN:
            return f"its lines have equal amplitudes within {played.spread:.2g} dB"
        return ""
    if found := compare_detection_lines(played, other):
        return f"its detection lines are empty, {found}"
    return ""
