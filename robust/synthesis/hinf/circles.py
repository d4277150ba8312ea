"""Singular H-infinity problems: zeros on the axis or at infinity, bounded from inside and reached
from outside.

No Riccati equation has a solution where P12 or P21 loses rank on the axis or at infinity (no weight
on u, an integrating plant under disturbances at its output). The axis is therefore replaced by
circles on either side of it:

    a disc in the right half plane     requires less: its least norm is a lower bound of the
                                       original one
    all but a disc in the left one     requires more: its controllers are judged by the original
                                       norm

Both are regular, both tend to the infimum as the circles tend to the axis (the bilinear transform
of Chiang & Safonov 1992 is the second). Where P12 or P21 lacks rank everywhere, small outputs of u
and disturbances of y are added to the second problem, which then requires more again.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import control
import numpy as np

from robust.synthesis.hinf.closed import close_stable_loop, controlled_loop, norm_as_given
from robust.synthesis.hinf.generalised_plant import (
    Plant,
    dual_plant,
    has_full_ranks,
    has_zero_on_axis,
    hidden_mode,
    map_region,
    normalise_plant,
    regularise_plant,
)
from robust.synthesis.hinf.riccati_pair import (
    ALL_STEPS_MADE,
    LARGEST_GAMMA,
    bisect_level,
    control_riccati,
    direct_term_bound,
    solve_riccati_pair,
)
from robust.synthesis.hinf.stiff import ROUNDING_FACTOR, TOLERANCE, fails_in_digits
from robust.synthesis.hinf.synthesis import Synthesis
from robust.synthesis.hinf.unchangeable import KERNEL_TOLERANCE, unchangeable_gain

#: Decades between the circles and the slowest pole, and the fastest.
_CIRCLE_RUNGS = ((1, 2), (1, 1), (1, 3), (1, 4), (2, 3), (3, 4), (4, 5), (0, 0))
_AXIS_RUNG = (
    4,
    0,
)  # the last resort: the axis is kept, the plant is regularised by 1e-4 where rank is lacking
_REGULARISATIONS = (
    1e-2,
    1e-6,
    # regularisation relative to the scaled plant if rank is lacking everywhere: a decade less for each
    # rung; least one
)
_BEYOND_POLES = 1.5  # factor that keeps poles away from the crossing of a circle
_COARSE_RUNGS = (1, 1), (0, 0)  # coarse circles, used if finer ones find nothing near the bound
_FAR_FROM_BOUND = 1.1
_NEAR_ENOUGH = 1.005  # times `factor`: sufficient distance to the lower bound
_MAX_CONDITIONS = (1e6, 1e4)  # condition of D12 and D21 up to which bounds use both, or one alone
_CHECKED_SHARES = (
    0.98,
    0.9,
    0.7,
    0.4,
)  # of a level that fails: these must fail too, otherwise it is rounding
#: Factors over the least level, dense at first: by rounding a loop may be unstable at one and
#: stable at the next.
_SINGULAR_STEPS_UP = (1.0, 1.003, 1.006, 1.01, 1.02, 1.05, 1.1, 1.3, 2.0, 5.0, 20.0)
_SINGULAR_TOLERANCE = 1.03  # gamma over the lower bound of a singular problem that is not reported


def synthesise_singular(
    P: control.StateSpace,
    plant: Plant,
    *,
    nothing: Synthesis,
    wanted: tuple[float, float],
    n_steps: int,
) -> Synthesis:
    """Return the best controller of a singular problem, with a lower bound of the original
    problem.
    """
    found = _synthesise_between_circles(P, plant, nothing, wanted=wanted, n_steps=n_steps)
    late, n_tried = found.n_steps >= n_steps, nothing.n_steps + found.n_steps
    if not found.found:
        if late:
            why = ALL_STEPS_MADE
        else:
            why = "no level met the existence conditions, with any regularisation"
        return replace(nothing, n_steps=n_tried, reason=why)
    if found.gamma_min > KERNEL_TOLERANCE * found.gamma:
        low = min(found.gamma_min, found.gamma)
    else:
        low = 0.0
    reason = ""
    if found.gamma > _SINGULAR_TOLERANCE * low and found.gamma > wanted[0]:
        why = ALL_STEPS_MADE if late else "the problem is singular"
        if low > 0:
            known = f"no controller reaches less than {low:.4g}"
        else:
            known = "no lower bound was found"
        reason = f"{why}: gamma {found.gamma:.4g} was reached, {known}"
    return replace(found, level=low, gamma_min=low, n_steps=n_tried, reason=reason)


def _synthesise_between_circles(
    P: control.StateSpace,
    plant: Plant,
    nothing: Synthesis,
    *,
    wanted: tuple[float, float],
    n_steps: int,
) -> Synthesis:
    """Return the best controller by circles that close in on the axis, until it is close enough to
    the lower bound.

    The first one is K = 0, if that is stable. Until then gamma_min is the least level of the last
    problem tried.
    """
    enough, factor = wanted
    step, low = max(1.001, factor**0.5), unchangeable_gain(plant, _usual_points(plant))
    found = replace(nothing, level=LARGEST_GAMMA, gamma_min=low, n_steps=0)
    found = _keep_if_better(plant, close_stable_loop(P, nothing.K), found=found)
    for rung in (*_CIRCLE_RUNGS, _AXIS_RUNG) if plant.B2.shape[1] and plant.C2.shape[0] else ():
        is_near = found.found and found.gamma <= max(
            _NEAR_ENOUGH * factor * found.gamma_min, enough
        )
        if is_near or found.n_steps >= n_steps:
            break
        if rung in _COARSE_RUNGS and found.gamma <= _FAR_FROM_BOUND * found.gamma_min:
            continue
        for problem in _regular_outside(plant, *rung):
            found = _try_levels(P, plant, problem=problem, found=found, step=step, n_steps=n_steps)
        if found.found:
            found = _raise_lower_bound(P, plant, rung=rung, found=found, n_steps=n_steps)
    return found


def _circle_ends(plant: Plant, below: int, above: int) -> tuple[float, float]:
    """Return the real points of a circle: decades below the slowest pole and above the fastest."""
    if plant.A.size:
        speeds = np.abs(np.linalg.eigvals(plant.A))
    else:
        speeds = np.ones(1)
    speeds = speeds[speeds > 1e-9 * max(1.0, float(speeds.max()))]
    slow = float(min(speeds.min(initial=1.0), 1.0))
    if plant.A.size:
        fast = max(1.0, float(np.linalg.norm(plant.A, 2)))
    else:
        fast = 1.0
    return slow * 10.0**-below, _BEYOND_POLES * fast * 10.0**above


def _regular_outside(plant: Plant, below: int, above: int) -> list[Plant]:
    """Return the regular problems outside a disc in the left half plane, the hardest one first."""
    a, b = _circle_ends(plant, below, above)
    if (below, above) == _AXIS_RUNG:
        problem = plant
    else:
        problem = map_region(plant, -a, -b)
    if hidden_mode(problem):
        return []
    lacking: tuple[float, ...]
    if problem.region:
        lacking = (_REGULARISATIONS[0] * 10.0**-below, _REGULARISATIONS[1])
    else:
        lacking = (10.0**-below,)
    sizes = (0.0,) if all(has_full_ranks(problem)) else lacking
    regular = [normalise_plant(regularise_plant(problem, size)) for size in sizes]
    return [
        one
        for one in regular
        if one is not None
        and (one.region or not any(map(has_zero_on_axis, (one, dual_plant(one)))))
    ]


def _raise_lower_bound(
    P: control.StateSpace, plant: Plant, *, rung: tuple[int, int], found: Synthesis, n_steps: int
) -> Synthesis:
    """Raise the lower bound by the level that fails inside a disc in the right half plane."""
    problem = map_region(plant, *_circle_ends(plant, *rung))
    # a bound requires a safe rank: nearly dependent columns would make it false
    spread = [
        float(np.linalg.cond(D)) if full else np.inf
        for full, D in zip(has_full_ranks(problem), (problem.D12, problem.D21), strict=True)
    ]
    both = max(spread) < _MAX_CONDITIONS[0]
    # if rank is lacking on one side everywhere: the bound by the other side alone
    known = [
        _full_information_plant(side)
        for side, size in zip((problem, dual_plant(problem)), spread, strict=True)
        if size < _MAX_CONDITIONS[1]
    ]
    sides, test = (
        ([problem], partial(solve_riccati_pair, quick=True)) if both else (known, control_riccati)
    )
    for side in sides:
        regular, reached = normalise_plant(side), found.gamma * ROUNDING_FACTOR
        # a level that a controller reaches cannot fail: then the failure is rounding, and no bound
        # follows
        if regular is None or reached <= found.gamma_min or not test(regular, reached):
            continue
        ends = found.gamma_min, reached
        left = n_steps - found.n_steps
        low, _, n_tried = bisect_level(
            partial(test, regular), ends, tolerance=TOLERANCE, n_steps=left
        )
        if low > found.gamma_min and not any(
            test(regular, share * low) for share in _CHECKED_SHARES
        ):
            fails = partial(fails_in_digits, P, plant, circle=problem.region)
            confirmed = (
                share * low for share in (1.0, *_CHECKED_SHARES) if fails(share * low) is not False
            )
            found = replace(found, gamma_min=max(found.gamma_min, next(confirmed, 0.0)))
        found = replace(found, n_steps=found.n_steps + n_tried + 1 + len(_CHECKED_SHARES))
    return found


def _full_information_plant(plant: Plant) -> Plant:
    """Return the plant with w measured, in the form to normalise D12 alone."""
    n_w = plant.B1.shape[1]
    return replace(
        plant, C2=np.zeros((n_w, plant.A.shape[0])), D21=np.eye(n_w), out_of_y=np.eye(n_w)
    )


def _try_levels(
    P: control.StateSpace,
    plant: Plant,
    *,
    problem: Plant,
    found: Synthesis,
    step: float,
    n_steps: int,
) -> Synthesis:
    """Try the controllers slightly above the least level of a problem; return the best so far.

    Near the least level rounding may satisfy the equations without a controller: higher levels are
    tried until the loop itself keeps one.
    """
    test = partial(solve_riccati_pair, problem, quick=not problem.added)
    ends = (
        max(direct_term_bound(problem), found.gamma_min),
        found.level if test(found.level) else np.inf,
    )
    _, level, n_tried = bisect_level(
        test, ends, tolerance=TOLERANCE, n_steps=n_steps - found.n_steps
    )
    found = replace(found, n_steps=found.n_steps + n_tried + 1)
    if not np.isfinite(level):
        return found
    found = replace(found, level=level)

    def is_kept(gamma: float) -> bool:
        nonlocal found
        nobody = replace(found, gamma=np.inf, n_steps=found.n_steps + 1)
        reached = _keep_if_better(plant, controlled_loop(P, problem, gamma), found=nobody)
        better = reached if reached.gamma < found.gamma else found
        found = replace(better, gamma_min=reached.gamma_min, n_steps=reached.n_steps)
        return reached.gamma <= gamma * 1.001

    any(
        is_kept(gamma)
        for gamma in level * step * np.array(_SINGULAR_STEPS_UP)[: max(0, n_steps - found.n_steps)]
    )
    return found


def _keep_if_better(
    plant: Plant, loop: tuple[control.StateSpace, control.StateSpace] | None, *, found: Synthesis
) -> Synthesis:
    """Take a controller and its loop if it is better by the original norm, and the lower bound at
    its peak.
    """
    if loop:
        achieved, peak = norm_as_given(loop[1])
    else:
        achieved, peak = np.inf, np.nan
    if loop is None or achieved >= found.gamma:
        return found
    where = (np.tan(peak * plant.dt / 2) if plant.dt else peak) / plant.speed
    low = max(found.gamma_min, unchangeable_gain(plant, np.array([where])))
    return replace(found, K=loop[0], gamma=achieved, gamma_min=low)


def _usual_points(plant: Plant) -> np.ndarray:
    """Return frequencies of the scaled plant (W,): zero, infinity, those of its poles and some
    around them.
    """
    if plant.A.size:
        poles = np.linalg.eigvals(plant.A)
    else:
        poles = np.ones(1)
    around = np.geomspace(*_circle_ends(plant, 1, 1), 60)
    return np.unique(np.concatenate([[0.0, np.inf], around, np.abs(poles), np.abs(poles.imag)]))
