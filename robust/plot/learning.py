"""Pictures of iterative learning control: factor per trial over frequency, error over trials."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nlfrf._base.arguments import require_kind, require_real_array
from nlfrf._base.axes import axes_or_new, finish_axes
from robust.plot.style import COLOR, mark_band, to_hertz
from robust.synthesis.learning import Learning

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def plot_contraction(learning: Learning, *, ax: Axes | None = None) -> Axes:
    """Plot the factor of the error per trial over frequency, with Q and the bound of the final
    error.

    Parameters
    ----------
    learning : Learning
        From `design_learning`.
    ax : matplotlib Axes, optional
        Where to draw; a new figure by default.
    """
    require_kind("learning", learning, Learning)
    ax, f = axes_or_new(ax), to_hertz(learning.omega)
    ax.plot(
        f,
        learning.contraction(learning.omega),
        "-",
        lw=1.8,
        color=COLOR["limit"],
        label="factor per trial",
    )
    ax.plot(f, learning.Q(learning.omega), "--", lw=1.2, color=COLOR["radius"], label="Q")
    ax.plot(
        f,
        learning.left(learning.omega),
        "-.",
        lw=1.2,
        color=COLOR["loop"],
        label="final error, at most",
    )
    ax.axhline(
        learning.factor, lw=0.8, color=COLOR["limit"], ls=":", label=f"factor {learning.factor:.3g}"
    )
    ax.set(
        xscale="log",
        xlabel="frequency [Hz]",
        ylabel="ratio",
        title="Learning, for every plant of the set",
    )
    low, high = to_hertz(np.asarray(learning.loop.band))
    mark_band(ax, (low, high), happens=[to_hertz(2 * learning.omega_Q)], top=f[-1])
    ax.set_ylim(0, 1.1)
    return finish_axes(ax)


def plot_trials(errors: np.ndarray, *, ax: Axes | None = None) -> Axes:
    """Plot the size of the error over the trials.

    Parameters
    ----------
    errors : (trials,) ndarray
        Size of the error of each trial, the first without learning.
    ax : matplotlib Axes, optional
        Where to draw; a new figure by default.
    """
    errors, ax = require_real_array("errors", errors, ndim=1), axes_or_new(ax)
    ax.plot(
        np.arange(errors.size),
        errors / errors[0],
        "o-",
        color=COLOR["loop"],
        label="error over that of the first",
    )
    ax.set(yscale="log", xlabel="trial", ylabel="ratio", title="Error over the trials")
    return finish_axes(ax)
