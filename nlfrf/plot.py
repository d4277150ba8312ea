"""Pictures: the excitation, the output by kind of line, the BLA with its bound. They compute nothing but units."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nlfrf.bla import Bla
from nlfrf.multisine import Multisine

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# one colour a kind of line in every picture, told apart by colour-blind readers too
COLOR = {"excited": "#000000", "odd": "#D55E00", "even": "#0072B2", "noise": "#999999", "bound": "#009E73"}


def plot_bla(bla: Bla, *, confidence: float = 0.95, ax: Axes | None = None) -> Axes:
    """Magnitude of the BLA with its bound, standard deviations, and what the detection lines say.

    Parameters
    ----------
    bla : Bla
    confidence : float
        Probability of the bound that is drawn.
    ax : matplotlib Axes, optional
        Where to draw; a new figure when not given.

    Returns
    -------
    matplotlib Axes
    """
    ax = axes(ax)
    U = np.abs(bla.levels.excited).mean(axis=0) / np.abs(bla.G)
    for kind, f, amplitude in (
        ("odd", bla.levels.f_odd, bla.levels.odd),
        ("even", bla.levels.f_even, bla.levels.even),
    ):
        if f.size:
            level = np.sqrt(np.mean(np.abs(amplitude) ** 2, axis=0)) / np.interp(f, bla.f, U)
            ax.plot(f, db(level), ".", ms=3, color=COLOR[kind], alpha=0.6, label=f"{kind} detection lines / |U|")
    ax.plot(bla.f, db(np.sqrt(bla.var_total)), "-", lw=1.2, color="#CC79A7", label="std of G, noise and distortion")
    if np.isfinite(bla.var_noise).all():
        ax.plot(bla.f, db(np.sqrt(bla.var_noise)), "-", lw=1, color=COLOR["noise"], label="std of G, noise")
    ax.plot(bla.f, db(bla.bound(confidence)), "-", lw=1.6, color=COLOR["bound"], label=f"{100 * confidence:g} % bound")
    ax.plot(bla.f, db(np.abs(bla.G)), "-", lw=1.6, color=COLOR["excited"], label="|G|, best linear approximation")
    ax.set(xlabel="frequency [Hz]", ylabel="magnitude [dB, unit of y / u]", title=title(bla))
    return finished(ax)


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
    return finished(ax)


def plot_excitation(ms: Multisine, *, ax: Axes | None = None) -> Axes:
    """One period of the first realisation in time; arguments as in `plot_bla`."""
    ax = axes(ax)
    t = np.arange(ms.n_samples) / ms.fs
    ax.plot(t, ms.u[0], "-", lw=0.6, color=COLOR["excited"])
    ax.axhline(ms.rms, color=COLOR["bound"], lw=1, label=f"rms {ms.rms:.3g}, crest factor {ms.crest_factor[0]:.2f}")
    ax.set(xlabel="time [s]", ylabel="u [unit of u]", title=f"{ms.kind} multisine, {ms.f.size} lines")
    return finished(ax)


def plot_spectrum(ms: Multisine, *, ax: Axes | None = None) -> Axes:
    """Amplitude spectrum of a multisine, with the places of its detection lines; arguments as in `plot_bla`."""
    ax = axes(ax)
    ax.plot(ms.f, db(ms.amplitude), ".", color=COLOR["excited"], label="excited")
    low = db(ms.amplitude).min() - 6
    for kind, marker in (("odd", "x"), ("even", "+")):
        lines = getattr(ms.lines, kind)
        if lines.size:
            where = np.full(lines.size, low)
            ax.plot(lines * ms.f0, where, marker, ms=4, color=COLOR[kind], label=f"{kind} detection")
    ax.set(xlabel="frequency [Hz]", ylabel="amplitude [dB, unit of u]", title="Harmonic grid")
    return finished(ax)


def title(bla: Bla) -> str:
    """What was measured, in one line."""
    return f"{bla.grid} grid, M = {bla.n_realizations}, P = {bla.n_periods}, level from {bla.level_source}"


def axes(ax: Axes | None) -> Any:
    """The axes given, or those of a new figure."""
    if ax is not None:
        return ax
    from matplotlib import pyplot as plt

    return plt.subplots(figsize=(8, 4.5), layout="constrained")[1]


def finished(ax: Any) -> Any:
    """Grid and legend, the same in every picture."""
    ax.grid(alpha=0.3)
    if ax.get_legend_handles_labels()[0]:
        ax.legend(fontsize="small", loc="best", framealpha=0.85)
    return ax


def db(x: np.ndarray) -> np.ndarray:
    """Amplitude in decibels; nan where it is zero."""
    x = np.asarray(x, dtype=float)
    return np.asarray(20 * np.log10(np.where(x > 0, x, np.nan)))
