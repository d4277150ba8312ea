"""Arguments of compiled code: tuples of numbers, and arrays, made without loading numba.

The cache of compiled code on disk is renewed when a file of kernels changes, and does not check
this file: change these tuples and the kernels together.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

# Kinds of hysteresis: a spring without memory, virgin curves with a stack of turning points (smooth
# ones first), elements
SPRING, TANH, EXPONENTIAL, PARABOLA, ELASTIC_PLASTIC, TABLE, ELEMENTS, VARYING = range(8)
# Laws: two forms of the state equation dz/dt, three that switch between sticking and slipping, user
# functions
LEUVEN, DAHL, COULOMB, GMS, SLIDERS, OWN = range(6)
# Indices into Memory.state
X, V, Z, F, DIRECTION, DEPTH, LOST, ERROR = range(8)
N_STATES = 8
#: Growth of an error of z, to first order, up to which sliding counts as stable. Beyond first order
#: the hysteresis bounds the error: below this limit the position was never wrong by 1e-3, well
#: above it by 1e-2 and more.
MAX_ERROR_GROWTH = 1e30
#: Number of turning points in memory; beyond it the innermost loop is forgotten.
STACK_DEPTH = 256


class Curve(NamedTuple):
    """The numbers of a virgin curve."""

    kind: int
    K0: float
    Fy: float


class Law(NamedTuple):
    """The numbers of a friction law."""

    form: int
    Fs: float
    Fc: float
    vs: float
    delta: float
    sigma1: float
    sigma2: float
    n: float  # exponent; for the generalised Maxwell-slip model the attraction C
    curve: Curve


class Body(NamedTuple):
    """The body that the friction acts on: a mass on a spring, or a prescribed motion."""

    driven: bool
    mass: float
    stiffness: float
    damping: float


class Step(NamedTuple):
    """Start of a step, or of its remaining part: position, velocity; drive over the whole step; its
    length.
    """

    x: float
    v: float
    u: tuple[float, float, float]
    h: float


class Memory(NamedTuple):
    """The state from one step to the next."""

    state: np.ndarray  # (N_STATES,)
    stack: (
        np.ndarray
    )  # (2, STACK_DEPTH): z and force of the turning points; (2 or 4, E) for elements


class Axes(NamedTuple):
    """Coupled masses, one axis each, with their friction laws, and work space."""

    # (4 or 5, axes, axes): mass, its inverse, stiffness, damping, cubic springs
    machine: np.ndarray
    laws: np.ndarray  # (axes, 11): numbers of each law, -1 first for none
    grids: np.ndarray  # (axes, 3 or 7, n): `Grid` of each
    states: np.ndarray  # (axes, N_STATES)
    stacks: np.ndarray  # (axes, 2 or 4, n): `Memory.stack` of each
    work: np.ndarray


#: (3, n) points of a virgin curve: z, force, slope behind it; or (3, E) elements: stiffness,
#: strength, 0; (7, E) varying elements.
Grid = np.ndarray


def initial_memory(curve: Curve, grid: Grid) -> Memory:
    """Return the memory of a body at rest."""
    sizes = {ELEMENTS: (2, grid.shape[1]), VARYING: (4, grid.shape[1])}
    return Memory(np.zeros(N_STATES), np.zeros(sizes.get(curve.kind, (2, STACK_DEPTH))))
