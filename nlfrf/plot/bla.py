"""Pictures of a `Bla`: magnitude and phase with the bound, the output spectrum, two estimates of
the distortion.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from typing import TYPE_CHECKING

import numpy as np

from nlfrf._base.arguments import (
    as_list,
    format_count,
    require_kind,
    require_list,
    require_one_channel,
    short_form,
)
from nlfrf._base.axes import (
    axes_or_new,
    bode_axes,
    finish_axes,
    follow_lines,
    gain_band,
    join_labels,
    lower_edge,
    phase_band,
    to_decibel,
)
from nlfrf.bla.bla import Bla
from nlfrf.bla.cross_check import DISAGREEMENT_DB, SecondOpinion
from nlfrf.plot.look import COLOR, COLOR_CYCLE, MARKER, OVER_100, crop_rounding

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_BAND_ALPHA = 0.25  # opacity of overlapping bounds
_BEST = "best linear approximation"
_LINES = (".-", ".--", ".:")  # line styles of several BLAs, after all colours are used


def plot_bla(bla: Bla, *, confidence: float = 0.95, ax: Axes | None = None) -> Axes:
    """Draw the magnitude of the best linear approximation (BLA) with its bound and its standard
    deviations.

    Output amplitudes on the detection lines (lines without excitation) are divided by |U|, so that
    they have the unit of G.

    Parameters
    ----------
    bla : Bla
    confidence : float
        Probability of the drawn bound.
    ax : matplotlib Axes, optional
        Axes to draw on; by default a new figure.
    """
    _require_single(bla)
    ax = axes_or_new(ax)
    known = bla.G != 0  # an even system has no output on excited lines
    U = np.abs(bla.levels.excited[:, known]).mean(axis=0) / np.abs(bla.G[known])
    for kind, f, amplitude in (
        ("odd", bla.levels.f_odd, bla.levels.odd),
        ("even", bla.levels.f_even, bla.levels.even),
    ):
        if f.size and U.size:
            level = np.sqrt(np.mean(np.abs(amplitude) ** 2, axis=0)) / np.interp(f, bla.f[known], U)
            ax.plot(
                f,
                to_decibel(level),
                MARKER[kind],
                ms=4,
                color=COLOR[kind],
                alpha=0.7,
                label=f"{kind} detection lines / |U|",
            )
    ax.plot(
        bla.f,
        to_decibel(np.sqrt(bla.var_total)),
        "-",
        lw=1.2,
        color="#CC79A7",
        label="std of G, noise and distortion",
    )
    if np.isfinite(bla.var_noise).all():
        ax.plot(
            bla.f,
            to_decibel(np.sqrt(bla.var_noise)),
            "--",
            lw=1,
            color=COLOR["noise"],
            label="std of G, noise",
        )
    _draw_magnitude(ax, bla, confidence)
    ax.set(xscale="log", xlabel="frequency [Hz]", title=_describe_measurement(bla))
    return finish_axes(crop_rounding(ax, np.abs(bla.G)))


def _draw_magnitude(ax: Axes, bla: Bla, confidence: float) -> None:
    """Draw |G| with its bound as a band around it, and label the axis."""
    size, radius = np.abs(bla.G), bla.bound(confidence)
    label = f"{100 * confidence:g} % bound"
    gain_band(
        ax,
        bla.f,
        size,
        size - radius,
        size + radius,
        color=COLOR["bound"],
        label=label,
        over=OVER_100,
    )
    ax.plot(bla.f, to_decibel(size), ".-", ms=3, lw=1.2, color=COLOR["excited"], label=_BEST)
    follow_lines(ax)
    ax.set(ylabel=f"magnitude [dB, {bla.unit or 'unit of y / u'}]")


def plot_bode(bla: Bla, *, confidence: float = 0.95, ax: Axes | None = None) -> tuple[Axes, Axes]:
    """Draw the Bode plot of the best linear approximation (BLA), with its bound as a band around
    magnitude and phase.

    Parameters
    ----------
    bla : Bla
    confidence : float
        Probability of the drawn bound.
    ax : matplotlib Axes, optional
        Axes in whose place the two axes are drawn; by default a new figure.
    """
    _require_single(bla)
    top, bottom = bode_axes(ax)
    _draw_magnitude(top, bla, confidence)
    top.set(xscale="log", title=_describe_measurement(bla))
    plot_phase(bla, confidence=confidence, ax=bottom)
    join_labels(bottom, top)
    finish_axes(top)
    return top, finish_axes(bottom)


def plot_phase(bla: Bla, *, confidence: float = 0.95, ax: Axes | None = None) -> Axes:
    """Draw the unwrapped phase of the best linear approximation (BLA) in degrees, with its bound as
    a band.

    Arguments as in `plot_bla`.
    """
    _require_single(bla)
    ax = axes_or_new(ax)
    phase, wide = np.degrees(np.unwrap(np.angle(bla.G))), phase_band(bla.G, bla.bound(confidence))
    label = f"{100 * confidence:g} % bound"
    ax.fill_between(
        bla.f, phase - wide, phase + wide, color=COLOR["bound"], alpha=0.35, lw=0, label=label
    )
    ax.plot(bla.f, phase, ".-", ms=3, lw=1.2, color=COLOR["excited"], label=_BEST)
    ax.set(xscale="log", xlabel="frequency [Hz]", ylabel="phase [deg]")
    return finish_axes(ax)


def _phase_from_surest(G: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Return (F,) unwrapped phase [deg] from the most certain line of the lowest third, where it is
    -270 to 90 deg.

    Unwrapping from a first line without a valid phase could shift all others by whole turns.

    >>> _phase_from_surest(np.exp(1j * np.radians([100.0, -170.0, -190.0])), np.array([2.0, 0.1, 0.1]))
    array([-260., -170., -190.])
    """
    relative = radius / np.abs(G)
    k = int(np.argmin(relative[: G.size // 3 + 1]))
    phase = np.angle(G)
    phase = np.concatenate([np.unwrap(phase[k::-1])[:0:-1], np.unwrap(phase[k:])])
    return np.asarray(np.degrees(phase) - 360 * np.round((np.degrees(phase[k]) + 90) / 360))


def plot_blas(
    blas: Sequence[Bla], labels: Sequence[str], *, confidence: float = 0.95, ax: Axes | None = None
) -> tuple[Axes, Axes]:
    """Draw the Bode plots of several best linear approximations (BLA) in one picture, each with its
    bound.

    Use this to compare the BLA at several rms values of the excitation.

    Parameters
    ----------
    blas : sequence of Bla
        BLAs with equal units.
    labels : sequence of str
        Name of each.
    confidence : float
        Probability of the drawn bounds.
    ax : matplotlib Axes, optional
        Axes in whose place the two axes are drawn; by default a new figure.
    """
    blas, labels = require_list("blas", blas, Bla), as_list(labels)
    for bla in blas:
        _require_single(bla)
    if len(labels) != len(blas):
        raise ValueError(
            f"labels must be a list of {len(blas)}, one per Bla, got {short_form(labels)}"
        )
    top, bottom = bode_axes(ax)
    styles = cycle((color, line) for line in _LINES for color in COLOR_CYCLE)
    for bla, label, (color, line) in zip(blas, labels, styles, strict=False):
        size, radius = np.abs(bla.G), bla.bound(confidence)
        top.fill_between(
            bla.f,
            to_decibel(lower_edge(size, size - radius)),
            to_decibel(size + radius),
            color=color,
            alpha=_BAND_ALPHA,
            lw=0,
        )
        phase, wide = _phase_from_surest(bla.G, radius), phase_band(bla.G, radius)
        bottom.fill_between(bla.f, phase - wide, phase + wide, color=color, alpha=_BAND_ALPHA, lw=0)
        top.plot(bla.f, to_decibel(size), line, ms=3, lw=1.2, color=color)
        bottom.plot(bla.f, phase, line, ms=3, lw=1.2, color=color, label=label)
    bottom.fill_between(
        [],
        [],
        [],
        color=COLOR["noise"],
        alpha=_BAND_ALPHA,
        label=f"{100 * confidence:g} % bound of each",
    )
    follow_lines(top)
    top.set(
        xscale="log",
        ylabel=f"magnitude [dB, {blas[0].unit or 'unit of y / u'}]",
        title="Best linear approximations",
    )
    bottom.set(xlabel="frequency [Hz]", ylabel="phase [deg]")
    finish_axes(top)
    return top, finish_axes(bottom)


def plot_levels(bla: Bla, *, ax: Axes | None = None) -> Axes:
    """Draw the output spectrum on excited and on detection lines (not excited), with the noise
    level.

    Parameters
    ----------
    bla : Bla
    ax : matplotlib Axes, optional
        Axes to draw on; by default a new figure.
    """
    _require_single(bla)
    ax = axes_or_new(ax)
    levels = bla.levels
    for kind, marker in MARKER.items():
        f, amplitude = getattr(levels, f"f_{kind}"), getattr(levels, kind)
        if f.size:
            rms = np.sqrt(np.mean(np.abs(amplitude) ** 2, axis=0))
            if kind == "excited":
                label = "excited lines"
            else:
                label = f"{kind} detection lines, Y - G U"
            ax.plot(f, to_decibel(rms), marker, ms=4, color=COLOR[kind], label=label)
    f = np.concatenate([levels.f_excited, levels.f_odd, levels.f_even])
    noise = np.concatenate([levels.noise_excited, levels.noise_odd, levels.noise_even])
    if np.isfinite(noise).all() and np.any(noise > 0):
        order = np.argsort(f)
        ax.plot(
            f[order],
            to_decibel(noise[order]),
            "-",
            lw=0.8,
            color=COLOR["noise"],
            label="std by noise",
        )
    ax.set(
        xscale="log",
        xlabel="frequency [Hz]",
        ylabel=f"output amplitude [dB, {bla.y_unit or 'unit of y'}]",
        title=f"Output{f' {bla.y_name}' * bool(bla.y_name)} by kind of line",
    )
    return finish_axes(
        crop_rounding(ax, np.abs(np.concatenate([levels.excited, levels.odd, levels.even], axis=1)))
    )


def plot_opinion(opinion: SecondOpinion, *, ax: Axes | None = None) -> Axes:
    """Draw the two estimates of the distortion by `nlfrf.second_opinion`, as standard deviations.

    Parameters
    ----------
    opinion : SecondOpinion
        Result of that function.
    ax : matplotlib Axes, optional
        Axes to draw on; by default a new figure.
    """
    require_kind("opinion", opinion, SecondOpinion)
    ax = axes_or_new(ax)
    ax.plot(
        opinion.f,
        to_decibel(np.sqrt(opinion.roughness)),
        "-",
        lw=1.4,
        color=COLOR["excited"],
        label="roughness of the FRF",
    )
    if np.isfinite(opinion.detection).any():
        read = to_decibel(np.sqrt(opinion.detection))
        ax.plot(
            opinion.f,
            read,
            "-",
            lw=1.4,
            color=COLOR["odd"],
            label="odd detection lines, corrected for the grid",
        )
        disagreement = opinion.disagree
        if disagreement.any():
            label = f"more than {DISAGREEMENT_DB:g} dB apart"
            ax.plot(
                opinion.f[disagreement],
                read[disagreement],
                "o",
                ms=5,
                mfc="none",
                color=COLOR["even"],
                label=label,
            )
    ax.set(
        xscale="log",
        xlabel="frequency [Hz]",
        ylabel=f"std of one FRF [dB, {opinion.unit or 'unit of y / u'}]",
        title="Two estimates of the distortion",
    )
    return finish_axes(ax)


def _describe_measurement(bla: Bla) -> str:
    """Describe grid, realisations, periods and source of the level in one line."""
    made = bla.experiment
    return (
        f"{made.grid} grid, {format_count(made.n_realizations, 'realisation')},"
        f" {format_count(made.n_periods, 'period')}, distortion from {bla.level_source}"
    )


def _require_single(bla: Bla) -> None:
    """Refuse anything but a `Bla` with one input and one output."""
    require_kind("bla", bla, Bla)
    require_one_channel("bla", bla, ": use plot_frm, plot_frm_bounds, or bla.entry(output, input)")
