"""What is installed here: versions against what is asked for, and whether `import robust` gives our package."""

from __future__ import annotations

import base64
import hashlib
import platform
import sys
from collections.abc import Iterator
from importlib import import_module, metadata
from importlib.util import find_spec
from pathlib import Path

from packaging.requirements import Requirement

__all__ = ["examine", "neighbour", "robust_command"]

CURE = "pip uninstall {other}, then pip install --force-reinstall --no-deps nlfrf"
TOOLS = {"test", "docs", "release"}  # extras for those who work on the packages


def examine() -> tuple[list[tuple[str, str, str]], list[str]]:
    """What is installed, and what is wrong with it.

    Returns
    -------
    rows : list of (name, version, what is asked for)
        This package, Python, then what the package needs; an optional package that is absent has version "".
    faults : list of str
        One line each, with the cure; none where all is well.

    Examples
    --------
    >>> rows, faults = examine()
    >>> rows[0][0], rows[1][0]
    ('nlfrf', 'Python')
    >>> [name for name, _, _ in rows if name in ("numpy", "control", "cvxpy")]
    ['control', 'cvxpy', 'numpy']
    """
    here = f"on {platform.platform(terse=True)}"
    rows = [("nlfrf", installed("nlfrf"), ""), ("Python", platform.python_version(), here)]
    faults = []
    for extra, need in sorted(needed(), key=lambda one: (one[0], one[1].name.lower())):
        version = installed(need.name)
        asked = str(need.specifier) + (f", for nlfrf[{extra}]" if extra else "")
        rows.append((need.name, version, asked))
        if version and not need.specifier.contains(version, prereleases=True):
            faults.append(f"{need.name} must be {need.specifier}, got {version}: pip install -U '{need}'")
        elif not version and not extra:
            faults.append(f"{need.name} must be installed, got none of it: pip install '{need}'")
    other = neighbour()
    return rows, faults + ([other] if other else [])


def needed() -> Iterator[tuple[str, Requirement]]:
    """(extra, requirement) of what runs this package here; tools of its developers are left out."""
    try:
        own = metadata.distribution("nlfrf")
    except metadata.PackageNotFoundError:  # run from a folder of files
        return
    extras = ["", *(set(own.metadata.get_all("Provides-Extra") or []) - TOOLS)]
    always = set()
    for extra in extras:
        for text in own.requires or []:
            need = Requirement(text)
            if text not in always and (need.marker is None or need.marker.evaluate({"extra": extra})):
                yield extra, Requirement(text.split(";")[0])
                if not extra:
                    always.add(text)


def installed(name: str) -> str:
    """The version of a distribution, "" where there is none."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return ""


def neighbour() -> str | None:
    """Why `import robust` does not give our package, with the cure; None where it does.

    Another distribution has the same import name. Installed after ours it overwrites files without a word; removed,
    it takes them along; beside an editable checkout it comes first on the path.

    Examples
    --------
    >>> neighbour() is None
    True
    """
    home = Path(__file__).resolve().parent.parent / "robust"
    spec = find_spec("robust")
    place = None if spec is None or spec.origin is None else Path(spec.origin).resolve().parent
    if place is not None and place == home and not damaged(home):
        return None
    others = [name for name in metadata.packages_distributions().get("robust", []) if name != "nlfrf"]
    other = others[0] if others else "robust"
    if place is not None and place != home:
        what = f"`import robust` must give the package beside nlfrf, got the one in {place}"
    elif others:
        what = f"`import robust` must give our package, got files of the distribution {other} {installed(other)}"
    else:
        what = "`import robust` must give our package, got it with files gone or changed by another of the same name"
    return f"{what}: {CURE.format(other=other)}"


def damaged(home: Path) -> bool:
    """Whether files of our `robust` are gone, or its first one is not what was installed."""
    if not (home / "__init__.py").exists():
        return True
    try:
        files = metadata.files("nlfrf") or []
    except metadata.PackageNotFoundError:
        files = []
    ours = [file for file in files if file.parts[0] == "robust"]  # none of an editable checkout
    if any(not Path(str(file.locate())).exists() for file in ours):
        return True
    first = next((file for file in ours if file.parts == ("robust", "__init__.py")), None)
    if first is None or first.hash is None:
        return False
    digest = hashlib.new(first.hash.mode, (home / "__init__.py").read_bytes()).digest()
    return base64.urlsafe_b64encode(digest).rstrip(b"=").decode() != first.hash.value


def robust_command() -> None:
    """The command `robust`: ours, or one line that says who holds its name."""
    other = neighbour()
    if other:
        sys.stderr.write(f"robust: {other}\n")
        raise SystemExit(2)
    import_module("robust.cli").main()
