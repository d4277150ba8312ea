"""Matrix inequalities decided over the rationals: positive definite or not, with nothing in between.

Inequalities that hold on an interval of a parameter are such at the Bernstein coefficients of the interval: build those
from `rational_matrix` and exact sums and products, and ask for each.
"""

from __future__ import annotations

from typing import Any

__all__ = ["pivots_of", "positive_definite"]


BITS = (128, 512)


def positive_definite(matrix: Any) -> bool:
    """Whether a symmetric matrix of rationals (fmpq_mat) is positive definite: all pivots of its LDL' positive.

    Balls decide where they can, rationals where they cannot.

    >>> from flint import fmpq, fmpq_mat
    >>> edge = fmpq(10**30 - 1, 10**30)
    >>> [positive_definite(fmpq_mat([[1, x], [x, 1]])) for x in (edge, fmpq(1))]
    [True, False]
    """
    from flint import arb, ctx

    rows = matrix.tolist()
    if any(rows[i][j] != rows[j][i] for i in range(len(rows)) for j in range(i)):
        raise ValueError("matrix must be symmetric, got one that is not")
    for bits in BITS:
        with ctx.workprec(bits):
            pivots = pivots_of([[arb(x) for x in row] for row in rows])
        if all(p > 0 for p in pivots):
            return True
        if any(p < 0 for p in pivots):
            return False
    return all(p > 0 for p in pivots_of(rows))


def pivots_of(rows: list[list[Any]]) -> list[Any]:
    """Pivots of the LDL' of a symmetric matrix, up to the first that is not certainly positive."""
    left = [list(row) for row in rows]
    pivots = []
    while left:
        pivot, *rest = left[0]
        pivots.append(pivot)
        if not pivot > 0:
            break
        factors = [x / pivot for x in rest]
        left = [
            [x - f * y for x, y in zip(row[1:], rest, strict=True)] for f, row in zip(factors, left[1:], strict=True)
        ]
    return pivots
