"""The command ``nlfrf``: files in, files out."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Sequence
from csv import reader as csv_reader
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

import nlfrf
from nlfrf._base.arguments import format_count, require_nonnegative
from nlfrf._base.axes import save_figure, write_pictures
from nlfrf._base.command import (
    Commands,
    Decimal,
    Json,
    Version,
    finish_command,
    printer,
    progress_display,
    require_left_out,
    run_command,
)
from nlfrf._base.files import LOAD_OPTIONS, MULTIRECORD_KINDS, require_writable, stated_kind
from nlfrf._base.values import ArrayField, to_json, wrap_lines
from nlfrf.doctor import examine
from nlfrf.io.designs import load_design
from nlfrf.io.inspection import screen_file
from nlfrf.io.measurement_files import extra_of_file
from nlfrf.io.records import ReadOptions
from nlfrf.io.results import load_own
from nlfrf.signals.lines import KINDS, grid_lines

app = Commands(
    help="Best linear approximations with a distortion bound from one multisine experiment.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # units stand in brackets
)

#: Parameters of the library whose options have other names.
_OPTIONS = LOAD_OPTIONS | {
    "n_periods": "periods",
    "n_realizations": "realizations",
    "n_log": "log-lines",
    "n_detection": "detection",
    "level_from": "level-from",
    "f_min": "f-min",
    "f_max": "f-max",
    "columns": "columns",
}
_MAX_BAND_GAP = 0.2  # share of the band that may lack lines at either end, without a warning
_MAX_HOLD_TURN = 3.0  # [deg] turn of the phase by an unknown hold that is not mentioned
_SPARSE_GRIDS = ("odd-odd", "special-odd")  # grids without some of the odd lines
Out = Annotated[Path, typer.Option("--out", "-o", help="File to write.")]
Identify = Callable[
    ..., Any
]  # `nlfrf.identify` with its options: a Bla for one record, a list for several


@app.callback()
def common(version: Version = False) -> None:
    """Best linear approximations with a distortion bound from one multisine experiment."""


@app.command()
def design(
    out: Out,
    fs: Annotated[float, typer.Option(help="Sampling frequency [Hz].")],
    period: Annotated[int, typer.Option(help="Samples in one period.")],
    f_min: Annotated[float, typer.Option(help="Lowest frequency [Hz].")],
    f_max: Annotated[float, typer.Option(help="Highest frequency [Hz].")],
    kind: Annotated[
        str, typer.Option(help=f"Harmonic grid: {', '.join(KINDS[:-1])}.")
    ] = "special-odd",
    rms: Annotated[float, typer.Option(help="Root mean square of the signal.")] = 1.0,
    log_lines: Annotated[
        int | None, typer.Option(help="Keep about this many lines, spaced logarithmically.")
    ] = None,
    crest: Annotated[
        float | None,
        typer.Option(help="Lower the crest factor to this; the phases are then not random."),
    ] = None,
    realizations: Annotated[int, typer.Option(help="Realisations, with independent phases.")] = 1,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed of the random phases.")] = None,
    hold: Annotated[
        str, typer.Option(help="Signal between its samples: zoh, band-limited or unknown.")
    ] = "unknown",
    inputs: Annotated[
        int,
        typer.Option(
            help="Number of inputs of the machine; each realisation then needs so many experiments."
        ),
    ] = 1,
    zippered: Annotated[
        bool,
        typer.Option(
            "--zippered", help="Several inputs in one experiment, each with its own lines."
        ),
    ] = False,
    draws: Annotated[
        int,
        typer.Option(
            help="Draws of the phases for several inputs; the draw with the lowest peak is kept."
        ),
    ] = 1,
    decimal: Decimal = ".",
) -> None:
    """Design a random-phase multisine, and write it with its samples: .npz, .h5, or .csv, .mat,
    .wav to play.
    """
    if inputs > 1 and crest is not None:
        raise ValueError(
            f"--crest must be left out for several inputs, got {crest:g}: lower the peaks by"
            " --draws"
        )
    if inputs <= 1 and (zippered or draws != 1):
        raise ValueError(
            f"--inputs must be 2 or more for --{'zippered' if zippered else 'draws'}, got {inputs}"
        )
    ms = nlfrf.multisine(
        kind,
        fs=fs,
        n_samples=period,
        f_min=f_min,
        f_max=f_max,
        rms=rms,
        n_log=log_lines,
        n_realizations=realizations,
        rng=seed,
        hold=hold,
        n_inputs=inputs,
        design="zippered" if zippered else "orthogonal",
        n_draws=draws,
    )
    warn_of_band(ms, kind, f_min=f_min, f_max=f_max)
    if crest is not None:
        ms = nlfrf.reduce_crest(ms, target=crest, rng=seed)
    nlfrf.save(ms, out, decimal=decimal)
    if out.suffix.lower() == ".wav":
        print(f"full scale of the WAV file is {np.abs(ms.u).max():.6g}, in the unit of --rms")
    if inputs > 1:
        several = f", {format_count(ms.phase.shape[-2], 'experiment')} with {inputs} inputs"
    else:
        several = ""
    print(
        f"{ms.kind} multisine, {ms.f.size} excited lines from {ms.f[0]:g} to {ms.f[-1]:g} Hz,"
        f" resolution {ms.f0:g} Hz, period {ms.n_samples / ms.fs:g} s, rms {np.max(ms.rms):g},"
        f" crest factor {ms.crest_factor.max():.2f}{several}"
    )


@app.command()
def simulate(
    file: Annotated[Path, typer.Argument(help="Multisine from 'nlfrf design'.")],
    out: Out,
    periods: Annotated[int, typer.Option(help="Periods to keep.")] = 2,
    discard: Annotated[int, typer.Option(help="Periods to leave out at the start.")] = 2,
    mass: Annotated[
        float | None, typer.Option(help="Mass [kg]; default: 1, as in the paper.")
    ] = None,
    stiffness: Annotated[
        float | None, typer.Option(help="Stiffness [N/m]; default: 80000, as in the paper.")
    ] = None,
    noise: Annotated[
        float, typer.Option(help="Standard deviation of white noise added to the position [m].")
    ] = 0.0,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed of the noise.")] = None,
    oversampling: Annotated[int, typer.Option(help="Integration steps per sample.")] = 1,
    resume: Annotated[
        Path | None,
        typer.Option(help="Folder for finished realisations, to resume an interrupted run."),
    ] = None,
    decimal: Decimal = ".",
) -> None:
    """Run a multisine through the built-in rig: a mass on a spring with friction; force [N] in,
    position [m] out.

    A multisine with two inputs runs a stage of two coupled axes with friction.
    """
    ms = load_design(file)
    several = not ms.is_single
    if several and (mass is not None or stiffness is not None):
        raise ValueError(
            "mass and stiffness must be left out for two inputs: the stage of two axes has its own,"
            " got one"
        )
    if several:
        rig = nlfrf.rig.two_axis_stage()
    else:
        rig = nlfrf.paper_rig()
    changed: dict[str, ArrayField] = {
        name: x for name, x in (("mass", mass), ("stiffness", stiffness)) if x is not None
    }
    rig = replace(rig, **changed)
    noise = require_nonnegative("noise", noise)
    with progress_display("simulating") as advance:
        record = nlfrf.simulate(
            rig,
            ms,
            n_periods=periods,
            n_discard=discard,
            oversampling=oversampling,
            resume=resume,
            progress=advance,
        )
    if noise > 0:
        record = replace(
            record, y=record.y + noise * np.random.default_rng(seed).standard_normal(record.y.shape)
        )
    nlfrf.save(record, out, decimal=decimal)
    runs = format_count(ms.phase.shape[-2], "experiment" if several else "realisation")
    print(f"{runs} x {record.n_periods} periods x {record.n_samples} samples")


@app.command()
def inspect(
    file: Annotated[
        list[Path],
        typer.Argument(help="Measurement files of any kind that 'nlfrf identify' can read."),
    ],
    picture: Annotated[
        Path | None,
        typer.Option(
            "--plot", "--picture", help="Draw the record and its findings as .png, .pdf or .svg."
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Show the content of a measurement file, a guess at input, output and period, and the command
    to run.
    """
    if picture is not None and len(file) > 1:
        raise ValueError(f"--plot must have one file to draw, got {len(file)}")
    found = [nlfrf.inspect_file(one) for one in file]
    print(to_json(found) if json else "\n\n".join(map(str, found)))
    if picture is not None:
        from nlfrf.plot.signals import plot_screened

        screened = screen_file(file[0], found[0])
        write_pictures(
            picture, [(plot_screened, screened)], height=1.6 + 1.8 * len(screened.labels)
        )


@app.command()
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
    input: Annotated[
        list[str] | None,
        typer.Option(
            "--input",
            help=(
                "Name of the input; default: u. Several: repeat the option, or put commas between."
            ),
        ),
    ] = None,
    output: Annotated[
        list[str] | None,
        typer.Option("--output", help="Name of the output; default: y. Several: as for --input."),
    ] = None,
    reference: Annotated[
        list[str] | None,
        typer.Option(
            help="Name of the reference, for a closed loop or a noisy input; one for each input."
        ),
    ] = None,
    units: Annotated[
        list[str] | None,
        typer.Option(help="Units of the inputs, then of the outputs, if the file has none: N,m."),
    ] = None,
    design: Annotated[
        Path | None, typer.Option(help="The excitation, from 'nlfrf design' (.npz, .h5).")
    ] = None,
    hold: Annotated[
        str | None, typer.Option(help="Input between its samples: zoh or band-limited.")
    ] = None,
    fs: Annotated[
        float | None, typer.Option(help="Sampling frequency [Hz]; default: from the file.")
    ] = None,
    period: Annotated[
        int | None, typer.Option(help="Samples in one period; default: found in the input.")
    ] = None,
    discard: Annotated[int, typer.Option(help="Periods to leave out at the start.")] = 0,
    resample: Annotated[
        bool,
        typer.Option(
            "--resample",
            help="Cut the periods where the input itself repeats, and interpolate between samples.",
        ),
    ] = False,
    start: Annotated[
        list[float] | None,
        typer.Option(help="Start of the part to use [s after the first row]; may be repeated."),
    ] = None,
    stop: Annotated[
        list[float] | None,
        typer.Option(help="End of this part; each --start with its --stop is a realisation."),
    ] = None,
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


@app.command()
def frf(
    file: Annotated[
        Path,
        typer.Argument(help="FRF from another program: table, universal file, Touchstone, array."),
    ],
    out: Out,
    relative_std: Annotated[
        float | None,
        typer.Option(
            help="Standard deviation of the FRF over |G|, from repeated sweeps: 0.1 dB is 0.012."
        ),
    ] = None,
    averages: Annotated[
        float | None,
        typer.Option(help="Number of independent averages behind the coherence, or of sweeps."),
    ] = None,
    channel: Annotated[
        str, typer.Option(help="Name of the FRF in a file with several, such as CH2.")
    ] = "",
    columns: Annotated[
        str,
        typer.Option(
            help=(
                "Meaning of the columns: 'f=col1 [Hz], re=col2 [Ohm], im=-col3 [Ohm]', or mag=,"
                " phase=."
            )
        ),
    ] = "",
    hold: Annotated[
        str, typer.Option(help="Input between its samples: zoh, band-limited, unknown.")
    ] = "unknown",
    json: Json = False,
) -> None:
    """Convert an FRF from another program to a BLA (.npz), for all commands that take one."""
    bla = nlfrf.io.load_frf(
        file,
        relative_std=relative_std,
        n_averages=averages,
        channel=channel,
        columns=columns,
        hold=hold,
    )
    nlfrf.save(bla, out)
    printer(json)(bla)
    finish_command(bla, True, json)


@app.command()
def plot(
    file: Annotated[
        Path, typer.Argument(help="Multisine, record, BLA or matrix written by a command of nlfrf.")
    ],
    out: Out,
    confidence: Annotated[float, typer.Option(help="Probability of the bound to draw.")] = 0.95,
) -> None:
    """Draw a saved result as .png, .pdf or .svg."""
    if out.suffix.lower() not in (".png", ".pdf", ".svg"):
        raise ValueError(f"out must end in .png, .pdf or .svg, got {out.name!r}")
    content = load_own(file)
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    from nlfrf import plot as pictures

    if isinstance(content, nlfrf.Record):
        content = nlfrf.identify(content)
    elif isinstance(content, nlfrf.signals.AxisExperiment):
        content = content.ms
    size = (9, 9)
    drawn: list[Callable[..., object]]
    if isinstance(content, nlfrf.Multisine):
        drawn = [pictures.plot_excitation, pictures.plot_spectrum]
    elif content.is_single:
        drawn = [
            partial(pictures.plot_bla, confidence=confidence),
            partial(pictures.plot_phase, confidence=confidence),
            pictures.plot_levels,
        ]
    else:
        drawn = [
            partial(pictures.plot_frm, confidence=confidence),
            partial(pictures.plot_singular_values, confidence=confidence),
        ]
        size = 3 * content.n_inputs + 3, 2 * content.n_outputs + 6
    figure, places = plt.subplots(len(drawn), 1, figsize=size, layout="constrained")
    for draw, ax in zip(drawn, places, strict=True):
        draw(content, ax=ax)
    save_figure(out, figure, dpi=120)
    plt.close(figure)


@app.command()
def doctor() -> None:
    """Show the installed versions, and what is wrong with them (exit code 1)."""
    rows, faults = examine(extra_of_file)
    for name, version, requirement in rows:
        print(f"{name:14} {version or 'not installed':16} {requirement}")
    for fault in faults:
        print(fault)
    if faults:
        raise typer.Exit(1)
    print("all is well")


def warn_of_band(ms: nlfrf.Multisine, kind: str, *, f_min: float, f_max: float) -> None:
    """Warn if the grid has no lines in a large part of the band at one end."""
    first, last = ms.f[[0, -1]].tolist()
    if first > (1 + _MAX_BAND_GAP) * f_min or last < (1 - _MAX_BAND_GAP) * f_max:
        warnings.warn(
            f"the wanted band is {f_min:g} to {f_max:g} Hz, but the excited lines go from {first:g}"
            f" to {last:g} Hz only; " + _suggest_lines(ms, kind, f_min),
            nlfrf.DataWarning,
            stacklevel=3,
        )


def _suggest_lines(ms: nlfrf.Multisine, kind: str, f_min: float) -> str:
    """Return the lines of a grid at its low end, and the options that give a line there, as
    text.
    """
    if f_min < ms.f0:
        n = int(np.ceil(ms.fs / f_min))
        return (
            f"a period of {ms.n_samples / ms.fs:g} s has no line below {ms.f0:g} Hz: give"
            f" --period {n}"
        )
    if kind not in _SPARSE_GRIDS:
        return "a longer period has lines nearer to its ends"
    lines = grid_lines(
        kind, 1, last=int(ms.f[0] / ms.f0 + 8.5), rng=np.random.default_rng()
    ).excited
    listed = ", ".join(f"{k * ms.f0:g}" for k in lines[lines * ms.f0 > f_min / 4][:6])
    below = lines[lines * ms.f0 <= f_min] * ms.f0
    finer = int(np.ceil(lines[0] * ms.fs / f_min))
    if below.size:
        other = (
            f", or --f-min {below[-1]:g}, which leaves a gap in the lines from {below[-1]:g} to"
            f" {ms.f[0]:g} Hz"
        )
    else:
        other = ""
    return (
        f"a {kind} grid has the lines {listed}, ... Hz at this resolution of {ms.f0:g} Hz: give a"
        f" longer period, such as --period {max(finer, 2 * ms.n_samples)}{other}"
    )


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


def main() -> None:
    """Run the command `nlfrf`."""
    run_command("nlfrf", app, nlfrf.DataWarning, options=_OPTIONS)


if __name__ == "__main__":
    main()
