"""The reviewed list of private words that no identifier and no sentence of the packages takes.

Each was a name that only those who had written the code could read. `docs/guide/nomenclature.md` has the field's terms.
"""

import ast
import re

from tests.project.test_architecture import ROOT
from tests.support.rules import each

#: Parts of identifiers: a text was `said` or `told`, a neighbour `beside`, a module a `room`, a package a `wing`, ...
WORDS = {
    *("alike", "apart", "bears", "bent", "beside", "door", "doors", "heard", "house", "plate", "room", "rooms", "said"),
    *(
        "spoken",
        "steep",
        "strange",
        "stranger",
        "strangers",
        "tames",
        "tells",
        "told",
        "torn",
        "unlike",
        "wing",
        "wings",
    ),
}
#: Identifiers that keep a word, and why.
REVIEWED = {"not_asked"}
#: Phrases of docstrings, comments and messages, as patterns.
PHRASES = (
    r"\bthis room\b",
    r"\bthe house\b",
    r"\bof the wing\b",
    r"\bits own room\b",
    r"\bsaid for\b",
    r"\bthe other door\b",
    r"\bhead of this (room|wing)\b",
    r"\bthe same of several\b",
    r"\btold apart from the strangers\b",
)
FILES = sorted(path for package in ("nlfrf", "robust") for path in (ROOT / package).rglob("*.py"))


def identifiers(tree):
    """Every name that a module defines: functions, classes, parameters, variables, attributes."""
    for node in ast.walk(tree):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
            yield node.name
        elif isinstance(node, ast.arg):
            yield node.arg
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            yield node.attr


def parts(name):
    """The words of an identifier, in lower case."""
    return re.findall(r"[a-z]+", re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower())


@each((path,) for path in FILES)
def test_no_private_word(path):
    text = path.read_text(encoding="utf-8")
    names = {name for name in identifiers(ast.parse(text)) if set(parts(name)) & WORDS} - REVIEWED
    assert not names, f"{path.name} names {sorted(names)}: take the term of the field"
    found = [phrase for phrase in PHRASES if re.search(phrase, text)]
    assert not found, f"{path.name} says {found}"


def test_the_list_finds_what_it_is_for():
    tree = ast.parse("def told_law(said): beside = said; RoomOf = 1; is_strange = 2")
    assert {name for name in identifiers(tree) if set(parts(name)) & WORDS} == {
        "told_law",
        "said",
        "beside",
        "RoomOf",
        "is_strange",
    }
