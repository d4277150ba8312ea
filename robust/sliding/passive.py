"""Every passive friction at once: what of damping a loop has to leave the machine with."""

from __future__ import annotations

import numpy as np

from robust.sliding.loop import SlidingLoop
from robust.sliding.machine import SlidingMachine
from robust.systems.lti import response

__all__ = ["damping_left"]

N_POINTS = 4000


def damping_left(machine: SlidingMachine, K: object, loop: SlidingLoop) -> tuple[float, float, str]:
    """What is left of it, where least [rad/s], and of what it speaks; positive where every passive friction is safe.

    Continuous: the least real part of the mobility of the closed loop over its absolute value. Sampled, force and
    friction at one place: the viscous damping c of a mass on a spring less the least that lets the loop be passive,

        c > (T/2)/(1 - cos wT) Re[(1 - exp(-jwT)) K(exp(jwT))],   0 < w <= pi/T,

    whatever the mass (Colgate & Schenkel 1997).
    """
    if not loop.T:
        fastest = np.abs(loop.poles()).max()
        omega = np.concatenate([np.geomspace(1e-6, 1e3, N_POINTS) * fastest, np.abs(loop.poles())])
        pencil = 1j * omega[:, None, None] * np.eye(loop.F.shape[0]) - loop.F
        column = np.broadcast_to(loop.B.astype(complex)[:, None], (omega.size, loop.B.size, 1))
        mobility = -(np.linalg.solve(pencil, column)[..., 0] @ loop.v)
        share = mobility.real / np.abs(mobility)
        return float(share.min()), float(omega[np.argmin(share)]), "the mobility of the closed loop is positive real"
    collocated = machine.A.shape[0] == 2 and np.array_equal(machine.B_force, machine.B_port)
    if not (collocated and np.array_equal(machine.C_measured, [1.0, 0.0]) and machine.B_port[0] == 0):
        return (
            np.nan,
            np.nan,
            "a sampled loop is decided for one mass with force, friction and sensor at one place only",
        )
    if np.count_nonzero(loop.jumps[0][loop.F.shape[0] - 1]) == 0 or loop.spans.size > 1:
        return np.nan, np.nan, "a delay is not in the criterion"
    omega = np.concatenate([np.geomspace(1e-6, 1, N_POINTS), np.linspace(1e-3, 1, N_POINTS)]) * np.pi / loop.T
    z = np.exp(1j * omega * loop.T)
    needed = loop.T / 2 * ((1 - 1 / z) * response(K, omega)).real / (1 - np.cos(omega * loop.T))
    c = -machine.A[1, 1] / machine.B_port[1]
    worst = int(np.argmax(needed))
    return float(c - needed[worst]), float(omega[worst]), f"c = {c:.4g} Ns/m, and {needed[worst]:.4g} Ns/m are needed"
