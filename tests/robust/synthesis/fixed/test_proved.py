"""Controllers that are proved for a class of friction by design."""

import control
import pytest

from robust import design_frf, friction_plant, prove_friction
from robust.friction import MaxwellSlip, Passive

RIG = friction_plant(1.0, 80e3, 0.4)
CLASS = MaxwellSlip(64e3)


STUCK = control.ss(control.tf([1], [1, 13.4, 144e3]))
ASKED = {"M_S": 2.0, "dt": 1e-3}


@pytest.mark.attack
def test_where_no_gain_is_proved_the_class_is_refused():
    undamped = friction_plant(1.0, 80e3)  # an integrator alone makes it unstable at every gain
    with pytest.raises(
        ValueError, match="prove must be a class for which the proof holds with some gain"
    ):
        design_frf(STUCK, "I", prove=(undamped, CLASS), **ASKED)


def test_a_design_from_the_frf_is_lowered_until_it_is_proved():
    """On the stuck machine alone a PID may destabilise the sliding one; with the class it
    does not.
    """
    alone = design_frf(STUCK, "I", **ASKED)
    assert prove_friction(RIG, alone.K, CLASS).verdict == "refuted"
    for given, message in (
        ((1.0, CLASS), "machine must be a friction_plant, or a MachineWithFriction alone, got 1.0"),
        ((RIG, Passive()), "friction must be of type MaxwellSlip"),
    ):
        with pytest.raises(ValueError, match=message):
            design_frf(STUCK, "PID", prove=given, **ASKED)
    better = design_frf(STUCK, "PID", prove=(RIG, CLASS), **ASKED)
    assert prove_friction(RIG, better.K, CLASS).verdict == "proved"
    assert "proved for its class of friction" in better.reason
    above = 1.03**2 * better.K  # the largest gain that is proved, within 3 %
    assert prove_friction(RIG, above, CLASS).verdict != "proved"
