"""The sources of the packages and of what uses them, parsed once for all rules that are held
against them.
"""

import ast
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("nlfrf", "robust")


def module_of(path):
    """Return the dotted name of a file."""
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


@cache
def parsed(folder, pattern="*.py"):
    """Return the tree of every file of a folder of the project, by its path."""
    return {
        path: ast.parse(path.read_text(encoding="utf-8"))
        for path in sorted((ROOT / folder).rglob(pattern))
    }


@cache
def modules():
    """Return the tree of every module of the packages, by its dotted name."""
    return {
        module_of(path): tree
        for package in PACKAGES
        for path, tree in parsed(package).items()
        if path.stem != "__main__"  # python -m
    }
