"""HDF5 files: datasets, tables, attributes that are texts, units or clocks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

__all__ = ["contents"]

UNITS = ("unit", "units", "unit_string", "einheit")
RATES = ("fs", "sample_rate", "samplerate", "sampling_rate", "sampling_frequency", "samplingfrequency", "rate")
STEPS = ("dt", "ts", "sample_time", "sampletime", "sampling_time", "wf_increment")
NAMES = ("columns", "channels", "channel_names", "names", "labels")


def contents(path: Path) -> tuple[dict[str, np.ndarray], dict[str, str], dict[str, Any], dict[str, str]]:
    """Numeric datasets, groups joined by dots; fields of tables, columns that attributes name; texts of attributes.

    This room is loaded by its path in a process of its own, so it imports nothing of this package.
    """
    import h5py

    arrays: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    clocks: dict[str, Any] = {}
    notes: dict[str, str] = {}

    def add(place: str, node: Any) -> None:
        attributes = plain(node)
        said = {key.lower(): held for key, held in attributes.items()}
        prefix = place.replace("/", ".")
        if place.startswith("#"):  # where MATLAB keeps what its cells and objects refer to
            notes[place.split("/")[0]] = "holds references"
            return
        if not isinstance(node, h5py.Dataset):
            for key, held in attributes.items():
                if isinstance(held, str | int | float) and not key.startswith("MATLAB"):
                    arrays[f"{prefix}.{key}" if prefix else key] = np.array(held)
            return
        for name, array in columns(prefix, node, said).items():
            arrays[name] = array
            unit = next((said[key] for key in UNITS if isinstance(said.get(key), str)), "")
            if unit:
                units[name] = unit
            fs = next((float(said[key]) for key in RATES if number(said.get(key))), 0.0)
            dt = next((float(said[key]) for key in STEPS if number(said.get(key))), 0.0)
            if fs > 0 or dt > 0:
                clocks[name] = fs if fs > 0 else 1 / dt

    with h5py.File(path, "r") as file:
        add("", file)
        file.visititems(add)
    return arrays, units, clocks, notes


def columns(name: str, node: Any, said: dict[str, Any]) -> dict[str, np.ndarray]:
    """A dataset as streams: fields of a table, columns by the names that an attribute gives, or the array as it is."""
    if node.dtype.names:
        table = np.asarray(node[()])
        return {f"{name}.{key}": table[key] for key in node.dtype.names if table[key].dtype.kind in "fiub"}
    if node.dtype.kind not in "fiubc":
        return {}
    array = np.asarray(node[()])
    if said.get("matlab_class") == "char":
        return {name: np.array("".join(map(chr, array.ravel().tolist())))}
    names: list[str] = next((said[key] for key in NAMES if isinstance(said.get(key), list)), [])
    if array.ndim == 2 and names and len(names) in array.shape:
        rows = array.T if array.shape[1] == len(names) else array
        return {f"{name}.{key}": np.ascontiguousarray(row) for key, row in zip(names, rows, strict=True)}
    return {name: array}


def plain(node: Any) -> dict[str, Any]:
    """The attributes that are a text, a number or a list of texts, as Python has them."""
    found: dict[str, Any] = {}
    for key in node.attrs:
        try:
            held = node.attrs[key]
        except (OSError, TypeError, ValueError):  # of a type that h5py does not know
            continue
        held = held.item() if isinstance(held, np.generic | np.ndarray) and np.size(held) == 1 else held
        if isinstance(held, bytes):
            held = held.decode(errors="replace")
        if isinstance(held, np.ndarray) and held.dtype.kind in "OSU" and held.ndim == 1:
            held = [one.decode(errors="replace") if isinstance(one, bytes) else str(one) for one in held]
        if isinstance(held, str | int | float | list):
            found[str(key)] = held
    return found


def number(held: Any) -> bool:
    """Whether an attribute is a number above zero."""
    return isinstance(held, int | float) and not isinstance(held, bool) and held > 0
