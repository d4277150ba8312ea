"""Elements of controllers: each is a system and a section of a drive, with free parameters for
`tune`.

Every frequency is an `omega` [rad/s], as in the rest of the package; 2 pi f for f in Hz. With a
sampling time T an element is its bilinear image: a filter is exact at its own omega, a PID at zero
frequency, s = 2/T (z - 1)/(z + 1), which is the trapezoidal rule of a PLC. So the tuned element is
exactly the one that is implemented.

`tune` connects blocks by the names of their input signals (`reads`) and output signals (`drives`),
which other functions do not need. A parameter keeps the sign of its start value, and the search
varies its logarithm.

A scheduled number is a polynomial of the operating point theta in [-1, 1], in Bernstein form: the
sum over k of c_k binom(d, k) ((1 + theta)/2)^k ((1 - theta)/2)^(d - k). Its values at the ends of
the range are c_0 and c_d. All its values are between the smallest and the largest c_k, so bounds
and sign of the c_k hold for the number.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar, TypeAlias, TypeVar

import control
import numpy as np
from scipy.special import comb

from nlfrf._base.arguments import (
    require_integer,
    require_kind,
    require_nonnegative,
    require_positive,
    require_real,
    require_real_array,
    short_form,
)
from nlfrf._base.values import ArrayField, value
from robust.lti.lti import Matrices
from robust.lti.norms import discrete_matrices

Names: TypeAlias = str | Sequence[str]
#: Numbers of a block by name, real or complex; coefficients of numerator and denominator, highest
#: power first.
Numbers: TypeAlias = Mapping[str, float | np.ndarray]
Coefficients: TypeAlias = tuple[list[float | np.ndarray], list[float | np.ndarray]]
#: Type of a field that is None or a mapping of bounds by name: a dataclass can declare a mapping
#: only.
BoundsField: TypeAlias = Any
Coordinate = TypeVar("Coordinate", float, complex)
Block = TypeVar("Block", bound="TunableBlock")
#: Default range of a parameter, as a factor about its start.
_RANGE_RATIO = 1000.0
#: The fastest pole of a sampled block over 2/T, as in `design_frf`: a faster one rings.
_MAX_SAMPLED_RATE = 5.0
_TWO_PI = 2 * np.pi


@value
class Parameter:
    """One free number of a block."""

    # name, index: field of the block, and index in it if that is a matrix
    name: str
    index: tuple[int, ...]
    start: float
    lower: float
    upper: float
    # 1 or -1: the parameter keeps this sign, and its logarithm is searched for. 0: any sign.
    sign: int

    @property
    def scale(self) -> float:
        """Return the unit of the search for a parameter of any sign."""
        return abs(self.start) or min(1.0, self.upper - self.lower)

    def to_coordinate(self, number: float) -> float:
        """Return the coordinate of the search for a number."""
        if self.sign:
            return float(np.log(self.sign * number))
        return number / self.scale

    def from_coordinate(self, x: Coordinate) -> Coordinate:
        """Return the number of the block for a real or complex coordinate."""
        if self.sign:
            return self.sign * np.exp(x)
        return x * self.scale

    def coordinate_bounds(self) -> tuple[float, float]:
        low, high = sorted(self.to_coordinate(number) for number in (self.lower, self.upper))
        return low, high

    def label(self, block: str) -> str:
        """Return the name, with that of the block in front."""
        if self.index:
            place = "[" + ", ".join(map(str, self.index)) + "]"
        else:
            place = ""
        return f"{block}.{self.name}{place}"


@value
class TunableBlock(ABC):
    """Base of all blocks: signals, free parameters, bounds.

    Subclasses are values with numbers as fields.
    """

    #: Fields with numbers, which keep their sign unless they are entries of a matrix.
    NUMBERS: ClassVar[tuple[str, ...]] = ()
    #: Bounds by the definition of a parameter.
    LIMITS: ClassVar[Mapping[str, tuple[float, float]]] = {}

    reads: Names = ""
    drives: Names = ""
    fixed: Names = ()
    lower: BoundsField = None
    upper: BoundsField = None
    scheduled: BoundsField = None

    def __post_init__(self) -> None:
        for name in ("reads", "drives"):
            given = getattr(self, name)
            object.__setattr__(self, name, () if given in ("", ()) else signal_names(name, given))
        fixed = (self.fixed,) if isinstance(self.fixed, str) else self.fixed
        if not isinstance(fixed, tuple | list) or not set(fixed) <= set(self.NUMBERS):
            raise ValueError(
                f"fixed must name parameters ({', '.join(self.NUMBERS)}), got"
                f" {short_form(self.fixed)}"
            )
        object.__setattr__(self, "fixed", tuple(fixed))
        for name in ("lower", "upper"):
            bounds = getattr(self, name) or {}
            if not isinstance(bounds, Mapping) or not set(bounds) <= set(self.NUMBERS):
                raise ValueError(
                    f"{name} must bound parameters by name ({', '.join(self.NUMBERS)}), got"
                    f" {short_form(bounds)}"
                )
            object.__setattr__(
                self,
                name,
                {key: require_real(f"{name}[{key!r}]", number) for key, number in bounds.items()},
            )
        scheduled, names = self.scheduled or {}, () if self.matrix_block else self.NUMBERS
        if not isinstance(scheduled, Mapping) or not set(scheduled) <= set(names):
            raise ValueError(
                f"scheduled must give degrees by name ({', '.join(names) or 'none here: take Pid'}),"
                f" got {short_form(scheduled)}"
            )
        degrees = {
            key: require_integer(f"scheduled[{key!r}]", degree, least=1)
            for key, degree in scheduled.items()
        }
        object.__setattr__(self, "scheduled", degrees)
        self.check_numbers()

    matrix_block = False

    def check_numbers(self) -> None:
        """Check the numbers of the block and the number of its signals."""
        if len(self.reads) > 1 or len(self.drives) > 1:
            raise ValueError(
                f"reads and drives must name one signal each, got {len(self.reads)} and"
                f" {len(self.drives)}"
            )
        for name in self.NUMBERS:
            check = self.check_coefficients if name in self.scheduled else self.check_number
            object.__setattr__(self, name, check(name, getattr(self, name)))

    def check_coefficients(self, name: str, number: ArrayField) -> np.ndarray:
        """Return the coefficients of a scheduled number, all alike if one number is given."""
        count = self.scheduled[name] + 1
        found = require_real_array(name, np.atleast_1d(np.asarray(number)), ndim=1)
        if found.size not in (1, count) or abs(np.sign(found).sum()) != found.size:
            raise ValueError(
                f"{name} must start at one number that is not zero, or at {count} coefficients of"
                f" one sign for its degree {count - 1}, got {short_form(number)}"
            )
        checked = [self.check_number(name, float(one)) for one in found]
        return read_only(np.array(np.broadcast_to(checked, count)))

    def numbers_at(self, numbers: Numbers, theta: float) -> Numbers:
        """Return numbers of the block with scheduled ones at theta in [-1, 1]."""
        return {
            name: _bernstein(self.scheduled[name], theta) @ number
            if name in self.scheduled
            else number
            for name, number in numbers.items()
        }

    def at(self: Block, theta: float) -> Block:
        """Return the block with its scheduled numbers at theta: -1 and 1 are the ends of the range of
        the operating point.
        """
        theta = require_real("theta", theta)
        if not -1 <= theta <= 1:
            raise ValueError(
                f"theta must lie between -1 and 1, the ends of the range, got {theta:g}"
            )
        numbers = {name: getattr(self, name) for name in self.scheduled}
        held: dict[str, Any] = {
            name: float(one) for name, one in self.numbers_at(numbers, theta).items()
        }
        return replace(self, scheduled=None, **held)

    def check_number(self, name: str, number: float) -> float:
        """Return a valid parameter value, else raise."""
        if name in self.LIMITS:
            return require_positive(name, number)
        return require_real(name, number)

    def present(self) -> list[str]:
        """Return the names of the numbers of this block; a part that is left out has none."""
        return list(self.NUMBERS)

    def parameters(self, dt: float) -> list[Parameter]:
        """Return free numbers in the order of the fields, with bounds for a sampling time dt [s]
        (0: continuous).
        """
        numbers = {
            name: array for name, array in parameter_values(self).items() if name not in self.fixed
        }
        return [
            self.parameter(name, index, float(start), dt)
            for name, array in numbers.items()
            for index, start in np.ndenumerate(array)
        ]

    def parameter(self, name: str, index: tuple[int, ...], start: float, dt: float) -> Parameter:
        """Return one free number with its bounds; refuse a start outside them."""
        if self.matrix_block:
            sign = 0
        else:
            sign = int(np.sign(start))
        reach = _RANGE_RATIO * (abs(start) or 1.0)
        if sign:
            low, high = start / _RANGE_RATIO, start * _RANGE_RATIO
        else:
            low, high = -reach, reach
        low, high = min(low, high), max(low, high)
        least, most = self.natural_bounds(name, dt)
        low, high = max(low, least), min(high, most)
        low, high = self.lower.get(name, low), self.upper.get(name, high)
        if sign and (low * sign <= 0 or high * sign <= 0):
            raise ValueError(
                f"lower and upper must keep the sign of {name}, which starts at {start:g}, got"
                f" {low:g} to {high:g}"
            )
        if not low <= start <= high or low == high:
            raise ValueError(
                f"{name} must start between its bounds, {low:g} to {high:g}, got {start:g}. "
                "Move the start, or widen lower and upper"
            )
        return Parameter(name=name, index=index, start=start, lower=low, upper=high, sign=sign)

    def natural_bounds(self, name: str, dt: float) -> tuple[float, float]:
        """Return bounds that follow from the definition of a parameter."""
        low, high = self.LIMITS.get(name, (-np.inf, np.inf))
        if dt and name.endswith("omega"):
            return low, 2 / dt * np.arctan(_MAX_SAMPLED_RATE)
        if dt and name == "filter_time":
            return max(low, dt / 2 / _MAX_SAMPLED_RATE), high
        return low, high

    @abstractmethod
    def state_space(self, numbers: Numbers, dt: float = 0.0) -> Matrices:
        """Return A, B, C, D for these numbers, which may be complex; complex analytic in them.

        The matrices are in s, or for a sampling time dt [s] in 2/dt (z - 1)/(z + 1).
        """

    def system(self, dt: float = 0.0) -> control.StateSpace:
        """Return the block as a system with the names of its signals, sampled if dt [s] is given.

        Use it as a start for `design_frf`; `pid_gains` reads its gains.
        """
        dt = require_nonnegative("dt", dt)
        self.require_system(dt)
        A, B, C, D = (
            np.asarray(part, dtype=float) for part in self.state_space(parameter_values(self), dt)
        )
        A, B, C, D = discrete_matrices((A, B, C, D), dt)
        names = {"inputs": list(self.reads) or None, "outputs": list(self.drives) or None}
        return control.StateSpace(A, B, C, D, dt, remove_useless_states=False, **names)

    def require_system(self, dt: float) -> None:
        """Refuse scheduled numbers, and a frequency above the Nyquist frequency of a sampling time dt
        [s].
        """
        if self.scheduled:
            raise ValueError(
                f"scheduled must be empty for one system, got {self.scheduled}: take block.at(theta), or"
                " design.schedule for the whole controller"
            )
        omega = getattr(self, "omega", 0.0)
        if omega * dt >= np.pi:
            raise ValueError(
                f"omega must lie below half the sampling frequency, {np.pi / dt:.6g} rad/s"
                f" ({0.5 / dt:.6g} Hz), got {omega:.6g} rad/s ({omega / _TWO_PI:.6g} Hz)"
            )

    @property
    def order(self) -> int:
        """Return the number of states."""
        return int(self.state_space(self.numbers_at(parameter_values(self), 0.0))[0].shape[0])


def _bernstein(degree: int, theta: float) -> np.ndarray:
    """Return (degree + 1,) the Bernstein polynomials on [-1, 1] at theta."""
    k = np.arange(degree + 1)
    return np.asarray(comb(degree, k) * ((1 + theta) / 2) ** k * ((1 - theta) / 2) ** (degree - k))


def signal_names(name: str, given: Names) -> tuple[str, ...]:
    """Return signal names as a tuple; refuse anything else."""
    names = (given,) if isinstance(given, str) else given
    if (
        not isinstance(names, tuple | list)
        or not names
        or not all(isinstance(one, str) and one for one in names)
    ):
        raise ValueError(f"{name} must name one signal or several, got {short_form(given)}")
    return tuple(names)


def second_order_section(
    numerator: Sequence[float | np.ndarray], denominator: Sequence[float | np.ndarray], scale: float
) -> np.ndarray:
    """Return (6,) b0 b1 b2 1 a1 a2, in powers of z^-1, for a quotient of polynomials in scale (z -
    1)/(z + 1).

    Both have the same number of coefficients, at most three, highest power first.

    >>> second_order_section([0.0, 1.0], [1.0, 1.0], 1.0)           # 1/(p + 1), p = (z - 1)/(z + 1)
    array([0.5, 0.5, 0. , 1. , 0. , 0. ])
    """
    n = len(denominator) - 1
    powers = [
        scale ** (n - k) * np.atleast_1d(np.poly([1.0] * (n - k) + [-1.0] * k))
        for k in range(n + 1)
    ]
    b, a = (np.asarray(one) @ np.array(powers) for one in (numerator, denominator))
    return np.concatenate([np.pad(one, (0, 2 - n)) for one in (b / a[0], a / a[0])])


def parameter_values(block: TunableBlock) -> dict[str, np.ndarray]:
    return {name: np.array(getattr(block, name), dtype=float) for name in block.present()}


def with_parameters(
    block: TunableBlock, parameters: list[Parameter], numbers: np.ndarray
) -> TunableBlock:
    """Return the same block with other numbers."""
    new = parameter_values(block)
    for parameter, number in zip(parameters, numbers, strict=True):
        new[parameter.name][parameter.index] = number
    held: dict[str, ArrayField] = {
        name: array if array.ndim else float(array) for name, array in new.items()
    }
    return replace(block, **held)


def require_blocks(blocks: object) -> dict[str, TunableBlock]:
    """Return blocks by name; refuse anything else."""
    if not isinstance(blocks, Mapping) or not blocks:
        raise ValueError(
            "blocks must be named blocks, {name: robust.tuning.Pid(...)}, got"
            f" {short_form(blocks)}"
        )
    for name, block in blocks.items():
        require_kind(f"blocks[{name!r}]", block, TunableBlock)
        if not (block.reads and block.drives):
            raise ValueError(
                f"blocks[{name!r}] must name the signal that it reads and the one that it drives,"
                " got none"
            )
    return dict(blocks)


def read_only(array: np.ndarray) -> np.ndarray:
    array.setflags(write=False)
    return array
