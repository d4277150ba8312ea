"""What `robust.tune` takes and returns: blocks, limits, plants.

The public names of `robust.synthesis.tuning`, in one place.
"""

from robust.synthesis.tuning.blocks import Filter2, Gain, Lead, Notch, Pid, StateSpace
from robust.synthesis.tuning.design import Ended, Known, LimitValue, TunedDesign
from robust.synthesis.tuning.friction import FrictionLimit
from robust.synthesis.tuning.limits import Limit
from robust.synthesis.tuning.plants import Plants

__all__ = [
    "Ended",
    "Filter2",
    "FrictionLimit",
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
