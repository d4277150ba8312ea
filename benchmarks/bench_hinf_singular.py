"""H-infinity synthesis on plants with deficient D12 and D21, unreached outputs, dead or repeated
channels.

python -m benchmarks.bench_hinf_singular [--problems N] [--seed S]

Each result is held against a closed form where there is one (the plant without the repeated
channels, the norm that no controller changes), and against the norm of the closed loop, put
together and evaluated by numpy alone.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections import Counter

import numpy as np

from robust import hinfsyn
from robust.lti.norms import hinf_norm
from tests.support.singular_plants import FAMILIES, closed_loop_gain

NEAR = 1.03  # of the closed form


def faults_of(family, seed):
    """What is wrong with one result; how far gamma is above its lower bound."""
    rng = np.random.default_rng(seed)
    P, n_y, n_u, known = FAMILIES[family](rng, int(rng.integers(1, 6)), 0.1 * int(rng.integers(2)))
    try:
        found = hinfsyn(P, n_y, n_u)
    except ValueError as error:
        return (
            [] if "stabilisable by a controller" in str(error) else [f"refused: {error}"]
        ), np.nan
    if not found.found:
        return [f"nothing found: {found.reason}"], np.nan
    gain, growth = closed_loop_gain(P, found.K, n_y, n_u)
    faults = [f"pole beyond the boundary by {growth:.2g}"] * bool(growth >= 1e-9)
    faults += [f"gain {gain:.6g} above gamma {found.gamma:.6g}"] * bool(
        gain > found.gamma * (1 + 1e-5) + 1e-9
    )
    faults += [f"bound {found.gamma_min:.6g} above gamma {found.gamma:.6g}"] * bool(
        found.gamma_min > found.gamma
    )
    if known is not None:
        least = (best := hinfsyn(*known)).gamma if isinstance(known, tuple) else hinf_norm(known)[0]
        low = best.gamma_min if isinstance(known, tuple) else least
        faults += [f"gamma {found.gamma:.6g}, known {least:.6g}"] * bool(
            found.gamma > NEAR * least + 1e-9
        )
        above = found.gamma_min > least * (1 + 1e-6) + 1e-9
        faults += [f"bound {found.gamma_min:.6g} above what is known, {least:.6g}"] * bool(above)
        faults += [f"bound {found.gamma_min:.6g} far below {low:.6g}"] * bool(
            found.gamma_min < 0.97 * low
        )
    faults += [f"not certified: {found.reason}"] * (not found.certified)
    return faults, found.gamma / found.gamma_min if found.gamma_min else np.nan


def main():
    """Everything."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--problems", type=int, default=30, help="of each family")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    begin, count = time.process_time(), Counter()
    for family in FAMILIES:
        ratios = []
        for k in range(given.problems):
            faults, ratio = faults_of(family, [given.seed, k])
            ratios += [] if np.isnan(ratio) else [ratio]
            count["problems"] += 1
            count["faults"] += bool(faults)
            if faults:
                print(f"{family} {given.seed}/{k}: {'; '.join(faults)}")
        text = (
            f"median {np.median(ratios):.4f}, largest {np.max(ratios):.4g}"
            if ratios
            else "without a bound"
        )
        print(f"{family}: gamma over its lower bound {text}, of {len(ratios)}")
    print(
        ", ".join(f"{number} {name}" for name, number in count.items()),
        f"in {time.process_time() - begin:.0f} s",
    )


if __name__ == "__main__":
    main()
