"""Units of a drive and its axis: positions and velocities in m or rad, currents in A, forces in N
or Nm, times in s.
"""

from __future__ import annotations

import re

import numpy as np

from nlfrf._base.arguments import is_real, short_form

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
#: Characters of units that stand for others.
_PLAIN_LETTERS = {ord("²"): "^2", ord("µ"): "u", ord("μ"): "u"}
#: Kind of quantity -> its units and their factors; the first is that of the result.
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

#: Symbol of a unit -> its base unit and the factor to it; a symbol that is not listed is a base
#: unit of its own.
_SYMBOLS = (
    POSITIONS
    | {unit: pair for unit, pair in OUTPUTS.items() if unit != "Nm"}
    | {unit: ("s", factor) for unit, factor in _QUANTITIES["time"].items()}
    | {"min": ("s", 60.0), "kg": ("kg", 1.0), "g": ("kg", 1e-3), "V": ("V", 1.0), "mV": ("V", 1e-3)}
)
#: Symbols without a sign between them, as in Nm, Ns or kgm, behind the first of them.
_JOINED_SYMBOLS = re.compile(rf"({'|'.join(sorted(_SYMBOLS, key=len, reverse=True))})(mm|m|)(s|)")


def parse_gain_unit(unit: str) -> tuple[str, str, float]:
    """Return (unit of the output, base unit of the position, factor to base units) for the gain of
    a velocity loop.

    >>> parse_gain_unit("Nm/(rad/s)"), parse_gain_unit("Nms/rad"), parse_gain_unit("A s/m")
    (('Nm', 'rad', 1.0), ('Nm', 'rad', 1.0), ('A', 'm', 1.0))
    >>> output, base, factor = parse_gain_unit("A/rpm")
    >>> output, base, round(factor, 4)                     # 1 A/rpm in A/(rad/s)
    ('A', 'rad', 9.5493)
    """
    found = re.fullmatch(
        r"\s*(\w+?)\s*(?:/\s*\(?\s*([^()\s]+)\s*\)?|[*·⋅]?\s*s\s*/\s*(\w+))\s*",
        unit if isinstance(unit, str) else "",
    )
    if found:
        output, velocity = found[1], found[2] or f"{found[3]}/s"
    else:
        output, velocity = "", ""
    if output not in OUTPUTS or velocity not in _VELOCITIES:
        raise ValueError(
            'kp_unit must be current or force over velocity, such as "A/(m/s)", "Ns/m", "Nms/rad"'
            f' or "A/rpm", got {short_form(unit)}'
        )
    (name, size), (base, per) = OUTPUTS[output], _VELOCITIES[velocity]
    return name, base, size / per


def position_factor(name: str, unit: str, base: str) -> float:
    """Return the number of base units in a position unit; refuse a unit without a known factor."""
    kind, factor = POSITIONS.get(unit, ("", np.nan))
    if kind != base:
        raise ValueError(
            f"{name} must be given, got none: the position is measured in {unit}, and the"
            f" velocity loop uses {base}/s. Give the number of {base} in one {unit}"
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
    if "" in units and is_real(written):
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
        r"\s*([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?)\s*(.*?)\s*",
        written if isinstance(written, str) else "",
    )
    if found is None:
        raise ValueError(f"written must be a number with its unit, got {short_form(written)}")
    number, unit = found[1], found[2]
    if number.count(".") > 1 or re.match(
        r"[,.']|(?!1\s*/)\d", unit
    ):  # "0,9" is no 0 in units of ",9"
        raise ValueError(
            f"written must be a number with a decimal point and its unit, got {short_form(written)}"
        )
    return float(number), unit


def _join_unit(unit: str) -> str:
    """Return a unit without separators between its parts: "kg m²" and "kg*m^2" become equal."""
    return re.sub(r"[\s*·⋅]", "", unit).translate(_PLAIN_LETTERS)


def split_unit(unit: str) -> tuple[float, dict[str, int]]:
    """Return the factor of a unit to base units, and the power of each of these.

    A slash divides by the symbol or the bracket behind it alone: N/m s is N s/m.

    >>> split_unit("N/(mm s)")
    (1000.0, {'N': 1, 'm': -1, 's': -1})
    >>> split_unit("Ns/m") == split_unit("N/m s"), split_unit("1/(m/N)") == split_unit("N/m")
    (True, True)
    """
    factor, powers, outside, sign = 1.0, dict[str, int](), [1], 1
    for token in re.findall(r"[()/]|[^()/\s*·⋅]+", unit.translate(_PLAIN_LETTERS)):
        if token == ")":
            outside = outside[:-1] or [1]
        elif token == "/":
            sign = -sign
        else:
            power, sign = sign * outside[-1], 1
            if token == "(":
                outside.append(power)
            else:
                name, _, exponent = token.partition("^")
                if name in _SYMBOLS:
                    joined = None
                else:
                    joined = _JOINED_SYMBOLS.fullmatch(name)
                *symbols, last = [one for one in joined.groups() if one] if joined else [name]
                if re.fullmatch("-?[0-9]{1,2}", exponent):
                    raised = int(exponent)
                else:
                    raised = 1
                for symbol, times in [*((one, power) for one in symbols), (last, power * raised)]:
                    base, size = _SYMBOLS.get(symbol, (symbol, 1.0))
                    factor *= size**times
                    powers[base] = powers.get(base, 0) + times
    return factor, {base: power for base, power in powers.items() if power and base != "1"}


def unit_factor(unit: str, base: str) -> float:
    """Return how many of another unit one unit is; nan where they are of different kinds.

    >>> unit_factor("N/mm", "N/m"), unit_factor("N/m", "N")
    (1000.0, nan)
    """
    (one, powers), (other, wanted) = split_unit(unit), split_unit(base)
    if powers == wanted:
        return one / other
    return np.nan


def units_differ(one: str, other: str) -> bool:
    """Return whether two units are known and differ; for a ratio both parts must be known.

    >>> units_differ("mm/A", "m/N"), units_differ("µm", "um"), units_differ("m/N", ""), units_differ("m/1", "mm/N")
    (True, False, False, False)
    """
    known = all(unit and "1" not in unit.split("/") for unit in (one, other))
    return known and not np.isclose(unit_factor(one, other), 1.0)
