"""The servo axis: against closed forms, against linear theory in other hands, against the loop of
the rig, attacked.
"""

from dataclasses import replace
from types import SimpleNamespace

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

import nlfrf
from nlfrf import DataWarning, identify, multisine, servo_axis
from nlfrf.rig import Controller, Drive, Rig, ServoAxis, run, simulate_servo

FS = 4000.0
TS = 1 / FS
PRESETS = ("linear motor", "belt", "ball screw", "joint")
DRIVE = Drive(
    fs=FS,
    kv=40,
    kp=20,
    kp_unit="A/(m/s)",
    torque_constant=50.0,
    tn=0.03,
    lag=4e-4,
    velocity_feedforward=1.0,
)
MASS = ServoAxis(motor_inertia=12.0, drive=DRIVE)
TWO = replace(
    MASS,
    motor_inertia=7.0,
    load_inertia=15.0,
    stiffness=1.3e6,
    damping=90.0,
    motor_damping=20.0,
    load_damping=30.0,
)


def frictionless(axis):
    return replace(axis, motor_friction=None, load_friction=None)


# ---- Closed forms.


@pytest.mark.parametrize("delay", [0.0, 0.3, 1.0, 2.6])
def test_a_free_mass_follows_the_parabola_of_its_delayed_force(delay):
    axis = replace(MASS, drive=replace(DRIVE, lag=0.0, delay_periods=delay))
    trace = run(axis, {"torque": np.full(200, 6.0)})
    since = np.maximum(trace.t - delay * TS, 0.0)
    assert np.allclose(trace.x[0], 6.0 / 12.0 * since**2 / 2, rtol=1e-12, atol=1e-18)
    assert np.allclose(trace.v[0], 6.0 / 12.0 * since, rtol=1e-12, atol=1e-15)


def test_the_lag_of_the_current_is_an_exponential():
    trace = run(MASS, {"torque": np.full(100, 6.0)})
    since = np.maximum(trace.t - TS, 0.0)
    settled = since - 0.4e-3 * (1 - np.exp(-since / 0.4e-3))
    assert np.allclose(trace.force, 6.0 * (1 - np.exp(-since / 0.4e-3)), atol=1e-12)
    # the integrator sees the exponential as a parabola over each step
    assert np.abs(trace.v[0] - 0.5 * settled).max() < 1e-4 * 0.5 * settled[-1]


UNDAMPED = replace(
    TWO,
    damping=0.0,
    motor_damping=0.0,
    load_damping=0.0,
    drive=replace(DRIVE, lag=0.0, delay_periods=0.0),
)


def test_motor_and_load_swing_against_each_other_at_the_resonance():
    assert np.isclose(UNDAMPED.resonance, np.sqrt(1.3e6 * (1 / 7 + 1 / 15)) / 2 / np.pi)
    w = 2 * np.pi * UNDAMPED.resonance
    trace = run(
        UNDAMPED, {"torque": np.zeros(400)}, initial=[[0.0, 0.0], [1.0, -7 / 15]], oversampling=4
    )
    assert np.allclose(trace.x, np.outer([1.0, -7 / 15], np.sin(w * trace.t) / w), atol=1e-5 / w)


def test_at_the_antiresonance_the_load_holds_the_motor_still():
    w = np.sqrt(1.3e6 / 15)
    force = 10 * np.sin(w * (np.arange(400) + 0.5) * TS)  # held: half a period late
    begin = [[0.0, 0.0], [0.0, -10 / 1.3e6 * w]]
    trace = run(UNDAMPED, {"torque": force}, initial=begin, oversampling=4)
    assert np.allclose(trace.x[1], -10 / 1.3e6 * np.sin(w * trace.t), atol=1e-2 * 10 / 1.3e6)
    assert np.abs(trace.x[0]).max() < 1e-2 * np.abs(trace.x[1]).max()


def test_the_spring_to_ground_holds_a_sprung_axis():
    axis = replace(TWO, spring=4e5)
    trace = run(axis, {"torque": np.full(40000, 8.0)})
    assert np.isclose(trace.x[1, -1], 8.0 / 4e5, rtol=1e-6)
    assert np.isclose(trace.x[0, -1] - trace.x[1, -1], 8.0 / 1.3e6, rtol=1e-6)


def test_break_away_is_where_the_force_passes_stiction():
    axis = replace(
        MASS,
        motor_friction=nlfrf.friction.Coulomb(Fc=9.0, Fs=13.0, vs=0.01),
        drive=replace(DRIVE, lag=0.0, delay_periods=0.0),
    )
    force = np.linspace(0.0, 20.0, 2000)
    trace = run(axis, {"torque": force})
    moves = int(np.argmax(trace.x[0] > 0))
    assert force[moves - 2] <= 13.0 < force[moves]
    assert np.allclose(trace.friction[0, : moves - 1], force[: moves - 1])


def dragged(friction, v, damping=0.0, n=40000):
    """A load of 2 kg behind a spring of 5 kN/m whose other end moves at a constant velocity: a
    motor of 1e9 kg.
    """
    axis = ServoAxis(
        motor_inertia=1e9,
        drive=Drive(fs=FS, kv=0, kp=0, kp_unit="N/(m/s)"),
        load_inertia=2.0,
        load_friction=friction,
        load_damping=damping,
        stiffness=5000.0,
    )
    return run(axis, {"torque": np.zeros(n)}, initial=[[0.0, 0.0], [v, 0.0]], oversampling=2)


@pytest.mark.parametrize("v", [0.002, 0.01, 0.03])
def test_stick_slip_has_the_period_and_the_force_of_the_closed_form(v):
    """Friction that drops from Fs to Fc at once: D. Karnopp 1985, E. Rabinowicz 1958."""
    Fs, Fc, k, m = 10.0, 6.0, 5000.0, 2.0
    trace = dragged(nlfrf.friction.Coulomb(Fc=Fc, Fs=Fs, vs=1e-7), v)
    drop, w = Fs - Fc, np.sqrt(k / m)
    period = 2 * drop / (k * v) + 2 / w * (np.pi - np.arctan(drop / k * w / v))
    stretch = trace.x[0] - trace.x[1]
    rises = np.flatnonzero((stretch[:-1] < Fc / k) & (stretch[1:] >= Fc / k))
    measured = np.diff(rises[1:]).mean() * TS
    assert np.isclose(measured, period, rtol=2e-3)
    late = k * stretch[8000:]
    assert np.isclose(late.max(), Fc + np.sqrt(drop**2 + (k * v / w) ** 2), rtol=2e-3)
    assert np.isclose(late.min(), Fc - np.sqrt(drop**2 + (k * v / w) ** 2), rtol=2e-3, atol=0.02)


@pytest.mark.parametrize(("share", "slips"), [(0.8, True), (1.2, False)])
def test_steady_sliding_is_lost_where_the_falling_stribeck_curve_outweighs_the_damping(
    share, slips
):
    Fs, Fc, vs, v = 10.0, 6.0, 0.02, 0.015
    slope = 2 * v / vs**2 * (Fs - Fc) * np.exp(-((v / vs) ** 2))
    trace = dragged(nlfrf.friction.Coulomb(Fc=Fc, Fs=Fs, vs=vs), v, damping=share * slope)
    late = trace.v[1, -4000:]
    assert (np.ptp(late) > v) == slips
    if not slips:
        assert np.allclose(late, v, rtol=0.02)


# ---- Energy.


@pytest.mark.parametrize("name", PRESETS)
def test_what_the_motor_gives_is_held_or_lost(name):
    axis = servo_axis(name)
    rig = axis.rig
    rng, n = np.random.default_rng(3), 4000
    strength = axis.motor_friction.strength.sum()
    force = 6 * strength * signal.lfilter(*signal.butter(2, 20, fs=FS), rng.standard_normal(n) * 6)
    axis = replace(axis, drive=replace(axis.drive, lag=0.0, delay_periods=0.0, limit=np.inf))
    trace = run(axis, {"torque": force}, oversampling=8)
    # the force is held over each period: its work is the force times the way
    given = np.sum(force[:-1] * np.diff(trace.x[0]))
    x, v = trace.x[:, -1], trace.v[:, -1]
    held = (v @ rig.mass @ v + x @ rig.stiffness @ x) / 2
    fine = (trace.v[:, 1:] + trace.v[:, :-1]) / 2
    viscous = np.einsum("in,ij,jn->", fine, rig.damping, fine) * TS
    slid = np.sum((trace.friction[:, 1:] + trace.friction[:, :-1]) / 2 * np.diff(trace.x, axis=1))
    assert slid > 0.2 * given
    assert np.isclose(given, held + viscous + slid, rtol=2e-3)


# ---- Linear theory in other hands.


def in_state_space(axis):
    """The linear machine with current lag and delay, sampled with its hold, by python-control."""
    rig, n = axis.rig, axis.rig.n_axes
    forces = np.hstack([rig.stiffness, rig.damping])
    A = np.vstack([np.eye(n, 2 * n, n), -np.linalg.solve(rig.mass, forces)])
    B = (
        np.vstack([np.zeros((n, 1)), np.linalg.solve(rig.mass, rig.actuators)])
        * axis.force_constant
    )
    plant = control.ss(A, B, np.hstack([rig.sensors, 0 * rig.sensors]), 0)
    if axis.drive.lag:
        plant = plant * control.ss(-1 / axis.drive.lag, 1 / axis.drive.lag, 1, 0)
    return control.c2d(plant, TS) * control.tf([1], [1, 0], TS) ** int(axis.drive.delay_periods)


@pytest.mark.parametrize(
    "axis", [MASS, TWO, replace(TWO, drive=replace(DRIVE, encoder="load", kv=15, kp=6))]
)
@pytest.mark.parametrize("feedforward", [0.0, 1.0])
def test_the_linear_axis_is_the_closed_loop_of_linear_theory(axis, feedforward):
    drive = replace(axis.drive, velocity_feedforward=feedforward)
    axis = replace(axis, drive=drive)
    rng, n = np.random.default_rng(5), 1200
    r = np.where(np.arange(n) > 10, 1e-3, 0.0)
    speed, force = 1e-3 * rng.standard_normal(n), rng.standard_normal(n)
    trace = run(axis, {"position": r, "velocity": speed, "force": force}, oversampling=8)
    P = in_state_space(axis)
    pi = drive.kp * (1 + TS / drive.tn * control.tf([1], [1, -1], TS))
    difference = control.tf([1, -1], [1, 0], TS) / TS
    loop = control.feedback(P, pi * (drive.kv + difference))  # current in, position out
    asked = control.forced_response(pi * (drive.kv + feedforward * difference), U=r).y[0]
    asked += control.forced_response(pi, U=speed).y[0] + force / axis.force_constant
    y = control.forced_response(control.ss(loop), U=asked).y[0]
    assert not trace.diverged
    assert np.abs(trace.position - y).max() < 2e-4 * np.abs(y).max()


def test_filters_are_those_of_scipy():
    """A motor held by friction: all that moves is the current."""
    notch = signal.tf2sos(*signal.iirnotch(180, 5, fs=FS))
    low = signal.butter(2, 600, fs=FS, output="sos")
    sections = np.vstack([notch, low])
    held = replace(
        MASS,
        motor_friction=nlfrf.friction.Coulomb.constant(1e6),
        drive=replace(DRIVE, filters=sections, tn=np.inf),
    )
    speed = np.random.default_rng(1).standard_normal(400) * 1e-2
    trace = run(held, {"velocity": speed})
    assert np.allclose(trace.current_set, signal.sosfilt(sections, DRIVE.kp * speed), atol=1e-14)


def test_a_slower_position_loop_holds_the_velocity_set_point():
    held = replace(
        MASS,
        motor_friction=nlfrf.friction.Coulomb.constant(1e6),
        drive=replace(DRIVE, position_every=4, velocity_feedforward=0),
    )
    r = np.random.default_rng(2).standard_normal(40)
    trace = run(held, r)
    assert np.allclose(trace.velocity_set, DRIVE.kv * np.repeat(r[::4], 4))


# ---- The same loop around the rig, which is older: friction, encoder and delay as they are there.

LAWS = [
    nlfrf.friction.VaryingSliders(stiffness=[6e5, 3e5], strength=[6.0, 7.0], stiction=1.3, vs=0.01),
    nlfrf.friction.LuGre(sigma0=2e5, sigma1=300.0, sigma2=2.0, Fc=10.0, Fs=13.0, vs=0.01),
    nlfrf.friction.Leuven(
        Fs=13.0, Fc=10.0, curve=nlfrf.friction.Leuven().curve.__class__(K0=2e5, Fy=13.0)
    ),
    nlfrf.friction.Coulomb(Fc=10.0, Fs=13.0, vs=0.01),
    nlfrf.friction.GeneralizedMaxwellSlip(
        stiffness=[1e5, 2e5], alpha=[0.5, 0.5], C=100, Fc=10.0, Fs=13.0, vs=0.01
    ),
]


@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
def test_one_mass_under_its_drive_is_the_rig_in_a_sampled_loop(law):
    n = 1500
    r = 1e-3 * np.minimum(np.arange(n) / 500, 1.0)
    drive = replace(DRIVE, lag=0.0, kp=25)
    axis = replace(MASS, motor_friction=law, motor_damping=20.0, drive=drive, resolution=1e-6)
    trace = run(axis, r, oversampling=4)
    # u = kp (1 + Ts/Tn/(z-1)) (kv + (1 - 1/z)/Ts) (r - y)
    z = control.tf([1, 0], [1], TS)
    K = 50.0 * drive.kp * (1 + TS / drive.tn / (z - 1)) * (drive.kv + (1 - 1 / z) / TS)
    K = control.ss(control.minreal(K, verbose=False))
    K = SimpleNamespace(A=K.A, B=K.B, C=K.C, D=K.D, dt=TS)
    rig = Rig([[12.0]], [[0.0]], [law], [[20.0]])
    response = run(rig, r[None], Controller(K, delay=TS, resolution=1e-6))
    assert (
        np.abs(trace.position - response.y[0]).max() <= 2.1e-6
    )  # one step of the encoder now and then
    assert np.abs(trace.x[0] - response.x[0]).max() < 2e-3 * np.abs(response.x).max()


# ---- Encoder and limit.


def test_the_drive_sees_whole_steps_of_the_encoder():
    axis = replace(servo_axis("belt"), resolution=1e-6)
    trace = run(axis, 1e-3 * np.sin(np.arange(2000) / 300))
    for seen, step in ((trace.position, 1e-6), (trace.velocity, 1e-6 * FS)):
        assert np.allclose(seen / step, np.round(seen / step), atol=1e-6)
    assert 0 < np.abs(trace.position - trace.x[0]).max() <= 0.5e-6 * (1 + 1e-9)


def test_the_current_keeps_its_limit_and_the_integrator_does_not_wind_up():
    """A held motor: 2 A of the proportional part and 4 A a second of the integral part reach 3 A
    after 1000 periods.
    """
    held = replace(
        MASS,
        motor_friction=nlfrf.friction.Coulomb.constant(1e6),
        drive=replace(DRIVE, tn=0.5, limit=3.0),
    )
    speed = np.where(np.arange(8000) < 6000, 0.1, -0.1)
    trace = run(held, {"velocity": speed})
    asked = 2.0 + 4.0 * trace.t
    assert np.allclose(trace.current_set[:6000], np.minimum(asked[:6000], 3.0), atol=2e-3)
    assert np.array_equal(np.flatnonzero(np.diff(trace.limited)), [999, 5999])
    # turned round, it is 1 A of the integral part, not 6 A of five seconds, less the proportional
    # part
    assert np.isclose(trace.current_set[6000], 1.0 - 2.0, atol=2e-3)


# ---- Step size.


def test_a_finer_step_changes_less_and_less():
    axis = frictionless(servo_axis("ball screw"))
    r = 1e-3 * np.minimum(np.arange(1200) / 400, 1.0)
    axis = replace(axis, resolution=0.0, drive=replace(axis.drive, lag=0.0))
    exact = run(axis, r, oversampling=64).x
    errors = [np.abs(run(axis, r, oversampling=n).x - exact).max() for n in (1, 2, 4, 8)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(orders > 3.7), orders


@pytest.mark.parametrize("name", PRESETS)
def test_the_step_of_a_preset_is_fine_enough(name):
    axis = replace(servo_axis(name), resolution=0.0)
    r = (1e-3 if axis.motion == "linear" else 2e-2) * np.sin(2 * np.pi * np.arange(4000) / 2000)
    coarse, fine = (run(axis, r, oversampling=n) for n in (1, 16))
    assert np.abs(coarse.x - fine.x).max() < 2e-3 * np.abs(fine.x).max()


# ---- Attacked: nothing that is not a number, no energy from nothing.


def some_axis(rng):
    law = [None, *LAWS]
    two = rng.random() < 0.7
    drive = Drive(
        kp_unit="A/(m/s)",
        torque_constant=10 ** rng.uniform(0, 2),
        encoder=str(rng.choice(["motor", "load"])) if two else "motor",
        fs=10 ** rng.uniform(3, 4),
        kv=10 ** rng.uniform(0, 3),
        kp=10 ** rng.uniform(-1, 3),
        tn=rng.choice([np.inf, 10 ** rng.uniform(-3, 0)]),
        limit=rng.choice([np.inf, 10 ** rng.uniform(-1, 2)]),
        lag=rng.choice([0.0, 10 ** rng.uniform(-4, -2)]),
        delay_periods=rng.choice([0.0, 1.0, rng.uniform(0, 3)]),
        velocity_lag=rng.choice([0.0, 1e-3]),
        position_every=int(rng.integers(1, 5)),
    )
    load = {
        "load_inertia": 10 ** rng.uniform(-1, 2),
        "load_friction": law[rng.integers(6)],
        "stiffness": 10 ** rng.uniform(3, 7),
        "damping": 10 ** rng.uniform(-1, 3),
    }
    return ServoAxis(
        motor_inertia=10 ** rng.uniform(-1, 2),
        motor_friction=law[rng.integers(6)],
        drive=drive,
        spring=rng.choice([0.0, 1e4]),
        resolution=rng.choice([0.0, 1e-6]),
        **(load if two else {}),
    )


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_random_axis_gives_numbers_or_says_that_it_ran_away(seed):
    rng = np.random.default_rng(seed)
    axis = some_axis(rng)
    r = 10 ** rng.uniform(-5, -1) * rng.standard_normal(300).cumsum()
    trace = run(axis, r)
    for name in ("position", "velocity", "current_set", "current", "x", "v", "friction"):
        assert np.isfinite(getattr(trace, name)).all()
    assert trace.diverged == (trace.t.size < 300)
    assert np.abs(trace.current_set).max(initial=0.0) <= axis.drive.limit


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_random_axis_left_alone_gains_no_energy(seed):
    rng = np.random.default_rng(seed)
    axis = some_axis(rng)
    axis = replace(axis, drive=replace(axis.drive, fs=8000.0, lag=0.0))
    force = np.where(np.arange(800) < 200, 30 * rng.standard_normal(800), 0.0)
    trace = run(axis, {"torque": force}, oversampling=16)
    rig, alone = axis.rig, slice(204, None)
    energy = np.einsum("in,ij,jn->n", trace.v, rig.mass, trace.v) / 2
    energy += np.einsum("in,ij,jn->n", trace.x, rig.stiffness, trace.x) / 2
    # what elements and bristles hold at most: Fs^2 / K0 and a generous factor
    stored = sum(
        0 if law is None or isinstance(law, nlfrf.friction.Coulomb) else 2 * 13.0**2 / 2e5
        for law in rig.friction
    )
    gained = energy[alone] - np.minimum.accumulate(energy[alone])
    assert gained.max() <= stored + 1e-6 * energy.max()


# ---- Experiments.


def frf(record):
    """(F,) frequencies [rad/s], and output over input on the excited lines, averaged over all
    periods.
    """
    u, y = (np.fft.rfft(one.mean(axis=1))[:, record.lines.excited] for one in (record.u, record.y))
    return 2 * np.pi * record.f0 * record.lines.excited, np.median(y / u, axis=0)


def test_an_axis_in_motion_shows_its_mass_and_at_rest_its_presliding_stiffness():
    axis = servo_axis("linear motor")
    ms = multisine(fs=FS, n_samples=4000, f_min=5, f_max=150, rms=4.0, rng=1)
    moving = simulate_servo(axis, ms, base_velocity=0.1)
    w, G = frf(moving)
    high = w > w[-1] / 2
    assert np.allclose(np.abs(w[high] ** 2 * G[high]), 1 / 12.0, rtol=0.05)
    assert identify(moving).G.shape == G.shape
    _, stuck = frf(simulate_servo(axis, ms, n_discard=8))
    assert 1.2e6 < 1 / abs(stuck[0]) < 2.0e6  # most of 2 MN/m at a fifth of the break-away force
    assert abs(G[0]) > 10 * abs(stuck[0])


def test_back_and_forth_keeps_the_directions_apart():
    axis = servo_axis("belt")
    ms = multisine(fs=FS, n_samples=2000, f_min=4, f_max=200, rms=15.0, rng=2)
    forth = simulate_servo(axis, ms, base_velocity=0.1, strokes=2, n_periods=2, n_discard=2)
    assert forth.y.shape == (1, 4, 2000)
    mirrored = replace(ms, phase=ms.phase + np.pi)
    back = simulate_servo(axis, mirrored, base_velocity=-0.1, strokes=2, n_periods=2, n_discard=2)
    assert np.allclose(forth.y, -back.y, atol=2 * axis.resolution)
    assert np.abs(forth.y.mean()) < 1e-3  # the way of the set point is taken off
    assert np.std(forth.y) > 1e-6


@pytest.mark.parametrize(("port", "rms"), [("force", 3.0), ("velocity", 2e-3), ("position", 2e-5)])
def test_every_port_gives_a_record_with_its_reference(port, rms):
    axis = servo_axis("linear motor")
    ms = multisine(fs=FS, n_samples=2000, f_min=4, f_max=200, rms=rms, n_realizations=2, rng=3)
    record = simulate_servo(axis, ms, port=port, base_velocity=0.1)
    assert record.u.shape == record.y.shape == record.r.shape == (2, 2, 2000)
    assert np.allclose(record.r[:, 0], ms.u)
    assert (record.u_unit, record.y_unit) == ("N", "m")
    w, G = frf(record)
    with_lag = np.exp(-1j * w * 1.5 * TS) / (1 + 1j * w * axis.drive.lag)
    expected = with_lag / (-12.0 * w**2 + 20.0j * w)
    assert np.median(np.abs(G / expected - 1)) < 0.1


def test_what_makes_another_record_than_was_asked_for_is_said():
    axis = servo_axis("linear motor")
    ms = multisine(fs=FS, n_samples=1000, f_min=8, f_max=200, rms=30.0, rng=1)
    with pytest.warns(
        DataWarning, match="moved backwards in .* % of the samples.*Raise base_velocity above 0.001"
    ):
        simulate_servo(axis, ms, base_velocity=0.001)
    weak = replace(axis, drive=replace(axis.drive, limit=0.5))
    with pytest.warns(DataWarning) as said:
        simulate_servo(weak, ms, n_discard=8)
    assert any("the current was at its limit of 0.5 A in" in str(one.message) for one in said)
    free = frictionless(replace(axis, drive=replace(axis.drive, kv=1.0, kp=1.0)))
    with pytest.warns(DataWarning, match="steady state was not reached"):
        simulate_servo(free, ms, n_discard=0)


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_comes_to_its_set_point(name):
    axis = servo_axis(name)
    way = 1e-2 if axis.motion == "linear" else 0.1
    r = way * np.minimum(np.arange(8000) / 2000, 1.0)
    trace = run(axis, r)
    assert not trace.limited.any()
    assert np.abs(trace.position[-1] - way) < 3e-3 * way
    assert np.abs(trace.velocity[-400:]).mean() < 1e-3 * way


# ---- Refusals.


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"motor_inertia": 0.0}, "motor_inertia must be positive"),
        ({"load_inertia": 3.0}, "stiffness must be positive with a load_inertia, got 0"),
        ({"load_damping": 3.0}, "load_inertia must be positive if load_damping is given, got 0"),
        (
            {"drive": replace(DRIVE, encoder="load")},
            'encoder must be "motor" without a load_inertia, got "load"',
        ),
        ({"motion": "circular"}, "motion must be"),
        ({"motion": "rotary"}, "must be A or N for a velocity loop in"),
        (
            {"drive": replace(DRIVE, torque_constant=np.nan)},
            r"torque_constant must be given \[N/A\]",
        ),
        ({"drive": replace(DRIVE, encoder="both")}, "drive must read one encoder"),
        ({"drive": None}, "drive must be"),
        ({"motor_friction": 3.0}, "friction must be one of the laws"),
    ],
)
def test_a_machine_that_is_none_is_refused(fields, message):
    with pytest.raises(ValueError, match=message):
        replace(MASS, **fields)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"kp": -1.0}, "kp must be zero or positive"),
        ({"tn": 0.0}, "tn must be positive"),
        ({"velocity_feedforward": 1.5}, "velocity_feedforward must lie between 0 and 1, got 1.5"),
        ({"position_every": 0}, "position_every must be"),
        (
            {"filters": np.ones((2, 5))},
            r"filters must be elements or second-order sections .*got shape \(2, 5\)",
        ),
    ],
)
def test_a_drive_that_is_none_is_refused(fields, message):
    with pytest.raises(ValueError, match=message):
        replace(DRIVE, **fields)


def test_signals_that_make_no_run_are_refused():
    ms = multisine(fs=1000, n_samples=1000, f_min=8, f_max=200, rng=1)
    own = replace(ms, fs=FS)
    with pytest.raises(
        ValueError, match="position, velocity or force must be given, with at least one sample"
    ):
        run(MASS, {})
    with pytest.raises(ValueError, match="signal must have no entry 'position'"):
        run(MASS, {"torque": np.zeros(5), "position": np.zeros(5)})
    with pytest.raises(ValueError, match="fs must be left out for a servo axis, got 4000"):
        run(MASS, np.zeros(5), fs=4000)
    with pytest.raises(ValueError, match="position must have one value for each of the 4 samples"):
        run(MASS, {"position": np.zeros(5), "velocity": np.zeros(4)})
    with pytest.raises(
        ValueError, match="ms must be sampled like the drive, at 4000 Hz, got 1000 Hz"
    ):
        simulate_servo(MASS, ms)
    with pytest.raises(
        ValueError, match='port must be "force" and base_velocity 0 in an open loop'
    ):
        simulate_servo(MASS, own, closed=False, port="position")
    with pytest.raises(
        ValueError, match="base_velocity must not be zero if the axis moves back and forth, got 2"
    ):
        simulate_servo(MASS, own, strokes=2)
    with pytest.raises(ValueError, match="n_discard must be at least 1 in motion"):
        simulate_servo(MASS, own, base_velocity=0.1, n_discard=0)
    wild = replace(MASS, drive=replace(DRIVE, kp=1e5))
    with pytest.raises(
        ValueError, match="axis must be stable under its drive, got one that ran away after"
    ):
        simulate_servo(wild, own)
    with pytest.raises(ValueError, match="preset must be"):
        servo_axis("rack")
