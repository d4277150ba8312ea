"""Fixed-order controllers straight from the FRF, by convex programming: what is asked, and what came out of it."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import control
import numpy as np

from nlfrf import Bla
from nlfrf.shared.arguments import integer, nonnegative, one_of, positive, real
from nlfrf.shared.wording import hertz, shown
from robust.fixed_structure.convex_concave import DesignTask, iterate
from robust.fixed_structure.demands import Demand, end_row, limit_rows, objective_row, weight_rows
from robust.fixed_structure.plants import SeenPlant, see, stacked_plants
from robust.fixed_structure.proved import largest_proved_gain, machines_of
from robust.fixed_structure.starts import find_start, given_start, loops_stable
from robust.fixed_structure.structures import FASTEST, FASTEST_SAMPLED, Basis, ControllerStructure, structure_of
from robust.synthesis.design import Design
from robust.systems.lti import constant, response, timebase
from robust.systems.nyquist import unstable_poles
from robust.systems.realisation import state_space
from robust.uncertain.model import UncertaintyModel

__all__ = ["design_frf"]


def design_frf(
    plant: Any,
    structure: str | int | ControllerStructure,
    *,
    w_P: Any = None,
    w_T: Any = None,
    w_u: Any = None,
    M_S: Any = None,
    M_T: Any = None,
    M_u: Any = None,
    omega_c: Any = None,
    gain: tuple[float, float] | None = None,
    aim: str = "auto",
    dt: float = 0.0,
    delay: float = 0.0,
    fixed: Any = 1,
    end_gain: float = 0.5,
    integrators: int = 0,
    filter_time: float | None = None,
    stable: bool = True,
    start: Any = None,
    n_starts: int = 1,
    n_unstable: int = 0,
    prove: Any = None,
    n_iterations: int = 60,
    time_cap: float = 20.0,
    progress: Callable[[int, float], Any] | None = None,
) -> Design:
    """Design a controller of fixed structure straight from a measured FRF, no parametric model needed.

    Give demands that must be met (M_S, M_T, M_u, omega_c, gain; stability of every plant of the set goes without
    saying) and what to make as good as possible: the weights (aim "gamma"), or, without weights, the gain at low
    frequency.

    Parameters
    ----------
    plant : nlfrf.Bla, control.FrequencyResponseData, UncertaintyModel, control system, or a list of them
        An FRF is known on its lines only; below the first one it is taken to go on as its slope says (flat, or as
        integrators). A list is a family: one controller for all. Discs of a Bla or model are
        part of every demand: it holds for each plant in them.
    structure : str, int or ControllerStructure
        "P", "I", "PI", "PD", "PID", "lead", "lead-lag" (real zeros and poles), or an order n ("order-n"); or one of
        your own, with a denominator that is given.
    w_P, w_T, w_u : control system or float, optional
        Weights on S, T and K S. gamma = max over frequency of the norm of [|w_P S| at worst over the set; w_T T;
        w_u K S]: without uncertainty the H-infinity norm, with w_P alone the structured singular value of robust
        performance.
    M_S, M_T, M_u : float or control system, optional
        Largest |S|, |T|, |K S| allowed, a number or a magnitude over frequency.
    omega_c : float or (low, high), optional
        Crossover at least there [rad/s]; with two numbers, at most at the second.
    gain : (omega, least), optional
        |L| at least so large at a frequency [rad/s]: tracking and disturbance rejection.
    aim : str
        "gamma": minimise it. "gain": make lim s^m K(s) at zero frequency as large as possible while weights, too,
        become demands (gamma <= 1). "auto": "gamma" where a weight is given.
    dt : float
        Sampling time of the controller [s]; 0 for a continuous one. Hold and delay are put into the plant.
    delay : float
        Computation delay [s] on top of what the plant contains.
    fixed : control system
        A known factor of K on the same time base: a notch, a roll-off, a filter (`robust.notch`, ...).
    end_gain : float
        Largest |L| from the last line of an FRF on; above it the plant is taken to be no larger than there.
    integrators : int
        Integrators inside an "order-n".
    filter_time : float, optional
        Time constant of the derivative filter [s] of PD and PID; chosen by the design when not given.
    stable : bool
        Keep the controller itself stable (integrators aside).
    start : control system, optional
        A stabilising controller of the structure to begin from; searched for when not given.
    n_starts : int
        How many of the controllers found to begin with are followed; more take longer and may end in a better optimum.
    n_unstable : int
        Unstable poles of a plant that is an FRF.
    prove : FrictionClass or (SlidingMachine, AnyFriction), optional
        Whose friction, every one of the class, the loop must be proved to come to rest with: the gain is lowered until
        it is, and all else is judged again there.
    n_iterations, time_cap : int, float
        Caps on convex steps and on time [s].
    progress : callable, optional
        Called with (iteration, worst demand or gamma) after every step.

    Returns
    -------
    Design
        With `met`, `reason` and `history`. What could not be met is said there, with the best controller found.

    Raises
    ------
    ValueError
        No stabilising controller to begin from, parts that do not fit each other, nothing asked for, no gain that is
        proved.

    References
    ----------
    Karimi & Kammer, *A data-driven approach to robust control of multivariable systems by convex optimization*,
    Automatica 85 (2017); SP 7.5 and 7.6.

    Examples
    --------
    SP Example 2.17: order 4 reaches gamma 1.366 at best, order 2 nearly so.

    >>> import robust
    >>> G = control.tf([200], np.polymul([10, 1], np.polymul([0.05, 1], [0.05, 1])))
    >>> design = design_frf(G, 2, w_P=robust.performance_weight(10, M_S=1.5, A=1e-4), w_u=1.0)
    >>> design.K.nstates, bool(design.gamma < 1.41)
    (2, True)
    """
    began = time.perf_counter()
    one_of("aim", aim, ("auto", "gamma", "gain"))
    dt, delay = nonnegative("dt", dt), nonnegative("delay", delay)
    n_unstable = integer("n_unstable", n_unstable, least=0)
    n_iterations = integer("n_iterations", n_iterations, least=0)
    time_cap = positive("time_cap", time_cap)
    shape = structure_of(structure, integer("integrators", integrators, least=0), filter_time)
    plants = list(plant) if isinstance(plant, Sequence) else [plant]
    if not plants:
        raise ValueError("plant must be a plant or a list of them, got an empty list")
    dt = time_base(plants, dt)
    named = [*pair("omega_c", omega_c), *(pair("gain", gain)[:1] if gain is not None else [])]
    wanted = tuple(real("omega_c", w) for w in named)
    seen = [see(p, dt, delay, wanted, (w_P, w_T, w_u, M_S, M_T, M_u)) for p in plants]
    at = stacked_plants(seen)
    weights = {"w_P": w_P, "w_T": w_T, "w_u": w_u}
    limits = {"M_S": M_S, "M_T": M_T, "M_u": M_u, "omega_c": omega_c, "gain": gain}
    aim, rows = asked(at, aim, weights, limits)
    rows += end_row(seen, at, positive("end_gain", end_gain))
    objective = objective_row(at, **weights)
    basis = basis_for(shape, at, dt, fixed)
    Y, X = basis.columns(at.omega)
    task = DesignTask(
        basis=basis,
        seen=seen,
        at=at,
        rows=rows,
        objective=objective if aim == "gamma" else None,
        stable=bool(stable),
        n_unstable=n_unstable,
        Y=Y,
        X=X,
    )
    starts = [checked_start(task, start)] if start is not None else found_starts(task, n_starts)
    theta, history, why = iterate(task, starts, n_iterations, began + time_cap, progress)
    if prove is not None:
        theta, why = proved_parameters(task, theta, prove, delay, why)
    return judged_design(task, theta, history, why, objective)


def proved_parameters(
    task: DesignTask, theta: np.ndarray, prove: Any, delay: float, why: str
) -> tuple[np.ndarray, str]:
    """The parameters with the largest gain, at most the one found, that is proved for a class of friction."""
    machines, friction = machines_of(*(prove if isinstance(prove, tuple) else (prove, None)))
    gain, proofs = largest_proved_gain(task.basis.controller(theta), machines, friction, delay)
    if proofs is None:
        raise ValueError(
            "prove must be a class for which some gain of the controller is proved, got none down to 1/256"
        )
    lowered = theta.copy()
    lowered[task.basis.n_y :] *= gain
    said = "proved for its class of friction" + (f" at {gain:.3g} times the gain found" if gain < 1 else "")
    return lowered, f"{why}; {said}"


def asked(at: SeenPlant, aim: str, weights: dict[str, Any], limits: dict[str, Any]) -> tuple[str, list[Demand]]:
    """What is to be made as good as possible, "gamma" or "gain", and what must be met."""
    weighted = any(w is not None for w in weights.values())
    aim = ("gamma" if weighted else "gain") if aim == "auto" else aim
    if aim == "gamma" and not weighted:
        raise ValueError('aim must be "gain" where no weight w_P, w_T or w_u is given, got "gamma"')
    rows = limit_rows(at, **limits)
    if aim == "gain":
        rows += weight_rows(at, **weights)
        if not rows:
            raise ValueError("M_S (or another limit, or a weight) must be given: nothing is asked of the loop")
    return aim, rows


def checked_start(task: DesignTask, start: Any) -> np.ndarray:
    """The parameters of a controller that was given to start from, or a refusal."""
    theta = given_start(task.basis, start, task.at)
    K = task.basis.controller(theta)
    good, why = loops_stable(K, task.seen, task.n_unstable)
    if not good:
        raise ValueError(f"start must stabilise the plant, got one with which {why}")
    if task.stable and unstable_poles(K, task.basis.dt):
        raise ValueError("start must be stable itself, got unstable poles. Or allow them with stable=False")
    return theta


def found_starts(task: DesignTask, n_starts: Any) -> list[np.ndarray]:
    """The best n_starts simple controllers that stabilise, or a refusal where there is none."""
    n_starts = integer("n_starts", n_starts, least=1)
    starts = find_start(
        task.basis,
        task.seen,
        task.at,
        task.rows,
        task.objective,
        n_unstable=task.n_unstable,
        allow_unstable=not task.stable,
        wanted=n_starts,
    )
    if not starts:
        raise ValueError(
            f"start must be given: no simple {task.basis.structure.name} controller was found that stabilises "
            f"{'every plant' if len(task.seen) > 1 else 'the plant'}"
        )
    return sorted(starts, key=task.merit)[:n_starts]


def pair(name: str, given: Any) -> list[Any]:
    """What was given as one number or two, as a list; the gain always has two."""
    if given is None:
        return []
    many = list(given) if isinstance(given, (tuple, list)) else [given]
    if len(many) != 2 and (name == "gain" or len(many) != 1):
        wanted = "(omega, least |L| there)" if name == "gain" else "one number or (low, high)"
        raise ValueError(f"{name} must be {wanted}, got {shown(given)}")
    return many


def time_base(plants: list[Any], dt: float) -> float:
    """Sampling time of the loop: that of the controller, or of plants that are sampled already."""
    steps = set()
    for p in plants:
        source = p.nominal if isinstance(p, UncertaintyModel) else p
        if not isinstance(source, Bla):
            if not isinstance(source, control.FrequencyResponseData):
                source = state_space("plant", source)
                steps.add(timebase(source))
            elif source.dt:
                steps.add(float(source.dt))
    steps -= {0.0}
    if len(steps) > 1 or (dt and steps and abs(dt / min(steps) - 1) > 1e-9):
        raise ValueError(f"dt must be one sampling time for all, got {sorted(steps | ({dt} if dt else set()))} s")
    return steps.pop() if steps else dt


def basis_for(shape: Any, at: SeenPlant, dt: float, fixed: Any) -> Basis:
    """The structure on the band of the lines."""
    F = state_space("fixed", fixed)
    if not constant(F) and timebase(F) != dt:
        raise ValueError(f"fixed must have the sampling time of the controller, {dt:g} s, got {timebase(F):g} s")
    F = control.StateSpace(F.A, F.B, F.C, F.D, dt)
    omega = at.omega[at.known & (at.omega >= at.lowest * (1 - 1e-9))]
    s = 2 / dt * np.tan(omega * dt / 2) if dt else omega
    low, high = float(s.min()), float(s.max())
    top = min(FASTEST * high, FASTEST_SAMPLED * 2 / dt) if dt else FASTEST * high
    middle = float(np.sqrt(low * min(high, top)))
    slowest = middle if shape.name in ("PD", "PID") else 0.0  # a derivative filter, and no second integrator
    return Basis(structure=shape, a=middle, dt=dt, slowest=slowest, fastest=top, fixed=F)


def judged_design(
    task: DesignTask, theta: np.ndarray, history: tuple[float, ...], why: str, objective: Demand | None
) -> Design:
    """Everything recomputed at the controller returned, and what can be said of it."""
    K = task.basis.controller(theta)
    good, trouble = loops_stable(K, task.seen, task.n_unstable)
    k = response(K, task.at.omega)
    ones = np.ones(k.size, complex)
    gamma = np.nan
    if objective is not None:
        gamma = float(objective.measure(ones, k).max()) if good else np.inf if "unstable" in trouble else np.nan
    if not good:
        return Design(K=K, gamma=gamma, met=False, reason=f"not found: {trouble}", history=history)
    failed = []
    for row in task.rows:
        v = row.measure(ones, k)
        if v.max() > 1 + 1e-4:
            failed.append((float(v.max()), row.name, float(task.at.omega[row.index[v.argmax()]])))
    if failed:
        failed.sort(reverse=True)
        said = "; ".join(f"{name} is missed by a factor {v:.4g} at {hertz(w)}" for v, name, w in failed[:3])
        return Design(K=K, gamma=gamma, met=False, reason=f"not found: {said} ({why})", history=history)
    return Design(K=K, gamma=gamma, met=True, reason=why, history=history)
