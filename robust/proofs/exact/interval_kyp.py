"""Proof that the structured singular value is below a level, interval by interval of the frequency
axis (generalised KYP lemma).

The axis of x, omega [rad/s] or tan(omega dt / 2), is cut into closed intervals [a, b] from zero to
infinity. With states g, f = j x g, outputs y and inputs u, an interval is proved by Hermitian P and
Q > 0, by scalings X that commute with the perturbation and by K with K* = -K on the real blocks, if

    f*P g + g*P f + (x - a)(b - x) g*Q g + y*X_L y - u*K y - y*K* u - level^2 u*X_R u < 0

for all states and inputs, where x g stands for -j f. On the axis the first two terms are zero, and
on the interval the third is not negative (Iwasaki & Hara 2005). On an interval up to infinity the
third is (x - a) g*Q g. This does not prove stability, which has its own matrix. Everything is
assembled over the rationals.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated

import numpy as np
from flint import fmpq, fmpq_mat

from nlfrf._base.values import value
from robust.proofs.exact.claim import Matrices
from robust.proofs.exact.claim_files import SQUARE
from robust.proofs.exact.matrices import identity, positive_definite, stack
from robust.proofs.exact.polynomials import (
    Decision,
    proved,
    to_rational,
    to_rational_matrix,
    undecided,
)
from robust.proofs.exact.scaled_kyp import (
    LEVEL,
    STABLE,
    Block,
    ScaledClaim,
    place_scalings,
    require_blocks,
)
from robust.proofs.exact.verification import Verification, summarise_claims


@value
class ComplexMatrix:
    """A square complex matrix, by its real and imaginary parts."""

    re: Annotated[np.ndarray, SQUARE]
    im: Annotated[np.ndarray, SQUARE]

    @classmethod
    def of(cls, M: np.ndarray) -> ComplexMatrix:
        return cls(re=np.array(M.real, dtype=float), im=np.array(M.imag, dtype=float))

    @property
    def numbers(self) -> np.ndarray:
        return np.asarray(self.re + 1j * self.im)

    @property
    def exact(self) -> ExactMatrix:
        """The matrix over the rationals."""
        return ExactMatrix(re=to_rational_matrix(self.re), im=to_rational_matrix(self.im))


@value(copy=False)
class ExactMatrix:
    """A complex matrix over the rationals."""

    re: fmpq_mat
    im: fmpq_mat

    @classmethod
    def real(cls, M: fmpq_mat) -> ExactMatrix:
        return cls(re=M, im=M * fmpq(0))

    def __add__(self, other: ExactMatrix) -> ExactMatrix:
        return ExactMatrix(re=self.re + other.re, im=self.im + other.im)

    def __sub__(self, other: ExactMatrix) -> ExactMatrix:
        return self + other.times(fmpq(-1))

    def __mul__(self, other: ExactMatrix) -> ExactMatrix:
        return ExactMatrix(
            re=self.re * other.re - self.im * other.im, im=self.re * other.im + self.im * other.re
        )

    def times(self, factor: fmpq) -> ExactMatrix:
        return ExactMatrix(re=self.re * factor, im=self.im * factor)

    def times_j(self) -> ExactMatrix:
        return ExactMatrix(re=self.im * fmpq(-1), im=self.re)

    @property
    def H(self) -> ExactMatrix:
        """Conjugate transpose."""
        return ExactMatrix(re=self.re.transpose(), im=self.im.transpose() * fmpq(-1))

    @property
    def inverse(self) -> ExactMatrix:
        """Inverse; a ZeroDivisionError is raised if there is none."""
        rows = stack([[self.re, self.im * fmpq(-1)], [self.im, self.re]]).inv().tolist()
        n = self.re.nrows()
        return ExactMatrix(
            re=fmpq_mat([row[:n] for row in rows[:n]]), im=fmpq_mat([row[:n] for row in rows[n:]])
        )

    @property
    def is_hermitian(self) -> bool:
        return bool(self.re == self.re.transpose() and self.im == self.im.transpose() * fmpq(-1))

    @property
    def is_positive(self) -> bool:
        """True if it is Hermitian and positive definite; decided on [re, -im; im, re]."""
        return self.is_hermitian and positive_definite(
            stack([[self.re, self.im * fmpq(-1)], [self.im, self.re]])
        )


@value
class IntervalProof:
    """P and Q (n, n) in the coordinates T g, and X and K of each block, as in `IntervalClaim`."""

    P: ComplexMatrix
    Q: ComplexMatrix
    scalings: tuple[ComplexMatrix, ...]
    skews: tuple[ComplexMatrix, ...]

    def placed(self, blocks: tuple[Block, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return X_L on the outputs of the system, X_R on its inputs, K from outputs to inputs."""
        return place_scalings(
            blocks, *([M.numbers for M in part] for part in (self.scalings, self.skews))
        )


@value
class IntervalClaim:
    """A claim on a system, with the matrices that prove it on each interval."""

    # system, blocks, level: as in `robust.proofs.exact.scaled_kyp.ScaledClaim`
    system: Matrices
    blocks: tuple[Block, ...]
    level: float
    # (n, n) matrix, in the coordinates T x, that proves stability of the system
    stability: Annotated[np.ndarray, SQUARE]
    T: Annotated[np.ndarray, SQUARE]  # (n, n) coordinates
    # (I - 1,) boundaries between the intervals of x from zero to infinity: omega [rad/s], in
    # discrete time tan(omega dt / 2)
    cuts: np.ndarray
    # one for each interval. X of a block is (1, 1) for a full one, (rows, rows) and Hermitian for
    # the others. K is (rows, rows) with K* = -K for a real block, else zero.
    pieces: tuple[IntervalProof, ...]

    def __post_init__(self) -> None:
        sizes = require_blocks(self.system, self.blocks, self.level)
        n = self.system.order
        if not n:
            raise ValueError("system must have states for a proof by frequency intervals, got none")
        if self.cuts.shape != (len(self.pieces) - 1,) or not _is_increasing(self.cuts):
            raise ValueError(
                f"cuts must be one fewer than pieces, positive and increasing, got {self.cuts}"
            )
        wanted = [(self.stability, n), (self.T, n)]
        for piece in self.pieces:
            if len(piece.scalings) != len(sizes) or len(piece.skews) != len(sizes):
                raise ValueError(
                    "scalings and skews must have one entry for each block, got another number"
                )
            parts = [(piece.P, n), (piece.Q, n), *zip(piece.scalings, sizes, strict=True)]
            parts += zip(piece.skews, sizes, strict=True)
            wanted += [(M, size) for part, size in parts for M in (part.re, part.im)]
        if any(M.shape != (size, size) or not np.isfinite(M).all() for M, size in wanted):
            raise ValueError(
                "pieces must hold finite matrices that fit system and blocks, got something else"
            )

    @property
    def intervals(self) -> np.ndarray:
        """(I, 2) intervals [rad/s], the last one up to infinity or to the Nyquist frequency."""
        ends = np.concatenate([[0.0], self.cuts, [np.inf]])
        if self.system.dt:
            ends = 2 / self.system.dt * np.arctan(ends)
        return np.column_stack([ends[:-1], ends[1:]])

    def decide(self) -> dict[str, Decision]:
        """Decide stability, and the level on every interval.

        1/(s + 1) has mu of one at zero frequency; P = 1 proves that it is not larger elsewhere, with
        any small Q.

        >>> def matrix(x): return ComplexMatrix.of(np.array([[x]]))
        >>> lag = Matrices(A=-np.ones((1, 1)), B=np.ones((1, 1)), C=np.ones((1, 1)), D=np.zeros((1, 1)))
        >>> one = IntervalProof(P=matrix(1.0), Q=matrix(1e-9), scalings=(matrix(1.0),), skews=(matrix(0.0),))
        >>> known = dict(system=lag, blocks=((1, 1, "full"),), stability=np.ones((1, 1)), T=np.ones((1, 1)))
        >>> known |= dict(cuts=np.array([0.5]), pieces=(one, one))
        >>> [IntervalClaim(level=x, **known).decide()[LEVEL].holds for x in (0.99, 1.01)]
        [False, True]
        """
        loop = ExactLoop.of(self)
        stable = loop.is_stable(self.stability)
        found = {
            STABLE: proved() if stable else undecided("the matrix for stability does not pass")
        }
        ends = pairwise([0.0, *self.cuts.tolist(), None])
        for piece, (low, high), (start, end) in zip(self.pieces, ends, self.intervals, strict=True):
            if not loop.holds(piece, low or 0.0, high):
                return found | {
                    LEVEL: undecided(
                        f"the inequality does not pass from {start:.6g} to {end:.6g} rad/s"
                    )
                }
        return found | {LEVEL: proved()}


def _is_increasing(cuts: np.ndarray) -> bool:
    return bool(np.isfinite(cuts).all() and np.all(np.diff(cuts) > 0) and np.all(cuts > 0))


@value(copy=False)
class ExactLoop:
    """A system over the rationals: the quantities of the inequality as functions of states and
    inputs (x, u).
    """

    blocks: tuple[Block, ...]  # the structure
    # g, f: in coordinates T: f = j x g on the axis. In discrete time g = (A + I) x + B u, f = (A -
    # I) x + B u.
    g: ExactMatrix
    f: ExactMatrix
    # y, u: outputs and inputs
    y: ExactMatrix
    u: ExactMatrix
    # A, T: dynamics of the system, and the coordinates
    A: fmpq_mat
    T: fmpq_mat
    level: fmpq  # the level
    discrete: bool  # True if A is that of a discrete system

    @classmethod
    def of(cls, claim: IntervalClaim) -> ExactLoop:
        A, B, C, D, T = (
            to_rational_matrix(M)
            for M in (*(getattr(claim.system, name) for name in "ABCD"), claim.T)
        )
        n, m, one = A.nrows(), D.ncols(), identity(A.nrows())
        if claim.system.dt:
            g, f = [A + one, B], [A - one, B]
        else:
            g, f = [one, B * fmpq(0)], [A, B]
        return cls(
            blocks=claim.blocks,
            g=ExactMatrix.real(T * stack([g])),
            f=ExactMatrix.real(T * stack([f])),
            y=ExactMatrix.real(stack([[C, D]])),
            u=ExactMatrix.real(stack([[fmpq_mat(m, n), identity(m)]])),
            A=A,
            T=T,
            level=to_rational(claim.level),
            discrete=claim.system.dt > 0,
        )

    def is_stable(self, given: np.ndarray) -> bool:
        """Return whether a matrix P > 0 proves that the system is stable."""
        P, A = self.T.transpose() * to_rational_matrix(given) * self.T, self.A
        P = (P + P.transpose()) / fmpq(2)
        if self.discrete:
            falls = P - A.transpose() * P * A
        else:
            falls = (A.transpose() * P + P * A) * fmpq(-1)
        return positive_definite(P) and positive_definite(falls)

    def holds(self, piece: IntervalProof, low: float, high: float | None) -> bool:
        """Return whether a piece proves its interval; high : None for infinity."""
        P, Q, g, f, y, u = piece.P.exact, piece.Q.exact, self.g, self.f, self.y, self.u
        if not (P.is_hermitian and Q.is_positive and _has_structure(piece, self.blocks)):
            return False
        X_L, X_R, K = (ComplexMatrix.of(M).exact for M in piece.placed(self.blocks))
        across = (f.H * Q * g).times_j().times(fmpq(1, 2))
        along, square = across + across.H, g.H * Q * g  # x g*Q g and g*Q g on the axis
        a = to_rational(low)
        if high is None:
            within = along - square.times(a)
        else:
            b = to_rational(high)
            within = along.times(a + b) - f.H * Q * f - square.times(a * b)
        storage, turned = f.H * P * g, u.H * K * y
        gain = y.H * X_L * y - turned - turned.H - (u.H * X_R * u).times(self.level**2)
        return (storage + storage.H + within + gain).times(fmpq(-1)).is_positive


def _has_structure(piece: IntervalProof, blocks: tuple[Block, ...]) -> bool:
    """Return whether each X is Hermitian and positive definite, and each K* = -K on a real block
    and zero elsewhere.
    """
    return all(
        X.exact.is_positive
        and K.exact.times_j().is_hermitian
        and (kind == "real" or not (K.re.any() or K.im.any()))
        for (_, _, kind), X, K in zip(blocks, piece.scalings, piece.skews, strict=True)
    )


def verify_level(claim: ScaledClaim | IntervalClaim, *, time_cap: float = 60.0) -> Verification:
    """Prove the claim again over the rationals; it takes milliseconds an interval, and `time_cap`
    has no effect.
    """
    del time_cap
    return summarise_claims(claim.decide())
