"""Contents of a measurement file, and a guess at how to load it."""

from __future__ import annotations

import os
import shlex
import warnings
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np

from nlfrf._base.arguments import format_count, label_with_unit
from nlfrf._base.values import value
from nlfrf.bla.bla import Bla
from nlfrf.io.channels import Channels
from nlfrf.io.direction import (
    MAX_CANDIDATES,
    WHOLE_TOLERANCE,
    Direction,
    choose_output,
    find_direction,
    is_set_point,
)
from nlfrf.io.frf_tables import describe_frfs, find_frfs
from nlfrf.io.measurement_files import read_channels
from nlfrf.io.readers.clock import UNIT_SUFFIX, is_time_name
from nlfrf.io.results import value_in
from nlfrf.io.rows import find_lost_rows, find_rows_off, merge_alternating_rows, unfold_periods
from nlfrf.io.uneven_clock import UnevenClock
from nlfrf.records.record import Record
from nlfrf.records.screened import ScreenedStreams, screen_streams
from nlfrf.signals.axis_experiment import AxisExperiment

# largest share of the steps of a counter that differ from the others, at its wraps
_MAX_UNEVEN_STEPS = 0.01
_MIN_LENGTH_RATIO = 16  # length ratio beyond which a shorter channel is ignored
#: Reason why a channel is no candidate.
_PROGRESSIVE = "rises or falls throughout, as a clock or a counter does"


class _Channel(NamedTuple):
    """One channel of a file: its name, unit, samples, sampling frequency [Hz] (nan if unknown),
    extremes, rms.
    """

    name: str
    unit: str
    n: int
    fs: float
    low: float
    high: float
    rms: float


@value
class _FileContents:
    """Result of `inspect_file`.

    Fields
    ------
    path : str
        Path of the file.
    channels : tuple of Channel
        Streams of samples, in the order of the file.
    notes : dict of str to str
        Reasons why other entries of the file are no signals.
    u, y, reference : str
        Guess at input, output and reference, empty if there is none. A channel that rises
        throughout (a clock, counter or frequency) is none of them; a set point is no output.
    period : float
        Guess at the period of the input, in samples; 0 if it does not repeat.
    lines : str
        Description of the excited lines; for a file of this package of its contents.
    schema : str
        Schema of a file of this package, empty for other files.
    lost : str
        Description of the rows missing in the time column and of the whole periods, or of its
        unequal steps.
    uneven : bool
        True if the rows belong to no even clock, and must be put on one.
    doubt : str
        Reason why no input is proposed although a period was found.
    frf : str
        Description of FRFs in the file, and of what they lack; empty without FRFs.
    frf_options : tuple of str
        Options of `robust model` that the FRF needs.

    Examples
    --------
    >>> import tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> t = np.arange(400) / 100
    >>> np.savez(f"{folder.name}/run.npz", u=np.sin(2 * np.pi * t), y=np.cos(2 * np.pi * t), fs=100.0)
    >>> found = inspect_file(f"{folder.name}/run.npz")
    >>> [(channel.name, channel.fs) for channel in found.channels]
    [('u', 100.0), ('y', 100.0)]
    >>> folder.cleanup()
    """

    path: str
    channels: tuple[_Channel, ...]
    notes: dict[str, str]
    u: str
    y: str
    period: float
    lines: str
    schema: str
    lost: str = ""
    uneven: bool = False
    reference: str = ""
    doubt: str = ""
    frf: str = ""
    frf_options: tuple[str, ...] = ()

    @property
    def command(self) -> str:
        """The command that identifies the BLA of a record or models an FRF; words in capitals are
        to be replaced.
        """
        file, stem = _escape_dash(self.path), Path(self.path).stem
        if self.frf and not self.period:
            return shlex.join(
                [
                    "robust",
                    "model",
                    file,
                    *self.frf_options,
                    "-o",
                    _escape_dash(f"{stem}-model.json"),
                ]
            )
        options = () if self.schema else self.record_options()
        return shlex.join(
            ["nlfrf", "identify", file, *options, "-o", _escape_dash(f"{stem}-bla.npz")]
        )

    def record_options(self) -> list[str]:
        """Return the options of `nlfrf identify` for a file of another program."""
        options = [
            "--input",
            _quote_name(self.u or "INPUT"),
            "--output",
            _quote_name(self.y or "OUTPUT"),
        ]
        options += ["--hold", "zoh" if is_set_point(self.u) else "unknown"]
        options += ["--reference", _quote_name(self.reference)] if self.reference else []
        known = [one for one in self.channels if self.u in ("", one.name)]
        options += [] if any(np.isfinite(one.fs) for one in known) else ["--fs", "HERTZ"]
        if max((one.n for one in known), default=0) < 2 * self.period or (
            self.u and not self.period
        ):
            options += ["--period", f"{self.period:.0f}" if self.period else "SAMPLES"]
        return options + ["--resample"] * (
            self.uneven or abs(self.period - round(self.period)) > WHOLE_TOLERANCE
        )

    def __str__(self) -> str:
        if self.channels:
            what = format_count(len(self.channels), "channel")
        else:
            what = self.schema
        lines = [f"{Path(self.path).name}: {what}", *_table_of_channels(self.channels)]
        lines += [f"  {name}: {why}" for name, why in self.notes.items()]
        if self.schema:
            lines += [self.lines, f"written by this package, as {self.schema}"]
            return "\n".join([*lines, f"run:   {self.command}"] if self.channels else lines)
        lines += [self.frf] if self.frf else []
        if self.lost:
            lines.append(f"{'clock: ' if self.uneven else 'lost:  '}{self.lost}")
        if self.doubt:
            lines.append(f"guess: none, {self.doubt}; {self.lines}")
        elif self.u:
            if self.reference:
                reference = f", reference {self.reference}"
            else:
                reference = ""
            lines.append(
                f"guess: input {self.u or '?'}, output {self.y or '?'}{reference}; {self.lines}"
            )
            if not is_set_point(self.u):
                lines.append(
                    "hold:  zoh if the input is a command, band-limited if it was measured; unknown"
                    " here"
                )
        return "\n".join([*lines, f"run:   {self.command}"])


def _table_of_channels(channels: Sequence[_Channel]) -> list[str]:
    """Return a line for each channel below their head, in columns; none without channels."""
    rows: list[tuple[str, ...]] = [
        ("channel", "unit", "samples", "fs [Hz]", "lowest", "highest", "rms")
    ]
    for c in channels:
        numbers = ["" if np.isnan(x) else f"{x:.6g}" for x in (c.fs, c.low, c.high, c.rms)]
        rows.append((c.name, c.unit, str(c.n), *numbers))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    aligned = [
        [
            cell.ljust(w) if i < 2 else cell.rjust(w)
            for i, (cell, w) in enumerate(zip(row, widths, strict=True))
        ]
        for row in rows
    ]
    if channels:
        return [("  " + "  ".join(cells)).rstrip() for cells in aligned]
    return []


def _quote_name(name: str) -> str:
    """Return a channel's name as `nlfrf identify` takes it: in quotes, as in a table, if it
    contains commas.

    >>> print(_quote_name("Kraft"), _quote_name("Kraft, x"))
    Kraft "Kraft, x"
    """
    plain = "," not in name and not name.startswith('"') and name == name.strip()
    if plain:
        return name
    return '"' + name.replace('"', '""') + '"'


def _escape_dash(path: str) -> str:
    """Return a path that cannot be mistaken for an option, even if it begins with a dash."""
    if path.startswith("-"):
        return f"./{path}"
    return path


def inspect_file(path: str | os.PathLike[str]) -> _FileContents:
    """List the channels of a measurement file, and guess its input, output and period.

    Use this before `load_record` if you do not know the names in a file. Print the result.

    Parameters
    ----------
    path : path
        A file that `load_record` reads.

    Returns
    -------
    FileContents
        Printed, it is a table of the channels with the command to run next. The guess uses names
        first, then spectra. A nonlinear machine adds power on lines that are not excited. So the
        channel without power on these lines is the input.

    Raises
    ------
    ValueError
        The file cannot be read as the kind that its suffix states.
    FileNotFoundError
        No such file.

    Examples
    --------
    >>> import nlfrf, tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> ms = nlfrf.multisine(fs=100, n_samples=100, f_min=1, f_max=20, rng=1)
    >>> u = np.tile(ms.u[0], 4)
    >>> np.savez(f"{folder.name}/run.npz", force=u, position=2 * u, fs=100.0)
    >>> found = inspect_file(f"{folder.name}/run.npz")
    >>> found.u, found.y, found.lines
    ('force', 'position', 'period 100 samples (1 s), 4 periods; 6 lines from 1 to 19 Hz')
    >>> folder.cleanup()
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # loading the record asks for a doubtful clock
        file = read_channels(path)
        if file.text("schema"):
            return _own_contents(file)
        gaps = [name for name in file.signals if not np.isfinite(file.arrays[name][:2]).all()]
        file = merge_alternating_rows(file, gaps)
        for name in [name for name in file.signals if file.arrays[name].ndim == 2]:
            file = unfold_periods(file, [name])[0]
        streams = {name: np.squeeze(file.arrays[name]) for name in file.signals}
        streams = {name: stream for name, stream in streams.items() if stream.ndim == 1}
        channels = tuple(
            _channel_statistics(name, file.unit(name), fs=_known_rate(file, name), stream=stream)
            for name, stream in streams.items()
        )
    tables = find_frfs(file)
    frf, frf_options = describe_frfs(tables)
    n_lines = {
        file.arrays[one.columns[0]].size for one in tables.values()
    }  # other streams may be a record
    streams = {name: stream for name, stream in streams.items() if stream.size not in n_lines}
    candidates, progressive = _split_moving(file, streams)
    rows = {name: find_rows_off(file.seconds(name), _known_rate(file, name)) for name in candidates}
    filled = {
        name: stream if (lost := rows[name]) is None else lost.filled(stream)
        for name, stream in candidates.items()
    }
    groups = _group_by_length(filled)
    guesses = [
        find_direction(together, lambda name: _known_rate(file, name)) for together in groups
    ]
    guess = next(
        (one for one in guesses if one.period), next((one for one in guesses if one.u), Direction())
    )
    lost = rows.get(guess.u)
    return _FileContents(
        path=str(path),
        channels=channels,
        notes=dict.fromkeys(progressive, _PROGRESSIVE) | dict(file.notes),
        u=guess.u,
        y=choose_output(guess.u, candidates) if guess.u else "",
        period=guess.period,
        lines=guess.lines,
        schema="",
        lost="" if lost is None else lost.describe(round(guess.period)),
        uneven=isinstance(lost, UnevenClock),
        reference=guess.reference,
        doubt=guess.doubt,
        frf=frf,
        frf_options=frf_options,
    )


def _split_moving(
    file: Channels, streams: dict[str, np.ndarray]
) -> tuple[dict[str, np.ndarray], list[str]]:
    """Return the varying streams without times, and the names of those that only rise or fall."""
    times = {name for name in streams if is_time_name(name)} | set(file.clocks.values())
    varying = {
        name: stream
        for name, stream in streams.items()
        if name not in times and _is_varying(stream)
    }
    candidates = {name: stream for name, stream in varying.items() if not _is_progressive(stream)}
    return candidates, [name for name in varying if name not in candidates]


def screen_file(path: str | os.PathLike[str], contents: _FileContents) -> ScreenedStreams:
    """Look for the faults of the record in a file, with their places, to draw them.

    For a file without a periodic input all varying channels are shown; for several realisations the
    first one.

    Parameters
    ----------
    path : path
        The file.
    contents : FileContents
        Result of `inspect_file` for it.

    Raises
    ------
    ValueError
        The file contains no record.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # loading the record asks for a doubtful clock
        file = read_channels(path)
        if contents.schema:
            record = value_in(file)
            if not isinstance(record, Record):
                raise ValueError(
                    f"plot must show a record, got {path}: nlfrf plot draws {contents.schema}"
                )
            signals = _record_signals(record)
            return screen_streams(
                [one[0].ravel() for _, _, one in signals],
                [label_with_unit(name, unit, f"unit of {name}") for name, unit, _ in signals],
                n_inputs=record.n_inputs,
                fs=record.fs,
                period=float(record.n_samples),
            )
        inputs = [name for name in (contents.reference, contents.u) if name]
        names = [*inputs, *[contents.y] * bool(contents.y)]
        if not contents.u:
            varying = {
                name: file.arrays[name]
                for name in file.signals
                if file.arrays[name].squeeze().ndim == 1
            }
            moving = {
                name: x for name, x in varying.items() if _is_varying(x) and name not in file.times
            }
            names = list(next(iter(_group_by_length(moving)), {}))[:MAX_CANDIDATES]
        if contents.frf and not contents.u:
            raise ValueError(
                f"plot must show a record, got {path}, which contains an FRF: use robust model"
            )
        if not names:
            raise ValueError(f"plot must show a record, got {path}, in which no channel varies")
        streams = [file.signal("u", name) for name in names]
        lost = find_lost_rows(file.seconds(names[0]), _known_rate(file, names[0]))
        fs = _known_rate(file, *names)
    return screen_streams(
        streams,
        [
            label_with_unit(UNIT_SUFFIX.sub("", name), file.unit(name), "unit of it")
            for name in names
        ],
        n_inputs=len(inputs),
        fs=fs,
        period=contents.period,
        place=None if lost is None else lost.place,
    )


def _own_contents(file: Channels) -> _FileContents:
    """Return the contents of a file of this package: the channels of a record, or a description of
    anything else.
    """
    content = value_in(file)
    channels: tuple[_Channel, ...] = ()
    if isinstance(content, Record):
        fs = content.fs
        channels = tuple(
            _channel_statistics(name, unit, fs=fs, stream=one)
            for name, unit, one in _record_signals(content)
        )
    return _FileContents(
        path=file.path,
        channels=channels,
        notes={},
        u="",
        y="",
        period=0.0,
        lines=(
            str(content) if isinstance(content, Bla | AxisExperiment) else content.describe_extent()
        ),
        schema=file.text("schema"),
    )


def _record_signals(record: Record) -> list[tuple[str, str, np.ndarray]]:
    """Return name, unit and samples of every channel."""
    references = ("r",) if record.is_single else tuple(f"r {name}" for name in record.inputs)
    sides = [
        (record.inputs, record.input_units, record.u),
        (record.outputs, record.output_units, record.y),
        (references, record.input_units, record.r),
    ]
    return [
        (name, unit, one)
        for names, units, signals in sides
        if signals is not None
        for name, unit, one in zip(
            names, units, signals.reshape(len(names), *signals.shape[-3:]), strict=True
        )
    ]


def _is_varying(stream: np.ndarray) -> bool:
    """Return whether a stream of numbers or truth values varies and is finite."""
    return bool(np.isfinite(stream).all() and stream.max() > stream.min())


def _is_progressive(stream: np.ndarray) -> bool:
    """Return whether a stream only rises or falls, or has equal steps except for rare wraps: no
    periodic signal.

    >>> [_is_progressive(np.array(x)) for x in ([1, 2, 2, 9], [3.0, 1.0, 0.5], [0, 1, 0], np.arange(900) % 256)]
    [True, True, False, True]
    """
    steps = np.diff(stream.astype(float))
    steps = steps[steps != 0]
    even = np.abs(steps - np.median(steps)) <= 1e-6 * np.abs(np.median(steps))
    return bool(np.ptp(np.sign(steps)) == 0 or np.mean(even) >= 1 - _MAX_UNEVEN_STEPS)


def _known_rate(file: Channels, *names: str) -> float:
    """Return the sampling frequency of channels [Hz]; nan if the file does not have it."""
    with warnings.catch_warnings(), suppress(ValueError):
        warnings.simplefilter("ignore")  # loading the record asks for a doubtful clock
        return file.sampling_frequency(None, names)
    return np.nan


def _channel_statistics(name: str, unit: str, *, fs: float, stream: np.ndarray) -> _Channel:
    x = np.asarray(stream, dtype=float)
    x = x[np.isfinite(x)]
    if x.size:
        extremes = float(x.min()), float(x.max()), float(np.sqrt(np.mean(x**2)))
    else:
        extremes = (np.nan,) * 3
    return _Channel(name, unit, stream.size, fs, *extremes)


def _group_by_length(candidates: dict[str, np.ndarray]) -> list[dict[str, np.ndarray]]:
    """Return groups of channels with equal length, sampled together, the longest first.

    A channel much shorter than the longest is no measurement, but a state, a setting or an
    occasional temperature.
    """
    sizes = sorted({stream.size for stream in candidates.values()}, reverse=True)
    return [
        {name: stream for name, stream in candidates.items() if stream.size == size}
        for size in sizes
        if _MIN_LENGTH_RATIO * size >= sizes[0]
    ]
