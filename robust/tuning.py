"""The blocks, limits and plants of `robust.tune`, and its result.

The names are defined in `robust.synthesis` (blocks) and `robust.synthesis.tuning`.
"""

from robust.synthesis.filters import Biquad, Lag, Lead, LowPass, Notch
from robust.synthesis.matrix_blocks import Gain, StateSpace
from robust.synthesis.pid import Pid
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
