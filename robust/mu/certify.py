"""A level for the structured singular value proved at every frequency, not only on a grid.

On each interval of the frequency axis the scaling found in its middle is frozen; what is left is a norm bound on a
linear system, decided by its Hamiltonian (`robust.intervals`). Intervals that fail are split.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from nlfrf.shared.arguments import positive
from nlfrf.shared.wording import hertz
from robust.certificates.certificate import Certificate, refused
from robust.certificates.intervals import SLACK, around, inside, prove
from robust.mu.blocks import fitting
from robust.mu.upper import MuBound, bounded
from robust.systems.bilinear import Matrices, continuous_image
from robust.systems.lti import along, timebase
from robust.systems.norms import sign_changes, well_conditioned
from robust.systems.realisation import multivariable
from robust.systems.stability import instability

__all__ = ["certify_mu"]


N_GRID = 300
MOST_INTERVALS = 5000
SLACK_REAL = 1e-9  # a large G brings the norm close to one, and what N may be off down by as much
Scaling = tuple[np.ndarray, ...]


def certify_mu(N_ss: Any, blocks: Any, level: float = 1.0, *, time_cap: float = 10.0) -> Certificate:
    """Prove that the structured singular value of a system stays below a level at every frequency.

    Parameters
    ----------
    N_ss : control.StateSpace
        Stable system that the perturbation closes, continuous or discrete.
    blocks : list
        As for `mu_upper`.
    level : float
        With mu < level everywhere the loop is stable for every stable linear perturbation of the structure of gain at
        most 1/level (with a block for performance: and keeps its gain from there under level).
    time_cap : float
        Seconds.

    Returns
    -------
    Certificate
        One that does not hold says why: the system is not stable, the upper bound reaches the level at a frequency, or
        time ran out. intervals : (I, 2) with the frequencies [rad/s] proved.

    Raises
    ------
    ValueError
        Blocks that do not add up to N_ss, a level that is not positive.

    References
    ----------
    Packard & Doyle 1993 (the theorem); Boyd, Balakrishnan & Kabamba 1989 (the Hamiltonian); Young, Newlin & Doyle 1991
    (real blocks as a norm).

    Examples
    --------
    >>> import control
    >>> lag = control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]])
    >>> certify_mu(control.append(lag, 2 * lag), [(1, 1), (1, 1)], 2.001).holds
    True
    """
    N = multivariable("N_ss", N_ss)
    s = fitting("blocks", blocks, (N.noutputs, N.ninputs), of="N_ss")
    level = positive("level", level)
    subject = "structured singular value"
    wrong = instability(N)
    if wrong:
        return refused(subject, level, f"the system is not stable: {wrong}")
    dt = timebase(N)
    A, B, C, D = well_conditioned(continuous_image(N))

    def omega_of(x: Any) -> Any:
        return 2 / dt * np.arctan(x) if dt else x

    def response_at(x: np.ndarray) -> np.ndarray:
        return along(N, omega_of(x))

    size = np.abs(np.linalg.eigvals(A)) if A.size else np.ones(1)
    size = size[(size > 0) & np.isfinite(size)]
    grid = np.geomspace(size.min() / 30, size.max() * 100, N_GRID)
    on_grid = bounded(np.moveaxis(response_at(grid), 2, 0), blocks, level)
    simple = s.scalar and not s.skew.size
    own: dict[float, Scaling] = {}

    def scaling_at(x: float) -> Scaling:
        """The one found for this frequency, else one from the grid: any scaling proves what it proves."""
        if x in own:
            return own[x]
        return between(on_grid, grid, x) if simple else picked(on_grid, int(np.abs(np.log(grid / x)).argmin()))

    def exact(x: float) -> float:
        value = response_at(np.array([x]))
        norm = float(np.linalg.norm(in_norm_form(scaling_at(x), C, value[:, :, 0], level)[1], 2))
        if norm < 1:
            return norm
        bound = bounded(np.moveaxis(value, 2, 0), blocks, level)
        own[x] = picked(bound, 0)
        reached = float(bound.value[0]) / level
        return min(reached, float(np.linalg.norm(in_norm_form(own[x], C, value[:, :, 0], level)[1], 2)))

    def frozen(low: float, high: float) -> Matrices:
        C_x, D_x, into = in_norm_form(scaling_at(inside(low, high)), C, D, level)
        return A, B @ into, C_x, D_x

    def changes(low: float, high: float) -> tuple[np.ndarray, np.ndarray] | None:
        D_L, D_R, G = scaling_at(inside(low, high))
        into, below = np.linalg.inv(D_R), level * (1 - SLACK)
        return sign_changes((A, B @ into, D_L @ C / below, D_L @ D @ into / below), G / level)

    real = bool(s.skew.size)
    outcome = prove(
        frozen,
        exact,
        around(size),
        np.inf,
        time_cap=time_cap,
        most=MOST_INTERVALS,
        slack=SLACK_REAL if real else SLACK,
        changes=changes if real else None,
    )
    if not outcome.holds:
        if not np.isfinite(outcome.violated_at):
            return refused(subject, level, outcome.reason)
        omega = omega_of(outcome.violated_at)
        return refused(subject, level, f"the bound does not stay below the level: at {hertz(omega)} {outcome.reason}")
    return Certificate(
        subject=subject,
        holds=True,
        level=level,
        method="Hamiltonian, interval by interval",
        intervals=np.array([[omega_of(low), omega_of(high)] for low, high in outcome.intervals]),
        reason="",
    )


def picked(bound: MuBound, k: int) -> Scaling:
    """The scaling of one frequency, in real numbers where it has them."""
    return tuple(m[:, :, k].real if not m[:, :, k].imag.any() else m[:, :, k] for m in bound.scaling)


def between(bound: MuBound, grid: np.ndarray, x: float) -> Scaling:
    """Positive diagonal scalings interpolated over log frequency."""
    k = int(np.clip(np.searchsorted(grid, x), 1, grid.size - 1))
    part = float(np.clip(np.log(x / grid[k - 1]) / np.log(grid[k] / grid[k - 1]), 0, 1))
    D_L, D_R = (
        np.diag(np.exp(np.log(np.einsum("iiw->iw", m[:, :, k - 1 : k + 1]).real) @ [1 - part, part]))
        for m in bound.scaling[:2]
    )
    return D_L, D_R, np.zeros(bound.scaling[2].shape[:2])


def in_norm_form(
    scaling: Scaling, C: np.ndarray, D: np.ndarray, level: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """C, D and the factor on B for which the bound under the level is a norm under one: G completes a square."""
    D_L, D_R, G = scaling
    into = np.linalg.inv(D_R)
    if not G.any():
        return D_L @ C / level, D_L @ D @ into / level, into
    G = G / level
    root = inverse_root(np.eye(G.shape[0]) + G @ G.conj().T)
    return D_L @ C / level, D_L @ D @ into @ root / level - 1j * G.conj().T @ root, into @ root


def inverse_root(M: np.ndarray) -> np.ndarray:
    """M^-1/2 of a positive definite matrix."""
    values, vectors = np.linalg.eigh((M + M.conj().T) / 2)
    return np.asarray((vectors / np.sqrt(values)) @ vectors.conj().T)
