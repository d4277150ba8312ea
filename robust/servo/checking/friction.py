"""Friction in the loop of a drive: identification from traces at rest, and the proof with it.

Viscous friction belongs to the machine and not to the class of friction. A proof for one mass and
one viscous friction does not hold for other values, so it is repeated at the ends of both
intervals. The interval of viscous friction begins at zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import control
import numpy as np

import nlfrf
from nlfrf.rig import Drive
from robust._base.states import FrictionVerdict
from robust.friction.loop import pad_states
from robust.friction.plant import FrictionPlant
from robust.friction.proof.protocol import FrictionClass, FrictionProof
from robust.friction.proof.prove import prove_all, prove_friction
from robust.friction.reading.force import edge_of_level, friction_of_period
from robust.friction.reading.friction_fit import FrictionFit
from robust.friction.reading.from_fit import interval_at_port, machines_of_fit
from robust.friction.reading.identification import identify_friction
from robust.friction.reading.in_motion import SlidingFit
from robust.friction.reading.machine_with_friction import machine_with_friction
from robust.servo.checking.cures import FrictionCure, friction_cures
from robust.servo.checking.drive_friction import (
    ADDED_STEP,
    K0_MARGIN,
    MOST_ADDED_PERIODS,
    DriveFriction,
)
from robust.servo.gains.p_pi import cascade

#: Number of levels needed to read friction.
_FEWEST_LEVELS = 3


def judge_friction(
    records: Sequence[nlfrf.Record],
    settings: Drive,
    *,
    actual: bool,
    stiction: float,
    Fs: float | None,
    spring: bool,
    masses: int,
    fit: FrictionFit | None = None,
    sliding: SlidingFit | None = None,
) -> DriveFriction:
    """Read the friction from traces at rest (force in, position out), and prove the loop;
    parameters as for `check`.
    """
    if fit is None:
        try:
            fit = _read_friction(records, spring=spring, masses=masses, sliding=sliding)
        except (ValueError, np.linalg.LinAlgError) as error:
            return DriveFriction(note=str(error))
    try:
        assumed = machine_with_friction(fit, stiction=stiction, margin=K0_MARGIN)
    except ValueError as error:
        return DriveFriction(fit=fit, note=fit.reason or str(error))
    if fit.load_mass and settings.encoder != "motor":
        return DriveFriction(
            fit=fit,
            note=(
                "motor and load can be read only with the encoder on the motor, and it is on the"
                " load"
            ),
        )
    # the loop has delay and lag of the settings, so the machine keeps only the delay beyond them
    if actual:
        known = 0.0
    else:
        known = settings.delay + settings.lag
    read, *ends = (
        friction_behind_lag(replace(one, delay=max(0.0, fit.delay - known)), settings.lag)
        for one in (assumed.machine, *machines_of_fit(fit)[1:])
    )
    largest: float | tuple[float, ...] | None = Fs
    if Fs is None and np.isfinite(fit.stds["Fs"]):
        largest = _largest_forces_read(fit)
    unit = fit.units[0]
    K = cascade(settings, output_unit=unit)
    friction = assumed.friction
    late = settings.delay
    added = 0.0
    try:
        proofs = prove_all((read,), K, friction, delay=late, Fs=largest)
    except ValueError as error:  # a delay that is too long to be proved
        return DriveFriction(fit=fit, note=str(error))
    if proofs[0].verdict is FrictionVerdict.PROVED:
        # with friction at two places the bound takes longer to compute than the proof
        at_ends = largest if len(friction) == 1 else None
        proofs = (*proofs, *prove_all(ends, K, friction, delay=late, Fs=at_ends))
        proofs = tuple(sorted(proofs, key=lambda proof: proof.verdict is FrictionVerdict.PROVED))
    cures: tuple[FrictionCure, ...] = ()
    if proofs[0].verdict is FrictionVerdict.PROVED:
        added = _largest_added_delay((read, *ends), K, friction, delay=late, period=settings.dt)
    elif largest is not None:
        weakest = replace(
            proofs[0].machine, delay=read.delay
        )  # a proof takes the delay out of its machine
        cures = friction_cures(weakest, settings, friction, Fs=largest, output_unit=unit)
    return DriveFriction(
        fit=fit,
        assumed=assumed,
        proofs=proofs,
        cures=cures,
        largest=largest,
        known_delay=known,
        added_delay=added,
        has_integral=bool(np.isfinite(settings.tn)),
    )


def force_over_position(record: nlfrf.Record, machine: SlidingFit | FrictionFit) -> np.ndarray:
    """Return (2, N) position [m] and friction force [N] over the mean period of a record at rest,
    without their means.

    Only frequencies at which a step of the encoder is small in the force are used.
    """
    return np.stack(friction_of_period(record, machine, edge_of_level(record, machine)))


def bound_any_friction(
    machine: FrictionPlant, settings: Drive, friction: FrictionClass, *, output_unit: str
) -> FrictionProof:
    """Return the bound of the error of a machine under its drive, with any bounded friction at any
    of its ports.

    The bound is a sum over the forces at motor and load, so it is largest if one of them has all of
    the friction.
    """
    K = cascade(settings, output_unit=output_unit)
    behind = friction_behind_lag(machine, settings.lag)
    ports = zip(
        behind.B_port.reshape(behind.A.shape[0], -1).T,
        [f", friction at {name}" for name in machine.port_names] or [""],
        strict=True,
    )
    places = [
        replace(
            behind,
            B_port=into,
            C_port=behind.C_measured,
            port_names=(),
            description=behind.description + where,
        )
        for into, where in ports
    ]
    proofs = [prove_friction(one, K, friction, delay=settings.delay) for one in places]
    return max(proofs, key=lambda proof: proof.error_bound)


def _largest_forces_read(fit: FrictionFit) -> float | tuple[float, ...]:
    """Return the upper end of the break-away force; for motor and load one each."""
    if not fit.load_mass:
        return fit.interval("Fs")[1]
    return tuple(interval_at_port(fit, "Fs", port)[1] for port in ("motor", "load"))


def _read_friction(
    records: Sequence[nlfrf.Record], *, spring: bool, masses: int, sliding: SlidingFit | None = None
) -> FrictionFit:
    """Read the friction from traces at rest; a ValueError has the reason if that is not
    possible.
    """
    if len(records) < _FEWEST_LEVELS:
        raise ValueError(
            "a class of friction needs traces at rest at three levels or more, sticking to"
            f" sliding, got {len(records)}"
        )
    if records[0].u_unit == "A":
        raise ValueError(
            "a class of friction needs traces of a force, got a current: give torque_constant of"
            " the drive"
        )
    return identify_friction(records, free=not spring, masses=masses, sliding=sliding)


def _largest_added_delay(
    machines: Sequence[FrictionPlant],
    K: control.StateSpace,
    friction: FrictionClass | Sequence[FrictionClass],
    *,
    delay: float,
    period: float,
) -> float:
    """Return the largest additional delay [s] for which the proof of every machine holds, by
    bisection.
    """

    def proves(steps: int) -> bool:
        late = delay + steps * ADDED_STEP * period
        return all(
            prove_friction(machine, K, friction, delay=late).verdict is FrictionVerdict.PROVED
            for machine in machines
        )

    low, high = 0, round(1 / ADDED_STEP)
    while high * ADDED_STEP <= MOST_ADDED_PERIODS and proves(high):
        low, high = high, 2 * high
    if high * ADDED_STEP > MOST_ADDED_PERIODS:
        return low * ADDED_STEP * period
    while high - low > 1:
        middle = (low + high) // 2
        if proves(middle):
            low, high = middle, high
        else:
            low, high = low, middle
    return low * ADDED_STEP * period


def friction_behind_lag(machine: FrictionPlant, lag: float) -> FrictionPlant:
    """Return a machine with the lag of the current loop [s] between command and force; friction
    acts without lag.
    """
    if not lag:
        return machine
    n = machine.A.shape[0]
    A = np.block(
        [[machine.A, machine.B_force[:, None]], [np.zeros((1, n)), np.array([[-1 / lag]])]]
    )
    return replace(
        machine,
        A=A,
        B_force=np.append(np.zeros(n), 1 / lag),
        B_port=pad_states(machine.B_port.T, n + 1).T,
        C_measured=pad_states(machine.C_measured, n + 1),
        C_port=pad_states(machine.C_port, n + 1),
        description=f"{machine.description}, behind a current loop of {1e3 * lag:g} ms",
    )
