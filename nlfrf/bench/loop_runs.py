"""A stack of loops around one rig as the compiled code takes it: one row of every array a run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from nlfrf.bench.rig import Rig
from nlfrf.friction import kernel_data as packing
from nlfrf.friction.laws import packed_law
from nlfrf.friction.own import OwnLaw
from nlfrf.shared.values import value

__all__ = ["LoopRuns", "Parts", "respond"]

#: How often the step is halved before a loop that runs away is called diverged.
MOST_HALVINGS = 6
SHARED = ("rig", "fs", "saturation", "resolution", "steps")


@value(copy=False)
class LoopRuns:
    """Runs of sampled loops around one rig.

    Fields
    ------
    rig : Rig
    fs, saturation, resolution : float
    steps : int
        Integration steps a sample.
    A, B, C, D : (R, s, s), (R, s), (R, s), (R,) ndarray
        Controllers.
    r, disturbance, noise : (R, n) ndarray
    delays : (R,) ndarray
        In samples.
    initial : (R, 2) ndarray
        Position and velocity.
    """

    rig: Rig
    fs: float
    saturation: float
    resolution: float
    steps: int
    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    r: np.ndarray
    disturbance: np.ndarray
    noise: np.ndarray
    delays: np.ndarray
    initial: np.ndarray

    def chosen(self, rows: np.ndarray, steps: int) -> LoopRuns:
        """Some of the runs, with other steps."""
        names = [field.name for field in fields(self) if field.name not in SHARED]
        arrays: dict[str, Any] = {name: some(getattr(self, name), rows) for name in names}
        return replace(self, steps=steps, **arrays)

    def __reduce__(self) -> Any:
        """To another process, what all runs share travels once."""
        held = {field.name: getattr(self, field.name) for field in fields(self)}
        once = [name for name, part in held.items() if isinstance(part, np.ndarray) and part.strides[0] == 0]
        return arrived, (held | {name: held[name][:1] for name in once}, once, self.delays.size)


def some(rows: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Some rows; of one row shown many times, the same fewer times."""
    return np.broadcast_to(rows[:1], (chosen.size, *rows.shape[1:])) if rows.strides[0] == 0 else rows[chosen]


def arrived(held: dict[str, Any], once: list[str], n: int) -> LoopRuns:
    """The runs as they were sent."""
    every = {name: np.broadcast_to(held[name], (n, *held[name].shape[1:])) for name in once}
    return LoopRuns(**(held | every))


class Parts(Sequence[LoopRuns]):
    """The same runs in parts of at most so many, each made when it is asked for."""

    def __init__(self, runs: LoopRuns, most: int) -> None:
        n = runs.delays.size
        self.runs, self.rows = runs, np.array_split(np.arange(n), -(-n // most))

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, i: Any) -> Any:
        return self.runs.chosen(self.rows[i], self.runs.steps)


def respond(runs: LoopRuns) -> dict[str, np.ndarray]:
    """rows (R, n, 5) of x, v, y, u and friction at each sample, lengths up to where a run ran away, loops lost.

    What does not reach the end is run again with shorter steps, before it is believed.
    """
    found = attempt(runs)
    for halving in range(1, MOST_HALVINGS + 1):
        short = np.flatnonzero(found["lengths"] < runs.r.shape[1])
        if not short.size:
            break
        again = attempt(runs.chosen(short, runs.steps * 2**halving))
        for name, part in again.items():
            found[name][short] = part
    return found


def attempt(runs: LoopRuns) -> dict[str, np.ndarray]:
    """One call of the compiled code for all runs."""
    n_runs, n = runs.r.shape
    law, grid = packed_law(runs.rig.friction)
    body = packing.Body(False, float(runs.rig.mass), float(runs.rig.stiffness), float(runs.rig.damping))
    memory = packing.at_rest(law.curve, grid)
    states = np.tile(memory.state, (n_runs, 1))
    stacks = np.tile(memory.stack, (n_runs, 1, 1))
    states[:, packing.X], states[:, packing.V] = runs.initial.T
    if law.form == packing.COULOMB:
        states[:, packing.DIRECTION] = np.sign(runs.initial[:, 1])
    run_loops = kernel_of(law)
    if isinstance(law, OwnLaw):
        stacks[:, 0, : law.of.rest.size] = law.of.rest
    rows, lengths = np.zeros((n_runs, n, 5)), np.zeros(n_runs, dtype=np.int64)
    # copies: the code was compiled for arrays that can be written
    controllers = [np.array(part, order="C") for part in (runs.A, runs.B, runs.C, runs.D)]
    signals = [np.array(part, order="C") for part in (runs.r, runs.disturbance, runs.noise)]
    numbers = float(runs.fs), float(runs.saturation), float(runs.resolution)
    places = np.array(grid), states, stacks
    run_loops(
        body,
        packing.Law(*law),
        *places,
        *controllers,
        *signals,
        *numbers,
        np.array(runs.delays, order="C"),
        int(runs.steps),
        rows,
        lengths,
    )
    return {"rows": rows, "lengths": lengths, "lost": states[:, packing.LOST].copy()}


def kernel_of(law: packing.Law) -> Callable[..., None]:
    """The compiled loops around a law."""
    if isinstance(law, OwnLaw):
        from nlfrf.friction.own_kernels import own_loops

        return own_loops(law.of.derivative, law.of.force, law.of.rest.size)
    from nlfrf.friction.loop_kernels import run_loops

    return run_loops
