"""Lower bounds on the structured singular value: a perturbation that does make the loop singular, verified.

Complex blocks by ascent on the spectral radius (its fixed points are those of the power iteration of Packard, Fan &
Doyle 1988); real blocks by a search among perturbations with a real eigenvalue.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.optimize import minimize

from robust.mu import MuBound, response_matrices, scalings
from robust.structure import Structure, fitting

RACE, FINISH = 15, 400  # steps from every start, and from the best of them
SINGULAR = 1e-8


def mu_lower(N: np.ndarray, blocks: Any, *, n_starts: int = 6, rng: Any = 0) -> MuBound:
    """A structured perturbation that makes the loop singular, as small as found: mu is at least 1 over its size.

    Parameters
    ----------
    N : (n_out, n_in, W) ndarray
        Complex response that the perturbation closes.
    blocks : list
        As for `mu_upper`.
    n_starts : int
        Random starts at each frequency, on top of the one from the singular vectors.
    rng : Generator, int or None
        For the starts.

    Returns
    -------
    MuBound
        value : 1 over the largest singular value of delta, which has the structure and det(I - N delta) = 0, verified;
        zero, and delta nan, where none was found. With real blocks it may well stay below mu.

    Raises
    ------
    ValueError
        Blocks that do not add up to N, numbers that are not finite.

    References
    ----------
    SP 8.8.1; Packard, Fan & Doyle 1988; Young & Doyle 1990 (real blocks).

    Examples
    --------
    >>> M = np.array([[2, 2], [-1, -1]])[:, :, None]
    >>> bound = mu_lower(M, [(1, 1), (1, 1)])
    >>> around = np.eye(2) - M[:, :, 0] @ bound.delta[:, :, 0]
    >>> round(float(bound.value[0]), 6), abs(np.linalg.det(around)).round(9).item()
    (3.0, 0.0)
    """
    M = response_matrices("N", N)
    s = fitting("blocks", blocks, M.shape[1:])
    rng = np.random.default_rng(rng)
    vectors = scaled_vectors(M, s)
    starts = [from_vectors(*vectors, s, rng if k else None, random=k % 3 == 2) for k in range(n_starts + 1)]
    raced = [ascended(M, start, s, RACE) for start in starts]
    order = np.argsort([-radius for _, radius in raced], axis=0)
    found = np.stack([delta for delta, _ in raced])
    best, delta = np.zeros(M.shape[0]), np.full((M.shape[0], *s.shape[::-1]), np.nan, complex)
    for place in order[: len(order) if s.skew.size else 2]:
        candidate, _ = ascended(M, found[place, np.arange(M.shape[0])], s, FINISH)
        if s.skew.size:
            candidate = np.stack([real_crossing(*pair, s) for pair in zip(M, candidate, strict=True)])
        value, candidate = judged(M, candidate, s)
        better = value > best
        best[better], delta[better] = value[better], candidate[better]
    return MuBound(value=best, delta=np.moveaxis(delta, 0, 2))


def judged(M: np.ndarray, delta: np.ndarray, s: Structure) -> tuple[np.ndarray, np.ndarray]:
    """1/size of the perturbations, scaled to an eigenvalue one of N delta; zero where the loop is not singular."""
    closed = M @ delta
    eigenvalues = np.linalg.eigvals(closed)
    real = eigenvalues[np.arange(len(M)), np.argmax(np.abs(eigenvalues), axis=1)]
    if s.skew.size:
        tame = np.abs(eigenvalues.imag) <= 1e-9 * np.abs(eigenvalues) + 1e-300
        size = np.where(tame, np.abs(eigenvalues.real), 0.0)
        real = eigenvalues.real[np.arange(len(M)), size.argmax(axis=1)] * (size.max(axis=1) > 0)
    with np.errstate(all="ignore"):
        delta = delta / real[:, None, None]
    fine = np.isfinite(delta).all(axis=(1, 2))
    delta = np.where(fine[:, None, None], delta, 0)
    least = np.linalg.svd(np.eye(M.shape[1]) - M @ delta, compute_uv=False)
    size = np.linalg.svd(delta, compute_uv=False)[:, 0]
    fine &= (least[:, -1] <= SINGULAR * np.maximum(least[:, 0], 1.0)) & (size > 0)
    return np.where(fine, 1 / np.where(size > 0, size, 1.0), 0.0), np.where(fine[:, None, None], delta, np.nan)


def scaled_vectors(M: np.ndarray, s: Structure) -> tuple[np.ndarray, np.ndarray]:
    """(W, n_in, 3), (W, n_out, 3) directions of the largest singular values at the scaling of least bound.

    There these values meet, and where the bound is mu itself a combination of their directions is the perturbation.
    """
    size = np.linalg.norm(M, axis=(1, 2))
    M = M / np.where(size > 0, size, 1.0)[:, None, None]
    D_L, D_R, _ = scalings(M, s)
    U, _, V = np.linalg.svd(D_L @ M @ np.linalg.inv(D_R))
    return np.linalg.solve(D_R, V[:, :3].conj().swapaxes(1, 2)), np.linalg.solve(D_L, U[:, :, :3])


def from_vectors(left: np.ndarray, right: np.ndarray, s: Structure, rng: Any, *, random: bool) -> np.ndarray:
    """A perturbation of size one along the first direction, or along a random combination, or any random one."""
    W, k = left.shape[0], min(left.shape[2], right.shape[2])
    if rng is None:
        return aligned(left[:, :, 0], right[:, :, 0], np.ones(W), s)
    if random:
        left, right = (rng.standard_normal((W, n)) + 1j * rng.standard_normal((W, n)) for n in s.shape[::-1])
        return aligned(left, right, np.ones(W), s)
    mix = (rng.standard_normal((W, k)) + 1j * rng.standard_normal((W, k))) * [1.0, 1.0, 0.3][:k]
    left, right = (np.einsum("wnk,wk->wn", vectors[:, :, :k], mix) for vectors in (left, right))
    return aligned(left, right, np.ones(W), s)


def ascended(M: np.ndarray, delta: np.ndarray, s: Structure, n_steps: int) -> tuple[np.ndarray, np.ndarray]:
    """(W, n_in, n_out) perturbations of size one, turned until the spectral radius (W,) of N delta grows no more."""
    best, radius = delta.copy(), np.zeros(len(M))
    todo = np.arange(len(M))
    for _ in range(n_steps):
        values, vectors = np.linalg.eig(M[todo] @ delta)
        each, k = np.arange(todo.size), np.argmax(np.abs(values), axis=1)
        value, right = values[each, k], vectors[each, :, k]
        grown = np.abs(value) - radius[todo]
        best[todo[grown > 0]] = delta[grown > 0]
        radius[todo] = np.maximum(radius[todo], np.abs(value))
        # the eigenvalue moves by l* N d(delta) r / (l* r): every block is turned to where that grows most
        with np.errstate(all="ignore"):
            duals = np.linalg.inv(vectors + 1e-14 * np.eye(s.shape[0]))
            left = np.einsum("wr,wrc->wc", duals[each, k], M[todo]).conj()
        delta = aligned(left, right, np.exp(1j * np.angle(value)), s)
        keep = (grown > 1e-10 * radius[todo]) & np.isfinite(delta).all(axis=(1, 2))
        todo, delta = todo[keep], delta[keep]
        if not todo.size:
            break
    return best, radius


def aligned(left: np.ndarray, right: np.ndarray, turn: np.ndarray, s: Structure) -> np.ndarray:
    """Delta of size one that maximises Re(turn* left* Delta right), block by block."""
    delta = np.zeros((left.shape[0], *s.shape[::-1]), complex)
    with np.errstate(all="ignore"):
        for kind, row, col in zip(s.kinds, s.rows, s.cols, strict=True):
            q, v = left[:, col], right[:, row]
            if kind == "full":
                size = np.linalg.norm(q, axis=1) * np.linalg.norm(v, axis=1)
                block = turn[:, None, None] * q[:, :, None] * v[:, None, :].conj()
                delta[:, col, row] = block / np.where(size > 0, size, np.inf)[:, None, None]
                continue
            along = turn.conj() * (q.conj() * v).sum(axis=1)
            n = row.stop - row.start
            number = np.where(along == 0, 1.0, along.conj() / np.abs(along))
            if kind == "real":
                number = np.where(along.real >= 0, 1.0, -1.0)
            delta[:, col, row] = number[:, None, None] * np.eye(n)
    return delta


def real_crossing(N: np.ndarray, delta: np.ndarray, s: Structure) -> np.ndarray:
    """A perturbation of size at most one, near the given one, with a large real eigenvalue of N delta.

    Real blocks move in [-1, 1], complex ones turn their phase: maximise Re lambda with Im lambda = 0.
    """
    real = np.array([kind == "real" for kind in s.kinds])
    start = np.where(real, 0.0, 0.0)
    for k, (row, col) in enumerate(zip(s.rows, s.cols, strict=True)):
        if real[k]:
            start[k] = delta[col, row][0, 0].real

    def perturbation(x: np.ndarray) -> np.ndarray:
        out = np.zeros_like(delta)
        for k, (row, col) in enumerate(zip(s.rows, s.cols, strict=True)):
            n = row.stop - row.start
            out[col, row] = x[k] * np.eye(n) if real[k] else delta[col, row] * np.exp(1j * x[k])
        return out

    def eigenvalue(x: np.ndarray) -> complex:
        values = np.linalg.eigvals(N @ perturbation(x))
        # the one that is largest for how far it is from the real axis
        return complex(values[np.argmax(np.abs(values) - 2 * np.abs(values.imag))])

    scale = max(float(np.linalg.norm(N)), 1e-300)
    sign = 1.0 if eigenvalue(start).real >= 0 else -1.0
    bounds = [(-1.0, 1.0) if r else (-7.0, 7.0) for r in real]
    found = minimize(
        lambda x: -sign * eigenvalue(x).real / scale,
        start * 0.999,
        method="SLSQP",
        bounds=bounds,
        constraints={"type": "eq", "fun": lambda x: eigenvalue(x).imag / scale},
        options={"maxiter": 60, "ftol": 1e-10},
    )
    x = np.clip(found.x, [b[0] for b in bounds], [b[1] for b in bounds])
    return perturbation(on_the_axis(x, eigenvalue, real, bounds))


def on_the_axis(x: np.ndarray, eigenvalue: Any, real: np.ndarray, bounds: list[tuple[float, float]]) -> np.ndarray:
    """The last digits: Newton steps of least length that bring the eigenvalue onto the real axis, inside the bounds."""
    low, high = np.array(bounds).T
    for _ in range(12):
        y = eigenvalue(x).imag
        slope = np.array([(eigenvalue(x + h).imag - eigenvalue(x - h).imag) / 2e-7 for h in 1e-7 * np.eye(x.size)])
        slope[(x <= low) & (slope * y > 0) | (x >= high) & (slope * y < 0)] = 0.0
        if not np.isfinite(y) or not slope.any():
            break
        x = np.clip(x - y * slope / (slope @ slope), low, high)
        if abs(y) < 1e-14 * abs(eigenvalue(x)):
            break
    return x
