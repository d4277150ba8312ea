"""The compiler of the integrators (numba), an optional package that every simulation needs."""

from nlfrf._base.extras import import_extra

njit = import_extra("numba", "rig", "the simulated bench").njit
