"""The norm that a controller reaches with a plant, certified from both as they are given."""

from __future__ import annotations

import time

import control
import numpy as np

from robust.certificates.certificate import EXACT, Certificate, refused
from robust.shared.states import Outcome
from robust.systems.lti import timebase
from robust.verification.claim import as_given
from robust.verification.closed_loops import (
    ClosedLoopClaim,
    decide_closed_loop,
    norm_of_closed_loop,
    verify_closed_loop,
)

__all__ = ["certify_closed_loop"]


#: How far above the norm that was computed a level is tried, relative to it: near it rounding has the word.
ABOVE = (1e-7, 1e-5, 1e-3)


def certify_closed_loop(
    P: control.StateSpace, K: control.StateSpace, gamma: float, *, subject: str = "norm", time_cap: float = 10.0
) -> Certificate:
    """Prove the norm of F_l(P, K) just above `gamma`, what it was found to be; else above what more digits find.

    Returns a certificate whose level is the bound that was proved. One that does not hold has the norm in many digits
    as its level (inf: the loop is not stable), or gamma where there was no time for it.
    """
    deadline = time.thread_time() + time_cap
    plant, controller = as_given(P), as_given(K)

    def proof(norm: float, *, thorough: bool = False) -> Certificate | None:
        for more in ABOVE[thorough:]:
            level = norm * (1 + more) if norm > 0 else np.finfo(float).tiny
            claim = ClosedLoopClaim(plant=plant, controller=controller, level=level)
            if decide_closed_loop(claim, deadline=deadline, thorough=thorough).holds:
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
    precise, _ = norm_of_closed_loop(plant, controller, deadline=deadline)
    if np.isnan(precise) and (found := proof(gamma, thorough=True)):
        return found
    if np.isnan(precise):
        return refused(
            subject, gamma, f"the norm, {gamma:.6g} in floating point, could not be proved in {time_cap:.3g} s"
        )
    if np.isinf(precise):
        return refused(subject, precise, "in more digits than floating point has, the loop is not stable")
    if found := proof(precise) or proof(precise, thorough=True):
        return found
    return refused(subject, precise, f"the norm, {precise:.6g} in many digits, could not be proved in {time_cap:.3g} s")
