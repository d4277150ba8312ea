"""Options that several commands share: how a trace is read."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Reference = Annotated[str | None, typer.Option(help="Name of what was added to the loop, where the drive was on.")]
SamplingFrequency = Annotated[float | None, typer.Option(help="Sampling frequency [Hz]; from the file when not given.")]
Period = Annotated[int | None, typer.Option(help="Samples in one period; found when not given.")]
Discard = Annotated[int, typer.Option(help="Periods to leave out at the start.")]
Resample = Annotated[bool, typer.Option("--resample", help="Cut the periods where the input shows they are.")]
PlayedDesign = Annotated[Path | None, typer.Option(help="What was played, as 'nlfrf design' wrote it.")]
