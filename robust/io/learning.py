"""Learning filters as JSON: the set, the controller and the choices of their design."""

from __future__ import annotations

from dataclasses import replace

from nlfrf._base.arguments import one_line
from nlfrf._base.files import write_json
from robust.io.models import (
    VERSION,
    PathLike,
    decode_model,
    decode_system,
    encode_model,
    encode_system,
    read_json,
)
from robust.synthesis.learning import Learning

LEARNING_SCHEMA = "robust-learning"
_NUMBERS = ("delay", "omega_Q", "factor", "full")


def save_learning(learning: Learning, path: PathLike) -> None:
    """Write a learning filter to a ``.json`` file; the model is stored without its records."""
    L = learning.L if isinstance(learning.L, str) else encode_system(learning.L)
    content = {
        "schema": LEARNING_SCHEMA,
        "version": VERSION,
        "units": {"dt": "s", "delay": "s", "omega_Q": "rad/s"},
    }
    content |= {
        "model": encode_model(replace(learning.model, records=())),
        "K": encode_system(learning.K),
        "L": L,
    }
    content |= {name: float(getattr(learning, name)) for name in _NUMBERS}
    content |= {"u_max": float(learning.u_max)} if learning.u_max < float("inf") else {}
    write_json(content | {"reason": learning.reason}, path)


def load_learning(path: PathLike) -> Learning:
    """Read a learning filter back from a ``.json`` file."""
    _, content = read_json(path, (LEARNING_SCHEMA,))
    model = content["model"]
    return Learning(
        model=decode_model(model, model["schema"]),
        K=decode_system(content["K"]),
        L=content["L"] if isinstance(content["L"], str) else decode_system(content["L"]),
        reason=one_line(content["reason"]),
        u_max=float(content.get("u_max", "inf")),
        **{name: float(content[name]) for name in _NUMBERS},
    )
