"""The servo axis: what a run costs, against a loop of the rig; random axes attacked.

    python -m benchmarks.bench_servo [axes]

A run is 2 s of a preset under its drive: 8000 periods at 4 kHz, one integration step each, friction
on every mass. The time is that of one process, warm, by the processor's clock.
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np

from benchmarks.bench_axes import some_law
from benchmarks.machine import main as machine
from benchmarks.timing import in_turn
from nlfrf import paper_rig, servo_axis
from nlfrf.friction import Coulomb
from nlfrf.rig import Drive, ServoAxis, run
from robust.shaping import pid

PRESETS = ("linear motor", "belt", "ball screw", "joint")
SECONDS = 2


def costs():
    """Milliseconds of a run of each preset, and as multiples of one of the rig in a loop at 1
    kHz.
    """
    runs = {}
    for name in PRESETS:
        axis = servo_axis(name)
        way = 1e-3 if axis.motion == "linear" else 2e-2
        r = way * np.sin(2 * np.pi * np.arange(SECONDS * int(axis.drive.fs)) / 4000)
        runs[name] = lambda axis=axis, r=r: run(axis, r)
    rig, K, r = paper_rig(), pid(40.0, 300.0, dt=1e-3), np.full(SECONDS * 1000, 1e-3)
    runs["rig"] = lambda: run(rig, r, K)
    spent = in_turn(runs, 15)
    for name in PRESETS:
        print(
            f"  {name:13} {1e3 * spent[name]:5.1f} ms a run, {spent[name] / spent['rig']:.1f} times"
            f" a loop of the rig; 10 000 runs {1e4 * spent[name]:.0f} s"
        )


def some_axis(rng):
    """One or two masses with any friction under any drive, most of them badly set."""
    drive = Drive(
        fs=4000.0,
        kp_unit="A/(m/s)",
        torque_constant=10 ** rng.uniform(0, 2),
        kv=10 ** rng.uniform(0, 3),
        kp=10 ** rng.uniform(-1, 2),
        tn=10 ** rng.uniform(-2.5, 0),
        limit=10 ** rng.uniform(0, 2),
        lag=10 ** rng.uniform(-4, -3),
        velocity_feedforward=1.0,
    )
    load = {
        "load_inertia": 10 ** rng.uniform(-0.5, 1.5),
        "load_friction": some_law(rng),
        "stiffness": 10 ** rng.uniform(4, 6.5),
        "damping": 10 ** rng.uniform(0, 2),
    }
    two = rng.random() < 0.7
    drive = replace(drive, encoder=str(rng.choice(["motor", "load"])) if two else "motor")
    return ServoAxis(
        motor_inertia=10 ** rng.uniform(-0.5, 1.5),
        motor_friction=some_law(rng),
        drive=drive,
        resolution=1e-6,
        **(load if two else {}),
    )


def attack(seed):
    """Whether all that a random axis gives is finite, and the energy it gained when left alone,
    over the largest.
    """
    rng = np.random.default_rng(seed)
    axis = some_axis(rng)
    trace = run(axis, 1e-4 * rng.standard_normal(800).cumsum())
    finite = all(
        np.isfinite(getattr(trace, name)).all()
        for name in ("x", "v", "friction", "current", "position")
    )
    free = replace(axis, drive=replace(axis.drive, lag=0.0, limit=np.inf))
    force = np.where(np.arange(1200) < 300, 30 * rng.standard_normal(1200), 0.0)
    alone = run(free, {"torque": force}, oversampling=8)
    rig = axis.rig
    energy = np.einsum("in,ij,jn->n", alone.v, rig.mass, alone.v) / 2
    energy += np.einsum("in,ij,jn->n", alone.x, rig.stiffness, alone.x) / 2
    stored = 0.0
    for law in rig.friction:
        if law is not None and not isinstance(law, Coulomb):
            K0 = (
                float(np.sum(getattr(law, "stiffness", 0.0)))
                or getattr(law, "sigma0", 0.0)
                or law.curve.K0
            )
            top = float(np.sum(getattr(law, "strength", 0.0))) or getattr(law, "Fs", 0.0) or law.Fc
            stored += 2 * top**2 / K0
    late = energy[304:]
    gained = max(float((late - np.minimum.accumulate(late)).max()) - stored, 0.0) / energy.max()
    return finite, trace.diverged, gained


def main():
    """Both."""
    machine()
    print(f"one run: {SECONDS} s at 4 kHz, one step of the integrator a period")
    costs()
    n = int(sys.argv[1]) if len(sys.argv) > 1 else 300
    found = [attack(seed) for seed in range(n)]
    finite, diverged, gained = (np.array([one[i] for one in found]) for i in range(3))
    print(
        f"{n} random axes: {np.count_nonzero(~finite)} gave a number that is none,"
        f" {np.sum(diverged)} ran away"
    )
    print(
        f"  energy gained when left alone, largest {gained.max():.1e} of the largest energy (seed"
        f" {gained.argmax()})"
    )


if __name__ == "__main__":
    main()
