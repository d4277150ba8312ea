"""Blocks whose numbers are matrices: a gain, and a system of a given order."""

from __future__ import annotations

import control
import numpy as np

from nlfrf._base.arguments import require_integer, require_real_array
from nlfrf._base.values import ArrayField, value
from robust.lti.lti import Matrices
from robust.lti.norms import continuous_image
from robust.lti.realisation import multivariable
from robust.synthesis.blocks import Names, Numbers, TunableBlock, read_only, signal_names


@value
class Gain(TunableBlock):
    """Static gain or matrix of gains, as a tunable block.

    Use it for `tune`, as a proportional gain or a decoupling matrix.

    Fields
    ------
    K : float or (n_u, n_y) ndarray
        Start value of the gain from the signals `reads` to the signals `drives`. Entries may change
        sign.
    reads, drives : str or list of str
        Names of the input signals (`reads`) and of the output signals (`drives`) of the block.
    fixed : tuple of str
        ("K",) to keep the gain at its start value.
    lower, upper : dict of str to float, optional
        Bounds of every entry of K, with the key "K". The default bound of |K| is 1000 times the
        start value, or 1000 if the start value is zero.
    scheduled : None
        Not available for a matrix. Use a `Pid` for a gain that depends on the operating point.

    Raises
    ------
    ValueError
        A matrix that does not fit the signals or contains numbers that are not finite.

    References
    ----------
    SP 3.2 (signals and blocks).

    Examples
    --------
    >>> Gain(K=[[1.0, 0.0]], reads=["x", "v"], drives="u").K.shape
    (1, 2)
    """

    K: ArrayField

    NUMBERS = ("K",)
    matrix_block = True

    def check_numbers(self) -> None:
        """Check the matrix against the signals."""
        K = require_real_array("K", np.atleast_2d(np.asarray(self.K)), ndim=2).copy()
        if K.shape != (len(self.drives), len(self.reads)):
            raise ValueError(
                f"K must be {len(self.drives)} by {len(self.reads)}, one row a signal it drives,"
                f" got {K.shape[0]} by {K.shape[1]}"
            )
        object.__setattr__(self, "K", read_only(K))

    def state_space(self, numbers: Numbers, dt: float = 0.0) -> Matrices:
        """Return a system without states."""
        K = np.asarray(numbers["K"])
        return np.zeros((0, 0)), np.zeros((0, K.shape[1])), np.zeros((K.shape[0], 0)), K


@value
class StateSpace(TunableBlock):
    """System of a given order with free matrices A, B, C and D, as a tunable block.

    Use it in `tune` for a controller without a prescribed structure, or to improve the controller
    of another design.

    Fields
    ------
    n_states : int
        Number of states.
    reads, drives : str or list of str
        Names of the input signals (`reads`) and of the output signals (`drives`) of the block.
    A, B, C, D : (n_states, n_states), (n_states, n_y), (n_u, n_states), (n_u, n_y) ndarray,
    optional
        Start values. By default A is -I, all entries of B and C are 0.1, and D is zero.
    fixed : tuple of str
        Matrices that keep their start values. For example, ("D",) keeps the block strictly proper.
    lower, upper : dict of str to float, optional
        Bounds of every entry of a matrix, by name of the matrix.
    scheduled : None
        Not available for matrices.

    Raises
    ------
    ValueError
        Matrices that do not fit the order and the signals.

    References
    ----------
    Apkarian & Noll, *Nonsmooth H-infinity synthesis*, IEEE Trans. Automatic Control 51 (2006).

    Examples
    --------
    >>> len(StateSpace(n_states=1, reads=["y1", "y2"], drives="u").parameters(0.0))     # 1 + 2 + 1 + 2
    6
    """

    n_states: int
    A: ArrayField = None
    B: ArrayField = None
    C: ArrayField = None
    D: ArrayField = None

    NUMBERS = ("A", "B", "C", "D")
    matrix_block = True

    @classmethod
    def from_system(
        cls, K: control.StateSpace | control.TransferFunction, *, reads: Names, drives: Names
    ) -> StateSpace:
        """Return a block that starts at a given controller or filter K, continuous or sampled.

        >>> start = StateSpace.from_system(control.ss(-2.0, 1.0, 3.0, 0.0), reads="e", drives="u")
        >>> start.A.tolist(), start.C.tolist()
        ([[-2.0]], [[3.0]])
        """
        system = multivariable("K", K)
        A, B, C, D = continuous_image(system)
        if system.dt:
            rate = 2 / system.dt  # the image has s in units of 2/T
            A, B, C = A * rate, B * np.sqrt(rate), C * np.sqrt(rate)
        n_y, n_u = len(signal_names("reads", reads)), len(signal_names("drives", drives))
        if D.shape != (n_u, n_y):
            raise ValueError(
                f"K must have {n_y} input{'s' * (n_y != 1)} and {n_u} output{'s' * (n_u != 1)}, as"
                f" reads and drives name them, got {D.shape[1]} and {D.shape[0]}"
            )
        return cls(n_states=len(A), reads=reads, drives=drives, A=A, B=B, C=C, D=D)

    def check_numbers(self) -> None:
        """Check the matrices against order and signals."""
        n = require_integer("n_states", self.n_states, least=0)
        m = len(self.reads)
        p = len(self.drives)
        starts = {
            "A": -np.eye(n),
            "B": np.full((n, m), 0.1),
            "C": np.full((p, n), 0.1),
            "D": np.zeros((p, m)),
        }
        for name, start in starts.items():
            given = getattr(self, name)
            if given is None:
                given = start
            else:
                given = require_real_array(name, np.atleast_2d(np.asarray(given)), ndim=2)
            if given.shape != start.shape:
                raise ValueError(
                    f"{name} must be {start.shape[0]} by {start.shape[1]}, got {given.shape[0]} by"
                    f" {given.shape[1]}"
                )
            object.__setattr__(self, name, read_only(given.copy()))
        object.__setattr__(self, "n_states", n)

    def state_space(self, numbers: Numbers, dt: float = 0.0) -> Matrices:
        """Return the four matrices unchanged."""
        return tuple(np.asarray(numbers[name]) for name in "ABCD")  # type: ignore[return-value]
