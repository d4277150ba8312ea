"""HDF5 files: datasets, tables, attributes that are texts, units or clocks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

__all__ = ["contents"]

UNITS = ("unit", "units", "unit_string", "einheit")
RATES = ("fs", "sample_rate", "samplerate", "sampling_rate", "sampling_frequency", "samplingfrequency", "rate")
STEPS = ("dt", "ts", "sample_time", "sampletime", "sampling_time", "wf_increment")
START = "wf_start_offset"
TEXT = 1 << 16  # characters that a text may have
#: What numbers are multiplied by and moved by: by the netCDF conventions, and of whole numbers as others call it.
SCALINGS = (("scale_factor", "add_offset"), ("scale", "offset"), ("slope", "intercept"))
NAMES = ("columns", "channels", "channel_names", "names", "labels")


def contents(path: Path) -> tuple[dict[str, np.ndarray], dict[str, str], dict[str, Any], dict[str, str]]:
    """Numeric datasets, groups joined by dots; fields of tables, columns that attributes name; texts of attributes.

    Long datasets are handed over unread, to be read a block at a time; so the file stays open as long as they do. This
    room is loaded by its path in a process of its own, so it imports nothing of this package.

    HDF5 can take numbers from any other file of the machine, by its path. What is read is one file, so a file that
    does so is refused as a whole: mat-io, which reads some of them again, would follow its links.

    Raises
    ------
    ValueError
        A dataset with external storage or a virtual one, a link to another file.
    """
    import h5py

    arrays: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    clocks: dict[str, Any] = {}
    notes: dict[str, str] = {}
    starts: dict[str, np.ndarray] = {}

    def add(place: str, node: Any) -> None:
        require_own_numbers(place, node)
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
                if finite(said.get(START)) and said[START]:
                    starts[f"{name}.start"] = np.array(float(said[START]))

    file = h5py.File(path, "r")
    add("", file)
    file.visititems(add)
    return arrays | starts, units, clocks, notes


def require_own_numbers(place: str, node: Any) -> None:
    """Refuse a dataset whose numbers lie in other files, and a group with a link to one."""
    import h5py

    why = ""
    if isinstance(node, h5py.Dataset):
        why = "has external storage" if node.external else "is a virtual dataset" if node.is_virtual else ""
    else:
        # of the classes of links, h5py knows three and HDF5 lets programs add others
        for name in node:
            link = node.get(name, getlink=True)
            if not isinstance(link, h5py.HardLink | h5py.SoftLink):
                place, why = f"{place}/{name}".lstrip("/"), "is a link to another file"
    if why:
        raise ValueError(f"its {place[:60]!r} {why}: other files are never read, copy the numbers into it")


class Unread:
    """A stream in a dataset: all of it, a field of a table, or a column; read where it is cut, and then scaled."""

    def __init__(
        self,
        node: Any,
        *,
        field: str | None = None,
        column: int | None = None,
        axis: int = 1,
        scaling: tuple[float, float, Any] | None = None,
    ) -> None:
        self.source, self.column, self.axis = node if field is None else node.fields(field), column, axis
        kind = node.dtype if field is None else node.dtype[field]  # which may be of several numbers
        self.scaling = scaling
        self.dtype = kind.base if scaling is None else np.dtype(float)
        self.shape = node.shape + kind.shape if column is None else (node.shape[1 - axis],)
        self.rows = 1 if node.chunks is None else node.chunks[0 if column is None else 1 - axis]

    def __getitem__(self, where: Any) -> np.ndarray:
        if self.column is not None:
            where = (where, self.column) if self.axis else (self.column, where)
        part = np.asarray(self.source[where])
        if self.scaling is None:
            return part
        scale, offset, missing = self.scaling
        scaled = part.astype(float) * scale + offset
        return scaled if missing is None else np.where(part == missing, np.nan, scaled)


def scaling_of(node: Any, said: dict[str, Any]) -> tuple[float, float, Any] | None:
    """What numbers are multiplied by, moved by, and which one stands for none; None where they stay as they are."""
    scale, offset = 1.0, 0.0
    for by, beside in reversed(SCALINGS if node.dtype.kind in "iu" else SCALINGS[:1]):
        if number(said.get(by)) or (by == "scale_factor" and finite(said.get(beside))):
            scale, offset = float(said.get(by, 1.0)), float(said.get(beside, 0.0))
    missing = said.get("_fillvalue")
    missing = missing if finite(missing) else None
    return None if (scale, offset, missing) == (1.0, 0.0, None) else (scale, offset, missing)


def columns(name: str, node: Any, said: dict[str, Any]) -> dict[str, Any]:
    """A dataset as streams: fields of a table, columns by the names that an attribute gives, or the array as it is."""
    if node.shape is None:  # of HDF5's null space
        return {}
    if node.dtype.names:
        kinds = {key: node.dtype[key] for key in node.dtype.names}
        return {f"{name}.{key}": Unread(node, field=key) for key, kind in kinds.items() if kind.base.kind in "fiub"}
    if node.dtype.kind not in "fiubc":
        return {}
    if said.get("matlab_class") == "char":
        text = node[()] if node.size < TEXT else np.empty(0, int)
        return {name: np.array("".join(map(chr, np.ravel(text).tolist())))}
    names: list[str] = next((said[key] for key in NAMES if isinstance(said.get(key), list)), [])
    scaling = scaling_of(node, said) if node.dtype.kind in "fiu" else None
    if node.ndim == 2 and names and len(names) in node.shape:
        axis = 1 if node.shape[1] == len(names) else 0
        return {f"{name}.{key}": Unread(node, column=i, axis=axis, scaling=scaling) for i, key in enumerate(names)}
    return {name: Unread(node, scaling=scaling)}


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
    return finite(held) and held > 0


def finite(held: Any) -> bool:
    """Whether an attribute is a finite number."""
    return isinstance(held, int | float) and not isinstance(held, bool) and bool(np.isfinite(held))
