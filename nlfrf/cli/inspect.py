"""The command `nlfrf inspect`: the content of a measurement file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import nlfrf
from nlfrf._base.axes import write_pictures
from nlfrf._base.command import Json
from nlfrf._base.values import to_json
from nlfrf.io.inspection import screen_file


def inspect(
    file: Annotated[
        list[Path],
        typer.Argument(help="Measurement files of any kind that 'nlfrf identify' can read."),
    ],
    picture: Annotated[
        Path | None,
        typer.Option(
            "--plot", "--picture", help="Draw the record and its findings as .png, .pdf or .svg."
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Show the content of a measurement file, a guess at input, output and period, and the command
    to run.
    """
    if picture is not None and len(file) > 1:
        raise ValueError(f"--plot must have one file to draw, got {len(file)}")
    found = [nlfrf.inspect_file(one) for one in file]
    print(to_json(found) if json else "\n\n".join(map(str, found)))
    if picture is not None:
        from nlfrf.plot.signals import plot_screened

        screened = screen_file(file[0], found[0])
        write_pictures(
            picture, [(plot_screened, screened)], height=1.6 + 1.8 * len(screened.labels)
        )
