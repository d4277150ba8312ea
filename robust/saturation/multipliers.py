"""Weights for a friction of a class and an actuator that saturates, together, by linear programs over frequency.

What the actuator misses, w = asked - u, obeys at every instant, for filters u_j of the force it gives,

    w (share (asked - h) - w) >= 0    while (1 - share) |asked - h| is at most what the limit leaves over friction
    w (u - u_j)               >= 0    as a mean of the past never exceeds the limit

with h the force that holds the friction at rest. With those of the friction they make one hermitian matrix in (f, w) a
frequency. Nothing here is a proof.
"""

from __future__ import annotations

import numpy as np

from nlfrf.shared.values import value
from robust.friction_proof.multipliers import weights
from robust.saturation.loop import CutLoop
from robust.sliding.response import driven

__all__ = ["SaturationWeights", "saturation_rows", "saturation_weights"]

LEAST = 1e-9  # share of a row that has to be left
SMALL = 1e-12  # of the largest weight: what is left out
ROUNDS = 60
COUPLINGS = (0.7, 0.9, 0.97, 0.99)  # of f and w, of what a definite matrix allows: slack for what the sampler folds


@value
class SaturationWeights:
    """Weights of friction and actuator.

    Fields
    ------
    mu : (1 + R,) ndarray
        Of the friction itself, and of its filters.
    sector : float
        Of w (share (asked - h) - w).
    given : (J,) ndarray
        Of the filters of the actuator.
    """

    mu: np.ndarray
    sector: float
    given: np.ndarray


def saturation_rows(
    cut: CutLoop, omega: np.ndarray, rates: np.ndarray, K0: float, rho: float, forgets: np.ndarray, share: float
) -> np.ndarray:
    """(W, 1 + R + 1 + J, 2, 2) hermitian forms in (f, w): friction, its filters, sector, filters of the actuator."""
    loop, s = cut.loop, 1j * omega
    none = np.zeros(loop.B.size)
    by_f, before_f = driven(loop, omega, loop.B, none)
    by_w, before_w = driven(loop, omega, none, -cut.enters) if loop.T else driven(loop, omega, -cut.enters, none)
    v, asked = np.stack([by_f, by_w], axis=1) @ loop.v, np.stack([before_f, before_w], axis=1) @ cut.asked
    f, w = np.broadcast_to([1.0, 0.0], v.shape), np.broadcast_to([0.0, 1.0], v.shape)
    rest = float(cut.asked @ loop.rest()[0]) * (rates[0] / (rates[0] + s))[:, None] * f
    columns = [product(f, v)]
    for a in rates:
        bent = (1 - a / (rho * (a - s)))[:, None] * v
        columns.append(
            product(f, bent) - (a * omega**2 / (rho * K0 * (a**2 + omega**2)))[:, None, None] * product(f, f)
        )
    each = 1 / loop.T if loop.T else 1.0  # samples a second
    columns.append(each * product(w, share * (asked - rest) - w))
    step = np.exp(s * loop.T) - 1 if loop.T else s
    columns += [each * product(w, (step / (step + phi))[:, None] * (asked - w)) for phi in forgets]
    return np.stack(columns, axis=1)


def product(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(W, 2, 2) the form Re(conj(x) y) of two linear ones (W, 2)."""
    full = np.conj(x)[:, :, None] * y[:, None, :]
    return np.asarray((full + np.conj(np.swapaxes(full, 1, 2))) / 2)


def saturation_weights(table: np.ndarray, n_rates: int) -> SaturationWeights | None:
    """Weights that make every matrix negative, few of them; None where none were found."""
    for coupling in COUPLINGS:
        found = solved(table, coupling)
        if found is not None:
            mu, sector, given = found[: n_rates + 1], float(found[n_rates + 1]), found[n_rates + 2 :]
            return SaturationWeights(mu=mu, sector=sector, given=given)
    return None


def solved(table: np.ndarray, coupling: float) -> np.ndarray | None:
    """(C,) weights of the forms, what couples f and w taken larger by 1/coupling.

    A matrix is negative where its form is, for every (f, w): a linear program over the (f, w) that were worst so far,
    again and again until none is worse.
    """
    table = table.copy()
    table[..., 0, 1] /= coupling
    table[..., 1, 0] /= coupling
    rows = [table[..., 0, 0].real, table[..., 1, 1].real]
    for _ in range(ROUNDS):
        theta, share = weights(np.concatenate(rows))
        if not share > LEAST:
            return None
        theta[theta < SMALL * theta.max()] = 0.0
        both = np.einsum("wcij,c->wij", table, theta)
        a, d, b = both[:, 0, 0].real, both[:, 1, 1].real, both[:, 0, 1]
        if not max(a.max(), d.max()) < 0:
            return None
        worse = np.abs(b) >= np.sqrt(a * d)
        if not worse.any():
            return theta
        worst = np.stack([1 / np.sqrt(-a), np.conj(b) / np.maximum(np.abs(b), 1e-300) / np.sqrt(-d)], axis=1)
        rows.append(np.einsum("wi,wcij,wj->wc", worst.conj(), table, worst).real[worse])
    return None
