"""Bound on the final distance from rest of a loop with stiction, from the class without stiction.

Elements with constant sliders (stiction rho = 1) have a force g under the same motion. It differs
from the force of a friction of the class by a remainder r of at most (1 - 1/rho) Fs/2. With the
force g alone the loop contracts: with the states z of `dissipation` (rho = 1),

    d/dt V + 2 lambda V <= r^2,      V = z'P(t) z + sum_j mu_j sum_i (g_i - gh_ij)^2/(2 k_i),

with the force g_i of element i and its filtered values gh_ij. So V <= (largest r)^2/(2 lambda)
eventually, and the position lies in the ellipsoid of that V. P(t), the weights and the bound come
from one semidefinite program for each rate lambda; the derivation is T7 of the page on the theory.
With friction at several ports r^2 becomes sum_p w_p (r_p/R_p)^2, with sum_p w_p = 1 and R_p the
largest remainder at port p. The solver only proposes: `verify_friction` judges its numbers over the
rationals.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import block_diag

from nlfrf._base.values import value
from robust.friction.loop import FrictionLoop
from robust.friction.proof.storage import balancing_coordinates
from robust.proofs.search.programs import solve_program

if TYPE_CHECKING:
    import cvxpy

#: Filters of one port: eight made the bound at most 6 % smaller than five on three axes, at twice
#: the time. Several ports have fewer each, because the program grows with their number.
_N_FILTERS, _N_FILTERS_OF_SEVERAL = 6, 4
#: Fastest filter, as a multiple of the reference rate.
_FASTEST = 40.0
#: Rates of decay that are tried, relative to the slowest mode of the loop, sliding or stuck.
_DECAYS = (0.9, 0.6, 0.3)
#: Margin that the program must leave in its scaled matrices, so that its solution is strict.
_STRICT = 1e-7
#: Factor on the bound for rounding; the bound is judged afterwards.
_ROUNDED_UP = 1 + 1e-6


@value(copy=False)
class SettlingNumbers:
    """Numbers of a settling proof: filter rates and weights, storage, rate of decay."""

    rates: np.ndarray  # (J,) rates of the filters [rad/s], the reference first
    weights: np.ndarray  # (P, J) weights mu_j of each port
    rest_weights: np.ndarray  # (P,) weights w_p of the rests
    decay: float  # rate lambda [1/s]
    # V, P, counts: (n, n) or (I, 4, n, n) or (S,) coordinates, Bernstein coefficients of the
    # storage, number of intervals in each span
    V: np.ndarray
    P: np.ndarray
    counts: np.ndarray
    # (P,) largest displacement at each port [m] for a largest rest of 1 N, without the rest
    # position
    reach: np.ndarray


def largest_rest(Fs: float, stiction: float) -> float:
    """Return the largest difference of a friction with stiction from that of the same elements with
    constant sliders.

    The difference is a force [N].

    >>> largest_rest(6.0, 1.5)
    1.0
    """
    return (1 - 1 / stiction) * Fs / 2


def settling_numbers(
    loop: FrictionLoop, K0: np.ndarray, reference: float, rests: np.ndarray
) -> list[SettlingNumbers]:
    """Return the numbers of all proofs found, the smallest reach first; an empty list if there are
    none.

    K0, rests : (P,) stiffness of the class at each port, and largest rest there relative to the
    largest of all. reference : rate [rad/s] for the choice of the filters.
    """
    slowest = min(_slowest_decay(loop, share * K0) for share in (0.0, 0.25, 1.0))
    if not slowest > 0:
        return []
    count = _N_FILTERS if K0.size == 1 else _N_FILTERS_OF_SEVERAL
    rates = np.geomspace(min(slowest, reference), _FASTEST * reference, count)
    first = count // 2
    rates = np.concatenate([rates[first : first + 1], np.delete(rates, first)])
    tried = (
        _settle_at_rate(loop, K0, rates=rates, rests=rests, decay=share * slowest)
        for share in _DECAYS
    )
    return sorted((one for one in tried if one is not None), key=lambda one: one.reach.max())


def _slowest_decay(loop: FrictionLoop, kappa: np.ndarray) -> float:
    """Return the decay [1/s] of the slowest mode of the loop with springs at its ports; negative if
    one grows.
    """
    growth = loop.growth(kappa)
    return float(-np.log1p(growth) / loop.T if loop.T else -growth)


def _filter_forms(
    V: np.ndarray,
    v: np.ndarray,
    unit: np.ndarray,
    *,
    K0: np.ndarray,
    rates: np.ndarray,
    decay: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return (P J, n + P, n + P) supply and storage of every filter, port by port, as forms in
    states and friction.

    V, v : coordinates, and velocities at the ports in them. unit : unit of the friction at each
    port.
    """
    n, n_ports, extra = V.shape[0], K0.size, rates.size - 1
    first = n - n_ports * extra  # of the filters
    supplies, stores = [], []
    for port in range(n_ports):
        own = np.zeros(n_ports)
        own[port] = unit[port]
        for j, rate in enumerate(rates):
            if j:
                held = V[first + port * extra + j - 1]
            else:
                held = np.zeros(n)
            seen = np.append(-held, own)  # d - e_j
            cross = np.outer(seen, np.append(v[port], np.zeros(n_ports)))
            supplies.append(
                (cross + cross.T) / 2 - max(rate - decay, 0.0) / K0[port] * np.outer(seen, seen)
            )
            stores.append(np.outer(seen, seen) / (2 * K0[port]))
    return np.array(supplies), np.array(stores)


def _slopes_of_cubic(b: list[cvxpy.Variable], span: float) -> list[cvxpy.Expression]:
    """Return the derivative of a cubic over a span [s], as Bernstein coefficients of a cubic."""
    s0, s1, s2 = (3 / span * (after - before) for before, after in pairwise(b))
    return [s0, (s0 + 2 * s1) / 3, (2 * s1 + s2) / 3, s2]


def _settle_at_rate(
    loop: FrictionLoop, K0: np.ndarray, *, rates: np.ndarray, rests: np.ndarray, decay: float
) -> SettlingNumbers | None:
    """Return the smallest reach for one rate of decay, or None if the program finds none."""
    import cvxpy as cp

    A, B, jumps, x, v = _with_filters(loop, rates, rests)
    n, n_ports = A.shape[0], K0.size
    # Coordinates, time and friction get units in which the entries of the program are near one:
    # interior-point solvers lose digits otherwise.
    V = balancing_coordinates(A, B, spans=loop.spans, jumps=jumps)
    back = np.linalg.inv(V)
    # d/dt V + 2 lambda V <= ... for A is d/dt V <= ... for A + lambda I
    A = back @ A @ V + decay * np.eye(n)
    jumps = back @ jumps @ V
    if loop.T:
        time_unit = float(loop.spans.sum())
    else:
        time_unit = 1 / max(1.0, float(np.linalg.norm(A, 2)))
    B = back @ B
    sizes = np.linalg.norm(B, axis=0)
    sizes[n_ports:] = sizes[n_ports:].max()  # one unit for all rests
    unit = 1 / sizes / np.sqrt(time_unit)
    B, x, v = B * unit, x @ V, v @ V
    size = float(np.linalg.norm(x, axis=1).max())
    positions = np.pad(x / size, ((0, 0), (0, n_ports)))
    allowed = np.tile(rates > decay, n_ports)
    supplies, stores = _filter_forms(V, v, unit, K0=K0, rates=rates, decay=decay)
    scale = np.abs(supplies).max(axis=(1, 2))
    mu = cp.Variable(scale.size, nonneg=True)
    shares = cp.Variable(n_ports, nonneg=True)
    reach = cp.Variable()
    supply, stored = (
        cp.reshape(
            mu @ (forms.reshape(scale.size, -1) / scale[:, None]), forms.shape[1:], order="C"
        )
        for forms in (supplies, stores)
    )
    full = n + 2 * n_ports
    wide, rests_of = np.split(np.eye(full), [n + n_ports], axis=1)
    weigh = np.diag(np.append(np.full(n, np.sqrt(time_unit)), np.ones(2 * n_ports)))
    last = rests_of @ cp.diag(shares) @ rests_of.T
    constraints = [cp.sum(shares) == 1, *(mu[j] == 0 for j in range(scale.size) if not allowed[j])]

    def flow(P: cvxpy.Expression, slope: cvxpy.Expression | np.ndarray) -> cvxpy.Constraint:
        across = P @ A
        side = P @ B
        total = cp.bmat(
            [[slope + across + across.T, side], [side.T, np.zeros((2 * n_ports, 2 * n_ports))]]
        )
        return weigh @ (total + wide @ supply @ wide.T - last) @ weigh << -_STRICT * np.eye(full)

    # Schur complement: c' E^-1 c, the square of the largest position with V <= 1, is at most reach
    def within(P: cvxpy.Expression) -> list[cvxpy.Constraint]:
        energy = np.eye(n + n_ports, n) @ P @ np.eye(n, n + n_ports) + stored
        corner = cp.reshape(reach, (1, 1), order="F")
        return [cp.bmat([[energy, row[:, None]], [row[None], corner]]) >> 0 for row in positions]

    # a continuous loop has no spans, and its storage is constant
    storage = [
        [cp.Variable((n, n), symmetric=True) for _ in range(4 if loop.T else 1)]
        for _ in range(max(1, loop.spans.size))
    ]
    for i, b in enumerate(storage):
        if loop.T:
            slopes = _slopes_of_cubic(b, loop.spans[i])
        else:
            slopes = [np.zeros((n, n))]
        constraints += [flow(P, slope) for P, slope in zip(b, slopes, strict=True)]
        constraints += [one for P in b for one in within(P)]
    # V does not rise over a jump: from the end of the span before it to the start of the span after
    for i, jump in enumerate(jumps):
        constraints.append(storage[i - 1][3] - jump.T @ storage[i][0] @ jump >> _STRICT * np.eye(n))
    solve_program(cp.Problem(cp.Minimize(reach), constraints), "CLARABEL")
    if reach.value is None:
        return None
    # the reach is computed again from the numbers that are kept, which are not quite the solver's
    found = np.array([[P.value for P in b] for b in storage])
    weights = np.where(allowed, np.maximum(mu.value, 0) / scale, 0.0)
    energies = np.pad(found.reshape(-1, n, n), ((0, 0), (0, n_ports), (0, n_ports))) + np.tensordot(
        weights, stores, 1
    )
    solved = np.linalg.solve(
        energies, np.broadcast_to(positions.T, (len(energies), n + n_ports, n_ports))
    )
    squared = np.einsum("eip,pi->ep", solved, positions).max(axis=0)
    if not (squared > 0).all():
        return None
    factor = unit[n_ports] ** 2  # the program has its own unit for the rest
    given = np.maximum(shares.value, 0.0)
    given /= given.sum() * (
        1.0 if n_ports == 1 else _ROUNDED_UP
    )  # their sum is at most one, exactly
    return SettlingNumbers(
        rates=rates,
        weights=(factor * weights).reshape(n_ports, -1),
        rest_weights=given,
        decay=decay,
        V=V,
        P=factor * found,
        counts=np.ones(loop.spans.size, dtype=int),
        reach=size * np.sqrt(squared / (2 * decay * factor)) * _ROUNDED_UP,
    )


def _with_filters(
    loop: FrictionLoop, rates: np.ndarray, rests: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return A, B (inputs d and r of each port), (S, n, n) jumps, x, v of the loop with the filters
    of the friction.
    """
    (n, n_ports), extra = loop.columns.shape, rates.size - 1
    size, rest = n + n_ports * extra, loop.rest()[0].reshape(n, n_ports)
    A, B = np.zeros((size, size)), np.zeros((size, 2 * n_ports))
    A[:n, :n], A[n:, n:] = loop.F, -np.diag(np.tile(rates[1:], n_ports))
    B[:n, :n_ports], B[:n, n_ports:] = loop.columns - rates[0] * rest, loop.columns * rests
    for port in range(n_ports):
        B[n + port * extra : n + (port + 1) * extra, port] = rates[1:] - rates[0]
    jumps = np.array([block_diag(jump, np.eye(size - n)) for jump in loop.jumps]).reshape(
        -1, size, size
    )
    wider = ((0, 0), (0, size - n))
    return A, B, jumps, np.pad(loop.displacements, wider), np.pad(loop.velocities, wider)
