"""The sections of a report on several inputs and outputs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import control

import nlfrf
from nlfrf import Bla
from nlfrf._base.arguments import counted
from robust.analysis.check_structure import StructuredReport
from robust.analysis.performance import loop_gains
from robust.lti.lti import poles, timebase
from robust.models.sets.model import MatrixUncertainty
from robust.reports import parts
from robust.reports.parts import Section, roots_text, rows_of, system_text

__all__ = ["matrix_sections"]


def matrix_sections(
    report: StructuredReport, model: MatrixUncertainty, K: control.StateSpace, frms: Sequence[Bla], nominal: Any
) -> list[Section]:
    """What was found, what was measured, the set, the loop, the check and its proofs."""
    return [verdict(report), measured(frms), the_set(model, frms, nominal), the_loop(model, K, report), proofs(report)]


def verdict(report: StructuredReport) -> Section:
    """What the reader came for."""
    return Section(
        name="verdict",
        title="Verdict",
        lead="What may be said of this controller on this machine, and what may not.",
        facts=(("because", report.reason), ("proved", report.proved), ("not proved", report.not_proved)),
    )


def measured(frms: Sequence[Bla]) -> Section:
    """The measured matrix: entries, what limits them, directions."""
    from nlfrf import plot

    facts, pictures = [], []
    for i, frm in enumerate(frms):
        which = f" of record {i + 1}" if len(frms) > 1 else ""
        facts += [(f"matrix{which}", rows_of(frm)), (f"directions{which}", rows_of(nlfrf.singular_values(frm)))]
        pictures += [
            parts.picture(plot.plot_frm, frm, tall=True, caption=f"Every entry{which} with its 95 % bound."),
            parts.picture(plot.plot_frm_bounds, frm, tall=True, caption=f"What limits each entry{which}."),
            parts.picture(
                plot.plot_singular_values,
                nlfrf.singular_values(frm),
                caption=f"Singular values{which}, in the bands that the bound of the matrix leaves them.",
            ),
        ]
    return Section(
        name="matrix",
        title="Frequency response matrix",
        lead="Bounds hold the best linear approximation, line by line, with 95 % probability; they are for this "
        "excitation, at this level, and say nothing about other levels.",
        facts=tuple(facts) or (("matrix", "was not handed over with this report"),),
        pictures=tuple(pictures),
    )


def the_set(model: MatrixUncertainty, frms: Sequence[Bla], nominal: Any) -> Section:
    """The nominal and the set around it."""
    from robust import plot

    G = model.nominal
    facts = [("nominal plant", system_text(G)), ("its poles", roots_text(poles(G), timebase(G)))]
    facts += [("fit", str(nominal).removeprefix("nominal model: "))] * (nominal is not None)
    facts += [
        ("set", str(model)),
        ("class of perturbations", model.perturbation),
        ("outside the measured band", f"nothing was measured; assumed: {model.extrapolation}"),
        ("source", model.source),
    ]
    return Section(
        name="set",
        title="Nominal and set",
        lead="The form was to be chosen before looking at the verdict; who tries two has tested twice.",
        facts=tuple(facts),
        pictures=(
            parts.picture(plot.plot_matrix_set, model, frms, tall=True, caption="The set, entry by entry."),
            parts.picture(plot.plot_matrix_weights, model, tall=True, caption="Radii on the lines, weights over them."),
        ),
    )


def the_loop(model: MatrixUncertainty, K: control.StateSpace, report: StructuredReport) -> Section:
    """The controller, the nominal loop, its margins."""
    from robust import plot

    facts = [("controller", system_text(K)), ("its poles", roots_text(poles(K), timebase(K)))]
    if report.margins is not None:
        facts.append(("disk margins", rows_of(report.margins)))
    gains = loop_gains(model.nominal, K, omega=model.omega)
    return Section(
        name="loop",
        title="Controller and loop",
        lead="u = K (r - y). A margin of each channel alone says the least: all at once may bear far less.",
        facts=tuple(facts),
        pictures=(parts.picture(plot.plot_matrix_loop, gains, caption="Singular values of the nominal loop."),),
    )


def proofs(report: StructuredReport) -> Section:
    """The numbers behind the verdict, and what was proved at all frequencies."""
    from robust import plot

    table = [("subject", "bound", "proved at all frequencies", "how, or why not")]
    for c in report.certificates:
        how = f"{c.method}, {counted(len(c.intervals), 'interval')}, {c.judged}" if c.holds else c.reason
        table.append((c.subject, f"{c.level:g}", "yes" if c.holds else "no", how))
    return Section(
        name="check",
        title="Check and proof",
        lead="Curves on a grid prove nothing between its points. A certificate is judged by its own numbers.",
        facts=(("check", rows_of(report)),),
        table=tuple(table) if report.certificates else (),
        pictures=(parts.picture(plot.plot_check, report, caption="Bounds of mu; each must stay below one."),),
    )
