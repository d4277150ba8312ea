"""Files of several channels that version 4aa289a wrote load as the one type there is now, with the values they had."""

import json
from pathlib import Path

import numpy as np
import pytest

import nlfrf
import robust

HERE = Path(__file__).parent / "0.1.0-several"
THEN = json.loads((HERE / "several.json").read_text())


@pytest.mark.parametrize("suffix", [".npz", ".h5", ".mat"])
def test_records(suffix):
    then = THEN["record"]
    for load in (nlfrf.load_record, nlfrf.load_multirecord, nlfrf.load):
        record = load(HERE / f"record{suffix}")
        assert isinstance(record, nlfrf.Record)
        assert (list(record.u.shape), record.fs) == (then["shape"], then["fs"])
        assert (list(record.inputs), list(record.outputs)) == (then["inputs"], then["outputs"])
        assert record.input_units == ("", "")
        assert record.y[1, 1, 1, :3].tolist() == then["y"]
        assert record.r is not None


@pytest.mark.parametrize("suffix", [".npz", ".h5"])
def test_matrices(suffix):
    then = THEN["frm"]
    for bla in (nlfrf.load_frm(HERE / f"frm{suffix}"), nlfrf.load_bla(HERE / f"frm{suffix}")):
        assert isinstance(bla, nlfrf.Bla)
        assert bla.f.tolist() == then["f"]
        assert bla.G.real[0, 1].tolist() == then["re_G"]
        np.testing.assert_allclose(bla.var_total[1, 0], then["var_total"], rtol=1e-12)
        assert bla.dof.tolist() == then["dof"]
        assert (bla.level_source, bla.design) == (then["level_source"], then["design"])
        np.testing.assert_allclose(bla.bound()[0, 0], then["bound"], rtol=1e-12)
        np.testing.assert_allclose(bla.bound(of="realization")[0, 0], then["bound_new"], rtol=0.3)  # calibrated anew


def test_models():
    then, model = THEN["model"], robust.load_model(HERE / "matrix_model.json")
    assert (model.form, model.confidence, list(model.inputs)) == (then["form"], then["confidence"], then["inputs"])
    assert model.omega[:3].tolist() == then["omega"]
    assert model.radius[0, :3].tolist() == then["radius"]
