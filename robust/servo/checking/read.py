"""Traces of a drive as records in the units of its velocity loop, and the conditions they were recorded under."""

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


def read_trace(
    path: Path, settings: Drive, *, actual: bool = False, load: Callable[[Path], nlfrf.Record] = nlfrf.load_record
) -> nlfrf.Record:
    """Read a trace of a drive in the units of its velocity loop: position in m or rad, force in N or Nm, or current.

    Parameters
    ----------
    path : Path
        A measurement file as `nlfrf.load_record` reads it.
    settings : Drive
        Of the drive; a position without a unit is in its `position_unit`, an input without one in its output unit.
    actual : bool
        Whether the input is the actual current or force, measured behind the hold; a set point is held.
    load : callable
        `nlfrf.load_record` with its options.

    Raises
    ------
    ValueError
        Units that are none of a drive, a trace that is not sampled as the drive is.
    """
    return _to_drive_units(load(path), settings, path, actual=actual)


def read_traces(
    traces: Sequence[Path],
    settings: Drive,
    *,
    actual: bool = False,
    load: Callable[[Path], nlfrf.Record] = nlfrf.load_record,
) -> tuple[list[nlfrf.Record], list[str], list[Conditions]]:
    """Read traces of any origin: records, names and conditions for `check`, as `read_experiments` returns them.

    Parameters
    ----------
    traces : sequence of Path
        One file a level.
    settings, actual, load
        As for `read_trace`.

    Returns
    -------
    records, names, conditions : list
        As from `read_experiments`; the conditions are not known.

    Raises
    ------
    ValueError
        As `read_trace`.

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
            records.append(read_trace(path, settings, actual=actual, load=load))
        conditions.append(Conditions(warnings=tuple(warned)))
    return records, [path.name for path in traces], conditions


@contextmanager
def collect_warnings(name: str) -> Iterator[list[str]]:
    """Collect what data of that name are warned of meanwhile, and pass every warning on.

    That friction at rest makes another force than the design expects is left out: no verdict depends on it.
    """
    texts: list[str] = []
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            yield texts
    finally:
        data = [one for one in caught if issubclass(one.category, nlfrf.DataWarning)]
        texts += [f"{name}: {one.message}" for one in data if one.category is not nlfrf.io.LevelWarning]
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
        One file a realisation.
    designs : sequence of nlfrf.signals.AxisExperiment
        One for all traces, or that of each trace, in their order.
    settings, actual
        As for `read_trace`.
    n_levels : int
        Levels to take of a pre-test, from sticking to sliding; motor and load need more than three.
    u, y, fs, start : as for `nlfrf.io.load_trace`.

    Returns
    -------
    records : list of nlfrf.Record
        Each direction of a base motion, the levels of a pre-test, or the one at rest.
    names : list of str
        What each is called.
    conditions : list of Conditions
        Under which it was recorded, by its design.

    Raises
    ------
    ValueError
        Traces that are more or fewer than those of the designs; pre-tests only, which do not show three levels; as
        `read_trace` and `nlfrf.io.load_trace`.
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
    if len(designs) == len(traces):  # that of each trace: of an experiment of several realisations once
        of_trace, designs = list(designs), []
        while of_trace:
            designs.append(of_trace[0])
            of_trace = of_trace[of_trace[0].ms.n_realizations :]
    counts = [design.ms.n_realizations for design in designs]
    repeats = len(traces) // counts[0] if len(designs) == 1 else 1
    if sum(counts) * repeats != len(traces):
        raise ValueError(
            f"design must be one for all traces, or that of each trace, got {len(designs)} of {sum(counts)} "
            f"realisations in all, and {len(traces)} traces"
        )
    records, names, conditions, unread, warned_texts, left = [], [], [], [], [], list(traces)
    levels_at_rest: list[nlfrf.Record] = []
    for design in list(designs) * repeats:
        paths, left = left[: design.ms.n_realizations], left[design.ms.n_realizations :]
        with collect_warnings(paths[0].name) as warned:
            found, labels = nlfrf.io.load_trace(paths, design, u=u, y=y, fs=fs, start=start), design.labels
        warned_texts += warned
        if design.is_ramp:
            read = find_levels(found, design)
            levels_at_rest += [_to_drive_units(record, settings, paths[0], actual=actual) for record in found]
            if read.reason:
                unread.append(f"{paths[0].name}: {read.reason}")
                continue
            taken = _choose_levels(read, n_levels)
            found, labels = tuple(found[k] for k in taken), tuple(read.states[k].value for k in taken)
        records += [_to_drive_units(record, settings, paths[0], actual=actual) for record in found]
        names += [f"{paths[0].name} {label}" for label in labels]
        motion = BaseMotion.MOVING if np.any(design.velocities) else BaseMotion.AT_REST
        strokes = list(design.groups.values())  # those of one direction are realisations of one record
        speeds = [design.velocities[one[0]] if motion is BaseMotion.MOVING else 0.0 for one in strokes[: len(found)]]
        gains = compare_gains(design, settings)
        conditions += [Conditions(gains=gains, motion=motion, velocity=float(speed)) for speed in speeds]
    if not records:
        raise ValueError(f"design of a pre-test must show three levels, got {'; '.join(unread)}")
    texts, why, levels = tuple(warned_texts), tuple(unread), tuple(levels_at_rest)
    return records, names, [one._replace(warnings=texts, unread=why, levels=levels) for one in conditions]


def _choose_levels(levels: AxisLevels, count: int) -> list[int]:
    """Return which levels of a pre-test to read: its three, or more between the lowest of them and the top."""
    named = np.flatnonzero(np.isin(levels.set_point_rms, levels.rms)).tolist()
    states = FrictionRegime
    readable = (states.STICKS, states.BENDS, states.SLIDES)
    top = max(k for k, state in enumerate(levels.states) if state in readable)
    if count <= len(named) or top - named[0] + 1 < count:
        return named
    return np.unique(np.round(np.linspace(named[0], top, count)).astype(int)).tolist()


def compare_gains(design: nlfrf.signals.AxisExperiment, settings: Drive) -> RecordedGains:
    """Compare the gains an experiment was designed for with these; unknown where kp cannot be converted to A."""
    try:
        kp = settings.gain * settings.output_factor("A")
    except ValueError:  # no torque constant: the design has a kp in A
        return RecordedGains.UNKNOWN
    same = settings.base_unit == design.position_unit and design.has_gains(settings.kv, kp, settings.tn)
    return RecordedGains.SAME if same else RecordedGains.OTHER


def _to_drive_units(record: nlfrf.Record, settings: Drive, path: Path, *, actual: bool) -> nlfrf.Record:
    """Return a record in the units of the velocity loop; the errors and units are those of `read_trace`."""
    if abs(record.fs / settings.fs - 1) > 1e-6:
        raise ValueError(
            f"trace must be sampled as the velocity loop is, at {settings.fs:g} Hz, got {path.name} at {record.fs:g} "
            "Hz: trace every period, as what lies between decimated samples is lost"
        )
    base, force = settings.base_unit, settings.force_unit
    kind, factor = POSITIONS.get(record.y_unit, ("", 1.0))
    position = settings.position_scale
    if record.y_unit in ("", position.unit):
        factor = position.factor
    elif kind != base:
        raise ValueError(
            f"trace must have the position in {position.unit} or a multiple of {base}, got {path.name} in "
            f"{record.y_unit}"
        )
    given = record.u_unit or settings.output_unit
    if given not in ("A", force):
        raise ValueError(f"trace must have an input in A or {force}, got {path.name} in {given}")
    unit = "A" if np.isnan(settings.torque_constant) and "A" in (given, settings.output_unit) else force
    scale = 1.0 if given == unit else settings.torque_constant
    if np.isnan(scale):
        raise ValueError(
            f"torque_constant must be given [{force}/A] between a gain in {settings.kp_unit} and a trace in {given}, "
            "got none"
        )
    return replace(
        record,
        u=record.u * scale,
        y=record.y * factor,
        input_units=(unit,),
        output_units=(base,),
        hold=("band-limited" if actual else "zoh") if record.hold == "unknown" else record.hold,
    )
