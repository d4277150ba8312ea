"""How hard a kick a stored energy allows an actuator: it falls, and what is asked for is bounded by it.

At rest and relaxed, a kick e v0 puts in v0^2 e'P e at most, at whatever instant. The force that is asked for is
asked'y + h, with h what holds the friction, and |asked'y| <= sqrt(c asked'E^-1 asked) where the energy E <= c.
"""

from __future__ import annotations

import numpy as np

from robust.storage.search import Energy

__all__ = ["kick_within"]

INWARD = 0.99  # far more than the rounding in E^-1


def kick_within(energy: Energy, asked: np.ndarray, hit: np.ndarray, reach: float) -> float:
    """[m/s] up to which a kick leaves |asked'y| below a reach [N]; hit : (n,) what 1 m/s is of the states.

    Infinite where nothing is asked for, whatever the state.
    """
    if not asked.any():
        return np.inf
    size = energy.V.shape[0]
    read = np.zeros(energy.stored.shape[0])
    read[:size] = energy.V.T @ asked
    whole = energy.stored.copy()
    whole[:size, :size] += energy.P[-1, -1]  # just before a sample, where the force is asked for
    unit = 1 / np.sqrt(np.diag(whole))
    asked_for = (unit * read) @ np.linalg.solve(whole * np.outer(unit, unit), unit * read)
    start = np.linalg.solve(energy.V, hit)
    put_in = float(np.einsum("i,...ij,j", start, energy.P, start).max())
    return float(INWARD * reach / np.sqrt(asked_for * put_in))
