"""The layout of a table written as text: where its header, units and numbers stand, and its separators.

Each separator with each decimal sign is tried on the first lines; the one with most rows of numbers is taken, because
no rule on the text alone tells a decimal comma from a separating one.
"""

from __future__ import annotations

import csv
import itertools
import re
from collections import Counter
from dataclasses import dataclass
from typing import NamedTuple

__all__ = ["COMMENT_MARKS", "EMPTY_CELLS", "UNIT_CELL", "Layout", "decode_text", "find_layout", "make_unique"]


N_HEAD_LINES, N_SAMPLE_LINES = 400, 60  # lines that are read, and those of them that the layout is tried on
SEPARATORS = [
    (",", "."),
    (";", "."),
    (";", ","),
    ("\t", "."),
    ("\t", ","),
    (" ", "."),
    (" ", ","),
    ("|", "."),
    (",", ","),
]
#: A line whose last cell begins with a quote that does not end in it, and the most lines that such a cell may have.
OPEN_QUOTE, BREAKS = re.compile(r'^(?:[^"]|"[^"]*")*(?:^|[,;\t|])\s*"[^"]*$'), 5
COMMENT_MARKS = tuple("#%;!*/")
EMPTY_CELLS = {"", "-", "--", "---", "nan", "n/a", "na", "#n/a", "null", "none", "inf", "-inf", "+inf"}
NUMBER_WITH_POINT = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
NUMBER_WITH_COMMA = re.compile(r"[+-]?(\d+,?\d*|,\d+)([eE][+-]?\d+)?")
#: A unit as instruments print it: brackets, or factors of one or more SI and everyday units.
BARE_UNIT = (
    r"(?:(?:[munpkMGµμdc]|da)?(?:m|s|g|N|V|A|W|J|Pa|Hz|bar|rad|Nm|l|F|H|T|Wb|VA|strain|in|ft|lbf?|psi|eu|FS)|sec|min|h|"
    r"deg|°|°C|°F|K|C|%|rpm|rev|grad|inch|mic|Ohm|Ω|dB|counts?|cnts?|incr?|ticks?|digits?|lsb|bits?|raw|V/V|volts?|"
    r"amp(?:ere)?s?|newtons?|meters?|metres?|seconds?|m?sec|sekunden|"
    r"bool|1)"
)
UNIT_CELL = re.compile(
    rf"\[[^\]]*\]|\([^)]*\)|{BARE_UNIT}(?:(?:\^?-?\d|[²³])?(?:[*/·.]{BARE_UNIT}(?:\^?-?\d|[²³])?)*)", re.I
)
MOMENT = re.compile(r"\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}|\d{1,2}:\d{2}(:\d{2})?")
TYPE_CELL = re.compile(r"(?:l?real|double|float|single|d?int|u?d?int\d*|bool|float\d\d|string|char|numeric)", re.I)


@dataclass(frozen=True)
class Layout:
    """Separator and decimal sign, lines before the numbers, and names, units and kinds of the columns."""

    delimiter: str
    decimal: str
    n_header_lines: int
    names: tuple[str, ...]
    units: tuple[str, ...]
    numeric: tuple[bool, ...]
    moments: tuple[bool, ...]
    has_padding: bool
    comment: str | None
    preamble: tuple[str, ...]


class Cutting(NamedTuple):
    """One way to cut the lines: number of columns, which are numbers, how many are texts, rows that fit."""

    delimiter: str
    decimal: str
    width: int
    numeric: tuple[bool, ...]
    n_text_columns: int
    n_data_rows: int


def decode_text(content: bytes) -> str:
    """Decode the text of a file: UTF-8, UTF-16 with or without its mark, else the code page of a spreadsheet."""
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return content.decode("utf-16")
    head = content[:400]
    if len(head) > 8 and head.count(0) > 0.3 * len(head):
        return content.decode("utf-16-le" if head[1::2].count(0) > head[::2].count(0) else "utf-16-be")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def find_layout(text: str) -> Layout:
    """Find the layout in the first lines.

    Raises
    ------
    ValueError
        No rows of numbers.
    """
    head = join_quoted_lines(first_lines(text))
    lines = [line for line, _ in head]
    declared = next((line[4:].strip() or "\t" for line in lines[:3] if line.lower().startswith("sep=")), None)
    cuts = [cut_lines(lines[-N_SAMPLE_LINES:], *split) for split in SEPARATORS if declared in (None, split[0])]
    best = max(
        cuts,
        key=lambda c: (
            c.n_data_rows > 1,
            c.n_data_rows * (sum(c.numeric) > 1),
            sum(c.numeric) - 2 * c.n_text_columns,
            c.n_data_rows,
        ),
    )
    if best.n_data_rows < 2:
        raise ValueError("no rows of numbers were found: one row a sample, one column a channel, is what can be read")
    delimiter, decimal = best.delimiter, best.decimal
    rows = [split_cells(line, delimiter) for line in lines]
    first = next(i for i, row in enumerate(rows) if is_data(row, best))
    comment = next((line[0] for line in lines[first:] if line[:1] in COMMENT_MARKS and line[0] != delimiter), None)
    names, units = find_header(lines[:first], best)
    moments = tuple(MOMENT.match(cell) is not None for cell in rows[first])
    padded = delimiter != " " and any(f"{delimiter} " in line or line.startswith(" ") for line in lines[first:])
    above = tuple(lines[: max(first - 1, 0)])
    before = sum(n for _, n in head[:first])
    return Layout(delimiter, decimal, before, names, units, best.numeric, moments, padded, comment, above)


def first_lines(text: str) -> list[str]:
    """Return the first lines, without the last one where it may be cut."""
    end, place = 0, 0
    for _ in range(N_HEAD_LINES):
        place = text.find("\n", end)
        if place < 0:
            break
        end = place + 1
    part = text if place < 0 else text[:end]
    return [line.rstrip("\r") for line in part.split("\n")][: N_HEAD_LINES + 1]


def join_quoted_lines(lines: list[str]) -> list[tuple[str, int]]:
    """Join the lines of a quoted cell with a line break in it to one; return each with the number of its lines.

    >>> join_quoted_lines(['Disk: 5" wide', '"Force', '[N]","Way"', "1,2"])
    [('Disk: 5" wide', 1), ('"Force [N]","Way"', 2), ('1,2', 1)]
    """
    rows, i = [], 0
    while i < len(lines):
        n = 1
        if lines[i].count('"') % 2 and OPEN_QUOTE.search(lines[i]):
            longer = range(2, min(BREAKS, len(lines) - i) + 1)
            n = next((k for k in longer if " ".join(lines[i : i + k]).count('"') % 2 == 0), 1)
        rows.append((" ".join(lines[i : i + n]), n))
        i += n
    return rows


def split_cells(line: str, delimiter: str) -> list[str]:
    """Split a line into cells, stripped of blanks and quotes."""
    if delimiter == " ":
        return line.split()
    if '"' in line:
        row = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    else:
        row = line.split(delimiter)
    return [cell.strip().strip("'") for cell in row]


def is_number(cell: str, decimal: str) -> bool:
    """Return whether a cell is a number written with that decimal sign."""
    return (NUMBER_WITH_POINT if decimal == "." else NUMBER_WITH_COMMA).fullmatch(cell) is not None


def cut_lines(lines: list[str], delimiter: str, decimal: str) -> Cutting:
    """Cut the lines one way: the width of most rows with numbers, the columns that are numbers in nearly all."""
    rows = [split_cells(line, delimiter) for line in lines if line.strip() and line[0] not in COMMENT_MARKS]
    kinds = [[is_number(cell, decimal) for cell in row] for row in rows]
    widths = Counter(len(row) for row, kind in zip(rows, kinds, strict=True) if any(kind))
    width = max(widths, key=lambda w: (widths[w], w), default=0)
    body = [(row, kind) for row, kind in zip(rows, kinds, strict=True) if len(row) == width and any(kind)]
    if not body:
        return Cutting(delimiter, decimal, 0, (), 0, 0)
    half = body[len(body) // 2 :]  # behind whatever stands above the numbers
    numeric = tuple(
        any(kind[i] for _, kind in half) and all(kind[i] or row[i].lower() in EMPTY_CELLS for row, kind in half)
        for i in range(width)
    )
    filled = [any(row[i] for row, _ in half) for i in range(width)]
    texts = sum(some and not number for some, number in zip(filled, numeric, strict=True))
    found = Cutting(delimiter, decimal, width, numeric, texts, 0)
    return found._replace(n_data_rows=sum(is_data(row, found) for row in rows))


def is_data(row: list[str], c: Cutting) -> bool:
    """Return whether a row has the width of the table and numbers, or nothing, where those stand."""
    if len(row) != c.width or not any(c.numeric):
        return False
    held = [is_number(cell, c.decimal) for cell, wanted in zip(row, c.numeric, strict=True) if wanted]
    blank = [cell.lower() in EMPTY_CELLS for cell, wanted in zip(row, c.numeric, strict=True) if wanted]
    return any(held) and all(a or b for a, b in zip(held, blank, strict=True))


def find_header(lines: list[str], c: Cutting) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Find names and units in the lines above the numbers, or number the columns where there are none."""
    block: list[list[str]] = []
    for line in reversed(lines):
        bare = line.strip()
        if not bare or set(bare) <= set("-=+| \t" + c.delimiter):
            if block:
                break
            continue
        bare = bare.lstrip("#%!*/ ") if bare[0] in COMMENT_MARKS else line
        row = fit_to_width(split_cells(bare, c.delimiter), c.width)
        if row is None and c.delimiter == " ":  # names with blanks in them are separated by several
            row = fit_to_width(re.split(r"\s{2,}|\t", bare.strip()), c.width)
        if row is None or not any(row) or sum(is_number(cell, c.decimal) for cell in row) > 0.5 * c.width:
            break
        block.insert(0, row)
    units: list[str] = [""] * c.width
    while len(block) > 1:
        last = block[-1]
        if all(TYPE_CELL.fullmatch(cell) or not cell for cell in last):
            block.pop()
        elif is_units_row(last, block[-2]):
            units = [cell.strip("[]()").strip() if cell != "-" else "" for cell in last]
            block.pop()
        else:
            break
    names = block[-1] if block else [""] * c.width
    return tuple(make_unique(names)), tuple(units)


def is_units_row(row: list[str], above: list[str]) -> bool:
    """Return whether a row holds units: all of its cells are, or all but a few unknown ones below names that are none.

    >>> is_units_row(["ms", "A", "INC", "per mille"], ["time", "current", "position", "load"])
    True
    >>> is_units_row(["time", "A", "V"], ["Motor", "Motor", "Motor"]), is_units_row(["u", "m"], ["a", "b"])
    (False, False)
    """
    filled = [cell for cell in row if cell not in ("", "-")]
    units = sum(UNIT_CELL.fullmatch(cell) is not None for cell in filled)
    if units == len(filled):
        return True
    names = len({*above}) == len(above) and not any(UNIT_CELL.fullmatch(cell) for cell in above if len(cell) > 1)
    return names and all(above) and units > len(filled) / 2 and UNIT_CELL.fullmatch(row[0]) is not None


def fit_to_width(row: list[str], width: int) -> list[str] | None:
    """Fit a row of names to the width of the table: it may lack an empty last column, or the first (an index)."""
    while len(row) > width and not row[-1]:
        row = row[:-1]
    if len(row) == width - 1:
        row = [*row, ""]
    return row if len(row) == width else None


def make_unique(names: list[str]) -> list[str]:
    """Make names unique: columns without one are numbered, and so are those that share theirs.

    >>> make_unique(["y", "y", "y.2", ""])
    ['y', 'y.3', 'y.2', 'col4']
    """
    found: list[str] = []
    for i, name in enumerate(names):
        name = name or f"col{i + 1}"
        others = (f"{name}.{k}" for k in itertools.count(i + 1))
        found.append(name if name not in found else next(one for one in others if one not in {*names, *found}))
    return found
