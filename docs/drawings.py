"""The drawings of the primer and of the pages on bounds, PID gains and friction proofs, as
computed.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import nlfrf
import robust
import robust.servo
from docs.gallery import made_from, outputs
from nlfrf.friction import VaryingSliders
from nlfrf.rig import Drive
from robust.friction import MaxwellSlip
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
        "both_bounds": both_bounds(record, bla),
        "levels": levels(),
        "gains": gains(),
        "verdicts_friction": verdicts_friction(),
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
    left.set(xlabel="time [s]", ylabel="u [N]", title="one second of the input")
    lines = np.arange(1, 26)
    excited = np.isin(lines, record.lines.excited)
    kinds = np.where(excited, "excited", np.where(lines % 2, "odd", "even"))
    for kind, colour in KINDS.items():
        there = lines[kinds == kind]
        right.vlines(there, 0, 1.0 if kind == "excited" else 0.06, color=colour, lw=3)
        label = kind if kind == "excited" else f"{kind}, not excited"
        right.plot(
            there,
            np.full(there.size, 1.0 if kind == "excited" else 0.06),
            "o",
            color=colour,
            ms=4,
            label=label,
        )
    right.set(xlabel="line of the period", ylim=(0, 1.7), yticks=[], title="lines of its spectrum")
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
        label = kind if kind == "excited" else f"{kind}, not excited"
        ax.plot(lines * record.f0, 20 * np.log10(Y[lines]), ".", color=colour, ms=4, label=label)
    ax.set(
        xlabel="frequency [Hz]",
        ylabel="amplitude of y [dB re 1 m]",
        title="distortion on lines without excitation",
    )
    ax.legend(fontsize="small", loc="upper right")
    ax.grid(alpha=0.3)
    return figure


def bound(bla: nlfrf.Bla) -> Figure:
    """|G| and its bound, as a band."""
    figure = Figure(figsize=(7.4, 3.4), layout="constrained")
    ax = figure.add_subplot()
    draw_band(
        ax,
        bla,
        "realization",
        color=KINDS["even"],
        alpha=0.25,
        label="FRF of another realisation, 95 % a line",
    )
    ax.plot(
        bla.f, 20 * np.log10(np.abs(bla.G)), color=KINDS["excited"], lw=1.4, label="measured FRF"
    )
    ax.set(xlabel="frequency [Hz]", ylabel="|G| [dB re 1 m/N]", title="the FRF and its bound")
    ax.legend(fontsize="small", loc="upper right")
    ax.grid(alpha=0.3)
    return figure


def draw_band(ax: Axes, bla: nlfrf.Bla, of: str, **look) -> None:
    """Draw the bound of |G| as a band [dB]."""
    G, r = np.abs(bla.G), bla.bound(of=of)
    ax.fill_between(
        bla.f, 20 * np.log10(np.maximum(G - r, 0.1 * G)), 20 * np.log10(G + r), lw=0, **look
    )


def both_bounds(record: nlfrf.Record, bla: nlfrf.Bla) -> Figure:
    """|G| with the bound of the BLA, that of a new realisation, and the FRF of such a one."""
    grid = {
        "fs": record.fs,
        "n_samples": record.u.shape[-1],
        "f_min": 1.25,
        "f_max": 150,
        "rms": 0.25,
    }
    other = nlfrf.simulate(
        nlfrf.paper_rig(), nlfrf.multisine("special-odd", **grid, rng=9), n_periods=2, n_discard=2
    )
    other = nlfrf.identify(other)
    figure = Figure(figsize=(7.4, 3.8), layout="constrained")
    ax = figure.add_subplot()
    for of, colour, what in (
        ("realization", "#9ec3f0", "FRF of another realisation"),
        ("bla", "#1f6fd1", "BLA"),
    ):
        draw_band(ax, bla, of, color=colour, alpha=0.6, label=f"contains the {what}, 95 % a line")
    ax.plot(
        bla.f,
        20 * np.log10(np.abs(bla.G)),
        color=KINDS["excited"],
        lw=1.2,
        label="measured FRF, one realisation",
    )
    ax.plot(
        other.f,
        20 * np.log10(np.abs(other.G)),
        ".",
        color=KINDS["odd"],
        ms=4,
        label="FRF of another realisation",
    )
    ax.set(
        xlabel="frequency [Hz]", ylabel="|G| [dB re 1 m/N]", title="The two bounds of one record"
    )
    ax.legend(fontsize="small", loc="lower left")
    ax.grid(alpha=0.3)
    return figure


def levels() -> Figure:
    """The FRF of the rig at two levels: gain and phase."""
    figure = Figure(figsize=(7.4, 4.2), layout="constrained")
    top, bottom = figure.subplots(2, 1, sharex=True)
    for rms, colour in ((0.1, KINDS["even"]), (3.0, KINDS["odd"])):
        ms = nlfrf.multisine(
            "special-odd", fs=4096, n_samples=16384, f_min=1.25, f_max=150, rms=rms, rng=2
        )
        bla = nlfrf.identify(nlfrf.simulate(nlfrf.paper_rig(), ms, n_periods=2, n_discard=2))
        top.plot(
            bla.f,
            20 * np.log10(np.abs(bla.G)),
            color=colour,
            lw=1.3,
            label=f"force of {rms:g} N rms",
        )
        bottom.plot(bla.f, np.degrees(np.unwrap(np.angle(bla.G))), color=colour, lw=1.3)
    top.set(ylabel="|G| [dB re 1 m/N]", title="One machine, two levels, two Bode plots")
    bottom.set(xlabel="frequency [Hz]", ylabel="Bode phase [deg]")
    top.legend(fontsize="small", loc="upper right")
    for ax in (top, bottom):
        ax.grid(alpha=0.3)
    return figure


def gains() -> Figure:
    """What the page on PID gains measures and designs: the FRF with its bound, and |S| of every
    plant in the bound.
    """
    ms = nlfrf.multisine(
        "special-odd", fs=1000, n_samples=4000, f_min=1, f_max=150, rms=0.25, rng=1
    )
    bla = nlfrf.identify(nlfrf.simulate(nlfrf.paper_rig(), ms, n_periods=2))
    report = robust.check(
        bla, robust.design_frf(bla, "PID", M_S=1.8, dt=1e-3, delay=5e-4).K, delay=5e-4
    )
    figure = Figure(figsize=(9.6, 3.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    draw_band(
        left,
        bla,
        "realization",
        color=KINDS["even"],
        alpha=0.25,
        label="FRF of another realisation, 95 % a line",
    )
    left.plot(
        bla.f, 20 * np.log10(np.abs(bla.G)), color=KINDS["excited"], lw=1.4, label="measured FRF"
    )
    left.set(
        xscale="log",
        xlabel="frequency [Hz]",
        ylabel="|G| [dB re 1 m/N]",
        title="measured: FRF and its bound",
    )
    curves = report.curves
    f, S = curves.omega / (2 * np.pi), np.abs(curves.S)
    worst = S / (1 - curves.rs)
    right.fill_between(
        f, 20 * np.log10(S), 20 * np.log10(worst), color=KINDS["even"], alpha=0.25, lw=0
    )
    right.plot(
        f,
        20 * np.log10(worst),
        color=KINDS["even"],
        lw=1,
        label="largest |S| of the plants in the bound",
    )
    right.plot(
        f, 20 * np.log10(S), color=KINDS["excited"], lw=1.4, label="|S| with the measured FRF"
    )
    right.axhline(
        20 * np.log10(1.8), color=KINDS["odd"], ls="--", lw=1.4, label="M_S = 1.8 (5.1 dB)"
    )
    right.set(
        xscale="log",
        xlabel="frequency [Hz]",
        ylabel="|S| [dB]",
        title="designed: sensitivity under its limit",
    )
    right.set(ylim=(-13, 13))
    for ax, corner in ((left, "lower left"), (right, "upper left")):
        ax.legend(fontsize="small", loc=corner)
        ax.grid(alpha=0.3)
    return figure


def verdicts_friction() -> Figure:
    """A mass with Maxwell-slip friction under a P-PI cascade, pushed and left alone: one run for
    each verdict.
    """
    free = robust.friction_plant(1.0, 0.0)
    pi = Drive(fs=1000, kv=31, kp=126, kp_unit="N/(m/s)", tn=0.04)
    late = replace(pi, delay_periods=2.0)
    figure = Figure(figsize=(9.6, 5.2), layout="constrained")
    rows = [
        ("this run rests", replace(pi, tn=np.inf), MaxwellSlip(1e5, 3.0), 1.0, (0, 300)),
        ("this run hunts", pi, MaxwellSlip(1e5, 3.0), 1.0, (-300, 300)),
        ("this run vibrates", late, MaxwellSlip(3e5, 1.5), 1.0, (-12, 12)),
        ("this run rests", pi, MaxwellSlip(1e5, 2.0), None, (-60, 60)),
    ]
    for ax, (text, settings, friction, Fs, limits) in zip(
        figure.subplots(2, 2).flat, rows, strict=True
    ):
        K = robust.servo.cascade(settings, output_unit="N")
        proof = robust.prove_friction(free, K, friction, delay=settings.delay, Fs=Fs)
        law = VaryingSliders(
            stiffness=[friction.K0], strength=[1.0], stiction=friction.stiction, vs=1e-3
        )
        drive = replace(settings, velocity_feedforward=1.0)
        axis = nlfrf.rig.ServoAxis(motor_inertia=1.0, drive=drive, motor_friction=law)
        push = np.append(5 * np.linspace(0, 1, 300), np.zeros(3700))  # N
        x = 1e6 * np.ravel(nlfrf.rig.run(axis, {"force": push}, oversampling=8).x)[: push.size]
        ax.plot(np.arange(push.size) / settings.fs, x, color=KINDS["even"], lw=0.9)
        if np.isfinite(proof.settling_error):
            error = 1e6 * proof.settling_error
            ax.axhline(-error, color=KINDS["odd"], ls="--", lw=1.2)
            ax.axhline(error, color=KINDS["odd"], ls="--", lw=1.2, label="settling_error")
            ax.legend(fontsize="small", loc="center right", bbox_to_anchor=(1, 0.78))
        ax.set(
            xlabel="time [s]", ylabel="position [µm]", ylim=limits, title=f"{proof.verdict}: {text}"
        )
        ax.grid(alpha=0.3)
    return figure


if __name__ == "__main__":
    draw_all(Path(__file__).parent / "generated" / "drawings")
