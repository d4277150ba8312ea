"""Traces of drives: exports of TwinCAT Scope, units rows, indices, constant parameters,
microseconds, .npy, .csv.gz.
"""

import gzip
import os
import struct
import sys
from pathlib import Path

import numpy as np
import pytest

import nlfrf
from nlfrf.io.measurement_files import read_channels
from tests.support.printed import unwrapped

#: pytcs's own exports (github CagtayFabry/pytcs, tests/data): beside this repository, or where the
#: variable says.
EXPORTS = Path(
    os.environ.get("PYTCS_DATA", Path(__file__).parents[5] / "shared" / "data" / "pytcs")
)
NAMES = sorted(path.name for path in EXPORTS.glob("tc3_scope_*.csv*"))
RNG = np.random.default_rng(0)
T = np.arange(400) * 250e-6
U, Y = np.round(RNG.standard_normal((2, 400)), 6)


@pytest.mark.skipif(
    len(NAMES) != 13, reason=f"the 13 exports of pytcs are not in {EXPORTS.name!r}: set PYTCS_DATA"
)
def test_every_export_of_pytcs_has_its_names_units_and_times():
    pytest.importorskip("pytcs")
    for name in NAMES:
        file = read_channels(EXPORTS / name)
        channels = [one for one in file.signals if one in file.clocks]
        assert len(channels) == (19 if "noOS" in name else 21), name
        assert file.notes == {}
        assert {"var_REAL64", "test space", "test space (1)", "test_special([{äöü!?ß$²}])"} <= set(
            channels
        )
        assert {one: file.unit(one) for one in channels if file.unit(one)} == {
            "func_units_unscaled": "V",
            "func_units_scaled": "dV",
        }
        rates = {one: file.sampling_frequency(None, (one,)) for one in channels}
        assert all(
            fs == 1000 for one, fs in rates.items() if one not in ("func_OS", "func_freesample")
        ), name
        assert (rates.get("func_OS", 5000), rates.get("func_freesample", 200)) == (5000, 200)
        # a ramp of one a millisecond, whole numbers or not; the 5 kHz channel counts milliseconds
        assert np.array_equal(file.arrays["var_REAL64"], np.arange(1000))
        assert np.allclose(file.seconds("var_REAL64"), np.arange(1000) / 1000)
        if "noOS" not in name:
            assert np.allclose(file.arrays["func_OS"], np.arange(4996) / 5)


def export(delimiter="\t", decimal=",", names=("torque", "pos space", "pos space (1)"), quote=""):
    """A file as TwinCAT Scope writes it: one time axis for two channels at 4 kHz, another one at 1
    kHz.
    """

    def number(x):
        return f"{x:.9g}".replace(".", decimal)

    def row(key, fast, second, slow):
        return delimiter.join([key, fast, second, key, slow])

    head = [
        delimiter.join(["Name", f"{quote}axis{quote}"]),
        delimiter.join(["File", f"{quote}C:\\axis.csv{quote}"]),
        delimiter.join(
            [
                f"{quote}Starttime of export{quote}",
                "132959733843760000",
                f"{quote}Montag, 2. Mai{quote}",
            ]
        ),
        delimiter.join(
            [
                f"{quote}Endtime of export{quote}",
                "132959733853750000",
                f"{quote}Montag, 2. Mai{quote}",
            ]
        ),
        "",
        "",
        row("Name", names[0], names[1], names[2]),
        row("SymbolComment", "", "", ""),
        row("Data-Type", "REAL64", "REAL64", "REAL32"),
        row("SampleTime[ms]", "0,25", "0,25", "1"),
        row("Offset", "0", "0", "0"),
        row("ScaleFactor", "1", "1", "1"),
        row("Unit", "Nm (Torque)", "mm (Length)", "(None)"),
        row("Unit ScaleFactor", "1", "1", "1"),
        row("Unit Offset", "0", "0", "0"),
        "",
    ]
    body = []
    for i in range(400):
        cells = [number(1e3 * T[i]), number(U[i]), number(Y[i])]
        body.append(
            delimiter.join([*cells, *([number(i), number(2.0 * i)] if i < 100 else [" ", " "])])
        )
    return "\n".join([*head, *body, "EOF", ""])


FORMS = [("\t", ","), ("\t", "."), (";", ","), (":", "."), (",", "."), (" ", ".")]


@pytest.mark.parametrize(("delimiter", "decimal"), FORMS)
@pytest.mark.parametrize("packed", [False, True])
def test_an_export_loads_whatever_parts_its_cells(tmp_path, delimiter, decimal, packed):
    pytest.importorskip("pytcs")
    text = export(delimiter, decimal, quote='"' if delimiter == " " else "").encode()
    if delimiter == " ":  # cells without a number are left out at the end of the line
        text = text.replace(b"    \n", b"\n")
    path = tmp_path / ("axis.csv.gz" if packed else "axis.csv")
    path.write_bytes(gzip.compress(text) if packed else text)
    file = read_channels(path)
    assert [one for one in file.signals if one in file.clocks] == [
        "torque",
        "pos space",
        "pos space (1)",
    ]
    assert np.allclose(file.arrays["torque"], U)
    assert np.allclose(file.arrays["pos space"], Y)
    assert np.allclose(file.seconds("torque"), T)
    assert [file.unit(one) for one in ("torque", "pos space", "pos space (1)")] == ["Nm", "mm", ""]
    assert file.sampling_frequency(None, ("torque", "pos space")) == 4000
    assert file.sampling_frequency(None, ("pos space (1)",)) == 1000
    with pytest.raises(
        ValueError, match=r"u and y must be sampled together, but .* at 4000 Hz, .* at 1000 Hz"
    ):
        file.sampling_frequency(None, ("torque", "pos space (1)"))


def test_an_export_with_names_that_cannot_be_told_apart_says_how_to_export(tmp_path):
    pytest.importorskip("pytcs")
    path = tmp_path / "axis.csv"
    path.write_text(export(" ", ".", names=("motor torque", "speed", "way"), quote='"'))
    with pytest.raises(ValueError, match="cannot be separated: export it with tabs or semicolons"):
        read_channels(path)


def test_without_pytcs_one_line_says_what_to_install(tmp_path, monkeypatch):
    path = tmp_path / "axis.csv"
    path.write_text(export())
    hidden = tmp_path / "reader.py"
    hidden.write_text("def contents(path):\n    import pytcs_that_is_missing\n")
    monkeypatch.setattr(
        sys.modules["nlfrf.io.measurement_files"].TWINCAT.contents, "__file__", str(hidden)
    )
    with pytest.raises(
        ValueError,
        match=r"needs pytcs_that_is_missing, which is not installed: pip install 'nlfrf\[tw",
    ):
        read_channels(path)


# ---- Tables.


def table(head, *columns, separator=","):
    return "\n".join(
        [head, *(separator.join(f"{x:.9g}" for x in row) for row in zip(*columns, strict=True))]
    )


def written(tmp_path, text):
    path = tmp_path / "trace.csv"
    path.write_text(text)
    return read_channels(path)


def test_an_index_in_brackets_is_no_unit(tmp_path):
    file = written(
        tmp_path, table("t [s],setpoint[0],DCOM(0),force [N],map(1;2),ratio [1]", T, U, Y, U, Y, U)
    )
    assert file.signals == ["t [s]", "setpoint[0]", "DCOM(0)", "force [N]", "map(1;2)", "ratio [1]"]
    assert [file.unit(one) for one in file.signals] == ["s", "", "", "N", "", "1"]
    assert file.labels("setpoint[0]", "force")["u_name"] == "setpoint[0]"
    assert file.full_name("ratio") == "ratio [1]"


@pytest.mark.parametrize(
    "units", ["ms,A,mm,1/min", "ms,A,INC,U/min", "[ms],[A],[mm],[per mille]", "ms,A,mm,per mille"]
)
def test_a_row_of_units_below_the_names(tmp_path, units):
    file = written(tmp_path, table(f"time,current,position,speed\n{units}", 1e3 * T, U, Y, U))
    assert file.signals == ["time", "current", "position", "speed"]
    assert [file.unit(one) for one in file.signals] == [one.strip("[]") for one in units.split(",")]
    assert file.sampling_frequency(None, ("current", "position")) == 4000


def test_a_row_of_groups_above_the_names_is_no_row_of_names(tmp_path):
    assert written(tmp_path, table("Motor,Motor,Load\ntime,A,V", T, U, Y)).signals == [
        "time",
        "A",
        "V",
    ]


@pytest.mark.parametrize("name", ["time", "t", "Zeit", "sample_time_us", "time [ms]"])
def test_a_constant_parameter_is_no_time_axis(tmp_path, name):
    constant = np.full(400, 250.0)
    other = "t [s]" if name != "t" else "time [s]"
    file = written(tmp_path, table(f"{name},u,y,{other}", constant, U, Y, T))
    assert file.sampling_frequency(None, ("u", "y")) == 4000
    assert file.time == other


@pytest.mark.parametrize(
    ("name", "number"),
    [
        ("Ts_us", 250.0),
        ("dt_ms", 0.25),
        ("Ts", 250e-6),
        ("Sample Time [us]", 250.0),
        ("fs_kHz", 4.0),
    ],
)
def test_a_constant_sampling_time_is_a_clock_in_its_unit(tmp_path, name, number):
    assert (
        written(tmp_path, table(f"u,y,{name}", U, Y, np.full(400, number))).sampling_frequency(
            None, ("u", "y")
        )
        == 4000
    )
    np.savez(tmp_path / "trace.npz", u=U, y=Y, **{name: number})
    assert read_channels(tmp_path / "trace.npz").sampling_frequency(None, ("u", "y")) == 4000


@pytest.mark.parametrize(
    "line",
    [
        "Sampling time [us]: 250",
        "SampleTime(µs),250",
        "Abtastzeit: 250 µs",
        "Cycle time: 250 us",
        "Zykluszeit: 0.25 ms",
    ],
)
def test_a_line_above_the_table_tells_the_sampling_time_in_microseconds(tmp_path, line):
    assert (
        written(tmp_path, table(f"{line}\nu,y", U, Y)).sampling_frequency(None, ("u", "y")) == 4000
    )


def test_a_temperature_called_ts_is_no_clock(tmp_path):
    with pytest.raises(ValueError, match="fs must be given"):
        written(tmp_path, table("u,y,Ts", U, Y, np.full(400, 25.0))).sampling_frequency(
            None, ("u", "y")
        )


def test_a_record_from_a_compressed_table_is_that_of_the_table(tmp_path):
    ms = nlfrf.multisine(fs=4000, n_samples=400, f_min=20, f_max=500, rng=1)
    played = np.tile(ms.u[0], 3)
    text = table("time [s],force [N],position [m]", np.arange(1200) / 4000, played, 2 * played)
    (tmp_path / "a.csv").write_text(text)
    (tmp_path / "a.csv.gz").write_bytes(gzip.compress(text.encode()))
    plain, packed = (
        nlfrf.load_record(tmp_path / name, u="force", y="position")
        for name in ("a.csv", "a.csv.gz")
    )
    assert np.array_equal(plain.u, packed.u)
    assert np.array_equal(plain.y, packed.y)
    assert (packed.u_unit, packed.y_unit, packed.fs) == ("N", "m", 4000)
    assert "a.csv.gz" in unwrapped(nlfrf.inspect_file(tmp_path / "a.csv.gz"))


def test_a_broken_or_boundless_compressed_table_is_refused(tmp_path):
    path = tmp_path / "a.csv.gz"
    whole = gzip.compress(table("t,u,y", T, U, Y).encode())
    for content in (whole[: len(whole) // 2], b"no gzip at all", whole[:-8] + b"\0" * 8):
        path.write_bytes(content)
        with pytest.raises(
            ValueError, match=r"path must be a readable \.gz file, got 'a\.csv\.gz'"
        ):
            read_channels(path)
    (tmp_path / "a.mat.gz").write_bytes(whole)
    with pytest.raises(ValueError, match=r"path must end in .*\.csv\.gz"):
        read_channels(tmp_path / "a.mat.gz")


# ---- .npy


def test_an_array_of_numpy_is_its_columns(tmp_path):
    np.save(tmp_path / "a.npy", np.column_stack([T, U, Y]))
    file = read_channels(tmp_path / "a.npy")
    assert np.array_equal(file.arrays["data.2"], U)
    assert file.sampling_frequency(None, ("data.2", "data.3")) == 4000


def test_a_structured_array_has_named_columns(tmp_path):
    table_ = np.zeros(400, dtype=[("time", float), ("u", "f4"), ("count", "i4")])
    table_["time"], table_["u"], table_["count"] = T, U, np.arange(400)
    np.save(tmp_path / "a.npy", table_)
    file = read_channels(tmp_path / "a.npy")
    assert file.signals == ["time", "u", "count"]
    assert np.array_equal(file.arrays["u"], U.astype("f4"))
    assert file.sampling_frequency(None, ("u", "count")) == 4000


def test_an_array_of_objects_or_of_a_header_that_lies_is_refused(tmp_path):
    path = tmp_path / "a.npy"
    np.save(path, np.array([{"a": 1}], dtype=object), allow_pickle=True)
    with pytest.raises(ValueError, match="pickles are never read"):
        read_channels(path)
    for shape in ("(40000,)", "(9999999999999,)"):
        head = (
            f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".ljust(117).encode()
            + b"\n"
        )
        path.write_bytes(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head + U.tobytes())
        with pytest.raises(ValueError, match=r"path must be a readable \.npy file"):
            read_channels(path)
    for content in (b"", b"\x93NUMPY", b"not an array"):
        path.write_bytes(content)
        with pytest.raises(ValueError, match=r"path must be a readable \.npy file"):
            read_channels(path)
