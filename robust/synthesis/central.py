"""The two Riccati equations of H-infinity control at one level gamma: whether they hold, and the central controller."""

from __future__ import annotations

import numpy as np
from scipy.linalg import cholesky

from nlfrf.shared.values import value
from robust.synthesis.generalised_plant import Plant
from robust.systems.lti import Matrices
from robust.systems.riccati import stabilising

__all__ = ["central", "least_level", "solved"]


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
    u, y = plant.B2.shape[1], plant.C2.shape[0]
    D = plant.D11
    upper, left = D[: D.shape[0] - u], D[:, : D.shape[1] - y]
    return max((float(np.linalg.norm(part, 2)) for part in (upper, left) if part.size), default=0.0)


def solved(plant: Plant, gamma: float) -> Solution | None:
    """X and Y where the level can be reached: both stabilising, semidefinite, with spectral radius under gamma^2."""
    A, B1, B2, C1, C2, D11, D12, D21 = (
        plant.A, plant.B1, plant.B2, plant.C1, plant.C2, plant.D11, plant.D12, plant.D21,
    )  # fmt: skip
    if gamma <= least_level(plant) * (1 + 1e-9):
        return None
    B, C = np.hstack([B1, B2]), np.vstack([C1, C2])
    across, down = np.hstack([D11, D12]), np.vstack([D11, D21])
    R = across.T @ across - np.diag(np.r_[np.full(B1.shape[1], gamma**2), np.zeros(B2.shape[1])])
    R_dual = down @ down.T - np.diag(np.r_[np.full(C1.shape[0], gamma**2), np.zeros(C2.shape[0])])
    X = stabilising(A, B, C1.T @ C1, R, C1.T @ across)
    if X is None:
        return None
    Y = stabilising(A.T, C.T, B1 @ B1.T, R_dual, B1 @ down.T)
    if Y is None or np.max(np.linalg.eigvals(X @ Y).real, initial=0.0) >= gamma**2:
        return None
    F = -np.linalg.solve(R, across.T @ C1 + B.T @ X)
    H = -np.linalg.solve(R_dual, down @ B1.T + C @ Y).T
    return Solution(gamma=gamma, X=X, Y=Y, F=F, H=H)


def central(plant: Plant, at: Solution) -> Matrices:
    """The central controller of a level (Zhou, Doyle & Glover 1996, Theorem 17.1)."""
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
    F1, F2 = at.F[n_w - n_y : n_w], at.F[n_w:]
    H1, H2 = at.H[:, n_z - n_u : n_z], at.H[:, n_z:]
    Z = np.linalg.inv(np.eye(plant.A.shape[0]) - at.Y @ at.X / g2)
    B_hat = Z @ (plant.B2 + H1) @ left
    C_hat = -right @ (plant.C2 + F1)
    B_K = -Z @ H2 + B_hat @ np.linalg.solve(left, D_hat)
    C_K = F2 + D_hat @ np.linalg.solve(right, C_hat)
    A_K = plant.A + np.hstack([plant.B1, plant.B2]) @ at.F + B_K @ np.linalg.solve(right, C_hat)
    return A_K, B_K, C_K, D_hat
