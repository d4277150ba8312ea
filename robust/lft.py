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

import numbers
from typing import Any

import control
import numpy as np
from scipy.linalg import eig, matrix_balance
from scipy.sparse.csgraph import connected_components

from nlfrf.checks import shown
from robust.lti import complete, evaluate, on_axis, state_space, timebase
from robust.norms import EPS


def multivariable(name: str, system: Any) -> control.StateSpace:
    """The system as a state space with any number of inputs and outputs, or a refusal."""
    if isinstance(system, (numbers.Real, list, tuple, np.ndarray)) and not isinstance(system, bool):
        gain = np.atleast_2d(np.asarray(system, dtype=float))
        system = control.StateSpace([], [], [], gain, None)
    if isinstance(system, control.TransferFunction) and (system.ninputs, system.noutputs) == (1, 1):
        named = system
        system = state_space(name, system)
        system = control.StateSpace(
            system.A, system.B, system.C, system.D, system.dt, inputs=named.input_labels, outputs=named.output_labels
        )
    if not isinstance(system, control.StateSpace):
        cure = (
            " Build it from single transfer functions (control.append, control.interconnect)."
            if isinstance(system, control.TransferFunction)
            else ""
        )
        raise ValueError(f"{name} must be a control.StateSpace, got {shown(system)}.{cure}")
    return complete(name, system)


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


def along(N: control.StateSpace, omega: np.ndarray) -> np.ndarray:
    """(n_out, n_in, W) response."""
    return np.moveaxis(evaluate(N.A, N.B, N.C, N.D, on_axis(omega, timebase(N))), 0, 2)


def certain_poles(system: control.StateSpace) -> tuple[np.ndarray, np.ndarray]:
    """Poles, hidden modes included, and how far rounding may have moved each.

    States that no path leads back to (a weight outside the loop) are looked at apart: their poles are exact.
    """
    n_parts, part = connected_components(system.A != 0, connection="strong") if system.nstates else (0, np.zeros(0))
    poles, moved = [np.zeros(0, complex)], [np.zeros(0)]
    for k in range(n_parts):
        A = matrix_balance(system.A[np.ix_(part == k, part == k)], permute=False)[0]
        found, left, right = eig(A, left=True, right=True)
        cosine = np.abs(np.einsum("ij,ij->j", left.conj(), right))
        poles.append(found)
        alone = A.shape[0] == 1
        moved.append(0.0 * cosine if alone else 100 * EPS * np.linalg.norm(A) / np.maximum(cosine, np.sqrt(EPS)))
    return np.concatenate(poles), np.concatenate(moved)


def instability(system: control.StateSpace) -> str:
    """Empty where every pole is stable beyond rounding, else what is wrong."""
    poles, moved = certain_poles(system)
    excess = np.abs(poles) - 1 if timebase(system) else poles.real
    if not poles.size or np.all(excess < -moved):
        return ""
    worst = int(np.argmax(excess + moved))
    if excess[worst] > moved[worst]:
        return f"unstable: a pole at {poles[worst]:.4g}"
    return f"undecided: a pole at {poles[worst]:.4g} cannot be told from the stability boundary"
