"""Lower bounds on the structured singular value: a perturbation that makes the loop singular,
verified.

For an eigenvalue lambda = l* N Delta r of the loop, the smallest Delta of the structure with l* N
Delta r = 1 is known in closed form: it moves the eigenvalue most. The perturbation is moved towards
it as far as the eigenvalue grows. With complex blocks only this is ascent on the spectral radius,
with the fixed points of the power iteration of Packard, Fan & Doyle 1988. Real blocks may end
between their limits, where the power iteration does not converge (Young & Doyle 1990; Seiler,
Packard & Balas 2010). If all blocks are real numbers, the determinant is affine in each of them.
The smallest perturbation then usually has all numbers but one at their limits. Perturbations of
this kind are computed exactly, from the roots of a polynomial.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from nlfrf._base.arguments import random_generator, require_integer
from nlfrf._base.types import Seed
from nlfrf._base.values import value
from robust._base.types import Blocks
from robust.mu.blocks import BlockStructure, structure_for
from robust.mu.scalings import MuBound, optimal_scalings, response_matrices, scaled_square

_RACE, _FINISH = 12, 400  # steps from every start, and from the best starts
_N_FINISHERS = 3
_STARTS_OF_REAL = 4  # factor on the starts for real blocks, which have many local maxima
_SINGULARITY_TOLERANCE = 1e-8
_BOUNDS_MEET = 1e-6  # relative distance of the bounds at which they count as equal
MOVES = (1.0, 0.5, 0.2, 0.07, 0.02)  # shares of the way to the smallest perturbation
_GROWTH = 1e-9  # relative growth of the eigenvalue below which the ascent stops
_N_ANGLES = 24
# largest number of real numbers for all signs: n 2^(n-2) polynomials at each frequency
_MOST_NUMBERS = 8
# relative imaginary part of a root that counts as rounding; the result is verified
_REAL_ROOT = 1e-6
_EIGENVALUE_TURNS = 2.0  # least penalty of an imaginary part


@value(copy=False)
class _Mode:
    """An eigenvalue of N Delta for every matrix."""

    value: np.ndarray  # (W,) the eigenvalue lambda
    # drive, right: (W, n_in) or (W, n_out) l* N and r of its eigenvectors, l* r = 1: it changes by
    # drive d(Delta) right
    drive: np.ndarray
    right: np.ndarray


def lower(N: np.ndarray, blocks: Blocks, *, n_starts: int = 6, rng: Seed = 0) -> MuBound:
    """Return a lower bound of mu, from the smallest destabilising perturbation that is found.

    Parameters
    ----------
    N : (n_out, n_in, W) ndarray
        Complex response of the system to which the perturbation is connected.
    blocks : list
        As for `upper`.
    n_starts : int
        Number of random starts at each frequency, in addition to a start from the singular vectors.
        With real blocks four times as many are used.
    rng : Generator, int or None
        Random generator for the starts.

    Returns
    -------
    MuBound
        `value` is 1 over the largest singular value of `delta`, a perturbation with the structure
        of the blocks for which det(I - N delta) = 0 is verified. If none was found, `value` is zero
        and `delta` is nan. With real blocks `value` may be below mu, and mu may be well below the
        upper bound.

    Raises
    ------
    ValueError
        Blocks that do not add up to N, numbers that are not finite.

    References
    ----------
    SP 8.8.1; Packard, Fan & Doyle 1988; Young & Doyle 1990, Seiler, Packard & Balas 2010 (real
    blocks).

    Examples
    --------
    >>> M = np.array([[2, 2], [-1, -1]])[:, :, None]
    >>> bound = lower(M, [(1, 1), (1, 1)])
    >>> around = np.eye(2) - M[:, :, 0] @ bound.delta[:, :, 0]
    >>> round(float(bound.value[0]), 6), abs(np.linalg.det(around)).round(9).item()
    (3.0, 0.0)
    """
    M = response_matrices("N", N)
    n_starts = require_integer("n_starts", n_starts, least=0)
    unit = np.ldexp(
        1.0, np.frexp(np.abs(M).max(axis=(1, 2)))[1] - 1
    )  # numbers near one, whose squares do not overflow
    found = search_perturbation(
        M / unit[:, None, None],
        structure_for("blocks", blocks, M.shape[1:]),
        n_starts=n_starts,
        rng=random_generator("rng", rng),
    )
    assert found.delta is not None  # for a lower bound
    return replace(found, value=found.value * unit, delta=found.delta / unit)


def search_perturbation(
    M: np.ndarray, s: BlockStructure, *, n_starts: int, rng: np.random.Generator
) -> MuBound:
    """Return the largest lower bound found on (W, n_out, n_in) matrices."""
    W = len(M)
    left, right, bound = _worst_directions(M, s)
    count = 1 + n_starts * (_STARTS_OF_REAL if s.skew.size else 1)
    starts = [
        _perturbation_from_directions(left, right, s=s, rng=rng if k else None, random=k % 3 == 2)
        for k in range(count)
    ]
    if s.skew.size and set(s.kinds) != {"real"}:
        starts.append(without_real_blocks(starts[0], s))
    best, delta = np.zeros(W), np.full((W, *s.shape[::-1]), np.nan, complex)
    raced, reached = _ascend(
        np.tile(M, (len(starts), 1, 1)), np.concatenate(starts), s=s, n_steps=_RACE
    )
    raced = raced.reshape(len(starts), W, *raced.shape[1:])
    reached = reached.reshape(len(starts), W)
    if set(s.kinds) == {"real"} and len(s.kinds) == s.shape[0] and 1 < s.shape[0] <= _MOST_NUMBERS:
        best, delta = _verified_bound(M, _restore_eigenvalue(M, _all_but_one_at_limits(M), s), s)
    order = np.argsort(-reached, axis=0)
    for place in order[: _N_FINISHERS * (_STARTS_OF_REAL if s.skew.size else 1)]:
        at = np.flatnonzero(
            best < (1 - _BOUNDS_MEET) * bound
        )  # at the other frequencies the bound is mu
        if not at.size:
            break
        candidate, _ = _ascend(M[at], raced[place[at], at], s=s, n_steps=_FINISH)
        if s.skew.size:
            candidate = _restore_eigenvalue(M[at], candidate, s)
        value, candidate = _verified_bound(M[at], candidate, s)
        better = value > best[at]
        best[at[better]], delta[at[better]] = value[better], candidate[better]
    return MuBound(value=best, delta=np.moveaxis(delta, 0, 2))


def _all_but_one_at_limits(M: np.ndarray) -> np.ndarray:
    """Return the smallest real diagonal (W, n, n) with det(I - M delta) = 0 and all but one entry
    of equal size, or 0.

    With the others at k times their signs, det = a(k) + t b(k) for the remaining number t. It is
    real if Im(a b*) = 0, which is a polynomial in k. One of two opposite sign patterns suffices,
    because k has both signs.
    """
    W, n = M.shape[:2]
    size = np.linalg.norm(M, 2, axis=(1, 2))
    M = M / np.where(size > 0, size, 1.0)[:, None, None]
    turn = np.exp(
        2j * np.pi * np.arange(n) / n
    )  # points at which a polynomial of degree n - 1 is known
    least, delta = np.full(W, np.inf), np.zeros((W, n, n), complex)
    for free, signs in itertools.product(
        range(n), itertools.product((1.0, -1.0), repeat=max(n - 2, 0))
    ):
        limits = np.insert(np.array([1.0, *signs])[: n - 1], free, 0.0)
        without = np.linalg.det(np.eye(n) - M[:, None] * (turn[:, None] * limits)[None, :, None, :])
        one = np.eye(n)[free]
        by_free = (
            np.linalg.det(np.eye(n) - M[:, None] * (turn[:, None] * limits + one)[None, :, None, :])
            - without
        )
        # (W, n) from the power zero on
        a, b = (np.fft.fft(values, axis=1) / n for values in (without, by_free))
        products = a[:, :, None] * b[:, None, :].conj()
        parts = [
            np.trace(products[:, :, ::-1], n - 1 - power, axis1=1, axis2=2).imag
            for power in range(2 * n - 1)
        ]
        k = _real_roots(np.stack(parts, axis=1))
        with np.errstate(all="ignore"):
            powers = k[:, :, None] ** np.arange(n)
            t = -(np.einsum("wkp,wp->wk", powers, a) / np.einsum("wkp,wp->wk", powers, b)).real
        inside = np.isfinite(t) & (np.abs(t) <= np.abs(k))
        sizes = np.where(inside, np.abs(k), np.inf)
        at, best = np.arange(W), sizes.argmin(axis=1)
        better = sizes[at, best] < least
        at, best = at[better], best[better]
        delta[better] = (k[at, best, None] * limits + t[at, best, None] * one)[:, :, None] * np.eye(
            n
        )
        least[better] = sizes[at, best]
    return delta


def _real_roots(coefficients: np.ndarray) -> np.ndarray:
    """Return (W, degree) real roots of polynomials (W, degree + 1), lowest power first; nan if
    there is none.
    """
    reversed_ = coefficients[:, 1:] / np.where(
        coefficients[:, :1] == 0, 1e-300, coefficients[:, :1]
    )  # of 1/k
    n = reversed_.shape[1]
    companion = np.zeros((len(coefficients), n, n))
    companion[:, 0] = -np.where(np.isfinite(reversed_), reversed_, 0.0)
    companion[:, np.arange(1, n), np.arange(n - 1)] = 1.0
    inverse = np.linalg.eigvals(companion)
    with np.errstate(all="ignore"):
        return np.where(
            np.abs(inverse.imag) <= _REAL_ROOT * np.abs(inverse), 1 / inverse.real, np.nan
        )


def without_real_blocks(delta: np.ndarray, s: BlockStructure) -> np.ndarray:
    """Return the perturbations with every real block at zero."""
    out = delta.copy()
    for kind, row, col in zip(s.kinds, s.rows, s.cols, strict=True):
        if kind == "real":
            out[:, col, row] = 0
    return out


def _ascend(
    M: np.ndarray, delta: np.ndarray, *, s: BlockStructure, n_steps: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return (W, n_in, n_out) perturbations of size one, moved until the eigenvalue of N delta (W,)
    stops growing.

    With real blocks that is its real part minus a penalty on its imaginary part, larger than the
    multiplier.
    """
    delta, turned = normalize_perturbation(delta, s), not s.skew.size
    price = np.full(len(M), 0.0 if turned else _EIGENVALUE_TURNS)
    reached, todo = np.zeros(len(M)), np.arange(len(M))
    for _ in range(n_steps):
        if not todo.size:
            break
        N, now = M[todo], delta[todo]
        mode = _best_mode(N, now, price[todo])
        if turned:  # complex blocks share one phase
            phase = np.exp(-1j * np.angle(mode.value))
            now = now * phase[:, None, None]
            mode = _Mode(
                value=np.abs(mode.value) + 0j, drive=mode.drive * phase[:, None], right=mode.right
            )
        smallest, multiplier = _smallest_perturbation(mode, s)
        if not turned:
            price[todo] = np.maximum(_EIGENVALUE_TURNS, 2 * np.minimum(multiplier, 20.0))
        before = mode.value.real - price[todo] * np.abs(mode.value.imag)
        best, moved = before.copy(), now.copy()
        for share in MOVES:
            candidate = normalize_perturbation((1 - share) * now + share * smallest, s)
            values = np.linalg.eigvals(N @ candidate)
            if turned:
                each = np.abs(values)
            else:
                each = values.real - price[todo][:, None] * np.abs(values.imag)
            better = each.max(axis=1) > best
            best, moved[better] = np.maximum(best, each.max(axis=1)), candidate[better]
            if turned and (best > before * (1 + _GROWTH)).all():  # the whole way is usually best
                break
        delta[todo], reached[todo] = moved, best
        todo = todo[best - before > _GROWTH * np.abs(best)]
    return delta, reached


def _best_mode(M: np.ndarray, delta: np.ndarray, price: np.ndarray) -> _Mode:
    """Return the eigenvalue of M delta with the largest penalised real part; without a penalty the
    largest.
    """
    values, vectors = np.linalg.eig(M @ delta)
    worth = np.where(
        price[:, None] > 0, values.real - price[:, None] * np.abs(values.imag), np.abs(values)
    )
    each, k = np.arange(len(M)), worth.argmax(axis=1)
    duals = np.linalg.inv(vectors + 1e-14 * np.eye(M.shape[1]))
    return _Mode(
        value=values[each, k],
        drive=np.einsum("wr,wrc->wc", duals[each, k], M),
        right=vectors[each, :, k],
    )


def _smallest_perturbation(mode: _Mode, s: BlockStructure) -> tuple[np.ndarray, np.ndarray]:
    """Return the smallest Delta with drive Delta right = 1 over its size k (W, n_in, n_out), and
    |multiplier| (W,).

    Real blocks add a_j delta_j, complex ones any number of modulus up to b k. By duality 1/k = min
    over theta of (sum |Re a_j exp(-j theta)| + b)/cos(theta). At a kink of this function one real
    block is between its limits, and cancels the imaginary part that the others leave.
    """
    W = len(mode.value)
    a, b = _real_and_complex_effects(mode, s)
    n_real = a.shape[1]
    each = np.arange(W)
    theta, kink = np.zeros(W), np.zeros(W, bool)
    if n_real:
        if b.any():
            grid = np.linspace(-np.pi / 2, np.pi / 2, _N_ANGLES + 2)[1:-1]
        else:
            grid = np.zeros(0)
        # a_j exp(-j theta) is imaginary there
        kinks = np.mod(np.angle(a) + np.pi, np.pi) - np.pi / 2
        angles = np.concatenate([kinks, np.broadcast_to(grid, (W, grid.size))], axis=1)
        k = _smallest_size(angles, a, b).argmax(axis=1)
        theta, kink = angles[each, k], k < n_real
        if grid.size:
            theta = np.where(kink, theta, _refine_angle(theta, np.pi / (_N_ANGLES + 1), a=a, b=b))
    turn = np.exp(1j * theta)
    delta = align_perturbation(mode.drive.conj(), mode.right, turn=turn, s=s)
    if n_real:
        size = _smallest_size(theta[:, None], a, b)[:, 0]
        along = turn.conj()[:, None] * a
        x = np.where(along.real >= 0, 1.0, -1.0)
        free = np.where(kink, k, 0)
        others = (along.imag * x).sum(axis=1) - (along.imag * x)[each, free]
        with np.errstate(all="ignore"):
            between = (-np.sin(theta) / size - others) / along.imag[each, free]
        x[each, free] = np.where(
            kink & np.isfinite(between), np.clip(between, -1, 1), x[each, free]
        )
        real = [
            (row, col)
            for kind, row, col in zip(s.kinds, s.rows, s.cols, strict=True)
            if kind == "real"
        ]
        for j, (row, col) in enumerate(real):
            delta[:, col, row] = x[:, j, None, None] * np.eye(row.stop - row.start)
    return delta, np.abs(np.tan(theta))


def _real_and_complex_effects(mode: _Mode, s: BlockStructure) -> tuple[np.ndarray, np.ndarray]:
    """Return (W, n_real) effect of each real block at one on the eigenvalue, and (W,) of the
    complex blocks at most.
    """
    a, b = [], np.zeros(len(mode.value))
    for kind, row, col in zip(s.kinds, s.rows, s.cols, strict=True):
        drive, right = mode.drive[:, col], mode.right[:, row]
        if kind == "real":
            a.append((drive * right).sum(axis=1))
        elif kind == "repeated":
            b += np.abs((drive * right).sum(axis=1))
        else:
            b += np.linalg.norm(drive, axis=1) * np.linalg.norm(right, axis=1)
    return np.array(a).T.reshape(b.size, -1), b


def _smallest_size(theta: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return (W, angles) cos(theta)/(sum |Re a_j exp(-j theta)| + b), a lower bound whose maximum
    is the size.
    """
    reach = np.abs((np.exp(-1j * theta)[:, :, None] * a[:, None]).real).sum(axis=2) + b[:, None]
    return np.cos(theta) / np.maximum(reach, 1e-300)


def _refine_angle(theta: np.ndarray, width: float, *, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the angles (W,) of largest size within a width, by golden-section search."""
    low, high = theta - width, theta + width
    for _ in range(12):
        inner = np.stack([low + 0.382 * (high - low), low + 0.618 * (high - low)], axis=1)
        size = _smallest_size(inner, a, b)
        up = size[:, 0] < size[:, 1]
        low, high = np.where(up, inner[:, 0], low), np.where(up, high, inner[:, 1])
    return (low + high) / 2


def normalize_perturbation(delta: np.ndarray, s: BlockStructure) -> np.ndarray:
    """Return perturbations (W, ., .) with each complex block of norm one; if all are real, with
    largest entry one.
    """
    delta = delta.copy()
    if set(s.kinds) == {"real"}:
        largest = np.abs(delta).max(axis=(1, 2), keepdims=True)
        return delta / np.where(largest > 0, largest, 1.0)
    for kind, row, col in zip(s.kinds, s.rows, s.cols, strict=True):
        block = delta[:, col, row]
        if kind != "real":
            if kind == "repeated":
                size = np.abs(block[:, :1, :1])
            else:
                size = np.linalg.norm(block, axis=(1, 2), keepdims=True)
            delta[:, col, row] = block / np.where(size > 0, size, 1.0)
    return delta


def _verified_bound(
    M: np.ndarray, delta: np.ndarray, s: BlockStructure
) -> tuple[np.ndarray, np.ndarray]:
    """Return 1/size of perturbations scaled to an eigenvalue of one of N delta; zero if the loop is
    not singular.
    """
    closed = M @ delta
    eigenvalues = np.linalg.eigvals(closed)
    real = eigenvalues[np.arange(len(M)), np.argmax(np.abs(eigenvalues), axis=1)]
    if s.skew.size:
        tame = np.abs(eigenvalues.imag) <= 1e-9 * np.abs(eigenvalues) + 1e-300
        size = np.where(tame, np.abs(eigenvalues.real), 0.0)
        real = eigenvalues.real[np.arange(len(M)), size.argmax(axis=1)] * (size.max(axis=1) > 0)
    with np.errstate(all="ignore"):
        delta = delta / real[:, None, None]
    fine = np.isfinite(delta).all(axis=(1, 2))
    delta = np.where(fine[:, None, None], delta, 0)
    least = np.linalg.svd(np.eye(M.shape[1]) - M @ delta, compute_uv=False)
    size = np.linalg.svd(delta, compute_uv=False)[:, 0]
    fine &= (least[:, -1] <= _SINGULARITY_TOLERANCE * np.maximum(least[:, 0], 1.0)) & (size > 0)
    return np.where(fine, 1 / np.where(size > 0, size, 1.0), 0.0), np.where(
        fine[:, None, None], delta, np.nan
    )


def _worst_directions(
    M: np.ndarray, s: BlockStructure
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return directions (W, n_in, 3), (W, n_out, 3) at the least upper bound, largest first, and
    that bound (W,).

    There the largest eigenvalues meet. If the bound is mu, a combination of their directions is the
    perturbation: right = N left, and left = Delta right, with left as long as a Delta of size one
    makes it.
    """
    size = np.linalg.norm(M, axis=(1, 2))
    # so that an N of size one gives the right directions
    M = M / np.where(size > 0, size, 1.0)[:, None, None]
    D_L, D_R, G = optimal_scalings(M, s)
    scaled = D_L @ M @ np.linalg.inv(D_R)
    values, vectors = np.linalg.eigh(scaled_square(scaled, G))
    vectors = vectors[:, :, ::-1][:, :, :3]
    bound = np.sqrt(np.maximum(values[:, -1], 0.0))
    left = np.linalg.solve(D_R, vectors) * bound[:, None, None]
    right = np.linalg.solve(D_L, scaled @ vectors)
    return left, right, bound * size


def _perturbation_from_directions(
    left: np.ndarray,
    right: np.ndarray,
    *,
    s: BlockStructure,
    rng: np.random.Generator | None,
    random: bool,
) -> np.ndarray:
    """Return a perturbation of size one along the first direction, a random combination, or a
    random direction.
    """
    W, k = left.shape[0], left.shape[2]
    if rng is None:
        return align_perturbation(left[:, :, 0], right[:, :, 0], turn=np.ones(W), s=s, inside=True)
    if random:
        left, right = (
            rng.standard_normal((W, n)) + 1j * rng.standard_normal((W, n)) for n in s.shape[::-1]
        )
        return align_perturbation(left, right, turn=np.ones(W), s=s)
    mix = (rng.standard_normal((W, k)) + 1j * rng.standard_normal((W, k))) * [1.0, 1.0, 0.3][:k]
    left, right = (np.einsum("wnk,wk->wn", vectors, mix) for vectors in (left, right))
    return align_perturbation(left, right, turn=np.ones(W), s=s, inside=True)


def align_perturbation(
    left: np.ndarray,
    right: np.ndarray,
    *,
    turn: np.ndarray,
    s: BlockStructure,
    inside: bool = False,
) -> np.ndarray:
    """Return Delta of size one that maximises Re(turn* left* Delta right), block by block.

    `inside` gives a real block the number that takes right to left, if it is in [-1, 1].
    """
    delta = np.zeros((left.shape[0], *s.shape[::-1]), complex)
    with np.errstate(all="ignore"):
        for kind, row, col in zip(s.kinds, s.rows, s.cols, strict=True):
            q, v = left[:, col], right[:, row]
            if kind == "full":
                size = np.linalg.norm(q, axis=1) * np.linalg.norm(v, axis=1)
                block = turn[:, None, None] * q[:, :, None] * v[:, None, :].conj()
                delta[:, col, row] = block / np.where(size > 0, size, np.inf)[:, None, None]
                continue
            along = turn.conj() * (q.conj() * v).sum(axis=1)
            n = row.stop - row.start
            number = np.where(along == 0, 1.0, along.conj() / np.abs(along))
            if kind == "real":
                number = np.where(along.real >= 0, 1.0, -1.0)
                if inside:
                    number = np.clip(
                        np.nan_to_num(along.real / (np.abs(v) ** 2).sum(axis=1)), -1.0, 1.0
                    )
            delta[:, col, row] = number[:, None, None] * np.eye(n)
    return delta


def _restore_eigenvalue(M: np.ndarray, delta: np.ndarray, s: BlockStructure) -> np.ndarray:
    """Take Newton steps of least length that bring the eigenvalue onto the real axis, without
    limits on the sizes.
    """
    delta = delta.copy()
    for _ in range(8):
        mode = _best_mode(M, delta, np.full(len(M), _EIGENVALUE_TURNS))
        slopes = np.zeros((len(M), len(s.kinds)))
        for k, (kind, row, col) in enumerate(zip(s.kinds, s.rows, s.cols, strict=True)):
            if kind == "real":
                slopes[:, k] = (mode.drive[:, col] * mode.right[:, row]).sum(axis=1).imag
            else:  # a change of phase
                slopes[:, k] = np.einsum(
                    "wc,wcr,wr->w", mode.drive[:, col], delta[:, col, row], mode.right[:, row]
                ).real
        step = -(mode.value.imag / np.maximum((slopes**2).sum(axis=1), 1e-300))[:, None] * slopes
        for k, (kind, row, col) in enumerate(zip(s.kinds, s.rows, s.cols, strict=True)):
            if kind == "real":
                delta[:, col, row] += step[:, k, None, None] * np.eye(row.stop - row.start)
            else:
                delta[:, col, row] *= np.exp(1j * step[:, k])[:, None, None]
    return delta
