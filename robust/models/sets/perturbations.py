"""Plants of a set, from perturbations with a gain of at most one."""

from __future__ import annotations

from collections.abc import Sequence

import control
import numpy as np

from robust.lti.connections import block_diagonal, in_series, inverse_system
from robust.lti.realisation import from_roots
from robust.models.sets.forms import FORMS

# [rad] treated as real: an all-pass of that phase has a pole next to zero or infinity
_REAL_ANGLE = 1e-7


def perturbed_plant(
    form: str,
    G: control.StateSpace,
    w: control.StateSpace,
    Delta: control.StateSpace,
    W: control.StateSpace | None = None,
) -> control.StateSpace:
    """Return the perturbed plant as a system, for a plant scaled by W."""
    row = FORMS[form]
    if W is None or not row.depends_on_units:
        return row.perturbed_system(G, w, Delta)
    return in_series(row.perturbed_system(in_series(G, W), w, Delta), inverse_system(W))


def random_delta(
    rng: np.random.Generator,
    structure: Sequence[tuple[int, int]],
    *,
    band: tuple[float, float],
    dt: float,
) -> control.StateSpace:
    """Return a random stable perturbation of these blocks (reads, drives), with gain one or (every
    other) less.

    A full block is V diag(all-passes) U^T with random orthogonal U and V: its gain differs with
    direction.
    """
    blocks = []
    for n, m in structure:
        passes = [_random_perturbation(rng, *band, dt) for _ in range(min(n, m))]
        if (n, m) != (1, 1):
            reads, drives = (
                np.linalg.qr(rng.normal(size=(size, size)))[0][:, : len(passes)] for size in (n, m)
            )
            D = block_diagonal(passes, dt)
            passes = [
                control.StateSpace(D.A, D.B @ reads.T, drives @ D.C, drives @ D.D @ reads.T, dt)
            ]
        blocks += passes
    if len(blocks) == 1:
        return blocks[0]
    return block_diagonal(blocks, dt)


def _random_perturbation(
    rng: np.random.Generator, low: float, high: float, dt: float
) -> control.StateSpace:
    """Return a random stable all-pass with one to three sections over the band [rad/s], with gain
    one or less.
    """
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
    return _all_pass_of_poles(np.array(poles), gain, dt)


def _all_pass_of_poles(poles: np.ndarray, gain: float, dt: float) -> control.StateSpace:
    """Return gain prod (s + p*)/(s - p), or its bilinear image."""
    if not dt:
        return from_roots(-poles.conj(), poles, gain, 0.0)
    z = (1 + poles * dt / 2) / (1 - poles * dt / 2)
    z = np.where(np.abs(z) < 1e-9, 1e-9, z)
    # (1 - z p*)/(z - p) has modulus one on the circle
    return from_roots(1 / z.conj(), z, gain * float(np.prod(z).real), dt)


def with_phase(omega: float, value: complex, dt: float) -> control.StateSpace:
    """Return a first-order all-pass times |value| that equals value at omega [rad/s]."""
    if dt:
        x = 2 / dt * np.tan(omega * dt / 2)
    else:
        x = omega
    angle = float(np.angle(value))
    if abs(np.sin(angle)) < _REAL_ANGLE:
        return control.StateSpace([], [], [], [[abs(value) * np.sign(np.cos(angle))]], dt)
    # (s - b)/(s + b) at j x has the phase pi - 2 atan(x / b), between 0 and pi; the sign gives the
    # other half
    sign = 1.0 if angle >= 0 else -1.0
    if angle >= 0:
        phase = angle
    else:
        phase = angle + np.pi
    b = x / np.tan(np.clip((np.pi - phase) / 2, 1e-9, np.pi / 2 - 1e-9))
    return _all_pass_of_poles(np.array([complex(-b)]), sign * abs(value), dt)


def with_phases(
    omega: np.ndarray, phases: np.ndarray, *, narrow: float = 1e-4
) -> control.StateSpace:
    """Return a continuous all-pass with given phases [rad] at several frequencies omega (n,)
    [rad/s], of order 2 n.

    A section (s + p)(s + p*)/((s - p)(s - p*)) with p = -h + j c, h << c turns once around c and is
    nearly one elsewhere. At omega its phase is 2 acot((omega - c)/h), so c sets it. Its phase at
    the others is subtracted first.

    >>> from robust.lti.lti import response
    >>> delta = with_phases(np.array([1.0, 5.0]), np.array([0.5, -2.0]))
    >>> np.angle(response(delta, np.array([1.0, 5.0]))).round(3).tolist()
    [0.5, -2.0]
    """
    omega, half = np.asarray(omega, dtype=float), narrow * np.asarray(omega, dtype=float)
    centre = omega.copy()
    for _ in range(30):
        for k, w in enumerate(omega):
            p = -half + 1j * centre
            every = np.angle(
                (1j * w + p) * (1j * w + p.conj()) / ((1j * w - p) * (1j * w - p.conj()))
            )
            wanted = (phases[k] - every.sum() + every[k]) % (2 * np.pi)
            centre[k] = w - half[k] / np.tan(np.clip(wanted / 2, 1e-6, np.pi - 1e-6))
    p = -half + 1j * centre
    return _all_pass_of_poles(np.concatenate([[a, a.conjugate()] for a in p]), 1.0, 0.0)
