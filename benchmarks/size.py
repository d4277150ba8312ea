"""How large the packages are: lines, statements, public names and the ways to them, arguments, fields, depth.

    python -m benchmarks.size                    # this tree
    python -m benchmarks.size --tree FOLDER      # another checkout, with its own packages

Statements are those of Python, a docstring being one. A public object counts once, a way to it is a name in the
namespace of a public module. The complexity of a function is the number of its branches (McCabe), boolean operators
counted.
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
BRANCHES = (ast.If, ast.For, ast.While, ast.ExceptHandler, ast.IfExp, ast.Assert, ast.comprehension, ast.match_case)


def parse_tree(root: Path) -> dict[str, ast.Module]:
    """Return every module of the packages by its name."""
    files = [path for package in PACKAGES for path in sorted((root / package).rglob("*.py"))]
    return {
        ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__"): ast.parse(path.read_text())
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
    """Return one more than the number of branches of a function, those of the functions inside it included."""
    found = 1
    for node in ast.walk(function):
        found += isinstance(node, BRANCHES)
        found += len(node.values) - 1 if isinstance(node, ast.BoolOp) else 0
        found += len(node.ifs) if isinstance(node, ast.comprehension) else 0
    return found


def longest_chain(modules: dict[str, ast.Module]) -> int:
    """Return the number of modules in the longest chain of imports that run when a module is imported."""
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
        inner = [one for one in (*dir(face), *getattr(face, "_submodules", ())) if not one.startswith("_")]
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
    lines = sum(len(path.read_text().splitlines()) for package in PACKAGES for path in (root / package).rglob("*.py"))
    functions = [node for tree in modules.values() for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    names = public_names()
    objects = {id(thing): (name, thing) for _, name, thing in names}
    by_name = defaultdict(set)
    for _, name, thing in names:
        by_name[name].add(id(thing))
    classes = [thing for _, thing in objects.values() if inspect.isclass(thing) and is_dataclass(thing)]
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
            sum(isinstance(n, ast.Name) and n.id == "Any" for tree in modules.values() for n in ast.walk(tree)),
        ),
    ]
    for full, label in REPORTED.items():
        module, _, name = full.rpartition(".")
        kind = getattr(import_module(module), name, None)
        if kind is not None:
            rows.append((f"fields of {label}", len(fields(kind))))
    return rows


def main(arguments: list[str]) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tree", type=Path, default=Path(__file__).parents[1], help="checkout that is measured")
    root = parser.parse_args(arguments).tree
    sys.path.insert(0, str(root))
    rows = measure_tree(root)
    width = max(len(name) for name, _ in rows)
    print(f"| {'':{width}} | {'':>7} |\n|{'-' * (width + 2)}|{'-' * 9}|")
    for name, found in rows:
        print(f"| {name:{width}} | {found!s:>7} |")


if __name__ == "__main__":
    main(sys.argv[1:])
