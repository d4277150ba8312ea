"""Why a check of gains may not be trusted, or why gains are not safe though the verdict is good."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

import control
import numpy as np

import nlfrf
from nlfrf._base.arguments import (
    format_hertz,
)
from nlfrf.rig import Drive
from robust.analysis.loop import assemble_loop, decide_nominal_stability
from robust.analysis.performance import classical_margins
from robust.analysis.report import RobustnessReport
from robust.models.sets.model import UncertaintyModel
from robust.servo.checking.findings import BaseMotion, Conditions, Doubt, DoubtKind, RecordedGains

#: Lowest lines by which friction is seen to hold an axis, and the mean cosine of the phase of G above which it does:
#: 1 of a spring, 0 of a damper, -1 of a mass.
_LOW_LINES, _HELD = 6, 0.5


#: Factors on kp that are tried where the model is unstable, the mildest first.
_TRIED_FACTORS = (0.5, 2.0, 0.25, 4.0, 0.1, 10.0, 0.05, 20.0)


def doubts_of_warnings(under: Sequence[Conditions], warned: Sequence[Sequence[str]]) -> list[Doubt]:
    """Return a doubt for each warning: of reading the traces, then of identifying some of them."""
    texts = chain.from_iterable([*(one.warnings for one in under), *warned])
    return [Doubt(DoubtKind.WARNED_TRACE, text) for text in dict.fromkeys(texts)]


def doubt_of_trace_at_rest(name: str, machine: nlfrf.Bla, *, under: Conditions, unit: str) -> Doubt | None:
    """Why a trace says nothing of the axis in motion: a spring answers on low lines, or its design is at rest."""
    low = machine.G[:_LOW_LINES]
    held = np.mean((low / np.abs(low)).real) > _HELD
    if not (held or under.motion is BaseMotion.AT_REST):
        return None
    found = (
        f"in {name} the axis is held, as by a spring of {np.median((1 / low).real):.3g} {unit} from "
        f"{machine.f[0]:.4g} to {machine.f[: low.size][-1]:.4g} Hz"
        if held
        else f"{name} was recorded at rest, where friction holds the axis and lets it go"
    )
    return Doubt(
        DoubtKind.AT_REST,
        f"{found}. Unless a spring is part of the machine, this cannot judge the gains: in motion the axis is another "
        "machine. Take a trace in motion: robust servo design ... --velocity V, then --design here. With a spring, "
        "give three levels or more",
    )


def doubt_of_crossover(report: RobustnessReport) -> Doubt | None:
    """Why margins are those of an assumed model: the loop crosses over where nothing was measured."""
    if report.given.band is None or report.curves.G is None or report.curves.K is None:
        return None
    crossover = classical_margins(report.curves.omega, report.curves.L).crossover
    first, last = report.given.band
    if not (crossover < 0.999 * first or crossover > 1.001 * last):
        return None
    above = crossover > last
    side, wanted = (
        ("above", f"up to {format_hertz(2 * crossover)}")
        if above
        else ("below", f"from {format_hertz(crossover / 2)} on")
    )
    return Doubt(
        DoubtKind.OUTSIDE_BAND,
        f"the loop crosses over at {format_hertz(crossover)}, {side} the measured band of {format_hertz(first)} to "
        f"{format_hertz(last)}. Stability and margins are those of a model that is assumed there. Take a trace "
        f"{wanted}",
    )


def stabilizing_factor(model: UncertaintyModel, K: control.StateSpace, delay: float) -> float | None:
    """Return the factor on kp, of those tried, nearest to one with which the nominal loop is stable; None of none.

    An integral and a position gain that are too high for kp are cured by more kp, all else by less.
    """
    loops = ((factor, assemble_loop(model, K * factor, w_P=None, delay=delay)) for factor in _TRIED_FACTORS)
    return next((factor for factor, loop in loops if decide_nominal_stability(loop).stable), None)


def doubt_of_unstable_model(
    name: str, report: RobustnessReport, *, under: Conditions, factor: float | None, proved: bool
) -> Doubt | None:
    """Why a model that is unstable with the gains may be wrong: the loop ran with them, or is proved without it."""
    if report.nominally_stable:
        return None
    if proved and under.motion is not BaseMotion.MOVING:  # in motion it may be a mode that the levels do not reach
        return Doubt(
            DoubtKind.CONTRADICTED,
            f"the machine that all traces at rest give is proved stable with these gains, and the linear model of "
            f"{name} is unstable: it has the friction at rest in it. Take a trace in motion, in a band around the "
            "crossover: robust servo design ... --velocity V, then --design here",
        )
    if under.gains is RecordedGains.SAME:
        return Doubt(
            DoubtKind.CONTRADICTED,
            f"{name} was recorded with these gains, by its design, in a loop that was stable. The model says that the "
            "loop is unstable: it is the model that is wrong, and nothing is known of the margins. Take a trace in "
            "motion, with more periods or realisations, in a band around the crossover",
        )
    cure = (
        f"no kp of {min(_TRIED_FACTORS):g} to {max(_TRIED_FACTORS):g} times this one makes it stable: change kv and tn"
        if factor is None
        else f"{factor:g} times this kp makes it stable"
    )
    if under.gains is RecordedGains.OTHER:
        return Doubt(
            DoubtKind.UNSTABLE,
            f"{name} was recorded with other gains, by its design. With these the loop is unstable; {cure}",
        )
    return Doubt(
        DoubtKind.UNSTABLE,
        f"if {name} was recorded with these gains, the loop was stable, and the model is wrong: take a trace in "
        f"motion, in a band around the crossover, and give its --design. If not, the loop is unstable; {cure}",
    )


def doubt_of_margins(report: RobustnessReport) -> Doubt | None:
    """Why a loop that is stable with the whole set is not safe: it is close to instability."""
    if not report.thin_margins:
        return None
    cures = {  # where the gain is nearer to its lower limit, kv and 1/tn are too high for this kp
        "higher": "raise kp, or lower kv and lengthen tn",
        "lower": "lower kp, or kv",
        "": "lower kv, or lengthen tn",
    }
    return Doubt(DoubtKind.THIN_MARGINS, f"{report.thin_margins}: {cures[report.better_gain]}")


def doubt_of_approximation(settings: Drive) -> Doubt | None:
    """Why what is proved is not proved of the drive: a slower position loop was taken as its mean over the phase."""
    if settings.position_every == 1:
        return None
    return Doubt(
        DoubtKind.APPROXIMATED,
        f"an approximation: the position loop runs once in {settings.position_every} periods, and this is its mean "
        "over the phase; nothing is proved of the drive itself",
    )
