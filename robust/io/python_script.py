"""A model as a Python script that needs numpy and python-control only."""

from __future__ import annotations

import re

import control
import numpy as np

from nlfrf._base.arguments import one_line, require_kind
from nlfrf._base.files import command_signature, to_path, write_text
from robust.io.models import PathLike
from robust.lti.connections import in_series
from robust.lti.lti import timebase
from robust.models.sets.coprime import factor_systems
from robust.models.sets.forms import ADDITIVE, BLOCK_FORMS, ELEMENTS, FORMS
from robust.models.sets.model import UncertaintyModel, require_parametric


def export_python(model: UncertaintyModel, path: PathLike) -> None:
    """Write a model as a Python script that needs python-control and not this package.

    The script contains the nominal and the weights. It computes the plant of the set for any
    perturbation, draws plants at random, and tries a controller on them. Such a trial is not a
    proof; `robust.check` gives proofs.

    Parameters
    ----------
    model : UncertaintyModel
        Model with a parametric nominal, continuous or sampled, with one or several channels and any
        form.
    path : path
        The ``.py`` file.

    Raises
    ------
    ValueError
        A path that does not end in .py, a nominal that is an FRF.

    References
    ----------
    SP 7.4, 7.5 and 8.2.

    Examples
    --------
    >>> import os, runpy, tempfile
    >>> omega = np.array([1.0, 2.0])
    >>> model = UncertaintyModel(control.tf([1], [1, 1]), 0.2, "multiplicative", omega, np.full(2, 0.2))
    >>> folder = tempfile.TemporaryDirectory()
    >>> path = os.path.join(folder.name, "plant.py")
    >>> export_python(model, path)
    >>> script = runpy.run_path(path)
    >>> float(script["plant"](1.0).dcgain()), float(script["rs"](2.0, [1.0])[0].round(4))     # 0.2 |2/(3 + j)|
    (1.2, 0.1265)
    >>> folder.cleanup()
    """
    require_kind("model", model, UncertaintyModel)
    path = to_path(path)
    if path.suffix.lower() != ".py":
        raise ValueError(f"path must end in .py, got {str(path)!r}")
    require_parametric(model, "to be written as a script")
    dt, single, elements = timebase(model.nominal), model.is_single, model.form == ELEMENTS
    systems = {"G": model.nominal}
    if single:
        systems["W"] = model.weight
        row = FORMS[model.form]
        formula, measure = row.matlab_expression, row.python_measure
        if model.scaling:
            factors = factor_systems(in_series(model.nominal, model.shaping))
            systems |= {"Ws": model.shaping, "N": factors[0], "M": factors[1]}
    else:
        sides = dict(zip(("Wl", "Wr"), model.side_weights(), strict=True))
        if (
            elements
        ):  # column after column: Delta reads an input, and its output is added to a plant output
            reads = np.repeat(np.eye(model.n_inputs), model.n_outputs, axis=0)
            adds = np.tile(np.eye(model.n_outputs), model.n_inputs)
            through = (control.StateSpace([], [], [], D, dt) for D in (reads, adds))
            sides = {"Wr": in_series(next(through), sides["Wr"]), "Wl": next(through)}
        systems |= sides
        block = BLOCK_FORMS[ADDITIVE if elements else model.form]
        formula = block.matlab_expression
        measure = f"np.linalg.norm(Wr @ ({block.python_measure}) @ Wl, 2)"
    # the MATLAB expression, except for its row vectors and quotients
    formula = formula.replace("[1 0] * Delta", "Delta[0, 0]").replace(
        "[0 1] * Delta", "Delta[1, 0]"
    )
    formula = formula.replace(") / (", ") * inverse(").replace(" / Ws", " * inverse(Ws)")
    if model.scaling:
        shape = 2, 1
    else:
        shape = 1, 1
    if not single:
        if elements:
            shape = (model.n_outputs * model.n_inputs,) * 2
        else:
            shape = model.structure[0][::-1]
    parts = {
        "TITLE": one_line(str(model)).replace('"', "'").replace("\\", "/"),
        "CLOCK": f"sampled every {dt:g} s" if dt else "continuous",
        "UNIT": one_line(model.origin.unit).replace('"', "'").replace("\\", "/") or "not known",
        "SIGNATURE": command_signature("robust export"),
        "SYSTEMS": "\n".join(_system_text(name, system) for name, system in systems.items()),
        "NAMES": ", ".join(systems),
        "FORMULA": formula,
        "SHAPE": repr(shape),
        "ONE": repr(elements),
        "BAND": repr((float(model.omega[0]), float(model.omega[-1]))),
        "TIME": repr(dt),
        "INDEX": "[0, 0]" * single,
        "SENSITIVITY": "" if single else "\n    S = np.linalg.inv(np.eye(len(G)) + G @ K)",
        "MEASURE": measure,
        "NOTE": "An upper bound: each entry has a Delta of its own" if elements else "Exact",
    }
    write_text(path, re.sub("@([A-Z]+)@", lambda found: parts[found[1]], _TEMPLATE))


def _system_text(name: str, system: control.StateSpace) -> str:
    """Return a system as a statement, exact to the bit."""
    matrices = [
        getattr(system, key).tolist() if system.nstates or key == "D" else [] for key in "ABCD"
    ]
    return f"{name} = control.ss({', '.join(map(repr, matrices))}, DT)"


_TEMPLATE = '''"""A set of plants for python-control, @CLOCK@; frequencies in rad/s, times in s, unit of G: @UNIT@.

@TITLE@

    G        nominal plant
    plant    the plant of a perturbation: @FORMULA@, for any stable Delta of gain at most one
    draw     perturbations at random
    rs       the measure of robust stability: if it is below one at all frequencies, and the loop with G is stable, then
             the loop is stable with every plant
    try_loop closed loops of random plants with a controller. It proves nothing: other plants may be unstable

@SIGNATURE@
"""

import control
import numpy as np
from control import feedback

DT = @TIME@  # sampling time [s]; 0: continuous
BAND = @BAND@  # of the measurement [rad/s]
SHAPE = @SHAPE@  # of Delta: outputs, inputs
DIAGONAL = @ONE@  # each entry has a Delta of its own
@SYSTEMS@


def gain(D):
    """Return a constant as a system; return a system unchanged."""
    return D if isinstance(D, control.lti.LTI) else control.ss([], [], [], np.atleast_2d(D), DT)


def eye(n):
    """Return the identity for n signals."""
    return gain(np.eye(n))


def inverse(X):
    """Return 1 / X for a direct term that is not zero."""
    D = np.linalg.inv(X.D)
    return control.ss(X.A - X.B @ D @ X.C, X.B @ D, -D @ X.C, D, DT)


def plant(Delta):
    """Return the plant of a perturbation: a system or a matrix of the size SHAPE, of gain at most one."""
    Delta = gain(Delta)
    ny, nu = G.noutputs, G.ninputs
    return @FORMULA@


def all_pass(rng):
    """Return a stable system of gain one at every frequency."""
    found = gain(rng.choice([-1.0, 1.0]))
    for a in np.exp(rng.uniform(*np.log(BAND), rng.integers(1, 4))):
        p = np.exp(-a * DT) if DT else -a
        found = found * (control.ss(p, 1.0, 1 - p**2, -p, DT) if DT else control.ss(p, 1.0, 2 * p, 1.0))
    return found


def draw(rng):
    """Return a perturbation of gain one: an all-pass for each direction."""
    passes = control.append(*(all_pass(rng) for _ in range(min(SHAPE))))
    if DIAGONAL:
        return passes
    left, right = (np.linalg.qr(rng.normal(size=(n, n)))[0][:, : min(SHAPE)] for n in SHAPE)
    return gain(left) * passes * gain(right.T)


def measure(K, @NAMES@):
    """Return the measure of robust stability from responses at one frequency. @NOTE@."""@SENSITIVITY@
    return @MEASURE@


def rs(K, omega):
    """Return (W,) the measure at frequencies omega [rad/s] of the loop u = K (r - y)."""
    z = np.exp(1j * np.asarray(omega) * DT) if DT else 1j * np.asarray(omega)
    systems = (gain(K), @NAMES@)
    return np.array([measure(*(np.atleast_2d(system(point))@INDEX@ for system in systems)) for point in z])


def try_loop(K, n=100, seed=0):
    """Return how many of n closed loops are stable: each a plant of the set with u = K (r - y)."""
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(n):
        p = feedback(plant(draw(rng)) * gain(K), eye(G.noutputs)).poles()
        found.append(bool(np.all(np.abs(p) < 1) if DT else np.all(p.real < 0)))
    return sum(found)


if __name__ == "__main__":
    K = gain(np.zeros((G.ninputs, G.noutputs)))  # your controller
    omega = np.geomspace(*BAND, 200)
    print(f"rs at most {rs(K, omega).max():.3g}; {try_loop(K)} of 100 closed loops are stable")
'''
