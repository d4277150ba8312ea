"""The result of a tuning: everything evaluated again, more densely."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import control
import numpy as np

from nlfrf._base.arguments import join_names
from robust.analysis.worst_plant import worst_case
from robust.lti.lti import to_s_plane
from robust.lti.norms import discrete_matrices
from robust.lti.stability import assess_stability, poles_with_rounding
from robust.models.sets.model import UncertaintyModel
from robust.synthesis.pid import Pid
from robust.synthesis.tuning.closing import ClosedLoop
from robust.synthesis.tuning.design import Ended, LimitValue, TunedDesign
from robust.synthesis.tuning.limits import Limit
from robust.synthesis.tuning.loops import true_frequency
from robust.synthesis.tuning.parameters import Controller
from robust.synthesis.tuning.plants import Plants
from robust.synthesis.tuning.problem import Evaluation, TuningProblem
from robust.synthesis.tuning.scenes import Limits


def make_design(
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
                    plant_name=problem.scenes[k].plant.name,
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
        found += [] if stable else [f"{design.plant.describe(k)}: {why}"]
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
