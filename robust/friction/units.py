"""Units of a machine that moves in m, or turns in rad."""

from __future__ import annotations

from nlfrf._base.values import value

__all__ = ["MechanicalUnits", "mechanical_units", "position_unit_of"]


@value
class MechanicalUnits:
    """Units of the mechanical quantities of one axis.

    Fields
    ------
    position, velocity, force, stiffness, damping, mass : str
        The stiffness in thousands.
    """

    position: str
    velocity: str
    force: str
    stiffness: str
    damping: str
    mass: str


UNITS = {
    "m": MechanicalUnits(position="m", velocity="m/s", force="N", stiffness="kN/m", damping="Ns/m", mass="kg"),
    "rad": MechanicalUnits(
        position="rad", velocity="rad/s", force="Nm", stiffness="kNm/rad", damping="Nm s/rad", mass="kg m^2"
    ),
}


def mechanical_units(position_unit: str) -> MechanicalUnits:
    """Return the units of an axis by that of its position, or refuse another unit.

    >>> mechanical_units("rad").stiffness
    'kNm/rad'
    """
    if position_unit not in UNITS:
        raise ValueError(f'position_unit must be "m" or "rad", got {position_unit!r}')
    return UNITS[position_unit]


def position_unit_of(unit: str) -> str:
    """Return "rad" for a position or a ratio such as rad/Nm in rad, "m" for every other unit and for none.

    >>> position_unit_of("rad/Nm"), position_unit_of("m"), position_unit_of("")
    ('rad', 'm', 'm')
    """
    return "rad" if unit.split("/")[0] == "rad" else "m"
