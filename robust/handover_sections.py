"""The sections of the report to hand over: what each says, its table, its pictures."""

from __future__ import annotations

import base64
import platform
from collections.abc import Callable
from importlib.metadata import version
from io import BytesIO
from typing import Any

import control
import numpy as np

import nlfrf
from nlfrf import Bla, Record
from nlfrf.values import value
from robust.lti import poles, response, state_space, timebase, zeros
from robust.nominal import NominalFit
from robust.report import RobustnessReport, factor, hertz
from robust.sections import controller_sections
from robust.uncertainty import UncertaintyModel
from robust.validation import validate
from robust.worst import sample_loops, worst_case

PACKAGES = ("nlfrf", "numpy", "scipy", "control", "cvxpy", "clarabel", "matplotlib", "numba")
N_PLANTS = 25  # of the set, drawn around the worst case


@value
class Picture:
    """A picture: its content as a data address, and what it shows."""

    source: str
    caption: str


@value
class Section:
    """One section of the report: a heading, what it says, and its pictures."""

    name: str
    title: str
    lead: str
    facts: tuple[tuple[str, str], ...] = ()
    table: tuple[tuple[str, ...], ...] = ()  # the first row is the head
    pictures: tuple[Picture, ...] = ()


def picture(draw: Callable[..., Any], *content: Any, caption: str, square: bool = False, **options: Any) -> Picture:
    """Draw by one of the plot functions, as a vector picture inside the file."""
    import matplotlib
    from matplotlib.figure import Figure

    # a fixed frame: finding one for each picture would take longer than to draw it
    figure = Figure(figsize=(5.6, 5.6) if square else (7.6, 4.7))
    draw(*content, ax=figure.add_axes((0.14, 0.1, 0.84, 0.84) if square else (0.1, 0.115, 0.88, 0.81)), **options)
    stream = BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": "robust"}):  # the same run gives the same file
        figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
    return Picture(
        source="data:image/svg+xml;base64," + base64.b64encode(stream.getvalue()).decode("ascii"), caption=caption
    )


def rows_of(thing: Any) -> str:
    """What a value says of itself, without the indents of a screen."""
    return "\n".join(row.strip() for row in str(thing).splitlines())


def verdict_section(report: RobustnessReport) -> Section:
    """What the reader came for."""
    return Section(
        name="verdict",
        title="Verdict",
        lead="What may be said of this controller on this machine, and what may not.",
        facts=(
            ("because", report.reason),
            ("margins", margins_text(report)),
            ("proved", report.proved),
            ("not proved", report.not_proved),
            ("what to do next", report.advice),
        ),
    )


def margins_text(report: RobustnessReport) -> str:
    """How far the loop is from trouble, in one line; nothing where it is in trouble."""
    said = []
    if report.nominally_stable and np.isfinite(report.margin_rs):
        said.append(factor(report.margin_rs))
    if report.nominally_stable and np.isfinite(report.disk_margin):
        gain, phase = 20 * np.log10(report.gain_margin), np.degrees(report.phase_margin)
        said.append(f"the nominal loop bears {gain:.1f} dB of gain and {phase:.0f} deg of phase at once")
    return "; ".join(said)


def excitation_section(records: list[Record], blas: list[Bla]) -> Section:
    """What was played, and what was measured."""
    from nlfrf import plot

    facts, pictures = [], []
    for i, record in enumerate(records):
        which = f" of record {i + 1}" if len(records) > 1 else ""
        grid, u = record.lines, record.u[0, -1]
        kind = blas[i].grid if i < len(blas) else "given"
        facts += [
            (
                f"excitation{which}",
                f"{kind} grid, {grid.excited.size} excited lines from {grid.excited[0] * record.f0:g} to "
                f"{grid.excited[-1] * record.f0:g} Hz, {grid.odd.size} odd and {grid.even.size} even detection lines; "
                f"rms {u.std():.4g}, crest factor {np.abs(u).max() / np.sqrt(np.mean(u**2)):.3g}",
            ),
            (
                f"record{which}",
                f"{counted(record.n_realizations, 'realisation')} of {counted(record.n_periods, 'period')} of "
                f"{record.n_samples} samples at {record.fs:g} Hz: {record.u.size / record.fs:.4g} s, "
                f"resolution {record.f0:.4g} Hz",
            ),
        ]
        pictures += [
            picture(plot.plot_input, record, caption=f"Input spectrum{which}: energy where none was to be."),
            picture(plot.plot_samples, record, caption=f"Input{which} in time, all periods over one another."),
            picture(plot.plot_samples, record, signal="y", caption=f"Output{which} in time, the last period in black."),
        ]
    if not records:
        facts = [("record", "was not handed over with this report")]
    return Section(
        name="record",
        title="Excitation and record",
        lead="Periods that lie over one another say that the machine was in steady state and the channels were alive.",
        facts=tuple(facts),
        pictures=tuple(pictures),
    )


def bla_section(blas: list[Bla]) -> Section:
    """The best linear approximation, its levels and its bound."""
    from nlfrf import plot

    facts, pictures = [], []
    for i, bla in enumerate(blas):
        which = f" of record {i + 1}" if len(blas) > 1 else ""
        facts.append((f"BLA{which}", rows_of(bla)))
        pictures += [
            picture(plot.plot_bla, bla, caption=f"Best linear approximation{which} with its 95 % bound."),
            picture(plot.plot_levels, bla, caption=f"Output{which} by kind of line: linear, distortion, noise."),
            picture(plot.plot_phase, bla, caption=f"Phase{which}."),
        ]
    return Section(
        name="bla",
        title="Best linear approximation",
        lead="The bound holds the best linear approximation, line by line, with 95 % probability; it is for this "
        "excitation, at this level, and says nothing about other levels.",
        facts=tuple(facts) or (("BLA", "was not handed over with this report"),),
        pictures=tuple(pictures),
    )


def opinion_section(records: list[Record]) -> Section:
    """The distortion level read a second time, by means that fail for other reasons."""
    from nlfrf import plot

    facts, pictures = [], []
    for i, record in enumerate(records):
        which = f" on record {i + 1}" if len(records) > 1 else ""
        opinion = nlfrf.second_opinion(record)
        facts.append((f"opinion{which}", rows_of(opinion).removeprefix("second opinion: ")))
        pictures.append(picture(plot.plot_opinion, opinion, caption=f"The distortion level read twice{which}."))
    return Section(
        name="opinion",
        title="Second opinion",
        lead="The lines that were not excited and the roughness of the FRF over the excited ones fail for different "
        "reasons: where both agree the level can be believed.",
        facts=tuple(facts) or (("opinion", "needs the record, which was not handed over"),),
        pictures=tuple(pictures),
    )


def nominal_section(model: UncertaintyModel, nominal: NominalFit | None, blas: list[Bla]) -> Section:
    """The model in the middle against the measured lines."""
    from robust import plot

    facts: list[tuple[str, str]] = []
    if model.measured_only:
        facts.append(("nominal plant", f"the measured FRF itself, on {np.size(model.nominal.omega)} lines"))
    else:
        facts.append(("nominal plant", system_text(model.nominal)))
        facts.append(("poles", roots_text(poles(model.nominal), timebase(model.nominal))))
        facts.append(("zeros", roots_text(zeros(model.nominal), timebase(model.nominal))))
    if nominal is not None:
        facts.append(("fit", str(nominal).removeprefix("nominal model: ")))
    for i, bla in enumerate(blas):
        if not np.isnan(model.confidence):
            seen = validate(model, bla)
            which = f", record {i + 1}" if len(blas) > 1 else ""
            facts.append(
                (
                    f"lines in the set{which}",
                    f"{seen.n_outside} of {seen.n_lines} lines of the BLA lie outside; {seen.n_expected:.3g} of a new "
                    "realisation would be expected there",
                )
            )

    def with_measured(model: UncertaintyModel, *, ax: Any) -> None:
        plot.plot_nominal(model, ax=ax)
        for bla in blas:
            ax.plot(bla.f, plot.db(np.abs(bla.G)), ".", ms=3, color=plot.COLOR["limit"], label="measured lines")
        plot.finished(ax)

    pictures = [picture(with_measured, model, caption="Nominal plant and its set, with the lines that were measured.")]
    if nominal is not None:
        pictures.append(
            picture(plot.plot_fit, nominal, caption="Measured lines, model, and what is left between them.")
        )
    return Section(
        name="nominal",
        title="Nominal fit",
        lead="What the fit leaves is not lost: it goes into the radius of the set as misfit.",
        facts=tuple(facts),
        pictures=tuple(pictures),
    )


def set_section(model: UncertaintyModel) -> Section:
    """The uncertainty and its weight."""
    from robust import plot

    facts = [
        ("set", str(model)),
        ("class of perturbations", model.perturbation),
        ("confidence", "none claimed" if np.isnan(model.confidence) else f"{100 * model.confidence:g} %"),
        ("outside the measured band", f"nothing was measured; assumed: {model.extrapolation}"),
        ("source", model.source),
    ]
    pictures = [picture(plot.plot_weight, model, caption="Radius on the lines, its parts, and the weight over it.")]
    if model.budget():
        pictures.append(picture(plot.plot_budget, model, caption="What the radius is made of: what to measure next."))
    return Section(
        name="set",
        title="Uncertainty and weight",
        lead="Every plant between the nominal and the weight is in the set; grey is where the weight is an assumption.",
        facts=tuple(facts),
        pictures=tuple(pictures),
    )


def loop_section(report: RobustnessReport, K: control.StateSpace) -> Section:
    """The controller and the loop it makes."""
    from robust import plot

    dt = timebase(K)
    facts = [
        ("controller", system_text(K)),
        ("poles", roots_text(poles(K), dt)),
        ("zeros", roots_text(zeros(K), dt)),
        ("loop", report.context),
    ]
    table: list[tuple[str, ...]] = []
    if dt:
        try:
            rows = controller_sections(K).tolist()
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
            picture(plot.plot_loop, report, caption="Loop gain and sensitivities of the nominal loop."),
            picture(
                plot.plot_nyquist, report, square=True, caption="L in the complex plane, with the discs of the set."
            ),
        ),
    )


def check_section(report: RobustnessReport) -> Section:
    """The numbers behind the verdict, and what was proved at all frequencies."""
    from robust import plot

    facts = [("nominal loop", "stable" if report.nominally_stable else "not stable: no margin is given")]
    if report.nominally_stable and np.isfinite(report.margin_rs):
        where = hertz(report.omega_rs)
        facts.append(("stability of the set", f"max {1 / report.margin_rs:.3f} at {where}; {factor(report.margin_rs)}"))
    if report.nominally_stable and np.isfinite(report.margin_rp):
        met = "met" if report.robust_performance else "not met"
        facts.append(
            (
                "performance",
                f"nominal max |w_P S| {np.max(report.np_):.3f}, worst case {np.max(report.rp):.3f} at "
                f"{hertz(report.omega_rp)}: demand {met} by the whole set",
            )
        )
    if report.nominally_stable and np.isfinite(report.disk_margin):
        facts.append(
            (
                "disk margin",
                f"{report.disk_margin:.3f} at {hertz(report.omega_disk)}: gain "
                f"{20 * np.log10(report.gain_margin):.2f} dB, phase {np.degrees(report.phase_margin):.1f} deg, at once",
            )
        )
    table = [("subject", "bound", "proved at all frequencies", "how, or why not")]
    for c in report.certificates:
        how = f"{c.method}, {counted(len(c.intervals), 'interval')}" if c.holds else c.reason
        table.append((c.subject, f"{c.level:g}", "yes" if c.holds else "no", how))
    return Section(
        name="check",
        title="Check and proof",
        lead="Curves on a grid prove nothing between its points. A certificate is judged by its own numbers, never by "
        "the word of the solver that proposed it.",
        facts=tuple(facts),
        table=tuple(table) if report.certificates else (),
        pictures=(picture(plot.plot_check, report, caption="Stability and performance; each must stay below one."),),
    )


def worst_section(model: UncertaintyModel, K: Any, report: RobustnessReport, delay: float) -> Section:
    """The plant of the set that hurts most."""
    from robust import plot

    name, title = "worst", "Worst case"
    if model.measured_only or not report.nominally_stable:
        why = (
            "the nominal loop is not stable" if not report.nominally_stable else "the plant is known on its lines only"
        )
        return Section(name=name, title=title, lead=f"None can be given: {why}.")
    worst = worst_case(model, K, delay=delay)
    peak = f"|S| = {worst.achieved:.3g}" if worst.stable else "an unstable loop"
    facts = [
        ("worst plant", f"{peak} at {hertz(worst.omega_worst)}, with |Delta| = {abs(worst.delta):.3g} there"),
        ("its poles", roots_text(poles(worst.plant), timebase(worst.plant))),
    ]
    family = sample_loops(model, K, N_PLANTS, delay=delay, rng=0)
    lost = int(np.sum(~family.stable))
    facts.append(("random plants", f"{family.stable.size} of the set, {lost} of them unstable in this loop"))
    return Section(
        name=name,
        title=title,
        lead="One plant of the set reaches the worst case; robust.worst_case returns it to replay in a simulation.",
        facts=tuple(facts),
        pictures=(
            picture(plot.plot_family, family, caption="Sensitivity with plants of the set, and the worst case."),
        ),
    )


def settings_section(model: UncertaintyModel, K: control.StateSpace, w_P: Any, delay: float) -> Section:
    """What is needed to repeat the run."""
    facts = [
        ("weight", system_text(model.weight)),
        ("performance weight", "none asked for" if w_P is None else demand_text(w_P)),
        ("computation delay", f"{1e3 * delay:g} ms, and {1e3 * model.delay:.4g} ms inside the nominal plant"),
        ("sampling of the controller", f"{1 / K.dt:g} Hz" if timebase(K) else "continuous"),
        ("versions", ", ".join(f"{name} {installed(name)}" for name in PACKAGES)),
        ("machine", f"Python {platform.python_version()} on {platform.system()} {platform.machine()}"),
    ]
    return Section(
        name="settings", title="Versions and settings", lead="What is needed to repeat this run.", facts=tuple(facts)
    )


def installed(package: str) -> str:
    """Its version."""
    return nlfrf.__version__ if package == "nlfrf" else version(package)


def system_text(system: control.StateSpace) -> str:
    """A system in one line."""
    kind = f"sampled at {1 / timebase(system):g} Hz" if timebase(system) else "continuous"
    return f"{system.nstates} states, {kind}"


def counted(n: int, what: str) -> str:
    """A count with its noun."""
    return f"{n} {what}" + "s" * (n != 1)


def roots_text(roots: np.ndarray, dt: float) -> str:
    """Poles or zeros as frequency and damping, those at the origin of s counted apart."""
    if not roots.size:
        return "none"
    with np.errstate(divide="ignore"):
        s = np.log(roots.astype(complex)) / dt if dt else roots
    said = []
    for root in sorted(s[s.imag > -1e-9 * np.abs(s)], key=abs):
        size = abs(root)
        if not np.isfinite(size):
            said.append("z = 0")
        elif size < 1e-6:
            said.append("0 Hz (integrator)")
        elif abs(root.imag) < 1e-9 * size:
            said.append(f"{size / 2 / np.pi:.4g} Hz" + (" (unstable side)" if root.real > 0 else ""))
        else:
            said.append(f"{size / 2 / np.pi:.4g} Hz, damping {round(-root.real / size, 6) + 0.0:.3g}")
    return "; ".join(said)


def demand_text(w_P: Any) -> str:
    """A performance weight as what it allows of |S|."""
    w_P = state_space("w_P", w_P)
    omega = np.geomspace(1e-3, 1e6, 4000)
    if timebase(w_P):
        omega = omega[omega * timebase(w_P) < np.pi]
    size = np.abs(response(w_P, omega))
    above = np.flatnonzero(size >= 1)
    at = f", |S| below one up to {hertz(omega[above[-1]])}" if above.size else ""
    return f"|S| at most {1 / size[0]:.3g} at low and {1 / size[-1]:.3g} at high frequency{at}"
