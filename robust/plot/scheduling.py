"""Picture of the gain of an `LpvModel` over frequency, at and between its operating points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nlfrf._base.arguments import require_kind
from nlfrf._base.axes import axes_or_new, finish_axes
from robust.lti.grids import structure_grid
from robust.lti.lti import response_by_channel
from robust.models.lpv import LpvModel
from robust.plot.style import to_hertz

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_BETWEEN = 5  # operating points between two that were given


def plot_schedule(model: LpvModel, *, ax: Axes | None = None) -> Axes:
    """Plot the largest gain of a scheduled controller or plant at and between its operating points.

    Parameters
    ----------
    model : LpvModel
        A controller or a plant.
    ax : matplotlib Axes, optional
        Where to draw; a new figure by default.
    """
    require_kind("model", model, LpvModel)
    ax = axes_or_new(ax)
    omega = np.unique(np.concatenate([structure_grid(model.at(p)) for p in model.points]))
    if model.dt:
        omega = omega[(omega > 0) & (omega <= np.pi / model.dt)]
    else:
        omega = omega[omega > 0]
    low, high = model.points[[0, -1]]
    fine = np.linspace(low, high, (_BETWEEN + 1) * (model.points.size - 1) + 1)
    for p, given in (*((p, False) for p in fine), *((p, True) for p in model.points)):
        size = np.linalg.norm(response_by_channel(model.at(p), omega), ord=2, axis=(0, 1))
        share = (p - low) / (high - low)
        if given:
            label = f"{p:g} {model.unit}".rstrip()
        else:
            label = None
        ax.plot(
            to_hertz(omega),
            size,
            lw=1.8 if given else 0.5,
            color=(0.1 + 0.8 * share, 0.3, 0.9 - 0.8 * share),
            label=label,
        )
    ax.set(
        xscale="log",
        yscale="log",
        xlabel="frequency [Hz]",
        ylabel="gain",
        title=f"At each {model.over}",
    )
    return finish_axes(ax)
