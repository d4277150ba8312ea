"""Two verdicts side by side: the verdict of a check, and the verdict of a friction proof."""

from __future__ import annotations

import warnings

import control
import numpy as np

from robust._base.states import FrictionVerdict
from robust._base.types import Weight
from robust.analysis.report import RobustnessReport
from robust.analysis.robustness import check
from robust.friction.proof.protocol import FrictionProof
from robust.lti.lti import response_by_channel
from robust.lti.realisation import multivariable
from robust.models.sets.model import UncertaintyModel
from robust.pages.section import Section

_MEANING_OF_PROOF = {
    FrictionVerdict.PROVED: "comes to rest with every friction of the class, from every state",
    FrictionVerdict.SETTLES: (
        "stays within a bound with every friction of the class, from every state"
    ),
    FrictionVerdict.REFUTED: (
        "with one friction of the class the loop is unstable; the friction of the machine may be"
        " another"
    ),
    FrictionVerdict.NOT_DECIDED: "neither proved nor refuted",
}


def _verdict_rows(
    report: RobustnessReport, proof: FrictionProof
) -> tuple[tuple[str, str, str], ...]:
    """Return rows of a table, the head first: question, answer of the check, answer of the
    proof.
    """
    settles = proof.verdict is FrictionVerdict.SETTLES
    away = (
        f"surely, with any friction of the given force, from a kick of {proof.kick_sure:.3g}"
        f" {proof.units.velocity}"
    )
    if np.isfinite(proof.kick_sure):
        fails = away
    else:
        fails = "unknown: there is no kick after which it surely does"
    if proof.verdict.is_proved:
        fails = "never, with a friction of the class"
    return (
        ("", "check: a set of linear plants", "proof: a class of friction"),
        ("verdict", report.headline, proof.verdict),
        ("meaning", report.meaning, _MEANING_OF_PROOF[proof.verdict]),
        ("because", report.reason, proof.claim if settles else proof.reason or proof.claim),
        (
            "holds for",
            report.proved or "the nominal plant and the measured set around it",
            proof.scope,
        ),
        ("linear part", "any plant of the set", f"{proof.machine.description}, exactly"),
        (
            "a harder kick than measured",
            "not covered: the machine slides more than in any record",
            "covered",
        ),
        ("runs away", "not judged", fails),
        ("not covered", report.not_proved, proof.not_claimed),
    )


def describe_proof(proof: FrictionProof) -> str:
    """Return the verdict of the proof in one line, for the banner."""
    size = f"{proof.kick_sure:.3g} {proof.units.velocity}"
    kick = f"; with any friction of the given force it surely runs away from a kick of {size}"
    away = kick if np.isfinite(proof.kick_sure) else ""
    return (
        f"Proof for a class of friction: {proof.verdict}"
        f" ({_MEANING_OF_PROOF[proof.verdict]}){away}."
    )


def friction_section(report: RobustnessReport, proof: FrictionProof) -> Section:
    """Return the section with both verdicts."""
    return Section(
        "friction",
        "Two verdicts",
        "The two verdicts answer different questions. A statistically robust loop may run away"
        " after a hard kick; a loop proved for a class of friction may fail with a plant of a wide"
        " set.",
        table=_verdict_rows(report, proof),
    )


# ---- Does a report belong to this model and this controller? A page must not mix two loops.

#: Curves of the loop to compare; several channels have only some of them.
_COMPARED = ("omega", "G", "K", "radius", "rs")
_WRONG_REPORT = (
    "report must be the result of check for this model and this K, got that of another loop"
)


def require_report_of(
    report: RobustnessReport,
    model: UncertaintyModel,
    *,
    K: control.StateSpace,
    w_P: Weight | None,
    delay: float,
) -> None:
    """Refuse a report of another loop.

    For the comparison the loop is checked again without proofs.
    """
    if delay not in (0.0, report.given.delay):
        raise ValueError(
            f"delay must be that of the report, {report.given.delay:g} s, got {delay:g} s"
        )
    if w_P is not None and not _has_demand(report, w_P):
        raise ValueError(
            "w_P must be that of the report, got another one. Leave it out, or check again with"
            " this one"
        )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the report has them
            now = check(model, K, w_P=report.given.demand, delay=report.given.delay, certify=False)
    except ValueError:
        raise ValueError(_WRONG_REPORT) from None
    pairs = [(getattr(one.curves, name) for one in (now, report)) for name in _COMPARED]
    if now.form != report.form or not all(_is_equal(*pair) for pair in pairs):
        raise ValueError(_WRONG_REPORT)


def _has_demand(report: RobustnessReport, w_P: Weight) -> bool:
    """Return whether a performance weight is that of a report."""
    if report.given.demand is None:
        return False
    weights = (multivariable("w_P", weight) for weight in (w_P, report.given.demand))
    return _is_equal(*(response_by_channel(weight, report.curves.omega) for weight in weights))


def _is_equal(one: np.ndarray | None, other: np.ndarray | None) -> bool:
    """Return whether two curves are equal up to rounding."""
    if one is None or other is None:
        return one is other
    return one.shape == other.shape and np.allclose(one, other, rtol=1e-6, atol=0, equal_nan=True)
