"""`DriveFriction`: the friction of a drive as identified, its proof, its bound, its simulation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nlfrf._base.values import value
from robust._base.states import FrictionVerdict
from robust.friction.proof.protocol import FrictionProof
from robust.friction.reading.assumed_class import ASSUMPTION_NOTE, MachineWithFriction
from robust.friction.reading.force import FrictionForce
from robust.friction.reading.friction_fit import FrictionFit
from robust.friction.reading.from_fit import interval_at_port, largest_damping
from robust.friction.reading.numbers import (
    HALF_WIDTH,
    REPORTED,
    format_rounded,
    number_facts,
    unit_of,
)
from robust.friction.units import format_length, format_plain
from robust.pages.section import Fact, Section
from robust.servo.checking.cures import FrictionCure
from robust.servo.checking.simulation import SimulatedRest

#: Error that the intervals do not contain.
_FORCE_NOTE = (
    "Mass, stiffness and forces depend on the factor that converts the trace to {unit}, such as the"
    " force constant; the intervals do not contain an error of this factor."
)
_STIFFNESS_NOTE = (
    "rms force on the lines, and stiffness of the friction over K0. Near 100 % friction sticks and"
    " shows K0; near 0 % it slides and shows mass, viscous friction and the forces; levels between"
    " show the transition"
)
#: Meaning of a bound with a given force if no class of friction was read.
_BOUNDED_NOTE = (
    "the bound is the largest final distance from rest, at rest or hunting, with the largest"
    " friction force at the motor or at the load, whichever is worse; whether the axis comes to"
    " rest is not judged"
)
#: Machines of such a bound.
MODEL = "the nominal model"
READ = "the machine as read in motion"
UNCERTIFIED = f"{READ} (its loop is stable; the linear loop with its uncertainty is not certified)"
#: Presliding stiffness of the proof over the upper end of its interval, for elements that slip
#: below the lowest level and do not show.
K0_MARGIN = 1.25
#: Largest additional delay to try, and resolution of the largest proved one, in periods.
MOST_ADDED_PERIODS, ADDED_STEP = 8, 1 / 16


@value
class DriveFriction:
    """Friction of an axis, and verdicts on its loop with this friction.

    Fields
    ------
    fit : FrictionFit or None
        Machine and friction from traces at rest, with intervals.
    assumed : MachineWithFriction or None
        Machine and class of the proof.
    proofs : tuple of FrictionProof
        The verdicts, the weakest first. The first proof is for the identified mass without viscous
        friction. If it succeeds, it is repeated at the ends of the intervals of mass and viscous
        friction.
    cures : tuple of FrictionCure
        Changes of the drive that improve a verdict that is not proved.
    bounded : FrictionProof or None
        Bound of the error with any friction up to the force `largest`, if no class of friction was
        identified.
    bounded_machine : str
        Machine of this bound: the nominal model (not its set), or the machine identified in motion.
    note : str
        Reason why no friction was identified, or why nothing was proved.
    largest : float, tuple of float or None
        Largest friction force [N] or [Nm] that the bounds assume: the given force, or the upper end
        of the identified interval; for motor and load one each.
    added_delay : float
        Largest additional delay [s] for which the proof was repeated with success, in steps of
        `ADDED_STEP` periods; zero if there is none, or if the loop is not proved.
    known_delay : float
        Delay and lag [s] of the settings that are part of the traces.
    has_integral : bool
        True if the velocity loop has an integral part. The axis can then rest only at its set
        point.
    force : FrictionForce or None
        Friction force without a friction law, from traces in motion and at rest.
    simulated : SimulatedRest or None
        Simulation of the identified axis.
    unsimulated : str
        Reason why the axis was not simulated.
    """

    fit: FrictionFit | None = None
    assumed: MachineWithFriction | None = None
    proofs: tuple[FrictionProof, ...] = ()
    cures: tuple[FrictionCure, ...] = ()
    bounded: FrictionProof | None = None
    bounded_machine: str = MODEL
    note: str = ""
    largest: float | tuple[float, ...] | None = None
    added_delay: float = 0.0
    known_delay: float = 0.0
    has_integral: bool = False
    force: FrictionForce | None = None
    simulated: SimulatedRest | None = None
    unsimulated: str = ""

    @property
    def proved(self) -> bool:
        """True if the loop is proved to come to rest with every friction of the class."""
        return bool(self.proofs) and all(
            proof.verdict is FrictionVerdict.PROVED for proof in self.proofs
        )

    @property
    def refuted(self) -> bool:
        """True if one friction of the class is proved to keep the axis from rest."""
        return any(proof.verdict is FrictionVerdict.REFUTED for proof in self.proofs)

    @property
    def outcome(self) -> str:
        """Proved result: "rests", "settles", "refuted" (with one friction of the class it never
        rests), or "open".
        """
        if self.proved:
            return "rests"
        if self.refuted:
            return "refuted"
        if np.isfinite(self.within):
            return "settles"
        return "open"

    @property
    def within(self) -> float:
        """Proved largest final distance from rest [m] or [rad]; zero if the axis rests, inf if
        none is proved.
        """
        if self.proved:
            return 0.0
        return min([self.error_bound, *(proof.settling_error for proof in self.proofs[:1])])

    @property
    def K0_used(self) -> float:
        """Largest presliding stiffness [N/m] for which the verdict holds; nan if it holds for
        any.
        """
        if self.assumed is None or self.bounded is not None:
            return np.nan
        return max(one.K0 for one in self.assumed.friction)

    @property
    def delay(self) -> str:
        """Sum of delay and lag of the current loop in the traces, as text; empty if the traces do
        not show it.
        """
        if self.fit is None or not np.isfinite(self.fit.stds["delay"]):
            return ""
        half = 1e3 * HALF_WIDTH * self.fit.stds["delay"]
        return f"{format_rounded(1e3 * self.fit.delay, half)} +- {half:.1g} ms"

    @property
    def error_bound(self) -> float:
        """Proved largest distance from rest [m] or [rad] with any friction up to `largest`; inf if
        none is proved.
        """
        if self.bounded is None:
            proofs = self.proofs
        else:
            proofs = (self.bounded,)
        return max(
            (proof.error_bound for proof in proofs if np.isfinite(proof.error_bound)),
            default=np.inf,
        )

    @property
    def hunts(self) -> bool:
        """True if the axis hunts in simulation."""
        return self.simulated is not None and self.simulated.hunts

    @property
    def headline(self) -> str:
        """End of a sentence that begins with "the axis": its behaviour with friction."""
        if self.proved:
            return "rests, proved"
        if self.simulated is None:
            return "may hunt with these gains"
        if self.simulated.hunts:
            return (
                f"hunts by +-{format_length(self.simulated.amplitude, self.simulated.unit)} in"
                " simulation"
            )
        return "comes to rest in simulation, which is no proof"

    def answers(self, unit: str, asked: float | None = None) -> dict[str, str]:
        """Return texts for the questions "rests", "within", "hunts", "change" and "traces"; an
        answer may be empty.

        unit : unit of the position. asked : required distance from rest [m] or [rad].
        """
        seen, rests, hunts, change = self.simulated, "", "", ""
        if self.proved:
            rests, hunts, change = f"yes, proved: {self.describe_rest()}", "no, proved", "nothing"
        elif seen is None:
            rests = hunts = f"not known: {self.unsimulated or self.note or 'it was not simulated'}"
        else:
            rests = f"yes in all {seen.ended} simulated runs; not proved"
            if seen.count:
                rests = (
                    f"{'no' if seen.hunts else 'not always'}: it hunts in {seen.count} of"
                    f" {seen.ended} simulated runs"
                )
            if seen.hunts:
                hunts = f"yes, {seen.describe_swing()}"
            else:
                hunts = "not seen in simulation"
        if self.refuted:
            rests += (
                ". One friction of the class is proved to keep the axis from rest; the real one may"
                " differ"
            )
        if not self.proved and seen is not None and seen.hunts:
            change = seen.advice or "none of the tried changes brings rest or halves the amplitude"
        elif self.cures:
            change = f"to prove more: {self.cures[0]}"
        distance = self.describe_distance(unit, asked)
        doubt = "" if self.force is None else self.force.contradiction
        return {
            "rests": rests,
            "within": distance,
            "hunts": hunts,
            "change": change,
            "traces": doubt,
        }

    @property
    def largest_forces(self) -> str:
        """Largest friction forces of the bounds, with their unit; empty if none is known."""
        proof = (*self.proofs, self.bounded)[0]
        if self.largest is None or proof is None:
            return ""
        return " and ".join(f"{own:.4g} {proof.units.force}" for own in np.atleast_1d(self.largest))

    def describe_rest(self) -> str:
        """Return where a proved loop comes to rest, as text."""
        if self.has_integral:
            rest = "at the set point, by the integral part"
        else:
            rest = "where friction holds it"
        if self.has_integral and self.fit is not None and isinstance(self.largest, tuple):
            stretch = format_length(self.largest[1] / self.fit.coupling, self.fit.units[1])
            return f"with the motor {rest}, and the load within {stretch} of it"
        return rest

    def describe_distance(self, unit: str, asked: float | None) -> str:
        """Return the largest final distance from rest as text, and whether it meets the required
        distance.
        """
        known = self.error_bound if self.proved and not self.has_integral else self.within
        distance = f"at most {format_length(known, unit)} off, at rest or hunting: proved"
        answer = ""
        if self.proved and self.has_integral:
            distance = "0: it rests at its set point"
        elif not np.isfinite(known):
            distance = "not known" + ": give the largest friction force, --force F, for a bound" * (
                self.largest is None
            )
        elif self.bounded is not None:
            distance += f" for {self.bounded_machine}, friction up to {self.largest_forces}"
        elif self.largest is not None:
            distance += f" for friction up to {self.largest_forces}"
        if asked is not None:
            seen = self.simulated
            if seen is None:
                far = np.nan
            else:
                far = np.fmax(seen.offset, seen.amplitude if seen.hunts else np.nan)
            simulated = "; in simulation yes" if far <= asked else ""
            if known <= asked:
                answer = "yes"
            elif far > asked:
                answer = "no, as simulated"
            else:
                answer = f"not proved{simulated}"
            answer = f". Within {format_length(asked, unit)}: {answer}"
        return distance + answer

    @property
    def sections(self) -> tuple[Section, ...]:
        """The sections of the page on friction: class and proof, then the friction for any law."""
        fit, bounded = self.fit, self.bounded
        table: tuple[tuple[str, ...], ...] = ()
        facts = [
            Fact("simulated", str(self.simulated or "")),
            Fact("not simulated", self.unsimulated),
        ]
        if fit is not None and self.assumed is not None:
            facts += [
                *_describe_reading(fit),
                Fact("assumption", ASSUMPTION_NOTE),
                *replace(self.proofs[0], error_bound=self.error_bound).facts,
                Fact("scope", " ".join(self.describe_scope())),
                *(Fact("a change", str(cure)) for cure in self.cures),
            ]
            table = _tabulate_assumptions(fit, self.assumed, self.known_delay)
        else:
            facts.append(Fact("not judged" if bounded is None else "rest not judged", self.note))
            if fit is not None and any(0 < std < np.inf for std in fit.stds.values()):
                facts += [
                    Fact("read from", f"{len(fit.levels)} traces at rest"),
                    *number_facts(fit),
                ]
        if bounded is not None:
            facts += [
                Fact("bound", bounded.claim or bounded.reason),
                Fact("bound holds for", self.bounded_machine, meaning=_BOUNDED_NOTE),
                Fact("not claimed", bounded.not_claimed),
            ]
        lead = "The friction in the traces, and the proof with it."
        law = Section("friction", "Friction", lead, facts=facts, table=table)
        if self.force is None:
            return (law,)
        lead = (
            "95 % intervals for any friction law, from the commanded force minus that of mass and"
            " viscous friction."
        )
        return law, Section("force", "Friction for any law", lead, facts=self.force.facts)

    def describe_scope(self) -> list[str]:
        """Return sentences on the place of rest, on machines and delays of the proof, and on the
        force of a bound.
        """
        rows = []
        if self.proved:
            two = self.fit is not None and self.fit.load_mass > 0
            if self.added_delay:
                added = f", and with {1e3 * self.added_delay:.3g} ms of additional delay"
            else:
                added = ""
            ends = "motor, load and the spring between them" if two else "mass"
            rows = [
                f"It rests {self.describe_rest()}. The proof was repeated at both ends of {ends}"
                f" and of viscous friction in the table{added}; it holds at these values, not"
                " between them."
            ]
        if self.largest is not None:
            rows.append(
                f"The given force is {self.largest_forces}: that of --force, else the upper end"
                " of Fs."
            )
        return rows


def _describe_reading(fit: FrictionFit) -> list[Fact]:
    """Return the facts on a fit: stiffness of the friction in each trace, class, numbers and open
    questions.
    """
    free = "" if fit.stds["stiffness"] else ", for a machine without a spring to ground"
    levels = sorted(fit.levels, key=lambda level: level.force)
    stiff = ", ".join(
        f"{level.force:.3g} {fit.units[0]}: {100 * max(level.stiffness, 0.0) / fit.K0:.3g} %"
        for level in levels
    )
    unexplained = 100 * max(level.unexplained for level in levels)
    seen = f"slips below {format_length(fit.seen_from, fit.units[1])}"
    if fit.stds["stiffness"]:
        seen += f" and none sticks at {format_length(fit.seen_to, fit.units[1])}"
    return [
        Fact("read from", f"{len(levels)} traces at rest{free}"),
        Fact("sticks, bends, slides", stiff, meaning=_STIFFNESS_NOTE),
        Fact("class read", f"Maxwell slip with {fit.element_stiffness.size} elements; none {seen}"),
        Fact(
            "unexplained",
            f"{unexplained:.2g}",
            "%",
            "largest unexplained share of the force over the levels",
        ),
        *(Fact("open", str(question)) for question in fit.questions),
        Fact("scale", _FORCE_NOTE.format(unit=fit.units[0])),
    ]


def _tabulate_assumptions(
    fit: FrictionFit, assumed: MachineWithFriction, known_delay: float
) -> tuple[tuple[str, ...], ...]:
    """Return the table of numbers as read and as assumed by the proof; `known_delay` [s] is that of
    the settings.
    """
    delay = (
        f"{1e3 * max(known_delay, fit.delay):.4g}",
        "drive" if known_delay >= fit.delay else "as read",
    )
    assumptions = (_assumptions_with_load if fit.load_mass else _assumptions_of_mass)(
        fit, assumed
    ) | {"delay": delay}
    table: list[tuple[str, ...]] = [("number", "read (95 %)", "assumed", "why")]
    for name, (label, unit, factor) in REPORTED.items():
        half = factor * HALF_WIDTH * fit.stds.get(name, 0.0)
        if not half or name not in assumptions:
            continue
        if np.isfinite(half):
            read = f"{format_rounded(factor * getattr(fit, name), half)} +- {half:.1g}"
        else:
            read = "left open"
        if unit:
            quantity = f"{label} [{unit_of(unit, fit.units)}]"
        else:
            quantity = label
        table.append((quantity, read, *assumptions[name]))
    return tuple(table)


#: Entry for a force that the class does not limit.
_UNLIMITED = "any", "no limit in class"


def _assumptions_of_mass(
    fit: FrictionFit, assumed: MachineWithFriction
) -> dict[str, tuple[str, str]]:
    """Return (value, reason) of the assumption of the proof on each number, for one mass."""
    (low, high), damping, (friction,) = fit.interval("mass"), largest_damping(fit), assumed.friction
    return {
        "mass": (f"{low:.5g} and {high:.5g}", "both ends"),
        "damping": (
            f"0 and {damping:.4g}" if damping else "0",
            "none, and the upper end" if damping else "",
        ),
        "stiffness": (f"{assumed.stiffness_low / 1e3:.4g}", "lower end, the rest is in K0"),
        "K0": (f"up to {friction.K0 / 1e3:.4g}", f"{K0_MARGIN:g} times the upper end"),
        "Fs": _UNLIMITED,
        "coulomb": _UNLIMITED,
        "stiction": (f"up to {friction.stiction:.3g}", "chosen, or the upper end"),
    }


def _assumptions_with_load(
    fit: FrictionFit, assumed: MachineWithFriction
) -> dict[str, tuple[str, str]]:
    """Return (value, reason) of the assumption of the proof on each number, for motor and load."""
    friction, damping = assumed.friction, largest_damping(fit)
    stiffest = [format_plain(one.K0 / 1e3) for one in friction]
    ratios = [f"{one.stiction:.3g}" for one in friction]

    def ends(name: str, port: str = "") -> str:
        if port:
            low, high = interval_at_port(fit, name, port)
        else:
            low, high = fit.interval(name)
        return " and ".join(f"{REPORTED[name][2] * end:.5g}" for end in (low, high))

    return {
        "mass": (ends("mass", "motor"), "motor, both ends"),
        "damping": (
            f"0 and {damping:.4g}" if damping else "0",
            "none; upper end" if damping else "",
        ),
        "stiffness": (f"{max(0.0, fit.interval('stiffness')[0]) / 1e3:.4g}", "lower end"),
        "K0": (f"up to {stiffest[0]}", f"motor, {K0_MARGIN:g} x upper"),
        "Fs": _UNLIMITED,
        "coulomb": _UNLIMITED,
        "stiction": (f"up to {' and '.join(ratios)}", "chosen, or read"),
        "load_mass": (ends("mass", "load"), "both ends"),
        "coupling": (ends("coupling"), "both ends"),
        "coupling_damping": (f"{max(0.0, fit.interval('coupling_damping')[0]):.4g}", "lower end"),
        "load_K0": (f"up to {stiffest[1]}", f"load, {K0_MARGIN:g} x upper"),
        "load_Fs": _UNLIMITED,
        "load_coulomb": _UNLIMITED,
    }
