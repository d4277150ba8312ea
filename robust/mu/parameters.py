"""The largest box of real parameters a loop bears, between a proof and a counter-example, by branch and bound.

Upper bounds of mu with real blocks may be far above it, and lower bounds find nothing between the lines of a grid. Cut
into smaller boxes both meet: around its own middle a small box is nearly a point. A level is proved box by box (each a
certificate at all frequencies), or a box turns up with a pole beyond the stability boundary (Balemi, Boyd &
Balakrishnan 1991; Newlin & Young 1997).
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import control
import numpy as np

from nlfrf._base.arguments import require_integer, require_positive
from nlfrf._base.values import value
from robust._base.types import Blocks, LinearSystem
from robust.lti.grids import structure_grid
from robust.lti.lti import response_by_channel, timebase, to_s_plane
from robust.lti.realisation import multivariable
from robust.mu.blocks import BlockStructure, structure_for
from robust.mu.certification import certify_by_intervals
from robust.mu.perturbations import search_perturbation
from robust.mu.scalings import refine_grid, upper_bound
from robust.proofs.search.certificate import Certificate
from robust.proofs.search.stability import decide_stability

# ---- The smallest real parameters that take a loop to its stability boundary, found by its poles.
#
# Real numbers make a loop singular at isolated frequencies only, and a grid of frequencies steps over them. Poles need
# no
# grid: they are followed from the nominal loop outwards, along the corners of the box and along some directions inside
# it, and from the best of them uphill (de Gaston & Safonov 1988 look at corners; first-order moves as in Seiler 2010).
# What is found is a fact about the loop; that nothing was found proves nothing.

MAX_CORNER_PARAMETERS = 6  # parameters up to which every corner is looked at
N_DIRECTIONS = 48  # random directions beside them
N_SIZES = 24  # sizes looked at on the way out
N_IMPROVEMENTS = 12  # attempts to do better from the best direction


@value
class Crossing:
    """Real parameters that bring a pole to the stability boundary.

    Fields
    ------
    size : float
        Largest modulus of the parameters.
    delta : (n_in, n_out) ndarray
        The perturbation, zero but for its real blocks.
    omega : float
        Where the pole crosses [rad/s].
    """

    size: float
    delta: np.ndarray
    omega: float


@value(copy=False)
class ParametricLoop:
    """A loop as a function of its real parameters x (K, r), one for each real block.

    Fields
    ------
    A, B, C, D : ndarray
        The loop, cut to the channels of the real blocks.
    of : (m,) int ndarray
        Which parameter closes each of these channels.
    dt : float
        Sampling time [s], 0 for continuous.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    of: np.ndarray
    dt: float

    def closed(self, x: np.ndarray) -> np.ndarray:
        """Return (K, n, n) state matrices."""
        d = x[:, self.of]
        return_difference = np.eye(len(self.of)) - self.D * d[:, None, :]
        return np.asarray(self.A + self.B @ (d[:, :, None] * np.linalg.solve(return_difference, self.C[None])))

    def excess(self, x: np.ndarray) -> np.ndarray:
        """(K,) how far the farthest pole is beyond the stability boundary; inf where the loop has no solution."""
        try:
            poles = np.linalg.eigvals(self.closed(x))
        except np.linalg.LinAlgError:
            return np.full(len(x), np.inf)
        return np.asarray((np.abs(poles) - 1 if self.dt else poles.real).max(axis=1))

    def slope(self, x: np.ndarray) -> np.ndarray:
        """Return (r,) how the excess grows with each parameter."""
        values, right = np.linalg.eig(self.closed(x[None])[0])
        k = int(np.argmax(np.abs(values) if self.dt else values.real))
        left = np.linalg.pinv(right)[k]
        d = x[self.of]
        return_difference = np.eye(len(d)) - self.D * d
        reads = np.linalg.solve(return_difference, self.C @ right[:, k])  # (I - D d)^-1 C r
        drives = np.linalg.solve(np.eye(len(d)) - (d[:, None] * self.D).T, self.B.T @ left)
        turn = values[k].conj() / abs(values[k]) if self.dt else 1.0
        moves = (turn * drives * reads).real
        return np.bincount(self.of, weights=moves, minlength=x.size)


def find_crossing(N: control.StateSpace, s: BlockStructure, *, least: float, limit: float) -> Crossing | None:
    """Return the smallest real parameters found that take a stable loop to the boundary.

    Parameters
    ----------
    N : control.StateSpace
        What the perturbation closes, stable.
    s : BlockStructure
        Complex blocks stay at zero.
    least, limit : float
        Sizes between which they are looked for.
    """
    if "real" not in s.kinds or not N.nstates or least >= limit:
        return None
    real = [k for k, kind in enumerate(s.kinds) if kind == "real"]
    rows, cols = (np.concatenate([np.arange(cut[k].start, cut[k].stop) for k in real]) for cut in (s.rows, s.cols))
    of = np.repeat(np.arange(len(real)), [s.rows[k].stop - s.rows[k].start for k in real])
    loop = ParametricLoop(A=N.A, B=N.B[:, cols], C=N.C[rows], D=N.D[np.ix_(rows, cols)], of=of, dt=timebase(N))
    return_difference = search_directions(len(real))
    inner = 0.0
    for size in np.geomspace(least, limit, N_SIZES):
        excess = loop.excess(size * return_difference)
        if excess.max() > 0:
            break
        inner = size
    if excess.max() <= 0:
        return None
    y = return_difference[excess.argmax()]
    size = bisect_direction(loop, y, inner=inner, outer=size)
    for _ in range(N_IMPROVEMENTS):
        # uphill at the present size: the best corner by the slope, and part of the way to it
        better = np.sign(loop.slope(size * y))
        tried = np.concatenate([y + np.linspace(0.1, 1, 10)[:, None] * (better - y), return_difference])
        excess = loop.excess(0.999 * size * tried)
        if excess.max() <= 0:
            break
        y = tried[excess.argmax()]
        size = bisect_direction(loop, y, inner=0.0, outer=0.999 * size)
        y, size = y / np.abs(y).max(), size * float(np.abs(y).max())
    delta = np.zeros(s.shape[::-1])
    delta[cols, rows] = size * y[of]
    at, beyond = loop.closed(size * y * np.array([[1.0], [1.001]]))
    farther = control.StateSpace(beyond, np.zeros((N.nstates, 1)), np.zeros((1, N.nstates)), 0.0, N.dt)
    if not decide_stability(farther).unstable:
        return None
    poles = np.linalg.eigvals(at)
    pole = poles[np.argmax(np.abs(poles) if loop.dt else poles.real)]
    omega = abs(to_s_plane(np.array([pole]), loop.dt)[0].imag)
    return Crossing(size=float(size), delta=delta, omega=float(omega))


def search_directions(n: int) -> np.ndarray:
    """Return (K, n) corners of the box, all of them or some, each parameter alone, and points inside."""
    rng = np.random.default_rng(0)
    corners = (
        np.array(list(product((-1.0, 1.0), repeat=n)))
        if n <= MAX_CORNER_PARAMETERS
        else np.sign(rng.standard_normal((64, n)))
    )
    inside = rng.uniform(-1, 1, (N_DIRECTIONS, n))
    inside /= np.abs(inside).max(axis=1, keepdims=True)
    return np.concatenate([corners, np.eye(n), -np.eye(n), inside]) if n > 1 else corners


def bisect_direction(loop: ParametricLoop, y: np.ndarray, *, inner: float, outer: float) -> float:
    """Return the size between a stable and an unstable one where the direction y crosses, from above."""
    for _ in range(40):
        middle = (inner + outer) / 2
        if loop.excess((middle * y)[None])[0] > 0:
            outer = middle
        else:
            inner = middle
        if outer - inner <= 1e-9 * outer:
            break
    return outer


MAX_FACTOR = 1e6  # factor beyond which nothing is looked for
N_TEST_FREQUENCIES = 32  # frequencies that tell whether a box is worth a proof
BOUND_LIMIT = 0.999  # what the bound there has to stay below
MIN_BOX_WIDTH = 1e-3  # of the whole box: thinner ones are not cut any more
MOST_BOXES, BOX_INTERVALS = 150, 500  # parts of the box looked at, and intervals of frequency of each
BOX_WORK = 100_000  # products of numbers of a step for the scalings of a part that counts once


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
class BoxSearch:
    """A loop, what breaks it, and the boxes that were proved at a level.

    Fields
    ------
    N : control.StateSpace
    s : BlockStructure
    blocks : list
    left : int
        How many parts of the box may be looked at.
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
    blocks: Blocks
    left: int
    level: float
    broken: float
    worst: np.ndarray
    omega: float
    boxes: tuple[tuple[np.ndarray, np.ndarray], ...]
    certificates: tuple[Certificate, ...] = ()
    reason: str = ""


def parameter_margin(
    N_ss: LinearSystem, blocks: Blocks, *, gap: float = 0.05, max_boxes: int = MOST_BOXES
) -> ParameterMargin:
    """Find how large real parameters may be, to a stated gap: proved on every part of the box, broken just above.

    Parameters
    ----------
    N_ss : control.StateSpace
        Stable system that the perturbation closes (`UncertainSystem.loop`), continuous or discrete.
    blocks : list
        As for `upper`, at least one of them real. Real blocks are cut, complex ones are taken whole.
    gap : float
        Relative distance between what is proved and what breaks the loop.
    max_boxes : int
        Parts of the box to look at; the margins known by then are returned, and why they are not closer.

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
    s = structure_for("blocks", blocks, (N.noutputs, N.ninputs), of="N_ss")
    gap, left = require_positive("gap", gap), require_integer("max_boxes", max_boxes, least=1)
    if "real" not in s.kinds:
        raise ValueError("blocks must hold a real one, got none: robust.mu.certify is for complex ones")
    nominal = decide_stability(N)
    if not nominal.stable:
        raise ValueError(f"N_ss must be stable, got one that is {nominal}")
    search, low = begin_search(N, s, blocks=blocks, left=left)
    kept = search
    while search.broken > low * (1 + gap) and low < MAX_FACTOR:
        tried = prove_level(replace(search, level=next_level(low, search.broken, gap), reason=""))
        if tried.reason and not tried.broken < search.broken:
            kept = replace(kept, reason=tried.reason)
            break
        if not tried.reason:
            low, kept, search = tried.level, tried, tried
        else:
            search = replace(search, broken=tried.broken, worst=tried.worst, omega=tried.omega)
    middles, halves = (np.array([box[k] for box in kept.boxes]).reshape(-1, len(s.kinds)) for k in (0, 1))
    met = bool(search.broken <= low * (1 + gap) or low >= MAX_FACTOR)
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
    """Return the level to be proved next: all that the gap leaves where that is near, else between what is known."""
    near = min(broken, MAX_FACTOR) / (1 + 0.9 * gap)
    if np.isinf(broken):
        return min(2 * low, MAX_FACTOR) if low else 1.0
    return near if near < 1.5 * low or not low else float(np.sqrt(low * near))


def begin_search(N: control.StateSpace, s: BlockStructure, *, blocks: Blocks, left: int) -> tuple[BoxSearch, float]:
    """Return what the bounds of mu say of the whole box, and the factor proved."""
    r = len(s.kinds)
    omega = structure_grid(N)
    omega = omega[:: max(1, omega.size // N_TEST_FREQUENCIES)]  # a first guess: what counts is proved or broken later
    omega, mu = refine_grid(N, blocks, omega=omega)
    whole = ((np.zeros(r), np.ones(r)),)
    search = BoxSearch(
        N=N,
        s=s,
        blocks=blocks,
        left=left,
        level=0.0,
        broken=np.inf,
        worst=np.full(r, np.nan),
        omega=np.nan,
        boxes=whole,
    )
    peak = max(float(mu.max()), 1 / MAX_FACTOR)
    search = try_poles(search, N, box=(np.zeros(r), np.ones(r)), least=1e-3 / peak, most=100 / peak)
    at = np.sort(np.argsort(-mu)[:4])
    found = search_perturbation(
        np.moveaxis(response_by_channel(N, omega[at]), 2, 0),
        s,
        n_starts=2,
        rng=np.random.default_rng(0),
    )
    k = int(found.value.argmax())
    if found.delta is not None and found.value[k] > 0 and 1 / found.value[k] < search.broken:
        x = real_parameters(found.delta[:, :, k], s) * float(found.value[k])
        search = replace(search, broken=1 / float(found.value[k]), worst=x, omega=float(omega[at[k]]))
    level = min(0.99 / peak, MAX_FACTOR)
    proof = certify_by_intervals(N, blocks, 1 / level, most=BOX_INTERVALS)
    if not proof.holds:
        return search, 0.0
    return replace(search, level=level, certificates=(proof,)), level


def prove_level(search: BoxSearch) -> BoxSearch:
    """Return the level proved on every part of the box; or broken below it, or the reason why it stays open."""
    level, waiting, proved, proofs = search.level, list(search.boxes), [], []
    while waiting:
        if not search.left:
            return replace(search, reason=f"{len(waiting)} parts of the box are open, and no more are looked at")
        search, box = replace(search, left=max(search.left - box_cost(search.s), 0)), waiting.pop()
        N = box_system(search, box)
        if N is not None and decide_stability(N).stable:
            proof, peak_at = prove_box(search, N)
            if proof is not None:
                proved.append(box)
                proofs.append(proof)
                continue
            found = try_poles(search, N, box=box, least=1e-3, most=1.0)
            if found.broken < search.broken:
                return replace(found, reason="broken")
        else:
            peak_at = np.nan
            found = try_multiple(search, level * box[0])
            if found.broken < search.broken:
                return replace(found, reason="broken")
        parts = split_box(search, box, peak_at)
        if not parts:
            return replace(search, reason="a part of the box is too thin to be cut, and open")
        waiting += parts
    return replace(search, boxes=tuple(proved), certificates=tuple(proofs), reason="")


def box_cost(s: BlockStructure) -> int:
    """Return as how many parts of the box one counts, where its scalings are very many."""
    return max(1, (len(s.left) + len(s.skew)) ** 2 * s.shape[1] ** 2 // BOX_WORK)


def box_system(search: BoxSearch, box: tuple[np.ndarray, np.ndarray]) -> control.StateSpace | None:
    """Return what perturbations of size one close of a part of the box at the level: Delta = middle + half delta."""
    N, s, (middle, half) = search.N, search.s, box
    C, H = np.zeros(s.shape[::-1]), np.zeros(s.shape[1])
    for k, (row, col) in enumerate(zip(s.rows, s.cols, strict=True)):
        H[col] = search.level * half[k]
        if s.kinds[k] == "real":
            C[col, row] = search.level * middle[k] * np.eye(row.stop - row.start)
    return_difference = np.eye(s.shape[0]) - N.D @ C
    if np.linalg.cond(return_difference) > 1e12:
        return None
    y = np.linalg.solve(return_difference, np.hstack([N.C, N.D * H]))  # (rows, n + cols)
    y_x, y_v = y[:, : N.nstates], y[:, N.nstates :]
    return control.StateSpace(N.A + N.B @ C @ y_x, N.B @ (C @ y_v + np.diag(H)), y_x, y_v, N.dt)


def prove_box(search: BoxSearch, N: control.StateSpace) -> tuple[Certificate | None, float]:
    """The proof that mu of a part stays below one, where a few frequencies do not contradict it; and where it peaks."""
    omega = structure_grid(N)
    omega = omega[np.linspace(0, omega.size - 1, N_TEST_FREQUENCIES).astype(int)]
    if np.isfinite(search.omega):
        omega = np.union1d(omega, search.omega * np.array([0.9, 0.97, 1.0, 1.03, 1.1]))
    mu = upper_bound(np.moveaxis(response_by_channel(N, omega), 2, 0), search.blocks, target=BOUND_LIMIT).value
    where = float(omega[mu.argmax()])
    if not mu.max() < BOUND_LIMIT:
        return None, where
    proof = certify_by_intervals(N, search.blocks, 1.0, most=BOX_INTERVALS)
    return (proof if proof.holds else None), where


def try_poles(
    search: BoxSearch, N: control.StateSpace, *, box: tuple[np.ndarray, np.ndarray], least: float, most: float
) -> BoxSearch:
    """With parameters of a part that take a pole across the boundary, if they are smaller than those known."""
    found = find_crossing(N, search.s, least=least, limit=most)
    if found is None:
        return search
    middle, half = box
    scale = search.level or 1.0
    return try_multiple(search, scale * (middle + half * np.nan_to_num(real_parameters(found.delta, search.s))))


def try_multiple(search: BoxSearch, x: np.ndarray) -> BoxSearch:
    """With the smallest multiple of these parameters that breaks the loop, if it is smaller than what is known."""
    size = float(np.abs(x).max())
    if not size:
        return search
    point = replace(search, level=1.0)

    def unstable(t: float) -> bool:
        N = box_system(point, (t * x, np.zeros(x.size)))
        return N is None or decide_stability(N).unstable

    high = next((t for t in (1.0, 1.0 + 1e-6, 1.0 + 1e-3) if unstable(t)), None)
    if high is None or high * size >= search.broken:
        return search
    low = 0.0
    for _ in range(50):
        middle = (low + high) / 2
        low, high = (low, middle) if unstable(middle) else (middle, high)
        if high - low < 1e-9 * high:
            break
    N = box_system(point, (high * x, np.zeros(x.size)))
    poles = np.linalg.eigvals(N.A) if N is not None else np.array([np.nan + 0j])
    pole = poles[np.argmax(np.abs(poles) if N is not None and N.dt else poles.real)]
    omega = float(abs(np.angle(pole)) / N.dt) if N is not None and N.dt else float(abs(pole.imag))
    real = np.array([kind == "real" for kind in search.s.kinds])
    return replace(search, broken=high * size, worst=np.where(real, x / size, np.nan), omega=omega)


def real_parameters(delta: np.ndarray, s: BlockStructure) -> np.ndarray:
    """Return (r,) the numbers of the real blocks of a perturbation, nan for the others."""
    return np.array(
        [
            delta[col.start, row.start].real if kind == "real" else np.nan
            for kind, row, col in zip(s.kinds, s.rows, s.cols, strict=True)
        ]
    )


def split_box(
    search: BoxSearch, box: tuple[np.ndarray, np.ndarray], omega: float
) -> list[tuple[np.ndarray, np.ndarray]]:
    """The part cut in two across the parameter for which the bound where it peaks falls most; none where it is thin."""
    middle, half = box
    best: tuple[float, list[tuple[np.ndarray, np.ndarray]]] = (np.inf, [])
    for k in np.flatnonzero([kind == "real" for kind in search.s.kinds]):
        if half[k] < MIN_BOX_WIDTH:
            continue
        move = half * (np.arange(half.size) == k) / 2
        parts = [(middle - move, half - move), (middle + move, half - move)]
        worst = -half[k]
        if np.isfinite(omega):
            cut = [box_system(search, part) for part in parts]
            if all(N is not None for N in cut):
                responses = np.concatenate([np.moveaxis(response_by_channel(N, np.array([omega])), 2, 0) for N in cut])
                worst = float(upper_bound(responses, search.blocks).value.max())
        if worst < best[0]:
            best = (worst, parts)
    return best[1]
