"""Every measured figure names the command that prints it, and `make bench` runs that command."""

import re
from pathlib import Path

import pytest

from benchmarks.__main__ import COMMANDS, main

ROOT = Path(__file__).parents[2]
RUN = {f"benchmarks.{command.split()[0]}" for command in COMMANDS}
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*/*.md"))]
MEASURED = (ROOT / "docs" / "guide" / "measured.md").read_text(encoding="utf-8")
#: Attacks the page of `robust.shaping.shape` in a browser, which is not to be had everywhere.
BY_HAND = {
    "benchmarks.attack_shaping_page",
    "benchmarks.bench_stranger",
}  # a browser; a rig that is not ours


def named(text):
    """Commands in a text."""
    return set(re.findall(r"python -m (benchmarks\.\w+)", text))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_what_a_page_says_was_measured_is_measured_again(page):
    assert named(page.read_text(encoding="utf-8")) <= RUN


@pytest.mark.parametrize("section", re.split(r"^## ", MEASURED, flags=re.MULTILINE)[1:])
def test_each_section_of_the_measured_names_its_command(section):
    assert named(section)


def test_each_row_of_the_speeds_names_its_command():
    rows = [
        [cell.strip() for cell in row.split("|")[1:-1]]
        for row in re.findall(r"^\|.*\|$", MEASURED, re.MULTILINE)
    ]
    speeds = [row for row in rows if len(row) == 4 and re.search(r"\d", row[1])]
    assert len(speeds) > 10
    for row in speeds:
        assert row[3] == "same" or named(row[3]), row


def test_every_benchmark_is_run():
    found = {
        f"benchmarks.{path.stem}"
        for path in (ROOT / "benchmarks").glob("*.py")
        if 'if __name__ == "__main__":' in path.read_text(encoding="utf-8")
    }
    assert found - BY_HAND - {"benchmarks.__main__"} == RUN
    assert "-m benchmarks\n" in (ROOT / "Makefile").read_text(encoding="utf-8")


def test_one_that_fails_is_named_and_the_others_run(capfd, monkeypatch):
    monkeypatch.setattr("benchmarks.__main__.COMMANDS", ("no_such_benchmark", "machine"))
    assert main([]) == 1
    told = capfd.readouterr().out
    assert "no_such_benchmark  FAILED" in told
    assert "cores" in told
    assert main(["machine"]) == 0
    with pytest.raises(
        SystemExit, match="name must be one of machine, no_such_benchmark, got speed"
    ):
        main(["speed"])
