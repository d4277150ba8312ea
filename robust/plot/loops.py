"""Pictures of loops and verdicts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nlfrf._base.arguments import label_with_unit, require_integer, require_kind
from nlfrf._base.axes import axes_or_new, finish_axes, to_decibel
from robust.analysis.family import LoopFamily
from robust.analysis.loop_gains import LoopGains
from robust.analysis.report import RobustnessReport
from robust.analysis.step import StepResponse
from robust.plot.style import COLOR, fit_vertical_axis, mark_band, to_hertz

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def plot_loop(report: RobustnessReport | LoopGains, *, ax: Axes | None = None) -> Axes:
    """Plot loop gain, sensitivity and complementary sensitivity of the nominal loop.

    For several channels the largest and smallest singular values of L, S and T are drawn.

    Parameters
    ----------
    report : RobustnessReport, or LoopGains for several channels
        From `check`, or from `loop_gains`.
    ax : matplotlib Axes, optional
        Where to draw; a new figure by default.
    """
    require_kind("report", report, RobustnessReport, LoopGains)
    ax = axes_or_new(ax)
    if isinstance(report, LoopGains):
        return _draw_gains(ax, report)
    _require_one_loop(report)
    f = to_hertz(report.curves.omega)
    ax.plot(
        f,
        to_decibel(np.abs(report.curves.L)),
        "-",
        lw=1.8,
        color=COLOR["radius"],
        label="|L| = |G K|",
    )
    ax.plot(f, to_decibel(np.abs(report.curves.S)), "-", lw=1.4, color=COLOR["loop"], label="|S|")
    ax.plot(f, to_decibel(np.abs(report.curves.T)), "-.", lw=1.4, color=COLOR["limit"], label="|T|")
    if report.curves.w_P is not None:
        ax.plot(
            f, -to_decibel(report.curves.w_P), "--", lw=1.2, color=COLOR["loop"], label="1/|w_P|"
        )
    ax.axhline(0, color="0.5", lw=0.8)
    ax.set(xscale="log", xlabel="frequency [Hz]", ylabel="magnitude [dB]", title="Nominal loop")
    seen = report.classical
    _mark_measured_band(
        ax,
        report.curves.omega,
        report.given.band,
        seen.crossover,
        seen.bandwidth,
        seen.omega_phase,
        seen.omega_gain,
    )
    fit_vertical_axis(ax)
    return finish_axes(ax)


def _draw_gains(ax: Axes, gains: LoopGains) -> Axes:
    """Draw `plot_loop` for several channels."""
    f = to_hertz(gains.omega)
    for name, color, style in (("L", "radius", "-"), ("S", "loop", "--"), ("T", "limit", "-.")):
        curves = getattr(gains, name)
        ax.fill_between(
            f, to_decibel(curves[-1]), to_decibel(curves[0]), color=COLOR[color], alpha=0.15, lw=0
        )
        ax.plot(
            f, to_decibel(curves[0]), style, lw=1.6, color=COLOR[color], label=f"{name}, largest"
        )
        ax.plot(
            f, to_decibel(curves[-1]), style, lw=0.7, color=COLOR[color], label=f"{name}, smallest"
        )
    ax.axhline(0, color="0.5", lw=0.8)
    title = "Nominal loop" if gains.stable else "Nominal loop, not stable"
    ax.set(xscale="log", xlabel="frequency [Hz]", ylabel="singular values [dB]", title=title)
    if gains.band is None:
        low, high = f[0], f[-1]
    else:
        low, high = to_hertz(gains.band)
    mark_band(ax, (low, high), top=f[-1])
    fit_vertical_axis(ax)
    return finish_axes(ax)


def _require_one_loop(report: RobustnessReport) -> None:
    """Refuse a report by the structured singular value, which has no curves for one loop."""
    if not report.is_single:
        raise ValueError(
            "report must be of a loop with one channel for this picture, got several channels:"
            " give the result of loop_gains to plot_loop"
        )


def _mark_measured_band(
    ax: Axes, omega: np.ndarray, band: np.ndarray | None, *happens: float
) -> None:
    """Mark the measured band of curves over omega [rad/s], and frequencies [rad/s] of events."""
    f = to_hertz(omega)
    if band is None:
        low, high = f[0], f[-1]
    else:
        low, high = to_hertz(np.asarray(band))
    # a plant known on its lines only has nothing above
    if f[-1] > high * (1 + 1e-9):
        top = f[-1]
    else:
        top = np.inf
    mark_band(ax, (low, high), happens=[to_hertz(w) for w in happens], top=top)


def plot_check(report: RobustnessReport, *, ax: Axes | None = None) -> Axes:
    """Plot robust stability, nominal and robust performance over frequency; all must stay below
    one.

    Parameters
    ----------
    report : RobustnessReport
        Report of `check` or `check_structure`. For several uncertainties or channels, bounds of mu
        are drawn.
    ax : matplotlib Axes, optional
        Where to draw; a new figure by default.
    """
    require_kind("report", report, RobustnessReport)
    ax, single = axes_or_new(ax), report.is_single
    there = report.curves.omega > 0
    f = to_hertz(report.curves.omega[there])
    curves = (
        (
            report.curves.rs,
            "robust stability" + ", upper bound of mu" * (not single),
            COLOR["limit"],
            "-",
        ),
        (report.curves.np_, "nominal performance |w_P S|", COLOR["loop"], "--"),
        (report.curves.rp, "robust performance", COLOR["radius"], "-" if single else "--"),
    )
    if single or report.given.band is not None:
        _mark_measured_band(
            ax,
            report.curves.omega,
            report.given.band,
            report.margins.omega_rs,
            report.margins.omega_rp,
        )
        inside = (f >= ax.get_xlim()[0]) & (f <= ax.get_xlim()[1])
    else:
        inside = f > 0
    drawn = [
        curve[there][np.isfinite(curve[there]) & (curve[there] > 0) & inside]
        for curve, *_ in curves
    ]
    for curve, label, color, style in curves:
        if np.isfinite(curve).any():
            ax.plot(f, curve[there], style, lw=1.6, color=color, label=label)
    if single and np.isfinite(report.margins.rs) and report.margins.rs > 0:
        ax.plot(
            to_hertz(report.margins.omega_rs),
            1 / report.margins.rs,
            "o",
            color=COLOR["limit"],
            label="limits the stability margin",
        )
    if np.isfinite(report.margins.broken):
        label = "reached by a perturbation that was found"
        ax.axhline(1 / report.margins.broken, color=COLOR["loop"], lw=1, ls=":", label=label)
        drawn.append(np.array([1 / report.margins.broken]))
    ax.axhline(1, color="0.3", lw=1, ls=":" if single else "-", label="limit")
    ax.set(
        xscale="log",
        yscale="log",
        xlabel="frequency [Hz]",
        ylabel="must stay below 1",
        title=f"Verdict on stability: {report.verdict}",
    )
    values = np.concatenate(drawn)
    if values.size:  # the relevant part is around one; curves may leave the picture below
        ax.set_ylim(max(1e-3, values.min() * 0.8), float(np.clip(1.5 * values.max(), 2.0, 1e2)))
    else:
        ax.text(0.5, 0.5, report.reason, transform=ax.transAxes, ha="center", wrap=True)
    return finish_axes(ax)


def plot_nyquist(report: RobustnessReport, *, n_discs: int = 25, ax: Axes | None = None) -> Axes:
    """Plot the nominal L in the complex plane, with discs of the set around the crossover.

    Parameters
    ----------
    report : RobustnessReport
    n_discs : int
        Number of discs.
    ax : matplotlib Axes, optional
        Where to draw; a new figure by default.
    """
    from matplotlib.patches import Circle

    require_kind("report", report, RobustnessReport)
    _require_one_loop(report)
    n_discs = require_integer("n_discs", n_discs, least=0)
    ax = axes_or_new(ax)
    L = report.curves.L
    reach = 2.5
    ax.plot(L.real, L.imag, "-", lw=1.6, color=COLOR["radius"], label="nominal L")
    ax.plot(L.real, -L.imag, "-", lw=0.7, color=COLOR["noise"], label="negative frequencies")
    centre, radius = report.discs
    near = np.flatnonzero((np.abs(L + 1) < reach) & np.isfinite(radius) & (radius > 0))
    if near.size:
        path = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(L[near])))])
        for k in near[
            np.unique(
                np.searchsorted(path, np.linspace(0, path[-1], n_discs)).clip(0, near.size - 1)
            )
        ]:
            touched = abs(centre[k] + 1) <= radius[k]
            if touched:
                color = COLOR["limit"]
            else:
                color = COLOR["weight"]
            ax.add_patch(
                Circle((centre[k].real, centre[k].imag), radius[k], fill=False, lw=0.8, color=color)
            )
        ax.plot([], [], "o", ms=9, mfc="none", color=COLOR["weight"], label="discs of the set")
        if np.any(np.abs(centre[near] + 1) <= radius[near]):
            ax.plot([], [], "o", ms=9, mfc="none", color=COLOR["limit"], label="discs over -1")
    ax.plot([-1], [0], "+", ms=12, mew=2, color=COLOR["limit"], label="-1")
    ax.set(
        xlim=(-1 - reach, reach - 1),
        ylim=(-reach, reach),
        aspect="equal",
        xlabel="Re L",
        ylabel="Im L",
        title="L with the discs of the set",
    )
    return finish_axes(ax)


def plot_family(family: LoopFamily, *, ax: Axes | None = None) -> Axes:
    """Plot sensitivities of loops with random plants of a set, and the worst case of the set.

    Parameters
    ----------
    family : LoopFamily
        From `sample_loops`.
    ax : matplotlib Axes, optional
        Where to draw; a new figure by default.
    """
    require_kind("family", family, LoopFamily)
    ax = axes_or_new(ax)
    f = to_hertz(family.omega)
    for k, (S, stable) in enumerate(zip(family.S, family.stable, strict=True)):
        if stable:
            color = COLOR["noise"]
        else:
            color = COLOR["limit"]
        ax.plot(
            f,
            to_decibel(np.abs(S)),
            "-",
            lw=0.5,
            color=color,
            alpha=0.6,
            label="plants of the set" if k == 0 else None,
        )
    ax.plot(
        f,
        to_decibel(np.abs(family.nominal)),
        "-",
        lw=1.8,
        color=COLOR["radius"],
        label="nominal |S|",
    )
    ax.plot(
        f,
        to_decibel(np.where(np.isfinite(family.worst), family.worst, np.nan)),
        "--",
        lw=1.4,
        color=COLOR["limit"],
        label="worst case of the set",
    )
    unstable = int(np.sum(~family.stable))
    if unstable:
        title = f"{family.stable.size} plants of the set, {unstable} of them unstable"
    else:
        title = f"{family.stable.size} plants of the set"
    ax.set(xscale="log", xlabel="frequency [Hz]", ylabel="|S| [dB]", title=title)
    finite = np.where(np.isfinite(family.worst), family.worst, np.max(np.abs(family.nominal)))
    _mark_measured_band(ax, family.omega, family.band, family.omega[np.argmax(finite)])
    fit_vertical_axis(ax, most=60.0)
    return finish_axes(ax)


def plot_step(
    step: StepResponse, worst: StepResponse | None = None, *, unit: str = "", ax: Axes | None = None
) -> Axes:
    """Plot the response of a loop to a step of its reference, with nominal and worst plant.

    For several outputs, the output whose reference steps is a thick line, and the others are thin.

    Parameters
    ----------
    step : StepResponse
        From `step_response`, for the nominal plant.
    worst : StepResponse, optional
        Response with the worst plant; `step.worst` by default.
    unit : str
        Unit of y.
    ax : matplotlib Axes, optional
        Where to draw; a new figure by default.
    """
    require_kind("step", step, StepResponse)
    ax, worst = axes_or_new(ax), step.worst if worst is None else worst
    ax.axhline(step.final, color="0.5", lw=0.8, label="final value")
    end = max(one.t[-1] for one in (step, worst) if one is not None)
    drawn = (
        (worst, "worst plant", COLOR["limit"], "--"),
        (step, "nominal plant", COLOR["radius"], "-"),
    )
    for one, label, color, style in drawn:
        if one is not None:
            t, rows = np.append(one.t, end), np.atleast_2d(one.y)
            for j, row in enumerate(rows):
                steps = j == one.reference
                if steps:
                    legend = f"{label}: overshoot {100 * one.overshoot:.0f} %"
                else:
                    legend = None
                ax.plot(
                    t,
                    np.append(row, row[-1]),
                    style,
                    lw=1.6 if steps else 0.8,
                    color=color,
                    label=legend,
                )
    ax.set(
        xlabel="time [s]",
        ylabel=label_with_unit("y", unit, "unit of y"),
        title="A step of the reference by one unit of y",
    )
    return finish_axes(ax)
