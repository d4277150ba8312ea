"""Transfer functions as quotients of polynomials whose coefficients are exact rationals, or balls
that contain them.

A stored double is a rational number and is used as such. For a single-loop system, with D(s) =
det(s - A), C adj(s - A) B = D(s) - det(s - A - B C): hidden modes are kept. A plant behind a hold
has the exponential of its matrix, enclosed with its remainder. Discrete systems are moved from the
unit circle to the imaginary axis by z = (1 + s)/(1 - s), which is exact.
"""

from __future__ import annotations

import time
from enum import Enum, auto
from typing import Any, TypeAlias

import numpy as np
from flint import acb, arb, arb_mat, arb_poly, ctx, fmpq, fmpq_mat, fmpq_poly

from nlfrf._base.values import value
from robust._base.states import Outcome
from robust.proofs.exact.claim import Matrices

#: A `fmpq_poly` or an `arb_poly`, and its coefficients `fmpq` or `arb`. Code for both makes objects
#: of the given kind, `type(p)`, and a union type does not express that two objects are of one kind.
Polynomial: TypeAlias = Any
Coefficient: TypeAlias = Any


@value
class Quotient:
    """num/den as polynomials in s or z (python-flint), both with a formal degree of at most
    `degree`.
    """

    num: Polynomial
    den: Polynomial
    degree: int


def to_rational(x: float) -> fmpq:
    """Return a double as its exact rational number (fmpq)."""
    return fmpq(*float(x).as_integer_ratio())


def to_rational_matrix(matrix: np.ndarray) -> fmpq_mat:
    return fmpq_mat(len(matrix), matrix.shape[1], [to_rational(x) for x in matrix.ravel()])


def transfer_quotient(system: Matrices) -> Quotient:
    """Return the transfer function of a single-loop system, exactly.

    >>> import numpy as np
    >>> A, B, C, D = np.array([[-2.0]]), np.ones((1, 1)), np.ones((1, 1)), np.array([[0.5]])
    >>> g = transfer_quotient(Matrices(A=A, B=B, C=C, D=D))                  # 1/(s + 2) + 1/2 = (s/2 + 2)/(s + 2)
    >>> str(g.num), str(g.den)
    ('1/2*x + 2', 'x + 2')
    """
    direct = to_rational(system.D[0, 0])
    if system.order == 0:
        return Quotient(num=fmpq_poly([direct]), den=fmpq_poly([1]), degree=0)
    A = to_rational_matrix(system.A)
    den = A.charpoly()
    num = den - (A + to_rational_matrix(system.B) * to_rational_matrix(system.C)).charpoly()
    return Quotient(num=num + direct * den, den=den, degree=system.order)


def delay_by_samples(system: Quotient, whole: int) -> Quotient:
    """Return a discrete system with a delay of whole samples."""
    return Quotient(num=system.num, den=system.den.left_shift(whole), degree=system.degree + whole)


def zoh_quotient(plant: Matrices, dt: fmpq, *, whole: int, rest: fmpq) -> Quotient:
    """Return a continuous plant with zero-order hold, a delay of whole dt + rest, and sampler, as a
    discrete system.

    For rest > 0 the input changes inside a sample (Åström & Wittenmark, 3rd ed., 2.3). The
    coefficients are balls that contain the exponentials; dt and rest are rationals.
    """
    direct = arb(to_rational(plant.D[0, 0]))
    n, memory = plant.order, whole + (1 if rest > 0 else 0)
    if n == 0:
        num, den = arb_poly([0]), arb_poly([1])
    else:
        both = [[to_rational(x) for x in (*plant.A[i], plant.B[i, 0])] for i in range(n)] + [
            [0] * (n + 1)
        ]
        generator = fmpq_mat(both)

        def step(duration: fmpq) -> tuple[arb_mat, arb_mat]:
            moved = arb_mat(generator * duration).exp().tolist()
            return arb_mat([row[:n] for row in moved[:n]]), arb_mat([row[n:] for row in moved[:n]])

        C = arb_mat(to_rational_matrix(plant.C))
        Phi, late = step(dt)
        parts = [(late, whole)]
        if rest > 0:
            after, late = step(dt - rest)
            parts = [(late, whole), (after * step(rest)[1], whole + 1)]
        den = Phi.charpoly()
        num = arb_poly([0])
        for column, delay in parts:
            num += (den - (Phi + column * C).charpoly()).left_shift(memory - delay)
    return Quotient(num=num + direct * den, den=den.left_shift(memory), degree=n + memory)


def bilinear_image(system: Quotient) -> Quotient:
    """Return the image of a discrete system under z = (1 + s)/(1 - s): the unit circle becomes the
    imaginary axis.
    """
    return Quotient(
        num=moebius_transform(system.num, system.degree),
        den=moebius_transform(system.den, system.degree),
        degree=system.degree,
    )


def moebius_transform(p: Polynomial, degree: int) -> Polynomial:
    """Return (1 - s)^degree p((1 + s)/(1 - s)); with v = 1 - s the argument is 2/v - 1."""
    kind = type(p)
    shifted = p(kind([-1, 2]))
    coefficients = [shifted[k] for k in range(degree, -1, -1)]
    return kind(coefficients)(kind([1, -1]))


# ---- Zeros, poles and gain of a single-loop system in many digits, for responses that doubles
# cannot resolve.


@value
class _Roots:
    """gain prod (s - zeros) / prod (s - poles); a discrete system has all about z = 1, with z - 1
    for s.
    """

    zeros: np.ndarray
    poles: np.ndarray
    gain: float

    def at(self, points: np.ndarray) -> np.ndarray:
        """Return (W,) values at s, or z - 1; infinite at a pole."""
        with np.errstate(divide="ignore", invalid="ignore"):
            logs = np.log(points[:, None] - self.zeros).sum(axis=1) - np.log(
                points[:, None] - self.poles
            ).sum(axis=1)
            values = self.gain * np.exp(logs)
        on_pole = (points[:, None] == self.poles).any(axis=1)
        return np.where(
            on_pole, np.inf, np.where((points[:, None] == self.zeros).any(axis=1), 0.0, values)
        )


def exact_roots(system: Matrices) -> _Roots:
    """Return the exact transfer function, with its roots to the last digit.

    >>> import numpy as np
    >>> one = np.ones((1, 1))
    >>> found = exact_roots(Matrices(A=-one, B=one, C=one, D=one))                       # (s + 2)/(s + 1)
    >>> found.zeros.real.tolist(), found.poles.real.tolist(), found.gain
    ([-2.0], [-1.0], 1.0)
    """
    exact = transfer_quotient(system)
    shift = fmpq_poly([1, 1] if system.dt else [0, 1])
    num, den = exact.num(shift), exact.den(shift)
    if not num:
        return _Roots(zeros=np.zeros(0, complex), poles=polynomial_roots(den), gain=0.0)
    lead = num[num.degree()] / den[den.degree()]
    return _Roots(
        zeros=polynomial_roots(num),
        poles=polynomial_roots(den),
        gain=float(int(lead.p) / int(lead.q)),
    )


def polynomial_roots(p: fmpq_poly) -> np.ndarray:
    """Return all roots of a fmpq_poly, repeated by multiplicity."""
    if p.degree() > 0:
        found = [complex(root) for root, many in complex_roots(p) for _ in range(many)]
    else:
        found = []
    return np.array(found, dtype=complex)


def complex_roots(p: fmpq_poly) -> list[tuple[acb, int]]:
    """Return every root as a ball, with its multiplicity."""
    return p.numer().complex_roots()  # type: ignore[return-value]  # the stub of python-flint declares a single ball


# ---- Polynomials proved positive on the half-line from zero to infinity, by the signs of their
# coefficients.
#
# A polynomial whose coefficients are all nonnegative has no positive root; on an interval the same
# holds for its Bernstein coefficients (Descartes, Bernstein, Vincent). The half-line is cut until
# every piece passes. The length of a piece falls with the square root of the distance from zero, so
# a polynomial that nearly touches zero takes few more.

_MIN_RELATIVE_WIDTH = 1e-13
_MAX_PIECES = 4000


@value
class Decision:
    """Result for a statement: proved, disproved or undecided; where it is false (nan: unknown), and
    why, for people.

    `needs_digits` is true if more digits may decide an undecided statement.
    """

    outcome: Outcome
    violated_at: float = np.nan
    reason: str = ""
    needs_digits: bool = False

    @property
    def holds(self) -> bool:
        """True if the statement is proved."""
        return self.outcome is Outcome.HOLDS

    @property
    def violated(self) -> bool:
        """True if the statement is disproved."""
        return self.outcome is Outcome.VIOLATED


def proved() -> Decision:
    return Decision(outcome=Outcome.HOLDS)


def refuted(reason: str, at: float = np.nan) -> Decision:
    return Decision(outcome=Outcome.VIOLATED, violated_at=at, reason=reason)


def undecided(reason: str, *, needs_digits: bool = False) -> Decision:
    return Decision(outcome=Outcome.UNDECIDED, reason=reason, needs_digits=needs_digits)


# ---- Routh's array: every root lies in the open left half plane if its first column is positive.

_ROUTH_BITS = (192, 768, 3072)
TOO_NEAR_BOUNDARY = "too close to the stability boundary to decide"


def _hurwitz(p: Polynomial, degree: int) -> Decision:
    """Decide whether all `degree` roots of p lie in the open left half plane (a root at infinity
    does not).

    p is a fmpq_poly, for which zero pivots refute, or an arb_poly, for which balls around zero
    leave it undecided.

    >>> from flint import fmpq_poly
    >>> _hurwitz(fmpq_poly([1, 3, 3, 1]), 3).holds, _hurwitz(fmpq_poly([1, 1, 1, 1]), 3).holds     # a pair at +-j
    (True, False)
    """
    lead = p[degree]
    if lead < 0:
        p, lead = -p, -lead
    rows = [[p[k] for k in range(degree, -1, -2)], [p[k] for k in range(degree - 1, -1, -2)]]
    for _ in range(degree + 1):
        pivot = rows[0][0]
        if not pivot > 0:
            if pivot <= 0:
                return refuted("a pole is not stable")
            return undecided(TOO_NEAR_BOUNDARY, needs_digits=True)
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


def routh(p: Polynomial, degree: int) -> Decision:
    """Decide by Routh's array in balls; for an exact polynomial with more and more digits, finally
    in rationals.
    """
    if isinstance(p, arb_poly):
        return _hurwitz(p, degree)
    for bits in _ROUTH_BITS:
        with ctx.workprec(bits):
            found = _hurwitz(arb_poly(p), degree)
        if not found.needs_digits:
            return found
    return _hurwitz(p, degree)


# ---- Signs on a half line, by Bernstein coefficients.


class _Signs(Enum):
    """Signs of the Bernstein coefficients of a piece."""

    POSITIVE = auto()
    MIXED = auto()
    UNCLEAR = auto()


def _bernstein_coefficients(
    p: Polynomial, low: Coefficient, high: Coefficient
) -> list[Coefficient]:
    """Return coefficients with the signs of the Bernstein coefficients of p on [low, high]
    (positive multiples).
    """
    kind = type(p)
    n = p.degree()
    local = p(kind([low, high - low]))
    coefficients = kind([local[k] for k in range(n, -1, -1)])(kind([1, 1]))
    return [coefficients[k] for k in range(n, -1, -1)]


def _bernstein_signs(coefficients: list[Coefficient]) -> _Signs:
    """Return positive if all are, so that the piece is, with its ends; mixed if one is negative;
    else unclear.
    """
    if all(c >= 0 for c in coefficients) and coefficients[0] > 0 and coefficients[-1] > 0:
        return _Signs.POSITIVE
    if any(c < 0 for c in coefficients):
        return _Signs.MIXED
    return _Signs.UNCLEAR


def positive_on_half_line(p: Polynomial, *, deadline: float = np.inf) -> Decision:
    """Prove p(y) > 0 for all y >= 0; p is an arb_poly or fmpq_poly of python-flint.

    The half-line is cut until the coefficients of every piece are nonnegative (Krandick & Mehlhorn,
    Journal of Symbolic Computation 41, 2006). Infinity is not examined.

    >>> from flint import fmpq, fmpq_poly
    >>> positive_on_half_line(fmpq_poly([fmpq(1000001, 1000000), -2, 1])).holds    # (y - 1)^2 + 1e-6
    True
    >>> round(positive_on_half_line(fmpq_poly([fmpq(999999, 1000000), -2, 1])).violated_at, 3)
    1.0
    """
    coefficients = p.coeffs()
    if not coefficients or not coefficients[0] > 0:
        below = not coefficients or bool(coefficients[0] <= 0)
        text = "not positive at zero"
        if below:
            return refuted(text, 0.0)
        return undecided(text, needs_digits=True)
    low, high = _root_bounds([arb(c) for c in coefficients])
    todo: list[tuple[float, float]] = [(0.0, low), (low, high), (high, np.inf)]
    for _ in range(_MAX_PIECES):
        if not todo:
            return proved()
        if time.thread_time() > deadline:
            return undecided("undecided: the time limit was reached")
        a, b = todo.pop()
        found = _bernstein_signs(
            _bernstein_coefficients(p, _to_exact_number(p, a), _to_exact_number(p, b))
            if np.isfinite(b)
            else _shifted_coefficients(p, a)
        )
        if found is _Signs.POSITIVE:
            continue
        # a negative coefficient does not disprove the statement, only a value of p does
        middle = _geometric_midpoint(a, b)
        if p(_to_exact_number(p, middle)) <= 0:
            return refuted("negative there", middle)
        # unclear: a ball contains zero, and more digits may decide; 1e290: near the end of doubles
        if (
            found is _Signs.UNCLEAR
            or (np.isfinite(b) and b - a <= _MIN_RELATIVE_WIDTH * b)
            or not 1e-290 < middle < 1e290
        ):
            return undecided(f"undecided near {middle:.6g}", needs_digits=True)
        todo += [(a, middle), (middle, b)]
    return undecided(f"undecided after {_MAX_PIECES} pieces")


def _shifted_coefficients(p: Polynomial, low: float) -> list[Coefficient]:
    """Return the coefficients of p(low + y): if all are nonnegative, p has no root beyond low."""
    return list(p(type(p)([_to_exact_number(p, low), 1])).coeffs())


def _to_exact_number(p: Polynomial, x: float) -> Coefficient:
    """Return a double as an exact number of the kind of the coefficients of p."""
    if isinstance(p, fmpq_poly):
        return fmpq(*float(x).as_integer_ratio())
    return arb(float(x))


def _geometric_midpoint(a: float, b: float) -> float:
    """Return the point of a cut, geometric because roots lie decades apart."""
    if a == 0:
        return b / 64
    if np.isinf(b):
        return a * 64
    return float(np.sqrt(a) * np.sqrt(b))


def _root_bounds(coefficients: list[arb]) -> tuple[float, float]:
    """Return approximate bounds of the smallest and the largest root, for the first cut only."""
    logs = [float(abs(c).log().mid()) if abs(c) > 0 else -np.inf for c in coefficients]
    n = max(k for k, log in enumerate(logs) if np.isfinite(log))
    small = [(logs[0] - log) / k for k, log in enumerate(logs) if k and np.isfinite(log)]
    large = [(logs[k] - logs[n]) / (n - k) for k in range(n) if np.isfinite(logs[k])]
    if not small or not large:
        return 0.5, 2.0
    low, high = min(small) - np.log(2), max(large) + np.log(2)
    low, high = np.clip([low, max(high, low + 1)], -600, 600)
    return float(np.exp(low)), float(np.exp(high))
