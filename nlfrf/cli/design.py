"""The command `nlfrf design`: a random-phase multisine."""

from __future__ import annotations

import warnings
from typing import Annotated

import numpy as np
import typer

import nlfrf
from nlfrf._base.arguments import format_count
from nlfrf._base.command import Decimal
from nlfrf.cli.options import Out
from nlfrf.signals.lines import KINDS, grid_lines

_MAX_BAND_GAP = 0.2  # share of the band that may lack lines at either end, without a warning
_SPARSE_GRIDS = ("odd-odd", "special-odd")  # grids without some of the odd lines


def design(
    out: Out,
    fs: Annotated[float, typer.Option(help="Sampling frequency [Hz].")],
    period: Annotated[int, typer.Option(help="Samples in one period.")],
    f_min: Annotated[float, typer.Option(help="Lowest frequency [Hz].")],
    f_max: Annotated[float, typer.Option(help="Highest frequency [Hz].")],
    kind: Annotated[
        str, typer.Option(help=f"Harmonic grid: {', '.join(KINDS[:-1])}.")
    ] = "special-odd",
    rms: Annotated[float, typer.Option(help="Root mean square of the signal.")] = 1.0,
    log_lines: Annotated[
        int | None, typer.Option(help="Keep about this many lines, spaced logarithmically.")
    ] = None,
    crest: Annotated[
        float | None,
        typer.Option(help="Lower the crest factor to this; the phases are then not random."),
    ] = None,
    realizations: Annotated[int, typer.Option(help="Realisations, with independent phases.")] = 1,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed of the random phases.")] = None,
    hold: Annotated[
        str, typer.Option(help="Signal between its samples: zoh, band-limited or unknown.")
    ] = "unknown",
    inputs: Annotated[
        int,
        typer.Option(
            help="Number of inputs of the machine; each realisation then needs so many experiments."
        ),
    ] = 1,
    zippered: Annotated[
        bool,
        typer.Option(
            "--zippered", help="Several inputs in one experiment, each with its own lines."
        ),
    ] = False,
    draws: Annotated[
        int,
        typer.Option(
            help="Draws of the phases for several inputs; the draw with the lowest peak is kept."
        ),
    ] = 1,
    decimal: Decimal = ".",
) -> None:
    """Design a random-phase multisine, and write it with its samples: .npz, .h5, or .csv, .mat,
    .wav to play.
    """
    if inputs > 1 and crest is not None:
        raise ValueError(
            f"--crest must be left out for several inputs, got {crest:g}: lower the peaks by"
            " --draws"
        )
    if inputs <= 1 and (zippered or draws != 1):
        raise ValueError(
            f"--inputs must be 2 or more for --{'zippered' if zippered else 'draws'}, got {inputs}"
        )
    ms = nlfrf.multisine(
        kind,
        fs=fs,
        n_samples=period,
        f_min=f_min,
        f_max=f_max,
        rms=rms,
        n_log=log_lines,
        n_realizations=realizations,
        rng=seed,
        hold=hold,
        n_inputs=inputs,
        design="zippered" if zippered else "orthogonal",
        n_draws=draws,
    )
    warn_of_band(ms, kind, f_min=f_min, f_max=f_max)
    if crest is not None:
        ms = nlfrf.reduce_crest(ms, target=crest, rng=seed)
    nlfrf.save(ms, out, decimal=decimal)
    if out.suffix.lower() == ".wav":
        print(f"full scale of the WAV file is {np.abs(ms.u).max():.6g}, in the unit of --rms")
    if inputs > 1:
        several = f", {format_count(ms.phase.shape[-2], 'experiment')} with {inputs} inputs"
    else:
        several = ""
    print(
        f"{ms.kind} multisine, {ms.f.size} excited lines from {ms.f[0]:g} to {ms.f[-1]:g} Hz,"
        f" resolution {ms.f0:g} Hz, period {ms.n_samples / ms.fs:g} s, rms {np.max(ms.rms):g},"
        f" crest factor {ms.crest_factor.max():.2f}{several}"
    )


def warn_of_band(ms: nlfrf.Multisine, kind: str, *, f_min: float, f_max: float) -> None:
    """Warn if the grid has no lines in a large part of the band at one end."""
    first, last = ms.f[[0, -1]].tolist()
    if first > (1 + _MAX_BAND_GAP) * f_min or last < (1 - _MAX_BAND_GAP) * f_max:
        warnings.warn(
            f"the wanted band is {f_min:g} to {f_max:g} Hz, but the excited lines go from {first:g}"
            f" to {last:g} Hz only; " + _suggest_lines(ms, kind, f_min),
            nlfrf.DataWarning,
            stacklevel=3,
        )


def _suggest_lines(ms: nlfrf.Multisine, kind: str, f_min: float) -> str:
    """Return the lines of a grid at its low end, and the options that give a line there, as
    text.
    """
    if f_min < ms.f0:
        n = int(np.ceil(ms.fs / f_min))
        return (
            f"a period of {ms.n_samples / ms.fs:g} s has no line below {ms.f0:g} Hz: give"
            f" --period {n}"
        )
    if kind not in _SPARSE_GRIDS:
        return "a longer period has lines nearer to its ends"
    # eight lines beyond the first excited one: one repetition of a special-odd grid, two of an
    # odd-odd one. Both are fixed patterns, so nothing is drawn from rng.
    lines = grid_lines(
        kind, 1, last=int(ms.f[0] / ms.f0 + 8.5), rng=np.random.default_rng()
    ).excited
    # six lines from two octaves below f_min on: the gap is nearly always among them
    listed = ", ".join(f"{k * ms.f0:g}" for k in lines[lines * ms.f0 > f_min / 4][:6])
    below = lines[lines * ms.f0 <= f_min] * ms.f0
    if below.size:
        other = (
            f", or --f-min {below[-1]:g}, which leaves a gap in the lines from {below[-1]:g} to"
            f" {ms.f[0]:g} Hz"
        )
    else:
        other = ""
    return (
        f"a {kind} grid has the lines {listed}, ... Hz at this resolution of {ms.f0:g} Hz: give a"
        f" longer period, such as --period {2 * ms.n_samples}{other}"
    )
