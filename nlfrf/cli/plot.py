"""The command `nlfrf plot`: a picture of a saved result."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

import nlfrf
from nlfrf._base.axes import save_figure
from nlfrf.cli.options import Out
from nlfrf.io.results import load_own


def plot(
    file: Annotated[
        Path, typer.Argument(help="Multisine, record, BLA or matrix written by a command of nlfrf.")
    ],
    out: Out,
    confidence: Annotated[float, typer.Option(help="Probability of the bound to draw.")] = 0.95,
) -> None:
    """Draw a saved result as .png, .pdf or .svg."""
    if out.suffix.lower() not in (".png", ".pdf", ".svg"):
        raise ValueError(f"out must end in .png, .pdf or .svg, got {out.name!r}")
    content = load_own(file)
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    from nlfrf import plot as pictures

    if isinstance(content, nlfrf.Record):
        content = nlfrf.identify(content)
    elif isinstance(content, nlfrf.signals.AxisExperiment):
        content = content.ms
    size = (9, 9)
    drawn: list[Callable[..., object]]
    if isinstance(content, nlfrf.Multisine):
        drawn = [pictures.plot_excitation, pictures.plot_spectrum]
    elif content.is_single:
        drawn = [
            partial(pictures.plot_bla, confidence=confidence),
            partial(pictures.plot_phase, confidence=confidence),
            pictures.plot_levels,
        ]
    else:
        drawn = [
            partial(pictures.plot_frm, confidence=confidence),
            partial(pictures.plot_singular_values, confidence=confidence),
        ]
        size = 3 * content.n_inputs + 3, 2 * content.n_outputs + 6
    figure, places = plt.subplots(len(drawn), 1, figsize=size, layout="constrained")
    for draw, ax in zip(drawn, places, strict=True):
        draw(content, ax=ax)
    save_figure(out, figure, dpi=120)
    plt.close(figure)
