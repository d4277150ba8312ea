"""A step of the reference through a loop: overshoot, rise and settling time, what the actuator has to give."""

from __future__ import annotations

from typing import Any

import control
import numpy as np
from scipy.linalg import expm

from nlfrf.shared.arguments import nonnegative, positive
from nlfrf.shared.values import value
from robust.systems.closed_loop import closed_loop
from robust.systems.lti import constant, evaluate, in_s, timebase
from robust.systems.realisation import state_space
from robust.systems.sampling import delayed, sampled
from robust.systems.stability import stable

__all__ = ["StepResponse", "simulate_samples", "simulate_step", "step_response"]


DELAY_ORDER = 8
WITHIN = 0.02
LONGEST = 60_000  # samples of a sampled loop
FINE, AT_ONE_STEP = 50, 500  # steps of a continuous loop in a radian of its fastest mode; how many before they double


@value
class StepResponse:
    """What a loop makes of a step of its reference by one unit.

    Fields
    ------
    t : (n,) ndarray
        Time [s]; the sampling instants of a sampled loop.
    y, u : (n,) ndarray
        Output [unit of y] and input of the plant [unit of u], per unit of the step.
    final : float
        Where y goes, from the transfer function; one with an integrator in the loop.
    overshoot : float
        Largest y above `final`, relative to it; zero where it stays below.
    rise_time : float
        From 10 to 90 % of `final` [s].
    settling_time : float
        From when on y stays within 2 % of `final` [s]; nan where it does not within the horizon.

    References
    ----------
    SP 2.4.1.

    Examples
    --------
    >>> step = step_response(control.tf([1], [1, 1]), 9.0)       # T = 9/(s + 10)
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

    def __str__(self) -> str:
        settled = (
            f"within {100 * WITHIN:g} % after {self.settling_time:.3g} s"
            if np.isfinite(self.settling_time)
            else f"not within {100 * WITHIN:g} % after {self.t[-1]:.3g} s"
        )
        return (
            f"goes to {self.final:.4g}, 10 to 90 % in {self.rise_time:.3g} s, overshoot {100 * self.overshoot:.1f} %, "
            f"{settled}"
        )


def step_response(plant: Any, K: Any, *, delay: float = 0.0, duration: float | None = None) -> StepResponse:
    """A step of the reference through the loop u = K (r - y).

    Parameters
    ----------
    plant : control.StateSpace or TransferFunction
        The nominal plant of a model, or the worst one (`worst_case(...).plant`).
    K : control.StateSpace, TransferFunction or float
        Controller. A sampled one sees a continuous plant behind its hold, at the sampling instants, exactly; the delay
        of a continuous loop is a Padé approximation of order 8.
    delay : float
        Computation delay [s].
    duration : float, optional
        Horizon [s]; until y has settled when not given.

    Returns
    -------
    StepResponse

    Raises
    ------
    ValueError
        A loop that is not stable, a negative delay, parts that do not fit each other.

    References
    ----------
    SP 2.4.1.

    Examples
    --------
    >>> step = step_response(control.tf([1], [1, 0.6, 1]), control.tf([0], [1]) + 1)     # zeta 0.3/sqrt(2), omega^2 2
    >>> zeta = 0.3 / np.sqrt(2)
    >>> bool(abs(step.overshoot - np.exp(-np.pi * zeta / np.sqrt(1 - zeta**2))) < 1e-3)
    True
    """
    G, K = state_space("plant", plant), state_space("K", K)
    delay = nonnegative("delay", delay)
    dt = timebase(G) if constant(K) else timebase(K)
    if dt and not timebase(G) and not constant(G):
        G = sampled(G, dt, delay)
    elif delay:
        G = delayed(G, delay, order=DELAY_ORDER)
    A, B, C, D = closed_loop(G, K, ("y", "u"), ("r",))
    loop = control.StateSpace(A, B, C, D, dt)
    if not stable(loop):
        raise ValueError("K must stabilise the plant for a step to go anywhere, got a loop that is not stable")
    final = float(evaluate(A, B, C, D, np.array([1.0 if dt else 0.0]))[0, 0, 0].real)
    t, out = simulate_step(loop, None if duration is None else positive("duration", duration))
    return judged(t, out[0], out[1], final, cut=duration is None)


def simulate_step(system: control.StateSpace, duration: float | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and (outputs, n) of a stable system of one input after a unit step, until it has settled."""
    A, B, C, D, dt = system.A, system.B, system.C, system.D, timebase(system)
    s = in_s(np.linalg.eigvals(A), dt) if A.size else np.zeros(0, complex)
    slow, fast = np.min(-s.real, initial=np.inf), np.max(np.abs(s), initial=0.0)
    horizon = duration if duration is not None else 8 / slow if slow < np.inf else 10 * dt
    if dt:
        t = np.arange(int(np.clip(np.ceil(horizon / dt) + 1, 2, LONGEST))) * dt
        x = states(A, B, np.zeros(A.shape[0]), t.size)
    else:
        t, x = in_growing_steps(A, B, 1 / (FINE * fast) if fast else 1.0, horizon)
    return t, C @ x + D


def simulate_samples(system: control.StateSpace, samples: np.ndarray, fs: float) -> np.ndarray:
    """(outputs, n) of a system of one input that rests before the samples at fs [Hz], each held until the next."""
    A, B, C, D = system.A, system.B, system.C, system.D
    if not timebase(system):
        A, B = held(A, B, 1 / fs)
    x, out = np.zeros(A.shape[0]), np.empty((C.shape[0], samples.size))
    for k, sample in enumerate(samples):
        out[:, k] = C @ x + D[:, 0] * sample
        x = A @ x + B[:, 0] * sample
    return out


def in_growing_steps(A: np.ndarray, B: np.ndarray, step: float, horizon: float) -> tuple[np.ndarray, np.ndarray]:
    """Times and states of a continuous loop, exact, in steps that double: a fast rise and a slow tail are both seen."""
    t, x = [np.zeros(1)], [np.zeros((A.shape[0], 1))]
    while t[-1][-1] < horizon:
        n = int(np.clip(np.ceil((horizon - t[-1][-1]) / step), 1, AT_ONE_STEP)) + 1
        x.append(states(*held(A, B, step), x[-1][:, -1], n)[:, 1:])
        t.append(t[-1][-1] + step * np.arange(1, n))
        step *= 2
    return np.concatenate(t), np.hstack(x)


def held(A: np.ndarray, B: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """The same dynamics over one step, the input held."""
    n = A.shape[0]
    both = np.zeros((n + 1, n + 1))
    both[:n, :n], both[:n, n:] = A, B
    both = expm(both * step)
    return both[:n, :n], both[:n, n:]


def states(A: np.ndarray, B: np.ndarray, x: np.ndarray, n: int) -> np.ndarray:
    """(states, n) of x+ = A x + B from x on, by doubling: what comes after m steps is A^m x and a constant."""
    found, constant_part = x[:, None], B
    while found.shape[1] < n:
        found = np.hstack([found, A @ found + constant_part])
        A, constant_part = A @ A, A @ constant_part + constant_part
    return found[:, :n]


def judged(t: np.ndarray, y: np.ndarray, u: np.ndarray, final: float, *, cut: bool) -> StepResponse:
    """The numbers of a step that was simulated; cut: what lies long after it has settled is left out."""
    size = abs(final)
    relative = y / final if size else np.full(y.size, np.nan)
    out = np.flatnonzero(np.abs(relative - 1) > WITHIN)
    last = int(out[-1]) if out.size else -1
    settled = t[last] + (t[last + 1] - t[last]) if 0 <= last < t.size - 1 else (0.0 if last < 0 else np.nan)
    above = [np.flatnonzero(relative >= level) for level in (0.1, 0.9)]
    rise = t[above[1][0]] - t[above[0][0]] if above[1].size else np.nan
    keep = min(t.size, max(int(1.5 * (last + 2)), 40)) if cut else t.size
    return StepResponse(
        t=t[:keep],
        y=y[:keep],
        u=u[:keep],
        final=final,
        overshoot=float(max(0.0, np.max(relative) - 1)) if size else float("nan"),
        rise_time=float(rise),
        settling_time=float(settled),
    )
