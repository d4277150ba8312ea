"""Stable or not: floating point says so far from the boundary, exact arithmetic beside it."""

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

_BOUNDARY_FACTOR = 1e6  # times what rounding moves a pole by
MAX_EXACT_STATES = 60  # states: seconds beyond


def is_near_boundary(system: control.StateSpace, found: tuple[np.ndarray, np.ndarray] | None = None) -> bool:
    """Return whether a pole lies so near the stability boundary that rounding may matter, by a wide margin.

    `found` are its `poles_with_rounding`, where they are known.
    """
    poles, moved = poles_with_rounding(system) if found is None else found
    excess = np.abs(poles) - 1 if timebase(system) else poles.real
    rounding = np.maximum(moved, EPS * np.linalg.norm(system.A))  # putting the system together rounds too
    return bool(np.any(np.abs(excess) <= _BOUNDARY_FACTOR * rounding))


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

_LEVEL_MARGIN = 1e-7  # how far above the norm that was computed a level is tried, relative to it
_NORM_TOLERANCE = 1e-9  # between both bounds of a norm
TIME_CAP = 60.0  # processor time [s] after which a loop is left open


def certify_closed_loop(
    P: control.StateSpace, K: control.StateSpace, gamma: float, *, subject: str = "norm"
) -> Certificate:
    """Prove the norm of F_l(P, K) just above `gamma`, what it was found to be; else just above what it is.

    Returns a certificate whose level is the bound that was proved. One that does not hold has as its level what the
    norm is at least (inf: the loop is not stable). A loop through which nothing passes has level zero.
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
    """Bound the norm of F_l(P, K) from both sides; both bounds are inf where it is not stable."""
    try:
        loop = transfer_of_loop(plant, controller)
    except ZeroDivisionError:
        return GainBound(upper=np.inf, lower=np.inf, omega=np.nan, reason="the loop has no solution")
    if not loop.stability.holds:
        return GainBound(upper=np.inf, lower=np.inf, omega=np.nan, reason="the loop is not stable")
    return bound_transfer(loop, plant.dt or controller.dt, tolerance=_NORM_TOLERANCE, time_cap=TIME_CAP)


def certificate_of_loop(claim: ClosedLoopClaim, subject: str) -> Certificate:
    """Return the certificate of a claim that was proved."""
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
