"""One convex step of the fixed-structure design: second-order cones, line by line.

Unknown are the parameters, in coordinates eta in which the columns of Y and of c X over P_c are orthonormal, and,
where a demand adds the two, |Y| and |X|. A modulus on the small side of a demand is a cone; one on the large side is
replaced by what the previous iterate leaves of it:

    |R| >= Re(R R_c*)/|R_c|     for demands that must be met
    |R|^2 >= 2 Re(R R_c*) - |R_c|^2     for the level that is minimised: a^2 <= level |R|^2 is a rotated cone

Both are exact at the previous iterate, so that it stays feasible and no step is a step back (Karimi & Kammer,
Automatica 85 (2017), eq. 22 to 26).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nlfrf._base.values import value
from robust.proofs.search.certificate import solve_program

if TYPE_CHECKING:
    import cvxpy

MAX_STEP_RATIO = 100.0


@value(copy=False)
class Rows:
    """Demands of one kind, over their own previous |R_c|: line (H,), a, b, c (H,) and Re(R/R_c) (H, n)."""

    line: np.ndarray
    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    R: np.ndarray


@value(copy=False)
class Step:
    """The numbers of one convex step, in eta.

    Fields
    ------
    eta : (n,) ndarray
        Of the previous iterate.
    Y, X : (F, n) complex ndarray
        Y and |c| X over the previous |P_c|.
    hard, aim : Rows
        Demands to be met; demands whose level is minimised.
    linear : (Q, n) ndarray
        linear @ eta >= 0.
    gain, scale : (n,) ndarray
        What is maximised where there is no aim, and what is kept at one meanwhile.
    """

    eta: np.ndarray
    Y: np.ndarray
    X: np.ndarray
    hard: Rows
    aim: Rows
    linear: np.ndarray
    gain: np.ndarray
    scale: np.ndarray


def solve_step(step: Step) -> tuple[np.ndarray | None, str]:
    """eta, or None and what went wrong; whether it is any good is judged by whoever asked."""
    import cvxpy as cp

    n = step.Y.shape[1]
    eta = cp.Variable(n)
    both = {kind: (rows.a > 0) & (rows.b > 0) for kind, rows in (("hard", step.hard), ("aim", step.aim))}
    lines = np.unique(np.concatenate([step.hard.line[both["hard"]], step.aim.line[both["aim"]]]))
    place = np.zeros(step.Y.shape[0], dtype=int)
    place[lines] = np.arange(lines.size)
    constraints = [
        cp.norm(eta) <= MAX_STEP_RATIO * np.linalg.norm(step.eta)
    ]  # a step, where there is no end to improvement
    constraints += [step.linear @ eta >= 0] if step.linear.size else []
    sizes: list[cvxpy.Variable] = []
    for part in (step.Y, step.X):
        if lines.size:
            size = cp.Variable(lines.size)
            constraints.append(cp.SOC(size, cp.vstack([part[lines].real @ eta, part[lines].imag @ eta]), axis=0))
            sizes.append(size)

    def small(rows: Rows, pick: np.ndarray) -> cvxpy.Expression:
        return cp.multiply(rows.a[pick], sizes[0][place[rows.line[pick]]]) + cp.multiply(
            rows.b[pick], sizes[1][place[rows.line[pick]]]
        )

    def alone(rows: Rows, pick: np.ndarray) -> list[cvxpy.Expression]:
        part = np.where(
            rows.a[pick, None] > 0,
            rows.a[pick, None] * step.Y[rows.line[pick]],
            rows.b[pick, None] * step.X[rows.line[pick]],
        )
        return [part.real @ eta, part.imag @ eta]

    for pick in (both["hard"], ~both["hard"]):
        if pick.any():
            right_side = step.hard.R[pick] @ eta
            constraints.append(
                small(step.hard, pick) <= right_side
                if pick is both["hard"]
                else cp.SOC(right_side, cp.vstack(alone(step.hard, pick)), axis=0)
            )
    if step.aim.line.size:
        level = cp.Variable()
        for pick in (both["aim"], ~both["aim"]):
            if pick.any():
                square = 2 * (step.aim.R[pick] @ eta) - 1
                parts = [small(step.aim, pick)] if pick is both["aim"] else alone(step.aim, pick)
                if np.any(step.aim.c[pick] > 0):
                    third = step.aim.c[pick, None] * step.X[step.aim.line[pick]]
                    parts += [third.real @ eta, third.imag @ eta]
                wide = level * np.ones(int(pick.sum()))
                constraints.append(cp.SOC(wide + square, cp.vstack([2 * p for p in parts] + [wide - square]), axis=0))
        goal: cvxpy.Minimize | cvxpy.Maximize = cp.Minimize(level)
    else:
        constraints.append(step.scale @ eta == 1)
        goal = cp.Maximize(step.gain @ eta)
    problem = cp.Problem(goal, constraints)
    failed = solve_program(problem, "CLARABEL")
    if failed:
        return None, failed
    if eta.value is None or not np.isfinite(eta.value).all():
        return None, f"the solver gave no step ({problem.status})"
    return np.asarray(eta.value, dtype=float), ""
