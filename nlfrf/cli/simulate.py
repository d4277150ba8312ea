"""The command `nlfrf simulate`: a multisine through the built-in rig."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

import nlfrf
from nlfrf._base.arguments import format_count, require_nonnegative
from nlfrf._base.command import Decimal, progress_display
from nlfrf._base.values import ArrayField
from nlfrf.cli.options import Out
from nlfrf.io.designs import load_design


def simulate(
    file: Annotated[Path, typer.Argument(help="Multisine from 'nlfrf design'.")],
    out: Out,
    periods: Annotated[int, typer.Option(help="Periods to keep.")] = 2,
    discard: Annotated[int, typer.Option(help="Periods to leave out at the start.")] = 2,
    mass: Annotated[
        float | None, typer.Option(help="Mass [kg]; default: 1, as in the paper.")
    ] = None,
    stiffness: Annotated[
        float | None, typer.Option(help="Stiffness [N/m]; default: 80000, as in the paper.")
    ] = None,
    noise: Annotated[
        float, typer.Option(help="Standard deviation of white noise added to the position [m].")
    ] = 0.0,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed of the noise.")] = None,
    oversampling: Annotated[int, typer.Option(help="Integration steps per sample.")] = 1,
    resume: Annotated[
        Path | None,
        typer.Option(help="Folder for finished realisations, to resume an interrupted run."),
    ] = None,
    decimal: Decimal = ".",
) -> None:
    """Run a multisine through the built-in rig: a mass on a spring with friction; force [N] in,
    position [m] out.

    A multisine with two inputs runs a stage of two coupled axes with friction.
    """
    ms = load_design(file)
    several = not ms.is_single
    if several and (mass is not None or stiffness is not None):
        raise ValueError(
            "mass and stiffness must be left out for two inputs: the stage of two axes has its own,"
            " got one"
        )
    if several:
        rig = nlfrf.rig.two_axis_stage()
    else:
        rig = nlfrf.paper_rig()
    changed: dict[str, ArrayField] = {
        name: x for name, x in (("mass", mass), ("stiffness", stiffness)) if x is not None
    }
    rig = replace(rig, **changed)
    noise = require_nonnegative("noise", noise)
    with progress_display("simulating") as advance:
        record = nlfrf.simulate(
            rig,
            ms,
            n_periods=periods,
            n_discard=discard,
            oversampling=oversampling,
            resume=resume,
            progress=advance,
        )
    if noise > 0:
        record = replace(
            record, y=record.y + noise * np.random.default_rng(seed).standard_normal(record.y.shape)
        )
    nlfrf.save(record, out, decimal=decimal)
    runs = format_count(ms.phase.shape[-2], "experiment" if several else "realisation")
    print(f"{runs} x {record.n_periods} periods x {record.n_samples} samples")
