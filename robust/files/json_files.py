"""Systems and numbers as JSON, exact to the bit, in files with a versioned schema.

A number is written with the digits that give it back exactly; a complex one as [re, im]; nan as null, infinities as
strings. A file is written whole or not at all, and what is read is held against the schema that is published.
"""

from __future__ import annotations

import json
import os
from typing import Any

import control
import numpy as np

from nlfrf.shared.strict_json import parse_json, require_schema
from nlfrf.shared.whole_files import write_text
from nlfrf.shared.wording import shown

__all__ = [
    "VERSION",
    "PathLike",
    "decoded",
    "decoded_system",
    "encoded",
    "encoded_system",
    "read",
    "written",
]


VERSION = 1
PathLike = str | os.PathLike[str]


def encoded(numbers: Any) -> Any:
    """Numbers as JSON holds them."""
    array = np.asarray(numbers)
    if array.ndim:
        return [encoded(item) for item in array]
    if array.dtype.kind == "c":
        return [encoded(array.real), encoded(array.imag)]
    number = float(array)
    return number if np.isfinite(number) else None if np.isnan(number) else ("inf" if number > 0 else "-inf")


def decoded(content: Any) -> Any:
    """The way back, for real numbers: float, or float arrays."""
    try:
        if isinstance(content, list):
            return np.array([decoded(item) for item in content], dtype=float)
        return np.nan if content is None else float(content)
    except ValueError:  # of rows that are not equally long
        raise ValueError(f"path must hold rows of the same length, got {shown(content)}") from None


def encoded_system(system: Any) -> dict[str, Any]:
    """A state space or an FRF."""
    dt = None if system.dt is None else float(system.dt)
    if isinstance(system, control.FrequencyResponseData):
        return {"kind": "frf", "omega": encoded(system.omega), "G": encoded(system.frdata[0, 0]), "dt": dt}
    return {"kind": "ss", "dt": dt, **{name: encoded(getattr(system, name)) for name in "ABCD"}}


def decoded_system(content: dict[str, Any]) -> Any:
    """The way back; an empty A, B or C takes its shape from the others."""
    if content["kind"] == "frf":
        omega, pairs = decoded(content["omega"]), decoded(content["G"])
        if pairs.shape != (*omega.shape, 2) or not omega.size:
            raise ValueError(f"G must have one pair for each of {omega.size} frequencies, got the shape {pairs.shape}")
        return control.FrequencyResponseData(pairs[:, 0] + 1j * pairs[:, 1], omega, content["dt"])
    D = np.atleast_2d(decoded(content["D"]))
    if not D.size:
        raise ValueError("D must have a number for each input and output, got none")
    n = len(content["A"])
    shapes = {"A": (n, n), "B": (n, D.shape[1]), "C": (D.shape[0], n)}
    matrices = {name: decoded(content[name]) for name in shapes}
    for name, shape in shapes.items():
        if matrices[name].shape != shape and (matrices[name].size or np.prod(shape)):
            raise ValueError(f"{name} must have the shape {shape}, got {matrices[name].shape}")
    return control.StateSpace(*(np.reshape(matrices[name], shapes[name]) for name in shapes), D, content["dt"])


def written(content: dict[str, Any], path: PathLike) -> None:
    """The JSON file, whole or not at all."""
    write_text(path, json.dumps(content, indent=1, allow_nan=False) + "\n")


def read(path: PathLike, schemas: tuple[str, ...]) -> tuple[str, dict[str, Any]]:
    """Schema and content of a JSON file of one of these schemas, or a refusal."""
    content = parse_json(path)
    found = content.get("schema") if isinstance(content, dict) else type(content).__name__
    if not isinstance(content, dict) or found not in schemas:
        wanted = " or ".join(f"a {schema} file" for schema in schemas)
        raise ValueError(f"path must hold {wanted}, got {path} with schema {shown(found)}")
    if content.get("version") != VERSION:
        raise ValueError(
            f"path must hold version {VERSION} of {found}, got {path} with version {shown(content.get('version'))}"
        )
    require_schema(content, path, "robust", str(found))
    return str(found), content
