"""A module shows its interface: names without underscore are used outside it, names with one nowhere else."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("nlfrf", "robust")
CLIENTS = ("tests", "benchmarks", "examples", "docs")


def module_of(path):
    """Return the dotted name of a file."""
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def parsed(folders, *patterns):
    """Return the tree of every file of the folders, by its path."""
    paths = [path for folder in folders for pattern in patterns for path in (ROOT / folder).rglob(pattern)]
    return {path: ast.parse(path.read_text(encoding="utf-8")) for path in sorted(paths)}


INSIDE = parsed(PACKAGES, "*.py", "*.pyi")
FILES = INSIDE | parsed(CLIENTS, "*.py")
MODULES = {module_of(path): path for path in INSIDE if path.suffix == ".py"}


def imported(path, tree):
    """Yield (module, name, alias) of each `from module import name` of a file; of `import module` the module alone."""
    own = module_of(path)
    package = own if path.stem == "__init__" else own.rpartition(".")[0]
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield "", alias.name, alias.asname or alias.name
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            for alias in node.names:
                yield base, alias.name, alias.asname or alias.name


#: Files that reach a module under any name: each attribute there, and each word of a text, may be a name of a module.
LATE = (
    "lazy_loader.load(",
    "import_module(",
    "sys.modules[",
    "reader.contents",
    "import_extra(",
    "setattr(",
    "subprocess",
)


def reached(tree, modules):
    """Yield (module, name) of each attribute of a module; modules: alias -> module."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute):
            head, _, rest = ast.unparse(node.value).partition(".")
            base = modules.get(head, head) + (f".{rest}" if rest else "")
            if base in MODULES:
                yield base, node.attr


def is_text(node):
    """Return whether a node is a text of a program, and not a paragraph."""
    return isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value.count(". ") < 3


def is_command(node):
    """Return whether a function is a command, or what runs before all of them."""
    return any(re.search(r"\.(command|callback)\b", ast.unparse(one)) for one in getattr(node, "decorator_list", []))


def top_level(tree):
    """Yield functions, classes and constants of a module."""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not is_command(node):
            yield node.name
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            leaves = [leaf.id for target in targets for leaf in ast.walk(target) if isinstance(leaf, ast.Name)]
            yield from (name for name in leaves if name.strip("_").isupper() and len(name.strip("_")) > 1)


DEFINED = {module: set(top_level(INSIDE[path])) for module, path in MODULES.items()}


def uses():
    """Return (module, name) -> files that import a name of a module, reach it as an attribute, or name it in a text."""
    found = {}
    for path, tree in FILES.items():
        names = list(imported(path, tree))
        joined = {alias: f"{base}.{name}".lstrip(".") for base, name, alias in names}
        text = path.read_text(encoding="utf-8")
        texts = re.findall(r"\b(?:nlfrf|robust)(?:\.\w+)+", text)
        late = {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
        late |= set(re.findall(r"\w+", " ".join(leaf.value for leaf in ast.walk(tree) if is_text(leaf))))
        late = late if any(word in text for word in LATE) else set()
        found_late = [(module, name) for module in MODULES for name in late & DEFINED[module]]
        pairs = [(base, name) for base, name, _ in names] + list(reached(tree, joined))
        for pair in [*pairs, *found_late, *(tuple(text.rpartition(".")[::2]) for text in texts)]:
            found.setdefault(pair, set()).add(path)
    return found


USES = uses()


def test_a_name_without_underscore_is_used_outside_its_module():
    lonely = [
        f"{module}.{name}"
        for module, path in MODULES.items()
        if path.stem not in ("__init__", "__main__")
        for name in top_level(INSIDE[path])
        if not name.startswith("_") and not USES.get((module, name), set()) - {path}
    ]
    assert not lonely, "an underscore for what no other file uses: " + ", ".join(lonely)


def test_a_name_with_underscore_is_used_in_its_module_alone():
    private = {(module, name) for module, path in MODULES.items() for name in top_level(INSIDE[path]) if name[0] == "_"}
    known = {pair: USES.get(pair, set()) - {MODULES[pair[0]]} for pair in private}
    taken = [f"{module}.{name} in {path.name}" for (module, name), paths in known.items() for path in paths]
    assert not taken, "a name with an underscore is its module's own: " + ", ".join(taken)
