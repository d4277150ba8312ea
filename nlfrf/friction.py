"""Friction laws: Coulomb, Dahl, LuGre, Leuven, generalised Maxwell slip, varying sliders, a law of
the user.

This module collects the public names of `nlfrf.rig.laws`.
"""

from nlfrf.rig.laws.laws import (
    Coulomb,
    Dahl,
    GeneralizedMaxwellSlip,
    Leuven,
    LuGre,
)
from nlfrf.rig.laws.own import OwnFriction
from nlfrf.rig.laws.sliders import VaryingSliders, element_forces, load_forces

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
