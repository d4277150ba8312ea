"""Models, controllers and proofs for MATLAB: a file of plain structs, and a loader for it."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import singledispatch
from pathlib import Path
from typing import TypeAlias

import control
import numpy as np
from scipy.io import savemat

from nlfrf._base.arguments import one_line
from nlfrf._base.files import (
    Role,
    command_signature,
    require_writable,
    to_path,
    write_atomically,
    write_text,
)
from robust._base.types import Controller
from robust.analysis.report import RobustnessReport
from robust.io.biquads import sections_by_name, transfer_polynomials
from robust.io.models import CONTROLLER_SCHEMA, MATRIX_SCHEMA, MODEL_SCHEMA, PathLike, as_controller
from robust.lti.connections import in_series
from robust.lti.lti import response, timebase
from robust.models.sets.coprime import factor_systems
from robust.models.sets.forms import BLOCK_FORMS, ELEMENTS, FORMS, Form, MatrixForm
from robust.models.sets.model import UncertaintyModel
from robust.models.sets.records import JointProbability
from robust.proofs.exact.channel_files import ChannelsClaim
from robust.proofs.exact.interval_kyp import IntervalClaim
from robust.proofs.exact.scaled_kyp import ScaledClaim, place_scalings
from robust.proofs.search.certificate import GENERALISED_KYP, SCALED_KYP


def export_matlab(
    content: UncertaintyModel | RobustnessReport | ChannelsClaim | Controller, path: PathLike
) -> None:
    """Write a model, a controller or a proof for MATLAB: a ``.mat`` and a ``.m`` that loads it.

    Use this to continue in MATLAB, or to check a proof there.

    The ``.mat`` contains plain structs. The loader makes `ss` and `frd` objects and, for a model,
    the uncertain plant with `ultidyn` (Robust Control Toolbox). For a proof the loader assembles
    the linear matrix inequality and returns its largest eigenvalue, which has to be negative.
    Warnings are in the field `warnings` of the struct and at the end of the loader.

    Parameters
    ----------
    content : UncertaintyModel, RobustnessReport or a controller
        Content to write. Of a report, the proofs by "scaled KYP" and "generalised KYP" are written
        with their loop: P and the scalings, and Q for each frequency interval.
    path : path
        The ``.mat`` file; the loader is ``load_<name>.m`` in the same folder.

    Raises
    ------
    ValueError
        A path that does not end in .mat; a file that has the name of the loader but is not a
        loader; a report without a proof.
    FileNotFoundError
        A folder that does not exist.

    Warns
    -----
    DataWarning
        The second-order sections of a sampled controller deviate by more than 0.1 %; the file then
        contains A, B, C and D only.

    Examples
    --------
    >>> import os, tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> export_matlab(control.tf([1, -0.5], [1, -0.9], 0.01), f"{folder.name}/K.mat")
    >>> sorted(os.listdir(folder.name))
    ['K.mat', 'load_K.m']
    >>> folder.cleanup()
    """
    path = to_path(path)
    if path.suffix != ".mat":
        raise ValueError(f"path must end in .mat, got {str(path)!r}")
    name = re.sub(
        r"\W", "_", path.stem, flags=re.ASCII
    )  # only characters allowed in the name of a MATLAB function
    struct, script = _struct_and_loader(content)
    warned = getattr(content, "warnings", ())
    struct |= {"warnings": _cell_array(list(warned))} if warned else {}
    loader = path.with_name(f"load_{name}.m")
    require_writable(loader, role=Role.DERIVED)  # before the first of two files is written

    def write_mat(temporary: Path) -> None:
        savemat(temporary, {"content": struct}, oned_as="column")

    write_atomically(path, write_mat)
    replacements = {
        "NAME": f"load_{name}",
        "'FILE'": "'{}'".format(path.name.replace("'", "''")),
        "FILE": path.name,
    }
    text = (
        re.sub("NAME|'FILE'|FILE", lambda found: replacements[found[0]], script)
        + "".join(f"% warning: {one_line(text)}\n" for text in warned)
        + f"% {command_signature('robust export')}\n"
    )
    write_text(loader, text, role=Role.DERIVED)


_StructAndLoader: TypeAlias = "tuple[dict[str, object], str]"


@singledispatch
def _struct_and_loader(content: Controller) -> _StructAndLoader:
    """Return the struct of a content, and the script that loads it."""
    K = as_controller("content", content)
    struct: dict[str, object] = {
        "kind": CONTROLLER_SCHEMA,
        "K": _matlab_system(K),
        **sections_by_name(K),
    }
    return struct, _CONTROLLER_LOADER


@_struct_and_loader.register(RobustnessReport)
def _report_and_loader(content: RobustnessReport) -> _StructAndLoader:
    held = {c.subject: c.claim for c in content.proofs.certificates if c.holds}
    return {"kind": ChannelsClaim.SCHEMA, "proofs": _proof_structs(held)}, _PROOF_LOADER


@_struct_and_loader.register(ChannelsClaim)
def _claim_and_loader(content: ChannelsClaim) -> _StructAndLoader:
    return {"kind": ChannelsClaim.SCHEMA, "proofs": _proof_structs(content.claims)}, _PROOF_LOADER


@_struct_and_loader.register(UncertaintyModel)
def _model_and_loader(model: UncertaintyModel) -> _StructAndLoader:
    if model.is_single:
        return _disc_struct(model), _MODEL_LOADER
    struct = _set_struct(MATRIX_SCHEMA, model)
    struct |= {side: _cell_array(list(getattr(model, side))) for side in ("inputs", "outputs")}
    struct |= {
        side: _cell_array(list(map(_matlab_system, getattr(model, side))))
        for side in ("left", "right")
    }
    return struct, _MATRIX_LOADER


def _set_struct(kind: str, model: UncertaintyModel) -> dict[str, object]:
    """Return the part of a struct that models with one channel and with several share."""
    joint = model.joint or JointProbability(frf=np.nan, bla=np.nan)  # an unknown number of MATLAB
    struct: dict[str, object] = {
        "kind": kind,
        "freq": model.omega,
        "freq_unit": "rad/s",
        "class": model.perturbation,
        "Ts": model.dt,
        **{name: getattr(model, name) for name in ("radius", "form", "confidence", "simultaneous")},
        "joint": joint.frf,
        "joint_bla": joint.bla,
        "extrapolation": model.origin.extrapolation,
        "source": model.origin.source,
    }
    if not model.measured_only:
        struct["nominal"] = _matlab_system(model.nominal)
    return struct


def _disc_struct(model: UncertaintyModel) -> dict[str, object]:
    """Return a model with one channel as a struct."""
    struct = _set_struct(MODEL_SCHEMA, model)
    struct |= {
        "Ts": timebase(model.weight),
        "response": model.at(model.omega),
        "weight": _matlab_system(model.weight),
        "delay": model.origin.delay,
    }
    struct |= {f"radius_{name}": part for name, part in model.budget.items()}
    if model.scaling:
        struct |= dict(
            zip(("W1", "W2"), map(_matlab_system, model.scaling), strict=True)
        ) | _coprime_struct(model)
    return struct


def _proof_structs(held: Mapping[str, object]) -> np.ndarray:
    """Return the proofs by P and scalings, one for all frequencies or for each interval, as a cell
    array of structs.
    """
    claims = {
        subject: claim
        for subject, claim in held.items()
        if isinstance(claim, ScaledClaim | IntervalClaim)
    }
    if not claims:
        raise ValueError(
            f"content must hold a proof by {SCALED_KYP} or {GENERALISED_KYP} for MATLAB, got none"
        )
    return _cell_array([_proof_struct(subject, claim) for subject, claim in claims.items()])


def _proof_struct(subject: str, claim: ScaledClaim | IntervalClaim) -> dict[str, object]:
    struct = {"subject": subject, "level": claim.level, "Ts": claim.system.dt}
    struct |= {name: getattr(claim.system, name) for name in "ABCD"}
    if isinstance(claim, ScaledClaim):
        placed = place_scalings(claim.blocks, claim.scalings, claim.skews)
        return struct | {"P": claim.storage} | dict(zip(("X_L", "X_R", "G"), placed, strict=True))

    def in_states(M: np.ndarray) -> np.ndarray:
        found = claim.T.T @ M @ claim.T
        return np.asarray((found + found.conj().T) / 2)

    ends = np.concatenate([[0.0], claim.cuts, [np.inf]])
    pieces = [
        {"P": in_states(piece.P.numbers), "Q": in_states(piece.Q.numbers), "ends": ends[k : k + 2]}
        | dict(zip(("X_L", "X_R", "K"), piece.placed(claim.blocks), strict=True))
        for k, piece in enumerate(claim.pieces)
    ]
    return struct | {"P": in_states(claim.stability), "pieces": _cell_array(pieces)}


def _cell_array(things: Sequence[object]) -> np.ndarray:
    row = np.empty((1, len(things)), dtype=object)
    row[0, :] = things
    return row


def _coprime_struct(model: UncertaintyModel) -> dict[str, object]:
    """Return normalised coprime factors of the scaled plant: systems, or values on the lines."""
    if not model.measured_only:
        return dict(
            zip(
                "NM",
                map(_matlab_system, factor_systems(in_series(model.nominal, model.shaping))),
                strict=True,
            )
        )
    G = model.at(model.omega) * response(model.shaping, model.omega)
    M = 1 / np.sqrt(1 + np.abs(G) ** 2)
    return {"N": G * M, "M": M + 0j}


def _matlab_system(system: control.StateSpace) -> dict[str, object]:
    """Return a system as a struct:

    A, B, C, D, Ts; for one input and output also num and den if accurate.
    """
    struct: dict[str, object] = {m: np.asarray(getattr(system, m), dtype=float) for m in "ABCD"}
    struct["Ts"] = timebase(system)
    if system.ninputs == system.noutputs == 1:
        struct |= transfer_polynomials(system)
    return struct


def _matlab_cases(forms: Mapping[str, Form | MatrixForm]) -> str:
    """Return the cases of a switch over forms, each for the uncertain plant of a form."""
    return "\n".join(
        f"    case '{name}'\n        Gu = {form.matlab_expression};" for name, form in forms.items()
    )


_MODEL_LOADER = """function [Gu, G, W, model] = NAME(file)
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
Delta = ultidyn('Delta', [1 + isfield(model, 'W1'), 1]);
if isfield(model, 'W1')
    Ws = ss(model.W1.A, model.W1.B, model.W1.C, model.W1.D, model.W1.Ts) ...
        * ss(model.W2.A, model.W2.B, model.W2.C, model.W2.D, model.W2.Ts);
    if isstruct(model.N)
        N = ss(model.N.A, model.N.B, model.N.C, model.N.D, model.N.Ts);
        M = ss(model.M.A, model.M.B, model.M.C, model.M.D, model.M.Ts);
    else
        N = frd(reshape(model.N, 1, 1, []), model.freq, model.Ts);
        M = frd(reshape(model.M, 1, 1, []), model.freq, model.Ts);
    end
end
switch model.form
CASES
end
end
""".replace("CASES", _matlab_cases(FORMS))
_MATRIX_LOADER = """function [Gu, G, model] = NAME(file)
%NAME  Uncertain plant with several inputs and outputs from FILE (frequencies in rad/s, times in s).
%   Gu     the uncertain plant: nominal, weights and ultidyn
%   G      nominal, ss
%   model  everything that was written, as a struct
if nargin < 1
    file = fullfile(fileparts(mfilename('fullpath')), 'FILE');
end
data = load(file);
model = data.content;
make = @(s) ss(s.A, s.B, s.C, s.D, model.Ts);
G = make(model.nominal);
ny = size(model.nominal.D, 1);
nu = size(model.nominal.D, 2);
W = cellfun(make, model.right, 'UniformOutput', false);
if strcmp(model.form, ELEMENTS)
    Gu = G;
    for i = 1:nu
        for j = 1:ny
            row = zeros(ny, 1); row(j) = 1;
            column = zeros(1, nu); column(i) = 1;
            Gu = Gu + row * W{(i - 1) * ny + j} * ultidyn(sprintf('Delta%d%d', j, i), [1 1]) * column;
        end
    end
    return
end
Wr = blkdiag(W{:});
V = cellfun(make, model.left, 'UniformOutput', false);
Wl = blkdiag(V{:});
Delta = ultidyn('Delta', [size(Wl, 2), size(Wr, 1)]);
switch model.form
CASES
end
end
""".replace("ELEMENTS", f"'{ELEMENTS}'").replace("CASES", _matlab_cases(BLOCK_FORMS))
_PROOF_LOADER = """function [largest, proofs] = NAME(file)
%NAME  Proofs by P and scalings from FILE.
%   largest  for each proof: largest eigenvalue of its inequalities and of -P, which have to be negative
%            [A'P+PA, PB; B'P, 0] + [C D]'X_L[C D] - [0; I]G[C D] - [C D]'G'[0 I] - level^2 [0 0; 0 X_R]
%            (discrete: first term [A'PA-P, A'PB; B'PA, B'PB]). For a proof with pieces: P shows that A is stable. On
%            each interval [a b] of x, omega or tan(omega Ts/2), f*Pg + g*Pf + (x-a)(b-x)g*Qg replaces the first
%            term, x g = -j f with g = [I 0], f = [A B] (discrete: [A+I B], [A-I B]), and K replaces G
%   proofs   everything that was written, as structs
if nargin < 1
    file = fullfile(fileparts(mfilename('fullpath')), 'FILE');
end
data = load(file);
proofs = data.content.proofs;
largest = zeros(size(proofs));
for k = 1:numel(proofs)
    p = proofs{k};
    n = size(p.A, 1);
    m = size(p.D, 2);
    if p.Ts
        M = [p.A, p.B]' * p.P * [p.A, p.B] - blkdiag(p.P, zeros(m));
        g = [p.A + eye(n), p.B];
        f = [p.A - eye(n), p.B];
    else
        M = [p.A' * p.P + p.P * p.A, p.P * p.B; p.B' * p.P, zeros(m)];
        g = [eye(n), zeros(n, m)];
        f = [p.A, p.B];
    end
    if ~isfield(p, 'pieces')
        M = M + supply(p, p.X_L, p.X_R, p.G);
        largest(k) = max([eig((M + M') / 2); eig(-p.P)]);
        continue
    end
    largest(k) = max([eig(M(1:n, 1:n)); eig(-p.P)]);
    for i = 1:numel(p.pieces)
        q = p.pieces{i};
        a = q.ends(1);
        b = q.ends(2);
        along = (f' * q.Q * g) * 1i / 2;
        along = along + along';
        within = along - a * (g' * q.Q * g);
        if isfinite(b)
            within = (a + b) * along - f' * q.Q * f - a * b * (g' * q.Q * g);
        end
        M = f' * q.P * g + g' * q.P * f + within + supply(p, q.X_L, q.X_R, q.K);
        largest(k) = max([largest(k); real(eig((M + M') / 2)); real(eig(-q.Q))]);
    end
end
end
function M = supply(p, X_L, X_R, G)
n = size(p.A, 1);
m = size(p.D, 2);
CD = [p.C, p.D];
across = [zeros(n, m); eye(m)] * G * CD;
M = CD' * X_L * CD - across - across' - p.level^2 * blkdiag(zeros(n), X_R);
end
"""
_CONTROLLER_LOADER = """function [K, content] = NAME(file)
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
