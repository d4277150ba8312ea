"""An actuator that saturates: how hard a kick may be so that a proof never asks it for more than it has.

The stored energy of a proof, E(z, rest), only falls. At rest and relaxed, a kick e v0 puts in v0^2 e'P e at most.
The force that is asked for is a'y + (a'xi_e) f_rest with |f_rest| <= Fs, and a'y is at most sqrt(c a'E^-1 a) where
E <= c. Up to the kick at which both add up to the limit the actuator stays linear, and the proof is one of the
saturated loop too: a local one. Beyond it nothing is said.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from robust.sliding.loop import SlidingLoop
from robust.sliding.machine import SlidingMachine
from robust.storage.search import Energy

__all__ = ["kick_within"]

INWARD = 0.99  # far more than the rounding in E^-1


def kick_within(machine: SlidingMachine, K: Any, loop: SlidingLoop, energy: Energy, Fs: float, limit: float) -> float:
    """[m/s] up to which a kick at the friction port leaves the actuator below its limit [N]; 0 where no kick does."""
    n, size = machine.A.shape[0], energy.V.shape[0]
    asked, hit = np.zeros(size), np.zeros(size)
    asked[:n] = -K.D[0, 0] * machine.C_measured
    own = slice(loop.F.shape[0] - K.nstates, loop.F.shape[0])
    asked[own] = K.C[0] if K.nstates else 0.0
    if not machine.velocity @ machine.B_port > 0:
        return 0.0
    hit[:n] = machine.B_port / (machine.velocity @ machine.B_port)
    left = limit - Fs * abs(float(asked[: loop.F.shape[0]] @ loop.rest()[0]))
    if left <= 0:
        return 0.0
    read = np.zeros(energy.stored.shape[0])
    read[:size] = energy.V.T @ asked
    whole = energy.stored.copy()
    whole[:size, :size] += energy.P[-1, -1]  # just before a sample, where the force is asked for
    unit = 1 / np.sqrt(np.diag(whole))
    reach = (unit * read) @ np.linalg.solve(whole * np.outer(unit, unit), unit * read)
    start = np.linalg.solve(energy.V, hit)
    put_in = float(np.einsum("i,...ij,j", start, energy.P, start).max())
    return float(INWARD * left / np.sqrt(reach * put_in))
