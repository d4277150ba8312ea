"""Colours, line styles, axis limits, and the white background of the measured band."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, TypeVar

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BAND_MARGIN = np.sqrt(10.0)  # half a decade is shown on both sides of the band
OVER_NOTE = "over 100 %: the set holds 0"  # for a band without a lower edge
_AXIS_MARGIN = 1.3  # around an event further out


def mark_band(
    ax: Axes, band: tuple[float, float], *, happens: Iterable[float] = (), top: float = np.inf
) -> None:
    """Frame a picture around the measured band [Hz], with the frequencies outside it in grey.

    Half a decade is shown beside it; more for the frequencies in `happens` (nan is ignored), never
    beyond `top`.
    """
    low, high = band
    start, end = low / BAND_MARGIN, high * BAND_MARGIN
    for f in happens:
        if np.isfinite(f) and f > 0:
            start, end = min(start, f / _AXIS_MARGIN), max(end, f * _AXIS_MARGIN)
    end = max(min(end, top), high)
    ax.set_xlim(start, end)
    outside = [
        (one, other) for one, other in ((start, low), (high, end)) if other > one * (1 + 1e-9)
    ]
    for k, (one, other) in enumerate(outside):
        label = None if k else "not measured"
        ax.axvspan(
            one, other, color="0.85", alpha=0.5, lw=0, zorder=0, gid="not measured", label=label
        )


def fit_vertical_axis(ax: Axes, most: float = 80.0) -> None:
    """Fit the vertical axis to the visible curves, at most `most` decibels from the top."""
    start, end = ax.get_xlim()
    seen = []
    for line in ax.get_lines():
        x, y = np.asarray(line.get_xdata(), dtype=float), np.asarray(line.get_ydata(), dtype=float)
        if x.size > 2:
            seen.append(y[(x >= start) & (x <= end) & np.isfinite(y)])
    if seen:
        values = np.concatenate(seen)
    else:
        values = np.zeros(0)
    if values.size and np.ptp(values) > 0:
        high = values.max()
        low = max(values.min(), high - most)
        ax.set_ylim(low - 0.06 * (high - low), high + 0.06 * (high - low))


# ---- Colours and units that the pictures of this package share.

# also distinguishable for colour-blind readers; the parts of the radius as in the pictures of nlfrf
COLOR = {
    "noise": "#999999",
    "odd": "#D55E00",
    "even": "#0072B2",
    "misfit": "#CC79A7",
    "level": "#E69F00",
    "systematic": "#F0E442",
    "radius": "#000000",
    "weight": "#009E73",
    "loop": "#0072B2",
    "limit": "#D55E00",
}
#: The parts of the radius in words.
PART = {
    "noise": "noise",
    "odd": "odd distortion",
    "even": "even distortion",
    "misfit": "misfit of the model",
    "level": "change with the level",
    "systematic": "allowance for the systematic part",
}
#: Colours of several records, in their order.
MEASURED = (COLOR["loop"], COLOR["limit"], COLOR["level"], COLOR["misfit"])
#: The parts of the radius on paper without colour.
STYLE = {
    "noise": ":",
    "odd": "-",
    "even": "-.",
    "misfit": "--",
    "level": (0, (6, 1, 1, 1, 1, 1)),
    "systematic": (0, (1, 3)),
}


#: A number, or an array of them.
Numbers = TypeVar("Numbers", float, np.ndarray)


def to_hertz(omega: Numbers) -> Numbers:
    """Convert rad/s to Hz."""
    return omega / (2 * np.pi)
