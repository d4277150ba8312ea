"""What a test engineer runs into in the first hour: lines, formats, numbers in tables, help."""

import re
import sys

import numpy as np
import pytest

import nlfrf
from nlfrf import cli as measuring
from robust import cli as controlling

BAND = "nlfrf design --fs 2000 --period 8000 --f-max 200 --seed 1"


@pytest.fixture
def command(monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)

    def run(line):
        monkeypatch.setattr(sys, "argv", line.split())
        with pytest.raises(SystemExit) as stop:
            {"nlfrf": measuring, "robust": controlling}[line.split()[0]].main()
        said = capsys.readouterr()
        return stop.value.code or 0, said.out, said.err

    return run


@pytest.mark.parametrize("kind", ["special-odd", "odd-odd"])
def test_what_the_warning_asks_for_has_a_line_there(command, kind, tmp_path):
    """4aa289a said that the band begins at 2.25 Hz instead of 1, and not why, nor what to ask
    for.
    """
    _, _, err = command(f"{BAND} --kind {kind} --f-min 1 -o exc.npz")
    assert f"a {kind} grid has the lines" in err
    if kind == "special-odd":
        assert "or --f-min 0.75, which leaves a gap in the lines from 0.75 to 2.25 Hz" in err
    for asked in re.findall(r"--f-min [\d.]+|--period \d+", err):
        line = (
            BAND.replace("--period 8000", asked) + " --f-min 1"
            if "period" in asked
            else f"{BAND} {asked}"
        )
        assert command(f"{line} --kind {kind} -o cured.npz --overwrite")[0] == 0
        assert nlfrf.load(tmp_path / "cured.npz").f[0] <= 1.2


def test_a_frequency_below_the_resolution_asks_for_its_period(command, tmp_path):
    _, _, err = command(f"{BAND} --f-min 0.1 -o exc.npz")
    assert "a period of 4 s has no line below 0.25 Hz: give --period 20000" in err
    _, _, err = command(f"{BAND.replace('8000', '20000')} --f-min 0.1 -o exc.npz")
    assert "warning" not in err
    assert nlfrf.load(tmp_path / "exc.npz").f[0] == pytest.approx(0.1)


def test_a_wav_file_says_its_full_scale_in_units(command, tmp_path):
    code, out, _ = command(f"{BAND} --f-min 0.25 --rms 3 -o exc.wav")
    assert code == 0
    scale = float(
        re.search(r"full scale of the WAV file is ([\d.]+), in the unit of --rms", out)[1]
    )
    ms = nlfrf.load(tmp_path / "exc.npz")
    assert scale == pytest.approx(np.abs(ms.u).max(), rel=1e-5)


def test_all_five_formats_are_named(command):
    code, _, err = command(f"{BAND} --f-min 0.25 -o exc.xlsx")
    assert code == 2
    for suffix in (".npz", ".h5", ".csv", ".mat", ".wav"):
        assert suffix in err


def test_tables_hold_the_shortest_digits_that_are_exact(command, tmp_path):
    """4aa289a wrote 0.00050000000000000001."""
    assert command(f"{BAND} --f-min 0.25 -o exc.csv")[0] == 0
    text = (tmp_path / "exc.csv").read_text()
    assert text.splitlines()[2].startswith("0.0005,")
    table = np.loadtxt(tmp_path / "exc.csv", delimiter=",", skiprows=1)
    np.testing.assert_array_equal(table[:, 1], nlfrf.load(tmp_path / "exc.npz").u[0])
    assert all(len(cell) <= 24 for cell in text.replace("\n", ",").split(","))


def test_decimal_commas_come_back_exactly(command, tmp_path):
    assert command(f"{BAND} --f-min 0.25 --rms 0.25 -o exc.csv --decimal ,")[0] == 0
    assert (tmp_path / "exc.csv").read_text().startswith("t [s];u0\n0,0;")
    assert (
        command(f"{BAND} --f-min 0.25 --rms 0.25 -o exc.csv --decimal ,")[0] == 0
    )  # known as one of ours
    assert command("nlfrf simulate exc.npz -o run.csv --decimal ,")[0] == 0
    assert command("nlfrf simulate exc.npz -o run.npz")[0] == 0
    comma = nlfrf.load_record(tmp_path / "run.csv", fs=2000, n_samples=8000)
    np.testing.assert_array_equal(comma.y, nlfrf.load_record(tmp_path / "run.npz").y)
    for decimal in (",", "."):
        assert command(f"nlfrf identify run.npz --csv --decimal {decimal} -o bla.npz")[0] == 0
    assert command("nlfrf identify run.npz --csv --decimal ; -o bla.npz")[0] == 2


@pytest.mark.parametrize("program", ["nlfrf", "robust"])
def test_help_is_not_cut_short(command, program):
    code, out, _ = command(f"{program} --help")
    assert code == 0
    assert "..." not in out.split("Commands:")[1]
