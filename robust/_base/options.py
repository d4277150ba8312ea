"""Options that several commands share for reading a trace."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Reference = Annotated[str | None, typer.Option(help="Name of the signal added to the loop, if the drive was on.")]
SamplingFrequency = Annotated[float | None, typer.Option(help="Sampling frequency [Hz]; from the file when not given.")]
Period = Annotated[int | None, typer.Option(help="Samples in one period; found when not given.")]
Discard = Annotated[int, typer.Option(help="Periods to leave out at the start.")]
Resample = Annotated[bool, typer.Option("--resample", help="Cut the periods where the input shows they begin.")]
PlayedDesign = Annotated[Path | None, typer.Option(help="The excitation, as 'nlfrf design' wrote it.")]
