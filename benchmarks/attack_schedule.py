"""Whether a scheduled loop stays stable below the rate that was proved: periodic and random
trajectories of many loops.

Loops are closed here sample by sample, apart from `prove_schedule`: the plant by exponentials of
short steps while the operating point moves, the perturbation as a number or an all-pass. "Grew":
trajectories below a proved rate whose period has a spectral radius above one; must be 0. "Refuted":
trajectories of a refutation that do not grow here.

With --designs random structures with scheduled numbers are tuned for random plants. "Wrong": the
schedule differs from its blocks by more than 1e-3, or a limit at a point, computed here from the
schedule, is more than 1e-3 above the stated one; "code": the compiled step differs from the rounded
schedule while the position moves. All must be 0. The rounded controllers are proved and attacked as
above.

With --cases a file of machines (matrices as polynomials) is proved at stated rates, and timed.

python -m benchmarks.attack_schedule [--loops 40] [--designs 20] [--trajectories 60] [--first 0]
[--cases machines.json]
"""

from __future__ import annotations

import argparse
import ctypes
import json
import subprocess
import tempfile
import time
import warnings
from itertools import pairwise
from pathlib import Path

import control
import numpy as np
from scipy.linalg import expm

from robust import prove_schedule, tune
from robust.io import export_c
from robust.models import LpvModel
from robust.scheduling import ScheduleProof
from robust.tuning import Limit, Notch, Pid, Plants, TunedDesign
from tests.support.responses import at_points

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


JOINED = [control.summing_junction(["r", "-y"], "e"), control.summing_junction(["v", "d"], "u")]


def random_design(rng: np.random.Generator) -> tuple[TunedDesign, dict]:
    """A tuned structure with scheduled numbers for a random plant, and the loop of its plant."""
    loop = random_loop(rng)
    plant, dt = loop["plant"], loop["K"].dt
    turn = float(np.abs(plant.at(0.0).poles()).max())
    gain = turn**2 * 10 ** rng.uniform(-2, -0.7)
    degrees = {name: int(rng.integers(0, 3)) for name in ("kp", "ki", "kd", "omega")}
    scheduled = {name: degree for name, degree in degrees.items() if degree}
    parts = {"ki": gain * turn / 10} if rng.random() < 0.5 else {}
    parts |= {"kd": gain / turn, "filter_time": 0.3 / turn} if rng.random() < 0.5 else {}
    parts = {"kp": gain} | parts
    notch = rng.random() < 0.5
    blocks = {
        "K": Pid(
            **parts,
            scheduled={name: d for name, d in scheduled.items() if name in parts},
            reads="e",
            drives="a" if notch else "v",
        )
    }
    if notch:
        moves = {name: d for name, d in scheduled.items() if name == "omega"}
        blocks["notch"] = Notch(omega=turn, scheduled=moves, reads="a", drives="v")
    design = tune(
        JOINED,
        Plants(plant, inputs="u", outputs="y"),
        blocks,
        hard=[Limit("d", "u", 2.0)],
        soft=[Limit("d", "y", 1 / gain)],
        dt=dt,
        delay=loop["delay"],
        n_starts=1,
        time_cap=20.0,
    )
    # slowly: to break a fast schedule of a high degree takes minutes
    return design, loop | {"rate": 0.01 * turn}


def largest_errors(design: TunedDesign, K: LpvModel, loop: dict) -> tuple[float, float]:
    """Largest error of the response of a schedule at random points, relative; largest excess of a
    limit over the stated one, with the loop closed here.
    """
    dt, delay, off, excess = K.dt, loop["delay"], 0.0, -np.inf
    turn = float(np.abs(loop["plant"].at(0.0).poles()).max())
    omega = turn * np.geomspace(1e-2, 30, 3000)
    points = np.exp(1j * np.minimum(omega * dt, np.pi)) if dt else 1j * omega
    for p in (*np.random.default_rng(0).uniform(-1, 1, 20), *design.plant.at):
        blocks = [block.at(float(p)).system(dt) for block in design.blocks.values()]
        wanted = np.prod([at_points(block, points)[0, 0] for block in blocks], axis=0)
        off = max(off, float(np.abs(at_points(K.at(p), points)[0, 0] / wanted - 1).max()))
    for one in design.limits:
        plant = loop["plant"].at(design.plant.at[one.plant])
        G = at_points(control.sample_system(plant, dt, "zoh") if dt else plant, points)[0, 0]
        G = G * (points ** -round(delay / dt) if dt else 1)
        d_to_u = 1 / (1 + G * at_points(K.at(design.plant.at[one.plant]), points)[0, 0])
        gain = np.abs(d_to_u * (G if one.limit.outputs == ("y",) else 1))
        excess = max(excess, float((gain * one.limit.factor(omega)).max() / one.ratio - 1))
    return off, excess


def code_error(K: LpvModel, folder: Path) -> float:
    """Largest difference of the compiled step in float64 from the schedule it stands for, relative,
    while the position moves and leaves its range.
    """
    rounded = export_c(K, folder / "k.h", dtype="float64").K
    (folder / "k.c").write_text(
        '#include "k.h"\nvoid run(int n, const double *p, const double *e, double *u)\n'
        "{ k_state k; k_init(&k); for (int i = 0; i < n; i++) u[i] = k_step(&k, p[i], e[i]); }\n"
    )
    flags = ["-std=c99", "-O2", "-ffp-contract=off", "-shared", "-fPIC"]
    subprocess.run(["cc", *flags, str(folder / "k.c"), "-o", str(folder / "k.so")], check=True)
    rng = np.random.default_rng(1)
    e, p = rng.standard_normal(2000), 1.2 * np.sin(np.linspace(0, 60, 2000))
    u, x, wanted = np.empty(2000), np.zeros(K.order), np.empty(2000)
    ctypes.CDLL(str(folder / "k.so")).run(
        e.size, *(array.ctypes.data_as(ctypes.c_void_p) for array in (p, e, u))
    )
    for i in range(e.size):
        law = rounded.at(float(np.clip(p[i], -1, 1)))
        wanted[i] = (law.C @ x + law.D[:, 0] * e[i])[0]
        x = law.A @ x + law.B[:, 0] * e[i]
    return float(np.abs(u - wanted).max() / np.abs(wanted).max())


def attack_designs(designs: int, trajectories: int, first: int) -> None:
    """Attack tuned schedules and their code."""
    wrong = code = written = proved = grew = tried = unstable = 0
    worst = np.full(3, -np.inf)
    for seed in range(first, first + designs):
        rng = np.random.default_rng(10_000 + seed)
        design, loop = random_design(rng)
        if not design.stable:
            unstable += 1
            continue
        K = design.schedule("y", "v")
        errors = largest_errors(design, K, loop)
        wrong += max(errors) > 1e-3
        if K.dt:
            with tempfile.TemporaryDirectory() as folder:
                error = code_error(K, Path(folder))
            written, code = written + 1, code + (error > 1e-9)
            with tempfile.TemporaryDirectory() as folder:
                K = export_c(K, Path(folder) / "k.h").K
            worst[2] = max(worst[2], error)
        worst[:2] = np.maximum(worst[:2], errors)
        proof = prove_schedule(
            loop["plant"], K, rate=loop["rate"], delay=loop["delay"], limit=False
        )
        proved += proof.holds
        for _ in range(trajectories if proof.holds else 0):
            points, step = random_trajectory(rng, proof, proof.rate)
            delta = 0.0 if loop["plant"].weight is None else float(rng.integers(-1, 2))
            tried += 1
            grew += radius(proof, points, step, delta) > 1 + 1e-9
        print(
            f"design {seed}: errors {errors[0]:.1e} {errors[1]:.1e}, degree {len(K.A) - 1}, {proof.outcome}",
            flush=True,
        )
    print(
        f"designs {designs}, not stabilised {unstable}, wrong {wrong}, written as C {written}, of these"
        f" code wrong {code}, proved {proved}"
    )
    print(f"trajectories below the rate of the proof {tried}, grew {grew}")
    print(
        f"largest error of a schedule {worst[0]:.1e}, of a limit {worst[1]:.1e}, of code {worst[2]:.1e}"
    )


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
    parser.add_argument("--designs", type=int, default=0)
    parser.add_argument("--trajectories", type=int, default=60)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--cases")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    if given.cases:
        prove_cases(given.cases)
    attack(given.loops, given.trajectories, given.first)
    attack_designs(given.designs, given.trajectories, given.first)


if __name__ == "__main__":
    main()
