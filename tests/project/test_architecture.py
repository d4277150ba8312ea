"""The layout: packages and parts with their arrows, modules that name what is public, heavy
packages late.
"""

import ast
import json
import subprocess
import sys
from functools import cache
from importlib import import_module

import pytest

from tests.support.sources import ROOT, modules

#: Package -> the packages that its modules may import from; every module may import from `_base`.
ARROWS = {
    "nlfrf._base": "",
    "nlfrf.signals": "",
    "nlfrf.records": "signals",
    "nlfrf.bla": "records signals",
    "nlfrf.rig": "bla records signals",
    "nlfrf.io": "bla records signals",
    "nlfrf.plot": "bla records signals",
    "nlfrf.doctor": "",
    "robust._base": "",
    "robust.lti": "",
    "robust.pages": "lti",
    "robust.proofs": "lti",
    "robust.mu": "proofs lti",
    "robust.models": "pages mu proofs lti",
    "robust.friction": "pages proofs lti",
    "robust.scheduling": "models proofs lti",
    "robust.analysis": "pages models mu proofs lti",
    "robust.synthesis": "pages analysis friction models mu proofs lti",
    "robust.plot": "scheduling synthesis analysis friction models lti",
    "robust.io": "scheduling synthesis analysis friction models proofs lti",
    "robust.servo": "pages plot io synthesis analysis friction models lti",
    "robust.reports": "pages io plot synthesis analysis friction models lti",
}
#: The same one level down: part -> the parts of the same package that it may import from.
#: The modules that lie in the package itself are the part named ".".
PARTS = {
    "nlfrf.records": {"screening": "", ".": "screening"},
    "nlfrf.rig": {"kernels": "", "laws": "kernels", "bench": "laws kernels"},
    "nlfrf.io": {"readers": "", ".": "readers"},
    "robust.models": {"fit": "", "sets": "fit", ".": "sets fit"},
    "robust.proofs": {"exact": "", "search": "exact"},
    "robust.friction": {
        "exact": "",
        ".": "",
        "proof": "exact .",
        "classes": "proof exact .",
        "reading": "classes .",
    },
    "robust.synthesis": {"hinf": "", ".": "hinf", "fixed": "hinf .", "tuning": "."},
    "robust.servo": {
        "gains": "",
        "experiment": "",
        "checking": "experiment gains",
        ".": "checking experiment gains",
    },
    "robust.reports": {".": "", "shaping_page": ""},
}
#: Faces: public modules that hand on the names of a package, and the commands, which may import
#: from every module.
FACES = {
    *("nlfrf", "nlfrf.cli", "nlfrf.friction", "nlfrf.hysteresis", "nlfrf.plot"),
    *(
        "robust",
        "robust.cli",
        "robust.servo.cli",
        "robust.plot",
        "robust.margins",
        "robust.shaping",
        "robust.tuning",
    ),
}
#: The commands: faces with all of their modules. They alone print.
COMMANDS = ("nlfrf.cli", "robust.cli", "robust.servo.cli")
#: What `robust` may take from `nlfrf`: its public names.
NLFRF_FACES = {
    "nlfrf",
    *(f"nlfrf.{name}" for name in ("bla", "friction", "io", "plot", "rig", "signals")),
}
#: Packages in which each module holds one public class and is named like it, which says enough.
ONE_CLASS_EACH = {"robust.friction.classes"}
#: Where a heavy package may be imported at all: modules, or whole packages.
HEAVY = {
    "matplotlib": "nlfrf.plot robust.plot nlfrf._base.axes robust.pages.html nlfrf.cli robust.cli",
    "numba": "nlfrf.rig.kernels",
    "h5py": "nlfrf.io.readers.hdf5 nlfrf._base.files",
    "cvxpy": (
        "robust.proofs.search robust.models.fit.spectral robust.models.sets.block_weights "
        "robust.friction.classes.bristle robust.friction.proof.settling"
    ),
    "clarabel": "robust.synthesis.conic",
    "jinja2": "robust.pages.html",
    "jsonschema": "nlfrf._base.parsing",
    "flint": (
        "robust.proofs.exact robust.proofs.search.scheduled robust.friction.exact"
        " robust.models.sets.membership robust.mu.pieces robust.scheduling.attack"
    ),
    "anywidget": "robust.reports.shaping_page.widget",
    "traitlets": "robust.reports.shaping_page.widget",
    "pandas": "nlfrf.io.readers.tables",
    "nptdms": "nlfrf.io.readers.tdms",
    "asammdf": "nlfrf.io.readers.mdf",
    "pyuff": "nlfrf.io.readers.uff",
    "skrf": "nlfrf.io.readers.touchstone",
    "pytcs": "nlfrf.io.readers.twincat",
    "pyarrow": "nlfrf.io.readers.columns",
}
ALWAYS_LATE = set(HEAVY) - {"numba", "flint"}


def each_module(rule):
    """Hold every module against a rule, in one test."""

    def test_every_module():
        for name, tree in modules().items():
            rule(name, tree)

    test_every_module.__doc__ = rule.__doc__
    return test_every_module


def package_of(module):
    """Return the package of a module; a module directly in nlfrf or robust is a package of
    its own.
    """
    return ".".join(module.split(".")[:2])


def is_command(module):
    """Whether a module belongs to the commands."""
    return f"{module}.".startswith(tuple(f"{command}." for command in COMMANDS))


def part_of(module):
    """(package, part) of a module on the second level; part "." for a module that lies in the
    package itself.
    """
    names = module.split(".")
    package = ".".join(names[:2])
    return package, names[2] if len(names) > 2 and names[2] in PARTS.get(package, ()) else "."


@cache
def imports(tree):
    """Return (module, names, whether it runs on import) of every import in a file, inside functions
    too.
    """
    return list(_iterate_imports(tree))


def statements(tree, at_import=True):
    """Yield every statement below a node with whether it runs on import: in no function, and not
    for a type checker alone.
    """
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.expr):
            continue
        yield node, at_import
        late = isinstance(node, ast.FunctionDef) or (
            at_import and isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
        )
        yield from statements(node, at_import and not late)


def _iterate_imports(tree):
    for node, at_import in statements(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, [], at_import
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            names = [alias.name for alias in node.names]
            full = [f"{node.module}.{name}" for name in names]
            for module in full:
                if module in modules():
                    yield module, [], at_import
            rest = [
                name for name, module in zip(names, full, strict=True) if module not in modules()
            ]
            if rest:
                yield node.module, rest, at_import


def is_lazy(tree):
    """Whether a package has nothing but its docstring and the names of its stub, each loaded when
    it is first used.
    """
    return len(tree.body) == 3 and "lazy_loader.attach_stub" in ast.unparse(tree.body[-1])


def defined(tree):
    """Return every name that a module defines."""
    names = set()
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names |= {
                leaf.id
                for target in targets
                for leaf in ast.walk(target)
                if isinstance(leaf, ast.Name)
            }
    return names


def classes_of(module):
    """Return the names of the public classes of a module, in lower case."""
    return {
        node.name.lower()
        for node in modules()[module].body
        if isinstance(node, ast.ClassDef) and node.name[0] != "_"
    }


def test_the_tables_name_every_package():
    found = {package_of(name) for name in modules() if name.count(".")} - (FACES - set(ARROWS))
    assert found == set(ARROWS)
    assert set(modules()) >= FACES


@each_module
def test_arrows_run_one_way(name, tree):
    root, package = name.split(".")[0], package_of(name)
    for imported, names, _ in imports(tree):
        top = imported.split(".")[0]
        if root == "nlfrf":
            assert top not in ("robust", "control", "cvxpy"), f"{name} imports {imported}"
        if top not in ("nlfrf", "robust") or name in FACES or is_command(name):
            continue
        if top != root:
            allowed = imported in NLFRF_FACES or package_of(imported) == "nlfrf._base"
            assert allowed, (
                f"{name} imports {imported}: nlfrf is known by its public names and its shared"
                " ground"
            )
            if imported in NLFRF_FACES:
                assert set(names) <= set(import_module(imported).__all__), (
                    f"{name} imports {names} from {imported}"
                )
        elif imported != root:
            allowed = {f"{root}.{other}" for other in ARROWS[package].split()} | {
                package,
                f"{root}._base",
            }
            assert package_of(imported) in allowed, f"{name} imports {imported}"
        else:
            raise AssertionError(f"{name} imports its own package")


@each_module
def test_arrows_run_one_way_between_parts(name, tree):
    package, part = part_of(name)
    if package in PARTS and name not in FACES and name != package:
        for imported, _, _ in imports(tree):
            other_package, other = part_of(imported)
            if other_package == package and imported != package:
                allowed = {part, *PARTS[package][part].split()}
                assert other in allowed, f"{name} imports {imported}"


def test_the_table_of_parts_names_every_folder():
    folders = {
        name
        for name in modules()
        if name.count(".") == 2 and (ROOT / name.replace(".", "/")).is_dir()
    }
    assert folders == {
        f"{package}.{part}" for package, parts in PARTS.items() for part in parts if part != "."
    }


def test_no_circle_inside_a_package():
    """Late imports count too: a circle is a circle whenever it closes."""
    below = {
        name: {i for i, _, _ in imports(tree) if i in modules() and i not in FACES}
        for name, tree in modules().items()
    }
    done = set()
    while True:
        free = {name for name in below if name not in done and below[name] <= done | {name}}
        if not free:
            break
        done |= free
    assert set(modules()) - done <= FACES


def test_packages_stand_in_few_layers():
    def layer(package):
        root = package.split(".")[0]
        others = [f"{root}.{other}" for other in ARROWS[package].split()]
        own = 1 + max(map(layer, others), default=0)
        return own if package == "nlfrf._base" else max(own, 1 + layer("nlfrf._base"))

    assert (
        max(map(layer, ARROWS)) + 2 <= 11
    )  # and the face, and the command; the servo axis stands on all others


def test_no_package_is_called_like_a_public_name():
    import nlfrf
    import robust

    for module in (nlfrf, robust):
        packages = {
            package.split(".")[1] for package in ARROWS if package.startswith(module.__name__)
        }
        assert not packages & set(module.__all__)


@each_module
def test_every_package_docstring_describes_its_modules(name, tree):
    """The `__init__` of a package says what each module holds, and has no code unless the package
    is public.
    """
    held = {
        other.split(".")[-1]
        for other in modules()
        if other.startswith(f"{name}.") and other.count(".") == name.count(".") + 1
    }
    if not (name.count(".") >= 1 and held):
        return
    if name in ONE_CLASS_EACH:
        unlike = {one for one in held if one.replace("_", "") not in classes_of(f"{name}.{one}")}
        assert not unlike, f"{name}: {unlike} are not named like their class"
        return
    rows = [line.split(maxsplit=1) for line in ast.get_docstring(tree).splitlines()]
    described = {row[0] for row in rows if len(row) == 2}
    assert held <= described, f"{name} does not say what {held - described} holds"
    assert name in FACES or len(tree.body) == 1 or is_lazy(tree), (
        f"{name}: a package docstring stands alone"
    )


@each_module
def test_names_are_imported_from_the_module_that_defines_them(name, tree):
    """Not from one that imports them itself; and a name with an underscore in front stays in its
    module.
    """
    for imported, names, _ in imports(tree):
        if (
            imported in modules()
            and names
            and imported not in FACES
            and not is_lazy(modules()[imported])
        ):
            foreign = set(names) - defined(modules()[imported])
            assert not foreign, f"{name} takes {foreign} from {imported}, which does not define it"
            private = {one for one in names if one.startswith("_")}
            assert not private, f"{name} takes {private} from {imported}, where they are private"


def test_only_packages_and_faces_list_their_names():
    for name, tree in modules().items():
        lists = any(
            "__all__" in ast.unparse(node) for node in tree.body if isinstance(node, ast.Assign)
        )
        assert not lists or name in FACES or is_lazy(tree), f"{name} has __all__"


@each_module
def test_heavy_packages_are_imported_where_they_are_used(name, tree):
    for imported, _, at_import in imports(tree):
        package = imported.split(".")[0]
        if package in HEAVY:
            places = HEAVY[package].split()
            assert any(f"{name}.".startswith(f"{place}.") for place in places), (
                f"{name} imports {package}"
            )
        assert not (at_import and package in ALWAYS_LATE), f"{name} imports {package} at the top"


@pytest.mark.parametrize(
    ("taken", "unloaded"),
    [
        (
            "nlfrf; [getattr(nlfrf, name) for name in nlfrf.__all__]",
            [
                "control",
                "cvxpy",
                "matplotlib",
                "numba",
                "h5py",
                "typer",
                "rich",
                "scipy.signal",
                "scipy.stats",
            ],
        ),
        (
            "nlfrf, robust",
            ["control", "numpy", "cvxpy", "matplotlib", "numba", "h5py", "typer", "rich"],
        ),
    ],
)
def test_import_loads_nothing_heavy(taken, unloaded):
    code = f"import sys, {taken}; print([m for m in {unloaded} if m in sys.modules])"
    assert subprocess.check_output([sys.executable, "-c", code], text=True).strip() == "[]"


def test_robust_is_a_plain_module():
    """Also after every module was imported: a function of the face is never hidden by the module it
    is defined in.
    """
    plain = sorted(name for name in modules() if name.startswith("robust") and not is_command(name))
    code = (
        f"import importlib, types, robust\nfor module in {plain}:\n   "
        " importlib.import_module(module)\nassert type(robust) is types.ModuleType\nprint([name"
        " for name in robust.__all__ if isinstance(getattr(robust, name), types.ModuleType)])\n"
    )
    assert subprocess.check_output([sys.executable, "-c", code], text=True).strip() == "[]"


def test_the_library_never_prints():
    for name, tree in modules().items():
        if not is_command(name):
            calls = [
                n
                for n in ast.walk(tree)
                if isinstance(n, ast.Call) and getattr(n.func, "id", "") == "print"
            ]
            assert not calls, f"{name} prints"


@pytest.mark.parametrize("schema", ["robust-model", "robust-matrix-model"])
def test_a_schema_has_every_form(schema):
    """A form that it lacks is saved, and its file is not loaded."""
    from robust.models.sets.forms import FORMS, MATRIX_FORMS

    wanted = {"robust-model": FORMS, "robust-matrix-model": MATRIX_FORMS}[schema]
    text = (ROOT / "robust" / f"{schema}.schema.json").read_text(encoding="utf-8")
    assert set(json.loads(text)["properties"]["form"]["enum"]) == set(wanted)


def test_forms_are_named_in_one_module():
    """A further form of uncertainty is one row of the table: no other module asks for a form by its
    name.
    """
    from robust.models.sets.forms import FORMS

    for name, tree in modules().items():
        if name != "robust.models.sets.forms":
            named = {
                n.value
                for n in ast.walk(tree)
                if isinstance(n, ast.Constant) and n.value in tuple(FORMS)
            }
            assert not named, f"{name} asks for {named}"
