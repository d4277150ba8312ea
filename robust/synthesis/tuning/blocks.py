"""Blocks with free parameters: what each is as a state space, and how its parameters are bounded and scaled.

    Gain        a matrix                           K
    Pid         kp + ki/s + kd s/(filter_time s + 1)
    Notch       (s^2 + depth width omega s + omega^2)/(s^2 + width omega s + omega^2)
    Lead        r (s + omega/r)/(s + omega r), r^2 = (1 + sin phase)/(1 - sin phase)
    Filter2     omega^2/(s^2 + 2 zeta omega s + omega^2)
    StateSpace  any A, B, C, D of a given order

Under a clock s = 2/T (z - 1)/(z + 1): each block is its own Tustin image, so that the controller that was tuned is the
one that runs. A parameter that starts positive (or negative) keeps its sign and is searched for in logarithms.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

import control
import numpy as np

from nlfrf._base.arguments import (
    require_integer,
    require_kind,
    require_positive,
    require_real,
    require_real_array,
    short_form,
)
from nlfrf._base.values import value
from robust.lti.lti import Matrices
from robust.lti.norms import continuous_image, to_discrete
from robust.lti.realisation import multivariable

Names: TypeAlias = str | Sequence[str]
#: How far a parameter may go from where it starts, as a factor, unless its block says otherwise.
RANGE_RATIO = 1000.0
#: The fastest pole of a sampled block over 2/T, as in `design_frf`: beyond it the sampled block rings.
MAX_SAMPLED_RATE = 5.0
NO_STATES = (np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)))


@value
class Parameter:
    """One free number of a block.

    Fields
    ------
    name, index : str, tuple of int
        Field of the block, and place in it where that is a matrix.
    start, lower, upper : float
    sign : int
        1 or -1: of this sign throughout, searched for in logarithms. 0: of any sign.
    """

    name: str
    index: tuple[int, ...]
    start: float
    lower: float
    upper: float
    sign: int

    @property
    def scale(self) -> float:
        """Return the unit in which a parameter of any sign is searched for."""
        return abs(self.start) or min(1.0, self.upper - self.lower)

    def to_coordinate(self, number: float) -> float:
        """Return the coordinate of the search."""
        return float(np.log(self.sign * number)) if self.sign else number / self.scale

    def from_coordinate(self, x: Any) -> Any:
        """Return the number of the block, of a real or complex coordinate."""
        return self.sign * np.exp(x) if self.sign else x * self.scale

    def coordinate_bounds(self) -> tuple[float, float]:
        """Return bounds of the coordinate."""
        low, high = sorted(self.to_coordinate(number) for number in (self.lower, self.upper))
        return low, high

    def label(self, block: str) -> str:
        """Return the name with that of its block."""
        place = "[" + ", ".join(map(str, self.index)) + "]" if self.index else ""
        return f"{block}.{self.name}{place}"


class TunableBlock:
    """What all blocks share: signals, free parameters, bounds. Subclasses are values with numbers as fields."""

    #: Fields with numbers, and those that keep their sign.
    NUMBERS: tuple[str, ...] = ()
    SIGNED: tuple[str, ...] = ()
    #: Bounds that the meaning of a parameter sets.
    LIMITS: Mapping[str, tuple[float, float]] = {}

    reads: Names
    drives: Names
    fixed: Any
    lower: Any
    upper: Any

    def __post_init__(self) -> None:
        for name in ("reads", "drives"):
            object.__setattr__(self, name, signal_names(name, getattr(self, name)))
        fixed = (self.fixed,) if isinstance(self.fixed, str) else self.fixed
        if not isinstance(fixed, tuple | list) or not set(fixed) <= set(self.NUMBERS):
            raise ValueError(f"fixed must name parameters ({', '.join(self.NUMBERS)}), got {short_form(self.fixed)}")
        object.__setattr__(self, "fixed", tuple(fixed))
        for name in ("lower", "upper"):
            bounds = getattr(self, name)
            if not isinstance(bounds, Mapping):
                if not self.matrix_block and bounds is not None:
                    raise ValueError(f"{name} must be bounds by name, {{parameter: number}}, got {short_form(bounds)}")
                bounds = {} if bounds is None else dict.fromkeys(self.NUMBERS, require_real(name, bounds))
            if not set(bounds) <= set(self.NUMBERS):
                raise ValueError(f"{name} must bound parameters ({', '.join(self.NUMBERS)}), got {short_form(bounds)}")
            object.__setattr__(
                self, name, {key: require_real(f"{name}[{key!r}]", number) for key, number in bounds.items()}
            )
        self.check_numbers()

    matrix_block = False

    def check_numbers(self) -> None:
        """Check the numbers of the block, and how many signals it has."""
        if len(self.reads) != 1 or len(self.drives) != 1:
            raise ValueError(
                f"reads and drives must name one signal each, got {len(self.reads)} and {len(self.drives)}"
            )
        for name in self.NUMBERS:
            number = getattr(self, name)
            if number is not None:
                number = require_positive(name, number) if name in self.LIMITS else require_real(name, number)
                object.__setattr__(self, name, number)

    def present(self) -> list[str]:
        """Return the names of the numbers that this block has: a part that is left out has none."""
        return [name for name in self.NUMBERS if getattr(self, name) is not None]

    def free_mask(self, name: str) -> np.ndarray:
        """Return which entries of a number or matrix are free."""
        return np.full(np.shape(getattr(self, name)), name not in self.fixed)

    def parameters(self, dt: float) -> list[Parameter]:
        """Return free numbers in the order of the fields, with their bounds under a clock dt [s] (0: continuous)."""
        found = []
        for name in self.present():
            array, free = np.asarray(getattr(self, name), dtype=float), self.free_mask(name)
            for index in np.ndindex(array.shape):
                if free[index]:
                    found.append(self.parameter(name, index, float(array[index]), dt))
        return found

    def parameter(self, name: str, index: tuple[int, ...], start: float, dt: float) -> Parameter:
        """One free number with its bounds, or a refusal of a start outside them."""
        sign = int(np.sign(start)) if name in self.SIGNED else 0
        reach = RANGE_RATIO * (abs(start) or 1.0)
        low, high = (start / RANGE_RATIO, start * RANGE_RATIO) if sign else (-reach, reach)
        low, high = min(low, high), max(low, high)
        least, most = self.natural_bounds(name, dt)
        low, high = max(low, least), min(high, most)
        low, high = self.lower.get(name, low), self.upper.get(name, high)
        if sign and (low * sign <= 0 or high * sign <= 0):
            raise ValueError(
                f"lower and upper must keep the sign of {name}, which starts at {start:g}, got {low:g} to {high:g}"
            )
        if not low <= start <= high or low == high:
            raise ValueError(
                f"{name} must start between its bounds, {low:g} to {high:g}, got {start:g}. "
                "Move the start, or widen lower and upper"
            )
        return Parameter(name=name, index=index, start=start, lower=low, upper=high, sign=sign)

    def natural_bounds(self, name: str, dt: float) -> tuple[float, float]:
        """Return bounds that follow from what the parameter is."""
        low, high = self.LIMITS.get(name, (-np.inf, np.inf))
        fastest = MAX_SAMPLED_RATE * 2 / dt if dt else np.inf
        if name == "omega":
            return low, fastest
        return (max(low, 1 / fastest), high) if name == "filter_time" else (low, high)

    def state_space(self, numbers: Mapping[str, np.ndarray]) -> Matrices:
        """Return A, B, C, D in s for these numbers, which may be complex; complex analytic in them."""
        raise NotImplementedError

    def system(self, dt: float = 0.0) -> control.StateSpace:
        """Return the block as a system with its signal names, sampled by Tustin where dt [s] is given.

        It is a start for `design_frf`, and `pid_gains` reads it.
        """
        A, B, C, D = (np.asarray(part, dtype=float) for part in self.state_space(parameter_values(self)))
        if dt:
            root = np.sqrt(dt / 2)  # s in units of 2/T
            A, B, C, D = to_discrete(A * dt / 2, B * root, C * root, D)
        names = {"inputs": list(self.reads), "outputs": list(self.drives)}
        return control.StateSpace(A, B, C, D, dt, remove_useless_states=False, **names)

    @property
    def order(self) -> int:
        """Return the number of states."""
        return int(self.state_space(parameter_values(self))[0].shape[0])


def signal_names(name: str, given: Names) -> tuple[str, ...]:
    """Return signal names as a tuple, or a refusal."""
    names = (given,) if isinstance(given, str) else given
    if not isinstance(names, tuple | list) or not names or not all(isinstance(one, str) and one for one in names):
        raise ValueError(f"{name} must name one signal or several, got {short_form(given)}")
    return tuple(names)


def parameter_values(block: TunableBlock) -> dict[str, np.ndarray]:
    """Return numbers of a block by name."""
    return {name: np.array(getattr(block, name), dtype=float) for name in block.present()}


def with_parameters(block: Any, parameters: list[Parameter], numbers: np.ndarray) -> Any:
    """Return the same block with other numbers."""
    new = parameter_values(block)
    for parameter, number in zip(parameters, numbers, strict=True):
        new[parameter.name][parameter.index] = number
    return replace(block, **{name: array if array.ndim else float(array) for name, array in new.items()})


@value
class Gain(TunableBlock):
    """A static gain, or a matrix of them.

    Fields
    ------
    K : float or (n_u, n_y) ndarray
        Start: drives = K reads. Entries may change sign.
    reads, drives : str or list of str
        Signals.
    free : (n_u, n_y) ndarray of bool, optional
        Which entries are tuned; all when not given.
    fixed : tuple of str
        ("K",) where nothing is tuned.
    lower, upper : float or dict, optional
        Bounds of every entry; 1000 times its start, 1000 where that is zero, when not given.

    Raises
    ------
    ValueError
        A matrix that does not fit the signals, or is not of finite numbers.

    References
    ----------
    SP 3.2 (signals and blocks).

    Examples
    --------
    >>> Gain(K=[[1.0, 0.0]], reads=["x", "v"], drives="u").K.shape
    (1, 2)
    """

    K: Any
    reads: Names
    drives: Names
    free: Any = None
    fixed: Any = ()
    lower: Mapping[str, float | np.ndarray] | None = None
    upper: Mapping[str, float | np.ndarray] | None = None

    NUMBERS = ("K",)
    matrix_block = True

    def check_numbers(self) -> None:
        """Check the matrix against the signals."""
        K = require_real_array("K", np.atleast_2d(np.asarray(self.K)), ndim=2).copy()
        if K.shape != (len(self.drives), len(self.reads)):
            raise ValueError(
                f"K must be {len(self.drives)} by {len(self.reads)}, one row a signal it drives, got "
                f"{K.shape[0]} by {K.shape[1]}"
            )
        free = np.ones(K.shape, bool) if self.free is None else np.atleast_2d(np.asarray(self.free))
        if free.shape != K.shape or free.dtype != bool:
            raise ValueError(f"free must be a matrix of true and false like K, got {short_form(self.free)}")
        object.__setattr__(self, "K", read_only(K))
        object.__setattr__(self, "free", read_only(free.copy()))

    def free_mask(self, name: str) -> np.ndarray:
        """Return which entries are free."""
        return self.free & (name not in self.fixed)

    def state_space(self, numbers: Mapping[str, np.ndarray]) -> Matrices:
        """Return no states."""
        K = np.asarray(numbers["K"])
        return np.zeros((0, 0)), np.zeros((0, K.shape[1])), np.zeros((K.shape[0], 0)), K


@value
class Pid(TunableBlock):
    """kp + ki/s + kd s/(filter_time s + 1), or the parts of it that are given.

    Fields
    ------
    kp, ki, kd : float, optional
        Gains where the search starts: unit of drives over reads, the same per second, the same times seconds. A part
        that is not given is not there. Each gain keeps its sign.
    filter_time : float, optional
        Time constant of the derivative filter [s]; where kd is given.
    reads, drives : str
        Signals: drives = Pid reads.
    fixed : tuple of str
        Parameters that stay at their start.
    lower, upper : dict of str to float, optional
        Bounds by name; a thousandth and a thousand times the start when not given. Under a clock filter_time stays
        above dt/10.

    Raises
    ------
    ValueError
        No part at all, a gain of zero, a derivative without filter, names that are no parameters.

    References
    ----------
    Åström & Hägglund, *Advanced PID Control* (2006), 3.

    Examples
    --------
    >>> Pid(kp=2.0, ki=10.0, reads="e", drives="u").order
    1
    """

    reads: Names
    drives: Names
    kp: float | None = None
    ki: float | None = None
    kd: float | None = None
    filter_time: float | None = None
    fixed: Any = ()
    lower: Mapping[str, float | np.ndarray] | None = None
    upper: Mapping[str, float | np.ndarray] | None = None

    NUMBERS = ("kp", "ki", "kd", "filter_time")
    SIGNED = ("kp", "ki", "kd", "filter_time")

    @classmethod
    def from_gains(cls, gains: Any, *, reads: str, drives: str) -> Pid:
        """Return the block of a `PidGains`, the same PID: `pid_gains` reads those of a design of `design_frf`.

        >>> from robust.io import PidGains
        >>> Pid.from_gains(PidGains(kp=2.0, ki=10.0), reads="e", drives="u").ki
        10.0
        """
        numbers = {name: getattr(gains, name) or None for name in cls.NUMBERS}
        return cls(reads=reads, drives=drives, **numbers)

    def check_numbers(self) -> None:
        """Check the gains, and that each part is whole."""
        super().check_numbers()
        if self.kp is None and self.ki is None and self.kd is None:
            raise ValueError("kp must be given, or ki or kd: a PID needs at least one part, got none")
        for name in self.present():
            if getattr(self, name) == 0:
                raise ValueError(f"{name} must not start at zero: leave it out, or start it at its sign, got 0")
        if (self.kd is None) != (self.filter_time is None):
            raise ValueError(
                "filter_time must be given [s] where kd is, and only there: a derivative needs a filter, got "
                f"kd = {self.kd} and filter_time = {self.filter_time}"
            )
        if self.filter_time is not None:
            require_positive("filter_time", self.filter_time)

    def state_space(self, numbers: Mapping[str, np.ndarray]) -> Matrices:
        """Return integral and derivative side by side."""
        rows: list[tuple[Any, Any, Any]] = []
        D = numbers.get("kp", 0.0)
        if "ki" in numbers:
            rows.append((0.0, 1.0, numbers["ki"]))
        if "kd" in numbers:
            kd, tau = numbers["kd"], numbers["filter_time"]
            rows.append((-1 / tau, 1 / tau, -kd / tau))
            D = D + kd / tau
        A = np.diag([row[0] for row in rows]) if rows else np.zeros((0, 0))
        B = np.array([[row[1]] for row in rows]).reshape(len(rows), 1)
        C = np.array([[row[2] for row in rows]]).reshape(1, len(rows))
        return A, B, C, np.array([[D]])


@value
class Notch(TunableBlock):
    """(s^2 + depth width omega s + omega^2)/(s^2 + width omega s + omega^2), as `robust.shaping.notch` has it.

    Fields
    ------
    omega : float
        Its frequency at the start [rad/s]; under a clock in the plane of the bilinear map.
    depth, width : float
        Gain there, and width relative to omega, 2 zeta of the poles.
    reads, drives, fixed, lower, upper : as for `Pid`
        The depth lies between 0.001 and 1, the width between 0.01 and 4, when no bounds are given.

    Raises
    ------
    ValueError
        Numbers that are not positive, names that are no parameters.

    References
    ----------
    Steinbuch & Norg, *Advanced motion control: an industrial perspective*, European Journal of Control 4 (1998).

    Examples
    --------
    >>> Notch(omega=500.0, reads="u_c", drives="u").depth
    0.3
    """

    omega: float
    reads: Names
    drives: Names
    depth: float = 0.3
    width: float = 0.6
    fixed: Any = ()
    lower: Mapping[str, float | np.ndarray] | None = None
    upper: Mapping[str, float | np.ndarray] | None = None

    NUMBERS = ("omega", "depth", "width")
    SIGNED = NUMBERS
    LIMITS = {"omega": (0.0, np.inf), "depth": (1e-3, 1.0), "width": (1e-2, 4.0)}  # noqa: RUF012

    def state_space(self, numbers: Mapping[str, np.ndarray]) -> Matrices:
        """Return states in units of omega, so that both rows of A are alike."""
        w, depth, width = numbers["omega"], numbers["depth"], numbers["width"]
        A = w * np.array([[0.0 * w, 1.0 + 0 * w], [-1.0 + 0 * w, -width]])
        return A, w * np.array([[0.0], [1.0]]), np.array([[0.0 * w, (depth - 1) * width]]), np.ones((1, 1))


@value
class Lead(TunableBlock):
    """r (s + omega/r)/(s + omega r): phase lead at omega, gain one there, as `robust.shaping.lead` has it.

    Fields
    ------
    omega : float
        Where the lead is largest, at the start [rad/s].
    phase : float
        Lead there [rad]; between 0.01 and 1.5 when no bounds are given.
    reads, drives, fixed, lower, upper : as for `Pid`

    Raises
    ------
    ValueError
        A frequency that is not positive, a phase that is not between its bounds, names that are no parameters.

    References
    ----------
    Franklin, Powell & Emami-Naeini, *Feedback Control of Dynamic Systems*, 6.7.

    Examples
    --------
    >>> round(float(Lead(omega=10.0, phase=0.8, reads="e", drives="u").parameters(0.0)[1].upper), 3)
    1.5
    """

    omega: float
    reads: Names
    drives: Names
    phase: float = 0.8
    fixed: Any = ()
    lower: Mapping[str, float | np.ndarray] | None = None
    upper: Mapping[str, float | np.ndarray] | None = None

    NUMBERS = ("omega", "phase")
    SIGNED = NUMBERS
    LIMITS = {"omega": (0.0, np.inf), "phase": (1e-2, 1.5)}  # noqa: RUF012

    def state_space(self, numbers: Mapping[str, np.ndarray]) -> Matrices:
        """One state: r + r omega (1/r - r)/(s + omega r)."""
        w = numbers["omega"]
        sine = np.sin(numbers["phase"])
        r = np.sqrt((1 + sine) / (1 - sine))
        return np.array([[-w * r]]), np.array([[w * r]]), np.array([[1 / r - r]]), np.array([[r]])


@value
class Filter2(TunableBlock):
    """omega^2/(s^2 + 2 zeta omega s + omega^2): a low-pass filter of second order, as `robust.shaping.roll_off` has it.

    Fields
    ------
    omega : float
        Corner at the start [rad/s].
    zeta : float
        Damping; between 0.1 and 2 when no bounds are given.
    reads, drives, fixed, lower, upper : as for `Pid`

    Raises
    ------
    ValueError
        Numbers that are not positive, names that are no parameters.

    References
    ----------
    Steinbuch & Norg, *Advanced motion control: an industrial perspective*, European Journal of Control 4 (1998).

    Examples
    --------
    >>> Filter2(omega=1000.0, reads="u_c", drives="u").order
    2
    """

    omega: float
    reads: Names
    drives: Names
    zeta: float = 0.7
    fixed: Any = ()
    lower: Mapping[str, float | np.ndarray] | None = None
    upper: Mapping[str, float | np.ndarray] | None = None

    NUMBERS = ("omega", "zeta")
    SIGNED = NUMBERS
    LIMITS = {"omega": (0.0, np.inf), "zeta": (0.1, 2.0)}  # noqa: RUF012

    def state_space(self, numbers: Mapping[str, np.ndarray]) -> Matrices:
        """Return states in units of omega."""
        w, zeta = numbers["omega"], numbers["zeta"]
        A = w * np.array([[0.0 * w, 1.0 + 0 * w], [-1.0 + 0 * w, -2 * zeta]])
        return A, w * np.array([[0.0], [1.0]]), np.array([[1.0, 0.0]]), np.zeros((1, 1))


@value
class StateSpace(TunableBlock):
    """Any system of a given order: A, B, C and D are all free.

    Fields
    ------
    n_states : int
        Number of states.
    reads, drives : str or list of str
        Signals.
    A, B, C, D : (n_states, n_states), (n_states, n_y), (n_u, n_states), (n_u, n_y) ndarray, optional
        Start. When not given A is -1 on the diagonal, B and C are 0.1 everywhere and D is zero.
    fixed : tuple of str
        Matrices that stay at their start: ("D",) keeps the block strictly proper.
    lower, upper : float or dict, optional
        Bounds of every entry.

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
    reads: Names
    drives: Names
    A: Any = None
    B: Any = None
    C: Any = None
    D: Any = None
    fixed: Any = ()
    lower: Mapping[str, float | np.ndarray] | None = None
    upper: Mapping[str, float | np.ndarray] | None = None

    NUMBERS = ("A", "B", "C", "D")
    matrix_block = True

    @classmethod
    def from_system(
        cls, K: control.StateSpace | control.TransferFunction, *, reads: Names, drives: Names
    ) -> StateSpace:
        """Return the block that starts at a controller or filter K, continuous or sampled, of any design.

        >>> start = StateSpace.from_system(control.ss(-2.0, 1.0, 3.0, 0.0), reads="e", drives="u")
        >>> start.A.tolist(), start.C.tolist()
        ([[-2.0]], [[3.0]])
        """
        system = multivariable("K", K)
        A, B, C, D = continuous_image(system)
        if system.dt:
            rate = 2 / system.dt  # the image counts s in units of 2/T
            A, B, C = A * rate, B * np.sqrt(rate), C * np.sqrt(rate)
        n_y, n_u = len(signal_names("reads", reads)), len(signal_names("drives", drives))
        if D.shape != (n_u, n_y):
            raise ValueError(
                f"K must have {n_y} input{'s' * (n_y != 1)} and {n_u} output{'s' * (n_u != 1)}, as reads and drives "
                f"name them, got {D.shape[1]} and {D.shape[0]}"
            )
        return cls(n_states=len(A), reads=reads, drives=drives, A=A, B=B, C=C, D=D)

    def check_numbers(self) -> None:
        """Check the matrices against order and signals."""
        n, m, p = require_integer("n_states", self.n_states, least=0), len(self.reads), len(self.drives)
        starts = {"A": -np.eye(n), "B": np.full((n, m), 0.1), "C": np.full((p, n), 0.1), "D": np.zeros((p, m))}
        for name, start in starts.items():
            given = getattr(self, name)
            given = start if given is None else require_real_array(name, np.atleast_2d(np.asarray(given)), ndim=2)
            if given.shape != start.shape:
                raise ValueError(
                    f"{name} must be {start.shape[0]} by {start.shape[1]}, got {given.shape[0]} by {given.shape[1]}"
                )
            object.__setattr__(self, name, read_only(given.copy()))
        object.__setattr__(self, "n_states", n)

    def state_space(self, numbers: Mapping[str, np.ndarray]) -> Matrices:
        """Return the matrices themselves."""
        return tuple(np.asarray(numbers[name]) for name in "ABCD")  # type: ignore[return-value]


def read_only(array: np.ndarray) -> np.ndarray:
    """Return the array, read-only."""
    array.setflags(write=False)
    return array


def require_blocks(blocks: Any) -> dict[str, TunableBlock]:
    """Check blocks by name, or a refusal."""
    if not isinstance(blocks, Mapping) or not blocks:
        raise ValueError(f"blocks must be named blocks, {{name: robust.tuning.Pid(...)}}, got {short_form(blocks)}")
    for name, block in blocks.items():
        require_kind(f"blocks[{name!r}]", block, TunableBlock)
    return dict(blocks)
