"""Proofs that a norm bound holds at every frequency: bounded-real certificates, judged apart from the solver.

A solver's status is never the verdict. Whatever cvxpy returns is a candidate matrix P; the bounded-real inequality
is put together again in numpy with a bound on its rounding, and its eigenvalues decide. It serves systems with several
inputs and outputs; one loop is proved in exact arithmetic (`robust.proofs.exact`).
"""

from __future__ import annotations

from dataclasses import replace

import control
import numpy as np
from scipy.linalg import solve_continuous_are

from nlfrf._base.arguments import format_hertz, require_choice, require_positive
from robust._base.states import Outcome
from robust._base.types import LinearSystem
from robust.lti.lti import Matrices, scale_states, timebase
from robust.lti.norms import EPS, hinf_norm, to_continuous, to_discrete, well_conditioned
from robust.lti.realisation import multivariable, rightmost_pole
from robust.proofs.exact.claim import to_matrices
from robust.proofs.exact.closed_loops import (
    ClosedLoopClaim,
    decide_closed_loop,
    norm_of_closed_loop,
    verify_closed_loop,
)
from robust.proofs.exact.matrices import MAX_STATES, NormClaim, decide_norm
from robust.proofs.search.certificate import EXACT, SOLVERS, Certificate, failed_certificate, solve_program

LARGEST_KYP = 32
NORM_ROUNDING = 1e-12  # of a norm in many digits, once it is a double
SLACK = 3e-6  # above what the change of coordinates may be off


def certify_norm(
    system: LinearSystem, level: float = 1.0, *, solver: str = "CLARABEL", subject: str = "norm"
) -> Certificate:
    """Prove by the bounded-real lemma that a system is stable with H-infinity norm below a level.

    P > 0 with [A'P + PA + C'C, PB + C'D; B'P + D'C, D'D - level^2 I] < 0 (in discrete time its counterpart). The
    solver proposes P, its status is not looked at; both inequalities are judged in numpy, strictly, by more than
    the rounding in putting them together. Where that decides nothing (a false level, one within 3e-6 of the norm, more
    than 32 states) exact arithmetic decides.

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

    Returns
    -------
    Certificate
        One that does not hold says why: violated with the norm and its frequency, violated as the system is not stable,
        or undecided. Nothing a solver does raises.

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
    >>> certify_norm(lag, 2.002).holds
    True
    >>> certify_norm(lag, 1.998).outcome, certify_norm(lag, 1.998).reason
    ('violated', 'the norm is 2, at 0 Hz')
    """
    level = require_positive("level", level)
    require_choice("solver", solver, SOLVERS)
    system = multivariable("system", system)
    may_hold = system.nstates <= LARGEST_KYP and hinf_norm(system)[0] < level
    if may_hold and is_proved_by_inequality(system, level, solver):
        return norm_certificate(NormClaim(system=to_matrices(system), level=level), subject, "KYP")
    return certify_exactly(system, level, subject)


def certify_exactly(system: control.StateSpace, level: float, subject: str) -> Certificate:
    """Return `certify_norm` in balls, as of a loop without a controller; at the norm itself in rationals."""
    matrices, nothing = to_matrices(system), to_matrices(control.StateSpace([], [], [], np.zeros((0, 0)), system.dt))
    loop, claim = (
        ClosedLoopClaim(plant=matrices, controller=nothing, level=level),
        NormClaim(system=matrices, level=level),
    )
    proof = replace(norm_certificate(loop, subject, EXACT), again=verify_closed_loop)
    if decide_closed_loop(loop, thorough=False).holds:
        return proof
    norm, peak = norm_of_closed_loop(matrices, nothing)
    if np.isinf(norm):
        reason = f"the system is not stable: a pole at {rightmost_pole(system):.4g}"
        return failed_certificate(subject, level, reason, outcome=Outcome.VIOLATED)
    violated = norm > level * (1 + NORM_ROUNDING)
    if not violated and decide_closed_loop(loop).holds:
        return proof
    if not violated and matrices.order <= MAX_STATES:
        decided = decide_norm(claim)
        if decided["norm"].holds:
            return norm_certificate(claim, subject, EXACT)
        violated = decided["norm"].violated
    if violated:
        reason = f"the norm is {norm:.10g}, at {format_hertz(peak)}"
        return failed_certificate(subject, level, reason, outcome=Outcome.VIOLATED, violated_at=peak)
    return failed_certificate(subject, level, f"the norm could be decided in no arithmetic, {norm:.10g} was computed")


def norm_certificate(claim: NormClaim | ClosedLoopClaim, subject: str, method: str) -> Certificate:
    """Return a certificate that holds at every frequency."""
    dt = (claim.system if isinstance(claim, NormClaim) else claim.plant).dt
    return Certificate(
        subject=subject,
        outcome=Outcome.HOLDS,
        level=claim.level,
        method=method,
        intervals=np.array([[0.0, np.pi / dt if dt else np.inf]]),
        reason="",
        claim=claim,
    )


def is_proved_by_inequality(system: control.StateSpace, level: float, solver: str) -> bool:
    """Return whether the solver finds a P that proves the norm of a stable system below a level."""
    discrete, inner = bool(timebase(system)), level * (1 - SLACK)
    B, C, D = system.B / np.sqrt(inner), system.C / np.sqrt(inner), system.D / inner
    if not system.nstates:
        return bool(np.linalg.norm(D, 2) < 1 - 10 * EPS)
    A, B, C = scale_states(system.A, B, C)  # by powers of two, which is exact
    matrices = A, B, C, D
    image = well_conditioned(to_continuous(*matrices) if discrete else matrices)
    there = change_coordinates(image, preconditioning_coordinates(image))
    X = solve_kyp(there, solver)
    # judged in the coordinates of the proposal: there rounding is smallest
    judged = to_discrete(*there) if discrete else there
    return X is not None and not judge_inequality(*judged, (X + X.T) / 2, discrete=discrete)


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


def solve_kyp(matrices: Matrices, solver: str) -> np.ndarray | None:
    """X from cvxpy for the inequality with the largest margin, or None."""
    import cvxpy as cp

    A, B, C, D = matrices
    n, m = B.shape
    X, t = cp.Variable((n, n), symmetric=True), cp.Variable()
    cross = X @ B + C.T @ D
    M = cp.bmat([[A.T @ X + X @ A + C.T @ C, cross], [cross.T, D.T @ D - np.eye(m)]])
    scale = np.diag(1 / np.sqrt(np.concatenate([np.maximum(np.linalg.norm(A, axis=0), 1e-6), np.ones(m)])))
    constraints = [scale @ M @ scale << -t * np.eye(n + m), X >> 1e-6 * np.eye(n), t <= 1]
    problem = cp.Problem(cp.Maximize(t), constraints)
    if solve_program(problem, solver) or np.shape(X.value) != (n, n) or not np.isfinite(X.value).all():
        return None
    return np.asarray(X.value, dtype=float)


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
