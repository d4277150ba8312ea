"""The motion of the axis: a bound of the error, and a simulation."""

from __future__ import annotations

from collections.abc import Callable, Set
from dataclasses import replace

import control
import numpy as np

from nlfrf.rig import Drive
from robust.analysis.report import RobustnessReport
from robust.analysis.robustness import check as check_loop
from robust.friction.classes.bounded import Bounded
from robust.friction.plant import friction_plant
from robust.friction.reading.from_fit import plant_of_fit
from robust.models.sets.model import UncertaintyModel
from robust.servo.checking.drive_friction import MODEL, READ, UNCERTIFIED, DriveFriction
from robust.servo.checking.findings import DoubtKind
from robust.servo.checking.friction import bound_any_friction
from robust.servo.checking.linear import LinearLoop
from robust.servo.checking.simulation import (
    reason_against_simulation,
    simulate_rest,
    with_advice,
    with_load,
)
from robust.servo.gains.p_pi import cascade


def bound_and_simulate(
    friction: DriveFriction,
    loop: LinearLoop,
    settings: Drive,
    kinds: Set[DoubtKind],
    *,
    misled: bool,
    Fs: float | None,
    masses: int,
    advance: Callable[[], None],
) -> DriveFriction:
    """Return the friction with what is known of the motion beside its proof: a bound of the error,
    and a simulation.

    misled : True if the linear model cannot judge these gains.
    """
    stable = loop.stable or DoubtKind.CONTRADICTED in kinds
    friction = _with_bound(
        friction,
        settings,
        machine=loop.machine if loop.stable and not misled else None,
        slides=stable and DoubtKind.AT_REST not in kinds,
        Fs=Fs,
        unit=loop.unit,
    )
    advance()
    friction = _simulate_drive(
        friction, settings, model=loop.model, report=loop.report, stable=stable, masses=masses
    )
    advance()
    return friction


def _with_bound(
    friction: DriveFriction,
    settings: Drive,
    *,
    machine: control.StateSpace | None,
    slides: bool,
    Fs: float | None,
    unit: str,
) -> DriveFriction:
    """Return the friction with a bound of the error, if its largest force is known and nothing
    better was proved.

    machine : the linear model; None if it cannot judge these gains. The bound then holds for the
    machine as read in motion, if the axis slides in a stable loop. Fs : as given; the default is
    the upper end of the interval as read.
    """
    force = friction.force
    if Fs is not None or force is None:
        largest = Fs
    else:
        largest = float(force.Fs[1])
    if largest is None or not np.isfinite(largest) or np.isfinite(friction.within):
        return friction
    if force is None:
        damped = 0.0
    else:
        damped = float(np.nan_to_num(force.bristle_time))
    any_friction = Bounded(largest, damped, position_unit=settings.base_unit)
    plants, two = [], force is not None and force.load is not None
    if machine is not None and not two:
        plants = [(friction_plant(machine, position_unit=settings.base_unit), MODEL)]
    if (
        force is not None and slides
    ):  # a fit may have modes that allow no bound; the machine as read in motion may
        read = plant_of_fit(force.sliding, encoder=settings.encoder)
        read = replace(read, delay=max(0.0, read.delay - settings.delay - settings.lag))
        plants.append((read, READ if machine is not None else UNCERTIFIED))
    if not plants:
        return _with_note(friction, "No bound with the given force: there is no linear model")
    for one, whose in plants:
        try:
            bounded = bound_any_friction(one, settings, any_friction, output_unit=unit)
        except ValueError as error:  # the delay is too long for the bound
            return _with_note(friction, f"No bound: {error}")
        found = replace(friction, bounded=bounded, bounded_machine=whose, largest=largest)
        if np.isfinite(bounded.error_bound):
            return found
    if machine is None:
        return _with_note(friction, f"No bound for the machine as read in motion: {bounded.reason}")
    return found


def _with_note(friction: DriveFriction, sentence: str) -> DriveFriction:
    return replace(friction, note=". ".join(filter(None, [friction.note, sentence])))


def _simulate_drive(
    friction: DriveFriction,
    settings: Drive,
    *,
    model: UncertaintyModel,
    report: RobustnessReport,
    stable: bool,
    masses: int,
) -> DriveFriction:
    """Return the friction with a simulation of the axis as read, and with the change to make if it
    hunts.

    stable : True if the linear loop is stable, by its model or because the traces were recorded in
    it.
    """
    if friction.force is None:
        force = None
    else:
        force = with_load(friction.force, friction.fit)
    reason = reason_against_simulation(force, settings, masses)
    if not stable:
        reason = "the linear loop is unstable"
    if reason or force is None:
        return replace(friction, unsimulated=reason)
    friction = replace(friction, force=force)

    def keeps(other: Drive) -> bool:
        found = check_loop(
            model, cascade(other, output_unit=force.sliding.units[0]), delay=other.delay
        )
        return found.proofs.robustly_stable and found.margins.S_worst <= report.peak

    found = simulate_rest(force, settings)
    if found.ended <= found.amplitudes.size / 2:
        return replace(
            friction, unsimulated=f"the integration succeeded in {found.ended} runs only"
        )
    return replace(friction, simulated=with_advice(found, force, settings, keeps))
