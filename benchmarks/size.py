"""How large the packages are, and how visible their inside: names, arguments, fields, depth, modes,
tuned numbers.

    python -m benchmarks.size                    # this tree
    python -m benchmarks.size --tree FOLDER      # another checkout, with its own packages

Statements are those of Python, a docstring being one. A public object counts once, a way to it is a
name in the namespace of a public module. The complexity of a function is the number of its branches
(McCabe), boolean operators counted. A place that branches on the kind of its input calls one of
`KINDS` or `isinstance` with an argument of the function that it stands in.
"""

from __future__ import annotations

import argparse
import ast
import inspect
import sys
from collections import defaultdict
from dataclasses import fields, is_dataclass
from importlib import import_module
from pathlib import Path
from types import ModuleType

PACKAGES = ("nlfrf", "robust")
MANY_ARGUMENTS, COMPLEX = 10, 21
REPORTED = {
    "robust.RobustnessReport": "RobustnessReport",
    "robust.UncertaintyModel": "UncertaintyModel",
    "nlfrf.Bla": "Bla",
    "nlfrf.rig.Drive": "Drive",
}
#: Names that give the kind of a plant, a record or a set: one channel or several, lines or a
#: system.
KINDS = (
    "is_single",
    "is_matrix",
    "is_known_on_lines",
    "has_several_channels",
    "measured_only",
    "has_full_weights",
)
BRANCHES = (
    ast.If,
    ast.For,
    ast.While,
    ast.ExceptHandler,
    ast.IfExp,
    ast.Assert,
    ast.comprehension,
    ast.match_case,
)


def parse_tree(root: Path) -> dict[str, ast.Module]:
    """Return every module of the packages by its name."""
    files = [path for package in PACKAGES for path in sorted((root / package).rglob("*.py"))]
    return {
        ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__"): ast.parse(
            path.read_text()
        )
        for path in files
    }


def count_statements(tree: ast.Module) -> int:
    """Return the number of statements, a docstring being one."""
    return sum(isinstance(node, ast.stmt) for node in ast.walk(tree))


def count_arguments(function: ast.FunctionDef) -> int:
    """Return the number of arguments of a function."""
    given = function.args
    names = [one.arg for one in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
    return len([name for name in names if name not in ("self", "cls")])


def complexity(function: ast.FunctionDef) -> int:
    """Return one more than the number of branches of a function, those of the functions inside it
    included.
    """
    found = 1
    for node in ast.walk(function):
        found += isinstance(node, BRANCHES)
        found += len(node.values) - 1 if isinstance(node, ast.BoolOp) else 0
        found += len(node.ifs) if isinstance(node, ast.comprehension) else 0
    return found


def count_kinds(tree: ast.Module) -> int:
    """Return the number of places that branch on the kind of their input."""
    found = 0
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef):
            given = {
                one.arg
                for one in (
                    *function.args.posonlyargs,
                    *function.args.args,
                    *function.args.kwonlyargs,
                )
            }
            for call in ast.walk(function):
                if (
                    isinstance(call, ast.Call)
                    and isinstance(call.func, ast.Name)
                    and call.func.id == "isinstance"
                ):
                    found += isinstance(call.args[0], ast.Name) and call.args[0].id in given - {
                        "self",
                        "other",
                    }
    for node in ast.walk(tree):
        found += isinstance(node, ast.Attribute) and node.attr in KINDS
        found += (
            isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in KINDS
        )
    return found


def is_tuned(node: ast.stmt) -> bool:
    """Return True for a constant of a module that holds a number."""
    if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
        return False
    target = node.targets[0] if isinstance(node, ast.Assign) else node.target
    names = [name.id for name in ast.walk(target) if isinstance(name, ast.Name)]
    numbers = [
        c
        for c in ast.walk(node.value)
        if isinstance(c, ast.Constant) and type(c.value) in (int, float)
    ]
    return bool(names and names[0].isupper() and numbers)


def count_nan_fields(tree: ast.Module) -> int:
    """Return the number of fields of classes whose default is NaN."""
    return sum(
        isinstance(field, ast.AnnAssign)
        and field.value is not None
        and "nan" in ast.unparse(field.value)
        for kind in ast.walk(tree)
        if isinstance(kind, ast.ClassDef)
        for field in kind.body
    )


def imported_names(folder: Path) -> set[tuple[str, str]]:
    """Return (module, name) of everything that the files of a folder import from the packages by
    name.
    """
    return {
        (node.module, alias.name)
        for path in folder.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] in PACKAGES
        for alias in node.names
    }


def measure_inside(
    root: Path, modules: dict[str, ast.Module], public: set[str]
) -> list[tuple[str, object]]:
    """Return the rows on the inside: how it reads, and how much of it the tests hold fast."""
    nodes = [node for tree in modules.values() for node in ast.walk(tree)]
    statements = sum(isinstance(node, ast.stmt) for node in nodes)
    functions = [node for node in nodes if isinstance(node, ast.FunctionDef)]
    internal = {
        (module, name)
        for module, name in imported_names(root / "tests")
        if "." in module and f"{module}.{name}" not in modules and f"{module}.{name}" not in public
    }
    files = [
        path.read_text().splitlines()
        for package in PACKAGES
        for path in (root / package).rglob("*.py")
    ]
    return [
        ("syntax nodes", len(nodes)),
        ("places that branch on a kind of input", sum(map(count_kinds, modules.values()))),
        ("fields that default to NaN", sum(map(count_nan_fields, modules.values()))),
        (
            "tuned numbers at module level",
            sum(is_tuned(node) for tree in modules.values() for node in tree.body),
        ),
        (
            "ternaries in 100 statements",
            round(100 * sum(isinstance(n, ast.IfExp) for n in nodes) / statements, 1),
        ),
        ("internal names that tests import", len(internal)),
        ("lines of the largest module", max(map(len, files))),
        ("lines of the longest function", max((f.end_lineno or 0) - f.lineno for f in functions)),
        (
            "comment lines [%]",
            round(
                100
                * sum(line.strip().startswith("#") for f in files for line in f)
                / sum(map(len, files)),
                1,
            ),
        ),
    ]


def longest_chain(modules: dict[str, ast.Module]) -> int:
    """Return the number of modules in the longest chain of imports that run when a module is
    imported.
    """
    below = defaultdict(set)
    for name, tree in modules.items():
        for node in tree.body:
            if isinstance(node, ast.ImportFrom) and node.module:
                members = {f"{node.module}.{alias.name}" for alias in node.names}
                below[name] |= ({node.module} | members) & set(modules) - {name}
    depth: dict[str, int] = {}

    def measure(name: str, above: tuple[str, ...]) -> int:
        if name not in depth:
            lower = [measure(one, (*above, name)) for one in below[name] if one not in above]
            depth[name] = 1 + max(lower, default=0)
        return depth[name]

    return max(measure(name, ()) for name in modules)


def public_names() -> list[tuple[str, str, object]]:
    """Return (module, name, object) of every name in the namespace of a public module."""
    found = []
    for package in PACKAGES:
        face = import_module(package)
        inner = [
            one
            for one in (*dir(face), *getattr(face, "_submodules", ()))
            if not one.startswith("_")
        ]
        modules = [face]
        for name in sorted(set(inner)):
            if isinstance(module := getattr(face, name), ModuleType):
                modules.append(module)
        for module in modules:
            names = getattr(module, "_public_names", None) or getattr(module, "__all__", ())
            found += [(module.__name__, name, getattr(module, name)) for name in names]
    return [one for one in found if not isinstance(one[2], ModuleType)]


def measure_tree(root: Path) -> list[tuple[str, object]]:
    """Return the rows of the table."""
    modules = parse_tree(root)
    lines = sum(
        len(path.read_text().splitlines())
        for package in PACKAGES
        for path in (root / package).rglob("*.py")
    )
    functions = [
        node
        for tree in modules.values()
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef)
    ]
    names = public_names()
    objects = {id(thing): (name, thing) for _, name, thing in names}
    by_name = defaultdict(set)
    for _, name, thing in names:
        by_name[name].add(id(thing))
    classes = [
        thing for _, thing in objects.values() if inspect.isclass(thing) and is_dataclass(thing)
    ]
    rows: list[tuple[str, object]] = [
        ("files", len(modules)),
        ("lines", lines),
        ("statements", sum(map(count_statements, modules.values()))),
        ("public objects", len(objects)),
        ("ways to reach them", len(names)),
        ("same name for different objects", sum(len(ids) > 1 for ids in by_name.values())),
        ("public value classes", len(classes)),
        (
            f"functions with {MANY_ARGUMENTS} arguments or more",
            sum(count_arguments(f) >= MANY_ARGUMENTS for f in functions),
        ),
        ("deepest chain of imports", longest_chain(modules)),
        ("functions of complexity D or worse", sum(complexity(f) >= COMPLEX for f in functions)),
        (
            "Any",
            sum(
                isinstance(n, ast.Name) and n.id == "Any"
                for tree in modules.values()
                for n in ast.walk(tree)
            ),
        ),
    ]
    public = {
        f"{thing.__module__}.{thing.__name__}"
        for _, _, thing in names
        if hasattr(thing, "__name__")
    }
    public |= {f"{module}.{name}" for module, name, _ in names}
    rows += measure_inside(root, modules, public)
    for full, label in REPORTED.items():
        module, _, name = full.rpartition(".")
        kind = getattr(import_module(module), name, None)
        if kind is not None:
            rows.append((f"fields of {label}", len(fields(kind))))
    return rows


def main(arguments: list[str]) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--tree", type=Path, default=Path(__file__).parents[1], help="checkout that is measured"
    )
    root = parser.parse_args(arguments).tree
    sys.path.insert(0, str(root))
    rows = measure_tree(root)
    width = max(len(name) for name, _ in rows)
    print(f"| {'':{width}} | {'':>7} |\n|{'-' * (width + 2)}|{'-' * 9}|")
    for name, found in rows:
        print(f"| {name:{width}} | {found!s:>7} |")


if __name__ == "__main__":
    main(sys.argv[1:])
