"""Attack on proofs with friction at motor and load: loops that are proved, and friction of the
class that moves them.

Axes of motor and load behind a spring, under a P-PI cascade at 1 to 8 kHz with lag and delay of the
current, the encoder at either. For each loop that is proved with Maxwell slip at both masses, runs
of the simulated axis, which shares no code with the proofs: friction of the class at its limits at
both masses (all of K0, sliders that vary with speed, rest, position, direction and at random),
after a push. Counted: runs that still move at their end. For loops that are refuted: whether the
springs that refute them move the simulated axis. For all with a bound: how much of it the runs
reach.

python -m benchmarks.friction_ports [--axes 200] [--runs 8]
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections import Counter
from dataclasses import dataclass, replace

import numpy as np

import nlfrf
import robust
from nlfrf.friction import VaryingSliders
from nlfrf.rig import Drive
from robust.friction.classes.maxwell_slip import MaxwellSlip
from robust.friction.loop import friction_loop
from robust.friction.plant import FrictionPlant, two_mass_plant
from robust.servo import cascade
from robust.servo.checking.friction import friction_behind_lag

MOVING = 0.02  # of Fs/K0: a smaller swing is rest
LONGEST = 40_000  # samples of a run
TIME_CONSTANTS = 20  # slowest ones, sliding and stuck, before a run ends
ENCODERS = ("motor", "motor", "motor", "load")


@dataclass
class PortCase:
    """Motor, load and coupling, the drive, and the class of the friction at both."""

    machine: FrictionPlant
    axis: nlfrf.rig.ServoAxis
    settings: Drive
    friction: tuple[MaxwellSlip, ...]
    Fs: tuple[float, float]


def draw_case(number: int, seed: int = 0) -> PortCase:
    """A two-mass axis and gains from timid to too bold."""
    rng = np.random.default_rng([seed, number])
    motor = 10 ** rng.uniform(0, 2)
    load = motor * 10 ** rng.uniform(-0.7, 0.7)
    fs = float(rng.choice([1000.0, 2000.0, 4000.0, 8000.0]))
    antiresonance = 2 * np.pi * fs * 10 ** rng.uniform(-2.2, -1.2)
    k = load * antiresonance**2
    c = 2 * rng.uniform(0.005, 0.05) * k / antiresonance
    bandwidth = antiresonance * 10 ** rng.uniform(-1, 0.3)
    kp = (motor + load) * bandwidth
    kv, tn = bandwidth * rng.uniform(0.1, 0.5), 10 ** rng.uniform(0.3, 1.5) / bandwidth
    if rng.random() < 0.2:
        tn = np.inf
    lag, delay_periods = rng.choice([0.0, 0.5]) / fs, float(rng.choice([0, 1, 1, 1.5]))
    encoder = str(rng.choice(ENCODERS))
    held = kp * (kv + (1 / tn if np.isfinite(tn) else 0.0))  # stiffness of the drive at rest
    K0 = held * 10 ** rng.uniform(-0.5, 1.5, 2)
    stiction = np.array([1.0, 1.05, 1.2, 1.5])[rng.integers(0, 4, 2)]
    Fs = tuple(map(float, 10 ** rng.uniform(0, 1, 2)))
    settings = Drive(
        fs=fs,
        kv=kv,
        kp=kp,
        kp_unit="N/(m/s)",
        tn=tn,
        lag=lag,
        delay_periods=delay_periods,
        encoder=encoder,
    )
    drive = replace(settings, velocity_feedforward=1.0)
    axis = nlfrf.rig.ServoAxis(
        motor_inertia=motor, drive=drive, load_inertia=load, stiffness=k, damping=c
    )
    machine = friction_behind_lag(two_mass_plant(motor, load, k, c, encoder=encoder), lag)
    friction = tuple(MaxwellSlip(*pair) for pair in zip(K0, stiction, strict=True))
    return PortCase(
        machine=machine, axis=axis, settings=settings, friction=friction, Fs=(Fs[0], Fs[1])
    )


def prove_case(case: PortCase) -> robust.friction.FrictionProof:
    """The verdict on an axis."""
    K = cascade(case.settings, output_unit="N")
    return robust.prove_friction(
        case.machine, K, case.friction, delay=case.settings.delay, Fs=case.Fs
    )


def draw_law(rng: np.random.Generator, friction: MaxwellSlip, Fs: float) -> VaryingSliders:
    """A friction of the class at its limits."""
    n = int(rng.choice([1, 1, 2, 4]))
    scale = Fs / friction.K0
    return VaryingSliders(
        stiffness=rng.dirichlet(np.ones(n)) * friction.K0,
        strength=rng.dirichlet(np.ones(n)) * Fs,
        stiction=friction.stiction,
        vs=10 ** rng.uniform(-4.5, -1.5),
        dwell=10 ** rng.uniform(-3, 0) if rng.random() < 0.3 else 0.0,
        wavelength=scale * 10 ** rng.uniform(-0.5, 2) if rng.random() < 0.3 else np.inf,
        asymmetry=rng.uniform() if rng.random() < 0.3 else 0.0,
        seed=int(rng.integers(1, 1000)) if rng.random() < 0.2 else 0,
    )


def samples_of(case: PortCase) -> int:
    """Length of a run: so many of the slowest time constants, sliding, stuck at either and at
    both.
    """
    loop = friction_loop(case.machine, cascade(case.settings, output_unit="N"), case.settings.delay)
    K0 = np.array([one.K0 for one in case.friction])
    springs = [np.zeros(2), K0, K0 * [1, 0], K0 * [0, 1]]
    slowest = max(
        np.abs(p)[np.abs(p) < 1 - 1e-9].max() for p in (loop.poles(kappa) for kappa in springs)
    )
    return int(np.clip(TIME_CONSTANTS / -np.log(slowest), 2000, LONGEST))


def run_case(
    case: PortCase, laws: tuple[VaryingSliders, ...], push: float, *, longer: int = 1
) -> tuple[float, bool]:
    """[m] largest displacement of either mass in the last third of a run after a push [N], and
    whether it moves.

    One that moves is run again for four times as long: a slider that is held just below its limit
    may let go once more.
    """
    n, end = longer * samples_of(case), samples_of(case) // 10
    force = np.zeros(n)
    force[:end] = push * np.linspace(0, 1, end)
    axis = replace(case.axis, motor_friction=laws[0], load_friction=laws[1])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", nlfrf.DataWarning)
        trace = nlfrf.rig.run(axis, {"force": force}, oversampling=8)
    third, tenth = trace.x[:, -n // 3 :], trace.x[:, -n // 10 :]
    smallest = MOVING * min(Fs / one.K0 for Fs, one in zip(case.Fs, case.friction, strict=True))
    swings = np.ptp(tenth, axis=1) > np.maximum(0.5 * np.ptp(third, axis=1), smallest)
    moves = bool(swings.any() or trace.diverged)
    if moves and longer == 1:
        return run_case(case, laws, push, longer=4)
    return float(np.abs(third).max()), moves


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--axes", type=int, default=200)
    parser.add_argument("--runs", type=int, default=8, help="runs of each axis")
    args = parser.parse_args()
    verdicts: Counter[str] = Counter()
    moved: Counter[str] = Counter()
    runs: Counter[str] = Counter()
    unverified, outside, times, reached = 0, 0, [], []
    for number in range(args.axes):
        case, rng = draw_case(number), np.random.default_rng([number, 9])
        begin = time.process_time()
        proof = prove_case(case)
        times.append(time.process_time() - begin)
        verdict = str(proof.verdict)
        verdicts[f"{verdict}, encoder at the {case.axis.encoder}"] += 1
        if verdict == "proved":
            assert proof.certificate is not None
            unverified += not proof.certificate.verify().verified
        for _ in range(args.runs):
            if verdict == "refuted":
                assert proof.counterexample is not None
                springs = np.maximum(np.atleast_1d(proof.counterexample[0]), 1e-6)
                laws = tuple(
                    VaryingSliders(stiffness=[k], strength=[Fs])
                    for k, Fs in zip(springs, case.Fs, strict=True)
                )
            else:
                laws = tuple(
                    draw_law(rng, one, Fs) for one, Fs in zip(case.friction, case.Fs, strict=True)
                )
            push = rng.choice([-1, 1]) * sum(case.Fs) * 10 ** rng.uniform(-0.3, 0.7)
            far, moves = run_case(case, laws, push)
            runs[verdict] += 1
            moved[verdict] += moves
            if moves and verdict == "proved":
                print(f"  {number} proved and MOVES", flush=True)
            if verdict in ("proved", "settles") and np.isfinite(proof.error_bound):
                bound = proof.settling_error if verdict == "settles" else proof.error_bound
                outside += far > bound
                reached.append(far / bound)
            if verdict == "refuted":
                break
    for verdict, count in sorted(verdicts.items()):
        print(f"{count:4d} {verdict}")
    for verdict in sorted(runs):
        print(f"{verdict}: {moved[verdict]} of {runs[verdict]} runs still move at the end")
    print(
        f"{unverified} proofs not verified over the rationals; {outside} of {len(reached)} runs"
        f" outside their bound, of which they reach {max(reached, default=np.nan):.2g} at most; CPU"
        f" of a proof: median {np.median(times):.2g} s"
    )


if __name__ == "__main__":
    main()
