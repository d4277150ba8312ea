"""The rig and the controllers of the oracles, and elements of friction that move exactly."""

import control
import numpy as np
from scipy.linalg import expm

from robust.friction.loop import friction_loop
from robust.friction.plant import friction_plant

T = 1e-3
RIG = friction_plant(1.0, 80e3, 0.4)
#: (Kp, Ki, Kd, delay) and the largest K0 of the weights for stiction 1.05, 1/0.7 and 2, the lowest
#: unstable spring.
ORACLES = {
    "P1": ((20e3, 3e5, 60.0, 0.0), (1.826e6, 2.303e5, 9.88e4), 1.826e6),
    "P2": ((-10e3, 2e6, 150.0, 0.0), (1.337e6, 1.562e5, 6.69e4), 2.318e6),
    "P3": ((40e3, 1e6, 120.0, T), (1.356e5, 1.356e5, 1.034e5), 1.356e5),
    "P4": ((0.0, 1e6, 30.0, 0.0), (1.561e6, 1.824e5, 7.83e4), 2.401e6),
}


def pid(Kp, Ki, Kd):
    """K = Kp + Ki T/(z - 1) + Kd (1 - 1/z)/T."""
    return control.StateSpace([[1, 0], [0, 0]], [[1], [1]], [[Ki * T, -Kd / T]], [[Kp + Kd / T]], T)


def pd(Kp, Kd):
    """K = Kp + Kd (1 - 1/z)/T."""
    return control.StateSpace([[0.0]], [[1.0]], [[-Kd / T]], [[Kp + Kd / T]], T)


def oracle_loop(name):
    (Kp, Ki, Kd, delay), _, _ = ORACLES[name]
    return friction_loop(RIG, pid(Kp, Ki, Kd), delay)


class Element:
    """A spring in series with a slider whose limits are drawn anew whenever it sticks: a member of
    the class.

    It moves with a loop in short exact steps; where it breaks away within a step, its limit was
    what it holds then.
    """

    def __init__(self, k, W, rho, rng):
        self.k, self.W, self.rho, self.rng = k, W, rho, rng
        self.force, self.slips = 0.0, 0.0
        self.draw()

    def draw(self):
        self.limit = self.W * self.rng.uniform(1 / self.rho, 0.98)
        self.level = self.rng.uniform(self.W / self.rho, self.limit)

    def after(self, force, v):
        """Commit a step that ended with the force of a stuck element, or with a slip, at the
        velocity v.
        """
        if self.slips:
            if v * self.slips <= 0:
                self.slips = 0.0
                self.draw()
        else:
            self.force = force
            if abs(force) >= self.limit:
                self.slips = np.sign(force)
                self.force = self.slips * self.level


def motion(loop, elements, xi, rates, n_samples, steps=40):
    """(n_samples, ...) state, filtered friction and elastic force just before each sample, elements
    and all.
    """
    n, J = xi.size, rates.size
    filters = np.zeros(J)
    h = loop.T / steps
    maps = {}
    rows = []
    for _ in range(n_samples):
        rows.append((xi, filters, sum(element.force for element in elements)))
        xi = loop.jumps[0] @ xi
        for _ in range(steps):
            stuck = tuple(not element.slips for element in elements)
            if stuck not in maps:
                maps[stuck] = exact_map(loop, elements, stuck, rates, h)
            start = np.concatenate([xi, filters, [element.force for element in elements]])
            end = maps[stuck] @ start
            xi, filters = end[:n], end[n : n + J]
            for element, force in zip(elements, end[n + J :], strict=True):
                element.after(force, loop.v @ xi)
    return rows


def exact_map(loop, elements, stuck, rates, h):
    """One short step of loop, filters and elements of which some stick."""
    n, J, E = loop.F.shape[0], rates.size, len(elements)
    M = np.zeros((n + J + E, n + J + E))
    M[:n, :n] = loop.F
    M[:n, n + J :] = loop.B[:, None]
    M[n : n + J, n : n + J] = -np.diag(rates)
    M[n : n + J, n + J :] = rates[:, None]
    for i, element in enumerate(elements):
        if stuck[i]:
            M[n + J + i, :n] = element.k * loop.v
    return expm(h * M)
