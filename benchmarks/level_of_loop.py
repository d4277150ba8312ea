"""Loops that a check calls statistically robust, on the rig with friction, at other levels than
that of the experiment.

python -m benchmarks.level_of_loop [--seeds 30] [--processes 1]

Each seed identifies the rig at five levels of force, and at three of them together, and designs by
loop shaping: six crossovers, each with a quarter to twice the gain. What the check calls
statistically robust is put around the rig and moved for 3 s, by white noise of force or by a step
of the reference, and left alone for 4.5 s. A loop behaves if it neither runs away nor goes on
swinging. That is judged by its velocity: it does not cycle if it is at rest in the last 1.1 s (a
micrometre a second), or swings less there than nine tenths of what it did in the 1.1 s before.
"""

from __future__ import annotations

import argparse
import warnings
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from enum import Enum
from typing import NamedTuple

import control
import numpy as np

import nlfrf
import robust
from benchmarks.machine import main as machine
from robust.analysis.loop_level import find_state

LEVELS = (0.1, 0.3, 1.0, 3.0, 10.0)  # rms of the force, in the experiment and at the loop [N]
FAMILY = (0.3, 1.0, 3.0)  # from 0.1 to 10 N the set is so wide that no loop is called robust on it
EXPERIMENTS = (*[(rms,) for rms in LEVELS], FAMILY)
STEPS = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2)  # of the reference [m]
BAND = {"fs": 4096, "n_samples": 16384, "f_min": 1.25, "f_max": 250}
# [Hz], and factors on each design
CROSSOVERS = (5.0, 10.0, 20.0, 40.0, 80.0, 120.0)
GAINS = (0.25, 0.5, 1.0, 2.0)
T, MOVED, ALONE, SETTLED = 1e-3, 3000, 4500, 500  # sample time of the controller [s]; samples
AT_REST = 1e-6  # swing of the velocity [m/s]; a break-away of the rig reaches 6e-3
DYING = 0.9  # of the swing in the quarter before
AS_PREDICTED = 1.25  # factor on the rms of the motion


class Outcome(Enum):
    """What became of a loop after it was moved."""

    RESTS = "rests"
    DIES_OUT = "dies out"
    CYCLES = "cycles"
    RUNS_AWAY = "runs away"


class Run(NamedTuple):
    """One loop on the rig: how it was found, how it was moved, what was predicted and what came."""

    seed: int
    experiment: tuple[float, ...]
    kind: str  # "noise" or "step"
    size: float
    outcome: Outcome
    u_state: robust.analysis.LevelState
    y_state: robust.analysis.LevelState
    u: float  # predicted rms
    y: float
    y_worst: float
    true_u: float  # nan of a loop that ran away
    true_y: float

    @property
    def behaves(self) -> bool:
        """Whether it came to rest or was on its way."""
        return self.outcome in (Outcome.RESTS, Outcome.DIES_OUT)

    @property
    def as_predicted(self) -> bool:
        """Whether it moved by the rms that was predicted, within a factor."""
        return 1 / AS_PREDICTED < self.true_y / self.y < AS_PREDICTED  # no comparison holds of nan


def identify_model(levels: tuple[float, ...], seed: int) -> robust.UncertaintyModel:
    """The set of plants from one record at each level [N]."""
    blas = []
    for rms in levels:
        ms = nlfrf.multisine("special-odd", **BAND, rms=rms, rng=seed)
        record = nlfrf.simulate(nlfrf.paper_rig(), ms, n_periods=2, n_discard=1, oversampling=4)
        blas.append(nlfrf.identify(record))
    return robust.uncertainty(blas, robust.fit_nominal(blas, n_poles=3))


def design_controllers(model: robust.UncertaintyModel) -> list[control.StateSpace]:
    """Loop shaping at each crossover, with each gain; those that a check calls statistically
    robust.
    """
    plant, found = robust.sampled(model.nominal, T), []
    for crossover in CROSSOVERS:
        K = robust.ncfsyn(plant, robust.shaping.crossover_weight(plant, 2 * np.pi * crossover)).K
        for gain in GAINS:
            tried = control.StateSpace(K.A, K.B, gain * K.C, gain * K.D, T)
            if robust.check(model, tried).verdict == "statistically robust":
                found.append(tried)
    return found


def judge(response: nlfrf.rig.Trajectory) -> Outcome:
    """By the swing of the velocity after the loop was left alone."""
    if response.diverged:
        return Outcome.RUNS_AWAY
    quarter = ALONE // 4
    before, last = np.ptp(response.v[-2 * quarter : -quarter]), np.ptp(response.v[-quarter:])
    if last < AT_REST:
        return Outcome.RESTS
    return Outcome.DIES_OUT if last < DYING * before else Outcome.CYCLES


def run_loops(
    seed: int,
    levels: tuple[float, ...],
    model: robust.UncertaintyModel,
    loops: list[control.StateSpace],
    sizes_of: dict[str, tuple[float, ...]],
) -> Iterator[Run]:
    """Every loop on the rig, moved by noise of each level and by each step."""
    n = MOVED + ALONE
    noise = np.random.default_rng(seed).standard_normal(MOVED)
    force = np.pad(noise / noise.std(), (0, ALONE))
    # the prediction is linear in the size of a signal: once for each loop
    units = {
        "noise": robust.analysis.LoopSignals(disturbance=robust.analysis.NoiseSignal(1.0)),
        "step": robust.analysis.LoopSignals(reference=robust.analysis.StepSignal(1.0)),
    }
    predicted = {
        kind: [robust.analysis.predict_level(model, K, unit) for K in loops]
        for kind, unit in units.items()
    }
    for kind, sizes in sizes_of.items():
        for size in sizes:
            r = np.full(n, size if kind == "step" else 0.0)
            d = size * force if kind == "noise" else np.zeros(n)
            with ThreadPoolExecutor(1) as pool:
                responses = nlfrf.rig.run_loops(
                    nlfrf.paper_rig(), r, loops, disturbance=d, executor=pool
                )
            for one, response in zip(predicted[kind], responses, strict=True):
                u, y = size * one.u, size * one.y
                states = find_state(u, *one.u_measured), find_state(y, *one.y_measured)
                true = true_level(response, d, kind)
                yield Run(
                    seed,
                    levels,
                    kind,
                    size,
                    judge(response),
                    *states,
                    u,
                    y,
                    size * one.y_worst,
                    *true,
                )


def true_level(response: nlfrf.rig.Trajectory, force: np.ndarray, kind: str) -> tuple[float, float]:
    """Rms of the whole force and of the motion while a loop was moved, as `predict_level` means
    them.
    """
    if response.diverged:
        return np.nan, np.nan
    if kind == "step":
        u, x = (
            (max(one.max(), 0.0) - min(one.min(), 0.0)) / np.sqrt(8)
            for one in (response.u, response.x)
        )
        return float(u), float(x)
    moved = slice(SETTLED, MOVED)
    return float(np.std(response.u[moved] + force[moved])), float(np.std(response.x[moved]))


def study(
    seed: int,
    experiments: tuple[tuple[float, ...], ...] = EXPERIMENTS,
    noise: tuple[float, ...] = LEVELS,
    steps: tuple[float, ...] = STEPS,
) -> list[Run]:
    """Every run of one seed."""
    found: list[Run] = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for levels in experiments:
            model = identify_model(levels, seed)
            if loops := design_controllers(model):
                found += run_loops(seed, levels, model, loops, {"noise": noise, "step": steps})
    return found


def behaves_table(runs: list[Run], kind: str) -> list[str]:
    """Level of the experiment over level of the loop: k of n behave."""
    of_kind = [run for run in runs if run.kind == kind]
    sizes = sorted({run.size for run in of_kind})
    rows = [
        "| identified at | " + " | ".join(f"{size:g}" for size in sizes) + " |",
        "|---" * (len(sizes) + 1) + "|",
    ]
    for levels in dict.fromkeys(run.experiment for run in of_kind):
        cells = []
        for size in sizes:
            here = [run.behaves for run in of_kind if (run.experiment, run.size) == (levels, size)]
            cells.append(f"{sum(here)} of {len(here)}")
        rows.append(f"| {', '.join(f'{rms:g}' for rms in levels)} N | {' | '.join(cells)} |")
    return rows


def quantiles(ratios: list[float]) -> str:
    """Median, and 5 to 95 %."""
    known = np.array([ratio for ratio in ratios if np.isfinite(ratio)])
    if not known.size:
        return "-"
    low, middle, high = np.quantile(known, (0.05, 0.5, 0.95))
    return f"{middle:.2f} ({low:.2f} to {high:.2f})"


def predicted_place(run: Run) -> robust.analysis.LevelState:
    """Above where input or output is; inside where both are; else below."""
    states = {run.u_state, run.y_state}
    if robust.analysis.LevelState.ABOVE in states:
        return robust.analysis.LevelState.ABOVE
    return (
        robust.analysis.LevelState.INSIDE
        if states == {robust.analysis.LevelState.INSIDE}
        else robust.analysis.LevelState.BELOW
    )


def state_table(runs: list[Run], kind: str) -> list[str]:
    """The words of the prediction: how many behave, and true over predicted rms of those that do
    not run away.
    """
    rows = [
        (
            "| identified at | predicted | behave | cycle | run away | motion as predicted | true"
            " over predicted motion |"
        ),
        "|---" * 7 + "|",
    ]
    for several in (False, True):
        for place in (
            robust.analysis.LevelState.INSIDE,
            robust.analysis.LevelState.BELOW,
            robust.analysis.LevelState.ABOVE,
        ):
            here = [
                run
                for run in runs
                if (run.kind, len(run.experiment) > 1, predicted_place(run))
                == (kind, several, place)
            ]
            if not here:
                continue
            count = Counter(run.outcome for run in here)
            rows.append(
                f"| {'three levels' if several else 'one level'} | {place.value} |"
                f" {sum(run.behaves for run in here)} of {len(here)} | {count[Outcome.CYCLES]} |"
                f" {count[Outcome.RUNS_AWAY]} |"
                f" {100 * np.mean([run.as_predicted for run in here]):.0f} % |"
                f" {quantiles([run.true_y / run.y for run in here])} |"
            )
    return rows


def bound_table(runs: list[Run]) -> list[str]:
    """How often the true motion stays under its bound over the set, where that is finite and no
    loop ran away.
    """
    rows = ["| predicted | under the bound over the set |", "|---|---|"]
    for place in (
        robust.analysis.LevelState.INSIDE,
        robust.analysis.LevelState.BELOW,
        robust.analysis.LevelState.ABOVE,
    ):
        here = [
            run.true_y <= run.y_worst
            for run in runs
            if predicted_place(run) is place and np.isfinite([run.y_worst, run.true_y]).all()
        ]
        rows.append(f"| {place.value} | {sum(here)} of {len(here)} |")
    return rows


def main() -> None:
    """Everything."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=30, help="multisines and disturbances drawn")
    parser.add_argument("--processes", type=int, default=1, help="processes that share the seeds")
    args = parser.parse_args()
    machine()
    runs: list[Run] = []
    with ProcessPoolExecutor(args.processes) as pool:
        for found in pool.map(study, range(args.seeds)):
            runs += found
    for kind, what in (
        ("noise", "noise of force [N rms]"),
        ("step", "a step of the reference [m]"),
    ):
        print(f"\nbehave after {what}")
        print("\n".join(behaves_table(runs, kind)))
        print(f"\nwhat the predicted level said, {what}")
        print("\n".join(state_table(runs, kind)))
    print("\nmotion under noise of force, of loops that did not run away")
    print("\n".join(bound_table(runs)))


if __name__ == "__main__":
    main()
