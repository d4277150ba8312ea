"""How every picture of this package looks: a colour and a marker a kind of line, what lies at rounding left out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nlfrf._base.axes import add_note, to_decibel

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# one colour a kind of line in every picture, distinct for colour-blind readers too
COLOR = {"excited": "#000000", "odd": "#D55E00", "even": "#0072B2", "noise": "#999999", "bound": "#009E73"}
COLOR_CYCLE = ("#000000", "#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00")  # of several inputs, or directions
MARKER = {"excited": ".", "odd": "x", "even": "+"}  # and in grey
ROUNDING_DB = 120.0  # dB under the input; what lies lower is of no interest
OVER_100 = "bound over 100 %: G may be 0"  # of a band without a lower edge
_MAX_DEPTH_DB = 160.0  # dB under the output, or the FRF; the same


def crop_rounding(ax: Axes, amplitude: np.ndarray) -> Axes:
    """Crop the axis above rounding, far under the largest amplitude, and note the curves that fall below."""
    bottom = float(to_decibel(amplitude.max())) - _MAX_DEPTH_DB
    if ax.get_ylim()[0] < bottom:
        ax.set_ylim(bottom=bottom)
        unseen = [line for line in ax.get_lines() if np.all(np.nan_to_num(line.get_ydata(), nan=-np.inf) < bottom)]
        if unseen:
            add_note(ax, f"{'; '.join(str(line.get_label()) for line in unseen)}: more than {_MAX_DEPTH_DB:g} dB lower")
        for line in unseen:
            line.set_label(None)
    return ax
