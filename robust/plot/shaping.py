"""A picture to shape a loop in: |L| between its bounds, redrawn as the controller changes."""

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
    from matplotlib.collections import FillBetweenPolyCollection


class LoopPicture:
    """|L| of the controller at hand between the bounds of `loop_bounds`, and what the check says of it.

    Made by `plot_loop_bounds`. `update` takes the next controller, in a script or in a notebook, where a cell that ends
    in it shows the picture again.

    Fields
    ------
    ax : matplotlib Axes
        What it is drawn on.
    low, high : (W,) ndarray
        Bounds on |L|, on the lines of the model.
    report : RobustnessReport or None
        Of the last controller, without proofs.
    violations : (W,) ndarray of bool
        Lines on which the last |L| is beyond a bound.
    """

    def __init__(self, model: UncertaintyModel, w_P: Weight, delay: float, ax: Axes) -> None:
        self.model, self.w_P, self.delay, self.ax = model, w_P, delay, ax
        self.low, self.high = loop_bounds(model, w_P)
        self.report: RobustnessReport | None = None
        self.violations = np.zeros(model.omega.size, dtype=bool)
        f = to_hertz(model.omega)
        ax.axhline(0, color="0.5", lw=0.8)
        self.forbidden: list[FillBetweenPolyCollection] = []
        (self.before,) = ax.plot([], [], "-", lw=1.0, color=COLOR["noise"], label="|L| before")
        (self.line,) = ax.plot([], [], "-", lw=1.8, color=COLOR["radius"], label="|L|")
        (self.dots,) = ax.plot([], [], "o", ms=4, color=COLOR["limit"], label="beyond a bound")
        ax.set(xscale="log", xlabel="frequency [Hz]", ylabel="|L| [dB]")
        mark_band(ax, (f[0], f[-1]))
        self.fit_view(np.ones(f.size))
        self.before.set_visible(False)

    def update(self, K: Controller) -> LoopPicture:
        """Draw |L| with another controller, the last one in grey; the title says what the check says.

        Parameters
        ----------
        K : control.StateSpace, TransferFunction or float
            Controller, continuous or sampled, negative feedback.

        Returns
        -------
        LoopPicture
            Itself.
        """
        omega = self.model.omega
        report = check(self.model, K, w_P=self.w_P, delay=self.delay, certify=False)
        known = np.log(np.abs(report.curves.L))
        L = np.exp(np.interp(np.log(omega), np.log(report.curves.omega), known, right=np.nan))  # nan above Nyquist
        self.violations = (self.low > L) | (self.high < L)
        self.before.set_data(*self.line.get_data())
        self.before.set_visible(self.report is not None)
        self.line.set_data(
            to_hertz(report.curves.omega), to_decibel(np.abs(report.curves.L))
        )  # on both sides of the band too
        self.dots.set_data(to_hertz(omega[self.violations]), to_decibel(L[self.violations]))
        self.report = report
        self.fit_view(L)
        self.ax.set_title(describe_check(report), fontsize="medium")
        for line, label in ((self.before, "|L| before"), (self.dots, "beyond a bound")):
            line.set_label(label if line.get_visible() and np.size(line.get_xdata()) else None)
        finish_axes(self.ax)
        self.ax.figure.canvas.draw_idle()
        return self

    def fit_view(self, L: np.ndarray) -> None:
        """The view around |L| and the bounds, and the forbidden regions up to its edges."""
        shown = np.concatenate([L, self.low[(self.low > 0) & (self.low < np.inf)], self.high[self.high < np.inf]])
        shown = shown[(shown > 0) & np.isfinite(shown)]
        floor, ceiling = (
            max(float(to_decibel(shown.min())) - 10, -120.0),
            min(float(to_decibel(shown.max())) + 10, 120.0),
        )
        low = np.where(self.low > 0, np.clip(to_decibel(np.where(self.low > 0, self.low, 1.0)), floor, ceiling), floor)
        high = np.where(self.high < np.inf, to_decibel(np.where(self.high > 0, self.high, 1e-300)), ceiling)
        f = to_hertz(self.model.omega)
        for patch in self.forbidden:
            patch.remove()
        self.forbidden = [
            self.ax.fill_between(f, bottom, top, color=COLOR[color], alpha=0.3, lw=0, label=label)
            for bottom, top, color, label in (
                (floor, low, "loop", "too low for performance"),
                (np.clip(high, floor, ceiling), ceiling, "limit", "too high for the uncertainty"),
            )
        ]
        self.ax.set_ylim(floor, ceiling)


def describe_check(report: RobustnessReport) -> str:
    """Return stability, worst demand and crossover in a line."""
    if not report.nominally_stable:
        return "unstable" if report.verdict is Verdict.NOT_ROBUST else "stability is not decided"
    over = np.flatnonzero(np.abs(report.curves.L) > 1)
    crossover = f", crossover {format_hertz(report.curves.omega[over[-1]])}" if over.size else ", no crossover"
    return f"nominally stable; max rs {np.max(report.curves.rs):.2f}, max rp {np.max(report.curves.rp):.2f}{crossover}"


def plot_loop_bounds(
    model: UncertaintyModel, w_P: Weight, K: Controller | None = None, *, delay: float = 0.0, ax: Axes | None = None
) -> LoopPicture:
    """Plot |L| between its bounds, to shape it by hand: change the controller, `update`, look.

    Parameters
    ----------
    model, w_P
        As in `loop_bounds`.
    K : control.StateSpace, TransferFunction or float, optional
        Controller to begin with; 1 when not given.
    delay : float
        Computation delay [s].
    ax : matplotlib Axes, optional
        Where to draw; a new figure when not given.

    Returns
    -------
    LoopPicture
        With `update(K)`, `ax`, `report` and `violations`.
    """
    return LoopPicture(model, w_P, delay, axes_or_new(ax)).update(1.0 if K is None else K)
