"""Storage functions for dissipation inequalities: proposed by a Riccati equation, judged by
Bernstein coefficients.
"""

from __future__ import annotations

from dataclasses import replace
from functools import reduce

import numpy as np
from scipy.linalg import expm, ordqz, schur, solve_continuous_lyapunov, solve_discrete_lyapunov

from nlfrf._base.values import value

# ---- A flow with jumps, its supply rate, and the rest of the stored energy.


@value
class Block:
    """A nonlinearity that acts at the first jump: y+ = J y - input_column w, and 2 w output_row y
    >= weight w^2.

    Fields
    ------
    input_column, output_row : (n,) ndarray
    weight : float
        Positive.
    """

    input_column: np.ndarray
    output_row: np.ndarray
    weight: float


@value
class Dissipation:
    """A flow with jumps, its supply rate, and the part of the stored energy beyond z'Pz."""

    A: np.ndarray  # (n, n)
    B: np.ndarray  # (n, m) flow z' = A z + B d
    spans: np.ndarray  # (S,)
    jumps: (
        np.ndarray
    )  # (S, n, n) duration of each flow [s], and the jump before it; none for a continuous loop
    # Q, N, R: (n, n) or (n, m) or (m, m) supply rate z'Qz + 2 z'Nd + d'Rd: `stored` does not rise
    # faster
    Q: np.ndarray
    N: np.ndarray
    R: np.ndarray
    # (n + E, n + E) the rest of the stored energy: a form in z and E more states (forces that rest)
    stored: np.ndarray
    B_error: np.ndarray  # (n, m)
    stored_error: (
        np.ndarray
    )  # (n + E, n + E) error bound of each entry: the rest xi_e is known to rounding only
    block: Block | None = None  # nonlinearity at the first jump


# ---- A storage function z'P(t)z for a flow with jumps: the stabilising solution of a periodic
# Riccati equation.
#
# It is only a proposal, judged below. Backwards over a stretch of time a Riccati map is
#
#     phi(W) = H + A'W (I - G W)^-1 A
#
# and two stretches in sequence are one such map. Its fixed point over a period comes from the
# stable subspace of a symplectic pencil: iterations from zero fail for slow integrators.

_NEWTON_STEPS = 2
#: Reason why there is no Gramian.
_NO_REST = "a state of the loop does not come to rest by itself"

Stretch = tuple[np.ndarray, np.ndarray, np.ndarray]


def balancing_coordinates(
    A: np.ndarray,
    B: np.ndarray,
    *,
    spans: np.ndarray,
    jumps: np.ndarray,
    block: Block | None = None,
) -> np.ndarray:
    """Return (n, n) V with z = V z~ in which the input reaches all states alike: a root of the
    closed-loop Gramian.

    The Gramian is summed over the ends of all spans: just after a delay the waiting and the held
    force are equal.
    """
    W = _gramian(A, B, spans=spans, jumps=jumps, block=block)
    unit = np.sqrt(np.maximum(np.diag(W), 1e-300))
    with np.errstate(over="ignore", invalid="ignore"):
        scaled = W / np.outer(unit, unit)
    if not np.isfinite(scaled).all():
        raise np.linalg.LinAlgError(_NO_REST)
    values, vectors = np.linalg.eigh(scaled)
    return np.asarray(unit[:, None] * vectors * np.sqrt(np.maximum(values, 1e-9 * values[-1])))


@np.errstate(over="ignore", invalid="ignore")  # what overflows is no Gramian, and is refused
def _gramian(
    A: np.ndarray, B: np.ndarray, *, spans: np.ndarray, jumps: np.ndarray, block: Block | None
) -> np.ndarray:
    """Return (n, n) controllability Gramian of the flow with its jumps."""
    n = A.shape[0]
    if not spans.size:
        return np.asarray(solve_continuous_lyapunov(A, -B @ B.T))
    parts: list[tuple[np.ndarray, np.ndarray]] = []
    for span, jump in zip(spans, jumps, strict=True):
        both = expm(span * np.block([[-A, B @ B.T], [np.zeros((n, n)), A.T]]))
        flow, reached = both[n:, n:].T, both[n:, n:].T @ both[:n, n:]
        if not parts and block is not None:
            struck = flow @ block.input_column
            reached = reached + np.outer(struck, struck) / block.weight
        parts.append((flow @ jump, reached))
    W, Phi = np.zeros((n, n)), np.eye(n)
    for move, driven in parts:
        W, Phi = move @ W @ move.T + driven, move @ Phi
    unit = np.sqrt(np.maximum(np.diag(W), 1e-300))
    unit[unit < 1e-12 * unit.max()] = 1.0
    W, Phi = W / np.outer(unit, unit), Phi * unit / unit[:, None]
    for _ in range(60):  # doubling: W = sum Phi^k W Phi^k'
        W, Phi = W + Phi @ W @ Phi.T, Phi @ Phi
        if np.linalg.norm(Phi) < 1e-12:
            break
    else:
        raise np.linalg.LinAlgError(_NO_REST)
    W = W * np.outer(unit, unit)
    total = np.zeros((n, n))
    for move, driven in parts:
        W = move @ W @ move.T + driven
        total += W
    return (total + total.T) / 2


def _supply_with_slack(
    form: Dissipation, slack: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return A_h, G, Q_h of P' = -(A_h'P + P A_h + P G P + Q_h), with slack added to the supply."""
    n, m = form.B.shape
    R = form.R + slack * np.eye(m)
    gain = np.linalg.solve(R, np.hstack([form.N.T, form.B.T]))
    A = form.A - form.B @ gain[:, :n]
    return A, -form.B @ gain[:, n:], form.Q + slack * np.eye(n) - form.N @ gain[:, :n]


def _join_stretches(first: Stretch, second: Stretch) -> Stretch:
    (A1, G1, H1), (A2, G2, H2) = first, second
    M = np.linalg.inv(np.eye(A1.shape[0]) - G1 @ H2)
    return A2 @ M @ A1, G2 + A2 @ M @ G1 @ A2.T, H1 + A1.T @ H2 @ M @ A1


def _jump_stretch(form: Dissipation, i: int, slack: float) -> Stretch:
    """Return the Riccati map backwards over a jump, with the worst case of its block."""
    n = form.A.shape[0]
    jump, left = form.jumps[i], slack * np.eye(n)
    if i or form.block is None:
        return jump, np.zeros((n, n)), left
    b, c, weight = form.block.input_column, form.block.output_row, form.block.weight
    return jump - np.outer(b, c) / weight, np.outer(b, b) / weight, left + np.outer(c, c) / weight


def _propagate_back(stretch: Stretch, W: np.ndarray) -> np.ndarray:
    """Return H + A'W (I - G W)^-1 A."""
    A, G, H = stretch
    return np.asarray(H + A.T @ W @ np.linalg.solve(np.eye(A.shape[0]) - G @ W, A))


def _flow_stretch(hamiltonian: np.ndarray, span: float) -> Stretch:
    """Return the Riccati map backwards over a flow."""
    n = hamiltonian.shape[0] // 2
    E = expm(-span * hamiltonian)
    A = np.linalg.inv(E[:n, :n])
    return A, -A @ E[:n, n:], E[n:, :n] @ A


def _proposed_storage(form: Dissipation, slack: float) -> np.ndarray | None:
    """Return (n, n) P just after the jump that begins a period, or the constant P of a continuous
    loop; else None.
    """
    if np.any(np.linalg.eigvalsh(form.R + slack * np.eye(form.R.shape[0])) >= 0):
        return None
    n = form.A.shape[0]
    A, G, Q = _supply_with_slack(form, slack)
    hamiltonian = np.block([[A, G], [-Q, -A.T]])
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # an overflow gives no storage function
            if not form.spans.size:
                _, Z, count = schur(hamiltonian, sort="lhp")
                if count == n:
                    return _solution_from_subspace(Z, n)
                return None
            stretches = []
            for i, span in enumerate(form.spans):  # begin after the first jump
                jump = _jump_stretch(form, (i + 1) % form.spans.size, slack * form.spans.sum())
                stretches.append(_join_stretches(_flow_stretch(hamiltonian, span), jump))
            Ac, Gc, Hc = period = reduce(_join_stretches, stretches)
            left = np.block([[Ac, np.zeros((n, n))], [-Hc, np.eye(n)]])
            right = np.block([[np.eye(n), -Gc], [np.zeros((n, n)), Ac.T]])
            *_, alpha, beta, _, Z = ordqz(left, right, sort="iuc")
            if np.count_nonzero(np.abs(alpha) < np.abs(beta)) != n:
                return None
            P = _solution_from_subspace(Z, n)
            if form.block is None or P is None:
                return P
            return _refine_by_newton(period, P)
    except (np.linalg.LinAlgError, ValueError):
        return None


def _refine_by_newton(period: Stretch, P: np.ndarray) -> np.ndarray | None:
    """Refine P by Newton steps: for a loop with a block the subspace alone gives few digits."""
    for _ in range(_NEWTON_STEPS):
        left = _propagate_back(period, P) - P
        closed = np.linalg.solve(np.eye(P.shape[0]) - period[1] @ P, period[0])
        P = P + solve_discrete_lyapunov(closed.T, (left + left.T) / 2)
    if np.isfinite(P).all():
        return (P + P.T) / 2
    return None


def _solution_from_subspace(Z: np.ndarray, n: int) -> np.ndarray | None:
    """Return P = U2 U1^-1 of a subspace [U1; U2]."""
    P = np.linalg.solve(Z[:n, :n].T, Z[n:, :n].T).T
    if np.isfinite(P).all():
        return (P + P.T) / 2
    return None


# ---- The judge: does a storage function prove a dissipation inequality? Its matrices are assembled
# here again.
#
# On each interval of a period P is a cubic between nodes. The inequality [P' + A'P + PA + Q, PB +
# N; ., R] < 0 is then cubic in time: a convex combination of its four Bernstein coefficients. If
# these are negative definite it holds at every instant. Each matrix is judged by its eigenvalues,
# with a margin above the rounding of its assembly.

_EPS = np.finfo(float).eps


@value(copy=False)
class _BoundedForm:
    """A dissipation inequality in coordinates z = V z~, with an error bound for each entry of its
    matrices.
    """

    # the inequality in those coordinates; the inputs are scaled so that the diagonal of R is minus
    # one
    form: Dissipation
    off: Dissipation  # error bound of each entry
    V: np.ndarray  # (n, n) the coordinates


@value(copy=False)
class JudgedStorage:
    """A storage function z'P(t)z in coordinates z = V z~, which is judged or to be judged."""

    V: np.ndarray  # (n, n)
    # (I, 4, n, n) bernstein coefficients on each interval; neighbours in one span share their end.
    # (1, 1, n, n) for a continuous loop.
    P: np.ndarray
    counts: np.ndarray  # (S,) number of intervals of equal length in each span
    stored: np.ndarray  # (n + E, n + E) the rest of the stored energy in these coordinates


def _in_balanced_coordinates(form: Dissipation) -> _BoundedForm:
    unit = np.sqrt(np.maximum(-np.diag(form.R), 1e-300))  # of the inputs
    top = unit.max()
    heavy = form.block and replace(form.block, weight=form.block.weight / top**2)
    V = balancing_coordinates(
        form.A, form.B * (top / unit), spans=form.spans, jumps=form.jumps, block=heavy
    )
    back = np.linalg.inv(V)
    n = form.B.shape[0]
    more = form.stored.shape[0] - n
    aV, aback = np.abs(V), 1.01 * np.abs(back)
    k = (2 * n + 8) * _EPS

    def similar(M: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return V^-1 M V, and its error bound from the residual of V X = M V."""
        X = back @ M @ V
        left = np.abs(V @ X - M @ V) + k * (aV @ np.abs(X) + np.abs(M) @ aV)
        return X, aback @ left

    A, A_off = similar(form.A)
    jumps = [similar(jump) for jump in form.jumps]
    B = back @ form.B / unit
    B_off = aback @ (np.abs(V @ B - form.B / unit) + k * (aV @ np.abs(B)) + form.B_error / unit)
    block, block_off = None, None
    if form.block is not None:
        b, c = form.block.input_column, form.block.output_row
        block = Block(input_column=back @ b, output_row=V.T @ c, weight=form.block.weight)
        left = np.abs(V @ block.input_column - b) + k * (aV @ np.abs(block.input_column))
        block_off = Block(
            input_column=aback @ left,
            output_row=k * (aV.T @ np.abs(c)),
            weight=8 * _EPS * form.block.weight,
        )
    wide = np.block([[V, np.zeros((n, more))], [np.zeros((more, n)), np.eye(more)]])
    awide = np.abs(wide)
    new = Dissipation(
        A=A,
        B=B,
        spans=form.spans,
        jumps=np.array([jump for jump, _ in jumps]).reshape(-1, n, n),
        Q=V.T @ form.Q @ V,
        N=V.T @ form.N / unit,
        R=form.R / np.outer(unit, unit),
        stored=wide.T @ form.stored @ wide,
        B_error=form.B_error,
        stored_error=form.stored_error,
        block=block,
    )
    off = replace(
        new,
        A=A_off,
        B=B_off,
        Q=k * (aV.T @ np.abs(form.Q) @ aV),
        N=k * (aV.T @ np.abs(form.N)) / unit,
        R=8 * _EPS * np.abs(new.R),
        jumps=np.array([off for _, off in jumps]).reshape(-1, n, n),
        stored=k * (awide.T @ np.abs(form.stored) @ awide) + awide.T @ form.stored_error @ awide,
        block=block_off,
    )
    return _BoundedForm(form=new, off=off, V=V)


def _build_storage(
    judged: _BoundedForm, P: np.ndarray, *, slack: float, n_intervals: int
) -> JudgedStorage:
    """Return cubics through the Riccati solution that begins with P, with its slopes; for one flow
    the constant P.
    """
    form = judged.form
    A, G, Q = _supply_with_slack(form, slack)
    hamiltonian = np.block([[A, G], [-Q, -A.T]])
    n, spans = A.shape[0], form.spans
    total = spans.sum()
    counts = np.array([max(1, round(n_intervals * span / total)) for span in spans], dtype=int)
    if spans.size:
        parts = []
    else:
        parts = [P[np.newaxis, np.newaxis]]
    later = P  # just after the jump that begins the next span
    for i in reversed(range(spans.size)):
        W = _propagate_back(_jump_stretch(form, (i + 1) % spans.size, slack * total), later)
        h = spans[i] / counts[i]
        E = expm(-h * hamiltonian)
        nodes = [W]
        for _ in range(counts[i]):
            W = np.linalg.solve((E[:n, :n] + E[:n, n:] @ W).T, (E[n:, :n] + E[n:, n:] @ W).T).T
            W = (W + W.T) / 2
            nodes.append(W)
        node = np.array(nodes[::-1])
        slope = -(A.T @ node + node @ A + node @ G @ node + Q)
        cubics = np.stack(
            [node[:-1], node[:-1] + h / 3 * slope[:-1], node[1:] - h / 3 * slope[1:], node[1:]],
            axis=1,
        )
        parts.append(cubics)
        later = node[0]
    found = np.concatenate(parts[::-1])
    found = (found + np.swapaxes(found, -1, -2)) / 2  # symmetric to the last bit
    return JudgedStorage(V=judged.V, P=found, counts=counts, stored=form.stored)


def _largest_scaled_eigenvalue(matrices: np.ndarray, errors: np.ndarray) -> float:
    """Return the largest scaled eigenvalue of symmetric matrices plus rounding; below zero if all
    are negative.
    """
    diagonal = -np.diagonal(matrices, axis1=-2, axis2=-1)
    if not np.isfinite(matrices).all() or not np.all(diagonal > 0):
        return float("inf")
    root = np.sqrt(diagonal)
    scale = root[..., :, None] * root[..., None, :]
    n = matrices.shape[-1]
    largest = np.linalg.eigvalsh(matrices / scale)[..., -1]
    slack = np.linalg.norm(errors / scale, axis=(-2, -1)) + 10 * n * _EPS
    return float((largest + slack).max())


def _flow_inequality(
    judged: _BoundedForm, P: np.ndarray, *, slope: np.ndarray, slope_size: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the matrix of the inequality for many P and P' at once, and its rounding error."""
    form = judged.form
    n, m = form.B.shape
    k = (2 * n + 8) * _EPS
    size = np.abs(P)
    M, E = np.zeros((*P.shape[:-2], n + m, n + m)), np.zeros((*P.shape[:-2], n + m, n + m))
    M[..., :n, :n] = slope + form.A.T @ P + P @ form.A + form.Q
    E[..., :n, :n] = size @ (k * np.abs(form.A) + judged.off.A)
    E[..., :n, :n] += (
        np.swapaxes(E[..., :n, :n].copy(), -1, -2)
        + k * (slope_size + np.abs(form.Q))
        + judged.off.Q
    )
    M[..., :n, n:] = P @ form.B + form.N
    E[..., :n, n:] = size @ (k * np.abs(form.B) + judged.off.B) + k * np.abs(form.N) + judged.off.N
    M[..., n:, :n] = np.swapaxes(M[..., :n, n:], -1, -2)
    E[..., n:, :n] = np.swapaxes(E[..., :n, n:], -1, -2)
    M[..., n:, n:] = form.R
    E[..., n:, n:] = judged.off.R
    return (M + np.swapaxes(M, -1, -2)) / 2, E


def _judge_storage(judged: _BoundedForm, storage: JudgedStorage) -> tuple[str, float]:
    """Return an empty text if the storage proves inequality, jumps and positivity; else the failure
    and its size.

    The size is the largest scaled eigenvalue of a failure between samples, which finer intervals
    may remove. It is infinite for any other failure.
    """
    if storage.counts.size:
        counts, spans = storage.counts, judged.form.spans
    else:
        counts, spans = np.ones(1, dtype=int), np.ones(1)
    b = np.broadcast_to(storage.P, (counts.sum(), 4, *storage.P.shape[2:]))
    h = np.repeat(spans / counts, counts)
    h = h[:, None, None, None]
    # of P', a parabola; its degree is raised to that of a cubic
    steps = 3 * (b[:, 1:] - b[:, :-1]) / h
    sizes = 3 * (np.abs(b[:, 1:]) + np.abs(b[:, :-1])) / h
    slope, size = _raise_degree(steps), _raise_degree(sizes)
    worst = _largest_scaled_eigenvalue(*_flow_inequality(judged, b, slope=slope, slope_size=size))
    if not worst < 0:
        between = " between samples" if len(judged.form.jumps) else ""
        return (
            f"the inequality does not hold{between}: its largest scaled eigenvalue is {worst:.2g}",
            worst,
        )
    last = np.cumsum(counts)
    begins, ends = b[last - counts, 0], b[last - 1, 3]
    for i in range(len(judged.form.jumps)):
        worst = _largest_scaled_eigenvalue(
            *_jump_inequality(judged, i, before=ends[i - 1], after=begins[i])
        )
        if not worst < 0:
            return (
                f"the energy may grow at a sample: its largest scaled eigenvalue is {worst:.2g}",
                np.inf,
            )
    return _check_positive(judged, np.array([begins[0], ends[-1]])), np.inf


def _jump_inequality(
    judged: _BoundedForm, i: int, *, before: np.ndarray, after: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the matrix of the energy gain at a jump, with the block as one more state, and its
    error bound.
    """
    jump = judged.form.jumps[i]
    unsure = judged.off.jumps[i]
    block = judged.form.block
    n = before.shape[0]
    lost, loose = before, np.zeros_like(before)
    if i == 0 and block is not None and judged.off.block is not None:
        jump = np.column_stack([jump, -block.input_column])
        unsure = np.column_stack([unsure, judged.off.block.input_column])
        lost, loose = np.zeros((n + 1, n + 1)), np.zeros((n + 1, n + 1))
        lost[:n, :n], lost[n, n] = before, block.weight
        lost[:n, n] = lost[n, :n] = -block.output_row
        loose[n, n] = judged.off.block.weight
        loose[:n, n] = loose[n, :n] = judged.off.block.output_row
    wide = np.abs(jump) + unsure
    off = (2 * n + 4) * _EPS * (wide.T @ np.abs(after) @ wide + np.abs(lost)) + loose
    cross = wide.T @ np.abs(after) @ unsure
    return jump.T @ after @ jump - lost, off + cross + cross.T


def _raise_degree(parabola: np.ndarray) -> np.ndarray:
    """Return the (I, 4, ...) Bernstein coefficients of a parabola as those of a cubic."""
    first, second, third = parabola[:, 0], parabola[:, 1], parabola[:, 2]
    return np.stack([first, (first + 2 * second) / 3, (2 * second + third) / 3, third], axis=1)


def _check_positive(judged: _BoundedForm, P: np.ndarray) -> str:
    """Return an empty string if the storage is positive for all states, else why not."""
    n = P.shape[-1]
    stored = judged.form.stored
    energy = np.broadcast_to(stored, (*P.shape[:-2], *stored.shape)).copy()
    energy[..., :n, :n] += P
    size = np.broadcast_to(judged.off.stored, energy.shape).copy() + 4 * _EPS * np.abs(stored)
    size[..., :n, :n] += 4 * _EPS * np.abs(P)
    worst = _largest_scaled_eigenvalue(-energy, size)
    if worst < 0:
        return ""
    return f"the stored energy is not positive: its least scaled eigenvalue is {-worst:.2g}"


METHOD = "periodic Riccati equation, Bernstein"
_SLACKS = 0.1 * 0.25 ** np.arange(4, 14)
_INTERVAL_COUNTS = (8, 32, 128)
_MAX_INTERVALS = 512
_NEAR_MISS = 1e-3  # for a failure this small the finest intervals are tried


def certified_dissipation(form: Dissipation) -> tuple[str, JudgedStorage | None]:
    """Return an empty text and the storage function that is judged to prove the inequality; else
    the last failure.
    """
    judged = _in_balanced_coordinates(form)
    failure = "no storage function was found"
    nearest = _NEAR_MISS, 0.0, np.zeros(0)
    for slack in _SLACKS:
        P = _proposed_storage(judged.form, slack)
        if P is None:
            continue
        for n_intervals in _INTERVAL_COUNTS if form.spans.size else _INTERVAL_COUNTS[:1]:
            storage = _build_storage(judged, P, slack=slack, n_intervals=n_intervals)
            failure, worst = _judge_storage(judged, storage)
            if not failure:
                return "", storage
            if (
                np.isinf(worst) and n_intervals > _INTERVAL_COUNTS[0]
            ):  # finer intervals will not help this slack
                break
        nearest = min(nearest, (worst, slack, P), key=lambda found: found[0])
    worst, slack, P = nearest
    if worst < _NEAR_MISS and form.spans.size:
        storage = _build_storage(judged, P, slack=slack, n_intervals=_MAX_INTERVALS)
        failure = _judge_storage(judged, storage)[0]
        if not failure:
            return "", storage
    return failure, None
