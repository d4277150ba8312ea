"""Weights of the filters that say most about a friction, by a linear program over the frequencies.

For every Maxwell-slip friction of the class, f driven by the velocity v of its port, and every filter a_j,

    int (f - fh_j/rho) v - fh_j'^2/(rho a_j K0) dt >= -S(0),    fh_j' = a_j (f - fh_j).

A row is what the loop, v = mobility f, makes of that integrand at one frequency: a sum of rows with weights mu_j >= 0
that is negative at every frequency contradicts any motion that goes on. Nothing here is a proof.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import linprog

from robust.sliding.loop import SlidingLoop
from robust.sliding.response import frequencies, mobility

__all__ = ["filter_rates", "largest_stiffness", "rows", "weights"]

N_FILTERS = 24
#: Where filters are tried, one set after another [rad/s].
RANGES = ((0.5, 3000.0), (15.0, 3000.0), (30.0, 1500.0), (5.0, 1200.0))


def filter_rates(reference: float, fastest: float) -> list[np.ndarray]:
    """Sets of rates a_j [rad/s], each with the reference first; all below `fastest` = 1/bristle time."""
    sets = []
    for low, high in RANGES:
        top = min(high, 0.9 * fastest)
        rates = np.geomspace(min(low, top / 10), top, N_FILTERS)
        first = np.argmin(np.abs(np.log(rates / reference)))
        sets.append(np.concatenate([rates[first : first + 1], np.delete(rates, first)]))
    return sets


def rows(mobility: np.ndarray, omega: np.ndarray, rates: np.ndarray, K0: float, rho: float) -> np.ndarray:
    """(W, 1 + J) the integrand of each weight at each frequency: that of f v first, then one a filter."""
    s = 1j * omega[:, None]
    bent = (1 - rates / (rho * (rates - s))) * mobility[:, None]
    lost = rates * omega[:, None] ** 2 / (rho * K0 * (rates**2 + omega[:, None] ** 2))
    return np.column_stack([mobility.real, bent.real - lost])


def weights(table: np.ndarray) -> tuple[np.ndarray, float]:
    """(1 + J,) weights that make every row negative by the largest share of its largest entry, and that share."""
    scaled = table / np.abs(table).max(axis=1, keepdims=True)
    columns = np.abs(scaled).max(axis=0)
    scaled = scaled / columns
    n = table.shape[1]
    A = np.column_stack([scaled, np.ones(table.shape[0])])
    result = linprog(
        np.append(np.zeros(n), -1.0),
        A_ub=A,
        b_ub=np.zeros(table.shape[0]),
        A_eq=np.append(np.ones(n), 0.0)[None, :],
        b_eq=[1.0],
        bounds=[(0, None)] * n + [(None, None)],
        method="highs",
    )
    if result.x is None:
        return np.zeros(n), -np.inf
    mu = np.clip(result.x[:-1], 0, None)
    return mu / columns, float(-(A[:, :-1] @ mu).max())


def largest_stiffness(loop: SlidingLoop, rates: np.ndarray, rho: float, top: float = 1e8) -> float:
    """Largest K0 [N/m] at which weights exist at every frequency of a grid, by bisection; 0 where none."""
    omega = frequencies(loop)
    response = mobility(loop, omega)

    def exist(K0: float) -> bool:
        return weights(rows(response, omega, rates, K0, rho))[1] > 1e-9

    low, high = 1.0, top
    if not exist(low):
        return 0.0
    while high / low > 1.0005:
        middle = np.sqrt(low * high)
        low, high = (middle, high) if exist(middle) else (low, middle)
    return float(low)
