r"""Claims that a sampled set with several channels contains a continuous one, with every alias.

After hold h_k and delay the perturbation of the sampled plant is sum_k h_k G_k W_l,k Delta_k W_r,k
over all aliases omega_k = omega + 2 pi k/T, with free |Delta_k| <= 1 (G_k = 1 if the form does not
pass through the plant). It is G_d V_l Delta V_r with one |Delta| <= 1 if at every omega up to
Nyquist there are numbers m_k > 0 with

    sum_k |h_k|/m_k M_k M_k* < 1,  M_k = V_l^-1 G_d^-1 G_k W_l,k,    and    sum_k |h_k| m_k |w_r,i,k/v_r,i|^2 < 1

for every i, because a row of the parts and a column of the others are contractions
(Cauchy-Schwarz). On an interval every m_k is the exponential of a line, and both sums are enclosed
by their Taylor polynomials about its middle. The remainder is bounded by series with the moduli of
the coefficients. For these every transfer function is the exponential of a series, in which a zero
near a pole cancels it. The interval is cut until both sums pass. Aliases near the band are taken
one by one, the others by upper bounds of |h_k| |G_k W_l,k| in blocks and by the power law of the
last ones.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import reduce
from math import ceil, prod
from typing import TypeAlias

import numpy as np
from flint import acb, acb_series, arb, arb_series, ctx, fmpq_poly

from nlfrf._base.arguments import format_hertz
from nlfrf._base.values import value
from robust.proofs.exact.aliases import (
    MOST_SINGLE,
    SINGLE,
    AliasBlocks,
    Ratio,
    magnitude_ratio,
    max_magnitude,
    product_of_systems,
    root_radius,
    upper_end,
)
from robust.proofs.exact.claim import Matrices
from robust.proofs.exact.matrices import ldl_pivots
from robust.proofs.exact.polynomials import (
    Decision,
    Quotient,
    complex_roots,
    proved,
    to_rational,
    transfer_quotient,
    undecided,
)
from robust.proofs.exact.verification import Verification, summarise_claims

ALIASES = "every alias in the weights"
_BITS = 192
_FEW_SINGLE = 2  # number of single aliases on each side in the first attempt
# value of the sums at the middle of an interval below which more single aliases are not worth their
# price
_CLEAR = 0.99
MOST_INTERVALS = 4000
_NARROW = 1e-9  # relative width of the narrowest interval

_LEAST_SHARE = 1e-12  # of the largest term: least weight of a term

_ORDER = 6  # number of terms of Taylor polynomials
# of the distance to a zero: in an interval that reaches farther the zero is a separate factor
_NEAR = 0.5
_UPWARD = 1 + 1e-9  # factor that covers the rounding in a few sums of positive doubles
Number: TypeAlias = float | arb | acb


@value
class FoldedPart:
    """A full block of a continuous set, and the block of the sampled set that contains it after
    folding.
    """

    # plant, sampled: continuous plant after the perturbation, and the sampled one; None if the
    # perturbation adds to the output
    plant: Matrices | None
    sampled: Matrices | None
    # left, right: continuous weights; W_l and W_r are diagonal
    left: tuple[Matrices, ...]
    right: tuple[Matrices, ...]
    # sampled_left, sampled_right: weights of the sampled set
    sampled_left: tuple[Matrices, ...]
    sampled_right: tuple[Matrices, ...]

    def __post_init__(self) -> None:
        n = len(self.left)
        if (
            not n
            or len(self.sampled_left) != n
            or not self.right
            or len(self.sampled_right) != len(self.right)
        ):
            raise ValueError(
                "weights must be as many for the sampled set as for the continuous one"
            )
        if any(
            w.D.shape != (1, 1)
            for w in (*self.left, *self.right, *self.sampled_left, *self.sampled_right)
        ):
            raise ValueError("weights must have one input and one output")
        if (self.plant is None) != (self.sampled is None):
            raise ValueError("plant and sampled must be given together, got one of them")
        if any(G is not None and G.D.shape != (n, n) for G in (self.plant, self.sampled)):
            raise ValueError(f"plant and sampled must be square, with {n} channels as the weights")


@value
class FoldedClaim:
    """The claim that with sampling time dt [s] each part of a continuous set lies in that of the
    sampled set.
    """

    dt: float
    parts: tuple[FoldedPart, ...]

    def __post_init__(self) -> None:
        if not (np.isfinite(self.dt) and self.dt > 0):
            raise ValueError(f"dt must be a sampling time [s], got {self.dt}")


def decide_folded(claim: FoldedClaim) -> dict[str, Decision]:
    """Decide whether every part lies within the sampled one.

    For 0.1/(1 + s/10) at dt = 0.1 s all aliases sum to 0.1 at zero frequency and to less than 0.095
    at Nyquist.

    >>> one, none = np.ones((1, 1)), np.zeros((0, 0))
    >>> def gain(x): return Matrices(A=none, B=none.reshape(0, 1), C=none.reshape(1, 0), D=np.array([[x]]))
    >>> lag = Matrices(A=-10 * one, B=one, C=one, D=0 * one)
    >>> part = dict(plant=None, sampled=None, left=(lag,), right=(gain(1.0),), sampled_right=(gain(1.0),))
    >>> def within(x): return FoldedClaim(dt=0.1, parts=(FoldedPart(**part, sampled_left=(gain(x),)),))
    >>> [decide_folded(within(x))[ALIASES].holds for x in (0.103, 0.099)]
    [True, False]
    """
    with ctx.workprec(_BITS):
        for part in claim.parts:
            found = _decide_part(_FoldedSum(part, claim.dt))
            if not found.holds:
                return {ALIASES: found}
    return {ALIASES: proved()}


def verify_folded(claim: FoldedClaim, *, time_cap: float = 60.0) -> Verification:
    """Prove the claim again in balls rounded outward.

    The number of intervals is limited; `time_cap` has no effect.
    """
    del time_cap
    return summarise_claims(decide_folded(claim))


def _decide_part(folded: _FoldedSum) -> Decision:
    """Decide one part, interval by interval from zero to Nyquist."""
    waiting = [(0.0, float(np.nextafter(np.pi / folded.period, np.inf)), 0)]
    last = len(folded.singles) - 1
    for _ in range(MOST_INTERVALS):
        if not waiting:
            return proved()
        low, high, level = waiting.pop()
        at = _Interval(low, high, folded.dt)
        holds, reached = folded.decide(at, folded.singles[level])
        if holds:
            continue
        if level < last and reached >= _CLEAR:
            waiting.append((low, high, level + 1))
            continue
        if reached >= 1 and low:
            return undecided(
                f"at {format_hertz(at.middle)} the folded aliases reach {reached:.6g} of the"
                " weights"
            )
        if high - low <= _NARROW * high or high < _NARROW / folded.period:
            break
        cut = high / 8
        if low:
            if high > 2 * low:
                cut = float(np.sqrt(low * high))
            else:
                cut = (low + high) / 2
        waiting += [(cut, high, level), (low, cut, 0)]
    return undecided(f"undecided from {format_hertz(low)} to {format_hertz(high)}")


class _Interval:
    """An interval of omega [rad/s]: middle and half-width, omega = middle + u radius with u in [-1,
    1].
    """

    def __init__(self, low: float, high: float, dt: arb) -> None:
        self.middle, self.starts_at_zero = (low + high) / 2, low == 0
        self.radius = max(high - self.middle, self.middle - low) * (1 + 1e-15)
        self.omega, self.omega_offset = (
            _Expansion.line(self.middle, self.radius),
            _Expansion.line(0, self.radius),
        )
        self.s_offset = _Expansion.line(0, acb(0, self.radius))
        # z - 1, in which slow systems are precise, is z + z_offset; its coefficients are at most
        # those of exp
        turn, angle = acb(0, dt * self.middle).exp(), dt * self.radius
        self.z = turn - 1
        self.z_offset = _Expansion(
            series=(acb_series([0, acb(0, angle)], _ORDER).exp() - 1) * turn,
            bound=arb_series([0, angle], _ORDER).exp() - 1,
            total=angle.expm1().abs_upper(),
        )


@value(copy=False)
class _Expansion:
    """A function of u in [-1, 1] by its Taylor series about zero, a bound of every coefficient and
    of their sum.

    `bound` contains upper bounds of the absolute coefficients below the order; `total` is an upper
    bound of the sum of all. `total` minus the sum of `bound` bounds the remainder. Products and
    sums of bounds are bounds again.
    """

    series: acb_series
    bound: arb_series
    total: arb

    @classmethod
    def line(cls, start: Number, slope: Number = 0) -> _Expansion:
        """Return start + slope u."""
        series = acb_series([acb(start), acb(slope)], _ORDER)
        return cls(series=series, bound=_absolute(series), total=_sum_of(_absolute(series)))

    def __mul__(self, other: _Expansion) -> _Expansion:
        return _Expansion(
            series=self.series * other.series,
            bound=self.bound * other.bound,
            total=(self.total * other.total).abs_upper(),
        )

    def __add__(self, other: _Expansion) -> _Expansion:
        return _Expansion(
            series=self.series + other.series,
            bound=self.bound + other.bound,
            total=(self.total + other.total).abs_upper(),
        )

    @property
    def conjugate(self) -> _Expansion:
        """Conjugate, for real u."""
        series = acb_series([c.conjugate() for c in self.series.coeffs()], _ORDER)
        return _Expansion(series=series, bound=self.bound, total=self.total)

    @property
    def squared(self) -> _Expansion:
        """Squared magnitude, for real u."""
        return self * self.conjugate

    @property
    def coefficients(self) -> list[acb]:
        """All coefficients below the order."""
        found = self.series.coeffs()
        return found + [acb(0)] * (_ORDER - len(found))

    @property
    def ball(self) -> acb:
        """Ball that contains the function for all u."""
        u, found = arb(0, 1), acb(0)
        for c in self.coefficients[::-1]:
            found = found * u + c
        rest = arb(0, (self.total - _sum_of(self.bound)).abs_upper())
        return found + acb(rest, rest)


def _absolute(series: acb_series) -> arb_series:
    return arb_series([c.abs_upper() for c in series.coeffs()], _ORDER)


def _sum_of(bound: arb_series) -> arb:
    return sum(bound.coeffs(), arb(0))


@value(copy=False)
class _Logarithm:
    """A function of u without roots: Taylor series of its logarithm, remainder bound."""

    value: acb
    series: acb_series
    rest: float

    def __add__(self, other: _Logarithm) -> _Logarithm:
        return _Logarithm(
            value=self.value * other.value,
            series=self.series + other.series,
            rest=self.rest + other.rest,
        )

    @property
    def inverse(self) -> _Logarithm:
        return _Logarithm(value=1 / self.value, series=-self.series, rest=self.rest)

    @property
    def function(self) -> _Expansion:
        size, bound = self.value.abs_upper(), _absolute(self.series)
        return _Expansion(
            series=self.series.exp() * self.value,
            bound=bound.exp() * size,
            total=((_sum_of(bound) + self.rest).exp() * size).abs_upper(),
        )


def _exponential(start: float, slope: float) -> _Expansion:
    """Return start exp(slope u)."""
    return _Logarithm(
        value=acb(start), series=acb_series([0, acb(slope)], _ORDER), rest=0.0
    ).function


@value(copy=False)
class _Product:
    """The product of a function without roots and of an optional factor with roots."""

    smooth: _Logarithm
    roots: _Expansion | None = None

    def __mul__(self, other: _Product) -> _Product:
        found = self.roots or other.roots
        if self.roots is not None and other.roots is not None:
            found = self.roots * other.roots
        return _Product(smooth=self.smooth + other.smooth, roots=found)

    @property
    def inverse(self) -> _Product:
        """One over the function; a ValueError is raised if it may have a root."""
        if self.roots is not None:
            raise ValueError("a root may lie within")
        return _Product(smooth=self.smooth.inverse)

    @property
    def function(self) -> _Expansion:
        if self.roots is None:
            return self.smooth.function
        return self.smooth.function * self.roots


@value(copy=False)
class _Factored:
    """A transfer function by its gain and its roots in s or z - 1, as balls."""

    gain: arb
    zeros: tuple[acb, ...]
    poles: tuple[acb, ...]

    @classmethod
    def of(cls, system: Quotient, *, at_one: bool = False) -> _Factored:
        """Return the factors of a quotient of polynomials over the rationals in s, or in z with
        `at_one`.
        """
        num, den = (p(fmpq_poly([1, 1])) if at_one else p for p in (system.num, system.den))
        if not num:
            return cls(gain=arb(0), zeros=(), poles=())
        gain = arb(num[num.degree()] / den[den.degree()])
        return cls(gain=gain, zeros=_all_roots(num), poles=_all_roots(den))

    def at(self, start: acb, offset: _Expansion) -> _Product:
        """Return it at start + offset, with offset zero in the middle; a ValueError is raised if a
        pole may be near.
        """
        zeros, poles = ([start - x for x in roots] for roots in (self.zeros, self.poles))
        size = float(offset.total.upper())
        near = [x for x in zeros if not size < _NEAR * float(abs(x).mid())]
        far = [x for x in zeros if size < _NEAR * float(abs(x).mid())]
        shares = [size / float(abs(x).lower()) for x in (*far, *poles) if x.abs_lower() > 0]
        if len(shares) < len(far) + len(poles) or not all(share < 1 for share in shares):
            raise ValueError("a pole may lie within")
        step, one = acb_series([0, 1], _ORDER), acb_series([1], _ORDER)
        ratio = prod((step / x + 1 for x in far), start=one) / prod(
            (step / x + 1 for x in poles), start=one
        )
        series = ratio.log()
        bound = _absolute(series)
        beyond = sum((c * offset.total**k for k, c in enumerate(bound.coeffs()) if k), arb(0))
        rest = float((beyond - _sum_of(bound(offset.bound))).abs_upper())
        smooth = _Logarithm(
            value=prod(far, start=acb(self.gain)) / prod(poles, start=acb(1)),
            series=series(offset.series),
            rest=(rest + sum(share**_ORDER / _ORDER / (1 - share) for share in shares)) * _UPWARD,
        )
        if near:
            roots = prod((_Expansion.line(x) + offset for x in near), start=_Expansion.line(1))
        else:
            roots = None
        return _Product(smooth=smooth, roots=roots)


def _all_roots(p: fmpq_poly) -> tuple[acb, ...]:
    """Return every root, repeated by its multiplicity."""
    if p.degree() > 0:
        return tuple(root for root, many in complex_roots(p) for _ in range(many))
    return ()


@value(copy=False)
class _Term:
    """One term of both sums: |h_k|, M_k by rows, |w_r,i,k/v_r,i|^2 for every i."""

    hold: _Expansion
    M: list[list[_Expansion]]
    right: list[_Expansion]

    def size(self, V: list[_Product]) -> tuple[float, float]:
        """Return the largest singular value of V_l M in the middle and its logarithmic derivative,
        in floating point.

        V : one over each V_l. So m_k does not depend on the sampled weights.
        """
        M, slope = (
            np.array([[complex(x.coefficients[k]) for x in row] for row in self.M]) for k in (0, 1)
        )
        scale = np.array([[complex(v.smooth.value), complex(v.smooth.series[1])] for v in V])
        M, slope = M / scale[:, :1], (slope - scale[:, 1:] * M) / scale[:, :1]
        u, s, v = np.linalg.svd(M)
        return float(s[0]), (
            float((u[:, 0].conj() @ slope @ v[0].conj()).real / s[0]) if s[0] > 0 else 0.0
        )


@value(copy=False)
class _Sums:
    """The sum of |h_k|/m_k M_k M_k* by rows, and the sums of |h_k| m_k |w_r,i,k/v_r,i|^2."""

    left: list[list[_Expansion]]
    right: list[_Expansion]


def _both_sums(terms: list[_Term], sizes: list[tuple[float, float]]) -> _Sums:
    """Return both sums with m_k = size exp(slope u)."""
    n, zero = len(terms[0].M), _Expansion.line(0)
    left = [[zero] * n for _ in range(n)]
    right = [zero] * len(terms[0].right)
    for term, (size, slope) in zip(terms, sizes, strict=True):
        share = term.hold * _exponential(1 / size, -slope)
        weight = term.hold * _exponential(size, slope)
        conjugates = [[x.conjugate for x in row] for row in term.M]
        for i, row in enumerate(term.M):
            weighted = [x * share for x in row]
            for j in range(i, n):
                left[i][j] = sum(
                    (x * y for x, y in zip(weighted, conjugates[j], strict=True)), left[i][j]
                )
        right = [x + weight * y for x, y in zip(right, term.right, strict=True)]
    return _Sums(left=left, right=right)


def _best_balance(sums: _Sums) -> tuple[float, tuple[float, float]]:
    """Return the value of both sums with the best common factor of all m_k, this factor and its log
    derivative.
    """
    left, left_slope = (
        np.array([[complex(x.coefficients[k]) for x in row] for row in sums.left]) for k in (0, 1)
    )
    right, right_slope = (
        np.array([float(x.coefficients[k].real.mid()) for x in sums.right]) for k in (0, 1)
    )
    if not (np.isfinite(left).all() and np.isfinite(right).all()):
        return np.inf, (1.0, 0.0)
    values, vectors = np.linalg.eigh(left, UPLO="U")
    v, i = vectors[:, -1], int(right.argmax())
    turned = np.triu(left_slope) + np.triu(left_slope, 1).conj().T
    slope = float((v.conj() @ turned @ v).real / values[-1] - right_slope[i] / right[i]) / 2
    return float(np.sqrt(values[-1] * right[i])), (float(np.sqrt(values[-1] / right[i])), slope)


def _is_below_one(upper: list[list[acb]]) -> bool:
    """Return whether a Hermitian matrix of balls (upper half) is less than the identity."""
    n = len(upper)
    M = [[upper[i][j] if i <= j else upper[j][i].conjugate() for j in range(n)] for i in range(n)]
    rows = [
        [(i == j) - x.real for j, x in enumerate(row)] + [x.imag for x in row]
        for i, row in enumerate(M)
    ]
    rows += [
        [-x.imag for x in row] + [(i == j) - x.real for j, x in enumerate(row)]
        for i, row in enumerate(M)
    ]
    for i in range(n):
        rows[i][n + i] = rows[n + i][i] = arb(0)
    pivots = ldl_pivots(rows)
    return len(pivots) == 2 * n and all(p > 0 for p in pivots)


def _diagonal(entries: list[_Expansion]) -> list[list[_Expansion]]:
    zero = _Expansion.line(0)
    return [[x if i == j else zero for j in range(len(entries))] for i, x in enumerate(entries)]


def _ratios_of(paths: Iterable[Quotient]) -> list[Ratio]:
    """Return the magnitudes of all transfer functions that are not zero."""
    return [magnitude_ratio(path) for path in paths if path.num]


def _upper_sinc(x: _Expansion) -> _Expansion:
    """Return a polynomial that is at least sin(x)/x, by at most 4e-7 up to pi/2: its series ends
    after a plus.
    """
    minus, one, found = x * x * _Expansion.line(-1), _Expansion.line(1), _Expansion.line(1)
    for k in (72, 42, 20, 6):
        found = one + minus * _Expansion.line(arb(1) / k) * found
    return found


def _entries_of(system: Matrices) -> list[list[Quotient]]:
    """Return the transfer functions of a system by outputs and inputs, with one denominator."""
    B, C, D = system.B, system.C, system.D
    return [
        [
            transfer_quotient(replace(system, B=B[:, [i]], C=C[[j]], D=D[[j]][:, [i]]))
            for i in range(D.shape[1])
        ]
        for j in range(D.shape[0])
    ]


def _inverse_of(system: Matrices) -> list[list[_Factored]]:
    """Return the inverse of a square sampled system by rows: d adj(N)/det(N) for N/d, without d^(n
    - 1) in both.
    """
    entries = _entries_of(system)
    n, d = len(entries), entries[0][0].den
    N = [[entry.num for entry in row] for row in entries]
    common = d ** (n - 1)
    den = _determinant(N) // common  # exact: N is C adj(z - A) B + d D
    if not den:
        raise ValueError("sampled must have an inverse, got a plant that has none at any frequency")

    def cofactor(i: int, j: int) -> fmpq_poly:
        minor = [row[:i] + row[i + 1 :] for k, row in enumerate(N) if k != j]
        return _determinant(minor) * (-1) ** (i + j) * d // common

    rows = [[Quotient(num=cofactor(i, j), den=den, degree=0) for j in range(n)] for i in range(n)]
    return [[_Factored.of(entry, at_one=True) for entry in row] for row in rows]


def _determinant(rows: list[list[fmpq_poly]]) -> fmpq_poly:
    """Return the determinant of a matrix of polynomials; one for an empty matrix."""
    if not rows:
        return fmpq_poly([1])
    first, *others = rows
    return sum(
        (
            x * _determinant([row[:j] + row[j + 1 :] for row in others]) * (-1) ** j
            for j, x in enumerate(first)
        ),
        fmpq_poly([0]),
    )


class _FoldedSum:
    """All quantities of a part that do not depend on frequency."""

    def __init__(self, part: FoldedPart, dt: float) -> None:
        self.period, self.dt = dt, arb(to_rational(dt))
        self.step = 2 * arb.pi() / self.dt
        lefts, rights = ([transfer_quotient(w) for w in each] for each in (part.left, part.right))
        self.left, self.right = ([_Factored.of(w) for w in each] for each in (lefts, rights))
        self.V_left, self.V_right = (
            [_Factored.of(transfer_quotient(w), at_one=True) for w in each]
            for each in (part.sampled_left, part.sampled_right)
        )
        if part.plant is None:
            entries = []
        else:
            entries = _entries_of(part.plant)
        self.G = [[_Factored.of(g) for g in row] for row in entries]
        self.inverse = [] if part.sampled is None else _inverse_of(part.sampled)
        plant = [g for row in entries for g in row]
        self.farthest = float(root_radius(*plant, *lefts, *rights)) / float(self.step.mid())
        self.singles = (
            0,
            _FEW_SINGLE,
            min(max(SINGLE, ceil(min(self.farthest, 1e6)) + 2), MOST_SINGLE),
        )
        through = map(product_of_systems, plant, lefts * len(lefts)) if plant else lefts
        F, right = _ratios_of(through), [magnitude_ratio(w) for w in rights]
        self.tails = {k: self.tail(F, k) for k in self.singles}
        self.highest = {k: [self.largest_beyond(w, k) for w in right] for k in self.singles}
        self.plant_tail = self.tail(_ratios_of(plant), 0)

    def tail(self, paths: list[Ratio], n: int) -> arb:
        """Return an upper bound of the sum of |h_k F_k| over |k| > n and all F, without |sin(omega
        dt/2)|.
        """
        blocks, total = AliasBlocks.beyond(n, self.farthest, dt=self.dt), arb(0)
        for F in paths:
            sizes = [max_magnitude(F, *block) for block in blocks.intervals]
            total += blocks.total(sizes, F.beyond(blocks.end), F.order, holds=1)
        return upper_end(total)

    def largest_beyond(self, w: Ratio, n: int) -> arb:
        """Return an upper bound of |w| beyond the lowest of the aliases |k| > n."""
        blocks = AliasBlocks.beyond(n, self.farthest, dt=self.dt)
        sizes = (max_magnitude(w, *block) for block in blocks.intervals)
        return upper_end(reduce(arb.max, sizes, w.beyond(blocks.end) / blocks.end**w.order))

    def decide(self, at: _Interval, singles: int) -> tuple[bool, float]:
        """Return whether both sums stay below one on an interval, and their approximate value at
        its middle.

        singles : number of single aliases on each side.
        """
        try:
            V = [w.at(at.z, at.z_offset).inverse for w in self.V_left]
            terms = list(self.terms(at, V, singles))
        except ValueError:
            return False, 0.0
        sizes = [term.size(V) for term in terms]
        least = _LEAST_SHARE * max(size for size, _ in sizes)
        sums = _both_sums(
            terms, [(size, slope) if size > least else (least, 0.0) for size, slope in sizes]
        )
        reached, (factor, slope) = _best_balance(sums)
        if not reached < 1:
            return False, reached
        times, over = _exponential(factor, slope), _exponential(1 / factor, -slope)
        right = all((x * times).ball.real < 1 for x in sums.right)
        return (
            right and _is_below_one([[(x * over).ball for x in row] for row in sums.left]),
            reached,
        )

    def terms(self, at: _Interval, V: list[_Product], singles: int) -> Iterator[_Term]:
        """Yield the terms of both sums; the first is for all aliases beyond the single ones.

        V : 1/V_l.

        A ValueError is raised if a pole is near.
        """
        v = [w.at(at.z, at.z_offset).inverse.function.squared for w in self.V_right]
        inverse = [[y.at(at.z, at.z_offset) for y in row] for row in self.inverse]
        rest = [v[i] * _Expansion.line(w * w) for i, w in enumerate(self.highest[singles])]
        sinc = _upper_sinc(at.omega * _Expansion.line(self.dt / 2))
        scaled = [[(V[i] * y).function for y in row] for i, row in enumerate(inverse)]
        yield _Term(
            hold=sinc * at.omega * _Expansion.line(self.dt / 2 * self.tails[singles]),
            M=scaled or _diagonal([x.function for x in V]),
            right=rest,
        )
        for k in range(-singles, singles + 1):
            start = acb(0, at.middle + k * self.step)
            right = [
                w.at(start, at.s_offset).function.squared * v[i] for i, w in enumerate(self.right)
            ]
            hold = sinc
            if k:
                hold = sinc * self.hold_share(at, k)
            elif inverse and at.starts_at_zero:
                hold = _Expansion.line(1)
            for M in self.alias_matrices(at, V, inverse, start, k):
                yield _Term(hold=hold, M=M, right=right)

    def alias_matrices(
        self, at: _Interval, V: list[_Product], inverse: list[list[_Product]], start: acb, k: int
    ) -> list[list[list[_Expansion]]]:
        """Return M_k; or two matrices for |h_0| M_0 on an interval from zero on, where the plant
        may have a pole.

        There G_0 is not used: h_0 G_0 is G_d minus the sum of the other h_k G_k, so G_d^-1 h_0 G_0
        differs from one by at most `off`. inverse : G_d^-1. start : j omega_k in the middle.
        """
        W, n = [w.at(start, at.s_offset) for w in self.left], len(V)
        if inverse and (k or not at.starts_at_zero):
            zero = _Expansion.line(0)
            G = [[g.at(start, at.s_offset) for g in row] for row in self.G]
            return [
                [
                    [
                        sum(
                            ((V[i] * inverse[i][m] * G[m][j] * W[j]).function for m in range(n)),
                            zero,
                        )
                        for j in range(n)
                    ]
                    for i in range(n)
                ]
            ]
        direct = _diagonal([(x * w).function for x, w in zip(V, W, strict=True)])
        if not inverse:
            return [direct]
        size = sum(
            (y.function.total * y.function.total for row in inverse for y in row), arb(0)
        ).sqrt()
        off = size * self.plant_tail * self.dt * arb(at.middle + at.radius) / 2
        most = _Expansion.line((off * sum((w.function.total for w in W), arb(0))).abs_upper())
        return [_diagonal([x.function * most for x in V]), direct]

    def hold_share(self, at: _Interval, k: int) -> _Expansion:
        """Return |h_k/h_0| = |omega/omega_k|."""
        share = _Factored(
            gain=arb(1 if k > 0 else -1), zeros=(acb(0),), poles=(acb(-k * self.step),)
        )
        return share.at(acb(at.middle), at.omega_offset).function
