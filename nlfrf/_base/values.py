"""``@value``: the only way in which this project makes a value type.

A value is a frozen dataclass with keyword arguments. Its arrays are copied when it is made, and are
read-only afterwards, so a valid value stays valid. Its `repr` is one line, and its `str` has at
most 100 columns. It has no ``==``, because comparing arrays for equality is rarely meant.
Validation is in ``__post_init__``, which runs after the arrays are frozen.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from enum import Enum
from functools import singledispatch, wraps
from pathlib import Path
from textwrap import wrap
from types import NoneType
from typing import TYPE_CHECKING, Any, TypeVar, dataclass_transform, overload

import numpy as np

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    from nlfrf._base.types import Json

# ---- A value on one line for a prompt.

_WIDTH, _FEW = 160, 6  # characters of a line; numbers that are shown

#: Type of a field that takes any sequence and holds an array, or None if its kind of value has
#: none. A dataclass can declare only one of these types, and the reader of the field knows the
#: kind.
ArrayField = Any


def _repr_line(thing: DataclassInstance) -> str:
    """Return the text of a value at a prompt: its type and fields, arrays by their shape.

    >>> from nlfrf._base.values import value
    >>> @value
    ... class Tone:
    ...     amplitude: np.ndarray
    ...     fs: float
    >>> Tone(amplitude=np.ones((3, 100)), fs=10.0)
    Tone(amplitude=array(3, 100), fs=10.0)
    """
    described = ", ".join(
        f"{field.name}={_short_repr(getattr(thing, field.name, None))}" for field in fields(thing)
    )
    if not (len(described) <= _WIDTH):
        described = described[: _WIDTH - 3] + "..."
    return f"{type(thing).__name__}({described})"


@singledispatch
def _short_repr(thing: object) -> str:
    """Return a few characters for any object."""
    if is_dataclass(type(thing)):
        return f"{type(thing).__name__}(...)"
    if hasattr(thing, "nstates") and hasattr(thing, "dt"):
        return _short_system(thing)
    described = " ".join(repr(thing).split())
    if len(described) <= 60:
        return described
    return described[:57] + "..."


def _short_system(system: Any) -> str:
    if isinstance(system.dt, float) and system.dt:
        clock = f", dt={system.dt:g}"
    else:
        clock = ""
    return f"{type(system).__name__}({system.nstates} states{clock})"


@_short_repr.register(np.ndarray)
def _short_array(thing: np.ndarray) -> str:
    if thing.ndim <= 1 and thing.size <= _FEW and thing.dtype.kind in "fiub":
        return np.array2string(thing, separator=", ", precision=5, max_line_width=10**6)
    if thing.ndim != 1:
        return f"array{thing.shape}"
    return f"array({thing.size})"


@_short_repr.register(np.generic)
def _short_scalar(thing: np.generic) -> str:
    return _short_repr(thing.item())


@_short_repr.register(list)
def _short_list(thing: list[object]) -> str:
    if len(thing) > _FEW:
        return f"{len(thing)} of {_short_repr(thing[0])}"
    return f"[{', '.join(map(_short_repr, thing))}]"


@_short_repr.register(tuple)
def _short_tuple(thing: tuple[object, ...]) -> str:
    if len(thing) > _FEW:
        return f"{len(thing)} of {_short_repr(thing[0])}"
    return f"({', '.join(map(_short_repr, thing))}{',' * (len(thing) == 1)})"


@_short_repr.register(dict)
def _short_dict(thing: dict[object, object]) -> str:
    shown = [f"{key}: {_short_repr(held)}" for key, held in list(thing.items())[:_FEW]]
    return "{" + ", ".join(shown) + "}"


SCREEN_WIDTH = 100  # columns of everything that is printed


def wrap_lines(text: str) -> str:
    """Wrap the lines of a text that are wider than a screen; continuation lines are indented by two
    more.

    A command to be copied ("run: ...") stays on its line.

    >>> print(wrap_lines("  limits: " + "a word and " * 10))
      limits: a word and a word and a word and a word and a word and a word and a word and a word and
        a word and a word and
    """
    rows = []
    for line in text.split("\n"):
        indent = " " * (len(line) - len(line.lstrip()))
        fits = len(line) <= SCREEN_WIDTH or line.startswith("run:")
        how = {
            "subsequent_indent": f"{indent}  ",
            "break_long_words": False,
            "break_on_hyphens": False,
        }
        rows += [line] if fits else wrap(line, SCREEN_WIDTH, **how)  # type: ignore[arg-type]
    return "\n".join(rows)


T = TypeVar("T")


@overload
def value(cls: type[T], /) -> type[T]: ...


@overload
def value(
    *, kw_only: bool = True, copy: bool = True, in_sentences: bool = False
) -> Callable[[type[T]], type[T]]: ...


@dataclass_transform(
    frozen_default=True, kw_only_default=True, eq_default=False, field_specifiers=(field,)
)
def value(
    cls: type[T] | None = None,
    /,
    *,
    kw_only: bool = True,
    copy: bool = True,
    in_sentences: bool = False,
) -> type[T] | Callable[[type[T]], type[T]]:
    """Make a class a value type; ``kw_only=False`` lets its fields also be given in order.

    ``copy=False`` is for values that are made inside this package only, from arrays without another
    owner. Printed text is wrapped at the width of the screen, except for values used in sentences
    of messages (``in_sentences``).

    >>> @value
    ... class Tone:
    ...     amplitude: np.ndarray
    >>> samples = np.ones(3)
    >>> tone = Tone(amplitude=samples)
    >>> samples[0] = 9.0                      # the value keeps its own copy
    >>> tone.amplitude
    array([1., 1., 1.])
    >>> tone.amplitude[0] = 9.0
    Traceback (most recent call last):
        ...
    ValueError: assignment destination is read-only
    """
    if cls is None:
        return lambda c: _value_class(c, kw_only, copy=copy, in_sentences=in_sentences)
    return _value_class(cls, kw_only, copy=copy, in_sentences=in_sentences)


def _value_class(cls: type[T], kw_only: bool, *, copy: bool, in_sentences: bool) -> type[T]:
    """Return the dataclass of `value`; arrays are frozen before the validation of the class, own or
    inherited.
    """
    validate = getattr(cls, "__post_init__", None)

    def __post_init__(self: object) -> None:
        held = self.__dict__
        for name, content in held.items():
            if isinstance(content, np.ndarray):
                if copy:
                    held[name] = freeze_array(content)
                else:
                    content.setflags(write=False)
        if validate is not None:
            validate(self)

    cls.__post_init__ = __post_init__  # type: ignore[attr-defined]
    if "__repr__" not in cls.__dict__:
        cls.__repr__ = _repr_line  # type: ignore[method-assign, assignment]
    if "__str__" in cls.__dict__ and not in_sentences:
        describe = cls.__str__

        @wraps(describe)
        def __str__(self: object) -> str:
            return wrap_lines(describe(self))

        cls.__str__ = __str__  # type: ignore[method-assign]
    return dataclass(frozen=True, kw_only=kw_only, eq=False, repr=False)(cls)


def freeze_array(array: np.ndarray) -> np.ndarray:
    """Return a read-only copy of an array; the array itself if nobody else can write it.

    A view is returned itself if the array behind it is read-only, too.
    """
    owner = array if array.base is None else array.base
    if array.flags.writeable or not isinstance(owner, np.ndarray) or owner.flags.writeable:
        array = array.copy()
        array.setflags(write=False)
    return array


def field_names(thing: DataclassInstance | type[DataclassInstance]) -> tuple[str, ...]:
    """Return the names of the fields of a value, or of a value type, in order."""
    return tuple(field.name for field in fields(thing))


# ---- Any value of this project as JSON: fields, and properties that are a word or a number.

_SIMPLE_TYPES = {"str", "bool", "int", "float", str, bool, int, float}


def to_json(thing: object, most: float = np.inf) -> str:
    """Return a value, or a list of values, as JSON: complex numbers as [re, im], nonfinite ones as
    null.

    Arrays of more than `most` numbers are replaced by their shape.

    >>> to_json({"gamma": 1.5, "poles": np.array([-1 + 2j]), "delay": float("nan")})
    '{"gamma": 1.5, "poles": [[-1.0, 2.0]], "delay": null}'
    """
    return json.dumps(to_plain(thing, most), ensure_ascii=False)


@singledispatch
def to_plain(thing: object, most: float = np.inf) -> Json:
    """Return a value in terms of JSON: dictionaries, lists, texts, numbers; systems as matrices,
    others as text.

    >>> to_plain((np.float64(2), None, Path("a")))
    [2.0, None, 'a']
    """
    if is_dataclass(thing):
        fields_of_value = {name: getattr(thing, name) for name in field_names(thing)}
        return to_plain(fields_of_value | _simple_properties(thing), most)
    names = getattr(thing, "_fields", ("A", "B", "C", "D", "dt"))
    if all(hasattr(thing, name) for name in names):
        return {name: to_plain(getattr(thing, name), most) for name in names}
    return " ".join(str(thing).split())


@to_plain.register(NoneType)
@to_plain.register(bool)
def _plain_truth(thing: bool | None, most: float = np.inf) -> Json:
    return thing


@to_plain.register(str)
@to_plain.register(Path)
def _plain_text(thing: str | Path, most: float = np.inf) -> Json:
    return str(thing)


@to_plain.register(int)
def _plain_int(thing: int, most: float = np.inf) -> Json:
    return int(thing)


@to_plain.register(float)
def _plain_float(thing: float, most: float = np.inf) -> Json:
    if np.isfinite(thing):
        return thing
    return None


@to_plain.register(complex)
def _plain_complex(thing: complex, most: float = np.inf) -> Json:
    return [to_plain(thing.real), to_plain(thing.imag)]


@to_plain.register(Enum)
def _plain_enum(thing: Enum, most: float = np.inf) -> Json:
    return to_plain(thing.value, most)


@to_plain.register(np.generic)
def _plain_scalar(thing: np.generic, most: float = np.inf) -> Json:
    return to_plain(thing.item(), most)


@to_plain.register(np.ndarray)
def _plain_array(thing: np.ndarray, most: float = np.inf) -> Json:
    if thing.size > most:
        return {"shape": list(thing.shape)}
    if thing.ndim:
        return [to_plain(one, most) for one in thing]
    return to_plain(thing.item(), most)


@to_plain.register(list)
@to_plain.register(tuple)
def _plain_list(thing: Sequence[object], most: float = np.inf) -> Json:
    if hasattr(thing, "_fields"):  # a named tuple
        return to_plain(dict(zip(thing._fields, thing, strict=True)), most)
    return [to_plain(one, most) for one in thing]


@to_plain.register(Mapping)
def _plain_mapping(thing: Mapping[object, object], most: float = np.inf) -> Json:
    return {str(key): to_plain(held, most) for key, held in thing.items()}


def _simple_properties(thing: object) -> dict[str, object]:
    """Return the properties of a value annotated as a word, a truth value or a number, by name."""
    found = {}
    for kind in reversed(type(thing).__mro__):
        for name, held in vars(kind).items():
            getter = held.fget if isinstance(held, property) and not name.startswith("_") else None
            if getter is not None and getter.__annotations__.get("return") in _SIMPLE_TYPES:
                found[name] = getattr(thing, name)
    return found
