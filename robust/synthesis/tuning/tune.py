"""`tune`: join fixed parts, plants, blocks and limits, search from several starts, and evaluate the
result.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import control
import numpy as np

from nlfrf._base.arguments import (
    format_hertz,
    join_names,
    random_generator,
    require_integer,
    require_kind,
    require_nonnegative,
    require_positive,
    short_form,
)
from robust.analysis.worst_plant import worst_case
from robust.lti.lti import require_sampling_time, to_s_plane, with_names
from robust.lti.norms import discrete_matrices
from robust.lti.realisation import multivariable
from robust.lti.stability import assess_stability, poles_with_rounding
from robust.lti.wiring import Port, join_by_name
from robust.models.sets.model import UncertaintyModel
from robust.synthesis.blocks import TunableBlock, require_blocks
from robust.synthesis.pid import Pid
from robust.synthesis.tuning.closing import ClosedLoop, state_plant
from robust.synthesis.tuning.design import Ended, LimitValue, TunedDesign
from robust.synthesis.tuning.friction import FrictionChannel, FrictionLimit
from robust.synthesis.tuning.limits import Channel, Limit, require_limits
from robust.synthesis.tuning.loops import MeasuredLoop, ModelledLoop, true_frequency
from robust.synthesis.tuning.minimax import find_stable, minimise_from
from robust.synthesis.tuning.parameters import Controller, controller_of_blocks
from robust.synthesis.tuning.plants import (
    MeasuredPlant,
    ModelledPlant,
    Plants,
    see_machine,
    see_plants,
    stated_sampling_time,
)
from robust.synthesis.tuning.problem import (
    Evaluation,
    OutOfTime,
    TuningProblem,
    is_better,
    worst_ratio,
)

#: Signals of the perturbation, with names that no user takes.
_AT_INPUT = "perturbation at plant input "
_AT_OUTPUT = "perturbation at plant output "
_PLANT_INPUT = "plant input "
_ZERO_GAIN = 1e-13
#: Limits with True for hard ones, hard ones first.
Limits = list[tuple[Limit | FrictionLimit, bool]]
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
        One plant, or several plants, each of which has to meet every limit. If dt is given, hold
        and delay are added to continuous plants.
    blocks : dict of str to block
        `robust.tuning.Pid`, `Gain`, `Notch`, `Lead`, `Lag`, `LowPass`, `Biquad` or `StateSpace`, by
        name. Their numbers are the first start. For dt > 0 each block is discretised by the Tustin
        method. A number that is named in `scheduled` is a polynomial of the operating point of the
        plants.
    hard, soft : list of Limit
        Limits that must be met, and limits whose largest ratio is minimised. A `FrictionLimit` is a
        hard limit.
    decay : float
        Least decay rate [rad/s] of every pole that depends on a block; zero requires stability
        only.
    dt : float
        Sampling time of blocks and system [s]; 0 for continuous ones, or that of a sampled plant.
    delay : float
        Computation delay [s] at the plant inputs. In continuous time it is a Padé approximation of
        order 8.
    n_starts : int
        Number of starts: the given blocks, and random blocks around them. Local optima are common,
        so use three or more.
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
    limits: Limits = [
        (limit, True) for limit in require_limits("hard", hard, (Limit, FrictionLimit))
    ]
    limits += [(limit, False) for limit in require_limits("soft", soft, (Limit,))]
    if not limits:
        raise ValueError("soft or hard must hold a limit, got none: the design has no demand")
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
    return _make_design(
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


def fixed_parts(system: object, dt: float) -> list[control.StateSpace]:
    """Return all fixed parts on the time base of the design; refuse others."""
    if isinstance(system, control.StateSpace | control.TransferFunction):
        system = [system]
    if not isinstance(system, list | tuple):
        raise ValueError(f"system must hold control systems, as a list, got {short_form(system)}")
    parts = []
    for k, part in enumerate(system):
        part = multivariable(f"system[{k}]", part)
        require_sampling_time(f"system[{k}]", part, reference="the design", wanted=dt)
        on_clock = control.StateSpace(
            part.A, part.B, part.C, part.D, dt, remove_useless_states=False
        )
        parts.append(with_names(on_clock, part.input_labels, part.output_labels))
    return parts


def make_loops(
    parts: list[control.StateSpace],
    plants: Plants,
    *,
    controller: Controller,
    limits: Limits,
    dt: float,
    delay: float,
) -> list[ModelledLoop | MeasuredLoop]:
    """Return the loop around each plant with its limits."""
    gains = [limit for limit, _ in limits if isinstance(limit, Limit)]
    worst = any(limit.worst for limit in gains)
    external = list(dict.fromkeys(label for limit in gains for label in limit.inputs))
    looked_at = list(dict.fromkeys(label for limit in gains for label in limit.outputs))
    ports = [
        Port(reads=tuple(block.reads), drives=tuple(block.drives))
        for block in controller.blocks.values()
    ]
    sizes = (controller.n_states, controller.n_in, controller.n_out)
    n_u, n_y = len(plants.inputs), len(plants.outputs)
    scenes: list[ModelledLoop | MeasuredLoop] = []
    for k, seen in enumerate(see_plants(plants, dt, delay=delay, worst=worst)):
        if isinstance(seen, ModelledPlant):
            G = _with_perturbation(seen.system, plants, dt)
            if worst:
                into, out = _perturbation_names(n_u, n_y)
            else:
                into, out = [], []
            joined = join_by_name(
                [*parts, G], ports, external=external + into, looked_at=looked_at + out
            )
            fixed = state_plant(joined, *sizes, dt)
            channels = _channels_of(
                limits, external, looked_at=looked_at, plant=seen, sizes=(n_u, n_y)
            )
            scenes.append(ModelledLoop(k, fixed, seen, channels, dt))
        else:
            port = Port(reads=tuple(plants.inputs), drives=tuple(plants.outputs))
            joined = join_by_name(parts, [port, *ports], external=external, looked_at=looked_at)
            channels = _channels_of(
                limits, external, looked_at=looked_at, plant=seen, sizes=(n_u, n_y)
            )
            scenes.append(
                MeasuredLoop(
                    k,
                    joined,
                    seen,
                    channels,
                    dt=dt,
                    n_external=len(external),
                    n_looked_at=len(looked_at),
                    sizes=sizes,
                )
            )
    for index, (limit, _) in enumerate(limits):
        if not isinstance(limit, FrictionLimit):
            continue
        for machine in limit.machines:
            seen = see_machine(machine, plants, dt=dt, delay=delay)
            G = _with_perturbation(seen.system, plants, dt)
            into, _ = _perturbation_names(1, 1)
            joined = join_by_name(
                [*parts, G],
                ports,
                external=external + into,
                looked_at=looked_at + list(plants.outputs),
            )
            channel = FrictionChannel(
                limit=limit,
                index=index,
                machine=machine,
                place=(len(looked_at), len(external) + 1),
                dt=dt,
                delay=delay + machine.delay,
                plant=seen.system,
            )
            fixed = state_plant(joined, *sizes, dt)
            scenes.append(ModelledLoop(len(scenes), fixed, seen, [channel], dt))
    return scenes


def _perturbation_names(n_u: int, n_y: int) -> tuple[list[str], list[str]]:
    """Return the signals that a perturbation drives, and those that it reads."""
    into = [f"{_AT_INPUT}{i}" for i in range(n_u)] + [f"{_AT_OUTPUT}{j}" for j in range(n_y)]
    return into, [f"{_PLANT_INPUT}{i}" for i in range(n_u)]


def _with_perturbation(G: control.StateSpace, plants: Plants, dt: float) -> control.StateSpace:
    """Return the plant with disturbances at inputs and outputs, and its input as an output, for a
    perturbation.
    """
    n_u, n_y = G.ninputs, G.noutputs
    into, out = _perturbation_names(n_u, n_y)
    one, zero = np.eye(n_u), np.zeros((n_u, n_y))
    return control.StateSpace(
        G.A,
        np.hstack([G.B, G.B, np.zeros((G.nstates, n_y))]),
        np.vstack([G.C, np.zeros((n_u, G.nstates))]),
        np.block([[G.D, G.D, np.eye(n_y)], [one, one, zero]]),
        dt,
        inputs=[*plants.inputs, *into],
        outputs=[*plants.outputs, *out],
        remove_useless_states=False,
    )


def _channels_of(
    limits: Limits,
    external: list[str],
    *,
    looked_at: list[str],
    plant: ModelledPlant | MeasuredPlant,
    sizes: tuple[int, int],
) -> list[Channel]:
    """Return the rows and columns of the loop for each limit, for a plant with n_u inputs and n_y
    outputs.
    """
    perturbation = len(looked_at) + np.arange(sizes[0]), len(external) + np.arange(sum(sizes))
    return [
        Channel(
            limit=limit,
            index=k,
            hard=is_hard,
            rows=np.array([looked_at.index(label) for label in limit.outputs]),
            columns=np.array([external.index(label) for label in limit.inputs]),
            perturbation=perturbation if limit.worst else None,
            blocks=plant.blocks,
        )
        for k, (limit, is_hard) in enumerate(limits)
        if isinstance(limit, Limit)
    ]


def _limit_name(k: int, limits: Limits) -> str:
    n_hard = sum(is_hard for _, is_hard in limits)
    if k < n_hard:
        return f"hard[{k}]"
    return f"soft[{k - n_hard}]"


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
                    f"{_limit_name(channel.index, limits)} must be a limit on a transfer"
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
                    f"{_limit_name(channel.index, limits)} must have lines of plant {scene.index}"
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
                    f" counted, got an FRF (plant {scene.index}) with lines that are too far"
                    " apart for the start of the blocks. Measure with more lines around the"
                    " modes or at lower frequency, fit a model, or start with smaller gains"
                )
            if not stable:
                raise ValueError(
                    "blocks must start with gains that stabilise every plant that is an FRF,"
                    f" got a start that does not stabilise plant {scene.index}. Design the start"
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


# ---- The result: everything evaluated again, more densely.


def _make_design(
    problem: TuningProblem,
    found: Evaluation | None,
    *,
    spread: list[float],
    ended: Ended,
    limits: Limits,
    parts: list[control.StateSpace],
    plants: Plants,
    dt: float,
    delay: float,
) -> TunedDesign:
    """Return the result, with every number computed again from the design itself."""
    x = problem.controller.start if found is None else found.x
    values = []
    for k, by_limit in enumerate(
        problem.look_closely(x) if found is not None and found.stable else []
    ):
        for index, look in by_limit.items():
            limit, is_hard = limits[index]
            omega = float(true_frequency(np.array([look.omega]), dt)[0])
            values.append(
                LimitValue(
                    limit=limit,
                    hard=is_hard,
                    plant=k,
                    ratio=look.ratio,
                    omega=omega,
                    n_lines=look.n_lines,
                    **_limit_curves(problem, k, limit=index, x=x),
                )
            )
    values.sort(key=lambda one: (not one.hard, -one.ratio))
    if found is None:
        excess = np.inf
    else:
        excess = found.excess - problem.decay
    stable = bool(values) and _is_surely_stable(problem, x)
    found_design = TunedDesign(
        blocks=problem.controller.blocks_at(x),
        met=bool(values) and stable and all(one.met for one in values if one.hard),
        stable=stable,
        limits=tuple(values),
        excess=float(excess),
        ended=ended,
        spread=tuple(spread),
        at_bounds=tuple(_parameters_at_bounds(problem.controller, x)),
        not_asked=tuple(_describe_unlimited(problem.controller, limits, plants)),
        n_evaluated=problem.n_evaluated,
        system=tuple(parts),
        plant=plants,
        dt=dt,
        delay=delay,
    )
    worst = any(isinstance(limit, Limit) and limit.worst for limit, _ in limits)
    if worst and found_design.met:
        broken = _find_broken_sets(found_design)
    else:
        broken = ()
    return replace(found_design, met=found_design.met and not broken, broken_sets=broken)


def _find_broken_sets(design: TunedDesign) -> tuple[str, ...]:
    """Describe the plants whose set is not stable with the whole controller, by `worst_case`."""
    found = []
    for k, model in enumerate(design.plant.models):
        K = design.controller_at(design.plant.outputs, design.plant.inputs, design.plant.thetas[k])
        if not isinstance(model, UncertaintyModel) or model.measured_only:
            continue
        try:
            stable = worst_case(model, K, delay=design.delay).stable
            why = "a plant of its set makes the loop unstable"
        except (
            ValueError
        ) as error:  # the nominal loop is not distinguishable from one on the boundary
            stable, why = False, str(error)
        found += [] if stable else [f"plant {k}: {why}"]
    return tuple(found)


def _limit_curves(
    problem: TuningProblem, plant: int, *, limit: int, x: np.ndarray
) -> dict[str, np.ndarray]:
    """Return the ratio of a limit over frequency, for the design and for the given blocks."""
    scene: Any = problem.scenes[plant]
    channel = next(channel for channel in scene.channels if channel.index == limit)
    theta, start = scene.plant.theta, problem.controller.start
    loop = scene.close(problem.controller.matrix(x, theta))
    omega = scene.frequencies(channel, loop)
    before = np.full(omega.size, np.nan)
    if problem.evaluate(start, peaks=False, pole_slopes=False).stable:
        before = scene.curve(channel, scene.close(problem.controller.matrix(start, theta)), omega)
    return {
        "omegas": true_frequency(omega, problem.dt),
        "curve": scene.curve(channel, loop, omega),
        "before": before,
    }


def _is_surely_stable(problem: TuningProblem, x: np.ndarray) -> bool:
    """Return True if the loop of every plant is stable beyond rounding, on its own time base."""
    of_blocks = problem.at_points(problem.controller.matrix, x)
    for scene, M in zip(problem.scenes, of_blocks, strict=True):
        loop = scene.close(M)
        if loop is None:
            return False
        if not isinstance(loop, ClosedLoop):  # on lines: by its winding number
            continue
        matrices = discrete_matrices(
            loop.matrices, problem.dt
        )  # back from the plane of the bilinear map
        closed = control.StateSpace(*matrices, problem.dt, remove_useless_states=False)
        if not assess_stability(closed).stable:
            return False
        if problem.decay and not _has_decay(closed, problem, scene.index):
            return False
    return True


def _has_decay(closed: control.StateSpace, problem: TuningProblem, scene: int) -> bool:
    """Return True if every pole that a block moves has the required decay."""
    poles, _ = poles_with_rounding(closed)
    real, image = to_s_plane(poles, problem.dt).real, poles
    if problem.dt:
        image = 2 / problem.dt * (poles - 1) / np.where(poles == -1, 1e-12, poles + 1)
    moved = problem.movable_poles(scene, image)
    return bool(np.all(real[moved] <= -problem.decay * (1 - 1e-6)))


def _parameters_at_bounds(controller: Controller, x: np.ndarray) -> list[str]:
    width = controller.upper - controller.lower
    near = np.minimum(x - controller.lower, controller.upper - x) < 1e-4 * width
    return [label for label, at in zip(controller.labels, near, strict=True) if at]


def _describe_unlimited(controller: Controller, limits: Limits, plants: Plants) -> list[str]:
    """Describe the properties that no limit protects."""
    found = []
    integral = [
        name
        for name, block in controller.blocks.items()
        if isinstance(block, Pid) and block.ki is not None
    ]
    free = [name for name in integral if "ki" not in controller.blocks[name].fixed]
    gains = [limit for limit, _ in limits if isinstance(limit, Limit)]
    shaped = any(
        (limit.band is not None and np.isfinite(limit.band[1])) or not limit.is_constant
        for limit in gains
    )
    if free and not shaped:
        found.append(
            f"low frequencies, where {join_names(free)} {'has' if len(free) == 1 else 'have'} an"
            " integrator: give a limit a band or a weight there"
        )
    if any(isinstance(model, UncertaintyModel) for model in plants.models) and not any(
        limit.worst for limit in gains
    ):
        found.append("the sets around the plants: give a limit worst=True")
    if not any(not is_hard for _, is_hard in limits):
        found.append("more than the hard limits: whatever meets them is taken")
    return found
