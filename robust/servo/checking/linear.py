"""The linear loop of a check: the set of a BLA, the controller of the gains, and reasons to
distrust it.
"""

from __future__ import annotations

import warnings
from dataclasses import replace

import control
import numpy as np

import nlfrf
from nlfrf._base.arguments import ratio_unit
from nlfrf._base.values import value
from nlfrf.rig import Drive
from robust._base.states import Verdict
from robust._base.warnings import DesignWarning
from robust.analysis.loop import assemble_loop
from robust.analysis.report import RobustnessReport
from robust.analysis.robustness import check as check_loop
from robust.analysis.step import StepResponse, measure_step, simulate_step
from robust.models.fit.nominal_fit import NominalFit
from robust.models.sets.build import uncertainty
from robust.models.sets.model import UncertaintyModel
from robust.servo.checking.doubts import (
    doubt_of_approximation,
    doubt_of_crossover,
    doubt_of_margins,
    doubt_of_trace_at_rest,
    doubt_of_unstable_model,
    stabilizing_factor,
)
from robust.servo.checking.drive_friction import DriveFriction
from robust.servo.checking.findings import Doubt
from robust.servo.checking.machine import behind_lag
from robust.servo.checking.traces import Traces
from robust.servo.gains.p_pi import with_set_point


@value(copy=False)
class LinearLoop:
    """The linear loop of a check: the set of plants, the controller of the gains, and its check."""

    machine: control.StateSpace  # the nominal without the lag of the drive
    model: UncertaintyModel  # behind that lag
    K: control.StateSpace
    report: RobustnessReport
    unit: str  # of the force in the traces

    @property
    def stable(self) -> bool:
        """True if the nominal loop is stable."""
        return self.report.nominally_stable


def check_linear_loop(
    bla: nlfrf.Bla,
    nominal: NominalFit,
    K: control.StateSpace,
    settings: Drive,
    *,
    unit: str,
    peak: float,
) -> LinearLoop:
    """Return the loop of a controller with the set of a BLA of the machine, checked."""
    # a free axis has poles below the band; `doubt_of_crossover` warns if they matter
    with warnings.catch_warnings():  # the page shows the warnings of the set
        warnings.simplefilter("ignore", DesignWarning)
        machine = uncertainty(bla, replace(nominal, warnings=()))
    model = replace(machine, nominal=behind_lag(machine.nominal, settings.lag))
    report = replace(check_loop(model, K, delay=settings.delay), peak=peak)
    return LinearLoop(machine=machine.nominal, model=model, K=K, report=report, unit=unit)


def doubts_of_loop(
    loop: LinearLoop,
    traces: Traces,
    bla: nlfrf.Bla,
    settings: Drive,
    friction: DriveFriction,
) -> list[Doubt]:
    """Return the reasons to distrust the linear loop, whose set is from the BLA of the machine."""
    name, under = traces.names[traces.chosen], traces.under[traces.chosen]
    if loop.stable:
        factor = None
    else:
        factor = stabilizing_factor(loop.model, loop.K, settings.delay)
    at_rest = None
    if friction.assumed is None:
        unit = ratio_unit(loop.unit, settings.base_unit)
        at_rest = doubt_of_trace_at_rest(name, bla, under=under, unit=unit)
    doubts = (
        at_rest,
        doubt_of_crossover(loop.report),
        doubt_of_unstable_model(
            name, loop.report, under=under, factor=factor, proved=friction.proved
        ),
        doubt_of_margins(loop.report),
        doubt_of_approximation(settings),
    )
    return [doubt for doubt in doubts if doubt is not None]


def report_of_drive(report: RobustnessReport, *, misled: bool) -> RobustnessReport:
    """Return the report without advice on an unstable model, and without a verdict from a trace
    that misleads.
    """
    if report.verdict is Verdict.NOT_ROBUST and misled:
        if report.nominally_stable:
            what = report.reason
        else:
            what = f"the model is {report.reason}"
        reason = f"{what}; but the trace cannot judge these gains, see the warning"
        return replace(report, verdict=Verdict.NOT_CERTIFIED, reason=reason, advice="")
    # the advice for a general loop is to lower the gain, which is wrong for a kp that is too low
    if report.nominally_stable:
        return report
    return replace(report, advice="")


def step_of(loop: LinearLoop, settings: Drive) -> StepResponse:
    """Return the response to a step of the position set point, through the loops of the drive."""
    G = assemble_loop(loop.model, loop.K, w_P=None, delay=settings.delay).G
    drive = with_set_point(settings, output_unit=loop.unit)
    A = np.block([[G.A, G.B @ drive.C], [drive.B[:, 1:] @ G.C, drive.A]])
    direct = np.zeros_like(A)
    direct[: G.nstates, : G.nstates] = G.B @ drive.D[:, 1:] @ G.C
    B = np.vstack([G.B @ drive.D[:, :1], drive.B[:, :1]])
    C = np.hstack([G.C, np.zeros((1, drive.nstates))])
    closed = control.StateSpace(A + direct, B, C, 0, loop.K.dt, remove_useless_states=False)
    t, y = simulate_step(closed)
    final = float(np.real(closed.dcgain()))
    return measure_step(t, y[0], u=np.full(t.size, np.nan), final=final, cut=True)
