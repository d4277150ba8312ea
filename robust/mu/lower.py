"""Lower bounds on the structured singular value: a perturbation that does make the loop singular, verified.

Complex blocks by ascent on the spectral radius (its fixed points are those of the power iteration of Packard, Fan &
Doyle 1988); real blocks by a search among perturbations with a real eigenvalue.
"""

from __future__ import annotations

import time
from functools import lru_cache, partial
from typing import Any

import numpy as np
from scipy.optimize import minimize

from nlfrf._base.arguments import random_generator, require_integer
from robust.mu.blocks import BlockStructure, structure_for
from robust.mu.upper import MuBound, conjugate_transpose, optimal_scalings, response_matrices

__all__ = ["mu_lower", "search_perturbation"]


RACE, FINISH = 15, 400  # steps from every start, and from the best of them
SINGULARITY_TOLERANCE = 1e-8
BOUNDS_MEET = 1e-6  # relative distance to the upper bound at which the lower one is as good as it
REAL_SEARCHES = 3  # searches for a real eigenvalue, complex blocks turned in between


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
    n_starts = require_integer("n_starts", n_starts, least=0)
    return search_perturbation(
        M, structure_for("blocks", blocks, M.shape[1:]), n_starts, random_generator("rng", rng), np.inf
    )


def search_perturbation(M: np.ndarray, s: BlockStructure, n_starts: int, rng: Any, deadline: float) -> MuBound:
    """The largest lower bound found on (W, n_out, n_in) matrices by the deadline (of time.monotonic())."""
    left, right, bound = worst_directions(M, s, deadline)
    starts = [
        perturbation_from_directions(left, right, s, rng if k else None, random=k % 3 == 2) for k in range(n_starts + 1)
    ]
    raced = [power_ascent(M, start, s, RACE) for start in starts]
    order = np.argsort([-radius for _, radius in raced], axis=0)
    found = np.stack([delta for delta, _ in raced])
    candidates = [found[place, np.arange(M.shape[0])] for place in order[:2]]
    best, delta = np.zeros(M.shape[0]), np.full((M.shape[0], *s.shape[::-1]), np.nan, complex)
    if s.skew.size:
        candidates = starts + candidates
        if set(s.kinds) != {"real"}:
            best, delta = complex_lower_bound(M, s, n_starts, rng, deadline)
            candidates.append(delta * best[:, None, None])
    for candidate in candidates:
        at = np.flatnonzero(best < (1 - BOUNDS_MEET) * bound)  # elsewhere it is mu
        if not at.size or time.monotonic() > deadline:
            break
        if s.skew.size:
            candidate = np.stack(
                [real_crossing(M[k], candidate[k], s) if time.monotonic() < deadline else candidate[k] for k in at]
            )
        else:
            candidate, _ = power_ascent(M[at], candidate[at], s, FINISH)
        value, candidate = verified_bound(M[at], candidate, s)
        better = value > best[at]
        best[at[better]], delta[at[better]] = value[better], candidate[better]
    return MuBound(value=best, delta=np.moveaxis(delta, 0, 2))


def complex_lower_bound(
    M: np.ndarray, s: BlockStructure, n_starts: int, rng: Any, deadline: float
) -> tuple[np.ndarray, np.ndarray]:
    """The lower bound and its perturbation with every real block at zero."""
    some = [k for k, kind in enumerate(s.kinds) if kind != "real"]
    rows, cols = (np.concatenate([np.arange(cut[k].start, cut[k].stop) for k in some]) for cut in (s.rows, s.cols))
    blocks = [(s.rows[k].stop - s.rows[k].start, s.cols[k].stop - s.cols[k].start, s.kinds[k]) for k in some]
    alone = M[:, rows[:, None], cols]
    bound = search_perturbation(alone, structure_for("blocks", blocks, alone.shape[1:]), n_starts, rng, deadline)
    delta = np.zeros((M.shape[0], *s.shape[::-1]), complex)
    delta[:, cols[:, None], rows] = np.nan_to_num(np.moveaxis(bound.delta, 2, 0))
    return bound.value.copy(), delta


def verified_bound(M: np.ndarray, delta: np.ndarray, s: BlockStructure) -> tuple[np.ndarray, np.ndarray]:
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
    fine &= (least[:, -1] <= SINGULARITY_TOLERANCE * np.maximum(least[:, 0], 1.0)) & (size > 0)
    return np.where(fine, 1 / np.where(size > 0, size, 1.0), 0.0), np.where(fine[:, None, None], delta, np.nan)


def worst_directions(M: np.ndarray, s: BlockStructure, deadline: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(W, n_in, 3), (W, n_out, 3) directions at which the least bound (W,) is reached, largest first; and that bound.

    There the largest eigenvalues meet, and where the bound is mu itself a combination of their directions is the
    perturbation: right = N left, and left = Delta right, where left is as long as a Delta of size one makes it.
    """
    size = np.linalg.norm(M, axis=(1, 2))
    M = M / np.where(size > 0, size, 1.0)[:, None, None]  # the right directions are as long as N of size one makes them
    now = time.monotonic()
    D_L, D_R, G = optimal_scalings(M, s, 0.0, now + 0.5 * (deadline - now))
    scaled = D_L @ M @ np.linalg.inv(D_R)
    square = conjugate_transpose(scaled) @ scaled
    if s.skew.size:
        skew = 1j * G @ scaled
        square = square + skew + conjugate_transpose(skew)
    values, vectors = np.linalg.eigh(square)
    vectors = vectors[:, :, ::-1][:, :, :3]
    bound = np.sqrt(np.maximum(values[:, -1], 0.0))
    left, right = np.linalg.solve(D_R, vectors) * bound[:, None, None], np.linalg.solve(D_L, scaled @ vectors)
    return left, right, bound * size


def perturbation_from_directions(
    left: np.ndarray, right: np.ndarray, s: BlockStructure, rng: Any, *, random: bool
) -> np.ndarray:
    """A perturbation of size one along the first direction, or along a random combination, or any random one."""
    W, k = left.shape[0], left.shape[2]
    if rng is None:
        return align_perturbation(left[:, :, 0], right[:, :, 0], np.ones(W), s, inside=True)
    if random:
        left, right = (rng.standard_normal((W, n)) + 1j * rng.standard_normal((W, n)) for n in s.shape[::-1])
        return align_perturbation(left, right, np.ones(W), s)
    mix = (rng.standard_normal((W, k)) + 1j * rng.standard_normal((W, k))) * [1.0, 1.0, 0.3][:k]
    left, right = (np.einsum("wnk,wk->wn", vectors, mix) for vectors in (left, right))
    return align_perturbation(left, right, np.ones(W), s, inside=True)


def power_ascent(M: np.ndarray, delta: np.ndarray, s: BlockStructure, n_steps: int) -> tuple[np.ndarray, np.ndarray]:
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
        delta = align_perturbation(left, right, np.exp(1j * np.angle(value)), s)
        keep = (grown > 1e-10 * radius[todo]) & np.isfinite(delta).all(axis=(1, 2))
        todo, delta = todo[keep], delta[keep]
        if not todo.size:
            break
    return best, radius


def align_perturbation(
    left: np.ndarray, right: np.ndarray, turn: np.ndarray, s: BlockStructure, *, inside: bool = False
) -> np.ndarray:
    """Delta of size one that maximises Re(turn* left* Delta right), block by block.

    `inside` gives real blocks the number that takes right to left, where it is in [-1, 1].
    """
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
                if inside:
                    number = np.clip(np.nan_to_num(along.real / (np.abs(v) ** 2).sum(axis=1)), -1.0, 1.0)
            delta[:, col, row] = number[:, None, None] * np.eye(n)
    return delta


def real_crossing(N: np.ndarray, delta: np.ndarray, s: BlockStructure) -> np.ndarray:
    """A perturbation of size at most one, near the given one, with a large real eigenvalue of N delta.

    Real blocks move in [-1, 1], complex ones turn their phase: maximise Re lambda with Im lambda = 0. Between two such
    searches the complex blocks are turned to where the eigenvalue grows most.
    """
    real = np.array([kind == "real" for kind in s.kinds])
    low, high = np.where(real, -1.0, -7.0), np.where(real, 1.0, 7.0)
    scale = max(float(np.linalg.norm(N)), 1e-300)
    best, largest = delta, 0.0
    for _ in range(1 if real.all() else REAL_SEARCHES):
        # the search asks for the value and the slopes at the same point again and again
        at = lru_cache(maxsize=4)(partial(eigenvalue_and_slopes, N, delta, s))
        start = np.array([delta[c, r][0, 0].real for r, c in zip(s.rows, s.cols, strict=True)]) * real
        value = at(tuple(start))[0]
        sign = -1.0 if value.real < 0 else 1.0
        found = minimize(
            lambda x, at=at, sign=sign: [-sign * part.real / scale for part in at(tuple(x))[:2]],
            start * 0.999,
            jac=True,
            method="SLSQP",
            bounds=list(zip(low, high, strict=True)),
            constraints={
                "type": "eq",
                "fun": lambda x, at=at: at(tuple(x))[0].imag / scale,
                "jac": lambda x, at=at: at(tuple(x))[1].imag / scale,
            },
            options={"maxiter": 60, "ftol": 1e-10},
        )
        x = make_eigenvalue_real(np.clip(found.x, low, high), at, low, high)
        value, _, left, right = at(tuple(x))
        crossed = move_perturbation(delta, x, s)
        if abs(value.imag) <= 1e-9 * abs(value) and abs(value) > largest * (1 + 1e-9):
            best, largest = crossed, abs(value)
        turned = align_perturbation(left[None], right[None], np.array([np.sign(value.real) or 1.0]), s)[0]
        delta = crossed.copy()
        for kind, r, c in zip(s.kinds, s.rows, s.cols, strict=True):
            if kind != "real":
                delta[c, r] = turned[c, r]
    return best


def move_perturbation(delta: np.ndarray, x: np.ndarray, s: BlockStructure) -> np.ndarray:
    """The perturbation with its real blocks at x and its complex ones turned by x [rad]."""
    out = np.zeros_like(delta)
    for k, (kind, row, col) in enumerate(zip(s.kinds, s.rows, s.cols, strict=True)):
        out[col, row] = x[k] * np.eye(row.stop - row.start) if kind == "real" else delta[col, row] * np.exp(1j * x[k])
    return out


def eigenvalue_and_slopes(
    N: np.ndarray, delta: np.ndarray, s: BlockStructure, x: tuple[float, ...]
) -> tuple[complex, np.ndarray, np.ndarray, np.ndarray]:
    """An eigenvalue of N times the moved perturbation, its slopes along x, and N* l and r for its vectors.

    It is the one that is largest for how far it is from the real axis.
    """
    point = np.array(x)
    perturbed = move_perturbation(delta, point, s)
    values, vectors = np.linalg.eig(N @ perturbed)
    k = int(np.argmax(np.abs(values) - 2 * np.abs(values.imag)))
    right = vectors[:, k]
    drives = np.linalg.inv(vectors + 1e-14 * np.eye(len(values)))[k] @ N
    slopes = np.zeros(point.size, complex)
    for j, (kind, row, col) in enumerate(zip(s.kinds, s.rows, s.cols, strict=True)):
        slopes[j] = drives[col] @ (right[row] if kind == "real" else 1j * perturbed[col, row] @ right[row])
    return complex(values[k]), slopes, drives.conj(), right


def make_eigenvalue_real(x: np.ndarray, at: Any, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """The last digits: Newton steps of least length that bring the eigenvalue onto the real axis, inside the bounds."""
    for _ in range(12):
        value, slopes = at(tuple(x))[:2]
        y, slope = value.imag, slopes.imag.copy()
        slope[(x <= low) & (slope * y > 0) | (x >= high) & (slope * y < 0)] = 0.0
        if abs(y) < 1e-14 * abs(value) or not np.isfinite(y) or not slope.any():
            break
        x = np.clip(x - y * slope / (slope @ slope), low, high)
    return x
