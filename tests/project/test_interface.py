"""A module shows its interface: names without underscore are used outside it, names with one
nowhere else.
"""

import ast
import re
from functools import cache

from tests.support.sources import PACKAGES, ROOT, module_of, modules, parsed

CLIENTS = ("tests", "benchmarks", "examples", "docs")


def files():
    """Return path -> tree of every file that may use a name: modules, their stubs and all
    clients.
    """
    stubs = [parsed(package, "*.pyi") for package in PACKAGES]
    return {
        path: tree
        for found in (*map(parsed, PACKAGES + CLIENTS), *stubs)
        for path, tree in found.items()
    }


@cache
def paths():
    """Return module -> path."""
    return {module_of(path): path for package in PACKAGES for path in parsed(package)}


def imported(path, nodes):
    """Yield (module, name, alias) of each `from module import name` of a file; of `import module`
    the module alone.
    """
    own = module_of(path)
    package = own if path.stem == "__init__" else own.rpartition(".")[0]
    for node in nodes:
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield "", alias.name, alias.asname or alias.name
        elif isinstance(node, ast.ImportFrom):
            above = (
                package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            )
            base = ".".join([*above, *([node.module] if node.module else [])])
            for alias in node.names:
                yield base, alias.name, alias.asname or alias.name


#: Files that reach a module under any name: each attribute there, and each word of a text, may be a
#: name of a module.
LATE = (
    "import_module(",
    "sys.modules[",
    "reader.contents",
    "import_extra(",
    "setattr(",
    "subprocess",
)


def dotted(node):
    """Return the dotted name of a chain of attributes; "" of anything else."""
    names = []
    while isinstance(node, ast.Attribute):
        names.append(node.attr)
        node = node.value
    return ".".join([node.id, *reversed(names)]) if isinstance(node, ast.Name) else ""


def reached(nodes, aliases):
    """Yield (module, name) of each attribute of a module; aliases: alias -> module."""
    for node in nodes:
        if isinstance(node, ast.Attribute):
            head, _, rest = dotted(node.value).partition(".")
            base = aliases.get(head, head) + (f".{rest}" if rest else "")
            if base in modules():
                yield base, node.attr


def is_text(node):
    """Return whether a node is a text of a program, and not a paragraph."""
    return (
        isinstance(node, ast.Constant)
        and isinstance(node.value, str)
        and node.value.count(". ") < 3
    )


def is_command(node):
    """Return whether a function is a command, or what runs before all of them."""
    return any(
        re.search(r"\.(command|callback)\b", ast.unparse(one))
        for one in getattr(node, "decorator_list", [])
    )


@cache
def top_level(tree):
    """Return functions, classes and constants of a module."""
    return list(_iterate_top_level(tree))


def _iterate_top_level(tree):
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not is_command(node):
            yield node.name
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            leaves = [
                leaf.id
                for target in targets
                for leaf in ast.walk(target)
                if isinstance(leaf, ast.Name)
            ]
            yield from (
                name for name in leaves if name.strip("_").isupper() and len(name.strip("_")) > 1
            )


def named_late(text, nodes):
    """Yield (module, name) of what a file may reach through a module whose name it does not
    import.
    """
    if any(word in text for word in LATE):
        words = {node.attr for node in nodes if isinstance(node, ast.Attribute)}
        words |= set(re.findall(r"\w+", " ".join(node.value for node in nodes if is_text(node))))
        for module, tree in modules().items():
            yield from ((module, name) for name in top_level(tree) if name in words)


@cache
def uses():
    """Return (module, name) -> files that import a name of a module, reach it as an attribute, or
    name it in a text.
    """
    found = {}
    for path, tree in files().items():
        text, nodes = path.read_text(encoding="utf-8"), list(ast.walk(tree))
        names = list(imported(path, nodes))
        aliases = {alias: f"{base}.{name}".lstrip(".") for base, name, alias in names}
        pairs = (
            {(base, name) for base, name, _ in names}
            | set(reached(nodes, aliases))
            | set(named_late(text, nodes))
        )
        pairs |= {
            dots.rpartition(".")[::2] for dots in re.findall(r"\b(?:nlfrf|robust)(?:\.\w+)+", text)
        }
        for pair in pairs:
            found.setdefault(pair, set()).add(path)
    return found


def test_a_name_without_underscore_is_used_outside_its_module():
    lonely = [
        f"{module}.{name}"
        for module, path in paths().items()
        if path.stem not in ("__init__", "__main__")
        for name in top_level(modules()[module])
        if not name.startswith("_") and not uses().get((module, name), set()) - {path}
    ]
    cure = "an underscore, or a line in the .pyi of its package, for what no other file uses: "
    assert not lonely, cure + ", ".join(lonely)


def test_a_name_with_underscore_is_used_in_its_module_alone():
    private = {
        (module, name)
        for module, tree in modules().items()
        for name in top_level(tree)
        if name[0] == "_"
    }
    known = {pair: uses().get(pair, set()) - {paths()[pair[0]]} for pair in private}
    taken = [
        f"{module}.{name} in {path.name}"
        for (module, name), users in known.items()
        for path in users
    ]
    assert not taken, "a name with an underscore is its module's own: " + ", ".join(taken)


def test_every_public_name_stands_where_a_user_meets_it():
    """In an example, on a how-to page or in the README: a name that no user needs is not public."""
    read = [
        *(ROOT / "examples").rglob("*.py"),
        *(ROOT / "examples").rglob("*.ipynb"),
        *(ROOT / "docs" / "howto").glob("*.md"),
        ROOT / "README.md",
    ]
    words = set(re.findall(r"\w+", " ".join(path.read_text(encoding="utf-8") for path in read)))
    stubs = {path: tree for package in PACKAGES for path, tree in parsed(package, "*.pyi").items()}
    unmet = {
        f"{path.parent.relative_to(ROOT)}: {alias.asname or alias.name}"
        for path, tree in stubs.items()
        for node in tree.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if (alias.asname or alias.name) not in words
    }
    assert stubs
    assert not unmet, "in no example, how-to page or README: " + ", ".join(sorted(unmet))
