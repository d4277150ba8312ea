"""The gain of F_l(P, K) in 100 digits, from the responses of P and K: no closed loop is put
together.
"""

from __future__ import annotations

import numpy as np
from flint import acb, acb_mat, arb, ctx

from tests.support.precise_loops import BITS, balls


def response(system, point):
    """C (s - A)^-1 B + D."""
    n = system.nstates
    D = acb_mat(balls(system.D))
    if n == 0:
        return D
    pencil = acb_mat(
        n,
        n,
        [
            (point if i == j else acb(0)) - acb(float(system.A[i, j]))
            for i in range(n)
            for j in range(n)
        ],
    )
    return D + acb_mat(balls(system.C)) * pencil.solve(acb_mat(balls(system.B)))


def lft_gain(P, K, omega):
    """Largest singular value of P11 + P12 K (1 - P22 K)^-1 P21 at omega [rad/s]."""
    dt = float(P.dt or 0)
    with ctx.workprec(BITS):
        point = (acb(0, arb(omega) * arb(dt))).exp() if dt else acb(0, omega)
        p, k = response(P, point).tolist(), response(K, point)
        z, w = P.noutputs - K.ninputs, P.ninputs - K.noutputs
        P11, P12 = (acb_mat([row[cols] for row in p[:z]]) for cols in (slice(w), slice(w, None)))
        P21, P22 = (acb_mat([row[cols] for row in p[z:]]) for cols in (slice(w), slice(w, None)))
        n = K.ninputs
        one = acb_mat(n, n, [int(i == j) for i in range(n) for j in range(n)])
        T = P11 + P12 * k * (one - P22 * k).solve(P21)
        return float(
            np.linalg.svd(
                np.array([[complex(x) for x in row] for row in T.tolist()]), compute_uv=False
            )[0]
        )


def lft_norm(P, K, n=120):
    """The largest gain on a grid that knows every pole of P and of K; and where.

    A lower bound of the norm.
    """
    dt = float(P.dt or 0)
    poles = np.concatenate([np.linalg.eigvals(s.A) for s in (P, K) if s.nstates] or [np.ones(1)])
    speeds = np.abs(np.log(poles[poles != 0].astype(complex)) / dt) if dt else np.abs(poles)
    speeds = speeds[(speeds > 0) & np.isfinite(speeds)]
    top = np.pi / dt if dt else 1e3 * speeds.max(initial=1.0)
    low = max(1e-3 * speeds.min(initial=1.0), 1e-16 * top)
    near = speeds[:, None] * (1 + np.array([-0.1, -0.01, 0.0, 0.01, 0.1]))
    omega = np.concatenate([np.geomspace(low, top, n), near.ravel()])
    omega = omega[omega <= top]
    gains = np.array([lft_gain(P, K, float(at)) for at in omega])
    for _ in range(3):  # once more around the largest
        best = omega[gains.argmax()]
        step = np.sort(np.abs(omega / best - 1))[1:3].max(initial=1e-3)
        more = best * (1 + np.linspace(-step, step, 15))
        more = more[more <= top]
        omega = np.concatenate([omega, more])
        gains = np.concatenate([gains, [lft_gain(P, K, float(at)) for at in more]])
    return float(gains.max()), float(omega[gains.argmax()])
