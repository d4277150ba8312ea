"""`robust` in numbers: weights and checks in seconds, and the check under attack by loops with a
known worst case.

python -m benchmarks.bench_robust            # 2000 random loops, some minutes
python -m benchmarks.bench_robust 200        # fewer
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from itertools import product

import control
import numpy as np

from benchmarks.timing import best, in_turn
from robust import UncertaintyModel, check, fit_nominal, fit_weight, performance_weight
from tests.robust.models.fit.test_weights import LINES, OMEGA, SHAPES, modes
from tests.support.precise_loops import wrongly_stable
from tests.support.random_loops import (
    closed_loop_poles,
    dense_grid,
    random_case,
    roots,
    tf_response,
    zpk,
)
from tests.support.random_rational import random_rational


def weights():
    """Order that is chosen, mean and largest excess and seconds over a thousand lines; the mean at
    orders 5 and 8.

    No weight of any order lies lower in the mean than the larger neighbour, which it has to cover:
    the column `least`.
    """
    print(
        "fit_weight, 1000 lines, log grid and special-odd grid: excess in dB; the order is chosen,"
        " then 5 and 8"
    )
    print("  radius             least   order   mean largest  seconds     at 5    at 8")
    radii = SHAPES | {f"{n} modes": lambda omega, n=n: modes(n, omega, n) for n in (2, 3, 4)}
    for (name, shape), omega in product(radii.items(), (OMEGA, LINES)):
        radius = shape(omega)
        sides = np.pad(radius, 1, mode="edge")
        least = np.mean(
            20 * np.log10(np.maximum(radius, np.maximum(sides[:-2], sides[2:])) / radius)
        )
        fit = fit_weight(omega, radius)
        seconds = best(lambda omega=omega, radius=radius: fit_weight(omega, radius))
        five, eight = (fit_weight(omega, radius, order=n).mean_excess_db for n in (5, 8))
        print(
            f"  {name:16s} {least:7.2f} {fit.W.nstates:7d} {fit.mean_excess_db:6.2f}"
            f" {fit.max_excess_db:7.1f} {seconds:8.3f} {five:8.2f} {eight:7.2f}"
        )


def nominal_fits(n_plants=100):
    """Share of the random plants whose fit costs at most 5 % more than one started from the truth,
    and seconds.
    """
    good, seconds = Counter(), []
    for seed in range(n_plants):
        plant = random_rational(seed)
        for delay in ("estimate", plant.delay):
            begin = time.process_time()
            fit = fit_nominal(
                plant.frd,
                n_poles=plant.poles.size,
                n_zeros=plant.zeros.size,
                delay=delay,
                std=plant.std,
            )
            seconds.append(time.process_time() - begin)
            free = delay == "estimate"
            good[free] += fit.cost < 1.05 * plant.cost_from_truth(free)
    print(
        f"fit_nominal of {n_plants} random plants of 1 to 6 poles: as good as from the truth with"
        f" the delay estimated in {good[True]}, with the delay given in {good[False]};"
        f" {np.median(seconds):.3f} s in the middle, {np.mean(seconds):.3f} s in the mean"
    )


def loop_of(rng, n):
    """A set and a stable loop of n states with its largest rs at 0.8, six of the states in
    controller and weight.
    """
    while True:
        G = zpk(roots(rng, n - 8, lightest=-2), roots(rng, n - 6, lightest=-2), 1.0)
        K = zpk(roots(rng, 2), roots(rng, 3), 0.02)
        w = zpk(roots(rng, 3), roots(rng, 3), 0.1)
        G = G * (1 / np.abs(tf_response(G, np.geomspace(0.05, 200, 3000))).max())
        K = K * (0.5 / np.abs(tf_response(K, np.geomspace(0.05, 200, 3000))).max())
        if np.all(closed_loop_poles(G, K).real < 0):
            break
    omega = dense_grid(0.0, closed_loop_poles(G, K), w.poles())
    L = tf_response(G, omega) * tf_response(K, omega)
    scale = 0.8 / np.max(np.abs(tf_response(w, omega) * L / (1 + L)))
    return (
        UncertaintyModel(
            G, w * scale, "multiplicative", np.array([1.0]), np.array([1e-6]), perturbation="LTI"
        ),
        K,
    )


def seconds_of_checks():
    """Milliseconds of the processor of a check: wanted 15 with proof and 5 without of 12 states,
    500 of order 40.
    """
    w_P = performance_weight(1e-3, M_S=20, A=1.5)
    print("check: ms of the processor, median of 3 in turn; each with what proved it")
    for n in (12, 40):
        model, K = loop_of(np.random.default_rng(3), n)
        sampled = K.sample(0.01, method="tustin")
        runs = {
            "bare": lambda m=model, K=K: check(m, K, certify=False),
            "proof": lambda m=model, K=K: check(m, K),
            "and performance": lambda m=model, K=K: check(m, K, w_P=w_P),
            "delayed": lambda m=model, K=K: check(m, K, delay=1e-3),
            "delayed, and performance": lambda m=model, K=K: check(m, K, delay=1e-3, w_P=w_P),
            "sampled": lambda m=model, K=sampled: check(m, K),
            "sampled, and performance": lambda m=model, K=sampled: check(m, K, w_P=w_P),
        }
        if n > 12:  # wanted of ordinary orders only
            del runs["sampled"], runs["sampled, and performance"]
        for name, milliseconds in in_turn(runs, 3).items():
            report = runs[name]()
            how = ", ".join(c.method or c.reason for c in report.proofs.certificates)
            print(
                f"  {n} states, {name}: {1e3 * milliseconds:.1f} ms ({report.verdict}: {how})",
                flush=True,
            )


def attack(n_loops, seed=0):
    """Verdicts against brute force over frequency: soundness, tightness at 0.99, seconds."""
    rng = np.random.default_rng(seed)
    count, methods, seconds = Counter({"called stable": 0, "called robust": 0}), Counter(), []
    for _ in range(n_loops):
        case = random_case(rng)
        lines = np.array([0.5, 1.0])
        radius = 0.5 * np.abs(tf_response(case["w"], lines))
        model = UncertaintyModel(
            case["G"], case["w"], case["form"], lines, radius, perturbation="LTI"
        )
        begin = time.process_time()
        report = check(model, case["K"], delay=case["delay"])
        seconds.append(time.process_time() - begin)
        if case["unstable"]:
            count["unstable loops"] += 1
            count["called stable"] += wrongly_stable(case, report)
            continue
        if case["target"] > 1:
            count["violations"] += 1
            count["called robust"] += report.verdict == "robust"
        if case["stable"] and case["target"] == 0.99:
            count["at 0.99"] += 1
            count["called robust at 0.99"] += report.verdict == "robust"
            if report.verdict == "robust":
                methods[report.proofs.certificates[0].method] += 1
            else:
                print(f"  not robust at 0.99: {case['kind']}, {case['form']}: {report.reason}")
    print(f"{n_loops} random loops: {dict(count)}")
    print(
        f"  proved by {dict(methods)}; {np.median(seconds):.3f} s a check, {max(seconds):.2f} s at"
        " most"
    )


def main():
    """Everything."""
    print(f"python-control {control.__version__}, numpy {np.__version__}")
    weights()
    nominal_fits()
    seconds_of_checks()
    attack(int(sys.argv[1]) if len(sys.argv) > 1 else 2000)


if __name__ == "__main__":
    main()
