"""The README, followed word by word: its scripts, its commands and its links; none of them prints a
warning.
"""

import re
import sys
from pathlib import Path

import matplotlib
import pytest

import nlfrf.cli
import robust.cli

matplotlib.use("Agg")
ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
CLIS = {"nlfrf": nlfrf.cli, "robust": robust.cli}


def section(heading):
    """The text under a heading."""
    return re.search(rf"^## {heading}\n(.*?)(?=^## )", README, re.DOTALL | re.MULTILINE).group(1)


pytestmark = pytest.mark.usefixtures("undrawn")


def test_the_script_runs_and_has_twenty_lines(tmp_path, monkeypatch, capsys):
    script = re.search(r"```python\n(.*?)```", section("In a script"), re.DOTALL).group(1)
    code = [line for line in script.splitlines() if line.strip()]
    assert 15 <= len(code) <= 20
    monkeypatch.chdir(tmp_path)
    exec(compile(script, "README.md", "exec"), {})
    said = capsys.readouterr().out
    assert "BLA on 148 lines" in said
    assert "STATISTICALLY ROBUST: " in said  # with nothing after it: no thin margins
    assert "warning" not in said.lower()
    assert {path.name for path in tmp_path.iterdir()} == {
        "plant.mat",
        "load_plant.m",
        "report.html",
    }


def test_the_first_claim_is_a_proof_that_is_found(tmp_path, monkeypatch, capsys):
    script = re.search(r"```python\n(.*?)```", section("A proof with friction"), re.DOTALL).group(1)
    monkeypatch.chdir(tmp_path)
    exec(compile(script, "README.md", "exec"), {})
    said = " ".join(capsys.readouterr().out.split())
    assert said.startswith("proved: Comes to rest from every state with every")
    assert "not claimed:" in said


def test_the_commands_run(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    text = section("On the command line")
    indented = [line for line in text.splitlines() if line.startswith("    ")]
    commands = [line.partition("#")[0].split() for line in indented]
    assert len(commands) == 11
    said = ""
    for words in commands:
        monkeypatch.setattr(sys, "argv", words)
        with pytest.raises(SystemExit) as stop:
            CLIS[words[0]].main()
        answer = capsys.readouterr()
        assert not stop.value.code, (words, answer.err)
        assert "warning" not in (answer.out + answer.err).lower(), words
        said += answer.out
    assert "STATISTICALLY ROBUST: " in said
    assert (tmp_path / "report.html").is_file()
    assert (tmp_path / "shape.html").is_file()


def test_pip_and_make_install_into_one_environment():
    """What `pip install` of the README made is what `make` finds: the same folder, constraints and
    kind of install.
    """
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    environment = re.search(r"^VENV := (.+)$", makefile, re.MULTILINE).group(1)
    made = re.search(r"python -m venv (\S+) && \. (\S+)/bin/activate", README)
    assert made.groups() == (environment, environment)
    assert re.search(r"^INSTALL = .*-c constraints\.txt$", makefile, re.MULTILINE)
    assert '$(INSTALL) -e ".[full]"' in makefile
    assert 'python -m pip install -c constraints.txt -e ".[full]"' in README


def test_the_first_script_leaves_its_picture_where_the_readme_says():
    line = re.search(r"python examples/(\w+)\.py +#.*: (\S+)$", README, re.MULTILINE)
    source = (ROOT / "examples" / f"{line.group(1)}.py").read_text(encoding="utf-8")
    folder = re.search(r'"--out", type=Path, default=Path\("(.+?)"\)', source).group(1)
    picture = re.search(r'savefig\(out / "(.+?)"', source).group(1)
    assert line.group(2) == f"{folder}/{picture}"


def test_links_and_commands_exist():
    for target in re.findall(r"\]\(([^)]+)\)", README):
        assert target.startswith("https://") or (ROOT / target).exists(), target
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for name in re.findall(r"\bmake (\w+)", README):
        assert re.search(rf"^{name}:", makefile, re.MULTILINE), name
    for name in re.findall(r"examples/(\w+\.py)", README):
        assert (ROOT / "examples" / name).is_file()


def test_the_citation_names_this_version():
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.search(r"^version: (.*)$", citation, re.MULTILINE).group(1) == nlfrf.__version__
