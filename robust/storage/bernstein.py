"""The judge: whether a storage function proves a dissipation inequality, in numbers put together here.

On each interval of a period P is a cubic between nodes. The inequality [P' + A'P + PA + Q, PB + N; ., R] < 0 is then a
cubic in time, a convex combination of its four Bernstein coefficients: where these are negative definite it holds at
every instant. Each matrix is judged by its eigenvalues, by more than the rounding in putting it together.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import expm

from nlfrf.shared.values import value
from robust.storage.form import Block, Dissipation
from robust.storage.riccati import back_over, coordinates, jump_stretch, supply_with_slack

__all__ = ["Judged", "Storage", "in_coordinates", "judge", "judge_constant", "storage_function"]

EPS = np.finfo(float).eps


@value(copy=False)
class Judged:
    """A dissipation inequality in coordinates z = V z~, with how far each matrix may be off, entry by entry.

    Fields
    ------
    form : Dissipation
        In those coordinates; the inputs scaled so that the diagonal of R is minus one.
    A, B, Q, N, R, jumps, stored : ndarray of shape (as in the form)
        How far an entry may be off.
    V : (n, n) ndarray
        The coordinates.
    block : Block or None
        How far an entry of that of the form may be off.
    """

    form: Dissipation
    A: np.ndarray
    B: np.ndarray
    Q: np.ndarray
    N: np.ndarray
    R: np.ndarray
    jumps: np.ndarray
    stored: np.ndarray
    V: np.ndarray
    block: Block | None = None


@value(copy=False)
class Storage:
    """P over a period: Bernstein coefficients of cubics.

    Fields
    ------
    coefficients : (I, 4, n, n) ndarray
        Of each interval; neighbours in one span share their end.
    lengths : (I,) ndarray
        How long each lasts [s].
    first : (S,) integer ndarray
        The interval that begins each span.
    """

    coefficients: np.ndarray
    lengths: np.ndarray
    first: np.ndarray


def in_coordinates(form: Dissipation) -> Judged:
    """The inequality in balanced coordinates."""
    unit = np.sqrt(np.maximum(-np.diag(form.R), 1e-300))  # of the inputs
    top = unit.max()
    heavy = form.block and replace(form.block, weight=form.block.weight / top**2)
    V = coordinates(replace(form, B=form.B * (top / unit), block=heavy))
    back = np.linalg.inv(V)
    n = form.B.shape[0]
    more = form.stored.shape[0] - n
    aV, aback = np.abs(V), 1.01 * np.abs(back)
    k = (2 * n + 8) * EPS

    def similar(M: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """V^-1 M V, and from what is left of V X = M V how far it may be off."""
        X = back @ M @ V
        left = np.abs(V @ X - M @ V) + k * (aV @ np.abs(X) + np.abs(M) @ aV)
        return X, aback @ left

    A, A_off = similar(form.A)
    jumps = [similar(jump) for jump in form.jumps]
    B = back @ form.B / unit
    B_off = aback @ (np.abs(V @ B - form.B / unit) + k * (aV @ np.abs(B)) + form.B_error / unit)
    block, block_off = None, None
    if form.block is not None:
        b, c = form.block.enters, form.block.seen
        block = Block(enters=back @ b, seen=V.T @ c, weight=form.block.weight)
        left = np.abs(V @ block.enters - b) + k * (aV @ np.abs(block.enters))
        block_off = Block(enters=aback @ left, seen=k * (aV.T @ np.abs(c)), weight=8 * EPS * form.block.weight)
    wide = np.block([[V, np.zeros((n, more))], [np.zeros((more, n)), np.eye(more)]])
    awide = np.abs(wide)
    new = Dissipation(
        A=A,
        B=B,
        spans=form.spans,
        jumps=np.array([jump for jump, _ in jumps]).reshape(-1, n, n),
        Q=V.T @ form.Q @ V,
        N=V.T @ form.N / unit,
        R=form.R / np.outer(unit, unit),
        stored=wide.T @ form.stored @ wide,
        B_error=form.B_error,
        stored_error=form.stored_error,
        block=block,
    )
    return Judged(
        form=new,
        A=A_off,
        B=B_off,
        Q=k * (aV.T @ np.abs(form.Q) @ aV),
        N=k * (aV.T @ np.abs(form.N)) / unit,
        R=8 * EPS * np.abs(new.R),
        jumps=np.array([off for _, off in jumps]).reshape(-1, n, n),
        stored=k * (awide.T @ np.abs(form.stored) @ awide) + awide.T @ form.stored_error @ awide,
        V=V,
        block=block_off,
    )


def storage_function(form: Dissipation, P: np.ndarray, slack: float, n_intervals: int) -> Storage:
    """Cubics through the solution of the Riccati equation that begins with P, with its slopes."""
    A, G, Q = supply_with_slack(form, slack)
    hamiltonian = np.block([[A, G], [-Q, -A.T]])
    n, spans = A.shape[0], form.spans
    parts, lengths = [], []
    total = spans.sum()
    later = P  # just after the jump that begins the next span
    for i in reversed(range(spans.size)):
        W = back_over(jump_stretch(form, (i + 1) % spans.size, slack * total), later)
        count = max(1, round(n_intervals * spans[i] / total))
        h = spans[i] / count
        E = expm(-h * hamiltonian)
        nodes = [W]
        for _ in range(count):
            W = np.linalg.solve((E[:n, :n] + E[:n, n:] @ W).T, (E[n:, :n] + E[n:, n:] @ W).T).T
            W = (W + W.T) / 2
            nodes.append(W)
        node = np.array(nodes[::-1])
        slope = -(A.T @ node + node @ A + node @ G @ node + Q)
        cubics = np.stack([node[:-1], node[:-1] + h / 3 * slope[:-1], node[1:] - h / 3 * slope[1:], node[1:]], axis=1)
        parts.append(cubics)
        lengths.append(np.full(count, h))
        later = node[0]
    counts = [len(part) for part in parts[::-1]]
    begins = np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(int)
    return Storage(coefficients=np.concatenate(parts[::-1]), lengths=np.concatenate(lengths[::-1]), first=begins)


def negative(matrices: np.ndarray, errors: np.ndarray) -> float:
    """Largest scaled eigenvalue of symmetric matrices plus their rounding; below zero where all are negative."""
    diagonal = -np.diagonal(matrices, axis1=-2, axis2=-1)
    if not np.isfinite(matrices).all() or not np.all(diagonal > 0):
        return float("inf")
    root = np.sqrt(diagonal)
    scale = root[..., :, None] * root[..., None, :]
    n = matrices.shape[-1]
    largest = np.linalg.eigvalsh(matrices / scale)[..., -1]
    slack = np.linalg.norm(errors / scale, axis=(-2, -1)) + 10 * n * EPS
    return float((largest + slack).max())


def inequality(
    judged: Judged, P: np.ndarray, slope: np.ndarray, slope_size: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The matrix of the inequality for P and P', many at once, and how far it may be off."""
    form = judged.form
    n, m = form.B.shape
    k = (2 * n + 8) * EPS
    size = np.abs(P)
    M, E = np.zeros((*P.shape[:-2], n + m, n + m)), np.zeros((*P.shape[:-2], n + m, n + m))
    M[..., :n, :n] = slope + form.A.T @ P + P @ form.A + form.Q
    E[..., :n, :n] = size @ (k * np.abs(form.A) + judged.A)
    E[..., :n, :n] += np.swapaxes(E[..., :n, :n].copy(), -1, -2) + k * (slope_size + np.abs(form.Q)) + judged.Q
    M[..., :n, n:] = P @ form.B + form.N
    E[..., :n, n:] = size @ (k * np.abs(form.B) + judged.B) + k * np.abs(form.N) + judged.N
    M[..., n:, :n] = np.swapaxes(M[..., :n, n:], -1, -2)
    E[..., n:, :n] = np.swapaxes(E[..., :n, n:], -1, -2)
    M[..., n:, n:] = form.R
    E[..., n:, n:] = judged.R
    return (M + np.swapaxes(M, -1, -2)) / 2, E


def judge(judged: Judged, storage: Storage) -> tuple[str, float]:
    """Empty if the storage function proves the inequality, the jumps and the energy; else what fails, and by how much.

    The number is the largest scaled eigenvalue between samples where that fails, which finer intervals may mend, and
    infinite where they will not.
    """
    b, h = storage.coefficients, storage.lengths[:, None, None, None]
    steps = 3 * (b[:, 1:] - b[:, :-1]) / h  # of P', a parabola; raised to a cubic
    sizes = 3 * (np.abs(b[:, 1:]) + np.abs(b[:, :-1])) / h
    slope, size = raised(steps), raised(sizes)
    worst = negative(*inequality(judged, b, slope, size))
    if not worst < 0:
        return f"the inequality does not hold between samples: its largest scaled eigenvalue is {worst:.2g}", worst
    begins = b[storage.first, 0]
    ends = b[np.concatenate([storage.first[1:], [b.shape[0]]]) - 1, 3]
    for i in range(len(judged.form.jumps)):
        worst = negative(*jump_inequality(judged, i, ends[i - 1], begins[i]))
        if not worst < 0:
            return f"the energy may grow at a sample: its largest scaled eigenvalue is {worst:.2g}", np.inf
    return positive_energy(judged, np.array([begins[0], ends[-1]])), np.inf


def jump_inequality(judged: Judged, i: int, before: np.ndarray, after: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The matrix of what the energy gains at a jump, a block there as one more state, and how far it may be off."""
    jump, unsure, block, n = judged.form.jumps[i], judged.jumps[i], judged.form.block, before.shape[0]
    lost, loose = before, np.zeros_like(before)
    if i == 0 and block is not None and judged.block is not None:
        jump = np.column_stack([jump, -block.enters])
        unsure = np.column_stack([unsure, judged.block.enters])
        lost, loose = np.zeros((n + 1, n + 1)), np.zeros((n + 1, n + 1))
        lost[:n, :n], lost[n, n] = before, block.weight
        lost[:n, n] = lost[n, :n] = -block.seen
        loose[n, n] = judged.block.weight
        loose[:n, n] = loose[n, :n] = judged.block.seen
    wide = np.abs(jump) + unsure
    off = (2 * n + 4) * EPS * (wide.T @ np.abs(after) @ wide + np.abs(lost)) + loose
    cross = wide.T @ np.abs(after) @ unsure
    return jump.T @ after @ jump - lost, off + cross + cross.T


def raised(parabola: np.ndarray) -> np.ndarray:
    """(I, 4, ...) Bernstein coefficients of a parabola as those of a cubic."""
    first, second, third = parabola[:, 0], parabola[:, 1], parabola[:, 2]
    return np.stack([first, (first + 2 * second) / 3, (2 * second + third) / 3, third], axis=1)


def judge_constant(judged: Judged, P: np.ndarray) -> str:
    """The same of a loop without jumps and one P for all time."""
    still = np.zeros_like(P)
    worst = negative(*inequality(judged, P, still, still))
    if not worst < 0:
        return f"the inequality does not hold: its largest scaled eigenvalue is {worst:.2g}"
    return positive_energy(judged, P[None])


def positive_energy(judged: Judged, P: np.ndarray) -> str:
    """Empty if the stored energy is positive, whatever its states."""
    n = P.shape[-1]
    stored = judged.form.stored
    energy = np.broadcast_to(stored, (*P.shape[:-2], *stored.shape)).copy()
    energy[..., :n, :n] += P
    size = np.broadcast_to(judged.stored, energy.shape).copy() + 4 * EPS * np.abs(stored)
    size[..., :n, :n] += 4 * EPS * np.abs(P)
    worst = negative(-energy, size)
    return "" if worst < 0 else f"the stored energy is not positive: its least scaled eigenvalue is {-worst:.2g}"
