"""A step of the reference through a loop: overshoot, rise and settling time, output of the
actuator.
"""

from __future__ import annotations

from dataclasses import replace

import control
import numpy as np

from nlfrf._base.arguments import (
    require_integer,
    require_nonnegative,
    require_positive,
)
from nlfrf._base.values import value
from robust._base.types import Controller, LinearSystem
from robust.lti.connections import closed_loop
from robust.lti.lti import (
    evaluate_transfer,
    is_constant,
    is_stable,
    poles,
    timebase,
    to_s_plane,
)
from robust.lti.realisation import multivariable
from robust.lti.sampling import delayed, sampled
from robust.pages.section import Fact

_SETTLING_BAND = 0.02  # of the final value
_MAX_SAMPLES = 60_000  # samples of a sampled loop; steps of a continuous one that rings
_STEPS_PER_RADIAN = 50  # steps of a continuous loop in a radian of its fastest mode
_STEPS_PER_SIZE = 500  # steps before their size doubles
# Largest step in radians of a mode that still rings, up to the largest number of samples; and the
# part of its beginning at which a mode has faded.
_LARGEST_STEP, _FADED = 0.4, 1e-3


@value
class StepResponse:
    """Response of a loop to a unit step of its reference.

    Fields
    ------
    t : (n,) ndarray
        Time [s]; the sampling instants of a sampled loop.
    y, u : (n,) or (n_y, n), (n_u, n) ndarray
        Outputs [unit of y] and inputs of the plant [unit of u], per unit of the step.
    final : float
        Final value of y, from the transfer function; one with an integrator in the loop.
    overshoot : float
        Largest y above `final`, relative to `final`; zero if y stays below.
    rise_time : float
        Time from 10 to 90 % of `final` [s].
    settling_time : float
        Time after which y stays within 2 % of `final` [s]; nan if this is not reached in the
        simulated time.
    reference : int
        For several outputs: the output whose reference steps, counted from 0.
    worst : StepResponse or None
        For a set: the response with the plant of the set that has the largest |S|; None if a plant
        of the set makes the loop unstable.

    References
    ----------
    SP 2.4.1.

    Examples
    --------
    >>> step = step_of_plant(control.tf([1], [1, 1]), 9.0)       # T = 9/(s + 10)
    >>> round(step.final, 9), round(step.rise_time, 3), round(step.settling_time, 3)
    (0.9, 0.22, 0.392)
    """

    t: np.ndarray
    y: np.ndarray
    u: np.ndarray
    final: float
    overshoot: float
    rise_time: float
    settling_time: float
    reference: int = 0
    worst: StepResponse | None = None

    @property
    def facts(self) -> tuple[Fact, ...]:
        """Final value, rise time, overshoot and settling time."""
        settled = np.isfinite(self.settling_time)
        return (
            Fact("goes to", self.final),
            Fact("10 to 90 % in", self.rise_time, "s"),
            Fact("overshoot", f"{100 * self.overshoot:.1f}", "%"),
            Fact(
                f"{'' if settled else 'not '}within {100 * _SETTLING_BAND:g} % after",
                self.settling_time if settled else float(self.t[-1]),
                "s",
            ),
        )

    def __str__(self) -> str:
        own = ", ".join(map(str, self.facts))
        if self.worst is None:
            return own
        return f"nominal plant: {own}\nworst plant: {self.worst}"


def step_of_plant(
    plant: LinearSystem,
    K: Controller,
    *,
    delay: float = 0.0,
    duration: float | None = None,
    reference: int = 0,
) -> StepResponse:
    """Simulate a step in one reference through the loop with one plant; see `step_response`."""
    G, K = multivariable("plant", plant), multivariable("K", K)
    delay, j = require_nonnegative("delay", delay), require_integer("reference", reference, least=0)
    n_y = G.noutputs
    if j >= n_y:
        raise ValueError(f"reference must be below the {n_y} outputs of the plant, got {j}")
    if is_constant(K):
        dt = timebase(G)
    else:
        dt = timebase(K)
    if dt and not timebase(G) and not is_constant(G):
        G = sampled(G, dt, delay)
    elif delay:
        G = delayed(G, delay)
    A, B, C, D = closed_loop(G, K, ("y", "u"), ("r",))
    loop = control.StateSpace(A, B[:, [j]], C, D[:, [j]], dt)
    if not is_stable(loop):
        raise ValueError(
            "K must stabilise the plant, because only a stable loop has a step response, got a"
            " loop that is not stable"
        )
    final = float(evaluate_transfer(A, B, C, D, np.array([1.0 if dt else 0.0]))[0, j, j].real)
    t, out = simulate_step(
        loop, None if duration is None else require_positive("duration", duration)
    )
    step = measure_step(t, out[j], u=out[n_y], final=final, cut=duration is None)
    kept = step.t.size
    if out.shape[0] == 2:
        return step
    return replace(step, y=out[:n_y, :kept], u=out[n_y:, :kept], reference=j)


def simulate_step(
    system: control.StateSpace, duration: float | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Simulate a unit step of a stable system with one input until it has settled: times [s] and
    (outputs, n).
    """
    A, B, C, D, dt = system.A, system.B, system.C, system.D, timebase(system)
    if A.size:
        s = to_s_plane(np.linalg.eigvals(A), dt)
    else:
        s = np.zeros(0, complex)
    slow, fast = np.min(-s.real, initial=np.inf), np.max(np.abs(s), initial=0.0)
    horizon = duration
    if horizon is None:
        if slow < np.inf:
            horizon = 8 / slow
        else:
            horizon = 10 * dt
    if dt:
        t = np.arange(int(np.clip(np.ceil(horizon / dt) + 1, 2, _MAX_SAMPLES))) * dt
        x = _propagate_states(A, B, np.zeros(A.shape[0]), t.size)
    else:
        t, x = _simulate_in_growing_steps(
            system, step=1 / (_STEPS_PER_RADIAN * fast) if fast else 1.0, horizon=horizon
        )
    return t, C @ x + D


def _simulate_in_growing_steps(
    system: control.StateSpace, *, step: float, horizon: float
) -> tuple[np.ndarray, np.ndarray]:
    """Simulate a step of a continuous loop exactly, in growing steps that resolve a fast rise and a
    slow tail.
    """
    t, x, p = [np.zeros(1)], [np.zeros((system.nstates, 1))], poles(system)
    held, n_steps = sampled(system, step), 0
    while t[-1][-1] < horizon:
        n = int(np.clip(np.ceil((horizon - t[-1][-1]) / step), 1, _STEPS_PER_SIZE)) + 1
        x.append(_propagate_states(held.A, held.B, x[-1][:, -1], n)[:, 1:])
        t.append(t[-1][-1] + step * np.arange(1, n))
        n_steps += n - 1
        rings = np.exp(p.real * t[-1][-1]) > _FADED
        fastest = np.abs(p.imag[rings]).max(initial=0.0)
        if 2 * step * fastest <= _LARGEST_STEP or n_steps > _MAX_SAMPLES:
            step *= 2
            held = sampled(system, step)
    return np.concatenate(t), np.hstack(x)


def _propagate_states(A: np.ndarray, B: np.ndarray, x: np.ndarray, n: int) -> np.ndarray:
    """Return the states (states, n) of x+ = A x + B from x on, by doubling: x after m steps is A^m
    x + constant.
    """
    found, constant_part = x[:, None], B
    while found.shape[1] < n:
        found = np.hstack([found, A @ found + constant_part])
        A, constant_part = A @ A, A @ constant_part + constant_part
    return found[:, :n]


def measure_step(
    t: np.ndarray, y: np.ndarray, *, u: np.ndarray, final: float, cut: bool
) -> StepResponse:
    """Measure overshoot, rise and settling time of a simulated step; `cut` removes the end, long
    after settling.
    """
    size = abs(final)
    if size:
        relative = y / final
    else:
        relative = np.full(y.size, np.nan)
    out = np.flatnonzero(np.abs(relative - 1) > _SETTLING_BAND)
    if out.size:
        last = int(out[-1])
    else:
        last = -1
    settled = np.nan  # outside the band at the end of the simulation
    if last < 0:
        settled = 0.0
    elif last < t.size - 1:
        settled = t[last] + (t[last + 1] - t[last])
    above = [np.flatnonzero(relative >= level) for level in (0.1, 0.9)]
    if above[1].size:
        rise = t[above[1][0]] - t[above[0][0]]
    else:
        rise = np.nan
    if cut:
        keep = min(t.size, max(int(1.5 * (last + 2)), 40))
    else:
        keep = t.size
    return StepResponse(
        t=t[:keep],
        y=y[:keep],
        u=u[:keep],
        final=final,
        overshoot=float(max(0.0, np.max(relative) - 1)) if size else float("nan"),
        rise_time=float(rise),
        settling_time=float(settled),
    )
