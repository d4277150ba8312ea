"""The command `robust orders`: nominal models of growing order."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

import robust
from nlfrf._base.arguments import require_positive
from nlfrf._base.axes import write_pictures
from nlfrf._base.command import parse_number, spinner
from robust.cli.options import Picture


def orders(
    bla: Annotated[
        list[Path], typer.Argument(help="BLA from 'nlfrf identify'; several make a plant family.")
    ],
    most: Annotated[int, typer.Option(help="Largest number of poles to try.")] = 8,
    relative_degree: Annotated[
        int | None, typer.Option(help="Poles minus zeros; default: 1, or a likelier number.")
    ] = None,
    delay: Annotated[
        str, typer.Option(help="Delay [s], 'estimate', or 'auto': if the phase shows one.")
    ] = "auto",
    bandwidth: Annotated[
        float | None, typer.Option(help="Crossover [Hz] of the loop for which the order is chosen.")
    ] = None,
    sample_time: Annotated[
        float, typer.Option(help="Sampling time [s] of discrete models; 0 for continuous.")
    ] = 0.0,
    picture: Picture = None,
) -> None:
    """Fit nominal models of growing order, and choose the one that a loop or the data need."""
    from robust.reports.command import load_blas

    with spinner("fitting nominal models"):
        scan = robust.models.scan_orders(
            load_blas(bla),
            n_poles=range(relative_degree or 1, most + 1),
            relative_degree=relative_degree,
            delay=delay if delay in ("estimate", "auto") else parse_number("delay", delay),
            dt=sample_time,
            omega_c=(
                None if bandwidth is None else 2 * np.pi * require_positive("bandwidth", bandwidth)
            ),
        )
    print(scan)
    if picture is not None:
        from robust.plot import plot_fit, plot_orders

        write_pictures(picture, [(plot_orders, scan), (plot_fit, scan.fit)])
