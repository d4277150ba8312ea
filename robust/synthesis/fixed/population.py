"""Global search over the parameters of a controller structure by differential evolution.

Convex steps lead to the nearest local optimum, and cannot pass an obstacle between two optima, such
as a resonance. The search varies the logarithms of gain, poles and zeros, so its controllers are
stable. Candidates are compared by the demands first, then by the aim. A wrong winding number
excludes a candidate.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from robust.synthesis.fixed.structures import Basis

_LEAST_DAMPING = 0.05  # of a pair of roots: a pair with less damping could hide between two lines
_BEST_SHARE = 0.2  # best part of the population, to which the others are drawn
_STEPS = (0.3, 0.9)  # share of that step, and of the added difference of two others
# generations with the demands first; with a price on them; and first again
_PATIENT = 20
_DARING = 35
_SETTLING = 5
_PRICES = (
    3.0,
    100.0,
)  # price of the worst demand in factors of the goal, at the beginning and at the end
_MET_FIRST = 1e4  # far above the logarithm of any goal

#: (N, n) parameters -> the worst demand, which is compared first, and the goal, which is compared
#: last; both (N,).
Merit = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


def genes_of_roots(zeros: np.ndarray, poles: np.ndarray, gains: np.ndarray) -> np.ndarray:
    """Return (N, m) logarithms of the coefficients of x and y, two roots at a time, and of the
    gain.
    """
    parts = []
    for sizes in (zeros, poles):
        for k in range(0, sizes.shape[1] - 1, 2):
            parts += [sizes[:, k] + sizes[:, k + 1], sizes[:, k] * sizes[:, k + 1]]
        if sizes.shape[1] % 2:
            parts.append(sizes[:, -1])
    return np.log(np.array([*parts, np.abs(gains)])).T


def _roots_of_genes(genes: np.ndarray, degree: int, real: bool) -> np.ndarray:
    """Return (N, degree) roots of one polynomial, whose genes are the first of the given ones."""
    roots = []
    for k in range(0, degree - 1, 2):
        middle, size = np.exp(genes[:, k]) / 2, np.exp(genes[:, k + 1] / 2)
        middle = np.maximum(middle, size if real else _LEAST_DAMPING * size)
        spread = np.sqrt((middle**2 - size**2).astype(complex))
        roots += [
            -(size**2) / (middle + spread),
            -middle - spread,
        ]  # the slow one without cancellation
    if degree % 2:
        roots.append(-np.exp(genes[:, degree - 1]) + 0j)
    return np.array(roots).reshape(degree, len(genes)).T


def parameters(basis: Basis, genes: np.ndarray, signs: np.ndarray) -> np.ndarray:
    """Return (N, n) theta from the genes; poles fixed by the structure are kept."""
    shape = basis.structure
    n_poles = shape.n_poles if shape.free else 0
    zeros = _roots_of_genes(genes, shape.n_zeros, shape.real)
    y = np.ones((len(genes), 1))
    if n_poles:
        poles = _roots_of_genes(genes[:, shape.n_zeros :], n_poles, shape.real)
        size, most = np.abs(poles), 0.5 * basis.fastest
        y = basis.coefficients(poles / size * np.clip(size, min(1.1 * basis.slowest, most), most))
    return np.hstack([y, (signs * np.exp(genes[:, -1]))[:, None] * basis.coefficients(zeros)])


def evolve(
    basis: Basis,
    genes: np.ndarray,
    signs: np.ndarray,
    *,
    box: tuple[np.ndarray, np.ndarray],
    merit: Merit,
    allowed: Callable[[np.ndarray], np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """Return (2 N, n) parameters, the best ones first, and their genes, from N controllers that are
    all allowed.

    box: smallest and largest genes (m,), of controllers that cross over within the band: the goal
    may be unbounded.

    The search runs twice: once with the demands before the goal, which keeps met demands met; and
    once with a rising price on their violation, which can pass through regions where they are not
    met.
    """
    rng = np.random.default_rng(0)
    patient, daring = [np.inf] * _PATIENT, [*np.geomspace(*_PRICES, _DARING), *[np.inf] * _SETTLING]
    genes = np.vstack(
        [
            _generations(
                basis, genes, signs, prices=prices, box=box, merit=merit, allowed=allowed, rng=rng
            )
            for prices in (patient, daring)
        ]
    )
    signs = np.concatenate([signs, signs])
    theta = parameters(basis, genes, signs)
    hard, goal = merit(theta)
    order = np.lexsort((goal, hard))
    return theta[order], genes[order]


def _generations(
    basis: Basis,
    genes: np.ndarray,
    signs: np.ndarray,
    *,
    prices: list[float],
    box: tuple[np.ndarray, np.ndarray],
    merit: Merit,
    allowed: Callable[[np.ndarray], np.ndarray],
    rng: np.random.Generator,
) -> np.ndarray:
    """Return (N, m) genes after one generation for each price on the violation of demands.

    References
    ----------
    Zhang & Sanderson, *JADE: adaptive differential evolution with optional external archive*, IEEE
    Trans. Evol. Comput. 13 (2009): each candidate is drawn to one of the best and takes the
    difference of two others.
    """
    genes, n = genes.copy(), len(genes)
    hard, goal = merit(parameters(basis, genes, signs))
    for price in prices:
        cost = _costs(hard, goal, price)
        best = genes[np.argsort(cost)[rng.integers(max(2, int(_BEST_SHARE * n)), size=n) % n]]
        one, other = genes[rng.integers(n, size=n)], genes[rng.integers(n, size=n)]
        trial = np.clip(
            genes + rng.uniform(*_STEPS, size=(n, 1)) * (best - genes + one - other), *box
        )
        theta = parameters(basis, trial, signs)
        new_hard, new_goal = merit(theta)
        better = np.flatnonzero(_costs(new_hard, new_goal, price) < cost)
        if better.size:
            better = better[allowed(theta[better])]
            genes[better], hard[better], goal[better] = (
                trial[better],
                new_hard[better],
                new_goal[better],
            )
    return genes


def _costs(hard: np.ndarray, goal: np.ndarray, price: float) -> np.ndarray:
    """Return (N,) log of the goal plus price times log of the worst demand; demands first for an
    infinite price.
    """
    missed = np.log(np.maximum(hard, 1.0))
    size = np.log(np.maximum(np.abs(goal), 1e-300))
    goal = np.where(goal < 0, -size, size)
    if np.isfinite(price):
        return goal + price * missed
    return np.where(missed > 0, missed, goal - _MET_FIRST)
