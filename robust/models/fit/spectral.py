"""Weights that are matrices: W stable and minimum phase with W W* over a Hermitian matrix at every frequency.

A scalar weight w = k prod (s - z)/(s - p) follows the trace. What is left, V V* >= L / |w|^2, is near one in size and
has its poles at the zeros z, so that w V has the poles p alone. V V* = Z + Z*, Z = M_0 + sum_k M_k/(s - z_k), is linear
in the real M_k: the smallest one over the matrices is a convex program. Its factor V follows from one Riccati equation
(the positive-real lemma; Anderson & Vongpanitlerd, Network Analysis and Synthesis, 1973).
"""

from __future__ import annotations

import control
import numpy as np
from scipy.linalg import block_diag, solve_continuous_are

from robust.lti.lti import response_by_channel
from robust.lti.norms import to_discrete
from robust.lti.realisation import order_roots
from robust.models.fit.rational import partial_fractions
from robust.models.fit.weights import WeightOrderError, fit_weight
from robust.proofs.search.certificate import SOLVERS, solve_program

POLE_SPACING = 1e-3  # relative distance that equal poles are moved apart, for their fractions to differ
BETWEEN_LINES = 0.5  # of the mean of its neighbours that W W* keeps halfway between lines: it has no dip to zero there
LIFT = 1e-9
RAISED = (0.0, 3e-3, 0.01, 0.03, 0.1)  # share of the trace at infinity that is added where W W* dips to zero
MIN_DIRECT = 1e-12  # smallest over largest gain of W at infinite frequency: its inverse is proper


def fit_matrix_weight(omega: np.ndarray, L: np.ndarray, *, order: int, dt: float) -> control.StateSpace:
    """Fit a stable minimum-phase W (n, n) with W W* >= L at every line, of least mean tr W W* / tr L.

    Parameters
    ----------
    omega : (W,) ndarray
        Lines [rad/s].
    L : (W, n, n) complex ndarray
        Hermitian, positive definite.
    order : int
        Poles of every entry; W has n times as many states.
    dt : float
        Sampling time [s]; 0 is continuous.

    Returns
    -------
    control.StateSpace

    Raises
    ------
    WeightOrderError
        No such weight of this order was found.

    Examples
    --------
    >>> omega = np.logspace(-2, 2, 30)
    >>> w = 0.1 * (1 + 1j * omega) / (1 + 0.1j * omega)
    >>> L = np.abs(w[:, None, None]) ** 2 * np.array([[2.0, 1.0], [1.0, 2.0]])
    >>> W = response_by_channel(fit_matrix_weight(omega, L, order=1, dt=0), omega)
    >>> np.allclose(np.einsum("ijw,kjw->wik", W, W.conj()), L, rtol=1e-3)
    True
    """
    x = np.tan(np.minimum(omega * dt / 2, np.pi / 2 * (1 - 1e-6))) if dt else np.asarray(omega)
    unit = float(np.sqrt(x[0] * x[-1]))
    x = x / unit
    w = fit_weight(x, np.sqrt(np.einsum("wii->w", L).real), order=order).W
    zeros = spaced(w.zeros(), np.zeros(0))
    poles = spaced(w.poles(), zeros)
    size = np.prod(np.abs((1j * x[:, None] - zeros) / (1j * x[:, None] - poles)), axis=1) ** 2
    V = spectral_factor(zeros, fit_spectrum(x, L / size[:, None, None], zeros))
    W = exchange_poles(V, zeros, poles)
    matrices = (W.A * unit, W.B * unit, W.C, W.D)
    found = control.StateSpace(*(to_discrete(*matrices) if dt else matrices), dt, remove_useless_states=False)
    over = np.linalg.solve(np.moveaxis(response_by_channel(found, omega), 2, 0), np.linalg.cholesky(L))
    lift = float(np.linalg.norm(over, 2, (1, 2)).max()) * (1 + LIFT)
    return control.StateSpace(found.A, found.B, found.C * lift, found.D * lift, dt, remove_useless_states=False)


def spaced(roots: np.ndarray, taken: np.ndarray) -> np.ndarray:
    """Return roots of which no two are equal, nor one of those taken: real ones first, pairs adjacent."""
    roots = order_roots(roots)
    upper = roots[roots.imag >= 0]
    for k in range(upper.size):
        others = np.concatenate([taken, upper[:k]])
        while np.any(np.abs(upper[k] - others) < POLE_SPACING / 2 * np.abs(upper[k])):
            upper[k] *= 1 + POLE_SPACING
    return order_roots(np.concatenate([upper, upper[upper.imag > 0].conj()]))


def fit_spectrum(x: np.ndarray, L: np.ndarray, poles: np.ndarray) -> np.ndarray:
    """Return M (1 + n_poles, n, n) of the least Z + Z* over L (W, n, n), also at zero and infinite frequency."""
    import cvxpy as cp

    size, n = np.einsum("wii->w", L).real, L.shape[1]
    middle = BETWEEN_LINES * (L[1:] + L[:-1]) / 2
    wanted = np.concatenate([L, middle, L[:1].real, L[-1:].real])
    s = 1j * np.concatenate([x, np.sqrt(x[1:] * x[:-1]), [0.0]])
    fractions = np.vstack([partial_fractions(s, poles), np.zeros((1, poles.size))])
    largest = np.concatenate([[1.0], np.abs(fractions).max(axis=0)])
    basis = np.column_stack([np.ones(s.size + 1), fractions]) / largest
    V = cp.Variable((poles.size + 1, n * n))
    flip = np.arange(n * n).reshape(n, n).T.ravel()
    constraints, means = [], []
    for row, least in zip(basis, wanted, strict=True):
        Z, Y = row.real @ V, row.imag @ V
        even, odd = (cp.reshape(part, (n, n), order="C") for part in (Z + Z[flip], Y - Y[flip]))
        constraints.append(cp.bmat([[even - least.real, least.imag - odd], [odd - least.imag, even - least.real]]) >> 0)
        means.append(cp.trace(even))
    problem = cp.Problem(cp.Minimize((1 / size) @ cp.hstack(means[: x.size]) / x.size), constraints)
    for solver in SOLVERS:
        solve_program(problem, solver)
        if V.value is not None and np.isfinite(V.value).all():
            break
    else:
        raise WeightOrderError(f"order must leave a weight over the matrices, got none with {poles.size} poles")
    return (np.asarray(V.value) / largest[:, None]).reshape(-1, n, n)


def spectral_factor(poles: np.ndarray, M: np.ndarray) -> control.StateSpace:
    """Return W, stable and minimum phase, with W W* = Z + Z*, Z = M_0 + sum over the fractions of the poles."""
    n = M.shape[1]
    A, B = fraction_states(poles, n)
    C = np.hstack([np.zeros((n, 0)), *M[1:]])
    for share in RAISED:
        direct = M[0] + M[0].T + share * np.trace(M[0]) * np.eye(n)
        values, vectors = np.linalg.eigh(direct)
        if values[0] <= MIN_DIRECT * values[-1]:
            continue
        root = (vectors * np.sqrt(values)) @ vectors.T
        if not poles.size:
            return control.StateSpace(A, B, C, root)
        try:
            X = solve_continuous_are(A.T, C.T, np.zeros_like(A), -direct, s=-B)
        except (np.linalg.LinAlgError, ValueError):
            continue
        return control.StateSpace(A, (B - X @ C.T) @ np.linalg.inv(root), C, root, remove_useless_states=False)
    raise WeightOrderError(f"order must leave a weight over the matrices, got no factor with {poles.size} poles")


def fraction_states(poles: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return A and B whose states are the `partial_fractions` of the poles, each of n inputs."""
    sections = [[[p.real, p.imag], [-p.imag, p.real]] if p.imag else [[p.real]] for p in poles[poles.imag >= 0]]
    inputs = np.concatenate([np.zeros(0), *([2.0, 0.0] if p.imag else [1.0] for p in poles[poles.imag >= 0])])
    A = block_diag(*sections) if sections else np.zeros((0, 0))
    return np.kron(A, np.eye(n)), np.kron(inputs[:, None], np.eye(n))


def exchange_poles(V: control.StateSpace, zeros: np.ndarray, poles: np.ndarray) -> control.StateSpace:
    """Return V prod (s - z)/(s - p) for a V whose poles are the zeros z: by its residues at the poles p."""
    n = V.noutputs
    A, B = fraction_states(poles, n)
    C = [np.zeros((n, 0))]
    for p in poles[poles.imag >= 0]:
        others = poles[poles != p]
        residue = (
            np.prod(p - zeros) / np.prod(p - others) * (V.C @ np.linalg.solve(p * np.eye(V.nstates) - V.A, V.B) + V.D)
        )
        C += [residue.real, residue.imag] if p.imag else [residue.real]
    return control.StateSpace(A, B, np.hstack(C), V.D, remove_useless_states=False)
