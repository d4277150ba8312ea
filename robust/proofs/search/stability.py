"""Stable or not: floating point says so far from the boundary, exact arithmetic beside it."""

from __future__ import annotations

import time

import control
import numpy as np

from nlfrf._base.values import value
from robust._base.states import Outcome, Stability
from robust.lti.connections import worst_sensitivity
from robust.lti.lti import in_s, on_axis, poles, response, timebase, zeros
from robust.lti.norms import EPS
from robust.lti.stability import StabilityResult, apparent_instability, certain_poles
from robust.proofs.exact.claim import as_given
from robust.proofs.exact.closed_loops import (
    ClosedLoopClaim,
    decide_closed_loop,
    norm_of_closed_loop,
    verify_closed_loop,
)
from robust.proofs.exact.stability import stable_matrix
from robust.proofs.search.certificate import EXACT, Certificate, refused
from robust.proofs.search.intervals import IntervalProof

__all__ = [
    "LARGEST_EXACT",
    "LoopFactors",
    "beside_boundary",
    "certify_closed_loop",
    "instability",
    "product",
    "prove_loop",
]


BESIDE = 1e6  # times what rounding moves a pole by
LARGEST_EXACT = 60  # states: seconds beyond


def beside_boundary(system: control.StateSpace, found: tuple[np.ndarray, np.ndarray] | None = None) -> bool:
    """Whether a pole lies so near the stability boundary that rounding may matter, by a wide margin.

    `found` are its `certain_poles`, where they are known.
    """
    poles, moved = certain_poles(system) if found is None else found
    excess = np.abs(poles) - 1 if timebase(system) else poles.real
    rounding = np.maximum(moved, EPS * np.linalg.norm(system.A))  # putting the system together rounds too
    return bool(np.any(np.abs(excess) <= BESIDE * rounding))


def instability(system: control.StateSpace) -> StabilityResult:
    """Whether every pole of the system, its matrix taken as it is, is strictly stable.

    >>> on_the_axis = control.ss([[0.0, 1.0], [-1.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]])
    >>> found = instability(on_the_axis)
    >>> found.state, found.at_boundary
    ('unstable', True)
    """
    apparent = apparent_instability(system)
    if not system.nstates or system.nstates > LARGEST_EXACT or not beside_boundary(system):
        return apparent
    exact = stable_matrix(system.A, discrete=bool(timebase(system)))
    if exact.holds:
        return StabilityResult(state=Stability.STABLE)
    if not exact.violated or apparent.unstable:
        return apparent
    poles = certain_poles(system)[0]
    worst = poles[int(np.argmax(np.abs(poles) if timebase(system) else poles.real))]
    return StabilityResult(state=Stability.UNSTABLE, pole=complex(worst), at_boundary=True)


# ---- Proofs for a single loop straight from its responses, interval by interval; a delay is taken as it is.
#
# On an interval of half-width h around m the logarithm of a rational response moves by at most |slope(m)| h + bend
# h^2/2,
# the bend being the sum of 1/distance^2 over its roots; a delay adds to the slope alone. So L, the uncertainty and the
# weights stay in known discs around their values at m, and the worst case below a known bound. Intervals on which that
# does not decide are halved. The responses are those of the report; the roots only bound how fast they change.

MOST_INTERVALS = 300_000
NARROWEST = 1e-12
SLACK = 1e-6  # what the responses may be off
TRUST = 1e-3  # how far roots may be off, seen from m
Spread = tuple[np.ndarray, np.ndarray, np.ndarray]


@value
class Product:
    """A product of responses (`over` divides), and the roots behind it as (zeros, poles, dt) of each factor."""

    systems: tuple[control.StateSpace, ...]
    over: tuple[control.StateSpace, ...]
    delay: float
    roots: tuple[tuple[np.ndarray, np.ndarray, float], ...]

    def at(self, omega: np.ndarray) -> np.ndarray:
        """(I,) value."""
        total = np.exp(-1j * omega * self.delay)
        with np.errstate(all="ignore"):
            for system in self.systems:
                total = total * response(system, omega)
            for system in self.over:
                total = total / response(system, omega)
        return total

    def logarithm(self, omega: np.ndarray) -> np.ndarray:
        """(I,) log magnitude by the roots, but for a constant."""
        total = np.zeros(omega.size)
        with np.errstate(divide="ignore", invalid="ignore"):
            for z, p, dt in self.roots:
                s = on_axis(omega, dt)[:, None]
                total += np.log(np.abs(s - z)).sum(axis=1) - np.log(np.abs(s - p)).sum(axis=1)
        return total

    def spread(self, m: np.ndarray, h: np.ndarray) -> Spread:
        """(I,) radius of the disc around the value at m, largest and smallest magnitude in it, all in units of it."""
        slope, bend = np.full(m.size, -1j * self.delay), np.zeros(m.size)
        least, most = np.zeros(m.size), np.zeros(m.size)
        with np.errstate(all="ignore"):
            for z, p, dt in self.roots:
                s = on_axis(m, dt)[:, None]
                rate = dt or 1.0  # how fast s moves
                reach = rate * h[:, None]
                for roots, sign in ((z, 1), (p, -1)):
                    far = np.abs(s - roots)
                    slope += sign * (1j * (dt * s if dt else 1.0) / (s - roots)).sum(axis=1)
                    size = np.abs(roots) if dt else 1.0
                    bend += (rate**2 * size / np.maximum(far - reach, 0) ** 2).sum(axis=1)
                    nearer = np.log(np.maximum(1 - reach / far, 0)).sum(axis=1)
                    farther = np.log1p(reach / far).sum(axis=1)
                    least, most = (least + nearer, most + farther) if sign > 0 else (least - farther, most - nearer)
            moved = np.abs(slope.real) * h + bend * h**2 / 2
            radius = np.expm1(np.abs(slope) * h + bend * h**2 / 2)
            return whole(radius, np.exp(np.fmin(moved, most)), np.exp(np.fmax(-moved, least)))

    def tail(self, omega: float) -> Spread:
        """The same from omega to infinity, in units of the value at omega; all systems continuous."""
        near = excess = 0.0
        for z, p, _ in self.roots:
            excess += p.size - z.size
            near += float(np.sum(np.abs(z)) + np.sum(np.abs(p))) / omega
        # a factor over j omega lies within t = |root|/omega of one: its log within t/(1 - t), and twice that in all
        most = float(np.exp(4 * near)) if near < 0.25 else np.inf
        radius = most - 1 if excess == 0 and self.delay == 0 else np.inf
        up, low = (most if excess >= 0 else np.inf), (1 / most if excess <= 0 else 0.0)
        return np.array([radius]), np.array([up]), np.array([low])


def doubted(spread: Spread, doubt: np.ndarray) -> Spread:
    """The same where the value at m is only known to within a factor exp(doubt), phase included."""
    radius, up, low = spread
    with np.errstate(over="ignore"):  # nothing known there
        return (1 + radius) * np.exp(doubt) - 1, up * np.exp(doubt), low * np.exp(-doubt)


def whole(radius: np.ndarray, up: np.ndarray, low: np.ndarray) -> Spread:
    """Nothing known where the numbers broke down."""
    return (
        np.where(np.isnan(radius), np.inf, radius),
        np.where(np.isnan(up), np.inf, up),
        np.where(np.isnan(low), 0.0, low),
    )


def product(*systems: control.StateSpace, over: tuple[control.StateSpace, ...] = (), delay: float = 0.0) -> Product:
    """The product of some systems, divided by others, behind a delay."""
    roots = [(zeros(s), poles(s), timebase(s)) for s in systems]
    roots += [(poles(s), zeros(s), timebase(s)) for s in over]
    return Product(systems=systems, over=over, delay=delay, roots=tuple(roots))


@value
class LoopFactors:
    """What a proof needs: L, q with b = q S, q / L, and the performance weight; for the inverse forms also a = q."""

    L: Product
    q: Product
    relative: Product
    w_P: Product | None
    inverse: bool

    @property
    def parts(self) -> list[Product]:
        """The products whose values enter."""
        return [self.L, self.q] + ([self.w_P] if self.w_P is not None else [])

    def exact(self, values: list[np.ndarray]) -> np.ndarray:
        """(I,) |b|, or with w_P the worst |w_P S_p|."""
        with np.errstate(all="ignore"):
            S = 1 / (1 + values[0])
            b = np.where(np.isfinite(values[0]), values[1] * S, np.nan)
            if self.w_P is None:
                return np.abs(b)
            a = values[1] if self.inverse else np.zeros_like(b)
            return np.abs(values[2]) * worst_sensitivity(S, a, b)

    def bound(self, values: list[np.ndarray], spreads: list[Spread], relative: Spread) -> np.ndarray:
        """(I,) an upper bound of `exact` over intervals, from values inside them and how far they spread."""
        L, q = values[:2]
        (radius, up, low), (_, q_up, q_low) = spreads[:2]
        with np.errstate(all="ignore"):
            size = np.abs(L)
            away = np.maximum(np.abs(1 + L) - size * radius, np.maximum(1 - size * up, size * low - 1))
            S_up = 1 / np.maximum(away, 0)
            T_far = 1 / np.maximum(1 - 1 / (size * low), 0)  # |T| where |L| is large, at a pole too
            b = np.fmin(np.abs(q) * q_up * S_up, np.abs(q / L) * relative[1] * T_far)
            if self.w_P is None:
                return np.where(np.isnan(b), np.inf, b)
            S = 1 / (1 + L)
            S_moved = np.abs(S) * size * radius * S_up
            S_up = np.fmin(S_up, np.abs(S) + S_moved)
            worst = S_up / (1 - b)
            if self.inverse:
                a = np.abs(q)
                T_up = np.fmin(np.fmin(np.abs(1 - S) + S_moved, size * up * S_up), T_far)
                edge = np.maximum(q_up**2 - 1, 1 - q_low**2)
                centre = np.abs(1 - a**2 * S) + a**2 * (edge * S_up + S_moved)
                worst = np.fmin(S_up * (centre + a * q_up * T_up), S_up + b**2 + b * T_up) / (1 - b**2)
            found = np.abs(values[2]) * spreads[2][1] * worst
            return np.where((b < 1) & ~np.isnan(found), found, np.inf)


def prove_loop(loop: LoopFactors, lines: np.ndarray, top: float, *, time_cap: float) -> IntervalProof:
    """Prove |b| < 1, or with w_P that |w_P| max |S_p| < 1, at every frequency up to top [rad/s].

    lines : frequencies [rad/s] to cut at first.
    """
    deadline = time.thread_time() + time_cap
    groups = [group for part in loop.parts for group in part.roots]
    sizes = np.abs(np.concatenate([in_s(r, dt) for z, p, dt in groups for r in (z, p)]))
    sizes = np.concatenate([sizes[(sizes > 0) & np.isfinite(sizes)], lines])
    end = top if np.isfinite(top) else 1e3 * float(sizes.max())  # a sampled loop has no tail that falls off
    first = min(float(sizes.min()), end) * 1e-6
    edges = np.concatenate([[0.0], np.geomspace(first, end, 300)])
    offset = [np.nan] * len(loop.parts)
    done: list[np.ndarray] = []
    count = 0

    def stop(reason: str, where: float = np.nan) -> IntervalProof:
        return IntervalProof(intervals=np.zeros((0, 2)), holds=False, violated_at=where, reason=reason)

    low, high = edges[:-1], edges[1:]
    while low.size:
        count += low.size
        if count > MOST_INTERVALS or time.thread_time() > deadline:
            return stop(f"undecided after {count} intervals")
        m, h = (low + high) / 2, (high - low) / 2
        values = [part.at(m) for part in loop.parts]
        exact = loop.exact(values)
        if np.any(exact >= 1):
            k = int(np.nanargmax(exact))
            return stop(f"the value there is {exact[k]:.6g}", float(m[k]))
        doubts = []  # log errors of the roots against the responses, where a response is all rounding too
        for k, (part, found) in enumerate(zip(loop.parts, values, strict=True)):
            with np.errstate(all="ignore"):
                difference = np.log(np.abs(found)) - part.logarithm(m)
            usual = np.isfinite(difference)
            offset[k] = float(np.median(difference[usual])) if np.isnan(offset[k]) and usual.any() else offset[k]
            doubts.append(np.where(usual, np.abs(difference - offset[k]), 0.0))
        worst = np.max(doubts, axis=0)
        reach = h * (1 + TRUST) * np.exp(worst)
        spreads = [doubted(part.spread(m, reach), doubt) for part, doubt in zip(loop.parts, doubts, strict=True)]
        bound = loop.bound(values, spreads, doubted(loop.relative.spread(m, reach), worst))
        fine = bound < 1 - SLACK
        done.append(np.column_stack([low[fine], high[fine]]))
        low, m, high = low[~fine], m[~fine], high[~fine]
        if np.any(high - low <= NARROWEST * high):
            return stop(f"undecided at {m[np.argmin((high - low) / high)] / 2 / np.pi:.6g} Hz")
        low, high = np.concatenate([low, m]), np.concatenate([m, high])
        if low.size == 0 and end < top:
            values = [part.at(np.array([end])) for part in loop.parts]
            tails = [part.tail(end) for part in loop.parts]
            if loop.bound(values, tails, loop.relative.tail(end))[0] < 1 - SLACK:
                done.append(np.array([[end, np.inf]]))
            elif end > 1e9 * sizes.max():
                return stop("undecided at infinite frequency")
            else:
                low, high, end = np.array([end]), np.array([10 * end]), 10 * end
    intervals = np.concatenate(done)
    return IntervalProof(intervals=intervals[np.argsort(intervals[:, 0])], holds=True, violated_at=np.nan, reason="")


# ---- The norm that a controller reaches with a plant, certified from both as they are given.

#: How far above the norm that was computed a level is tried, relative to it: near it rounding has the word.
ABOVE = (1e-7, 1e-5, 1e-3)


def certify_closed_loop(
    P: control.StateSpace, K: control.StateSpace, gamma: float, *, subject: str = "norm", time_cap: float = 10.0
) -> Certificate:
    """Prove the norm of F_l(P, K) just above `gamma`, what it was found to be; else above what more digits find.

    Returns a certificate whose level is the bound that was proved. One that does not hold has the norm in many digits
    as its level (inf: the loop is not stable), or gamma where there was no time for it.
    """
    deadline = time.thread_time() + time_cap
    plant, controller = as_given(P), as_given(K)

    def proof(norm: float, *, thorough: bool = False) -> Certificate | None:
        for more in ABOVE[thorough:]:
            level = norm * (1 + more) if norm > 0 else np.finfo(float).tiny
            claim = ClosedLoopClaim(plant=plant, controller=controller, level=level)
            if decide_closed_loop(claim, deadline=deadline, thorough=thorough).holds:
                top = np.pi / timebase(P) if timebase(P) else np.inf
                return Certificate(
                    subject=subject,
                    outcome=Outcome.HOLDS,
                    level=level,
                    method=EXACT,
                    intervals=np.array([[0.0, top]]),
                    reason="",
                    claim=claim,
                    again=verify_closed_loop,
                )
        return None

    if found := proof(gamma):
        return found
    precise, _ = norm_of_closed_loop(plant, controller, deadline=deadline)
    if np.isnan(precise) and (found := proof(gamma, thorough=True)):
        return found
    if np.isnan(precise):
        return refused(
            subject, gamma, f"the norm, {gamma:.6g} in floating point, could not be proved in {time_cap:.3g} s"
        )
    if np.isinf(precise):
        return refused(subject, precise, "in more digits than floating point has, the loop is not stable")
    if found := proof(precise) or proof(precise, thorough=True):
        return found
    return refused(subject, precise, f"the norm, {precise:.6g} in many digits, could not be proved in {time_cap:.3g} s")
