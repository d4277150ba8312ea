"""Common look of the pictures: a colour and a marker for each kind of line; curves of rounding
errors are not drawn.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nlfrf._base.axes import add_note, to_decibel

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# one colour per kind of line in every picture, distinct also for colour-blind readers
COLOR = {
    "excited": "#000000",
    "odd": "#D55E00",
    "even": "#0072B2",
    "noise": "#999999",
    "bound": "#009E73",
}
COLOR_CYCLE = (
    "#000000",
    "#D55E00",
    "#0072B2",
    "#009E73",
    "#CC79A7",
    "#E69F00",
)  # one per input or direction
MARKER = {"excited": ".", "odd": "x", "even": "+"}  # also for pictures in grey
ROUNDING_DB = 120.0  # dB under the input; lower values are rounding
OVER_100 = "bound over 100 %: G may be 0"  # for a band without a lower edge
_MAX_DEPTH_DB = 160.0  # dB under the output or the FRF; lower values are not shown


def crop_rounding(ax: Axes, amplitude: np.ndarray) -> Axes:
    """Crop the axis above rounding, far under the largest amplitude, and note the curves that fall
    below.
    """
    bottom = float(to_decibel(amplitude.max())) - _MAX_DEPTH_DB
    if ax.get_ylim()[0] < bottom:
        ax.set_ylim(bottom=bottom)
        unseen = [
            line
            for line in ax.get_lines()
            if np.all(np.nan_to_num(line.get_ydata(), nan=-np.inf) < bottom)
        ]
        if unseen:
            add_note(
                ax,
                f"{'; '.join(str(line.get_label()) for line in unseen)}: more than"
                f" {_MAX_DEPTH_DB:g} dB lower",
            )
        for line in unseen:
            line.set_label(None)
    return ax
