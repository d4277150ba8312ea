"""The command: BLAs and controllers at operating points in, a proof and a certificate out; and the
picture.
"""

import sys

import control
import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy.io import savemat

import nlfrf
import robust
from robust import cli, save
from robust.io import verify_certificate
from robust.models import LpvModel
from tests.support.responses import response

POINTS = (-0.2, 0.0, 0.2)
F = np.linspace(1, 60, 60)


@pytest.fixture
def prove(monkeypatch, capsys, tmp_path):
    """Run the command in a folder with three BLAs and three controllers; gives exit code, output
    and errors.
    """
    monkeypatch.chdir(tmp_path)
    for k, p in enumerate(POINTS):
        G = response(
            control.ss([[0, 1], [-900 * (1 + p), -6]], [[0], [1]], [[1, 0]], 0), 2 * np.pi * F
        )
        noise = np.random.default_rng(k).normal(size=(2, F.size))
        save(
            nlfrf.bla_from_frf(
                F, G * (1 + 0.01 * (noise[0] + 1j * noise[1])), std=0.015 * np.abs(G)
            ),
            f"bla{k}.npz",
        )
        save(control.ss([[0.5]], [[1.0]], [[-150.0]], [[400 * (1 + p)]], 5e-3), f"K{k}.json")

    def run(command):
        monkeypatch.setattr(sys, "argv", ["robust", "prove-schedule", *command.split()])
        with pytest.raises(SystemExit) as stop:
            cli.main()
        said = capsys.readouterr()
        return stop.value.code or 0, said.out, said.err

    return run


FILES = (
    "bla0.npz bla1.npz bla2.npz --controller K0.json --controller K1.json --controller K2.json"
    " --poles 2 --no-limit"
)


def test_files_in_and_a_certificate_out(prove, tmp_path):
    code, out, _ = prove(f"{FILES} --at=-0.2,0,0.2 --rate 0.5 --delay 0.005 -o proof.json")
    assert code == 0
    assert "position from -0.2 to 0.2 m, at most 0.5 m/s, controller of order 1 at 200 Hz" in out
    assert (
        "stability on every trajectory, for every operator within the weight: proved, rigorous"
        in out
    )
    assert verify_certificate(tmp_path / "proof.json").verified


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--at=-0.2,0,0.2 --rate 0", "rate must be positive, got 0"),
        ("--at=-0.2,0,x --rate 1", "--at must be a number"),
        ("--at=0,0.2 --rate 1", "at must have one operating point for each BLA, got 2 for 3"),
        (
            "--at=-0.2,0,0.2 --rate 1 --over level",
            "over must be a position, a load or another state",
        ),
    ],
)
def test_bad_input_is_one_line(prove, options, message):
    code, _, err = prove(f"{FILES} {options}")
    assert code == 2
    assert message in " ".join(err.split())


def test_controllers_with_different_delays_are_refused(prove):
    save(control.ss([[0.5]], [[1.0]], [[-150.0]], [[400.0]], 5e-3), "late.json", delay=5e-3)
    code, _, err = prove(f"{FILES.replace('K1.json', 'late.json')} --at=-0.2,0,0.2 --rate 1")
    assert code == 2
    assert "one computation delay at all operating points, got 0 and 0.005 s" in " ".join(
        err.split()
    )


@pytest.mark.parametrize("suffix", ["json", "mat"])
def test_a_schedule_of_transfer_functions_is_refused_and_a_fixed_one_is_not(prove, suffix):
    for name, gain in (("slow", 1.0), ("fast", 1.2)):
        K = control.tf([400 * gain, -350 * gain], [1, -0.5], 5e-3)
        if suffix == "json":
            save(K, f"{name}.json")
        else:
            savemat(f"{name}.mat", {"num": K.num[0][0], "den": K.den[0][0], "Ts": 5e-3})
    files = "bla0.npz bla1.npz --poles 2 --no-limit --at=0,0.2 --rate 0.1 --degree 1 --delay 0.005"
    code, _, err = prove(f"{files} --controller slow.{suffix} --controller fast.{suffix}")
    assert code == 2
    assert (
        "controller must be matrices whose states mean the same at every operating point, got"
        f" slow.{suffix}, which was saved as a transfer function"
    ) in " ".join(err.split())
    code, out, err = prove(f"{files} --controller slow.{suffix}")
    assert code == 0, err
    assert "controller of order 1 at 200 Hz" in out


def test_the_picture_has_a_line_for_each_point():
    K = LpvModel.from_points(
        [control.ss(-k, 1, 1, 0) for k in (1.0, 2.0, 4.0)], at=[0, 1, 2], unit="kg"
    )
    ax = robust.plot.plot_schedule(K, ax=Figure().subplots())
    named = {
        line.get_label(): line for line in ax.get_lines() if not line.get_label().startswith("_")
    }
    assert list(named) == ["0 kg", "1 kg", "2 kg"]
    for k, line in zip((1.0, 2.0, 4.0), named.values(), strict=True):
        f, size = line.get_data()
        assert np.allclose(size, 1 / np.hypot(2 * np.pi * np.asarray(f), k))
    with pytest.raises(ValueError, match="model must be of type LpvModel"):
        robust.plot.plot_schedule(control.ss(-1, 1, 1, 0))
