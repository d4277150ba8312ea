"""Multiplier weights for a class of friction, by a linear program over the frequencies.

For every Maxwell-slip friction of the class, f driven by the velocity v of its port, and every
filter a_j,

    int (f - fh_j/rho) v - fh_j'^2/(rho a_j K0) dt >= -S(0),    fh_j' = a_j (f - fh_j).

S(0) is the initial value of the storage function, rho the stiction and K0 the presliding stiffness.
A row of the linear program is this integrand in the loop, v = mobility f, at one frequency. If a
sum of rows with weights mu_j >= 0 is negative at every frequency, it contradicts any motion that
continues. Nothing here is a proof.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import linprog

from robust.friction.exact.classes import MaxwellSlipPort
from robust.friction.proof.dissipation import ROUNDED_UP


def weighed_port(rates: np.ndarray, limits: MaxwellSlipPort, mu: np.ndarray) -> MaxwellSlipPort:
    """Return one port with its weights, without the filters of zero weight; the first filter, the
    reference, stays.

    mu : (1 + J,) weight of f v, then one a rate.
    """
    used = np.append(True, mu[2:] > 0)
    return replace(
        limits,
        stiction=max(limits.stiction, ROUNDED_UP),
        free=float(mu[0]),
        rates=rates[used],
        weights=mu[1:][used],
    )


_N_FILTERS = 24
#: Ranges in which filters are tried, one set after another [rad/s].
_FREQUENCY_RATIOS = ((0.5, 3000.0), (15.0, 3000.0), (30.0, 1500.0), (5.0, 1200.0))


def filter_rates(reference: float, bristle_time: float = 0.0) -> list[np.ndarray]:
    """Return sets of rates a_j [rad/s] below 1/bristle_time, each with the reference first."""
    sets, fastest = [], 1 / bristle_time if bristle_time else np.inf
    for low, high in _FREQUENCY_RATIOS:
        top = min(high, 0.9 * fastest)
        rates = np.geomspace(min(low, top / 10), top, _N_FILTERS)
        first = np.argmin(np.abs(np.log(rates / reference)))
        sets.append(np.concatenate([rates[first : first + 1], np.delete(rates, first)]))
    return sets


def multiplier_terms(
    mobility: np.ndarray, omega: np.ndarray, *, rates: np.ndarray, K0: float, rho: float
) -> np.ndarray:
    """Return the (W, 1 + J) integrand of each multiplier at each frequency: that of f v, then one a
    filter.
    """
    filters, lost = _filter_terms(omega, rates, K0=K0, rho=rho)
    return (filters * mobility[:, None] - lost).real


def _filter_terms(
    omega: np.ndarray, rates: np.ndarray, *, K0: float, rho: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return (W, 1 + J) factors on the velocity, and losses: of f v, then of each filter."""
    s = 1j * omega[:, None]
    factors = 1 - rates / (rho * (rates - s))
    lost = rates * omega[:, None] ** 2 / (rho * K0 * (rates**2 + omega[:, None] ** 2))
    one = np.ones((omega.size, 1))
    return np.hstack([one, factors]), np.hstack([0 * one, lost])


def port_terms(
    mobility: np.ndarray, omega: np.ndarray, *, rates: np.ndarray, K0: np.ndarray, rho: np.ndarray
) -> np.ndarray:
    """Return the (W, P (1 + J), P, P) integrand of each multiplier: hermitian forms in the P
    friction forces.

    mobility : (W, P, P); K0, rho : (P,) of the class at each port. All multipliers of the first
    port come first.
    """
    forces = np.broadcast_to(np.eye(rho.size, dtype=complex), (omega.size, rho.size, rho.size))
    table = []
    for port in range(rho.size):
        table += friction_forms(
            forces[:, port], mobility[:, port], omega=omega, rates=rates, K0=K0[port], rho=rho[port]
        )
    return np.stack(table, axis=1)


def hermitian_product(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the (W, P, P) form Re(conj(x) y) of two linear forms (W, P)."""
    full = np.conj(x)[:, :, None] * y[:, None, :]
    return np.asarray((full + np.conj(np.swapaxes(full, 1, 2))) / 2)


def friction_forms(
    f: np.ndarray, v: np.ndarray, *, omega: np.ndarray, rates: np.ndarray, K0: float, rho: float
) -> list[np.ndarray]:
    """Return the (W, P, P) hermitian form of each multiplier; friction f and velocity v are linear
    forms (W, P).
    """
    factors, lost = _filter_terms(omega, rates, K0=K0, rho=rho)
    own = hermitian_product(f, f)
    return [
        hermitian_product(f, factors[:, [j]] * v) - lost[:, j, None, None] * own
        for j in range(1 + rates.size)
    ]


_MAX_ROUNDS = 60
_NEGLIGIBLE_WEIGHT = 1e-9  # relative to the largest weight; smaller weights become zero
_NOT_NEGATIVE = (
    -1e-9
)  # a largest eigenvalue above this, relative to the diagonal, does not count as negative


def negative_multipliers(
    table: np.ndarray,
    *,
    couplings: Sequence[float],
    least: float,
    balanced: np.ndarray | None = None,
) -> np.ndarray | None:
    """Return few multipliers >= 0 (C,) that make every hermitian matrix negative definite; None if
    none are found.

    couplings : the off-diagonal terms are enlarged by 1/coupling; the first coupling with
    multipliers is taken. The other arguments are those of `_coupled_multipliers`.
    """
    tried = (
        _coupled_multipliers(table, coupling, least=least, balanced=balanced)
        for coupling in couplings
    )
    return next((theta for theta in tried if theta is not None), None)


def _coupled_multipliers(
    table: np.ndarray, coupling: float, *, least: float, balanced: np.ndarray | None
) -> np.ndarray | None:
    """Return (C,) multipliers for one enlargement of the off-diagonal terms, or None.

    A matrix is negative if its form is, for every vector. A linear program over the worst vectors
    so far is solved again until no vector is worse (cutting planes, Kelley 1960). The enlargement
    leaves slack for the aliases of the sampler.

    table : (W, C, P, P) matrix of each multiplier at each frequency.
    least : share of every row that must remain.
    balanced : (C, B) combinations of the multipliers that must be zero.
    """
    n = table.shape[-1]
    table = np.where(np.eye(n, dtype=bool), table, table / coupling)
    rows = [table[..., i, i].real for i in range(n)]
    for _ in range(_MAX_ROUNDS):
        theta, share = maxwell_slip_multipliers(np.concatenate(rows), balanced)
        if not share > least:
            return None
        theta[theta < _NEGLIGIBLE_WEIGHT * theta.max()] = 0.0
        # small weights were set to zero, so the sign is tested again
        both = np.einsum("wcij,c->wij", table, theta)
        diagonal = np.diagonal(both, axis1=1, axis2=2).real
        if not diagonal.max() < 0:
            return None
        unit = 1 / np.sqrt(-diagonal)  # forces at different ports in comparable units
        sizes, vectors = np.linalg.eigh(both * unit[:, :, None] * unit[:, None, :])
        worse = sizes[:, -1] >= _NOT_NEGATIVE
        if not worse.any():
            return theta
        worst = vectors[..., -1] * unit
        rows.append(
            np.einsum("wi,wcij,wj->wc", worst.conj(), table, worst, optimize=True).real[worse]
        )
    return None


def maxwell_slip_multipliers(
    table: np.ndarray, balanced: np.ndarray | None = None
) -> tuple[np.ndarray, float]:
    """Return the (1 + J,) multipliers that make every row most negative relative to its largest
    entry, and that share.

    balanced : (1 + J, B) combinations of the multipliers that must be zero.
    """
    scaled = table / np.abs(table).max(axis=1, keepdims=True)
    columns = np.abs(scaled).max(axis=0)
    scaled = scaled / columns
    n = table.shape[1]
    A = np.column_stack([scaled, np.ones(table.shape[0])])
    if balanced is None:
        equal = np.ones((1, n))
    else:
        equal = np.vstack([np.ones(n), (balanced / columns[:, None]).T])
    result = linprog(
        np.append(np.zeros(n), -1.0),
        A_ub=A,
        b_ub=np.zeros(table.shape[0]),
        A_eq=np.column_stack([equal, np.zeros(equal.shape[0])]),
        b_eq=np.append(1.0, np.zeros(equal.shape[0] - 1)),
        bounds=[(0, None)] * n + [(None, None)],
        method="highs",
    )
    if result.x is None:
        return np.zeros(n), -np.inf
    mu = np.clip(result.x[:-1], 0, None)
    return mu / columns, float(-(A[:, :-1] @ mu).max())
