"""Files of a matrix: exact to the bit, whole or not at all, damaged ones refused in one line."""

import json
from dataclasses import replace

import numpy as np
import pytest

import nlfrf
from tests.nlfrf.io.test_files import same
from tests.support.measurement_files import damaged


@pytest.fixture(scope="module")
def frm():
    ms = nlfrf.multisine(fs=256, n_samples=256, f_min=1, f_max=100, n_inputs=2, rng=1)
    u = np.repeat(ms.u[:, :, None], 2, axis=2)
    y = np.stack([u[0] + 0.1 * u[0] ** 3, u[1], u[0] - u[1]])
    y += 0.01 * np.random.default_rng(0).standard_normal(y.shape)
    names = {"inputs": ("Kraft, x [N]", "µ/2"), "outputs": ("x", "y", 'a "b"')}
    return nlfrf.identify(nlfrf.Record(u=u, y=y, fs=256, lines=ms.lines, **names))


def parts_same(one, two):
    assert one.inputs == two.inputs
    assert one.outputs == two.outputs
    for a, b in zip(one.levels, two.levels, strict=True):
        same(a, b)
    same(replace(one, levels=one.levels[:1] * 3), replace(two, levels=one.levels[:1] * 3))


@pytest.mark.parametrize("suffix", [".npz", ".h5"])
def test_a_matrix_comes_back_as_it_was(frm, suffix, tmp_path):
    nlfrf.save(frm, tmp_path / f"G{suffix}")
    back = nlfrf.load(tmp_path / f"G{suffix}")
    parts_same(back, frm)
    assert str(back) == str(frm)
    np.testing.assert_array_equal(back.bound(of="realization"), frm.bound(of="realization"))
    assert isinstance(nlfrf.load(tmp_path / f"G{suffix}"), nlfrf.Bla)
    parts_same(nlfrf.load(tmp_path / f"G{suffix}"), frm)  # one loader for any number of channels


def test_files_that_are_not_whole_are_refused(frm, tmp_path):
    nlfrf.save(frm, tmp_path / "G.npz")
    whole = dict(np.load(tmp_path / "G.npz"))

    def refusal(**changes):
        content = {name: array for name, array in (whole | changes).items() if array is not None}
        np.savez(tmp_path / "bad.npz", **content)
        with pytest.raises(ValueError) as error:  # noqa: PT011 - its message is what is looked at
            nlfrf.load(tmp_path / "bad.npz")
        assert "\n" not in str(error.value)
        return str(error.value)

    assert "without 'cov.gamma'" in refusal(**{"cov.gamma": None})
    assert "G must be numbers of shape (3, 2, 26)" in refusal(G=whole["G"][:, :, 1:])
    assert "G must be numbers" in refusal(G=whole["G"].astype(str))
    assert "levels must be one per output, 3 of them, got 2" in refusal(
        **{"levels.2.f_excited": None}
    )
    assert "without 'levels.1.odd'" in refusal(**{"levels.1.odd": None})
    assert "got 3 in" in refusal(version=np.array(3))
    for bad in ("x, y", json.dumps({"x": 1}), json.dumps([1, 2]), "[" * 100_000):
        assert "path must hold names as a list in JSON for outputs" in refusal(
            outputs=np.array(bad)
        )
    with pytest.raises(ValueError, match=r"path must end in .npz or .h5, got 'G.csv'"):
        nlfrf.save(frm, tmp_path / "G.csv")
    assert not (tmp_path / "G.csv").exists()


def test_damaged_files_are_refused_or_harmless(frm, tmp_path):
    nlfrf.save(frm, tmp_path / "G.npz")
    content, rng = (tmp_path / "G.npz").read_bytes(), np.random.default_rng(0)
    said = []
    for _ in range(80):
        (tmp_path / "bad.npz").write_bytes(damaged(content, rng))
        try:
            nlfrf.load(tmp_path / "bad.npz")
        except ValueError as error:
            said.append(str(error))
    assert len(said) > 40
    assert not any("\n" in message for message in said)


def test_a_table_has_every_entry(frm, tmp_path):
    nlfrf.export_csv(frm, tmp_path / "G.csv", confidence=0.9)
    header = (tmp_path / "G.csv").read_text().splitlines()[0].split(",")
    table = dict(
        zip(header, np.loadtxt(tmp_path / "G.csv", delimiter=",", skiprows=1).T, strict=True)
    )
    assert len(table) == 1 + 3 * 6
    np.testing.assert_array_equal(table["Im y/µ/2"], frm.G[1, 1].imag)
    np.testing.assert_array_equal(table["bound x/Kraft; x [N]"], frm.bound(0.9)[0, 0])


def test_channels_of_several_lengths_are_named(tmp_path):
    u = np.random.default_rng(0).standard_normal((2, 400))
    np.savez(tmp_path / "m.npz", a=u[0], b=u[1, :300], y=u[1], fs=100.0)
    with pytest.raises(
        ValueError,
        match=r"u must be channels of equal length, got 400 samples in 'a' and 300 in 'b'",
    ):
        nlfrf.load_record(tmp_path / "m.npz", u=["a", "b"], y=["y"])
    ms = nlfrf.multisine(fs=100, n_samples=100, f_min=1, f_max=20, rng=1)
    nlfrf.save(
        nlfrf.Record(u=ms.u[None], y=ms.u[None] ** 3, fs=100, lines=ms.lines), tmp_path / "r.npz"
    )
    with pytest.raises(
        ValueError, match=r"path must be measurement files, got '.*r\.npz', written as nlfrf-record"
    ):
        nlfrf.load_record(tmp_path / "r.npz", u=["u"], y=["y"])
