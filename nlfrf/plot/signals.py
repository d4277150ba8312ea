"""Pictures of signals: what is played, what was measured."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nlfrf.excitation.multisine import Multisine
from nlfrf.identification.neighbours import place_lines
from nlfrf.identification.spectra import dft
from nlfrf.plot.look import COLOR, MARKER, ROUNDING
from nlfrf.records.record import Record
from nlfrf.shared.arguments import of_kind, one_of
from nlfrf.shared.axes import axes, db, finished, note
from nlfrf.shared.wording import in_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["plot_excitation", "plot_input", "plot_samples", "plot_spectrum"]


HARMONICS = 48  # of a grid are shown, so that each is seen


def plot_excitation(ms: Multisine, *, ax: Axes | None = None) -> Axes:
    """One period of the first realisation in time; arguments as in `plot_bla`."""
    of_kind("ms", ms, Multisine)
    ax = axes(ax)
    t = np.arange(ms.n_samples) / ms.fs
    ax.plot(t, ms.u[0], "-", lw=0.6, color=COLOR["excited"])
    ax.axhline(ms.rms, color=COLOR["bound"], lw=1, label=f"rms {ms.rms:.3g}, crest factor {ms.crest_factor[0]:.2f}")
    ax.set(xlabel="time [s]", ylabel="u [unit of u]", title=f"{ms.kind} multisine, {ms.f.size} lines")
    return finished(ax)


def plot_spectrum(ms: Multisine, *, ax: Axes | None = None) -> Axes:
    """The first lines of a multisine one by one: what is played, and where to listen; arguments as in `plot_bla`."""
    of_kind("ms", ms, Multisine)
    ax = axes(ax)
    last = int(ms.lines.excited[-1])
    first = int(ms.lines.excited[0])
    shown = min(last, first + HARMONICS)
    mine = ms.lines.excited <= shown
    same = " like this" * bool(np.ptp(ms.amplitude) < 1e-6 * ms.amplitude.max())
    more = f"; it goes on{same} up to {last}" if shown < last else ""
    ax.vlines(ms.lines.excited[mine], 0, ms.amplitude[mine], color=COLOR["excited"], lw=1.2)
    ax.plot(ms.lines.excited[mine], ms.amplitude[mine], "o", ms=4, color=COLOR["excited"], label="excited")
    for kind, marker in (("odd", "x"), ("even", "+")):
        lines = getattr(ms.lines, kind)
        lines = lines[lines <= shown]
        if lines.size:
            ax.plot(
                lines, np.zeros(lines.size), marker, ms=6, color=COLOR[kind], label=f"{kind} detection, nothing played"
            )
    ax.set(
        xlabel=f"harmonic of {ms.f0:g} Hz{more}",
        ylabel="amplitude [unit of u]",
        xlim=(max(first - 1.5, -0.5), shown + 0.5),
        ylim=(-0.06 * ms.amplitude.max(), 1.12 * ms.amplitude.max()),
        title=f"Harmonic grid, {ms.f[0]:g} to {ms.f[-1]:g} Hz, {ms.f.size} excited lines",
    )
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
    of_kind("record", record, Record)
    one_of("signal", signal, ("u", "y", "r"))
    samples = getattr(record, signal)
    if samples is None:
        raise ValueError(f"signal must be one that the record has, got {signal!r}")
    ax, periods = axes(ax), samples[0]
    t = np.arange(record.n_samples) / record.fs
    for p, period in enumerate(periods):
        last = p == len(periods) - 1
        label = "last period" if last else "periods before" if p == 0 else None
        ax.plot(t, period, "-", lw=0.6, color=COLOR["excited" if last else "noise"], label=label)
    name, unit = getattr(record, f"{signal}_name", "") or signal, getattr(record, f"{signal}_unit", "")
    rms = float(np.sqrt(np.mean(periods[-1] ** 2)))
    crest = float(np.abs(periods[-1]).max()) / rms if rms else np.nan
    ax.set(
        xlabel="time [s]",
        ylabel=in_unit(name, unit, f"unit of {signal}"),
        title=f"{name}: {len(periods)} periods over one another, rms {rms:.3g}, crest factor {crest:.2f}",
    )
    return finished(ax)


def plot_input(record: Record, *, ax: Axes | None = None) -> Axes:
    """Input spectrum by kind of line: what stands where nothing was to be excited; arguments as in `plot_bla`."""
    of_kind("record", record, Record)
    ax, grid = axes(ax), record.lines
    lines = place_lines(grid).lines
    U = np.sqrt(np.mean(np.abs(dft(record.u, lines)) ** 2, axis=(0, 1)))
    top, lower = np.nanmax(db(U)), []
    for kind, marker in MARKER.items():
        mine = getattr(grid, kind)
        if mine.size:
            level = db(U[np.searchsorted(lines, mine)])
            label = "excited lines" if kind == "excited" else f"{kind} detection lines"
            if np.all(np.nan_to_num(level, nan=-np.inf) < top - ROUNDING):
                lower.append(label)
            else:
                ax.plot(mine * record.f0, level, marker, ms=4, color=COLOR[kind], label=label)
    ax.set(
        xscale="log",
        xlabel="frequency [Hz]",
        ylabel=f"input amplitude [dB, {record.u_unit or 'unit of u'}]",
        ylim=(max(np.nanmin(db(U)), top - ROUNDING) - 5, top + 10),
        title=f"Input{f' {record.u_name}' * bool(record.u_name)} by kind of line",
    )
    if lower:
        note(ax, f"{' and '.join(lower)}: more than {ROUNDING:g} dB lower")
    return finished(ax)
