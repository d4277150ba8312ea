"""Channels of one file that begin at different moments, and numbers that a file says how to scale."""

import h5py
import numpy as np
import pytest

import nlfrf

FS, N = 1000.0, 400
T = np.arange(3 * N) / FS
MS = nlfrf.multisine(fs=FS, n_samples=N, f_min=5, f_max=300, rng=1)
U = np.tile(MS.u[0], 3)
Y = 2 * U


def table(path, late, times=("time", "time"), scale=1.0):
    rows = np.column_stack([scale * T, U, scale * (T + late / FS), Y])
    names = ",".join((times[0], "u", times[1], "y"))
    np.savetxt(path / "run.csv", rows, delimiter=",", header=names, comments="", fmt="%.9g")
    return path / "run.csv"


def groups(path, late):
    with h5py.File(path / "run.h5", "w") as file:
        for name, x, t in (("u", U, T), ("y", Y, T + late / FS)):
            file[f"{name}_raster/{name}"], file[f"{name}_raster/t"] = x, t
    return path / "run.h5"


def waveforms(path, late):
    with h5py.File(path / "run.h5", "w") as file:
        for name, x, start in (("u", U, 0.0), ("y", Y, late / FS)):
            file[name] = x
            file[name].attrs.update({"wf_increment": 1 / FS, "wf_start_offset": start})
    return path / "run.h5"


def tdms(path, late):
    nptdms = pytest.importorskip("nptdms")
    channels = [
        nptdms.ChannelObject("run", name, x, properties={"wf_increment": 1 / FS, "wf_start_offset": start})
        for name, x, start in (("u", U, 0.0), ("y", Y, late / FS))
    ]
    with nptdms.TdmsWriter(str(path / "run.tdms")) as writer:
        writer.write_segment(channels)
    return path / "run.tdms"


def mdf(path, late):
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(U, T, name="u")])
        file.append([asammdf.Signal(Y, T + late / FS, name="y")])
        file.save(path / "run.mf4", overwrite=True)
    return path / "run.mf4"


@pytest.mark.parametrize("write", [table, groups, waveforms, tdms, mdf])
def test_channels_that_begin_at_different_moments(write, tmp_path):
    """Side by side they were early by it, without a word: a delay in G that is none of the machine."""
    record = nlfrf.load_record(write(tmp_path, 0.0))
    np.testing.assert_allclose(record.y, 2 * record.u, atol=1e-6)
    with pytest.raises(ValueError, match=r"'.*y' begins \+10 samples behind '.*u'; bring them to one clock"):
        nlfrf.load_record(write(tmp_path, 10.0))
    with pytest.raises(ValueError, match="must be sampled together"):
        nlfrf.load_record(write(tmp_path, 10.0), fs=FS)
    with pytest.warns(nlfrf.DataWarning, match=r"'.*y' begins \+0\.3 samples behind '.*u': G has that delay"):
        nlfrf.load_record(write(tmp_path, 0.3))


def test_time_columns_of_each_channel_have_the_unit_of_the_first(tmp_path):
    path = table(tmp_path, 10.0, times=("time (ms)", "time (ms)"), scale=1e3)
    with pytest.raises(ValueError, match=r"begins \+10 samples"):
        nlfrf.load_record(path)
    np.testing.assert_allclose(nlfrf.load_record(table(tmp_path, 0.0, ("time (ms)",) * 2, 1e3)).fs, FS)


def test_times_that_count_from_another_origin_are_no_delay(tmp_path):
    assert nlfrf.load_record(groups(tmp_path, 1.7e12)).fs == FS
    assert nlfrf.load_record(table(tmp_path, 1.7e12, times=("time", "stamp")), y="y").fs == FS


@pytest.mark.parametrize(
    ("kind", "names"),
    [("i2", ("scale_factor", "add_offset")), ("f4", ("scale_factor", "add_offset")), ("i2", ("Scale", "Offset"))],
)
def test_numbers_are_scaled_as_an_hdf5_file_says(kind, names, tmp_path):
    """They were read as they are stored: G a thousand times too large, without a word."""
    scale, offset = 1e-3, -0.5
    with h5py.File(tmp_path / "run.h5", "w") as file:
        file["u"], file["fs"] = U, FS
        file["y"] = np.round((Y - offset) / scale).astype(kind)
        file["y"].attrs.update(dict(zip(names, (scale, offset), strict=True)))
    np.testing.assert_allclose(nlfrf.load_record(tmp_path / "run.h5").y.ravel(), Y, atol=1e-3)


def test_other_numbers_are_left_as_they_are(tmp_path):
    with h5py.File(tmp_path / "run.h5", "w") as file:
        file["u"], file["y"], file["fs"] = U, Y, FS
        file["y"].attrs.update({"scale": 10.0, "offset": 3.0, "gain": 2.0})
    np.testing.assert_array_equal(nlfrf.load_record(tmp_path / "run.h5").y.ravel(), Y)


def test_a_number_that_stands_for_none_is_none(tmp_path):
    with h5py.File(tmp_path / "run.h5", "w") as file:
        file["u"], file["fs"] = U, FS
        file["y"] = np.where(np.arange(U.size) == 700, -9999.0, Y)
        file["y"].attrs["_FillValue"] = -9999.0
    with pytest.raises(ValueError, match="y must be finite, got 1 nan"):
        nlfrf.load_record(tmp_path / "run.h5")
