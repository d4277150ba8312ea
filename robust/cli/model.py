"""The command `robust model`: a nominal model and a weight for a measured BLA or FRF."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import robust
from nlfrf._base.axes import write_pictures
from nlfrf._base.command import parse_number, spinner
from nlfrf._base.files import json_path
from robust.cli.options import Out, Picture

#: How an FRF of another program is read.
_RelativeStd = Annotated[
    float | None,
    typer.Option(help="For an FRF: standard deviation over |G|, from repeated sweeps."),
]
_Averages = Annotated[
    float | None,
    typer.Option(
        help="For an FRF: number of independent averages behind the coherence, or of sweeps."
    ),
]
_Channel = Annotated[str, typer.Option(help="Name of the FRF in a file with several, such as CH2.")]
_Columns = Annotated[
    str,
    typer.Option(
        help=(
            "For an FRF: its columns, 'f=col1 [Hz], re=col2 [Ohm], im=-col3 [Ohm]', or mag=,"
            " phase=."
        )
    ),
]

#: The radius of the set.
_Confidence = Annotated[
    float, typer.Option(help="Probability that the set contains a line of another realisation.")
]
_Simultaneous = Annotated[
    bool, typer.Option("--simultaneous", help="This probability for all lines together.")
]
_NoEven = Annotated[bool, typer.Option("--no-even", help="Leave out the even distortion.")]
_Systematic = Annotated[
    float | None,
    typer.Option(help="Systematic part of the distortion [dB above the odd level]."),
]
_Below = Annotated[
    str, typer.Option(help="Radius below the band: 'flat', or its slope [dB/decade].")
]
_Above = Annotated[
    str, typer.Option(help="Radius above the band: 'flat', or its slope [dB/decade].")
]
_Perturbation = Annotated[
    str, typer.Option(help="Class of the perturbations: statistical, LTI or operator.")
]


def model(
    bla: Annotated[
        list[Path],
        typer.Argument(
            help=(
                "BLA or matrix from 'nlfrf identify', or an FRF (see 'nlfrf inspect'); several make"
                " a family."
            )
        ),
    ],
    out: Out,
    poles: Annotated[
        int | None,
        typer.Option(
            help=(
                "Poles of the nominal model; default: as few as the loop of --bandwidth needs,"
                " without --bandwidth as "
                "many as the data need."
            )
        ),
    ] = None,
    zeros: Annotated[
        int | None, typer.Option(help="Zeros of the nominal model; default: one fewer than poles.")
    ] = None,
    delay: Annotated[
        str | None,
        typer.Option(
            help=(
                "Delay [s] of the nominal model, or 'estimate'; default: none with --poles, else"
                " from the phase."
            )
        ),
    ] = None,
    bandwidth: Annotated[
        float | None,
        typer.Option(
            help=(
                "Crossover [Hz] of the loop for which fit and order are chosen; default: the whole"
                " band."
            )
        ),
    ] = None,
    sample_time: Annotated[
        float, typer.Option(help="Sampling time [s] of a discrete model; 0 for continuous.")
    ] = 0.0,
    unstable: Annotated[bool, typer.Option("--unstable", help="Allow unstable poles.")] = False,
    form: Annotated[
        str | None,
        typer.Option(
            help=(
                "multiplicative (default), additive, inverse-..., coprime; for a matrix elements,"
                " additive, input."
            )
        ),
    ] = None,
    order: Annotated[
        int | None,
        typer.Option(help="Order of the weight; default: chosen, up to 12."),
    ] = None,
    confidence: _Confidence = 0.95,
    simultaneous: _Simultaneous = False,
    no_even: _NoEven = False,
    systematic: _Systematic = None,
    below: _Below = "flat",
    above: _Above = "20",
    perturbation: _Perturbation = "statistical",
    relative_std: _RelativeStd = None,
    averages: _Averages = None,
    channel: _Channel = "",
    columns: _Columns = "",
    picture: Picture = None,
) -> None:
    """Fit a nominal model to a measured BLA or FRF, and a weight to its uncertainty."""
    json_path(out)
    from robust.reports.command import fit_nominal_model, load_blas, model_pictures

    blas = load_blas(
        bla, relative_std=relative_std, n_averages=averages, channel=channel, columns=columns
    )
    tau = delay if delay in (None, "estimate") else parse_number("delay", delay)
    with spinner("fitting the nominal model"):
        nominal, words = fit_nominal_model(
            blas,
            n_poles=poles,
            n_zeros=zeros,
            delay=tau,
            dt=sample_time,
            stable=not unstable,
            bandwidth=bandwidth,
        )
    print(nominal)
    if words:
        print(words)
    with spinner("fitting the weight"):
        result = robust.uncertainty(
            blas,
            nominal,
            form=form,
            order=order,
            confidence=confidence,
            simultaneous=simultaneous,
            even=not no_even,
            systematic=systematic,
            below=below if below == "flat" else parse_number("below", below),
            above=above if above == "flat" else parse_number("above", above),
            perturbation=perturbation,
        )
    print(result)
    robust.save(result, out)
    if picture is not None:
        write_pictures(picture, model_pictures(result, blas))
