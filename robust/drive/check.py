"""Gains of a drive checked against traces of its axis, on one page: set, worst case, friction, step.

    u* -->[delay]-->[1/(lag s + 1)]-->[ machine ]--> y        delay and lag are those of the settings

The machine is what a trace leaves once delay and lag are taken off, where its input is the set point of the current.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import chain, count
from pathlib import Path
from textwrap import wrap
from typing import NamedTuple

import control
import numpy as np

import nlfrf
from nlfrf._base.arguments import (
    format_hertz,
    format_paragraph,
    ratio_unit,
    require_kind,
    require_positive,
)
from nlfrf._base.command import MAX_ROWS
from nlfrf._base.types import JsonObject
from nlfrf._base.units import POSITIONS
from nlfrf._base.values import SCREEN_WIDTH, to_plain, value
from nlfrf.axis import Drive
from robust._base.states import State, Verdict
from robust.analysis.loop import assemble_loop, decide_nominal_stability
from robust.analysis.performance import StepResponse, classical_margins, measure_step, simulate_step
from robust.analysis.report import RobustnessReport
from robust.analysis.robustness import check
from robust.drive.friction import MODEL, READ, UNCERTIFIED, DriveFriction, bound_any_friction, judge_friction
from robust.drive.p_pi import cascade, with_set_point
from robust.drive.simulation import reason_against_simulation, simulate_rest, with_advice, with_load
from robust.friction.classes import any_bounded
from robust.friction.plant import friction_plant
from robust.friction.reading.balance import HALF_WIDTH, motion_of_record
from robust.friction.reading.force import FrictionForce, read_friction_force
from robust.friction.reading.from_blas import highest_level
from robust.friction.reading.from_fit import plant_of_fit
from robust.friction.reading.identification import FrictionFit
from robust.friction.reading.in_motion import fit_linear
from robust.friction.units import format_length
from robust.lti.connections import in_series
from robust.lti.lti import response
from robust.models.fit.nominal import NominalFit
from robust.models.sets.build import uncertainty
from robust.models.sets.model import UncertaintyModel
from robust.models.sets.orders import NEAR_BEST, UNDAMPED, doubtful_roots, scan_orders

#: Poles of a machine that are tried, two more than zeros: one mass, one whose friction slips, two masses, ...
ORDERS = range(2, 6)
#: An unstable pole above this share of the last line is a lead, and no machine that falls over.
LEAD = 0.3
#: Largest change of G that a pole and a zero make which cancel.
CANCELLED = 0.05
#: Periods of the drive by which a delay as read may be off: on 180 axes it was less.
DELAY_ERROR = 0.05
FILTERED = "a filter that the gains do not name, or a mode above the band, which looks like one"
#: By which an unstable pole raises the logarithm of the likelihood where scatter does so once in a hundred times.
SURE = 3.32
#: Turns by which the phase may rise over the band; an antiresonance gives half a turn, a delay that is too long any.
MOST_RISE = 0.75
#: Mean of unit phasors above which F lines agree on a lead; that of random phases is 0 +- 1/sqrt(2 F).
AGREE = 0.5
#: Lowest lines by which friction is seen to hold an axis, and the mean cosine of the phase of G above which it does:
#: 1 of a spring, 0 of a damper, -1 of a mass.
LOW_LINES, HELD = 6, 0.5
#: Factors on kp that are tried where the model is unstable, the mildest first.
TRIED_FACTORS = (0.5, 2.0, 0.25, 4.0, 0.1, 10.0, 0.05, 20.0)
#: What a drive does not say of its currents.
AMPERE_NOTE = ". A is rms or peak, the same in kp and in the force constant"
#: Why friction that creeps is not read as a class whose rest can be proved.
CREEP_NOTE = (
    "the friction creeps below break-away, or is damped there, as LuGre, Dahl and hysteresis with micro-damping do: no "
    "rest of such friction is proved"
)
#: What the words of the page mean.
LEGEND = """line: an excited frequency; rms: on the lines, in parentheses of the whole trace with its noise
radius: how far the FRF on a line may be from the model, relative to it; weight: bound of that error
at all frequencies, above the radius; rs: weight times |T|, all plants are stable if it is below 1
S = 1/(1 + L), T = 1 - S, L the loop gain; bandwidth of S: where |S| reaches 0.71
disk margin: change of gain, of phase, or less of both; lower gain margin: how far the gain may fall"""


class DriveVerdict(State):
    """What was found of gains, for linear loop and friction together; the exit code of the command is made of it."""

    PASSED = "passed"
    NOT_PASSED = "not passed"
    FRICTION_BOUNDED = "linear loop passed; friction bounded, rest unproved"
    FRICTION_NOT_JUDGED = "linear loop passed; friction not judged"


class RecordedGains(State):
    """Whether a trace was recorded with the gains that are checked, by its design."""

    SAME = "same"
    OTHER = "other"
    UNKNOWN = "unknown"


class BaseMotion(State):
    """Whether the axis moved while a trace was recorded, by its design."""

    AT_REST = "at rest"
    MOVING = "in motion"
    UNKNOWN = "unknown"


class Conditions(NamedTuple):
    """With which gains a trace was recorded, whether the axis moved, and what was found when all traces were read.

    velocity : base velocity [m/s], [rad/s]. warnings : what was warned of. unread : why pre-tests show no class of
    friction. levels : every level of the pre-tests.
    """

    gains: RecordedGains = RecordedGains.UNKNOWN
    motion: BaseMotion = BaseMotion.UNKNOWN
    warnings: tuple[str, ...] = ()
    unread: tuple[str, ...] = ()
    velocity: float = 0.0
    levels: tuple[nlfrf.Record, ...] = ()


class DoubtKind(State):
    """Why gains are not safe though the verdict may be good, or why the model cannot judge them."""

    AT_REST = "friction held the axis in the trace, which cannot judge the gains"
    OUTSIDE_BAND = "the loop crosses over outside the measured band"
    UNSTABLE = "the nominal loop is unstable with these gains"
    CONTRADICTED = "the linear model is wrong: it is unstable with gains that are known to be stable"
    THIN_MARGINS = "thin margins"
    APPROXIMATED = "an approximation of the drive was checked"
    WARNED_TRACE = "a trace has a warning"


class Doubt(NamedTuple):
    """What speaks against the gains or the model: its kind, and the number that shows it with what to do."""

    kind: DoubtKind
    description: str


@value
class DriveCheck:
    """What the traces of an axis say of the gains of its drive.

    Fields
    ------
    settings : Drive
        The gains, for a position in m or rad.
    unit : str
        Unit of the force that they ask for: "N", "Nm", or "A" without a torque constant.
    traces : tuple of str
        What each trace holds.
    base : str
        Which of them the set is made of.
    report : RobustnessReport
        Margins, set, verdict and proof.
    step : StepResponse or None
        A step of the position set point; none where the nominal loop is unstable.
    friction : DriveFriction
        What the traces at rest say of the friction, and the verdicts with it.
    actual : bool
        Whether the input of the traces is the actual current, so that nothing in them shows delay and lag.
    doubts : tuple of Doubt
        Why the gains are not safe though the verdict may be good, or why the model cannot judge them.
    given : Drive or None
        The settings as given: those of `settings` have delay and lag of the trace where it refutes the given ones.
    asked : float or None
        The distance from its rest [m] or [rad] within which the axis is asked to stay.
    """

    settings: Drive
    unit: str
    traces: tuple[str, ...]
    base: str
    report: RobustnessReport
    step: StepResponse | None
    friction: DriveFriction
    actual: bool
    doubts: tuple[Doubt, ...] = ()
    given: Drive | None = None
    asked: float | None = None

    @property
    def linear_passed(self) -> bool:
        """Whether the linear loop is stable with the whole set, and nothing speaks against its model or its margins."""
        return self.report.proofs.robustly_stable and not self.doubts

    @property
    def proved(self) -> bool:
        """Whether the drive itself is proved: stable with the whole set, at rest with every friction of the class."""
        return self.report.proofs.robustly_stable and self.friction.proved and self.settings.position_every == 1

    @property
    def verdict(self) -> DriveVerdict:
        """Whether linear loop and friction passed; what was not judged has not passed, nor what hunts in simulation."""
        if self.linear_passed and not self.friction.proofs and not self.friction.hunts:
            bounded = np.isfinite(self.friction.within)
            return DriveVerdict.FRICTION_BOUNDED if bounded else DriveVerdict.FRICTION_NOT_JUDGED
        return DriveVerdict.PASSED if self.linear_passed and self.friction.proved else DriveVerdict.NOT_PASSED

    @property
    def safe(self) -> bool:
        """Whether linear loop and friction were both judged, and passed."""
        return self.verdict is DriveVerdict.PASSED

    @property
    def findings(self) -> tuple[str, ...]:
        """What the verdict means for the axis, then why and on which conditions, a sentence each."""
        largest = f"max |S| is {self.report.margins.S_worst:.3g}, allowed are {self.report.peak:g}"
        stable = f"The linear loop is stable with every linear plant of the set; {largest}"
        if self.safe:
            rests = "The axis comes to rest with every friction of the class below"
            return "PASSED, linear loop and friction: the axis may run with these gains", stable, rests
        if self.linear_passed and self.friction.proofs:
            return f"NOT PASSED, friction: rest is not proved; the axis {self.friction.headline}", stable
        if self.linear_passed and self.friction.hunts:
            return f"NOT PASSED, friction: the axis {self.friction.headline}", stable
        if self.linear_passed:
            within = ""
            if self.verdict is DriveVerdict.FRICTION_BOUNDED:
                within = f"stays within {format_length(self.friction.within, self.settings.base_unit)}, proved, and "
            return f"{self.verdict}: the axis {within}{self.friction.headline}", stable
        why: str = self.doubts[0].kind if self.doubts else self.report.reason
        why += f"; the axis {self.friction.headline}" * self.friction.hunts
        more = ("The verdict below only says that no linear plant of the set is unstable",)
        return f"NOT PASSED, linear loop: {why}", *(more if self.report.proofs.robustly_stable else ())

    @property
    def conclusion(self) -> str:
        """What the verdict is on, linear loop and friction, and why."""
        return ". ".join(self.findings)

    @property
    def answers(self) -> dict[str, str]:
        """What is asked of an axis first: whether it rests, within how much, whether it hunts, what to change."""
        answers = self.friction.answers(self.settings.base_unit, self.asked)
        if not self.linear_passed:
            answers["change"] = "the linear loop first: see the warnings" if self.doubts else self.report.reason
        return {question: answer for question, answer in answers.items() if answer}

    def to_values(self) -> JsonObject:
        """Return all fields in terms of JSON, with `linear` and in `friction` what an engineer asks for, in SI units.

        friction.outcome : "rests", "settles" (within `within` [m]), "refuted" or "open": what is proved.
        friction.simulated : "rests" or "hunts", with amplitude [m], advice and the laws that the records leave.
        """
        fields, force, fit = to_plain(self, MAX_ROWS), self.friction.force, self.friction.fit
        assert isinstance(fields, dict)
        friction = fields.pop("friction")
        assert isinstance(friction, dict)
        known = fit if force is None else force.sliding
        simulated = self.friction.simulated
        mass = None if known is None or not np.isfinite(known.stds["mass"]) else known.mass
        interval = [None, None] if force is None else force.Fs.tolist()
        if force is None and fit is not None and np.isfinite(fit.stds["Fs"]):
            interval = list(fit.interval("Fs"))
        played: dict[str, object] = dict.fromkeys(("simulated", "simulated_amplitude", "advice", "laws"))
        if simulated is not None:
            played = {
                "simulated": "hunts" if simulated.hunts else "rests",
                "simulated_amplitude": simulated.amplitude * simulated.hunts,
                "advice": simulated.advice,
                "laws": simulated.laws,
            }
        asked = {
            "outcome": self.friction.outcome,
            "within": self.friction.within,
            "reason": self.friction.note,
            **played,
            "mass": mass,
            "mass_interval": None if mass is None or known is None else known.interval("mass"),
            "delay": None if known is None else known.delay,
            "Fs_interval": interval,
            "K0_used": self.friction.K0_used,
        }
        plain = to_plain(asked)
        assert isinstance(plain, dict)
        return {
            "verdict": self.verdict.value,
            "answers": self.answers,
            "linear": {"verdict": self.report.verdict.value, "max_S": self.report.margins.S_worst},
            "friction": plain | {name: held for name, held in friction.items() if name not in plain},
            **{name: held for name, held in fields.items() if name != "verdict"},
        }

    @property
    def stiffness(self) -> str | None:
        """The least stiffness of the axis in its loop, over frequency; None where it is not stable or not known."""
        G, K = self.report.curves.G, self.report.curves.K
        if G is None or K is None or not self.report.nominally_stable:
            return None
        stiffness = np.abs(1 + G * K) / np.abs(G)
        k = int(np.argmin(stiffness))
        unit = ratio_unit(self.unit, self.settings.base_unit)
        return f"{stiffness[k]:.3g} {unit} at least, at {format_hertz(self.report.curves.omega[k])}; more at all others"

    @property
    def assumption(self) -> str:
        """What is taken from the settings and not from the traces."""
        timing = f"delay {1e3 * self.settings.delay:g} ms and lag {1e3 * self.settings.lag:g} ms"
        margin = self.report.classical.delay_margin if self.report.nominally_stable else np.inf
        more = f"; the nominal loop tolerates {1e3 * margin:.3g} ms of additional delay" if margin < np.inf else ""
        if self.given is not None and (self.given.delay, self.given.lag) != (self.settings.delay, self.settings.lag):
            late = self.given.delay + self.given.lag > self.settings.delay + self.settings.lag
            why = "with which the machine would lead its force" if late else FILTERED
            timing += (
                f", as the trace shows them, and not {1e3 * self.given.delay:g} ms and {1e3 * self.given.lag:g} ms as "
                f"given, {why}"
            )
        if shown := self.friction.delay:
            more = f"; the traces at rest show {shown} of both together{more}"
        if self.actual:
            return f"assumed: {timing} of the current loop, which a trace of the actual current does not show{more}"
        return (
            f"{timing} of the current loop taken off, and put back in the loop: the fit takes up an error of them, "
            f"and the radius of the set what is left as misfit{more}"
        )

    def __str__(self) -> str:
        warned = [row for doubt in self.doubts for row in format_paragraph("warning", doubt.description)]
        first, more = wrap(f"{self.findings[0]}.", SCREEN_WIDTH), self.findings[1:]
        answers = [row for question, answer in self.answers.items() for row in format_paragraph(question, answer)]
        ratio, linear = ratio_unit(self.settings.base_unit, self.unit), replace(self.report, peak=np.inf)
        parts = {
            "gains": "\n".join(
                [*first, *answers, *(row for one in more for row in wrap(f"{one}.", SCREEN_WIDTH)), *warned]
            ),
            "drive": f"{self.settings}\n{describe_parameters(self.settings)}",
            "traces": "\n".join([*self.traces, self.assumption]),
            f"linear loop, from {self.base} ({ratio})": str(linear),  # its thin margins are among the warnings
            "stiffness against a force on the axis, nominal": self.stiffness,
            "friction": str(self.friction),
            "step of the position set point": self.step
            and f"of any size, in parts of it, linear, without limits: {self.step}",
            "words": LEGEND,
        }
        return "\n\n".join(f"{title}\n{content}" for title, content in parts.items() if content)


def read_trace(
    path: Path, settings: Drive, *, actual: bool = False, load: Callable[[Path], nlfrf.Record] = nlfrf.load_record
) -> nlfrf.Record:
    """Read a trace of a drive in the units of its velocity loop: position in m or rad, force in N or Nm, or current.

    Parameters
    ----------
    path : Path
        A measurement file as `nlfrf.load_record` reads it.
    settings : Drive
        Of the drive; a position without a unit is in its `position_unit`, an input without one in its output unit.
    actual : bool
        Whether the input is the actual current or force, measured behind the hold; a set point is held.
    load : callable
        `nlfrf.load_record` with its options.

    Raises
    ------
    ValueError
        Units that are none of a drive, a trace that is not sampled as the drive is.
    """
    return to_drive_units(load(path), settings, path, actual=actual)


def read_traces(
    traces: Sequence[Path],
    settings: Drive,
    *,
    actual: bool = False,
    load: Callable[[Path], nlfrf.Record] = nlfrf.load_record,
) -> tuple[list[nlfrf.Record], list[str], list[Conditions]]:
    """Read traces of any origin: records, names and conditions for `check_drive`, as `read_experiments` returns them.

    Parameters
    ----------
    traces : sequence of Path
        One file a level.
    settings, actual, load
        As for `read_trace`.

    Raises
    ------
    ValueError
        As `read_trace`.
    """
    records, conditions = [], []
    for path in traces:
        with collect_warnings(path.name) as warned:
            records.append(read_trace(path, settings, actual=actual, load=load))
        conditions.append(Conditions(warnings=tuple(warned)))
    return records, [path.name for path in traces], conditions


@contextmanager
def collect_warnings(name: str) -> Iterator[list[str]]:
    """Collect what data of that name are warned of meanwhile, and pass every warning on.

    That friction at rest makes another force than the design expects is left out: no verdict depends on it.
    """
    texts: list[str] = []
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            yield texts
    finally:
        data = [one for one in caught if issubclass(one.category, nlfrf.DataWarning)]
        texts += [f"{name}: {one.message}" for one in data if one.category is not nlfrf.axis.LevelWarning]
        for one in caught:
            warnings.warn_explicit(one.message, one.category, one.filename, one.lineno)


def read_experiments(
    traces: Sequence[Path],
    designs: Sequence[nlfrf.axis.AxisExperiment],
    settings: Drive,
    *,
    actual: bool = False,
    n_levels: int = 3,
    u: str = "force set point",
    y: str = "position",
    fs: float | None = None,
    start: float = 0.0,
) -> tuple[list[nlfrf.Record], list[str], list[Conditions]]:
    """Read the traces of experiments on a running drive, in the units of its velocity loop.

    Parameters
    ----------
    traces : sequence of Path
        One file a realisation.
    designs : sequence of nlfrf.axis.AxisExperiment
        One for all traces, or that of each trace, in their order.
    settings, actual
        As for `read_trace`.
    n_levels : int
        Levels to take of a pre-test, from sticking to sliding; motor and load need more than three.
    u, y, fs, start : as for `nlfrf.axis.load_trace`.

    Returns
    -------
    records : list of nlfrf.Record
        Each direction of a base motion, the levels of a pre-test, or the one at rest.
    names : list of str
        What each is called.
    conditions : list of Conditions
        Under which it was recorded, by its design.

    Raises
    ------
    ValueError
        Traces that are more or fewer than those of the designs; pre-tests only, which do not show three levels; as
        `read_trace` and `nlfrf.axis.load_trace`.
    """
    if len(designs) == len(traces):  # that of each trace: of an experiment of several realisations once
        of_trace, designs = list(designs), []
        while of_trace:
            designs.append(of_trace[0])
            of_trace = of_trace[of_trace[0].ms.n_realizations :]
    counts = [design.ms.n_realizations for design in designs]
    repeats = len(traces) // counts[0] if len(designs) == 1 else 1
    if sum(counts) * repeats != len(traces):
        raise ValueError(
            f"design must be one for all traces, or that of each trace, got {len(designs)} of {sum(counts)} "
            f"realisations in all, and {len(traces)} traces"
        )
    records, names, conditions, unread, warned_texts, left = [], [], [], [], [], list(traces)
    levels_at_rest: list[nlfrf.Record] = []
    for design in list(designs) * repeats:
        paths, left = left[: design.ms.n_realizations], left[design.ms.n_realizations :]
        with collect_warnings(paths[0].name) as warned:
            found, labels = nlfrf.axis.load_trace(paths, design, u=u, y=y, fs=fs, start=start), design.labels
        warned_texts += warned
        if design.is_ramp:
            read = nlfrf.axis.find_levels(found, design)
            levels_at_rest += [to_drive_units(record, settings, paths[0], actual=actual) for record in found]
            if read.reason:
                unread.append(f"{paths[0].name}: {read.reason}")
                continue
            taken = choose_levels(read, n_levels)
            found, labels = tuple(found[k] for k in taken), tuple(read.states[k].value for k in taken)
        records += [to_drive_units(record, settings, paths[0], actual=actual) for record in found]
        names += [f"{paths[0].name} {label}" for label in labels]
        motion = BaseMotion.MOVING if np.any(design.velocities) else BaseMotion.AT_REST
        strokes = list(design.groups.values())  # those of one direction are realisations of one record
        speeds = [design.velocities[one[0]] if motion is BaseMotion.MOVING else 0.0 for one in strokes[: len(found)]]
        gains = compare_gains(design, settings)
        conditions += [Conditions(gains=gains, motion=motion, velocity=float(speed)) for speed in speeds]
    if not records:
        raise ValueError(f"design of a pre-test must show three levels, got {'; '.join(unread)}")
    texts, why, levels = tuple(warned_texts), tuple(unread), tuple(levels_at_rest)
    return records, names, [one._replace(warnings=texts, unread=why, levels=levels) for one in conditions]


def choose_levels(levels: nlfrf.axis.AxisLevels, count: int) -> list[int]:
    """Return which levels of a pre-test to read: its three, or more between the lowest of them and the top."""
    named = np.flatnonzero(np.isin(levels.set_point_rms, levels.rms)).tolist()
    states = nlfrf.axis.FrictionRegime
    readable = (states.STICKS, states.BENDS, states.SLIDES)
    top = max(k for k, state in enumerate(levels.states) if state in readable)
    if count <= len(named) or top - named[0] + 1 < count:
        return named
    return np.unique(np.round(np.linspace(named[0], top, count)).astype(int)).tolist()


def compare_gains(design: nlfrf.axis.AxisExperiment, settings: Drive) -> RecordedGains:
    """Compare the gains an experiment was designed for with these; unknown where kp cannot be converted to A."""
    try:
        kp = settings.gain * settings.output_factor("A")
    except ValueError:  # no torque constant: the design has a kp in A
        return RecordedGains.UNKNOWN
    same = settings.base_unit == design.position_unit and design.has_gains(settings.kv, kp, settings.tn)
    return RecordedGains.SAME if same else RecordedGains.OTHER


def to_drive_units(record: nlfrf.Record, settings: Drive, path: Path, *, actual: bool) -> nlfrf.Record:
    """Return a record in the units of the velocity loop; the errors and units are those of `read_trace`."""
    if abs(record.fs / settings.fs - 1) > 1e-6:
        raise ValueError(
            f"trace must be sampled as the velocity loop is, at {settings.fs:g} Hz, got {path.name} at {record.fs:g} "
            "Hz: trace every period, as what lies between decimated samples is lost"
        )
    base, force = settings.base_unit, settings.force_unit
    kind, factor = POSITIONS.get(record.y_unit, ("", 1.0))
    position = settings.position_scale
    if record.y_unit in ("", position.unit):
        factor = position.factor
    elif kind != base:
        raise ValueError(
            f"trace must have the position in {position.unit} or a multiple of {base}, got {path.name} in "
            f"{record.y_unit}"
        )
    given = record.u_unit or settings.output_unit
    if given not in ("A", force):
        raise ValueError(f"trace must have an input in A or {force}, got {path.name} in {given}")
    unit = "A" if np.isnan(settings.torque_constant) and "A" in (given, settings.output_unit) else force
    scale = 1.0 if given == unit else settings.torque_constant
    if np.isnan(scale):
        raise ValueError(
            f"torque_constant must be given [{force}/A] between a gain in {settings.kp_unit} and a trace in {given}, "
            "got none"
        )
    return replace(
        record,
        u=record.u * scale,
        y=record.y * factor,
        input_units=(unit,),
        output_units=(base,),
        hold=("band-limited" if actual else "zoh") if record.hold == "unknown" else record.hold,
    )


def check_drive(
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
    """Check the gains of a drive against traces of its axis, one a level.

    The friction is read by `identify_friction` from the traces at rest, three levels or more; those whose condition is
    not known count as at rest.

    Parameters
    ----------
    records : sequence of nlfrf.Record
        From `read_trace`: set point of force or current in, position out.
    settings : Drive
        Gains, filters, sampling and units.
    names : sequence of str
        Of the traces.
    actual : bool
        Whether the input is the actual current or force, so that delay and lag are not in the traces.
    conditions : sequence of Conditions
        Under which each trace was recorded, from `read_experiments`; not known where not given.
    peak : float
        Largest |S| over the set that is not warned of; 2 when not given.
    stiction : float
        Largest over smallest force of a slider; the upper end of what was read where that is more.
    Fs : float, optional
        Largest friction force [N] or [Nm], for a bound of the error where the axis may not come to rest, and what
        changes it; the upper end of the break-away force that was read when not given. Where no friction was read, the
        bound is that of `any_bounded` around the linear model.
    spring : bool
        Whether a spring to ground, such as a balancer, is part of the machine.
    masses : int
        2 for a motor and a load; to read Maxwell slip on both takes up to half a minute.
    within : float, optional
        Distance [m] or [rad] within which the axis is to stay in the end: the page says whether it does.
    fit : FrictionFit, optional
        What was read from these traces at rest before, as `friction.fit` of a check of other gains: reading it again
        takes seconds. `spring` and `masses` are then those of the fit.

    Raises
    ------
    ValueError
        Two encoders; traces that make no model; a delay that is longer than in the traces; a fit in other units; a
        largest friction force for a loop in A.

    References
    ----------
    SP 2.4.3: max |S| below 2, a phase margin of 30 deg or more.
    """
    require_kind("settings", settings, Drive)
    peak, unit, base = require_positive("peak", peak), records[0].u_unit, settings.base_unit
    require_units(settings, unit, within=within, Fs=Fs, fit=fit)
    settings = replace(settings, position_unit=base, load_unit=base, unit_factor=1.0, load_factor=1.0)
    K = cascade(settings, output_unit=unit)
    names = list(names) or [f"trace {k + 1}" for k in range(len(records))]
    under = list(conditions) or [Conditions()] * len(records)
    blas, warned = [], []
    advance = count_steps(progress, len(records) + len(("machine", "friction", "loop", "bound", "simulation")))
    for name, record in zip(names, records, strict=True):
        with collect_warnings(name) as texts:
            blas.append(nlfrf.identify(record))
        warned.append(texts)
        advance()
    moving = in_motion(under)
    candidates = moving or list(range(len(records)))
    chosen = candidates[highest_level([blas[k] for k in candidates])]
    given = settings
    timings = [settings] if actual else timings_of(records[chosen], settings, masses, slides=chosen in moving)
    machine_bla, nominal, settings = fit_machine(blas[chosen], timings, actual=actual)
    advance()
    at_rest = [record for k, record in enumerate(records) if k not in moving]
    force, note = (None, "") if fit is not None else read_force(records, under, masses)
    if force is not None and force.creeps:
        friction = DriveFriction(note=CREEP_NOTE)
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
    friction = with_notes(replace(friction, force=force), under, note)
    advance()
    # poles below the band are those of a free axis: `doubt_of_crossover` says where they count
    machine = uncertainty(machine_bla, replace(nominal, warnings=()))
    model = replace(machine, nominal=behind_lag(machine.nominal, settings.lag))
    report = replace(check(model, K, delay=settings.delay), peak=peak)
    factor = None if report.nominally_stable else stabilizing_factor(model, K, settings.delay)
    advance()
    doubted = [
        None
        if friction.assumed is not None
        else doubt_of_trace_at_rest(names[chosen], machine_bla, under=under[chosen], unit=ratio_unit(unit, base)),
        doubt_of_crossover(report),
        doubt_of_unstable_model(names[chosen], report, under=under[chosen], factor=factor, proved=friction.proved),
        doubt_of_margins(report),
        doubt_of_approximation(settings),
    ]
    doubts = list(filter(None, doubted))
    kinds = {doubt.kind for doubt in doubts}
    misled = bool(kinds & {DoubtKind.AT_REST, DoubtKind.OUTSIDE_BAND, DoubtKind.CONTRADICTED})
    stable = report.nominally_stable or DoubtKind.CONTRADICTED in kinds
    # at rest an FRF judges nothing but the friction, which has its own balance, unless the set is made of it
    doubts += doubts_of_warnings(under, [warned[k] for k in moving or [chosen]])
    linear = machine.nominal if report.nominally_stable and not misled else None
    slides = stable and DoubtKind.AT_REST not in kinds
    friction = with_bound(friction, settings, machine=linear, slides=slides, Fs=Fs, unit=unit)
    advance()
    friction = simulate_drive(friction, settings, model=model, report=report, stable=stable, masses=masses)
    advance()
    return DriveCheck(
        settings=settings,
        unit=unit,
        traces=tuple(map(describe_trace, names, records, blas)),
        base=names[chosen],
        report=report_of_drive(report, misled=misled),
        step=step_of(model, K, settings=settings, unit=unit) if report.nominally_stable else None,
        friction=friction,
        actual=actual,
        doubts=tuple(doubts),
        given=given,
        asked=within,
    )


def require_units(
    settings: Drive, unit: str, *, within: float | None, Fs: float | None, fit: FrictionFit | None
) -> None:
    """Refuse two encoders, and what is in no unit of the traces, whose force is in `unit`."""
    if within is not None:
        require_positive("within", within)
    if settings.encoder == "both":
        raise ValueError('encoder must be "motor" or "load" for a check of one position, got "both"')
    if Fs is not None and require_positive("Fs", Fs) and unit == "A":
        raise ValueError(
            f"Fs must be left out where traces and gains are in A and no torque_constant says how many {unit} that is, "
            f"got {Fs:g} {settings.force_unit}"
        )
    if fit is not None:
        require_kind("fit", fit, FrictionFit)
        if fit.units != (unit, settings.base_unit):
            raise ValueError(
                f"fit must be in {unit} and {settings.base_unit} as the traces, got {' and '.join(fit.units)}"
            )


def with_notes(friction: DriveFriction, under: Sequence[Conditions], note: str) -> DriveFriction:
    """Return the friction with why some of it was not read; `note` is why not in motion."""
    if friction.fit is None and under[0].unread:
        friction = replace(friction, note="; ".join(under[0].unread))
    if note:
        friction = replace(friction, note=f"{friction.note}; {note}".lstrip("; "))
    if friction.assumed is None and friction.fit is not None and BaseMotion.UNKNOWN in {one.motion for one in under}:
        friction = replace(friction, note=f"{friction.note}. A trace that was recorded in motion needs its --design")
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
    """Return the friction with a bound of the error, where its largest force is known and nothing better was proved.

    machine : the linear model; None where it does not judge these gains. The bound is then of what was read in motion,
    where the axis slides in a loop that is stable. Fs : as given, else the upper end of what was read.
    """
    force = friction.force
    largest = Fs if Fs is not None or force is None else float(force.Fs[1])
    if largest is None or not np.isfinite(largest) or np.isfinite(friction.within):
        return friction
    damped = 0.0 if force is None else float(np.nan_to_num(force.bristle_time))
    any_friction = any_bounded(largest, damped, position_unit=settings.base_unit)
    plants, two = [], force is not None and force.load is not None
    if machine is not None and not two:
        plants = [(friction_plant(machine, position_unit=settings.base_unit), MODEL)]
    if force is not None and slides:  # a fit may have modes that no bound can follow: then what the trace shows
        read = plant_of_fit(force.sliding, encoder=settings.encoder)
        read = replace(read, delay=max(0.0, read.delay - settings.delay - settings.lag))
        plants.append((read, READ if machine is not None else UNCERTIFIED))
    if not plants:
        return replace(friction, note=f"{friction.note}. No bound with the given force: no linear model is known")
    for one, whose in plants:
        try:
            bounded = bound_any_friction(one, settings, any_friction, output_unit=unit)
        except ValueError as error:  # a delay that is too long for it
            return replace(friction, note=f"{friction.note}. No bound: {error}".lstrip(". "))
        found = replace(friction, bounded=bounded, bounded_machine=whose, largest=largest)
        if np.isfinite(bounded.error_bound):
            return found
    unknown = replace(friction, note=f"{friction.note}. No bound by what is read in motion: {bounded.reason}")
    return unknown if machine is None else found


def report_of_drive(report: RobustnessReport, *, misled: bool) -> RobustnessReport:
    """Return the report without what it must not say: advice on an unstable model, a verdict by a trace that misled."""
    if report.verdict is Verdict.NOT_ROBUST and misled:
        what = report.reason if report.nominally_stable else f"the model is {report.reason}"
        reason = f"{what}; but this trace cannot judge these gains, see the warning"
        return replace(report, verdict=Verdict.NOT_CERTIFIED, reason=reason, advice="")
    # advice on a loop, lower the gain, is wrong for a kp that is too low
    return report if report.nominally_stable else replace(report, advice="")


def doubts_of_warnings(under: Sequence[Conditions], warned: Sequence[Sequence[str]]) -> list[Doubt]:
    """Return a doubt for each warning: of reading the traces, then of identifying some of them."""
    texts = chain.from_iterable([*(one.warnings for one in under), *warned])
    return [Doubt(DoubtKind.WARNED_TRACE, text) for text in dict.fromkeys(texts)]


def simulate_drive(
    friction: DriveFriction,
    settings: Drive,
    *,
    model: UncertaintyModel,
    report: RobustnessReport,
    stable: bool,
    masses: int,
) -> DriveFriction:
    """Return the friction with what the axis as read does in the end, by simulation, and what to change.

    stable : whether the linear loop is, by its model or as the traces ran in it.
    """
    force = None if friction.force is None else with_load(friction.force, friction.fit)
    reason = reason_against_simulation(force, settings, masses)
    if not stable:
        reason = "the linear loop is unstable"
    if reason or force is None:
        return replace(friction, unsimulated=reason)
    friction = replace(friction, force=force)

    def keeps(other: Drive) -> bool:
        found = check(model, cascade(other, output_unit=force.sliding.units[0]), delay=other.delay)
        return found.proofs.robustly_stable and found.margins.S_worst <= report.peak

    found = simulate_rest(force, settings)
    if found.ended <= found.amplitudes.size / 2:
        return replace(friction, unsimulated=f"the integration came to its end in {found.ended} runs only")
    return replace(friction, simulated=with_advice(found, force, settings, keeps))


def count_steps(progress: Callable[[int, int], object] | None, total: int) -> Callable[[], None]:
    """Return what is to be called after each of so many steps; it says first that none is done.

    >>> advance = count_steps(lambda done, total: print(done, "of", total), 2)
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


def in_motion(under: Sequence[Conditions]) -> list[int]:
    """Return which traces were recorded in motion."""
    return [k for k, one in enumerate(under) if one.motion is BaseMotion.MOVING]


def read_force(
    records: Sequence[nlfrf.Record], under: Sequence[Conditions], masses: int
) -> tuple[FrictionForce | None, str]:
    """Return the friction without a law from traces in motion, and why there is none or no break-away force."""
    moving = in_motion(under)
    if not moving or records[0].u_unit == "A":
        return None, ""
    levels = under[0].levels or [record for k, record in enumerate(records) if k not in moving]
    try:
        velocities = [under[k].velocity for k in moving]
        force = read_friction_force([records[k] for k in moving], velocities, levels, masses=masses)
    except (ValueError, np.linalg.LinAlgError) as error:
        return None, str(error)
    return force, force.reason


def fit_machine(bla: nlfrf.Bla, timings: Sequence[Drive], *, actual: bool) -> tuple[nlfrf.Bla, NominalFit, Drive]:
    """Return the BLA of the machine, its fit, and the settings with a delay and lag that the trace does not refute.

    What is taken off too much leaves a machine that leads. Where the best fit leads with all timings, as where a pole
    and a zero above the band nearly cancel, the best one that does not lead is taken: the radius of the set holds what
    it leaves.

    timings : settings with the delays that are tried, in their order.
    """
    not_leading, reason = [], ""
    for timing in timings:
        s, machine = 1j * bla.omega, bla
        if not actual:  # delay and lag of the current loop are in the trace
            machine = bla.times(np.exp(s * timing.delay) * (1 + s * timing.lag), output_unit=bla.output_units)
        late = "" if actual else reason_of_late_settings(machine, timing)
        if late:
            reason = reason or late
            continue
        best, others = fit_orders(machine, cascade(timing, output_unit=bla.input_units[0]))
        leads = "" if actual else reason_of_lead(best.G, machine, timing)
        if not leads:
            return machine, best, timing
        reason = reason or leads
        not_leading += [
            (one.cost, machine, one, timing) for one in others if not reason_of_lead(one.G, machine, timing)
        ]
    if not not_leading:
        raise ValueError(reason)
    return min(not_leading, key=lambda one: one[0])[1:]


def timings_of(record: nlfrf.Record, settings: Drive, masses: int, *, slides: bool) -> list[Drive]:
    """Return the settings, and with delay and lag as a trace shows them of an axis that slides, the likelier first.

    The lag is kept as far as there is so much, or that which the trace shows. slides : whether the axis is known to.
    """
    numbers, stds = fit_linear(motion_of_record(record, 1), masses)
    late, std = numbers["delay"], stds["delay"]
    if not (numbers["mass"] > 0 and 0 < late < np.inf and np.isfinite(std)):
        return [settings]
    later = late - settings.delay - settings.lag > max(HALF_WIDTH * std, DELAY_ERROR * settings.dt)
    lag = min(max(settings.lag, numbers["lag"] if later else 0.0), late)
    traced = replace(settings, lag=lag, delay_periods=(late - lag) * settings.fs)
    # the phase of a load is read as delay, too: 4 of 59 axes showed up to 0.8 periods more than they had
    return [traced, settings] if slides and later and masses == 1 else [settings, traced]


def reason_of_lead(machine: control.StateSpace, bla: nlfrf.Bla, settings: Drive) -> str:
    """Why a delay is not that of the traces: what is left where it is too long is fitted by unstable poles."""
    fast = machine.poles()[machine.poles().real > 0]
    fast = fast[np.abs(fast) > LEAD * bla.omega[-1]]
    if not fast.size:
        return ""
    return (
        f"delay must be no longer than in the traces, got {1e3 * settings.delay:g} ms, and a lag of "
        f"{1e3 * settings.lag:g} ms: without them the machine leads, as with an unstable pole at "
        f"{format_hertz(float(np.abs(fast).max()))}"
    )


def fit_orders(machine: nlfrf.Bla, K: control.StateSpace) -> tuple[NominalFit, tuple[NominalFit, ...]]:
    """Return the fit of a machine, and those of every order: stable, unless an unstable pole is more than scatter.

    Where scatter explains no fit, what the class misses is kept from the crossover of the loop with the gains.

    A free axis has its pole at zero, and a few lines above it cannot tell on which side. A loop that is stable with the
    one and not with the other would be judged by scatter. A pole of friction that falls with speed is kept; one that a
    zero cancels is fitted to a single line and is none of the machine, however much it is worth.
    """
    free, held = (
        scan_orders(machine, n_poles=ORDERS, relative_degree=2, delay=0.0, stable=stable) for stable in (False, True)
    )
    kept = [k for k, fit in enumerate(free.fits) if not cancels_unstable_pole(fit.G)]
    unstable = bool(kept) and free.criterion[kept].min() + SURE < held.criterion.min()
    scan = held
    if unstable:
        scan = replace(free, fits=tuple(free.fits[k] for k in kept), sizes=tuple(free.sizes[k] for k in kept))
    omega_c = classical_margins(machine.omega, machine.G * response(K, machine.omega)).crossover
    if np.any(scan.fit.class_std) and not np.isnan(omega_c):
        each = [
            scan_orders(machine, n_poles=(n,), relative_degree=2, delay=0.0, stable=not unstable, omega_c=omega_c)
            for n in ORDERS
        ]
        each = [one for one in each if not cancels_unstable_pole(one.fit.G) and UNDAMPED not in doubtful_roots(one.fit)]
        if each:  # |S| is bounded over the set: one near the smallest, not the first that is small enough
            least = min(float(one.loop_radius[0]) for one in each)
            best = next(one for one in each if one.loop_radius[0] <= NEAR_BEST * least)
            return best.fit, (*(one.fit for one in each), *scan.fits)
    return scan.fit, scan.fits


def cancels_unstable_pole(G: control.StateSpace) -> bool:
    """Whether a zero z stands so close to an unstable pole p that both change G(jw) by at most |z - p| / Re p < 5 %.

    >>> s = control.tf("s")
    >>> cancels_unstable_pole(control.ss((s - 1.01) / (s - 1) / s**2)), cancels_unstable_pole(control.ss(1 / (s - 1)))
    (True, False)
    """
    zeros, poles = G.zeros(), G.poles()
    return any(np.any(np.abs(zeros - p) < CANCELLED * p.real) for p in poles if p.real > 0)


def reason_of_late_settings(machine: nlfrf.Bla, settings: Drive) -> str:
    """Why a delay is too long: it turns the phase of what is left up by more than a machine can, or by a whole turn."""
    omega, steps = machine.omega, machine.G[1:] * machine.G[:-1].conj()
    widths = np.diff(omega)
    longest, period = settings.delay + settings.lag, 2 * np.pi / float(widths.min())
    if longest >= period:  # a whole turn from line to line is none
        return (
            f"delay must be below {1e3 * period:.4g} ms, one over the distance of the lines, got "
            f"{1e3 * settings.delay:g} ms"
        )
    leads = np.linspace(0, longest, 2 + int(4 * longest * widths.max()))
    agree = np.mean((steps / np.abs(steps)) * np.exp(-1j * np.outer(leads, widths)), axis=1).real
    k = int(np.argmax(agree))
    turns = leads[k] * (omega[-1] - omega[0]) / (2 * np.pi)
    if not (agree[k] > AGREE and turns > MOST_RISE):
        return ""
    return (
        f"delay must be no longer than in the traces, got {1e3 * settings.delay:g} ms, and a lag of "
        f"{1e3 * settings.lag:g} ms: without them the machine leads: its phase rises by {turns:.2g} turns over the band"
    )


def doubt_of_trace_at_rest(name: str, machine: nlfrf.Bla, *, under: Conditions, unit: str) -> Doubt | None:
    """Why a trace says nothing of the axis in motion: a spring answers on low lines, or its design is at rest."""
    low = machine.G[:LOW_LINES]
    held = np.mean((low / np.abs(low)).real) > HELD
    if not (held or under.motion is BaseMotion.AT_REST):
        return None
    found = (
        f"in {name} the axis is held, as by a spring of {np.median((1 / low).real):.3g} {unit} from "
        f"{machine.f[0]:.4g} to {machine.f[: low.size][-1]:.4g} Hz"
        if held
        else f"{name} was recorded at rest, where friction holds the axis and lets it go"
    )
    return Doubt(
        DoubtKind.AT_REST,
        f"{found}. Unless a spring is part of the machine, this cannot judge the gains: in motion the axis is another "
        "machine. Take a trace in motion: nlfrf axis design ... --velocity V, then --design here. With a spring, give "
        "three levels or more",
    )


def doubt_of_crossover(report: RobustnessReport) -> Doubt | None:
    """Why margins are those of an assumed model: the loop crosses over where nothing was measured."""
    if report.given.band is None or report.curves.G is None or report.curves.K is None:
        return None
    crossover = classical_margins(report.curves.omega, report.curves.L).crossover
    first, last = report.given.band
    if not (crossover < 0.999 * first or crossover > 1.001 * last):
        return None
    above = crossover > last
    side, wanted = (
        ("above", f"up to {format_hertz(2 * crossover)}")
        if above
        else ("below", f"from {format_hertz(crossover / 2)} on")
    )
    return Doubt(
        DoubtKind.OUTSIDE_BAND,
        f"the loop crosses over at {format_hertz(crossover)}, {side} the measured band of {format_hertz(first)} to "
        f"{format_hertz(last)}. Stability and margins are those of a model that is assumed there. Take a trace "
        f"{wanted}",
    )


def stabilizing_factor(model: UncertaintyModel, K: control.StateSpace, delay: float) -> float | None:
    """Return the factor on kp, of those tried, nearest to one with which the nominal loop is stable; None of none.

    An integral and a position gain that are too high for kp are cured by more kp, all else by less.
    """
    loops = ((factor, assemble_loop(model, K * factor, w_P=None, delay=delay)) for factor in TRIED_FACTORS)
    return next((factor for factor, loop in loops if decide_nominal_stability(loop).stable), None)


def doubt_of_unstable_model(
    name: str, report: RobustnessReport, *, under: Conditions, factor: float | None, proved: bool
) -> Doubt | None:
    """Why a model that is unstable with the gains may be wrong: the loop ran with them, or is proved without it."""
    if report.nominally_stable:
        return None
    if proved and under.motion is not BaseMotion.MOVING:  # in motion it may be a mode that the levels do not reach
        return Doubt(
            DoubtKind.CONTRADICTED,
            f"the machine that all traces at rest give is proved stable with these gains, and the linear model of "
            f"{name} is unstable: it has the friction at rest in it. Take a trace in motion, in a band around the "
            "crossover: nlfrf axis design ... --velocity V, then --design here",
        )
    if under.gains is RecordedGains.SAME:
        return Doubt(
            DoubtKind.CONTRADICTED,
            f"{name} was recorded with these gains, by its design, in a loop that was stable. The model says that the "
            "loop is unstable: it is the model that is wrong, and nothing is known of the margins. Take a trace in "
            "motion, with more periods or realisations, in a band around the crossover",
        )
    cure = (
        f"no kp of {min(TRIED_FACTORS):g} to {max(TRIED_FACTORS):g} times this one makes it stable: change kv and tn"
        if factor is None
        else f"{factor:g} times this kp makes it stable"
    )
    if under.gains is RecordedGains.OTHER:
        return Doubt(
            DoubtKind.UNSTABLE,
            f"{name} was recorded with other gains, by its design. With these the loop is unstable; {cure}",
        )
    return Doubt(
        DoubtKind.UNSTABLE,
        f"if {name} was recorded with these gains, the loop was stable, and the model is wrong: take a trace in "
        f"motion, in a band around the crossover, and give its --design. If not, the loop is unstable; {cure}",
    )


def doubt_of_margins(report: RobustnessReport) -> Doubt | None:
    """Why a loop that is stable with the whole set is not safe: it is close to instability."""
    if not report.thin_margins:
        return None
    cures = {  # where the gain is nearer to its lower limit, kv and 1/tn are too high for this kp
        "higher": "raise kp, or lower kv and lengthen tn",
        "lower": "lower kp, or kv",
        "": "lower kv, or lengthen tn",
    }
    return Doubt(DoubtKind.THIN_MARGINS, f"{report.thin_margins}: {cures[report.better_gain]}")


def doubt_of_approximation(settings: Drive) -> Doubt | None:
    """Why what is proved is not proved of the drive: a slower position loop was taken as its mean over the phase."""
    if settings.position_every == 1:
        return None
    return Doubt(
        DoubtKind.APPROXIMATED,
        f"an approximation: the position loop runs once in {settings.position_every} periods, and this is its mean "
        "over the phase; nothing is proved of the drive itself",
    )


def behind_lag(machine: control.StateSpace, lag: float) -> control.StateSpace:
    """Return a machine behind the lag of the current loop [s]."""
    if not lag:
        return machine
    return in_series(control.StateSpace([[-1 / lag]], [[1 / lag]], [[1.0]], [[0.0]], 0), machine, dt=0)


def step_of(model: UncertaintyModel, K: control.StateSpace, *, settings: Drive, unit: str) -> StepResponse:
    """Return the step of the position set point, through the loops of the drive."""
    G, drive = assemble_loop(model, K, w_P=None, delay=settings.delay).G, with_set_point(settings, output_unit=unit)
    A = np.block([[G.A, G.B @ drive.C], [drive.B[:, 1:] @ G.C, drive.A]])
    direct = np.zeros_like(A)
    direct[: G.nstates, : G.nstates] = G.B @ drive.D[:, 1:] @ G.C
    B = np.vstack([G.B @ drive.D[:, :1], drive.B[:, :1]])
    C = np.hstack([G.C, np.zeros((1, drive.nstates))])
    closed = control.StateSpace(A + direct, B, C, 0, K.dt, remove_useless_states=False)
    t, y = simulate_step(closed)
    final = float(np.real(closed.dcgain()))
    return measure_step(t, y[0], u=np.full(t.size, np.nan), final=final, cut=True)


def describe_parameters(settings: Drive) -> str:
    """Say which of the settings are typed into the drive, and what an ampere is."""
    observed = settings.velocity_from == "observer"
    typed = {
        "kv": settings.kv,
        "kp": settings.kp,
        "tn": np.isfinite(settings.tn),
        "frequency of the observer": observed,
        "low-pass of the velocity": settings.velocity_lag and not observed,
        "filters": settings.filters,
    }
    ampere = settings.output_unit == "A" and bool(np.isfinite(settings.torque_constant))
    names = ", ".join(name for name, is_set in typed.items() if is_set)
    return f"to be set in the drive: {names}; the rest is the drive as it is" + AMPERE_NOTE * ampere


def describe_trace(name: str, record: nlfrf.Record, bla: nlfrf.Bla) -> str:
    """Level and band of a trace, a row: rms on the excited lines, and of all that was recorded."""
    force, motion = (
        np.sqrt(np.sum(np.abs(np.fft.rfft(signal.mean(axis=-2))[..., record.lines.excited]) ** 2) / 2)
        * 2
        / record.n_samples
        for signal in (record.u[0], record.y[0])
    )
    all_force, all_motion = np.sqrt(np.mean(record.u**2)), np.std(record.y)
    return (
        f"{name}: {force:.3g} {record.u_unit} rms ({all_force:.3g}), {motion:.3g} {record.y_unit} rms "
        f"({all_motion:.3g}); {bla.f.size} lines from {bla.f[0]:.4g} to {bla.f[-1]:.4g} Hz"
    )
