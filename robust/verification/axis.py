"""A claimed loop on one imaginary axis: its parts as polynomials at the working precision, its terms along the axis."""

from __future__ import annotations

from typing import Any

import numpy as np

from nlfrf.shared.values import value
from robust.verification.claim import LoopClaim, Matrices
from robust.verification.conditions import Terms
from robust.verification.exact import Quotient, behind_samples, held, mapped, quotient, rational
from robust.verification.stability import squared

__all__ = [
    "WHOLE_SAMPLES",
    "Axis",
    "Squares",
    "at_infinity",
    "axis_of",
    "loop_axis",
    "polynomials",
    "squares",
]


UNITY = Matrices(A=np.zeros((0, 0)), B=np.zeros((0, 1)), C=np.zeros((1, 0)), D=np.ones((1, 1)))
WHOLE_SAMPLES, WHOLE_SAMPLES_DISCRETE, SAME_CLOCK = 1e-9, 1e-6, 1e-9


@value
class Axis:
    """The loop on s = j x: x is omega [rad/s] in a continuous loop, tan(omega dt/2) in a sampled one.

    Fields
    ------
    G, K, w, P : Quotient
        Plant (hold and delay by samples inside), controller, weights; P is None without one.
    W : Quotient or None
        What the plant is scaled by, for coprime factors.
    dt, delay : fmpq
        Sampling time [s], 0 for continuous; delay [s] that is not in G (continuous loops).
    w_timed, P_timed : bool
        Whether a weight is continuous around a sampled loop: then it lives on s = j omega.
    """

    G: Quotient
    K: Quotient
    w: Quotient
    P: Quotient | None
    dt: Any
    delay: Any
    w_timed: bool
    P_timed: bool
    W: Quotient | None = None

    @property
    def algebraic(self) -> bool:
        """Whether everything is a polynomial in one variable."""
        return bool(self.delay == 0) and not self.w_timed and not self.P_timed


def axis_of(claim: LoopClaim) -> Axis:
    """Put the parts of a claim on one axis, by the rules that `LoopClaim` states, or refuse with a ValueError."""
    G, K, dt, delay = loop_axis(claim.plant, claim.controller, claim.delay)
    w, w_timed = weight("weight", claim.weight, dt)
    P, P_timed = (None, False) if claim.performance is None else weight("performance", claim.performance, dt)
    W = shaping(claim, dt) if "M" in claim.reads else None
    return Axis(G=G, K=K, w=w, P=P, dt=dt, delay=delay, w_timed=w_timed, P_timed=P_timed, W=W)


def shaping(claim: LoopClaim, dt: Any) -> Quotient:
    """The product of the shaping functions, on the axis of the loop."""
    if dt and not claim.plant.dt:
        raise ValueError("plant must be sampled as the controller is for coprime factors, got a continuous one")
    num = den = quotient(UNITY).num
    degree = 0
    for W in claim.shaping:
        part, timed = weight("shaping", W, dt)
        if timed:
            raise ValueError("shaping must be sampled as the loop is, got a continuous one")
        num, den, degree = num * part.num, den * part.den, degree + part.degree
    return Quotient(num=num, den=den, degree=degree)


def loop_axis(plant: Matrices, K: Matrices, seconds: Any) -> tuple[Quotient, Quotient, Any, Any]:
    """Plant and controller on one axis, the sampling time, and the delay [s] that is not in the plant.

    `seconds` is a double or a rational.
    """
    delay = rational(seconds) if isinstance(seconds, float) else seconds
    dt = rational(plant.dt or K.dt)
    if plant.dt:
        if K.order and not same_clock(K.dt, plant.dt):
            raise ValueError(f"controller must have the sampling time of the plant, {plant.dt} s, got {K.dt} s")
        samples = delay / dt
        whole = int((samples + rational(0.5)).floor())
        if abs(samples - whole) > rational(WHOLE_SAMPLES_DISCRETE):
            raise ValueError(f"delay must be whole samples of {plant.dt} s, got {seconds} s")
        G, delay = mapped(behind_samples(quotient(plant), whole)), rational(0.0)
    elif dt:
        whole = int((delay / dt + rational(WHOLE_SAMPLES)).floor())
        rest = delay - whole * dt
        if rest < rational(WHOLE_SAMPLES) * dt:
            rest = rational(0.0)
        G, delay = mapped(held(plant, dt, whole, rest)), rational(0.0)
    else:
        G = quotient(plant)
    return G, mapped(quotient(K)) if dt else quotient(K), dt, delay


def same_clock(dt: float, other: float) -> bool:
    """Whether two sampling times are the same but for rounding."""
    return abs(dt - other) <= SAME_CLOCK * other


def weight(name: str, system: Matrices, dt: Any) -> tuple[Quotient, bool]:
    """A weight as a quotient, and whether it is continuous around a sampled loop."""
    found = quotient(system)
    if system.order == 0:
        return found, False
    if system.dt:
        if not dt or not same_clock(system.dt, int(dt.p) / int(dt.q)):
            raise ValueError(f"{name} must be continuous or sampled as the loop is, got {system.dt} s")
        return mapped(found), False
    return found, bool(dt)


@value
class Squares:
    """Polynomials in y = x^2 (arb_poly, at the precision of the moment) and their formal degrees.

    Those of the loop (G, K, closed) all belong to one variable, those of a timed weight to omega^2. `even` and `odd`
    make N D* = even + j x odd, without the delay.
    """

    G: tuple[Any, Any, int]
    K: tuple[Any, Any, int]
    even: Any
    odd: Any
    closed: Any
    w: tuple[Any, Any, int]
    P: tuple[Any, Any, int] | None
    W: tuple[Any, Any, int] | None = None


def squares(axis: Axis) -> Squares:
    """The squared magnitudes of what the loop is made of."""
    from flint import arb_poly

    G_num, G_den, K_num, K_den = (arb_poly(p) for p in (axis.G.num, axis.G.den, axis.K.num, axis.K.den))
    N, D = G_num * K_num, G_den * K_den
    both = (N * arb_poly([c if k % 2 == 0 else -c for k, c in enumerate(D.coeffs())])).coeffs()

    def signed(coefficients: list[Any]) -> Any:
        return arb_poly([c if k % 2 == 0 else -c for k, c in enumerate(coefficients)])

    def of_weight(part: Quotient) -> tuple[Any, Any, int]:
        return squared(arb_poly(part.num)), squared(arb_poly(part.den)), part.degree

    return Squares(
        G=(squared(G_num), squared(G_den), axis.G.degree),
        K=(squared(K_num), squared(K_den), axis.K.degree),
        even=signed(both[::2]),
        odd=signed(both[1::2]),
        closed=squared(N + D),
        w=of_weight(axis.w),
        P=None if axis.P is None else of_weight(axis.P),
        W=None if axis.W is None else of_weight(axis.W),
    )


def polynomials(found: Squares) -> Terms:
    """The terms as polynomials in y, where everything is one."""
    P_num, P_den = (None, None) if found.P is None else found.P[:2]
    W_num, W_den = (None, None) if found.W is None else found.W[:2]
    return Terms(
        G_num=found.G[0],
        G_den=found.G[1],
        K_num=found.K[0],
        K_den=found.K[1],
        cross=found.even,
        closed=found.closed,
        w_num=found.w[0],
        w_den=found.w[1],
        P_num=P_num,
        P_den=P_den,
        W_num=W_num,
        W_den=W_den,
    )


def at_infinity(found: Squares) -> Terms:
    """The same at the far end of the axis: coefficients at the formal degrees."""
    n, m = found.G[2], found.K[2]
    P_num, P_den = (None, None) if found.P is None else (found.P[0][found.P[2]], found.P[1][found.P[2]])
    W_num, W_den = (None, None) if found.W is None else (found.W[0][found.W[2]], found.W[1][found.W[2]])
    return Terms(
        G_num=found.G[0][n],
        G_den=found.G[1][n],
        K_num=found.K[0][m],
        K_den=found.K[1][m],
        cross=found.even[n + m],
        closed=found.closed[n + m],
        w_num=found.w[0][found.w[2]],
        w_den=found.w[1][found.w[2]],
        P_num=P_num,
        P_den=P_den,
        W_num=W_num,
        W_den=W_den,
    )
