"""Colours and units that the pictures of this package share."""

from __future__ import annotations

from typing import Any

import numpy as np

__all__ = ["COLOR", "MEASURED", "STYLE", "hz"]


# told apart by colour-blind readers too; the parts of the radius as in the pictures of nlfrf
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
#: Of several records, one after the other.
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


def hz(omega: Any) -> Any:
    """rad/s to Hz."""
    return omega / (2 * np.pi)
