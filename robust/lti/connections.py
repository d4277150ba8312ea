"""Connections of systems: in series, in parallel, in a loop."""

from __future__ import annotations

from collections.abc import Sequence

import control
import numpy as np
from scipy.linalg import block_diag

from robust.lti.lti import Matrices, is_constant


def in_series(*systems: control.StateSpace, dt: float | None = None) -> control.StateSpace:
    """Return the series connection, first system first: the output of each drives the next; all
    states are kept.
    """
    total = systems[0]
    for system in systems[1:]:
        nt, ns = total.nstates, system.nstates
        A = np.block([[total.A, np.zeros((nt, ns))], [system.B @ total.C, system.A]])
        B = np.vstack([total.B, system.B @ total.D])
        C = np.hstack([system.D @ total.C, system.C])
        step = total.dt if is_constant(system) or total.dt is not None else system.dt
        total = control.StateSpace(
            A, B, C, system.D @ total.D, system.dt if is_constant(total) else step
        )
    if dt is None:
        return total
    return control.StateSpace(total.A, total.B, total.C, total.D, dt)


def in_parallel(F: control.StateSpace, G: control.StateSpace) -> control.StateSpace:
    """Return F + G."""
    n, m = F.nstates, G.nstates
    A = np.block([[F.A, np.zeros((n, m))], [np.zeros((m, n)), G.A]])
    return control.StateSpace(A, np.vstack([F.B, G.B]), np.hstack([F.C, G.C]), F.D + G.D, F.dt)


def one_plus(X: control.StateSpace) -> control.StateSpace:
    """Return 1 + X."""
    return control.StateSpace(X.A, X.B, X.C, X.D + 1, X.dt)


def biproper_inverse(X: control.StateSpace) -> control.StateSpace:
    """Return 1 / X for a biproper X."""
    d = X.D[0, 0]
    return control.StateSpace(X.A - X.B @ X.C / d, X.B / d, -X.C / d, [[1 / d]], X.dt)


def inverse_system(X: control.StateSpace) -> control.StateSpace:
    """Return `biproper_inverse` of a divisor of a plant, or refuse it."""
    if abs(X.D[0, 0]) < 1e-9:
        raise ValueError(
            "form must leave the perturbed plant proper, got 1 + weight Delta = 0 at infinite"
            " frequency"
        )
    return biproper_inverse(X)


def feedback(G: control.StateSpace, X: control.StateSpace) -> control.StateSpace:
    """Return G / (1 + X G): y = G (u - X y), with the algebraic loop of the direct terms solved."""
    k = 1 / (1 + G.D[0, 0] * X.D[0, 0])
    A = np.block(
        [
            [G.A - k * X.D[0, 0] * G.B @ G.C, -G.B @ X.C * k],
            [k * X.B @ G.C, X.A - k * G.D[0, 0] * X.B @ X.C],
        ]
    )
    B = np.vstack([k * G.B, k * G.D[0, 0] * X.B])
    return control.StateSpace(A, B, np.hstack([k * G.C, -k * G.D[0, 0] * X.C]), k * G.D, G.dt)


# ---- The closed loop as one state space, and the worst case over a disc in closed form.
#
#                 p_in            p_out
#                  |                |
# r --->(+)-- e -->[ K ]-- u -->(+)-->[ G ]-->(+)---+--> y
#       -^                                          |
#        +------------------------------------------+
#
# u = K (r - y),  L = G K,  S = (1 + L)^-1,  T = 1 - S

_INPUTS = ("p_in", "p_out", "r")
_OUTPUTS = ("u", "y", "e")


def closed_loop(
    G: control.StateSpace, K: control.StateSpace, outputs: tuple[str, ...], inputs: tuple[str, ...]
) -> Matrices:
    """Return the state space from the named inputs to the named outputs of the loop drawn above;
    each is a vector.

    A controller of another shape, and a loop without a solution (1 + D_K D_G singular), raise a
    ValueError.
    """
    n_y, n_u = G.noutputs, G.ninputs
    require_shape(K, n_y, n_u)
    D, Dk = G.D, K.D
    return_difference = np.eye(n_u) + Dk @ D
    if np.linalg.norm(return_difference, -2) < 1e-12 * max(1.0, float(np.linalg.norm(Dk @ D, 2))):
        raise ValueError(
            "K must leave the loop well posed, got 1 + K G singular at infinite frequency"
        )
    k = np.linalg.inv(return_difference)
    n, m = G.nstates, K.nstates
    one, none = np.eye(n_y), np.zeros((n_y, n_y))
    # u = k (Ck xk + Dk (r - C x - D p_in - p_out)), and everything else follows from u
    u_x, u_w = np.hstack([-k @ Dk @ G.C, k @ K.C]), k @ Dk @ np.hstack([-D, -one, one])
    y_x, y_w = D @ u_x + np.hstack([G.C, np.zeros((n_y, m))]), D @ u_w + np.hstack([D, one, none])
    e_x, e_w = -y_x, np.hstack([np.zeros((n_y, n_u)), none, one]) - y_w
    A = np.block([[G.A, np.zeros((n, m))], [np.zeros((m, n)), K.A]])
    A = A + np.vstack([G.B @ u_x, K.B @ e_x])
    B = np.vstack([G.B @ (u_w + np.eye(n_u, n_u + 2 * n_y)), K.B @ e_w])
    C, W = np.vstack([u_x, y_x, e_x]), np.vstack([u_w, y_w, e_w])
    rows = _channel_indices(_OUTPUTS, outputs, (n_u, n_y, n_y))
    cols = _channel_indices(_INPUTS, inputs, (n_u, n_y, n_y))
    return A, B[:, cols], C[rows], W[np.ix_(rows, cols)]


def require_shape(K: control.StateSpace, n_y: int, n_u: int) -> None:
    """Refuse a controller that does not fit a plant with n_y outputs and n_u inputs."""
    if (K.ninputs, K.noutputs) != (n_y, n_u):
        raise ValueError(
            f"K must have {n_y} inputs and {n_u} outputs, one for each output and input of the"
            f" plant, got {K.ninputs} and {K.noutputs}"
        )


def _channel_indices(
    names: tuple[str, ...], wanted: tuple[str, ...], sizes: tuple[int, ...]
) -> np.ndarray:
    """Return the places of the channels of the wanted ports in a vector of all channels."""
    first = np.cumsum([0, *sizes])
    return np.concatenate([np.arange(first[k], first[k + 1]) for k in map(names.index, wanted)])


def weighted_plant(
    P: control.StateSpace,
    n_y: int,
    *,
    n_u: int,
    weights: list[tuple[str, control.StateSpace]],
    reference: bool = True,
) -> control.StateSpace:
    """Return the system from (d, r, u) to (z, outputs of the weights on "e", "u" or "y", e).

    The plant P is from (d, u) to (z, y); one without d and z is allowed. e = r - y is the input of
    a controller u = K e; without `reference` r is left out.
    """
    n_d, n_z = P.ninputs - n_u, P.noutputs - n_y
    r = np.eye(n_y)[:, : n_y if reference else 0]
    n_r, n = r.shape[1], P.nstates
    z = np.hstack([P.D[:n_z, :n_d], np.zeros((n_z, n_r)), P.D[:n_z, n_d:]])
    y = np.hstack([P.D[n_z:, :n_d], np.zeros((n_y, n_r)), P.D[n_z:, n_d:]])
    e = np.hstack([-P.D[n_z:, :n_d], r, -P.D[n_z:, n_d:]])
    # inputs of the weights, as functions of x and (d, r, u)
    read = {
        "e": (-P.C[n_z:], e),
        "u": (np.zeros((n_u, n)), np.eye(n_u, n_d + n_r + n_u, n_d + n_r)),
        "y": (P.C[n_z:], y),
    }
    m = n + sum(w.nstates for _, w in weights)
    A, B = np.zeros((m, m)), np.zeros((m, n_d + n_r + n_u))
    A[:n, :n], B[:n] = P.A, np.hstack([P.B[:, :n_d], np.zeros((n, n_r)), P.B[:, n_d:]])
    rows, direct, at = [np.hstack([P.C[:n_z], np.zeros((n_z, m - n))])], [z], n
    for port, w in weights:
        C, D = read[port]
        own = slice(at, at + w.nstates)
        A[own, :n], A[own, own], B[own] = w.B @ C, w.A, w.B @ D
        row = np.zeros((w.noutputs, m))
        row[:, :n], row[:, own] = w.D @ C, w.C
        rows.append(row)
        direct.append(w.D @ D)
        at += w.nstates
    rows.append(np.hstack([-P.C[n_z:], np.zeros((n_y, m - n))]))
    return control.StateSpace(A, B, np.vstack(rows), np.vstack([*direct, e]), P.dt)


def worst_sensitivity(S: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return max |S_p| over |Delta| <= 1: |S| (|1 - a b*| + |a - b|)/(1 - |b|^2), inf for |b| >= 1.

    The image of the disc under a bilinear map is a disc with centre (1 - a b*)/(1 - |b|^2) and
    radius
    |a - b|/(1 - |b|^2).

    >>> worst_sensitivity(np.array([0.5]), np.array([0.0]), np.array([0.5j])).tolist()   # |S|/(1 - |w T|)
    [1.0]
    """
    size = np.abs(b)
    with np.errstate(all="ignore"):
        out = np.abs(S) * (np.abs(1 - a * b.conj()) + np.abs(a - b)) / (1 - size**2)
    return np.where(size < 1, out, np.inf)


def worst_perturbation(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the Delta of modulus one that attains `worst_sensitivity`."""
    centre, edge = 1 - a * b.conj(), a - b
    direction = np.where(np.abs(edge) > 0, edge, 1.0)
    # Delta = exp(j psi): (1 + a D)/(1 + b D) = [centre + edge (D + b*)/(1 + b D)]/(1 - |b|^2). The
    # last fraction is a point of the unit circle, which must be in line with the centre
    target = np.exp(1j * (np.angle(centre) - np.angle(direction)))
    return (target - b.conj()) / (1 - b * target)


def largest_allowed_factor(nominal: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return (W,) the largest x with nominal (|1 - x^2 a b*| + x |a - b|)/(1 - x^2 |b|^2) <= 1, by
    bisection.
    """
    low, high = np.zeros(nominal.size), 1 / np.maximum(np.abs(b), 1e-12)
    for _ in range(60):
        x = (low + high) / 2
        with np.errstate(all="ignore"):
            value = (
                nominal
                * (np.abs(1 - x**2 * a * b.conj()) + x * np.abs(a - b))
                / (1 - x**2 * np.abs(b) ** 2)
            )
        good = (value <= 1) & (x * np.abs(b) < 1)
        low, high = np.where(good, x, low), np.where(good, high, x)
    return np.maximum(low, 1e-12)


# ---- Linear fractional transformations: systems with several inputs and outputs, closed through
# each other.
#
#           +-----+                          +-------+
#      z <--|     |<-- w              +----->| Delta |------+
#           |  P  |                   |      +-------+      |
#    +-- y--|     |<-- u --+        u_D <--+-----+<-- y_D   |   (the last inputs and outputs of P
#    close with K,
#    |      +-----+        |               |  N  |              the first ones of N with Delta)
#    +----->[  K  ]--------+          z <--+-----+<-- w
#
# (SP A.7.) Both are closed with a positive sign: u = K y. A negative feedback is part of P.


def lower_lft(P: control.StateSpace, K: control.StateSpace) -> control.StateSpace:
    """Return F_l(P, K): the last inputs and outputs of P closed through K, with all states.

    A loop without a solution (I - D_K D_22 singular) raises a ValueError.

    >>> P = control.ss([], [], [], [[1.0, 2.0], [3.0, 0.5]])
    >>> float(lower_lft(P, control.ss([], [], [], [[1.0]])).D[0, 0])      # 1 + 2 (1 - 0.5)^-1 3
    13.0
    """
    n_u, n_y = K.noutputs, K.ninputs
    w, u = np.s_[: P.ninputs - n_u], np.s_[P.ninputs - n_u :]
    z, y = np.s_[: P.noutputs - n_y], np.s_[P.noutputs - n_y :]
    return_difference = np.eye(n_u) - K.D @ P.D[y, u]
    if n_u and np.linalg.svd(return_difference, compute_uv=False)[-1] < 1e-12 * max(
        1.0, float(np.linalg.norm(return_difference))
    ):
        raise ValueError(
            "K must leave the loop well posed, got I - K P_22 singular at infinite frequency"
        )
    # u = gain [x; xk] + direct w, and everything else follows from u
    gain = np.linalg.solve(return_difference, np.hstack([K.D @ P.C[y], K.C]))
    direct = np.linalg.solve(return_difference, K.D @ P.D[y, w])
    n, m = P.nstates, K.nstates
    A = np.block([[P.A, np.zeros((n, m))], [K.B @ P.C[y], K.A]])
    A = A + np.vstack([P.B[:, u], K.B @ P.D[y, u]]) @ gain
    B = np.vstack([P.B[:, w], K.B @ P.D[y, w]]) + np.vstack([P.B[:, u], K.B @ P.D[y, u]]) @ direct
    C = np.hstack([P.C[z], np.zeros((P.C[z].shape[0], m))]) + P.D[z, u] @ gain
    dt = P.dt if P.nstates or not K.nstates else K.dt
    return control.StateSpace(A, B, C, P.D[z, w] + P.D[z, u] @ direct, dt)


def upper_lft(N: control.StateSpace, Delta: control.StateSpace) -> control.StateSpace:
    """Return F_u(N, Delta): the first inputs and outputs of N closed by Delta."""
    k, m = Delta.noutputs, Delta.ninputs
    columns = np.r_[k : N.ninputs, :k]
    rows = np.r_[m : N.noutputs, :m]
    turned = control.StateSpace(N.A, N.B[:, columns], N.C[rows], N.D[np.ix_(rows, columns)], N.dt)
    return lower_lft(turned, Delta)


def block_diagonal(parts: Sequence[control.StateSpace], dt: float) -> control.StateSpace:
    """Return all parts side by side, without coupling."""
    A, B, C, D = (block_diag(*(getattr(part, name) for part in parts)) for name in "ABCD")
    n, n_in, n_out = (
        sum(sizes)
        for sizes in zip(*((p.nstates, p.ninputs, p.noutputs) for p in parts), strict=True)
    )
    return control.StateSpace(
        A.reshape(n, n), B.reshape(n, n_in), C.reshape(n_out, n), D.reshape(n_out, n_in), dt
    )
