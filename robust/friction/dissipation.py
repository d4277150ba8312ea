"""The dissipation inequality of a Maxwell-slip friction, in states that come to rest where the machine does.

The reference filter fh_1 follows the friction f. With d = f - fh_1 as input, xi_e the rest under f = 1, and states

    z = (y, e_j),   y = xi - fh_1 xi_e,   e_j = fh_j - fh_1 (j >= 2)
    y' = F y + (B - a_1 xi_e) d,   e_j' = -a_j e_j + (a_j - a_1) d,   jump: J on y

the class says  d/dt [sum S_i - s (fh_1 x - fh_1^2 x_e/2)] <= Supply(z, d), a form, where

    Supply = mu_0 (d v - a_1 d y_x) + sum_j mu_j [d v - (1 - 1/rho) a_1 d y_x - e_j v/rho - (a_j/(rho K0)) (d - e_j)^2]

and s = mu_0 + (1 - 1/rho) sum_j mu_j. This takes out the line of rests, on which nothing can be strict.
"""

from __future__ import annotations

import numpy as np

from robust.friction.multipliers import BristleMultipliers
from robust.friction.plant import FrictionLoop
from robust.friction.storage import Dissipation

__all__ = ["ROUNDED_UP", "bristle_dissipation", "maxwell_slip_dissipation"]


#: rho = 1 as it is taken, a larger class: at one itself the stored energy is not strictly positive. With integral
#: action K0 (rho - 1) < k + K_p limits what is provable; 1.001 left a PID of 200 N/m undecided from K0 = 1e5 N/m on.
ROUNDED_UP = 1 + 1e-6


def maxwell_slip_dissipation(
    loop: FrictionLoop, rates: np.ndarray, *, mu: np.ndarray, K0: float, rho: float
) -> Dissipation:
    """Return the inequality for a loop with weights mu = (mu_0, mu_1, ...); filters without weight are left out."""
    rho = max(rho, ROUNDED_UP)
    used = np.concatenate([[True], mu[2:] > 0])
    a, weight, free = rates[used], np.where(mu[1:] > 0, mu[1:], 0.0)[used], float(mu[0])
    n, extra = loop.F.shape[0], a.size - 1
    size = n + extra
    rest, offset = loop.rest()
    A, B = np.zeros((size, size)), np.zeros(size)
    A[:n, :n], A[n:, n:] = loop.F, -np.diag(a[1:])
    B[:n], B[n:] = loop.B - a[0] * rest, a[1:] - a[0]
    jumps = np.zeros((loop.jumps.shape[0], size, size))
    jumps[:, :n, :n] = loop.jumps
    jumps[:, n:, n:] = np.eye(extra)
    x, v = np.pad(loop.x, (0, extra)), np.pad(loop.v, (0, extra))
    total = float(weight.sum())
    s = free + (1 - 1 / rho) * total
    lost = weight * a / (rho * K0)
    Q, N = np.zeros((size, size)), (free + total) / 2 * v - s * a[0] / 2 * x
    R = -lost.sum()
    for j in range(1, a.size):
        e = n + j - 1
        Q[e] -= weight[j] / (2 * rho) * v
        Q[:, e] -= weight[j] / (2 * rho) * v
        Q[e, e] -= lost[j]
        N[e] += lost[j]
    stored = np.zeros((size + 2, size + 2))
    h, F = size, size + 1
    x_e = float(loop.x @ rest)
    stored[:size, h] = stored[h, :size] = -s / 2 * x
    stored[h, h] = -s * x_e / 2 + total / (rho * 2 * K0)
    stored[F, F] = (free + total) / (2 * K0)
    stored[h, F] = stored[F, h] = -total / (rho * 2 * K0)
    for j in range(1, a.size):
        e, held = n + j - 1, weight[j] / (2 * K0 * rho)
        stored[e, e] += held
        stored[e, h] += held
        stored[h, e] += held
        stored[e, F] -= held
        stored[F, e] -= held
    stored_error = np.zeros_like(stored)
    stored_error[h, h] = s / 2 * float(np.abs(loop.x) @ offset)
    return Dissipation(
        A=A,
        B=B[:, None],
        spans=loop.spans,
        jumps=jumps,
        Q=Q,
        N=N[:, None],
        R=np.array([[R]]),
        stored=stored,
        B_error=np.pad(a[0] * offset, (0, extra))[:, None],
        stored_error=stored_error,
    )


# ---- The dissipation inequality of creeping bristles, in states that come to rest where the machine does.
#
# With y = xi - F xi_e, F the elastic force and xi_e the rest under f = 1, with e_j = Fh_j - F, and inputs
# gamma = F'/K0 and q = z',
#
#     y' = F_loop y - K0 xi_e gamma + sigma B q,   e_j' = -a_j e_j - K0 gamma,   jump: J on y
#
# and the class says d/dt [S - mu (F y_x + F^2 x_e/2)] <= Supply(z, gamma, q), where
#
#     Supply = -mu K0 gamma y_x - sum nu_j (e_j q + (a_j/K0) e_j^2) + (v, q, gamma) M (v, q, gamma)'
#
# and S >= mu F^2/(2 K0) + sum nu_j e_j^2/(2 K0). With mu = 0 (a circle criterion for the slopes) the energy is a form
# in
# z alone: z and the inputs fall as an exponential, so that F = F(0) + int K0 gamma converges too.


def bristle_dissipation(
    loop: FrictionLoop, rates: np.ndarray, *, weights: BristleMultipliers, K0: float, microdamping: float
) -> Dissipation:
    """Return the inequality for a loop with weights of its forms; filters without weight are left out."""
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
