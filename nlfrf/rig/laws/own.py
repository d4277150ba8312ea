"""A friction law of user functions: state equation and force."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from nlfrf._base.arguments import (
    require_nonnegative,
    require_real_array,
)
from nlfrf._base.values import value
from nlfrf.rig.kernels import data as kernel_data
from nlfrf.rig.laws.curves import NO_GRID


@value
class OwnFriction:
    """Friction law by your own functions: dz/dt = derivative(x, v, z), F = force(x, v, z).

    Use this for a law that is not built in. Simulations of one axis accept the law; proofs do
    not.

    - The functions are compiled by numba if they use only numbers, arrays and loops of Python and
      NumPy. Otherwise they run about a hundred times slower.
    - The integration is fourth-order Runge-Kutta with fixed steps. A law with a jump, such as sgn v,
      needs short steps.

    Fields
    ------
    derivative : callable
        Function (x, v, z) -> (s,) array: time derivative of the state z, at position x [m] and
        velocity v [m/s].
    force : callable
        Function (x, v, z) -> float: friction force [N]. A force with the sign of v opposes the
        motion.
    rest : (s,) ndarray
        Initial state z, for a machine that has never moved; empty for a law without state.
    stiffness : float
        dF/dx while friction sticks [N/m]; the integration step is chosen by it.
    damping : float
        dF/dv while friction sticks [Ns/m].

    Raises
    ------
    ValueError
        For x = v = 0 and z = rest, the functions do not return a finite force and one finite
        derivative per state.

    References
    ----------
    C. Canudas de Wit, H. Olsson, K. J. Åström, P. Lischinsky, *A new model for control of systems
    with friction*, IEEE Transactions on Automatic Control 40 (1995): the law of the example.

    Examples
    --------
    >>> from nlfrf.rig import Rig, run
    >>> def derivative(x, v, z):
    ...     return v - 1e5 * np.abs(v) * z / 0.7
    >>> def force(x, v, z):
    ...     return 1e5 * z[0]
    >>> dahl = OwnFriction(derivative=derivative, force=force, rest=[0.0], stiffness=1e5)
    >>> motion = run(Rig(1.0, 80e3, dahl), np.full(2000, 1.0), fs=4000.0)
    >>> bool(abs(motion.friction).max() < 0.7)
    True
    """

    derivative: Callable[[float, float, np.ndarray], ArrayLike]
    force: Callable[[float, float, np.ndarray], float]
    rest: np.ndarray
    stiffness: float
    damping: float = 0.0

    def __post_init__(self) -> None:
        rest = require_real_array("rest", np.atleast_1d(np.asarray(self.rest, dtype=float)), ndim=1)
        object.__setattr__(self, "rest", rest)
        if rest.size > kernel_data.STACK_DEPTH or not np.isfinite(rest).all():
            raise ValueError(
                f"rest must hold at most {kernel_data.STACK_DEPTH} finite numbers, got {rest.size}"
            )
        require_nonnegative("stiffness", self.stiffness)
        require_nonnegative("damping", self.damping)
        for name, wanted in (("derivative", rest.shape), ("force", ())):
            function = getattr(self, name)
            if not callable(function):
                raise ValueError(
                    f"{name} must be a function of (x, v, z), got {type(function).__name__}"
                )
            try:
                found = np.asarray(function(0.0, 0.0, rest.copy()), dtype=float)
            except Exception as error:  # a function of the user may raise anything
                raise ValueError(
                    f"{name} must be a function of (x, v, z), got {type(error).__name__}: {error}"
                ) from error
            if found.shape != wanted or not np.isfinite(found).all():
                if wanted:
                    what = f"{rest.size} finite numbers"
                else:
                    what = "one finite number"
                raise ValueError(f"{name} must give {what} at rest, got {found.tolist()}")

    @property
    def compiled(self) -> bool:
        """True if numba has compiled the functions."""
        from nlfrf.rig.kernels.loops import compile_user_law

        return compile_user_law(self.derivative, self.force, self.rest.size)[1]


class UserLawData(kernel_data.Law):
    """Parameters of a law whose state equation and force are user functions."""

    functions: OwnFriction


def pack_user_law(law: OwnFriction) -> tuple[UserLawData, kernel_data.Grid]:
    """Return the parameters of a law of user functions for the integration."""
    spring = kernel_data.Curve(kernel_data.SPRING, float(law.stiffness), np.inf)
    numbers = UserLawData(
        kernel_data.OWN, np.inf, np.inf, 1.0, 2.0, float(law.damping), 0.0, 1.0, spring
    )
    numbers.functions = law
    return numbers, NO_GRID
