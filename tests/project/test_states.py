"""A state is an enum: nothing in the packages decides by the words of a sentence, which may be
reworded at any time.
"""

import ast

import pytest

from tests.support.sources import modules

#: Names, attributes and functions that hold words for people.
PROSE = {
    *(
        "reason",
        "reasons",
        "why",
        "wrong",
        "failure",
        "failed",
        "trouble",
        "message",
        "words",
        "sentence",
        "text",
    ),
    *(
        "said",
        "told",
        "message_lines",
        "listing",
        "description",
        "descriptions",
        "what",
        "where",
        "claim",
        "not_claimed",
        "proved",
        "not_proved",
        "advice",
        "context",
        "verdict",
    ),
    *(
        "probability",
        "words",
        "before",
        "note",
        "notes",
        "summary",
        "warning",
        "error",
        "evidence",
        "subject",
        "how",
    ),
    *("level_source", "state", "outcome"),
}
#: Ways to take a sentence apart.
CUTS = {
    *(
        "startswith",
        "endswith",
        "partition",
        "rpartition",
        "split",
        "rsplit",
        "find",
        "index",
        "removeprefix",
    ),
    "removesuffix",
}
#: module:function that takes words apart which are no message, reviewed one by one: what they are
#: instead.
REVIEWED = {
    "nlfrf.doctor:_iterate_requirements": "a requirement of the metadata of a package",
    "nlfrf.io.readers.header:_parse_number": "a number in a file",
    "nlfrf.io.readers.layout:_first_lines": "the beginning of a file",
    "nlfrf.io.readers.twincat:_separate_by_tabs": "a file",
    "nlfrf._base.values:wrap_lines": "lines of what is printed, broken to fit a screen",
    "nlfrf._base.values:to_plain": "white space made even in what is only printed",
    "nlfrf.io.measurement_files:_read_contents": "white space made even in what is only printed",
    "nlfrf._base.own_process:read_in_own_process": (
        "the name of the exception that ended another process"
    ),
    "nlfrf.bla.bla:covariance_of": "how the level was read, a token that files keep",
    "robust.models.sets.radius:record_radius_parts": (
        "how the level was read, a token that files keep"
    ),
    "nlfrf.records.excited_lines:_excited_lines_on_grid": "the name of a grid",
    "robust.synthesis.fixed.structures:structure_of": "the name of a structure that a user gave",
    "robust.friction.exact.verify:verify_friction": "the parts of a claim, by name",
    "robust.reports.data:cross_check_section": "the label of a row that gets another one",
    "robust.reports.data:nominal_section": "the label of a row that gets another one",
}


def name_of(node):
    """The name that a thing goes by: of a call its function, of an element that of the whole."""
    if isinstance(node, ast.Call):
        return name_of(node.func) if not isinstance(node.func, ast.Attribute) else node.func.attr
    if isinstance(node, ast.Subscript):
        return name_of(node.value)
    return getattr(node, "attr", getattr(node, "id", ""))


def returns_words():
    """Functions of the packages that are said to return a text."""
    return {
        node.name
        for tree in modules().values()
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef)
        and isinstance(node.returns, ast.Name)
        and node.returns.id == "str"
    }


def is_prose(node, words):
    if isinstance(node, ast.Call) and name_of(node) == "str":
        return True
    name = name_of(node)
    return name in PROSE or (isinstance(node, ast.Call) and name in words)


def is_text(node):
    """A text that is not empty, or several."""
    if isinstance(node, ast.Tuple | ast.List | ast.Set):
        return any(map(is_text, node.elts))
    return isinstance(node, ast.Constant) and isinstance(node.value, str) and bool(node.value)


def branches(tree, words):
    """(function, line, code) of everything that takes words apart or compares them with a text."""
    within = {}
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef):
            within |= dict.fromkeys(ast.walk(function), function.name)
    for node in ast.walk(tree):
        found = False
        if (
            isinstance(node, ast.Call)
            and isinstance(node.func, ast.Attribute)
            and node.func.attr in CUTS
        ):
            found = is_prose(node.func.value, words)
        elif isinstance(node, ast.Call) and name_of(node.func) in (
            "match",
            "search",
            "fullmatch",
            "findall",
        ):
            found = any(is_prose(given, words) for given in node.args[1:])
        elif isinstance(node, ast.Compare):
            sides = [node.left, *node.comparators]
            kinds = (ast.In, ast.NotIn, ast.Eq, ast.NotEq)
            found = any(isinstance(op, kinds) for op in node.ops) and (
                any(is_prose(side, words) for side in sides) and any(map(is_text, sides))
            )
        elif isinstance(node, ast.Match):
            found = is_prose(node.subject, words)
        if found:
            yield within.get(node, ""), node.lineno, ast.unparse(node)


def test_nothing_is_decided_by_the_words_of_a_sentence():
    words = returns_words()
    found = {
        f"{name}:{function}": f"{name}:{line}: {code}"
        for name, tree in modules().items()
        for function, line, code in branches(tree, words)
    }
    assert not {place: code for place, code in found.items() if place not in REVIEWED}
    assert set(REVIEWED) <= set(found), "reviewed places that are no more"


@pytest.mark.parametrize(
    "code",
    [
        'found.reason.startswith("violated")',
        'wrong.startswith("undecided")',
        'said.partition("a pole of the nominal loop ")[2]',
        '"unstable" in report.reason',
        "claim.startswith(start)",
        'report.verdict == "robust"',
        'proof.verdict not in ("proved", "refuted")',
        'str(found).split(":")',
        'reasons[0].endswith("boundary")',
        're.match("violated", certificate.reason)',
    ],
)
def test_the_check_sees_each_kind_of_branch(code):
    assert list(branches(ast.parse(code), set()))


@pytest.mark.parametrize(
    "code", ["if not reason: pass", 'reason == ""', "f'{reason}'.upper()", "path.split('/')"]
)
def test_the_check_leaves_be_what_is_no_branch_on_words(code):
    assert not list(branches(ast.parse(code), set()))
