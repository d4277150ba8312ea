"""The loop cut open at an actuator that saturates: what it is asked for, and where what it does not give is missing.

The actuator gives u = sat(asked) and misses w = asked - u, so that y+ = J y - enters w at a sample (y' = F y - enters w
where the controller is continuous). Beside the state of the sliding loop stand filters of the force it gives, which the
proof reads and the machine never sees: u_j+ = u_j + phi_j (u - u_j), or u_j' = phi_j (u - u_j).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from nlfrf.shared.values import value
from robust.sliding.loop import SlidingLoop, sliding_loop
from robust.sliding.machine import SlidingMachine
from robust.systems.realisation import state_space

__all__ = ["CutLoop", "cut_open"]


@value
class CutLoop:
    """A sliding loop with its actuator cut open, and filters beside it.

    Fields
    ------
    loop : SlidingLoop
        With the filters as its last states.
    asked : (n,) ndarray
        The force that is asked for, of the state before a sample.
    enters : (n,) ndarray
        Where what is missed is taken off: at a sample, or of the flow.
    forgets : (J,) ndarray
        How fast the filters forget: a share of each sample, or a rate [1/s].
    """

    loop: SlidingLoop
    asked: np.ndarray
    enters: np.ndarray
    forgets: np.ndarray

    @property
    def filters(self) -> slice:
        """Where the filters stand in the state."""
        return slice(self.asked.size - self.forgets.size, self.asked.size)

    def open_growth(self) -> float:
        """How the loop grows with its actuator cut off, nothing of what is asked for given; negative where it dies."""
        return without_actuator(self).growth()


def cut_open(machine: SlidingMachine, K: Any, delay: float, forgets: np.ndarray | None = None) -> CutLoop:
    """The loop u = -K y cut open at its actuator, with filters that forget as fast as said.

    >>> from robust.sliding.machine import sliding_machine
    >>> cut = cut_open(sliding_machine(1.0, 80e3, 0.4), 2e3, 0.0)
    >>> (0 + cut.asked).tolist(), cut.enters.tolist()  # of displacement and velocity
    ([-2000.0, 0.0], [0.0, 1.0])
    """
    K = state_space("K", K)
    loop = sliding_loop(machine, K, delay)
    forgets = np.zeros(0) if forgets is None else forgets
    n, m, s = machine.A.shape[0], loop.F.shape[0], K.nstates
    size = m + forgets.size
    asked, enters = np.zeros(size), np.zeros(size)
    asked[:n] = -K.D[0, 0] * machine.C_measured
    asked[m - s : m] = K.C[0] if s else 0.0
    if loop.T:
        enters[n + 1 if m > n + 1 + s else n] = 1.0  # the force that waits, or the one that is held
    else:
        enters[:n] = machine.B_force
    enters[m:] = forgets
    F, jumps = widened(loop.F, size), np.array([widened(J, size, 1.0) for J in loop.jumps]).reshape(-1, size, size)
    rows = np.outer(forgets, asked)  # of u = asked - w
    rows[:, m:] -= np.diag(forgets)
    if loop.T:
        jumps[0][m:] += rows
    else:
        F[m:] = rows
    parts = {name: np.pad(getattr(loop, name), (0, size - m)) for name in ("B", "x", "v", "measured")}
    wider = SlidingLoop(F=F, T=loop.T, spans=loop.spans, jumps=jumps, **parts)
    return CutLoop(loop=wider, asked=asked, enters=enters, forgets=forgets)


def without_actuator(cut: CutLoop) -> SlidingLoop:
    """The same with u = 0."""
    loop, missing = cut.loop, np.outer(cut.enters, cut.asked)
    if not loop.T:
        return replace(loop, F=loop.F - missing)
    return replace(loop, jumps=np.concatenate([loop.jumps[:1] - missing, loop.jumps[1:]]))


def widened(M: np.ndarray, size: int, diagonal: float = 0.0) -> np.ndarray:
    """A square matrix as the first part of a larger one, the rest on the diagonal."""
    n = M.shape[0]
    larger = np.diag(np.concatenate([np.zeros(n), np.full(size - n, diagonal)]))
    larger[:n, :n] = M
    return larger
