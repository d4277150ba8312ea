"""Attack on the bound within which friction with stiction settles (T7): runs chosen to hunt, and
how far they get.

Axes of 1 to 50 kg without a spring under a cascade with integral action, at 1 to 8 kHz with one
period of delay, whose verdict is "settles": friction of the class at its limits (all of K0 and Fs,
one to four elements, sliders that vary with speed, rest, position, direction and at random), each
first drawn at random, the worst of them varied. Counted: runs that leave the bound in the last
third of their time. Printed: bound over the largest hunting found, beside that of T4; a run hunts
that swings in its last tenth by half of what it does in its last third or more, not a slow rest of
the transient.

python -m benchmarks.settling [--runs 500]
"""

from __future__ import annotations

import argparse
import time
import warnings
from dataclasses import dataclass, replace

import control
import numpy as np

import nlfrf
import robust
from nlfrf.friction import VaryingSliders
from robust.friction.loop import friction_loop
from robust.friction.plant import friction_plant

FS = 20.0  # [N]; everything scales with it
RUNS_PER_AXIS = 30
MOVING = 0.02  # of Fs/K0: a smaller swing is no hunting
LONGEST = 60_000  # samples of a run
TIME_CONSTANTS = 8  # slowest ones before it counts


@dataclass
class Axis:
    """A free mass, its cascade, and the class of its friction."""

    mass: float
    K: control.StateSpace
    T: float
    K0: float
    stiction: float


def cascade(
    mass: float, bandwidth: float, T: float, share: float, reset: float
) -> control.StateSpace:
    """u = kp (1 + T/(tn (z - 1))) (kv e + (1 - 1/z)/T e) with kp = mass w, kv = share w, tn =
    reset/w.
    """
    w = 2 * np.pi * bandwidth
    lead = control.tf([share * w + 1 / T, -1 / T], [1, 0], T)
    return control.ss(lead * control.tf([1, -1 + T * w / reset], [1, -1], T) * (mass * w))


def draw_axis(rng: np.random.Generator) -> Axis:
    """An axis whose loop is stable sliding and stuck, if perhaps not at rest."""
    mass, T = 10 ** rng.uniform(0, 1.7), 1 / rng.choice([1000.0, 2000.0, 4000.0, 8000.0])
    bandwidth = rng.uniform(0.004, 0.03) / T
    K = cascade(mass, bandwidth, T, rng.uniform(0.1, 0.35), 10 ** rng.uniform(0.5, 1.3))
    K0 = mass * (2 * np.pi * bandwidth) ** 2 * 10 ** rng.uniform(-0.5, 1)
    return Axis(mass=mass, K=K, T=T, K0=K0, stiction=float(rng.choice([1.2, 1.5, 2.0, 3.0])))


def settling_proof(axis: Axis) -> robust.friction.FrictionProof:
    """The verdict on an axis."""
    friction = robust.friction.MaxwellSlip(axis.K0, axis.stiction)
    return robust.prove_friction(
        friction_plant(axis.mass, 0.0), axis.K, friction, delay=axis.T, Fs=FS
    )


def draw_law(rng: np.random.Generator, axis: Axis) -> VaryingSliders:
    """A friction of the class at its limits."""
    n = int(rng.choice([1, 1, 1, 2, 4]))
    scale = FS / axis.K0
    return VaryingSliders(
        stiffness=rng.dirichlet(np.ones(n)) * axis.K0 * rng.choice([1.0, 1.0, 0.3]),
        strength=rng.dirichlet(np.ones(n)) * FS,
        stiction=axis.stiction,
        vs=10 ** rng.uniform(-4.5, -1.5),
        dwell=10 ** rng.uniform(-3, 0) if rng.random() < 0.3 else 0.0,
        wavelength=scale * 10 ** rng.uniform(-0.5, 2) if rng.random() < 0.3 else np.inf,
        asymmetry=rng.uniform() if rng.random() < 0.3 else 0.0,
        seed=int(rng.integers(1, 1000)) if rng.random() < 0.2 else 0,
    )


def vary_law(rng: np.random.Generator, law: VaryingSliders) -> VaryingSliders:
    """One near it."""
    weight = law.stiffness * np.exp(0.2 * rng.standard_normal(law.stiffness.size))
    return replace(
        law,
        stiffness=weight * (law.stiffness.sum() / weight.sum()),
        vs=law.vs * np.exp(0.5 * rng.standard_normal()),
        dwell=law.dwell * np.exp(0.5 * rng.standard_normal()),
        wavelength=law.wavelength * np.exp(0.5 * rng.standard_normal()),
    )


def hunting(rng: np.random.Generator, axis: Axis, law: VaryingSliders) -> tuple[float, bool]:
    """[m] largest displacement in the last third of a run, after a disturbance in its first tenth;
    whether it hunts.
    """
    loop = friction_loop(friction_plant(axis.mass, 0.0), axis.K, axis.T)
    slowest = max(
        np.abs(p)[np.abs(p) < 1 - 1e-9].max() for p in (loop.poles(), loop.poles(axis.K0))
    )
    n = int(np.clip(1.5 * TIME_CONSTANTS / -np.log(slowest), 2000, LONGEST))
    force, end = np.zeros(n), n // 10
    force[:end] = rng.choice([-1, 1]) * FS * 10 ** rng.uniform(-0.3, 0.5) * np.linspace(0, 1, end)
    rig = nlfrf.rig.Rig(axis.mass, 0.0, law, 0.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", nlfrf.DataWarning)
        found = nlfrf.rig.run(
            rig,
            np.zeros(n),
            nlfrf.rig.Controller(axis.K, delay=axis.T),
            disturbance=force,
            oversampling=8,
        )
    third, tenth = found.x[-n // 3 :], found.x[-n // 10 :]
    return float(np.abs(third).max()), bool(
        np.ptp(tenth) > max(0.5 * np.ptp(third), MOVING * FS / axis.K0)
    )


def attack(rng: np.random.Generator, axis: Axis, runs: int) -> tuple[np.ndarray, np.ndarray]:
    """(runs,) [m] how far each got, and whether it hunts: half of them drawn, half near the worst
    so far.
    """
    worst, law, reached, hunts = 0.0, draw_law(rng, axis), [], []
    for i in range(runs):
        tried = draw_law(rng, axis) if i < runs // 2 else vary_law(rng, law)
        far, moves = hunting(rng, axis, tried)
        reached.append(far)
        hunts.append(moves)
        if moves and far > worst:
            worst, law = far, tried
    return np.array(reached), np.array(hunts)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=500, help="runs, on all axes together")
    args = parser.parse_args()
    rng, done, outside = np.random.default_rng(0), 0, 0
    verdicts: dict[str, int] = {}
    rows, times = [], []
    while done < args.runs:
        axis = draw_axis(rng)
        begin = time.process_time()
        proof = settling_proof(axis)
        verdicts[str(proof.verdict)] = verdicts.get(str(proof.verdict), 0) + 1
        if not np.isfinite(proof.settling_error):
            continue
        times.append(time.process_time() - begin)
        reached, moves = attack(rng, axis, RUNS_PER_AXIS)
        done += reached.size
        outside += int((reached > proof.settling_error).sum())
        largest = reached[moves].max() if moves.any() else np.nan
        rows.append((axis.stiction, proof.error_bound, proof.settling_error, largest))
        print(
            f"  stiction {axis.stiction:g}: T4 {1e6 * proof.error_bound:.3g}, T7"
            f" {1e6 * proof.settling_error:.3g} um, hunts {1e6 * largest:.3g} um",
            flush=True,
        )
    stiction, t4, t7, found = np.array(rows).T
    print(
        f"verdicts {verdicts}; {outside} of {done} runs outside; CPU of a proof: median"
        f" {np.median(times):.2g} s"
    )
    for one in np.unique(stiction):
        these = stiction == one
        ratio, old = (t7 / found)[these & ~np.isnan(found)], (t4 / found)[these & ~np.isnan(found)]
        text = (
            f"stiction {one:g}, {these.sum()} axes: T4 over T7 median"
            f" {np.median((t4 / t7)[these]):.3g}"
        )
        if ratio.size:
            text += (
                f"; bound over hunting of the {ratio.size} that hunt: median"
                f" {np.median(ratio):.3g}, worst "
            )
            text += (
                f"{ratio.max():.3g}, best {ratio.min():.3g} (T4: median {np.median(old):.3g}, worst"
                f" {old.max():.3g})"
            )
        print(text)


if __name__ == "__main__":
    main()
