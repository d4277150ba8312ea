"""A wheel of ours beside another distribution that has the import name `robust`."""

import os
import subprocess
import sys
import zipfile
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest

from nlfrf import doctor
from tests.nlfrf.test_cli import nlfrf_command  # noqa: F401 (a fixture)

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    run([sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)], cwd=ROOT)
    return next(folder.glob("*.whl"))


@pytest.fixture
def place(wheel, tmp_path):
    """A fresh environment that sees the packages of this one, with our wheel in front."""
    run([sys.executable, "-m", "venv", "--without-pip", str(tmp_path / "env")])
    site = next((tmp_path / "env").glob("lib/python*/site-packages"))
    (site / "outer.pth").write_text(
        "\n".join(path for path in sys.path if path.endswith("site-packages")) + "\n"
    )
    unpack(wheel, site)
    return site


def run(command, **options):
    return subprocess.run(
        command, capture_output=True, text=True, timeout=300, check=True, **options
    ).stdout


def unpack(wheel, site):
    """What an installer does with a pure wheel: its files over those that are there."""
    with zipfile.ZipFile(wheel) as files:
        files.extractall(site)


def other(site):
    """The neighbour: one module in a package of the same name."""
    (site / "robust" / "__init__.py").write_text('"""Somebody else."""\n')
    info = site / "robust-0.5.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: robust\nVersion: 0.5\n")
    (info / "RECORD").write_text("robust/__init__.py,,\nrobust-0.5.dist-info/METADATA,,\n")
    (info / "top_level.txt").write_text("robust\n")


def said(site, code):
    python = site.parents[2] / "bin" / "python"
    result = subprocess.run(
        [str(python), "-c", code],
        cwd=site.parents[2],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    return result.returncode, result.stdout, result.stderr


DOCTOR = "import sys; sys.argv = ['nlfrf', 'doctor']; from nlfrf.cli import main; main()"
ROBUST = (
    "import sys; sys.argv = ['robust', '--version']; from nlfrf.doctor import robust_command;"
    " robust_command()"
)


def test_all_is_well_with_our_wheel(place):
    code, out, err = said(place, DOCTOR)
    assert (code, err) == (0, "")
    assert out.splitlines()[-1] == "all is well"
    assert said(place, ROBUST)[:2] == (0, "nlfrf + robust 0.1.0\n")


def test_a_neighbour_that_overwrote_ours_is_named_with_the_cure(place):
    other(place)
    code, out, _ = said(place, DOCTOR)
    assert code == 1
    assert (
        out.splitlines()[-1]
        == "`import robust` must give our package, got files of the distribution robust 0.5: "
        "pip uninstall robust, then pip install --force-reinstall --no-deps nlfrf"
    )
    code, _, err = said(place, ROBUST)
    assert code == 2
    assert "robust 0.5" in err
    assert len(err.splitlines()) == 1


def test_ours_left_empty_by_its_removal(place):
    (place / "robust" / "__init__.py").unlink()
    code, _, err = said(place, ROBUST)
    assert code == 2
    assert "files removed or changed" in err
    assert "force-reinstall" in err


def test_a_package_of_the_name_that_comes_first_on_the_path(place):
    front = place.parents[2] / "robust"
    front.mkdir()
    (front / "__init__.py").write_text("")
    line = (
        f"{front} hides the package 'robust' from every program run in its folder: rename that"
        " folder"
    )
    code, _, err = said(place, ROBUST)
    assert (code, err) == (2, f"robust: {line}\n")
    code, out, _ = said(place, DOCTOR)
    assert (code, out.splitlines()[-1]) == (1, line)


@pytest.mark.attack(every=5)
@pytest.mark.parametrize(
    ("name", "whose"),
    [
        ("robust", "package 'robust'"),
        ("nlfrf", "package 'nlfrf'"),
        ("control", "package 'control'"),
        ("flint", "package 'flint'"),
        ("random", "module of Python 'random'"),
    ],
)
def test_a_file_of_ones_own_in_the_working_folder_is_seen_by_the_commands(
    name, whose, place, tmp_path
):
    """As installed: the folder is not on the path of a console script, but on that of everything
    run in it.
    """
    folder = tmp_path / "my work"
    folder.mkdir()
    (folder / f"{name}.py").write_text("gain = 3\n")
    python = place.parents[2] / "bin" / "python"
    line = (
        f"{folder / name}.py hides the {whose} from every program run in its folder: rename that"
        " file"
    )
    script = tmp_path / "bin" / "nlfrf"
    script.parent.mkdir()
    script.write_text("from nlfrf.doctor import nlfrf_command; nlfrf_command()\n")
    command = [str(python), str(script), "doctor"]
    run = {"cwd": folder, "capture_output": True, "text": True, "timeout": 300, "check": False}
    done = subprocess.run(command, env={"PATH": ""}, **run)
    assert (done.returncode, done.stdout.splitlines()[-1], done.stderr) == (1, line, "")
    # on the path of the command itself it is one line too, and no traceback
    for which, arguments in (
        ("nlfrf", "doctor"),
        ("robust", "--version"),
        ("robust", "check a.json b.json"),
    ):
        if name == "nlfrf":
            continue  # then nothing of ours is run at all
        script.write_text(
            f"import sys; sys.argv[0] = {which!r}\nfrom nlfrf.doctor import {which}_command as c;"
            " c()\n"
        )
        command = [str(python), str(script), *arguments.split()]
        done = subprocess.run(command, env={"PYTHONPATH": str(folder), "PATH": ""}, **run)
        assert "Traceback" not in done.stderr, (which, done.stderr)
        if (name, which) == ("flint", "robust"):
            continue  # which few commands import, and those say so
        if (name, arguments) == ("control", "--version"):
            assert done.returncode == 0  # a version needs none of it
            continue
        assert line in (done.stdout if arguments == "doctor" and name != "random" else done.stderr)
        assert done.returncode == (1 if line in done.stdout else 2)


def test_what_hides_nothing_is_not_named(tmp_path, monkeypatch):
    (tmp_path / "random").mkdir()  # no package
    for name in ("test.py", "mine.py", "control.txt", "robust.json"):
        (tmp_path / name).write_text("")
    monkeypatch.chdir(tmp_path)
    assert doctor.examine()[1] == []
    front, behind = tmp_path / "front", tmp_path / "behind"
    for folder in (front, behind):
        folder.mkdir()
        (folder / "control.py").write_text("")
    monkeypatch.chdir(front)
    with monkeypatch.context() as path:
        path.syspath_prepend(behind)
        assert [line.split(" hides ")[0] for line in doctor.examine()[1]] == [
            str(front / "control.py")
        ]
    (front / "some-1.0.dist-info").mkdir()  # modules are installed there
    assert doctor.examine()[1] == []


def test_a_version_below_the_floor_is_a_fault(monkeypatch):
    def version(name):
        if name == "numpy":
            return "1.0"
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "version", version)
    faults = doctor.examine()[1]
    assert any(fault.startswith("numpy must be >=2.2") and "got 1.0" in fault for fault in faults)
    assert any(fault.startswith("cvxpy must be installed") for fault in faults)


def test_linear_algebra_that_computes_wrong_is_named(monkeypatch):
    right = np.linalg.eigh
    monkeypatch.setattr(np.linalg, "eigh", lambda H: (right(H)[0] + 1e-3, right(H)[1]))
    (fault,) = doctor.examine()[1]
    assert fault.startswith("NumPy's linear algebra must be right, got wrong factorisations: ")
    monkeypatch.setattr(np.linalg, "eigh", lambda H: (np.nan * right(H)[0], right(H)[1]))
    assert doctor.examine()[1] == [fault]

    def fails(_):
        raise np.linalg.LinAlgError("SVD did not converge")

    monkeypatch.setattr(np.linalg, "svd", fails)
    assert "SVD did not converge" in doctor.examine()[1][0]


def test_a_cache_of_numba_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").write_text("")  # where no folder can be made
    nowhere = {
        "NUMBA_CACHE_LOCATOR_CLASSES": "UserProvidedCacheLocator",
        "NUMBA_CACHE_DIR": str(tmp_path / "file"),
    }
    code = "from nlfrf.doctor import examine; print(*examine()[1])"
    for variables, begin in ((nowhere, "numba must have a folder for its compiled code"), ({}, "")):
        line = run([sys.executable, "-c", code], env=os.environ | variables, cwd=tmp_path).strip()
        assert line.startswith(begin)
        assert line.endswith(": set NUMBA_CACHE_DIR to one" if begin else "")
        assert bool(line) == bool(begin)


def test_readers_that_the_files_of_a_folder_need_are_named(nlfrf_command, tmp_path, monkeypatch):  # noqa: F811
    files = {
        "run.tdms": b"",
        "second.TDMS": b"",
        "old.dat": b"MDF     3.00" + bytes(100),
        "v5.mat": b"MATLAB 5.0 MAT-file" + bytes(200),
        "v73.mat": b"MATLAB 7.3 MAT-file" + bytes(200),
        "notes.md": b"",
        "data.npz": b"",
    }
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    (tmp_path / "folder.uff").mkdir()
    monkeypatch.chdir(tmp_path)
    code, said, _ = nlfrf_command("doctor")
    assert (code, said.splitlines()[-1]) == (0, "all is well")
    have = metadata.version

    def version(name):
        if name in ABSENT:
            raise metadata.PackageNotFoundError(name)
        return have(name)

    monkeypatch.setattr(metadata, "version", version)
    code, said, _ = nlfrf_command("doctor")
    assert code == 1
    assert [line for line in said.splitlines() if " needs " in line] == [
        "old.dat needs asammdf, which is not installed: pip install 'nlfrf[mdf]'",
        "run.tdms needs nptdms, which is not installed: pip install 'nlfrf[tdms]'",
        "v73.mat needs h5py, which is not installed: pip install 'nlfrf[hdf5]'",
    ]


ABSENT = ("nptdms", "npTDMS", "asammdf", "h5py", "pyuff")


@pytest.mark.parametrize("package", ["nlfrf", "robust"])
def test_a_file_of_ones_own_called_lazy_loader_is_named_by_whatever_imports_us(
    tmp_path, package, monkeypatch
):
    (tmp_path / "lazy_loader.py").write_text("gain = 3\n")
    command = [sys.executable, "-c", f"import {package}"]
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False
    )
    last = done.stderr.splitlines()[-1]
    assert (
        last
        == f"ImportError: {tmp_path / 'lazy_loader.py'} hides the package 'lazy_loader': rename"
        " that file"
    )
    monkeypatch.chdir(tmp_path)
    assert doctor.examine()[1][0].startswith(last.removeprefix("ImportError: ").partition(":")[0])


def test_the_wheel_holds_types_schemas_and_no_tests(wheel):
    with zipfile.ZipFile(wheel) as files:
        names = set(files.namelist())
    assert {"nlfrf/py.typed", "robust/py.typed", "robust/__init__.pyi"} <= names
    assert not [name for name in names if name.startswith(("tests/", "benchmarks/", "examples/"))]
    files = [
        path
        for package in ("nlfrf", "robust")
        for path in (ROOT / package).rglob("*")
        if path.is_file()
    ]
    here = {path.relative_to(ROOT).as_posix() for path in files}
    assert {name for name in here if not name.endswith((".pyc", ".nbi", ".nbc"))} <= names
