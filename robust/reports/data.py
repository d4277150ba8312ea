"""The sections of the report page on what was measured and modelled."""

from __future__ import annotations

import control
import numpy as np

import nlfrf
from nlfrf import Bla, Record
from nlfrf._base.arguments import format_count
from robust.analysis.text import describe_confidence
from robust.lti.lti import poles, timebase, zeros
from robust.lti.sampling import without_pade
from robust.models.fit.nominal import NominalFit
from robust.models.sets.model import UncertaintyModel
from robust.models.validation import Validation, validate
from robust.reports import parts
from robust.reports.parts import Section, describe_roots, describe_system, rows_of_value

_NEGLIGIBLE_DECIBELS = 100.0  # dB under the excited lines from which energy on the others is not worth a number


def excitation_section(records: list[Record], blas: list[Bla]) -> Section:
    """Return the section on grid, lines, level and length of each record; of `blas` the kind of the grid alone."""
    from nlfrf import plot

    facts, pictures = [], []
    for i, record in enumerate(records):
        which = f" of record {i + 1}" if len(records) > 1 else ""
        grid, u = record.lines, record.u[0, -1]
        rms = " ".join([f"{u.std():.4g}", *record.u_unit.split()])
        kind = blas[i].experiment.grid if i < len(blas) else "given"
        facts += [
            (
                f"excitation{which}",
                f"{kind} grid, {grid.excited.size} excited lines from {grid.excited[0] * record.f0:g} to "
                f"{grid.excited[-1] * record.f0:g} Hz, {grid.odd.size} odd and {grid.even.size} even detection lines; "
                f"rms {rms}, crest factor {np.abs(u - u.mean()).max() / u.std():.3g}",
            ),
            (
                f"record{which}",
                f"{format_count(record.n_realizations, 'realisation')} of {format_count(record.n_periods, 'period')} "
                f"of {record.n_samples} samples at {record.fs:g} Hz: {record.u.size / record.fs:.4g} s, "
                f"resolution {record.f0:.4g} Hz",
            ),
        ]
        pictures += [
            parts.draw_picture(
                plot.plot_input, record, caption=f"Input spectrum{which}: {_describe_stray_energy(record)}."
            ),
            parts.draw_picture(
                plot.plot_samples, record, caption=f"Input{which} in time, all periods over one another."
            ),
            parts.draw_picture(
                plot.plot_samples, record, signal="y", caption=f"Output{which} in time, the last period in black."
            ),
        ]
    if not records:
        facts = [("record", "was not handed over with this report")]
    return Section(
        name="record",
        title="Excitation and record",
        lead="Where periods lie over one another, the machine was in steady state and its channels worked.",
        facts=tuple(facts),
        pictures=tuple(pictures),
    )


def _describe_stray_energy(record: Record) -> str:
    """Return how much energy stands where none was to be, the largest line of it under the rms of the excited ones."""
    grid = record.lines
    spectrum = np.abs(np.fft.rfft(record.u, axis=-1)) / record.n_samples * 2
    power = np.mean(spectrum**2, axis=(0, 1))
    detection = np.concatenate([grid.odd, grid.even])
    if not detection.size:
        return "every line of the band was excited"
    with np.errstate(divide="ignore"):
        below = 10 * np.log10(np.mean(power[grid.excited]) / np.max(power[detection]))
    return (
        f"lines that were not to be excited lie over {_NEGLIGIBLE_DECIBELS:g} dB under the excited ones"
        if below > _NEGLIGIBLE_DECIBELS
        else f"of the lines that were not to be excited the largest lies {below:.0f} dB under the excited ones"
    )


def describe_directions(bla: Bla) -> str:
    """Return the largest and the smallest singular value, the condition, and whether the weakest was measured."""
    sigma, low, _ = nlfrf.bla.singular_values(bla)
    with np.errstate(divide="ignore", invalid="ignore"):
        condition = np.nan_to_num(sigma[0] / sigma[-1], nan=np.inf, posinf=np.inf)
    k, lost = int(condition.argmax()), int(np.count_nonzero(low[-1] == 0))
    return (
        f"{len(sigma)} singular values on {bla.f.size} lines; largest {sigma[0].max():.4g}, smallest "
        f"{sigma[-1].min():.4g}, condition at most {condition[k]:.4g} at {bla.f[k]:g} Hz"
    ) + (
        f"; on {lost} lines the set may hold a matrix of lower rank: the weakest direction is not measured" * (lost > 0)
    )


def bla_section(blas: list[Bla]) -> Section:
    """Return the best linear approximation, its levels and its bound."""
    from nlfrf import plot

    facts, pictures = [], []
    for i, bla in enumerate(blas):
        which = f" of record {i + 1}" if len(blas) > 1 else ""
        if not bla.is_single:
            facts += [(f"matrix{which}", rows_of_value(bla)), (f"directions{which}", describe_directions(bla))]
            pictures += [
                parts.draw_picture(plot.plot_frm, bla, tall=True, caption=f"Every entry{which} with its 95 % bound."),
                parts.draw_picture(plot.plot_frm_bounds, bla, tall=True, caption=f"What limits each entry{which}."),
                parts.draw_picture(
                    plot.plot_singular_values,
                    bla,
                    caption=f"Singular values{which}, in the bands that the bound of the matrix leaves them.",
                ),
            ]
            continue
        facts.append((f"BLA{which}", rows_of_value(bla)))
        pictures += [
            parts.draw_picture(
                plot.plot_bode, bla, tall=True, caption=f"Best linear approximation{which} with its 95 % bound."
            ),
            parts.draw_picture(plot.plot_bla, bla, caption=f"The same{which} over what makes the bound."),
        ]
        if np.any(np.isfinite(bla.levels.excited)):  # an FRF of another program has none
            caption = f"Output{which} by kind of line: linear, distortion, noise."
            pictures.append(parts.draw_picture(plot.plot_levels, bla, caption=caption))
    condition = "Subject to the warnings, the" if any(bla.warnings for bla in blas) else "The"
    return Section(
        name="bla",
        title="Best linear approximation",
        lead=f"{condition} bound holds the best linear approximation, line by line, with 95 % probability; it is for "
        "this excitation, at this level, and says nothing about other levels.",
        facts=tuple(facts) or (("BLA", "was not handed over with this report"),),
        pictures=tuple(pictures),
    )


def cross_check_section(records: list[Record]) -> Section:
    """Return the distortion level read a second time, by means that fail for other reasons."""
    from nlfrf import plot

    facts, pictures = [], []
    for i, record in enumerate(records):
        which = f" on record {i + 1}" if len(records) > 1 else ""
        opinion = nlfrf.second_opinion(record)
        facts.append((f"opinion{which}", rows_of_value(opinion).removeprefix("second opinion: ")))
        pictures.append(
            parts.draw_picture(plot.plot_opinion, opinion, caption=f"The distortion level read twice{which}.")
        )
    return Section(
        name="opinion",
        title="Second opinion",
        lead="The lines that were not excited and the roughness of the FRF over the excited ones fail for different "
        "reasons: where both agree the level can be believed.",
        facts=tuple(facts) or (("opinion", "needs the record, which was not handed over"),),
        pictures=tuple(pictures),
    )


def nominal_section(model: UncertaintyModel, nominal: NominalFit | None, blas: list[Bla]) -> Section:
    """Return the model in the middle against the measured lines."""
    from robust import plot

    facts: list[tuple[str, str]] = []
    if model.measured_only:
        facts.append(("nominal plant", f"the measured FRF itself, on {np.size(model.nominal.omega)} lines"))
    else:
        facts.append(("nominal plant", describe_system(model.nominal)))
        facts += roots_of_plant(model.nominal)
    if nominal is not None:
        facts.append(("fit", str(nominal).removeprefix("nominal model: ")))
    for i, bla in enumerate(blas):
        if not np.isnan(model.confidence):
            seen = validate(model, bla)
            which = f", record {i + 1}" if len(blas) > 1 else ""
            facts.append(
                (
                    f"lines in the set{which}",
                    f"{seen.n_outside_set} of {seen.n_lines} lines of the BLA lie outside" + _describe_change(seen),
                )
            )

    shown = "Nominal plant and its set" + ", with the lines that were measured" * bool(blas)
    pictures = [parts.draw_picture(plot.plot_set, model, blas, tall=True, caption=f"{shown}.")]
    if nominal is not None:
        pictures.append(
            parts.draw_picture(plot.plot_fit, nominal, caption="Measured lines, model, and what is left between them.")
        )
    return Section(
        name="nominal",
        title="Nominal fit",
        lead="What the fit leaves is not lost: it goes into the radius of the set as misfit.",
        facts=tuple(facts),
        pictures=tuple(pictures),
    )


def roots_of_plant(G: control.StateSpace) -> list[tuple[str, str]]:
    """Return the rows of poles and zeros; a continuous delay, a Padé approximation inside the plant, is separated."""
    single, dt = G.ninputs == G.noutputs == 1, timebase(G)
    rest, delay = without_pade(G) if single and not dt else (G, 0.0)
    rows = [("poles", describe_roots(poles(rest), dt))]
    rows += [("zeros", describe_roots(zeros(rest), dt))] * single
    late = f"{1e3 * delay:.4g} ms, by an all-pass of order {G.nstates - rest.nstates} (Padé)"
    return rows + [("delay", late)] * (delay > 0)


def _describe_change(seen: Validation) -> str:
    """Return what a record says against the one that the model was made of; nothing where it is that one."""
    if seen.p_value == 1 or np.isnan(seen.p_value):
        return ""
    return (
        f"; against the record of the model p = {seen.p_value:.2g} for another gain ({100 * seen.gain:+.2g} %), "
        f"frequency ({100 * seen.frequency:+.2g} %) or delay ({1e3 * seen.delay:+.2g} ms), "
        f"the rest {seen.level:.2g} times what both scatter"
    )


def set_section(model: UncertaintyModel) -> Section:
    """Return the uncertainty and its weight."""
    from robust import plot

    facts = [
        ("set", str(model)),
        ("class of perturbations", model.perturbation),
        ("confidence", "; ".join(describe_confidence(model)) or "none claimed"),
        ("outside the measured band", f"nothing was measured; assumed: {model.origin.extrapolation}"),
        ("source", model.origin.source),
    ]
    pictures = [
        parts.draw_picture(plot.plot_weight, model, caption="Radius on the lines, its parts, and the weight over it.")
    ]
    if model.is_single and model.budget:
        pictures.append(
            parts.draw_picture(
                plot.plot_budget,
                model,
                caption="Parts of the radius, their share as the mean over the lines, and what to measure next.",
            )
        )
    return Section(
        name="set",
        title="Uncertainty and weight",
        lead="Every plant between the nominal and the weight is in the set; grey is where the weight is an assumption."
        if model.is_single
        else "The form was to be chosen before looking at the verdict; who tries two has tested twice.",
        facts=tuple(facts),
        pictures=tuple(pictures),
    )
