"""The compiler of the integrators, which is an extra: without it there is no simulation."""

from nlfrf._base.extras import import_extra

njit = import_extra("numba", "rig", "the simulated bench").njit
