"""Stable or not: floating point says so far from the boundary, exact arithmetic beside it."""

from __future__ import annotations

import control
import numpy as np

from robust._base.states import Outcome, Stability
from robust.lti.lti import timebase
from robust.lti.norms import EPS
from robust.lti.stability import StabilityResult, assess_stability, poles_with_rounding
from robust.proofs.exact.claim import to_matrices
from robust.proofs.exact.closed_loops import (
    ClosedLoopClaim,
    decide_closed_loop,
    norm_of_closed_loop,
    verify_closed_loop,
)
from robust.proofs.exact.stability import decide_matrix_stability
from robust.proofs.search.certificate import EXACT, Certificate, failed_certificate

BOUNDARY_FACTOR = 1e6  # times what rounding moves a pole by
MAX_EXACT_STATES = 60  # states: seconds beyond


def is_near_boundary(system: control.StateSpace, found: tuple[np.ndarray, np.ndarray] | None = None) -> bool:
    """Return whether a pole lies so near the stability boundary that rounding may matter, by a wide margin.

    `found` are its `poles_with_rounding`, where they are known.
    """
    poles, moved = poles_with_rounding(system) if found is None else found
    excess = np.abs(poles) - 1 if timebase(system) else poles.real
    rounding = np.maximum(moved, EPS * np.linalg.norm(system.A))  # putting the system together rounds too
    return bool(np.any(np.abs(excess) <= BOUNDARY_FACTOR * rounding))


def decide_stability(system: control.StateSpace) -> StabilityResult:
    """Return whether every pole of the system, its matrix taken as it is, is strictly stable.

    >>> on_the_axis = control.ss([[0.0, 1.0], [-1.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]])
    >>> found = decide_stability(on_the_axis)
    >>> found.state, found.at_boundary
    ('unstable', True)
    """
    apparent = assess_stability(system)
    if not system.nstates or system.nstates > MAX_EXACT_STATES or not is_near_boundary(system):
        return apparent
    exact = decide_matrix_stability(system.A, discrete=bool(timebase(system)))
    if exact.holds:
        return StabilityResult(state=Stability.STABLE)
    if not exact.violated or apparent.unstable:
        return apparent
    poles = poles_with_rounding(system)[0]
    worst = poles[int(np.argmax(np.abs(poles) if timebase(system) else poles.real))]
    return StabilityResult(state=Stability.UNSTABLE, pole=complex(worst), at_boundary=True)


# ---- The norm that a controller reaches with a plant, certified from both as they are given.

#: How far above the norm that was computed a level is tried, relative to it: near it rounding has the word.
LEVEL_MARGINS = (1e-7, 1e-5, 1e-3)


def certify_closed_loop(
    P: control.StateSpace, K: control.StateSpace, gamma: float, *, subject: str = "norm"
) -> Certificate:
    """Prove the norm of F_l(P, K) just above `gamma`, what it was found to be; else above what more digits find.

    Returns a certificate whose level is the bound that was proved. One that does not hold has the norm in many digits
    as its level (inf: the loop is not stable), or gamma of a loop with too many states for that. A loop through which
    nothing passes has level zero.
    """
    plant, controller = to_matrices(P), to_matrices(K)

    def proof(norm: float, *, thorough: bool = False) -> Certificate | None:
        for more in LEVEL_MARGINS[thorough:]:
            level = norm * (1 + more)
            claim = ClosedLoopClaim(plant=plant, controller=controller, level=level)
            if decide_closed_loop(claim, thorough=thorough).holds:
                top = np.pi / timebase(P) if timebase(P) else np.inf
                return Certificate(
                    subject=subject,
                    outcome=Outcome.HOLDS,
                    level=level,
                    method=EXACT,
                    intervals=np.array([[0.0, top]]),
                    reason="",
                    claim=claim,
                    again=verify_closed_loop,
                )
        return None

    if found := proof(gamma):
        return found
    precise, _ = norm_of_closed_loop(plant, controller)
    if np.isnan(precise) and (found := proof(gamma, thorough=True)):
        return found
    if np.isnan(precise):
        return failed_certificate(subject, gamma, f"the norm, {gamma:.6g} in floating point, could not be proved")
    if np.isinf(precise):
        return failed_certificate(subject, precise, "in more digits than floating point has, the loop is not stable")
    if found := proof(precise) or proof(precise, thorough=True):
        return found
    return failed_certificate(subject, precise, f"the norm, {precise:.6g} in many digits, could not be proved")
