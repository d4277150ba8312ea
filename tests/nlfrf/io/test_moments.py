"""Channels of one file that begin at different moments, and numbers that a file says how to
scale.
"""

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
        nptdms.ChannelObject(
            "run", name, x, properties={"wf_increment": 1 / FS, "wf_start_offset": start}
        )
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
    """Side by side they were early by it, without a word: a delay in G that is none of the
    machine.
    """
    record = nlfrf.load_record(write(tmp_path, 0.0))
    np.testing.assert_allclose(record.y, 2 * record.u, atol=1e-6)
    with pytest.raises(
        ValueError, match=r"'.*y' begins \+10 samples after '.*u'. Resample them to common times"
    ):
        nlfrf.load_record(write(tmp_path, 10.0))
    with pytest.raises(ValueError, match="must be sampled together"):
        nlfrf.load_record(write(tmp_path, 10.0), fs=FS)
    with pytest.warns(
        nlfrf.DataWarning, match=r"'.*y' begins \+0\.3 samples after '.*u': G includes this delay"
    ):
        nlfrf.load_record(write(tmp_path, 0.3))


def test_time_columns_of_each_channel_have_the_unit_of_the_first(tmp_path):
    path = table(tmp_path, 10.0, times=("time (ms)", "time (ms)"), scale=1e3)
    with pytest.raises(ValueError, match=r"begins \+10 samples"):
        nlfrf.load_record(path)
    np.testing.assert_allclose(
        nlfrf.load_record(table(tmp_path, 0.0, ("time (ms)",) * 2, 1e3)).fs, FS
    )


def test_times_that_count_from_another_origin_are_no_delay(tmp_path):
    assert nlfrf.load_record(groups(tmp_path, 1.7e12)).fs == FS
    assert nlfrf.load_record(table(tmp_path, 1.7e12, times=("time", "stamp")), y="y").fs == FS


@pytest.mark.parametrize(
    ("kind", "names"),
    [
        ("i2", ("scale_factor", "add_offset")),
        ("f4", ("scale_factor", "add_offset")),
        ("i2", ("Scale", "Offset")),
    ],
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


# The unit of an abscissa that the file states

SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60.0, "": 1.0}


def uff(path, late=0.0, unit="s", even=True):
    pyuff = pytest.importorskip("pyuff")
    file = pyuff.UFF(str(path / "run.uff"))
    for name, x, start in (("u", U, 0.0), ("y", Y, late / FS)):
        t = (T + start) / SECONDS[unit] if unit in SECONDS else T
        about = dict(binary=0, func_type=1, rsp_node=1, rsp_dir=3, ref_dir=0, ref_node=0, id1=name)
        about |= dict(
            abscissa_spacing=int(even), abscissa_min=t[0], abscissa_inc=(t[1] - t[0]) * even
        )
        about |= dict(
            rsp_ent_name="NONE", ref_ent_name="NONE", ord_data_type=4, num_pts=x.size, data=x, x=t
        )
        about |= dict(
            abscissa_spec_data_type=17, ordinate_spec_data_type=13, orddenom_spec_data_type=0
        )
        file.write_sets(pyuff.prepare_58(**about, abscissa_axis_units_lab=unit), "add")
    return path / "run.uff"


def waveforms_in(path, late=0.0, unit="s"):
    with h5py.File(path / "run.h5", "w") as file:
        for name, x, start in (("u", U, 0.0), ("y", Y, late / FS)):
            file[name] = x
            about = {"wf_increment": 1 / FS, "wf_start_offset": start}
            second = SECONDS.get(unit, 1.0)
            file[name].attrs.update(
                {key: held / second for key, held in about.items()} | {"wf_xunit_string": unit}
            )
    return path / "run.h5"


def tdms_in(path, late=0.0, unit="s", began=(None, None)):
    nptdms = pytest.importorskip("nptdms")
    second, channels = SECONDS.get(unit, 1.0), []
    for name, x, start, moment in (("u", U, 0.0, began[0]), ("y", Y, late / FS, began[1])):
        about = {
            "wf_increment": 1 / FS / second,
            "wf_start_offset": start / second,
            "wf_xunit_string": unit,
        }
        about |= {} if moment is None else {"wf_start_time": np.datetime64(moment, "us")}
        channels.append(nptdms.ChannelObject("run", name, x, properties=about))
    with nptdms.TdmsWriter(str(path / "run.tdms")) as writer:
        writer.write_segment(channels)
    return path / "run.tdms"


@pytest.mark.parametrize("write", [uff, waveforms_in, tdms_in])
def test_the_unit_of_an_abscissa_that_the_file_states(write, tmp_path):
    for unit in ("s", "ms", "us", "min", ""):
        record = nlfrf.load_record(write(tmp_path, unit=unit))
        (tmp_path / "run.uff").unlink(missing_ok=True)
        assert record.fs == pytest.approx(FS, rel=3e-6)  # of six digits of a step
        np.testing.assert_allclose(record.y, 2 * record.u, atol=1e-6)
        with pytest.warns(nlfrf.DataWarning, match=r"y' begins \+0\.3 samples after"):
            nlfrf.load_record(write(tmp_path, 0.3, unit=unit))
        (tmp_path / "run.uff").unlink(missing_ok=True)


@pytest.mark.parametrize("write", [uff, waveforms_in, tdms_in])
def test_an_abscissa_of_an_unknown_unit_asks_for_fs(write, tmp_path):
    path = write(tmp_path, unit="furlong")
    with pytest.raises(
        ValueError,
        match=r"fs must be given: .* neither fs nor a time channel: it counts in 'furlong'",
    ):
        nlfrf.load_record(path)
    assert nlfrf.load_record(path, fs=FS).fs == FS


def test_times_of_a_universal_file_that_are_not_even_have_its_unit(tmp_path):
    assert nlfrf.load_record(uff(tmp_path, unit="ms", even=False)).fs == pytest.approx(FS)


# Starts


@pytest.mark.parametrize("write", [uff, waveforms_in, tdms_in])
def test_starts_that_are_further_apart_than_the_record_is_long_are_no_other_origin(write, tmp_path):
    with pytest.raises(ValueError, match=r"y' begins \+5000 samples after"):
        nlfrf.load_record(write(tmp_path, 5000.0))


def test_the_moments_at_which_waveforms_began(tmp_path):
    day = "2026-11-22T10:00:00"
    np.testing.assert_allclose(
        nlfrf.load_record(tdms_in(tmp_path, began=(day, day))).y, Y.reshape(1, 3, N)
    )
    with pytest.warns(nlfrf.DataWarning, match=r"y' begins \+0\.4 samples after"):
        nlfrf.load_record(tdms_in(tmp_path, began=(day, f"{day}.000400"), unit="ms"))
    with pytest.raises(ValueError, match=r"y' begins \+1000 samples after"):
        nlfrf.load_record(tdms_in(tmp_path, began=(day, "2026-11-22T10:00:01")))
    with pytest.warns(
        nlfrf.DataWarning, match=r"y' begins \+0\.1 samples after"
    ):  # 400 us, and 300 us back
        nlfrf.load_record(tdms_in(tmp_path, late=-0.3, began=(day, f"{day}.000400")))
    assert (
        nlfrf.load_record(tdms_in(tmp_path, began=(day, None))).fs == FS
    )  # of one channel it is not known


def test_time_columns_without_a_moment_in_common(tmp_path):
    with pytest.warns(
        nlfrf.DataWarning,
        match=r"'u' and 'y' in 'run.csv' do not overlap. It is assumed that their clocks",
    ):
        nlfrf.load_record(table(tmp_path, 1e5))
