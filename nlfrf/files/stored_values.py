"""Values of this package as named arrays in a file, field by field, with a schema and its version."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from nlfrf.excitation.lines import LineGrid
from nlfrf.files.channels import Channels, read_channels
from nlfrf.identification.bla import DistortionLevels
from nlfrf.shared.values import field_names
from nlfrf.shared.whole_files import VERSION, write_arrays

__all__ = ["AXES", "load_value", "refuse_newer", "save_value"]


PARTS: dict[str, Any] = {"lines": LineGrid, "levels": DistortionLevels}  # values inside a Bla
#: What the axes of signals are. A channel axis in front, for several inputs and outputs, is reserved.
AXES = "realization period sample"


def save_value(thing: Any, schema: str, path: str | os.PathLike[str], **more: np.ndarray) -> None:
    """Write every field of a value, those of the values inside it by dotted names."""
    content: dict[str, np.ndarray] = {"schema": np.array(schema), "version": np.array(VERSION)} | more
    for name in field_names(thing):
        part = getattr(thing, name)
        if name in PARTS:
            content |= {f"{name}.{inner}": getattr(part, inner) for inner in field_names(part)}
        else:
            content[name] = np.asarray(part)
    write_arrays(Path(path), content)


def load_value(kind: Any, schema: str, path: str | os.PathLike[str]) -> Any:
    """The value of one kind that `save_value` wrote."""
    channels = read_channels(path)
    found = channels.text("schema")
    if found != schema:
        raise ValueError(f"path must be a file of the schema {schema}, got {found or 'none'} in {str(path)!r}")
    content = channels.arrays
    refuse_newer(channels, schema)
    try:
        return kind(
            **{
                name: PARTS[name](**{inner: content[f"{name}.{inner}"] for inner in field_names(PARTS[name])})
                if name in PARTS
                else plain(content[name])
                for name in field_names(kind)
                if name in content or name in PARTS or not hasattr(kind, name)  # a newer field has a default
            }
        )
    except KeyError as missing:
        raise ValueError(f"path must hold a whole {schema}, got {str(path)!r} without {missing}") from None


def plain(array: np.ndarray) -> Any:
    """A number or a text from an array without axes, any other array as it is."""
    return array.item() if array.ndim == 0 else array


def refuse_newer(file: Channels, schema: str) -> None:
    """Refuse a file of a version, or with axes, that this package does not know; older versions are known."""
    stored = file.arrays.get("version")
    version = int(np.ravel(stored)[0]) if stored is not None and stored.dtype.kind in "iuf" and stored.size == 1 else 0
    if not 1 <= version <= VERSION:
        raise ValueError(f"path must hold schema version 1 to {VERSION} of {schema}, got {version} in {file.path!r}")
    axes = file.text("axes")
    if axes not in ("", AXES):
        raise ValueError(f"path must hold signals with the axes {AXES!r}, got {axes!r} in {file.path!r}")
