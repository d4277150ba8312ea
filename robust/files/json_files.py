"""Systems and numbers as JSON, exact to the bit, in files with a versioned schema.

A number is written with the digits that give it back exactly; a complex one as [re, im]; nan as null, infinities as
strings. A file is written whole or not at all.
"""

from __future__ import annotations

import json
import os
from typing import Any

import control
import numpy as np

from nlfrf.shared.whole_files import path_of, write_text
from nlfrf.shared.wording import shown

__all__ = [
    "VERSION",
    "PathLike",
    "damaged",
    "decoded",
    "decoded_system",
    "encoded",
    "encoded_system",
    "parsed",
    "read",
    "written",
    "yes_or_no",
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
    except (ValueError, OverflowError):  # of a whole number too large for a float
        raise ValueError(f"path must hold numbers where its schema has them, got {shown(content)}") from None


def encoded_system(system: Any) -> dict[str, Any]:
    """A state space or an FRF."""
    dt = None if system.dt is None else float(system.dt)
    if isinstance(system, control.FrequencyResponseData):
        return {"kind": "frf", "omega": encoded(system.omega), "G": encoded(system.frdata[0, 0]), "dt": dt}
    return {"kind": "ss", "dt": dt, **{name: encoded(getattr(system, name)) for name in "ABCD"}}


def decoded_system(content: dict[str, Any]) -> Any:
    """The way back; an empty A, B or C takes its shape from the others."""
    if content["kind"] not in ("ss", "frf"):
        raise ValueError(f'path must hold systems of the kind "ss" or "frf", got {shown(content["kind"])}')
    if content["kind"] == "frf":
        pairs = decoded(content["G"])
        return control.FrequencyResponseData(pairs[:, 0] + 1j * pairs[:, 1], decoded(content["omega"]), content["dt"])
    D = np.atleast_2d(decoded(content["D"]))
    n = len(content["A"])
    shapes = {"A": (n, n), "B": (n, D.shape[1]), "C": (D.shape[0], n)}
    A, B, C = (np.reshape(decoded(content[name]), shape) for name, shape in shapes.items())
    return control.StateSpace(A, B, C, D, content["dt"])


def yes_or_no(name: str, content: Any) -> bool:
    """A truth value: not whatever else counts as one."""
    if not isinstance(content, bool):
        raise ValueError(f"path must hold true or false for {name}, got {shown(content)}")
    return content


def written(content: dict[str, Any], path: PathLike) -> None:
    """The JSON file, whole or not at all."""
    write_text(path, json.dumps(content, indent=1, allow_nan=False) + "\n")


def parsed(path: PathLike) -> Any:
    """What a JSON file holds, or a refusal."""
    text = path_of(path).read_text(encoding="utf-8", errors="replace")
    try:
        return json.loads(text)
    except (json.JSONDecodeError, RecursionError) as error:
        raise ValueError(f"path must be a whole JSON file, got {path}: {error}") from None


def read(path: PathLike, schemas: tuple[str, ...]) -> tuple[str, dict[str, Any]]:
    """Schema and content of a JSON file of one of these schemas, or a refusal."""
    content = parsed(path)
    found = content.get("schema") if isinstance(content, dict) else type(content).__name__
    if not isinstance(content, dict) or found not in schemas:
        wanted = " or ".join(f"a {schema} file" for schema in schemas)
        raise ValueError(f"path must hold {wanted}, got {path} with schema {shown(found)}")
    if content.get("version") != VERSION:
        raise ValueError(
            f"path must hold version {VERSION} of {found}, got {path} with version {shown(content.get('version'))}"
        )
    return str(found), content


def damaged(schema: str, path: PathLike, error: Exception) -> ValueError:
    """The refusal of a file that says what it is but is not whole."""
    lacks = f"without {error}" if isinstance(error, KeyError) else "with other things where its numbers and systems are"
    return ValueError(f"path must hold a whole {schema} file, got {path} {lacks}")
