"""Stable or not: floating point says so far from the boundary, exact arithmetic beside it."""

from __future__ import annotations

import control
import numpy as np

from robust.shared.states import Stability
from robust.systems.lti import timebase
from robust.systems.norms import EPS
from robust.systems.stability import StabilityResult, apparent_instability, certain_poles
from robust.verification.poles import stable_matrix

__all__ = ["LARGEST_EXACT", "beside_boundary", "instability"]


BESIDE = 1e6  # times what rounding moves a pole by
LARGEST_EXACT = 60  # states: seconds beyond


def beside_boundary(system: control.StateSpace, found: tuple[np.ndarray, np.ndarray] | None = None) -> bool:
    """Whether a pole lies so near the stability boundary that rounding may matter, by a wide margin.

    `found` are its `certain_poles`, where they are known.
    """
    poles, moved = certain_poles(system) if found is None else found
    excess = np.abs(poles) - 1 if timebase(system) else poles.real
    rounding = np.maximum(moved, EPS * np.linalg.norm(system.A))  # putting the system together rounds too
    return bool(np.any(np.abs(excess) <= BESIDE * rounding))


def instability(system: control.StateSpace) -> StabilityResult:
    """Whether every pole of the system, its matrix taken as it is, is strictly stable.

    >>> on_the_axis = control.ss([[0.0, 1.0], [-1.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]])
    >>> found = instability(on_the_axis)
    >>> found.state, found.at_boundary
    ('unstable', True)
    """
    apparent = apparent_instability(system)
    if not system.nstates or system.nstates > LARGEST_EXACT or not beside_boundary(system):
        return apparent
    exact = stable_matrix(system.A, discrete=bool(timebase(system)))
    if exact.holds:
        return StabilityResult(state=Stability.STABLE)
    if not exact.violated or apparent.unstable:
        return apparent
    poles = certain_poles(system)[0]
    worst = poles[int(np.argmax(np.abs(poles) if timebase(system) else poles.real))]
    return StabilityResult(state=Stability.UNSTABLE, pole=complex(worst), at_boundary=True)
