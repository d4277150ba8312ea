"""The elements of controllers: each as a system and as a section of a drive, with its free
parameters for `tune`.

    Notch       (p^2 + depth width p + 1)/(p^2 + width p + 1)
    Lead        (r p + 1)/(p + r), r^2 = (1 + sin phase)/(1 - sin phase)
    Lag         (p + 1)/(p + 1/gain)
    LowPass     1/(p^2 + 2 zeta p + 1), or 1/(p + 1)
    Biquad      (p^2/q^2 + 2 numerator_zeta p/q + 1)/(p^2 + 2 zeta p + 1), q = numerator_omega/omega
    Pid         kp + ki/s + kd s/(filter_time s + 1)
    Gain        a matrix
    StateSpace  any A, B, C, D of a given order

with p = s/omega. Every frequency is an `omega` [rad/s], as in the rest of the package; 2 pi f for f
in Hz. With a sampling time T an element is its bilinear image: a filter is exact at its own omega,
p = (z - 1)/(z + 1)/tan(omega T/2), a PID at zero frequency, s = 2/T (z - 1)/(z + 1), which is the
trapezoidal rule of a PLC. So the tuned element is exactly the one that is implemented.

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
from robust.lti.norms import continuous_image, discrete_matrices
from robust.lti.realisation import multivariable

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
        return _read_only(np.array(np.broadcast_to(checked, count)))

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
        object.__setattr__(self, "K", _read_only(K))

    def state_space(self, numbers: Numbers, dt: float = 0.0) -> Matrices:
        """Return a system without states."""
        K = np.asarray(numbers["K"])
        return np.zeros((0, 0)), np.zeros((0, K.shape[1])), np.zeros((K.shape[0], 0)), K


@value
class Pid(TunableBlock):
    """PID controller kp + ki/s + kd s/(filter_time s + 1), or a part of it, as a tunable block.

    Use it as the start of `tune` or `design_frf`, or for an existing PID controller.

    Fields
    ------
    kp, ki, kd : float
        Gains at the start of the search, in the unit of `drives` over `reads`; ki per second, kd
        times seconds. A part with zero gain is left out. Each gain keeps its sign.
    filter_time : float
        Time constant of the derivative filter [s]; positive if kd is not zero.
    reads, drives : str
        Names of the input signal (`reads`) and of the output signal (`drives`) of the block.
    fixed : tuple of str
        Parameters that keep their start values.
    lower, upper : dict of str to float, optional
        Bounds by name of the parameter; by default a thousandth of the start value, and a thousand
        times the start value. In a sampled loop filter_time stays above dt/10.
    scheduled : dict of str to int, optional
        Degree d of each number that is a polynomial of the operating point, by name. The field of
        such a number contains its Bernstein coefficients (d + 1,). The first and the last
        coefficient are the values at the ends of the range, and all values are between the smallest
        and the largest coefficient. If a single number is given, all coefficients start with it.

    Raises
    ------
    ValueError
        A derivative without filter, names that are no parameters.

    References
    ----------
    Åström & Hägglund, *Advanced PID Control* (2006), 3.

    Examples
    --------
    >>> Pid(kp=2.0, ki=10.0, reads="e", drives="u").order
    1
    """

    kp: float = 0.0
    ki: float = 0.0
    kd: float = 0.0
    filter_time: float = 0.0

    NUMBERS = ("kp", "ki", "kd", "filter_time")

    @classmethod
    def from_gains(cls, gains: object, *, reads: str, drives: str) -> Pid:
        """Return the block for a `PidGains`, for example from `robust.io.pid_gains`.

        >>> from robust.io import PidGains
        >>> Pid.from_gains(PidGains(kp=2.0, ki=10.0), reads="e", drives="u").ki
        10.0
        """
        return cls(
            reads=reads, drives=drives, **{name: getattr(gains, name) for name in cls.NUMBERS}
        )

    def check_numbers(self) -> None:
        """Check the gains, and the filter of a derivative."""
        super().check_numbers()
        require_nonnegative("filter_time", float(np.min(self.filter_time)))
        if np.any(self.kd) and not np.any(self.filter_time):
            raise ValueError(
                "filter_time must be positive [s] if kd is not zero: a derivative needs a filter,"
                " got 0"
            )

    def present(self) -> list[str]:
        """Return the names of the nonzero gains, and the filter of a derivative."""
        gains = [name for name in ("kp", "ki", "kd") if np.any(getattr(self, name))]
        if np.any(self.kd):
            return [*gains, "filter_time"]
        return gains

    def state_space(self, numbers: Numbers, dt: float = 0.0) -> Matrices:
        """Return the PID as a system with its parts in parallel.

        The factor ki is before the integrator, so that the integral does not jump if ki is
        scheduled.
        """
        rows: list[tuple[float | np.ndarray, ...]] = []
        D = numbers.get("kp", 0.0)
        if "ki" in numbers:
            rows.append((0.0, numbers["ki"], 1.0))
        if "kd" in numbers:
            kd, tau = numbers["kd"], numbers["filter_time"]
            rows.append((-1 / tau, 1 / tau, -kd / tau))
            D = D + kd / tau
        if rows:
            A = np.diag(np.array([row[0] for row in rows]))
        else:
            A = np.zeros((0, 0))
        B = np.array([[row[1]] for row in rows]).reshape(len(rows), 1)
        C = np.array([[row[2] for row in rows]]).reshape(1, len(rows))
        return A, B, C, np.array([[D]])

    def section(self, fs: float) -> np.ndarray:
        """Return (6,) b0 b1 b2 1 a1 a2, in powers of z^-1, of the PID sampled at fs [Hz]."""
        self.require_system(0.0)
        kp, ki, kd, tau = self.kp, self.ki, self.kd, self.filter_time if self.kd else 0.0
        numerator, denominator = [kp * tau + kd, kp + ki * tau, ki], [tau, 1.0, 0.0]
        first, last = 0 if self.kd else 1, 3 if self.ki else 2
        return second_order_section(
            numerator[first:last], denominator[first:last], 2 * require_positive("fs", fs)
        )


@value
class Filter(TunableBlock):
    """A filter of first or second order: a quotient of polynomials in p = s/omega.

    When sampled, it has exactly the response of the continuous filter at omega.
    """

    omega: float

    @abstractmethod
    def polynomials(self, numbers: Numbers) -> Coefficients:
        """Return coefficients of numerator and monic denominator in p, highest power first."""

    def state_space(self, numbers: Numbers, dt: float = 0.0) -> Matrices:
        """Return states in units of omega (sampled: of its image), so that the rows of A have equal
        size.
        """
        omega = numbers["omega"]
        rate = 2 / dt * np.tan(omega * dt / 2) if dt else omega
        (direct, *top), (_, *bottom) = self.polynomials(numbers)
        C = np.array(
            [[b - direct * a for b, a in zip(reversed(top), reversed(bottom), strict=True)]]
        )
        if len(bottom) == 1:
            return np.array([[-rate * bottom[0]]]), np.array([[rate]]), C, np.array([[direct]])
        A = np.array([[0.0, rate], [-rate * bottom[1], -rate * bottom[0]]])
        return A, np.array([[0.0], [rate]]), C, np.array([[direct]])

    def section(self, fs: float) -> np.ndarray:
        """Return (6,) b0 b1 b2 1 a1 a2 of the filter sampled at fs [Hz], in powers of z^-1, as in a
        drive.
        """
        self.require_system(1 / require_positive("fs", fs))
        return second_order_section(*self.polynomials(vars(self)), 1 / np.tan(self.omega / fs / 2))

    def __str__(self) -> str:
        hertz = " to ".join(f"{one / _TWO_PI:g}" for one in np.atleast_1d(self.omega))
        return f"{type(self).__name__.lower()} at {hertz} Hz"


@value
class Notch(Filter):
    """Notch filter for a resonance as a tunable block.

    Fields
    ------
    omega : float
        Frequency of the notch [rad/s].
    depth : float
        Gain at omega. With 0 the frequency omega is blocked completely; a depth above one makes a
        peak. The default range for tuning is 0.001 to 1.
    width : float
        Relative width, which is twice the damping ratio of the poles. A notch of depth zero has a
        gain of 1/sqrt(2) at two frequencies whose distance is width times omega. The default range
        for tuning is 0.01 to 4.
    reads, drives, fixed, lower, upper, scheduled : as for `Pid`

    Raises
    ------
    ValueError
        A frequency or width that is not positive, a negative depth, names that are no parameters.

    References
    ----------
    Steinbuch & Norg, *Advanced motion control: an industrial perspective*, European Journal of
    Control 4 (1998). Siemens, *SINAMICS S120 Function Manual Drive Functions*: current set point
    filters, bandstop with its blocking frequency, bandwidth (here `width` times it) and numerator
    bandwidth (here `depth` times the bandwidth).

    Examples
    --------
    A notch at 83 Hz, 20 Hz wide, at a sampling frequency of 4 kHz.

    >>> slot = Notch(omega=2 * np.pi * 83.0, depth=0.1, width=20.0 / 83.0)
    >>> b, a = slot.section(4000.0).reshape(2, 3)
    >>> q = np.exp(-2j * np.pi * 83.0 / 4000.0)
    >>> round(float(abs(np.polyval(b[::-1], q) / np.polyval(a[::-1], q))), 9)
    0.1
    """

    omega: float
    depth: float = 0.3
    width: float = 0.6

    NUMBERS = ("omega", "depth", "width")
    LIMITS = {"omega": (0.0, np.inf), "depth": (1e-3, 1.0), "width": (1e-2, 4.0)}  # noqa: RUF012

    def check_number(self, name: str, number: float) -> float:
        """Return a valid parameter value, else raise. The depth may be zero."""
        if name == "depth":
            return require_nonnegative(name, number)
        return super().check_number(name, number)

    def polynomials(self, numbers: Numbers) -> Coefficients:
        """Return the coefficients of numerator and denominator in p = s/omega."""
        depth, width = numbers["depth"], numbers["width"]
        return [1.0, depth * width, 1.0], [1.0, width, 1.0]


@value
class Lead(Filter):
    """Lead element as a tunable block: phase lead at omega, where its gain is one.

    The transfer function is (r p + 1)/(p + r), with p = s/omega and r^2 = (1 + sin phase)/(1 - sin
    phase). The gain is 1/r far below omega and r far above it.

    Fields
    ------
    omega : float
        Frequency of the largest lead [rad/s].
    phase : float
        Phase lead at omega [rad], below pi/2. The default range for tuning is 0.01 to 1.5.
    reads, drives, fixed, lower, upper, scheduled : as for `Pid`

    Raises
    ------
    ValueError
        A frequency that is not positive, a phase that is not between zero and pi/2, names that are
        no parameters.

    References
    ----------
    Franklin, Powell & Emami-Naeini, *Feedback Control of Dynamic Systems*, 6.7.

    Examples
    --------
    >>> K = Lead(omega=10.0, phase=np.radians(50)).system()
    >>> round(float(abs(K(10j))), 9), round(float(np.degrees(np.angle(K(10j)))), 9)
    (1.0, 50.0)
    """

    omega: float
    phase: float = 0.8

    NUMBERS = ("omega", "phase")
    LIMITS = {"omega": (0.0, np.inf), "phase": (1e-2, 1.5)}  # noqa: RUF012

    def check_number(self, name: str, number: float) -> float:
        """Return a valid parameter value, else raise."""
        if super().check_number(name, number) >= np.pi / 2 and name == "phase":
            raise ValueError(f"phase must be below pi/2 rad for one lead, got {number:g}. Take two")
        return float(number)

    def polynomials(self, numbers: Numbers) -> Coefficients:
        """Return the coefficients of numerator and denominator in p = s/omega."""
        sine = np.sin(numbers["phase"])
        r = np.sqrt((1 + sine) / (1 - sine))
        return [r, 1.0], [1.0, r]


@value
class Lag(Filter):
    """Lag element as a tunable block: higher gain below omega, gain one above it.

    Fields
    ------
    omega : float
        Frequency below which the gain is raised [rad/s]. With omega at a tenth of the crossover,
        the lag costs 6 degrees of phase at the crossover.
    gain : float
        Gain at zero frequency, above one. inf: the block has PI action, and the gain is not tuned.
    reads, drives, fixed, lower, upper, scheduled : as for `Pid`

    Raises
    ------
    ValueError
        A frequency that is not positive, a gain of one or less, names that are no parameters.

    References
    ----------
    Franklin, Powell & Emami-Naeini, *Feedback Control of Dynamic Systems*, 6.7.

    Examples
    --------
    >>> K = Lag(omega=1.0, gain=20.0).system()
    >>> round(float(abs(K(0))), 9), round(float(abs(K(1e6j))), 6)
    (20.0, 1.0)
    """

    omega: float
    gain: float = np.inf

    NUMBERS = ("omega", "gain")
    LIMITS = {"omega": (0.0, np.inf), "gain": (1.0, np.inf)}  # noqa: RUF012

    def check_number(self, name: str, number: float) -> float:
        """Return a valid parameter value, else raise. The gain may be infinite."""
        if name == "gain" and isinstance(number, float) and np.isposinf(number):
            return number
        if super().check_number(name, number) <= 1 and name == "gain":
            raise ValueError(f"gain must be above 1, got {number:g}")
        return float(number)

    def present(self) -> list[str]:
        """Return the names of the numbers; an infinite gain is not one of them."""
        if np.all(np.isfinite(self.gain)):
            return ["omega", "gain"]
        return ["omega"]

    def polynomials(self, numbers: Numbers) -> Coefficients:
        """Return the coefficients of numerator and denominator in p = s/omega."""
        return [1.0, 1.0], [1.0, 1 / numbers.get("gain", np.inf)]


@value
class LowPass(Filter):
    """Low-pass filter of first or second order as a tunable block.

    Fields
    ------
    omega : float
        Corner [rad/s].
    zeta : float
        Damping ratio of a filter of second order. Default: 1/sqrt(2), the Butterworth filter. The
        default range for tuning is 0.1 to 2.
    order : int
        1 or 2.
    reads, drives, fixed, lower, upper, scheduled : as for `Pid`

    Raises
    ------
    ValueError
        A frequency or damping that is not positive, an order other than one or two, names that are
        no parameters.

    References
    ----------
    Steinbuch & Norg, *Advanced motion control: an industrial perspective*, European Journal of
    Control 4 (1998). G. Ellis, *Control System Design Guide*, 4th ed., Butterworth-Heinemann, 2012,
    9.2.

    Examples
    --------
    >>> round(float(abs(LowPass(omega=10.0, zeta=0.5).system()(10j))), 9)
    1.0
    >>> b, a = LowPass(omega=2 * np.pi * 800).section(4000.0).reshape(2, 3)
    >>> round(float(b.sum() / a.sum()), 9)                            # gain one at zero frequency
    1.0
    """

    omega: float
    zeta: float = np.sqrt(0.5)
    order: int = 2

    NUMBERS = ("omega", "zeta")
    LIMITS = {"omega": (0.0, np.inf), "zeta": (0.1, 2.0)}  # noqa: RUF012

    def check_numbers(self) -> None:
        """Check numbers and order."""
        super().check_numbers()
        if require_integer("order", self.order, least=1) > 2:
            raise ValueError(f"order must be 1 or 2, got {self.order}")

    def present(self) -> list[str]:
        """Return the names of the numbers; a filter of first order has no damping."""
        return ["omega", "zeta"][: self.order]

    def polynomials(self, numbers: Numbers) -> Coefficients:
        """Return the coefficients of numerator and denominator in p = s/omega."""
        if self.order == 1:
            return [0.0, 1.0], [1.0, 1.0]
        return [0.0, 0.0, 1.0], [1.0, 2 * numbers["zeta"], 1.0]


@value
class Biquad(Filter):
    """Second-order filter with gain one at zero frequency, as a tunable block.

    The transfer function is (p^2/q^2 + 2 numerator_zeta p/q + 1)/(p^2 + 2 zeta p + 1), with p =
    s/omega and q = numerator_omega/omega.

    Fields
    ------
    omega, numerator_omega : float
        Natural frequencies of denominator and numerator [rad/s].
    zeta, numerator_zeta : float
        Damping ratios of denominator and numerator. The damping ratio of the numerator may be zero.
    reads, drives, fixed, lower, upper, scheduled : as for `Pid`

    Raises
    ------
    ValueError
        A frequency or the damping of the denominator that is not positive, a negative damping of
        the numerator.

    References
    ----------
    Siemens, *SINAMICS S120 Function Manual Drive Functions*: general filter of second order.

    Examples
    --------
    >>> hz = 2 * np.pi
    >>> slot = Biquad(omega=80 * hz, zeta=0.5, numerator_omega=47 * hz, numerator_zeta=0.02)
    >>> b, a = slot.section(4000.0).reshape(2, 3)
    >>> round(float(b.sum() / a.sum()), 9)
    1.0
    """

    omega: float
    zeta: float
    numerator_omega: float
    numerator_zeta: float

    NUMBERS = ("omega", "zeta", "numerator_omega", "numerator_zeta")
    LIMITS = {  # noqa: RUF012
        "omega": (0.0, np.inf),
        "zeta": (1e-2, 2.0),
        "numerator_omega": (0.0, np.inf),
        "numerator_zeta": (0.0, 2.0),
    }

    def check_number(self, name: str, number: float) -> float:
        """Return a valid parameter value, else raise; the damping of the numerator may be zero."""
        if name == "numerator_zeta":
            return require_nonnegative(name, number)
        return super().check_number(name, number)

    def polynomials(self, numbers: Numbers) -> Coefficients:
        """Return the coefficients of numerator and denominator in p = s/omega."""
        ratio = numbers["omega"] / numbers["numerator_omega"]
        return [ratio**2, 2 * numbers["numerator_zeta"] * ratio, 1.0], [
            1.0,
            2 * numbers["zeta"],
            1.0,
        ]


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
            object.__setattr__(self, name, _read_only(given.copy()))
        object.__setattr__(self, "n_states", n)

    def state_space(self, numbers: Numbers, dt: float = 0.0) -> Matrices:
        """Return the four matrices unchanged."""
        return tuple(np.asarray(numbers[name]) for name in "ABCD")  # type: ignore[return-value]


def _read_only(array: np.ndarray) -> np.ndarray:
    array.setflags(write=False)
    return array


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
