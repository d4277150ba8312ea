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
from robust.synthesis.central import central, least_level, solved
from robust.synthesis.generalised_plant import Plant, controller_of, hidden_mode, normalised, prepared, regularised
from robust.systems.lft import lower
from robust.systems.norms import hinf_norm
from robust.systems.realisation import multivariable
from robust.systems.stability import instability

__all__ = ["Synthesis", "hinfsyn"]


#: What is added where a problem is singular, relative to the scaled plant, and whether to the states too.
REGULARISATIONS = ((0.0, False), (1e-4, False), (1e-4, True), (1e-3, True), (1e-2, True))
LARGEST_GAMMA = 1e10
STEPS_UP = (1.0, 1.01, 1.03, 1.1, 1.3, 2.0, 5.0)


@value
class Synthesis:
    """A controller, the norm it reaches, and the bracket on what any controller can reach.

    Fields
    ------
    K : control.StateSpace
        u = K y, positive feedback through P (n_u outputs, n_y inputs); zero where nothing was found.
    gamma : float
        Norm of F_l(P, K), recomputed from the closed loop; inf where that is not stable.
    gamma_min, gamma_low : float
        Least gamma at which the existence conditions were met, and the largest at which they were seen to fail.
    regularisation : float
        Size of what had to be added to make the problem regular (0: nothing). gamma is the norm without it.
    n_steps : int
        Values of gamma tried.
    reason : str
        Why nothing, or less than asked for, was found; empty otherwise.

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
        Seconds; the best found by then is returned.

    Returns
    -------
    Synthesis
        Where no controller was found K is zero, gamma is inf and the reason is stated.

    Raises
    ------
    ValueError
        Sizes that do not fit, or a plant that no controller can stabilise through u and y (it names the mode).

    Notes
    -----
    Where D12 or D21 lacks rank, or a zero of P12 or P21 lies on the stability boundary (an integrating plant in a
    mixed-sensitivity problem), the problem is singular; small disturbances and outputs are then added.

    References
    ----------
    Doyle, Glover, Khargonekar & Francis 1989; Glover & Doyle 1988 and Zhou, Doyle & Glover 1996, Theorem
    17.1 (with D11).

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
    for size, states in REGULARISATIONS:
        problem = normalised(regularised(plant, size, states=states))
        if problem is None:
            continue
        best = better(best, synthesised(P, problem, best, size, (gamma_min, tolerance, factor), deadline))
        if best.found or time.monotonic() > deadline:
            break
    return best


def better(a: Synthesis, b: Synthesis) -> Synthesis:
    """The one with the smaller norm, the later one where neither has one."""
    return a if a.gamma < b.gamma else b


def synthesised(
    P: control.StateSpace,
    problem: Plant,
    nothing: Synthesis,
    size: float,
    wanted: tuple[float, float, float],
    deadline: float,
) -> Synthesis:
    """The best controller of one regular problem, judged on P itself; `nothing` with the reason where none is good."""
    enough, tolerance, factor = wanted
    low, high, n_steps = bracket(problem, enough, tolerance, deadline)
    best = replace(nothing, gamma_low=low, gamma_min=high, n_steps=nothing.n_steps + n_steps, regularisation=size)
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
        if K is None or instability(closed):
            continue
        achieved = hinf_norm(closed)[0]
        reason = "" if achieved <= gamma * 1.001 else f"the norm reached is above the level {gamma:.4g} asked for"
        if late:
            reason = f"the time cap was reached with gamma between {low:.4g} and {high:.4g}"
        best = better(best, replace(best, K=K, gamma=achieved, reason=reason))
        if achieved <= gamma * 1.001 or time.monotonic() > deadline:
            break
    return best


def bracket(problem: Plant, enough: float, tolerance: float, deadline: float) -> tuple[float, float, int]:
    """Largest level seen to fail, smallest seen to hold (inf: none), and how many were tried."""
    low, high = least_level(problem), np.inf
    n_steps, gamma = 0, max(1.0, 2 * low)
    while time.monotonic() < deadline:
        n_steps += 1
        if solved(problem, gamma):
            high = gamma
        else:
            low = gamma
        if high <= max(low, enough) * (1 + tolerance) or low > LARGEST_GAMMA or high < 1e-9:
            break
        if not np.isfinite(high):
            gamma = low * 4
        else:
            floor = max(low, enough)
            # far from both ends go down by decades; near, halve
            gamma = high / 8 if floor < high / 64 else float(np.sqrt(floor * high))
    return low, high, n_steps
