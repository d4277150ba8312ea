"""Models and controllers to and from JSON files with a versioned schema, exact to the bit.

A number is written with the digits that give it back exactly; a complex one as [re, im]; nan as null, infinities as
strings. A file is written whole or not at all.
"""

from __future__ import annotations

import json
import os
from dataclasses import fields
from pathlib import Path
from typing import Any

import control
import numpy as np

from nlfrf.shared.whole_files import write_text
from nlfrf.shared.wording import shown
from robust.files.biquads import controller_sections
from robust.systems.realisation import state_space
from robust.uncertain.evidence import Evidence
from robust.uncertain.model import UncertaintyModel
from robust.uncertain.radius import PARTS

__all__ = [
    "CONTROLLER_SCHEMA",
    "MODEL_SCHEMA",
    "PathLike",
    "holds_model",
    "load_controller",
    "load_model",
    "save_controller",
    "save_model",
]


MODEL_SCHEMA, CONTROLLER_SCHEMA = "robust-model", "robust-controller"
VERSION = 1
EVIDENCE = tuple(field.name for field in fields(Evidence))
PathLike = str | os.PathLike[str]


def save_model(model: UncertaintyModel, path: PathLike) -> None:
    """Write an uncertainty model to a ``.json`` file.

    Parameters
    ----------
    model : UncertaintyModel
        The model.
    path : path
        File to write.

    Raises
    ------
    ValueError
        Anything that is not an UncertaintyModel.
    FileNotFoundError
        A folder that does not exist.

    Examples
    --------
    >>> import tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> G, w = control.tf([1], [1, 1]), control.tf([0.2], [1])
    >>> model = UncertaintyModel(G, w, "multiplicative", np.array([1.0, 2.0]), np.array([0.1, 0.2]))
    >>> save_model(model, f"{folder.name}/model.json")
    >>> bool(np.array_equal(load_model(f"{folder.name}/model.json").radius, model.radius))
    True
    >>> folder.cleanup()
    """
    if not isinstance(model, UncertaintyModel):
        raise ValueError(f"model must be an UncertaintyModel, got {shown(model)}")
    content: dict[str, Any] = {
        "schema": MODEL_SCHEMA,
        "version": VERSION,
        "units": {"omega": "rad/s", "delay": "s", "dt": "s"},
        "nominal": encoded_system(model.nominal),
        "weight": encoded_system(model.weight),
        "form": model.form,
        "perturbation": model.perturbation,
        "confidence": encoded(model.confidence),
        "simultaneous": model.simultaneous,
        "omega": encoded(model.omega),
        "radius": encoded(model.radius),
        "delay": encoded(model.delay),
        "extrapolation": model.extrapolation,
        "source": model.source,
        "hold": model.hold,
        "fs": encoded(model.fs),
        "unit": model.unit,
        "joint": encoded(model.joint),
        "joint_bla": encoded(model.joint_bla),
        "evidence": [{part: encoded(getattr(one, part)) for part in EVIDENCE} for one in model.evidence],
    }
    content |= {name: encoded_system(W) for name in ("W1", "W2") if (W := getattr(model, name)) is not None}
    content |= {f"radius_{name}": encoded(getattr(model, f"radius_{name}")) for name in PARTS}
    written(content, path)


def load_model(path: PathLike) -> UncertaintyModel:
    """Read an uncertainty model back from a ``.json`` file.

    Parameters
    ----------
    path : path
        A file that `save_model` wrote.

    Returns
    -------
    UncertaintyModel

    Raises
    ------
    ValueError
        A file that is not such a model, is truncated, or has a newer version.
    FileNotFoundError
        No such file.

    Examples
    --------
    >>> load_model("nothing.json")
    Traceback (most recent call last):
        ...
    FileNotFoundError: [Errno 2] No such file or directory: 'nothing.json'
    """
    content = read(path, MODEL_SCHEMA)
    try:
        return UncertaintyModel(
            nominal=decoded_system(content["nominal"]),
            weight=decoded_system(content["weight"]),
            form=content["form"],
            omega=decoded(content["omega"]),
            radius=decoded(content["radius"]),
            confidence=float(decoded(content["confidence"])),
            perturbation=content["perturbation"],
            simultaneous=yes_or_no("simultaneous", content["simultaneous"]),
            delay=float(decoded(content["delay"])),
            extrapolation=str(content["extrapolation"]),
            source=str(content["source"]),
            hold=str(content.get("hold", "unknown")),  # files of 0.1.0 do not say
            fs=float(decoded(content.get("fs"))),
            unit=str(content.get("unit", "")),
            joint=float(decoded(content.get("joint"))),  # nor these, those of before
            joint_bla=float(decoded(content.get("joint_bla"))),
            evidence=tuple(decoded_evidence(one) for one in content.get("evidence", ())),
            **{name: decoded_system(content[name]) for name in ("W1", "W2") if name in content},
            **{f"radius_{name}": decoded(content[f"radius_{name}"]) for name in PARTS},
        )
    except (KeyError, TypeError, IndexError) as error:
        raise damaged(MODEL_SCHEMA, path, error) from None


def save_controller(K: Any, path: PathLike) -> None:
    """Write a controller to a ``.json`` file.

    Parameters
    ----------
    K : control.StateSpace, TransferFunction or float
        Controller, negative feedback.
    path : path
        File to write.

    Raises
    ------
    ValueError
        Several inputs or outputs, or anything that is no controller.
    FileNotFoundError
        A folder that does not exist.

    Examples
    --------
    >>> import tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> save_controller(control.tf([1, -0.5], [1, -0.9], 0.01), f"{folder.name}/K.json")
    >>> load_controller(f"{folder.name}/K.json").dt
    0.01
    >>> folder.cleanup()
    """
    K = state_space("K", K)
    content = {
        "schema": CONTROLLER_SCHEMA,
        "version": VERSION,
        "units": {"dt": "s"},
        "feedback": "negative: u = K (r - y)",
        "K": encoded_system(K),
    }
    if K.dt:
        content["sections"] = encoded(controller_sections(K))
    written(content, path)


def load_controller(path: PathLike) -> control.StateSpace:
    """Read a controller back from a ``.json`` file.

    Parameters
    ----------
    path : path
        A file that `save_controller` wrote.

    Returns
    -------
    control.StateSpace
        With the sampling time that was saved.

    Raises
    ------
    ValueError
        A file that is not a controller, or is truncated.
    FileNotFoundError
        No such file.

    Examples
    --------
    >>> load_controller("nothing.json")
    Traceback (most recent call last):
        ...
    FileNotFoundError: [Errno 2] No such file or directory: 'nothing.json'
    """
    content = read(path, CONTROLLER_SCHEMA)
    try:
        return state_space("K", decoded_system(content["K"]))
    except (KeyError, TypeError, IndexError) as error:
        raise damaged(CONTROLLER_SCHEMA, path, error) from None


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
    except ValueError:
        raise ValueError(f"path must hold numbers where its schema has them, got {shown(content)}") from None


def encoded_system(system: Any) -> dict[str, Any]:
    """A state space or an FRF."""
    dt = None if system.dt is None else float(system.dt)
    if isinstance(system, control.FrequencyResponseData):
        return {"kind": "frf", "omega": encoded(system.omega), "G": encoded(system.frdata[0, 0]), "dt": dt}
    return {"kind": "ss", "dt": dt, **{name: encoded(getattr(system, name)) for name in "ABCD"}}


def decoded_evidence(content: dict[str, Any]) -> Evidence:
    """What a model remembers of a record."""
    parts = {part: decoded(content[part]) for part in EVIDENCE}
    pairs = parts["G"].reshape(-1, 2)
    return Evidence(**(parts | {"G": pairs[:, 0] + 1j * pairs[:, 1], "confirmed": float(parts["confirmed"])}))


def yes_or_no(name: str, content: Any) -> bool:
    """A truth value: not whatever else counts as one."""
    if not isinstance(content, bool):
        raise ValueError(f"path must hold true or false for {name}, got {shown(content)}")
    return content


def damaged(schema: str, path: PathLike, error: Exception) -> ValueError:
    """The refusal of a file that says what it is but is not whole."""
    lacks = f"without {error}" if isinstance(error, KeyError) else "with other things where its numbers and systems are"
    return ValueError(f"path must hold a whole {schema} file, got {path} {lacks}")


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


def written(content: dict[str, Any], path: PathLike) -> None:
    """The JSON file, whole or not at all."""
    write_text(path, json.dumps(content, indent=1, allow_nan=False) + "\n")


def parsed(path: PathLike) -> Any:
    """What a JSON file holds, or a refusal."""
    text = Path(path).read_text(encoding="utf-8", errors="replace")
    try:
        return json.loads(text)
    except (json.JSONDecodeError, RecursionError) as error:
        raise ValueError(f"path must be a whole JSON file, got {path}: {error}") from None


def holds_model(path: PathLike) -> bool:
    """Whether a JSON file says that it is a model."""
    content = parsed(path)
    return isinstance(content, dict) and content.get("schema") == MODEL_SCHEMA


def read(path: PathLike, schema: str) -> dict[str, Any]:
    """The content of a JSON file of that schema, or a refusal."""
    content = parsed(path)
    if not isinstance(content, dict) or content.get("schema") != schema:
        found = content.get("schema") if isinstance(content, dict) else type(content).__name__
        raise ValueError(f"path must hold a {schema} file, got {path} with schema {found!r}")
    if content.get("version") != VERSION:
        raise ValueError(
            f"path must hold version {VERSION} of {schema}, got {path} with version {content.get('version')}"
        )
    return content
