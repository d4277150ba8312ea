"""Friction in the loop of a drive: read from traces at rest, and the loop proved with it.

The class of friction leaves the viscous part to the machine. A proof for one mass and one viscous friction says nothing
of others, so it is repeated at the ends of both intervals, the viscous friction beginning at zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import control
import numpy as np

import nlfrf
from nlfrf._base.values import value
from nlfrf.rig import Drive
from robust._base.states import FrictionVerdict
from robust.friction.classes import AnyFriction, FrictionAtPorts
from robust.friction.plant import FrictionPlant, pad_states
from robust.friction.proof.certify import FrictionProof
from robust.friction.proof.prove import prove_all, prove_friction
from robust.friction.reading.assumed_class import ASSUMPTION_NOTE, FrictionClass
from robust.friction.reading.balance import HALF_WIDTH, REPORTED, format_rounded, number_facts, unit_of
from robust.friction.reading.force import FrictionForce, edge_of_level, friction_of_period
from robust.friction.reading.friction_class import friction_class
from robust.friction.reading.from_fit import interval_at_port, largest_damping, machines_of_fit
from robust.friction.reading.identification import FrictionFit, identify_friction
from robust.friction.reading.in_motion import SlidingFit
from robust.friction.units import format_length, format_plain
from robust.pages.section import Fact, Section
from robust.servo.checking.cures import FrictionCure, friction_cures
from robust.servo.checking.simulation import SimulatedRest
from robust.servo.gains.p_pi import cascade

#: Levels from which friction is read.
_FEWEST_LEVELS = 3
#: Largest presliding stiffness of the proof, over the upper end of what was read: elements that slip below the lowest
#: level are not seen.
_K0_MARGIN = 1.25
#: What no interval of a reading holds.
_FORCE_NOTE = (
    "Mass, stiffness and forces are as good as what scales the trace to {unit}, such as the force constant: an error "
    "of that is in no interval."
)
_STIFFNESS_NOTE = (
    "rms force on the lines, and stiffness of the friction over K0. Near 100 % friction sticks and gives K0; near 0 % "
    "it slides and gives mass, viscous friction and the forces; levels between give the transition"
)
#: What the bound of a stated force is of, where no friction was read.
_BOUNDED_NOTE = (
    "how far the axis moves in the end, at rest or hunting, by the largest friction force, at the motor or at the load "
    "where one was read and that is worse; whether it comes to rest is not judged"
)
#: Machines of such a bound.
MODEL = "the nominal model"
READ = "the machine as read in motion"
UNCERTIFIED = f"{READ} (its loop is stable; the linear loop with its uncertainty is not certified)"
#: Added delays that are tried: up to so many periods, the largest that is proved to this share of a period.
_MOST_ADDED_PERIODS, _ADDED_STEP = 8, 1 / 16


@value
class DriveFriction:
    """What traces at rest say of the friction of an axis, and of its loop with that friction.

    Fields
    ------
    fit : FrictionFit or None
        Machine and friction, with intervals.
    assumed : FrictionClass or None
        Machine and class that the loop was proved with.
    proofs : tuple of FrictionProof
        The verdicts, the weakest first: with the mass that was read and no viscous friction, and where that is proved
        at the ends of both intervals.
    cures : tuple of FrictionCure
        What a change of the drive does to a verdict that is not proved.
    bounded : FrictionProof or None
        Where no friction was read: the bound of the error with any friction of at most a stated force.
    bounded_machine : str
        Of which machine that bound is: the nominal linear model of the traces, not its set, or what they show in
        motion.
    note : str
        Why nothing was read, or nothing proved.
    largest : float, tuple of float or None
        Largest friction force [N] or [Nm] of the bounds: stated, or the upper end of what was read; of motor and load
        one each.
    added_delay : float
        Additional delay [s] with which all was proved too; with `_ADDED_STEP` of a period more it was not, or not
        tried. nan where the loop is not proved.
    known_delay : float
        Delay with lag [s] that the settings have in front of the traces.
    has_integral : bool
        Whether the velocity loop has an integral part, so that the axis can rest at its set point only.
    force : FrictionForce or None
        The friction without a law, from traces in motion and at rest.
    simulated : SimulatedRest or None
        What the axis as read does in the end, by simulation.
    unsimulated : str
        Why it was not simulated.
    """

    fit: FrictionFit | None = None
    assumed: FrictionClass | None = None
    proofs: tuple[FrictionProof, ...] = ()
    cures: tuple[FrictionCure, ...] = ()
    bounded: FrictionProof | None = None
    bounded_machine: str = MODEL
    note: str = ""
    largest: float | tuple[float, ...] | None = None
    added_delay: float = np.nan
    known_delay: float = 0.0
    has_integral: bool = False
    force: FrictionForce | None = None
    simulated: SimulatedRest | None = None
    unsimulated: str = ""

    @property
    def proved(self) -> bool:
        """Whether the loop comes to rest with every friction of the class, by a proof."""
        return bool(self.proofs) and all(proof.verdict is FrictionVerdict.PROVED for proof in self.proofs)

    @property
    def refuted(self) -> bool:
        """Whether a friction of the class is proved to keep the axis from rest."""
        return any(proof.verdict is FrictionVerdict.REFUTED for proof in self.proofs)

    @property
    def outcome(self) -> str:
        """What is proved: "rests", "settles", "refuted" (a friction of the class never rests), or "open"."""
        if self.proved:
            return "rests"
        if self.refuted:
            return "refuted"
        return "settles" if np.isfinite(self.within) else "open"

    @property
    def within(self) -> float:
        """How far the axis is from its rest in the end [m] or [rad], at most; zero where it rests, nan: unknown."""
        if self.proved:
            return 0.0
        known = [self.error_bound, *(proof.settling_error for proof in self.proofs[:1])]
        return float(np.fmin.reduce(known))

    @property
    def K0_used(self) -> float:
        """The largest presliding stiffness that a verdict is for [N/m]; nan where it is for any."""
        if self.assumed is None or self.bounded is not None:
            return np.nan
        return float(np.max(self.assumed.friction.K0))

    @property
    def delay(self) -> str:
        """Delay and lag of the current loop together, as the traces show them; empty where they do not."""
        if self.fit is None or not np.isfinite(self.fit.stds["delay"]):
            return ""
        half = 1e3 * HALF_WIDTH * self.fit.stds["delay"]
        return f"{format_rounded(1e3 * self.fit.delay, half)} +- {half:.1g} ms"

    @property
    def error_bound(self) -> float:
        """Where the axis is in the end, from its rest [m] or [rad], with any friction up to `largest`; nan: unknown."""
        proofs = self.proofs if self.bounded is None else (self.bounded,)
        return max((proof.error_bound for proof in proofs if np.isfinite(proof.error_bound)), default=np.nan)

    @property
    def hunts(self) -> bool:
        """Whether the axis hunts in simulation."""
        return self.simulated is not None and self.simulated.hunts

    @property
    def headline(self) -> str:
        """What the axis does with its friction, in a few words."""
        if self.proved:
            return "rests, proved"
        if self.simulated is None:
            return "may hunt with these gains"
        if self.simulated.hunts:
            return f"hunts by +-{format_length(self.simulated.amplitude, self.simulated.unit)} in simulation"
        return "comes to rest in simulation, which is no proof"

    def answers(self, unit: str, asked: float | None = None) -> dict[str, str]:
        """Return whether the axis rests, within how much it stays, whether it hunts and what to change, by these words.

        unit : of the position. asked : distance from the rest that was asked for [m] or [rad].
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
                    f"{'no' if seen.hunts else 'not always'}: it hunts in {seen.count} of {seen.ended} simulated runs"
                )
            hunts = f"yes, {seen.describe_swing()}" if seen.hunts else "not seen in simulation"
        if self.refuted:
            rests += ". A friction of the class is proved to keep the axis from rest; this one may be another"
        if not self.proved and seen is not None and seen.hunts:
            change = seen.advice or "none of the changes that were tried brings rest, or half the amplitude"
        elif self.cures:
            change = f"to prove more: {self.cures[0]}"
        distance, doubt = self.describe_distance(unit, asked), "" if self.force is None else self.force.contradiction
        return {"rests": rests, "within": distance, "hunts": hunts, "change": change, "traces": doubt}

    @property
    def largest_forces(self) -> str:
        """The largest friction forces of the bounds, with their unit; empty where none is known."""
        proof = (*self.proofs, self.bounded)[0]
        if self.largest is None or proof is None:
            return ""
        return " and ".join(f"{own:.4g} {proof.units.force}" for own in np.atleast_1d(self.largest))

    def describe_rest(self) -> str:
        """Say where a loop that is proved comes to rest."""
        rest = "at the set point, by the integral part" if self.has_integral else "where friction holds it"
        if self.has_integral and self.fit is not None and isinstance(self.largest, tuple):
            stretch = format_length(self.largest[1] / self.fit.coupling, self.fit.units[1])
            return f"with the motor {rest}, and the load within {stretch} of it"
        return rest

    def describe_distance(self, unit: str, asked: float | None) -> str:
        """Say how far from its rest the axis is in the end, at most, and whether that is within what was asked for."""
        known = self.error_bound if self.proved and not self.has_integral else self.within
        distance, answer = f"at most {format_length(known, unit)} off, at rest or hunting: proved", ""
        if self.proved and self.has_integral:
            distance = "0: it rests at its set point"
        elif not np.isfinite(known):
            distance = "not known" + ": --force F with the largest friction force bounds it" * (self.largest is None)
        elif self.bounded is not None:
            distance += f" of {self.bounded_machine}, friction up to {self.largest_forces}"
        elif self.largest is not None:
            distance += f" for friction up to {self.largest_forces}"
        if asked is not None:
            seen = self.simulated
            far = np.nan if seen is None else np.fmax(seen.offset, seen.amplitude if seen.hunts else np.nan)
            simulated = "; in simulation yes" if far <= asked else ""
            answer = "yes" if known <= asked else "no, as simulated" if far > asked else f"not proved{simulated}"
            answer = f". Asked were {format_length(asked, unit)}: {answer}"
        return distance + answer

    @property
    def sections(self) -> tuple[Section, ...]:
        """Return what was read of the friction and what is proved with it, then what was read without a law."""
        fit, bounded = self.fit, self.bounded
        table: tuple[tuple[str, ...], ...] = ()
        facts = [Fact("simulated", str(self.simulated or "")), Fact("not simulated", self.unsimulated)]
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
                facts += [Fact("read from", f"{len(fit.levels)} traces at rest"), *number_facts(fit)]
        if bounded is not None:
            facts += [
                Fact("bound", bounded.claim or bounded.reason),
                Fact("bound of", self.bounded_machine, meaning=_BOUNDED_NOTE),
                Fact("not claimed", bounded.not_claimed),
            ]
        lead = "What the traces show of the friction, and what is proved with it."
        law = Section("friction", "Friction", lead, facts=facts, table=table)
        if self.force is None:
            return (law,)
        lead = "Read from the force that the axis leaves of its command: 95 % intervals, whatever the law of friction."
        return law, Section("force", "Friction without a law", lead, facts=self.force.facts)

    def describe_scope(self) -> list[str]:
        """Say where a proved loop rests, for which other machines and delays it is proved, and the force of a bound."""
        rows = []
        if self.proved:
            two = self.fit is not None and self.fit.load_mass > 0
            added = f", and with {1e3 * self.added_delay:.3g} ms of additional delay" if self.added_delay else ""
            ends = "motor, load and the spring between them" if two else "mass"
            rows = [
                f"It rests {self.describe_rest()}. Proved also at both ends of {ends} and of viscous friction in the "
                f"table{added} (at these values, not between them)."
            ]
        if self.largest is not None:
            rows.append(f"The given force is {self.largest_forces}, as stated or the upper end of Fs.")
        return rows


def _describe_reading(fit: FrictionFit) -> list[Fact]:
    """Return which trace gives which number, by how stiff its friction is over K0, and what the reading leaves open."""
    free = "" if fit.stds["stiffness"] else ", of a machine without a spring to ground"
    levels = sorted(fit.levels, key=lambda level: level.force)
    stiff = ", ".join(
        f"{level.force:.3g} {fit.units[0]}: {100 * max(level.stiffness, 0.0) / fit.K0:.3g} %" for level in levels
    )
    unexplained = 100 * max(level.unexplained for level in levels)
    seen = f"slips below {format_length(fit.seen_from, fit.units[1])}"
    if fit.stds["stiffness"]:
        seen += f" and none sticks at {format_length(fit.seen_to, fit.units[1])}"
    return [
        Fact("read from", f"{len(levels)} traces at rest{free}"),
        Fact("sticks, bends, slides", stiff, meaning=_STIFFNESS_NOTE),
        Fact("class read", f"Maxwell slip of {fit.element_stiffness.size} elements none of which {seen}"),
        Fact("unexplained", f"{unexplained:.2g}", "%", "of the force at most, at any level"),
        *(Fact("open", str(question)) for question in fit.questions),
        Fact("scale", _FORCE_NOTE.format(unit=fit.units[0])),
    ]


def _tabulate_assumptions(fit: FrictionFit, assumed: FrictionClass, known_delay: float) -> tuple[tuple[str, ...], ...]:
    """Return the table of what was read, what the proof assumes of it, and why; `known_delay` [s] is the drive's."""
    delay = f"{1e3 * max(known_delay, fit.delay):.4g}", "drive" if known_delay >= fit.delay else "as read"
    assumptions = (_assumptions_with_load if fit.load_mass else _assumptions_of_mass)(fit, assumed) | {"delay": delay}
    table: list[tuple[str, ...]] = [("number", "read (95 %)", "assumed", "why")]
    for name, (label, unit, factor) in REPORTED.items():
        half = factor * HALF_WIDTH * fit.stds.get(name, 0.0)
        if not half or name not in assumptions:
            continue
        read = (
            f"{format_rounded(factor * getattr(fit, name), half)} +- {half:.1g}" if np.isfinite(half) else "left open"
        )
        quantity = f"{label} [{unit_of(unit, fit.units)}]" if unit else label
        table.append((quantity, read, *assumptions[name]))
    return tuple(table)


#: Of a force that the class does not limit.
_UNLIMITED = "any", "no limit in class"


def _assumptions_of_mass(fit: FrictionFit, assumed: FrictionClass) -> dict[str, tuple[str, str]]:
    """Return what the proof assumes of each number of one mass, and why."""
    (low, high), damping, friction = fit.interval("mass"), largest_damping(fit), assumed.friction
    assert isinstance(friction, AnyFriction)
    return {
        "mass": (f"{low:.5g} and {high:.5g}", "both ends"),
        "damping": (f"0 and {damping:.4g}" if damping else "0", "none, and the upper end" if damping else ""),
        "stiffness": (f"{assumed.stiffness_low / 1e3:.4g}", "lower end, the rest is in K0"),
        "K0": (f"up to {friction.K0 / 1e3:.4g}", f"{_K0_MARGIN:g} times the upper end"),
        "Fs": _UNLIMITED,
        "coulomb": _UNLIMITED,
        "stiction": (f"up to {friction.stiction:.3g}", "chosen, or the upper end"),
    }


def _assumptions_with_load(fit: FrictionFit, assumed: FrictionClass) -> dict[str, tuple[str, str]]:
    """Return what the proof assumes of each number of motor and load, and why."""
    friction, damping = assumed.friction, largest_damping(fit)
    assert isinstance(friction, FrictionAtPorts)
    stiffest = [format_plain(one.K0 / 1e3) for one in friction.ports]
    ratios = [f"{one.stiction:.3g}" for one in friction.ports]

    def ends(name: str, port: str = "") -> str:
        low, high = interval_at_port(fit, name, port) if port else fit.interval(name)
        return " and ".join(f"{REPORTED[name][2] * end:.5g}" for end in (low, high))

    return {
        "mass": (ends("mass", "motor"), "motor, both ends"),
        "damping": (f"0 and {damping:.4g}" if damping else "0", "none; upper end" if damping else ""),
        "stiffness": (f"{max(0.0, fit.interval('stiffness')[0]) / 1e3:.4g}", "lower end"),
        "K0": (f"up to {stiffest[0]}", f"motor, {_K0_MARGIN:g} x upper"),
        "Fs": _UNLIMITED,
        "coulomb": _UNLIMITED,
        "stiction": (f"up to {' and '.join(ratios)}", "chosen, or read"),
        "load_mass": (ends("mass", "load"), "both ends"),
        "coupling": (ends("coupling"), "both ends"),
        "coupling_damping": (f"{max(0.0, fit.interval('coupling_damping')[0]):.4g}", "lower end"),
        "load_K0": (f"up to {stiffest[1]}", f"load, {_K0_MARGIN:g} x upper"),
        "load_Fs": _UNLIMITED,
        "load_coulomb": _UNLIMITED,
    }


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
    """Read the friction from traces at rest, and prove the loop with it; the other parameters as of `check`.

    records : force in, position out, each at rest.
    actual : whether their input is the actual force, in which delay and lag of the settings do not show.
    """
    if fit is None:
        try:
            fit = _read_friction(records, spring=spring, masses=masses, sliding=sliding)
        except (ValueError, np.linalg.LinAlgError) as error:
            return DriveFriction(note=str(error))
    try:
        assumed = friction_class(fit, stiction=stiction, margin=_K0_MARGIN)
    except ValueError as error:
        return DriveFriction(fit=fit, note=fit.reason or str(error))
    if fit.load_mass and settings.encoder != "motor":
        return DriveFriction(
            fit=fit, note="motor and load are read from the encoder of the motor, and it is at the load"
        )
    # the loop has delay and lag of the settings: the machine keeps what the traces show beyond them
    known = 0.0 if actual else settings.delay + settings.lag
    read, *ends = (
        friction_behind_lag(replace(one, delay=max(0.0, fit.delay - known)), settings.lag)
        for one in (assumed.machine, *machines_of_fit(fit)[1:])
    )
    largest: float | tuple[float, ...] | None = Fs
    if Fs is None and np.isfinite(fit.stds["Fs"]):
        largest = _largest_forces_read(fit)
    unit = fit.units[0]
    K, friction, late, added = cascade(settings, output_unit=unit), assumed.friction, settings.delay, np.nan
    try:
        proofs = prove_all((read,), K, friction, delay=late, Fs=largest)
    except ValueError as error:  # a delay that is too long to be proved
        return DriveFriction(fit=fit, note=str(error))
    if proofs[0].verdict is FrictionVerdict.PROVED:
        # with friction at two places the bound takes longer than the proof
        at_ends = None if isinstance(friction, FrictionAtPorts) else largest
        proofs = (*proofs, *prove_all(ends, K, friction, delay=late, Fs=at_ends))
        proofs = tuple(sorted(proofs, key=lambda proof: proof.verdict is FrictionVerdict.PROVED))
    cures: tuple[FrictionCure, ...] = ()
    if proofs[0].verdict is FrictionVerdict.PROVED:
        added = largest_added_delay((read, *ends), K, friction, delay=late, period=settings.dt)
    elif largest is not None:
        weakest = replace(proofs[0].machine, delay=read.delay)  # a proof takes the delay out of its machine
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
    """(2, N) position [m] and friction force [N] over the mean period of a record at rest, each from its mean.

    Up to where a step of the encoder is small in the force.
    """
    return np.stack(friction_of_period(record, machine, edge_of_level(record, machine)))


def bound_any_friction(
    machine: FrictionPlant, settings: Drive, friction: AnyFriction, *, output_unit: str
) -> FrictionProof:
    """Return the bound of the error of a machine with any bounded friction, under its drive, wherever it acts.

    The bound is a sum over the forces at motor and load, so that it is largest with all of the friction at one of them.
    """
    K, behind = cascade(settings, output_unit=output_unit), friction_behind_lag(machine, settings.lag)
    ports = zip(
        behind.B_port.reshape(behind.A.shape[0], -1).T,
        [f", friction at {name}" for name in machine.port_names] or [""],
        strict=True,
    )
    places = [
        replace(behind, B_port=into, C_port=behind.C_measured, port_names=(), description=behind.description + where)
        for into, where in ports
    ]
    proofs = [prove_friction(one, K, friction, delay=settings.delay) for one in places]
    return max(proofs, key=lambda proof: np.nan_to_num(proof.error_bound, nan=np.inf))


def _largest_forces_read(fit: FrictionFit) -> float | tuple[float, ...]:
    """Return the upper end of the break-away force; of motor and load one each."""
    if not fit.load_mass:
        return fit.interval("Fs")[1]
    return tuple(interval_at_port(fit, "Fs", port)[1] for port in ("motor", "load"))


def _read_friction(
    records: Sequence[nlfrf.Record], *, spring: bool, masses: int, sliding: SlidingFit | None = None
) -> FrictionFit:
    """Read the friction from traces at rest; a ValueError says why it cannot be."""
    if len(records) < _FEWEST_LEVELS:
        raise ValueError(
            f"it takes traces at rest at three levels or more, from sticking to sliding, got {len(records)}"
        )
    if records[0].u_unit == "A":
        raise ValueError("it takes a force, and the gains have no torque_constant")
    return identify_friction(records, free=not spring, masses=masses, sliding=sliding)


def largest_added_delay(
    machines: Sequence[FrictionPlant],
    K: control.StateSpace,
    friction: AnyFriction | FrictionAtPorts,
    *,
    delay: float,
    period: float,
) -> float:
    """Return the largest added delay [s] that was tried and with which every machine is proved, by bisection."""

    def proves(steps: int) -> bool:
        late = delay + steps * _ADDED_STEP * period
        return all(
            prove_friction(machine, K, friction, delay=late).verdict is FrictionVerdict.PROVED for machine in machines
        )

    low, high = 0, round(1 / _ADDED_STEP)
    while high * _ADDED_STEP <= _MOST_ADDED_PERIODS and proves(high):
        low, high = high, 2 * high
    if high * _ADDED_STEP > _MOST_ADDED_PERIODS:
        return low * _ADDED_STEP * period
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if proves(middle) else (low, middle)
    return low * _ADDED_STEP * period


def friction_behind_lag(machine: FrictionPlant, lag: float) -> FrictionPlant:
    """Return a machine behind the lag of the current loop [s], its friction acting behind it too."""
    if not lag:
        return machine
    n = machine.A.shape[0]
    A = np.block([[machine.A, machine.B_force[:, None]], [np.zeros((1, n)), np.array([[-1 / lag]])]])
    return replace(
        machine,
        A=A,
        B_force=np.append(np.zeros(n), 1 / lag),
        B_port=pad_states(machine.B_port.T, n + 1).T,
        C_measured=pad_states(machine.C_measured, n + 1),
        C_port=pad_states(machine.C_port, n + 1),
        description=f"{machine.description}, behind a current loop of {1e3 * lag:g} ms",
    )
