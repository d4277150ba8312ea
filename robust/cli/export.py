"""The command `robust export`: a model or controller for other programs and targets."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import robust
from nlfrf._base.files import require_file_of, require_writable, write_text


def export(
    file: Annotated[
        Path,
        typer.Argument(
            help=(
                "Model, controller or certificate from 'robust check --proof lmi' (.json), or a PID"
                " (.toml)."
            )
        ),
    ],
    out: Annotated[
        Path,
        typer.Option(
            "--out",
            "-o",
            help=(
                "File to write: .mat (with a loader .m), .py (python-control), .csv (sections), .h"
                " (C), .st (PLC)."
            ),
        ),
    ],
    dtype: Annotated[
        str | None,
        typer.Option(help="Code: float32 (default in C) or float64 (default in structured text)."),
    ] = None,
    limit: Annotated[
        list[float] | None,
        typer.Option(help="Code: largest |u|; given twice: smallest and largest u."),
    ] = None,
    rounded: Annotated[
        Path | None,
        typer.Option(
            help=(
                "Code: file for the controller with rounded coefficients, to check it again"
                " (.json)."
            )
        ),
    ] = None,
) -> None:
    """Write a model or controller for MATLAB (.mat), a model for python-control (.py), or a
    controller as code.

    Code of a sampled controller is C (.h), structured text (.st), or second-order sections (.csv).
    """
    is_code = out.suffix in (".h", ".st")
    if not is_code and (dtype or limit or rounded):
        raise ValueError(
            f"--dtype, --limit and --rounded must be left out except for .h and .st, got {out}"
        )
    from robust.io.models import load_model, save_controller
    from robust.reports.command import load_controller

    if is_code:
        K, late, unit = load_controller(file)
        write = robust.io.export_c if out.suffix == ".h" else robust.io.export_structured_text
        if dtype:
            given = {"dtype": dtype}
        else:
            given = {}
        if rounded:
            require_writable(rounded)
        code = write(K, out, limit=limit or None, unit=unit, **given)
        if rounded:
            save_controller(code.K, rounded, delay=late, unit=unit)
        print(code)
    elif out.suffix == ".mat":
        require_file_of(
            file,
            "robust-model",
            "robust-matrix-model",
            "robust-controller",
            "robust-mu-certificate",
        )
        robust.io.export_matlab(robust.load(file), out)
    elif out.suffix == ".py":
        robust.io.export_python(load_model(file), out)
    elif out.suffix == ".csv":
        sections = robust.io.controller_sections(load_controller(file)[0])
        if isinstance(sections, tuple):
            raise ValueError(
                f"file must be a controller with one input and output for .csv, got {len(sections)}"
                f" channels in {file}"
            )
        rows = [",".join(map(repr, row)) for row in sections.tolist()]
        write_text(out, "\n".join(["b0,b1,b2,a0,a1,a2", *rows]) + "\n")
    else:
        raise ValueError(f"out must end in .mat, .csv, .h, .st or .py, got {out}")
