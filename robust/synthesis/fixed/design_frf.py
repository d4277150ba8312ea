"""`design_frf`: controllers of fixed structure from an FRF, for one loop or several."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import cast

from nlfrf import Bla
from nlfrf._base.arguments import as_list, require_kind
from robust._base.types import Controller, Weight
from robust.models.sets.model import UncertaintyModel
from robust.synthesis.fixed.demands import Bound
from robust.synthesis.fixed.one_loop import Proved, design_loop
from robust.synthesis.fixed.plants import DesignPlant
from robust.synthesis.fixed.sequential import close_in_turn
from robust.synthesis.fixed.structures import ControllerStructure
from robust.synthesis.hinf.design import Design


def design_frf(
    plant: DesignPlant | Sequence[DesignPlant],
    structure: str | int | ControllerStructure | list[str | int | ControllerStructure],
    *,
    w_P: Weight | list[Weight | None] | None = None,
    w_T: Weight | list[Weight | None] | None = None,
    w_u: Weight | list[Weight | None] | None = None,
    M_S: Bound | list[Bound | None] | None = None,
    M_T: Bound | list[Bound | None] | None = None,
    M_u: Bound | list[Bound | None] | None = None,
    omega_c: float | tuple[float, float] | list[float | tuple[float, float] | None] | None = None,
    gain: tuple[float, float] | None = None,
    aim: str = "auto",
    dt: float = 0.0,
    delay: float = 0.0,
    fixed: Controller | list[Controller] = 1,
    end_gain: float = 0.5,
    integrators: int = 0,
    filter_time: float | None = None,
    stable: bool = True,
    positive: bool = False,
    start: Controller | list[Controller | None] | None = None,
    n_starts: int = 1,
    n_unstable: int = 0,
    plant_integrators: int | None = None,
    prove: Proved | None = None,
    n_iterations: int = 60,
    progress: Callable[[int, float], object] | None = None,
) -> Design:
    """Design a controller of fixed structure, such as a PID, directly from a measured FRF.

    Use this for a PID or another low-order controller, if you have only an FRF, or if the fit of a
    parametric model is doubtful.

    The hard demands are M_S, M_T, M_u, omega_c and gain. Stability with every plant of the set is
    always a hard demand. The aim is to minimise gamma, the norm with the weights; or, without
    weights, to maximise the gain at low frequency.

    Parameters
    ----------
    plant : nlfrf.Bla, FrequencyResponseData, UncertaintyModel, control system, list of them
        The plant. An FRF is known on its lines only. It is interpolated between two lines if the
        controller has a mode there, and extrapolated below the first line. Every demand holds for
        each plant within the bound of a Bla or the radius of a model. A list is a family of plants
        with one controller for all. For several channels, with as many inputs as outputs, the
        controller is diagonal, and any of the next arguments may be a list with one entry for each
        loop.
    structure : str, int or ControllerStructure
        "P", "I", "PI", "PD", "PID", "lead", "lead-lag" (real zeros and poles); "order-n" or n for a
        controller of order n; or a ControllerStructure, for example with a given denominator.
    w_P, w_T, w_u : control system or float, optional
        Weights on S, T and K S. gamma is the maximum over frequency of the norm of [max |w_P S|
        over the set; w_T T; w_u K S]; with w_P alone it is mu of robust performance.
    M_S, M_T, M_u : float or control system, optional
        Largest |S|, |T| and |K S| allowed: a number, or a system whose magnitude is the limit.
    omega_c : float or (low, high), optional
        Smallest crossover frequency allowed [rad/s], and the largest: |L| <= 1 at all frequencies
        above it, or at it alone if the structure has a resonance.
    gain : (omega, least), optional
        Smallest |L| allowed at a frequency omega [rad/s], for tracking and disturbance rejection.
    aim : str
        "gamma": minimise gamma. "gain": maximise lim s^m K(s) at zero frequency (m integrators),
        with gamma <= 1 as a further demand if weights are given. "auto": "gamma" if a weight is
        given, otherwise "gain".
    dt : float
        Sampling time of the controller [s]; 0 for a continuous one. Hold and delay are added to the
        plant.
    delay : float
        Computation delay [s], in addition to the delay of the plant.
    fixed : control system
        A known factor of K with the sampling time dt, for example a notch or a low-pass filter
        (`robust.shaping`).
    end_gain : float
        Largest |L| allowed at the last line of an FRF and above it, where the gain of the plant is
        assumed to be no larger.
    integrators : int
        Number of integrators of a controller "order-n".
    filter_time : float, optional
        Time constant of the derivative filter of PD and PID [s]. By default it is designed, and at
        least half a sample.
    stable : bool
        Keep the controller itself stable, except for its integrators.
    positive : bool
        Keep Kp, Ki and Kd of a PID (or of a part of it) positive, without the factor `fixed`, as a
        PLC needs them.
    start : control system, optional
        A stabilising controller of this structure, as start; by default from differential evolution.
    n_starts : int
        Number of controllers from differential evolution that are refined, beside a simple start.
    n_unstable : int
        Number of unstable poles of the plant, for an FRF.
    plant_integrators : int, optional
        Number of integrators of the plant, for an FRF. By default it is estimated from slope and
        phase of the first lines. The loop must be stable for each number that their bound allows;
        otherwise its stability is not decided.
    prove : MachineWithFriction or (FrictionPlant, MaxwellSlip), optional
        Machine and class of friction with which the loop must be proved to come to rest: the gain
        is lowered until the proof holds.
    n_iterations : int
        Largest number of convex optimisation steps from each start.
    progress : callable, optional
        Function that is called with (iteration, worst demand or gamma) after every step.

    Returns
    -------
    Design
        The best controller found, with its fields `met`, `reason` and `history`. `reason` names the
        demands that are not met.

    Warns
    -----
    DesignWarning
        A filter time below half a sample: the derivative oscillates from sample to sample.

    Raises
    ------
    ValueError
        No stabilising controller was found as a start, parts that do not fit each other, no demand
        at all, or no gain for which the friction proof holds.

    References
    ----------
    Karimi & Kammer, *A data-driven approach to robust control of multivariable systems by convex
    optimization*, Automatica 85 (2017); SP 7.5 and 7.6.

    Examples
    --------
    SP Example 2.17: the least gamma is 1.366 with order 4; order 2 is nearly as good.

    >>> import control
    >>> import numpy as np
    >>> import robust
    >>> G = control.tf([200], np.polymul([10, 1], np.polymul([0.05, 1], [0.05, 1])))
    >>> design = design_frf(G, 2, w_P=robust.performance_weight(10, M_S=1.5, A=1e-4), w_u=1.0)
    >>> design.K.nstates, bool(design.gamma < 1.41)
    (2, True)
    """
    require_kind("positive", positive, bool)
    asked = {
        "w_P": w_P,
        "w_T": w_T,
        "w_u": w_u,
        "M_S": M_S,
        "M_T": M_T,
        "M_u": M_u,
        "omega_c": omega_c,
        "gain": gain,
        "aim": aim,
        "dt": dt,
        "delay": delay,
        "fixed": fixed,
        "end_gain": end_gain,
        "integrators": integrators,
        "filter_time": filter_time,
        "stable": stable,
        "positive": positive,
        "y_rises": positive,
        "start": start,
        "n_starts": n_starts,
        "n_unstable": n_unstable,
        "plant_integrators": plant_integrators,
        "prove": prove,
        "n_iterations": n_iterations,
        "progress": progress,
    }
    matrices = [
        one
        for one in as_list(plant)
        if isinstance(one, Bla | UncertaintyModel) and not one.is_single
    ]
    if plant in matrices:
        return close_in_turn(matrices[0], structure, asked)
    if matrices:
        raise ValueError(
            "plant must be one Bla or UncertaintyModel with several channels, or a list of single"
            " loops, got a list of matrices"
        )
    return design_loop(plant, cast("str", structure), asked)
