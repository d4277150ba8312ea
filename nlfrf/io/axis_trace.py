"""Records from the trace of a drive that played a designed experiment.

The played signal is known. So every record has a reference, and a trace is compared with the
response that its design expects.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from nlfrf._base.arguments import (
    DataWarning,
    data_warning,
    keep_warnings,
    require_kind,
    require_real,
)
from nlfrf._base.files import to_path
from nlfrf._base.numbers import rfft_at, squared_modulus
from nlfrf._base.units import OUTPUTS, POSITIONS
from nlfrf.io.channels import Channels
from nlfrf.io.designs import given_or_read, load_experiment
from nlfrf.io.measurement_files import read_channels, to_paths
from nlfrf.io.rows import find_lost_rows
from nlfrf.records.record import Record, SignalLabels
from nlfrf.records.reference import design_period
from nlfrf.records.screening.input import warn_about_channel
from nlfrf.signals.axis_experiment import AssumedDrive, AxisExperiment

#: Units of positions, velocities and accelerations, which no force has.
_MOTION_UNITS = (
    *(
        "m",
        "mm",
        "um",
        "µm",
        "nm",
        "rad",
        "mrad",
        "deg",
        "°",
        "inc",
        "counts",
        "m/s",
        "mm/s",
        "rad/s",
        "deg/s",
        "°/s",
    ),
    *("rpm", "1/min", "rev/min", "U/min", "m/s^2", "m/s²", "mm/s^2", "mm/s²", "rad/s^2", "rad/s²"),
)
# share of power by which a recorded set point differs from the played one: rounding
_SAME_SIGNAL = 1e-6
_OTHER_SIGNAL = 1e-4  # least expected share by which the wanted signal differs from the set point
# |mean exp(j phase steps)| of U over R between neighbouring lines; 1: smooth, 1/sqrt(F): unrelated
_MIN_LIKENESS = 0.3
_PERIODIC = 0.01  # least share of the power of u on the excited lines, encoder noise included
# least factor of a wrong unit, on the upper lines: N for A, m for mm; a stuck axis has less
_UNIT_FACTOR = 5.0
_FACTOR = 2.0  # largest ratio of reached to designed force, and between periods, without a warning
_START = 0.1  # share of a period by which unmodelled sticking friction may make phases look late
# |mean| of unit phasors above which lines agree on a phase; 15 random ones exceed it in 0.06 % of
# cases
_AGREE = 0.7
_TURNED = 135.0  # [deg] phase against the design above which a signal has the other sign
_UPPER_SHARE = 1 / 3  # share of the lines that count as upper
_SIMILAR = (
    1.5  # largest ratio of the factors of force and position for a common cause, another drive
)
_LITTLE = 0.1  # share of the base motion below which an axis was at rest
_OFF_VELOCITY = 0.1  # relative error of the measured base velocity against the played one
_TURNED_BACK = 1e-3  # share of samples in which an axis in motion may turn back without a warning


class LevelWarning(DataWarning):
    """Warning that the force of an axis at rest differs much from the designed force, because of
    friction.

    The recorded signals are correct.

    References
    ----------
    docs/guide/axis.md: force on each line while friction sticks.

    Examples
    --------
    >>> issubclass(LevelWarning, DataWarning)
    True
    """


@keep_warnings
def load_trace(
    path: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    experiment: AxisExperiment | str | os.PathLike[str],
    *,
    u: str = "force set point",
    y: str = "position",
    fs: float | None = None,
    start: float = 0.0,
) -> tuple[Record, ...]:
    """Read the trace (recorded signals) of a drive that played an experiment, as records for
    `identify`.

    The experiment is an `nlfrf.signals.AxisExperiment`: a multisine added to a set point, while the
    axis is at rest or moves at constant velocity (base motion). There is one record for each
    direction of a base motion. A ramp is an experiment at rest that raises the amplitude in steps;
    it gives one record for each amplitude. The base motion and the remaining trend are subtracted
    from the position. Periods in which velocity or amplitude changes are left out. The reference of
    the records is the played multisine.

    Parameters
    ----------
    path : path, or a list of them
        File of the trace, in any format of `load_record`. A list has one file per realisation, in
        any order.
    experiment : AxisExperiment or path
        Experiment that was played, or the ``.npz`` file that `nlfrf.save` wrote beside the file to
        play.
    u : str
        Name of the channel with the force, torque or current set point at the output of the control
        loops.
    y : str
        Name of the channel with the measured position.
    fs : float, optional
        Sampling frequency of the trace [Hz]; by default from the file.
    start : float
        Time from the first sample of the trace to the first played sample [s].

    Returns
    -------
    tuple of Record
        Records in the order of `experiment.labels`: one at rest; one or two in motion; for a ramp
        one per amplitude that the trace contains.

    Raises
    ------
    ValueError
        The trace does not follow the played signal (another file, period or sampling frequency); a
        channel is a set point instead of the force or the measured position; the base motion of the
        trace is not that of the design; or the trace is too short or sampled too slowly.
    FileNotFoundError
        No such file.

    Warns
    -----
    DataWarning
        The force reached its limit; the position has the wrong sign; force or position are much
        larger or smaller than the design expects; the trace is sampled more slowly than the drive
        runs; an axis in motion moved backwards within a period.

    References
    ----------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., 2.6.4: FRF
    of a closed loop.

    Examples
    --------
    >>> import nlfrf, tempfile
    >>> from nlfrf.io import load_trace
    >>> from robust.servo import design_experiment, play_experiment
    >>> axis = nlfrf.servo_axis("belt")
    >>> motion = {"base_velocity": 0.1, "strokes": 1}
    >>> ms = nlfrf.multisine(fs=4000, n_samples=4000, f_min=5, f_max=200, rng=1)
    >>> experiment = design_experiment(axis, ms, rms=20, **motion)
    >>> folder = tempfile.TemporaryDirectory()
    >>> nlfrf.save(experiment, f"{folder.name}/play.csv")
    >>> trace = play_experiment(axis, f"{folder.name}/play.csv", f"{folder.name}/trace.csv")
    >>> forward, backward = load_trace(f"{folder.name}/trace.csv", f"{folder.name}/play.npz")
    >>> nlfrf.identify(forward).input_units, forward.u.shape
    (('N',), (1, 2, 4000))
    >>> folder.cleanup()
    """
    experiment = given_or_read(experiment, load_experiment)
    require_kind("experiment", experiment, AxisExperiment)
    start = require_real("start", start)
    runs = [_read_run(read_channels(to_path(one)), u, y=y, fs=fs) for one in to_paths(path)]
    if len(runs) != experiment.ms.n_realizations:
        raise ValueError(
            f"path must be one trace per realisation, {experiment.ms.n_realizations}, got"
            f" {len(runs)}"
        )
    return _records_of_runs(runs, experiment, start)


def _records_of_runs(
    runs: list[_Run], experiment: AxisExperiment, start: float
) -> tuple[Record, ...]:
    """Return the records of traces, after checks of their contents."""
    fs = runs[0].fs
    N = design_period(experiment.ms, fs)
    others = [run.fs for run in runs if design_period(experiment.ms, run.fs) != N]
    if others:
        raise ValueError(
            f"path must be traces with one sampling frequency, got {fs:g} and {others[0]:g} Hz"
        )
    _require_fast_trace(experiment, fs, N)
    cut = [_cut_run(run, experiment, N=N, start=start) for run in runs]
    # a ramp can be stopped before its end; other experiments need all their records
    labels = [label for label in experiment.groups if all(label in one for one in cut)]
    if not labels or (len(labels) < len(experiment.groups) and not experiment.is_ramp):
        raise ValueError(
            f"path must hold the whole experiment, {experiment.duration:g} s from start = {start:g}"
            f" s on, got {min(run.u.size for run in runs) / fs:g} s: is fs right?"
        )
    drawn = experiment.ms.sampled(N)
    # by the last label, which is the largest amplitude of a ramp
    order = _match_realizations(
        [one[labels[-1]] for one in cut], drawn, experiment.ms.lines.excited
    )
    records = _join_periods(
        cut, labels, order=order, drawn=drawn, experiment=experiment, run=runs[0]
    )
    if not records:
        raise ValueError(
            "y must move by at least one step of its encoder, got a position that stands still"
        )
    off = {label: max((one[label].drift for one in cut), key=abs) for label in labels}
    _examine_records(
        [in_design_units(record, experiment) for record in records], labels, experiment, off
    )
    return tuple(records)


def _join_periods(
    cut: list[dict[str, _Periods]],
    labels: list[str],
    *,
    order: list[int],
    drawn: np.ndarray,
    experiment: AxisExperiment,
    run: _Run,
) -> list[Record]:
    """Return one record per label, with its realisations in order; a level of a ramp without motion
    has none.
    """
    hold = "zoh" if experiment.ms.n_samples == drawn.shape[1] else "unknown"
    records = []
    for label in labels:
        parts = [cut[m][label] for m in order]
        P = min(len(one.u) for one in parts)
        u, y = (np.stack([getattr(one, name)[:P] for one in parts]) for name in ("u", "y"))
        if experiment.is_ramp and np.ptp(y) == 0:
            continue  # motion below the step of the encoder
        r = np.repeat(experiment.gains[experiment.groups[label][0]] * drawn[:, None], P, axis=1)
        records.append(
            Record(u=u, y=y, r=r, fs=run.fs, lines=experiment.ms.lines, hold=hold, **run.labels)
        )
    return records


def _examine_records(
    records: list[Record], labels: list[str], experiment: AxisExperiment, off: dict[str, float]
) -> None:
    """Refuse or warn of differences between records and their design, in its units; off: of the
    base velocity.
    """
    alone = experiment.is_ramp  # its levels differ by design
    for label, record in () if alone else zip(labels, records, strict=True):
        _require_even_periods(record)
        _examine_motion(experiment, label, record=record, off=off[label])
    if _examine_trace(experiment, records[-1]) and not alone:
        for label, record in zip(labels, records, strict=True):
            _warn_of_other_level(experiment, label, record)


def _unit_ratio(
    unit: str, designed: str, known: dict[str, tuple[str, float]], drive: AssumedDrive | None = None
) -> float:
    """Return how many units of a design one unit is; one without a unit, nan if it cannot be
    converted.

    known : base unit and factor of each known unit. drive : converts A into force.
    """
    (base, size), (own, own_size) = (
        known.get(one, (one, 1.0)) for one in (unit or designed, designed)
    )
    if base == own:
        return size / own_size
    if base == "A" and drive is not None:
        return drive.force_constant * size / own_size
    return np.nan


def in_design_units(record: Record, experiment: AxisExperiment) -> Record:
    """Convert a record to the units of its design.

    A signal whose unit cannot be converted stays unchanged.

    Parameters
    ----------
    record : Record
        Record of `load_trace`.
    experiment : AxisExperiment
        Experiment that was played. Its drive converts current into force.

    Returns
    -------
    Record

    Examples
    --------
    >>> import nlfrf, robust.servo
    >>> axis = nlfrf.servo_axis("belt")
    >>> ms = nlfrf.multisine(fs=4000, n_samples=4000, f_min=5, f_max=200, rng=1)
    >>> experiment = robust.servo.design_experiment(axis, ms, rms=20)
    >>> signals = {"u": ms.u[:, None], "y": ms.u[:, None], "u_unit": "N", "y_unit": "mm"}
    >>> record = Record(fs=4000, lines=ms.lines, **signals)
    >>> in_design_units(record, experiment).y_unit
    'm'
    """
    u = _unit_ratio(record.u_unit, experiment.force_unit, OUTPUTS, experiment.assumed_drive)
    y = _unit_ratio(record.y_unit, experiment.position_unit, POSITIONS)
    return replace(
        record,
        u=np.nan_to_num(u, nan=1.0) * record.u,
        y=np.nan_to_num(y, nan=1.0) * record.y,
        input_units=(experiment.force_unit if np.isfinite(u) else record.u_unit,),
        output_units=(experiment.position_unit if np.isfinite(y) else record.y_unit,),
    )


class _Run(NamedTuple):
    """One trace: force set point and position (n,), sampling frequency [Hz], names and units."""

    u: np.ndarray
    y: np.ndarray
    fs: float
    labels: SignalLabels


class _Periods(NamedTuple):
    """Kept periods (P, N) of force set point and position, and the relative error of the base
    velocity.
    """

    u: np.ndarray
    y: np.ndarray
    drift: float


def _read_run(file: Channels, u: str, *, y: str, fs: float | None) -> _Run:
    """Return the two channels of a file; a force in a unit of motion is refused."""
    run = _Run(
        file.signal("u", u),
        file.signal("y", y),
        file.sampling_frequency(fs, (u, y)),
        file.labels(u, y),
    )
    unit = run.labels["u_unit"]
    if unit in _MOTION_UNITS:
        raise ValueError(
            "u must be the force, torque or current set point at the output of the loops, got"
            f" {u!r} in {unit}: trace that channel, not a set point of motion"
        )
    lost = find_lost_rows(file.seconds(u), run.fs)
    if lost is not None:
        raise ValueError(f"path must be a trace without gaps, got {lost}; trace again")
    if run.u.size != run.y.size:
        raise ValueError(f"y must be as long as u, {run.u.size} samples, got {run.y.size}")
    return run


def _require_fast_trace(experiment: AxisExperiment, fs: float, N: int) -> None:
    """Refuse a trace that is too slow for the lines, and warn of one that is slower than the
    drive.
    """
    ms = experiment.ms
    if 2 * ms.lines.excited[-1] >= N:
        raise ValueError(
            f"fs must be above {2 * ms.f[-1]:g} Hz for lines up to {ms.f[-1]:g} Hz, got {fs:g} Hz"
        )
    if ms.n_samples > N:
        data_warning(
            f"the trace is sampled at {fs:g} Hz and the drive at {ms.fs:g} Hz: without an"
            f" anti-aliasing filter, frequencies above {fs / 2:g} Hz are folded into G. Trace"
            " every sample of the drive"
        )


def _cut_run(run: _Run, experiment: AxisExperiment, *, N: int, start: float) -> dict[str, _Periods]:
    """Return the kept periods of each group that the trace reaches, without base motion and
    remaining trend.
    """
    first = round(start * run.fs)
    block, discard = (experiment.n_discard + experiment.n_periods) * N, experiment.n_discard * N
    moments = (np.arange(run.y.size) - first) / run.fs
    scale = 1 / np.nan_to_num(
        _unit_ratio(run.labels["y_unit"], experiment.position_unit, POSITIONS), nan=1.0
    )
    base = scale * np.interp(
        moments, np.arange(experiment.n_rows) / experiment.ms.fs, experiment.base
    )
    _require_same_motion(run, experiment, base=base, N=N, travel=scale * experiment.travel)
    found = {}
    for label, segments in experiment.groups.items():
        u, y, drifts = [], [], []
        for s in segments:
            begin = first + s * block + discard
            n = min(experiment.n_periods, (run.u.size - begin) // N)
            if begin < 0 or n < 1:
                continue
            some = slice(begin, begin + n * N)
            u.append(run.u[some].reshape(n, N))
            way = (run.y - base)[some].reshape(n, N)
            if n > 1:
                slope = float(np.polyfit(np.arange(n) * N, way.mean(axis=1), 1)[0])
            else:
                slope = 0.0
            velocity = scale * float(experiment.velocities[s])
            if velocity:
                way = way - slope * np.arange(n * N).reshape(n, N)
                drifts.append(slope * run.fs / velocity)
            y.append(way - way.mean())
        if u:
            found[label] = _Periods(
                np.concatenate(u), np.concatenate(y), max(drifts, key=abs, default=0.0)
            )
    return found


def _require_same_motion(
    run: _Run, experiment: AxisExperiment, *, base: np.ndarray, N: int, travel: float
) -> None:
    """Refuse the trace of an axis in motion for a design at rest, and one at rest for a design in
    motion.

    At rest the position repeats. In motion it moves on by more than its swing, because the
    multisine is slower.
    """
    unit = run.labels["y_unit"] or experiment.position_unit
    velocity = float(np.abs(experiment.velocities).max())
    if velocity:
        moved, size = float(np.ptp(run.y)), "in all"
        same = moved > _LITTLE * np.ptp(base)
    else:
        periods = run.y[: min(run.y.size, experiment.n_rows) // N * N].reshape(-1, N)
        steps = np.diff(periods, axis=0).mean(axis=1)
        if not steps.size:
            return
        swing = np.ptp(periods[:-1] - steps[:, None] * np.arange(N) / N, axis=1)
        moved, size = float(np.median(np.abs(steps))), "a period"
        same = moved <= max(np.median(swing), travel)
    if not same:
        raise ValueError(
            "experiment must be at rest or in motion like its trace, got a base velocity of"
            f" {velocity:g} {experiment.position_unit}/s and a position that moves by {moved:.3g}"
            f" {unit} {size}: was another design played, or is y in another unit?"
        )


def _likeness(U: np.ndarray, R: np.ndarray, lines: np.ndarray) -> float:
    """Return the smoothness of U over R from line to line, 0 to 1; a delay has equal steps over
    equal distances.

    A single line counts as smooth.
    """
    if lines.size < 2:
        return 1.0
    H = U / R
    steps = np.divide(
        H[1:] * H[:-1].conj(),
        np.abs(H[1:] * H[:-1]),
        out=np.zeros(H.size - 1, complex),
        where=H[1:] != 0,
    )
    widths = np.diff(lines)
    return float(sum(abs(steps[widths == one].sum()) for one in np.unique(widths)) / steps.size)


def _match_realizations(parts: list[_Periods], drawn: np.ndarray, lines: np.ndarray) -> list[int]:
    """Return the trace that responds to each realisation; refuse a realisation without one."""
    U, R = (rfft_at(one, lines) for one in (np.stack([one.u.mean(axis=0) for one in parts]), drawn))
    found = np.array([[_likeness(one, drawn_one, lines) for one in U] for drawn_one in R])
    total = np.array([np.mean((one.u - one.u.mean(axis=1, keepdims=True)) ** 2) for one in parts])
    found = found * (
        2 * np.sum(squared_modulus(U), axis=1) / drawn.shape[1] ** 2 > _PERIODIC * total
    )
    order = [int(m) for m in found.argmax(axis=1)]
    for m, likely in enumerate(found.max(axis=1)):
        if not likely > _MIN_LIKENESS or len(set(order)) < len(order):
            raise ValueError(
                "path must be the trace of the played signal, got a force that agrees with"
                f" realisation {m + 1} by {100 * likely:.0f} % only. Check the file, its"
                " sampling frequency, and start"
            )
    return order


def _same_signal(A: np.ndarray, R: np.ndarray, *, lines: np.ndarray, N: int) -> float:
    """Return the share of the power of spectra A (F,) that is not R with one gain and a delay of a
    few samples.
    """
    delays = np.exp(-2j * np.pi * np.outer(np.arange(-4, 5), lines) / N)
    gain = np.max(np.abs(np.sum(A * (R * delays).conj(), axis=1).real)) ** 2 / np.sum(
        squared_modulus(R)
    )
    return float(1 - gain / np.sum(squared_modulus(A)))


def _examine_trace(experiment: AxisExperiment, record: Record) -> bool:
    """Return whether force and position are as the design expects, apart from friction.

    Refuses set points in place of measured signals; warns of a limit, a wrong sign, another size
    than expected.
    """
    lines, N = record.lines.excited, record.n_samples
    U, Y, R = (rfft_at(one.mean(axis=1), lines) for one in (record.u, record.y, record.r))
    for name, A, expected, cure in (
        (
            "u",
            U,
            experiment.force_response,
            "trace the force, torque or current set point behind the loops",
        ),
        ("y", Y, experiment.position_response, "trace the actual position"),
    ):
        if (
            _same_signal(A[0], R[0], lines=lines, N=N) < _SAME_SIGNAL
            and _same_signal(expected * R[0], R[0], lines=lines, N=N) > _OTHER_SIGNAL
        ):
            raise ValueError(
                f"{name} must be measured in the loop, got the multisine that was played: {cure}"
            )
    warn_about_channel("u", np.ascontiguousarray(record.u[0]).ravel(), N)
    _require_start(U / R / experiment.force_response, record)
    upper = slice(-max(int(_UPPER_SHARE * lines.size), 3), None)
    ratios = {
        "u": (U / R / experiment.force_response)[:, upper],
        "y": (Y / R / experiment.position_response)[:, upper],
    }
    means = {name: np.mean(one / np.abs(one)) for name, one in ratios.items()}
    turns = {
        name: float(np.degrees(np.angle(one))) * (abs(one) > _AGREE) for name, one in means.items()
    }
    if all(abs(turn) > _TURNED for turn in turns.values()):
        raise ValueError(
            "path must begin with the played signal, or start must be the time at which it"
            " begins, got u and y with the opposite sign, as after half a period"
        )
    units = {
        "u": (experiment.force_unit, record.u_unit),
        "y": (experiment.position_unit, record.y_unit),
    }
    gains = {name: float(np.median(np.abs(one))) for name, one in ratios.items()}
    other = (
        f"a drive with another velocity feedforward or other gains (assumed: {experiment.drive})"
    )
    similar = (
        1 / _SIMILAR < gains["u"] / gains["y"] < _SIMILAR
        and abs(turns["u"] - turns["y"]) < 180 - _TURNED
    )
    found = True
    for name, turn in turns.items():
        gain, (designed, traced) = gains[name], units[name]
        if abs(turn) > _TURNED:
            data_warning(
                f"{name} has the sign opposite to the design: reverse it in the trace, or G has a"
                " negative mass"
            )
        elif abs(turn) > 180 - _TURNED or (
            traced in ("", designed) and not 1 / _UNIT_FACTOR < gain < _UNIT_FACTOR
        ):
            if similar:
                first = f"is it {other}, because u and y differ by one factor"
            else:
                first = f"is it another signal, {other}"
            data_warning(
                f"{name} is {gain:.3g} times the expected size, turned by {turn:.0f} deg, on"
                f" the upper lines, where friction hardly counts: {first}, is it in another unit"
                f" than {designed}, or is the machine another one?"
            )
        else:
            continue
        found = False
    return found


def _require_even_periods(record: Record) -> None:
    """Refuse periods of very different size: some of them do not belong to the kept ones."""
    size = np.sum(squared_modulus(rfft_at(record.u, record.lines.excited)), axis=2).min(axis=0)
    if size.min() * _FACTOR**2 < size.max():
        first, last = np.sqrt(2 * size[[size.argmin(), size.argmax()]]) / record.n_samples
        raise ValueError(
            "path must begin with the played signal, or start must be the time at which it"
            f" begins, got a force of {first:.2g} to {last:.2g} {record.u_unit} rms from period"
            " to period"
        )


def _require_start(ratio: np.ndarray, record: Record) -> None:
    """Refuse a force whose phases, against the design (M, F), show that the trace begins
    elsewhere.
    """
    N = record.n_samples
    spectrum = np.zeros(N // 2 + 1, dtype=complex)
    spectrum[record.lines.excited] = np.mean(ratio / np.abs(ratio), axis=0)
    # 1: all lines agree on this delay
    agreement = np.abs(np.fft.irfft(spectrum, N)) * N / 2 / record.lines.excited.size
    late, near, half = int(np.argmax(agreement)), max(int(_START * N), 1), N // 2
    late = (
        late + half // 2
    ) % half - half // 2  # after half a period odd lines repeat with the other sign
    if (
        agreement[late] > _AGREE
        and max(agreement[: near + 1].max(), agreement[-near:].max()) < _AGREE * agreement[late]
    ):
        raise ValueError(
            "path must begin with the played signal, or start must be the time at which it"
            f" begins, got a force that is {late / record.fs:.3g} s late, up to half periods"
        )


def _warn_of_other_level(experiment: AxisExperiment, label: str, record: Record) -> None:
    """Warn of a force far from the designed one: the loop is not the one of the design."""
    if record.u_unit not in ("", experiment.force_unit):
        return
    U = rfft_at(record.u.mean(axis=1), record.lines.excited) * 2 / record.n_samples
    reached = float(np.sqrt(np.mean(np.sum(squared_modulus(U), axis=1)) / 2))
    if not 1 / _FACTOR < reached / experiment.rms < _FACTOR:
        data_warning(
            f"the force is {reached:.3g} {experiment.force_unit} rms {label}, not"
            f" {experiment.rms:.3g} as designed. The cause is friction, another machine, or a"
            " drive with another velocity feedforward or other gains (assumed:"
            f" {experiment.drive}). Design the experiment again, with this record as source",
            LevelWarning if not np.any(experiment.velocities) else DataWarning,
        )


def _examine_motion(experiment: AxisExperiment, label: str, *, record: Record, off: float) -> None:
    """Refuse a base motion at another velocity; warn of an axis that turns back."""
    velocity = float(experiment.velocities[experiment.groups[label][0]])
    if not velocity:
        return
    moved = f"{(1 + off) * velocity:.3g}"
    if abs(off) > _OFF_VELOCITY:
        cure = f"is y the actual position in {experiment.position_unit}, and start right?"
        raise ValueError(
            f"y must move at {velocity:g} {experiment.position_unit}/s {label}, as in the file, got"
            f" {moved}: " + ("turn its sign" if abs(off + 2) < _OFF_VELOCITY else cure)
        )
    lines, N = record.lines.excited, record.n_samples
    spectrum = np.zeros((record.n_realizations, N // 2 + 1), dtype=complex)
    spectrum[:, lines] = 2j * np.pi * lines * record.f0 * rfft_at(record.y.mean(axis=1), lines)
    back = float(np.mean((np.fft.irfft(spectrum, N, axis=1) + velocity) * velocity < 0))
    if back > _TURNED_BACK:
        data_warning(
            f"the axis moves backwards in {100 * back:.2g} % of the samples {label}, so its"
            " friction does not slide all the time. Raise base_velocity, or lower the rms"
        )
