"""Pictures of models: the nominal, its set, the parts of the radius."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from typing import TYPE_CHECKING

import numpy as np

from nlfrf import Bla
from nlfrf._base.arguments import as_list, require_kind
from nlfrf._base.axes import (
    axes_or_new,
    bode_axes,
    finish_axes,
    finish_matrix,
    gain_band,
    join_labels,
    lower_edge,
    matrix_axes,
    phase_band,
    to_decibel,
)
from robust._base.channels import require_matrix, require_single
from robust.lti.lti import response, response_by_channel, timebase
from robust.models.fit.nominal_fit import NominalFit
from robust.models.sets.forms import FORMS
from robust.models.sets.model import UncertaintyModel, require_one_channel
from robust.models.sets.orders import OrderScan
from robust.plot.style import (
    BAND_MARGIN,
    COLOR,
    MEASURED,
    OVER_NOTE,
    PART,
    STYLE,
    mark_band,
    to_hertz,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: The parts of a budget in grey.
_HATCH = {
    "noise": "",
    "odd": "//",
    "even": "..",
    "misfit": "\\\\",
    "level": "xx",
    "systematic": "--",
}

#: The measurement that lowers a part of the radius.
_NEXT_MEASUREMENT = {
    "noise": "measure more periods",
    "odd": "measure more realisations, or at the level of the loop",
    "even": "measure about another set point, or without an offset",
    "misfit": "needs no measurement, but more poles",
    "level": "measure a narrower range of levels",
    "systematic": "measure at a second level",
}
_AXIS_MARGIN = 15.0  # dB below the least gain of the nominal in a row
_FLAT_MARGIN = 5.0  # dB above and below a constant weight
_MAX_MARKERS = 300  # measured lines that are drawn with their bounds, for several channels
# dB around the curves of a set: bands of 84 % below and of 300 % above fit
_DECIBELS_BELOW = 16.0
_DECIBELS_ABOVE = 12.0


def plot_weight(model: UncertaintyModel, *, ax: Axes | None = None) -> Axes | np.ndarray:
    """Plot the radius on the measured lines, its parts, and the weight that covers it.

    For several channels radii and weights are drawn in a matrix of axes, which is returned. For the
    form "elements" the axes are the entries of G. For other forms W_l is in the first row and W_r
    in the second row, with one column for each channel.

    Parameters
    ----------
    model : UncertaintyModel
    ax : matplotlib Axes, optional
        Where to draw; a new figure by default. For several channels it is replaced by the matrix of
        axes.
    """
    require_kind("model", model, UncertaintyModel)
    if not model.is_single:
        return _draw_weights(model, ax)
    ax = axes_or_new(ax)
    f = to_hertz(model.omega)
    floor = model.radius.min() * 10 ** (-25 / 20)
    for name, part in model.budget.items():
        if np.any(part > floor):
            label = f"part: {PART[name]}"
            ax.plot(
                f,
                to_decibel(part),
                ls=STYLE[name],
                lw=1.1,
                color=COLOR[name],
                alpha=0.9,
                label=label,
            )
    ax.plot(
        f, to_decibel(model.radius), ".", ms=3, color=COLOR["radius"], label="radius on the lines"
    )
    wide = _widened_band(model)
    ax.plot(
        to_hertz(wide),
        to_decibel(np.abs(response(model.weight, wide))),
        "-",
        lw=1.8,
        color=COLOR["weight"],
        label="|weight|",
    )
    mark_band(ax, (f[0], f[-1]), top=to_hertz(wide[-1]))
    unit = FORMS[model.form].unit_of(model.origin.unit)
    ax.set(
        xscale="log",
        ylim=(to_decibel(floor), None),
        xlabel="frequency [Hz]",
        ylabel=f"radius, {model.form} [{', '.join(['dB', *[unit] * bool(unit)])}]",
        title=f"Uncertainty weight of order {model.weight.nstates}; {model.origin.extrapolation}",
    )
    return finish_axes(ax)


def plot_set(
    model: UncertaintyModel, bla: Bla | Sequence[Bla] | None = None, *, ax: Axes | None = None
) -> tuple[Axes, Axes] | np.ndarray:
    """Plot measured points, nominal and set as a Bode plot.

    For several channels a matrix of axes shows the gain of each entry of the nominal, with its
    range over the set.

    Parameters
    ----------
    model : UncertaintyModel
    bla : nlfrf.Bla or list of them, optional
        The measurement, drawn as points with their 95 % bounds.
    ax : matplotlib Axes, optional
        Axes that are replaced by the returned ones; a new figure by default.

    Returns
    -------
    tuple of two matplotlib Axes, or (n_y, n_u) ndarray of them
    """
    require_kind("model", model, UncertaintyModel)
    if bla is None:
        blas = []
    else:
        blas = as_list(bla)
    require, draw = (
        (require_single, _draw_disc) if model.is_single else (require_matrix, _draw_entries)
    )
    for one in blas:
        require("bla", one)
    blas = [model.centre.behind_hold(one) for one in blas]
    omega = model.centre.band(model.omega, _widened_band(model))
    return draw(model, blas, omega=omega, ax=ax)


def _draw_disc(
    model: UncertaintyModel, blas: Sequence[Bla], *, omega: np.ndarray, ax: Axes | None
) -> tuple[Axes, Axes]:
    """Draw `plot_set` for one channel."""
    top, bottom = bode_axes(ax)
    f, G = to_hertz(omega), model.at(omega)
    size, w, scale = (
        np.abs(G),
        *(np.abs(response(part, omega)) for part in (model.weight, model.shaping)),
    )
    low, high = (gain / scale for gain in FORMS[model.form].gains(w, scale * size))
    gain_band(
        top, f, size, low, high, color=COLOR["weight"], alpha=0.25, label="the set", over=OVER_NOTE
    )
    phase = np.unwrap(np.angle(G))
    with np.errstate(
        invalid="ignore"
    ):  # the set is a disc, with its ends on the ray of the nominal
        ratio = (high - low) / (high + low)
    wide = np.arcsin(np.where((low > 0) & (ratio < 1), ratio, np.nan))
    bottom.fill_between(
        f, *np.degrees([phase - wide, phase + wide]), color=COLOR["weight"], alpha=0.25, lw=0
    )
    shown: list[np.ndarray] = []
    for one, color in zip(blas, MEASURED * len(blas), strict=False):
        radius, measured = one.bound(), np.abs(one.G)
        ends = [
            to_decibel(measured) - to_decibel(lower_edge(measured, measured - radius)),
            to_decibel(measured + radius) - to_decibel(measured),
        ]
        label = f"measured, 95 % bound{f' ({len(shown) + 1})' * (len(blas) > 1)}"
        top.errorbar(one.f, to_decibel(measured), ends, fmt="none", lw=0.8, color=color)
        top.plot(one.f, to_decibel(measured), ".", ms=4, color=color, label=label)
        turn = np.interp(one.f, f, phase)
        around = turn + np.angle(one.G * np.exp(-1j * turn))
        bottom.errorbar(
            one.f, np.degrees(around), phase_band(one.G, radius), fmt=".", ms=4, lw=0.8, color=color
        )
        shown += [around]
    for axes_, curve in ((top, to_decibel(size)), (bottom, np.degrees(phase))):
        axes_.plot(
            f, curve, "-", lw=1.6, color=COLOR["radius"], label="nominal" if axes_ is top else None
        )
        axes_.set_xscale("log")
        mark_band(axes_, (to_hertz(model.omega[0]), to_hertz(model.omega[-1])), top=f[-1])
    every = np.degrees(np.concatenate([phase, *shown]))
    bottom.set(
        ylim=(every.min() - 60, every.max() + 60), xlabel="frequency [Hz]", ylabel="phase [deg]"
    )
    top.set(
        ylim=_magnitude_limits(size, *(np.abs(one.G) for one in blas)),
        ylabel=f"magnitude [dB, {model.origin.unit or 'unit of y / u'}]",
    )
    join_labels(bottom, top)
    finish_axes(top)
    return top, finish_axes(bottom)


def _draw_entries(
    model: UncertaintyModel, frms: Sequence[Bla], *, omega: np.ndarray, ax: Axes | None
) -> np.ndarray:
    """Draw `plot_set` for several channels."""
    f = to_hertz(omega)
    size = np.abs(response_by_channel(model.nominal, omega))
    reach = model.entry_radius(omega)
    made, foot = matrix_axes(
        ax, [f"{name}  [dB]" for name in model.outputs], [f"by {name}" for name in model.inputs]
    )
    within = (omega >= model.omega[0]) & (omega <= model.omega[-1])
    for (j, i), one in np.ndenumerate(made):
        floor = float(to_decibel(size[j][:, within].min())) - _AXIS_MARGIN
        gains = size[j, i], size[j, i] - reach[j, i], size[j, i] + reach[j, i]
        gain_band(
            one, f, *gains, color=COLOR["weight"], alpha=0.25, label="the set", over=OVER_NOTE
        )
        for k, (measured, color) in enumerate(zip(frms, cycle(MEASURED))):
            gain, radius = np.abs(measured.G[j, i]), measured.bound()[j, i]
            ends = [
                to_decibel(gain) - to_decibel(lower_edge(gain, gain - radius)),
                to_decibel(gain + radius) - to_decibel(gain),
            ]
            if measured.f.size <= _MAX_MARKERS:
                one.errorbar(measured.f, to_decibel(gain), ends, fmt="none", lw=0.6, color=color)
            label = f"measured, 95 % bound{f' ({k + 1})' * (len(frms) > 1)}"
            one.plot(measured.f, to_decibel(gain), ".", ms=3, color=color, label=label)
        one.plot(f, to_decibel(size[j, i]), "-", lw=1.4, color=COLOR["radius"], label="nominal")
        one.set_xscale("log")
        mark_band(one, (to_hertz(model.omega[0]), to_hertz(model.omega[-1])), top=f[-1])
        one.set_ylim(floor, float(to_decibel(size[j][:, within].max())) + _AXIS_MARGIN)
    return finish_matrix(made, foot, "frequency [Hz]")


def _draw_weights(model: UncertaintyModel, ax: Axes | None) -> np.ndarray:
    """Draw `plot_weight` for several channels."""
    omega = _widened_band(model)
    if model.left:
        ((n_r, n_l),) = model.structure
        n = max(n_l, n_r)
        rows, columns = ["W_l  [dB]", "W_r  [dB]"], [f"channel {k + 1}" for k in range(n)]
        places = {(0, k): k for k in range(n_l)} | {(1, k): n_l + k for k in range(n_r)}
    else:
        rows = [f"{name}  [dB]" for name in model.outputs]
        columns = [f"by {name}" for name in model.inputs]
        places = {
            (j, i): i * model.n_outputs + j
            for j in range(model.n_outputs)
            for i in range(model.n_inputs)
        }
    made, foot = matrix_axes(ax, rows, columns)
    gains = model.weight_gains(omega)
    for place, one in np.ndenumerate(made):
        if place not in places:
            one.set_visible(False)
            continue
        k = places[place]
        one.plot(
            to_hertz(model.omega),
            to_decibel(model.radius[k]),
            ".",
            ms=3,
            color=COLOR["radius"],
            label="radius on the lines",
        )
        one.plot(
            to_hertz(omega),
            to_decibel(gains[k]),
            "-",
            lw=1.6,
            color=COLOR["weight"],
            label="|weight|",
        )
        one.set_xscale("log")
        one.ticklabel_format(axis="y", useOffset=False)
        mark_band(
            one, (to_hertz(model.omega[0]), to_hertz(model.omega[-1])), top=to_hertz(omega[-1])
        )
    for row in made:  # a constant weight is drawn flat
        low, high = row[0].get_ylim()
        row[0].set_ylim(
            min(low, (low + high) / 2 - _FLAT_MARGIN), max(high, (low + high) / 2 + _FLAT_MARGIN)
        )
    return finish_matrix(made, foot, "frequency [Hz]")


def _magnitude_limits(*sizes: np.ndarray) -> tuple[float, float]:
    """Return the limits of the vertical axis [dB] around measured and fitted points, with a margin
    for a band.
    """
    every = np.concatenate(sizes)
    return float(to_decibel(every[every > 0].min())) - _DECIBELS_BELOW, float(
        to_decibel(every.max())
    ) + _DECIBELS_ABOVE


def plot_budget(model: UncertaintyModel, *, ax: Axes | None = None) -> Axes:
    """Draw the parts of the radius over frequency; arguments as in `plot_weight`.

    The legend contains the mean share of each part over the lines, and the measurement that lowers
    this part.
    """
    require_one_channel(
        model,
        "plot_weight shows every radius, budget its parts",
        "for this picture",
        parametric=False,
    )
    ax = axes_or_new(ax)
    f = to_hertz(model.omega)
    below = np.zeros(f.size)
    for name, part in model.budget.items():
        share = 100 * np.nan_to_num(part) / model.radius
        if np.any(share > 0.5):
            over, colour, hatch = below + share, COLOR[name], _HATCH[name]
            label = f"{PART[name]}, {np.mean(share):.0f} %: {_NEXT_MEASUREMENT[name]}"
            ax.fill_between(
                f,
                below,
                over,
                lw=0,
                label=label,
                alpha=0.75,
                facecolor=colour,
                edgecolor="0.25",
                hatch=hatch,
            )
            below = below + share
    ax.set(
        xscale="log",
        ylim=(0, 100),
        xlabel="frequency [Hz]",
        ylabel="share of the radius [%]",
        title="What to measure next",
    )
    mark_band(ax, (f[0], f[-1]))
    return finish_axes(ax)


def plot_fit(fit: NominalFit, *, ax: Axes | None = None) -> Axes:
    """Plot measured FRF, nominal model and residual; arguments as in `plot_weight`."""
    require_kind("fit", fit, NominalFit)
    ax = axes_or_new(ax)
    f, measured = to_hertz(fit.omega), fit.response + fit.residual
    ax.plot(f, to_decibel(np.abs(measured)), ".", ms=3, color=COLOR["noise"], label="measured")
    label = f"model, {fit.G.nstates} poles" + (
        f", delay {1e3 * fit.delay:.3g} ms" if fit.delay else ""
    )
    wide = np.geomspace(f.min() / BAND_MARGIN, f.max() * BAND_MARGIN, 400)
    wide = np.unique(np.concatenate([wide[wide < 0.5 / fit.G.dt] if fit.G.dt else wide, f]))
    drawn = response(fit.G, 2 * np.pi * wide)
    ax.plot(wide, to_decibel(np.abs(drawn)), "-", lw=1.6, color=COLOR["radius"], label=label)
    ax.plot(
        f,
        to_decibel(np.abs(fit.residual)),
        "x",
        ms=3,
        color=COLOR["limit"],
        alpha=0.7,
        label="residual",
    )
    title = f"Nominal model of {fit.G.nstates} poles"
    if np.isfinite(fit.expected_cost):
        ax.plot(
            f,
            to_decibel(fit.std),
            "_",
            ms=4,
            color=COLOR["loop"],
            alpha=0.9,
            label="standard deviation of the lines",
        )
        title += f": cost {fit.cost / fit.expected_cost:.3g} times what scatter alone leaves"
    label = f"magnitude [dB, {fit.unit or 'unit of y / u'}]"
    ax.set(xscale="log", xlabel="frequency [Hz]", ylabel=label, title=title)
    mark_band(ax, (f.min(), f.max()))
    return finish_axes(ax)


def plot_orders(scan: OrderScan, *, ax: Axes | None = None) -> Axes:
    """Plot cost and criterion over the number of poles; arguments as in `plot_weight`."""
    from matplotlib.ticker import MaxNLocator

    require_kind("scan", scan, OrderScan)
    ax = axes_or_new(ax)
    ax.plot(scan.n_poles, scan.cost, "o-", color=COLOR["loop"], label="cost")
    ax.plot(
        scan.n_poles,
        scan.expected_cost,
        ":",
        color=COLOR["noise"],
        label="what scatter alone leaves",
    )
    ax.plot(scan.n_poles, scan.criterion, "s-", color=COLOR["radius"], label="criterion")
    ax.axvline(scan.best, color=COLOR["weight"], lw=1.5, alpha=0.6, label=f"take {scan.best} poles")
    ax.set(yscale="log", xlabel="poles", ylabel="weighted squared error", title="Order scan")
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    return finish_axes(ax)


def _widened_band(model: UncertaintyModel) -> np.ndarray:
    """Return frequencies [rad/s] of the band and half a decade on both sides, up to Nyquist."""
    high, dt = model.omega[-1] * BAND_MARGIN, max(map(timebase, model.weights)) or model.dt
    if dt:
        high = min(high, np.pi / dt * (1 - 1e-9))
    return np.unique(
        np.concatenate([np.geomspace(model.omega[0] / BAND_MARGIN, high, 600), model.omega])
    )
