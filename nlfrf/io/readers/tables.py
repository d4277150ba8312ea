"""Tables written as text: CSV and similar, from instruments, spreadsheets and logging programs."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from nlfrf._base.own_process import Contents, require_size
from nlfrf.io.readers.clock import NUMBER_SUFFIX, STEP_NAME, is_time_name, split_clock_name
from nlfrf.io.readers.header import Header, read_header
from nlfrf.io.readers.layout import COMMENT_MARKS, EMPTY_CELLS, Layout, decode_text, find_layout

if TYPE_CHECKING:
    import pandas as pd

_END_OF_LABVIEW_HEADER = b"***End_of_Header***"  # once for the file, and once for each measurement
_GAMRY_IMPEDANCE = re.compile(
    rb"^ZCURVE\tTABLE[^\n]*\n(?:[\t ][^\n]*\n?)+", re.M
)  # one of the tables in a .DTA
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?"
_WRITTEN_OUT = r"[-+]?\d\.\d+e[-+]\d+"  # without a decimal comma
#: Complex numbers: 1+2j, 1 - 2i, and those of LTspice: (-3dB,45°), and 1.0e+00,2.0e+00 between
#: tabs.
_COMPLEX = re.compile(
    rf"\(?(?P<re>{_NUMBER})\s*(?P<im>[-+]\s*{_NUMBER[5:]})\s*\*?[ij]\b\)?|"
    rf"\((?P<dB>{_NUMBER})dB,\s*(?P<deg>{_NUMBER})[^\s\d,)]{{1,2}}\)|"
    rf"(?<=\t)(?P<a>{_WRITTEN_OUT}),(?P<b>{_WRITTEN_OUT})(?=[\t\r\n]|$)",
    re.I,
)
_HEAD_BYTES = 1 << 17  # bytes in which the layout is searched
_MAX_WIDTH = 256  # most columns of a table with fewer rows
_BLOCK_ROWS = (
    1 << 16
)  # rows of a long table that are read at once: pandas needs several times their memory
_DATE, _DAYTIME = (
    re.compile(r"\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}"),
    re.compile(r"\d{1,2}:\d{2}(:\d{2})?"),
)


def contents(path: Path) -> Contents:
    """Read columns by name, with units and clocks from the rows above the numbers."""
    with path.open("rb") as stream:
        start = stream.read(_HEAD_BYTES)
    if (
        _END_OF_LABVIEW_HEADER in start
        and (n := path.read_bytes().count(_END_OF_LABVIEW_HEADER)) > 2
    ):
        raise ValueError(
            f"it holds {n - 1} measurements, one behind the other; save each in its own file"
        )
    if start.startswith(b"EXPLAIN") and (section := _GAMRY_IMPEDANCE.search(path.read_bytes())):
        return _read_table(section[0])
    tail = start[-200:].replace(b"\0", b"").decode("latin-1")
    if re.search(r"[ij]\)?\s|dB,|\t[^\s,]+,", tail, re.I) and _COMPLEX.search(tail):
        return _read_complex(decode_text(path.read_bytes()))
    if b"\0" in start:  # UTF-16, which pandas does not recognise
        return _read_table(decode_text(path.read_bytes()).encode())
    return _read_table(start, path)


def _read_complex(text: str) -> Contents:
    """Read a table with complex numbers; the parser gets the index of each number in its place."""
    numbers = [complex(np.nan)]

    def keep(found: re.Match[str]) -> str:
        if found["dB"]:
            z = 10 ** (float(found["dB"]) / 20) * np.exp(1j * np.radians(float(found["deg"])))
        else:
            z = complex(
                float(found["re"] or found["a"]),
                float("".join((found["im"] or found["b"]).split())),
            )
        numbers.append(z)
        return f"{len(numbers) - 1}e-300"

    arrays, units, clocks, notes = _read_table(_COMPLEX.sub(keep, text).encode())
    values = np.array(numbers)
    for name, x in arrays.items():
        if np.nanmin(x, initial=1.0) > 0 and np.nanmax(x, initial=0.0) < 1e-290:
            arrays[name] = values[np.rint(np.nan_to_num(1e300 * x)).astype(int)]
    return arrays, units, clocks, notes


def _read_table(start: bytes, path: Path | None = None) -> Contents:
    """Read a table from the first bytes of a file, or from all its bytes if there is no path."""
    head = start[:_HEAD_BYTES]
    text = decode_text(head[: head.rfind(b"\n") + 1] or head if len(head) == _HEAD_BYTES else head)
    layout = find_layout(text)
    size, n_lines = len(start) if path is None else path.stat().st_size, _count_lines(start, path)
    require_size(8 * len(layout.numeric) * n_lines, size)  # a short row is padded with nan
    if (width := len(layout.numeric)) > _MAX_WIDTH and width > 2 * n_lines:
        raise ValueError(
            f"it has {layout.n_data_rows} rows of {width} columns: transpose it: rows are samples,"
            " columns channels"
        )
    long = path is not None and size > _HEAD_BYTES
    try:
        frame, no_numbers = _parse_columns(
            lambda: _open_at_numbers(start, path, layout.n_header_lines),
            layout,
            n_lines if long else 0,
        )
    except ValueError as error:  # pandas counts from the first row of numbers
        raise ValueError(
            re.sub(
                r"(?<=in line )\d+", lambda n: str(int(n[0]) + layout.n_header_lines), str(error)
            )
        ) from None
    columns = {i: column.to_numpy() for i, column in frame.items() if layout.numeric[i]}
    header = read_header(layout, columns)
    names = header.names
    texts = (
        i
        for i, some in enumerate(layout.filled)
        if some and not (layout.numeric[i] or layout.moments[i])
    )
    notes = header.unplaced | {
        names[i]: why for i, why in (dict.fromkeys(texts, "holds texts") | no_numbers).items()
    }
    arrays = {names[i]: column for i, column in columns.items()}
    moments = {names[i]: seconds for i, seconds in _seconds_of_moments(frame, layout).items()}
    units = dict(zip(names, header.units, strict=True)) | dict.fromkeys(moments, "s")
    arrays = moments | arrays
    clocks, more = _clocks_of_table(header, list(columns), list(arrays))
    for name in () if any(map(is_time_name, arrays)) else moments:
        clocks.setdefault("", name)  # a time by its content, whatever its name
    return arrays | more, units, clocks, notes


def _clocks_of_table(
    header: Header, columns: list[int], arrays: list[str]
) -> tuple[dict[str, float | str], dict[str, np.ndarray]]:
    """Return the clock of each channel by its name, and more arrays for it: starts [s], a sampling
    time.
    """
    names, clocks = header.names, _own_time_columns(arrays)
    more: dict[str, np.ndarray] = {}
    channels = [i for i in columns if not is_time_name(names[i])]
    steps = {names[i]: header.steps[i] for i in channels if header.steps.get(i, 0.0) > 0}
    starts = {i: header.starts[i] for i in channels if i in header.starts}
    if len({*steps.values()}) > 1 or (
        len({*starts.values()}) > 1 and not any(map(is_time_name, arrays))
    ):
        clocks = {name: 1 / step for name, step in steps.items()}
        more = {f"{names[i]}.start": np.array(start) for i, start in starts.items()}
    elif header.clock.rates and not any(map(is_time_name, arrays)):
        more = {f"{name}.sample rate": np.array(fs) for name, fs in header.clock.rates}
    elif header.clock.fs and not any(map(is_time_name, arrays)):
        if STEP_NAME.fullmatch(split_clock_name(header.clock.label)[0]):
            label = header.clock.label
        else:
            label = "sampling time"
        if header.clock.unit:
            clocks = {"": header.clock.fs}
            more = {}
        else:
            clocks = {}
            more = {label: np.array(1 / header.clock.fs)}
    return clocks, more


def _own_time_columns(names: list[str]) -> dict[str, float | str]:
    """Return the time column of each channel if each has one before it, all with one name.

    >>> _own_time_columns(["time (ms)", "u", "time (ms).3", "y"]), _own_time_columns(["time", "u", "y"])
    ({'u': 'time (ms)', 'y': 'time (ms).3'}, {})
    """
    axes: dict[str, float | str] = {}
    if names:
        time = names[0]
    else:
        time = ""
    for name in names[1:] if is_time_name(time) else ():
        if NUMBER_SUFFIX.sub("", name) == names[0]:
            time = name
        else:
            axes[name] = time
    if len({*axes.values()}) > 1:
        return axes
    return {}


def _count_lines(start: bytes, path: Path | None) -> int:
    """Return the number of lines of a table, an upper bound of its rows."""
    if path is None:
        return 1 + start.count(b"\n") + start.count(b"\r")
    with path.open("rb") as stream:
        return 1 + sum(
            part.count(b"\n") + part.count(b"\r")
            for part in iter(lambda: stream.read(1 << 20), b"")
        )


def _open_at_numbers(start: bytes, path: Path | None, n_lines: int) -> BinaryIO:
    """Open a table behind its first `n_lines`: pandas would skip rows, whose quotes may not end."""
    stream = io.BytesIO(start) if path is None else path.open("rb")
    for _ in range(n_lines):
        stream.readline()
    return stream


def _parse_columns(
    source: Callable[[], BinaryIO], layout: Layout, n_rows: int
) -> tuple[pd.DataFrame, dict[int, str]]:
    """Parse the columns of numbers, and dates and times as texts, with pandas; note cells that are
    no number.
    """
    import pandas as pd

    wanted = [i for i, numeric in enumerate(layout.numeric) if numeric or layout.moments[i]]
    options: dict[str, object] = {
        "sep": r"\s+" if layout.delimiter == " " else layout.delimiter,
        "header": None,
        "names": list(range(len(layout.numeric))),
        "comment": layout.comment,
        "encoding_errors": "replace",
        "index_col": False,
    }
    if len(wanted) < len(layout.numeric):  # each of these options costs time
        options["usecols"] = wanted
    if layout.has_padding:
        options["skipinitialspace"] = True
    newer = tuple(int(part) for part in pd.__version__.split(".")[:2]) >= (3, 1)
    # newer versions are always exact
    exact: dict[str, object] = {} if newer else {"float_precision": "round_trip"}
    kinds: dict[int, type] = {i: float if layout.numeric[i] else str for i in wanted}
    empty = {"na_values": sorted(EMPTY_CELLS - {""})}
    # pandas has the usual words for an empty cell, and is a quarter slower with more of them
    for more_empty in ({}, empty) if layout.decimal != layout.delimiter else ():
        try:
            all_options = exact | options | more_empty
            with source() as stream:
                if not n_rows:
                    return (
                        _infinite_to_nan(
                            pd.read_csv(stream, dtype=kinds, decimal=layout.decimal, **all_options),
                            layout,
                        ),
                        {},
                    )
                with pd.read_csv(
                    stream,
                    dtype=kinds,
                    decimal=layout.decimal,
                    chunksize=_BLOCK_ROWS,
                    **all_options,
                ) as frames:
                    return (
                        _concatenate_frames(
                            (_infinite_to_nan(frame, layout) for frame in frames), n_rows
                        ),
                        {},
                    )
        except ValueError as error:
            if isinstance(error, pd.errors.ParserError):
                raise
    with source() as stream:
        return _numbers_of_texts(pd.read_csv(stream, dtype=str, **options, **empty), layout)


def _numbers_of_texts(frame: pd.DataFrame, layout: Layout) -> tuple[pd.DataFrame, dict[int, str]]:
    """Return the numbers of columns that were read as texts, without comments and text below; note
    other cells.
    """
    import pandas as pd

    numbers = [i for i in frame.columns if layout.numeric[i]]
    first = frame[frame.columns[0]].fillna("").str.strip()
    as_written = frame.copy()
    for i in numbers:
        if layout.decimal == ".":
            column = frame[i]
        else:
            column = frame[i].str.replace(",", ".")
        frame[i] = pd.to_numeric(column.str.strip(), errors="coerce")
    bare = frame[numbers].isna().all(axis=1)
    kept = ~(bare & first.str.slice(0, 1).isin(COMMENT_MARKS))
    if bare.iloc[-1]:  # text below the numbers
        kept.iloc[int(np.flatnonzero(~bare)[-1]) + 1 if not bare.all() else 0 :] = False
    frame, as_written = frame[kept], as_written[kept]
    notes = {}
    for i in numbers:
        no_number = frame[i].isna() & as_written[i].notna()
        if no_number.any():
            row = int(np.argmax(no_number))
            notes[i] = f"holds {as_written[i].iloc[row].strip()!r} in row {row + 1} of its numbers"
    return frame, notes


def _infinite_to_nan(frame: pd.DataFrame, layout: Layout) -> pd.DataFrame:
    """Replace infinite numbers by nan: instruments write them for missing values."""
    numbers = (column.to_numpy() for i, column in frame.items() if layout.numeric[i])
    if any(np.isinf(one).any() for one in numbers):
        return frame.replace([np.inf, -np.inf], np.nan)
    return frame


def _concatenate_frames(frames: Iterable[pd.DataFrame], n_rows: int) -> pd.DataFrame:
    """Concatenate frames into one, column by column as they come; `n_rows` is an estimate of their
    rows.
    """
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


def _seconds_of_moments(frame: pd.DataFrame, layout: Layout) -> dict[int, np.ndarray]:
    """Return the seconds since the first row of a column of dates and times; a date next to a time
    is joined to it.
    """
    found = [i for i in frame.columns if not layout.numeric[i]]
    if not found:
        return {}
    column = frame[found[0]].str.strip()
    if len(found) > 1 and not _DAYTIME.search(str(column.iloc[0])):
        column = column + " " + frame[found[1]].str.strip()
        found = found[1:]
    try:
        seconds = _seconds_since_first(column.str.replace(",", "."))
    except (ValueError, OverflowError):
        return {}
    return {found[0]: seconds}


def _seconds_since_first(column: pd.Series) -> np.ndarray:
    """Return the seconds since the first entry of texts with dates and times, or times of day."""
    import pandas as pd

    sample = str(column.iloc[0])
    if not _DATE.match(sample):
        short = sample.count(":") == 1
        seconds = pd.to_timedelta("00:" + column if short else column).dt.total_seconds().to_numpy()
        seconds = seconds + 86400.0 * np.cumsum(
            np.diff(seconds, prepend=seconds[:1]) < -43200
        )  # past midnight
        return np.asarray(seconds - seconds[0])
    try:
        moment = pd.to_datetime(column, format="ISO8601", utc=True)
    except ValueError:
        moment = pd.to_datetime(column, dayfirst="." in sample[:6], utc=True)
    return np.asarray((moment - moment.iloc[0]).dt.total_seconds())
