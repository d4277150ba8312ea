"""Prove robust stability and performance of one loop by a linear matrix inequality.

The loop with its perturbation pulled out is one state space, put together in floating point. cvxpy proposes P and a
scaling for it, which are verified over the rationals (`robust.proofs.exact.scaled_kyp`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal, TypeAlias

import control

from robust.analysis.curves import Curves
from robust.analysis.findings import Proofs
from robust.analysis.loop import Loop
from robust.analysis.loop_proofs import prove_set
from robust.lti.connections import in_series
from robust.lti.lti import is_constant, timebase
from robust.models.sets.forms import FORMS
from robust.proofs.exact.claim import PERFORMANCE, STABILITY, LoopClaim
from robust.proofs.search.certificate import Certificate, failed_certificate
from robust.proofs.search.intervals import SLACK
from robust.proofs.search.scaled_kyp import certify_scaled

#: How one loop is proved.
ProofMethod: TypeAlias = Literal["exact", "lmi", "both"]
METHODS = ("exact", "lmi", "both")
TIME_CAP = 20.0  # seconds of each program


def prove_set_by(
    loop: Loop,
    curves: Curves,
    peak: float,
    *,
    claim: LoopClaim,
    certify: bool,
    proof: ProofMethod,
    solver: str | None,
) -> Proofs:
    """Return what is proved in the way that was asked for; by both, what either of them proves is."""
    exact = prove_set(loop, curves, peak, claim=claim, certify=certify and proof != "lmi")
    if proof == "exact" or not certify or exact.violated or peak >= 1:
        return exact
    found = certificates_by_lmi(loop, solver)
    stable = found[0].holds
    return replace(
        exact,
        certificates=(*exact.certificates, *found),
        robustly_stable=exact.robustly_stable or stable,
        robust_performance=exact.robust_performance or (len(found) == 2 and found[1].holds),
    )


def certificates_by_lmi(loop: Loop, solver: str | None) -> tuple[Certificate, ...]:
    """Return the certificate of stability, and of performance where it is asked for and stability holds."""
    if reason := reason_against_lmi(loop):
        return (failed_certificate(STABILITY, 1.0, reason),)
    N = perturbation_loop(loop)
    stability = certify_channels(control.StateSpace(N.A, N.B[:, :1], N.C[:1], N.D[:1, :1], N.dt), STABILITY, solver)
    if loop.w_P is None or not stability.holds:
        return (stability,)
    return stability, certify_channels(N, PERFORMANCE, solver)


def certify_channels(N: control.StateSpace, subject: str, solver: str | None) -> Certificate:
    """Return the proof that mu of scalar blocks stays below one."""
    blocks = [(1, 1, "full")] * N.noutputs
    found = certify_scaled(N, blocks, 1 - SLACK, solver=solver or "CLARABEL", time_cap=TIME_CAP, subject=subject)
    if found is None:
        return failed_certificate(subject, 1.0, "no P was found with one scaling for all frequencies")
    return replace(found, level=1.0)


def reason_against_lmi(loop: Loop) -> str:
    """Return why a loop is no state space that an inequality could be about; empty where it is one."""
    if FORMS[loop.form].depends_on_units:
        return f"an inequality is not set up for the {loop.form} form; exact arithmetic proves it"
    if loop.continuous_plant is not None:
        return "every alias of a continuous plant counts, which no inequality covers; exact arithmetic proves it"
    if loop.pade_delay:
        return "the delay of a continuous loop is no state space; exact arithmetic proves it"
    for name, weight in (("weight", loop.weight), ("w_P", loop.w_P)):
        if weight is not None and not is_constant(weight) and timebase(weight) != loop.dt:
            return f"{name} is continuous over a sampled loop; exact arithmetic proves it"
    return ""


def perturbation_loop(loop: Loop) -> control.StateSpace:
    """Return the loop from (perturbation, r) to (what it reads, w_P e), with weights; without w_P its first channel.

    What the form weighs is b = w R S, so the factors of R name the channels.
    """
    factors = FORMS[loop.form].rs_factors
    outputs, inputs = ["u" if "K" in factors else "y"], ["p_in" if "G" in factors else "p_out"]
    weights = [loop.weight]
    if loop.w_P is not None:
        outputs, inputs, weights = [*outputs, "e"], [*inputs, "r"], [*weights, loop.w_P]
    N = loop.closed_loop(tuple(outputs), tuple(inputs))
    joined = control.append(*(control.StateSpace(w.A, w.B, w.C, w.D, loop.dt) for w in weights))
    return in_series(N, joined, dt=loop.dt)
