"""The rig and the controllers of the oracles, a sliding loop by another hand, and elements of
friction that move exactly.
"""

from types import SimpleNamespace

import control
import numpy as np
from scipy.linalg import expm

from robust import friction_plant

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
    return sliding_loop(RIG, pid(Kp, Ki, Kd), delay)


def sliding_loop(machine, K, delay=0.0):
    """The loop u = -K y that no friction holds: xi' = F xi + B f between samples, jumps at them.

    Its state is that of a claim: the machine, the held force, the forces that wait, the newest
    first, and the controller. For a continuous controller it has no jumps and T = 0.
    """
    K = control.ss(K)
    n, s, T, D = machine.A.shape[0], K.nstates, K.dt or 0.0, K.D[0, 0]
    push, read = machine.B_force[:, None], machine.C_measured[None]
    if not T:
        F = np.block([[machine.A - D * push @ read, push @ K.C], [-K.B @ read, K.A]])
        spans, jumps = [], []
    else:
        samples = delay / T
        whole = round(samples) if np.isclose(samples, round(samples)) else int(samples)
        part = 0.0 if np.isclose(samples, whole) else delay - whole * T
        waiting = whole + (part > 0)
        F = np.zeros((n + 1 + waiting + s, n + 1 + waiting + s))
        F[:n, : n + 1] = np.hstack([machine.A, push])
        same = np.eye(F.shape[0])
        command = np.concatenate([-D * read[0], np.zeros(1 + waiting), K.C[0] if s else []])
        forces = [command, *same[n + 1 : n + 1 + waiting]]
        at_sample = np.vstack([same[: n + 1], *forces[:waiting], same[n + 1 + waiting :]])
        at_sample[n + 1 + waiting :, :n] = -K.B @ read
        at_sample[n + 1 + waiting :, n + 1 + waiting :] = K.A
        if part:
            late = same.copy()
            late[n] = same[n + waiting]
            spans, jumps = [part, T - part], [at_sample, late]
        else:
            at_sample[n] = forces[waiting]
            spans, jumps = [T], [at_sample]
    more = np.zeros((*machine.C_port.shape[:-1], F.shape[0] - n))
    B = np.vstack([-machine.B_port.reshape(n, -1), np.zeros((F.shape[0] - n, machine.n_ports))])
    return SimpleNamespace(
        F=F,
        B=B[:, 0] if machine.B_port.ndim == 1 else B,
        x=np.concatenate([machine.C_port, more], axis=-1),
        v=np.concatenate([machine.velocity, more], axis=-1),
        T=T,
        spans=spans,
        jumps=jumps,
    )


def poles_of(loop, kappa=0.0):
    """Poles of the loop with a spring [N/m] at its port, of one period if it is sampled."""
    F = loop.F + kappa * np.outer(loop.B, loop.x)
    period = F if not loop.T else np.eye(F.shape[0])
    for span, jump in zip(loop.spans, loop.jumps, strict=True):
        period = expm(span * F) @ jump @ period
    return np.linalg.eigvals(period)


def growth(loop, kappa=0.0):
    """Largest |pole| minus one, or largest real part: negative for a stable loop."""
    poles = poles_of(loop, kappa)
    return float(np.abs(poles).max() - 1 if loop.T else poles.real.max())


def rest_of(loop):
    """The state at rest under f = 1 N, of the shape of B."""
    own = np.eye(loop.F.shape[0])
    unit = loop.T or 1.0
    still = np.vstack([loop.F * unit, *(jump - own for jump in loop.jumps)])
    pushed = np.zeros((still.shape[0], *loop.B.shape[1:]))
    pushed[: own.shape[0]] = -loop.B * unit
    size = np.linalg.norm(still, axis=0)
    return (np.linalg.pinv(still / size) @ pushed) / size.reshape(-1, *[1] * (pushed.ndim - 1))


def energy_of(claim, loop, xi, *, elements, filters):
    """The energy of a claim of Maxwell slip just before a sample, of known elements (theory: T2).

    elements : (stiffness, force, port) of each; filters : (J,) the force of each, filtered at the
    rates of its port. z'Pz - sum s_p fh_p x_p(y) - fh' s X fh/2, and what each element has stored.
    """
    rest = rest_of(loop).reshape(loop.F.shape[0], -1)
    x = np.atleast_2d(loop.x)
    ports = range(len(claim.ports))
    ratios = [port.stiction if port.stiction > 1 else 1.001 for port in claim.ports]
    total = [
        sum((fh for one, fh in zip(elements, filters, strict=True) if one[2] == p), start=0.0)
        for p in ports
    ]
    first = np.array([fh[0] for fh in total])
    y = xi - rest @ first
    z = np.linalg.solve(claim.V, np.concatenate([y, *(fh[1:] - fh[0] for fh in total)]))
    s = np.array(
        [
            port.free + (1 - 1 / rho) * port.weights.sum()
            for port, rho in zip(claim.ports, ratios, strict=True)
        ]
    )
    stored = z @ claim.P[-1, -1] @ z - s @ (first * (x @ y))
    stored -= 0.5 * first @ (s[:, None] * (x @ rest)) @ first
    for (k, f, p), fh in zip(elements, filters, strict=True):
        port, rho = claim.ports[p], ratios[p]
        held = f**2 / 2 - f * fh / rho + fh**2 / (2 * rho)
        stored += (port.free * f**2 / 2 + port.weights @ held) / k
    return stored


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
    """(n_samples, ...) state, filtered force (E, J) and force (E,) of each element just before each
    sample.
    """
    n, shape = xi.size, (len(elements), rates.size)
    filters = np.zeros(shape)
    h = loop.T / steps
    maps = {}
    rows = []
    for _ in range(n_samples):
        rows.append((xi, filters, np.array([element.force for element in elements])))
        xi = loop.jumps[0] @ xi
        for _ in range(steps):
            stuck = tuple(not element.slips for element in elements)
            if stuck not in maps:
                maps[stuck] = exact_map(loop, elements, stuck, rates, h)
            start = np.concatenate([xi, filters.ravel(), [element.force for element in elements]])
            end = maps[stuck] @ start
            xi, filters = end[:n], end[n : n + filters.size].reshape(shape)
            for element, force in zip(elements, end[n + filters.size :], strict=True):
                element.after(force, loop.v @ xi)
    return rows


def exact_map(loop, elements, stuck, rates, h):
    """One short step of loop, elements of which some stick, and the filters of each."""
    n, J, E = loop.F.shape[0], rates.size, len(elements)
    M = np.zeros((n + E * J + E, n + E * J + E))
    M[:n, :n] = loop.F
    M[:n, n + E * J :] = loop.B[:, None]
    for i, element in enumerate(elements):
        own = slice(n + i * J, n + (i + 1) * J)
        M[own, own] = -np.diag(rates)
        M[own, n + E * J + i] = rates
        if stuck[i]:
            M[n + E * J + i, :n] = element.k * loop.v
    return expm(h * M)
