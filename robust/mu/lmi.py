"""The upper bound of mu by a convex program, to check the fast one against."""

from __future__ import annotations

import numpy as np

from nlfrf._base.arguments import require_choice
from robust._base.types import Blocks
from robust.mu.blocks import BlockStructure, structure_for
from robust.mu.upper import MuBound, bound_from_scalings, osborne_balance, response_matrices
from robust.proofs.search.certificate import SOLVERS, solve_program


def mu_upper_lmi(N: np.ndarray, blocks: Blocks, *, solver: str = "CLARABEL", time_cap: float = 5.0) -> MuBound:
    """Return the bound of `mu_upper` by semidefinite programming in cvxpy: slow, and found in another way.

    beta is bisected on beta^2 X_R - N^H X_L N - j (G N - N^H G^H) > 0; the bound is recomputed from the variables, so
    that no solver's status enters it.

    Parameters
    ----------
    N, blocks
        As for `mu_upper`.
    solver : str
        "CLARABEL" or "SCS".
    time_cap : float
        Seconds for each program.

    Returns
    -------
    MuBound
        value : never below what the scalings found prove; the largest singular value where the solver found nothing.

    Raises
    ------
    ValueError
        Blocks that do not add up to N, numbers that are not finite, a solver that is none of the two.

    References
    ----------
    Boyd, El Ghaoui, Feron & Balakrishnan 1994, 3.1; Fan, Tits & Doyle 1991.

    Examples
    --------
    >>> M = np.array([[2, 2], [-1, -1]])[:, :, None]
    >>> round(float(mu_upper_lmi(M, [(1, 1), (1, 1)]).value[0]), 4)
    3.0
    """
    require_choice("solver", solver, SOLVERS)
    M = response_matrices("N", N)
    s = structure_for("blocks", blocks, M.shape[1:])
    found = [solve_scaling_program(one, s, solver=solver, time_cap=time_cap) for one in M]
    values = np.array([value for value, _ in found])
    return MuBound(
        value=values, scaling=tuple(np.stack(parts, axis=2) for parts in zip(*(f[1] for f in found), strict=True))
    )


def solve_scaling_program(
    M: np.ndarray, s: BlockStructure, *, solver: str, time_cap: float
) -> tuple[float, tuple[np.ndarray, ...]]:
    """Return the bound at one frequency with its scalings."""
    import cvxpy as cp

    n_out, n_in = M.shape
    size = float(np.linalg.norm(M)) or 1.0
    d = osborne_balance(M[None] / size, s)[0]
    left, right = (np.repeat(d, [p.stop - p.start for p in parts]) for parts in (s.rows, s.cols))
    A = left[:, None] * M / size / right
    pieces = [A.conj().T @ L @ A for L in s.left]
    skews = [1j * G @ A + (1j * G @ A).conj().T for G in s.skew]
    x, g, t = cp.Variable(len(pieces)), cp.Variable(max(len(skews), 1)), cp.Variable()
    beta2 = cp.Parameter(nonneg=True)
    weight = sum(x[k] * real_embedding(R) for k, R in enumerate(s.right))
    outer = sum(x[k] * real_embedding(L) for k, L in enumerate(s.left))
    load = sum(x[k] * real_embedding(B) for k, B in enumerate(pieces)) + sum(
        g[k] * real_embedding(B) for k, B in enumerate(skews)
    )
    constraints = [
        beta2 * weight - load >> t * np.eye(2 * n_in),
        outer >> 1e-7 * np.eye(2 * n_out),
        weight >> 1e-7 * np.eye(2 * n_in),
        cp.trace(outer) == 2 * n_out,
        t <= 1,
        cp.norm_inf(g) <= 1e4,
    ]
    problem = cp.Problem(cp.Maximize(t), constraints)
    plain = (np.diag(left).astype(complex), np.diag(right).astype(complex), np.zeros((n_in, n_out), complex))
    best, scaling = float(np.linalg.norm(A, 2)), plain
    low, high = 0.0, best
    for _ in range(30):
        middle = (low + high) / 2
        beta2.value = middle**2
        if solve_program(problem, solver, time_cap, eps=1e-8):
            break
        reached, now = bound_from_variables(A, s, x=x.value, g=g.value)
        if reached < best:
            best, scaling = reached, (now[0] * left, now[1] * right, now[2] * size)
        low, high = (low, min(middle, reached)) if reached <= middle else (middle, high)
        if high - low < 1e-7 * high:
            break
    return best * size, scaling


def real_embedding(H: np.ndarray) -> np.ndarray:
    """Return the symmetric matrix of twice the size with the eigenvalues of a Hermitian one."""
    return np.block([[H.real, -H.imag], [H.imag, H.real]])


def bound_from_variables(
    A: np.ndarray, s: BlockStructure, *, x: np.ndarray | None, g: np.ndarray
) -> tuple[float, tuple[np.ndarray, ...]]:
    """Return the bound that a solver's variables prove (inf: none), put together again."""
    nothing = np.inf, (np.zeros(0),) * 3
    if x is None or not np.isfinite(x).all() or (s.skew.size and not np.isfinite(g).all()):
        return nothing
    try:
        D_L = np.linalg.cholesky(np.tensordot(x, s.left, 1)).conj().T
        D_R = np.linalg.cholesky(np.tensordot(x, s.right, 1)).conj().T
    except np.linalg.LinAlgError:
        return nothing
    G = np.tensordot(g, s.skew, 1) if s.skew.size else np.zeros(A.shape[::-1], complex)
    G = np.linalg.inv(D_R).conj().T @ G @ np.linalg.inv(D_L)
    return float(bound_from_scalings(A[None], D_L[None], D_R[None], G[None])[0]), (D_L, D_R, G)
