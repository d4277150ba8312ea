"""The sliding loop of a claim over the rationals: flows between samples, jumps at them, where it rests under 1 N."""

from __future__ import annotations

from typing import Any

from nlfrf.shared.values import value
from robust.friction_verification.claim import FrictionClaim
from robust.verification.exact import rational, rational_matrix

__all__ = ["ExactLoop", "exact_loop", "identity", "rest_of"]


@value(copy=False)
class ExactLoop:
    """Flow xi' = F xi + B f over each span after its jump, as matrices of rationals; x, v rows at the port.

    Fields
    ------
    F, B, x, v : fmpq_mat
    spans : list of fmpq
    jumps : list of fmpq_mat
    """

    F: Any
    B: Any
    x: Any
    v: Any
    spans: list[Any]
    jumps: list[Any]


def exact_loop(claim: FrictionClaim) -> ExactLoop:
    """The loop of machine, hold, delay and controller, with the state (machine, held force, waiting forces, K)."""
    from flint import fmpq_mat

    A, B, C = (rational_matrix(getattr(claim.machine, name)).tolist() for name in "ABC")
    K = {name: rational_matrix(getattr(claim.controller, name)).tolist() for name in "ABCD"}
    n, s = claim.machine.order, claim.controller.order
    D, T = K["D"][0][0], rational(claim.controller.dt)
    if not T:
        size = n + s
        F = [[A[i][j] - D * B[i][0] * C[0][j] for j in range(n)] + [B[i][0] * c for c in K["C"][0]] for i in range(n)]
        F += [[-K["B"][i][0] * C[0][j] for j in range(n)] + list(K["A"][i]) for i in range(s)]
        spans, jumps = [], []
    else:
        whole, part = samples(rational(claim.delay), T)
        waiting = whole + (part > 0)
        size, own = n + 1 + waiting + s, n + 1 + waiting
        F = [list(A[i]) + [B[i][0]] + [0] * (size - n - 1) for i in range(n)] + [[0] * size for _ in range(size - n)]
        asked = [-D * c for c in C[0]] + [0] * (1 + waiting) + list(K["C"][0]) if s else [-D * c for c in C[0]]
        asked = asked + [0] * (size - len(asked))
        rows = identity(size)
        forces = [asked, *identity(size)[n + 1 : own]]  # the new one, then those that wait, the oldest last
        rows[n + 1 : own] = forces[:waiting]
        for i in range(s):
            rows[own + i] = [-K["B"][i][0] * c for c in C[0]] + [0] * (1 + waiting) + list(K["A"][i])
        spans, jumps = [T], [rows]
        if part > 0:
            late = identity(size)
            late[n] = identity(size)[n + waiting]
            spans, jumps = [part, T - part], [rows, late]
        else:
            rows[n] = forces[waiting]
    velocity = [sum((C[1][i] * A[i][j] for i in range(n)), start=rational(0.0)) for j in range(n)]
    return ExactLoop(
        F=fmpq_mat(F),
        B=fmpq_mat([[-B[i][1]] for i in range(n)] + [[0]] * (size - n)),
        x=fmpq_mat([list(C[1]) + [0] * (size - n)]),
        v=fmpq_mat([velocity + [0] * (size - n)]),
        spans=spans,
        jumps=[fmpq_mat(jump) for jump in jumps],
    )


def samples(delay: Any, T: Any) -> tuple[int, Any]:
    """Whole samples of a delay, and what is left [s]."""
    from flint import fmpq

    near = fmpq(1, 10**9)
    whole = int((delay / T + near).floor())
    left = delay - whole * T
    return whole, left if left > near * T else fmpq(0)


def identity(n: int) -> list[list[int]]:
    """Rows of the identity."""
    return [[int(i == j) for j in range(n)] for i in range(n)]


def rest_of(loop: ExactLoop) -> Any:
    """Where the loop rests under f = 1, exactly; a ValueError where there is no such place."""
    from flint import fmpq_mat

    n = loop.F.nrows()
    rows, wanted = loop.F.tolist(), (-loop.B).tolist()
    unit = fmpq_mat(identity(n))
    for jump in loop.jumps:
        rows, wanted = rows + (jump - unit).tolist(), wanted + [[0]] * n
    M, b = fmpq_mat(rows), fmpq_mat(wanted)
    try:
        there = (M.transpose() * M).solve(M.transpose() * b)
    except ZeroDivisionError:
        raise ValueError("the loop may rest in many places") from None
    if M * there != b:
        raise ValueError("the loop does not rest under a constant friction")
    return there
