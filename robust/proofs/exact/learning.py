r"""The claim that the factor per trial of a learning filter is below a level, for a whole set.

J = G S is the nominal loop from u to y, r the relative radius of the set (|w|, |w/G|, all aliases
included). Over the set J_p/J is a disc with centre c and radius rho. The learning filter is L = F/J
with any F, so its factor |1 - L J_p| is at most |1 - F c| + |F| rho. The least of this over F is
rho/|c| if that is below one:

    x = rho/|c| = r |S| / |1 - r^2 T*|       inverse forms: x = |b|

It grows with r as long as r |T| < 1, so an upper bound of r gives one of x. The claim |Q| f(x) <
level, with f as in `LearningClaim`, is x < X on an interval with a largest |Q|. This is a
polynomial inequality in the terms of the loop (`conditions`), decided by Taylor models.
"""

from __future__ import annotations

import time
from dataclasses import replace
from math import cos, inf, pi, sqrt

from flint import arb, ctx

from nlfrf._base.values import value
from robust.proofs.exact.aliases import AliasBounds, aliased_terms, squared_line, upper_end
from robust.proofs.exact.claim import LoopClaim
from robust.proofs.exact.conditions import Quantity, Terms
from robust.proofs.exact.polynomials import Decision, proved, undecided
from robust.proofs.exact.stability import claim_on_axis, squared_magnitudes
from robust.proofs.exact.taylor_models import (
    bisect_axis,
    compose_polynomial,
    lower_bound,
    sampled_terms,
)

_BITS = (192, 320, 640)
_ROUNDING = 1e-9  # of a level: error bound of Q and X, which are doubles


@value
class LearningClaim:
    """A claim on a learning filter around a sampled loop."""

    loop: LoopClaim  # the loop and its set, which is robustly stable
    omega_Q: float  # cut-off of Q [rad/s]: Q is 1 up to it, cos^2 from there to zero at twice that
    # x up to which L = 1/(J c). From there to x = 1 it fades, so that the factor without Q is f(x)
    # = x up to `full`, then 1 - (1 - x)^2/(1 - full).
    full: float
    level: float  # upper bound of |Q| f(x); less than one

    def largest_ratio(self, omega: float) -> float:
        """Return X with |Q| f(x) <= level for x <= X at all frequencies from omega [rad/s] on; inf
        for any x.
        """
        share = min(max(omega / self.omega_Q - 1, 0.0), 1.0)
        Q = cos(pi / 2 * share) ** 2 + _ROUNDING
        wanted = self.level / Q * (1 - _ROUNDING)
        if wanted >= 1:
            return inf
        if wanted <= self.full:
            return wanted
        return 1 - sqrt((1 - wanted) * (1 - self.full))


def prove_learning(claim: LearningClaim, *, time_cap: float) -> Decision:
    """Prove a claim at every frequency up to Nyquist, from the given matrices; coprime factors have
    no such proof.
    """
    deadline = time.thread_time() + time_cap
    decision = undecided("the coprime form has no such proof")
    for bits in () if "M" in claim.loop.reads else _BITS:
        with ctx.workprec(bits):
            decision = _decide(claim, deadline)
        if not decision.needs_digits or time.thread_time() > deadline:
            break
    return decision


def _decide(claim: LearningClaim, deadline: float) -> Decision:
    """Decide the claim at the current precision."""
    loop = claim.loop
    axis = claim_on_axis(loop)
    found = squared_magnitudes(axis)
    aliases = None
    if loop.plant.dt:
        terms = sampled_terms(axis, found)
    else:
        aliases, terms, _ = aliased_terms(loop, "learning", axis=axis, found=found)

    def holds(low: float, high: float) -> bool:
        X = claim.largest_ratio(low)
        if not inf > X:
            return True
        a, b = arb(low), arb(high)
        t = terms((a + b) / 2, (b - a) / 2)
        if aliases is None:
            ways = [(loop.reads, t)]
        else:
            ways = _with_aliases(aliases, t, low=a, high=b)
        return any(
            all(
                lower_bound(part) > 0
                for part in _inequalities(reads, loop.inverse, t=seen, square=arb(X) ** 2)
            )
            for reads, seen in ways
        )

    def at_point(omega: float) -> Decision:
        if holds(omega, omega):
            return proved()
        return undecided(f"undecided at {omega:.6g} rad/s", needs_digits=True)

    top = float((arb.pi() / arb(axis.dt)).upper()) * (1 + 1e-15)
    return bisect_axis(holds, at_point, top, deadline)


def _inequalities(
    reads: tuple[str, ...], inverse: bool, *, t: Terms, square: arb
) -> list[Quantity]:
    """Return expressions that are positive if r |T| < 1 (|b| < 1) and x^2 < X^2 = square."""
    N, D = t.G_num * t.K_num, t.G_den * t.K_den
    if inverse:
        channel = t.w_num * (t.G_num if "G" in reads else t.G_den) * t.K_den
        return [t.w_den * t.closed * square - channel]
    if "G" in reads:  # r = |w|
        centre = (
            t.w_den * t.w_den * t.closed
            - t.w_num * t.w_den * (t.cross + N) * 2
            + t.w_num * t.w_num * N
        )
        return [t.w_den * t.closed - t.w_num * N, centre * square - t.w_num * t.w_den * D]
    KS = t.G_den * t.K_num  # r = |w|/|G|, all over |G|^2
    centre = (
        t.w_den * t.w_den * t.closed * t.G_num - t.w_num * t.w_den * t.G_den * (t.cross + N) * 2
    )
    centre = centre + t.w_num * t.w_num * t.G_den * KS
    return [t.w_den * t.closed - t.w_num * KS, centre * square - t.w_num * t.w_den * D * t.G_den]


def _with_aliases(
    aliases: AliasBounds, t: Terms, *, low: arb, high: arb
) -> list[tuple[tuple[str, ...], Terms]]:
    """Return the terms on an interval with an upper bound of the squared radius, with all aliases,
    for |w|^2.

    The radius is given twice: R = |h_0 F| + rest about G_d, and relative to |G_d|, with |h_0 G| <=
    |G_d|/(1 - share).
    """
    sums, w = aliases.sums(low, high), aliases.w.upper(low, high)
    hold_low, hold = aliases.hold(low, high)
    _, G_inverse = aliases.G.bounds(low, high)
    share, others = sums.G * G_inverse / hold_low, sums.F * G_inverse / hold_low
    y = squared_line(low, high)
    F_num, F_den = compose_polynomial(aliases.F.num, y), compose_polynomial(aliases.F.den, y)
    w_num, w_den = compose_polynomial(aliases.w.num, y), compose_polynomial(aliases.w.den, y)
    found: list[tuple[tuple[str, ...], Terms]] = []
    for reads, num, den, factor, first, rest in (
        (("K",), F_num, F_den, hold, aliases.F.upper(low, high), sums.F),
        (("G", "K"), w_num, w_den, 1 / (1 - share), w, others / (1 - share)),
    ):
        more = upper_end(rest * (2 * factor * first + rest))  # of (factor first + rest)^2
        if more.is_finite() and (reads == ("K",) or (aliases.through and share < 1)):
            found.append(
                (reads, replace(t, w_num=num * upper_end(factor) ** 2 + den * more, w_den=den))
            )
    return found
