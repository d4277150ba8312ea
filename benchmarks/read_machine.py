"""How well machines with friction are identified from records: errors and coverage of intervals on
the axis presets.

At rest: `robust.friction.identify_friction` on levels that stick, bend and slide, at random phases.
In motion: `identify_sliding` at two speeds either way. The presets with a load are two masses with
friction on both: with --masses 2 they are measured to beyond the resonance and fitted as such. With
one mass they are measured below a third of the antiresonance, and the table says how often that was
refused.

The truth: mass and viscous friction of all that moves, K0, strength and Coulomb friction of all
elements together, and those of the load.

With --attack: random machines with Maxwell slip, free or on a spring, half of them with noise, a
quarter with a delay (those of benchmarks/read_class.py without a load), and PD and PID loops around
them. A loop that the truth refutes and that is proved for the class that `machine_with_friction`
read from the records is false. --levels: rms of the force over the break-away force, in the place
of levels that stick, bend and slide.

With --sets: three levels of the linear motor under its drive, played and traced as files, for each
of the drives, bands, discarded periods and levels of `SETS`. A set is right where m, K0 and Fs are
within 1 %, refused where one of them is left open, and else wrong without a flag.

python -m benchmarks.read_machine [--runs 20] [--presets linear-motor,belt] [--at rest,motion]
[--quiet] python -m benchmarks.read_machine --attack 40 [--levels 0.04,0.12,0.6] python -m
benchmarks.read_machine --sets 1
"""

from __future__ import annotations

import argparse
import tempfile
import time
import warnings
from collections import defaultdict
from dataclasses import dataclass, replace
from enum import Enum
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

import nlfrf
import robust
from benchmarks.read_class import FAMILIES, GOOD, Case, draw_case, draw_loops, prove_read
from nlfrf.io import load_trace
from robust.servo import design_experiment, play_experiment


@dataclass(frozen=True)
class Plan:
    """Levels or a level, band and period of an experiment."""

    rms: tuple[float, ...]
    f_min: float
    f_max: float
    n_samples: int
    speeds: tuple[float, ...] = ()


#: Preset -> levels at rest [N or Nm], from sticking to sliding.
AT_REST = {
    "linear motor": Plan((1, 5, 15, 30, 60), 2, 300, 8000),
    "belt": Plan((5, 15, 40, 100, 300), 0.5, 16, 16000),
    "ball screw": Plan((20, 60, 150, 400, 1200), 1, 40, 8000),
    "joint": Plan((0.7, 2, 6, 12, 40), 0.25, 5.5, 32000),
}
#: Preset -> levels at rest for two masses, to beyond the resonance.
TWO_MASSES = {
    "belt": Plan((5, 15, 40, 100, 300), 1, 200, 8000),
    "ball screw": Plan((20, 60, 150, 400, 1200), 2, 300, 8000),
    "joint": Plan((0.7, 2, 6, 12, 40), 0.5, 80, 16000),
}
#: Preset -> level and speeds in motion.
IN_MOTION = {
    "linear motor": Plan((20,), 2, 200, 8000, (0.1, 0.3)),
    "belt": Plan((20,), 2, 12, 8000, (0.1, 0.3)),
    "ball screw": Plan((60,), 2, 30, 8000, (0.05, 0.15)),
    "joint": Plan((2,), 0.5, 4, 16000, (0.2, 0.6)),
}


def truth_of(axis: nlfrf.rig.ServoAxis, masses: int = 1) -> dict[str, float]:
    """What is to be read. K0 and delay are not read in motion."""
    laws = [law for law in (axis.motor_friction, axis.load_friction) if law is not None]
    found = {
        "mass": axis.inertia,
        "damping": axis.motor_damping + axis.load_damping,
        "Fs": sum(float(law.strength.sum()) for law in laws),
        "coulomb": sum(float(law.strength.sum() / law.stiction) for law in laws),
    }
    # one mass takes a load for a lag, and its coupling for a soft friction
    if len(laws) == 1 or masses == 2:
        found |= {
            "K0": sum(float(law.stiffness.sum()) for law in laws),
            "delay": axis.drive.lag + axis.drive.delay_periods / axis.drive.fs,
        }
    if masses == 2 and axis.load_friction is not None:
        law = axis.load_friction
        found |= {
            "load_mass": axis.load_inertia,
            "coupling": axis.stiffness,
            "coupling_damping": axis.damping,
            "load_K0": float(law.stiffness.sum()),
            "load_Fs": float(law.strength.sum()),
            "load_coulomb": float(law.strength.sum() / law.stiction),
        }
    return found


def played(axis: nlfrf.rig.ServoAxis, plan: Plan, rms: float, rng: Any) -> nlfrf.Multisine:
    """A multisine of a plan."""
    grid = {"f_min": plan.f_min, "f_max": plan.f_max, "n_samples": plan.n_samples}
    return nlfrf.multisine("special-odd", fs=axis.drive.fs, rms=rms, rng=rng, **grid)


def measure_at_rest(axis: nlfrf.rig.ServoAxis, plan: Plan, seed: int) -> list[nlfrf.Record]:
    """Records of all levels."""
    return [
        nlfrf.rig.simulate_servo(
            axis,
            played(axis, plan, rms, np.random.default_rng([seed, i])),
            n_periods=4,
            n_discard=2,
            oversampling=16,
        )
        for i, rms in enumerate(plan.rms)
    ]


def measure_in_motion(
    axis: nlfrf.rig.ServoAxis, plan: Plan, seed: int
) -> tuple[list[nlfrf.Record], list[float]]:
    """Records either way at each speed, and the velocities."""
    velocities = [sign * speed for speed in plan.speeds for sign in (1, -1)]
    records = [
        nlfrf.rig.simulate_servo(
            axis,
            played(axis, plan, plan.rms[0], np.random.default_rng([seed, i])),
            base_velocity=velocity,
            n_periods=4,
            n_discard=1,
            oversampling=2,
        )
        for i, velocity in enumerate(velocities)
    ]
    return records, velocities


def pulls_of(fit: Any, truth: dict[str, float]) -> dict[str, tuple[float, bool]]:
    """Relative error of each number that was read, and whether its interval holds the truth."""
    found = {}
    for name, true in truth.items():
        if np.isfinite(fit.stds.get(name, np.inf)):
            low, high = fit.interval(name)
            found[name] = (getattr(fit, name) / true - 1, bool(low <= true <= high))
    return found


def format_pulls(pulls: dict[str, tuple[float, bool]]) -> str:
    """A row of errors, those outside their interval marked."""
    return ", ".join(
        f"{name} {100 * off:+.2f} %{'' if held else ' OUT'}" for name, (off, held) in pulls.items()
    )


def records_of(
    case: Case, number: int, levels: tuple[float, ...] | None = None
) -> list[nlfrf.Record]:
    """Records of a random machine, its delay and noise in the position; levels stick, bend and
    slide if not given.

    levels : rms of the force over the break-away force.
    """
    rng, records = np.random.default_rng([number, 7]), []
    strength = float(case.rig.friction.strength.sum())
    for i, pair in enumerate(GOOD if levels is None else levels):
        rms = strength * (10 ** rng.uniform(*np.log10(pair)) if levels is None else levels[i])
        ms = nlfrf.multisine(
            "special-odd", fs=2048, n_samples=4096, f_min=1.0, f_max=200.0, rms=rms, rng=rng
        )
        record = nlfrf.simulate(case.rig, ms, n_periods=3, n_discard=3, oversampling=64)
        turn = np.exp(-2j * np.pi * np.fft.rfftfreq(4096, 1 / 2048) * case.delay)
        y = np.fft.irfft(turn * np.fft.rfft(record.y), n=4096)
        records.append(replace(record, y=y + case.noise * y.std() * rng.standard_normal(y.shape)))
    return records


@dataclass
class Counts:
    """Loops of one machine, or of all."""

    provable: int = 0
    #: Of machines that were read.
    refuted: int = 0
    read_provable: int = 0
    proved: int = 0
    false: int = 0
    refusal: str = ""

    def add(self, other: Counts) -> None:
        for name in ("provable", "refuted", "read_provable", "proved", "false"):
            setattr(self, name, getattr(self, name) + getattr(other, name))


def attack_case(number: int, n_loops: int, levels: tuple[float, ...] | None = None) -> Counts:
    """Read one random machine, and hold what is proved for the class against the truth."""
    case, counts = draw_case(number, seed=1), Counts()
    loops = draw_loops(case, n_loops, np.random.default_rng([number, 99]))
    truth = robust.friction.MaxwellSlip(case.K0)
    verdicts = [
        robust.prove_friction(case.truth, K, truth, delay=late + case.delay).verdict
        for K, late in loops
    ]
    counts.provable = verdicts.count("proved")
    try:
        found = robust.friction.machine_with_friction(
            records_of(case, number, levels), free=not case.stiffness
        )
    except ValueError as error:
        counts.refusal = str(error)
        return counts
    counts.refuted, counts.read_provable = verdicts.count("refuted"), verdicts.count("proved")
    for (K, late), verdict in zip(loops, verdicts, strict=True):
        if verdict != "not decided" and prove_read(found, K, late):
            counts.proved += verdict == "proved"
            counts.false += verdict == "refuted"
    if counts.false:
        print(
            f"{number} FALSE: K0 {case.K0:.4g}, k {case.stiffness:.4g}, delay {case.delay:.3g}:"
            f" {found}",
            flush=True,
        )
    return counts


def attack(n_machines: int, n_loops: int = 12, levels: tuple[float, ...] | None = None) -> None:
    """Attack random machines of one mass with Maxwell slip."""
    total, machines, number, refused = Counts(), 0, -1, 0
    begin = time.process_time()
    while machines < n_machines:
        number += 1
        case = draw_case(number, seed=1)
        if case.family != FAMILIES[0] or case.flexible:
            continue
        machines += 1
        counts = attack_case(number, n_loops, levels)
        total.add(counts)
        if counts.refusal:
            refused += 1
            print(f"{number}: refused: {counts.refusal}", flush=True)
    print(
        f"{machines} machines, {refused} refused, {n_loops} loops each,"
        f" {time.process_time() - begin:.0f} s of CPU: of {total.refuted} loops that the truth"
        f" refutes {total.false} were proved; of {total.provable} provable ones {total.proved} were"
        f" proved ({total.proved / max(1, total.provable):.0%};"
        f" {total.proved / max(1, total.read_provable):.0%} of those of machines that were read)"
    )


@dataclass(frozen=True)
class LevelSet:
    """Three levels of the linear motor at rest: under which drive, to which frequency, after how
    many periods.
    """

    soft: bool
    f_max: float
    n_discard: int
    rms: tuple[float, float, float]


SETS = tuple(
    LevelSet(*choice)
    for choice in product(
        (False, True), (100.0, 400.0), (1, 6), ((0.3, 4.0, 60.0), (0.3, 4.0, 120.0))
    )
)
#: Error of m, K0 or Fs above which a set that is read is wrong.
RIGHT = 0.01


class Outcome(Enum):
    """What became of a set of levels."""

    RIGHT = "right"
    REFUSED = "refused"
    WRONG = "wrong without a flag"


def measure_set(one: LevelSet, seed: int) -> list[nlfrf.Record]:
    """Records of the three levels, played as files under the drive of the preset or a soft one."""
    axis = nlfrf.servo_axis("linear motor")
    if one.soft:
        axis = replace(axis, drive=replace(axis.drive, kv=20, kp=40, tn=0.05))
    records = []
    with tempfile.TemporaryDirectory() as folder:
        table, trace = Path(folder) / "play.csv", Path(folder) / "trace.csv"
        for rms in one.rms:
            ms = nlfrf.multisine(
                fs=axis.drive.fs, n_samples=4000, f_min=5.0, f_max=one.f_max, rng=seed
            )
            experiment = design_experiment(axis, ms, rms=rms, n_periods=3, n_discard=one.n_discard)
            nlfrf.save(experiment, table)
            play_experiment(axis, table, trace, oversampling=16)
            records += load_trace(trace, experiment)
    return records


def judge_set(fit: Any, truth: dict[str, float]) -> Outcome:
    """Whether m, K0 and Fs were read right, or left open."""
    pulls = pulls_of(fit, {name: truth[name] for name in ("mass", "K0", "Fs")})
    if any(abs(off) > RIGHT for off, _ in pulls.values()):
        return Outcome.WRONG
    return Outcome.RIGHT if len(pulls) == 3 else Outcome.REFUSED


def read_sets(n_seeds: int, first: int = 0) -> None:
    """Read all sets with other phases each time."""
    truth = truth_of(nlfrf.servo_axis("linear motor"))
    counts = dict.fromkeys(Outcome, 0)
    tables: dict[str, list[tuple[float, bool]]] = defaultdict(list)
    for seed, one in product(range(first, first + n_seeds), SETS):
        fit = robust.friction.identify_friction(measure_set(one, seed), free=True)
        outcome, pulls = judge_set(fit, truth), pulls_of(fit, truth)
        counts[outcome] += 1
        for name, pull in pulls.items():
            tables[name].append(pull)
        drive, levels = "soft" if one.soft else "stiff", ", ".join(f"{rms:g}" for rms in one.rms)
        print(
            f"{drive} drive, to {one.f_max:g} Hz, {one.n_discard} discarded, {levels} N, phases"
            f" {seed}: {outcome.value};"
            f" {format_pulls(pulls) or fit.questions[0].kind.name.lower()}",
            flush=True,
        )
    print(", ".join(f"{outcome.value} {count}" for outcome, count in counts.items()))
    for name, table in tables.items():
        largest = max(abs(off) for off, _ in table)
        print(
            f"{name}: largest error {100 * largest:.2f} %,"
            f" {np.mean([held for _, held in table]):.0%} hold"
        )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="seed of the first run")
    parser.add_argument("--presets", default=",".join(name.replace(" ", "-") for name in AT_REST))
    parser.add_argument("--at", default="rest,motion")
    parser.add_argument("--masses", type=int, default=1, help="2: motor and load, at rest")
    parser.add_argument("--quiet", action="store_true", help="the tables only")
    parser.add_argument("--attack", type=int, default=0, help="random machines to attack instead")
    parser.add_argument("--levels", default="", help="of the attack")
    parser.add_argument(
        "--sets", type=int, default=0, help="phases of the sets of levels to read instead"
    )
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    if args.attack:
        attack(
            args.attack, levels=tuple(map(float, args.levels.split(","))) if args.levels else None
        )
        return
    if args.sets:
        read_sets(args.sets, args.first)
        return
    places = args.at.split(",")
    pooled: list[bool] = []
    for name in args.presets.replace("-", " ").split(","):
        axis, begin = nlfrf.servo_axis(name), time.process_time()
        tables: dict[tuple[str, str], list[tuple[float, bool]]] = defaultdict(list)
        said: dict[str, int] = defaultdict(int)
        for seed in range(args.first, args.first + args.runs):
            fits: dict[str, Any] = {}
            if "rest" in places:
                plan = TWO_MASSES[name] if args.masses == 2 else AT_REST[name]
                records = measure_at_rest(axis, plan, seed)
                fits["rest"] = robust.friction.identify_friction(
                    records, free=True, masses=args.masses
                )
            if "motion" in places:
                fits["motion"] = robust.friction.identify_sliding(
                    *measure_in_motion(axis, IN_MOTION[name], seed)
                )
            kinds = (
                {question.kind for question in fits["rest"].questions} if "rest" in fits else set()
            )
            for kind in kinds:
                said[kind.name.lower().replace("_", " ")] += 1
            for where, fit in fits.items():
                pulls = pulls_of(fit, truth_of(axis, args.masses if where == "rest" else 1))
                if not args.quiet:
                    print(f"{name} {seed} in {where}: {format_pulls(pulls)}", flush=True)
                for key, pull in pulls.items():
                    tables[where, key].append(pull)
        seconds = (time.process_time() - begin) / args.runs
        print(
            f"{name}: {args.runs} runs, {seconds:.1f} s of CPU each; left open at rest:"
            f" {dict(said) or 'nothing'}"
        )
        print("| at | number | runs | median error | largest error | within 5 % | interval holds |")
        print("|---|---|---|---|---|---|---|")
        for (where, key), pulls in tables.items():
            off, held = np.array([p[0] for p in pulls]), [p[1] for p in pulls]
            pooled += held
            print(
                f"| {where} | {key} | {off.size} | {100 * np.median(off):+.2f} % |"
                f" {100 * np.abs(off).max():.2f} % | {np.mean(np.abs(off) < 0.05):.0%} |"
                f" {np.mean(held):.0%} |",
                flush=True,
            )
    print(f"intervals of all that was read: {np.mean(pooled):.1%} of {len(pooled)} hold")


if __name__ == "__main__":
    main()
