"""Crossover, phase and gain margin and bandwidth from the loop gain; singular values of a loop;
step responses.
"""

from __future__ import annotations

from dataclasses import replace

import control
import numpy as np

from nlfrf._base.arguments import (
    format_hertz,
    require_integer,
    require_nonnegative,
    require_positive,
    require_real_array,
)
from nlfrf._base.values import value
from robust._base.types import AnySystem, Controller, LinearSystem
from robust.lti.connections import closed_loop, lower_lft
from robust.lti.grids import NO_PEAK, Peak, structure_grid
from robust.lti.lti import (
    evaluate_transfer,
    is_constant,
    is_stable,
    response,
    response_by_channel,
    timebase,
    to_s_plane,
)
from robust.lti.realisation import multivariable, state_space
from robust.lti.sampling import delayed, sampled
from robust.pages.section import Fact

_BETWEEN = 8  # subdivisions between two frequencies of the grid of a system
#: Usual limit of |S| over a set; it leaves a phase margin of 29 deg and a gain margin of 2 (SP
#: 2.4.3).
USUAL_PEAK = 2.0
#: Phase margin [deg] below which a loop is close to instability (SP 2.4.3).
USUAL_PHASE_MARGIN = 30.0
# |Im L| over |L| below which the last point, just below Nyquist, counts as real
_REAL_TOLERANCE = 1e-6


@value
class ClassicalMargins:
    """Crossover, phase margin, gain margin and bandwidth of a loop; valid for a stable loop only.

    Fields
    ------
    crossovers : tuple of float
        Every frequency with |L| = 1 [rad/s], increasing.
    phase : Peak or None
        Smallest |180 deg + arg L| over all frequencies with |L| = 1 [rad], and its frequency
        [rad/s]; None without crossover.
    delay_margin : float
        Smallest additional delay that puts L on -1, over all frequencies with |L| = 1 [s]; inf
        without crossover.
    gain, reduction : Peak or None
        Smallest factor above one, and largest below one, on the loop gain that puts L on -1, and
        its frequency [rad/s]; None if there is none.
    bandwidth : float
        Lowest frequency at which |S| rises to 1/sqrt(2) [rad/s]; nan if |S| starts above it or
        never reaches it.

    References
    ----------
    SP 2.4.3 (margins), 2.4.5 (bandwidth).

    Examples
    --------
    L = 4/(s + 1)^3: phase crossover at sqrt(3) with |L| = 1/2.

    >>> omega = np.geomspace(1e-2, 1e2, 2000)
    >>> seen = classical_margins(omega, 4 / (1j * omega + 1) ** 3)
    >>> round(seen.gain_margin, 4), round(seen.omega_gain**2, 4)
    (2.0, 3.0)
    """

    crossovers: tuple[float, ...] = ()
    phase: Peak | None = None
    delay_margin: float = float("inf")
    gain: Peak | None = None
    reduction: Peak | None = None
    bandwidth: float = float("nan")

    @property
    def phase_margin(self) -> float:
        """Smallest |180 deg + arg L| over all frequencies with |L| = 1 [rad]; nan without
        crossover.
        """
        return (self.phase or NO_PEAK).value

    @property
    def omega_phase(self) -> float:
        """Frequency of the phase margin [rad/s]; nan without crossover."""
        return (self.phase or NO_PEAK).omega

    @property
    def gain_margin(self) -> float:
        """Smallest factor above one on the loop gain that puts L on -1; inf if there is none."""
        if self.gain is None:
            return float("inf")
        return self.gain.value

    @property
    def omega_gain(self) -> float:
        """Frequency of the gain margin [rad/s]; nan if no factor puts L on -1."""
        return (self.gain or NO_PEAK).omega

    @property
    def gain_reduction(self) -> float:
        """Largest factor below one on the loop gain that puts L on -1; 0 if there is none."""
        if self.reduction is None:
            return 0.0
        return self.reduction.value

    @property
    def omega_reduction(self) -> float:
        """Frequency of the gain reduction [rad/s]; nan if no factor puts L on -1."""
        return (self.reduction or NO_PEAK).omega

    @property
    def crossover(self) -> float:
        """Highest frequency with |L| = 1 [rad/s]; nan without crossover."""
        if self.crossovers:
            return self.crossovers[-1]
        return float("nan")

    @property
    def facts(self) -> tuple[Fact, ...]:
        """Crossover, margins and bandwidth as lines of a report."""
        high, low = (
            20 * np.log10(gain or np.nan) for gain in (self.gain_margin, self.gain_reduction)
        )
        return (
            Fact(
                "crossovers" if len(self.crossovers) > 1 else "crossover",
                ", ".join(map(format_hertz, self.crossovers)) or "none: |L| never crosses one",
            ),
            Fact(
                "phase margin",
                Peak(np.degrees(self.phase_margin), self.omega_phase),
                "deg",
                f"customary are {USUAL_PHASE_MARGIN:g} deg or more",
            ),
            Fact("gain margin", Peak(high, self.omega_gain), "dB", "allowed rise of the gain"),
            Fact(
                "lower gain margin",
                Peak(low, self.omega_reduction),
                "dB",
                "allowed fall of the gain",
            ),
            Fact(
                "bandwidth of S",
                self.bandwidth / (2 * np.pi),
                "Hz",
                "disturbances below it are reduced",
            ),
        )

    def __str__(self) -> str:
        return ", ".join(str(fact) for fact in self.facts if fact.amount)


def classical_margins(
    omega: np.ndarray | AnySystem, L: np.ndarray | None = None
) -> ClassicalMargins:
    """Return gain margin, phase margin and bandwidth of a loop, from L as a system or as values.

    Use this for a quick comparison with other tools. The report of `check` contains these margins,
    too (`RobustnessReport.classical`).

    Parameters
    ----------
    omega : (W,) ndarray, or control system
        Frequencies [rad/s], increasing and dense; or the loop gain L = G K as a system, for which
        the frequencies are chosen automatically.
    L : (W,) complex ndarray, optional
        Loop gain at these frequencies; values that are not finite are ignored.

    Returns
    -------
    ClassicalMargins
        The margins, computed by linear interpolation of log |L| and phase over log frequency.

    Raises
    ------
    ValueError
        Arrays of different sizes, frequencies that do not increase.

    References
    ----------
    SP 2.4.3 (margins), 2.4.5 (bandwidth).

    Examples
    --------
    >>> omega = np.geomspace(1e-2, 1e2, 2000)
    >>> seen = classical_margins(omega, 2 / (1j * omega * (1j * omega + 1)))
    >>> round(float(np.degrees(seen.phase_margin)), 1)                # 90 deg - atan(1.2496)
    38.7
    >>> print(classical_margins(control.tf([2], [1, 1, 0])))
    crossover 0.1989 Hz, phase margin 38.67 deg at 0.1989 Hz, gain margin infinite, bandwidth of S
      0.1333 Hz
    """
    if L is None:
        omega, L = _loop_gain_of(omega)
    else:
        omega, L = _check_loop_gain(omega, L)
    known = np.isfinite(L) & (L != 0)
    x, L = np.log(omega[known]), L[known]
    if x.size < 2:
        return ClassicalMargins()
    size, phase = np.log(np.abs(L)), np.unwrap(np.angle(L))
    found = ClassicalMargins()
    at = _zero_crossings(x, size)
    if at.size:
        off = np.interp(at, x, phase)
        margin = np.abs((off + 2 * np.pi) % (2 * np.pi) - np.pi)
        k = int(np.argmin(margin))
        found = replace(
            found,
            crossovers=tuple(np.exp(at).tolist()),
            phase=Peak(float(margin[k]), float(np.exp(at[k]))),
            delay_margin=float(((off + np.pi) % (2 * np.pi) / np.exp(at)).min()),
        )
    turns = np.arange(
        np.ceil((phase.min() / np.pi - 1) / 2), np.floor((phase.max() / np.pi - 1) / 2) + 1
    )
    real = [_zero_crossings(x, phase - (2 * n + 1) * np.pi) for n in turns]
    if abs(L[-1].imag) < _REAL_TOLERANCE * abs(L[-1]) and L[-1].real < 0:
        real.append(x[-1:])
    at = np.unique(np.concatenate([np.zeros(0), *real]))
    factor = np.exp(-np.interp(at, x, size))
    found = replace(
        found,
        gain=_nearest_to_one(factor, at, factor > 1),
        reduction=_nearest_to_one(factor, at, factor < 1),
    )
    S = np.log(np.abs(1 / (1 + L))) + np.log(2) / 2
    reached = _zero_crossings(x, S)
    if S[0] < 0 and reached.size:
        return replace(found, bandwidth=float(np.exp(reached[0])))
    return found


def _nearest_to_one(factor: np.ndarray, x: np.ndarray, side: np.ndarray) -> Peak | None:
    """Return the factor (n,) nearest to one on one side of it, with its frequency exp x; None if
    there is none on this side.
    """
    if not side.any():
        return None
    k = np.flatnonzero(side)[np.argmin(np.abs(np.log(factor[side])))]
    return Peak(float(factor[k]), float(np.exp(x[k])))


def _loop_gain_of(L: object) -> tuple[np.ndarray, np.ndarray]:
    """Return the response of a system with one channel, on a grid dense around its poles and those
    of its loop.
    """
    if isinstance(L, control.FrequencyResponseData):
        return _check_loop_gain(np.asarray(L.omega), np.squeeze(np.asarray(L.frdata)))
    system = state_space("L", L)
    dt, one = timebase(system), control.StateSpace([], [], [], [[1.0]], None)
    closed = control.StateSpace(*closed_loop(system, one, ("e",), ("r",)), dt)
    grid = np.log(np.union1d(structure_grid(system)[1:], structure_grid(closed)[1:]))
    omega = np.exp(
        np.interp(np.arange(0, grid.size - 1 + 1e-9, 1 / _BETWEEN), np.arange(grid.size), grid)
    )
    if dt:
        omega = np.unique(np.minimum(omega, np.pi / dt * (1 - 1e-9)))
    return omega, response(system, omega)


def _check_loop_gain(omega: np.ndarray, L: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies and loop gain as arrays of one size; refuse others."""
    omega, L = require_real_array("omega", omega, ndim=1), np.asarray(L)
    if L.shape != omega.shape or L.dtype.kind not in "iufc":
        raise ValueError(
            f"L must have one number for each frequency, shape ({omega.size},), got {L.dtype}"
            f" of shape {L.shape}"
        )
    if omega.size and not (omega[0] > 0 and np.all(np.diff(omega) > 0)):
        raise ValueError("omega must be positive and increase")
    return omega, L


def _zero_crossings(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the zeros of a piecewise linear function."""
    k = np.flatnonzero((y[:-1] < 0) != (y[1:] < 0))
    return np.asarray(x[k] + (x[k + 1] - x[k]) * y[k] / (y[k] - y[k + 1]))


# ---- Principal gains of a loop with several inputs and outputs: singular values of L, S, T and K S
# over frequency.


@value
class LoopGains:
    """Singular values of the transfer functions of a nominal loop over frequency, largest first.

    Fields
    ------
    omega : (W,) ndarray
        Frequencies [rad/s].
    L, S, T : (n_y, W) ndarray
        Singular values of L = G K at the plant outputs, of the sensitivity S = (I + L)^-1 and of T
        = I - S.
    K_S : (n, W) ndarray
        Singular values of K S, from the reference to the plant inputs; n is the smaller of n_y and
        n_u.
    stable : bool
        Whether the loop is stable. For an unstable loop the singular values are no amplifications
        of signals.
    band : (2,) ndarray or None
        Lowest and highest of the measured frequencies [rad/s], if any were given.

    References
    ----------
    SP 3.3 (directions), 9.1 (demands on the singular values of a loop).

    Examples
    --------
    >>> lags = control.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2)))
    >>> gains = loop_gains(lags, np.diag([1.0, 3.0]))
    >>> np.round(gains.S[:, 0], 2)                                            # 1/2 and 1/4 at low frequency
    array([0.5 , 0.25])
    """

    omega: np.ndarray
    L: np.ndarray
    S: np.ndarray
    T: np.ndarray
    K_S: np.ndarray
    stable: bool
    band: np.ndarray | None


def loop_gains(G: Controller, K: Controller, *, omega: np.ndarray | None = None) -> LoopGains:
    """Return the singular values of L, S, T and K S of the loop u = K (r - y) over frequency.

    Use this for a loop with several channels, where the gain depends on the direction of the
    signal.

    Parameters
    ----------
    G : control.StateSpace, TransferFunction or (n_y, n_u) ndarray
        Plant.
    K : control.StateSpace, TransferFunction, float or (n_u, n_y) ndarray
        Controller, negative feedback, on the same time base.
    omega : (W,) ndarray, optional
        Measured frequencies [rad/s], which become part of the grid.

    Returns
    -------
    LoopGains
        The singular values on a frequency grid that is dense around every pole of the loop. For a
        sampled loop the grid ends at the Nyquist frequency.

    Raises
    ------
    ValueError
        A K whose channels or sampling time do not fit G.

    References
    ----------
    SP 3.3, 9.1.

    Examples
    --------
    >>> loop_gains(np.eye(2), np.ones((1, 2)))
    Traceback (most recent call last):
        ...
    ValueError: K must have 2 inputs and 2 outputs, one for each output and input of the plant, got 2 and 1
    """
    G, K = multivariable("G", G), multivariable("K", K)
    n_y, n_u = G.noutputs, G.ninputs
    if (K.ninputs, K.noutputs) != (n_y, n_u):
        raise ValueError(
            f"K must have {n_y} inputs and {n_u} outputs, one for each output and input of the"
            f" plant, got {K.ninputs} and {K.noutputs}"
        )
    if G.nstates and K.nstates and timebase(K) != timebase(G):
        raise ValueError(
            f"K must have the sampling time of G, {timebase(G):g} s, got {timebase(K):g} s"
        )
    one = np.eye(n_y)
    e = control.StateSpace(
        G.A,
        np.hstack([np.zeros((G.nstates, n_y)), G.B]),
        np.vstack([-G.C] * 2),
        np.block([[one, -G.D]] * 2),
        G.dt,
    )
    closed = lower_lft(e, K)  # the sensitivity, with all states
    if omega is None:
        lines = np.zeros(0)
    else:
        lines = require_real_array("omega", omega, ndim=1)
    at = np.union1d(structure_grid(closed)[1:], lines)
    if timebase(closed):
        at = at[at * timebase(closed) < np.pi * (1 - 1e-9)]
    plant, controller = (np.moveaxis(response_by_channel(part, at), 2, 0) for part in (G, K))
    L = plant @ controller
    S = np.linalg.inv(one + L)
    sizes = (np.linalg.svd(part, compute_uv=False).T for part in (L, S, one - S, controller @ S))
    return LoopGains(
        omega=at,
        **dict(zip(("L", "S", "T", "K_S"), sizes, strict=True)),
        stable=is_stable(closed),
        band=lines[[0, -1]] if lines.size else None,
    )


# ---- A step of the reference through a loop: overshoot, rise and settling time, output of the
# actuator.

_SETTLING_BAND = 0.02  # of the final value
_MAX_SAMPLES = 60_000  # samples of a sampled loop
_STEPS_PER_RADIAN = 50  # steps of a continuous loop in a radian of its fastest mode
_STEPS_PER_SIZE = 500  # steps before their size doubles


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
    t, x = [np.zeros(1)], [np.zeros((system.nstates, 1))]
    while t[-1][-1] < horizon:
        n = int(np.clip(np.ceil((horizon - t[-1][-1]) / step), 1, _STEPS_PER_SIZE)) + 1
        held = sampled(system, step)
        x.append(_propagate_states(held.A, held.B, x[-1][:, -1], n)[:, 1:])
        t.append(t[-1][-1] + step * np.arange(1, n))
        step *= 2
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
