"""Gains of a drive as blocks of `tune` and back: the same controller, the same numbers."""

from dataclasses import replace

import control
import numpy as np
import pytest

import robust
from nlfrf.rig import Drive
from robust import tuning
from robust.lti.wiring import join_by_name
from robust.servo import cascade, to_blocks, with_blocks
from robust.servo.gains.p_pi import with_set_point

HZ = 2 * np.pi  # rad/s

LINEAR = Drive(
    fs=4000,
    kv=100,
    kp=143,
    kp_unit="A/(m/s)",
    tn=0.01,
    torque_constant=52.8,
    filters=(
        robust.tuning.Notch(omega=HZ * 83.0, width=20.0 / 83.0, depth=0.1),
        robust.tuning.Biquad(omega=HZ * 80, zeta=0.5, numerator_omega=HZ * 47, numerator_zeta=0.02),
    ),
    velocity_feedforward=0.7,
    position_unit="mm",
)
ROTARY = Drive(
    fs=2000,
    kv=30,
    kp=0.4,
    kp_unit="Nm/(rad/s)",
    filters=(robust.tuning.LowPass(omega=HZ * 400.0),),
    encoder="both",
    observer_frequency=300.0,
    load_unit="mm",
    load_factor=0.63,
)


def joined(settings, unit, inputs, output):
    """The drive from these inputs to its plant input, made of parts and blocks."""
    system, blocks = to_blocks(settings, output_unit=unit)
    parts = [*system, *(block.system(settings.dt) for block in blocks.values())]
    return join_by_name(parts, [], external=inputs, looked_at=[output])


@pytest.mark.parametrize(
    ("settings", "unit", "positions", "output"),
    [
        (LINEAR, "N", ["position"], "force"),
        (LINEAR, "A", ["position"], "current"),
        (ROTARY, "Nm", ["motor", "load"], "force"),
        (replace(LINEAR, tn=np.inf), "N", ["position"], "force"),
    ],
)
def test_parts_and_blocks_are_the_cascade(settings, unit, positions, output):
    """From the positions, and from the set point with its feedforward, as `cascade` has it."""
    omega = 2 * np.pi * np.array([0.3, 20.0, 83.0, 700.0])
    systems = (
        joined(settings, unit, ["r", *positions], output),
        cascade(settings, output_unit=unit),
        with_set_point(settings, output_unit=unit),
    )
    z = np.exp(1j * omega * settings.dt)
    found, K, whole = (system(z, squeeze=False)[0] for system in systems)
    assert np.allclose(found[1:], -K, rtol=1e-9)
    assert np.allclose(found[0], whole[0], rtol=1e-9)


@pytest.mark.parametrize(("settings", "unit"), [(LINEAR, "N"), (LINEAR, "A"), (ROTARY, "Nm")])
def test_back_again(settings, unit):
    again = with_blocks(settings, to_blocks(settings, output_unit=unit)[1], output_unit=unit)
    for name in ("kv", "kp", "tn"):
        assert getattr(again, name) == pytest.approx(getattr(settings, name), rel=1e-12)
    for one, other in zip(again.filters, settings.filters, strict=True):
        assert np.allclose(one.section(settings.fs), other.section(settings.fs), rtol=1e-12)


def test_a_drive_is_tuned_and_its_gains_come_back():
    """A mass under a drive: the gains to type in make the controller that was tuned."""
    settings = Drive(fs=1000, kv=31, kp=126, kp_unit="N/(m/s)", tn=0.04)
    system, blocks = to_blocks(settings)
    design = robust.tune(
        system,
        tuning.Plants(control.tf([1], [1, 0, 0]), inputs="force", outputs="position"),
        blocks,
        hard=[tuning.Limit("d", "force", 1.8), tuning.Limit("d", "position", 3e-6, band=(0, 2.0))],
        soft=[tuning.Limit("d", "position", 1e-6)],
        dt=settings.dt,
        delay=settings.delay,
        n_starts=1,
        rng=1,
    )
    tuned = with_blocks(settings, design.blocks)
    assert design.met
    assert tuned.kv > settings.kv
    z = np.exp(1j * np.array([0.5, 40.0, 900.0]) * settings.dt)
    assert np.allclose(cascade(tuned)(z), design.controller("position", "force")(z), rtol=1e-9)


@pytest.mark.parametrize(
    ("match", "call"),
    [
        ("must have a position loop with a gain", lambda: to_blocks(replace(LINEAR, kv=0.0))),
        ("reset time above half a period", lambda: to_blocks(replace(LINEAR, tn=1e-4))),
        (
            "blocks must hold 'K_v'",
            lambda: with_blocks(LINEAR, {"K_x": to_blocks(LINEAR)[1]["K_x"]}),
        ),
        (
            "blocks must be those of the drive",
            lambda: with_blocks(
                LINEAR, to_blocks(LINEAR)[1] | {"more": to_blocks(LINEAR)[1]["K_x"]}
            ),
        ),
    ],
)
def test_refusals(match, call):
    with pytest.raises(ValueError, match=match):
        call()
