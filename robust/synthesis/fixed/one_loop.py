"""A fixed-order controller for one loop, by convex programming: its demands and its result."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NoReturn, TypeAlias

import control
import numpy as np
from scipy.optimize import minimize_scalar

from nlfrf._base.arguments import (
    as_list,
    format_hertz,
    require_choice,
    require_integer,
    require_nonnegative,
    require_positive,
    require_real,
    short_form,
)
from robust._base.states import Stability
from robust._base.types import Controller
from robust._base.warnings import DesignWarning
from robust.analysis.classical import classical_margins
from robust.friction.classes.maxwell_slip import MaxwellSlip
from robust.friction.plant import FrictionPlant
from robust.friction.proof.prove import prove_friction
from robust.friction.reading.assumed_class import MachineWithFriction, machines_of
from robust.lti.grids import peak_of
from robust.lti.low_frequency import read_below
from robust.lti.lti import is_constant, one_sampling_time, require_sampling_time, response
from robust.lti.realisation import state_space
from robust.lti.stability import LARGEST_JUMP, unstable_poles
from robust.models.sets.measured import source_of
from robust.synthesis.fixed.cone_program import Demand
from robust.synthesis.fixed.convex_concave import DesignTask, is_lower, iterate, linear_rows
from robust.synthesis.fixed.demands import end_row, limit_rows, objective_row, weight_rows
from robust.synthesis.fixed.plants import (
    DesignPlant,
    KnownPlant,
    PlantOnLines,
    along_arcs,
    plant_on_lines,
    stacked_plants,
)
from robust.synthesis.fixed.starts import (
    describe_open_reading,
    find_start,
    loops_stable,
    start_from_controller,
)
from robust.synthesis.fixed.structures import (
    FASTEST,
    FASTEST_SAMPLED,
    PID_PARTS,
    Basis,
    ControllerStructure,
    structure_of,
)
from robust.synthesis.hinf.design import Design, DesignedLoop

#: Repetitions of a design on lines of the loop found, the degradation there that causes one, and
#: the largest violation of a demand with which it continues from its result.
_LOOKS, _LOOKED, _NEARLY = 3, 1e-3, 1.1
#: Starts that are refined if the controller has to be proved for friction: of 15 in example 19 five
#: were proved, at a lowered gain, and none of those with the most integral gain.
_PROVED_STARTS = 6
_N_FILTER_TIMES = 6  # time constants of a derivative filter that are tried for positive gains
_N_REFINED = 8  # more of them, around the best
#: Accepted violation of a demand, recomputed on those lines.
_LIMIT_TOLERANCE = 1e-3
_CROSSOVER_TOLERANCE = 0.98  # share of the requested crossover: it is read between two lines
#: Gains of a controller that are tried for a proof, in turn, and the final ratio of the bisection
#: from there.
_PROOF_GAINS, _PROOF_GAIN_RATIO = tuple(0.5**n for n in range(10)), 1.03

#: Subject of a proof: a class of friction with its machines, or one machine and a class.
Proved: TypeAlias = MachineWithFriction | tuple[FrictionPlant, MaxwellSlip]


#: Arguments of `design_frf` for one loop, by name.
LoopOptions: TypeAlias = dict[str, Any]


def design_loop(
    plant: DesignPlant | Sequence[DesignPlant],
    structure: str | int | ControllerStructure,
    options: LoopOptions,
) -> Design:
    """Return `design_frf` for a plant with one input and output."""
    aim = require_choice("aim", options["aim"], ("auto", "gamma", "gain"))
    dt = require_nonnegative("dt", options["dt"])
    delay = require_nonnegative("delay", options["delay"])
    n_unstable = require_integer("n_unstable", options["n_unstable"], least=0)
    n_iterations = require_integer("n_iterations", options["n_iterations"], least=0)
    integrators = require_integer("integrators", options["integrators"], least=0)
    shape = structure_of(structure, integrators, options["filter_time"])
    options = {**options, "resonates": not shape.free and bool(np.iscomplex(shape.poles).any())}
    plants = [source_of("plant", one) for one in as_list(plant)]
    if not plants:
        raise ValueError("plant must be a plant or a list of them, got an empty list")
    dt = one_sampling_time([dt, *(one.dt for one in plants)])
    _warn_of_ringing(options["filter_time"], dt)
    named = [
        *_per_demand_list("omega_c", options["omega_c"]),
        *_per_demand_list("gain", options["gain"])[:1],
    ]
    wanted = tuple(require_real("omega_c", w) for w in named)
    sizes = (
        options["w_P"],
        options["w_T"],
        options["w_u"],
        options["M_S"],
        options["M_T"],
        options["M_u"],
    )
    end_gain = require_positive("end_gain", options["end_gain"])
    positive_gains = options["positive"]
    known = _what_is_known(options, n_unstable)
    look = partial(plant_on_lines, dt=dt, delay=delay, extra=wanted, weights=sizes, known=known)
    family = [look(p) for p in plants]
    basis = _structure_basis(shape, stacked_plants(family), dt=dt, fixed=options["fixed"])
    if positive_gains and shape.name not in PID_PARTS:
        raise ValueError(
            f"positive must be used with {', '.join(PID_PARTS)}, got it with {shape.name!r}"
        )
    if positive_gains and shape.free:
        return _best_filter(plant, structure, basis=basis, options=options)

    def closer(K: list[control.StateSpace]) -> DesignTask:
        """Return the task with more lines, at features of the controllers or of their loops."""
        own = [look(p, K=K) for p in plants]
        at = stacked_plants(own)
        Y, X = basis.columns(at.omega)
        task_aim, gamma, rows = _split_demands(own, at, aim=aim, options=options, end_gain=end_gain)
        return DesignTask(
            basis=basis,
            family=family,
            at=at,
            aim=task_aim,
            gamma=gamma,
            rows=rows,
            stable=bool(options["stable"]),
            positive=bool(positive_gains),
            n_unstable=n_unstable,
            Y=Y,
            X=X,
        )

    _warn_of_rising_gain(family, dt)
    task = closer([basis.known_modes()])
    starts = _starts_for(task, options)
    if not starts:  # with the likeliest continuation of an FRF below its first line only
        family = [at.held_for(at.readings[:1]) for at in family]
        task = closer([basis.known_modes()])
        starts = _starts_for(task, options) or _refuse_without_start(task, options["start"])
    follow = partial(
        _iterate_on_loop_lines,
        closer=closer,
        n_iterations=n_iterations,
        progress=options["progress"],
    )
    if options["prove"] is None:
        theta, history, why = follow(task, starts)
    else:  # the best controller may have no proved gain, while another one has
        each = [follow(task, [one]) for one in starts]
        theta, history, why = _best_proved(task, each, prove=options["prove"], delay=delay)
    omega_c = tuple(map(float, _per_demand_list("omega_c", options["omega_c"])))
    found = replace(
        _evaluate_design(closer([basis.controller(theta)]), theta, history=history, why=why),
        omega_c=omega_c,
    )
    if found.met and omega_c and not options["resonates"]:
        found = _judge_crossover(found, family, omega_c[0])
    if found.met:
        return _with_lines_named(found, family, aim=aim, options=options)
    return found


def _warn_of_ringing(filter_time: float | None, dt: float) -> None:
    """Warn of a derivative filter that is too fast for the sampling time."""
    if filter_time is not None and 2 * filter_time < dt * (1 - 1e-9):
        keep = (2 * filter_time - dt) / (2 * filter_time + dt)
        warnings.warn(
            f"filter_time {filter_time:g} s is below half a sample of {1e3 * dt:g} ms: the"
            f" derivative rings, d[k] = {keep:.3g} d[k-1] + ...; use two samples, {2 * dt:g} s",
            DesignWarning,
            stacklevel=4,
        )


def _warn_of_rising_gain(family: list[PlantOnLines], dt: float) -> None:
    """Warn of an FRF whose gain rises over its last lines: above them it is assumed to be no
    larger.
    """
    for at in family:
        if at.loop is None and at.highest * dt < 0.9 * np.pi and at.rises_at_end:
            warnings.warn(
                f"|G| rises towards the last line, {format_hertz(at.highest)}: a mode above"
                " this line may make the loop unstable. Measure at higher frequency, or lower"
                " end_gain",
                DesignWarning,
                stacklevel=4,
            )


def _best_filter(
    plant: DesignPlant | Sequence[DesignPlant],
    structure: str | int | ControllerStructure,
    *,
    basis: Basis,
    options: LoopOptions,
) -> Design:
    """Return a design with positive gains, or else the best over the time constants of the
    derivative filter.

    For a given time constant the gains are linear in the parameters, and the convex program keeps
    them positive; for a free one that constraint is bilinear.
    """
    found: list[tuple[tuple[bool, float], Design]] = []
    refused: ValueError | None = None
    freely = design_loop(plant, structure, {**options, "positive": False})
    if _has_positive_gains(freely.K if freely.K_free is None else freely.K_free, basis.dt):
        return freely
    omega = np.array([1e-3 * basis.omega_mid])

    def merit(log_pole: float) -> float:
        """Return gamma, or minus the gain at low frequency; inf without a start or with a missed
        limit.
        """
        nonlocal refused
        try:
            design = design_loop(
                plant, structure, {**options, "filter_time": float(np.exp(-log_pole))}
            )
        except ValueError as error:  # no start with this filter
            refused = error
            return np.inf
        if np.isfinite(design.gamma):
            goal = design.gamma
        else:
            goal = -float(abs(response(design.K, omega)[0]))
        found.append(((not design.met, goal), design))
        if design.met:
            return goal
        return np.inf

    log_poles = np.linspace(np.log(basis.slowest), np.log(0.9 * basis.fastest), _N_FILTER_TIMES)
    goals = [merit(log_pole) for log_pole in log_poles]
    if not found:
        assert refused is not None
        raise refused
    best = int(np.argmin(goals))
    if np.isfinite(
        goals[best]
    ):  # six filters are too few: the gain between two of them may be half as large again
        between = log_poles[max(best - 1, 0)], log_poles[min(best + 1, _N_FILTER_TIMES - 1)]
        minimize_scalar(
            merit, bounds=between, method="bounded", options={"maxiter": _N_REFINED, "xatol": 0.02}
        )
    return min(found, key=lambda one: one[0])[1]


def _has_positive_gains(K: control.StateSpace, dt: float) -> bool:
    """Return True if all gains of a PID with a derivative filter are positive."""
    p = K.poles()
    s = np.sort(np.abs(2 / dt * (p - 1) / (p + 1) if dt else p))
    filter_time = 1 / s[-1]
    omega = np.geomspace(1e-2, 1.0, 12) * min(s[-1], 1 / dt if dt else np.inf)
    if dt:
        s = 2j / dt * np.tan(omega * dt / 2)
    else:
        s = 1j * omega
    parts = [np.ones_like(s), s / (filter_time * s + 1)] + ([1 / s] if K.nstates > 1 else [])
    columns = np.array(parts) / response(K, omega)
    gains = np.linalg.lstsq(
        np.hstack([columns.real, columns.imag]).T, np.repeat([1.0, 0.0], omega.size)
    )[0]
    return bool(np.all(gains >= 0))


def _iterate_on_loop_lines(
    task: DesignTask,
    starts: list[np.ndarray],
    *,
    closer: Callable[[list[control.StateSpace]], DesignTask],
    n_iterations: int,
    progress: Callable[[int, float], object] | None,
) -> tuple[np.ndarray, tuple[float, ...], str]:
    """Return parameters, history and the reason of the end; begin again if the lines of the loop
    show a worse result.

    The next run begins from the result if it nearly meets the demands; otherwise from the start, on
    the new lines.
    """
    tried, found, history = [], [], tuple[float, ...]()
    begin = starts
    for _ in range(1 + _LOOKS):
        theta, more, why = iterate(task, begin, n_iterations=n_iterations, progress=progress)
        history += more
        tried.append(task.basis.controller(theta))
        finer = closer(tried)
        found.append((finer.merit(theta), theta, why))
        missed = task.hard(theta) <= 1 + _LIMIT_TOLERANCE < finer.hard(theta)
        if not n_iterations or not (
            missed or is_lower(task.merit(theta), finer.merit(theta), _LOOKED)
        ):
            break
        task, begin = finer, [theta] if finer.hard(theta) < _NEARLY else starts
    _, theta, why = min(found, key=lambda one: one[0])
    return theta, history, why


def _best_proved(
    task: DesignTask,
    found: list[tuple[np.ndarray, tuple[float, ...], str]],
    *,
    prove: Proved,
    delay: float,
) -> tuple[np.ndarray, tuple[float, ...], str]:
    """Return the best of the candidates, each with the largest gain up to its own that is proved
    for the friction.
    """
    machines, friction = machines_of(*(prove if isinstance(prove, tuple) else (prove, None)))
    proved = []
    for theta, history, why in found:
        if gain := _largest_proved_gain(
            task.basis.controller(theta), machines, friction=friction, delay=delay
        ):
            lowered = theta.copy()
            lowered[task.basis.n_y :] *= gain
            text = "proved for its class of friction" + (
                f" at {gain:.3g} times the gain found" if gain < 1 else ""
            )
            proved.append((lowered, history, f"{why}; {text}"))
    if not proved:
        raise ValueError(
            "prove must be a class for which the proof holds with some gain, got no proof with"
            " the gain times 1, 1/2, ... 1/512"
        )
    return min(proved, key=lambda one: task.merit(one[0]))


def _largest_proved_gain(
    K: control.StateSpace,
    machines: tuple[FrictionPlant, ...],
    *,
    friction: MaxwellSlip,
    delay: float,
) -> float:
    """Return the largest gain, at most one, with which each machine is proved to come to rest; zero
    if none is.
    """

    def is_proved(gain: float) -> bool:
        return all(
            prove_friction(one, gain * K, friction, delay=delay).verdict.is_proved
            for one in machines
        )

    low = next((gain for gain in _PROOF_GAINS if is_proved(gain)), 0.0)
    high = 2 * low
    while 0 < low < 1 and high > _PROOF_GAIN_RATIO * low:
        middle = float(np.sqrt(low * high))
        if is_proved(middle):
            low, high = middle, high
        else:
            low, high = low, middle
    return low


def _split_demands(
    family: list[PlantOnLines], at: PlantOnLines, *, aim: str, options: LoopOptions, end_gain: float
) -> tuple[str, Demand | None, list[Demand]]:
    """Return the aim, "gamma" or "gain", the demand for gamma, and the hard demands."""
    w_P, w_T, w_u = options["w_P"], options["w_T"], options["w_u"]
    weighted = not (w_P is None and w_T is None and w_u is None)
    if aim == "auto":
        aim = "gamma" if weighted else "gain"
    if aim == "gamma" and not weighted:
        raise ValueError('aim must be "gain" without a weight w_P, w_T or w_u, got "gamma"')
    rows = limit_rows(
        at,
        M_S=options["M_S"],
        M_T=options["M_T"],
        M_u=options["M_u"],
        omega_c=options["omega_c"],
        gain=options["gain"],
        resonates=options["resonates"],
    )
    if aim == "gain":
        rows += weight_rows(at, w_P=w_P, w_T=w_T, w_u=w_u)
        if not rows and family:
            raise ValueError(
                "M_S (or another limit, or a weight) must be given, got no demand on the loop"
            )
    return aim, objective_row(at, w_P, w_T, w_u), rows + end_row(family, at, end_gain)


def _what_is_known(options: LoopOptions, n_unstable: int) -> KnownPlant:
    """Return the user's knowledge of an FRF: positive gains imply a stable plant whose y rises as u
    rises.
    """
    n = options["plant_integrators"]
    if n is not None:
        n = require_integer("plant_integrators", n, least=0)
    return KnownPlant(
        n_unstable=n_unstable,
        n_integrators=n,
        sign=1 if options["y_rises"] and not n_unstable else None,
    )


def _starts_for(task: DesignTask, options: LoopOptions) -> list[np.ndarray]:
    """Return the parameters of stabilising controllers, given or found; an empty list if there are
    none.
    """
    if options["start"] is not None:
        return _check_start(task, options["start"])
    if options["prove"] is None:
        n_starts = options["n_starts"]
    else:
        n_starts = max(options["n_starts"], _PROVED_STARTS)
    return _search_starts(task, n_starts)


def _check_start(task: DesignTask, start: Controller) -> list[np.ndarray]:
    """Return the parameters of a given start; an empty list if it does not stabilise."""
    theta = start_from_controller(task.basis, start, task.at)
    K = task.basis.controller(theta)
    if loops_stable(K, task.family, task.n_unstable)[0] is not Stability.STABLE:
        return []
    if task.positive and np.any(linear_rows(task, theta) @ theta < 0):
        raise ValueError("start must have positive gains only, got a negative gain")
    if task.stable and unstable_poles(K, task.basis.dt):
        raise ValueError(
            "start must be stable itself, got unstable poles. Or allow them with stable=False"
        )
    return [theta]


def _search_starts(task: DesignTask, n_starts: int) -> list[np.ndarray]:
    """Return n_starts stabilising controllers and a simple one; an empty list if there are none."""
    n_starts = require_integer("n_starts", n_starts, least=1)
    return find_start(
        task.basis,
        task.family,
        at=task.at,
        rows=task.rows,
        aim=task.objective,
        n_unstable=task.n_unstable,
        allow_unstable=not task.stable,
        positive=task.positive,
        wanted=n_starts,
    )


def _refuse_without_start(task: DesignTask, start: Controller | None) -> NoReturn:
    if start is not None:
        K = task.basis.controller(start_from_controller(task.basis, start, task.at))
        why = loops_stable(K, task.family, task.n_unstable)[1]
        raise ValueError(f"start must stabilise the plant, got a controller with which {why}")
    plants = "every plant" if len(task.family) > 1 else "the plant"
    gains = " with positive gains" if task.positive else ""
    gaps = [gap for at in task.family if (gap := _describe_phase_gap(at))]
    if gaps:
        because = gaps[0]
    else:
        because = "Or use a structure of higher order"
    if task.positive and all(read_below(*at.measured)[0].sign < 0 for at in task.family):
        because = "By its phase y falls as u rises: change the sign of one of them"
    raise ValueError(
        f"{'positive' if task.positive else 'start'} must be"
        f" {'left out' if task.positive else 'given'}: no simple {task.basis.structure.name}"
        f" controller{gains} was found that stabilises {plants}. {because}"
    )


def _describe_phase_gap(at: PlantOnLines) -> str:
    """Describe two lines of an FRF too far apart for a winding number, at the largest |G|; ""
    without any.
    """
    omega, G = at.measured
    turn = np.abs(np.angle(G[1:] / G[:-1]))
    gaps = np.flatnonzero(turn > LARGEST_JUMP)
    if at.loop is not None or not gaps.size:
        return ""
    k = gaps[np.argmax(np.abs(G[gaps]))]
    return (
        f"Between its lines at {omega[k]:.4g} and {omega[k + 1]:.4g} rad/s the phase of the FRF"
        f" turns by {np.degrees(turn[k]):.0f} deg, too much for a winding number of 1 + L: measure"
        " lines between them, or design for a fitted nominal"
    )


def _per_demand_list(name: str, given: float | tuple[float, ...] | None) -> list[float]:
    """Return one number or two as a list; the gain always has two."""
    if given is None:
        return []
    many = as_list(given)
    if len(many) != 2 and (name == "gain" or len(many) != 1):
        wanted = "(omega, least |L| there)" if name == "gain" else "one number or (low, high)"
        raise ValueError(f"{name} must be {wanted}, got {short_form(given)}")
    return many


def _structure_basis(
    shape: ControllerStructure, at: PlantOnLines, *, dt: float, fixed: Controller
) -> Basis:
    """Return the structure on the band of the lines."""
    F = state_space("fixed", fixed)
    require_sampling_time("fixed", F, reference="the controller", wanted=dt)
    F = control.StateSpace(F.A, F.B, F.C, F.D, dt)
    omega = at.omega[
        at.known & (at.omega >= at.lowest * (1 - 1e-9)) & (at.omega <= at.highest * (1 + 1e-9))
    ]
    if dt:
        s = 2 / dt * np.tan(omega * dt / 2)
    else:
        s = omega
    low, high = float(s.min()), float(s.max())
    derivative = shape.name in ("PD", "PID")  # a filter below half a sample rings
    if dt:
        top = min(FASTEST * high, (1 if derivative else FASTEST_SAMPLED) * 2 / dt)
    else:
        top = FASTEST * high
    middle = float(np.sqrt(low * min(high, top)))
    slowest = middle if derivative else 0.0  # a derivative filter, and no second integrator
    return Basis(structure=shape, a=middle, dt=dt, slowest=slowest, fastest=top, fixed=F)


def _evaluate_design(
    task: DesignTask, theta: np.ndarray, *, history: tuple[float, ...], why: str
) -> Design:
    """Return the design, with everything recomputed for the final controller, and its
    description.
    """
    K = task.basis.controller(theta)
    one = control.StateSpace([], [], [], [[1.0]], task.basis.dt)
    if is_constant(task.basis.fixed):
        K_free = None
    else:
        K_free = replace(task.basis, fixed=one).controller(theta)
    state, trouble = loops_stable(K, task.family, task.n_unstable)
    good = state is Stability.STABLE
    k = response(K, task.at.omega)
    ones = np.ones(k.size, complex)
    gamma = np.nan
    if task.gamma is not None and good:
        gamma = float(task.gamma.measure(ones, k).max())
    elif task.gamma is not None and state is Stability.UNSTABLE:
        gamma = np.inf
    if not good:
        return Design(
            K=K,
            K_free=K_free,
            gamma=gamma,
            met=False,
            reason=f"not found: {trouble}",
            history=history,
            stability=state,
        )
    failed = []
    for row in task.rows:
        v = row.measure(ones, k)
        if v.max() > 1 + _LIMIT_TOLERANCE:
            failed.append((float(v.max()), row.name, float(task.at.omega[row.index[v.argmax()]])))
    failed.sort(reverse=True)
    text = "; ".join(
        f"{name} is missed by a factor {v:.4g} at {format_hertz(w)}" for v, name, w in failed[:3]
    )
    if failed:
        reason = f"not found: {text} ({why})"
    else:
        reason = why
    if undecided := describe_open_reading(K, task.family, task.n_unstable):
        state, reason = Stability.UNDECIDED, f"{undecided}; {reason}"
    return Design(
        K=K,
        K_free=K_free,
        gamma=gamma,
        met=not failed and state is Stability.STABLE,
        reason=reason,
        stability=state,
        history=history,
        loop=_describe_loop(task, K),
    )


def _judge_crossover(design: Design, family: list[PlantOnLines], omega_c: float) -> Design:
    """Return a design as not met if a loop crosses one far below the requested crossover.

    The demand |L| >= 1 at one line may be met by a mode of the plant alone.
    """
    for at in family:
        omega = at.omega[at.known]
        reached = _reached_crossover(omega, at.G[at.known] * response(design.K, omega))
        if reached < _CROSSOVER_TOLERANCE * omega_c:
            wanted = format_hertz(omega_c)
            return replace(
                design,
                met=False,
                reason=(
                    f"not found: the loop crosses over at {format_hertz(reached)}, asked {wanted}:"
                    f" from there on |L| is below one over most of the octaves to {wanted}, where"
                    f" only a mode lifts it above ({design.reason})"
                ),
            )
    return design


def _reached_crossover(omega: np.ndarray, L: np.ndarray) -> float:
    """Return the frequency that best separates |L| > 1 below it from |L| < 1 above, in octaves.

    The short dip of an antiresonance leaves it above the dip; the short peak of a mode leaves it
    below the peak. It is the first line if no crossover is better.
    """
    crossovers = classical_margins(omega, L).crossovers
    ends = np.log([omega[0], *crossovers, omega[-1]])
    first = 1.0 if abs(L[0]) >= 1 else -1.0
    signs = first * (-1.0) ** np.arange(ends.size - 1)
    above = np.concatenate([[0.0], np.cumsum(signs * np.diff(ends))])
    return float(np.exp(ends[np.argmax(above)]))


def _with_lines_named(
    design: Design, family: list[PlantOnLines], *, aim: str, options: LoopOptions
) -> Design:
    """Return a design that is met, with the number of lines if a mode between two of them may
    violate a demand.
    """
    paths = [along_arcs(at) for at in family if at.loop is None]
    if not paths:
        return design
    at = stacked_plants(paths)
    _, gamma, rows = _split_demands(
        [], at, aim=aim, options={**options, "omega_c": None, "gain": None}, end_gain=1.0
    )
    missed = [(row, 1.0) for row in rows] + ([] if gamma is None else [(gamma, design.gamma)])
    k = response(design.K, at.omega)
    worst, name, where = 0.0, "", 0.0
    for row, most in missed:
        v = row.measure(np.ones(k.size, complex), k) / most
        if v.max() > worst:
            worst, name, where = float(v.max()), row.name, float(at.omega[row.index[v.argmax()]])
    if worst <= 1 + _LIMIT_TOLERANCE:
        return design
    n_lines = sum(one.measured[0].size for one in family if one.loop is None)
    return replace(
        design,
        n_lines=n_lines,
        reason=(
            f"{design.reason}; met on {n_lines} lines: between two of them, at"
            f" {format_hertz(where)}, a hidden mode may violate {name} by a factor {worst:.4g}"
        ),
    )


def _describe_loop(task: DesignTask, K: control.StateSpace) -> DesignedLoop:
    """Return the crossovers of the nominal loops of the family, and their largest |S| and |T| on
    the lines.
    """
    crossovers: list[float] = []
    S, T = [], []
    for at in task.family:
        own = at if len(task.family) > 1 else task.at  # including the lines of its loop
        omega = own.omega[own.known]
        L = own.G[own.known] * response(K, omega)
        crossovers += classical_margins(omega, L).crossovers
        S.append(peak_of(omega, np.abs(1 / (1 + L))))
        T.append(peak_of(omega, np.abs(L / (1 + L))))
    return DesignedLoop(crossovers=tuple(sorted(crossovers)), peak_S=max(S), peak_T=max(T))
