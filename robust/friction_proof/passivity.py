"""Every passive friction at once: what damping a loop leaves at the friction port, over all frequencies.

A quotient of polynomials in y = x^2, with x = omega in a continuous loop and tan(omega T/2) in a sampled one, from the
numbers as they are given. Where it is least is looked for at its stationary points; that it is positive is proved over
the rationals, so that no resonance is too sharp to be seen.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from nlfrf.shared.values import value
from nlfrf.shared.wording import hertz
from robust.shared.states import FrictionVerdict
from robust.sliding.loop import SlidingLoop
from robust.sliding.machine import SlidingMachine
from robust.systems.lti import timebase
from robust.verification.claim import Matrices, as_given
from robust.verification.exact import behind_samples, mapped, quotient, rational
from robust.verification.half_line import positive_on_half_line
from robust.verification.poles import stable_loop
from robust.verification.stability import squared

__all__ = ["passive_verdict"]

#: What is said to be left, below the least that was found: of the size of the damping.
BELOW = 1e-6
#: Damping this small against that at high frequencies is none.
ROUNDING = 1e-9
#: More than this times the damping is missing without bound, as with integral action.
BOUNDLESS = 1e12
SECONDS = 20.0
MOST_STATES = 40


@value
class Damping:
    """What is left of it [Ns/m]: top/bottom over y >= 0, both of formal degree `degree`; `end` is that at infinity."""

    top: Any
    bottom: Any
    degree: int

    @property
    def end(self) -> float:
        """At the far end of the axis."""
        return ratio(self.top[self.degree], self.bottom[self.degree])

    def at(self, y: float) -> float:
        """At one place of the axis."""
        return ratio(self.top(rational(y)), self.bottom(rational(y))) if np.isfinite(y) else self.end


def passive_verdict(machine: SlidingMachine, K: Any, delay: float, loop: SlidingLoop) -> tuple[FrictionVerdict, str]:
    """Verdict and reason: "proved" where the loop is stable and leaves damping at the port at every frequency."""
    if loop.F.shape[0] > MOST_STATES:
        return (
            FrictionVerdict.NOT_DECIDED,
            f"the loop has {loop.F.shape[0]} states, and at most {MOST_STATES} are decided exactly",
        )
    seen = Matrices(A=machine.A, B=machine.B_force[:, None], C=machine.C_measured[None], D=np.zeros((1, 1)))
    if not stable_loop(seen, as_given(K), delay=delay).holds:
        return (
            FrictionVerdict.NOT_DECIDED,
            "the sliding loop, with all states of its controller, is not strictly stable: one may drift at rest",
        )
    if loop.T:
        why = not_one_mass(machine, delay / loop.T)
        if why:
            return FrictionVerdict.NOT_DECIDED, why
        c, _ = mass_and_damper(machine)
        left = sampled_damping(c, K, delay)
    else:
        c, left = np.nan, continuous_damping(loop)
    return judged(left, c, loop.T)


def not_one_mass(machine: SlidingMachine, samples: float) -> str:
    """Why the criterion of Colgate and Schenkel does not speak of this loop; empty where it does."""
    collocated = np.array_equal(machine.B_force, machine.B_port)
    collocated &= np.array_equal(machine.C_measured, machine.C_port)
    if not collocated or machine.A.shape[0] != 2 or not mass_and_damper(machine)[1] > 0:
        return "a sampled loop is decided for one mass with force, friction and sensor at one place only"
    if np.abs(samples - np.round(samples)) > 1e-9:
        return "a delay of part of a sample is not in the criterion"
    return ""


def mass_and_damper(machine: SlidingMachine) -> tuple[float, float]:
    """Damping [Ns/m] and 1/mass [1/kg] of a machine of two states, in whatever coordinates."""
    mobility = float(machine.velocity @ machine.B_port)
    return float(-np.trace(machine.A) / mobility) if mobility else np.nan, mobility


def parts(num: Any, den: Any) -> tuple[Any, Any]:
    """(even, odd) of num den* = even(x^2) + j x odd(x^2) on s = j x."""
    kind = type(num)
    both = (num * kind([c if k % 2 == 0 else -c for k, c in enumerate(den.coeffs())])).coeffs()

    def signed(coefficients: list[Any]) -> Any:
        return kind([c if k % 2 == 0 else -c for k, c in enumerate(coefficients)])

    return signed(both[::2]), signed(both[1::2])


def continuous_damping(loop: SlidingLoop) -> Damping:
    """Real part of the impedance 1/(s X) at the port, X = num/den from a force to the displacement there."""
    n = loop.F.shape[0]
    X = quotient(Matrices(A=loop.F, B=-loop.B[:, None], C=loop.x[None], D=np.zeros((1, 1))))
    num = type(X.num)(X.num.coeffs()[: n - 1])  # a force does not move what has mass at once: what is left is rounding
    _, odd = parts(num, X.den)
    return Damping(top=-odd, bottom=squared(num), degree=n - 2)


def sampled_damping(c: float, K: Any, delay: float) -> Damping:
    """c less (T/2)/(1 - cos wT) Re[(1 - exp(-jwT)) K(exp(jwT))] (Colgate & Schenkel 1997), a delay in K.

    With x = tan(wT/2) what is needed is (T/2)(Re K - Im K/x).
    """
    T = timebase(K)
    late = mapped(behind_samples(quotient(as_given(K)), round(delay / T)))
    even, odd = parts(late.num, late.den)
    size = squared(late.den)
    return Damping(
        top=size * rational(c) - (even - odd) * (rational(T) / rational(2.0)), bottom=size, degree=late.degree
    )


def judged(left: Damping, c: float, T: float) -> tuple[FrictionVerdict, str]:
    """The verdict on what is left: more than nothing at every frequency, as is proved over the rationals."""
    y, least = smallest(left)
    where = place(y, T)
    size = np.abs(c) if T else np.abs(left.end)
    if not least > ROUNDING * size:
        words = f"c = {c:.4g} Ns/m, and {c - least:.4g} Ns/m are needed" if T else f"{-least:.4g} Ns/m are missing"
        if -least > BOUNDLESS * size:
            words = "no damping is enough"
        return FrictionVerdict.NOT_DECIDED, f"not passive {where}: {words}"
    claimed = least - BELOW * max(least, size) if least > 2 * BELOW * size else least / 2
    rest = left.top - left.bottom * rational(claimed)
    found = positive_on_half_line(rest, deadline=time.thread_time() + SECONDS)
    if not (found.holds and rest[left.degree] > 0):
        return (
            FrictionVerdict.NOT_DECIDED,
            f"not shown that damping is left at every frequency: {found.reason or 'not at the end'}",
        )
    needed = f"c = {c:.4g} Ns/m, and at most {c - claimed:.4g} Ns/m are needed"
    words = needed if T else f"at least {claimed:.4g} Ns/m of damping is left at the friction port"
    return FrictionVerdict.PROVED, f"{words} (most critical {where}; proved for all frequencies)"


def smallest(left: Damping) -> tuple[float, float]:
    """About where it is least, and what it is there; nothing rests on it, as it is proved afterwards."""
    slope = left.top.derivative() * left.bottom - left.top * left.bottom.derivative()
    roots = slope.numer().complex_roots() if slope.degree() > 0 else []
    places = [0.0, np.inf, *(float(root.real.mid()) for root, _ in roots)]
    values = [(left.at(y), y) for y in places if y >= 0]
    least, y = min(values)
    return y, least


def ratio(top: Any, bottom: Any) -> float:
    """A quotient of rationals as a double; minus infinity where there is nothing but nothing below."""
    if bottom == 0:
        return np.inf if top > 0 else -np.inf
    found = top / bottom
    try:
        return int(found.p) / int(found.q)
    except OverflowError:
        return np.inf if found > 0 else -np.inf


def place(y: float, T: float) -> str:
    """A place on the axis, to be read."""
    omega = 2 / T * np.arctan(np.sqrt(y)) if T else np.sqrt(y)
    return f"at {hertz(float(omega))}" if np.isfinite(omega) else "towards high frequencies"
