"""``@value``: the one way this project makes a value type.

A value is frozen and made by keyword. Its arrays are copied when it is made and cannot be written afterwards, so a
value that was valid once stays valid. At a prompt it is one line, in a notebook a table; its `str()` fits 100 columns.
It has no ``==``: comparing arrays for equality is rarely what was meant. Validation goes into ``__post_init__``, which
runs after the arrays were frozen.
"""

from __future__ import annotations

import html
import inspect
import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from functools import cache, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar, dataclass_transform, overload

import numpy as np

from nlfrf._base.arguments import wrap_lines
from nlfrf._base.types import Json

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

__all__ = [
    "ArrayField",
    "Sketch",
    "field_names",
    "freeze_array",
    "html_card",
    "repr_line",
    "short_repr",
    "simple_properties",
    "to_json",
    "to_plain",
    "value",
]


# ---- A value on one line for a prompt, and as a table with a small picture for a notebook.

WIDTH, FEW, MOST = 160, 6, 400  # characters of a line, numbers that are shown, points of a curve
COLOURS = ("#1f77b4", "#d62728", "#2ca02c", "#9467bd")
SKETCH_SIZE = 420, 170, 46, 24  # of a picture: width, height, left and lower margin


#: Type of a field that takes any sequence and holds an array, or None in a value of a kind that has none: a dataclass
#: can declare one of them only, and who reads the field knows the kind.
ArrayField = Any


class Sketch(NamedTuple):
    """A small picture: labelled curves over one axis, logarithmic where it is a frequency."""

    across: str
    up: str
    curves: Sequence[tuple[str, np.ndarray, np.ndarray]]
    log: bool = False


def repr_line(thing: DataclassInstance) -> str:
    """Return a value as it stands at a prompt: its type and fields, arrays by their shape.

    >>> from nlfrf._base.values import value
    >>> @value
    ... class Tone:
    ...     amplitude: np.ndarray
    ...     fs: float
    >>> Tone(amplitude=np.ones((3, 100)), fs=10.0)
    Tone(amplitude=array(3, 100), fs=10.0)
    """
    described = ", ".join(f"{field.name}={short_repr(getattr(thing, field.name, None))}" for field in fields(thing))
    described = described if len(described) <= WIDTH else described[: WIDTH - 3] + "..."
    return f"{type(thing).__name__}({described})"


def short_repr(thing: object) -> str:
    """Anything in a few characters."""
    if isinstance(thing, np.ndarray):
        if is_written_out(thing):
            return np.array2string(thing, separator=", ", precision=5, max_line_width=10**6)
        return f"array{thing.shape}" if thing.ndim != 1 else f"array({thing.size})"
    if is_dataclass(thing) and not isinstance(thing, type):
        return f"{type(thing).__name__}(...)"
    if hasattr(thing, "nstates") and hasattr(thing, "dt"):
        clock = f", dt={thing.dt:g}" if isinstance(thing.dt, float) and thing.dt else ""
        return f"{type(thing).__name__}({thing.nstates} states{clock})"
    if isinstance(thing, np.generic):
        thing = thing.item()
    if isinstance(thing, list | tuple) and len(thing) > FEW:
        return f"{len(thing)} of {short_repr(thing[0])}"
    if isinstance(thing, list | tuple):
        inner = ", ".join(map(short_repr, thing))
        return f"[{inner}]" if isinstance(thing, list) else f"({inner}{',' * (len(thing) == 1)})"
    if isinstance(thing, dict):
        return "{" + ", ".join(f"{key}: {short_repr(held)}" for key, held in list(thing.items())[:FEW]) + "}"
    described = " ".join(repr(thing).split())
    return described if len(described) <= 60 else described[:57] + "..."


def is_written_out(array: np.ndarray) -> bool:
    """Return whether `short_repr` shows the numbers of an array, not its shape."""
    return array.ndim <= 1 and array.size <= FEW and array.dtype.kind in "fiub"


def html_card(thing: DataclassInstance) -> str:
    """Return a value as HTML: what it says of itself, a picture where it has one, its fields with their meaning."""
    kind = type(thing)
    parts = [f"<b>{html.escape(kind.__name__)}</b>"]
    has_own_text = kind.__str__ is not object.__str__
    if has_own_text:
        parts.append(f"<pre style='line-height:1.25'>{html.escape(str(thing))}</pre>")
    sketch = getattr(thing, "_sketch_", None)
    if sketch is not None:
        parts.append(svg_sketch(sketch()))
    meaning = field_meanings(kind)
    rows = "".join(
        f"<tr><td style='text-align:left'><code>{html.escape(name)}</code></td>"
        f"<td style='text-align:left'>{html.escape(describe_content(getattr(thing, name, None)))}</td>"
        f"<td style='text-align:left'>{html.escape(meaning.get(name, ''))}</td></tr>"
        for name in (field.name for field in fields(thing))
    )
    table = f"<table>{rows}</table>"
    parts.append(f"<details><summary>fields</summary>{table}</details>" if has_own_text else table)
    return f"<div>{''.join(parts)}</div>"


def describe_content(thing: object) -> str:
    """Return what a field holds: of real numbers between what and what, too."""
    described = short_repr(thing)
    if isinstance(thing, np.ndarray) and not is_written_out(thing) and thing.dtype.kind in "fiu":
        finite = thing[np.isfinite(thing)]
        described += f" from {finite.min():.4g} to {finite.max():.4g}" if finite.size else " of nan"
    return described


@cache
def field_meanings(kind: type) -> dict[str, str]:
    """Return what the docstring of a type says of each of its fields, the first sentence."""
    text = inspect.getdoc(kind) or ""
    section = re.search(r"(?:Fields|Parameters|Attributes)\n-+\n(.*?)(?=\n\n?[A-Z]\w+\n-+|\Z)", text, re.S)
    found: dict[str, str] = {}
    for entry in re.finditer(r"^(\w[\w, ]*) :[^\n]*\n((?: +[^\n]*\n?)+)", section[1] if section else "", re.M):
        described = " ".join(entry[2].split()).split(". ")[0].rstrip(".")
        found |= {name.strip(): described for name in entry[1].split(",")}
    return found


def svg_sketch(sketch: Sketch) -> str:
    """Curves as SVG, drawn by hand: no library has to be loaded for it."""
    width, height, left, low = SKETCH_SIZE
    curves = [(label, *thin_curve(np.asarray(x, float), np.asarray(y, float))) for label, x, y in sketch.curves]
    xs, ys = (np.concatenate([curve[i] for curve in curves]) for i in (1, 2))
    visible = np.isfinite(xs) & np.isfinite(ys) & ((xs > 0) | (not sketch.log))
    if not visible.any():
        return ""
    scale = np.log10 if sketch.log else np.asarray
    x0, x1 = (float(scale(extreme)) for extreme in (xs[visible].min(), xs[visible].max()))
    y0, y1 = float(ys[visible].min()), float(ys[visible].max())
    wide, high = (x1 - x0) or 1.0, (y1 - y0) or 1.0
    drawn = []
    for i, (label, x, y) in enumerate(curves):
        keep = np.isfinite(y) & np.isfinite(x) & ((x > 0) | (not sketch.log))
        px = left + (scale(x[keep]) - x0) / wide * (width - left - 8)
        py = 8 + (y1 - y[keep]) / high * (height - low - 16)
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(px, py, strict=True))
        colour = COLOURS[i % len(COLOURS)]
        drawn.append(f"<polyline fill='none' stroke='{colour}' stroke-width='1.2' points='{points}'/>")
        drawn.append(svg_text(left + 6 + 90 * i, 14, described=label, colour=colour))
    drawn += [
        svg_text(2, 14, described=f"{y1:.3g}"),
        svg_text(2, height - low - 6, described=f"{y0:.3g}"),
        svg_text(2, height - 4, described=sketch.up),
    ]
    low_x, high_x = (10**x0, 10**x1) if sketch.log else (x0, x1)
    drawn += [
        svg_text(left, height - 10, described=f"{low_x:.3g}"),
        svg_text(width - 50, height - 10, described=f"{high_x:.3g}"),
    ]
    drawn.append(svg_text(width / 2 - 20, height - 10, described=sketch.across))
    return f"<svg width='{width}' height='{height}' style='background:#fff'>{''.join(drawn)}</svg>"


def svg_text(x: float, y: float, *, described: str, colour: str = "#444") -> str:
    """Return a few words in a picture."""
    return f"<text x='{x:.0f}' y='{y:.0f}' font-size='10' fill='{colour}'>{html.escape(described)}</text>"


def thin_curve(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a curve of few points: of each stretch of a long one its lowest and its highest."""
    x, y = np.ravel(x), np.ravel(y)
    if y.size <= MOST:
        return x, y
    n = y.size // (MOST // 2) * (MOST // 2)
    pieces = y[:n].reshape(MOST // 2, -1)
    start = np.arange(MOST // 2) * pieces.shape[1]
    places = np.sort(np.stack([start + pieces.argmin(axis=1), start + pieces.argmax(axis=1)], axis=1), axis=1).ravel()
    return x[places], y[places]


T = TypeVar("T")


@overload
def value(cls: type[T], /) -> type[T]: ...


@overload
def value(*, kw_only: bool = True, copy: bool = True, in_sentences: bool = False) -> Callable[[type[T]], type[T]]: ...


@dataclass_transform(frozen_default=True, kw_only_default=True, eq_default=False)
def value(
    cls: type[T] | None = None, /, *, kw_only: bool = True, copy: bool = True, in_sentences: bool = False
) -> type[T] | Callable[[type[T]], type[T]]:
    """Make a class a value type; ``kw_only=False`` lets its fields also be given in order.
    ``copy=False`` is for values that are only made inside this package, from arrays that nobody else holds. Printed
    text is broken at the width of the screen, but for one that stands in the sentences of messages (``in_sentences``).

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
        return lambda c: value_class(c, kw_only, copy=copy, in_sentences=in_sentences)
    return value_class(cls, kw_only, copy=copy, in_sentences=in_sentences)


def value_class(cls: type[T], kw_only: bool, *, copy: bool, in_sentences: bool) -> type[T]:
    """The dataclass behind `value`, with arrays frozen before the validation of the class, its own or inherited."""
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
        cls.__repr__ = repr_line  # type: ignore[method-assign, assignment]
    if "__str__" in cls.__dict__ and not in_sentences:
        describe = cls.__str__

        @wraps(describe)
        def __str__(self: object) -> str:
            return wrap_lines(describe(self))

        cls.__str__ = __str__  # type: ignore[method-assign]
    cls._repr_html_ = html_card  # type: ignore[attr-defined]
    return dataclass(frozen=True, kw_only=kw_only, eq=False, repr=False)(cls)


def freeze_array(array: np.ndarray) -> np.ndarray:
    """Return a read-only copy; the array itself where nobody else can write it.

    A view is its own where the array that it looks into is read-only too.
    """
    owner = array if array.base is None else array.base
    if array.flags.writeable or not isinstance(owner, np.ndarray) or owner.flags.writeable:
        array = array.copy()
        array.setflags(write=False)
    return array


def field_names(thing: DataclassInstance | type[DataclassInstance]) -> tuple[str, ...]:
    """Return the names of a value's fields, or of a value type's, in order."""
    return tuple(field.name for field in fields(thing))


# ---- Any value of this project as JSON has it: fields, and properties that are a word or a number.

SIMPLE_TYPES = {"str", "bool", "int", "float", str, bool, int, float}


def to_json(thing: object, most: float = np.inf) -> str:
    """Return a value, or a list of them, as JSON: complex numbers as [re, im], what is not finite as null.

    Arrays of more than `most` numbers are left out, and their shape told.

    >>> to_json({"gamma": 1.5, "poles": np.array([-1 + 2j]), "delay": float("nan")})
    '{"gamma": 1.5, "poles": [[-1.0, 2.0]], "delay": null}'
    """
    return json.dumps(to_plain(thing, most), ensure_ascii=False)


def to_plain(thing: object, most: float = np.inf) -> Json:
    """Return a value in terms of JSON: dictionaries, lists, texts, numbers; systems as matrices, others as text."""
    if thing is None or isinstance(thing, str | bool | int):
        return thing
    if isinstance(thing, Enum):
        return to_plain(thing.value, most)
    if isinstance(thing, np.generic):
        return to_plain(thing.item(), most)
    if isinstance(thing, float):
        return thing if np.isfinite(thing) else None
    if isinstance(thing, complex):
        return [to_plain(thing.real), to_plain(thing.imag)]
    if isinstance(thing, np.ndarray) and thing.size > most:
        return {"shape": list(thing.shape)}
    if isinstance(thing, np.ndarray):
        return [to_plain(one, most) for one in thing] if thing.ndim else to_plain(thing.item(), most)
    if isinstance(thing, Mapping):
        return {str(key): to_plain(held, most) for key, held in thing.items()}
    if hasattr(thing, "_fields"):
        return {name: to_plain(getattr(thing, name), most) for name in thing._fields}
    if isinstance(thing, list | tuple):
        return [to_plain(one, most) for one in thing]
    if is_dataclass(thing):
        fields = {name: to_plain(getattr(thing, name), most) for name in field_names(thing)}
        return {**fields, **{name: to_plain(held, most) for name, held in simple_properties(thing).items()}}
    if all(hasattr(thing, name) for name in "ABCD") and hasattr(thing, "dt"):
        return {name: to_plain(getattr(thing, name), most) for name in ("A", "B", "C", "D", "dt")}
    return str(thing) if isinstance(thing, Path) else " ".join(str(thing).split())


def simple_properties(thing: object) -> dict[str, object]:
    """Return the properties of a value that are said to be a word, a truth or a number, by name."""
    found = {}
    for kind in reversed(type(thing).__mro__):
        for name, held in vars(kind).items():
            getter = held.fget if isinstance(held, property) and not name.startswith("_") else None
            if getter is not None and getter.__annotations__.get("return") in SIMPLE_TYPES:
                found[name] = getattr(thing, name)
    return found
