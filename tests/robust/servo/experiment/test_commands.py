"""The commands `robust servo design`, `play` and `levels`: from the gains of a drive to levels and
directions.
"""

import re
import sys

import numpy as np
import pytest

import nlfrf.cli
import robust.cli
from nlfrf import load, multisine, save
from nlfrf.rig import Drive, ServoAxis
from robust.servo import design_experiment, play_experiment
from tests.support.printed import unwrapped


@pytest.fixture
def run_step(monkeypatch, capsys, tmp_path):
    """Run a command line in an empty folder; gives exit code, standard output, standard error."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        own = arguments[0] == "nlfrf"
        monkeypatch.setattr(sys, "argv", [*("robust",) * (not own), *map(str, arguments)])
        with pytest.raises(SystemExit) as stop:
            (nlfrf.cli if own else robust.cli).main()
        said = capsys.readouterr()
        return stop.value.code or 0, said.out, said.err

    return run


AXIS_TOML = """
motor_inertia = 7.17
load_inertia = 15.0
stiffness = 1.33e6
damping = 100.0
[drive]
torque_constant = 125.0
fs = 4000
kv = 30
kp = 33
tn = 0.03
lag = 0.5e-3
"""


def test_an_axis_from_its_gains_to_three_levels_and_either_direction(run_step, tmp_path):
    (tmp_path / "axis.toml").write_text(f"{AXIS_TOML}velocity_feedforward = 1.0\n")
    ramp = "--ramp 14 --max-velocity 0.2 --periods 1 --discard 1"
    move = "--velocity 0.1 --strokes 1 --max-force 200 --max-travel 0.5"
    band = "--period 1000 --f-min 4 --f-max 100 --seed 1"
    assert (
        "assumed of the drive: kv = 30 1/s"
        in run_step("servo", "design", "belt", *band.split(), "--rms", "5", "-o", "x.csv")[1]
    )
    said = []
    for step in (
        f"servo design axis.toml {band} {ramp} -o ramp.csv",
        "servo play belt ramp.csv -o ramp-trace.csv",
        "servo levels ramp-trace.csv --design ramp.npz",
        f"servo design axis.toml --period 2000 --f-min 6 --f-max 200 --seed 1 {move} -o move.csv",
        "servo play belt move.csv -o move-trace.csv",
        "nlfrf identify move-trace.csv --design move.npz --csv -o bla.npz",
        "nlfrf plot move.npz -o move.png",
        (
            "servo design ramp-trace.csv --first ramp.npz --level bends --period 1000 --f-min 12"
            " --f-max 90 -o bends.csv"
        ),
    ):
        code, out, err = run_step(*step.split())
        assert (code, err) == (0, ""), step
        said.append(out)
    assert "14 levels from 0.0" in said[0]
    assert re.search(
        r"take, as rms of the force set point: .* N \(sticks\), .* N \(bends\), .* N \(slides\)",
        said[2],
    )
    assert "in motion at 0.1 m/s" in said[3]
    assert "forward: BLA on" in said[5]
    forward, backward = (load(tmp_path / f"bla-{one}.npz") for one in ("forward", "backward"))
    assert forward.output_units == ("m",)
    np.testing.assert_allclose(forward.G, backward.G, rtol=0.05)
    bends = re.search(r"([\d.]+) N \(bends\)", said[2])[1]
    assert f"force {bends} N rms" in said[7]
    assert one_line(said[3]).endswith(
        "assumed of the drive: kv = 30 1/s, kp = 33 A s/m, tn = 0.03 s, velocity_feedforward = 1;"
        " current loop: 125 N/A, lag 0.5 ms, delay 0.25 ms wrote move.csv wrote move.npz"
    )


def one_line(page):
    """A page without its line breaks."""
    return " ".join(page.split())


def test_levels_of_a_trace_in_amperes_and_millimetres_are_recommended_in_newtons(
    run_step, tmp_path
):
    (tmp_path / "axis.toml").write_text(f"{AXIS_TOML}velocity_feedforward = 1.0\n")
    band = "--period 1000 --f-min 4 --f-max 100"
    run_step(
        *f"servo design axis.toml {band} --seed 1 --ramp 14 --max-velocity 0.2 -o ramp.csv".split()
    )
    run_step(*["servo", "play", "belt", "ramp.csv", "-o", "trace.csv"])
    names, *rows = (tmp_path / "trace.csv").read_text().splitlines()
    names = names.split(",")
    table = np.array([row.split(",") for row in rows], dtype=float)
    force, position = (names.index(name) for name in ("force set point [N]", "position [m]"))
    table[:, force] /= 125.0
    table[:, position] *= 1e3
    names[force], names[position] = "force set point [A]", "position [mm]"
    np.savetxt(
        tmp_path / "amperes.csv",
        table,
        delimiter=",",
        header=",".join(names),
        comments="",
        fmt="%.12g",
    )
    one, other = (
        run_step("servo", "levels", trace, "--design", "ramp.npz")[1]
        for trace in ("trace.csv", "amperes.csv")
    )
    assert one == other
    assert "take, as rms of the force set point: " in one
    again = f"{band} --first ramp.npz --level bends --seed 1 -o".replace(
        "--f-min 4", "--f-min 12"
    ).split()
    one, other = (
        run_step("servo", "design", f"{name}.csv", *again, f"{name}-bends.csv")
        for name in ("trace", "amperes")
    )
    assert one[1].replace("trace-bends", "amperes-bends") == other[1]
    first, second = (
        np.loadtxt(tmp_path / f"{name}-bends.csv", delimiter=",", skiprows=1)
        for name in ("trace", "amperes")
    )
    assert np.abs(first).max(axis=0) == pytest.approx(np.abs(second).max(axis=0), rel=1e-6)
    assert "position [m]" in (tmp_path / "amperes-bends.csv").read_text().splitlines()[0]


def test_a_drive_without_velocity_feedforward(run_step, tmp_path):
    """The default of axis.toml; the presets have one, and what is designed for another drive is not
    played.
    """
    (tmp_path / "axis.toml").write_text(AXIS_TOML)
    design = "servo design axis.toml --period 1000 --f-min 4 --f-max 100 --seed 1 --rms 20"
    code, out, err = run_step(*f"{design} -o play.csv".split())
    assert (code, err) == (0, "")
    assert "velocity_feedforward = 0 (none)" in one_line(out)
    code, _, err = run_step(*["servo", "play", "belt", "play.csv", "-o", "trace.csv"])
    assert code == 2
    assert (
        "must have the gains of the design in 'play.npz', kv = 30 1/s, kp = 33 A s/m, tn = 0.03 s, "
        in err
    )
    assert "velocity_feedforward = 0, got" in err
    assert "velocity_feedforward = 1: design again" in err
    run_step(
        *f"{design} --port force -o push.csv".split()
    )  # at rest no set point moves: the feedforward is idle
    assert run_step(*["servo", "play", "belt", "push.csv", "-o", "push-trace.csv"])[0] == 0


def test_a_band_without_lines_at_its_low_end_is_warned_of(run_step):
    band = "servo design belt --period 4000 --f-max 100 --rms 5 --seed 1 -o play.csv"
    code, _, err = run_step(*f"{band} --f-min 5".split())
    assert code == 0
    assert "the wanted band is 5 to 100 Hz, but the excited lines go from 9 to 9" in err
    assert "or --f-min 3, which leaves a gap in the lines from 3 to 9 Hz" in unwrapped(err)
    assert run_step(*f"{band} --f-min 9 --overwrite".split())[2] == ""


def test_a_design_is_replaced_when_asked_to_and_the_refusal_says_what_it_is(run_step):
    design = "servo design belt --period 1000 --f-min 4 --f-max 100 --rms 5 -o play.csv"
    assert run_step(*design.split())[0] == 0
    code, _, err = run_step(*design.split())
    assert code == 2
    assert "got play.csv, which contains set points or a trace of the experiment in play.npz" in err
    assert "something else" not in err
    assert run_step(*f"{design} --overwrite".split())[0] == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("servo design lathe {} -o x.csv", "preset must be one of"),
        (
            "servo design belt {} --rms 5 --ramp 8 --velocity 0.1 -o x.csv",
            "ramp must be left out with --velocity",
        ),
        (
            "servo design belt {} --rms 5 --strokes 1 -o x.csv",
            "--velocity must not be zero with strokes",
        ),
        ("servo design belt {} --rms 500 --max-force 50 -o x.csv", "rms must be at most"),
        ("servo design trace.csv {} -o x.csv", "got 'trace.csv': for a trace give --first"),
        (
            "servo design bad.toml {} -o x.csv",
            (
                "bad.toml must have no entry 'motor_inertai', did you mean motor_inertia?"
                " Known: damping, drive,"
            ),
        ),
        (
            "servo design bare.toml {} -o x.csv",
            "bare.toml must have an entry motor_inertia, got none",
        ),
        ("servo design broken.toml {} -o x.csv", "axis must be a TOML file, got 'broken.toml': "),
        ("servo play belt play.npz -o x.csv", "path must hold set points called"),
        (
            "nlfrf identify trace.csv --design play.npz --period 500 -o x.npz",
            "period must be left out for an experiment on a",
        ),
        (
            "servo levels trace.csv --design play.npz",
            "experiment must be a ramp of levels, got one with the parts at rest",
        ),
        (
            "servo levels trace.csv --design ms.npz",
            "design must be a file from 'robust servo design', got ms.npz with a Multisine",
        ),
    ],
)
def test_what_the_commands_of_an_axis_refuse(run_step, tmp_path, arguments, message):
    band = "--period 500 --f-min 8 --f-max 100 --seed 1"
    (tmp_path / "bad.toml").write_text("motor_inertai = 3\n[drive]\nfs = 4000\nkv = 1\nkp = 1\n")
    (tmp_path / "bare.toml").write_text("spring = 3\n[drive]\nfs = 4000\nkv = 1\nkp = 1\n")
    (tmp_path / "broken.toml").write_text("mass = = 3\n")
    for step in (
        f"servo design belt {band} --rms 30 -o play.csv",
        "servo play belt play.csv -o trace.csv",
    ):
        assert run_step(*step.split())[0] == 0
    save(multisine(fs=100, n_samples=100, f_min=1, f_max=20, rng=1), tmp_path / "ms.npz")
    code, _, err = run_step(*arguments.format(band).split())
    assert code == 2
    assert message in err
    assert err.count("\n") == 1


LINEAR = """
motor_inertia = "7170 g"
load_inertia = 15
stiffness = "1.33 N/um"
damping = "100 N/(m/s)"
resolution = "50 nm"
[drive]
torque_constant = "125 N/A"
fs = "4 kHz"
kv = "1.8 m/min/mm"
kp = "33 A s/m"
tn = "30 ms"
lag = "500 us"
limit = "17000 mA"
velocity_feedforward = "80 %"
"""
ROTARY = """
motion = "rotary"
motor_inertia = "5200 kg cm²"
motor_damping = "15 Nms/rad"
[drive]
torque_constant = "12 Nm/A"
fs = 4000
kv = "900 1/min"
kp = "2 A/rpm"
"""
#: Text of a file, the axis in plain numbers, and how it is moved.
WITH_UNITS = {
    "linear": (
        LINEAR,
        ServoAxis(
            motor_inertia=7.17,
            load_inertia=15.0,
            stiffness=1.33e6,
            damping=100.0,
            resolution=50e-9,
            drive=Drive(
                torque_constant=125.0,
                fs=4000.0,
                kv=30.0,
                kp=33.0,
                kp_unit="A/(m/s)",
                tn=0.03,
                lag=0.5e-3,
                limit=17.0,
                velocity_feedforward=0.8,
            ),
        ),
        {"rms": 1000.0},
    ),
    "rotary": (
        ROTARY,
        ServoAxis(
            motion="rotary",
            motor_inertia=0.52,
            motor_damping=15.0,
            drive=Drive(
                torque_constant=12.0, fs=4000.0, kv=15.0, kp=60 / np.pi, kp_unit="A/(rad/s)"
            ),
        ),
        {"rms": 20.0, "base_velocity": 1.0, "strokes": 1},
    ),
}


@pytest.mark.parametrize("motion", WITH_UNITS)
def test_an_axis_with_units_is_the_one_in_plain_numbers(run_step, tmp_path, motion):
    """One moves as the other does: by inertia, spring, gains, feedforward, limit and encoder."""
    text, axis, moved = WITH_UNITS[motion]
    (tmp_path / "axis.toml").write_text(text, encoding="utf-8")
    ms = multisine(fs=4000, n_samples=2000, f_min=4, f_max=300, rng=1)
    save(design_experiment(axis, ms, n_discard=1, **moved), tmp_path / "play.csv")
    code, said, _ = run_step("servo", "play", "axis.toml", "play.csv", "-o", "by_units.csv")
    assert code == 0
    assert ("limit in 0.0%" in said) == (motion == "rotary")
    play_experiment(axis, tmp_path / "play.csv", tmp_path / "plain.csv")
    found, wanted = (
        np.genfromtxt(tmp_path / f"{one}.csv", delimiter=",", skip_header=1)
        for one in ("by_units", "plain")
    )
    off = np.abs(found - wanted).max(axis=0)
    assert np.all(off <= 1e-9 * np.ptp(wanted, axis=0))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            ("load_inertia = 15.0", 'load_inertia = "15 kg m^2"'),
            "load_inertia must be a number with its unit, such as",
        ),
        (("tn = 0.03", 'tn = "30"'), 'tn must be a number with its unit, such as "1 s" or "1 ms"'),
        (
            ("kp = 33", 'kp = "33 A/(rad/s)"'),
            r'kp must be a number with its unit, such as "143 A/\(m/s\)", got',
        ),
        (("kv = 30", ""), r"\[drive\] of axis.toml must have an entry kv, got none"),
        (
            ("kv = 30", "Kv = 30"),
            r"\[drive\] of axis.toml must have no entry 'Kv', did you mean kv\? Known: delay",
        ),
        (("[drive]", "drive = 3\n[other]"), "axis.toml must have no entry 'other'"),
        (
            ("lag = 0.5e-3", 'delay_periods = "1 ms"'),
            "delay_periods must be a real number, got '1 ms'",
        ),
    ],
)
def test_an_axis_that_is_not_well_written_is_refused(run_step, tmp_path, change, message):
    (tmp_path / "axis.toml").write_text(AXIS_TOML.replace(*change))
    code, _, refused = run_step("servo", "play", "axis.toml", "play.csv", "-o", "trace.csv")
    assert code == 2
    assert re.search(message, refused)
