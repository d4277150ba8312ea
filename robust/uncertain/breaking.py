"""The smallest perturbation found that breaks a loop of several inputs and outputs, as a stable system to replay.

At one frequency the lower bound of mu gives a matrix that makes the loop singular: a direction in, a direction out, or
one number a block. An all-pass of first order takes any phase at one frequency and has one gain at all of them, so a
vector of all-passes carries each direction, and the perturbation is no larger anywhere else.
"""

from __future__ import annotations

from typing import Any

import control
import numpy as np

from nlfrf.shared.arguments import real
from nlfrf.shared.values import value
from nlfrf.shared.wording import shown
from robust.certificates.stability import instability
from robust.mu.lower import mu_lower
from robust.mu.upper import refined
from robust.systems.bilinear import to_discrete
from robust.systems.connections import in_series
from robust.systems.grids import structure_grid
from robust.systems.lft import joined
from robust.systems.lti import along, timebase
from robust.uncertain.forms import ELEMENTS
from robust.uncertain.matrix_model import MatrixUncertainty

__all__ = ["BreakingPerturbation", "all_passes", "as_system", "breaking_perturbation"]


NEAR = 1e-4  # of the lowest frequency, or of the distance to Nyquist


@value
class BreakingPerturbation:
    """A perturbation of a `MatrixUncertainty` that puts a pole of the loop on the stability boundary.

    Fields
    ------
    size : float
        Its gain: below one it lies in the set.
    omega : float
        Where the loop gets singular [rad/s].
    Delta : control.StateSpace
        The perturbation divided by its size: gain one at every frequency.
    model : MatrixUncertainty
        The set it belongs to.

    References
    ----------
    SP 8.8 (the smallest destabilising perturbation); Packard & Doyle, *The complex structured singular value*,
    Automatica 29, 1993.

    Examples
    --------
    >>> G = control.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2)))
    >>> w = control.ss([], [], [], [[1.0]])
    >>> model = MatrixUncertainty(
    ...     nominal=G, form="additive", left=(w, w), right=(w, w), omega=np.array([1.0]), radius=np.ones((4, 1)),
    ...     confidence=0.95)
    >>> worst = breaking_perturbation(model, control.ss([], [], [], 2 * np.eye(2)))
    >>> round(worst.size, 3)                             # |K S| is largest at high frequency: 2
    0.5
    """

    size: float
    omega: float
    Delta: control.StateSpace
    model: MatrixUncertainty

    def plant(self, factor: float = 1.0) -> control.StateSpace:
        """The plant with `factor` times the smallest breaking perturbation: at 0.99 stable, at 1.01 not."""
        Delta, x = self.Delta, real("factor", factor) * self.size
        return self.model.perturbed(control.StateSpace(Delta.A, Delta.B, x * Delta.C, x * Delta.D, Delta.dt))


def breaking_perturbation(model: MatrixUncertainty, K: Any) -> BreakingPerturbation:
    """The smallest perturbation found that breaks the loop u = K (r - y), to look at and to replay on a machine.

    Parameters
    ----------
    model : MatrixUncertainty
        The set.
    K : control.StateSpace
        Controller, negative feedback.

    Returns
    -------
    BreakingPerturbation

    Raises
    ------
    ValueError
        A nominal loop that is not stable, a K that does not fit, a loop that nothing breaks.

    References
    ----------
    SP 8.8; Packard & Doyle 1993.

    Examples
    --------
    >>> G = control.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2)))
    >>> w = control.ss([], [], [], [[0.5]])
    >>> omega = np.array([1.0])
    >>> model = MatrixUncertainty(
    ...     nominal=G, form="elements", left=(), right=(w,) * 4, omega=omega, radius=np.full((4, 1), 0.5),
    ...     confidence=0.95)
    >>> K = control.ss([], [], [], np.eye(2))
    >>> round(breaking_perturbation(model, K).size, 3)   # all four at once: 1 + 2 * 0.5 d = 0
    1.0
    """
    if not isinstance(model, MatrixUncertainty):
        raise ValueError(f"model must be a MatrixUncertainty, got {shown(model)}")
    system = model.loop(K)
    nominal = instability(system.N)
    if not nominal.stable:
        raise ValueError(f"K must leave the nominal loop stable, got one that is {nominal}")
    N = system.loop
    omega, mu = refined(N, system.structure, structure_grid(N))
    dt = timebase(N)
    # at zero and at Nyquist N is real and an all-pass has no phase to give: as near as makes no difference
    top = np.pi / dt * (1 - NEAR) if dt else np.inf
    some = np.unique(np.clip(omega[np.argsort(-mu)[:6]], NEAR * omega[omega > 0].min(), top))
    found = mu_lower(along(N, some), system.structure, n_starts=3)
    k = int(found.value.argmax())
    if not found.value[k] > 0:
        raise ValueError("K must react to the plant at all for a perturbation to break the loop, got one that does not")
    delta = found.delta[:, :, k] * found.value[k]  # of gain one
    return BreakingPerturbation(
        size=float(1 / found.value[k]),
        omega=float(some[k]),
        Delta=as_system(delta, float(some[k]), dt, full=model.form != ELEMENTS),
        model=model,
    )


def as_system(delta: np.ndarray, omega: float, dt: float, *, full: bool) -> control.StateSpace:
    """A stable real system of gain one that is `delta` (drives, reads) at omega: of rank one, or diagonal."""
    if not full:
        return joined(all_passes(np.diag(delta), omega, dt), dt)
    U, sizes, Vh = np.linalg.svd(delta)
    into, out = Vh[0] * sizes[0], U[:, 0]
    add = control.StateSpace([], [], [], np.ones((1, into.size)), dt)
    spread = control.StateSpace([], [], [], np.ones((out.size, 1)), dt)
    return in_series(
        joined(all_passes(into, omega, dt), dt), add, spread, joined(all_passes(out, omega, dt), dt), dt=dt
    )


def all_passes(numbers: np.ndarray, omega: float, dt: float) -> list[control.StateSpace]:
    """All-passes of first order that are these complex numbers at omega: |a| times +-(c - s)/(c + s)."""
    at = 2 / dt * np.tan(omega * dt / 2) if dt else omega
    parts = []
    for number in numbers:
        size, phase = abs(number), np.angle(number)
        sign = 1.0 if phase <= 0 else -1.0
        lag = -phase if phase <= 0 else np.pi - phase  # from 0 to pi
        if lag < 1e-9 or lag > np.pi - 1e-9 or not at or not np.isfinite(at):
            gain = size * np.sign(np.cos(phase)) if size else 0.0
            parts.append(control.StateSpace([], [], [], [[gain]], dt))
            continue
        c = at / np.tan(lag / 2)
        # (c - s)/(c + s) = -1 + 2 c/(s + c)
        A, B, C, D = (np.array([[x]]) for x in (-c, 1.0, 2 * c * size * sign, -size * sign))
        if dt:
            scale = 2 / dt
            A, B, C, D = to_discrete(A / scale, B / np.sqrt(scale), C / np.sqrt(scale), D)
        parts.append(control.StateSpace(A, B, C, D, dt))
    return parts
