"""Files: exact to the bit, versioned, whole or not at all, and readable by others."""

import json
import re
from fractions import Fraction
from functools import cache

import control
import numpy as np
import pytest
from scipy.io import loadmat
from scipy.signal import sosfilt

import robust
from nlfrf import DataWarning
from robust import UncertaintyModel, fit_nominal, frd, load, save, uncertainty
from robust.io import controller_sections, export_matlab
from robust.lti import discretize
from tests.support.bla import make_bla
from tests.support.responses import response

F = np.arange(1, 80, 2) * 0.3


def plant(s):
    return 200 / (s * s + 3 * s + 900)


SCATTER = {"f0": 0.3, "sigma_noise": 1e-3, "sigma_distortion": 0.01, "sigma_even": 2e-3}


@cache
def bla():
    return make_bla(plant, F, rng=0, **SCATTER)


@cache
def late_bla():
    return make_bla(lambda s: plant(s) * np.exp(-0.02 * s), F, rng=0, **SCATTER)


def some_models():
    fit = fit_nominal(bla(), n_poles=2, n_zeros=0)
    discrete = fit_nominal(late_bla(), n_poles=2, n_zeros=1, dt=0.01, delay=0.02)
    yield "continuous", uncertainty(bla(), fit, order=3)
    yield (
        "discrete with delay",
        uncertainty(late_bla(), discrete, form="additive", order=4, simultaneous=True),
    )
    yield "FRF", uncertainty(bla(), frd(bla()), order=4, below=10.0)
    yield (
        "made directly",
        UncertaintyModel(
            control.tf([1.0], [1, 1 / 3]),
            0.1,
            "inverse-additive",
            np.array([0.1, 0.3]),
            np.array([0.05, 0.1]),
            np.nan,
            "LTI",
        ),
    )


@cache
def models():
    return dict(some_models())


NAMES = ("continuous", "discrete with delay", "FRF", "made directly")


def same(a, b):
    """Equal to the bit, nan included."""
    return np.array_equal(np.asarray(a), np.asarray(b), equal_nan=True)


def assert_same_system(a, b):
    assert a.dt == b.dt
    if isinstance(a, control.FrequencyResponseData):
        assert same(a.frdata, b.frdata)
        assert same(a.omega, b.omega)
    else:
        assert all(
            same(getattr(a, m), getattr(b, m)) and getattr(a, m).shape == getattr(b, m).shape
            for m in "ABCD"
        )


@pytest.mark.parametrize("name", NAMES)
def test_a_model_comes_back_to_the_bit(name, tmp_path):
    model = models()[name]
    save(model, tmp_path / "m.json")
    back = load(tmp_path / "m.json")
    assert_same_system(back.nominal, model.nominal)
    assert_same_system(back.weight, model.weight)
    for field in ("omega", "radius", "confidence"):
        assert same(getattr(back, field), getattr(model, field)), field
    assert back.budget.keys() == model.budget.keys()
    assert all(same(back.budget[part], model.budget[part]) for part in model.budget)
    for field in ("form", "perturbation", "simultaneous"):
        assert getattr(back, field) == getattr(model, field), field
    assert repr(back.origin) == repr(model.origin)
    save(back, tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == (tmp_path / "m.json").read_bytes()


def test_the_file_says_what_it_is(tmp_path):
    save(models()["FRF"], tmp_path / "m.json")
    content = json.loads((tmp_path / "m.json").read_text())
    assert content["schema"] == "robust-model"
    assert content["version"] == 1
    assert content["units"]["omega"] == "rad/s"
    first = content["nominal"]["G"][0]
    assert first == [bla().G[0].real, bla().G[0].imag]


@pytest.mark.parametrize(
    "K",
    [
        control.ss(control.tf([1.0, 0.1, 1 / 3], [1, 0.7, 0.1])),
        control.tf([0.5, -0.4], [1, -1], 0.01),
        2.5,
        control.ss([], [], [], [[-0.1]], 0.02),
    ],
)
def test_a_controller_comes_back_to_the_bit(K, tmp_path):
    save(K, tmp_path / "K.json")
    back = load(tmp_path / "K.json")
    save(back, tmp_path / "again.json")
    stored, again = (json.loads((tmp_path / f"{name}.json").read_text()) for name in ("K", "again"))
    assert stored.pop("realised", False) is (isinstance(K, control.TransferFunction))
    assert again == stored  # what comes back has states, whatever it was made of
    omega = np.array([0.1, 1.0, 10.0])
    wanted = (
        np.full(3, 2.5)
        if isinstance(K, float)
        else np.squeeze(K(np.exp(1j * omega * K.dt) if K.dt else 1j * omega))
    )
    assert response(back, omega) == pytest.approx(wanted, rel=1e-12)


def damaged(text):
    content = json.loads(text)
    yield "truncated", text[: len(text) // 2], "must be a whole JSON file"
    yield "empty", "", "must be a whole JSON file"
    yield (
        "another schema",
        json.dumps(content | {"schema": "nlfrf-bla"}),
        "must hold a model, .*, got .*, which is a BLA",
    )
    yield "newer", json.dumps(content | {"version": 2}), "must hold version 1"
    yield (
        "no weight",
        json.dumps({k: v for k, v in content.items() if k != "weight"}),
        "must hold a whole robust-model",
    )
    yield "a list", "[1, 2]", "must hold robust-model or"
    yield (
        "wrong shapes",
        json.dumps(content | {"radius": [1.0]}),
        "radius must have one value per frequency",
    )
    yield (
        "text for numbers",
        json.dumps(content | {"omega": "many"}),
        "omega must have type \"array\", got 'many'",
    )
    yield (
        "no matrix",
        json.dumps(content | {"weight": {"kind": "ss", "dt": 0}}),
        "must hold a whole robust-model",
    )
    yield (
        "ragged",
        json.dumps(content | {"nominal": content["nominal"] | {"A": [[1.0], [1.0, 2.0]]}}),
        "path must hold rows of the same length",
    )
    yield "nested without end", "[" * 100_000, "must be a whole JSON file"
    yield (
        "no such kind",
        json.dumps(content | {"nominal": content["nominal"] | {"kind": "zpk"}}),
        "nominal must be as its schema says, got .*'kind': 'zpk'",
    )
    yield (
        "no truth value",
        json.dumps(content | {"simultaneous": "no"}),
        'simultaneous must have type "boolean"',
    )
    yield (
        "no system",
        json.dumps(content | {"nominal": 3}),
        "nominal must be as its schema says, got 3",
    )


@pytest.mark.parametrize("case", range(14))
def test_damaged_files_are_refused_in_one_line(case, tmp_path):
    save(models()["continuous"], tmp_path / "m.json")
    _, text, message = list(damaged((tmp_path / "m.json").read_text()))[case]
    (tmp_path / "bad.json").write_text(text)
    with pytest.raises(ValueError, match=message) as refusal:
        load(tmp_path / "bad.json")
    assert "\n" not in str(refusal.value)


def test_binary_rubbish_and_missing_files(tmp_path):
    (tmp_path / "x.json").write_bytes(bytes(range(256)) * 10)
    with pytest.raises(ValueError, match="must be a whole JSON file"):
        load(tmp_path / "x.json")
    with pytest.raises(FileNotFoundError):
        load(tmp_path / "nothing.json")


def test_nothing_is_left_of_a_file_that_could_not_be_written(tmp_path, monkeypatch):
    save(models()["continuous"], tmp_path / "m.json")
    before = (tmp_path / "m.json").read_bytes()
    monkeypatch.setattr(
        "pathlib.Path.write_text", lambda *a, **k: (_ for _ in ()).throw(OSError("disk full"))
    )
    with pytest.raises(OSError, match="disk full"):
        save(models()["FRF"], tmp_path / "m.json")
    assert (tmp_path / "m.json").read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["m.json"]


def test_sections_run_like_the_controller():
    rng = np.random.default_rng(0)
    K = control.ss(
        control.tf(
            np.poly([0.9, 0.5 + 0.3j, 0.5 - 0.3j]).real * 0.7,
            np.poly([1.0, 0.95, 0.8 + 0.5j, 0.8 - 0.5j]).real,
            0.01,
        )
    )
    u = rng.normal(size=300)
    t = np.arange(300) * 0.01
    y = control.forced_response(K, t, u).outputs
    assert sosfilt(controller_sections(K), u) == pytest.approx(y, rel=1e-8, abs=1e-8)
    assert controller_sections(control.ss([], [], [], [[3.0]], 0.1)).tolist() == [
        [3, 0, 0, 1, 0, 0]
    ]
    with pytest.raises(ValueError, match="K must be discrete to have sections"):
        controller_sections(control.tf([1], [1, 1]))


def run(sections, z):
    """Response of sections from their own coefficients, added up without rounding; z is z^-1
    - 1.
    """
    w = [Fraction(z.real), Fraction(z.imag)]
    out = 1.0 + 0j
    for row in sections:
        b, a = ([Fraction(float(c)) for c in part] for part in (row[:3], row[3:]))
        square = (w[0] ** 2 - w[1] ** 2, 2 * w[0] * w[1])  # of z^-1 - 1
        top, bottom = (
            complex(
                c[0] + c[1] + c[2] + (c[1] + 2 * c[2]) * w[0] + c[2] * square[0],
                (c[1] + 2 * c[2]) * w[1] + c[2] * square[1],
            )
            for c in (b, a)
        )
        out *= top / bottom
    return out


@pytest.mark.parametrize("dt", [1e-3, 1e-4, 1e-5])
def test_sections_keep_what_is_slow(dt):
    """An integrator, and poles and zeros a million samples long, far below 1e-2 rad."""
    K = discretize(robust.shaping.pid(2.0, 3.0, 0.1, filter_time=0.01), dt)
    for omega in np.geomspace(1e-3, 1.0, 7):
        wanted = response(K, np.array([omega]))[0]
        assert abs(
            run(controller_sections(K), np.expm1(-1j * omega * dt)) / wanted - 1
        ) < 1e-8 * max(1, 1e-4 / dt)
    slow = np.array([1.0, 3.0, 10.0]) * dt * 1e-2
    chain = control.ss([], [], [], 1.0, dt)
    for p in (*slow, 0.3):
        chain = control.ss([[1 - p]], [[1.0]], [[p]], [[0.0]], dt) * chain
    sections = controller_sections(chain)
    assert len(sections) == 2
    gain = np.prod([row[:3].sum() / row[3:].sum() for row in sections])
    assert gain == pytest.approx(1.0, rel=1e-3)


def test_sections_that_lose_what_is_slow_are_refused():
    """A resonance at 1e-8 rad a sample: the sum of its coefficients, 2e-16, is rounding."""
    q = 1e-8
    K = control.ss([[1 - q, q], [-q, 1 - q]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]], 1e-4)
    with pytest.raises(
        ValueError, match="K must be accurate as second-order sections, got an error of"
    ):
        controller_sections(K)


def test_a_controller_whose_sections_do_not_hold_is_kept_all_the_same(tmp_path):
    q = 1e-8
    K = control.ss([[1 - q, q], [-q, 1 - q]], [[0], [1]], [[1, 0]], [[0]], 1e-4)
    with pytest.warns(DataWarning, match="without sections"):
        save(K, tmp_path / "K.json")
    with pytest.warns(DataWarning, match="without sections"):
        export_matlab(K, tmp_path / "K.mat")
    assert same(load(tmp_path / "K.json").A, K.A)
    assert "sections" not in json.loads((tmp_path / "K.json").read_text())


@pytest.mark.parametrize("dt", [0.0, 1e-2, 1e-4, 1e-6])
def test_matlab_gets_polynomials_only_where_they_hold_the_system(dt, tmp_path):
    """Of a chain of slow lags in a fast clock numerator and denominator were up to 100 % wrong."""
    K = control.ss(control.zpk([-1.5, -0.1], [-1e-3, -20.0, -0.05], 4.0))
    K = discretize(K, dt) if dt else K
    export_matlab(K, tmp_path / "K.mat")
    written = loadmat(tmp_path / "K.mat", simplify_cells=True)["content"]["K"]
    assert ("num" in written) == ("den" in written) == (dt in (0.0, 1e-2))
    if "num" in written:
        omega = np.geomspace(1e-3, 30, 50)
        s = np.exp(1j * omega * dt) if dt else 1j * omega
        ratio = np.polyval(written["num"], s) / np.polyval(written["den"], s)
        assert ratio == pytest.approx(response(K, omega), rel=1e-3)


@pytest.mark.parametrize("name", NAMES)
def test_matlab_gets_plain_structs_to_the_bit(name, tmp_path):
    model = models()[name]
    export_matlab(model, tmp_path / "my model.mat")
    content = loadmat(tmp_path / "my model.mat", squeeze_me=False, struct_as_record=False)[
        "content"
    ][0, 0]
    assert same(content.freq[:, 0], model.omega)
    assert same(content.radius[:, 0], model.radius)
    assert same(content.response[:, 0], model.at(model.omega))
    assert content.form[0] == model.form
    assert getattr(content, "class")[0] == model.perturbation
    weight = content.weight[0, 0]
    for m in "ABCD":
        assert same(
            np.reshape(getattr(weight, m), getattr(model.weight, m).shape), getattr(model.weight, m)
        )
    s = np.exp(1j * model.omega * model.weight.dt) if model.weight.dt else 1j * model.omega
    ratio = np.polyval(weight.num.ravel(), s) / np.polyval(weight.den.ravel(), s)
    assert ratio == pytest.approx(response(model.weight, model.omega), rel=1e-6)
    loader = (tmp_path / "load_my_model.m").read_text()
    assert "function [Gu, G, W, model] = load_my_model(file)" in loader
    assert "'my model.mat'" in loader
    assert "ultidyn('Delta', [1 1])" in loader
    assert not re.search("NAME|FILE", loader)


def test_matlab_gets_controllers_too(tmp_path):
    K = control.tf([0.5, -0.4], [1, -1], 0.01)
    export_matlab(K, tmp_path / "K.mat")
    content = loadmat(tmp_path / "K.mat", struct_as_record=False)["content"][0, 0]
    assert content.K[0, 0].Ts[0, 0] == 0.01
    assert same(content.sections, controller_sections(K))
    assert "load_K" in (tmp_path / "load_K.m").read_text()
    with pytest.raises(ValueError, match=r"path must end in \.mat"):
        export_matlab(K, tmp_path / "K.m")


@pytest.mark.parametrize(
    ("file", "function"),
    [
        ("K_FILE.mat", "load_K_FILE"),
        ("it's NAME.mat", "load_it_s_NAME"),
        ("Größe.mat", "load_Gr__e"),
    ],
)
def test_a_loader_is_matlab_whatever_its_file_is_called(file, function, tmp_path):
    export_matlab(control.tf([1, -0.5], [1, -0.9], 0.01), tmp_path / file)
    loader = (tmp_path / f"{function}.m").read_text()
    assert loader.startswith(f"function [K, content] = {function}(file)\n")
    assert "'{}'".format(file.replace("'", "''")) in loader
