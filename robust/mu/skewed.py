"""Skewed mu at all frequencies: the largest size of some blocks, between a proof and a
counterexample.

The growing blocks have size t, the others at most one. The largest t for which mu stays below one
at every frequency is 1/mu if all blocks grow, 1/(the worst gain) if only the performance grows, and
the robust margin of a gain if all but the performance grow (Fan & Tits 1992; SP 8.10.3).

The counter-example is a perturbation that takes a pole to the boundary (`robust.mu.crossings`).
Upper bounds of mu with real blocks may be far above it. On smaller boxes of the parameters the
bounds approach each other, because a small box around its centre is nearly a point. So a level is
proved box by box, each with a certificate at all frequencies, or a box is found that contains an
unstable loop (Balemi, Boyd & Balakrishnan 1991; Newlin & Young 1997).
"""

from __future__ import annotations

from dataclasses import replace

import control
import numpy as np

from nlfrf._base.values import value
from robust._base.types import Blocks
from robust.lti.grids import structure_grid
from robust.lti.lti import response_by_channel
from robust.mu.blocks import BlockStructure, block_structure
from robust.mu.certification import certify_by_intervals
from robust.mu.crossings import PerturbedLoop, boundary_excess, find_crossing, verified_crossing
from robust.mu.perturbations import search_perturbation
from robust.mu.scalings import refine_grid, upper_bound
from robust.proofs.search.certificate import Certificate
from robust.proofs.search.stability import decide_stability

_MAX_FACTOR = 1e6  # largest factor of the search
_N_TEST_FREQUENCIES = 32  # frequencies of the test before a proof of a box
_BOUND_LIMIT = 0.999  # largest bound at them
_MIN_BOX_WIDTH = 1e-3  # of the whole box: narrower boxes are not cut
# largest number of parts of the box, and of frequency intervals for each
MOST_BOXES = 150
_BOX_INTERVALS = 500
_FEW_BOXES = 40  # parts of the box in some ten seconds
_BOX_WORK = 100_000  # products in a step for the scalings of a part that counts once
_LEVEL_ACCURACY = (
    1e-3  # relative accuracy of the level at which the bound on the test frequencies is one
)
#: Shares of that level, or of the counter-example, that are tried for the whole box: a peak may
#: have been missed.
_WHOLE_SHARES = (0.997, 0.99, 0.95, 0.8, 0.5, 0.2)


@value(copy=False)
class SkewedMargin:
    """A loop, its counter-example, and the boxes that are proved at a level."""

    N: control.StateSpace
    blocks: Blocks
    s: BlockStructure
    growing: np.ndarray  # (K,) blocks whose size is searched
    n_unstable: int  # number of unstable poles of N
    left: int  # number of parts of the box that may still be examined
    level: float  # size of the growing blocks that is proved for the boxes; 0 if none is
    # broken, delta, omega: (n_in, n_out) least size found at which a perturbation makes the loop
    # unstable (inf: none), the perturbation, and where [rad/s]
    broken: float
    delta: np.ndarray
    omega: float
    # (middle, half) or (K,) boxes to examine, or proved boxes; complex blocks stay whole
    boxes: tuple[tuple[np.ndarray, np.ndarray], ...]
    certificates: tuple[Certificate, ...] = ()  # certificates of the proved boxes
    reason: str = ""  # reason why level and broken are not closer; empty if they are within the gap

    def sizes(self, level: float) -> np.ndarray:
        """Return (n_out,) the size of the block that reads each output of N, at a level."""
        lengths = [row.stop - row.start for row in self.s.rows]
        return np.repeat(np.where(self.growing, level, 1.0), lengths)

    @property
    def real(self) -> np.ndarray:
        """(r,) indices of the real blocks."""
        return np.flatnonzero([kind == "real" for kind in self.s.kinds])


def skewed_margin(
    N: control.StateSpace,
    blocks: Blocks,
    *,
    growing: np.ndarray | None = None,
    gap: float,
    max_boxes: int = _FEW_BOXES,
) -> SkewedMargin:
    """Return the largest size of the growing blocks (by default all), to a relative gap if it can
    be reached.

    N may have unstable poles. The claim is that no perturbation below the level takes a pole to the
    stability boundary.
    """
    s, nominal = block_structure("blocks", blocks), decide_stability(N)
    K = len(s.kinds)
    if growing is None:
        growing = np.ones(K, bool)
    search = SkewedMargin(
        N=N,
        blocks=blocks,
        s=s,
        growing=growing,
        n_unstable=0 if nominal.stable else int(np.sum(boundary_excess(N.poles(), N) > 0)),
        left=max_boxes,
        level=0.0,
        broken=np.inf,
        delta=np.full(s.shape[::-1], np.nan),
        omega=np.nan,
        boxes=((np.zeros(K), np.ones(K)),),
        reason="" if nominal.stable or nominal.unstable else f"the system is {nominal}",
    )
    if not nominal.stable and (search.reason or nominal.at_boundary or not search.n_unstable):
        return replace(search, reason=search.reason or f"the system is {nominal}")
    omega, start = _level_on_grid(search)
    search = _find_broken(search, omega, start)
    return _close_gap(search, start, gap)


def scaled_system(search: SkewedMargin, level: float) -> control.StateSpace:
    """Return the system with the growing blocks at a level."""
    N, size = search.N, search.sizes(level)[:, None]
    return control.StateSpace(N.A, N.B, size * N.C, size * N.D, N.dt)


def _level_on_grid(search: SkewedMargin) -> tuple[np.ndarray, float]:
    """Return frequencies around the peak, and the level at which the bound there is one; 0 if there
    is none.
    """
    omega = structure_grid(search.N)
    omega = omega[
        :: max(1, omega.size // _N_TEST_FREQUENCIES)
    ]  # a first guess: proof or counter-example come later
    if search.growing.all():
        omega, mu = refine_grid(search.N, search.blocks, omega=omega)
        return omega[np.sort(np.argsort(-mu)[:4])], 1 / max(float(mu.max()), 1 / _MAX_FACTOR)
    M = np.moveaxis(response_by_channel(search.N, omega), 2, 0)

    def bound(level: float) -> np.ndarray:
        return upper_bound(search.sizes(level)[:, None] * M, search.blocks, target=1.0).value

    # the level changes the bound by at most its own factor: after a step up by that factor it stays
    # below one
    size = np.linalg.norm(M, axis=(1, 2)).max()
    low, high = 0.0, np.inf
    level = 1 / max(size, 1e-300)
    for _ in range(60):
        if bound(level).max() < 1:
            low = level
        else:
            high = level
        if (
            high <= low * (1 + _LEVEL_ACCURACY)
            or low > _MAX_FACTOR * 1e3 / size
            or high < 1e-9 / size
        ):
            break
        if np.isinf(high):
            level = 8 * low
        else:
            if low:
                level = np.sqrt(low * high)
            else:
                level = high / 8
    peaks = np.argsort(-bound(low or high))[:4]
    if low:
        omega, mu = refine_grid(scaled_system(search, low), search.blocks, omega=omega)
        peaks, low = np.argsort(-mu)[:4], low / max(1.0, float(mu.max()))
    return omega[np.sort(peaks)], low


def _find_broken(search: SkewedMargin, omega: np.ndarray, start: float) -> SkewedMargin:
    """Return the search with the smallest perturbation found that makes the loop unstable."""
    size = 1 / max(np.linalg.norm(response_by_channel(search.N, omega), axis=(0, 1)).max(), 1e-300)
    level = start or size
    M = np.moveaxis(response_by_channel(scaled_system(search, level), omega), 2, 0)
    found = search_perturbation(M, search.s, n_starts=2, rng=np.random.default_rng(0))
    assert found.delta is not None  # for a lower bound
    units = np.nan_to_num(np.moveaxis(found.delta, 2, 0) * found.value[:, None, None])
    crossing = find_crossing(
        search.N,
        search.s,
        least=1e-3 * level,
        limit=100 * level,
        growing=search.growing,
        seeds=units,
    )
    if crossing is not None:
        search = replace(search, broken=crossing.size, delta=crossing.delta, omega=crossing.omega)
    k = int(found.value.argmax())
    if (
        found.value[k] > 0
        and (search.growing.all() or found.value[k] >= 1)
        and level / found.value[k] < search.broken
    ):
        delta = found.delta[:, :, k] * search.sizes(level)
        search = replace(
            search, broken=level / float(found.value[k]), delta=delta, omega=float(omega[k])
        )
    return search


def _close_gap(search: SkewedMargin, start: float, gap: float) -> SkewedMargin:
    """Return the search with a proved level, as close to the counter-example as the parts of the
    box allow.
    """
    kept = search
    for share in _WHOLE_SHARES:
        level = share * min(start, search.broken, _MAX_FACTOR)
        if level:
            proof = certify_by_intervals(
                scaled_system(search, level), search.blocks, 1.0, most=_BOX_INTERVALS
            )
        else:
            proof = None
        if proof is not None and proof.holds:
            kept = replace(search, level=level, certificates=(proof,))
            break
    low, top = kept.level, np.inf
    if not search.real.size:
        reason = "the bound by scalings is no tighter, and no real block can be subdivided"
    else:
        reason = ""
    while search.broken > low * (1 + gap) and low < _MAX_FACTOR and not reason:
        level = _next_level(low, min(search.broken, top), gap)
        tried = _prove_level(replace(search, level=level, left=(search.left + 1) // 2))
        search = replace(search, left=search.left // 2 + tried.left)
        if not tried.reason:
            low, kept = tried.level, tried
        elif tried.broken < search.broken:
            search = replace(search, broken=tried.broken, delta=tried.delta, omega=tried.omega)
        else:
            top = level
            reason = tried.reason if search.left < 2 or top < low * (1 + 2 * gap) else ""
    met = search.broken <= low * (1 + gap) or low >= _MAX_FACTOR
    return replace(
        search,
        level=low,
        boxes=kept.boxes,
        certificates=kept.certificates,
        reason="" if met else reason,
    )


def _next_level(low: float, broken: float, gap: float) -> float:
    """Return the level to prove next: the last one before the gap if it is close, else one between
    the bounds.
    """
    near = min(broken, _MAX_FACTOR) / (1 + 0.9 * gap)
    if np.isinf(broken):
        if low:
            return min(2 * low, _MAX_FACTOR)
        return 1.0
    if near < 1.5 * low or not low:
        return near
    return float(np.sqrt(low * near))


def _prove_level(search: SkewedMargin) -> SkewedMargin:
    """Return the level proved on every part of the box; or a smaller counter-example; or the reason
    why it is open.
    """
    waiting, proved, proofs = list(search.boxes), [], []
    while waiting:
        if not search.left:
            return replace(
                search,
                reason=f"{len(waiting)} parts of the box are undecided at the limit of the search",
            )
        search, box = replace(search, left=max(search.left - _box_cost(search.s), 0)), waiting.pop()
        N = _box_system(search, box)
        if N is not None and _has_poles_of_nominal(search, N):
            proof, peak_at = _prove_box(search, N)
            if proof is not None:
                proved.append(box)
                proofs.append(proof)
                continue
            found = _try_box(search, N, box)
        else:
            peak_at = np.nan
            found = _try_perturbation(search, _place_parameters(search.s, box[0]))
        if found.broken < search.broken:
            return replace(found, reason="broken")
        parts = _split_box(search, box, peak_at)
        if not parts:
            return replace(
                search, reason="a part of the box is undecided and too thin to subdivide"
            )
        waiting += parts
    return replace(search, boxes=tuple(proved), certificates=tuple(proofs), reason="")


def _box_cost(s: BlockStructure) -> int:
    """Return the number of parts for which one part counts if it has very many scalings."""
    return max(1, (len(s.left) + len(s.skew)) ** 2 * s.shape[1] ** 2 // _BOX_WORK)


def _box_system(
    search: SkewedMargin, box: tuple[np.ndarray, np.ndarray]
) -> control.StateSpace | None:
    """Return the system that perturbations of size one close on a part of the box:

    Delta = middle + half delta.
    """
    s, (middle, half) = search.s, box
    N = scaled_system(search, search.level)
    C = _place_parameters(s, middle).real
    H = np.repeat(half, [col.stop - col.start for col in s.cols])
    return_difference = np.eye(s.shape[0]) - N.D @ C
    if np.linalg.cond(return_difference) > 1e12:
        return None
    y = np.linalg.solve(return_difference, np.hstack([N.C, N.D * H]))  # (rows, n + cols)
    y_x, y_v = y[:, : N.nstates], y[:, N.nstates :]
    return control.StateSpace(N.A + N.B @ C @ y_x, N.B @ (C @ y_v + np.diag(H)), y_x, y_v, N.dt)


def _has_poles_of_nominal(search: SkewedMargin, N: control.StateSpace) -> bool:
    """Return whether N has as many unstable poles as the system without a perturbation."""
    if not search.n_unstable:
        return decide_stability(N).stable
    return int(np.sum(boundary_excess(N.poles(), N) > 0)) == search.n_unstable


def _prove_box(search: SkewedMargin, N: control.StateSpace) -> tuple[Certificate | None, float]:
    """Return a proof that mu of a part stays below one, unless test frequencies contradict it; and
    the peak there.
    """
    omega = structure_grid(N)
    omega = omega[np.linspace(0, omega.size - 1, _N_TEST_FREQUENCIES).astype(int)]
    if np.isfinite(search.omega):
        omega = np.union1d(omega, search.omega * np.array([0.9, 0.97, 1.0, 1.03, 1.1]))
    mu = upper_bound(
        np.moveaxis(response_by_channel(N, omega), 2, 0), search.blocks, target=_BOUND_LIMIT
    ).value
    where = float(omega[mu.argmax()])
    if not mu.max() < _BOUND_LIMIT:
        return None, where
    proof = certify_by_intervals(N, search.blocks, 1.0, most=_BOX_INTERVALS)
    return (proof if proof.holds else None), where


def _try_box(
    search: SkewedMargin, N: control.StateSpace, box: tuple[np.ndarray, np.ndarray]
) -> SkewedMargin:
    """Return the search with a counter-example from a part of the box, if it is smaller than the
    known one.
    """
    found = find_crossing(N, search.s, least=1e-3, limit=1.0)
    if found is None:
        return search
    C = _place_parameters(search.s, box[0])
    H = np.repeat(box[1], [col.stop - col.start for col in search.s.cols])
    return _try_perturbation(search, C + H[:, None] * found.delta)


def _try_perturbation(search: SkewedMargin, E: np.ndarray) -> SkewedMargin:
    """Return the search with the smallest size at which this perturbation makes the loop unstable,
    if it is smaller.

    The perturbation has size one: it makes the loop unstable with the growing blocks at the level.
    """
    loop = PerturbedLoop.of(search.N, search.s, search.growing)
    high = next(
        (t for t in (1.0, 1.0 + 1e-6, 1.0 + 1e-3) if loop.excess(E[None], t * search.level)[0] > 0),
        None,
    )
    if high is None:
        return search
    found = verified_crossing(search.N, loop, E, loop.crossing_size(E, 0.0, high * search.level))
    if found is None or found.size * np.abs(E).max() >= search.broken:
        return search
    return replace(search, broken=found.size, delta=found.delta, omega=found.omega)


def _place_parameters(s: BlockStructure, x: np.ndarray) -> np.ndarray:
    """Return the perturbation (n_in, n_out) with the numbers (K,) in its real blocks."""
    delta = np.zeros(s.shape[::-1], complex)
    for kind, row, col, number in zip(s.kinds, s.rows, s.cols, x, strict=True):
        if kind == "real":
            delta[col, row] = number * np.eye(row.stop - row.start)
    return delta


def real_parameters(delta: np.ndarray, s: BlockStructure) -> np.ndarray:
    """Return (K,) the numbers of the real blocks of a perturbation, nan for the others."""
    return np.array(
        [
            delta[col.start, row.start].real if kind == "real" else np.nan
            for kind, row, col in zip(s.kinds, s.rows, s.cols, strict=True)
        ]
    )


def _split_box(
    search: SkewedMargin, box: tuple[np.ndarray, np.ndarray], omega: float
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the part cut in two across the parameter that lowers the bound at its peak most; none
    if it is thin.
    """
    middle, half = box
    found: list[list[tuple[np.ndarray, np.ndarray]]] = []
    for k in search.real:
        if half[k] >= _MIN_BOX_WIDTH:
            move = half * (np.arange(half.size) == k) / 2
            found.append([(middle - move, half - move), (middle + move, half - move)])
    if not found:
        return []
    worst = -np.array(
        [box[1].sum() - parts[0][1].sum() for parts in found]
    )  # by default the widest
    cut = [_box_system(search, part) for parts in found for part in parts]
    if np.isfinite(omega) and all(N is not None for N in cut):
        responses = np.concatenate(
            [np.moveaxis(response_by_channel(N, np.array([omega])), 2, 0) for N in cut]
        )
        worst = upper_bound(responses, search.blocks).value.reshape(-1, 2).max(axis=1)
    return found[int(worst.argmin())]
