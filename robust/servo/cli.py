"""The commands ``robust servo``: what a servo axis needs from data sheet to verdict."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import lazy_loader
import typer

import nlfrf
from nlfrf._base.command import Commands, Json, finish_command, printer, progress_display, require_left_out, spinner
from nlfrf._base.files import command_signature, write_text
from robust._base.options import Discard, Period, Reference, Resample, SamplingFrequency

#: Imported when a command uses them: help and refusals of the command line need none of them.
findings, gains_file, judge, page, read = (
    lazy_loader.load(f"robust.servo.{module}", suppress_warning=True)
    for module in ("checking.findings", "gains.gains_file", "checking.judge", "page", "checking.read")
)

servo_app = Commands(help="Gains of a drive, checked against traces of its axis.", no_args_is_help=True)


@servo_app.command(name="check")
def check_gains(
    file: Annotated[
        list[Path],
        typer.Argument(metavar="TRACE... GAINS.toml", help="Traces, one a level, and the gains with their units."),
    ],
    input: Annotated[
        str | None,
        typer.Option("--input", help='Current or force in the traces: "u", with --design "force set point".'),
    ] = None,
    output: Annotated[
        str | None, typer.Option("--output", help='Position in the traces: "y", with --design "position".')
    ] = None,
    reference: Reference = None,
    fs: SamplingFrequency = None,
    period: Period = None,
    discard: Discard = 0,
    resample: Resample = False,
    design: Annotated[
        list[Path] | None,
        typer.Option(
            help="What was played, as 'nlfrf axis design' or 'design' wrote it; one, or repeated for each trace."
        ),
    ] = None,
    peak: Annotated[float, typer.Option(help="Largest |S| over the set that counts as safe.")] = 2.0,
    actual: Annotated[
        bool, typer.Option("--actual", help="The input is the actual current, not its set point.")
    ] = False,
    stiction: Annotated[float, typer.Option(help="Largest over smallest force of a slider.")] = 1.5,
    force: Annotated[
        float | None,
        typer.Option(
            help="Largest friction force [N] or [Nm] where the axis may hunt: how far it then moves; else as was read."
        ),
    ] = None,
    within: Annotated[
        float | None, typer.Option(help="Distance [m] or [rad] within which the axis is to stay: the page says if.")
    ] = None,
    spring: Annotated[bool, typer.Option("--spring", help="A spring to ground is part of the machine.")] = False,
    masses: Annotated[
        int, typer.Option(help="2: friction is read of a motor and a load, which takes up to half a minute.")
    ] = 1,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Page to write: .html with pictures, or .txt.")
    ] = None,
    json: Json = False,
) -> None:
    """Check whether the gains of a drive are safe: margins, set, worst case, friction and step, on one page.

    Exit code 0 where the linear loop is proved stable for the whole set, the axis to come to rest with its friction,
    and no warning stands on the page. Exit code 3 where the same holds of the linear loop and rest was not judged: no
    traces at rest were given, or no friction could be read from them; the axis may hunt, within a bound if there is
    one. Exit code 1 where not: the axis hunts in simulation, margins are thin, a trace has a warning, friction held the
    axis, the loop crosses over outside the measured band, or the position loop is slower than the velocity loop, as
    that is approximated. Exit code 2: bad input.
    """
    traces, gains = _split_gains(file)
    settings, say = gains_file.load_gains(gains), printer(json)
    experiments = _load_experiments(design or [])
    if experiments:
        require_left_out({"reference": reference, "period": period, "discard": discard, "resample": resample})
        records, names, conditions = read.read_experiments(
            traces,
            experiments,
            settings,
            actual=actual,
            n_levels=3 if masses == 1 else 6,
            u=input or "force set point",
            y=output or "position",
            fs=fs,
        )
    else:
        load = partial(
            nlfrf.load_record,
            u=input or "u",
            y=output or "y",
            r=reference,
            fs=fs,
            n_samples=period,
            n_discard=discard,
            resample=resample,
            design=design[0] if design else None,
        )
        try:
            records, names, conditions = read.read_traces(traces, settings, actual=actual, load=load)
        except ValueError:
            if input is None and not design:
                _require_design(traces)
            raise
    with progress_display("checking", even=False) as advance:
        found = judge.check(
            records,
            settings,
            names=names,
            conditions=conditions,
            progress=advance,
            peak=peak,
            actual=actual,
            stiction=stiction,
            Fs=force,
            spring=spring,
            masses=masses,
            within=within,
        )
    say(found)
    if out is not None and out.suffix.lower() in (".html", ".htm"):
        with spinner("drawing"):
            page.write_page(out, found, records, names=names, conditions=conditions)
    elif out is not None:
        write_text(out, f"{found}\n\n{command_signature('robust servo check')}\n")
    passed = found.verdict is not findings.DriveVerdict.NOT_PASSED
    finish_command(found.to_values() if json else found, found.safe, json, code=3 if passed else 1)


def _split_gains(files: list[Path]) -> tuple[list[Path], Path]:
    """Return the traces among files, and the one that has the gains."""
    gains = [path for path in files if path.suffix.lower() == ".toml"]
    traces = [path for path in files if path not in gains]
    if len(gains) != 1 or not traces:
        raise ValueError(f"file must be traces and one GAINS.toml, got {', '.join(map(str, files))}")
    return traces, gains[0]


def _load_experiments(designs: list[Path]) -> list[nlfrf.axis.AxisExperiment]:
    """Return the experiments on a drive that were played; none where it was one multisine."""
    played = [nlfrf.load(one) for one in designs]
    experiments = [one for one in played if isinstance(one, nlfrf.axis.AxisExperiment)]
    if len(played) > max(len(experiments), 1):
        raise ValueError(
            "design must be one multisine, or of experiments on a drive one a trace, got several multisines"
        )
    return experiments


def _require_design(traces: list[Path]) -> None:
    """Refuse the trace of a servo axis without its design, which has the names of the signals and the periods."""
    from nlfrf.io.channels import read_channels

    for path in traces:
        file = read_channels(path)
        if file.full_name("u") not in file.arrays and file.full_name("force set point") in file.arrays:
            raise ValueError(
                f"design must be given for {path.name}, which looks like the trace of a servo axis: the .npz that "
                "'nlfrf axis design' wrote. For another trace give --input and --output"
            ) from None
