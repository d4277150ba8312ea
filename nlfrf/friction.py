"""Friction laws: Coulomb, Dahl, LuGre, Leuven, generalised Maxwell slip, varying sliders, a law of the user's own.

The public names of `nlfrf.rig.laws`, in one place.
"""

from nlfrf.rig.laws.laws import (
    Coulomb,
    Dahl,
    GeneralizedMaxwellSlip,
    Leuven,
    LuGre,
    OwnFriction,
    VaryingSliders,
    element_forces,
    load_forces,
)

__all__ = [
    "Coulomb",
    "Dahl",
    "GeneralizedMaxwellSlip",
    "Leuven",
    "LuGre",
    "OwnFriction",
    "VaryingSliders",
    "element_forces",
    "load_forces",
]
