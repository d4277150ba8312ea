"""The result of a check of gains: verdict, conditions of the traces, doubts, and the page as
text.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

import nlfrf
from nlfrf._base.arguments import ratio_unit
from nlfrf._base.command import MAX_ROWS
from nlfrf._base.types import JsonObject
from nlfrf._base.values import to_plain, value
from nlfrf.rig import Drive
from robust._base.states import State
from robust.analysis.report import RobustnessReport
from robust.analysis.step import StepResponse
from robust.friction.units import format_length
from robust.lti.grids import Peak
from robust.pages.section import Fact, Section
from robust.pages.text import format_sections
from robust.servo.checking.drive_friction import DriveFriction

_FILTERED = "a filter that is missing in the gains, or a mode above the band, acts like them"


#: Manuals of drives often leave open whether their amperes are rms or peak values.
_AMPERE_NOTE = ". A may be rms or peak, but must be the same in kp and in the force constant"


#: Meaning of the terms of the page.
_WORDS = {
    "line": "an excited frequency",
    "rms": "on the lines; total: of the whole trace, with its noise",
    "radius": "largest distance of the FRF on a line from the model, relative to the model",
    "weight": "bound of this distance at all frequencies, at least the radius",
    "rs": "weight times |T|; the loop is stable with every plant of the set if rs is below 1",
    "S, T": (
        "S = 1/(1 + L) and T = 1 - S, with the loop gain L; |S| reaches 0.71 at the bandwidth of S"
    ),
    "disk margin": (
        "change of gain, of phase, or of both by less, with which the loop is still stable"
    ),
}
_TRACE_HEAD = ("trace", "force, rms", "total", "motion, rms", "total", "lines", "band")


class DriveVerdict(State):
    """Verdict on gains, for linear loop and friction together; it decides the exit code of the
    command.
    """

    PASSED = "passed"
    NOT_PASSED = "not passed"
    FRICTION_BOUNDED = "linear loop passed; friction bounded, rest unproved"
    FRICTION_NOT_JUDGED = "linear loop passed; friction not judged"


class RecordedGains(State):
    """Gains during a recording, by its design: the gains to check, or others."""

    SAME = "same"
    OTHER = "other"
    UNKNOWN = "unknown"


class BaseMotion(State):
    """Motion of the axis during a recording, by its design."""

    AT_REST = "at rest"
    MOVING = "in motion"
    UNKNOWN = "unknown"


class Conditions(NamedTuple):
    """Conditions of a trace: gains, motion, base velocity [m/s] or [rad/s], and warnings from
    reading all traces.

    unread : reason for each pre-test from which no class of friction can be read. levels : all
    levels of the pre-tests.
    """

    gains: RecordedGains = RecordedGains.UNKNOWN
    motion: BaseMotion = BaseMotion.UNKNOWN
    warnings: tuple[str, ...] = ()
    unread: tuple[str, ...] = ()
    velocity: float = 0.0
    levels: tuple[nlfrf.Record, ...] = ()


class DoubtKind(State):
    """Kinds of reasons to distrust the gains or the model, even with a good verdict."""

    AT_REST = "friction held the axis in the trace, which cannot judge the gains"
    OUTSIDE_BAND = "the loop crosses over outside the measured band"
    UNSTABLE = "the nominal loop is unstable with these gains"
    CONTRADICTED = (
        "the linear model is wrong: it is unstable with gains that are known to be stable"
    )
    THIN_MARGINS = "thin margins"
    APPROXIMATED = "an approximation of the drive was checked"
    WARNED_TRACE = "a trace has a warning"


class Doubt(NamedTuple):
    """A reason to distrust the gains or the model: kind, evidence, remedy."""

    kind: DoubtKind
    description: str


class Trace(NamedTuple):
    """A trace: rms of force and motion, each on the lines and in total; motion of the axis; lines
    and band [Hz].
    """

    name: str
    force: tuple[float, float]
    motion: tuple[float, float]
    units: tuple[str, str]
    moving: bool
    n_lines: int
    band: tuple[float, float]

    @property
    def row(self) -> tuple[str, ...]:
        """Row of the table below `_TRACE_HEAD`."""
        N, m = self.units
        forces = (f"{one:.3g} {N}" for one in self.force)
        motions = (format_length(one, m) for one in self.motion)
        first, last = self.band
        return self.name, *forces, *motions, str(self.n_lines), f"{first:.4g} to {last:.4g} Hz"


@value
class DriveCheck:
    """Result of a check of the gains of a drive against traces of its axis.

    Fields
    ------
    settings : Drive
        The gains, for a position in m or rad. Delay and lag are those of the trace if the trace
        refutes the given values.
    unit : str
        Unit of the force set point: "N", "Nm", or "A" without a torque constant.
    traces : tuple of Trace
        Force, motion and band of each trace.
    base : str
        Name of the trace from which the uncertainty set is made.
    report : RobustnessReport
        Margins, set, verdict and proof.
    step : StepResponse or None
        A step of the position set point; None if the nominal loop is unstable.
    friction : DriveFriction
        The friction identified from the traces, and the verdicts with this friction.
    actual : bool
        True if the input of the traces is the actual current, which does not show delay and lag.
    doubts : tuple of Doubt
        Reasons to distrust the gains or the model, even with a good verdict.
    given : Drive or None
        The settings as given, with the given delay and lag.
    asked : float or None
        Distance from rest [m] or [rad] within which the axis is required to stay.
    """

    settings: Drive
    unit: str
    traces: tuple[Trace, ...]
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
        """True if the linear loop is stable with the whole set, and there is no doubt."""
        return self.report.proofs.robustly_stable and not self.doubts

    @property
    def proved(self) -> bool:
        """True if both are proved: the loop is stable with the whole set, and the axis comes to
        rest with every friction of the class.
        """
        return (
            self.report.proofs.robustly_stable
            and self.friction.proved
            and self.settings.position_every == 1
        )

    @property
    def verdict(self) -> DriveVerdict:
        """Verdict on linear loop and friction.

        The friction has not passed if it was not judged, or if the axis hunts in the simulation.
        """
        if self.linear_passed and not self.friction.proofs and not self.friction.hunts:
            bounded = np.isfinite(self.friction.within)
            if bounded:
                return DriveVerdict.FRICTION_BOUNDED
            return DriveVerdict.FRICTION_NOT_JUDGED
        if self.linear_passed and self.friction.proved:
            return DriveVerdict.PASSED
        return DriveVerdict.NOT_PASSED

    @property
    def safe(self) -> bool:
        """True if linear loop and friction were both judged, and passed."""
        return self.verdict is DriveVerdict.PASSED

    @property
    def findings(self) -> tuple[str, ...]:
        """Meaning of the verdict for the axis, then its reasons and conditions, one sentence each."""
        largest = (
            f"max |S| is {self.report.margins.S_worst:.3g}, at most {self.report.peak:g} is allowed"
        )
        stable = f"The linear loop is stable with every linear plant of the set; {largest}"
        if self.safe:
            rests = "The axis comes to rest with every friction of the class below"
            return (
                "PASSED, linear loop and friction: the axis may run with these gains",
                stable,
                rests,
            )
        if self.linear_passed and self.friction.proofs:
            return (
                f"NOT PASSED, friction: rest is not proved; the axis {self.friction.headline}",
                stable,
            )
        if self.linear_passed and self.friction.hunts:
            return f"NOT PASSED, friction: the axis {self.friction.headline}", stable
        if self.linear_passed:
            within = ""
            if self.verdict is DriveVerdict.FRICTION_BOUNDED:
                within = (
                    f"stays within {format_length(self.friction.within, self.settings.base_unit)},"
                    " proved, and "
                )
            return f"{self.verdict}: the axis {within}{self.friction.headline}", stable
        why: str = self.doubts[0].kind if self.doubts else self.report.reason
        why += f"; the axis {self.friction.headline}" * self.friction.hunts
        more = (
            (
                "The verdict of the linear loop below only means that its loop is stable with every"
                " plant of the set"
            ),
        )
        return f"NOT PASSED, linear loop: {why}", *(
            more if self.report.proofs.robustly_stable else ()
        )

    @property
    def conclusion(self) -> str:
        """The findings as one text."""
        return ". ".join(self.findings)

    @property
    def answers(self) -> dict[str, str]:
        """Answers to the first questions: does the axis rest, within which distance, does it hunt,
        what to change.
        """
        answers = self.friction.answers(self.settings.base_unit, self.asked)
        if not self.linear_passed:
            answers["change"] = (
                "the linear loop first: see the warnings" if self.doubts else self.report.reason
            )
        return {question: answer for question, answer in answers.items() if answer}

    def to_values(self) -> JsonObject:
        """Return all fields as values for JSON, in SI units, with a summary in `linear` and
        `friction`.

        friction.outcome : the proved result: "rests", "settles" (within `within` [m]), "refuted" or
        "open". friction.simulated : "rests" or "hunts", with amplitude [m], advice and the laws not
        refuted by the records.
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
        asked = {
            "outcome": self.friction.outcome,
            "within": self.friction.within,
            "reason": self.friction.note,
            "simulated": simulated and ("hunts" if simulated.hunts else "rests"),
            "simulated_amplitude": simulated and simulated.amplitude * simulated.hunts,
            "advice": simulated and simulated.advice,
            "laws": simulated and simulated.laws,
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
            "friction": (
                plain | {name: held for name, held in friction.items() if name not in plain}
            ),
            **{name: held for name, held in fields.items() if name != "verdict"},
            "facts": to_plain({section.name: section.facts for section in self.sections}),
        }

    @property
    def stiffness(self) -> Peak | None:
        """Least stiffness of the axis in its loop over frequency; None if the loop is not stable or
        not known.
        """
        G, K = self.report.curves.G, self.report.curves.K
        if G is None or K is None or not self.report.nominally_stable:
            return None
        stiffness = np.abs(1 + G * K) / np.abs(G)
        k = int(np.argmin(stiffness))
        return Peak(float(stiffness[k]), float(self.report.curves.omega[k]))

    @property
    def assumption(self) -> str:
        """Delay and lag of the current loop, and their source: the settings or the trace."""
        timing = (
            f"delay {1e3 * self.settings.delay:g} ms and lag {1e3 * self.settings.lag:g} ms of the"
            " current loop"
        )
        margin = self.report.classical.delay_margin if self.report.nominally_stable else np.inf
        if margin < np.inf:
            more = f"; the nominal loop tolerates {1e3 * margin:.3g} ms of additional delay"
        else:
            more = ""
        if self.given is not None and (self.given.delay, self.given.lag) != (
            self.settings.delay,
            self.settings.lag,
        ):
            late = self.given.delay + self.given.lag > self.settings.delay + self.settings.lag
            why = "with the given ones the machine would lead its force" if late else _FILTERED
            timing += (
                f", as the trace shows them, instead of {1e3 * self.given.delay:g} ms and"
                f" {1e3 * self.given.lag:g} ms as given ({why})"
            )
        if shown := self.friction.delay:
            more = f"; the traces at rest show {shown} for their sum{more}"
        if self.actual:
            return f"assumed: {timing}; a trace of the actual current does not show them{more}"
        return (
            f"{timing}. Both are removed for the fit and put back for the check; the radius of the"
            f" set contains the misfit that an error of them leaves{more}"
        )

    @property
    def sections(self) -> tuple[Section, ...]:
        """The page: all facts of text, HTML and JSON, in their order."""
        # thin margins are among the warnings
        settings = self.settings
        linear = replace(self.report, peak=np.inf)
        first, *more = self.findings
        verdict = [
            *(Fact(question, answer) for question, answer in self.answers.items()),
            Fact("because", ". ".join(more)),
            *(Fact("warning", doubt.description) for doubt in self.doubts),
        ]
        loop = [*linear.claims, *linear.findings, *linear.details]
        if self.stiffness is not None:
            unit = ratio_unit(self.unit, settings.base_unit)
            loop.append(
                Fact(
                    "stiffness",
                    self.stiffness,
                    unit,
                    "least over frequency, against a force on the axis",
                )
            )
        around = (
            f"The set of plants around {self.base} [{ratio_unit(settings.base_unit, self.unit)}]"
        )
        margins = {fact.name: fact for fact in linear.classical.facts}
        smoothed = (
            f"kv/(s + kv) smooths the set point; after a force only the {margins['phase margin']}"
            " counts"
        )
        found = () if self.step is None else self.step.facts
        step = [
            replace(fact, meaning=smoothed) if fact.name == "overshoot" else fact for fact in found
        ]
        motion = (
            "At rest friction holds the axis like a spring; in motion the axis slides and responds"
            " as a mass."
        )
        return (
            Section("gains", "Gains", f"{first}.", verdict),
            Section(
                "traces",
                "Drive and traces",
                motion,
                facts=[
                    Fact("drive", str(settings)),
                    Fact("set in the drive", _describe_parameters(settings)),
                    Fact("timing", self.assumption),
                ],
                table=[_TRACE_HEAD, *(trace.row for trace in self.traces)],
            ),
            *self.friction.sections,
            Section(
                "loop",
                "Linear loop",
                f"{around}, and the loop of these gains with each of them.",
                loop,
            ),
            Section(
                "step",
                "Step of the position set point",
                "Response of the nominal linear loop, without limits of current and speed, to a"
                " step of any size.",
                facts=step,
            ),
            Section("words", "Terms", facts=[Fact(*words) for words in _WORDS.items()]),
        )

    def __str__(self) -> str:
        return format_sections(self.sections)


def _describe_parameters(settings: Drive) -> str:
    """Return the names of the settings that are parameters of the drive, with a note on amperes."""
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
    return f"{names}; the other numbers are properties of the drive" + _AMPERE_NOTE * ampere


def describe_trace(name: str, record: nlfrf.Record, bla: nlfrf.Bla, moving: bool) -> Trace:
    """Return level and band of a trace; a trace with unknown motion counts as at rest."""
    force, motion = (
        np.sqrt(
            np.sum(np.abs(np.fft.rfft(signal.mean(axis=-2))[..., record.lines.excited]) ** 2) / 2
        )
        * 2
        / record.n_samples
        for signal in (record.u[0], record.y[0])
    )
    return Trace(
        name=name,
        force=(force, np.sqrt(np.mean(record.u**2))),
        motion=(motion, np.std(record.y)),
        units=(record.u_unit, record.y_unit),
        n_lines=bla.f.size,
        moving=moving,
        band=(bla.f[0], bla.f[-1]),
    )
