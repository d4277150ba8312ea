"""The entry point to controllers of fixed structure from an FRF: one loop by itself, several one
after the other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import cast

from nlfrf._base.arguments import require_kind
from robust._base.channels import is_matrix
from robust._base.types import Controller, Weight
from robust.models.sets.model import has_several_channels
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
    """Design a controller of fixed structure directly from a measured FRF, without a parametric
    model.

    Use this for a PID or another low-order controller, if the FRF is all you have, or if a fit is
    doubtful.

    Give the hard demands (M_S, M_T, M_u, omega_c, gain; stability of every plant of the set is
    always one of them) and the aim: the weights (aim "gamma"), or, without weights, the gain at low
    frequency.

    Parameters
    ----------
    plant : nlfrf.Bla, FrequencyResponseData, UncertaintyModel, control system, list of them
        An FRF is known on its lines only. It is interpolated between two of them where the
        controller has a mode, and continued below the first one by gain and phase of its first
        lines. A list is a family: one controller for all. Discs of a Bla or model are part of every
        demand, which then holds for each plant in them. For a matrix, with as many inputs as
        outputs, the controller is diagonal: input k by output k, one loop after the other with
        those before it closed. Each is then judged with all others closed, and designed again if it
        misses a demand. The whole is checked last. A list for any of the next arguments has one
        entry for each loop.
    structure : str, int or ControllerStructure
        "P", "I", "PI", "PD", "PID", "lead", "lead-lag" (real zeros and poles), or an order n
        ("order-n"); or one of your own, with a given denominator.
    w_P, w_T, w_u : control system or float, optional
        Weights on S, T and K S. gamma = max over frequency of the norm of [|w_P S| at worst over
        the set; w_T T; w_u K S]: without uncertainty the H-infinity norm, with w_P alone the
        structured singular value of robust performance.
    M_S, M_T, M_u : float or control system, optional
        Largest |S|, |T|, |K S| allowed, a number or a magnitude over frequency.
    omega_c : float or (low, high), optional
        Least crossover [rad/s]; with two numbers also the largest one: |L| <= 1 from there on, or
        only at that line if the structure has a resonance. With one number the loop may cross over
        far above it.
    gain : (omega, least), optional
        Least |L| at a frequency [rad/s]: tracking and disturbance rejection.
    aim : str
        "gamma": minimise gamma. "gain": maximise lim s^m K(s) at zero frequency, with the weights
        as further demands (gamma <= 1). "auto": "gamma" if a weight is given.
    dt : float
        Sampling time of the controller [s]; 0 for a continuous one. Hold and delay are added to the
        plant.
    delay : float
        Computation delay [s], in addition to the delay of the plant.
    fixed : control system
        A known factor of K on the same time base: a notch, a roll-off, a filter
        (`robust.shaping.notch`, ...).
    end_gain : float
        Largest |L| from the last line of an FRF on; above it the plant is assumed to be no larger
        than there.
    integrators : int
        Number of integrators in an "order-n".
    filter_time : float, optional
        Time constant of the derivative filter [s] of PD and PID; by default chosen by the design,
        at least half a sample: with a shorter one a sampled derivative rings.
    stable : bool
        Keep the controller itself stable (integrators aside).
    positive : bool
        Keep Kp, Ki and Kd of a PID (or a part of one) positive: no PLC takes a negative time Ti =
        Kp/Ki or Td = Kd/Kp. Without a given filter time it is then the best of six.
    start : control system, optional
        A stabilising controller of the structure as a start; by default it is searched for over the
        band, in gain and roots, by differential evolution.
    n_starts : int
        Number of evolved controllers that are refined, besides a simple one; more take longer and
        may end better.
    n_unstable : int
        Number of unstable poles of a plant that is an FRF.
    plant_integrators : int, optional
        Number of integrators of a plant that is an FRF. By default estimated, with the sign of the
        plant, from slope and phase of its first lines. If their bound allows several values, the
        design must hold for each; otherwise its stability is not decided.
    prove : MachineWithFriction or (FrictionPlant, MaxwellSlip), optional
        Class of friction with which the loop must be proved to come to rest: the gain is lowered
        until the proof holds, and all else is judged again there.
    n_iterations : int
        Largest number of convex steps from each start, on each choice of lines.
    progress : callable, optional
        Function of (iteration, worst demand or gamma), called after every step.

    Returns
    -------
    Design
        With `met`, `reason` and `history`. `reason` names the demands that are not met, with the
        best controller found.

    Warns
    -----
    DesignWarning
        A filter time below half a sample.

    Raises
    ------
    ValueError
        No stabilising controller to begin from, parts that do not fit each other, no demand at all,
        no gain that is proved.

    References
    ----------
    Karimi & Kammer, *A data-driven approach to robust control of multivariable systems by convex
    optimization*, Automatica 85 (2017); SP 7.5 and 7.6.

    Examples
    --------
    SP Example 2.17: order 4 reaches gamma 1.366 at best, order 2 nearly so.

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
    if has_several_channels(plant) or is_matrix(plant):
        return close_in_turn(plant, structure, asked)
    if isinstance(plant, list | tuple) and any(
        has_several_channels(one) or is_matrix(one) for one in plant
    ):
        raise ValueError(
            "plant must be one Bla or UncertaintyModel with several channels, or a list of single"
            " loops, got a list of matrices"
        )
    return design_loop(plant, cast("str", structure), asked)
