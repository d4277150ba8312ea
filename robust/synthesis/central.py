"""The two Riccati equations of H-infinity control at one level gamma: whether they hold, and the central controller."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.linalg import cholesky

from nlfrf.shared.values import value
from robust.synthesis.generalised_plant import Plant, dual
from robust.systems.lti import Matrices
from robust.systems.riccati import stabilising

__all__ = ["LARGEST_GAMMA", "bracket", "central", "control_equation", "least_level", "left_by_control", "solved"]


LARGEST_GAMMA = 1e10
CHANGED = 100.0  # of its size A may change by another choice of the control: a nearly singular D12 asks for more


@value(copy=False)
class Solution:
    """X and Y of a level, with the gains F (of all inputs) and H (of all outputs) that go with them."""

    gamma: float
    X: np.ndarray
    Y: np.ndarray
    F: np.ndarray
    H: np.ndarray


def least_level(plant: Plant) -> float:
    """What the direct term alone leaves: no controller gets below it."""
    return max(left_by_control(plant), left_by_control(dual(plant)))


def left_by_control(plant: Plant) -> float:
    """The part of the direct term in outputs that u does not reach."""
    upper = plant.D11[: plant.D11.shape[0] - plant.B2.shape[1]]
    return float(np.linalg.norm(upper, 2)) if upper.size else 0.0


def solved(plant: Plant, gamma: float, *, quick: bool = False) -> Solution | None:
    """X and Y where the level can be reached: both stabilising, semidefinite, with spectral radius under gamma^2."""
    if gamma <= least_level(plant) * (1 + 1e-9):
        return None
    control = control_equation(plant, gamma, quick=quick)
    if control is None:
        return None
    filtering = control_equation(dual(plant), gamma, quick=quick)
    if filtering is None or np.max(np.linalg.eigvals(control[0] @ filtering[0]).real, initial=0.0) >= gamma**2:
        return None
    return Solution(gamma=gamma, X=control[0], Y=filtering[0], F=control[1], H=filtering[1].T)


def control_equation(plant: Plant, gamma: float, *, quick: bool = False) -> tuple[np.ndarray, np.ndarray] | None:
    """X and F of a level where the states and w are known; of the dual plant, Y and H'. Only D12 need be [0; I].

    What is not possible with all of x and w known is not possible with y either: where there is no X, the level is a
    lower bound. The outputs that u reaches are taken as the control in its place where that changes little: cross terms
    that would cancel in rounding are then never made, and where y tells all of w, Y is zero to the last bit.
    """
    if gamma <= left_by_control(plant) * (1 + 1e-9):
        return None
    n_w, n_u = plant.B1.shape[1], plant.B2.shape[1]
    free = plant.C1.shape[0] - n_u
    A, B1, C1, D11 = plant.A, plant.B1, plant.C1, plant.D11
    C_u, D_u = C1[free:], D11[free:]
    instead = bool(np.linalg.norm(plant.B2 @ C_u) < CHANGED * np.linalg.norm(A))
    if instead:
        A, B1 = A - plant.B2 @ C_u, B1 - plant.B2 @ D_u
        C1, D11 = (np.vstack([rows[:free], np.zeros_like(rows[free:])]) for rows in (C1, D11))
    B, D = np.hstack([B1, plant.B2]), np.hstack([D11, plant.D12])
    R = D.T @ D - np.diag(np.r_[np.full(n_w, gamma**2), np.zeros(n_u)])
    X = stabilising(A, B, C1.T @ C1, R, C1.T @ D, quick=quick)
    if X is None:
        return None
    F = -np.linalg.solve(R, D.T @ C1 + B.T @ X)
    if instead:
        F[n_w:] -= C_u + D_u @ F[:n_w]
    return X, F


def central(plant: Plant, at: Solution, *, rolled_off: bool = False) -> Matrices:
    """The central controller of a level, or the one of least direct term (Zhou, Doyle & Glover 1996, Theorem 17.1).

    All controllers of the level are F_l(M, Q) with |Q| < gamma; the central one has Q = 0. In a problem of one block
    that one makes the whole direct term of the loop zero, at times with a K that is infinite there.
    """
    (n_z, n_w), n_u, n_y = plant.D11.shape, plant.B2.shape[1], plant.C2.shape[0]
    g2 = at.gamma**2
    D = plant.D11
    D1111, D1112 = D[: n_z - n_u, : n_w - n_y], D[: n_z - n_u, n_w - n_y :]
    D1121, D1122 = D[n_z - n_u :, : n_w - n_y], D[n_z - n_u :, n_w - n_y :]
    inner = g2 * np.eye(n_w - n_y) - D1111.T @ D1111
    outer = g2 * np.eye(n_z - n_u) - D1111 @ D1111.T
    D_hat = -D1121 @ D1111.T @ np.linalg.solve(outer, D1112) - D1122
    left = cholesky(np.eye(n_u) - D1121 @ np.linalg.solve(inner, D1121.T), lower=True)
    right = cholesky(np.eye(n_y) - D1112.T @ np.linalg.solve(outer, D1112))
    if rolled_off:
        Q = -np.linalg.solve(left, np.linalg.solve(right.T, D_hat.T).T)
        D_hat = D_hat + left @ Q @ right * min(1.0, 0.9 * at.gamma / max(float(np.linalg.norm(Q, 2)), 1e-300))
    F1, F2 = at.F[n_w - n_y : n_w], at.F[n_w:]
    H1, H2 = at.H[:, n_z - n_u : n_z], at.H[:, n_z:]
    Z = np.linalg.inv(np.eye(plant.A.shape[0]) - at.Y @ at.X / g2)
    B_hat = Z @ (plant.B2 + H1) @ left
    C_hat = -right @ (plant.C2 + F1)
    B_K = -Z @ H2 + B_hat @ np.linalg.solve(left, D_hat)
    C_K = F2 + D_hat @ np.linalg.solve(right, C_hat)
    A_K = plant.A + np.hstack([plant.B1, plant.B2]) @ at.F + B_K @ np.linalg.solve(right, C_hat)
    return A_K, B_K, C_K, D_hat


def bracket(
    holds: Callable[[float], Any], ends: tuple[float, float], tolerance: float, deadline: float, *, enough: float = 0.0
) -> tuple[float, float, int]:
    """Largest level seen to fail, smallest seen to hold (inf: none), and how many were tried; from what is known."""
    low, high = ends
    n_steps, gamma = 0, max(1.0, 2 * low) if np.isinf(high) else high / 2
    while time.monotonic() < deadline:
        if high <= max(low, enough) * (1 + tolerance) or low > LARGEST_GAMMA or high < 1e-9:
            break
        if np.isfinite(high):
            floor = max(low, enough)
            # far from both ends go down by decades; near, halve
            gamma = high / 8 if floor < high / 64 else float(np.sqrt(floor * high))
        elif n_steps:
            gamma = low * 4
        n_steps += 1
        if holds(gamma):
            high = gamma
        else:
            low = gamma
    return low, high, n_steps
