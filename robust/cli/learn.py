"""The commands `robust learn`: the input of a repeated trial."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

import robust
from nlfrf._base.arguments import require_positive, split_ratio_unit
from nlfrf._base.axes import write_pictures
from nlfrf._base.command import Commands, spinner
from nlfrf._base.files import write_text
from robust.cli.options import Delay, ModelFile, Out, Picture


class _DesignByDefault(typer.core.TyperGroup):
    """Commands with `design` as the default."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Put `design` in front of arguments without a command."""
        return super().parse_args(
            ctx, args if not args or args[0] in (*self.commands, "--help") else ["design", *args]
        )


learn_app = Commands(
    help="Learn the input of a repeated trial.",
    cls=_DesignByDefault,
    no_args_is_help=True,
)


@learn_app.command("design")
def design_learning(
    model: ModelFile,
    controller: Annotated[Path, typer.Argument(help="Sampled controller that stays in the loop.")],
    out: Out,
    factor: Annotated[
        float, typer.Option(help="Largest factor per trial, for every plant of the set.")
    ] = 0.8,
    cutoff: Annotated[
        float | None,
        typer.Option(help="Cut-off of Q [Hz]; default: the highest in the band with this factor."),
    ] = None,
    limit: Annotated[float, typer.Option(help="Largest learned |u|, in the unit of u.")] = np.inf,
    delay: Delay = None,
    picture: Picture = None,
) -> None:
    """Design a learning filter for a loop with repeated trials (the word design may be left
    out).
    """
    from robust.io.models import load_model
    from robust.reports.command import load_loops

    plant = load_model(model)
    [(K, late)] = load_loops([controller], delay, plant.origin.unit)
    if cutoff is None:
        omega_Q = None
    else:
        omega_Q = 2 * np.pi * require_positive("--cutoff", cutoff)
    with spinner("designing and proving"):
        learning = robust.design_learning(
            plant, K, factor=factor, omega_Q=omega_Q, delay=late, u_max=limit
        )
    print(learning)
    robust.save(learning, out)
    if picture is not None:
        from robust.plot import plot_contraction

        write_pictures(picture, [(plot_contraction, learning)])


@learn_app.command("step")
def step_learning(
    learning: Annotated[Path, typer.Argument(help="Filter from 'robust learn'.")],
    u: Annotated[Path, typer.Argument(help="File with the added input of the trial.")],
    e: Annotated[Path, typer.Argument(help="File with the error r - y of the trial.")],
    out: Annotated[
        Path, typer.Option("--out", "-o", help="File for the input of the next trial (.csv).")
    ],
    input_column: Annotated[
        str, typer.Option("--input", help="Column of the added input; default: by its name.")
    ] = "",
    error_column: Annotated[
        str, typer.Option("--error", help="Column of the error; default: by its name.")
    ] = "",
) -> None:
    """Compute the input of the next trial from input and error of the last trial, sampled like the
    controller.
    """
    from nlfrf.io.trials import read_trial
    from robust.io.learning import load_learning

    filters = load_learning(learning)
    unit_y, unit_u = split_ratio_unit(filters.model.origin.unit)
    added = read_trial(u, "u", dt=filters.dt, unit=unit_u, column=input_column)
    error = read_trial(e, "e", dt=filters.dt, unit=unit_y, column=error_column)
    found = filters.update(added.samples, error.samples)
    rows = [f"{k * filters.dt:.12g},{sample!r}" for k, sample in enumerate(found.tolist())]
    write_text(out, "\n".join(["t [s],learned input", *rows]) + "\n")
    print(f"u: {added}\ne: {error}\n{found.size} samples, at most {np.abs(found).max():.4g}")
