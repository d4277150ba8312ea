"""Hysteresis with non-local memory: virgin curves, and the force they give along a path.

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
