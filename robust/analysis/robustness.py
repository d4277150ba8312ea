"""The controller check: stability of the nominal loop, then the effect of the whole set, then the
proofs.

                      w Delta
                    +---------+           multiplicative: reads u, acts at p_in    G (1 + w Delta)
                    |         v           additive:       reads u, acts at p_out   G + w Delta
                    |        p_in   p_out inv. mult.:     reads y, acts at p_out   G / (1 + w Delta)
                    |         |       |   inv. additive:  reads y, acts at p_in    G / (1 + w G Delta)
    r --->(+)- e ->[ K ]- u -(+)-[ G ]-(+)---+--> y
          -^                                 |
           +---------------------------------+    u = K (r - y),  S = 1/(1 + G K),  T = 1 - S

A sampled controller is checked in a sampled loop: hold and computation delay are first included in
G.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TypeAlias

import control
import numpy as np

from nlfrf import Bla
from nlfrf._base.arguments import keep_warnings, require_choice, require_positive, short_form
from robust._base.types import Controller, Weight
from robust.analysis.classical import USUAL_PEAK
from robust.analysis.findings import METHODS, Effort, Findings, ProofMethod
from robust.analysis.judge_exact import judge_exact
from robust.analysis.judge_lines import (
    LoopOnLines,
    MatrixLoopOnLines,
    assemble_matrix_on_lines,
    assemble_on_lines,
    judge_lines,
    judge_matrix_lines,
)
from robust.analysis.judge_mu import judge_mu, judge_system
from robust.analysis.loop import Loop, assemble_loop
from robust.analysis.loop_level import encoder_noise, predict_level, require_one_channel_loop
from robust.analysis.loop_of_channels import LoopOfChannels
from robust.analysis.report import RobustnessReport
from robust.analysis.signals import LoopSignals
from robust.analysis.text import describe_confidence
from robust.lti.connections import biproper_inverse
from robust.lti.grids import structure_grid
from robust.lti.lti import response
from robust.lti.realisation import multivariable
from robust.models.sets.interconnection import UncertainSystem
from robust.models.sets.measured import lines_of, warn_of_unknown_hold
from robust.models.sets.model import UncertaintyModel, describe_no_set, has_several_channels
from robust.proofs.search.programs import SOLVERS

#: A loop that `check` can judge.
AnyLoop: TypeAlias = Loop | LoopOfChannels | LoopOnLines | MatrixLoopOnLines
_LARGEST_PEAK = 4.0  # of |S|: above it, robustness is poor whatever a demand allows (SP 2.4.3)


@keep_warnings
def check(
    model: UncertaintyModel | Bla | control.FrequencyResponseData,
    K: Controller,
    *,
    w_P: Weight | None = None,
    delay: float = 0.0,
    certify: bool = True,
    proof: ProofMethod = "exact",
    solver: str | None = None,
    n_unstable: int = 0,
    signals: LoopSignals | None = None,
) -> RobustnessReport:
    """Check a controller with an uncertainty model, and prove robust stability and performance.

    Use this after every design, and for an existing controller. The report contains the verdict,
    the margins over the whole set, and the proofs. Use `check_structure` for several uncertainties.

    Parameters
    ----------
    model : UncertaintyModel, nlfrf.Bla or control.FrequencyResponseData
        The plant with its uncertainty. If it is an FRF (alone, as a Bla with its bound, or as the
        nominal of a model), the result holds on its lines only. An FRF with several channels is
        checked without uncertainty.
    K : control.StateSpace, TransferFunction or float
        Controller, negative feedback u = K (r - y). With a discrete K and a continuous nominal,
        which is the usual case, the nominal is discretised with zero-order hold and delay. Verdict,
        margins and certificate then include the aliases of the set above the Nyquist frequency. For
        several channels the aliases are part of a sampled set, whose weights cover them on a
        frequency grid.
    w_P : control.StateSpace or TransferFunction, optional
        Performance weight: the demand is |w_P S_p| <= 1 for every plant of the set. The report
        warns of thin margins if |S| over the set exceeds a limit. This limit is max 1/|w_P| if that
        is at most 4, otherwise 2.
    delay : float
        Computation delay [s], in addition to the delay of the model.
    certify : bool
        Prove the result over all frequencies. Without a proof the best verdict is "not certified".
    proof : str
        Method of proof for one channel. "exact": polynomials in exact arithmetic. "lmi": linear
        matrix inequality with a matrix P and a scaling from cvxpy, verified over the rationals; it
        does not decide loops with aliases or with a delay in continuous time. "both": a proof by
        either method suffices. For several channels the method is always "lmi".
    solver : str, optional
        Solver of cvxpy for P and the scaling: "CLARABEL" or "SCS". Default: CLARABEL for one
        channel, both solvers for several channels.
    n_unstable : int
        Number of unstable open-loop poles, if the plant is an FRF.
    signals : LoopSignals, optional
        Reference, disturbance and noise. The report then contains the rms of plant input and
        output, as from `predict_level`. This needs an UncertaintyModel with a parametric nominal.

    Returns
    -------
    RobustnessReport
        Verdict, margins and proofs. An unstable loop or a missed demand is a result, not an error.
        For several channels the report is as from `check_structure`.

    Raises
    ------
    ValueError
        Sampling times or shapes that do not fit each other, an unstable w_P, an algebraic loop
        without a solution, or signals that do not fit the loop or the model.

    References
    ----------
    SP 7.5 (robust stability), 7.6 (robust performance), 8.6; Seiler, Packard & Gahinet 2020 (disk
    margins); Dullerud & Glover, IEEE Trans. Automatic Control 38, 1993 (sampled sets).

    Examples
    --------
    >>> import numpy as np
    >>> from robust import UncertaintyModel
    >>> lag, w = control.tf([1], [1, 1]), control.tf([1, 0.2], [0.5, 1])
    >>> model = UncertaintyModel(lag, w, "multiplicative", np.array([1.0]), np.array([0.5]), perturbation="LTI")
    >>> report = check(model, 2.0)                       # |w T| peaks at |w| -> 2, T = 2/(s + 3): 0.98 near 5 rad/s
    >>> report.verdict, bool(abs(report.margins.rs - 1 / max(report.curves.rs)) < 1e-3)
    ('robust', True)
    """
    require_choice("proof", proof, METHODS)
    if solver is not None:
        require_choice("solver", solver, SOLVERS)
    if signals is not None:
        require_one_channel_loop(model)
    loop, judge = _assemble(model, K, w_P=w_P, delay=delay, n_unstable=n_unstable)
    found = judge(Effort(certify=certify, proof=proof, solver=solver))
    level, noise = None, float("nan")
    if isinstance(loop, Loop) and found.nominally_stable:
        if signals is None:
            level = None
        else:
            level = predict_level(loop.model, loop.controller, signals, delay=delay)
        noise = encoder_noise(loop)
    return RobustnessReport(
        **vars(found),
        given=loop.given,
        channels=loop.channels if isinstance(loop, LoopOfChannels | MatrixLoopOnLines) else None,
        level=level,
        peak=_allowed_peak(loop.given.demand),
        encoder_noise=noise,
        confidence=describe_confidence(model),
    )


def _allowed_peak(w_P: control.StateSpace | None) -> float:
    """Return the largest |S| that a demand allows; the usual limit if it allows more than 4, or
    less than one.

    The result only limits a warning, so a grid around the modes of 1/w_P and infinite frequency are
    enough.
    """
    if w_P is None:
        W = None
    else:
        W = multivariable("w_P", w_P)
    if W is None or not W.issiso() or W.D[0, 0] == 0:
        return USUAL_PEAK
    inverse = biproper_inverse(W)
    allowed = max(np.abs(response(inverse, structure_grid(inverse))).max(), abs(inverse.D[0, 0]))
    return (
        allowed if 1 <= allowed <= _LARGEST_PEAK else USUAL_PEAK
    )  # below one |S| grows no disturbance


def _assemble(
    model: UncertaintyModel | Bla | control.FrequencyResponseData,
    K: Controller,
    *,
    w_P: Weight | None,
    delay: float,
    n_unstable: int,
) -> tuple[AnyLoop, Callable[[Effort], Findings]]:
    """Return the loop of a model and a controller, and its judge; check that they fit."""
    if has_several_channels(model):
        channels = LoopOfChannels(model=model, K=multivariable("K", K), w_P=w_P, delay=delay)
        return channels, partial(judge_mu, channels)
    plant = lines_of(model)
    if plant is not None and plant.G.shape[:2] == (1, 1):
        lines = assemble_on_lines(plant, K, w_P=w_P, delay=delay, n_unstable=n_unstable)
        return lines, partial(judge_lines, lines)
    if isinstance(model, control.FrequencyResponseData):
        matrix = assemble_matrix_on_lines(model, K, w_P=w_P, delay=delay, n_unstable=n_unstable)
        return matrix, partial(judge_matrix_lines, matrix)
    if not isinstance(model, UncertaintyModel):
        raise ValueError(
            "model must be an UncertaintyModel, a Bla or a FrequencyResponseData, got"
            f" {describe_no_set(model)}"
        )
    loop = assemble_loop(model, K, w_P=w_P, delay=delay)
    if loop.dt:
        warn_of_unknown_hold(model, loop.dt)
    return loop, partial(judge_exact, loop)


def check_structure(
    system: UncertainSystem,
    *,
    certify: bool = True,
    gap: float | None = None,
    solver: str | None = None,
) -> RobustnessReport:
    """Check a loop with several uncertainties by the structured singular value, with proofs.

    Use this if uncertainties act at several places, or if parameters are uncertain.

    Parameters
    ----------
    system : UncertainSystem
        System with its perturbations, from `interconnection`.
    certify : bool
        Prove the result at all frequencies. Without a proof the best verdict is "not certified".
    gap : float, optional
        Subdivide the box of real parameters (see `parameter_margin`) until the proved margin
        (`margins.rs`) and a destabilising size (`margins.broken`) differ by this relative amount.
        By default it is 5 %, and the box is subdivided only if the verdict is still open.
    solver : str, optional
        Solver of cvxpy that searches one scaling for all frequencies: "CLARABEL" or "SCS". Default:
        one after the other.

    Returns
    -------
    RobustnessReport
        Verdict, margins and proofs. An unstable loop is a result, not an error. If one block is of
        class "operator" (any causal operator, as in `UncertaintyModel`), only a proof with the same
        scalings at every frequency is accepted (Shamma 1994).

    Raises
    ------
    ValueError
        An argument that is not an UncertainSystem, or a system without blocks.

    References
    ----------
    SP 8.9 (RS), 8.10 (RP); Packard & Doyle 1993.

    Examples
    --------
    >>> from robust.models.sets.interconnection import Block, interconnection
    >>> lag = control.ss([[-1.0]], [[1.0, 1.0]], [[1.0]], [[0.0, 0.0]], inputs=["u", "pole"], outputs="y")
    >>> K = control.ss([], [], [], [[-4.0]], inputs="y", outputs="u")
    >>> blocks = {"pole": Block("y", "pole", 2.5, kind="real"), "actuator": Block("u", "u", 0.5)}
    >>> report = check_structure(interconnection([lag, K], blocks))      # s + 5 - 2.5 d1 + 2 d2: 4.5 of 5
    >>> report.verdict, round(report.margins.rs, 3)
    ('robust', 1.111)
    """
    if not isinstance(system, UncertainSystem):
        raise ValueError(
            f"system must be an UncertainSystem, from interconnection(), got {short_form(system)}"
        )
    if not system.blocks:
        raise ValueError("system must have at least one block to check, got none")
    if gap is not None:
        gap = require_positive("gap", gap)
    effort = Effort(certify=certify, solver=solver, gap=gap)
    return RobustnessReport(**vars(judge_system(system, effort)))
