"""A matrix of rational functions with shared poles and residues of low rank, fitted to a measured
matrix.

    G(s) = sum_r C_r B_r^T / (s - p_r) + conjugates (+ D),    C_r (n_y, rank), B_r (n_u, rank)

minimises sum_k || C_k^-1/2 (G_k - G(j omega_k)) gamma_k^-1/2 ||_F^2. On line k, C_k (n_y, n_y) and
gamma_k (n_u, n_u) are the covariance of the scatter of G at its outputs and at its inputs. The
error of the class of models is added to it as in `robust.models.fit.class_error`. All entries of a
machine share its poles, and a mode has one shape: residues have rank one, and n poles make n
states, not n n_u. The start is vector fitting with poles shared by all entries and residues cut to
their rank. Then follows Levenberg-Marquardt on p, C and B, with least-norm steps, because C_r/a and
a B_r are the same model (Gustavsen & Semlyen 1999; Pintelon & Schoukens, 2nd ed., 9).
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import TypedDict

import control
import numpy as np
from scipy.linalg import block_diag

from nlfrf import Bla
from nlfrf._base.values import value
from robust.lti.realisation import order_roots
from robust.models.fit.class_error import balance, loop_tolerance
from robust.models.fit.rational import (
    partial_fractions,
    relocated_poles,
    stack_real_imaginary,
    starting_poles,
)

_N_RELOCATIONS, _N_STEPS = 15, 60
_MIN_POLE_DISTANCE = 1e-6  # damping below which a starting pole is moved off the axis
_CONVERGED = 1e-12
_MIN_EIGENVALUE_RATIO = 1e-3  # least eigenvalue of a covariance over its largest one


@value(copy=False)
class SharedPoles:
    """Poles with their residues as products."""

    # (n,) complex poles in the upper half plane, each with its conjugate, and real ones
    poles: np.ndarray
    # left, right: (n, n_y, rank) or (n, n_u, rank) complex residue r is left[r] right[r]^T; real
    # for a real pole
    left: np.ndarray
    right: np.ndarray
    direct: np.ndarray  # (n_y, n_u) D

    def response(self, omega: np.ndarray) -> np.ndarray:
        """Return (F, n_y, n_u) at omega [rad/s]."""
        up, down = self.pole_fractions(omega)
        residues = self.left @ np.swapaxes(self.right, 1, 2)
        both = np.einsum("fr,rij->fij", up, residues) + np.einsum(
            "fr,rij->fij", down, residues.conj()
        )
        return both + self.direct

    def pole_fractions(self, omega: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return (F, n) 1/(s - p), and 1/(s - p*) which is zero for a real pole."""
        s = 1j * omega[:, None]
        return 1 / (s - self.poles), np.where(
            self.poles.imag == 0, 0.0, 1 / (s - self.poles.conj())
        )

    @property
    def n_parameters(self) -> int:
        """Return the number of free real parameters (C/a and a B are the same model)."""
        n_y, rank = self.left.shape[1:]
        each = 1 + rank * (n_y + self.right.shape[1]) - rank**2
        real = self.poles.imag == 0
        return int(np.sum(np.where(real, 1, 2) * each)) + int(np.count_nonzero(self.direct))

    def state_space(self) -> control.StateSpace:
        """Return the real modal form: one block for each pole or pair, `rank` times."""
        A, B, C = [], [], []
        for p, c, b in zip(self.poles, self.left, self.right, strict=True):
            for k in range(c.shape[1]):
                if p.imag == 0:
                    A.append(np.array([[p.real]]))
                    B.append(b[:, k].real[None])
                    C.append(c[:, k].real[:, None])
                else:  # z' = p z + b^T u, y = 2 Re(c z)
                    A.append(np.array([[p.real, -p.imag], [p.imag, p.real]]))
                    B.append(np.stack([b[:, k].real, b[:, k].imag]))
                    C.append(2 * np.stack([c[:, k].real, -c[:, k].imag], axis=1))
        if not A:
            return control.StateSpace([], [], [], self.direct, 0)
        return control.StateSpace(block_diag(*A), np.vstack(B), np.hstack(C), self.direct, 0)


@value(copy=False, kw_only=False)
class ErrorMetric:
    """Weight of the error of a measured matrix: by its scatter, and by the tolerance for the error
    of the class.
    """

    # left, right: (F, n_y, n_y) or (F, n_u, n_u) complex factors for which left E right has
    # independent entries for an error E: scatter has variance one in each
    left: np.ndarray
    right: np.ndarray
    # (F, n_y, n_u) standard deviation of the entries of left E right for an error of the class of
    # size one
    tolerance: np.ndarray
    entry_tolerance: np.ndarray  # (F, n_y, n_u) the same for the entries of E [unit of G]
    epsilon: float = 0.0  # size of the error of the class

    @property
    def total_var(self) -> np.ndarray:
        """Return (F, n_y, n_u) variances of the entries of left E right."""
        return 1 + (self.epsilon * self.tolerance) ** 2

    def whiten(self, E: np.ndarray) -> np.ndarray:
        """Return errors (..., F, n_y, n_u) in units of their standard deviation, real over
        imaginary.
        """
        # one product for each line, left E right = (left kron right^T) vec E: thousands of 2 x 2
        # products are slower
        n = E.shape[-2] * E.shape[-1]
        errors = np.moveaxis(E.reshape(-1, len(self.left), n), 0, -1)  # (F, n, errors)
        scaled = self._factor @ errors / np.sqrt(self.total_var).reshape(-1, n, 1)
        flat = np.moveaxis(scaled, -1, 0).reshape(*E.shape[:-3], -1)
        return np.concatenate([flat.real, flat.imag], axis=-1)

    @cached_property
    def _factor(self) -> np.ndarray:
        """(F, n_y n_u, n_y n_u) left kron right^T."""
        product = np.einsum("fij,flk->fikjl", self.left, self.right)
        n = product.shape[1] * product.shape[2]
        return product.reshape(-1, n, n)

    def entry_std(self) -> np.ndarray:
        """Return (F, n_y, n_u) standard deviation of the error of each entry, given the errors of
        the others.
        """
        rows, columns = (np.swapaxes(np.abs(root) ** 2, 1, 2) for root in (self.left, self.right))
        return np.asarray(1 / np.sqrt(rows @ (1 / self.total_var) @ columns))

    def behind_delays(self, turn: np.ndarray) -> ErrorMetric:
        """Return the metric of errors multiplied by a phase factor (F, n_u) for each input."""
        return replace(self, right=turn.conj()[:, :, None] * self.right)


def error_metric(frms: list[Bla], omega_c: float) -> ErrorMetric:
    """Return the metric of the errors of concatenated measured matrices, for a loop with the
    crossover omega_c.

    The tolerance of an entry is the product of the size of its row and its column (`balance`), over
    |T_c|^2. The scatter in any direction is at least a thirtieth of the largest, and a millionth of
    |G|: a smaller variance is rounding, or one nonlinearity alone, and would dominate the fit.
    """
    parts = []
    for frm in frms:
        gamma = np.moveaxis(frm.cov.gamma, 2, 0)
        size = np.einsum("jik->k", np.abs(frm.G) ** 2) / np.einsum("iik->k", frm.cov.gamma).real
        rounding = (1e-6) ** 2 * size + np.finfo(float).tiny
        parts.append(
            (
                hermitian_power(
                    np.moveaxis(frm.cov.bound, 2, 0),
                    -0.5,
                    share=_MIN_EIGENVALUE_RATIO,
                    least=rounding[:, None],
                ),
                hermitian_power(gamma, -0.5, share=_MIN_EIGENVALUE_RATIO),
            )
        )
    left, right = (np.concatenate(roots) for roots in zip(*parts, strict=True))
    tolerance = loop_tolerance(
        np.concatenate([frm.omega for frm in frms]),
        np.concatenate([frm.G for frm in frms], axis=2),
        omega_c,
    )
    rows, columns = balance(np.moveaxis(tolerance, 2, 0))
    # in directions in which scatter and error of the class are both uncorrelated
    of_rows, forth = np.linalg.eigh(left * rows[:, None] ** 2 @ _conjugate(left))
    of_columns, back = np.linalg.eigh(_conjugate(right) * columns[:, None] ** 2 @ right)
    power = np.maximum(of_rows, 0.0)[:, :, None] * np.maximum(of_columns, 0.0)[:, None]
    return ErrorMetric(
        _conjugate(forth) @ left, right @ back, np.sqrt(power), rows[:, :, None] * columns[:, None]
    )


def _conjugate(X: np.ndarray) -> np.ndarray:
    return np.asarray(np.swapaxes(X, 1, 2).conj())


def hermitian_power(
    X: np.ndarray, power: float, *, share: float = 0.0, least: np.ndarray | float = 0.0
) -> np.ndarray:
    """Return (F, n, n) powers of Hermitian matrices; eigenvalues are at least `share` of the
    largest, and `least`.
    """
    values, vectors = np.linalg.eigh(X)
    values = np.maximum(values, np.maximum(share * values[:, -1:], least))
    return np.asarray(vectors * values[:, None] ** power @ np.swapaxes(vectors, 1, 2).conj())


class FitOptions(TypedDict):
    """Options of a fit with shared poles."""

    n_poles: int
    rank: int
    direct: bool
    stable: bool


def fit_shared_poles(
    omega: np.ndarray,
    G: np.ndarray,
    *,
    metric: ErrorMetric,
    n_poles: int,
    rank: int,
    direct: bool,
    stable: bool,
) -> SharedPoles:
    """Return the best fit from two sets of starting poles."""
    kind: FitOptions = {"n_poles": n_poles, "rank": rank, "direct": direct, "stable": stable}
    fits = []
    for spacing in ("log", "linear"):
        start = fit_by_vector_fitting(omega, G, metric=metric, **kind, spacing=spacing)
        fits.append(
            refine_shared_poles(omega, G, metric=metric, model=start, direct=direct, stable=stable)
        )
    return min(fits, key=lambda found: found[1])[0]


def fit_by_vector_fitting(
    omega: np.ndarray,
    G: np.ndarray,
    *,
    metric: ErrorMetric,
    n_poles: int,
    rank: int,
    direct: bool,
    stable: bool,
    spacing: str = "log",
) -> SharedPoles:
    """Fit by vector fitting alone, from poles of one spacing: the start of `fit_shared_poles`."""
    std = metric.entry_std()
    std = np.maximum(std, 1e-3 * std.min(axis=0))
    poles = _relocate_shared_poles(
        omega,
        G,
        std=std,
        poles=starting_poles(n_poles, omega.min(), omega.max(), spacing=spacing),
        direct=direct,
        stable=stable,
    )
    return _residues_of_rank(omega, G, std=std, poles=poles, rank=rank, direct=direct)


def _relocate_shared_poles(
    omega: np.ndarray,
    G: np.ndarray,
    *,
    std: np.ndarray,
    poles: np.ndarray,
    direct: bool,
    stable: bool,
) -> np.ndarray:
    """Return poles shared by all entries, by vector fitting; the own unknowns of each entry are
    projected off first.
    """
    s, n = 1j * omega, poles.size
    if not n:
        return poles
    best, least = poles, np.inf
    for _ in range(_N_RELOCATIONS):
        basis = partial_fractions(s, poles)
        if direct:
            own = np.hstack([basis, np.ones((s.size, 1))])
        else:
            own = basis
        rows, aims, cost = [], [], 0.0
        for j, i in np.ndindex(G.shape[1:]):
            weight = 1 / std[:, j, i]
            Q, _ = np.linalg.qr(stack_real_imaginary(own * weight[:, None]))
            A = stack_real_imaginary(-G[:, j, i, None] * basis * weight[:, None])
            b = stack_real_imaginary(G[:, j, i] * weight)
            rest = b - Q @ (Q.T @ b)
            rows.append(A - Q @ (Q.T @ A))
            aims.append(rest)
            cost += float(rest @ rest)
        if cost < least:
            best, least = poles, cost
        # with the sign of `relocated_poles`: sum c/(s - p) - (sum d/(s - p)) G = G
        solution = np.linalg.lstsq(np.vstack(rows), np.concatenate(aims), rcond=None)[0]
        moved = relocated_poles(poles, solution)
        if stable:
            moved = np.where(moved.real > 0, -moved.conj(), moved)
        moved = np.where(
            np.abs(moved.real) < _MIN_POLE_DISTANCE * np.abs(moved),
            moved - _MIN_POLE_DISTANCE * np.abs(moved),
            moved,
        )
        poles = order_roots(moved)
    return best


def _residues_of_rank(
    omega: np.ndarray, G: np.ndarray, *, std: np.ndarray, poles: np.ndarray, rank: int, direct: bool
) -> SharedPoles:
    """Return residues over given poles, each cut to its largest singular values (the rank)."""
    s = 1j * omega
    if poles.size:
        basis = partial_fractions(s, poles)
    else:
        basis = np.zeros((s.size, 0))
    if direct:
        own = np.hstack([basis, np.ones((s.size, 1))])
    else:
        own = basis
    n_y, n_u = G.shape[1:]
    solution = np.zeros((own.shape[1], n_y, n_u))
    for j, i in np.ndindex(n_y, n_u):
        weight = 1 / std[:, j, i]
        A = stack_real_imaginary(own * weight[:, None])
        scale = np.maximum(np.linalg.norm(A, axis=0), np.finfo(float).tiny)
        solution[:, j, i] = (
            np.linalg.lstsq(A / scale, stack_real_imaginary(G[:, j, i] * weight), rcond=None)[0]
            / scale
        )
    kept, left, right = [], [], []
    rank, k = min(rank, n_y, n_u), 0
    while k < poles.size:
        pair = poles[k].imag != 0
        if pair:
            residue = solution[k] + 1j * solution[k + 1]
        else:
            residue = solution[k].astype(complex)
        U, sizes, Vh = np.linalg.svd(residue)
        root = np.sqrt(sizes[:rank])
        kept.append(poles[k] if poles[k].imag >= 0 else poles[k].conj())
        left.append(U[:, :rank] * root)
        right.append(Vh[:rank].T * root)
        k += 2 if pair else 1
    shape = (len(kept), -1, rank)
    if direct:
        D = solution[-1]
    else:
        D = np.zeros((n_y, n_u))
    return SharedPoles(
        poles=np.array(kept, dtype=complex),
        left=np.array(left).reshape(shape) if kept else np.zeros((0, n_y, rank), complex),
        right=np.array(right).reshape(shape) if kept else np.zeros((0, n_u, rank), complex),
        direct=D,
    )


def refine_shared_poles(
    omega: np.ndarray,
    G: np.ndarray,
    *,
    metric: ErrorMetric,
    model: SharedPoles,
    direct: bool,
    stable: bool,
) -> tuple[SharedPoles, float]:
    """Refine poles, residues and D by Levenberg-Marquardt; a stable pole has the log of its real
    part as parameter.
    """

    residual = metric.whiten(G - model.response(omega))
    cost, damping = float(residual @ residual), 1e-3
    for _ in range(_N_STEPS):
        J = metric.whiten(response_derivatives(omega, model, direct=direct, stable=stable)).T
        scale = np.maximum(np.linalg.norm(J, axis=0), np.finfo(float).tiny)
        # J has far more rows than columns: the triangle of [J residual] has its singular values,
        # and U' residual
        triangle = np.asarray(np.linalg.qr(np.column_stack([J / scale, residual]), mode="r"))
        U, sizes, Vh = np.linalg.svd(triangle[:, :-1], full_matrices=False)
        along, improved = U.T @ triangle[:, -1], False
        for _ in range(8):
            if sizes.size:
                filtered = sizes / (sizes**2 + damping * sizes[0] ** 2)
            else:
                filtered = sizes
            step = (Vh.T @ (np.where(sizes > 1e-12 * sizes[0], filtered, 0.0) * along)) / scale
            trial = _step_parameters(model, step, direct=direct, stable=stable)
            new = metric.whiten(G - trial.response(omega))
            new_cost = float(new @ new)
            if np.isfinite(new_cost) and new_cost < cost:
                improved = True
                break
            damping *= 10
        if not improved:
            break
        done = cost - new_cost < _CONVERGED * cost
        model, residual, cost, damping = trial, new, new_cost, max(damping / 30, 1e-15)
        if done:
            break
    return model, cost


def response_derivatives(
    omega: np.ndarray, model: SharedPoles, *, direct: bool, stable: bool
) -> np.ndarray:
    """Return (n_parameters, F, n_y, n_u) derivatives of the response by the parameters of
    `_step_parameters`.
    """
    up, down = model.pole_fractions(omega)
    out = []
    for r, p in enumerate(model.poles):
        c, b = model.left[r], model.right[r]
        R, real = c @ b.T, p.imag == 0
        first, second = up[:, r, None, None], down[:, r, None, None]

        def both(X: np.ndarray, a: np.ndarray, z: np.ndarray, real: bool) -> list[np.ndarray]:
            """Return derivatives by real and imaginary part of a number that multiplies X, and its
            conjugate.
            """
            if real:
                return [a * X + z * X.conj()]
            return [a * X + z * X.conj(), 1j * (a * X - z * X.conj())]

        by_pole = both(R, first**2, second**2, real)
        by_pole[0] = by_pole[0] * (p.real if stable else 1.0)  # p = -exp(alpha) + j beta
        out += by_pole
        for k in range(c.shape[1]):
            for j in range(c.shape[0]):
                out += both(np.outer(np.eye(c.shape[0])[j], b[:, k]), first, second, real)
            for i in range(b.shape[0]):
                out += both(np.outer(c[:, k], np.eye(b.shape[0])[i]), first, second, real)
    if direct:
        n_y, n_u = model.direct.shape
        out += [
            np.broadcast_to(np.outer(a, b), (omega.size, n_y, n_u))
            for a in np.eye(n_y)
            for b in np.eye(n_u)
        ]
    return np.array(out, dtype=complex).reshape(len(out), omega.size, *model.direct.shape)


def _step_parameters(
    model: SharedPoles, step: np.ndarray, *, direct: bool, stable: bool
) -> SharedPoles:
    poles, left, right, at = model.poles.copy(), model.left.copy(), model.right.copy(), 0

    def take(real: bool) -> complex:
        nonlocal at
        at += 1 if real else 2
        if real:
            return complex(step[at - 1])
        return complex(step[at - 2], step[at - 1])

    for r, p in enumerate(poles):
        real = p.imag == 0
        change = take(real)
        if stable:
            there = p.real * np.exp(np.clip(change.real, -1, 1))
        else:
            there = p.real + change.real
        poles[r] = complex(there, abs(p.imag + change.imag) if not real else 0.0)
        for k in range(left.shape[2]):
            for j in range(left.shape[1]):
                left[r, j, k] += take(real)
            for i in range(right.shape[1]):
                right[r, i, k] += take(real)
    if direct:
        D = model.direct + step[at:].reshape(model.direct.shape)
    else:
        D = model.direct
    return SharedPoles(poles=poles, left=left, right=right, direct=D)
