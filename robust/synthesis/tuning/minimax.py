"""The search: first for stability, then for the minimum of the largest limit ratio.

    find_stable   spectral abscissa over all plants by BFGS with weak Wolfe steps (Lewis & Overton 2013)
    improve       in turns until a round gains nothing: sequential quadratic programs for the minimax of all peaks
                  (after Curtis, Mitchell & Overton 2017), then BFGS on the exact penalty

A quadratic program stalls if peaks appear and vanish between the steps; BFGS is slow if they
remain. So both methods are used in turn.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np

from robust.synthesis.conic import solve_conic
from robust.synthesis.tuning.loops import Peak
from robust.synthesis.tuning.problem import HARD_LIMIT_MARGIN, Evaluation, TuningProblem

#: Relative gain of a round below which the search ends.
_ROUND_GAIN = 2e-5
#: The same for points around a stalled design, which cost more: TMD of COMPleib goes from 2.561 to
#: 2.528.
_SAMPLED_GAIN = 2e-4
_N_ROUNDS, _N_SQP, _N_BFGS = 20, 40, 200
#: Weights of the hard limits; the next one is for limits that are still missed.
_PENALTIES = (10.0, 100.0, 1000.0)
#: Largest number of closer evaluations that restart the search, and the excess (log) that causes
#: one.
_N_LOOKS, _LOOK_TOLERANCE = 3, 2e-6
#: Around a stalled design: distances in coordinates, and the largest number of points.
_SAMPLING_RADII, _MAX_SAMPLES = (0.1, 0.03, 0.01, 3e-3, 1e-3, 1e-4), 20
#: Largest number of rounds with new scalings, and the gain (log) that causes another. For a 2 by 2
#: plant with two PIDs the rounds gained 0.75, 0.037, 0.013, 0.003 and 0.0007, and eight more
#: together 0.003.
_N_SCALINGS, _SCALED_GAIN = 6, 1e-3
#: Level (log) relative to the start at and below which a limit counts as zero.
_MIN_LOG_GAIN = float(np.log(1e-10))
_WOLFE = 1e-4, 0.5
Found = TypeVar("Found")  # result of a function besides its value and slope


# ---- Stability.


def find_stable(problem: TuningProblem, x: np.ndarray, n_steps: int = 150) -> Evaluation:
    """Search from coordinates for a design whose poles all decay as required; otherwise return the
    last one.
    """
    low, high = problem.controller.lower, problem.controller.upper

    def function(x: np.ndarray) -> tuple[float, np.ndarray, Evaluation]:
        inside = np.clip(x, low, high)
        found = problem.evaluate(inside, peaks=False)
        if found.poles:
            slope = found.poles[0].gradient
        else:
            slope = np.zeros(x.size)
        outside = x - inside
        return (
            found.excess + float(np.abs(outside).sum()),
            np.where(outside == 0, slope, np.sign(outside)),
            found,
        )

    target = -1e-6 * max(1.0, problem.decay)
    return _bfgs(function, x, n_steps, enough=target)[1]


def _bfgs(
    function: Callable[[np.ndarray], tuple[float, np.ndarray, Found]],
    x: np.ndarray,
    n_steps: int,
    *,
    enough: float = -np.inf,
) -> tuple[float, Found]:
    """Minimise by BFGS with weak Wolfe steps by bisection, for functions that are smooth almost
    everywhere.
    """
    f, g, found = function(x)
    H: np.ndarray | None = None
    for _ in range(n_steps):
        if f < enough or not np.isfinite(f) or not np.isfinite(g).all():
            break
        if H is None:
            d = -g / max(float(np.linalg.norm(g)), 1e-12)
        else:
            d = -H @ g
        slope = float(g @ d)
        if slope >= -1e-14 * max(1.0, abs(f)):
            break
        low, high, t = 0.0, np.inf, 1.0
        best = None
        for _ in range(30):
            f_t, g_t, found_t = function(x + t * d)
            if not f_t <= f + _WOLFE[0] * t * slope:
                high = t
            else:
                best = (t, f_t, g_t, found_t)
                if float(g_t @ d) >= _WOLFE[1] * slope:
                    break
                low = t
            if np.isfinite(high):
                t = (low + high) / 2
            else:
                t = 2 * low
            if np.isfinite(high) and high - low < 1e-12 * max(1.0, high):
                break
        if best is None:
            if H is None:
                break
            H = None
            continue
        t, f_new, g_new, found = best
        s, y = t * d, g_new - g
        x = x + s
        sy = float(s @ y)
        if sy > 1e-14 * float(np.linalg.norm(s) * np.linalg.norm(y)):
            if H is None:
                H = sy / float(y @ y) * np.eye(x.size)
            V = np.eye(x.size) - np.outer(s, y) / sy
            H = V @ H @ V.T + np.outer(s, s) / sy
        gained = f - f_new
        f, g = f_new, g_new
        if gained < 1e-9 * max(1.0, abs(f)):
            break
    return f, found


# ---- The smallest worst level.


def minimise_from(problem: TuningProblem, start: Evaluation) -> Evaluation:
    """Minimise the merit from a stable design, until no step improves it."""
    start = _evaluate_with_scalings(problem, start)
    current = _minimise(problem, start, start)
    for _ in range(_N_SCALINGS if problem.has_scalings else 0):
        before = current.merit(_PENALTIES[-1])
        current = _minimise(problem, _evaluate_with_scalings(problem, current), start)
        if not current.merit(_PENALTIES[-1]) < before - _SCALED_GAIN:
            break
    for _ in range(_N_LOOKS):
        closer = _evaluate_closely(problem, current)
        if closer is current:
            break
        current = _minimise(problem, closer, start)
    return current


def _evaluate_with_scalings(problem: TuningProblem, current: Evaluation) -> Evaluation:
    """Return the same design with the scalings of its worst cases fitted again."""
    if not problem.has_scalings:
        return current
    problem.refit_scalings(current.x)
    return problem.evaluate(current.x)


def _evaluate_closely(problem: TuningProblem, current: Evaluation) -> Evaluation:
    """Return the same design, evaluated again if a closer evaluation raised a limit."""
    known = _highest_levels(current)
    for k, looks in enumerate(problem.look_closely(current.x)):
        for limit, look in looks.items():
            if (
                look.ratio > 0
                and float(np.log(look.ratio)) > known.get((limit, k), -np.inf) + _LOOK_TOLERANCE
            ):
                return problem.evaluate(current.x)
    return current


def _highest_levels(evaluation: Evaluation) -> dict[tuple[int, int], float]:
    """Return the highest level of each limit and plant."""
    known: dict[tuple[int, int], float] = {}
    for peak in evaluation.peaks:
        key = (peak.limit, peak.plant)
        known[key] = max(known.get(key, -np.inf), peak.level)
    return known


def _minimise(problem: TuningProblem, current: Evaluation, start: Evaluation) -> Evaluation:
    """Minimise by rounds of programs and BFGS with growing penalties."""
    for rho in _PENALTIES:
        for _ in range(_N_ROUNDS):
            before = current.merit(rho)
            current = _evaluate_at_exact_peaks(problem, _sequential_programs(problem, current, rho))
            if _is_done(current, start):
                break
            current = _evaluate_at_exact_peaks(problem, _descend_on_penalty(problem, current, rho))
            problem.report(current)
            if _is_done(current, start):
                break
            if not current.merit(rho) < before - _ROUND_GAIN:
                current = _evaluate_at_exact_peaks(problem, _sampled_steps(problem, current, rho))
                if not current.merit(rho) < before - _SAMPLED_GAIN:
                    break
        if current.hard < 2 * HARD_LIMIT_MARGIN or _is_done(current, start):
            break
    return current


def _is_done(current: Evaluation, start: Evaluation) -> bool:
    """Return True if nothing is left to minimise: hard limits alone are met, or soft ones are
    zero.
    """
    has_soft = any(not peak.hard for peak in current.peaks)
    if current.hard > 0:
        return False
    return not has_soft or current.soft < start.soft + _MIN_LOG_GAIN


def _evaluate_at_exact_peaks(problem: TuningProblem, current: Evaluation) -> Evaluation:
    """Return the same design with new peaks if the exact norm lies above them."""
    for _ in range(3):
        norms = problem.norms(current.x)
        known, missed = _highest_levels(current), 0.0
        for k, found in enumerate(norms):
            for limit, (level, _, _) in found.items():
                if np.isfinite(level) and level > 0:
                    missed = max(missed, float(np.log(level)) - known.get((limit, k), -np.inf))
        if missed < 1e-7:
            break
        current = problem.evaluate(current.x)
    return current


def _descend_on_penalty(problem: TuningProblem, current: Evaluation, rho: float) -> Evaluation:
    """Minimise the exact penalty by BFGS, trial points projected onto the bounds."""
    low, high = problem.controller.lower, problem.controller.upper
    best = current

    def function(x: np.ndarray) -> tuple[float, np.ndarray, Evaluation]:
        nonlocal best
        inside = np.clip(x, low, high)
        found = problem.evaluate(inside, pole_slopes=False)
        merit = found.merit(rho)
        if merit < best.merit(rho):
            best = found
            problem.report(found)
        outside = x - inside
        if found.stable:
            slope = found.merit_slope(rho)
        else:
            slope = np.zeros(x.size)
        return (
            merit + float(np.abs(outside).sum()),
            np.where(outside == 0, slope, np.sign(outside)),
            found,
        )

    _bfgs(function, current.x, _N_BFGS)
    return best


def _sampled_steps(problem: TuningProblem, current: Evaluation, rho: float) -> Evaluation:
    """Step by gradient sampling: on the peaks of nearby points, if neither programs nor BFGS
    improve.

    Near a kink the peaks of one point do not show a common direction of descent (Burke, Lewis &
    Overton 2005).
    """
    rng, n = np.random.default_rng(0), current.x.size
    low, high = problem.controller.lower, problem.controller.upper
    for radius in _SAMPLING_RADII:
        cuts: list[tuple[Peak, np.ndarray]] = []
        for _ in range(min(2 * n, _MAX_SAMPLES)):
            near = np.clip(current.x + radius * rng.uniform(-1, 1, n), low, high)
            tried = problem.evaluate(near, pole_slopes=False)
            if tried.stable:
                cuts += _cuts_of_trial(current, tried, near - current.x)
        if not current.poles:
            current = problem.evaluate(current.x)
        solved = _quadratic_program(
            problem, current, cuts=cuts, H=1e-3 * np.eye(n), rho=rho, box=10 * radius
        )
        if solved is None:
            continue
        for shorter in (1.0, 0.5, 0.25, 0.1, 0.03):
            tried = problem.evaluate(np.clip(current.x + shorter * solved[0], low, high))
            if tried.merit(rho) < current.merit(rho):
                current, _ = _lengthen_step(
                    problem, current, tried=tried, d=shorter * solved[0], rho=rho
                )
                break
    return current


def _sequential_programs(problem: TuningProblem, current: Evaluation, rho: float) -> Evaluation:
    """Step by quadratic programs on the peaks while they improve the merit; rho weighs its hard
    limits.
    """
    n = current.x.size
    if not current.poles:
        current = problem.evaluate(current.x)
    H, box = 0.1 * np.eye(n), 1.0
    fresh = True
    for _ in range(_N_SQP):
        cuts: list[tuple[Peak, np.ndarray]] = []
        accepted = None
        for trial in range(10):
            solved = _quadratic_program(problem, current, cuts=cuts, H=H, rho=rho, box=box)
            if solved is None:
                break
            d, predicted, multipliers = solved
            if (
                predicted < 1e-7 * max(1.0, abs(current.merit(rho)) * 1e-3)
                or float(np.abs(d).max()) < 1e-10
            ):
                break
            tried = problem.evaluate(
                np.clip(current.x + d, problem.controller.lower, problem.controller.upper)
            )
            if tried.merit(rho) <= current.merit(rho) - 0.1 * predicted:
                accepted = (d, tried, multipliers, predicted)
                break
            if tried.stable and trial < 4:
                cuts += _cuts_of_trial(current, tried, d)
            else:
                box = min(box, float(np.abs(d).max())) / 3
        if accepted is None:
            break
        d, tried, multipliers, predicted = accepted
        tried, d = _lengthen_step(problem, current, tried=tried, d=d, rho=rho)
        problem.report(tried)
        s = tried.x - current.x
        y = _lagrangian_change(current, tried, multipliers)
        H = _damped_update(H, s, y=y, fresh=fresh)
        fresh = False
        gained = current.merit(rho) - tried.merit(rho)
        current = _evaluate_at_exact_peaks(problem, tried)
        if float(np.abs(d).max()) > 0.9 * box:
            box = min(3.0, 2 * box)
        if gained < 1e-6 * max(1.0, abs(current.merit(rho)) * 1e-2):
            break
        if _is_done(current, current) and not any(not peak.hard for peak in current.peaks):
            break
    return current


def _lengthen_step(
    problem: TuningProblem, current: Evaluation, *, tried: Evaluation, d: np.ndarray, rho: float
) -> tuple[Evaluation, np.ndarray]:
    """Return the step, doubled as long as the merit falls nearly as steeply."""
    for _ in range(5):
        longer = problem.evaluate(
            np.clip(current.x + 2 * d, problem.controller.lower, problem.controller.upper)
        )
        if not longer.merit(rho) < tried.merit(rho) - 0.7 * (current.merit(rho) - tried.merit(rho)):
            break
        tried, d = longer, 2 * d
    return tried, d


def _cuts_of_trial(
    current: Evaluation, tried: Evaluation, d: np.ndarray
) -> list[tuple[Peak, np.ndarray]]:
    """Return peaks of a failed trial as rows of the next program, lowered so that they hold at its
    start.
    """
    highest, rows = _highest_levels(current), []
    for peak in tried.peaks:
        if np.isfinite(peak.gradient).all():
            level = min(
                peak.level - float(peak.gradient @ d), highest.get((peak.limit, peak.plant), np.inf)
            )
            rows.append((peak, np.array([level])))
    return rows


def _quadratic_program(
    problem: TuningProblem,
    current: Evaluation,
    *,
    cuts: list[tuple[Peak, np.ndarray]],
    H: np.ndarray,
    rho: float,
    box: float,
) -> tuple[np.ndarray, float, list[tuple[Peak, float]]] | None:
    """Return the step d of min d'Hd/2 + t + rho sum e, its predicted gain, and the multipliers of
    the peaks.

    Soft peaks lie below t, hard ones below the e of their limit and plant, at least zero; poles may
    lose nine tenths of their distance to the limit.
    """
    n = current.x.size
    peaks = [(peak, peak.level) for peak in current.peaks] + [
        (peak, float(level[0])) for peak, level in cuts
    ]
    peaks = [
        (peak, level)
        for peak, level in peaks
        if np.isfinite(peak.gradient).all() and np.isfinite(level)
    ]
    groups = sorted({(peak.limit, peak.plant) for peak, _ in peaks if peak.hard})
    low = np.maximum(problem.controller.lower - current.x, -box)
    high = np.minimum(problem.controller.upper - current.x, box)
    A, b = _linear_constraints(current, peaks, groups)
    edges = np.hstack([np.vstack([np.eye(n), -np.eye(n)]), np.zeros((2 * n, A.shape[1] - n))])
    P = np.zeros((A.shape[1], A.shape[1]))
    P[:n, :n] = (H + H.T) / 2
    q = np.concatenate([np.zeros(n), [1.0], np.full(len(groups), rho)])
    x, z, failed = solve_conic(
        P,
        q,
        A=np.vstack([A, edges]),
        b=np.concatenate([b, high, -low]),
        positive=len(b) + 2 * len(high),
    )
    if failed:
        return None
    d = np.clip(x[:n], low, high)
    after = _model_merit(peaks, d, groups=groups, rho=rho)
    predicted = _model_merit(peaks, np.zeros(n), groups=groups, rho=rho) - after
    return (
        d,
        float(predicted),
        [(peak, float(z[k])) for k, (peak, _) in enumerate(peaks) if z[k] > 1e-9],
    )


def _linear_constraints(
    current: Evaluation, peaks: list[tuple[Peak, float]], groups: list[tuple[int, int]]
) -> tuple[np.ndarray, np.ndarray]:
    """Return A, b of A (d, t, e) <= b: the peaks in their order, t if no peak bounds it, e, and the
    poles.
    """
    n = current.x.size

    def row(gradient: np.ndarray | float, below: int | None) -> np.ndarray:
        found = np.zeros(n + 1 + len(groups))
        found[:n] = gradient
        if below is not None:
            found[n + below] = -1.0
        return found

    rows = [
        (
            (
                row(peak.gradient, 1 + groups.index((peak.limit, peak.plant))),
                -level - HARD_LIMIT_MARGIN,
            )
            if peak.hard
            else (row(peak.gradient, 0), -level)
        )
        for peak, level in peaks
    ]
    bounded = any(not peak.hard for peak, _ in peaks)
    rows += [(row(0.0, k), 0.0) for k in range(bounded, 1 + len(groups))]
    for pole in current.poles:
        if np.isfinite(pole.gradient).all() and pole.excess > 10 * current.excess:
            scale = max(abs(pole.excess), 1e-9)
            rows.append((row(pole.gradient / scale, None), 0.9 * max(-pole.excess, 0.0) / scale))
    return np.array([one for one, _ in rows]), np.array([right for _, right in rows])


def _model_merit(
    peaks: list[tuple[Peak, float]], d: np.ndarray, *, groups: list[tuple[int, int]], rho: float
) -> float:
    """Return the exact-penalty merit of the linearised peaks after a step d: largest soft peak plus
    rho violations.

    peaks : peaks with their levels; groups : (limit, plant) of the hard limits.
    """
    soft = [level + float(peak.gradient @ d) for peak, level in peaks if not peak.hard]
    if soft:
        total = max(soft)
    else:
        total = 0.0
    for group in groups:
        excess = [
            level + HARD_LIMIT_MARGIN + float(peak.gradient @ d)
            for peak, level in peaks
            if peak.hard and (peak.limit, peak.plant) == group
        ]
        total += rho * max(0.0, *excess)
    return total


def _lagrangian_change(
    current: Evaluation, tried: Evaluation, multipliers: list[tuple[Peak, float]]
) -> np.ndarray:
    """Return the change of the Lagrangian's slope over a step; each peak is matched to the nearest
    of its limit.
    """
    change = np.zeros(current.x.size)
    for peak, weight in multipliers:
        same = [one for one in tried.peaks if (one.limit, one.plant) == (peak.limit, peak.plant)]
        if same:
            nearest = min(same, key=lambda one: _frequency_distance(one.omega, peak.omega))
            change += weight * (nearest.gradient - peak.gradient)
    return change


def _frequency_distance(one: float, other: float) -> float:
    """Return the distance of two frequencies; zero and infinity are close only to themselves."""
    if one == other:
        return 0.0
    if min(one, other) <= 0 or np.isinf(max(one, other)):
        return 1e3
    return abs(float(np.log(one / other)))


def _damped_update(H: np.ndarray, s: np.ndarray, *, y: np.ndarray, fresh: bool) -> np.ndarray:
    """Return a BFGS update that keeps H positive definite (Powell 1978)."""
    if not s.any() or not np.isfinite(y).all():
        return H
    sy, ss = float(s @ y), float(s @ s)
    if fresh and sy > 1e-12 * ss:
        H = np.clip(sy / ss, 1e-4, 1e4) * np.eye(s.size)
    Hs = H @ s
    sHs = float(s @ Hs)
    if sy >= 0.2 * sHs:
        theta = 1.0
    else:
        theta = 0.8 * sHs / (sHs - sy)
    r = theta * y + (1 - theta) * Hs
    H = H - np.outer(Hs, Hs) / sHs + np.outer(r, r) / float(s @ r)
    H = (H + H.T) / 2
    if np.linalg.cond(H) > 1e12:
        return 0.1 * np.eye(s.size)
    return H
