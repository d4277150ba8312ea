"""Every public name says in numpydoc sections what it takes, in which shape and unit, what it
refuses, its source.
"""

import ast
import dataclasses
import inspect
import re
from enum import Enum

from docs.api import pictures, things
from tests.support.rules import each
from tests.support.sources import ROOT, modules

#: Code of a function that refuses an argument; one that has none needs no "Raises".
REFUSES = re.compile(r"\braise\b|\b(?:require|check)_\w+\(")

#: Files, containers and our own bookkeeping: nothing in them comes from a book.
OWN = {
    *("nlfrf.DataWarning", "nlfrf.signals.LineGrid", "nlfrf.rig.Trajectory"),
    *("nlfrf.Record", "nlfrf.record_from_samples"),
    *("nlfrf.io.SetPoints", "nlfrf.io.load_set_points", "nlfrf.io.in_design_units"),
    *("nlfrf.progress_bar", "nlfrf.inspect_file", "nlfrf.load_record"),
    *(
        "nlfrf.load",
        "nlfrf.save",
        "robust.load",
        "robust.save",
        "nlfrf.export_csv",
        "nlfrf.simulate",
    ),
    *(
        "robust.DesignWarning",
        "robust.io.controller_sections",
        "robust.io.export_matlab",
        "robust.frd",
    ),
    *(
        "robust.servo.load_gains",
        "robust.servo.read_experiments",
        "robust.servo.read_traces",
        "robust.servo.write_page",
    ),
    "robust.models.Origin",
    *("robust.reports.write_report", "nlfrf.hysteresis.Linear", "nlfrf.hysteresis.Table"),
}

#: Names that always carry the same unit, wherever they are documented with a type of numbers.
UNITS = {
    **dict.fromkeys(("fs", "f", "f0", "f_min", "f_max", "f_excited"), "[Hz]"),
    **dict.fromkeys(
        ("omega", "omega_B", "omega_rs", "omega_rp", "omega_worst", "omega_outside"), "[rad/s]"
    ),
    **dict.fromkeys(("delay", "dt", "t"), "[s]"),
    **dict.fromkeys(("Fs", "Fc", "force", "friction"), "[N]"),
    **dict.fromkeys(("vs", "v"), "[m/s]"),
    **dict.fromkeys(("x", "z"), "[m]"),
    **dict.fromkeys(("mass",), "[kg]"),
    **dict.fromkeys(("stiffness", "sigma0", "K0"), "[N/m]"),
    **dict.fromkeys(("sigma1", "sigma2", "damping"), "[Ns/m]"),
    "phase": "[rad]",
}
NUMBERS = re.compile(r"float|ndarray|callable|number")


def sections(thing):
    """Heading -> text of the numpydoc sections of a docstring, the summary under ''."""
    text = inspect.getdoc(thing) or ""
    parts = re.split(r"(?:^|\n)([A-Z][a-z]+)\n-{3,}\n", text)
    return {"": parts[0], **dict(zip(parts[1::2], parts[2::2], strict=True))}


def entries(text):
    """(names, type, description) of a Parameters or Fields section."""
    found = []
    for line in text.splitlines():
        if line and not line.startswith(" "):
            names, _, kind = line.partition(" : ")
            found.append([[name.strip().lstrip("*") for name in names.split(",")], kind, ""])
        elif found:
            found[-1][2] += line.strip() + " "
    return found


def named(found):
    """Yield (dotted name, thing) of each public thing."""
    for module, name, thing in found:
        yield f"{module}.{name}", thing


@each(lambda: named(things()))
def test_docstring(name, thing):
    found = sections(thing)
    summary = found[""].split("\n\n")[0].split("\n>>>")[0].rstrip()
    assert summary, "no summary"
    assert summary.endswith((".", ":", ")")), f"the summary does not end: {summary!r}"
    assert name in OWN or "References" in found, "no source"
    assert ">>>" in inspect.getdoc(thing), "no doctest"
    if inspect.isclass(thing) and issubclass(thing, Warning | Enum):
        return
    if inspect.isclass(thing):
        wanted = [field.name for field in dataclasses.fields(thing) if field.init]
        for member, value in vars(thing).items():
            if not member.startswith("_") and (
                inspect.isfunction(value) or isinstance(value, property)
            ):
                assert inspect.getdoc(value), f"{member} has no docstring"
    else:
        signature = inspect.signature(thing)
        wanted = list(signature.parameters)
        assert signature.return_annotation in (None, "None") or "Returns" in found, "no Returns"
        assert "Raises" in found or not REFUSES.search(inspect.getsource(thing)), "no Raises"
    documented = entries(found.get("Parameters", "")) + entries(found.get("Fields", ""))
    missing = set(wanted) - {one for names, _, _ in documented for one in names}
    assert not missing, f"not documented: {sorted(missing)}"
    for names, kind, description in documented:
        if "ndarray" in kind:
            assert "(" in kind, f"{names} has no shape: {kind}"
        for one in names:
            if one in UNITS and NUMBERS.search(kind):
                assert UNITS[one] in description, (
                    f"{one} : {kind} without its unit {UNITS[one]}: {description}"
                )


def classes_with_fields():
    """Every value class of the packages that inherits no fields, with its module."""
    for module, tree in modules().items():
        for node in ast.walk(tree):
            if not isinstance(node, ast.ClassDef) or "Fields\n---" not in (
                ast.get_docstring(node) or ""
            ):
                continue
            has_fields = any(isinstance(one, ast.AnnAssign) for one in node.body)
            if has_fields and all(
                isinstance(base, ast.Name) and base.id == "NamedTuple" for base in node.bases
            ):
                yield f"{module}: {node.name}", node


@each(classes_with_fields)
def test_the_fields_that_are_documented_exist(name, node):
    """Names change, and docstrings of classes that nobody sees are left behind."""
    text = re.split(r"(?:^|\n)([A-Z][a-z]+)\n-{3,}\n", ast.get_docstring(node))
    documented = {one for names, _, _ in entries(text[text.index("Fields") + 1]) for one in names}
    known = {one.target.id for one in node.body if isinstance(one, ast.AnnAssign)}
    assert documented <= known, f"no field is called {sorted(documented - known)}"


@each(lambda: named(pictures()))
def test_pictures_document_their_arguments(name, thing):
    found = sections(thing)
    assert found[""].strip(), "no summary"
    if "Parameters" in found:
        documented = {one for names, _, _ in entries(found["Parameters"]) for one in names}
        assert set(inspect.signature(thing).parameters) <= documented
    else:
        pattern = r"[Aa]rguments (?:and result )?as in\s`\w+`"
        assert re.search(pattern, inspect.getdoc(thing)), "no Parameters, and no reference to them"


def test_the_nomenclature_has_every_symbol():
    text = (ROOT / "docs" / "guide" / "nomenclature.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`([A-Za-z_0-9.]+)(?:\(.*?\))?`", text))
    named |= {name.rpartition(".")[2] for name in named}
    # the fields of a class of friction stand in the heads of the tables of classes
    page = (ROOT / "docs" / "howto" / "friction_classes.md").read_text(encoding="utf-8")
    of_classes = set(re.findall(r"\w+", " ".join(re.findall(r"\| `\w+\((.*?)\)`", page))))
    for module, _, thing in things():
        if not dataclasses.is_dataclass(thing) or module == "nlfrf.hysteresis":  # explained there
            continue
        missing = {field.name for field in dataclasses.fields(thing)} - named
        if thing.__module__.startswith("robust.friction.classes."):
            missing -= of_classes
        place = "docs/guide/nomenclature.md, or a column head of docs/howto/friction_classes.md"
        assert not missing, f"{thing.__name__}: add {missing} to {place}"
