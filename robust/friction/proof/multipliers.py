"""Multiplier weights for a class of friction, by a linear program over the frequencies.

For every Maxwell-slip friction of the class, f driven by the velocity v of its port, and every filter a_j,

    int (f - fh_j/rho) v - fh_j'^2/(rho a_j K0) dt >= -S(0),    fh_j' = a_j (f - fh_j).

A row is this integrand in the loop, v = mobility f, at one frequency. If a sum of rows with weights mu_j >= 0 is
negative at every frequency, it contradicts any motion that continues. Nothing here is a proof.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from scipy.optimize import linprog, minimize_scalar

from nlfrf._base.values import value
from robust.proofs.search.programs import solve_program

if TYPE_CHECKING:
    import cvxpy


@value(copy=False)
class Multipliers:
    """Weights of the filters of a friction class, and the block of bristles."""

    # rates, weights: (J,) rates [rad/s] of the filters, the reference first, and their weights mu_j
    rates: np.ndarray
    weights: np.ndarray
    free: float  # weight of f v
    # block, bounds: (3, 3) or (2,) for bristles, see `FrictionClaim`; empty for Maxwell slip
    block: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    bounds: np.ndarray = field(default_factory=lambda: np.zeros(0))


def used_multipliers(rates: np.ndarray, mu: np.ndarray) -> Multipliers:
    """Return the multipliers for one port without the filters of zero weight; the first filter, the reference, stays.

    mu : (1 + J,) weight of f v, then one a rate.
    """
    used = np.append(True, mu[2:] > 0)
    return Multipliers(rates=rates[used], weights=mu[1:][used], free=float(mu[0]))


_N_FILTERS = 24
#: Ranges in which filters are tried, one set after another [rad/s].
_FREQUENCY_RATIOS = ((0.5, 3000.0), (15.0, 3000.0), (30.0, 1500.0), (5.0, 1200.0))


def filter_rates(reference: float, fastest: float) -> list[np.ndarray]:
    """Return sets of rates a_j [rad/s], each with the reference first; all are below `fastest` = 1/bristle time."""
    sets = []
    for low, high in _FREQUENCY_RATIOS:
        top = min(high, 0.9 * fastest)
        rates = np.geomspace(min(low, top / 10), top, _N_FILTERS)
        first = np.argmin(np.abs(np.log(rates / reference)))
        sets.append(np.concatenate([rates[first : first + 1], np.delete(rates, first)]))
    return sets


def multiplier_terms(
    mobility: np.ndarray, omega: np.ndarray, *, rates: np.ndarray, K0: float, rho: float
) -> np.ndarray:
    """Return the (W, 1 + J) integrand of each multiplier at each frequency: that of f v, then one a filter."""
    filters, lost = _filter_terms(omega, rates, K0=K0, rho=rho)
    return (filters * mobility[:, None] - lost).real


def _filter_terms(omega: np.ndarray, rates: np.ndarray, *, K0: float, rho: float) -> tuple[np.ndarray, np.ndarray]:
    """Return (W, 1 + J) factors on the velocity, and losses: of f v, then of each filter."""
    s = 1j * omega[:, None]
    factors = 1 - rates / (rho * (rates - s))
    lost = rates * omega[:, None] ** 2 / (rho * K0 * (rates**2 + omega[:, None] ** 2))
    one = np.ones((omega.size, 1))
    return np.hstack([one, factors]), np.hstack([0 * one, lost])


def port_terms(
    mobility: np.ndarray, omega: np.ndarray, *, rates: np.ndarray, K0: np.ndarray, rho: np.ndarray
) -> np.ndarray:
    """Return the (W, P (1 + J), P, P) integrand of each multiplier: hermitian forms in the P friction forces.

    mobility : (W, P, P); K0, rho : (P,) of the class at each port. All multipliers of the first port come first.
    """
    forces = np.broadcast_to(np.eye(rho.size, dtype=complex), (omega.size, rho.size, rho.size))
    table = []
    for port in range(rho.size):
        table += friction_forms(
            forces[:, port], mobility[:, port], omega=omega, rates=rates, K0=K0[port], rho=rho[port]
        )
    return np.stack(table, axis=1)


def friction_forms(
    f: np.ndarray, v: np.ndarray, *, omega: np.ndarray, rates: np.ndarray, K0: float, rho: float
) -> list[np.ndarray]:
    """Return the (W, P, P) hermitian form of each multiplier; friction f and velocity v are linear forms (W, P)."""
    factors, lost = _filter_terms(omega, rates, K0=K0, rho=rho)
    own = hermitian_product(f, f)
    return [hermitian_product(f, factors[:, [j]] * v) - lost[:, j, None, None] * own for j in range(1 + rates.size)]


_MAX_ROUNDS = 60
_NEGLIGIBLE_WEIGHT = 1e-9  # relative to the largest weight; smaller weights become zero
_NOT_NEGATIVE = -1e-9  # a largest eigenvalue above this, relative to the diagonal, does not count as negative


def negative_multipliers(
    table: np.ndarray, *, couplings: Sequence[float], least: float, balanced: np.ndarray | None = None
) -> np.ndarray | None:
    """Return few multipliers >= 0 (C,) that make every hermitian matrix negative definite; None if none are found.

    couplings : the off-diagonal terms are enlarged by 1/coupling; the first coupling with multipliers is taken.
    The other arguments are those of `_coupled_multipliers`.
    """
    tried = (_coupled_multipliers(table, coupling, least=least, balanced=balanced) for coupling in couplings)
    return next((theta for theta in tried if theta is not None), None)


def _coupled_multipliers(
    table: np.ndarray, coupling: float, *, least: float, balanced: np.ndarray | None
) -> np.ndarray | None:
    """Return (C,) multipliers for one enlargement of the off-diagonal terms, or None.

    A matrix is negative if its form is, for every vector. A linear program over the worst vectors so far is solved
    again until no vector is worse.

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
        both = np.einsum("wcij,c->wij", table, theta)
        diagonal = np.diagonal(both, axis1=1, axis2=2).real
        if not diagonal.max() < 0:
            return None
        unit = 1 / np.sqrt(-diagonal)
        sizes, vectors = np.linalg.eigh(both * unit[:, :, None] * unit[:, None, :])
        worse = sizes[:, -1] >= _NOT_NEGATIVE
        if not worse.any():
            return theta
        worst = vectors[..., -1] * unit
        rows.append(np.einsum("wi,wcij,wj->wc", worst.conj(), table, worst, optimize=True).real[worse])
    return None


def maxwell_slip_multipliers(table: np.ndarray, balanced: np.ndarray | None = None) -> tuple[np.ndarray, float]:
    """Return the (1 + J,) multipliers that make every row most negative relative to its largest entry, and that share.

    balanced : (1 + J, B) combinations of the multipliers that must be zero.
    """
    scaled = table / np.abs(table).max(axis=1, keepdims=True)
    columns = np.abs(scaled).max(axis=0)
    scaled = scaled / columns
    n = table.shape[1]
    A = np.column_stack([scaled, np.ones(table.shape[0])])
    equal = np.ones((1, n)) if balanced is None else np.vstack([np.ones(n), (balanced / columns[:, None]).T])
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


# ---- Weights for the friction of bristles that creep, by one cone program over the frequencies.
#
# The bristle z bends with the velocity v minus a creep p: z' = q = v - p, F p >= 0, |p| <= rho |v|; F is a hysteresis
# of z with slopes up to K0, f = F + sigma q. These forms in gamma = F'/K0 and q have integrals bounded from below:
#
#     F v                                      with weight mu
#     -e_j q - (a_j/K0) e_j^2                  with weights nu_j; e_j = Fh_j - F, Fh_j' = a_j (F - Fh_j)
#     (v, q, gamma) M (v, q, gamma)'           q between (1 - rho) v and (1 + rho) v, gamma between 0 and q
#
# The loop turns them into one hermitian matrix a frequency. Nothing here is a proof.

BLOCK_ENTRIES = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))  # entries of M
_MIN_SHARE = 1e-7  # share of a row that the solver must leave
_SOLVER_TOLERANCE = 1e-9  # of M, added in the direction that makes the form larger: the tolerance of the solver
_NEGLIGIBLE_WEIGHTS = (1e-2, 1e-4, 1e-6)  # relative to the largest weight; filters below are left out


def bristle_terms(
    mobility: np.ndarray, omega: np.ndarray, *, rates: np.ndarray, K0: float, microdamping: float
) -> np.ndarray:
    """Return (W, 1 + J + 6, 2, 2) hermitian forms in (gamma, q): of F v, of each filter and of each entry of M."""
    s = 1j * omega
    zero, one = np.zeros_like(s), np.ones_like(s)
    F, q, gamma = (np.stack(pair, axis=1) for pair in ((K0 / s, zero), (zero, one), (one, zero)))
    v = mobility[:, None] * (F + microdamping * q)
    columns = [hermitian_product(F, v)]
    for a in rates:
        e = -K0 / (a + s)[:, None] * gamma
        columns.append(-hermitian_product(e, q) - a / K0 * hermitian_product(e, e))
    y = v, q, gamma
    columns += [hermitian_product(y[i], y[j]) * (1 if i == j else 2) for i, j in BLOCK_ENTRIES]
    return np.stack(columns, axis=1)


def hermitian_product(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the (W, P, P) form Re(conj(x) y) of two linear forms (W, P)."""
    full = np.conj(x)[:, :, None] * y[:, None, :]
    return np.asarray((full + np.conj(np.swapaxes(full, 1, 2))) / 2)


def bristle_multipliers(table: np.ndarray, rates: np.ndarray, rho: float) -> Multipliers | None:
    """Return multipliers that make every matrix most negative relative to its entries; None if there are none.

    The program is solved twice, the second time with the filters of large weight only: an interior-point solver leaves
    none at zero.
    """
    theta = _solve_multipliers(table, rho)
    if theta is None:
        return None
    n = theta.size
    kept = np.arange(n) >= n - 6
    for small in _NEGLIGIBLE_WEIGHTS:
        kept[: n - 6] = theta[: n - 6] > small * np.abs(theta).max()
        again = _solve_multipliers(table[:, kept], rho)
        if again is not None:
            break
    else:
        return None
    found = np.zeros(n)
    found[kept] = again / _term_sizes(table[:, kept])[1]
    block, bounds = enlarge_block(found[n - 6 :], rho)
    nu = found[1 : n - 6]
    return Multipliers(
        rates=rates[nu > 0], weights=nu[nu > 0], free=max(float(found[0]), 0.0), block=block, bounds=bounds
    )


def _term_sizes(table: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (W, 2) units of gamma and q at each frequency, and (C,) the largest size of each form in these units."""
    unit = 1 / np.sqrt(np.abs(np.diagonal(table, axis1=2, axis2=3)).max(axis=1))
    return unit, np.abs(table * unit[:, None, :, None] * unit[:, None, None, :]).max(axis=(0, 2, 3))


def _solve_multipliers(table: np.ndarray, rho: float) -> np.ndarray | None:
    """Return (C,) the multipliers of the cone solver, relative to the sizes of the forms; None if they fail."""
    import cvxpy as cp

    unit, scale = _term_sizes(table)
    table = table * unit[:, None, :, None] * unit[:, None, None, :] / scale[:, None, None]
    a, d, b = table[..., 0, 0].real, table[..., 1, 1].real, table[..., 0, 1]
    n = scale.size
    theta, share, bounds = cp.Variable(n), cp.Variable(), cp.Variable(2, nonneg=True)
    M = [theta[n - 6 + k] / scale[n - 6 + k] for k in range(6)]
    constraints = [
        cp.SOC(-(a + d) @ theta - 2 * share, cp.vstack([2 * b.real @ theta, 2 * b.imag @ theta, (a - d) @ theta])),
        M[5] <= 0,
        cp.norm(theta, 1) <= 1,
        *([theta[: n - 6] >= 0] if n > 6 else []),
    ]
    for i, form in enumerate(_block_at_ends(M)):
        p, cross, r = (x - bounds[i] * y for x, y in zip(form, _sector_form(rho), strict=True))
        constraints.append(cp.SOC(p + r, cp.hstack([2 * cross, p - r])))
    solve_program(cp.Problem(cp.Maximize(share), constraints), "CLARABEL")
    if theta.value is None or share.value is None or not share.value > _MIN_SHARE:
        return None
    return np.asarray(theta.value)


#: Entries (v, v), (v, q), (q, q) of a form: numbers, or expressions of a convex program.
Entries: TypeAlias = "tuple[float | cvxpy.Expression, float | cvxpy.Expression, float | cvxpy.Expression]"


def _block_at_ends(M: np.ndarray | cvxpy.Variable) -> tuple[Entries, Entries]:
    """Return the form of M in (v, q) at gamma = 0 and at gamma = q: entries (v, v), (v, q), (q, q)."""
    return (M[0], M[1], M[3]), (M[0], M[1] + M[2], M[3] + 2 * M[4] + M[5])


def _sector_form(rho: float) -> tuple[float, float, float]:
    """Return the form (q - (1 - rho) v)((1 + rho) v - q), entry by entry."""
    return rho**2 - 1, 1.0, -1.0


def enlarge_block(entries: np.ndarray, rho: float) -> tuple[np.ndarray, np.ndarray]:
    """Enlarge M by the tolerance of the solver, so that its form is nonnegative for all possible q and gamma."""
    M = np.array(entries)
    M[5] = min(M[5], 0.0)
    bounds, left = np.zeros(2), 0.0
    for i, form in enumerate(_block_at_ends(M)):
        bounds[i], below = _sector_multiple(form, rho)
        left = max(left, below)
    M[[0, 3]] += left + _SOLVER_TOLERANCE * np.abs(M).max()
    block = np.zeros((3, 3))
    for (i, j), entry in zip(BLOCK_ENTRIES, M, strict=True):
        block[i, j] = block[j, i] = entry
    return block, bounds


def _sector_multiple(form: tuple[float, float, float], rho: float) -> tuple[float, float]:
    """Return the largest multiple of the sector form below a form in (v, q), and the deficit that remains."""

    def below(multiple: float) -> float:
        p, cross, r = (x - multiple * y for x, y in zip(form, _sector_form(rho), strict=True))
        return float(np.hypot((p - r) / 2, cross) - (p + r) / 2)  # minus the least eigenvalue, a convex function

    top = 1.0 + 8 * np.abs(form).max()
    found = minimize_scalar(below, bounds=(0.0, top), method="bounded", options={"xatol": 1e-12 * top})
    multiple = min((0.0, float(found.x)), key=below)
    return multiple, max(below(multiple), 0.0)
