"""A value on one line for a prompt, and as a table with a small picture for a notebook."""

from __future__ import annotations

import html
import inspect
import re
from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np

__all__ = ["Sketch", "card", "line", "short"]


WIDTH, FEW, MOST = 160, 6, 400  # characters of a line, numbers that are shown, points of a curve
COLOURS = ("#1f77b4", "#d62728", "#2ca02c", "#9467bd")
SIZE = 420, 170, 46, 24  # of a picture: width, height, left and lower margin


class Sketch(NamedTuple):
    """A small picture: labelled curves over one axis, logarithmic where it is a frequency."""

    across: str
    up: str
    curves: Sequence[tuple[str, np.ndarray, np.ndarray]]
    log: bool = False


def line(thing: Any) -> str:
    """A value as it stands at a prompt: its type and fields, arrays by their shape.

    >>> from nlfrf.shared.values import value
    >>> @value
    ... class Tone:
    ...     amplitude: np.ndarray
    ...     fs: float
    >>> Tone(amplitude=np.ones((3, 100)), fs=10.0)
    Tone(amplitude=array(3, 100), fs=10.0)
    """
    said = ", ".join(f"{field.name}={short(getattr(thing, field.name, None))}" for field in fields(thing))
    said = said if len(said) <= WIDTH else said[: WIDTH - 3] + "..."
    return f"{type(thing).__name__}({said})"


def short(thing: Any) -> str:
    """Anything in a few characters."""
    if isinstance(thing, np.ndarray):
        if thing.ndim <= 1 and thing.size <= FEW and thing.dtype.kind in "fiub":
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
        return f"{len(thing)} of {short(thing[0])}"
    if isinstance(thing, list | tuple):
        inner = ", ".join(map(short, thing))
        return f"[{inner}]" if isinstance(thing, list) else f"({inner}{',' * (len(thing) == 1)})"
    if isinstance(thing, dict):
        return "{" + ", ".join(f"{key}: {short(held)}" for key, held in list(thing.items())[:FEW]) + "}"
    said = " ".join(repr(thing).split())
    return said if len(said) <= 60 else said[:57] + "..."


def card(thing: Any) -> str:
    """A value as HTML: what it says of itself, a picture where it has one, its fields with their meaning."""
    kind: Any = type(thing)
    parts = [f"<b>{html.escape(kind.__name__)}</b>"]
    spoken = kind.__str__ is not object.__str__
    if spoken:
        parts.append(f"<pre style='line-height:1.25'>{html.escape(str(thing))}</pre>")
    sketch = getattr(thing, "_sketch_", None)
    if sketch is not None:
        parts.append(picture(sketch()))
    meaning = meanings(kind)
    rows = "".join(
        f"<tr><td style='text-align:left'><code>{html.escape(name)}</code></td>"
        f"<td style='text-align:left'>{html.escape(held(getattr(thing, name, None)))}</td>"
        f"<td style='text-align:left'>{html.escape(meaning.get(name, ''))}</td></tr>"
        for name in (field.name for field in fields(thing))
    )
    table = f"<table>{rows}</table>"
    parts.append(f"<details><summary>fields</summary>{table}</details>" if spoken else table)
    return f"<div>{''.join(parts)}</div>"


def held(thing: Any) -> str:
    """What a field holds: of real numbers between what and what, too."""
    said = short(thing)
    if isinstance(thing, np.ndarray) and said.startswith("array") and thing.dtype.kind in "fiu":
        finite = thing[np.isfinite(thing)]
        said += f" from {finite.min():.4g} to {finite.max():.4g}" if finite.size else " of nan"
    return said


@cache
def meanings(kind: type) -> dict[str, str]:
    """What the docstring of a type says of each of its fields, the first sentence."""
    text = inspect.getdoc(kind) or ""
    section = re.search(r"(?:Fields|Parameters|Attributes)\n-+\n(.*?)(?=\n\n?[A-Z]\w+\n-+|\Z)", text, re.S)
    found: dict[str, str] = {}
    for entry in re.finditer(r"^(\w[\w, ]*) :[^\n]*\n((?: +[^\n]*\n?)+)", section[1] if section else "", re.M):
        said = " ".join(entry[2].split()).split(". ")[0].rstrip(".")
        found |= {name.strip(): said for name in entry[1].split(",")}
    return found


def picture(sketch: Sketch) -> str:
    """Curves as SVG, drawn by hand: no library has to be loaded for it."""
    width, height, left, low = SIZE
    curves = [(label, *thinned(np.asarray(x, float), np.asarray(y, float))) for label, x, y in sketch.curves]
    xs, ys = (np.concatenate([curve[i] for curve in curves]) for i in (1, 2))
    seen = np.isfinite(xs) & np.isfinite(ys) & ((xs > 0) | (not sketch.log))
    if not seen.any():
        return ""
    scale = np.log10 if sketch.log else np.asarray
    x0, x1 = (float(scale(extreme)) for extreme in (xs[seen].min(), xs[seen].max()))
    y0, y1 = float(ys[seen].min()), float(ys[seen].max())
    wide, high = (x1 - x0) or 1.0, (y1 - y0) or 1.0
    drawn = []
    for i, (label, x, y) in enumerate(curves):
        keep = np.isfinite(y) & np.isfinite(x) & ((x > 0) | (not sketch.log))
        px = left + (scale(x[keep]) - x0) / wide * (width - left - 8)
        py = 8 + (y1 - y[keep]) / high * (height - low - 16)
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(px, py, strict=True))
        colour = COLOURS[i % len(COLOURS)]
        drawn.append(f"<polyline fill='none' stroke='{colour}' stroke-width='1.2' points='{points}'/>")
        drawn.append(text(left + 6 + 90 * i, 14, label, colour))
    drawn += [text(2, 14, f"{y1:.3g}"), text(2, height - low - 6, f"{y0:.3g}"), text(2, height - 4, sketch.up)]
    low_x, high_x = (10**x0, 10**x1) if sketch.log else (x0, x1)
    drawn += [text(left, height - 10, f"{low_x:.3g}"), text(width - 50, height - 10, f"{high_x:.3g}")]
    drawn.append(text(width / 2 - 20, height - 10, sketch.across))
    return f"<svg width='{width}' height='{height}' style='background:#fff'>{''.join(drawn)}</svg>"


def text(x: float, y: float, said: str, colour: str = "#444") -> str:
    """A few words in a picture."""
    return f"<text x='{x:.0f}' y='{y:.0f}' font-size='10' fill='{colour}'>{html.escape(said)}</text>"


def thinned(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A curve of few points: of each stretch of a long one its lowest and its highest."""
    x, y = np.ravel(x), np.ravel(y)
    if y.size <= MOST:
        return x, y
    n = y.size // (MOST // 2) * (MOST // 2)
    pieces = y[:n].reshape(MOST // 2, -1)
    start = np.arange(MOST // 2) * pieces.shape[1]
    places = np.sort(np.stack([start + pieces.argmin(axis=1), start + pieces.argmax(axis=1)], axis=1), axis=1).ravel()
    return x[places], y[places]
