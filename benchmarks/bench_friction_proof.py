"""Whether what `robust.prove_friction` proves is so: hundreds of loops, thousands of bursts chosen
to hurt.

For the 240 controllers of example 14 and 220 random ones (PD, PID, lead with integrator, loop
shaping, delays): proved, refuted, not decided; every proved loop with laws of the class (sliders
that vary with speed, rest, position, direction, at random) after bursts and kicks; every loop that
only a spring that does not slip refutes, with that spring; and laws outside the class, to show what
is not claimed. Then the same of bristles that creep, with LuGre, Dahl, the friction of the paper
and random Leuven laws.

With --certificates: what three levels are enough for, every certificate made again over the
rationals, and the time.

"Still moving": swing in the last tenth above 1e-3 of the largest after 20 slowest time constants;
else it runs on.

python -m benchmarks.bench_friction_proof [--bursts 24] [--loops 460] [--bristles] [--bounded]
[--certificates]
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections import Counter

import control
import numpy as np

import nlfrf
import robust
from benchmarks.friction_loops import bla_of_level, of_example_14, random_loops
from nlfrf import hysteresis
from nlfrf.friction import Dahl, Leuven, LuGre, VaryingSliders
from robust.friction.loop import friction_loop
from robust.friction.proof.protocol import FrictionClass

MACHINE = robust.friction_plant(1.0, 80e3, 0.4)
K0 = 64e3
MICRODAMPING = 13.0  # of the paper's rig [Ns/m]
LONGEST = 60_000  # samples of one run
QUICK = 6_000  # where it is that few, more bursts
RETRIES = 5
MOVING = 1e-3


def law(rng: np.random.Generator, stiction: float) -> VaryingSliders:
    """A friction of the class, at its limits: all of K0, elements from one to six, sliders varying
    in every way.
    """
    n = int(rng.integers(1, 7))
    stiffness = rng.dirichlet(np.ones(n)) * K0
    options = {
        "vs": 10 ** rng.uniform(-4, -1.5) if rng.random() < 0.7 else np.inf,
        "dwell": 10 ** rng.uniform(-3, 0) if rng.random() < 0.5 else 0.0,
        "wavelength": 10 ** rng.uniform(-5.5, -3) if rng.random() < 0.4 else np.inf,
        "asymmetry": rng.uniform() if rng.random() < 0.4 else 0.0,
        "seed": int(rng.integers(1, 1000)) if rng.random() < 0.4 else 0,
    }
    strength = rng.dirichlet(np.ones(n)) * 10 ** rng.uniform(-0.5, 0.5)
    return VaryingSliders(stiffness=stiffness, strength=strength, stiction=stiction, **options)


def disturbed(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """A disturbance that ends, and an initial state: a burst, slow reversals, a kick, a long push
    and its release.
    """
    force, begin = np.zeros(n), np.zeros(2)
    kind, end = rng.integers(4), min(n // 4, 400)
    size = 10 ** rng.uniform(-0.5, 1.5)
    if kind == 0:
        force[:end] = size * rng.standard_normal(end)
    elif kind == 1:
        force[:end] = size * np.sin(np.arange(end) * 2 * np.pi / rng.uniform(50, 400))
    elif kind == 2:
        begin[:] = 10 ** rng.uniform(-6, -3.5) * rng.choice([-1, 1]), 10 ** rng.uniform(-3, -0.3)
    else:
        force[:end] = size * np.linspace(0, 1, end)
    return force, begin


def samples_needed(K: object, delay: float) -> int:
    """Samples of 20 slowest time constants, of the sliding loop and of the loop on its whole
    presliding spring.
    """
    loop = friction_loop(MACHINE, K, delay)
    slowest = max(max(np.abs(p)[np.abs(p) < 1 - 1e-9]) for p in (loop.poles(), loop.poles(K0)))
    return int(np.clip(np.ceil(-20 / np.log(slowest)), 1500, LONGEST))


def swings(response: nlfrf.rig.Trajectory) -> float:
    """Swing of the last tenth over the largest."""
    if response.diverged:
        return np.inf
    return float(np.ptp(response.x[-response.x.size // 10 :]) / max(np.ptp(response.x), 1e-300))


def moving(
    friction: VaryingSliders | LuGre | Leuven | Dahl,
    K: object,
    delay: float,
    force: np.ndarray,
    begin: np.ndarray,
    saturation: float = np.inf,
) -> bool:
    """Whether a loop still moves after all its time; what moves at first runs on, each time twice
    as long.
    """
    for _ in range(RETRIES):
        rig = nlfrf.rig.Rig(
            1.0, 80e3, friction, 0.4 if isinstance(friction, (VaryingSliders, Dahl)) else 0.0
        )
        late = nlfrf.rig.Controller(K, delay=delay, saturation=saturation)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", nlfrf.DataWarning)
            still = np.zeros(force.size)
            left = swings(
                nlfrf.rig.run(rig, still, late, disturbance=force, initial=begin, oversampling=8)
            )
        if left <= MOVING or np.isinf(left):
            return bool(np.isinf(left))
        force = np.concatenate([force, np.zeros(force.size)])
    return True


def attacked(
    loops: list, n_bursts: int, stiction: float, rng: np.random.Generator, laws: object = law
) -> tuple[int, list]:
    """Bursts played to loops, and those that keep moving."""
    total, found = 0, []
    for i, (K, delay) in enumerate(loops):
        n = samples_needed(K, delay)
        for _ in range(max(1, round(n_bursts * (1.5 if n <= QUICK else 0.5)))):
            friction, (force, begin) = laws(rng, stiction), disturbed(rng, n)
            total += 1
            if moving(friction, K, delay, force, begin):
                found.append((i, friction))
    return total, found


def spring_oscillates(K: object, delay: float, kappa: float) -> bool:
    """One element of that stiffness with a finite slider, released off rest: its growth simulated
    out.
    """
    loop = friction_loop(MACHINE, K, delay)
    growth = np.log1p(loop.growth(kappa))
    n = int(np.clip(np.ceil(12 / growth), 2000, 400_000))
    friction = VaryingSliders(stiffness=[kappa], strength=[1.0], stiction=1.0)
    force = np.zeros(n)
    force[:5] = 0.1
    rig = nlfrf.rig.Rig(1.0, 80e3, friction, 0.4)
    response = nlfrf.rig.run(
        rig, np.zeros(n), nlfrf.rig.Controller(K, delay=delay), disturbance=force, oversampling=8
    )
    return swings(response) > 0.05


def lugre(rng: np.random.Generator, stiction: float) -> LuGre:
    """Outside the class: bristles that creep below break-away."""
    return LuGre(
        sigma0=K0, sigma1=13.0, sigma2=0.4, Fc=1 / stiction, Fs=1.0, vs=10 ** rng.uniform(-3, -1.5)
    )


def bristles(rng: np.random.Generator, stiction: float) -> LuGre | Leuven | Dahl:
    """A friction of creeping bristles, at its limits:

    LuGre, the rig of the paper, Leuven laws of every curve.
    """
    kind, vs = rng.integers(4), 10 ** rng.uniform(-3.5, -1)
    Fs = 10 ** rng.uniform(-0.5, 0.5)
    if kind == 0:
        return LuGre(sigma0=K0, sigma1=MICRODAMPING, sigma2=0.4, Fc=Fs / stiction, Fs=Fs, vs=vs)
    if kind == 1 and stiction >= 1 / 0.7:
        return Leuven()
    n = 10 ** rng.uniform(-0.5, 0.5)
    shapes = hysteresis.Tanh, hysteresis.Exponential, hysteresis.Parabola, hysteresis.ElasticPlastic
    curve = shapes[rng.integers(4)](K0=K0, Fy=Fs * rng.uniform(1.0, 2.0))
    return Leuven(
        Fs=Fs, Fc=Fs / stiction ** (1 / n), vs=vs, sigma1=MICRODAMPING, sigma2=0.4, n=n, curve=curve
    )


def dahl(rng: np.random.Generator, stiction: float) -> Dahl:
    """The one law of creeping bristles without microdamping."""
    return Dahl(sigma0=K0, Fc=10 ** rng.uniform(-0.5, 0.5))


def verdicts(loops: list, friction: FrictionClass) -> tuple[list, list[float]]:
    """A proof of every loop, and how long each took [s]."""
    proofs, times = [], []
    for K, delay in loops:
        begin = time.process_time()
        proofs.append(robust.prove_friction(MACHINE, K, friction, delay=delay))
        times.append(time.process_time() - begin)
    return proofs, times


def counted(loops: list, friction: FrictionClass) -> tuple[list, list]:
    """Proofs of all loops, printed as counts, and the loops that are proved."""
    proofs, times = verdicts(loops, friction)
    count = Counter(proof.verdict for proof in proofs)
    decided = 1 - count["not decided"] / len(loops)
    tried = [t for proof, t in zip(proofs, times, strict=True) if proof.certificate is not None]
    print(
        f"stiction {friction.stiction:.3g}: {dict(count)}, decided {100 * decided:.1f} %; ", end=""
    )
    print(
        f"CPU of a proof: median {1e3 * np.median(tried):.0f} ms, most {1e3 * max(tried):.0f} ms",
        flush=True,
    )
    return proofs, [
        loop for loop, proof in zip(loops, proofs, strict=True) if proof.verdict == "proved"
    ]


def attack(
    proved: list, bursts: int, stiction: float, rng: np.random.Generator, laws: object, name: str
) -> None:
    """Bursts at what is proved, and what of it keeps moving, printed."""
    total, found = attacked(proved, bursts, stiction, rng, laws)
    print(f"  {name}: proved and still moving {len(found)} of {total} bursts", flush=True)
    for i, friction in found[:5]:
        print("   ", i, friction)


def from_levels(loops: list) -> None:
    """Of what is proved for the true machine and class, how much is with what three levels tell;
    and of the rest.
    """
    assumed = robust.friction.machine_with_friction([bla_of_level(rms) for rms in (0.1, 0.25, 2.5)])
    truth, _ = verdicts(loops, robust.friction.MaxwellSlip(K0, assumed.friction[0].stiction))
    told = [
        robust.prove_friction(assumed.machine, K, assumed.friction, delay=delay)
        for K, delay in loops
    ]
    both = Counter((true.verdict, level.verdict) for true, level in zip(truth, told, strict=True))
    provable = sum(count for (true, _), count in both.items() if true == "proved")
    unstable = sum(count for (true, _), count in both.items() if true == "refuted")
    print(
        f"from levels of 0.1, 0.25, 2.5 N: {both['proved', 'proved']} of {provable} provable ones"
        " proved, ",
        end="",
    )
    print(f"{both['refuted', 'proved']} of {unstable} that the truth refutes", flush=True)


def certificates(loops: list, friction: FrictionClass) -> None:
    """Every proof made again over the rationals, and the time that one takes."""
    proved = [
        (K, d, p)
        for (K, d), p in zip(loops, verdicts(loops, friction)[0], strict=True)
        if p.verdict == "proved"
    ]
    again = sum(proof.certificate.verify().verified for _, _, proof in proved)
    print(f"{friction.description}: {again} of {len(proved)} hold over the rationals; ", end="")
    times = []
    for K, delay, _ in proved[::4]:
        begin = time.process_time()
        robust.prove_friction(MACHINE, K, friction, delay=delay)
        times.append(time.process_time() - begin)
    print(f"CPU of a proof: median {np.median(times):.2g} s, most {max(times):.2g} s", flush=True)


def bounded() -> None:
    """The bound of any friction of 1 N under a PD at ever faster clocks: they tend to one, and take
    how long.
    """
    for clock in (1e-3, 1e-4, 1e-5):
        K = control.ss([[0.0]], [[1.0]], [[-60 / clock]], [[20e3 + 60 / clock]], clock)
        begin = time.process_time()
        proof = robust.prove_friction(MACHINE, K, robust.friction.Bounded(1.0))
        seconds = time.process_time() - begin
        print(
            f"Bounded at {1e6 * clock:.0f} us: {proof.verdict}, {1e6 * proof.error_bound:.3f} um,"
            f" {seconds:.3f} s"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--bursts", type=int, default=24, help="bursts for each proved loop and stiction"
    )
    parser.add_argument("--loops", type=int, default=460, help="loops, at most")
    parser.add_argument("--bristles", action="store_true", help="bristles that creep only")
    parser.add_argument(
        "--bounded", action="store_true", help="bounded friction at three clocks only"
    )
    parser.add_argument(
        "--certificates", action="store_true", help="levels and certificates only, no bursts"
    )
    args = parser.parse_args()
    loops = (of_example_14() + random_loops(220, 1))[: args.loops]
    rng = np.random.default_rng(0)
    if args.bounded:
        bounded()
        return
    if args.certificates:
        from_levels(loops)
        for stiction in (1.05, 1 / 0.7):
            certificates(loops, robust.friction.MaxwellSlip(K0, stiction))
        certificates(loops, robust.friction.Bristle(K0, 1 / 0.7, MICRODAMPING))
        return
    for stiction in () if args.bristles else (1.05, 1 / 0.7):
        print("Maxwell slip, ", end="")
        proofs, proved = counted(loops, robust.friction.MaxwellSlip(K0, stiction))
        attack(proved, args.bursts, stiction, rng, law, "laws of the class")
        attack(proved, max(1, args.bursts // 24), stiction, rng, lugre, "LuGre, outside the class")
        springs = [
            (K, d, p.counterexample[0])
            for (K, d), p in zip(loops, proofs, strict=True)
            if p.counterexample
        ]
        only = [(K, d, kappa) for K, d, kappa in springs if kappa > 0]
        if only and stiction < 1.1:
            oscillate = sum(spring_oscillates(*spring) for spring in only)
            print(
                f"  refuted by a spring only: {oscillate} of {len(only)} oscillate with that"
                " element",
                flush=True,
            )
    for stiction, microdamping, laws in (
        (1.0, 0.0, dahl),
        (1.05, MICRODAMPING, bristles),
        (1 / 0.7, MICRODAMPING, bristles),
    ):
        print(f"bristles, microdamping {microdamping:g} Ns/m, ", end="")
        _, proved = counted(loops, robust.friction.Bristle(K0, stiction, microdamping))
        attack(proved, 2 * args.bursts, stiction, rng, laws, "laws of the class")


if __name__ == "__main__":
    main()
