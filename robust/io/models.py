"""Models and controllers to and from JSON files, exact to the bit."""

from __future__ import annotations

import json
import os
from dataclasses import fields, replace
from typing import Any

import control
import numpy as np

from nlfrf._base.arguments import one_line, short_form
from nlfrf._base.files import parse_json, require_schema, write_text
from robust.io.biquads import told_sections
from robust.lti.realisation import multivariable, state_space
from robust.models.sets.evidence import Evidence, MatrixEvidence
from robust.models.sets.matrix_model import MatrixUncertainty
from robust.models.sets.model import UncertaintyModel
from robust.models.sets.radius import PARTS

__all__ = [
    "CONTROLLER_SCHEMA",
    "MATRIX_SCHEMA",
    "MODEL_SCHEMA",
    "VERSION",
    "PathLike",
    "controller",
    "decoded",
    "decoded_matrix",
    "decoded_system",
    "encoded",
    "encoded_matrix",
    "encoded_system",
    "holds_model",
    "load_controller",
    "load_model",
    "read",
    "save_controller",
    "save_model",
    "written",
]


# ---- Systems and numbers as JSON, exact to the bit, in files with a versioned schema.
#
# A number is written with the digits that give it back exactly; a complex one as [re, im]; nan as null, infinities as
# strings. A file is written whole or not at all, and what is read is held against the schema that is published.

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
        raise ValueError(f"path must hold rows of the same length, got {short_form(content)}") from None


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
        raise ValueError(f"path must hold {wanted}, got {path} with schema {short_form(found)}")
    if content.get("version") != VERSION:
        raise ValueError(
            f"path must hold version {VERSION} of {found}, got {path} with version {short_form(content.get('version'))}"
        )
    require_schema(content, path, "robust", str(found))
    return str(found), content


# ---- A `MatrixUncertainty` as JSON.

MATRIX_SCHEMA = "robust-matrix-model"
REAL, COMPLEX = ("omega", "dof"), ("G", "C", "gamma")  # of the record
SIDES, NAMES = ("left", "right"), ("inputs", "outputs")
TEXTS, NUMBERS = ("form", "perturbation", "extrapolation", "source"), ("confidence", "joint", "joint_bla")


def encoded_matrix(model: MatrixUncertainty) -> dict[str, Any]:
    """A model of several inputs and outputs as JSON holds it."""
    content: dict[str, Any] = {
        "schema": MATRIX_SCHEMA,
        "version": VERSION,
        "units": {"omega": "rad/s", "dt": "s"},
        "nominal": encoded_system(model.nominal),
        "omega": encoded(model.omega),
        "radius": encoded(model.radius),
        "simultaneous": model.simultaneous,
    }
    content |= {side: [encoded_system(weight) for weight in getattr(model, side)] for side in SIDES}
    content |= {name: list(getattr(model, name)) for name in NAMES}
    content |= {name: getattr(model, name) for name in TEXTS}
    content |= {name: encoded(getattr(model, name)) for name in NUMBERS}
    if model.measured:
        content["measured"] = [
            {part: encoded(getattr(one, part)) for part in (*REAL, *COMPLEX)} for one in model.measured
        ]
    # of two forms of a set the records are the same
    return content if model.other is None else content | {"other": encoded_matrix(replace(model.other, measured=()))}


def decoded_matrix(content: dict[str, Any]) -> MatrixUncertainty:
    """The way back."""
    sides: dict[str, Any] = {side: tuple(decoded_system(one) for one in content[side]) for side in SIDES}
    names: dict[str, Any] = {name: tuple(map(one_line, content[name])) for name in NAMES}
    words: dict[str, Any] = {name: one_line(content[name]) for name in TEXTS}
    numbers: dict[str, Any] = {name: float(decoded(content[name])) for name in NUMBERS}
    other, records = content.get("other"), content.get("measured", [])  # files of before have one, or do not say
    measured = tuple(decoded_record(one) for one in (records if isinstance(records, list) else [records]))
    return MatrixUncertainty(
        other=None if other is None else replace(decoded_matrix(other), measured=measured),
        measured=measured,
        nominal=decoded_system(content["nominal"]),
        omega=decoded(content["omega"]),
        radius=decoded(content["radius"]),
        simultaneous=content["simultaneous"],
        **sides,
        **names,
        **words,
        **numbers,
    )


def decoded_record(content: Any) -> MatrixEvidence:
    """What a model remembers of a record."""
    parts = {part: decoded(content[part]) for part in REAL}
    for part in COMPLEX:
        pairs = decoded(content[part])
        if pairs.ndim != 4 or len(pairs) != parts["omega"].size:
            raise ValueError(f"{part} must have one matrix for each line of the record, got the shape {pairs.shape}")
        parts[part] = pairs[..., 0] + 1j * pairs[..., 1]
    if parts["dof"].shape != parts["omega"].shape:
        raise ValueError(f"dof must have one number for each line of the record, got {parts['dof'].size}")
    return MatrixEvidence(**parts)


MODEL_SCHEMA, CONTROLLER_SCHEMA = "robust-model", "robust-controller"
EVIDENCE = tuple(field.name for field in fields(Evidence))
LEVELS = ("rms_u", "rms_y")


def save_model(model: UncertaintyModel | MatrixUncertainty, path: PathLike) -> None:
    """Write an uncertainty model to a ``.json`` file.

    Parameters
    ----------
    model : UncertaintyModel or MatrixUncertainty
        The model.
    path : path
        File to write.

    Raises
    ------
    ValueError
        Anything that is no model.
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
    if isinstance(model, MatrixUncertainty):
        written(encoded_matrix(model), path)
        return
    if not isinstance(model, UncertaintyModel):
        raise ValueError(f"model must be an UncertaintyModel or a MatrixUncertainty, got {short_form(model)}")
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


def load_model(path: PathLike) -> Any:
    """Read an uncertainty model back from a ``.json`` file.

    Parameters
    ----------
    path : path
        A file that `save_model` wrote.

    Returns
    -------
    UncertaintyModel or MatrixUncertainty

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
    schema, content = read(path, (MODEL_SCHEMA, MATRIX_SCHEMA))
    if schema == MATRIX_SCHEMA:
        return decoded_matrix(content)
    return UncertaintyModel(
        nominal=decoded_system(content["nominal"]),
        weight=decoded_system(content["weight"]),
        form=content["form"],
        omega=decoded(content["omega"]),
        radius=decoded(content["radius"]),
        confidence=float(decoded(content["confidence"])),
        perturbation=content["perturbation"],
        simultaneous=content["simultaneous"],
        delay=float(decoded(content["delay"])),
        extrapolation=one_line(content["extrapolation"]),
        source=one_line(content["source"]),
        hold=content.get("hold", "unknown"),  # files of 0.1.0 do not say
        fs=float(decoded(content.get("fs"))),
        unit=one_line(content.get("unit", "")),
        joint=float(decoded(content.get("joint"))),  # nor these, those of before
        joint_bla=float(decoded(content.get("joint_bla"))),
        evidence=tuple(decoded_evidence(one) for one in content.get("evidence", ())),
        **{name: decoded_system(content[name]) for name in ("W1", "W2") if name in content},
        **{f"radius_{name}": decoded(content[f"radius_{name}"]) for name in PARTS},
    )


def save_controller(K: Any, path: PathLike) -> None:
    """Write a controller to a ``.json`` file.

    Parameters
    ----------
    K : control.StateSpace, TransferFunction, float or (n_u, n_y) ndarray
        Controller, negative feedback.
    path : path
        File to write.

    Raises
    ------
    ValueError
        Anything that is no controller.
    FileNotFoundError
        A folder that does not exist.

    Warns
    -----
    DataWarning
        A sampled controller whose second-order sections do not hold it to 0.1 %: they are left out, A, B, C and D kept.

    Examples
    --------
    >>> import tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> save_controller(control.tf([1, -0.5], [1, -0.9], 0.01), f"{folder.name}/K.json")
    >>> load_controller(f"{folder.name}/K.json").dt
    0.01
    >>> folder.cleanup()
    """
    K = controller("K", K)
    content = {
        "schema": CONTROLLER_SCHEMA,
        "version": VERSION,
        "units": {"dt": "s"},
        "feedback": "negative: u = K (r - y)",
        "K": encoded_system(K),
    }
    content |= {name: encoded(rows) for name, rows in told_sections(K).items()}
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
    _, content = read(path, (CONTROLLER_SCHEMA,))
    return controller("K", decoded_system(content["K"]))


def controller(name: str, K: Any) -> control.StateSpace:
    """Any controller as a state space, of one input and output or of several."""
    several = np.ndim(K) > 0 or getattr(K, "ninputs", 1) > 1 or getattr(K, "noutputs", 1) > 1
    return (multivariable if several else state_space)(name, K)


def decoded_evidence(content: dict[str, Any]) -> Evidence:
    """What a model remembers of a record."""
    numbers = {part: float(decoded(content.get(part))) for part in LEVELS}  # files of before do not say
    numbers["confirmed"] = float(decoded(content["confirmed"]))
    parts = {part: decoded(content[part]) for part in EVIDENCE if part not in numbers}
    shapes = {part: parts[part].shape[:1] for part in parts}
    if len(set(shapes.values())) > 1:
        raise ValueError(f"evidence must have one number a line for {', '.join(shapes)}, got {short_form(shapes)}")
    pairs = parts["G"].reshape(-1, 2)
    return Evidence(**(parts | numbers | {"G": pairs[:, 0] + 1j * pairs[:, 1]}))


def holds_model(path: PathLike) -> bool:
    """Whether a JSON file says that it is a model."""
    content = parse_json(path)
    return isinstance(content, dict) and content.get("schema") in (MODEL_SCHEMA, MATRIX_SCHEMA)
