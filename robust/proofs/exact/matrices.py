"""Matrix inequalities decided over the rationals.

An inequality that holds at the Bernstein coefficients on an interval of a parameter holds on the
interval. Compute these coefficients from `to_rational_matrix` by exact sums and products, and
decide each of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

from flint import arb, arb_mat, ctx, fmpq_mat

from robust.proofs.exact.polynomials import (
    Coefficient,
)

_BITS = (128, 512)
AnyMatrix = TypeVar("AnyMatrix", fmpq_mat, arb_mat)


def positive_definite(matrix: fmpq_mat) -> bool:
    """Return whether a symmetric matrix of rationals (fmpq_mat) is positive definite: all pivots of
    its LDL' positive.

    Balls decide if they can, otherwise rationals.

    >>> from flint import fmpq, fmpq_mat
    >>> edge = fmpq(10**30 - 1, 10**30)
    >>> [positive_definite(fmpq_mat([[1, x], [x, 1]])) for x in (edge, fmpq(1))]
    [True, False]
    """
    rows = matrix.tolist()
    if any(rows[i][j] != rows[j][i] for i in range(len(rows)) for j in range(i)):
        raise ValueError("matrix must be symmetric, got one that is not")
    for bits in _BITS:
        with ctx.workprec(bits):
            pivots = ldl_pivots([[arb(x) for x in row] for row in rows])
        if all(p > 0 for p in pivots):
            return True
        if any(p < 0 for p in pivots):
            return False
    return all(p > 0 for p in ldl_pivots(rows))


def ldl_pivots(rows: Sequence[Sequence[Coefficient]]) -> list[Coefficient]:
    """Return the pivots of the LDL' of a symmetric matrix, up to the first that is not certainly
    positive.
    """
    left = [list(row) for row in rows]
    pivots = []
    while left:
        pivot, *rest = left[0]
        pivots.append(pivot)
        if not pivot > 0:
            break
        factors = [x / pivot for x in rest]
        left = [
            [x - f * y for x, y in zip(row[1:], rest, strict=True)]
            for f, row in zip(factors, left[1:], strict=True)
        ]
    return pivots


def identity(n: int) -> fmpq_mat:
    return fmpq_mat(n, n, [int(i == j) for i in range(n) for j in range(n)])


def stack(parts: Sequence[Sequence[AnyMatrix]]) -> AnyMatrix:
    """Return one matrix from rows of matrices, over the rationals or in balls."""
    lines = (zip(*(M.tolist() for M in line), strict=True) for line in parts)
    rows = [[x for row in across for x in row] for line in lines for across in line]
    kind = type(parts[0][0])
    return kind(len(rows), sum(M.ncols() for M in parts[0]), [x for row in rows for x in row])
