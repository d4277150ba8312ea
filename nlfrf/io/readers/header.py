"""The header of a text table, by a table of rules: names and units of the columns, and the sampling
rate or time in the preamble.

A row of the header has a label, as in ``Unit,V,V`` and ``Interval,0.001``, and `_RULES` give its
meaning. Or it has a cell for each column: names, units, types, comments. If a header has fewer or
more names than the table has columns, the numbers decide to which columns the names belong, or the
names are not used.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from enum import Enum
from itertools import repeat
from typing import NamedTuple

import numpy as np

from nlfrf._base.arguments import data_warning
from nlfrf.io.readers.clock import (
    MIN_DURATION,
    RATE_WORDS,
    STEP_NAME,
    STEP_WORDS,
    hertz_per_unit,
    is_rising,
    is_time_name,
    sampling_frequency,
    seconds_per_unit,
)
from nlfrf.io.readers.layout import COMMENT_MARKS, MOMENT, Layout, make_unique, split_cells
from nlfrf.io.readers.names import parse_unit

_TYPE_CELL = re.compile(
    r"(?:l?real|double|float|single|d?int|u?d?int\d*|bool|float\d\d|string|char|numeric)", re.I
)
_NUMBER_CELL = re.compile(r"[-+]?(?=[.,]?\d)\d*[.,]?\d*(?:e[-+]?\d+)?", re.I)


#: Meaning of the other cells of a labelled row.
Role = Enum("Role", "NAMES UNITS ABSCISSA_UNIT RATE STEP START TIME_OF_DAY")
#: Content of a column; a clock runs forward from row to row.
Kind = Enum("Kind", "CLOCK NUMBERS TEXT EMPTY")

#: The rules: role, label in the first cell, and pattern of every other cell.
_RULES = (
    (
        Role.NAMES,
        re.compile(r"(?:(?:channel|signal|trace|kanal)[ _]?)?names?|source|kanal", re.I),
        re.compile(r".*"),
    ),
    (
        Role.UNITS,
        re.compile(
            r"(?:(?:vertical|y|channel)[ _]?)?(?:units?|einheit(?:en)?)(?:[ _]?label)?", re.I
        ),
        re.compile(rf"(?!{_NUMBER_CELL.pattern}$).*|1", re.I),
    ),
    (
        Role.ABSCISSA_UNIT,
        re.compile(r"(?:horizontal|x|time)[ _]?units?(?:[ _]?label)?", re.I),
        re.compile(r"\D+"),
    ),
    (Role.RATE, re.compile(RATE_WORDS, re.I), re.compile(r"[\d., ]+\D{0,4}")),
    (Role.STEP, re.compile(rf"{STEP_WORDS}|interval|increment", re.I), _NUMBER_CELL),
    (Role.START, re.compile(r"x0|t0|start|x[ _]?(?:origin|start)", re.I), _NUMBER_CELL),
    (Role.TIME_OF_DAY, re.compile(r"time", re.I), re.compile(r"\d{1,2}:\d{2}:\d{2}(?:[.,]\d*)?")),
)
#: Names of rising columns other than times, of remarks that few rows have, and of sockets.
_COUNTER_NAME = re.compile(
    r"(?:row["
    r" _]?)?(?:index|idx|nr|no|row|samples?|count(?:er)?|number|#|record|line|points?|frames?|steps?|cycles?|"
    r"ticks?|(?:loop[ _]?)?iterations?|id|seq(?:uence)?)\.?",
    re.I,
)
_REMARK_NAME = re.compile(r"comments?|remarks?|notes?|kommentare?|bemerkung(?:en)?|.*:", re.I)
_SOCKET_NAME = re.compile(
    r"(?:analog|digital|ch|channel|input|trace|data|col|column)[ _.]?\w{1,2}", re.I
)
# largest relative difference between the steps of a column and those in the preamble
_SAME_CLOCK = 1e-3
#: Unlikely contents for the name of a time or counter (True), and for any other name (False).
_MISMATCHED_KINDS = {True: {Kind.NUMBERS}, False: {Kind.CLOCK, Kind.EMPTY}}
_MAX_UNPAIRED = 2  # most columns without a name, or names without a column

#: A line above a table with the clock: "Sample rate: 2 kHz", "Sampling interval,0.001".
_CLOCK_TEXT = re.compile(
    rf"(?P<rate>\b(?:{RATE_WORDS})\b)|(?P<step>\b(?:{STEP_WORDS})\b|^\W*(?:interval|increment)\b)",
    re.I,
)
#: The factor from the rate of a converter to that of the table, and names of the latter.
_DECIMATION = re.compile(
    r"\b(?:decimation|down[ -]?sampling|decimated?)\b[^\d\n]{0,20}(?<![\d.])([1-9]\d*)(?![\d.])",
    re.I,
)
_OUTPUT = re.compile(r"out|log|record|stor|sav|effective|decimat|result|file|export|display", re.I)
#: The number behind the name, possibly grouped by blanks or marks, and the next word: its unit, or
#: another cell.
_CLOCK_VALUE = re.compile(
    r"[^\w.]*?(?P<number>[-+]?(?=\.?\d)(?:\d{1,3}(?:["
    r" '’\u00a0\u202f]\d{3})+(?!\d)|\d)?[\d.,]*(?:e[+-]?\d+)?)"
    r"(?P<gap>[\s,;\"'|\[(]*)(?P<unit>1/s|s\^-1|[^\W\d][\w/]*(?: per sec(?:ond)?)?)?",
    re.I,
)


class _Clock(NamedTuple):
    """A sampling frequency [Hz] from a preamble; 0 if it has none, or if it has several, which are
    in `rates`.
    """

    fs: float = 0.0
    label: str = ""
    unit: str = ""
    rates: tuple[tuple[str, float], ...] = ()


class Header(NamedTuple):
    """Content of a header: names, units, steps and starts [s] of columns, the common clock, names
    without a column.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    steps: dict[int, float]
    starts: dict[int, float]
    clock: _Clock
    unplaced: dict[str, str]


def read_header(layout: Layout, columns: Mapping[int, np.ndarray]) -> Header:
    """Read the header of a table; `columns` are its columns of numbers, by their index."""
    kinds, width = _find_kinds(layout, columns), len(layout.numeric)
    rows, labelled, preamble = _sort_rows(layout, kinds)
    names, units, constants = _find_names(rows, kinds)
    if {*kinds[len(names) :]} == {Kind.EMPTY} and any(
        len(row) == width and row[: len(names)] == names for row in rows
    ):
        names = _slice_row(names, 0, width)  # each name ends in a separator, also the last one
    label = ""
    if _find_role(names) is Role.NAMES:
        label, names = names[0], names[len(names) > width :]
    placed, stated, unplaced = _place_names_and_units(names, units, kinds)
    stated = stated or _spread(labelled.get(Role.UNITS, []), kinds)
    abscissa = [*labelled.get(Role.ABSCISSA_UNIT, []), "", ""][1].strip("[]()")
    clock = _find_clock((*preamble, *constants), layout.delimiter, layout.decimal)
    if clock.fs and not clock.unit and (scale := seconds_per_unit(abscissa)):
        clock = _Clock(
            clock.fs / scale, clock.label, abscissa
        )  # step and unit are in different lines
    rate = clock.fs * (seconds_per_unit(abscissa or clock.unit) or 0.0)
    for j in [j for j in range(width) if kinds[j] is Kind.CLOCK and placed[j] in ("", label)]:
        # a rate in an unknown unit is ignored
        as_clock = (
            j in columns
            and rate > 0
            and abs(sampling_frequency(columns[j]) / rate - 1) < _SAME_CLOCK
        )
        stated[j] = stated[j] or (clock.unit if as_clock else "")
        placed[j] = (
            "time"
            if label or as_clock or (j not in columns and not any(layout.moments[j + 1 :]))
            else ""
        )
    steps, starts = _steps_and_starts(layout, labelled, kinds)
    return Header(
        tuple(make_unique(placed)),
        tuple(map(_bare_unit, stated, placed, repeat(abscissa))),
        steps,
        starts,
        clock,
        unplaced,
    )


def _place_names_and_units(
    names: list[str], units: list[str], kinds: list[Kind]
) -> tuple[list[str], list[str], dict[str, str]]:
    """Return the name of each column, its unit if there are any, and reasons for names without a
    column.
    """
    width, first = len(kinds), _place_names(names, kinds)
    why = (
        f"is one of {len(names)} names above {width} columns: give each column its name, or use"
        " col1, col2, ..."
    )
    if first is None:
        unplaced = dict.fromkeys(filter(None, names), why)
    else:
        unplaced = {}
    if unplaced:
        return [""] * width, [], unplaced
    shift = first or 0
    return _slice_row(names, -shift, width), _slice_row(units, -shift, width) if units else [], {}


def _is_unit(cell: str) -> bool:
    """Return whether a cell contains a unit, in brackets or bare."""
    return re.fullmatch(r"\[.*\]|\(.*\)", cell) is not None or parse_unit(cell) is not None


def _bare_unit(unit: str, name: str, abscissa: str) -> str:
    """Return the unit of a column without its brackets, that of the abscissa for a time without
    one.
    """
    unit = unit or (abscissa if is_time_name(name) else "")
    if unit == "-":
        return ""
    return unit.strip("[]()").strip()


def _sort_rows(
    layout: Layout, kinds: list[Kind]
) -> tuple[list[list[str]], dict[Role, list[str]], list[str]]:
    """Return the rows of a header without a label, those with a label by their role, and the lines
    of the preamble.

    If a row without the mark of a comment has names, rows with the mark give units only.
    """
    rows: list[tuple[list[str], bool]] = []  # with True for a comment
    labelled: dict[Role, list[str]] = {}
    preamble = []
    for i, line in enumerate(layout.header):
        cells = _split_header_line(line, layout.delimiter, len(layout.numeric))
        role = _find_role(cells)
        if role not in (None, Role.NAMES):
            labelled[role] = cells
        elif any(cells):
            rows.append((cells, line.lstrip().startswith(COMMENT_MARKS)))
        if i != len(layout.header) - 1 or role in (Role.RATE, Role.STEP) or re.search("[=:]", line):
            preamble.append(line)  # without the names, one of which may be that of a clock
    named = [
        row
        for row, comment in rows
        if not comment and _names_in(row, kinds) and not _is_units_row(row, [])
    ]
    kept = [
        row for row, comment in rows if not (comment and named) or _is_units_row(row, named[-1])
    ]
    return kept, labelled, preamble


def _steps_and_starts(
    layout: Layout, labelled: Mapping[Role, list[str]], kinds: list[Kind]
) -> tuple[dict[int, float], dict[int, float]]:
    """Return steps and starts [s] of the columns from labelled rows; a time of day is added to the
    start.
    """
    steps, starts = (
        {
            j: _parse_number(cell, layout.delimiter, layout.decimal)
            for j, cell in enumerate(_spread(row, kinds))
            if cell
        }
        for row in (labelled.get(Role.STEP, []), labelled.get(Role.START, []))
    )
    for j, cell in enumerate(_spread(labelled.get(Role.TIME_OF_DAY, []), kinds)):
        if cell:
            parts = enumerate(reversed(cell.replace(",", ".").split(":")))
            starts[j] = starts.get(j, 0.0) + sum(60**k * float(part) for k, part in parts)
    return steps, starts


def _find_kinds(layout: Layout, columns: Mapping[int, np.ndarray]) -> list[Kind]:
    kinds = []
    for j, filled in enumerate(layout.filled):
        if j in columns and not is_rising(columns[j]):
            kinds.append(Kind.NUMBERS)
        elif j in columns or layout.moments[j]:
            kinds.append(Kind.CLOCK)
        else:
            kinds.append(Kind.TEXT if filled else Kind.EMPTY)
    return kinds


def _split_header_line(line: str, delimiter: str, width: int) -> list[str]:
    """Split a line of the header into cells; none for a blank line, a rule, or a remark of one
    cell.
    """
    bare = line.strip()
    if not bare or set(bare) <= set("-=+| \t" + delimiter):
        return []
    marked = line.lstrip(" ")[0] in COMMENT_MARKS and bare[0] != delimiter
    if marked:
        bare = bare.lstrip("#%!*/ ")
    else:
        bare = line
    cells = split_cells(bare, delimiter)
    if len(cells) != width and (
        delimiter == " " or len(cells) == 1
    ):  # such names are separated by several blanks
        wider = re.split(r"\s{2,}|\t", bare.strip(' "'))
        if len(wider) == width:
            cells = wider
    if marked and len(cells) == 1 < width:
        return []
    return cells


def _find_role(cells: Sequence[str]) -> Role | None:
    """Return the role of a row by its label, None without a label.

    >>> [_find_role(row) for row in (["Unit", "V", "A"], ["dt", "0.001"], ["dt", "u", "y"])]
    [<Role.UNITS: 2>, <Role.STEP: 5>, None]
    """
    if cells:
        label = cells[0].rstrip(":")
    else:
        label = ""
    others = [cell for cell in cells[1:] if cell and cell != cells[0]]
    found = (
        role
        for role, name, cell in _RULES
        if name.fullmatch(label) and all(map(cell.fullmatch, others))
    )
    if others:
        return next(found, None)
    return None


def _slice_row(row: Sequence[str], start: int, width: int) -> list[str]:
    """Return `width` cells of a row from `start` on, which may be negative; cells that do not exist
    are empty.
    """
    return [row[i] if 0 <= i < len(row) else "" for i in range(start, start + width)]


def _spread(row: list[str], kinds: list[Kind]) -> list[str]:
    """Return the cells of a labelled row by column: at their place, or in turn if there are as many
    channels.

    >>> _spread(["Unit", "N", "", "mm"], [Kind.CLOCK, Kind.NUMBERS, Kind.CLOCK, Kind.NUMBERS])
    ['', 'N', '', 'mm']
    >>> _spread(["Unit", "N", "mm"], [Kind.NUMBERS, Kind.NUMBERS])     # no column lies below the label
    ['N', 'mm']
    """
    values = ["" if cell == row[0] else cell for cell in row]
    if len(row) >= len(kinds):
        return _slice_row(values, int(any(values[len(kinds) :])), len(kinds))
    given = [cell for cell in values if cell]
    numbers = [j for j, kind in enumerate(kinds) if kind is Kind.NUMBERS]
    return [
        given[numbers.index(j)] if j in numbers and len(given) == len(numbers) else ""
        for j in range(len(kinds))
    ]


def _find_names(rows: list[list[str]], kinds: list[Kind]) -> tuple[list[str], list[str], list[str]]:
    """Find names, units below them, and constants below names of clocks, upwards from the numbers.

    >>> kinds = [Kind.CLOCK, Kind.NUMBERS, Kind.NUMBERS]
    >>> _find_names([["X", "CH1", "Increment"], ["Sequence", "Volt", "1e-3"]], kinds)
    (['X', 'CH1', 'Increment'], ['Sequence', 'Volt', ''], ['Increment,1e-3'])
    >>> _find_names([["Time", "Analog 1", "Analog 2"], ["ms", "Torque", "Speed"]], kinds)     # a row of units and names
    (['Time', 'Torque', 'Speed'], ['ms', '', ''], [])
    >>> _find_names([["t", "u", "y"], ["s", "N", "mm"], ["", "load cell", "encoder"]], kinds)     # a row of comments
    (['t', 'u', 'y'], ['s', 'N', 'mm'], [])
    """
    rows = rows[:1] + [
        row for row in rows[1:] if not all(map(_TYPE_CELL.fullmatch, filter(None, row)))
    ]
    while len(rows) > 1 and len(rows[-1]) == 1 < len(kinds) - kinds.count(
        Kind.EMPTY
    ):  # "End Comments"
        rows = rows[:-1]
    over, above = [[], [], *(_names_in(earlier, kinds) for earlier in rows[:-1])][-2:]
    if rows:
        row = rows[-1]
    else:
        row = []
    if above and {*row[len(above) :]} <= {"", "-"}:
        row = _slice_row(row, 0, len(above))
        clocks = [
            j
            for j, name in enumerate(above)
            if STEP_NAME.fullmatch(name) and _NUMBER_CELL.fullmatch(row[j])
        ]
        constants = [f"{above[j]},{row[j]}" for j in clocks]
        row = ["" if clocks and _NUMBER_CELL.fullmatch(cell) else cell for cell in row]
        if (found := _names_and_units(above, row)) is not None:
            return (*found, constants)
    if over and len(above) == len(over) and all(map(_is_unit, above)):
        return over, above, []
    return _names_in(row, kinds), [], []


def _names_and_units(above: list[str], row: list[str]) -> tuple[list[str], list[str]] | None:
    """Return names and units from a row of names and the row below, which may contain both; None
    without units.
    """
    seconds = [
        is_time_name(name) and seconds_per_unit(cell.strip("[]() ") or "?")
        for name, cell in zip(above, row, strict=True)
    ]
    others = [name for name, second in zip(above, seconds, strict=True) if not second]
    sockets = all(map(_SOCKET_NAME.fullmatch, others)) or len({*others}) < len(others)
    if _is_units_row(row, above) or (any(seconds) and not sockets):
        return above, row
    if not any(seconds):
        return None
    names = [
        one if second else other for one, other, second in zip(above, row, seconds, strict=True)
    ]
    return names, [cell if second else "" for cell, second in zip(row, seconds, strict=True)]


def _names_in(row: list[str], kinds: list[Kind]) -> list[str]:
    """Return the names in a row; none for a line of a preamble, with numbers or dates, or too
    short.

    >>> kinds = [Kind.CLOCK, Kind.NUMBERS, Kind.NUMBERS, Kind.EMPTY]
    >>> _names_in(["time", "1", "2", ""], kinds), _names_in(["u", "y"], kinds), _names_in(["Range", "5.0"], kinds)
    (['time', '1', '2'], ['u', 'y'], [])
    """
    names = row[: max((j + 1 for j, cell in enumerate(row) if cell), default=0)]
    least = max(j + 1 for j, kind in enumerate(kinds) if kind is not Kind.EMPTY)
    if (
        names
        and _REMARK_NAME.fullmatch(names[-1])
        and (len(names) > least or kinds[0] is Kind.EMPTY)
    ):
        return _names_in(names[:-1], kinds)
    numbers = [cell for cell in names if _NUMBER_CELL.fullmatch(cell)]
    if len(numbers) == len(names) or any(map(MOMENT.match, names)):
        return []
    if least <= len(names) <= len(kinds):
        are_numbered = len({*numbers}) == len(numbers) and all(map(str.isdigit, numbers))
        if are_numbered or len(numbers) < 0.5 * len(names):
            return names
        return []
    near = range(max(2, least - _MAX_UNPAIRED), len(kinds) + _MAX_UNPAIRED + 1)
    if len(names) in near and not numbers and all(names):
        return names
    return []


def _place_names(names: list[str], kinds: list[Kind]) -> int | None:
    """Return the column of the first name; None if the numbers do not show it.

    Columns without a name are empty, or come first and run forward, as row numbers and times do. A
    time or a counter runs forward. Any other name hardly belongs to a clock.

    >>> clock, numbers = Kind.CLOCK, Kind.NUMBERS
    >>> _place_names(["time", "u", "y"], [clock, clock, numbers, numbers])
    1
    >>> _place_names(["time", "u", "y"], [clock, numbers, numbers, numbers])     # the missing name may be any
    >>> _place_names(["u", "y"], [Kind.EMPTY, numbers, Kind.EMPTY])     # either may be the channel
    """
    if not names or len(names) == len(kinds):
        return 0
    costs = {}
    for first in range(len(kinds) - len(names) + 1):
        # times and row numbers run forward
        runs = (is_time_name(name) or _COUNTER_NAME.fullmatch(name) is not None for name in names)
        pairs = list(zip(runs, kinds[first:], strict=False))
        unnamed = {*kinds[:first]} - {Kind.CLOCK} | {*kinds[first + len(names) :]}
        if unnamed <= {Kind.EMPTY} and (not first or (True, Kind.NUMBERS) not in pairs):
            costs[first] = sum(kind in _MISMATCHED_KINDS[counter] for counter, kind in pairs)
    best = [first for first, cost in costs.items() if cost == min(costs.values())]
    if len(best) == 1:
        return best[0]
    return None


def _is_units_row(row: list[str], above: list[str]) -> bool:
    """Return whether a row contains units: in all cells, or in most of them, below names that are
    no units.

    >>> _is_units_row(["ms", "A", "INC", "per mille"], ["time", "current", "position", "load"])
    True
    >>> _is_units_row(["time", "A", "V"], ["Motor", "Motor", "Motor"]), _is_units_row(["u", "m"], ["a", "b"])
    (False, False)
    """
    filled = [cell for cell in row if cell.strip("-#")]
    if any(map(is_time_name, row)) and not any(map(is_time_name, above)):
        return False
    units = sum(map(_is_unit, filled))
    if units == len(filled):
        return True
    names = len({*above}) == len(above) and not any(
        _is_unit(cell) for cell in above if len(cell) > 1
    )
    return names and all(above) and units > len(filled) / 2 and _is_unit(row[0])


def _find_clock(lines: Sequence[str], delimiter: str = ",", decimal: str = ".") -> _Clock:
    """Find the sampling frequency in the lines above a table; a rate in an unknown unit is ignored.

    A sampling time in seconds may be the duration of the record. If there are several rates, that
    of the output counts, and a rate before a decimation is divided by its factor.

    >>> _find_clock(("Device: A1", "Sample rate: 2 kHz"))
    _Clock(fs=2000.0, label='Sample rate', unit='s', rates=())
    >>> _find_clock(("Sampling time,125,[us]",)).fs, _find_clock(("dt,0.25",)).unit, _find_clock(("Notes",)).fs
    (8000.0, '', 0.0)
    >>> _find_clock(("ADC sample rate: 10 kHz", "Output sample rate: 1 kHz")).fs
    1000.0
    >>> _find_clock(("fs = 10", "dt = 1")).rates
    (('line 1', 10.0), ('line 2', 1.0))
    """
    clocks: dict[str, _Clock] = {}
    for i, line in enumerate(lines):
        found = _CLOCK_TEXT.search(line)
        if found:
            value = _CLOCK_VALUE.match(
                re.sub(r"^\s*[\[(]([^\])]*)[\])](.*)", r"\2 \1", line[found.end() :])
            )
        else:
            value = None
        if found is None or value is None:
            continue
        unit = value["unit"] or ""
        scale = (hertz_per_unit if found["rate"] else seconds_per_unit)(unit)
        if scale is None and value["gap"].strip() and not _is_unit(unit):
            scale, unit = 1.0, ""  # a word in a cell of its own
        number = _parse_number(value["number"], delimiter, decimal) * (scale or 0.0)
        if (
            found["step"]
            and found["step"].lower().endswith(("time", "zeit"))
            and number >= MIN_DURATION
        ):
            continue
        if 0 < number < np.inf:
            if found["rate"]:
                fs = number
            else:
                fs = float(f"{1 / number:.12g}")
            unit = "s" if found["rate"] or found[0] == "Delta_X" else unit  # by LabVIEW
            clocks[line[: found.start()].strip("#%!;/* ") or f"line {i + 1}"] = _Clock(
                fs, found[0].strip(), unit
            )
    factor = _DECIMATION.search("\n".join(lines))
    if clocks and factor and (rate := max(one.fs for one in clocks.values()) / int(factor[1])) > 0:
        if int(factor[1]) > 1 and not any(map(_OUTPUT.search, clocks)):
            data_warning(
                f"fs is taken as {rate:g} Hz, the rate above the table over {factor[0]!r}; give fs"
                " if it is another"
            )
        clocks |= {
            name: one._replace(fs=rate) for name, one in clocks.items() if not _OUTPUT.search(name)
        }
    outputs = [one for name, one in clocks.items() if _OUTPUT.search(name)] or [*clocks.values()]
    if len({f"{one.fs:.9g}" for one in outputs}) > 1:
        return _Clock(rates=tuple((name, one.fs) for name, one in clocks.items()))
    if outputs:
        return outputs[0]
    return _Clock()


def _parse_number(text: str, delimiter: str, decimal: str) -> float:
    """Parse a number in any notation; 0 if it is none or ambiguous: 51,200 may be 51200 or 51.2.

    >>> [_parse_number(text, ";", ".") for text in ("1'000", "1.000,5", "2,5", "51,200", "0,001", "1000,")]
    [1000.0, 1000.5, 2.5, 0.0, 0.001, 1000.0]
    >>> _parse_number("1000,1000", ",", "."), _parse_number("1000,2000", ",", ".")
    (1000.0, 0.0)
    """
    text = re.sub(r"[ '’\u00a0\u202f]", "", text).rstrip(",")
    if delimiter == "," and "," in text:  # one cell per channel
        if len(set(text.split(","))) == 1:
            text = text.split(",")[0]
        else:
            text = ""
    marks = sorted({".", ","} & set(text), key=text.rfind)
    if len(marks) == 2:
        text = text.replace(marks[0], "").replace(marks[1], ".")
    elif marks and text.count(marks[0]) > 1:
        text = text.replace(marks[0], "")
    elif marks:
        whole, _, rest = text.partition(marks[0])
        known = marks[0] == decimal or len(rest) != 3 or whole.lstrip("+-") in ("", "0")
        if known:
            text = f"{whole}.{rest}"
        else:
            text = ""
    try:
        return float(text)
    except ValueError:
        return 0.0
