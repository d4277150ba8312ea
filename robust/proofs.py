"""Proofs about an assembled loop: robust stability and robust performance at every frequency."""

from __future__ import annotations

from typing import Any

import control
import numpy as np
from scipy.optimize import minimize_scalar

from robust.assembly import Assembly, weighted
from robust.certify import Certificate, certify_norm, refused
from robust.intervals import inside, magnitude, prove
from robust.loop import closed_loop
from robust.lti import constant, evaluate, poles, response, timebase, zeros
from robust.norms import continuous_image, well_conditioned
from robust.report import hertz
from robust.weights import fit_weight

BUDGET = 3.0  # seconds for each proof by intervals


def prove_stability(loop: Assembly, omega: np.ndarray, solver: str) -> Certificate:
    """|b| < 1 at every frequency: by a linear matrix inequality, else interval by interval."""
    subject = "robust stability"
    level, trouble = 1.0, ""
    if loop.pade_delay:
        level, trouble = 1 - delay_allowance(loop, omega), "the delay leaves no room"
        if not level > 0:
            return refused(subject, 1.0, trouble)
    whole = weighted(loop, loop.weight if on_loop_time(loop) else sampled_weight(loop))
    first = refused(subject, level, "no discrete weight was found that covers the continuous one closely")
    if whole is not None:
        first = certify_norm(whole, level, solver=solver, subject=subject)
        if first.holds:
            return first
    out, into = loop.ports()
    A, B, C, D = well_conditioned(continuous_image(loop.closed((out,), (into,))))
    bound = loop.weight_bound(loop.weight)

    def frozen(low: float, high: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        size = bound(low, high) / level
        return A, B, C * size, D * size

    outcome = prove(
        frozen,
        lambda x: float(loop.rs(np.array([loop.omega_of(x)]))[0]) / level,
        starting_points(loop, A, omega),
        np.inf,
        time_cap=BUDGET,
    )
    return as_certificate(subject, loop, outcome, first.reason)


def on_loop_time(loop: Assembly) -> bool:
    """Whether the weight runs on the time base of the loop."""
    return constant(loop.weight) or timebase(loop.weight) == loop.dt


def sampled_weight(loop: Assembly) -> control.StateSpace | None:
    """A discrete weight proved to cover the continuous one at every frequency up to Nyquist; None if none is close."""
    size = np.abs(np.concatenate([poles(loop.weight), zeros(loop.weight)]))
    size = size[size > 0]
    low = min(size.min(initial=loop.top), loop.top) / 100
    omega = np.geomspace(low, loop.top, 300)
    target = np.abs(response(loop.weight, omega))
    try:
        W = fit_weight(omega, target * (1 + 1e-4), order=min(loop.weight.nstates + 2, 10), dt=loop.dt).W
    except ValueError:
        return None
    above, below = magnitude(loop.weight), magnitude(W).reciprocal()
    low_x, high_x = np.concatenate([[0.0], loop.x_of(omega)]), np.concatenate([loop.x_of(omega), [np.inf]])
    tail = above.upper(loop.omega_of(low_x[-1]), loop.top) * below.upper(low_x[-1], np.inf)
    low_x, high_x = low_x[:-1], high_x[:-1]
    for _ in range(20):
        ratio = above.upper_each(loop.omega_of(low_x), loop.omega_of(high_x)) * below.upper_each(low_x, high_x)
        open_ = ~(ratio <= 1)
        if not open_.any():
            return W if tail <= 1 else None
        if open_.sum() > 3000:
            return None
        low_x, high_x = low_x[open_], high_x[open_]
        middle = (low_x + high_x) / 2
        low_x, high_x = np.concatenate([low_x, middle]), np.concatenate([middle, high_x])
    return None


def prove_performance(loop: Assembly, omega: np.ndarray, *, one_scaling: bool) -> Certificate:
    """|w_P| max |S_p| <= 1 at every frequency: the scaled norm of the two-block loop, interval by interval.

    The scaling between the two blocks is chosen anew on each interval; for an operator perturbation it has to be
    the same one everywhere.
    """
    subject = "robust performance"
    if loop.pade_delay:
        return refused(subject, 1.0, "not attempted with a delay in a continuous loop")
    out, into = loop.ports()
    A, B, C, D = well_conditioned(continuous_image(loop.closed((out, "e"), (into, "r"))))
    bound, bound_P = loop.weight_bound(loop.weight), loop.weight_bound(loop.w_P)

    fixed = best_constant(loop, omega)

    def frozen(low: float, high: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        w, w_P = bound(low, high), bound_P(low, high)
        d = fixed
        if not one_scaling:
            d = scaling(np.abs(loop_matrix(loop, np.array([loop.omega_of(inside(low, high))]))[0]), fixed)
        rows, cols = np.array([[w], [w_P / d]]), np.array([[1.0, d]])
        return A, B * cols, C * rows, D * rows * cols

    def exact(x: float) -> float:
        points = np.array([loop.omega_of(x)])
        if not one_scaling:
            return float(loop.rp(points)[0])
        matrix = loop_matrix(loop, points)[0] * np.array([[1.0, fixed], [1 / fixed, 1.0]])
        return float(np.linalg.norm(matrix, 2))

    outcome = prove(frozen, exact, starting_points(loop, A, omega), np.inf, time_cap=BUDGET)
    return as_certificate(subject, loop, outcome, "")


def scaling(matrix: np.ndarray, usual: float) -> float:
    """The scaling between the two blocks at one frequency.

    It balances the off-diagonal entries; where their product is so small that they do not matter, as at DC under
    integral action, it stays as near to the usual one as they allow, for the sake of the numbers.
    """
    (t, upper), (lower, p) = matrix
    least, most = lower / max(0.1 * (1 - p), 1e-300), 0.1 * (1 - t) / max(upper, 1e-300)
    if 0 < least <= most:
        return float(np.clip(usual, least, most))
    return float(np.sqrt(max(lower, 1e-300) / max(upper, 1e-300)))


def loop_matrix(loop: Assembly, omega: np.ndarray) -> np.ndarray:
    """(W, 2, 2) weighted response from (perturbation, r) to (perturbation, e)."""
    out, into = loop.ports()
    matrices = closed_loop(loop.G, loop.K, (out, "e"), (into, "r"))
    points = np.exp(1j * omega * loop.dt) if loop.dt else 1j * omega
    rows = np.stack([response(loop.weight, omega), response(loop.w_P, omega)], axis=1)
    return evaluate(*matrices, points) * rows[:, :, None]


def best_constant(loop: Assembly, omega: np.ndarray) -> float:
    """The one scaling d that keeps the largest singular value lowest over the grid (convex in log d)."""
    matrices = loop_matrix(loop, omega)

    def largest(log: float) -> float:
        d = np.exp(log)
        return float(np.linalg.svd(matrices * np.array([[1.0, d], [1 / d, 1.0]]), compute_uv=False)[:, 0].max())

    start = np.sqrt(np.abs(matrices[:, 1, 0]).max() / np.abs(matrices[:, 0, 1]).max())
    return float(np.exp(minimize_scalar(largest, bracket=(np.log(start) - 1, np.log(start) + 1)).x))


def starting_points(loop: Assembly, A: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """Where to cut the axis first: around the resonances of the loop."""
    size = np.abs(np.linalg.eigvals(A)) if A.size else np.zeros(0)
    size = size[(size > 0) & np.isfinite(size)]
    x = np.concatenate([size, loop.x_of(omega[[0, omega.size // 2, -1]])])
    x = np.unique(np.concatenate([x / 3, x * 3]))
    keep = [x[0]]
    for point in x[1:]:
        if point > 2 * keep[-1]:
            keep.append(point)
    return np.array(keep)


def delay_allowance(loop: Assembly, omega: np.ndarray) -> float:
    """How much of the level the Padé approximation of the delay may take: a proved bound on |error T|.

    exp(-s delay) = Padé (1 + e) with |e| = |error| on the axis; in every form 1 + b Delta + T e must not vanish.
    """
    A, B, C, D = well_conditioned(continuous_image(loop.closed(("y",), ("r",))))
    T = np.abs(1 - loop.terms(omega)[0])
    guess = 1.5 * float(np.max(loop.delay_error(omega) * T)) + 1e-9

    def frozen(low: float, high: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        size = float(loop.delay_error(np.array([high]))[0]) / guess
        return A, B, C * size, D * size

    def exact(x: float) -> float:
        return float(loop.delay_error(np.array([x]))[0] * np.abs(1 - loop.terms(np.array([x]))[0])[0]) / guess

    outcome = prove(frozen, exact, starting_points(loop, A, omega), np.inf, time_cap=BUDGET)
    return guess if outcome.holds else 1.0


def as_certificate(subject: str, loop: Assembly, outcome: Any, before: str) -> Certificate:
    """An interval proof as a certificate, in rad/s."""
    if outcome.holds:
        intervals = np.array([[loop.omega_of(low), loop.omega_of(high)] for low, high in outcome.intervals])
        return Certificate(
            subject=subject,
            holds=True,
            level=1.0,
            method="Hamiltonian, interval by interval",
            intervals=intervals,
            reason="",
        )
    if np.isfinite(outcome.violated_at):
        return refused(subject, 1.0, f"violated at {hertz(loop.omega_of(outcome.violated_at))}: {outcome.reason}")
    return refused(
        subject, 1.0, "; ".join(part for part in (before, f"interval by interval: {outcome.reason}") if part)
    )
