"""Axes, legends and decibels for the pictures of both packages."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from nlfrf._base.files import PICTURE_SIGNATURE, Role, write_atomically

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.typing import ColorType

#: Axes as returned by `plt.subplots`: one, or several.
AxesLike: TypeAlias = "Axes | list[Axes] | tuple[Axes, ...] | np.ndarray"
_TITLE_LETTERS, _SMALL_LETTERS = 10.0, 16.0  # letters of a title per inch, large and small
_LETTER_SIZE = 15.0  # letters of a legend per inch; a marker counts as _MARKER_SIZE
_MARKER_SIZE = 6
_DEPTH_DB = 20.0  # [dB] below a curve, lower edge of a band that extends to zero
_HEADROOM = 6.0  # [dB] least free space above and below the curves of a picture
_MAX_GROWTH = 1.25  # growth of the width of axes by a layout


def _listed_axes(ax: AxesLike | None) -> list[Axes]:
    """Return one Axes, or those of any array of them, as a list."""
    return list(np.asarray(ax, dtype=object).ravel())


def _single_axes(ax: AxesLike | None, n_axes: int = 1) -> Axes | None:
    """Return one Axes from a result of `plt.subplots`; refuse an array of several, as the picture
    draws on one.
    """
    if ax is None:
        return None
    given = _listed_axes(ax)
    if len(given) == 1:
        return given[0]
    if n_axes > 1:
        also = f", or {n_axes} of them"
    else:
        also = ""
    raise ValueError(
        f"ax must be one Axes{also}, got an array of {len(given)}; give one of them, such as"
        " ax.flat[0]"
    )


def axes_or_new(ax: AxesLike | None) -> Axes:
    """Return the given axes, or those of a new figure."""
    given = _single_axes(ax)
    if given is not None:
        return given
    from matplotlib import pyplot as plt

    return plt.subplots(figsize=(8, 4.5), layout="constrained")[1]


def bode_axes(ax: AxesLike | None) -> tuple[Axes, Axes]:
    """Return axes for magnitude and phase: the two given ones, or two in the place of one, or in a
    new figure.
    """
    if len(given := _listed_axes(ax)) == 2:
        return given[0], given[1]
    whole = _single_axes(ax, 2)
    if whole is None:
        from matplotlib import pyplot as plt

        whole = plt.figure(figsize=(8, 6.5), layout="constrained").add_subplot()
    figure = whole.figure
    spec = whole.get_subplotspec()
    place = whole.get_position()
    whole.remove()
    if spec is not None:
        rows = spec.subgridspec(2, 1, height_ratios=(1.5, 1))
        top = figure.add_subplot(rows[0])
        bottom = figure.add_subplot(rows[1], sharex=top)
    else:
        low = 0.38 * place.height
        top = figure.add_axes((place.x0, place.y0 + low, place.width, place.height - low))
        bottom = figure.add_axes((place.x0, place.y0, place.width, low - 0.03), sharex=top)
    top.tick_params(which="both", labelbottom=False)
    return top, bottom


def matrix_axes(
    ax: AxesLike | None, rows: Sequence[str], columns: Sequence[str]
) -> tuple[np.ndarray, Axes]:
    """Return (n, m) axes of a matrix, in the place of the given ones or in a new figure, and axes
    for their legend.

    Rows have names at their left end, columns at their top: outputs and inputs. A row shares its
    vertical axis.
    """
    n, m = len(rows), len(columns)
    whole = _single_axes(ax)
    if whole is None:
        from matplotlib import pyplot as plt

        whole = plt.figure(
            figsize=(1.6 + 2.8 * m, 1.4 + 2.0 * n), layout="constrained"
        ).add_subplot()
    figure = whole.figure
    spec, place = whole.get_subplotspec(), whole.get_position()
    whole.remove()
    if spec is None:
        inside = None
    else:
        inside = spec.subgridspec(n + 1, m, height_ratios=[1.0] * n + [1e-3])
    wide, high = place.width / m, place.height / n
    made = np.empty((n, m), dtype=object)
    for j, i in np.ndindex(n, m):
        where = (place.x0 + i * wide, place.y0 + (n - 1 - j) * high, 0.93 * wide, 0.86 * high)
        shared = {"sharex": made[0, 0], "sharey": made[j, 0]}  # None for the first axes
        if inside is None:
            one = figure.add_axes(where, **shared)
        else:
            one = figure.add_subplot(inside[j, i], **shared)
        one.tick_params(which="both", labelbottom=j == n - 1, labelleft=i == 0)
        one.set_title(columns[i] if j == 0 else "", fontsize="medium")
        one.set_ylabel(rows[j] if i == 0 else "")
        made[j, i] = one
    under_all = (place.x0, place.y0, place.width, 1e-3)
    if inside is None:
        foot = figure.add_axes(under_all)
    else:
        foot = figure.add_subplot(inside[n, :])
    foot.set_axis_off()
    return made, foot


def finish_matrix(made: np.ndarray, foot: Axes, across: str) -> np.ndarray:
    """Draw grids, the label of the horizontal axis in the lowest row, and one legend for all below
    it.
    """
    entries: dict[str, Artist] = {}
    for one in made.flat:
        _draw_grid(one)
        for handle, label in zip(*one.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    for one in made[-1]:
        one.set_xlabel(across)
    if entries:
        _legend_below(
            foot,
            list(entries.values()),
            labels=list(entries),
            down=-34 if foot.get_subplotspec() is None else 0,
        )
    return made


def finish_axes(ax: Axes) -> Axes:
    """Draw grid and legend, alike in every picture; the title fits, and the legend is below the
    axes.
    """
    _draw_grid(ax)
    _fit_title(ax)
    handles, labels = ax.get_legend_handles_labels()
    if handles:
        _legend_below(ax, handles, labels=labels)
    return ax


def _fit_title(ax: Axes) -> None:
    """Set a title that is wider than the axes in small letters, and wrap it: a figure cuts off what
    sticks out.
    """
    wide = ax.get_position().width * ax.figure.figure.get_figwidth()
    if len(ax.get_title()) > wide * _TITLE_LETTERS:
        ax.set_title(fill(ax.get_title(), int(wide * _SMALL_LETTERS)), fontsize="small")


def _draw_grid(ax: Axes) -> None:
    """Draw a grid, with plain numbers on a logarithmic axis."""
    ax.grid(alpha=0.3, which="both", lw=0.5)
    if ax.get_xscale() == "log":
        _plain_numbers(ax)


def _legend_below(
    ax: Axes, handles: Sequence[Artist], *, labels: list[str], down: float = -34
) -> None:
    """Draw a legend below the axes, at a distance `down` [points]."""
    from matplotlib.transforms import offset_copy

    ax.legend(
        handles,
        labels,
        fontsize="small",
        loc="upper center",
        bbox_to_anchor=(0.5, 0.0),
        bbox_transform=offset_copy(ax.transAxes, ax.figure.figure, y=down, units="points"),
        ncols=_legend_columns(ax, labels),
        frameon=False,
        borderaxespad=0.2,
        columnspacing=1.4,
    )


def _plain_numbers(ax: Axes) -> None:
    """Label a logarithmic axis with plain numbers, 20 and not 2e1."""
    from matplotlib.ticker import FuncFormatter

    low, high = ax.get_xlim()
    between = (2, 5) if high < 300 * low else ()
    ax.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    ax.xaxis.set_minor_formatter(
        FuncFormatter(
            lambda x, _: (
                f"{x:g}" if round(x / 10 ** np.floor(np.log10(x) + 1e-9)) in between else ""
            )
        )
    )


def join_labels(bottom: Axes, top: Axes) -> None:
    """Add the labels of the upper axes of a pair to the legend of the lower ones, each once."""
    existing = set(bottom.get_legend_handles_labels()[1])
    for handle, label in zip(*top.get_legend_handles_labels(), strict=True):
        if label not in existing:
            if hasattr(handle, "get_marker"):
                bottom.plot([], [], label=label, **_line_style(handle))
            else:
                bottom.fill_between([], [], [], label=label, **_line_style(handle))
        handle.set_label(f"_{label}")


def _line_style(
    handle: Artist,
) -> dict[str, Any]:  # values of many types, like the arguments of a drawing
    """Return the style of a curve or a band, for its sample in a legend."""
    if hasattr(handle, "get_linestyle") and hasattr(handle, "get_marker"):
        kept = (
            "color",
            "linestyle",
            "linewidth",
            "marker",
            "markersize",
            "markerfacecolor",
            "alpha",
        )
        return {name: getattr(handle, f"get_{name}")() for name in kept}
    face, edge, hatch = (
        getattr(handle, f"get_{name}")() for name in ("facecolor", "edgecolor", "hatch")
    )
    drawn = {
        "facecolor": face[0] if len(face) else "none",
        "edgecolor": edge[0] if len(edge) else "none",
    }
    return drawn | {"hatch": hatch, "linewidth": 0}


def _legend_columns(ax: Axes, labels: list[str]) -> int:
    """Return the number of legend columns that fit below the axes."""
    available = ax.get_position().width * ax.figure.figure.get_figwidth() * _LETTER_SIZE
    if ax.figure.get_layout_engine() is not None:
        available *= _MAX_GROWTH
    widest = max(map(len, labels)) + _MARKER_SIZE
    return int(np.clip(available // widest, 1, len(labels)))


def height_below(ax: Axes) -> float:
    """Return the height [inch] of axis label and legend below the axes."""
    legend = ax.get_legend()
    if legend is None:
        return 0.5
    rows = -(-len(legend.get_texts()) // max(legend._ncols, 1))  # type: ignore[attr-defined]  # there is no public attribute
    return 0.6 + 0.19 * rows


def add_note(ax: Axes, text: str) -> None:
    """Write a remark in small letters inside the axes, at the bottom."""
    ax.text(0.01, 0.015, text, transform=ax.transAxes, fontsize="small", color="0.35", va="bottom")


def to_decibel(x: np.ndarray) -> np.ndarray:
    """Return an amplitude in decibels; nan for zero."""
    x = np.asarray(x, dtype=float)
    return np.asarray(20 * np.log10(np.where(x > 0, x, np.nan)))


def write_pictures(
    path: Path, pictures: Sequence[tuple[Callable[..., object], object]], *, height: float = 4.8
) -> None:
    """Draw pictures (function, argument) side by side into one file of this height [inch], without
    a screen.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, places = plt.subplots(
        1, len(pictures), figsize=(7.5 * len(pictures), height), layout="constrained"
    )
    for ax, (plot, content) in zip(np.atleast_1d(places), pictures, strict=True):
        plot(content, ax=ax)
    if path.suffix.lstrip(".").lower() not in figure.canvas.get_supported_filetypes():
        raise ValueError(
            f"picture must be a file that matplotlib writes (.png, .pdf, .svg), got {path}"
        )
    save_figure(path, figure, dpi=130)
    plt.close(figure)


def save_figure(path: Path, figure: Figure, *, dpi: int, role: Role = Role.NAMED) -> None:
    """Write a figure, with a signature in the formats that have one."""
    kind = path.suffix.lstrip(".").lower()
    existing = {
        "png": "Software",
        "pdf": "Creator",
        "svg": "Creator",
        "eps": "Creator",
        "ps": "Creator",
    }.get(kind)
    if existing is None:
        metadata = None
    else:
        metadata = {existing: PICTURE_SIGNATURE}
    write_atomically(
        path,
        lambda temporary: figure.savefig(temporary, format=kind, dpi=dpi, metadata=metadata),
        role=role,
    )


def lower_edge(size: np.ndarray, low: np.ndarray) -> np.ndarray:
    """Return the lower edge of a band of gains on a logarithmic axis, at most _DEPTH_DB below the
    curve (for zero).
    """
    return np.maximum(low, 10 ** (-_DEPTH_DB / 20) * size)


def gain_band(
    ax: Axes,
    f: np.ndarray,
    size: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    *,
    color: ColorType,
    label: str,
    over: str,
    alpha: float = 0.35,
) -> None:
    """Draw gains `low` to `high` as a band in decibels around the curve `size`.

    Where `low` is not above zero, the band has no lower edge: it ends _DEPTH_DB below the curve, is
    hatched, and `over` explains this in the legend.
    """
    edge, top = to_decibel(lower_edge(size, low)), to_decibel(np.minimum(high, 1e3 * size))
    ax.fill_between(f, edge, top, color=color, alpha=alpha, lw=0, label=label)
    endless = ~(low > 0) & (size > 0)
    if endless.any():
        hatched = endless.copy()  # hatched up to the next line on both sides
        hatched[1:] |= endless[:-1]
        hatched[:-1] |= endless[1:]
        ax.fill_between(
            f,
            edge,
            top,
            where=hatched,
            label=over,
            facecolor="none",
            edgecolor=color,
            hatch="/////",
            lw=0,
        )


def follow_lines(ax: Axes) -> None:
    """Fit the vertical axis to the curves and points, and not to the bands around them."""
    drawn_values = [np.asarray(line.get_ydata(), dtype=float) for line in ax.get_lines()]
    if drawn_values:
        values = np.concatenate([y[np.isfinite(y)] for y in drawn_values])
    else:
        values = np.zeros(0)
    if values.size:
        free = max(_HEADROOM, 0.08 * float(np.ptp(values)))
        ax.set_ylim(float(values.min()) - free, float(values.max()) + _HEADROOM)


def phase_band(G: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Return (W,) half the phase width [deg] of a disc around G; nan if it contains zero, and so
    every phase.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = radius / np.abs(G)
        return np.degrees(np.arcsin(np.where(ratio < 1, ratio, np.nan)))
