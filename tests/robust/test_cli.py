"""The command robust: from a BLA to a verdict by files; bad input is one line and exit code 2."""

import json
import re
import sys
from dataclasses import replace
from pathlib import Path

import control
import numpy as np
import pytest
from scipy.io import savemat

import nlfrf
from robust import UncertaintyModel, cli, load, save
from tests.support.bla import make_bla
from tests.support.printed import unwrapped

F = np.sort(np.concatenate([8 * np.arange(30) + 1, 8 * np.arange(30) + 3])) * 0.5


def plant(s):
    w = 2 * np.pi * 59
    return w * w / (s * s + 0.08 * w * s + w * w)


@pytest.fixture
def robust_command(monkeypatch, capsys, tmp_path):
    """Run the command in a folder with bla.npz; gives exit code, standard output, standard
    error.
    """
    monkeypatch.chdir(tmp_path)
    size = np.abs(plant(2j * np.pi * F))
    for name, seed in (("bla.npz", 0), ("bla2.npz", 1)):
        bla = make_bla(
            plant,
            F,
            f0=0.5,
            sigma_noise=0.01 * size,
            sigma_distortion=0.05 * size,
            rng=seed,
            fs=1000,
        )
        save(bla, name)

    def run(command):
        monkeypatch.setattr(sys, "argv", ["robust", *command.split()])
        with pytest.raises(SystemExit) as stop:
            cli.main()
        said = capsys.readouterr()
        return stop.value.code or 0, said.out, said.err

    return run


#: Command line -> what it wrote.
WRITTEN = {}


def made(robust_command, *commands):
    """Write what the commands make of bla.npz; what was made before is taken from memory."""
    for command in commands:
        path = Path(re.search(r"-o (\S+)", command)[1])
        if command in WRITTEN:
            path.write_bytes(WRITTEN[command])
            continue
        assert robust_command(command)[0] == 0
        WRITTEN[command] = path.read_bytes()


def test_the_whole_way(robust_command, tmp_path):
    steps = [
        ("orders bla.npz --relative-degree 2 --most 4 --picture orders.png", "(taken)"),
        (
            "model bla.npz --poles 2 --zeros 0 --order 3 -o m.json --picture m.png",
            "multiplicative uncertainty",
        ),
        (
            "design m.json --bandwidth 6 --sample-time 0.001 --delay 0.001 -o K.json",
            "controller of order",
        ),
        (
            "check m.json K.json --delay 0.001 --bandwidth 1 -o r.txt --picture c.pdf",
            "STATISTICALLY ROBUST",
        ),
        ("export m.json -o m.mat", "wrote m.mat"),
        ("export K.json -o K.mat", "wrote K.mat"),
        ("export K.json -o K.csv", "wrote K.csv"),
        ("export K.json -o K.h --limit -2 --limit 3 --rounded Kr.json", "limit: u from -2 to 3"),
        ("check m.json Kr.json --delay 0.001", "STATISTICALLY ROBUST"),
        ("export K.json -o K.st --dtype float32", "coefficients in float32"),
        (
            (
                "model bla.npz bla2.npz --poles 2 --zeros 0 --form additive --simultaneous --above"
                " flat -o f.json"
            ),
            "additive",
        ),
        (
            "model bla.npz --poles 2 --delay estimate --sample-time 0.001 -o d.json",
            "sampled at 1000 Hz",
        ),
        ("design d.json --bandwidth 6 -o Kd.json", "sampled at 1000 Hz"),
        ("design m.json --method mixsyn --bandwidth 1 --sample-time 0.001 -o Km.json", "gamma 0."),
        ("check m.json Km.json --no-certify", "NOT CERTIFIED"),
        (
            "design bla.npz --method pid --sample-time 0.001 --peak 1.8 -o Kp.json",
            "every limit met",
        ),
        (
            (
                "design m.json --method pid --structure PI --bandwidth 0.5 --sample-time 0.001 -o"
                " Kp2.json"
            ),
            "every limit met",
        ),
        ("check d.json Kd.json --no-certify", "NOT CERTIFIED"),
    ]
    for command, word in steps:
        code, out, err = robust_command(command)
        assert code == (1 if word == "NOT CERTIFIED" else 0), (command, err)  # nothing proved
        assert word in out, command
    told_as_json(robust_command)
    assert load(tmp_path / "m.json").form == "multiplicative"
    assert load(tmp_path / "K.json").dt == 0.001
    assert (tmp_path / "r.txt").read_text().startswith("verdict")
    assert (tmp_path / "K.csv").read_text().startswith("b0,b1,b2,a0,a1,a2\n")
    for name, magic in (("m.png", b"\x89PNG"), ("c.pdf", b"%PDF"), ("orders.png", b"\x89PNG")):
        assert (tmp_path / name).read_bytes().startswith(magic)
    assert (tmp_path / "load_m.m").exists()


def test_the_order_that_the_data_ask_for(robust_command, tmp_path):
    code, out, err = robust_command("model bla.npz -o m.json")
    assert code == 0, err
    assert "the data need 2 poles and 0 zeros" in unwrapped(out)
    model = load(tmp_path / "m.json")
    assert model.nominal.nstates == 2
    assert 0 < model.weight.nstates <= 8
    excess = 20 * np.log10(np.abs(model.weight(1j * model.omega)) / model.radius)
    assert excess.min() >= 0
    assert excess.mean() <= 3.0 or model.weight.nstates == 8
    assert "order:" not in robust_command("model bla.npz --poles 2 --zeros 0 -o m.json")[1]
    code, out, _ = robust_command("model bla.npz --poles 3 --zeros 0 --order 4 -o m.json")
    assert code == 0
    assert (
        "poles must be given with zeros" in robust_command("model bla.npz --zeros 1 -o m.json")[2]
    )


def test_of_several_levels_each_is_asked_for_its_order(robust_command, tmp_path):
    """No model explains two plants: what one leaves of both would ask for ever more poles."""
    size = np.abs(plant(2j * np.pi * F))
    for k, gain in enumerate((1.0, 1.5)):
        bla = make_bla(
            lambda s, g=gain: g * plant(s),
            F,
            f0=0.5,
            sigma_noise=0.01 * size,
            sigma_distortion=0.02 * size,
            rng=k,
            fs=1e3,
        )
        save(bla, f"level{k}.npz")
    code, out, err = robust_command("model level0.npz level1.npz -o m.json")
    assert code == 0, err
    assert "one of 2 records needs 2 poles and 0 zeros, none needs more poles" in unwrapped(out)
    assert load(tmp_path / "m.json").nominal.nstates == 2


def test_a_fit_that_leaves_more_than_scatter_is_named(robust_command):
    def softer(s):
        return plant(s) + 0.08 * 4e4 / (s * s + 4 * s + 4e4)

    size = np.abs(softer(2j * np.pi * F))
    save(
        make_bla(
            softer, F, f0=0.5, sigma_noise=0.01 * size, sigma_distortion=0.05 * size, rng=3, fs=1000
        ),
        "two.npz",
    )
    code, out, _ = robust_command("model two.npz --poles 2 -o m.json")
    assert code == 0
    assert "order: 2 poles and" in unwrapped(out)
    assert "times noise and distortion, which widens the set" in unwrapped(out)
    assert "the data need 4 poles" in unwrapped(out)


def test_a_controller_file_has_the_delay_or_the_check_warns_of_it(robust_command):
    """The verdict on a saved controller is that of its design; a file without a delay is named."""
    made(robust_command, "model bla.npz --poles 2 --zeros 0 --order 2 -o m.json")
    for delay in ("0", "0.002"):
        line = f"design m.json --bandwidth 8 --sample-time 0.002 --delay {delay} -o K.json"
        assert robust_command(line)[0] == 0
        _, out, err = robust_command("check m.json K.json --no-certify")
        assert "computation delay" not in err
        assert out == robust_command(f"check m.json K.json --no-certify --delay {delay}")[1]
    robust_command("reduce m.json K.json -o low.json")
    assert json.loads(Path("low.json").read_text())["delay"] == 0.002
    save(load("K.json"), "K.json")
    expected = (
        "warning: K.json has no computation delay: zero is assumed. Give --delay [s], or delay to"
        " robust.save"
    )
    for line in ("check m.json K.json --no-certify", "reduce m.json K.json --order 2 -o low.json"):
        assert expected in unwrapped(robust_command(line)[2])
    assert "delay" not in json.loads(Path("low.json").read_text())


@pytest.mark.usefixtures("undrawn")
def test_a_controller_and_a_record_from_matlab(robust_command, tmp_path):
    """A record by its names, its units by an option, and a controller by its matrices: names are
    given once.
    """
    ms = nlfrf.multisine("special-odd", fs=512, n_samples=1024, f_min=1, f_max=150, rng=1)
    u, f = np.tile(ms.u[0], 2), np.fft.rfftfreq(2048, 1 / 512)
    y = np.fft.irfft(plant(2j * np.pi * f) * np.fft.rfft(u)) + 0.01 * np.random.default_rng(
        0
    ).standard_normal(2048)
    savemat("run.mat", {"force": u, "position": y, "command": u, "fs": 512.0})
    record = nlfrf.load_record("run.mat", u="force", y="position", n_samples=1024)
    save(nlfrf.identify(replace(record, input_units=("N",), output_units=("m",))), "G.npz")
    assert robust_command("model G.npz --poles 2 --zeros 0 --order 2 -o m.json")[0] == 0
    savemat("K.mat", {"num": [0.02, 0.0], "den": [1.0, -1.0], "Ts": 1 / 512})
    save(control.tf([0.02, 0.0], [1.0, -1.0], 1 / 512), "K.json")
    code, out, err = robust_command("check m.json K.mat --no-certify")
    assert "warning: K.mat has no computation delay" in err
    assert out == robust_command("check m.json K.json --no-certify --delay 0")[1]
    assert (
        "computation delay"
        not in robust_command("check m.json K.mat --no-certify --delay 0.001")[2]
    )
    records = ("run.mat", "own.npz", "run.mat --reference command")
    for command in (f"--record {one} --bla G.npz" for one in records):
        save(record, "own.npz")
        code, out, err = robust_command(f"report m.json K.mat --delay 0 {command} -o r.html")
        assert not code, err
        assert "rms" in (tmp_path / "r.html").read_text()
        assert re.search(r"[\d.]+ N\b", (tmp_path / "r.html").read_text())
    assert (
        "must name a signal of 'run.mat'"
        in robust_command("report m.json K.mat --record run.mat --input x -o r.html")[2]
    )
    asked = "report m.json K.mat --record run.mat --reference x -o r.html"
    assert "--reference must name a signal of 'run.mat'" in robust_command(asked)[2]


def told_as_json(robust_command):
    """Verdicts for programs: JSON alone on standard output, long arrays by shape, and exit
    codes.
    """
    code, out, err = robust_command("check m.json K.json Km.json --delay 0.001 --json -o all.txt")
    told = json.loads(out)
    assert code == 0
    assert list(told) == ["K.json", "Km.json"]
    assert told["K.json"]["verdict"] == "statistically robust"
    assert told["K.json"]["proofs"]["robustly_stable"] is True
    assert list(told["K.json"]["curves"]["rs"]) == ["shape"]
    assert told["K.json"]["margins"]["disk_gain"] > 1
    assert "wrote all-K.txt" in err
    assert "wrote all-Km.certificate.json" in err
    code, out, _ = robust_command("verify all-K.certificate.json --json")
    assert (code, json.loads(out)["verified"]) == (0, True)
    code, out, _ = robust_command("check m.json K.json --delay 0.001 --bandwidth 5 --json")
    assert (code, json.loads(out)["K.json"]["proofs"]["robust_performance"]) == (
        1,
        False,
    )  # more than the set allows
    code, out, err = robust_command(
        "design m.json --method pid --structure P --bandwidth 20 --peak 1.2 -o s.json --json"
    )
    assert (code, json.loads(out)["met"]) == (1, False)
    assert "wrote s.json" in err


def test_a_shell_is_taught_the_commands(monkeypatch, capsys):
    monkeypatch.setenv("_ROBUST_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", "robust ver")
    monkeypatch.setenv("COMP_CWORD", "1")
    monkeypatch.setattr(sys, "argv", ["robust"])
    with pytest.raises(SystemExit):
        cli.main()
    assert capsys.readouterr().out.split() == ["verify"]


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("model nothing.npz --poles 2 -o m.json", "nothing.npz"),
        ("model bla.npz --poles 2 --zeros 3 -o m.json", "--zeros must be at most"),
        ("model bla.npz --poles 2 --delay soon -o m.json", "delay must be a number"),
        ("model bla.npz --poles 2 --form cubic -o m.json", "form must be one of"),
        ("model bla.npz --poles 2 --above steep -o m.json", "above must be a number"),
        ("model bla.npz --poles 2 -o nowhere/m.json", "existing folder"),
        (
            "model bla.npz --poles 2 -o m.json --picture m.xyz",
            "picture must be a file that matplotlib writes",
        ),
        (
            "design bla.npz --bandwidth 5 -o K.json",
            "path must hold a model, got bla.npz, which is a BLA; go on with: robust model bla.npz",
        ),
        ("check m.json nothing.json", "nothing.json"),
        (
            "check K.json K.json",
            (
                "must hold a model, got K.json, which is a controller; go on with: robust check"
                " MODEL K.json"
            ),
        ),
        (
            "check m.json m.json",
            (
                "must hold a controller, got m.json, which is a model; go on with: robust design"
                " m.json"
            ),
        ),
        ("check m.json K.json --solver MOSEK", "solver must be one of"),
        ("check m.json K.json --delay -1", "delay must be zero or positive"),
        ("check m.json K.json --bandwidth 0", "bandwidth must be positive, got 0"),
        (
            "design m.json --bandwidth 900 --sample-time 0.001 -o K2.json",
            (
                "--bandwidth must be at most half the Nyquist frequency, 1570.8 rad/s (250 Hz), got"
                " 5654.87 rad/s (900 Hz)"
            ),
        ),
        ("design m.json -o K2.json", "bandwidth must be given"),
        ("design m.json --method lqg -o K2.json", "method must be one of"),
        ("design m.json --method PID --structure PIDD -o K2.json", "structure must be one of"),
        (
            "design bla.npz --method pid --bandwidth 9000 -o K2.json",
            "--bandwidth must lie within the lines, ",
        ),
        ("export m.json -o m.xyz", "out must end in .mat, .csv, .h, .st or .py"),
        ("export m.json -o m.csv", "path must hold a controller"),
        ("export m.json -o m.h", "path must hold a controller"),
        (
            "export K.json -o K.mat --limit 3",
            "--dtype, --limit and --rounded must be left out except for .h and .st",
        ),
        (
            "export K.json -o K.h --dtype half",
            "dtype must be one of 'float32', 'float64', got 'half'",
        ),
    ],
)
def test_bad_input_is_one_line_and_exit_code_two(robust_command, command, message, tmp_path):
    made(
        robust_command,
        "model bla.npz --poles 2 --zeros 0 --order 2 -o m.json",
        "design m.json --bandwidth 6 --sample-time 0.001 -o K.json",
    )
    before = sorted(p.name for p in tmp_path.iterdir())
    code, _, err = robust_command(command)
    assert code == 2
    lines = [line for line in err.strip().splitlines() if line.startswith("robust:")]
    assert len(lines) == 1
    assert message in lines[0]
    assert "Traceback" not in err
    assert sorted(p.name for p in tmp_path.iterdir()) == before


def test_help_everywhere(robust_command):
    for command in ("", "model ", "design ", "check ", "export ", "orders "):
        code, out, _ = robust_command(f"{command}--help")
        assert code == 0
        assert "Usage" in out


def test_a_missing_file_is_named(robust_command):
    code, _, err = robust_command("check nowhere.json K.json")
    assert code == 2
    assert err == "robust: nowhere.json could not be opened: no such file or directory\n"


def test_export_says_what_is_wrong_with_a_controller(robust_command, tmp_path):
    (tmp_path / "newer.json").write_text('{"schema": "robust-controller", "version": 2}')
    code, _, err = robust_command("export newer.json -o K.mat")
    assert code == 2
    assert "version 1 of robust-controller" in err


def test_a_certificate_is_verified_by_whoever_has_it(robust_command, tmp_path):
    for command in (
        "model bla.npz --poles 2 --zeros 0 --order 3 -o m.json",
        "design m.json --bandwidth 6 --sample-time 0.001 --delay 0.001 -o K.json",
        "check m.json K.json --delay 0.001 --bandwidth 1 -o r.txt",
        "design m.json --bandwidth 5 --sample-time 0.001 --delay 0.001 -o other.json",
    ):
        code, said, wrong = robust_command(command)
        assert code == 0, wrong
        if command.startswith("check"):
            assert "wrote r.certificate.json" in said
            assert said.count(": proved, rigorous") == 4
            assert said.count("exact arithmetic, proved, rigorous") == 2
    code, said, _ = robust_command("verify r.certificate.json --model m.json --controller K.json")
    assert code == 0
    assert said.splitlines()[-1] == "VERIFIED"
    code, said, _ = robust_command("check m.json K.json --delay 0.001 --proof lmi")
    assert code == 1
    assert "no inequality covers the aliases of a continuous plant" in unwrapped(said)
    code, said, _ = robust_command("verify r.certificate.json --controller other.json")
    assert code == 1
    assert "the controller: NOT verified: not the one of the certificate" in said
    text = (tmp_path / "r.certificate.json").read_text()
    (tmp_path / "changed.json").write_text(text.replace('"delay": 0.001', '"delay": 0.0009'))
    code, _, wrong = robust_command("verify changed.json")
    assert code == 2
    assert "whose digest does not fit" in wrong
    save(control.ss([], [], [], [[1e9]], 0.001), tmp_path / "bold.json")
    code, said, _ = robust_command("check m.json bold.json -o r.txt")  # which proves nothing
    assert "r.certificate.json is from an earlier run" in said


def model_of_a_matrix(robust_command):
    """Identify a plant of two channels, G.npz, and make its model, m.json; return the output."""
    ms = nlfrf.multisine("random-odd", fs=256, n_samples=512, f_min=1, f_max=60, n_inputs=2, rng=1)
    line, u = np.fft.rfftfreq(512, 1 / 256), np.repeat(ms.u[:, :, None], 2, axis=2)
    held = control.sample_system(control.tf(plant(control.tf("s"))), 1 / 256, "zoh")
    G = np.array([[1.0, 0.2], [-0.1, 0.5]])[:, :, None] * held(np.exp(2j * np.pi * line / 256))
    y = np.fft.irfft(np.einsum("jik,impk->jmpk", G, np.fft.rfft(u)), 512)
    y += 2e-3 * y.std() * np.random.default_rng(2).standard_normal(y.shape)
    frm = nlfrf.identify(nlfrf.Record(u=u, y=y, fs=256, lines=ms.lines), transient="none")
    nlfrf.save(frm, "G.npz")
    command = (
        "model G.npz --poles 4 --delay 0 --sample-time 0.00390625 --form additive --order 2"
        " -o m.json --picture m.png"
    )
    code, out, err = robust_command(command)
    assert not code, err
    return out


@pytest.mark.usefixtures("undrawn")
def test_a_matrix_goes_from_file_to_verdict(robust_command, tmp_path):
    out = model_of_a_matrix(robust_command)
    assert "additive uncertainty with 2 outputs and 2 inputs" in out
    T = 1 / 256
    small = control.append(*[control.ss(control.tf([0.3 * T, 0], [1, -1], T))] * 2)
    save(small, "small.json")
    save(control.ss([], [], [], 500 * np.eye(2), T), "large.json")
    code, out, err = robust_command("check m.json small.json large.json -o r.txt")
    assert code == 1, err
    assert re.search(r"small\.json:\nverdict: +STATISTICALLY ROBUST", out)
    assert re.search(r"large\.json:\nverdict: +NOT ROBUST", out)
    assert "STATISTICALLY ROBUST" in (tmp_path / "r-small.txt").read_text()
    code, out, err = robust_command(
        "verify r-small.certificate.json --model m.json --controller small.json"
    )
    assert (code, out.splitlines()[-1]) == (0, "VERIFIED"), err
    code, out, err = robust_command("export r-small.certificate.json -o proof.mat")
    assert (code, (tmp_path / "load_proof.m").exists()) == (0, True), err
    assert (tmp_path / "m.png").read_bytes().startswith(b"\x89PNG")
    code, out, err = robust_command(
        "check m.json small.json --bandwidth 0.01 --peak 4 --no-certify"
    )
    assert re.search(r"performance: +\S+ at .*max mu, allowed is 1", " ".join(out.split()))
    code, out, err = robust_command("export m.json -o m.mat")
    assert not code, err
    code, _, err = robust_command("shape m.json -o s.html")
    assert code == 2
    assert (
        "model must have one input and output for this command, got m.json with 2 outputs by 2"
        " inputs" in err
    )
    code, out, err = robust_command("report m.json small.json -o r.html --bla G.npz")
    assert not code, err
    assert "statistically robust" in out
    code, _, err = robust_command("design m.json --method mixsyn --bandwidth 3 -o K.json")
    assert code == 2
    assert "use dk_iteration for its perturbation" in err
    code, _, err = robust_command("design m.json --bandwidth 3 --delay 0.004 -o K.json")
    assert code == 2
    assert "delay must be left out for several channels" in err
    code, _, err = robust_command("model G.npz bla.npz --poles 2 -o n.json")
    assert code == 2
    assert "bla must be all BLAs or all matrices, got bla.npz with Bla" in err


@pytest.mark.attack
def test_a_matrix_of_two_records_and_its_controllers(robust_command, tmp_path):
    model_of_a_matrix(robust_command)
    for method, asked in (("ncfsyn", "--bandwidth 3"), ("pid", "--structure PI --peak 1.8")):
        code, out, err = robust_command(f"design m.json --method {method} {asked} -o K.json")
        assert not code, err
        assert "controller of order" in out
        assert (load("K.json").ninputs, load("K.json").dt) == (2, 1 / 256)
        code, out, err = robust_command("check m.json K.json --no-certify")
        assert "because" in out
        assert "max mu" in out
    code, _, err = robust_command(
        "model G.npz G.npz --poles 4 --delay 0 --sample-time 0.00390625 --form elements -o n.json"
    )
    assert not code, err
    assert load(tmp_path / "n.json").origin.source.count("random-odd multisine") == 2


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("design m.json --bandwidth -6 -o K.json", "bandwidth must be positive, got -6"),
        (
            "design m.json --method mixsyn --bandwidth 6 --peak 0.5 -o K.json",
            "--peak must be above 1",
        ),
        ("check m.json K.json --bandwidth 1 --error -1", "error must be positive, got -1"),
        (
            "check m.json K.json a/K.json -o r.txt",
            "controller must be files of different names, got K.json, a/K.json",
        ),
    ],
)
def test_messages_name_the_option_in_its_own_unit(robust_command, command, message, tmp_path):
    G, w = control.tf([1], [1, 1]), control.tf([0.2], [1])
    save(
        UncertaintyModel(G, w, "multiplicative", np.array([1.0, 2.0]), np.array([0.1, 0.2])),
        "m.json",
    )
    (tmp_path / "a").mkdir()
    for path in ("K.json", "a/K.json"):
        save(2.0, path)
    code, _, err = robust_command(command)
    assert code == 2
    assert message in err


def test_a_controller_is_checked_with_the_delay_it_was_designed_for(robust_command):
    assert robust_command("model bla.npz --poles 2 --zeros 0 --order 2 -o m.json")[0] == 0
    assert (
        robust_command("design m.json --bandwidth 6 --sample-time 0.001 --delay 0.002 -o K.json")[0]
        == 0
    )
    assert json.loads(Path("K.json").read_text())["delay"] == 0.002
    _, stored, err = robust_command("check m.json K.json --no-certify")
    assert "designed for" not in err
    assert "zero-order hold and a delay of 0.002 s in the plant" in " ".join(stored.split())
    assert robust_command("check m.json K.json --no-certify --delay 0.002")[1] == stored
    _, without, err = robust_command("check m.json K.json --no-certify --delay 0")
    assert "K.json was designed for a computation delay of 0.002 s, but --delay is 0 s" in err
    assert "zero-order hold in the plant" in " ".join(without.split())
    save(load("K.json"), "old.json")  # says nothing of a delay, as every file of before
    assert robust_command("check m.json old.json --no-certify")[1] == without


def test_the_check_warns_of_thin_margins_as_its_peak_says(robust_command):
    assert robust_command("model bla.npz --poles 2 --zeros 0 --order 2 -o m.json")[0] == 0
    assert robust_command("design m.json --bandwidth 6 --sample-time 0.001 -o K.json")[0] == 0
    code, page, _ = robust_command("check m.json K.json")
    largest = float(re.search(r"max \|S\|: +(\S+) at ", page)[1])
    assert (code, "thin margins" in page) == (0, largest > 2)
    for peak, warned in ((0.9 * largest, True), (1.1 * largest, False)):
        code, page, _ = robust_command(f"check m.json K.json --peak {peak}")
        assert (
            code,
            f"thin margins: |S| reaches {largest:.3g} over the set" in " ".join(page.split()),
        ) == (0, warned)
    assert robust_command("check m.json K.json --peak 0")[0] == 2


def test_a_continuous_design_has_its_delay(robust_command):
    """The delay was left out of a loop shaping without --sample-time."""
    assert robust_command("model bla.npz --poles 2 --zeros 0 --order 2 -o m.json")[0] == 0
    orders = []
    for delay in ("0", "0.004"):
        assert robust_command(f"design m.json --bandwidth 6 --delay {delay} -o K.json")[0] == 0
        orders.append(load("K.json").nstates)
    assert orders[1] == orders[0] + 4  # of the Pade approximation


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (
            "design m.json --bandwidth 6 --sample-time 0.001 --delay 0.5 -o K.json",
            "for 0.5 ms give --delay 0.0005",
        ),
        (
            "design bla.npz --method pid --positive --sample-time 0.001 --delay 0.5 -o K.json",
            "periods of 0.001 s",
        ),
        (
            "check m.json old.json --delay 0.5",
            "at most 50 sampling periods of 0.001 s, got 0.5 s, which is 500 periods",
        ),
        ("shape m.json --sample-time 0.001 --delay 0.5 -o s.html", "delay must be in seconds"),
        (
            "check md.json 2.json",
            "robust.lti.discretize(K, 0.001), or robust design --sample-time 0.001",
        ),
    ],
)
def test_units_and_clocks_are_named(robust_command, command, message):
    made(
        robust_command,
        "model bla.npz --poles 2 --zeros 0 --order 2 -o m.json",
        "model bla.npz --poles 2 --zeros 0 --order 2 --sample-time 0.001 -o md.json",
    )
    save(control.tf([1], [1, 0], 0.001), "old.json")
    save(control.tf([1], [1, 1]), "2.json")
    code, _, err = robust_command(command)
    assert code == 2
    assert message in err


def test_a_plant_that_may_be_two_is_not_decided(robust_command):
    """Five lines with discs of 0.9 of the plant leave its sign open: exit code 3, and no rows for a
    PLC.
    """
    f = np.geomspace(0.5, 1.5, 5)
    G = control.tf([100], [1, 17, 0])(2j * np.pi * f)
    save(nlfrf.bla_from_frf(f, G * (1 + 0.2j), std=0.55 * np.abs(G)), "open.npz")
    code, out, _ = robust_command("design open.npz --method pid --structure P --peak 4 -o K.json")
    assert code == 3
    assert "STABILITY NOT DECIDED; stability not decided: below its first line at 0.5 Hz" in out
    assert "TwinCAT" not in out
    code, out, _ = robust_command(
        "design open.npz --method pid --structure P --peak 4 -o K.json --json"
    )
    assert (code, json.loads(out)["stability"]) == (3, "undecided")
    code, _, err = robust_command("design m.json --plant-integrators 0 --bandwidth 3 -o K.json")
    assert code == 2
    assert "plant-integrators must be given with --method pid" in err


def test_limits_that_are_not_met_are_not_called_held(robust_command):
    code, out, _ = robust_command(
        "design bla.npz --method pid --peak 0.9 --sample-time 0.001 -o K.json"
    )
    assert code == 1
    assert "LIMITS NOT MET" in out
    assert "held" not in out
    assert "limits tried: on the 60 measured lines only" in out
    assert "to meet the limits: a larger --peak; or a --structure of higher order" in unwrapped(out)
    assert "prove it" not in out
