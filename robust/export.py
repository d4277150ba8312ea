"""Models and controllers to and from files: JSON with a versioned schema, exact to the bit; MATLAB; sections.

A number is written with the digits that give it back exactly; a complex one as [re, im]; nan as null, infinities as
strings. A file is written whole or not at all.
"""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import Any

import control
import numpy as np
from scipy.io import savemat
from scipy.signal import sosfreqz

from nlfrf.checks import shown
from nlfrf.files import write_whole
from robust.lti import on_axis, paired, poles, response, state_space, timebase, zeros
from robust.radius import PARTS
from robust.rational import in_order
from robust.uncertainty import UncertaintyModel

MODEL_SCHEMA, CONTROLLER_SCHEMA = "robust-model", "robust-controller"
VERSION = 1
PathLike = str | os.PathLike[str]


def save_model(model: UncertaintyModel, path: PathLike) -> None:
    """Write an uncertainty model to a ``.json`` file.

    Parameters
    ----------
    model : UncertaintyModel
        The model.
    path : path
        File to write.

    Raises
    ------
    ValueError
        Anything that is not an UncertaintyModel.
    FileNotFoundError
        A folder that does not exist.

    Examples
    --------
    >>> import tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> G, w = control.tf([1], [1, 1]), control.tf([0.2], [1])
    >>> model = UncertaintyModel(G, w, "multiplicative", np.array([1.0, 2.0]), np.array([0.1, 0.2]))
    >>> save_model(model, f"{folder.name}/model.json")
    >>> bool(np.array_equal(load_model(f"{folder.name}/model.json").radius, model.radius))
    True
    >>> folder.cleanup()
    """
    if not isinstance(model, UncertaintyModel):
        raise ValueError(f"model must be an UncertaintyModel, got {shown(model)}")
    content: dict[str, Any] = {
        "schema": MODEL_SCHEMA,
        "version": VERSION,
        "units": {"omega": "rad/s", "delay": "s", "dt": "s"},
        "nominal": encoded_system(model.nominal),
        "weight": encoded_system(model.weight),
        "form": model.form,
        "perturbation": model.perturbation,
        "confidence": encoded(model.confidence),
        "simultaneous": model.simultaneous,
        "omega": encoded(model.omega),
        "radius": encoded(model.radius),
        "delay": encoded(model.delay),
        "extrapolation": model.extrapolation,
        "source": model.source,
    }
    content |= {f"radius_{name}": encoded(getattr(model, f"radius_{name}")) for name in PARTS}
    written(content, path)


def load_model(path: PathLike) -> UncertaintyModel:
    """Read an uncertainty model back from a ``.json`` file.

    Parameters
    ----------
    path : path
        A file that `save_model` wrote.

    Returns
    -------
    UncertaintyModel

    Raises
    ------
    ValueError
        A file that is not such a model, is truncated, or has a newer version.
    FileNotFoundError
        No such file.

    Examples
    --------
    >>> load_model("nothing.json")
    Traceback (most recent call last):
        ...
    FileNotFoundError: [Errno 2] No such file or directory: 'nothing.json'
    """
    content = read(path, MODEL_SCHEMA)
    try:
        return UncertaintyModel(
            nominal=decoded_system(content["nominal"]),
            weight=decoded_system(content["weight"]),
            form=content["form"],
            omega=decoded(content["omega"]),
            radius=decoded(content["radius"]),
            confidence=float(decoded(content["confidence"])),
            perturbation=content["perturbation"],
            simultaneous=yes_or_no("simultaneous", content["simultaneous"]),
            delay=float(decoded(content["delay"])),
            extrapolation=str(content["extrapolation"]),
            source=str(content["source"]),
            **{f"radius_{name}": decoded(content[f"radius_{name}"]) for name in PARTS},
        )
    except (KeyError, TypeError, IndexError) as error:
        raise damaged(MODEL_SCHEMA, path, error) from None


def save_controller(K: Any, path: PathLike) -> None:
    """Write a controller to a ``.json`` file.

    Parameters
    ----------
    K : control.StateSpace, TransferFunction or float
        Controller, negative feedback.
    path : path
        File to write.

    Raises
    ------
    ValueError
        Several inputs or outputs, or anything that is no controller.
    FileNotFoundError
        A folder that does not exist.

    Examples
    --------
    >>> import tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> save_controller(control.tf([1, -0.5], [1, -0.9], 0.01), f"{folder.name}/K.json")
    >>> load_controller(f"{folder.name}/K.json").dt
    0.01
    >>> folder.cleanup()
    """
    K = state_space("K", K)
    content = {
        "schema": CONTROLLER_SCHEMA,
        "version": VERSION,
        "units": {"dt": "s"},
        "feedback": "negative: u = K (r - y)",
        "K": encoded_system(K),
    }
    if K.dt:
        content["sections"] = encoded(controller_sections(K))
    written(content, path)


def load_controller(path: PathLike) -> control.StateSpace:
    """Read a controller back from a ``.json`` file.

    Parameters
    ----------
    path : path
        A file that `save_controller` wrote.

    Returns
    -------
    control.StateSpace

    Raises
    ------
    ValueError
        A file that is not a controller, or is truncated.
    FileNotFoundError
        No such file.

    Examples
    --------
    >>> load_controller("nothing.json")
    Traceback (most recent call last):
        ...
    FileNotFoundError: [Errno 2] No such file or directory: 'nothing.json'
    """
    content = read(path, CONTROLLER_SCHEMA)
    try:
        return state_space("K", decoded_system(content["K"]))
    except (KeyError, TypeError, IndexError) as error:
        raise damaged(CONTROLLER_SCHEMA, path, error) from None


def controller_sections(K: Any) -> np.ndarray:
    """A discrete controller as second-order sections, the form in which it runs on a target.

    Parameters
    ----------
    K : control.StateSpace or TransferFunction
        Discrete controller.

    Returns
    -------
    (n, 6) ndarray
        Rows b0 b1 b2 1 a1 a2, run one after the other: y = b0 u + b1 u[k-1] + ... - a1 y[k-1] - a2 y[k-2].

    Raises
    ------
    ValueError
        A continuous controller, or one whose sections do not reproduce its response.

    Examples
    --------
    >>> controller_sections(control.tf([1, -0.5], [1, -0.9], 0.01)).tolist()
    [[1.0, -0.5, 0.0, 1.0, -0.9, 0.0]]
    """
    K = state_space("K", K)
    dt = timebase(K)
    if not dt:
        raise ValueError("K must be discrete to have sections, got a continuous controller: sample it first")
    z, p, gain = roots_and_gain(K)
    sections = chained(z, p, gain)
    angles = np.geomspace(1e-2, 0.99 * np.pi, 60)
    wanted = response(K, angles / dt)
    error = np.abs(sosfreqz(sections, worN=angles)[1] - wanted) / np.maximum(np.abs(wanted), 1e-300)
    if not error.max() < 1e-6:
        raise ValueError(f"K must be a system whose roots make sections of it, got an error of {error.max():.2g}")
    return sections


def chained(z: np.ndarray, p: np.ndarray, gain: float) -> np.ndarray:
    """(n, 6) sections in z^-1: poles nearest the circle last, each with the zeros nearest to them."""
    pole_pairs, pole_rest = paired(p)
    zero_pairs, zero_rest = paired(z)
    groups: list[tuple[complex, ...]] = [*pole_pairs, *((r,) for r in pole_rest)]
    free: list[tuple[complex, ...]] = [*zero_pairs, *((r,) for r in zero_rest)]
    rows = []
    for group in sorted(groups, key=lambda g: abs(abs(g[0]) - 1)):
        mine: tuple[complex, ...] = ()
        fitting = [zs for zs in free if len(zs) <= len(group)]
        # pairs of zeros must all find a pair of poles
        if len(group) == 2 and any(len(zs) == 2 for zs in free):
            fitting = [zs for zs in fitting if len(zs) == 2]
        if fitting:
            mine = min(fitting, key=lambda zs: abs(zs[0] - group[0]))
            free.remove(mine)
        top = np.concatenate([np.zeros(len(group) - len(mine)), np.poly(mine).real if mine else [1.0]])
        rows.append([*top, *np.zeros(3 - top.size), *np.poly(group).real, *np.zeros(2 - len(group))])
    rows = rows[::-1] or [[1.0, 0.0, 0.0, 1.0, 0.0, 0.0]]
    sections = np.array(rows)
    sections[0, :3] *= gain
    return sections


def export_matlab(content: Any, path: PathLike) -> None:
    """Write a model or a controller for MATLAB: a ``.mat`` file of plain structs and a ``.m`` file that loads it.

    The loader makes `ss`, `frd` and, for a model, the uncertain plant with `ultidyn` (Robust Control Toolbox).

    Parameters
    ----------
    content : UncertaintyModel, or a controller
        What to write.
    path : path
        The ``.mat`` file; the loader is ``load_<name>.m`` beside it.

    Raises
    ------
    ValueError
        A path that does not end in .mat.
    FileNotFoundError
        A folder that does not exist.

    Examples
    --------
    >>> import tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> export_matlab(control.tf([1, -0.5], [1, -0.9], 0.01), f"{folder.name}/K.mat")
    >>> sorted(os.listdir(folder.name))
    ['K.mat', 'load_K.m']
    >>> folder.cleanup()
    """
    path = Path(path)
    if path.suffix != ".mat":
        raise ValueError(f"path must end in .mat, got {str(path)!r}")
    name = re.sub(r"\W", "_", path.stem)
    if isinstance(content, UncertaintyModel):
        struct, loader = model_struct(content), MODEL_LOADER
    else:
        K = state_space("content", content)
        struct, loader = {"kind": CONTROLLER_SCHEMA, "K": matlab_system(K)}, CONTROLLER_LOADER
        if K.dt:
            struct["sections"] = controller_sections(K)

    def write_mat(beside: Path) -> None:
        savemat(beside, {"content": struct}, oned_as="column")

    def write_loader(beside: Path) -> None:
        text = loader.replace("NAME", f"load_{name}").replace("FILE", path.name)
        beside.write_text(text, encoding="utf-8")

    write_whole(path, write_mat)
    write_whole(path.with_name(f"load_{name}.m"), write_loader)


def model_struct(model: UncertaintyModel) -> dict[str, Any]:
    """A model as a struct of numbers and text."""
    struct = {
        "kind": MODEL_SCHEMA,
        "freq": model.omega,
        "freq_unit": "rad/s",
        "response": model.at(model.omega),
        "radius": model.radius,
        "weight": matlab_system(model.weight),
        "Ts": timebase(model.weight),
        "form": model.form,
        "class": model.perturbation,
        "confidence": model.confidence,
        "simultaneous": model.simultaneous,
        "delay": model.delay,
        "extrapolation": model.extrapolation,
        "source": model.source,
    }
    struct |= {f"radius_{part}": getattr(model, f"radius_{part}") for part in PARTS}
    if not model.measured_only:
        struct["nominal"] = matlab_system(model.nominal)
    return struct


def matlab_system(system: control.StateSpace) -> dict[str, Any]:
    """A system as a struct: A, B, C, D, num, den, Ts."""
    z, p, gain = roots_and_gain(system)
    return {m: np.asarray(getattr(system, m), dtype=float) for m in "ABCD"} | {
        "num": gain * np.poly(z).real,
        "den": np.poly(p).real,
        "Ts": timebase(system),
    }


def roots_and_gain(system: control.StateSpace) -> tuple[np.ndarray, np.ndarray, float]:
    """Zeros, poles and gain, the gain fitted where the response is neither very large nor very small."""
    z, p, dt = in_order(zeros(system)), in_order(poles(system)), timebase(system)
    size = np.concatenate([np.abs(np.log(r[r != 0].astype(complex)) / dt if dt else r) for r in (z, p)])
    centre = float(np.exp(np.median(np.log(size[size > 0])))) if np.any(size > 0) else 1.0
    omega = centre * np.geomspace(0.1, 10, 21)
    omega = np.minimum(omega, 0.99 * np.pi / dt) if dt else omega
    s = on_axis(omega, dt)
    ratio = response(system, omega) * np.prod(s[:, None] - p, axis=1) / np.prod(s[:, None] - z, axis=1)
    return z, p, float(np.median(ratio.real))


MODEL_LOADER = """function [Gu, G, W, model] = NAME(file)
%NAME  Uncertain plant from FILE (frequencies in rad/s, times in s).
%   Gu     the uncertain plant: nominal, weight and ultidyn('Delta', [1 1])
%   G, W   nominal (ss where there is one, else frd) and weight
%   model  everything that was written, as a struct
if nargin < 1
    file = fullfile(fileparts(mfilename('fullpath')), 'FILE');
end
data = load(file);
model = data.content;
w = model.weight;
W = ss(w.A, w.B, w.C, w.D, w.Ts);
if isfield(model, 'nominal')
    n = model.nominal;
    G = ss(n.A, n.B, n.C, n.D, n.Ts);
else
    G = frd(reshape(model.response, 1, 1, []), model.freq, model.Ts);
end
Delta = ultidyn('Delta', [1 1]);
switch model.form
    case 'multiplicative'
        Gu = G * (1 + W * Delta);
    case 'additive'
        Gu = G + W * Delta;
    case 'inverse-multiplicative'
        Gu = G * feedback(1, W * Delta);
    case 'inverse-additive'
        Gu = feedback(G, W * Delta);
end
end
"""

CONTROLLER_LOADER = """function [K, content] = NAME(file)
%NAME  Controller from FILE, negative feedback u = K (r - y).
%   K        ss
%   content  everything that was written; content.sections for sosfilt where it is discrete
if nargin < 1
    file = fullfile(fileparts(mfilename('fullpath')), 'FILE');
end
data = load(file);
content = data.content;
k = content.K;
K = ss(k.A, k.B, k.C, k.D, k.Ts);
end
"""


def encoded(numbers: Any) -> Any:
    """Numbers as JSON holds them."""
    array = np.asarray(numbers)
    if array.ndim:
        return [encoded(item) for item in array]
    if array.dtype.kind == "c":
        return [encoded(array.real), encoded(array.imag)]
    number = float(array)
    return number if np.isfinite(number) else None if np.isnan(number) else ("inf" if number > 0 else "-inf")


def decoded(content: Any) -> Any:
    """The way back, for real numbers: float, or float arrays."""
    try:
        if isinstance(content, list):
            return np.array([decoded(item) for item in content], dtype=float)
        return np.nan if content is None else float(content)
    except ValueError:
        raise ValueError(f"path must hold numbers where its schema has them, got {shown(content)}") from None


def encoded_system(system: Any) -> dict[str, Any]:
    """A state space or an FRF."""
    dt = None if system.dt is None else float(system.dt)
    if isinstance(system, control.FrequencyResponseData):
        return {"kind": "frf", "omega": encoded(system.omega), "G": encoded(system.frdata[0, 0]), "dt": dt}
    return {"kind": "ss", "dt": dt, **{name: encoded(getattr(system, name)) for name in "ABCD"}}


def yes_or_no(name: str, content: Any) -> bool:
    """A truth value: not whatever else counts as one."""
    if not isinstance(content, bool):
        raise ValueError(f"path must hold true or false for {name}, got {shown(content)}")
    return content


def damaged(schema: str, path: PathLike, error: Exception) -> ValueError:
    """The refusal of a file that says what it is but is not whole."""
    lacks = f"without {error}" if isinstance(error, KeyError) else "with other things where its numbers and systems are"
    return ValueError(f"path must hold a whole {schema} file, got {path} {lacks}")


def decoded_system(content: dict[str, Any]) -> Any:
    """The way back; an empty A, B or C takes its shape from the others."""
    if content["kind"] not in ("ss", "frf"):
        raise ValueError(f'path must hold systems of the kind "ss" or "frf", got {shown(content["kind"])}')
    if content["kind"] == "frf":
        pairs = decoded(content["G"])
        return control.FrequencyResponseData(pairs[:, 0] + 1j * pairs[:, 1], decoded(content["omega"]), content["dt"])
    D = np.atleast_2d(decoded(content["D"]))
    n = len(content["A"])
    shapes = {"A": (n, n), "B": (n, D.shape[1]), "C": (D.shape[0], n)}
    A, B, C = (np.reshape(decoded(content[name]), shape) for name, shape in shapes.items())
    return control.StateSpace(A, B, C, D, content["dt"])


def written(content: dict[str, Any], path: PathLike) -> None:
    """The JSON file, whole or not at all."""
    text = json.dumps(content, indent=1, allow_nan=False) + "\n"

    def write(temporary: Path) -> None:
        temporary.write_text(text, encoding="utf-8")

    write_whole(path, write)


def parsed(path: PathLike) -> Any:
    """What a JSON file holds, or a refusal."""
    text = Path(path).read_text(encoding="utf-8", errors="replace")
    try:
        return json.loads(text)
    except (json.JSONDecodeError, RecursionError) as error:
        raise ValueError(f"path must be a whole JSON file, got {path}: {error}") from None


def holds_model(path: PathLike) -> bool:
    """Whether a JSON file says that it is a model."""
    content = parsed(path)
    return isinstance(content, dict) and content.get("schema") == MODEL_SCHEMA


def read(path: PathLike, schema: str) -> dict[str, Any]:
    """The content of a JSON file of that schema, or a refusal."""
    content = parsed(path)
    if not isinstance(content, dict) or content.get("schema") != schema:
        found = content.get("schema") if isinstance(content, dict) else type(content).__name__
        raise ValueError(f"path must hold a {schema} file, got {path} with schema {found!r}")
    if content.get("version") != VERSION:
        raise ValueError(
            f"path must hold version {VERSION} of {schema}, got {path} with version {content.get('version')}"
        )
    return content
