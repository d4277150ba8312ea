"""The figures of the paper, drawn from its ensembles."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from ensembles import (
    GRIDS,
    LEVELS,
    Ensembles,
    frf,
    output_linear,
    output_rms,
    output_stochastic,
    power_db,
    systematic_over_detection,
)
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from nlfrf.rig import Rig

_BLUE, _ORANGE, _GREEN, _RED, _GREY = "tab:blue", "tab:orange", "tab:green", "tab:red", "0.6"


def draw_figures(ensembles: Ensembles, rig: Rig) -> dict[str, Figure]:
    """Every figure by its name."""
    names = {
        "odd": "figure4",
        "odd-odd": "figure5",
        "special-odd": "figure6",
        "random-odd": "random_odd",
    }
    grids = {names[kind]: _figure_grid(ensembles, kind, rig) for kind in GRIDS}
    return {"figure3": _figure_levels(ensembles), **grids, "figure7": _figure_comparison(ensembles)}


def _new_figure(height: float, rows: int) -> tuple[Figure, np.ndarray]:
    """Create a figure that belongs to no window, and its axes as an array, one under the other."""
    figure = Figure(figsize=(8, height), layout="constrained")
    return figure, figure.subplots(rows, sharex=True)


def _figure_levels(ensembles: Ensembles) -> Figure:
    """Draw figure 3: the BLA at the three levels, amplitude and phase."""
    figure, (top, bottom) = _new_figure(7, 2)
    for level, colour in zip(LEVELS, (_BLUE, _GREEN, _RED), strict=True):
        e = ensembles[level, "odd"]
        G, variance = frf(e)
        f = e.lines.excited * e.f0
        label = f"level {level} ({LEVELS[level]:g} N rms)"
        top.plot(f, 2 * power_db(np.abs(G)), color=colour, label=label)
        top.plot(f, power_db(variance), color=colour, lw=0.6, ls=":")
        bottom.plot(f, np.degrees(np.unwrap(np.angle(G))), color=colour)
    top.set(
        ylabel="|G| [dB re 1 m/N]",
        title="Figure 3. BLA on the odd grid (dotted: its standard deviation)",
    )
    bottom.set(xlabel="frequency [Hz]", ylabel="phase [deg]")
    return _add_grids(figure, (top, bottom))


def _figure_grid(ensembles: Ensembles, kind: str, rig: Rig) -> Figure:
    """Draw figures 4 to 6: the output on excited and detection lines at the three levels."""
    figure, axes = _new_figure(11, 3)
    number = {"odd": "Figure 4. ", "odd-odd": "Figure 5. ", "special-odd": "Figure 6. "}.get(
        kind, ""
    )
    for level, ax in zip(LEVELS, axes, strict=True):
        e = ensembles[level, kind]
        f = e.lines.excited * e.f0
        ax.plot(
            f, 2 * power_db(np.abs(output_linear(e))), color=_BLUE, label="linear output, eq. (7)"
        )
        ax.plot(
            f,
            2 * power_db(output_stochastic(e)),
            color=_RED,
            label="stochastic distortion, eq. (8)",
        )
        if e.lines.odd.size:
            ax.plot(
                e.lines.odd * e.f0,
                2 * power_db(output_rms(e, e.lines.odd)),
                ".",
                ms=4,
                color=_ORANGE,
                label="odd lines, eq. (9)",
            )
        even = output_rms(e, e.lines.even)
        floor = 2 * power_db(np.sqrt(np.mean(even**2)))
        if kind == "special-odd":
            odd = np.interp(e.lines.excited, e.lines.odd, 2 * power_db(output_rms(e, e.lines.odd)))
            ax.plot(
                f,
                odd + systematic_over_detection(e, rig),
                color=_GREEN,
                lw=0.8,
                label="systematic distortion",
            )
        ax.plot(
            e.lines.even * e.f0,
            2 * power_db(even),
            ".",
            ms=2,
            color=_GREY,
            label=f"even lines, eq. (9): rms {floor:.0f} dB",
        )
        ax.set(ylabel="output [dB re 1 m]", title=f"level {level}, {LEVELS[level]:g} N rms")
    axes[0].set_title(f"{number}{kind.capitalize()} grid: level 1, {LEVELS[1]:g} N rms")
    axes[-1].set_xlabel("frequency [Hz]")
    return _add_grids(figure, axes)


def _figure_comparison(ensembles: Ensembles) -> Figure:
    """Draw figure 7: the BLAs of the three grids at level 1, their differences and the standard
    deviation.
    """
    figure, (top, bottom) = _new_figure(7, 2)
    G_odd, variance = frf(ensembles[1, "odd"])
    lines = ensembles[1, "odd"].lines.excited
    for kind, colour in zip(GRIDS[:3], (_BLUE, _ORANGE, _GREEN), strict=True):
        e = ensembles[1, kind]
        G, other = frf(e)
        f = e.lines.excited * e.f0
        top.plot(f, 2 * power_db(np.abs(G)), color=colour, label=kind)
        if kind != "odd":
            _, i, j = np.intersect1d(lines, e.lines.excited, return_indices=True)
            bottom.plot(
                f[j],
                2 * power_db(np.abs(G_odd[i] - G[j])),
                ".",
                color=colour,
                label=f"odd minus {kind}",
            )
            bottom.plot(
                f[j],
                power_db(variance[i] + other[j]),
                color=colour,
                lw=0.8,
                label="standard deviation of it",
            )
    top.set(ylabel="|G| [dB re 1 m/N]", title="Figure 7. Three grids, one BLA (level 1)")
    bottom.set(xlabel="frequency [Hz]", ylabel="difference [dB re 1 m/N]")
    return _add_grids(figure, (top, bottom))


def _add_grids(figure: Figure, axes: Iterable[Axes]) -> Figure:
    """Add grids and legends to a figure."""
    for ax in axes:
        ax.grid(alpha=0.3)
        if ax.get_legend_handles_labels()[0]:
            ax.legend()
    return figure
