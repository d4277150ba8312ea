"""Check of the gains of a drive against traces of its axis: set, worst case, friction, step.

    u* -->[delay]-->[1/(lag s + 1)]-->[ machine ]--> y        delay and lag are those of the settings

If the input of a trace is the current set point, delay and lag are removed from it, and the rest is
the machine.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import count
from typing import Any

import numpy as np

import nlfrf
from nlfrf._base.arguments import require_kind, require_positive
from nlfrf.rig import Drive
from robust.friction.reading.force import FrictionForce, read_friction_force
from robust.friction.reading.friction_fit import FrictionFit
from robust.models.fit.nominal_fit import NominalFit
from robust.servo.checking.drive_friction import DriveFriction
from robust.servo.checking.findings import BaseMotion, Conditions, DoubtKind, DriveCheck
from robust.servo.checking.friction import judge_friction
from robust.servo.checking.linear import check_linear_loop, doubts_of_loop, report_of_drive, step_of
from robust.servo.checking.machine import fit_machine, timings_of
from robust.servo.checking.rest import bound_and_simulate
from robust.servo.checking.traces import Traces, identify_traces
from robust.servo.gains.p_pi import cascade

#: Reason why creeping friction is not read as a class whose rest can be proved.
_CREEP_NOTE = (
    "the friction creeps or is damped below break-away, like LuGre, Dahl and hysteresis with"
    " micro-damping: rest cannot be proved with such friction"
)


def check(
    records: Sequence[nlfrf.Record],
    settings: Drive,
    *,
    names: Sequence[str] = (),
    actual: bool = False,
    conditions: Sequence[Conditions] = (),
    peak: float = 2.0,
    stiction: float = 1.5,
    Fs: float | None = None,
    spring: bool = False,
    masses: int = 1,
    within: float | None = None,
    fit: FrictionFit | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> DriveCheck:
    """Check the gains of a drive with measured traces of its axis.

    Use this before you enter gains in a drive. The linear loop is checked with a trace in motion.
    The friction is identified from traces at rest, at three levels or more. A trace with unknown
    conditions counts as a trace at rest.

    Parameters
    ----------
    records : sequence of nlfrf.Record
        Traces from `read_experiments` or `read_traces`, with the set point of force or current as
        input and the position as output.
    settings : Drive
        Gains, filters, sampling and units.
    names : sequence of str
        Names of the traces.
    actual : bool
        True if the input is the actual current or force, without delay and lag of the current loop.
    conditions : sequence of Conditions
        Conditions of each trace (gains and motion during the recording), from `read_experiments`;
        unknown by default.
    peak : float
        Limit of |S| over the set, above which a warning is given.
    stiction : float
        Assumed ratio of the largest to the smallest slip force of a friction element, at least the
        upper end of the identified interval.
    Fs : float, optional
        Largest friction force [N] or [Nm], for a bound on the error if rest is not proved; by
        default the upper end of the identified break-away force.
    spring : bool
        True if a spring to ground, such as a balancer, is part of the machine.
    masses : int
        1, or 2 for a motor and a load, which takes up to half a minute to identify.
    within : float, optional
        Required bound on the final error [m] or [rad]; the result shows whether it is met.
    fit : FrictionFit, optional
        `friction.fit` of an earlier check with the same traces, `spring` and `masses`; it saves the
        identification.
    progress : callable, optional
        Function that is called with (number of steps done, number of all steps).

    Returns
    -------
    DriveCheck
        Verdict, margins, friction and doubts; `print` shows what `robust servo check` prints.

    Raises
    ------
    ValueError
        Two encoders; traces from which no model can be fitted; a delay longer than that of the
        traces; a fit in other units; an `Fs` for a loop whose output is a current in A.

    References
    ----------
    SP 2.4.3: max |S| below 2, a phase margin of 30 deg or more.

    Examples
    --------
    >>> from nlfrf.rig import Drive
    >>> axis = nlfrf.servo_axis("linear motor")
    >>> ms = nlfrf.multisine(fs=4000, n_samples=4000, f_min=5, f_max=400, rms=60, rng=1)
    >>> record = nlfrf.rig.simulate_servo(axis, ms, n_periods=2, base_velocity=0.1)
    >>> gains = Drive(fs=4000, kv=20, kp=40, kp_unit="A/(m/s)", tn=0.05, torque_constant=52.8)
    >>> check([record], gains).linear_passed
    True
    """
    require_kind("settings", settings, Drive)
    peak, unit, base = require_positive("peak", peak), records[0].u_unit, settings.base_unit
    _require_units(settings, unit, within=within, Fs=Fs, fit=fit)
    settings = replace(
        settings, position_unit=base, load_unit=base, unit_factor=1.0, load_factor=1.0
    )
    K = cascade(settings, output_unit=unit)
    steps = len(records) + len(("machine", "friction", "loop", "bound", "simulation"))
    advance = _count_steps(progress, steps)
    traces = identify_traces(records, names, conditions, advance)
    given = settings
    bla, nominal, settings = _fit_machine_of(traces, settings, masses, actual=actual)
    advance()
    assumed = {"stiction": stiction, "Fs": Fs, "spring": spring}
    friction = _judge_friction_of_traces(
        traces, settings, actual=actual, masses=masses, fit=fit, **assumed
    )
    advance()
    loop = check_linear_loop(bla, nominal, K, settings, unit=unit, peak=peak)
    advance()
    doubts = doubts_of_loop(loop, traces, bla, settings, friction)
    kinds = {doubt.kind for doubt in doubts}
    misled = bool(kinds & {DoubtKind.AT_REST, DoubtKind.OUTSIDE_BAND, DoubtKind.CONTRADICTED})
    friction = bound_and_simulate(
        friction, loop, settings, kinds, misled=misled, Fs=Fs, masses=masses, advance=advance
    )
    return DriveCheck(
        settings=settings,
        unit=unit,
        traces=traces.describe(),
        base=traces.names[traces.chosen],
        report=report_of_drive(loop.report, misled=misled),
        step=step_of(loop, settings) if loop.stable else None,
        friction=friction,
        actual=actual,
        doubts=(*doubts, *traces.doubts()),
        given=given,
        asked=within,
    )


def _require_units(
    settings: Drive, unit: str, *, within: float | None, Fs: float | None, fit: FrictionFit | None
) -> None:
    """Refuse two encoders, and arguments that are not in the units of the traces, whose force is in
    `unit`.
    """
    if within is not None:
        require_positive("within", within)
    if settings.encoder == "both":
        raise ValueError(
            'encoder must be "motor" or "load" for a check of one position, got "both"'
        )
    if Fs is not None and require_positive("Fs", Fs) and unit == "A":
        raise ValueError(
            "Fs must be left out where traces and gains are in A and no torque_constant converts"
            f" it to {unit}, got {Fs:g} {settings.force_unit}"
        )
    if fit is not None:
        require_kind("fit", fit, FrictionFit)
        if fit.units != (unit, settings.base_unit):
            raise ValueError(
                f"fit must be in {unit} and {settings.base_unit} as the traces, got"
                f" {' and '.join(fit.units)}"
            )


def _count_steps(progress: Callable[[int, int], object] | None, total: int) -> Callable[[], None]:
    """Return the function to call after each of `total` steps, and report that none is done yet.

    >>> advance = _count_steps(lambda done, total: print(done, "of", total), 2)
    0 of 2
    >>> advance()
    1 of 2
    """
    done = count()

    def advance() -> None:
        if progress is not None:
            progress(next(done), total)

    advance()
    return advance


def _fit_machine_of(
    traces: Traces, settings: Drive, masses: int, *, actual: bool
) -> tuple[nlfrf.Bla, NominalFit, Drive]:
    """Return `fit_machine` for the chosen trace, with the timings that it shows."""
    k = traces.chosen
    if actual:
        timings = [settings]
    else:
        timings = timings_of(traces.records[k], settings, masses, slides=k in traces.moving)
    return fit_machine(traces.blas[k], timings, actual=actual)


def _judge_friction_of_traces(
    traces: Traces,
    settings: Drive,
    *,
    masses: int,
    fit: FrictionFit | None,
    **options: Any,
) -> DriveFriction:
    """Return the friction for any law from traces in motion, and that of a class with its proof
    from traces at rest; options as for `judge_friction`.
    """
    if fit is not None:
        force, note = None, ""
    else:
        force, note = _read_force(traces, masses)
    if force is not None and force.creeps:
        friction = DriveFriction(note=_CREEP_NOTE)
    else:
        friction = judge_friction(
            traces.at_rest,
            settings,
            masses=masses,
            fit=fit,
            sliding=None if force is None else force.sliding,
            **options,
        )
    return _with_notes(replace(friction, force=force), traces.under, note)


def _read_force(traces: Traces, masses: int) -> tuple[FrictionForce | None, str]:
    """Return the friction for any law from traces in motion, and the reason if there is none or no
    break-away force.
    """
    moving = traces.moving
    if not moving or traces.records[0].u_unit == "A":
        return None, ""
    try:
        force = read_friction_force(
            [traces.records[k] for k in moving],
            [traces.under[k].velocity for k in moving],
            traces.under[0].levels or traces.at_rest,
            masses=masses,
        )
    except (ValueError, np.linalg.LinAlgError) as error:
        return None, str(error)
    return force, force.reason


def _with_notes(friction: DriveFriction, under: Sequence[Conditions], note: str) -> DriveFriction:
    """Return the friction with the reasons why some of it was not read; `note` is the reason for
    traces in motion.
    """
    if friction.fit is None and under[0].unread:
        friction = replace(friction, note="; ".join(under[0].unread))
    if note:
        friction = replace(friction, note=f"{friction.note}; {note}".lstrip("; "))
    if (
        friction.assumed is None
        and friction.fit is not None
        and BaseMotion.UNKNOWN in {one.motion for one in under}
    ):
        friction = replace(
            friction, note=f"{friction.note}. For a trace in motion give its --design"
        )
    return friction
