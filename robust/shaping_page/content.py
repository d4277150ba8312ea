"""What the page is told: models as a controller sees them, the demand, the controller to begin with."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import control
import numpy as np

from nlfrf.shared.arguments import nonnegative
from nlfrf.shared.wording import shown
from robust.analysis.loop import Loop, assemble
from robust.loopshaping.bounds import loop_bounds
from robust.shaping_page.systems import doubtful_poles, encoded_response
from robust.shaping_page.words import Told, python_to_paste, to_prove
from robust.systems.lti import constant, timebase
from robust.systems.realisation import state_space
from robust.uncertain.forms import FORMS, worst_terms
from robust.uncertain.measured import warn_of_unknown_hold
from robust.uncertain.model import UncertaintyModel

__all__ = ["page_content"]

BEYOND = 1e300
UNFILTERED = 1e120  # stands for a sum over aliases without a bound: its square is a number still
#: How far beyond the lines the winding is followed [decades], and points on each of those.
BELOW, ABOVE, SPARSE = 5, 3, 4
#: Frequencies up to Nyquist, relative to it.
NEAR_NYQUIST = np.array([3e-2, 1e-2, 3e-3, 1e-3, 1e-6])
#: Lines that are drawn at most, of each model.
MOST_LINES = 400


def page_content(models: Any, *, w_P: Any, K: Any, dt: float, delay: float, told: Told) -> dict[str, Any]:
    """Everything the page needs, as JSON holds it."""
    models = list(models) if isinstance(models, Sequence) else [models]
    if not models or not all(isinstance(model, UncertaintyModel) for model in models):
        raise ValueError(f"model must be an UncertaintyModel or a list of them, got {shown(models)}")
    if any(model.measured_only for model in models):
        raise ValueError(
            "model must have a parametric nominal to be shaped on, got one on an FRF. Make it by fit_nominal"
        )
    K, w_P = state_space("K", 1.0 if K is None else K), None if w_P is None else state_space("w_P", w_P)
    dt = time_step(models, K, dt)
    start = control.StateSpace(K.A, K.B, K.C, K.D, dt)
    loops = [assemble(model, start, w_P, delay) for model in models]
    if len({loop.dt for loop in loops}) > 1:
        raise ValueError(f"model must have one sampling time, got {', '.join(f'{loop.dt:g} s' for loop in loops)}")
    dt = loops[0].dt
    for model in models if dt else ():
        warn_of_unknown_hold(model, dt)
    names = [*told.names, *(f"level {k + 1}" for k in range(len(told.names), len(models)))]
    return {
        "title": told.title,
        "dt": dt,
        "delay": delay,
        "omega": shared_grid(models, loops),
        "models": [described(*row) for row in zip(names, models, loops, strict=False)],
        "w_P": None if w_P is None else encoded_response(loops[0].w_P),
        "K": encoded_response(start) | {name: getattr(start, name).tolist() for name in "ABCD"},
        "K_poles": doubtful_poles(start),
        "begun": not constant(start) or float(start.D[0, 0]) != 1.0,
        "python": python_to_paste(told, models, w_P, start, dt, delay),
        "command": to_prove(told, w_P, delay),
    }


def time_step(models: list[UncertaintyModel], K: control.StateSpace, dt: float) -> float:
    """The sampling time of the loop [s]: asked for, that of the controller, or that of the models."""
    dt = nonnegative("dt", dt)
    known = {timebase(model.nominal) for model in models} | ({0.0} if constant(K) else {timebase(K)})
    known = {step for step in known | {dt} if step}
    if len(known) > 1:
        raise ValueError(
            f"dt must be one for models and controller, got {' and '.join(f'{s:g} s' for s in sorted(known))}"
        )
    if not constant(K) and known and not timebase(K):
        raise ValueError(f"K must be sampled at {known.pop():g} s as the loop is, got a continuous one. Use discretize")
    return known.pop() if known else 0.0


def described(name: str, model: UncertaintyModel, loop: Loop) -> dict[str, Any]:
    """One model: its responses, its bounds on |L|, its poles that are not surely stable."""
    row = FORMS[model.form]
    # without a demand the bounds are those of robust stability: a demand that asks nothing
    demand = control.StateSpace([], [], [], [[1e-9]]) if loop.w_P is None else loop.w_P
    low, high = loop_bounds(model, demand)
    omega = model.omega[model.omega < loop.top]
    refuse_unknown(model)
    return {
        "name": name,
        "G": encoded_response(loop.short),
        "shift": loop.shift,
        "poles": doubtful_poles(loop.short),
        "w": encoded_response(loop.weight),
        "read": "".join(factor for factor in row.read if factor != "w"),
        "inverse": row.inverse,
        "lines": omega.tolist(),
        # JSON has no infinity: beyond every plot
        "low": np.minimum(low, BEYOND)[: omega.size].tolist(),
        "high": np.minimum(high, BEYOND)[: omega.size].tolist(),
        "set": f"{model.form}, {model.perturbation}" + ", aliases left to the check" * left_out(loop),
        "aliases": encoded_aliases(loop),
    }


def left_out(loop: Loop) -> bool:
    """Whether the page shows rs without the aliases: their condition in an inverse form is no size of K S."""
    return loop.aliases is not None and loop.aliases.inverse


def encoded_aliases(loop: Loop) -> dict[str, Any] | None:
    """What the page adds up over the aliases of a frequency (`robust.analysis.aliases`); None where there are none."""
    aliases = loop.aliases
    if aliases is None or aliases.inverse:
        return None
    tail = float((aliases.beyond.FF if aliases.operator else aliases.beyond.F)[0])
    return {
        "dt": aliases.dt,
        "delay": aliases.delay,
        "n": int(aliases.single[-1]),
        "tail": min(tail, UNFILTERED),
        "operator": aliases.operator,
        "G": encoded_response(aliases.plant) if aliases.through else None,
    }


def refuse_unknown(model: UncertaintyModel) -> None:
    """Refuse a form that is not b = (factors it reads) S with a = 0, or a = those factors where it is inverse."""
    row, rng = FORMS[model.form], np.random.default_rng(0)
    w, G, K = rng.standard_normal((3, 4)) + 1j * rng.standard_normal((3, 4))
    parts = {"w": w, "G": G, "K": K}
    q = np.prod([parts[name] for name in row.read], axis=0)
    S, a, b = worst_terms(model.form, w, G, K)
    if not (np.allclose(b, q * S) and np.allclose(a, q * row.inverse)):
        raise ValueError(f"model must be of a form that the page computes with, got {model.form}: use plot_loop_bounds")


def shared_grid(models: list[UncertaintyModel], loops: list[Loop]) -> list[float]:
    """Frequencies [rad/s] of all models: their lines and modes, sparse for decades on both sides."""
    grids = []
    for model, loop in zip(models, loops, strict=True):
        lines = model.omega[:: model.omega.size // MOST_LINES + 1]
        grids.append(loop.grid(lines[lines < loop.top]))
    omega = np.unique(np.concatenate(grids))
    omega = omega[np.concatenate([[True], np.diff(np.log(omega)) > 1e-5])]
    low, high = omega[0], omega[-1]
    far = [low * np.geomspace(10.0**-BELOW, 1, BELOW * SPARSE + 1)[:-1]]
    top = loops[0].top
    beyond = high * np.geomspace(1, 10.0**ABOVE, ABOVE * SPARSE + 1)[1:] if np.isinf(top) else top * (1 - NEAR_NYQUIST)
    return np.unique(np.concatenate([omega, *far, beyond[beyond > high]])).tolist()
