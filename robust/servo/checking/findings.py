"""What a check of the gains of a drive finds: verdict, conditions, doubts, and the page as text."""

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
from robust.analysis.performance import StepResponse
from robust.analysis.report import RobustnessReport
from robust.friction.units import format_length
from robust.lti.grids import Peak
from robust.pages.section import Fact, Section
from robust.pages.text import format_sections
from robust.servo.checking.friction import DriveFriction

_FILTERED = "a filter that the gains do not name, or a mode above the band, which looks like one"


#: What a drive does not say of its currents.
_AMPERE_NOTE = ". A is rms or peak, the same in kp and in the force constant"


#: What the words of the page mean.
_WORDS = {
    "line": "an excited frequency",
    "rms": "on the lines; all of it: of the whole trace, with its noise",
    "radius": "how far the FRF on a line may be from the model, relative to it",
    "weight": "bound of that error at all frequencies, above the radius",
    "rs": "weight times |T|; all plants are stable if it is below 1",
    "S, T": "S = 1/(1 + L) and T = 1 - S, with the loop gain L; |S| reaches 0.71 at the bandwidth of S",
    "disk margin": "a change of gain, of phase, or of less of both, that the loop stands",
}
_TRACE_HEAD = ("trace", "force, rms", "all of it", "motion, rms", "all of it", "lines", "band")


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


class Trace(NamedTuple):
    """Force and motion of a trace, rms, on its lines and all of it; whether its axis moved; its lines and band [Hz]."""

    name: str
    force: tuple[float, float]
    motion: tuple[float, float]
    units: tuple[str, str]
    moving: bool
    n_lines: int
    band: tuple[float, float]

    @property
    def row(self) -> tuple[str, ...]:
        """Return the row of a table, under `_TRACE_HEAD`."""
        N, m = self.units
        forces, motions = (f"{one:.3g} {N}" for one in self.force), (format_length(one, m) for one in self.motion)
        first, last = self.band
        return self.name, *forces, *motions, str(self.n_lines), f"{first:.4g} to {last:.4g} Hz"


@value
class DriveCheck:
    """What the traces of an axis say of the gains of its drive.

    Fields
    ------
    settings : Drive
        The gains, for a position in m or rad.
    unit : str
        Unit of the force that they ask for: "N", "Nm", or "A" without a torque constant.
    traces : tuple of Trace
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
            "friction": plain | {name: held for name, held in friction.items() if name not in plain},
            **{name: held for name, held in fields.items() if name != "verdict"},
            "facts": to_plain({section.name: section.facts for section in self.sections}),
        }

    @property
    def stiffness(self) -> Peak | None:
        """The least stiffness of the axis in its loop over frequency; None where it is not stable or not known."""
        G, K = self.report.curves.G, self.report.curves.K
        if G is None or K is None or not self.report.nominally_stable:
            return None
        stiffness = np.abs(1 + G * K) / np.abs(G)
        k = int(np.argmin(stiffness))
        return Peak(float(stiffness[k]), float(self.report.curves.omega[k]))

    @property
    def assumption(self) -> str:
        """What is taken from the settings and not from the traces."""
        timing = f"delay {1e3 * self.settings.delay:g} ms and lag {1e3 * self.settings.lag:g} ms"
        margin = self.report.classical.delay_margin if self.report.nominally_stable else np.inf
        more = f"; the nominal loop tolerates {1e3 * margin:.3g} ms of additional delay" if margin < np.inf else ""
        if self.given is not None and (self.given.delay, self.given.lag) != (self.settings.delay, self.settings.lag):
            late = self.given.delay + self.given.lag > self.settings.delay + self.settings.lag
            why = "with which the machine would lead its force" if late else _FILTERED
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

    @property
    def sections(self) -> tuple[Section, ...]:
        """Return the page: every fact that text, HTML and JSON show, in their order."""
        settings, linear = self.settings, replace(self.report, peak=np.inf)  # thin margins are among the warnings
        first, *more = self.findings
        verdict = [
            *(Fact(question, answer) for question, answer in self.answers.items()),
            Fact("because", ". ".join(more)),
            *(Fact("warning", doubt.description) for doubt in self.doubts),
        ]
        loop = [*linear.claims, *linear.findings, *linear.details]
        if self.stiffness is not None:
            unit = ratio_unit(self.unit, settings.base_unit)
            loop.append(Fact("stiffness", self.stiffness, unit, "the least over frequency, of a force on the axis"))
        around = f"The set of plants around {self.base} [{ratio_unit(settings.base_unit, self.unit)}]"
        margins = {fact.name: fact for fact in linear.classical.facts}
        smoothed = f"kv/(s + kv) smooths the set point; a force meets the {margins['phase margin']}"
        found = () if self.step is None else self.step.facts
        step = [replace(fact, meaning=smoothed) if fact.name == "overshoot" else fact for fact in found]
        motion = "At rest friction holds the axis like a spring; in motion it slides, and the axis answers as a mass."
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
            Section("loop", "Linear loop", f"{around}, and the loop that the gains make with each of them.", loop),
            Section(
                "step",
                "Step of the position set point",
                "Of any size, of the nominal linear loop, without limits of current and speed.",
                facts=step,
            ),
            Section("words", "Words", facts=[Fact(*words) for words in _WORDS.items()]),
        )

    def __str__(self) -> str:
        return format_sections(self.sections)


def _describe_parameters(settings: Drive) -> str:
    """Return which of the settings are typed into the drive, and what an ampere is."""
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
    return f"{names}; the rest is the drive as it is" + _AMPERE_NOTE * ampere


def describe_trace(name: str, record: nlfrf.Record, bla: nlfrf.Bla, moving: bool) -> Trace:
    """Return level and band of a trace; one that is not known to be in motion counts as at rest."""
    force, motion = (
        np.sqrt(np.sum(np.abs(np.fft.rfft(signal.mean(axis=-2))[..., record.lines.excited]) ** 2) / 2)
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
