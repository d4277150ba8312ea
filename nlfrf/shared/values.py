"""``@value``: the one way this project makes a value type.

A value is frozen and made by keyword. Its arrays are copied when it is made and cannot be written afterwards, so a
value that was valid once stays valid. At a prompt it is one line, in a notebook a table. It has no ``==``: comparing
arrays for equality is rarely what was meant. Validation goes into ``__post_init__``, which runs after the arrays were
frozen.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, TypeVar, dataclass_transform, overload

import numpy as np

from nlfrf.shared.cards import card, line

__all__ = ["field_names", "frozen", "value"]


T = TypeVar("T")


@overload
def value(cls: type[T], /) -> type[T]: ...


@overload
def value(*, kw_only: bool = True, copy: bool = True) -> Callable[[type[T]], type[T]]: ...


@dataclass_transform(frozen_default=True, kw_only_default=True, eq_default=False)
def value(cls: Any = None, /, *, kw_only: bool = True, copy: bool = True) -> Any:
    """Make a class a value type; ``kw_only=False`` lets its fields also be given in order.
    ``copy=False`` is for values that are only made inside this package, from arrays that nobody else holds.

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
        return lambda c: value_class(c, kw_only, copy)
    return value_class(cls, kw_only, copy)


def value_class(cls: type[T], kw_only: bool, copy: bool) -> type[T]:
    """The dataclass behind `value`, with arrays frozen before the validation of the class, its own or inherited."""
    validate = getattr(cls, "__post_init__", None)

    def __post_init__(self: Any) -> None:
        held = self.__dict__
        for name, content in held.items():
            if isinstance(content, np.ndarray):
                if copy:
                    held[name] = frozen(content)
                else:
                    content.setflags(write=False)
        if validate is not None:
            validate(self)

    cls.__post_init__ = __post_init__  # type: ignore[attr-defined]
    if "__repr__" not in cls.__dict__:
        cls.__repr__ = line  # type: ignore[method-assign]
    cls._repr_html_ = card  # type: ignore[attr-defined]
    return dataclass(frozen=True, kw_only=kw_only, eq=False, repr=False)(cls)


def frozen(array: np.ndarray) -> np.ndarray:
    """A read-only copy; the array itself where nobody else can write it.

    A view is its own where the array that it looks into is read-only too.
    """
    owner = array if array.base is None else array.base
    if array.flags.writeable or not isinstance(owner, np.ndarray) or owner.flags.writeable:
        array = array.copy()
        array.setflags(write=False)
    return array


def field_names(thing: Any) -> tuple[str, ...]:
    """The names of a value's fields, or of a value type's, in order."""
    return tuple(field.name for field in fields(thing))
