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
        H = J.T @ (second[:, None] * J)
        H[:-1, :-1] += curvature(problem, theta, order, first)
        sizes, axes = np.linalg.eigh(H)
        slope = axes.T @ (J.T @ first)
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


def curvature(problem: Problem, theta: np.ndarray, order: int, first: np.ndarray) -> np.ndarray:
    """Hessian (2n, 2n) of sum first * excess by the parameters: a block for each section."""
    out = np.zeros((2 * order, 2 * order))
    c = first[: problem.x.size]
    x2 = problem.x**2
    m = order - order % 2
    for start, sign in ((0, 1.0), (order, -1.0)):
        part = theta[start : start + order]
        if m:
            w2 = np.exp(2 * part[:m:2, None])
            damped = 4 * w2 * np.exp(2 * part[1:m:2, None]) * x2
            gap = w2 - x2
            square = gap * gap + damped
            by_w, by_zeta = (4 * w2 * gap + 2 * damped) / square, 2 * damped / square
            ww = ((8 * w2 * (gap + w2) + 4 * damped) / square - by_w**2) @ c
            wz = (4 * damped / square - by_w * by_zeta) @ c
            zz = (4 * damped / square - by_zeta**2) @ c
            k = start + np.arange(0, m, 2)
            out[k, k], out[k + 1, k + 1] = 0.5 * sign * ww, 0.5 * sign * zz
            out[k, k + 1] = out[k + 1, k] = 0.5 * sign * wz
        if order % 2:
            w2 = np.exp(2 * part[-1])
            ratio = w2 / (w2 + x2)
            out[start + order - 1, start + order - 1] = sign * float(2 * ratio * (1 - ratio) @ c)
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
