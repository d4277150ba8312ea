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
from nlfrf.shared.axes import axes, bode_axes, db, finished, labelled, note, phase_band
from nlfrf.shared.wording import in_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = [
    "plot_bla",
    "plot_bode",
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
MARKER = {"excited": ".", "odd": "x", "even": "+"}  # and in grey
ROUNDING = 120.0  # dB under the input; what lies lower is of no interest
DEEPEST = 160.0  # dB under the output, or the FRF; the same
HARMONICS = 48  # of a grid are shown, so that each is seen


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
            ax.plot(
                f, db(level), MARKER[kind], ms=4, color=COLOR[kind], alpha=0.7, label=f"{kind} detection lines / |U|"
            )
    ax.plot(bla.f, db(np.sqrt(bla.var_total)), "-", lw=1.2, color="#CC79A7", label="std of G, noise and distortion")
    if np.isfinite(bla.var_noise).all():
        ax.plot(bla.f, db(np.sqrt(bla.var_noise)), "--", lw=1, color=COLOR["noise"], label="std of G, noise")
    draw_magnitude(ax, bla, confidence)
    ax.set(xscale="log", xlabel="frequency [Hz]", title=title(bla))
    return finished(cut(ax, np.abs(bla.G)))


def draw_magnitude(ax: Any, bla: Bla, confidence: float) -> None:
    """|G| with its bound as a band around it, and the axis that it is on."""
    size, radius = np.abs(bla.G), bla.bound(confidence)
    low = db(np.maximum(size - radius, 10 ** (-DEEPEST / 20) * size.max()))
    label = f"{100 * confidence:g} % bound"
    ax.fill_between(bla.f, low, db(size + radius), color=COLOR["bound"], alpha=0.35, lw=0, label=label)
    ax.plot(bla.f, db(size), ".-", ms=3, lw=1.2, color=COLOR["excited"], label="|G|, best linear approximation")
    floor = db(size[size > 0].min()) - 20 if np.any(size > 0) else None
    if ax.get_ylim()[0] < (floor or -np.inf) and len(ax.get_lines()) == 1:  # a bound above |G| has no lower edge
        ax.set_ylim(bottom=floor)
    ax.set(ylabel=f"magnitude [dB, {bla.unit or 'unit of y / u'}]")


def plot_bode(bla: Bla, *, confidence: float = 0.95, ax: Axes | None = None) -> tuple[Axes, Axes]:
    """Magnitude and phase of the BLA over logarithmic frequency, with its bound as a band around both.

    Parameters
    ----------
    bla : Bla
    confidence : float
        Probability of the bound that is drawn.
    ax : matplotlib Axes, optional
        Where to draw: it gives its place to the two that are returned; a new figure when not given.
    """
    top, bottom = bode_axes(ax)
    draw_magnitude(top, bla, confidence)
    top.set(xscale="log", title=title(bla))
    phase, wide = np.degrees(np.unwrap(np.angle(bla.G))), phase_band(bla.G, bla.bound(confidence))
    bottom.fill_between(bla.f, phase - wide, phase + wide, color=COLOR["bound"], alpha=0.35, lw=0)
    bottom.plot(bla.f, phase, ".-", ms=3, lw=1.2, color=COLOR["excited"])
    bottom.set(xscale="log", xlabel="frequency [Hz]", ylabel="phase [deg]")
    labelled(bottom, top)
    finished(top)
    return top, finished(bottom)


def plot_phase(bla: Bla, *, ax: Axes | None = None) -> Axes:
    """Unwrapped phase of the BLA in degrees; arguments as in `plot_bla`."""
    ax = axes(ax)
    ax.plot(bla.f, np.degrees(np.unwrap(np.angle(bla.G))), "-", color=COLOR["excited"], label="arg G")
    ax.set(xscale="log", xlabel="frequency [Hz]", ylabel="phase [deg]")
    return finished(ax)


def plot_levels(bla: Bla, *, ax: Axes | None = None) -> Axes:
    """Output spectrum by kind of line, with the noise floor; arguments as in `plot_bla`."""
    ax = axes(ax)
    levels = bla.levels
    for kind, marker in MARKER.items():
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
    ax.set(
        xscale="log",
        xlabel="frequency [Hz]",
        ylabel=f"output amplitude [dB, {bla.y_unit or 'unit of y'}]",
        title=f"Output{f' {bla.y_name}' * bool(bla.y_name)} by kind of line",
    )
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
    """The first lines of a multisine one by one: what is played, and where to listen; arguments as in `plot_bla`."""
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
    ax.set(
        xscale="log",
        xlabel="frequency [Hz]",
        ylabel=f"std of one FRF [dB, {opinion.unit or 'unit of y / u'}]",
        title="Two readings of one level",
    )
    return finished(ax)


def title(bla: Bla) -> str:
    """What was measured, in one line."""
    return f"{bla.grid} grid, M = {bla.n_realizations}, P = {bla.n_periods}, level from {bla.level_source}"


def cut(ax: Any, amplitude: np.ndarray) -> Any:
    """Leave out what lies at rounding, far under the largest amplitude, and say so."""
    bottom = float(db(amplitude.max())) - DEEPEST
    if ax.get_ylim()[0] < bottom:
        ax.set_ylim(bottom=bottom)
        unseen = [line for line in ax.get_lines() if np.all(np.nan_to_num(line.get_ydata(), nan=-np.inf) < bottom)]
        if unseen:
            note(ax, f"{'; '.join(str(line.get_label()) for line in unseen)}: more than {DEEPEST:g} dB lower")
        for line in unseen:
            line.set_label(None)
    return ax
