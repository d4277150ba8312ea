"""Names, units and clocks above a text table: each column is the one that its name says, or is
refused with a cure.
"""

import numpy as np
import pytest

import nlfrf
from nlfrf.io.measurement_files import read_channels
from tests.support.measurement_files import FS, T, U, Y, lvm

N = U.size
NUMBERS = np.arange(1, N + 1)
#: Separator and decimal sign.
CUTS = [(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ","), (" ", "."), ("|", ".")]


def rows(*columns, sep=",", decimal=".", quoted=()):
    """Lines of a table, the columns of these places in quotes."""

    def cell(j, held):
        text = held if isinstance(held, str) else f"{held:.13g}".replace(".", decimal)
        return f'"{text}"' if j in quoted else text

    return [
        sep.join(cell(j, held) for j, held in enumerate(row)) for row in zip(*columns, strict=True)
    ]


def written(tmp_path, lines, end="\n", encoding="utf-8", name="run.csv"):
    path = tmp_path / name
    path.write_bytes((end.join(lines) + end).encode(encoding))
    return path


def holds(path, u="u", y="y", rate=FS, factor=1.0, **options):
    """The record is the one that was written; return it."""
    record = nlfrf.load_record(path, u=u, y=y, **options)
    assert record.fs == pytest.approx(rate, rel=1e-6)
    np.testing.assert_allclose(record.u.ravel(), U, atol=2e-6)
    np.testing.assert_allclose(record.y.ravel(), factor * Y, atol=2e-6 * factor)
    return record


# Fewer names than columns

ANGLE = np.cumsum(np.abs(U) + 0.1)


@pytest.mark.parametrize(("sep", "decimal"), CUTS)
@pytest.mark.parametrize("quoted", [False, True])
def test_an_index_without_a_name_moves_the_names_to_the_last_columns(
    sep, decimal, quoted, tmp_path
):
    names = ['"t"', '"u"', '"z"', '"y"'] if quoted else ["t", "u", "z", "y"]
    body = rows(NUMBERS, T, U, 7 * Y, Y, sep=sep, decimal=decimal, quoted=(0,) * quoted)
    for end, encoding, blank in (
        ("\n", "utf-8", []),
        ("\r\n", "utf-8-sig", []),
        ("\r\n", "utf-8", ["", ""]),
    ):
        holds(written(tmp_path, [*blank, sep.join(names), *blank, *body], end, encoding))


INDICES = {
    "row numbers": NUMBERS,
    "row numbers from 0": NUMBERS - 1,
    "seconds": T + 0.5,
    "epoch seconds": 1.7e9 + T,
    "epoch milliseconds": 1.7e12 + 1e3 * T,
    "rounded seconds": np.round(T, 2) + T * 1e-9,
    "dates": [f"2026-11-22 10:00:{s:09.6f}" for s in T],
    "times of day": [f"23:59:{s:09.6f}" for s in T],
    "texts": [f"row{i}" for i in NUMBERS],
}


@pytest.mark.parametrize("index", INDICES)
@pytest.mark.parametrize("sep", [",", ";", "\t"])
def test_any_index_without_a_name(index, sep, tmp_path):
    path = written(
        tmp_path, [sep.join(("u", "z", "y")), *rows(INDICES[index], U, 7 * Y, Y, sep=sep)]
    )
    if index == "texts":  # no clock shows which column has no name
        with pytest.raises(
            ValueError, match="got 'u'; 'u' is one of 3 names above 4 columns: give each"
        ):
            nlfrf.load_record(path, fs=FS)
        return
    holds(path, fs=FS)
    if isinstance(INDICES[index], list):  # dates are a clock, whatever they are called
        holds(path)


@pytest.mark.parametrize(
    "name", ["Uhrzeit", "Zeitstempel", "Date", "Datum", "DateTime", "Date Time"]
)
def test_a_column_of_dates_is_a_clock(name, tmp_path):
    moments = ["01.02.2026" + f" 10:00:{s:06.3f}".replace(".", ",") for s in T]
    body = rows(moments, U, Y, sep=";", decimal=",")
    holds(written(tmp_path, [f"{name};u;y", *body]))


def test_two_names_are_missing(tmp_path):
    holds(written(tmp_path, ["u,z,y", *rows(NUMBERS, T, U, 7 * Y, Y)]), fs=FS)
    holds(written(tmp_path, ["u,z,y", *(f"{row}," for row in rows(NUMBERS, U, 7 * Y, Y))]), fs=FS)
    file = read_channels(written(tmp_path, ["u,z,y", "N,,mm", *rows(NUMBERS, T, U, 7 * Y, Y)]))
    assert [file.unit(name) for name in ("u", "z", "y")] == ["N", "", "mm"]


def test_a_time_decides_where_two_columns_run_forward(tmp_path):
    holds(written(tmp_path, ["t,u,z,y", *rows(T + 0.5, T, U, 7 * Y, Y)]))
    holds(written(tmp_path, ["time [ms];u;z;y", *rows(NUMBERS, 1e3 * T, U, 7 * Y, Y, sep=";")]))


@pytest.mark.parametrize(
    ("header", "columns"),
    [
        ("u,y", (U, Y, 7 * Y)),  # the last name is missing, or the first
        ("t,u,y", (T, U, Y, 7 * Y)),  # a time is no column that runs back and forth
        ("sample,u,y", (NUMBERS, U, Y, 7 * Y)),
        ("u,y", (7 * Y, U, Y)),
        ("t,u,y,z", (U, Y, 7 * Y)),
        ("t,u,y", (T, U, Y, ["OK"] * N)),  # or that of a column between them
        ("frame,u,y", (NUMBERS, U, Y, 7 * Y)),
        ("time_[s],u,y", (T, U, Y, 7 * Y)),
        ("u,y,dead", (NUMBERS, U, Y, [""] * N)),
        ("angle,u", (ANGLE, U, Y)),  # that turns forward, and is no index
        ("t,angle,u", (T, ANGLE, U, Y)),
        ("u,y,z", (U, Y)),
        ("u,y,z", (T, U, Y, 3 * Y, 7 * Y)),
    ],
)
def test_names_that_belong_to_no_column_for_sure_are_refused_with_a_cure(header, columns, tmp_path):
    path = written(tmp_path, [header, *rows(*columns)])
    n = len(header.split(","))
    why = (
        rf"'u' is one of {n} names above {len(columns)} columns: give each column its name, or use"
        r" col1, col2"
    )
    with pytest.raises(
        ValueError, match=rf"u must name a signal of 'run.csv', one of col1, .*; got 'u'; {why}"
    ):
        nlfrf.load_record(path, fs=FS)
    assert f"u: is one of {n} names above {len(columns)} columns" in str(nlfrf.inspect_file(path))
    at = {id(column): f"col{j + 1}" for j, column in enumerate(columns)}
    holds(path, u=at[id(U)], y=at[id(Y)], fs=FS)  # the cure works


def test_columns_that_hold_nothing_need_no_name(tmp_path):
    holds(written(tmp_path, ["t;u;y", *(f"{row};;" for row in rows(T, U, Y, sep=";"))]))
    holds(written(tmp_path, ["t,u,y,,,", *(f"{row},,," for row in rows(T, U, Y))]))
    holds(
        written(tmp_path, ["T,u,y", *(f"{row}," for row in rows(20 + 0.1 * U, U, Y))]), fs=FS
    )  # a temperature
    holds(written(tmp_path, ["t,u,y,,comment", "s,N,mm,,-", *(f"{row}," for row in rows(T, U, Y))]))


# More names than columns


@pytest.mark.parametrize("remark", ["comment", "Comments", "shapers:", "Bemerkung", '"note"'])
@pytest.mark.parametrize("sep", [",", ";", "\t", " "])
def test_a_remark_behind_the_names_has_no_column(remark, sep, tmp_path):
    holds(written(tmp_path, [sep.join(("t", "u", "y", remark)), *rows(T, U, Y, sep=sep)]))
    holds(written(tmp_path, [sep.join(("u", "y", remark)), *rows(U, Y, sep=sep)]), fs=FS)


def test_a_remark_of_its_own_column_stays(tmp_path):
    file = read_channels(written(tmp_path, ["t,u,note", *rows(T, U, Y)]))
    np.testing.assert_allclose(file.arrays["note"], Y, atol=2e-6)
    holds(written(tmp_path, ["t,u,y,comment", *rows(T, U, Y, ["", "start"] + [""] * (N - 2))]))


# Rows above the numbers

MS = 1e3 * T
BODIES = {
    "Mitsubishi": (
        [
            "Axis1",
            "Number of sampling data,750",
            "Sampling time interval(ms),1.000",
            "Time,Analog 1,Analog 2,Digital 1",
            "ms,u,y,INP",
            *rows(MS, U, Y, np.full(N, 2.5)),
        ],
        ("", ""),
    ),
    "Mitsubishi, units in brackets": (
        ["Time;Analog 1;Analog 2", "(ms);u;y", *rows(MS, U, Y, sep=";", decimal=",")],
        ("", ""),
    ),
    "unknown units": (["time,u,y", "ms,furlong,parsec", *rows(MS, U, Y)], ("furlong", "parsec")),
    "DAQExpress": (
        [
            "Timestamp,2026-01-01 10:00:00,Timestamp,2026-01-01 10:00:00",
            "Interval,0.001,Interval,0.001",
            'Channel name,"u",Channel name,"y"',
            'Unit,"N",Unit,"mm"',
            *rows(T, U, T, Y),
        ],
        ("N", "mm"),
    ),
    "Rigol": (
        [
            "X,u,y,Start,Increment",
            "Sequence,Volt,Volt,-2.0e+00,1.0e-03",
            *(f"{row},," for row in rows(NUMBERS, U, Y)),
        ],
        ("Volt", "Volt"),
    ),
    "Rigol, a step in a cell": (
        ["u,y,t0 =-0.5, tInc = 1.0e-03,", *(f"{row},,," for row in rows(U, Y))],
        ("", ""),
    ),
    "Siglent": (
        [
            "Record Length,750",
            "Sample Interval,0.001",
            "Vertical Units,V",
            "Horizontal Units,s,,",
            "Serial Number,X",
            "",
            "Source,u,y",
            "Second,Volt,Volt",
            *rows(T - 2, U, Y),
        ],
        ("Volt", "Volt"),
    ),
    "labels beside the columns": (
        ["Name,u,y", "Unit,N,mm", "Sample rate,1000,1000", *rows(U, Y)],
        ("N", "mm"),
    ),
    "one name for each label": (
        ["Name;u;y", "Einheit;N;mm", *rows(T, U, Y, sep=";", decimal=",")],
        ("N", "mm"),
    ),
    "Tektronix MSO": (
        [
            "Model,MSO24",
            "Label,A,B",
            "Horizontal Units,ms",
            "Sample Interval,1E+00",
            "Vertical Units,V,mV",
            ",,",
            "TIME,u,y",
            *rows(MS, U, Y),
        ],
        ("V", "mV"),
    ),
    "Yaskawa": (
        ["Trace", "Sampling time,1000,[us]", "Data number,750", "u[%],y[min-1]", *rows(U, Y)],
        ("%", "min-1"),
    ),
    "PicoScope": (["Time,u,y", "(ms),(V),(mV)", "", *rows(MS, U, Y)], ("V", "mV")),
    "a blank row above the units": (
        ["Time,u,y", "", "(ms),(V),(mV)", *rows(MS, U, Y)],
        ("V", "mV"),
    ),
    "Origin": (
        ["t\tu\ty", "ms\tN\tmm", "\tload cell\tencoder", *rows(MS, U, Y, sep="\t")],
        ("N", "mm"),
    ),
    "Klipper": (["##overflows=0,errors=0", "#t,u,y,z", *rows(T, U, Y, 9 * U)], ("", "")),
    "a remark below the names": (["# t,u,y", "# trigger", *rows(T, U, Y)], ("", "")),
    "types and units": (["t,u,y", "double,double,double", "ms,N,mm", *rows(MS, U, Y)], ("N", "mm")),
}


@pytest.mark.parametrize("layout", BODIES)
@pytest.mark.parametrize(("end", "encoding"), [("\n", "utf-8"), ("\r\n", "utf-8-sig")])
def test_rows_above_the_numbers(layout, end, encoding, tmp_path):
    lines, units = BODIES[layout]
    record = holds(written(tmp_path, lines, end, encoding))
    assert (record.u_unit, record.y_unit) == units


def test_channels_that_are_called_by_numbers(tmp_path):
    for header in (["x-axis,1,2", "second,Volt,Volt"], ["time;1;2"], ["t\t10\t20"]):
        sep = next(one for one in ",;\t" if one in header[0])
        _, u, y = header[0].split(sep)
        holds(written(tmp_path, [*header, *rows(T, U, Y, sep=sep)]), u=u, y=y)


@pytest.mark.parametrize("sep", [",", ";", "\t"])
def test_a_preamble_beside_the_first_rows(sep, tmp_path):
    left = [sep.join(("Record Length", "750", "")), sep.join(("Sample Interval", "1.0e-03", ""))]
    left += [sep.join(("Source", "CH1", "")), sep.join(("Horizontal Units", "s", ""))]
    body = rows(T - 2, U, Y, sep=sep)
    path = written(
        tmp_path, [f"{left[i] if i < 4 else 2 * sep}{sep}{row}" for i, row in enumerate(body)]
    )
    holds(path, u="col5", y="col6")
    assert read_channels(path).time == "time"


def test_a_time_column_that_only_the_preamble_tells(tmp_path):
    for preamble, t in (("Sample rate: 1 kHz", T), ("Sample interval: 1 ms", MS)):
        path = written(tmp_path, [preamble, *rows(t, U, Y)])
        holds(path, u="col2", y="col3")
    path = written(
        tmp_path, ["Sample rate: 50 Hz", *rows(T, U, Y)]
    )  # which is not that of the first column
    assert "time" not in read_channels(path).arrays


def test_a_preamble_whose_step_has_no_unit(tmp_path):
    path = written(tmp_path, ["Sample interval,0.02", "u,y", *rows(U, Y)])
    with pytest.warns(
        nlfrf.DataWarning, match=r"'Sample interval' names no unit and is 0\.02: 50 Hz if these are"
    ):
        holds(path, rate=50)
    path = written(tmp_path, ["Sample interval,0.25", "u,y", *rows(U, Y)])
    with pytest.raises(
        ValueError, match=r"fs must be given: .*'Sample interval' names no unit and is 0\.25: 4 Hz"
    ):
        nlfrf.load_record(path)
    path = written(tmp_path, ["Interval,1", "u,y", *rows(U, Y)])
    with pytest.raises(
        ValueError, match=r"fs must be given: .*'sampling time' names no unit and is 1: 1 Hz"
    ):
        nlfrf.load_record(path)
    holds(written(tmp_path, ["Sample interval [ms],0.25", "u,y", *rows(U, Y)]), rate=4000)


@pytest.mark.parametrize(("unit", "scale"), [("s", 1.0), ("ms", 1e-3), ("min", 60.0)])
def test_a_step_whose_unit_stands_in_a_line_of_its_own(unit, scale, tmp_path):
    path = written(
        tmp_path,
        [f"Horizontal Units,{unit}", f"Sample Interval,{1e-3 / scale:.12g}", "u,y", *rows(U, Y)],
    )
    holds(path, rate=1000)


# LabVIEW


def labview(x_columns="No", **lines):
    """Lines of a measurement file with other lines of the header."""
    return [
        next((text for key, text in lines.items() if line.startswith(key)), line)
        for line in lvm(x_columns)
    ]


def test_units_of_a_labview_file_stand_above_their_channel(tmp_path):
    record = holds(written(tmp_path, labview(Y_Unit_Label="Y_Unit_Label\t\tmm\t"), name="run.lvm"))
    assert (record.u_unit, record.y_unit) == ("", "mm")


def test_channels_of_a_labview_file_that_begin_at_different_moments(tmp_path):
    def saved(**lines):
        return written(tmp_path, labview(**lines), name="run.lvm")

    holds(saved(Channels="X0\t0.0\t0.0\t"))
    for late in ("X0\t0.0\t4.0E-4\t", "Time\t10:00:00,0000\t10:00:00,0004"):
        with pytest.warns(nlfrf.DataWarning, match=r"'y' begins \+0\.4 samples after 'u'"):
            holds(saved(Channels=late))
    with pytest.raises(
        ValueError, match=r"'y' begins \+3000 samples after 'u'. Resample them to common times"
    ):
        nlfrf.load_record(saved(Channels="X0\t0.0\t3.0\t"))
    holds(saved(Channels="Time\t10:00:00,5\t10:00:00,5"))


def test_a_labview_file_whose_names_have_none_for_the_empty_column_of_times(tmp_path):
    lines = labview(X_Value="u\ty\tComment")
    holds(written(tmp_path, lines, name="run.lvm"))


def test_a_slow_labview_file_counts_in_seconds(tmp_path):
    holds(written(tmp_path, labview(Delta_X="Delta_X\t0.25\t0.25\t"), name="run.lvm"), rate=4)


def test_time_columns_of_each_labview_channel(tmp_path):
    names = "X_Value\tu\tX_Value\ty\tComment"
    for late, warns in ((0.0, False), (0.0004, True)):
        lines = [line for line in labview("Multi") if "\t" in line][:10]
        lines = [names if line.startswith("X_Value") else line for line in lines]
        head = (
            lines[: lines.index(names) + 1]
            if names in lines
            else [*lines, "***End_of_Header***", names]
        )
        path = written(tmp_path, [*head, *rows(T, U, T + late, Y, sep="\t")], name="run.lvm")
        if warns:
            with pytest.warns(nlfrf.DataWarning, match=r"'y' begins \+0\.4 samples after 'u'"):
                holds(path)
        else:
            holds(path)


def test_numbers_of_columns_that_pandas_writes_for_names_are_no_samples(tmp_path):
    holds(written(tmp_path, ["0,1,2", *rows(T, U, Y)]), u="col2", y="col3", fs=FS)
    holds(written(tmp_path, [",0,1,2", *rows(NUMBERS - 1, T, U, Y)]), u="1", y="2", fs=FS)
