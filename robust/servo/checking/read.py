"""Traces of a drive as records in the units of its velocity loop, with the conditions of their
recording.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

import nlfrf
from nlfrf._base.units import POSITIONS
from nlfrf.rig import Drive
from robust.servo.checking.findings import BaseMotion, Conditions, RecordedGains
from robust.servo.experiment.levels import AxisLevels, FrictionRegime, find_levels


def _read_trace(
    path: Path,
    settings: Drive,
    *,
    actual: bool = False,
    load: Callable[[Path], nlfrf.Record] = nlfrf.load_record,
) -> nlfrf.Record:
    """Read a trace of a drive in the units of its velocity loop: position in m or rad, force in N
    or Nm, or current.
    """
    return _to_drive_units(load(path), settings, path, actual=actual)


def read_traces(
    traces: Sequence[Path],
    settings: Drive,
    *,
    actual: bool = False,
    load: Callable[[Path], nlfrf.Record] = nlfrf.load_record,
) -> tuple[list[nlfrf.Record], list[str], list[Conditions]]:
    """Read traces of experiments that were not designed with `robust.servo`, for `check`.

    Use `read_experiments` for traces with a design: the design contains gains and motion during the
    recording.

    Parameters
    ----------
    traces : sequence of Path
        Files, one for each level.
    settings : Drive
        The drive. A position without a unit is in its `position_unit`, an input without a unit in
        its output unit.
    actual : bool
        True if the input is the actual current or force: the FRF then includes no hold. False if
        the input is a set point, which is held between the samples.
    load : callable
        Function that reads one file: `nlfrf.load_record` with its options.

    Returns
    -------
    records, names, conditions : list
        As from `read_experiments`, with unknown conditions.

    Raises
    ------
    ValueError
        Units that do not fit the drive, or another sampling frequency than that of the drive.

    Examples
    --------
    >>> import tempfile
    >>> from nlfrf.rig import Drive
    >>> gains = Drive(fs=4000, kv=20, kp=40, kp_unit="A/(m/s)", tn=0.05, torque_constant=52.8)
    >>> ms = nlfrf.multisine(fs=4000, n_samples=4000, f_min=5, f_max=400, rms=60, rng=1)
    >>> record = nlfrf.rig.simulate_servo(nlfrf.servo_axis("linear motor"), ms, n_periods=2)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     nlfrf.save(record, Path(folder, "trace.npz"))
    ...     records, names, conditions = read_traces([Path(folder, "trace.npz")], gains)
    >>> names, records[0].input_units
    (['trace.npz'], ('N',))
    """
    records, conditions = [], []
    for path in traces:
        with collect_warnings(path.name) as warned:
            records.append(_read_trace(path, settings, actual=actual, load=load))
        conditions.append(Conditions(warnings=tuple(warned)))
    return records, [path.name for path in traces], conditions


@contextmanager
def collect_warnings(name: str) -> Iterator[list[str]]:
    """Collect the data warnings of a block, each with a name in front, and pass every warning on.

    A `LevelWarning` is not collected: at rest friction changes the force, and no verdict depends on
    that.
    """
    texts: list[str] = []
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            yield texts
    finally:
        data = [one for one in caught if issubclass(one.category, nlfrf.DataWarning)]
        texts += [
            f"{name}: {one.message}" for one in data if one.category is not nlfrf.io.LevelWarning
        ]
        for one in caught:
            warnings.warn_explicit(one.message, one.category, one.filename, one.lineno)


def read_experiments(
    traces: Sequence[Path],
    designs: Sequence[nlfrf.signals.AxisExperiment],
    settings: Drive,
    *,
    actual: bool = False,
    n_levels: int = 3,
    u: str = "force set point",
    y: str = "position",
    fs: float | None = None,
    start: float = 0.0,
) -> tuple[list[nlfrf.Record], list[str], list[Conditions]]:
    """Read the traces of experiments on a running drive, in the units of its velocity loop.

    Parameters
    ----------
    traces : sequence of Path
        Files, one for each realisation.
    designs : sequence of nlfrf.signals.AxisExperiment
        One design for all traces, or one for each trace, in the order of the traces.
    settings : Drive
        The drive. A position without a unit is in its `position_unit`, an input without a unit in
        its output unit.
    actual : bool
        True if the input is the actual current or force: the FRF then includes no hold. False if
        the input is a set point, which is held between the samples.
    n_levels : int
        Number of levels to use from a pre-test, from sticking to sliding. Identification of a motor
        and a load needs more than three.
    u, y, fs, start
        As for `nlfrf.io.load_trace`.

    Returns
    -------
    records : list of nlfrf.Record
        One record for each direction of a base motion, one for each level of a pre-test, or one for
        an experiment at rest.
    names : list of str
        Name of each record: its file name, with direction or level.
    conditions : list of Conditions
        Gains and motion during each recording, from its design.

    Raises
    ------
    ValueError
        A number of traces that does not fit the designs; only pre-tests, none of which contains
        three usable levels; units or a sampling frequency that do not fit the drive; the errors of
        `nlfrf.io.load_trace`.

    Examples
    --------
    >>> import tempfile
    >>> from nlfrf.rig import Drive
    >>> from robust.servo import design_experiment, play_experiment
    >>> axis = nlfrf.servo_axis("linear motor")
    >>> ms = nlfrf.multisine(fs=4000, n_samples=4000, f_min=5, f_max=400, rng=1)
    >>> moving = design_experiment(axis, ms, rms=60, base_velocity=0.1, strokes=1)
    >>> gains = Drive(fs=4000, kv=20, kp=40, kp_unit="A/(m/s)", tn=0.05, torque_constant=52.8)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     nlfrf.save(moving, Path(folder, "moving.csv"))
    ...     _ = play_experiment(axis, Path(folder, "moving.csv"), Path(folder, "trace.csv"))
    ...     records, names, conditions = read_experiments([Path(folder, "trace.csv")], [moving], gains)
    >>> names[0], conditions[0].motion
    ('trace.csv forward', 'in motion')
    """
    records, names, conditions, unread, warned_texts, left = [], [], [], [], [], list(traces)
    levels_at_rest: list[nlfrf.Record] = []
    for design in _designs_in_turn(traces, designs):
        paths, left = left[: design.ms.n_realizations], left[design.ms.n_realizations :]
        with collect_warnings(paths[0].name) as warned:
            found = nlfrf.io.load_trace(paths, design, u=u, y=y, fs=fs, start=start)
            labels = design.labels
        warned_texts += warned
        if design.is_ramp:
            read = find_levels(found, design)
            levels_at_rest += [
                _to_drive_units(record, settings, paths[0], actual=actual) for record in found
            ]
            if read.reason:
                unread.append(f"{paths[0].name}: {read.reason}")
                continue
            taken = _choose_levels(read, n_levels)
            found = tuple(found[k] for k in taken)
            labels = tuple(read.states[k].value for k in taken)
        records += [_to_drive_units(record, settings, paths[0], actual=actual) for record in found]
        names += [f"{paths[0].name} {label}" for label in labels]
        motion = BaseMotion.MOVING if np.any(design.velocities) else BaseMotion.AT_REST
        strokes = list(
            design.groups.values()
        )  # strokes in one direction are realisations of one record
        speeds = [
            design.velocities[one[0]] if motion is BaseMotion.MOVING else 0.0
            for one in strokes[: len(found)]
        ]
        gains = _compare_gains(design, settings)
        conditions += [
            Conditions(gains=gains, motion=motion, velocity=float(speed)) for speed in speeds
        ]
    if not records:
        raise ValueError(f"design of a pre-test must show three levels, got {'; '.join(unread)}")
    texts, why, levels = tuple(warned_texts), tuple(unread), tuple(levels_at_rest)
    return (
        records,
        names,
        [one._replace(warnings=texts, unread=why, levels=levels) for one in conditions],
    )


def _designs_in_turn(
    traces: Sequence[Path], designs: Sequence[nlfrf.signals.AxisExperiment]
) -> list[nlfrf.signals.AxisExperiment]:
    """Return the design of each experiment, in the order of the traces; refuse a number that does
    not fit them.
    """
    if len(designs) == len(
        traces
    ):  # one for each trace: keep one for each experiment with several realisations
        of_trace, designs = list(designs), []
        while of_trace:
            designs.append(of_trace[0])
            of_trace = of_trace[of_trace[0].ms.n_realizations :]
    counts = [design.ms.n_realizations for design in designs]
    if len(designs) == 1:
        repeats = len(traces) // counts[0]
    else:
        repeats = 1
    if sum(counts) * repeats != len(traces):
        raise ValueError(
            f"design must be one for all traces, or one for each, got {len(designs)} designs with"
            f" {sum(counts)} realisations in all for {len(traces)} traces"
        )
    return list(designs) * repeats


def _choose_levels(levels: AxisLevels, count: int) -> list[int]:
    """Return the indices of the levels to read: the three named ones, or more from the lowest of
    these to the top.
    """
    named = np.flatnonzero(np.isin(levels.set_point_rms, levels.rms)).tolist()
    states = FrictionRegime
    readable = (states.STICKS, states.BENDS, states.SLIDES)
    top = max(k for k, state in enumerate(levels.states) if state in readable)
    if count <= len(named) or top - named[0] + 1 < count:
        return named
    return np.unique(np.round(np.linspace(named[0], top, count)).astype(int)).tolist()


def _compare_gains(design: nlfrf.signals.AxisExperiment, settings: Drive) -> RecordedGains:
    """Compare the gains with those of a design; the result is UNKNOWN if kp cannot be converted to
    A.
    """
    try:
        kp = settings.gain * settings.output_factor("A")
    except ValueError:  # no torque constant: the design has a kp in A
        return RecordedGains.UNKNOWN
    same = (
        design.assumed_drive is not None
        and settings.base_unit == design.position_unit
        and design.assumed_drive.has_gains(settings.kv, kp, settings.tn)
    )
    if same:
        return RecordedGains.SAME
    return RecordedGains.OTHER


def _to_drive_units(
    record: nlfrf.Record, settings: Drive, path: Path, *, actual: bool
) -> nlfrf.Record:
    """Return a record in the units of the velocity loop, with the defaults and errors of
    `read_traces`.
    """
    if abs(record.fs / settings.fs - 1) > 1e-6:
        raise ValueError(
            f"trace must be sampled as the velocity loop is, at {settings.fs:g} Hz, got {path.name}"
            f" at {record.fs:g} Hz: trace every period, because decimation loses the samples"
            " between"
        )
    base, force = settings.base_unit, settings.force_unit
    kind, factor = POSITIONS.get(record.y_unit, ("", 1.0))
    position = settings.position_scale
    if record.y_unit in ("", position.unit):
        factor = position.factor
    elif kind != base:
        raise ValueError(
            f"trace must have the position in {position.unit} or a multiple of {base}, got"
            f" {path.name} in {record.y_unit}"
        )
    given = record.u_unit or settings.output_unit
    if given not in ("A", force):
        raise ValueError(f"trace must have an input in A or {force}, got {path.name} in {given}")
    if np.isnan(settings.torque_constant) and "A" in (given, settings.output_unit):
        unit = "A"
    else:
        unit = force
    scale = 1.0 if given == unit else settings.torque_constant
    if np.isnan(scale):
        raise ValueError(
            f"torque_constant must be given [{force}/A] between a gain in {settings.kp_unit} and a"
            f" trace in {given}, got none"
        )
    if record.hold == "unknown":
        hold = "band-limited" if actual else "zoh"
    else:
        hold = record.hold
    return replace(
        record,
        u=record.u * scale,
        y=record.y * factor,
        input_units=(unit,),
        output_units=(base,),
        hold=hold,
    )
