"""Claims as JSON files that others can check.

A file is JSON with every number as given, and a digest over all of it. A claim is a value with the
class attributes SCHEMA, UNITS and LOOP: the kind of its files, and the texts in them for people.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from types import UnionType
from typing import Annotated, ClassVar, Protocol, TypeVar, get_args, get_origin, get_type_hints

import numpy as np

from nlfrf._base.files import write_json
from nlfrf._base.parsing import parse_json, require_schema
from nlfrf._base.types import Json, JsonObject
from robust.proofs.exact.claim import LpvMatrices, Matrices

_VERSION = 1
# arrays of a claim with as many columns as rows, and with integers
SQUARE = "square"
WHOLE = "whole"


class _Claim(Protocol):
    """A value with its own kind of file."""

    SCHEMA: ClassVar[str]
    UNITS: ClassVar[Mapping[str, str]]
    LOOP: ClassVar[str]


T = TypeVar("T")
C = TypeVar("C", bound=_Claim)


def _to_plain(part: object) -> Json:
    """Return a part of a claim for JSON; floats are written so that they are restored exactly."""
    if is_dataclass(part):
        return {one.name: _to_plain(getattr(part, one.name)) for one in fields(part)}
    if isinstance(part, np.ndarray | np.generic):
        return part.tolist()
    if isinstance(part, dict):
        return {name: _to_plain(each) for name, each in part.items()}
    if isinstance(part, tuple):
        return [_to_plain(each) for each in part]
    return part


def _from_plain(kind: type[T], given: object) -> T:
    """Return the claim that `_to_plain` wrote, or raise a ValueError with its fault."""
    names = {one.name for one in fields(kind)}  # type: ignore[arg-type]
    if not isinstance(given, dict) or set(given) != names:
        raise ValueError(
            f"claim must have the entries {', '.join(sorted(names))}, got other entries"
        )
    try:
        hints = get_type_hints(kind, include_extras=True)
        return kind(**{name: _part_from_plain(hints[name], part) for name, part in given.items()})
    except (TypeError, KeyError, IndexError, AttributeError) as error:
        raise ValueError(
            f"claim must hold its entries in the form in which it was saved, got {error}"
        ) from None


def _part_from_plain(hint: object, given: Json) -> object:
    """Return a part of a claim with the type of its field."""
    kind = get_origin(hint) or hint
    if kind in _MAKERS:
        return _MAKERS[kind](get_args(hint), given)
    if not isinstance(hint, type):
        raise TypeError(f"no part is of type {hint}")
    made: object = _from_plain(hint, given) if is_dataclass(hint) else hint(given)
    return made


def _part_of_union(kinds: tuple[object, ...], given: Json) -> object:
    """Return None, or a part of the type in a union whose entries fit; if none fits, of the first
    type.
    """
    if given is None:
        return None
    fitting = [
        one
        for one in kinds
        if is_dataclass(one) and {each.name for each in fields(one)} == set(given)
    ]
    return _part_from_plain((*fitting, kinds[0])[0], given)


def _annotated_array(kinds: tuple[object, ...], given: Json) -> np.ndarray:
    """Return an array of integers, or a square one."""
    if kinds[1] == WHOLE:
        return np.array(given, dtype=int)
    return np.array(given, float).reshape(2 * (len(given),))


def _tuple_from_plain(kinds: tuple[object, ...], given: Json) -> tuple[object, ...]:
    """Return a tuple of parts, each with its own type, or all with the first."""
    if kinds[-1] is Ellipsis:
        kinds = kinds[:1] * len(given)
    return tuple(_part_from_plain(each, part) for each, part in zip(kinds, given, strict=True))


def _system_from_plain(kind: type[Matrices], given: JsonObject) -> Matrices:
    """Return a system, or polynomial matrices, from lists of numbers; empty lists have lost their
    shapes.
    """
    if set(given) != {*"ABCD", "dt"}:
        raise ValueError(f"a system must have A, B, C, D and dt, got {', '.join(sorted(given))}")
    try:
        D = np.array(given["D"], dtype=float, ndmin=kind.LEADING + 2)
        n, (*lead, p, m) = len(given["A"][0] if kind.LEADING else given["A"]), D.shape
        shapes = {"A": (n, n), "B": (n, m), "C": (p, n), "D": (p, m)}
        parts = {
            name: np.array(given[name], dtype=float).reshape(*lead, *shape)
            for name, shape in shapes.items()
        }
    except ValueError as error:
        raise ValueError(f"a system must have matrices that fit each other, got {error}") from None
    return kind(**parts, dt=float(given["dt"]))


#: Function that makes a part from plain data, by the type of its field. Any other type is made by
#: its constructor.
_MAKERS: Mapping[object, Callable[[tuple[object, ...], Json], object]] = {
    UnionType: _part_of_union,
    np.ndarray: lambda _, given: np.array(given, dtype=float),
    Annotated: _annotated_array,
    tuple: _tuple_from_plain,
    dict: lambda kinds, given: {
        str(name): _part_from_plain(kinds[1], part) for name, part in given.items()
    },
    Matrices: lambda _, given: _system_from_plain(Matrices, given),
    LpvMatrices: lambda _, given: _system_from_plain(LpvMatrices, given),
    bool: lambda _, given: given is True,
}


def differing_fields(claim: object, other: object, names: Sequence[str]) -> list[str]:
    """Return the named fields that differ in any number."""
    return [
        name for name in names if _to_plain(getattr(claim, name)) != _to_plain(getattr(other, name))
    ]


def _content_digest(given: JsonObject) -> str:
    """Return SHA-256 over the entries in sorted order; a float counts by the shortest digits that
    restore it.

    >>> _content_digest({"a": 1.0})[:8], _content_digest({"a": 1.0000000000000002})[:8]
    ('c29a44ab', 'a9c3d934')
    """
    text = json.dumps(
        given, sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False
    )
    return hashlib.sha256(text.encode()).hexdigest()


def write_claim(
    path: str | os.PathLike[str],
    claim: _Claim,
    *,
    found: Sequence[Mapping[str, object]] = (),
    read_from: JsonObject | None = None,
    units: Mapping[str, str] | None = None,
    warnings: Sequence[str] = (),
) -> None:
    """Write a claim, its search, its sources and its warnings; the digest covers all other entries.

    units : units that the claim itself does not have.
    """
    entries: JsonObject = {
        "schema": claim.SCHEMA,
        "version": _VERSION,
        "units": {**claim.UNITS, **(units or {})},
        "loop": claim.LOOP,
        "claim": _to_plain(claim),
        **({} if read_from is None else {"read from": read_from}),
        "found": list(found),
        **({"warnings": list(warnings)} if warnings else {}),
    }
    write_json(entries | {"digest": _content_digest(entries)}, path)


def read_claim(path: str | os.PathLike[str], kind: type[C]) -> C | None:
    """Return the claim of a file whose digest fits, None for a file of another kind; otherwise
    raise a ValueError.

    A digest guards against accidents and hurried edits, not against a forger who computes it again.
    What counts is that the claim is proved again, and that plant and controller are compared with
    your own.
    """
    entries = parse_json(path)
    if not isinstance(entries, dict) or entries.get("schema") != kind.SCHEMA:
        return None
    if entries.get("version") != _VERSION:
        raise ValueError(
            f"path must be a certificate of version {_VERSION}, got version"
            f" {entries.get('version')!r} in {str(path)!r}"
        )
    if entries.get("digest") != _content_digest(
        {name: entry for name, entry in entries.items() if name != "digest"}
    ):
        raise ValueError(
            f"path must be a certificate as it was written, got {str(path)!r} whose digest does not"
            " fit. Something in it was changed."
        )
    require_schema(entries, path, package="robust", name=kind.SCHEMA)
    return _from_plain(kind, entries["claim"])
