"""The closed loop as one state space, and the worst case over a disc in closed form.

                p_in            p_out
                 |                |
r --->(+)-- e -->[ K ]-- u -->(+)-->[ G ]-->(+)---+--> y
      -^                                          |
       +------------------------------------------+

u = K (r - y),  L = G K,  S = 1/(1 + L),  T = 1 - S
"""

from __future__ import annotations

import control
import numpy as np

from robust.systems.lti import Matrices

__all__ = ["closed_loop", "factor_allowed", "worst_perturbation", "worst_sensitivity"]


INPUTS = {"p_in": 0, "p_out": 1, "r": 2}
OUTPUTS = {"u": 0, "y": 1, "e": 2}


def closed_loop(
    G: control.StateSpace, K: control.StateSpace, outputs: tuple[str, ...], inputs: tuple[str, ...]
) -> Matrices:
    """State space from the named inputs to the named outputs of the loop drawn above.

    Raises
    ------
    ValueError
        A loop without a solution: direct terms with 1 + D_G D_K = 0.
    """
    D, Dk = G.D[0, 0], K.D[0, 0]
    if abs(1 + D * Dk) < 1e-12 * max(1.0, abs(D * Dk)):
        raise ValueError("K must leave the loop well posed, got 1 + K G = 0 at infinite frequency")
    k = 1 / (1 + D * Dk)
    n, m = G.nstates, K.nstates
    # u = k (Ck xk + Dk (r - C x - D p_in - p_out)), everything else follows from u
    u_x, u_w = np.hstack([-k * Dk * G.C, k * K.C]), k * Dk * np.array([[-D, -1.0, 1.0]])
    y_x, y_w = D * u_x + np.hstack([G.C, np.zeros((1, m))]), D * u_w + np.array([[D, 1.0, 0.0]])
    e_x, e_w = -y_x, np.array([[0.0, 0.0, 1.0]]) - y_w
    A = np.block([[G.A, np.zeros((n, m))], [np.zeros((m, n)), K.A]])
    A = A + np.vstack([G.B @ u_x, K.B @ e_x])
    B = np.vstack([G.B @ (u_w + np.array([[1.0, 0.0, 0.0]])), K.B @ e_w])
    C, W = np.vstack([u_x, y_x, e_x]), np.vstack([u_w, y_w, e_w])
    rows, cols = [OUTPUTS[o] for o in outputs], [INPUTS[i] for i in inputs]
    return A, B[:, cols], C[rows], W[np.ix_(rows, cols)]


def worst_sensitivity(S: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """max |S_p| over |Delta| <= 1: |S| (|1 - a b*| + |a - b|)/(1 - |b|^2), inf where |b| >= 1.

    The image of the disc under a bilinear map is a disc with centre (1 - a b*)/(1 - |b|^2) and radius
    |a - b|/(1 - |b|^2).

    >>> worst_sensitivity(np.array([0.5]), np.array([0.0]), np.array([0.5j])).tolist()   # |S|/(1 - |w T|)
    [1.0]
    """
    size = np.abs(b)
    with np.errstate(all="ignore"):
        out = np.abs(S) * (np.abs(1 - a * b.conj()) + np.abs(a - b)) / (1 - size**2)
    return np.where(size < 1, out, np.inf)


def worst_perturbation(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The Delta of modulus one that reaches `worst_sensitivity`."""
    centre, edge = 1 - a * b.conj(), a - b
    direction = np.where(np.abs(edge) > 0, edge, 1.0)
    # Delta = exp(j psi): (1 + a D)/(1 + b D) = [centre + edge (D + b*)/(1 + b D)]/(1 - |b|^2); the last fraction is
    # a point of the unit circle, wanted in line with the centre
    target = np.exp(1j * (np.angle(centre) - np.angle(direction)))
    return (target - b.conj()) / (1 - b * target)


def factor_allowed(nominal: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(W,) largest x with nominal (|1 - x^2 a b*| + x |a - b|)/(1 - x^2 |b|^2) <= 1, by bisection (increasing in x)."""
    low, high = np.zeros(nominal.size), 1 / np.maximum(np.abs(b), 1e-12)
    for _ in range(60):
        x = (low + high) / 2
        with np.errstate(all="ignore"):
            value = nominal * (np.abs(1 - x**2 * a * b.conj()) + x * np.abs(a - b)) / (1 - x**2 * np.abs(b) ** 2)
        good = (value <= 1) & (x * np.abs(b) < 1)
        low, high = np.where(good, x, low), np.where(good, high, x)
    return np.maximum(low, 1e-12)
