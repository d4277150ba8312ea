"""The command `robust verify`: the proof of a certificate, repeated."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import robust
from nlfrf._base.command import Json, finish_command, printer, spinner


def verify(
    file: Annotated[
        Path,
        typer.Argument(
            help="Certificate from 'robust check' or 'robust prove' (.certificate.json)."
        ),
    ],
    model: Annotated[
        Path | None, typer.Option(help="Model that must be the one in the certificate.")
    ] = None,
    controller: Annotated[
        Path | None, typer.Option(help="Controller that must be the one in the certificate.")
    ] = None,
    seconds: Annotated[
        float, typer.Option(help="Processor time [s] after which the rest counts as not verified.")
    ] = 60.0,
    json: Json = False,
) -> None:
    """Prove a certificate again, with all rounding outward (exit code 1: a claim is not proved)."""
    from robust.io.models import load_model
    from robust.reports.command import load_controller

    if model is None:
        plant = None
    else:
        plant = load_model(model)
    if controller is None:
        K = None
    else:
        K = load_controller(controller)[0]
    with spinner("verifying"):
        found = robust.io.verify_certificate(file, model=plant, K=K, time_cap=seconds)
    printer(json)(f"{found}\n{'VERIFIED' if found.verified else 'NOT VERIFIED'}")
    finish_command(found, found.verified, json)
