"""Files as instruments, spreadsheets and logging programs write them load as a test engineer
expects.
"""

import base64
import datetime
import sys

import h5py
import numpy as np
import pytest

import nlfrf
from nlfrf.io.measurement_files import read_channels
from tests.support import measurement_files as files
from tests.support.measurement_files import FS, MS, WRITERS, N, P, T, U, Y, fuzz, lvm


def rows(*columns, sep=",", decimal=".", form="{:.6f}"):
    """Lines of numbers, or of texts as they are."""
    cell = lambda one: one if isinstance(one, str) else form.format(one).replace(".", decimal)  # noqa: E731
    return [sep.join(map(cell, row)) for row in zip(*columns, strict=True)]


def iso(step=T, start=datetime.datetime(2026, 11, 22, 10, 15, 30), form="%Y-%m-%dT%H:%M:%S.%f"):
    return [(start + datetime.timedelta(seconds=float(s))).strftime(form) for s in step]


def gaps(column, every):
    return ["" if i % every == 0 else f"{x:.6f}" for i, x in enumerate(column)]


TUY = rows(T, U, Y)
#: Layout -> (suffix, lines or bytes, what `load_record` is given beside names u="u", y="y").
TEXTS = {
    "header": (".csv", ["t,u,y", *TUY], {}),
    "units in brackets": (".csv", ["t [s],u [N],y [mm]", *TUY], {}),
    "units row": (".csv", ["t,u,y", "s,N,mm", *TUY], {}),
    "units row in brackets": (".csv", ["Time,u,y", "(s),(N),(µm)", *TUY], {}),
    "units and types row": (".csv", ["t,u,y", "s,N,m/s^2", "double,double,double", *TUY], {}),
    "preamble": (".csv", ["Device: DAQ 7", "Operator: A. B.", "", "t,u,y", *TUY], {}),
    "preamble of the width of the table": (
        ".csv",
        ["Name,Run 7,", "Date,2026-11-22,", "t,u,y", *TUY],
        {},
    ),
    "rate in the preamble": (".csv", ["Sample rate: 1 kHz", "u,y", *rows(U, Y)], {}),
    "interval in the preamble": (".csv", ["Sampling interval [s],0.001", "u,y", *rows(U, Y)], {}),
    "hash lines": (".csv", ["# device 7", "# t,u,y", *TUY], {}),
    "hash lines in between": (".csv", ["t,u,y", *TUY[:100], "# trigger", *TUY[100:]], {}),
    "late hash lines": (".csv", ["t,u,y", *TUY[:600], "# trigger", *TUY[600:]], {}),
    "percent lines": (".txt", ["% t u y", *rows(T, U, Y, sep=" ")], {}),
    "no header": (".csv", TUY, dict(u="col2", y="col3")),
    "quotes": (
        ".csv",
        ['"t","u","y"', *['"' + '","'.join(line.split(",")) + '"' for line in TUY]],
        {},
    ),
    "quoted decimal commas": (
        ".csv",
        [
            '"t","u","y"',
            *['"' + '","'.join(r.split(";")) + '"' for r in rows(T, U, Y, sep=";", decimal=",")],
        ],
        {},
    ),
    "trailing separator": (".csv", ["t,u,y,", *[line + "," for line in TUY]], {}),
    "trailing separator in the rows only": (
        ".csv",
        ["t;u;y", *[line + ";" for line in rows(T, U, Y, sep=";")]],
        {},
    ),
    "text column": (".csv", ["t,state,u,y", *rows(T, ["run"] * U.size, U, Y)], {}),
    "text column with separators": (
        ".csv",
        ["t,note,u,y", *rows(T, ['"a, b"'] * U.size, U, Y)],
        {},
    ),
    "iso times": (".csv", ["time,u,y", *rows(iso(), U, Y)], {}),
    "iso times with a zone": (".csv", ["time,u,y", *rows([s + "+01:00" for s in iso()], U, Y)], {}),
    "german dates": (
        ".csv",
        ["Zeit;u;y", *rows(iso(form="%d.%m.%Y %H:%M:%S,%f"), U, Y, sep=";", decimal=",")],
        {},
    ),
    "date and time of day": (
        ".csv",
        ["Date,Time,u,y", *rows(iso(form="%Y-%m-%d"), iso(form="%H:%M:%S.%f"), U, Y)],
        {},
    ),
    "past midnight": (
        ".csv",
        [
            "Time,u,y",
            *rows(
                iso(start=datetime.datetime(2026, 1, 1, 23, 59, 59, 500_000), form="%H:%M:%S.%f"),
                U,
                Y,
            ),
        ],
        {},
    ),
    "empty cells in another column": (".csv", ["t,u,y,temp", *rows(T, U, Y, gaps(Y, 2))], {}),
    "shorter column": (".csv", ["t,u,y", *TUY, *[f"{9 + i / FS:.6f},," for i in range(3)]], {}),
    "decimal comma": (".csv", ["t;u;y", *rows(T, U, Y, sep=";", decimal=",")], {}),
    "decimal comma with tabs": (".tsv", ["t\tu\ty", *rows(T, U, Y, sep="\t", decimal=",")], {}),
    "excel's own line": (".csv", ["sep=;", "t;u;y", *rows(T, U, Y, sep=";", decimal=",")], {}),
    "tabs": (".dat", ["t\tu\ty", *rows(T, U, Y, sep="\t")], {}),
    "blanks": (
        ".txt",
        ["   t      u      y", *["   " + line for line in rows(T, U, Y, sep="   ")]],
        {},
    ),
    "blanks and names with blanks": (
        ".txt",
        ["t (s)   u (N)   y (mm)", *rows(T, U, Y, sep="   ")],
        {},
    ),
    "commas with blanks": (".csv", ["t, u, y", *rows(T, U, Y, sep=", ")], {}),
    "line breaks in names": (".csv", ['"t\n[s]","u","y\n[mm]"', *TUY], dict(y="y [mm]")),
    "an inch above": (".csv", ['Disk: 5" wide', '"left open', "t,u,y", *TUY], {}),
    "exponents": (".csv", ["t,u,y", *rows(T, U, Y, form="{:.7e}")], {}),
    "utf-16": (".csv", "\r\n".join(["t\tu\ty", *rows(T, U, Y, sep="\t")]).encode("utf-16"), {}),
    "utf-16 without a mark": (
        ".txt",
        "\n".join(["t\tu\ty", *rows(T, U, Y, sep="\t")]).encode("utf-16-le"),
        {},
    ),
    "utf-8 with a mark": (".csv", "\n".join(["t,u,y", *TUY]).encode("utf-8-sig"), {}),
    "a line under the header": (
        ".txt",
        ["t;u;y", "-----;-----;-----", *rows(T, U, Y, sep=";")],
        {},
    ),
    "a last word": (".csv", ["t,u,y", *TUY, "End of measurement"], {}),
    "a last line cut short": (".csv", "\n".join(["t,u,y", *TUY, "0.75"]).encode(), {}),
    "milliseconds by the name": (".csv", ["time_ms,u,y", *rows(1e3 * T, U, Y)], {}),
    "milliseconds by the units row": (".csv", ["time,u,y", "ms,N,m", *rows(1e3 * T, U, Y)], {}),
    "microseconds since 1970": (
        ".csv",
        ["timestamp_us,u,y", *rows(1.7e15 + 1e6 * T, U, Y, form="{:.6f}")],
        {},
    ),
    "oscilloscope": (".csv", ["x-axis,u,y", "second,Volt,Volt", *rows(T, U, Y, form="{:.6E}")], {}),
    "pandas index": (".csv", [",t,u,y", *rows([str(i) for i in range(U.size)], T, U, Y)], {}),
}


TEXTS["lvm"] = (".lvm", lvm(), {})
TEXTS["lvm without times"] = (".lvm", lvm("No"), {})
TEXTS["lvm with decimal commas"] = (".lvm", lvm(decimal=","), {})
UNITS = {
    "units in brackets": ("N", "mm"),
    "units row": ("N", "mm"),
    "units row in brackets": ("N", "µm"),
    "units and types row": ("N", "m/s^2"),
    "oscilloscope": ("Volt", "Volt"),
    "lvm": ("N", "mm"),
}


def agrees(record, scale=1.0):
    """The record is the one that was written."""
    assert record.fs == pytest.approx(FS, rel=1e-6)
    assert record.u.shape == (1, P, N)
    np.testing.assert_allclose(record.u.ravel() * scale, U, atol=2e-6)
    np.testing.assert_allclose(record.y.ravel() * scale, Y, atol=2e-6)
    np.testing.assert_array_equal(record.lines.excited, MS.lines.excited)


@pytest.mark.parametrize("layout", TEXTS)
def test_text_tables_as_the_world_writes_them(layout, tmp_path):
    suffix, content, options = TEXTS[layout]
    path = tmp_path / f"run{suffix}"
    path.write_bytes(
        content if isinstance(content, bytes) else ("\n".join(content) + "\n").encode()
    )
    needs_fs = {} if layout != "no header" else {"fs": FS}
    record = nlfrf.load_record(path, **({"u": "u", "y": "y"} | options | needs_fs))
    agrees(record)
    if layout in UNITS:
        assert (record.u_unit, record.y_unit) == UNITS[layout]


def refused(tmp_path, name, content, cure, **options):
    path = tmp_path / name
    path.write_bytes(
        content if isinstance(content, bytes) else ("\n".join(content) + "\n").encode()
    )
    with pytest.raises(ValueError, match=cure) as caught:
        nlfrf.load_record(path, **options)
    assert "\n" not in str(caught.value)


def test_what_cannot_be_read_is_refused_with_the_cure(tmp_path):
    refused(
        tmp_path,
        "a.csv",
        ["notes", "only words here"],
        r"no rows of numbers .* go to record_from_samples\(u, y",
    )
    refused(tmp_path, "b.xlsx", ["x"], r"save the sheet as \.csv")
    strange = ["t,u,y", *TUY[:500], "0.5,0.1,Overload", *TUY[501:]]
    refused(
        tmp_path,
        "c.csv",
        strange,
        "y must hold numbers, but 'y' of 'c.csv' holds 'Overload' in row 501",
    )
    half = ["t,u,y", *rows(T, U, gaps(Y, 10))]
    refused(
        tmp_path,
        "d.csv",
        half,
        r"y must be finite, got 75 nan .*fill the gaps and give the arrays to record_from_samples",
    )
    refused(tmp_path, "e.csv", ["t,u,y", *rows(T, ["on"] * U.size, Y)], "got 'u'; 'u' holds texts")
    refused(
        tmp_path,
        "f.csv",
        ["u,y", *rows(U, Y)],
        "fs must be given: 'f.csv' has neither fs nor a time channel",
    )
    refused(tmp_path, "g.lvm", lvm() + lvm()[8:], "holds 2 measurements, one behind the other")
    ragged = ["t,u,y", *TUY[:500], "0.5,0.1,0.2,0.3", *TUY[501:]]
    refused(
        tmp_path,
        "h.csv",
        ragged,
        r"must be a readable \.csv file, got 'h.csv': .*Expected 3 fields in line 502",
    )


# Binary formats


def units(record):
    return record.u_unit, record.y_unit


@pytest.mark.parametrize("suffix", [".tdms", ".mf4", ".dat"])
def test_channels_in_groups_of_their_own_clocks(suffix, tmp_path):
    write, _ = WRITERS[suffix]
    write(tmp_path / f"run{suffix}")
    record = nlfrf.load_record(tmp_path / f"run{suffix}")
    agrees(record)
    assert units(record) == ("N", "mm")
    with pytest.raises(
        ValueError, match=r"u and y must be sampled together, but .* at 1000 Hz, .* at 100 Hz"
    ):
        nlfrf.load_record(tmp_path / f"run{suffix}", y="temperature")


def test_a_channel_with_the_name_of_the_time_axis_is_no_time_axis(tmp_path):
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(version="4.10") as file:
        channels = (("u", U, "N"), ("y", Y, "mm"), ("time", 100 * T + 7, "h"))
        file.append([asammdf.Signal(x, T, name=name, unit=unit) for name, x, unit in channels])
        file.save(tmp_path / "run.mf4")
    record = nlfrf.load_record(tmp_path / "run.mf4", u="u", y="y")
    agrees(record)
    assert record.fs == pytest.approx(FS)


def test_uff_58(tmp_path):
    files.write_uff(tmp_path / "run.uff")
    record = nlfrf.load_record(tmp_path / "run.uff")
    agrees(record)
    assert units(record) == ("N", "mm")


@pytest.mark.parametrize(("suffix", "moments"), [(".parquet", True), (".feather", False)])
def test_columns_of_arrow(suffix, moments, tmp_path):
    files.write_arrow(tmp_path / f"run{suffix}", moments)
    record = nlfrf.load_record(tmp_path / f"run{suffix}")
    agrees(record)
    assert units(record) == ("N", "mm")
    with pytest.raises(ValueError, match="got 'state'; 'state' holds no numbers"):
        nlfrf.load_record(tmp_path / f"run{suffix}", y="state")


@pytest.mark.parametrize("kind", [np.int16, np.int32, np.float32])
def test_wav(kind, tmp_path):
    from scipy.io import wavfile

    scale = 8.0
    full = 1.0 if kind is np.float32 else float(np.iinfo(kind).max + 1)
    samples = np.column_stack([U, Y]) / scale * full
    wavfile.write(
        tmp_path / "run.wav",
        FS,
        samples.astype(kind) if full == 1 else np.round(samples).astype(kind),
    )
    record = nlfrf.load_record(tmp_path / "run.wav", u="ch1", y="ch2", n_samples=N)
    assert record.fs == FS
    np.testing.assert_allclose(scale * record.y.ravel(), Y, atol=scale * 3e-5)


# MATLAB


def test_matlab_matrices_and_their_clocks(tmp_path):
    from scipy.io import savemat

    savemat(tmp_path / "tuy.mat", {"run": np.column_stack([T, U, Y])})
    agrees(nlfrf.load_record(tmp_path / "tuy.mat", u="run.2", y="run.3"))
    with pytest.raises(
        ValueError, match=r"got 'run' with shape \(750, 3\); its columns are run\.1, run\.2, run\.3"
    ):
        nlfrf.load_record(tmp_path / "tuy.mat", u="run", y="run.3", fs=FS)
    savemat(tmp_path / "file.mat", {"ans": np.vstack([T, U, Y])})  # as "To File" writes it
    agrees(nlfrf.load_record(tmp_path / "file.mat", u="ans.2", y="ans.3"))
    for clock in (
        {"fs": FS},
        {"Ts": 1 / FS},
        {"Fs": FS},
        {"dt": 1 / FS},
        {"tout": T},
        {"time": T},
        {"SampleTime": 1e-3},
    ):
        savemat(tmp_path / "m.mat", {"u": U, "y": Y} | clock)
        agrees(nlfrf.load_record(tmp_path / "m.mat"))
    savemat(
        tmp_path / "two.mat", {"a": {"u": U, "y": Y, "Ts": 1e-3}, "b": {"u": U, "y": Y, "Ts": 2e-3}}
    )
    assert nlfrf.load_record(tmp_path / "two.mat", u="b.u", y="b.y").fs == 500
    with pytest.raises(ValueError, match=r"one of a\.u, a\.y, b\.u, b\.y; got 'u'"):
        nlfrf.load_record(tmp_path / "two.mat")
    savemat(tmp_path / "yout.mat", {"tout": T, "yout": np.column_stack([U, Y])})
    agrees(nlfrf.load_record(tmp_path / "yout.mat", u="yout.1", y="yout.2"))


def test_simulink_scopes(tmp_path):
    from scipy.io import savemat

    signals = np.zeros(2, dtype=[("values", object), ("dimensions", object), ("label", object)])
    signals[0], signals[1] = (U[:, None], 1.0, "u"), (Y[:, None], 1.0, "y")
    savemat(
        tmp_path / "scope.mat",
        {"ScopeData": {"time": T[:, None], "signals": signals, "blockName": "rig/Scope"}},
    )
    agrees(nlfrf.load_record(tmp_path / "scope.mat"))
    one = {"values": np.column_stack([U, Y]), "dimensions": 2.0, "label": ""}
    savemat(
        tmp_path / "one.mat",
        {"ScopeData": {"time": T[:, None], "signals": one, "blockName": "rig/Scope"}},
    )
    agrees(nlfrf.load_record(tmp_path / "one.mat", u="ScopeData.1.1", y="ScopeData.1.2"))


def test_dspace_units(tmp_path):
    from scipy.io import savemat

    channels = np.zeros(2, dtype=[("Name", object), ("Data", object), ("Unit", object)])
    channels[0], channels[1] = ("u", U, "N"), ("y", Y, "mm")
    savemat(tmp_path / "exp.mat", {"exp1": {"X": {"Name": "Time", "Data": T}, "Y": channels}})
    record = nlfrf.load_record(tmp_path / "exp.mat")
    agrees(record)
    assert (record.u_unit, record.y_unit) == ("N", "mm")


#: A file of version 7 with the time series x and nothing else.
TIME_SERIES = base64.b64decode(
    "TUFUTEFCIDUuMCBNQVQtZmlsZSBQbGF0Zm9ybS4gQ3JlYXRlZCBvbjogMjAyNi0xMS0yNyAxNToyNTo1NSBVVEMgYnkgbWF0aW8gd2l0aCBzY2lw"
    "eSAgICAgICAgICAgICAgICAgICAgICAgICAgICAgICDWAAAAAAAAAAABSU0PAAAATgAAAHic42NgYOgAYjYg5gBiQQYIYATCCjDNwuDr7B/MCGRz"
    "AXFJZm5qcWpRZmoxRB0fEHsg6eeF6meF8tnAZkAwA5QvAWHeZUKSg2EA3VoIMw8AAAD/AAAAeJzjY2Bg0GBhYGAD0hxAzMkAAaxQPiMQ/2CG0CDA"
    "BOUzMHr6gvh8QPyCGaGfCYt+GIaIs4DlGKFqfJ39g2HmLEAyRxCqnhFOs4DVgvi8QOyWmZMaXpRYUJBaFB8P1Z+ApB9hH4TPjuYOPqjhuPx9AU09"
    "E1QMGFQMIO87gOyD4glAvAOIT0AxSJ1fYm4qg0tiSWI8Q0lmbmpxalFmajEDdsCMQxwZMGLhI4sxYXEvuhpsgA+JNmBAhAcLVBxXPAoAWaVQfR5I"
    "+tjQ9DGj6QOFswTc9g/26DTIvBUMuOMR3V8g9RYM+NMfAwNq+qOlfl4C7oWpY0DSP5T8CwAxICRM"
)


def test_matlab_objects_are_named_and_not_read(tmp_path):
    (tmp_path / "ts.mat").write_bytes(TIME_SERIES)
    with pytest.raises(
        ValueError, match=r"with none: .*timeseries, timetable.* save it as a matrix, x = \[ts.Time"
    ):
        nlfrf.load_record(tmp_path / "ts.mat")
    with h5py.File(
        tmp_path / "ts73.mat", "w"
    ) as file:  # as MATLAB writes it: references, marked as an object
        file.attrs["H5PATH"] = "/"
        file["#subsystem#/MCOS"] = np.zeros((1, 7))
        file["x"] = np.arange(6, dtype=np.uint32)[None]
        file["x"].attrs["MATLAB_object_decode"] = np.int32(3)
        file["u"], file["y"], file["fs"] = U, Y, float(FS)
    agrees(nlfrf.load_record(tmp_path / "ts73.mat"))
    assert "x: is a MATLAB object and not read: save it as a matrix" in str(
        nlfrf.inspect_file(tmp_path / "ts73.mat")
    )
    with pytest.raises(
        ValueError,
        match=r"y must name a signal .*one of u, y; got 'x'; 'x' is a MATLAB object and not",
    ):
        nlfrf.load_record(tmp_path / "ts73.mat", y="x")


# HDF5


def test_hdf5_tables_groups_and_attributes(tmp_path):
    files.write_hdf5(tmp_path / "run.h5")
    agrees(nlfrf.load_record(tmp_path / "run.h5"))
    record = nlfrf.load_record(tmp_path / "run.h5", u="force", y="fast.position")
    agrees(record)
    assert (record.u_unit, record.y_unit, record.y_name) == ("N", "mm", "fast.position")
    agrees(nlfrf.load_record(tmp_path / "run.h5", u="current", y="angle"))
    np.savez(tmp_path / "m.npz", run=np.column_stack([T, U, Y]))
    agrees(nlfrf.load_record(tmp_path / "m.npz", u="run.2", y="run.3"))


# What is damaged


@pytest.mark.own_process
@pytest.mark.filterwarnings(
    "ignore"
)  # readers may warn about what they find; here only errors count
@pytest.mark.parametrize("suffix", WRITERS)
def test_damaged_files_raise_documented_errors_only(suffix, tmp_path):
    n = 40 if suffix in (".csv", ".lvm") else 1  # each of the others in its own process
    fuzz(suffix, tmp_path, n=n, seed=0)


# What is not installed


def test_a_package_that_is_missing_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    path = tmp_path / "run.csv"
    path.write_text("t,u,y\n0,1,2\n1,2,3\n2,3,4\n")
    with pytest.raises(ValueError, match=r"needs pandas, which is not installed: pip install "):
        read_channels(path)


#: A Python that lacks one package.
LACKING = """#!/bin/sh
exec "{python}" -c '
import runpy, sys
class Lacking:
    def find_spec(name, path=None, target=None):
        if name == "{package}":
            raise ModuleNotFoundError("No module named " + repr(name))
sys.meta_path.insert(0, Lacking)
sys.argv = sys.argv[2:]
runpy.run_path(sys.argv[0], run_name="__main__")
' "$@"
"""


@pytest.mark.own_process
@pytest.mark.parametrize(
    ("suffix", "package", "extra"),
    [
        (".mf4", "asammdf", "mdf"),
        (".tdms", "nptdms", "tdms"),
        (".uff", "pyuff", "uff"),
        (".parquet", "pyarrow", "parquet"),
    ],
)
def test_a_package_missing_in_the_process_apart_is_named_with_its_extra(
    suffix, package, extra, tmp_path, monkeypatch
):
    path, python = tmp_path / f"run{suffix}", tmp_path / "python"
    path.write_bytes(b"MDF     4.10")
    python.write_text(LACKING.format(python=sys.executable, package=package))
    python.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(python))
    with pytest.raises(ValueError, match=rf"needs {package}, .* pip install 'nlfrf\[{extra}\]'"):
        read_channels(path)
