"""The command `robust shape`: a page to shape a loop by hand."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robust.cli.options import Bandwidth, Delay, ErrorAtZero, LoopSampleTime, Peak, require_demand


def shape(
    model: Annotated[
        list[Path], typer.Argument(help="Model from 'robust model'; several are shown together.")
    ],
    out: Annotated[Path, typer.Option("--out", "-o", help="Page to write (.html).")],
    controller: Annotated[
        Path | None, typer.Option(help="Controller at the start; default: made for the plant.")
    ] = None,
    sample_time: LoopSampleTime = 0.0,
    delay: Delay = None,
    bandwidth: Bandwidth = None,
    peak: Peak = 2.0,
    error: ErrorAtZero = 1e-2,
) -> None:
    """Write a page to shape a loop by hand in any browser; it needs no server and proves
    nothing.
    """
    require_demand(bandwidth, error)
    from robust.reports.command import load_loops, load_single_model, require_delay
    from robust.reports.shaping_page.command import write_from_files

    models, K, late = [load_single_model(path) for path in model], None, delay or 0.0
    if controller is not None:
        [(K, late)] = load_loops([controller], delay, models[0].origin.unit)
    require_delay(late, sample_time)
    write_from_files(
        out, models, K, (model, controller), (bandwidth, peak, error), dt=sample_time, delay=late
    )
