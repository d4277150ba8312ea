"""Values of this package as named arrays in a file, field by field, with a schema and its
version.
"""

from __future__ import annotations

import inspect
import itertools
import json
import os
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from nlfrf._base.arguments import one_line
from nlfrf._base.files import VERSION, Role, describe_wrong_file, to_path, write_arrays
from nlfrf._base.values import field_names
from nlfrf.bla.bla import Covariances, DistortionLevels, Experiment
from nlfrf.io.channels import Channels
from nlfrf.io.measurement_files import read_channels
from nlfrf.signals.axis_experiment import AssumedDrive
from nlfrf.signals.lines import LineGrid
from nlfrf.signals.multisine import Multisine

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

#: Values inside a Bla or an experiment; levels for several channels are one per output.
_NESTED_VALUES: dict[str, type[DataclassInstance]] = {
    "lines": LineGrid,
    "experiment": Experiment,
    "cov": Covariances,
    "levels": DistortionLevels,
    "ms": Multisine,
    "assumed_drive": AssumedDrive,
}
_TEXT_FIELDS = ("inputs", "outputs", "input_units", "output_units", "warnings")
#: Axes of signals; for several inputs and outputs a channel axis comes first.
AXES_ORDER = "realization period sample"


def save_value(
    thing: DataclassInstance,
    schema: str,
    path: str | os.PathLike[str],
    *,
    role: Role = Role.NAMED,
    **more: np.ndarray,
) -> None:
    """Write every field of a value: those of inner values by dotted names, tuples of texts as
    JSON.
    """
    content: dict[str, np.ndarray] = {
        "schema": np.array(schema),
        "version": np.array(VERSION),
    } | more
    content |= _value_to_arrays(thing, field_names(thing))
    write_arrays(to_path(path), content, role=role)


def _value_to_arrays(
    thing: DataclassInstance, names: tuple[str, ...], prefix: str = ""
) -> dict[str, np.ndarray]:
    """Return the fields of a value as arrays; those of inner values have its name and a dot as
    prefix.
    """
    content: dict[str, np.ndarray] = {}
    for name in names:
        part, key = getattr(thing, name), f"{prefix}{name}"
        if part is None:
            continue
        if name in _TEXT_FIELDS:
            content[key] = np.array(json.dumps(part))
        elif name in _NESTED_VALUES and isinstance(part, tuple):
            for k, one in enumerate(part):
                content |= _value_to_arrays(one, field_names(one), f"{key}.{k}.")
        elif name in _NESTED_VALUES:
            content |= _value_to_arrays(part, field_names(part), f"{key}.")
        else:
            content[key] = np.asarray(part)
    return content


Kind = TypeVar("Kind")


def load_value(kinds: Mapping[str, Callable[..., Kind]], path: str | os.PathLike[str]) -> Kind:
    """Read a value that `save_value` wrote; its schema has to be among these kinds."""
    return value_from_file(kinds, read_channels(path))


def value_from_file(kinds: Mapping[str, Callable[..., Kind]], file: Channels) -> Kind:
    """Return the value in the channels of a file; its schema has to be among these kinds."""
    schema = file.text("schema")
    if schema not in kinds:
        raise ValueError(describe_wrong_file(file.path, schema or None, *kinds))
    require_known_version(file, schema, AXES_ORDER)
    try:
        return _value_from_arrays(kinds[schema], file.arrays)
    except KeyError as missing:
        raise ValueError(
            f"path must hold a whole {schema}, got {file.path!r} without {missing}"
        ) from None


def _value_from_arrays(
    kind: Callable[..., Kind], content: Mapping[str, np.ndarray], prefix: str = ""
) -> Kind:
    """Return a value from its fields as arrays; optional fields may be missing."""
    wanted = inspect.signature(kind).parameters
    required = [
        name
        for name, one in wanted.items()
        if one.default is one.empty and one.kind is one.KEYWORD_ONLY
    ]
    return kind(
        **{
            name: _field_from_arrays(name, content, prefix)
            for name in wanted
            if name in required or _is_stored(f"{prefix}{name}", content)
        }
    )


def _is_stored(key: str, content: Mapping[str, np.ndarray]) -> bool:
    """Return whether a file has a field: itself, or the fields of its inner value."""
    return key in content or any(one.startswith(f"{key}.") for one in content)


def _field_from_arrays(name: str, content: Mapping[str, np.ndarray], prefix: str) -> object:
    """Return one field of a value from the arrays of its file."""
    key = f"{prefix}{name}"
    if name in _TEXT_FIELDS:
        return names_from_json(name, content[key])
    if name not in _NESTED_VALUES:
        return _to_scalar(content[key])
    kind = _NESTED_VALUES[name]
    first = field_names(kind)[0]
    if f"{key}.0.{first}" not in content:
        return _value_from_arrays(kind, content, f"{key}.")
    several = itertools.takewhile(lambda k: f"{key}.{k}.{first}" in content, itertools.count())
    return tuple(_value_from_arrays(kind, content, f"{key}.{k}.") for k in several)


def names_from_json(field: str, array: np.ndarray) -> tuple[str, ...]:
    """Return names of channels, or warnings, from JSON."""
    try:
        names = json.loads(str(_to_scalar(array)))
    except (json.JSONDecodeError, RecursionError):
        names = None
    if not (isinstance(names, list) and all(isinstance(name, str) for name in names)):
        raise ValueError(
            f"path must hold names as a list in JSON for {field}, got {str(array)[:60]!r}"
        )
    return tuple(map(one_line, names))


def _to_scalar(array: np.ndarray) -> object:
    """Return a number or a text from an array without axes, any other array unchanged."""
    if array.ndim == 0:
        held = array.item()
    else:
        held = array
    if isinstance(held, str):
        return one_line(held)
    return held


def require_known_version(file: Channels, schema: str, axes: str) -> None:
    """Refuse a file of a version, or with axes, unknown to this package."""
    stored = file.arrays.get("version")
    if stored is not None and stored.dtype.kind in "iuf" and stored.size == 1:
        version = int(np.ravel(stored)[0])
    else:
        version = 0
    if version != VERSION:
        raise ValueError(
            f"path must hold schema version {VERSION} of {schema}, got {version} in {file.path!r}"
        )
    found = file.text("axes")
    if found not in ("", axes):
        raise ValueError(
            f"path must hold signals with the axes {axes!r}, got {found!r} in {file.path!r}"
        )
