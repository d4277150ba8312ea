"""What the project's own files install: a set of pins that every Python from the declared floor on
is served with.
"""

import os
import re
import subprocess
import sys
import tomllib
import zipfile
from importlib import metadata
from pathlib import Path

from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

from tests.support.rules import each

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
PINS = [Requirement(line) for line in (ROOT / "constraints.txt").read_text().splitlines() if line]
OLDEST = [
    Requirement(line)
    for line in (ROOT / "constraints-oldest.txt").read_text().splitlines()
    if line[:1] not in "#"
]
VERSIONS = os.environ.get("NLFRF_VERSIONS", "pinned")  # of nox
FLOOR = re.fullmatch(r">=(\d+\.\d+)", PROJECT["requires-python"])


@each(lambda: ((pin,) for pin in PINS))
def test_every_pin_serves_the_oldest_python(pin):
    """Requires-Python of what is installed, which is the pin itself, holds the first patch release
    of the floor.
    """
    oldest = f"{FLOOR[1]}.0"
    if pin.marker is not None and not pin.marker.evaluate(
        {"python_full_version": oldest, "python_version": FLOOR[1]}
    ):
        return  # a pin that the floor is not given
    try:
        installed = metadata.distribution(pin.name)
    except metadata.PackageNotFoundError:
        return  # not on this machine
    if VERSIONS != "pinned":
        return  # other versions are asked for
    assert pin.specifier.contains(installed.version), (
        f"{pin} is pinned, {installed.version} is installed"
    )
    wanted = installed.metadata.get("Requires-Python")
    assert wanted is None or SpecifierSet(wanted).contains(oldest), (
        f"{pin} needs Python {wanted}, not {oldest}"
    )


def test_what_is_installed_is_pinned():
    """Whatever the extras bring in through others is pinned too, or a later release changes a fresh
    clone.
    """
    pinned = {canonical(pin.name) for pin in PINS + (OLDEST if VERSIONS == "oldest" else [])}
    wanted, seen = ["nlfrf[test,docs]"], set()
    while wanted:
        asked = Requirement(wanted.pop())
        name = canonical(asked.name)
        extras = asked.extras or {""}
        for needed in metadata.requires(name) or []:
            need = Requirement(needed)
            if need.marker is None or any(
                need.marker.evaluate({"extra": extra}) for extra in extras
            ):
                key = (canonical(need.name), frozenset(need.extras))
                if key not in seen:
                    seen.add(key)
                    wanted.append(f"{need.name}[{','.join(need.extras)}]")
    assert {name for name, _ in seen} - {"nlfrf"} <= pinned


def canonical(name):
    return re.sub(r"[-_.]+", "-", name).lower()


def test_the_floors_are_the_oldest_versions_that_were_tried():
    """A floor in pyproject.toml is what constraints-oldest.txt installs, to the last digit that it
    names.
    """
    tried = {canonical(pin.name): next(iter(pin.specifier)).version for pin in OLDEST}
    for needed in map(Requirement, PROJECT["dependencies"]):
        (floor,) = needed.specifier
        version = tried[canonical(needed.name)]
        assert floor.operator == ">="
        assert needed.specifier.contains(version)
        assert re.fullmatch(rf"{re.escape(floor.version)}(\.0)*", version), (
            f"{needed} was tried with {version}"
        )


def test_the_conda_recipe_asks_for_the_same():
    recipe = (ROOT / "conda" / "recipe.yaml").read_text()
    asked = re.search(r"  run:\n((?:    - .*\n)+)", recipe)[1]
    theirs = {"matplotlib-base": "matplotlib", "lazy_loader": "lazy-loader"}
    found = {
        theirs.get(name, name): f">={floor}"
        for name, floor in re.findall(r"- (\S+) >=(\S+)", asked)
    }
    extras = PROJECT["optional-dependencies"]
    full = [
        *PROJECT["dependencies"],
        *extras["csv"],
        *extras["hdf5"],
        *extras["rig"],
    ]  # a recipe has no extras
    own = {one.name: str(one.specifier) for one in map(Requirement, full)}
    assert found == own | {"python": PROJECT["requires-python"]}
    for name, entry in PROJECT["scripts"].items():
        assert f"- {name} = {entry}\n" in recipe
    assert f'version: "{metadata.version("nlfrf")}"' in recipe


def test_a_wheel_holds_what_pages_are_made_of(tmp_path):
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    with zipfile.ZipFile(next(tmp_path.glob("*.whl"))) as wheel:
        held = set(wheel.namelist())
    static = [
        path
        for path in ROOT.glob("robust/**/*")
        if path.suffix in (".js", ".css", ".jinja", ".json", ".pyi")
    ]
    static += ROOT.glob("nlfrf/**/*.pyi")
    assert len(static) > 7
    assert {path.relative_to(ROOT).as_posix() for path in static} <= held
    assert "robust/reports/shaping_page/uplot/LICENSE" in held
