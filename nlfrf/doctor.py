"""Check the installation: versions, modules hidden by other files, linear algebra, compiled code,
readers of files.

A file of the user with the name of a module hides it from every program run in its folder:
`robust.py` hides our package, `control.py` a required one, `random.py` one of Python. Only the
standard library is imported at the top, so that this module works when any other is hidden.
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

_REINSTALL_HINT = "pip uninstall {other}, then pip install --force-reinstall --no-deps nlfrf"
_DEVELOPER_EXTRAS = {"test", "docs", "release"}  # extras for developers of the packages
_OWN_PACKAGES = ("nlfrf", "robust")
#: Imported packages whose name differs from that of their distribution.
_IMPORT_NAMES = {"python-flint": "flint", "lazy-loader": "lazy_loader"}


def examine(
    extra_of_file: Callable[[Path], str] = lambda path: "",
) -> tuple[list[tuple[str, str, str]], list[str]]:
    """List the installed packages and the faults of the installation.

    Parameters
    ----------
    extra_of_file : callable, optional
        Function that returns the extra needed to read a file; it is called for files of the working
        folder.

    Returns
    -------
    rows : list of (name, version, requirement)
        This package, Python, then its requirements; an absent optional package has version "".
    faults : list of str
        One line each, with the cure; empty without faults.

    Examples
    --------
    >>> rows, faults = examine()
    >>> rows[0][0], rows[1][0]
    ('nlfrf', 'Python')
    >>> [name for name, _, _ in rows if name in ("numpy", "control", "cvxpy")]
    ['control', 'cvxpy', 'numpy']
    """
    here = f"on {platform.platform(terse=True)}"
    rows = [("nlfrf", _installed_version("nlfrf"), ""), ("Python", platform.python_version(), here)]
    faults = []
    for extra, need in sorted(
        _iterate_requirements(), key=lambda one: (one[0], one[1].name.lower())
    ):
        version = _installed_version(need.name)
        requirement = str(need.specifier) + (f", for nlfrf[{extra}]" if extra else "")
        rows.append((need.name, version, requirement))
        if version and not need.specifier.contains(version, prereleases=True):
            faults.append(
                f"{need.name} must be {need.specifier}, got {version}: pip install -U '{need}'"
            )
        elif not version and not extra:
            faults.append(f"{need.name} must be installed, got none of it: pip install '{need}'")
    if not sys.flags.safe_path:
        folders = [Path.cwd(), *map(Path, sys.path)]
    else:
        folders = list(map(Path, sys.path))
    faults += _find_hiding_files(folders)
    if faults and any("'robust'" in fault for fault in faults):
        other = None
    else:
        other = _find_name_conflict()
    faults += [other] if other else []
    if not faults:  # these checks import the packages
        faults = [
            *_find_wrong_algebra(),
            *_find_cache_fault(),
            *_find_missing_readers(Path.cwd(), extra_of_file),
        ]
    return rows, faults


def _find_hiding_files(folders: Iterable[Path]) -> list[str]:
    """Return a line for each file in a folder that hides a module that our packages need, with the
    cure.

    Folders with installed modules, and the folder of our packages, hide nothing. Modules of Python
    count only if they are loaded by now: a `test.py` hides one that is not needed.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, "control.py").write_text("gain = 3")
    ...     [line.replace(folder, "FOLDER") for line in _find_hiding_files([Path(folder)])]
    ["FOLDER/control.py hides the package 'control' from every program run in its folder: rename that file"]
    """
    home = Path(__file__).resolve().parent.parent
    python = {name for name in sys.stdlib_module_names if name in sys.modules}
    packages = {
        *_OWN_PACKAGES,
        *(_IMPORT_NAMES.get(name, name.replace("-", "_")) for name in _required_distributions()),
    }
    searched = list(dict.fromkeys(path.resolve() for path in folders))
    lines = []
    for folder in searched:
        if folder == home or not folder.is_dir() or _is_installation(folder):
            continue
        for name in sorted(
            {entry.name.partition(".")[0] for entry in folder.iterdir()} & (python | packages)
        ):
            spec = PathFinder.find_spec(name, list(map(str, searched)))
            if spec is None or spec.origin is None:  # a folder without an __init__.py hides nothing
                continue
            place = Path(spec.origin)
            if place.name == "__init__.py":
                place = place.parent
            if place.parent == folder:  # and no folder earlier on the path
                whose = "package" if name in packages else "module of Python"
                what = "file" if place.suffix else "folder"
                lines.append(
                    f"{place} hides the {whose} {name!r} from every program run in its folder:"
                    f" rename that {what}"
                )
    return lines


def _required_distributions() -> Iterator[str]:
    """Yield the names of the required distributions; none if the module that reads them is hidden
    itself.
    """
    try:
        yield from (need.name for extra, need in _iterate_requirements() if not extra)
    except Exception:  # a foreign module of the same name may raise anything
        return


def _is_installation(folder: Path) -> bool:
    """Return whether a folder contains installed modules, or those of Python."""
    paths = {
        Path(sysconfig.get_path(name)).resolve()
        for name in ("stdlib", "platstdlib", "purelib", "platlib")
    }
    known = folder in paths or folder.name in ("site-packages", "dist-packages", "lib-dynload")
    return known or any(folder.glob("*.dist-info"))


def _iterate_requirements() -> Iterator[tuple[str, Requirement]]:
    """Yield (extra, requirement) of the installed package, without the tools for developers."""
    from importlib import metadata

    from packaging.requirements import Requirement

    try:
        own = metadata.distribution("nlfrf")
    except metadata.PackageNotFoundError:  # the packages are run from a folder
        return
    extras = ["", *(set(own.metadata.get_all("Provides-Extra") or []) - _DEVELOPER_EXTRAS)]
    always = set()
    for extra in extras:
        for text in own.requires or []:
            need = Requirement(text)
            if text not in always and (
                need.marker is None or need.marker.evaluate({"extra": extra})
            ):
                yield extra, Requirement(text.split(";")[0])
                if not extra:
                    always.add(text)


def _installed_version(name: str) -> str:
    """Return the version of a distribution, "" if it is not installed."""
    from importlib import metadata  # a slow import

    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return ""


def _find_wrong_algebra() -> list[str]:
    """Return a line if the linear algebra of NumPy is wrong, as with a library made for another
    processor.

    Products of small whole numbers are exact in any order of the sums. Factorisations are checked
    by their residual.

    Examples
    --------
    >>> _find_wrong_algebra()
    []
    """
    import numpy as np

    n = 256  # rows of the matrices: enough for blocks and threads
    whole = np.random.default_rng(1).integers(-8, 9, (4, n, n))
    A, B, C, D = whole.astype(float)
    exact = (
        whole[0] @ whole[1] - whole[2] @ whole[3],
        whole[0] @ whole[3] + whole[2] @ whole[1],
    )  # without the library
    H, M = A + A.T, A + 16 * n * np.eye(n)  # a symmetric and a regular matrix
    found = {"products": (A + 1j * C) @ (B + 1j * D) - (exact[0] + 1j * exact[1])}
    try:
        left, sv, right = np.linalg.svd(B)
        eigenvalues, vectors = np.linalg.eigh(H)
        residuals = (
            M @ np.linalg.solve(M, B) - B,
            (left * sv) @ right - B,
            (vectors * eigenvalues) @ vectors.T - H,
        )
        found |= {"factorisations": np.array(residuals) / (n**2 * 64 * np.finfo(float).eps)}
    except np.linalg.LinAlgError as error:
        found |= {f"factorisations ({error})": np.array([np.inf])}
    wrong = [what for what, error in found.items() if not np.abs(error).max() < 1]
    cure = (
        "install NumPy and SciPy anew from one source, or set OPENBLAS_CORETYPE=Haswell to try"
        " another kernel"
    )
    if wrong:
        return [f"NumPy's linear algebra must be right, got wrong {' and '.join(wrong)}: {cure}"]
    return []


def _find_cache_fault() -> list[str]:
    """Return a line if numba has no folder for its compiled code, without which it refuses to
    compile.
    """
    try:
        import_module("nlfrf.rig.kernels.leuven")
    except ModuleNotFoundError:  # numba is an extra
        return []
    except RuntimeError as error:
        return [
            f"numba must have a folder for its compiled code, got '{error}': set NUMBA_CACHE_DIR"
            " to one"
        ]
    return []


def _find_missing_readers(folder: Path, extra_of_file: Callable[[Path], str]) -> list[str]:
    """Return a line for each missing extra that the measurement files in a folder need."""
    extras: dict[str, Path] = {}
    for path in sorted(folder.iterdir()):
        if extra := extra_of_file(path):
            extras.setdefault(extra, path)
    absent = [
        (extra, need.name)
        for extra, need in _iterate_requirements()
        if not _installed_version(need.name)
    ]
    return [
        f"{path.name} needs {name}, which is not installed: pip install 'nlfrf[{extra}]'"
        for extra, path in extras.items()
        for needed_by, name in absent
        if needed_by == extra
    ]


def _find_name_conflict() -> str | None:
    """Return the reason, with the cure, if `import robust` does not give our package; else None.

    Another distribution has the same import name. If it is installed after ours, it overwrites
    files without a warning. If it is removed, it deletes them. With an editable checkout it comes
    first on the path.

    Examples
    --------
    >>> _find_name_conflict() is None
    True
    """
    from importlib import metadata  # a slow import

    home = Path(__file__).resolve().parent.parent / "robust"
    spec = find_spec("robust")
    place = None if spec is None or spec.origin is None else Path(spec.origin).resolve().parent
    if place is not None and place == home and not _is_damaged(home):
        return None
    others = [
        name for name in metadata.packages_distributions().get("robust", []) if name != "nlfrf"
    ]
    if others:
        other = others[0]
    else:
        other = "robust"
    if place is not None and place != home:
        what = f"`import robust` must give the package next to nlfrf, got the one in {place}"
    elif others:
        what = (
            f"`import robust` must give our package, got files of the distribution {other}"
            f" {_installed_version(other)}"
        )
    else:
        what = (
            "`import robust` must give our package, got it with files removed or changed by another"
            " of this name"
        )
    return f"{what}: {_REINSTALL_HINT.format(other=other)}"


def _is_damaged(home: Path) -> bool:
    """Return whether files of our `robust` are missing, or its first one differs from the installed
    one.
    """
    from importlib import metadata  # a slow import

    if not (home / "__init__.py").exists():
        return True
    try:
        files = metadata.files("nlfrf") or []
    except metadata.PackageNotFoundError:
        files = []
    ours = [file for file in files if file.parts[0] == "robust"]  # empty for an editable checkout
    if any(not Path(str(file.locate())).exists() for file in ours):
        return True
    first = next((file for file in ours if file.parts == ("robust", "__init__.py")), None)
    if first is None or first.hash is None:
        return False
    digest = hashlib.new(first.hash.mode, (home / "__init__.py").read_bytes()).digest()
    return base64.urlsafe_b64encode(digest).rstrip(b"=").decode() != first.hash.value


def nlfrf_command() -> None:
    """Run the command `nlfrf`, or print one line that names the file that hides a module it
    needs.
    """
    _run_or_explain("nlfrf")


def robust_command() -> None:
    """Run the command `robust`, or print one line that names the distribution or file in its
    way.
    """
    _exit_with_line("robust", _hiding_files_on_path("robust"))
    _run_or_explain("robust", _find_name_conflict)


def _run_or_explain(name: str, find_fault: Callable[[], str | None] = lambda: None) -> None:
    """Run a command if `find_fault` finds no fault; if it fails and a file hides a module from it,
    name the file.
    """
    try:
        found = find_fault()
        _exit_with_line(name, [found] if found else [])
        import_module(f"{name}.cli").main()
    except Exception:  # a foreign module of the same name may raise anything
        _exit_with_line(name, _hiding_files_on_path())
        raise


def _hiding_files_on_path(*names: str) -> list[str]:
    """Return the lines of `_find_hiding_files` for the folders on the path of Python, for some
    modules or all.
    """
    lines = _find_hiding_files(Path(folder or os.getcwd()) for folder in sys.path)
    return [line for line in lines if not names or any(repr(name) in line for name in names)]


def _exit_with_line(name: str, lines: list[str]) -> None:
    """End a command with the first line on standard error, if there is one."""
    if lines:
        sys.stderr.write(f"{name}: {lines[0]}\n")
        raise SystemExit(2)
