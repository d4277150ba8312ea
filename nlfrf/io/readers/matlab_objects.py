"""MATLAB objects that hold signals: time series, timetables, datasets of Simulink, by mat-io."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from nlfrf._base.own_process import Contents

MAX_DEPTH = 12  # how far objects may lie in objects
SECONDS_PER_TIME_UNIT = {
    "milliseconds": 1e-3,
    "microseconds": 1e-6,
    "nanoseconds": 1e-9,
    "minutes": 60.0,
    "hours": 3600.0,
}
SECONDS_PER_TIME_UNIT |= {"days": 86400.0, "weeks": 604800.0}


def contents(path: Path) -> Contents:
    """Read signals by name with their units and times.

    This module is loaded by its path in a process of its own, so it imports nothing of this package.
    """
    from matio import load_from_mat

    found: Contents = ({}, {}, {}, {})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        variables = load_from_mat(str(path), add_table_attrs=True)
    for name, held in variables.items():
        if not name.startswith("__"):
            add_signals(name, held, found=found, depth=0)
    return found


def add_signals(name: str, held: object, *, found: Contents, depth: int) -> None:
    """Add the signals in a variable: series and tables are read, objects, structs and cells searched."""
    if depth > MAX_DEPTH:
        return
    if hasattr(held, "columns") and hasattr(held, "index"):
        add_table(name, held, found)
        return
    members = object_members(held)
    if members:
        if not add_time_series(name, members, found):
            label = single_text(members.get("Name"))
            for key, member in members.items():
                inner = name if key.startswith(("Storage", "Elements", "Values")) else f"{name}.{key}"
                add_signals(label if label and key == "Values" else inner, member, found=found, depth=depth + 1)
    elif isinstance(held, np.ndarray) and held.dtype.kind == "O":
        for i, element in enumerate(held.ravel()):
            label = single_text(object_members(element).get("Name"))
            add_signals(label or (name if held.size == 1 else f"{name}.{i + 1}"), element, found=found, depth=depth + 1)


def object_members(held: object) -> dict[str, object]:
    """Return the properties of an object, or the fields of a struct."""
    properties = getattr(held, "properties", None)
    if isinstance(properties, dict):
        return {str(key): member for key, member in properties.items()}
    if isinstance(held, np.ndarray) and held.dtype.names and held.size == 1:
        return {key: held.ravel()[0][key] for key in held.dtype.names}
    if isinstance(held, np.void) and held.dtype.names:
        return {key: held[key] for key in held.dtype.names}
    if isinstance(held, np.ndarray) and held.dtype.kind == "O" and held.size == 1:
        return object_members(held.ravel()[0])
    return {}


def add_time_series(name: str, members: dict[str, object], found: Contents) -> bool:
    """Add Data to found, with Time or the step in its TimeInfo as clock where there is one; False without Data."""
    data = first_numbers(members, "Data_", "Data")
    if data is None or data.size < 2:
        return False
    times = first_numbers(members, "Time_", "Time")
    about = next((object_members(members[key]) for key in ("TimeInfo_", "TimeInfo") if key in members), {})
    step = first_numbers(about, "Increment_", "Increment")
    unit = single_text(about.get("Units"))
    arrays, units, clocks, _ = found
    full = single_text(members.get("Name")) or name
    full = full if full not in arrays and full != "unnamed" else name
    clock: float | str | None = None
    if times is not None and times.size > 1:
        clock = f"{full}.time"
        arrays[clock], units[clock] = np.ravel(times).astype(float) * SECONDS_PER_TIME_UNIT.get(unit, 1.0), "s"
    elif step is not None and step.size == 1 and float(step.ravel()[0]) > 0:
        clock = 1 / (float(step.ravel()[0]) * SECONDS_PER_TIME_UNIT.get(unit, 1.0))
    rows = np.squeeze(np.asarray(data))
    n = times.size if times is not None and times.size > 1 else max(rows.shape)
    rows = rows[None] if rows.ndim == 1 else np.reshape(np.moveaxis(rows, rows.shape.index(n), -1), (-1, n))
    held = next((object_members(members[key]) for key in ("DataInfo_", "DataInfo") if key in members), {})
    for i, row in enumerate(rows):
        one = full if len(rows) == 1 else f"{full}.{i + 1}"
        arrays[one] = np.ascontiguousarray(row)
        if clock is not None:
            clocks[one] = clock
        if single_text(held.get("Units")):
            units[one] = single_text(held.get("Units"))
    return True


def add_table(name: str, frame: Any, found: Contents) -> None:
    """Add a table or timetable: its columns by name, its row times."""
    arrays, units, clocks, _ = found
    column_units = frame.attrs.get("varUnits") or frame.attrs.get("VariableUnits") or []
    clock = ""
    index = np.asarray(frame.index)
    if index.dtype.kind in "mM" and index.size > 1:
        clock = f"{name}.time"
        arrays[clock], units[clock] = (index - index[0]) / np.timedelta64(1, "ns") * 1e-9, "s"
    for i, key in enumerate(frame.columns):
        column = np.asarray(frame[key])
        full = f"{name}.{key}"
        if column.dtype.kind in "mM":
            arrays[full], units[full] = (column - column[0]) / np.timedelta64(1, "ns") * 1e-9, "s"
        if column.dtype.kind not in "fiub":
            continue
        arrays[full] = column
        if clock:
            clocks[full] = clock
        if i < len(column_units) and str(column_units[i]):
            units[full] = str(column_units[i])


def first_numbers(members: dict[str, object], *keys: str) -> np.ndarray | None:
    """Return the first of these members that is an array of numbers and not empty."""
    for key in keys:
        array = np.asarray(members.get(key, ()))
        if array.dtype.kind in "fiub" and array.size:
            return array
    return None


def single_text(held: object) -> str:
    """Return a text, empty where it is none."""
    array = np.asarray(held)
    return str(array.ravel()[0]) if array.dtype.kind in "UT" and array.size == 1 else ""
