"""The smallest real parameters that take a loop to its stability boundary, found by its poles.

Real numbers make a loop singular at isolated frequencies only, and a grid of frequencies steps over them. Poles need no
grid: they are followed from the nominal loop outwards, along the corners of the box and along some directions inside
it, and from the best of them uphill (de Gaston & Safonov 1988 look at corners; first-order moves as in Seiler 2010).
What is found is a fact about the loop; that nothing was found proves nothing.
"""

from __future__ import annotations

import time
from itertools import product

import control
import numpy as np

from nlfrf.shared.values import value
from robust.certificates.stability import instability
from robust.mu.blocks import BlockStructure
from robust.systems.lti import in_s, timebase

__all__ = ["Crossing", "crossing"]


CORNERS = 6  # parameters up to which every corner is looked at
SOME = 48  # random directions beside them
STEPS = 24  # sizes looked at on the way out
MOVES = 12  # attempts to do better from the best direction


@value
class Crossing:
    """Real parameters that bring a pole to the stability boundary.

    Fields
    ------
    size : float
        Largest modulus of the parameters.
    delta : (n_in, n_out) ndarray
        The perturbation, zero but for its real blocks.
    omega : float
        Where the pole crosses [rad/s].
    """

    size: float
    delta: np.ndarray
    omega: float


@value(copy=False)
class Parametric:
    """A loop as a function of its real parameters x (K, r), one for each real block.

    Fields
    ------
    A, B, C, D : ndarray
        The loop, cut to the channels of the real blocks.
    of : (m,) int ndarray
        Which parameter closes each of these channels.
    dt : float
        Sampling time [s], 0 for continuous.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    of: np.ndarray
    dt: float

    def closed(self, x: np.ndarray) -> np.ndarray:
        """(K, n, n) state matrices."""
        d = x[:, self.of]
        around = np.eye(len(self.of)) - self.D * d[:, None, :]
        return np.asarray(self.A + self.B @ (d[:, :, None] * np.linalg.solve(around, self.C[None])))

    def excess(self, x: np.ndarray) -> np.ndarray:
        """(K,) how far the farthest pole is beyond the stability boundary; inf where the loop has no solution."""
        try:
            poles = np.linalg.eigvals(self.closed(x))
        except np.linalg.LinAlgError:
            return np.full(len(x), np.inf)
        return np.asarray((np.abs(poles) - 1 if self.dt else poles.real).max(axis=1))

    def slope(self, x: np.ndarray) -> np.ndarray:
        """(r,) how the excess grows with each parameter."""
        values, right = np.linalg.eig(self.closed(x[None])[0])
        k = int(np.argmax(np.abs(values) if self.dt else values.real))
        left = np.linalg.pinv(right)[k]
        d = x[self.of]
        around = np.eye(len(d)) - self.D * d
        reads = np.linalg.solve(around, self.C @ right[:, k])  # (I - D d)^-1 C r
        drives = np.linalg.solve(np.eye(len(d)) - (d[:, None] * self.D).T, self.B.T @ left)
        turn = values[k].conj() / abs(values[k]) if self.dt else 1.0
        moves = (turn * drives * reads).real
        return np.bincount(self.of, weights=moves, minlength=x.size)


def crossing(
    N: control.StateSpace, s: BlockStructure, least: float, limit: float, *, time_cap: float = 2.0
) -> Crossing | None:
    """The smallest real parameters found that take a stable loop to the boundary.

    Parameters
    ----------
    N : control.StateSpace
        What the perturbation closes, stable.
    s : BlockStructure
        Complex blocks stay at zero.
    least, limit : float
        Sizes between which they are looked for.
    time_cap : float
        Seconds; what was found by then is returned.
    """
    if "real" not in s.kinds or not N.nstates or least >= limit:
        return None
    deadline = time.monotonic() + time_cap
    real = [k for k, kind in enumerate(s.kinds) if kind == "real"]
    rows, cols = (np.concatenate([np.arange(cut[k].start, cut[k].stop) for k in real]) for cut in (s.rows, s.cols))
    of = np.repeat(np.arange(len(real)), [s.rows[k].stop - s.rows[k].start for k in real])
    loop = Parametric(A=N.A, B=N.B[:, cols], C=N.C[rows], D=N.D[np.ix_(rows, cols)], of=of, dt=timebase(N))
    around = directions(len(real))
    inner = 0.0
    for size in np.geomspace(least, limit, STEPS):
        excess = loop.excess(size * around)
        if excess.max() > 0 or time.monotonic() > deadline:
            break
        inner = size
    if excess.max() <= 0:
        return None
    y = around[excess.argmax()]
    size = halved(loop, y, inner, size)
    for _ in range(MOVES):
        if time.monotonic() > deadline:
            break
        # uphill at the present size: the best corner by the slope, and part of the way to it
        better = np.sign(loop.slope(size * y))
        tried = np.concatenate([y + np.linspace(0.1, 1, 10)[:, None] * (better - y), around])
        excess = loop.excess(0.999 * size * tried)
        if excess.max() <= 0:
            break
        y = tried[excess.argmax()]
        size = halved(loop, y, 0.0, 0.999 * size)
        y, size = y / np.abs(y).max(), size * float(np.abs(y).max())
    delta = np.zeros(s.shape[::-1])
    delta[cols, rows] = size * y[of]
    at, beyond = loop.closed(size * y * np.array([[1.0], [1.001]]))
    farther = control.StateSpace(beyond, np.zeros((N.nstates, 1)), np.zeros((1, N.nstates)), 0.0, N.dt)
    if not instability(farther).unstable:
        return None
    poles = np.linalg.eigvals(at)
    pole = poles[np.argmax(np.abs(poles) if loop.dt else poles.real)]
    omega = abs(in_s(np.array([pole]), loop.dt)[0].imag)
    return Crossing(size=float(size), delta=delta, omega=float(omega))


def directions(n: int) -> np.ndarray:
    """(K, n) corners of the box, all of them or some, each parameter alone, and points inside."""
    rng = np.random.default_rng(0)
    corners = np.array(list(product((-1.0, 1.0), repeat=n))) if n <= CORNERS else np.sign(rng.standard_normal((64, n)))
    inside = rng.uniform(-1, 1, (SOME, n))
    inside /= np.abs(inside).max(axis=1, keepdims=True)
    return np.concatenate([corners, np.eye(n), -np.eye(n), inside]) if n > 1 else corners


def halved(loop: Parametric, y: np.ndarray, inner: float, outer: float) -> float:
    """The size between a stable and an unstable one where the direction y crosses, from above."""
    for _ in range(40):
        middle = (inner + outer) / 2
        if loop.excess((middle * y)[None])[0] > 0:
            outer = middle
        else:
            inner = middle
        if outer - inner <= 1e-9 * outer:
            break
    return outer
