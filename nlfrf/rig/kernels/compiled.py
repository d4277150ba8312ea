"""The compiler of the integrators, an extra that every simulation needs."""

from nlfrf._base.extras import import_extra

njit = import_extra("numba", "rig", "the simulated bench").njit
