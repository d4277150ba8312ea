"""The sections of the report on the controller: texts, tables and pictures of each."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version

import control
import numpy as np

import nlfrf
from nlfrf._base.arguments import format_count, format_hertz
from robust.analysis.family import sample_loops
from robust.analysis.performance import loop_gains, step_of_plant
from robust.analysis.report import RobustnessReport
from robust.analysis.text import (
    describe_disk_margin,
    describe_performance,
    format_margin_factor,
    format_stability_margin,
)
from robust.analysis.worst_plant import worst_case
from robust.io.biquads import loop_sections
from robust.io.pid import format_gains
from robust.lti.lti import poles, timebase, zeros
from robust.models.sets.model import UncertaintyModel
from robust.reports import parts
from robust.reports.parts import Section, describe_demand, describe_roots, describe_system, rows_of_value

_PACKAGES = ("nlfrf", "numpy", "scipy", "control", "cvxpy", "clarabel", "matplotlib", "numba")
_N_PLANTS = 25  # of the set, drawn around the worst case


def verdict_section(report: RobustnessReport) -> Section:
    """Return what the reader came for."""
    return Section(
        name="verdict",
        title="Verdict",
        lead="What may be said of this controller on this machine, and what may not.",
        facts=(
            ("because", report.reason),
            ("margins", _describe_margins(report)),
            ("proved", report.proved),
            ("not proved", report.not_proved),
            *([] if report.level is None else [("level of the loop", str(report.level))]),
            ("what to do next", report.next_step),
        ),
    )


def _describe_margins(report: RobustnessReport) -> str:
    """Return how far the loop is from trouble, in one line; nothing where it is in trouble."""
    parts = []
    if report.nominally_stable and np.isfinite(report.margins.rs):
        parts.append(format_margin_factor(report.margins.rs))
    if report.channels is not None and not report.channels.reason:
        parts.append(report.channels.least())
    if report.nominally_stable and np.isfinite(report.margins.disk):
        gain, phase = 20 * np.log10(report.margins.disk_gain), np.degrees(report.margins.disk_phase)
        parts.append(f"the nominal loop bears {gain:.1f} dB of gain, or {phase:.0f} deg of phase, or less of both")
    return "; ".join(parts)


def loop_section(report: RobustnessReport, model: UncertaintyModel, K: control.StateSpace) -> Section:
    """Return the controller and the loop it makes."""
    from robust import plot

    dt, unit = timebase(K), model.origin.unit
    facts = [("controller", describe_system(K)), ("poles", describe_roots(poles(K), dt))]
    if not report.is_single:
        if report.channels is not None:
            facts.append(("disk margins", rows_of_value(report.channels)))
        gains = loop_gains(model.nominal, K, omega=model.omega)
        return Section(
            name="loop",
            title="Controller and loop",
            lead="u = K (r - y). A margin of each channel alone says the least: all at once may bear far less.",
            facts=tuple(facts),
            pictures=(parts.draw_picture(plot.plot_loop, gains, caption="Singular values of the nominal loop."),),
        )
    facts += [("zeros", describe_roots(zeros(K), dt)), ("loop", report.context)]
    if report.nominally_stable:
        facts.append(("loop gain", str(report.classical)))
    table: list[tuple[str, ...]] = []
    facts += [("gains", format_gains(K, unit).strip())] * bool(format_gains(K, unit))
    if dt:
        try:
            rows = loop_sections(K).tolist()
            table = [("b0", "b1", "b2", "a0", "a1", "a2"), *(tuple(f"{c:.12g}" for c in row) for row in rows)]
        except ValueError as error:
            facts.append(("sections", f"none: {error}"))
    return Section(
        name="loop",
        title="Controller and loop",
        lead="u = K (r - y). The rows below, where there are any, are second-order sections, run one after the other.",
        facts=tuple(facts),
        table=tuple(table),
        pictures=(
            parts.draw_picture(plot.plot_loop, report, caption="Loop gain and sensitivities of the nominal loop."),
            parts.draw_picture(
                plot.plot_nyquist, report, square=True, caption="L in the complex plane, with the discs of the set."
            ),
        ),
    )


def check_section(report: RobustnessReport) -> Section:
    """Return the numbers behind the verdict, and what was proved at all frequencies."""
    from robust import plot

    facts = [("nominal loop", "stable" if report.nominally_stable else "not stable: no margin is given")]
    caption = "Stability and performance; each must stay below one."
    if not report.is_single:
        facts, caption = [("check", rows_of_value(report))], "Bounds of mu; each must stay below one."
    if report.is_single and report.nominally_stable:
        if np.isfinite(report.margins.rs):
            facts.append(
                ("stability of the set", format_stability_margin("rs", report.margins.rs, report.margins.omega_rs))
            )
        if np.isfinite(report.margins.rp):
            facts.append(("performance", describe_performance(report.curves, report.margins, report.performance)))
        if np.isfinite(report.margins.disk):
            facts.append(("disk margin", describe_disk_margin(report.margins)))
    table = [("subject", "bound", "proved at all frequencies", "how, or why not")]
    for c in report.proofs.certificates:
        how = f"{c.method}, {format_count(len(c.intervals), 'interval')}, {c.judged}" if c.holds else c.reason
        table.append((c.subject, f"{c.level:g}", "yes" if c.holds else "no", how))
    return Section(
        name="check",
        title="Check and proof",
        lead="Curves on a grid prove nothing between its points. A certificate is judged by its own numbers, never by "
        "the word of the solver that proposed it.",
        facts=tuple(facts),
        table=tuple(table) if report.proofs.certificates else (),
        pictures=(parts.draw_picture(plot.plot_check, report, caption=caption),),
    )


def worst_case_section(
    model: UncertaintyModel, K: control.StateSpace, *, report: RobustnessReport, delay: float
) -> Section:
    """Return the plant of the set that hurts most."""
    from robust import plot

    name, title = "worst", "Worst case"
    if model.measured_only or not report.nominally_stable:
        why = (
            "the nominal loop is not stable" if not report.nominally_stable else "the plant is known on its lines only"
        )
        return Section(name=name, title=title, lead=f"None can be given: {why}.")
    worst = worst_case(model, K, delay=delay)
    peak = f"|S| = {worst.achieved:.3g}" if worst.stable else "an unstable loop"
    size = np.linalg.norm(np.atleast_2d(worst.delta), 2)
    facts = [
        (
            "worst plant",
            f"{peak} at {format_hertz(worst.omega_worst)}, with |Delta| = {size:.3g} there",
        ),
        ("its poles", describe_roots(poles(worst.plant), timebase(worst.plant))),
    ]
    family = sample_loops(model, K, _N_PLANTS, delay=delay, rng=0)
    lost = int(np.sum(~family.stable))
    nominal = step_of_plant(model.nominal, K, delay=delay)
    worst_step = step_of_plant(worst.plant, K, delay=delay) if worst.stable else None
    facts.append(("step, nominal plant", str(nominal)))
    facts.append(("step, worst plant", "none: the loop is unstable" if worst_step is None else str(worst_step)))
    facts.append(("random plants", f"{family.stable.size} of the set, {lost} of them unstable in this loop"))
    return Section(
        name=name,
        title=title,
        lead="One plant of the set reaches the worst case; robust.worst_case returns it to replay in a simulation.",
        facts=tuple(facts),
        pictures=(
            parts.draw_picture(
                plot.plot_family, family, caption="Sensitivity with plants of the set, and the worst case."
            ),
            parts.draw_picture(
                plot.plot_step,
                nominal,
                worst_step,
                unit=model.origin.unit.split("/")[0],
                caption="A step of the reference: what the loop makes of it with the nominal and with the worst plant.",
            ),
        ),
    )


def settings_section(
    model: UncertaintyModel, K: control.StateSpace, *, w_P: control.StateSpace | None, delay: float
) -> Section:
    """Return the section on settings: weight, demand, delay [s], sampling of K, versions of packages and machine."""
    facts = [
        *([("weight", describe_system(model.weight))] if model.is_single else []),
        ("performance weight", "none asked for" if w_P is None else describe_demand(w_P)),
        ("computation delay", f"{1e3 * delay:g} ms, and {1e3 * model.origin.delay:.4g} ms inside the nominal plant"),
        ("sampling of the controller", f"{1 / K.dt:g} Hz" if timebase(K) else "continuous"),
        ("versions", ", ".join(f"{name} {_installed_version(name)}" for name in _PACKAGES)),
        ("machine", f"Python {platform.python_version()} on {platform.system()} {platform.machine()}"),
    ]
    return Section(
        name="settings", title="Versions and settings", lead="What is needed to repeat this run.", facts=tuple(facts)
    )


def _installed_version(package: str) -> str:
    """Return its version, or that it is not installed: an extra brings some of them."""
    if package == "nlfrf":
        return nlfrf.__version__
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
