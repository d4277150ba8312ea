"""Inequalities between transfer matrices in a band of frequencies, decided over the rationals.

M is a Hermitian matrix on the axis, assembled from real systems and their adjoints X~(s) = X(-s)'.
With d the product of their denominators, d d~ det M is an even polynomial. It is found from its
values at real points, where everything is rational, and its real roots cut the band into pieces.
Inside a piece no eigenvalue of M changes its sign, so one point decides it. Poles and zeros on the
axis, at zero and at infinity need no special treatment, because nothing is inverted. Only the time
limit can leave the inequality undecided. A discrete system is first moved onto the axis by z = (1 +
s)/(1 - s).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import count, pairwise
from typing import TypeAlias

import numpy as np
from flint import arb, ctx, fmpq, fmpq_mat, fmpq_poly

from nlfrf._base.values import value
from robust.proofs.exact.claim import Matrices
from robust.proofs.exact.interval_kyp import ExactMatrix
from robust.proofs.exact.matrices import identity, stack
from robust.proofs.exact.polynomials import (
    Decision,
    complex_roots,
    moebius_transform,
    proved,
    refuted,
    routh,
    to_rational,
    to_rational_matrix,
    undecided,
)

_END_ROUNDING = 1e-14  # relative, for an end of a band in doubles
_SINGULAR = "the inequality is an equality at every frequency"
_TIME_UP = "undecided: the time limit was reached"

#: A system at one point and its adjoint there: X(s) and X(-s)', on the axis X and X*.
Pair: TypeAlias = tuple[ExactMatrix, ExactMatrix]
#: Function that assembles the matrix that must be positive.
Inequality: TypeAlias = Callable[[Sequence[Pair]], ExactMatrix]


@value(copy=False)
class TransferMatrix:
    """A system as polynomials in s over the rationals: numerators over one denominator of `order`
    roots.

    Each polynomial p is stored by its even and odd part: p(s) = even(s^2) + s odd(s^2). `own_poles`
    is False if its poles are those of another part of an inequality, and are counted there.
    """

    num: tuple[tuple[tuple[fmpq_poly, fmpq_poly], ...], ...]
    den: tuple[fmpq_poly, fmpq_poly]
    order: int
    own_poles: bool = True

    @classmethod
    def of(cls, system: Matrices, *, own_poles: bool = True) -> TransferMatrix:
        """Return the transfer matrix of a system with its hidden modes; for a discrete one its
        bilinear image.

        >>> import numpy as np
        >>> one = np.ones((1, 1))
        >>> lag = TransferMatrix.of(Matrices(A=-one, B=one, C=one, D=0 * one))
        >>> str(lag.at(fmpq(2))[0].re), str(lag.on_axis(fmpq(1))[0].im)       # 1/(2 + 1), and -1/2 of 1/(1 + j)
        ('[1/3]', '[-1/2]')
        """
        matrices = [to_rational_matrix(getattr(system, name)) for name in "ABCD"]
        return cls.of_rationals(*matrices, discrete=bool(system.dt), own_poles=own_poles)

    @classmethod
    def of_rationals(
        cls,
        A: fmpq_mat,
        B: fmpq_mat,
        C: fmpq_mat,
        D: fmpq_mat,
        *,
        discrete: bool,
        own_poles: bool = True,
    ) -> TransferMatrix:
        """Return `of` for a system whose matrices are rationals."""
        n, rows, columns = A.nrows(), D.nrows(), D.ncols()
        den = A.charpoly()

        def numerator(i: int, j: int) -> fmpq_poly:
            b = fmpq_mat(n, 1, [B[k, j] for k in range(n)])
            c = fmpq_mat(1, n, [C[i, k] for k in range(n)])
            return den * (D[i, j] + 1) - (A + b * c).charpoly()

        def parts(p: fmpq_poly) -> tuple[fmpq_poly, fmpq_poly]:
            if discrete:
                p = moebius_transform(p, n)
            return fmpq_poly(p.coeffs()[::2]), fmpq_poly(p.coeffs()[1::2])

        num = tuple(tuple(parts(numerator(i, j)) for j in range(columns)) for i in range(rows))
        return cls(num=num, den=parts(den), order=n, own_poles=own_poles)

    @property
    def characteristic(self) -> fmpq_poly:
        """d(s); for a discrete system that of its bilinear image."""
        even, odd = (p(fmpq_poly([0, 0, 1])) for p in self.den)
        return even + fmpq_poly([0, 1]) * odd

    @cached_property
    def stability(self) -> Decision:
        """Decision whether every pole is stable."""
        return routh(self.characteristic, self.order)

    @property
    def is_zero(self) -> bool:
        """True if the transfer from every input to every output is zero."""
        return not any(p for row in self.num for parts in row for p in parts)

    def denominator(self, s: fmpq) -> fmpq:
        """Return d(s) d(-s)."""
        even, odd = (p(s * s) for p in self.den)
        return even * even - s * s * odd * odd

    @cached_property
    def known(self) -> dict[fmpq, Pair]:
        """Cache of the results of `at`: all inequalities of a system use the same points."""
        return {}

    def at(self, s: fmpq) -> Pair:
        """Return X(s) and X(-s)' at a real point that is not a pole."""
        if s not in self.known:
            self.known[s] = self.evaluate(s)
        return self.known[s]

    def evaluate(self, s: fmpq) -> Pair:
        """Compute `at` without the cache."""
        even, odd = (p(s * s) for p in self.den)
        values = [[(e(s * s), s * o(s * s)) for e, o in row] for row in self.num]
        plus = fmpq_mat([[(e + o) / (even + s * odd) for e, o in row] for row in values])
        minus = fmpq_mat([[(e - o) / (even - s * odd) for e, o in row] for row in values])
        return ExactMatrix.real(plus), ExactMatrix.real(minus.transpose())

    def on_axis(self, x: fmpq | None) -> Pair:
        """Return X(jx), at infinity for x None, and its conjugate transpose; a pole raises a
        ZeroDivisionError.
        """
        if x is None:
            k, part = divmod(self.order, 2)
            direct = fmpq_mat(
                [[parts[part][k] / self.den[part][k] for parts in row] for row in self.num]
            )
            return ExactMatrix.real(direct), ExactMatrix.real(direct.transpose())
        y = -x * x
        even, odd = self.den[0](y), x * self.den[1](y)
        size = even * even + odd * odd
        values = [[(e(y), x * o(y)) for e, o in row] for row in self.num]
        found = ExactMatrix(
            re=fmpq_mat([[(e * even + o * odd) / size for e, o in row] for row in values]),
            im=fmpq_mat([[(o * even - e * odd) / size for e, o in row] for row in values]),
        )
        return found, found.H


def points_of_band(band: tuple[float, float], dt: float) -> tuple[float, float]:
    """Return the ends of a band [rad/s] on the axis, rounded outward: x = omega, discrete tan(omega
    dt/2).
    """
    if not dt:
        return band
    low, high = (
        float(np.tan(omega * dt / 2)) if omega * dt < np.pi * (1 - 1e-12) else np.inf
        for omega in band
    )
    return low * (1 - _END_ROUNDING), high * (1 + _END_ROUNDING)


def frequency_of_point(x: float, dt: float) -> float:
    if dt:
        return 2 / dt * float(np.arctan(x))
    return x


@value(copy=False)
class Piece:
    """A stretch of the axis on which det M has no root: its ends, rounded outward, and M at a point
    inside.
    """

    low: float
    high: float
    x: fmpq
    M: ExactMatrix


def cut_at_crossings(
    parts: Sequence[TransferMatrix],
    inequality: Inequality,
    *,
    low: float = 0.0,
    high: float = np.inf,
    deadline: float = np.inf,
) -> list[Piece] | str:
    """Return the pieces of the axis from low to high between the roots of det M; or the reason why
    there are none.

    At a root an eigenvalue of M changes its sign or touches zero, or a pole lies on the axis.

    >>> import numpy as np
    >>> one = np.ones((1, 1))
    >>> lag = TransferMatrix.of(Matrices(A=-one, B=one, C=one, D=0 * one))                   # |1/(1 + jx)|
    >>> def holds(level, low): return [p.M.is_positive for p in cut_at_crossings([lag], gain_below(level), low=low)]
    >>> holds(0.71, 0.0), holds(0.70, 1.0), holds(0.71, 1.0), holds(1.0, 0.0)
    ([False, True], [False, True], [True], [True])
    """
    p = _determinant(parts, inequality, deadline)
    if p is None:
        return _TIME_UP
    if not p:
        return _SINGULAR
    ends = _pieces_between_roots(p, to_rational(low), None if np.isinf(high) else to_rational(high))
    pieces = [_look_inside(*each, parts, inequality) for each in ends]
    return [*pieces[:-1], replace(pieces[-1], high=high)]


def gain_below(level: float) -> Inequality:
    """Return level^2 - H~H of a system, which is positive if its largest singular value is below
    the level.
    """

    def inequality(pairs: Sequence[Pair]) -> ExactMatrix:
        (H, adjoint), square = pairs[0], to_rational(level) ** 2
        return ExactMatrix.real(identity(H.re.ncols()) * square) - adjoint * H

    return inequality


def decide_norm(H: TransferMatrix, level: float, *, deadline: float = np.inf) -> Decision:
    """Decide whether a system is stable and its largest singular value is below a level everywhere,
    at infinity too.

    >>> import numpy as np
    >>> one = np.ones((1, 1))
    >>> lag = TransferMatrix.of(Matrices(A=-one, B=one, C=one, D=0 * one))                   # 1/(s + 1): norm one
    >>> [decide_norm(lag, x).holds for x in (1.0, np.nextafter(1, 2))]
    [False, True]
    """
    if not H.stability.holds:
        return H.stability
    inequality = gain_below(level)
    p = _determinant([H], inequality, deadline)
    if p is None:
        return undecided(_TIME_UP)
    if p.degree() > 0:
        roots = complex_roots(p(fmpq_poly([0, -1])))
    else:
        roots = []
    is_reached = p.degree() < H.order or any(y.imag == 0 and not y.real < 0 for y, _ in roots)
    if is_reached or not inequality([H.on_axis(fmpq(1))]).is_positive:
        return refuted("the largest singular value reaches the level")
    return proved()


def multiply(left: Pair, right: Pair) -> Pair:
    """Return the product of two systems at a point, and its adjoint."""
    return left[0] * right[0], right[1] * left[1]


def subtract(left: Pair, right: Pair) -> Pair:
    """Return the difference of two systems at a point, and its adjoint."""
    return left[0] - right[0], left[1] - right[1]


def join_blocks(rows: Sequence[Sequence[ExactMatrix]]) -> ExactMatrix:
    return ExactMatrix(
        re=stack([[M.re for M in row] for row in rows]),
        im=stack([[M.im for M in row] for row in rows]),
    )


def _determinant(
    parts: Sequence[TransferMatrix], inequality: Inequality, deadline: float
) -> fmpq_poly | None:
    """Return d d~ det M as a polynomial in s^2, from its values at as many points; None if time
    runs out.
    """
    counted = [part for part in parts if part.own_poles]
    order = sum(part.order for part in counted)
    y: list[fmpq] = []
    c: list[fmpq] = []
    for s in map(fmpq, count(1)):
        if len(y) > order:
            break
        if time.thread_time() > deadline:
            return None
        size = fmpq(1)
        for part in counted:
            size *= part.denominator(s)
        if size:
            y.append(s * s)
            c.append(inequality([part.at(s) for part in parts]).re.det() * size)
    for k in range(1, order + 1):  # divided differences, then Horner
        for i in range(order, k - 1, -1):
            c[i] = (c[i] - c[i - 1]) / (y[i] - y[i - k])
    p = fmpq_poly([c[order]])
    for i in range(order - 1, -1, -1):
        p = p * fmpq_poly([-y[i], 1]) + c[i]
    return p


def _pieces_between_roots(p: fmpq_poly, low: fmpq, high: fmpq | None) -> list[tuple[fmpq, fmpq]]:
    """Return the squares of the ends of each piece of ]low, high[ on which p(-x^2) has no root.

    high : None for infinity, which is replaced by a number beyond the last root.
    """
    first, last = low * low, None if high is None else high * high
    q = p(fmpq_poly([0, -1])) * fmpq_poly([-first, 1])
    if last is not None:
        q = q * fmpq_poly([-last, 1])
    balls = sorted(
        _ends_of_ball(root.real) for root, _ in complex_roots(q) if root.imag == 0
    )  # balls of distinct roots are disjoint
    inside = [
        (below, above)
        for below, above in balls
        if above >= first and (last is None or below <= last)
    ]
    if last is None:
        beyond = 4 * max(fmpq(1), inside[-1][1])
        inside.append((beyond, beyond))
    return [(before[1], after[0]) for before, after in pairwise(inside)]


def _ends_of_ball(y: arb) -> tuple[fmpq, fmpq]:
    middle, radius = _exact_number(y.mid()), _exact_number(y.rad())
    return middle - radius, middle + radius


def _exact_number(x: arb) -> fmpq:
    """Return the exact number of a ball with radius zero."""
    mantissa, exponent = x.man_exp()
    return fmpq(mantissa) * fmpq(2) ** int(exponent)


def _look_inside(
    low: fmpq, high: fmpq, parts: Sequence[TransferMatrix], inequality: Inequality
) -> Piece:
    """Return a piece with M at a point inside, near the geometric mean of its ends."""
    top = high
    for bits in count(64, 64):
        with ctx.workprec(bits):
            if low > 0:
                middle = arb(low) * arb(top)
            else:
                middle = arb(top) ** 2 / 64
            x = _exact_number(middle.sqrt().sqrt().mid())
        if not low < x * x < top:
            continue
        try:
            M = inequality([part.on_axis(x) for part in parts])
        except ZeroDivisionError:  # a pole; there are at most as many as states
            top = x * x
            continue
        ends = [float(np.sqrt(to_float(y))) for y in (low, high)]
        return Piece(
            low=ends[0] * (1 - _END_ROUNDING), high=ends[1] * (1 + _END_ROUNDING), x=x, M=M
        )
    raise AssertionError


def to_float(x: fmpq | None) -> float:
    """Return the nearest double of a rational number; infinity for None."""
    if x is None:
        return np.inf
    return int(x.p) / int(x.q)


def to_numbers(M: ExactMatrix) -> np.ndarray:
    """Return a matrix as complex doubles."""
    re, im = (
        np.array([[to_float(x) for x in row] for row in part.tolist()]) for part in (M.re, M.im)
    )
    return np.asarray(re + 1j * im)
