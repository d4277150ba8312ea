"""Loops judged as given: stability and norm in the coordinates of the generalised plant."""

from __future__ import annotations

import control
import numpy as np

from robust.lti.connections import lower_lft
from robust.lti.lti import response_by_channel, timebase, to_s_plane
from robust.lti.norms import hinf_norm
from robust.proofs.search.stability import decide_stability
from robust.synthesis.hinf.generalised_plant import Plant, restore_controller
from robust.synthesis.hinf.riccati_pair import central_controller, solve_riccati_pair


def controlled_loop(
    P: control.StateSpace, problem: Plant, gamma: float
) -> tuple[control.StateSpace, control.StateSpace] | None:
    """Return the controller of a level for a regular problem and the loop of P with it; None if
    that is not stable.
    """
    solution = solve_riccati_pair(problem, gamma)
    if solution is None:
        return None
    try:
        matrices = central_controller(problem, solution, rolled_off=bool(problem.region))
        return close_stable_loop(P, restore_controller(problem, matrices))
    except (ValueError, np.linalg.LinAlgError):
        return None


def close_stable_loop(
    P: control.StateSpace, K: control.StateSpace
) -> tuple[control.StateSpace, control.StateSpace] | None:
    """Return a controller and the loop of P with it; None if that is not stable."""
    closed = lower_lft(P, K)
    if decide_stability(closed).stable:
        return K, closed
    return None


def norm_as_given(closed: control.StateSpace) -> tuple[float, float]:
    """Return the norm, at least its value on a grid in the original coordinates of the loop, and
    its peak frequency.
    """
    if closed.nstates:
        poles = to_s_plane(np.linalg.eigvals(closed.A), timebase(closed))
    else:
        poles = np.zeros(0)
    near = np.concatenate([np.abs(poles.imag), np.abs(poles)])
    omega = np.unique(near[:, None] * (1 + np.linspace(-0.03, 0.03, 31)))
    if timebase(closed):
        omega = omega[omega <= np.pi / timebase(closed)]
    gains = np.linalg.svd(np.moveaxis(response_by_channel(closed, omega), 2, 0), compute_uv=False)
    found = hinf_norm(closed)
    if omega.size:
        return max(found, (float(gains.max()), float(omega[gains[:, 0].argmax()])))
    return found
