"""A `MatrixUncertainty` as JSON."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from nlfrf.shared.wording import one_line
from robust.files.json_files import VERSION, decoded, decoded_system, encoded, encoded_system
from robust.uncertain.evidence import MatrixEvidence
from robust.uncertain.matrix_model import MatrixUncertainty

__all__ = ["MATRIX_SCHEMA", "decoded_matrix", "encoded_matrix"]


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
