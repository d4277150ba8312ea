"""Whether a measured FRF is of one input and one output, or a matrix of several."""

from __future__ import annotations

from typing import TypeGuard

import control

from nlfrf import Bla
from nlfrf._base.arguments import short_form

_HINT_FOR_FRF = "; of an FRF from elsewhere nlfrf.bla_from_frf makes one, by its std or coherence"


def is_single(thing: object) -> TypeGuard[Bla]:
    """Return whether it is a `Bla` of one input and one output."""
    return isinstance(thing, Bla) and thing.is_single


def is_matrix(thing: object) -> TypeGuard[Bla]:
    """Return whether it is a `Bla` of several inputs or outputs."""
    return isinstance(thing, Bla) and not thing.is_single


def is_known_on_lines(plant: object) -> bool:
    """Return whether a plant is an FRF, or a set around one: known at its frequencies only."""
    return isinstance(plant, Bla | control.FrequencyResponseData) or bool(getattr(plant, "measured_only", False))


def require_matrix(name: str, thing: object) -> None:
    """Refuse anything but a `Bla` of several inputs or outputs."""
    if not is_matrix(thing):
        raise ValueError(f"{name} must be an nlfrf.Bla of several inputs or outputs, got {_describe_channels(thing)}")


def require_single(name: str, thing: object) -> None:
    """Refuse anything but a `Bla` of one input and one output."""
    if not is_single(thing):
        raise ValueError(f"{name} must be an nlfrf.Bla of one input and output, got {_describe_channels(thing)}")


def _describe_channels(thing: object) -> str:
    """Return a value in a refusal: of a `Bla` how many channels it has."""
    if not isinstance(thing, Bla):
        return short_form(thing) + _HINT_FOR_FRF * hasattr(thing, "frdata")
    return "one of one input and output" if thing.is_single else f"one of {thing.n_outputs} x {thing.n_inputs}"
