"""The command `robust prove-schedule`: a scheduled loop while its operating point moves."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

import robust
from nlfrf._base.command import Json, finish_command, parse_number, printer, spinner
from robust.cli.options import Delay


def prove_schedule(
    bla: Annotated[
        list[Path], typer.Argument(help="BLAs of 'nlfrf identify', one at each operating point.")
    ],
    controller: Annotated[
        list[Path],
        typer.Option(
            help="Controller at each operating point, with states that mean the same; or one for"
            " all, also a transfer function."
        ),
    ],
    at: Annotated[str, typer.Option(help="Operating points, increasing: -0.2,0,0.2")],
    rate: Annotated[
        float, typer.Option(help="Largest rate of the operating point, per second; inf: it jumps.")
    ],
    poles: Annotated[int, typer.Option(help="Number of poles at each operating point.")],
    degree: Annotated[int, typer.Option(help="Degree of the polynomials of the plant.")] = 2,
    form: Annotated[
        str | None, typer.Option(help="Form of the set, as of one input: multiplicative (default).")
    ] = None,
    order: Annotated[int | None, typer.Option(help="Order of the weight.")] = None,
    gain: Annotated[str, typer.Option(help="S or GS: prove its gain too.")] = "",
    level: Annotated[float | None, typer.Option(help="Level of that gain.")] = None,
    over: Annotated[str, typer.Option(help="Name of the operating point.")] = "position",
    unit: Annotated[str, typer.Option(help="Its unit.")] = "m",
    delay: Delay = None,
    limit: Annotated[
        bool, typer.Option(help="Search the largest provable rate, and one that breaks it.")
    ] = True,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Certificate to write (.json).")
    ] = None,
    json: Json = False,
) -> None:
    """Prove that a scheduled loop stays stable while its operating point moves; exit code 0 where
    it is proved.
    """
    points = [parse_number("--at", part) for part in at.split(",")]
    from robust.io.models import load_bla
    from robust.reports.command import load_loops, require_own_states

    loops = load_loops(controller, delay)
    dt, late = float(loops[0][0].dt or 0.0), loops[0][1]
    delays = sorted({one for _, one in loops})
    if len(delays) > 1:
        raise ValueError(
            "controller must have one computation delay at all operating points, got"
            f" {delays[0]:g} and {delays[-1]:g} s: give --delay"
        )
    if len(loops) > 1:
        require_own_states(controller)
    named: dict[str, Any] = {"at": points, "over": over, "unit": unit} | (
        {} if form is None else {"form": form}
    )
    blas = [load_bla(path) for path in bla]
    with spinner("fitting"):
        plant = robust.models.interpolate(
            blas, n_poles=poles, degree=degree, dt=dt, order=order, **named
        )
    if len(loops) == 1:
        K = loops[0][0]
    else:
        K = robust.models.LpvModel.from_points([K for K, _ in loops], **named)
    with spinner("proving"):
        proof = robust.prove_schedule(
            plant, K, rate=rate, delay=late, gain=gain, level=level, limit=limit
        )
    printer(json)(f"{plant}\n{proof}")
    if out is not None and proof.holds:
        robust.save(proof, out)
    finish_command(proof, proof.holds, json)
