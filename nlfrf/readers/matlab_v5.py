"""MATLAB v4 to v7 files by SciPy: variables, structs, Simulink scopes, dSPACE recordings.

Loaded by its path alone in a process of its own, so it imports nothing of this package: some damaged files crash SciPy.
"""

from __future__ import annotations

import warnings
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
    if "__function_workspace__" in raw:
        found[3]["#objects"] = ""
    return found


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
    """A dSPACE ControlDesk recording: X.Data is the time, Y a list of channels with Name, Data and Unit."""
    arrays, units, clocks, _ = found
    time = np.ravel(getattr(np.ravel(recording.X)[0], "Data", np.empty(0)))
    if time.size > 1:
        arrays["time"], units["time"] = np.asarray(time, dtype=float), "s"
    for channel in np.ravel(recording.Y):
        name = str(channel.Name)
        arrays[name] = np.asarray(channel.Data, dtype=float)
        unit = getattr(channel, "Unit", "")
        if isinstance(unit, str) and unit.strip() not in ("", "-"):
            units[name] = unit.strip()
        if "time" in arrays and arrays["time"].size == arrays[name].size:
            clocks[name] = "time"


def flatten_scope(name: str, scope: Any, found: Found) -> None:
    """A Simulink scope or "structure with time": signals by their labels, each with the times of the scope."""
    arrays, _, clocks, _ = found
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
        label = label if isinstance(label, str) and label else f"{name}.{i + 1}"
        for k, row in enumerate(rows if rows.ndim == 2 else ()):
            full = label if len(rows) == 1 else f"{label}.{k + 1}"
            arrays[full] = row
            if time.size == row.size:
                clocks[full] = f"{name}.time"
