"""Refusals: one clear line naming the parameter, what it must be, and what it was."""

from __future__ import annotations

import numbers
import sys
import warnings
from typing import Any

import numpy as np

from nlfrf.shared.transforms import all_finite
from nlfrf.shared.wording import shown

__all__ = [
    "HOLDS",
    "DataWarning",
    "channel_names",
    "data_warning",
    "generator",
    "integer",
    "nonnegative",
    "of_kind",
    "one_of",
    "positive",
    "probability",
    "real",
    "real_array",
]


#: How a signal runs between its samples: as the band-limited signal itself, held by a converter, or nobody said.
HOLDS = ("band-limited", "zoh", "unknown")


class DataWarning(UserWarning):
    """A result that is usable but suspicious: the data or the grid limit what it means.

    Examples
    --------
    >>> import warnings
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("error", DataWarning)  # to stop at every suspicious result
    """


def data_warning(text: str) -> None:
    """A `DataWarning` that points at the line of the user's that led to it, however many of ours lie between."""
    level, frame = 1, sys._getframe()
    while frame.f_back is not None and frame.f_globals.get("__name__", "").partition(".")[0] in ("nlfrf", "robust"):
        level, frame = level + 1, frame.f_back
    warnings.warn(text, DataWarning, stacklevel=level)


def of_kind(name: str, thing: Any, *kinds: type[Any]) -> None:
    """A refusal unless the thing is of one of these kinds: what is made for one of them would fail somewhere inside."""
    if not isinstance(thing, kinds):
        raise ValueError(f"{name} must be of type {' or '.join(kind.__name__ for kind in kinds)}, got {shown(thing)}")


def positive(name: str, number: Any) -> float:
    """The number as a float, or a refusal unless it is finite and above zero."""
    number = real(name, number)
    if not number > 0:
        raise ValueError(f"{name} must be positive, got {number:g}")
    return number


def nonnegative(name: str, number: Any) -> float:
    """The number as a float, or a refusal unless it is finite and at least zero."""
    number = real(name, number)
    if number < 0:
        raise ValueError(f"{name} must be zero or positive, got {number:g}")
    return number


def real(name: str, number: Any) -> float:
    """The number as a float, or a refusal unless it is one finite real number."""
    if isinstance(number, (bool, np.bool_)) or not isinstance(number, numbers.Real):
        raise ValueError(f"{name} must be a real number, got {shown(number)}")
    if not np.isfinite(float(number)):
        raise ValueError(f"{name} must be finite, got {float(number)}")
    return float(number)


def integer(name: str, number: Any, *, least: int) -> int:
    """The number as an int, or a refusal unless it is a whole number of at least `least`."""
    if type(number) is int and number >= least:
        return number
    if isinstance(number, numbers.Real) and not isinstance(number, (bool, np.bool_)):
        number_f = float(number)
        if number_f.is_integer() and number_f >= least:
            return int(number_f)
    raise ValueError(f"{name} must be a whole number of at least {least}, got {shown(number)}")


def probability(name: str, number: Any) -> float:
    """The number as a float, or a refusal unless it lies strictly between 0 and 1."""
    p = real(name, number)
    if not 0 < p < 1:
        raise ValueError(f"{name} must lie strictly between 0 and 1, got {p:g}")
    return p


def generator(name: str, seed: Any) -> np.random.Generator:
    """A source of random numbers from one, from a seed or from nothing, or a refusal."""
    try:
        return np.random.default_rng(seed)
    except (TypeError, ValueError):
        raise ValueError(f"{name} must be a numpy Generator, a whole number or None, got {shown(seed)}") from None


def one_of(name: str, choice: Any, choices: tuple[str, ...]) -> str:
    """The choice, or a refusal that lists what can be chosen."""
    if choice not in choices:
        raise ValueError(f"{name} must be one of {', '.join(map(repr, choices))}, got {shown(choice)}")
    return str(choice)


def real_array(name: str, array: Any, *, ndim: int) -> np.ndarray:
    """The array as float64, or a refusal unless it has `ndim` axes and finite real numbers."""
    if isinstance(array, np.ma.MaskedArray):
        refuse_masked(name, array)
    array = np.asarray(array)
    if array.dtype.kind not in "fiub":
        raise ValueError(f"{name} must hold real numbers, got dtype {array.dtype}")
    if array.ndim != ndim:
        raise ValueError(f"{name} must have {ndim} axes, got shape {array.shape}")
    array = np.asarray(array, dtype=float)
    if not all_finite(array):
        bad = int(np.count_nonzero(~np.isfinite(array)))
        first = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        where = first[0] if ndim == 1 else first
        raise ValueError(f"{name} must be finite, got {bad} nan or infinite numbers, the first at {where}")
    return array


def refuse_masked(name: str, array: np.ma.MaskedArray) -> None:
    """Refuse masked samples, which would otherwise count with whatever lies under the mask."""
    mask = np.ma.getmaskarray(array)
    if mask.any():
        first = tuple(int(i) for i in np.argwhere(mask)[0])
        raise ValueError(
            f"{name} must have no masked numbers, got {int(mask.sum())}, the first at "
            f"{first[0] if array.ndim == 1 else first}; cut them out or fill them"
        )


def channel_names(name: str, given: Any, count: int) -> tuple[str, ...]:
    """Names of channels, none where none are given; of one channel a text will do."""
    names = (given,) if isinstance(given, str) else tuple(given)
    if names and (not all(isinstance(one, str) for one in names) or len(set(names)) != count or len(names) != count):
        wanted = "one name" if count == 1 else f"{count} different names"
        raise ValueError(f"{name} must be {wanted}, got {given!r}")
    return names
