"""The linear part of a machine with friction: how it moves while it slides without any."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import control
import numpy as np

from nlfrf.shared.arguments import nonnegative, positive
from nlfrf.shared.values import value
from robust.systems.lti import timebase
from robust.systems.realisation import multivariable
from robust.systems.sampling import without_pade

__all__ = ["SlidingMachine", "separate_delay", "sliding_machine", "with_port_impedance"]

#: A gain is zero when it is this small against what the matrices could make of it.
ROUNDING = 1e-9


@value
class SlidingMachine:
    """A machine without its friction: p' = A p + B_force u - B_port f, with f the friction at its port.

    Fields
    ------
    A : (n, n) ndarray
        Dynamics.
    B_force, B_port : (n,) ndarray
        How the force of the actuator enters, and a force at the friction port [N].
    C_measured, C_port : (n,) ndarray
        The measured position and the displacement at the friction port [m].
    words : str
        What it is, for people.
    delay : float
        From the command to the force, or from the position to its sample [s]; every loop around it has it.
    """

    A: np.ndarray
    B_force: np.ndarray
    B_port: np.ndarray
    C_measured: np.ndarray
    C_port: np.ndarray
    words: str
    delay: float = 0.0

    @property
    def velocity(self) -> np.ndarray:
        """(n,) the velocity at the friction port: x' = velocity @ p, whatever the forces."""
        return self.C_port @ self.A

    @property
    def resonance(self) -> float:
        """The mode that moves the friction port most, [rad/s]; of a free mass zero."""
        poles, modes = np.linalg.eig(self.A)
        try:
            residues = (self.velocity @ modes) * np.linalg.solve(modes, self.B_port.astype(complex))
        except np.linalg.LinAlgError:
            return 0.0
        size = np.where(np.abs(poles) > ROUNDING * np.abs(poles).max(initial=0), np.abs(residues), 0)
        return float(np.abs(poles[np.argmax(size)])) if np.isfinite(size).all() and size.any() else 0.0


def sliding_machine(
    mass: Any, stiffness: float | None = None, damping: float = 0.0, *, port: Any = None
) -> SlidingMachine:
    """The machine without its friction, from mass, stiffness and damping or from a model.

    Parameters
    ----------
    mass : float or control.StateSpace
        [kg]; or a continuous model from force [N] to position [m] with the friction where the force acts; or, with
        `port`, one with several inputs and outputs. A Padé approximation in the former is taken as the delay that it
        stands for, exactly: its zeros in the right half-plane are those of no machine, and no proof is found for them.
    stiffness : float, optional
        Spring to ground [N/m], zero for a free mass; not given with a model.
    damping : float
        Viscous damping [Ns/m].
    port : bool, optional
        True where the friction acts elsewhere than the force: the model then has the inputs (force, force at the
        friction port) and the outputs (measured position, displacement at the friction port).

    Returns
    -------
    SlidingMachine

    Raises
    ------
    ValueError
        A model that is sampled, not strictly proper, or without a velocity at its friction port (a fit needs at least
        two poles more than zeros); a mass that is not positive.

    References
    ----------
    B. Armstrong-Hélouvry, *Control of Machines with Friction*, Kluwer, 1991.

    Examples
    --------
    >>> machine = sliding_machine(1.0, 80e3)
    >>> round(machine.resonance / 2 / np.pi, 1)                    # the sliding rig of the paper resonates at 45 Hz
    45.0
    """
    if isinstance(mass, (control.StateSpace, control.TransferFunction)):
        if stiffness is not None or damping != 0.0:
            raise ValueError("stiffness must be left out with a model, which has its own, got one")
        return from_model(mass, bool(port))
    if port:
        raise ValueError(f"port must be left out with a mass, whose friction acts where the force acts, got {port}")
    mass = positive("mass", mass)
    if stiffness is None:
        raise ValueError("stiffness must be given with a mass [N/m], zero for a free one, got none")
    stiffness, damping = nonnegative("stiffness", stiffness), nonnegative("damping", damping)
    push, place = np.array([0.0, 1 / mass]), np.array([1.0, 0.0])
    A = np.array([[0.0, 1.0], [-stiffness / mass, -damping / mass]])
    words = f"m = {mass:.4g} kg, k = {stiffness / 1e3:.4g} kN/m, c = {damping:.3g} Ns/m"
    return SlidingMachine(A=A, B_force=push, B_port=push, C_measured=place, C_port=place, words=words)


def from_model(model: Any, port: bool) -> SlidingMachine:
    """A state space with one force and one position, or with those of its friction port beside them."""
    G = multivariable("mass", model)
    wanted = 2 if port else 1
    if (G.ninputs, G.noutputs) != (wanted, wanted):
        hint = "(force, port force) to (measured, port displacement)" if port else "force to position"
        raise ValueError(f"mass must be a model from {hint}, got {G.ninputs} inputs and {G.noutputs} outputs")
    if not G.nstates:
        raise ValueError("mass must be a model that moves, from force to position, got a gain without states")
    if timebase(G):
        raise ValueError(f"mass must be a continuous model, got one sampled at dt = {G.dt:g} s. Fit it with dt=0")
    delay = 0.0
    if wanted == 1:
        G, delay = without_pade(G)
    if np.any(G.D != 0):
        raise ValueError(
            "mass must be a strictly proper model, got a direct term. Fit it with two poles more than zeros"
        )
    B, C = np.asarray(G.B, float), np.asarray(G.C, float)
    size = np.linalg.norm(C[-1]) * np.linalg.norm(B, axis=0)
    if np.any(np.abs(C[-1] @ B) > ROUNDING * size):
        raise ValueError(
            "mass must have a velocity at its friction port (C B = 0 there), got one that jumps by "
            f"{np.abs(C[-1] @ B).max():.3g} m/s per N of force. Fit it with at least two poles more than zeros"
        )
    words = f"model of order {G.nstates}" + (", friction at another port than the force" if port else "")
    return SlidingMachine(
        A=np.asarray(G.A, float),
        B_force=B[:, 0],
        B_port=B[:, -1],
        C_measured=C[0],
        C_port=C[-1],
        words=words,
        delay=delay,
    )


def separate_delay(machine: SlidingMachine, delay: float) -> tuple[SlidingMachine, float]:
    """The machine without its delay, and the delay of the whole loop [s]."""
    return replace(machine, delay=0.0), nonnegative("delay", delay) + machine.delay


def with_port_impedance(machine: SlidingMachine, stiffness: float, mass: float = 0.0) -> SlidingMachine:
    """The machine with a spring [N/m] and a mass [kg] more at its friction port; either may be negative.

    >>> machine = with_port_impedance(sliding_machine(1.0, 80e3), -30e3, 0.25)
    >>> round(machine.resonance**2 * 1.25)
    50000
    """
    accelerated = float(machine.velocity @ machine.B_port)
    share = mass / (1 + mass * accelerated)  # of the acceleration that the machine would have without the mass
    A = machine.A - stiffness * np.outer(machine.B_port, machine.C_port)
    taken = share * np.outer(machine.B_port, machine.velocity)
    return replace(
        machine,
        A=A - taken @ A,
        B_force=machine.B_force - taken @ machine.B_force,
        B_port=machine.B_port - taken @ machine.B_port,
    )
