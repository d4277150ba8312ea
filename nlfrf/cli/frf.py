"""The command `nlfrf frf`: a BLA of an FRF from another program."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import nlfrf
from nlfrf._base.command import Json, finish_command, printer
from nlfrf.cli.options import Out


def frf(
    file: Annotated[
        Path,
        typer.Argument(help="FRF from another program: table, universal file, Touchstone, array."),
    ],
    out: Out,
    relative_std: Annotated[
        float | None,
        typer.Option(
            help="Standard deviation of the FRF over |G|, from repeated sweeps: 0.1 dB is 0.012."
        ),
    ] = None,
    averages: Annotated[
        float | None,
        typer.Option(help="Number of independent averages behind the coherence, or of sweeps."),
    ] = None,
    channel: Annotated[
        str, typer.Option(help="Name of the FRF in a file with several, such as CH2.")
    ] = "",
    columns: Annotated[
        str,
        typer.Option(
            help=(
                "Meaning of the columns: 'f=col1 [Hz], re=col2 [Ohm], im=-col3 [Ohm]', or mag=,"
                " phase=."
            )
        ),
    ] = "",
    hold: Annotated[
        str, typer.Option(help="Input between its samples: zoh, band-limited, unknown.")
    ] = "unknown",
    json: Json = False,
) -> None:
    """Convert an FRF from another program to a BLA (.npz), for all commands that take one."""
    bla = nlfrf.io.load_frf(
        file,
        relative_std=relative_std,
        n_averages=averages,
        channel=channel,
        columns=columns,
        hold=hold,
    )
    nlfrf.save(bla, out)
    printer(json)(bla)
    finish_command(bla, True, json)
