"""Every command against every kind of file that the commands write: a file in the wrong place is
named, and goes on.
"""

import re
import sys

import control
import numpy as np
import pytest

import nlfrf
import nlfrf.cli
import robust
import robust.cli

FILES = {
    "ms.npz": ("a multisine", "nlfrf simulate ms.npz"),
    "record.npz": ("a record", "nlfrf identify record.npz"),
    "record.mat": ("a record", "nlfrf identify record.mat"),
    "bla.npz": ("a BLA", "robust model bla.npz"),
    "bla.h5": ("a BLA", "robust model bla.h5"),
    "model.json": ("a model", "robust design model.json"),
    "K.json": ("a controller", "robust check MODEL K.json"),
    "proof.json": ("a certificate", "robust verify proof.json"),
    "report.txt": ("a text of 'robust check', for people to read", "robust check --help"),
}
MEASURED = ("record.npz", "record.mat")
BLAS = ("bla.npz", "bla.h5")
#: Command, and the files that it takes in the place of {}.
COMMANDS = [
    ("robust model {} --poles 2 -o out.json", BLAS),
    ("robust orders {}", BLAS),
    ("robust design {} --bandwidth 1 -o out.json", ("model.json",)),
    ("robust design {} --method pid -o out.json", (*BLAS, "model.json")),
    ("robust check {} K.json", ("model.json",)),
    ("robust check model.json {}", ("K.json",)),
    ("robust verify {}", ("proof.json",)),
    ("robust verify proof.json --model {}", ("model.json",)),
    ("robust verify proof.json --controller {}", ("K.json",)),
    ("robust prove {} K.json", (*MEASURED, *BLAS, "model.json")),
    ("robust prove model.json {} --stiffness 1e5", ("K.json",)),
    ("robust export {} -o out.mat", ("model.json", "K.json")),
    ("robust export {} -o out.csv", ("K.json",)),
    ("robust report {} K.json -o out.html", ("model.json",)),
    ("robust report model.json {} -o out.html", ("K.json",)),
    ("robust report model.json K.json --bla {} -o out.html", BLAS),
    ("robust report model.json K.json --record {} -o out.html", MEASURED),
    ("robust shape {} -o out.html", ("model.json",)),
    ("robust shape model.json --controller {} -o out.html", ("K.json",)),
    ("nlfrf simulate {} -o out.npz", ("ms.npz",)),
    ("nlfrf inspect {}", ("ms.npz", *MEASURED, *BLAS)),
    ("nlfrf identify {} -o out.npz", MEASURED),
    ("nlfrf identify record.npz --design {} -o out.npz", ("ms.npz",)),
    ("nlfrf plot {} -o out.png", ("ms.npz", *MEASURED, *BLAS)),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """One file of each kind."""
    folder = tmp_path_factory.mktemp("files")
    ms = nlfrf.multisine(fs=128, n_samples=128, f_min=1, f_max=40, rng=1)
    record = nlfrf.Record(
        u=ms.u[None], y=2 * ms.u[None] + 0.1 * ms.u[None] ** 3, fs=128, lines=ms.lines
    )
    nlfrf.save(ms, folder / "ms.npz")
    for name in MEASURED:
        nlfrf.save(record, folder / name)
    for name in BLAS:
        nlfrf.save(nlfrf.identify(record), folder / name)
    G, w = control.tf([1], [1, 1]), control.tf([0.2], [1])
    model = robust.UncertaintyModel(
        G, w, "multiplicative", np.array([1.0, 2.0]), np.array([0.1, 0.2])
    )
    robust.save(model, folder / "model.json")
    robust.save(2.0, folder / "K.json")
    report = robust.check(model, 2.0)
    robust.save(report, folder / "proof.json")
    (folder / "report.txt").write_text(f"{report}\n\n(written by 'robust check')\n")
    return folder


@pytest.mark.parametrize(("command", "takes"), COMMANDS)
def test_a_file_in_the_wrong_place_is_named_with_the_command_that_takes_it(
    folder, command, takes, monkeypatch, capsys
):
    monkeypatch.chdir(folder)
    for file in FILES.keys() - set(takes):
        program, *given = command.format(file).split()
        monkeypatch.setattr(sys, "argv", [program, *given])
        with pytest.raises(SystemExit) as stop:
            {"robust": robust.cli, "nlfrf": nlfrf.cli}[program].main()
        err = capsys.readouterr().err.strip()
        assert (stop.value.code, err.count("\n")) == (2, 0), err
        name, goes_on = FILES[file]
        assert re.search(
            rf"path must hold an? .*, got {file}, which is {name}; go on with: {goes_on}", err
        ), err


def test_a_table_of_someone_else_is_to_be_looked_at(tmp_path):
    (tmp_path / "run.csv").write_text("t,u,y\n0,1,2\n1,2,3\n2,3,4\n")
    with pytest.raises(
        ValueError,
        match=(
            r"path must hold a multisine, .* a model, .*, got .*run.csv, which is of a kind .*"
            r" nlfrf inspect"
        ),
    ):
        robust.load(tmp_path / "run.csv")
