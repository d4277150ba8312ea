"""Bars: where somebody looks they show what is done, elsewhere nothing; an interrupted command says
what it keeps.
"""

import io
import re
import sys
import time

import pytest

import nlfrf
from tests.nlfrf.test_cli import nlfrf_command  # noqa: F401 (a fixture)


class Screen(io.StringIO):
    """A terminal that keeps what is written."""

    def isatty(self):
        return True


def open_screen(monkeypatch):
    """Make standard error a terminal, with a clock that is turned by hand: both are returned."""
    monkeypatch.setenv("COLUMNS", "100")
    shown, clock = Screen(), [0.0]
    monkeypatch.setattr(sys, "stderr", shown)
    monkeypatch.setattr(time, "monotonic", lambda: clock[0])
    return shown, clock


def rows(shown):
    """What stood on the row of the bar, one after the other, without colours."""
    plain = re.sub(r"\x1b\[[0-9;]*[mK]", "", shown.getvalue())
    return [
        " ".join(row.replace("━", "").replace("╸", "").replace("╺", "").split())
        for row in plain.split("\r")[1:]
    ]


def test_a_terminal_shows_what_is_done_and_not_more_often_than_is_seen(monkeypatch):
    shown, clock = open_screen(monkeypatch)
    show = nlfrf.progress_bar("simulating")
    for done, now in ((0, 0.0), (1, 0.05), (2, 1.0), (4, 1.01)):
        clock[0] = now
        show(done, 4)
    assert [row[: len("simulating 0 of 4")] for row in rows(shown)] == [
        f"simulating {k} of 4" for k in (0, 2, 4)
    ]
    assert shown.getvalue().endswith("\n")  # what is printed next stands below
    assert (
        "\x1b[?25l" not in shown.getvalue()
    )  # the cursor is never hidden: an interrupt would leave it so


def test_a_search_with_a_limit_of_time_shows_its_best(monkeypatch):
    shown, clock = open_screen(monkeypatch)
    show = nlfrf.progress_bar("tuning")
    clock[0] = 30.0
    show.timed(120, 0.5678, 90.0)
    assert rows(shown)[0].startswith("tuning 120 evaluations, best 0.5678")
    assert show.bar.tasks[0].percentage == 25.0


def test_nothing_is_written_to_a_file(monkeypatch):
    written = io.StringIO()
    monkeypatch.setattr(sys, "stderr", written)
    show = nlfrf.progress_bar("simulating")
    show(1, 2)
    show.timed(3, 1.0, 2.0)
    assert written.getvalue() == ""
    with pytest.raises(ValueError, match="label must be of type str, got 3"):
        nlfrf.progress_bar(3)


def test_an_interrupted_command_leaves_the_file_that_is_there(nlfrf_command, monkeypatch, tmp_path):  # noqa: F811
    design = "design --fs 512 --period 512 --f-min 2 --f-max 100 -o ms.npz"
    simulate = "simulate ms.npz -o run.npz"
    assert [nlfrf_command(*words.split())[0] for words in (design, simulate)] == [0, 0]
    before = (tmp_path / "run.npz").read_bytes()

    def interrupt(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(nlfrf, "simulate", interrupt)
    code, printed, said = nlfrf_command(*simulate.split())
    assert (code, printed, said.strip()) == (130, "", "nlfrf: interrupted. No file is half written")
    assert (tmp_path / "run.npz").read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["ms.npz", "run.npz"]
