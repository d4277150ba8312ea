"""Responses in doubles: from the matrices where rounding hardly moves a mode, from exact roots where it may."""

from __future__ import annotations

from collections.abc import Callable

import control
import numpy as np

from robust.systems.lti import beside_one, responder, timebase
from robust.systems.stability import certain_poles
from robust.verification.claim import as_given
from robust.verification.roots import roots_of

__all__ = ["in_doubt", "trusted_responder"]


MOVED = 0.1  # of its distance to the axis, by which rounding may move a pole unnoticed
UNDAMPED = 1e-8  # of its modulus: what counts as the distance of a pole on the axis
LARGEST = 40  # states of which exact roots are taken


def in_doubt(poles: np.ndarray, moved: np.ndarray, discrete: bool) -> bool:
    """Whether rounding may have moved a pole by about as much as it is damped."""
    damping = np.abs(np.abs(poles) - 1) if discrete else np.abs(poles.real)
    size = np.abs(poles - 1) if discrete else np.abs(poles)
    return bool(np.any(moved > MOVED * np.maximum(damping, UNDAMPED * size)))


def trusted_responder(system: control.StateSpace) -> Callable[[np.ndarray], np.ndarray]:
    """`robust.systems.lti.responder`, from exact roots where modes over decades share poor coordinates."""
    dt = timebase(system)
    if not 1 < system.nstates <= LARGEST or not in_doubt(*certain_poles(system), bool(dt)):
        return responder(system)
    roots = roots_of(as_given(system))
    return lambda omega: roots.at(beside_one(omega, dt))
