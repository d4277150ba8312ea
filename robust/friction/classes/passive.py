"""Passive friction: the loop comes to rest if it has damping at the friction port at all
frequencies.

The damping is a quotient of polynomials in y = x^2, with x = omega in a continuous loop and
tan(omega T/2) in a sampled one, computed from the numbers as given. Its smallest value is searched
at its stationary points. Its positivity is proved over the rationals, so no resonance is too narrow
to be found.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np

from nlfrf._base.arguments import format_hertz
from nlfrf._base.values import value
from robust._base.states import FrictionVerdict
from robust.friction.loop import FrictionLoop
from robust.friction.plant import FrictionPlant
from robust.friction.proof.protocol import FrictionClass, FrictionProof, ProofTask
from robust.lti.lti import timebase
from robust.proofs.exact.claim import Matrices, to_matrices
from robust.proofs.exact.polynomials import (
    Coefficient,
    Polynomial,
    bilinear_image,
    complex_roots,
    delay_by_samples,
    positive_on_half_line,
    to_rational,
    transfer_quotient,
)
from robust.proofs.exact.stability import decide_loop_stability, squared_magnitude

if TYPE_CHECKING:
    import control

#: Distance of the claimed damping below the smallest value found, relative to the damping.
_MIN_DAMPING_SHARE = 1e-6
#: Damping this small, relative to that at high frequencies, is zero.
_ROUNDING = 1e-9
#: Missing damping above this multiple of the damping is unbounded, as with integral action.
_INFINITE_DAMPING = 1e12
_MAX_STATES = 40


@value
class _Damping:
    """Remaining damping [Ns/m]: top/bottom over y >= 0, both of formal degree `degree`; `end` is
    its limit.
    """

    top: Polynomial
    bottom: Polynomial
    degree: int

    @property
    def end(self) -> float:
        """Limit for y to infinity."""
        return _quotient_as_float(self.top[self.degree], self.bottom[self.degree])

    def at(self, y: float) -> float:
        if np.isfinite(y):
            return _quotient_as_float(self.top(to_rational(y)), self.bottom(to_rational(y)))
        return self.end


@value(kw_only=False)
class Passive(FrictionClass):
    """Class of all passive friction laws, int f v dt >= -E0.

    Passive friction never returns more energy than it received. Not all friction is passive: LuGre
    is passive only if sigma2 >= sigma1 (Fs - Fc)/Fc.

    Fields
    ------
    position_unit : str
        "m", or "rad" with Nm.

    Raises
    ------
    ValueError
        Another unit.

    References
    ----------
    N. Barabanov, R. Ortega, IEEE Trans. Automatic Control 45, 2000 (when LuGre is passive).

    Examples
    --------
    >>> Passive().description
    'passive friction'
    """

    excluded: ClassVar[str] = "LuGre with less damping than sigma1 (Fs - Fc)/Fc, "
    description: ClassVar[str] = "passive friction"

    def decide(
        self, undecided: FrictionProof, task: ProofTask, others: Sequence[Self] = ()
    ) -> FrictionProof:
        """Return "proved" if the loop is stable and strictly passive at the friction port."""
        verdict, reason = _decide_passivity(task)
        return replace(undecided, verdict=verdict, reason=reason)


def _decide_passivity(task: ProofTask) -> tuple[FrictionVerdict, str]:
    machine, K, delay, loop, _ = task
    if loop.F.shape[0] > _MAX_STATES:
        return (
            FrictionVerdict.NOT_DECIDED,
            (
                f"the loop has {loop.F.shape[0]} states; the exact decision takes at most"
                f" {_MAX_STATES}"
            ),
        )
    matrices = Matrices(
        A=machine.A, B=machine.B_force[:, None], C=machine.C_measured[None], D=np.zeros((1, 1))
    )
    if not decide_loop_stability(matrices, to_matrices(K), delay=delay).holds:
        return (
            FrictionVerdict.NOT_DECIDED,
            (
                "the sliding loop, with all states of its controller, is not strictly stable: a"
                " state may drift at rest"
            ),
        )
    if loop.T:
        why = _not_single_mass(machine, delay / loop.T)
        if why:
            return FrictionVerdict.NOT_DECIDED, why
        c, _ = _mass_and_damping(machine)
        left = _sampled_damping(c, K, delay)
    else:
        c, left = np.nan, _continuous_damping(loop)
    return _decide_damping(left, c, loop.T, unit=machine.units.damping)


def _not_single_mass(machine: FrictionPlant, samples: float) -> str:
    """Return the reason why the criterion of Colgate and Schenkel does not apply to this loop;
    empty if it does.
    """
    collocated = np.array_equal(machine.B_force, machine.B_port)
    collocated &= np.array_equal(machine.C_measured, machine.C_port)
    if not collocated or machine.A.shape[0] != 2 or not _mass_and_damping(machine)[1] > 0:
        return (
            "a sampled loop is decided only for one mass with force, friction and sensor at one"
            " place"
        )
    if np.abs(samples - np.round(samples)) > 1e-9:
        return "the criterion takes a delay of whole samples only"
    return ""


def _mass_and_damping(machine: FrictionPlant) -> tuple[float, float]:
    """Return damping [Ns/m] and 1/mass [1/kg] of a machine with two states, in any coordinates."""
    mobility = float(machine.velocity @ machine.B_port)
    return float(-np.trace(machine.A) / mobility) if mobility else np.nan, mobility


def _even_and_odd_part(num: Polynomial, den: Polynomial) -> tuple[Polynomial, Polynomial]:
    """Return (even, odd) with num den* = even(x^2) + j x odd(x^2) on s = j x."""
    kind = type(num)
    both = (num * kind([c if k % 2 == 0 else -c for k, c in enumerate(den.coeffs())])).coeffs()

    def signed(coefficients: list[Coefficient]) -> Polynomial:
        return kind([c if k % 2 == 0 else -c for k, c in enumerate(coefficients)])

    return signed(both[::2]), signed(both[1::2])


def _continuous_damping(loop: FrictionLoop) -> _Damping:
    """Return the real part of the impedance 1/(s X) at the port, with X = num/den from force to
    displacement there.
    """
    n = loop.F.shape[0]
    X = transfer_quotient(
        Matrices(A=loop.F, B=-loop.B[:, None], C=loop.x[None], D=np.zeros((1, 1)))
    )
    num = type(X.num)(
        X.num.coeffs()[: n - 1]
    )  # a mass does not move at once under a force: the rest is rounding
    _, odd = _even_and_odd_part(num, X.den)
    return _Damping(top=-odd, bottom=squared_magnitude(num), degree=n - 2)


def _sampled_damping(c: float, K: control.StateSpace, delay: float) -> _Damping:
    """Return c minus (T/2)/(1 - cos wT) Re[(1 - exp(-jwT)) K(exp(jwT))] (Colgate & Schenkel 1997),
    the delay in K.

    With x = tan(wT/2) the damping needed is (T/2)(Re K - Im K/x).
    """
    T = timebase(K)
    late = bilinear_image(delay_by_samples(transfer_quotient(to_matrices(K)), round(delay / T)))
    even, odd = _even_and_odd_part(late.num, late.den)
    size = squared_magnitude(late.den)
    return _Damping(
        top=size * to_rational(c) - (even - odd) * (to_rational(T) / to_rational(2.0)),
        bottom=size,
        degree=late.degree,
    )


def _decide_damping(
    left: _Damping, c: float, T: float, *, unit: str
) -> tuple[FrictionVerdict, str]:
    """Return the verdict on the remaining damping, proved over the rationals."""
    y, least = _least_damping(left)
    where = _frequency_of(y, T)
    if T:
        size = np.abs(c)
    else:
        size = np.abs(left.end)
    if not least > _ROUNDING * size:
        if T:
            words = f"c = {c:.4g} {unit}, and {c - least:.4g} {unit} are needed"
        else:
            words = f"{-least:.4g} {unit} are missing"
        if -least > _INFINITE_DAMPING * size:
            words = "no damping is enough"
        return FrictionVerdict.NOT_DECIDED, f"not passive {where}: {words}"
    if least > 2 * _MIN_DAMPING_SHARE * size:
        claimed = least - _MIN_DAMPING_SHARE * max(least, size)
    else:
        claimed = least / 2
    rest = left.top - left.bottom * to_rational(claimed)
    found = positive_on_half_line(rest)
    if not (found.holds and rest[left.degree] > 0):
        return (
            FrictionVerdict.NOT_DECIDED,
            (
                "damping at every frequency is not proved: "
                f"{found.reason or 'the limit at high frequencies is not positive'}"
            ),
        )
    needed = f"c = {c:.4g} {unit}, and at most {c - claimed:.4g} {unit} are needed"
    if T:
        words = needed
    else:
        words = f"at least {claimed:.4g} {unit} of damping is left at the friction port"
    return FrictionVerdict.PROVED, f"{words} (most critical {where}; proved for all frequencies)"


def _least_damping(left: _Damping) -> tuple[float, float]:
    """Return the smallest damping and its y approximately, for the report only."""
    slope = left.top.derivative() * left.bottom - left.top * left.bottom.derivative()
    if slope.degree() > 0:
        roots = complex_roots(slope)
    else:
        roots = []
    places = [0.0, np.inf, *(float(root.real.mid()) for root, _ in roots)]
    values = [(left.at(y), y) for y in places if y >= 0]
    least, y = min(values)
    return y, least


def _quotient_as_float(top: Coefficient, bottom: Coefficient) -> float:
    """Return a quotient of rationals as a double; plus or minus infinity for a zero denominator."""
    if bottom == 0:
        if top > 0:
            return np.inf
        return -np.inf
    found = top / bottom
    try:
        return int(found.p) / int(found.q)
    except OverflowError:
        if found > 0:
            return np.inf
        return -np.inf


def _frequency_of(y: float, T: float) -> str:
    """Describe the frequency of a point y on the axis, for the report."""
    if T:
        omega = 2 / T * np.arctan(np.sqrt(y))
    else:
        omega = np.sqrt(y)
    if np.isfinite(omega):
        return f"at {format_hertz(float(omega))}"
    return "towards high frequencies"
