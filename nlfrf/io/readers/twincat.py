"""Text exports of TwinCAT Scope (.csv, .txt), by pytcs."""

from __future__ import annotations

import re
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from nlfrf._base.own_process import Contents

#: Begin of an export: name of the scope, file, and start of the export, in quotes if blanks
#: separate cells.
_EXPORT_HEAD = re.compile(
    rb'(?:\xef\xbb\xbf)?Name[\t;:, ][^\n]*\nFile[\t;:, ][^\n]*\n"?Starttime of export'
)


def is_export(start: bytes) -> bool:
    """Return whether a file with these first bytes is an export of TwinCAT Scope."""
    return _EXPORT_HEAD.match(start) is not None


def contents(path: Path) -> Contents:
    """Read channels by name, each with its unit and its own time axis [ms].

    This module is loaded by its path in its own process, so it imports nothing from this package.
    """
    from pytcs import ScopeFile

    # names and units can have another encoding, in which numbers are the same bytes
    text = path.read_bytes().decode("utf-8-sig", errors="replace").replace("\r\n", "\n")
    delimiter = text[4]  # behind "Name", with which an export begins
    # pytcs accepts neither blanks nor commas between cells
    scope = ScopeFile(StringIO(_separate_by_tabs(text, delimiter) if delimiter in " ," else text))
    scope.load(backend="pandas")  # the other backend cannot read from memory
    found: Contents = ({}, {}, {}, {})
    arrays, units, clocks, notes = found
    axes: dict[bytes, str] = {}
    names = {name for name, _ in scope.items()}
    for name, channel in scope.items():
        time = np.asarray(channel.time, dtype=float)
        samples = np.asarray(channel.values, dtype=float)
        if time.size != samples.size:
            notes[name] = f"has {samples.size} samples at {time.size} times"
            continue
        # channels with equal times share one axis, so that they can be input and output of a record
        key = time.tobytes()
        if key not in axes:
            # a channel can have the name of the first axis
            first = not axes and "time" not in names
            axes[key] = "time" if first else f"axis{len(axes) + 1}.time"
            arrays[axes[key]], units[axes[key]] = time, "ms"
        arrays[name], clocks[name] = samples, axes[key]
        units[name] = str(channel.units or "")
    return found


def _separate_by_tabs(text: str, delimiter: str) -> str:
    """Return the export with tabs between the cells.

    The header names every column, and the first row of numbers has as many cells as there are
    columns. Cells of the header can contain the delimiter: decimal commas, names with blanks. Rows
    that cannot be cut to the width of the table are left out. The row of names is refused, because
    it is needed.
    """
    lines = text.split("\n")
    first = next(i for i, line in enumerate(lines) if i > 4 and re.match(r"-?\d", line))
    width = len(lines[first].rstrip(delimiter).split(delimiter))
    head = [line.rstrip() if delimiter == "," else line for line in lines[:first]]
    names = next(i for i, line in enumerate(head) if i > 0 and line.startswith(f"Name{delimiter}"))
    rows = []
    for i, line in enumerate(head):
        if i < names:
            if delimiter == ",":
                parted = line.split(",")
            else:
                parted = re.findall(r'"[^"]*"|[^ "]+', line)
            rows.append("\t".join(cell.strip('"') for cell in parted))
        elif not line.strip():
            rows.append("")
        else:
            cells = _split_header_row(line, delimiter, width, named=i == names)
            if cells is not None:
                rows.append("\t".join(cells))
    numbers = [line.replace(delimiter, "\t") for line in lines[first:]]
    return "\n".join(rows + numbers)


def _split_header_row(line: str, delimiter: str, width: int, *, named: bool) -> list[str] | None:
    """Split a row of the header into cells; None for a row with more cells than the table has
    columns.

    >>> _split_header_row("Name a test space Name b test space (1)", " ", 6, named=True)
    ['Name', 'a', 'test space', 'Name', 'b', 'test space (1)']
    >>> _split_header_row("Unit (None) dV (Voltage)", " ", 3, named=False)
    ['Unit', '(None)', 'dV (Voltage)']
    """
    cells = line.split(delimiter)
    if len(cells) == width:
        return cells
    if delimiter == " ":
        cells = _join_words([cell for cell in cells if cell], named)
    if len(cells) == width:
        return cells
    if named:
        raise ValueError(
            f"its names, {len(cells)} between {'blanks' if delimiter == ' ' else 'commas'} for"
            f" {width} columns, cannot be separated: export it with tabs or semicolons"
        )
    return None


def _join_words(tokens: list[str], named: bool) -> list[str]:
    """Join words that belong together: "(Voltage)" to its unit, "(1)" to a name that occurs a
    second time.

    This name is the longest run of words in front of "(1)" that occurs earlier, too.
    """
    repeated: set[tuple[str, ...]] = set()
    if named:
        for i, token in enumerate(tokens):
            if re.fullmatch(r"\(\d+\)", token):
                runs = [tuple(tokens[k:i]) for k in range(i) if "Name" not in tokens[k:i]]
                before = tokens[: max(i - 1, 0)]
                found = (
                    run
                    for run in runs
                    if any(tuple(before[j : j + len(run)]) == run for j in range(i - len(run)))
                )
                repeated.add(next(found, ()))
    cells: list[str] = []
    i = 0
    while i < len(tokens):
        run = next(
            (run for run in repeated if run and tuple(tokens[i : i + len(run)]) == run),
            (tokens[i],),
        )
        cells.append(" ".join(run))
        i += len(run)
        while i < len(tokens) and re.fullmatch(r"\(.*\)", tokens[i]) and tokens[i] != "(None)":
            cells[-1] += f" {tokens[i]}"
            i += 1
    return cells
