"""Stiff plants: a lower bound of gamma that is free of rounding, in multiple precision."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import control
import numpy as np

from robust.proofs.exact.claim import to_matrices
from robust.proofs.exact.synthesis_levels import level_fails
from robust.synthesis.hinf.generalised_plant import Plant
from robust.synthesis.hinf.riccati_pair import MOST_STEPS, bisect_level
from robust.synthesis.hinf.synthesis import Synthesis

_STIFF = 1e5  # largest number of A over the slowest pole, above which rounding made bounds false
NEAR_BOUND = 1.02  # times `factor`: beyond it other controllers are tried
TOLERANCE = 1e-3  # of the levels of a rung
# contradiction between a bound and a controller that is ignored; a larger one is rounding
ROUNDING_FACTOR = 1.003


def fails_in_digits(
    P: control.StateSpace, plant: Plant, level: float, *, circle: tuple[float, ...] = ()
) -> bool | None:
    """Return True if no controller reaches a level, in multiple precision; None if undecided, or P
    is not stiff.
    """
    if plant.A.size:
        speeds = np.abs(np.linalg.eigvals(plant.A))
    else:
        speeds = np.ones(1)
    slowest = speeds[speeds > 0].min(initial=np.inf)
    if not np.linalg.norm(plant.A) > _STIFF * slowest:
        return None
    ends = tuple(plant.speed * end for end in circle)
    return level_fails(to_matrices(P), plant.into_u, plant.out_of_y, level, circle=ends)


def settle_lower_bound(
    P: control.StateSpace, plant: Plant, *, found: Synthesis, factor: float
) -> Synthesis:
    """Return a synthesis whose lower bound is confirmed in multiple precision for a stiff P, and
    never above gamma.
    """
    low, reached = min(found.gamma_min, found.gamma), found.gamma * ROUNDING_FACTOR
    fails = partial(fails_in_digits, P, plant)
    # a level that was reached must not fail: otherwise the problem is singular, and no bound
    # follows
    if found.found and fails(reached) is False:
        if low and not fails(low):
            ends = 0.0, low
        else:
            ends = low, reached
        if ends[0] == 0 or found.gamma > NEAR_BOUND * factor * low:
            low = bisect_level(
                lambda level: not fails(level), ends, tolerance=TOLERANCE, n_steps=MOST_STEPS
            )[0]
    return replace(found, gamma_min=min(low, found.gamma))
