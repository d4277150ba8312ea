"""The smallest perturbation found that takes a pole of a loop to its stability boundary.

Real parameters make a loop singular at isolated frequencies only, which a grid of frequencies
misses. Therefore the poles are followed as the perturbation grows from zero: towards the corners of
the box of parameters, in directions inside it, and along the perturbations that move each pole
most. The best of these is improved by gradient ascent (corners: de Gaston & Safonov 1988;
first-order moves: Seiler 2010; structured pseudospectral abscissa: Guglielmi, Rehman & Kressner
2017). A search without result proves nothing.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import control
import numpy as np

from nlfrf._base.values import value
from robust.lti.lti import response_by_channel, timebase, to_s_plane
from robust.mu.blocks import BlockStructure
from robust.mu.perturbations import MOVES, align_perturbation, normalize_perturbation
from robust.proofs.search.stability import decide_stability

_MAX_CORNER_PARAMETERS = 6  # largest number of parameters for which every corner is tried
_N_DIRECTIONS = 48  # additional random directions
_N_SIZES = 24  # sizes tried on the way out
_N_IMPROVEMENTS = 15  # attempts to improve the best perturbations
_N_ASCENTS = 8  # perturbations that are moved uphill each time
_CLOSER = 1e-3, 1e-6  # relative reductions of the size that are tried, first the larger
_SINGULAR = 1e-6  # least singular value of the loop at the boundary, relative to the largest


@value
class Crossing:
    """A perturbation that brings a pole to the stability boundary."""

    size: float  # largest singular value of the blocks that grow
    delta: np.ndarray  # (n_in, n_out) the perturbation
    omega: float  # frequency of the pole that crosses [rad/s]


@value(copy=False)
class PerturbedLoop:
    """A system as a function of the perturbations that close it: (K, n_in, n_out), of size one."""

    # A, B, C, D: the system
    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    s: BlockStructure  # the blocks
    # (n_in, n_out) entries of the blocks whose size is searched; the other blocks have size at most
    # one
    growing: np.ndarray
    dt: float  # sampling time [s], 0 for continuous
    n_unstable: int  # number of poles beyond the stability boundary without a perturbation

    @classmethod
    def of(cls, N: control.StateSpace, s: BlockStructure, growing: np.ndarray) -> PerturbedLoop:
        """Return the loop of a system with the blocks (K,) that grow."""
        kept, grown = _moved_states(N), np.zeros(s.shape[::-1], bool)
        for grows, row, col in zip(growing, s.rows, s.cols, strict=True):
            grown[col, row] = grows
        A = N.A[np.ix_(kept, kept)]
        if kept.size:
            beyond = boundary_excess(np.linalg.eigvals(A), N)
        else:
            beyond = np.zeros(0)
        return cls(
            A=A,
            B=N.B[kept],
            C=N.C[:, kept],
            D=N.D,
            s=s,
            growing=grown,
            dt=timebase(N),
            n_unstable=int((beyond > 0).sum()),
        )

    def sized(self, E: np.ndarray, size: float) -> np.ndarray:
        """Return the perturbations with the growing blocks at a size; real if possible."""
        delta = np.where(self.growing, size * E, E)
        if delta.imag.any():
            return delta
        return delta.real

    def closed(self, delta: np.ndarray) -> np.ndarray:
        """Return (K, n, n) state matrices."""
        loop = np.linalg.solve(
            np.eye(self.D.shape[0]) - self.D @ delta,
            np.broadcast_to(self.C, (len(delta), *self.C.shape)),
        )
        return np.asarray(self.A + self.B @ (delta @ loop))

    def excess(self, E: np.ndarray, size: float) -> np.ndarray:
        """Return (K,) the distance of a pole beyond the stability boundary; inf if the loop has no
        solution.
        """
        try:
            beyond = boundary_excess(np.linalg.eigvals(self.closed(self.sized(E, size))), self)
        except np.linalg.LinAlgError:
            return np.full(len(E), np.inf)
        if not self.n_unstable:
            return np.asarray(beyond.max(axis=1))
        nearest = np.abs(beyond).min(axis=1)
        return np.where((beyond > 0).sum(axis=1) == self.n_unstable, -nearest, nearest)

    def towards_boundary(self, delta: np.ndarray, which: np.ndarray | None = None) -> np.ndarray:
        """Return (K, n_in, n_out) of size one that move the pole nearest to the boundary, or
        `which`, most.
        """
        values, right = np.linalg.eig(self.closed(delta))
        beyond, each = boundary_excess(values, self), np.arange(len(delta))
        if which is None:
            which = (-np.abs(beyond) if self.n_unstable else beyond).argmax(axis=1)
        left = np.linalg.pinv(right)[each, which]
        pole, inner = values[each, which], np.eye(self.D.shape[1]) - delta @ self.D
        drive = np.linalg.solve(inner.swapaxes(1, 2), (left @ self.B)[:, :, None])[:, :, 0]
        reads = np.linalg.solve(
            np.eye(self.D.shape[0]) - self.D @ delta, (right[each, :, which] @ self.C.T)[:, :, None]
        )[:, :, 0]
        if self.dt:
            turn = pole / np.maximum(np.abs(pole), 1e-300)
        else:
            turn = np.ones(len(delta))
        turn = np.where(beyond[each, which] < 0, turn, -turn)
        return align_perturbation(drive.conj(), reads, turn=turn, s=self.s)

    def uphill(self, E: np.ndarray, size: float) -> tuple[np.ndarray, np.ndarray]:
        """Return perturbations after one best step towards the boundary, and their excess."""
        now = self.excess(E, size)
        try:
            corner = self.towards_boundary(self.sized(E, size) + np.zeros(1))
        except np.linalg.LinAlgError:
            return E, now
        E = E + 0j
        moved = E.copy()
        for share in MOVES:
            tried = (1 - share) * E + share * np.nan_to_num(corner)
            if set(self.s.kinds) != {"real"}:
                tried = normalize_perturbation(tried, self.s)
            reached = self.excess(tried, size)
            moved[reached > now], now = tried[reached > now], np.maximum(now, reached)
        return moved, now

    def crossing_size(self, E: np.ndarray, inner: float, outer: float) -> float:
        """Return an upper bound of the size at which E crosses, between one inside and one beyond
        the boundary.
        """
        if self.excess(E[None], 0.0)[0] > 0:
            return 0.0
        for _ in range(50):
            middle = (inner + outer) / 2
            if self.excess(E[None], middle)[0] > 0:
                inner, outer = inner, middle
            else:
                inner, outer = middle, outer
            if outer - inner <= 1e-12 * outer:
                break
        return outer


def find_crossing(
    N: control.StateSpace,
    s: BlockStructure,
    *,
    least: float,
    limit: float,
    growing: np.ndarray | None = None,
    seeds: np.ndarray | None = None,
) -> Crossing | None:
    """Return the smallest perturbation found that takes a pole of a loop to the boundary, or None.
    Parameters
    ----------
    N : control.StateSpace
        System that the perturbation closes.
    s : BlockStructure
        The blocks.
    least, limit : float
        Range of sizes for the search.
    growing : (K,) bool ndarray, optional
        Blocks whose size is searched, down to zero; the other blocks have size at most one. All by
        default.
    seeds : (S, n_in, n_out) ndarray, optional
        Perturbations of size one as additional starts.
    """
    if not N.nstates or least >= limit:
        return None
    if growing is None:
        growing = np.ones(len(s.kinds), bool)
    loop = PerturbedLoop.of(N, s, growing)
    if not loop.A.size:
        return None
    starts, inner = _first_perturbations(loop, seeds), 0.0
    for size in [*([] if growing.all() else [0.0]), *np.geomspace(least, limit, _N_SIZES)]:
        excess = loop.excess(starts, size)
        if excess.max() <= 0 and set(s.kinds) != {"real"}:
            best = np.argsort(-excess)[:_N_ASCENTS]
            starts[best], excess[best] = loop.uphill(starts[best], size)
        if excess.max() > 0:
            break
        inner = size
    if excess.max() <= 0:
        return None
    E = starts[int(excess.argmax())]
    E, size = _improve(loop, starts, E=E, size=loop.crossing_size(E, inner, size))
    return verified_crossing(N, loop, E, size)


def boundary_excess(poles: np.ndarray, of: control.StateSpace | PerturbedLoop) -> np.ndarray:
    """Return the distances of poles of a system beyond the stability boundary."""
    return np.asarray(np.abs(poles) - 1 if of.dt else poles.real)


def _moved_states(N: control.StateSpace) -> np.ndarray:
    """Return the states on a path from an input to an output; the others do not move."""
    into, out = np.any(N.B != 0, axis=1), np.any(N.C != 0, axis=0)
    for _ in range(N.nstates):
        into, out = into | ((N.A != 0) @ into), out | ((N.A != 0).T @ out)
    return np.flatnonzero(into & out)


def _first_perturbations(loop: PerturbedLoop, seeds: np.ndarray | None) -> np.ndarray:
    """Return (K, n_in, n_out) of size one: parameters alone, perturbations that move each pole
    most, and the seeds.
    """
    s = loop.s
    real = [k for k, kind in enumerate(s.kinds) if kind == "real"]
    starts = []
    if real:
        directions = _search_directions(len(real))
        starts.append(np.zeros((len(directions), *s.shape[::-1]), complex))
        for x, k in zip(directions.T, real, strict=True):
            starts[0][:, s.cols[k], s.rows[k]] = x[:, None, None] * np.eye(
                s.rows[k].stop - s.rows[k].start
            )
    if len(real) < len(s.kinds):
        upper = np.flatnonzero(np.linalg.eigvals(loop.A).imag >= 0)
        starts.append(loop.towards_boundary(np.zeros((upper.size, *s.shape[::-1])), upper))
    if seeds is not None:
        starts.append(seeds)
    return np.nan_to_num(np.concatenate(starts))


def _search_directions(n: int) -> np.ndarray:
    """Return (K, n) directions: corners of the box, all or some; each parameter alone; and points
    inside.
    """
    rng = np.random.default_rng(0)
    if n <= _MAX_CORNER_PARAMETERS:
        corners = np.array(list(product((-1.0, 1.0), repeat=n)))
    else:
        corners = np.sign(rng.standard_normal((64, n)))
    inside = rng.uniform(-1, 1, (_N_DIRECTIONS, n))
    inside /= np.abs(inside).max(axis=1, keepdims=True)
    if n > 1:
        return np.concatenate([corners, np.eye(n), -np.eye(n), inside])
    return corners


def _improve(
    loop: PerturbedLoop, starts: np.ndarray, *, E: np.ndarray, size: float
) -> tuple[np.ndarray, float]:
    """Return a perturbation that crosses at a smaller size, found uphill just below the present
    one, and its size.
    """
    for closer in _CLOSER:
        for _ in range(_N_IMPROVEMENTS if size else 0):
            below = (1 - closer) * size
            best = starts[np.argsort(-loop.excess(starts, below))[: _N_ASCENTS - 1]]
            tried, excess = loop.uphill(np.concatenate([E[None], best]), below)
            if excess.max() > 0:
                E = tried[int(excess.argmax())]
            else:
                E = tried[0]
            if excess.max() <= 0:
                break
            size = loop.crossing_size(E, 0.0, below)
    return E, size


def verified_crossing(
    N: control.StateSpace, loop: PerturbedLoop, E: np.ndarray, size: float
) -> Crossing | None:
    """Return the crossing if the loop is singular at the frequency of the pole, or unstable beyond;
    else None.
    """
    if not size:  # the blocks that do not grow suffice: find their size
        loop = replace(loop, growing=~loop.growing)
        E = np.where(loop.growing, E, 0)
        found = verified_crossing(N, loop, E, loop.crossing_size(E, 0.0, 1.0))
        return found and replace(found, size=0.0)
    delta = loop.sized(E[None], size)
    poles = np.linalg.eigvals(loop.closed(delta)[0])
    pole = poles[np.abs(boundary_excess(poles, loop)).argmin()]
    omega = to_s_plane(np.array([pole]), loop.dt)[0].imag
    if omega < 0:
        delta, omega = delta.conj(), -omega
    else:
        delta, omega = delta, omega
    if np.isrealobj(delta) and not loop.n_unstable:
        beyond = loop.closed(loop.sized(E[None], 1.001 * size))[0]
        n = len(beyond)
        farther = control.StateSpace(beyond, np.zeros((n, 1)), np.zeros((1, n)), 0.0, N.dt)
        fine = decide_stability(farther).unstable
    else:
        M = response_by_channel(N, np.array([omega]))[:, :, 0]
        sizes = np.linalg.svd(np.eye(len(M)) - M @ delta[0], compute_uv=False)
        fine = bool(sizes[-1] <= _SINGULAR * max(1.0, float(sizes[0])))
    if fine:
        return Crossing(size=float(size), delta=delta[0], omega=float(omega))
    return None
