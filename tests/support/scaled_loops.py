"""Random loops with several blocks of perturbations, in units that lie decades apart."""

import control
import numpy as np

import robust
from tests.support.responses import response_by_channel

#: (rows, cols, kind) of each block.
STRUCTURES = (
    ((1, 1, "full"), (1, 1, "full")),
    ((1, 1, "full"), (1, 1, "full"), (2, 2, "full")),
    ((2, 1, "full"), (1, 2, "full"), (2, 2, "full")),
    ((2, 2, "repeated"), (1, 1, "full"), (1, 2, "full")),
    ((2, 2, "real"), (1, 1, "real"), (2, 2, "full")),
    ((1, 1, "full"), (1, 1, "full"), (2, 2, "repeated"), (1, 1, "real"), (1, 1, "full")),
)


def random_loop(rng, n, blocks, dt=0.0):
    """A stable N of n states whose channels fit the blocks."""
    rows, cols = [b[0] for b in blocks], [b[1] for b in blocks]
    A = rng.standard_normal((n, n))
    A -= (np.linalg.eigvals(A).real.max() + rng.uniform(0.05, 1)) * np.eye(n)
    B, C = rng.standard_normal((n, sum(cols))), rng.standard_normal((sum(rows), n))
    D = 0.1 * rng.standard_normal((sum(rows), sum(cols)))
    units = 10.0 ** rng.uniform(-3, 3, len(blocks))
    left, right = np.repeat(units, rows)[:, None], np.repeat(units, cols)
    B, C, D = B / right, left * C, left * D / right
    if dt:
        back = np.linalg.inv(np.eye(n) - A / 4)
        A, B, C, D = back @ (np.eye(n) + A / 4), back @ B, C @ back, D + C @ back @ B / 4
    return control.StateSpace(A, B, C, D, dt)


def bounds_on_grid(N, blocks):
    """Largest upper and lower bound of mu over frequencies around every pole."""
    poles = N.poles()
    if N.dt:
        poles = np.log(poles.astype(complex)) / N.dt
    near = np.outer(np.abs(poles), np.linspace(0.8, 1.2, 21)).ravel()
    omega = np.unique(np.concatenate([near, np.geomspace(1e-3, 1e3, 200)]))
    omega = omega[omega <= np.pi / N.dt] if N.dt else omega
    response = response_by_channel(N, omega)
    upper = robust.mu.upper(response, blocks).value.max()
    return upper, robust.mu.lower(response[:, :, ::10], blocks).value.max()
