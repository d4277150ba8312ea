"""The largest box of real parameters a loop bears, between a proof and a counter-example, by branch and bound.

Upper bounds of mu with real blocks may be far above it, and lower bounds find nothing between the lines of a grid. Cut
into smaller boxes both meet: around its own middle a small box is nearly a point. A level is proved box by box (each a
certificate at all frequencies), or a box turns up with a pole beyond the stability boundary (Balemi, Boyd &
Balakrishnan 1991; Newlin & Young 1997).
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import control
import numpy as np

from nlfrf.shared.arguments import positive
from nlfrf.shared.values import value
from robust.certificates.certificate import Certificate
from robust.certificates.stability import instability
from robust.mu.blocks import BlockStructure, fitting
from robust.mu.certify import certify_mu
from robust.mu.lower import searched
from robust.mu.real_parameters import crossing
from robust.mu.upper import bounded, refined
from robust.systems.grids import structure_grid
from robust.systems.lti import along
from robust.systems.realisation import multivariable

__all__ = ["ParameterMargin", "parameter_margin"]


LARGEST = 1e6  # factor beyond which nothing is looked for
FEW = 32  # frequencies that tell whether a box is worth a proof
ROOM = 0.999  # what the bound there has to stay below
THINNEST = 1e-3  # of the whole box: thinner ones are not cut any more
PROOF = 5.0  # [s] for one box


@value
class ParameterMargin:
    """Between which factors on all perturbations a loop loses its stability.

    Fields
    ------
    proved : float
        Factor up to which it is stable for every parameter of the box and every perturbation; 0: nothing is proved.
    broken : float
        Factor at which a perturbation that was found breaks it; inf where none was found.
    worst : (r,) ndarray
        The parameters at `broken`, of size up to one as in `boxes`, block by block; nan for a complex block.
    omega : float
        Where the pole crosses [rad/s].
    boxes : (L, r, 2) ndarray
        Ends of the boxes into which the box was cut at `proved`, of size up to one.
    certificates : tuple of Certificate
        The proof on each of them, at all frequencies.
    met : bool
        Whether broken is within the gap of proved.
    reason : str
        Why not.

    References
    ----------
    Balemi, Boyd & Balakrishnan 1991; Newlin & Young 1997.

    Examples
    --------
    >>> lag = control.ss([[-5.0]], [[1.0]], [[1.0]], [[0.0]])           # s + 5 - d
    >>> found = parameter_margin(lag, [(1, 1, "real")])
    >>> round(found.broken, 3), bool(4.75 < found.proved < 5)
    (5.0, True)
    """

    proved: float
    broken: float
    worst: np.ndarray
    omega: float
    boxes: np.ndarray
    certificates: tuple[Certificate, ...]
    met: bool
    reason: str


@value(copy=False)
class Search:
    """A loop, what breaks it, and the boxes that were proved at a level.

    Fields
    ------
    N : control.StateSpace
    s : BlockStructure
    blocks : list
    deadline : float
        Of time.monotonic().
    level, broken, worst, omega
        As in the result.
    boxes : list of (middle, half) of (r,) ndarray
        Boxes to look at, or those that were proved; complex blocks stay whole.
    certificates : tuple
        Of the latter.
    reason : str
        Why a level could not be proved: empty where it was.
    """

    N: control.StateSpace
    s: BlockStructure
    blocks: Any
    deadline: float
    level: float
    broken: float
    worst: np.ndarray
    omega: float
    boxes: tuple[tuple[np.ndarray, np.ndarray], ...]
    certificates: tuple[Certificate, ...] = ()
    reason: str = ""


def parameter_margin(N_ss: Any, blocks: Any, *, gap: float = 0.05, time_cap: float = 60.0) -> ParameterMargin:
    """Find how large real parameters may be, to a stated gap: proved on every part of the box, broken just above.

    Parameters
    ----------
    N_ss : control.StateSpace
        Stable system that the perturbation closes (`UncertainSystem.loop`), continuous or discrete.
    blocks : list
        As for `mu_upper`, at least one of them real. Real blocks are cut, complex ones are taken whole.
    gap : float
        Relative distance between what is proved and what breaks the loop.
    time_cap : float
        Seconds; the margins known by then are returned, and why they are not closer.

    Returns
    -------
    ParameterMargin
        The margins are those of the perturbations all at once: 1 over the structured singular value.

    Raises
    ------
    ValueError
        Blocks that do not add up to N_ss or none of them real, a system that is not stable.

    References
    ----------
    Balemi, Boyd & Balakrishnan 1991; Newlin & Young 1997; de Gaston & Safonov 1988.

    Examples
    --------
    One parameter in two places, (s + 1)^2 + d^2: complex ones of size one break it, real ones of no size do.

    >>> N = control.ss(-np.eye(2), np.eye(2), [[0.0, 1.0], [-1.0, 0.0]], np.zeros((2, 2)))
    >>> found = parameter_margin(N, [(2, 2, "real")])
    >>> found.broken, found.proved > 100
    (inf, True)
    """
    N = multivariable("N_ss", N_ss)
    s = fitting("blocks", blocks, (N.noutputs, N.ninputs), of="N_ss")
    gap, deadline = positive("gap", gap), time.monotonic() + positive("time_cap", time_cap)
    if "real" not in s.kinds:
        raise ValueError("blocks must hold a real one, got none: certify_mu is for complex ones")
    nominal = instability(N)
    if not nominal.stable:
        raise ValueError(f"N_ss must be stable, got one that is {nominal}")
    search, low = begun(N, s, blocks, deadline)
    kept = search
    while search.broken > low * (1 + gap) and low < LARGEST:
        tried = decided(replace(search, level=next_level(low, search.broken, gap), reason=""))
        if tried.reason and not tried.broken < search.broken:
            kept = replace(kept, reason=tried.reason)
            break
        if not tried.reason:
            low, kept, search = tried.level, tried, tried
        else:
            search = replace(search, broken=tried.broken, worst=tried.worst, omega=tried.omega)
    middles, halves = (np.array([box[k] for box in kept.boxes]).reshape(-1, len(s.kinds)) for k in (0, 1))
    met = bool(search.broken <= low * (1 + gap) or low >= LARGEST)
    return ParameterMargin(
        proved=low,
        broken=search.broken,
        worst=search.worst,
        omega=search.omega,
        boxes=np.stack([middles - halves, middles + halves], axis=-1),
        certificates=kept.certificates,
        met=met,
        reason="" if met else kept.reason,
    )


def next_level(low: float, broken: float, gap: float) -> float:
    """The level to be proved next: all that the gap leaves where that is near, else between what is known."""
    near = min(broken, LARGEST) / (1 + 0.9 * gap)
    if np.isinf(broken):
        return min(2 * low, LARGEST) if low else 1.0
    return near if near < 1.5 * low or not low else float(np.sqrt(low * near))


def begun(N: control.StateSpace, s: BlockStructure, blocks: Any, deadline: float) -> tuple[Search, float]:
    """What the bounds of mu say of the whole box, and the factor proved."""
    now, r = time.monotonic(), len(s.kinds)
    omega = structure_grid(N)
    omega = omega[:: max(1, omega.size // FEW)]  # a first guess: what counts is proved or broken later
    omega, mu = refined(N, blocks, omega, now + 0.3 * (deadline - now))
    whole = ((np.zeros(r), np.ones(r)),)
    search = Search(
        N=N,
        s=s,
        blocks=blocks,
        deadline=deadline,
        level=0.0,
        broken=np.inf,
        worst=np.full(r, np.nan),
        omega=np.nan,
        boxes=whole,
    )
    peak = max(float(mu.max()), 1 / LARGEST)
    search = broken_by_poles(search, N, (np.zeros(r), np.ones(r)), 1e-3 / peak, 100 / peak)
    at = np.sort(np.argsort(-mu)[:4])
    found = searched(
        np.moveaxis(along(N, omega[at]), 2, 0), s, 2, np.random.default_rng(0), now + 0.4 * (deadline - now)
    )
    k = int(found.value.argmax())
    if found.value[k] > 0 and 1 / found.value[k] < search.broken:
        x = parameters_of(found.delta[:, :, k], s) * float(found.value[k])
        search = replace(search, broken=1 / float(found.value[k]), worst=x, omega=float(omega[at[k]]))
    level = min(0.99 / peak, LARGEST)
    proof = certify_mu(N, blocks, 1 / level, time_cap=max(min(PROOF, deadline - time.monotonic()), 0.1))
    if not proof.holds:
        return search, 0.0
    return replace(search, level=level, certificates=(proof,)), level


def decided(search: Search) -> Search:
    """The level proved on every part of the box; or broken below it, or the reason why it stays open."""
    level, waiting, proved, proofs = search.level, list(search.boxes), [], []
    while waiting:
        if time.monotonic() > search.deadline:
            return replace(search, reason=f"the time cap was reached with {len(waiting)} parts of the box open")
        box = waiting.pop()
        N = part_of(search, box)
        if N is not None and instability(N).stable:
            proof, peak_at = proof_of(search, N)
            if proof is not None:
                proved.append(box)
                proofs.append(proof)
                continue
            found = broken_by_poles(search, N, box, 1e-3, 1.0)
            if found.broken < search.broken:
                return replace(found, reason="broken")
        else:
            peak_at = np.nan
            found = along_ray(search, level * box[0])
            if found.broken < search.broken:
                return replace(found, reason="broken")
        parts = halves_of(search, box, peak_at)
        if not parts:
            return replace(search, reason="a part of the box is too thin to be cut, and open")
        waiting += parts
    return replace(search, boxes=tuple(proved), certificates=tuple(proofs), reason="")


def part_of(search: Search, box: tuple[np.ndarray, np.ndarray]) -> control.StateSpace | None:
    """What perturbations of size one close of a part of the box at the level: Delta = middle + half delta."""
    N, s, (middle, half) = search.N, search.s, box
    C, H = np.zeros(s.shape[::-1]), np.zeros(s.shape[1])
    for k, (row, col) in enumerate(zip(s.rows, s.cols, strict=True)):
        H[col] = search.level * half[k]
        if s.kinds[k] == "real":
            C[col, row] = search.level * middle[k] * np.eye(row.stop - row.start)
    around = np.eye(s.shape[0]) - N.D @ C
    if np.linalg.cond(around) > 1e12:
        return None
    y = np.linalg.solve(around, np.hstack([N.C, N.D * H]))  # (rows, n + cols)
    y_x, y_v = y[:, : N.nstates], y[:, N.nstates :]
    return control.StateSpace(N.A + N.B @ C @ y_x, N.B @ (C @ y_v + np.diag(H)), y_x, y_v, N.dt)


def proof_of(search: Search, N: control.StateSpace) -> tuple[Certificate | None, float]:
    """The proof that mu of a part stays below one, where a few frequencies do not contradict it; and where it peaks."""
    omega = structure_grid(N)
    omega = omega[np.linspace(0, omega.size - 1, FEW).astype(int)]
    if np.isfinite(search.omega):
        omega = np.union1d(omega, search.omega * np.array([0.9, 0.97, 1.0, 1.03, 1.1]))
    mu = bounded(np.moveaxis(along(N, omega), 2, 0), search.blocks, ROOM, search.deadline).value
    where = float(omega[mu.argmax()])
    if not mu.max() < ROOM:
        return None, where
    left = max(min(PROOF, search.deadline - time.monotonic()), 0.05)
    proof = certify_mu(N, search.blocks, 1.0, time_cap=left)
    return (proof if proof.holds else None), where


def broken_by_poles(
    search: Search, N: control.StateSpace, box: tuple[np.ndarray, np.ndarray], least: float, most: float
) -> Search:
    """With parameters of a part that take a pole across the boundary, if they are smaller than those known."""
    found = crossing(N, search.s, least, most, time_cap=min(1.0, max(search.deadline - time.monotonic(), 0.01)))
    if found is None:
        return search
    middle, half = box
    scale = search.level or 1.0
    return along_ray(search, scale * (middle + half * np.nan_to_num(parameters_of(found.delta, search.s))))


def along_ray(search: Search, x: np.ndarray) -> Search:
    """With the smallest multiple of these parameters that breaks the loop, if it is smaller than what is known."""
    size = float(np.abs(x).max())
    if not size:
        return search
    point = replace(search, level=1.0)

    def unstable(t: float) -> bool:
        N = part_of(point, (t * x, np.zeros(x.size)))
        return N is None or instability(N).unstable

    high = next((t for t in (1.0, 1.0 + 1e-6, 1.0 + 1e-3) if unstable(t)), None)
    if high is None or high * size >= search.broken:
        return search
    low = 0.0
    for _ in range(50):
        middle = (low + high) / 2
        low, high = (low, middle) if unstable(middle) else (middle, high)
        if high - low < 1e-9 * high:
            break
    N = part_of(point, (high * x, np.zeros(x.size)))
    poles = np.linalg.eigvals(N.A) if N is not None else np.array([np.nan + 0j])
    pole = poles[np.argmax(np.abs(poles) if N is not None and N.dt else poles.real)]
    omega = float(abs(np.angle(pole)) / N.dt) if N is not None and N.dt else float(abs(pole.imag))
    real = np.array([kind == "real" for kind in search.s.kinds])
    return replace(search, broken=high * size, worst=np.where(real, x / size, np.nan), omega=omega)


def parameters_of(delta: np.ndarray, s: BlockStructure) -> np.ndarray:
    """(r,) the numbers of the real blocks of a perturbation, nan for the others."""
    return np.array(
        [
            delta[col.start, row.start].real if kind == "real" else np.nan
            for kind, row, col in zip(s.kinds, s.rows, s.cols, strict=True)
        ]
    )


def halves_of(search: Search, box: tuple[np.ndarray, np.ndarray], omega: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """The part cut in two across the parameter for which the bound where it peaks falls most; none where it is thin."""
    middle, half = box
    best: tuple[float, list[Any]] = (np.inf, [])
    for k in np.flatnonzero([kind == "real" for kind in search.s.kinds]):
        if half[k] < THINNEST:
            continue
        move = half * (np.arange(half.size) == k) / 2
        parts = [(middle - move, half - move), (middle + move, half - move)]
        worst = -half[k]
        if np.isfinite(omega):
            cut = [part_of(search, part) for part in parts]
            if all(N is not None for N in cut):
                responses = np.concatenate([np.moveaxis(along(N, np.array([omega])), 2, 0) for N in cut])
                worst = float(bounded(responses, search.blocks, 0.0, search.deadline).value.max())
        if worst < best[0]:
            best = (worst, parts)
    return best[1]
