"""The paper on the impact of friction on FRF measurements, repeated: its figures, and each finding
with a number.

    python examples/paper/reproduce.py --out paper                      100 realisations of each level and grid
    python examples/paper/reproduce.py --out paper --resume unfinished  keeps finished realisations in a folder

Figures 3 to 7 show what the paper's figures show; where its text and not its drawing says what
belongs in one, the arrangement is ours: 3 the BLA at the three levels, 4 to 6 the output on excited
and detection lines for the odd, odd-odd and special-odd grid (equations 7, 8 and 9), 7 the three
grids compared.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from dataclasses import asdict
from os import PathLike
from pathlib import Path

import numpy as np
from ensembles import GRIDS, LEVELS, Ensembles, ensemble_spectra, paper_multisine
from figures import draw_figures
from findings import SIGNALS, Finding, judge_findings, judge_side_remarks

import nlfrf


def reproduce(
    out: str | PathLike[str],
    *,
    n_realizations: int = 100,
    seed: int = 1,
    progress: Callable[[int, int], object] | None = None,
    resume: str | PathLike[str] | None = None,
) -> list[Finding]:
    """Run the paper's experiments, and write its figures and findings to a folder.

    n_realizations : of each level and grid, at least 10; the paper has 100.
    progress : called with the realisations done and their total.
    resume : folder that keeps finished realisations of the multisines, as for `nlfrf.simulate`.
    """
    if n_realizations < 10:
        raise ValueError(f"n_realizations must be at least 10, got {n_realizations}")
    folder = Path(out)
    if folder.exists() and not (folder.is_dir() and not any(folder.iterdir())):
        raise ValueError(f"out must be a new or an empty folder, got {folder}")
    rig, rng = nlfrf.paper_rig(), np.random.default_rng(seed)
    total, n_done = n_realizations * (len(LEVELS) * len(GRIDS) + len(SIGNALS) + 1), 0

    def done(n: int = 1) -> None:
        nonlocal n_done
        n_done += n
        if progress:
            progress(n_done, total)

    ensembles: Ensembles = {}
    for level in LEVELS:
        for kind in GRIDS:
            ms = paper_multisine(kind, level, n_realizations=n_realizations, rng=rng)
            ensembles[level, kind] = ensemble_spectra(nlfrf.simulate(rig, ms, resume=resume))
            done(n_realizations)
    found = [
        *judge_findings(ensembles, rig),
        *judge_side_remarks(rig, ensembles[1, "odd"], rng=rng, done=done),
    ]
    folder.mkdir(parents=True, exist_ok=True)
    for name, figure in draw_figures(ensembles, rig).items():
        figure.savefig(folder / f"{name}.png", dpi=110)
    content = {
        "n_realizations": n_realizations,
        "seed": seed,
        "findings": [asdict(finding) for finding in found],
    }
    (folder / "findings.json").write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    (folder / "findings.md").write_text(format_table(found, n_realizations), encoding="utf-8")
    return found


def format_table(found: list[Finding], n_realizations: int) -> str:
    """Format the findings as a table in Markdown."""
    rows = [
        f"# Findings with {n_realizations} realisations a case",
        "",
        "| | claim | paper | ours | holds if | holds |",
        "|---|---|---|---|---|---|",
    ]
    for finding in found:
        ours = "<br>".join(f"{name}: {number:.3g}" for name, number in finding.ours.items())
        yes = "yes" if finding.holds else "**no**"
        rows.append(
            f"| {finding.name} | {finding.claim} | {finding.paper} | {ours} | {finding.criterion} |"
            f" {yes} |"
        )
    notes = [f"- {finding.name}: {finding.remark}" for finding in found if finding.remark]
    return "\n".join([*rows, "", "## Where and why ours differs", "", *notes, ""])


def main() -> None:
    """Read the command line, run, and print the findings."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--out", required=True, help="folder for the figures, findings.json and findings.md"
    )
    parser.add_argument(
        "--realizations", type=int, default=100, help="realisations of each level and grid"
    )
    parser.add_argument("--seed", type=int, default=1, help="seed of the random phases")
    parser.add_argument("--resume", help="folder that keeps finished realisations")
    given = parser.parse_args()
    found = reproduce(
        given.out,
        n_realizations=given.realizations,
        seed=given.seed,
        progress=nlfrf.progress_bar("simulating"),
        resume=given.resume,
    )
    print("\n\n".join(map(str, found)))
    print(f"{sum(finding.holds for finding in found)} of {len(found)} findings hold")


if __name__ == "__main__":
    main()
