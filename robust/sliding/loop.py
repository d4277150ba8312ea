"""The sliding loop between its samples and at them: linear flows, and the jumps of the controller.

Flow xi' = F xi + B f over a span, jump xi+ = J xi before it. The state xi is that of the machine, the held force, the
forces that wait for the delay to pass, and the controller. Nothing is cancelled: the controller is used as given.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg import expm

from nlfrf.shared.values import value
from robust.sliding.machine import SlidingMachine, separate_delay
from robust.systems.lti import timebase
from robust.systems.realisation import state_space

__all__ = ["SlidingLoop", "sliding_loop"]

EPS = np.finfo(float).eps
LONGEST_DELAY = 20  # samples


@value
class SlidingLoop:
    """A loop around a machine without friction, and how a friction f at its port would drive it.

    Fields
    ------
    F : (n, n) ndarray
        Flow between the samples; the whole loop where the controller is continuous.
    B : (n,) ndarray
        How the friction enters: xi' = F xi + B f.
    x, v : (n,) ndarray
        Displacement and velocity at the friction port.
    T : float
        Sampling time [s]; zero for a continuous controller.
    spans : (S,) ndarray
        How long each flow lasts [s].
    jumps : (S, n, n) ndarray
        What happens before each.
    measured : (n,) ndarray
        The measured position.
    """

    F: np.ndarray
    B: np.ndarray
    x: np.ndarray
    v: np.ndarray
    T: float
    spans: np.ndarray
    jumps: np.ndarray
    measured: np.ndarray

    def period(self, kappa: float = 0.0, damper: float = 0.0) -> np.ndarray:
        """(n, n) one sample on, from just before the jump, with a spring and a damper at the port; F if continuous."""
        F = self.F + np.outer(self.B, kappa * self.x + damper * self.v)
        if not self.T:
            return F
        total = np.eye(F.shape[0])
        for span, jump in zip(self.spans, self.jumps, strict=True):
            total = expm(span * F) @ jump @ total
        return total

    def poles(self, kappa: float = 0.0, damper: float = 0.0) -> np.ndarray:
        """Poles of the loop with a spring and a damper at its port: of one period where sampled."""
        return np.linalg.eigvals(self.period(kappa, damper))

    def growth(self, kappa: float = 0.0, damper: float = 0.0) -> float:
        """Largest |pole| less one, or largest real part: negative where the loop is stable."""
        poles = self.poles(kappa, damper)
        return float(np.abs(poles).max() - 1 if self.T else poles.real.max())

    def rest(self) -> tuple[np.ndarray, np.ndarray]:
        """(n,) where the loop comes to rest under f = 1 N, and how far each entry of it may be off."""
        unit_time = self.T or 1.0
        own = np.eye(self.F.shape[0])
        conditions = np.vstack([self.F * unit_time, *(jump - own for jump in self.jumps)])
        wanted = np.concatenate([-self.B * unit_time, np.zeros(conditions.shape[0] - self.F.shape[0])])
        unit = np.linalg.norm(conditions, axis=0)
        unit[unit == 0] = 1.0  # a state that may rest anywhere
        inverse = np.linalg.pinv(conditions / unit, rcond=1e-15) / unit[:, None]
        there = inverse @ wanted
        for _ in range(2):
            there += inverse @ (wanted - conditions @ there)
        left = np.abs(conditions @ there - wanted) + there.size * EPS * (np.abs(conditions) @ np.abs(there))
        return there, 2 * np.abs(inverse) @ left


def sliding_loop(machine: SlidingMachine, K: Any, delay: float = 0.0) -> SlidingLoop:
    """The loop u = -K y around a machine, through sampler, delay [s] and hold where K is sampled.

    The delay of the machine itself is added to it.

    >>> from robust.sliding.machine import sliding_machine
    >>> loop = sliding_loop(sliding_machine(1.0, 80e3, 0.4), 0.0)
    >>> round(loop.growth(), 3)                                    # -c / 2m: nothing but the damping of the rig
    -0.2
    """
    K = state_space("K", K)
    machine, delay = separate_delay(machine, delay)
    T = timebase(K)
    if not T:
        if delay:
            raise ValueError(f"delay must be 0 s with a continuous controller, got {delay:g} s. Sample it first")
        return continuous_loop(machine, K)
    whole = int(np.floor(delay / T + 1e-9))
    part = max(0.0, delay - whole * T)
    part = 0.0 if part < 1e-9 * T else part
    if whole > LONGEST_DELAY:
        raise ValueError(f"delay must be at most {LONGEST_DELAY} samples of {T:g} s, got {delay:g} s")
    n, s, waiting = machine.A.shape[0], K.nstates, whole + (part > 0)
    size = n + 1 + waiting + s
    held, queue, own = n, slice(n + 1, n + 1 + waiting), slice(n + 1 + waiting, size)
    F = np.zeros((size, size))
    F[:n, :n], F[:n, held] = machine.A, machine.B_force
    asked = np.zeros(size)  # u = K (0 - y), of the state before the jump
    asked[own] = K.C[0] if s else 0.0
    asked[:n] -= K.D[0, 0] * machine.C_measured
    jump = np.eye(size)
    jump[own, own] = K.A
    jump[own, :n] = -np.outer(K.B[:, 0], machine.C_measured) if s else 0.0
    line = np.vstack([asked, np.eye(size)[queue]])  # the new force, then those that wait, oldest last
    jump[queue] = line[:waiting]
    jumps, spans = [jump], [T]
    if part:
        late = np.eye(size)
        late[held] = np.eye(size)[n + waiting]
        jumps, spans = [jump, late], [part, T - part]
    else:
        jump[held] = line[waiting]
    return SlidingLoop(
        F=F,
        B=padded(-machine.B_port, size),
        x=padded(machine.C_port, size),
        v=padded(machine.velocity, size),
        T=T,
        spans=np.array(spans),
        jumps=np.array(jumps),
        measured=padded(machine.C_measured, size),
    )


def continuous_loop(machine: SlidingMachine, K: Any) -> SlidingLoop:
    """The loop with a continuous controller: one flow, no jump."""
    n, s = machine.A.shape[0], K.nstates
    F = np.zeros((n + s, n + s))
    F[:n, :n] = machine.A - K.D[0, 0] * np.outer(machine.B_force, machine.C_measured)
    if s:
        F[:n, n:] = np.outer(machine.B_force, K.C[0])
        F[n:, :n], F[n:, n:] = -np.outer(K.B[:, 0], machine.C_measured), K.A
    return SlidingLoop(
        F=F,
        B=padded(-machine.B_port, n + s),
        x=padded(machine.C_port, n + s),
        v=padded(machine.velocity, n + s),
        T=0.0,
        spans=np.zeros(0),
        jumps=np.zeros((0, n + s, n + s)),
        measured=padded(machine.C_measured, n + s),
    )


def padded(part: np.ndarray, size: int) -> np.ndarray:
    """A vector of the machine as one of the loop."""
    return np.concatenate([part, np.zeros(size - part.size)])
