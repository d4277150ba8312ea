"""The nu-gap between two plants, and the coprime margin of a loop (Vinnicombe 2001).

Both use normalised coprime factors: the gap is the norm of M2 N1 - N2 M1 if the winding condition
holds, else one. In state space no frequency grid is needed: hinf_norm encloses the peak, zeros
decide the winding condition.
"""

from __future__ import annotations

import control
import numpy as np

from robust._base.types import Controller
from robust.lti.connections import closed_loop, in_series
from robust.lti.lti import Matrices, is_constant, sampling_times_differ, timebase, zeros
from robust.lti.norms import hinf_norm
from robust.lti.realisation import multivariable
from robust.models.sets.coprime import coprime_factors
from robust.models.sets.model import UncertaintyModel, plant_of


def nu_gap(G1: Controller | UncertaintyModel, G2: Controller | UncertaintyModel) -> float:
    """Compute Vinnicombe's nu-gap between two plants, from 0 (equal plants) to 1 (no guarantee).

    Use this to judge whether one controller suits two plants. If the coprime factor margin of a
    controller with one plant (`ncf_margin`) exceeds the gap, the controller stabilises both plants.
    Its margin with the other plant is at least sin(arcsin(margin) - arcsin(gap)). Two plants may
    differ much in open loop and still have a small gap. The gap depends on the units of input and
    output, so shape both plants with the same weights first.

    Parameters
    ----------
    G1, G2 : control.StateSpace, TransferFunction, float, UncertaintyModel
        Plants with one or several inputs and outputs, both continuous or both with the same
        sampling time.

    Returns
    -------
    float
        sup |G1 - G2| / sqrt((1 + |G1|^2)(1 + |G2|^2)) over frequency if the winding condition
        holds, else 1. For several channels the largest singular value of (1 + G2 G2~)^-1/2 (G1 -
        G2) (1 + G1~ G1)^-1/2.

    Raises
    ------
    ValueError
        Sampling times or shapes that differ, or a plant with a mode that cannot be stabilised.

    References
    ----------
    Vinnicombe, *Uncertainty and Feedback* (2001), 3; Zhou & Doyle, *Essentials of Robust Control*,
    17.2 to 17.4.

    Examples
    --------
    A stable and an unstable plant for which a fast controller gives nearly the same loop (Zhou &
    Doyle, 17.2).

    >>> stable, unstable = control.tf([100], [2, 1]), control.tf([100], [2, -1])
    >>> round(nu_gap(stable, unstable), 4), round(nu_gap(stable, control.tf([100], [1, 2, 1])), 4)
    (0.02, 0.8988)
    """
    first, second = plant_of("G1", G1), plant_of("G2", G2)
    steps = {name: timebase(G) for name, G in (("G1", first), ("G2", second)) if not is_constant(G)}
    if len(set(steps.values())) > 1:
        raise ValueError(
            f"G2 must have the sampling time of G1, {steps['G1']:g} s, got {steps['G2']:g} s"
        )
    n_y, n_u = first.noutputs, first.ninputs
    if (second.noutputs, second.ninputs) != (n_y, n_u):
        raise ValueError(
            f"G2 must have {n_y} outputs and {n_u} inputs, as G1, got {second.noutputs} and"
            f" {second.ninputs}"
        )
    (right_1, _), (right_2, _) = coprime_factors("G1", first), coprime_factors("G2", second)
    # the left factors of G2 times the right ones of G1: M2 N1 - N2 M1
    turned = np.block([[np.zeros((n_u, n_y)), -np.eye(n_u)], [np.eye(n_y), np.zeros((n_y, n_u))]])
    distance, _ = hinf_norm(
        _cascade_through(right_1, turned, _left_coprime_factors(second, right_2))
    )
    # [N2; M2]~ [N1; M1] needs as many unstable zeros as the first factor has poles, all of them
    # unstable
    A, B, C, D = _transpose_system(right_2)
    inside = zeros(_cascade_through(right_1, np.eye(n_y + n_u), (-A, -B, C, D)))
    if int(np.sum(inside.real > 0)) != len(A):
        return 1.0
    return float(min(distance, 1.0))


def ncf_margin(G: Controller | UncertaintyModel, K: Controller) -> float:
    """Compute the normalised coprime factor margin of a loop; 0 if the loop is unstable.

    Use this as one number for the robustness of a loop, for instance after `ncfsyn`, which
    maximises this margin for a shaped plant. The loop stays stable with every plant whose nu-gap
    (`nu_gap`) to G is smaller than the margin.

    Parameters
    ----------
    G : control.StateSpace, TransferFunction, UncertaintyModel
        Plant with one or several inputs and outputs. A set of the coprime form is taken with its
        shaping weights.
    K : control.StateSpace, TransferFunction, float or (n_u, n_y) ndarray
        Controller, negative feedback, on the same time base.

    Returns
    -------
    float
        1 / norm of [K; 1] (1 + G K)^-1 [1, G].

    Raises
    ------
    ValueError
        Sampling times that differ, a K whose shape does not fit G, or an algebraic loop without a
        solution.

    References
    ----------
    Vinnicombe 2001, 1.2; SP 9.4.1 (there 1/gamma).

    Examples
    --------
    For G = K = 1 every column is 1/2 [1, 1; 1, 1].

    >>> round(ncf_margin(1.0, 1.0), 6)
    1.0
    """
    plant, K = plant_of("G", G), multivariable("K", K)
    if sampling_times_differ(plant, K):
        raise ValueError(
            f"K must have the sampling time of G, {timebase(plant):g} s, got {timebase(K):g} s"
        )
    if is_constant(plant):
        dt = timebase(K)
    else:
        dt = timebase(plant)
    norm = hinf_norm(control.StateSpace(*closed_loop(plant, K, ("u", "y"), ("p_out", "p_in")), dt))[
        0
    ]
    return 1 / norm


def _left_coprime_factors(G: control.StateSpace, right: Matrices) -> Matrices:
    """Return [N M] of G = M^-1 N: the transposed right factors of the transposed plant."""
    if (G.ninputs, G.noutputs) != (1, 1):
        right, _ = coprime_factors(
            "G2", control.StateSpace(*_transpose_system((G.A, G.B, G.C, G.D)), G.dt)
        )
    return _transpose_system(right)


def _transpose_system(matrices: Matrices) -> Matrices:
    A, B, C, D = matrices
    return A.T, C.T, B.T, D.T


def _cascade_through(first: Matrices, between: np.ndarray, last: Matrices) -> control.StateSpace:
    """Return `first`, a constant matrix and `last` in series."""
    through = control.StateSpace([], [], [], between, 0)
    return in_series(control.StateSpace(*first, 0), through, control.StateSpace(*last, 0))
