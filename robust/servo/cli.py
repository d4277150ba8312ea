"""The commands ``robust servo``, from the data sheet of a servo axis to a verdict on its gains."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

import nlfrf
from nlfrf._base.command import (
    Commands,
    Decimal,
    Json,
    Resample,
    finish_command,
    printer,
    progress_display,
    require_left_out,
    spinner,
)
from nlfrf._base.files import command_signature, write_text
from robust._base.options import Discard, Period, Reference, SamplingFrequency

servo_app = Commands(
    help="A servo axis: experiments, and a check of its gains.",
    no_args_is_help=True,
)
Out = Annotated[Path, typer.Option("--out", "-o", help="File to write.")]
Force = Annotated[
    str,
    typer.Option("--input", help="Name of the force, torque or current set point in the trace."),
]
Position = Annotated[
    str, typer.Option("--output", help="Name of the actual position in the trace.")
]


@servo_app.command("design")
def design_for_drive(
    source: Annotated[
        Path, typer.Argument(help="Preset, .toml file of an axis, or a first trace (with --first).")
    ],
    out: Out,
    period: Annotated[
        int, typer.Option(help="Samples in one period, at the sampling frequency of the drive.")
    ],
    f_min: Annotated[float, typer.Option(help="Lowest frequency [Hz].")],
    f_max: Annotated[float, typer.Option(help="Highest frequency [Hz].")],
    rms: Annotated[
        float | None,
        typer.Option(
            help="Rms of the force set point [N], [Nm]; default: largest within the limits."
        ),
    ] = None,
    port: Annotated[
        str, typer.Option(help="Set point to add it to: position, velocity or force.")
    ] = "position",
    max_force: Annotated[
        float, typer.Option(help="Limit of the force set point [N], [Nm].")
    ] = np.inf,
    max_velocity: Annotated[
        float, typer.Option(help="Limit of the velocity [m/s], [rad/s].")
    ] = np.inf,
    max_travel: Annotated[float, typer.Option(help="Limit of the travel [m], [rad].")] = np.inf,
    velocity: Annotated[
        float, typer.Option(help="Base velocity [m/s], [rad/s]; 0: at rest.")
    ] = 0.0,
    strokes: Annotated[int, typer.Option(help="Strokes forth and back.")] = 0,
    ramp: Annotated[
        int, typer.Option(help="Levels of a pre-test at rest, up to --rms; 0: none.")
    ] = 0,
    span: Annotated[float, typer.Option(help="Highest over lowest level of the pre-test.")] = 1e4,
    periods: Annotated[int, typer.Option(help="Periods to keep of each stroke or level.")] = 2,
    discard: Annotated[int, typer.Option(help="Periods before them, not kept.")] = 2,
    realizations: Annotated[int, typer.Option(help="Realisations, one file each.")] = 1,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed of the random phases.")] = None,
    first: Annotated[Path | None, typer.Option(help="Design (.npz) of the first trace.")] = None,
    level: Annotated[
        str,
        typer.Option(
            help="Level of the first trace, if that is a pre-test: sticks, bends or slides."
        ),
    ] = "",
    input: Force = "force set point",
    output: Position = "position",
    decimal: Decimal = ".",
) -> None:
    """Design an experiment on a running drive: set points to play (.csv), and the design (.npz)."""
    origin: nlfrf.rig.ServoAxis | nlfrf.Record
    if first is None:
        origin = _read_axis(source)
    else:
        played = _load_experiment(first)
        records = nlfrf.io.load_trace(source, played, u=input, y=output)
        origin = nlfrf.io.in_design_units(records[0], played)
        if played.is_ramp:
            from robust.servo.experiment.levels import find_levels

            found, states = find_levels(records, played), ("sticks", "bends", "slides")
            if level not in states or found.reason:
                raise ValueError(
                    found.reason
                    or f"--level must be {', '.join(states)} for a pre-test, got {level or 'none'}"
                )
            k = states.index(level)
            origin, rms = found.records[k], float(found.rms[k]) if rms is None else rms
    if ramp and (velocity or strokes or realizations != 1):
        raise ValueError(
            "--ramp must be left out with --velocity, --strokes or --realizations, got it with one"
            " of them"
        )
    from robust.servo.experiment.design import design_experiment, design_ramp

    fs = origin.drive.fs if isinstance(origin, nlfrf.rig.ServoAxis) else origin.fs
    ms = nlfrf.multisine(
        fs=fs, n_samples=period, f_min=f_min, f_max=f_max, n_realizations=realizations, rng=seed
    )
    motion = partial(design_experiment, base_velocity=velocity, strokes=strokes)
    experiment = (partial(design_ramp, n_levels=ramp, span=span) if ramp else motion)(
        origin,
        ms,
        rms=rms,
        port=port,
        limits=nlfrf.signals.AxisLimits(force=max_force, velocity=max_velocity, travel=max_travel),
        n_periods=periods,
        n_discard=discard,
    )
    from nlfrf.cli.design import warn_of_band

    warn_of_band(experiment.ms, experiment.ms.kind, f_min=f_min, f_max=f_max)
    nlfrf.save(experiment, out, decimal=decimal)
    printer(False)(experiment)


@servo_app.command("play")
def play_set_points(
    axis: Annotated[Path, typer.Argument(help="Preset, or .toml file of an axis.")],
    file: Annotated[
        Path, typer.Argument(help="Set points to play, from 'robust servo design' (.csv).")
    ],
    out: Out,
) -> None:
    """Play set points on a simulated axis, and write the trace of its drive (.csv)."""
    from robust.servo.experiment.play import play_experiment

    trace = play_experiment(_read_axis(axis), file, out)
    if trace.diverged:
        raise ValueError(
            f"axis must be stable under its drive, got one that diverges after {trace.t[-1]:.3g} s:"
            " lower its gains"
        )
    printer(False)(
        f"{trace.t.size} samples, {trace.t[-1]:.3g} s; current at its limit in"
        f" {trace.limited.mean():.1%} of them"
    )


@servo_app.command("levels")
def find_levels_of_ramp(
    file: Annotated[Path, typer.Argument(help="Trace of the pre-test.")],
    played: Annotated[
        Path,
        typer.Option(
            "--design", help="Design of the pre-test, from 'robust servo design --ramp' (.npz)."
        ),
    ],
    input: Force = "force set point",
    output: Position = "position",
    json: Json = False,
) -> None:
    """Find the levels of a pre-test at which an axis sticks, bends and slides (exit code 1: it does
    not show three).
    """
    from robust.servo.experiment.levels import find_levels

    experiment = _load_experiment(played)
    found = find_levels(nlfrf.io.load_trace(file, experiment, u=input, y=output), experiment)
    printer(json)(found)
    finish_command(found, not found.reason, json)


def _read_axis(path: Path) -> nlfrf.rig.ServoAxis:
    """Return the axis of a preset, or of a TOML file with the fields of `ServoAxis` and its
    drive.
    """
    if path.suffix.lower() not in ("", ".toml"):
        raise ValueError(
            f"axis must be a preset or a .toml file, got {path.name!r}: for a trace give --first"
        )
    if path.suffix:
        from robust.servo.experiment.axis_file import load_axis

        return load_axis(path)
    return nlfrf.servo_axis(str(path))


#: What the check assumes of the machine.
_Actual = Annotated[
    bool, typer.Option("--actual", help="The input is the actual current, not its set point.")
]
_Stiction = Annotated[float, typer.Option(help="Largest over smallest force of a slider.")]
_LargestForce = Annotated[
    float | None,
    typer.Option(
        help=(
            "Largest friction force [N] or [Nm], to bound how far the axis may hunt; default:"
            " as read."
        )
    ),
]
_Within = Annotated[
    float | None, typer.Option(help="Distance [m] or [rad] within which the axis must stay.")
]
_Spring = Annotated[bool, typer.Option("--spring", help="The machine has a spring to ground.")]
_Masses = Annotated[
    int,
    typer.Option(help="2: read friction of motor and load, which takes up to half a minute."),
]


@servo_app.command(name="check")
def check_gains(
    file: Annotated[
        list[Path],
        typer.Argument(
            metavar="TRACE... GAINS.toml", help="Traces, and the gains with their units."
        ),
    ],
    input: Annotated[
        str | None,
        typer.Option(
            "--input", help='Current or force in the traces: "u", with --design "force set point".'
        ),
    ] = None,
    output: Annotated[
        str | None,
        typer.Option("--output", help='Position in the traces: "y", with --design "position".'),
    ] = None,
    reference: Reference = None,
    fs: SamplingFrequency = None,
    period: Period = None,
    discard: Discard = 0,
    resample: Resample = False,
    design: Annotated[
        list[Path] | None,
        typer.Option(
            help=(
                "Design of the traces, from 'robust servo design' or 'nlfrf design'; one, or one"
                " for each trace."
            )
        ),
    ] = None,
    peak: Annotated[
        float, typer.Option(help="Largest |S| over the set that counts as safe.")
    ] = 2.0,
    actual: _Actual = False,
    stiction: _Stiction = 1.5,
    force: _LargestForce = None,
    within: _Within = None,
    spring: _Spring = False,
    masses: _Masses = 1,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Page to write: .html with pictures, or .txt."),
    ] = None,
    json: Json = False,
) -> None:
    """Check whether the gains of a drive are safe: margins, set, worst case, friction and step, on
    one page.

    Exit code 0: the linear loop is proved stable with the whole set, the axis is proved to come to
    rest with its friction, and the page has no warning. Exit code 3: the linear loop passed, but
    rest was not judged, because there are no traces at rest or no friction can be read from them.
    The axis may hunt, within a bound if there is one. Exit code 1: the gains did not pass. The axis
    hunts in simulation, margins are thin, a trace has a warning, friction held the axis, the loop
    crosses over outside the measured band, or the position loop is slower than the velocity loop,
    which is approximated. Exit code 2: bad input.
    """
    traces, gains = _split_gains(file)
    from robust.servo.checking.findings import DriveVerdict
    from robust.servo.checking.judge import check
    from robust.servo.checking.read import read_experiments, read_traces
    from robust.servo.gains.gains_file import load_gains
    from robust.servo.page import write_page

    settings, say = load_gains(gains), printer(json)
    experiments = _load_experiments(design or [])
    if experiments:
        require_left_out(
            {"reference": reference, "period": period, "discard": discard, "resample": resample}
        )
        records, names, conditions = read_experiments(
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
            records, names, conditions = read_traces(traces, settings, actual=actual, load=load)
        except ValueError:
            if input is None and not design:
                _require_design(traces)
            raise
    with progress_display("checking", even=False) as advance:
        found = check(
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
            write_page(out, found, records)
    elif out is not None:
        write_text(out, f"{found}\n\n{command_signature('robust servo check')}\n")
    passed = found.verdict is not DriveVerdict.NOT_PASSED
    finish_command(found.to_values() if json else found, found.safe, json, code=3 if passed else 1)


def _split_gains(files: list[Path]) -> tuple[list[Path], Path]:
    """Return the traces among the files, and the file with the gains."""
    gains = [path for path in files if path.suffix.lower() == ".toml"]
    traces = [path for path in files if path not in gains]
    if len(gains) != 1 or not traces:
        raise ValueError(
            f"file must be traces and one GAINS.toml, got {', '.join(map(str, files))}"
        )
    return traces, gains[0]


def _load_experiment(path: Path) -> nlfrf.signals.AxisExperiment:
    """Return the experiment in a design file."""
    found = nlfrf.load(path)
    if not isinstance(found, nlfrf.signals.AxisExperiment):
        raise ValueError(
            f"design must be a file from 'robust servo design', got {path.name} with a"
            f" {type(found).__name__}"
        )
    return found


def _load_experiments(designs: list[Path]) -> list[nlfrf.signals.AxisExperiment]:
    """Return the experiments in design files; none for a single multisine."""
    played = [nlfrf.load(one) for one in designs]
    experiments = [one for one in played if isinstance(one, nlfrf.signals.AxisExperiment)]
    if len(played) > max(len(experiments), 1):
        raise ValueError(
            "design must be one multisine, or an experiment of 'robust servo design' for each"
            " trace, got several multisines"
        )
    return experiments


def _require_design(traces: list[Path]) -> None:
    """Refuse the trace of a servo axis without its design, which has the names of its signals and
    its periods.
    """
    from nlfrf.io.measurement_files import read_channels

    for path in traces:
        file = read_channels(path)
        if (
            file.full_name("u") not in file.arrays
            and file.full_name("force set point") in file.arrays
        ):
            raise ValueError(
                f"design must be given for {path.name}, which looks like the trace of a servo axis:"
                " give --design with the .npz from 'robust servo design'. For another trace give"
                " --input and --output"
            ) from None
