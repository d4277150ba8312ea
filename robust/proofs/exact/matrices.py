"""Matrix inequalities decided over the rationals: positive definite or not, with nothing in between.

Inequalities that hold on an interval of a parameter are such at the Bernstein coefficients of the interval: build those
from `to_rational_matrix` and exact sums and products, and ask for each.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

from flint import arb, arb_mat, arb_poly, ctx, fmpq_mat

from robust.proofs.exact.claim import Matrices
from robust.proofs.exact.polynomials import (
    Coefficient,
    Decision,
    positive_on_half_line,
    proved,
    refuted,
    routh,
    to_rational,
    to_rational_matrix,
    undecided,
)

BITS = (128, 512)
AnyMatrix = TypeVar("AnyMatrix", fmpq_mat, arb_mat)


def positive_definite(matrix: fmpq_mat) -> bool:
    """Return whether a symmetric matrix of rationals (fmpq_mat) is positive definite: all pivots of its LDL' positive.

    Balls decide where they can, rationals where they cannot.

    >>> from flint import fmpq, fmpq_mat
    >>> edge = fmpq(10**30 - 1, 10**30)
    >>> [positive_definite(fmpq_mat([[1, x], [x, 1]])) for x in (edge, fmpq(1))]
    [True, False]
    """
    rows = matrix.tolist()
    if any(rows[i][j] != rows[j][i] for i in range(len(rows)) for j in range(i)):
        raise ValueError("matrix must be symmetric, got one that is not")
    for bits in BITS:
        with ctx.workprec(bits):
            pivots = ldl_pivots([[arb(x) for x in row] for row in rows])
        if all(p > 0 for p in pivots):
            return True
        if any(p < 0 for p in pivots):
            return False
    return all(p > 0 for p in ldl_pivots(rows))


def ldl_pivots(rows: Sequence[Sequence[Coefficient]]) -> list[Coefficient]:
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


# ---- A norm bound of a system with any number of inputs and outputs, decided in exact arithmetic.
#
# A stable system has norm below a level at every frequency iff level^2 - D'D > 0 and the Hamiltonian matrix has no
# eigenvalue on the imaginary axis (Boyd, Balakrishnan & Kabamba 1989). Its characteristic polynomial has rational
# coefficients and only even powers.

MAX_STATES = 40
NORM_BITS = (256, 1024, 4096)
NOT_EXAMINED = undecided("not looked at")


def decide_norm(system: Matrices, level: float) -> dict[str, Decision]:
    """Stability and a norm bound, each decided; for an unstable system the bound is not looked at.

    >>> import numpy as np
    >>> one = np.ones((1, 1))
    >>> lag = Matrices(A=-one, B=one, C=one, D=0 * one)                   # 1/(s + 1): the norm is one
    >>> [decide_norm(lag, x)["norm"].holds for x in (1.0, np.nextafter(1, 2))]
    [False, True]
    """
    n = system.order
    A, B, C, D = (to_rational_matrix(getattr(system, name)) for name in "ABCD")
    if system.dt and n:
        shifted = A + identity(n)
        if shifted.det() == 0:
            return {"stability": refuted("a pole at -1")}
        back = shifted.inv()
        A, B, C, D = back * (A - identity(n)), back * B * to_rational(2.0), C * back, D - C * back * B
    stable = routh(A.charpoly(), n) if n else proved()
    return {
        "stability": stable,
        "norm": gain_below_level(A, B, C=C, D=D, level=level) if stable.holds else NOT_EXAMINED,
    }


def gain_below_level(A: fmpq_mat, B: fmpq_mat, *, C: fmpq_mat, D: fmpq_mat, level: float) -> Decision:
    """Return whether the largest singular value of D + C (s - A)^-1 B stays below the level on the imaginary axis."""
    n, m = A.nrows(), D.ncols()
    R = identity(m) * (to_rational(level) ** 2) - D.transpose() * D
    if not positive_definite(R):
        return refuted("not below the level at infinite frequency")
    if n == 0:
        return proved()
    inverse = R.inv()
    F = A + B * inverse * D.transpose() * C
    upper, lower = B * inverse * B.transpose(), C.transpose() * C + C.transpose() * D * inverse * D.transpose() * C
    p = stack([[F, upper], [-lower, -F.transpose()]]).charpoly().coeffs()[::2]  # in s^2 = -y
    on_axis = [c if (k + n) % 2 == 0 else -c for k, c in enumerate(p)]
    found = undecided("not looked at")
    for bits in NORM_BITS:
        with ctx.workprec(bits):
            found = positive_on_half_line(arb_poly(on_axis))
        if not found.needs_digits:
            break
    return found


def identity(n: int) -> fmpq_mat:
    """Return the identity over the rationals."""
    return fmpq_mat(n, n, [int(i == j) for i in range(n) for j in range(n)])


def stack(parts: Sequence[Sequence[AnyMatrix]]) -> AnyMatrix:
    """Return one matrix of rows of matrices, over the rationals or in balls."""
    lines = (zip(*(M.tolist() for M in line), strict=True) for line in parts)
    rows = [[x for row in across for x in row] for line in lines for across in line]
    kind = type(parts[0][0])
    return kind(len(rows), sum(M.ncols() for M in parts[0]), [x for row in rows for x in row])
