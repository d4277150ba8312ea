"""The dissipation inequality of a Maxwell-slip friction, in states that come to rest where the
machine does.

The friction f is filtered by fh_j' = a_j (f - fh_j). With d = f - fh_1 as input, xi the state of
the loop (`robust.friction.loop`), xi_e its equilibrium under f = 1, and states

    z = (y, e_j),   y = xi - fh_1 xi_e,   e_j = fh_j - fh_1 (j >= 2)
    y' = F y + (B - a_1 xi_e) d,   e_j' = -a_j e_j + (a_j - a_1) d,   jump: J on y

the class guarantees, with a quadratic form Supply,  d/dt [sum S_i - s (fh_1 x - fh_1^2 x_e/2)] <=
Supply(z, d), where

    Supply = mu_0 (d v - a_1 d y_x) + sum_j mu_j [d v - (1 - 1/rho) a_1 d y_x - e_j v/rho -
    (a_j/(rho K0)) (d - e_j)^2]

and s = mu_0 + (1 - 1/rho) sum_j mu_j. x and v are displacement and velocity at the port, x_e and
y_x the displacements that belong to xi_e and y. S_i is the storage function of element i, rho the
stiction, and mu the weights of `multipliers`. In these states all equilibria of the loop are zero;
in xi they form a line, on which no inequality can be strict.

With friction at several ports p everything is summed over them: y = xi - sum_p fh_p xi_p, and with
X_pq the displacement at port p at rest under f_q = 1 the term s (fh_1 x - fh_1^2 x_e/2) becomes
sum_p s_p fh_p y_p + 1/2 sum_pq fh_p s_p X_pq fh_q. It is the integral of sum_p s_p fh_p v_p only
where s_p X_pq is symmetric.
"""

from __future__ import annotations

import numpy as np

from robust.friction.loop import FrictionLoop
from robust.friction.proof.storage import Dissipation

#: rho = 1 is replaced by this, a larger class: at rho = 1 the stored energy is not strictly
#: positive. With integral action K0 (rho - 1) < k + K_p limits the proof; 1.001 left a PID of 200
#: N/m undecided from K0 = 1e5 N/m on.
ROUNDED_UP = 1 + 1e-6


def maxwell_slip_dissipation(
    loop: FrictionLoop,
    rates: np.ndarray,
    *,
    mu: np.ndarray,
    K0: float | np.ndarray,
    rho: float | np.ndarray,
) -> Dissipation:
    """Return the inequality for a loop with weights mu = (mu_0, mu_1, ...); filters of zero weight
    are left out.

    With P friction ports mu is (P, 1 + J), and K0 and rho are (P,).
    """
    n, n_ports = loop.columns.shape
    ports = list(
        zip(
            np.atleast_2d(mu),
            np.broadcast_to(K0, n_ports),
            np.broadcast_to(rho, n_ports),
            strict=True,
        )
    )
    used = [np.concatenate([[True], own[2:] > 0]) for own, _, _ in ports]
    starts = n + np.concatenate([[0], np.cumsum([chosen.sum() - 1 for chosen in used])])
    size = int(starts[-1])
    rest, offset = (part.reshape(n, n_ports) for part in loop.rest())
    jumps = np.zeros((loop.jumps.shape[0], size, size))
    jumps[:, :n, :n] = loop.jumps
    jumps[:, n:, n:] = np.eye(size - n)
    A = np.zeros((size, size))
    Q = np.zeros((size, size))
    stored = np.zeros((size + 2 * n_ports, size + 2 * n_ports))
    A[:n, :n] = loop.F
    B = np.zeros((size, n_ports))
    N = np.zeros((size, n_ports))
    B_error = np.zeros((size, n_ports))
    R = []
    shares = np.zeros(n_ports)  # s of each port
    for port, (own, stiffness, stiction) in enumerate(ports):
        ratio, e = max(float(stiction), ROUNDED_UP), slice(starts[port], starts[port + 1])
        a = rates[used[port]]
        weight = np.where(own[1:] > 0, own[1:], 0.0)[used[port]]
        free = float(own[0])
        x, v = (np.pad(row[port], (0, size - n)) for row in (loop.displacements, loop.velocities))
        total, lost = float(weight.sum()), weight * a / (ratio * stiffness)
        shares[port] = free + (1 - 1 / ratio) * total
        A[e, e] = -np.diag(a[1:])
        B[:n, port], B[e, port] = loop.columns[:, port] - a[0] * rest[:, port], a[1:] - a[0]
        B_error[:n, port] = a[0] * offset[:, port]
        N[:, port] = (free + total) / 2 * v - shares[port] * a[0] / 2 * x
        N[e, port] += lost[1:]
        slips = np.outer(weight[1:] / (2 * ratio), v)
        Q[e] -= slips
        Q[:, e] -= slips.T
        Q[e, e] -= np.diag(lost[1:])
        R.append(-lost.sum())
        h, F = size + 2 * port, size + 2 * port + 1
        held = weight[1:] / (2 * stiffness * ratio)
        stored[:size, h] = stored[h, :size] = -shares[port] / 2 * x
        stored[h, h] = total / (ratio * 2 * stiffness)
        stored[F, F] = (free + total) / (2 * stiffness)
        stored[h, F] = stored[F, h] = -total / (ratio * 2 * stiffness)
        stored[e, e] += np.diag(held)
        for column, signed in ((h, held), (F, -held)):
            stored[e, column] += signed
            stored[column, e] += signed
    at_rest = np.arange(size, size + 2 * n_ports, 2)
    moved = shares[:, np.newaxis] * (loop.displacements @ rest)
    stored[np.ix_(at_rest, at_rest)] -= (moved + moved.T) / 4
    unsure = shares[:, np.newaxis] / 2 * (np.abs(loop.displacements) @ offset)
    stored_error = np.zeros_like(stored)
    stored_error[np.ix_(at_rest, at_rest)] = (unsure + unsure.T) / 2
    return Dissipation(
        A=A,
        B=B,
        spans=loop.spans,
        jumps=jumps,
        Q=Q,
        N=N,
        R=np.diag(R),
        stored=stored,
        B_error=B_error,
        stored_error=stored_error,
    )
