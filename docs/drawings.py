"""The drawings of the primer, from what the first example measured: what is played, what comes back, what it gives."""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

import nlfrf
import robust
from docs.gallery import made_from, outputs
from robust.plot import plot_check, plot_nyquist

KINDS = {"excited": "#1d2733", "odd": "#d1681f", "even": "#1f6fd1"}


def draw_all(folder: Path) -> None:
    """Every drawing, where the packages or this page have changed since."""
    folder.mkdir(parents=True, exist_ok=True)
    stamp = folder / "drawn.stamp"
    wanted = made_from("01_identify_then_design") + Path(__file__).read_text(encoding="utf-8")
    if stamp.is_file() and stamp.read_text(encoding="utf-8") == wanted:
        return
    stamp.unlink(missing_ok=True)
    made = outputs("01_identify_then_design")
    record, bla = nlfrf.load_record(made / "record.npz"), nlfrf.load(made / "bla.npz")
    model, K = robust.load(made / "model.json"), robust.load(made / "controller.json")
    report = robust.check(model, K, w_P=robust.performance_weight(2 * np.pi * 3.3, M_S=2.5, A=1e-2))
    drawn = {
        "played": played(record),
        "answer": answer(record),
        "bound": bound(bla),
        "discs": one(plot_nyquist, report, width=5.2, height=4.6),
        "verdict": one(plot_check, report),
    }
    for name, figure in drawn.items():
        figure.savefig(folder / f"{name}.png", dpi=110)
    plt.close("all")
    stamp.write_text(wanted, encoding="utf-8")


def one(draw, *content, width: float = 7.4, height: float = 4.0) -> Figure:
    """One picture of the package."""
    figure = Figure(figsize=(width, height), layout="constrained")
    draw(*content, ax=figure.add_subplot())
    return figure


def played(record: nlfrf.Record) -> Figure:
    """A second of the multisine, and the first of its lines."""
    figure = Figure(figsize=(7.4, 2.7), layout="constrained")
    left, right = figure.subplots(1, 2)
    n = int(record.fs)
    left.plot(np.arange(n) / record.fs, record.u[0, 0, :n], color=KINDS["excited"], lw=0.7)
    left.set(xlabel="time [s]", ylabel="u [N]", title="one second of what is played")
    lines = np.arange(1, 26)
    excited = np.isin(lines, record.lines.excited)
    kinds = np.where(excited, "excited", np.where(lines % 2, "odd", "even"))
    for kind, colour in KINDS.items():
        there = lines[kinds == kind]
        right.vlines(there, 0, 1.0 if kind == "excited" else 0.06, color=colour, lw=3)
        label = kind if kind == "excited" else f"{kind}, left free"
        right.plot(there, np.full(there.size, 1.0 if kind == "excited" else 0.06), "o", color=colour, ms=4, label=label)
    right.set(xlabel="line of the period", ylim=(0, 1.7), yticks=[], title="where it has power")
    right.legend(fontsize="x-small", loc="upper left")
    return figure


def answer(record: nlfrf.Record) -> Figure:
    """The spectrum of the output, by kind of line."""
    figure = Figure(figsize=(7.4, 3.4), layout="constrained")
    ax = figure.add_subplot()
    Y = np.abs(np.fft.rfft(record.y[0].mean(axis=0))) * 2 / record.y.shape[-1]
    for kind, colour in KINDS.items():
        lines = getattr(record.lines, kind)
        lines = lines[(lines > 0) & (lines * record.f0 < 160)]
        label = {"excited": "excited", "odd": "odd, left free", "even": "even, left free"}[kind]
        ax.plot(lines * record.f0, 20 * np.log10(Y[lines]), ".", color=colour, ms=4, label=label)
    ax.set(xlabel="frequency [Hz]", ylabel="output [dB]", title="what comes back, also on lines that nobody played")
    ax.legend(fontsize="small", loc="upper right")
    ax.grid(alpha=0.3)
    return figure


def bound(bla: nlfrf.Bla) -> Figure:
    """|G| and its bound, as a band."""
    figure = Figure(figsize=(7.4, 3.4), layout="constrained")
    ax = figure.add_subplot()
    G, r = np.abs(bla.G), bla.bound(of="realization")
    low, high = 20 * np.log10(np.maximum(G - r, 0.1 * G)), 20 * np.log10(G + r)
    ax.fill_between(bla.f, low, high, color="#1f6fd1", alpha=0.25)
    ax.plot(bla.f, 20 * np.log10(G), color=KINDS["excited"], lw=1.4)
    ax.set(xlabel="frequency [Hz]", ylabel="|G| [dB]", title="the FRF, and where that of another record lies")
    ax.grid(alpha=0.3)
    return figure


if __name__ == "__main__":
    draw_all(Path(__file__).parent / "generated" / "drawings")
