"""The command `robust check`: controllers against a model."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

import robust
from nlfrf._base.arguments import require_positive
from nlfrf._base.axes import write_pictures
from nlfrf._base.command import Json, finish_command, printer, spinner
from nlfrf._base.files import require_writable
from robust.cli.options import (
    CONTROLLER_FILES,
    Bandwidth,
    Delay,
    DisturbanceRms,
    ErrorAtZero,
    ModelFile,
    NoiseBand,
    NoiseRms,
    Picture,
    StepHeight,
    require_demand,
)


def check(
    model: ModelFile,
    controller: Annotated[list[Path], typer.Argument(help=f"Controllers: {CONTROLLER_FILES}.")],
    delay: Delay = None,
    bandwidth: Bandwidth = None,
    peak: Annotated[
        float,
        typer.Option(
            help="Largest |S| over the set without a warning; with --bandwidth it is required."
        ),
    ] = 2.0,
    error: ErrorAtZero = 1e-2,
    no_certify: Annotated[
        bool, typer.Option("--no-certify", help="Check on a grid only, without proof.")
    ] = False,
    proof: Annotated[
        str,
        typer.Option(
            help=(
                "Proof of a single loop: exact, lmi (a matrix from cvxpy, verified exactly) or"
                " both."
            )
        ),
    ] = "exact",
    solver: Annotated[
        str | None,
        typer.Option(help="CLARABEL or SCS, for --proof lmi and several channels; default: both."),
    ] = None,
    reference_step: StepHeight = None,
    disturbance: DisturbanceRms = None,
    noise: NoiseRms = None,
    up_to: NoiseBand = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Report to write (.txt), with its certificate beside it."),
    ] = None,
    picture: Picture = None,
    json: Json = False,
) -> None:
    """Check controllers against a model: nominal stability, the whole set, and a proof over all
    frequencies.

    Exit code 0: every loop is proved stable with the whole set, and the demand, if there is one, is
    met. Exit code 1: not so. A warning of thin margins, |S| above --peak over the set, does not
    change the exit code. With several controllers each has its own files: report.txt becomes
    report-CONTROLLER.txt.
    """
    require_demand(bandwidth, error)
    if len({path.stem for path in controller}) < len(controller):
        raise ValueError(
            f"controller must be files of different names, got {', '.join(map(str, controller))}"
        )
    several = len(controller) > 1
    files = {
        path: [_controller_file(path, one, several) for one in (out, picture)]
        for path in controller
    }
    require_writable(*(one for pair in files.values() for one in pair if one is not None))
    from robust.io.certificates import certificate_path
    from robust.io.models import load_model
    from robust.reports.command import (
        check_pictures,
        demand_weight,
        format_gains_of,
        load_loops,
        signals_from_options,
        write_report_files,
    )

    require_writable(
        *(certificate_path(report) for report, _ in files.values() if report is not None)
    )
    plant, say, reports = load_model(model), printer(json), {}
    w_P = demand_weight(plant, bandwidth, peak, error)
    signals = signals_from_options(reference_step, disturbance, noise, up_to)
    for path, (K, late) in zip(
        controller, load_loops(controller, delay, plant.origin.unit), strict=True
    ):
        with spinner("checking"):
            report = robust.check(
                plant,
                K,
                w_P=w_P,
                delay=late,
                certify=not no_certify,
                proof=proof,  # type: ignore[arg-type]
                solver=solver,
                signals=signals,
            )
        report = replace(report, peak=require_positive("peak", peak))
        gains = format_gains_of(path, K, plant.origin.unit)
        say(f"{path}:\n{report}{gains}\n" if several else f"{report}{gains}")
        text, drawing = files[path]
        if text is not None:
            write_report_files(report, text, say)
        if drawing is not None:
            write_pictures(drawing, check_pictures(plant, K, report))
        reports[str(path)] = report
    good = all(
        r.proofs.robustly_stable and (r.proofs.robust_performance or w_P is None)
        for r in reports.values()
    )
    finish_command(reports, good, json)


def _controller_file(controller: Path, out: Path | None, several: bool) -> Path | None:
    """Return the file for one of several controllers."""
    if several and out is not None:
        return out.with_stem(f"{out.stem}-{controller.stem}")
    return out
