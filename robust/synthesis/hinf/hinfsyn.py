"""H-infinity synthesis: the output-feedback controller of least closed-loop norm, from two Riccati
equations.

The existence conditions decide in the bisection on gamma. The result is judged by its closed loop.
"""

from __future__ import annotations

from dataclasses import replace

import control
import numpy as np

from nlfrf._base.arguments import (
    require_integer,
    require_nonnegative,
    require_positive,
    require_real,
)
from robust._base.types import LinearSystem
from robust.lti.connections import lower_lft
from robust.lti.lti import response_by_channel, timebase, to_s_plane
from robust.lti.norms import continuous_image, hinf_norm, well_conditioned_with
from robust.lti.realisation import multivariable
from robust.proofs.search.stability import certify_closed_loop
from robust.synthesis.hinf.circles import synthesise_singular
from robust.synthesis.hinf.closed import close_stable_loop, controlled_loop, norm_as_given
from robust.synthesis.hinf.generalised_plant import (
    Plant,
    dual_plant,
    has_zero_on_axis,
    hidden_mode,
    normalise_plant,
    prepare_plant,
)
from robust.synthesis.hinf.riccati_pair import (
    ALL_STEPS_MADE,
    LARGEST_GAMMA,
    MOST_STEPS,
    bisect_level,
    direct_term_bound,
    solve_riccati_pair,
)
from robust.synthesis.hinf.stiff import NEAR_BOUND, settle_lower_bound
from robust.synthesis.hinf.synthesis import Synthesis

_STEPS_UP = (1.0, 1.01, 1.03, 1.1, 1.3, 2.0, 5.0)
_STATIC_SIZES = np.geomspace(
    1e-3, 1e3, 13
)  # sizes of a static controller, times the inverse of the gain from u to y


def hinfsyn(
    P: LinearSystem,
    n_y: int,
    n_u: int,
    *,
    gamma_min: float = 0.0,
    tolerance: float = 1e-4,
    factor: float = 1.01,
    n_steps: int = MOST_STEPS,
) -> Synthesis:
    """Return the controller that minimises the H-infinity norm from w to z of a generalised plant.

    Use this for a generalised plant of your own; `mixsyn` builds the usual one with weights on S, T
    and K S.

    Parameters
    ----------
    P : control.StateSpace or TransferFunction
        Generalised plant from (w, u) to (z, y), continuous or discrete, weights included.
    n_y, n_u : int
        Number of measured outputs y and of controlled inputs u. They are the last outputs and
        inputs of P.
    gamma_min : float
        Sufficient gamma: the search stops once gamma is this small.
    tolerance : float
        Relative distance between the upper and lower bounds of gamma at which the search stops.
    factor : float
        Ratio of gamma of the controller to the least gamma found, at least 1. At the infimum itself
        the controller is singular.
    n_steps : int
        Largest number of values of gamma that are tried. The best controller so far is returned.

    Returns
    -------
    Synthesis
        If no controller was found, K is zero, gamma is inf, and `reason` states why. If gamma is
        not certified, `reason` states this.

    Raises
    ------
    ValueError
        Sizes that do not fit, or a plant that no controller can stabilise through u and y (the
        message names the mode).

    Notes
    -----
    The problem is singular if D12 or D21 lacks rank, or if P12 or P21 has a zero on the stability
    boundary (an integrating plant in a mixed-sensitivity problem). No controller then reaches the
    infimum. It is enclosed by problems whose stability boundary is a circle close to the axis:
    circles on one side give controllers, circles on the other side a lower bound. If both values
    differ by more than 3 %, `reason` states this.

    Combinations of u without an effect on z, and of y without information, are removed first: two
    equal actuators share the work. If P is stable, K = 0 is the first controller tried, and the
    result if no other is better. Some gains are independent of the controller: at infinity, at
    poles of P on the axis, and to outputs that u does not reach. They are part of the lower bound.

    References
    ----------
    Doyle, Glover, Khargonekar & Francis 1989; Glover & Doyle 1988 and Zhou, Doyle & Glover 1996,
    Theorem 17.1 (with D11); Chiang & Safonov 1992 (circles in place of the axis).

    Examples
    --------
    SP Example 2.17: S and K S of a plant in mixed sensitivity reach 1.37.

    >>> G = control.ss(control.tf([200], np.polymul([10, 1], np.polymul([0.05, 1], [0.05, 1]))))
    >>> w_P = control.ss(control.tf([1 / 1.5, 10], [1, 1e-3]))
    >>> r, u = control.ss([], [], [], [[1.0, 0.0]]), control.ss([], [], [], [[0.0, 1.0]])
    >>> e = r - G * u
    >>> P = control.StateSpace(e.A, e.B, np.vstack([e.C, 0 * e.C, e.C]), [[1, 0], [0, 1], [1, 0]])
    >>> P = control.append(w_P, 1, 1) * P
    >>> round(hinfsyn(P, 1, 1).gamma_min, 3)
    1.366
    """
    P = multivariable("P", P)
    return _with_certificate(
        P,
        synthesise(
            P, n_y, n_u, gamma_min=gamma_min, tolerance=tolerance, factor=factor, n_steps=n_steps
        ),
    )


def _with_certificate(P: control.StateSpace, found: Synthesis) -> Synthesis:
    """Return a synthesis with the proved gamma, its certificate and closed loop, or the reason of a
    failure.
    """
    if not found.found:
        return found
    proof = certify_closed_loop(P, found.K, found.gamma, subject="norm of the closed loop")
    text = "; ".join(
        part
        for part in (found.reason, "" if proof.holds else f"gamma is not certified: {proof.reason}")
        if part
    )
    return replace(
        found, gamma=proof.level, certificate=proof, reason=text, CL=lower_lft(P, found.K)
    )


def synthesise(
    P: control.StateSpace,
    n_y: int,
    n_u: int,
    *,
    gamma_min: float = 0.0,
    tolerance: float = 1e-4,
    factor: float = 1.01,
    n_steps: int = MOST_STEPS,
) -> Synthesis:
    """Return `hinfsyn` without the proof of gamma, for callers that judge the loop by another
    measure.
    """
    n_y, n_u = require_integer("n_y", n_y, least=1), require_integer("n_u", n_u, least=1)
    gamma_min = require_nonnegative("gamma_min", gamma_min)
    tolerance = require_positive("tolerance", tolerance)
    factor, n_steps = require_real("factor", factor), require_integer("n_steps", n_steps, least=1)
    if factor < 1:
        raise ValueError(f"factor must be at least 1, got {factor:g}")
    if P.noutputs <= n_y or P.ninputs <= n_u:
        raise ValueError(
            f"P must have more than n_y = {n_y} outputs and n_u = {n_u} inputs, got {P.noutputs}"
            f" and {P.ninputs}"
        )
    wanted = gamma_min, tolerance, factor
    plant = prepare_plant(P, n_y, n_u)
    hidden = hidden_mode(plant)
    if hidden:
        raise ValueError(f"P must be stabilisable through u and y, got a plant where {hidden}")
    found = _synthesise_as_given(P, plant, wanted=wanted, n_steps=n_steps)
    found = settle_lower_bound(P, plant, found=found, factor=factor)
    if _is_far_from_bound(found, wanted) and found.n_steps < n_steps:
        others = _controllers_by_other_means(
            P, plant, wanted=wanted, n_steps=n_steps - found.n_steps
        )
        for loop in (close_stable_loop(P, K) for K in others):
            if loop:
                achieved = norm_as_given(loop[1])[0]
            else:
                achieved = np.inf
            if loop and achieved < found.gamma:
                found = replace(found, K=loop[0], gamma=achieved)
        low = min(found.gamma_min, found.gamma)
        found = replace(
            found, gamma_min=low, reason=found.reason if _is_far_from_bound(found, wanted) else ""
        )
    return found


def _synthesise_as_given(
    P: control.StateSpace, plant: Plant, *, wanted: tuple[float, float, float], n_steps: int
) -> Synthesis:
    """Return the best controller by Riccati equations in the coordinates of P, for a regular or
    singular problem.
    """
    nothing = control.StateSpace(
        [], [], [], np.zeros((plant.into_u.shape[0], plant.out_of_y.shape[1])), P.dt
    )
    best = Synthesis(K=nothing, gamma=np.inf, level=np.inf, gamma_min=0.0, n_steps=0, reason="")
    problem = normalise_plant(plant)
    if problem is not None and not any(map(has_zero_on_axis, (problem, dual_plant(problem)))):
        best = _synthesise_regular(P, problem, nothing=best, wanted=wanted, n_steps=n_steps)
    if best.found or best.n_steps >= n_steps:
        return best
    wanted_singular = wanted[0], wanted[2]
    return synthesise_singular(
        P, plant, nothing=best, wanted=wanted_singular, n_steps=n_steps - best.n_steps
    )


def _synthesise_regular(
    P: control.StateSpace,
    problem: Plant,
    *,
    nothing: Synthesis,
    wanted: tuple[float, float, float],
    n_steps: int,
) -> Synthesis:
    """Return the best controller of a regular problem, judged on P itself, or `nothing` with the
    reason.
    """
    enough, tolerance, factor = wanted
    ends = direct_term_bound(problem), np.inf
    low, high, n_tried = bisect_level(
        lambda gamma: solve_riccati_pair(problem, gamma),
        ends,
        tolerance=tolerance,
        n_steps=n_steps,
        enough=enough,
    )
    best = replace(nothing, gamma_min=low, level=high, n_steps=nothing.n_steps + n_tried)
    late = n_tried >= n_steps
    if not np.isfinite(high):
        if late:
            what = ALL_STEPS_MADE
        else:
            what = f"no level up to {LARGEST_GAMMA:.0e} met the existence conditions"
        return replace(best, reason=what)
    best = replace(
        best, reason="the loop with the controller of the Riccati equations is not stable"
    )
    # The Riccati equations state existence; near the least level rounding decides whether the
    # controller built from them works. So the loop itself is judged, and higher levels are tried.
    for step in _STEPS_UP:
        gamma = high * factor * step
        loop = controlled_loop(P, problem, gamma)
        if loop is None:
            continue
        achieved = hinf_norm(loop[1])[0]
        if achieved <= gamma * 1.001:
            reason = ""
        else:
            reason = f"the norm reached is above the requested level {gamma:.4g}"
        if late:
            reason = f"{ALL_STEPS_MADE} with gamma between {low:.4g} and {high:.4g}"
        if achieved < best.gamma:
            best = replace(best, K=loop[0], gamma=achieved, reason=reason)
        if achieved <= gamma * 1.001:
            break
    return best


def _is_far_from_bound(found: Synthesis, wanted: tuple[float, float, float]) -> bool:
    """Return True if a controller is neither close to the lower bound nor at the sufficient
    level.
    """
    return bool(found.gamma > max(NEAR_BOUND * wanted[2] * found.gamma_min, wanted[0]))


def _controllers_by_other_means(
    P: control.StateSpace, plant: Plant, *, wanted: tuple[float, float, float], n_steps: int
) -> list[control.StateSpace]:
    """Return the zero controller, static ones, and the best in coordinates that balance the
    Gramians of P.
    """
    n_u, n_y = plant.into_u.shape[0], plant.out_of_y.shape[1]
    if P.nstates:
        omega = np.unique(np.abs(np.linalg.eigvals(P.A)))
    else:
        omega = np.ones(1)
    if timebase(P):
        speeds = np.abs(to_s_plane(omega, timebase(P)))
    else:
        speeds = omega
    speeds = speeds[speeds > 0]
    inverses = [np.zeros((n_u, n_y))]
    for at in (speeds.min(initial=1.0) / 10, speeds.max(initial=1.0)):
        inverses += list(
            _STATIC_SIZES[:, None, None]
            * np.linalg.pinv(response_by_channel(P, np.array([at]))[-n_y:, -n_u:, 0].real)
        )
    found = [control.StateSpace([], [], [], sign * M, P.dt) for M in inverses for sign in (1, -1)]
    try:
        T = well_conditioned_with(continuous_image(P))[1]
        back = np.linalg.inv(T)
        balanced = control.StateSpace(T @ P.A @ back, T @ P.B, P.C @ back, P.D, P.dt)
        other = prepare_plant(balanced, n_y, n_u)
        if not hidden_mode(other):
            found.append(_synthesise_as_given(balanced, other, wanted=wanted, n_steps=n_steps).K)
    except np.linalg.LinAlgError:  # no balanced coordinates
        pass
    return found
