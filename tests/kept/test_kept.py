"""Files that a released version wrote load with the values they had: one folder a version, never edited again.

`values.json` was written by that version beside its files, from what it had in memory.
"""

import json
from pathlib import Path

import numpy as np
import pytest

import nlfrf
import robust

HERE = Path(__file__).parent
VERSIONS = sorted(path for path in HERE.iterdir() if (path / "values.json").exists())
EACH = pytest.mark.parametrize("folder", VERSIONS, ids=[path.name for path in VERSIONS])


def values(folder, part):
    return json.loads((folder / "values.json").read_text())[part]


def test_every_version_left_files():
    assert [path.name for path in VERSIONS][:1] == ["0.1.0"]


@EACH
@pytest.mark.parametrize("name", ["ms.npz", "ms.h5"])
def test_multisines(folder, name):
    then, ms = values(folder, "ms"), nlfrf.load_multisine(folder / name)
    assert (ms.kind, ms.fs, ms.n_samples) == (then["kind"], then["fs"], then["n_samples"])
    assert ms.lines.excited.tolist() == then["lines"]
    assert ms.amplitude[0] == then["amplitude"]
    assert ms.phase[:, :3].tolist() == then["phase"]


@EACH
def test_the_design_beside_what_was_played(folder):
    ms = nlfrf.load_multisine(folder / "played.npz")
    assert ms.phase[0, :3].tolist() == values(folder, "played")["phase"]
    table = np.loadtxt(folder / "played.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(table[:, 1], ms.u[0], rtol=0, atol=1e-14)


@EACH
@pytest.mark.parametrize("name", ["record.npz", "record.mat", "record.h5"])
def test_records(folder, name):
    then, record = values(folder, "record"), nlfrf.load_record(folder / name, r="r")
    assert list(record.u.shape) == then["shape"]
    assert record.fs == then["fs"]
    for signal in "uyr":
        assert getattr(record, signal)[1, 1, :3].tolist() == then[signal]
    assert (record.lines.odd.tolist(), record.lines.even.tolist()) == (then["odd"], then["even"])


@EACH
def test_records_in_csv(folder):
    then = values(folder, "record")
    record = nlfrf.load_record(folder / "record.csv", n_samples=then["shape"][2])
    assert record.y[0, 0, :3].tolist() == then["y_first"]
    assert record.fs == then["fs"]


@EACH
@pytest.mark.parametrize("name", ["bla.npz", "bla.h5"])
def test_blas(folder, name):
    then, bla = values(folder, "bla"), nlfrf.load_bla(folder / name)
    assert bla.f.tolist() == then["f"]
    assert (bla.G.real.tolist(), bla.G.imag.tolist()) == (then["re_G"], then["im_G"])
    assert bla.var_bound.tolist() == then["var_bound"]
    assert [bla.grid, bla.transient, bla.level_source] == [then[k] for k in ("grid", "transient", "level_source")]
    assert bla.n_periods == then["n_periods"]
    np.testing.assert_allclose(np.sum(bla.levels.odd), complex(*then["odd"]), rtol=1e-12)
    np.testing.assert_allclose(bla.bound(), then["bound"], rtol=0.5)  # may be calibrated better, not differently


@EACH
def test_models(folder):
    then, model = values(folder, "model"), robust.load_model(folder / "model.json")
    assert (model.form, model.perturbation, model.delay) == (then["form"], then["perturbation"], then["delay"])
    assert model.confidence == then["confidence"]
    assert (model.omega.tolist(), model.radius.tolist()) == (then["omega"], then["radius"])
    np.testing.assert_allclose(model.nominal.poles().real, then["poles"], rtol=1e-12)
    np.testing.assert_allclose(np.sort(model.weight.poles().real), then["weight_poles"], rtol=1e-9)


@EACH
def test_controllers(folder):
    then, K = values(folder, "controller"), robust.load_controller(folder / "controller.json")
    assert [getattr(K, name).tolist() for name in "ABCD"] == [then[name] for name in "ABCD"]
    assert K.dt == then["dt"]
