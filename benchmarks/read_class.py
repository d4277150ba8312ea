"""Whether what `machine_with_friction` reads from levels can make a false proof: random machines,
levels and loops.

Machines: a mass, free or on a spring, with Maxwell slip of many elements, LuGre, Leuven, Dahl or
generalised Maxwell slip; some with a load on a spring behind it, some with a delay in the
measurement, some with noise. Level sets: good ones, which stick, bend and slide, and bad ones,
drawn at random. Loops: PD and PID at 1 kHz, with and without delay.

The truth: the true linear part, delay included, and every spring up to the true presliding
stiffness. A loop that the truth refutes and that is proved for the class that was read is false.
Its cause is found by putting the true value of one part of the reading after another in its place.

Each machine is read three times: as one mass, around a nominal that is fitted at the lowest level,
and around one that is fitted at the highest. "any route": a loop that is proved on one of them.

python -m benchmarks.read_class [--machines 200] [--loops 12] [--seed 0]
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections import Counter
from dataclasses import dataclass, field, replace
from typing import Any

import control
import numpy as np

import nlfrf
import robust
from nlfrf import hysteresis
from nlfrf.friction import Dahl, GeneralizedMaxwellSlip, Leuven, LuGre, VaryingSliders
from robust.friction.loop import destabilizing_stiffness, friction_loop

F_MAX = 200.0  # of the multisines [Hz]
T = 1e-3  # sampling time of the loops [s]
ROUTES = ("one mass", "nominal, lowest level", "nominal, highest level")
FAMILIES = ("Maxwell", "LuGre", "Leuven", "Dahl", "GMS")
#: Rms of the force over the break-away force: sets that stick, bend and slide.
GOOD = ((0.02, 0.06), (0.08, 0.2), (0.4, 0.8), (4.0, 7.0))


@dataclass(frozen=True)
class Case:
    """A machine with friction and its levels."""

    family: str
    rig: Any
    mass: float
    stiffness: float
    K0: float
    truth: Any  # FrictionPlant
    delay: float
    noise: float  # relative to the rms of the output
    levels: tuple[float, ...]
    good: bool
    flexible: bool


@dataclass
class Tally:
    """Counts over loops and machines of one route."""

    machines: int = 0
    refused: Counter[str] = field(default_factory=Counter)
    refuted: int = 0  # loops that the truth refutes, of machines that were read
    causes: Counter[str] = field(default_factory=Counter)  # of false proofs
    provable: int = 0  # loops that are provable for the true machine and class, of all machines
    provable_read: int = 0  # of machines that were read
    proved: int = 0


def draw_friction(family: str, K0: float, Fs: float, rng: np.random.Generator) -> tuple[Any, float]:
    """A law of presliding stiffness K0 and break-away force about Fs, and its viscous damping."""
    stiction = rng.uniform(1.0, 1.5)
    vs = 10 ** rng.uniform(-3, -1.5)
    if family == "Maxwell":
        n = int(rng.integers(1, 9))
        reach = 10 ** rng.uniform(-0.5, 0.5, n)  # break-away displacements, within a decade
        stiffness = K0 * rng.dirichlet(2 * np.ones(n))
        strength = stiffness * reach
        strength *= Fs / strength.sum()
        return VaryingSliders(stiffness=stiffness, strength=strength, stiction=stiction, vs=vs), 0.0
    if family == "Dahl":
        return Dahl(sigma0=K0, Fc=Fs), 0.0
    damping = 2 * rng.uniform(0.005, 0.05) * np.sqrt(K0)
    if family == "LuGre":
        return LuGre(sigma0=K0, sigma1=damping, sigma2=0.0, Fc=Fs / stiction, Fs=Fs, vs=vs), 0.0
    if family == "GMS":
        n = int(rng.integers(2, 7))
        law = GeneralizedMaxwellSlip(
            stiffness=K0 * rng.dirichlet(2 * np.ones(n)),
            alpha=rng.dirichlet(2 * np.ones(n)),
            C=Fs * 10 ** rng.uniform(1.5, 2.5),
            Fs=Fs,
            Fc=Fs / stiction,
            vs=vs,
        )
        return law, 0.0
    shapes = hysteresis.Tanh, hysteresis.Exponential, hysteresis.Parabola
    curve = shapes[rng.integers(3)](K0=K0, Fy=Fs * rng.uniform(1.0, 1.5))
    return (
        Leuven(Fs=Fs, Fc=Fs / stiction, vs=vs, sigma1=damping, sigma2=0.0, n=1.0, curve=curve),
        0.0,
    )


def draw_case(number: int, seed: int = 0) -> Case:
    """Machine and levels of a number."""
    rng = np.random.default_rng([seed, number])
    family = FAMILIES[number % len(FAMILIES)]
    mass = 10 ** rng.uniform(-0.3, 0.5)
    stuck = mass * (2 * np.pi * rng.uniform(40, 80)) ** 2  # whole stiffness while it sticks
    share = 1.0 if rng.random() < 0.2 else rng.uniform(0.2, 0.8)
    K0, stiffness = share * stuck, (1 - share) * stuck
    Fs, damping = 10 ** rng.uniform(-0.5, 0.5), 2 * rng.uniform(0.002, 0.02) * np.sqrt(stuck * mass)
    friction, _ = draw_friction(family, K0, Fs, rng)
    flexible, late, noisy, good = rng.random(4) < (0.25, 0.25, 0.5, 0.5)
    if flexible:
        load, coupling = mass * rng.uniform(0.1, 0.6), stuck * rng.uniform(2, 10)
        light = 2 * 0.01 * np.sqrt(coupling * load)
        M = np.diag([mass, load])
        K = np.array([[stiffness + coupling, -coupling], [-coupling, coupling]])
        C = np.array([[damping + light, -light], [-light, light]])
        rig = nlfrf.rig.Rig(
            M, K, [friction, None], C, actuators=[[1.0], [0.0]], sensors=[[1.0, 0.0]]
        )
        A = np.block(
            [[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]]
        )
        truth = robust.friction_plant(
            control.StateSpace(A, [[0], [0], [1 / mass], [0]], [[1, 0, 0, 0]], 0)
        )
    else:
        rig = nlfrf.rig.Rig(mass, stiffness, friction, damping)
        truth = robust.friction_plant(mass, stiffness, damping)
    if good:
        levels = tuple(Fs * 10 ** rng.uniform(*np.log10(pair)) for pair in GOOD)
    else:
        levels = tuple(sorted(Fs * 10 ** rng.uniform(-1.7, 0.8, int(rng.integers(3, 5)))))
    return Case(
        family=family,
        rig=rig,
        mass=mass,
        stiffness=stiffness,
        K0=K0,
        truth=truth,
        delay=10 ** rng.uniform(-4, -2.7) if late else 0.0,
        noise=10 ** rng.uniform(-3, -1.3) if noisy else 0.0,
        levels=levels,
        good=bool(good),
        flexible=bool(flexible),
    )


def measure(case: Case, number: int) -> list[nlfrf.Bla]:
    """The BLAs of its levels, from one record of two periods each."""
    blas = []
    for i, rms in enumerate(case.levels):
        rng = np.random.default_rng([number, i])
        ms = nlfrf.multisine(
            "special-odd", fs=2048, n_samples=8192, f_min=1.0, f_max=F_MAX, rms=rms, rng=rng
        )
        record = nlfrf.simulate(case.rig, ms, n_periods=2, n_discard=3, oversampling=finely(case))
        if case.noise:
            y = record.y + case.noise * record.y.std() * rng.standard_normal(record.y.shape)
            record = replace(record, y=y)
        bla = nlfrf.identify(record)
        blas.append(bla.times(np.exp(-1j * bla.omega * case.delay)) if case.delay else bla)
    return blas


def finely(case: Case) -> int:
    """Integration steps a sample: generalised Maxwell slip is stiff while an element slips."""
    return 32 if case.family == "GMS" else 8


def draw_loops(
    case: Case, n: int, rng: np.random.Generator
) -> list[tuple[control.StateSpace, float]]:
    """(K, delay) of PD and PID, from timid to too bold for this machine; some soften it."""
    stuck = case.stiffness + case.K0
    found = []
    for _ in range(n):
        Kp = rng.choice([-1, 1], p=[0.35, 0.65]) * stuck * 10 ** rng.uniform(-1.3, 0.2)
        Kd = 2 * np.sqrt(stuck * case.mass) * 10 ** rng.uniform(-1.5, 0)
        Ki = stuck * 10 ** rng.uniform(-0.3, 1.8) if rng.random() < 0.6 else 0.0
        K = control.StateSpace(
            [[1, 0], [0, 0]], [[1], [1]], [[Ki * T, -Kd / T]], [[Kp + Kd / T]], T
        )
        if not Ki:
            K = control.StateSpace([[0.0]], [[1.0]], [[-Kd / T]], [[Kp + Kd / T]], T)
        found.append((K, float(rng.choice([0.0, T / 2, T]))))
    return found


def read(case: Case, blas: list[nlfrf.Bla], route: str) -> Any:
    """The class that is read, or the refusal as a sentence."""
    try:
        if route == "one mass":
            return robust.friction.machine_with_friction(blas)
        level = 0 if route == "nominal, lowest level" else -1
        orders = {"n_poles": 4, "n_zeros": 2} if case.flexible else {"n_poles": 2, "n_zeros": 0}
        nominal = robust.fit_nominal(blas[level], delay="estimate" if case.delay else 0.0, **orders)
        return robust.friction.machine_with_friction(blas, nominal=nominal)
    except ValueError as error:
        return str(error)


def prove_read(found: Any, K: Any, delay: float) -> bool:
    """Whether a loop is proved for every machine of the class."""
    return all(
        robust.prove_friction(machine, K, found.friction, delay=delay).verdict == "proved"
        for machine in found.machines
    )


def is_refuted(machine: Any, K: Any, delay: float, K0: float) -> bool:
    """Whether a spring up to K0 makes the loop unstable."""
    return destabilizing_stiffness(friction_loop(machine, K, delay), K0) is not None


def port_stiffness(machine: Any) -> float:
    """Stiffness of a machine at its friction port [N/m]; nearly zero of a free one."""
    moved = np.linalg.lstsq(machine.A, -machine.B_port, rcond=None)[0]
    at_rest = np.abs(machine.A @ moved + machine.B_port).max() < 1e-6 * np.abs(machine.B_port).max()
    return float(1 / (machine.C_port @ moved)) if at_rest else 0.0


def trace(case: Case, found: Any, K: Any, delay: float) -> str:
    """Which part of the reading makes a false proof: the first that the truth in its place takes
    away.
    """
    machine, K0 = found.machines[0], found.friction[0].K0
    k = port_stiffness(machine)
    if is_refuted(
        replace(machine, delay=case.delay) if hasattr(machine, "delay") else machine, K, delay, K0
    ):
        return "the delay"
    if case.stiffness < k:
        missing = k - case.stiffness
        softer = replace(machine, A=machine.A + missing * np.outer(machine.B_port, machine.C_port))
        if is_refuted(softer, K, delay, K0 + missing):
            return (
                f"the highest level: {missing / case.K0:.2f} of the friction read as a spring of"
                " the machine"
            )
    missing = case.stiffness + case.K0 - k - K0
    if missing > 0 and is_refuted(machine, K, delay, K0 + missing):
        return f"the lowest level: K0 read {missing / case.K0:.2f} of the truth too small"
    if not case.flexible:
        return "mass and damping"
    mode = float(np.abs(np.linalg.eigvals(case.truth.A).imag).max() / (2 * np.pi))
    return (
        f"a mode {'above' if mode > F_MAX else 'in'} the measured band: {mode:.0f} Hz, band to"
        f" {F_MAX:g} Hz"
    )


def tally_case(
    case: Case, number: int, n_loops: int, tallies: dict[tuple[bool, str], Tally]
) -> list[str]:
    """Read, prove and compare one machine on every route; what is refused or false, in words."""
    warnings.simplefilter("ignore")
    blas = measure(case, number)
    loops = draw_loops(case, n_loops, np.random.default_rng([number, 99]))
    truth = robust.friction.MaxwellSlip(case.K0)
    verdicts = [
        robust.prove_friction(case.truth, K, truth, delay=delay + case.delay).verdict
        for K, delay in loops
    ]
    lines, any_proved = [], np.zeros(len(loops), bool)
    for route in ROUTES:
        tally, found = tallies[case.good, route], read(case, blas, route)
        tally.machines += 1
        tally.provable += verdicts.count("proved")
        if isinstance(found, str):
            tally.refused[cause_of(found)] += 1
            lines.append(f"{number} {case.family}, {route}, refused: {found}")
            continue
        tally.refuted += verdicts.count("refuted")
        tally.provable_read += verdicts.count("proved")
        for i, ((K, delay), verdict) in enumerate(zip(loops, verdicts, strict=True)):
            if verdict == "not decided" or not prove_read(found, K, delay):
                continue
            any_proved[i] = True
            tally.proved += verdict == "proved"
            if verdict == "refuted":
                cause = trace(case, found, K, delay)
                tally.causes[cause.split(":")[0]] += 1
                lines.append(
                    f"{number} {case.family}, {route}, FALSE by {cause}; {described(case)}; {found}"
                )
    total = tallies[case.good, "any route"]
    total.machines += 1
    total.provable += verdicts.count("proved")
    total.proved += sum(
        p for p, verdict in zip(any_proved, verdicts, strict=True) if verdict == "proved"
    )
    return lines


def described(case: Case) -> str:
    """The numbers of a machine."""
    levels = ", ".join(f"{rms:.3g}" for rms in case.levels)
    return (
        f"{case.mass:.4g} kg, {case.stiffness / 1e3:.4g} kN/m, K0 {case.K0 / 1e3:.4g} kN/m, delay "
        f"{1e3 * case.delay:.3g} ms, noise {case.noise:.2g}, levels {levels} N"
    )


def cause_of(refusal: str) -> str:
    """What a refusal is about, in two words or three."""
    causes = {
        "delay than": "a delay",
        "misses this model": "misfit",
        "at which the friction sticks: it is": "lowest level slips",
        "differ enough": "low levels alike",
        "span from": "no span",
        "level at which the friction slides": "highest level sticks",
        "Reverse the sign": "reversed sign",
        "above the band": "a mode above the band",
    }
    return next((words for part, words in causes.items() if part in refusal), refusal)


def print_table(tallies: dict[tuple[bool, str], Tally]) -> None:
    """Counts of each set of levels and each route, and what was refused."""
    print(
        "| levels | route | machines read | truly refuted | proved falsely | truly provable |"
        " proved | of those read |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for (good, route), t in tallies.items():
        share = f"{100 * t.proved / t.provable_read:.0f} %" if t.provable_read else "-"
        n_read = t.machines - sum(t.refused.values())
        levels = "stick, bend, slide" if good else "random"
        proved = f"{t.proved / max(1, t.provable):.0%}"
        print(
            f"| {levels} | {route} | {n_read} of {t.machines} | {t.refuted} |"
            f" {sum(t.causes.values())} | {t.provable} | {t.proved} ({proved}) | {share} |"
        )
    for (good, route), t in tallies.items():
        refused = ", ".join(f"{count} {reason}" for reason, count in t.refused.most_common())
        false = f"; false by {dict(t.causes)}" if t.causes else ""
        print(f"{'good' if good else 'random'}, {route}: refused {refused or 'none'}{false}")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--machines", type=int, default=200)
    parser.add_argument("--loops", type=int, default=12)
    parser.add_argument("--first", type=int, default=0, help="number of the first machine")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--quiet", action="store_true", help="the table only")
    args = parser.parse_args()
    begin = time.monotonic()
    tallies = {(good, route): Tally() for good in (True, False) for route in (*ROUTES, "any route")}
    for number in range(args.first, args.first + args.machines):
        for line in tally_case(draw_case(number, args.seed), number, args.loops, tallies):
            if not args.quiet:
                print(line, flush=True)
    print(f"{args.machines} machines, {args.loops} loops each, {time.monotonic() - begin:.0f} s")
    print_table(tallies)


if __name__ == "__main__":
    main()
