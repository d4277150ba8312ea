"""JSON files of every kind in this package, for `load` and `save`, which both packages share."""

from __future__ import annotations

import control
import numpy as np

from nlfrf import load as load
from nlfrf import save as save
from nlfrf._base.arguments import short_form
from nlfrf._base.parsing import parse_json_of
from robust.io.learning import LEARNING_SCHEMA, load_learning, save_learning
from robust.io.models import (
    CERTIFICATE_SCHEMAS,
    CONTROLLER_SCHEMA,
    MATRIX_SCHEMA,
    MODEL_SCHEMA,
    PathLike,
    load_system,
    save_controller,
    save_model,
)
from robust.models.sets.model import UncertaintyModel
from robust.synthesis.learning import Learning

_CONTROLLERS = (control.StateSpace, control.TransferFunction, int, float, np.ndarray, np.number)


def save_json(thing: object, path: PathLike, *, delay: float | None, unit: str) -> None:
    """Write a model, a controller, or the certificate of a proof."""
    if isinstance(thing, _CONTROLLERS):
        save_controller(thing, path, delay=delay, unit=unit)
        return
    if delay is not None or unit:
        raise ValueError(
            f"delay and unit must be left out except for a controller, got {delay!r} and {unit!r}"
        )
    if isinstance(thing, UncertaintyModel):
        save_model(thing, path)
        return
    if isinstance(thing, Learning):
        save_learning(thing, path)
        return
    from robust.analysis.report import RobustnessReport
    from robust.friction.proof.protocol import FrictionProof
    from robust.io.certificates import save_certificate
    from robust.scheduling.prove import ScheduleProof

    if isinstance(thing, RobustnessReport | FrictionProof | ScheduleProof):
        save_certificate(thing, path)
    elif isinstance(K := getattr(thing, "K", None), control.StateSpace):
        raise ValueError(
            f"thing must be the controller, got a {type(thing).__name__}: save its K, of order"
            f" {K.nstates}"
        )
    else:
        raise ValueError(
            "thing must be a multisine, an experiment, a record, a BLA, an uncertainty model, a"
            f" controller, a learning filter or a report of a proof, got {short_form(thing)}"
        )


def load_json(path: PathLike) -> object:
    """Read a model, a controller, a learning filter or the claim of a certificate, by the schema in
    the file.
    """
    kinds = (MODEL_SCHEMA, MATRIX_SCHEMA, CONTROLLER_SCHEMA, LEARNING_SCHEMA, *CERTIFICATE_SCHEMAS)
    schema = parse_json_of(path, *kinds)["schema"]
    if schema == LEARNING_SCHEMA:
        return load_learning(path)
    if schema not in CERTIFICATE_SCHEMAS:
        return load_system(path)
    from robust.io.certificates import load_claim

    return load_claim(path)
