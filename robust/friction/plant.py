"""The linear plant of a machine with friction: its motion while it slides without friction."""

from __future__ import annotations

from dataclasses import replace

import control
import numpy as np

from nlfrf._base.arguments import require_choice, require_nonnegative, require_positive
from nlfrf._base.values import value
from robust._base.types import LinearSystem
from robust.friction.units import MechanicalUnits, format_plain, mechanical_units
from robust.lti.lti import timebase
from robust.lti.realisation import multivariable
from robust.lti.sampling import without_pade

#: A gain this small, relative to the norms of its factors, is zero.
ROUNDING = 1e-9


@value
class FrictionPlant:
    """A machine without its friction: p' = A p + B_force u - B_port f, with friction f at its port.

    Fields
    ------
    A : (n, n) ndarray
        Dynamics.
    B_force : (n,) ndarray
        Column through which the force of the actuator enters.
    B_port : (n,) or (n, P) ndarray
        Column through which a force at the friction port enters [N]; one column for each port.
    C_measured : (n,) ndarray
        Row that gives the measured position.
    C_port : (n,) or (P, n) ndarray
        Row that gives the displacement at the friction port [m]; one row for each port.
    description : str
        Text for people.
    delay : float
        Delay from the command to the force, or from the position to its sample [s]. It is part of
        every loop with this plant.
    position_unit : str
        "m", or "rad" for a machine that turns, with Nm for N.
    port_names : tuple of str
        Place of each friction port, for texts. If it is empty, the names are port 1, port 2, ...
    """

    A: np.ndarray
    B_force: np.ndarray
    B_port: np.ndarray
    C_measured: np.ndarray
    C_port: np.ndarray
    description: str
    delay: float = 0.0
    position_unit: str = "m"
    port_names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        mechanical_units(self.position_unit)

    @property
    def n_ports(self) -> int:
        """Number of places where friction acts."""
        return int(np.atleast_2d(self.C_port).shape[0])

    @property
    def places(self) -> tuple[str, ...]:
        """Phrase for the place of each port, for texts; empty for a single one."""
        names = self.port_names or tuple(f"port {i + 1}" for i in range(self.n_ports))
        if self.n_ports > 1:
            return tuple(f" at {name}" for name in names)
        return ("",)

    @property
    def units(self) -> MechanicalUnits:
        """Units of position, velocity, force, stiffness and damping."""
        return mechanical_units(self.position_unit)

    @property
    def velocity(self) -> np.ndarray:
        """(n,) or (P, n) row of the port velocity: x' = velocity @ p for any forces."""
        return self.C_port @ self.A

    @property
    def resonance(self) -> float:
        """Frequency of the oscillatory mode that moves the friction port most [rad/s]; zero if no
        mode oscillates.

        >>> friction_plant(12.0, 0.0, 20.0).resonance, round(friction_plant(1.0, 100.0, 2.0).resonance, 9)
        (0.0, 10.0)
        """
        poles, modes = np.linalg.eig(self.A)
        try:
            enters = np.linalg.solve(modes, self.B_port.reshape(poles.size, -1).astype(complex))
        except np.linalg.LinAlgError:
            return 0.0
        residues = np.abs(np.atleast_2d(self.velocity) @ modes).max(axis=0) * np.abs(enters).max(
            axis=1
        )
        # the pole -c/m of a free mass with viscous friction is no resonance: with filters placed by
        # it, loops were not proved that are proved without that friction
        size = np.where(np.abs(poles.imag) > ROUNDING * np.abs(poles).max(initial=0), residues, 0)
        if np.isfinite(size).all() and size.any():
            return float(np.abs(poles[np.argmax(size)]))
        return 0.0


def friction_plant(
    mass: float | LinearSystem,
    stiffness: float | None = None,
    damping: float = 0.0,
    *,
    port: bool | None = None,
    position_unit: str = "m",
) -> FrictionPlant:
    """Return the linear plant of a machine with friction, from its parameters or from a model.

    Use this before `prove_friction`, for a machine with friction at one place; `two_mass_plant` is
    for friction at two places.

    Parameters
    ----------
    mass : float or control.StateSpace
        One of three: the mass [kg]; a continuous model from force [N] to position [m], with the
        friction at the place of the force; or, with `port`, a model with several inputs and
        outputs. In a model without `port`, a Padé approximation is replaced by the exact delay,
        because its right half-plane zeros prevent a proof.
    stiffness : float, optional
        Stiffness of the spring to ground [N/m]; zero for a free mass. Not given with a model.
    damping : float
        Viscous damping [Ns/m].
    port : bool, optional
        True if the friction acts at another place than the force, or at several places. Each such
        place is a *friction port*. The inputs of the model are then (force, force at each friction
        port), and its outputs (measured position, displacement at each friction port).
    position_unit : str
        "m", or "rad" for a rotary machine, with kg m^2, Nm/rad and Nm s/rad.

    Returns
    -------
    FrictionPlant

    Raises
    ------
    ValueError
        A model that is sampled or not strictly proper; a model whose velocity at the friction port
        jumps with the force (a fit needs at least two poles more than zeros); a model that
        accelerates against the force; a mass that is not positive.

    References
    ----------
    B. Armstrong-Hélouvry, *Control of Machines with Friction*, Kluwer, 1991.

    Examples
    --------
    >>> machine = friction_plant(1.0, 80e3)
    >>> round(machine.resonance / 2 / np.pi, 1)                    # the sliding rig of the paper resonates at 45 Hz
    45.0
    """
    if isinstance(mass, (control.StateSpace, control.TransferFunction)):
        if stiffness is not None or damping != 0.0:
            raise ValueError(
                "stiffness must be left out with a model, which already contains it, got one"
            )
        return _plant_from_model(mass, bool(port), position_unit)
    if port:
        raise ValueError(
            "port must be left out with a mass, whose friction acts where the force acts, got"
            f" {port}"
        )
    mass = require_positive("mass", mass)
    if stiffness is None:
        raise ValueError(
            "stiffness must be given with a mass [N/m], zero for a free mass, got none"
        )
    stiffness = require_nonnegative("stiffness", stiffness)
    damping = require_nonnegative("damping", damping)
    units = mechanical_units(position_unit)
    push, place = np.array([0.0, 1 / mass]), np.array([1.0, 0.0])
    A = np.array([[0.0, 1.0], [-stiffness / mass, -damping / mass]])
    description = (
        f"m = {mass:.4g} {units.mass}, k = {stiffness / 1e3:.4g} {units.stiffness}, c ="
        f" {damping:.3g} {units.damping}"
    )
    return FrictionPlant(
        A=A,
        B_force=push,
        B_port=push,
        C_measured=place,
        C_port=place,
        description=description,
        position_unit=position_unit,
    )


def two_mass_plant(
    motor: float,
    load: float,
    stiffness: float,
    damping: float = 0.0,
    *,
    motor_damping: float = 0.0,
    load_damping: float = 0.0,
    spring: float = 0.0,
    encoder: str = "motor",
    position_unit: str = "m",
) -> FrictionPlant:
    """Return the linear plant of a motor and an elastically coupled load, with friction at each.

    Parameters
    ----------
    motor, load : float
        Masses [kg] or inertias [kg m^2], both in the coordinate of the load.
    stiffness, damping : float
        Stiffness and damping between motor and load, [N/m] and [Ns/m], or [Nm/rad] and [Nm s/rad].
    motor_damping, load_damping : float
        Viscous friction to ground at motor and load [Ns/m].
    spring : float
        Stiffness from the motor to ground [N/m]; zero for a free axis.
    encoder : str
        "motor" or "load": the position that is measured and controlled.
    position_unit : str
        "m", or "rad" for a rotary machine.

    Returns
    -------
    FrictionPlant
        Plant with two friction ports: first the motor, then the load.

    Raises
    ------
    ValueError
        A mass or a stiffness that is not positive, or another encoder.

    References
    ----------
    G. Ellis, *Control System Design Guide*, 4th ed., Butterworth-Heinemann, 2012, chapter 16: two
    masses and a spring.

    Examples
    --------
    >>> machine = two_mass_plant(7.17, 15.0, 1.33e6, 100.0)             # the belt of `nlfrf.servo_axis`
    >>> machine.n_ports, round(machine.resonance / 2 / np.pi, 1)
    (2, 83.3)
    """
    motor, load = require_positive("motor", motor), require_positive("load", load)
    k, c = require_positive("stiffness", stiffness), require_nonnegative("damping", damping)
    ground = require_nonnegative("spring", spring)
    viscous = {
        "motor": require_nonnegative("motor_damping", motor_damping),
        "load": require_nonnegative("load_damping", load_damping),
    }
    units = mechanical_units(position_unit)
    A = np.array(
        [
            [0, 0, 1, 0],
            [0, 0, 0, 1],
            [-(k + ground) / motor, k / motor, -(c + viscous["motor"]) / motor, c / motor],
            [k / load, -k / load, c / load, -(c + viscous["load"]) / load],
        ]
    )
    into, places = np.array([[0, 0], [0, 0], [1 / motor, 0], [0, 1 / load]]), np.eye(4)[:2]
    return FrictionPlant(
        A=A,
        B_force=into[:, 0],
        B_port=into,
        C_measured=places[
            ("motor", "load").index(require_choice("encoder", encoder, ("motor", "load")))
        ],
        C_port=places,
        description=(
            f"motor {motor:.4g} {units.mass} and load {load:.4g} {units.mass} with"
            f" {format_plain(k / 1e3)} {units.stiffness} and {format_plain(c)} {units.damping}"
            " between them"
            + (f", {ground / 1e3:.4g} {units.stiffness} to ground" if ground else "")
            + "".join(
                f", c = {own:.3g} {units.damping} at the {place}"
                for place, own in viscous.items()
                if own
            )
            + f", encoder on the {encoder}"
        ),
        position_unit=position_unit,
        port_names=("the motor", "the load"),
    )


def _plant_from_model(model: LinearSystem, port: bool, position_unit: str) -> FrictionPlant:
    """Return the plant of a model from force to position, or from and to the friction ports too if
    `port` is true.
    """
    units = mechanical_units(position_unit)
    G = multivariable("mass", model)
    if port:
        wanted = max(2, G.ninputs)
    else:
        wanted = 1
    if (G.ninputs, G.noutputs) != (wanted, wanted):
        if port:
            hint = "(force, port force) to (measured, port displacement)"
        else:
            hint = "force to position"
        raise ValueError(
            f"mass must be a model from {hint}, got {G.ninputs} inputs and {G.noutputs} outputs"
        )
    if not G.nstates:
        raise ValueError(
            "mass must be a dynamic model from force to position, got a gain without states"
        )
    if timebase(G):
        raise ValueError(
            f"mass must be a continuous model, got one sampled at dt = {G.dt:g} s. Fit it with dt=0"
        )
    delay = 0.0
    if wanted == 1:
        G, delay = without_pade(G)
    if np.any(G.D != 0):
        raise ValueError(
            "mass must be a strictly proper model, got a direct term. Fit it with two poles more"
            " than zeros"
        )
    B, C = np.asarray(G.B, float), np.asarray(G.C, float)
    if port:
        places = C[1:]
    else:
        places = C
    size = np.linalg.norm(places, axis=1)[:, np.newaxis] * np.linalg.norm(B, axis=0)
    if np.any(np.abs(places @ B) > ROUNDING * size):
        raise ValueError(
            "mass must be a model whose velocity at the friction port does not jump with the"
            f" force (C B = 0 there), got a jump of {np.abs(places @ B).max():.3g}"
            f" {units.velocity} per {units.force} of force. Fit it with at least two poles more"
            " than zeros"
        )
    if port:
        ports = B[:, 1:]
    else:
        ports = B
    push = np.diag(
        places @ G.A @ ports
    )  # acceleration of each port by a force at it, the inverse of a mass
    if np.any(
        push < -ROUNDING * np.linalg.norm(places @ G.A, axis=1) * np.linalg.norm(ports, axis=0)
    ):
        raise ValueError(
            "mass must be a model that accelerates in the direction of the force at the"
            f" friction port, got {push.min():.3g} {units.velocity} per second and"
            f" {units.force}: friction would drive it. Change the sign of the model and of K, so"
            " that force and position have the same positive direction"
        )
    several = wanted > 2
    description = f"model of order {G.nstates}"
    if port:
        description += (
            f", friction at {wanted - 1} ports"
            if several
            else ", friction at another port than the force"
        )
    return FrictionPlant(
        A=np.asarray(G.A, float),
        B_force=B[:, 0],
        B_port=B[:, 1:] if several else B[:, -1],
        C_measured=C[0],
        C_port=C[1:] if several else C[-1],
        description=description,
        delay=delay,
        position_unit=position_unit,
    )


def require_one_port(machine: FrictionPlant) -> None:
    if machine.n_ports > 1:
        raise ValueError(
            f"machine must have one friction port, got {machine.n_ports}: only prove_friction takes"
            " several"
        )


def separate_delay(machine: FrictionPlant, delay: float) -> tuple[FrictionPlant, float]:
    """Return the machine without its delay, and the total delay of the loop [s]."""
    return replace(machine, delay=0.0), require_nonnegative("delay", delay) + machine.delay


def with_port_impedance(
    machine: FrictionPlant, stiffness: float, mass: float = 0.0
) -> FrictionPlant:
    """Return the machine with an additional spring [N/m] and mass [kg] at its friction port; either
    may be negative.

    >>> machine = with_port_impedance(friction_plant(1.0, 80e3), -30e3, 0.25)
    >>> round(machine.resonance**2 * 1.25)
    50000
    """
    require_one_port(machine)
    accelerated = float(machine.velocity @ machine.B_port)
    share = mass / (
        1 + mass * accelerated
    )  # of the acceleration of the machine without the additional mass
    A = machine.A - stiffness * np.outer(machine.B_port, machine.C_port)
    taken = share * np.outer(machine.B_port, machine.velocity)
    return replace(
        machine,
        A=A - taken @ A,
        B_force=machine.B_force - taken @ machine.B_force,
        B_port=machine.B_port - taken @ machine.B_port,
    )
