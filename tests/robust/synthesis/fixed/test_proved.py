"""Controllers that are proved for a class of friction by design."""

import control
import numpy as np
import pytest

import robust
from robust import any_maxwell_slip, any_passive, design_frf, design_proved, friction_plant, prove_friction
from robust.synthesis.fixed.proved import first_crossing, largest_allowed_gain
from tests.support.printed import unwrapped

RIG = friction_plant(1.0, 80e3, 0.4)
CLASS = any_maxwell_slip(64e3)


def test_the_largest_allowed_gain_is_bracketed():
    for first in (0.01, 1.0, 70.0):
        found, told = largest_allowed_gain(lambda g: f"{g}" if g < 3.7 else None, first)
        assert 3.7 / 1.03 < found < 3.7
        assert float(told) == found
    assert largest_allowed_gain(lambda g: None, 1.0) == (0.0, None)


def test_a_crossing_is_found_between_lines():
    """|S| of an integrator loop passes 1/sqrt(2) at its gain: w/sqrt(w^2 + 1)."""
    omega = np.geomspace(1e-2, 1e2, 60)
    assert first_crossing(omega, omega / np.hypot(omega, 1), np.sqrt(0.5)) == pytest.approx(1.0, rel=5e-3)


def test_a_search_widens_the_band_and_every_gain_above_fails():
    first = design_proved(RIG, CLASS, dt=1e-3, n_iterations=0)
    found = design_proved(RIG, CLASS, dt=1e-3, n_iterations=7)
    assert found.bandwidth > 3 * first.bandwidth
    assert found.peak <= 2.0
    assert prove_friction(RIG, found.K, CLASS).verdict == "proved"
    assert found.proofs[0].certificate.holds
    over = 1.05 * found.K  # the gain is the largest: what limits it is |S| or the proof
    S = 1 / (1 + over * robust.sampled(control.ss(control.tf([1], [1, 0.4, 80e3])), 1e-3))
    stuck = 1 / (1 + over * robust.sampled(control.ss(control.tf([1], [1, 0.4, 144e3])), 1e-3))
    z = np.exp(1j * np.linspace(0.01, np.pi - 1e-3, 800))
    peak = max(np.abs(S(z)).max(), np.abs(stuck(z)).max())
    assert peak > 1.99 or prove_friction(RIG, over, CLASS).verdict != "proved"
    assert "proofs tried" in unwrapped(found)


def test_a_design_from_the_frf_is_lowered_until_it_is_proved():
    """On the stuck machine alone a PID may destabilise the sliding one; with the class it does not."""
    stuck = control.ss(control.tf([1], [1, 13.4, 144e3]))
    asked = {"M_S": 2.0, "dt": 1e-3}
    alone = design_frf(stuck, "I", **asked)
    assert prove_friction(RIG, alone.K, CLASS).verdict == "refuted"
    undamped = robust.friction_plant(1.0, 80e3)  # an integrator alone makes it unstable at every gain
    with pytest.raises(ValueError, match="prove must be a class for which some gain of the controller is proved"):
        design_frf(stuck, "I", prove=(undamped, CLASS), **asked)
    better = design_frf(stuck, "PID", prove=(RIG, CLASS), **asked)
    assert prove_friction(RIG, better.K, CLASS).verdict == "proved"
    assert "proved for its class of friction" in better.reason


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"machine": 1.0}, "machine must be a friction_plant, or a FrictionClass alone, got 1.0"),
        ({"friction": any_passive()}, "friction must be a class such as any_maxwell_slip"),
        ({"structure": "PIDD"}, "structure must be"),
        ({"start": (1.0, 1.0, 0.0)}, "start must hold Kp, Ki >= 0 and Kd > 0"),
        ({"notch": 1e4}, "notch must lie below Nyquist"),
        ({"start": (0.0, 1e9, 1e-3), "n_iterations": 0}, "start must have a gain that is proved"),
    ],
)
def test_refusals(options, message):
    with pytest.raises(ValueError, match=message):
        design_proved(**({"machine": RIG, "friction": CLASS, "dt": 1e-3} | options))
