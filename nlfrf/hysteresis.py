"""Hysteresis with non-local memory: virgin curves, and the force they give along a path.

The public names of `nlfrf.friction.curves` and `nlfrf.friction.hysteresis`, in one place.
"""

from nlfrf.friction.curves import ElasticPlastic, Exponential, Linear, MaxwellSlip, Parabola, Table, Tanh
from nlfrf.friction.hysteresis import fit_maxwell_slip, hysteresis_force

__all__ = [
    "ElasticPlastic",
    "Exponential",
    "Linear",
    "MaxwellSlip",
    "Parabola",
    "Table",
    "Tanh",
    "fit_maxwell_slip",
    "hysteresis_force",
]
