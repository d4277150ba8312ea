"""Limits of a tuned design over frequency, before and after."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nlfrf._base.arguments import short_form
from nlfrf._base.axes import axes_or_new, finish_axes
from robust.plot.style import COLOR, to_hertz

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: One colour for each limit, also distinguishable for colour-blind readers.
_COLOURS = (
    COLOR["loop"],
    COLOR["limit"],
    COLOR["weight"],
    COLOR["misfit"],
    COLOR["level"],
    COLOR["noise"],
)
_PLANT_STYLES = ("-", "--", "-.", ":")


def plot_limits(design: Any, *, ax: Axes | None = None) -> Axes:
    """Plot the ratio of every limit to its bound over frequency, before and after tuning.

    Each limit has a colour, and each plant a line style. Thin lines show the ratios with the given
    blocks. A dot marks the maximum of each limit; it is filled for a hard limit. The line at one is
    the bound.

    Parameters
    ----------
    design : TunedDesign
        Result of `robust.tune`, with a stable loop.
    ax : matplotlib Axes, optional
        Where to draw; a new figure by default.
    """
    if not hasattr(design, "limits") or not hasattr(design, "spread"):
        raise ValueError(f"design must be a TunedDesign of robust.tune, got {short_form(design)}")
    if not design.limits:
        raise ValueError(
            "design must have a stable loop, because the limits of an unstable loop are"
            " unknown, got an unstable one"
        )
    ax = axes_or_new(ax)
    ordered = sorted(design.limits, key=lambda one: (not one.hard, one.plant))
    colours = {
        id(limit): _COLOURS[k % len(_COLOURS)]
        for k, limit in enumerate({id(o.limit): o.limit for o in ordered}.values())
    }
    for one in ordered:
        colour, style = colours[id(one.limit)], _PLANT_STYLES[one.plant % len(_PLANT_STYLES)]
        if len(design.plant.models) > 1:
            of_plant = f", {one.plant_name}"
        else:
            of_plant = ""
        label = f"{'hard' if one.hard else 'soft'} {one.limit}{of_plant}"
        f = to_hertz(one.omegas)
        ax.plot(
            f,
            np.where(np.isfinite(one.before), one.before, np.nan),
            style,
            color=colour,
            lw=0.7,
            alpha=0.6,
        )
        ax.plot(
            f,
            np.where(np.isfinite(one.curve), one.curve, np.nan),
            style,
            color=colour,
            lw=1.8,
            label=label,
        )
        place = float(np.clip(to_hertz(one.omega), f[0], f[-1]))
        ax.plot([place], [one.ratio], "o", color=colour, mfc=colour if one.hard else "none", ms=6)
    ax.axhline(1.0, color=COLOR["radius"], lw=1.0)
    ax.set(xscale="log", yscale="log", xlabel="frequency [Hz]", ylabel="gain over bound")
    ax.set_title("Limits before (thin) and after tuning: " + ("met" if design.met else "not met"))
    top = max(
        float(np.nanmax(np.where(np.isfinite(one.curve), one.curve, np.nan))) for one in ordered
    )
    ax.set_ylim(1e-3, max(3.0, 2 * top))
    return finish_axes(ax)
