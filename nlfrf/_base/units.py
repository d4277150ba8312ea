"""Units of a drive and its axis: positions and velocities in m or rad, currents in A, forces in N or Nm, times in s."""

from __future__ import annotations

import re

import numpy as np

from nlfrf._base.arguments import short_form

#: Unit of a position -> base unit and factor to it.
POSITIONS = {
    "m": ("m", 1.0),
    "mm": ("m", 1e-3),
    "um": ("m", 1e-6),
    "µm": ("m", 1e-6),
    "nm": ("m", 1e-9),
    "rad": ("rad", 1.0),
    "mrad": ("rad", 1e-3),
    **dict.fromkeys(("deg", "°"), ("rad", np.pi / 180)),
    "rev": ("rad", 2 * np.pi),
}
#: Unit of a velocity -> base unit of its position and factor to base units per second.
_VELOCITIES = {f"{unit}/s": pair for unit, pair in POSITIONS.items()} | {
    **dict.fromkeys(("rpm", "1/min"), ("rad", 2 * np.pi / 60)),
    "mm/min": ("m", 1e-3 / 60),
}
#: Unit of the output of a velocity loop -> base unit and factor to A, N or Nm.
OUTPUTS = {"A": ("A", 1.0), "mA": ("A", 1e-3), "N": ("N", 1.0), "kN": ("N", 1e3), "Nm": ("Nm", 1.0)}
#: Kind of quantity -> its units and their factors; the first one is that of the result.
_QUANTITIES = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6},
    "frequency": {"Hz": 1.0, "kHz": 1e3},
    "rate": {"1/s": 1.0, "1/min": 1 / 60, "(m/min)/mm": 1e3 / 60, "m/min/mm": 1e3 / 60},
    "current": {"A": 1.0, "mA": 1e-3},
    "output": {"A": 1.0, "mA": 1e-3, "N": 1.0, "kN": 1e3, "Nm": 1.0},
    "torque constant": {"N/A": 1.0, "Nm/A": 1.0},
    # for an axis, linear and rotary
    "mass": {"kg": 1.0, "g": 1e-3},
    "inertia": {"kg m^2": 1.0, "kg cm^2": 1e-4},
    "linear force constant": {"N/A": 1.0},
    "rotary force constant": {"Nm/A": 1.0},
    "linear damping": {"Ns/m": 1.0, "N/(m/s)": 1.0},
    "rotary damping": {"Nms/rad": 1.0, "Nm/(rad/s)": 1.0},
    "linear stiffness": {"N/m": 1.0, "N/mm": 1e3, "N/um": 1e6, "N/µm": 1e6},
    "rotary stiffness": {"Nm/rad": 1.0},
    "length": {unit: factor for unit, (base, factor) in POSITIONS.items() if base == "m"},
    "angle": {unit: factor for unit, (base, factor) in POSITIONS.items() if base == "rad"},
    "share": {"": 1.0, "%": 0.01},
}


def parse_gain_unit(unit: str) -> tuple[str, str, float]:
    """Return (unit of the output, base unit of the position, factor to base units) for the gain of a velocity loop.

    >>> parse_gain_unit("Nm/(rad/s)"), parse_gain_unit("Nms/rad"), parse_gain_unit("A s/m")
    (('Nm', 'rad', 1.0), ('Nm', 'rad', 1.0), ('A', 'm', 1.0))
    >>> output, base, factor = parse_gain_unit("A/rpm")
    >>> output, base, round(factor, 4)                     # 1 A/rpm in A/(rad/s)
    ('A', 'rad', 9.5493)
    """
    found = re.fullmatch(
        r"\s*(\w+?)\s*(?:/\s*\(?\s*([^()\s]+)\s*\)?|[*·⋅]?\s*s\s*/\s*(\w+))\s*", unit if isinstance(unit, str) else ""
    )
    output, velocity = (found[1], found[2] or f"{found[3]}/s") if found else ("", "")
    if output not in OUTPUTS or velocity not in _VELOCITIES:
        raise ValueError(
            'kp_unit must be current or force over velocity, such as "A/(m/s)", "Ns/m", "Nms/rad" or "A/rpm", '
            f"got {short_form(unit)}"
        )
    (name, size), (base, per) = OUTPUTS[output], _VELOCITIES[velocity]
    return name, base, size / per


def position_factor(name: str, unit: str, base: str) -> float:
    """Return the number of base units in a position unit; refuse a unit without a known factor."""
    kind, factor = POSITIONS.get(unit, ("", np.nan))
    if kind != base:
        raise ValueError(
            f"{name} must be given if the position is measured in {unit} and the velocity loop counts in {base}/s: "
            f"the number of {base} in one {unit}, got none"
        )
    return factor


def parse_quantity(name: str, kind: str, written: object) -> float:
    """Return a number written with its unit, in the first unit of its kind.

    >>> parse_quantity("tn", "time", "10 ms"), parse_quantity("depth", "share", 0.1)
    (0.01, 0.1)
    >>> parse_quantity("motor_inertia", "inertia", "2 kgm²")  # spaces, dots and stars between units are ignored
    2.0
    """
    units = _QUANTITIES[kind]
    listed = " or ".join(f'"1 {unit}"' for unit in units if unit)
    if "" in units and isinstance(written, int | float) and not isinstance(written, bool):
        return float(written)
    try:
        number, unit = split_quantity(written)
        return number * {_join_unit(one): factor for one, factor in units.items()}[_join_unit(unit)]
    except (KeyError, ValueError):
        raise ValueError(
            f"{name} must be a number with its unit, such as {listed}, got {short_form(written)}"
        ) from None


def split_quantity(written: object) -> tuple[float, str]:
    """Return number and unit of a text; refuse a text without a number in front.

    >>> split_quantity("143 A/(m/s)"), split_quantity("3.6m/min/mm")
    ((143.0, 'A/(m/s)'), (3.6, 'm/min/mm'))
    """
    found = re.fullmatch(
        r"\s*([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?)\s*(.*?)\s*", written if isinstance(written, str) else ""
    )
    if found is None:
        raise ValueError(f"written must be a number with its unit, got {short_form(written)}")
    return float(found[1]), found[2]


def _join_unit(unit: str) -> str:
    """Return a unit without separators between its parts: "kg m²" and "kg*m^2" become equal."""
    return re.sub(r"[\s*·⋅]", "", unit).translate({ord("²"): "^2", ord("µ"): "u", ord("μ"): "u"})


def units_differ(one: str, other: str) -> bool:
    """Return whether two units are known and differ; for a ratio both parts must be known.

    >>> units_differ("mm/A", "m/N"), units_differ("µm", "um"), units_differ("m/N", ""), units_differ("m/1", "mm/N")
    (True, False, False, False)
    """
    known = all(unit and "1" not in unit.split("/") for unit in (one, other))
    return known and _join_unit(one) != _join_unit(other)
