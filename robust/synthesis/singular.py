"""Singular H-infinity problems: zeros on the axis or at infinity, bounded from inside and reached from outside.

No Riccati equation has a solution where P12 or P21 loses rank on the axis or at infinity (no weight on u, an
integrating plant under disturbances at its output). The axis is therefore replaced by circles on either side of it:

    a disc in the right half plane     asks for less: its least norm is a lower bound of what was asked
    all but a disc in the left one     asks for more: its controllers are judged by the norm that was asked

Both are regular, both tend to the infimum as the circles tend to the axis (the bilinear transform of Chiang & Safonov
1992 is the second); where P12 or P21 lacks rank everywhere, small outputs of u and disturbances of y are added to the
second, which asks for more again.
"""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial

import control
import numpy as np

from nlfrf.shared.values import value
from robust.certificates.stability import instability
from robust.synthesis.central import LARGEST_GAMMA, bracket, central, control_equation, least_level, solved
from robust.synthesis.generalised_plant import (
    Plant,
    controller_of,
    dual,
    hidden_mode,
    in_region,
    normalised,
    ranks,
    regularised,
    zero_on_axis,
)
from robust.systems.lft import lower
from robust.systems.lti import along, evaluate, in_s, on_axis, timebase
from robust.systems.norms import hinf_norm

__all__ = ["Found", "between_circles", "fixed_gain"]


#: Decades between the circles and the slowest pole, and the fastest.
RUNGS = ((1, 2), (1, 1), (1, 3), (1, 4), (2, 3), (3, 4), (4, 5), (0, 0))
ADDED = (1e-2, 1e-6)  # where rank is lacking everywhere, relative to the scaled plant: a decade less a rung, and least
WITHOUT_CIRCLE = 1e-4  # added where the axis is kept: the last resort
COARSE = (1, 1), (0, 0)  # of these: where finer ones found nothing near the bound
NOT_NEAR = 1.1
ENOUGH = 1.005  # beside `factor`: how near the lower bound is near enough
DISTINCT = (1e6, 1e4)  # condition of D12 and D21 up to which bounds are drawn from both, from one alone
TOLERANCE = 1e-3  # to which the levels of a rung are found
TRUSTED = 1.003  # a bound may contradict a controller by this before rounding is blamed
SHARES = (0.98, 0.9, 0.7, 0.4)  # of a level that fails: they must fail too, or rounding has the word
STEPS_UP = (1.0, 1.02, 1.1, 1.3)


@value
class Found:
    """What the circles gave so far.

    Fields
    ------
    K : control.StateSpace or None
    gamma : float
        Norm of the problem that was asked with K; inf without one.
    low : float
        No controller reaches less, by the discs inside; 0 where they say nothing.
    level : float
        Least level of the last problem tried.
    size, tried : float
        Distance of the circle from the axis relative to the slowest pole: K is of, and at the moment.
    n_steps : int
        Levels tried.
    late : bool
        Whether time ran out.
    """

    K: control.StateSpace | None = None
    gamma: float = np.inf
    low: float = 0.0
    level: float = LARGEST_GAMMA
    size: float = 0.0
    tried: float = 0.0
    n_steps: int = 0
    late: bool = False


def between_circles(P: control.StateSpace, plant: Plant, enough: float, factor: float, deadline: float) -> Found:
    """The best controller by circles that close in on the axis, until it is within `factor` of the lower bound."""
    found, step = Found(), max(1.001, factor**0.5)
    for rung in RUNGS:
        if rung in COARSE and found.gamma <= NOT_NEAR * found.low:
            continue
        for problem in outside(plant, *rung):
            found = judged(P, problem, replace(found, tried=10.0 ** -rung[0]), step, deadline)
        if found.K is not None:
            found = replace(found, low=max(found.low, fixed_gain(P, found.K)))
            found = bounded(plant, rung, found, deadline)
        if found.gamma <= max(ENOUGH * factor * found.low, enough) or time.monotonic() > deadline:
            return replace(found, late=time.monotonic() > deadline)
    last = normalised(regularised(plant, WITHOUT_CIRCLE))
    if last is not None and not (zero_on_axis(last) or zero_on_axis(dual(last))):
        found = judged(P, last, replace(found, tried=WITHOUT_CIRCLE), step, deadline)
    return replace(found, late=time.monotonic() > deadline)


def circle(plant: Plant, below: int, above: int) -> tuple[float, float]:
    """Where a circle crosses the real axis: decades below the slowest pole and above the fastest."""
    speeds = np.abs(np.linalg.eigvals(plant.A)) if plant.A.size else np.ones(1)
    speeds = speeds[speeds > 1e-9 * max(1.0, float(speeds.max()))]
    slow = float(min(speeds.min(initial=1.0), 1.0))
    fast = max(1.0, float(np.linalg.norm(plant.A, 2))) if plant.A.size else 1.0
    return slow * 10.0**-below, fast * 10.0**above


def outside(plant: Plant, below: int, above: int) -> list[Plant]:
    """What is asked for outside of a disc in the left half plane, made regular, the hardest first."""
    a, b = circle(plant, below, above)
    problem = in_region(plant, -a, -b)
    if hidden_mode(problem):
        return []
    sizes = (0.0,) if all(ranks(problem)) else (ADDED[0] * 10.0**-below, ADDED[1])
    regular = (normalised(regularised(problem, size)) for size in sizes)
    return [one for one in regular if one is not None]


def bounded(plant: Plant, rung: tuple[int, int], found: Found, deadline: float) -> Found:
    """With the level that fails inside a disc in the right half plane, which no controller reaches."""
    problem = in_region(plant, *circle(plant, *rung))
    # a bound is only as good as the rank: columns that nearly depend on one another would make it a false one
    spread = [
        float(np.linalg.cond(D)) if full else np.inf
        for full, D in zip(ranks(problem), (problem.D12, problem.D21), strict=True)
    ]
    both = max(spread) < DISTINCT[0]
    # where rank is lacking on one side everywhere, what the other side alone leaves
    known = [all_known(side) for side, size in zip((problem, dual(problem)), spread, strict=True) if size < DISTINCT[1]]
    sides, test = ([problem], partial(solved, quick=True)) if both else (known, control_equation)
    for side in sides:
        regular, reached = normalised(side), found.gamma * TRUSTED
        # a level that a controller reaches cannot fail: then rounding has the word, and nothing is learnt
        if regular is None or reached <= found.low or not test(regular, reached):
            continue
        ends = found.low, reached
        low, _, n_steps = bracket(partial(test, regular), ends, TOLERANCE, deadline)
        if low > found.low and not any(test(regular, share * low) for share in SHARES):
            found = replace(found, low=low)
        found = replace(found, n_steps=found.n_steps + n_steps + 1 + len(SHARES))
    return found


def all_known(plant: Plant) -> Plant:
    """The plant with w measured, as it has to be put to normalise D12 alone."""
    n_w = plant.B1.shape[1]
    return replace(
        plant, C2=np.zeros((n_w, plant.A.shape[0])), D21=np.eye(n_w), D22_region=np.zeros((n_w, plant.B2.shape[1]))
    )


def judged(P: control.StateSpace, problem: Plant, found: Found, step: float, deadline: float) -> Found:
    """With the controller a little above the least level of a problem if it is better, by the norm that was asked."""
    test = partial(solved, problem, quick=not problem.added)
    ends = max(least_level(problem), found.low), found.level if test(found.level) else np.inf
    _, level, n_steps = bracket(test, ends, TOLERANCE, deadline)
    found = replace(found, n_steps=found.n_steps + n_steps + 1)
    if not np.isfinite(level):
        return found
    found = replace(found, level=level)
    for gamma in level * step * np.array(STEPS_UP):
        try:
            solution = solved(problem, gamma)
            K = (
                controller_of(problem, central(problem, solution, rolled_off=bool(problem.region)))
                if solution
                else None
            )
            closed = lower(P, K) if K else None
        except (ValueError, np.linalg.LinAlgError):
            continue
        if K is None or closed is None or not instability(closed).stable:
            continue
        achieved = norm_as_given(closed)
        if achieved < found.gamma:
            found = replace(found, K=K, gamma=achieved, size=found.tried)
        if achieved <= gamma * 1.001 or time.monotonic() > deadline:
            break
    return found


def norm_as_given(closed: control.StateSpace) -> float:
    """The norm, and at least what evaluation finds in the coordinates of the loop as they are."""
    poles = in_s(np.linalg.eigvals(closed.A), timebase(closed)) if closed.nstates else np.zeros(0)
    near = np.concatenate([np.abs(poles.imag), np.abs(poles)])
    omega = np.unique(near[:, None] * (1 + np.linspace(-0.03, 0.03, 31)))
    if timebase(closed):
        omega = omega[omega <= np.pi / timebase(closed)]
    gains = np.linalg.svd(np.moveaxis(along(closed, omega), 2, 0), compute_uv=False)
    return max(hinf_norm(closed)[0], float(gains.max(initial=0.0)))


def fixed_gain(P: control.StateSpace, K: control.StateSpace) -> float:
    """What no controller changes where P12 or P21 loses rank: at infinity, and at poles of the plant on the axis.

    At such a point T = T1 + T2 Q T3, and v' T is the same for all Q where v' T2 = 0; so is T v where T3 v = 0.
    """
    n_u, n_y, dt = K.noutputs, K.ninputs, timebase(P)
    w, z = P.ninputs - n_u, P.noutputs - n_y
    B, C, D = (
        np.hstack([P.B, P.B[:, w:]]),
        np.vstack([P.C, P.C[z:]]),
        np.block([[P.D, P.D[:, w:]], [P.D[z:], P.D[z:, w:]]]),
    )
    closed = lower(control.StateSpace(P.A, B, C, D, P.dt), K)  # (w, beside u) -> (z, y)
    poles = np.linalg.eigvals(P.A) if P.nstates else np.zeros(0)
    size = max(1.0, float(np.abs(poles).max(initial=0.0)))
    off = np.abs(np.abs(poles) - 1) if dt else np.abs(poles.real)
    on = poles[(off < 1e-9 * size) & (poles.imag >= 0)]
    points = np.concatenate([np.exp(1j * np.angle(on)) if dt else 1j * on.imag, [-1.0 if dt else np.inf]])
    usual = evaluate(
        closed.A, closed.B, closed.C, closed.D, on_axis(np.geomspace(1e-2, 1, 20) * (np.pi / dt if dt else size), dt)
    )
    values = evaluate(closed.A, closed.B, closed.C, closed.D, points)
    gains = [0.0]
    for T in values:
        for M, typical in ((T, usual), (T.T, np.swapaxes(usual, 1, 2))):
            rows, cols = (z, w) if M is T else (w, z)
            reach, typical_reach = M[:rows, cols:], np.linalg.norm(typical[:, :rows, cols:], axis=(1, 2)).max()
            U, sizes, _ = np.linalg.svd(reach)
            free = U[:, np.concatenate([sizes, np.zeros(rows - sizes.size)]) < 1e-9 * typical_reach]
            if free.shape[1]:
                gains.append(float(np.linalg.norm(free.conj().T @ M[:rows, :cols], 2)))
    return max(gains)
