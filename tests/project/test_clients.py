"""What is exported, tried by those who will read it:

GNU Octave, a JSON schema validator, pandas.
"""

import json
import shutil
import subprocess
from importlib.resources import files

import control
import jsonschema
import numpy as np
import pandas
import pytest
from scipy.io import loadmat

from nlfrf import export_csv
from nlfrf.signals.multisine import multisine
from robust import fit_nominal, load, save
from robust.io import controller_sections, export_matlab
from tests.robust.io.test_export import NAMES, bla, models
from tests.support.responses import response

CONTROLLERS = {
    "continuous": control.tf([1.0, 0.1, 1 / 3], [1, 0.7, 0.1]),
    "discrete": control.tf([0.5, -0.4], [1, -1], 0.01),
    "a number": 2.5,
}


def validator(name):
    """A validator of one of the schemas that come with the package; the schema itself is validated
    too.
    """
    schema = json.loads(files("robust").joinpath(f"{name}.schema.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


@pytest.mark.parametrize("name", NAMES)
def test_models_are_what_their_schema_says(name, tmp_path):
    save(models()[name], tmp_path / "m.json")
    validator("robust-model").validate(json.loads((tmp_path / "m.json").read_text()))


@pytest.mark.parametrize("name", CONTROLLERS)
def test_controllers_are_what_their_schema_says(name, tmp_path):
    save(CONTROLLERS[name], tmp_path / "K.json")
    validator("robust-controller").validate(json.loads((tmp_path / "K.json").read_text()))


@pytest.mark.parametrize(
    "damage",
    [
        {"version": 2},
        {"form": "cubic"},
        {"omega": [-1.0]},
        {"radius": [0.0]},
        {"confidence": 1.5},
        {"weight": {"kind": "ss", "dt": 0}},
        {"surprise": 1},
    ],
)
def test_the_schema_refuses_what_the_reader_refuses(damage, tmp_path):
    save(models()["continuous"], tmp_path / "m.json")
    content = json.loads((tmp_path / "m.json").read_text()) | damage
    assert list(validator("robust-model").iter_errors(content))
    if "surprise" not in damage:
        (tmp_path / "bad.json").write_text(json.dumps(content))
        with pytest.raises(ValueError, match=r"must|whole"):
            load(tmp_path / "bad.json")


def test_pandas_reads_the_tables(tmp_path):
    export_csv(bla(), tmp_path / "bla.csv")
    table = pandas.read_csv(tmp_path / "bla.csv")
    columns = {
        "f [Hz]": bla().f,
        "Re G": bla().G.real,
        "Im G": bla().G.imag,
        "bound": bla().bound(),
        "bound_realization": bla().bound(of="realization"),
        "std_total": np.sqrt(bla().var_total),
    }
    for name, values in columns.items():
        assert table[name].to_numpy() == pytest.approx(values, rel=1e-12, abs=0), name
    assert table.notna().all().all()
    ms = multisine(fs=100, n_samples=200, f_min=1, f_max=20, n_realizations=2, rng=1)
    save(ms, tmp_path / "ms.csv")
    played = pandas.read_csv(tmp_path / "ms.csv")
    assert list(played.columns) == ["t [s]", "u0", "u1"]
    assert pytest.approx(ms.u, rel=1e-12, abs=0) == played[["u0", "u1"]].to_numpy().T


def octave(script, folder, package=""):
    """Run a script in GNU Octave; skips where it, or its package, is not installed."""
    program = shutil.which("octave-cli") or shutil.which("octave")
    if program is None:
        pytest.skip("GNU Octave is not installed")
    lines = [
        f"try, pkg load {package}; catch, printf('no package'); exit(0); end" if package else "",
        script,
        "exit(0)",
    ]
    done = subprocess.run(
        [program, "--quiet", "--no-gui", "--eval", "\n".join(lines)],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    if done.stdout.startswith("no package"):
        pytest.skip(f"the package {package} of GNU Octave is not installed")
    assert "finished" in done.stdout, done.stderr
    return done.stdout


def test_octave_reads_a_model_to_the_bit(tmp_path):
    model = models()["continuous"]
    export_matlab(model, tmp_path / "plant.mat")
    export_matlab(models()["FRF"], tmp_path / "frf.mat")
    octave(
        """
        m = load('plant.mat').content; n = m.nominal; w = m.weight; f = load('frf.mat').content;
        G = arrayfun(@(x) n.C * ((1i * x * eye(rows(n.A)) - n.A) \\ n.B) + n.D, m.freq);
        W = arrayfun(@(x) abs(polyval(w.num, 1i * x) / polyval(w.den, 1i * x)), m.freq);
        freq = m.freq; answer = m.response; radius = m.radius; A = n.A; frf = f.response; form = m.form;
        save('-v7', 'back.mat', 'freq', 'answer', 'radius', 'A', 'G', 'W', 'frf', 'form');
        printf('finished');
        """,
        tmp_path,
    )
    back = loadmat(tmp_path / "back.mat", squeeze_me=True)
    assert np.array_equal(back["freq"], model.omega)
    assert np.array_equal(back["answer"], model.at(model.omega))
    assert np.array_equal(back["radius"], model.radius)
    assert np.array_equal(back["A"], model.nominal.A)
    assert np.array_equal(back["frf"], bla().G)
    assert back["form"] == model.form
    assert back["G"] == pytest.approx(model.at(model.omega), rel=1e-10)
    assert back["W"] == pytest.approx(np.abs(response(model.weight, model.omega)), rel=1e-8)


def test_octave_runs_the_loader_of_a_controller(tmp_path):
    K = CONTROLLERS["discrete"]
    export_matlab(K, tmp_path / "K.mat")
    octave(
        """
        [K, c] = load_K(); sections = c.sections; Ts = K.Ts; at = [1 10 100];
        H = squeeze(freqresp(K, at)); u = ones(50, 1); y = filter(c.K.num, c.K.den, u);
        save('-v7', 'back.mat', 'sections', 'Ts', 'H', 'y'); printf('finished');
        """,
        tmp_path,
        package="control",
    )
    back = loadmat(tmp_path / "back.mat", squeeze_me=True)
    assert np.array_equal(back["sections"], controller_sections(K).ravel())
    assert back["Ts"] == 0.01
    assert back["H"] == pytest.approx(
        np.squeeze(K(np.exp(0.01j * np.array([1, 10, 100])))), rel=1e-10
    )
    assert back["y"] == pytest.approx(
        control.forced_response(K, np.arange(50) * 0.01, np.ones(50)).outputs, rel=1e-9
    )


def test_octave_runs_the_loader_of_a_model_up_to_the_uncertainty(tmp_path):
    model = models()["continuous"]
    export_matlab(model, tmp_path / "plant.mat")
    # Octave has no ultidyn: a gain of half stands for Delta, and the plant must be one of the set
    (tmp_path / "ultidyn.m").write_text("function D = ultidyn(name, size)\nD = 0.5;\nend\n")
    octave(
        """
        [Gu, G, W, m] = load_plant();
        H = squeeze(freqresp(Gu, m.freq)); save('-v7', 'back.mat', 'H'); printf('finished');
        """,
        tmp_path,
        package="control",
    )
    H = loadmat(tmp_path / "back.mat", squeeze_me=True)["H"]
    w = response(model.weight, model.omega)
    assert pytest.approx(model.at(model.omega) * (1 + 0.5 * w), rel=1e-8) == H
    assert model.contains(control.FrequencyResponseData(H, model.omega))


def test_a_fit_survives_the_way_through_octave(tmp_path):
    nominal = fit_nominal(bla(), n_poles=2, n_zeros=0).G
    export_matlab(control.ss(nominal), tmp_path / "G.mat")
    octave(
        """
        k = load('G.mat').content.K; A = k.A; B = k.B; C = k.C; D = k.D;
        save('-v7', 'back.mat', 'A', 'B', 'C', 'D'); printf('finished');
        """,
        tmp_path,
    )
    back = loadmat(tmp_path / "back.mat")
    for name in "ABCD":
        assert np.array_equal(
            np.reshape(back[name], getattr(nominal, name).shape), getattr(nominal, name)
        )
