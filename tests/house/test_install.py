"""What the project's own files install: a set of pins that every Python from the declared floor on is served with."""

import re
import tomllib
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

ROOT = Path(__file__).parents[2]
PINS = [Requirement(line) for line in (ROOT / "constraints.txt").read_text().splitlines() if line]
FLOOR = re.fullmatch(
    r">=(\d+\.\d+)", tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["requires-python"]
)


@pytest.mark.parametrize("pin", PINS, ids=[pin.name for pin in PINS])
def test_every_pin_serves_the_oldest_python(pin):
    """Requires-Python of what is installed, which is the pin itself, holds the first patch release of the floor."""
    oldest = f"{FLOOR[1]}.0"
    if pin.marker is not None and not pin.marker.evaluate({"python_full_version": oldest, "python_version": FLOOR[1]}):
        return  # a pin that the floor is not given
    try:
        installed = metadata.distribution(pin.name)
    except metadata.PackageNotFoundError:
        pytest.skip(f"{pin.name} is not installed on this machine")
    assert pin.specifier.contains(installed.version), f"{pin} is pinned, {installed.version} is installed"
    wanted = installed.metadata["Requires-Python"]
    assert wanted is None or SpecifierSet(wanted).contains(oldest), f"{pin} needs Python {wanted}, not {oldest}"


def test_what_is_installed_is_pinned():
    """Whatever the extras bring in through others is pinned too, or a later release changes a fresh clone."""
    pinned = {canonical(pin.name) for pin in PINS}
    wanted, seen = ["nlfrf[test,docs]"], set()
    while wanted:
        asked = Requirement(wanted.pop())
        name = canonical(asked.name)
        extras = asked.extras or {""}
        for needed in metadata.requires(name) or []:
            need = Requirement(needed)
            if need.marker is None or any(need.marker.evaluate({"extra": extra}) for extra in extras):
                key = (canonical(need.name), frozenset(need.extras))
                if key not in seen:
                    seen.add(key)
                    wanted.append(f"{need.name}[{','.join(need.extras)}]")
    assert {name for name, _ in seen} - {"nlfrf"} <= pinned


def canonical(name):
    return re.sub(r"[-_.]+", "-", name).lower()
