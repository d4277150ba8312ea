"""A storage function z'P(t)z for a flow with jumps: the stabilising solution of a periodic Riccati equation.

Only a proposal: `bernstein` judges it. Back over a stretch of time a Riccati map is

    phi(W) = H + A'W (I - G W)^-1 A

and the map of two stretches is one more (A, G, H). Its fixed point over a period comes from the stable subspace of a
symplectic pencil: iterations from zero fail where an integrator is slow.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm, ordqz, schur, solve_continuous_lyapunov, solve_discrete_lyapunov

from robust.storage.form import Dissipation

__all__ = ["back_over", "coordinates", "jump_stretch", "proposed_storage", "supply_with_slack"]

NEWTON_STEPS = 2

Stretch = tuple[np.ndarray, np.ndarray, np.ndarray]


def coordinates(form: Dissipation) -> np.ndarray:
    """(n, n) V with z = V z~ in which the input reaches every state alike: a root of the closed-loop Gramian.

    Summed over the ends of all spans: just after a delay the force that waited and the one that is held are the same.
    """
    W = gramian(form)
    unit = np.sqrt(np.maximum(np.diag(W), 1e-300))
    values, vectors = np.linalg.eigh(W / np.outer(unit, unit))
    return np.asarray(unit[:, None] * vectors * np.sqrt(np.maximum(values, 1e-9 * values[-1])))


def gramian(form: Dissipation) -> np.ndarray:
    """(n, n) controllability Gramian of the flow with its jumps."""
    n = form.A.shape[0]
    if not form.spans.size:
        return np.asarray(solve_continuous_lyapunov(form.A, -form.B @ form.B.T))
    parts: list[tuple[np.ndarray, np.ndarray]] = []
    for span, jump in zip(form.spans, form.jumps, strict=True):
        both = expm(span * np.block([[-form.A, form.B @ form.B.T], [np.zeros((n, n)), form.A.T]]))
        flow, reached = both[n:, n:].T, both[n:, n:].T @ both[:n, n:]
        if not parts and form.block is not None:
            struck = flow @ form.block.enters
            reached = reached + np.outer(struck, struck) / form.block.weight
        parts.append((flow @ jump, reached))
    W, Phi = np.zeros((n, n)), np.eye(n)
    for move, driven in parts:
        W, Phi = move @ W @ move.T + driven, move @ Phi
    unit = np.sqrt(np.maximum(np.diag(W), 1e-300))
    unit[unit < 1e-12 * unit.max()] = 1.0
    W, Phi = W / np.outer(unit, unit), Phi * unit / unit[:, None]
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(60):  # doubling: W = sum Phi^k W Phi^k'
            W, Phi = W + Phi @ W @ Phi.T, Phi @ Phi
            if np.linalg.norm(Phi) < 1e-12:
                break
        else:
            raise np.linalg.LinAlgError("a state of the loop does not come to rest by itself")
    W = W * np.outer(unit, unit)
    total = np.zeros((n, n))
    for move, driven in parts:
        W = move @ W @ move.T + driven
        total += W
    return (total + total.T) / 2


def supply_with_slack(form: Dissipation, slack: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A_h, G, Q_h of the Riccati equation P' = -(A_h'P + P A_h + P G P + Q_h), the supply made larger by slack."""
    n, m = form.B.shape
    R = form.R + slack * np.eye(m)
    gain = np.linalg.solve(R, np.hstack([form.N.T, form.B.T]))
    A = form.A - form.B @ gain[:, :n]
    return A, -form.B @ gain[:, n:], form.Q + slack * np.eye(n) - form.N @ gain[:, :n]


def joined(first: Stretch, second: Stretch) -> Stretch:
    """Two stretches of time as one."""
    (A1, G1, H1), (A2, G2, H2) = first, second
    M = np.linalg.inv(np.eye(A1.shape[0]) - G1 @ H2)
    return A2 @ M @ A1, G2 + A2 @ M @ G1 @ A2.T, H1 + A1.T @ H2 @ M @ A1


def jump_stretch(form: Dissipation, i: int, slack: float) -> Stretch:
    """The Riccati map back over a jump, with the block that acts there at its worst."""
    n = form.A.shape[0]
    jump, left = form.jumps[i], slack * np.eye(n)
    if i or form.block is None:
        return jump, np.zeros((n, n)), left
    b, c, weight = form.block.enters, form.block.seen, form.block.weight
    return jump - np.outer(b, c) / weight, np.outer(b, b) / weight, left + np.outer(c, c) / weight


def back_over(stretch: Stretch, W: np.ndarray) -> np.ndarray:
    """H + A'W (I - G W)^-1 A."""
    A, G, H = stretch
    return np.asarray(H + A.T @ W @ np.linalg.solve(np.eye(A.shape[0]) - G @ W, A))


def flow_stretch(hamiltonian: np.ndarray, span: float) -> Stretch:
    """The Riccati map back over a flow."""
    n = hamiltonian.shape[0] // 2
    E = expm(-span * hamiltonian)
    A = np.linalg.inv(E[:n, :n])
    return A, -A @ E[:n, n:], E[n:, :n] @ A


def proposed_storage(form: Dissipation, slack: float) -> np.ndarray | None:
    """(n, n) P just after the jump that begins a period, P itself where nothing is sampled; None if none."""
    if np.any(np.linalg.eigvalsh(form.R + slack * np.eye(form.R.shape[0])) >= 0):
        return None
    with np.errstate(over="ignore", invalid="ignore"):  # what runs over is no storage function
        return stabilising(form, slack)


def stabilising(form: Dissipation, slack: float) -> np.ndarray | None:
    """The same, of an equation that exists."""
    n = form.A.shape[0]
    A, G, Q = supply_with_slack(form, slack)
    hamiltonian = np.block([[A, G], [-Q, -A.T]])
    try:
        if not form.spans.size:
            _, Z, count = schur(hamiltonian, sort="lhp")
            return solved(Z, n) if count == n else None
        period: Stretch | None = None
        total = form.spans.sum()
        turn = [*range(1, form.spans.size), 0]  # begin after the first jump
        for i, after in enumerate(turn):
            flow = flow_stretch(hamiltonian, form.spans[i])
            stretch = joined(flow, jump_stretch(form, after, slack * total))
            period = stretch if period is None else joined(period, stretch)
        assert period is not None
        Ac, Gc, Hc = period
        left = np.block([[Ac, np.zeros((n, n))], [-Hc, np.eye(n)]])
        right = np.block([[np.eye(n), -Gc], [np.zeros((n, n)), Ac.T]])
        *_, alpha, beta, _, Z = ordqz(left, right, sort="iuc")
        if np.count_nonzero(np.abs(alpha) < np.abs(beta)) != n:
            return None
        P = solved(Z, n)
        return P if form.block is None else corrected(period, P)
    except (np.linalg.LinAlgError, ValueError):
        return None


def corrected(period: Stretch, P: np.ndarray | None) -> np.ndarray | None:
    """The solution after Newton steps: of a loop with a block the subspace alone gives few digits."""
    if P is None:
        return None
    for _ in range(NEWTON_STEPS):
        left = back_over(period, P) - P
        closed = np.linalg.solve(np.eye(P.shape[0]) - period[1] @ P, period[0])
        P = P + solve_discrete_lyapunov(closed.T, (left + left.T) / 2)
    return (P + P.T) / 2 if np.isfinite(P).all() else None


def solved(Z: np.ndarray, n: int) -> np.ndarray | None:
    """P = U2 U1^-1 of a subspace."""
    P = np.linalg.solve(Z[:n, :n].T, Z[n:, :n].T).T
    return (P + P.T) / 2 if np.isfinite(P).all() else None
