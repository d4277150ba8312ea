"""Norm bounds at every frequency, interval by interval: the scaling frozen, a Hamiltonian test on each.

On an interval the loop has one scaling, any of which proves what it proves. If its largest singular value is below one
at a point of the interval and no eigenvalue of the Hamiltonian at level one lies on the interval, it stays below one
all over it. Intervals that fail are split until they pass, a violation is
found, or the cap is reached.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable

import control
import numpy as np

from nlfrf._base.values import value
from robust.lti.lti import Matrices, axis_offset, make_response, poles, timebase, zeros
from robust.lti.norms import crossings, largest_gain
from robust.lti.stability import poles_with_rounding
from robust.proofs.exact.claim import to_matrices
from robust.proofs.exact.polynomials import exact_roots

MAX_INTERVALS = 600
MIN_RELATIVE_WIDTH = 1e-9
SLACK = 3e-6  # above what coordinates and the check against `exact` may be off


@value
class Magnitude:
    """|W(j omega)| = gain prod |j omega - zeros| / prod |j omega - poles|, to be bounded on intervals."""

    zeros: np.ndarray
    poles: np.ndarray
    gain: float

    def upper_each(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Return (I,) a bound from above on each finite interval, tight as it shrinks."""
        z, p = self.zeros / 1j, self.poles / 1j
        middle, half = (low + high) / 2, (high - low) / 2
        with np.errstate(divide="ignore", invalid="ignore"):
            crude = log_max_distance(z, low, high) - log_min_distance(p, low, high)
            at = np.log(np.abs(middle[:, None] - z)).sum(axis=1) - np.log(np.abs(middle[:, None] - p)).sum(axis=1)
            z_low, z_high = slope_range(z, low, high)
            p_low, p_high = slope_range(p, low, high)
            fine = at + half * np.maximum(np.abs(z_high - p_low), np.abs(z_low - p_high))
            return self.gain * np.exp(np.fmin(crude, fine)) * (1 + 1e-9)


def log_max_distance(roots: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return (I,) log of the product of the largest distances of the roots from each real interval."""
    ends = np.maximum(np.abs(low[:, None] - roots), np.abs(high[:, None] - roots))
    return np.asarray(np.log(ends).sum(axis=1))


def log_min_distance(roots: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return (I,) log of the product of the smallest distances."""
    with np.errstate(divide="ignore"):
        nearest = np.clip(roots.real, low[:, None], high[:, None]) - roots
        return np.asarray(np.log(np.abs(nearest)).sum(axis=1))


def slope_range(roots: np.ndarray, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(I,), (I,) range over each interval of the derivative of the log distances, summed root by root."""
    a = np.abs(roots.imag)
    first, last = low[:, None] - roots.real, high[:, None] - roots.real
    with np.errstate(divide="ignore", invalid="ignore"):
        # t/(t^2 + a^2) has its extremes +-1/(2a) at t = +-a; nan only where a root lies on the interval
        at_first, at_last, peak = first / (first**2 + a**2), last / (last**2 + a**2), 1 / (2 * a)
        most = np.where((first <= a) & (a <= last), peak, np.maximum(at_first, at_last))
        least = np.where((first <= -a) & (-a <= last), -peak, np.minimum(at_first, at_last))
    return np.nan_to_num(least, nan=-np.inf).sum(axis=1), np.nan_to_num(most, nan=np.inf, posinf=np.inf).sum(axis=1)


def magnitude_of(system: control.StateSpace) -> Magnitude:
    """Return the magnitude of a single-loop system over omega, or over x = tan(omega dt/2) where it is discrete."""
    z, p = zeros(system), poles(system)
    dt = timebase(system)
    if dt:
        z, p = (z - 1) / (z + 1), (p - 1) / (p + 1)
        z, p = z[np.abs(z) < 1e12], p[np.abs(p) < 1e12]
    # the gain from one point where nothing is near
    point = 1.2345 * (np.exp(np.mean(np.log(np.abs(p[p != 0])))) if np.any(p != 0) else 1.0)
    at = np.exp(2j * np.arctan(point)) if dt else 1j * point
    value_there = abs(complex(system(at))) if system.nstates else abs(system.D[0, 0])
    gain = value_there * float(np.prod(np.abs(1j * point - p)) / np.prod(np.abs(1j * point - z)))
    return Magnitude(zeros=z, poles=p, gain=gain)


@value
class IntervalProof:
    """Intervals proved (I, 2), whether they cover everything, the violation found (nan: none), and what went wrong."""

    intervals: np.ndarray
    holds: bool
    violated_at: float
    reason: str


def prove(
    frozen: Callable[[float, float], Matrices],
    exact: Callable[[float], float],
    starts: np.ndarray,
    top: float,
    *,
    most: int = MAX_INTERVALS,
    slack: float = SLACK,
    changes: Callable[[float, float], tuple[np.ndarray, np.ndarray] | None] | None = None,
) -> IntervalProof:
    """Prove that the loop stays below one on [0, top].

    frozen(low, high) : the loop with the scaling of the interval; exact(x) : the true value
    at one frequency, computed in another way, which the frozen loop must not undercut. slack : what the frozen loop may
    be off, relative to the level. changes : where the frozen loop may pass the level, by another test than the
    Hamiltonian of its norm.
    """
    edges = np.unique(np.concatenate([[0.0], starts[(starts > 0) & (starts < top)], [top]]))

    def narrow(low: float, high: float) -> bool:
        return bool(low > edges[-2] / MIN_RELATIVE_WIDTH if np.isinf(high) else high - low <= MIN_RELATIVE_WIDTH * high)

    nothing_below = MIN_RELATIVE_WIDTH * edges[1] if np.isfinite(edges[1]) else 0.0
    todo = list(itertools.pairwise(edges.tolist()))[::-1]
    done: list[tuple[float, float]] = []
    count = 0

    def stop(reason: str, where: float = np.nan) -> IntervalProof:
        return IntervalProof(intervals=np.array(done).reshape(-1, 2), holds=False, violated_at=where, reason=reason)

    while todo:
        count += 1
        if count > most:
            return stop(f"undecided after {most} intervals")
        low, high = todo.pop()
        inner = interior_point(low, high)
        if not (truth := exact(inner)) < 1:
            return stop(f"the value there is {truth:.6g}", inner)
        A, B, C, D = frozen(low, high)
        matrices = A, B, C * (1 + slack), D * (1 + slack)
        if not all(np.isfinite(m).all() for m in matrices):
            todo += [(inner, high), (low, inner)]
            continue
        at_inner = float(largest_gain(matrices, np.array([inner]))[0])
        if truth > at_inner * (1 + 1e-9 - slack / 2) + 1e-9:
            return stop("the state space of the loop does not reproduce its frequency response")
        if at_inner < 1 and (
            has_no_crossing(changes(low, high) if changes else crossings(matrices, 1.0), low, high)
            or below_one_nearby(matrices, inner, max(inner - low, high - inner))
        ):
            done.append((low, high))
        elif narrow(low, high) or high <= nothing_below:
            return stop(f"undecided at {inner:.6g}")
        else:
            todo += [(inner, high), (low, inner)]
    return IntervalProof(intervals=np.array(sorted(done)), holds=True, violated_at=np.nan, reason="")


def initial_cuts(points: np.ndarray) -> np.ndarray:
    """Return where to cut the axis first: a third and three times every point, those that crowd left out."""
    x = np.unique(np.concatenate([points / 3, points * 3]))
    keep = [x[0]]
    for point in x[1:]:
        if point > 2 * keep[-1]:
            keep.append(point)
    return np.array(keep)


def has_no_crossing(found: tuple[np.ndarray, np.ndarray] | None, low: float, high: float) -> bool:
    """Return whether no singular value of the frozen loop can reach one on the interval."""
    if found is None:
        return False
    omega, moved = found
    return not np.any((omega + moved >= low) & (omega - moved <= high))


def below_one_nearby(matrices: Matrices, middle: float, reach: float) -> bool:
    """Return whether the loop stays below one within `reach` of the middle by the size of its resolvent alone.

    With R = (j middle - A)^-1 and reach |R| < 1, the response moves by at most reach |C R| |R B|/(1 - reach |R|): a
    proof for short intervals that asks nothing of eigenvalues, where slow modes crowd around zero.
    """
    A, B, C, _ = matrices
    if not np.isfinite(reach) or A.shape[0] == 0:
        return False
    R = np.linalg.inv(1j * middle * np.eye(A.shape[0]) - A)
    size = reach * np.linalg.norm(R, 2)
    if not size < 1:
        return False
    moves = reach * np.linalg.norm(C @ R, 2) * np.linalg.norm(R @ B, 2) / (1 - size)
    return bool(largest_gain(matrices, np.array([middle]))[0] + moves < 1)


def interior_point(low: float, high: float) -> float:
    """Return a point well inside: the geometric middle, a decade from an end at zero or infinity."""
    if low == 0 and np.isinf(high):
        return 1.0
    if low == 0:
        return high / 2
    return low * 8 if np.isinf(high) else float(np.sqrt(low * high))


# ---- Responses in doubles: from the matrices where rounding hardly moves a mode, from exact roots where it may.

MAX_POLE_SHIFT = 0.1  # of its distance to the axis, by which rounding may move a pole unnoticed
AXIS_DISTANCE = 1e-8  # of its modulus: what counts as the distance of a pole on the axis
MAX_EXACT_STATES = 40  # states of which exact roots are taken


def poles_are_uncertain(poles: np.ndarray, moved: np.ndarray, discrete: bool) -> bool:
    """Return whether rounding may have moved a pole by about as much as it is damped."""
    damping = np.abs(np.abs(poles) - 1) if discrete else np.abs(poles.real)
    size = np.abs(poles - 1) if discrete else np.abs(poles)
    return bool(np.any(moved > MAX_POLE_SHIFT * np.maximum(damping, AXIS_DISTANCE * size)))


def trusted_responder(system: control.StateSpace) -> Callable[[np.ndarray], np.ndarray]:
    """`robust.lti.lti.make_response`, from exact roots where modes over decades share poor coordinates."""
    dt = timebase(system)
    if not 1 < system.nstates <= MAX_EXACT_STATES or not poles_are_uncertain(*poles_with_rounding(system), bool(dt)):
        return make_response(system)
    roots = exact_roots(to_matrices(system))
    return lambda omega: roots.at(axis_offset(omega, dt))
