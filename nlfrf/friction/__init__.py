"""Friction laws, and the compiled code that steps a mass through them; no rig, no records.

    laws            Coulomb, Dahl, LuGre, Leuven, generalised Maxwell slip
    varying         Maxwell slip whose sliders vary: with speed, rest, position, direction, at random
    own             a law of the user's own: state, derivative, force
    own_kernels     steps of such a law, compiled where it can be
    curves          virgin curves: the force on the way out from rest
    hysteresis      the force along a path, with all its memory (Masing, Madelung)
    integration     from a law to the compiled code that steps it
    kernel_data     the numbers that compiled code reads and writes
    leuven_kernels  compiled steps of the Leuven, LuGre and Dahl laws
    slip_kernels    compiled steps of Coulomb friction and of Maxwell slip
    slider_kernels  compiled steps of sliders that vary
    loop_kernels    compiled sampled loops around all of them

The laws are handed on from here: `from nlfrf.friction import LuGre`.
"""

from nlfrf.friction.laws import Coulomb, Dahl, GeneralizedMaxwellSlip, Leuven, LuGre, stribeck
from nlfrf.friction.own import OwnFriction
from nlfrf.friction.varying import VaryingSliders

__all__ = [
    "Coulomb",
    "Dahl",
    "GeneralizedMaxwellSlip",
    "Leuven",
    "LuGre",
    "OwnFriction",
    "VaryingSliders",
    "stribeck",
]
