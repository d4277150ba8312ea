"""Pictures of models and verdicts. They compute nothing beyond units; the curves come from the values."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nlfrf.plot import axes, db
from robust.lti import response, state_space
from robust.nominal import NominalFit
from robust.orders import OrderScan
from robust.report import RobustnessReport
from robust.uncertainty import UncertaintyModel
from robust.validation import Validation
from robust.worst import LoopFamily

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# told apart by colour-blind readers too; the parts of the radius as in the pictures of nlfrf
COLOR = {
    "noise": "#999999",
    "odd": "#D55E00",
    "even": "#0072B2",
    "misfit": "#CC79A7",
    "level": "#E69F00",
    "systematic": "#F0E442",
    "radius": "#000000",
    "weight": "#009E73",
    "loop": "#0072B2",
    "limit": "#D55E00",
}


def plot_weight(model: UncertaintyModel, *, ax: Axes | None = None) -> Axes:
    """The radius on the measured lines, what it is made of, and the weight over it, outside the band too.

    Parameters
    ----------
    model : UncertaintyModel
    ax : matplotlib Axes, optional
        Where to draw; a new figure when not given.

    Returns
    -------
    matplotlib Axes
    """
    ax = axes(ax)
    f = hz(model.omega)
    for name, part in model.budget().items():
        if np.any(part > 1e-3 * model.radius):
            ax.plot(f, db(part), "-", lw=0.9, color=COLOR[name], alpha=0.9, label=f"part: {name}")
    ax.plot(f, db(model.radius), ".", ms=3, color=COLOR["radius"], label="radius on the lines")
    wide = outside_too(model)
    ax.plot(hz(wide), db(np.abs(response(model.weight, wide))), "-", lw=1.8, color=COLOR["weight"], label="|weight|")
    shade(ax, model)
    ax.set(
        xscale="log",
        ylim=(db(model.radius.min()) - 25, None),
        xlabel="frequency [Hz]",
        ylabel=f"radius, {model.form} [dB]",
        title=f"Uncertainty weight of order {model.weight.nstates}; {model.extrapolation}",
    )
    ax.title.set_fontsize("medium")
    return finished(ax)


def plot_nominal(model: UncertaintyModel, *, ax: Axes | None = None) -> Axes:
    """The nominal plant and the band of gains the set gives it; arguments as in `plot_weight`."""
    ax = axes(ax)
    omega = model.omega if model.measured_only else outside_too(model)
    G = model.at(omega)
    w = np.abs(response(model.weight, omega))
    size = np.abs(G)
    low, high = {
        "multiplicative": lambda: (size * (1 - w), size * (1 + w)),
        "additive": lambda: (size - w, size + w),
        "inverse-multiplicative": lambda: (size / (1 + w), np.where(w < 1, size / np.abs(1 - w), np.inf)),
        "inverse-additive": lambda: (
            size / (1 + w * size),
            np.where(w * size < 1, size / np.abs(1 - w * size), np.inf),
        ),
    }[model.form]()
    floor, ceiling = size.min() * 1e-2, size.max() * 1e2
    band = (db(np.clip(low, floor, ceiling)), db(np.clip(high, floor, ceiling)))
    ax.fill_between(hz(omega), *band, color=COLOR["weight"], alpha=0.25, lw=0, label="gains of the set")
    ax.plot(hz(omega), db(size), "-", lw=1.6, color=COLOR["radius"], label="nominal")
    shade(ax, model)
    ax.set(xscale="log", xlabel="frequency [Hz]", ylabel="|G| [dB]", ylim=(db(floor * 3), db(ceiling / 3)))
    return finished(ax)


def plot_loop(report: RobustnessReport, *, ax: Axes | None = None) -> Axes:
    """Loop gain, sensitivity and complementary sensitivity of the nominal loop.

    Parameters
    ----------
    report : RobustnessReport
    ax : matplotlib Axes, optional
        Where to draw; a new figure when not given.

    Returns
    -------
    matplotlib Axes
    """
    ax = axes(ax)
    f = hz(report.omega)
    ax.plot(f, db(np.abs(report.G * report.K)), "-", lw=1.8, color=COLOR["radius"], label="|L| = |G K|")
    ax.plot(f, db(np.abs(report.S)), "-", lw=1.4, color=COLOR["loop"], label="|S|")
    ax.plot(f, db(np.abs(report.T)), "-", lw=1.4, color=COLOR["limit"], label="|T|")
    if report.w_P is not None:
        ax.plot(f, -db(report.w_P), "--", lw=1.2, color=COLOR["loop"], label="1/|w_P|")
    ax.axhline(0, color="0.5", lw=0.8)
    ax.set(xscale="log", xlabel="frequency [Hz]", ylabel="magnitude [dB]", title="Nominal loop", ylim=(-80, 60))
    return finished(ax)


def plot_check(report: RobustnessReport, *, ax: Axes | None = None) -> Axes:
    """Robust stability, nominal and robust performance over frequency, all to stay below one.

    Arguments as in `plot_loop`.
    """
    ax = axes(ax)
    f = hz(report.omega)
    curves = (
        (report.rs, "robust stability", COLOR["limit"], "-"),
        (report.np_, "nominal performance |w_P S|", COLOR["loop"], "--"),
        (report.rp, "robust performance", COLOR["radius"], "-"),
    )
    drawn = np.concatenate([c[np.isfinite(c) & (c > 0)] for c, *_ in curves])
    for curve, label, color, style in curves:
        if np.isfinite(curve).any():
            ax.plot(f, curve, style, lw=1.6, color=color, label=label)
    if np.isfinite(report.margin_rs) and report.margin_rs > 0:
        ax.plot(
            hz(report.omega_rs), 1 / report.margin_rs, "o", color=COLOR["limit"], label="limits the stability margin"
        )
    ax.axhline(1, color="0.3", lw=1, ls=":")
    ax.set(
        xscale="log",
        yscale="log",
        xlabel="frequency [Hz]",
        ylabel="must stay below 1",
        title=f"Verdict on stability: {report.verdict}",
    )
    if drawn.size:  # what matters happens around one; curves run out of the picture below
        ax.set_ylim(max(1e-3, drawn.min() * 0.8), float(np.clip(1.5 * drawn.max(), 2.0, 1e2)))
    else:
        ax.text(0.5, 0.5, report.reason, transform=ax.transAxes, ha="center", wrap=True)
    return finished(ax)


def plot_budget(model: UncertaintyModel, *, ax: Axes | None = None) -> Axes:
    """What the radius is made of, in shares over frequency; arguments as in `plot_weight`."""
    ax = axes(ax)
    f = hz(model.omega)
    below = np.zeros(f.size)
    for name, part in model.budget().items():
        share = 100 * np.nan_to_num(part) / model.radius
        if np.any(share > 0.1):
            ax.fill_between(f, below, below + share, color=COLOR[name], lw=0, alpha=0.75, label=name)
            below = below + share
    ax.set(
        xscale="log",
        ylim=(0, 100),
        xlabel="frequency [Hz]",
        ylabel="share of the radius [%]",
        title="What to measure next",
    )
    return finished(ax)


def plot_fit(fit: NominalFit, *, ax: Axes | None = None) -> Axes:
    """The measured lines, the nominal model through them, and what is left; arguments as in `plot_weight`."""
    ax = axes(ax)
    f, measured = hz(fit.omega), fit.response + fit.residual
    order = np.argsort(f, kind="stable")
    ax.plot(f, db(np.abs(measured)), ".", ms=3, color=COLOR["noise"], label="measured")
    label = f"model, {fit.G.nstates} poles" + (f", delay {1e3 * fit.delay:.3g} ms" if fit.delay else "")
    ax.plot(f[order], db(np.abs(fit.response[order])), "-", lw=1.6, color=COLOR["radius"], label=label)
    ax.plot(f, db(np.abs(fit.residual)), ".", ms=2, color=COLOR["limit"], alpha=0.7, label="residual")
    title = f"Nominal model of {fit.G.nstates} poles"
    if np.isfinite(fit.expected_cost):
        ax.plot(f, db(fit.std), ".", ms=2, color=COLOR["loop"], alpha=0.7, label="standard deviation of the lines")
        title += f": cost {fit.cost / fit.expected_cost:.3g} times what scatter alone leaves"
    ax.set(xscale="log", xlabel="frequency [Hz]", ylabel="magnitude [dB]", title=title)
    return finished(ax)


def plot_validation(validation: Validation, *, ax: Axes | None = None) -> Axes:
    """How far the lines of a second record lie from the nominal, in units of their disc.

    Parameters
    ----------
    validation : Validation
        From `validate`.
    ax : matplotlib Axes, optional
        Where to draw; a new figure when not given.

    Returns
    -------
    matplotlib Axes
    """
    ax = axes(ax)
    f, out = hz(validation.omega), validation.distance > 1
    ax.plot(f[~out], validation.distance[~out], ".", ms=4, color=COLOR["weight"], label="inside")
    if out.any():
        ax.plot(f[out], validation.distance[out], "x", ms=5, color=COLOR["limit"], label="outside")
    ax.axhline(1, color="0.3", lw=1, ls=":")
    ax.set(
        xscale="log",
        yscale="log",
        xlabel="frequency [Hz]",
        ylabel="distance from the nominal, over the weight",
        title=f"{validation.n_outside} of {validation.n_lines} lines outside, {validation.n_expected:.3g} expected at "
        f"most; p = {validation.p_value:.2g}",
    )
    return finished(ax)


def plot_orders(scan: OrderScan, *, ax: Axes | None = None) -> Axes:
    """Cost and criterion over the number of poles; arguments as in `plot_weight`."""
    from matplotlib.ticker import MaxNLocator

    ax = axes(ax)
    ax.plot(scan.n_poles, scan.cost, "o-", color=COLOR["loop"], label="cost")
    ax.plot(scan.n_poles, scan.expected_cost, ":", color=COLOR["noise"], label="what scatter alone leaves")
    ax.plot(scan.n_poles, scan.criterion, "s-", color=COLOR["radius"], label="criterion")
    ax.axvline(scan.best, color=COLOR["weight"], lw=1.5, alpha=0.6, label=f"take {scan.best} poles")
    ax.set(yscale="log", xlabel="poles", ylabel="weighted squared error", title="Order scan")
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    return finished(ax)


def plot_nyquist(report: RobustnessReport, *, n_discs: int = 25, ax: Axes | None = None) -> Axes:
    """The nominal L in the complex plane, with the disc of the set at some frequencies around the crossover.

    Parameters
    ----------
    report : RobustnessReport
    n_discs : int
        How many discs to draw.
    ax : matplotlib Axes, optional
        Where to draw; a new figure when not given.

    Returns
    -------
    matplotlib Axes
    """
    from matplotlib.patches import Circle

    ax = axes(ax)
    L = report.G * report.K
    reach = 2.5
    ax.plot(L.real, L.imag, "-", lw=1.6, color=COLOR["radius"], label="nominal L")
    ax.plot(L.real, -L.imag, "-", lw=0.7, color=COLOR["noise"])
    centre, radius = report.discs
    near = np.flatnonzero((np.abs(L + 1) < reach) & np.isfinite(radius) & (radius > 0))
    if near.size:
        path = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(L[near])))])
        for k in near[np.unique(np.searchsorted(path, np.linspace(0, path[-1], n_discs)).clip(0, near.size - 1))]:
            touched = abs(centre[k] + 1) <= radius[k]
            color = COLOR["limit"] if touched else COLOR["weight"]
            ax.add_patch(Circle((centre[k].real, centre[k].imag), radius[k], fill=False, lw=0.8, color=color))
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
    return finished(ax)


def plot_family(family: LoopFamily, *, ax: Axes | None = None) -> Axes:
    """Sensitivities of loops with sampled plants, under the worst case of the set.

    Parameters
    ----------
    family : LoopFamily
        From `sample_loops`.
    ax : matplotlib Axes, optional
        Where to draw; a new figure when not given.

    Returns
    -------
    matplotlib Axes
    """
    ax = axes(ax)
    f = hz(family.omega)
    for k, (S, stable) in enumerate(zip(family.S, family.stable, strict=True)):
        color = COLOR["noise"] if stable else COLOR["limit"]
        ax.plot(f, db(np.abs(S)), "-", lw=0.5, color=color, alpha=0.6, label="plants of the set" if k == 0 else None)
    ax.plot(f, db(np.abs(family.nominal)), "-", lw=1.8, color=COLOR["radius"], label="nominal |S|")
    ax.plot(
        f,
        db(np.where(np.isfinite(family.worst), family.worst, np.nan)),
        "--",
        lw=1.4,
        color=COLOR["limit"],
        label="worst case of the set",
    )
    unstable = int(np.sum(~family.stable))
    title = (
        f"{family.stable.size} plants of the set, {unstable} of them unstable"
        if unstable
        else f"{family.stable.size} plants of the set"
    )
    ax.set(xscale="log", xlabel="frequency [Hz]", ylabel="|S| [dB]", title=title)
    return finished(ax)


def plot_bounds(
    model: UncertaintyModel, K: Any, bounds: tuple[np.ndarray, np.ndarray], *, ax: Axes | None = None
) -> Axes:
    """|L| between the bounds of `loop_bounds`, on the lines of the model.

    Parameters
    ----------
    model : UncertaintyModel
    K : control.StateSpace or TransferFunction
        Controller.
    bounds : (low, high)
        From `loop_bounds`.
    ax : matplotlib Axes, optional
        Where to draw; a new figure when not given.

    Returns
    -------
    matplotlib Axes
    """
    ax = axes(ax)
    f, (low, high) = hz(model.omega), bounds
    L = np.abs(model.at(model.omega) * response(state_space("K", K), model.omega))
    ax.plot(f, db(L), "-", lw=1.8, color=COLOR["radius"], label="|L|")
    floor, ceiling = db(L.min()) - 20, db(L.max()) + 20
    if np.any(low > 0):
        edge = np.where(low > 0, db(low), floor)
        ax.fill_between(f, floor, edge, color=COLOR["loop"], alpha=0.3, lw=0, label="too low for performance")
    if np.any(np.isfinite(high)):
        edge = np.where(np.isfinite(high), db(high), ceiling)
        ax.fill_between(f, edge, ceiling, color=COLOR["limit"], alpha=0.3, lw=0, label="too high for the uncertainty")
    ax.set(
        xscale="log",
        ylim=(floor, ceiling),
        xlabel="frequency [Hz]",
        ylabel="|L| [dB]",
        title="Loop gain and its bounds",
    )
    return finished(ax)


def outside_too(model: UncertaintyModel) -> np.ndarray:
    """Frequencies [rad/s] for a curve: the band and a decade on both sides, up to Nyquist."""
    high = model.omega[-1] * 10
    if model.weight.dt:
        high = min(high, np.pi / model.weight.dt * (1 - 1e-9))
    return np.unique(np.concatenate([np.geomspace(model.omega[0] / 10, high, 600), model.omega]))


def shade(ax: Any, model: UncertaintyModel) -> None:
    """The measured band in white, what is assumed outside it in grey."""
    low, high = ax.get_xlim()
    low, high = max(low, hz(model.omega[0]) / 12), hz(model.omega[-1]) * 12
    for start, end in ((low, hz(model.omega[0])), (hz(model.omega[-1]), high)):
        ax.axvspan(start, end, color="0.85", alpha=0.5, lw=0, zorder=0)
    top = np.inf if not model.weight.dt else 0.5 / model.weight.dt
    ax.set_xlim(hz(model.omega[0]) / 10, min(hz(model.omega[-1]) * 10, top))


def hz(omega: Any) -> Any:
    """rad/s to Hz."""
    return omega / (2 * np.pi)


def finished(ax: Any) -> Any:
    """Grid and legend, the same in every picture."""
    ax.grid(alpha=0.3, which="both", lw=0.5)
    if ax.get_legend_handles_labels()[0]:
        ax.legend(fontsize="small", loc="best", framealpha=0.85)
    return ax
