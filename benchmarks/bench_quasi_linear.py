"""How often `robust.friction.quasi_linear` says what becomes of a loop around the paper's rig: 240 loops, three bursts.

Predicted from the law and from levels of 0.25, 0.5 and 2 N, beside the statistical verdict; simulated without
saturation. "Keeps moving" is a limit cycle or a run-away. Sensitivity: of those that keep moving, how many were said
to; specificity: of those that settle. Then the predicted kick over the simulated one, by bisection over kicks.

python -m benchmarks.bench_quasi_linear [--loops 240] [--kicks 17]
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Iterable

import numpy as np

import nlfrf
import robust
from benchmarks.friction_loops import T, bla_of_level, of_example_14

MACHINE = robust.friction_plant(1.0, 80e3, 0.4)
BURSTS = (0.5, 2.0, 20.0)  # rms [N]
CALM, SILENCE = 300, 2700  # samples


def burst(rms: float) -> np.ndarray:
    """White force [N], always the same but for its size."""
    return rms * np.random.default_rng(0).standard_normal(CALM)


def keeps_moving(controllers: list, rms: float) -> np.ndarray:
    """What the rig does after a burst."""
    force = np.append(burst(rms), np.zeros(SILENCE))
    found = nlfrf.rig.run_loops(nlfrf.paper_rig(), np.zeros(force.size), controllers, disturbance=force)
    return np.array([response.outcome(CALM * T) in ("limit cycle", "ran away") for response in found])


def predicted(friction: object, controllers: list, rms: float) -> np.ndarray:
    """What is said of it."""
    said = [robust.friction.quasi_linear(friction, MACHINE, K, burst=burst(rms)).outcome for K in controllers]
    return np.array([outcome != "settled" for outcome in said])


def scores(said: np.ndarray, true: np.ndarray) -> str:
    """Sensitivity, specificity and how many are right."""
    return (
        f"sensitivity {np.mean(said[true]):.2f}, specificity {np.mean(~said[~true]):.2f}, "
        f"right {np.sum(said == true)} of {true.size}"
    )


def kick_ratios(controllers: Iterable, most: int) -> list[float]:
    """Predicted over simulated kick from which a loop no longer comes to rest, by bisection of the simulated one."""
    ratios = []
    for K in controllers:
        kick = robust.friction.quasi_linear(nlfrf.paper_rig().friction, MACHINE, K).kick
        if not 1e-4 < kick < 10:
            continue
        low, high = kick / 10, kick * 10
        while high / low > 1.01:
            middle = np.sqrt(low * high)
            rig, rest = nlfrf.paper_rig(), np.zeros(6000)
            response = nlfrf.rig.run(rig, rest, K, initial=(0.0, middle), oversampling=8)
            swing = np.ptp(response.x[-600:]) if not response.diverged else np.inf
            low, high = (middle, high) if swing < 0.5 * np.ptp(response.x[:600]) else (low, middle)
        if 1.1 * kick / 10 < low < 0.9 * kick * 10:
            ratios.append(kick / low)
        if len(ratios) == most:
            break
    return ratios


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--loops", type=int, default=240)
    parser.add_argument("--kicks", type=int, default=17)
    args = parser.parse_args()
    warnings.simplefilter("ignore", nlfrf.DataWarning)
    rng = np.random.default_rng(1)
    loops = of_example_14()
    controllers = [loops[i][0] for i in rng.permutation(len(loops))[: args.loops]]
    frictions = {"law": nlfrf.paper_rig().friction, "levels": [bla_of_level(rms) for rms in (0.25, 0.5, 2.0)]}
    for rms in BURSTS:
        true = keeps_moving(controllers, rms)
        print(f"burst of {rms} N: {np.sum(true)} of {true.size} keep moving", flush=True)
        for name, friction in frictions.items():
            begin = time.process_time()
            said = predicted(friction, controllers, rms)
            each = (time.process_time() - begin) / len(controllers)
            print(f"  from the {name}: {scores(said, true)}; {1e3 * each:.0f} ms each", flush=True)
    ratios = kick_ratios(controllers, args.kicks)
    print(f"kick, predicted over simulated, {len(ratios)} loops: {min(ratios):.2f} to {max(ratios):.2f}, ", end="")
    print(f"median {np.median(ratios):.2f}")


if __name__ == "__main__":
    main()
