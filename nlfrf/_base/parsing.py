"""JSON and TOML from a file, strictly: finite numbers, unique keys, and checked against a JSON
schema.

The schema is the published file, so that a reader accepts exactly what the schema allows.
"""

from __future__ import annotations

import json
import math
import os
import tomllib
from functools import lru_cache
from importlib.resources import files
from itertools import islice
from typing import TYPE_CHECKING, NoReturn

from nlfrf._base.arguments import one_line, short_form
from nlfrf._base.files import FILE_KINDS, KIND_READERS, describe_wrong_file, stated_kind, to_path
from nlfrf._base.types import Json, JsonObject

if TYPE_CHECKING:
    from jsonschema.protocols import Validator


def parse_json(path: str | os.PathLike[str]) -> Json:
    """Return the content of a JSON file.

    Raises
    ------
    ValueError
        The file is no JSON, a key occurs twice in one object, a number is not finite or does not
        fit into a float, or brackets are nested too deeply.
    FileNotFoundError
        No such file.
    """
    text = to_path(path).read_text(encoding="utf-8", errors="replace")
    try:
        return json.loads(
            text,
            parse_constant=_refuse_constant,
            parse_float=_parse_finite,
            parse_int=_parse_whole,
            object_pairs_hook=_object_with_unique_keys,
        )
    except RecursionError:
        reason = "it is nested too deeply"
    except ValueError as error:  # also json.JSONDecodeError
        reason = str(error)
    raise ValueError(f"path must be a whole JSON file, got {path}: {reason[:160]}") from None


def _refuse_constant(text: str) -> NoReturn:
    """Refuse NaN and infinities, which are no JSON."""
    raise ValueError(f"a number must be finite, got {text}")


def _parse_finite(text: str) -> float:
    """Return a number with a point or an exponent."""
    number = float(text)
    if math.isfinite(number):
        return number
    return _refuse_constant(text[:40])


def _parse_whole(text: str) -> int:
    """Return a whole number that a float can hold."""
    _parse_finite(text)
    return int(text)


def _object_with_unique_keys(pairs: list[tuple[str, Json]]) -> JsonObject:
    """Return an object; refuse a repeated key, which programs read in different ways."""
    found = dict(pairs)
    if len(found) < len(pairs):
        keys = [key for key, _ in pairs]
        raise ValueError(
            "a key must occur once, got"
            f" {short_form(next(key for key in keys if keys.count(key) > 1))} twice"
        )
    return found


def parse_json_of(path: str | os.PathLike[str], *schemas: str) -> JsonObject:
    """Return the content of a JSON file with one of these schemas; refuse any other file by its
    kind.

    Raises
    ------
    ValueError
        A file of another kind, or as in `parse_json`.
    FileNotFoundError
        No such file.
    """
    path = to_path(path)
    suffix = path.suffix.lower()
    if suffix != ".json" and suffix in KIND_READERS and path.is_file():
        raise ValueError(describe_wrong_file(path, stated_kind(path, suffix), *schemas))
    content = parse_json(path)
    if isinstance(content, dict):
        found = content.get("schema")
    else:
        found = type(content).__name__
    if (
        isinstance(content, dict) and found in schemas
    ):  # a tuple, because `found` may not be hashable
        return content
    if isinstance(found, str) and found in FILE_KINDS:
        raise ValueError(describe_wrong_file(path, found, *schemas))
    raise ValueError(
        f"path must hold {' or '.join(schemas)}, got {path} with schema {short_form(found)}"
    )


def require_schema(content: Json, path: str | os.PathLike[str], *, package: str, name: str) -> None:
    """Refuse the content of a file that violates the named schema of a package.

    Raises
    ------
    ValueError
        The first place that violates the schema.
    """
    try:
        fault = _schema_fault(content, _schema_validator(package, name))
    except RecursionError:
        fault = "it is nested too deeply"
    if fault:
        raise ValueError(f"path must hold a whole {name} file, got {path}: {fault}")


@lru_cache
def _schema_validator(package: str, name: str) -> Validator:
    from jsonschema import Draft202012Validator

    schema = json.loads(files(package).joinpath(f"{name}.schema.json").read_text(encoding="utf-8"))
    return Draft202012Validator(schema)


def _schema_fault(content: Json, validator: Validator) -> str:
    """Describe in one line the first place in which parsed JSON violates a schema; "" if it does
    not.

    >>> from jsonschema import Draft202012Validator
    >>> _schema_fault({"dt": -1}, Draft202012Validator({"properties": {"dt": {"minimum": 0}}}))
    'dt must have minimum 0, got -1'
    """
    from jsonschema.exceptions import best_match

    error = best_match(islice(validator.iter_errors(content), 1))
    if error is None:
        return ""
    place = one_line(error.json_path.removeprefix("$").removeprefix("."))[:80] or "it"
    if error.validator in ("required", "additionalProperties"):
        return f"{place} must be as its schema says: {one_line(error.message)[:160]}"
    wanted = f"have {error.validator} {json.dumps(error.validator_value)[:160]}"
    if error.validator == "oneOf":
        wanted = "be as its schema says"
    elif error.validator == "enum":
        wanted = "be one of " + ", ".join(map(json.dumps, error.validator_value))
    return f"{place} must {wanted}, got {short_form(error.instance)}"


def parse_toml(path: str | os.PathLike[str], name: str, of: str = "") -> JsonObject:
    """Return what a TOML file holds; a refusal names the parameter, and what the file is of."""
    path = to_path(path)
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{name} must be a TOML file{of}, got {path.name!r}: {error}") from None
