"""Tests for a measured FRF with one input and one output, or a matrix of FRFs."""

from __future__ import annotations

from typing import TypeGuard

from nlfrf import Bla
from nlfrf._base.arguments import short_form

_HINT_FOR_FRF = "; nlfrf.bla_from_frf makes one from another FRF, by its std or coherence"


def is_single(thing: object) -> TypeGuard[Bla]:
    """Return whether a value is a `Bla` with one input and one output."""
    return isinstance(thing, Bla) and thing.is_single


def require_matrix(name: str, thing: object) -> None:
    if not isinstance(thing, Bla) or thing.is_single:
        raise ValueError(
            f"{name} must be an nlfrf.Bla of several inputs or outputs, got"
            f" {_describe_channels(thing)}"
        )


def require_single(name: str, thing: object) -> None:
    if not is_single(thing):
        raise ValueError(
            f"{name} must be an nlfrf.Bla of one input and output, got {_describe_channels(thing)}"
        )


def _describe_channels(thing: object) -> str:
    """Describe a value for a message; for a `Bla` by its number of channels."""
    if not isinstance(thing, Bla):
        return short_form(thing) + _HINT_FOR_FRF * hasattr(thing, "frdata")
    if thing.is_single:
        return "one of one input and output"
    return f"one of {thing.n_outputs} x {thing.n_inputs}"
