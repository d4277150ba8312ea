"""Checks of arguments. An error message is one line with the parameter, its requirement, and its
value.
"""

from __future__ import annotations

import numbers
import re
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import replace
from functools import wraps
from typing import TYPE_CHECKING, Any, ParamSpec, Protocol, TypeGuard, TypeVar, cast

import numpy as np

from nlfrf._base.numbers import all_finite

if TYPE_CHECKING:
    from nlfrf._base.types import Seed

# ---- Text of messages: frequencies in Hz, counts, short forms of any object.

_NUMBER_WORDS = (
    "no",
    "one",
    "two",
    "three",
    "four",
    "five",
    "six",
    "seven",
    "eight",
    "nine",
    "ten",
    "eleven",
    "twelve",
)
#: Characters that control a terminal or turn the direction of the text behind them: control
#: characters except line break and tab, marks of direction and of no width, tags, halves of a pair
#: (bytes of a file name that are no text).
_CONTROL_CHARACTERS = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ud800-\udfff\U000e0000-\U000e007f]"
)
_LINE_BREAKS = re.compile("[\t\n\x0b\f\r\x85\u2028\u2029]+")


def printable(text: str) -> str:
    r"""Return a text with every character that controls a terminal written out, as in JSON.

    >>> printable("force\x1b[2J [N]\n")
    'force\\u001b[2J [N]\n'
    """

    def written_out(found: re.Match[str]) -> str:
        raw = found[0].encode("utf-16-be", "surrogatepass").hex()
        return "".join(f"\\u{raw[i : i + 4]}" for i in range(0, len(raw), 4))

    return _CONTROL_CHARACTERS.sub(written_out, text)


def one_line(text: str) -> str:
    r"""Return a text from a file, or a name, printable and without line breaks.

    >>> one_line("Force\r\n[N]"), one_line("u\x9b2J")
    ('Force [N]', 'u\\u009b2J')
    """
    return printable(_LINE_BREAKS.sub(" ", text))


def short_form(thing: object) -> str:
    """Return a short form of anything, for the end of a message."""
    if isinstance(thing, np.ndarray):
        return f"an array of shape {thing.shape}"
    text = " ".join(repr(thing).split())
    if len(text) <= 60:
        return text
    return text[:57] + "..."


def format_hertz(omega: float) -> str:
    """Return a frequency in Hz, as text."""
    if np.isinf(omega):
        return "infinite frequency"
    return f"{omega / 2 / np.pi:.4g} Hz"


def format_count(n: int, what: str) -> str:
    """Return a count with its noun."""
    return f"{n} {what}" + "s" * (n != 1)


def format_small_count(n: int, what: str) -> str:
    """Return a count with its noun, small numbers in words.

    >>> format_small_count(1, "sample"), format_small_count(2, "sample"), format_small_count(40, "sample")
    ('one sample', 'two samples', '40 samples')
    """
    if 0 <= n < len(_NUMBER_WORDS):
        return f"{_NUMBER_WORDS[n]} {what}" + "s" * (n != 1)
    return format_count(n, what)


def join_names(names: Sequence[str]) -> str:
    """Return names with commas and an "and" between them.

    >>> join_names(["1"]), join_names(["1", "3"]), join_names(["1", "3", "4"])
    ('1', '1 and 3', '1, 3 and 4')
    """
    return " and ".join([*([", ".join(names[:-1])] if len(names) > 1 else []), names[-1]])


def inverse_unit(unit: str) -> str:
    """Return the unit of the inverse of a quantity.

    >>> inverse_unit("m/N"), inverse_unit("1/N"), inverse_unit("rad"), inverse_unit("m/s/V")
    ('N/m', 'N', '1/rad', '1/(m/s/V)')
    """
    top, *bottom = unit.split("/")
    if len(bottom) > 1:
        return f"1/({unit})"
    if bottom and top == "1":
        return bottom[0]
    return f"{bottom[0] if bottom else 1}/{top}"


def ratio_unit(top: str, bottom: str) -> str:
    """Return the unit of one quantity over another; empty if neither is known.

    >>> ratio_unit("m", "N"), ratio_unit("m", ""), ratio_unit("", "")
    ('m/N', 'm/1', '')
    """
    if top or bottom:
        return f"{top or '1'}/{bottom or '1'}"
    return ""


def split_ratio_unit(unit: str) -> tuple[str, str]:
    """Return the units of the two quantities of a ratio; empty ones where the unit leaves it open.

    >>> split_ratio_unit("m/N"), split_ratio_unit("m/1"), split_ratio_unit("m/s/V")
    (('m', 'N'), ('m', ''), ('', ''))
    """
    parts = ["" if one == "1" else one for one in unit.split("/")]
    if len(parts) == 2:
        return parts[0], parts[1]
    return "", ""


def label_with_unit(what: str, unit: str, otherwise: str) -> str:
    """Return a quantity with its unit in brackets, for an axis: the known unit, or a description of
    it.

    >>> label_with_unit("u", "N", "unit of u"), label_with_unit("u", "", "unit of u")
    ('u [N]', 'u [unit of u]')
    """
    return f"{what} [{unit or otherwise}]"


#: Signal between its samples: the band-limited signal itself, held by a converter, or unknown.
HOLDS = ("band-limited", "zoh", "unknown")


class DataWarning(UserWarning):
    """Warning that a result can be used with caution only; its text states the reason.

    To stop at every such warning, make it an error:

    Examples
    --------
    >>> import warnings
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("error", DataWarning)  # to stop at every suspicious result
    """


#: Texts of the warnings so far, in order, for each running function that `keep_warnings` decorates.
_WARNED: ContextVar[tuple[dict[str, None], ...]] = ContextVar("WARNED", default=())
Given = ParamSpec("Given")


class _Warned(Protocol):
    """A value with the texts of the warnings issued while it was made."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """Text of each warning."""


Made = TypeVar("Made", bound="_Warned | Sequence[_Warned]")
Kept = TypeVar("Kept", bound=_Warned)
Thing = TypeVar("Thing")


def data_warning(text: str, category: type[UserWarning] = DataWarning) -> None:
    """Warn at the line of the user's code, outside both packages; `keep_warnings` keeps the
    text.
    """
    level, frame = 1, sys._getframe()
    while frame.f_back is not None and frame.f_globals.get("__name__", "").partition(".")[0] in (
        "nlfrf",
        "robust",
    ):
        level, frame = level + 1, frame.f_back
    warnings.warn(text, category, stacklevel=level)
    for texts in _WARNED.get():  # not reached if the warning is an error
        texts[text] = None


@contextmanager
def _collect_warnings() -> Iterator[dict[str, None]]:
    """Collect the texts of the warnings issued inside, in order."""
    texts: dict[str, None] = {}
    token = _WARNED.set((*_WARNED.get(), texts))
    try:
        yield texts
    finally:
        _WARNED.reset(token)


def keep_warnings(make: Callable[Given, Made]) -> Callable[Given, Made]:
    """Decorate a function so that the value, or the list of values, that it returns keeps its
    warnings in `warnings`.

    These are the warnings of its arguments, those that it has already, and those of `data_warning`
    while the function runs, whether a filter shows them or not.
    """

    @wraps(make)
    def keeping(*args: Given.args, **kwargs: Given.kwargs) -> Made:
        given = [one for arg in (*args, *kwargs.values()) for one in as_list(arg)]
        with _collect_warnings() as texts:
            texts.update(
                dict.fromkeys(text for one in given for text in getattr(one, "warnings", ()))
            )
            made = make(*args, **kwargs)
        if isinstance(made, list | tuple):
            return cast("Made", type(made)(add_warnings(one, texts) for one in made))
        return cast("Made", add_warnings(cast("_Warned", made), texts))

    return keeping


def as_list(given: Thing | Sequence[Thing]) -> list[Thing]:
    """Return an argument that is one value or several as a list."""
    if isinstance(given, list | tuple):
        return list(given)
    return [cast("Thing", given)]


def as_names(given: object) -> tuple[str, ...]:
    """Return an argument that is one text or several as a tuple.

    >>> as_names("force"), as_names(["force", "torque"])
    (('force',), ('force', 'torque'))
    """
    return tuple(cast("list[str]", as_list(given)))


def add_warnings(made: Kept, texts: Iterable[str]) -> Kept:
    """Return a value with these warnings added, each once; the value itself if it has them all."""
    warned = tuple(dict.fromkeys((*texts, *made.warnings)))
    return made if warned == made.warnings else replace(made, warnings=warned)  # type: ignore[type-var]  # a value is a dataclass


def repeat_warnings(read: Kept) -> Kept:
    """Repeat the warnings of a value that comes from a file; return the value."""
    for text in read.warnings:
        data_warning(text)
    return read


def require_kind(name: str, thing: object, *kinds: type) -> None:
    """Refuse an object of none of these kinds, which would fail somewhere inside."""
    if not isinstance(thing, kinds):
        raise ValueError(
            f"{name} must be of type {' or '.join(kind.__name__ for kind in kinds)}, got"
            f" {short_form(thing)}"
        )


def require_list(name: str, given: object, kind: type[Thing]) -> list[Thing]:
    """Return several values of one kind as a list; refuse an empty one, or other contents.

    >>> require_list("gains", (1.0, 2.0), float)
    [1.0, 2.0]
    >>> require_list("gains", 1.0, float)
    Traceback (most recent call last):
        ...
    ValueError: gains must be a list of at least one float, got 1.0
    """
    found = list(given) if isinstance(given, Iterable) else []
    if not found or not all(isinstance(one, kind) for one in found):
        raise ValueError(
            f"{name} must be a list of at least one {kind.__name__}, got {short_form(given)}"
        )
    return found


def require_known(where: str, given: Iterable[str], known: Sequence[str]) -> None:
    """Refuse an unknown entry of a file, with the nearest known one.

    >>> require_known("axis.toml", ["motor_mass"], ["motor_inertia", "drive"])
    Traceback (most recent call last):
        ...
    ValueError: axis.toml must have no entry 'motor_mass', did you mean motor_inertia? Known: drive, motor_inertia
    """
    for name in given:
        if name not in known:
            from difflib import get_close_matches

            lower = {one.lower(): one for one in known}
            near = [lower[one] for one in get_close_matches(name.lower(), lower, n=1, cutoff=0.5)]
            raise ValueError(
                f"{where} must have no entry"
                f" {name!r}{f', did you mean {near[0]}?' if near else '.'} Known:"
                f" {', '.join(sorted(known))}"
            )


class _OfChannels(Protocol):
    """A value with inputs and outputs."""

    @property
    def is_single(self) -> bool:
        """True for one input and one output."""

    @property
    def n_inputs(self) -> int:
        """Number of inputs."""

    @property
    def n_outputs(self) -> int:
        """Number of outputs."""


def require_one_channel(name: str, thing: _OfChannels, cure: str = "") -> None:
    """Refuse a value with several inputs or outputs."""
    if not thing.is_single:
        raise ValueError(
            f"{name} must have one input and one output, got {thing.n_inputs} and"
            f" {thing.n_outputs}{cure}"
        )


class MissingArgumentError(ValueError):
    """A required argument, `parameter`, was not given."""

    def __init__(self, parameter: str, why: str) -> None:
        super().__init__(f"{parameter} must be given: {why}")
        self.parameter = parameter


def require_positive(name: str, number: object) -> float:
    """Return the number as a float; refuse it unless it is finite and above zero."""
    found = require_real(name, number)
    if not found > 0:
        raise ValueError(f"{name} must be positive, got {found:g}")
    return found


def require_nonnegative(name: str, number: object) -> float:
    """Return the number as a float; refuse it unless it is finite and at least zero."""
    found = require_real(name, number)
    if found < 0:
        raise ValueError(f"{name} must be zero or positive, got {found:g}")
    return found


def is_real(thing: object) -> TypeGuard[float]:
    """Return whether a thing is a real number, of Python or numpy; a truth value is none."""
    return isinstance(thing, numbers.Real) and type(thing) is not bool


def require_real(name: str, number: object) -> float:
    """Return the number as a float; refuse it unless it is one finite real number."""
    if not is_real(number):
        raise ValueError(f"{name} must be a real number, got {short_form(number)}")
    if not np.isfinite(float(number)):
        raise ValueError(f"{name} must be finite, got {float(number)}")
    return float(number)


def require_integer(name: str, number: object, *, least: int) -> int:
    """Return the number as an int; refuse it unless it is a whole number of at least `least`."""
    if type(number) is int and number >= least:
        return number
    if is_real(number):
        number_f = float(number)
        if number_f.is_integer() and number_f >= least:
            return int(number_f)
    raise ValueError(f"{name} must be a whole number of at least {least}, got {short_form(number)}")


def require_probability(name: str, number: object) -> float:
    """Return the number as a float; refuse it unless it lies strictly between 0 and 1."""
    p = require_real(name, number)
    if not 0 < p < 1:
        raise ValueError(f"{name} must lie strictly between 0 and 1, got {p:g}")
    return p


def random_generator(name: str, seed: Seed) -> np.random.Generator:
    """Return a generator of random numbers, from a generator, a seed or None; refuse other
    types.
    """
    try:
        return np.random.default_rng(seed)
    except (TypeError, ValueError):
        raise ValueError(
            f"{name} must be a numpy Generator, a whole number or None, got {short_form(seed)}"
        ) from None


def require_choice(name: str, choice: object, choices: tuple[str, ...]) -> str:
    """Return the choice; refuse it unless it is one of the choices."""
    if choice not in choices:
        raise ValueError(
            f"{name} must be one of {', '.join(map(repr, choices))}, got {short_form(choice)}"
        )
    return str(choice)


def require_real_array(name: str, array: object, *, ndim: int) -> np.ndarray:
    """Return the array as float64; refuse it unless it has `ndim` axes and finite real numbers."""
    _require_unmasked(name, array)
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
        raise ValueError(
            f"{name} must be finite, got {bad} nan or infinite numbers, the first at {where}"
        )
    return array


def _require_unmasked(name: str, array: Any) -> None:
    """Refuse masked samples: the numbers under the mask would be used."""
    mask = np.ma.getmask(array)
    if mask.any():
        first = tuple(int(i) for i in np.argwhere(mask)[0])
        raise ValueError(
            f"{name} must have no masked numbers, got {int(mask.sum())}, the first at "
            f"{first[0] if mask.ndim == 1 else first}; cut them out or fill them"
        )


def channel_names(name: str, given: object, count: int) -> tuple[str, ...]:
    """Return names of channels, none if none are given; a text suffices for one channel."""
    names = as_names(given)
    if names and (
        not all(isinstance(one, str) for one in names)
        or len(set(names)) != count
        or len(names) != count
    ):
        if count == 1:
            wanted = "one name"
        else:
            wanted = f"{count} different names"
        raise ValueError(f"{name} must be {wanted}, got {given!r}")
    return names
