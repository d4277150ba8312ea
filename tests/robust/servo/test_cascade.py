"""A drive as one controller: the simulated axis without friction is the loop of `cascade` with its
linear plant.
"""

from dataclasses import replace

import control
import numpy as np
import pytest
from scipy.signal import lfilter

import nlfrf
import robust
from nlfrf.rig import Drive
from robust.servo import cascade, design_experiment
from robust.servo.gains.p_pi import with_set_point
from tests.support.linear_axis import PRESETS, frictionless, linear_plant, settings_of

HZ = 2 * np.pi  # rad/s

FS = 4000.0
BASE = {"fs": FS, "kv": 60.0, "kp": 30.0, "kp_unit": "A/(m/s)"}


def at(K, f):
    return np.asarray(K(np.exp(2j * np.pi * np.asarray(f) / FS)))


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize(
    "more",
    [{}, {"velocity_lag": 0.4e-3}, {"delay_periods": 1.5}],
    ids=["plain", "low-pass", "delay"],
)
def test_the_loop_is_that_of_the_simulated_axis_without_friction(preset, more):
    slots = (
        robust.tuning.LowPass(omega=HZ * 900.0),
        robust.tuning.Notch(omega=HZ * 300.0, width=60.0 / 300.0, depth=0.2),
    )
    axis = frictionless(preset, filters=np.array([slot.section(FS) for slot in slots]), **more)
    settings = settings_of(axis, filters=slots)
    force = 10 * np.random.default_rng(3).standard_normal(3000)
    trace = nlfrf.rig.run(axis, {"position": np.zeros(3000), "force": force}, oversampling=4)
    G = robust.sampled(linear_plant(axis), settings.dt, settings.delay)
    y = control.forced_response(
        control.feedback(G, cascade(settings, output_unit=axis.units[1])), inputs=force
    )
    assert (
        np.abs(y.outputs - trace.position).max() < 5e-6 * np.abs(trace.position).max()
    )  # the steps of the integrator


def test_load_encoder_and_set_point():
    axis = frictionless("belt", encoder="load", kp=12.0, kv=10.0, velocity_lag=2e-3)
    settings = settings_of(axis, velocity_feedforward=0.6)
    axis = replace(axis, drive=replace(axis.drive, velocity_feedforward=0.6))
    r = np.cumsum(np.random.default_rng(1).standard_normal(2000)) * 1e-5
    r[0] = 0.0
    trace = nlfrf.rig.run(axis, r, oversampling=4)
    G = robust.sampled(linear_plant(axis), settings.dt, settings.delay)
    drive, y, x = with_set_point(settings, output_unit="N"), [], np.zeros(G.nstates)
    xd = np.zeros(drive.nstates)
    for set_point in r:  # the loop, sample by sample
        y.append((G.C @ x).item())
        seen = np.array([set_point, y[-1]])
        u = drive.C @ xd + drive.D @ seen
        xd, x = drive.A @ xd + drive.B @ seen, G.A @ x + G.B @ u
    assert 1e-4 < np.abs(trace.position).max() < 1e-2
    assert np.abs(y - trace.position).max() < 5e-6 * np.abs(trace.position).max()


def test_two_encoders_are_two_inputs():
    axis = frictionless("belt")
    settings = settings_of(axis, encoder="both", position_unit="mm", load_unit="um")
    K = cascade(settings, output_unit="N")
    assert (K.input_labels, K.output_labels) == (["motor", "load"], ["force"])
    alone = cascade(settings_of(axis), output_unit="N")  # both see one position: one encoder
    assert K(1j) @ np.array([1e3, 1e6]) == pytest.approx(alone(1j), rel=1e-12)
    velocity = cascade(settings_of(axis, kv=0.0), output_unit="N")
    assert K(1j)[0, 0] * 1e3 == pytest.approx(velocity(1j), rel=1e-12)


def test_closed_form_of_the_plain_cascade():
    settings = Drive(**BASE, tn=0.02)
    z = np.exp(2j * np.pi * np.array([3.0, 70.0, 900.0]) / FS)
    wanted = 30 * (1 + 1 / FS / 0.02 / (z - 1)) * (FS * (1 - 1 / z) + 60)
    assert np.allclose(cascade(settings)(z), wanted, rtol=1e-12)


def test_slow_loop_tends_to_the_continuous_cascade():
    s = 2j * np.pi * 0.5
    K = at(cascade(Drive(**BASE, tn=0.02)), [0.5])[0]
    assert pytest.approx(30 * (s + 50) * (s + 60) / s, rel=2e-3) == K


def test_observer_and_low_pass_are_velocities():
    f = np.array([5.0, 100.0, 700.0])
    observed = cascade(Drive(**{**BASE, "kv": 0.0}, observer_frequency=300.0))
    s = 2 * np.pi * 300 / np.tan(np.pi * 300 / FS) * 1j * np.tan(np.pi * f / FS)
    assert np.allclose(at(observed, f), 30 * s / (s / (2 * np.pi * 300) + 1) ** 2, rtol=1e-9)
    smooth = cascade(Drive(**{**BASE, "kv": 0.0}, velocity_lag=1e-3))
    q = np.exp(-2j * np.pi * f / FS)
    assert np.allclose(at(smooth, f), 30 * FS * (1 - q) * 0.2 / (1 - 0.8 * q), rtol=1e-9)


def test_a_slow_position_loop_is_said_to_be_a_mean():
    settings = Drive(**{**BASE, "kp": 1.0}, position_every=4)
    with pytest.warns(
        robust.DesignWarning, match="^the position loop runs once in 4 periods.*approximation"
    ):
        K = cascade(settings)
    z = np.exp(2j * np.pi * 200 / FS)
    assert K(z) == pytest.approx(FS * (1 - 1 / z) + 60 * np.mean(z ** -np.arange(4.0)))


def test_the_mean_is_the_response_of_the_simulated_drive_averaged_over_its_phase():
    axis = frictionless("linear motor", position_every=4)
    settings = settings_of(axis)
    with pytest.warns(robust.DesignWarning, match="position loop runs"):
        K = cascade(settings, output_unit="N")
    G = robust.sampled(linear_plant(axis), settings.dt, settings.delay)
    hit = np.zeros((4, 800))
    hit[np.arange(4), np.arange(4)] = 100.0
    runs = [
        nlfrf.rig.run(axis, {"position": np.zeros(800), "force": force}).position for force in hit
    ]
    mean = np.mean([run[k : 700 + k] for k, run in enumerate(runs)], axis=0)
    y = control.forced_response(control.feedback(G, K), inputs=hit[0]).outputs[:700]
    # an approximation: of second order in the change of K over its phase
    assert 1e-6 < np.abs(y - mean).max() / np.abs(y).max() < 0.05


def test_the_actuator_is_delay_and_lag():
    settings = Drive(**BASE, lag=0.5e-3, delay_periods=1.25)
    f = np.array([1.0, 5.0])
    ratio = at(cascade(settings, actuator=True), f) / at(cascade(settings), f)
    # a hold of half a period comes with the samples of the current
    late = 1.25 / FS + 0.5e-3 + 0.5 / FS
    assert np.angle(ratio) == pytest.approx(-2 * np.pi * f * late, rel=1e-3)
    assert np.abs(ratio) == pytest.approx(1, rel=1e-3)
    alone = cascade(Drive(**BASE, delay_periods=2.0), actuator=True)
    assert at(alone, f) == pytest.approx(
        at(cascade(Drive(**BASE)), f) * np.exp(-2j * np.pi * f * 2 / FS)
    )


@pytest.mark.parametrize(
    ("unit", "kp", "position_unit", "factor"),
    [
        ("A s/m", 30.0, "mm", 1e-3),
        ("A/(mm/s)", 0.03, "m", 1.0),
        ("A/(rad/s)", 30.0, "deg", np.pi / 180),
        ("A/rpm", 30 * 2 * np.pi / 60, "rad", 1.0),
        ("mA s/m", 3e4, "um", 1e-6),
    ],
)
def test_units_are_factors(unit, kp, position_unit, factor):
    settings = Drive(fs=FS, kv=60, kp=kp, kp_unit=unit, position_unit=position_unit)
    assert cascade(settings)(1j) == pytest.approx(cascade(Drive(**BASE))(1j) * factor, rel=1e-12)


def test_counts_and_forces():
    base = {"fs": FS, "kv": 60, "kp": 2.0, "kp_unit": "Nm/(rad/s)", "torque_constant": 0.5}
    K = cascade(Drive(**base))
    counts = Drive(**base, position_unit="counts", unit_factor=2 * np.pi / 2**20)
    assert cascade(counts)(1j) == pytest.approx(K(1j) * 2 * np.pi / 2**20)
    amperes = cascade(counts, output_unit="A")
    assert amperes.output_labels == ["current"]
    assert amperes(1j) == pytest.approx(cascade(counts, output_unit="Nm")(1j) / 0.5)


def test_filters_run_as_scipy_runs_them():
    x = np.random.default_rng(0).standard_normal(200)
    slots = (
        robust.tuning.Notch(omega=HZ * 83, width=20 / 83, depth=0.0),
        robust.tuning.LowPass(omega=HZ * 500),
        robust.tuning.Biquad(omega=HZ * 80, zeta=0.5, numerator_omega=HZ * 47, numerator_zeta=0),
    )
    plain = control.forced_response(cascade(Drive(**BASE)), inputs=x).outputs
    for slot in slots:
        section = slot.section(FS)
        y = control.forced_response(cascade(Drive(**BASE, filters=(slot,))), inputs=x).outputs
        assert np.allclose(
            y, lfilter(section[:3], section[3:], plain), rtol=1e-9, atol=1e-9 * np.abs(y).max()
        )


def test_filters_are_exact_where_they_act():
    H = robust.tuning.Notch(omega=HZ * 83.0, width=20.0 / 83.0, depth=0.0).section(FS)
    q = np.exp(-2j * np.pi * np.array([83.0, 83.0 * 1.2]) / FS)
    gain = np.abs(np.polyval(H[2::-1], q) / np.polyval(H[:2:-1], q))
    assert gain[0] < 1e-9 < 0.5 < gain[1]
    half = robust.tuning.Notch(omega=HZ * 200.0, width=0.2 / 200.0, depth=0.0)
    edges = np.array([200.0 - 0.1, 200.0 + 0.1])
    b, a = half.section(FS).reshape(2, 3)
    q = np.exp(-2j * np.pi * edges / FS)
    assert np.abs(np.polyval(b[::-1], q) / np.polyval(a[::-1], q)) == pytest.approx(
        np.sqrt(0.5), rel=1e-2
    )


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize(
    "more", [{}, {"velocity_lag": 0.4e-3, "position_every": 4}], ids=["plain", "slow"]
)
@pytest.mark.filterwarnings("ignore:the position loop runs once")
def test_the_experiment_and_the_controller_are_of_one_loop(preset, more):
    """What reaches the force of a port, as an experiment is designed, is that of the state space:

    G C/(1 + G C).
    """
    axis = frictionless(preset, filters=(robust.tuning.Notch(omega=HZ * 300.0, depth=0.2),), **more)
    ms = nlfrf.multisine(fs=axis.drive.fs, n_samples=4000, f_min=3, f_max=700, rng=1)
    f, rng = ms.f, np.random.default_rng(0)
    G = 1e-6 * (rng.standard_normal(f.size) + 1j * rng.standard_normal(f.size))
    plant = nlfrf.bla_from_frf(f, G, std=1e-9, fs=axis.drive.fs, hold="zoh")
    fed = replace(axis, drive=replace(axis.drive, velocity_feedforward=0.7))
    systems = (
        cascade(axis.drive, output_unit=axis.units[1]),
        with_set_point(fed.drive, output_unit=axis.units[1]),
    )
    z = np.exp(2j * np.pi * f * axis.drive.dt)
    C, r = (system(z, squeeze=False)[0, 0] for system in systems)
    for one, port, wanted in ((axis, "force", 1 / (1 + G * C)), (fed, "position", r / (1 + G * C))):
        found = design_experiment((one, plant), ms, rms=1.0, port=port).force_response
        assert found == pytest.approx(wanted, rel=1e-9)


def test_a_loop_of_two_encoders_is_checked():
    axis = frictionless("belt")
    settings = settings_of(axis, encoder="both")
    K = cascade(settings, output_unit="N")
    G = robust.sampled(linear_plant(axis, sensors=("motor", "load")), settings.dt, settings.delay)
    poles = control.feedback(G, K).poles()
    moving = nlfrf.rig.run(frictionless("belt"), np.zeros(3000), initial=(0.0, 0.01))
    assert np.abs(poles).max() < 1
    assert not moving.diverged


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"kp": -1.0}, "kp must be zero or positive, got -1"),
        ({"kv": -1.0}, "kv must be zero or positive, got -1"),
        ({"tn": 0.0}, "tn must be positive, got 0"),
        ({"kp_unit": "V/(m/s)"}, "kp_unit must be current or force over velocity.*got 'V/"),
        ({"kp_unit": "A"}, "kp_unit must be current or force over velocity"),
        ({"encoder": "none"}, "encoder must be one of 'motor', 'load', 'both', got 'none'"),
        ({"observer_frequency": 0.0}, "observer_frequency must be positive, got 0"),
        ({"position_every": 0}, "position_every must be a whole number of at least 1, got 0"),
        (
            {"position_unit": "counts"},
            "unit_factor must be given, got none: the position is measured in counts",
        ),
        (
            {"position_unit": "deg"},
            "unit_factor must be given, .* uses m/s. Give the number of m in one deg",
        ),
        (
            {"filters": (robust.tuning.LowPass(omega=HZ * 2500.0),)},
            r"half the sampling frequency, .* \(2000 Hz\), got .* \(2500 Hz\)",
        ),
        ({"filters": [1.0]}, "filters must have 2 axes"),
        ({"velocity_feedforward": 2.0}, "velocity_feedforward must lie between 0 and 1, got 2"),
    ],
)
def test_refusals(change, message):
    with pytest.raises(ValueError, match=message):
        Drive(**BASE | change)


def test_refusals_of_the_controller_and_the_filters():
    with pytest.raises(
        ValueError, match=r"torque_constant must be given \[N/A\] between A and N, got none"
    ):
        cascade(Drive(**BASE), output_unit="N")
    with pytest.raises(
        ValueError, match=r"output_unit must be A or N for a velocity loop in A/.*got 'Nm'"
    ):
        cascade(Drive(**BASE), output_unit="Nm")
    with pytest.raises(ValueError, match="settings must be of type Drive, got 1"):
        cascade(1)
    with pytest.raises(ValueError, match="depth must be zero or positive, got -1"):
        robust.tuning.Notch(omega=HZ * 80, depth=-1.0)
    with pytest.raises(ValueError, match="width must be positive, got 0"):
        robust.tuning.Notch(omega=HZ * 80, width=0.0)
