"""Taylor models: a smooth function on a short interval as a polynomial and a ball for all that it leaves out.

A jet is a polynomial of degree `ORDER` in x, |x| <= 1, the interval being middle + x half. What a product or a
composition has beyond that degree is bounded by the sum of its coefficients and joins the constant as a ball, so the
error falls with the sixth power of the length: a function that nearly touches zero is still decided on few intervals.
"""

from __future__ import annotations

from typing import Any

__all__ = ["Jet", "cosine", "line", "lower_bound", "of_polynomial", "sine"]


ORDER = 5


class Jet:
    """A polynomial in x (arb_poly) of degree at most `ORDER` that encloses a function on [-1, 1]."""

    __slots__ = ("p",)

    def __init__(self, p: Any) -> None:
        self.p = p

    def __add__(self, other: Any) -> Jet:
        return Jet(self.p + (other.p if isinstance(other, Jet) else other))

    __radd__ = __add__

    def __sub__(self, other: Any) -> Jet:
        return Jet(self.p - (other.p if isinstance(other, Jet) else other))

    def __mul__(self, other: Any) -> Jet:
        return shortened(self.p * other.p) if isinstance(other, Jet) else Jet(self.p * other)

    __rmul__ = __mul__


def shortened(p: Any) -> Jet:
    """What lies beyond the order goes into the constant, as a ball."""
    from flint import arb, arb_poly

    coefficients = p.coeffs()
    if len(coefficients) <= ORDER + 1:
        return Jet(p)
    left = sum((abs(c) for c in coefficients[ORDER + 1 :]), arb(0)).abs_upper()
    return Jet(arb_poly([coefficients[0] + arb(0, left), *coefficients[1 : ORDER + 1]]))


def line(middle: Any, half: Any) -> Jet:
    """The variable itself: middle + half x."""
    from flint import arb_poly

    return Jet(arb_poly([middle, half]))


def sine_and_cosine(middle: Any, half: Any) -> tuple[Jet, Jet]:
    """sin and cos of middle + half x: their Taylor polynomials and half^(n+1)/(n+1)! for the rest."""
    from flint import arb, arb_poly

    at = (middle.sin(), middle.cos())
    cycle = (at[0], at[1], -at[0], -at[1], at[0])
    powers, factor = [], arb(1)
    for k in range(ORDER + 1):
        powers.append(factor)
        factor = factor * half / (k + 1)
    rest = arb(0, factor.abs_upper())
    out = []
    for phase in (0, 1):
        coefficients = [cycle[(k + phase) % 4] * powers[k] for k in range(ORDER + 1)]
        out.append(Jet(arb_poly([coefficients[0] + rest, *coefficients[1:]])))
    return out[0], out[1]


def sine(middle: Any, half: Any) -> Jet:
    """sin(middle + half x)."""
    return sine_and_cosine(middle, half)[0]


def cosine(middle: Any, half: Any) -> Jet:
    """cos(middle + half x)."""
    return sine_and_cosine(middle, half)[1]


def of_polynomial(p: Any, argument: Jet) -> Jet:
    """p of a jet, by the Taylor coefficients of p at the middle; those beyond the order are bounded by their sum."""
    from flint import arb, arb_poly

    middle = argument.p[0].mid()
    away = argument.p - middle
    reach = sum((abs(c) for c in away.coeffs()), arb(0)).abs_upper()
    coefficients = p(arb_poly([middle, 1])).coeffs() if p.degree() > 0 else p.coeffs()
    left = arb(0)
    for c in reversed(coefficients[ORDER + 1 :]):
        left = left * reach + abs(c)
    left *= reach ** (ORDER + 1)
    total = Jet(arb_poly([0]))
    moved = Jet(away)
    for c in reversed(coefficients[: ORDER + 1]):
        total = total * moved + c
    return total + arb(0, left.abs_upper())


def lower_bound(jet: Jet) -> Any:
    """A number that the jet does not fall below on [-1, 1]: its least Bernstein coefficient, rounded down."""
    from math import comb

    from flint import arb, arb_poly

    n = max(jet.p.degree(), 0)
    unit = jet.p(arb_poly([-1, 2]))  # on [0, 1]
    least = None
    for i in range(n + 1):
        c = sum((unit[k] * arb(comb(i, k)) / comb(n, k) for k in range(i + 1)), arb(0)).lower()
        if not c.is_finite():
            return arb.neg_inf()
        least = c if least is None or c < least else least
    return least
