"""The entries of a file that describe a drive, as arguments of `Drive`."""

from __future__ import annotations

from collections.abc import Mapping

from nlfrf._base.arguments import require_known, short_form
from nlfrf._base.types import JsonObject
from nlfrf._base.units import parse_gain_unit, parse_quantity, split_quantity

PORTS = ("force", "velocity", "position")  # set points of a drive to which a signal can be added
SAME_GAIN = 1e-3  # relative error up to which two gains are the same
#: Position gains [1/s] without a warning. Chosen: the four preset axes have 15 to 100 1/s, and a
#: misread unit gives an error by a factor of 16.7 or 60.
USUAL_KV = (5.0, 1000.0)
#: Entry -> kind of quantity.
_NUMBERS = {
    **dict.fromkeys(("fs", "observer_frequency"), "frequency"),
    **dict.fromkeys(("tn", "lag", "delay", "velocity_lag"), "time"),
    "kv": "rate",
    "limit": "output",
    "torque_constant": "torque constant",
    "velocity_feedforward": "share",
}
#: Entries that are texts or whole numbers, as in `Drive`.
_PLAIN = ("position_every", "encoder", "position_unit", "load_unit", "unit_factor", "load_factor")
#: Optional entries of a file whose numbers need no unit.
_WITHOUT_UNIT = ("delay_periods", "filters")


def read_drive_entries(
    where: str, content: Mapping[str, object], *, position: str = ""
) -> JsonObject:
    """Return the arguments of a `Drive`.

    position : "m" or "rad": a number without a unit is then in m, rad, N, Nm, A and s. If it is not
    given, every number
        must have its unit, and a missing `lag` or `delay` is taken as zero and as one period: both
        are listed as assumed.

    Raises
    ------
    ValueError
        An unknown or missing entry, a number without a unit or with a wrong one.
    """
    plain = _PLAIN + _WITHOUT_UNIT * bool(position)
    require_known(where, content, [*_NUMBERS, *plain, "kp"])
    if missing := [name for name in ("fs", "kv", "kp") if name not in content]:
        raise ValueError(f"{where} must have an entry {missing[0]}, got none")
    found: JsonObject = {name: content[name] for name in plain if name in content}
    for name, kind in _NUMBERS.items():
        if name in content:
            as_it_is = position and not isinstance(content[name], str)
            found[name] = content[name] if as_it_is else parse_quantity(name, kind, content[name])
    found["kp"], found["kp_unit"] = _read_gain(content["kp"], position)
    if not position:
        found["assumed"] = tuple(name for name in ("lag", "delay") if name not in found)
    if "delay" in found:
        found["delay_periods"] = found.pop("delay") * found["fs"]
    return found


def _read_gain(written: object, position: str) -> tuple[object, str]:
    """Return kp and its unit; for an axis in m or rad it must be a gain over a velocity in m/s or
    rad/s.
    """
    if position and not isinstance(written, str):
        return written, f"A/({position}/s)"
    try:
        number, unit = split_quantity(written)
        if position and parse_gain_unit(unit)[1] != position:
            raise ValueError(unit)
    except ValueError:
        raise ValueError(
            f'kp must be a number with its unit, such as "143 A/({position or "m"}/s)", got'
            f" {short_form(written)}"
        ) from None
    return number, unit


def is_unusual_gain(kv: float) -> bool:
    """Return whether a position gain kv [1/s] is unusual for drives; zero is not.

    >>> is_unusual_gain(3.6), is_unusual_gain(60.0), is_unusual_gain(0.0)
    (True, False, False)
    """
    return bool(kv) and not USUAL_KV[0] <= kv <= USUAL_KV[1]
