"""`tune`: join fixed parts, plants, blocks and limits, search from several starts, and evaluate the
result.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from nlfrf._base.arguments import (
    format_hertz,
    random_generator,
    require_integer,
    require_kind,
    require_nonnegative,
    require_positive,
    short_form,
)
from robust.synthesis.blocks import TunableBlock, require_blocks
from robust.synthesis.tuning.design import Ended, TunedDesign
from robust.synthesis.tuning.friction import FrictionLimit
from robust.synthesis.tuning.limits import Channel, Limit, require_limits
from robust.synthesis.tuning.loops import true_frequency
from robust.synthesis.tuning.measured_loop import MeasuredLoop
from robust.synthesis.tuning.minimax import find_stable, minimise_from
from robust.synthesis.tuning.parameters import Controller, controller_of_blocks
from robust.synthesis.tuning.plants import Plants, stated_sampling_time
from robust.synthesis.tuning.problem import (
    Evaluation,
    OutOfTime,
    TuningProblem,
    is_better,
    worst_ratio,
)
from robust.synthesis.tuning.result import make_design
from robust.synthesis.tuning.scenes import Limits, fixed_parts, limit_name, make_loops

_ZERO_GAIN = 1e-13
_UNMOVED_TOLERANCE = 1e-9


def tune(
    system: Sequence[object],
    plant: Plants,
    blocks: Mapping[str, TunableBlock],
    *,
    hard: Sequence[Limit | FrictionLimit] = (),
    soft: Sequence[Limit] = (),
    decay: float = 0.0,
    dt: float = 0.0,
    delay: float = 0.0,
    n_starts: int = 3,
    time_cap: float = 60.0,
    rng: np.random.Generator | int | None = None,
    progress: Callable[[int, float, float], object] | None = None,
) -> TunedDesign:
    """Tune controller blocks of fixed structure in one or several loops, for several plants at
    once.

    Use this for several loops at once, for limits between any two signals, or for a structure that
    `design_frf` does not offer.

    Each limit compares a norm with a bound. `tune` minimises the largest ratio of norm to bound
    over the soft limits, while every hard limit is met. The search is local and proves nothing, so
    give the resulting controller to `check`.

    Parameters
    ----------
    system : list of control systems
        All fixed parts, with named inputs and outputs (`control.summing_junction`, filters,
        weights). Each input is the sum of all outputs with the same name, as in `interconnection`.
    plant : Plants
        One plant, or several, each of which has to meet every limit. With dt, hold and delay are
        added to continuous plants.
    blocks : dict of str to block
        `robust.tuning.Pid`, `Gain`, `Notch`, `Lead`, `Lag`, `LowPass`, `Biquad` or `StateSpace`, by
        name. Their numbers are the first start. For dt > 0 each block is its bilinear image.
    hard, soft : list of Limit
        Limits that must be met, such as a `FrictionLimit`, and limits whose ratio is minimised.
    decay : float
        Least decay rate [rad/s] of every pole that depends on a block; zero: stability only.
    dt : float
        Sampling time of blocks and system [s]; 0 for continuous ones, or that of a sampled plant.
    delay : float
        Computation delay [s] at the plant inputs; in continuous time by Padé, of order 8.
    n_starts : int
        Number of starts: the given blocks, and random ones. Local optima are common: three or more.
    time_cap : float
        Time for all starts together [s].
    rng : numpy Generator or int, optional
        For the random starts.
    progress : callable, optional
        Function that is called with (loops evaluated, best ratio so far, seconds left).

    Returns
    -------
    TunedDesign
        The best design found, also after an interrupt or at the end of the time.

    Raises
    ------
    ValueError
        Parts that do not fit each other; no free parameter; a limit on a transfer function that is
        zero, or that no choice of the blocks can meet; an unstable part that no block can
        stabilise; a plant given as an FRF that the first start does not stabilise.

    References
    ----------
    Apkarian & Noll, *Nonsmooth H-infinity synthesis*, IEEE Trans. Automatic Control 51 (2006);
    Burke, Henrion, Lewis & Overton, *HIFOO*, IFAC ROCOND 2006; Curtis, Mitchell & Overton, *A
    BFGS-SQP method for nonsmooth, nonconvex, constrained optimization*, Optimization Methods and
    Software 32 (2017).

    Examples
    --------
    A position loop with P and a velocity loop with PI on a mass, tuned together. The aim is a small
    response to a force d, with |S| below 1.6 at the actuator.

    >>> import control
    >>> import robust
    >>> mass = control.ss([[0, 1], [0, 0]], [[0], [1]], np.eye(2), np.zeros((2, 1)))
    >>> system = [
    ...     control.summing_junction(["r", "-x"], "e_x"),
    ...     control.summing_junction(["v_ref", "-v"], "e_v"),
    ...     control.summing_junction(["u", "d"], "force"),
    ... ]
    >>> design = robust.tune(
    ...     system,
    ...     robust.tuning.Plants(mass, inputs="force", outputs=["x", "v"]),
    ...     {
    ...         "K_x": robust.tuning.Pid(kp=1.0, reads="e_x", drives="v_ref"),
    ...         "K_v": robust.tuning.Pid(kp=2.0, ki=1.0, reads="e_v", drives="u"),
    ...     },
    ...     hard=[robust.tuning.Limit("d", "force", 1.6), robust.tuning.Limit("d", "u", 1.8)],
    ...     soft=[robust.tuning.Limit("d", "x", 1.0)],
    ...     delay=0.01,
    ...     rng=1)
    >>> design.met
    True
    """
    require_kind("plant", plant, Plants)
    blocks = require_blocks(blocks)
    limits = _checked_limits(hard, soft)
    decay, delay = require_nonnegative("decay", decay), require_nonnegative("delay", delay)
    dt = require_nonnegative("dt", dt) or stated_sampling_time(plant.models)
    n_starts = require_integer("n_starts", n_starts, least=1)
    time_cap = require_positive("time_cap", time_cap)
    rng = random_generator("rng", rng)
    if progress is not None and not callable(progress):
        raise ValueError(f"progress must be callable, got {short_form(progress)}")
    parts = fixed_parts(system, dt)
    controller = controller_of_blocks(blocks, dt)
    _require_points(plant, controller, limits)
    scenes = make_loops(parts, plant, controller=controller, limits=limits, dt=dt, delay=delay)
    began = time.monotonic()
    problem = TuningProblem(
        controller, scenes, decay=decay, dt=dt, deadline=began + time_cap, progress=progress
    )
    problem.find_fixed_modes(np.random.default_rng(0))
    _require_paths(problem, limits)
    found, spread, ended = _search(problem, n_starts, began + time_cap, rng)
    problem.deadline = np.inf
    return make_design(
        problem,
        found,
        spread=spread,
        ended=ended,
        limits=limits,
        parts=parts,
        plants=plant,
        dt=dt,
        delay=delay,
    )


def _checked_limits(hard: Sequence[Limit | FrictionLimit], soft: Sequence[Limit]) -> Limits:
    """Return the limits, hard ones first; refuse none."""
    limits: Limits = [
        (limit, True) for limit in require_limits("hard", hard, (Limit, FrictionLimit))
    ]
    limits += [(limit, False) for limit in require_limits("soft", soft, (Limit,))]
    if not limits:
        raise ValueError("soft or hard must hold a limit, got none: the design has no demand")
    return limits


def _require_points(plant: Plants, controller: Controller, limits: Limits) -> None:
    """Refuse scheduled numbers for plants without operating points, or with too few."""
    for name, degree in controller.scheduled.items():
        if plant.at is None or degree > len(plant.at) - 1:
            if plant.at is None:
                count = "no"
            else:
                count = f"{len(plant.at)}"
            raise ValueError(
                f"plant must have at least {degree + 1} operating points for {name} of degree"
                f" {degree}, got {count}: Plants(models, ..., at=points), or an LpvModel"
            )
    if controller.scheduled and any(isinstance(limit, FrictionLimit) for limit, _ in limits):
        raise ValueError(
            "hard must hold no friction limit for scheduled blocks, because friction is proved for"
            " one fixed controller, got a friction limit"
        )


def _require_paths(problem: TuningProblem, limits: Limits) -> None:
    """Refuse a limit on a channel that is zero for all numbers of the blocks, and a bound without a
    value somewhere.
    """
    controller = problem.controller
    rng = np.random.default_rng(1)
    tried = [
        problem.at_points(
            controller.matrix,
            np.clip(
                controller.start + rng.uniform(-0.5, 0.5, controller.start.size),
                controller.lower,
                controller.upper,
            ),
        )
        for _ in range(2)
    ]
    for k, scene in enumerate(problem.scenes):
        responses = []
        for M in (matrices[k] for matrices in tried):
            if isinstance(scene, MeasuredLoop):
                responses.append(scene.responses(M))
            else:
                loop = scene.close(M)
                if loop is None or not loop.poles.size:
                    omega = np.array([0.37, 1.9, 11.0])
                else:
                    omega = (
                        np.geomspace(0.1, 10, 5)[:, None] * np.maximum(np.abs(loop.poles), 1e-6)
                    ).ravel()
                responses.append(None if loop is None else loop.responses_by_elimination(omega))
        for channel in scene.channels:
            size = [
                np.abs(H[:, channel.rows[:, None], channel.columns]).max()
                for H in responses
                if H is not None
            ]
            if size and max(size) <= _ZERO_GAIN:
                raise ValueError(
                    f"{limit_name(channel.index, limits)} must be a limit on a transfer"
                    f" function that is not zero, got {channel.limit}, which is zero for all"
                    " blocks"
                )
            channel.limit.factor(np.array([1e-3, 1.0, 1e3]))
            if (
                isinstance(scene, MeasuredLoop)
                and isinstance(channel, Channel)
                and not any(scene.band(channel) & scene.plant.on_lines)
            ):
                raise ValueError(
                    f"{limit_name(channel.index, limits)} must have lines of {scene.plant.name}"
                    " in its band, got none from"
                    f" {' to '.join(f'{edge:g}' for edge in channel.limit.band or ())} rad/s"
                )


# ---- The search from several starts.


def _search(
    problem: TuningProblem, n_starts: int, deadline: float, rng: np.random.Generator
) -> tuple[Evaluation | None, list[float], Ended]:
    """Return the best of several starts, the result of each, and the reason of the end."""
    best: Evaluation | None = None
    last: Evaluation | None = None
    spread: list[float] = []
    ended = Ended.CONVERGED
    for k in range(n_starts):
        left = deadline - time.monotonic()
        if left <= 0:
            ended = Ended.OUT_OF_TIME
            break
        problem.deadline = time.monotonic() + left / (n_starts - k)
        problem.best = None
        try:
            x = _starting_point(problem, k, rng)
            if x is None:
                spread.append(np.inf)
                continue
            current = find_stable(problem, x)
            if last is None or current.excess < last.excess:
                last = current
            if not current.stable:
                spread.append(np.inf)
                continue
            current = problem.evaluate(current.x)
            problem.report(current)
            if best is None:
                _require_movable_limits(problem, current)
            found = minimise_from(problem, current)
        except (OutOfTime, KeyboardInterrupt) as stop:
            ended = Ended.INTERRUPTED if isinstance(stop, KeyboardInterrupt) else Ended.OUT_OF_TIME
            if problem.best is None:
                spread.append(np.inf)
                if ended is Ended.INTERRUPTED:
                    break
                continue
            found = problem.best
        spread.append(worst_ratio(found))
        if best is None or is_better(found, best):
            best = found
        if ended is Ended.INTERRUPTED:
            break
    return best if best is not None else last, spread, ended


def _starting_point(problem: TuningProblem, k: int, rng: np.random.Generator) -> np.ndarray | None:
    """Return coordinates of a start: the user's, then random ones; for an FRF one that stabilises
    it, or None.
    """
    controller = problem.controller
    measured = [scene for scene in problem.scenes if isinstance(scene, MeasuredLoop)]
    if k == 0:
        for scene in measured:
            start = controller.matrix(controller.start, scene.plant.theta)
            stable, clear = scene.stability_by_winding(start)
            if not clear:
                raise ValueError(
                    "plant must have lines so close that the winding number of its loop can be"
                    f" counted, got an FRF ({scene.plant.name}) with lines that are too far"
                    " apart for the start of the blocks. Measure with more lines around the"
                    " modes or at lower frequency, fit a model, or start with smaller gains"
                )
            if not stable:
                raise ValueError(
                    "blocks must start with gains that stabilise every plant that is an FRF,"
                    f" got a start that does not stabilise {scene.plant.name}. Design the start"
                    " with design_frf, or start with smaller gains"
                )
        return controller.start
    signs = np.array([parameter.sign for _, parameter in controller.parameters])
    for width in (1.0, 0.5, 0.25, 0.1):
        for _ in range(8 if measured else 1):
            step = rng.normal(size=signs.size) * np.where(signs != 0, 1.2, 1.0) * width
            x = np.clip(controller.start + step, controller.lower, controller.upper)
            matrices = [controller.matrix(x, scene.plant.theta) for scene in measured]
            if all(
                all(scene.stability_by_winding(M))
                for scene, M in zip(measured, matrices, strict=True)
            ):
                return np.asarray(x)
    return None


def _require_movable_limits(problem: TuningProblem, current: Evaluation) -> None:
    """Refuse hard limits that are missed and that no block changes."""
    for peak in current.excesses.values():
        if peak.level > 1e-6 and float(np.abs(peak.gradient).max()) < _UNMOVED_TOLERANCE:
            limit = next(
                c.limit for c in problem.scenes[peak.plant].channels if c.index == peak.limit
            )
            elsewhere = np.clip(current.x + 0.1, problem.controller.lower, problem.controller.upper)
            other = problem.evaluate(elsewhere)
            again = other.excesses.get((peak.limit, peak.plant))
            if again is None or abs(again.level - peak.level) < 1e-9:
                where = format_hertz(float(true_frequency(np.array([peak.omega]), problem.dt)[0]))
                raise ValueError(
                    f"hard[{peak.limit}] must be a limit that the blocks can change, got {limit},"
                    f" which is missed by a factor {np.exp(peak.level):.4g} at {where} for all"
                    " blocks. Raise its bound there, or give it a band"
                )
