"""Pictures: the excitation, the output by kind of line, the BLA with its bound. They compute nothing but units."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nlfrf.excitation.multisine import Multisine
from nlfrf.identification.bla import Bla
from nlfrf.identification.neighbours import place_lines
from nlfrf.identification.second_opinion import DISAGREE, SecondOpinion
from nlfrf.identification.spectra import dft
from nlfrf.records.record import Record
from nlfrf.shared.arguments import one_of
from nlfrf.shared.axes import axes, db, finished

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = [
    "plot_bla",
    "plot_excitation",
    "plot_input",
    "plot_levels",
    "plot_opinion",
    "plot_phase",
    "plot_samples",
    "plot_spectrum",
]


# one colour a kind of line in every picture, told apart by colour-blind readers too
COLOR = {"excited": "#000000", "odd": "#D55E00", "even": "#0072B2", "noise": "#999999", "bound": "#009E73"}
ROUNDING = 120.0  # dB under the input; what lies lower is of no interest
DEEPEST = 160.0  # dB under the output, or the FRF; the same


def plot_bla(bla: Bla, *, confidence: float = 0.95, ax: Axes | None = None) -> Axes:
    """Magnitude of the BLA with its bound, standard deviations, and what the detection lines say.

    Parameters
    ----------
    bla : Bla
    confidence : float
        Probability of the bound that is drawn.
    ax : matplotlib Axes, optional
        Where to draw; a new figure when not given.
    """
    ax = axes(ax)
    known = bla.G != 0  # an even system leaves excited lines empty
    U = np.abs(bla.levels.excited[:, known]).mean(axis=0) / np.abs(bla.G[known])
    for kind, f, amplitude in (
        ("odd", bla.levels.f_odd, bla.levels.odd),
        ("even", bla.levels.f_even, bla.levels.even),
    ):
        if f.size and U.size:
            level = np.sqrt(np.mean(np.abs(amplitude) ** 2, axis=0)) / np.interp(f, bla.f[known], U)
            ax.plot(f, db(level), ".", ms=3, color=COLOR[kind], alpha=0.6, label=f"{kind} detection lines / |U|")
    ax.plot(bla.f, db(np.sqrt(bla.var_total)), "-", lw=1.2, color="#CC79A7", label="std of G, noise and distortion")
    if np.isfinite(bla.var_noise).all():
        ax.plot(bla.f, db(np.sqrt(bla.var_noise)), "-", lw=1, color=COLOR["noise"], label="std of G, noise")
    ax.plot(bla.f, db(bla.bound(confidence)), "-", lw=1.6, color=COLOR["bound"], label=f"{100 * confidence:g} % bound")
    ax.plot(bla.f, db(np.abs(bla.G)), "-", lw=1.6, color=COLOR["excited"], label="|G|, best linear approximation")
    ax.set(xlabel="frequency [Hz]", ylabel="magnitude [dB, unit of y / u]", title=title(bla))
    return finished(cut(ax, np.abs(bla.G)))


def plot_phase(bla: Bla, *, ax: Axes | None = None) -> Axes:
    """Unwrapped phase of the BLA in degrees; arguments as in `plot_bla`."""
    ax = axes(ax)
    ax.plot(bla.f, np.degrees(np.unwrap(np.angle(bla.G))), "-", color=COLOR["excited"], label="arg G")
    ax.set(xlabel="frequency [Hz]", ylabel="phase [deg]")
    return finished(ax)


def plot_levels(bla: Bla, *, ax: Axes | None = None) -> Axes:
    """Output spectrum by kind of line, with the noise floor; arguments as in `plot_bla`."""
    ax = axes(ax)
    levels = bla.levels
    for kind, marker in (("excited", "."), ("odd", "x"), ("even", "+")):
        f, amplitude = getattr(levels, f"f_{kind}"), getattr(levels, kind)
        if f.size:
            rms = np.sqrt(np.mean(np.abs(amplitude) ** 2, axis=0))
            label = "excited lines" if kind == "excited" else f"{kind} detection lines, Y - G U"
            ax.plot(f, db(rms), marker, ms=4, color=COLOR[kind], label=label)
    f = np.concatenate([levels.f_excited, levels.f_odd, levels.f_even])
    noise = np.concatenate([levels.noise_excited, levels.noise_odd, levels.noise_even])
    if np.isfinite(noise).all() and np.any(noise > 0):
        order = np.argsort(f)
        ax.plot(f[order], db(noise[order]), "-", lw=0.8, color=COLOR["noise"], label="std by noise")
    ax.set(xlabel="frequency [Hz]", ylabel="output amplitude [dB, unit of y]", title="Output by kind of line")
    return finished(cut(ax, np.abs(np.concatenate([levels.excited, levels.odd, levels.even], axis=1))))


def plot_excitation(ms: Multisine, *, ax: Axes | None = None) -> Axes:
    """One period of the first realisation in time; arguments as in `plot_bla`."""
    ax = axes(ax)
    t = np.arange(ms.n_samples) / ms.fs
    ax.plot(t, ms.u[0], "-", lw=0.6, color=COLOR["excited"])
    ax.axhline(ms.rms, color=COLOR["bound"], lw=1, label=f"rms {ms.rms:.3g}, crest factor {ms.crest_factor[0]:.2f}")
    ax.set(xlabel="time [s]", ylabel="u [unit of u]", title=f"{ms.kind} multisine, {ms.f.size} lines")
    return finished(ax)


def plot_spectrum(ms: Multisine, *, ax: Axes | None = None) -> Axes:
    """Amplitude spectrum of a multisine, the places of its detection lines under it; arguments as in `plot_bla`."""
    ax = axes(ax)
    ax.plot(ms.f, db(ms.amplitude), ".", color=COLOR["excited"], label="excited")
    low = db(ms.amplitude).min() - 6  # they have no amplitude: two rows beside one another
    for kind, marker, row in (("odd", "x", low), ("even", "+", low - 1)):
        lines = getattr(ms.lines, kind)
        if lines.size:
            where = np.full(lines.size, row)
            ax.plot(lines * ms.f0, where, marker, ms=4, color=COLOR[kind], label=f"{kind} detection, zero amplitude")
    ax.set(xlabel="frequency [Hz]", ylabel="amplitude [dB, unit of u]", title="Harmonic grid")
    return finished(ax)


def plot_samples(record: Record, *, signal: str = "u", ax: Axes | None = None) -> Axes:
    """Every period of the first realisation over one another: what was played and measured, in time.

    Parameters
    ----------
    record : Record
    signal : str
        "u", "y" or "r".
    ax : matplotlib Axes, optional
        Where to draw; a new figure when not given.
    """
    one_of("signal", signal, ("u", "y", "r"))
    samples = getattr(record, signal)
    if samples is None:
        raise ValueError(f"signal must be one that the record has, got {signal!r}")
    ax, periods = axes(ax), samples[0]
    t = np.arange(record.n_samples) / record.fs
    for p, period in enumerate(periods):
        last = p == len(periods) - 1
        ax.plot(t, period, "-", lw=0.6, color=COLOR["excited" if last else "noise"])
    rms = float(np.sqrt(np.mean(periods[-1] ** 2)))
    crest = float(np.abs(periods[-1]).max()) / rms if rms else np.nan
    ax.set(
        xlabel="time [s]",
        ylabel=f"{signal} [unit of {signal}]",
        title=f"{signal}: {len(periods)} periods over one another, rms {rms:.3g}, crest factor {crest:.2f}",
    )
    return finished(ax)


def plot_input(record: Record, *, ax: Axes | None = None) -> Axes:
    """Input spectrum by kind of line: what stands where nothing was to be excited; arguments as in `plot_bla`."""
    ax, grid = axes(ax), record.lines
    lines = place_lines(grid).lines
    U = np.sqrt(np.mean(np.abs(dft(record.u, lines)) ** 2, axis=(0, 1)))
    top = np.nanmax(db(U))
    for kind, marker in (("excited", "."), ("odd", "x"), ("even", "+")):
        mine = getattr(grid, kind)
        if mine.size:
            level = db(U[np.searchsorted(lines, mine)])
            label = "excited lines" if kind == "excited" else f"{kind} detection lines"
            if np.all(np.nan_to_num(level, nan=-np.inf) < top - ROUNDING):
                label += f": more than {ROUNDING:g} dB lower"
            ax.plot(mine * record.f0, level, marker, ms=4, color=COLOR[kind], label=label)
    ax.set(
        xlabel="frequency [Hz]",
        ylabel="input amplitude [dB, unit of u]",
        ylim=(max(np.nanmin(db(U)), top - ROUNDING) - 5, top + 10),
        title="Input by kind of line",
    )
    return finished(ax)


def plot_opinion(opinion: SecondOpinion, *, ax: Axes | None = None) -> Axes:
    """The two readings of the distortion level, as standard deviations; arguments as in `plot_bla`."""
    ax = axes(ax)
    ax.plot(
        opinion.f, db(np.sqrt(opinion.roughness)), "-", lw=1.4, color=COLOR["excited"], label="roughness of the FRF"
    )
    if np.isfinite(opinion.detection).any():
        read = db(np.sqrt(opinion.detection))
        ax.plot(opinion.f, read, "-", lw=1.4, color=COLOR["odd"], label="odd detection lines, calibrated")
        apart = opinion.disagree
        if apart.any():
            label = f"more than {DISAGREE:g} dB apart"
            ax.plot(opinion.f[apart], read[apart], "o", ms=5, mfc="none", color=COLOR["even"], label=label)
    ax.set(xlabel="frequency [Hz]", ylabel="std of one FRF [dB, unit of y / u]", title="Two readings of one level")
    return finished(ax)


def title(bla: Bla) -> str:
    """What was measured, in one line."""
    return f"{bla.grid} grid, M = {bla.n_realizations}, P = {bla.n_periods}, level from {bla.level_source}"


def cut(ax: Any, amplitude: np.ndarray) -> Any:
    """Leave out what lies at rounding, far under the largest amplitude; the legend says so."""
    bottom = float(db(amplitude.max())) - DEEPEST
    if ax.get_ylim()[0] < bottom:
        ax.set_ylim(bottom=bottom)
        for line in ax.get_lines():
            if np.all(np.nan_to_num(line.get_ydata(), nan=-np.inf) < bottom):
                line.set_label(f"{line.get_label()}: more than {DEEPEST:g} dB lower")
    return ax
