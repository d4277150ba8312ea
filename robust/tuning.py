"""What `robust.tune` takes and returns: blocks, limits, plants.

The public names of `robust.synthesis.tune`, in one place.
"""

from robust.synthesis.tune.blocks import Filter2, Gain, Lead, Notch, Pid, StateSpace
from robust.synthesis.tune.design import Ended, Known, LimitValue, TunedDesign
from robust.synthesis.tune.limits import Limit
from robust.synthesis.tune.plants import Plants

__all__ = [
    "Ended",
    "Filter2",
    "Gain",
    "Known",
    "Lead",
    "Limit",
    "LimitValue",
    "Notch",
    "Pid",
    "Plants",
    "StateSpace",
    "TunedDesign",
]
