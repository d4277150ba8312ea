"""A friction law of the user's own: a state, its derivative, the force."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from nlfrf.friction import kernel_data
from nlfrf.friction.hysteresis import NO_GRID
from nlfrf.shared.arguments import nonnegative, real_array
from nlfrf.shared.values import value

__all__ = ["OwnFriction", "OwnLaw", "packed_own"]


@value
class OwnFriction:
    """Friction by functions of your own: dz/dt = derivative(x, v, z), F = force(x, v, z), z = rest to begin with.

    Both are compiled where numba can (plain numbers, arrays and loops of Python and NumPy); where it cannot they run as
    they are, some hundred times slower. Steps are those of Runge and Kutta of order four, of fixed length: a law with
    a jump (sgn v) needs short ones. `run`, `drive`, `simulate` and loops around one axis take it; proofs do not.

    Fields
    ------
    derivative : callable
        (x, v, z) -> (s,) array: how fast the state changes, at a position [m], a velocity [m/s] and a state.
    force : callable
        (x, v, z) -> float: the friction force [N], against the motion where positive with v.
    rest : (s,) ndarray
        The state of a machine that has never moved; empty for a law without one.
    stiffness : float
        dF/dx of the machine stuck [N/m]: how short a step has to be.
    damping : float
        dF/dv there [Ns/m].

    Raises
    ------
    ValueError
        Functions that do not give a force and one derivative for each state, all finite, at rest.

    References
    ----------
    C. Canudas de Wit, H. Olsson, K. J. Åström, P. Lischinsky, *A new model for control of systems with friction*, IEEE
    Transactions on Automatic Control 40 (1995): the law of the example.

    Examples
    --------
    >>> from nlfrf import Rig, run
    >>> def derivative(x, v, z):
    ...     return v - 1e5 * np.abs(v) * z / 0.7
    >>> def force(x, v, z):
    ...     return 1e5 * z[0]
    >>> dahl = OwnFriction(derivative=derivative, force=force, rest=[0.0], stiffness=1e5)
    >>> motion = run(Rig(1.0, 80e3, dahl), np.full(2000, 1.0), fs=4000.0)
    >>> bool(abs(motion.friction).max() < 0.7)
    True
    """

    derivative: Callable[[float, float, np.ndarray], Any]
    force: Callable[[float, float, np.ndarray], float]
    rest: np.ndarray
    stiffness: float
    damping: float = 0.0

    def __post_init__(self) -> None:
        rest = real_array("rest", np.atleast_1d(np.asarray(self.rest, dtype=float)), ndim=1)
        object.__setattr__(self, "rest", rest)
        if rest.size > kernel_data.STACK_DEPTH or not np.isfinite(rest).all():
            raise ValueError(f"rest must hold at most {kernel_data.STACK_DEPTH} finite numbers, got {rest.size}")
        nonnegative("stiffness", self.stiffness)
        nonnegative("damping", self.damping)
        for name, wanted in (("derivative", rest.shape), ("force", ())):
            function = getattr(self, name)
            if not callable(function):
                raise ValueError(f"{name} must be a function of (x, v, z), got {type(function).__name__}")
            try:
                found = np.asarray(function(0.0, 0.0, rest.copy()), dtype=float)
            except Exception as error:  # a function of the user's may raise anything
                raise ValueError(
                    f"{name} must be a function of (x, v, z), got {type(error).__name__}: {error}"
                ) from error
            if found.shape != wanted or not np.isfinite(found).all():
                what = f"{rest.size} finite numbers" if wanted else "one finite number"
                raise ValueError(f"{name} must give {what} at rest, got {found.tolist()}")

    @property
    def compiled(self) -> bool:
        """Whether numba could compile it."""
        from nlfrf.friction.own_kernels import stepper

        return stepper(self.derivative, self.force, self.rest.size)[1]


class OwnLaw(kernel_data.Law):
    """The numbers of a law that has functions beside them."""

    of: OwnFriction


def packed_own(law: OwnFriction) -> tuple[OwnLaw, kernel_data.Grid]:
    """The law as the integration reads it."""
    spring = kernel_data.Curve(kernel_data.SPRING, float(law.stiffness), np.inf)
    numbers = OwnLaw(kernel_data.OWN, np.inf, np.inf, 1.0, 2.0, float(law.damping), 0.0, 1.0, spring)
    numbers.of = law
    return numbers, NO_GRID
