"""The worst gain over a set of perturbations: a bound by one semidefinite program, and a
perturbation that attains it.

Let X > 0 be scalings that commute with the perturbations, and G Hermitian for the real blocks. The
gain of the performance channel stays below sqrt(gamma) if

    N^H diag(X_L, I) N + j (G N - N^H G^H) <= diag(X_R, gamma I).

This is linear in X, G and gamma together, so skewed mu needs no bisection. It is solved by a
primal-dual interior-point method for all frequencies at once, and the bound is recomputed from the
scalings.
"""

from __future__ import annotations

import numpy as np

from robust._base.types import Blocks
from robust.mu.blocks import BlockStructure, block_structure
from robust.mu.perturbations import (
    MOVES,
    align_perturbation,
    search_perturbation,
    without_real_blocks,
)
from robust.mu.scalings import (
    bound_from_scalings,
    conjugate_transpose,
    response_matrices,
    scaled_square,
    upper_bound,
)

_MAX_STEPS = 60
_GAPS = (
    1e-3,
    1e-5,
    1e-6,
    1e-7,
    1e-8,
    1e-9,
)  # relative distances of the program to its dual at which variables are kept
_TO_THE_BOUNDARY = 0.95  # share of the largest step that keeps both matrices positive
_N_STARTING_SIZES = 16
_ROUNDING_MARGINS = (1e-9, 1e-7, 1e-5, 1e-3)
_MAX_ENTRIES = 500_000  # of the arrays of one step, a fraction of a second


def gain_bound(N: np.ndarray, blocks: Blocks) -> np.ndarray:
    """Return an upper bound on the gain from the inputs to the outputs that no block closes, over
    all perturbations.

    N (n_out, n_in, W): its first outputs and inputs belong to the perturbations, of size at most
    one; the others are the performance. The bound is inf if the perturbations may make the loop
    singular.
    """
    M = response_matrices("N", N)
    rows, cols = block_structure("blocks", blocks).shape
    W, n_out, n_in = M.shape
    if rows >= n_out or cols >= n_in:
        raise ValueError(
            f"blocks must use fewer than the {n_out} outputs and {n_in} inputs of N, because"
            f" the others are the performance channel, got {rows} rows and {cols} columns"
        )
    gain = np.full(W, np.inf)
    stable = upper_bound(M[:, :rows, :cols], blocks, target=1.0)
    open_ = np.flatnonzero(stable.value < 1)
    if not open_.size:
        return gain
    assert stable.scaling is not None  # for an upper bound
    s = block_structure("blocks", blocks)
    for at in np.array_split(
        open_, max(1, open_.size * (len(s.left) + len(s.skew)) * n_in**2 // _MAX_ENTRIES)
    ):
        D_L, D_R, G = (np.moveaxis(each, 2, 0)[at] for each in stable.scaling)
        gain[at] = _least_gain(M[at], (D_L, D_R, G), slack=1 - stable.value[at] ** 2, s=s)
    return gain


def _least_gain(
    M: np.ndarray, of_blocks: tuple[np.ndarray, ...], *, slack: np.ndarray, s: BlockStructure
) -> np.ndarray:
    """Return (W,) the least gain that scalings prove; start from those of the blocks, which leave
    `slack` to one.
    """
    rows, cols = s.shape
    D_L, D_R, G = of_blocks
    # in the coordinates of these scalings X begins at one, and the gain at one
    scaled = M.copy()
    scaled[:, :rows] = D_L @ scaled[:, :rows]
    scaled[:, :, :cols] = scaled[:, :, :cols] @ np.linalg.inv(D_R)
    size, level = _starting_size(scaled, G, slack)
    unit = np.sqrt(level)
    scaled[:, rows:] *= size[:, None, None]
    scaled[:, :, cols:] /= (size * unit)[:, None, None]
    gain = np.full(len(M), np.inf)
    for found in _solve_gain_program(scaled, G, s):
        gain = np.minimum(gain, _proved_gain(scaled, found, s) * unit)
    return gain


def _proved_gain(M: np.ndarray, variables: np.ndarray, s: BlockStructure) -> np.ndarray:
    """Return (W,) the gain that variables of the program prove, recomputed from the scalings; inf
    if none.
    """
    (rows, cols), K = s.shape, len(s.left)
    try:
        C_L, C_R = (
            np.linalg.cholesky(np.tensordot(variables[:, :K], each, 1))
            for each in (s.left, s.right)
        )
    except np.linalg.LinAlgError:
        return np.full(len(M), np.inf)
    L, R = (np.tile(np.eye(n, dtype=complex), (len(M), 1, 1)) for n in M.shape[1:])
    L[:, :rows, :rows], R[:, :cols, :cols] = conjugate_transpose(C_L), conjugate_transpose(C_R)
    G = np.zeros((len(M), M.shape[2], M.shape[1]), complex)
    G[:, :cols, :rows] = (
        np.linalg.inv(C_R)
        @ np.tensordot(variables[:, K:-1], s.skew, 1)
        @ np.linalg.inv(conjugate_transpose(C_L))
    )
    reached = np.sqrt(
        np.maximum(_least_level(L @ M @ np.linalg.inv(R), G[:, :cols, :rows]), 1e-300)
    )
    gain = np.full(len(M), np.inf)
    for (
        margin
    ) in _ROUNDING_MARGINS:  # the gain that the scalings prove counts, not the one that was reached
        tried = reached * (1 + margin)
        divided = M.copy()
        divided[:, :, cols:] /= tried[:, None, None]
        proved = np.isinf(gain) & (bound_from_scalings(divided, L, R, G) < 1)
        gain[proved] = tried[proved]
    return gain


def _starting_size(
    M: np.ndarray, G: np.ndarray, slack: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return (W,) the size of the performance with the least level for unit scalings, and that
    level.

    The smallest size tried uses half of the slack of the loop of the blocks, so that it proves a
    level.
    """
    cols, rows = G.shape[1:]
    reads = np.linalg.norm(M[:, rows:, :cols], axis=(1, 2))
    smallest = np.sqrt(0.5 * slack) / np.maximum(
        reads, 1e-9 * np.linalg.norm(M, axis=(1, 2)) + 1e-300
    )
    sizes = smallest * 2.0 ** np.arange(_N_STARTING_SIZES)[:, None]
    levels = []
    for size in sizes:
        scaled = M.copy()
        scaled[:, rows:] *= size[:, None, None]
        scaled[:, :, cols:] /= size[:, None, None]
        closed = np.linalg.eigvalsh(scaled_square(scaled, G)[:, :cols, :cols])[:, -1]
        levels.append(np.where(closed < 1 - 0.01 * slack, _least_level(scaled, G), np.inf))
    best = np.argmin(levels, axis=0), np.arange(len(M))
    return sizes[best], np.maximum(np.array(levels)[best], 1e-300)


def _least_level(M: np.ndarray, G: np.ndarray) -> np.ndarray:
    """Return (W,) the smallest gamma with diag(I, gamma I) >= M^H M + j (G M - M^H G^H), or inf: a
    Schur complement.
    """
    A, n = scaled_square(M, G), G.shape[1]
    level = np.full(len(M), np.inf)
    # otherwise there is no gamma, and I - A is singular
    within = np.linalg.eigvalsh(A[:, :n, :n])[:, -1] < 1
    A = A[within]
    through = np.linalg.solve(np.eye(n) - A[:, :n, :n], A[:, :n, n:])
    level[within] = np.linalg.eigvalsh(A[:, n:, n:] + A[:, n:, :n] @ through)[:, -1]
    return level


def _solve_gain_program(M: np.ndarray, G: np.ndarray, s: BlockStructure) -> np.ndarray:
    """Return (len(GAPS), W, m) coefficients of X and G, and gamma, with decreasing gap, from X = I
    and the given G.

    Those with a larger gap are farther from the boundary: with a large G rounding takes the gain of
    the last ones.

    Minimise gamma with Z_1 = diag(X_R, gamma I) - M^H diag(X_L, I) M - j (G M - M^H G^H) and Z_2 =
    X_L positive, by the predictor and corrector of Mehrotra with the direction of Helmberg, Rendl,
    Vanderbei & Wolkowicz 1996.
    """
    W, n, (rows, cols) = len(M), M.shape[2], s.shape
    K, n_skew = len(s.left), len(s.skew)
    m = K + n_skew + 1
    first = np.zeros((W, m, n, n), complex)  # Z_1 is constant + sum of y first
    first[:, :K, :cols, :cols] = s.right
    first[:, :K] -= conjugate_transpose(M[:, None, :rows]) @ s.left @ M[:, None, :rows]
    if n_skew:
        skew = np.zeros((W, n_skew, n, n), complex)
        skew[:, :, :cols] = 1j * s.skew @ M[:, None, :rows]
        first[:, K:-1] -= skew + conjugate_transpose(skew)
    first[:, -1, cols:, cols:] = np.eye(n - cols)
    constant = -conjugate_transpose(M[:, rows:]) @ M[:, rows:]
    second = np.zeros((m, rows, rows), complex)
    second[:K] = s.left
    y = np.zeros((W, m))
    y[:, :K] = np.einsum("kii->k", s.left).real / np.einsum("kij,kji->k", s.left, s.left).real
    y[:, K:-1] = np.einsum("kij,wij->wk", s.skew.conj(), G).real
    y[:, -1] = 1.3
    todo, found, gap = np.arange(W), np.tile(y, (len(_GAPS), 1, 1)), np.full(W, np.inf)
    cones = [first, np.broadcast_to(second, (W, *second.shape))]
    Z = [constant + np.einsum("wk,wkij->wij", y, cones[0]), np.einsum("wk,wkij->wij", y, cones[1])]
    Y = [np.linalg.inv(each) for each in Z]  # the multipliers
    start = 1 / np.einsum("wii->w", Y[0][:, cols:, cols:]).real
    Y = [start[:, None, None] * each for each in Y]
    for _ in range(_MAX_STEPS):
        before = gap
        y, Z, Y, gap = _interior_point_step(y, Z, Y=Y, cones=cones)
        fine = np.isfinite(gap)
        for snapshot, level in zip(found, _GAPS, strict=True):
            still = fine & (before > level * y[:, -1])
            snapshot[todo[still]] = y[still]
        keep = fine & (gap > _GAPS[-1] * y[:, -1])
        todo, y, gap = todo[keep], y[keep], gap[keep]
        Z, Y, cones = ([each[keep] for each in group] for group in (Z, Y, cones))
        if not todo.size:
            break
    return found


def _interior_point_step(
    y: np.ndarray, Z: list[np.ndarray], *, Y: list[np.ndarray], cones: list[np.ndarray]
) -> tuple[np.ndarray, list[np.ndarray], list[np.ndarray], np.ndarray]:
    """Take one step of variables, slacks and multipliers; return them and the gap (W,), nan if no
    step was possible.
    """
    W, m = y.shape
    size = sum(each.shape[1] for each in Z)
    inverse = [np.linalg.inv(each) for each in Z]
    H, pull = np.zeros((W, m, m)), np.zeros((W, m))
    for B, multiplier, inv in zip(cones, Y, inverse, strict=True):
        P = multiplier[:, None] @ B @ inv[:, None]
        H += (B.reshape(W, m, -1) @ P.swapaxes(-1, -2).reshape(W, m, -1).swapaxes(-1, -2)).real
        pull += np.einsum("wkij,wji->wk", B, inv).real
    gap = sum(np.einsum("wij,wji->w", a, b).real for a, b in zip(Z, Y, strict=True))
    goal = np.zeros(m)
    goal[-1] = 1.0
    H += 1e-15 * np.einsum("wkk->wk", H)[:, :, None] * np.eye(m)

    def direction(
        centre: np.ndarray, correction: list[np.ndarray] | None
    ) -> tuple[np.ndarray, list[np.ndarray], list[np.ndarray]]:
        right = centre[:, None] * pull - goal
        if correction is not None:
            for B, each in zip(cones, correction, strict=True):
                right -= np.einsum("wkij,wji->wk", B, each).real
        dy = np.linalg.solve(H, right[:, :, None])[:, :, 0]
        dZ = [np.einsum("wk,wkij->wij", dy, B) for B in cones]
        dY = []
        for k, (multiplier, inv) in enumerate(zip(Y, inverse, strict=True)):
            change = multiplier @ dZ[k] @ inv
            if correction is not None:
                change = change + correction[k]
            dY.append(
                centre[:, None, None] * inv
                - multiplier
                - (change + conjugate_transpose(change)) / 2
            )
        return dy, dZ, dY

    with np.errstate(all="ignore"):
        roots = [_inverse_root(each) for each in Z], [_inverse_root(each) for each in Y]
        try:
            _, dZ, dY = direction(np.zeros(W), None)
            a_Z, a_Y = _longest_step(roots[0], dZ), _longest_step(roots[1], dY)
            after = sum(
                np.einsum(
                    "wij,wji->w", z + a_Z[:, None, None] * dz, x + a_Y[:, None, None] * dx
                ).real
                for z, dz, x, dx in zip(Z, dZ, Y, dY, strict=True)
            )
            centre = np.clip(after / gap, 1e-4, 1.0) ** 3 * gap / size
            correction = [dx @ dz @ inv for dx, dz, inv in zip(dY, dZ, inverse, strict=True)]
            dy, dZ, dY = direction(centre, correction)
            a_Z, a_Y = _longest_step(roots[0], dZ), _longest_step(roots[1], dY)
        except np.linalg.LinAlgError:
            return y, Z, Y, np.full(W, np.nan)
    fine = np.isfinite(a_Z) & np.isfinite(a_Y) & (a_Z > 1e-6)
    a_Z, a_Y = np.where(fine, a_Z, 0.0), np.where(fine, a_Y, 0.0)
    y = y + a_Z[:, None] * np.where(fine[:, None], dy, 0)
    Z = [
        z + a_Z[:, None, None] * np.where(fine[:, None, None], dz, 0)
        for z, dz in zip(Z, dZ, strict=True)
    ]
    Y = [
        x + a_Y[:, None, None] * np.where(fine[:, None, None], dx, 0)
        for x, dx in zip(Y, dY, strict=True)
    ]
    gap = sum(np.einsum("wij,wji->w", a, b).real for a, b in zip(Z, Y, strict=True))
    return y, Z, Y, np.where(fine & (gap > 0), gap, np.nan)


def _inverse_root(A: np.ndarray) -> np.ndarray:
    """Return A^-1/2 of every matrix; nan if it is not positive."""
    values, vectors = np.linalg.eigh(A)
    return np.where(values > 0, values, np.nan)[:, None, :] ** -0.5 * vectors


def _longest_step(roots: list[np.ndarray], steps: list[np.ndarray]) -> np.ndarray:
    """Return (W,) the longest step up to one that keeps all matrices positive; else nan."""
    least = np.zeros(len(steps[0]))
    for root, step in zip(roots, steps, strict=True):
        turned = conjugate_transpose(root) @ step @ root
        known = np.isfinite(turned).all(axis=(1, 2))
        low = np.linalg.eigvalsh(np.where(known[:, None, None], turned, 0))[:, 0]
        least = np.where(known, np.minimum(least, low), np.nan)
    return np.minimum(1.0, _TO_THE_BOUNDARY / np.maximum(-least, 1e-300))


# ---- A perturbation of the set that makes the gain large.
#
# The gain of F_u(N, Delta) changes by u* N_21 (I - Delta N_11)^-1 d(Delta) (I - N_11 Delta)^-1 N_12
# v with its singular vectors. Over the set it rises most towards a corner in closed form. Every
# Delta on the way there is in the set too (the method of Frank & Wolfe), so each step takes the
# largest gain of several points on the way.

_N_SEARCHES = 12  # random starts, in addition to the perturbation of skewed mu
_MAX_ASCENT = 200
_GROWTH = 1e-7


def search_worst_case(
    M: np.ndarray, blocks: Blocks, *, upper: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return (W,) the largest gain found over the set, and (W, n_in, n_out) its perturbation.

    The gain is inf, with a perturbation that makes the loop singular, if one of size at most one
    was found.
    """
    s = block_structure("blocks", blocks)
    (rows, cols), W = s.shape, len(M)
    gain, delta = np.zeros(W), np.zeros((W, cols, rows), complex)
    open_ = np.flatnonzero(np.isinf(upper))
    if open_.size:
        smallest = search_perturbation(M[open_, :rows, :cols], s, n_starts=6, rng=rng)
        assert smallest.delta is not None  # for a lower bound
        singular = smallest.value >= 1
        gain[open_[singular]] = np.inf
        delta[open_[singular]] = np.moveaxis(smallest.delta, 2, 0)[singular]
    todo = np.flatnonzero(np.isfinite(gain) & (upper > 0))
    if not todo.size:
        return gain, delta
    starts = [np.zeros((todo.size, cols, rows), complex)]
    starts.append(_perturbation_of_skewed_mu(M[todo], s, gain=upper[todo], rng=rng))
    starts.append(without_real_blocks(starts[1], s))
    for _ in range(_N_SEARCHES):
        left, right = (rng.standard_normal((2, todo.size, n)) for n in (cols, rows))
        direction = align_perturbation(
            left[0] + 1j * left[1], right[0] + 1j * right[1], turn=np.ones(todo.size), s=s
        )
        starts.append(rng.uniform(0, 1, (todo.size, 1, 1)) * direction)
    reached, found = _ascend_gain(np.tile(M[todo], (len(starts), 1, 1)), np.concatenate(starts), s)
    best = reached.reshape(len(starts), -1).argmax(axis=0) * todo.size + np.arange(todo.size)
    gain[todo], delta[todo] = reached[best], found[best]
    return gain, delta


def _perturbation_of_skewed_mu(
    M: np.ndarray, s: BlockStructure, *, gain: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Return (W, n_in, n_out) of size at most one: the blocks of skewed mu at one with the outputs
    over the gain.
    """
    rows, cols = s.shape
    level = np.where(
        np.isfinite(gain), gain, 10 * np.linalg.norm(M[:, rows:, cols:], axis=(1, 2)) + 1e-300
    )
    scaled = M.copy()
    scaled[:, rows:] /= level[:, None, None]
    sizes = [
        (r.stop - r.start, c.stop - c.start, kind)
        for r, c, kind in zip(s.rows, s.cols, s.kinds, strict=True)
    ]
    whole = block_structure("blocks", [*sizes, (M.shape[1] - rows, M.shape[2] - cols)])
    found = search_perturbation(scaled, whole, n_starts=2, rng=rng)
    assert found.delta is not None  # for a lower bound
    delta = np.nan_to_num(np.moveaxis(found.delta, 2, 0)[:, :cols, :rows])
    size = np.linalg.norm(delta, 2, axis=(1, 2))
    return delta / np.maximum(size, 1.0)[:, None, None]


def _ascend_gain(
    M: np.ndarray, delta: np.ndarray, s: BlockStructure
) -> tuple[np.ndarray, np.ndarray]:
    """Return (W,) gains and perturbations of size at most one, improved by ascent."""
    rows, cols = s.shape
    delta, gain, todo = delta.copy(), np.zeros(len(M)), np.arange(len(M))
    for _ in range(_MAX_ASCENT):
        N, now = M[todo], delta[todo]
        with np.errstate(all="ignore"):
            U, sizes, Vh = np.linalg.svd(np.nan_to_num(_closed_gain(N, now)))
            right = np.linalg.solve(
                np.eye(rows) - N[:, :rows, :cols] @ now,
                N[:, :rows, cols:] @ conjugate_transpose(Vh[:, :1]),
            )
            through = N[:, rows:, :cols] @ np.linalg.inv(np.eye(cols) - now @ N[:, :rows, :cols])
            drive = (conjugate_transpose(U[:, :, :1]) @ through)[:, 0]
            corner = np.nan_to_num(
                align_perturbation(drive.conj(), right[:, :, 0], turn=np.ones(todo.size), s=s)
            )
            best, moved = sizes[:, 0].copy(), now.copy()
            for share in MOVES:
                candidate = (1 - share) * now + share * corner
                reached = np.linalg.norm(np.nan_to_num(_closed_gain(N, candidate)), 2, axis=(1, 2))
                better = reached > best
                best, moved[better] = np.maximum(best, reached), candidate[better]
        delta[todo], gain[todo] = moved, best
        todo = todo[best > sizes[:, 0] * (1 + _GROWTH)]
        if not todo.size:
            break
    return gain, delta


def _closed_gain(M: np.ndarray, delta: np.ndarray) -> np.ndarray:
    """Return F_u(M, delta) for every matrix."""
    cols, rows = delta.shape[1:]
    loop = np.linalg.solve(np.eye(rows) - M[:, :rows, :cols] @ delta, M[:, :rows, cols:])
    return np.asarray(M[:, rows:, cols:] + M[:, rows:, :cols] @ delta @ loop)
