"""Pictures of signals: excitations, excited and detection lines, measured samples, input spectra."""

from __future__ import annotations

from itertools import cycle
from typing import TYPE_CHECKING

import numpy as np

from nlfrf._base.arguments import format_count, label_with_unit, require_choice, require_kind
from nlfrf._base.axes import (
    add_note,
    axes_or_new,
    finish_axes,
    finish_matrix,
    matrix_axes,
    to_decibel,
)
from nlfrf.bla.line_index import index_lines
from nlfrf.bla.spectra import period_dft
from nlfrf.plot.look import COLOR, COLOR_CYCLE, MARKER, ROUNDING_DB
from nlfrf.records.record import Record
from nlfrf.records.screened import Fault, ScreenedStreams
from nlfrf.signals.multisine import Multisine

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MAX_HARMONICS = 48  # harmonics of a grid that are shown, so that each is visible
_INPUT_COLORS = tuple(
    tone for tone in COLOR_CYCLE if tone not in (COLOR["odd"], COLOR["even"])
)  # of several inputs
#: Colours of the kinds of faults.
_FAULT_COLORS = {
    Fault.SILENCE: COLOR["noise"],
    Fault.REST: COLOR["even"],
    Fault.LOST: COLOR["odd"],
    Fault.DIFFERENT: "#E69F00",
}
_MAX_NAMED = 3  # spans of one kind in the legend
_MAX_PERIODS = 200  # periods whose start is marked
_LINE_OFFSET = 0.3  # [lines] distance between the markers of two inputs


def plot_excitation(ms: Multisine, *, ax: Axes | None = None) -> Axes:
    """Draw one period of the first realisation (draw of the random phases) over time, for every
    input.

    Parameters
    ----------
    ms : Multisine
    ax : matplotlib Axes, optional
        Axes to draw on; by default a new figure.
    """
    require_kind("ms", ms, Multisine)
    ax = axes_or_new(ax)
    t = np.arange(ms.n_samples) / ms.fs
    if not ms.is_single:
        for i, (u, color) in enumerate(zip(ms.u[:, 0], cycle(_INPUT_COLORS))):
            label = f"u{i + 1}: rms {ms.rms[i]:.3g}, crest factor {ms.crest_factor[i, 0]:.2f}"
            ax.plot(t, u, "-", lw=0.6, color=color, label=label)
        several = f", the first of {ms.n_experiments} experiments" * (ms.n_experiments > 1)
        what = f"{ms.design} {ms.kind} multisine{several}"
    else:
        ax.plot(t, ms.u[0], "-", lw=0.6, color=COLOR["excited"])
        label = f"rms {ms.rms:.3g}, crest factor {ms.crest_factor[0]:.2f}"
        ax.axhline(ms.rms, color=COLOR["bound"], lw=1, label=label)
        what = f"{ms.kind} multisine"
    ax.set(xlabel="time [s]", ylabel="u [unit of u]", title=f"{what}, {ms.f.size} lines")
    return finish_axes(ax)


def plot_spectrum(ms: Multisine, *, ax: Axes | None = None) -> Axes:
    """Draw the first excited lines of a multisine, and the detection lines (not excited) between
    them.

    Parameters
    ----------
    ms : Multisine
    ax : matplotlib Axes, optional
        Axes to draw on; by default a new figure.
    """
    require_kind("ms", ms, Multisine)
    ax = axes_or_new(ax)
    last = int(ms.lines.excited[-1])
    first = int(ms.lines.excited[0])
    shown = min(last, first + _MAX_HARMONICS)
    mine = ms.lines.excited <= shown
    amplitudes = _labelled_amplitudes(ms)
    top = max(float(size.max()) for size, _, _ in amplitudes.values())
    same = " like this" * all(
        np.ptp(size[size > 0]) < 1e-6 * top for size, _, _ in amplitudes.values()
    )
    if shown < last:
        more = f"; it continues{same} up to {last}"
    else:
        more = ""
    for label, (size, color, offset) in amplitudes.items():
        here = mine & (size > 0)
        ax.vlines(ms.lines.excited[here] + offset, 0, size[here], color=color, lw=1.2)
        ax.plot(ms.lines.excited[here] + offset, size[here], "o", ms=4, color=color, label=label)
    for kind, marker in (("odd", "x"), ("even", "+")):
        lines = getattr(ms.lines, kind)
        lines = lines[lines <= shown]
        if lines.size:
            ax.plot(
                lines,
                np.zeros(lines.size),
                marker,
                ms=6,
                color=COLOR[kind],
                label=f"{kind} detection, nothing played",
            )
    ax.set(
        xlabel=f"harmonic of {ms.f0:g} Hz{more}",
        ylabel="amplitude [unit of u]",
        xlim=(max(first - 1.5, -0.5), shown + 0.5),
        ylim=(-0.06 * top, 1.12 * top),
        title=f"Harmonic grid, {ms.f[0]:g} to {ms.f[-1]:g} Hz, {ms.f.size} excited lines",
    )
    return finish_axes(ax)


def plot_screened(screened: ScreenedStreams, *, ax: Axes | None = None) -> np.ndarray:
    """Draw a whole record over time with the findings of screening: periods, silence, outliers,
    lost samples.

    Parameters
    ----------
    screened : ScreenedStreams
        Findings of screening, as for `nlfrf inspect`.
    ax : matplotlib Axes, optional
        Axes in whose place the returned axes are drawn; by default a new figure.

    Returns
    -------
    (C, 1) ndarray of matplotlib Axes
        One for each stream.
    """
    require_kind("screened", screened, ScreenedStreams)
    known = bool(np.isfinite(screened.fs))
    if known:
        dt = 1 / screened.fs
    else:
        dt = 1.0
    period = f"{format_count(screened.starts.size, 'whole period')} of {screened.period:g} samples"
    made, foot = matrix_axes(
        ax, screened.labels, [period if screened.period else "no channel repeats"]
    )
    t = dt * np.arange(screened.samples.shape[1])
    for one, x, outliers in zip(made[:, 0], screened.samples, screened.outliers, strict=True):
        one.plot(t, x, "-", lw=0.6, color=COLOR["excited"], rasterized=True)
        for fault, color in _FAULT_COLORS.items():
            spans = [span for span in screened.spans if span.fault is fault]
            extents = [span.extent for span in spans[:_MAX_NAMED]] + ["..."] * (
                len(spans) > _MAX_NAMED
            )
            for span in spans:
                one.axvspan(dt * span.first, dt * span.end, color=color, alpha=0.35, lw=1)
            if spans:  # an empty patch: one entry of the legend for all spans
                one.fill_between(
                    [],
                    [],
                    [],
                    color=color,
                    alpha=0.35,
                    label=f"{fault.value}: {', '.join(extents)}",
                )
        for start in dt * screened.starts[:_MAX_PERIODS]:
            one.axvline(start, color=COLOR["noise"], lw=0.8, ls="--")
        if screened.starts.size:
            one.plot([], [], "--", lw=0.8, color=COLOR["noise"], label="a period begins")
        if outliers.size:
            label = (
                f"{format_count(outliers.size, 'outlier')}, the first at {dt * outliers[0]:.4g}"
                f" {'s' if known else ''}"
            )
            one.plot(
                dt * outliers,
                x[outliers],
                "o",
                ms=8,
                mfc="none",
                color=COLOR["odd"],
                label=label.strip(),
            )
        one.set_xlim(0, t[-1])
    return finish_matrix(made, foot, "time [s]" if known else "sample")


def _labelled_amplitudes(ms: Multisine) -> dict[str, tuple[np.ndarray, str, float]]:
    """Return amplitudes (F,) by label, each with a colour and an offset from the line, for each
    input.
    """
    if ms.is_single:
        return {"excited": (ms.amplitude, COLOR["excited"], 0.0)}
    sizes = np.sqrt(
        np.mean(np.abs(ms.spectrum) ** 2, axis=1)
    )  # mean over experiments, which differ with a mixing
    offset = _LINE_OFFSET * (np.arange(ms.n_inputs) - (ms.n_inputs - 1) / 2)
    return {
        f"u{i + 1}": (sizes[i], _INPUT_COLORS[i % len(_INPUT_COLORS)], float(offset[i]))
        for i in range(ms.n_inputs)
    }


def plot_samples(record: Record, *, signal: str = "u", ax: Axes | None = None) -> Axes:
    """Draw all periods of the first realisation (draw of the random phases) on top of each other.

    Parameters
    ----------
    record : Record
    signal : str
        Signal to draw: input "u", output "y" or reference "r".
    ax : matplotlib Axes, optional
        Axes to draw on; by default a new figure.
    """
    require_kind("record", record, Record)
    require_choice("signal", signal, ("u", "y", "r"))
    samples = getattr(record, signal)
    if samples is None:
        raise ValueError(f"signal must be one of the record, got {signal!r}")
    ax, periods = axes_or_new(ax), samples[0]
    t = np.arange(record.n_samples) / record.fs
    for p, period in enumerate(periods):
        last = p == len(periods) - 1
        if last:
            label = "last period"
        elif p == 0:
            label = "periods before"
        else:
            label = None
        ax.plot(t, period, "-", lw=0.6, color=COLOR["excited" if last else "noise"], label=label)
    name = getattr(record, f"{signal}_name", "") or signal
    unit = getattr(record, f"{signal}_unit", "")
    swing = periods[-1] - np.mean(periods[-1])
    rms = float(np.std(periods[-1]))
    if rms:
        crest = float(np.abs(swing).max()) / rms
    else:
        crest = np.nan
    ax.set(
        xlabel="time [s]",
        ylabel=label_with_unit(name, unit, f"unit of {signal}"),
        title=(
            f"{name}: {len(periods)} periods over one another; "
            f"without the mean: rms {rms:.3g}, crest factor {crest:.2f}"
        ),
    )
    return finish_axes(ax)


def plot_input(record: Record, *, ax: Axes | None = None) -> Axes:
    """Draw the input spectrum on excited and on detection lines (not excited).

    Parameters
    ----------
    record : Record
    ax : matplotlib Axes, optional
        Axes to draw on; by default a new figure.
    """
    require_kind("record", record, Record)
    ax, grid = axes_or_new(ax), record.lines
    lines = index_lines(grid).lines
    U = np.sqrt(np.mean(np.abs(period_dft(record.u, lines)) ** 2, axis=(0, 1)))
    top, lower = np.nanmax(to_decibel(U)), []
    for kind, marker in MARKER.items():
        mine = getattr(grid, kind)
        if mine.size:
            level = to_decibel(U[np.searchsorted(lines, mine)])
            if kind == "excited":
                label = "excited lines"
            else:
                label = f"{kind} detection lines"
            if np.all(np.nan_to_num(level, nan=-np.inf) < top - ROUNDING_DB):
                lower.append(label)
            else:
                ax.plot(mine * record.f0, level, marker, ms=4, color=COLOR[kind], label=label)
    ax.set(
        xscale="log",
        xlabel="frequency [Hz]",
        ylabel=f"input amplitude [dB, {record.u_unit or 'unit of u'}]",
        ylim=(max(np.nanmin(to_decibel(U)), top - ROUNDING_DB) - 5, top + 10),
        title=f"Input{f' {record.u_name}' * bool(record.u_name)} by kind of line",
    )
    if lower:
        add_note(ax, f"{' and '.join(lower)}: more than {ROUNDING_DB:g} dB lower")
    return finish_axes(ax)
