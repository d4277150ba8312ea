"""Feedforward of a free mass: closed forms, every machine within the intervals, the simulated
axis.
"""

from dataclasses import replace

import control
import numpy as np
import pytest

import nlfrf
import robust
from nlfrf.rig import Drive
from robust.servo import cascade, feedforward
from tests.support.linear_axis import frictionless, settings_of

DRIVE = Drive(fs=4000, kv=100, kp=143, kp_unit="A/(m/s)", tn=0.01, torque_constant=52.8, lag=0.3e-3)
PLANT = control.tf([1], [12, 20, 0])


def motion(n=4000, fs=4000.0, way=0.05, time=0.4):
    """Position, velocity, acceleration and jerk of a smooth way there and back."""
    t, x = np.arange(n) / fs, 2 * np.pi / time
    ramp, run = np.minimum(t, time), t < time
    r = way * (ramp / time - np.sin(x * ramp) / (2 * np.pi))
    v, a, j = (
        way / time * np.array([1 - np.cos(x * t), x * np.sin(x * t), x**2 * np.cos(x * t)]) * run
    )
    return r, v, a, j


def test_gains_are_those_of_the_closed_form():
    found = feedforward(PLANT, coulomb=15.0, settings=DRIVE)
    T = 0.3e-3 + 1 / 4000 + 0.5 / 4000
    gains = {name: (gain, unit) for name, gain, unit in found.drive_gains}
    assert gains["acceleration"] == (pytest.approx((12 + 20 * T) / 52.8), "A/(m/s^2)")
    assert gains["velocity"] == (pytest.approx(20 / 52.8), "A/(m/s)")
    assert gains["jerk"] == (pytest.approx(12 * T / 52.8), "A/(m/s^3)")
    assert gains["sign of the velocity (Coulomb)"] == (pytest.approx(15 / 52.8), "A")


def test_units_of_a_rotary_drive_that_asks_for_torque():
    drive = Drive(fs=4000, kv=15, kp=16, kp_unit="Nm/(rad/s)")
    gains = feedforward(
        mass=2.0, viscous=1.0, stiction=7.0, coulomb=5.0, stribeck_velocity=0.1, settings=drive
    ).drive_gains
    assert [unit for *_, unit in gains] == [
        *("Nm/(rad/s^2)", "Nm/(rad/s)", "Nm/(rad/s^3)", "Nm", "Nm", "rad/s"),
    ]
    with pytest.raises(ValueError, match=r"torque_constant must be given \[N/A\]"):
        feedforward(mass=2.0, settings=replace(DRIVE, torque_constant=np.nan))


def test_no_machine_within_the_intervals_is_further_off_than_the_error():
    rng = np.random.default_rng(2)
    ends = {"mass": (10, 13), "viscous": (15, 30), "coulomb": (12, 16), "stiction": (18, 22)}
    found = feedforward(**ends, stribeck_velocity=(3e-3, 8e-3))
    v = rng.uniform(-0.05, 0.05, 400) * rng.uniform(0, 1, 400) ** 3
    a = rng.uniform(-3, 3, 400)
    closest = 0.0
    for _ in range(200):
        m, c, Fc, Fs = (
            rng.choice(end) if rng.random() < 0.5 else rng.uniform(*end) for end in ends.values()
        )
        vs = rng.uniform(3e-3, 8e-3)
        needed = m * a + c * v + np.sign(v) * (Fc + (Fs - Fc) * np.exp(-((v / vs) ** 2)))
        missing = np.abs(needed - found.force(v, a))
        assert np.all(missing <= found.error(v, a) * (1 + 1e-9))
        closest = max(closest, float(np.max(missing / found.error(v, a))))
    assert closest > 0.9  # and the bound is one that is nearly reached


def test_what_friction_leaves_for_a_verdict():
    found = feedforward(mass=10.0, coulomb=(14, 16), stiction=(18, 22), stribeck_velocity=5e-3)
    assert found.friction_error == pytest.approx(2.0)  # of 20 +- 2 N at standstill
    assert found.relative_error == pytest.approx(2 / 22)
    plant, K = robust.friction_plant(10.0, 0.0), cascade(DRIVE, output_unit="N")
    whole, left = (
        robust.prove_friction(plant, K, friction, delay=DRIVE.delay)
        for friction in map(robust.friction.Bounded, (22.0, found.relative_error * 22.0))
    )
    assert left.error_bound == pytest.approx(whole.error_bound / 11)


def test_the_simulated_axis_follows():
    axis = frictionless("linear motor")
    axis = replace(
        axis,
        motor_friction=nlfrf.friction.Coulomb.constant(15.0),
        drive=replace(axis.drive, velocity_feedforward=1.0),
    )
    settings = settings_of(axis)
    r, v, a, j = motion()
    gains = feedforward(
        mass=axis.motor_inertia, viscous=axis.motor_damping, coulomb=15.0, settings=settings
    )
    mass_only = feedforward(mass=axis.motor_inertia, viscous=axis.motor_damping)
    moving = slice(200, 1400)  # between the rise and the end, where it sticks
    errors = [
        np.abs((nlfrf.rig.run(axis, {"position": r, "force": force}).position - r)[moving]).max()
        for force in (np.zeros_like(r), mass_only.force(v, a), gains.force(v, a, j))
    ]
    assert errors[0] > 4 * errors[1] > 20 * errors[2]


def test_a_plant_is_read():
    model = robust.friction_plant(12.0, 0.0, 20.0)
    for plant in (PLANT, control.ss(PLANT), model):
        found = feedforward(plant)
        assert found.mass == pytest.approx(12.0)
        assert found.viscous == pytest.approx(20.0)
    assert feedforward(control.tf([1], [3, 0, 0])).viscous == pytest.approx(0.0, abs=1e-9)
    assert feedforward(PLANT, mass=(11, 13)).mass.tolist() == [11, 13]


def test_a_class_of_friction_gives_the_mass_with_its_interval():
    known = robust.friction_plant(12.0, 0.0)
    friction = robust.friction.MachineWithFriction(
        machines=(known,),
        friction=robust.friction.MaxwellSlip(1e6),
        evidence="",
        mass=12.0,
        mass_std=0.1,
        stiffness_low=0.0,
        stiffness_std=0.0,
    )
    assert feedforward(friction).mass == pytest.approx([11.7, 12.3])


def test_the_filter_of_the_package_refuses_what_this_serves():
    model = robust.UncertaintyModel(
        PLANT,
        control.tf([0.1], [1]),
        "multiplicative",
        np.array([1.0]),
        np.array([0.1]),
        perturbation="LTI",
    )
    K, reference = control.tf([600, 12000], [1e-3, 1]), control.tf([1], [1e-6, 3e-4, 3e-2, 1])
    with pytest.raises(
        ValueError, match=r"model must have a stable nominal.*robust\.servo\.feedforward"
    ):
        robust.synthesis.feedforward_filter(model, K, reference)
    assert feedforward(model).mass == pytest.approx(12.0)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, "mass must be given"),
        ({"mass": 0.0}, "mass must be positive, got 0"),
        ({"mass": (2.0, 1.0)}, r"mass must be \(low, high\), got"),
        ({"mass": 1.0, "viscous": -1.0}, "viscous must be zero or positive, got -1"),
        ({"mass": 1.0, "stiction": 3.0}, "stribeck_velocity must be given with stiction"),
        ({"mass": 1.0, "stribeck_velocity": 3.0}, "stiction must be given with stribeck_velocity"),
        (
            {"mass": 1.0, "coulomb": 5.0, "stiction": 3.0, "stribeck_velocity": 1.0},
            r"stiction must be at least coulomb, \[5.0, 5.0\], got \[3.0, 3.0\]",
        ),
        (
            {"plant": control.tf([1], [1, 2, 300])},
            r"plant must be 1/\(m s\^2 \+ c s\), got a relative error of",
        ),
        (
            {"plant": control.tf([1], [1, 0], 0.1)},
            "plant must be continuous, got one sampled at 0.1 s",
        ),
        ({"mass": 1.0, "settings": 3}, "settings must be of type Drive"),
    ],
)
def test_refusals(given, message):
    with pytest.raises(ValueError, match=message):
        feedforward(**given)
