"""No command writes onto a file that it reads, nor over one that no such command made; each names
what it wrote.
"""

import io
import os
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import control
import numpy as np
import pytest

import nlfrf
import robust
from benchmarks.fuzz_commands import made
from nlfrf import cli as measuring
from robust import cli as controlling

DESIGN = "nlfrf design --fs 512 --period 512 --f-min 2 --f-max 100 --seed 1 -o {}"
#: Every command that writes, with {} for the file; the words before it that are files are what it
#: reads.
COMMANDS = (
    DESIGN,
    "nlfrf simulate ms.npz -o {}",
    "nlfrf identify plain-run.npz --design ms.npz -o {}",
    "nlfrf identify mid.csv -o {}",
    "nlfrf identify multi.npz -o {}",
    "nlfrf inspect mid.csv --picture {}",
    "nlfrf frf bode.csv --relative-std 0.02 -o {}",
    "nlfrf plot bla.npz -o {}",
    "robust servo design belt --period 500 --f-min 8 --f-max 100 --rms 5 -o {}",
    "robust servo play belt played.csv -o {}",
    "robust model bla.npz --poles 2 -o {}",
    "robust model bla.npz --poles 2 -o other.json --picture {}",
    "robust design model.json --bandwidth 5 -o {}",
    "robust check model.json Kc.json -o {}",
    "robust check model.json Kc.json --picture {}",
    "robust prove model.json Kc.json --stiffness 8e4 -o {}",
    "robust prove bla.npz bla.npz bla.npz Kc.json --nominal model.json -o {}",
    "robust orders bla.npz --picture {}",
    "robust servo check rec.npz gains.toml -o {}",
    (
        "robust prove-schedule bla.npz bla.npz --controller Kc.json --at 0,1 --rate 1 --poles 2"
        " --degree 0 -o {}"
    ),
    "robust learn design narrow.json soft.json -o {}",
    "robust learn design narrow.json soft.json -o other.json --picture {}",
    "robust learn step learning.json added.csv errors.csv -o {}",
    "robust export Kc.json -o {}",
    "robust export soft.json -o soft.h --rounded {}",
    "robust reduce model.json Kc.json -o {}",
    "robust report model.json Kc.json --bla bla.npz --record rec.npz -o {}",
    "robust shape model.json --controller Kc.json -o {}",
)


def run(command, capture=None):
    """Exit code and standard error of a command line."""
    program, *words = command.split()
    out, err, before = io.StringIO(), io.StringIO(), sys.argv
    sys.argv = [program, *words]
    try:
        with redirect_stdout(out), redirect_stderr(err):
            {"nlfrf": measuring, "robust": controlling}[program].main()
        code = 0
    except SystemExit as stop:
        code = stop.code or 0
    finally:
        sys.argv = before
    if capture is not None:
        capture.append(out.getvalue() + err.getvalue())
    return code, err.getvalue()


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A folder with a file of every kind, and what they hold."""
    folder = tmp_path_factory.mktemp("files")
    before = Path.cwd()
    os.chdir(folder)
    made()
    record = nlfrf.load_record("rec.npz")
    np.savez("plain-run.npz", u=record.u.ravel(), y=record.y.ravel(), fs=record.fs)
    nlfrf.save(record, "mid.csv")
    assert run("robust model bla.npz --poles 2 --zeros 0 -o m0.json")[0] == 0
    robust.save(control.ss([], [], [], [[10.0]], 1e-3), "soft.json")
    lag = robust.sampled(control.tf([1], [1, 1]), 1e-3)
    small = control.ss([], [], [], [[0.2]], 1e-3)
    omega, radius = np.array([1.0, 2.0]), np.full(2, 0.2)
    narrow = robust.UncertaintyModel(
        lag, small, "multiplicative", omega, radius, perturbation="LTI"
    )
    robust.save(narrow, "narrow.json")
    assert run("robust learn narrow.json soft.json -o learning.json")[0] == 0
    for name in ("added.csv", "errors.csv"):
        np.savetxt(name, np.zeros(2000))
    gains = f'fs = "{record.fs:g} Hz"\nkv = "10 1/s"\nkp = "10 N/(m/s)"\n'
    Path("gains.toml").write_text(gains)
    assert (
        run("robust servo design belt --period 500 --f-min 8 --f-max 100 --rms 5 -o played.csv")[0]
        == 0
    )
    Path("bode.csv").write_text("Frequency (Hz),Gain (dB),Phase (deg)\n10,0,-45\n20,-20,-90\n")
    (folder / "sub").mkdir()
    yield folder
    os.chdir(before)


def held(folder):
    """Every file below a folder with its bytes; what was linked holds the bytes of its target."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def spellings(file, folder):
    """Other names of one file."""
    symbolic, hard = folder / f"symbolic{file.suffix}", folder / f"hard{file.suffix}"
    symbolic.unlink(missing_ok=True)
    hard.unlink(missing_ok=True)
    symbolic.symlink_to(file)
    os.link(file, hard)
    return [
        file.name,
        f"./{file.name}",
        f"sub/../{file.name}",
        str(file),
        symbolic.name,
        hard.name,
        file.name.upper(),  # the same file on two systems of three
    ]


def reads(command):
    """The files that a command line reads."""
    return [word for word in command.split() if Path(word).is_file()]


def commands_of(group):
    """Name and command of each of a group, and of the groups inside it."""
    for name, command in group.commands.items():
        inner = commands_of(command) if hasattr(command, "commands") else [("", command)]
        yield from ((f"{name} {rest}".strip(), one) for rest, one in inner)


def test_every_command_that_writes_is_here():
    from typer.main import get_command

    writing = {
        f"{program} {name} {parameter.name}"
        for program, module in (("nlfrf", measuring), ("robust", controlling))
        for name, command in commands_of(get_command(module.app))
        for parameter in command.params
        if parameter.name in ("out", "picture", "rounded")
    }
    options = {"out": "-o {}", "picture": "--picture {}", "rounded": "--rounded {}"}
    tried = {
        f"{' '.join(command.split()[: 3 if command.split()[1] in ('servo', 'learn') else 2])}"
        f" {name}"
        for command in COMMANDS
        for name, option in options.items()
        if option in command
    }
    assert writing == tried
    paths = {
        parameter.name
        for module in (measuring, controlling)
        for _, command in commands_of(get_command(module.app))
        for parameter in command.params
        if any(word in parameter.name for word in ("out", "picture", "rounded"))
    } - {"output"}
    assert paths == {
        "out",
        "picture",
        "rounded",
    }  # what writes under another name would be taken for an input


@pytest.mark.parametrize(
    "which",  # of the spellings: the name and a symbolic link, or all
    [slice(0, None, 4), pytest.param(slice(None), marks=pytest.mark.attack)],
    ids=["two", "all"],
)
@pytest.mark.parametrize("command", COMMANDS)
def test_no_command_writes_onto_what_it_reads(files, command, which):
    for name in dict.fromkeys(reads(command)):
        for spelling in spellings(files / name, files)[which]:
            before = held(files)
            for overwrite in ("", " --overwrite"):
                code, err = run(command.format(spelling) + overwrite)
                assert (code, held(files) == before) == (2, True), (spelling, overwrite, err)
                assert "must not be one that the command reads" in err


@pytest.mark.parametrize("command", COMMANDS)
def test_no_command_replaces_what_none_of_its_kind_made(files, command):
    foreign = "notes.html"
    Path(foreign).write_text("<p>mine")
    Path("mine.npz").write_bytes(Path("plain-run.npz").read_bytes())
    Path("mine.h5").write_text("damaged")
    before = held(files)
    for name in (foreign, "text.csv", "notes.txt", "list.json", "mine.npz", "mine.h5", "rec.mat"):
        if name in reads(command):
            continue
        code, err = run(command.format(name))
        assert (code, held(files) == before) == (2, True), (name, err)
        assert (
            "must be new or an earlier result of the same kind" in err or "must be a folder" in err
        )


@pytest.mark.parametrize(
    ("command", "foreign"),
    [
        ("nlfrf identify mid.csv -o mid.npz --csv", "mid-bla.csv"),
        ("nlfrf identify plain-run.npz --output y,u -o one.npz", "one-y.npz"),
        ("nlfrf identify multi.npz -o G.npz --csv", "G-bla.csv"),
        (DESIGN.format("exc.csv"), "exc.npz"),
        (DESIGN.format("exc.wav"), "exc.npz"),
        (
            "robust servo design belt --period 500 --f-min 8 --f-max 100 --rms 5 -o move.csv",
            "move.npz",
        ),
        ("robust export Kc.json -o Kc.mat", "load_Kc.m"),
        ("robust check model.json Kc.json K.json -o r.txt", "r-K.txt"),
        ("robust check model.json Kc.json -o r.txt", "r.certificate.json"),
        ("robust check model.json Kc.json K.json --picture r.png", "r-K.png"),
        ("robust prove model.json Kc.json --stiffness 8e4 -o p.txt", "p.certificate.json"),
        ("robust prove model.json Kc.json --stiffness 8e4 -o p.txt", "p.2.certificate.json"),
    ],
)
def test_a_name_that_a_command_makes_up_takes_no_file(files, command, foreign):
    Path(foreign).write_text("mine")
    before = held(files)
    code, err = run(command)
    assert (code, held(files) == before) == (2, True), err
    assert f"got {foreign}, which contains something else" in err
    Path(foreign).unlink()


def test_a_made_up_name_is_no_input_either(files):
    Path("mid-bla.csv").write_bytes(Path("mid.csv").read_bytes())
    Path("r.certificate.json").write_bytes(Path("model.json").read_bytes())
    before = held(files)
    for command in (
        "nlfrf identify mid-bla.csv -o mid.npz --csv --overwrite",
        "robust check r.certificate.json Kc.json -o r.txt --overwrite",
    ):
        code, err = run(command)
        assert (code, held(files) == before) == (2, True), err
    for path in (Path("mid-bla.csv"), Path("r.certificate.json")):
        path.unlink()


def test_two_outputs_take_no_place_of_each_other(files):
    code, err = run("robust check model.json Kc.json -o twice.svg --picture twice.svg")
    assert code == 2
    assert "files to write must have different names, got twice.svg twice" in err


@pytest.mark.usefixtures("undrawn")  # of the report, which is written twice
@pytest.mark.parametrize(
    ("command", "written"),
    [
        *((DESIGN.format(f"e.{kind}"), f"e.{kind}") for kind in ("npz", "h5")),
        *((DESIGN.format(f"e.{kind}"), f"e.{kind} e.npz") for kind in ("csv", "wav", "mat")),
        *((f"nlfrf simulate ms.npz -o s.{kind}", f"s.{kind}") for kind in ("npz", "h5", "mat")),
        *(
            (f"nlfrf identify mid.csv -o b.{kind} --csv", f"b.{kind} b-bla.csv")
            for kind in ("npz", "h5")
        ),
        ("nlfrf identify multi.npz -o F.npz --csv", "F.npz F-bla.csv"),
        ("nlfrf identify multi.npz -o F.csv", "F.csv"),
        ("nlfrf inspect mid.csv --plot i.png", "i.png"),
        *((f"nlfrf plot bla.npz -o p.{kind}", f"p.{kind}") for kind in ("png", "pdf", "svg")),
        ("robust model bla.npz --poles 2 -o m.json --picture m.png", "m.json m.png"),
        ("robust orders bla.npz --most 2 --picture o.pdf", "o.pdf"),
        ("robust design model.json --bandwidth 5 --sample-time 1e-3 -o D.json", "D.json"),
        (
            "robust check model.json Kc.json -o c.txt --picture c.png",
            "c.txt c.certificate.json c.png",
        ),
        ("robust export Kc.json -o Kc.mat", "Kc.mat load_Kc.m"),
        ("robust export model.json -o model.mat", "model.mat load_model.m"),
        ("robust export K.json -o K.csv", "K.csv"),
        ("robust report model.json Kc.json -o r.html", "r.html"),
        ("robust shape model.json -o s.html", "s.html"),
        (
            "robust prove m0.json soft.json --stiffness 1e4 -o proof.txt",
            "proof.txt proof.certificate.json",
        ),
    ],
)
def test_a_script_runs_twice_and_every_file_is_named(files, command, written):
    """What a command made it replaces by the same kind of result, and says so, a line each."""
    for _ in range(2):
        before, said = held(files), []
        code, err = run(command, said)
        assert code in (0, 1), err
        named = [
            line.removeprefix("wrote ")
            for line in said[0].splitlines()
            if line.startswith("wrote ")
        ]
        assert sorted(named) == sorted(written.split())
        changed = {name for name, content in held(files).items() if before.get(name) != content}
        assert changed <= set(named)


def test_overwrite_replaces_what_was_asked_for(files):
    Path("old.npz").write_text("mine")
    assert run("nlfrf identify mid.csv -o old.npz --force")[0] == 0
    assert nlfrf.load("old.npz").experiment.n_periods == 2


def test_a_measurement_is_never_taken_for_a_simulation(files):
    """A record that a user saved is the same kind of file: only `nlfrf simulate` may replace what
    it made itself.
    """
    before = held(files)
    code, err = run("nlfrf simulate ms.npz -o rec.npz")
    assert (code, held(files) == before) == (2, True), err


def test_a_device_is_no_file(files):
    code, err = run("nlfrf identify mid.csv -o /dev/null")
    assert code == 2
    assert "must be a file, got /dev/null" in err


def test_a_symbolic_link_is_written_through(files):
    Path("link.npz").symlink_to("sub/behind.npz")
    assert run("nlfrf identify mid.csv -o link.npz")[0] == 0
    assert Path("link.npz").is_symlink()
    assert nlfrf.load("sub/behind.npz").experiment.n_periods == 2


def test_a_script_replaces_the_path_that_it_names_and_no_other(tmp_path):
    """As NumPy and pandas do; but a file that nobody named stays."""
    ms = nlfrf.multisine(fs=100, n_samples=100, f_min=1, f_max=20, rng=1)
    (tmp_path / "exc.npz").write_text("a measurement")
    (tmp_path / "K.mat").write_text("mine")
    nlfrf.save(ms, tmp_path / "exc.npz")
    assert nlfrf.load(tmp_path / "exc.npz") is not None
    for name in ("mid.npz", "load_K.m"):
        (tmp_path / name).write_text("a measurement")
    K = control.ss(control.tf([1.0], [1.0, 1.0]))
    for write, path in (
        (lambda: nlfrf.save(ms, tmp_path / "mid.csv"), tmp_path / "mid.csv"),
        (lambda: robust.io.export_matlab(K, tmp_path / "K.mat"), None),
    ):
        with pytest.raises(ValueError, match="must be new or an earlier result of the same kind"):
            write()
        assert path is None or not path.exists()
    assert (
        (tmp_path / "mid.npz").read_text() == (tmp_path / "load_K.m").read_text() == "a measurement"
    )
    assert (tmp_path / "K.mat").read_text() == "mine"  # neither of the two, then


def test_nothing_is_half_written(tmp_path, monkeypatch):
    nlfrf.save(
        nlfrf.multisine(fs=100, n_samples=100, f_min=1, f_max=20, rng=1), tmp_path / "ms.npz"
    )
    before = (tmp_path / "ms.npz").read_bytes()

    def broken(stream, **content):
        stream.write(b"half")
        raise OSError("disk full")

    monkeypatch.setattr(np, "savez", broken)
    with pytest.raises(OSError, match="disk full"):
        nlfrf.save(
            nlfrf.multisine(fs=100, n_samples=100, f_min=1, f_max=20, rng=2), tmp_path / "ms.npz"
        )
    assert (tmp_path / "ms.npz").read_bytes() == before
    assert os.listdir(tmp_path) == ["ms.npz"]


def test_the_full_scale_of_a_wav_file_is_in_it_and_read_past(tmp_path):
    from scipy.io import wavfile

    ms = nlfrf.multisine(fs=512, n_samples=512, f_min=2, f_max=100, rms=3.0, rng=1)
    nlfrf.save(ms, tmp_path / "exc.wav")
    rate, samples = wavfile.read(tmp_path / "exc.wav")
    assert rate == 512
    np.testing.assert_allclose(samples * np.abs(ms.u).max(), ms.u[0], rtol=1e-6, atol=1e-6)
    content = (tmp_path / "exc.wav").read_bytes()
    assert f"full scale is {np.abs(ms.u).max():.17g}".encode() in content
    assert int.from_bytes(content[4:8], "little") == len(content) - 8
