"""What a friction that is only known to be bounded cannot do: stop a run-away, or hunt further than this.

The unstable part of a sliding loop grows by lambda a sample, w' Phi J = lambda w', and |f| <= Fs takes off it at most
what a support function says: beyond that the motion diverges with every such friction. A stable one keeps the position
within Fs times the integral of the absolute kernel from friction to position.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import eig, expm

from robust.sliding.loop import SlidingLoop

__all__ = ["hunting_bound", "sure_kick"]

PIECES = 32  # of a sampling period, or of the fastest swing
MOST_PERIODS = 200_000
TAIL = 1e-5
OUTWARD = 1 + 1e-3  # what the pieces may miss where a kernel turns its sign within one


def sure_kick(loop: SlidingLoop, direction: np.ndarray, Fs: float) -> float:
    """Least multiple of a state from which the motion surely diverges with every |f| <= Fs; inf where none does."""
    period, kernel, _ = pieces(loop)
    poles, left = eig(period.T)
    least = np.inf
    for pole, w in zip(poles, left.T, strict=True):
        if np.abs(pole) <= 1 + 1e-12 or pole.imag < 0:
            continue
        reach = w @ direction
        if not np.abs(reach) > 1e-14 * np.linalg.norm(w) * np.linalg.norm(direction):
            continue
        parts = w @ kernel / pole
        phases = -np.angle(reach) + (np.linspace(-0.6, 0.6, 31) if pole.imag else np.zeros(1))
        taken = support(np.exp(1j * phases), pole, parts)
        least = min(least, float((taken / np.cos(phases + np.angle(reach))).min() / np.abs(reach)))
    return Fs * least * OUTWARD


def support(turn: np.ndarray, pole: complex, parts: np.ndarray) -> np.ndarray:
    """(P,) sum over all samples k of sum |Re(turn pole^-k parts)|, the rest of the series bounded."""
    total = np.zeros(turn.size)
    periods = int(min(MOST_PERIODS, np.ceil(np.log(1 / TAIL) / np.log(np.abs(pole)))))
    for block in np.array_split(np.arange(periods), max(1, periods // 256)):
        terms = (pole ** -block.astype(float))[:, None] * parts
        total += np.abs((turn[:, None, None] * terms).real).sum(axis=(1, 2))
    rest = np.abs(pole) ** -periods / (1 - 1 / np.abs(pole))
    return np.asarray(total + rest * np.abs(parts).sum())


def hunting_bound(loop: SlidingLoop) -> float:
    """[m/N] how far from rest any friction of at most 1 N keeps a stable loop, in the end."""
    period, kernel, reads = pieces(loop)
    growth = np.abs(np.linalg.eigvals(period)).max()
    if growth >= 1:
        return np.inf
    # within the period that is read: what came before the reading
    total = np.array([np.abs(own).sum() for _, own in reads])
    rows = np.array([row for row, _ in reads])
    state = kernel
    for _ in range(MOST_PERIODS):
        part = np.abs(rows @ state).sum(axis=1)
        total = total + part
        if part.max() / (1 - growth) < 1e-6 * total.max():
            break
        state = period @ state
    return float(total.max() * OUTWARD)


def pieces(
    loop: SlidingLoop,
) -> tuple[np.ndarray, np.ndarray, list[tuple[np.ndarray, np.ndarray]]]:
    """A period cut into pieces: its map, what 1 N over each makes of the state at its end, and readings.

    A reading is the position at the end of a piece: of the state at the begin of the period, and of the pieces of this
    period before it. A continuous loop is cut by the fastest of its poles.
    """
    n = loop.F.shape[0]
    if not loop.T:
        T = np.pi / np.abs(loop.poles()).max()
        spans, jumps = np.array([T]), np.eye(n)[None]
    else:
        T, spans, jumps = loop.T, loop.spans, loop.jumps
    map_, kernel, reads = np.eye(n), np.zeros((n, 0)), []
    for span, jump in zip(spans, jumps, strict=True):
        count = max(2, round(PIECES * span / T))
        block = np.zeros((n + 1, n + 1))
        block[:n, :n], block[:n, n] = loop.F, loop.B
        both = expm(block * (span / count))
        flow, push = both[:n, :n], both[:n, n]
        map_, kernel = jump @ map_, jump @ kernel
        for _ in range(count):
            map_, kernel = flow @ map_, np.column_stack([flow @ kernel, push])
            reads.append((loop.x @ map_, loop.x @ kernel))
    return map_, kernel, reads
