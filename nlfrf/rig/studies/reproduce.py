"""The paper reproduced: its figures, and each finding with a number, written to a folder.

Figures 3 to 7 show what the paper's figures show; where its text and not its drawing says what belongs in one,
the arrangement is ours: 3 the BLA at the three levels, 4 to 6 the output on excited and detection lines for the
odd, odd-odd and special-odd grid (equations 7, 8 and 9), 7 the three grids compared.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import asdict
from functools import partial
from os import PathLike
from pathlib import Path

import numpy as np

from nlfrf._base.arguments import require_integer
from nlfrf._base.axes import save_figure
from nlfrf._base.files import Role, require_writable, write_text
from nlfrf.rig.bench.rig import paper_rig
from nlfrf.rig.bench.simulate import run_all, simulate
from nlfrf.rig.studies.ensembles import GRIDS, LEVELS, Ensembles, ensemble_spectra, paper_multisine
from nlfrf.rig.studies.figures import draw_figures
from nlfrf.rig.studies.findings import SIGNALS, Finding, judge_findings, judge_side_remarks

_FIGURES = (*(f"figure{k}" for k in range(3, 8)), "random_odd")
_OUTPUT_FILES = (*(f"{name}.png" for name in _FIGURES), "findings.json", "findings.md")


def reproduce(
    out: str | PathLike[str],
    *,
    n_realizations: int = 100,
    seed: int = 1,
    executor: Executor | None = None,
    progress: Callable[[int, int], object] | None = None,
    resume: str | PathLike[str] | None = None,
) -> list[Finding]:
    """Run the paper's experiments and write its figures and findings.

    Writes figure3.png to figure7.png, random_odd.png, findings.json and findings.md.

    Parameters
    ----------
    out : path
        Folder; made where it does not exist.
    n_realizations : int
        Realisations of each case, at least 10; the paper has 100.
    seed : int
        Of all random numbers.
    executor, progress, resume
        As for `nlfrf.simulate`; progress counts realisations over everything.

    Returns
    -------
    list of Finding

    Raises
    ------
    ValueError
        Too few realisations; a file in the place of the folder, or in it one of these names that holds something else.
    """
    m, seed = require_integer("n_realizations", n_realizations, least=10), require_integer("seed", seed, least=0)
    folder = Path(out)
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"out must be a folder, got the file {folder}")
    folder.mkdir(parents=True, exist_ok=True)
    require_writable(*(folder / name for name in _OUTPUT_FILES), role=Role.DERIVED)  # hours before they are written
    rig, rng = paper_rig(), np.random.default_rng(seed)
    total = m * (len(LEVELS) * len(GRIDS) + len(SIGNALS) + 1)
    done = 0

    def count(before: int) -> Callable[[int, int], object] | None:
        return None if progress is None else lambda now, _: progress(before + now, total)

    ensembles: Ensembles = {}
    for level in LEVELS:
        for kind in GRIDS:
            ms = paper_multisine(kind, level, n_realizations=m, rng=rng)
            record = simulate(rig, ms, executor=executor, progress=count(done), resume=resume)
            ensembles[level, kind] = ensemble_spectra(record)
            done += m
    run = partial(run_all, executor=executor, resume=resume)
    remarks = judge_side_remarks(rig, ensembles[1, "odd"], rng=rng, run=run, count=lambda before: count(done + before))
    found = [*judge_findings(ensembles, rig), *remarks]
    for name, figure in draw_figures(ensembles, rig).items():
        save_figure(folder / f"{name}.png", figure, dpi=110, role=Role.DERIVED)
    content = {
        "schema": "nlfrf-findings",
        "n_realizations": m,
        "seed": seed,
        "findings": [asdict(finding) for finding in found],
    }
    write_text(folder / "findings.json", json.dumps(content, indent=2) + "\n", role=Role.DERIVED)
    write_text(folder / "findings.md", format_table(found, m), role=Role.DERIVED)
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
        rows.append(f"| {finding.name} | {finding.claim} | {finding.paper} | {ours} | {finding.criterion} | {yes} |")
    notes = [f"- {finding.name}: {finding.remark}" for finding in found if finding.remark]
    return "\n".join(
        [*rows, "", "## Where and why ours differs", "", *notes, "", "<!-- written by 'nlfrf reproduce' -->", ""]
    )
