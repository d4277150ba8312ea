"""The worst gain over a set at all frequencies: bounded by scalings, each proved where it holds (SP 8.10.3).

With X > 0 that commutes with the perturbations, the gain stays below gamma where

    diag(X_R, gamma^2) - N~ diag(X_L, 1) N >= 0.

A scaling is taken where nothing is proved yet, and exact arithmetic says on which stretches of the axis it holds
(`robust.proofs.exact.bands`). What is left is covered by others, from where they are best; where no scaling proves
gamma, the bound there is the next gamma.
"""

from __future__ import annotations

import time
from collections.abc import Sequence

import control
import numpy as np

from robust._base.types import Blocks
from robust.lti.lti import poles, response_by_channel, timebase, to_s_plane
from robust.mu.gain import gain_bound
from robust.mu.scalings import upper_bound
from robust.proofs.exact.bands import (
    Inequality,
    Pair,
    TransferMatrix,
    cut_at_crossings,
    frequency_of_point,
    points_of_band,
    to_float,
)
from robust.proofs.exact.claim import to_matrices
from robust.proofs.exact.interval_kyp import ExactMatrix
from robust.proofs.exact.polynomials import to_rational_matrix
from robust.proofs.search.bands import TIME_CAP, GainBound

TOLERANCE = 1e-3  # between the bound at all frequencies and the largest at one
N_STARTS = 12  # frequencies at which a first level is found, most of them at poles


def bound_set_gain(N: control.StateSpace, blocks: Blocks, *, time_cap: float = TIME_CAP) -> GainBound:
    """Bound the largest gain from the inputs to the outputs that no block closes, over full blocks of size at most one.

    Returns
    -------
    GainBound
        upper : proved at every frequency. lower : the least that scalings prove at omega, where that is largest: the
        worst gain itself up to three blocks, performance among them. Both are inf where a plant may be unstable.

    Examples
    --------
    S of L = 1/s with an input that is 50 % wrong, at any phase: omega/(|1 + j omega| - 0.5) is 2/sqrt(3) at worst.

    >>> N = control.ss([[-1.0]], [[1.0, 1.0]], [[-0.5], [-1.0]], [[0.0, 0.5], [0.0, 1.0]])
    >>> found = bound_set_gain(N, [(1, 1)])
    >>> bool(2 / np.sqrt(3) <= found.upper < 1.0011 * 2 / np.sqrt(3)), round(found.omega, 1)
    (True, 1.7)
    """
    deadline, dt = time.thread_time() + time_cap, timebase(N)
    H, sizes = TransferMatrix.of(to_matrices(N)), [np.array(each) for each in zip(*blocks, strict=True)]
    whole = np.append(sizes[0], N.noutputs - sizes[0].sum()), np.append(sizes[1], N.ninputs - sizes[1].sum())
    omega = starting_points(N)
    gains = gain_bound(response_by_channel(N, omega), blocks)
    lower, peak = float(gains.max()), float(omega[gains.argmax()])
    level, todo = lower * (1 + TOLERANCE), [(0.0, np.inf, points_of_band((peak, peak), dt)[0])]
    while todo and np.isfinite(level):
        low, high, x = todo.pop()
        here = frequency_of_point(x, dt)
        M = np.moveaxis(response_by_channel(N, np.array([here])), 2, 0)
        M[:, :, sizes[1].sum() :] /= level
        found = upper_bound(M, list(zip(*whole, strict=True)), target=1.0)
        assert found.scaling is not None  # of an upper bound
        proved = found.value[0] < 1
        if proved:
            X = (np.abs(np.diag(found.scaling[0][:, :, 0])) ** 2)[np.cumsum(whole[0]) - 1]
            holds = gain_below_scaled(level, *(np.repeat(X / X[-1], size) for size in whole), n=int(whole[1][-1]))
            pieces = cut_at_crossings([H], holds, low=low, high=high, deadline=deadline)
            if isinstance(pieces, str):
                return GainBound(upper=np.inf, lower=lower, omega=peak, reason=pieces)
            rest = [piece for piece in pieces if not piece.M.is_positive]
            todo += [(piece.low, piece.high, to_float(piece.x)) for piece in rest]
            proved = not any(piece.low <= x <= piece.high for piece in rest)
        if not proved:  # no scaling does here, or it does so by less than rounding
            todo += [(low, high, x)] * (not found.value[0] < 1)
            gain = float(gain_bound(response_by_channel(N, np.array([here])), blocks)[0])
            lower, peak = (gain, here) if gain > lower else (lower, peak)
            level = max(level, lower) * (1 + TOLERANCE)
    return GainBound(upper=level, lower=lower, omega=peak)


def gain_below_scaled(level: float, X_L: np.ndarray, X_R: np.ndarray, *, n: int) -> Inequality:
    """Return diag(X_R, level^2) - N~ diag(X_L, 1) N, of scalings that end in n ones for the performance."""
    right = X_R.copy()
    right[-n:] = level**2
    P, Q = (ExactMatrix.real(to_rational_matrix(np.diag(each))) for each in (X_L, right))

    def inequality(pairs: Sequence[Pair]) -> ExactMatrix:
        H, adjoint = pairs[0]
        return Q - adjoint * P * H

    return inequality


def starting_points(N: control.StateSpace) -> np.ndarray:
    """Return frequencies [rad/s] of poles, the lightest first, for a first level."""
    dt = timebase(N)
    s = to_s_plane(poles(N), dt)
    s = s[np.isfinite(s) & (s.imag >= 0) & (np.abs(s) > 0)]
    s = s[np.argsort(np.abs(s.real) / np.abs(s))][:N_STARTS]
    omega = np.abs(s) if s.size else np.ones(1)
    return np.unique(np.minimum(omega, np.pi / dt) if dt else omega)
