"""Whether what `robust.prove_friction` proves of a loop that saturates is so, and how far short of
the truth it stays.

Of the 460 loops of `bench_friction_proof` those that are proved without a limit: how many from
every state with one of 20 N and friction of at most 1 N, how many up to a kick, how much harder
than the kick up to which the actuator never saturates. Each is then played with laws of the class
and kicks up to what is proved; from every state: with bursts of up to a hundred newton. "Still
moving" is as there, and must be 0. Last, the least of growing kicks after which the saturated loop
no longer came to rest, over the one that is proved: what the proof leaves.

python -m benchmarks.bench_saturation [--bursts 12] [--every 1]
"""

from __future__ import annotations

import argparse
import time

import numpy as np

import robust
from benchmarks.bench_friction_proof import K0, MACHINE, disturbed, law, moving, samples_needed
from benchmarks.friction_loops import of_example_14, random_loops
from nlfrf.friction import VaryingSliders

STICTION = 1.05
FS, LIMIT = 1.0, 20.0
STEPS = 1.5 ** np.arange(1, 16)  # times the proved kick


def weak_law(rng: np.random.Generator) -> VaryingSliders:
    """A friction of the class that is never above Fs."""
    drawn = law(rng, STICTION)
    options = {
        name: getattr(drawn, name)
        for name in ("vs", "dwell", "wavelength", "asymmetry", "seed", "stiffness")
    }
    return VaryingSliders(
        strength=FS * drawn.strength / drawn.strength.sum(), stiction=STICTION, **options
    )


def played(
    proof: robust.friction.FrictionProof, K: object, delay: float, rng: np.random.Generator
) -> bool:
    """Whether a loop still moves after a kick that is proved, or after any burst where it is from
    every state.
    """
    n = samples_needed(K, delay)
    force = np.zeros(n)
    begin = np.array([0.0, rng.choice([-1, 1]) * proof.actuator.kick * rng.uniform(0.5, 1.0)])
    if np.isinf(proof.actuator.kick):
        force, begin = disturbed(rng, n)
        force, begin = force * 10 ** rng.uniform(0, 0.5), begin * 10 ** rng.uniform(0, 2)
    return moving(weak_law(rng), K, delay, force, begin, LIMIT)


def least_bad_kick(
    proof: robust.friction.FrictionProof, K: object, delay: float, rng: np.random.Generator
) -> float:
    """The least of growing kicks that keeps a loop moving, over the proved one; infinite where none
    did.
    """
    n = samples_needed(K, delay)
    for times in STEPS:
        if moving(
            weak_law(rng),
            K,
            delay,
            np.zeros(n),
            np.array([0.0, times * proof.actuator.kick]),
            LIMIT,
        ):
            return float(times)
    return np.inf


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--bursts", type=int, default=12, help="kicks or bursts for each proved loop"
    )
    parser.add_argument("--every", type=int, default=1, help="only each of so many loops")
    args = parser.parse_args()
    rng, slip = np.random.default_rng(0), robust.friction.MaxwellSlip(K0, STICTION)
    proofs, seconds = [], []
    for K, delay in (of_example_14() + random_loops(220, 1))[:: args.every]:
        begin = time.process_time()
        proof = robust.prove_friction(MACHINE, K, slip, Fs=FS, saturation=LIMIT, delay=delay)
        if proof.verdict.is_proved:
            proofs.append((proof, K, delay))
            seconds.append(time.process_time() - begin)
    kicks = np.array(
        [
            proof.actuator.kick / proof.actuator.kick_linear
            for proof, _, _ in proofs
            if np.isfinite(proof.actuator.kick)
        ]
    )
    print(
        f"{len(proofs)} loops proved without a limit; CPU median {np.median(seconds):.2g} s, most"
        f" {max(seconds):.2g} s"
    )
    print(f"  from every state: {len(proofs) - kicks.size}; up to a kick: {kicks.size}")
    quantiles = ", ".join(f"{q:.3g}" for q in np.quantile(kicks, [0, 0.25, 0.5, 0.75, 1]))
    print(f"  kick over that without saturating: {quantiles} (least, quartiles, largest); ", end="")
    print(f"no further: {np.sum(kicks <= 1)}")
    again = sum(proof.certificate.verify().verified for proof, _, _ in proofs[::5])
    print(f"  proved again over the rationals: {again} of {len(proofs[::5])}", flush=True)
    found = [played(*each, rng) for each in proofs for _ in range(args.bursts)]
    print(f"  proved and still moving {sum(found)} of {len(found)} kicks and bursts", flush=True)
    bad = np.array(
        [least_bad_kick(*each, rng) for each in proofs[::5] if np.isfinite(each[0].actuator.kick)]
    )
    seen = bad[np.isfinite(bad)]
    print(
        f"  kicks up to {STEPS[-1]:.0f} times that: {seen.size} of {bad.size} loops did not come to"
        " rest, ",
        end="",
    )
    print(
        f"from {np.min(seen, initial=np.inf):.3g}, median"
        f" {np.median(seen) if seen.size else np.nan:.3g} times it on"
    )


if __name__ == "__main__":
    main()
