"""The house: wings and their arrows, rooms that show their face, heavy packages late."""

import ast
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

#: Wing -> the wings its rooms may import from; every room may import from `shared`. The only thing typed by hand here.
ARROWS = {
    "nlfrf.shared": "",
    "nlfrf.excitation": "",
    "nlfrf.friction": "",
    "nlfrf.records": "excitation",
    "nlfrf.identification": "records excitation",
    "nlfrf.multivariable": "identification records excitation",
    "nlfrf.coupled": "friction",
    "nlfrf.bench": "coupled friction records excitation",
    "nlfrf.readers": "",
    "nlfrf.files": "readers multivariable identification records excitation",
    "nlfrf.studies": "bench identification records excitation",
    "nlfrf.plot": "multivariable identification records excitation",
    "nlfrf.doctor": "",
    "robust.shared": "",
    "robust.systems": "",
    "robust.verification": "",
    "robust.friction_verification": "verification",
    "robust.certificates": "verification systems",
    "robust.modelling": "systems",
    "robust.mu": "certificates systems",
    "robust.uncertain": "modelling mu certificates systems",
    "robust.validation": "uncertain modelling systems",
    "robust.performance": "systems",
    "robust.analysis": "performance uncertain mu certificates verification systems",
    "robust.synthesis": "analysis uncertain modelling mu certificates systems",
    "robust.fixed_structure": "friction_proof sliding analysis synthesis uncertain certificates systems",
    "robust.sliding": "systems",
    "robust.storage": "",
    "robust.friction_proof": "sliding storage certificates friction_verification verification systems",
    "robust.saturation": "friction_proof friction_verification sliding storage certificates systems",
    "robust.friction_motion": "friction_proof sliding systems",
    "robust.plot": "validation loopshaping friction_motion analysis performance uncertain modelling systems",
    "robust.loopshaping": "uncertain systems",
    "robust.shaping_page": "loopshaping analysis uncertain modelling systems",
    "robust.files": "saturation friction_proof friction_verification sliding analysis uncertain verification systems",
    "robust.reports": "files plot validation friction_proof analysis performance uncertain modelling systems",
}
#: Faces: public modules that hand on the names of a wing, and the commands, which may enter any room.
FACES = {
    *("nlfrf", "nlfrf.cli", "nlfrf.friction", "nlfrf.hysteresis", "nlfrf.plot"),
    *("robust", "robust.cli", "robust.plot", "robust.shaping_plot"),
}
#: Where a heavy package may be imported at all: rooms, or whole wings.
HEAVY = {
    "matplotlib": "nlfrf.plot robust.plot nlfrf.shared.axes nlfrf.studies.figures "
    "robust.reports.parts nlfrf.cli robust.cli",
    "numba": "nlfrf.friction.leuven_kernels nlfrf.friction.slip_kernels nlfrf.friction.slider_kernels "
    "nlfrf.friction.loop_kernels nlfrf.friction.own_kernels nlfrf.coupled.step_kernels "
    "nlfrf.coupled.run_kernels",
    "h5py": "nlfrf.readers.hdf5 nlfrf.shared.whole_files nlfrf.shared.outputs",
    "cvxpy": "robust.certificates robust.mu.lmi robust.fixed_structure.cone_program "
    "robust.friction_proof.bristle_multipliers robust.friction_proof.linear_uncertainty",
    "jinja2": "robust.reports.page",
    "flint": "robust.verification robust.friction_verification",
    "anywidget": "robust.shaping_page.widget",
    "traitlets": "robust.shaping_page.widget",
    "pandas": "nlfrf.readers.tables",
    "matio": "nlfrf.readers.matlab_objects",
    "nptdms": "nlfrf.readers.tdms",
    "asammdf": "nlfrf.readers.mdf",
    "pyuff": "nlfrf.readers.uff",
    "pyarrow": "nlfrf.readers.columns",
}
ALWAYS_LATE = set(HEAVY) - {"numba"}


def found_rooms():
    for package in ("nlfrf", "robust"):
        for path in sorted((ROOT / package).rglob("*.py")):
            name = ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
            yield name, ast.parse(path.read_text())


ROOMS = dict(found_rooms())
EACH = pytest.mark.parametrize(("name", "tree"), ROOMS.items(), ids=list(ROOMS))


def wing_of(room):
    """The folder of a room; a room on the landing is a wing of its own."""
    return ".".join(room.split(".")[:2])


def imports(tree):
    """(module, names, whether it runs on import) of every import in a file, inside functions too."""
    late = {node for function in ast.walk(tree) if isinstance(function, ast.FunctionDef) for node in ast.walk(function)}
    blocks = [n for n in ast.walk(tree) if isinstance(n, ast.If) and "TYPE_CHECKING" in ast.dump(n.test)]
    typing_only = {node for block in blocks for node in ast.walk(block)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, [], node not in late and node not in typing_only
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            names = [alias.name for alias in node.names]
            rooms = [f"{node.module}.{name}" for name in names]
            for room in rooms:
                if room in ROOMS:
                    yield room, [], node not in late and node not in typing_only
            rest = [name for name, room in zip(names, rooms, strict=True) if room not in ROOMS]
            if rest:
                yield node.module, rest, node not in late and node not in typing_only


def shown(tree):
    """What a room names in `__all__`."""
    for node in tree.body:
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "__all__":
            return set(ast.literal_eval(node.value))
    return None


def defined(tree):
    """Every name that a room defines."""
    names = set()
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names |= {leaf.id for target in targets for leaf in ast.walk(target) if isinstance(leaf, ast.Name)}
    return names


def test_the_tables_name_every_wing():
    found = {wing_of(name) for name in ROOMS if name.count(".")} - (FACES - set(ARROWS))
    assert found == set(ARROWS)
    assert set(ROOMS) >= FACES


@EACH
def test_arrows_run_one_way(name, tree):
    package, wing = name.split(".")[0], wing_of(name)
    for imported, names, _ in imports(tree):
        top = imported.split(".")[0]
        if package == "nlfrf":
            assert top not in ("robust", "control", "cvxpy"), f"{name} imports {imported}"
        if top not in ("nlfrf", "robust") or name in FACES:
            continue
        if top != package:
            allowed = imported in ("nlfrf", "nlfrf.plot") or wing_of(imported) == "nlfrf.shared"
            assert allowed, f"{name} imports {imported}: nlfrf is known by its public names and its shared ground"
            public = set(import_module("nlfrf").__all__)
            assert imported != "nlfrf" or set(names) <= public, f"{name} imports {names} from nlfrf"
        elif imported != package:
            allowed = {f"{package}.{other}" for other in ARROWS[wing].split()} | {wing, f"{package}.shared"}
            assert wing_of(imported) in allowed, f"{name} imports {imported}"
        else:
            raise AssertionError(f"{name} imports its own package")


def test_no_circle_inside_a_wing():
    """Late imports count too: a circle is a circle whenever it closes."""
    below = {name: {i for i, _, _ in imports(tree) if i in ROOMS and i not in FACES} for name, tree in ROOMS.items()}
    done = set()
    while True:
        free = {name for name in below if name not in done and below[name] <= done | {name}}
        if not free:
            break
        done |= free
    assert set(ROOMS) - done <= FACES


def test_wings_stand_in_few_floors():
    def floor(wing):
        package = wing.split(".")[0]
        others = [f"{package}.{other}" for other in ARROWS[wing].split()]
        own = 1 + max(map(floor, others), default=0)
        return own if wing == "nlfrf.shared" else max(own, 1 + floor("nlfrf.shared"))

    assert max(map(floor, ARROWS)) + 2 <= 10  # and the face, and the command


def test_no_wing_is_called_like_a_public_name():
    import nlfrf
    import robust

    for module in (nlfrf, robust):
        wings = {wing.split(".")[1] for wing in ARROWS if wing.startswith(module.__name__)}
        assert not wings & set(module.__all__)


@EACH
def test_a_plate_hangs_at_every_door(name, tree):
    """A wing's `__init__` says what each room holds, and has no code but where the wing is public."""
    rooms = {other.split(".")[-1] for other in ROOMS if other.startswith(f"{name}.") and other.count(".") == 2}
    if not (name.count(".") == 1 and rooms):
        return
    rows = [line.split(maxsplit=1) for line in ast.get_docstring(tree).splitlines()]
    said = {row[0] for row in rows if len(row) == 2}
    assert rooms <= said, f"{name} does not say what {rooms - said} holds"
    assert name in FACES or len(tree.body) == 1, f"{name}: a plate has no code"


@EACH
def test_rooms_show_their_face(name, tree):
    if (name in FACES and name.split(".")[-1] != "cli") or (name.count(".") == 1 and wing_of(name) != name):
        return
    if len(tree.body) == 1 or name.endswith("cli"):  # a plate, a command
        return
    face = shown(tree)
    assert face is not None, f"{name} has no __all__"
    assert face <= defined(tree), f"{name} shows {face - defined(tree)}, which it does not define"


@EACH
def test_names_are_taken_from_the_room_that_shows_them(name, tree):
    for imported, names, _ in imports(tree):
        if imported in ROOMS and names and imported not in ("nlfrf", "robust"):
            face = shown(ROOMS[imported]) or set()
            assert set(names) <= face, f"{name} takes {set(names) - face} from {imported}, which does not show it"


@EACH
def test_heavy_packages_are_imported_where_they_are_used(name, tree):
    for imported, _, at_import in imports(tree):
        package = imported.split(".")[0]
        if package in HEAVY:
            places = HEAVY[package].split()
            assert name in places or wing_of(name) in places, f"{name} imports {package}"
        assert not (at_import and package in ALWAYS_LATE), f"{name} imports {package} at the top"


@pytest.mark.parametrize(
    ("taken", "unloaded"),
    [
        (
            "nlfrf; [getattr(nlfrf, name) for name in nlfrf.__all__]",
            ["control", "cvxpy", "matplotlib", "numba", "h5py", "typer", "rich", "scipy.signal", "scipy.stats"],
        ),
        ("nlfrf, robust", ["control", "numpy", "cvxpy", "matplotlib", "numba", "h5py", "typer", "rich"]),
    ],
)
def test_import_loads_nothing_heavy(taken, unloaded):
    code = f"import sys, {taken}; print([m for m in {unloaded} if m in sys.modules])"
    assert subprocess.check_output([sys.executable, "-c", code], text=True).strip() == "[]"


def test_robust_is_a_plain_module():
    """Also after every room was entered: a function of the face is never hidden by the room it stands in."""
    code = (
        "import importlib, types, robust\n"
        f"for room in {sorted(name for name in ROOMS if name.startswith('robust') and not name.endswith('cli'))}:\n"
        "    importlib.import_module(room)\n"
        "assert type(robust) is types.ModuleType\n"
        "print([name for name in robust.__all__ if isinstance(getattr(robust, name), types.ModuleType)])\n"
    )
    assert subprocess.check_output([sys.executable, "-c", code], text=True).strip() == "[]"


def test_the_library_never_prints():
    for name, tree in ROOMS.items():
        if not name.endswith(".cli"):
            calls = [n for n in ast.walk(tree) if isinstance(n, ast.Call) and getattr(n.func, "id", "") == "print"]
            assert not calls, f"{name} prints"


def test_forms_are_named_in_one_room():
    """A further form of uncertainty is one row of the table: no other room asks for a form by its name."""
    from robust.uncertain.forms import FORMS

    for name, tree in ROOMS.items():
        if name != "robust.uncertain.forms":
            named = {n.value for n in ast.walk(tree) if isinstance(n, ast.Constant) and n.value in tuple(FORMS)}
            assert not named, f"{name} asks for {named}"
