"""Units of a machine that moves in m, or turns in rad."""

from __future__ import annotations

import numpy as np

from nlfrf._base.values import value


@value
class MechanicalUnits:
    """Units of the mechanical quantities of one axis.

    Fields
    ------
    position, velocity, force, stiffness, damping, mass : str
        Names of the units. The unit of stiffness is in thousands.
    """

    position: str
    velocity: str
    force: str
    stiffness: str
    damping: str
    mass: str


_UNITS = {
    "m": MechanicalUnits(
        position="m", velocity="m/s", force="N", stiffness="kN/m", damping="Ns/m", mass="kg"
    ),
    "rad": MechanicalUnits(
        position="rad",
        velocity="rad/s",
        force="Nm",
        stiffness="kNm/rad",
        damping="Nm s/rad",
        mass="kg m^2",
    ),
}


def mechanical_units(position_unit: str) -> MechanicalUnits:
    """Return the units of an axis for its position unit, "m" or "rad".

    >>> mechanical_units("rad").stiffness
    'kNm/rad'
    """
    if position_unit not in _UNITS:
        raise ValueError(f'position_unit must be "m" or "rad", got {position_unit!r}')
    return _UNITS[position_unit]


def format_plain(number: float) -> str:
    """Return a number with four digits and without an exponent.

    >>> format_plain(25086.7), format_plain(2.0)
    ('25090', '2')
    """
    return str(np.format_float_positional(float(f"{number:.4g}"), trim="-"))


def format_length(length: float, unit: str) -> str:
    """Format a length or angle with its unit: below a thousandth in millionths, below a tenth in
    thousandths.

    >>> format_length(2.19e-05, "m"), format_length(0.5, "rad"), format_length(1e-5, "mm"), format_length(2.5e-3, "m")
    ('21.9 um', '0.5 rad', '1e-05 mm', '2.5 mm')
    """
    if unit not in _UNITS:
        return f"{length:.3g} {unit}"
    scale, prefix = 1.0, ""
    if abs(length) < 1e-3:
        scale, prefix = 1e6, "u"
    elif abs(length) < 0.1:
        scale, prefix = 1e3, "m"
    return f"{scale * length:.3g} {prefix}{unit}"


def position_unit_of(unit: str) -> str:
    """Return "rad" for a position in rad and for a ratio such as rad/Nm, else "m".

    >>> position_unit_of("rad/Nm"), position_unit_of("m"), position_unit_of("")
    ('rad', 'm', 'm')
    """
    if unit.split("/")[0] == "rad":
        return "rad"
    return "m"
