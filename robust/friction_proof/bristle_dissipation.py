"""The dissipation inequality of creeping bristles, in states that come to rest where the machine does.

With y = xi - F xi_e, F the elastic force and xi_e the rest under f = 1, with e_j = Fh_j - F, and inputs
gamma = F'/K0 and q = z',

    y' = F_loop y - K0 xi_e gamma + sigma B q,   e_j' = -a_j e_j - K0 gamma,   jump: J on y

and the class says d/dt [S - mu (F y_x + F^2 x_e/2)] <= Supply(z, gamma, q), where

    Supply = -mu K0 gamma y_x - sum nu_j (e_j q + (a_j/K0) e_j^2) + (v, q, gamma) M (v, q, gamma)'

and S >= mu F^2/(2 K0) + sum nu_j e_j^2/(2 K0). With mu = 0 (a circle criterion for the slopes) the energy is a form in
z alone: z and the inputs fall as an exponential, so that F = F(0) + int K0 gamma converges too.
"""

from __future__ import annotations

import numpy as np

from robust.friction_proof.bristle_multipliers import BristleWeights
from robust.sliding.loop import SlidingLoop
from robust.storage.form import Dissipation

__all__ = ["bristle_dissipation"]


def bristle_dissipation(
    loop: SlidingLoop, rates: np.ndarray, weights: BristleWeights, K0: float, microdamping: float
) -> Dissipation:
    """The inequality for a loop with weights of its forms; filters without weight are left out."""
    used = weights.nu > 0
    a, nu, mu, M = rates[used], weights.nu[used], weights.mu, weights.block
    n, extra = loop.F.shape[0], int(used.sum())
    size = n + extra
    rest, offset = loop.rest()
    A, B = np.zeros((size, size)), np.zeros((size, 2))
    A[:n, :n], A[n:, n:] = loop.F, -np.diag(a)
    B[:n, 0], B[n:, 0], B[:n, 1] = -K0 * rest, -K0, microdamping * loop.B
    jumps = np.zeros((loop.jumps.shape[0], size, size))
    jumps[:, :n, :n] = loop.jumps
    jumps[:, n:, n:] = np.eye(extra)
    x, v, e = np.pad(loop.x, (0, extra)), np.pad(loop.v, (0, extra)), slice(n, size)
    Q = M[0, 0] * np.outer(v, v)
    Q[e, e] -= np.diag(nu * a / K0)
    N = np.column_stack([M[0, 2] * v - mu * K0 / 2 * x, M[0, 1] * v])
    N[e, 1] -= nu / 2
    stored = np.zeros((size + 1, size + 1))  # in (z, F)
    stored[e, e] = np.diag(nu) / (2 * K0)
    stored[:size, size] = stored[size, :size] = -mu / 2 * x
    stored[size, size] = mu / (2 * K0) - mu / 2 * float(loop.x @ rest)
    stored_error = np.zeros_like(stored)
    stored_error[size, size] = mu / 2 * float(np.abs(loop.x) @ offset)
    kept = size + (mu > 0)  # without mu nothing of F is stored: z falls as an exponential, and F comes to rest with it
    B_error = np.zeros_like(B)
    B_error[:n, 0] = K0 * offset
    return Dissipation(
        A=A,
        B=B,
        spans=loop.spans,
        jumps=jumps,
        Q=Q,
        N=N,
        R=np.array([[M[2, 2], M[1, 2]], [M[1, 2], M[1, 1]]]),
        stored=stored[:kept, :kept],
        B_error=B_error,
        stored_error=stored_error[:kept, :kept],
    )
