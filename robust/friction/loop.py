"""The loop around a machine while it slides: between its samples, at them, and over frequency.

Flow xi' = F xi + B f over a span, with the jump xi+ = J xi before it. The state xi contains the
machine, the held force, the forces that wait for the delay, and the controller. Nothing is
cancelled: the controller is used as given.
"""

from __future__ import annotations

from itertools import product

import control
import numpy as np
from scipy.linalg import expm

from nlfrf._base.values import value
from robust._base.types import Controller
from robust.friction.plant import FrictionPlant, separate_delay
from robust.lti.lti import timebase
from robust.lti.realisation import state_space

_EPS = np.finfo(float).eps
_LONGEST_DELAY = 20  # samples
CIRCLE_MARGIN = 1e-9  # rounding may put a pole closer to the unit circle on either side


@value
class FrictionLoop:
    """A loop around a machine without friction, and the input of a friction f at its port."""

    # (n, n) dynamics between the samples; those of the whole loop if the controller is continuous
    F: np.ndarray
    # (n,) or (n, P) input of the friction: xi' = F xi + B f; one column for each port
    B: np.ndarray
    # x, v: (n,) or (P, n) displacement and velocity at the friction port; one row for each port
    x: np.ndarray
    v: np.ndarray
    T: float  # sampling time [s]; zero for a continuous controller
    spans: np.ndarray  # (S,) durations of the flows [s]
    jumps: np.ndarray  # (S, n, n) jump before each flow
    measured: np.ndarray  # (n,) row of the measured position

    @property
    def columns(self) -> np.ndarray:
        """(n, P) input of the friction at each port."""
        return self.B.reshape(self.F.shape[0], -1)

    @property
    def displacements(self) -> np.ndarray:
        """(P, n) displacement at each port."""
        return np.atleast_2d(self.x)

    @property
    def velocities(self) -> np.ndarray:
        """(P, n) velocity at each port."""
        return np.atleast_2d(self.v)

    def period(
        self, kappa: float | np.ndarray = 0.0, damper: float | np.ndarray = 0.0
    ) -> np.ndarray:
        """(n, n) state transition over one sample, from just before the jump, with springs and
        dampers at the ports.

        It is F for a continuous controller. kappa : stiffness [N/m], one for all ports or one for
        each.
        """
        F = (
            self.F
            + self.columns * kappa @ self.displacements
            + self.columns * damper @ self.velocities
        )
        if not self.T:
            return F
        total = np.eye(F.shape[0])
        for span, jump in zip(self.spans, self.jumps, strict=True):
            total = expm(span * F) @ jump @ total
        return total

    def poles(
        self, kappa: float | np.ndarray = 0.0, damper: float | np.ndarray = 0.0
    ) -> np.ndarray:
        """Poles of the loop with a spring and a damper at its port; of one period for a sampled
        controller.
        """
        return np.linalg.eigvals(self.period(kappa, damper))

    def growth(self, kappa: float | np.ndarray = 0.0, damper: float | np.ndarray = 0.0) -> float:
        """Largest |pole| minus one, or largest real part: negative for a stable loop."""
        poles = self.poles(kappa, damper)
        return float(np.abs(poles).max() - 1 if self.T else poles.real.max())

    def rest(self) -> tuple[np.ndarray, np.ndarray]:
        """Rest position under f = 1 N, of the shape of B, and the error bound of each entry."""
        unit_time = self.T or 1.0
        own = np.eye(self.F.shape[0])
        conditions = np.vstack([self.F * unit_time, *(jump - own for jump in self.jumps)])
        wanted = np.zeros((conditions.shape[0], *self.B.shape[1:]))
        wanted[: own.shape[0]] = -self.B * unit_time
        unit = np.linalg.norm(conditions, axis=0)
        unit[unit == 0] = 1.0  # a state with an arbitrary rest
        inverse = np.linalg.pinv(conditions / unit, rcond=1e-15) / unit[:, None]
        there = inverse @ wanted
        for _ in range(2):
            there += inverse @ (wanted - conditions @ there)
        left = np.abs(conditions @ there - wanted) + own.shape[0] * _EPS * (
            np.abs(conditions) @ np.abs(there)
        )
        return there, 2 * np.abs(inverse) @ left


def friction_loop(machine: FrictionPlant, K: Controller, delay: float = 0.0) -> FrictionLoop:
    """Return the loop u = -K y around a machine; for a sampled K with sampler, delay [s] and hold.

    The delay of the machine itself is added to it.

    >>> from robust.friction.plant import friction_plant
    >>> loop = friction_loop(friction_plant(1.0, 80e3, 0.4), 0.0)
    >>> round(loop.growth(), 3)                                    # -c / 2m: the damping of the rig alone
    -0.2
    """
    K = state_space("K", K)
    machine, delay = separate_delay(machine, delay)
    T = timebase(K)
    if not T:
        if delay:
            raise ValueError(
                f"delay must be 0 s with a continuous controller, got {delay:g} s. Sample it first"
            )
        return _continuous_loop(machine, K)
    whole = int(np.floor(delay / T + 1e-9))
    part = max(0.0, delay - whole * T)
    if part < 1e-9 * T:
        part = 0.0
    if whole > _LONGEST_DELAY:
        raise ValueError(
            f"delay must be at most {_LONGEST_DELAY} samples of {T:g} s, got {delay:g} s"
        )
    n, s, waiting = machine.A.shape[0], K.nstates, whole + (part > 0)
    size = n + 1 + waiting + s
    held, queue, own = n, slice(n + 1, n + 1 + waiting), slice(n + 1 + waiting, size)
    F = np.zeros((size, size))
    F[:n, :n], F[:n, held] = machine.A, machine.B_force
    command = np.zeros(size)  # u = K (0 - y), of the state before the jump
    command[own] = K.C[0] if s else 0.0
    command[:n] -= K.D[0, 0] * machine.C_measured
    jump = np.eye(size)
    jump[own, own] = K.A
    jump[own, :n] = -np.outer(K.B[:, 0], machine.C_measured) if s else 0.0
    line = np.vstack(
        [command, np.eye(size)[queue]]
    )  # the new force, then those that wait, oldest last
    jump[queue] = line[:waiting]
    jumps, spans = [jump], [T]
    if part:
        late = np.eye(size)
        late[held] = np.eye(size)[n + waiting]
        jumps, spans = [jump, late], [part, T - part]
    else:
        jump[held] = line[waiting]
    return FrictionLoop(
        F=F,
        B=pad_states(-machine.B_port.T, size).T,
        x=pad_states(machine.C_port, size),
        v=pad_states(machine.velocity, size),
        T=T,
        spans=np.array(spans),
        jumps=np.array(jumps),
        measured=pad_states(machine.C_measured, size),
    )


def _continuous_loop(machine: FrictionPlant, K: control.StateSpace) -> FrictionLoop:
    """Return the loop with a continuous controller: one flow and no jump."""
    n, s = machine.A.shape[0], K.nstates
    F = np.zeros((n + s, n + s))
    F[:n, :n] = machine.A - K.D[0, 0] * np.outer(machine.B_force, machine.C_measured)
    if s:
        F[:n, n:] = np.outer(machine.B_force, K.C[0])
        F[n:, :n], F[n:, n:] = -np.outer(K.B[:, 0], machine.C_measured), K.A
    return FrictionLoop(
        F=F,
        B=pad_states(-machine.B_port.T, n + s).T,
        x=pad_states(machine.C_port, n + s),
        v=pad_states(machine.velocity, n + s),
        T=0.0,
        spans=np.zeros(0),
        jumps=np.zeros((0, n + s, n + s)),
        measured=pad_states(machine.C_measured, n + s),
    )


def pad_states(part: np.ndarray, size: int) -> np.ndarray:
    """Pad rows (..., n) over the states of the machine to the states of the loop."""
    return np.concatenate([part, np.zeros((*part.shape[:-1], size - part.shape[-1]))], axis=-1)


# ---- The sliding loop over frequency: from the friction at its port to the velocity there.


def loop_frequencies(loop: FrictionLoop, n: int = 900) -> np.ndarray:
    """Return (W,) frequencies [rad/s] up to Nyquist: logarithmic, linear, and clustered at the
    poles of the loop.
    """
    poles = loop.poles()
    if loop.T:
        poles = np.log(np.where(poles == 0, 1e-300, poles).astype(complex)) / loop.T
    sizes = np.abs(poles[np.abs(poles) > 0])
    if loop.T:
        top = np.pi / loop.T
    else:
        top = 100 * sizes.max(initial=1.0)
    points = [np.geomspace(1e-5 * top, top, n // 2), np.linspace(top / n, top, n // 4)]
    for pole in poles[(poles.imag > 0) & (np.abs(poles) < top)]:
        width = max(abs(pole.real), 1e-6 * abs(pole))
        points.append(pole.imag + width * np.sinh(np.linspace(-3, 3, 31)))
    points.append(sizes)
    omega = np.unique(np.concatenate(points))
    return omega[(omega > 1e-6 * top) & (omega <= top)]


def mobility(loop: FrictionLoop, omega: np.ndarray) -> np.ndarray:
    """Return (W,) velocity at the port over friction at the same frequency; aliases of the sampler
    are left out.

    With several ports: (W, P, P), from the friction at the second index to the velocity at the
    first.
    """
    none = np.zeros(loop.F.shape[0])
    moved = [
        driven_states(loop, omega, flow=column, struck=none)[0] @ loop.v.T
        for column in loop.columns.T
    ]
    return np.asarray(np.stack(moved, axis=-1) if loop.B.ndim > 1 else moved[0])


def driven_states(
    loop: FrictionLoop, omega: np.ndarray, *, flow: np.ndarray, struck: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the (W, n) state at the frequency of the force, and the (W, n) state just before a
    sample.

    flow, struck : (n,) input of exp(j w t) into the flow, and into the first jump of a period
    (sampled loops only).

    With f = exp(j w t) the state repeats up to a phase. Its component at w follows from the flow by
    partial integration: (j w - F) xi_1 = B + (1/T) sum of the jumps, each with its phase.
    """
    n = loop.F.shape[0]
    # an undamped machine has its poles on the axis, where both sides of that equation vanish
    s = 1j * omega * (1 + 1e-9)
    pencil = s[:, None, None] * np.eye(n) - loop.F
    forced = np.linalg.solve(
        pencil, np.broadcast_to(flow.astype(complex)[:, None], (s.size, n, 1))
    )[..., 0]
    if not loop.T:
        return forced, forced
    flows = [expm(span * loop.F) for span in loop.spans]
    strikes = [struck, *[np.zeros(n)] * (len(flows) - 1)]
    # state before each jump as (matrix) start + (forced part)
    total, offset = np.eye(n), np.zeros((s.size, n), complex)
    before = []
    t = 0.0
    for phi, jump, hit, span in zip(flows, loop.jumps, strikes, loop.spans, strict=True):
        before.append((total, offset, t))
        total, offset = phi @ jump @ total, (offset @ jump.T + hit) @ phi.T
        offset = (
            offset
            + np.exp(s * (t + span))[:, None] * forced
            - (np.exp(s * t)[:, None] * forced) @ phi.T
        )
        t += span
    start = np.linalg.solve(np.exp(s * t)[:, None, None] * np.eye(n) - total, offset[..., None])[
        ..., 0
    ]
    jumped = np.zeros((s.size, n), complex)
    for (matrix, part, when), jump, hit in zip(before, loop.jumps, strikes, strict=True):
        jumped += np.exp(-s * when)[:, None] * (
            (start @ matrix.T + part) @ (jump - np.eye(n)).T + hit
        )
    answer = np.linalg.solve(pencil, jumped[..., None] / loop.T)[..., 0]
    return forced + answer, start


# ---- Refutation: a friction of the class that never slips is a spring, and a spring can make the
# loop unstable.

#: Springs that are tried, relative to K0: for one port, and for each of several.
_SPRING_SHARES = (
    np.unique(np.concatenate([np.linspace(0, 1, 31)[1:], np.geomspace(1e-3, 1, 30)])),
    np.concatenate([[0.0], np.geomspace(1e-3, 1, 13)]),
)


def destabilizing_stiffness(
    loop: FrictionLoop, K0: float | np.ndarray, damper: float | np.ndarray = 0.0
) -> tuple[float | tuple[float, ...], complex] | None:
    """Return the most unstable stiffness [N/m] found in [0, K0], and its pole; None if none is
    unstable.

    Each stiffness except zero comes with a damper [Ns/m], that of a bristle. With several ports,
    K0, damper and stiffness have one entry a port. The search covers a fixed grid and its
    refinement around the worst point.
    """
    beyond = CIRCLE_MARGIN * (1.0 if loop.T else np.abs(loop.poles()).max())
    n_ports = loop.columns.shape[1]
    stiffest = np.broadcast_to(np.asarray(K0, dtype=float), n_ports)
    worst, growth = np.zeros(n_ports), loop.growth()
    if growth <= beyond and stiffest.any():
        tried = _SPRING_SHARES[n_ports > 1]
        shares = np.array(list(product(tried, repeat=n_ports)))
        found = np.array([loop.growth(share * stiffest, damper) for share in shares])
        worst, growth = shares[int(np.argmax(found))], float(found.max())
        for port in range(
            n_ports
        ):  # between the neighbours of the worst, for one port after another
            at = int(np.searchsorted(tried, worst[port]))
            low, high = tried[max(at - 1, 0)], tried[min(at + 1, tried.size - 1)]
            for share in np.linspace(low, high, 9)[1:-1]:
                changed = np.where(np.arange(n_ports) == port, share, worst)
                now = loop.growth(changed * stiffest, damper)
                if now > growth:
                    worst, growth = changed, now
    if not growth > beyond:
        return None
    springs = worst * stiffest
    stiffness = float(springs[0]) if loop.B.ndim == 1 else tuple(map(float, springs))
    poles = loop.poles(springs, damper)
    return stiffness, complex(poles[np.argmax(np.abs(poles) if loop.T else poles.real)])


def format_pole_modulus(size: float) -> str:
    """Format the modulus of a pole with enough digits to distinguish it from one."""
    if size == 1:
        digits = 6
    else:
        digits = int(np.clip(np.ceil(3 - np.log10(abs(size - 1))), 6, 16))
    return f"{size:.{digits}g}"
