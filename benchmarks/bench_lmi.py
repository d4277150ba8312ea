"""Proofs of several channels on random loops: how many, how fast, each verified again and attacked.

    python -m benchmarks.bench_lmi [--loops 300] [--first 0]

Each loop: order 4 to 24, continuous or sampled, 2 to 5 blocks (full, repeated, real numbers) in
units that lie decades apart, modes over three decades or a random state matrix; scaled to an upper
bound of mu on a dense grid between 0.4 and 1.2. Counted: the share proved below one of those whose
bound is below 0.9, proofs not verified over the rationals, and proofs that a perturbation of size
one contradicts. Perturbations are searched for at the peaks of the lower bound of mu, by random
ones and by ascent of the poles, and judged by the poles of the closed loop.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter

import control
import numpy as np

import robust
from benchmarks.soundness_matrix import broken, passes
from robust.lti.grids import structure_grid
from robust.lti.lti import response_by_channel

KINDS = ((1, 1, "full"), (2, 1, "full"), (2, 2, "full"), (2, 2, "repeated"), (1, 1, "real"))
N_RANDOM = 300  # perturbations tried at random, beside those that the lower bound of mu names
N_ASCENTS = 4  # starts of the ascent of the poles


def random_blocks(rng):
    """Two to five blocks, some of them real numbers in every third loop at most."""
    while True:
        blocks = [
            KINDS[k]
            for k in rng.choice(len(KINDS), rng.integers(2, 6), p=(0.45, 0.1, 0.15, 0.1, 0.2))
        ]
        if 2 <= sum(block[0] for block in blocks) <= 8 and any(
            block[2] != "real" for block in blocks
        ):
            return blocks


def state_matrix(rng, n):
    """Modes from 0.1 to 100 rad/s with damping down to 0.01, or a random matrix, stable."""
    if rng.random() < 0.5:
        A = rng.standard_normal((n, n))
        return A - (np.linalg.eigvals(A).real.max() + rng.uniform(0.05, 1)) * np.eye(n)
    A, k = np.zeros((n, n)), 0
    while k < n:
        w = 10 ** rng.uniform(-1, 2)
        if n - k == 1 or rng.random() < 0.3:
            A[k, k], k = -w, k + 1
        else:
            A[k : k + 2, k : k + 2] = w * np.array(
                [[0.0, 1.0], [-1.0, -2 * 10 ** rng.uniform(-2, 0)]]
            )
            k += 2
    return A


def dense_grid(N):
    """Frequencies [rad/s] of the check, with points between them and beyond."""
    omega = structure_grid(N)
    between = np.sqrt(omega[1:-1] * omega[2:])
    return np.unique(
        np.concatenate([omega, between, [omega[1] / 100], [] if N.dt else [omega[-1] * 100]])
    )


def feedback_loop(rng, dt):
    """N of a random plant under integral control, and its random blocks; None where it is
    unstable.
    """
    k, n = int(rng.integers(2, 5)), int(rng.integers(2, 9))
    A = state_matrix(rng, n)
    B, C = rng.standard_normal((n, k)), rng.standard_normal((k, n))
    fast, slow = np.abs(np.linalg.eigvals(A)).max(), np.abs(np.linalg.eigvals(A)).min()
    dt = dt / fast
    gain = np.linalg.inv(-C @ np.linalg.solve(A, B) + 1e-6 * np.eye(k))
    size = np.linalg.norm(C @ np.linalg.solve(1j * slow * np.eye(n) - A, B) @ gain, 2)
    crossover = slow * 10 ** rng.uniform(-1, 1) / size
    G = control.StateSpace(A, B, C, np.zeros((k, k)), 0)
    direct = rng.choice([0.0, 1.0]) * crossover / fast
    K = control.StateSpace(np.zeros((k, k)), np.eye(k), crossover * gain, direct * gain, 0)
    if dt:
        G, K = robust.sampled(G, dt), control.StateSpace(np.eye(k), dt * np.eye(k), K.C, K.D, dt)
    A = np.block([[G.A - G.B @ K.D @ G.C, -G.B @ K.C], [K.B @ G.C, K.A]])
    p = np.linalg.eigvals(A)
    if (np.abs(p).max() > 1 - 1e-5) if dt else (p.real.max() > -1e-5):
        return None
    B = np.block(
        [[G.B, -G.B @ K.D], [np.zeros((k, k)), K.B]]
    )  # forces at the inputs, disturbances at the outputs
    C = np.block([[-K.D @ G.C, -K.C], [G.C, np.zeros((k, k))]])  # what K asks for, what is measured
    D = np.block([[np.zeros((k, k)), -K.D], [np.zeros((k, k)), np.eye(k)]])
    rows, cols, blocks, weights = [], [], [], []
    for block in random_blocks(rng):
        side = int(rng.integers(2)) * k
        read, drive = (side + rng.choice(k, min(size, k), replace=False) for size in block[:2])
        if block[2] != "full":
            drive = read
        rows = [*rows, *read]
        cols = [*cols, *drive]
        blocks = [*blocks, (len(read), len(drive), block[2])]
        weights += [random_weight(rng, crossover, dt, block[2], bool(side))] * len(read)
    N = control.StateSpace(A, B[:, cols], C[rows], D[np.ix_(rows, cols)], dt)
    return control.append(*weights) * N, blocks


def random_weight(rng, crossover, dt, kind, output):
    """A weight of an uncertainty that grows with the frequency, of performance that falls, of a
    parameter constant.
    """
    low, high = 10 ** rng.uniform(-1.5, -0.3), 10 ** rng.uniform(0, 1)
    if kind == "real" or rng.random() < 0.2:
        return control.StateSpace([], [], [], [[low]], dt)
    low, high = (high, low) if output and rng.random() < 0.5 else (low, high)
    pole = crossover * 10 ** rng.uniform(-1, 2)
    weight = control.StateSpace([[-pole]], [[1.0]], [[(low - high) * pole]], [[high]], 0)
    return robust.lti.discretize(weight, dt) if dt else weight


def random_system(rng, dt):
    """N of random numbers, its channels in units that lie decades apart, and its blocks."""
    blocks, n = random_blocks(rng), int(rng.integers(4, 25))
    rows, cols = [b[0] for b in blocks], [b[1] for b in blocks]
    A = state_matrix(rng, n)
    speed = np.sqrt(np.abs(A).max(axis=1))[:, None]  # modes of like weight
    B = rng.standard_normal((n, sum(cols))) * speed
    C = rng.standard_normal((sum(rows), n)) * speed.T
    D = rng.choice([0.0, 0.1]) * rng.standard_normal((sum(rows), sum(cols)))
    units = 10.0 ** rng.uniform(-2, 2, len(blocks))
    left, right = np.repeat(units, rows)[:, None], np.repeat(units, cols)
    N = control.StateSpace(A, B / right, left * C, left * D / right, 0)
    return (robust.lti.discretize(N, dt / np.abs(np.linalg.eigvals(A)).max()) if dt else N), blocks


def random_loop(seed):
    """N, its blocks and its upper bound of mu on a dense grid."""
    rng = np.random.default_rng(seed)
    while True:
        dt = float(10 ** rng.uniform(-0.7, 0.3)) if rng.random() < 0.5 else 0.0
        found = feedback_loop(rng, dt) if seed % 3 else random_system(rng, dt)
        if found is not None and 4 <= found[0].nstates <= 24:
            break
    N, blocks = found
    goal = rng.uniform(0.4, 1.2)
    peak = robust.mu.upper(response_by_channel(N, dense_grid(N)), blocks).value.max()
    root = np.sqrt(goal / peak)
    return control.StateSpace(N.A, root * N.B, root * N.C, root**2 * N.D, N.dt), blocks, goal


def perturbation_systems(deltas, omega, blocks, dt):
    """States (A, B, C, D) of real systems of gain one that are these matrices (T, n_in, n_out) at
    omega (T,).
    """
    parts, r, c, T = [], 0, 0, len(deltas)
    for rows, cols, kind in blocks:
        block = deltas[:, c : c + cols, r : r + rows]
        r, c = r + rows, c + cols
        if kind == "real":
            D = np.sign(block[:, :1, :1].real) * np.abs(block[:, :1, :1]).clip(0, 1) * np.eye(rows)
            parts.append((np.zeros((T, 0, 0)), np.zeros((T, 0, rows)), np.zeros((T, rows, 0)), D))
        elif kind == "repeated":
            number = block[:, 0, :1] / np.maximum(np.abs(block[:, 0, :1]), 1e-300)
            parts.append(
                tuple(each[:, :, None] * np.eye(rows) for each in passes(number, omega, dt))
            )
        else:
            U, _, Vh = np.linalg.svd(block)
            a1, b1, c1, d1 = passes(Vh[:, 0], omega, dt)  # one number out of what the block reads
            a2, b2, c2, d2 = passes(U[:, :, 0], omega, dt)  # into what it drives
            n1, n2, diag = rows, cols, lambda x: x[:, :, None] * np.eye(x.shape[1])
            A = np.zeros((T, n1 + n2, n1 + n2))
            A[:, :n1, :n1], A[:, n1:, n1:], A[:, n1:, :n1] = (
                diag(a1),
                diag(a2),
                b2[:, :, None] * c1[:, None],
            )
            B = np.concatenate([diag(b1), b2[:, :, None] * d1[:, None]], axis=1)
            C = np.concatenate([d2[:, :, None] * c1[:, None], diag(c2)], axis=2)
            parts.append((A, B, C, d2[:, :, None] * d1[:, None]))
    return tuple(block_diagonal([part[k] for part in parts]) for k in range(4))


def block_diagonal(parts):
    """(T, ., .) matrices along the diagonal."""
    shape = sum(p.shape[1] for p in parts), sum(p.shape[2] for p in parts)
    out, r, c = np.zeros((len(parts[0]), *shape)), 0, 0
    for part in parts:
        out[:, r : r + part.shape[1], c : c + part.shape[2]] = part
        r, c = r + part.shape[1], c + part.shape[2]
    return out


def random_deltas(rng, blocks, n):
    """(n, n_in, n_out) matrices of the structure, each block of size one, real numbers anywhere up
    to one.
    """
    out = []
    for rows, cols, kind in blocks:
        if kind == "real":
            out.append(
                np.where(rng.random(n) < 0.7, rng.choice([-1.0, 1.0], n), rng.uniform(-1, 1, n))[
                    :, None, None
                ]
            )
        elif kind == "repeated":
            out.append(np.exp(2j * np.pi * rng.random(n))[:, None, None] * np.eye(rows))
        else:
            left, right = (rng.standard_normal((2, n, k)) @ np.eye(k) for k in (cols, rows))
            u, v = left[0] + 1j * left[1], right[0] + 1j * right[1]
            u, v = (x / np.linalg.norm(x, axis=1, keepdims=True) for x in (u, v))
            out.append(u[:, :, None] * v[:, None].conj())
    shape = sum(p.shape[1] for p in out), sum(p.shape[2] for p in out)
    delta, r, c = np.zeros((n, *shape), complex), 0, 0
    for part in out:
        delta[:, r : r + part.shape[1], c : c + part.shape[2]] = part
        r, c = r + part.shape[1], c + part.shape[2]
    return delta


def breaks(N, blocks, seed):
    """Whether a perturbation of size 0.999 of the structure was found that makes the loop
    unstable.
    """
    rng, dt = np.random.default_rng(seed), float(N.dt or 0)
    omega = dense_grid(N)[1:]
    omega = omega[omega < np.pi / dt * 0.999] if dt else omega
    response = response_by_channel(N, omega)
    peaks = np.argsort(-robust.mu.upper(response, blocks).value)[:12]
    found = robust.mu.lower(response[:, :, peaks], blocks, n_starts=8, rng=seed)
    known = np.isfinite(found.delta).all(axis=(0, 1))
    deltas = np.moveaxis(found.delta[:, :, known] * found.value[known], 2, 0)
    where = omega[peaks[known]]
    for _ in range(N_ASCENTS):  # from the best known, ever nearer to it
        tried = random_deltas(rng, blocks, N_RANDOM // N_ASCENTS)
        at = rng.choice(omega[peaks] if rng.random() < 0.5 else omega, len(tried))
        if len(deltas):
            base = rng.integers(len(deltas), size=len(tried))
            spread = 10 ** rng.uniform(-3, 0.3, len(tried))[:, None, None]
            near = rng.random(len(tried)) < 0.7
            tried = np.where(near[:, None, None], deltas[base] + spread * tried, tried)
            at = np.where(
                near, where[base] * np.exp(0.3 * spread[:, 0, 0] * rng.standard_normal(len(at))), at
            )
        deltas, where = np.concatenate([deltas, tried]), np.concatenate([where, at])
    where = np.minimum(where, np.pi / dt * 0.999) if dt else where
    return bool(broken(N, perturbation_systems(deltas, where, blocks, dt), 0.999).any())


def main(loops, first):
    """Every figure."""
    told, seconds, near_20 = Counter(), [], []
    for seed in range(first, first + loops):
        N, blocks, bound = random_loop(seed)
        begin = time.process_time()
        proof = robust.mu.certify(N, blocks, 1.0)
        seconds.append(time.process_time() - begin)
        near_20 += [seconds[-1]] * (18 <= N.nstates <= 22)
        about = (
            f"loop {seed}: {N.nstates} states, {blocks}, dt {N.dt}, bound {bound:.3f},"
            f" {seconds[-1]:.1f} s"
        )
        told["bound below 0.9"] += bound < 0.9
        if not proof.holds:
            if bound < 0.9:
                print(f"{about}: {proof.reason}", flush=True)
            continue
        told["of these proved"] += bound < 0.9
        told[proof.method] += 1
        if not proof.verify().verified:
            told["not verified"] += 1
            print(f"{about}: {proof.method}, NOT verified", flush=True)
        if breaks(N, blocks, seed):
            told["CONTRADICTED"] += 1
            print(
                f"{about}: proved by {proof.method}, and a perturbation of size 0.999 breaks it",
                flush=True,
            )
    print(f"{loops} loops: {', '.join(f'{name} {count}' for name, count in told.items())}")
    print(
        f"seconds of a proof: median {np.median(seconds):.2f}, largest {max(seconds):.1f}; "
        f"orders 18 to 22: median {np.median(near_20 or [np.nan]):.2f}"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--loops", type=int, default=300)
    parser.add_argument("--first", type=int, default=0)
    given = parser.parse_args()
    main(given.loops, given.first)
