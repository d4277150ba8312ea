"""Norms that synthesis claims on ill-conditioned problems, held against evaluation in 100 digits.

python -m benchmarks.bench_gamma [--problems N] [--seed S] [--data FOLDER]

Four families: states in units over many decades, coordinates nearly singular, modes that nearly
cancel, poles over many decades; of random plants, and of the problems of COMPleib where FOLDER
holds them. A claim is false where gamma is said to be certified and a frequency is found at which
the loop of P and K as they are has more gain.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections import Counter
from pathlib import Path

import control
import numpy as np

from benchmarks.bench_synthesis import FOLDER
from robust import hinfsyn
from robust.synthesis.hinf.hinfsyn import synthesise
from tests.robust.synthesis.test_hinfsyn import random_plant
from tests.support.compleib import generalised
from tests.support.precise_lft import lft_norm

MOST_STATES = 12  # of the published problems


def moved(P, T):
    """P in the coordinates T x, as doubles have it."""
    back = np.linalg.inv(T)
    return control.StateSpace(T @ P.A @ back, T @ P.B, P.C @ back, P.D, P.dt)


def units(P, rng):
    """States in units over up to twenty decades."""
    return moved(P, np.diag(10 ** rng.uniform(-10, 10, P.nstates)))


def skewed(P, rng):
    """Coordinates of condition 1e3 to 1e10."""
    U, V = (np.linalg.qr(rng.standard_normal((P.nstates, P.nstates)))[0] for _ in range(2))
    return moved(P, U @ np.diag(np.geomspace(1, 10 ** rng.uniform(3, 10), P.nstates)) @ V)


def cancelling(P, rng):
    """With a slow mode, stable or not, that hardly shows at u and y."""
    n, small = P.nstates, 10 ** rng.uniform(-9, -2)
    pole = (1.0 if P.dt else 0.0) + 10 ** rng.uniform(-4, -1) * rng.choice([-1.0, 1.0])
    A = np.block([[P.A, np.zeros((n, 1))], [np.zeros((1, n)), np.array([[pole]])]])
    B = np.vstack([P.B, small * rng.standard_normal((1, P.ninputs))])
    C = np.hstack([P.C, rng.standard_normal((P.noutputs, 1))])
    return control.StateSpace(A, B, C, P.D, P.dt)


def spread(P, rng):
    """With the rows of A over ten decades: fast states and slow ones."""
    if P.dt:
        return units(P, rng)
    rates = 10 ** rng.uniform(-5, 5, P.nstates)
    return control.StateSpace(rates[:, None] * P.A, rates[:, None] * P.B, P.C, P.D, 0)


FAMILIES = {"units": units, "skewed": skewed, "cancelling": cancelling, "spread": spread}


def problems(n, seed, folder):
    """(name, P, n_y, n_u), n of each family."""
    known = np.load(folder / "problems.npz") if (folder / "problems.npz").exists() else {}
    titles = [key[:-2] for key in known if key.endswith("/A") and len(known[key]) <= MOST_STATES]
    for k in range(n):
        for name, family in FAMILIES.items():
            rng = np.random.default_rng([seed, k, len(name)])
            if titles and k % 3 == 2:
                title = titles[int(rng.integers(len(titles)))]
                P, n_y, n_u = generalised(known, title)
            else:
                n_u, n_y = map(int, rng.integers(1, 3, 2))
                title, dt = "random", 0.1 * (k % 2)
                P = random_plant(rng, int(rng.integers(2, 11)), n_y + 1, n_u, n_u + 1, n_y, dt)
            yield f"{name} {title} {seed}/{k}", family(P, rng), n_y, n_u


def judge(name, P, n_y, n_u, count):
    """One problem: what is claimed, and what is."""
    try:
        before = synthesise(P, n_y, n_u).gamma
        found = hinfsyn(P, n_y, n_u)
    except ValueError:
        count["refused"] += 1
        return
    if not np.isfinite(before) or not found.found:
        count["nothing found"] += not np.isfinite(before)
        count["found unstable in many digits"] += bool(np.isfinite(before))
        return
    true, where = lft_norm(P, found.K)
    count["found"] += 1
    count["certified"] += found.certified
    count["computed in doubles alone, 1 % or more too low"] += before < 0.99 * true
    false = found.certified and true > found.gamma
    loose = found.certified and found.gamma > 1.01 * true
    count["FALSE"] += false
    count["certified, 1 % or more above what evaluation finds"] += loose
    if false or loose or not found.certified or before < 0.99 * true:
        said = "certified" if found.certified else found.reason
        print(
            f"{name}: doubles {before:.6g}, gamma {found.gamma:.6g}, evaluated {true:.6g} at"
            f" {where:.4g}: {said}"
        )


def main():
    """Everything."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--problems", type=int, default=25, help="of each family")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--data", type=Path, default=FOLDER)
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    count, begin = Counter(), time.time()
    for problem in problems(given.problems, given.seed, given.data):
        judge(*problem, count)
    print(
        "; ".join(f"{name} {number}" for name, number in count.items()),
        f"in {time.time() - begin:.0f} s",
    )


if __name__ == "__main__":
    main()
