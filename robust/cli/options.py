"""Arguments and options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from nlfrf._base.arguments import require_positive

CONTROLLER_FILES = (
    "from 'robust design', matrices saved by MATLAB (.mat), or a PID with notches (.toml)"
)
ModelFile = Annotated[Path, typer.Argument(help="Model from 'robust model'.")]
ControllerFile = Annotated[Path, typer.Argument(help=f"Controller: {CONTROLLER_FILES}.")]
Out = Annotated[Path, typer.Option("--out", "-o", help="File to write (.json).")]
Picture = Annotated[Path | None, typer.Option(help="Picture to write (.png, .pdf, .svg).")]
Delay = Annotated[
    float | None, typer.Option(help="Computation delay [s]; default: that of the controller file.")
]
LoopSampleTime = Annotated[
    float, typer.Option(help="Sampling time [s] of the controller; 0 for continuous.")
]

#: A demand on S, of which the bandwidth makes the performance weight.
Bandwidth = Annotated[float | None, typer.Option(help="Performance: required bandwidth of S [Hz].")]
Peak = Annotated[float, typer.Option(help="Performance: largest allowed |S|.")]
ErrorAtZero = Annotated[float, typer.Option(help="Performance: largest |S| at zero frequency.")]

#: Signals that act on a loop, from which its level is predicted.
StepHeight = Annotated[
    float | None,
    typer.Option("--reference-step", help="Level of the loop: height of a step of the reference."),
]
DisturbanceRms = Annotated[
    float | None,
    typer.Option("--disturbance", help="Level of the loop: rms of white noise at the plant input."),
]
NoiseRms = Annotated[
    float | None,
    typer.Option("--noise", help="Level of the loop: rms of white noise of the sensor."),
]
NoiseBand = Annotated[
    float | None,
    typer.Option(
        "--up-to",
        help=(
            "Level of the loop: highest frequency of the noise [Hz]; needed for a continuous loop."
        ),
    ),
]


def require_demand(bandwidth: float | None, error: float) -> None:
    """Refuse a demand on S that is not positive, with the names of its options."""
    require_positive("--error", error)
    if bandwidth is not None:
        require_positive("--bandwidth", bandwidth)
