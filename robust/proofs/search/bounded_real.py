"""Proofs that a norm bound holds at every frequency: bounded-real certificates, judged apart from the solver.

A solver's status is never the verdict. Whatever cvxpy returns is a candidate matrix P; the bounded-real inequality
is put together again in numpy with a bound on its rounding, and its eigenvalues decide. It serves systems with several
inputs and outputs; one loop is proved in exact arithmetic (`robust.proofs.exact`).
"""

from __future__ import annotations

import control
import numpy as np
from scipy.linalg import solve_continuous_are

from nlfrf._base.arguments import require_positive, short_form
from robust._base.states import Outcome
from robust._base.types import LinearSystem
from robust.lti.lti import Matrices, scale_states, timebase
from robust.lti.norms import EPS, hinf_norm, to_continuous, to_discrete, well_conditioned
from robust.proofs.exact.claim import to_matrices
from robust.proofs.exact.matrices import NormClaim
from robust.proofs.search.certificate import TIME_CAP, Certificate, failed_certificate, solve_program

__all__ = ["certify_norm"]


LARGEST_KYP = 32
SLACK = 3e-6  # above what the change of coordinates may be off


def certify_norm(
    system: LinearSystem,
    level: float = 1.0,
    *,
    solver: str = "CLARABEL",
    subject: str = "norm",
    time_cap: float = TIME_CAP,
) -> Certificate:
    """Prove by the bounded-real lemma that a system is stable with H-infinity norm below a level.

    P > 0 with [A'P + PA + C'C, PB + C'D; B'P + D'C, D'D - level^2 I] < 0 (in discrete time its counterpart). The
    solver proposes P, its status is not looked at; both inequalities are judged in numpy, strictly, by more than
    the rounding in putting them together.

    Parameters
    ----------
    system : control.StateSpace or TransferFunction
        Continuous or discrete; several inputs and outputs are fine.
    level : float
        Level to hold the norm under.
    solver : str
        "CLARABEL" or "SCS".
    subject : str
        What to call it.
    time_cap : float
        Seconds the solver may take.

    Returns
    -------
    Certificate
        One that does not hold says why. Nothing a solver does raises.

    Raises
    ------
    ValueError
        A level that is not positive, a solver that is none of the two.

    References
    ----------
    Boyd, El Ghaoui, Feron & Balakrishnan 1994, 2.7.3.

    Examples
    --------
    >>> lag = control.tf([2], [1, 1])
    >>> certify_norm(lag, 2.002).holds, certify_norm(lag, 1.998).holds
    (True, False)
    """
    level = require_positive("level", level)
    if isinstance(system, control.TransferFunction):
        system = control.ss(system)
    if not isinstance(system, control.StateSpace):
        raise ValueError(f"system must be a control.StateSpace or TransferFunction, got {short_form(system)}")
    dt, n = timebase(system), system.nstates
    everywhere = np.array([[0.0, np.pi / dt if dt else np.inf]])

    def proved(method: str) -> Certificate:
        return Certificate(
            subject=subject,
            outcome=Outcome.HOLDS,
            level=level,
            method=method,
            intervals=everywhere,
            reason="",
            claim=NormClaim(system=to_matrices(system), level=level),
        )

    inner = level * (1 - SLACK)
    A, B, C, D = system.A, system.B / np.sqrt(inner), system.C / np.sqrt(inner), system.D / inner
    if not all(np.isfinite(m).all() for m in (A, B, C, D)):
        return failed_certificate(subject, level, "the system has coefficients that are not finite")
    if not n:
        gain = np.linalg.norm(D, 2)
        return (
            proved("KYP")
            if gain < 1 - 10 * EPS
            else failed_certificate(subject, level, f"the gain is {gain * level:.6g}")
        )
    A, B, C = scale_states(A, B, C)  # by powers of two, which is exact
    if n > LARGEST_KYP:
        return failed_certificate(
            subject, level, f"{n} states are too many for a linear matrix inequality (at most {LARGEST_KYP})"
        )
    p = np.linalg.eigvals(A)
    if np.any(np.abs(p) >= 1) if dt else np.any(p.real >= 0):
        return failed_certificate(subject, level, "the system is not stable")
    method, reason = prove_inequality((A, B, C, D), bool(dt), solver=solver, time_cap=time_cap)
    return proved(method) if method else failed_certificate(subject, level, reason)


def prove_inequality(matrices: Matrices, discrete: bool, *, solver: str, time_cap: float) -> tuple[str, str]:
    """Return the method that proves the norm of a stable system below one, or why none does."""
    image = well_conditioned(to_continuous(*matrices) if discrete else matrices)
    there = change_coordinates(image, preconditioning_coordinates(image))
    reasons = []
    for method, proposal in (("KYP", solve_kyp), ("KYP, P from a Riccati equation", None)):
        X, trouble = (np.eye(len(there[0])), "") if proposal is None else proposal(there, solver, time_cap)
        if X is None:
            reasons.append(trouble)
            continue
        # judged in the coordinates of the proposal: there rounding is smallest
        failure = judge_inequality(*(to_discrete(*there) if discrete else there), (X + X.T) / 2, discrete=discrete)
        if not failure:
            return method, ""
        reasons.append(f"{method}: {failure}")
    return "", "; ".join(reasons)


def change_coordinates(matrices: Matrices, T: np.ndarray) -> Matrices:
    """Return the system in the coordinates T x."""
    A, B, C, D = matrices
    back = np.linalg.inv(T)
    return T @ A @ back, T @ B, C @ back, D


def preconditioning_coordinates(matrices: Matrices) -> np.ndarray:
    """Coordinates in which the identity is already close to a solution: T'T solves the Riccati equation nearby.

    With poles over many decades the inequality is hopeless for a solver in the coordinates of the model.
    """
    A, B, C, D = matrices
    n, m = B.shape
    norm = hinf_norm(control.StateSpace(A, B, C, D, 0))[0]
    level = np.sqrt(norm) if 0 < norm < 1 else 1.0
    size = np.linalg.norm(C) ** 2 / n + 1e-12
    for small in (1e-2, 1e-4, 1e-6, 1e-9):
        R = D.T @ D - level**2 * np.eye(m)
        try:
            P = solve_continuous_are(A, B, C.T @ C + small * size * np.eye(n), R, s=C.T @ D)
            T = np.linalg.cholesky((P + P.T) / 2).T
        except (np.linalg.LinAlgError, ValueError):
            continue
        if np.isfinite(T).all() and np.linalg.cond(T) < 1e12:
            return T
    return np.eye(n)


def solve_kyp(matrices: Matrices, solver: str, time_cap: float) -> tuple[np.ndarray | None, str]:
    """X from cvxpy for the inequality with the largest margin, or None and what went wrong."""
    import cvxpy as cp

    A, B, C, D = matrices
    n, m = B.shape
    X, t = cp.Variable((n, n), symmetric=True), cp.Variable()
    cross = X @ B + C.T @ D
    M = cp.bmat([[A.T @ X + X @ A + C.T @ C, cross], [cross.T, D.T @ D - np.eye(m)]])
    scale = np.diag(1 / np.sqrt(np.concatenate([np.maximum(np.linalg.norm(A, axis=0), 1e-6), np.ones(m)])))
    constraints = [scale @ M @ scale << -t * np.eye(n + m), X >> 1e-6 * np.eye(n), t <= 1]
    problem = cp.Problem(cp.Maximize(t), constraints)
    failed = solve_program(problem, solver, time_cap)
    if failed:
        return None, failed
    if X.value is None or np.shape(X.value) != (n, n) or not np.isfinite(X.value).all():
        return None, f"the solver {solver} gave no matrix ({problem.status})"
    return np.asarray(X.value, dtype=float), ""


def judge_inequality(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray, P: np.ndarray, *, discrete: bool
) -> str:
    """Empty if P > 0 and the bounded-real inequality at level one hold by more than rounding, else what fails."""
    n, m = B.shape
    a, b, c, d, p = (np.abs(matrix) for matrix in (A, B, C, D, P))
    if discrete:
        M = np.block([[A.T @ P @ A - P + C.T @ C, A.T @ P @ B + C.T @ D], [np.zeros((m, n)), B.T @ P @ B + D.T @ D]])
        size = np.block([[a.T @ p @ a + p + c.T @ c, a.T @ p @ b + c.T @ d], [np.zeros((m, n)), b.T @ p @ b + d.T @ d]])
    else:
        M = np.block([[A.T @ P + P @ A + C.T @ C, P @ B + C.T @ D], [np.zeros((m, n)), D.T @ D]])
        size = np.block([[a.T @ p + p @ a + c.T @ c, p @ b + c.T @ d], [np.zeros((m, n)), d.T @ d]])
    M[n:, n:] -= np.eye(m)
    size[n:, n:] += np.eye(m)
    M[n:, :n], size[n:, :n] = M[:n, n:].T, size[:n, n:].T
    for name, matrix, error in (("P > 0", -P, EPS * p), ("the inequality", M, 4 * (n + m + 2) * EPS * size)):
        diagonal = -np.diag(matrix)
        if np.any(diagonal <= 0) or not np.isfinite(matrix).all():
            return f"{name} does not hold"
        root = np.sqrt(np.outer(diagonal, diagonal))
        largest = np.linalg.eigvalsh(matrix / root)[-1]
        slack = np.linalg.norm(error / root) + 10 * (n + m) * EPS
        if not largest < -slack:
            return f"{name} does not hold: its largest eigenvalue is {largest:.2g}, rounding is {slack:.2g}"
    return ""
