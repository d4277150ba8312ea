"""Decisions on stability: floating point far from the boundary, exact arithmetic close to it."""

from __future__ import annotations

import time
from dataclasses import replace

import control
import numpy as np

from robust._base.states import Outcome, Stability
from robust.lti.lti import timebase
from robust.lti.norms import EPS
from robust.lti.stability import StabilityResult, assess_stability, poles_with_rounding
from robust.proofs.exact.claim import Matrices, to_matrices
from robust.proofs.exact.closed_loops import (
    ClosedLoopClaim,
    decide_closed_loop,
    transfer_of_loop,
    verify_closed_loop,
)
from robust.proofs.exact.stability import decide_matrix_stability
from robust.proofs.search.bands import GainBound, bound_transfer
from robust.proofs.search.certificate import EXACT, Certificate, failed_certificate

_BOUNDARY_FACTOR = 1e6  # times the shift of a pole by rounding
MAX_EXACT_STATES = 60  # number of states; more would take seconds


def is_near_boundary(
    system: control.StateSpace, found: tuple[np.ndarray, np.ndarray] | None = None
) -> bool:
    """Return whether a pole is so close to the stability boundary that rounding may matter, with a
    wide margin.

    `found` are its `poles_with_rounding`, if they are known.
    """
    if found is None:
        poles, moved = poles_with_rounding(system)
    else:
        poles, moved = found
    if timebase(system):
        excess = np.abs(poles) - 1
    else:
        excess = poles.real
    rounding = np.maximum(moved, EPS * np.linalg.norm(system.A))  # assembling the system rounds too
    return bool(np.any(np.abs(excess) <= _BOUNDARY_FACTOR * rounding))


def decide_stability(system: control.StateSpace) -> StabilityResult:
    """Decide whether every pole of the system, with its matrix as given, is strictly stable.

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


# ---- The norm of a plant with a controller, certified from both as they are given.

_LEVEL_MARGIN = 1e-7  # relative distance of a tried level above the computed norm
_NORM_TOLERANCE = 1e-9  # relative, between both bounds of a norm
TIME_CAP = 60.0  # processor time [s] after which a loop is left undecided


def certify_closed_loop(
    P: control.StateSpace, K: control.StateSpace, gamma: float, *, subject: str = "norm"
) -> Certificate:
    """Prove a level just above `gamma`, the computed norm of F_l(P, K); if that fails, just above
    the norm itself.

    The level of the certificate is the proved bound. If it does not hold, its level is a lower
    bound of the norm (inf for an unstable loop). A loop with zero transfer has level zero.
    """
    plant, controller = to_matrices(P), to_matrices(K)
    claim = ClosedLoopClaim(plant=plant, controller=controller, level=gamma * (1 + _LEVEL_MARGIN))
    if not decide_closed_loop(claim, deadline=time.thread_time() + TIME_CAP).holds:
        norm = norm_of_closed_loop(plant, controller)
        if not norm.is_proved:
            return failed_certificate(subject, max(gamma, norm.lower), norm.reason)
        claim = replace(claim, level=norm.upper * (1 + _LEVEL_MARGIN))
    return certificate_of_loop(claim, subject)


def norm_of_closed_loop(plant: Matrices, controller: Matrices) -> GainBound:
    """Bound the norm of F_l(P, K) from both sides; both bounds are inf for an unstable loop."""
    try:
        loop = transfer_of_loop(plant, controller)
    except ZeroDivisionError:
        return GainBound(
            upper=np.inf, lower=np.inf, omega=np.nan, reason="the loop has no solution"
        )
    if not loop.stability.holds:
        return GainBound(upper=np.inf, lower=np.inf, omega=np.nan, reason="the loop is not stable")
    return bound_transfer(
        loop, plant.dt or controller.dt, tolerance=_NORM_TOLERANCE, time_cap=TIME_CAP
    )


def certificate_of_loop(claim: ClosedLoopClaim, subject: str) -> Certificate:
    """Return the certificate of a proved claim."""
    dt = claim.plant.dt or claim.controller.dt
    return Certificate(
        subject=subject,
        outcome=Outcome.HOLDS,
        level=claim.level,
        method=EXACT,
        intervals=np.array([[0.0, np.pi / dt if dt else np.inf]]),
        reason="",
        claim=claim,
        again=verify_closed_loop,
    )
