"""The command `robust reduce`: a controller of lower order with the same proofs."""

from __future__ import annotations

from typing import Annotated

import typer

import robust
from nlfrf._base.command import Json, finish_command, printer, spinner
from nlfrf._base.files import json_path
from robust.cli.options import (
    Bandwidth,
    ControllerFile,
    Delay,
    ErrorAtZero,
    ModelFile,
    Out,
    Peak,
    require_demand,
)


def reduce(
    model: ModelFile,
    controller: ControllerFile,
    out: Out,
    order: Annotated[
        int | None, typer.Option(help="Order to reach; default: the lowest that keeps all proofs.")
    ] = None,
    delay: Delay = None,
    bandwidth: Bandwidth = None,
    peak: Peak = 2.0,
    error: ErrorAtZero = 1e-2,
    candidates: Annotated[int, typer.Option(help="Number of reduced controllers to try.")] = 300,
    json: Json = False,
) -> None:
    """Lower the order of a controller as far as the check still proves everything that it proved
    before.

    Exit code 0: all proofs are kept. If no lower order keeps them, the controller is written
    unchanged. Exit code 1: --order loses a proof; the controller is written.
    """
    json_path(out)
    require_demand(bandwidth, error)
    from robust.io.models import load_model
    from robust.reports.command import demand_weight, load_controller, load_loops

    plant = load_model(model)
    [(K, late)] = load_loops([controller], delay, plant.origin.unit)
    w_P = demand_weight(plant, bandwidth, peak, error)
    with spinner("reducing"):
        result = robust.reduce_controller(
            K, plant, w_P, order=order, delay=late, max_candidates=candidates
        )
    # a delay of zero that was only assumed does not become a known one in the file
    known = delay is not None or load_controller(controller)[1] is not None
    robust.save(result.K, out, delay=late if known else None, unit=plant.origin.unit)
    printer(json)(result)
    finish_command(result, result.kept, json)
