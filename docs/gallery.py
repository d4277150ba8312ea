"""The examples, each run once: the tests look at what they print, the gallery of the documentation shows it.

`outputs("03_identify_one_record")` gives the folder build/examples/03_... with the pictures the example drew and what
it printed (printed.txt). It is run when nothing is there, or when anything that it was made from has changed since: the
script, the packages, the versions of what they stand on.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
import platform
import re
import runpy
import shutil
import sys
import time
import warnings
from importlib.metadata import version
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = ROOT / "examples"
BUILD = ROOT / "build" / "examples"
STANDS_ON = ("numpy", "scipy", "control", "cvxpy", "clarabel", "matplotlib", "numba", "h5py", "jinja2")


def names() -> list[str]:
    """The examples in order, by the stems of their files."""
    return sorted(path.stem for path in EXAMPLES.glob("[0-9]*.py"))


def title_and_text(name: str) -> tuple[str, str]:
    """First line of an example's docstring, and the rest."""
    docstring = re.match(r'"""(.*?)"""', (EXAMPLES / f"{name}.py").read_text(encoding="utf-8"), re.DOTALL)
    assert docstring is not None, f"{name} has no docstring"
    title, _, text = docstring.group(1).partition("\n")
    return title.strip().rstrip("."), text.strip()


def data_folder() -> Path:
    """Where measured records are looked for."""
    return Path(os.environ.get("NLFRF_DATA", ROOT.parent / "shared" / "data"))


def made_from(name: str) -> str:
    """A digest of everything that the output of an example depends on."""
    digest = hashlib.sha256()
    for path in [EXAMPLES / f"{name}.py", *sorted(ROOT.glob("nlfrf/*.py")), *sorted(ROOT.glob("robust/*.[pj]*"))]:
        digest.update(path.read_bytes())
    installed = [f"{package} {version(package)}" for package in STANDS_ON]
    found = [str(data_folder().is_dir()), str(shutil.which("octave") is not None)]
    digest.update(" ".join([platform.python_version(), *installed, *found]).encode())
    return digest.hexdigest()


def outputs(name: str) -> Path:
    """The folder with what an example drew and printed; runs it where that is not up to date."""
    folder, stamp = BUILD / name, BUILD / f"{name}.stamp"
    BUILD.mkdir(parents=True, exist_ok=True)
    with only_one(BUILD / f"{name}.lock"):
        wanted = made_from(name)
        if not (stamp.is_file() and stamp.read_text() == wanted):
            stamp.unlink(missing_ok=True)
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
            (folder / "printed.txt").write_text(run(name), encoding="utf-8")
            stamp.write_text(wanted)
    return folder


@contextlib.contextmanager
def only_one(lock: Path):
    """Hold a lock file, so that two processes do not run the same example; waits where files can be locked."""
    with lock.open("w") as file:
        with contextlib.suppress(ImportError):
            import fcntl

            fcntl.flock(file, fcntl.LOCK_EX)
        yield


def run(name: str, *arguments: str) -> str:
    """Run an example as a user would, but in this process, warnings as errors; what it printed."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    folder, argv, printed = Path.cwd(), sys.argv, io.StringIO()
    os.chdir(BUILD)
    sys.argv = [f"{name}.py", *(arguments or ("--out", name))]
    try:
        with contextlib.redirect_stdout(printed), warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
            except SystemExit as stop:
                if stop.code:
                    raise RuntimeError(f"{name} ended with {stop.code!r}") from stop
    finally:
        os.chdir(folder)
        sys.argv = argv
        plt.close("all")
    return printed.getvalue()


if __name__ == "__main__":
    for one in names():
        begin = time.perf_counter()
        outputs(one)
        print(f"{one}: {time.perf_counter() - begin:.1f} s")
