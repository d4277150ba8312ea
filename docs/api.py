"""The public names in the order of the reference, its index, and docstrings as Sphinx should read
them.

The pages of the names are made by sphinx.ext.autosummary. A page of a name is no entry of the table
of contents: a sidebar that listed every name would be most of every page, and of the time to build
it.
"""

from __future__ import annotations

import inspect
import re
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import robust

DOCS = Path(__file__).resolve().parent
HERE = "generated/api"  # among the pages
#: Modules whose names are public, pictures apart.
MODULES = (
    *(
        "nlfrf",
        *(f"nlfrf.{name}" for name in ("bla", "friction", "hysteresis", "io", "rig", "signals")),
    ),
    *("robust", *(f"robust.{name}" for name in robust._submodules if name != "plot")),
)
#: Module -> its public names.
PUBLIC: dict[str, tuple[str, ...]] = {name: tuple(import_module(name).__all__) for name in MODULES}
#: The order of the reference after what most scripts need: that in which data flow.
PACKAGES = (
    *(
        "nlfrf.signals",
        "nlfrf.records",
        "nlfrf.bla",
        "nlfrf.rig",
        "nlfrf.io",
        "nlfrf.plot",
        "nlfrf._base",
    ),
    *("robust.models", "robust.synthesis", "robust.analysis", "robust.mu", "robust.friction"),
    *("robust.scheduling", "robust.proofs"),
    *("robust.lti", "robust.io", "robust.plot", "robust.reports"),
)
#: What most scripts need, `identify` first.
FIRST = (
    *(
        "nlfrf.identify",
        "nlfrf.multisine",
        "nlfrf.load_record",
        "nlfrf.inspect_file",
        "nlfrf.simulate",
        "nlfrf.Bla",
    ),
    *(
        "nlfrf.Record",
        "nlfrf.Multisine",
        "robust.fit_nominal",
        "robust.uncertainty",
        "robust.uncertainty_of_plants",
        "robust.UncertaintyModel",
    ),
    *(
        "robust.sampled",
        "robust.performance_weight",
        "robust.ncfsyn",
        "robust.design_frf",
        "robust.tune",
    ),
    *(
        "robust.design_learning",
        "robust.check",
        "robust.RobustnessReport",
        "robust.worst_case",
        "robust.prove_friction",
        "robust.prove_schedule",
    ),
    *("robust.reports.write_report", "robust.io.export_matlab"),
)
#: Modules of pictures: every plot_ function is public.
PICTURES = ("nlfrf.plot", "robust.plot")


def things() -> list[tuple[str, str, Any]]:
    """(module, name, thing) of every public name but the pictures and the older names of the same
    thing.
    """
    found = [
        (module, name, getattr(import_module(module), name))
        for module, names in PUBLIC.items()
        for name in names
    ]
    return [one for one in found if getattr(one[2], "__name__", one[1]) == one[1]]


def pictures() -> list[tuple[str, str, Any]]:
    """The same of the functions that draw."""
    found = [(module, import_module(module)) for module in PICTURES]
    drawing = [
        (m, name, thing)
        for m, home in found
        for name, thing in vars(home).items()
        if name.startswith("plot_")
    ]
    return [one for one in drawing if one[2].__name__ == one[1]]


#: A link of a page to the tree, as a clone shows it: its text, and the file that it leads to.
LINK = re.compile(r"\[([^]]*)\]\(((?:\.\./)*)((?:examples|nlfrf|robust)(?:/[\w./]+\.py)?)\)")


@cache
def full_names() -> dict[str, str]:
    """Return public name -> its full name, the first of two that are equal."""
    return {name: f"{module}.{name}" for module, name, _ in reversed([*things(), *pictures()])}


def link_to_page(found: re.Match[str], depth: int) -> str:
    """Return a link to an example or to the source of a public name as one to its page, of a page
    so deep in docs.
    """
    text, _, file = found.groups()
    up, full = "../" * depth, full_names().get(text.strip("`"))
    if file == "examples":
        return f"[{text}]({up}generated/examples/index.rst)"
    if file.startswith("examples/"):
        return f"[{text}]({up}generated/{file.removesuffix('.py')}.rst)"
    return found[0] if full is None else f"[{text}]({up}{HERE}/{full}.rst)"


def link_to_pages(app: object, docname: str, source: list[str]) -> None:
    """Turn the links of a hand-written page, which work in a clone, into links to what is built."""
    if not docname.startswith("generated/"):
        source[0] = LINK.sub(lambda found: link_to_page(found, docname.count("/")), source[0])


def by_package() -> dict[str, list[str]]:
    """Package -> full public names, in the order in which data flow; a name stands in the package
    that holds it.
    """
    found: dict[str, list[str]] = {package: [] for package in PACKAGES}
    for module, name, thing in [*things(), *pictures()]:
        home = ".".join(thing.__module__.split(".")[:2])
        found.setdefault(home, []).append(f"{module}.{name}")
    return {package: full for package, full in found.items() if full}


def summary_table(full_names: list[str]) -> list[str]:
    """The directive that lists names with their summaries, and makes a page of each."""
    return [
        ".. autosummary::",
        "   :toctree: .",
        "   :nosignatures:",
        "",
        *(f"   {full}" for full in full_names),
        "",
    ]


def write_index(path: Path) -> None:
    """Write the index of the reference: what most scripts need, then every name by package."""
    page = ["All functions and classes", "=========================", ""]
    page += ["Arrays and units are those of the :doc:`nomenclature </guide/nomenclature>`.", ""]
    page += ["What most scripts need", "----------------------", ""]
    page += summary_table([*FIRST])
    for package, full_names in by_package().items():
        title = package.replace("._base", ": shared").replace(".", ": ")
        summary = (inspect.getdoc(import_module(package)) or "").split("\n\n")[0]
        page += [
            title,
            "-" * len(title),
            "",
            *map(escaped, summary.split("\n")),
            "",
            *summary_table(full_names),
        ]
    write_if_changed(path, "\n".join(page))


def add_uses(app: Any, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Add to a docstring what returns the thing, and the guide pages and examples that use it."""
    if what in ("function", "class"):
        lines += used_in(name, what == "class")


@cache
def used_in(full: str, is_class: bool) -> tuple[str, ...]:
    """Rows of reStructuredText: what returns a class; guide pages and examples that use a name."""
    name = full.rpartition(".")[2]
    makers = [
        f":py:obj:`~{module}.{other}`"
        for module, other, function in things()
        if returns(function, name)
    ]
    guide = [
        f":doc:`{title} </{path}>`" for path, title, words in guide_pages() if names_it(name, words)
    ]
    rows = {"Returned by": makers if is_class else [], "In the guide": guide}
    listed = [f"* **{head}:** {', '.join(links)}" for head, links in rows.items() if links]
    examples = DOCS / "generated" / "backreferences" / f"{full}.examples"
    shown = examples.is_file() and examples.stat().st_size > 0
    gallery = (
        [".. rubric:: Examples that use it", "", f".. minigallery:: {full}", ""] if shown else []
    )
    return ("", *listed, "", *gallery)


def returns(function: Any, name: str) -> bool:
    """Whether the docstring of a function names a class under Returns."""
    section = re.search(
        r"Returns\n-+\n(.*?)(?:\n\n[A-Z]|\Z)", inspect.getdoc(function) or "", re.DOTALL
    )
    return inspect.isfunction(function) and section is not None and names_it(name, section[1])


def names_it(name: str, text: str) -> bool:
    """Whether a text has a name as a word of its own."""
    return re.search(rf"(?<![\w.]){re.escape(name)}(?!\w)", text) is not None


@cache
def guide_pages() -> list[tuple[str, str, str]]:
    """(path, title, code) of the guide and how-to pages; code is what stands in backticks and
    blocks.
    """
    found = []
    for path in [*sorted((DOCS / "guide").glob("*.md")), *sorted((DOCS / "howto").glob("*.md"))]:
        text = path.read_text(encoding="utf-8")
        code = " ".join(re.findall(r"```python\n.*?```|`[^`\n]+`", text, re.DOTALL))
        code = re.sub(r"\b(?:robust|nlfrf)(?:\.\w+)?\.(?=\w)", " ", code)
        if path.stem != "index":
            found.append(
                (
                    path.relative_to(DOCS).with_suffix("").as_posix(),
                    text.split("\n")[0].lstrip("# "),
                    code,
                )
            )
    return found


def escape_docstring(
    app: Any, what: str, name: str, thing: Any, options: Any, lines: list[str]
) -> None:
    """Docstrings are plain text with numpydoc sections: what reStructuredText would read into |G|
    is taken back.
    """
    code, literal = False, False
    for i, line in enumerate(lines):
        if not line.strip():
            code = False
            continue
        code = code or line.lstrip().startswith(">>>")
        if literal and not line.startswith(" "):
            literal = False
        if not code and not literal:
            lines[i] = escaped(line)


def escaped(line: str) -> str:
    """A line in which |x|, stars, trailing underscores and a leading initial ("A.

    Rantzer") stand for themselves.

    *Emphasis* and `code` are kept.
    """
    line = re.sub(r"^(\s*)([A-Z])\. ", r"\1\2\\. ", line)
    pieces = re.split(r"(``[^`]*``|`[^`]*`|\*[^*\s][^*]*[^*\s]\*(?!\w))", line)
    for i in range(0, len(pieces), 2):
        pieces[i] = re.sub(r"([|*]|\\(?!\. ))", r"\\\1", pieces[i])
        pieces[i] = re.sub(r"(?<=\w)_(?!\w)", r"\\_", pieces[i])
    return "".join(pieces)


def leave_out_of_contents(app: Any, doctree: Any) -> None:
    """Take the pages of the names out of the table of contents."""
    from sphinx.ext.autosummary import autosummary_toc

    for node in list(doctree.findall(autosummary_toc)):
        node.parent.remove(node)


def write_if_changed(path: Path, text: str) -> None:
    """Write a page only where it differs, so that an unchanged one is not built again."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")
