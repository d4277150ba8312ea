"""A servo axis that shares no code with the packages, through files and commands."""

import pytest

from benchmarks import bench_stranger

pytestmark = [
    pytest.mark.skipif(not bench_stranger.RIG.is_file(), reason="the independent axis is not beside the project"),
    pytest.mark.filterwarnings("ignore"),
]


@pytest.mark.attack(every=3)
@pytest.mark.parametrize("law", ["lugre", "rigid", "dahl"])
def test_an_axis_of_any_friction_gets_a_verdict(law, tmp_path):
    """The linear verdict, and a bound of the motion that the axis keeps: it comes to rest."""
    rig = bench_stranger.load_rig(bench_stranger.RIG)
    axis = rig.Axis(law=law)
    bench_stranger.play(rig, axis, tmp_path)
    code, found, said, _ = bench_stranger.check(tmp_path)
    assert code == 3, said
    assert found["linear"]["verdict"] == "statistically robust"
    assert 1 < found["linear"]["max_S"] < 2
    friction = found["friction"]
    assert friction["outcome"] == "settles"
    assert 0 < friction["within"] < 3 * bench_stranger.bound_of_truth(axis)
    assert friction["mass"] == pytest.approx(axis.mass, rel=0.02)
    assert friction["mass_interval"][0] < axis.mass < friction["mass_interval"][1]
    assert friction["delay"] == pytest.approx(axis.delay_periods / axis.fs + axis.lag, abs=0.05 / axis.fs)
    low, high = friction["Fs_interval"]
    assert low < (axis.Fc if law == "dahl" else axis.Fs) < high
    assert friction["reason"]


@pytest.mark.attack
def test_a_pole_that_a_zero_cancels_makes_no_loop_unstable(tmp_path):
    """The best fit that does not lead had an unstable pole 0.7 % from a zero: all was lost, and the axis hunts."""
    rig = bench_stranger.load_rig(bench_stranger.RIG)
    bench_stranger.play(rig, rig.hunting_axis(25), tmp_path)
    found = bench_stranger.check(tmp_path)[1]
    assert found["linear"]["verdict"] == "statistically robust"
    assert found["friction"]["outcome"] == "settles"
    assert found["friction"]["simulated"] == "hunts"


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
