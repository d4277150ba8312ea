"""Prove robust stability and robust performance of a loop at every frequency, in exact arithmetic.

This module writes the claims as polynomial inequalities in omega, which `robust.proofs.exact`
decides. For sets of class "operator" (any causal perturbation, nonlinear or time-varying ones
included) it also searches one scaling for all frequencies. The claim with this scaling is proved,
so the search itself needs no proof.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import minimize_scalar

from robust._base.states import Outcome
from robust._base.types import Controller
from robust.analysis.curves import Curves
from robust.analysis.findings import Proofs
from robust.analysis.loop import Loop
from robust.lti.grids import peak_of
from robust.lti.lti import replace_infinite
from robust.lti.realisation import state_space
from robust.models.sets.forms import FORMS
from robust.models.sets.model import UncertaintyModel
from robust.proofs.exact.claim import (
    ALIASED,
    OPERATOR_PERFORMANCE,
    PERFORMANCE,
    STABILITY,
    LoopClaim,
    to_matrices,
)
from robust.proofs.exact.conditions import Terms, claim_inequalities
from robust.proofs.exact.loops import NOMINAL, WEIGHTS, verify_loop
from robust.proofs.exact.verification import Verification
from robust.proofs.search.certificate import EXACT, Certificate, failed_certificate

if TYPE_CHECKING:
    import control

# ---- The claim of a check as exact numbers, for an independent proof.


def stability_claim(
    model: UncertaintyModel, K: Controller, *, w_P: control.StateSpace | None, delay: float
) -> LoopClaim:
    """Return the claim of robust stability of a model with its controller, in the given numbers."""
    form = FORMS[model.form]
    return LoopClaim(
        plant=to_matrices(model.nominal),
        controller=to_matrices(state_space("K", K)),
        weight=to_matrices(model.weight),
        performance=None if w_P is None else to_matrices(state_space("w_P", w_P)),
        reads=tuple(name for name in form.rs_factors if name != "w"),
        inverse=form.inverse,
        perturbation=model.perturbation,
        delay=float(delay),
        claims=(STABILITY,),
        shaping=tuple(to_matrices(W) for W in model.scaling),
    )


_TIME_CAP = 10.0  # processor time for a single claim [s]
_TIME_CAP_PER_CLAIM = 3.0  # processor time for each of several claims [s]


def prove_set(loop: Loop, curves: Curves, peak: float, *, certify: bool) -> Proofs:
    """Prove stability and performance of the set in exact arithmetic; `peak` is the largest rs
    found.

    With aliases the condition is only sufficient, so a failure is no disproof.
    """
    claim = stability_claim(loop.model, loop.controller, w_P=loop.w_P, delay=loop.delay)
    aliased, operator = loop.aliases is not None, claim.perturbation == "operator"
    if peak >= 1 or not certify:
        return Proofs(certificates=(), violated=peak >= 1 and not aliased)
    names, scaling, hopeless = [STABILITY], 1.0, ""
    if loop.w_P is not None:
        if aliased:
            hopeless = _reason_to_skip_performance(curves, claim)
        else:
            hopeless = ""
        if not hopeless:
            names.append(OPERATOR_PERFORMANCE if operator else PERFORMANCE)
            if operator:
                scaling = _best_operator_scaling(loop, claim, curves)
            else:
                scaling = 1.0
    if aliased:
        names = [ALIASED[name] for name in names]
    claims = [
        replace(claim, claims=(name,), scaling=scaling if k else 1.0)
        for k, name in enumerate(names)
    ]
    found = verify_loop(
        replace(claims[-1], claims=tuple(names)), time_cap=_TIME_CAP_PER_CLAIM * len(names)
    )
    certificates = [
        _certificate_of_claim(found, *each, loop.omega_max)
        for each in zip((STABILITY, PERFORMANCE), claims, strict=False)
    ]
    if hopeless:
        certificates.append(failed_certificate(PERFORMANCE, 1.0, hopeless))
    stable, violated = certificates[0].holds, certificates[0].violated
    if not stable or loop.w_P is None:
        return Proofs(
            certificates=tuple(certificates[:1]), violated=violated, robustly_stable=stable
        )
    return Proofs(
        certificates=tuple(certificates),
        violated=False,
        robustly_stable=True,
        robust_performance=certificates[1].holds,
    )


def has_worst_gain_below(loop: Loop, level: float) -> bool:
    """Return whether |w_P S| (|S| without w_P) is proved to stay below a level for every plant of
    the set.
    """
    if loop.w_P is None:
        demand = state_space("w_P", 1.0)
    else:
        demand = loop.w_P
    demand = type(demand)(demand.A, demand.B, demand.C / level, demand.D / level, demand.dt)
    claim = stability_claim(loop.model, loop.controller, w_P=demand, delay=loop.delay)
    if loop.aliases is not None and claim.perturbation == "operator":
        return False
    if loop.aliases is None:
        name = PERFORMANCE
    else:
        name = ALIASED[PERFORMANCE]
    return name in verify_loop(replace(claim, claims=(name,)), time_cap=_TIME_CAP).proved


def _reason_to_skip_performance(curves: Curves, claim: LoopClaim) -> str:
    """Return why no proof of performance with every alias is tried; empty if it is tried.

    With aliases, exact arithmetic has upper bounds only. If they fail, it would split the axis
    around that frequency without end.
    """
    if claim.perturbation == "operator":
        if claim.inverse:
            return "not attempted for operators in an inverse form under a sampled controller"
        return ""
    worst = peak_of(curves.omega, curves.rp)
    if worst.value >= 1:
        return f"rp reaches {worst}"
    return ""


def _certificate_of_claim(
    found: Verification, subject: str, claim: LoopClaim, top: float
) -> Certificate:
    """Return the certificate of a claim; it contains the claim if it holds."""
    (name,) = claim.claims
    if name in found.proved:
        return Certificate(
            subject=subject,
            outcome=Outcome.HOLDS,
            level=1.0,
            method=EXACT,
            intervals=np.array([[0.0, top]]),
            reason="",
            claim=claim,
            again=verify_loop,
        )
    # nothing else was checked if stability of the nominal loop is open: the first failure is the
    # cause
    if set(found.proved) >= {NOMINAL, WEIGHTS}:
        reason = dict(found.failed).get(name, "")
    else:
        reason = ": ".join(found.failed[0])
    return failed_certificate(
        subject,
        1.0,
        reason,
        outcome=Outcome.VIOLATED if name in found.violated else Outcome.UNDECIDED,
    )


def _best_operator_scaling(loop: Loop, claim: LoopClaim, curves: Curves) -> float:
    """Find the scaling, the same for all frequencies, with the least gain of an operator's loop
    (convex in its log).
    """
    if loop.aliases is not None:
        point, PS = loop.with_aliases(curves), np.abs(curves.w_P * curves.S)
        others = point.alias_sums()

        def largest(log: float) -> float:
            return float(
                point.squared_performance_gain(others, PS=PS, scaling=float(np.exp(log))).max()
            )
    else:
        terms = _terms_of_curves(curves)

        def largest(log: float) -> float:
            left = claim_inequalities(
                OPERATOR_PERFORMANCE,
                claim.reads,
                inverse=claim.inverse,
                t=terms,
                scaling=np.exp(2 * log),
            )
            return -float(np.nanmin(left[-1] / terms.closed))

    logs = np.linspace(
        -30.0, 30.0, 31
    )  # wide, because the units of plant and weights may differ by decades
    k = int(np.clip(np.argmin([largest(log) for log in logs]), 1, logs.size - 2))
    return float(np.exp(minimize_scalar(largest, bracket=tuple(logs[k - 1 : k + 2])).x))


def _terms_of_curves(curves: Curves) -> Terms:
    """Return the terms of exact arithmetic as numbers, for the search of a scaling."""
    assert curves.w_P is not None  # a scaling is searched only with a performance weight
    G, K, W = replace_infinite(curves.G), replace_infinite(curves.K), np.abs(curves.W) ** 2
    L, one = G * K, np.ones(curves.omega.size)
    return Terms(
        G_num=np.abs(G) ** 2,
        G_den=one,
        K_num=np.abs(K) ** 2,
        K_den=one,
        cross=L.real,
        closed=np.abs(1 + L) ** 2,
        w_num=np.abs(curves.w) ** 2,
        w_den=one,
        P_num=np.abs(curves.w_P) ** 2,
        P_den=one,
        W_num=W,
        W_den=one,
    )
