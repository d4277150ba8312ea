"""JSON from a file, strictly: finite numbers, no key twice, and held against a JSON schema.

The schema is the file that is published, so that what a reader accepts is what the schema says, to the last rule. Of
JSON Schema (draft 2020-12) as much is understood as our schemas use, and nothing else is skipped in silence.
"""

from __future__ import annotations

import json
import math
import os
from functools import lru_cache
from importlib.resources import files
from typing import Any, NoReturn

from nlfrf.shared.whole_files import path_of
from nlfrf.shared.wording import one_line, shown

__all__ = ["parse_json", "require_schema", "schema_fault"]


KINDS: dict[str, Any] = {"object": dict, "array": list, "string": str, "number": int | float, "boolean": bool}
NAMES = {"object": "an object", "array": "a list", "string": "a text", "number": "a number", "boolean": "true or false"}
BOUNDS = {
    "minimum": ("at least", lambda number, bound: number >= bound),
    "exclusiveMinimum": ("above", lambda number, bound: number > bound),
    "maximum": ("at most", lambda number, bound: number <= bound),
    "exclusiveMaximum": ("below", lambda number, bound: number < bound),
}
SILENT = {"$schema", "$defs", "title", "description"}


def parse_json(path: str | os.PathLike[str]) -> Any:
    """Return what a JSON file holds.

    Raises
    ------
    ValueError
        A file that is no JSON, a key that stands twice in one object, a number that is not finite or does not fit into
        a float, brackets nested too deeply.
    FileNotFoundError
        No such file.
    """
    text = path_of(path).read_text(encoding="utf-8", errors="replace")
    try:
        return json.loads(
            text, parse_constant=refused, parse_float=finite, parse_int=whole, object_pairs_hook=keys_once
        )
    except RecursionError:
        reason = "it is nested too deeply"
    except ValueError as error:  # of json.JSONDecodeError too
        reason = str(error)
    raise ValueError(f"path must be a whole JSON file, got {path}: {reason[:160]}") from None


def refused(text: str) -> NoReturn:
    """Refuse NaN and infinities, which are no JSON."""
    raise ValueError(f"a number must be finite, got {text}")


def finite(text: str) -> float:
    """Return a number with a point or an exponent."""
    number = float(text)
    return number if math.isfinite(number) else refused(text[:40])


def whole(text: str) -> int:
    """Return a whole number that a float can hold."""
    finite(text)
    return int(text)


def keys_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object; two values by one key would be read one way here and another way there."""
    found = dict(pairs)
    if len(found) < len(pairs):
        keys = [key for key, _ in pairs]
        raise ValueError(f"a key must stand once, got {shown(next(key for key in keys if keys.count(key) > 1))} twice")
    return found


def require_schema(content: Any, path: str | os.PathLike[str], package: str, name: str) -> None:
    """Refuse what a file holds where it is not what the schema of that name says, which lies in the package.

    Raises
    ------
    ValueError
        The first place that is not as it must be.
    """
    try:
        fault = schema_fault(content, published(package, name))
    except RecursionError:
        fault = "it is nested too deeply"
    if fault:
        raise ValueError(f"path must hold a whole {name} file, got {path}: {fault}")


@lru_cache
def published(package: str, name: str) -> Any:
    """Return a schema as it is published."""
    return json.loads(files(package).joinpath(f"{name}.schema.json").read_text(encoding="utf-8"))


def schema_fault(content: Any, schema: Any, root: Any = None, place: str = "it") -> str:
    """Return in one line the first place in which parsed JSON is not what a schema says; "" where it is.

    >>> schema_fault({"dt": -1}, {"type": "object", "properties": {"dt": {"type": "number", "minimum": 0}}})
    'dt must be at least 0, got -1'
    """
    root = schema if root is None else root
    for rule, wanted in schema.items():
        if fault := RULES[rule](content, wanted, schema, root, place) if rule not in SILENT else "":
            return fault
    return ""


def refer(content: Any, wanted: Any, _: Any, root: Any, place: str) -> str:
    """Hold content against another part of the schema, "#" or "#/$defs/name"."""
    part = root if wanted == "#" else root["$defs"][wanted.removeprefix("#/$defs/")]
    return schema_fault(content, part, root, place)


def of_type(content: Any, wanted: Any, _: Any, __: Any, place: str) -> str:
    """Hold content against a type; true is no number."""
    fits = content is None if wanted == "null" else isinstance(content, KINDS[wanted])
    fits &= wanted == "boolean" or not isinstance(content, bool)
    return "" if fits else f"{place} must be {NAMES.get(wanted, wanted)}, got {shown(content)}"


def of_enum(content: Any, wanted: Any, _: Any, __: Any, place: str) -> str:
    """Hold content against the values that there are."""
    if any(same(content, one) for one in wanted):
        return ""
    return f"{place} must be {' or '.join(json.dumps(one) for one in wanted)}, got {shown(content)}"


def one_of_these(content: Any, wanted: Any, _: Any, root: Any, place: str) -> str:
    """Hold content against schemas of which exactly one must fit."""
    faults = [schema_fault(content, one, root, place) for one in wanted]
    if faults.count("") == 1:
        return ""
    if faults.count("") > 1:
        return f"{place} must be one thing, got {shown(content)}, which may be read in two ways"
    meant = [fault for one, fault in zip(wanted, faults, strict=True) if is_meant(content, one, root)]
    return meant[0] if meant else f"{place} must be as its schema says, got {shown(content)}: {faults[0]}"


def is_meant(content: Any, schema: Any, root: Any) -> bool:
    """Return whether content is of the type, and has the constants, by which a choice tells its schemas apart."""
    if "$ref" in schema:
        return is_meant(content, root["$defs"][schema["$ref"].removeprefix("#/$defs/")], root)
    constants = {name: part for name, part in schema.get("properties", {}).items() if "const" in part}
    kind = {rule: schema[rule] for rule in ("type", "const", "enum") if rule in schema}
    fits = not schema_fault(content, kind)
    return fits and all(name in content and not schema_fault(content[name], one) for name, one in constants.items())


def of_bound(rule: str) -> Any:
    """Return how to hold a number against a bound."""
    words, fits = BOUNDS[rule]

    def hold(content: Any, wanted: Any, _: Any, __: Any, place: str) -> str:
        if isinstance(content, bool) or not isinstance(content, int | float) or fits(content, wanted):
            return ""
        return f"{place} must be {words} {wanted}, got {shown(content)}"

    return hold


def of_length(rule: str) -> Any:
    """Return how to hold a list against the least or the largest number of its items."""

    def hold(content: Any, wanted: Any, _: Any, __: Any, place: str) -> str:
        if not isinstance(content, list) or (len(content) >= wanted if rule == "minItems" else len(content) <= wanted):
            return ""
        return f"{place} must have {'at least' if rule == 'minItems' else 'at most'} {wanted} items, got {len(content)}"

    return hold


def of_items(content: Any, wanted: Any, _: Any, root: Any, place: str) -> str:
    """Hold every item of a list against a schema."""
    for i, item in enumerate(content if isinstance(content, list) else ()):
        if fault := schema_fault(item, wanted, root, f"{place}[{i}]"):
            return fault
    return ""


def of_properties(content: Any, wanted: Any, _: Any, root: Any, place: str) -> str:
    """Hold the values of an object against their schemas."""
    for name, schema in wanted.items() if isinstance(content, dict) else ():
        if name in content and (fault := schema_fault(content[name], schema, root, within(place, name))):
            return fault
    return ""


def with_required(content: Any, wanted: Any, _: Any, __: Any, place: str) -> str:
    """Hold an object against the keys that it must have."""
    missing = [name for name in wanted if isinstance(content, dict) and name not in content]
    return f"{within(place, missing[0])} must be there, got none" if missing else ""


def without_others(content: Any, wanted: Any, schema: Any, _: Any, place: str) -> str:
    """Hold an object against the keys that it may have, where it may have no others."""
    known = schema.get("properties", {})
    others = [name for name in content if name not in known] if isinstance(content, dict) and not wanted else []
    return f"{place} must have no entry {shown(one_line(others[0]))}, got one" if others else ""


def within(place: str, name: str) -> str:
    """Return the place of a key."""
    return name if place == "it" else f"{place}.{name}"


def same(one: Any, other: Any) -> bool:
    """Return whether two values of JSON are the same: 1 is 1.0, and true is no number."""
    if isinstance(one, bool) or isinstance(other, bool):
        return one is other
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(same(one[key], other[key]) for key in one)
    return bool(one == other)


RULES: dict[str, Any] = {
    "$ref": refer,
    "type": of_type,
    "const": lambda content, wanted, *rest: of_enum(content, [wanted], *rest),
    "enum": of_enum,
    "oneOf": one_of_these,
    "items": of_items,
    "properties": of_properties,
    "required": with_required,
    "additionalProperties": without_others,
    **{rule: of_bound(rule) for rule in BOUNDS},
    **{rule: of_length(rule) for rule in ("minItems", "maxItems")},
}
