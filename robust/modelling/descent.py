"""Newton steps on the roots of a weight, towards the least excess over a target."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from robust.modelling.excess import Problem

__all__ = ["asymmetric", "polished"]


# excess -> value, first and second derivative
Objective = Callable[[np.ndarray], tuple[float, np.ndarray, np.ndarray]]


def descended(
    problem: Problem, theta: np.ndarray, log_k: float, order: int, objective: Objective, n_iterations: int, small: float
) -> tuple[np.ndarray, float]:
    """Newton's method with the exact Hessian, its negative curvatures turned around, damped until it descends."""
    e, J = problem.excess(theta, log_k, order)
    value, first, second = objective(e)
    damping = 1e-3
    for _ in range(n_iterations):
        H = (second * J) @ J.T
        H[:-1, :-1] += curvature(problem, theta, order, first, J)
        sizes, axes = np.linalg.eigh(H)
        slope = axes.T @ (J @ first)
        before = value
        for _ in range(10):
            step = -axes @ (slope / (np.abs(sizes) + damping * np.abs(sizes).max()))
            step *= min(1.0, 1.5 / np.abs(step[:-1]).max(initial=1e-300))
            trial = problem.clipped(theta + step[:-1], order)
            e_new, J_new = problem.excess(trial, log_k + step[-1], order)
            value_new, first_new, second_new = objective(e_new)
            if value_new < value:
                theta, log_k, e, J = trial, log_k + step[-1], e_new, J_new
                value, first, second = value_new, first_new, second_new
                damping = max(damping / 10, 1e-12)
                break
            damping = min(max(damping * 10, 1e-8), 1e6)
        if not value < before - small:
            break
    return theta, log_k


def curvature(problem: Problem, theta: np.ndarray, order: int, first: np.ndarray, J: np.ndarray) -> np.ndarray:
    """Hessian (2n, 2n) of sum first * excess by the parameters: a block for each section, from the Jacobian there."""
    N, m = problem.x.size, order - order % 2
    c, slopes = first[:N], J[:-1, :N].reshape(2, order, N)
    sign = np.array([[1.0], [-1.0]])  # of the roots of W, those above and those below
    weighted = slopes * c
    linear, square = np.add.reduce(weighted, axis=-1), sign * np.vecdot(weighted, slopes)
    out = np.diag(2 * (linear - square).ravel())
    if m:
        # for a pair: w^4 over the square of the section is its slope by zeta times w^2 / (2 zeta x)^2
        w, zeta = slice(0, m, 2), slice(1, m, 2)
        by_zeta = slopes[:, zeta]
        mixed = 2 * (linear[:, zeta] - sign * np.vecdot(weighted[:, w], by_zeta))
        first_of = np.arange(2 * order).reshape(2, order)[:, w]
        out[first_of, first_of] += np.exp(2 * (theta[first_of] - theta[first_of + 1])) * (by_zeta @ (c / problem.x**2))
        out[first_of, first_of + 1] = out[first_of + 1, first_of] = mixed
    return out


def asymmetric(
    problem: Problem, theta: np.ndarray, order: int, below: float, n_iterations: int
) -> tuple[np.ndarray, float]:
    """Least squares on the log excess, where lying below the target costs below^2 times as much."""

    def objective(e: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        w = np.where(e < 0, 2 * below**2, 2.0) / e.size
        return float(0.5 * w @ e**2), w * e, w

    log_k = -float(problem.share @ problem.excess(theta, 0.0, order)[0][: problem.x.size])
    return descended(problem, theta, log_k, order, objective, n_iterations, 1e-14)


def polished(
    problem: Problem,
    theta: np.ndarray,
    log_k: float,
    order: int,
    barriers: tuple[float, ...],
    n_iterations: int,
    deadline: float,
) -> tuple[np.ndarray, float]:
    """Least mean excess with none negative: a logarithmic barrier, lowered step by step, then down to the target."""
    n = problem.x.size
    e = problem.excess(theta, log_k, order)[0]
    log_k += 0.02 - e.min()
    share = np.zeros(e.size)
    share[:n] = problem.share
    weight = np.maximum(share, 1 / n)  # the ends count like a point
    for mu in barriers:
        if time.monotonic() > deadline:
            break

        def objective(e: np.ndarray, mu: float = mu) -> tuple[float, np.ndarray, np.ndarray]:
            if not e.min() > 0:
                return np.inf, e, e
            return float(share @ e - mu * (weight @ np.log(e))), share - mu * weight / e, mu * weight / (e * e)

        theta, log_k = descended(problem, theta, log_k, order, objective, n_iterations, 1e-3 * mu)
    return theta, log_k - float(problem.excess(theta, log_k, order)[0].min())
