"""The floors of the house: a module imports only from strictly lower floors, and heavy packages come late."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

FLOORS = {
    "nlfrf.values": 0,
    "nlfrf.checks": 0,
    "nlfrf.command": 0,
    "nlfrf.lines": 1,
    "nlfrf.curves": 1,
    "nlfrf.hysteresis": 2,
    "nlfrf.multisine": 2,
    "nlfrf.friction": 3,
    "nlfrf.packing": 0,
    "nlfrf.kernels": 1,
    "nlfrf.slip_kernels": 1,
    "nlfrf.ensemble": 4,
    "nlfrf.loop": 6,
    "nlfrf.paper": 6,
    "nlfrf.remarks": 7,
    "nlfrf.level_study": 9,
    "nlfrf.reproduce": 10,
    "nlfrf.excitation": 2,
    "nlfrf.diagnosis": 3,
    "nlfrf.record": 4,
    "nlfrf.rig": 5,
    "nlfrf.neighbours": 2,
    "nlfrf.localfit": 3,
    "nlfrf.channels": 3,
    "nlfrf.calibration": 3,
    "nlfrf.transient": 4,
    "nlfrf.distortion": 4,
    "nlfrf.spectra": 5,
    "nlfrf.frf": 6,
    "nlfrf.simulate": 6,
    "nlfrf.crest": 3,
    "nlfrf.hdf5": 0,
    "nlfrf.level": 7,
    "nlfrf.opinion": 8,
    "nlfrf.noise": 8,
    "nlfrf.bla": 7,
    "nlfrf.identify": 8,
    "nlfrf.files": 1,
    "nlfrf.record_files": 5,
    "nlfrf.io": 8,
    "nlfrf.plot": 9,
    "nlfrf": 11,
    "nlfrf.cli": 12,
    "robust.lti": 17,
    "robust.sampling": 18,
    "robust.norms": 19,
    "robust.rational": 19,
    "robust.programs": 19,
    "robust.perturb": 19,
    "robust.lft": 20,
    "robust.delays": 20,
    "robust.regular": 20,
    "robust.riccati": 21,
    "robust.hinfsyn": 22,
    "robust.structure": 20,
    "robust.mu": 21,
    "robust.mu_lower": 22,
    "robust.mu_certify": 23,
    "robust.interconnection": 23,
    "robust.parameters": 23,
    "robust.structured": 24,
    "robust.mu_gain": 22,
    "robust.dk": 25,
    "robust.radius": 19,
    "robust.loop": 20,
    "robust.overbound": 20,
    "robust.nominal": 20,
    "robust.intervals": 20,
    "robust.enclosure": 21,
    "robust.formulas": 20,
    "robust.weights": 21,
    "robust.orders": 21,
    "robust.certify": 21,
    "robust.uncertainty": 22,
    "robust.validation": 23,
    "robust.report": 22,
    "robust.shaping": 23,
    "robust.assembly": 23,
    "robust.words": 23,
    "robust.margins": 24,
    "robust.proofs": 24,
    "robust.frf_check": 25,
    "robust.worst": 25,
    "robust.check": 26,
    "robust.disk": 26,
    "robust.export": 27,
    "robust.sections": 25,
    "robust.model_files": 26,
    "robust.plot": 28,
    "robust.structures": 21,
    "robust.cones": 21,
    "robust.demands": 26,
    "robust.starts": 27,
    "robust.iteration": 28,
    "robust.frf_design": 29,
    "robust.elements": 19,
    "robust.gap": 23,
    "robust.mixed": 24,
    "robust.shaping_plot": 29,
    "robust.handover_sections": 29,
    "robust.handover": 30,
    "robust": 31,
    "robust.cli": 32,
}

#: Where a heavy package may be imported at all.
HEAVY = {
    "matplotlib": {
        "nlfrf.plot",
        "nlfrf.reproduce",
        "nlfrf.cli",
        "robust.plot",
        "robust.shaping_plot",
        "robust.handover_sections",
        "robust.cli",
    },
    "numba": {"nlfrf.kernels", "nlfrf.slip_kernels"},
    "h5py": {"nlfrf.hdf5", "nlfrf.files"},
}


def found_modules():
    for package in ("nlfrf", "robust"):
        for path in sorted((ROOT / package).glob("*.py")):
            name = package if path.stem == "__init__" else f"{package}.{path.stem}"
            yield name, ast.parse(path.read_text())


MODULES = list(found_modules())


def imports(tree):
    """Every module imported anywhere in a file, inside functions too, and whether the import runs on import."""
    late = {node for function in ast.walk(tree) if isinstance(function, ast.FunctionDef) for node in ast.walk(function)}
    typing_only = {
        node
        for block in ast.walk(tree)
        if isinstance(block, ast.If) and "TYPE_CHECKING" in ast.dump(block.test)
        for node in ast.walk(block)
    }
    for node in ast.walk(tree):
        if node in typing_only:
            continue
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, node not in late
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            inner = [f"{node.module}.{alias.name}" for alias in node.names]
            for name in inner if set(inner) <= set(FLOORS) else [node.module]:
                yield name, node not in late


def test_every_module_has_a_floor():
    assert {name for name, _ in MODULES} == set(FLOORS)


@pytest.mark.parametrize(("name", "tree"), MODULES, ids=[name for name, _ in MODULES])
def test_imports_run_downstairs(name, tree):
    for imported, _ in imports(tree):
        if imported in FLOORS and imported not in ("nlfrf", "robust"):
            assert FLOORS[imported] < FLOORS[name], f"{name} imports {imported} from floor {FLOORS[imported]}"
        elif imported in ("nlfrf", "robust") and not (imported == "nlfrf" and name.startswith("robust")):
            assert name.endswith(".cli"), f"{name} imports its own package"
        if name.startswith("nlfrf"):
            assert imported.split(".")[0] not in ("robust", "control", "cvxpy"), f"{name} imports {imported}"


@pytest.mark.parametrize(("name", "tree"), MODULES, ids=[name for name, _ in MODULES])
def test_heavy_packages_are_imported_where_they_are_used(name, tree):
    for imported, at_import in imports(tree):
        package = imported.split(".")[0]
        if package in HEAVY:
            assert name in HEAVY[package], f"{name} imports {package}"
        if package in ("matplotlib", "cvxpy", "h5py", "jinja2"):
            assert not at_import, f"{name} imports {package} at the top"


@pytest.mark.parametrize(
    ("package", "unloaded"),
    [
        ("nlfrf", ["control", "cvxpy", "matplotlib", "numba", "h5py", "typer", "rich", "scipy.signal", "scipy.stats"]),
        ("robust", ["cvxpy", "matplotlib", "numba", "h5py", "typer", "rich"]),
    ],
)
def test_import_loads_nothing_heavy(package, unloaded):
    code = f"import sys, {package}; print([m for m in {unloaded} if m in sys.modules])"
    assert subprocess.check_output([sys.executable, "-c", code], text=True).strip() == "[]"


def test_the_library_never_prints():
    for name, tree in MODULES:
        if not name.endswith(".cli"):
            calls = [n for n in ast.walk(tree) if isinstance(n, ast.Call) and getattr(n.func, "id", "") == "print"]
            assert not calls, f"{name} prints"
