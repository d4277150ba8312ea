"""Stabilising solutions of Riccati equations."""

from __future__ import annotations

import warnings

import numpy as np
from scipy.linalg import schur, solve_continuous_are

from robust.systems.norms import EPS

__all__ = ["stabilising"]


WELL_CONDITIONED = 1e6  # R of up to this: the Hamiltonian, at a third of the time
EXACT = 1e-11  # of its largest terms may be left of the equation where another solver can be asked


def stabilising(
    A: np.ndarray, B: np.ndarray, Q: np.ndarray, R: np.ndarray, S: np.ndarray, *, quick: bool = False
) -> np.ndarray | None:
    """X >= 0 with A'X + XA - (XB + S) R^-1 (B'X + S') + Q = 0 and A + B F stable; None where there is none.

    quick: from the Hamiltonian where that is exact enough, for when only the existence is asked for.
    """
    n = A.shape[0]
    if n == 0:
        return np.zeros((0, 0))
    if not Q.any() and not S.any() and np.linalg.eigvals(A).real.max() < 0:
        return np.zeros((n, n))  # which rounding would give a sign
    quick = quick and np.linalg.cond(R) < WELL_CONDITIONED
    solvers = (by_hamiltonian, by_pencil) if quick else (by_pencil, by_hamiltonian)
    for solve in solvers:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # the solution is judged below
                X = solve(A, B, Q, R, S)
            gain = np.linalg.solve(R, B.T @ X + S.T)
            poles = np.linalg.eigvals(A - B @ gain)
        except (np.linalg.LinAlgError, ValueError):
            continue
        # a slow pole may come out on either side and is judged later; an undamped one means no solution
        slack = np.where(np.abs(poles) > 1e-9 * np.linalg.norm(A), -1e-9 * np.abs(poles), 1e-9 * np.linalg.norm(A))
        if np.any(poles.real > slack):
            continue
        X = (X + X.T) / 2
        if quick and solve is by_hamiltonian:
            left = A.T @ X + X @ A - (X @ B + S) @ gain + Q
            terms = 2 * np.linalg.norm(A.T @ X) + np.linalg.norm((X @ B + S) @ gain) + np.linalg.norm(Q)
            if not np.linalg.norm(left) <= EXACT * terms:
                continue
        # X = 0 is a solution too, and a slow pole magnifies its rounding
        slowest = max(float(np.abs(poles).min()), 1e-12)
        rounding = 1e-7 * np.linalg.norm(X) + (1e-9 + 1000 * EPS / slowest) * np.linalg.norm(Q)
        if np.linalg.eigvalsh(X)[0] >= -rounding:
            return X
    return None


def by_pencil(A: np.ndarray, B: np.ndarray, Q: np.ndarray, R: np.ndarray, S: np.ndarray) -> np.ndarray:
    """SciPy's solver, on the extended pencil: R need not be well conditioned."""
    return np.asarray(solve_continuous_are(A, B, Q, R, s=S))


def by_hamiltonian(A: np.ndarray, B: np.ndarray, Q: np.ndarray, R: np.ndarray, S: np.ndarray) -> np.ndarray:
    """From the stable subspace of the Hamiltonian, whose slow eigenvalues are the more exact ones."""
    n = A.shape[0]
    F = A - B @ np.linalg.solve(R, S.T)
    G, H = B @ np.linalg.solve(R, B.T), Q - S @ np.linalg.solve(R, S.T)
    size = np.sqrt(np.linalg.norm(H) / np.linalg.norm(G)) if H.any() and G.any() else 1.0
    _, Z, n_stable = schur(np.block([[F, -G * size], [-H / size, -F.T]]), sort="lhp")
    if n_stable != n:
        raise ValueError("eigenvalues on the imaginary axis")
    return np.asarray(np.linalg.solve(Z[:n, :n].T, Z[n:, :n].T).T * size)
