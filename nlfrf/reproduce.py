"""The paper reproduced: its figures, its findings with a number beside each, written to a folder.

Figures 3 to 7 show what the paper's figures show; where its text and not its drawing says what belongs in one,
the arrangement is ours: 3 the BLA at the three levels, 4 to 6 the output on excited and detection lines for the
odd, odd-odd and special-odd grid (equations 7, 8 and 9), 7 the three grids compared.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nlfrf.checks import integer
from nlfrf.files import write_whole
from nlfrf.level_study import LevelStudy, level_study
from nlfrf.paper import (
    GRIDS,
    LEVELS,
    Ensemble,
    Ensembles,
    Finding,
    db,
    ensemble,
    findings,
    frf,
    output_linear,
    output_rms,
    output_stochastic,
    paper_multisine,
    systematic_over_detection,
)
from nlfrf.remarks import SIGNALS, side_remarks
from nlfrf.rig import Rig, paper_rig
from nlfrf.simulate import simulate

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Levels of the study [N rms], 10 dB apart.
STUDIED = 0.0025 * 10 ** np.arange(0, 3.1, 0.5)
BLUE, ORANGE, GREEN, RED, GREY = "tab:blue", "tab:orange", "tab:green", "tab:red", "0.6"


def reproduce(
    out: Any,
    *,
    n_realizations: int = 100,
    seed: int = 1,
    executor: Executor | None = None,
    progress: Callable[[int, int], Any] | None = None,
    resume: Any = None,
) -> list[Finding]:
    """Run the paper's experiments and write its figures and findings.

    Writes figure3.png to figure7.png, random_odd.png, excitations.png, levels.png, findings.json and findings.md.

    Parameters
    ----------
    out : path
        Folder; made where it does not exist.
    n_realizations : int
        Realisations of each case, at least 10; the paper has 100.
    seed : int
        Of all random numbers.
    executor, progress, resume
        As for `nlfrf.simulate`; progress counts realisations over everything.

    Returns
    -------
    list of Finding
    """
    m, seed = integer("n_realizations", n_realizations, least=10), integer("seed", seed, least=0)
    folder = Path(out)
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"out must be a folder, got the file {folder}")
    folder.mkdir(parents=True, exist_ok=True)
    rig, rng, few = paper_rig(), np.random.default_rng(seed), max(4, m // 10)
    total = m * (len(LEVELS) * len(GRIDS) + len(SIGNALS) + 1) + few * STUDIED.size
    done = 0

    def count(before: int) -> Callable[[int, int], Any] | None:
        return None if progress is None else lambda now, _: progress(before + now, total)

    ensembles: Ensembles = {}
    for level in LEVELS:
        for kind in GRIDS:
            ms = paper_multisine(kind, level, n_realizations=m, rng=rng)
            record = simulate(rig, ms, executor=executor, progress=count(done), resume=resume)
            ensembles[level, kind] = ensemble(record)
            done += m
    found = findings(ensembles, rig)
    remarks, signals = side_remarks(
        rig, ensembles[1, "odd"], rng=rng, executor=executor, progress=count(done), resume=resume
    )
    done += m * (len(SIGNALS) + 1)
    ms = paper_multisine("special-odd", 1, n_realizations=few, rng=rng)
    study = level_study(rig, ms, STUDIED, n_discard=4, executor=executor, progress=count(done), resume=resume)
    found = [*found, *remarks]
    for name, figure in pictures(ensembles, signals, study, rig):
        write_whole(folder / f"{name}.png", lambda path, f=figure: f.savefig(path, dpi=110))  # type: ignore[misc]
    content = {"n_realizations": m, "seed": seed, "findings": [asdict(finding) for finding in found]}
    write_whole(folder / "findings.json", lambda path: write_text(path, json.dumps(content, indent=2) + "\n"))
    write_whole(folder / "findings.md", lambda path: write_text(path, table(found, m)))
    return found


def write_text(path: Path, text: str) -> None:
    """Write text as UTF-8."""
    path.write_text(text, encoding="utf-8")


def table(found: list[Finding], n_realizations: int) -> str:
    """The findings as a table in Markdown."""
    rows = [
        f"# Findings with {n_realizations} realisations a case",
        "",
        "| | claim | paper | ours | holds if | holds |",
        "|---|---|---|---|---|---|",
    ]
    for finding in found:
        ours = "<br>".join(f"{name}: {number:.3g}" for name, number in finding.ours.items())
        yes = "yes" if finding.holds else "**no**"
        rows.append(f"| {finding.name} | {finding.claim} | {finding.paper} | {ours} | {finding.criterion} | {yes} |")
    notes = [f"- {finding.name}: {finding.remark}" for finding in found if finding.remark]
    return "\n".join([*rows, "", "## Where and why ours differs", "", *notes, ""])


def pictures(
    ensembles: Ensembles, signals: dict[str, Ensemble], study: LevelStudy, rig: Rig
) -> list[tuple[str, Figure]]:
    """Every figure with its name."""
    names = {"odd": "figure4", "odd-odd": "figure5", "special-odd": "figure6", "random-odd": "random_odd"}
    return [
        ("figure3", figure_levels(ensembles)),
        *((names[kind], figure_grid(ensembles, kind, rig)) for kind in GRIDS),
        ("figure7", figure_comparison(ensembles)),
        ("excitations", figure_excitations(signals)),
        ("levels", figure_study(study)),
    ]


def new_figure(width: float, height: float, rows: int = 1, columns: int = 1, **options: Any) -> tuple[Figure, Any]:
    """A figure that belongs to no window, and its axes as an array."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False, **options).ravel()


def figure_levels(ensembles: Ensembles) -> Figure:
    """Figure 3: the BLA at the three levels, amplitude and phase."""
    figure, (top, bottom) = new_figure(8, 7, 2, sharex=True)
    for level, colour in zip(LEVELS, (BLUE, GREEN, RED), strict=True):
        e = ensembles[level, "odd"]
        G, variance = frf(e)
        f = e.lines.excited * e.f0
        label = f"level {level} ({LEVELS[level]:g} N rms)"
        top.plot(f, 2 * db(np.abs(G)), color=colour, label=label)
        top.plot(f, db(variance), color=colour, lw=0.6, ls=":")
        bottom.plot(f, np.degrees(np.unwrap(np.angle(G))), color=colour)
    top.set(ylabel="|G| [dB re 1 m/N]", title="Figure 3. BLA on the odd grid (dotted: its standard deviation)")
    bottom.set(xlabel="frequency [Hz]", ylabel="phase [deg]")
    return finished(figure, (top, bottom))


def figure_grid(ensembles: Ensembles, kind: str, rig: Rig) -> Figure:
    """Figures 4 to 6: the output on excited and detection lines at the three levels."""
    figure, axes = new_figure(8, 11, 3, sharex=True)
    number = {"odd": "Figure 4. ", "odd-odd": "Figure 5. ", "special-odd": "Figure 6. "}.get(kind, "")
    for level, ax in zip(LEVELS, axes, strict=True):
        e = ensembles[level, kind]
        f = e.lines.excited * e.f0
        ax.plot(f, 2 * db(np.abs(output_linear(e))), color=BLUE, label="linear output, eq. (7)")
        ax.plot(f, 2 * db(output_stochastic(e)), color=RED, label="stochastic distortion, eq. (8)")
        if e.lines.odd.size:
            ax.plot(
                e.lines.odd * e.f0,
                2 * db(output_rms(e, e.lines.odd)),
                ".",
                ms=4,
                color=ORANGE,
                label="odd lines, eq. (9)",
            )
        even = output_rms(e, e.lines.even)
        floor = 2 * db(np.sqrt(np.mean(even**2)))
        if kind == "special-odd":
            odd = np.interp(e.lines.excited, e.lines.odd, 2 * db(output_rms(e, e.lines.odd)))
            ax.plot(f, odd + systematic_over_detection(e, rig), color=GREEN, lw=0.8, label="systematic distortion")
        ax.plot(
            e.lines.even * e.f0, 2 * db(even), ".", ms=2, color=GREY, label=f"even lines, eq. (9): rms {floor:.0f} dB"
        )
        ax.set(ylabel="output [dB re 1 m]", title=f"level {level}, {LEVELS[level]:g} N rms")
    axes[0].set_title(f"{number}{kind.capitalize()} grid: level 1, {LEVELS[1]:g} N rms")
    axes[-1].set_xlabel("frequency [Hz]")
    return finished(figure, axes)


def figure_comparison(ensembles: Ensembles) -> Figure:
    """Figure 7: the BLAs of the three grids at level 1, and their differences beside the standard deviation."""
    figure, (top, bottom) = new_figure(8, 7, 2, sharex=True)
    G_odd, variance = frf(ensembles[1, "odd"])
    lines = ensembles[1, "odd"].lines.excited
    for kind, colour in zip(GRIDS[:3], (BLUE, ORANGE, GREEN), strict=True):
        e = ensembles[1, kind]
        G, other = frf(e)
        f = e.lines.excited * e.f0
        top.plot(f, 2 * db(np.abs(G)), color=colour, label=kind)
        if kind != "odd":
            _, i, j = np.intersect1d(lines, e.lines.excited, return_indices=True)
            bottom.plot(f[j], 2 * db(np.abs(G_odd[i] - G[j])), ".", color=colour, label=f"odd minus {kind}")
            bottom.plot(f[j], db(variance[i] + other[j]), color=colour, lw=0.8, label="standard deviation of it")
    top.set(ylabel="|G| [dB re 1 m/N]", title="Figure 7. Three grids, one BLA (level 1)")
    bottom.set(xlabel="frequency [Hz]", ylabel="difference [dB re 1 m/N]")
    return finished(figure, (top, bottom))


def figure_excitations(signals: dict[str, Ensemble]) -> Figure:
    """Side remarks: the BLAs of signals with the same power spectrum and other distributions."""
    figure, (top, bottom) = new_figure(8, 7, 2, sharex=True)
    G_first, variance = frf(signals[SIGNALS[0]])
    for signal, colour in zip(SIGNALS, ("black", GREY, BLUE, ORANGE, RED), strict=True):
        e = signals[signal]
        G, other = frf(e)
        f = e.lines.excited * e.f0
        top.plot(f, 2 * db(np.abs(G)), color=colour, label=signal)
        if signal != SIGNALS[0]:
            ratio = np.abs(G - G_first) ** 2 / (variance + other)
            bottom.plot(f, ratio, ".", color=colour, label=f"{signal}: mean {np.mean(ratio):.1f}")
    top.set(ylabel="|G| [dB re 1 m/N]", title="Same power spectrum, other distributions (held for 1/64 s)")
    bottom.set(xlabel="frequency [Hz]", ylabel="squared difference over its variance", yscale="log")
    return finished(figure, (top, bottom))


def figure_study(study: LevelStudy) -> Figure:
    """The level study: the family, and how fast its distortion grows."""
    figure, axes = new_figure(8, 10, 3, sharex=True)
    plot_level_study(study, axes=axes)
    return figure


def plot_level_study(study: LevelStudy, *, axes: Any = None) -> Any:
    """Draw a level study on three axes: the BLAs, the distortion, and its growth per 20 dB of level."""
    if axes is None:
        _, axes = new_figure(8, 10, 3, sharex=True)
    import matplotlib

    colours = matplotlib.colormaps["viridis"](np.linspace(0, 0.9, study.rms.size))
    for i, (level, bla, colour) in enumerate(zip(study.rms, study.blas, colours, strict=True)):
        axes[0].plot(bla.f, 2 * db(np.abs(bla.G)), color=colour, label=f"{level:.3g} N rms")
        axes[1].plot(bla.f, db(study.distortion[i]), color=colour)
        if i > 0:
            label = f"to {level:.3g} N: median {np.median(study.growth[i - 1]):.0f} dB"
            axes[2].plot(bla.f, study.growth[i - 1], color=colour, lw=0.8, label=label)
    axes[0].set(ylabel="|G| [dB re 1 m/N]", title="The family over levels")
    axes[1].set(ylabel="distortion over |G| [dB]")
    axes[2].set(xlabel="frequency [Hz]", ylabel="growth [dB per 20 dB]")
    for ax in axes:
        grid(ax)
    return axes


def finished(figure: Figure, axes: Any) -> Figure:
    """The figure with grids and legends."""
    for ax in axes:
        grid(ax)
    return figure


def grid(ax: Axes) -> None:
    """A light grid, and a legend where there is something to name."""
    ax.grid(alpha=0.3)
    if ax.get_legend_handles_labels()[0]:
        ax.legend(fontsize="small")
