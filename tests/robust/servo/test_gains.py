"""Controllers read as gains of a drive: cascades come back, PIDs are cascades where their zeros are
real.
"""

from dataclasses import replace

import control
import numpy as np
import pytest

import nlfrf
import robust
from nlfrf.rig import Drive
from robust.servo import cascade, gains_from_controller
from tests.support.linear_axis import frictionless

HZ = 2 * np.pi  # rad/s

BASE = Drive(fs=4000, kv=60, kp=143, kp_unit="A/(m/s)", tn=0.01, torque_constant=52.8)
BLANK = {"kv": 1.0, "kp": 1.0, "tn": 1.0}


def same(one, other, rel=1e-6):
    for name in ("kv", "kp", "tn", "velocity_lag"):
        assert getattr(one, name) == pytest.approx(getattr(other, name), rel=rel, abs=1e-12), name


@pytest.mark.parametrize(
    "more",
    [
        {},
        {"velocity_lag": 0.7e-3},
        {"tn": np.inf},
        {"tn": np.inf, "velocity_lag": 0.7e-3},
        {
            "filters": (
                robust.tuning.LowPass(omega=HZ * 600.0),
                robust.tuning.Notch(omega=HZ * 150.0, width=30.0 / 150.0, depth=0.0),
            )
        },
        {"position_unit": "mm"},
        {"kp_unit": "A/rpm", "kp": 0.2, "position_unit": "rad", "unit_factor": 1.0},
        {"observer_frequency": 400.0},
        {"encoder": "both", "load_unit": "um", "load_factor": 1e-6, "velocity_lag": 1e-3},
        {"tn": 1e4},
        {"kv": 300.0, "tn": 1e-3},
    ],
    ids=str,
)
def test_a_cascade_comes_back(more):
    if "position_unit" in more and "unit_factor" not in more:
        more = more | {"unit_factor": 1e-3, "load_factor": 1e-3}
    settings = replace(BASE, **more)
    found = gains_from_controller(cascade(settings), like=replace(settings, **BLANK))
    same(
        found.settings
        if found.settings.kv == pytest.approx(settings.kv, rel=1e-3)
        else found.alternative,
        settings,
    )
    assert found.misfit < 1e-9


def test_a_slow_position_loop_comes_back():
    settings = replace(BASE, position_every=4)
    with pytest.warns(robust.DesignWarning, match="position loop runs"):
        K = cascade(settings)
    same(gains_from_controller(K, like=replace(settings, **BLANK)).settings, settings)


def test_output_units_are_kept_apart():
    K = cascade(BASE, output_unit="N")
    same(gains_from_controller(K, like=replace(BASE, **BLANK), output_unit="N").settings, BASE)


def test_both_solutions_are_the_same_controller():
    found = gains_from_controller(cascade(BASE), like=BASE)
    assert found.settings.kv < found.alternative.kv
    angles = np.exp(1j * np.geomspace(1e-4, 3, 30))
    one, other = (cascade(settings)(angles) for settings in (found.settings, found.alternative))
    assert np.allclose(one, other, rtol=1e-9)
    assert "the same controller: kv = " in str(found)


@pytest.mark.parametrize("sampled", [False, True])
def test_a_pid_is_the_cascade_of_the_derivation(sampled):
    Kp, Ki, Kd, Tf, dt = 280.0, 8000.0, 2.0, 2e-3, BASE.dt
    K = robust.shaping.pid(Kp, Ki, Kd, filter_time=Tf, dt=dt if sampled else 0.0)
    found = gains_from_controller(K, like=BASE).settings
    # the sampled low-pass on the velocity is half a period faster than the filter
    assert found.velocity_lag == pytest.approx(Tf - dt / 2, rel=1e-6)
    # continuous: (Kp Tf + Kd) s^2 + (Kp + Ki Tf) s + Ki
    slow, fast = np.sort(-np.roots([Kp * Tf + Kd, Kp + Ki * Tf, Ki]))
    kv = slow / (1 - slow * Tf)
    assert found.kv == pytest.approx(kv, rel=0.02)
    assert found.tn == pytest.approx(1 / fast, rel=0.02)
    assert found.kp == pytest.approx((Kp * Tf + Kd) / (1 + kv * Tf), rel=0.02)


def test_a_design_from_the_frf_is_read():
    """The gain at zero frequency is largest with complex zeros; behind a PI that is given they are
    real.
    """
    ms = nlfrf.multisine(fs=4000, n_samples=4000, f_min=4, f_max=400, rms=5.0, rng=1)
    bla = nlfrf.identify(nlfrf.rig.simulate_servo(frictionless("linear motor"), ms))
    dt, like = 1 / 4000, replace(BASE, **BLANK)
    free = robust.design_frf(bla, "PID", M_S=2.0, dt=dt, positive=True)
    with pytest.raises(
        ValueError, match=r"two real zeros.*got 4 n0 n2 at [1-9][\d.]* times n1\^2.*fixed PI"
    ):
        gains_from_controller(free.K, like=like, output_unit="N")
    design = robust.design_frf(
        bla, "PD", M_S=2.0, dt=dt, fixed=robust.shaping.pid(1.0, 100.0, dt=dt)
    )
    found = gains_from_controller(design.K, like=like, output_unit="N").settings
    z = np.exp(1j * np.geomspace(1e-4, 3, 50))
    assert np.allclose(cascade(found, output_unit="N")(z), design.K(z), rtol=1e-9)
    assert found.kp > 30
    assert found.velocity_lag >= 0


def test_complex_zeros_are_refused_with_the_number():
    # in the sampled filter the number is that of continuous time
    Kp = 180.0
    Ki = 4000.0
    Kd = 2.0
    Tf = 0.5e-3
    number = 4 * Ki * (Kp * Tf + Kd) / (Kp + Ki * Tf) ** 2
    with pytest.raises(
        ValueError,
        match=rf"K must have two real zeros .*got 4 n0 n2 at {number:.3g}\d? times n1\^2",
    ):
        gains_from_controller(robust.shaping.pid(Kp, Ki, Kd, filter_time=Tf), like=BASE)


@pytest.mark.parametrize(
    ("K", "message"),
    [
        (
            robust.shaping.pid(1.0, 0.0, -1e-2, filter_time=0.1),
            "zeros between the pole of its derivative filter",
        ),
        (
            robust.shaping.pid(280.0, 8000.0, 2.0, filter_time=0.5e-4),
            "pole 0 to 1, got a pole at -0.4286.*half the sampling",
        ),
        (-cascade(BASE), "gains of one sign to be a cascade, got kp = -143 A/"),
        (2.0, "zeros between the pole|one sign|real zeros|act on the velocity"),
        (robust.shaping.pid(1.0, 3.0), "zeros between the pole|one sign|real zeros|pole 0 to 1"),
        (
            cascade(
                replace(
                    BASE,
                    filters=(robust.tuning.Notch(omega=HZ * 100.0, width=20.0 / 100.0, depth=0.0),),
                )
            ),
            ".",
        ),
        (
            control.ss(control.tf([1.0], [1.0, -0.5], 0.1)),
            "K must be sampled as the drive is, 0.00025 s, got 0.1 s",
        ),
        (np.ones((1, 2)), "K must have one output and 1 position for a drive.*got 1 and 2"),
        (0.0, "got a response of zero"),
    ],
)
def test_what_is_no_cascade_is_refused(K, message):
    with pytest.raises(ValueError, match=message):
        gains_from_controller(K, like=BASE)


def test_the_misfit_is_a_number():
    like = replace(BASE, observer_frequency=400.0)
    with pytest.raises(ValueError, match=r"relative error of \d\.\d+ to the nearest such cascade"):
        gains_from_controller(
            cascade(replace(like, filters=(robust.tuning.LowPass(omega=HZ * 300.0),))), like=like
        )
