"""What a friction that is only known to be bounded cannot do: stop a run-away, or hunt further than this.

The unstable part of a sliding loop grows by lambda a sample, w' Phi J = lambda w', and |f| <= Fs takes off it at most
what a support function says: beyond that the motion diverges with every such friction. A stable one keeps the position
within Fs times the integral of the absolute kernel from friction to position.

Every integral is taken from above: over a piece of length h, int |g| <= sqrt(h int g^2) (Cauchy and Schwarz), and int
g^2 is a quadratic form that a matrix exponential gives exactly, however often g turns its sign. The rest of a series
is bounded by a Lyapunov function. Pieces only make the bound tight.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import eig, expm, solve_discrete_lyapunov

from nlfrf.shared.values import value
from robust.sliding.loop import SlidingLoop
from robust.systems.lti import evened

__all__ = ["hunting_bound", "sure_kick"]

PIECES = 32  # of a sampling period, or of half a swing of the fastest mode
MOST_PIECES = 4096  # of a period
MOST_PERIODS = 200_000
MOST_WORK = 1e10  # multiplications
TAIL = 1e-4
ROUNDING = 1 + 1e-6  # outward
BEYOND = 1e-9  # a pole closer to the unit circle may lie on either side


@value
class Pieces:
    """A period of a loop cut into pieces.

    Fields
    ------
    map : (n, n) ndarray
        The state a period on.
    kernel : (n, P n) ndarray
        What the friction of each piece makes of the state at its end, n columns a piece: for any row r,
        int |r g| over piece p is at most the norm of (r kernel) in its columns.
    reads : (R, n) ndarray
        The position at the ends of the pieces, of the state at the begin of the period.
    within : (R,) ndarray
        What 1 N in the pieces of the period before each makes of it, at most.
    bends, bends_within : ndarray
        The acceleration at the ends of the pieces, likewise.
    longest : float
        Length of the longest piece [s].
    """

    map: np.ndarray
    kernel: np.ndarray
    reads: np.ndarray
    within: np.ndarray
    bends: np.ndarray
    bends_within: np.ndarray
    longest: float


def sure_kick(loop: SlidingLoop, direction: np.ndarray, Fs: float) -> float:
    """Least multiple of a state from which the motion surely diverges with every |f| <= Fs; inf where none does.

    Also inf where it would take too many pieces to tell.
    """
    cut = pieces(loop)
    if cut is None:
        return np.inf
    poles, left = eig(cut.map.T)
    least = np.inf
    for pole, w in zip(poles, left.T, strict=True):
        if np.abs(pole) <= 1 + BEYOND or pole.imag < 0:
            continue
        reach = w @ direction
        if not np.abs(reach) > 1e-14 * np.linalg.norm(w) * np.linalg.norm(direction):
            continue
        parts = (w @ cut.kernel / pole).reshape(-1, loop.F.shape[0])
        phases = -np.angle(reach) + (np.linspace(-0.6, 0.6, 31) if pole.imag else np.zeros(1))
        taken = support(np.exp(1j * phases), pole, parts)
        least = min(least, float((taken / np.cos(phases + np.angle(reach))).min() / np.abs(reach)))
    return Fs * least * ROUNDING


def support(turn: np.ndarray, pole: complex, parts: np.ndarray) -> np.ndarray:
    """(P,) not less than sum over samples k and pieces of |Re(turn pole^-k parts)|, the rest of the series bounded."""
    total = np.zeros(turn.size)
    affordable = MOST_WORK / (40 * turn.size * parts.size)
    periods = int(max(1, min(MOST_PERIODS, affordable, np.ceil(np.log(1 / TAIL) / np.log(np.abs(pole))))))
    at_once = max(1, int(4e6 / (turn.size * parts.size)))
    for first in range(0, periods, at_once):
        powers = complex(pole) ** -np.arange(first, min(first + at_once, periods), dtype=float)
        turned = turn[:, None, None, None] * powers[:, None, None] * parts
        total += np.linalg.norm(turned.real, axis=-1).sum(axis=(1, 2))
    rest = np.abs(pole) ** -float(periods) / (1 - 1 / np.abs(pole))
    return np.asarray(total + rest * np.linalg.norm(parts, axis=-1).sum())


def hunting_bound(loop: SlidingLoop) -> float:
    """[m/N] how far from rest any friction of at most 1 N keeps a stable loop, in the end.

    inf where the loop is not stable by more than its rounding, or where it would take too many pieces or periods.
    """
    cut = pieces(loop)
    if cut is None:
        return np.inf
    positions = absolute_sum(cut, cut.reads, cut.within)
    if not loop.T:  # nothing tells one instant from another
        return float(positions.max() * ROUNDING)
    if not np.isfinite(positions).all():
        return np.inf
    # between two readings the position leaves its chord by at most h^2/8 times the acceleration: twice the most read
    bend = 2 * (absolute_sum(cut, cut.bends, cut.bends_within).max() + np.abs(loop.v @ loop.B))
    return float((positions.max() + cut.longest**2 / 8 * bend) * ROUNDING)


def absolute_sum(cut: Pieces, rows: np.ndarray, within: np.ndarray) -> np.ndarray:
    """(R,) not less than the integral of |kernel| from the friction, of all the past, to each reading."""
    state, norm = cut.kernel, lyapunov_norm(cut.map)
    if norm is None:
        return np.full(rows.shape[0], np.inf)
    factor, inverse, rate = norm
    n = cut.map.shape[0]
    weight = np.linalg.norm(rows @ inverse, axis=1) / (1 - rate)
    total = within
    for k in range(int(min(MOST_PERIODS, MOST_WORK / (rows.shape[0] * state.size)))):
        if k % 8 == 0:  # what is left: |r Phi^k x| <= |r| rate^k |x| in the norm in which the map shrinks
            rest = weight * np.linalg.norm((factor @ state).reshape(n, -1, n), axis=(0, 2)).sum()
            if (rest <= TAIL * total.max()).all():
                return np.asarray(total + rest)
        total = total + over_pieces(rows, state)
        state = cut.map @ state
    return np.full(rows.shape[0], np.inf)


def over_pieces(rows: np.ndarray, kernel: np.ndarray) -> np.ndarray:
    """(R,) sums of the norms of (rows kernel) over the columns of each piece."""
    n = kernel.shape[0]
    blocks = np.array_split(rows, 1 + rows.shape[0] * kernel.shape[1] // 4_000_000)
    return np.concatenate(
        [np.linalg.norm((block @ kernel).reshape(block.shape[0], -1, n), axis=2).sum(axis=1) for block in blocks]
    )


def lyapunov_norm(period: np.ndarray) -> tuple[np.ndarray, np.ndarray, float] | None:
    """A norm |L x| in which a stable map shrinks by a rate below one: L, its inverse, the rate; None where none is."""
    scaled, weights = evened(period)
    goal = 1 - 0.75 * (1 - np.abs(np.linalg.eigvals(scaled)).max(initial=0.0))
    if not 0 < goal < 1 or MOST_PERIODS * (1 - goal) < 1:
        return None
    try:
        P = solve_discrete_lyapunov((scaled / goal).T, np.eye(scaled.shape[0]))
        L = np.linalg.cholesky((P + P.T) / 2).T
        back = np.linalg.inv(L)
    except np.linalg.LinAlgError:
        return None
    rate = float(np.linalg.norm(L @ scaled @ back, 2))
    rounding = np.finfo(float).eps * np.linalg.norm(L, 2) * np.linalg.norm(back, 2)
    return (L / weights, weights[:, None] * back, rate) if rounding < 1e-3 * (1 - rate) else None


def pieces(loop: SlidingLoop) -> Pieces | None:
    """A period cut so that neither the clock nor the fastest mode gets far in a piece; None where they are too many.

    The period of a continuous loop is half a swing of its fastest mode.
    """
    n = loop.F.shape[0]
    fastest = np.abs(np.linalg.eigvals(loop.F)).max(initial=0.0)
    if not loop.T:
        T = np.pi / fastest if fastest else 1.0
        spans, jumps = np.array([T]), np.eye(n)[None]
    else:
        T, spans, jumps = loop.T, loop.spans, loop.jumps
    counts = np.maximum(2, np.ceil(PIECES * spans * max(1 / T, fastest / np.pi) * (1 - 1e-12)))
    if not counts.sum() <= MOST_PIECES:
        return None
    read = np.array([loop.x, loop.v @ loop.F])  # position and acceleration
    map_, kernel, ends, within = np.eye(n), np.zeros((n, 0)), [], []
    for span, jump, count in zip(spans, jumps, counts.astype(int), strict=True):
        flow, push = flow_and_push(loop.F, loop.B, span / count)
        map_, kernel = jump @ map_, jump @ kernel
        for _ in range(count):
            map_, kernel = flow @ map_, np.hstack([flow @ kernel, push])
            ends.append(read @ map_)
            within.append(over_pieces(read, kernel))
    kept = slice(None) if loop.T else slice(-1, None)
    reads, sums = np.array(ends)[kept], np.array(within)[kept]
    return Pieces(
        map=map_,
        kernel=kernel,
        reads=reads[:, 0],
        within=sums[:, 0],
        bends=reads[:, 1],
        bends_within=sums[:, 1],
        longest=float((spans / counts).max()),
    )


def flow_and_push(F: np.ndarray, B: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray]:
    """exp(F h), and a matrix G with h int_0^h exp(F s) B B' exp(F s)' ds = G G' (Van Loan 1978)."""
    n = F.shape[0]
    block = np.zeros((2 * n, 2 * n))
    block[:n, :n], block[:n, n:], block[n:, n:] = -F, np.outer(B, B), F.T
    both = expm(block * h)
    flow = both[n:, n:].T
    gram = h * flow @ both[:n, n:]
    # in units in which every state is moved alike, as eigenvalues are as good as the largest
    unit = np.sqrt(np.maximum(np.diag(gram), 0))
    per_unit = np.divide(1.0, unit, out=np.zeros(n), where=unit > 0)
    sizes, turns = np.linalg.eigh((gram + gram.T) / 2 * np.outer(per_unit, per_unit))
    return flow, unit[:, None] * turns * np.sqrt(np.maximum(sizes, 0) + 4 * n * np.finfo(float).eps * sizes.max())
