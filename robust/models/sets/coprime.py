"""Normalised coprime factors of a plant, and the plants with perturbed factors.

G = N M^-1, both stable, N~ N + M~ M = 1 on the axis. For one input and output let [M~; -N~], made
stable by an all-pass, be the complement of [N; M]. A plant whose factors differ by at most eps < 1
at a frequency is at this frequency

    G_p = (G + t Delta)/(1 - G* t Delta),     t = eps/sqrt(1 - eps^2),  |Delta| <= 1,

the plants within a chordal distance |G_p - G|/sqrt((1 + |G|^2)(1 + |G_p|^2)) of eps (Vinnicombe).
"""

from __future__ import annotations

import control
import numpy as np
from scipy.linalg import solve_continuous_lyapunov

from robust.lti.lti import (
    Matrices,
    balance_matrix,
    evaluate_transfer,
    is_constant,
    is_stable,
    replace_infinite,
    response,
    timebase,
)
from robust.lti.norms import continuous_image, hinf_norm, stabilising_riccati, to_discrete
from robust.lti.realisation import state_space
from robust.lti.truncation import gramian_root

# Hankel singular value over the largest one, below which a mode is removed
_HIDDEN_MODE_RATIO = 1e-14
# largest chordal distance between the plant and the quotient of its factors
_FACTOR_TOLERANCE = 1e-8


def invertible_scaling(
    name: str,
    W: control.StateSpace | control.TransferFunction,
    nominal: control.StateSpace | control.FrequencyResponseData,
) -> control.StateSpace:
    """Return a scaling of the plant, stable with a stable inverse, on the time base of the plant;
    or refuse it.
    """
    W = state_space(name, 1.0 if W is None else W)
    if (
        not is_constant(W)
        and not isinstance(nominal, control.FrequencyResponseData)
        and timebase(W) != timebase(nominal)
    ):
        raise ValueError(
            f"{name} must have the sampling time of the nominal, {timebase(nominal):g} s, got"
            f" {timebase(W):g} s"
        )
    d = W.D[0, 0]
    if d == 0:
        inverse = None
    else:
        inverse = control.StateSpace(W.A - W.B @ W.C / d, W.B / d, W.C / d, [[1 / d]], W.dt)
    if inverse is None or not is_stable(W) or not is_stable(inverse):
        raise ValueError(
            f"{name} must be stable with a stable inverse and a direct term, got {W.nstates} states"
            f" and D = {d:g}. For an integrator take (s + a)/(s + b) with b small"
        )
    return W


def require_below_one(weight: control.StateSpace) -> None:
    """Refuse a weight that reaches one: such a set contains every plant."""
    largest, where = hinf_norm(weight)
    if largest >= 1:
        raise ValueError(
            f"weight must stay below one for the coprime form, got {largest:.4g} at {where:.4g}"
            " rad/s. Another scaling W1, W2, a smaller radius or a higher order may help"
        )


def chord(radius: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Return (W,) the smallest eps that covers a disc about G, |G| = size: its point nearest to
    zero is the farthest.

    >>> float(chord(np.array([0.5]), np.array([1.0]))[0])              # from 1 to 1/2: 0.5/sqrt(2 * 1.25)
    0.31622776601683794
    """
    return np.asarray(radius / np.sqrt((1 + size**2) * (1 + (size - radius) ** 2)))


def tangent(w: np.ndarray) -> np.ndarray:
    """Return (W,) t = w/sqrt(1 - |w|^2), with the phase of w."""
    return np.asarray(w / np.sqrt(np.maximum(1 - np.abs(w) ** 2, 1e-300)))


def coprime_factors(name: str, G: control.StateSpace) -> tuple[Matrices, np.ndarray]:
    """Return [N; M] as matrices in continuous time (a discrete plant by the bilinear map), and
    their Gramian X.

    For several inputs and outputs G = N M^-1; transpose the factors of the transposed plant for
    left factors.
    """
    A, B, C, D = _scaled_continuous_plant(G)
    R = np.eye(G.ninputs) + D.T @ D
    X = stabilising_riccati(A, B, Q=C.T @ C, R=R, S=C.T @ D)
    if X is None:
        raise ValueError(
            f"{name} must be stabilisable and detectable, got a plant whose Riccati equation has no"
            " solution"
        )
    F = -np.linalg.solve(R, D.T @ C + B.T @ X)
    values, vectors = np.linalg.eigh(R)
    root = vectors / np.sqrt(values) @ vectors.T
    return (A + B @ F, B @ root, np.vstack([C + D @ F, F]), np.vstack([D @ root, root])), X


def _scaled_continuous_plant(G: control.StateSpace) -> Matrices:
    return _scale_states(continuous_image(G) if G.nstates else (G.A, G.B, G.C, G.D))


def _scale_states(matrices: Matrices) -> Matrices:
    """Scale the states of a system, because the Riccati equation of a companion form may be
    ill-conditioned.
    """
    A, B, C, D = matrices
    if not A.size:
        return matrices
    weights = balance_matrix(_bordered_matrix(A, B, C))[
        1
    ]  # an entry at rounding level does not reflect the size of its state
    units = weights[: len(A)] / weights[-1]
    A, B, C = A * units / units[:, None], B / units[:, None], C * units
    if B.any() and C.any():
        size = np.sqrt(np.linalg.norm(C) / np.linalg.norm(B))
    else:
        size = 1.0
    return A, B * size, C / size, D


def _bordered_matrix(A: np.ndarray, B: np.ndarray, C: np.ndarray) -> np.ndarray:
    """Return [A b; c 0], with the norms of the rows of B in b and of the columns of C in c."""
    b, c = np.linalg.norm(B, axis=1, keepdims=True), np.linalg.norm(C, axis=0, keepdims=True)
    return np.block([[A, b], [c, np.zeros((1, 1))]])


def factor_systems(G: control.StateSpace) -> tuple[control.StateSpace, control.StateSpace]:
    """Return N and M as systems on the time base of the plant."""
    (A, B, C, D), _ = coprime_factors("nominal", G)
    dt = timebase(G)
    each = ((A, B, C[[k]], D[[k]]) for k in (0, 1))
    N, M = (control.StateSpace(*(to_discrete(*one) if dt and len(A) else one), dt) for one in each)
    return N, M


def _factors_with_complement(G: control.StateSpace) -> tuple[Matrices, np.ndarray, np.ndarray]:
    """Return [N; M], and B, D of its complement, which has the same A and C: both columns together
    are all-pass.

    The states have X = 1 as Gramian, so the conditions are A + A' + C'C = 0 and B = -C'D, without
    the inverse of X. They hold to the last bit; the remaining rounding affects N/M only, which is
    compared with the plant.
    """
    factors, X = coprime_factors("nominal", G)
    A, C = _output_normal_form(factors, X)
    D = np.array([[factors[3][0, 0], factors[3][1, 0]], [factors[3][1, 0], -factors[3][0, 0]]])
    A, B = (A - A.T - C.T @ C) / 2, -C.T @ D
    made = (A, B[:, :1], C, D[:, :1])
    _require_exact_factors(G, made, np.linalg.eigvals(factors[0]))
    return made, B[:, 1:], D[:, 1:]


def _output_normal_form(factors: Matrices, X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return A and C of the factors in states with unit Gramian, from balanced states without
    hidden modes.
    """
    A, B, C, _ = factors
    if not A.size:
        return A, C
    reached, seen = gramian_root(solve_continuous_lyapunov(A, -B @ B.T)), gramian_root(X)
    U, sizes, V = np.linalg.svd(seen.T @ reached)
    kept = int(np.sum(sizes > _HIDDEN_MODE_RATIO * sizes.max(initial=0.0)))
    forth, back = U[:, :kept].T @ seen.T, reached @ V[:kept].T / sizes[:kept]
    return forth @ A @ back, C @ back


def _require_exact_factors(G: control.StateSpace, factors: Matrices, poles: np.ndarray) -> None:
    """Require factors whose quotient is the plant; others give plants outside the set."""
    if not poles.size:
        return
    fast, slow = np.abs(poles).max(), max(np.abs(poles).min(), 1e-12 * np.abs(poles).max())
    x = np.geomspace(1e-2 * slow, 1e2 * fast, 200)
    plant = replace_infinite(evaluate_transfer(*_scaled_continuous_plant(G), 1j * x)[:, 0, 0])
    N, M = np.moveaxis(evaluate_transfer(*factors, 1j * x)[:, :, 0], 0, 1)
    off = float(np.max(np.abs(N - plant * M) / np.hypot(1, np.abs(plant))))
    if not off <= _FACTOR_TOLERANCE:
        raise ValueError(
            "nominal must have coprime factors that can be computed accurately, got factors"
            f" with an error of {off:.2g}. Other units or fewer states may help"
        )


def plant_of_perturbed_factors(G: control.StateSpace, X: control.StateSpace) -> control.StateSpace:
    """Return the plant with the factors of G plus X times their complement, for a stable X."""
    (A, B, C, D), B_across, D_across = _factors_with_complement(G)
    if X.nstates:
        A_X, B_X, C_X, D_X = continuous_image(X)
    else:
        A_X, B_X, C_X, D_X = X.A, X.B, X.C, X.D
    n, m = len(A), len(A_X)
    A = np.block([[A, B_across @ C_X], [np.zeros((m, n)), A_X]])
    B = np.vstack([B + B_across @ D_X, B_X])
    C, D = np.hstack([C, D_across @ C_X]), D + D_across @ D_X
    d = D[1, 0]
    if abs(d) < 1e-9:
        raise ValueError(
            "form must leave the perturbed plant proper, got a factor M of zero at infinite"
            " frequency"
        )
    A, B, C, D = A - B @ C[1:] / d, B / d, C[:1] - D[:1] @ C[1:] / d, D[:1] / d
    dt = timebase(G)
    return control.StateSpace(*(to_discrete(A, B, C, D) if dt and len(A) else (A, B, C, D)), dt)


def tangent_system(w: control.StateSpace) -> control.StateSpace:
    """Return a stable system with the gain |w|/sqrt(1 - |w|^2): w over the spectral factor of 1 -
    |w|^2.
    """
    dt = timebase(w)
    A, B, C, D = _scale_states(continuous_image(w) if w.nstates else (w.A, w.B, w.C, w.D))
    # 1 - |w|^2 = |V|^2 with V = (A, B, gain, root), from the same equation with R = D'D - 1, which
    # is negative
    if D[0, 0] ** 2 < 1:
        Y = stabilising_riccati(A, B, Q=C.T @ C, R=D.T @ D - 1, S=C.T @ D)
    else:
        Y = None
    if Y is None:
        raise ValueError(
            "weight must stay below one at all frequencies to make plants of the set, got a"
            " weight that reaches one"
        )
    root = np.sqrt(1 - D.T @ D)
    gain, back = -(B.T @ Y + D.T @ C) / root, 1 / root
    A, B, C, D = A - B @ gain * back, B * back, C - D @ gain * back, D * back
    return control.StateSpace(*(to_discrete(A, B, C, D) if dt and len(A) else (A, B, C, D)), dt)


def coprime_phase_offset(G: control.StateSpace, w: control.StateSpace, omega: float) -> complex:
    """Return the phase factor of Delta between `plant_of_perturbed_factors` with `tangent_system`
    and the formula.
    """
    (A, B, C, D), B_across, D_across = _factors_with_complement(G)
    dt = timebase(G)
    if dt:
        s = 1j * np.tan(omega * dt / 2)
    else:
        s = 1j * omega
    if len(A):
        resolved = np.linalg.solve(s * np.eye(len(A)) - A, np.hstack([B, B_across]))
    else:
        resolved = np.zeros((0, 2))
    both = C @ resolved + np.hstack([D, D_across])
    at = np.array([omega])
    inside = both[0, 1] / both[1, 0] * response(tangent_system(w), at)[0]
    outside = tangent(response(w, at))[0]
    if outside:
        return complex(inside / outside)
    return 1.0 + 0j
