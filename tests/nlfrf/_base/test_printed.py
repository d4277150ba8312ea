"""What is printed: names of files, channels and units never command the terminal, whatever way they
take there.
"""

import sys
import warnings

import click
import numpy as np
import pytest

import nlfrf
from nlfrf import cli
from tests.support.hostile_files import COMMANDS, NAMES

HOSTILE = "force\x1b[2J\x1b]0;owned\x07\u202ednab\x9b31m"
HOSTILE_PRINTED = r"force\u001b[2J\u001b]0;owned\u0007\u202ednab\u009b31m"


@pytest.fixture
def command(monkeypatch, capsys, tmp_path):
    """Run the command nlfrf; gives exit code, standard output, standard error."""
    monkeypatch.chdir(tmp_path)

    def run_it(*arguments):
        monkeypatch.setattr(sys, "argv", ["nlfrf", *arguments])
        with pytest.raises(SystemExit) as stop:
            cli.main()
        said = capsys.readouterr()
        return stop.value.code or 0, said.out, said.err

    return run_it


def hostile_record(path, **more):
    u = np.tile(nlfrf.multisine(fs=100, n_samples=100, f_min=1, f_max=30, rng=1).u[0], 3)
    np.savez(path, **{HOSTILE: u, "y\nall is well": 2 * u, "fs": 100.0, **more})


@pytest.fixture
def speaking(command, monkeypatch, tmp_path):
    """Run a command in which the library does anything; gives what `command` gives."""
    nlfrf.save(nlfrf.multisine(fs=100, n_samples=100, f_min=1, f_max=30, rng=1), tmp_path / "m.npz")

    def run_it(speak):
        monkeypatch.setattr(nlfrf, "simulate", lambda *_, **__: speak())
        return command("simulate", "m.npz", "-o", "run.npz")

    return run_it


#: Letters between those that are looked at, and behind the last one.
BETWEEN, END = "\u3042", "\u3044"


def raising(text):
    """A function that raises bad input with a message."""

    def speak():
        raise ValueError(text)

    return speak


def test_every_character_that_commands_is_written_out_and_no_other(speaking):
    def printed(text):
        return speaking(lambda: sys.stdout.write(f"{text}{END}"))[1].partition(END)[0]

    characters = [chr(code) for code in range(0x3000)]
    for character, found in zip(
        characters, printed(BETWEEN.join(characters)).split(BETWEEN), strict=True
    ):
        assert (found == character) == (not COMMANDS.search(character) or character in "\n\t") or (
            ord(character)
            in (0x200B, 0x200C, 0x200D, *range(0x2060, 0x2070))  # of no width: a name within a name
        )
    plain = "Weg [µm] \u65b9\U0001f600\n\t°"
    assert printed(plain) == plain
    assert printed("\udce9\U000e0041") == "\\udce9\\udb40\\udc41"


@pytest.mark.parametrize("name", [HOSTILE, *NAMES])
def test_a_refusal_is_one_line_whatever_it_names(name, speaking):
    code, _, err = speaking(raising(name))
    assert (code, err.count("\n"), err.startswith("nlfrf: ")) == (2, 1, True)
    assert not COMMANDS.search(err.replace("\n", ""))


def test_inspect_identify_plot_and_the_refusal_of_a_name(command, tmp_path):
    hostile_record(tmp_path / "run.npz")
    name = HOSTILE_PRINTED
    steps = [
        ("inspect", "run.npz"),
        ("inspect", "run.npz", "--json"),
        ("identify", "run.npz", "--input", name, "--output", "y all is well", "-o", "bla.npz"),
        ("identify", "run.npz", "--input", HOSTILE, "--output", "y all is well", "-o", "bla.npz"),
        ("identify", "run.npz", "-o", "bla.npz"),
        ("identify", "missing\x1b[2J.npz", "-o", "bla.npz"),
        ("inspect\x1b[2J", "run.npz"),
        ("plot", "bla.npz", "-o", "bla.svg"),
    ]
    for arguments in steps:
        code, out, err = command(*arguments)
        assert not COMMANDS.search(out.replace("\n", "") + err.replace("\n", "")), arguments
        assert "all is well" not in out.splitlines()
        if code == 2 and "inspect\x1b[2J" not in arguments:
            assert len(err.splitlines()) == 1
    record = nlfrf.load_record("run.npz", u=name, y="y all is well")
    assert not COMMANDS.search(str(record) + repr(record) + str(nlfrf.identify(record)))


def test_a_stored_record_and_its_labels(command, tmp_path):
    ms = nlfrf.multisine(fs=100, n_samples=100, f_min=1, f_max=30, rng=1)
    u = np.repeat(ms.u[:, None], 2, axis=1)
    record = nlfrf.Record(
        u=u,
        y=2 * u,
        fs=100,
        lines=ms.lines,
        u_name=HOSTILE,
        y_name="y\nall is well",
        u_unit="\x1b[N",
    )
    nlfrf.save(record, tmp_path / "run.npz")
    for arguments in (
        ("inspect", "run.npz"),
        ("identify", "run.npz", "-o", "bla.npz"),
        ("inspect", "bla.npz"),
    ):
        code, out, err = command(*arguments)
        assert code == 0
        assert not COMMANDS.search(out.replace("\n", "") + err.replace("\n", ""))
        assert "all is well" not in out.splitlines()


def test_whatever_is_printed_passes_one_place(speaking):
    """Warnings of the library and of others, errors, what a command prints or writes, each by its
    own way.
    """

    def speak():
        sys.stdout.write(f"{HOSTILE}\n")
        sys.stderr.write(f"{HOSTILE}\n")
        sys.stdout.writelines([HOSTILE])
        click.echo(HOSTILE)
        warnings.warn(f"{HOSTILE}\nsecond line", nlfrf.DataWarning, stacklevel=1)
        raise ValueError(f"{HOSTILE}\nall is well")

    before = sys.stdout, sys.stderr
    code, out, err = speaking(speak)
    assert code == 2
    assert (sys.stdout, sys.stderr) == before
    assert out.count("force\\u001b[2J") == 2
    assert out.count("\\u202e") == 3  # click leaves out what it knows
    assert err.count("force\\u001b[2J") == 3
    assert not COMMANDS.search((out + err).replace("\n", ""))
    assert err.splitlines()[-1].endswith("31m all is well")
