"""Universal files (.uff, .unv): time records and FRFs in datasets of type 58, by pyuff."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

if TYPE_CHECKING:
    from nlfrf._base.own_process import Contents

_TIME_RESPONSE = 1
_FREQUENCY_FUNCTIONS = {4: "", 6: ".coherence"}  # FRF and coherence, and the suffix of the name
Dataset: TypeAlias = dict[str, Any]  # a dataset of the file, by the field names of pyuff
_AXIS_NAMES = {1: "x", -1: "-x", 2: "y", -2: "-y", 3: "z", -3: "-z"}


def contents(path: Path) -> Contents:
    """Read time records by the names of their points, else by node and direction, each with its
    step or its times.

    This module is loaded by its path in its own process, so it imports nothing from this package.
    """
    import pyuff

    found = pyuff.UFF(str(path)).read_sets()
    sets = [one for one in (found if isinstance(found, list) else [found]) if one.get("type") == 58]
    records = [one for one in sets if one.get("func_type") == _TIME_RESPONSE]
    arrays, units = _frequency_functions(sets)
    if not records and not arrays:
        raise ValueError(
            f"it holds {len(sets)} functions, no time record and no FRF: export the time histories"
        )
    clocks: dict[str, float | str] = {}
    for one in records:
        data = np.asarray(one["data"])
        if data.dtype.kind not in "fiu":
            continue
        name = _unused_name(_record_name(one), arrays)
        arrays[name] = data
        step = float(one.get("abscissa_inc") or 0.0)
        counted, units[name] = _stated_unit(one, "abscissa"), _stated_unit(one, "ordinate")
        x = np.asarray(one.get("x", ()), dtype=float)
        if step > 0 and int(one.get("abscissa_spacing", 1)) == 1:
            clocks[name] = 1 / step
            arrays[f"{name}.start"], units[f"{name}.start"] = (
                np.array(float(one.get("abscissa_min") or 0.0)),
                counted or "s",
            )
        elif x.shape == data.shape:
            arrays[f"{name}.time"], units[f"{name}.time"], clocks[name] = (
                x,
                counted or "s",
                f"{name}.time",
            )
    return arrays, units, clocks, {}


def _frequency_functions(sets: list[Dataset]) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Return FRFs by degrees of freedom, "5 z / 1 x", each with its frequencies and coherence, and
    their units.
    """
    arrays: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    for one in sets:
        if (suffix := _FREQUENCY_FUNCTIONS.get(one.get("func_type", 0))) is not None:
            axes = (
                _AXIS_NAMES.get(int(one.get(f"{end}_dir", 0)), "").replace("-", "minus ")
                for end in ("rsp", "ref")
            )
            name = "{} {} / {} {}".format(
                one.get("rsp_node", 0), next(axes), one.get("ref_node", 0), next(axes)
            )
            arrays |= {
                name + suffix: np.asarray(one["data"]),
                f"{name}.frequency": np.asarray(one["x"], dtype=float),
            }
            units[f"{name}.frequency"] = _stated_unit(one, "abscissa") or "Hz"
            if not suffix:
                units[name] = "/".join(
                    filter(None, (_stated_unit(one, axis) for axis in ("ordinate", "orddenom")))
                )
    return arrays, units


def _stated_unit(one: Dataset, axis: str) -> str:
    """Return the unit of an axis, empty if the file states none."""
    unit = str(one.get(f"{axis}_axis_units_lab") or "").strip()
    if unit.upper() == "NONE":
        return ""
    return unit


def _record_name(one: Dataset) -> str:
    """Return the name of a record: its first line, the name of its point, or its node and
    direction.
    """
    point, text = (str(one.get(key) or "").strip() for key in ("rsp_ent_name", "id1"))
    for name in (text, point):
        if name and name.upper() != "NONE":
            return name
    return f"node{one.get('rsp_node', 0)}{_AXIS_NAMES.get(int(one.get('rsp_dir', 0)), '')}"


def _unused_name(name: str, names: Collection[str]) -> str:
    """Return the name, numbered if another record has it."""
    free = (name if i == 1 else f"{name}.{i}" for i in range(1, len(names) + 2))
    return next(one for one in free if one not in names)
