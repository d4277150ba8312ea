"""Files in which a name, a clock or a row could be taken for another: each channel is the one that
was asked for.
"""

import numpy as np
import pytest

import nlfrf
from nlfrf.io.measurement_files import read_channels
from tests.support.measurement_files import FS, T, U, Y, lvm


def test_columns_that_share_a_name(tmp_path):
    rng = np.random.default_rng(3)
    for _ in range(200):
        given = [rng.choice(["y", "y.2", "y.3", "col2", ""]) for _ in range(rng.integers(1, 7))]
        values = np.arange(4)[:, None] + np.arange(len(given) + 1) ** 2
        np.savetxt(
            tmp_path / "run.csv", values, delimiter=",", header=",".join(["t", *given]), comments=""
        )
        found = read_channels(tmp_path / "run.csv").arrays
        assert len(found) == len(given) + 1
        for name in {*given} - {""}:  # the first that is called so keeps its name
            first = values[:, 1 + given.index(name)]
            assert np.array_equal(found.get(name), first) or "" in given
    columns = np.column_stack([T, U, Y, 2 * Y, 3 * Y])
    np.savetxt(tmp_path / "run.csv", columns, delimiter=",", header="t,u,y,y,y.2", comments="")
    arrays = read_channels(tmp_path / "run.csv").arrays
    np.testing.assert_allclose(arrays["y.2"], 3 * Y)
    np.testing.assert_allclose(arrays["y"], Y)


@pytest.mark.parametrize("suffix", [".parquet", ".feather"])
def test_arrow_columns_that_share_a_name(suffix, tmp_path):
    import pyarrow as pa
    from pyarrow import feather, parquet

    table = pa.Table.from_arrays(
        [pa.array(a) for a in (T, U, Y, 2 * Y)], names=["t", "u", "y", "y"]
    )
    (parquet.write_table if suffix == ".parquet" else feather.write_feather)(
        table, tmp_path / f"run{suffix}"
    )
    arrays = read_channels(tmp_path / f"run{suffix}").arrays
    np.testing.assert_array_equal(arrays["y"], Y)
    np.testing.assert_array_equal(arrays["y.4"], 2 * Y)


def test_channels_of_a_labview_file_each_with_its_own_step(tmp_path):
    lines = [line.replace("Delta_X\t0.001\t0.001", "Delta_X\t0.001\t0.002") for line in lvm("No")]
    (tmp_path / "run.lvm").write_text("\n".join(lines))
    with pytest.raises(
        ValueError, match=r"u and y must be sampled together, .* 'u' at 1000 Hz, 'y' at 500 Hz"
    ):
        nlfrf.load_record(tmp_path / "run.lvm")


def test_scopes_with_signals_of_the_same_label(tmp_path):
    from scipy.io import savemat

    def scope(*labelled):
        signals = np.zeros(
            len(labelled), dtype=[("values", object), ("dimensions", object), ("label", object)]
        )
        for i, (label, values) in enumerate(labelled):
            signals[i] = (values[:, None], 1.0, label)
        return {"time": T[:, None], "signals": signals, "blockName": "rig/Scope"}

    savemat(
        tmp_path / "run.mat",
        {"One": scope(("u", U), ("y", Y)), "Two": scope(("y", 2 * Y), ("y", 3 * Y))},
    )
    with pytest.raises(
        ValueError,
        match=r"y must name a signal of 'run.mat', one of One\.time, One\.y, .*; got 'y'",
    ):
        nlfrf.load_record(tmp_path / "run.mat")
    for name, factor in (("One.y", 1), ("Two.y", 2), ("Two.2", 3)):
        record = nlfrf.load_record(tmp_path / "run.mat", y=name)
        assert record.fs == FS
        np.testing.assert_array_equal(record.y.ravel(), factor * Y)


def test_dspace_rasters_of_their_own_clocks(tmp_path):
    from scipy.io import savemat

    slow = slice(None, None, 2)
    channels = np.zeros(
        3, dtype=[("Name", object), ("Data", object), ("Unit", object), ("XIndex", object)]
    )
    channels[0], channels[1] = ("slow u", U[slow], "N", 2.0), ("slow y", Y[slow], "mm", 2.0)
    channels[2] = ("u", U, "N", 1.0)
    rasters = np.zeros(2, dtype=[("Name", object), ("Data", object)])
    rasters[0], rasters[1] = ("fast", T), ("slow", T[slow])
    savemat(tmp_path / "exp.mat", {"exp1": {"X": rasters, "Y": channels}})
    assert nlfrf.load_record(tmp_path / "exp.mat", u="slow u", y="slow y").fs == FS / 2


def test_truth_values_and_bytes_are_looked_at(tmp_path):
    signed = np.round(127 * Y / np.abs(Y).max()).astype(np.int8)
    np.savez(tmp_path / "run.npz", u=U, y=signed, on=np.arange(U.size) % 2 == 0, fs=float(FS))
    found = nlfrf.inspect_file(tmp_path / "run.npz")
    assert (found.u, found.y) == ("u", "y")
