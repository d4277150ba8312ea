"""Pictures of a `Bla` with several channels: every entry, singular values, relative gains."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nlfrf._base.arguments import require_kind
from nlfrf._base.axes import (
    axes_or_new,
    finish_axes,
    finish_matrix,
    gain_band,
    matrix_axes,
    to_decibel,
)
from nlfrf.bla.bla import Bla
from nlfrf.bla.gains import rga, rga_radius, singular_values
from nlfrf.plot.look import COLOR, COLOR_CYCLE, OVER_100

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LEGEND_DB = 12.0  # [dB] free space above and below the curves
_MAX_MARKED_LINES = 300  # most lines that are drawn with points
_LINE_STYLES = ("-", "--", "-.", ":")


def plot_frm(frm: Bla, *, confidence: float = 0.95, ax: Axes | None = None) -> np.ndarray:
    """Draw the magnitude of every entry of G with its bound: one row of axes per output, one column
    per input.

    Parameters
    ----------
    frm : Bla
        Identified matrix.
    confidence : float
        Probability of the drawn bound.
    ax : matplotlib Axes, optional
        Axes in whose place the matrix of axes is drawn; by default a new figure.

    Returns
    -------
    (n_y, n_u) ndarray of matplotlib Axes
    """
    require_kind("frm", frm, Bla)
    made, foot = _entry_axes(ax, frm, "[dB]")
    size, radius = np.abs(frm.matrix), _expand_entries(frm, frm.bound(confidence))
    label = f"{100 * confidence:g} % bound of the entry"
    for j in range(frm.n_outputs):
        floor = _smallest_nonzero(size[j]) - _LEGEND_DB / 2
        ceiling = float(to_decibel(size[j].max())) + _LEGEND_DB / 2
        for i, entry in enumerate(made[j]):
            gains = size[j, i], size[j, i] - radius[j, i], size[j, i] + radius[j, i]
            gain_band(entry, frm.f, *gains, color=COLOR["bound"], label=label, over=OVER_100)
            entry.plot(
                frm.f,
                to_decibel(size[j, i]),
                ".-" if frm.f.size <= _MAX_MARKED_LINES else "-",
                ms=2,
                lw=1.0,
                color=COLOR["excited"],
                label="|G|",
            )
            entry.set(xscale="log", ylim=(floor, ceiling))
    return finish_matrix(made, foot, "frequency [Hz]")


def plot_frm_bounds(frm: Bla, *, confidence: float = 0.95, ax: Axes | None = None) -> np.ndarray:
    """Draw the radii of the bounds of every entry of G, and its standard deviations.

    One radius is for the entry alone. The other follows from the bound of the whole matrix G, which
    holds for all entries together, and is larger. Arguments and result as in `plot_frm`.
    """
    require_kind("frm", frm, Bla)
    made, foot = _entry_axes(ax, frm, "[dB]")
    left, right = frm.block(confidence)
    bound = _expand_entries(frm, frm.bound(confidence))
    matrix_radius = np.sqrt(np.einsum("jkf,jkf->jf", left, left.conj()).real)[:, None] * np.sqrt(
        np.einsum("kif,kif->if", right, right.conj()).real
    )
    curves = (
        (np.abs(frm.matrix), "|G|", "-", COLOR["excited"], 1.6),
        (matrix_radius, f"{100 * confidence:g} % bound of the matrix", "-.", COLOR["even"], 1.2),
        (bound, f"{100 * confidence:g} % bound of the entry", "-", COLOR["bound"], 1.2),
        (
            _expand_entries(frm, np.sqrt(frm.var_distortion)),
            "std by distortion, one set",
            "--",
            COLOR["odd"],
            1.0,
        ),
        (_expand_entries(frm, np.sqrt(frm.var_noise)), "std by noise", ":", COLOR["noise"], 1.4),
    )
    for (j, i), one in np.ndenumerate(made):
        for curve, label, style, color, width in curves:
            if np.isfinite(curve[j, i]).any():
                one.plot(frm.f, to_decibel(curve[j, i]), style, lw=width, color=color, label=label)
        one.set_xscale("log")
    return finish_matrix(made, foot, "frequency [Hz]")


def plot_singular_values(
    frm: Bla, *, confidence: float = 0.95, of: str = "bla", ax: Axes | None = None
) -> Axes:
    """Draw the singular values of the matrix, each with its bounds.

    Parameters
    ----------
    frm : Bla
        Identified matrix.
    confidence, of
        As in `singular_values`.
    ax : matplotlib Axes, optional
        Axes to draw on; by default a new figure.
    """
    require_kind("frm", frm, Bla)
    ax = axes_or_new(ax)
    sigma, low, high = singular_values(frm, confidence, of=of)
    for i, gain in enumerate(sigma):
        color, style = COLOR_CYCLE[i % len(COLOR_CYCLE)], _LINE_STYLES[i % len(_LINE_STYLES)]
        gain_band(
            ax,
            frm.f,
            gain,
            low[i],
            high[i],
            color=color,
            alpha=0.2,
            label="_band",
            over="the matrix may be singular",
        )
        ax.plot(
            frm.f, to_decibel(gain), style, lw=1.4, color=color, label=f"singular value {i + 1}"
        )
    ax.fill_between(
        [],
        [],
        [],
        color="0.5",
        alpha=0.3,
        lw=0,
        label=f"{100 * confidence:g} % bound of the matrix",
    )
    ax.set(
        xscale="log",
        xlabel="frequency [Hz]",
        ylabel="singular values of G [dB]",
        ylim=(
            _smallest_nonzero(sigma) - _LEGEND_DB / 2,
            float(to_decibel(sigma.max())) + _LEGEND_DB / 2,
        ),
        title="Gain in the strongest and in the weakest direction",
    )
    return finish_axes(ax)


def plot_rga(frm: Bla, *, confidence: float = 0.95, ax: Axes | None = None) -> np.ndarray:
    """Draw the magnitude of every relative gain over frequency, with its bound.

    An output and an input with a relative gain near 1 are a good pair. The bound is that of
    `rga_radius`. Arguments and result as in `plot_frm`.
    """
    require_kind("frm", frm, Bla)
    made, foot = _entry_axes(ax, frm, "")
    size, radius = np.abs(rga(frm.matrix)), rga_radius(frm, confidence)
    top = 1.15 * max(float(np.quantile(size + radius, 0.99)), 1.2)
    for (j, i), one in np.ndenumerate(made):
        low, high = np.maximum(size[j, i] - radius[j, i], 0.0), size[j, i] + radius[j, i]
        label = f"{100 * confidence:g} % bound"
        one.fill_between(frm.f, low, high, color=COLOR["bound"], alpha=0.35, lw=0, label=label)
        one.plot(frm.f, size[j, i], "-", lw=1.2, color=COLOR["excited"], label="|relative gain|")
        one.axhline(1, color="0.3", lw=0.8, ls=":")
        one.set(xscale="log", ylim=(0, top))
    return finish_matrix(made, foot, "frequency [Hz]")


def _entry_axes(ax: Axes | None, frm: Bla, up: str) -> tuple[np.ndarray, Axes]:
    """Create a matrix of axes with the names of the channels."""
    return matrix_axes(
        ax, [f"{name}  {up}".strip() for name in frm.outputs], [f"by {name}" for name in frm.inputs]
    )


def _expand_entries(frm: Bla, curve: np.ndarray) -> np.ndarray:
    """Return a curve of every entry as (n_y, n_u, F), also for one input and output."""
    return curve.reshape(frm.matrix.shape)


def _smallest_nonzero(sizes: np.ndarray) -> float:
    """Return the smallest nonzero size [dB]."""
    return float(to_decibel(np.min(sizes, initial=np.inf, where=sizes > 0)))
