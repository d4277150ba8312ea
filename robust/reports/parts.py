"""Sections of the report page: a table, and pictures that live inside the page."""

from __future__ import annotations

import base64
from collections.abc import Callable
from io import BytesIO
from typing import Any

from nlfrf.shared.axes import under
from nlfrf.shared.values import value

__all__ = ["Section", "rows_of"]


@value
class Picture:
    """A picture: its content as a data address, and what it shows."""

    source: str
    caption: str


@value
class Section:
    """One section of the report: a heading, what it says, and its pictures."""

    name: str
    title: str
    lead: str
    facts: tuple[tuple[str, str], ...] = ()
    table: tuple[tuple[str, ...], ...] = ()  # the first row is the head
    pictures: tuple[Picture, ...] = ()


def picture(
    draw: Callable[..., Any], *content: Any, caption: str, square: bool = False, tall: bool = False, **options: Any
) -> Picture:
    """Draw by one of the plot functions, as a vector picture inside the file."""
    import matplotlib
    from matplotlib.figure import Figure

    # a fixed frame: finding one for each picture would take longer than to draw it
    width, height = (5.6, 6.2) if square else (7.6, 6.2) if tall else (7.6, 5.0)
    figure = Figure(figsize=(width, height))
    left = 0.14 if square else 0.11
    draw(*content, ax=figure.add_axes((left, 0.1, 0.98 - left, 0.84)), **options)
    bottom, top = max(map(under, figure.axes)) / height, 1 - 0.35 / height
    old = [axes.get_position() for axes in figure.axes]
    for axes, place in zip(figure.axes, old, strict=True):  # room for the legend below, whatever it takes
        low, high = (bottom + (y - 0.1) / 0.84 * (top - bottom) for y in (place.y0, place.y1))
        axes.set_position((place.x0, low, place.width, high - low))
    stream = BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": "robust"}):  # the same run gives the same file
        figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
    return Picture(
        source="data:image/svg+xml;base64," + base64.b64encode(stream.getvalue()).decode("ascii"), caption=caption
    )


def rows_of(thing: Any) -> str:
    """What a value says of itself, without the indents of a screen."""
    return "\n".join(row.strip() for row in str(thing).splitlines())
