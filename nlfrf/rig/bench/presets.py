"""Typical servo axes, each with a drive that is tuned for it.

docs/guide/axis.md gives the origin of the numbers.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from nlfrf._base.arguments import require_choice
from nlfrf.rig.bench.drive import Drive
from nlfrf.rig.bench.servo import ServoAxis
from nlfrf.rig.laws.sliders import VaryingSliders


def _sliders(K0: float, Fs: float, stiction: float, vs: float) -> VaryingSliders:
    """Return three elements of equal strength that slip one after the other, at 0.56, 1.1 and 3.3
    times Fs / K0.
    """
    stiffness = K0 * np.array([0.6, 0.3, 0.1])
    return VaryingSliders(
        stiffness=stiffness, strength=np.full(3, Fs / 3), stiction=stiction, vs=vs
    )


def _linear_motor() -> ServoAxis:
    """Return one mass on rails."""
    return ServoAxis(
        motor_inertia=12.0,
        motor_friction=_sliders(K0=2e6, Fs=20.0, stiction=1.3, vs=5e-3),
        motor_damping=20.0,
        resolution=5e-8,
        drive=Drive(
            kp_unit="A/(m/s)",
            torque_constant=52.8,
            fs=4000,
            kv=100,
            kp=143,
            tn=0.01,
            limit=28.8,
            lag=0.3e-3,
            velocity_feedforward=1.0,
        ),
    )


def _belt() -> ServoAxis:
    """Return a motor and a load on a toothed belt."""
    # 32 teeth of 5 mm: 25.46 mm per radian; gear 5; ATL5 of 25 mm, branches of 0.7 and 1.5 m
    r, gear = 32 * 5e-3 / (2 * np.pi), 5
    return ServoAxis(
        motor_inertia=(gear**2 * 1.74e-4 + 3e-4) / r**2,
        motor_friction=_sliders(K0=2e6, Fs=20.0, stiction=1.2, vs=5e-3),
        motor_damping=20.0,
        load_inertia=15.0,
        load_friction=_sliders(K0=1e6, Fs=30.0, stiction=1.4, vs=5e-3),
        load_damping=30.0,
        stiffness=632500 * (1 / 0.7 + 1 / 1.5),
        damping=100.0,
        resolution=2 * np.pi * r / gear / 2**17,
        drive=Drive(
            kp_unit="A/(m/s)",
            torque_constant=gear * 0.636 / r,
            fs=4000,
            kv=30,
            kp=33,
            tn=0.03,
            limit=17.0,
            lag=0.5e-3,
            velocity_feedforward=1.0,
        ),
    )


def _ball_screw() -> ServoAxis:
    """Return a motor and a load on a ball screw."""
    r = 10e-3 / (2 * np.pi)  # a lead of 10 mm
    return ServoAxis(
        motor_inertia=(3.19e-4 + 2.41e-4 + 0.3e-4) / r**2,
        motor_friction=_sliders(K0=2e7, Fs=100.0, stiction=1.2, vs=2e-3),
        motor_damping=300.0,
        load_inertia=150.0,
        load_friction=_sliders(K0=1e7, Fs=60.0, stiction=1.3, vs=2e-3),
        load_damping=200.0,
        stiffness=8e7,
        damping=5000.0,
        resolution=10e-3 / 2**17,
        drive=Drive(
            kp_unit="A/(m/s)",
            torque_constant=0.544 / r,
            fs=4000,
            kv=50,
            kp=280,
            tn=0.02,
            limit=42.0,
            lag=0.5e-3,
            velocity_feedforward=1.0,
        ),
    )


def _joint() -> ServoAxis:
    """Return a robot joint with a harmonic drive."""
    return ServoAxis(
        motor_inertia=100**2 * 5.2e-5,
        motor_friction=_sliders(K0=1.5e4, Fs=6.0, stiction=1.3, vs=5e-3),
        motor_damping=15.0,
        load_inertia=1.5,
        load_friction=_sliders(K0=5e3, Fs=1.0, stiction=1.2, vs=5e-3),
        load_damping=0.5,
        stiffness=1.6e4,
        damping=10.0,
        resolution=2 * np.pi / (100 * 2**14),
        motion="rotary",
        drive=Drive(
            kp_unit="A/(rad/s)",
            torque_constant=100 * 0.12,
            fs=4000,
            kv=15,
            kp=16,
            tn=0.05,
            limit=10.0,
            lag=0.5e-3,
            velocity_feedforward=1.0,
        ),
    )


#: Function that makes the axis, by the name of the preset.
_PRESETS: dict[str, Callable[[], ServoAxis]] = {
    "linear motor": _linear_motor,
    "belt": _belt,
    "ball screw": _ball_screw,
    "joint": _joint,
}


def servo_axis(preset: str) -> ServoAxis:
    """Return a typical servo axis with a drive that is tuned for it.

    Parameters
    ----------
    preset : str
        Kind of axis; inertias are those of motor and load:

        - "linear motor": one mass of 12 kg on rails
        - "belt": 7 and 15 kg, antiresonance 47 Hz, resonance 83 Hz
        - "ball screw": 233 and 150 kg, antiresonance 116 Hz, resonance 149 Hz
        - "joint": robot joint with a harmonic drive, 0.52 and 1.5 kg m^2, antiresonance 16 Hz, resonance
          32 Hz

    Returns
    -------
    ServoAxis
        Axis with viscous friction and with friction of the class `robust.friction.MaxwellSlip`.

    Raises
    ------
    ValueError
        `preset` is another text.

    References
    ----------
    docs/guide/axis.md: data sheet of each number.

    Examples
    --------
    >>> [round(servo_axis(name).inertia, 1) for name in ("linear motor", "belt", "ball screw", "joint")]
    [12.0, 22.2, 382.9, 2.0]
    """
    require_choice("preset", preset, tuple(_PRESETS))
    return _PRESETS[preset]()
