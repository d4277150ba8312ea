"""Plants of a set: perturbations of gain at most one, and what they make of a nominal."""

from __future__ import annotations

import control
import numpy as np

from robust.systems.lti import in_series
from robust.systems.realisation import from_roots

__all__ = ["perturbed", "random_perturbation", "with_phase"]


def perturbed(form: str, G: control.StateSpace, w: control.StateSpace, Delta: control.StateSpace) -> control.StateSpace:
    """The perturbed plant as a system."""
    X = in_series(Delta, w)
    if form == "multiplicative":
        return in_series(one_plus(X), G)
    if form == "inverse-multiplicative":
        return in_series(inverse(one_plus(X)), G)
    n, m = G.nstates, X.nstates
    if form == "additive":
        A = np.block([[G.A, np.zeros((n, m))], [np.zeros((m, n)), X.A]])
        return control.StateSpace(A, np.vstack([G.B, X.B]), np.hstack([G.C, X.C]), G.D + X.D, G.dt)
    # y = G (u - X y): the two direct terms close a loop of their own
    k = 1 / (1 + G.D[0, 0] * X.D[0, 0])
    A = np.block(
        [
            [G.A - k * X.D[0, 0] * G.B @ G.C, -G.B @ X.C * k],
            [k * X.B @ G.C, X.A - k * G.D[0, 0] * X.B @ X.C],
        ]
    )
    B = np.vstack([k * G.B, k * G.D[0, 0] * X.B])
    return control.StateSpace(A, B, np.hstack([k * G.C, -k * G.D[0, 0] * X.C]), k * G.D, G.dt)


def one_plus(X: control.StateSpace) -> control.StateSpace:
    """1 + X."""
    return control.StateSpace(X.A, X.B, X.C, X.D + 1, X.dt)


def inverse(X: control.StateSpace) -> control.StateSpace:
    """1 / X for a biproper X."""
    d = X.D[0, 0]
    if abs(d) < 1e-9:
        raise ValueError("form must leave the perturbed plant proper, got 1 + weight Delta = 0 at infinite frequency")
    return control.StateSpace(X.A - X.B @ X.C / d, X.B / d, -X.C / d, [[1 / d]], X.dt)


def random_perturbation(rng: np.random.Generator, low: float, high: float, dt: float) -> control.StateSpace:
    """A random stable all-pass of one to three sections over the band [rad/s], of gain one or (every other) less."""
    poles: list[complex] = []
    for _ in range(rng.integers(1, 4)):
        w = np.exp(rng.uniform(np.log(low), np.log(high)))
        if rng.random() < 0.5:
            zeta = 10 ** rng.uniform(-2, 0)
            p = w * (-zeta + 1j * np.sqrt(1 - zeta**2))
            poles += [p, np.conj(p)]
        else:
            poles.append(complex(-w))
    gain = rng.choice([-1.0, 1.0]) * (1.0 if rng.random() < 0.5 else rng.random())
    return all_pass(np.array(poles), gain, dt)


def all_pass(poles: np.ndarray, gain: float, dt: float) -> control.StateSpace:
    """gain prod (s + p*)/(s - p), or its bilinear image."""
    if not dt:
        return from_roots(-poles.conj(), poles, gain, 0.0)
    z = (1 + poles * dt / 2) / (1 - poles * dt / 2)
    z = np.where(np.abs(z) < 1e-9, 1e-9, z)
    # (1 - z p*)/(z - p) has modulus one on the circle
    return from_roots(1 / z.conj(), z, gain * float(np.prod(z).real), dt)


def with_phase(omega: float, value: complex, dt: float) -> control.StateSpace:
    """A first-order all-pass times |value| that takes the given complex value at omega [rad/s]."""
    x = 2 / dt * np.tan(omega * dt / 2) if dt else omega
    angle = float(np.angle(value))
    if abs(np.sin(angle)) < 1e-4:  # as good as real: an all-pass of that phase has a pole next to zero or infinity
        return control.StateSpace([], [], [], [[abs(value) * np.sign(np.cos(angle))]], dt)
    # (s - b)/(s + b) at j x has the phase pi - 2 atan(x / b), between 0 and pi; the sign gives the other half
    sign = 1.0 if angle >= 0 else -1.0
    phase = angle if angle >= 0 else angle + np.pi
    b = x / np.tan(np.clip((np.pi - phase) / 2, 1e-9, np.pi / 2 - 1e-9))
    return all_pass(np.array([complex(-b)]), sign * abs(value), dt)
