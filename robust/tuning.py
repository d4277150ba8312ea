"""The blocks, limits and plants of `robust.tune`, and its result.

The names are defined in `robust.synthesis.blocks` and `robust.synthesis.tuning`.
"""

from robust.synthesis.blocks import Biquad, Gain, Lag, Lead, LowPass, Notch, Pid, StateSpace
from robust.synthesis.tuning.design import Ended, TunedDesign
from robust.synthesis.tuning.friction import FrictionLimit
from robust.synthesis.tuning.limits import Limit
from robust.synthesis.tuning.plants import Plants

__all__ = [
    "Biquad",
    "Ended",
    "FrictionLimit",
    "Gain",
    "Lag",
    "Lead",
    "Limit",
    "LowPass",
    "Notch",
    "Pid",
    "Plants",
    "StateSpace",
    "TunedDesign",
]
