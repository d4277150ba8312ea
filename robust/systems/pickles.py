"""State spaces of python-control as pickles: for a worker in another process, never for a file.

A state space is reduced to its numbers and names: python-control's own holds functions that pickle refuses, so that a
controller could not be sent to a `ProcessPoolExecutor`. A pickle runs code when it is read and knows one version of
python-control: to a file go `save_model` and `save_controller`.
"""

from __future__ import annotations

import copyreg
from typing import Any

import control

__all__ = ["make_picklable"]


def make_picklable() -> None:
    """Let every pickler reduce a state space to numbers and names."""
    copyreg.pickle(control.StateSpace, reduced)


def reduced(system: control.StateSpace) -> tuple[Any, ...]:
    """How to make the system again: a function and what it is given."""
    names = {"inputs": system.input_labels, "outputs": system.output_labels, "states": system.state_labels}
    numbers = (system.A, system.B, system.C, system.D, system.dt)
    return rebuilt, (numbers, {"name": system.name} | {key: list(labels) for key, labels in names.items()})


def rebuilt(numbers: tuple[Any, ...], names: dict[str, Any]) -> control.StateSpace:
    """The system from its numbers and names."""
    return control.StateSpace(*numbers, remove_useless_states=False, **names)
