"""The primer and the how-to pages, followed word by word: every block of Python on them runs, in order."""

import re
import warnings
from pathlib import Path

import matplotlib
import pytest

matplotlib.use("Agg")
DOCS = Path(__file__).parents[2] / "docs"
PAGES = [
    DOCS / "guide" / "primer.md",
    DOCS / "guide" / "aliases.md",
    DOCS / "guide" / "drive.md",
    DOCS / "guide" / "axis.md",
    *sorted(path for path in (DOCS / "howto").glob("*.md") if path.stem != "index"),
]


@pytest.mark.parametrize("page", PAGES, ids=[page.stem for page in PAGES])
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
