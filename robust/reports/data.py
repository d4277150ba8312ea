"""The sections of the report page on measurement and model."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain, repeat
from typing import TypeVar

import control
import numpy as np

import nlfrf
from nlfrf import Bla, Record
from nlfrf._base.arguments import format_count
from nlfrf.plot import (
    plot_bla,
    plot_bode,
    plot_frm,
    plot_frm_bounds,
    plot_input,
    plot_levels,
    plot_opinion,
    plot_samples,
    plot_singular_values,
)
from robust.analysis.text import describe_confidence
from robust.lti.lti import poles, timebase, zeros
from robust.lti.sampling import without_pade
from robust.models.fit.nominal_fit import NominalFit
from robust.models.sets.model import UncertaintyModel
from robust.models.validation import Validation, validate
from robust.pages import html
from robust.pages.section import Fact, Section
from robust.plot import plot_budget, plot_fit, plot_set, plot_weight
from robust.reports.parts import describe_roots, describe_system, rows_of_value

# energy on other lines is given as a number only if it is less far below the excited ones
_NEGLIGIBLE_DECIBELS = 100.0


Measured = TypeVar("Measured", Record, Bla)


def _numbered(before: str, measured: list[Measured]) -> Iterator[tuple[str, Measured]]:
    """Yield the number of each record or BLA as text, and the record or BLA; the text of a single
    one is empty.
    """
    for number, one in enumerate(measured, 1):
        yield f"{before} record {number}" * (len(measured) > 1), one


def excitation_section(records: list[Record], blas: list[Bla]) -> Section:
    """Return the section on grid, lines, level and length of each record; `blas` give the kind of
    the grid.
    """
    facts, pictures = [], []
    for (which, record), bla in zip(
        _numbered(" of", records), chain(blas, repeat(None)), strict=False
    ):
        grid, u = record.lines, record.u[0, -1]
        rms = " ".join([f"{u.std():.4g}", *record.u_unit.split()])
        kind = "given" if bla is None else bla.experiment.grid
        facts += [
            Fact(
                f"excitation{which}",
                f"{kind} grid, {grid.excited.size} excited lines from"
                f" {grid.excited[0] * record.f0:g} to {grid.excited[-1] * record.f0:g} Hz,"
                f" {grid.odd.size} odd and {grid.even.size} even detection lines; rms {rms}, crest"
                f" factor {np.abs(u - u.mean()).max() / u.std():.3g}",
            ),
            Fact(
                f"record{which}",
                f"{format_count(record.n_realizations, 'realisation')} of"
                f" {format_count(record.n_periods, 'period')} of {record.n_samples} samples at"
                f" {record.fs:g} Hz: {record.u.size / record.fs:.4g} s, resolution"
                f" {record.f0:.4g} Hz",
            ),
        ]
        pictures += [
            html.draw_picture(
                f"Input spectrum{which}: {_describe_stray_energy(record)}.", plot_input, record
            ),
            html.draw_picture(
                f"Input{which} in time, all periods over one another.", plot_samples, record
            ),
            html.draw_picture(
                f"Output{which} in time, the last period in black.",
                plot_samples,
                record,
                signal="y",
            ),
        ]
    if not records:
        facts = [Fact("record", "not given to this report")]
    return Section(
        "record",
        "Excitation and record",
        "If the periods coincide, the machine was in steady state and its channels worked.",
        facts=facts,
        pictures=pictures,
    )


def _describe_stray_energy(record: Record) -> str:
    """Return the largest line that should not be excited, in dB below the rms of the excited lines,
    as text.
    """
    grid = record.lines
    spectrum = np.abs(np.fft.rfft(record.u, axis=-1)) / record.n_samples * 2
    power = np.mean(spectrum**2, axis=(0, 1))
    detection = np.concatenate([grid.odd, grid.even])
    if not detection.size:
        return "every line of the band was excited"
    with np.errstate(divide="ignore"):
        below = 10 * np.log10(np.mean(power[grid.excited]) / np.max(power[detection]))
    if below > _NEGLIGIBLE_DECIBELS:
        return f"detection lines are more than {_NEGLIGIBLE_DECIBELS:g} dB below the excited ones"
    return f"the largest detection line is {below:.0f} dB below the excited ones"


def _describe_directions(bla: Bla) -> str:
    """Return largest and smallest singular value and condition as text, with a note if the weakest
    is not measured.
    """
    sigma, low, _ = nlfrf.bla.singular_values(bla)
    with np.errstate(divide="ignore", invalid="ignore"):
        condition = np.nan_to_num(sigma[0] / sigma[-1], nan=np.inf, posinf=np.inf)
    k, lost = int(condition.argmax()), int(np.count_nonzero(low[-1] == 0))
    return (
        f"{len(sigma)} singular values on {bla.f.size} lines; largest {sigma[0].max():.4g},"
        f" smallest {sigma[-1].min():.4g}, condition at most {condition[k]:.4g} at {bla.f[k]:g} Hz"
        + (
            f"; on {lost} lines the set may contain a matrix of lower rank: the weakest direction"
            " is not measured" * (lost > 0)
        )
    )


def bla_section(blas: list[Bla]) -> Section:
    """Return the section on the best linear approximation, its distortion and its bound."""
    facts, pictures = [], []
    for which, bla in _numbered(" of", blas):
        if not bla.is_single:
            facts += [
                Fact(f"matrix{which}", rows_of_value(bla)),
                Fact(f"directions{which}", _describe_directions(bla)),
            ]
            pictures += [
                html.draw_picture(
                    f"Every entry{which} with its 95 % bound.", plot_frm, bla, tall=True
                ),
                html.draw_picture(
                    f"Parts of the bound of each entry{which}.", plot_frm_bounds, bla, tall=True
                ),
                html.draw_picture(
                    f"Singular values{which}, with their bands by the bound of the matrix.",
                    plot_singular_values,
                    bla,
                ),
            ]
            continue
        facts.append(Fact(f"BLA{which}", rows_of_value(bla)))
        pictures += [
            html.draw_picture(
                f"Best linear approximation{which} with its 95 % bound.", plot_bode, bla, tall=True
            ),
            html.draw_picture(f"The same{which}, with the parts of the bound.", plot_bla, bla),
        ]
        if np.any(np.isfinite(bla.levels.excited)):  # an FRF of another program has none
            caption = f"Output{which} by kind of line: linear, distortion, noise."
            pictures.append(html.draw_picture(caption, plot_levels, bla))
    condition = "Subject to the warnings, the" if any(bla.warnings for bla in blas) else "The"
    return Section(
        "bla",
        "Best linear approximation",
        f"{condition} bound contains the best linear approximation, on each line with 95 %"
        " probability. It holds for this excitation at this level, and not for other levels.",
        facts=facts or (Fact("BLA", "not given to this report"),),
        pictures=pictures,
    )


def cross_check_section(records: list[Record]) -> Section:
    """Return the section on the distortion level by a second, independent method."""
    facts, pictures = [], []
    for which, record in _numbered(" on", records):
        opinion = nlfrf.second_opinion(record)
        facts.append(
            Fact(f"opinion{which}", rows_of_value(opinion).removeprefix("second opinion: "))
        )
        pictures.append(
            html.draw_picture(f"The distortion level by two methods{which}.", plot_opinion, opinion)
        )
    return Section(
        "opinion",
        "Second opinion",
        "Detection lines and the roughness of the FRF over the excited lines fail for different"
        " reasons: if both agree, the level is credible.",
        facts=facts or (Fact("opinion", "needs the record, which was not given"),),
        pictures=pictures,
    )


def nominal_section(
    model: UncertaintyModel, nominal: NominalFit | None, blas: list[Bla]
) -> Section:
    """Return the section on the nominal model and the measured lines."""
    if model.measured_only:
        facts = [
            Fact(
                "nominal plant", f"the measured FRF itself, on {np.size(model.nominal.omega)} lines"
            )
        ]
    else:
        facts = [
            Fact("nominal plant", describe_system(model.nominal)),
            *_roots_of_plant(model.nominal),
        ]
    if nominal is not None:
        facts.append(Fact("fit", str(nominal).removeprefix("nominal model: ")))
    for which, bla in _numbered(",", blas):
        if not np.isnan(model.confidence):
            seen = validate(model, bla)
            outside = f"{seen.n_outside_set} of {seen.n_lines} lines of the BLA lie outside"
            facts.append(Fact(f"lines in the set{which}", outside + _describe_change(seen)))

    shown = "Nominal plant and its set" + ", with the lines that were measured" * bool(blas)
    pictures = [html.draw_picture(f"{shown}.", plot_set, model, blas, tall=True)]
    if nominal is not None:
        pictures.append(
            html.draw_picture("Measured lines, model, and their difference.", plot_fit, nominal)
        )
    return Section(
        "nominal",
        "Nominal fit",
        "The radius of the set contains the misfit.",
        facts=facts,
        pictures=pictures,
    )


def _roots_of_plant(G: control.StateSpace) -> list[Fact]:
    """Return the facts on poles, zeros and delay; a Padé approximation in a continuous plant is
    shown as a delay.
    """
    single, dt = G.ninputs == G.noutputs == 1, timebase(G)
    if single and not dt:
        rest, delay = without_pade(G)
    else:
        rest, delay = G, 0.0
    rows = [Fact("poles", describe_roots(poles(rest), dt))]
    rows += [Fact("zeros", describe_roots(zeros(rest), dt))] * single
    late = f"{1e3 * delay:.4g} ms, by an all-pass of order {G.nstates - rest.nstates} (Padé)"
    return rows + [Fact("delay", late)] * (delay > 0)


def _describe_change(seen: Validation) -> str:
    """Return the change between a record and the record of the model as text; empty if they are the
    same.
    """
    change = seen.change
    if change is None:
        return ""
    return (
        f"; compared with the record of the model p = {seen.p_value:.2g} for another gain"
        f" ({100 * change.gain:+.2g} %), frequency ({100 * change.frequency:+.2g} %) or delay"
        f" ({1e3 * change.delay:+.2g} ms), the rest is {change.level:.2g} times the scatter of both"
    )


def set_section(model: UncertaintyModel) -> Section:
    """Return the section on uncertainty set and weight."""
    facts = (
        Fact("set", str(model)),
        Fact("class of perturbations", model.perturbation),
        Fact("confidence", "; ".join(describe_confidence(model)) or "none claimed"),
        Fact(
            "outside the measured band",
            f"nothing was measured; assumed: {model.origin.extrapolation}",
        ),
        Fact("source", model.origin.source),
    )
    pictures = [
        html.draw_picture(
            "Radius on the lines, its parts, and the weight over it.", plot_weight, model
        )
    ]
    if model.is_single:
        lead = (
            "The set contains every plant whose distance from the nominal is below the weight."
            " Grey: assumed."
        )
        if model.budget:
            caption = (
                "Parts of the radius, their share as the mean over the lines, and what to measure"
                " next."
            )
            pictures.append(html.draw_picture(caption, plot_budget, model))
    else:
        lead = "Choose the form before you see the verdict; trying two is a multiple test."
    return Section(
        "set",
        "Uncertainty and weight",
        lead,
        facts=facts,
        pictures=pictures,
    )
