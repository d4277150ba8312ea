"""Proofs near the limit: what `check` proves of random loops whose largest rs is known to be just
below or above one.

python -m benchmarks.near_limit 20 --write old.json       # 20 loops a cell; verdicts are kept
python -m benchmarks.near_limit 20 --against old.json     # verdicts side by side with those that were kept

A cell is a kind of loop (continuous, behind a delay, discrete, sampled) with a form of uncertainty
or, as the sixth, with an operator set. The largest rs is 0.9 to 0.999 or 1.001 to 1.1; every second
loop below one has a performance weight with the same of rp. The draw does not look at proofs, so
two versions of the package see the same loops.
"""

from __future__ import annotations

import argparse
import json
import time
import warnings
from pathlib import Path

import numpy as np

from robust import UncertaintyModel, check
from tests.support.random_loops import FORMS, random_case, roots, tf_response, zpk

KINDS = ("continuous", "delayed", "discrete", "sampled")
SETS = (*FORMS, "coprime", "operator")
LINES = np.array([0.5, 1.0])
MOST_TRIES = 200


def largest(rng):
    """A largest value just below one, or just above."""
    return float(rng.uniform(0.9, 0.999) if rng.random() < 0.5 else rng.uniform(1.001, 1.1))


def near_one(rng, kind, of):
    """A model, and the arguments of its check; the weight brought to its target by the margin of a
    bare check.
    """
    for _ in range(MOST_TRIES):
        case = random_case(rng, ("continuous" if kind == "delayed" else kind,))
        if not case["stable"]:
            continue
        delay = 10 ** rng.uniform(-4, -2) if kind == "delayed" else case["delay"]
        form = str(rng.choice(FORMS[:2])) if of == "operator" else of
        w = case["w"]
        if (
            kind == "sampled" and form == "additive" and w.D[0, 0] != 0
        ):  # else it reaches the sampler without a bound
            w = w * zpk([], roots(rng, 1), 10.0)
        class_of = "operator" if of == "operator" else "LTI"

        def model(w, G=case["G"], form=form, class_of=class_of):
            radius = 0.5 * np.abs(tf_response(w, LINES))
            return UncertaintyModel(G, w, form, LINES, radius, perturbation=class_of)

        rs, rp = largest(rng), largest(rng)
        performance, w_P = rng.random() < 0.5, zpk(roots(rng, 1), roots(rng, 1), 1.0)
        try:
            bare = check(model(w * 1e-3), case["K"], delay=delay, certify=False)
            if not bare.nominally_stable or not 1e-6 < bare.margins.rs < 1e6:
                continue
            there = model(w * (1e-3 * bare.margins.rs * rs))
            more = {"delay": delay}
            if performance and rs < 1:
                top = (
                    check(
                        there, case["K"], delay=delay, w_P=w_P * 1e-9, certify=False
                    ).curves.rp.max()
                    * 1e9
                )
                more["w_P"] = w_P * (rp / top)
        except ValueError:  # a weight that reaches one in a coprime form holds every plant
            continue
        return there, case["K"], more, rs, rp if "w_P" in more else np.nan
    raise RuntimeError(f"no {kind} loop of the form {of}")


def run(n):
    """Verdict, outcomes of the certificates, margin and seconds of `n` checks of every cell."""
    found = {}
    for number, (kind, of) in enumerate((kind, of) for kind in KINDS for of in SETS):
        if (kind, of) == ("sampled", "coprime"):  # its set is that of the sampled plant
            continue
        for k in range(n):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                model, K, more, rs, rp = near_one(np.random.default_rng([0, number, k]), kind, of)
                begin = time.process_time()
                report = check(model, K, **more)
                seconds = time.process_time() - begin
            found[f"{kind} {of} {k}"] = {
                "rs": rs,
                "rp": rp,
                "verdict": str(report.verdict),
                "certificates": [
                    f"{c.subject}: {c.outcome}, {c.method or c.reason}"
                    for c in report.proofs.certificates
                ],
                "outcomes": [str(c.outcome) for c in report.proofs.certificates],
                "margin": report.margins.rs,
                "seconds": seconds,
            }
        cell = [found[f"{kind} {of} {k}"] for k in range(n)]
        wrong = sum(one["rs"] > 1 and one["verdict"] == "robust" for one in cell)
        wrong += sum(one["rp"] > 1 and "holds" in one["outcomes"][1:] for one in cell)
        refused = [one for one in cell if one["rs"] < 1 and "holds" not in one["outcomes"][:1]]
        refused += [one for one in cell if one["rp"] < 1 and "holds" not in one["outcomes"][1:]]
        took = [one["seconds"] for one in cell]
        print(
            f"{kind:10s} {of:22s} proved above the limit {wrong}, not proved below it"
            f" {len(refused)} of {n}; {np.median(took):.3f} s, {max(took):.2f} s at most",
            flush=True,
        )
    return found


def compare(old, new):
    """Print every loop of which the verdict or an outcome is another one, and the seconds of
    both.
    """
    common = [name for name in new if name in old]
    for name in common:
        one, other = old[name], new[name]
        if (one["verdict"], one["outcomes"]) != (other["verdict"], other["outcomes"]):
            print(
                f"{name}, rs {other['rs']:.5f}, rp {other['rp']:.5f}: {one['verdict']} ->"
                f" {other['verdict']}"
            )
            print(f"    {one['certificates']}\n -> {other['certificates']}")
    for kind in KINDS:
        names = [name for name in common if name.startswith(kind)]
        took = [np.array([found[name]["seconds"] for name in names]) for found in (old, new)]
        print(
            f"{kind}: median {np.median(took[0]):.3f} -> {np.median(took[1]):.3f} s, most"
            f" {took[0].max():.2f} ->",
            end="",
        )
        print(f" {took[1].max():.2f} s")


def main():
    """Run, print, keep and compare."""
    parser = argparse.ArgumentParser()
    parser.add_argument("n", type=int, nargs="?", default=20)
    parser.add_argument("--write", type=Path)
    parser.add_argument("--against", type=Path)
    asked = parser.parse_args()
    found = run(asked.n)
    if asked.write:
        asked.write.write_text(json.dumps(found, indent=1))
    if asked.against:
        compare(json.loads(asked.against.read_text()), found)


if __name__ == "__main__":
    main()
