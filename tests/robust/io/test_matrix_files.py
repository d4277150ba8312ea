"""Models and controllers of several inputs and outputs: exact to the bit, refused where not whole,
read by MATLAB.
"""

import json
import re
import shutil
import subprocess
from dataclasses import replace

import control
import numpy as np
import pytest
from scipy.io import loadmat

import robust
from robust.models import Origin
from robust.models.sets.records import JointProbability
from tests.support.responses import response_by_channel
from tests.support.signed import signed

OMEGA = np.array([1.0, 3.0, 10.0])
G = control.ss(
    [[-1.0, 0.3], [0.0, -2.0]],
    [[1.0, 0.1], [0.2, 1 / 3]],
    [[1.0, 0.0], [0.1, 2.0]],
    [[0.0, 0], [0.0, 0.1]],
)


def weights(n, dt=0):
    return tuple(control.ss([[-1.0 - k]], [[0.1]], [[1.0]], [[0.2 + k / 10]], dt) for k in range(n))


def model(form):
    n_left, n_right = {"elements": (0, 4), "additive": (2, 2), "input": (2, 2)}[form]
    parts = weights(n_left + n_right)
    radius = np.array([np.abs(np.ravel(response_by_channel(one, OMEGA))) for one in parts])
    made = robust.UncertaintyModel(
        nominal=G, form=form, left=parts[:n_left], right=parts[n_left:], omega=OMEGA, radius=radius, confidence=0.95,
        inputs=("Fx", "µ"), outputs=('a "b"', "y"),
        origin=Origin(extrapolation="flat", source="a record"),
    )  # fmt: skip
    return replace(made, joint=JointProbability(frf=0.97, bla=0.99))


MODELS = {form: model(form) for form in ("elements", "additive", "input")}
K = control.ss([[0.5, 0.1], [0.0, 0.9]], np.eye(2), [[1 / 3, 0.0], [0.1, 1.0]], np.eye(2), 1e-3)


@pytest.mark.parametrize("form", MODELS)
def test_a_model_comes_back_to_the_bit(form, tmp_path):
    one = MODELS[form]
    robust.save(one, tmp_path / "m.json")
    back = robust.load(tmp_path / "m.json")
    for name in ("omega", "radius"):
        np.testing.assert_array_equal(getattr(back, name), getattr(one, name))
    for name in ("form", "confidence", "simultaneous", "perturbation", "inputs", "outputs"):
        assert getattr(back, name) == getattr(one, name), name
    assert (back.origin.extrapolation, back.origin.source) == ("flat", "a record")
    assert (back.joint.frf, back.joint.bla) == (0.97, 0.99)
    for a, b in zip(
        (back.nominal, *back.left, *back.right), (one.nominal, *one.left, *one.right), strict=True
    ):
        assert a.dt == b.dt
        assert all(np.array_equal(getattr(a, part), getattr(b, part)) for part in "ABCD")
    robust.save(back, tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == (tmp_path / "m.json").read_bytes()
    first, second = (robust.check(m, np.eye(2), certify=False) for m in (one, back))
    np.testing.assert_array_equal(first.curves.rs, second.curves.rs)


def test_files_that_are_not_whole_are_refused_in_one_line(tmp_path):
    robust.save(MODELS["additive"], tmp_path / "m.json")
    whole = json.loads((tmp_path / "m.json").read_text())
    assert (whole["schema"], whole["version"], whole["units"]["omega"]) == (
        "robust-matrix-model",
        1,
        "rad/s",
    )

    def refusal(**changes):
        content = {name: part for name, part in (whole | changes).items() if part != "gone"}
        (tmp_path / "bad.json").write_text(json.dumps(content))
        with pytest.raises(ValueError) as error:  # noqa: PT011 - its message is what is looked at
            robust.load(tmp_path / "bad.json")
        assert "\n" not in str(error.value)
        return str(error.value)

    for name in set(whole) - {
        "units",
        "delay",
        "hold",
        "fs",
    }:  # for people, and what files of before do not say
        refusal(**{name: "gone"})
        refusal(**{name: {"some": "thing"}})
    assert "path must hold version 1 of robust-matrix-model" in refusal(version=2)
    assert "must cover its radius" in refusal(radius=(10 * np.array(whole["radius"])).tolist())
    assert "left and right must hold 2 and 2 weights" in refusal(left=whole["left"][:1])
    assert 'simultaneous must have type "boolean"' in refusal(simultaneous=1)
    assert 'inputs[0] must have type "string", got 1' in refusal(inputs=[1, 2])
    assert (
        'form must be one of "elements", "additive", "input", "output", "inverse-additive", '
        in refusal(form=3)
    )
    text = (tmp_path / "m.json").read_text()
    for cut in (10, len(text) // 2, len(text) - 3):
        (tmp_path / "cut.json").write_text(text[:cut])
        with pytest.raises(ValueError, match="path must be a whole JSON file"):
            robust.load(tmp_path / "cut.json")
    with pytest.raises(
        ValueError, match=r"thing must be a multisine, .* an uncertainty model, .* got '1'"
    ):
        robust.save("1", tmp_path / "n.json")


@pytest.mark.parametrize("one", [K, control.ss([], [], [], np.ones((2, 3))), np.eye(2)])
def test_a_controller_matrix_comes_back_to_the_bit(one, tmp_path):
    robust.save(one, tmp_path / "K.json")
    back = robust.load(tmp_path / "K.json")
    np.testing.assert_array_equal(back.D, one.D if hasattr(one, "D") else one)
    robust.save(back, tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == (tmp_path / "K.json").read_bytes()
    assert "sections" not in json.loads((tmp_path / "K.json").read_text())


@pytest.mark.parametrize("form", MODELS)
def test_matlab_reads_a_model(form, tmp_path):
    one = MODELS[form]
    robust.io.export_matlab(one, tmp_path / "stage.mat")
    content = loadmat(tmp_path / "stage.mat", squeeze_me=True, struct_as_record=False)["content"]
    np.testing.assert_array_equal(content.nominal.A, one.nominal.A)
    assert content.form == form
    assert list(content.inputs) == list(one.inputs)
    for side in ("left", "right"):
        kept = np.atleast_1d(getattr(content, side))
        assert len(kept) == len(getattr(one, side))
        for struct, weight in zip(kept, getattr(one, side), strict=True):
            assert float(struct.D) == weight.D[0, 0]
            assert float(struct.A) == weight.A[0, 0]
    loader = (tmp_path / "load_stage.m").read_text()
    assert loader.startswith("function [Gu, G, model] = load_stage(file)")
    assert not re.search(r"NAME|FILE\b|ELEMENTS|INPUT", loader)
    assert "strcmp(model.form, 'elements')" in loader
    opened = len(re.findall(r"^\s*(?:function|if|for|switch)\b", loader, re.MULTILINE))
    assert len(re.findall(r"^\s*end\s*$", loader, re.MULTILINE)) == opened
    robust.io.export_matlab(K, tmp_path / "K.mat")
    kept = loadmat(tmp_path / "K.mat", squeeze_me=True, struct_as_record=False)["content"].K
    np.testing.assert_array_equal(kept.C, K.C)


@pytest.mark.skipif(shutil.which("octave") is None, reason="Octave is not installed")
@pytest.mark.parametrize("form", MODELS)
def test_the_loader_makes_the_same_plants(form, tmp_path):
    """Run by Octave, with numbers in the place of systems: responses at 2 rad/s, 0.3 for every
    perturbation.
    """
    one = MODELS[form]
    robust.io.export_matlab(one, tmp_path / "stage.mat")
    (tmp_path / "ss.m").write_text(
        "function s = ss(A, B, C, D, T)\ns = C*((2i*eye(size(A)) - A)\\B) + D;\nend\n"
    )
    (tmp_path / "ultidyn.m").write_text("function d = ultidyn(name, n)\nd = 0.3*ones(n);\nend\n")
    command = "Gu = load_stage(); printf('%.15g ', real(Gu), imag(Gu))"
    done = subprocess.run(
        ["octave", "-q", "--eval", command],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    numbers = np.array(done.stdout.split(), dtype=float)
    found = (numbers[:4] + 1j * numbers[4:]).reshape(2, 2).T
    Delta = 0.3 * (np.eye(4) if form == "elements" else np.ones((2, 2)))
    np.testing.assert_allclose(
        found, response_by_channel(one.perturbed(Delta), np.array([2.0]))[:, :, 0], rtol=1e-12
    )


@pytest.mark.parametrize(("form", "dt"), [*((form, 0.0) for form in MODELS), ("input", 1e-3)])
def test_a_proof_of_several_channels_is_verified_from_its_file(form, dt, tmp_path):
    one, C = MODELS[form], control.ss([], [], [], 0.3 * np.eye(2))
    if dt:  # a continuous set under a sampled controller, which only has a bound if it is filtered
        one = replace(one, nominal=control.ss(G.A, G.B, G.C, 0 * G.D))
        C = control.ss(0.5 * np.eye(2), np.eye(2), 0.05 * np.eye(2), 0.1 * np.eye(2), dt)
    report = robust.check(one, C, w_P=control.tf([0.3], [1]))
    assert {c.judged for c in report.proofs.certificates} == {"proved, rigorous"}, str(report)
    path = tmp_path / "proof.json"
    robust.save(report, path)
    found = robust.io.verify_certificate(path, model=one, K=C)
    assert found.verified
    aliases = ("every alias in the weights",) * bool(dt)
    assert found.proved == ("nominal stability", "robust stability", "robust performance", *aliases)
    other = robust.io.verify_certificate(path, model=one, K=1.01 * C)
    assert "the loop of model and controller: NOT verified: not the one of the certificate" in str(
        other
    )
    with pytest.raises(ValueError, match="model and K must be given together"):
        robust.io.verify_certificate(path, K=C)
    text = path.read_text()
    path.write_text(text.replace('"level": 0.9', '"level": 0.8', 1))
    with pytest.raises(ValueError, match="digest does not fit"):
        robust.io.verify_certificate(path)


def test_a_proof_whose_level_is_lowered_and_signed_anew_is_not_verified(tmp_path):
    path = tmp_path / "proof.json"
    robust.save(robust.check(MODELS["input"], 0.3 * np.eye(2)), path)
    content = json.loads(path.read_text())
    content["claim"]["claims"]["robust stability"]["level"] = 0.01
    path.write_text(json.dumps(signed(content)))
    found = robust.io.verify_certificate(path)
    assert found.proved == ("nominal stability",)
    assert "robust stability: NOT verified: the inequality does not pass" in str(found)
