"""The level pre-test: against what the simulated axes do at its levels, and on machines it must not
read.
"""

import re
from dataclasses import replace

import numpy as np
import pytest

import nlfrf
from nlfrf import DataWarning, servo_axis
from nlfrf.io import load_trace
from nlfrf.rig import run
from robust.servo import (
    FrictionRegime,
    design_experiment,
    design_ramp,
    find_levels,
    play_experiment,
)
from tests.support.backlash import play_backlash
from tests.support.tables import write_columns

N = 1000
MS = nlfrf.multisine(fs=4000, n_samples=N, f_min=4, f_max=100, rng=1)
TOP = {"linear motor": 120, "belt": 150, "ball screw": 2500, "joint": 25}


def without_friction(axis):
    return replace(axis, motor_friction=None, load_friction=None)


def slipping(axis, x):
    """Peak of each mass over the displacement at which its first, and its last, element slips."""
    laws = [law for law in (axis.motor_friction, axis.load_friction) if law is not None]
    peak = np.abs(x - x.mean(axis=1, keepdims=True)).max(axis=1)
    return np.array(
        [
            [one * k / s for k, s in zip(law.stiffness, law.strength, strict=True)]
            for one, law in zip(peak, laws, strict=True)
        ]
    )


@pytest.mark.filterwarnings("ignore:the force is .* as designed")
@pytest.mark.parametrize("name", TOP)
def test_the_levels_are_those_at_which_the_axis_sticks_bends_and_slides(tmp_path, name):
    """Truth: no element slips, some do, all do.

    The first one may slip by a sixth at the highest peak.
    """
    axis = servo_axis(name)
    ramp = design_ramp(without_friction(axis), MS, rms=TOP[name], n_levels=18)
    nlfrf.save(ramp, tmp_path / "ramp.csv")
    play_experiment(axis, tmp_path / "ramp.csv", tmp_path / "trace.csv")
    levels = find_levels(load_trace(tmp_path / "trace.csv", ramp), ramp)
    assert levels.reason == ""
    found, narrow = [], nlfrf.multisine(fs=4000, n_samples=N, f_min=8, f_max=90, rng=2)
    for rms, record in zip(levels.rms, levels.records, strict=True):
        experiment = design_experiment(record, narrow, rms=rms, n_discard=4)
        trace = run(axis, experiment.set_points(0))
        found.append(slipping(axis, trace.x[:, 4 * N : 6 * N]))
    sticks, bends, slides = found
    assert 0.15 < sticks.max() < 1.17
    assert bends.max() > 1.5
    assert bends[:, -1].max() < 2.5  # the last element slips at the peaks at most
    assert slides.min() > 1.5


def test_the_stiffness_of_the_plateau_is_the_presliding_stiffness(tmp_path):
    axis = servo_axis("linear motor")
    ramp = design_ramp(without_friction(axis), MS, rms=120, n_levels=18)
    nlfrf.save(ramp, tmp_path / "ramp.csv")
    play_experiment(axis, tmp_path / "ramp.csv", tmp_path / "trace.csv")
    levels = find_levels(load_trace(tmp_path / "trace.csv", ramp), ramp)
    sticks = np.array([state is FrictionRegime.STICKS for state in levels.states])
    plateau = levels.stiffness[sticks]
    assert np.allclose(plateau, axis.motor_friction.stiffness.sum(), rtol=0.05)
    asked = (levels.set_point_rms / levels.position_rms)[
        sticks
    ]  # a mass on a spring; the lowest are quantised
    assert np.allclose(asked[-3:], asked[-1], rtol=0.15)
    assert set(levels.rms) < set(levels.set_point_rms)
    assert str(levels).endswith("(slides)")


def judged(tmp_path, axis, ms=MS, **how):
    ramp = design_ramp(without_friction(axis), ms, **{"n_levels": 10} | how)
    nlfrf.save(ramp, tmp_path / "ramp.csv")
    play_experiment(axis, tmp_path / "ramp.csv", tmp_path / "trace.csv")
    return find_levels(load_trace(tmp_path / "trace.csv", ramp), ramp)


@pytest.mark.parametrize(
    ("how", "reason"),
    [
        (
            {"rms": 1.2, "span": 60},
            "the axis does not break away: its stiffness stays at .* N/m at .* N rms",
        ),
        (
            {"rms": 15, "span": 1000},
            "the axis does not slide yet: its stiffness still changes from .* to .* N/m",
        ),
        ({"rms": 150, "span": 10}, "no level sticks: .* raise --span|no readable level sticks"),
        (
            {"rms": 0.2, "span": 1000},
            "of [0-9]* levels can be read, 4 are needed: . move less than 2 steps of the encoder",
        ),
    ],
)
def test_a_ramp_that_does_not_show_all_three_says_why(tmp_path, how, reason):
    levels = judged(tmp_path, servo_axis("belt"), **how)
    assert levels.rms.size == len(levels.records) == 0
    assert re.search(reason, levels.reason), str(levels)


def test_levels_at_the_limit_of_the_current_are_not_read(tmp_path):
    axis = servo_axis("belt")
    tight = replace(axis, drive=replace(axis.drive, limit=200 / axis.force_constant))
    ramp = design_ramp(without_friction(axis), MS, rms=150, n_levels=10)
    nlfrf.save(ramp, tmp_path / "ramp.csv")
    play_experiment(tight, tmp_path / "ramp.csv", tmp_path / "trace.csv")
    with pytest.warns(DataWarning, match="u seems clipped"):
        records = load_trace(tmp_path / "trace.csv", ramp)
    levels = find_levels(records, ramp)
    assert levels.states[-1] is FrictionRegime.LIMITED


def test_an_axis_without_friction_has_no_levels(tmp_path):
    axis = without_friction(servo_axis("belt"))
    levels = judged(tmp_path, axis, rms=100)
    assert levels.reason.startswith("no readable level sticks: ")
    assert "friction holds" not in levels.reason
    small = [state is FrictionRegime.TOO_SMALL for state in levels.states]
    assert (
        small == (levels.position_rms < 2 * axis.resolution).tolist()
    )  # what it resolves is left open


@pytest.mark.parametrize(
    ("resolution", "said"),
    [
        (5e-8, "At [1-9] of 10 levels friction holds the axis within 2 steps of the encoder"),
        (1e-6, "no level sticks"),
    ],
)
def test_friction_that_is_stiffer_than_the_encoder_shows_is_not_looked_for_lower(
    tmp_path, resolution, said
):
    """Rigid friction holds the axis at all, and at no level that is seen."""
    rigid = nlfrf.friction.Coulomb(Fc=15.0, Fs=20.0, vs=0.01)
    axis = replace(servo_axis("linear motor"), motor_friction=rigid, resolution=resolution)
    levels = judged(tmp_path, axis, rms=60, span=1e4)
    assert re.search(said, levels.reason)
    assert "a finer encoder" in levels.reason
    assert "span" not in levels.reason


BACKLASH = {
    "m1": 7.0,
    "m2": 15.0,
    "k": 1.3e6,
    "c": 100.0,
    "kv": 30.0,
    "kp": 700.0,
    "tn": 0.05,
    "lag": 0.5e-3,
}
FRICTION = {"motor_K0": 2e6, "load_K0": 1e6, "load_Fs": 30.0}


def levels_with_play(tmp_path, **machine):
    drive = nlfrf.rig.Drive(
        kp_unit="N/(m/s)", fs=2000, kv=30, kp=700, tn=0.05, lag=0.5e-3, velocity_feedforward=1.0
    )
    rough = nlfrf.rig.ServoAxis(
        motor_inertia=7.0, load_inertia=15.0, stiffness=1.3e6, damping=100.0, drive=drive
    )
    ms = nlfrf.multisine(fs=2000, n_samples=1000, f_min=4, f_max=100, rng=1)
    ramp = design_ramp(rough, ms, rms=200, n_levels=14, span=3e3)
    u, y = play_backlash(ramp, **BACKLASH, **FRICTION, **machine)
    table = np.column_stack([np.arange(u.size) / 2000, u, np.round(y / 1e-7) * 1e-7])
    write_columns(tmp_path / "trace.csv", table, ["t [s]", "force set point [N]", "position [m]"])
    return find_levels(load_trace(tmp_path / "trace.csv", ramp), ramp)


def test_play_in_front_of_a_load_with_friction_is_seen(tmp_path):
    levels = levels_with_play(tmp_path, play=1e-4, motor_Fs=0.0)
    assert levels.reason.startswith("the stiffness rises with the level, from ")
    assert "backlash" in levels.reason
    assert levels_with_play(tmp_path, play=0.0, motor_Fs=0.0).reason == ""


def test_an_axis_that_vibrates_by_itself_is_not_taken_for_play(tmp_path):
    """On stiff bristles the loop is unstable: the axis vibrates by a micrometre, which makes dry
    friction viscous.
    """
    drive = nlfrf.rig.Drive(fs=1000, kv=35, kp=5222, kp_unit="N/(m/s)", tn=0.0185, lag=0.44e-3)
    machine = {"motor_inertia": 34.6, "motor_damping": 96.0, "drive": drive, "resolution": 2e-9}
    ms = nlfrf.multisine(fs=1000, n_samples=1000, f_min=3, f_max=120, rng=1)
    said = []
    for stiffness in (4.9e7, 4.9e5):
        axis = nlfrf.rig.ServoAxis(
            motor_friction=nlfrf.friction.Dahl(sigma0=stiffness, Fc=86.3), **machine
        )
        said.append(judged(tmp_path, axis, ms, rms=110, span=1e2, n_levels=7).reason)
        (tmp_path / "ramp.csv").unlink()
    assert said[0].startswith("below ")
    assert "may vibrate by itself" in said[0]
    assert "vibrates" not in said[1]
    assert "backlash" not in "".join(said)


def test_an_axis_that_drifts_is_not_said_to_vibrate(tmp_path):
    """With two periods a level, one whose integral part winds up."""
    gains = {
        "kv": 50.2,
        "kp": 204.2,
        "kp_unit": "N/(m/s)",
        "tn": 0.01616,
        "lag": 0.27e-3,
        "velocity_feedforward": 1.0,
    }
    slow = nlfrf.rig.ServoAxis(
        motor_inertia=1.256,
        motor_damping=3.49,
        drive=nlfrf.rig.Drive(fs=2000, **gains),
        resolution=3e-9,
        motor_friction=nlfrf.friction.Dahl(sigma0=5e6, Fc=4.9),
    )
    ms = nlfrf.multisine(fs=2000, n_samples=2000, f_min=3, f_max=100, rng=1)
    said = judged(tmp_path, slow, ms, rms=15, span=3e2, n_periods=2).reason
    assert re.search(
        r"its position drifts by \S+ m rms from period to period, .* raise --discard", said
    )
    assert "vibrates" not in said


@pytest.mark.attack
def test_an_axis_that_vibrates_is_not_said_to_drift(tmp_path):
    """At 190 Hz, with two periods a level."""
    fast = nlfrf.rig.ServoAxis(
        motor_inertia=34.6,
        motor_damping=96.0,
        drive=nlfrf.rig.Drive(fs=1000, kv=35, kp=5222, kp_unit="N/(m/s)", tn=0.0185, lag=0.44e-3),
        resolution=2e-9,
        motor_friction=nlfrf.friction.Dahl(sigma0=4.9e7, Fc=86.3),
    )
    ms = nlfrf.multisine(fs=1000, n_samples=1000, f_min=3, f_max=120, rng=1)
    said = judged(tmp_path, fast, ms, rms=110, span=1e2, n_levels=7, n_periods=2).reason
    assert "may vibrate by itself" in said
    assert "drifts" not in said


def test_play_behind_the_friction_of_the_motor_is_not_seen(tmp_path):
    """What the guide names as silent: the motor sticks first, so the stiffness falls as friction
    makes it fall.
    """
    assert levels_with_play(tmp_path, play=1e-4, motor_Fs=10.0).reason == ""


def test_what_is_no_ramp_is_refused(tmp_path):
    axis = without_friction(servo_axis("belt"))
    still = design_experiment(axis, MS, rms=20)
    with pytest.raises(
        ValueError, match="experiment must be a ramp of levels, got one with the parts at rest"
    ):
        find_levels([], still)
    ramp = design_ramp(axis, MS, rms=20)
    with pytest.raises(ValueError, match="records must be a list of at least one Record"):
        find_levels([], ramp)
