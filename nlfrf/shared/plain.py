"""Any value of this project as JSON has it: fields, and properties that are a word or a number."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from nlfrf.shared.values import field_names

__all__ = ["as_json", "plain", "said_properties"]


WORDS = {"str", "bool", "int", "float", str, bool, int, float}


def as_json(thing: Any, most: float = np.inf) -> str:
    """A value, or a list of them, as JSON: complex numbers as [re, im], what is not finite as null.

    Arrays of more than `most` numbers are left out, and their shape told.

    >>> as_json({"gamma": 1.5, "poles": np.array([-1 + 2j]), "delay": float("nan")})
    '{"gamma": 1.5, "poles": [[-1.0, 2.0]], "delay": null}'
    """
    return json.dumps(plain(thing, most), ensure_ascii=False)


def plain(thing: Any, most: float = np.inf) -> Any:
    """The same as dictionaries, lists, texts and numbers; systems as their matrices, all else in its own words."""
    if thing is None or isinstance(thing, str | bool | int):
        return thing
    if isinstance(thing, Enum):
        return plain(thing.value, most)
    if isinstance(thing, np.generic):
        return plain(thing.item(), most)
    if isinstance(thing, float):
        return thing if np.isfinite(thing) else None
    if isinstance(thing, complex):
        return [plain(thing.real), plain(thing.imag)]
    if isinstance(thing, np.ndarray) and thing.size > most:
        return {"shape": list(thing.shape)}
    if isinstance(thing, np.ndarray):
        return [plain(one, most) for one in thing] if thing.ndim else plain(thing.item(), most)
    if isinstance(thing, Mapping):
        return {str(key): plain(held, most) for key, held in thing.items()}
    if hasattr(thing, "_fields"):
        return {name: plain(getattr(thing, name), most) for name in thing._fields}
    if isinstance(thing, list | tuple):
        return [plain(one, most) for one in thing]
    if is_dataclass(thing):
        fields = {name: plain(getattr(thing, name), most) for name in field_names(thing)}
        return {**fields, **{name: plain(held, most) for name, held in said_properties(thing).items()}}
    if all(hasattr(thing, name) for name in "ABCD") and hasattr(thing, "dt"):
        return {name: plain(getattr(thing, name), most) for name in ("A", "B", "C", "D", "dt")}
    return str(thing) if isinstance(thing, Path) else " ".join(str(thing).split())


def said_properties(thing: Any) -> dict[str, Any]:
    """The properties of a value that are said to be a word, a truth or a number, by name."""
    found = {}
    for kind in reversed(type(thing).__mro__):
        for name, held in vars(kind).items():
            getter = held.fget if isinstance(held, property) and not name.startswith("_") else None
            if getter is not None and getter.__annotations__.get("return") in WORDS:
                found[name] = getattr(thing, name)
    return found
