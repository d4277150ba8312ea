"""Proofs of the claims on a loop: stability in exact arithmetic, curves in ball arithmetic.

The proofs use only the stored matrices, and no curve or pole computed in floating point. If plant,
controller and weights share one time base, a claim is a polynomial in one variable, positive from
zero to infinity. A delay in a continuous loop, or a continuous weight around a sampled one, is
treated exactly, interval by interval.
"""

from __future__ import annotations

import time
from dataclasses import replace

from flint import arb, ctx

from robust.proofs.exact.aliases import prove_with_aliases
from robust.proofs.exact.claim import ALIASED, LoopClaim
from robust.proofs.exact.conditions import Quantity, Terms, claim_inequalities
from robust.proofs.exact.polynomials import (
    Decision,
    positive_on_half_line,
    proved,
    refuted,
    routh,
    to_rational,
    undecided,
)
from robust.proofs.exact.stability import (
    Axis,
    claim_on_axis,
    decide_quotient_stability,
    polynomial_terms,
    squared_magnitudes,
    terms_at_infinity,
)
from robust.proofs.exact.taylor_models import positive_on_intervals
from robust.proofs.exact.verification import Verification, summarise_claims

_BITS = (192, 320, 640, 2048)
_MAX_STATES = 400
NOMINAL, WEIGHTS = "nominal stability", "stable weights"


def verify_loop(claim: LoopClaim, *, time_cap: float = 60.0) -> Verification:
    """Prove every claim on a loop from its matrices as exact rationals, with outward rounding.

    Parameters
    ----------
    claim : LoopClaim
        The claims, with all numbers as given.
    time_cap : float
        Seconds of processor time, after which the rest counts as not verified. The load of the
        machine has no effect.

    Returns
    -------
    Verification
        A claim that is not verified is a result and not an error: each has its reason.

    Examples
    --------
    >>> import numpy as np
    >>> from robust.proofs.exact.claim import Matrices
    >>> def lag(a, b, c, d): return Matrices(A=np.array([[a]]), B=np.array([[b]]), C=np.array([[c]]), D=np.array([[d]]))
    >>> def gain(d): return Matrices(A=np.zeros((0, 0)), B=np.zeros((0, 1)), C=np.zeros((1, 0)), D=np.array([[d]]))
    >>> loop = dict(plant=lag(-1.0, 1.0, 1.0, 0.0), controller=gain(2.0), performance=None, reads=("G", "K"),
    ...             inverse=False, perturbation="LTI", delay=0.0, claims=("robust stability",))
    >>> print(verify_loop(LoopClaim(weight=gain(1.4999999999), **loop)))       # T = 2/(s + 3): |w T| < 1 for |w| < 1.5
    nominal stability: proved, rigorous
    stable weights: proved, rigorous
    robust stability: proved, rigorous
    >>> verify_loop(LoopClaim(weight=gain(1.5), **loop)).verified
    False
    """
    deadline = time.thread_time() + time_cap
    try:
        decided: dict[str, Decision] = {}
        first = any(
            name in ALIASED.values() for name in claim.claims
        )  # with aliases 192 bits seldom suffice
        for bits in _BITS[first:]:
            with ctx.workprec(bits):
                _decide_claims(claim, decided, deadline)
            if (
                not any(found.needs_digits for found in decided.values())
                or time.thread_time() > deadline
            ):
                break
    except ValueError as error:
        return Verification(proved=(), failed=(("the loop", str(error)),))
    return summarise_claims(decided)


def _decide_claims(claim: LoopClaim, decided: dict[str, Decision], deadline: float) -> None:
    """Decide the claims that are still open, at the current precision."""
    axis = claim_on_axis(claim)
    if axis.G.degree + axis.K.degree > _MAX_STATES:
        raise ValueError(f"the loop must have at most {_MAX_STATES} states to be verified")

    def open_still(name: str) -> bool:
        return name not in decided or decided[name].needs_digits

    if open_still(NOMINAL):
        decided[NOMINAL] = decide_quotient_stability(axis.G, axis.K, axis.delay)
    if open_still(WEIGHTS):
        decided[WEIGHTS] = _check_weights(axis)
    if not (decided[NOMINAL].holds and decided[WEIGHTS].holds):
        needs_digits = decided[NOMINAL].needs_digits or decided[WEIGHTS].needs_digits
        decided.update(
            {
                name: undecided(
                    "not examined: the nominal loop or a weight is not proved stable",
                    needs_digits=needs_digits,
                )
                for name in claim.claims
            }
        )
        return
    found = squared_magnitudes(axis)
    scaling = arb(
        to_rational(claim.scaling) ** 2
    )  # d^2 as a ball, which combines with every kind of quantity
    names = list(filter(open_still, claim.claims))
    aliased = [name for name in names if name in ALIASED.values()]
    if aliased:
        decided |= prove_with_aliases(
            claim, aliased, axis=axis, found=found, scaling=scaling, deadline=deadline
        )
    for name in [name for name in names if name not in aliased]:

        def inequalities(terms: Terms, name: str = name) -> list[Quantity]:
            return claim_inequalities(
                name, claim.reads, inverse=claim.inverse, t=terms, scaling=scaling
            )

        if axis.algebraic:
            decided[name] = _prove_on_half_line(
                axis,
                inequalities(polynomial_terms(found)),
                ends=inequalities(terms_at_infinity(found)),
                deadline=deadline,
            )
        else:
            decided[name] = positive_on_intervals(
                axis, found, inequalities=inequalities, deadline=deadline
            )


def _check_weights(axis: Axis) -> Decision:
    """Decide whether every pole of the weights is strictly stable, and every zero of the scaling of
    the plant.
    """
    parts = [(part.den, part.degree) for part in (axis.w, axis.P, axis.W) if part is not None]
    for polynomial, degree in parts + ([] if axis.W is None else [(axis.W.num, axis.W.degree)]):
        if not (found := routh(polynomial, degree)).holds:
            return found
    return proved()


def _prove_on_half_line(
    axis: Axis, expressions: list[Quantity], *, ends: list[Quantity], deadline: float
) -> Decision:
    """Prove polynomials in y = x^2 positive for all y >= 0, and at infinity."""
    for expression, end in zip(expressions, ends, strict=True):
        if not end > 0:
            text = f"not below the limit at {'the Nyquist' if axis.dt else 'infinite'} frequency"
            if end <= 0:
                return refuted(text)
            return undecided(text, needs_digits=True)
        found = positive_on_half_line(expression, deadline=deadline)
        if not found.holds:
            return _frequency_of(axis, found)
    return proved()


def _frequency_of(axis: Axis, found: Decision) -> Decision:
    """Return a decision with its place y on the axis replaced by the frequency [rad/s], for
    messages only.
    """
    from math import atan, sqrt

    if not found.violated_at >= 0:
        return found
    x = sqrt(found.violated_at)
    dt = int(axis.dt.p) / int(axis.dt.q)
    if dt:
        omega = 2 / dt * atan(x)
    else:
        omega = x
    return replace(found, violated_at=omega)
