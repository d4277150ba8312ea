"""The linear plant of a machine with friction: its motion while it slides without friction."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import control
import numpy as np
from scipy.linalg import eig, expm, solve_discrete_lyapunov

from nlfrf._base.arguments import require_choice, require_nonnegative, require_positive
from nlfrf._base.values import value
from robust._base.types import Controller, LinearSystem
from robust.friction.units import MechanicalUnits, format_plain, mechanical_units
from robust.lti.lti import balance_matrix, timebase
from robust.lti.realisation import multivariable, state_space
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
        Delay from the command to the force, or from the position to its sample [s]. Every loop with
        this plant has it.
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
        return tuple(f" at {name}" for name in names) if self.n_ports > 1 else ("",)

    @property
    def units(self) -> MechanicalUnits:
        """Units of position, velocity, force, stiffness and damping."""
        return mechanical_units(self.position_unit)

    @property
    def velocity(self) -> np.ndarray:
        """(n,) or (P, n) row of the velocity at the friction port: x' = velocity @ p for any
        forces.
        """
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
        return (
            float(np.abs(poles[np.argmax(size)])) if np.isfinite(size).all() and size.any() else 0.0
        )


def friction_plant(
    mass: float | LinearSystem,
    stiffness: float | None = None,
    damping: float = 0.0,
    *,
    port: bool | None = None,
    position_unit: str = "m",
) -> FrictionPlant:
    """Return a machine without its friction, from mass, stiffness and damping or from a model.

    Use this before `prove_friction`, for a machine with friction at one place. `two_mass_plant` has
    two places.

    Parameters
    ----------
    mass : float or control.StateSpace
        Mass [kg]; or a continuous model from force [N] to position [m], with the friction where the
        force acts; or, with `port`, a model with several inputs and outputs. A Padé approximation
        in a model without `port` is replaced by the exact delay: no machine has the right
        half-plane zeros of the approximation, and no proof is found for them.
    stiffness : float, optional
        Stiffness of the spring to ground [N/m]; zero for a free mass. Not given with a model.
    damping : float
        Viscous damping [Ns/m].
    port : bool, optional
        True if the friction acts elsewhere than the force, or at several places. The model then has
        the inputs (force, force at each friction port) and the outputs (measured position,
        displacement at each friction port).
    position_unit : str
        "m", or "rad" for a machine that turns, with kg m^2, Nm/rad and Nm s/rad.

    Returns
    -------
    FrictionPlant

    Raises
    ------
    ValueError
        A model that is sampled, not strictly proper, or without a velocity at its friction port (a
        fit needs at least two poles more than zeros); a model that a force accelerates backwards,
        so that its friction would push; a mass that is not positive.

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
            raise ValueError("stiffness must be left out with a model, which has its own, got one")
        return _plant_from_model(mass, bool(port), position_unit)
    if port:
        raise ValueError(
            "port must be left out with a mass, whose friction acts where the force acts, got"
            f" {port}"
        )
    mass = require_positive("mass", mass)
    if stiffness is None:
        raise ValueError("stiffness must be given with a mass [N/m], zero for a free one, got none")
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
    """Return a motor and a load behind a belt, a screw or a gear, with a friction port at each.

    Parameters
    ----------
    motor, load : float
        Masses in the coordinate of the load [kg], or inertias [kg m^2].
    stiffness, damping : float
        Stiffness and damping between motor and load, [N/m] and [Ns/m], or [Nm/rad] and [Nm s/rad].
    motor_damping, load_damping : float
        Viscous friction to ground at motor and load [Ns/m].
    spring : float
        Stiffness from the motor to ground [N/m]; zero for a free axis.
    encoder : str
        "motor" or "load": the position that the drive controls.
    position_unit : str
        "m", or "rad" for a machine that turns.

    Returns
    -------
    FrictionPlant
        With two friction ports: first the motor, then the load.

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
    wanted = max(2, G.ninputs) if port else 1
    if (G.ninputs, G.noutputs) != (wanted, wanted):
        hint = (
            "(force, port force) to (measured, port displacement)" if port else "force to position"
        )
        raise ValueError(
            f"mass must be a model from {hint}, got {G.ninputs} inputs and {G.noutputs} outputs"
        )
    if not G.nstates:
        raise ValueError(
            "mass must be a model that moves, from force to position, got a gain without states"
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
    places = C[1:] if port else C
    size = np.linalg.norm(places, axis=1)[:, np.newaxis] * np.linalg.norm(B, axis=0)
    if np.any(np.abs(places @ B) > ROUNDING * size):
        raise ValueError(
            "mass must have a velocity at its friction port (C B = 0 there), got one that jumps by"
            f" {np.abs(places @ B).max():.3g} {units.velocity} per {units.force} of force. Fit it"
            " with at least two poles more than zeros"
        )
    ports = B[:, 1:] if port else B
    push = np.diag(
        places @ G.A @ ports
    )  # acceleration of each port by a force at it, the inverse of a mass
    if np.any(
        push < -ROUNDING * np.linalg.norm(places @ G.A, axis=1) * np.linalg.norm(ports, axis=0)
    ):
        raise ValueError(
            "mass must be a model that a force accelerates in its own direction at the friction"
            f" port, got {push.min():.3g} {units.velocity} per second and {units.force}: its"
            " friction would push. Change the sign of the model, and of K with it: force and"
            " position are counted in one direction"
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


# ---- The sliding loop between its samples and at them: linear flows, and the jumps of the
# controller.
#
# Flow xi' = F xi + B f over a span, with the jump xi+ = J xi before it. The state xi contains the
# machine, the held force, the forces that wait for the delay, and the controller. Nothing is
# cancelled: the controller is used as given.

_EPS = np.finfo(float).eps
_LONGEST_DELAY = 20  # samples


@value
class FrictionLoop:
    """A loop around a machine without friction, and the input of a friction f at its port."""

    # (n, n) dynamics between the samples; those of the whole loop if the controller is continuous
    F: np.ndarray
    # (n,) or (n, P) input of the friction: xi' = F xi + B f; one column for each port
    B: np.ndarray
    # x, v: (n,) or (P, n) displacement and velocity at the friction port; one row for each port
    x: np.ndarray
    v: np.ndarray
    T: float  # sampling time [s]; zero for a continuous controller
    spans: np.ndarray  # (S,) durations of the flows [s]
    jumps: np.ndarray  # (S, n, n) jump before each flow
    measured: np.ndarray  # (n,) row of the measured position

    @property
    def columns(self) -> np.ndarray:
        """(n, P) input of the friction at each port."""
        return self.B.reshape(self.F.shape[0], -1)

    @property
    def displacements(self) -> np.ndarray:
        """(P, n) displacement at each port."""
        return np.atleast_2d(self.x)

    @property
    def velocities(self) -> np.ndarray:
        """(P, n) velocity at each port."""
        return np.atleast_2d(self.v)

    def period(
        self, kappa: float | np.ndarray = 0.0, damper: float | np.ndarray = 0.0
    ) -> np.ndarray:
        """(n, n) state transition over one sample, from just before the jump, with springs and
        dampers at the ports.

        It is F for a continuous controller. kappa : stiffness [N/m], one for all ports or one for
        each.
        """
        F = (
            self.F
            + self.columns * kappa @ self.displacements
            + self.columns * damper @ self.velocities
        )
        if not self.T:
            return F
        total = np.eye(F.shape[0])
        for span, jump in zip(self.spans, self.jumps, strict=True):
            total = expm(span * F) @ jump @ total
        return total

    def poles(
        self, kappa: float | np.ndarray = 0.0, damper: float | np.ndarray = 0.0
    ) -> np.ndarray:
        """Poles of the loop with a spring and a damper at its port; of one period for a sampled
        controller.
        """
        return np.linalg.eigvals(self.period(kappa, damper))

    def growth(self, kappa: float | np.ndarray = 0.0, damper: float | np.ndarray = 0.0) -> float:
        """Largest |pole| minus one, or largest real part: negative for a stable loop."""
        poles = self.poles(kappa, damper)
        return float(np.abs(poles).max() - 1 if self.T else poles.real.max())

    def rest(self) -> tuple[np.ndarray, np.ndarray]:
        """Rest position under f = 1 N, of the shape of B, and the error bound of each entry."""
        unit_time = self.T or 1.0
        own = np.eye(self.F.shape[0])
        conditions = np.vstack([self.F * unit_time, *(jump - own for jump in self.jumps)])
        wanted = np.zeros((conditions.shape[0], *self.B.shape[1:]))
        wanted[: own.shape[0]] = -self.B * unit_time
        unit = np.linalg.norm(conditions, axis=0)
        unit[unit == 0] = 1.0  # a state with an arbitrary rest
        inverse = np.linalg.pinv(conditions / unit, rcond=1e-15) / unit[:, None]
        there = inverse @ wanted
        for _ in range(2):
            there += inverse @ (wanted - conditions @ there)
        left = np.abs(conditions @ there - wanted) + own.shape[0] * _EPS * (
            np.abs(conditions) @ np.abs(there)
        )
        return there, 2 * np.abs(inverse) @ left


def friction_loop(machine: FrictionPlant, K: Controller, delay: float = 0.0) -> FrictionLoop:
    """Return the loop u = -K y around a machine; for a sampled K with sampler, delay [s] and hold.

    The delay of the machine itself is added to it.

    >>> from robust.friction.plant import friction_plant
    >>> loop = friction_loop(friction_plant(1.0, 80e3, 0.4), 0.0)
    >>> round(loop.growth(), 3)                                    # -c / 2m: the damping of the rig alone
    -0.2
    """
    K = state_space("K", K)
    machine, delay = separate_delay(machine, delay)
    T = timebase(K)
    if not T:
        if delay:
            raise ValueError(
                f"delay must be 0 s with a continuous controller, got {delay:g} s. Sample it first"
            )
        return _continuous_loop(machine, K)
    whole = int(np.floor(delay / T + 1e-9))
    part = max(0.0, delay - whole * T)
    part = 0.0 if part < 1e-9 * T else part
    if whole > _LONGEST_DELAY:
        raise ValueError(
            f"delay must be at most {_LONGEST_DELAY} samples of {T:g} s, got {delay:g} s"
        )
    n, s, waiting = machine.A.shape[0], K.nstates, whole + (part > 0)
    size = n + 1 + waiting + s
    held, queue, own = n, slice(n + 1, n + 1 + waiting), slice(n + 1 + waiting, size)
    F = np.zeros((size, size))
    F[:n, :n], F[:n, held] = machine.A, machine.B_force
    command = np.zeros(size)  # u = K (0 - y), of the state before the jump
    command[own] = K.C[0] if s else 0.0
    command[:n] -= K.D[0, 0] * machine.C_measured
    jump = np.eye(size)
    jump[own, own] = K.A
    jump[own, :n] = -np.outer(K.B[:, 0], machine.C_measured) if s else 0.0
    line = np.vstack(
        [command, np.eye(size)[queue]]
    )  # the new force, then those that wait, oldest last
    jump[queue] = line[:waiting]
    jumps, spans = [jump], [T]
    if part:
        late = np.eye(size)
        late[held] = np.eye(size)[n + waiting]
        jumps, spans = [jump, late], [part, T - part]
    else:
        jump[held] = line[waiting]
    return FrictionLoop(
        F=F,
        B=pad_states(-machine.B_port.T, size).T,
        x=pad_states(machine.C_port, size),
        v=pad_states(machine.velocity, size),
        T=T,
        spans=np.array(spans),
        jumps=np.array(jumps),
        measured=pad_states(machine.C_measured, size),
    )


def _continuous_loop(machine: FrictionPlant, K: control.StateSpace) -> FrictionLoop:
    """Return the loop with a continuous controller: one flow and no jump."""
    n, s = machine.A.shape[0], K.nstates
    F = np.zeros((n + s, n + s))
    F[:n, :n] = machine.A - K.D[0, 0] * np.outer(machine.B_force, machine.C_measured)
    if s:
        F[:n, n:] = np.outer(machine.B_force, K.C[0])
        F[n:, :n], F[n:, n:] = -np.outer(K.B[:, 0], machine.C_measured), K.A
    return FrictionLoop(
        F=F,
        B=pad_states(-machine.B_port.T, n + s).T,
        x=pad_states(machine.C_port, n + s),
        v=pad_states(machine.velocity, n + s),
        T=0.0,
        spans=np.zeros(0),
        jumps=np.zeros((0, n + s, n + s)),
        measured=pad_states(machine.C_measured, n + s),
    )


def pad_states(part: np.ndarray, size: int) -> np.ndarray:
    """Pad a row or rows (..., n) over the states of the machine with zeros to the states of the
    loop.
    """
    return np.concatenate([part, np.zeros((*part.shape[:-1], size - part.shape[-1]))], axis=-1)


# ---- Two consequences of |f| <= Fs: a state from which the motion diverges, and the farthest that
# the loop can hunt.
#
# An unstable part of a sliding loop grows by lambda a sample, w' Phi J = lambda w'. |f| <= Fs
# reduces it at most by the value of a support function; beyond that value the motion diverges with
# every such friction. A stable loop keeps the position within Fs times the integral of the absolute
# kernel from friction to position.
#
# Every integral is bounded from above: over a piece of length h, int |g| <= sqrt(h int g^2) (Cauchy
# and Schwarz), and a matrix exponential gives the quadratic form int g^2 exactly, however often g
# changes its sign. The rest of a series is bounded by a Lyapunov function. Cutting into pieces only
# makes the bound tight.

_PIECES_PER_CYCLE = 32  # of a sampling period, or of half a swing of the fastest mode
_MAX_PIECES = 4096  # of a period
_MAX_PERIODS = 200_000
_MAX_OPERATIONS = 1e10  # multiplications
# pieces of whole periods in half a swing of the fastest mode that lasts: 0.02 % of the bound
_MERGED_PER_CYCLE = 128
# after these periods the modes that are fast relative to the clock have died out
_N_FINE_PERIODS = 64
_TAIL_SHARE = 1e-4
_ROUNDED_UP = 1 + 1e-6  # outward
_CIRCLE_MARGIN = 1e-9  # rounding may put a pole closer to the unit circle on either side


@value
class _PeriodPieces:
    """One period of a loop, cut into pieces."""

    map: np.ndarray  # (n, n) state transition over the period
    # (n, P n) effect of the friction of each piece on the state at the end of the period, n columns
    # a piece. For any row r, int |r g| over piece p is at most the norm of (r kernel) in its
    # columns.
    kernel: np.ndarray
    # (3, R, n) rows that give position, acceleration and velocity at the ends of the pieces from
    # the state at the start
    reads: np.ndarray
    # (3, R) upper bound of their change by 1 N in the pieces of the period up to each end
    within: np.ndarray
    lengths: np.ndarray  # (P,) lengths of the pieces [s]


def divergence_velocity(loop: FrictionLoop, direction: np.ndarray, Fs: float) -> float:
    """Return the smallest multiple of the state `direction` from which the motion diverges with
    every |f| <= Fs.

    It is inf if there is none, and if the computation would take too many pieces.
    """
    cut = _cut_period(loop)
    if cut is None:
        return np.inf
    poles, left = eig(cut.map.T)
    least = np.inf
    for pole, w in zip(poles, left.T, strict=True):
        if np.abs(pole) <= 1 + _CIRCLE_MARGIN or pole.imag < 0:
            continue
        reach = w @ direction
        if not np.abs(reach) > 1e-14 * np.linalg.norm(w) * np.linalg.norm(direction):
            continue
        parts = (w @ cut.kernel / pole).reshape(-1, loop.F.shape[0])
        phases = -np.angle(reach) + (np.linspace(-0.6, 0.6, 31) if pole.imag else np.zeros(1))
        taken = _support_function(np.exp(1j * phases), pole, parts)
        least = min(least, float((taken / np.cos(phases + np.angle(reach))).min() / np.abs(reach)))
    return Fs * least * _ROUNDED_UP


def _support_function(turn: np.ndarray, pole: complex, parts: np.ndarray) -> np.ndarray:
    """Return an upper bound (P,) of the sum over samples k and pieces of |Re(turn pole^-k parts)|,
    with its tail.
    """
    total = np.zeros(turn.size)
    affordable = _MAX_OPERATIONS / (40 * turn.size * parts.size)
    periods = int(
        max(
            1,
            min(_MAX_PERIODS, affordable, np.ceil(np.log(1 / _TAIL_SHARE) / np.log(np.abs(pole)))),
        )
    )
    at_once = max(1, int(4e6 / (turn.size * parts.size)))
    for first in range(0, periods, at_once):
        powers = complex(pole) ** -np.arange(first, min(first + at_once, periods), dtype=float)
        turned = turn[:, None, None, None] * powers[:, None, None] * parts
        total += np.linalg.norm(turned.real, axis=-1).sum(axis=(1, 2))
    rest = np.abs(pole) ** -float(periods) / (1 - 1 / np.abs(pole))
    return np.asarray(total + rest * np.linalg.norm(parts, axis=-1).sum())


def steady_error_bound(loop: FrictionLoop) -> float:
    """Return an upper bound of the distance from rest [m/N] that a friction of at most 1 N can
    sustain: the peak gain.

    It is inf if the loop is not stable by more than its rounding, or if it would take too many
    pieces or periods.
    """
    cut = _cut_period(loop)
    if cut is None:
        return np.inf
    positions = _absolute_kernel_integral(cut, 0)
    if not loop.T:  # all instants are alike
        return float(positions.max() * _ROUNDED_UP)
    if not np.isfinite(positions).all():
        return np.inf
    # between two ends of pieces the position leaves its chord by at most h^2/8 times the largest
    # acceleration, which is bounded by twice the largest one at the ends
    bend = 2 * (_absolute_kernel_integral(cut, 1).max() + np.abs(loop.v @ loop.B))
    step, at_once = cut.lengths.max(), np.abs(loop.x @ loop.B)
    away = step**2 / 8 * bend
    if at_once > ROUNDING * np.linalg.norm(loop.x) * np.linalg.norm(
        loop.B
    ):  # the velocity jumps with the friction
        away = step / 2 * (_absolute_kernel_integral(cut, 2).max() + step * bend + at_once)
    return float((positions.max() + away) * _ROUNDED_UP)


def _absolute_kernel_integral(cut: _PeriodPieces, what: int) -> np.ndarray:
    """Return an upper bound (R,) of the integral of |kernel| from the past friction to each of
    `cut.reads[what]`.
    """
    rows, total = cut.reads[what], cut.within[what]
    norm = _lyapunov_norm(cut.map)
    if norm is None:
        return np.full(rows.shape[0], np.inf)
    factor, inverse, rate = norm
    n = cut.map.shape[0]
    weight = np.linalg.norm(rows @ inverse, axis=1)
    merged = _merge_periods(cut)
    affordable = int(min(_MAX_PERIODS, _MAX_OPERATIONS / (rows.shape[0] * cut.kernel.size)))
    stages = [(1, cut.map, cut.kernel, affordable)]
    if merged is not None and affordable > _N_FINE_PERIODS:
        count, kernel = merged
        start = np.linalg.matrix_power(cut.map, _N_FINE_PERIODS) @ kernel
        stages = [
            (1, cut.map, cut.kernel, _N_FINE_PERIODS),
            (
                count,
                np.linalg.matrix_power(cut.map, count),
                start,
                (affordable - _N_FINE_PERIODS) // count,
            ),
        ]
    for count, step, state, n_steps in stages:
        for k in range(n_steps):
            if (
                k % 8 == 0
            ):  # the rest: |r Phi^k x| <= |r| rate^k |x| in the norm in which the map contracts
                left = np.linalg.norm((factor @ state).reshape(n, -1, n), axis=(0, 2)).sum()
                rest = weight * left / (1 - rate**count)
                if (rest <= _TAIL_SHARE * total.max()).all():
                    return np.asarray(total + rest)
            total = total + _kernel_norms(rows, state)
            state = step @ state
    return np.full(rows.shape[0], np.inf)


def _merge_periods(cut: _PeriodPieces) -> tuple[int, np.ndarray] | None:
    """Return a number of periods that is cut into pieces of whole periods, and the effect of the
    friction in each.

    This is for modes that are slow relative to the clock, after the fast ones have died out. None
    if one is not slow.
    """
    poles = np.linalg.eigvals(cut.map)
    lasting = poles[np.abs(poles) ** _N_FINE_PERIODS > _TAIL_SHARE]
    fastest = np.abs(np.log(lasting)).max(initial=0.0)
    if not fastest * _MERGED_PER_CYCLE <= np.pi:
        return None
    together = int(np.pi / (_MERGED_PER_CYCLE * fastest)) if fastest else 1
    n = cut.map.shape[0]
    pieces = cut.kernel.reshape(n, -1, n)
    # (sum of h_p) times the sum of int g^2; a piece contains h_p int g^2
    gram = np.einsum("ipk,jpk,p->ij", pieces, pieces, cut.lengths.sum() * together / cut.lengths)
    total, power = np.zeros((n, n)), np.eye(n)
    for _ in range(together):
        total += power @ gram @ power.T
        power = cut.map @ power
    root = _gramian_root(total)
    kernel = [root]
    for _ in range(_MERGED_PER_CYCLE - 1):
        kernel.append(power @ kernel[-1])
    return _MERGED_PER_CYCLE * together, np.hstack(kernel)


def _kernel_norms(rows: np.ndarray, kernel: np.ndarray) -> np.ndarray:
    """Return (R,) sums of the norms of (rows kernel) over the columns of each piece."""
    n, at_once = kernel.shape[0], max(1, 4_000_000 // kernel.shape[1])
    sums = []
    for first in range(0, rows.shape[0], at_once):
        pieces = (rows[first : first + at_once] @ kernel).reshape(-1, kernel.shape[1] // n, n)
        sums.append(np.sqrt(np.einsum("rpi,rpi->rp", pieces, pieces)).sum(axis=1))
    return np.concatenate(sums)


def _lyapunov_norm(period: np.ndarray) -> tuple[np.ndarray, np.ndarray, float] | None:
    """Return a norm |L x| in which a stable map contracts:

    L, its inverse, the rate below one; else None.
    """
    scaled, weights = balance_matrix(period)
    goal = 1 - 0.75 * (1 - np.abs(np.linalg.eigvals(scaled)).max(initial=0.0))
    if not 0 < goal < 1 or _MAX_PERIODS * (1 - goal) < 1:
        return None
    try:
        P = solve_discrete_lyapunov((scaled / goal).T, np.eye(scaled.shape[0]))
        L = np.linalg.cholesky((P + P.T) / 2).T
        back = np.linalg.inv(L)
    except np.linalg.LinAlgError:
        return None
    rate = float(np.linalg.norm(L @ scaled @ back, 2))
    rounding = np.finfo(float).eps * np.linalg.norm(L, 2) * np.linalg.norm(back, 2)
    return (L / weights, weights[:, None] * back, rate) if rounding < 1e-3 * (1 - rate) else None


def _cut_period(loop: FrictionLoop) -> _PeriodPieces | None:
    """Cut a period into pieces that are short for both the clock and the fastest mode; None if
    these are too many.

    The period of a continuous loop is half an oscillation of its fastest mode.
    """
    n = loop.F.shape[0]
    fastest = np.abs(np.linalg.eigvals(loop.F)).max(initial=0.0)
    if not loop.T:
        T = np.pi / fastest if fastest else 1.0
        spans, jumps = np.array([T]), np.eye(n)[None]
    else:
        T, spans, jumps = loop.T, loop.spans, loop.jumps
    counts = np.maximum(
        2, np.ceil(_PIECES_PER_CYCLE * spans * max(1 / T, fastest / np.pi) * (1 - 1e-12))
    )
    if not counts.sum() <= _MAX_PIECES:
        return None
    read = np.array([loop.x, loop.v @ loop.F, loop.v])  # position, acceleration, velocity
    map_, kernel, ends, within = np.eye(n), np.zeros((n, 0)), [], []
    for span, jump, count in zip(spans, jumps, counts.astype(int), strict=True):
        flow, push = _flow_and_gramian_root(loop.F, loop.B, span / count)
        map_, kernel = jump @ map_, jump @ kernel
        for _ in range(count):
            map_, kernel = flow @ map_, np.hstack([flow @ kernel, push])
            ends.append(read @ map_)
            within.append(_kernel_norms(read, kernel))
    kept = slice(None) if loop.T else slice(-1, None)
    return _PeriodPieces(
        map=map_,
        kernel=kernel,
        reads=np.moveaxis(np.array(ends)[kept], 1, 0),
        within=np.array(within)[kept].T,
        lengths=np.repeat(spans / counts, counts.astype(int)),
    )


def _flow_and_gramian_root(F: np.ndarray, B: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray]:
    """Return exp(F h) and G with h int_0^h exp(F s) B B' exp(F s)' ds = G G' (Van Loan 1978)."""
    n = F.shape[0]
    block = np.zeros((2 * n, 2 * n))
    block[:n, :n], block[:n, n:], block[n:, n:] = -F, np.outer(B, B), F.T
    both = expm(block * h)
    flow = both[n:, n:].T
    return flow, _gramian_root(h * flow @ both[:n, n:])


def _gramian_root(gram: np.ndarray) -> np.ndarray:
    """Return G with G G' slightly above the Gramian, so that rounding cannot make it too small.

    The Gramian is scaled to unit diagonal, because eigenvalues are accurate only relative to the
    largest one.
    """
    n = gram.shape[0]
    unit = np.sqrt(np.maximum(np.diag(gram), 0))
    per_unit = np.divide(1.0, unit, out=np.zeros(n), where=unit > 0)
    sizes, turns = np.linalg.eigh((gram + gram.T) / 2 * np.outer(per_unit, per_unit))
    return np.asarray(
        unit[:, None]
        * turns
        * np.sqrt(np.maximum(sizes, 0) + 4 * n * np.finfo(float).eps * sizes.max())
    )


# ---- The sliding loop over frequency: from the friction at its port to the velocity there.


def loop_frequencies(loop: FrictionLoop, n: int = 900) -> np.ndarray:
    """Return (W,) frequencies [rad/s] up to Nyquist: logarithmic, linear, and clustered at the
    poles of the loop.
    """
    poles = loop.poles()
    if loop.T:
        poles = np.log(np.where(poles == 0, 1e-300, poles).astype(complex)) / loop.T
    sizes = np.abs(poles[np.abs(poles) > 0])
    top = np.pi / loop.T if loop.T else 100 * sizes.max(initial=1.0)
    points = [np.geomspace(1e-5 * top, top, n // 2), np.linspace(top / n, top, n // 4)]
    for pole in poles[(poles.imag > 0) & (np.abs(poles) < top)]:
        width = max(abs(pole.real), 1e-6 * abs(pole))
        points.append(pole.imag + width * np.sinh(np.linspace(-3, 3, 31)))
    points.append(sizes)
    omega = np.unique(np.concatenate(points))
    return omega[(omega > 1e-6 * top) & (omega <= top)]


def mobility(loop: FrictionLoop, omega: np.ndarray) -> np.ndarray:
    """Return (W,) velocity at the port over friction at the same frequency; aliases of the sampler
    are left out.

    With several ports: (W, P, P), from the friction at the second index to the velocity at the
    first.
    """
    none = np.zeros(loop.F.shape[0])
    moved = [
        driven_states(loop, omega, flow=column, struck=none)[0] @ loop.v.T
        for column in loop.columns.T
    ]
    return np.asarray(np.stack(moved, axis=-1) if loop.B.ndim > 1 else moved[0])


def driven_states(
    loop: FrictionLoop, omega: np.ndarray, *, flow: np.ndarray, struck: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the (W, n) state at the frequency of the force, and the (W, n) state just before a
    sample.

    flow, struck : (n,) input of exp(j w t) into the flow, and into the first jump of a period
    (sampled loops only).

    With f = exp(j w t) the state repeats up to a phase. Its component at w follows from the flow by
    partial integration: (j w - F) xi_1 = B + (1/T) sum of the jumps, each with its phase.
    """
    n = loop.F.shape[0]
    # an undamped machine has its poles on the axis, where both sides of that equation vanish
    s = 1j * omega * (1 + 1e-9)
    pencil = s[:, None, None] * np.eye(n) - loop.F
    forced = np.linalg.solve(
        pencil, np.broadcast_to(flow.astype(complex)[:, None], (s.size, n, 1))
    )[..., 0]
    if not loop.T:
        return forced, forced
    flows = [expm(span * loop.F) for span in loop.spans]
    strikes = [struck, *[np.zeros(n)] * (len(flows) - 1)]
    # state before each jump as (matrix) start + (forced part)
    total, offset = np.eye(n), np.zeros((s.size, n), complex)
    before = []
    t = 0.0
    for phi, jump, hit, span in zip(flows, loop.jumps, strikes, loop.spans, strict=True):
        before.append((total, offset, t))
        total, offset = phi @ jump @ total, (offset @ jump.T + hit) @ phi.T
        offset = (
            offset
            + np.exp(s * (t + span))[:, None] * forced
            - (np.exp(s * t)[:, None] * forced) @ phi.T
        )
        t += span
    start = np.linalg.solve(np.exp(s * t)[:, None, None] * np.eye(n) - total, offset[..., None])[
        ..., 0
    ]
    jumped = np.zeros((s.size, n), complex)
    for (matrix, part, when), jump, hit in zip(before, loop.jumps, strikes, strict=True):
        jumped += np.exp(-s * when)[:, None] * (
            (start @ matrix.T + part) @ (jump - np.eye(n)).T + hit
        )
    answer = np.linalg.solve(pencil, jumped[..., None] / loop.T)[..., 0]
    return forced + answer, start


# ---- Refutation: a friction of the class that never slips is a spring, and a spring can make the
# loop unstable.

#: Springs that are tried, relative to K0: for one port, and for each of several.
_SPRING_SHARES = (
    np.unique(np.concatenate([np.linspace(0, 1, 31)[1:], np.geomspace(1e-3, 1, 30)])),
    np.concatenate([[0.0], np.geomspace(1e-3, 1, 13)]),
)


def destabilizing_stiffness(
    loop: FrictionLoop, K0: float | np.ndarray, damper: float | np.ndarray = 0.0
) -> tuple[float | tuple[float, ...], complex] | None:
    """Return the most unstable stiffness [N/m] found in [0, K0], and its pole; None if none is
    unstable.

    Each stiffness except zero comes with a damper [Ns/m], that of a bristle. With several ports,
    K0, damper and stiffness have one entry a port. The search covers a fixed grid and its
    refinement around the worst point.
    """
    beyond = _CIRCLE_MARGIN * (1.0 if loop.T else np.abs(loop.poles()).max())
    n_ports = loop.columns.shape[1]
    stiffest = np.broadcast_to(np.asarray(K0, dtype=float), n_ports)
    worst, growth = np.zeros(n_ports), loop.growth()
    if growth <= beyond and stiffest.any():
        tried = _SPRING_SHARES[n_ports > 1]
        shares = np.array(list(product(tried, repeat=n_ports)))
        found = np.array([loop.growth(share * stiffest, damper) for share in shares])
        worst, growth = shares[int(np.argmax(found))], float(found.max())
        for port in range(
            n_ports
        ):  # between the neighbours of the worst, for one port after another
            at = int(np.searchsorted(tried, worst[port]))
            low, high = tried[max(at - 1, 0)], tried[min(at + 1, tried.size - 1)]
            for share in np.linspace(low, high, 9)[1:-1]:
                changed = np.where(np.arange(n_ports) == port, share, worst)
                now = loop.growth(changed * stiffest, damper)
                if now > growth:
                    worst, growth = changed, now
    if not growth > beyond:
        return None
    springs = worst * stiffest
    stiffness = float(springs[0]) if loop.B.ndim == 1 else tuple(map(float, springs))
    poles = loop.poles(springs, damper)
    return stiffness, complex(poles[np.argmax(np.abs(poles) if loop.T else poles.real)])


def format_pole_modulus(size: float) -> str:
    """Format the modulus of a pole with enough digits to distinguish it from one."""
    digits = 6 if size == 1 else int(np.clip(np.ceil(3 - np.log10(abs(size - 1))), 6, 16))
    return f"{size:.{digits}g}"
