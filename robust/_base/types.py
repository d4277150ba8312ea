"""Type aliases that many signatures of this package use, written as strings to avoid imports."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    from collections.abc import Sequence

    import control
    import numpy as np

#: A linear system by its matrices or its polynomials.
LinearSystem: TypeAlias = "control.StateSpace | control.TransferFunction"
#: A linear system, or an FRF: anything with a response at frequencies.
AnySystem: TypeAlias = "LinearSystem | control.FrequencyResponseData"
#: A controller from a user: a number, or a matrix of numbers, is a constant gain.
Controller: TypeAlias = "LinearSystem | float | np.ndarray"
#: A weight from a user, on a signal or a channel.
Weight: TypeAlias = "LinearSystem | float | np.ndarray"
#: Type of a field that takes a `Weight`, None, or plants from a user, and holds a state space,
#: None, or a tuple of plants: a dataclass can declare one type only.
SystemField: TypeAlias = Any
#: Rows and columns of each block of a perturbation, and its kind unless it is full.
Blocks: TypeAlias = "Sequence[tuple[int, int] | tuple[int, int, str]]"
