"""The design through the loop: spectra against the simulated axis without friction, limits,
files.
"""

import re
from dataclasses import replace

import numpy as np
import pytest

import nlfrf
from nlfrf import identify, multisine, servo_axis
from nlfrf.io import load_trace
from nlfrf.rig import run
from nlfrf.signals import AxisLimits
from robust.servo import design_experiment, design_ramp, play_experiment
from robust.servo.experiment.loop import closed_loop_poles

N = 2000
BAND = {"fs": 4000, "n_samples": N, "f_min": 4, "f_max": 300, "rng": 1}
MS = multisine(**BAND)
PRESETS = ("linear motor", "belt", "ball screw", "joint")
PORTS = ("position", "velocity", "force")


def free(name, **drive):
    axis = replace(servo_axis(name), motor_friction=None, load_friction=None, resolution=0.0)
    return replace(axis, drive=replace(axis.drive, **drive))


def plant_of(experiment):
    """FRF from force set point to position on the lines of an experiment, as its design has it."""
    return experiment.position_response / experiment.force_response


def spectrum(signal, begin, lines):
    return 2 / N * np.fft.rfft(signal[begin : begin + N])[lines]


@pytest.mark.attack(every=3)
@pytest.mark.parametrize(
    ("name", "port"),
    [*((name, "position") for name in PRESETS), ("belt", "velocity"), ("ball screw", "force")],
)
def test_the_spectrum_of_force_is_the_one_asked_for(name, port):
    axis = free(name)
    experiment = design_experiment(
        axis, multisine(**BAND, amplitude=lambda f: 1 / f), rms=20, port=port, n_discard=10
    )
    trace = run(axis, experiment.set_points(0), oversampling=4)
    lines, begin = experiment.ms.lines.excited, experiment.n_discard * N
    U, Y = (spectrum(one, begin, lines) for one in (trace.force_set, trace.position))
    asked = 1 / experiment.ms.f
    asked *= 20 / np.sqrt(np.sum(asked**2) / 2)
    assert np.allclose(np.abs(U), asked, rtol=1e-4)  # of the integration step
    assert np.allclose(Y / U, plant_of(experiment), rtol=1e-4)
    kept = slice(begin, begin + N)
    assert np.isclose(np.abs(trace.force_set[kept]).max(), experiment.peak_force, rtol=1e-4)
    assert np.isclose(np.ptp(trace.position[kept]), experiment.travel, rtol=1e-4)
    assert np.isclose(
        np.abs(np.gradient(trace.position[kept], 1 / axis.drive.fs)).max(),
        experiment.peak_velocity,
        rtol=0.02,
    )


@pytest.mark.parametrize(
    "drive",
    [
        {"delay_periods": 0.4, "lag": 0.0},
        {
            "delay_periods": 2.7,
            "velocity_lag": 1e-3,
            "velocity_feedforward": 0.3,
            "kp": 10.0,
            "kv": 10.0,
        },
        {"filters": [[0.2, 0.3, 0.1, 1.0, -0.6, 0.2]], "tn": np.inf},
    ],
)
def test_every_part_of_the_drive_is_in_the_transfer(drive):
    axis = free("belt", **drive)
    experiment = design_experiment(axis, MS, rms=20, n_discard=12)
    trace = run(axis, experiment.set_points(0), oversampling=4)
    U = spectrum(trace.force_set, experiment.n_discard * N, experiment.ms.lines.excited)
    assert np.allclose(np.abs(U), experiment.force_amplitude, rtol=1e-4)


def test_a_slower_position_loop_is_taken_as_its_mean():
    axis = free("belt", position_every=4)
    experiment = design_experiment(axis, MS, rms=20, n_discard=12)
    trace = run(axis, experiment.set_points(0))
    U = spectrum(trace.force_set, experiment.n_discard * N, experiment.ms.lines.excited)
    assert np.allclose(np.abs(U), experiment.force_amplitude, rtol=0.03)


def test_phases_stay_random_on_a_special_odd_grid():
    experiment = design_experiment(
        servo_axis("belt"), multisine(**BAND, n_realizations=200), rms=20
    )
    plain = multisine(**BAND, n_realizations=200)
    assert experiment.ms.lines.kind == "special-odd"
    assert np.array_equal(experiment.ms.phase, plain.phase)


@pytest.mark.parametrize(
    ("limits", "which"),
    [
        (AxisLimits(force=30), "peak_force"),
        (AxisLimits(velocity=0.01), "peak_velocity"),
        (AxisLimits(travel=2e-4), "travel"),
    ],
)
def test_without_a_level_the_limit_is_reached_and_not_passed(limits, which):
    experiment = design_experiment(
        servo_axis("belt"), multisine(**BAND, n_realizations=3), limits=limits
    )
    limit = next(one for one in (limits.force, limits.velocity, limits.travel) if np.isfinite(one))
    assert np.isclose(getattr(experiment, which), limit)


def test_in_motion_the_multisine_never_turns_the_axis_back():
    axis = servo_axis("belt")
    experiment = design_experiment(
        axis, MS, base_velocity=0.1, strokes=1, limits=AxisLimits(velocity=1)
    )
    trace = run(axis, experiment.set_points(0))
    forward = slice(experiment.n_discard * N, experiment.block)
    assert trace.v[0, forward].min() > -1e-3
    assert np.isclose(np.ptp(experiment.base), 0.1 * experiment.block / 4000, rtol=0.05)
    assert np.abs(trace.position).max() < experiment.travel
    assert np.abs(trace.force_set).max() < 1.1 * experiment.peak_force


def test_the_base_motion_begins_and_ends_at_rest_without_a_jump():
    experiment = design_experiment(servo_axis("belt"), MS, base_velocity=0.1, strokes=2, rms=20)
    velocity = np.diff(experiment.base) * 4000
    played = experiment.set_points(0)["position"]
    assert np.abs(np.diff(velocity)).max() < 1.01 * 0.2 * np.pi / 2 / (
        N // 4
    )  # slope of a cosine from -0.1 to 0.1
    assert abs(played[0]) < 1e-6
    assert abs(played[-1] - experiment.base[-1]) < 1e-6
    assert abs(experiment.base[-1]) < 0.1 * N / 4000


def test_a_measured_loop_gives_the_spectrum_too():
    axis = free("belt")
    first = design_experiment(replace(axis, motor_inertia=12.0), MS, rms=2, n_discard=10)
    trace = run(axis, first.set_points(0), oversampling=4)
    kept = slice(10 * N, 12 * N)
    u, y = (one[kept].reshape(1, 2, N) for one in (trace.force_set, trace.position))
    record = nlfrf.Record(
        u=u, y=y, r=np.tile(first.ms.u[:, None], (1, 2, 1)), fs=4000, lines=first.ms.lines
    )
    second = design_experiment(
        record, multisine(fs=4000, n_samples=N, f_min=6, f_max=290, rng=2), rms=20, n_discard=10
    )
    trace = run(axis, second.set_points(0), oversampling=4)
    U = spectrum(trace.force_set, 10 * N, second.ms.lines.excited)
    assert np.allclose(np.abs(U), second.force_amplitude, rtol=1e-3)
    frf = plant_of(design_experiment(axis, MS, rms=2))
    bla = nlfrf.bla_from_frf(first.ms.f, frf, std=1e-9, fs=4000, hold="zoh")
    by_bla = design_experiment(
        (axis, bla), multisine(fs=4000, n_samples=N, f_min=6, f_max=290, rng=2), rms=20
    )
    assert np.allclose(by_bla.ms.amplitude, second.ms.amplitude, rtol=1e-3)
    with pytest.raises(
        ValueError, match="f_min and f_max must be within the lines of the record, 6 to 294 Hz"
    ):
        design_experiment(record, multisine(fs=4000, n_samples=N, f_min=2, f_max=290), rms=20)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (
            {"rms": 500, "limits": AxisLimits(force=100)},
            "rms must be at most .* N within the limits, got 500 N: force would peak",
        ),
        (
            {"rms": 20, "limits": AxisLimits(travel=1e-5)},
            "got 20 N: travel would peak at .*, above 1e-05 m",
        ),
        ({}, "rms must be given without limits"),
        (
            {"base_velocity": 0.1, "rms": 500},
            "velocity would peak at .*, above 0.1 m/s left by the base motion",
        ),
        (
            {"base_velocity": 0.1, "limits": AxisLimits(travel=0.05)},
            "base_velocity or the length of the strokes must be smaller for a travel of at most 0.05 m",
        ),
        ({"base_velocity": 0.1, "limits": AxisLimits(force=5)}, "the base motion alone needs .* N"),
        ({"strokes": 2, "rms": 1}, "base_velocity must not be zero with strokes"),
        ({"rms": 1, "port": "current"}, "port must be"),
        ({"rms": 1, "n_discard": 0}, "n_discard must be a whole number of at least 1"),
    ],
)
def test_what_cannot_fit_is_refused_with_its_number(more, message):
    with pytest.raises(ValueError, match=message):
        design_experiment(servo_axis("belt"), MS, **more)


def test_sources_that_do_not_fit():
    record = nlfrf.Record(
        u=np.ones((1, 1, 8)) * np.arange(8),
        y=np.ones((1, 1, 8)) * np.arange(8),
        fs=1,
        lines=nlfrf.signals.LineGrid(excited=[1]),
    )
    with pytest.raises(ValueError, match="source must be of type ServoAxis or Record, got 1"):
        design_experiment(1.0, MS, rms=1)
    with pytest.raises(ValueError, match="with its reference r, got one without"):
        design_experiment(record, multisine(fs=1, n_samples=8, f_min=0.1, f_max=0.2), rms=1)
    with pytest.raises(
        ValueError, match="ms must be sampled as the source is, at 1 Hz, got 4000 Hz"
    ):
        design_experiment(record, MS, rms=1)
    with pytest.raises(ValueError, match="ms must be of type Multisine, got 1"):
        design_experiment(servo_axis("belt"), 1.0, rms=1)
    with pytest.raises(ValueError, match="ms must have one realisation, got 2"):
        design_ramp(servo_axis("belt"), multisine(**BAND, n_realizations=2), rms=1)
    with pytest.raises(ValueError, match="span must be above 1"):
        design_ramp(servo_axis("belt"), MS, rms=1, span=0.5)
    with pytest.raises(ValueError, match="force must be"):
        AxisLimits(force=-1)


# ---- Files: what is written is what is played, and what is read is what was traced.


@pytest.mark.parametrize("port", PORTS)
def test_the_design_survives_its_file(tmp_path, port):
    experiment = design_experiment(
        servo_axis("joint"), MS, base_velocity=0.5, strokes=1, rms=3, port=port
    )
    nlfrf.save(experiment, tmp_path / "play.csv")
    again = nlfrf.load(tmp_path / "play.npz")
    for name in ("force_response", "position_response", "gains", "velocities"):
        assert np.array_equal(getattr(again, name), getattr(experiment, name))
    assert np.array_equal(again.ms.u, experiment.ms.u)
    assert (again.port, again.force_unit, again.position_unit) == (port, "Nm", "rad")
    header = (tmp_path / "play.csv").read_text().split("\n", 1)[0]
    assert (
        header
        == {
            "position": "t [s],position [rad]",
            "velocity": "t [s],position [rad],velocity [rad/s]",
            "force": "t [s],position [rad],force [Nm]",
        }[port]
    )
    assert str(experiment) in str(nlfrf.inspect_file(tmp_path / "play.npz"))


@pytest.mark.parametrize("suffix", [".npz", ".h5"])
def test_a_file_has_the_assumed_drive_or_none(tmp_path, suffix):
    by_model = design_experiment(servo_axis("belt"), MS, rms=3)
    for experiment in (by_model, replace(by_model, assumed_drive=None)):
        path = tmp_path / f"{experiment.assumed_drive is None}{suffix}"
        nlfrf.save(experiment, path)
        again = nlfrf.load(path)
        assert str(again) == str(experiment)
        assert (again.assumed_drive is None) == (experiment.assumed_drive is None)
    assert "the same as in the first record" in str(again)


@pytest.mark.parametrize("name", PRESETS)
def test_from_the_design_to_the_frf_of_either_direction(tmp_path, name):
    """In motion the friction is a constant and a damping: the FRF is that of the machine without
    friction.
    """
    axis = servo_axis(name)
    velocity, rms = {"joint": (0.5, 5), "ball screw": (0.05, 300)}.get(name, (0.15, 30))
    ms = multisine(**BAND | {"f_min": 10})
    experiment = design_experiment(free(name), ms, rms=rms, base_velocity=velocity, strokes=1)
    nlfrf.save(experiment, tmp_path / "play.csv")
    play_experiment(axis, tmp_path / "play.csv", tmp_path / "trace.csv")
    records = load_trace(tmp_path / "trace.csv", tmp_path / "play.npz")
    assert experiment.labels == ("forward", "backward")
    means = [record.u.mean() for record in records]
    assert means[0] > 0 > means[1]  # friction
    for record in records:
        U = 2 / N * np.abs(np.fft.rfft(record.u.mean(axis=(0, 1))))[record.lines.excited]
        assert np.allclose(U, experiment.force_amplitude, rtol=0.02)
        G = np.fft.rfft(record.y.mean(axis=(0, 1)))[record.lines.excited]
        G = G / np.fft.rfft(record.u.mean(axis=(0, 1)))[record.lines.excited]
        assert np.allclose(G, plant_of(experiment), rtol=0.03, atol=0.003 * np.abs(G).max())
        assert (record.hold, record.u_name, record.y_name) == ("zoh", "force set point", "position")
        assert (record.y_unit, record.u_unit) == axis.units


def test_realisations_are_files_and_are_found_in_any_order(tmp_path):
    axis = free("linear motor")
    ms = multisine(fs=4000, n_samples=1000, f_min=10, f_max=200, n_realizations=3, rng=1)
    experiment = design_experiment(axis, ms, rms=10, n_discard=6)
    nlfrf.save(experiment, tmp_path / "play.csv")
    for m in (1, 2, 3):
        play_experiment(axis, tmp_path / f"play-{m}.csv", tmp_path / f"trace-{m}.csv")
    (record,) = load_trace([tmp_path / f"trace-{m}.csv" for m in (3, 1, 2)], experiment)
    assert record.u.shape == (3, 2, 1000)
    assert np.allclose(record.r[:, 0], experiment.ms.u)
    assert np.allclose(identify(record).G, plant_of(experiment), rtol=1e-4)
    with pytest.raises(ValueError, match="path must be one trace per realisation, 3, got 1"):
        load_trace(tmp_path / "trace-1.csv", experiment)
    with pytest.raises(ValueError, match="agrees with realisation"):
        load_trace([tmp_path / f"trace-{m}.csv" for m in (1, 1, 2)], experiment)
    head, *rows = (tmp_path / "trace-2.csv").read_text().splitlines()
    (tmp_path / "slower.csv").write_text("\n".join([head, *rows[::2]]) + "\n")
    with pytest.raises(ValueError, match="one sampling frequency, got 4000 and 2000 Hz"):
        load_trace(
            [tmp_path / name for name in ("trace-1.csv", "slower.csv", "trace-3.csv")], experiment
        )


def test_what_the_simulated_axis_does_not_play(tmp_path):
    axis, play, out = servo_axis("belt"), tmp_path / "play.csv", tmp_path / "trace.csv"
    t = np.arange(8) / 4000

    def table(*columns):
        names = ",".join(["t [s]", *columns])
        play.write_text(
            "\n".join([names, *(",".join(map(str, [one] + [0.0] * len(columns))) for one in t)])
        )

    table("speed")
    with pytest.raises(
        ValueError, match="path must hold set points called force, velocity, position, got none"
    ):
        play_experiment(axis, play, out)
    table("position [mm]")
    with pytest.raises(ValueError, match="path must have its position in m, the unit of the axis"):
        play_experiment(axis, play, out)
    table("position [m]")
    with pytest.raises(ValueError, match=r"out must end in \.csv"):
        play_experiment(axis, play, tmp_path / "trace.mat")
    slow = replace(axis, drive=replace(axis.drive, fs=1000))
    with pytest.raises(
        ValueError, match="path must be sampled as the drive is, at 1000 Hz, got 4000 Hz"
    ):
        play_experiment(slow, play, out)


@pytest.mark.parametrize("realizations", [1, 2])
def test_a_drive_with_other_gains_than_its_design_is_not_played(tmp_path, realizations):
    axis = servo_axis("belt")
    ms = multisine(fs=4000, n_samples=400, f_min=50, f_max=300, n_realizations=realizations, rng=1)
    nlfrf.save(design_experiment(axis, ms, rms=5), tmp_path / "play.csv")
    file = tmp_path / ("play.csv" if realizations == 1 else "play-2.csv")
    other = replace(axis, drive=replace(axis.drive, kv=60))
    with pytest.raises(
        ValueError,
        match=r"gains of the design in 'play.npz', kv = 30 1/s, kp = 33 .* got kv = 60 1/s",
    ):
        play_experiment(other, file, tmp_path / "t.csv")
    assert not (tmp_path / "t.csv").exists()
    play_experiment(axis, file, tmp_path / "t.csv")
    (tmp_path / "play.npz").unlink()
    np.savez(tmp_path / "play.npz", u=np.zeros(3))  # of the same name, and no design
    play_experiment(other, file, tmp_path / "t.csv")


def test_a_trace_ends_where_a_limit_is_passed(tmp_path):
    axis = servo_axis("linear motor")
    ms = multisine(fs=4000, n_samples=1000, f_min=8, f_max=200, rng=1)
    ramp = design_ramp(free("linear motor"), ms, rms=100, n_levels=8)
    nlfrf.save(ramp, tmp_path / "play.csv")
    play_experiment(
        axis, tmp_path / "play.csv", tmp_path / "trace.csv", limits=AxisLimits(travel=1e-4)
    )
    records = load_trace(tmp_path / "trace.csv", ramp)
    assert 3 <= len(records) < 8
    assert all(np.ptp(record.y) <= 1e-4 for record in records)


LOOPS = [
    {},
    {"position_every": 4},
    {"delay_periods": 2.7, "velocity_lag": 1e-3},
    {"filters": [[0.2, 0.3, 0.1, 1.0, -0.6, 0.2]], "lag": 0.0},
]


@pytest.mark.parametrize("drive", LOOPS)
@pytest.mark.parametrize("name", ["belt", "joint"])
def test_a_kick_decays_or_grows_as_the_poles_of_the_loop_say(name, drive):
    axis = free(name, limit=np.inf, **drive)
    force = np.zeros(7000)
    force[0] = 1.0
    x = np.abs(run(axis, {"force": force}, oversampling=4).position)
    rate = (x[6000:].max() / x[5000:6000].max()) ** (1 / 1000)
    largest = np.abs(closed_loop_poles(axis)).max() ** (1 / axis.drive.position_every)
    assert np.isclose(rate, largest, rtol=0, atol=1e-4)


def test_crossover_of_a_mass_under_a_velocity_loop():
    """Without position loop, reset time, delay and lag |L| is kp K / (m omega), a sampled
    integrator.
    """
    axis = free("linear motor", kv=0.0, tn=np.inf, lag=0.0, delay_periods=0.0, kp=10.0)
    axis = replace(axis, motor_damping=0.0)
    above = multisine(**BAND | {"f_min": 40})
    with pytest.warns(nlfrf.DataWarning, match="far outside the lines of 50 to") as warned:
        design_experiment(axis, above, rms=5)
    crossover = float(re.search(r"crosses over at ([\d.]+) Hz", str(warned[0].message))[1])
    assert np.isclose(crossover, 10.0 * 52.8 / 12.0 / (2 * np.pi), rtol=0.01)
    still = replace(axis, drive=replace(axis.drive, kp=0.0))
    with pytest.warns(nlfrf.DataWarning, match="crosses over nowhere, far outside the lines"):
        design_experiment(still, above, rms=5, port="force")


@pytest.mark.parametrize(
    ("axis", "message"),
    [
        (
            free("linear motor", kp=1500.0),
            "is unstable without friction, so the computed peaks and set points",
        ),
        (
            free("linear motor", torque_constant=0.0528),
            "is unstable without friction, so the computed peaks and set points",
        ),
        (
            free("linear motor", kp=1.43, kv=1.0, tn=0.4),
            r"crosses over at 1[\d.]+ Hz, far outside the lines of 6",
        ),
        (
            free("linear motor", tn=12.0),
            "tn = 12 s is longer than the period of 0.5 s: .*it is in seconds",
        ),
    ],
)
@pytest.mark.filterwarnings("ignore::nlfrf.DataWarning")
def test_gains_and_machines_that_the_loop_shows_to_be_wrong_are_warned_of(axis, message):
    with pytest.warns(nlfrf.DataWarning, match=message):
        design_experiment(axis, MS, rms=5)
