"""Values of this package as named arrays in a file, field by field, with a schema and its version."""

from __future__ import annotations

import inspect
import itertools
import json
import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from nlfrf._base.arguments import one_line
from nlfrf._base.files import VERSION, Role, to_path, write_arrays
from nlfrf._base.values import field_names
from nlfrf.bla.bla import DistortionLevels
from nlfrf.io.channels import Channels, read_channels
from nlfrf.signals.lines import LineGrid

__all__ = ["AXES_ORDER", "load_value", "names_from_json", "require_known_version", "save_value", "value_from_file"]


#: Values inside a Bla; of several channels one an output.
NESTED_VALUES: dict[str, Any] = {"lines": LineGrid, "levels": DistortionLevels}
NAME_FIELDS = ("inputs", "outputs", "input_units", "output_units")
#: What the axes of signals are; of several inputs and outputs there is a channel axis in front.
AXES_ORDER = "realization period sample"


def save_value(
    thing: Any, schema: str, path: str | os.PathLike[str], *, role: Role = Role.NAMED, **more: np.ndarray
) -> None:
    """Write every field of a value, those of the values inside it by dotted names, names of channels as JSON."""
    content: dict[str, np.ndarray] = {"schema": np.array(schema), "version": np.array(VERSION)} | more
    for name in getattr(thing, "_stored_", None) or field_names(thing):
        part = getattr(thing, name)
        if part is None:
            continue
        if name in NAME_FIELDS:
            content[name] = np.array(json.dumps(part))
        elif name in NESTED_VALUES and isinstance(part, tuple):
            for k, one in enumerate(part):
                content |= {f"{name}.{k}.{inner}": getattr(one, inner) for inner in field_names(one)}
        elif name in NESTED_VALUES:
            content |= {f"{name}.{inner}": getattr(part, inner) for inner in field_names(part)}
        else:
            content[name] = np.asarray(part)
    write_arrays(to_path(path), content, role=role)


def load_value(kinds: Mapping[str, Any], path: str | os.PathLike[str]) -> Any:
    """The value of one of these kinds, by its schema, that `save_value` wrote."""
    return value_from_file(kinds, read_channels(path))


def value_from_file(kinds: Mapping[str, Any], file: Channels) -> Any:
    """The same of a file that was read."""
    schema = file.text("schema")
    if schema not in kinds:
        expected = " or ".join(kinds)
        raise ValueError(f"path must be a file of the schema {expected}, got {schema or 'none'} in {file.path!r}")
    require_known_version(file, schema, AXES_ORDER)
    kind, content = kinds[schema], file.arrays
    wanted = inspect.signature(kind).parameters
    required = [name for name, one in wanted.items() if one.default is one.empty and one.kind is one.KEYWORD_ONLY]
    try:
        return kind(
            **{name: field_from_arrays(name, content) for name in wanted if name in content or name in required}
        )
    except KeyError as missing:
        raise ValueError(f"path must hold a whole {schema}, got {file.path!r} without {missing}") from None


def field_from_arrays(name: str, content: Mapping[str, np.ndarray]) -> Any:
    """One field of a value from the arrays of its file."""
    if name in NAME_FIELDS:
        return names_from_json(name, content[name])
    if name not in NESTED_VALUES:
        return to_scalar(content[name])
    kind = NESTED_VALUES[name]
    first = field_names(kind)[0]
    if f"{name}.0.{first}" not in content:
        return kind(**{inner: content[f"{name}.{inner}"] for inner in field_names(kind)})
    several = itertools.takewhile(lambda k: f"{name}.{k}.{first}" in content, itertools.count())
    return tuple(kind(**{inner: content[f"{name}.{k}.{inner}"] for inner in field_names(kind)}) for k in several)


def names_from_json(field: str, array: np.ndarray) -> tuple[str, ...]:
    """Names of channels, from JSON."""
    try:
        names = json.loads(str(to_scalar(array)))
    except (json.JSONDecodeError, RecursionError):
        names = None
    if not (isinstance(names, list) and all(isinstance(name, str) for name in names)):
        raise ValueError(f"path must hold names as a list in JSON for {field}, got {str(array)[:60]!r}")
    return tuple(map(one_line, names))


def to_scalar(array: np.ndarray) -> Any:
    """A number or a text from an array without axes, any other array as it is."""
    held = array.item() if array.ndim == 0 else array
    return one_line(held) if isinstance(held, str) else held


def require_known_version(file: Channels, schema: str, axes: str) -> None:
    """Refuse a file of a version, or with axes, that this package does not know; older versions are known."""
    stored = file.arrays.get("version")
    version = int(np.ravel(stored)[0]) if stored is not None and stored.dtype.kind in "iuf" and stored.size == 1 else 0
    if not 1 <= version <= VERSION:
        raise ValueError(f"path must hold schema version 1 to {VERSION} of {schema}, got {version} in {file.path!r}")
    found = file.text("axes")
    if found not in ("", axes):
        raise ValueError(f"path must hold signals with the axes {axes!r}, got {found!r} in {file.path!r}")
