"""Proofs about a loop: robust stability and robust performance at every frequency."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from nlfrf._base.arguments import hertz
from nlfrf._base.values import value
from robust._base.states import Outcome
from robust.analysis.aliases import operator_performance
from robust.analysis.loop import Loop, weighted
from robust.lti.connections import closed_loop
from robust.lti.lti import Matrices, constant, over_frequency, response, timebase
from robust.lti.norms import continuous_image, well_conditioned
from robust.lti.realisation import state_space
from robust.models.sets.forms import FORMS
from robust.models.sets.model import UncertaintyModel
from robust.proofs.exact.claim import ALIASED, OPERATOR_PERFORMANCE, PERFORMANCE, STABILITY, LoopClaim, as_given
from robust.proofs.exact.loops import verify_loop
from robust.proofs.search.bounded_real import certify_norm
from robust.proofs.search.certificate import EXACT, Certificate, refused
from robust.proofs.search.intervals import IntervalProof, around, prove
from robust.proofs.search.stability import LoopFactors, product, prove_loop

__all__ = ["Proofs", "claim_of", "claimed", "prove_set"]


# ---- What a check claims of a loop, put into the exact form in which someone else can prove it again.


def claim_of(model: UncertaintyModel, K: Any, w_P: Any, delay: float) -> LoopClaim:
    """Robust stability of a model with its controller, with all numbers as they were given."""
    form = FORMS[model.form]
    return LoopClaim(
        plant=as_given(model.nominal),
        controller=as_given(state_space("K", K)),
        weight=as_given(model.weight),
        performance=None if w_P is None else as_given(state_space("w_P", w_P)),
        reads=tuple(name for name in form.read if name != "w"),
        inverse=form.inverse,
        perturbation=model.perturbation,
        delay=float(delay),
        claims=(STABILITY,),
        shaping=tuple(as_given(W) for W in (model.W1, model.W2)) if form.scaled else (),
    )


def claimed(found: Certificate, claim: LoopClaim, name: str, *, scaling: float = 1.0) -> Certificate:
    """A certificate with what it claims, by that name; one that does not hold claims nothing."""
    return replace(found, claim=replace(claim, claims=(name,), scaling=scaling) if found.holds else None)


BUDGET = 3.0  # seconds for each proof by intervals


@value
class Proofs:
    """What was proved of a loop, and what was disproved on the way.

    Fields
    ------
    certificates : tuple of Certificate
        Stability first, then performance where it was asked for and stability holds.
    violated : bool
        A plant of the set is unstable in the loop.
    stable, performance : bool
        Proved for the whole set, at every frequency.
    """

    certificates: tuple[Certificate, ...]
    violated: bool
    stable: bool = False
    performance: bool = False


def prove_set(loop: Loop, omega: np.ndarray, peak: float, *, claim: LoopClaim, certify: bool, solver: str) -> Proofs:
    """Whatever can be proved of the claim where the largest rs found is `peak`."""
    if loop.aliases is not None:
        return prove_aliased(loop, omega, peak, claim, certify)
    if peak >= 1 or not certify:
        return Proofs(certificates=(), violated=peak >= 1)
    stability = claimed(prove_stability(loop, omega, solver), claim, STABILITY)
    stability = stability if settled(stability) else prove_exactly(stability, claim, STABILITY, loop.top)
    violated, stable = stability.violated, stability.holds
    if not stable or loop.w_P is None:
        return Proofs(certificates=(stability,), violated=violated, stable=stable)
    performance = prove_performance(loop, omega, claim)
    if not settled(performance) and claim.perturbation != "operator":
        performance = prove_exactly(performance, claim, PERFORMANCE, loop.top)
    return Proofs(
        certificates=(stability, performance), violated=violated, stable=stable, performance=performance.holds
    )


def prove_aliased(loop: Loop, omega: np.ndarray, peak: float, claim: LoopClaim, certify: bool) -> Proofs:
    """The same of a set of continuous plants under a sampled controller: every alias counts, interval by interval."""
    if peak >= 1 or not certify:
        return Proofs(certificates=(), violated=False)
    stability = prove_with_aliases(loop, omega, claim, STABILITY)
    if not stability.holds or loop.w_P is None:
        return Proofs(certificates=(stability,), violated=False, stable=stability.holds)
    name = OPERATOR_PERFORMANCE if claim.perturbation == "operator" else PERFORMANCE
    performance = prove_with_aliases(loop, omega, claim, name)
    return Proofs(certificates=(stability, performance), violated=False, stable=True, performance=performance.holds)


def prove_with_aliases(loop: Loop, omega: np.ndarray, claim: LoopClaim, name: str) -> Certificate:
    """One claim with every alias, in exact arithmetic."""
    failed = refused(STABILITY if name == STABILITY else PERFORMANCE, 1.0, "")
    if name == OPERATOR_PERFORMANCE and claim.inverse:
        return replace(failed, reason="not attempted for operators in an inverse form under a sampled controller")
    scaling = best_aliased_scaling(loop, omega) if name == OPERATOR_PERFORMANCE else 1.0
    return prove_exactly(failed, replace(claim, scaling=scaling), ALIASED[name], loop.top)


def best_aliased_scaling(loop: Loop, omega: np.ndarray) -> float:
    """The one scaling that keeps the largest gain of an operator's loop lowest over the grid (convex in its log)."""
    curves = loop.curves(omega)
    point = loop.at_points(curves)
    PS, F = np.abs(curves.w_P * curves.S), point.F[:, 0]
    sizes, others = point.sizes, point.sums()

    def largest(log: float) -> float:
        return float(operator_performance(sizes, others, PS, F * PS, float(np.exp(log))).max())

    start = np.log(np.median(np.sqrt(others.FF + F**2)))
    return float(np.exp(minimize_scalar(largest, bracket=(start - 1, start + 1)).x))


def settled(found: Certificate) -> bool:
    """Whether a proof was found, or a place where there is none."""
    return found.outcome is not Outcome.UNDECIDED


def prove_exactly(failed: Certificate, claim: LoopClaim, name: str, top: float) -> Certificate:
    """The proof that floating point did not find, in exact arithmetic; the failure where that finds none either."""
    found = verify_loop(replace(claim, claims=(name,)), time_cap=BUDGET)
    if found.verified:
        everywhere = np.array([[0.0, top]])
        proof = replace(failed, outcome=Outcome.HOLDS, method=EXACT, intervals=everywhere, reason="")
        return claimed(proof, claim, name, scaling=claim.scaling)
    reason = dict(found.failed).get(name, "")
    if name in found.violated:
        return replace(failed, outcome=Outcome.VIOLATED, reason=reason)
    return failed if failed.reason else replace(failed, reason=reason)


def prove_stability(loop: Loop, omega: np.ndarray, solver: str) -> Certificate:
    """|b| < 1 at every frequency: by a linear matrix inequality, else interval by interval."""
    subject = "robust stability"
    before = ""
    if not loop.pade_delay and (constant(loop.weight) or timebase(loop.weight) == loop.dt):
        certificate = certify_norm(weighted(loop), 1.0, solver=solver, subject=subject)
        if certificate.holds:
            return certificate
        before = certificate.reason
    if FORMS[loop.form].scaled:  # b is no product of responses: what is left is for exact arithmetic
        return refused(subject, 1.0, before)
    outcome = prove_loop(parts(loop, performance=False), omega[[0, -1]], loop.top, time_cap=BUDGET)
    return as_certificate(subject, outcome, "interval by interval", before)


def parts(loop: Loop, *, performance: bool) -> LoopFactors:
    """The loop as `prove_loop` takes it."""
    G, K, w, tau = loop.short, loop.K, loop.weight, loop.shift
    form, named = FORMS[loop.form], {"w": w, "G": G, "K": K}
    read, beside = [named[name] for name in form.read], tuple(named[name] for name in form.beside)
    return LoopFactors(
        L=product(G, K, delay=tau),
        q=product(*read, delay=tau if "G" in form.read else 0.0),
        relative=product(w, over=beside, delay=-tau if "G" in form.beside else 0.0),
        w_P=product(loop.w_P) if performance else None,
        inverse=form.inverse,
    )


def prove_performance(loop: Loop, omega: np.ndarray, claim: LoopClaim) -> Certificate:
    """|w_P| max |S_p| < 1 at every frequency, interval by interval.

    For an operator perturbation it is the norm of the two-block loop under one scaling that holds at all frequencies.
    """
    subject = "robust performance"
    if claim.perturbation != "operator" and FORMS[loop.form].scaled:
        return refused(subject, 1.0, "")
    if claim.perturbation != "operator":
        outcome = prove_loop(parts(loop, performance=True), omega[[0, -1]], loop.top, time_cap=BUDGET)
        return claimed(as_certificate(subject, outcome, "interval by interval"), claim, PERFORMANCE)
    if loop.pade_delay:
        return refused(subject, 1.0, "not attempted for operators with a delay in a continuous loop")
    out, into = loop.ports()
    A, B, C, D = well_conditioned(continuous_image(loop.shaped().closed((*out, "e"), (*into, "r"))))
    bound, bound_P = loop.weight_bound(loop.weight), loop.weight_bound(loop.w_P)
    d = best_constant(loop, omega)

    def frozen(low: float, high: float) -> Matrices:
        rows = np.array([[bound(low, high)]] * len(out) + [[bound_P(low, high) / d]])
        cols = np.array([[1.0] * len(into) + [d]])
        return A, B * cols, C * rows, D * rows * cols

    def exact(x: float) -> float:
        return float(np.linalg.norm(scaled(loop_matrix(loop, np.array([loop.omega_of(x)]))[0], d), 2))

    outcome = prove(frozen, exact, starting_points(loop, A, omega), np.inf, time_cap=BUDGET)
    found = as_certificate(subject, in_omega(loop, outcome), "Hamiltonian with one scaling, interval by interval")
    return claimed(found, claim, OPERATOR_PERFORMANCE, scaling=d)


def loop_matrix(loop: Loop, omega: np.ndarray) -> np.ndarray:
    """(W, ., .) weighted response from (perturbation, r) to (perturbation, e)."""
    out, into = loop.ports()
    own = loop.shaped()
    matrices = closed_loop(own.G, own.K, (*out, "e"), (*into, "r"))
    rows = np.stack([response(loop.weight, omega)] * len(out) + [response(loop.w_P, omega)], axis=1)
    return over_frequency(matrices, omega, loop.dt) * rows[:, :, None]


def scaled(matrix: np.ndarray, d: float) -> np.ndarray:
    """(..., ., .) the last row divided by d, the last column times it."""
    out = matrix.copy()
    out[..., -1, :] /= d
    out[..., :, -1] *= d
    return out


def best_constant(loop: Loop, omega: np.ndarray) -> float:
    """The one scaling d that keeps the largest singular value lowest over the grid (convex in log d)."""
    matrices = loop_matrix(loop, omega)

    def largest(log: float) -> float:
        d = np.exp(log)
        return float(np.linalg.svd(scaled(matrices, d), compute_uv=False)[:, 0].max())

    start = np.sqrt(np.abs(matrices[:, -1, 0]).max() / np.abs(matrices[:, 0, -1]).max())
    return float(np.exp(minimize_scalar(largest, bracket=(np.log(start) - 1, np.log(start) + 1)).x))


def starting_points(loop: Loop, A: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """Where to cut the axis first: around the resonances of the loop."""
    size = np.abs(np.linalg.eigvals(A)) if A.size else np.zeros(0)
    size = size[(size > 0) & np.isfinite(size)]
    return around(np.concatenate([size, loop.x_of(omega[[0, omega.size // 2, -1]])]))


def in_omega(loop: Loop, outcome: IntervalProof) -> IntervalProof:
    """An outcome on the axis of `prove`, in rad/s."""
    return replace(outcome, intervals=loop.omega_of(outcome.intervals), violated_at=loop.omega_of(outcome.violated_at))


def as_certificate(subject: str, outcome: IntervalProof, method: str, before: str = "") -> Certificate:
    """The outcome of a proof by intervals as a certificate."""
    if outcome.holds:
        return Certificate(
            subject=subject, outcome=Outcome.HOLDS, level=1.0, method=method, intervals=outcome.intervals, reason=""
        )
    if np.isfinite(outcome.violated_at):
        where = f"violated at {hertz(outcome.violated_at)}: {outcome.reason}"
        return refused(subject, 1.0, where, outcome=Outcome.VIOLATED)
    return refused(subject, 1.0, "; ".join(part for part in (before, f"{method}: {outcome.reason}") if part))
