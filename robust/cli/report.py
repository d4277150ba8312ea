"""The command `robust report`: a whole run on one page."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

import nlfrf
import robust
from nlfrf._base.command import Resample, finish_command, spinner
from robust._base.states import FrictionVerdict
from robust.cli.options import (
    Bandwidth,
    ControllerFile,
    Delay,
    DisturbanceRms,
    ErrorAtZero,
    ModelFile,
    NoiseBand,
    NoiseRms,
    Peak,
    StepHeight,
    require_demand,
)

#: How the record is read.
_Records = Annotated[
    list[Path] | None, typer.Option("--record", help="Measured record; may be repeated.")
]
_RecordInput = Annotated[
    str | None,
    typer.Option("--input", help="Name of the input in the record; default: that of the model."),
]
_RecordOutput = Annotated[
    str | None,
    typer.Option("--output", help="Name of the output in the record; default: that of the model."),
]
_RecordReferences = Annotated[
    list[str] | None,
    typer.Option(help="Name of the reference in the record; may be repeated, one for each input."),
]
_RecordSamplingFrequency = Annotated[
    float | None,
    typer.Option(help="Sampling frequency of the record [Hz]; default: from the file."),
]
_RecordPeriod = Annotated[
    int | None,
    typer.Option(help="Samples in one period of the record; default: found in the input."),
]
_RecordDiscard = Annotated[
    int, typer.Option(help="Periods to leave out at the start of the record.")
]


def report(
    model: ModelFile,
    controller: ControllerFile,
    out: Annotated[Path, typer.Option("--out", "-o", help="Report to write (.html).")],
    bla: Annotated[
        list[Path] | None,
        typer.Option(
            "--bla",
            help="BLA behind the model; may be repeated. Default: identified from the record.",
        ),
    ] = None,
    record: _Records = None,
    input: _RecordInput = None,
    output: _RecordOutput = None,
    reference: _RecordReferences = None,
    fs: _RecordSamplingFrequency = None,
    period: _RecordPeriod = None,
    discard: _RecordDiscard = 0,
    resample: Resample = False,
    delay: Delay = None,
    bandwidth: Bandwidth = None,
    peak: Peak = 2.0,
    error: ErrorAtZero = 1e-2,
    stiffness: Annotated[
        float | None,
        typer.Option(
            help=(
                "Presliding stiffness of the friction [N/m], for a proof with friction beside the"
                " check."
            )
        ),
    ] = None,
    stiction: Annotated[
        float,
        typer.Option(help="Largest over smallest force of a slider, for the proof with friction."),
    ] = 1.5,
    force: Annotated[
        float | None,
        typer.Option(help="Largest friction force [N], for a kick after which the loop runs away."),
    ] = None,
    reference_step: StepHeight = None,
    disturbance: DisturbanceRms = None,
    noise: NoiseRms = None,
    up_to: NoiseBand = None,
    title: Annotated[str, typer.Option(help="Heading of the report.")] = "Controller report",
    notes: Annotated[str, typer.Option(help="Further text for the reader.")] = "",
) -> None:
    """Write a whole run as one HTML file: record, BLA, model, controller, check and proof.

    Exit code 0: the loop is proved stable with the whole set, and the demand and the proof with
    friction, if there are any, hold. Exit code 1: not so; the page is written.
    """
    require_demand(bandwidth, error)
    from robust.friction.proof.prove import prove_all
    from robust.io.models import load_bla, load_model
    from robust.reports.command import (
        demand_weight,
        load_loops,
        signals_from_options,
        with_units_of,
    )
    from robust.reports.prove import MachineFiles, read_basis

    plant = load_model(model)
    [(K, late)] = load_loops([controller], delay, plant.origin.unit)
    columns: dict[str, str | list[str] | None] = {
        "u": list(plant.inputs),
        "y": list(plant.outputs),
        "r": reference or None,
    }
    if plant.is_single:
        columns = {
            "u": input or plant.inputs[0],
            "y": output or plant.outputs[0],
            "r": reference[0] if reference else None,
        }
    load = partial(
        nlfrf.load_record,
        **columns,
        fs=fs,
        n_samples=period,
        n_discard=discard,
        resample=resample,
    )
    blas = [load_bla(path) for path in bla or []]
    w_P = demand_weight(plant, bandwidth, peak, error)
    proof = None
    if stiffness is not None:
        basis = read_basis(
            MachineFiles(
                files=(model,), controller=controller, stiffness=stiffness, stiction=stiction
            )
        )
        # the first proof is the weakest: the page claims what holds with each machine
        proof = prove_all(basis.machines, K, basis.friction, delay=late, Fs=force)[0]
    with spinner("checking and drawing"):
        result = robust.reports.write_report(
            out,
            plant,
            K,
            bla=blas,
            record=[with_units_of(load(path), blas) for path in record or []],
            w_P=w_P,
            delay=late,
            friction=proof,
            signals=signals_from_options(reference_step, disturbance, noise, up_to),
            title=title,
            notes=notes,
        )
    print(f"verdict: {result.headline}: {result.meaning}")
    for condition in result.conditions:
        print(f"condition: {condition}")
    if proof is not None:
        print(f"friction: {proof.verdict}")
    good = result.proofs.robustly_stable and (result.proofs.robust_performance or w_P is None)
    finish_command(
        result, good and (proof is None or proof.verdict is FrictionVerdict.PROVED), json=False
    )
