"""The public names, in the order of the reference, and the pages made of their docstrings."""

from __future__ import annotations

import inspect
import re
from importlib import import_module
from pathlib import Path
from typing import Any

import nlfrf
import robust
from docs.beside import beside

#: Module -> its public names.
PUBLIC: dict[str, tuple[str, ...]] = {
    "nlfrf": nlfrf._public_names,
    "nlfrf.axis": tuple(import_module("nlfrf.axis").__all__),
    "nlfrf.friction": (
        *("Coulomb", "Dahl", "LuGre", "Leuven", "GeneralizedMaxwellSlip", "VaryingSliders", "OwnFriction"),
        "element_forces",
    ),
    "nlfrf.hysteresis": (
        *("Linear", "Tanh", "Exponential", "Parabola", "ElasticPlastic", "Table", "MaxwellSlip"),
        *("hysteresis_force", "fit_maxwell_slip"),
    ),
    "robust": robust._public_names,
    "robust.drive": tuple(import_module("robust.drive").__all__),
    "robust.tuning": tuple(import_module("robust.tuning").__all__),
}
#: The order of the reference: that in which data flow.
WINGS = (
    *(
        "nlfrf.signals",
        "nlfrf.records",
        "nlfrf.bla",
        "nlfrf.rig",
        "nlfrf.io",
        "nlfrf.axis",
        "nlfrf.plot",
        "nlfrf._base",
    ),
    *("robust.models", "robust.synthesis", "robust.analysis", "robust.mu", "robust.friction", "robust.proofs"),
    *("robust.lti", "robust.io", "robust.plot", "robust.reports"),
)
#: Modules of pictures: every plot_ function is public.
PICTURES = ("nlfrf.plot", "robust.plot", "robust.shaping_plot")


def things() -> list[tuple[str, str, Any]]:
    """(module, name, thing) of every public name but the pictures and the older names of the same thing."""
    found = [(module, name, getattr(import_module(module), name)) for module, names in PUBLIC.items() for name in names]
    return [one for one in found if getattr(one[2], "__name__", one[1]) == one[1]]


def pictures() -> list[tuple[str, str, Any]]:
    """The same of the functions that draw."""
    found = [(module, import_module(module)) for module in PICTURES]
    return [(m, name, getattr(home, name)) for m, home in found for name in vars(home) if name.startswith("plot_")]


def first_line(thing: Any) -> str:
    """The summary of a docstring."""
    return " ".join((inspect.getdoc(thing) or "").split("\n\n")[0].split())


def wings() -> dict[str, list[tuple[str, str, Any]]]:
    """Wing -> its public names, in the order in which data flow; what a public module hands on stands in its wing."""
    found: dict[str, list[tuple[str, str, Any]]] = {wing: [] for wing in WINGS}
    for module, name, thing in [*things(), *pictures()]:
        home = ".".join(thing.__module__.split(".")[:2])
        found.setdefault(home, []).append((module, name, thing))
    return {wing: names for wing, names in found.items() if names}


def write_pages(folder: Path) -> None:
    """One page a name, and an index of them by wing with their summaries."""
    index = ["Reference", "=========", ""]
    index += ["Every public name, by the step of the work. Arrays and units are those of the nomenclature.", ""]
    for wing, entries in wings().items():
        title = wing.replace("._", ".").replace(".", ": ").replace("_", " ")
        plate = escaped(first_line(import_module(wing)))
        index += [title, "-" * len(title), "", plate, "", ".. list-table::", "   :widths: 30 70", ""]
        for module, name, thing in entries:
            summary = escaped(first_line(thing))
            index += [f"   * - :doc:`{name} <{module}.{name}>`", f"     - {summary}"]
        index += [""]
        for module, name, thing in entries:
            title = f"{module}.{name}"
            kind = "autoclass" if inspect.isclass(thing) else "autofunction"
            members = ["   :members:"] if inspect.isclass(thing) and not issubclass(thing, Warning) else []
            # an orphan: a sidebar that listed every name would be most of every page, and of the time to build it
            up = ":doc:`Reference <index>`"
            page = [":orphan:", "", up, "", title, "=" * len(title), "", f".. {kind}:: {title}", *members, ""]
            page += beside(module, name, thing, [(home, other) for home, other, _ in entries], things())
            write_if_changed(folder / f"{title}.rst", "\n".join(page))
    write_if_changed(folder / "index.rst", "\n".join(index))


def escape_docstring(app: Any, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Docstrings are plain text with numpydoc sections: what reStructuredText would read into |G| is taken back."""
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
    """A line in which |x|, stars and trailing underscores stand for themselves; *emphasis* and `code` are kept."""
    pieces = re.split(r"(``[^`]*``|`[^`]*`|\*[^*\s][^*]*[^*\s]\*(?!\w))", line)
    for i in range(0, len(pieces), 2):
        pieces[i] = re.sub(r"([|*\\])", r"\\\1", pieces[i])
        pieces[i] = re.sub(r"(?<=\w)_(?!\w)", r"\\_", pieces[i])
    return "".join(pieces)


def write_if_changed(path: Path, text: str) -> None:
    """Write a page only where it differs, so that an unchanged one is not built again."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")
