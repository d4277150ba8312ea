"""The sections of the report page on the controller: facts, tables and pictures."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version

import control
import numpy as np

import nlfrf
from nlfrf._base.arguments import format_hertz
from robust.analysis.family import sample_loops
from robust.analysis.loop_gains import loop_gains
from robust.analysis.report import RobustnessReport
from robust.analysis.step import step_of_plant
from robust.analysis.worst_plant import worst_case
from robust.io.biquads import loop_sections
from robust.io.pid import format_gains
from robust.lti.lti import poles, timebase, zeros
from robust.models.sets.model import UncertaintyModel
from robust.pages import html
from robust.pages.section import Fact, Section
from robust.plot import plot_check, plot_family, plot_loop, plot_nyquist, plot_step
from robust.reports.parts import describe_demand, describe_roots, describe_system, rows_of_value

_PACKAGES = ("nlfrf", "numpy", "scipy", "control", "cvxpy", "clarabel", "matplotlib", "numba")
_N_PLANTS = 25  # of the set, drawn around the worst case


def loop_section(
    report: RobustnessReport, model: UncertaintyModel, K: control.StateSpace
) -> Section:
    """Return the section on controller and loop, for one channel."""
    dt = timebase(K)
    facts = [
        *_controller_facts(K),
        Fact("zeros", describe_roots(zeros(K), dt)),
        Fact("gains", format_gains(K, model.origin.unit).strip()),
    ]
    table: list[tuple[str, ...]] = []
    if dt:
        try:
            rows = loop_sections(K).tolist()
            table = [
                ("b0", "b1", "b2", "a0", "a1", "a2"),
                *(tuple(f"{c:.12g}" for c in row) for row in rows),
            ]
        except ValueError as error:
            facts.append(Fact("sections", f"none: {error}"))
    return Section(
        "loop",
        "Controller and loop",
        "u = K (r - y). A table below has the second-order sections of a sampled controller, in"
        " series.",
        facts=facts,
        table=table,
        pictures=(
            html.draw_picture(
                "Loop gain and sensitivities of the nominal loop.", plot_loop, report
            ),
            html.draw_picture(
                "L in the complex plane, with the discs of the set.",
                plot_nyquist,
                report,
                square=True,
            ),
        ),
    )


def channels_section(
    report: RobustnessReport, model: UncertaintyModel, K: control.StateSpace
) -> Section:
    """Return the section on controller and loop, for several channels."""
    margins = "" if report.channels is None else rows_of_value(report.channels)
    gains = loop_gains(model.nominal, K, omega=model.omega)
    return Section(
        "loop",
        "Controller and loop",
        "u = K (r - y). The margin of one channel alone is the weakest test: if all channels"
        " change at once, the loop may tolerate far less.",
        facts=[*_controller_facts(K), Fact("disk margins", margins)],
        pictures=(html.draw_picture("Singular values of the nominal loop.", plot_loop, gains),),
    )


def _controller_facts(K: control.StateSpace) -> list[Fact]:
    return [
        Fact("controller", describe_system(K)),
        Fact("poles", describe_roots(poles(K), timebase(K))),
    ]


def check_section(report: RobustnessReport) -> Section:
    """Return the section with the numbers behind the verdict, and with the proofs."""
    curves = "Stability and performance" if report.is_single else "Bounds of mu"
    if report.nominally_stable:
        facts = []
    else:
        facts = [Fact("nominal loop", "not stable: no margin is given")]
    return Section(
        "check",
        "Check and proof",
        "Curves on a grid prove nothing between its points. A certificate is checked by its own"
        " numbers, whatever the solver reports that proposed it.",
        facts=(*facts, *report.details),
        pictures=(html.draw_picture(f"{curves}; each must stay below one.", plot_check, report),),
    )


def worst_case_section(
    model: UncertaintyModel, K: control.StateSpace, *, report: RobustnessReport, delay: float
) -> Section:
    """Return the section on the worst plant of the set."""
    name, title = "worst", "Worst case"
    if model.measured_only or not report.nominally_stable:
        if not report.nominally_stable:
            why = "the nominal loop is not stable"
        else:
            why = "the plant is known on its lines only"
        return Section(name, title, f"None can be given: {why}.")
    worst = worst_case(model, K, delay=delay)
    if worst.stable:
        peak = f"|S| = {worst.achieved:.3g}"
    else:
        peak = "an unstable loop"
    size = np.linalg.norm(np.atleast_2d(worst.delta), 2)
    family = sample_loops(model, K, _N_PLANTS, delay=delay, rng=0)
    lost = int(np.sum(~family.stable))
    nominal = step_of_plant(model.nominal, K, delay=delay)
    if worst.stable:
        worst_step = step_of_plant(worst.plant, K, delay=delay)
    else:
        worst_step = None
    facts = (
        Fact(
            "worst plant",
            f"{peak} at {format_hertz(worst.omega_worst)}, with |Delta| = {size:.3g} there",
        ),
        Fact("its poles", describe_roots(poles(worst.plant), timebase(worst.plant))),
        Fact("step, nominal plant", str(nominal)),
        Fact(
            "step, worst plant",
            "none: the loop is unstable" if worst_step is None else str(worst_step),
        ),
        Fact(
            "random plants",
            f"{family.stable.size} of the set, {lost} of them unstable in this loop",
        ),
    )
    return Section(
        name,
        title,
        "One plant of the set reaches the worst case; robust.worst_case returns it to replay in a"
        " simulation.",
        facts=facts,
        pictures=(
            html.draw_picture(
                "Sensitivity with plants of the set, and the worst case.", plot_family, family
            ),
            html.draw_picture(
                "Response to a step of the reference, with the nominal and with the worst plant.",
                plot_step,
                nominal,
                worst_step,
                unit=model.origin.unit.split("/")[0],
            ),
        ),
    )


def settings_section(
    model: UncertaintyModel, K: control.StateSpace, *, w_P: control.StateSpace | None, delay: float
) -> Section:
    """Return the section on settings: weight, demand, delay [s], sampling of K, versions of
    packages and computer.
    """
    facts = (
        Fact("weight", describe_system(model.weight) if model.is_single else ""),
        Fact("performance weight", "none asked for" if w_P is None else describe_demand(w_P)),
        Fact(
            "computation delay",
            f"{1e3 * delay:g} ms, and {1e3 * model.origin.delay:.4g} ms inside the nominal plant",
        ),
        Fact("sampling of the controller", f"{1 / K.dt:g} Hz" if timebase(K) else "continuous"),
        Fact("versions", ", ".join(f"{name} {_installed_version(name)}" for name in _PACKAGES)),
        Fact(
            "machine",
            f"Python {platform.python_version()} on {platform.system()} {platform.machine()}",
        ),
    )
    lead = "Settings and versions needed to repeat this run."
    return Section("settings", "Versions and settings", lead, facts=facts)


def _installed_version(package: str) -> str:
    """Return the version of a package, or "not installed": some are extras."""
    if package == "nlfrf":
        return nlfrf.__version__
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
