"""What the compiled code reads and writes: plain tuples of numbers and arrays, made without loading numba.

The cache of compiled code on disk is renewed when `kernels.py` changes and does not look here: change the
fields of these tuples and `kernels.py` together.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

# Kinds of hysteresis: a spring that needs no memory, virgin curves with a stack of turning points, elements
SPRING, LINEAR, TANH, EXPONENTIAL, PARABOLA, ELASTIC_PLASTIC, TABLE, ELEMENTS = range(8)

# Forms of the state equation dz/dt
LEUVEN, ORIGINAL, DAHL = range(3)

# Places in Memory.state
X, V, Z, F, DIRECTION, DEPTH, DEEPEST, LOST, RATE = range(9)
N_STATES = 9

#: Turning points remembered before the innermost loop is forgotten.
STACK_DEPTH = 256


class Curve(NamedTuple):
    """A virgin curve, or the elements that stand for one."""

    kind: int
    K0: float
    Fy: float
    table: np.ndarray  # (3, n): z, force, slope that follows
    elements: np.ndarray  # (2, E): stiffness, strength


class Law(NamedTuple):
    """A friction law."""

    form: int
    Fs: float
    Fc: float
    vs: float
    delta: float
    sigma1: float
    sigma2: float
    n: float
    curve: Curve


class Body(NamedTuple):
    """What carries the friction: a mass on a spring, or a motion that is prescribed."""

    driven: bool
    mass: float
    stiffness: float
    damping: float


class Memory(NamedTuple):
    """What is carried from one step to the next."""

    state: np.ndarray  # (N_STATES,)
    stack: np.ndarray  # (2, STACK_DEPTH): z and force of the turning points
    slip: np.ndarray  # (2, E): force and slip direction of the elements


def at_rest(curve: Curve) -> Memory:
    """The memory of a body that has never moved."""
    return Memory(
        state=np.zeros(N_STATES), stack=np.zeros((2, STACK_DEPTH)), slip=np.zeros((2, curve.elements.shape[1]))
    )
