"""The command `nlfrf identify`: the best linear approximation of a measured record."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from csv import reader as csv_reader
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

import nlfrf
from nlfrf._base.command import Decimal, Json, Resample, finish_command, printer, require_left_out
from nlfrf._base.files import MULTIRECORD_KINDS, require_writable, stated_kind
from nlfrf._base.values import wrap_lines
from nlfrf.cli.options import Out
from nlfrf.io.records import ReadOptions
from nlfrf.io.results import load_own

_MAX_HOLD_TURN = 3.0  # [deg] turn of the phase by an unknown hold that is not mentioned
#: `nlfrf.identify` with its options: a Bla for one record, a list for several.
Identify = Callable[..., Any]

#: How the file is read.
_Inputs = Annotated[
    list[str] | None,
    typer.Option(
        "--input",
        help=("Name of the input; default: u. Several: repeat the option, or put commas between."),
    ),
]
_Outputs = Annotated[
    list[str] | None,
    typer.Option("--output", help="Name of the output; default: y. Several: as for --input."),
]
_References = Annotated[
    list[str] | None,
    typer.Option(
        help="Name of the reference, for a closed loop or a noisy input; one for each input."
    ),
]
_Units = Annotated[
    list[str] | None,
    typer.Option(help="Units of the inputs, then of the outputs, if the file has none: N,m."),
]
_PlayedDesign = Annotated[
    Path | None, typer.Option(help="The excitation, from 'nlfrf design' (.npz, .h5).")
]
_Hold = Annotated[str | None, typer.Option(help="Input between its samples: zoh or band-limited.")]
_SamplingFrequency = Annotated[
    float | None, typer.Option(help="Sampling frequency [Hz]; default: from the file.")
]
_Period = Annotated[
    int | None, typer.Option(help="Samples in one period; default: found in the input.")
]
_Discard = Annotated[int, typer.Option(help="Periods to leave out at the start.")]
_Starts = Annotated[
    list[float] | None,
    typer.Option(help="Start of the part to use [s after the first row]; may be repeated."),
]
_Stops = Annotated[
    list[float] | None,
    typer.Option(help="End of this part; each --start with its --stop is a realisation."),
]


def identify(
    file: Annotated[
        list[Path],
        typer.Argument(
            help=(
                "Measured record (see 'nlfrf inspect'); several files are realisations of one"
                " experiment."
            )
        ),
    ],
    out: Out,
    input: _Inputs = None,
    output: _Outputs = None,
    reference: _References = None,
    units: _Units = None,
    design: _PlayedDesign = None,
    hold: _Hold = None,
    fs: _SamplingFrequency = None,
    period: _Period = None,
    discard: _Discard = 0,
    resample: Resample = False,
    start: _Starts = None,
    stop: _Stops = None,
    transient: Annotated[
        str, typer.Option(help="Removal of the transient: auto, none, discard or local.")
    ] = "auto",
    level_from: Annotated[
        str, typer.Option(help="Source of the distortion variance: auto, detection or roughness.")
    ] = "auto",
    detection: Annotated[
        int,
        typer.Option(
            help="Number of detection lines to average for the distortion on one excited line."
        ),
    ] = 6,
    opinion: Annotated[
        bool,
        typer.Option(
            "--opinion",
            help=(
                "Compare two estimates of the distortion: from detection lines, and from the"
                " scatter of G."
            ),
        ),
    ] = False,
    csv: Annotated[
        bool, typer.Option("--csv", help="Also write a table: mid-bla.csv for mid.npz.")
    ] = False,
    decimal: Decimal = ".",
    json: Json = False,
) -> None:
    """Identify the best linear approximation, distortion level and bound from a measured record.

    With several outputs each has its own file: bla.npz becomes bla-OUTPUT.npz. Several inputs give
    a matrix in one file, or its table (.csv); each FILE is then one experiment.
    """
    inputs = _split_names(input or ["u"])
    outputs = _split_names(output or ["y"])
    references = _split_names(reference or [])
    how = partial(nlfrf.identify, transient=transient, level_from=level_from, n_detection=detection)
    if opinion:
        another = partial(nlfrf.second_opinion, transient=transient, n_detection=detection)
    else:
        another = None
    cut: ReadOptions = {
        "fs": fs,
        "n_samples": period,
        "n_discard": discard,
        "resample": resample,
        "design": design,
        "hold": hold,
        "start": start,
        "stop": stop,
    }
    if input is None:
        kind = stated_kind(file[0], file[0].suffix.lower())
    else:
        kind = None
    if len(inputs) > 1 or kind in MULTIRECORD_KINDS:
        if opinion:
            raise ValueError(
                "--opinion must be left out for several inputs, got it with"
                f" {', '.join(input or [file[0].name])}"
            )
        u, y = inputs if input else None, outputs if input or output else None
        record = _with_units(
            nlfrf.load_record(file, u=u, y=y, r=references, **cut), _split_names(units or [])
        )
        _identify_matrix(record, how, out=out, csv=csv, json=json, decimal=decimal)
        return
    if design is not None and isinstance(found := load_own(design), nlfrf.signals.AxisExperiment):
        given: dict[str, object] = {"period": period, "discard": discard, "resample": resample}
        given |= {"reference": references, "start": start, "stop": stop}
        require_left_out({**given, "opinion": opinion, "units": units})
        names = (
            (inputs if input else ["force set point"])[0],
            (outputs if output else ["position"])[0],
        )
        _identify_experiment(
            found, file, names=names, fs=fs, how=how, out=out, csv=csv, json=json, decimal=decimal
        )
        return
    targets = _output_paths(out, outputs)
    require_writable(*targets, *map(_table_path, targets * csv))
    records = nlfrf.load_record(file, u=inputs[0], y=outputs, r=",".join(references) or None, **cut)
    if units is not None:
        records = _with_units_of_each(records, _split_names(units))
    named = dict(zip(outputs, targets, strict=True))
    _identify_each(records, how, named, opinion=another, csv=csv, json=json, decimal=decimal)


def _identify_experiment(
    experiment: nlfrf.signals.AxisExperiment,
    files: list[Path],
    *,
    names: tuple[str, str],
    fs: float | None,
    how: Identify,
    out: Path,
    csv: bool,
    json: bool,
    decimal: str,
) -> None:
    """Identify a BLA for each direction of a base motion, for each level of a ramp, or for an axis
    at rest.
    """
    records = nlfrf.io.load_trace(files, experiment, u=names[0], y=names[1], fs=fs)
    labels = list(experiment.labels)[-len(records) :]
    targets = _output_paths(out, labels)
    require_writable(*targets, *map(_table_path, targets * csv))
    _identify_each(
        list(records),
        how,
        dict(zip(labels, targets, strict=True)),
        csv=csv,
        json=json,
        decimal=decimal,
    )


def _identify_each(
    records: list[nlfrf.Record],
    how: Identify,
    targets: dict[str, Path],
    *,
    opinion: Callable[[nlfrf.Record], object] | None = None,
    csv: bool,
    json: bool,
    decimal: str,
) -> None:
    """Identify records with one input and output; write each to the file of its label, and a table
    if `csv` is set.
    """
    blas = dict(zip(targets, how(records), strict=True))
    for record, (label, bla) in zip(records, blas.items(), strict=True):
        nlfrf.save(bla, targets[label])
        printer(json)(f"{label}: {bla}{_describe_unknown_hold(bla)}")
        if opinion:
            printer(json)(opinion(record))
        if csv:
            nlfrf.export_csv(bla, _table_path(targets[label]), decimal=decimal)
    finish_command(blas, True, json)


def _identify_matrix(
    record: nlfrf.Record, how: Identify, *, out: Path, csv: bool, json: bool, decimal: str
) -> None:
    """Identify a record with several inputs; write the matrix, and a table if `csv` is set."""
    is_table = out.suffix.lower() == ".csv"
    targets = [out, *[_table_path(out)] * (csv and not is_table)]
    require_writable(*targets)
    frm = how(record)
    printer(json)(f"{frm}{_describe_unknown_hold(frm)}")
    for target in targets:
        if target.suffix.lower() == ".csv":
            nlfrf.export_csv(frm, target, decimal=decimal)
        else:
            nlfrf.save(frm, target)
    finish_command(frm, True, json)


def _describe_unknown_hold(bla: nlfrf.Bla) -> str:
    """Return a line on a hold that is unknown and that would turn the phase of the last lines;
    empty otherwise.
    """
    last = float(bla.f[-1])
    turn = 180 * last / bla.fs if bla.fs else 0.0  # a hold delays by half a sample
    if bla.hold != "unknown" or turn < _MAX_HOLD_TURN:
        return ""
    return wrap_lines(
        "\nhold unknown: if u is the command of a converter, G includes its hold, which turns the"
        f" phase by -{turn:.3g} deg at {last:.4g} Hz. Give --hold zoh then, or --hold band-limited"
        " if u was measured behind the converter"
    )


def _table_path(out: Path) -> Path:
    """Return the path for the table of a result: mid-bla.csv for mid.npz, because mid.csv may be
    the measurement.
    """
    return out.with_name(
        f"{out.stem}.csv"
        if out.stem == "bla" or out.stem.endswith("-bla")
        else f"{out.stem}-bla.csv"
    )


def _with_units(record: nlfrf.Record, units: list[str]) -> nlfrf.Record:
    """Return a record with these units, inputs first; refuse a unit that differs from that of the
    file.
    """
    names, stated = record.inputs + record.outputs, record.input_units + record.output_units
    if not units:
        return record
    if len(units) != len(names):
        raise ValueError(
            f"--units must be one for each of {', '.join(names)}, got {', '.join(units)}"
        )
    for name, known, unit in zip(names, stated, units, strict=True):
        if known not in ("", unit):
            raise ValueError(
                f"--units must be those of the file, which has {known} for {name}, got {unit}"
            )
    n = record.n_inputs
    return replace(record, input_units=tuple(units[:n]), output_units=tuple(units[n:]))


def _with_units_of_each(records: Sequence[nlfrf.Record], units: list[str]) -> list[nlfrf.Record]:
    """Return records of one input and different outputs, with the unit of the input and that of
    each output.
    """
    if len(units) != len(records) + 1:
        raise ValueError(
            f"--units must be one for the input and one for each output, got {', '.join(units)}"
        )
    return [
        _with_units(record, [units[0], unit])
        for record, unit in zip(records, units[1:], strict=True)
    ]


def _output_paths(out: Path, outputs: list[str]) -> list[Path]:
    """Return a different path for each output."""
    parts = [re.sub(r"[^\w.-]+", "_", name).strip("_") for name in outputs]  # of names of files
    targets = [
        out if len(parts) == 1 else out.with_name(f"{out.stem}-{part}{out.suffix}")
        for part in parts
    ]
    if len(set(targets)) < len(targets):
        twice = next(target for target in targets if targets.count(target) > 1)
        alike = [
            repr(name) for name, target in zip(outputs, targets, strict=True) if target == twice
        ]
        raise ValueError(
            f"--output must be names that give different files, got {', '.join(alike)}, "
            f"which give the same file, {twice.name}"
        )
    return targets


def _split_names(given: list[str]) -> list[str]:
    """Split names at commas; a name that contains a comma is in quotes, as in a table."""
    return [
        name for text in given for name in next(csv_reader([text], skipinitialspace=True)) or [text]
    ]
