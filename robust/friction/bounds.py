"""Two consequences of |f| <= Fs: a state from which the motion diverges, and the farthest that the
loop can hunt.

An unstable part of a sliding loop grows by lambda a sample: w' Phi J = lambda w', with the jump J
at the sample and the transition matrix Phi until the next one. |f| <= Fs reduces it at most by the
value of a support function; beyond that value the motion diverges with every such friction. A
stable loop keeps the position within Fs times the integral of the absolute impulse response g from
friction to position.

Every integral is bounded from above: over a piece of length h, int |g| <= sqrt(h int g^2) (Cauchy
and Schwarz), and a matrix exponential gives the quadratic form int g^2 exactly, however often g
changes its sign. The tail of the impulse response is bounded by a Lyapunov function. Cutting into
pieces only makes the bound tight.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import eig, expm, solve_discrete_lyapunov

from nlfrf._base.values import value
from robust.friction.loop import CIRCLE_MARGIN, FrictionLoop
from robust.friction.plant import ROUNDING
from robust.lti.lti import balance_matrix

_PIECES_PER_CYCLE = 32  # of a sampling period, or of half a swing of the fastest mode
_MAX_PIECES = 4096  # of a period
_MAX_PERIODS = 200_000
_MAX_OPERATIONS = 1e10  # multiplications
# pieces of whole periods in half a swing of the fastest mode that lasts: 0.02 % of the bound
_MERGED_PER_CYCLE = 128
# after these periods the modes that are fast relative to the clock have died out
_N_FINE_PERIODS = 64
_TAIL_SHARE = 1e-4
_ROUNDED_UP = 1 + 1e-6  # outward


@value
class _PeriodPieces:
    """One period of a loop, cut into pieces."""

    map: np.ndarray  # (n, n) state transition over the period
    # (n, P n) effect of the friction of each piece on the state at the end of the period, n columns
    # a piece. For any row r, int |r g| over piece p is at most the norm of (r kernel) in its
    # columns.
    kernel: np.ndarray
    # (3, R, n) rows that give position, acceleration and velocity at the ends of the pieces from
    # the state at the start
    reads: np.ndarray
    # (3, R) upper bound of their change by 1 N in the pieces of the period up to each end
    within: np.ndarray
    lengths: np.ndarray  # (P,) lengths of the pieces [s]


def divergence_velocity(loop: FrictionLoop, direction: np.ndarray, Fs: float) -> float:
    """Return the smallest multiple of the state `direction` from which the motion diverges with
    every |f| <= Fs.

    It is inf if there is none, and if the computation would take too many pieces.
    """
    cut = _cut_period(loop)
    if cut is None:
        return np.inf
    poles, left = eig(cut.map.T)
    least = np.inf
    for pole, w in zip(poles, left.T, strict=True):
        if np.abs(pole) <= 1 + CIRCLE_MARGIN or pole.imag < 0:
            continue
        reach = w @ direction
        if not np.abs(reach) > 1e-14 * np.linalg.norm(w) * np.linalg.norm(direction):
            continue
        parts = (w @ cut.kernel / pole).reshape(-1, loop.F.shape[0])
        phases = -np.angle(reach) + (np.linspace(-0.6, 0.6, 31) if pole.imag else np.zeros(1))
        taken = _support_function(np.exp(1j * phases), pole, parts)
        least = min(least, float((taken / np.cos(phases + np.angle(reach))).min() / np.abs(reach)))
    return Fs * least * _ROUNDED_UP


def _support_function(turn: np.ndarray, pole: complex, parts: np.ndarray) -> np.ndarray:
    """Return an upper bound (P,) of the sum over samples k and pieces of |Re(turn pole^-k parts)|,
    with its tail.
    """
    total = np.zeros(turn.size)
    affordable = _MAX_OPERATIONS / (40 * turn.size * parts.size)
    periods = int(
        max(
            1,
            min(_MAX_PERIODS, affordable, np.ceil(np.log(1 / _TAIL_SHARE) / np.log(np.abs(pole)))),
        )
    )
    at_once = max(1, int(4e6 / (turn.size * parts.size)))
    for first in range(0, periods, at_once):
        powers = complex(pole) ** -np.arange(first, min(first + at_once, periods), dtype=float)
        turned = turn[:, None, None, None] * powers[:, None, None] * parts
        total += np.linalg.norm(turned.real, axis=-1).sum(axis=(1, 2))
    rest = np.abs(pole) ** -float(periods) / (1 - 1 / np.abs(pole))
    return np.asarray(total + rest * np.linalg.norm(parts, axis=-1).sum())


def steady_error_bound(loop: FrictionLoop) -> float:
    """Return an upper bound of the distance from rest [m/N] that a friction of at most 1 N can
    sustain: the peak gain.

    It is inf if the loop is not stable by more than its rounding, or if it would take too many
    pieces or periods.
    """
    cut = _cut_period(loop)
    if cut is None:
        return np.inf
    positions = _absolute_kernel_integral(cut, 0)
    if not loop.T:  # all instants are alike
        return float(positions.max() * _ROUNDED_UP)
    if not np.isfinite(positions).all():
        return np.inf
    # between two ends of pieces the position leaves its chord by at most h^2/8 times the largest
    # acceleration, which is bounded by twice the largest one at the ends
    bend = 2 * (_absolute_kernel_integral(cut, 1).max() + np.abs(loop.v @ loop.B))
    step, at_once = cut.lengths.max(), np.abs(loop.x @ loop.B)
    away = step**2 / 8 * bend
    if at_once > ROUNDING * np.linalg.norm(loop.x) * np.linalg.norm(
        loop.B
    ):  # the velocity jumps with the friction
        away = step / 2 * (_absolute_kernel_integral(cut, 2).max() + step * bend + at_once)
    return float((positions.max() + away) * _ROUNDED_UP)


def _absolute_kernel_integral(cut: _PeriodPieces, what: int) -> np.ndarray:
    """Return an upper bound (R,) of the integral of |kernel| from the past friction to each of
    `cut.reads[what]`.
    """
    rows, total = cut.reads[what], cut.within[what]
    norm = _lyapunov_norm(cut.map)
    if norm is None:
        return np.full(rows.shape[0], np.inf)
    factor, inverse, rate = norm
    n = cut.map.shape[0]
    weight = np.linalg.norm(rows @ inverse, axis=1)
    merged = _merge_periods(cut)
    affordable = int(min(_MAX_PERIODS, _MAX_OPERATIONS / (rows.shape[0] * cut.kernel.size)))
    stages = [(1, cut.map, cut.kernel, affordable)]
    if merged is not None and affordable > _N_FINE_PERIODS:
        count, kernel = merged
        start = np.linalg.matrix_power(cut.map, _N_FINE_PERIODS) @ kernel
        stages = [
            (1, cut.map, cut.kernel, _N_FINE_PERIODS),
            (
                count,
                np.linalg.matrix_power(cut.map, count),
                start,
                (affordable - _N_FINE_PERIODS) // count,
            ),
        ]
    for count, step, state, n_steps in stages:
        for k in range(n_steps):
            if (
                k % 8 == 0
            ):  # the rest: |r Phi^k x| <= |r| rate^k |x| in the norm in which the map contracts
                left = np.linalg.norm((factor @ state).reshape(n, -1, n), axis=(0, 2)).sum()
                rest = weight * left / (1 - rate**count)
                if (rest <= _TAIL_SHARE * total.max()).all():
                    return np.asarray(total + rest)
            total = total + _kernel_norms(rows, state)
            state = step @ state
    return np.full(rows.shape[0], np.inf)


def _merge_periods(cut: _PeriodPieces) -> tuple[int, np.ndarray] | None:
    """Return a number of periods that is cut into pieces of whole periods, and the effect of the
    friction in each.

    This is for modes that are slow relative to the clock, after the fast ones have died out. None
    if one is not slow.
    """
    poles = np.linalg.eigvals(cut.map)
    lasting = poles[np.abs(poles) ** _N_FINE_PERIODS > _TAIL_SHARE]
    fastest = np.abs(np.log(lasting)).max(initial=0.0)
    if not fastest * _MERGED_PER_CYCLE <= np.pi:
        return None
    if fastest:
        together = int(np.pi / (_MERGED_PER_CYCLE * fastest))
    else:
        together = 1
    n = cut.map.shape[0]
    pieces = cut.kernel.reshape(n, -1, n)
    # (sum of h_p) times the sum of int g^2; a piece contains h_p int g^2
    gram = np.einsum("ipk,jpk,p->ij", pieces, pieces, cut.lengths.sum() * together / cut.lengths)
    total, power = np.zeros((n, n)), np.eye(n)
    for _ in range(together):
        total += power @ gram @ power.T
        power = cut.map @ power
    root = _gramian_root(total)
    kernel = [root]
    for _ in range(_MERGED_PER_CYCLE - 1):
        kernel.append(power @ kernel[-1])
    return _MERGED_PER_CYCLE * together, np.hstack(kernel)


def _kernel_norms(rows: np.ndarray, kernel: np.ndarray) -> np.ndarray:
    """Return (R,) sums of the norms of (rows kernel) over the columns of each piece."""
    n, at_once = kernel.shape[0], max(1, 4_000_000 // kernel.shape[1])
    sums = []
    for first in range(0, rows.shape[0], at_once):
        pieces = (rows[first : first + at_once] @ kernel).reshape(-1, kernel.shape[1] // n, n)
        sums.append(np.sqrt(np.einsum("rpi,rpi->rp", pieces, pieces)).sum(axis=1))
    return np.concatenate(sums)


def _lyapunov_norm(period: np.ndarray) -> tuple[np.ndarray, np.ndarray, float] | None:
    """Return a norm |L x| in which a stable map contracts:

    L, its inverse, the rate below one; else None.
    """
    scaled, weights = balance_matrix(period)
    goal = 1 - 0.75 * (1 - np.abs(np.linalg.eigvals(scaled)).max(initial=0.0))
    if not 0 < goal < 1 or _MAX_PERIODS * (1 - goal) < 1:
        return None
    try:
        P = solve_discrete_lyapunov((scaled / goal).T, np.eye(scaled.shape[0]))
        L = np.linalg.cholesky((P + P.T) / 2).T
        back = np.linalg.inv(L)
    except np.linalg.LinAlgError:
        return None
    rate = float(np.linalg.norm(L @ scaled @ back, 2))
    rounding = np.finfo(float).eps * np.linalg.norm(L, 2) * np.linalg.norm(back, 2)
    if rounding < 1e-3 * (1 - rate):
        return L / weights, weights[:, None] * back, rate
    return None


def _cut_period(loop: FrictionLoop) -> _PeriodPieces | None:
    """Cut a period into pieces that are short for both the clock and the fastest mode; None if
    these are too many.

    The period of a continuous loop is half an oscillation of its fastest mode.
    """
    n = loop.F.shape[0]
    fastest = np.abs(np.linalg.eigvals(loop.F)).max(initial=0.0)
    if not loop.T:
        if fastest:
            T = np.pi / fastest
        else:
            T = 1.0
        spans, jumps = np.array([T]), np.eye(n)[None]
    else:
        T, spans, jumps = loop.T, loop.spans, loop.jumps
    counts = np.maximum(
        2, np.ceil(_PIECES_PER_CYCLE * spans * max(1 / T, fastest / np.pi) * (1 - 1e-12))
    )
    if not counts.sum() <= _MAX_PIECES:
        return None
    read = np.array([loop.x, loop.v @ loop.F, loop.v])  # position, acceleration, velocity
    map_, kernel, ends, within = np.eye(n), np.zeros((n, 0)), [], []
    for span, jump, count in zip(spans, jumps, counts.astype(int), strict=True):
        # what friction in a piece does at its end; later pieces and jumps carry it on as they carry
        # the state
        flow, push = _flow_and_gramian_root(loop.F, loop.B, span / count)
        map_, kernel = jump @ map_, jump @ kernel
        for _ in range(count):
            map_, kernel = flow @ map_, np.hstack([flow @ kernel, push])
            ends.append(read @ map_)
            within.append(_kernel_norms(read, kernel))
    if loop.T:
        kept = slice(None)
    else:
        kept = slice(-1, None)
    return _PeriodPieces(
        map=map_,
        kernel=kernel,
        reads=np.moveaxis(np.array(ends)[kept], 1, 0),
        within=np.array(within)[kept].T,
        lengths=np.repeat(spans / counts, counts.astype(int)),
    )


def _flow_and_gramian_root(F: np.ndarray, B: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray]:
    """Return exp(F h) and G with h int_0^h exp(F s) B B' exp(F s)' ds = G G' (Van Loan 1978)."""
    n = F.shape[0]
    block = np.zeros((2 * n, 2 * n))
    block[:n, :n], block[:n, n:], block[n:, n:] = -F, np.outer(B, B), F.T
    both = expm(block * h)
    flow = both[n:, n:].T
    return flow, _gramian_root(h * flow @ both[:n, n:])


def _gramian_root(gram: np.ndarray) -> np.ndarray:
    """Return G with G G' slightly above the Gramian, so that rounding cannot make it too small.

    The Gramian is scaled to unit diagonal, because eigenvalues are accurate only relative to the
    largest one.
    """
    n = gram.shape[0]
    unit = np.sqrt(np.maximum(np.diag(gram), 0))
    per_unit = np.divide(1.0, unit, out=np.zeros(n), where=unit > 0)
    sizes, turns = np.linalg.eigh((gram + gram.T) / 2 * np.outer(per_unit, per_unit))
    return np.asarray(
        unit[:, None]
        * turns
        * np.sqrt(np.maximum(sizes, 0) + 4 * n * np.finfo(float).eps * sizes.max())
    )
