"""A bound on the worst gain over a set at all frequencies, from several scalings (SP 8.10.3).

The gain stays below gamma if mu with an additional full block for the performance, whose inputs are
divided by gamma, stays below one. A scaling is computed where nothing is proved yet, and exact
arithmetic gives the ranges of the axis on which it holds (`robust.mu.pieces`). The remaining ranges
are covered by other scalings, each from a frequency inside. If no scaling proves gamma at a
frequency, the bound there is the next gamma.
"""

from __future__ import annotations

import time

import control
import numpy as np

from robust._base.types import Blocks
from robust.lti.lti import response_by_channel, timebase
from robust.mu.blocks import block_structure, with_performance_block
from robust.mu.gain import gain_bound
from robust.mu.pieces import cut_by_scaling
from robust.mu.scalings import upper_bound
from robust.proofs.exact.bands import TransferMatrix, frequency_of_point, points_of_band, to_float
from robust.proofs.exact.claim import to_matrices
from robust.proofs.exact.polynomials import polynomial_roots
from robust.proofs.search.bands import TIME_CAP, GainBound

_TOLERANCE = 1e-3  # between the bound at all frequencies and the largest at one
_N_STARTS = 12  # frequencies for a first level, most of them at poles


def bound_set_gain(
    N: control.StateSpace, blocks: Blocks, *, time_cap: float = TIME_CAP
) -> GainBound:
    """Bound the largest gain from the inputs to the outputs that no block closes, over full blocks
    of size at most one.

    Returns
    -------
    GainBound
        upper : proved at every frequency. lower : the least gain that scalings prove at omega,
        where it is largest: the worst gain itself for up to three blocks, with that of performance.
        Both are inf if a plant may be unstable.

    Examples
    --------
    S of L = 1/s with an input error of 50 % at any phase: the worst of omega/(|1 + j omega| - 0.5)
    is 2/sqrt(3).

    >>> N = control.ss([[-1.0]], [[1.0, 1.0]], [[-0.5], [-1.0]], [[0.0, 0.5], [0.0, 1.0]])
    >>> found = bound_set_gain(N, [(1, 1)])
    >>> bool(2 / np.sqrt(3) <= found.upper < 1.0011 * 2 / np.sqrt(3)), round(found.omega, 1)
    (True, 1.7)
    """
    deadline, dt = time.thread_time() + time_cap, timebase(N)
    H, cols = TransferMatrix.of(to_matrices(N)), sum(block[1] for block in blocks)
    whole, _ = with_performance_block(blocks, (N.noutputs, N.ninputs))
    s = block_structure("blocks", whole)
    omega = _starting_points(H, dt)
    gains = gain_bound(response_by_channel(N, omega), blocks)
    lower, peak = float(gains.max()), float(omega[gains.argmax()])
    level, todo = lower * (1 + _TOLERANCE), [(0.0, np.inf, points_of_band((peak, peak), dt)[0])]
    while todo and np.isfinite(level):
        low, high, x = todo.pop()
        here, units = frequency_of_point(x, dt), np.where(np.arange(N.ninputs) < cols, 1.0, level)
        M = np.moveaxis(response_by_channel(N, np.array([here])), 2, 0)
        found = upper_bound(M / units, whole, target=1.0)
        proved = found.value[0] < 1
        if proved:
            pieces = cut_by_scaling(
                H, s, found, units=units, x=x, band=(low, high), deadline=deadline
            )
            if isinstance(pieces, str):
                return GainBound(upper=np.inf, lower=lower, omega=peak, reason=pieces)
            rest = [piece for piece in pieces if not piece.M.is_positive]
            todo += [(piece.low, piece.high, to_float(piece.x)) for piece in rest]
            proved = not any(piece.low <= x <= piece.high for piece in rest)
        if not proved:  # no scaling proves it here, or only by less than rounding
            todo += [(low, high, x)] * (not found.value[0] < 1)
            gain = float(gain_bound(M.transpose(1, 2, 0), blocks)[0])
            if gain > lower:
                lower, peak = gain, here
            else:
                lower, peak = lower, peak
            level = max(level, lower) * (1 + _TOLERANCE)
    return GainBound(upper=level, lower=lower, omega=peak)


def _starting_points(H: TransferMatrix, dt: float) -> np.ndarray:
    """Return frequencies [rad/s] of poles, the most lightly damped first, for a first level."""
    s = polynomial_roots(H.characteristic)
    s = s[np.argsort(np.abs(s.real) / np.abs(s))][:_N_STARTS]
    return np.array([frequency_of_point(float(x), dt) for x in np.unique(np.abs(s))] or [1.0])
