"""Models and controllers to and from JSON files, exact to the bit."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import control
import numpy as np

from nlfrf.shared.strict_json import parse_json
from nlfrf.shared.wording import one_line, shown
from robust.files.biquads import told_sections
from robust.files.json_files import (
    VERSION,
    PathLike,
    decoded,
    decoded_system,
    encoded,
    encoded_system,
    read,
    written,
)
from robust.files.matrix_models import MATRIX_SCHEMA, decoded_matrix, encoded_matrix
from robust.systems.realisation import multivariable, state_space
from robust.uncertain.evidence import Evidence
from robust.uncertain.matrix_model import MatrixUncertainty
from robust.uncertain.model import UncertaintyModel
from robust.uncertain.radius import PARTS

__all__ = [
    "CONTROLLER_SCHEMA",
    "MODEL_SCHEMA",
    "controller",
    "holds_model",
    "load_controller",
    "load_model",
    "save_controller",
    "save_model",
]


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
        raise ValueError(f"model must be an UncertaintyModel or a MatrixUncertainty, got {shown(model)}")
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
        raise ValueError(f"evidence must have one number a line for {', '.join(shapes)}, got {shown(shapes)}")
    pairs = parts["G"].reshape(-1, 2)
    return Evidence(**(parts | numbers | {"G": pairs[:, 0] + 1j * pairs[:, 1]}))


def holds_model(path: PathLike) -> bool:
    """Whether a JSON file says that it is a model."""
    content = parse_json(path)
    return isinstance(content, dict) and content.get("schema") in (MODEL_SCHEMA, MATRIX_SCHEMA)
