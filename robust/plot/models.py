"""Pictures of models: the nominal, its set, what the radius is made of."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nlfrf.shared.axes import axes, db, finished
from robust.modelling.nominal import NominalFit
from robust.modelling.orders import OrderScan
from robust.plot.colours import COLOR, hz
from robust.systems.lti import response
from robust.uncertain.forms import FORMS
from robust.uncertain.model import UncertaintyModel
from robust.uncertain.validation import Validation

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["plot_budget", "plot_fit", "plot_nominal", "plot_orders", "plot_validation", "plot_weight"]


def plot_weight(model: UncertaintyModel, *, ax: Axes | None = None) -> Axes:
    """The radius on the measured lines, what it is made of, and the weight over it, outside the band too.

    Parameters
    ----------
    model : UncertaintyModel
    ax : matplotlib Axes, optional
        Where to draw; a new figure when not given.
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
    w, scale = np.abs(response(model.weight, omega)), np.abs(response(model.shaping, omega))
    size = np.abs(G)
    low, high = (gain / scale for gain in FORMS[model.form].gains(w, scale * size))
    floor, ceiling = size.min() * 1e-2, size.max() * 1e2
    band = (db(np.clip(low, floor, ceiling)), db(np.clip(high, floor, ceiling)))
    ax.fill_between(hz(omega), *band, color=COLOR["weight"], alpha=0.25, lw=0, label="gains of the set")
    ax.plot(hz(omega), db(size), "-", lw=1.6, color=COLOR["radius"], label="nominal")
    shade(ax, model)
    ax.set(xscale="log", xlabel="frequency [Hz]", ylabel="|G| [dB]", ylim=(db(floor * 3), db(ceiling / 3)))
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
        title=f"{validation.n_outside_set} of {validation.n_lines} lines outside the set; "
        f"another gain, delay or frequency: p = {validation.p_value:.2g}",
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
