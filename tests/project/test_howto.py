"""The primer and the how-to pages, followed word by word: every block of Python on them runs, in
order.
"""

import re
import shlex
import sys
import warnings
from pathlib import Path

import matplotlib
import pytest

from nlfrf import cli as measuring
from robust import cli as controlling

matplotlib.use("Agg")
DOCS = Path(__file__).parents[2] / "docs"
PAGES = [
    DOCS / "index.md",
    DOCS / "guide" / "primer.md",
    DOCS / "guide" / "aliases.md",
    DOCS / "guide" / "servo.md",
    DOCS / "guide" / "axis.md",
    DOCS / "guide" / "friction_proof.md",
    *sorted(path for path in (DOCS / "howto").glob("*.md") if path.stem != "index"),
]


#: Pages that take seconds.
SLOW = {
    "friction_classes",
    "friction_laws",
    "tuned_drive",
    "pictures",
    "axis",
    "extend",
    "from_matlab",
    "servo_axis",
    "schedule",
}


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, id=page.stem, marks=pytest.mark.docs if page.stem in SLOW else ())
        for page in PAGES
    ],
)
def test_the_python_of_a_page_runs(page, tmp_path, monkeypatch, capsys):
    blocks = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    assert blocks
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # what python-control is told by a newer NumPy
        warnings.filterwarnings("ignore", category=DeprecationWarning, module=r"control\.")
        for block in blocks:
            exec(compile(block, page.name, "exec"), names)
    assert capsys.readouterr().out or page.stem == "which_signal"


@pytest.mark.docs
def test_the_commands_of_the_servo_axis_run_with_its_files(tmp_path, monkeypatch, capsys):
    """The whole walk as it stands on the page: both files, every command in order, and a verdict
    without a warning.

    A trace in motion alone leaves the friction unjudged: exit code 3.
    """
    page = (DOCS / "howto" / "servo_axis.md").read_text(encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    for block in re.findall(r"```toml\n(.*?)```", page, re.DOTALL):
        Path(re.match(r"# (\S+\.toml)\n", block)[1]).write_text(block, encoding="utf-8")
    commands = re.findall(r"^    ((?:nlfrf|robust) .*)$", page, re.MULTILINE)
    design, play, judge = "robust servo design", "robust servo play", "robust servo check"
    assert [" ".join(one.split()[:3]) for one in commands] == [
        design,
        play,
        judge,
        design,
        play,
        play,
        judge,
    ]
    for step, command in enumerate(commands):
        program, *words = shlex.split(command)
        monkeypatch.setattr(sys, "argv", [program, *words])
        with pytest.raises(SystemExit) as stop:
            (measuring if program == "nlfrf" else controlling).main()
        printed = capsys.readouterr()
        assert (stop.value.code or 0) == (3 if step == 2 else 0), printed
        assert printed.err == ""
    assert "STATISTICALLY ROBUST" in printed.out
    assert "warning" not in printed.out
    assert re.search(r"break-away force Fs \[N\] +19\.9\d* \+- ", printed.out)
    assert "proved: Comes to rest from every state" in " ".join(printed.out.split())


def test_every_name_of_the_dictionary_is_called_on_its_page():
    page = (DOCS / "howto" / "from_matlab.md").read_text(encoding="utf-8")
    code = "\n".join(re.findall(r"```python\n(.*?)```", page, re.DOTALL))
    rows = [
        row.split(" | ")
        for row in page.partition("## The dictionary")[2].partition("## Blocks")[0].splitlines()
    ]
    ours = [
        name
        for row in rows
        if len(row) == 4
        for name in re.findall(r"`((?:nlfrf|robust)(?:\.\w+)+)`", row[1])
    ]
    theirs = " ".join(row[0] for row in rows if len(row) == 4)
    assert len(ours) >= 25
    assert [name for name in ours if f"{name}(" not in code] == []
    asked = (
        "ucover mussv wcgain robstab ultidyn ureal loopmargin diskmargin systune looptune mixsyn"
        " hinfsyn ncfsyn "
    )
    asked += "ncfmargin gapmetric musyn usample tfest spa idinput"
    assert [name for name in asked.split() if not re.search(rf"\b{name}\b", theirs)] == []


def test_the_set_without_a_measurement_of_the_guide_is_proved(capsys):
    page = (DOCS / "guide" / "several.md").read_text(encoding="utf-8")
    (block,) = (
        one
        for one in re.findall(r"```python\n(.*?)```", page, re.DOTALL)
        if "UncertaintyModel(" in one
    )
    exec(compile(f"import control, robust\nimport numpy as np\n{block}", "several.md", "exec"), {})
    printed = capsys.readouterr().out
    assert "ROBUST: this controller keeps every plant of the set stable, which is proved" in printed
    assert "the uncertainty may grow by a factor 4.99" in printed
