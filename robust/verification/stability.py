"""Stability of polynomials and of loops with a delay, decided in exact or enclosed arithmetic.

Routh's array decides whether every root lies in the open left half plane: all of its first column positive. With a
delay the roots of D + N exp(-s tau) are those of D + N at tau = 0, moved across the axis only where |D| = |N|, in the
direction in which |D| - |N| changes sign there (Cooke & van den Driessche 1986; Walton & Marshall 1987).
"""

from __future__ import annotations

from typing import Any

from robust.verification.half_line import Decision, proved, refuted, undecided

__all__ = ["hurwitz", "hurwitz_with_delay", "routh", "squared"]


BITS = (192, 768, 3072)
MOST_BITS = 4096
BESIDE = "not told from the stability boundary"


def hurwitz(p: Any, degree: int) -> Decision:
    """Whether all `degree` roots of p lie in the open left half plane (a root at infinity does not).

    p is a fmpq_poly, where zero pivots say no, or an arb_poly, where balls that hold zero leave it undecided.

    >>> from flint import fmpq_poly
    >>> hurwitz(fmpq_poly([1, 3, 3, 1]), 3).holds, hurwitz(fmpq_poly([1, 1, 1, 1]), 3).holds     # a pair at +-j
    (True, False)
    """
    lead = p[degree]
    if lead < 0:
        p, lead = -p, -lead
    rows = [[p[k] for k in range(degree, -1, -2)], [p[k] for k in range(degree - 1, -1, -2)]]
    for _ in range(degree + 1):
        pivot = rows[0][0]
        if not pivot > 0:
            return refuted("a pole is not stable") if pivot <= 0 else undecided(BESIDE, needs_digits=True)
        above, below = rows
        if not below:
            break
        if not below[0] > 0:  # the next pivot
            rows = [below, []]
            continue
        ratio = pivot / below[0]
        padded = [*below[1:], *[0] * (len(above) - len(below))]
        rows = [below, [a - ratio * b for a, b in zip(above[1:], padded, strict=False)]]
    return proved()


def routh(p: Any, degree: int) -> Decision:
    """Routh's array in balls; for an exact polynomial in more and more digits, at last in rationals."""
    from flint import arb_poly, ctx

    if isinstance(p, arb_poly):
        return hurwitz(p, degree)
    for bits in BITS:
        with ctx.workprec(bits):
            found = hurwitz(arb_poly(p), degree)
        if not found.needs_digits:
            return found
    return hurwitz(p, degree)


def squared(p: Any) -> Any:
    """|p(j x)|^2 as a polynomial in y = x^2."""
    kind = type(p)
    mirrored = kind([c if k % 2 == 0 else -c for k, c in enumerate(p.coeffs())])
    both = (p * mirrored).coeffs()
    return kind([c if k % 2 == 0 else -c for k, c in enumerate(both[::2])])


def hurwitz_with_delay(den: Any, num: Any, degree: int, delay: Any) -> Decision:
    """Whether every root of den + num exp(-s delay) lies in the open left half plane; fmpq_poly and fmpq."""
    from flint import arb, ctx

    total = den + num
    if total[0] == 0:
        return refuted("a pole at zero")
    if not abs(den[degree]) > abs(num[degree]):
        return refuted("the loop gain does not fall below one at infinite frequency")
    if total[degree] == 0:
        return undecided("the loop without its delay is not well posed", needs_digits=True)
    bits = 128
    while bits <= MOST_BITS:
        with ctx.workprec(bits):
            outside = roots_outside(total)
            if outside is not None:
                moved = crossed(den, num, arb(delay))
                if moved is not None:
                    count = outside + moved
                    return proved() if count == 0 else refuted(f"{count} poles are not stable")
        bits *= 4
    return undecided(BESIDE, needs_digits=True)


def roots_outside(p: Any) -> int | None:
    """How many roots of a fmpq_poly lie in the right half plane; None where one cannot be told from the axis."""
    count = 0
    for root, many in p.numer().complex_roots():
        if root.real > 0:
            count += many
        elif not root.real < 0:
            return None
    return count


def crossed(den: Any, num: Any, delay: Any) -> int | None:
    """How many roots of den + num exp(-s tau) move out of the left half plane as tau grows from 0 to the delay."""
    from flint import acb, arb

    balance = squared(den) - squared(num)
    if balance.degree() <= 0:
        return 0 if balance[0] != 0 else None
    count, pi = 0, arb.pi()
    for root, many in balance.numer().complex_roots():
        if root.imag != 0 or root.real < 0:
            continue
        if not root.imag.is_zero() or not root.real > 0:
            if balance[0] == 0 and root.overlaps(acb(0)):
                continue  # at zero frequency nothing crosses: total[0] != 0
            return None
        omega = root.real.sqrt()
        s = acb(0, omega)
        ratio = -value(num, s) / value(den, s)  # exp(s tau) at a crossing: tau = (angle + 2 pi k)/omega
        angle = ratio.arg() if ratio.real > 0 else (-ratio).arg() + pi  # away from the cut of the argument
        turns = (omega * delay - angle) / (2 * pi)
        # crossings at tau > 0 have angle + 2 pi k > 0, those up to the delay k <= turns
        first, last = (-angle / (2 * pi)), turns
        low, high = whole_below(first), whole_below(last)
        if low is None or high is None:
            return None
        if many % 2:
            rising = sign_of_slope(balance, root.real, many)
            if rising is None:
                return None
            count += 2 * (high - low) * rising
    return count


def value(p: Any, s: Any) -> Any:
    """p(s) at a complex ball."""
    from flint import acb_poly

    return acb_poly([acb_coefficient(c) for c in p.coeffs()])(s)


def acb_coefficient(c: Any) -> Any:
    """A rational as a ball at the precision of the moment."""
    from flint import acb, arb

    return acb(arb(c))


def whole_below(x: Any) -> int | None:
    """floor(x), None where the ball holds an integer."""
    floor = x.floor().unique_fmpz()
    return None if floor is None or x.contains_integer() else int(floor)


def sign_of_slope(p: Any, y: Any, order: int) -> int | None:
    """The sign of the first derivative that does not vanish at a root of that multiplicity (odd)."""
    from flint import arb_poly

    for _ in range(order):
        p = p.derivative()
    slope = arb_poly(p)(y)
    return 1 if slope > 0 else -1 if slope < 0 else None
