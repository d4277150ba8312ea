"""HDF5 files: datasets, tables, attributes that are texts, units or clocks."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, TypeGuard

import numpy as np

if TYPE_CHECKING:
    import h5py

    from nlfrf._base.own_process import Contents

_UNIT_ATTRIBUTES = ("unit", "units", "unit_string", "einheit")
_RATE_ATTRIBUTES = (
    "fs",
    "sample_rate",
    "samplerate",
    "sampling_rate",
    "sampling_frequency",
    "samplingfrequency",
    "rate",
)
_STEP_ATTRIBUTES = ("dt", "ts", "sample_time", "sampletime", "sampling_time", "wf_increment")
_START_ATTRIBUTE, _ABSCISSA_UNIT_ATTRIBUTE = "wf_start_offset", "wf_xunit_string"
_TIME_UNITS = ("time_unit", "time_units", "timeunit")
_MAX_TEXT = 1 << 16  # most characters of a text
#: Scale and offset of numbers: by the netCDF conventions, and for whole numbers by other names.
_SCALING_ATTRIBUTES = (("scale_factor", "add_offset"), ("scale", "offset"), ("slope", "intercept"))
_COLUMN_ATTRIBUTES = ("columns", "channels", "channel_names", "names", "labels")


def contents(path: Path) -> Contents:
    """Read numeric datasets, groups joined by dots; fields of tables, columns named by attributes;
    attribute texts.

    Long datasets are returned unread, to be read in blocks; so the file stays open as long as they
    exist. This module is loaded by its path in its own process, so it imports nothing from this
    package.

    HDF5 can take numbers from any other file of the machine, by its path. Such a file is refused as
    a whole.

    Raises
    ------
    ValueError
        A dataset with external storage or a virtual one, a link to another file.
    """
    import h5py

    found: Contents = ({}, {}, {}, {})
    arrays, units, clocks, notes = found

    def add(place: str, node: h5py.Dataset | h5py.Group) -> None:
        _require_own_numbers(place, node)
        attributes = _plain_attributes(node)
        by_key = {key.lower(): held for key, held in attributes.items()}
        prefix = place.replace("/", ".")
        if place.startswith("#"):  # the targets of references of MATLAB's cells and objects
            notes[place.split("/")[0]] = "holds references"
            return
        if (
            "MATLAB_object_decode" in attributes
        ):  # the numbers of such a dataset are references, too
            notes[prefix] = "is a MATLAB object"
            return
        if not isinstance(node, h5py.Dataset):
            for key, held in attributes.items():
                if isinstance(held, str | int | float) and not key.startswith("MATLAB"):
                    arrays[f"{prefix}.{key}" if prefix else key] = np.array(held)
            return
        for name, array in _dataset_streams(prefix, node, by_key).items():
            arrays[name] = array
            units[name] = next(
                (by_key[key] for key in _UNIT_ATTRIBUTES if isinstance(by_key.get(key), str)), ""
            )
            if clock := _stated_clock(by_key):
                clocks[name], arrays[f"{name}.start"], units[f"{name}.start"] = clock

    file = h5py.File(path, "r")
    add("", file)
    file.visititems(add)
    return found


def _stated_clock(by_key: Attributes) -> tuple[float, np.ndarray, str] | None:
    """Return the sampling frequency in attributes, the start of the abscissa and its unit; None
    without one.
    """
    key = next(
        (
            one
            for one in _RATE_ATTRIBUTES + _STEP_ATTRIBUTES
            if _is_positive_number(by_key.get(one))
        ),
        "",
    )
    if not key:
        return None
    number = float(by_key[key])
    start = by_key.get(_START_ATTRIBUTE)
    is_rate = key in _RATE_ATTRIBUTES
    stated = (
        _ABSCISSA_UNIT_ATTRIBUTE,
        f"{key}_unit",
        f"{key}_units",
        f"{key}unit",
        *(() if is_rate else _TIME_UNITS),
    )
    unit = next(
        (str(by_key[one]) for one in stated if by_key.get(one)),
        "s" if is_rate or key == "wf_increment" else "",
    )
    return (
        number if is_rate else 1 / number,
        np.array(float(start) if _is_finite_number(start) else 0.0),
        unit,
    )


def _require_own_numbers(place: str, node: h5py.Dataset | h5py.Group) -> None:
    """Refuse a dataset whose numbers lie in other files, and a group with a link to one."""
    import h5py

    why = ""
    if isinstance(node, h5py.Dataset):
        if node.external:
            why = "has external storage"
        elif node.is_virtual:
            why = "is a virtual dataset"
    else:
        # h5py has three classes of links; programs may add others in HDF5
        for name in node:
            link = node.get(name, getlink=True)
            if not isinstance(link, h5py.HardLink | h5py.SoftLink):
                place, why = f"{place}/{name}".lstrip("/"), "is a link to another file"
    if why:
        raise ValueError(
            f"its {place[:60]!r} {why}: other files are never read; copy the numbers into this one"
        )


#: Attributes of a dataset by name: h5py gives whatever numpy or Python type a file has.
Attributes: TypeAlias = dict[str, Any]


class _LazyStream:
    """A stream in a dataset: all of it, a field of a table, or a column; a slice is read and scaled
    when taken.
    """

    def __init__(
        self,
        node: h5py.Dataset | h5py.Group,
        *,
        field: str | None = None,
        column: int | None = None,
        axis: int = 1,
        scaling: tuple[float, float, float | None] | None = None,
    ) -> None:
        self.source, self.column, self.axis = (
            node if field is None else node.fields(field),
            column,
            axis,
        )
        kind = node.dtype if field is None else node.dtype[field]  # may contain several numbers
        self.scaling = scaling
        self.dtype = kind.base if scaling is None else np.dtype(float)
        self.shape = node.shape + kind.shape if column is None else (node.shape[1 - axis],)
        self.rows = 1 if node.chunks is None else node.chunks[0 if column is None else 1 - axis]

    def __getitem__(self, where: object) -> np.ndarray:
        if self.column is not None:
            if self.axis:
                where = where, self.column
            else:
                where = self.column, where
        part = np.asarray(self.source[where])
        if self.scaling is None:
            return part
        scale, offset, missing = self.scaling
        scaled = part.astype(float) * scale + offset
        if missing is None:
            return scaled
        return np.where(part == missing, np.nan, scaled)


def _find_scaling(
    node: h5py.Dataset | h5py.Group, attributes: Attributes
) -> tuple[float, float, float | None] | None:
    """Find scale, offset and missing value of a dataset; None if its numbers are unscaled."""
    scale, offset = 1.0, 0.0
    for scale_key, offset_key in reversed(
        _SCALING_ATTRIBUTES if node.dtype.kind in "iu" else _SCALING_ATTRIBUTES[:1]
    ):
        if _is_positive_number(attributes.get(scale_key)) or (
            scale_key == "scale_factor" and _is_finite_number(attributes.get(offset_key))
        ):
            scale = float(attributes.get(scale_key, 1.0))
            offset = float(attributes.get(offset_key, 0.0))
    missing = attributes.get("_fillvalue")
    if not _is_finite_number(missing):
        missing = None
    if (scale, offset, missing) == (1.0, 0.0, None):
        return None
    return scale, offset, missing


def _dataset_streams(
    name: str, node: h5py.Dataset | h5py.Group, attributes: Attributes
) -> dict[str, Any]:
    """Return a dataset as streams: fields of a table, columns by names of an attribute, or the
    array itself.
    """
    import h5py

    if node.shape is None:  # a null dataspace of HDF5
        return {}
    if node.dtype.names:
        kinds = {key: node.dtype[key] for key in node.dtype.names}
        return {
            f"{name}.{key}": _LazyStream(node, field=key)
            for key, kind in kinds.items()
            if kind.base.kind in "fiub"
        }
    if h5py.check_string_dtype(node.dtype) and node.size == 1:
        return {name: np.array(np.ravel(node.asstr()[()])[0])}
    if node.dtype.kind not in "fiubc":
        return {}
    if attributes.get("matlab_class") == "char":
        if node.size < _MAX_TEXT:
            text = node[()]
        else:
            text = np.empty(0, int)
        return {name: np.array("".join(map(chr, np.ravel(text).tolist())))}
    names: list[str] = next(
        (attributes[key] for key in _COLUMN_ATTRIBUTES if isinstance(attributes.get(key), list)), []
    )
    if node.dtype.kind in "fiu":
        scaling = _find_scaling(node, attributes)
    else:
        scaling = None
    if node.ndim == 2 and names and len(names) in node.shape:
        axis = 1 if node.shape[1] == len(names) else 0
        return {
            f"{name}.{key}": _LazyStream(node, column=i, axis=axis, scaling=scaling)
            for i, key in enumerate(names)
        }
    return {name: _LazyStream(node, scaling=scaling)}


def _plain_attributes(node: h5py.Dataset | h5py.Group) -> Attributes:
    """Return the attributes that are a text, a number or a list of texts, as Python types."""
    found: Attributes = {}
    for key in node.attrs:
        try:
            held = node.attrs[key]
        except (OSError, TypeError, ValueError):  # a type unknown to h5py
            continue
        if isinstance(held, np.generic | np.ndarray) and np.size(held) == 1:
            held = held.item()
        if isinstance(held, bytes):
            held = held.decode(errors="replace")
        if isinstance(held, np.ndarray) and held.dtype.kind in "OSU" and held.ndim == 1:
            held = [
                one.decode(errors="replace") if isinstance(one, bytes) else str(one) for one in held
            ]
        if isinstance(held, str | int | float | list):
            found[str(key)] = held
    return found


def _is_positive_number(held: object) -> bool:
    """Return whether an attribute is a number above zero."""
    return _is_finite_number(held) and held > 0


def _is_finite_number(held: object) -> TypeGuard[float]:
    return isinstance(held, int | float) and not isinstance(held, bool) and bool(np.isfinite(held))
