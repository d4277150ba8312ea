"""Check of the gains of a drive against traces of its axis: set, worst case, friction, step.

    u* -->[delay]-->[1/(lag s + 1)]-->[ machine ]--> y        delay and lag are those of the settings

If the input of a trace is the current set point, delay and lag are removed from it, and the rest is
the machine.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import count

import control
import numpy as np

import nlfrf
from nlfrf._base.arguments import (
    ratio_unit,
    require_kind,
    require_positive,
)
from nlfrf.rig import Drive
from robust._base.states import Verdict
from robust._base.warnings import DesignWarning
from robust.analysis.loop import assemble_loop
from robust.analysis.performance import StepResponse, measure_step, simulate_step
from robust.analysis.report import RobustnessReport
from robust.analysis.robustness import check as check_loop
from robust.friction.classes.bounded import Bounded
from robust.friction.plant import friction_plant
from robust.friction.reading.force import FrictionForce, read_friction_force
from robust.friction.reading.from_blas import highest_level
from robust.friction.reading.from_fit import plant_of_fit
from robust.friction.reading.friction_fit import FrictionFit
from robust.models.sets.build import uncertainty
from robust.models.sets.model import UncertaintyModel
from robust.servo.checking.doubts import (
    doubt_of_approximation,
    doubt_of_crossover,
    doubt_of_margins,
    doubt_of_trace_at_rest,
    doubt_of_unstable_model,
    doubts_of_warnings,
    stabilizing_factor,
)
from robust.servo.checking.findings import (
    BaseMotion,
    Conditions,
    DoubtKind,
    DriveCheck,
    describe_trace,
)
from robust.servo.checking.friction import (
    MODEL,
    READ,
    UNCERTIFIED,
    DriveFriction,
    bound_any_friction,
    judge_friction,
)
from robust.servo.checking.machine import behind_lag, fit_machine, timings_of
from robust.servo.checking.read import collect_warnings
from robust.servo.checking.simulation import (
    reason_against_simulation,
    simulate_rest,
    with_advice,
    with_load,
)
from robust.servo.gains.p_pi import cascade, with_set_point

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
        True if the input is the actual current or force. The traces then do not contain delay and
        lag of the current loop.
    conditions : sequence of Conditions
        Conditions of each trace (gains and motion during the recording), from `read_experiments`;
        unknown by default.
    peak : float
        Limit of |S| over the set, above which a warning is given.
    stiction : float
        Ratio of the largest to the smallest slip force of a friction element, an assumption. The
        upper end of the identified interval is used if it is larger.
    Fs : float, optional
        Largest friction force [N] or [Nm]. If rest is not proved, it gives a bound on the error.
        The default is the upper end of the identified break-away force. If no friction was
        identified, the bound is that of the class `Bounded` with the linear model.
    spring : bool
        True if a spring to ground, such as a balancer, is part of the machine.
    masses : int
        1 for one mass; 2 for a motor and a load, whose friction takes up to half a minute to
        identify.
    within : float, optional
        Required bound on the final error [m] or [rad]; the result shows whether it is met.
    fit : FrictionFit, optional
        Field `friction.fit` of an earlier check with the same traces and other gains. It saves the
        time of the identification. `spring` and `masses` are then those of the fit.
    progress : callable, optional
        Function that is called with (number of steps done, number of all steps).

    Returns
    -------
    DriveCheck
        Verdict, margins, friction and doubts. `print` shows what the command `robust servo check`
        prints.

    Raises
    ------
    ValueError
        Two encoders; traces from which no model can be fitted; a delay that is longer than the
        delay in the traces; a fit in other units; an `Fs` for a loop whose output is a current in
        A.

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
    names = list(names) or [f"trace {k + 1}" for k in range(len(records))]
    under = list(conditions) or [Conditions()] * len(records)
    blas, warned = [], []
    advance = _count_steps(
        progress, len(records) + len(("machine", "friction", "loop", "bound", "simulation"))
    )
    for name, record in zip(names, records, strict=True):
        with collect_warnings(name) as texts:
            blas.append(nlfrf.identify(record))
        warned.append(texts)
        advance()
    moving = _in_motion(under)
    candidates = moving or list(range(len(records)))
    chosen = candidates[highest_level([blas[k] for k in candidates])]
    given = settings
    if actual:
        timings = [settings]
    else:
        timings = timings_of(records[chosen], settings, masses, slides=chosen in moving)
    machine_bla, nominal, settings = fit_machine(blas[chosen], timings, actual=actual)
    advance()
    at_rest = [record for k, record in enumerate(records) if k not in moving]
    if fit is not None:
        force, note = None, ""
    else:
        force, note = _read_force(records, under, masses)
    if force is not None and force.creeps:
        friction = DriveFriction(note=_CREEP_NOTE)
    else:
        friction = judge_friction(
            at_rest,
            settings,
            actual=actual,
            stiction=stiction,
            Fs=Fs,
            spring=spring,
            masses=masses,
            fit=fit,
            sliding=None if force is None else force.sliding,
        )
    friction = _with_notes(replace(friction, force=force), under, note)
    advance()
    # a free axis has poles below the band; `doubt_of_crossover` warns if they matter
    with warnings.catch_warnings():  # the page shows the warnings of the set
        warnings.simplefilter("ignore", DesignWarning)
        machine = uncertainty(machine_bla, replace(nominal, warnings=()))
    model = replace(machine, nominal=behind_lag(machine.nominal, settings.lag))
    report = replace(check_loop(model, K, delay=settings.delay), peak=peak)
    if report.nominally_stable:
        factor = None
    else:
        factor = stabilizing_factor(model, K, settings.delay)
    advance()
    doubted = [
        (
            None
            if friction.assumed is not None
            else doubt_of_trace_at_rest(
                names[chosen], machine_bla, under=under[chosen], unit=ratio_unit(unit, base)
            )
        ),
        doubt_of_crossover(report),
        doubt_of_unstable_model(
            names[chosen], report, under=under[chosen], factor=factor, proved=friction.proved
        ),
        doubt_of_margins(report),
        doubt_of_approximation(settings),
    ]
    doubts = list(filter(None, doubted))
    kinds = {doubt.kind for doubt in doubts}
    misled = bool(kinds & {DoubtKind.AT_REST, DoubtKind.OUTSIDE_BAND, DoubtKind.CONTRADICTED})
    stable = report.nominally_stable or DoubtKind.CONTRADICTED in kinds
    # warnings of identifying a trace at rest count only if the set is made from it: friction has
    # its own balance
    doubts += doubts_of_warnings(under, [warned[k] for k in moving or [chosen]])
    linear = machine.nominal if report.nominally_stable and not misled else None
    slides = stable and DoubtKind.AT_REST not in kinds
    friction = with_bound(friction, settings, machine=linear, slides=slides, Fs=Fs, unit=unit)
    advance()
    friction = simulate_drive(
        friction, settings, model=model, report=report, stable=stable, masses=masses
    )
    advance()
    return DriveCheck(
        settings=settings,
        unit=unit,
        traces=tuple(
            describe_trace(names[k], record, blas[k], k in moving)
            for k, record in enumerate(records)
        ),
        base=names[chosen],
        report=_report_of_drive(report, misled=misled),
        step=_step_of(model, K, settings=settings, unit=unit) if report.nominally_stable else None,
        friction=friction,
        actual=actual,
        doubts=tuple(doubts),
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


def with_bound(
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


def _report_of_drive(report: RobustnessReport, *, misled: bool) -> RobustnessReport:
    """Return the report without advice on an unstable model, and without a verdict from a trace
    that misleads.
    """
    if report.verdict is Verdict.NOT_ROBUST and misled:
        if report.nominally_stable:
            what = report.reason
        else:
            what = f"the model is {report.reason}"
        reason = f"{what}; but the trace cannot judge these gains, see the warning"
        return replace(report, verdict=Verdict.NOT_CERTIFIED, reason=reason, advice="")
    # the advice for a general loop is to lower the gain, which is wrong for a kp that is too low
    if report.nominally_stable:
        return report
    return replace(report, advice="")


def simulate_drive(
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


def _in_motion(under: Sequence[Conditions]) -> list[int]:
    """Return the indices of the traces in motion."""
    return [k for k, one in enumerate(under) if one.motion is BaseMotion.MOVING]


def _read_force(
    records: Sequence[nlfrf.Record], under: Sequence[Conditions], masses: int
) -> tuple[FrictionForce | None, str]:
    """Return the friction for any law from traces in motion, and the reason if there is none or no
    break-away force.
    """
    moving = _in_motion(under)
    if not moving or records[0].u_unit == "A":
        return None, ""
    levels = under[0].levels or [record for k, record in enumerate(records) if k not in moving]
    try:
        velocities = [under[k].velocity for k in moving]
        force = read_friction_force([records[k] for k in moving], velocities, levels, masses=masses)
    except (ValueError, np.linalg.LinAlgError) as error:
        return None, str(error)
    return force, force.reason


def _step_of(
    model: UncertaintyModel, K: control.StateSpace, *, settings: Drive, unit: str
) -> StepResponse:
    """Return the response to a step of the position set point, through the loops of the drive."""
    G = assemble_loop(model, K, w_P=None, delay=settings.delay).G
    drive = with_set_point(settings, output_unit=unit)
    A = np.block([[G.A, G.B @ drive.C], [drive.B[:, 1:] @ G.C, drive.A]])
    direct = np.zeros_like(A)
    direct[: G.nstates, : G.nstates] = G.B @ drive.D[:, 1:] @ G.C
    B = np.vstack([G.B @ drive.D[:, :1], drive.B[:, :1]])
    C = np.hstack([G.C, np.zeros((1, drive.nstates))])
    closed = control.StateSpace(A + direct, B, C, 0, K.dt, remove_useless_states=False)
    t, y = simulate_step(closed)
    final = float(np.real(closed.dcgain()))
    return measure_step(t, y[0], u=np.full(t.size, np.nan), final=final, cut=True)
