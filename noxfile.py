"""What is tried before a release: other interpreters, oldest and newest versions, the files that
are uploaded.

    nox -s tests                 the suite on every interpreter found, with pinned, oldest and newest packages
    nox -s package               the wheel and the source distribution, built and looked into
    nox -s installed             the wheel in a clean environment: both commands, a record identified, a loop proved
    nox -s from_sdist            the suite inside the unpacked source distribution
    nox -s from_wheel            the suite against the installed wheel, without our folders beside it

`make release-check` runs all but the first. An interpreter that is not on the machine is skipped,
and said to be.
"""

import re
import shutil
import tarfile
from pathlib import Path

import nox

ROOT = Path(__file__).parent
PYTHONS = ["3.11", "3.12", "3.13", "3.14"]
VERSIONS = {
    "pinned": ["-c", str(ROOT / "constraints.txt")],
    "oldest": ["-c", str(ROOT / "constraints-oldest.txt")],
    "newest": ["-U"],
}
# two processes on two cores: threads of the linear algebra would only wait for one another
QUIET = {"MPLBACKEND": "Agg", "OMP_NUM_THREADS": "1"}

nox.options.sessions = ["package", "installed", "from_sdist", "from_wheel"]
nox.options.error_on_missing_interpreters = False

#: The first script of the README.
SCRIPT = re.search(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)[1]
#: A record in memory, to a model, a controller and a report: what the core does without the
#: packages of the extras.
CORE = re.search(
    r'CORE = """\n(.*?)"""', (ROOT / "tests/project/test_light_install.py").read_text(), re.DOTALL
)[1]
#: Every interpreter with the pins and with the newest; the oldest packages have wheels for the
#: oldest interpreter only.
COMBINATIONS = [(python, versions) for python in PYTHONS for versions in ("pinned", "newest")] + [
    ("3.11", "oldest")
]


@nox.session
@nox.parametrize(("python", "versions"), COMBINATIONS)
def tests(session, versions):
    """The suite, in the checkout."""
    session.install(*VERSIONS[versions], "-e", ".[test,docs]")
    asked = QUIET | {"NLFRF_VERSIONS": versions}
    session.run(
        "python", "-m", "pytest", "-n", "2", "--dist", "worksteal", *session.posargs, env=asked
    )


@nox.session
def package(session):
    """Build both distributions into dist/ and look into them."""
    session.install("-c", "constraints.txt", "build", "twine", "check-wheel-contents")
    shutil.rmtree(ROOT / "dist", ignore_errors=True)
    session.run("python", "-m", "build", "--quiet")
    session.run("twine", "check", "--strict", *map(str, (ROOT / "dist").iterdir()))
    # W002, files held twice: the licence of the plot library stands beside it, and among the
    # licences of the wheel
    session.run(
        "check-wheel-contents", "--toplevel", "nlfrf,robust", "--ignore", "W002", str(built("whl"))
    )


@nox.session
@nox.parametrize(("python", "versions"), COMBINATIONS)
def installed(session, versions):
    """The wheel alone, in a clean environment and outside of the checkout."""
    session.install(*VERSIONS[versions], str(built("whl")))
    session.chdir(session.create_tmp())
    session.run("nlfrf", "--version")
    session.run("robust", "--version")
    session.run("nlfrf", "doctor")
    session.run("python", "-c", CORE, env=QUIET)
    session.install(*VERSIONS[versions], f"{built('whl')}[full]")
    session.run("python", "-c", SCRIPT, env=QUIET)


@nox.session(python="3.11")
def from_sdist(session):
    """The suite in what an unpacked source distribution holds."""
    with tarfile.open(built("tar.gz")) as files:
        files.extractall(session.create_tmp(), filter="data")
    session.chdir(Path(session.create_tmp()) / built("tar.gz").name.removesuffix(".tar.gz"))
    session.install("-c", "constraints.txt", "-e", ".[test,docs]")
    session.run(
        "python", "-m", "pytest", "-n", "2", "--dist", "worksteal", *session.posargs, env=QUIET
    )


@nox.session(python="3.11")
def from_wheel(session):
    """The suite against the installed wheel; tests of the files of the repository are left out."""
    folder = Path(session.create_tmp()) / "outside"
    shutil.rmtree(folder, ignore_errors=True)
    for name in ("tests", "benchmarks", "examples", "docs"):
        shutil.copytree(ROOT / name, folder / name)
    shutil.copy(ROOT / "pyproject.toml", folder)
    session.install("-c", "constraints.txt", f"{built('whl')}[test,docs]")
    session.chdir(folder)
    session.run(
        *(
            "python",
            "-m",
            "pytest",
            "-n",
            "2",
            "--dist",
            "worksteal",
            "tests",
            "--ignore",
            "tests/project",
        ),
        *("--ignore", "tests/nlfrf/test_doctor.py", *session.posargs),
        env=QUIET,
    )


def built(suffix):
    """The one file of this kind in dist/."""
    found = sorted((ROOT / "dist").glob(f"*.{suffix}"))
    if len(found) != 1:
        raise FileNotFoundError(
            f"dist must hold one file .{suffix}, got {len(found)}; run nox -s package first"
        )
    return found[0]
