"""Both verdicts side by side: what a check says of measured levels, what a proof says of a class of friction."""

from __future__ import annotations

import numpy as np

from robust.analysis.report import RobustnessReport
from robust.analysis.verdict import meaning
from robust.friction_proof.proof import FrictionProof
from robust.reports.parts import Section
from robust.shared.states import FrictionVerdict

__all__ = ["both_verdicts", "friction_section", "in_short"]

MEANS = {
    FrictionVerdict.PROVED: "comes to rest with every friction of the class, from every state",
    FrictionVerdict.REFUTED: (
        "said of the class, not of the machine: a named member makes the loop unstable; yours may be another"
    ),
    FrictionVerdict.NOT_DECIDED: "neither proved nor refuted",
}


def both_verdicts(report: RobustnessReport, proof: FrictionProof) -> tuple[tuple[str, str, str], ...]:
    """Rows of a table, the head first: what is asked, the check's answer, the proof's answer."""
    friction = proof.friction.words
    away = f"surely, with any friction of the given force, from a kick of {proof.kick_sure:.3g} m/s"
    fails = away if np.isfinite(proof.kick_sure) else "no kick from which it surely does is known"
    if proof.verdict.is_proved:
        fails = "never, with a friction of the class"
    return (
        ("", "check: a set of linear plants", "proof: a class of friction"),
        ("verdict", report.verdict, proof.verdict),
        ("it means", meaning(report.verdict, report.probability), MEANS[proof.verdict]),
        ("because", report.reason, proof.reason or proof.claim),
        ("it is about", report.proved or "the nominal plant and what was measured around it", f"every {friction}"),
        ("linear part", "as far from the nominal as the set is wide", f"{proof.machine.words}, exactly"),
        ("a harder kick than measured", "nothing is said: the machine slides more than in any record", "is in it"),
        ("runs away", "not asked", fails),
        ("not in it", report.not_proved, proof.not_claimed.removeprefix("Not claimed: ")),
    )


def in_short(proof: FrictionProof) -> str:
    """The other verdict in one line, so that no banner stands alone."""
    kick = f"; with any friction of the given force it surely runs away from a kick of {proof.kick_sure:.3g} m/s"
    away = kick if np.isfinite(proof.kick_sure) else ""
    return f"Beside it, for a class of friction: {proof.verdict} ({MEANS[proof.verdict]}){away}."


def friction_section(report: RobustnessReport, proof: FrictionProof) -> Section:
    """The two verdicts, which answer two questions and may differ."""
    return Section(
        name="friction",
        title="Two verdicts",
        lead="They answer two questions, and neither is in the other: a statistically robust loop may run away after a "
        "hard kick, a loop proved for a class of friction may fail on a wide set of linear plants.",
        table=both_verdicts(report, proof),
    )
