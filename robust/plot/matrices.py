"""Pictures of a set of plants of several inputs and outputs, and of its loop: a matrix of axes, singular values, mu."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np

from nlfrf import Bla
from nlfrf._base.arguments import of_kind
from nlfrf._base.axes import axes, db, finished, finished_matrix, gain_band, lower_edge, matrix_axes
from robust._base.channels import require_matrix
from robust.analysis.check_structure import StructuredReport
from robust.analysis.performance import LoopGains
from robust.lti.lti import along, timebase
from robust.models.fit.nominal import behind_hold
from robust.models.sets.model import MatrixUncertainty
from robust.plot.look import BESIDE, COLOR, MEASURED, OVER, hz, mark_band, show_all_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["draw_mu", "plot_matrix_loop", "plot_matrix_set", "plot_matrix_weights"]


ROOM = 15.0  # dB under the least gain of the nominal in a row
FLAT = 5.0  # dB above and below a weight that is a number
FEW = 300  # measured lines that are drawn with their bounds


def plot_matrix_set(model: MatrixUncertainty, frm: Bla | Sequence[Bla] | None = None, *, ax: Axes | None = None) -> Any:
    """Every entry of the nominal with the gains that the set gives it, and what was measured.

    Parameters
    ----------
    model : MatrixUncertainty
    frm : nlfrf.Bla or list of them, optional
        What was measured, drawn as points with their 95 % bounds.
    ax : matplotlib Axes, optional
        Where to draw: it gives its place to the matrix of axes that is returned; a new figure when not given.

    Returns
    -------
    (n_y, n_u) ndarray of matplotlib Axes
    """
    of_kind("model", model, MatrixUncertainty)
    omega = outside_too(model)
    frms = [] if frm is None else [frm] if isinstance(frm, Bla) else list(frm)
    for one in frms:
        require_matrix("frm", one)
    frms = [behind_hold(one, timebase(model.nominal)) for one in frms]
    f, size, reach = hz(omega), np.abs(along(model.nominal, omega)), model.entry_radius(omega)
    made, foot = matrix_axes(ax, [f"{name}  [dB]" for name in model.outputs], [f"by {name}" for name in model.inputs])
    within = (omega >= model.omega[0]) & (omega <= model.omega[-1])
    for (j, i), one in np.ndenumerate(made):
        floor = float(db(size[j][:, within].min())) - ROOM
        gains = size[j, i], size[j, i] - reach[j, i], size[j, i] + reach[j, i]
        gain_band(one, f, *gains, color=COLOR["weight"], alpha=0.25, label="the set", over=OVER)
        for k, (measured, color) in enumerate(zip(frms, cycle(MEASURED))):
            gain, radius = np.abs(measured.G[j, i]), measured.bound()[j, i]
            ends = [db(gain) - db(lower_edge(gain, gain - radius)), db(gain + radius) - db(gain)]
            if measured.f.size <= FEW:
                one.errorbar(measured.f, db(gain), ends, fmt="none", lw=0.6, color=color)
            label = f"measured, 95 % bound{f' ({k + 1})' * (len(frms) > 1)}"
            one.plot(measured.f, db(gain), ".", ms=3, color=color, label=label)
        one.plot(f, db(size[j, i]), "-", lw=1.4, color=COLOR["radius"], label="nominal")
        one.set_xscale("log")
        mark_band(one, (hz(model.omega[0]), hz(model.omega[-1])), top=f[-1])
        one.set_ylim(floor, float(db(size[j][:, within].max())) + ROOM)
    return finished_matrix(made, foot, "frequency [Hz]")


def plot_matrix_weights(model: MatrixUncertainty, *, ax: Axes | None = None) -> Any:
    """Radii on the measured lines and the weights over them; of a full block W_l above W_r, a column a channel.

    Arguments as in `plot_matrix_set`, and what is returned; weights that a channel does not have are left empty.
    """
    of_kind("model", model, MatrixUncertainty)
    omega = outside_too(model)
    if model.left:
        n = max(len(model.left), len(model.right))
        rows, columns = ["W_l  [dB]", "W_r  [dB]"], [f"channel {k + 1}" for k in range(n)]
        places = {(0, k): k for k in range(len(model.left))}
        places |= {(1, k): len(model.left) + k for k in range(len(model.right))}
    else:
        rows, columns = [f"{name}  [dB]" for name in model.outputs], [f"by {name}" for name in model.inputs]
        places = {(j, i): i * model.n_outputs + j for j in range(model.n_outputs) for i in range(model.n_inputs)}
    made, foot = matrix_axes(ax, rows, columns)
    weights = (*model.left, *model.right)
    for place, one in np.ndenumerate(made):
        if place not in places:
            one.set_visible(False)
            continue
        k = places[place]
        weight = np.abs(along(weights[k], omega)[0, 0]) * np.ones(omega.size)
        one.plot(hz(model.omega), db(model.radius[k]), ".", ms=3, color=COLOR["radius"], label="radius on the lines")
        one.plot(hz(omega), db(weight), "-", lw=1.6, color=COLOR["weight"], label="|weight|")
        one.set_xscale("log")
        one.ticklabel_format(axis="y", useOffset=False)
        mark_band(one, (hz(model.omega[0]), hz(model.omega[-1])), top=hz(omega[-1]))
    for row in made:  # what is flat is drawn flat
        low, high = row[0].get_ylim()
        row[0].set_ylim(min(low, (low + high) / 2 - FLAT), max(high, (low + high) / 2 + FLAT))
    return finished_matrix(made, foot, "frequency [Hz]")


def plot_matrix_loop(gains: LoopGains, *, ax: Axes | None = None) -> Axes:
    """Between what the singular values of L, S and T lie: strongest and weakest direction of the nominal loop.

    Parameters
    ----------
    gains : LoopGains
        From `loop_gains`.
    ax : matplotlib Axes, optional
        Where to draw; a new figure when not given.
    """
    of_kind("gains", gains, LoopGains)
    ax, f = axes(ax), hz(gains.omega)
    for name, color, style in (("L", "radius", "-"), ("S", "loop", "--"), ("T", "limit", "-.")):
        curves = getattr(gains, name)
        ax.fill_between(f, db(curves[-1]), db(curves[0]), color=COLOR[color], alpha=0.15, lw=0)
        ax.plot(f, db(curves[0]), style, lw=1.6, color=COLOR[color], label=f"{name}, largest")
        ax.plot(f, db(curves[-1]), style, lw=0.7, color=COLOR[color], label=f"{name}, smallest")
    ax.axhline(0, color="0.5", lw=0.8)
    title = "Nominal loop" if gains.stable else "Nominal loop, not stable"
    ax.set(xscale="log", xlabel="frequency [Hz]", ylabel="singular values [dB]", title=title)
    low, high = (f[0], f[-1]) if gains.band is None else hz(gains.band)
    mark_band(ax, (low, high), top=f[-1])
    show_all_of(ax)
    return finished(ax)


def draw_mu(ax: Any, report: StructuredReport) -> Any:
    """The bounds of a check of several uncertainties over frequency, to stay below one."""
    f = hz(report.omega)
    seen = f > 0
    if report.band is not None:
        low, high = hz(np.asarray(report.band))
        mark_band(ax, (low, high), happens=(hz(report.omega_rs), hz(report.omega_rp)), top=f[-1])
        seen &= (f >= ax.get_xlim()[0]) & (f <= ax.get_xlim()[1])
    drawn = [1.0]
    for curve, label, color, style in (
        (report.mu, "robust stability, upper bound of mu", "limit", "-"),
        (report.mu_rp, "robust performance", "radius", "--"),
    ):
        if np.isfinite(curve).any():
            ax.plot(f[f > 0], curve[f > 0], style, lw=1.6, color=COLOR[color], label=label)
            drawn += [*curve[seen & (curve > 0)]]
    if np.isfinite(report.margin_broken):
        label = "reached by a perturbation that was found"
        ax.axhline(1 / report.margin_broken, color=COLOR["loop"], lw=1, ls=":", label=label)
        drawn.append(1 / report.margin_broken)
    ax.axhline(1, color="0.3", lw=1)
    ax.set(
        xscale="log",
        yscale="log",
        xlabel="frequency [Hz]",
        ylabel="must stay below 1",
        title=f"Verdict on stability: {report.verdict}",
        ylim=(max(1e-3, 0.8 * min(drawn)), float(np.clip(1.5 * max(drawn), 2.0, 1e2))),
    )
    if not report.nominally_stable:
        ax.set_ylim(0.1, 10)
        ax.text(0.5, 0.5, report.reason, transform=ax.transAxes, ha="center", wrap=True)
    return finished(ax)


def outside_too(model: MatrixUncertainty) -> np.ndarray:
    """Frequencies [rad/s] for a curve: the band and half a decade on both sides, up to Nyquist."""
    high = model.omega[-1] * BESIDE
    if model.nominal.dt:
        high = min(high, np.pi / model.nominal.dt * (1 - 1e-9))
    return np.unique(np.concatenate([np.geomspace(model.omega[0] / BESIDE, high, 600), model.omega]))
