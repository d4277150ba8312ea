"""A row that a logger lost is named, by its time; the periods without it are kept, where they
belong.
"""

import json
import shlex
import sys

import numpy as np
import pytest

import nlfrf
from nlfrf import cli
from tests.support.belt import FS, PERIOD, run, write_log

BELT = {"u": "Kraft [N]", "y": "Position [mm]"}


@pytest.fixture
def command(monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)

    def run_command(line):
        monkeypatch.setattr(sys, "argv", shlex.split(line))
        with pytest.raises(SystemExit) as stop:
            cli.main()
        said = capsys.readouterr()
        return stop.value.code or 0, said.out, said.err

    return run_command


def test_the_command_that_inspect_prints_keeps_what_is_good(command, tmp_path):
    """4aa289a printed a period of 3999.5 samples and --resample, which left one period of three."""
    write_log(tmp_path / "belt.csv", lost=[6507])
    code, out, _ = command("nlfrf inspect belt.csv")
    assert code == 0
    assert "time jumps by two samples at 6.507 s: one sample lost; periods 1 and 3 are whole" in out
    assert "period 4000 samples (4 s), 3 periods" in out
    line = (
        next(row for row in out.splitlines() if row.startswith("run:")).removeprefix("run:").strip()
    )
    assert "--resample" not in line
    code, out, err = command(line)
    assert code == 0, err
    assert (
        "time jumps by two samples at 6.507 s: one sample lost; periods 1 and 3 are whole, and kept"
        in err
    )
    whole = nlfrf.identify(nlfrf.load_record(write_log(tmp_path / "whole.csv"), **BELT))
    bla = nlfrf.load(tmp_path / "belt-bla.npz")
    assert (bla.experiment.n_periods, whole.experiment.n_periods) == (2, 3)
    np.testing.assert_array_equal(bla.f, whole.f)
    assert np.median(np.abs(bla.G / whole.G - 1)) < 1e-3
    assert np.median(bla.bound() / whole.bound()) < 1.1
    code, out, _ = command("nlfrf inspect belt.csv --json")
    assert json.loads(out)[0]["lost"].startswith("time jumps by two samples at 6.507 s")


@pytest.mark.parametrize(
    ("lost", "kept", "said"),
    [
        ([100], [1, 2], "at 0.1 s: one sample lost; periods 2 and 3 are whole"),
        ([11000], [0, 1], "at 11 s: one sample lost; periods 1 and 2 are whole"),
        (
            [5000, 5001, 5002],
            [0, 2],
            "jumps by four samples at 5 s: three samples lost; periods 1 and 3 are whole",
        ),
        (
            [3999, 4000],
            [2],
            "jumps by three samples at 3.999 s: two samples lost; period 3 is whole",
        ),
        (
            [100, 9000],
            [1],
            "one sample lost; time jumps by two samples at 9 s: one sample lost; period 2 is whole",
        ),
    ],
)
def test_the_periods_that_are_whole_are_those_of_the_logger(tmp_path, lost, kept, said):
    u, y = (signal.reshape(3, PERIOD) for signal in run())
    with pytest.warns(nlfrf.DataWarning, match=said):
        record = nlfrf.load_record(write_log(tmp_path / "belt.csv", lost=lost), **BELT)
    assert record.fs == FS
    np.testing.assert_allclose(record.u[0], u[kept], atol=1e-6)
    np.testing.assert_allclose(record.y[0], y[kept], atol=1e-6)


def test_periods_to_discard_are_counted_as_they_were_played(tmp_path):
    path = write_log(tmp_path / "belt.csv", lost=[6507])
    with pytest.warns(nlfrf.DataWarning, match="periods 1 and 3 are whole"):
        record = nlfrf.load_record(path, n_discard=1, **BELT)
    np.testing.assert_allclose(record.y[0, 0], run()[1][2 * PERIOD :], atol=1e-6)
    with pytest.raises(
        ValueError, match=r"a whole period .* after n_discard = 3, got 'belt.csv': time jumps"
    ):
        nlfrf.load_record(path, n_discard=3, **BELT)


def test_no_whole_period_is_refused_by_name(tmp_path):
    path = write_log(tmp_path / "belt.csv", lost=[100, 5000, 9000])
    with pytest.raises(
        ValueError, match=r"got 'belt.csv': time jumps by two samples at 0.1 s.*no period is whole"
    ):
        nlfrf.load_record(path, **BELT)


def test_realisations_lose_what_each_of_them_lost(tmp_path):
    paths = [write_log(tmp_path / "a.csv", lost=[6507]), write_log(tmp_path / "b.csv")]
    with pytest.warns(nlfrf.DataWarning, match=r"'a.csv': time jumps"):
        record = nlfrf.load_record(paths, **BELT)
    assert record.u.shape == (2, 2, PERIOD)


def test_a_list_of_names_keeps_them_too(tmp_path):
    path = write_log(tmp_path / "belt.csv", lost=[6507])
    with pytest.warns(nlfrf.DataWarning, match="periods 1 and 3 are whole"):
        record = nlfrf.load_record([path], u=["Kraft"], y=["Position"])
    assert (record.u_name, record.y_name) == ("Kraft", "Position")
    np.testing.assert_allclose(record.y[0], run()[1].reshape(3, PERIOD)[[0, 2]], atol=1e-6)


def test_resample_that_leaves_one_period_says_so(tmp_path):
    """The bound is then that of noise and distortion together; 4aa289a left it at that."""
    path = write_log(tmp_path / "belt.csv", lost=[6507], time=False)
    with pytest.warns(nlfrf.DataWarning, match="resample leaves one period of"):
        record = nlfrf.load_record(path, fs=FS, resample=True, **BELT)
    assert record.n_periods == 1


@pytest.mark.parametrize(
    "spoil", [lambda t, rng: t + 4e-4 * rng.uniform(size=t.size), lambda t, rng: np.round(t, 2)]
)
def test_a_clock_that_jitters_or_is_coarse_shows_no_lost_row(spoil, tmp_path):
    u, y = (np.delete(signal, 700) for signal in run())
    t = np.delete(np.arange(run()[0].size) / FS, 700)

    def lost(seconds):
        np.savez(tmp_path / "belt.npz", t=seconds, u=u, y=y)
        return nlfrf.inspect_file(tmp_path / "belt.npz").lost

    assert lost(t).startswith("time jumps by two samples at 0.7 s")
    assert "jump" not in lost(spoil(t, np.random.default_rng(1)))
    assert not lost(np.arange(u.size) / 7.0)  # an even clock
