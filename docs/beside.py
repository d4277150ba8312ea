"""What stands beside a name of the reference: kin of the same step, its types, guide pages and examples that use it."""

from __future__ import annotations

import inspect
import os
import re
from functools import cache
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parent
#: Types of other packages, as docstrings write them -> as their documentation has them.
THEIRS = {
    "ndarray": "numpy.ndarray",
    "control.StateSpace": "control.StateSpace",
    "TransferFunction": "control.TransferFunction",
    "control.FrequencyResponseData": "control.FrequencyResponseData",
    "matplotlib Axes": "matplotlib.axes.Axes",
}


def beside(module: str, name: str, thing: Any, kin: list[tuple[str, str]], everything: Any) -> list[str]:
    """Rows of reStructuredText that end a page of the reference; everything as `docs.api.things` gives it."""
    classes = {other: home for home, other, its in everything if inspect.isclass(its)}
    text = inspect.getdoc(thing) or ""
    types = [f":doc:`{kind} <{home}.{kind}>`" for kind, home in classes.items() if kind != name and said(kind, text)]
    theirs = [linked(full) for short, full in THEIRS.items() if short in text]
    rows = {
        "In the same step": [f":doc:`{other} <{home}.{other}>`" for home, other in kin if other != name],
        "Made by": [f":doc:`{other} <{home}.{other}>`" for home, other, its in everything if makes(its, name, thing)],
        "Types": types + theirs,
        "Guide": [f":doc:`{title} </{path}>`" for path, title, words in pages() if said(name, words)],
        "Examples": [f":doc:`{title} </{path}>`" for path, title, words in examples() if used(name, words)],
    }
    listed = [f"* **{head}:** {', '.join(links)}" for head, links in rows.items() if links]
    return ["", ".. rubric:: Beside it", "", *listed, ""] if listed else []


def makes(function: Any, name: str, thing: Any) -> bool:
    """Whether a function says that it returns a value of a class."""
    returns = re.search(r"Returns\n-+\n(.*?)(?:\n\n[A-Z]|\Z)", inspect.getdoc(function) or "", re.DOTALL)
    return inspect.isclass(thing) and inspect.isfunction(function) and bool(returns) and said(name, returns[1])


def said(name: str, text: str) -> bool:
    """Whether a text names something as a word of its own."""
    return re.search(rf"(?<![\w.]){re.escape(name)}(?!\w)", text) is not None


def used(name: str, script: str) -> bool:
    """Whether a script takes it from a package or calls it."""
    return re.search(rf"(?:\.|import .*|^|\W){re.escape(name)}\b", script) is not None and len(name) > 3


def linked(full: str) -> str:
    """A type of another package: a link where their inventories were asked for."""
    return f":py:class:`{full}`" if os.environ.get("DOCS_LINKS") else f"``{full}``"


@cache
def pages() -> list[tuple[str, str, str]]:
    """(path, title, what stands in backticks or code) of the guide and how-to pages."""
    found = []
    for path in [*sorted((DOCS / "guide").glob("*.md")), *sorted((DOCS / "howto").glob("*.md"))]:
        text = path.read_text(encoding="utf-8")
        code = " ".join(re.findall(r"```python\n.*?```|`[^`\n]+`", text, re.DOTALL))
        code = re.sub(r"\b(?:robust|nlfrf)(?:\.plot|\.friction|\.tuning)?\.", " ", code)
        if path.stem != "index":
            found.append((path.relative_to(DOCS).with_suffix("").as_posix(), text.split("\n")[0].lstrip("# "), code))
    return found


@cache
def examples() -> list[tuple[str, str, str]]:
    """(path, title, script) of the examples."""
    from docs.gallery import EXAMPLES, names, title_and_text

    return [
        (f"generated/examples/{name}", f"{name[:2]}. {title_and_text(name)[0]}", (EXAMPLES / f"{name}.py").read_text())
        for name in names()
    ]
