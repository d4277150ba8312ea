"""Models and controllers to and from JSON files, exact to the bit."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from functools import singledispatch
from types import NoneType
from typing import Any

import control
import numpy as np

import nlfrf
from nlfrf._base.arguments import one_line, require_kind, require_nonnegative, short_form
from nlfrf._base.files import require_file_of, to_path, write_json
from nlfrf._base.parsing import parse_json_of, require_schema
from nlfrf._base.types import Json, JsonObject
from nlfrf._base.values import ArrayField, field_names
from robust._base.types import Controller
from robust.io.biquads import sections_by_name
from robust.io.from_matlab import is_state_space, load_matlab_system
from robust.lti.realisation import multivariable, state_space
from robust.models.sets.model import UncertaintyModel
from robust.models.sets.records import (
    JointProbability,
    Origin,
    RecordHold,
    RecordLevel,
    RecordSummary,
)

# ---- Systems and numbers as JSON, exact to the bit, in files with a versioned schema.
#
# A number is written with the digits that reproduce it exactly; a complex one as [re, im]; nan as
# null, infinities as strings. A file is written whole or not at all, and its content is checked
# against the published schema.

VERSION = 1
_BLA_SCHEMAS = ("nlfrf-bla", "nlfrf-frm")
PathLike = str | os.PathLike[str]


def load_bla(path: PathLike) -> nlfrf.Bla:
    """Return the BLA in a file; refuse any other kind."""
    require_file_of(path, *_BLA_SCHEMAS)
    bla: nlfrf.Bla = nlfrf.load(path)
    return bla


@singledispatch
def _encode(content: object) -> Json:
    """Encode any content of a model as JSON types: a value by its fields, all else as numbers."""
    if is_dataclass(content):
        return {name: _encode(getattr(content, name)) for name in field_names(content)}
    array = np.asarray(content)
    if array.ndim:
        return [_encode(item) for item in array]
    if array.dtype.kind == "c":
        return [_encode(array.real), _encode(array.imag)]
    number = float(array)
    if np.isnan(number):
        return None
    if np.isinf(number):
        if number > 0:
            return "inf"
        return "-inf"
    return number


@_encode.register(NoneType)
@_encode.register(str)
@_encode.register(bool)
def _encode_word(content: str | bool | None) -> Json:
    return content


@_encode.register(tuple)
@_encode.register(list)
def _encode_sequence(content: Sequence[object]) -> Json:
    return [_encode(item) for item in content]


@_encode.register(Mapping)
def _encode_mapping(content: Mapping[str, object]) -> Json:
    return {name: _encode(part) for name, part in content.items()}


def _decode(content: Json) -> ArrayField:
    """Decode real numbers: a float, or float arrays."""
    try:
        if isinstance(content, list):
            return np.array([_decode(item) for item in content], dtype=float)
        if content is None:
            return np.nan
        return float(content)
    except ValueError:  # rows of different lengths
        raise ValueError(
            f"path must hold rows of the same length, got {short_form(content)}"
        ) from None


@_encode.register(control.StateSpace)
def encode_system(system: control.StateSpace) -> JsonObject:
    """Encode a state space."""
    matrices = {name: _encode(getattr(system, name)) for name in "ABCD"}
    return {"kind": "ss", "dt": _encode_clock(system), **matrices}


@_encode.register(control.FrequencyResponseData)
def _encode_frf(frf: control.FrequencyResponseData) -> JsonObject:
    return {
        "kind": "frf",
        "omega": _encode(frf.omega),
        "G": _encode(frf.frdata[0, 0]),
        "dt": _encode_clock(frf),
    }


def _encode_clock(system: control.StateSpace | control.FrequencyResponseData) -> float | None:
    if system.dt is None:
        return None
    return float(system.dt)


def decode_system(content: JsonObject) -> control.StateSpace | control.FrequencyResponseData:
    """Decode a state space or an FRF; an empty A, B or C takes its shape from the others."""
    if content["kind"] == "frf":
        omega, pairs = _decode(content["omega"]), _decode(content["G"])
        if pairs.shape != (*omega.shape, 2) or not omega.size:
            raise ValueError(
                f"G must have one pair for each of {omega.size} frequencies, got the shape"
                f" {pairs.shape}"
            )
        return control.FrequencyResponseData(pairs[:, 0] + 1j * pairs[:, 1], omega, content["dt"])
    D = np.atleast_2d(_decode(content["D"]))
    if not D.size:
        raise ValueError("D must have a number for each input and output, got none")
    n = len(content["A"])
    shapes = {"A": (n, n), "B": (n, D.shape[1]), "C": (D.shape[0], n)}
    matrices = {name: _decode(content[name]) for name in shapes}
    for name, shape in shapes.items():
        if matrices[name].shape != shape and (matrices[name].size or np.prod(shape)):
            raise ValueError(f"{name} must have the shape {shape}, got {matrices[name].shape}")
    return control.StateSpace(
        *(np.reshape(matrices[name], shapes[name]) for name in shapes), D, content["dt"]
    )


def read_json(path: PathLike, schemas: tuple[str, ...]) -> tuple[str, JsonObject]:
    """Return schema and content of a JSON file with one of these schemas; refuse others."""
    content = parse_json_of(path, *schemas)
    found = str(content["schema"])
    if content.get("version") != VERSION:
        raise ValueError(
            f"path must hold version {VERSION} of {found}, got {path} with version"
            f" {short_form(content.get('version'))}"
        )
    require_schema(content, path, package="robust", name=found)
    return found, content


# ---- A model as JSON: its fields by name, in a schema for one channel and one for several.

MODEL_SCHEMA = "robust-model"
MATRIX_SCHEMA = "robust-matrix-model"
CONTROLLER_SCHEMA = "robust-controller"
CERTIFICATE_SCHEMAS = (
    "robust-certificate",
    "robust-mu-certificate",
    "robust-friction-certificate",
    "robust-schedule-certificate",
)
_UNITS = {"omega": "rad/s", "delay": "s", "fs": "Hz", "dt": "s"}
#: Fields that a set of such a schema does not have.
_FIELDS_LEFT_OUT = {
    MODEL_SCHEMA: ("left", "right", "alternative_form"),
    MATRIX_SCHEMA: ("weight", "scaling"),
}
_LEFT_OUT_WHEN_EMPTY = ("budget", "scaling", "records", "alternative_form", "warnings")
_COMPLEX_FIELDS = {MODEL_SCHEMA: ("G",), MATRIX_SCHEMA: ("G", "variance", "gamma")}
_RECORD_FIELDS = {
    MODEL_SCHEMA: ("omega", "G", "variance", "scatter", "confirmed", "level"),
    MATRIX_SCHEMA: ("omega", "dof", "G", "variance", "confirmed", "gamma"),
}


def encode_model(model: UncertaintyModel) -> JsonObject:
    """Return a model as JSON."""
    schema = MODEL_SCHEMA if model.is_single else MATRIX_SCHEMA
    content: JsonObject = {"schema": schema, "version": VERSION, "units": _UNITS}
    for name in field_names(model):
        held = getattr(model, name)
        if name in _FIELDS_LEFT_OUT[schema] or (name in _LEFT_OUT_WHEN_EMPTY and not held):
            continue
        if name == "records":
            held = [
                {part: _encode(getattr(one, part)) for part in _RECORD_FIELDS[schema]}
                for one in held
            ]
        elif isinstance(held, UncertaintyModel):  # two forms of a set have the same records
            held = encode_model(replace(held, records=()))
        else:
            held = _encode(held)
        content[name] = held
    return content


def decode_model(content: JsonObject, schema: str) -> UncertaintyModel:
    """Return a model from JSON; fields that a file lacks are as in a set without a record."""
    known = {
        field.name: _decode_field(content[field.name], str(field.type))
        for field in fields(UncertaintyModel)
        if field.name in content and field.name not in ("records", "alternative_form")
    }
    records = tuple(_decode_record(one, schema) for one in content.get("records", ()))
    if "alternative_form" in content:
        known["alternative_form"] = replace(
            decode_model(content["alternative_form"], schema), records=records
        )
    return UncertaintyModel(**known, records=records)


_TUPLE_DECODERS: dict[str, Callable[[Json], object]] = {
    "tuple[str, ...]": one_line,
    "tuple[control.StateSpace, ...]": decode_system,
    "tuple[SystemField, ...]": decode_system,
}
_VALUES = {
    "Origin": Origin,
    "RecordHold | None": RecordHold,
    "JointProbability | None": JointProbability,
    "RecordLevel | None": RecordLevel,
}


def _decode_field(content: Json, kind: str) -> Any:
    """Return a field from JSON, by its declared type."""
    if kind == "str":
        return one_line(content)
    if kind.endswith("| None") and content is None:
        return None
    if kind == "bool":
        return content
    if kind in _TUPLE_DECODERS:
        return tuple(map(_TUPLE_DECODERS[kind], content))
    if kind in _VALUES:
        types = {field.name: str(field.type) for field in fields(_VALUES[kind])}
        return _VALUES[kind](
            **{name: _decode_field(held, types[name]) for name, held in content.items()}
        )
    if kind.startswith("Mapping"):
        return {name: _decode(part) for name, part in content.items()}
    if isinstance(content, dict):
        return decode_system(content)
    if kind == "float":
        return float(_decode(content))
    return _decode(content)


def _decode_record(content: JsonObject, schema: str) -> RecordSummary:
    """Return the record summary of a model."""
    types = {field.name: str(field.type) for field in fields(RecordSummary)}
    parts: dict[str, ArrayField] = {}
    for part in _RECORD_FIELDS[schema]:
        held = _decode_field(content[part], types[part])
        if part in _COMPLEX_FIELDS[schema]:
            if held.ndim != (2 if schema == MODEL_SCHEMA else 4):
                raise ValueError(
                    f"{part} must have complex numbers for each line of the record, got"
                    f" {held.shape}"
                )
            held = held[..., 0] + 1j * held[..., 1]
        if np.ndim(held) and len(held) != len(np.asarray(parts.get("omega", held))):
            raise ValueError(
                f"{part} must have one number for each line of the record, got {len(held)}"
            )
        parts[part] = held
    return RecordSummary(**parts)


def save_model(model: UncertaintyModel, path: PathLike) -> None:
    """Write an uncertainty model to a ``.json`` file."""
    write_json(encode_model(model), path)


def load_model(path: PathLike) -> UncertaintyModel:
    """Read an uncertainty model back from a ``.json`` file."""
    schema, content = read_json(path, (MODEL_SCHEMA, MATRIX_SCHEMA))
    return decode_model(content, schema)


def save_controller(
    K: Controller, path: PathLike, *, delay: float | None = None, unit: str = ""
) -> None:
    """Write a controller to a ``.json`` file, with its computation delay [s] and unit."""
    realised = isinstance(K, control.TransferFunction)
    K = as_controller("K", K)
    require_kind("unit", unit, str)
    content: JsonObject = {
        "schema": CONTROLLER_SCHEMA,
        "version": VERSION,
        "units": {"dt": "s"} | ({"G": unit} if unit else {}),
        "feedback": "negative: u = K (r - y)",
        "K": encode_system(K),
    }
    content |= {name: _encode(rows) for name, rows in sections_by_name(K).items()}
    content |= {"realised": True} if realised and K.nstates else {}
    if delay is not None:
        content["delay"] = require_nonnegative("delay", delay)
    write_json(content, path)


def load_controller(path: PathLike) -> control.StateSpace:
    """Read a controller back from a ``.json`` file, with its sampling time; or one that MATLAB
    saved (``.mat``).
    """
    path = to_path(path)
    if path.suffix.lower() == ".mat":
        require_file_of(path, CONTROLLER_SCHEMA)
        return load_matlab_system(path)
    _, content = read_json(path, (CONTROLLER_SCHEMA,))
    return as_controller("K", decode_system(content["K"]))


def load_system(path: PathLike) -> UncertaintyModel | control.StateSpace:
    """Return the model or the controller in a file; refuse any other kind."""
    content = parse_json_of(path, MODEL_SCHEMA, MATRIX_SCHEMA, CONTROLLER_SCHEMA)
    if content["schema"] == CONTROLLER_SCHEMA:
        return load_controller(path)
    return load_model(path)


def load_controller_context(path: PathLike) -> tuple[float | None, str]:
    """Return computation delay [s] and unit of a controller file; None, "" if unknown."""
    if to_path(path).suffix.lower() == ".mat":
        return None, ""
    content = read_json(path, (CONTROLLER_SCHEMA,))[1]
    found = content.get("delay")
    return None if found is None else float(found), one_line(content["units"].get("G", ""))


def has_own_states(path: PathLike) -> bool:
    """Return whether a controller file has states of its own: it was not saved as a transfer
    function.
    """
    if to_path(path).suffix.lower() == ".mat":
        return is_state_space(to_path(path))
    return not read_json(path, (CONTROLLER_SCHEMA,))[1].get("realised", False)


def as_controller(name: str, K: Controller) -> control.StateSpace:
    """Return any controller as a state space, with one input and output or several."""
    several = np.ndim(K) > 0 or getattr(K, "ninputs", 1) > 1 or getattr(K, "noutputs", 1) > 1
    return (multivariable if several else state_space)(name, K)
