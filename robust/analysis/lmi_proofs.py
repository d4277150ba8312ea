"""Prove robust stability and performance for one channel by a linear matrix inequality.

The loop, with its perturbation as an external block, is one state space that is assembled in
floating point. cvxpy proposes P and a scaling for it, which are verified over the rationals
(`robust.proofs.exact.scaled_kyp`).
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import control

from robust.analysis.curves import Curves
from robust.analysis.findings import Effort, Proofs
from robust.analysis.loop import Loop
from robust.analysis.loop_proofs import prove_set
from robust.proofs.exact.claim import PERFORMANCE, STABILITY
from robust.proofs.search.certificate import Certificate, failed_certificate
from robust.proofs.search.scaled_kyp import certify_with_one_scaling


def prove_set_by(loop: Loop, curves: Curves, peak: float, effort: Effort) -> Proofs:
    """Return the proofs by the chosen method; for "both", a claim counts as proved if either method
    proves it.
    """
    exact = prove_set(loop, curves, peak, certify=effort.certify and effort.proof != "lmi")
    if effort.proof == "exact" or not effort.certify or exact.violated or peak >= 1:
        return exact
    found = _certificates_by_lmi(loop, effort.solver)
    stable = found[0].holds
    return replace(
        exact,
        certificates=(*exact.certificates, *found),
        robustly_stable=exact.robustly_stable or stable,
        robust_performance=exact.robust_performance or (len(found) == 2 and found[1].holds),
    )


def _certificates_by_lmi(loop: Loop, solver: str | None) -> tuple[Certificate, ...]:
    """Return the certificate of stability, and that of performance if there is a demand and
    stability holds.
    """
    if reason := loop.reason_against_system:
        return (failed_certificate(STABILITY, 1.0, reason),)
    N = loop.perturbation_loop
    prove = partial(certify_with_one_scaling, solver=solver or "CLARABEL")
    inner = control.StateSpace(N.A, N.B[:, :1], N.C[:1], N.D[:1, :1], N.dt)
    stability = prove(inner, [(1, 1, "full")], subject=STABILITY)
    if loop.w_P is None or not stability.holds:
        return (stability,)
    return stability, prove(N, [(1, 1, "full")] * 2, subject=PERFORMANCE)
