"""How well machines with friction are identified from records: errors and coverage of intervals on the axis presets.

At rest: `robust.identify_friction` on levels that stick, bend and slide, at random phases. In motion:
`robust.identify_sliding` at two speeds either way. The presets with a load are two masses with friction on both. At
rest one mass is fitted to them below a third of the antiresonance, and the table says how often that was refused.

The truth: mass and viscous friction of all that moves, K0, strength and Coulomb friction of all elements together. K0
of two masses is not one number, as the belt bends under the friction of the load.

python -m benchmarks.read_machine [--runs 20] [--presets linear-motor,belt] [--quiet]
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections import defaultdict
from dataclasses import dataclass
from typing import Any

import numpy as np

import nlfrf
import robust

__all__ = ["AT_REST", "IN_MOTION", "Plan", "measure_at_rest", "measure_in_motion", "pulls_of", "truth_of"]


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
#: Preset -> level and speeds in motion.
IN_MOTION = {
    "linear motor": Plan((20,), 2, 200, 8000, (0.1, 0.3)),
    "belt": Plan((20,), 2, 12, 8000, (0.1, 0.3)),
    "ball screw": Plan((60,), 2, 30, 8000, (0.05, 0.15)),
    "joint": Plan((2,), 0.5, 4, 16000, (0.2, 0.6)),
}


def truth_of(axis: nlfrf.ServoAxis) -> dict[str, float]:
    """What is to be read; delay and K0 of one mass only."""
    laws = [law for law in (axis.motor_friction, axis.load_friction) if law is not None]
    found = {
        "mass": axis.inertia,
        "damping": axis.motor_damping + axis.load_damping,
        "Fs": sum(float(law.strength.sum()) for law in laws),
        "coulomb": sum(float(law.strength.sum() / law.stiction) for law in laws),
    }
    if len(laws) == 1:
        found |= {
            "K0": float(laws[0].stiffness.sum()),
            "delay": axis.drive.lag + axis.drive.delay_periods / axis.drive.fs,
        }
    return found


def played(axis: nlfrf.ServoAxis, plan: Plan, rms: float, rng: Any) -> nlfrf.Multisine:
    """A multisine of a plan."""
    grid = {"f_min": plan.f_min, "f_max": plan.f_max, "n_samples": plan.n_samples}
    return nlfrf.multisine("special-odd", fs=axis.drive.fs, rms=rms, rng=rng, **grid)


def measure_at_rest(axis: nlfrf.ServoAxis, plan: Plan, seed: int) -> list[nlfrf.Record]:
    """Records of all levels."""
    return [
        nlfrf.simulate_servo(
            axis,
            played(axis, plan, rms, np.random.default_rng([seed, i])),
            n_periods=4,
            n_discard=2,
            oversampling=8,
        )
        for i, rms in enumerate(plan.rms)
    ]


def measure_in_motion(axis: nlfrf.ServoAxis, plan: Plan, seed: int) -> tuple[list[nlfrf.Record], list[float]]:
    """Records either way at each speed, and the velocities."""
    velocities = [sign * speed for speed in plan.speeds for sign in (1, -1)]
    records = [
        nlfrf.simulate_servo(
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="seed of the first run")
    parser.add_argument("--presets", default=",".join(name.replace(" ", "-") for name in AT_REST))
    parser.add_argument("--quiet", action="store_true", help="the tables only")
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    pooled: list[bool] = []
    for name in args.presets.replace("-", " ").split(","):
        axis, begin = nlfrf.servo_axis(name), time.process_time()
        tables: dict[tuple[str, str], list[tuple[float, bool]]] = defaultdict(list)
        said: dict[str, int] = defaultdict(int)
        for seed in range(args.first, args.first + args.runs):
            at_rest = robust.identify_friction(measure_at_rest(axis, AT_REST[name], seed), free=True)
            sliding = robust.identify_sliding(*measure_in_motion(axis, IN_MOTION[name], seed))
            kinds = {question.kind for question in at_rest.questions}
            for kind in kinds:
                said[kind.name.lower().replace("_", " ")] += 1
            for where, fit in (("rest", at_rest), ("motion", sliding)):
                pulls = pulls_of(fit, truth_of(axis))
                if not args.quiet:
                    row = ", ".join(
                        f"{k} {100 * off:+.2f} %{'' if held else ' OUT'}" for k, (off, held) in pulls.items()
                    )
                    print(f"{name} {seed} in {where}: {row}", flush=True)
                if where == "motion" or robust.Gap.OTHER_MACHINE not in kinds:
                    for key, pull in pulls.items():
                        tables[where, key].append(pull)
        seconds = (time.process_time() - begin) / args.runs
        print(f"{name}: {args.runs} runs, {seconds:.1f} s of CPU each; left open at rest: {dict(said) or 'nothing'}")
        print("| at | number | runs | median error | largest error | within 5 % | interval holds |")
        print("|---|---|---|---|---|---|---|")
        for (where, key), pulls in tables.items():
            off, held = np.array([p[0] for p in pulls]), [p[1] for p in pulls]
            pooled += held
            print(
                f"| {where} | {key} | {off.size} | {100 * np.median(off):+.2f} % | {100 * np.abs(off).max():.2f} % | "
                f"{np.mean(np.abs(off) < 0.05):.0%} | {np.mean(held):.0%} |",
                flush=True,
            )
    print(f"intervals of all that was read: {np.mean(pooled):.1%} of {len(pooled)} hold")


if __name__ == "__main__":
    main()
