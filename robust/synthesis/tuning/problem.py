"""The objective of the search: poles and peaks of all limits, with their gradients."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from nlfrf._base.values import value
from robust.synthesis.tuning.closing import ClosedLoop
from robust.synthesis.tuning.loops import CloseLook, ModelledLoop, Peak
from robust.synthesis.tuning.measured_loop import MeasuredLoop
from robust.synthesis.tuning.parameters import Controller

#: Relative margin below the bound of hard limits, so that they are met in spite of rounding.
HARD_LIMIT_MARGIN = 1e-5
#: Poles that are evaluated besides the one that decides.
_N_POLES = 4
_FIXED_MODE_TOLERANCE = 1e-6  # relative distance from a fixed pole
_STABILITY_TOLERANCE = 1e-9  # real part over the largest pole, from which a fixed pole is refused


class OutOfTime(Exception):
    """The time is over, or the user stopped the search; the best so far is kept."""


@value(copy=False)
class _PoleRow:
    """Real part of a pole in s plus the required decay [rad/s], and its slope by the
    coordinates.
    """

    excess: float
    gradient: np.ndarray


@value(copy=False)
class Evaluation:
    """A design at some coordinates."""

    x: np.ndarray  # (p,) coordinates
    # largest real part of a pole plus the required decay [rad/s]; inf if a loop has no solution, or
    # an FRF has another winding number
    excess: float
    poles: list[_PoleRow]
    peaks: list[Peak]  # peaks of a stable loop

    @property
    def stable(self) -> bool:
        """Return True if every pole has the required decay."""
        return self.excess < 0

    @property
    def soft(self) -> float:
        """Return the largest level of the soft limits; zero without any."""
        return max((peak.level for peak in self.peaks if not peak.hard), default=0.0)

    @property
    def excesses(self) -> dict[tuple[int, int], Peak]:
        """Return the highest peak of each hard limit and plant."""
        found: dict[tuple[int, int], Peak] = {}
        for peak in self.peaks:
            key = (peak.limit, peak.plant)
            if peak.hard and (key not in found or peak.level > found[key].level):
                found[key] = peak
        return found

    @property
    def hard(self) -> float:
        """Return the sum of the violations of hard limits, in logarithms."""
        return sum(max(0.0, peak.level + HARD_LIMIT_MARGIN) for peak in self.excesses.values())

    def merit(self, rho: float) -> float:
        """Return the exact penalty that is minimised."""
        if self.stable:
            return self.soft + rho * self.hard
        return np.inf

    def merit_slope(self, rho: float) -> np.ndarray:
        """Return the slope of the merit, for the active pieces."""
        slope = np.zeros(self.x.size)
        soft = [peak for peak in self.peaks if not peak.hard]
        if soft:
            slope = slope + max(soft, key=lambda peak: peak.level).gradient
        for peak in self.excesses.values():
            if peak.level + HARD_LIMIT_MARGIN > 0:
                slope = slope + rho * peak.gradient
        return slope


class TuningProblem:
    """The loops of all plants with the blocks of a design, evaluated at coordinates."""

    def __init__(
        self,
        controller: Controller,
        scenes: Sequence[ModelledLoop | MeasuredLoop],
        *,
        decay: float,
        dt: float,
        deadline: float,
        progress: Callable[[int, float, float], object] | None,
    ) -> None:
        self.controller, self.scenes, self.decay, self.dt = controller, scenes, decay, dt
        self.deadline, self.progress = deadline, progress
        self.fixed_modes = [np.zeros(0, complex)] * len(scenes)
        self.n_evaluated = 0
        self.best: Evaluation | None = None

    # ---- Evaluation.

    def evaluate(
        self, x: np.ndarray, *, peaks: bool = True, pole_slopes: bool = True
    ) -> Evaluation:
        """Return poles, and peaks if every loop is stable."""
        if time.monotonic() > self.deadline:
            raise OutOfTime
        self.n_evaluated += 1
        with np.errstate(all="ignore"):  # an overflow is not finite, and is refused as such
            return self.evaluate_in_time(x, peaks=peaks, pole_slopes=pole_slopes)

    def evaluate_in_time(self, x: np.ndarray, *, peaks: bool, pole_slopes: bool) -> Evaluation:
        """Return `evaluate` until the time is over."""
        loops = self.close_loops(x)
        if loops is None:
            return Evaluation(x=x, excess=np.inf, poles=[], peaks=[])
        rows: list[tuple[float, int, int]] = []
        for k, loop in enumerate(loops):
            excesses = self.real_parts(loop.poles) + self.decay
            rows += [
                (float(excesses[place]), k, int(place))
                for place in self.movable_poles(k, loop.poles)
            ]
        rows.sort(reverse=True)
        if rows:
            excess = rows[0][0]
        else:
            excess = -np.inf
        slopes = self.at_points(self.controller.slopes, x)
        if pole_slopes:
            seen = rows[:_N_POLES]
        else:
            seen = []
        pole_rows = [
            self.pole_gradient(loops[k], place, value_, slopes[k]) for value_, k, place in seen
        ]
        if not peaks or not excess < 0:
            return Evaluation(x=x, excess=excess, poles=pole_rows, peaks=[])
        found: list[Peak] = []
        for scene, loop, slope in zip(self.scenes, loops, slopes, strict=True):
            found += scene.peaks(loop, slope)
        return Evaluation(x=x, excess=excess, poles=pole_rows, peaks=found)

    def at_points(
        self, function: Callable[[np.ndarray, float], np.ndarray], x: np.ndarray
    ) -> list[np.ndarray]:
        """Return `controller.matrix` or `slopes` for each scene, at its operating point."""
        thetas = [scene.plant.theta for scene in self.scenes]
        found = {theta: function(x, theta) for theta in set(thetas)}
        return [found[theta] for theta in thetas]

    def close_loops(self, x: np.ndarray) -> list[Any] | None:
        """Return the loop of each scene; None if one has no solution, or an unstable winding
        number.
        """
        matrices = self.at_points(self.controller.matrix, x)
        if not all(np.isfinite(M).all() for M in matrices):
            return None
        loops = [scene.close(M) for scene, M in zip(self.scenes, matrices, strict=True)]
        if any(loop is None for loop in loops):
            return None
        return loops

    def loops_at(self, x: np.ndarray) -> list[tuple[ModelledLoop | MeasuredLoop, Any]]:
        """Return every scene with its loop, at coordinates at which there is one."""
        loops = self.close_loops(x)
        assert loops is not None
        return list(zip(self.scenes, loops, strict=True))

    def real_parts(self, poles: np.ndarray) -> np.ndarray:
        """Return real parts in s of poles in the plane of the bilinear map."""
        if not self.dt:
            return poles.real
        half = poles * self.dt / 2
        with np.errstate(divide="ignore"):
            found = (np.log(np.abs(1 + half)) - np.log(np.abs(1 - half))) / self.dt
        return np.maximum(found, -1e3 / self.dt)

    def movable_poles(self, scene: int, poles: np.ndarray) -> np.ndarray:
        """Return indices of the poles that the blocks move."""
        left = np.ones(poles.size, bool)
        for mode in self.fixed_modes[scene]:
            distance = np.where(left, np.abs(poles - mode), np.inf)
            k = int(np.argmin(distance))
            if distance[k] <= _FIXED_MODE_TOLERANCE * (1 + abs(mode)):
                left[k] = False
        return np.flatnonzero(left)

    def pole_gradient(
        self, loop: ClosedLoop, place: int, excess: float, slopes: np.ndarray
    ) -> _PoleRow:
        """Return the slope of a pole: d pole = l dM r, converted to s."""
        right, left = loop.pole_sensitivity_factors(place)
        slope = slopes.reshape(len(slopes), -1) @ (right @ left).T.ravel()
        if self.dt:
            slope = slope / (1 - (loop.poles[place] * self.dt / 2) ** 2)
        return _PoleRow(excess=excess, gradient=slope.real)

    # ---- Properties for all coordinates.

    def find_fixed_modes(self, rng: np.random.Generator) -> None:
        """Find the poles of the plants that no block moves: those in common for two different
        controllers.
        """
        low, high = self.controller.lower, self.controller.upper
        tried = []
        for _ in range(2):
            x = self.controller.start + rng.uniform(-0.7, 0.7, low.size)
            tried.append(self.at_points(self.controller.matrix, np.clip(x, low, high)))
        for k, scene in enumerate(self.scenes):
            if isinstance(scene, MeasuredLoop):
                continue
            loops = [scene.close(matrices[k]) for matrices in tried]
            if len(scene.fixed.A):
                open_poles = np.linalg.eigvals(scene.fixed.A)
            else:
                open_poles = np.zeros(0, complex)
            if any(loop is None for loop in loops):
                continue
            near = np.ones(open_poles.size, bool)
            for loop in loops:
                assert loop is not None
                distance = np.abs(open_poles[:, None] - loop.poles[None]).min(
                    axis=1, initial=np.inf
                )
                near &= distance <= _FIXED_MODE_TOLERANCE / 10 * (1 + np.abs(open_poles))
            n_own = self.controller.n_states  # their rows in A are zero before the loop is closed
            if n_own:
                own = np.argsort(np.abs(open_poles), kind="stable")[:n_own]
            else:
                own = np.zeros(0, int)
            near[[place for place in own if abs(open_poles[place]) == 0]] = False
            self.fixed_modes[k] = open_poles[near]
        self.refuse_fixed_unstable()

    def refuse_fixed_unstable(self) -> None:
        """Refuse a plant or fixed part with a pole that is not stable and that no block moves."""
        for k, modes in enumerate(self.fixed_modes):
            if modes.size:
                scene = self.scenes[k]
                assert isinstance(scene, ModelledLoop)
                size = np.abs(np.linalg.eigvals(scene.fixed.A)).max(initial=0.0)
                worst = modes[int(np.argmax(modes.real))]
                if worst.real >= -_STABILITY_TOLERANCE * size * 1e-3:
                    if self.dt:
                        s = complex(
                            np.log((1 + worst * self.dt / 2) / (1 - worst * self.dt / 2)) / self.dt
                        )
                    else:
                        s = worst
                    raise ValueError(
                        "system must have no unstable pole that is independent of all blocks,"
                        f" got a pole at s = {complex(s):.4g} rad/s with {scene.plant.name}. Remove"
                        " the integrator or weight, or connect it to a block"
                    )

    def norms(self, x: np.ndarray) -> list[dict[int, tuple[float, float, bool]]]:
        """Return for each plant the largest level of each limit, its frequency, and True if no
        frequency has more.
        """
        return [scene.raise_norms(loop) for scene, loop in self.loops_at(x)]

    @property
    def has_scalings(self) -> bool:
        """Return True if a worst case is a bound by scalings, which are fitted between the rounds
        of the search.
        """
        return any(channel.is_scaled for scene in self.scenes for channel in scene.channels)

    def refit_scalings(self, x: np.ndarray) -> None:
        """Fit the scalings of the worst cases to the design at x."""
        for scene, loop in self.loops_at(x):
            scene.refit_scalings(loop)

    def look_closely(self, x: np.ndarray) -> list[dict[int, CloseLook]]:
        """Return for each plant the final value of every limit."""
        return [scene.look_closely(loop) for scene, loop in self.loops_at(x)]

    def report(self, evaluation: Evaluation) -> None:
        """Keep the best design, and report the progress of the search."""
        if evaluation.stable and (self.best is None or is_better(evaluation, self.best)):
            self.best = evaluation
        if self.progress is not None:
            if self.best is None:
                best = np.inf
            else:
                best = worst_ratio(self.best)
            self.progress(self.n_evaluated, best, max(0.0, self.deadline - time.monotonic()))


def worst_ratio(evaluation: Evaluation) -> float:
    """Return the ratio for display: that of the worst hard limit while one is missed, otherwise of
    the soft ones.
    """
    hard = max((peak.level for peak in evaluation.excesses.values()), default=-np.inf)
    has_soft = any(not peak.hard for peak in evaluation.peaks)
    return float(np.exp(hard if hard > 0 or not has_soft else evaluation.soft))


def is_better(one: Evaluation, other: Evaluation) -> bool:
    """Return True if a design is better: hard limits first; a violation within the margin counts as
    met.
    """
    first, second = (0.0 if e.hard < 2 * HARD_LIMIT_MARGIN else e.hard for e in (one, other))
    return (first, one.soft) < (second, other.soft)
