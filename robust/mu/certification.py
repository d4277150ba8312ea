"""A level for the structured singular value proved at every frequency, not only on a grid.

First one scaling for all frequencies is searched (`robust.proofs.search.scaled_kyp`); where none is found, one for each
interval of the frequency axis (`robust.mu.intervals`). Anyone can repeat either proof over the rationals. Repeated
parameters may ask for thousands of intervals. There the scaling found in the middle of an interval is frozen, and what
is left, a norm bound on a linear system, is decided in floating point by its Hamiltonian
(`robust.proofs.search.intervals`), which the certificate says.
"""

from __future__ import annotations

from dataclasses import replace

import control
import numpy as np

from nlfrf._base.arguments import format_hertz, require_choice, require_positive
from nlfrf._base.values import value
from robust._base.states import Outcome
from robust._base.types import Blocks, LinearSystem
from robust.lti.lti import Matrices, response_by_channel, timebase
from robust.lti.norms import continuous_image, real_block_crossings, well_conditioned
from robust.lti.realisation import multivariable
from robust.mu.blocks import BlockStructure, blocks_with_kinds, structure_for
from robust.mu.intervals import certify_intervals
from robust.mu.scalings import MuBound, upper_bound
from robust.proofs.exact.scaled_kyp import LEVEL
from robust.proofs.search.certificate import Certificate, failed_certificate
from robust.proofs.search.intervals import SLACK, initial_cuts, interior_point, prove
from robust.proofs.search.programs import SOLVERS
from robust.proofs.search.scaled_kyp import certify_scaled
from robust.proofs.search.stability import decide_stability

N_GRID, LEAST_GRID, GRID_WORK = 300, 30, 5e8  # points at which scalings are looked for; fewer of very many scalings
MAX_INTERVALS = 2000  # by one scaling each, judged in floating point
SLACK_REAL = 1e-9  # of the norm with real blocks, for rounding in it; what N may be off is in the level
Scaling = tuple[np.ndarray, ...]


def certify(N_ss: LinearSystem, blocks: Blocks, level: float = 1.0, *, solver: str | None = None) -> Certificate:
    """Prove that the structured singular value of a system stays below a level at every frequency.

    Parameters
    ----------
    N_ss : control.StateSpace
        Stable system that the perturbation closes, continuous or discrete.
    blocks : list
        As for `upper`.
    level : float
        With mu < level everywhere the loop is stable for every stable linear perturbation of the structure of gain at
        most 1/level (with a block for performance: and keeps its gain from there under level).
    solver : str, optional
        "CLARABEL" or "SCS" of cvxpy, for one scaling at all frequencies; one after the other when not given.

    Returns
    -------
    Certificate
        One that does not hold says why: the system is not stable, the upper bound reaches the level at a frequency, or
        the intervals became too many, with the one that is left. intervals : (I, 2) with the frequencies [rad/s]
        proved. By "scaled KYP" (one scaling) and "generalised KYP" (one an interval) it is proved over the rationals,
        and `verify` repeats that; by any other method it is judged in floating point.

    Raises
    ------
    ValueError
        Blocks that do not add up to N_ss, a level that is not positive.

    References
    ----------
    Packard & Doyle 1993 (the theorem); Boyd, El Ghaoui, Feron & Balakrishnan 1994, 8.1 (one scaling);
    Iwasaki & Hara 2005 (intervals); Boyd, Balakrishnan & Kabamba 1989 (the Hamiltonian); Young, Newlin & Doyle 1991
    (real blocks as a norm).

    Examples
    --------
    >>> import control
    >>> lag = control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]])
    >>> certify(control.append(lag, 2 * lag), [(1, 1), (1, 1)], 2.001).verify().verified
    True
    """
    N = multivariable("N_ss", N_ss)
    structure_for("blocks", blocks, (N.noutputs, N.ninputs), of="N_ss")
    level = require_positive("level", level)
    if solver is not None:
        require_choice("solver", solver, SOLVERS)
    nominal = decide_stability(N)
    if not nominal.stable:
        return failed_certificate(LEVEL, level, f"the system is not stable: {nominal}")
    # exact of N as it is, which was rounded when it was put together: the slack on the level is for that
    slack, given = level * (1 - SLACK), blocks_with_kinds(blocks)
    found = certify_scaled(N, given, slack, solver=solver)
    if found is None:
        found = certify_intervals(N, given, slack)
    if not found.holds and not found.violated:
        other = certify_by_intervals(N, blocks, level)
        found = other if other.holds else found
    return replace(found, level=level)


def certify_by_intervals(
    N: control.StateSpace, blocks: Blocks, level: float, *, most: int = MAX_INTERVALS
) -> Certificate:
    """Return `certify` of a stable system by at most so many intervals, judged in floating point."""
    subject = LEVEL
    s = structure_for("blocks", blocks, (N.noutputs, N.ninputs), of="N_ss")
    real = bool(s.skew.size)
    # a large G brings the norm so near to one that slack on it is none on mu: with real blocks the level has it
    proved = level * (1 - SLACK) if real else level
    frozen = frozen_scalings(N, s, blocks=blocks, level=proved)
    outcome = prove(
        frozen.loop,
        frozen.size,
        initial_cuts(frozen.speeds),
        np.inf,
        most=most,
        slack=SLACK_REAL if real else SLACK,
        changes=frozen.changes if real else None,
    )
    omega_of = frozen.omega_of
    if not outcome.holds:
        if not np.isfinite(outcome.violated_at):
            return failed_certificate(subject, level, outcome.reason)
        omega = omega_of(outcome.violated_at)
        return failed_certificate(
            subject, level, f"the bound does not stay below the level: at {format_hertz(omega)} {outcome.reason}"
        )
    return Certificate(
        subject=subject,
        outcome=Outcome.HOLDS,
        level=level,
        method="Hamiltonian, interval by interval",
        intervals=np.array([[omega_of(low), omega_of(high)] for low, high in outcome.intervals]),
        reason="",
    )


@value(copy=False)
class FrozenScalings:
    """A system and the scalings of its mu bound along a grid, of which each interval takes one.

    Fields
    ------
    N : control.StateSpace
    matrices : A, B, C, D
        Its continuous image in good coordinates, over x: omega, or tan(omega dt / 2).
    speeds, grid : ndarray
        Moduli of the poles in x; where the bound was found.
    bound : MuBound
    simple : bool
        Whether the scalings are positive and diagonal, so that they may be interpolated.
    own : dict
        Scalings found for one x alone.
    """

    N: control.StateSpace
    blocks: Blocks
    level: float
    matrices: Matrices
    speeds: np.ndarray
    grid: np.ndarray
    bound: MuBound
    simple: bool
    own: dict[float, Scaling]

    def omega_of(self, x: float) -> float:
        """Frequency [rad/s]."""
        dt = timebase(self.N)
        return float(2 / dt * np.arctan(x)) if dt else x

    def scaling(self, x: float) -> Scaling:
        """Return the one found for this x, else one from the grid: any scaling proves what it proves."""
        if x in self.own:
            return self.own[x]
        if self.simple:
            return interpolate_scalings(self.bound, self.grid, x)
        return scaling_at(self.bound, int(np.abs(np.log(self.grid / x)).argmin()))

    def size(self, x: float) -> float:
        """The bound at x over the level; where the scaling at hand is too poor, a better one is found and kept."""
        C, response = self.matrices[2], response_by_channel(self.N, np.array([self.omega_of(x)]))  # (rows, cols, 1)
        norm = float(np.linalg.norm(to_norm_form(self.scaling(x), C, D=response[:, :, 0], level=self.level)[1], 2))
        if norm < 1:
            return norm
        bound = upper_bound(np.moveaxis(response, 2, 0), self.blocks, target=self.level)
        self.own[x] = scaling_at(bound, 0)
        reached = float(bound.value[0]) / self.level
        return min(
            reached, float(np.linalg.norm(to_norm_form(self.own[x], C, D=response[:, :, 0], level=self.level)[1], 2))
        )

    def loop(self, low: float, high: float) -> Matrices:
        """Return the scaled system of an interval, below the level where its norm is below one."""
        A, B, C, D = self.matrices
        C_x, D_x, into = to_norm_form(self.scaling(interior_point(low, high)), C, D=D, level=self.level)
        return A, B @ into, C_x, D_x

    def changes(self, low: float, high: float) -> tuple[np.ndarray, np.ndarray] | None:
        """Return where the form that real blocks ask for may become singular."""
        A, B, C, D = self.matrices
        D_L, D_R, G = self.scaling(interior_point(low, high))
        into = np.linalg.inv(D_R)
        return real_block_crossings((A, B @ into, D_L @ C / self.level, D_L @ D @ into / self.level), G / self.level)


def frozen_scalings(N: control.StateSpace, s: BlockStructure, *, blocks: Blocks, level: float) -> FrozenScalings:
    """Return the system in good coordinates, and the scalings of its bound on a grid around its poles."""
    dt = timebase(N)
    matrices = well_conditioned(continuous_image(N))
    speeds = np.abs(np.linalg.eigvals(matrices[0])) if matrices[0].size else np.ones(1)
    speeds = speeds[(speeds > 0) & np.isfinite(speeds)]
    work = (len(s.left) + len(s.skew)) ** 2 * s.shape[1] ** 2 + 1
    n_grid = int(np.clip(GRID_WORK / work, LEAST_GRID, N_GRID))
    grid = np.geomspace(speeds.min() / 30, speeds.max() * 100, n_grid)
    response = response_by_channel(N, 2 / dt * np.arctan(grid) if dt else grid)  # (rows, cols, n_grid)
    return FrozenScalings(
        N=N,
        blocks=blocks,
        level=level,
        matrices=matrices,
        speeds=speeds,
        grid=grid,
        bound=upper_bound(np.moveaxis(response, 2, 0), blocks, target=level),
        simple=s.scalar and not s.skew.size,
        own={},
    )


def scaling_at(bound: MuBound, k: int) -> Scaling:
    """Return the scaling of one frequency, in real numbers where it has them."""
    assert bound.scaling is not None  # of an upper bound
    return tuple(m[:, :, k].real if not m[:, :, k].imag.any() else m[:, :, k] for m in bound.scaling)


def interpolate_scalings(bound: MuBound, grid: np.ndarray, x: float) -> Scaling:
    """Positive diagonal scalings interpolated over log frequency."""
    assert bound.scaling is not None  # of an upper bound
    k = int(np.clip(np.searchsorted(grid, x), 1, grid.size - 1))
    part = float(np.clip(np.log(x / grid[k - 1]) / np.log(grid[k] / grid[k - 1]), 0, 1))
    D_L, D_R = (
        np.diag(np.exp(np.log(np.einsum("iiw->iw", m[:, :, k - 1 : k + 1]).real) @ [1 - part, part]))
        for m in bound.scaling[:2]
    )
    return D_L, D_R, np.zeros(bound.scaling[2].shape[:2])


def to_norm_form(
    scaling: Scaling, C: np.ndarray, *, D: np.ndarray, level: float
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
