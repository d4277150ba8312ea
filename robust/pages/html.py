"""Sections as one HTML file.

The file contains its pictures, its style and a small script that enlarges the pictures. Its content
security policy forbids every network request, so the page does not depend on other files.
"""

from __future__ import annotations

import base64
from collections.abc import Callable, Sequence
from datetime import datetime
from importlib.resources import files
from io import BytesIO

from nlfrf._base.axes import height_below
from robust.pages.section import Picture, Section


def draw_picture(
    caption: str,
    draw: Callable[..., object],
    *content: object,
    square: bool = False,
    tall: bool = False,
    **options: object,
) -> Picture:
    """Draw by one of the plot functions, as a vector picture inside the file."""
    import matplotlib
    from matplotlib.figure import Figure

    # a fixed frame: finding one for each picture would take longer than to draw it
    if square:
        width, height = 5.6, 6.2
    elif tall:
        width, height = 7.6, 6.2
    else:
        width, height = 7.6, 5.0
    figure = Figure(figsize=(width, height))
    left = 0.14 if square else 0.11
    draw(*content, ax=figure.add_axes((left, 0.1, 0.98 - left, 0.84)), **options)
    bottom, top = max(map(height_below, figure.axes)) / height, 1 - 0.35 / height
    old = [axes.get_position() for axes in figure.axes]
    for axes, place in zip(
        figure.axes, old, strict=True
    ):  # free space for a legend of any height below
        low, high = (bottom + (y - 0.1) / 0.84 * (top - bottom) for y in (place.y0, place.y1))
        axes.set_position((place.x0, low, place.width, high - low))
    stream = BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": "robust"}):  # the same run gives the same file
        figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
    return Picture(
        "data:image/svg+xml;base64," + base64.b64encode(stream.getvalue()).decode("ascii"), caption
    )


def render_page(sections: Sequence[Section], **content: object) -> str:
    """Return the HTML text.

    content : title and notes; verdict; style, heading and lines of the banner above all sections;
    warnings.
    """
    from jinja2 import Environment, StrictUndefined

    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    template = files("robust.pages").joinpath("page.html.jinja").read_text(encoding="utf-8")
    written = datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %Z")
    return environment.from_string(template).render(**content, sections=sections, written=written)
