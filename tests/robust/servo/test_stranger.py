"""A servo axis that shares no code with the packages, through files and commands."""

import numpy as np
import pytest

import nlfrf
from benchmarks import bench_stranger
from robust.servo import check as check_drive
from robust.servo import load_gains
from robust.servo.checking.read import read_experiments

pytestmark = [
    pytest.mark.skipif(
        not bench_stranger.RIG.is_file(), reason="the independent axis is not beside the project"
    ),
    pytest.mark.filterwarnings("ignore"),
]


@pytest.mark.attack(every=3)
@pytest.mark.parametrize("law", ["rigid", "lugre", "dahl"])
def test_an_axis_of_any_friction_gets_a_verdict(law, tmp_path):
    """The linear verdict, and a bound of the motion that the axis keeps: it comes to rest."""
    rig = bench_stranger.load_rig(bench_stranger.RIG)
    axis = rig.Axis(law=law)
    bench_stranger.play(rig, axis, tmp_path)
    code, found, said, _ = bench_stranger.check(tmp_path)
    # the simulation needs no proof: gains with which it hunts are not passed
    assert code == {"rests": 3, "hunts": 1}[found["friction"]["simulated"]], said
    assert found["linear"]["verdict"] == "statistically robust"
    assert 1 < found["linear"]["max_S"] < 2
    friction = found["friction"]
    assert friction["outcome"] == "settles"
    assert 0 < friction["within"] < 3 * bench_stranger.bound_of_truth(axis)
    assert friction["mass"] == pytest.approx(axis.mass, rel=0.02)
    assert friction["mass_interval"][0] < axis.mass < friction["mass_interval"][1]
    assert friction["delay"] == pytest.approx(
        axis.delay_periods / axis.fs + axis.lag, abs=0.05 / axis.fs
    )
    low, high = friction["Fs_interval"]
    assert low < (axis.Fc if law == "dahl" else axis.Fs) < high
    assert friction["reason"]


@pytest.mark.attack
@pytest.mark.parametrize("law", ["lugre", "rigid"])
def test_an_axis_with_a_load_of_any_friction_gets_a_verdict(law, tmp_path):
    """The trace in motion was read as one mass: 2 % of it were found, and no bound."""
    rig = bench_stranger.load_rig(bench_stranger.RIG)
    axis = rig.with_load(rig.Axis(law=law, resolution=1e-8), 1)
    bench_stranger.play(rig, axis, tmp_path)
    _, found, said, _ = bench_stranger.check(tmp_path, "--masses", 2)
    friction = found["friction"]
    assert friction["outcome"] == "settles", said
    assert 0 < friction["within"] < 3 * bench_stranger.bound_of_truth(axis)
    assert friction["simulated"] == "rests"
    assert friction["mass"] == pytest.approx(8.0, rel=0.02)  # of both
    # LuGre creeps while it slides, which the fit leaves out: on one of two processors, whose
    # roundings the simulation amplifies, its 95 % interval began 0.6 % above the mass
    low, high = friction["mass_interval"]
    assert 0.985 * low < 8.0 < 1.015 * high
    assert friction["delay"] == pytest.approx(
        axis.delay_periods / axis.fs + axis.lag, abs=0.05 / axis.fs
    )
    low, high = friction["Fs_interval"]
    assert low < axis.Fs < high


@pytest.mark.attack
def test_a_delay_that_is_too_long_for_a_proof_keeps_the_linear_verdict(tmp_path):
    """25 samples, as behind a network: the command ended with nothing but their number."""
    rig = bench_stranger.load_rig(bench_stranger.RIG)
    axis = rig.Axis(law="maxwell", Fs=25.0, fs=8000.0, delay_periods=25, kp=12.0, kv=12.0, tn=0.1)
    bench_stranger.play(rig, axis, tmp_path)
    code, found, said, _ = bench_stranger.check(tmp_path)
    # the simulation needs no proof: gains with which it hunts are not passed
    assert code == {"rests": 3, "hunts": 1}[found["friction"]["simulated"]], said
    assert found["linear"]["verdict"] == "statistically robust"
    assert found["friction"]["outcome"] == "open"
    assert "No bound: delay must be at most 20 samples" in found["friction"]["reason"]
    low, high = found["friction"]["Fs_interval"]
    assert low < axis.Fs < high


@pytest.mark.attack
@pytest.mark.parametrize("seed", [0, 3])
def test_a_pole_that_a_zero_cancels_is_none_of_the_machine(seed, tmp_path):
    """It is worth more than scatter, as it takes up one line: both axes were called unstable with
    their own gains.
    """
    rig = bench_stranger.load_rig(bench_stranger.RIG)
    bench_stranger.play(rig, rig.random_axis(seed), tmp_path)
    assert bench_stranger.check(tmp_path)[1]["linear"]["verdict"] == "statistically robust"


@pytest.mark.attack
def test_a_pole_that_a_zero_cancels_makes_no_loop_unstable(tmp_path):
    """The best fit that does not lead had an unstable pole 0.7 % from a zero: all was lost, and the
    axis hunts.
    """
    rig = bench_stranger.load_rig(bench_stranger.RIG)
    bench_stranger.play(rig, rig.hunting_axis(25), tmp_path)
    found = bench_stranger.check(tmp_path)[1]
    assert found["linear"]["verdict"] == "statistically robust"
    assert found["friction"]["outcome"] == "settles"
    assert found["friction"]["simulated"] == "hunts"


@pytest.mark.attack(every=6)
@pytest.mark.parametrize("strokes", [1, 2])
@pytest.mark.parametrize("seed", [3, 5, 8])
def test_a_free_axis_is_judged_with_lines_far_below_its_crossover(seed, strokes, tmp_path):
    """Its pole at zero lies below every line: on which side of the axis scatter puts it decided the
    verdict.
    """
    rig = bench_stranger.load_rig(bench_stranger.RIG)
    axis = rig.random_axis(70)
    bench_stranger.write_files(axis, tmp_path)
    asked = [
        "--period",
        2000,
        "--f-min",
        3,
        "--f-max",
        200,
        "--velocity",
        0.1,
        "--strokes",
        strokes,
    ]
    asked += ["--max-force", 88, "--max-travel", 0.5, "--seed", seed, "-o", tmp_path / "moving.csv"]
    code, _, said = bench_stranger.run("robust", "servo", "design", tmp_path / "axis.toml", *asked)
    assert code == 0, said
    data = np.loadtxt(tmp_path / "moving.csv", delimiter=",", skiprows=1)
    u, y, _ = rig.play(axis, data[:, 1])
    head = "t [s],force set point [N],position [m]"
    np.savetxt(
        tmp_path / "trace.csv", np.c_[data[:, 0], u, y], delimiter=",", header=head, comments=""
    )
    gains = load_gains(tmp_path / "gains.toml")
    experiment = nlfrf.load(tmp_path / "moving.npz")
    records, names, conditions = read_experiments(
        [tmp_path / "trace.csv"], [experiment], gains, u="force set point", y="position"
    )
    assert [np.sign(one.velocity) for one in conditions] == [1, -1]
    found = check_drive(records, gains, names=names, conditions=conditions)
    assert found.linear_passed
    assert found.report.margins.S_worst < 1.5


def test_the_design_of_realisations_may_be_given_for_each_of_their_traces(tmp_path):
    rig = bench_stranger.load_rig(bench_stranger.RIG)
    axis = rig.Axis()
    bench_stranger.write_files(axis, tmp_path)
    asked = [
        "--period",
        2000,
        "--f-min",
        9,
        "--f-max",
        200,
        "--velocity",
        0.1,
        "--strokes",
        1,
        "--realizations",
        2,
    ]
    asked += ["--max-force", 1500, "--max-travel", 0.6, "--seed", 1, "-o", tmp_path / "moving.csv"]
    code, _, said = bench_stranger.run("robust", "servo", "design", tmp_path / "axis.toml", *asked)
    assert code == 0, said
    traces = sorted(tmp_path.glob("moving-*.csv"))
    for path in traces:
        data = np.loadtxt(path, delimiter=",", skiprows=1)
        u, y, _ = rig.play(axis, data[:, 1])
        head = "t [s],force set point [N],position [m]"
        np.savetxt(path, np.c_[data[:, 0], u, y], delimiter=",", header=head, comments="")
    design, gains = nlfrf.load(tmp_path / "moving.npz"), load_gains(tmp_path / "gains.toml")
    once, each = (
        read_experiments(traces, designs, gains, u="force set point", y="position")[0]
        for designs in ([design], [design, design])
    )
    assert [len(once), once[0].n_realizations] == [2, 2]
    assert all(np.array_equal(a.y, b.y) for a, b in zip(once, each, strict=True))


def test_an_axis_that_hunts_is_named_with_its_amplitude_and_the_advice_helps(tmp_path):
    rig = bench_stranger.load_rig(bench_stranger.RIG)
    axis = rig.hunting_axis(14)
    bench_stranger.play(rig, axis, tmp_path)
    friction = bench_stranger.check(tmp_path)[1]["friction"]
    swing = rig.rests(axis)[1]
    assert friction["simulated"] == "hunts"
    assert 0.5 < friction["simulated_amplitude"] / (swing / 2) < 2
    assert "rigid" in friction["laws"]
    advised = bench_stranger.play_advice(axis, friction["advice"])
    assert bench_stranger.swing_of(rig, advised) < swing / 2
