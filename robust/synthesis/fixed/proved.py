"""The stiffest PID, with a notch or not, with which a machine is still proved to come to rest with every friction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias, TypeVar

import control
import numpy as np
from scipy.optimize import minimize

from nlfrf._base.arguments import (
    format_hertz,
    require_choice,
    require_integer,
    require_nonnegative,
    require_positive,
    short_form,
)
from nlfrf._base.values import value
from robust.friction.classes import AnyFriction
from robust.friction.levels import FrictionClass, machines_of
from robust.friction.plant import FrictionPlant
from robust.friction.prove import FrictionProof, prove_friction
from robust.lti.connections import in_series
from robust.lti.lti import response
from robust.lti.realisation import from_roots, state_space
from robust.lti.sampling import discretize, sampled

__all__ = ["Proved", "ProvedDesign", "design_proved", "largest_proved_gain"]

BISECTION_RATIO = 1.03  # ratio of the two gains where a bisection stops
MAX_GAIN_RATIO = 256.0  # times the gain that was given, up and down
GAIN_STEP = 2.0
N_FREQUENCIES = 400  # of the frequencies at which |S| is looked at


#: What a controller is proved for: a class of friction with its machines, or one machine and a class.
Proved: TypeAlias = FrictionClass | tuple[FrictionPlant, AnyFriction]


@value
class ProvedDesign:
    """A controller with which a machine comes to rest with every friction of a class, and how far it goes.

    Fields
    ------
    K : control.StateSpace
        The controller, u = K (r - y), sampled.
    parameters : tuple of float
        Kp [N/m], Ki [N/ms], Kd [Ns/m].
    bandwidth : float
        Up to which |S| stays below 1/sqrt(2) [rad/s], whether the machine slides or sticks on the whole K0.
    peak : float
        Largest |S| of the two.
    proofs : tuple of FrictionProof
        One for each machine that was given, all "proved".
    n_proofs : int
        How many were tried on the way.

    References
    ----------
    J. A. Nelder, R. Mead, *A simplex method for function minimization*, Computer Journal 7, 1965.

    Examples
    --------
    >>> from robust import any_maxwell_slip, design_proved, friction_plant
    >>> machine, friction = friction_plant(1.0, 80e3), any_maxwell_slip(64e3)
    >>> found = design_proved(machine, friction, dt=1e-3, structure="PD", n_iterations=0)
    >>> found.proofs[0].verdict, bool(found.bandwidth >= 0)
    ('proved', True)
    """

    K: control.StateSpace
    parameters: tuple[float, float, float]
    bandwidth: float
    peak: float
    proofs: tuple[FrictionProof, ...]
    n_proofs: int

    def __str__(self) -> str:
        Kp, Ki, Kd = self.parameters
        return (
            f"Kp = {Kp:.4g} N/m, Ki = {Ki:.4g} N/ms, Kd = {Kd:.4g} Ns/m: |S| below -3 dB up to "
            f"{format_hertz(self.bandwidth)}, sliding or stuck, at most {self.peak:.3g}; {self.n_proofs} proofs tried."
            f"\n{self.proofs[0]}"
        )


def design_proved(
    machine: FrictionPlant | FrictionClass,
    friction: AnyFriction | None = None,
    *,
    dt: float,
    structure: str = "PID",
    delay: float = 0.0,
    M_S: float = 2.0,
    notch: float | None = None,
    start: tuple[float, float, float] | None = None,
    n_iterations: int = 30,
) -> ProvedDesign:
    """Return the widest band of a PID or PD with which a machine is still proved to come to rest with every friction.

    The gain is raised until a proof fails or |S| exceeds M_S, by bisection; the shape (Ki over Kp, Kd over Kp) is
    searched for without derivatives. A local search: the start matters.

    Parameters
    ----------
    machine : FrictionPlant, or FrictionClass
        The linear part; a class read from levels brings its machines, each of which is proved, and its friction.
    friction : AnyFriction, optional
        `any_maxwell_slip`; not given with a FrictionClass.
    dt : float
        Sampling time of the controller [s].
    structure : str
        "PID" or "PD".
    delay : float
        Computation delay [s].
    M_S : float
        Largest |S| allowed, sliding and stuck.
    notch : float, optional
        Frequency of a notch of a tenth in series [rad/s].
    start : (Kp, Ki, Kd), optional
        Whose shape to begin with; from the resonance of the machine when not given.
    n_iterations : int
        Of the search over shapes; zero: the gain alone.

    Returns
    -------
    ProvedDesign

    Raises
    ------
    ValueError
        No gain of the first shape is proved, no class of friction, numbers out of range.

    References
    ----------
    A. Rantzer, Int. J. Robust Nonlinear Control 11, 2001 (the proof); J. A. Nelder, R. Mead, Computer Journal 7, 1965.

    Examples
    --------
    >>> from robust import any_maxwell_slip, friction_plant
    >>> rig = friction_plant(1.0, 80e3)
    >>> found = design_proved(rig, any_maxwell_slip(64e3), dt=1e-3, n_iterations=0)     # the gain alone
    >>> bool(1.5 < found.bandwidth < 2.0), bool(1.9 < found.peak < 2)
    (True, True)
    """
    machines, friction = machines_of(machine, friction)
    dt, delay, M_S = require_positive("dt", dt), require_nonnegative("delay", delay), require_positive("M_S", M_S)
    require_choice("structure", structure, ("PID", "PD"))
    task = ProofSearch(
        machines=machines, friction=friction, dt=dt, delay=delay, M_S=M_S, factor=sampled_notch(notch, dt)
    )
    shape = initial_gains(machines[0], friction.K0) if start is None else np.array(start, float)
    if structure == "PD":
        shape[1] = 0.0
    if np.any(shape < 0) or not shape[2] > 0:
        raise ValueError(f"start must hold Kp, Ki >= 0 and Kd > 0, got {short_form(tuple(shape))}")
    tried = Tried()
    free = [i for i in (0, 1) if shape[i] > 0]

    def missed(theta: np.ndarray) -> float:
        candidate = shape.copy()
        candidate[free] *= np.exp(theta)
        return task.negative_log_bandwidth(candidate, tried)

    missed(np.zeros(len(free)))
    if tried.best is None:
        raise ValueError(f"start must have a gain that is proved, got none for {short_form(tuple(shape))}. Damp more")
    if require_integer("n_iterations", n_iterations, least=0):
        simplex = np.vstack([np.zeros(len(free)), 0.5 * np.eye(len(free))])
        options = {"maxfev": n_iterations, "initial_simplex": simplex, "xatol": 0.02, "fatol": 0.01}
        minimize(missed, np.zeros(len(free)), method="Nelder-Mead", options=options)
    return replace(tried.best, n_proofs=tried.n)


@dataclass
class Tried:
    """What a search has seen so far: how many proofs, the last gain that was proved, the best controller."""

    n: int = 0
    gain: float = 1.0
    best: ProvedDesign | None = None


@value(copy=False)
class ProofSearch:
    """What every candidate is held against."""

    machines: tuple[FrictionPlant, ...]
    friction: AnyFriction
    dt: float
    delay: float
    M_S: float
    factor: control.StateSpace

    def negative_log_bandwidth(self, shape: np.ndarray, tried: Tried) -> float:
        """Minus the log bandwidth of the largest proved gain of a shape; the best one is kept."""
        K = in_series(sampled_pid(shape, self.dt), self.factor)

        def allowed(g: float) -> tuple[FrictionProof, ...] | None:
            if self.evaluate(g * K)[1] > self.M_S:
                return None
            tried.n += 1
            return all_proved(g * K, self.machines, friction=self.friction, delay=self.delay)

        g, proofs = largest_allowed_gain(allowed, tried.gain)
        if proofs is None:
            return 50.0
        tried.gain = g
        bandwidth, peak = self.evaluate(g * K)
        if tried.best is None or bandwidth > tried.best.bandwidth:
            Kp, Ki, Kd = (float(g * part) for part in shape)
            tried.best = ProvedDesign(
                K=g * K, parameters=(Kp, Ki, Kd), bandwidth=bandwidth, peak=peak, proofs=proofs, n_proofs=tried.n
            )
        return -float(np.log(max(bandwidth, 1e-6)))

    def evaluate(self, K: control.StateSpace) -> tuple[float, float]:
        """Bandwidth and largest |S| over the machines, sliding and stuck; 0 and inf where one is unstable."""
        omega = np.geomspace(1e-4, 1, N_FREQUENCIES) * np.pi / self.dt * 0.999
        band, peak = np.inf, 0.0
        for machine in self.machines:
            for spring in (0.0, self.friction.K0):
                A = machine.A - spring * np.outer(machine.B_port, machine.C_port)
                plant = sampled(
                    control.StateSpace(A, machine.B_force[:, None], machine.C_measured[None, :], 0),
                    self.dt,
                    self.delay + machine.delay,
                )
                S = np.abs(1 / (1 + response(plant, omega) * response(K, omega)))
                band = min(band, first_crossing(omega, S, np.sqrt(0.5)))
                peak = max(peak, float(S.max()))
        return band, peak


def first_crossing(omega: np.ndarray, S: np.ndarray, level: float) -> float:
    """The frequency at which |S| first passes a level, straight over logarithms between; 0 where it begins above."""
    above = np.flatnonzero(level < S)
    if not above.size:
        return float(omega[-1])
    i = int(above[0])
    if not i:
        return 0.0
    share = np.log(level / S[i - 1]) / np.log(S[i] / S[i - 1])
    return float(omega[i - 1] * (omega[i] / omega[i - 1]) ** share)


def largest_proved_gain(
    K: control.StateSpace, machines: tuple[FrictionPlant, ...], *, friction: AnyFriction, delay: float
) -> tuple[float, tuple[FrictionProof, ...] | None]:
    """Up to one: the largest gain of a controller that is proved, with its proofs; 0 and None where none is."""
    whole = all_proved(K, machines, friction=friction, delay=delay)
    if whole is not None:
        return 1.0, whole
    return largest_allowed_gain(
        lambda g: all_proved(g * K, machines, friction=friction, delay=delay) if g < 1 else None, 1 / GAIN_STEP
    )


def all_proved(
    K: control.StateSpace, machines: tuple[FrictionPlant, ...], *, friction: AnyFriction, delay: float
) -> tuple[FrictionProof, ...] | None:
    """Return the proofs, one a machine; None as soon as one fails."""
    proofs = []
    for machine in machines:
        proof = prove_friction(machine, K, friction, delay=delay)
        if not proof.verdict.is_proved:
            return None
        proofs.append(proof)
    return tuple(proofs)


Found = TypeVar("Found")


def largest_allowed_gain(allowed: Callable[[float], Found | None], gain: float) -> tuple[float, Found | None]:
    """Return the largest gain that is allowed around a first one: doubled or halved to the limit, then bisected."""
    found = allowed(gain)
    if found is not None:
        low, high = gain, gain * GAIN_STEP
        while high <= gain * MAX_GAIN_RATIO and (more := allowed(high)) is not None:
            low, found, high = high, more, high * GAIN_STEP
    else:
        low, high = gain / GAIN_STEP, gain
        while low >= gain / MAX_GAIN_RATIO and (found := allowed(low)) is None:
            low, high = low / GAIN_STEP, low
        if found is None:
            return 0.0, None
    while high / low > BISECTION_RATIO:
        middle = float(np.sqrt(low * high))
        more = allowed(middle)
        if more is None:
            high = middle
        else:
            low, found = middle, more
    return low, found


def initial_gains(machine: FrictionPlant, K0: float) -> np.ndarray:
    """Kp, Ki, Kd around the resonance of a mass m: stiffness m w^2, damping m w, integration within ten swings."""
    mass = 1 / float(machine.velocity @ machine.B_port)
    omega = machine.resonance or np.sqrt(K0 / mass)
    return np.array([mass * omega**2, mass * omega**3, mass * omega]) / np.array([4, 10, 4])


def sampled_pid(shape: np.ndarray, dt: float) -> control.StateSpace:
    """Kp + Ki dt/(z - 1) + Kd (1 - 1/z)/dt; without integrator where Ki is zero."""
    Kp, Ki, Kd = map(float, shape)
    if not Ki:
        return control.StateSpace([[0.0]], [[1.0]], [[-Kd / dt]], [[Kp + Kd / dt]], dt)
    return control.StateSpace([[1, 0], [0, 0]], [[1], [1]], [[Ki * dt, -Kd / dt]], [[Kp + Kd / dt]], dt)


def sampled_notch(omega: float | None, dt: float) -> control.StateSpace:
    """Return a notch of a tenth at a frequency, sampled; one where none is asked for."""
    if omega is None:
        return control.StateSpace([], [], [], [[1.0]], dt)
    omega = require_positive("notch", omega)
    if omega * dt >= np.pi:
        raise ValueError(f"notch must lie below Nyquist, {np.pi / dt:g} rad/s, got {omega:g} rad/s")
    zeros, poles = (np.roots([1, 2 * damping * omega, omega**2]) for damping in (0.05, 0.5))
    return state_space("notch", discretize(from_roots(zeros, poles, 1.0, 0.0), dt))
