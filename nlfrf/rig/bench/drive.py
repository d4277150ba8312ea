"""Settings of a drive: gains, filters, sampling and units, for a simulated or a real axis.

r --->(+)-->[ kv ]-->(+)-->[ kp (1 + 1/(tn s)) ]-->[filters]-->[limit]--- i* -->[delay]-->[1/(lag s
+ 1)]--> motor
     -^             -^
      |              +------[velocity: differences, low-pass or observer]------- position of the motor
      +---------------------------------------------- position of the motor or of the load
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np

from nlfrf._base.arguments import (
    as_list,
    ratio_unit,
    require_choice,
    require_integer,
    require_nonnegative,
    require_positive,
    require_real,
    require_real_array,
)
from nlfrf._base.drive_entries import USUAL_KV, is_unusual_gain
from nlfrf._base.units import parse_gain_unit, position_factor
from nlfrf._base.values import ArrayField, freeze_array, value


class _FilterSlot(Protocol):
    """Interface of a filter slot of a drive:

    `Notch`, `LowPass` and `Biquad` of `robust.tuning` have it.
    """

    def section(self, fs: float) -> np.ndarray:
        """Return (6,) b0 b1 b2 1 a1 a2 of the filter sampled at fs [Hz], in powers of z^-1."""


class _Scale(NamedTuple):
    """Unit of a measured position, and its factor to m or rad of the velocity loop."""

    unit: str
    factor: float


@value
class Drive:
    """Settings of a drive: position controller (P), velocity controller (PI), filters, and units.

    A simulated drive has anti-windup: while the output is limited, the integrator does not move
    further towards the limit.

    Parameters
    ----------
    fs : float
        Sampling frequency of the velocity loop and of the current set point [Hz].
    kv : float
        Gain of the position loop [1/s].
    kp : float
        Gain of the velocity loop, in `kp_unit`.
    kp_unit : str
        Unit of `kp`, current or force over velocity: "A/(m/s)", "A s/rad", "Nm/(rad/s)", "A/rpm",
        ...
    tn : float
        Reset time of the velocity controller [s]; infinite for no integral part.
    torque_constant : float
        Force or torque per current [N/A] or [Nm/A], in the coordinate of the velocity loop; nan if
        unknown.
    lag : float
        Time constant of the current loop [s].
    delay_periods : float
        Delay from sampling to the change of the current, in periods of `fs`; it need not be a whole
        number.
    filters : tuple of Notch, LowPass, Biquad, or (S, 6) ndarray
        Filters between the velocity controller and the current limit: elements of `robust.tuning`,
        or second-order sections as in scipy.signal.
    position_every : int
        Number of periods of the velocity loop in one period of the position loop.
    encoder : str
        Encoder that both loops read: "motor" or "load". "both": the velocity loop reads the motor,
        the position loop the load.
    velocity_lag : float
        Time constant of a low-pass on the velocity [s]. The velocity is the difference of two
        positions over the period.
    observer_frequency : float
        Natural frequency [Hz] of an observer that gives the velocity: a critically damped tracking
        loop, s/(s/omega + 1)^2. Infinite: the velocity is the difference of two positions.
    velocity_feedforward : float
        Fraction of the set-point velocity that is added to the velocity set point, 0 to 1. The
        presets of `nlfrf.servo_axis` have 1.
    limit : float
        Limit of the current or force set point in either direction [A], [N] or [Nm], as in
        `kp_unit`.
    position_unit, load_unit : str
        Unit of the measured position, and with two encoders of the position of the load: "m", "mm",
        "um", "rad", "deg", "rev", or another one ("counts") with a factor. By default m or rad, as
        in `kp_unit`.
    unit_factor, load_factor : float
        Motion in the unit of the velocity loop (m or rad) per `position_unit`, and per `load_unit`.
        It is needed for counts, and for different kinds of unit, such as rad at a motor and mm
        after its screw.
    assumed : tuple of str
        Names of settings that were not given and have their defaults; they are printed as assumed.

    Raises
    ------
    ValueError
        A number is out of range, a unit is unknown, a factor is missing, or filters are not
        second-order sections.

    References
    ----------
    H. Gross, J. Hamann, G. Wiegärtner, *Electrical Feed Drives in Automation*, Publicis MCD, 2001:
    the cascade.

    Examples
    --------
    >>> drive = Drive(fs=4000, kv=100, kp=143, kp_unit="A/(m/s)", tn=0.01, torque_constant=52.8)
    >>> print(drive)
    position loop kv = 100 1/s = 6 (m/min)/mm, every 0.25 ms
    velocity loop kp = 143 A/(m/s), tn = 10 ms, velocity from differences, every 0.25 ms
    force constant 52.8 N/A; current loop: lag 0 ms, delay 0.25 ms
    """

    fs: float
    kv: float
    kp: float
    kp_unit: str
    tn: float = np.inf
    torque_constant: float = np.nan
    lag: float = 0.0
    delay_periods: float = 1.0
    filters: ArrayField = ()
    position_every: int = 1
    encoder: str = "motor"
    velocity_lag: float = 0.0
    observer_frequency: float = np.inf
    velocity_feedforward: float = 0.0
    limit: float = np.inf
    position_unit: str = ""
    unit_factor: float = np.nan
    load_unit: str = ""
    load_factor: float = np.nan
    assumed: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        require_positive("fs", self.fs)
        for name in ("kv", "kp", "lag", "delay_periods", "velocity_lag"):
            require_nonnegative(name, getattr(self, name))
        for name in ("tn", "limit", "observer_frequency"):
            if getattr(self, name) != np.inf:
                require_positive(name, getattr(self, name))
        for name in ("torque_constant", "unit_factor", "load_factor"):
            number = getattr(self, name)
            if not (isinstance(number, float) and np.isnan(number)):
                require_positive(name, number)
        if not 0 <= require_real("velocity_feedforward", self.velocity_feedforward) <= 1:
            raise ValueError(
                f"velocity_feedforward must lie between 0 and 1, got {self.velocity_feedforward:g}"
            )
        require_integer("position_every", self.position_every, least=1)
        require_choice("encoder", self.encoder, ("motor", "load", "both"))
        object.__setattr__(self, "filters", _filter_slots(self.filters))
        _ = self.sections  # refuses a filter beyond half the sampling frequency
        _ = self.load_scale  # refuses units and factors that do not fit

    @property
    def sections(self) -> np.ndarray:
        """(S, 6) second-order sections of the filters."""
        slots = [
            slot if isinstance(slot, np.ndarray) else slot.section(self.fs) for slot in self.filters
        ]
        return np.array(slots, dtype=float).reshape(-1, 6)

    @property
    def position_scale(self) -> _Scale:
        """Unit of the measured position, with its factor to the unit of the velocity loop.

        With two encoders it is the unit of the motor position.
        """
        unit = self.position_unit or self.base_unit
        return _Scale(unit, _scale_factor("unit_factor", self.unit_factor, unit, self.base_unit))

    @property
    def load_scale(self) -> _Scale:
        """Unit of the measured position of the load, with its factor to the unit of the velocity
        loop.
        """
        position = self.position_scale
        unit = self.load_unit or position.unit
        if np.isnan(self.load_factor) and unit == position.unit:
            return position
        return _Scale(unit, _scale_factor("load_factor", self.load_factor, unit, self.base_unit))

    @property
    def velocity_from(self) -> str:
        """Source of the velocity, "differences" or "observer"."""
        if np.isinf(self.observer_frequency):
            return "differences"
        return "observer"

    @property
    def dt(self) -> float:
        """Period of the velocity loop [s]."""
        return 1 / self.fs

    @property
    def delay(self) -> float:
        """Delay from sampling to the change of the current set point [s]."""
        return self.delay_periods / self.fs

    @property
    def base_unit(self) -> str:
        """Unit of position in the velocity loop: "m" or "rad"."""
        return parse_gain_unit(self.kp_unit)[1]

    @property
    def output_unit(self) -> str:
        """Unit of the output of the velocity loop: "A", "N" or "Nm"."""
        return parse_gain_unit(self.kp_unit)[0]

    @property
    def force_unit(self) -> str:
        """Unit of the force in the coordinate of the velocity loop: "N" or "Nm"."""
        return {"m": "N", "rad": "Nm"}[self.base_unit]

    @property
    def gain(self) -> float:
        """Gain kp of the velocity controller [A, N or Nm over m/s or rad/s]."""
        return self.kp * parse_gain_unit(self.kp_unit)[2]

    def output_factor(self, unit: str) -> float:
        """Return the factor from the output of the velocity loop to a current [A] or a force [N] or
        [Nm].
        """
        if unit == self.output_unit:
            return 1.0
        if {unit, self.output_unit} != {"A", self.force_unit}:
            raise ValueError(
                f"output_unit must be A or {self.force_unit} for a velocity loop in {self.kp_unit},"
                f" got {unit!r}"
            )
        if np.isnan(self.torque_constant):
            raise ValueError(
                f"torque_constant must be given [{self.force_unit}/A] between {self.output_unit}"
                f" and {unit}, got none"
            )
        if unit != "A":
            return self.torque_constant
        return 1 / self.torque_constant

    def __str__(self) -> str:
        period = 1e3 / self.fs
        if np.isinf(self.tn):
            reset = "no integral part"
        else:
            reset = f"tn = {1e3 * self.tn:.6g} ms"
        if self.velocity_lag:
            smoothed = f" after a first-order low-pass of {1e3 * self.velocity_lag:.6g} ms"
        else:
            smoothed = ""
        if self.velocity_from == "observer":
            velocity = f"an observer of {self.observer_frequency:g} Hz"
        else:
            velocity = f"differences{smoothed}"
        low, high = USUAL_KV
        if is_unusual_gain(self.kv):
            unusual = f" (drives have {low:g} to {high:g} 1/s: look up its unit)"
        else:
            unusual = ""
        if self.base_unit == "m":
            per_mm = f" = {0.06 * self.kv:.4g} (m/min)/mm"
        else:
            per_mm = ""
        rows = [
            (
                f"position loop kv = {self.kv:.6g} 1/s{per_mm}{unusual}, every"
                f" {period * self.position_every:g} ms"
            ),
            (
                f"velocity loop kp = {self.kp:.6g} {self.kp_unit}, {reset}, velocity from"
                f" {velocity}, every {period:g} ms"
            ),
        ]
        if self.encoder == "both":
            rows.append(
                f"velocity of the motor [{self.position_scale.unit}], position of the load"
                f" [{self.load_scale.unit}]"
            )
        named = ["a section" if isinstance(one, np.ndarray) else str(one) for one in self.filters]
        rows += [f"filters: {', '.join(named)}"] if named else []
        constant = ratio_unit(self.force_unit, "A")
        if np.isnan(self.torque_constant):
            known = ""
        else:
            known = f"force constant {self.torque_constant:g} {constant}; "
        if self.assumed:
            guessed = f" ({' and '.join(self.assumed)} assumed, not given)"
        else:
            guessed = ""
        rows.append(
            f"{known}current loop: lag {1e3 * self.lag:g} ms, delay {1e3 * self.delay:g}"
            f" ms{guessed}"
        )
        return "\n".join(rows)


def _filter_slots(given: object) -> tuple[_FilterSlot | np.ndarray, ...]:
    """Return filters as a tuple of elements or of sections; refuse anything else."""
    slots: list[Any] = as_list(given)
    if all(hasattr(one, "section") for one in slots):
        return tuple(slots)
    sections = require_real_array("filters", given, ndim=2)
    if sections.shape[1:] != (6,) or not np.allclose(sections[:, 3], 1):
        raise ValueError(
            "filters must be elements or second-order sections (S, 6) with 1 in the fourth column,"
            " got "
            f"{'another fourth column' if sections.shape[1:] == (6,) else f'shape {sections.shape}'}"
        )
    return tuple(freeze_array(one) for one in sections)


def _scale_factor(name: str, given: float, unit: str, base: str) -> float:
    """Return the number of base units in one unit: as given, or by its name."""
    if np.isnan(given):
        return position_factor(name, unit, base)
    return given
