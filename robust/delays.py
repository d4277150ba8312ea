"""What a delay does to the poles of a continuous loop, exactly: from no delay on, they cross the axis where |L| = 1.

A pole of 1 + L exp(-s tau) lies at j omega only where |L(j omega)| = 1, at the delays that turn L there to -1; as tau
grows past them it moves out where |L| falls and in where |L| rises (Walton & Marshall, *IEE Proceedings D* 134, 1987).
"""

from __future__ import annotations

import control
import numpy as np

from robust.lti import response
from robust.norms import crossings


def moved_out(L: control.StateSpace, delay: float) -> float:
    """How many poles of 1 + L exp(-s delay) the delay [s] moves out of the left half plane, less those it moves in.

    inf where |L| > 1 at infinite frequency, nan where rounding decides.

    >>> moved_out(control.ss(control.tf([5], [1, 1])), 0.36), moved_out(control.ss(control.tf([5], [1, 1])), 0.37)
    (0.0, 2.0)
    """
    direct = abs(float(L.D[0, 0]))
    found = crossings((L.A, L.B, L.C, L.D), 1.0)
    if direct > 1 or found is None:
        return np.inf if direct > 1 + 1e-9 else np.nan
    clusters = apart(*found)
    if not clusters:
        return 0.0
    low, high = np.array(clusters).T
    between = np.concatenate([[low[0] / 2], np.sqrt(high[:-1] * low[1:]), [2 * high[-1]]])
    above = np.abs(response(L, between)) > 1
    total = 0.0
    for k, ends in enumerate(np.column_stack([np.maximum(low, high * 1e-9), high])):
        turned = (np.angle(response(L, ends)) + np.pi) % (2 * np.pi)
        passed = np.floor((ends * delay - turned) / (2 * np.pi)) + 1
        if passed[0] != passed[1]:
            return np.nan
        if low[k] > 0:
            total += 2 * passed[0] * (int(above[k]) - int(above[k + 1]))
        elif passed[0] > 0:
            return np.nan
    return float(total)


def apart(omega: np.ndarray, moved: np.ndarray) -> list[tuple[float, float]]:
    """Intervals in which the crossings lie, those that overlap put together."""
    out: list[tuple[float, float]] = []
    for k in np.argsort(omega - moved):
        low, high = max(0.0, float(omega[k] - moved[k])), float(omega[k] + moved[k])
        if out and low <= out[-1][1]:
            out[-1] = (out[-1][0], max(high, out[-1][1]))
        elif high > 0:
            out.append((low, high))
    return out
