"""H-infinity synthesis: the output-feedback controller of least closed-loop norm, from two Riccati
equations.

The existence conditions decide in the bisection on gamma. The result is judged by its closed loop.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import control
import numpy as np
from scipy.linalg import cholesky

from nlfrf._base.arguments import (
    require_integer,
    require_nonnegative,
    require_positive,
    require_real,
)
from nlfrf._base.values import value
from robust._base.types import LinearSystem
from robust.lti.connections import lower_lft
from robust.lti.lti import Matrices, response_by_channel, timebase, to_s_plane
from robust.lti.norms import continuous_image, hinf_norm, stabilising_riccati, well_conditioned_with
from robust.lti.realisation import multivariable
from robust.proofs.exact.claim import to_matrices
from robust.proofs.exact.synthesis_levels import level_fails
from robust.proofs.search.certificate import Certificate
from robust.proofs.search.stability import certify_closed_loop, decide_stability
from robust.synthesis.hinf.design import Unpacked, describe_controller
from robust.synthesis.hinf.generalised_plant import (
    Plant,
    dual_plant,
    has_full_ranks,
    has_zero_on_axis,
    hidden_mode,
    map_region,
    normalise_plant,
    prepare_plant,
    regularise_plant,
    restore_controller,
)

# ---- The two Riccati equations of H-infinity control at one level gamma: their solvability, and
# the central controller.

_LARGEST_GAMMA = 1e10
# largest change of A over its size by the substituted control: more means a nearly singular D12
_MAX_CHANGE_OF_A = 100.0


@value(copy=False)
class _Solution:
    """X and Y of a level, with the gains F (for all inputs) and H (for all outputs)."""

    gamma: float
    X: np.ndarray
    Y: np.ndarray
    F: np.ndarray
    H: np.ndarray


def _direct_term_bound(plant: Plant) -> float:
    """Return the lower bound of gamma by the direct term alone."""
    return max(_uncontrolled_direct_term(plant), _uncontrolled_direct_term(dual_plant(plant)))


def _uncontrolled_direct_term(plant: Plant) -> float:
    """Return the norm of the direct term in outputs that u does not reach."""
    upper = plant.D11[: plant.D11.shape[0] - plant.B2.shape[1]]
    if upper.size:
        return float(np.linalg.norm(upper, 2))
    return 0.0


def solve_riccati_pair(plant: Plant, gamma: float, *, quick: bool = False) -> _Solution | None:
    """Return X and Y if the level can be reached: stabilising, semidefinite, with spectral radius
    below gamma^2.
    """
    if gamma <= _direct_term_bound(plant) * (1 + 1e-9):
        return None
    control = control_riccati(plant, gamma, quick=quick)
    if control is None:
        return None
    filtering = control_riccati(dual_plant(plant), gamma, quick=quick)
    if (
        filtering is None
        or np.max(np.linalg.eigvals(control[0] @ filtering[0]).real, initial=0.0) >= gamma**2
    ):
        return None
    return _Solution(gamma=gamma, X=control[0], Y=filtering[0], F=control[1], H=filtering[1].T)


def control_riccati(
    plant: Plant, gamma: float, *, quick: bool = False
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return X and F of a level for known states and w; for the dual plant Y and H'.

    Only D12 must be [0; I].

    A level that is impossible with x and w known is impossible with y too: if there is no X, the
    level is a lower bound. The outputs that u reaches replace the control if that changes little:
    cross terms that would cancel in rounding then do not arise, and if y contains all of w, Y is
    zero to the last bit.
    """
    if gamma <= _uncontrolled_direct_term(plant) * (1 + 1e-9):
        return None
    n_w, n_u = plant.B1.shape[1], plant.B2.shape[1]
    free = plant.C1.shape[0] - n_u
    A, B1, C1, D11 = plant.A, plant.B1, plant.C1, plant.D11
    C_u, D_u = C1[free:], D11[free:]
    instead = bool(np.linalg.norm(plant.B2 @ C_u) < _MAX_CHANGE_OF_A * np.linalg.norm(A))
    if instead:
        A, B1 = A - plant.B2 @ C_u, B1 - plant.B2 @ D_u
        C1, D11 = (np.vstack([rows[:free], np.zeros_like(rows[free:])]) for rows in (C1, D11))
    B, D = np.hstack([B1, plant.B2]), np.hstack([D11, plant.D12])
    R = D.T @ D - np.diag(np.r_[np.full(n_w, gamma**2), np.zeros(n_u)])
    X = stabilising_riccati(A, B, Q=C1.T @ C1, R=R, S=C1.T @ D, quick=quick)
    if X is None:
        return None
    F = -np.linalg.solve(R, D.T @ C1 + B.T @ X)
    if instead:
        F[n_w:] -= C_u + D_u @ F[:n_w]
    return X, F


def _central_controller(plant: Plant, at: _Solution, *, rolled_off: bool = False) -> Matrices:
    """Return the central controller of a level, or that of least direct term (Zhou et al.

    1996, Theorem 17.1).

    All controllers of the level are F_l(M, Q) with |Q| < gamma; the central one has Q = 0. In a
    one-block problem the central one makes the whole direct term of the loop zero, at times with a
    K that is infinite there.
    """
    (n_z, n_w), n_u, n_y = plant.D11.shape, plant.B2.shape[1], plant.C2.shape[0]
    g2 = at.gamma**2
    D = plant.D11
    D1111, D1112 = D[: n_z - n_u, : n_w - n_y], D[: n_z - n_u, n_w - n_y :]
    D1121, D1122 = D[n_z - n_u :, : n_w - n_y], D[n_z - n_u :, n_w - n_y :]
    inner = g2 * np.eye(n_w - n_y) - D1111.T @ D1111
    outer = g2 * np.eye(n_z - n_u) - D1111 @ D1111.T
    D_hat = -D1121 @ D1111.T @ np.linalg.solve(outer, D1112) - D1122
    left = cholesky(np.eye(n_u) - D1121 @ np.linalg.solve(inner, D1121.T), lower=True)
    right = cholesky(np.eye(n_y) - D1112.T @ np.linalg.solve(outer, D1112))
    if rolled_off:
        Q = -np.linalg.solve(left, np.linalg.solve(right.T, D_hat.T).T)
        D_hat = D_hat + left @ Q @ right * min(
            1.0, 0.9 * at.gamma / max(float(np.linalg.norm(Q, 2)), 1e-300)
        )
    F1, F2 = at.F[n_w - n_y : n_w], at.F[n_w:]
    H1, H2 = at.H[:, n_z - n_u : n_z], at.H[:, n_z:]
    Z = np.linalg.inv(np.eye(plant.A.shape[0]) - at.Y @ at.X / g2)
    B_hat = Z @ (plant.B2 + H1) @ left
    C_hat = -right @ (plant.C2 + F1)
    B_K = -Z @ H2 + B_hat @ np.linalg.solve(left, D_hat)
    C_K = F2 + D_hat @ np.linalg.solve(right, C_hat)
    A_K = plant.A + np.hstack([plant.B1, plant.B2]) @ at.F + B_K @ np.linalg.solve(right, C_hat)
    return A_K, B_K, C_K, D_hat


def _bisect_level(
    holds: Callable[[float], object],
    ends: tuple[float, float],
    *,
    tolerance: float,
    n_steps: int,
    enough: float = 0.0,
) -> tuple[float, float, int]:
    """Return the largest level that fails, the smallest that holds (inf: none), and the number of
    levels tried.
    """
    low, high = ends
    n_tried, gamma = 0, max(1.0, 2 * low) if np.isinf(high) else high / 2
    while n_tried < n_steps:
        if high <= max(low, enough) * (1 + tolerance) or low > _LARGEST_GAMMA or high < 1e-9:
            break
        if np.isfinite(high):
            floor = max(low, enough)
            # far from both ends go down by decades; near, halve
            if floor < high / 64:
                gamma = high / 8
            else:
                gamma = float(np.sqrt(floor * high))
        elif n_tried:
            gamma = low * 4
        n_tried += 1
        if holds(gamma):
            high = gamma
        else:
            low = gamma
    return low, high, n_tried


# ---- Singular H-infinity problems: zeros on the axis or at infinity, bounded from inside and
# reached from outside.
#
# No Riccati equation has a solution where P12 or P21 loses rank on the axis or at infinity (no
# weight on u, an integrating plant under disturbances at its output). The axis is therefore
# replaced by circles on either side of it:
#
#     a disc in the right half plane     requires less: its least norm is a lower bound of the
#     original one
#     all but a disc in the left one     requires more: its controllers are judged by the original
#     norm
#
# Both are regular, both tend to the infimum as the circles tend to the axis (the bilinear transform
# of Chiang & Safonov 1992 is the second); where P12 or P21 lacks rank everywhere, small outputs of
# u and disturbances of y are added to the second problem, which then requires more again.

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
# rounding for rows of length one; gamma below it counts as a lower bound of zero
_KERNEL_TOLERANCE = 1e-13
# distance of a pole from its frequency on the axis, for the scaled plant (mean pole one)
_ON_AXIS = 1e-9
_ANY_POINT = 1.2345  # in scaled time: a generic point, where no plant has a zero except by chance
_BEYOND_POLES = 1.5  # factor that keeps poles away from the crossing of a circle
_COARSE_RUNGS = (1, 1), (0, 0)  # coarse circles, used if finer ones find nothing near the bound
_FAR_FROM_BOUND = 1.1
_NEAR_ENOUGH = 1.005  # times `factor`: sufficient distance to the lower bound
_MAX_CONDITIONS = (1e6, 1e4)  # condition of D12 and D21 up to which bounds use both, or one alone
_TOLERANCE = 1e-3  # of the levels of a rung
# contradiction between a bound and a controller that is ignored; a larger one is rounding
_ROUNDING_FACTOR = 1.003
_CHECKED_SHARES = (
    0.98,
    0.9,
    0.7,
    0.4,
)  # of a level that fails: these must fail too, otherwise it is rounding
#: Factors over the least level, dense at first: by rounding a loop may be unstable at one and
#: stable at the next.
_SINGULAR_STEPS_UP = (1.0, 1.003, 1.006, 1.01, 1.02, 1.05, 1.1, 1.3, 2.0, 5.0, 20.0)


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
    found = replace(nothing, level=_LARGEST_GAMMA, gamma_min=low, n_steps=0)
    found = _keep_if_better(plant, _close_stable_loop(P, nothing.K), found=found)
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
    lacking = (
        (_REGULARISATIONS[0] * 10.0**-below, _REGULARISATIONS[1])
        if problem.region
        else (10.0**-below,)
    )
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
        regular, reached = normalise_plant(side), found.gamma * _ROUNDING_FACTOR
        # a level that a controller reaches cannot fail: then the failure is rounding, and no bound
        # follows
        if regular is None or reached <= found.gamma_min or not test(regular, reached):
            continue
        ends = found.gamma_min, reached
        left = n_steps - found.n_steps
        low, _, n_tried = _bisect_level(
            partial(test, regular), ends, tolerance=_TOLERANCE, n_steps=left
        )
        if low > found.gamma_min and not any(
            test(regular, share * low) for share in _CHECKED_SHARES
        ):
            fails = partial(_fails_in_digits, P, plant, circle=problem.region)
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
        max(_direct_term_bound(problem), found.gamma_min),
        found.level if test(found.level) else np.inf,
    )
    _, level, n_tried = _bisect_level(
        test, ends, tolerance=_TOLERANCE, n_steps=n_steps - found.n_steps
    )
    found = replace(found, n_steps=found.n_steps + n_tried + 1)
    if not np.isfinite(level):
        return found
    found = replace(found, level=level)

    def is_kept(gamma: float) -> bool:
        nonlocal found
        nobody = replace(found, gamma=np.inf, n_steps=found.n_steps + 1)
        reached = _keep_if_better(plant, _controlled_loop(P, problem, gamma), found=nobody)
        better = reached if reached.gamma < found.gamma else found
        found = replace(better, gamma_min=reached.gamma_min, n_steps=reached.n_steps)
        return reached.gamma <= gamma * 1.001

    any(
        is_kept(gamma)
        for gamma in level * step * np.array(_SINGULAR_STEPS_UP)[: max(0, n_steps - found.n_steps)]
    )
    return found


def _controlled_loop(
    P: control.StateSpace, problem: Plant, gamma: float
) -> tuple[control.StateSpace, control.StateSpace] | None:
    """Return the controller of a level for a regular problem and the loop of P with it; None if
    that is not stable.
    """
    solution = solve_riccati_pair(problem, gamma)
    if solution is None:
        return None
    try:
        matrices = _central_controller(problem, solution, rolled_off=bool(problem.region))
        return _close_stable_loop(P, restore_controller(problem, matrices))
    except (ValueError, np.linalg.LinAlgError):
        return None


def _close_stable_loop(
    P: control.StateSpace, K: control.StateSpace
) -> tuple[control.StateSpace, control.StateSpace] | None:
    """Return a controller and the loop of P with it; None if that is not stable."""
    closed = lower_lft(P, K)
    if decide_stability(closed).stable:
        return K, closed
    return None


def _keep_if_better(
    plant: Plant, loop: tuple[control.StateSpace, control.StateSpace] | None, *, found: Synthesis
) -> Synthesis:
    """Take a controller and its loop if it is better by the original norm, and the lower bound at
    its peak.
    """
    if loop:
        achieved, peak = _norm_as_given(loop[1])
    else:
        achieved, peak = np.inf, np.nan
    if loop is None or achieved >= found.gamma:
        return found
    where = (np.tan(peak * plant.dt / 2) if plant.dt else peak) / plant.speed
    low = max(found.gamma_min, unchangeable_gain(plant, np.array([where])))
    return replace(found, K=loop[0], gamma=achieved, gamma_min=low)


def _norm_as_given(closed: control.StateSpace) -> tuple[float, float]:
    """Return the norm, at least its value on a grid in the original coordinates of the loop, and
    its peak frequency.
    """
    if closed.nstates:
        poles = to_s_plane(np.linalg.eigvals(closed.A), timebase(closed))
    else:
        poles = np.zeros(0)
    near = np.concatenate([np.abs(poles.imag), np.abs(poles)])
    omega = np.unique(near[:, None] * (1 + np.linspace(-0.03, 0.03, 31)))
    if timebase(closed):
        omega = omega[omega <= np.pi / timebase(closed)]
    gains = np.linalg.svd(np.moveaxis(response_by_channel(closed, omega), 2, 0), compute_uv=False)
    found = hinf_norm(closed)
    if omega.size:
        return max(found, (float(gains.max()), float(omega[gains[:, 0].argmax()])))
    return found


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


def unchangeable_gain(plant: Plant, omega: np.ndarray) -> float:
    """Return the largest gain that no controller changes, at frequencies (W,) of the scaled plant.

    If (A - s) x + B1 w = 0 and C2 x + D21 w = 0, y and u stay zero for any K, and z = C1 x + D11 w.
    Such w exist at every frequency if P21 has fewer independent rows than columns, otherwise where
    it loses rank: especially at poles of the plant on the axis and at infinity. The same holds for
    the transposed plant.
    """
    return max(unmeasured_gain(side, omega) for side in (plant, dual_plant(plant)))


def unmeasured_gain(plant: Plant, omega: np.ndarray) -> float:
    """Return `unchangeable_gain` for disturbances that do not show in y."""
    if plant.A.size:
        poles = np.linalg.eigvals(plant.A)
    else:
        poles = np.zeros(0)
    everywhere = _unmeasured_space(plant, _ANY_POINT, 0).shape[1]
    gains = [0.0]
    for w in omega:
        is_special = w in (0, np.inf) or np.any(np.abs(poles - 1j * w) < _ON_AXIS)
        kernel = _unmeasured_space(
            plant, 1j * w if np.isfinite(w) else w, 0 if is_special else everywhere
        )
        n = len(kernel) - plant.B1.shape[1]
        z = np.hstack([plant.C1, plant.D11])[:, -len(kernel) :] @ kernel
        gains += [float(np.linalg.norm(z @ np.linalg.pinv(kernel[n:]), 2))] if kernel.size else []
    return max(gains)


def _unmeasured_space(plant: Plant, s: complex, dimension: int) -> np.ndarray:
    """Return states and disturbances (n + n_w, k), at infinity disturbances alone, with y = u = 0
    at s.

    `dimension` is the known dimension, or 0 for the directions that are zero to rounding.
    """
    n = plant.A.shape[0]
    if np.isfinite(s):
        pencil = np.block([[plant.A - s * np.eye(n), plant.B1], [plant.C2, plant.D21]])
    else:
        pencil = plant.D21
    rows = np.linalg.norm(pencil, axis=1, keepdims=True)
    _, sizes, V = np.linalg.svd(pencil / np.where(rows > 0, rows, 1.0))
    rank = len(V) - dimension if dimension else np.count_nonzero(sizes > _KERNEL_TOLERANCE)
    return V[rank:].conj().T


MOST_STEPS = 1000  # levels: the hardest of 54 published problems takes a third of them
_ALL_STEPS_MADE = "all levels that n_steps allows were tried"
_SINGULAR_TOLERANCE = 1.03  # gamma over the lower bound of a singular problem that is not reported
_STEPS_UP = (1.0, 1.01, 1.03, 1.1, 1.3, 2.0, 5.0)


@value
class Synthesis(Unpacked):
    """A controller from `hinfsyn`, the norm it achieves, and a lower bound for all controllers.

    Unpacks as K, CL, gamma, info = hinfsyn(P, n_y, n_u).

    Fields
    ------
    K : control.StateSpace
        Controller u = K y (n_u outputs, n_y inputs), with positive feedback as usual for a
        generalised plant; zero if none was found.
    gamma : float
        Norm of F_l(P, K), recomputed from the closed loop; inf if the loop is not stable. If
        `certificate` holds, the norm is proved to be below gamma. Otherwise gamma is only computed,
        and `reason` states this.
    gamma_min : float
        Lower bound of gamma over all controllers: the largest gamma at which the existence
        conditions fail. They are evaluated in multiple precision if the poles are decades apart. 0
        if no lower bound is known.
    level : float
        Least gamma at which the existence conditions hold; for a singular problem gamma_min.
    n_steps : int
        Number of values of gamma that were tried.
    reason : str
        Reason why no controller or only a worse one than requested was found, or why gamma is not
        certified; otherwise empty.
    certificate : Certificate or None
        The proof of gamma for P and K as given, or the reason why there is no proof. None if no
        controller was found.
    CL : control.StateSpace or None
        F_l(P, K) from w to z; None if no controller was found.

    References
    ----------
    Doyle, Glover, Khargonekar & Francis 1989.

    Examples
    --------
    >>> P = control.StateSpace([[-1.0]], [[1.0, 1.0]], [[1.0], [0.0], [1.0]], [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0]])
    >>> found = hinfsyn(P, 1, 1)
    >>> bool(found.gamma_min <= found.level <= found.gamma < np.inf), found.reason
    (True, '')
    >>> print(found)
    controller of order 1, continuous, u = K y: gamma 0.71 proved, at best 0.7071
    """

    K: control.StateSpace
    gamma: float
    gamma_min: float
    level: float
    n_steps: int
    reason: str
    certificate: Certificate | None = None
    CL: control.StateSpace | None = None

    @property
    def certified(self) -> bool:
        """True if gamma is proved to be a bound on the norm."""
        return self.certificate is not None and self.certificate.holds

    @property
    def found(self) -> bool:
        """True if K stabilises the loop by more than rounding errors."""
        return bool(np.isfinite(self.gamma))

    def __str__(self) -> str:
        best = f"at best {self.gamma_min:.4g}"
        if not self.found:
            return f"no controller found, {best}: {self.reason}"
        proved = "proved" if self.certified else "computed, not proved"
        text = f"{describe_controller(self.K)}, u = K y: gamma {self.gamma:.4g} {proved}, {best}"
        return "\n  ".join(filter(None, (text, self.reason)))


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
    found = _settle_lower_bound(P, plant, found=found, factor=factor)
    if _is_far_from_bound(found, wanted) and found.n_steps < n_steps:
        others = _controllers_by_other_means(
            P, plant, wanted=wanted, n_steps=n_steps - found.n_steps
        )
        for loop in (_close_stable_loop(P, K) for K in others):
            if loop:
                achieved = _norm_as_given(loop[1])[0]
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
    return _synthesise_singular(
        P, plant, nothing=best, wanted=wanted_singular, n_steps=n_steps - best.n_steps
    )


# ---- Stiff plants: a lower bound that is free of rounding, and controllers by other methods.

_STIFF = 1e5  # largest number of A over the slowest pole, above which rounding made bounds false
_NEAR_BOUND = 1.02  # times `factor`: beyond it other controllers are tried
_STATIC_SIZES = np.geomspace(
    1e-3, 1e3, 13
)  # sizes of a static controller, times the inverse of the gain from u to y


def _is_far_from_bound(found: Synthesis, wanted: tuple[float, float, float]) -> bool:
    """Return True if a controller is neither close to the lower bound nor at the sufficient
    level.
    """
    return bool(found.gamma > max(_NEAR_BOUND * wanted[2] * found.gamma_min, wanted[0]))


def _fails_in_digits(
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


def _settle_lower_bound(
    P: control.StateSpace, plant: Plant, *, found: Synthesis, factor: float
) -> Synthesis:
    """Return a synthesis whose lower bound is confirmed in multiple precision for a stiff P, and
    never above gamma.
    """
    low, reached = min(found.gamma_min, found.gamma), found.gamma * _ROUNDING_FACTOR
    fails = partial(_fails_in_digits, P, plant)
    # a level that was reached must not fail: otherwise the problem is singular, and no bound
    # follows
    if found.found and fails(reached) is False:
        if low and not fails(low):
            ends = 0.0, low
        else:
            ends = low, reached
        if ends[0] == 0 or found.gamma > _NEAR_BOUND * factor * low:
            low = _bisect_level(
                lambda level: not fails(level), ends, tolerance=_TOLERANCE, n_steps=MOST_STEPS
            )[0]
    return replace(found, gamma_min=min(low, found.gamma))


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


def _synthesise_singular(
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
            why = _ALL_STEPS_MADE
        else:
            why = "no level met the existence conditions, with any regularisation"
        return replace(nothing, n_steps=n_tried, reason=why)
    if found.gamma_min > _KERNEL_TOLERANCE * found.gamma:
        low = min(found.gamma_min, found.gamma)
    else:
        low = 0.0
    reason = ""
    if found.gamma > _SINGULAR_TOLERANCE * low and found.gamma > wanted[0]:
        why = _ALL_STEPS_MADE if late else "the problem is singular"
        if low > 0:
            known = f"no controller reaches less than {low:.4g}"
        else:
            known = "no lower bound was found"
        reason = f"{why}: gamma {found.gamma:.4g} was reached, {known}"
    return replace(found, level=low, gamma_min=low, n_steps=n_tried, reason=reason)


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
    ends = _direct_term_bound(problem), np.inf
    low, high, n_tried = _bisect_level(
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
            what = _ALL_STEPS_MADE
        else:
            what = f"no level up to {_LARGEST_GAMMA:.0e} met the existence conditions"
        return replace(best, reason=what)
    best = replace(
        best, reason="the loop with the controller of the Riccati equations is not stable"
    )
    # The Riccati equations state existence; near the least level rounding decides whether the
    # controller built from them works. So the loop itself is judged, and higher levels are tried.
    for step in _STEPS_UP:
        gamma = high * factor * step
        loop = _controlled_loop(P, problem, gamma)
        if loop is None:
            continue
        achieved = hinf_norm(loop[1])[0]
        if achieved <= gamma * 1.001:
            reason = ""
        else:
            reason = f"the norm reached is above the requested level {gamma:.4g}"
        if late:
            reason = f"{_ALL_STEPS_MADE} with gamma between {low:.4g} and {high:.4g}"
        if achieved < best.gamma:
            best = replace(best, K=loop[0], gamma=achieved, reason=reason)
        if achieved <= gamma * 1.001:
            break
    return best
