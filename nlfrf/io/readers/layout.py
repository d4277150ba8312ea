"""The layout of a table written as text: place of header, units and numbers, and the separators.

Each separator with each decimal sign is tried on the first lines; the pair with most rows of
numbers is taken, because no rule on the text alone distinguishes a decimal comma from a separating
one.
"""

from __future__ import annotations

import csv
import itertools
import re
from collections import Counter
from dataclasses import dataclass, replace

# lines that are read, and lines on which the layout is tried
_N_HEAD_LINES = 400
_N_SAMPLE_LINES = 60
_SEPARATORS = [
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
#: A line whose last cell begins with a quote that does not end in it, and the most lines of such a
#: cell.
_OPEN_QUOTE, _BREAKS = re.compile(r'^(?:[^"]|"[^"]*")*(?:^|[,;\t|])\s*"[^"]*$'), 5
COMMENT_MARKS = tuple("#%;!*/")
EMPTY_CELLS = {
    "",
    "-",
    "--",
    "---",
    "nan",
    "n/a",
    "na",
    "#n/a",
    "null",
    "none",
    "inf",
    "-inf",
    "+inf",
}
_NUMBER_WITH_POINT = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_NUMBER_WITH_COMMA = re.compile(r"[+-]?(\d+,?\d*|,\d+)([eE][+-]?\d+)?")
MOMENT = re.compile(r"\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}|\d{1,2}:\d{2}(:\d{2})?")


@dataclass(frozen=True)
class _Cutting:
    """One way to cut the lines: number of columns, masks of numeric and of nonempty columns, number
    of fitting rows.
    """

    delimiter: str
    decimal: str
    width: int = 0
    numeric: tuple[bool, ...] = ()
    filled: tuple[bool, ...] = ()
    n_data_rows: int = 0


@dataclass(frozen=True, kw_only=True)
class Layout(_Cutting):
    """The cutting of the lines, and the text above and among the numbers."""

    n_header_lines: int  # lines of the file before the numbers
    header: tuple[
        str, ...
    ]  # these lines, and text left of the first rows of numbers, as a preamble
    moments: tuple[bool, ...]  # True for a column of dates or times of day
    has_padding: bool  # True if there are blanks next to the separators
    comment: str | None  # mark of comments among the numbers


def decode_text(content: bytes) -> str:
    """Decode the text of a file:

    UTF-8, UTF-16 with or without its mark, else the code page of a spreadsheet.
    """
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return content.decode("utf-16")
    head = content[:400]
    if len(head) > 8 and head.count(0) > 0.3 * len(head):
        return content.decode(
            "utf-16-le" if head[1::2].count(0) > head[::2].count(0) else "utf-16-be"
        )
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def find_layout(text: str) -> Layout:
    """Find the layout in the first lines.

    Raises
    ------
    ValueError
        There are no rows of numbers.
    """
    head = _join_quoted_lines(_first_lines(text))
    lines = [line for line, _ in head]
    best = _best_cutting(lines)
    rows = [split_cells(line, delimiter := best.delimiter) for line in lines]
    first = next(i for i, row in enumerate(rows) if _is_data(row, best))
    # pandas writes numbers above columns without names
    first += len(cells := [cell for cell in rows[first] if cell]) > 2 and cells == [
        str(i) for i in range(len(cells))
    ]
    comment = next(
        (line[0] for line in lines[first:] if line[:1] in COMMENT_MARKS and line[0] != delimiter),
        None,
    )
    moments = tuple(MOMENT.match(cell) is not None for cell in rows[first])
    padded = delimiter != " " and any(
        f"{delimiter} " in line or line.startswith(" ") for line in lines[first:]
    )
    if any(best.filled[: best.numeric.index(True)]):
        left = 0
    else:
        left = best.numeric.index(True)
    return Layout(
        **vars(best),
        n_header_lines=sum(n for _, n in head[:first]),
        header=(
            *(delimiter.join(row[:left]) for row in rows[first:] if any(row[:left])),
            *lines[:first],
        ),
        moments=moments,
        has_padding=padded,
        comment=comment,
    )


def _best_cutting(lines: list[str]) -> _Cutting:
    """Return the cutting with most numbers, or the one that a file declares; refuse a file without
    numbers.
    """
    declared = next(
        (line[4:].strip() or "\t" for line in lines[:3] if line.lower().startswith("sep=")), None
    )
    best = max(
        (
            _cut_lines(lines[-_N_SAMPLE_LINES:], *split)
            for split in _SEPARATORS
            if declared in (None, split[0])
        ),
        key=lambda c: (
            c.n_data_rows > 1,
            c.n_data_rows * (sum(c.numeric) > 1),
            3 * sum(c.numeric) - 2 * sum(c.filled),
            c.n_data_rows,
        ),
    )
    if best.n_data_rows < 2:
        raise ValueError(
            "no rows of numbers were found: a table needs one row per sample and one column per"
            " channel"
        )
    return best


def _first_lines(text: str) -> list[str]:
    """Return the first lines, without the last one if it may be incomplete."""
    end, place = 0, 0
    for _ in range(_N_HEAD_LINES):
        place = text.find("\n", end)
        if place < 0:
            break
        end = place + 1
    if place < 0:
        part = text
    else:
        part = text[:end]
    return [line.rstrip("\r") for line in part.split("\n")][: _N_HEAD_LINES + 1]


def _join_quoted_lines(lines: list[str]) -> list[tuple[str, int]]:
    """Join the lines of a quoted cell with line breaks; return each line with its number of
    original lines.

    >>> _join_quoted_lines(['Disk: 5" wide', '"Force', '[N]","Way"', "1,2"])
    [('Disk: 5" wide', 1), ('"Force [N]","Way"', 2), ('1,2', 1)]
    """
    rows, i = [], 0
    while i < len(lines):
        n = 1
        if lines[i].count('"') % 2 and _OPEN_QUOTE.search(lines[i]):
            longer = range(2, min(_BREAKS, len(lines) - i) + 1)
            n = next((k for k in longer if " ".join(lines[i : i + k]).count('"') % 2 == 0), 1)
        rows.append((" ".join(lines[i : i + n]), n))
        i += n
    return rows


def split_cells(line: str, delimiter: str) -> list[str]:
    """Split a line into cells, stripped of blanks and quotes."""
    if delimiter == " ":
        line = " ".join(line.split())
    if '"' in line:
        row = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    else:
        if line:
            row = line.split(delimiter)
        else:
            row = []
    return [
        cell.strip("'") if cell.startswith("'") else cell for cell in map(str.strip, row)
    ]  # keep the mark of Z'


def _is_number(cell: str, decimal: str) -> bool:
    """Return whether a cell is a number with this decimal sign."""
    return (_NUMBER_WITH_POINT if decimal == "." else _NUMBER_WITH_COMMA).fullmatch(
        cell
    ) is not None


def _cut_lines(lines: list[str], delimiter: str, decimal: str) -> _Cutting:
    """Cut the lines one way: width of most rows with numbers, columns with numbers in nearly
    all.
    """
    comments = {*COMMENT_MARKS} - {delimiter}
    rows = [
        split_cells(line, delimiter) for line in lines if line.strip() and line[0] not in comments
    ]
    kinds = [[_is_number(cell, decimal) for cell in row] for row in rows]
    widths = Counter(len(row) for row, kind in zip(rows, kinds, strict=True) if any(kind))
    width = max(widths, key=lambda w: (widths[w], w), default=0)
    body = [
        (row, kind)
        for row, kind in zip(rows, kinds, strict=True)
        if len(row) == width and any(kind)
    ]
    if not body:
        return _Cutting(delimiter, decimal)
    half = body[len(body) // 2 :]  # behind the text above the numbers
    numeric = tuple(
        any(kind[i] for _, kind in half)
        and all(kind[i] or row[i].lower() in EMPTY_CELLS for row, kind in half)
        for i in range(width)
    )
    filled = tuple(any(row[i] for row, _ in half) for i in range(width))
    found = _Cutting(delimiter, decimal, width, numeric, filled)
    return replace(found, n_data_rows=sum(_is_data(row, found) for row in rows))


def _is_data(row: list[str], c: _Cutting) -> bool:
    """Return whether a row has the width of the table, with numbers or empty cells in the numeric
    columns.
    """
    if len(row) != c.width or not any(c.numeric):
        return False
    held = [
        _is_number(cell, c.decimal) for cell, wanted in zip(row, c.numeric, strict=True) if wanted
    ]
    blank = [
        cell.lower() in EMPTY_CELLS for cell, wanted in zip(row, c.numeric, strict=True) if wanted
    ]
    return any(held) and all(a or b for a, b in zip(held, blank, strict=True))


def make_unique(names: list[str]) -> list[str]:
    """Make names unique: columns without a name are numbered, and so are those with equal names.

    >>> make_unique(["y", "y", "y.2", ""])
    ['y', 'y.3', 'y.2', 'col4']
    """
    found: list[str] = []
    for i, name in enumerate(names):
        name = name or f"col{i + 1}"
        others = (f"{name}.{k}" for k in itertools.count(i + 1))
        found.append(
            name
            if name not in found
            else next(one for one in others if one not in {*names, *found})
        )
    return found
