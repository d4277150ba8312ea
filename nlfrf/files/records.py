"""Records to and from files."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any, overload

import numpy as np

from nlfrf.excitation.lines import LineGrid
from nlfrf.excitation.multisine import Multisine
from nlfrf.files.channels import Channels, paths_of, read_channels
from nlfrf.files.designs import load_multisine
from nlfrf.files.lost_rows import keep_whole_periods
from nlfrf.files.stored_records import MULTIRECORD_SCHEMA, RECORD_SCHEMA, Asked, stored_records
from nlfrf.records.record import SAME_CLOCK, Record
from nlfrf.records.samples import records_from_streams
from nlfrf.shared.arguments import data_warning
from nlfrf.shared.transforms import all_finite
from nlfrf.shared.wording import shown

__all__ = ["load_record"]


FRAYED = 0.01  # share of rows at the ends of a file that may lack a channel without a word


Path_ = str | os.PathLike[str]


@overload
def load_record(
    path: Path_ | Sequence[Path_],
    *,
    u: str = ...,
    y: str = ...,
    r: str | None = ...,
    fs: float | None = ...,
    n_samples: int | None = ...,
    lines: LineGrid | None = ...,
    n_discard: int = ...,
    resample: bool = ...,
    design: Multisine | Path_ | None = ...,
    hold: str | None = ...,
) -> Record: ...


@overload
def load_record(
    path: Path_ | Sequence[Path_],
    *,
    u: str = ...,
    y: list[str] | tuple[str, ...],
    r: str | None = ...,
    fs: float | None = ...,
    n_samples: int | None = ...,
    lines: LineGrid | None = ...,
    n_discard: int = ...,
    resample: bool = ...,
    design: Multisine | Path_ | None = ...,
    hold: str | None = ...,
) -> list[Record]: ...


def load_record(
    path: Path_ | Sequence[Path_],
    *,
    u: str = "u",
    y: str | list[str] | tuple[str, ...] = "y",
    r: str | None = None,
    fs: float | None = None,
    n_samples: int | None = None,
    lines: LineGrid | None = None,
    n_discard: int = 0,
    resample: bool = False,
    design: Multisine | Path_ | None = None,
    hold: str | None = None,
) -> Record | list[Record]:
    """Read a record from a measurement file, or from several of one experiment.

    Parameters
    ----------
    path : path, or a list of them
        ``.csv .txt .tsv .dat .asc`` as instruments and spreadsheets write them, ``.lvm``, ``.mat`` (Simulink scopes,
        dSPACE, ``[t u y]`` matrices; objects by mat-io), ``.npz``, ``.h5``, ``.tdms``, ``.mf4 .mdf``, ``.uff .unv``,
        ``.parquet .feather``, ``.wav``; `inspect_file` shows what is inside. Several files are several realisations of
        one experiment, as in `join_records`.
    u, y, r : str
        Names of the input, output and reference: variables, columns or channels, ``struct.field`` inside structs,
        ``matrix.2`` for a column, ``col2`` where a table has no header. A list of names for `y` gives a list of
        records that share the input. The reference that `save_record` wrote comes along where `r` is not named.
    fs : float, optional
        Sampling frequency [Hz]; when not given from the file: a variable ``fs`` or ``Ts``, what a channel says of
        itself, a time channel (in seconds, or in the unit that its name or a units row tells).
    n_samples : int, optional
        Samples in one period; found from the input when not given.
    lines : LineGrid, optional
        Excited and detection lines; found from the input when not given.
    n_discard : int
        Periods to leave out at the start.
    resample : bool
        Cut the periods where the input shows that they stand; see `record_from_samples`.
    design : Multisine or path, optional
        What was played, or the file that ``nlfrf design`` wrote; see `record_from_samples`.
    hold : str, optional
        How u runs between its samples, "zoh" or "band-limited"; see `Record`. From the file or the design when not
        given.

    Returns
    -------
    Record, or a list of them for a list of y
        With the names and units that the file has for the channels.

    Raises
    ------
    ValueError
        A file that cannot be read as what its name says, names that are not in it (the message lists those that
        are), signals that do not make a record.
    FileNotFoundError
        No such file.

    Warns
    -----
    DataWarning
        A sampling frequency that is not that of the file, a time channel without a unit, one that shows lost rows: the
        periods that are whole by their times are kept.

    Examples
    --------
    >>> import nlfrf
    >>> import tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> ms = nlfrf.multisine(fs=100, n_samples=100, f_min=1, f_max=20, rng=1)
    >>> nlfrf.save_record(Record(u=ms.u[None], y=2 * ms.u[None], fs=100, lines=ms.lines), f"{folder.name}/run.mat")
    >>> record = load_record(f"{folder.name}/run.mat", u="u", y="y")
    >>> bool(np.array_equal(record.u, ms.u[None]))
    True
    >>> folder.cleanup()
    """
    refuse_wrong_names(u, y, r)
    paths = paths_of(path)
    if isinstance(design, str | os.PathLike):
        design = load_multisine(design)
    names = {"u": u} | ({} if r is None else {"r": r})
    outputs = [y] if isinstance(y, str) else list(y)
    asked = Asked(n_samples, lines, n_discard, resample, design, hold)
    files = [read_channels(one) for one in paths]
    if several := next((file.path for file in files if file.text("schema") == MULTIRECORD_SCHEMA), None):
        raise ValueError(
            f"path must be a record of one input, got {several!r} of several: take load_multirecord, or leave input out"
        )
    stored = [file.text("schema") == RECORD_SCHEMA for file in files]
    if any(stored) and not all(stored):
        raise ValueError("path must be records that this package wrote, or none of them, got some of each")
    read = stored_records if all(stored) else measured_records
    records = read(files, names, outputs, fs, asked)
    return records[0] if isinstance(y, str) else records


def refuse_wrong_names(u: Any, y: Any, r: Any) -> None:
    """Refuse what is no name of a channel, and an output that is asked for twice."""
    for parameter, name in (("u", u), ("r", "" if r is None else r)):
        if not isinstance(name, str):
            raise ValueError(
                f"{parameter} must name one channel, got {shown(name)}; load_multirecord reads several inputs"
            )
    outputs = [y] if isinstance(y, str) else y
    if not isinstance(outputs, list | tuple) or not all(isinstance(name, str) for name in outputs):
        raise ValueError(f"y must name an output, or be a list of names, got {shown(y)}")
    if not outputs:
        raise ValueError("y must name at least one output, got none")
    if len(set(outputs)) < len(outputs):
        raise ValueError(f"y must name different outputs, got {shown(list(outputs))}")


def measured_records(
    files: list[Channels], names: Mapping[str, str], outputs: list[str], fs: float | None, asked: Asked
) -> list[Record]:
    """A record for each output, of the streams of all files."""
    streams: dict[str, Any] = {signal: [file.signal(signal, name) for file in files] for signal, name in names.items()}
    streams["y"] = {name: [file.signal("y", name) for file in files] for name in outputs}
    asked_for = (*names.values(), *outputs)
    clocks = [file.sampling_frequency(fs, asked_for) for file in files]
    if max(clocks) > min(clocks) * (1 + SAME_CLOCK):
        raise ValueError(f"path must be files of one sampling frequency, got {min(clocks):g} to {max(clocks):g} Hz")
    groups = [*(streams[signal] for signal in names), *streams["y"].values()]
    times = [file.seconds(names["u"]) for file in files]
    asked = keep_whole_periods(
        times, groups, streams.get("r", streams["u"])[0], clocks[0], asked, [f.path for f in files]
    )
    whole({signal: streams[signal] for signal in names}, streams["y"])
    found = {name: [names["u"], name] for name in outputs}
    for name in outputs:
        if files[0].full_name(name) == files[0].full_name(names["u"]):
            data_warning(f"y names the input itself, {name!r}: G is 1 whatever was measured")
    labels: dict[str, Any] = {name: files[0].labels(*pair) for name, pair in found.items()}
    files.clear()  # what else they hold is not needed any more
    return records_from_streams(  # which alone holds the streams then, so that it can let go of them
        streams.pop("u"),
        streams.pop("y"),
        r=streams.pop("r", None),
        fs=clocks[0],
        n_samples=asked.n_samples,
        lines=asked.lines,
        n_discard=asked.n_discard,
        resample=asked.resample,
        design=asked.design,
        hold=asked.hold,
        labels=labels,
    )


def whole(*groups: dict[str, list[np.ndarray]]) -> None:
    """Cut the rows off both ends of each file where a channel has no number yet, or none any more."""
    for m in range(len(next(iter(groups[0].values())))):
        streams = {(i, name): group[name][m] for i, group in enumerate(groups) for name in group}
        sizes = {stream.size for stream in streams.values()}
        if len(sizes) > 1 or all(map(all_finite, streams.values())):
            continue
        held = np.logical_and.reduce([np.isfinite(s) for s in streams.values()])
        if not held.any():
            continue
        first, last = np.flatnonzero(held)[[0, -1]]
        inside = held[first : last + 1]
        if not inside.all():
            worst = min(streams, key=lambda key: np.isfinite(streams[key]).sum())
            bad = np.flatnonzero(~np.isfinite(streams[worst]))
            raise ValueError(
                f"{'y' if worst[0] else worst[1]} must be finite, got {bad.size} nan or infinite numbers, the first at "
                f"{bad[0]}; where a channel has a slower clock than the other its cells stay empty: record both at "
                "one, or fill the gaps and give the arrays to record_from_samples(u, y, fs=...)"
            )
        if held.size - inside.size > FRAYED * held.size:
            data_warning(
                f"{held.size - inside.size} of {held.size} rows at the ends of the file have no number in every "
                "channel; they are left out"
            )
        for (i, name), stream in streams.items():
            groups[i][name][m] = stream[first : last + 1]
