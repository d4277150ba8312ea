"""How far from rest friction with stiction can keep a loop: the class with stiction 1, and a bounded rest.

The same elements with constant sliders, moved by the same motion, differ from a friction of the class by a rest r of at
most (1 - 1/rho) Fs/2. Their own friction g makes the loop contract: with the states z of `dissipation` (rho = 1),

    d/dt V + 2 lambda V <= r^2,      V = z'P(t) z + sum_j mu_j sum_i (g_i - gh_ij)^2/(2 k_i),

so that V <= (rest)^2/(2 lambda) in the end, and the position is within the ellipsoid of that. P(t), the weights and the
bound come from one semidefinite program for each rate lambda; the derivation is T7 of the page on the theory.
The solver only proposes: `verify_settling` judges what it found over the rationals.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from nlfrf._base.values import value
from robust.friction.plant import FrictionLoop
from robust.friction.storage import Dissipation, balancing_coordinates
from robust.proofs.search.certificate import solve_program

if TYPE_CHECKING:
    import cvxpy

__all__ = ["SettlingNumbers", "largest_rest", "settling_numbers"]

#: Filters; eight made the bound at most 6 % smaller than five on three axes, at twice the time.
N_FILTERS = 6
#: Fastest filter, times the rate that the others are placed by.
FASTEST = 40.0
#: Rates of decay that are tried, of the slowest mode of the loop, sliding or stuck.
DECAYS = (0.9, 0.6, 0.3)
#: What the program has to leave in its scaled matrices, so that its solution is strict.
STRICT = 1e-7
#: Of the bound: what makes up for rounding, judged afterwards.
ROUNDED_UP = 1 + 1e-6
TIME_CAP = 20.0


@value(copy=False)
class SettlingNumbers:
    """Why a loop settles: rates and weights of the filters, the storage, its rate of decay.

    Fields
    ------
    rates, weights : (J,) ndarray
        [rad/s], the reference first, and mu_j.
    decay : float
        lambda [1/s].
    V, P, counts : (n, n), (I, 4, n, n), (S,) ndarray
        Coordinates, Bernstein coefficients of the storage, intervals of each span.
    reach : float
        Largest displacement at the port [m] for a rest of at most 1 N, the rest position left out.
    """

    rates: np.ndarray
    weights: np.ndarray
    decay: float
    V: np.ndarray
    P: np.ndarray
    counts: np.ndarray
    reach: float


def largest_rest(Fs: float, stiction: float) -> float:
    """Return how far a friction with stiction is from the one of the same elements with constant sliders [N].

    >>> largest_rest(6.0, 1.5)
    1.0
    """
    return (1 - 1 / stiction) * Fs / 2


def settling_numbers(loop: FrictionLoop, K0: float, reference: float) -> list[SettlingNumbers]:
    """Return what was found, the smallest reach first; empty where nothing was.

    reference : rate [rad/s] that the filters are placed by.
    """
    slowest = min(slowest_decay(loop, kappa) for kappa in (0.0, K0 / 4, K0))
    if not slowest > 0:
        return []
    rates = np.geomspace(min(slowest, reference), FASTEST * reference, N_FILTERS)
    first = N_FILTERS // 2
    rates = np.concatenate([rates[first : first + 1], np.delete(rates, first)])
    tried = (settle_at_rate(loop, K0, rates=rates, decay=share * slowest) for share in DECAYS)
    return sorted((one for one in tried if one is not None), key=lambda one: one.reach)


def slowest_decay(loop: FrictionLoop, kappa: float) -> float:
    """Return the decay [1/s] of the slowest mode of the loop with a spring at its port; negative if one grows."""
    growth = loop.growth(kappa)
    return float(-np.log1p(growth) / loop.T if loop.T else -growth)


def settle_at_rate(loop: FrictionLoop, K0: float, *, rates: np.ndarray, decay: float) -> SettlingNumbers | None:
    """Return the least reach with one rate of decay, or None where the program finds none."""
    import cvxpy as cp

    A, B, jumps, x, v = with_filters(loop, rates)
    n = A.shape[0]
    V = coordinates(loop, A, B=B, jumps=jumps)
    back = np.linalg.inv(V)
    A = back @ A @ V + decay * np.eye(n)
    jumps = [back @ jump @ V for jump in jumps]
    time_unit = float(loop.spans.sum()) if loop.T else 1 / max(1.0, float(np.linalg.norm(A, 2)))
    B = back @ B
    unit = 1 / np.linalg.norm(B, axis=0) / np.sqrt(time_unit)
    B, x, v = B * unit, x @ V, v @ V
    size = float(np.linalg.norm(x))
    position = np.append(x / size, 0.0)[:, None]
    supplies, stores = [], []
    for j, rate in enumerate(rates):
        seen = np.append(-V[n - rates.size + j] if j else np.zeros(n), unit[0])  # d - e_j
        cross = np.outer(seen, np.append(v, 0.0))
        supplies.append((cross + cross.T) / 2 - max(rate - decay, 0.0) / K0 * np.outer(seen, seen))
        stores.append(np.outer(seen, seen) / (2 * K0))
    scale = np.array([np.abs(supply).max() for supply in supplies])
    allowed = rates > decay
    mu = cp.Variable(rates.size, nonneg=True)
    reach = cp.Variable()
    supply = sum(mu[j] * (supplies[j] / scale[j]) for j in range(rates.size))
    stored = sum(mu[j] * (stores[j] / scale[j]) for j in range(rates.size))
    wide, weigh = np.eye(n + 2, n + 1), np.diag(np.append(np.full(n, np.sqrt(time_unit)), [1.0, 1.0]))
    last = np.zeros((n + 2, n + 2))
    last[-1, -1] = 1.0
    constraints = [mu[j] == 0 for j in range(rates.size) if not allowed[j]]

    def flow(P: cvxpy.Expression, slope: cvxpy.Expression | np.ndarray) -> cvxpy.Constraint:
        across = P @ A
        side = P @ B
        total = cp.bmat([[slope + across + across.T, side], [side.T, np.zeros((2, 2))]])
        return weigh @ (total + wide @ supply @ wide.T - last) @ weigh << -STRICT * np.eye(n + 2)

    def within(P: cvxpy.Expression) -> cvxpy.Constraint:
        energy = np.eye(n + 1, n) @ P @ np.eye(n, n + 1) + stored
        return cp.bmat([[energy, position], [position.T, cp.reshape(reach, (1, 1), order="F")]]) >> 0

    storage = [[cp.Variable((n, n), symmetric=True) for _ in range(4)] for _ in loop.spans]
    if not loop.T:
        storage = [[cp.Variable((n, n), symmetric=True)]]
        constraints += [flow(storage[0][0], np.zeros((n, n))), within(storage[0][0])]
    for span, b in zip(loop.spans, storage, strict=False):
        s0, s1, s2 = (3 / span * (after - before) for before, after in pairwise(b))
        slopes = (s0, (s0 + 2 * s1) / 3, (2 * s1 + s2) / 3, s2)
        constraints += [flow(P, slope) for P, slope in zip(b, slopes, strict=True)]
        constraints += [within(P) for P in b]
    for i, jump in enumerate(jumps):
        constraints.append(storage[i - 1][3] - jump.T @ storage[i][0] @ jump >> STRICT * np.eye(n))
    solve_program(cp.Problem(cp.Minimize(reach), constraints), "CLARABEL", TIME_CAP)
    if reach.value is None or mu.value is None or any(P.value is None for b in storage for P in b):
        return None
    found = np.array([[(P.value + P.value.T) / 2 for P in b] for b in storage])
    weights = np.where(allowed, np.maximum(mu.value, 0) / scale, 0.0)
    kept = sum(w * S for w, S in zip(weights, stores, strict=True))
    energies = np.pad(found.reshape(-1, n, n), ((0, 0), (0, 1), (0, 1))) + kept
    squared = float(
        (np.linalg.solve(energies, np.broadcast_to(position, (len(energies), n + 1, 1)))[:, :, 0] @ position).max()
    )
    if not squared > 0:
        return None
    factor = unit[1] ** 2  # the program had the rest in a unit of its own
    return SettlingNumbers(
        rates=rates,
        weights=factor * weights,
        decay=decay,
        V=V,
        P=factor * found,
        counts=np.ones(loop.spans.size, dtype=int),
        reach=size * float(np.sqrt(squared / (2 * decay * factor))) * ROUNDED_UP,
    )


def with_filters(
    loop: FrictionLoop, rates: np.ndarray
) -> tuple[np.ndarray, np.ndarray, list[np.ndarray], np.ndarray, np.ndarray]:
    """Return A, B (inputs d and r), jumps, x, v of the loop with the filters of the friction."""
    n, extra = loop.F.shape[0], rates.size - 1
    A, B = np.zeros((n + extra, n + extra)), np.zeros((n + extra, 2))
    A[:n, :n], A[n:, n:] = loop.F, -np.diag(rates[1:])
    B[:n, 0], B[n:, 0], B[:n, 1] = loop.B - rates[0] * loop.rest()[0], rates[1:] - rates[0], loop.B
    jumps = []
    for one in loop.jumps:
        jump = np.eye(n + extra)
        jump[:n, :n] = one
        jumps.append(jump)
    return A, B, jumps, np.pad(loop.x, (0, extra)), np.pad(loop.v, (0, extra))


def coordinates(loop: FrictionLoop, A: np.ndarray, *, B: np.ndarray, jumps: list[np.ndarray]) -> np.ndarray:
    """Return (n, n) V with z = V z~ in which both inputs reach every state alike."""
    n, none = A.shape[0], np.zeros((A.shape[0], 2))
    form = Dissipation(
        A=A,
        B=B,
        spans=loop.spans,
        jumps=np.array(jumps).reshape(-1, n, n),
        Q=np.zeros((n, n)),
        N=none,
        R=-np.eye(2),
        stored=np.zeros((n, n)),
        B_error=none,
        stored_error=np.zeros((n, n)),
    )
    return balancing_coordinates(form)
