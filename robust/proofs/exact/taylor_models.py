"""Taylor models: a smooth function on an interval as a polynomial and a ball for the remainder.

A jet is a polynomial of degree `_ORDER` in x, |x| <= 1, on the interval middle + x half. The terms
of a product or a composition beyond that degree are bounded by the sum of their coefficients and
added to the constant as a ball. So the error falls with the sixth power of the length: a function
that nearly touches zero is still decided on few intervals.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import lru_cache, partial
from math import comb, inf, sqrt
from typing import TypeAlias

from flint import arb, arb_mat, arb_poly, ctx

from robust.proofs.exact.conditions import Quantity, Terms
from robust.proofs.exact.polynomials import Decision, Polynomial, proved, refuted, undecided
from robust.proofs.exact.stability import Axis, SquaredPart, Squares, loop_terms, map_parts

_ORDER = 5
Summand: TypeAlias = "TaylorModel | arb | int"


class TaylorModel:
    """A polynomial in x (arb_poly) of degree at most `_ORDER` that encloses a function on
    [-1, 1].
    """

    __slots__ = ("p",)

    def __init__(self, p: arb_poly) -> None:
        self.p = p

    def __add__(self, other: Summand) -> TaylorModel:
        return TaylorModel(self.p + (other.p if isinstance(other, TaylorModel) else other))

    __radd__ = __add__

    def __sub__(self, other: Summand) -> TaylorModel:
        return TaylorModel(self.p - (other.p if isinstance(other, TaylorModel) else other))

    def __mul__(self, other: Summand) -> TaylorModel:
        if isinstance(other, TaylorModel):
            return _truncate(self.p * other.p)
        return TaylorModel(self.p * other)

    __rmul__ = __mul__


def _truncate(p: arb_poly) -> TaylorModel:
    """Return a Taylor model, with the terms beyond the order added to the constant as a ball."""
    coefficients = p.coeffs()
    if len(coefficients) <= _ORDER + 1:
        return TaylorModel(p)
    left = sum((abs(c) for c in coefficients[_ORDER + 1 :]), arb(0)).abs_upper()
    return TaylorModel(arb_poly([coefficients[0] + arb(0, left), *coefficients[1 : _ORDER + 1]]))


def linear_model(middle: arb, half: arb) -> TaylorModel:
    """Return the Taylor model of the variable, middle + half x."""
    return TaylorModel(arb_poly([middle, half]))


def _sine_and_cosine(middle: arb, half: arb) -> tuple[TaylorModel, TaylorModel]:
    """Return sin and cos of middle + half x: their Taylor polynomials, and half^(n+1)/(n+1)! for
    the remainder.
    """
    at = (middle.sin(), middle.cos())
    cycle = (at[0], at[1], -at[0], -at[1], at[0])
    powers, factor = [], arb(1)
    for k in range(_ORDER + 1):
        powers.append(factor)
        factor = factor * half / (k + 1)
    rest = arb(0, factor.abs_upper())
    out = []
    for phase in (0, 1):
        coefficients = [cycle[(k + phase) % 4] * powers[k] for k in range(_ORDER + 1)]
        out.append(TaylorModel(arb_poly([coefficients[0] + rest, *coefficients[1:]])))
    return out[0], out[1]


def sine(middle: arb, half: arb) -> TaylorModel:
    """Return sin(middle + half x)."""
    return _sine_and_cosine(middle, half)[0]


def cosine(middle: arb, half: arb) -> TaylorModel:
    """Return cos(middle + half x)."""
    return _sine_and_cosine(middle, half)[1]


def compose_polynomial(p: Polynomial, argument: TaylorModel) -> TaylorModel:
    """Return p of a jet by the Taylor coefficients of p at the middle; those beyond the order are
    bounded by a sum.
    """
    middle = argument.p[0].mid()
    away = argument.p - middle
    reach = sum((abs(c) for c in away.coeffs()), arb(0)).abs_upper()
    if p.degree() > 0:
        coefficients = p(arb_poly([middle, 1])).coeffs()
    else:
        coefficients = p.coeffs()
    left = arb(0)
    for c in reversed(coefficients[_ORDER + 1 :]):
        left = left * reach + abs(c)
    left *= reach ** (_ORDER + 1)
    return _truncate(arb_poly(coefficients[: _ORDER + 1])(away)) + arb(0, left.abs_upper())


@lru_cache(maxsize=64)
def _bernstein_matrix(n: int, precision: int) -> arb_mat:
    """Return the matrix from the coefficients of a polynomial of degree n to its Bernstein
    coefficients on [0, 1].
    """
    with ctx.workprec(precision):
        return arb_mat([[arb(comb(i, k)) / comb(n, k) for k in range(n + 1)] for i in range(n + 1)])


def lower_bound(jet: TaylorModel) -> arb:
    """Return a lower bound of the jet on [-1, 1]: its least Bernstein coefficient, rounded down."""
    n = max(jet.p.degree(), 0)
    unit = jet.p(arb_poly([-1, 2]))  # on [0, 1]
    column = arb_mat(n + 1, 1, [unit[k] for k in range(n + 1)])
    least = arb.pos_inf()
    for found in (_bernstein_matrix(n, ctx.prec) * column).entries():
        c = found.lower()
        if not c.is_finite():
            return arb.neg_inf()
        if c < least:
            least = c
    return least


# ---- Claims with a delay or a continuous weight are not polynomials: they are proved interval by
# interval.
#
# On an interval every term is a Taylor model in omega (`robust.proofs.exact.taylor_models`). The
# least Bernstein coefficient of an expression that must be positive decides. Intervals that fail
# are cut. In a continuous loop all frequencies beyond the last interval are decided at once, for
# any phase of the delay.

_MIN_RELATIVE_WIDTH = 1e-12
_NARROW = 1e-3  # of the frequency: width of intervals whose middle is examined
_MAX_INTERVALS = 50_000
_MAX_OMEGA = 1e18  # [rad/s]
_MIN_OMEGA_SHARE = 1e-30  # of the highest frequency

Inequalities = Callable[[Terms], list[Quantity]]


def positive_on_intervals(
    axis: Axis, found: Squares, *, inequalities: Inequalities, deadline: float
) -> Decision:
    """Prove that all expressions of the terms are positive from zero to Nyquist, or to infinity."""
    if axis.dt:
        # slightly beyond Nyquist, because pi is not a double
        top = float((arb.pi() / arb(axis.dt)).upper()) * (1 + 1e-15)
        terms = sampled_terms(axis, found)
    else:
        top = _tail_frequency(found, inequalities)
        if top == inf:
            return undecided("undecided at infinite frequency", needs_digits=True)
        terms = _delayed_terms(axis, found)

    def holds(low: float, high: float) -> bool:
        middle, half = (arb(low) + arb(high)) / 2, (arb(high) - arb(low)) / 2
        return all(lower_bound(jet) > 0 for jet in inequalities(terms(middle, half)))

    def at_point(omega: float) -> Decision:
        at = [jet.p[0] for jet in inequalities(terms(arb(omega), arb(0)))]
        if any(x <= 0 for x in at):
            return refuted("negative there", omega)
        if all(x > 0 for x in at):
            return proved()
        return undecided(f"undecided at {omega:.6g} rad/s", needs_digits=True)

    at_zero = at_point(0.0)
    if at_zero.holds:
        return bisect_axis(holds, at_point, top, deadline)
    return at_zero


def bisect_axis(
    holds: Callable[[float, float], bool],
    at_point: Callable[[float], Decision],
    top: float,
    deadline: float,
) -> Decision:
    """Cut the axis until a claim holds on every interval; the middle of a narrow one may refute it
    or leave it open.
    """
    todo = [(0.0, top)]
    for count in range(_MAX_INTERVALS):
        if not todo:
            return proved()
        low, high = todo.pop()
        if holds(low, high):
            continue
        if high - low <= _NARROW * high and not (found := at_point((low + high) / 2)).holds:
            return found  # if a point is undecided, no interval around it is decided
        if high - low <= _MIN_RELATIVE_WIDTH * high or high < _MIN_OMEGA_SHARE * top:
            return undecided(f"undecided near {high:.6g} rad/s", needs_digits=True)
        if time.thread_time() > deadline:
            return undecided(f"undecided after {count} intervals: the time limit was reached")
        if low == 0:
            cut = high / 16
        elif high > 4 * low:
            cut = sqrt(low) * sqrt(high)
        else:
            cut = (low + high) / 2
        todo += [(cut, high), (low, cut)]
    return undecided(f"undecided after {_MAX_INTERVALS} intervals")


def _delayed_terms(axis: Axis, found: Squares) -> Callable[[arb, arb], Terms]:
    """Return the terms of a continuous loop with its delay on an interval of omega."""
    tau = arb(axis.delay)

    def terms(middle: arb, half: arb) -> Terms:
        omega = linear_model(middle, half)
        y = omega * omega
        phase = middle * tau, half * tau
        G, K, w, P, W = map_parts(found, lambda part: _quotient_at(part, y))
        cross = compose_polynomial(found.even, y) * cosine(*phase) + compose_polynomial(
            found.odd, y
        ) * omega * sine(*phase)
        return loop_terms(G, K, w, P, W, cross=cross, closed=G[0] * K[0] + G[1] * K[1] + cross * 2)

    return terms


def sampled_terms(axis: Axis, found: Squares, samples: int = 0) -> Callable[[arb, arb], Terms]:
    """Return the terms of a sampled loop on an interval of omega, by polynomials in u = sin^2(omega
    dt/2).

    y = u/(1 - u). A delay of `samples` whole samples that is not in the plant enters by its exact
    phase; as poles at zero it would raise the degree of the polynomials.
    """
    dt = arb(axis.dt)
    G_in_sine, K_in_sine, w_in_sine, P_in_sine, W_in_sine = map_parts(found, _part_in_sine)
    # a timed weight is made of polynomials in omega^2
    w_known = found.w if axis.w_timed else w_in_sine
    P_known = found.P if axis.P_timed else P_in_sine
    n = found.G[2] + found.K[2]
    even = polynomial_in_sine(found.even, n)
    whole = polynomial_in_sine(found.closed, n)
    odd = polynomial_in_sine(found.odd, max(n - 1, 0))

    def terms(middle: arb, half: arb) -> Terms:
        omega = linear_model(middle, half)
        u = (cosine(middle * dt, half * dt) - 1) * arb("-0.5")
        y = omega * omega
        G, K = _quotient_at(G_in_sine, u), _quotient_at(K_in_sine, u)
        w = _quotient_at(w_known, y if axis.w_timed else u)
        if P_known is None:
            P = None
        else:
            P = _quotient_at(P_known, y if axis.P_timed else u)
        if W_in_sine is None:
            W = None
        else:
            W = _quotient_at(W_in_sine, u)
        cross, closed = compose_polynomial(even, u), compose_polynomial(whole, u)
        if samples:
            # x (1 - u) = sin(omega dt)/2: a part that is odd in x = tan(omega dt/2) has one power
            # of 1 - u less
            phase, turn = (middle * dt * samples, half * dt * samples), sine(middle * dt, half * dt)
            cross = cross * cosine(*phase) + compose_polynomial(odd, u) * turn * sine(*phase) * arb(
                "0.5"
            )
            closed = G[0] * K[0] + G[1] * K[1] + cross * 2
        return loop_terms(G, K, w, P, W, cross=cross, closed=closed)

    return terms


def _quotient_at(part: SquaredPart, argument: TaylorModel) -> tuple[TaylorModel, TaylorModel]:
    """Return numerator and denominator along a jet."""
    return compose_polynomial(part[0], argument), compose_polynomial(part[1], argument)


def _part_in_sine(part: SquaredPart) -> SquaredPart:
    """Return a part as polynomials in u = sin^2(omega dt/2); its own variable is y = u/(1 - u)."""
    num, den, degree = part
    return polynomial_in_sine(num, degree), polynomial_in_sine(den, degree), degree


def polynomial_in_sine(p: arb_poly, degree: int) -> arb_poly:
    """Return (1 - u)^degree p(u/(1 - u)), a polynomial in u."""
    kind = type(p)
    shifted = p(kind([-1, 1]))
    return kind([shifted[k] for k in range(degree, -1, -1)])(kind([1, -1]))


def reversed_polynomial(p: arb_poly, v: arb, degree: int) -> arb:
    """Return p(y) y^-degree at v = 1/y."""
    total = arb(0)
    for k in range(degree + 1):
        total = total * v + p[k]
    return total


def _ratio_at_infinity(part: SquaredPart, v: arb) -> tuple[arb, arb]:
    """Return numerator and denominator over their formal degree."""
    num, den, degree = part
    return reversed_polynomial(num, v, degree), reversed_polynomial(den, v, degree)


def _tail_frequency(found: Squares, inequalities: Inequalities) -> float:
    """Return a frequency above which the claim holds for any delay; inf if none is found."""
    omega = 1e-3
    while omega < _MAX_OMEGA:
        v = arb(0).union(1 / arb(omega) ** 2)
        G, K, w, P, W = map_parts(found, partial(_ratio_at_infinity, v=v))
        N, D = G[0] * K[0], G[1] * K[1]
        cross = arb(0, (N.abs_upper() * D.abs_upper()).sqrt().abs_upper())
        terms = loop_terms(G, K, w, P, W, cross=cross, closed=N + D + cross * 2)
        if all(x > 0 for x in inequalities(terms)):
            return omega
        omega *= 4
    return inf
