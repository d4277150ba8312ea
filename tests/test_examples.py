"""Every example runs, from a clean folder, and leaves what it says it leaves."""

import subprocess
import sys
from pathlib import Path

import pytest

from robust import load_controller, load_model

EXAMPLES = Path(__file__).parents[1] / "examples"
WRITTEN = ("bla.npz", "bla.png", "check.png", "controller.json", "model.json", "model.png", "record.npz", "report.txt")


def run(example, *arguments, cwd):
    command = [sys.executable, "-W", "error", str(EXAMPLES / example), *map(str, arguments)]
    done = subprocess.run(
        command, cwd=cwd, env={"MPLBACKEND": "Agg", "PATH": ""}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_examples_are_short():
    for path in EXAMPLES.glob("*.py"):
        assert len(path.read_text().splitlines()) <= 80, path.name


def test_identify_then_design_on_the_rig(tmp_path):
    out = run("01_identify_then_design.py", "--out", "demo", cwd=tmp_path)
    assert "STATISTICALLY ROBUST (holds for the whole set at its confidence; no stability proof" in out
    for name in WRITTEN:
        assert (tmp_path / "demo" / name).stat().st_size > 0
    assert load_model(tmp_path / "demo" / "model.json").perturbation == "statistical"
    assert load_controller(tmp_path / "demo" / "controller.json").dt == 1e-3


@pytest.mark.data
def test_identify_then_design_on_the_motor_bench(tmp_path, measured):
    file = measured / "motor_bench" / "MultisineTypeB.mat"
    names = "--input iq_adx --output theta_mx --fs 2500 --period 2500 --poles 4 --bandwidth 20 --sample-time 4e-4"
    command = [sys.executable, str(EXAMPLES / "01_identify_then_design.py"), str(file), *names.split()]
    done = subprocess.run(
        command, cwd=tmp_path, env={"MPLBACKEND": "Agg", "PATH": ""}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "DataWarning: the odd detection lines of an odd-odd grid" in done.stderr
    assert "verdict:  " in done.stdout
