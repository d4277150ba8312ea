"""A servo axis and its drive in a TOML file: numbers in m, rad, kg, N, Nm, A and s, or as text with a unit."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Mapping
from dataclasses import MISSING, fields

from nlfrf._base.arguments import require_known, short_form
from nlfrf._base.files import to_path
from nlfrf._base.types import JsonObject
from nlfrf._base.units import parse_gain_unit, parse_quantity, split_quantity
from nlfrf.rig.bench.servo import ServoAxis, ServoDrive

#: Entry -> kind of quantity of a linear and of a rotary axis.
AXIS_KINDS = {
    **dict.fromkeys(("motor_inertia", "load_inertia"), ("mass", "inertia")),
    "force_constant": ("linear force constant", "rotary force constant"),
    **dict.fromkeys(("motor_damping", "load_damping", "damping"), ("linear damping", "rotary damping")),
    **dict.fromkeys(("stiffness", "spring"), ("linear stiffness", "rotary stiffness")),
    "resolution": ("length", "angle"),
}
#: Entry of [drive] -> kind of quantity.
DRIVE_KINDS = {
    "fs": "frequency",
    "kv": "rate",
    "max_current": "current",
    "velocity_feedforward": "share",
    **dict.fromkeys(("tn", "lag", "velocity_lag"), "time"),
}
#: Fields of an axis that no entry can hold.
LAWS = ("motor_friction", "load_friction")


def load_axis(path: str | os.PathLike[str]) -> ServoAxis:
    """Read an axis without friction: the fields of `ServoAxis`, and those of `ServoDrive` in a section [drive].

    Raises
    ------
    ValueError
        A file that is no TOML; an entry that is not known or missing; a unit that does not fit.
    FileNotFoundError
        No such file.

    Examples
    --------
    >>> import tempfile
    >>> text = 'motor_inertia = "7 kg"\\nforce_constant = 125\\n[drive]\\nfs = 4000\\nkv = 30\\nkp = 33\\ntn = "30 ms"'
    >>> with tempfile.NamedTemporaryFile("w", suffix=".toml") as file:
    ...     _ = file.write(text), file.flush()
    ...     axis = load_axis(file.name)
    >>> axis.motor_inertia, axis.drive.tn
    (7.0, 0.03)
    """
    path = to_path(path)
    try:
        content: JsonObject = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"axis must be a TOML file, got {path.name!r}: {error}") from None
    require_entries(path.name, content, ServoAxis, left_out=LAWS)
    drive = content.pop("drive")
    if not isinstance(drive, Mapping):
        raise ValueError(f"drive must be a section [drive] of {path.name}, got {short_form(drive)}")
    require_entries(f"[drive] of {path.name}", drive, ServoDrive)
    rotary = content.get("motion") == "rotary"
    kinds = {name: pair[rotary] for name, pair in AXIS_KINDS.items()}
    numbers = read_quantities(drive, DRIVE_KINDS)
    if isinstance(numbers["kp"], str):
        numbers["kp"] = read_gain(numbers["kp"], "rad" if rotary else "m")
    return ServoAxis(drive=ServoDrive(**numbers), **read_quantities(content, kinds))


def require_entries(
    where: str, given: Mapping[str, object], kind: type[ServoAxis | ServoDrive], left_out: tuple[str, ...] = ()
) -> None:
    """Refuse an entry that is no field of this kind, and a field without a default that is missing."""
    known = [field for field in fields(kind) if field.name not in left_out]
    require_known(where, given, [field.name for field in known])
    missing = [one.name for one in known if one.default is MISSING and one.name not in given]
    if missing:
        raise ValueError(f"{where} must have an entry {missing[0]}, got none")


def read_quantities(given: Mapping[str, object], kinds: Mapping[str, str]) -> JsonObject:
    """Return the entries, those that are text with a unit as numbers."""
    return {
        name: parse_quantity(name, kinds[name], one) if name in kinds and isinstance(one, str) else one
        for name, one in given.items()
    }


def read_gain(written: str, position: str) -> float:
    """Return kp [A s/m] or [A s/rad] of a text; refused where it is no current over a velocity of the axis."""
    try:
        number, unit = split_quantity(written)
        output, base, factor = parse_gain_unit(unit)
    except ValueError:
        output, base = "", ""
    if (output, base) != ("A", position):
        raise ValueError(
            f'kp must be a number with its unit, such as "143 A/({position}/s)", got {short_form(written)}'
        )
    return number * factor
