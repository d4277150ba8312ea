"""Ill-conditioned loops of order 15 to 30 beside the stability boundary, and their poles in many
digits.
"""

from __future__ import annotations

import control
import numpy as np
from flint import acb_mat, arb, ctx

from tests.support.random_loops import roots

BITS = 1500


def hard_loop(rng, most=30):
    """Plant and controller of 15 to `most` states together, continuous or sampled: modes over four
    decades.
    """
    total = int(rng.integers(15, most + 1))
    n = int(rng.integers(10, total - 2))
    G = in_bad_coordinates(rng, roots(rng, n, -1.5, 2.5, -3.0))
    K = in_bad_coordinates(rng, roots(rng, total - n, -1.5, 2.5, -1.0))
    if rng.random() < 0.5:
        dt = 10 ** rng.uniform(-3, -1.5)
        G, K = (
            control.StateSpace(*to_discrete(s.A * dt / 2, s.B * dt / 2, s.C, s.D), dt)
            for s in (G, K)
        )
    return G, K


def to_discrete(A, B, C, D):
    """The bilinear map z = (1 + s)/(1 - s)."""
    back = np.linalg.inv(np.eye(len(A)) - A)
    return back @ (np.eye(len(A)) + A), 2 * back @ B, C @ back, D + C @ back @ B


def modal_matrix(poles):
    """A real matrix with these eigenvalues, block by block."""
    n = poles.size
    A, k = np.zeros((n, n)), 0
    while k < n:
        p = poles[k]
        if p.imag:
            A[k : k + 2, k : k + 2] = [[p.real, p.imag], [-p.imag, p.real]]
            k += 2
        else:
            A[k, k] = p.real
            k += 1
    return A


def in_bad_coordinates(rng, poles):
    """A system with these poles, its states mixed by a matrix of condition up to 1e6."""
    n, A = poles.size, modal_matrix(poles)
    left, right = (np.linalg.qr(rng.normal(size=(n, n)))[0] for _ in range(2))
    T = left @ np.diag(10 ** rng.uniform(-3, 3, n)) @ right
    B, C = rng.normal(size=(n, 1)), rng.normal(size=(1, n))
    back = np.linalg.inv(T)
    return control.StateSpace(T @ A @ back, T @ B, C @ back, [[0.0]], 0)


def margin(G, K):
    """How far the outermost pole of the loop lies outside the boundary, from eigenvalues in 450
    digits.
    """
    n, m = G.nstates, K.nstates
    with ctx.workprec(BITS):
        A, B, C = ([[arb(float(x)) for x in row] for row in M] for M in (G.A, G.B, G.C))
        F, H, L = ([[arb(float(x)) for x in row] for row in M] for M in (K.A, K.B, K.C))
        k, d = arb(float(K.D[0, 0])), arb(float(G.D[0, 0]))
        # u = L xk + k e, e = -C x - d u
        u = [-k * C[0][j] / (1 + k * d) for j in range(n)] + [
            L[0][j] / (1 + k * d) for j in range(m)
        ]
        e = [-(C[0][j] if j < n else arb(0)) - d * u[j] for j in range(n + m)]
        upper = [
            [(A[i][j] if j < n else arb(0)) + B[i][0] * u[j] for j in range(n + m)]
            for i in range(n)
        ]
        lower = [
            [(F[i][j - n] if j >= n else arb(0)) + H[i][0] * e[j] for j in range(n + m)]
            for i in range(m)
        ]
        poles = acb_mat(upper + lower).eig(algorithm="approx")
        return max((abs(p) - 1 if G.dt else p.real).mid() for p in poles)


def with_gain(K, gain):
    """The controller times a gain."""
    return control.StateSpace(K.A, K.B, K.C * gain, K.D * gain, K.dt)


def boundary_gain(G, K, stable):
    """A gain between two neighbours of which one is stable: by bisection; None where none is
    found.
    """
    gains = np.geomspace(1e-9, 1e6, 16)
    verdicts = [stable(G, with_gain(K, g)) for g in gains]
    changes = [k for k in range(gains.size - 1) if verdicts[k] != verdicts[k + 1]]
    if not changes:
        return None
    low, high = gains[changes[0]], gains[changes[0] + 1]
    first = verdicts[changes[0]]
    for _ in range(60):
        middle = (low + high) / 2
        if middle in (low, high):
            break
        low, high = (middle, high) if stable(G, with_gain(K, middle)) == first else (low, middle)
    return low, high
