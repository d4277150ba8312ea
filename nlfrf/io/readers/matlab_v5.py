"""MATLAB v4 to v7 files by SciPy: variables, structs, Simulink scopes, dSPACE recordings.

This module is loaded by its path in its own process, because some damaged files crash SciPy. So it
imports nothing from this package.
"""

from __future__ import annotations

import warnings
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from scipy.io.matlab import mat_struct

    from nlfrf._base.own_process import Contents

_MAX_STRUCT_ELEMENTS = 64  # elements of a struct array that are read


def contents(path: Path) -> Contents:
    """Read arrays by name, units and clocks; "#subsystem#" in the notes marks a file with MATLAB
    objects.
    """
    from scipy.io import loadmat

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # for objects with equal names
        raw = loadmat(path, squeeze_me=True, struct_as_record=False, appendmat=False)
    found: Contents = ({}, {}, {}, {})
    for name, content in raw.items():
        if isinstance(name, str) and not name.startswith("__"):
            _add_variable(name, content, found)
    found = _rename_by_labels(found)
    if "__function_workspace__" in raw:
        found[3]["#subsystem#"] = ""
    return found


def _rename_by_labels(found: Contents) -> Contents:
    """Rename the signals of scopes to their labels, which are in the notes, if these are unique."""
    arrays, units, clocks, labels = found
    often = Counter([*labels.values(), *arrays])
    short = {full: label for full, label in labels.items() if often[label] == 1}
    arrays = {short.get(name, name): array for name, array in arrays.items()}
    clocks = {short.get(name, name): clock for name, clock in clocks.items()}
    return arrays, units, clocks, {}


def _add_variable(name: str, content: object, found: Contents) -> None:
    """Add a MATLAB variable: numbers and texts unchanged, structs member by member, scopes and
    dSPACE by name.
    """
    members = getattr(content, "_fieldnames", None)
    if members is not None:
        if {"X", "Y"} <= set(members):
            _add_dspace_recording(content, found)
        elif "signals" in members:
            _add_scope(name, content, found)
        else:
            for member in members:
                _add_variable(f"{name}.{member}", getattr(content, member), found)
        return
    array = np.asarray(content)
    if array.dtype.kind in "fiubcUS" and array.dtype.names is None:
        found[0][name] = array
    elif array.dtype.kind == "O" and array.size <= _MAX_STRUCT_ELEMENTS:
        for i, element in enumerate(array.ravel()):
            if element is not content:
                _add_variable(f"{name}.{i + 1}", element, found)


def _add_dspace_recording(recording: mat_struct, found: Contents) -> None:
    """Add a dSPACE ControlDesk recording:

    X are times, one per raster, Y channels with Name, Data, Unit and raster.
    """
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
        if index.size == 1 and index.dtype.kind in "iuf":
            own = times.get(int(index[0]))
        else:
            own = None
        as_long = [
            time
            for time in [own, *times.values()]
            if time and arrays[time].size == arrays[name].size
        ]
        if as_long:
            clocks[name] = as_long[0]


def _add_scope(name: str, scope: mat_struct, found: Contents) -> None:
    """Add a Simulink scope or "structure with time": its signals with times; labels go to the
    notes.
    """
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
        if rows.ndim == 2 and rows.shape[0] == time.size:
            rows = rows.T
        else:
            rows = np.atleast_2d(rows)
        label = getattr(signal, "label", "")
        if not isinstance(label, str):
            label = ""
        for k, row in enumerate(rows if rows.ndim == 2 else ()):
            if len(rows) == 1:
                which = ""
            else:
                which = f".{k + 1}"
            full = f"{name}.{label}{which}"
            if not (label and full not in arrays):
                full = f"{name}.{i + 1}{which}"
            arrays[full] = row
            if label:
                labels[full] = f"{label}{which}"
            if time.size == row.size:
                clocks[full] = f"{name}.time"
