"""Axes and decibels, as every picture of both packages has them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nlfrf.shared.whole_files import write_whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["axes", "db", "finished", "write_pictures"]


def axes(ax: Axes | None) -> Any:
    """The axes given, or those of a new figure."""
    if ax is not None:
        return ax
    from matplotlib import pyplot as plt

    return plt.subplots(figsize=(8, 4.5), layout="constrained")[1]


def finished(ax: Any) -> Any:
    """Grid and legend, the same in every picture."""
    ax.grid(alpha=0.3, which="both", lw=0.5)
    if ax.get_legend_handles_labels()[0]:
        ax.legend(fontsize="small", loc="best", framealpha=0.85)
    return ax


def db(x: np.ndarray) -> np.ndarray:
    """Amplitude in decibels; nan where it is zero."""
    x = np.asarray(x, dtype=float)
    return np.asarray(20 * np.log10(np.where(x > 0, x, np.nan)))


def write_pictures(path: Path, pictures: Sequence[tuple[Callable[..., Any], Any]]) -> None:
    """Draw pictures (function, what it draws) side by side into one file, without a screen."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, places = plt.subplots(1, len(pictures), figsize=(7.5 * len(pictures), 4.8), layout="constrained")
    for ax, (plot, content) in zip(np.atleast_1d(places), pictures, strict=True):
        plot(content, ax=ax)
    kind = path.suffix.lstrip(".").lower()
    if kind not in figure.canvas.get_supported_filetypes():
        raise ValueError(f"picture must be a file that matplotlib writes (.png, .pdf, .svg), got {path}")
    write_whole(path, lambda beside: figure.savefig(beside, format=kind, dpi=130))
    plt.close(figure)
