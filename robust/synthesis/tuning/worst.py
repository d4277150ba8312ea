"""The worst gain of a closed-loop channel over a set of plants, and its derivative by the loop.

The perturbation reads Z u and drives inputs and outputs of the plant by P. With the loop N around
it and the channel,

    N = [Z 0; 0 I] H [P 0; 0 I],

the gain over the set is the largest sigma(N22 + N21 Delta (I - N11 Delta)^-1 N12) over |Delta| <=
1.

For one scalar Delta and a scalar channel the values fill a disc, and centre plus radius is exact.
Otherwise scalings D that commute with Delta give the smallest gamma with

    (D N D^-1)^H (D N D^-1) <= diag(I, gamma^2 I),      D = diag(d_k I, I) for full blocks,

an upper bound for any D (SP 8.10.3). The search keeps D as a function of frequency and fits it
again between its rounds, as D-K iteration does (SP 8.12); the result uses the best D at every
frequency, as in `check`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nlfrf._base.values import value
from robust.mu.gain import gain_bound
from robust.mu.scalings import conjugate_transpose, upper

#: Distance 1 - |N11|^2 below which the worst case is continued by a tangent, so that a start
#: outside has a slope.
_NEAR_ONE = 1e-6
#: A second singular value within this ratio of the largest is a peak of its own.
SECOND_VALUE_RATIO = 0.9

#: The blocks of a perturbation: for each (rows, columns) of N that it closes.
Blocks = tuple[tuple[int, int], ...]
ONE_DISC: Blocks = ((1, 1),)


@value(copy=False)
class Perturbation:
    """Ports of the perturbation of a set, over frequency."""

    reads: np.ndarray  # (W, n_z, n_u) complex Z: the combination of plant inputs that it reads
    drives: (
        np.ndarray
    )  # (W, n_u + n_y, n_d) complex P: its effect at the inputs and the outputs of the plant
    reads_before: bool = False  # True if it reads the plant inputs without its own contribution

    def at(self, k: int) -> Perturbation:
        return replace(self, reads=self.reads[[k]], drives=self.drives[[k]])

    def pull_out(
        self,
        H: np.ndarray,
        rows: tuple[np.ndarray, np.ndarray],
        columns: tuple[np.ndarray, np.ndarray],
    ) -> np.ndarray:
        """Return N (W, n_z + p, n_d + m) for responses H; rows and columns of the plant, then of
        the channel.
        """
        n_z, n_d = self.reads.shape[1], self.drives.shape[2]
        N = np.empty((len(H), n_z + rows[1].size, n_d + columns[1].size), complex)
        of_inputs, of_outputs = H[:, rows[0]], H[:, rows[1]]
        N[:, :n_z, :n_d] = self.reads @ of_inputs[:, :, columns[0]] @ self.drives
        if self.reads_before:
            N[:, :n_z, :n_d] -= self.reads @ self.drives[:, : self.reads.shape[2]]
        N[:, :n_z, n_d:] = self.reads @ of_inputs[:, :, columns[1]]
        N[:, n_z:, :n_d] = of_outputs[:, :, columns[0]] @ self.drives
        N[:, n_z:, n_d:] = of_outputs[:, :, columns[1]]
        return N

    def carry_back(
        self,
        Q: np.ndarray,
        rows: tuple[np.ndarray, np.ndarray],
        columns: tuple[np.ndarray, np.ndarray],
        shape: tuple[int, ...],
    ) -> np.ndarray:
        """Return the adjoint for H, of this shape, from the adjoint Q for N at one frequency."""
        n_z, n_d = self.reads.shape[1], self.drives.shape[2]
        Z, P = self.reads[0].conj().T, self.drives[0].conj().T
        found = np.zeros(shape, complex)
        np.add.at(found, (rows[0][:, None], columns[0]), Z @ Q[:n_z, :n_d] @ P)
        np.add.at(found, (rows[0][:, None], columns[1]), Z @ Q[:n_z, n_d:])
        np.add.at(found, (rows[1][:, None], columns[0]), Q[n_z:, :n_d] @ P)
        np.add.at(found, (rows[1][:, None], columns[1]), Q[n_z:, n_d:])
        return found


# ---- One scalar perturbation in a scalar channel.


def disc_gain(N: np.ndarray, *, smooth: bool = False) -> np.ndarray:
    """Return (W,) largest |N22 + N21 Delta N12/(1 - N11 Delta)| over |Delta| <= 1, N (W, 2, 2); inf
    where |N11| >= 1.

    The values fill a disc with centre N22 + N21 N12 conj(N11)/(1 - |N11|^2) and radius |N21 N12|/(1
    - |N11|^2). `smooth` continues it to |N11| >= 1.
    """
    product, square = N[:, 1, 0] * N[:, 0, 1], np.abs(N[:, 0, 0]) ** 2
    if smooth:
        share = _inverse_slack(square)[0]
        return np.abs(N[:, 1, 1] + product * N[:, 0, 0].conj() * share) + np.abs(product) * share
    with np.errstate(divide="ignore", invalid="ignore"):
        found = np.abs(N[:, 1, 1] + product * N[:, 0, 0].conj() / (1 - square)) + np.abs(
            product
        ) / (1 - square)
    return np.where((square < 1) & np.isfinite(found), found, np.inf)


def disc_slope(N: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the smooth gain of N (2, 2) and its adjoint Q: d gain = Re sum conj(Q) dN."""
    N11, product = N[0, 0], N[1, 0] * N[0, 1]
    (share,), (slope,) = _inverse_slack(np.array([abs(N11) ** 2]))
    centre = N[1, 1] + product * np.conj(N11) * share
    u, edge = _direction(centre), _direction(product)
    of_product = (u * N11 + edge) * share
    by_share = (np.conj(u) * product * np.conj(N11)).real + abs(product)
    of_N11 = np.conj(u) * product * share + by_share * slope * 2 * N11
    Q = np.array([[of_N11, of_product * np.conj(N[1, 0])], [of_product * np.conj(N[0, 1]), u]])
    return float(abs(centre) + abs(product) * share), Q


def _direction(z: complex) -> complex:
    """Return z/|z|, or one for zero."""
    if z:
        return z / abs(z)
    return 1.0


def _inverse_slack(a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return 1/(1 - a), continued by its tangent at 1 - a = NEAR_ONE, and the slope by a."""
    slack = np.maximum(1 - a, _NEAR_ONE)
    return 1 / slack + np.maximum(_NEAR_ONE - (1 - a), 0) / _NEAR_ONE**2, 1 / slack**2


# ---- Several perturbations, or a channel with several signals, with scalings.


@value(copy=False)
class Scalings:
    """Scalings of the blocks over frequency; those of the channel are one."""

    omega: np.ndarray  # (W,) frequencies of the fit, increasing [rad/s]
    log_d: np.ndarray  # (K, W) logarithms of the scalings

    def at(self, omega: np.ndarray) -> np.ndarray:
        """Return (W, K) scalings at any frequencies: any positive numbers prove a bound, also
        between lines.
        """
        at = np.log(np.clip(omega, self.omega[0], self.omega[-1]))
        return np.exp([np.interp(at, np.log(self.omega), row) for row in self.log_d]).T


def fit_scalings(
    omega: np.ndarray, N: np.ndarray, *, blocks: Blocks, level: np.ndarray
) -> Scalings:
    """Return the scalings of least gain for N (W, ., .) at increasing positive frequencies.

    If perturbations of the set make the loop singular, they are those of least mu, with the channel
    over `level` (W,).
    """
    gain = largest_gain(N, blocks)
    level = np.where(np.isfinite(gain) & (gain > 1e-9 * level), gain, level)
    return Scalings(omega=omega, log_d=np.log(_scalings_of_mu(N, blocks, level).T))


def _scalings_of_mu(N: np.ndarray, blocks: Blocks, level: np.ndarray) -> np.ndarray:
    """Return (W, K) the scalings of least mu with the channel over `level` (W,); those of the
    channel are one.
    """
    rows, columns = _sizes_of(blocks)
    scaled = N.copy()
    scaled[:, rows:] /= level[:, None, None]
    structure = [*blocks, (N.shape[1] - rows, N.shape[2] - columns)]
    found = upper(np.moveaxis(scaled, 0, 2), structure).scaling
    assert found is not None
    D = np.abs(np.einsum("iiw->iw", found[0]))
    first = np.cumsum([0, *(block[0] for block in blocks)])
    return (D[first[:-1]] / D[first[-1]] * level).T


def largest_gain(N: np.ndarray, blocks: Blocks) -> np.ndarray:
    """Return (W,) the bound with the best scalings at every frequency; inf if no scalings prove the
    loop stable.

    The program of `gain_bound` is off by up to a thousandth because of rounding. The scalings of mu
    at that level prove the rest.
    """
    gain = gain_bound(np.moveaxis(N, 0, 2), list(blocks))
    known = np.flatnonzero(np.isfinite(gain) & (gain > 0))
    if known.size:
        d = _scalings_of_mu(N[known], blocks, gain[known])
        proves = _scaled_square(N[known], blocks, d)[1][:, -1] < 1 - _NEAR_ONE
        gain[known] = np.where(
            proves, np.minimum(scaled_gain(N[known], blocks, d), gain[known]), gain[known]
        )
    return gain


def _sizes_of(blocks: Blocks) -> tuple[int, int]:
    return sum(block[0] for block in blocks), sum(block[1] for block in blocks)


def _scaled_square(
    N: np.ndarray, blocks: Blocks, d: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return D N D^-1 (W, ., .), and eigenvalues and eigenvectors of the part of its square that
    Delta closes.
    """
    rows, columns = _sizes_of(blocks)
    left, right = (np.repeat(d, [block[k] for block in blocks], axis=1) for k in (0, 1))
    scaled = N.copy()
    scaled[:, :rows] *= left[:, :, None]
    scaled[:, :, :columns] /= right[:, None, :]
    inner = scaled[:, :, :columns]
    a, V = np.linalg.eigh(conjugate_transpose(inner) @ inner)
    return scaled, a, V


def scaled_gain(N: np.ndarray, blocks: Blocks, d: np.ndarray) -> np.ndarray:
    """Return (W,) the bound on the gain with scalings d (W, K), continued where they prove none."""
    scaled, a, V = _scaled_square(N, blocks, d)
    columns = a.shape[1]
    outer = scaled[:, :, columns:]
    across = conjugate_transpose(V) @ conjugate_transpose(scaled[:, :, :columns]) @ outer
    share = _inverse_slack(a)[0]
    B = conjugate_transpose(outer) @ outer + conjugate_transpose(across) @ (
        share[:, :, None] * across
    )
    return np.sqrt(np.maximum(np.linalg.eigvalsh(B)[:, -1], 0.0))


def scaled_slopes(N: np.ndarray, blocks: Blocks, d: np.ndarray) -> list[tuple[float, np.ndarray]]:
    """Return gains of N (., .) with scalings d (K,) and their adjoints; two if they are close.

    With A = (D N D^-1)^H D N D^-1 the square of the gain is v^H (A22 + A21 f(A11) A12) v, where f
    is 1/(1 - a) on the eigenvalues of A11. Its differential is tr(T dA), by Daleckii and Krein.
    """
    scaled, values, vectors = (each[0] for each in _scaled_square(N[None], blocks, d[None]))
    columns = values.size
    outer = scaled[:, columns:]
    across = vectors.conj().T @ scaled[:, :columns].conj().T @ outer
    share, slope = _inverse_slack(values)
    distance = values[:, None] - values
    with np.errstate(divide="ignore", invalid="ignore"):
        quotients = np.where(
            np.abs(distance) > 1e-7 * (1 + np.abs(values)),
            (share[:, None] - share) / distance,
            (slope[:, None] + slope) / 2,
        )
    squares, W = np.linalg.eigh(
        outer.conj().T @ outer + across.conj().T @ (share[:, None] * across)
    )
    left, right = (np.repeat(d, [block[k] for block in blocks]) for k in (0, 1))
    found = []
    for k in range(squares.size - 1, max(squares.size - 3, -1), -1):
        if squares[k] <= 0 or squares[k] < SECOND_VALUE_RATIO**2 * squares[-1]:
            break
        v, gain = W[:, k], float(np.sqrt(squares[k]))
        q = across @ v
        T = np.empty((scaled.shape[1],) * 2, complex)
        T[:columns, :columns] = vectors @ (quotients * np.outer(q, q.conj())) @ vectors.conj().T
        T[:columns, columns:] = np.outer(vectors @ (share * q), v.conj())
        T[columns:, :columns] = T[:columns, columns:].conj().T
        T[columns:, columns:] = np.outer(v, v.conj())
        Q = scaled @ T / gain
        Q[: left.size] *= left[:, None]
        Q[:, : right.size] /= right
        found.append((gain, Q))
    return found
