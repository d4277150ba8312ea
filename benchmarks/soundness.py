"""The check under attack, family by family: false "robust", refusals at 0.99 of the limit,
undecided.

python -m benchmarks.soundness               # 300 loops of each family; bench_robust runs 2000 of the common kind
python -m benchmarks.soundness 50 coprime    # fewer, of the families named like this
"""

from __future__ import annotations

import sys
import time
import warnings
from collections import Counter

import numpy as np

from robust import UncertaintyModel, check
from tests.support.random_families import FAMILIES
from tests.support.random_loops import tf_response

LINES = np.array([0.5, 1.0])


def model_of(case):
    """The set of a case; None where its weight reaches one in the coprime form, which holds every
    plant.
    """
    lines = LINES if not case["G"].dt else np.array([0.1, 0.2]) * min(1.0, 1 / case["G"].dt)
    radius = 0.5 * np.abs(tf_response(case["w"], lines))
    more = {"scaling": (1.0, case["W2"])} if "W2" in case else {}
    kind = case.get("perturbation", "LTI")
    return UncertaintyModel(
        case["G"], case["w"], case["form"], lines, radius, perturbation=kind, **more
    )


def judged(case):
    """What a verdict counts as, in words; the verdict, the reason and seconds."""
    begin = time.process_time()
    try:
        report = check(model_of(case), case["K"], delay=case["delay"])
    except ValueError as error:
        if "weight must stay below one" in str(error):
            return ["weight of one: holds every plant"], None, 0.0
        raise
    seconds = time.process_time() - begin
    found = []
    # an inverse form under a sampled controller is judged exactly, and proved by a condition that
    # is sufficient
    sufficient = case["kind"] == "sampled" and case["form"].startswith("inverse")
    if report.verdict == "not certified" and not report.margins.rs <= 1:
        found.append("inverse form left open" if sufficient else "undecided")
    if case["unstable"]:
        found += ["unstable"] + ["called stable"] * report.nominally_stable
    elif case["stable"]:
        if not report.nominally_stable:
            found.append(
                "stable called unstable"
                if report.reason.startswith("unstable")
                else "stability left open"
            )
        if case["target"] > 1:
            found += ["violations"] + ["called robust"] * (report.verdict == "robust")
        if case["target"] == 0.99 and not sufficient:
            found += ["at 0.99"] + ["refused at 0.99"] * (report.verdict != "robust")
    return found, report, seconds


WRONG = (
    "called stable",
    "called robust",
    "refused at 0.99",
    "stable called unstable",
    "stability left open",
    "undecided",
)


def attack(n_loops, only="", seed=0):
    """Verdicts of every family against brute force over frequency."""
    print(
        f"{n_loops} loops of each family: wrong verdicts of how many, refusals at 0.99, undecided"
        " of all"
    )
    for number, (name, draw) in enumerate(FAMILIES.items()):
        if only and only not in name:
            continue
        rng, count, seconds = np.random.default_rng([seed, number]), Counter(), []
        for k in range(n_loops):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of the random designs
                case = draw(rng)
                found, report, took = judged(case)
            count.update(found)
            seconds.append(took)
            for what in found:
                if what in WRONG:
                    detail = (
                        f"{case['kind']}, {case['form']}, {case['target']}: {report.verdict}:"
                        f" {report.reason}"
                    )
                    print(f"  {name} {k}: {what}: {detail}", flush=True)
        print(
            f"{name:20s} robust {count['called robust']} of {count['violations']} violated, stable"
            f" {count['called stable']} of {count['unstable']} unstable, refused"
            f" {count['refused at 0.99']} of {count['at 0.99']} at 0.99, unstable or open"
            f" {count['stable called unstable'] + count['stability left open']} of the stable,"
            f" undecided {count['undecided']} of {n_loops}, inverse forms left open"
            f" {count['inverse form left open']}; {np.median(seconds):.3f} s a check,"
            f" {max(seconds):.2f} s at most",
            flush=True,
        )


if __name__ == "__main__":
    attack(int(sys.argv[1]) if len(sys.argv) > 1 else 300, "".join(sys.argv[2:3]))
