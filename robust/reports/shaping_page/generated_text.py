"""Generated texts of the page: Python code, and the command that proves the loop."""

from __future__ import annotations

import shlex
from collections.abc import Sequence

import control

from nlfrf._base.values import value
from robust.models.sets.model import UncertaintyModel

#: Marker that the page replaces by the shaped controller.
_PLACE_OF_K = "# shaped"


@value
class PartSources:
    """Names and files of models and controller for the texts of the page; empty if they are not
    from files.

    demand, options : the demand in Python, and as options of the command. title : heading of the
    page.
    """

    names: tuple[str, ...] = ()
    files: tuple[str, ...] = ()
    controller: str = ""
    demand: str = ""
    options: str = ""
    title: str = "Shape a loop"


def python_script(
    sources: PartSources,
    models: Sequence[UncertaintyModel],
    *,
    w_P: control.StateSpace | None,
    K: control.StateSpace,
    dt: float,
    delay: float,
) -> str:
    """Return a script that loads the models, has a marker for the controller, checks each model and
    saves K.
    """
    files = sources.files or tuple(
        f"model{k + 1 if len(models) > 1 else ''}.json" for k in range(len(models))
    )
    several = len(files) > 1
    rows = ["import control", "import numpy as np", "import robust", ""]
    if not sources.files:
        rows.append(
            "# or use the model in memory"
            + " itself" * (not several)
            + "; robust.save writes such a file"
        )
    if several:
        rows.append(f"models = [robust.load(path) for path in {list(files)!r}]")
    else:
        rows.append(f"model = robust.load({files[0]!r})")
    if w_P is not None:
        rows.append(f"w_P = {sources.demand or _state_space_literal(w_P)}")
    rows += [f"dt = {dt!r}", _starting_controller(sources, K), _PLACE_OF_K, ""]
    arguments = ", w_P=w_P" * (w_P is not None) + (f", delay={delay!r}" if delay else "")
    check = f"print(robust.check(model, K{arguments}))"
    rows += ["for model in models:", f"    {check}"] if several else [check]
    if dt or delay:
        stored = f", delay={delay!r}"
    else:
        stored = ""
    return "\n".join([*rows, f'robust.save(K, "controller.json"{stored})', ""])


def _starting_controller(sources: PartSources, K: control.StateSpace) -> str:
    """Return the Python of the controller at the start."""
    if sources.controller:
        return f"K = robust.load({sources.controller!r})"
    return "K = " + (
        _state_space_literal(K)
        if K.nstates
        else f"control.ss([], [], [], [[{float(K.D[0, 0])!r}]], dt)"
    )


def _state_space_literal(system: control.StateSpace) -> str:
    """Return the Python of a state space, with every digit."""
    matrices = ", ".join(repr(getattr(system, name).tolist()) for name in "ABCD")
    return f"control.ss({matrices}, {0 if system.dt is None else system.dt!r})"


def proof_commands(sources: PartSources, w_P: control.StateSpace | None, delay: float) -> list[str]:
    """Return the commands that prove the loop, one for each model; none if models or demand are not
    from files.
    """
    if not sources.files or (w_P is not None and not sources.options):
        return []
    arguments = f" {sources.options}" * bool(sources.options) + (
        f" --delay {delay:g}" if delay else ""
    )
    return [
        f"robust check {shlex.quote(file)} controller.json{arguments}" for file in sources.files
    ]
