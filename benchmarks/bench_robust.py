"""`robust` in numbers: weights and checks in seconds, and the check under attack by loops with a known worst case.

python -m benchmarks.bench_robust            # 2000 random loops, some minutes
python -m benchmarks.bench_robust 200        # fewer
"""

from __future__ import annotations

import sys
import time
from collections import Counter

import control
import numpy as np

from benchmarks.timing import best, in_turn
from robust import UncertaintyModel, check, fit_weight, performance_weight
from tests.robust.models.fit.test_weights import LINES, OMEGA, SHAPES
from tests.support.precise_loops import wrongly_stable
from tests.support.random_loops import closed_loop_poles, dense_grid, random_case, roots, tf_response, zpk


def weights():
    """Seconds and mean excess of order 8 (5) over a thousand lines of every shape; target 0.5 s."""
    print(
        "fit_weight, 1000 lines, log grid and special-odd grid: seconds at order 8, mean excess [dB] at order 5 and 8"
    )
    for name, shape in SHAPES.items():
        row = []
        for omega in (OMEGA, LINES):
            radius = shape(omega)
            seconds = best(lambda omega=omega, radius=radius: fit_weight(omega, radius, order=8))
            five, eight = (fit_weight(omega, radius, order=n).mean_excess_db for n in (5, 8))
            row.append(f"{seconds:6.3f} s  {five:7.3f} {eight:7.3f} dB")
        print(f"  {name:16s} {'   '.join(row)}")


def twelve_states():
    """Seconds of a check with certificate and performance on a loop of twelve states; target 2 s."""
    rng = np.random.default_rng(1)
    G = zpk(roots(rng, 4, lightest=-2), roots(rng, 6, lightest=-2), 1.0)
    K = zpk(roots(rng, 2), roots(rng, 3), 0.02)
    w = zpk(roots(rng, 3), roots(rng, 3), 0.1)
    omega = dense_grid(0.0, closed_loop_poles(G, K), w.poles())
    L = tf_response(G, omega) * tf_response(K, omega)
    scale = 0.8 / np.max(np.abs(tf_response(w, omega) * L / (1 + L)))
    model = UncertaintyModel(G, w * scale, "multiplicative", np.array([1.0]), np.array([1e-6]), perturbation="LTI")
    for label, w_P in (("stability", None), ("and performance", performance_weight(1e-3, M_S=20, A=1.5))):
        report = check(model, K, w_P=w_P)
        how = ", ".join(c.method or c.reason for c in report.certificates)
        seconds = best(lambda w_P=w_P: check(model, K, w_P=w_P))
        times = in_turn({"bare": lambda w_P=w_P: check(model, K, w_P=w_P, certify=False)}, 20)
        print(f"check, 12 states, {label}: {seconds:.3f} s ({report.verdict}: {how})")
        print(f"  without proof {1e3 * times['bare']:.1f} ms of the processor (wanted 5 for stability)")


def attack(n_loops, seed=0):
    """Verdicts against brute force over frequency: soundness, tightness at 0.99, seconds."""
    rng = np.random.default_rng(seed)
    count, methods, seconds = Counter({"called stable": 0, "called robust": 0}), Counter(), []
    for _ in range(n_loops):
        case = random_case(rng)
        lines = np.array([0.5, 1.0])
        radius = 0.5 * np.abs(tf_response(case["w"], lines))
        model = UncertaintyModel(case["G"], case["w"], case["form"], lines, radius, perturbation="LTI")
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
                methods[report.certificates[0].method] += 1
            else:
                print(f"  not robust at 0.99: {case['kind']}, {case['form']}: {report.reason}")
    print(f"{n_loops} random loops: {dict(count)}")
    print(f"  proved by {dict(methods)}; {np.median(seconds):.3f} s a check, {max(seconds):.2f} s at most")


def main():
    """Everything."""
    print(f"python-control {control.__version__}, numpy {np.__version__}")
    weights()
    twelve_states()
    attack(int(sys.argv[1]) if len(sys.argv) > 1 else 2000)


if __name__ == "__main__":
    main()
