"""Both verdicts side by side: a check at the measured levels, and a proof for a class of friction."""

from __future__ import annotations

import control
import numpy as np

from robust._base.states import FrictionVerdict
from robust._base.types import Weight
from robust.analysis.disk import DiskMargin, LoopMargins, disk_margins
from robust.analysis.judge_lines import assemble_on_lines
from robust.analysis.judge_mu import stability_bound_at
from robust.analysis.loop import assemble_loop
from robust.analysis.report import RobustnessReport
from robust.friction.proof.certify import FrictionProof
from robust.lti.lti import response, response_by_channel
from robust.lti.realisation import multivariable, state_space
from robust.models.sets.model import UncertaintyModel
from robust.reports.parts import Section

MEANING_OF_PROOF = {
    FrictionVerdict.PROVED: "comes to rest with every friction of the class, from every state",
    FrictionVerdict.SETTLES: "stays within a bound with every friction of the class, from every state",
    FrictionVerdict.REFUTED: (
        "said of the class, not of the machine: a named member makes the loop unstable; yours may be another"
    ),
    FrictionVerdict.NOT_DECIDED: "neither proved nor refuted",
}


def verdict_rows(report: RobustnessReport, proof: FrictionProof) -> tuple[tuple[str, str, str], ...]:
    """Return rows of a table, the head first: what is asked, the check's answer, the proof's answer."""
    friction, settles = proof.friction.description, proof.verdict is FrictionVerdict.SETTLES
    away = f"surely, with any friction of the given force, from a kick of {proof.kick_sure:.3g} {proof.units.velocity}"
    fails = away if np.isfinite(proof.kick_sure) else "no kick from which it surely does is known"
    if proof.verdict.is_proved:
        fails = "never, with a friction of the class"
    return (
        ("", "check: a set of linear plants", "proof: a class of friction"),
        ("verdict", f"{report.verdict}{report.missed_performance}", proof.verdict),
        ("it means", report.meaning, MEANING_OF_PROOF[proof.verdict]),
        ("because", report.reason, proof.claim if settles else proof.reason or proof.claim),
        ("it is about", report.proved or "the nominal plant and what was measured around it", f"every {friction}"),
        ("linear part", "as far from the nominal as the set is wide", f"{proof.machine.description}, exactly"),
        ("a harder kick than measured", "nothing is said: the machine slides more than in any record", "is in it"),
        ("runs away", "not asked", fails),
        ("not in it", report.not_proved, proof.not_claimed.removeprefix("Not claimed: ")),
    )


def describe_proof(proof: FrictionProof) -> str:
    """Describe the verdict of the proof in one line, for the banner."""
    size = f"{proof.kick_sure:.3g} {proof.units.velocity}"
    kick = f"; with any friction of the given force it surely runs away from a kick of {size}"
    away = kick if np.isfinite(proof.kick_sure) else ""
    return f"Beside it, for a class of friction: {proof.verdict} ({MEANING_OF_PROOF[proof.verdict]}){away}."


def friction_section(report: RobustnessReport, proof: FrictionProof) -> Section:
    """Return the two verdicts, which answer two questions and may differ."""
    return Section(
        name="friction",
        title="Two verdicts",
        lead="They answer two questions, and neither is in the other: a statistically robust loop may run away after a "
        "hard kick, a loop proved for a class of friction may fail on a wide set of linear plants.",
        table=verdict_rows(report, proof),
    )


# ---- Whether a report is of the set and the controller that it is to be told of: nobody is told of two loops at once.

WRONG_REPORT = "report must be what check gave of this model and this K, got one of another loop"


def require_report_of(
    report: RobustnessReport, model: UncertaintyModel, *, K: control.StateSpace, w_P: Weight | None, delay: float
) -> None:
    """Refuse a report of something else than what is to be reported."""
    if delay not in (0.0, report.given.delay):
        raise ValueError(f"delay must be that of the report, {report.given.delay:g} s, got {delay:g} s")
    if w_P is not None and not has_demand(report, w_P):
        raise ValueError("w_P must be that of the report, got another one. Leave it out, or check again with it")
    if report.is_single != model.is_single or not (is_of_loop if model.is_single else is_of_matrix_loop)(
        report, model, K
    ):
        raise ValueError(WRONG_REPORT)


def is_of_matrix_loop(report: RobustnessReport, model: UncertaintyModel, K: control.StateSpace) -> bool:
    """Return whether it is of this set and controller, by margins of the nominal loop and by mu where it peaks."""
    return has_margins(report, disk_margins(model, K)) and has_mu_peak(report, model, K)


def is_of_loop(report: RobustnessReport, model: UncertaintyModel, K: control.StateSpace) -> bool:
    """Return whether a report is of this set and this controller, by their responses at some of its frequencies."""
    at = slice(None, None, max(1, report.curves.omega.size // 50))
    omega = report.curves.omega[at]
    if model.measured_only:
        curves = assemble_on_lines(model, K, w_P=None, delay=report.given.delay, n_unstable=0).curves
        if not np.array_equal(curves.omega, report.curves.omega):
            return False
        now = curves.G[at], curves.K[at], np.abs(curves.w)[at]
    else:
        curves = assemble_loop(model, K, w_P=None, delay=report.given.delay).curves(omega)
        now = curves.G, curves.K, np.abs(curves.w)
    known = report.curves.G[at], report.curves.K[at], report.curves.radius[at]
    return model.form == report.form and all(map(is_equal, now, known))


def is_equal(one: np.ndarray, other: np.ndarray) -> bool:
    """Return whether two arrays are equal up to rounding."""
    return np.allclose(one, other, rtol=1e-6, atol=0, equal_nan=True)


def has_demand(report: RobustnessReport, w_P: Weight) -> bool:
    """Return whether a performance weight is the one that a report was made with."""
    if not report.is_single and report.given.demand is not None:
        given, known = (
            response_by_channel(multivariable("w_P", w), report.curves.omega) for w in (w_P, report.given.demand)
        )
        return given.shape == known.shape and is_equal(given, known)
    if report.curves.w_P is None:
        return False
    return is_equal(np.abs(response(state_space("w_P", w_P), report.curves.omega)), report.curves.w_P)


def has_margins(report: RobustnessReport, now: LoopMargins) -> bool:
    """Return whether the nominal loop has the margins of the report."""
    known = report.channels
    if known is None or (len(known.inputs), len(known.outputs)) != (len(now.inputs), len(now.outputs)):
        return False
    pairs = zip(margin_parts(known), margin_parts(now), strict=True)
    return all(np.isclose(one.alpha, other.alpha, rtol=1e-6, atol=0, equal_nan=True) for one, other in pairs)


def margin_parts(margins: LoopMargins) -> tuple[DiskMargin, ...]:
    """Return the disk margins of every channel, and of all at once."""
    return (*margins.inputs, *margins.outputs, margins.all_inputs, margins.all_outputs, margins.everywhere)


def has_mu_peak(report: RobustnessReport, model: UncertaintyModel, K: control.StateSpace) -> bool:
    """Return whether mu of this set, in one of its forms, has the size at the peak that the report states."""
    if not report.nominally_stable:
        return True
    peaks = [
        stability_bound_at(form.loop(K), report.margins.omega_rs)
        for form in (model, model.alternative_form)
        if form is not None
    ]
    return bool(np.isclose(peaks, 1 / report.margins.rs, rtol=0.02, atol=0).any())  # searched for, to better than that
