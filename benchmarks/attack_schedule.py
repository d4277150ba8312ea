"""Whether a scheduled loop stays stable below the rate that was proved: periodic and random
trajectories of many loops.

Loops are closed here sample by sample, apart from `prove_schedule`: the plant by exponentials of
short steps while the operating point moves, the perturbation as a number or an all-pass. "Grew":
trajectories below a proved rate whose period has a spectral radius above one; must be 0. "Refuted":
trajectories of a refutation that do not grow here.

With --cases a file of machines (matrices as polynomials) is proved at stated rates, and timed.

python -m benchmarks.attack_schedule [--loops 40] [--trajectories 60] [--first 0] [--cases
machines.json]
"""

from __future__ import annotations

import argparse
import json
import time
import warnings
from itertools import pairwise

import control
import numpy as np
from scipy.linalg import expm

from robust import prove_schedule
from robust.models import LpvModel
from robust.scheduling import ScheduleProof

_SUBSTEPS = 4  # of a sample, or of a step of a continuous trajectory
_STEPS = 160  # of a continuous trajectory


def random_loop(rng: np.random.Generator) -> dict:
    """A mass on a spring, or two masses, that go with the position; a PID-like controller that
    follows or does not.
    """
    stiffness = 10 ** rng.uniform(1, 3)
    spread, damping = rng.uniform(0.1, 0.5), 10 ** rng.uniform(-3, -1)
    two = rng.random() < 0.5
    points = np.array([-1.0, 0.0, 1.0])

    def plant(p: float) -> control.StateSpace:
        k, force = stiffness * (1 + spread * p), 1 - 0.2 * p
        c = 2 * damping * np.sqrt(stiffness)
        if not two:
            return control.ss([[0, 1], [-k, -c]], [[0], [force]], [[1, 0]], 0)
        A = [
            [0, 0, 1, 0],
            [0, 0, 0, 1],
            [-2 * k, 2 * k, -2 * c, c],
            [2 * k, -2 * k - stiffness / 5, c, -2 * c],
        ]
        return control.ss(A, [[0], [0], [force], [0]], [[1, 0, 0, 0]], 0)

    turn = np.sqrt(stiffness)
    dt = 0.0 if rng.random() < 0.4 else 2 * np.pi / turn / rng.uniform(15, 60)
    gain = stiffness * 10 ** rng.uniform(-1.3, -0.2)
    lead = rng.uniform(0.0, 1.5) / turn
    follows = rng.random() < 0.7

    def law(p: float) -> control.StateSpace:
        g = gain * (1 + spread * p if follows else 1)
        fast = 8 * turn
        if not dt:
            return control.ss(
                [[-fast]], [[1.0]], [[-g * lead * fast**2]], [[g * (1 + lead * fast)]]
            )
        a = np.exp(-fast * dt)
        return control.ss([[a]], [[1 - a]], [[-g * lead * fast]], [[g * (1 + lead * fast)]], dt)

    weight = None if rng.random() < 0.4 else control.ss([], [], [], rng.uniform(0.02, 0.3), dt)
    known = {"at": points, "over": "position", "unit": "m"}
    return {
        "plant": LpvModel.from_points([plant(p) for p in points], weight=weight, **known),
        "K": LpvModel.from_points([law(p) for p in points], **known),
        "rate": turn * 10 ** rng.uniform(-2, 0),
        "delay": dt * int(rng.integers(0, 2)),
    }


def random_trajectory(
    rng: np.random.Generator, proof: ScheduleProof, rate: float
) -> tuple[np.ndarray, float]:
    """Vertices of a period at a rate, and the time between them."""
    low, high = proof.plant.points[[0, -1]]
    poles = np.abs(np.linalg.eigvals(proof.plant.at((low + high) / 2).A))
    period = np.pi / poles.max() * 10 ** rng.uniform(-0.3, 0.9)
    count = max(2, min(2000, round(period / proof.K.dt))) if proof.K.dt else _STEPS
    if proof.K.dt and count < 100:  # several periods
        cycles = round(100 / count)
        count = round(cycles * period / proof.K.dt)
    else:
        cycles = 1
    step = proof.K.dt or period / count
    phase = np.arange(count) * cycles / count
    kind = rng.integers(3)
    wave = np.sin(2 * np.pi * phase) if kind == 0 else 4 * np.abs((phase + 0.25) % 1 - 0.5) - 1
    if kind == 2:  # a walk that closes, at the limit of the rate
        half = np.cumsum(rng.choice([-1.0, 1.0], (count + 1) // 2))
        wave = np.concatenate([half, half[::-1]])[:count]
    moves = np.abs(np.diff(wave, append=wave[:1])).max() / step
    wave = (wave - (wave.max() + wave.min()) / 2) * rate / moves
    size = np.abs(wave).max()
    wave = wave * min(1, (high - low) / 2 / size)
    room = max((high - low) / 2 - np.abs(wave).max(), 0.0)
    return np.clip((low + high) / 2 + room * rng.uniform(-1, 1) + wave, low, high), step


def radius(proof: ScheduleProof, points: np.ndarray, step: float, delta: float | str) -> float:
    """Spectral radius over a period, with the perturbation a number or "all-pass" at the input."""
    plant, K, weight = proof.plant, proof.K, proof.plant.weight
    ends = np.append(points, points[0])
    made = None
    for a, b in pairwise(ends):
        steps = (a + (b - a) * (np.arange(_SUBSTEPS) + 0.5) / _SUBSTEPS).clip(
            *plant.points[[0, -1]]
        )
        law = K.at(a)
        n, q = plant.order, law.nstates
        C, W = plant.at(a).C, 0.0 if weight is None else float(weight.D[0, 0])
        if not K.dt:
            flow = np.eye(n + q)
            for p in steps:
                here, now = plant.at(p), K.at(p)
                B = here.B * (1 + W * float(delta))
                A = np.block([[here.A - B @ now.D @ here.C, -B @ now.C], [now.B @ here.C, now.A]])
                flow = expm(A * step / _SUBSTEPS) @ flow
        else:
            both = np.eye(n + 1)
            for p in steps:
                here = plant.at(p)
                both = (
                    expm(np.block([[here.A, here.B], [np.zeros((1, n + 1))]]) * step / _SUBSTEPS)
                    @ both
                )
            late = round(proof.delay / K.dt)
            flow = sampled_loop(both[:n, :n], both[:n, n:], C, law, late, W, delta)
        made = flow if made is None else flow @ made
    return float(np.abs(np.linalg.eigvals(made)).max())


def sampled_loop(
    Phi: np.ndarray,
    Gamma: np.ndarray,
    C: np.ndarray,
    law: control.StateSpace,
    late: int,
    W: float,
    delta: float | str,
) -> np.ndarray:
    """One sample of x, controller, delay and all-pass."""
    n, q = Phi.shape[0], law.nstates
    size = n + q + late + 1
    x, s, h, f = np.split(np.eye(size), np.cumsum([n, q, late]))
    u = -(law.C @ s + law.D @ C @ x)
    v = h[:1] if late else u
    if delta == "all-pass":  # (1 - c z)/(z - c) with c = 0.5
        out, filtered = f * (1 - 0.25) - 0.5 * v, 0.5 * f + v
    else:
        out, filtered = float(delta) * v, 0 * f
    rows = [Phi @ x + Gamma @ (v + W * out), law.A @ s + law.B @ C @ x]
    rows += [h[1:], u] if late else []
    return np.vstack([*rows, filtered])


def attack(loops: int, trajectories: int, first: int) -> None:
    """Attack random loops."""
    grew = tried = proved = refuted = wrong = 0
    gaps = []
    for seed in range(first, first + loops):
        rng = np.random.default_rng(seed)
        proof = prove_schedule(**random_loop(rng))
        broken = proof.broken
        if broken is not None and np.isfinite(broken.rate):
            refuted += 1
            if not radius(proof, broken.points, broken.step, broken.delta) > 1 - 1e-9:
                wrong += 1
                print(f"seed {seed}: refuted, but it does not grow here")
        if not proof.provable:
            continue
        proved += 1
        if broken is not None and np.isfinite(proof.provable):
            gaps.append(broken.rate / proof.provable)
        top = min(proof.provable, 100 * proof.rate)
        deltas = [0.0] if proof.plant.weight is None else [1.0, -1.0, 0.0]
        deltas += ["all-pass"] if proof.plant.weight is not None and proof.K.dt else []
        for _ in range(trajectories):
            points, step = random_trajectory(rng, proof, top)
            delta = deltas[rng.integers(len(deltas))]
            tried += 1
            if (size := radius(proof, points, step, delta)) > 1 + 1e-9:
                grew += 1
                print(
                    f"seed {seed}: radius {size:.6f} below a proved rate of {top:g}, Delta {delta}"
                )
    print(
        f"loops {loops}, proved {proved}, broken by a trajectory {refuted}, of these wrong {wrong}"
    )
    print(f"trajectories below the proved rate {tried}, grew {grew}")
    if gaps:
        print(
            f"slowest trajectory that grows over the proved rate: median {np.median(gaps):.2f},"
            f" least {min(gaps):.2f}"
        )


def case(name: str, machine: dict, *, weighted: bool) -> tuple[LpvModel, LpvModel | float, float]:
    """Plant, controller and delay of a machine of a file, theta being the operating point."""

    def model(parts: dict, dt: float, **options: object) -> LpvModel:
        arrays = {each: np.array(parts[each], dtype=float) for each in parts}
        n, (p, m) = arrays["A"].shape[1], (1, 1)
        arrays.setdefault("D", np.zeros((1, p, m)))
        shapes = {"A": (n, n), "B": (n, m), "C": (p, n), "D": (p, m)}
        longest = max(map(len, arrays.values()))
        full = {each: np.zeros((longest, *shape)) for each, shape in shapes.items()}
        for each, array in arrays.items():
            full[each][: len(array)] = array.reshape(len(array), *shapes[each])
        return LpvModel(**full, points=np.array([-1.0, 1.0]), dt=dt, over="theta", **options)

    if "plant" not in machine:
        A = np.array(machine["A"])
        return (
            model(
                {"A": A, "B": np.zeros((1, A.shape[1], 1)), "C": np.zeros((1, 1, A.shape[1]))}, 0.0
            ),
            0.0,
            0.0,
        )
    dt = machine["dt"]
    W = control.ss(*(np.array(machine["weight"][each]).reshape(1, 1) for each in "ABCD"), dt)
    plant = model(machine["plant"], 0.0, weight=W if weighted else None)
    return plant, model(machine["controller"], dt), dt * machine["delay_samples"]


def prove_cases(path: str) -> None:
    """Prove the machines of a file at stated rates."""
    with open(path, encoding="utf-8") as file:
        machines = json.load(file)
    for name, weighted, rate, degree in (
        *(
            ("oscillator", False, rate, d)
            for d, rate in ((1, 0.72), (2, 0.88), (3, 0.93), (3, 1.0), (4, 0.96))
        ),
        *(("gantry", False, rate, d) for d, rate in ((1, 4.0), (1, 18.0), (2, 19.5))),
        *(("gantry", True, rate, d) for d, rate in ((1, 4.0), (1, 8.5), (2, 12.0))),
    ):
        plant, K, delay = case(name, machines[name], weighted=weighted)
        began = time.perf_counter()
        proof = prove_schedule(plant, K, rate=rate, delay=delay, degree=degree, limit=False)
        took = time.perf_counter() - began
        broken = "" if proof.broken is None else f", grows at {proof.broken.rate:.4g}"
        what = f"{name}{', every Delta' if weighted else ''}"
        print(
            f"{what:22} degree {degree}  rate {rate:5g}/s  {proof.outcome!s:10} {took:5.1f}"
            f" s{broken}",
            flush=True,
        )
    for weighted in (False, True):
        plant, K, delay = case("gantry", machines["gantry"], weighted=weighted)
        began = time.perf_counter()
        print(
            prove_schedule(plant, K, rate=4.0, delay=delay),
            f"\n  {time.perf_counter() - began:.1f} s",
            flush=True,
        )


def main() -> None:
    """Run the attack, and the machines of a file."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--loops", type=int, default=40)
    parser.add_argument("--trajectories", type=int, default=60)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--cases")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    if given.cases:
        prove_cases(given.cases)
    attack(given.loops, given.trajectories, given.first)


if __name__ == "__main__":
    main()
