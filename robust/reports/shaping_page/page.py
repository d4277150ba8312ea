"""One self-contained HTML file to shape a loop in, with its curves, style and script."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from html import escape
from importlib.resources import files

import control
import numpy as np
from scipy.linalg import hessenberg

from nlfrf._base.arguments import as_list, require_nonnegative, short_form
from nlfrf._base.files import page_path, write_text
from nlfrf._base.types import JsonObject
from robust._base.types import Controller, Weight
from robust.analysis.bounds import loop_bounds
from robust.analysis.loop import Loop, assemble_loop
from robust.lti.lti import is_constant, one_sampling_time, scale_states, timebase
from robust.lti.realisation import state_space
from robust.lti.stability import poles_with_rounding
from robust.models.sets.forms import FORMS
from robust.models.sets.measured import warn_of_unknown_hold
from robust.models.sets.model import UncertaintyModel
from robust.reports.shaping_page.beginning import starting_state
from robust.reports.shaping_page.generated_text import PartSources, proof_commands, python_script

# ---- A system for the page: a Hessenberg form, whose response costs n^2 operations for each
# frequency.


def _encode_response(system: control.StateSpace) -> JsonObject:
    """Encode a system for C (x I - H)^-1 B + D, with x = j omega, or exp(j omega dt) - 1 if it is
    sampled.

    A sampled system is encoded as A - I, because its slow poles are close to one and would lose
    digits.
    """
    dt = timebase(system)
    A, B, C = scale_states(system.A - np.eye(system.nstates) * (dt > 0), system.B, system.C)
    if A.size:
        H, Q = hessenberg(A, calc_q=True)
    else:
        H, Q = A, A
    return {
        "dt": dt,
        "H": H.ravel().tolist(),
        "b": (Q.T @ B).ravel().tolist(),
        "c": (C @ Q).ravel().tolist(),
        "d": float(system.D[0, 0]),
    }


def _uncertain_poles(system: control.StateSpace) -> list[list[float]]:
    """Return [re, im] of the poles that are not stable beyond rounding; sampled ones as s = 2/dt (z
    - 1)/(z + 1).
    """
    dt = timebase(system)
    poles, moved = poles_with_rounding(system)
    found = poles[(np.abs(poles) - 1 if dt else poles.real) >= -moved]
    if dt:
        found = 2 / dt * (found - 1) / (found + 1)
    return [[float(p.real), float(p.imag)] for p in found]


# ---- Content of the page: models as seen by the controller, the demand, the controller at the
# start.

_LARGEST_NUMBER = 1e300
# stands for a sum over aliases without a bound; its square is still finite
_UNFILTERED_SIZE = 1e120
#: Decades below and above the lines over which the winding is counted, and points in each.
_DECADES_BELOW, _DECADES_ABOVE, _POINTS_PER_DECADE = 5, 3, 4
#: Frequencies up to Nyquist, relative to it.
_NEAR_NYQUIST = np.array([3e-2, 1e-2, 3e-3, 1e-3, 1e-6])
#: Largest number of lines to draw for each model.
_MAX_LINES = 400


def _list_models(models: UncertaintyModel | Sequence[UncertaintyModel]) -> list[UncertaintyModel]:
    """Return the models of a page; refuse other things, and models without a parametric nominal."""
    found = as_list(models)
    if not found or not all(isinstance(model, UncertaintyModel) for model in found):
        raise ValueError(
            f"model must be an UncertaintyModel or a list of them, got {short_form(found)}"
        )
    if any(model.measured_only for model in found):
        raise ValueError(
            "model must have a parametric nominal to shape a loop, got a measured FRF. Make a"
            " nominal by fit_nominal"
        )
    return found


def page_content(
    models: UncertaintyModel | Sequence[UncertaintyModel],
    *,
    w_P: Weight | None,
    K: Controller | None,
    dt: float,
    delay: float,
    sources: PartSources,
    omega_c: float | None = None,
) -> JsonObject:
    """Return the content of the page for JSON.

    Without K the page starts with |L| = 1 at omega_c [rad/s].
    """
    models = _list_models(models)
    initial = state_space("K", 1.0 if K is None else K)
    if w_P is not None:
        w_P = state_space("w_P", w_P)
    dt = _loop_sampling_time(models, initial, dt)
    # a gain has no sampling time of its own: it gets that of the loop
    start = control.StateSpace(initial.A, initial.B, initial.C, initial.D, dt)
    loops = [assemble_loop(model, start, w_P=w_P, delay=delay) for model in models]
    if len({loop.dt for loop in loops}) > 1:
        raise ValueError(
            "model must have one sampling time, got"
            f" {', '.join(f'{loop.dt:g} s' for loop in loops)}"
        )
    dt = loops[0].dt
    for model in models if dt else ():
        warn_of_unknown_hold(model, dt)
    names = [*sources.names, *(f"level {k + 1}" for k in range(len(sources.names), len(models)))]
    omega = _shared_grid(models, loops)
    return {
        "title": sources.title,
        "begin": (
            {"gain": 1, "elements": []}
            if K is not None
            else starting_state(models, loops, np.array(omega), omega_c=omega_c, delay=delay)
        ),
        "warnings": list(dict.fromkeys(text for model in models for text in model.warnings)),
        "dt": dt,
        "delay": delay,
        "omega": omega,
        "models": [_encode_model(*row) for row in zip(names, models, loops, strict=False)],
        "w_P": None if w_P is None else _encode_response(loops[0].w_P),
        "K": _encode_response(start) | {name: getattr(start, name).tolist() for name in "ABCD"},
        "K_poles": _uncertain_poles(start),
        # the controller of the page is K times its elements, and has no PID gains if K is given
        "begun": not is_constant(start) or float(start.D[0, 0]) != 1.0,
        "python": python_script(sources, models, w_P=w_P, K=start, dt=dt, delay=delay),
        "command": proof_commands(sources, w_P, delay),
    }


def _loop_sampling_time(models: list[UncertaintyModel], K: control.StateSpace, dt: float) -> float:
    """Return the sampling time of the loop [s]: as given, that of the controller, or that of the
    models.
    """
    dt = require_nonnegative("dt", dt)
    step = one_sampling_time(
        [dt, *(model.nominal.dt for model in models), 0.0 if is_constant(K) else K.dt]
    )
    if not is_constant(K) and step and not timebase(K):
        raise ValueError(
            f"K must be sampled at {step:g} s like the loop, got a continuous one. Use discretize"
        )
    return step


def _encode_model(name: str, model: UncertaintyModel, loop: Loop) -> JsonObject:
    """Encode one model: its responses, its bounds on |L|, its poles that may be unstable."""
    row = FORMS[model.form]
    if row.depends_on_units:  # its conditions are no products of w, G and K
        raise ValueError(
            f"model must have a form that the page can compute, got {model.form}: use"
            " plot_loop_bounds"
        )
    # without a demand the bounds are those of robust stability, computed with a negligible demand
    if loop.w_P is None:
        demand = control.StateSpace([], [], [], [[1e-9]])
    else:
        demand = loop.w_P
    low, high = loop_bounds(model, demand)
    omega = model.omega[model.omega < loop.omega_max]
    return {
        "name": name,
        "G": _encode_response(loop.undelayed_plant),
        "shift": loop.plant_delay,
        "poles": _uncertain_poles(loop.undelayed_plant),
        "w": _encode_response(loop.weight),
        "read": "".join(factor for factor in row.rs_factors if factor != "w"),
        "inverse": row.inverse,
        "lines": omega.tolist(),
        # JSON has no infinity: beyond every plot
        "low": np.minimum(low, _LARGEST_NUMBER)[: omega.size].tolist(),
        "high": np.minimum(high, _LARGEST_NUMBER)[: omega.size].tolist(),
        "set": (
            f"{model.form}, {model.perturbation}"
            + ", aliases left to the check" * _omits_aliases(loop)
        ),
        "aliases": _encode_aliases(loop),
    }


def _omits_aliases(loop: Loop) -> bool:
    """Return whether the page shows rs without aliases: in an inverse form their condition is no
    magnitude of K S.
    """
    return loop.aliases is not None and loop.aliases.inverse


def _encode_aliases(loop: Loop) -> JsonObject | None:
    """Encode the sums over the aliases of a frequency (`robust.analysis.aliases`); None without
    aliases.
    """
    aliases = loop.aliases
    if aliases is None or aliases.inverse:
        return None
    tail = float((aliases.tail_bounds.FF if aliases.operator else aliases.tail_bounds.F)[0])
    return {
        "dt": aliases.dt,
        "delay": aliases.delay,
        "n": int(aliases.single_indices[-1]),
        "tail": min(tail, _UNFILTERED_SIZE),
        "operator": aliases.operator,
        "G": _encode_response(aliases.plant) if aliases.F_includes_plant else None,
    }


def _shared_grid(models: list[UncertaintyModel], loops: list[Loop]) -> list[float]:
    """Return frequencies [rad/s] of all models: their lines and modes, sparse for decades on both
    sides.
    """
    grids = []
    for model, loop in zip(models, loops, strict=True):
        lines = model.omega[:: model.omega.size // _MAX_LINES + 1]
        grids.append(loop.grid(lines[lines < loop.omega_max]))
    omega = np.unique(np.concatenate(grids))
    omega = omega[np.concatenate([[True], np.diff(np.log(omega)) > 1e-5])]
    low, high = omega[0], omega[-1]
    far = [
        low * np.geomspace(10.0**-_DECADES_BELOW, 1, _DECADES_BELOW * _POINTS_PER_DECADE + 1)[:-1]
    ]
    top = loops[0].omega_max
    if np.isinf(top):
        beyond = (
            high
            * np.geomspace(1, 10.0**_DECADES_ABOVE, _DECADES_ABOVE * _POINTS_PER_DECADE + 1)[1:]
        )
    else:
        beyond = top * (1 - _NEAR_NYQUIST)
    return np.unique(np.concatenate([omega, *far, beyond[beyond > high]])).tolist()


_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="generator" content="robust: page to shape a loop in">
<meta http-equiv="Content-Security-Policy"
 content="default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:">
<title>{title}</title>
<style>
{style}
</style>
</head>
<body class="shaping-sheet">
<main id="shaping"></main>
<noscript>This page computes as you drag: allow it to run its own script. It sends nothing to anybody.</noscript>
<script type="application/json" id="content">{content}</script>
<script type="module">
{script}
globalThis.shaping = start(document.getElementById("shaping"), JSON.parse(document.getElementById("content").text));
</script>
</body>
</html>
"""


def write_shaping_page(
    path: str | os.PathLike[str],
    model: UncertaintyModel | Sequence[UncertaintyModel],
    *,
    w_P: Weight | None = None,
    K: Controller | None = None,
    dt: float = 0.0,
    delay: float = 0.0,
    title: str = "Shape a loop",
) -> None:
    """Write an interactive page on which a loop is shaped by hand.

    Use this to design a controller by eye, or to change one: drag gain, integrator, lead, notch and
    roll-off in the plot of |L|. The page is one HTML file that runs in any browser, needs no server
    and sends no request. It shows |L| with its bounds, the Nyquist plot with the discs of the set,
    the measures rs and rp of robust stability and performance, S, T, the step response and a
    verdict *on a frequency grid*, for several models at once. It also shows the PID gains, Python
    code of the controller, and the command that proves the loop. The page itself proves nothing.

    Parameters
    ----------
    path : path
        The ``.html`` file; written whole or not at all.
    model : UncertaintyModel or list of them
        The uncertainty model, or one model for each level.
    w_P : control.StateSpace or TransferFunction, optional
        Performance weight.
    K : control.StateSpace, TransferFunction or float, optional
        Controller at the start, which is multiplied by the elements that you drag. The default is a
        gain, with integrator, lead and roll-off if the plant needs them. Its crossover is near the
        frequency with |w_P| = 1; without w_P, near half the frequency at which the radius of the
        set reaches |G|.
    dt : float
        Sampling time [s] of the controller. 0: sampling time of K or of a sampled model, otherwise
        a continuous controller.
    delay : float
        Computation delay [s], as in `check`.
    title : str
        Heading.

    Raises
    ------
    ValueError
        A path that does not end in .html, a model without a parametric nominal, a form that the
        page cannot compute, or sampling times that differ.
    FileNotFoundError
        A folder that does not exist.

    References
    ----------
    SP 2.6 (loop shaping), 7.5 and 7.6 (rs and rp).

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import control
    >>> import numpy as np
    >>> from robust import UncertaintyModel
    >>> G, w = control.tf([1], [1, 1]), control.tf([0.2], [1])
    >>> model = UncertaintyModel(G, w, "multiplicative", np.array([1.0, 2.0]), np.array([0.1, 0.2]))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_shaping_page(Path(folder, "shape.html"), model, delay=0.1)
    ...     text = Path(folder, "shape.html").read_text(encoding="utf-8")
    >>> "default-src 'none'" in text, "src=" in text          # the page may not load anything, and does not
    (True, False)
    """
    path = page_path(path)
    write_text(
        path,
        page_text(
            page_content(model, w_P=w_P, K=K, dt=dt, delay=delay, sources=PartSources(title=title))
        ),
    )


def page_text(content: JsonObject) -> str:
    """Return the page, as text."""
    # "<" cannot end the script element that holds the content
    text = json.dumps(content, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    return _PAGE.format(
        title=escape(content["title"]), style=read_style(), content=text, script=read_script()
    )


def read_script() -> str:
    """Return the JavaScript of page and notebook, with the entry point `start(element, content,
    changed)`.
    """
    return "\n".join(
        _read_part(name) for name in ("uplot/uPlot.iife.min.js", "arithmetic.js", "view.js")
    )


def read_style() -> str:
    """Return the style sheet of the page."""
    return "\n".join(_read_part(name) for name in ("uplot/uPlot.min.css", "shape.css"))


def _read_part(name: str) -> str:
    """Return a file of this package, with closing tags escaped, which would end the element around
    it.
    """
    text = files("robust.reports.shaping_page").joinpath(name).read_text(encoding="utf-8")
    return text.replace("</script", "<\\/script").replace("</style", "<\\/style")
