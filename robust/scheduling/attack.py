"""Periodic trajectories of the operating point on which the state of a scheduled loop grows.

The search is in floating point, the proof in ball arithmetic. theta oscillates about a centre as a
triangle or a sine, or jumps between two points. Frequencies near twice the frequency of a mode, or
a fraction of it, cause parametric resonance. The growth over a period is the spectral radius of a
product of transition matrices. Delta is 0, 1 or -1.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from flint import ctx
from scipy.optimize import minimize_scalar

from nlfrf._base.values import value
from robust.proofs.exact.polynomial_matrices import BITS
from robust.proofs.exact.scheduled_kyp import ScheduleClaim
from robust.proofs.exact.trajectories import Trajectory, grows, held_loop

_VERTICES = 32  # of a period in continuous time, at least
_SAMPLES = 200  # in several short periods of a sampled loop
_LONGEST = 4000  # samples of a period
_PERIODS = 16  # that are tried, beside those near a mode
_NEAR = np.array([0.9, 0.97, 1.0, 1.03, 1.1])
_CENTRES = (0.0, 0.5, -0.5)
_SHARES = (1.0, 0.7, 0.5, 0.35, 0.25, 0.15)  # of the largest amplitude about a centre
_GROWS = 1 + 1e-9
_AT_REST = np.linspace(-1, 1, 33)
_ENDS = ((-1.0, 1.0), (-1.0, 0.0), (0.0, 1.0))


@value(copy=False)
class _Wave:
    """A shape ("triangle", "sine") of theta with its centre, and the perturbation."""

    shape: str
    centre: float
    delta: float

    def trajectory(self, period: float, amplitude: float, dt: float) -> Trajectory:
        """Return a period; for a sampled loop (dt [s]) so many of them that they are whole samples,
        nearly.
        """
        cycles = max(1, round(_SAMPLES * dt / period))
        if dt:
            count = max(2, round(cycles * period / dt))
        else:
            count = _VERTICES
        phase = np.arange(count) * cycles / count % 1
        if self.shape == "sine":
            wave = np.sin(2 * np.pi * phase)
        else:
            wave = 4 * np.abs((phase + 0.25) % 1 - 0.5) - 1
        theta = np.clip(self.centre + amplitude * wave, -1, 1)
        return Trajectory(theta=theta, step=dt or period / count, delta=self.delta)


def _exponentials(matrices: np.ndarray) -> np.ndarray:
    """Return exp of (N, n, n) matrices, all at once."""
    halvings = max(
        0, int(np.ceil(np.log2(max(np.linalg.norm(matrices, axis=(1, 2)).max(), 1e-300)))) + 2
    )
    small = matrices / 2.0**halvings
    made = term = np.broadcast_to(np.eye(matrices.shape[1]), matrices.shape)
    for k in range(1, 9):
        term = term @ small / k
        made = made + term
    for _ in range(halvings):
        made = made @ made
    return made


def slowest_growth(claim: ScheduleClaim) -> Trajectory | None:
    """Return the slowest trajectory found on which the loop grows, proved in balls; None if none
    was found.

    claim : loop and set; its P and its rate are not used.
    """
    loop = _FrozenLoop(claim)
    if (still := _growth_at_rest(loop, claim)) is not None:
        return still
    found: list[tuple[float, _Wave, float, float]] = []
    for delta, centre, shape in product(loop.deltas, _CENTRES, ("triangle", "sine")):
        wave = _Wave(shape=shape, centre=centre, delta=delta)
        for period, share in product(loop.periods(centre, delta), _SHARES):
            amplitude = share * (1 - abs(centre))
            one = wave.trajectory(period, amplitude, loop.dt)
            if (not found or one.rate < found[-1][0]) and loop.radius(one) > _GROWS:
                found.append((one.rate, wave, period, amplitude))
    for _, wave, period, amplitude in found[:-4:-1]:
        slowest = _refine(loop, wave, period, amplitude)
        for more in (1.0, 1.02, 1.1):
            centred = wave.centre + (slowest.theta - wave.centre) * more
            one = Trajectory(theta=np.clip(centred, -1, 1), step=slowest.step, delta=wave.delta)
            if grows(claim, one):
                return one
    return None


def _growth_at_rest(loop: _FrozenLoop, claim: ScheduleClaim) -> Trajectory | None:
    """Return a theta at which the loop grows, held there."""
    step = loop.dt or 1 / np.abs(np.linalg.eigvals(loop.at(np.zeros(1), 0.0)[0])).max()
    for delta in loop.deltas:
        sizes = np.abs(np.linalg.eigvals(loop.steps(_AT_REST, step, delta))).max(axis=1)
        one = Trajectory(theta=_AT_REST[[int(sizes.argmax())]], step=step, delta=delta)
        if sizes.max() > _GROWS and grows(claim, one):
            return one
    return None


def growing_jumps(claim: ScheduleClaim) -> Trajectory | None:
    """Return a trajectory that jumps between two points, on which the loop grows, proved in balls;
    or None.
    """
    loop = _FrozenLoop(claim)
    if (still := _growth_at_rest(loop, claim)) is not None:
        return still
    step = loop.dt or min(loop.periods()) / 16
    counts = np.unique(np.round(np.geomspace(1, 200, 16)).astype(int))
    for delta, ends in product(loop.deltas, _ENDS):
        steps = loop.steps(np.array(ends), step, delta)
        powers = [[np.linalg.matrix_power(each, p) for p in counts] for each in steps]
        for (i, p), (j, q) in product(enumerate(counts), enumerate(counts)):
            if _radius(powers[0][i] @ powers[1][j]) > _GROWS:
                one = Trajectory(theta=np.repeat(ends, [p, q]), step=step, held=True, delta=delta)
                if grows(claim, one):
                    return one
    return None


def _refine(loop: _FrozenLoop, wave: _Wave, period: float, amplitude: float) -> Trajectory:
    """Return a slower trajectory that grows: the least amplitude of each period, the best period
    near the given one.
    """
    best = wave.trajectory(period, amplitude, loop.dt)

    def rate(log_period: float) -> float:
        nonlocal best
        low, high, least = 0.0, 1 - abs(wave.centre), np.inf
        for _ in range(10):
            if np.isfinite(least) or low:
                middle = (low + high) / 2
            else:
                middle = min(amplitude, high)
            one = wave.trajectory(np.exp(log_period), middle, loop.dt)
            if loop.radius(one) > _GROWS:
                high, least = middle, one.rate
                if one.rate < best.rate:
                    best = one
            else:
                low = middle
        if np.isfinite(least):
            return least
        return 10 * best.rate

    minimize_scalar(
        rate,
        bounds=np.log(period) + np.array([-0.1, 0.1]),
        method="bounded",
        options={"maxiter": 12},
    )
    return best


def _radius(matrix: np.ndarray) -> float:
    return float(np.abs(np.linalg.eigvals(matrix)).max())


class _FrozenLoop:
    """A loop in doubles, with theta held in each step."""

    def __init__(self, claim: ScheduleClaim) -> None:
        with ctx.workprec(BITS):
            loop = held_loop(claim)
        self._A, self._B, self._C, self._D = (getattr(loop, name).to_array() for name in "ABCD")
        self._q = loop.blocks[0][0] if claim.weight is not None else 0
        self._plant_states, self.dt = loop.plant_states, loop.dt
        self.deltas = (0.0, 1.0, -1.0) if self._q else (0.0,)

    def at(self, theta: np.ndarray, delta: float) -> np.ndarray:
        """Return (N, n, n) A closed by the perturbation at each theta."""
        powers = theta[:, None] ** np.arange(max(map(len, (self._A, self._B, self._C, self._D))))
        A, B, C, D = (
            np.tensordot(powers[:, : len(M)], M, 1) for M in (self._A, self._B, self._C, self._D)
        )
        if not delta:
            return np.asarray(A)
        q = self._q
        w = np.linalg.solve(np.eye(q) - delta * D[:, :q, :q], delta * C[:, :q])
        return np.asarray(A + B[:, :, :q] @ w)

    def steps(self, theta: np.ndarray, step: float, delta: float) -> np.ndarray:
        """Return (N, n, n) transition matrices of steps in which theta is held."""
        A = self.at(theta, delta)
        if self.dt:
            return A
        return _exponentials(A * step)

    def periods(self, centre: float = 0.0, delta: float = 0.0) -> np.ndarray:
        """Return periods [s] about half and one period of each mode with theta held at the centre,
        and between them.
        """
        poles = np.linalg.eigvals(self.at(np.array([centre]), delta)[0])
        if self.dt:
            poles = np.log(poles[np.abs(poles) > 1e-3] + 0j) / self.dt
        turning = poles.imag[poles.imag > 0.05 * np.abs(poles)]
        if not turning.size:
            turning = np.abs(poles)
        near = np.pi / turning[:, None] * np.concatenate([_NEAR, 2 * _NEAR])
        found = np.union1d(
            near, np.geomspace(np.pi / 2 / turning.max(), 4 * np.pi / turning.min(), _PERIODS)
        )
        if self.dt:
            return found[(found >= 2 * self.dt) & (found <= _LONGEST * self.dt)]
        return found

    def radius(self, trajectory: Trajectory) -> float:
        """Return the spectral radius over a period, with theta in the middle of each step."""
        theta, delta = trajectory.theta, trajectory.delta
        if trajectory.held:
            middle = theta
        else:
            middle = (theta + np.roll(theta, -1)) / 2
        steps = self.steps(middle, trajectory.step, delta)
        if (
            self.dt and not trajectory.held
        ):  # the plant in the middle of the sample, the controller at its start
            n = self._plant_states
            steps = np.concatenate([steps[:, :n], self.at(theta, delta)[:, n:]], axis=1)
        while len(steps) > 1:  # neighbours, later ones from the left
            if len(steps) % 2:
                odd = steps[-1:]
            else:
                odd = steps[:0]
            even = steps[: len(steps) - len(odd)]
            steps = np.concatenate([even[1::2] @ even[::2], odd])
        return _radius(steps[0])
