"""Axes and decibels, as every picture of both packages has them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["axes", "db", "finished"]


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
