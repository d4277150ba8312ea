"""A look into a file, and records of several inputs out of files."""

import json
import shlex

import numpy as np
import pytest

import nlfrf
from tests.nlfrf.test_cli import nlfrf_command  # noqa: F401 (a fixture)
from tests.support import measurement_files as files
from tests.support.measurement_files import FS, MS, N, P, T, U, Y
from tests.support.printed import unwrapped


def test_a_file_tells_its_channels_and_the_command_to_run(tmp_path):
    table = np.column_stack([T, 20 + 0 * T, Y, U, 1e-3 * np.cumsum(U)])
    head = "time,temperature,position,force,drift\nms,°C,mm,N,1"
    table[:, 0] *= 1e3
    np.savetxt(
        tmp_path / "my run.csv",
        table,
        delimiter=",",
        header=head,
        comments="",
        fmt="%.6f",
        encoding="utf-8",
    )
    found = nlfrf.inspect_file(tmp_path / "my run.csv")
    assert (found.u, found.y, found.period) == ("force", "position", N)
    assert [(c.name, c.unit, c.n) for c in found.channels][:2] == [
        ("time", "ms", U.size),
        ("temperature", "°C", U.size),
    ]
    assert all(c.fs == FS for c in found.channels)
    assert found.channels[3].rms == pytest.approx(np.sqrt(np.mean(U**2)), rel=1e-5)
    assert (
        found.lines
        == f"period 250 samples (0.25 s), {P} periods; {MS.f.size} lines from 4 to 196 Hz"
    )
    assert str(found).splitlines()[-1] == f"run:   {found.command}"
    assert "--input force --output position --hold unknown -o 'my run-bla.npz'" in found.command
    assert "hold: zoh if the input is a command, band-limited if it was measured" in unwrapped(
        found
    )


def test_a_set_point_is_an_input_that_is_held_and_no_output(tmp_path):
    names = "position set point [m],position [m],current [A],current set point [A]"
    table = np.column_stack([2 * U, Y, U + 1e-3, U])
    np.savetxt(tmp_path / "trace.csv", table, delimiter=",", header=names, comments="")
    found = nlfrf.inspect_file(tmp_path / "trace.csv")
    assert (found.u, found.y) == ("current set point [A]", "position [m]")
    assert "--input 'current set point [A]' --output 'position [m]' --hold zoh" in found.command
    assert "hold:" not in str(found)
    assert found.reference == "position set point [m]"
    np.savetxt(
        tmp_path / "measured.csv",
        table[:, :3],
        delimiter=",",
        header=names.rpartition(",")[0],
        comments="",
    )
    found = nlfrf.inspect_file(tmp_path / "measured.csv")
    assert (found.u, found.y) == ("current [A]", "position [m]")
    assert "--hold unknown --reference 'position set point [m]' --fs HERTZ" in found.command
    assert "hold:" in str(found)


def closed_loop(names, *columns):
    """Write a table with a time column; the reference r, its force and its position behind it
    repeat together.
    """
    return lambda path: np.savetxt(
        path,
        np.column_stack([T, *columns]),
        delimiter=",",
        header=f"t [s],{names}",
        comments="",
        fmt="%.9g",
    )


COUNTER, CLOCK = (
    np.arange(U.size),
    1.7e9 + np.cumsum(1 + 0.3 * np.random.default_rng(1).random(U.size)),
)
FORCE = np.roll(U, 3) + 0.2 * Y
NOISE = 1e-3 * np.random.default_rng(3).standard_normal(U.size)


@pytest.mark.parametrize(
    ("names", "columns", "expected"),
    [
        ("reference,force,position", (U, FORCE, Y), ("force", "position", "reference")),
        (
            "position reference,force,position",
            (U, FORCE, Y),
            ("force", "position", "position reference"),
        ),
        ("Lage_Soll,Strom,Lage_Ist", (U, FORCE, Y), ("Strom", "Lage_Ist", "Lage_Soll")),
        ("r,force,position", (U, FORCE, Y), ("force", "position", "r")),
        (
            "generator,force,position",
            (U, FORCE + NOISE, Y + NOISE),
            ("force", "position", "generator"),
        ),
        ("temperature,force,position", (U + NOISE, FORCE, Y), ("force", "position", "")),
        ("target,position,torque", (U, Y, FORCE), ("torque", "position", "target")),
        ("reference,position", (U, Y), ("reference", "position", "")),
        (
            "position command,force,position",
            (U, FORCE, Y),
            ("force", "position", "position command"),
        ),
        (
            "force,sequence,position",
            (U, np.random.default_rng(2).random(U.size), Y),
            ("force", "position", ""),
        ),
        ("cmd,force,position", (U, FORCE, Y), ("force", "position", "cmd")),
        ("cmd,position", (U, Y), ("cmd", "position", "")),
        (
            "set point,force,position",
            (np.sign(COUNTER - 300), FORCE, Y),
            ("force", "position", ""),
        ),  # repeats not
        ("force,encoder index,position", (U, COUNTER, Y), ("force", "position", "")),
        ("position clock,force,accel", (CLOCK, U, Y), ("force", "accel", "")),
        ("force,measured,other", (U, -(COUNTER**2), Y), ("force", "other", "")),
        ("force,enc cycle,other", (U, COUNTER % 240, Y), ("force", "other", "")),
        ("force,distance", (U, Y), ("force", "distance", "")),
        ("force,frequency", (U, 1 + COUNTER), ("force", "", "")),
    ],
)
def test_what_is_proposed_goes_by_what_a_channel_can_be(
    names,
    columns,
    expected,
    nlfrf_command,  # noqa: F811
    tmp_path,
):
    """A counter, a clock and frequencies are no outputs, nor is a reference; what is printed runs
    as it stands.
    """
    closed_loop(names, *columns)(tmp_path / "run.csv")
    found = nlfrf.inspect_file(tmp_path / "run.csv")
    assert (found.u, found.y, found.reference) == expected
    if found.y:
        command = str(found).splitlines()[-1].removeprefix("run:   nlfrf ")
        code, out, err = nlfrf_command(*shlex.split(command))
        assert code == 0, err
        held = found.u in ("cmd", "reference")
        assert nlfrf.load(tmp_path / "run-bla.npz").hold == ("zoh" if held else "unknown")
        assert ("includes its hold, which turns the phase by -35.3 deg" in unwrapped(out)) != held
    else:
        assert "frequency: rises or falls throughout" in str(found)
        assert "--output OUTPUT" in found.command


def test_without_names_the_input_is_the_channel_with_even_lines(tmp_path):
    slow = np.cumsum(Y - Y.mean())
    np.savetxt(tmp_path / "run.csv", np.column_stack([slow, U]), delimiter=",")
    found = nlfrf.inspect_file(tmp_path / "run.csv")
    assert (found.u, found.y) == ("col2", "col1")
    assert found.command.endswith(
        "--input col2 --output col1 --hold unknown --fs HERTZ -o run-bla.npz"
    )


def test_what_does_not_repeat_has_no_input(tmp_path):
    noise = np.random.default_rng(0).standard_normal((2, 500))
    np.savez(tmp_path / "noise.npz", a=noise[0], b=noise[1], note="first")
    found = nlfrf.inspect_file(tmp_path / "noise.npz")
    assert (found.u, found.period, found.lines) == ("", 0.0, "no channel repeats")
    assert "--input INPUT" in found.command


def test_what_this_package_wrote_is_called_so(tmp_path):
    record = nlfrf.Record(u=U.reshape(1, P, N), y=Y.reshape(1, P, N), fs=FS, lines=MS.lines)
    nlfrf.save(record, tmp_path / "r.npz")
    found = nlfrf.inspect_file(tmp_path / "r.npz")
    assert found.schema == "nlfrf-record"
    assert [(channel.name, channel.n) for channel in found.channels] == [("u", P * N), ("y", P * N)]
    assert f"1 realisation x {P} periods x {N} samples, " in unwrapped(found)
    assert "written by this package, as nlfrf-record\nrun:   nlfrf identify" in str(found)
    nlfrf.save(nlfrf.identify(record), tmp_path / "bla.npz")
    said = str(nlfrf.inspect_file(tmp_path / "bla.npz"))
    assert said.startswith("bla.npz: nlfrf-bla\nBLA on ")
    assert "run:" not in said


@pytest.mark.parametrize("closed", [False, True])
def test_what_several_inputs_are_is_told(closed, tmp_path):
    ms = nlfrf.multisine("random-odd", fs=256, n_samples=256, f_min=2, f_max=100, n_inputs=2, rng=1)
    u = np.repeat(ms.u[:, :, None], 2, axis=2)
    names = {"inputs": ("fx", "fy"), "outputs": ("x", "y")}
    record = nlfrf.Record(u=u, y=u[::-1], r=u if closed else None, fs=256, lines=ms.lines, **names)
    nlfrf.save(record, tmp_path / "r.npz")
    nlfrf.save(ms, tmp_path / "ms.npz")
    found = nlfrf.inspect_file(tmp_path / "r.npz")
    assert [channel.name for channel in found.channels] == [
        "fx",
        "fy",
        "x",
        "y",
        *["r fx", "r fy"] * closed,
    ]
    assert (
        found.lines
        == "2 experiments x 2 periods x 256 samples, 37 lines from 3 to 99 Hz, hold unknown"
    )
    assert "2 experiments x 256 samples, 37 lines" in unwrapped(
        nlfrf.inspect_file(tmp_path / "ms.npz")
    )


def test_from_inspect_to_identify_on_the_command_line(nlfrf_command, tmp_path):  # noqa: F811
    files.write_csv(tmp_path / "run.csv")
    code, out, _ = nlfrf_command("inspect", "run.csv")
    assert code == 0
    command = out.splitlines()[-1].removeprefix("run:   nlfrf ")
    assert nlfrf_command(*shlex.split(command))[0] == 0
    bla = nlfrf.load(tmp_path / "run-bla.npz")
    assert bla.unit == "mm/N"
    code, out, _ = nlfrf_command("inspect", "run.csv", "--json")
    told = json.loads(out)[0]
    assert (told["u"], told["y"], told["channels"][1]["unit"]) == ("u", "y", "N")
    code, _, err = nlfrf_command("inspect", "no.csv")
    assert code == 2
    assert err.startswith("nlfrf: path must be an existing file")


def test_several_inputs_of_files_make_a_matrix(nlfrf_command, tmp_path):  # noqa: F811
    ms = nlfrf.multisine(fs=100, n_samples=100, f_min=1, f_max=40, n_inputs=2, rng=1)
    G = np.array([[1.0, 0.5], [0.0, 2.0], [1.0, 1.0]])
    for m in range(2):
        u = np.tile(ms.u[:, m], 3)
        rows = np.vstack([np.arange(300) / 100, u, G @ u]).T
        np.savetxt(
            tmp_path / f"run{m}.csv",
            rows,
            delimiter=",",
            header="t [s],fx,fy,x,y,z",
            comments="",
            fmt="%.17g",
        )
    paths = [tmp_path / f"run{m}.csv" for m in range(2)]
    record = nlfrf.load_record(paths, u=["fx", "fy"], y=["x", "y", "z"], n_samples=100)
    assert (record.inputs, record.outputs, record.fs) == (("fx", "fy"), ("x", "y", "z"), 100)
    found = nlfrf.identify(record)
    np.testing.assert_allclose(found.G, np.repeat(G[..., None], found.f.size, axis=2), atol=1e-9)
    command = "identify run0.csv run1.csv --input fx,fy --output x,y,z --period 100 -o G"
    assert nlfrf_command(*command.split())[0] == 2  # a matrix is a table
    assert nlfrf_command(*f"{command}.csv".split())[0] == 0
    table = np.genfromtxt(tmp_path / "G.csv", delimiter=",", names=True)
    np.testing.assert_allclose(table["Re_yfy"], 2.0, rtol=1e-9)
    with pytest.raises(ValueError, match="u, y and r must be lists of names"):
        nlfrf.load_record(paths, u=["fx", "fy"], y=[])


def test_lost_rows_are_named_where_no_period_is_found(tmp_path):
    rng, n = np.random.default_rng(0), 3000
    rows = [
        f"{k / 1000:.3f},{rng.standard_normal():.9f},{rng.standard_normal():.9f}"
        for k in range(n)
        if not 1000 <= k < 1004
    ]
    (tmp_path / "run.csv").write_text("\n".join(["t [s],u [N],y [m]", *rows]) + "\n")
    found = nlfrf.inspect_file(tmp_path / "run.csv")
    assert found.period == 0
    assert found.lost == "time jumps by five samples at 1 s: four samples lost"
