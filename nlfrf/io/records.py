"""Records to and from files."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any, TypedDict, Unpack, overload

import numpy as np

from nlfrf._base.arguments import as_list, data_warning, keep_warnings, short_form
from nlfrf._base.files import FILE_KINDS, RECORD_SCHEMAS, describe_wrong_file
from nlfrf.io.channels import Channels
from nlfrf.io.designs import given_or_read, load_design
from nlfrf.io.measurement_files import read_channels, to_paths
from nlfrf.io.rows import Seconds, align_rows, arrange_rows
from nlfrf.io.stored_records import (
    MULTIRECORD_SCHEMA,
    RECORD_SCHEMA,
    stored_multirecord,
    stored_records,
)
from nlfrf.records.periods import Cutting, records_from_streams
from nlfrf.records.record import Record
from nlfrf.records.samples import record_from_samples
from nlfrf.signals.lines import LineGrid
from nlfrf.signals.multisine import Multisine

Path_ = str | os.PathLike[str]


def _read_measurement(path: str | os.PathLike[str]) -> Channels:
    """Return the channels of a file that may be a record; refuse a result."""
    file = read_channels(path)
    schema = file.text("schema")
    if schema in FILE_KINDS and schema not in RECORD_SCHEMAS:
        raise ValueError(describe_wrong_file(path, schema, RECORD_SCHEMA))
    return file


class ReadOptions(TypedDict, total=False):
    """Options for cutting a record from files; the names are arguments of `load_record`."""

    fs: float | None
    n_samples: int | None
    lines: LineGrid | None
    n_discard: int
    resample: bool
    design: Multisine | Path_ | None
    hold: str | None
    start: Seconds
    stop: Seconds


@overload
def load_record(
    path: Path_ | Sequence[Path_],
    *,
    u: str = ...,
    y: str = ...,
    r: str | None = ...,
    **options: Unpack[ReadOptions],
) -> Record: ...


@overload
def load_record(
    path: Path_ | Sequence[Path_],
    *,
    u: str = ...,
    y: list[str] | tuple[str, ...],
    r: str | None = ...,
    **options: Unpack[ReadOptions],
) -> list[Record]: ...


@overload
def load_record(
    path: Path_ | Sequence[Path_],
    *,
    u: list[str] | tuple[str, ...] | None,
    y: str | list[str] | tuple[str, ...] | None = ...,
    r: str | list[str] | tuple[str, ...] | None = ...,
    **options: Unpack[ReadOptions],
) -> Record: ...


@keep_warnings
def load_record(
    path: Path_ | Sequence[Path_],
    *,
    u: str | list[str] | tuple[str, ...] | None = None,
    y: str | list[str] | tuple[str, ...] | None = None,
    r: str | list[str] | tuple[str, ...] | None = None,
    fs: float | None = None,
    n_samples: int | None = None,
    lines: LineGrid | None = None,
    n_discard: int = 0,
    resample: bool = False,
    design: Multisine | Path_ | None = None,
    hold: str | None = None,
    start: Seconds = None,
    stop: Seconds = None,
) -> Record | list[Record]:
    """Read a record from a measurement file, or from several files of one experiment.

    The samples are cut into periods and searched for faults, as in `record_from_samples`.
    `inspect_file` lists the channels of a file.

    Parameters
    ----------
    path : path, or a list of them
        ``.csv .txt .tsv .dat .asc`` as instruments and spreadsheets write them, ``.lvm``, ``.mat``
        (Simulink scopes, dSPACE, ``[t u y]`` matrices), ``.npz``, ``.h5``, ``.tdms``, ``.mf4
        .mdf``, ``.uff .unv``, ``.parquet .feather``, ``.wav``. Several files are several
        realisations (draws of the random phases) of one experiment, as in `join_records`.
    u, y, r : str, or a list of them
        Names of the input, output and reference; by default "u" and "y", and no reference. A name
        is that of a variable, column or channel. Write ``struct.field`` inside structs,
        ``matrix.2`` for a column of a matrix, and ``col2`` for a table without a header.

        - A list of names for `u` gives one record with all channels; `path` then has one file per
          experiment.
        - One name for `u` and a list for `y` give a list of records with the same input.
        - For files that `nlfrf.save` wrote with several inputs, `u` may be left out, and `y` chooses
          the outputs. Several files give one record with the experiments of all. The record keeps
          its reference if `r` is not given.
    fs : float, optional
        Sampling frequency [Hz]. By default it is read from the file: from a variable ``fs`` or
        ``Ts``, a rate stated for a channel, or a time channel. The unit of a time channel is
        seconds, if neither its name nor a row of units states another one.
    n_samples : int, optional
        Samples in one period; by default found from the input.
    lines : LineGrid, optional
        Excited lines and detection lines (not excited); by default found from the input.
    n_discard : int
        Number of periods to leave out at the start.
    resample : bool
        Interpolate to equal time steps, and find the start of each period from the repetition of
        the input; see `record_from_samples`.
    design : Multisine or path, optional
        Design that was played, or the file that ``nlfrf design`` wrote; see `record_from_samples`.
    hold : str, optional
        Input between its samples, "zoh" or "band-limited"; see `Record`. By default that of the
        file or of the design.
    start, stop : float, or a list of them, optional
        Start and end of the part to use, in seconds after the first row of the file. With lists
        each part is a realisation.

    Returns
    -------
    Record, or a list of them for one input and a list of y
        Record with the names and units of the channels in the file.

    Raises
    ------
    ValueError
        The file cannot be read as the kind that its suffix states; a name is not in the file (the
        message lists the existing names); or the signals make no record, as in
        `record_from_samples`.
    FileNotFoundError
        No such file.

    Warns
    -----
    DataWarning
        The given sampling frequency is not that of the file; the time channel has no unit; or rows
        are lost, so that only periods with all rows are kept. Also as in `record_from_samples`.

    Examples
    --------
    >>> import nlfrf
    >>> import tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> ms = nlfrf.multisine(fs=100, n_samples=100, f_min=1, f_max=20, rng=1)
    >>> nlfrf.save(Record(u=ms.u[None], y=2 * ms.u[None], fs=100, lines=ms.lines), f"{folder.name}/run.mat")
    >>> record = load_record(f"{folder.name}/run.mat", u="u", y="y")
    >>> bool(np.array_equal(record.u, ms.u[None]))
    True
    >>> folder.cleanup()
    """
    files = list(map(_read_measurement, to_paths(path)))
    if design is not None:
        design = given_or_read(design, load_design)
    options = Cutting(n_samples, lines, n_discard, resample, design, hold)
    _require_whole_records(files, start, stop)
    if not isinstance(u, str) and not isinstance(y, str) and all(map(_holds_several, files)):
        if r:
            raise ValueError(
                "r must be left out for a record that has its own references or none, got"
                f" {short_form(r)}"
            )
        return stored_multirecord(files, u, y=y, fs=fs, options=options)
    u, y = "u" if u is None else u, "y" if y is None else y
    one_output = isinstance(y, str)
    files, options = arrange_rows(files, (u, y, r), options=options, fs=fs, windows=(start, stop))
    if isinstance(u, list | tuple) and not (len(u) == 1 and one_output):
        names = {"u": list(u), "y": as_list(y), "r": [] if r is None else as_list(r)}
        return _load_channels(files, names, fs=fs, options=options)
    records = _load_outputs(files, *_checked_names(as_list(u)[0], y, r), fs=fs, options=options)
    if one_output:
        return records[0]
    return records


def _require_whole_records(files: list[Channels], start: Seconds, stop: Seconds) -> None:
    """Refuse a part of a record that was saved."""
    if (start, stop) != (None, None) and any(file.text("schema") for file in files):
        raise ValueError(
            f"start and stop must be left out for a record that was saved, got {start} and {stop}"
        )


def _load_outputs(
    files: list[Channels],
    names: Mapping[str, str],
    outputs: list[str],
    *,
    fs: float | None,
    options: Cutting,
) -> list[Record]:
    """Return a record for each output of one input, from files of this package or from measurement
    files.
    """
    if several := next((file.path for file in files if _holds_several(file)), None):
        raise ValueError(
            f"path must be a record of one input, got {several!r} with several: name its inputs in"
            " a list, or leave input out"
        )
    stored = [file.text("schema") == RECORD_SCHEMA for file in files]
    if any(stored) and not all(stored):
        raise ValueError(
            "path must be records that this package wrote, or none of them, got some of each"
        )
    return (stored_records if all(stored) else _measured_records)(
        files, names, outputs, fs, options
    )


def _checked_names(u: object, y: object, r: object) -> tuple[dict[str, str], list[str]]:
    """Return the names of input and reference, and of the outputs; refuse other types, or an output
    given twice.
    """
    for parameter, name in (("u", u), ("r", "" if r is None else r)):
        if not isinstance(name, str):
            raise ValueError(f"{parameter} must name one channel, got {short_form(name)}")
    outputs: list[Any] = as_list(y)
    if not all(isinstance(name, str) for name in outputs):
        raise ValueError(f"y must name an output, or be a list of names, got {short_form(y)}")
    if not outputs:
        raise ValueError("y must name at least one output, got none")
    if len(set(outputs)) < len(outputs):
        raise ValueError(f"y must name different outputs, got {short_form(list(outputs))}")
    return {"u": str(u)} | ({} if r is None else {"r": str(r)}), list(outputs)


def _measured_records(
    files: list[Channels],
    names: Mapping[str, str],
    outputs: list[str],
    fs: float | None,
    options: Cutting,
) -> list[Record]:
    streams = {
        signal: [file.signal(signal, name) for file in files] for signal, name in names.items()
    }
    measured = {"y": {name: [file.signal("y", name) for file in files] for name in outputs}}
    fs, options = align_rows(
        files,
        (*names.values(), *outputs),
        [(signal, streams[signal]) for signal in sorted(names)]
        + [("y", group) for group in measured["y"].values()],
        fs=fs,
        options=options,
    )
    for name in outputs:
        if files[0].full_name(name) == files[0].full_name(names["u"]):
            data_warning(f"y names the input itself, {name!r}: G is 1 in any case")
    labels = {name: files[0].labels(names["u"], name) for name in outputs}
    files.clear()  # their other arrays are no longer needed
    return records_from_streams(  # the only owner of the streams, so that it can free them
        streams.pop("u"),
        measured.pop("y"),
        r=streams.pop("r", None),
        fs=fs,
        options=options,
        labels=labels,
    )


# ---- Records of several inputs or outputs from files.


def _load_channels(
    files: list[Channels],
    names: Mapping[str, list[str]],
    *,
    fs: float | None,
    options: Cutting,
) -> Record:
    """Return the record with several inputs or outputs in measurement files, one file per
    experiment.
    """
    u, y, r = (names[parameter] for parameter in "uyr")
    if not (u and y):
        raise ValueError(
            f"u, y and r must be lists of names, at least one input and one output, got {u!r},"
            f" {y!r}, {r!r}"
        )
    signals = {
        parameter: [_stack_channels(parameter, some, file) for file in files]
        for parameter, some in names.items()
        if some
    }
    fs, cut = align_rows(files, (*u, *y, *r), sorted(signals.items()), fs=fs, options=options)
    return record_from_samples(
        signals["u"],
        signals["y"],
        r=signals.get("r"),
        fs=fs,
        n_samples=cut.n_samples,
        lines=options.lines,
        n_discard=options.n_discard,
        resample=options.resample,
        inputs=tuple(u),
        outputs=tuple(y),
        design=options.design,
        hold=options.hold,
    )


def _holds_several(file: Channels) -> bool:
    """Return whether a file is a record with several channels, written by this package."""
    return file.text("schema") == MULTIRECORD_SCHEMA


def _stack_channels(parameter: str, names: Sequence[str], file: Channels) -> np.ndarray:
    """Return (n_channels, n) channels of one file."""
    if file.text("schema"):
        raise ValueError(
            f"path must be measurement files, got {file.path!r}, written as {file.text('schema')}"
        )
    streams = [file.signal(parameter, name) for name in names]
    for name, stream in zip(names, streams, strict=True):
        if stream.size != streams[0].size:
            raise ValueError(
                f"{parameter} must be channels of equal length, got {streams[0].size} samples in"
                f" {names[0]!r} and {stream.size} in {name!r}"
            )
    return np.stack(streams)
