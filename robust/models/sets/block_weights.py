"""The smallest W_l and W_r at each frequency for which W_l Delta W_r covers several matrices.

With L = W_l W_l* and R = W_r* W_r a matrix E is W_l Delta W_r, sigma(Delta) <= 1, if and only if
[[R, E*], [E, L]] >= 0 (Schur complement). So the smallest pair, by tr L + tr R, is a convex
program. Scaling L up and R down by one factor leaves the set unchanged: at the optimum the traces
are equal, and tr L + tr R = 2 sqrt(tr L tr R). For one matrix E alone L = (E E*)^1/2, R = (E*
E)^1/2, and the optimum is the sum of its singular values.
"""

from __future__ import annotations

import numpy as np

from robust.models.fit.spectral import largest_gains
from robust.proofs.search.programs import SOLVERS, solve_program

#: Least eigenvalue of L and R over the mean one: the weights have an inverse, at the cost of a
#: thousandth of the trace.
_EIGENVALUE_FLOOR = 1e-3


def smallest_block_weights(E: np.ndarray, *, full: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return L (W, n, n) and R (W, m, m) of least tr L + tr R that cover all E (M, W, n, m),
    diagonal or full.

    The solution of the solver is not trusted: both are scaled until every E is covered.

    >>> E = np.array([[[[3.0, 0.0], [0.0, 1.0]]]])
    >>> L, R = smallest_block_weights(E, full=True)
    >>> bool(abs(np.trace(L[0] + R[0]) / 8 - 1) < 3e-3)               # twice the sum of the singular values
    True
    """
    import cvxpy as cp

    M, _, n, m = E.shape
    held = [cp.Parameter((2 * n, 2 * m)) for _ in range(M)]
    if full:  # a Hermitian matrix X + j Y as the symmetric [[X, -Y], [Y, X]]
        parts = [(cp.Variable((k, k), symmetric=True), cp.Variable((k, k))) for k in (n, m)]
        L, R = (cp.bmat([[X, -Y], [Y, X]]) for X, Y in parts)
        constraints = [Y == -Y.T for _, Y in parts]
    else:
        diagonals = [cp.Variable(k) for k in (n, m)]
        L, R = (cp.diag(cp.hstack([d, d])) for d in diagonals)
        constraints = []
    constraints += [cp.bmat([[R, one.T], [one, L]]) >> 0 for one in held]
    problem = cp.Problem(cp.Minimize(cp.trace(L) + cp.trace(R)), constraints)

    def solve_at(E: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        size = np.abs(E).max() or 1.0
        for one, value in zip(held, E / size, strict=True):
            one.value = np.block([[value.real, -value.imag], [value.imag, value.real]])
        for solver in SOLVERS:
            solve_program(problem, solver)
            found = [L.value, R.value]
            if all(x is not None and np.isfinite(x).all() for x in found):
                break
        else:  # without a solution: a larger set than necessary, but a valid one
            found = [np.eye(2 * n), np.eye(2 * m)]
        halves = (
            x[: len(x) // 2, : len(x) // 2] + 1j * x[len(x) // 2 :, : len(x) // 2] for x in found
        )
        left, right = (_raise_eigenvalues((x + x.conj().T) / 2) * size for x in halves)
        excess = np.max(largest_gains(E, left, right))
        return left * excess, right * excess

    solved = [solve_at(E[:, k]) for k in range(E.shape[1])]
    left, right = (np.array(side) for side in zip(*solved, strict=True))
    traces = np.sqrt(np.einsum("wii->w", left).real / np.einsum("wii->w", right).real)[
        :, None, None
    ]
    return left / traces, right * traces


def _raise_eigenvalues(X: np.ndarray) -> np.ndarray:
    """Return a Hermitian matrix (n, n) with its eigenvalues raised to a floor."""
    values, vectors = np.linalg.eigh(X)
    return np.asarray(
        (vectors * np.maximum(values, _EIGENVALUE_FLOOR * values.mean())) @ vectors.conj().T
    )
