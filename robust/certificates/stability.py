"""Stable or not: floating point says so far from the boundary, exact arithmetic beside it."""

from __future__ import annotations

import control
import numpy as np

from robust.systems.lti import timebase
from robust.systems.norms import EPS
from robust.systems.stability import apparent_instability, certain_poles
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


def instability(system: control.StateSpace) -> str:
    """Empty where every pole of the system, its matrix taken as it is, is strictly stable; else what is wrong.

    >>> on_the_axis = control.ss([[0.0, 1.0], [-1.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]])
    >>> instability(on_the_axis).split(",")[1]
    ' on the stability boundary or beyond it'
    """
    said = apparent_instability(system)
    if not system.nstates or system.nstates > LARGEST_EXACT or not beside_boundary(system):
        return said
    found = stable_matrix(system.A, discrete=bool(timebase(system)))
    if found.holds or found.unclear:
        return "" if found.holds else said
    if said.startswith("unstable"):
        return said
    poles = certain_poles(system)[0]
    worst = poles[int(np.argmax(np.abs(poles) if timebase(system) else poles.real))]
    return f"unstable: a pole at {worst:.4g}, on the stability boundary or beyond it"
