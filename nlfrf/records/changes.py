"""What changes over the periods of a record: the gain from u to y, evenly or at once, and the operating point."""

from __future__ import annotations

import numpy as np

__all__ = ["ALONE", "FEW", "gain_told", "line", "point_told"]


DRIFT = 0.02  # change of gain over the record that is named
WANDER = 0.15  # change of the operating point over the record that is named, in rms of the output
FEW, ALONE = 4, 0.9  # periods from which a drift is told from a transient; of fewer it has to explain so much
CLEAR = 0.3  # of a change that what is left may be apart from it
CURE = "let it settle, or cut the record into shorter ones (n_discard)"


def gain_told(at: np.ndarray, gain: np.ndarray, noise: float, explained: float) -> str:
    """How the gain of the periods `at` drifts or steps, with its numbers; empty where it does neither.

    `explained` is what share of all that does not repeat it explains: of little, a first period alone may still ring,
    and of few periods each is a first one.
    """
    if at.size < 2 or (at.size < FEW and explained < ALONE):
        return ""
    slope, bend = line(at, gain)
    drift = slope * float(np.ptp(at))
    place, step, rest = step_in(gain)
    least = max(DRIFT, noise)
    if rest < bend or at.size < 3:
        if abs(step) > least and rest < CLEAR * abs(step) and (place > 1 or explained > ALONE):
            where = f"before period {at[place] + 1}"
            return f"the gain from u to y steps by {100 * step:+.2g} % {where}: G is that of neither side; {CURE}"
        if place == 1:
            return ""
    if at.size >= FEW and abs(drift) > least and bend < CLEAR * abs(drift):
        said = f"the gain from u to y drifts by {100 * drift:+.2g} % over the record: G is that of no moment of it"
        return f"{said}; {CURE}"
    return ""


def point_told(offset: np.ndarray) -> str:
    """How far the operating point of the periods wanders; empty where it does not."""
    change = float(np.ptp(offset))
    if change <= WANDER:
        return ""
    return (
        f"the operating point of y wanders by {100 * change:.2g} % of its rms over the record: G is that of "
        "all these points; hold it by a slow loop, or cut the record into shorter ones (n_discard)"
    )


def line(at: np.ndarray, x: np.ndarray) -> tuple[float, float]:
    """Slope of the straight line through x, and the largest departure from it."""
    fit = np.polyfit(at, x, 1)
    return float(fit[0]), float(np.abs(x - np.polyval(fit, at)).max())


def step_in(x: np.ndarray) -> tuple[int, float, float]:
    """Where x (n,) steps, by what share of what it was, and the largest departure from that."""
    first, last = (np.maximum.accumulate(part) - np.minimum.accumulate(part) for part in (x, x[::-1]))
    rest = np.maximum(first[:-1], last[-2::-1]) / 2
    k = int(np.argmin(rest))
    before, after = float(np.mean(x[: k + 1])), float(np.mean(x[k + 1 :]))
    return k + 1, after / before - 1 if before else 0.0, float(rest[k])
