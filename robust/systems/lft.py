"""Linear fractional transformations: systems with several inputs and outputs, closed through one another.

          +-----+                          +-------+
     z <--|     |<-- w              +----->| Delta |------+
          |  P  |                   |      +-------+      |
   +-- y--|     |<-- u --+        u_D <--+-----+<-- y_D   |   (the last inputs and outputs of P close with K,
   |      +-----+        |               |  N  |              the first ones of N with Delta)
   +----->[  K  ]--------+          z <--+-----+<-- w

(SP A.7.) Both are closed with positive sign: u = K y. A negative feedback is part of P.
"""

from __future__ import annotations

from collections.abc import Sequence

import control
import numpy as np
from scipy.linalg import block_diag

__all__ = ["joined", "lower", "upper"]


def lower(P: control.StateSpace, K: control.StateSpace) -> control.StateSpace:
    """F_l(P, K): the last inputs and outputs of P closed through K, all states kept.

    Raises
    ------
    ValueError
        A loop without a solution: I - D_K D_22 singular.

    >>> P = control.ss([], [], [], [[1.0, 2.0], [3.0, 0.5]])
    >>> float(lower(P, control.ss([], [], [], [[1.0]])).D[0, 0])      # 1 + 2 (1 - 0.5)^-1 3
    13.0
    """
    n_u, n_y = K.noutputs, K.ninputs
    w, u = np.s_[: P.ninputs - n_u], np.s_[P.ninputs - n_u :]
    z, y = np.s_[: P.noutputs - n_y], np.s_[P.noutputs - n_y :]
    around = np.eye(n_u) - K.D @ P.D[y, u]
    if n_u and np.linalg.svd(around, compute_uv=False)[-1] < 1e-12 * max(1.0, float(np.linalg.norm(around))):
        raise ValueError("K must leave the loop well posed, got I - K P_22 singular at infinite frequency")
    # u = gain [x; xk] + direct w, everything else follows from u
    gain = np.linalg.solve(around, np.hstack([K.D @ P.C[y], K.C]))
    direct = np.linalg.solve(around, K.D @ P.D[y, w])
    n, m = P.nstates, K.nstates
    A = np.block([[P.A, np.zeros((n, m))], [K.B @ P.C[y], K.A]])
    A = A + np.vstack([P.B[:, u], K.B @ P.D[y, u]]) @ gain
    B = np.vstack([P.B[:, w], K.B @ P.D[y, w]]) + np.vstack([P.B[:, u], K.B @ P.D[y, u]]) @ direct
    C = np.hstack([P.C[z], np.zeros((P.C[z].shape[0], m))]) + P.D[z, u] @ gain
    dt = P.dt if P.nstates or not K.nstates else K.dt
    return control.StateSpace(A, B, C, P.D[z, w] + P.D[z, u] @ direct, dt)


def upper(N: control.StateSpace, Delta: control.StateSpace) -> control.StateSpace:
    """F_u(N, Delta): the first inputs and outputs of N closed through Delta, all states kept."""
    k, m = Delta.noutputs, Delta.ninputs
    columns = np.r_[k : N.ninputs, :k]
    rows = np.r_[m : N.noutputs, :m]
    turned = control.StateSpace(N.A, N.B[:, columns], N.C[rows], N.D[np.ix_(rows, columns)], N.dt)
    return lower(turned, Delta)


def joined(parts: Sequence[control.StateSpace], dt: float) -> control.StateSpace:
    """All parts side by side."""
    A, B, C, D = (block_diag(*(getattr(part, name) for part in parts)) for name in "ABCD")
    n, n_in, n_out = (sum(sizes) for sizes in zip(*((p.nstates, p.ninputs, p.noutputs) for p in parts), strict=True))
    return control.StateSpace(A.reshape(n, n), B.reshape(n, n_in), C.reshape(n_out, n), D.reshape(n_out, n_in), dt)
