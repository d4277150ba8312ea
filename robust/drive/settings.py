"""The settings of a drive: gains, filters, sampling and units.

r --->(+)-->[ kv ]-->(+)-->[ kp (1 + 1/(tn s)) ]-->[filters]-->[limit]--- i* -->[delay]-->[1/(lag s + 1)]--> motor
     -^             -^
      |              +------[velocity: differences, low-pass or observer]------- position of the motor
      +---------------------------------------------- position of the motor or of the load
"""

from __future__ import annotations

import numpy as np

from nlfrf._base.arguments import (
    ratio_unit,
    require_choice,
    require_integer,
    require_kind,
    require_nonnegative,
    require_positive,
    require_real,
)
from nlfrf._base.units import parse_gain_unit, position_factor
from nlfrf._base.values import value
from robust.synthesis.blocks import Filter

#: Position gains [1/s] that no warning is made of. Chosen: the four preset axes have 15 to 100 1/s, and a unit that is
#: misread is off by a factor of 16.7 or 60.
USUAL_KV = (5.0, 1000.0)


@value
class DriveSettings:
    """What is typed into a drive: a position P, a velocity PI, filters, and the units of it all.

    Parameters
    ----------
    fs : float
        Sampling frequency of the velocity loop and of the current set point [Hz].
    kv : float
        Gain of the position loop [1/s].
    kp : float
        Gain of the velocity loop, in `kp_unit`.
    kp_unit : str
        Current or force over velocity: "A/(m/s)", "A s/rad", "Nm/(rad/s)", "A/rpm".
    tn : float
        Reset time of the velocity loop [s], not in ms; infinite: no integral part.
    torque_constant : float
        Force per current [N/A] or [Nm/A], in the coordinate of the velocity loop; nan where it is not known.
    lag : float
        Time constant of the current loop [s].
    delay_periods : float
        From sampling to the current set point changing, in periods of `fs`; any part of one, or several.
    filters : tuple of Notch, LowPass, Biquad
        Between the velocity loop and the limit.
    position_every : int
        The position loop runs in every so many periods of the velocity loop.
    encoder : str
        "motor" or "load": which of them both loops read. "both": velocity of the motor, position of the load.
    velocity_from : str
        "differences": of two positions, behind a low-pass of `velocity_lag`. "observer": a tracking loop of second
        order, critically damped, s/(s/omega + 1)^2 with omega of `observer_frequency`.
    velocity_lag : float
        Time constant of the low-pass on the differences [s].
    observer_frequency : float
        Natural frequency of the observer [Hz].
    velocity_feedforward : float
        Share of the velocity of the position set point that goes straight to the velocity loop, 0 to 1.
    limit : float
        Of the current or force set point, either way, in the output unit of `kp_unit`.
    position_unit, load_unit : str
        Unit in which the position is measured, of the load with two encoders: "m", "mm", "um", "rad", "deg", "rev", or
        any other ("counts") with its factor. That of `kp_unit`, in m or rad, when not given.
    unit_factor, load_factor : float
        How many units of the velocity loop (m or rad) one `position_unit`, one `load_unit` is. Needed where they are
        not multiples of one another: rad of a motor behind a screw for a position in mm, counts.
    assumed : tuple of str
        Settings that nobody gave, which stand at their defaults: printed as assumed.

    Raises
    ------
    ValueError
        Numbers out of range, a unit that is not known, a factor that is missing.

    References
    ----------
    H. Gross, J. Hamann, G. Wiegärtner, *Electrical Feed Drives in Automation*, Publicis MCD, 2001: the cascade.

    Examples
    --------
    >>> settings = DriveSettings(fs=4000, kv=100, kp=143, kp_unit="A/(m/s)", tn=0.01, torque_constant=52.8)
    >>> print(settings)
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
    filters: tuple[Filter, ...] = ()
    position_every: int = 1
    encoder: str = "motor"
    velocity_from: str = "differences"
    velocity_lag: float = 0.0
    observer_frequency: float = np.nan
    velocity_feedforward: float = 0.0
    limit: float = np.inf
    position_unit: str = ""
    unit_factor: float = np.nan
    load_unit: str = ""
    load_factor: float = np.nan
    assumed: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("fs", "kp"):
            require_positive(name, getattr(self, name))
        for name in ("kv", "lag", "delay_periods", "velocity_lag"):
            require_nonnegative(name, getattr(self, name))
        for name in ("tn", "limit"):
            if getattr(self, name) != np.inf:
                require_positive(name, getattr(self, name))
        for name in ("torque_constant", "unit_factor", "load_factor"):
            if not np.isnan(require_number(name, getattr(self, name))):
                require_positive(name, getattr(self, name))
        if not 0 <= require_real("velocity_feedforward", self.velocity_feedforward) <= 1:
            raise ValueError(f"velocity_feedforward must lie between 0 and 1, got {self.velocity_feedforward:g}")
        require_integer("position_every", self.position_every, least=1)
        require_choice("encoder", self.encoder, ("motor", "load", "both"))
        require_choice("velocity_from", self.velocity_from, ("differences", "observer"))
        require_kind("filters", self.filters, tuple)
        for slot in self.filters:
            require_kind("filters", slot, Filter)
            slot.section(self.fs)
        if self.velocity_from == "observer" and not require_real("observer_frequency", self.observer_frequency) > 0:
            raise ValueError(f"observer_frequency must be positive, got {self.observer_frequency:g}")
        base = parse_gain_unit(self.kp_unit)[1]
        object.__setattr__(self, "position_unit", self.position_unit or base)
        object.__setattr__(self, "load_unit", self.load_unit or self.position_unit)
        if np.isnan(self.unit_factor):
            object.__setattr__(self, "unit_factor", position_factor("unit_factor", self.position_unit, base))
        if np.isnan(self.load_factor):
            same = self.load_unit == self.position_unit
            factor = self.unit_factor if same else position_factor("load_factor", self.load_unit, base)
            object.__setattr__(self, "load_factor", factor)

    @property
    def dt(self) -> float:
        """Period of the velocity loop [s]."""
        return 1 / self.fs

    @property
    def delay(self) -> float:
        """From sampling to the current set point changing [s]."""
        return self.delay_periods / self.fs

    @property
    def base_unit(self) -> str:
        """Unit of position in the velocity loop: "m" or "rad"."""
        return parse_gain_unit(self.kp_unit)[1]

    @property
    def output_unit(self) -> str:
        """Unit of what the velocity loop puts out: "A", "N" or "Nm"."""
        return parse_gain_unit(self.kp_unit)[0]

    @property
    def force_unit(self) -> str:
        """Unit of the force on the coordinate of the velocity loop: "N" or "Nm"."""
        return {"m": "N", "rad": "Nm"}[self.base_unit]

    @property
    def gain(self) -> float:
        """The gain kp [A, N or Nm over m/s or rad/s]."""
        return self.kp * parse_gain_unit(self.kp_unit)[2]

    def output_factor(self, unit: str) -> float:
        """Return the factor from what the velocity loop puts out to a current [A] or a force [N] or [Nm]."""
        if unit == self.output_unit:
            return 1.0
        if {unit, self.output_unit} != {"A", self.force_unit}:
            raise ValueError(
                f"output_unit must be A or {self.force_unit} for a velocity loop in {self.kp_unit}, got {unit!r}"
            )
        if np.isnan(self.torque_constant):
            raise ValueError(
                f"torque_constant must be given [{self.force_unit}/A] between {self.output_unit} and {unit}, got none"
            )
        return self.torque_constant if unit != "A" else 1 / self.torque_constant

    def __str__(self) -> str:
        period = 1e3 / self.fs
        reset = "no integral part" if np.isinf(self.tn) else f"tn = {1e3 * self.tn:.6g} ms"
        smoothed = f" behind a first-order low-pass of {1e3 * self.velocity_lag:.6g} ms" if self.velocity_lag else ""
        velocity = (
            f"an observer of {self.observer_frequency:g} Hz"
            if self.velocity_from == "observer"
            else f"differences{smoothed}"
        )
        low, high = USUAL_KV
        unusual = f" (drives have {low:g} to {high:g} 1/s: look up its unit)" if is_unusual_gain(self.kv) else ""
        per_mm = f" = {0.06 * self.kv:.4g} (m/min)/mm" if self.base_unit == "m" else ""
        rows = [
            f"position loop kv = {self.kv:.6g} 1/s{per_mm}{unusual}, every {period * self.position_every:g} ms",
            f"velocity loop kp = {self.kp:.6g} {self.kp_unit}, {reset}, velocity from {velocity}, every {period:g} ms",
        ]
        if self.encoder == "both":
            rows.append(f"velocity of the motor [{self.position_unit}], position of the load [{self.load_unit}]")
        rows += [f"filters: {', '.join(map(str, self.filters))}"] if self.filters else []
        constant = ratio_unit(self.force_unit, "A")
        known = "" if np.isnan(self.torque_constant) else f"force constant {self.torque_constant:g} {constant}; "
        guessed = f" ({' and '.join(self.assumed)} assumed, not given)" if self.assumed else ""
        rows.append(f"{known}current loop: lag {1e3 * self.lag:g} ms, delay {1e3 * self.delay:g} ms{guessed}")
        return "\n".join(rows)


def is_unusual_gain(kv: float) -> bool:
    """Return whether hardly any drive has a position gain kv [1/s]; none at all is not unusual.

    >>> is_unusual_gain(3.6), is_unusual_gain(60.0), is_unusual_gain(0.0)
    (True, False, False)
    """
    return bool(kv) and not USUAL_KV[0] <= kv <= USUAL_KV[1]


def require_number(name: str, number: object) -> float:
    """Return the number, which may be nan, or a refusal."""
    return np.nan if isinstance(number, float) and np.isnan(number) else require_real(name, number)
