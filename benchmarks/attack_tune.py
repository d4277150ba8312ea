"""Whether a tuned design is what it says: random structures, plants, sets and limits, looked at on
a dense grid.

Loops are made again from blocks and plants, apart from `tune`. "Unstable": met, with a pole
outside. "Violated": met, with a hard limit above its bound somewhere. "Low": a ratio that the dense
grid finds larger than was said. All must be
0. Worst cases over a set are compared with `check` (--worst).

python -m benchmarks.attack_tune [--designs 300] [--first 0]
"""

from __future__ import annotations

import argparse
import warnings

import numpy as np

import robust
from tests.support.random_tunings import random_tuning, violation, worst_distance


def judged(seed: int, number: int, time_cap: float) -> tuple[str, float]:
    """What is wrong with one design, and how far its worst case is from that of `check`."""
    try:
        design = robust.tune(
            **random_tuning(np.random.default_rng([seed, number]), n_starts=1, time_cap=time_cap)
        )
    except ValueError:
        return "refused", 0.0
    found = violation(design)
    if found:
        return found if found in ("unstable", "violated") else "low", 0.0
    return "met" if design.met else "not met", worst_distance(design)


def main() -> None:
    """Print what was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--designs", type=int, default=300)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--time-cap", type=float, default=20.0)
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    numbers = range(args.first, args.first + args.designs)
    found = [judged(args.seed, number, args.time_cap) for number in numbers]
    words = [word for word, _ in found]
    count = {
        word: words.count(word)
        for word in ("met", "not met", "refused", "unstable", "violated", "low")
    }
    print(f"{len(found)} designs: " + ", ".join(f"{n} {word}" for word, n in count.items()))
    print(f"worst case over a set: at most {max(away for _, away in found):.1e} from that of check")
    for word in ("unstable", "violated", "low"):
        if word in words:
            print(
                f"  {word}: {[k for k, one in zip(numbers, words, strict=True) if one == word]} of"
                f" seed {args.seed}"
            )


if __name__ == "__main__":
    main()
