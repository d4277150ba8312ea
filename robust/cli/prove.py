"""The command `robust prove`: a loop with every friction of a class."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from nlfrf._base.command import Json, Resample, finish_command, printer, spinner
from nlfrf._base.files import command_signature, require_writable, write_text
from robust._base.options import (
    Discard,
    Period,
    PlayedDesign,
    Reference,
    SamplingFrequency,
)
from robust._base.states import FrictionVerdict
from robust.cli.options import ControllerFile, Delay


def prove(
    machine: Annotated[
        list[Path],
        typer.Argument(
            help="Model from 'robust model', or BLAs or records at three levels or more."
        ),
    ],
    controller: ControllerFile,
    stiffness: Annotated[
        float | None,
        typer.Option(
            help="Presliding stiffness of the friction [N/m]; default: read from the levels."
        ),
    ] = None,
    nominal: Annotated[
        Path | None,
        typer.Option(
            help="With BLAs: model of one level, for a machine that is flexible or has a delay."
        ),
    ] = None,
    free: Annotated[
        bool, typer.Option("--free", help="With records: the machine has no spring to ground.")
    ] = False,
    masses: Annotated[
        int,
        typer.Option(help="2: with records, a motor and a load, which takes up to half a minute."),
    ] = 1,
    stiction: Annotated[float, typer.Option(help="Largest over smallest force of a slider.")] = 1.5,
    delay: Delay = None,
    force: Annotated[
        float | None,
        typer.Option(
            help=(
                "Largest friction force [N], for a bound of the hunting or a kick that"
                " destabilises."
            )
        ),
    ] = None,
    input: Annotated[
        str | None, typer.Option("--input", help="Name of the force in traces; default: u.")
    ] = None,
    output: Annotated[
        str | None, typer.Option("--output", help="Name of the position in traces; default: y.")
    ] = None,
    reference: Reference = None,
    fs: SamplingFrequency = None,
    period: Period = None,
    discard: Discard = 0,
    resample: Resample = False,
    design: PlayedDesign = None,
    hold: Annotated[
        str | None, typer.Option(help="Force between its samples: zoh or band-limited.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", help="Result to write (.txt), with its certificates beside it."
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Prove that a machine comes to rest with every friction of a class, or find a friction with
    which it does not.

    Exit code 0: proved for every machine. Exit code 1: not proved.
    """
    from robust.friction.proof.prove import prove_all
    from robust.io.certificates import certificate_path
    from robust.reports.command import load_loops
    from robust.reports.prove import MachineFiles, read_basis, save_proofs

    if out is not None:
        require_writable(*(certificate_path(out, number) for number in range(2)))
    [(K, late)] = load_loops([controller], delay)
    named = {
        "u": input,
        "y": output,
        "r": reference,
        "fs": fs,
        "n_samples": period,
        "design": design,
        "hold": hold,
    }
    named |= {"n_discard": discard or None, "resample": resample or None}
    load = {name: option for name, option in named.items() if option is not None}
    given = MachineFiles(
        files=tuple(machine),
        controller=controller,
        nominal=nominal,
        stiffness=stiffness,
        stiction=stiction,
        free=free,
        masses=masses,
        load=load,
    )
    basis = read_basis(given)
    with spinner("proving"):
        proofs = prove_all(basis.machines, K, basis.friction, delay=late, Fs=force)
    text = f"{basis}\n" + "\n\n".join(map(str, proofs))
    say = printer(json)
    say(text)
    if out is not None:
        write_text(out, f"{text}\n\n{command_signature('robust prove')}\n")
        save_proofs(proofs, out, basis)
    finish_command(proofs, all(proof.verdict is FrictionVerdict.PROVED for proof in proofs), json)
