"""The most likely mistakes between the drive and the record: the table of docs/guide/axis.md, a row
a test.
"""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import nlfrf
from nlfrf import DataWarning, servo_axis
from nlfrf.io import load_trace
from robust.servo import design_experiment, play_experiment
from tests.robust.servo.experiment import test_levels
from tests.support.tables import write_columns

ROOT = Path(__file__).parents[3]
N = 2000
AXIS = servo_axis("belt")
ROUGH = replace(AXIS, motor_friction=None, load_friction=None)
FORCE, POSITION = "force set point [N]", "position [m]"


#: Row of the table in the guide -> the tests that show it.
ROWS = {
    "a set point of motion as u, with its unit": "test_a_set_point_of_motion_in_place_of_the_force",
    "the position set point as u, without a unit": (
        "test_the_position_set_point_in_place_of_the_force_without_units"
    ),
    "the velocity set point as u, without a unit": (
        "test_the_velocity_set_point_in_place_of_the_force_without_units"
    ),
    "the position set point as y": "test_the_position_set_point_in_place_of_the_position",
    "the velocity as y": "test_the_velocity_in_place_of_the_position",
    "wrong sign of the force": "test_a_wrong_sign",
    "wrong sign of the position": "test_a_wrong_sign_of_the_position",
    "a wrong unit, by a factor of 5 or more": "test_a_wrong_unit_factor",
    "another file, or another period": "test_a_wrong_period_or_another_file",
    "a wrong sampling frequency": "test_a_wrong_clock",
    "a trace sampled more slowly than the drive": "test_a_decimated_trace",
    "lost rows, by the time column": "test_lost_rows",
    "a trace that is too short": "test_a_trace_that_ends_too_early",
    "a trace that begins at another time": "test_a_trace_that_begins_somewhere_else",
    "current at its limit": "test_a_saturated_current",
    "a drive with another velocity feedforward": (
        "test_a_drive_without_the_feedforward_of_the_design_is_named"
    ),
    "a level at which friction changes the loop": (
        "test_a_level_so_low_that_friction_changes_the_loop"
    ),
    "an axis that moves backwards within a period": "test_an_axis_that_turns_back_in_motion",
    "backlash between motor and a load with friction": (
        "test_play_in_front_of_a_load_with_friction_is_seen"
    ),
}


def test_every_row_of_the_guide_is_tested():
    guide = (ROOT / "docs" / "guide" / "axis.md").read_text(encoding="utf-8")
    table = guide[guide.index("| mistake |") :].split("\n\n")[0]
    rows = [row.split("|")[1].strip() for row in table.splitlines()[2:]]
    assert rows == list(ROWS)
    assert set(ROWS.values()) <= set(dir(test_levels)) | set(globals())


class Run:
    """An experiment, its trace as a table, and what is read of a changed one."""

    def __init__(self, folder, **how):
        self.folder = folder
        ms = nlfrf.multisine(fs=4000, n_samples=N, f_min=10, f_max=250, rng=1)
        self.experiment = design_experiment(ROUGH, ms, rms=30, **how)
        nlfrf.save(self.experiment, folder / "play.csv")
        play_experiment(AXIS, folder / "play.csv", folder / "trace.csv")
        self.names, *rows = (folder / "trace.csv").read_text().splitlines()
        self.names = self.names.split(",")
        self.table = np.array([row.split(",") for row in rows], dtype=float)

    def read(self, *, change=None, names=None, rows=slice(None), **how):
        table, experiment = self.table.copy(), how.pop("experiment", self.experiment)
        if change:
            for name, factor in change.items():
                table[:, self.names.index(name)] *= factor
        write_columns(
            self.folder / "changed.csv",
            table[rows],
            [(names or {}).get(one, one) for one in self.names],
        )
        return load_trace(self.folder / "changed.csv", experiment, **how)


@pytest.fixture(scope="module")
def at_rest(tmp_path_factory):
    return Run(tmp_path_factory.mktemp("rest"))


@pytest.fixture(scope="module")
def in_motion(tmp_path_factory):
    return Run(tmp_path_factory.mktemp("motion"), base_velocity=0.15, strokes=1)


def without_units(run):
    return {name: name.split(" [")[0] for name in run.names if name != "t [s]"}


@pytest.fixture(params=["at_rest", "in_motion"])
def run(request):
    return request.getfixturevalue(request.param)


def test_what_was_traced_right_is_read_without_a_word(run):
    records = run.read()
    assert [record.u_unit for record in records] == ["N"] * len(run.experiment.labels)
    assert np.allclose(records[0].r[0, 0], run.experiment.ms.u[0])


def test_another_unit_that_the_file_names_is_no_fault(run):
    (meant, *_), (found, *_) = (
        run.read(),
        run.read(change={POSITION: 1e3}, names={POSITION: "position [mm]"}),
    )
    assert found.y_unit == "mm"
    assert np.allclose(found.y, 1e3 * meant.y, atol=1e-9)
    assert run.read(u="current set point")[0].u_unit == "A"


@pytest.mark.parametrize("u", ["position set point", "velocity set point", "velocity"])
def test_a_set_point_of_motion_in_place_of_the_force(run, u):
    with pytest.raises(
        ValueError, match=f"u must be the force, torque or current set point .*, got '{u}' in m"
    ):
        run.read(u=u)


def test_the_position_set_point_in_place_of_the_force_without_units(at_rest, in_motion):
    with pytest.raises(
        ValueError, match="u must be measured in the loop, got the multisine that was played"
    ):
        at_rest.read(u="position set point", names=without_units(at_rest))
    with pytest.raises(
        ValueError,
        match="path must be the trace of the played signal, got a force that agrees with",
    ):
        in_motion.read(u="position set point", names=without_units(in_motion))


def test_the_velocity_set_point_in_place_of_the_force_without_units(run):
    with pytest.warns(
        DataWarning, match="u is .* times the expected size, .* is it another signal"
    ):
        run.read(u="velocity set point", names=without_units(run))


def test_the_position_set_point_in_place_of_the_position(run):
    with pytest.raises(
        ValueError, match="y must be measured in the loop, got the multisine that was played"
    ):
        run.read(y="position set point")


def test_the_velocity_in_place_of_the_position(at_rest, in_motion):
    with pytest.warns(DataWarning, match="y is .* times the expected size, turned by [78]. deg"):
        at_rest.read(y="velocity")
    with pytest.raises(
        ValueError, match=r"y must move at 0\.15 m/s forward, as in the file, got .*e-"
    ):
        in_motion.read(y="velocity")


def test_a_wrong_sign(run):
    with pytest.warns(DataWarning, match="u has the sign opposite to the design"):
        run.read(change={FORCE: -1})


def test_a_wrong_sign_of_the_position(at_rest, in_motion):
    with pytest.warns(DataWarning, match="y has the sign opposite to the design"):
        at_rest.read(change={POSITION: -1})
    with pytest.raises(
        ValueError,
        match=r"y must move at 0\.15 m/s forward, as in the file, got -0\.15: turn its sign",
    ):
        in_motion.read(change={POSITION: -1})


@pytest.mark.parametrize("in_amperes", [False, True])
def test_a_drive_without_the_feedforward_of_the_design_is_named(tmp_path, in_amperes):
    """The factors are those of force and position in N and m, whatever the header has, and the
    drive is named first.
    """
    drive = replace(ROUGH.drive, velocity_feedforward=0.0)
    experiment = design_experiment(
        ROUGH,
        nlfrf.multisine(fs=4000, n_samples=N, f_min=4, f_max=250, rng=1),
        rms=60,
        base_velocity=0.15,
    )
    nlfrf.save(experiment, tmp_path / "play.csv")
    (tmp_path / "play.npz").rename(tmp_path / "design.npz")  # which would refuse this drive
    play_experiment(replace(ROUGH, drive=drive), tmp_path / "play.csv", tmp_path / "trace.csv")
    names, *rows = (tmp_path / "trace.csv").read_text().splitlines()
    table, names = np.array([row.split(",") for row in rows], dtype=float), names.split(",")
    if in_amperes:
        for k, scale, unit in (
            (names.index("force set point [N]"), 1 / ROUGH.force_constant, "A"),
            (2, 1e3, "mm"),
        ):
            table[:, k] *= scale
            names[k] = f"{names[k].partition(' [')[0]} [{unit}]"
    np.savetxt(
        tmp_path / "trace.csv",
        table,
        delimiter=",",
        header=",".join(names),
        comments="",
        fmt="%.12g",
    )
    with pytest.warns(DataWarning) as seen:
        records = load_trace(tmp_path / "trace.csv", tmp_path / "design.npz")
    texts = [str(one.message) for one in seen]
    found = [re.match(r"([uy]) is (\S+) times the expected size", text) for text in texts]
    z = np.exp(2j * np.pi * experiment.ms.f[-(experiment.ms.f.size // 3) :] / ROUGH.drive.fs)
    true = np.median(
        np.abs(ROUGH.drive.kv / (ROUGH.drive.kv + (1 - 1 / z) * ROUGH.drive.fs))
    )  # of what feeds the PI
    assert [one[1] for one in found] == ["u", "y"]
    assert [float(one[2]) for one in found] == pytest.approx([true, true], rel=0.06)
    assert all(
        "hardly counts: is it a drive with another velocity feedforward or other gains (assumed: "
        in text
        for text in texts
    )
    assert all("velocity_feedforward = 1" in text for text in texts)
    assert records[0].u_unit == ("A" if in_amperes else "N")


def test_at_rest_another_force_than_designed_has_a_category_of_its_own(tmp_path):
    experiment = design_experiment(
        ROUGH, nlfrf.multisine(fs=4000, n_samples=N, f_min=4, f_max=250, rng=1), rms=2
    )
    nlfrf.save(experiment, tmp_path / "play.csv")
    play_experiment(AXIS, tmp_path / "play.csv", tmp_path / "trace.csv")
    with pytest.warns(
        nlfrf.io.LevelWarning,
        match="friction, another machine, or a drive with another velocity feed",
    ):
        load_trace(tmp_path / "trace.csv", experiment)


def test_a_wrong_unit_factor(at_rest, in_motion):
    with pytest.warns(DataWarning, match="u is 0.00[0-9]* times .* in another unit than N"):
        at_rest.read(u="current set point", names=without_units(at_rest))
    with pytest.warns(DataWarning, match=r"y is 1.*e\+03 times .* in another unit than m"):
        at_rest.read(change={POSITION: 1e3})
    with pytest.raises(
        ValueError, match=r"y must move at 0\.15 m/s forward, as in the file, got 150: is y"
    ):
        in_motion.read(change={POSITION: 1e3})


def test_a_wrong_period_or_another_file(run):
    band = {"fs": 4000, "f_min": 10, "f_max": 250}
    other = replace(
        run.experiment,
        ms=design_experiment(ROUGH, nlfrf.multisine(n_samples=N, rng=2, **band), rms=30).ms,
    )
    with pytest.raises(
        ValueError,
        match="path must be the trace of the played signal, got a force that agrees with",
    ):
        run.read(experiment=other)
    motion = {"base_velocity": 0.15, "strokes": 1} if np.any(run.experiment.velocities) else {}
    longer = design_experiment(
        ROUGH, nlfrf.multisine(n_samples=N + 200, rng=1, **band), rms=30, **motion
    )
    with pytest.raises(
        ValueError,
        match="path must be the trace of the played signal, got a force that agrees with",
    ):
        run.read(experiment=longer)


def test_a_design_at_rest_and_a_trace_in_motion(at_rest, in_motion):
    with pytest.raises(
        ValueError,
        match=r"got a base velocity of 0 m/s and a position that moves by 0\.0[78]\d+ m a period",
    ):
        in_motion.read(experiment=at_rest.experiment)
    with pytest.raises(
        ValueError,
        match=r"got a base velocity of 0\.15 m/s and a position that moves by 0\.000\d+ m in all",
    ):
        at_rest.read(experiment=in_motion.experiment)


def test_a_wrong_clock(run):
    """The time column is doubled:

    2 kHz, of which half a period of the drive is one of the record.
    """
    with (
        pytest.raises(
            ValueError,
            match="path must be the trace of the played signal, got a force that agrees with",
        ),
        pytest.warns(DataWarning, match="the trace is sampled at 2000 Hz"),
    ):
        run.read(change={"t [s]": 2})


def test_a_decimated_trace(run):
    with pytest.warns(
        DataWarning, match="sampled at 1000 Hz and the drive at 4000 Hz: .* above 500 Hz are folded"
    ):
        records = run.read(rows=slice(None, None, 4))
    assert records[0].hold == "unknown"
    with pytest.raises(
        ValueError, match=r"fs must be above 492 Hz for lines up to 246 Hz, got 400 Hz"
    ):
        run.read(rows=slice(None, None, 10))
    with pytest.raises(ValueError, match=r"must hold the whole experiment, .* is fs right"):
        run.read(rows=slice(None, None, 4), change={"t [s]": 0.25})


def test_lost_rows(run):
    with pytest.raises(
        ValueError, match="path must be a trace without gaps, got time jumps by two samples"
    ):
        run.read(rows=np.delete(np.arange(len(run.table)), 5000))


def test_a_trace_that_ends_too_early(run):
    with pytest.raises(ValueError, match="path must hold the whole experiment"):
        run.read(rows=slice(0, 4500))


def test_a_trace_that_begins_somewhere_else(at_rest, in_motion):
    with pytest.raises(
        ValueError,
        match=r"or start must be the time at which it begins, got a force that is .* s late",
    ):
        at_rest.read(rows=slice(700, None))
    (late,) = at_rest.read(rows=slice(700, None), start=-700 / 4000)
    (whole,) = at_rest.read()
    assert np.array_equal(late.u, whole.u)
    with pytest.raises(ValueError, match=r"y must move at 0\.15 m/s forward, .* and start right"):
        in_motion.read(rows=slice(1500, None))


def test_a_trace_that_begins_long_before(at_rest):
    rows = np.concatenate([np.zeros(3 * N, dtype=int), np.arange(len(at_rest.table))])
    table = at_rest.table[rows]
    table[:, 0] = np.arange(rows.size) / 4000
    write_columns(at_rest.folder / "early.csv", table, at_rest.names)
    with pytest.raises(
        ValueError,
        match="path must begin with the played signal, or start must be the time at which it begins",
    ):
        load_trace(at_rest.folder / "early.csv", at_rest.experiment)
    (record,) = load_trace(at_rest.folder / "early.csv", at_rest.experiment, start=3 * N / 4000)
    assert np.array_equal(record.u, at_rest.read()[0].u)


def test_a_saturated_current(run, tmp_path):
    peak = run.experiment.peak_force
    tight = replace(AXIS, drive=replace(AXIS.drive, limit=0.5 * peak / AXIS.force_constant))
    play_experiment(tight, run.folder / "play.csv", tmp_path / "trace.csv")
    with pytest.warns(
        DataWarning, match="u seems clipped: .* Lower the amplitude, or widen the measuring range"
    ):
        load_trace(tmp_path / "trace.csv", run.experiment)


def test_a_level_so_low_that_friction_changes_the_loop(tmp_path):
    axis = servo_axis("linear motor")
    rough = replace(axis, motor_friction=None)
    experiment = design_experiment(
        rough, nlfrf.multisine(fs=4000, n_samples=4000, f_min=5, f_max=250, rng=1), rms=1.5
    )
    nlfrf.save(experiment, tmp_path / "play.csv")
    play_experiment(axis, tmp_path / "play.csv", tmp_path / "trace.csv")
    with pytest.warns(
        DataWarning, match="N rms at rest, not 1.5 as designed. .* this record as source"
    ):
        (record,) = load_trace(tmp_path / "trace.csv", experiment)
    again = design_experiment(
        record, nlfrf.multisine(fs=4000, n_samples=4000, f_min=5, f_max=240, rng=2), rms=1.5
    )
    nlfrf.save(again, tmp_path / "play2.csv")
    play_experiment(axis, tmp_path / "play2.csv", tmp_path / "trace.csv")
    (record,) = load_trace(tmp_path / "trace.csv", again)
    U = 2 / 4000 * np.abs(np.fft.rfft(record.u.mean(axis=(0, 1))))[record.lines.excited]
    assert np.isclose(np.sqrt(np.sum(U**2) / 2), 1.5, rtol=0.3)


def test_an_axis_that_turns_back_in_motion(tmp_path):
    slow = design_experiment(
        ROUGH,
        nlfrf.multisine(fs=4000, n_samples=N, f_min=10, f_max=250, rng=1),
        rms=10,
        base_velocity=0.05,
    )
    fast = replace(slow, ms=replace(slow.ms, amplitude=8 * slow.ms.amplitude))
    nlfrf.save(fast, tmp_path / "play.csv")
    play_experiment(AXIS, tmp_path / "play.csv", tmp_path / "trace.csv")
    with pytest.warns(DataWarning, match="the axis moves backwards in .* % of the samples forward"):
        load_trace(tmp_path / "trace.csv", fast)


def test_other_designs_are_sent_where_they_belong(at_rest):
    with pytest.raises(ValueError, match=r"got an experiment on a drive in .*: use load_trace"):
        nlfrf.load_record(
            at_rest.folder / "trace.csv",
            u="force set point",
            y="position",
            design=at_rest.folder / "play.npz",
        )
    nlfrf.save(at_rest.experiment.ms, at_rest.folder / "ms.npz")
    with pytest.raises(ValueError, match="path must hold an experiment on a drive, got "):
        load_trace(at_rest.folder / "trace.csv", at_rest.folder / "ms.npz")


def test_one_line_follows_whatever_was_played(tmp_path):
    """Steps from line to line were counted, and divided by: there are none."""
    one = nlfrf.multisine("full", fs=4000, n_samples=N, f_min=120, f_max=121, rng=1)
    assert one.lines.excited.size == 1
    experiment = design_experiment(ROUGH, one, rms=30)
    nlfrf.save(experiment, tmp_path / "play.csv")
    play_experiment(AXIS, tmp_path / "play.csv", tmp_path / "trace.csv")
    with pytest.warns(DataWarning, match="N rms at rest, not 30 as designed"):
        (record,) = load_trace(tmp_path / "trace.csv", experiment)
    assert record.lines.excited.tolist() == one.lines.excited.tolist()
