"""MATLAB v4 to v7 files by SciPy: variables, structs, Simulink scopes, dSPACE recordings.

Loaded by its path alone in a process of its own, so it imports nothing of this package: some damaged files crash SciPy.
"""

from __future__ import annotations

import warnings
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

__all__ = ["contents"]


MANY = 64  # elements of a struct array that are looked at
Found = tuple[dict[str, np.ndarray], dict[str, str], dict[str, Any], dict[str, str]]


def contents(path: Path) -> Found:
    """Arrays by name, their units, their clocks, and "#objects" noted where MATLAB objects lie in the file."""
    from scipy.io import loadmat

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # several objects share one name there
        raw = loadmat(path, squeeze_me=True, struct_as_record=False, appendmat=False)
    found: Found = ({}, {}, {}, {})
    for name, content in raw.items():
        if isinstance(name, str) and not name.startswith("__"):
            flatten(name, content, found)
    found = by_labels(found)
    if "__function_workspace__" in raw:
        found[3]["#objects"] = ""
    return found


def by_labels(found: Found) -> Found:
    """The same with the signals of scopes called by their labels, which stand in the notes, where these occur once."""
    arrays, units, clocks, labels = found
    often = Counter([*labels.values(), *arrays])
    short = {full: label for full, label in labels.items() if often[label] == 1}
    arrays, clocks = ({short.get(name, name): held for name, held in some.items()} for some in (arrays, clocks))
    return arrays, units, clocks, {}


def flatten(name: str, content: Any, found: Found) -> None:
    """Add a MATLAB variable: numbers and texts as they are, structs member by member, scopes and dSPACE by name."""
    members = getattr(content, "_fieldnames", None)
    if members is not None:
        if {"X", "Y"} <= set(members):
            flatten_dspace(content, found)
        elif "signals" in members:
            flatten_scope(name, content, found)
        else:
            for member in members:
                flatten(f"{name}.{member}", getattr(content, member), found)
        return
    array = np.asarray(content)
    if array.dtype.kind in "fiubUS" and array.dtype.names is None:
        found[0][name] = array
    elif array.dtype.kind == "O" and array.size <= MANY:
        for i, element in enumerate(array.ravel()):
            if element is not content:
                flatten(f"{name}.{i + 1}", element, found)


def flatten_dspace(recording: Any, found: Found) -> None:
    """A dSPACE ControlDesk recording: X are times, one a raster, Y channels with Name, Data, Unit and their raster."""
    arrays, units, clocks, _ = found
    times = {}
    for i, raster in enumerate(np.ravel(recording.X)):
        time = np.ravel(getattr(raster, "Data", np.empty(0)))
        if time.size > 1:
            times[i + 1] = "time" if i == 0 else f"time.{i + 1}"
            arrays[times[i + 1]], units[times[i + 1]] = np.asarray(time, dtype=float), "s"
    for channel in np.ravel(recording.Y):
        name = str(channel.Name)
        arrays[name] = np.asarray(channel.Data, dtype=float)
        unit = getattr(channel, "Unit", "")
        if isinstance(unit, str) and unit.strip() not in ("", "-"):
            units[name] = unit.strip()
        index = np.ravel(getattr(channel, "XIndex", 0))
        own = times.get(int(index[0])) if index.size == 1 and index.dtype.kind in "iuf" else None
        as_long = [time for time in [own, *times.values()] if time and arrays[time].size == arrays[name].size]
        if as_long:
            clocks[name] = as_long[0]


def flatten_scope(name: str, scope: Any, found: Found) -> None:
    """A Simulink scope or "structure with time": signals with the times of the scope; their labels go to the notes."""
    arrays, _, clocks, labels = found
    time = np.ravel(getattr(scope, "time", np.empty(0)))
    if time.size > 1:
        arrays[f"{name}.time"] = np.asarray(time, dtype=float)
        found[1][f"{name}.time"] = "s"
    for i, signal in enumerate(np.ravel(scope.signals)):
        values = np.asarray(getattr(signal, "values", np.empty(0)))
        if values.dtype.kind not in "fiub":
            continue
        rows = np.squeeze(values)
        rows = rows.T if rows.ndim == 2 and rows.shape[0] == time.size else np.atleast_2d(rows)
        label = getattr(signal, "label", "")
        label = label if isinstance(label, str) else ""
        for k, row in enumerate(rows if rows.ndim == 2 else ()):
            which = "" if len(rows) == 1 else f".{k + 1}"
            full = f"{name}.{label}{which}"
            full = full if label and full not in arrays else f"{name}.{i + 1}{which}"
            arrays[full] = row
            if label:
                labels[full] = f"{label}{which}"
            if time.size == row.size:
                clocks[full] = f"{name}.time"
