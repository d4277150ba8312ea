"""Parts of a page: its sections, each a table and pictures that live inside the page, and the page made of them."""

from __future__ import annotations

import base64
from collections.abc import Callable
from datetime import datetime
from importlib.resources import files
from io import BytesIO

import control
import numpy as np

from nlfrf._base.arguments import format_hertz
from nlfrf._base.axes import height_below
from nlfrf._base.values import value
from robust._base.types import Weight
from robust.lti.lti import response, timebase, to_s_plane
from robust.lti.realisation import state_space


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
    printed: str = ""  # as a command prints it, in columns


@value
class Banner:
    """The verdict above all sections: a class of colours of the page, what it is, what it means in lines."""

    style: str
    heading: str
    lines: tuple[str, ...]


def draw_picture(
    draw: Callable[..., object],
    *content: object,
    caption: str,
    square: bool = False,
    tall: bool = False,
    **options: object,
) -> Picture:
    """Draw by one of the plot functions, as a vector picture inside the file."""
    import matplotlib
    from matplotlib.figure import Figure

    # a fixed frame: finding one for each picture would take longer than to draw it
    width, height = (5.6, 6.2) if square else (7.6, 6.2) if tall else (7.6, 5.0)
    figure = Figure(figsize=(width, height))
    left = 0.14 if square else 0.11
    draw(*content, ax=figure.add_axes((left, 0.1, 0.98 - left, 0.84)), **options)
    bottom, top = max(map(height_below, figure.axes)) / height, 1 - 0.35 / height
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


def rows_of_value(thing: object) -> str:
    """Return what a value says of itself, without the indents of a screen."""
    return "\n".join(row.strip() for row in str(thing).splitlines())


# ---- Systems and demands in words, for the report page.


def describe_system(system: control.StateSpace) -> str:
    """Return a system in one line."""
    kind = f"sampled at {1 / timebase(system):g} Hz" if timebase(system) else "continuous"
    return f"{system.nstates} states, {kind}"


def describe_roots(roots: np.ndarray, dt: float) -> str:
    """Return poles or zeros as frequency and damping, those at the origin of s counted apart."""
    if not roots.size:
        return "none"
    s = to_s_plane(roots, dt)
    text = []
    for root in sorted(s[s.imag >= -1e-9 * np.abs(s)], key=abs):
        size = abs(root)
        if not np.isfinite(size):
            text.append("z = 0")
        elif size < 1e-6:
            text.append("0 Hz (integrator)")
        elif abs(root.imag) < 1e-9 * size:
            text.append(f"{size / 2 / np.pi:.4g} Hz" + (" (unstable side)" if root.real > 0 else ""))
        else:
            text.append(f"{size / 2 / np.pi:.4g} Hz, damping {round(-root.real / size, 6) + 0.0:.3g}")
    return "; ".join(text)


def describe_demand(w_P: Weight) -> str:
    """Return a performance weight as what it allows of |S|."""
    w_P = state_space("w_P", w_P)
    omega = np.geomspace(1e-3, 1e6, 4000)
    if timebase(w_P):
        omega = omega[omega * timebase(w_P) < np.pi]
    size = np.abs(response(w_P, omega))
    above = np.flatnonzero(size >= 1)
    at = f", |S| below one up to {format_hertz(omega[above[-1]])}" if above.size else ""
    return f"|S| at most {1 / size[0]:.3g} at low and {1 / size[-1]:.3g} at high frequency{at}"


def render_page(**content: object) -> str:
    """Return the HTML text."""
    from jinja2 import Environment, StrictUndefined

    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    template = files("robust.reports").joinpath("page.html.jinja").read_text(encoding="utf-8")
    written = datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %Z")
    return environment.from_string(template).render(**content, written=written)
