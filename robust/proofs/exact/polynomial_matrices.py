"""Matrices that are polynomials of one parameter theta, in balls, and their definiteness on an
interval.

On [a, b] a polynomial lies in the convex hull of its Bernstein coefficients (Garloff 2000). If all
of these are positive definite, so is the matrix at every theta of [a, b]. With one parameter,
bisection makes this exact. Doubles choose the intervals, balls decide.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import comb
from typing import TypeVar

import numpy as np
from flint import arb, arb_mat

BITS = 256  # of the balls: far more than the doubles that they begin with
_MAX_LEAVES = 200
Part = TypeVar("Part", arb_mat, "PolynomialMatrix")


class PolynomialMatrix:
    """A matrix polynomial; `parts` are its coefficients (arb_mat), lowest power first."""

    def __init__(self, parts: Sequence[arb_mat]) -> None:
        self.parts = list(parts)

    @classmethod
    def of(cls, array: np.ndarray) -> PolynomialMatrix:
        """Return the polynomial with coefficients (d + 1, rows, cols) in doubles, exactly."""
        _, rows, cols = array.shape
        return cls([arb_mat(rows, cols, part.ravel().tolist()) for part in array])

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of rows and columns."""
        return self.parts[0].nrows(), self.parts[0].ncols()

    def __add__(self, other: PolynomialMatrix) -> PolynomialMatrix:
        if len(self.parts) >= len(other.parts):
            long, short = self, other
        else:
            long, short = other, self
        n = len(short.parts)
        return PolynomialMatrix(
            [p + q for p, q in zip(long.parts, short.parts, strict=False)] + long.parts[n:]
        )

    def __neg__(self) -> PolynomialMatrix:
        return PolynomialMatrix([-p for p in self.parts])

    def __sub__(self, other: PolynomialMatrix) -> PolynomialMatrix:
        return self + (-other)

    def __mul__(self, other: PolynomialMatrix | arb) -> PolynomialMatrix:
        if isinstance(other, arb):
            return PolynomialMatrix([p * other for p in self.parts])
        (rows, _), (_, cols) = self.shape, other.shape
        made = [arb_mat(rows, cols) for _ in range(len(self.parts) + len(other.parts) - 1)]
        for i, p in enumerate(self.parts):
            for j, q in enumerate(other.parts):
                made[i + j] += p * q
        return PolynomialMatrix(made)

    def scaled(self, factor: arb | float) -> PolynomialMatrix:
        """Return factor times the polynomial."""
        return self * arb(factor)

    def transpose(self) -> PolynomialMatrix:
        """Return the transposed polynomial."""
        return PolynomialMatrix([p.transpose() for p in self.parts])

    def derivative(self) -> PolynomialMatrix:
        """Return the derivative by theta."""
        return PolynomialMatrix(
            [p * arb(k) for k, p in enumerate(self.parts) if k] or [self.parts[0] * arb(0)]
        )

    def at(self, theta: arb | float) -> arb_mat:
        """Return the matrix at theta."""
        made = self.parts[-1]
        for p in self.parts[-2::-1]:
            made = made * arb(theta) + p
        return made

    def to_array(self) -> np.ndarray:
        """Return (d + 1, rows, cols) coefficients rounded to doubles."""
        return np.array([[float(x.mid()) for x in p.entries()] for p in self.parts]).reshape(
            len(self.parts), *self.shape
        )

    def is_positive_definite(self) -> bool:
        """Return whether a symmetric matrix is positive definite at every theta in [-1, 1]."""
        if not self.shape[0]:
            return True
        leaves = _choose_intervals(self.to_array())
        return leaves is not None and all(
            _is_positive(part) for low, high in leaves for part in bernstein(self.parts, low, high)
        )


def stacked(rows: Sequence[PolynomialMatrix]) -> PolynomialMatrix:
    """Return the polynomial whose rows are those of all given ones."""
    cols, longest = rows[0].shape[1], max(len(row.parts) for row in rows)
    height = sum(row.shape[0] for row in rows)
    parts = []
    for k in range(longest):
        entries = [
            x
            for p in rows
            for x in (p.parts[k].entries() if k < len(p.parts) else [0] * (p.shape[0] * cols))
        ]
        parts.append(arb_mat(height, cols, entries))
    return PolynomialMatrix(parts)


def _bernstein_map(n: int, low: float, high: float) -> np.ndarray:
    """Return (n + 1, n + 1) map from n + 1 coefficients in theta to those of Bernstein on [low,
    high] (dyadic ends).
    """
    moved = np.zeros((n + 1, n + 1))  # powers of t, theta = low + (high - low) t
    for k in range(n + 1):
        moved[: k + 1, k] = [comb(k, j) * low ** (k - j) * (high - low) ** j for j in range(k + 1)]
    rise = np.array(
        [[comb(i, j) / comb(n, j) if j <= i else 0.0 for j in range(n + 1)] for i in range(n + 1)]
    )
    return np.asarray(rise @ moved)


def _choose_intervals(coefficients: np.ndarray) -> list[tuple[float, float]] | None:
    """Return intervals on which, in doubles, all Bernstein coefficients are positive definite; None
    if one is not.
    """
    n = len(coefficients) - 1
    scale = np.sqrt(np.abs(np.diagonal(coefficients, axis1=1, axis2=2)).sum(axis=0))
    if not (np.isfinite(coefficients).all() and np.all(scale > 0)):
        return None
    coefficients = coefficients / np.outer(scale, scale)
    open_ = [(-1.0, 1.0)]
    leaves: list[tuple[float, float]] = []
    while open_:
        low, high = open_.pop()
        middle = (low + high) / 2
        values = np.tensordot(
            np.array([[x**k for k in range(n + 1)] for x in (low, middle, high)]), coefficients, 1
        )
        if np.linalg.eigvalsh(values).min() <= 0 or len(open_) + len(leaves) > _MAX_LEAVES:
            return None
        if (
            np.linalg.eigvalsh(np.tensordot(_bernstein_map(n, low, high), coefficients, 1)).min()
            > 0
        ):
            leaves.append((low, high))
        else:
            open_ += [(low, middle), (middle, high)]
    return leaves


def shifted(parts: Sequence[Part], low: arb | float, width: arb | float) -> list[Part]:
    """Return the coefficients in t of a polynomial of theta = low + width t (Horner)."""
    made, n = list(parts), len(parts) - 1
    for i in range(n):
        for k in range(n - 1, i - 1, -1):
            made[k] = made[k] + made[k + 1] * arb(low)
    return [c * arb(width) ** j for j, c in enumerate(made)]


def bernstein(parts: Sequence[Part], low: arb | float, high: arb | float) -> list[Part]:
    """Return the Bernstein coefficients on [low, high]."""
    n = len(parts) - 1
    rows = [
        c * (1 / arb(comb(n, j))) for j, c in enumerate(shifted(parts, low, arb(high) - arb(low)))
    ]
    made = rows[:1]
    for _ in range(n):  # b_i = sum_j binom(i, j) row_j, as sums along Pascal's triangle
        rows = [a + b for a, b in pairwise(rows)]
        made.append(rows[0])
    return made


def _is_positive(matrix: arb_mat) -> bool:
    """Return whether a symmetric matrix is certainly positive definite:

    X M X' has a dominant diagonal.

    X is the inverse of a Cholesky factor in doubles, a triangle without a zero on its diagonal.
    """
    n = matrix.nrows()
    middle = np.array([float(x.mid()) for x in matrix.entries()]).reshape(n, n)
    scale = np.abs(np.diag(middle)) ** -0.5
    try:
        X = np.linalg.inv(np.linalg.cholesky(middle * np.outer(scale, scale))) * scale
    except np.linalg.LinAlgError:
        return False
    X = np.tril(X)
    if not (np.isfinite(X).all() and np.all(np.diag(X) > 0)):
        return False
    ball = arb_mat(n, n, X.ravel().tolist())
    rows = (ball * matrix * ball.transpose()).tolist()
    return all(
        bool(row[i] - sum((abs(x) for j, x in enumerate(row) if j != i), arb(0)) > 0)
        for i, row in enumerate(rows)
    )
