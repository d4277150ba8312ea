"""Stability of polynomials and of loops with a delay, decided in exact or enclosed arithmetic.

Without a delay Routh's array decides (`robust.proofs.exact.polynomials`). With a delay the roots of
D + N exp(-s tau) are those of D + N at tau = 0. They cross the axis only at |D| = |N|, in the
direction in which |D| - |N| changes its sign (Cooke & van den Driessche 1986; Walton & Marshall
1987).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias, TypeVar

import numpy as np
from flint import acb, arb, arb_poly, ctx, fmpq, fmpq_poly

from nlfrf._base.values import value
from robust.proofs.exact.claim import LoopClaim, Matrices
from robust.proofs.exact.conditions import Quantity, Terms
from robust.proofs.exact.polynomials import (
    TOO_NEAR_BOUNDARY,
    Decision,
    Polynomial,
    Quotient,
    bilinear_image,
    complex_roots,
    delay_by_samples,
    proved,
    refuted,
    routh,
    to_rational,
    to_rational_matrix,
    transfer_quotient,
    undecided,
    zoh_quotient,
)

_MAX_BITS = 4096


def squared_magnitude(p: Polynomial) -> Polynomial:
    """Return |p(j x)|^2 as a polynomial in y = x^2."""
    return _alternate(type(p)((p * _alternate(p)).coeffs()[::2]))


def _hurwitz_with_delay(den: fmpq_poly, num: fmpq_poly, *, degree: int, delay: fmpq) -> Decision:
    """Decide whether every root of den + num exp(-s delay) lies in the open left half plane;
    fmpq_poly and fmpq.
    """
    total = den + num
    if total[0] == 0:
        return refuted("a pole at zero")
    if not abs(den[degree]) > abs(num[degree]):
        return refuted("the loop gain does not fall below one at infinite frequency")
    if total[degree] == 0:
        return undecided("the loop without its delay is not well posed", needs_digits=True)
    bits = 128
    while bits <= _MAX_BITS:
        with ctx.workprec(bits):
            outside = _roots_outside(total)
            if outside is not None:
                moved = _delay_crossings(den, num, arb(delay))
                if moved is not None:
                    count = outside + moved
                    if count == 0:
                        return proved()
                    return refuted(f"{count} poles are not stable")
        bits *= 4
    return undecided(TOO_NEAR_BOUNDARY, needs_digits=True)


def _roots_outside(p: fmpq_poly) -> int | None:
    """Return the number of roots of a fmpq_poly in the right half plane; None if one may lie on the
    axis.
    """
    count = 0
    for root, many in complex_roots(p):
        if root.real > 0:
            count += many
        elif not root.real < 0:
            return None
    return count


def _delay_crossings(den: fmpq_poly, num: fmpq_poly, delay: arb) -> int | None:
    """Return the number of roots of den + num exp(-s tau) that leave the left half plane up to the
    delay.
    """
    balance = squared_magnitude(den) - squared_magnitude(num)
    if balance.degree() <= 0:
        if balance[0] != 0:
            return 0
        return None
    count, pi = 0, arb.pi()
    for root, many in complex_roots(balance):
        if root.imag != 0 or root.real < 0:
            continue
        if not root.imag.is_zero() or not root.real > 0:
            if balance[0] == 0 and root.overlaps(acb(0)):
                continue  # at zero frequency nothing crosses: total[0] != 0
            return None
        omega = root.real.sqrt()
        s = acb(0, omega)
        ratio = -arb_poly(num)(s) / arb_poly(den)(
            s
        )  # exp(s tau) at a crossing: tau = (angle + 2 pi k)/omega
        angle = (
            ratio.arg() if ratio.real > 0 else (-ratio).arg() + pi
        )  # away from the cut of the argument
        turns = (omega * delay - angle) / (2 * pi)
        # crossings at tau > 0 have angle + 2 pi k > 0, those up to the delay k <= turns
        first, last = (-angle / (2 * pi)), turns
        low, high = _floor_or_none(first), _floor_or_none(last)
        if low is None or high is None:
            return None
        if many % 2:
            rising = _sign_of_slope(balance, root.real, many)
            if rising is None:
                return None
            count += 2 * (high - low) * rising
    return count


def _floor_or_none(x: arb) -> int | None:
    """Return floor(x), or None if the ball contains an integer."""
    floor = x.floor().unique_fmpz()
    if floor is None or x.contains_integer():
        return None
    return int(floor)


def _sign_of_slope(p: fmpq_poly, y: arb, order: int) -> int | None:
    """Return the sign of the first nonzero derivative at a root of this (odd) multiplicity."""
    for _ in range(order):
        p = p.derivative()
    slope = arb_poly(p)(y)
    if slope > 0:
        return 1
    if slope < 0:
        return -1
    return None


# ---- A claimed loop on one imaginary axis: its parts as polynomials at the working precision, and
# its terms along it.

WHOLE_SAMPLES, _WHOLE_SAMPLES_DISCRETE, _SAME_CLOCK = 1e-9, 1e-6, 1e-9


@value
class Axis:
    """The loop on s = j x: x is omega [rad/s], or tan(omega dt/2) for a sampled loop."""

    # G, K, w, P: plant (hold and delay by samples inside), controller, weights; P is None without
    # one
    G: Quotient
    K: Quotient
    w: Quotient
    P: Quotient | None
    # dt, delay: sampling time [s], 0 for continuous; delay [s] that is not in G (continuous loops)
    dt: fmpq
    delay: fmpq
    # w_timed, P_timed: True for a continuous weight around a sampled loop: it is a function of s =
    # j omega
    w_timed: bool
    P_timed: bool
    W: Quotient | None = None  # scaling of the plant, for coprime factors

    @property
    def algebraic(self) -> bool:
        """True if everything is a polynomial in one variable."""
        return bool(self.delay == 0) and not self.w_timed and not self.P_timed


def claim_on_axis(claim: LoopClaim) -> Axis:
    """Put the parts of a claim on one axis, by the rules of `LoopClaim`; a part that violates them
    is refused.
    """
    G, K, dt, delay = loop_on_axis(claim.plant, claim.controller, to_rational(claim.delay))
    w, w_timed = _weight_quotient("weight", claim.weight, dt)
    if claim.performance is None:
        P, P_timed = None, False
    else:
        P, P_timed = _weight_quotient("performance", claim.performance, dt)
    if "M" in claim.reads:
        W = _shaping_product(claim, dt)
    else:
        W = None
    return Axis(G=G, K=K, w=w, P=P, dt=dt, delay=delay, w_timed=w_timed, P_timed=P_timed, W=W)


def _shaping_product(claim: LoopClaim, dt: fmpq) -> Quotient:
    """Return the product of the shaping functions, on the axis of the loop."""
    if dt and not claim.plant.dt:
        raise ValueError(
            "plant must be sampled as the controller is for coprime factors, got a continuous one"
        )
    num = den = fmpq_poly([1])
    degree = 0
    for W in claim.shaping:
        part, timed = _weight_quotient("shaping", W, dt)
        if timed:
            raise ValueError("shaping must be sampled as the loop is, got a continuous one")
        num, den, degree = num * part.num, den * part.den, degree + part.degree
    return Quotient(num=num, den=den, degree=degree)


def loop_on_axis(
    plant: Matrices, K: Matrices, delay: fmpq
) -> tuple[Quotient, Quotient, fmpq, fmpq]:
    """Return plant and controller on one axis, the sampling time, and the delay [s] that is not in
    the plant.
    """
    dt = to_rational(plant.dt or K.dt)
    if plant.dt:
        if K.order and not _is_same_sampling_time(K.dt, plant.dt):
            raise ValueError(
                f"controller must have the sampling time of the plant, {plant.dt} s, got {K.dt} s"
            )
        samples = delay / dt
        whole = int((samples + to_rational(0.5)).floor())
        if abs(samples - whole) > to_rational(_WHOLE_SAMPLES_DISCRETE):
            raise ValueError(f"delay must be whole samples of {plant.dt} s, got {float(delay)} s")
        G = bilinear_image(delay_by_samples(transfer_quotient(plant), whole))
        delay = to_rational(0.0)
    elif dt:
        whole = int((delay / dt + to_rational(WHOLE_SAMPLES)).floor())
        rest = delay - whole * dt
        if rest < to_rational(WHOLE_SAMPLES) * dt:
            rest = to_rational(0.0)
        G, delay = bilinear_image(zoh_quotient(plant, dt, whole=whole, rest=rest)), to_rational(0.0)
    else:
        G = transfer_quotient(plant)
    return G, bilinear_image(transfer_quotient(K)) if dt else transfer_quotient(K), dt, delay


def _is_same_sampling_time(dt: float, other: float) -> bool:
    return abs(dt - other) <= _SAME_CLOCK * other


def _weight_quotient(name: str, system: Matrices, dt: fmpq) -> tuple[Quotient, bool]:
    """Return a weight as a quotient; and True if it is continuous around a sampled loop."""
    found = transfer_quotient(system)
    if system.order == 0:
        return found, False
    if system.dt:
        if not dt or not _is_same_sampling_time(system.dt, int(dt.p) / int(dt.q)):
            raise ValueError(
                f"{name} must be continuous or sampled as the loop is, got {system.dt} s"
            )
        return bilinear_image(found), False
    return found, bool(dt)


#: Numerator and denominator of a squared magnitude, and their formal degree.
SquaredPart: TypeAlias = tuple[arb_poly, arb_poly, int]


@value
class Squares:
    """Polynomials in y = x^2 (arb_poly, at the current precision) and their formal degrees.

    Those of the loop (G, K, closed) have one variable; those of a timed weight have omega^2. `even`
    and `odd` give N D* = even + j x odd, without the delay.
    """

    G: SquaredPart
    K: SquaredPart
    even: arb_poly
    odd: arb_poly
    closed: arb_poly
    w: SquaredPart
    P: SquaredPart | None
    W: SquaredPart | None = None


def product_with_conjugate(p: arb_poly, q: arb_poly) -> tuple[arb_poly, arb_poly]:
    """Return `even` and `odd` of p(j x) q(j x)* = even + j x odd, polynomials in y = x^2."""
    both = (p * _alternate(q)).coeffs()
    even, odd = (_alternate(arb_poly(part)) for part in (both[::2], both[1::2]))
    return even, odd


def _alternate(p: Polynomial) -> Polynomial:
    """Return p(-s)."""
    return type(p)([c if k % 2 == 0 else -c for k, c in enumerate(p.coeffs())])


def squared_magnitudes(axis: Axis) -> Squares:
    """Return the squared magnitudes of the parts of a loop."""
    G_num, G_den, K_num, K_den = (
        arb_poly(p) for p in (axis.G.num, axis.G.den, axis.K.num, axis.K.den)
    )
    N, D = G_num * K_num, G_den * K_den
    even, odd = product_with_conjugate(N, D)

    def of_weight(part: Quotient) -> SquaredPart:
        return (
            squared_magnitude(arb_poly(part.num)),
            squared_magnitude(arb_poly(part.den)),
            part.degree,
        )

    return Squares(
        G=(squared_magnitude(G_num), squared_magnitude(G_den), axis.G.degree),
        K=(squared_magnitude(K_num), squared_magnitude(K_den), axis.K.degree),
        even=even,
        odd=odd,
        closed=squared_magnitude(N + D),
        w=of_weight(axis.w),
        P=None if axis.P is None else of_weight(axis.P),
        W=None if axis.W is None else of_weight(axis.W),
    )


Pair: TypeAlias = tuple[Quantity, Quantity]
Made = TypeVar("Made")


def loop_terms(
    G: Pair, K: Pair, w: Pair, P: Pair | None, W: Pair | None, *, cross: Quantity, closed: Quantity
) -> Terms:
    """Return the terms from numerator and denominator of each part."""
    P, W = P or (None, None), W or (None, None)
    return Terms(
        G_num=G[0],
        G_den=G[1],
        K_num=K[0],
        K_den=K[1],
        cross=cross,
        closed=closed,
        w_num=w[0],
        w_den=w[1],
        P_num=P[0],
        P_den=P[1],
        W_num=W[0],
        W_den=W[1],
    )


def map_parts(
    found: Squares, pair: Callable[[SquaredPart], Made]
) -> tuple[Made, Made, Made, Made | None, Made | None]:
    """Return the results of `pair` for plant, controller and weights; None if absent."""
    P, W = (None if part is None else pair(part) for part in (found.P, found.W))
    return pair(found.G), pair(found.K), pair(found.w), P, W


def polynomial_terms(found: Squares) -> Terms:
    """Return the terms as polynomials in y, for a loop that is algebraic."""
    return loop_terms(
        *map_parts(found, lambda part: part[:2]), cross=found.even, closed=found.closed
    )


def terms_at_infinity(found: Squares) -> Terms:
    """Return the terms of the loop at infinite frequency: coefficients at the formal degrees."""
    n = found.G[2] + found.K[2]
    ends = map_parts(found, lambda part: (part[0][part[2]], part[1][part[2]]))
    return loop_terms(*ends, cross=found.even[n], closed=found.closed[n])


# ---- Stability of a loop or of a matrix of doubles, decided where floating point cannot decide.
#
# The characteristic polynomial of a matrix of doubles is exact over the rationals, and Routh's
# array decides stability in every case. A plant behind a hold has balls as coefficients, which are
# refined until they decide; only a pole exactly on the boundary stays undecided there.

_POLE_BITS = (256, 1024, 4096)


def decide_loop_stability(plant: Matrices, controller: Matrices, *, delay: float = 0.0) -> Decision:
    """Decide whether every pole of u = K (r - y) around the plant, hidden modes included, is
    strictly stable.

    Hold and delay are those of `LoopClaim`; the delay of a continuous loop is exact. The decision
    `holds` for a stable loop, and is `violated` for an unstable one.

    >>> import numpy as np
    >>> one = np.ones((1, 1))
    >>> def gain(k): return Matrices(A=np.zeros((0, 0)), B=np.zeros((0, 1)), C=np.zeros((1, 0)), D=k * one)
    >>> lag = Matrices(A=-one, B=one, C=one, D=0 * one)                       # 1/(s + 1): stable for K > -1
    >>> [decide_loop_stability(lag, gain(k)).holds for k in (-1.0, np.nextafter(-1, 0))]
    [False, True]
    """
    found = undecided("not examined", needs_digits=True)
    for bits in _POLE_BITS:
        with ctx.workprec(bits):
            G, K, _, rest = loop_on_axis(plant, controller, to_rational(delay))
            found = decide_quotient_stability(G, K, rest)
        if not found.needs_digits:
            break
    return found


def decide_matrix_stability(A: np.ndarray, *, discrete: bool = False) -> Decision:
    """Decide whether every eigenvalue of a matrix of doubles is in the open left half plane, or in
    the unit circle.

    >>> import numpy as np
    >>> [decide_matrix_stability(np.array([[0.0, 1.0], [-1.0, d]])).holds for d in (0.0, -5e-324, 5e-324)]
    [False, True, False]
    """
    n = len(A)
    if not n:
        return proved()
    p = to_rational_matrix(np.asarray(A, dtype=float)).charpoly()
    return routh(bilinear_image(Quotient(num=p, den=p, degree=n)).den if discrete else p, n)


def decide_quotient_stability(G: Quotient, K: Quotient, delay: fmpq) -> Decision:
    """Decide whether the loop of two quotients on one axis with a delay (fmpq) is stable, at the
    current precision.
    """
    if type(G.num) is type(K.num):
        kind = type(G.num)
    else:
        kind = arb_poly
    N: Polynomial = kind(G.num) * kind(K.num)
    D: Polynomial = kind(G.den) * kind(K.den)
    if delay > 0:
        return _hurwitz_with_delay(D, N, degree=G.degree + K.degree, delay=delay)
    return routh(N + D, G.degree + K.degree)
