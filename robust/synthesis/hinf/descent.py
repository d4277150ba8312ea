"""Scalings of D-K iteration, improved along the gradient of the least norm over all controllers.

D-K iteration alternates between synthesis and scalings. Its steps become small even if the norm
would decrease by a change of both together. The least norm over all controllers is a function of
the scalings alone. It is lowered by quasi-Newton steps (BFGS) in the logarithms of their gains and
of the frequencies and dampings of their zeros and poles, with difference quotients.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import control
import numpy as np

from robust.lti.lti import timebase
from robust.lti.norms import continuous_image
from robust.lti.realisation import from_roots
from robust.models.fit.rational import map_to_model_plane
from robust.models.fit.refinement import section_logarithms, zeros_and_poles
from robust.synthesis.hinf.generalised_plant import (
    dual_plant,
    has_zero_on_axis,
    normalise_plant,
    prepare_plant,
)
from robust.synthesis.hinf.riccati_pair import solve_riccati_pair

_STEP = 1e-4  # step of a logarithm for the difference quotient
_FIRST_STEP = 0.1  # norm of the first step in the logarithms, before the curvature is known
_SHORTENINGS = 8  # reductions of a step, to a third each time
_EQUAL = 0.05  # largest difference of the logarithms of scalings that are kept equal
_NEAR, _FAR, _LEVEL_TOLERANCE = 1e-3, 10.0, 1e-9  # widths of the bracket of a level, relative to it


def descend(
    least_norm: Callable[[list[control.StateSpace]], float], scaling: list[control.StateSpace]
) -> Iterator[list[control.StateSpace]]:
    """Yield better scalings, one set for each step, until no step is better.

    least_norm : function of the scalings without the last one (of the performance, which stays
    one).
    """
    dt = timebase(scaling[0])
    groups = _equal_scalings(scaling)
    shapes = [_sections_of(scaling[group[0]]) for group in groups]
    x = np.concatenate([part for part, _ in shapes])
    if not np.isfinite(x).all():
        return
    ends = np.cumsum([0, *(part.size for part, _ in shapes)])

    def scalings(x: np.ndarray) -> list[control.StateSpace]:
        found = list(scaling)
        for group, (_, n), start, end in zip(groups, shapes, ends, ends[1:], strict=False):
            for k in group:
                found[k] = _system_of_sections(x[start:end], n, dt)
        return found

    def norm(x: np.ndarray) -> float:
        return least_norm(scalings(x))

    now, slope, moved, inverse = norm(x), np.zeros(0), np.zeros(0), np.zeros((0, 0))
    while np.isfinite(now):
        before = slope
        slope = np.array([norm(x + _STEP * unit) - now for unit in np.eye(x.size)]) / _STEP
        if not np.isfinite(slope).all() or not slope.any():
            return
        if not before.size:
            inverse = _FIRST_STEP / np.linalg.norm(slope) * np.eye(x.size)
        else:
            inverse = _updated_inverse(inverse, moved, slope - before)
        step = -inverse @ slope
        for _ in range(_SHORTENINGS):
            reached = norm(x + step)
            if reached < now + 0.1 * (slope @ step):
                break
            step = step / 3
        else:
            return
        moved, x, now = step, x + step, reached
        yield scalings(x)


def least_level(P: control.StateSpace, n_y: int, n_u: int, near: float) -> float:
    """Return the least norm of a controller for a regular problem, searched from near it; inf for a
    singular one.
    """
    plant = normalise_plant(prepare_plant(P, n_y, n_u))
    if plant is None or any(map(has_zero_on_axis, (plant, dual_plant(plant)))):
        return np.inf
    width, low, high = _NEAR, near * (1 - _NEAR), near * (1 + _NEAR)
    while solve_riccati_pair(plant, high, quick=True) is None:
        low, width = high, 4 * width
        high *= 1 + width
        if width > _FAR:
            return np.inf
    while low > 0 and solve_riccati_pair(plant, low, quick=True) is not None:
        high, width = low, 4 * width
        low = max(low * (1 - width), 0.0)
    while high - low > _LEVEL_TOLERANCE * high:
        middle = (low + high) / 2
        if solve_riccati_pair(plant, middle, quick=True) is None:
            low, high = middle, high
        else:
            low, high = low, middle
    return high


def _updated_inverse(inverse: np.ndarray, moved: np.ndarray, change: np.ndarray) -> np.ndarray:
    """Return the inverse Hessian of BFGS after a step and the change of the gradient, if the step
    is usable.
    """
    along = float(moved @ change)
    if not along > 1e-10 * np.linalg.norm(moved) * np.linalg.norm(change):
        return inverse
    left = np.eye(moved.size) - np.outer(moved, change) / along
    return np.asarray(left @ inverse @ left.T + np.outer(moved, moved) / along)


def _equal_scalings(scaling: list[control.StateSpace]) -> list[list[int]]:
    """Return groups of blocks with nearly the same scaling, as from fits of the same data; without
    the last block.
    """
    dt = timebase(scaling[0])
    x = 1j * np.geomspace(1e-6, 1e6, 200)
    if dt:
        points = (1 + x) / (1 - x)
    else:
        points = x
    sizes = [np.log(np.abs([one(point) for point in points])).ravel() for one in scaling[:-1]]
    groups: list[list[int]] = []
    for k, size in enumerate(sizes):
        same = [group for group in groups if np.abs(sizes[group[0]] - size).max() < _EQUAL]
        if same:
            same[0].append(k)
        else:
            groups.append([k])
    return groups


def _sections_of(system: control.StateSpace) -> tuple[np.ndarray, int]:
    """Return the parameters of a stable minimum-phase system (log gain, zeros, poles) and its
    order.
    """
    A, B, C, D = continuous_image(system)
    zeros, poles = np.linalg.eigvals(A - B @ np.linalg.solve(D, C)), np.linalg.eigvals(A)
    parts = [np.log(np.abs(D[0])), section_logarithms(zeros), section_logarithms(poles)]
    return np.concatenate(parts), len(A)


def _system_of_sections(parameters: np.ndarray, order: int, dt: float) -> control.StateSpace:
    roots = zeros_and_poles(parameters[1:], order)
    return from_roots(
        *map_to_model_plane(*roots, float(np.exp(parameters[0])), 2.0 if dt else 0.0, 0), dt
    )
