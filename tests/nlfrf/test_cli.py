"""The command nlfrf: the whole way by files, and errors as one line and exit code 2."""

import subprocess
import sys

import numpy as np
import pytest
from scipy.io import savemat

from nlfrf import Record, __version__, cli, load, multisine, save


@pytest.fixture
def nlfrf_command(monkeypatch, capsys, tmp_path):
    """Run the command in an empty folder; gives exit code, standard output, standard error."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["nlfrf", *map(str, arguments)])
        with pytest.raises(SystemExit) as stop:
            cli.main()
        said = capsys.readouterr()
        return stop.value.code or 0, said.out, said.err

    return run


def test_design_simulate_identify_plot(nlfrf_command, tmp_path):
    steps = [
        "design --fs 2048 --period 4096 --f-min 2 --f-max 140 --rms 0.25 --seed 1 -o ms.npz",
        "simulate ms.npz --noise 1e-8 --seed 2 -o record.npz",
        "identify record.npz -o bla.npz",
        "plot bla.npz -o bla.png",
        "plot ms.npz -o ms.svg",
        "plot record.npz -o record.pdf",
    ]
    for step in steps:
        code, out, _ = nlfrf_command(*step.split())
        assert code == 0, step
        assert "wrote" in out
    bla = load(tmp_path / "bla.npz")
    assert bla.experiment.grid == "special-odd"
    assert 55 < bla.f[np.argmax(np.abs(bla.G))] < 63
    for name, magic in (("bla.png", b"\x89PNG"), ("ms.svg", b"<?xml"), ("record.pdf", b"%PDF")):
        assert (tmp_path / name).read_bytes().startswith(magic)


def test_more_that_design_and_identify_can_do(nlfrf_command, tmp_path):
    steps = [
        (
            "design --kind full --fs 512 --period 512 --f-min 1 --f-max 100 --crest 1.6 --seed 1 -o"
            " play.wav"
        ),
        (
            "design --kind odd --fs 512 --period 2048 --f-min 0.5 --f-max 200 --log-lines 30 --seed"
            " 1 -o log.csv"
        ),
        (
            "design --fs 2048 --period 2048 --f-min 2 --f-max 140 --rms 0.25 --realizations 2"
            " --seed 1 -o ms.npz"
        ),
        "simulate ms.npz --mass 1.2 --stiffness 70000 --oversampling 2 -o record.mat",
        "identify record.mat --opinion --csv -o bla.h5",
    ]
    for step in steps:
        code, out, _ = nlfrf_command(*step.split())
        assert code == 0, step
    assert "second opinion: the variance from roughness" in out
    assert (tmp_path / "bla.csv").read_text().startswith("f [Hz],Re G,Im G,bound")
    assert (tmp_path / "play.npz").exists()
    assert load(tmp_path / "bla.h5").experiment.n_realizations == 2


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ("--units N,m", ""),
        ("--units N --units m", ""),
        ("--units N", "units must be one for the input and one for each output, got N"),
        ("--units N,m,s", "units must be one for the input and one for each output, got N, m, s"),
    ],
)
def test_units_that_a_file_does_not_say(nlfrf_command, tmp_path, asked, message):
    ms = multisine(fs=100, n_samples=200, f_min=1, f_max=30, rng=1)
    savemat(
        tmp_path / "run.mat",
        {"force": np.tile(ms.u, 2), "position": np.tile(2 * ms.u, 2), "fs": 100.0},
    )
    names = "--input force --output position --period 200 -o G.npz"
    code, out, err = nlfrf_command("identify", "run.mat", *names.split(), *asked.split())
    assert bool(code) == bool(message)
    if message:
        assert message in err
    else:
        assert load(tmp_path / "G.npz").unit == "m/N"
        assert "m/N" in out


def test_units_of_the_file_are_right(nlfrf_command, tmp_path):
    ms = multisine(fs=100, n_samples=200, f_min=1, f_max=30, rng=1)
    table = np.column_stack([np.arange(400) / 100, np.tile(ms.u[0], 2), np.tile(2 * ms.u[0], 2)])
    np.savetxt(tmp_path / "run.csv", table, delimiter=",", header="t [s],f [N],x", comments="")
    command = "identify run.csv --input f --output x --period 200 -o G.npz --units"
    assert (
        "units must be those of the file, which has N for f, got A"
        in nlfrf_command(*command.split(), "A,m")[2]
    )
    assert nlfrf_command(*command.split(), "N,m")[0] == 0
    assert load(tmp_path / "G.npz").unit == "m/N"


@pytest.mark.parametrize("suffix", [".npz", ".h5", ".csv"])
def test_several_inputs_make_a_matrix(nlfrf_command, tmp_path, suffix):
    ms = multisine(fs=100, n_samples=200, f_min=1, f_max=30, n_inputs=2, rng=1)
    for m in range(2):
        fx, fy = np.tile(ms.u[:, m], 3)
        np.savez(tmp_path / f"run{m}.npz", fx=fx, fy=fy, x=fx + 0.1 * fx**3, y=2 * fy, fs=100.0)
    asked = ["--input", "fx,fy", "--output", "x,y", "--period", "200", "--hold", "zoh"]
    code, out, _ = nlfrf_command(
        "identify", "run0.npz", "run1.npz", *asked, "-o", f"G{suffix}", "--csv"
    )
    assert code == 0
    assert "FRF matrix of 2 outputs by 2 inputs" in out
    table = "G.csv" if suffix == ".csv" else "G-bla.csv"
    assert out.count(f"wrote {table}") == 1
    assert (tmp_path / table).read_text().startswith("f [Hz],Re x/fx,Im x/fx,bound x/fx,Re x/fy")
    code, _, err = nlfrf_command(
        "identify", "run0.npz", "run1.npz", *asked, "--opinion", "-o", "H.npz"
    )
    assert code == 2
    assert "opinion must be left out for several inputs" in err
    for m in range(2):  # a sample that one output lost
        run = dict(np.load(tmp_path / f"run{m}.npz"))
        run["y"] = np.append(np.delete(run["y"], 250), run["y"][-1]) if m else run["y"]
        np.savez(tmp_path / f"lost{m}.npz", **run)
    code, _, err = nlfrf_command("identify", "lost0.npz", "lost1.npz", *asked, "-o", "H.npz")
    assert code == 2
    assert "y2 (y), realisation 1 must stay in step with u" in err
    code, out, _ = nlfrf_command(
        "identify", "lost0.npz", "lost1.npz", *asked, "--resample", "-o", "H.npz"
    )
    assert code == 0
    if suffix != ".csv":
        frm = load(tmp_path / f"G{suffix}")
        assert frm.hold == "zoh"
        assert (frm.inputs, frm.outputs) == (("fx", "fy"), ("x", "y"))
        assert np.abs(frm.G[1, 1] - 2).max() < 1e-9
        code, out, _ = nlfrf_command("plot", f"G{suffix}", "-o", "G.png")
        assert code == 0
        assert (tmp_path / "G.png").read_bytes().startswith(b"\x89PNG")


def test_inputs_one_by_one_are_as_many_as_with_commas(nlfrf_command, tmp_path):
    """The last alone was kept, without a word."""
    ms = multisine("random-odd", fs=100, n_samples=200, f_min=1, f_max=30, n_inputs=2, rng=1)
    rng = np.random.default_rng(1)
    for m in range(2):
        r = np.tile(ms.u[:, m], 3)
        u = r + 0.01 * rng.standard_normal(r.shape)
        table = {
            "rx": r[0],
            "ry": r[1],
            "f,x": u[0],
            "fy": u[1],
            "x": u[0] + 0.1 * u[0] ** 3 - u[1],
        }
        np.savez(tmp_path / f"run{m}.npz", fs=100.0, **table)
    asked = ["identify", "run0.npz", "run1.npz", "--output", "x", "--period", "200"]
    several = [
        "--input",
        '"f,x"',
        "--input",
        "fy",
        "--reference",
        "rx",
        "--reference",
        "ry",
        "-o",
        "G.npz",
    ]
    commas = ["--input", '"f,x",fy', "--reference", "rx,ry", "-o", "H.npz"]
    for how in (several, commas):
        assert nlfrf_command(*asked, *how)[0] == 0
    one, other = load(tmp_path / "G.npz"), load(tmp_path / "H.npz")
    assert one.inputs == other.inputs == ("f,x", "fy")
    np.testing.assert_array_equal(one.cov.bound, other.cov.bound)
    code, _, err = nlfrf_command(
        *asked, "--input", "fy", "--reference", "rx", "--reference", "ry", "-o", "b.npz"
    )
    assert code == 2
    assert "--reference must name a signal of 'run0.npz'" in err


def test_a_zippered_record_beside_its_design(nlfrf_command, tmp_path):
    """The design was put in as references, which a zippered record does not take."""
    asked = (
        "--kind random-odd --fs 256 --period 256 --f-min 1 --f-max 100 --inputs 2 --zippered"
        " --seed 1"
    )
    assert nlfrf_command("design", *asked.split(), "-o", "ms.npz")[0] == 0
    fx, fy = np.tile(load(tmp_path / "ms.npz").u[:, 0], 3)
    np.savez(tmp_path / "run.npz", fx=fx, fy=fy, x=fx + 0.1 * fx**3 - fy, fs=256.0)
    names = ["--input", "fx,fy", "--output", "x"]
    code, _, err = nlfrf_command("identify", "run.npz", *names, "--design", "ms.npz", "-o", "G.npz")
    assert (code, "r must be left out" in err) == (0, False)
    assert load(tmp_path / "G.npz").experiment.design == "zippered"


def test_two_inputs_from_the_design_to_the_matrix(nlfrf_command, tmp_path):
    steps = [
        (
            "design --fs 512 --period 1024 --f-min 2 --f-max 100 --kind random-odd --inputs 2 --rms"
            " 2 --draws 5 --seed 1 -o ms.npz"
        ),
        "plot ms.npz -o ms.png",
        "simulate ms.npz --discard 3 --oversampling 8 --noise 1e-8 --seed 2 -o run.npz",
        "identify run.npz --design ms.npz -o G.npz",
        "plot run.npz -o run.png",
        "identify run.npz --output y --discard 1 -o row.npz",
    ]
    said = []
    for step in steps:
        code, out, _ = nlfrf_command(*step.split())
        assert code == 0, step
        said.append(out)
    assert "2 experiments with 2 inputs" in said[0]
    assert "2 experiments x 2 periods x 1024 samples\nwrote run.npz\n" in said[2]
    frm, row = load(tmp_path / "G.npz"), load(tmp_path / "row.npz")
    assert (frm.inputs, frm.outputs, row.outputs) == (("Fx", "Fy"), ("x", "y"), ("y",))
    assert 25 < frm.f[np.argmax(np.abs(frm.G[0, 0]))] < 33
    np.testing.assert_allclose(row.G[0], frm.G[1], atol=0.05 * np.abs(frm.G).max())
    assert all(
        (tmp_path / name).read_bytes().startswith(b"\x89PNG") for name in ("ms.png", "run.png")
    )


@pytest.mark.parametrize(
    ("command", "refusal"),
    [
        ("design --inputs 2 --crest 1.7", "crest must be left out for several inputs"),
        ("design --zippered", "inputs must be 2 or more for --zippered, got 1"),
        ("design --draws 3", "inputs must be 2 or more for --draws, got 1"),
        ("simulate ms.npz --mass 2", "mass and stiffness must be left out for two inputs"),
        (
            "simulate run.npz",
            (
                "path must hold a multisine or an experiment on a drive, got run.npz, which is a"
                " record"
            ),
        ),
        (
            "identify run.npz --resample",
            "--resample must be left out for a record that is cut into periods already",
        ),
        (
            "identify run.npz --opinion",
            "opinion must be left out for several inputs, got it with run.npz",
        ),
        (
            "identify run.npz --input u",
            "with several: name its inputs in a list, or leave input out",
        ),
    ],
)
def test_what_several_inputs_refuse(nlfrf_command, tmp_path, command, refusal):
    ms = multisine("random-odd", fs=512, n_samples=512, f_min=2, f_max=100, n_inputs=2, rng=1)
    save(ms, tmp_path / "ms.npz")
    u = np.repeat(ms.u[:, :, None], 2, axis=2)
    save(Record(u=u, y=u[::-1], fs=512, lines=ms.lines), tmp_path / "run.npz")
    band = "--fs 512 --period 512 --f-min 2 --f-max 100 " if command.startswith("design") else ""
    code, _, err = nlfrf_command(*f"{command} {band}-o out.npz".split())
    assert code == 2
    assert refusal in err
    assert not (tmp_path / "out.npz").exists()


@pytest.mark.data
def test_the_linear_guide_is_diagnosed(nlfrf_command, measured):
    file = measured / "linear_guide" / "exp1.mat"
    names = ["--input", "input", "--output", "enc1 (mm)"]
    code, _, err = nlfrf_command("identify", file, *names, "--period", "5000", "-o", "bla.npz")
    assert code == 2
    assert "the input repeats every 4999 samples; give --period 4999" in err
    code, out, _ = nlfrf_command("identify", file, *names, "-o", "bla.npz")
    assert code == 0
    assert "100 lines" in out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("identify no.mat -o bla.npz", "path must be an existing file, got 'no.mat'"),
        (
            "design --fs 100 --period 100 --f-min 1 --f-max 80 -o ms.npz",
            "--f-max must lie below the Nyquist frequency",
        ),
        (
            "design --fs 100 --period 100 --f-min 1 --f-max 40 --kind even -o ms.npz",
            "kind must be one of",
        ),
        ("design --fs 100 --period 100 --f-min 1 --f-max 40 -o ms.txt", "path must end in .npz"),
        (
            "design --fs 1 --period 1000000000000 --f-min 0.1 --f-max 0.4 -o ms.npz",
            "not enough memory for this: Unable to allocate",
        ),
        ("plot no.npz -o picture.bmp", "out must end in .png, .pdf or .svg"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(nlfrf_command, tmp_path, arguments, message):
    code, out, err = nlfrf_command(*arguments.split())
    assert code == 2
    assert out == ""
    assert err.startswith("nlfrf: ")
    assert message in err
    assert err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_options_that_are_no_numbers_exit_with_2_too(nlfrf_command):
    assert nlfrf_command("design", "--fs", "fast", "-o", "ms.npz")[0] == 2


@pytest.mark.data
def test_motor_bench_from_the_command_line(nlfrf_command, measured):
    file = measured / "motor_bench" / "MultisineTypeB.mat"
    names = "--input iq_adx --output theta_mx --output theta_my --fs 2500 --period 2500 --discard 1"
    code, out, err = nlfrf_command("identify", file, *names.split(), "-o", "bla.npz")
    assert code == 0
    assert "nlfrf: warning: the odd detection lines of an odd-odd grid" in err
    assert "60 lines from 13 to 249 Hz, odd-odd grid" in out
    assert load("bla-theta_my.npz").experiment.n_periods == 19


def test_the_version_needs_no_command(nlfrf_command):
    code, out, _ = nlfrf_command("--version")
    assert code == 0
    assert out == f"nlfrf + robust {__version__}\n"


def test_the_command_is_installed():
    shown = subprocess.check_output([sys.executable, "-m", "nlfrf", "--help"], text=True)
    for command in ("design", "simulate", "identify", "plot"):
        assert command in shown


def test_messages_speak_of_options(nlfrf_command, tmp_path):
    ms = multisine(fs=1000, n_samples=1000, f_min=1, f_max=200, rng=0)
    u = np.tile(ms.u[0], 3)
    np.savez(tmp_path / "m.npz", u=u, y=u, z=2 * u, fs=1000.0)
    code, _, err = nlfrf_command(*["identify", "m.npz", "--period", "0", "-o", "bla.npz"])
    assert code == 2
    assert err.startswith("nlfrf: --period must be a whole number of at least 4, got 0")
    code, _, err = nlfrf_command(*["identify", "m.npz", "--period", "999", "-o", "bla.npz"])
    assert code == 2
    assert "the input repeats every 1000 samples; give --period 1000" in err
    code, _, err = nlfrf_command(*["identify", "m.npz", "--input", "force", "-o", "bla.npz"])
    assert err.startswith(
        "nlfrf: --input must name a signal of 'm.npz', one of u, y, z; got 'force'"
    )
    u = np.tile(ms.u[0], 6)
    np.savez(tmp_path / "lost.npz", u=np.delete(u, 1500), y=np.delete(u, 1500), fs=1000.0)
    code, _, err = nlfrf_command(*["identify", "lost.npz", "--period", "1000", "-o", "bla.npz"])
    assert code == 2
    assert "--resample cuts the periods where the input itself repeats" in err


def test_a_warning_is_said_once_for_all_outputs(nlfrf_command, tmp_path):
    ms = multisine("odd", fs=1000, n_samples=1000, f_min=1, f_max=200, rng=0)
    u = np.tile(np.clip(ms.u[0], -2, 2), 3)
    rng = np.random.default_rng(0)
    y, z = u + 0.1 * rng.standard_normal(u.size), u + 0.1 * rng.standard_normal(u.size)
    np.savez(tmp_path / "m.npz", u=u, y=y, z=z, fs=1000.0)
    code, _, err = nlfrf_command(
        *["identify", "m.npz", "--output", "y", "--output", "z", "-o", "bla.npz"]
    )
    assert code == 0
    lines = err.strip().splitlines()
    assert (
        len(lines) == len(set(lines)) == 3
    )  # the clipped input, which has low peaks; the level from roughness
    assert lines[0].startswith("nlfrf: warning: u seems clipped")


def test_the_excited_band_is_printed_and_warned_of(nlfrf_command):
    band = "--fs 1000 --period 4000 --f-max 200 --seed 0 -o ms.npz"
    code, out, err = nlfrf_command("design", *["--f-min", "1.25"], *band.split())
    assert code == 0
    assert "excited lines from 2.25 to 198.75 Hz" in out
    assert (
        "the wanted band is 1.25 to 200 Hz, but the excited lines go from 2.25 to 198.75 Hz only"
        in err
    )
    _, _, err = nlfrf_command("design", *["--f-min", "2.2"], *band.split())
    assert err == ""


def test_several_files_and_the_design_that_was_played(nlfrf_command, tmp_path):
    steps = (
        "design --fs 1024 --period 1024 --f-min 1 --f-max 200 --realizations 3 --seed 0 --hold zoh"
        " -o ms.csv"
    )
    code, _, _ = nlfrf_command(*steps.split())
    assert code == 0
    ms = load(tmp_path / "ms.npz")
    rng = np.random.default_rng(0)
    for m, row in enumerate(ms.u):
        u = np.tile(np.clip(np.roll(row, 17 * m), -1.3, 1.3), 2)
        table = np.column_stack(
            [np.arange(u.size) / 1024, u, 3 * u + 1e-3 * rng.standard_normal(u.size)]
        )
        np.savetxt(
            tmp_path / f"run{m}.csv",
            table,
            delimiter=",",
            header="time [s],force [N],way [mm]",
            comments="",
        )
    files = [f"run{m}.csv" for m in range(3)]
    code, out, err = nlfrf_command(
        "identify",
        *files,
        *["--input", "force", "--output", "way", "--design", "ms.npz", "-o", "bla.npz"],
    )
    assert code == 0
    assert all(
        "seems clipped" in line or "got a crest factor of" in line for line in err.splitlines()
    )
    bla = load(tmp_path / "bla.npz")
    assert (bla.experiment.n_realizations, bla.f.size) == (3, ms.f.size)
    assert np.abs(bla.G - 3).max() < 0.02
    assert "3 realisations, 2 periods" in out


@pytest.fixture
def raw(tmp_path):
    """raw.npz: an input, a second one, and outputs whose names look alike as parts of a file's."""
    u = np.tile(multisine(fs=1000, n_samples=500, f_min=2, f_max=200, rng=1).u[0], 3)
    np.savez(
        tmp_path / "raw.npz", **{"u": u, "v": u[::-1], "y 1": 2 * u, "y_1": 3 * u, "fs": 1000.0}
    )


@pytest.mark.usefixtures("raw")
def test_no_result_is_written_over_another(nlfrf_command, tmp_path):
    for outputs in (("y 1", "y_1"), ("y_1", "y_1")):
        told = [word for name in outputs for word in ("--output", name)]
        code, _, err = nlfrf_command("identify", "raw.npz", *told, "-o", "b.npz")
        assert code == 2
        same = f"'{outputs[0]}', '{outputs[1]}', which give the same file, b-y_1.npz"
        assert f"output must be names that give different files, got {same}" in err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["raw.npz"]


@pytest.mark.usefixtures("raw")
def test_messages_have_the_numbers_that_were_measured(nlfrf_command, tmp_path):
    _, _, err = nlfrf_command(
        "identify", "raw.npz", "--output", "y_1", "--discard", "99", "-o", "b.npz"
    )
    assert (
        "of --period 500 samples after --discard 99, got 1500 samples, which is 3.00 periods" in err
    )
    (tmp_path / "empty.csv").touch()
    _, _, err = nlfrf_command("identify", "empty.csv", "-o", "b.npz")
    assert "record_from_samples(u, y, fs=...)" in err


def test_a_name_with_a_comma_stands_in_quotes(nlfrf_command, tmp_path):
    ms = multisine(fs=100, n_samples=100, f_min=1, f_max=30, rng=1)
    u = np.tile(ms.u[0], 3)
    t = np.arange(u.size) / 100
    header = 't [s],"Kraft, x [N]",way'
    np.savetxt(
        tmp_path / "run.csv",
        np.stack([t, u, 2 * u], axis=1),
        delimiter=",",
        header=header,
        comments="",
    )
    for output in ("way", '"way"'):
        code, out, _ = nlfrf_command(
            "identify", "run.csv", "--input", '"Kraft, x"', "--output", output, "-o", "bla.npz"
        )
        assert code == 0
        assert "BLA on" in out
    code, _, err = nlfrf_command(
        "identify", "run.csv", "--input", "", "--output", "way", "-o", "bla.npz"
    )
    assert code == 2
    code, _, err = nlfrf_command(
        "identify",
        "run.csv",
        "--reference",
        "a,b",
        "--input",
        "way",
        "--output",
        "way",
        "-o",
        "x.npz",
    )
    assert code == 2
    assert "--reference must name a signal of 'run.csv'" in err
