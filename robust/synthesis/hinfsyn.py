"""H-infinity synthesis: the output-feedback controller of least closed-loop norm, from two Riccati equations.

The bracket on gamma is closed on the existence conditions; what is returned is judged on its own closed loop.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import control
import numpy as np

from nlfrf.shared.arguments import integer, nonnegative, positive, real
from nlfrf.shared.values import value
from robust.certificates.certificate import Certificate
from robust.certificates.closed_loop import certify_closed_loop
from robust.certificates.stability import instability
from robust.synthesis.central import LARGEST_GAMMA, bracket, central, least_level, solved
from robust.synthesis.generalised_plant import (
    Plant,
    controller_of,
    dual,
    hidden_mode,
    normalised,
    prepared,
    zero_on_axis,
)
from robust.synthesis.singular import between_circles
from robust.systems.lft import lower
from robust.systems.norms import hinf_norm
from robust.systems.realisation import multivariable

__all__ = ["Synthesis", "hinfsyn", "synthesise"]


NEAR = 1.03  # gamma over the lower bound of a singular problem that needs no comment
STEPS_UP = (1.0, 1.01, 1.03, 1.1, 1.3, 2.0, 5.0)


@value
class Synthesis:
    """A controller, the norm it reaches, and the bracket on what any controller can reach.

    Fields
    ------
    K : control.StateSpace
        u = K y, positive feedback through P (n_u outputs, n_y inputs); zero where nothing was found.
    gamma : float
        Norm of F_l(P, K), recomputed from the closed loop; inf where that is not stable. With a `certificate` that
        holds the norm is proved to be below it; else it is only what was computed, and the reason says so.
    gamma_min, gamma_low : float
        Least gamma at which the existence conditions were met, and a level that no controller reaches: the largest at
        which they were seen to fail. Where the problem is singular both are that level, of the problem as it was given.
    regularisation : float
        Distance of the circle that took the place of the axis in a singular problem, relative to the slowest pole
        (0: the problem is regular). gamma is the norm without it.
    n_steps : int
        Values of gamma tried.
    reason : str
        Why nothing, or less than asked for, was found, or gamma is not certified; empty otherwise.
    certificate : Certificate or None
        The proof of gamma, from P and K as they are given, or why there is none; None where nothing was found.

    References
    ----------
    Doyle, Glover, Khargonekar & Francis 1989.

    Examples
    --------
    >>> P = control.StateSpace([[-1.0]], [[1.0, 1.0]], [[1.0], [0.0], [1.0]], [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0]])
    >>> found = hinfsyn(P, 1, 1)
    >>> bool(found.gamma_low <= found.gamma_min <= found.gamma < np.inf), found.reason
    (True, '')
    """

    K: control.StateSpace
    gamma: float
    gamma_min: float
    gamma_low: float
    regularisation: float
    n_steps: int
    reason: str
    certificate: Certificate | None = None

    @property
    def certified(self) -> bool:
        """Whether gamma is proved to be a bound on the norm."""
        return self.certificate is not None and self.certificate.holds

    @property
    def found(self) -> bool:
        """Whether K stabilises the loop, beyond rounding."""
        return bool(np.isfinite(self.gamma))


def hinfsyn(
    P: Any,
    n_y: int,
    n_u: int,
    *,
    gamma_min: float = 0.0,
    tolerance: float = 1e-4,
    factor: float = 1.01,
    time_cap: float = 10.0,
) -> Synthesis:
    """The controller that makes the norm from w to z of a plant with weights as small as it can be.

    Parameters
    ----------
    P : control.StateSpace
        Generalised plant from (w, u) to (z, y), continuous or discrete, weights inside.
    n_y, n_u : int
        How many of its last outputs are measured, how many of its last inputs are controlled.
    gamma_min : float
        Level that is good enough: nothing better is looked for.
    tolerance : float
        Relative width to which the bracket on gamma is closed.
    factor : float
        gamma of the controller over the least one, at least 1: at the least one itself it is singular.
    time_cap : float
        Seconds; the best found by then is returned. The proof of its gamma may take a quarter of that beyond.

    Returns
    -------
    Synthesis
        Where no controller was found K is zero, gamma is inf and the reason is stated. gamma is certified, or said not
        to be.

    Raises
    ------
    ValueError
        Sizes that do not fit, or a plant that no controller can stabilise through u and y (it names the mode).

    Notes
    -----
    Where D12 or D21 lacks rank, or a zero of P12 or P21 lies on the stability boundary (an integrating plant in a
    mixed-sensitivity problem), the problem is singular: its infimum is approached and not reached. Circles on either
    side of the axis then take its place, closing in on it: controllers from the outside, a lower bound from the inside.
    Where more than 3 % is left between the two, the reason says so.

    References
    ----------
    Doyle, Glover, Khargonekar & Francis 1989; Glover & Doyle 1988 and Zhou, Doyle & Glover 1996, Theorem
    17.1 (with D11); Chiang & Safonov 1992 (circles in place of the axis).

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
    deadline = time.monotonic() + positive("time_cap", time_cap)
    options = {"gamma_min": gamma_min, "tolerance": tolerance, "factor": factor, "time_cap": time_cap}
    return certified(P, synthesise(P, n_y, n_u, **options), max(deadline - time.monotonic(), time_cap / 4))


def certified(P: control.StateSpace, found: Synthesis, time_cap: float) -> Synthesis:
    """The same with gamma proved, or the reason why it is not."""
    if not found.found:
        return found
    proof = certify_closed_loop(P, found.K, found.gamma, subject="norm of the closed loop", time_cap=time_cap)
    said = "; ".join(
        part for part in (found.reason, "" if proof.holds else f"gamma is not certified: {proof.reason}") if part
    )
    return replace(found, gamma=proof.level, certificate=proof, reason=said)


def synthesise(
    P: control.StateSpace,
    n_y: int,
    n_u: int,
    *,
    gamma_min: float = 0.0,
    tolerance: float = 1e-4,
    factor: float = 1.01,
    time_cap: float = 10.0,
) -> Synthesis:
    """`hinfsyn` without the proof of gamma, for who judges the loop by something else."""
    n_y, n_u = integer("n_y", n_y, least=1), integer("n_u", n_u, least=1)
    gamma_min, tolerance = nonnegative("gamma_min", gamma_min), positive("tolerance", tolerance)
    factor, time_cap = real("factor", factor), positive("time_cap", time_cap)
    if factor < 1:
        raise ValueError(f"factor must be at least 1, got {factor:g}")
    if P.noutputs <= n_y or P.ninputs <= n_u:
        raise ValueError(
            f"P must have more than n_y = {n_y} outputs and n_u = {n_u} inputs, got {P.noutputs} and {P.ninputs}"
        )
    deadline = time.monotonic() + time_cap
    plant = prepared(P, n_y, n_u)
    hidden = hidden_mode(plant)
    if hidden:
        raise ValueError(f"P must be one that a controller can stabilise, got one where {hidden}")
    nothing = control.StateSpace([], [], [], np.zeros((n_u, n_y)), P.dt)
    best = Synthesis(
        K=nothing, gamma=np.inf, gamma_min=np.inf, gamma_low=0.0, regularisation=0.0, n_steps=0, reason="no time"
    )
    problem = normalised(plant)
    if problem is not None and not (zero_on_axis(problem) or zero_on_axis(dual(problem))):
        best = synthesised(P, problem, best, (gamma_min, tolerance, factor), deadline)
    if best.found or time.monotonic() > deadline:
        return best
    return without_axis(P, plant, best, (gamma_min, factor), deadline)


def without_axis(
    P: control.StateSpace, plant: Plant, nothing: Synthesis, wanted: tuple[float, float], deadline: float
) -> Synthesis:
    """The best controller of a singular problem, with a lower bound of the problem itself."""
    found = between_circles(P, plant, *wanted, deadline)
    if found.K is None:
        why = "the time cap was reached" if found.late else "no level met the existence conditions, however regularised"
        return replace(nothing, n_steps=nothing.n_steps + found.n_steps, reason=why)
    low = min(found.low, found.gamma)
    reason = ""
    if found.gamma > NEAR * low and found.gamma > wanted[0]:
        why = "the time cap was reached" if found.late else "the problem is singular"
        reason = f"{why}: gamma {found.gamma:.4g} was reached, and below {low:.4g} there is nothing"
    return replace(
        nothing,
        K=found.K,
        gamma=found.gamma,
        gamma_min=low,
        gamma_low=low,
        regularisation=found.size,
        n_steps=nothing.n_steps + found.n_steps,
        reason=reason,
    )


def better(a: Synthesis, b: Synthesis) -> Synthesis:
    """The one with the smaller norm, the later one where neither has one."""
    return a if a.gamma < b.gamma else b


def synthesised(
    P: control.StateSpace,
    problem: Plant,
    nothing: Synthesis,
    wanted: tuple[float, float, float],
    deadline: float,
) -> Synthesis:
    """The best controller of one regular problem, judged on P itself; `nothing` with the reason where none is good."""
    enough, tolerance, factor = wanted
    ends = least_level(problem), np.inf
    low, high, n_steps = bracket(lambda gamma: solved(problem, gamma), ends, tolerance, deadline, enough=enough)
    best = replace(nothing, gamma_low=low, gamma_min=high, n_steps=nothing.n_steps + n_steps)
    late = time.monotonic() > deadline
    if not np.isfinite(high):
        what = (
            "the time cap was reached" if late else f"no level up to {LARGEST_GAMMA:.0e} met the existence conditions"
        )
        return replace(best, reason=what)
    best = replace(best, reason="the loop with the controller of the Riccati equations is not stable")
    for step in STEPS_UP:
        gamma = high * factor * step
        try:
            K = controller_of(problem, central(problem, solution)) if (solution := solved(problem, gamma)) else None
            closed = lower(P, K) if K else None
        except (ValueError, np.linalg.LinAlgError):
            continue
        if K is None or not instability(closed).stable:
            continue
        achieved = hinf_norm(closed)[0]
        reason = "" if achieved <= gamma * 1.001 else f"the norm reached is above the level {gamma:.4g} asked for"
        if late:
            reason = f"the time cap was reached with gamma between {low:.4g} and {high:.4g}"
        best = better(best, replace(best, K=K, gamma=achieved, reason=reason))
        if achieved <= gamma * 1.001 or time.monotonic() > deadline:
            break
    return best
