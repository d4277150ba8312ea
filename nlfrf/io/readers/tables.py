"""Tables written as text: CSV and its kin, as instruments, spreadsheets and logging programs write them."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from nlfrf._base.own_process import Contents, require_size
from nlfrf.io.readers.clock import is_time, told_clock, unit_of
from nlfrf.io.readers.layout import EMPTY, MARKS, Layout, decoded, layout_of

__all__ = ["contents", "table"]


START = 1 << 17  # bytes in which the layout is looked for
ROWS = 1 << 16  # rows of a long table that are read together: pandas holds several times as much beside them
NUMBERED = re.compile(r"\.\d+$")  # how columns that share a name are told apart
DATE, DAYTIME = re.compile(r"\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}"), re.compile(r"\d{1,2}:\d{2}(:\d{2})?")


def contents(path: Path) -> Contents:
    """Columns by the names above them; units from the row below these; the clock of a preamble."""
    with path.open("rb") as stream:
        start = stream.read(START)
    if b"\0" in start:  # UTF-16, which pandas would want to be told of
        return table(decoded(path.read_bytes()).encode())
    return table(start, path)


def table(start: bytes, path: Path | None = None) -> Contents:
    """The same from the first bytes of a file, or from all of them where no path is given."""
    head = start[:START]
    text = decoded(head[: head.rfind(b"\n") + 1] or head if len(head) == START else head)
    layout = layout_of(text)
    size, n_lines = len(start) if path is None else path.stat().st_size, lines_in(start, path)
    require_size(8 * len(layout.names) * n_lines, size)  # a short row is filled up with nan
    long = path is not None and size > START
    try:
        frame, notes = parsed(lambda: numbers_of(start, path, layout.first), layout, n_lines if long else 0)
    except ValueError as error:  # pandas counts from the first row of numbers
        raise ValueError(re.sub(r"(?<=in line )\d+", lambda n: str(int(n[0]) + layout.first), str(error))) from None
    notes |= {
        name: "holds texts"
        for name, numeric, moment in zip(layout.names, layout.numeric, layout.moments, strict=True)
        if not (numeric or moment)
    }
    arrays: dict[str, np.ndarray] = {}
    units = {name: unit for name, unit in zip(layout.names, layout.units, strict=True) if unit}
    for i, column in frame.items():
        if layout.numeric[i]:
            arrays[layout.names[i]] = column.to_numpy()
    for name, seconds in moments(frame, layout).items():
        arrays, units[name] = {name: seconds} | arrays, "s"
    last = len(layout.names) - 1
    if last and layout.names[last] == f"col{last + 1}" and np.isnan(arrays.get(layout.names[last], [0])).all():
        del arrays[layout.names[last]]  # behind a separator that ends every line
    clock = told_clock(layout.preamble, layout.delimiter, layout.decimal)
    if clock and not any(map(is_time, arrays)):
        return arrays, units, {"": clock}, notes
    axes, more = own_axes(list(arrays))
    return arrays, more | units, axes, notes


def own_axes(names: list[str]) -> tuple[dict[str, str], dict[str, str]]:
    """The time column of each channel where there is one before each, all of one name; and their units.

    >>> own_axes(["time (ms)", "u", "time (ms).3", "y"])
    ({'u': 'time (ms)', 'y': 'time (ms).3'}, {'time (ms).3': 'ms'})
    >>> own_axes(["time", "u", "y"])
    ({}, {})
    """
    first = names[0] if names and is_time(names[0]) else None
    axes: dict[str, str] = {}
    units: dict[str, str] = {}
    time = first
    for name in names[1:] if first else ():
        if NUMBERED.sub("", name) == first:
            time, unit = name, unit_of(first)
            units |= {name: unit} if unit else {}
        else:
            axes[name] = str(time)
    return (axes, units) if len(set(axes.values())) > 1 else ({}, {})


def lines_in(start: bytes, path: Path | None) -> int:
    """How many lines a table has at most."""
    if path is None:
        return 1 + start.count(b"\n") + start.count(b"\r")
    with path.open("rb") as stream:
        return 1 + sum(part.count(b"\n") + part.count(b"\r") for part in iter(lambda: stream.read(1 << 20), b""))


def numbers_of(start: bytes, path: Path | None, n_lines: int) -> Any:
    """A stream that stands behind so many lines: what pandas would skip are rows, with quotes that may not end."""
    stream = io.BytesIO(start) if path is None else path.open("rb")
    for _ in range(n_lines):
        stream.readline()
    return stream


def parsed(source: Callable[[], Any], layout: Layout, n_rows: int) -> tuple[Any, dict[str, str]]:
    """The columns of numbers, and those of dates and times as texts, by pandas; and what is no number in them."""
    import pandas as pd

    wanted = [i for i, numeric in enumerate(layout.numeric) if numeric or layout.moments[i]]
    options: dict[str, Any] = {
        "sep": r"\s+" if layout.delimiter == " " else layout.delimiter,
        "header": None,
        "names": list(range(len(layout.names))),
        "comment": layout.comment,
        "encoding_errors": "replace",
        "index_col": False,
    }
    if len(wanted) < len(layout.names):  # each of these costs time where it is not needed
        options["usecols"] = wanted
    if layout.padded:
        options["skipinitialspace"] = True
    newer = tuple(int(part) for part in pd.__version__.split(".")[:2]) >= (3, 1)
    exact: Any = {} if newer else {"float_precision": "round_trip"}  # newer ones always are
    kinds: Any = {i: float if layout.numeric[i] else str for i in wanted}
    empty = {"na_values": sorted(EMPTY - {""})}
    # pandas knows the usual words for an empty cell itself, and is a quarter slower where it is told more of them
    for told_empty in ({}, empty) if layout.decimal != layout.delimiter else ():
        try:
            told = exact | options | told_empty
            with source() as stream:
                if not n_rows:
                    return finite(pd.read_csv(stream, dtype=kinds, decimal=layout.decimal, **told), layout), {}
                with pd.read_csv(stream, dtype=kinds, decimal=layout.decimal, chunksize=ROWS, **told) as frames:
                    return joined((finite(frame, layout) for frame in frames), n_rows), {}
        except ValueError as error:
            if isinstance(error, pd.errors.ParserError):
                raise
    with source() as stream:
        frame = pd.read_csv(stream, dtype=str, **options, **empty)
    numbers = [i for i in wanted if layout.numeric[i]]
    first = frame[wanted[0]].fillna("").str.strip()
    told = frame.copy()
    for i in numbers:
        column = frame[i] if layout.decimal == "." else frame[i].str.replace(",", ".")
        frame[i] = pd.to_numeric(column.str.strip(), errors="coerce")
    bare = frame[numbers].isna().all(axis=1)
    kept = ~(bare & first.str.slice(0, 1).isin(MARKS))
    if bare.iloc[-1]:  # what stands below the numbers
        kept.iloc[int(np.flatnonzero(~bare)[-1]) + 1 if not bare.all() else 0 :] = False
    frame, told = frame[kept], told[kept]
    notes = {}
    for i in numbers:
        strange = frame[i].isna() & told[i].notna()
        if strange.any():
            row = int(np.argmax(strange))
            notes[layout.names[i]] = f"holds {told[i].iloc[row].strip()!r} in row {row + 1} of its numbers"
    return frame, notes


def finite(frame: Any, layout: Layout) -> Any:
    """The same without the numbers that are written as infinite: they stand for none, as empty cells do."""
    numbers = (column.to_numpy() for i, column in frame.items() if layout.numeric[i])
    return frame.replace([np.inf, -np.inf], np.nan) if any(np.isinf(one).any() for one in numbers) else frame


def joined(frames: Iterable[Any], n_rows: int) -> Any:
    """One table of the rows of several, put where they belong as they come; `n_rows` is about how many they are."""
    import pandas as pd

    columns: dict[int, np.ndarray] = {}
    filled = 0
    for frame in frames:
        for i, column in frame.items():
            part = column.to_numpy()
            if i not in columns:
                columns[i] = np.empty(max(n_rows, part.size), dtype=part.dtype)
            if filled + part.size > columns[i].size:
                columns[i] = np.resize(columns[i], 2 * columns[i].size)
            columns[i][filled : filled + part.size] = part
        filled += len(frame)
    return pd.DataFrame({i: column[:filled] for i, column in columns.items()}, copy=False)


def moments(frame: Any, layout: Layout) -> dict[str, np.ndarray]:
    """Seconds since the first row, of columns of dates and times; a date beside a time of day belongs to it."""
    found = [i for i in frame.columns if not layout.numeric[i]]
    if not found:
        return {}
    column = frame[found[0]].str.strip()
    if len(found) > 1 and not DAYTIME.search(str(column.iloc[0])):
        column = column + " " + frame[found[1]].str.strip()
        found = found[1:]
    try:
        seconds = since_first(column.str.replace(",", "."))
    except (ValueError, OverflowError):
        return {}
    return {layout.names[found[0]]: seconds}


def since_first(column: Any) -> np.ndarray:
    """Seconds since the first of texts that are dates with times, or times of a day."""
    import pandas as pd

    sample = str(column.iloc[0])
    if not DATE.match(sample):
        short = sample.count(":") == 1
        seconds = pd.to_timedelta("00:" + column if short else column).dt.total_seconds().to_numpy()
        seconds = seconds + 86400.0 * np.cumsum(np.diff(seconds, prepend=seconds[:1]) < -43200)  # past midnight
        return np.asarray(seconds - seconds[0])
    try:
        moment = pd.to_datetime(column, format="ISO8601", utc=True)
    except ValueError:
        moment = pd.to_datetime(column, dayfirst="." in sample[:6], utc=True)
    return np.asarray((moment - moment.iloc[0]).dt.total_seconds())
