"""What a type checker sees of the packages: a user's script is typed from the record to the
verdict, mistakes show.
"""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPT = """
import nlfrf
import robust

ms = nlfrf.multisine(fs=1000.0, n_samples=1000, f_min=2.0, f_max=100.0, rng=1)
record = nlfrf.load_record("run.csv", u="force", y="position")
both = nlfrf.load_record("run.csv", u="force", y=["x", "v"])
bla = nlfrf.identify(record)
fit = robust.fit_nominal(bla, n_poles=2, n_zeros=0)
model = robust.uncertainty(bla, fit)
design = robust.ncfsyn(model)
report = robust.check(model, design.K, certify=True)
print(report.verdict, bla.f, both[0].fs, ms.u)
"""
MISTAKES = [
    "bla.frequency",  # it is f
    "nlfrf.multisine(fs=1000.0, n_sample=1000, f_min=2.0, f_max=100.0)",  # n_samples
    'robust.check(model, design.K, certify="yes")',
    "_ = report.verdict + 1",
    "both.fs",  # a list of records
    "nlfrf.identify('run.csv')",  # a path is not a record
    "robust.uncertainty(bla, 3.0, weight=1.0)",  # weights
]


def by_mypy(folder):
    command = [
        sys.executable,
        "-m",
        "mypy",
        "--config-file",
        str(ROOT / "pyproject.toml"),
        "script.py",
    ]
    environment = {
        "MYPYPATH": str(ROOT),
        "MYPY_CACHE_DIR": str(ROOT / ".mypy_cache"),
        "PATH": "/usr/bin:/bin",
    }
    said = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, timeout=300
    )
    assert not said.stderr, said.stderr
    return {
        int(line.split(":")[1])
        for line in said.stdout.splitlines()
        if re.match(r"script\.py:\d+: error:", line)
    }


def by_basedpyright(folder):
    (folder / "pyrightconfig.json").write_text(
        json.dumps(
            {"include": ["script.py"], "extraPaths": [str(ROOT)], "typeCheckingMode": "basic"}
        )
    )
    command = [
        sys.executable,
        "-m",
        "basedpyright",
        "--outputjson",
        "--pythonpath",
        sys.executable,
        "script.py",
    ]
    said = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300)
    diagnostics = json.loads(said.stdout)["generalDiagnostics"]
    return {one["range"]["start"]["line"] + 1 for one in diagnostics if one["severity"] == "error"}


@pytest.mark.parametrize("errors", [pytest.param(by_mypy, marks=pytest.mark.docs), by_basedpyright])
def test_a_checker_finds_the_mistakes_and_nothing_else(errors, tmp_path):
    lines = SCRIPT.strip().splitlines()
    (tmp_path / "script.py").write_text("\n".join([*lines, *MISTAKES]) + "\n")
    assert errors(tmp_path) == set(range(len(lines) + 1, len(lines) + len(MISTAKES) + 1))


@pytest.mark.parametrize("package", ["nlfrf", "robust"])
def test_the_packages_say_that_they_are_typed(package):
    assert (ROOT / package / "py.typed").exists()
