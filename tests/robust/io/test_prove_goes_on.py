"""Each refusal of `robust prove` ends with commands, and these commands go on."""

import re
import shlex
import shutil
import sys
from pathlib import Path

import control
import numpy as np
import pytest

import robust
from robust import cli, save
from tests.support.bla import make_bla

F = np.arange(1, 240) * 0.5


def two_masses(spring):
    """1 kg on a friction spring [N/m] and 8e4 N/m to ground, with 0.5 kg on a belt: a flexible
    machine.
    """

    def G(s):
        carriage = 0.5 * s**2 + 20 * s + 3e5
        belt = 3e5 * (0.5 * s**2) / carriage
        return 1 / (s**2 + 40 * s + 8e4 + spring + belt)

    return G


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """BLAs at three levels, a model as `robust model` makes it, and controllers."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("made"))
        write_files(patch)
        return Path.cwd()


def command(patch, line):
    """Run a command line, and return its exit code."""
    patch.setattr(sys, "argv", shlex.split(line))
    with pytest.raises(SystemExit) as stop:
        cli.main()
    return stop.value.code or 0


def write_files(patch):
    for name, spring in (("low", 5.1e4), ("mid", 5e4), ("high", 0.0)):
        G = two_masses(spring)
        size = np.abs(G(2j * np.pi * F))
        save(
            make_bla(G, F, f0=0.5, sigma_noise=1e-3 * size, sigma_distortion=1e-3 * size, rng=1),
            f"{name}.npz",
        )
    for name, spring in (
        ("a", 5.1e4),
        ("b", 5e4),
        ("c", 0.0),
    ):  # above their resonance: no mass on a spring is seen
        G, f = two_masses(spring), F[F > 75]
        size = np.abs(G(2j * np.pi * f))
        save(
            make_bla(G, f, f0=0.5, sigma_noise=1e-3 * size, sigma_distortion=1e-3 * size, rng=1),
            f"{name}.npz",
        )
    robust.save(control.ss([], [], [], [[1e3]], 1e-3), "K.json")


#: Options of `robust model` by the file that it makes.
MODELS = {
    "default.json": "",
    "three.json": "--zeros 3",
    "sampled.json": "--zeros 2 --sample-time 0.002",
    "good.json": "--zeros 2",
}


@pytest.fixture
def prove(folder, monkeypatch, capsys, tmp_path):
    """Run the command in a copy of the folder, with the models that it names."""

    def made(name):
        if not (folder / name).exists():
            monkeypatch.chdir(folder)
            line = f"robust model high.npz --poles 4 -o {name} {MODELS[name]}"
            assert command(monkeypatch, line) == 0
            capsys.readouterr()
        shutil.copy(folder / name, tmp_path / name)

    shutil.copytree(folder, tmp_path, ignore=lambda *_: MODELS, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)

    def run(line):
        for name in MODELS.keys() & set(line.split()):
            if not (tmp_path / name).exists():
                made(name)
        monkeypatch.chdir(tmp_path)
        code, said = command(monkeypatch, line), capsys.readouterr()
        return code, said.out, said.err

    return run


def commands_in(refusal):
    """The command lines of a refusal, with what the user has to know put in."""
    known = {"NEWTON_PER_METRE": "5e4", "BLA.npz": "high.npz", "HERTZ": "5", "SECONDS": "0.001"}
    found = re.findall(r"robust (?:prove|model|design) [^;,]*", refusal.strip())
    for name, number in known.items():
        found = [line.replace(name, number) for line in found]
    return [
        line.replace("LOW", "low").replace("MID", "mid").replace("HIGH", "high") for line in found
    ]


@pytest.mark.attack(every=3)
@pytest.mark.parametrize(
    ("asked", "word"),
    [
        ("default.json K.json", "--nominal default.json"),
        ("three.json K.json --stiffness 5e4", "at least two poles more than zeros"),
        ("sampled.json K.json --stiffness 5e4", "must be a continuous model"),
        ("low.npz K.json", "got 1 BLA"),
        ("low.npz mid.npz K.json", "got 2 BLAs"),
        ("a.npz b.npz c.npz K.json", "--nominal nominal.json"),
        (
            "low.npz mid.npz high.npz K.json --nominal default.json",
            "must span from sticking to sliding",
        ),
        ("low.npz mid.npz high.npz default.json K.json", "got both"),
        ("default.json sampled.json K.json", "must be one model, got 2"),
        ("good.json default.json --stiffness 5e4", "default.json, which is a model"),
    ],
)
def test_whoever_follows_the_refusals_gets_a_verdict(prove, asked, word):
    line = f"robust prove {asked}"
    code, _, err = prove(line)
    assert code == 2
    assert word in err
    for _ in range(4):
        commands = commands_in(err)
        assert commands, err
        assert "n_poles" not in err
        last = next(
            k
            for k, one in enumerate(commands)
            if one.startswith("robust prove") or k == len(commands) - 1
        )
        for one in commands[: last + 1]:
            code, out, err = prove(one)
        if code != 2:
            break
    assert code in (0, 1), err
    assert (
        out.startswith(("modal damping", "Assumed"))
        or "proved" in out
        or "wrote controller.json" in out
    )
