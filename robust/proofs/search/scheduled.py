"""Search for P(theta) and the scalings of a `ScheduleClaim`: an LMI at nodes of theta, then a check
at every theta.

cvxpy proposes the matrices in balanced coordinates; the solver status is not used. If the check
fails between two nodes, more nodes are tried.
"""

from __future__ import annotations

from dataclasses import replace

import control
import numpy as np
from flint import ctx

from robust.proofs.exact.polynomial_matrices import BITS, PolynomialMatrix
from robust.proofs.exact.polynomials import Decision, undecided
from robust.proofs.exact.scheduled_kyp import (
    ScheduleClaim,
    decide_schedule,
    inequalities,
    moved_polynomials,
    scaled_blocks,
)
from robust.proofs.exact.scheduled_loop import ScheduledLoop
from robust.proofs.search.programs import solve_program
from robust.proofs.search.scaled_kyp import ScalingSearch

_NODES = np.cos(np.pi * np.arange(9) / 8)
_GRID = np.linspace(-1, 1, 201)  # where the least eigenvalue is looked for, for more nodes
_ROUNDS = 4
_LEAST, _LARGEST = 1e-7, 1e3  # eigenvalue of P and X, and of P on average


def search_schedule(claim: ScheduleClaim, degree: int) -> tuple[ScheduleClaim | None, Decision]:
    """Return the claim with P of a degree and X that prove it, or None, and the decision on the
    last proposal.

    claim : with any P, S and scalings.
    """
    with ctx.workprec(BITS):
        loop = claim.loop()
    if loop is None:
        return None, undecided("theta moves too fast within a sample")
    start = _balanced_coordinates(loop, claim.level if claim.gain else 1.0)
    if start is None:
        return None, undecided("the loop is not stable with theta held in the middle")
    decision = undecided("no P was found")
    nodes = _NODES
    for _ in range(_ROUNDS):
        found = _solve(loop, claim, degree, start, nodes)
        if found is None:
            break
        decision = decide_schedule(found)
        if decision.holds:
            return found, decision
        nodes = np.union1d(nodes, _weakest_points(loop, found))
    return None, decision


def _weakest_points(loop: ScheduledLoop, claim: ScheduleClaim) -> np.ndarray:
    """Return the theta of the grid at which an inequality fails most, locally; if it holds there,
    its least margin.
    """
    with ctx.workprec(BITS):
        arrays = [(-M).to_array() for M in inequalities(loop, claim)]
    made: list[float] = []
    for array in arrays:
        values = np.tensordot(_GRID[:, None] ** np.arange(len(array)), array, 1)
        scale = np.sqrt(np.abs(np.diagonal(values, axis1=1, axis2=2)).max(axis=0))
        least = np.linalg.eigvalsh(values / np.outer(scale, scale))[:, 0]
        padded = np.concatenate([[np.inf], least, [np.inf]])
        local = (
            (least <= padded[:-2]) & (least <= padded[2:]) & ((least < 0) | (least == least.min()))
        )
        made += _GRID[local].tolist()
    return np.array(made)


def _balanced_coordinates(
    loop: ScheduledLoop, level: float
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return S and a scaling d of each block from the loop with theta held in the middle; None if
    it is not stable.
    """
    parts = [getattr(loop, name).to_array()[0] for name in "ABCD"]
    A = parts[0]
    poles = np.linalg.eigvals(A)
    if not (np.all(np.abs(poles) < 1) if loop.dt else np.all(poles.real < 0)):
        return None
    n = len(A)
    blocks = loop.blocks
    if blocks:
        parts[2][-blocks[-1][0] :] /= level
        parts[3][-blocks[-1][0] :] /= level
    if not blocks:  # stability alone: a channel from and to every state in balanced units
        parts, blocks = [A, np.eye(n), np.eye(n), np.zeros((n, n))], [(n, n)]
    frozen = control.StateSpace(*parts, loop.dt or 0, remove_useless_states=False)
    search = ScalingSearch.of(frozen, tuple((*block, "full") for block in blocks), 1.0)
    return np.linalg.inv(search.T), search.balance[: len(loop.blocks)]


def _solve(
    loop: ScheduledLoop,
    claim: ScheduleClaim,
    degree: int,
    start: tuple[np.ndarray, np.ndarray],
    nodes: np.ndarray,
) -> ScheduleClaim | None:
    """Return the claim with the P and X of the largest margin at nodes, or None."""
    import cvxpy as cp

    S, d = start
    system = _in_coordinates(loop, S, d)
    n, m = system[1].shape[1:]
    P = [cp.Variable((n, n), symmetric=True) for _ in range(degree + 1)]
    X, t = cp.Variable(max(d.size, 1), nonneg=True), cp.Variable()
    decay = system[0][0] - (np.eye(n) if loop.dt else 0)
    units = np.concatenate(
        [1 / np.sqrt(np.maximum(np.linalg.norm(decay, axis=0), 1e-9)), np.ones(m)]
    )
    constraints = [t <= 1, cp.trace(P[0]) <= _LARGEST * n, X >= _LEAST]
    E = np.eye(n, n + m)
    for theta in nodes:
        A, B, C, D = (np.tensordot(theta ** np.arange(len(M)), M, 1) for M in system)
        AB, CD = np.hstack([A, B]), np.hstack([C, D])
        here = sum(p * theta**k for k, p in enumerate(P))
        supply = np.zeros((n + m, n + m))
        for k, unit in enumerate(np.eye(d.size)):
            left, right = scaled_blocks(loop.blocks, unit, claim.level if claim.gain else None)
            supply = supply + X[k] * (
                CD.T @ left @ CD - np.diag(np.concatenate([np.zeros(n), right]))
            )
        constraints.append(here >> _LEAST * np.eye(n))
        for moved in _moves(loop, claim, P, theta):
            half = E.T @ here @ AB
            if loop.dt:
                change = AB.T @ moved @ AB - E.T @ here @ E
            else:
                change = half + half.T + E.T @ moved @ E
            M = cp.multiply(np.outer(units, units), change + supply)
            constraints.append((M + M.T) / 2 << -t * np.eye(n + m))
    problem = cp.Problem(cp.Maximize(t), constraints)
    if solve_program(problem, "CLARABEL") or t.value is None or not t.value > 0:
        return None
    values = np.array([(p.value + p.value.T) / 2 for p in P])
    return replace(claim, P=values, S=S, scalings=d**2 * np.asarray(X.value, dtype=float)[: d.size])


def _in_coordinates(loop: ScheduledLoop, S: np.ndarray, d: np.ndarray) -> list[np.ndarray]:
    """Return the coefficients of A, B, C, D in the states S^-1 x and scaled channels."""
    T = np.linalg.inv(S)
    rows, cols = (np.repeat(d, [block[k] for block in loop.blocks]) for k in (0, 1))
    A, B, C, D = (getattr(loop, name).to_array() for name in "ABCD")
    return [T @ A @ S, T @ B / cols, rows[:, None] * C @ S, rows[:, None] * D / cols]


def _moves(loop: ScheduledLoop, claim: ScheduleClaim, P: list, theta: float) -> list:
    """Return P+ of each move of a discrete loop, +- nu dP/dtheta of a continuous one, as
    expressions.
    """
    if not loop.dt:
        slope = sum((k * theta ** (k - 1) * p for k, p in enumerate(P) if k), 0 * P[0])
        if len(P) == 1:
            return [slope]
        return [claim.rate * slope, -claim.rate * slope]
    with ctx.workprec(BITS):  # the weight of each coefficient of P in each move
        powers = moved_polynomials(
            PolynomialMatrix.of(np.eye(len(P))[:, :, None]), claim.speed * loop.dt
        )
        weights = [[float(x.mid()) for x in each.at(theta).entries()] for each in powers]
    return [sum(w * p for w, p in zip(row, P, strict=True)) for row in weights]
