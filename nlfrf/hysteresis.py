"""Hysteresis of friction before it slides: virgin curves (force on the way out from rest), and the
force along any path.

This module collects the public names of `nlfrf.rig.laws.curves` and `nlfrf.rig.laws.hysteresis`.
"""

from nlfrf.rig.laws.curves import (
    ElasticPlastic,
    Exponential,
    Linear,
    MaxwellSlip,
    Parabola,
    Table,
    Tanh,
)
from nlfrf.rig.laws.hysteresis import hysteresis_force

__all__ = [
    "ElasticPlastic",
    "Exponential",
    "Linear",
    "MaxwellSlip",
    "Parabola",
    "Table",
    "Tanh",
    "hysteresis_force",
]
