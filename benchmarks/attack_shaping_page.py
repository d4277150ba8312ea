"""The shaping page against `check`, on random loops in a browser:

`python -m benchmarks.attack_shaping_page`.

Loops of every form the page takes, sampled or not, with delay: the largest difference of S, T, rs
and rp at the frequencies of the check, how often stability is told alike, and what a redraw's
arithmetic takes.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import warnings
from importlib.resources import files
from pathlib import Path

import numpy as np

import robust
from robust.analysis.loop import assemble_loop
from robust.reports.shaping_page.elements import shaped_controller
from robust.reports.shaping_page.generated_text import PartSources
from robust.reports.shaping_page.page import page_content
from tests.support.browser import browser
from tests.support.shaped_loops import random_loop

ASK = """
function asked(content, state, omega) {
  const problem = prepare(content);
  evaluate(problem, state);
  const begun = performance.now(), answer = evaluate(problem, state), took = performance.now() - begun;
  const there = shaped(problem, fixed(problem, Float64Array.from(omega)), partsOf(state, problem.dt), state.gain);
  const of = loopCurves(there, 0, problem.models[0].inverse, problem.demand), m = answer.models[0];
  const plain = values => Array.from(values, x => (Number.isFinite(x) ? x : 1e300));
  return { S: plain(of.S), T: plain(of.T), rs: plain(of.rs), rp: plain(of.rp), stable: m.stable, clear: m.clear, took };
}
0
"""


def main() -> None:
    """Print what was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--loops", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    warnings.simplefilter("ignore", robust.DesignWarning)
    worst, wrong, unclear, took = dict.fromkeys(("S", "T", "rs", "rp"), 0.0), [], 0, []
    with (
        tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder,
        browser(Path(folder)) as page,
    ):
        page.run(
            files("robust.reports.shaping_page")
            .joinpath("arithmetic.js")
            .read_text(encoding="utf-8")
            + ASK
        )
        for k in range(args.loops):
            model, w_P, begin, dt, delay, state = random_loop([args.seed, k])
            content = page_content(
                model, w_P=w_P, K=begin, dt=dt, delay=delay, sources=PartSources()
            )
            K = shaped_controller(state, 1.0 if begin is None else begin, dt)
            report = robust.check(model, K, w_P=w_P, delay=delay, certify=False)
            curves = assemble_loop(model, K, w_P=w_P, delay=delay).curves(report.curves.omega)
            found = page.run(
                f"asked({json.dumps(content)}, {json.dumps(state)},"
                f" {json.dumps(report.curves.omega.tolist())})"
            )
            safe = curves.rs < 1 - 1e-9
            for name, wanted in (
                ("S", abs(curves.S)),
                ("T", abs(1 - curves.S)),
                ("rs", curves.rs),
                ("rp", curves.rp),
            ):
                keep = safe if name == "rp" else np.ones(safe.size, bool)
                off = np.abs(np.array(found[name]) - wanted)[keep] / np.maximum(
                    1, np.abs(wanted[keep])
                )
                worst[name] = max(worst[name], float(off.max(initial=0.0)))
            unclear += not found["clear"]
            wrong += [k] if found["stable"] != report.nominally_stable else []
            took.append(found["took"])
    print(
        f"{args.loops} loops; largest difference",
        {name: f"{off:.1e}" for name, off in worst.items()},
    )
    print(f"stability told otherwise: {wrong or 'never'}; not told: {unclear}")
    print(
        f"arithmetic of a redraw: {np.median(took):.2f} ms in the median, {max(took):.1f} ms at"
        " most"
    )


if __name__ == "__main__":
    main()
