"""The loop of a sliding machine over the rationals, its equilibrium under a friction force of 1 N,
and the supply rate of a class of friction.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

from flint import fmpq, fmpq_mat

from nlfrf._base.values import value
from robust.proofs.exact.matrices import identity

Row: TypeAlias = list[fmpq | int]
Rows: TypeAlias = list[Sequence[fmpq | int]]


@value(copy=False)
class ExactLoop:
    """Flow xi' = F xi + B f over each span after its jump, as matrices of rationals; x, v rows at
    each port.
    """

    F: fmpq_mat
    B: fmpq_mat
    x: fmpq_mat
    v: fmpq_mat
    spans: list[fmpq]
    jumps: list[fmpq_mat]


def block_diagonal(first: fmpq_mat, second: fmpq_mat) -> fmpq_mat:
    rows: Rows = [[*row, *[0] * second.ncols()] for row in first.tolist()]
    rows += [[*[0] * first.ncols(), *row] for row in second.tolist()]
    return fmpq_mat(rows)


def equilibrium(loop: ExactLoop) -> fmpq_mat:
    """Return the exact equilibrium under f = 1 at each port, one column each; raise a ValueError if
    there is none.
    """
    n = loop.F.nrows()
    rows, wanted = loop.F.tolist(), (-loop.B).tolist()
    unit = identity(n)
    for jump in loop.jumps:
        rows, wanted = rows + (jump - unit).tolist(), wanted + [[fmpq(0)] * loop.B.ncols()] * n
    M, b = fmpq_mat(rows), fmpq_mat(wanted)
    try:
        there = (M.transpose() * M).solve(M.transpose() * b)
    except ZeroDivisionError:
        raise ValueError("the rest of the loop is not unique") from None
    if M * there != b:
        raise ValueError("the loop does not rest under a constant friction")
    return there


@value(copy=False)
class ExactBlock:
    """A dead zone: its output w enters the jump or the flow by `input_column`, and 2 w output_row y
    >= weight w^2.
    """

    # input_column, output_row: both as columns
    input_column: fmpq_mat
    output_row: fmpq_mat
    weight: fmpq


# ---- The dissipation inequality of a class of friction over the rationals: supply z'Qz + 2 z'N d +
# d'R d, and storage.


@value(copy=False)
class ExactSupply:
    """A flow z' = A z + B d with jumps, its supply, and the rest of the stored energy, as matrices
    of rationals.
    """

    A: fmpq_mat
    B: fmpq_mat
    Q: fmpq_mat
    N: fmpq_mat
    R: fmpq_mat
    stored: fmpq_mat
    jumps: list[fmpq_mat]
    block: ExactBlock | None = None  # nonlinearity at the first jump


def with_force_filters(
    loop: ExactLoop, rates: list[fmpq]
) -> tuple[list[list[fmpq]], list[fmpq_mat]]:
    """Append the filters of the friction force to the flow and to the jumps."""
    extra = len(rates)
    fall = fmpq_mat(
        extra, extra, [-a if i == j else 0 for i, a in enumerate(rates) for j in range(extra)]
    )
    return block_diagonal(loop.F, fall).tolist(), [
        block_diagonal(jump, identity(extra)) for jump in loop.jumps
    ]
