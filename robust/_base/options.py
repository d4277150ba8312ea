"""Options for reading a trace, shared by several commands."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Reference = Annotated[
    str | None, typer.Option(help="Name of the signal added to the loop, if the drive was on.")
]
SamplingFrequency = Annotated[
    float | None, typer.Option(help="Sampling frequency [Hz]; default: from the file.")
]
Period = Annotated[
    int | None, typer.Option(help="Samples in one period; default: found in the input.")
]
Discard = Annotated[int, typer.Option(help="Periods to leave out at the start.")]
PlayedDesign = Annotated[Path | None, typer.Option(help="The excitation, from 'nlfrf design'.")]
