"""A servo axis and its drive in a TOML file: numbers in m, rad, kg, N, Nm, A and s, or as text with
a unit.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import fields

from nlfrf._base.arguments import require_known, short_form
from nlfrf._base.drive_entries import read_drive_entries
from nlfrf._base.files import to_path
from nlfrf._base.parsing import parse_toml
from nlfrf._base.units import parse_quantity
from nlfrf.rig import Drive, ServoAxis

#: Entry -> kind of quantity for a linear and for a rotary axis.
_AXIS_KINDS = {
    **dict.fromkeys(("motor_inertia", "load_inertia"), ("mass", "inertia")),
    **dict.fromkeys(
        ("motor_damping", "load_damping", "damping"), ("linear damping", "rotary damping")
    ),
    **dict.fromkeys(("stiffness", "spring"), ("linear stiffness", "rotary stiffness")),
    "resolution": ("length", "angle"),
}
#: Fields of an axis that cannot be given in a file.
_LAWS = ("motor_friction", "load_friction")


def load_axis(path: str | os.PathLike[str]) -> ServoAxis:
    """Read an axis without friction: the fields of `ServoAxis`, and those of `Drive` in a section
    [drive].

    >>> import tempfile
    >>> text = 'motor_inertia = "7 kg"\\n[drive]\\nfs = 4000\\nkv = 30\\nkp = 33\\ntn = "30 ms"\\ntorque_constant = 125'
    >>> with tempfile.NamedTemporaryFile("w", suffix=".toml") as file:
    ...     _ = file.write(text), file.flush()
    ...     axis = load_axis(file.name)
    >>> axis.motor_inertia, axis.drive.tn
    (7.0, 0.03)
    """
    path = to_path(path)
    content = parse_toml(path, "axis")
    require_known(
        path.name, content, [one.name for one in fields(ServoAxis) if one.name not in _LAWS]
    )
    if missing := [name for name in ("motor_inertia", "drive") if name not in content]:
        raise ValueError(f"{path.name} must have an entry {missing[0]}, got none")
    drive = content.pop("drive")
    if not isinstance(drive, Mapping):
        raise ValueError(f"drive must be a section [drive] of {path.name}, got {short_form(drive)}")
    rotary = content.get("motion") == "rotary"
    settings = read_drive_entries(
        f"[drive] of {path.name}", drive, position="rad" if rotary else "m"
    )
    for name, kinds in _AXIS_KINDS.items():
        if isinstance(content.get(name), str):
            content[name] = parse_quantity(name, kinds[rotary], content[name])
    return ServoAxis(drive=Drive(**settings), **content)
