"""Types that signatures of this package say often, under one name each; as texts, so that nothing is loaded."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    from collections.abc import Sequence

    import control
    import numpy as np

#: A linear system by its matrices or its polynomials.
LinearSystem: TypeAlias = "control.StateSpace | control.TransferFunction"
#: The same, or an FRF: what has a response at frequencies.
AnySystem: TypeAlias = "LinearSystem | control.FrequencyResponseData"
#: A controller as a user gives it: a number, or a matrix of them, is a constant gain.
Controller: TypeAlias = "LinearSystem | float | np.ndarray"
#: A weight on a signal or a channel, as a user gives it.
Weight: TypeAlias = "LinearSystem | float | np.ndarray"
#: Type of a field that takes a `Weight`, None, or plants as a user gives them, and holds a state space, None, or a
#: tuple of plants: a dataclass can declare one only.
SystemField: TypeAlias = Any
#: Rows and columns of each block of a perturbation, and its kind where it is not full.
Blocks: TypeAlias = "Sequence[tuple[int, int] | tuple[int, int, str]]"
