"""Reasons to distrust a check of gains, or gains with a good verdict."""

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
from robust.analysis.classical import classical_margins
from robust.analysis.loop import assemble_loop, decide_nominal_stability
from robust.analysis.report import RobustnessReport
from robust.models.sets.model import UncertaintyModel
from robust.servo.checking.findings import BaseMotion, Conditions, Doubt, DoubtKind, RecordedGains

#: Number of lowest lines that decide whether friction holds an axis. It does if the mean cosine of
#: the phase of G on them is above the second number: the cosine is 1 for a spring, 0 for a damper,
#: -1 for a mass.
_LOW_LINES, _HELD = 6, 0.5


#: Factors on kp that are tried where the model is unstable, the mildest first.
_TRIED_FACTORS = (0.5, 2.0, 0.25, 4.0, 0.1, 10.0, 0.05, 20.0)


def doubts_of_warnings(under: Sequence[Conditions], warned: Sequence[Sequence[str]]) -> list[Doubt]:
    """Return a doubt for each warning from reading the traces, then from identifying them."""
    texts = chain.from_iterable([*(one.warnings for one in under), *warned])
    return [Doubt(DoubtKind.WARNED_TRACE, text) for text in dict.fromkeys(texts)]


def doubt_of_trace_at_rest(
    name: str, machine: nlfrf.Bla, *, under: Conditions, unit: str
) -> Doubt | None:
    """Return a doubt if friction holds the axis in a trace:

    G is a spring on low lines, or the design is at rest.
    """
    low = machine.G[:_LOW_LINES]
    held = np.mean((low / np.abs(low)).real) > _HELD
    if not (held or under.motion is BaseMotion.AT_REST):
        return None
    if held:
        found = (
            f"in {name} the axis is held, as by a spring of {np.median((1 / low).real):.3g} {unit} from"
            f" {machine.f[0]:.4g} to {machine.f[: low.size][-1]:.4g} Hz"
        )
    else:
        found = f"{name} was recorded at rest, where friction holds the axis part of the time"
    return Doubt(
        DoubtKind.AT_REST,
        f"{found}. This trace cannot judge the gains, because in motion friction does not hold the"
        " axis. Take a trace in motion: robust servo design ... --velocity V, then --design here."
        " If a spring to ground is part of the machine, give traces at three levels or more",
    )


def doubt_of_crossover(report: RobustnessReport) -> Doubt | None:
    """Return a doubt if the loop crosses over outside the measured band, where the model is
    assumed.
    """
    if report.given.band is None or report.curves.G is None or report.curves.K is None:
        return None
    crossover = classical_margins(report.curves.omega, report.curves.L).crossover
    first, last = report.given.band
    if not (crossover < 0.999 * first or crossover > 1.001 * last):
        return None
    above = crossover > last
    if above:
        side, wanted = "above", f"up to {format_hertz(2 * crossover)}"
    else:
        side, wanted = "below", f"from {format_hertz(crossover / 2)} on"
    return Doubt(
        DoubtKind.OUTSIDE_BAND,
        f"the loop crosses over at {format_hertz(crossover)}, {side} the measured band of"
        f" {format_hertz(first)} to {format_hertz(last)}. There the model is assumed, and so are"
        f" stability and margins. Take a trace {wanted}",
    )


def stabilizing_factor(
    model: UncertaintyModel, K: control.StateSpace, delay: float
) -> float | None:
    """Return the mildest tried factor on kp with which the nominal loop is stable, or None.

    A higher kp helps if kv and 1/tn are too high for kp; otherwise a lower kp helps.
    """
    loops = (
        (factor, assemble_loop(model, K * factor, w_P=None, delay=delay))
        for factor in _TRIED_FACTORS
    )
    return next((factor for factor, loop in loops if decide_nominal_stability(loop).stable), None)


def doubt_of_unstable_model(
    name: str, report: RobustnessReport, *, under: Conditions, factor: float | None, proved: bool
) -> Doubt | None:
    """Return a doubt if the nominal loop is unstable: the gains or the model are wrong.

    The model is wrong if the trace was recorded with these gains, or if the proof with friction
    shows stability.
    """
    if report.nominally_stable:
        return None
    if (
        proved and under.motion is not BaseMotion.MOVING
    ):  # in motion it may be a mode that the levels do not reach
        return Doubt(
            DoubtKind.CONTRADICTED,
            f"the linear model of {name} is unstable with these gains, but the machine and friction"
            " read from all traces at rest are proved stable: the linear model contains the"
            " friction at rest. Take a trace in motion, in a band around the crossover: robust"
            " servo design ... --velocity V, then --design here",
        )
    if under.gains is RecordedGains.SAME:
        return Doubt(
            DoubtKind.CONTRADICTED,
            f"{name} was recorded with these gains, by its design, in a loop that was stable. With"
            " the model the loop is unstable, so the model is wrong, and the margins are unknown."
            " Take a trace in motion, with more periods or realisations, in a band around the"
            " crossover",
        )
    if factor is None:
        cure = (
            f"no kp of {min(_TRIED_FACTORS):g} to {max(_TRIED_FACTORS):g} times the present one makes"
            " it stable: change kv and tn"
        )
    else:
        cure = f"{factor:g} times the present kp makes it stable"
    if under.gains is RecordedGains.OTHER:
        return Doubt(
            DoubtKind.UNSTABLE,
            f"{name} was recorded with other gains, by its design. With these gains the loop is"
            f" unstable; {cure}",
        )
    return Doubt(
        DoubtKind.UNSTABLE,
        f"the loop is unstable with the model of {name}. If the trace was recorded with these"
        " gains, the loop was stable and the model is wrong: take a trace in motion, in a band"
        f" around the crossover, and give its --design. If not, the gains are wrong; {cure}",
    )


def doubt_of_margins(report: RobustnessReport) -> Doubt | None:
    """Return a doubt if the margins are thin although the loop is stable with the whole set."""
    if not report.thin_margins:
        return None
    cures = {  # where the gain is nearer to its lower limit, kv and 1/tn are too high for this kp
        "higher": "raise kp, or lower kv and lengthen tn",
        "lower": "lower kp, or kv",
        "": "lower kv, or lengthen tn",
    }
    return Doubt(DoubtKind.THIN_MARGINS, f"{report.thin_margins}: {cures[report.better_gain]}")


def doubt_of_approximation(settings: Drive) -> Doubt | None:
    """Return a doubt if the position loop is slower than the velocity loop, because its mean was
    checked.
    """
    if settings.position_every == 1:
        return None
    return Doubt(
        DoubtKind.APPROXIMATED,
        f"an approximation was checked: the position loop runs once in {settings.position_every}"
        " periods of the velocity loop, and was replaced by its mean over these; nothing is proved"
        " of the drive itself",
    )
