"""Friction as a spring and a damper at the levels that were measured: what is left once the machine is taken off.

At an amplitude a and a frequency w the first harmonic of the friction is (k_eq + j w c_eq) times that of the motion.
Friction is the force without its viscous part, which belongs to the machine.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nlfrf import Bla
from nlfrf.shared.values import value
from nlfrf.shared.wording import shown
from robust.sliding.machine import SlidingMachine

__all__ = ["Levels", "levels_of", "port_responses"]

AROUND = (0.3, 2.0)  # of the resonance: the lines that are fitted
FEWEST_LINES = 8


@value
class Levels:
    """Spring and damper of the friction at the amplitudes that were measured, smallest first.

    Fields
    ------
    amplitude : (L,) ndarray
        sqrt(2) times the rms displacement at the port [m].
    stiffness, damping : (L,) ndarray
        k_eq [N/m] and c_eq [Ns/m].
    stiffness_std : float
        Standard deviation of k_eq [N/m] at the highest level, by what the fit leaves.
    """

    amplitude: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    stiffness_std: float

    def at(self, amplitudes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """k_eq and c_eq at other amplitudes: straight over log a, constant below, falling as 1/a beyond the top."""
        beyond = np.minimum(1.0, self.amplitude[-1] / amplitudes)
        where = np.log(amplitudes), np.log(self.amplitude)
        return np.interp(*where, self.stiffness) * beyond, np.interp(*where, self.damping) * beyond


def levels_of(blas: Sequence[Bla], machine: SlidingMachine) -> Levels:
    """What is left of measured levels once the machine is taken off, as a spring and a damper at each.

    With the friction N at its port the FRF is G_l = G_ym - G_yp N G_xm / (1 + N G_xp), m the force and p the friction
    port: solved for N on each line, fitted by k_eq + j w c_eq around the resonance, weighted by what it does to G_l.
    """
    rows = []
    for bla in blas:
        if not isinstance(bla, Bla):
            raise ValueError(f"friction must be a law or BLAs from nlfrf.identify, got {shown(bla)}")
        peak = bla.omega[int(np.argmax(np.abs(bla.G)))]
        chosen = (bla.omega > AROUND[0] * peak) & (bla.omega < AROUND[1] * peak)
        if np.count_nonzero(chosen) < FEWEST_LINES:
            raise ValueError(
                f"friction must be BLAs with at least {FEWEST_LINES} lines around the resonance, got "
                f"{np.count_nonzero(chosen)}"
            )
        omega, measured = bla.omega[chosen], bla.G[chosen]
        ym, yp, xm, xp = port_responses(machine, omega)
        away = ym - measured
        N = away / (yp * xm - away * xp)
        weight = np.sqrt(np.abs(yp * xm / (1 + N * xp) ** 2))
        table = np.column_stack([weight, 1j * omega * weight])
        table, wanted = np.vstack([table.real, table.imag]), N * weight
        wanted = np.concatenate([wanted.real, wanted.imag])
        (k, c), *_ = np.linalg.lstsq(table, wanted, rcond=None)
        left = np.linalg.norm(wanted - table @ [k, c]) / np.sqrt(wanted.size - 2)
        swing = np.sqrt((np.abs(bla.levels.excited) ** 2).sum(axis=1).mean())
        std = left / np.linalg.norm(table[:, 0])
        rows.append((float(swing * at_port(xm, ym, peak, omega)), float(k), float(c), float(std)))
    if not rows:
        raise ValueError("friction must be a law or at least one BLA, got none")
    amplitude, k, c, std = np.array(sorted(rows)).T
    return Levels(amplitude=amplitude, stiffness=k, damping=c, stiffness_std=float(std[-1]))


def at_port(port: np.ndarray, measured: np.ndarray, peak: float, omega: np.ndarray) -> float:
    """Displacement at the port over the measured one, where they swing most."""
    i = int(np.argmin(np.abs(omega - peak)))
    return float(np.abs(port[i] / measured[i]))


def port_responses(machine: SlidingMachine, omega: np.ndarray) -> tuple[np.ndarray, ...]:
    """(W,) each: measured over force, measured over port force, port displacement over force, over port force."""
    n = machine.A.shape[0]
    pencil = 1j * omega[:, None, None] * (1 + 1e-9) * np.eye(n) - machine.A
    push = np.broadcast_to(np.column_stack([machine.B_force, machine.B_port]).astype(complex), (omega.size, n, 2))
    moved = np.linalg.solve(pencil, push)
    seen = np.vstack([machine.C_measured, machine.C_port]) @ moved
    return seen[:, 0, 0], seen[:, 0, 1], seen[:, 1, 0], seen[:, 1, 1]
