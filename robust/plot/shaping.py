"""A picture for loop shaping: |L| between its bounds, with the result of the check."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nlfrf._base.arguments import format_hertz
from nlfrf._base.axes import axes_or_new, finish_axes, to_decibel
from robust._base.states import Verdict
from robust._base.types import Controller, Weight
from robust.analysis.bounds import loop_bounds
from robust.analysis.report import RobustnessReport
from robust.analysis.robustness import check
from robust.models.sets.model import UncertaintyModel
from robust.plot.style import COLOR, mark_band, to_hertz

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# dB: limit of the view above and below, and its margin around curve and bounds
_LEAST_VIEW = 120.0
_VIEW_MARGIN = 10.0


def plot_loop_bounds(
    model: UncertaintyModel,
    w_P: Weight,
    K: Controller = 1.0,
    *,
    delay: float = 0.0,
    ax: Axes | None = None,
) -> Axes:
    """Plot |L| with its bounds from `loop_bounds`, for manual loop shaping.

    The title contains the result of the check, without proofs. For interactive shaping use
    `robust.shaping.shape`.

    Parameters
    ----------
    model, w_P
        As in `loop_bounds`.
    K : control.StateSpace, TransferFunction or float
        Controller, continuous or sampled, negative feedback.
    delay : float
        Computation delay [s].
    ax : matplotlib Axes, optional
        Where to draw; a new figure by default.
    """
    low, high = loop_bounds(model, w_P)
    ax, omega = axes_or_new(ax), model.omega
    report = check(model, K, w_P=w_P, delay=delay, certify=False)
    known = np.log(np.abs(report.curves.L))
    L = np.exp(
        np.interp(np.log(omega), np.log(report.curves.omega), known, right=np.nan)
    )  # nan above Nyquist
    shown = to_decibel(
        np.concatenate([one[(one > 0) & np.isfinite(one)] for one in (L, low, high)])
    )
    floor = max(shown.min() - _VIEW_MARGIN, -_LEAST_VIEW)
    ceiling = min(shown.max() + _VIEW_MARGIN, _LEAST_VIEW)
    # without a bound, and where no |L| suffices, low and high are zero or infinite: they are drawn
    # at the edge of the view
    bottom, top = (
        np.clip(to_decibel(np.clip(one, 1e-300, 1e300)), floor, ceiling) for one in (low, high)
    )
    f, outside = to_hertz(omega), (low > L) | (high < L)
    ax.axhline(0, color="0.5", lw=0.8)
    ax.fill_between(
        f, floor, bottom, color=COLOR["loop"], alpha=0.3, lw=0, label="too low for performance"
    )
    ax.fill_between(
        f, top, ceiling, color=COLOR["limit"], alpha=0.3, lw=0, label="too high for the uncertainty"
    )
    curve = (
        to_hertz(report.curves.omega),
        to_decibel(np.abs(report.curves.L)),
    )  # also outside the band
    ax.plot(*curve, "-", lw=1.8, color=COLOR["radius"], label="|L|")
    if outside.any():
        label = "beyond a bound"
        ax.plot(f[outside], to_decibel(L[outside]), "o", ms=4, color=COLOR["limit"], label=label)
    ax.set(xscale="log", xlabel="frequency [Hz]", ylabel="|L| [dB]", ylim=(floor, ceiling))
    ax.set_title(_describe_check(report), fontsize="medium")
    mark_band(ax, (f[0], f[-1]))
    return finish_axes(ax)


def _describe_check(report: RobustnessReport) -> str:
    """Return stability, worst demand and crossover in one line."""
    if not report.nominally_stable:
        if report.verdict is Verdict.NOT_ROBUST:
            return "unstable"
        return "stability is not decided"
    over = np.flatnonzero(np.abs(report.curves.L) > 1)
    if over.size:
        crossover = f", crossover {format_hertz(report.curves.omega[over[-1]])}"
    else:
        crossover = ", no crossover"
    return (
        f"nominally stable; max rs {np.max(report.curves.rs):.2f}, max rp"
        f" {np.max(report.curves.rp):.2f}{crossover}"
    )
