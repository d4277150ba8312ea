"""Proofs to the last bit under attack: what `check` certifies is verified, what is above the limit
never is.

python -m benchmarks.bench_verification            # 500 loops of each kind, some minutes
python -m benchmarks.bench_verification 50         # fewer
"""

from __future__ import annotations

import sys
import time
import warnings
from collections import Counter

import control
import numpy as np

from robust import UncertaintyModel, check
from robust._base.states import Stability
from robust.analysis.loop_proofs import stability_claim
from robust.lti.connections import closed_loop
from robust.proofs.exact.claim import to_matrices
from robust.proofs.exact.loops import verify_loop
from robust.proofs.exact.stability import decide_loop_stability
from robust.proofs.search.stability import decide_stability
from tests.support.hard_loops import boundary_gain, hard_loop, margin, with_gain
from tests.support.precise_loops import PreciseLoop, just_above
from tests.support.random_loops import curves, random_case, roots, tf_response, zpk

MOST_STATES = 12
LINES = np.array([0.5, 1.0])


def stable_cases(seed):
    """Random loops of at most twelve states, stable for certain; a third of the continuous ones
    behind a delay.
    """
    rng = np.random.default_rng(seed)
    while True:
        case = random_case(rng)
        states = sum(case[name].nstates for name in ("G", "K", "w"))
        if not case["stable"] or states > MOST_STATES:
            continue
        if case["kind"] == "continuous" and rng.random() < 1 / 3:
            case = behind_delay(case, 10 ** rng.uniform(-4, -2))
        yield rng, case


def behind_delay(case, delay):
    """The same loop with its plant behind a delay, its weight scaled to the same target."""
    G, K, w, omega = (case[name] for name in ("G", "K", "w", "omega"))
    there = tf_response(G, omega) * np.exp(-1j * omega * delay)
    S, a, b = curves(case["form"], there, tf_response(K, omega), tf_response(w, omega))
    scale = case["target"] / np.abs(b).max()
    return case | {"delay": delay, "w": w * scale, "S": S, "a": a * scale, "b": b * scale}


def model_of(case, w, perturbation="LTI"):
    radius = 0.5 * np.abs(tf_response(w, LINES))
    return UncertaintyModel(case["G"], w, case["form"], LINES, radius, perturbation=perturbation)


def demanding(rng, case):
    """A performance weight that the worst plant of the set reaches to 90 to 99.9 %."""
    w_P, omega = zpk(roots(rng, 1), roots(rng, 1), 1.0), case["omega"]
    S, a, b = case["S"], case["a"], case["b"]
    worst = np.abs(S) * (np.abs(1 - a * b.conj()) + np.abs(a - b)) / (1 - np.abs(b) ** 2)
    return w_P * (rng.choice([0.9, 0.99, 0.999]) / np.max(worst * np.abs(tf_response(w_P, omega))))


def certificates(n_loops, seed=0):
    """Share of the certificates of `check` that are verified, and seconds."""
    count, seconds, cases = Counter(), [], stable_cases(seed)
    for _ in range(n_loops):
        rng, case = next(cases)
        w_P = demanding(rng, case) if case["target"] < 1 and rng.random() < 0.5 else None
        perturbation = str(rng.choice(["LTI", "statistical", "operator"]))
        report = check(
            model_of(case, case["w"], perturbation), case["K"], delay=case["delay"], w_P=w_P
        )
        for certificate in report.proofs.certificates:
            count["asked"] += 1
            if certificate.holds:
                begin = time.process_time()
                found = certificate.verify()
                seconds.append(time.process_time() - begin)
                count["certified"] += 1
                count["verified"] += found.verified
                if not found.verified:
                    print(
                        f"  not verified: {case['kind']}, {case['form']}, {certificate.subject}:"
                        f" {found.failed}"
                    )
    share = 100 * count["verified"] / count["certified"]
    print(
        f"{n_loops} loops: {count['certified']} certificates, {count['verified']} verified"
        f" ({share:.1f} %, target 95), {np.median(seconds):.3f} s median (target 0.2),"
        f" {np.quantile(seconds, 0.99):.2f} s of 99 %, {max(seconds):.2f} s at most"
    )


def above(n_loops, seed=1):
    """How many loops with a peak between 1 + 1e-9 and 1 + 1e-6 are verified, and as far below
    it.
    """
    count, cases, rng = Counter(), stable_cases(seed), np.random.default_rng(seed)
    while count["above"] < n_loops:
        _, case = next(cases)
        excess = 10 ** rng.uniform(-8.9, -6.1)
        w, peak, _ = just_above(case, excess)
        if not 1e-9 < float(peak - 1) < 1e-6:
            continue
        count["above"] += 1
        bad = verify_loop(
            stability_claim(model_of(case, w), case["K"], w_P=None, delay=case["delay"])
        ).verified
        count["verified above"] += bad
        if bad:
            print(
                f"  VERIFIED ABOVE: {case['kind']}, {case['form']}, delay {case['delay']}, peak 1 +"
                f" {float(peak - 1)}"
            )
        below = just_above(case, -excess)[0]
        if highest(case, below) < 1:
            count["below"] += 1
            count["verified below"] += verify_loop(
                stability_claim(model_of(case, below), case["K"], w_P=None, delay=case["delay"])
            ).verified
    print(f"peaks within 1e-9 to 1e-6 of one: {dict(count)}; target: none verified above")


def highest(case, w):
    """The largest of the ten highest places of the curve in many digits, ends included."""
    loop = PreciseLoop(case["G"], case["K"], w, case["form"], case["delay"])
    order = np.argsort(-np.abs(case["b"]))[:10]
    places = [*case["omega"][order], 1e-9 * float(case["omega"][0])]
    return max(float(loop.values(float(omega))[0]) for omega in places)


def poles(n_loops, seed=2):
    """Stability of loops of 15 to 30 states within 1e-2 to 1e-9 of a gain at the boundary, against
    450 digits.
    """
    rng, count, seconds, done = np.random.default_rng(seed), Counter(), [], 0

    def exactly(G, K):
        return decide_loop_stability(to_matrices(G), to_matrices(K)).holds

    while done < n_loops:
        G, K = hard_loop(rng)
        edges = boundary_gain(G, K, exactly)
        if edges is None:
            continue
        done += 1
        for gain in (edges[0] * (1 + rng.choice([-1, 1]) * 10 ** rng.uniform(-9, -2)), *edges):
            beside = with_gain(K, gain)
            true = float(margin(G, beside)) < 0
            begin = time.process_time()
            found = decide_loop_stability(to_matrices(G), to_matrices(beside))
            seconds.append(time.process_time() - begin)
            count["decided"] += 1
            count["wrong"] += found.holds != true
            count["undecided"] += not (found.holds or found.violated)
            floats = decide_stability(
                control.StateSpace(*closed_loop(G, beside, ("e",), ("r",)), G.dt)
            )
            count["undecided in floating point"] += floats.state is Stability.UNDECIDED
            count["wrong in floating point"] += (
                floats.state is not Stability.UNDECIDED and floats.stable != true
            )
    print(
        f"{n_loops} ill-conditioned loops beside the boundary: {dict(count)};"
        f" {np.median(seconds):.3f} s median"
    )


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    many = int(sys.argv[1]) if len(sys.argv) > 1 else 500
    certificates(many)
    above(many)
    poles(max(1, many // 10))
