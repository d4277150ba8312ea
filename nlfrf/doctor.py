"""What is installed here: versions against what is asked for, and whether our names import our packages.

A file of a user's own that is called like a module hides it from every program that is run in its folder: `robust.py`
hides our package, `control.py` one that we need, `random.py` one of Python's own. Only the standard library is imported
at the top, so that this can be said of any of them.
"""

from __future__ import annotations

import base64
import hashlib
import os
import platform
import sys
import sysconfig
from collections.abc import Callable, Iterable, Iterator
from importlib import import_module
from importlib.machinery import PathFinder
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from packaging.requirements import Requirement

__all__ = ["examine", "hidden", "neighbour", "nlfrf_command", "robust_command"]

CURE = "pip uninstall {other}, then pip install --force-reinstall --no-deps nlfrf"
TOOLS = {"test", "docs", "release"}  # extras for those who work on the packages
OURS = ("nlfrf", "robust")
#: What we import by another name than that of its distribution.
IMPORTED = {"python-flint": "flint", "lazy-loader": "lazy_loader"}


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
        requirement = str(need.specifier) + (f", for nlfrf[{extra}]" if extra else "")
        rows.append((need.name, version, requirement))
        if version and not need.specifier.contains(version, prereleases=True):
            faults.append(f"{need.name} must be {need.specifier}, got {version}: pip install -U '{need}'")
        elif not version and not extra:
            faults.append(f"{need.name} must be installed, got none of it: pip install '{need}'")
    folders = [Path.cwd(), *map(Path, sys.path)] if not sys.flags.safe_path else list(map(Path, sys.path))
    faults += hidden(folders)
    other = None if faults and any("'robust'" in fault for fault in faults) else neighbour()
    return rows, faults + ([other] if other else [])


def hidden(folders: Iterable[Path]) -> list[str]:
    """Return a line for each file in a folder that hides a module that our packages need, with the cure.

    Folders in which modules are installed, and that of our packages, hide nothing. Of Python's own modules those are
    looked for that are loaded by now: a `test.py` hides one that nobody needs.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, "control.py").write_text("gain = 3")
    ...     [line.replace(folder, "FOLDER") for line in hidden([Path(folder)])]
    ["FOLDER/control.py hides the package 'control' from whatever is run in its folder: rename that file"]
    """
    home = Path(__file__).resolve().parent.parent
    python = {name for name in sys.stdlib_module_names if name in sys.modules}
    packages = {*OURS, *(IMPORTED.get(name, name.replace("-", "_")) for name in distributions())}
    searched = list(dict.fromkeys(path.resolve() for path in folders))
    lines = []
    for folder in searched:
        if folder == home or not folder.is_dir() or is_installation(folder):
            continue
        for name in sorted({entry.name.partition(".")[0] for entry in folder.iterdir()} & (python | packages)):
            spec = PathFinder.find_spec(name, list(map(str, searched)))
            if spec is None or spec.origin is None:  # a folder without an __init__.py hides nothing
                continue
            place = Path(spec.origin)
            place = place.parent if place.name == "__init__.py" else place
            if place.parent == folder:  # and none that is looked in before
                whose, what = (
                    "package" if name in packages else "module of Python",
                    "file" if place.suffix else "folder",
                )
                lines.append(
                    f"{place} hides the {whose} {name!r} from whatever is run in its folder: rename that {what}"
                )
    return lines


def distributions() -> Iterator[str]:
    """Names of the distributions that our packages cannot do without; none where what would say it is hidden itself."""
    try:
        yield from (need.name for extra, need in needed() if not extra)
    except Exception:  # whatever a stranger's module of the same name lets go wrong
        return


def is_installation(folder: Path) -> bool:
    """Whether modules are installed in a folder, or Python's own stand there."""
    paths = {Path(sysconfig.get_path(name)).resolve() for name in ("stdlib", "platstdlib", "purelib", "platlib")}
    known = folder in paths or folder.name in ("site-packages", "dist-packages", "lib-dynload")
    return known or any(folder.glob("*.dist-info"))


def needed() -> Iterator[tuple[str, Requirement]]:
    """(extra, requirement) of what runs this package here; tools of its developers are left out."""
    from importlib import metadata

    from packaging.requirements import Requirement

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
    from importlib import metadata  # which imports much of Python's own

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
    from importlib import metadata  # which imports much of Python's own

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
    from importlib import metadata  # which imports much of Python's own

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


def nlfrf_command() -> None:
    """The command `nlfrf`: ours, or one line that says which file hides what it needs."""
    run_or_explain("nlfrf")


def robust_command() -> None:
    """The command `robust`: ours, or one line that says who holds its name, or which file hides what it needs."""
    explain("robust", hidden_on_path("robust"))
    run_or_explain("robust", neighbour)


def run_or_explain(name: str, wrong: Callable[[], str | None] = lambda: None) -> None:
    """Run a command where nothing is wrong; where it breaks and a file hides a module from it, say which."""
    try:
        found = wrong()
        explain(name, [found] if found else [])
        import_module(f"{name}.cli").main()
    except Exception:  # whatever a stranger's module of the same name lets go wrong
        explain(name, hidden_on_path())
        raise


def hidden_on_path(*names: str) -> list[str]:
    """Return what `hidden` says of the folders that Python really looks in, of some modules or of all."""
    lines = hidden(Path(folder or os.getcwd()) for folder in sys.path)
    return [line for line in lines if not names or any(repr(name) in line for name in names)]


def explain(name: str, lines: list[str]) -> None:
    """End a command with one line, where there is one to say."""
    if lines:
        sys.stderr.write(f"{name}: {lines[0]}\n")
        raise SystemExit(2)
