"""A simulated axis instead of the machine: it plays a file of set points, and writes the trace of
the drive.
"""

from __future__ import annotations

import os
import re
from contextlib import suppress
from pathlib import Path

import numpy as np

from nlfrf import load
from nlfrf._base.arguments import require_kind
from nlfrf._base.drive_entries import PORTS, SAME_GAIN
from nlfrf._base.files import require_writable, to_path, write_table
from nlfrf.io import load_set_points
from nlfrf.rig import ServoAxis, Trajectory, run
from nlfrf.signals import AxisExperiment, AxisLimits


def play_experiment(
    axis: ServoAxis,
    path: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    limits: AxisLimits | None = None,
    oversampling: int = 1,
) -> Trajectory:
    """Play a file of set points on a simulated axis, and write its trace.

    Use this to test an experiment in simulation before you play it on the machine.

    Parameters
    ----------
    axis : ServoAxis
        Simulated machine and drive.
    path : path
        Table to play, as `nlfrf.save` writes it for an experiment. Its columns are the time, and
        set points with the names position, velocity or force.
    out : path
        File of the trace to write, a ``.csv`` with set points and actual values of position,
        velocity, current and force, each with its unit.
    limits : AxisLimits, optional
        Limits that the drive monitors. The trace ends at the first sample beyond a limit.
    oversampling : int
        As in `nlfrf.rig.run`.

    Returns
    -------
    Trajectory
        Signals of the trace, and signals that a drive does not measure.

    Raises
    ------
    ValueError
        A file without a set point, or with another sampling frequency or other units than the
        drive; gains that differ from the gains in the design (``.npz``) of the same name; a limit
        that is exceeded at the first sample; an output file that is not a .csv.
    FileNotFoundError
        No such file.

    References
    ----------
    docs/guide/axis.md: the files for a drive.

    Examples
    --------
    >>> import nlfrf, tempfile
    >>> from nlfrf.io import load_trace
    >>> from robust.servo import design_experiment, play_experiment
    >>> axis = nlfrf.servo_axis("belt")
    >>> ms = nlfrf.multisine(fs=4000, n_samples=4000, f_min=5, f_max=200, rng=1)
    >>> experiment = design_experiment(axis, ms, rms=20)
    >>> folder = tempfile.TemporaryDirectory()
    >>> nlfrf.save(experiment, f"{folder.name}/play.csv")
    >>> trace = play_experiment(axis, f"{folder.name}/play.csv", f"{folder.name}/trace.csv")
    >>> with open(f"{folder.name}/trace.csv") as file:
    ...     file.readline()
    't [s],position set point [m],position [m],velocity set point [m/s],velocity [m/s],current set point [A],current...
    >>> folder.cleanup()
    """
    require_kind("axis", axis, ServoAxis)
    out = to_path(out)
    if out.suffix.lower() != ".csv":
        raise ValueError(f"out must end in .csv, got {out.name!r}")
    require_writable(out)
    found = load_set_points(path)
    _require_designed_gains(axis, to_path(path))
    position, force = axis.units
    for port, unit in zip(PORTS, (force, f"{position}/s", position), strict=True):
        if found.units.get(port, "") not in ("", unit):
            raise ValueError(
                f"path must have its {port} in {unit}, the unit of the axis, got it in"
                f" {found.units[port]}"
            )
    if abs(found.fs / axis.drive.fs - 1) > 1e-6:
        raise ValueError(
            f"path must be sampled as the drive is, at {axis.drive.fs:g} Hz, got {found.fs:g} Hz"
        )
    trace = run(axis, {port: found.played.get(port) for port in PORTS}, oversampling=oversampling)
    n = _stop_sample(trace, AxisLimits() if limits is None else limits)
    if n < 2:
        raise ValueError(
            "limits must be above force, velocity and travel of the first period, got limits"
            " that are exceeded in it"
        )
    columns = {
        "t [s]": trace.t,
        f"position set point [{position}]": trace.position_set,
        f"position [{position}]": trace.position,
        f"velocity set point [{position}/s]": trace.velocity_set,
        f"velocity [{position}/s]": trace.velocity,
        "current set point [A]": trace.current_set,
        "current [A]": trace.current,
        f"force set point [{force}]": trace.force_set,
    }
    write_table(out, np.column_stack(list(columns.values()))[:n], list(columns))
    return trace


def _require_designed_gains(axis: ServoAxis, path: Path) -> None:
    """Refuse a drive whose gains differ from those of the design beside the file: the force would
    differ too.
    """
    found = [
        one
        for one in (path, path.with_stem(re.sub(r"-\d+$", "", path.stem)))
        if one.with_suffix(".npz").is_file()
    ]
    design: object = None
    with suppress(ValueError):  # the file of the same name is no design
        if found:
            design = load(found[0].with_suffix(".npz"))
        else:
            design = None
    if not isinstance(design, AxisExperiment) or design.assumed_drive is None:
        return
    drive, assumed = axis.drive, design.assumed_drive
    # the feedforward acts on the position set point only
    fed = design.port == "position" or np.any(design.velocities)
    other = (
        fed and abs(drive.velocity_feedforward - assumed.velocity_feedforward) > SAME_GAIN
    ) or not assumed.has_gains(drive.kv, drive.gain, drive.tn)
    if other:
        numbers = [
            f"kv = {one.kv:g} 1/s, kp = {kp:g} A s/{axis.units[0]}, tn = {one.tn:g} s,"
            f" velocity_feedforward = {one.velocity_feedforward:g}"
            for one, kp in ((drive, drive.gain), (assumed, assumed.kp))
        ]
        raise ValueError(
            f"axis must have the gains of the design in {found[0].with_suffix('.npz').name!r},"
            f" {numbers[1]}, got {numbers[0]}: design again with these gains, because the force"
            " differs from the design otherwise"
        )


def _stop_sample(trace: Trajectory, limits: AxisLimits) -> int:
    """Return the number of samples before the first one beyond a limit."""
    require_kind("limits", limits, AxisLimits)
    way = np.maximum.accumulate(trace.position) - np.minimum.accumulate(trace.position)
    passed = (
        (np.abs(trace.force_set) > limits.force)
        | (np.abs(trace.v[0]) > limits.velocity)
        | (way > limits.travel)
    )
    if passed.any():
        return int(np.argmax(passed))
    return trace.t.size
