"""Tests for a measured FRF with one input and one output, or a matrix of FRFs."""

from __future__ import annotations

from typing import TypeGuard

from nlfrf import Bla
from nlfrf._base.arguments import short_form

_HINT_FOR_FRF = "; nlfrf.bla_from_frf makes one from another FRF, by its std or coherence"


def _count_channels(thing: object) -> tuple[int, int]:
    """Return the number of outputs and of inputs of a `Bla`; zeros for anything else."""
    if isinstance(thing, Bla):
        return thing.n_outputs, thing.n_inputs
    return 0, 0


def is_single(thing: object) -> TypeGuard[Bla]:
    """Return whether a value is a `Bla` with one input and one output."""
    return _count_channels(thing) == (1, 1)


def require_matrix(name: str, thing: object) -> None:
    if _count_channels(thing) <= (1, 1):
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
    n_outputs, n_inputs = _count_channels(thing)
    if not n_outputs:
        return short_form(thing) + _HINT_FOR_FRF * hasattr(thing, "frdata")
    if n_outputs == n_inputs == 1:
        return "one of one input and output"
    return f"one of {n_outputs} x {n_inputs}"
