"""Matrix weights W, stable and minimum phase, with W W* above a Hermitian matrix at every
frequency.

W W* = Z + Z* with Z = M_0 + sum_k M_k/(s - p_k) is linear in the real M_k. So the smallest W_l W_l*
and W_r* W_r that cover every matrix follow from one convex program. The factor W follows from a
Riccati equation (the positive-real lemma; Anderson & Vongpanitlerd, Network Analysis and Synthesis,
1973). W_l contains the size of the uncertainty: W_l = w V, with a scalar weight w = prod (s - z)/(s
- p) fitted to the trace of W_l W_l*, and V of size near one with its poles at the zeros z.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import control
import numpy as np
from scipy.linalg import block_diag, solve_continuous_are

from robust.lti.lti import divide_right, response_by_channel
from robust.lti.norms import to_discrete
from robust.lti.realisation import order_roots
from robust.models.fit.rational import partial_fractions
from robust.models.fit.weights import WeightOrderError, fit_weight
from robust.proofs.search.programs import SOLVERS, solve_program

if TYPE_CHECKING:
    import cvxpy

_BAND_MARGIN = 3.0  # factor outside the band within which a pole may lie
# least relative distance between poles, so that their fractions differ; closer ones are moved
_POLE_SPACING = 0.1
# share of the largest gain at a line above which a matrix is a constraint of the fit
_ACTIVE_SHARE = 0.5
_LIFT = 1e-9
#: Steps of SCS where CLARABEL fails, as for matrices of rank one: the set is lifted over every
#: plant in any case. With 300, 1000 and 3000 steps the weights of one such family came to 1.013,
#: 1.003 and 1.010 of the smallest.
_SPECTRUM_STEPS = 1000
_RAISED = (
    1e-3,
    3e-3,
    0.01,
    0.03,
    0.1,
)  # of the trace, added in every direction so that W has an inverse
_MIN_DIRECT = 1e-12  # smallest over largest gain of W at infinite frequency: its inverse is proper


def fit_matrix_weights(
    omega: np.ndarray, E: np.ndarray, *, L: np.ndarray, R: np.ndarray, order: int, dt: float
) -> tuple[control.StateSpace, control.StateSpace]:
    """Fit stable minimum-phase W_l and W_r so that W_l Delta W_r covers every E, as little above L
    and R as possible.

    Parameters
    ----------
    omega : (W,) ndarray
        Lines [rad/s].
    E : (M, W, n, m) complex ndarray
        The matrices to be covered at every line, with Delta of gain at most one.
    L, R : (W, n, n), (W, m, m) complex ndarray
        The smallest W_l W_l* and W_r* W_r that cover E: the unit of the mean traces.
    order : int
        Poles of every entry; W_l and W_r have n and m times as many states.
    dt : float
        Sampling time [s]; 0 is continuous.

    Returns
    -------
    W_l, W_r : control.StateSpace

    Raises
    ------
    WeightOrderError
        No such weights of this order were found.

    Examples
    --------
    >>> omega = np.logspace(-2, 2, 30)
    >>> w = 0.1 * (1 + 1j * omega) / (1 + 0.1j * omega)
    >>> E = w[None, :, None, None] * np.array([[2.0, 1.0], [1.0, 2.0]])
    >>> L, R = np.abs(w)[:, None, None] * np.abs(E[0]), np.broadcast_to([[2.0, 1.0], [1.0, 2.0]], (30, 2, 2))
    >>> W_l, W_r = fit_matrix_weights(omega, E, L=L, R=R, order=1, dt=0)
    >>> W = response_by_channel(W_l, omega)
    >>> np.allclose(np.einsum("ijw,kjw->wik", W, W.conj()), L, rtol=0.02)
    True
    """
    if dt:
        x = np.tan(np.minimum(omega * dt / 2, np.pi / 2 * (1 - 1e-6)))
    else:
        x = np.asarray(omega)
    unit = float(np.sqrt(x[0] * x[-1]))
    x = x / unit
    w = fit_weight(x, np.sqrt(np.einsum("wii->w", L).real), order=order).W
    zeros = _space_roots(_clip_roots(w.zeros(), x), np.zeros(0))
    poles = _space_roots(_clip_roots(w.poles(), x), zeros)
    s = 1j * x[:, None]
    size = np.prod(np.abs((s - zeros) / (s - poles)), axis=1) ** 2
    traces = np.einsum("wii->w", L).real / size, np.einsum("wii->w", R).real
    gains = largest_gains(E, L, R)
    active = gains > _ACTIVE_SHARE * gains.max(axis=0)
    found = _fit_spectra(
        x, E / np.sqrt(size)[:, None, None], active, poles=(zeros, poles), traces=traces
    )
    factors = (
        _exchange_poles(_spectral_factor(zeros, found[0]), zeros, poles),
        _spectral_factor(poles, found[1]),
    )
    sides = []
    for W in factors:
        matrices = (W.A * unit, W.B * unit, W.C, W.D)
        sides.append(
            control.StateSpace(
                *(to_discrete(*matrices) if dt else matrices), dt, remove_useless_states=False
            )
        )
    W_l, V_r = sides  # W_r is the transpose of V_r: V V* covers the conjugate of R
    W_r = control.StateSpace(V_r.A.T, V_r.C.T, V_r.B.T, V_r.D.T, dt, remove_useless_states=False)
    left, right = (np.moveaxis(response_by_channel(W, omega), 2, 0) for W in (W_l, W_r))
    Delta = np.linalg.solve(left, divide_right(E, right))
    lift = float(np.linalg.norm(Delta, 2, (2, 3)).max()) * (1 + _LIFT)
    return (
        control.StateSpace(
            W_l.A, W_l.B, W_l.C * lift, W_l.D * lift, dt, remove_useless_states=False
        ),
        W_r,
    )


def largest_gains(E: np.ndarray, L: np.ndarray, R: np.ndarray) -> np.ndarray:
    """Return (...) gains of W_l^-1 E W_r^-1, with positive definite L and R."""
    # W_l, and W_r*, because R = W_r* W_r
    left = np.linalg.cholesky(L)
    right = np.linalg.cholesky(R)
    Delta = divide_right(np.linalg.solve(left, E), np.swapaxes(right.conj(), -1, -2))
    return np.asarray(np.linalg.norm(Delta, 2, (-2, -1)))


def _clip_roots(roots: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return the roots clipped to the neighbourhood of the band; beyond it no line constrains the
    weight.
    """
    size = np.abs(roots)
    return roots * np.clip(size, x[0] / _BAND_MARGIN, x[-1] * _BAND_MARGIN) / size


def _space_roots(roots: np.ndarray, taken: np.ndarray) -> np.ndarray:
    """Return distinct roots, different from the taken ones too: real ones first, pairs adjacent."""
    roots = order_roots(roots)
    upper = roots[roots.imag >= 0]
    for k in range(upper.size):
        others = np.concatenate([taken, upper[:k]])
        while np.any(np.abs(upper[k] - others) < 0.99 * _POLE_SPACING * np.abs(upper[k])):
            upper[k] *= 1 + _POLE_SPACING
    return order_roots(np.concatenate([upper, upper[upper.imag > 0].conj()]))


class _SpectrumVariable:
    """Z + Z* at lines, at zero, at infinity and between lines, in that order; linear in the real
    unknowns M_k.
    """

    def __init__(self, x: np.ndarray, poles: np.ndarray, n: int) -> None:
        import cvxpy as cp

        s = 1j * np.concatenate([x, [0.0], np.sqrt(x[1:] * x[:-1])])
        fractions = partial_fractions(s, poles)
        self.largest = np.concatenate([[1.0], np.abs(fractions).max(axis=0)])
        basis = np.column_stack([np.ones(s.size), fractions])
        basis = np.insert(basis, x.size + 1, np.eye(1, poles.size + 1), axis=0) / self.largest
        self.n, self.basis, self.M = n, basis, cp.Variable((poles.size + 1, n * n))

    def at(self, k: int) -> tuple[cvxpy.Expression, cvxpy.Expression]:
        """Return real and imaginary part (n, n) at a point."""
        import cvxpy as cp

        flip = np.arange(self.n**2).reshape(self.n, self.n).T.ravel()
        Z, Y = self.basis[k].real @ self.M, self.basis[k].imag @ self.M
        real, imaginary = (
            cp.reshape(part, (self.n, self.n), order="C") for part in (Z + Z[flip], Y - Y[flip])
        )
        return real, imaginary

    @property
    def value(self) -> np.ndarray | None:
        """Return the M_k (1 + n_poles, n, n) of the solution, or None."""
        if self.M.value is None or not np.isfinite(self.M.value).all():
            return None
        return np.asarray(self.M.value / self.largest[:, None]).reshape(-1, self.n, self.n)


def _fit_spectra(
    x: np.ndarray,
    E: np.ndarray,
    active: np.ndarray,
    *,
    poles: tuple[np.ndarray, np.ndarray],
    traces: tuple[np.ndarray, np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """Return the M_k of both spectra, over E (M, W, n, m) where active (M, W), also at zero and
    infinite frequency.
    """
    import cvxpy as cp

    n, m = E.shape[2:]
    sides = [_SpectrumVariable(x, roots, size) for roots, size in zip(poles, (n, m), strict=True)]
    constraints, cost = [], 0
    for k in range(2 * x.size + 1):
        (L, L_j), (R, R_j) = (side.at(k) for side in sides)
        # zero takes the first line, infinity the last
        if k == x.size:
            line = 0
        else:
            line = min(k, x.size - 1)
        if k < x.size:
            cost += cp.trace(L) / traces[0][k] + cp.trace(R) / traces[1][k]
        if k > x.size + 1:
            constraints += [cp.bmat([[X, -Y], [Y, X]]) >> 0 for X, Y in ((L, L_j), (R, R_j))]
            continue
        for one in E[active[:, line], line]:  # the conjugate for the right side
            real = cp.bmat([[R, one.real.T], [one.real, L]])
            imaginary = cp.bmat([[-R_j, -one.imag.T], [one.imag, L_j]])
            constraints.append(cp.bmat([[real, -imaginary], [imaginary, real]]) >> 0)
    problem = cp.Problem(cp.Minimize(cost / x.size), constraints)
    for solver in SOLVERS:
        solve_program(problem, solver, steps=_SPECTRUM_STEPS)
        found = [side.value for side in sides]
        if found[0] is not None and found[1] is not None:
            return found[0], found[1]
    raise WeightOrderError(
        f"order must allow a weight that covers the matrices, got none with {poles[0].size} poles"
    )


def _spectral_factor(poles: np.ndarray, M: np.ndarray) -> control.StateSpace:
    """Return W, stable and minimum phase, with W W* = Z + Z*, Z = M_0 + sum over the fractions of
    the poles.
    """
    n = M.shape[1]
    A, B = _fraction_states(poles, n)
    C = np.hstack([np.zeros((n, 0)), *M[1:]])
    for share in _RAISED:
        direct = M[0] + M[0].T + share * 2 * np.trace(M[0]) / n * np.eye(n)
        values, vectors = np.linalg.eigh(direct)
        if values[0] <= _MIN_DIRECT * values[-1]:
            continue
        root = (vectors * np.sqrt(values)) @ vectors.T
        if not poles.size:
            return control.StateSpace(A, B, C, root)
        try:
            X = solve_continuous_are(A.T, C.T, np.zeros_like(A), -direct, s=-B)
        except (np.linalg.LinAlgError, ValueError):
            continue
        return control.StateSpace(
            A, (B - X @ C.T) @ np.linalg.inv(root), C, root, remove_useless_states=False
        )
    raise WeightOrderError(
        f"order must allow a weight that covers the matrices, got none with {poles.size} poles"
    )


def _fraction_states(poles: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return A and B whose states are the `partial_fractions` of the poles, each of n inputs."""
    sections = [
        [[p.real, p.imag], [-p.imag, p.real]] if p.imag else [[p.real]]
        for p in poles[poles.imag >= 0]
    ]
    inputs = np.concatenate(
        [np.zeros(0), *([2.0, 0.0] if p.imag else [1.0] for p in poles[poles.imag >= 0])]
    )
    if sections:
        A = block_diag(*sections)
    else:
        A = np.zeros((0, 0))
    return np.kron(A, np.eye(n)), np.kron(inputs[:, None], np.eye(n))


def _exchange_poles(
    V: control.StateSpace, zeros: np.ndarray, poles: np.ndarray
) -> control.StateSpace:
    """Return V prod (s - z)/(s - p) for a V whose poles are the zeros z: by its residues at the
    poles p.
    """
    n = V.noutputs
    A, B = _fraction_states(poles, n)
    C = [np.zeros((n, 0))]
    for p in poles[poles.imag >= 0]:
        others = poles[poles != p]
        residue = (
            np.prod(p - zeros)
            / np.prod(p - others)
            * (V.C @ np.linalg.solve(p * np.eye(V.nstates) - V.A, V.B) + V.D)
        )
        C += [residue.real, residue.imag] if p.imag else [residue.real]
    return control.StateSpace(A, B, np.hstack(C), V.D, remove_useless_states=False)
