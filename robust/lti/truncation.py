"""Model reduction by balanced truncation: of a system itself, with weights, or of its coprime
factors.

The controllability Gramian P and the observability Gramian Q are made equal and diagonal, and the
states with the smallest entries are removed. Truncation deletes these states, and is exact at high
frequency. Residualisation replaces them by their steady state, and is exact at zero frequency, so
that the integral action of the factors is kept. Modes that are not stable are kept as they are
(Moore 1981; Enns 1984 for weights; Meyer 1990 for coprime factors; SP 11.2 to 11.4).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.linalg import (
    block_diag,
    schur,
    solve_continuous_are,
    solve_continuous_lyapunov,
    solve_sylvester,
)

from robust.lti.lti import Matrices

_AXIS_TOLERANCE = 1e-9  # of the size of A: modes closer to the axis are kept as they are


def _split_modes(
    A: np.ndarray, B: np.ndarray, C: np.ndarray
) -> tuple[tuple[np.ndarray, ...], tuple[np.ndarray, ...]]:
    """Return (A, B, C) of the modes that are kept because they are not strictly stable, and of the
    others.
    """
    n, size = A.shape[0], _AXIS_TOLERANCE * max(float(np.linalg.norm(A)), 1e-300)
    if n:
        T, Z, k = schur(A, output="real", sort=lambda re, im=0.0: re >= -size)
    else:
        T, Z, k = A, np.eye(0), 0
    # T = [T11 T12; 0 T22] made block diagonal: T11 X - X T22 = -T12
    if 0 < k < n:
        X = solve_sylvester(T[:k, :k], -T[k:, k:], -T[:k, k:])
    else:
        X = np.zeros((k, n - k))
    forth, back = Z.T.copy(), Z.copy()
    forth[:k] = forth[:k] - X @ forth[k:]
    back[:, k:] = back[:, k:] + back[:, :k] @ X
    moved, shown = forth @ B, C @ back
    return (T[:k, :k], moved[:k], shown[:, :k]), (T[k:, k:], moved[k:], shown[:, k:])


def balanced_candidates(K: Matrices) -> Iterator[tuple[str, int, Matrices]]:
    """Yield (way, order, system) for every order: the strictly stable part is reduced, the rest is
    added.
    """
    A, B, C, D = K
    kept, (A, B, C) = _split_modes(A, B, C)
    P, Q = solve_continuous_lyapunov(A, -B @ B.T), solve_continuous_lyapunov(A.T, -C.T @ C)
    for way, small in _truncations((A, B, C, D), P, Q):
        yield f"balanced, {way}", small[0].shape[0] + kept[0].shape[0], _add_systems(kept, small)


def weighted_candidates(
    K: Matrices, before: Matrices, behind: Matrices
) -> Iterator[tuple[str, int, Matrices]]:
    """Yield reductions K_r of each order, for a small norm of behind (K - K_r) before with stable
    weights (Enns).
    """
    A, B, C, D = K
    kept, (A, B, C) = _split_modes(A, B, C)
    n, (Ab, Bb, Cb, Db), (Aa, Ba, Ca, _) = A.shape[0], before, behind
    driven = np.block([[A, B @ Cb], [np.zeros((Ab.shape[0], n)), Ab]])
    A_weighted = np.block([[A, np.zeros((n, Aa.shape[0]))], [Ba @ C, Aa]])
    into, out = np.vstack([B @ Db, Bb]), np.hstack([behind[3] @ C, Ca])
    P = solve_continuous_lyapunov(driven, -into @ into.T)[:n, :n]
    Q = solve_continuous_lyapunov(A_weighted.T, -out.T @ out)[:n, :n]
    for way, small in _truncations((A, B, C, D), P, Q):
        yield (
            f"weighted by the loop, {way}",
            small[0].shape[0] + kept[0].shape[0],
            _add_systems(kept, small),
        )


def coprime_factor_candidates(K: Matrices) -> Iterator[tuple[str, int, Matrices]]:
    """Yield reductions of K of each order by truncating its normalised left coprime factors,
    unstable modes too.
    """
    A, B, C, D = K
    R, S = np.eye(D.shape[0]) + D @ D.T, np.eye(D.shape[1]) + D.T @ D
    drift = A - B @ np.linalg.solve(S, D.T @ C)
    Y = solve_continuous_are(drift.T, C.T, B @ np.linalg.solve(S, B.T), R)
    H = -np.linalg.solve(R, (B @ D.T + Y @ C.T).T).T
    root = np.linalg.cholesky(np.linalg.inv(R)).T
    factors = (
        A + H @ C,
        np.hstack([B + H @ D, H]),
        root @ C,
        root @ np.hstack([D, np.eye(D.shape[0])]),
    )
    P = solve_continuous_lyapunov(factors[0], -factors[1] @ factors[1].T)
    Q = solve_continuous_lyapunov(factors[0].T, -factors[2].T @ factors[2])
    m = B.shape[1]
    for way, (Ar, Br, Cr, Dr) in _truncations(factors, P, Q):
        N, M, into = Dr[:, :m], Dr[:, m:], Br[:, m:]
        if np.linalg.cond(M) < 1e12:
            back = np.linalg.solve(M, np.hstack([Cr, N]))
            C_K, D_K = back[:, : Cr.shape[1]], back[:, Cr.shape[1] :]
            yield (
                f"coprime factors, {way}",
                Ar.shape[0],
                (Ar - into @ C_K, Br[:, :m] - into @ D_K, C_K, D_K),
            )


def _truncations(system: Matrices, P: np.ndarray, Q: np.ndarray) -> Iterator[tuple[str, Matrices]]:
    """Yield every smaller order, truncated and residualised, from Gramians of a system (square
    root, Tombs 1987).
    """
    A, B, C, D = system
    Lc, Lo = gramian_root(P), gramian_root(Q)
    U, sizes, V = np.linalg.svd(Lo.T @ Lc)
    n = int(
        np.sum(sizes > 1e-12 * sizes.max(initial=0.0))
    )  # undriven and unseen states are removed exactly
    scale = np.sqrt(sizes[:n])
    forth, back = (U[:, :n] / scale).T @ Lo.T, Lc @ V[:n].T / scale
    A, B, C = forth @ A @ back, forth @ B, C @ back
    for r in range(min(n, system[0].shape[0] - 1) + 1):
        yield "truncated", (A[:r, :r], B[:r], C[:, :r], D)
        rest = A[r:, r:]
        if r < n and np.linalg.cond(rest) < 1e12:
            settled = np.linalg.solve(rest, np.hstack([A[r:, :r], B[r:]]))
            A_s, B_s = settled[:, :r], settled[:, r:]
            yield "residualised", (
                A[:r, :r] - A[:r, r:] @ A_s, B[:r] - A[:r, r:] @ B_s, C[:, :r] - C[:, r:] @ A_s, D - C[:, r:] @ B_s,
            )  # fmt: skip


def gramian_root(gramian: np.ndarray) -> np.ndarray:
    """Return L with L L' the positive part of a Gramian."""
    values, vectors = np.linalg.eigh((gramian + gramian.T) / 2)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def _add_systems(kept: tuple[np.ndarray, ...], small: Matrices) -> Matrices:
    A, B, C, D = small
    return block_diag(kept[0], A), np.vstack([kept[1], B]), np.hstack([kept[2], C]), D
