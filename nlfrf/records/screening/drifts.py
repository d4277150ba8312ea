"""Drifts over the periods of a record: the gain from u to y, evenly or in a step, and the operating
point.
"""

from __future__ import annotations

import numpy as np

_MIN_GAIN_DRIFT = 0.02  # smallest change of gain over the record that is reported
NEGLIGIBLE = 1e-6  # differences of periods, over the rms, that are ignored
_MIN_OFFSET_DRIFT = (
    0.15  # smallest reported change of the operating point over the record, in rms of the output
)
# periods that separate a drift from a transient; share that fewer periods must explain
FEW = 4
ALONE = 0.9
_CLEAR_SHARE = 0.3  # largest remainder of a clear change, as a fraction of it
_DRIFT_CURE = "let the machine settle, or cut the record into shorter ones (n_discard)"


def describe_gain_drift(at: np.ndarray, gain: np.ndarray, *, noise: float, explained: float) -> str:
    """Describe a drift or step of the gain of the periods `at`, with its numbers; empty if there is
    neither.

    `explained` is the explained share of the nonrepeating power. If it is small, a first period
    alone may be in transient, and among few periods each may be such a first one.
    """
    if at.size < 2 or (at.size < FEW and explained < ALONE):
        return ""
    slope, bend = fit_line(at, gain)
    drift = slope * float(np.ptp(at))
    place, step, rest = _find_step(gain)
    least = max(_MIN_GAIN_DRIFT, noise)
    # two periods fit a step and a line alike
    if rest < bend or at.size < 3:
        if (
            abs(step) > least
            and rest < _CLEAR_SHARE * abs(step)
            and (place > 1 or explained > ALONE)
        ):
            return (
                f"the gain from u to y steps by {100 * step:+.2g} % before period"
                f" {at[place] + 1}, and G is an average of both gains; {_DRIFT_CURE}"
            )
        if place == 1:  # the first period alone: a transient, and no drift of the others
            return ""
    if at.size >= FEW and abs(drift) > least and bend < _CLEAR_SHARE * abs(drift):
        return (
            f"the gain from u to y drifts by {100 * drift:+.2g} % over the record, and G is an"
            f" average over the record; {_DRIFT_CURE}"
        )
    return ""


def describe_offset_drift(offset: np.ndarray) -> str:
    """Describe a wandering operating point of the periods; empty if it does not wander."""
    change = float(np.ptp(offset))
    if change <= _MIN_OFFSET_DRIFT:
        return ""
    return (
        f"the operating point of y drifts by {100 * change:.2g} % of its rms over the record,"
        " and G is an average over these points. Hold the operating point by a slow loop, or"
        " cut the record into shorter ones (n_discard)"
    )


def fit_line(at: np.ndarray, x: np.ndarray) -> tuple[float, float]:
    """Return the slope of the straight line through x and the largest departure from it."""
    fit = np.polyfit(at, x, 1)
    return float(fit[0]), float(np.abs(x - np.polyval(fit, at)).max())


def _find_step(x: np.ndarray) -> tuple[int, float, float]:
    """Return place and relative size of the step of x (n,), and the largest departure from a
    step.
    """
    first, last = (
        np.maximum.accumulate(part) - np.minimum.accumulate(part) for part in (x, x[::-1])
    )
    rest = np.maximum(first[:-1], last[-2::-1]) / 2
    k = int(np.argmin(rest))
    before, after = float(np.mean(x[: k + 1])), float(np.mean(x[k + 1 :]))
    return k + 1, after / before - 1 if before else 0.0, float(rest[k])
