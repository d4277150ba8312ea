"""The two Riccati equations of H-infinity control at one level gamma: their solvability, the
central controller, and the bisection on gamma.

The equations and the controller are those of Zhou, Doyle & Glover, *Robust and Optimal Control*,
1996, Theorem 17.1. The equation for Y is that for X of the dual plant.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import cholesky

from nlfrf._base.values import value
from robust.lti.lti import Matrices
from robust.lti.norms import stabilising_riccati
from robust.synthesis.hinf.generalised_plant import Plant, dual_plant

LARGEST_GAMMA = 1e10
MOST_STEPS = 1000  # levels: the hardest of 54 published problems takes a third of them
ALL_STEPS_MADE = "all levels that n_steps allows were tried"
# largest change of A over its size by the substituted control: more means a nearly singular D12
_MAX_CHANGE_OF_A = 100.0


@value(copy=False)
class _Solution:
    """X and Y of a level, with the gains F (for all inputs) and H (for all outputs)."""

    gamma: float
    X: np.ndarray
    Y: np.ndarray
    F: np.ndarray
    H: np.ndarray


def direct_term_bound(plant: Plant) -> float:
    """Return the lower bound of gamma by the direct term alone."""
    return max(_uncontrolled_direct_term(plant), _uncontrolled_direct_term(dual_plant(plant)))


def _uncontrolled_direct_term(plant: Plant) -> float:
    """Return the norm of the direct term in outputs that u does not reach."""
    upper = plant.D11[: plant.D11.shape[0] - plant.B2.shape[1]]
    if upper.size:
        return float(np.linalg.norm(upper, 2))
    return 0.0


def solve_riccati_pair(plant: Plant, gamma: float, *, quick: bool = False) -> _Solution | None:
    """Return X and Y if the level can be reached: stabilising, semidefinite, with spectral radius
    below gamma^2.
    """
    if gamma <= direct_term_bound(plant) * (1 + 1e-9):
        return None
    control = control_riccati(plant, gamma, quick=quick)
    if control is None:
        return None
    filtering = control_riccati(dual_plant(plant), gamma, quick=quick)
    if (
        filtering is None
        or np.max(np.linalg.eigvals(control[0] @ filtering[0]).real, initial=0.0) >= gamma**2
    ):
        return None
    return _Solution(gamma=gamma, X=control[0], Y=filtering[0], F=control[1], H=filtering[1].T)


def control_riccati(
    plant: Plant, gamma: float, *, quick: bool = False
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return X and F of a level for known states and w; for the dual plant Y and H'.

    Only D12 must be [0; I].

    A level that is impossible with x and w known is impossible with y too: if there is no X, the
    level is a lower bound. The outputs that u reaches replace the control if that changes little:
    cross terms that would cancel in rounding then do not arise, and if y contains all of w, Y is
    zero to the last bit.
    """
    # at the bound R is singular
    if gamma <= _uncontrolled_direct_term(plant) * (1 + 1e-9):
        return None
    n_w, n_u = plant.B1.shape[1], plant.B2.shape[1]
    free = plant.C1.shape[0] - n_u
    A, B1, C1, D11 = plant.A, plant.B1, plant.C1, plant.D11
    C_u, D_u = C1[free:], D11[free:]
    # v = C_u x + D_u w + u in place of u
    instead = bool(np.linalg.norm(plant.B2 @ C_u) < _MAX_CHANGE_OF_A * np.linalg.norm(A))
    if instead:
        A, B1 = A - plant.B2 @ C_u, B1 - plant.B2 @ D_u
        C1, D11 = (np.vstack([rows[:free], np.zeros_like(rows[free:])]) for rows in (C1, D11))
    B, D = np.hstack([B1, plant.B2]), np.hstack([D11, plant.D12])
    R = D.T @ D - np.diag(np.r_[np.full(n_w, gamma**2), np.zeros(n_u)])
    X = stabilising_riccati(A, B, Q=C1.T @ C1, R=R, S=C1.T @ D, quick=quick)
    if X is None:
        return None
    F = -np.linalg.solve(R, D.T @ C1 + B.T @ X)
    if instead:  # back to u = v - C_u x - D_u w with w = F_w x
        F[n_w:] -= C_u + D_u @ F[:n_w]
    return X, F


def central_controller(plant: Plant, at: _Solution, *, rolled_off: bool = False) -> Matrices:
    """Return the central controller of a level, or that of least direct term.

    All controllers of the level are F_l(M, Q) with |Q| < gamma; the central one has Q = 0. In a
    one-block problem the central one makes the whole direct term of the loop zero, at times with a
    K that is infinite there.
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
        D_hat = D_hat + left @ Q @ right * min(
            1.0, 0.9 * at.gamma / max(float(np.linalg.norm(Q, 2)), 1e-300)
        )
    F1, F2 = at.F[n_w - n_y : n_w], at.F[n_w:]
    H1, H2 = at.H[:, n_z - n_u : n_z], at.H[:, n_z:]
    Z = np.linalg.inv(np.eye(plant.A.shape[0]) - at.Y @ at.X / g2)
    B_hat = Z @ (plant.B2 + H1) @ left
    C_hat = -right @ (plant.C2 + F1)
    B_K = -Z @ H2 + B_hat @ np.linalg.solve(left, D_hat)
    C_K = F2 + D_hat @ np.linalg.solve(right, C_hat)
    A_K = plant.A + np.hstack([plant.B1, plant.B2]) @ at.F + B_K @ np.linalg.solve(right, C_hat)
    return A_K, B_K, C_K, D_hat


def bisect_level(
    holds: Callable[[float], object],
    ends: tuple[float, float],
    *,
    tolerance: float,
    n_steps: int,
    enough: float = 0.0,
) -> tuple[float, float, int]:
    """Return the largest level that fails, the smallest that holds (inf: none), and the number of
    levels tried.
    """
    low, high = ends
    n_tried, gamma = 0, max(1.0, 2 * low) if np.isinf(high) else high / 2
    while n_tried < n_steps:
        if high <= max(low, enough) * (1 + tolerance) or low > LARGEST_GAMMA or high < 1e-9:
            break
        if np.isfinite(high):
            floor = max(low, enough)
            # far from both ends go down by decades; near, halve
            if floor < high / 64:
                gamma = high / 8
            else:
                gamma = float(np.sqrt(floor * high))
        elif n_tried:
            gamma = low * 4
        n_tried += 1
        if holds(gamma):
            high = gamma
        else:
            low = gamma
    return low, high, n_tried
