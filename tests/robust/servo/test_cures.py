"""What changes a friction verdict: each number is that of a proof with the change, in the units of
the axis.
"""

from dataclasses import replace

import pytest

from nlfrf.rig import Drive
from robust import friction_plant, prove_friction
from robust.friction import MaxwellSlip
from robust.servo import cascade, friction_cures

SETTINGS = Drive(fs=1000, kv=31, kp=1.26, kp_unit="Nm/(rad/s)", tn=0.04)
MACHINE = friction_plant(0.01, 0.0, position_unit="rad")
SLIP = MaxwellSlip(1e3, 3.0, position_unit="rad")


@pytest.mark.attack
def test_each_cure_is_a_proof_of_the_changed_drive():
    cures = friction_cures(MACHINE, SETTINGS, SLIP, Fs=0.1)
    assert [cure.verdict for cure in cures] == sorted(
        (cure.verdict for cure in cures), key=lambda v: v != "proved"
    )
    by_change = {cure.change: cure for cure in cures}

    def proved(settings):
        return prove_friction(
            MACHINE, cascade(settings, output_unit="Nm"), SLIP, delay=1e-3, Fs=0.1
        )

    present = proved(SETTINGS).settling_error
    faster = proved(replace(SETTINGS, kp=1.89)).settling_error
    longer = proved(replace(SETTINGS, tn=0.06)).settling_error
    errors = {change: cure.error for change, cure in by_change.items() if cure.verdict == "settles"}
    assert (errors.get("kp 1.26 -> 1.89 Nm/(rad/s)") == faster) == (faster < present)
    assert (errors.get("tn 40 -> 60 ms") == longer) == (longer < present)
    assert list(errors.values()) == sorted(errors.values())
    assert max(errors.values()) < present
    # without an integrator the friction holds the axis up to Fs/(kp kv) away
    without = by_change["no integral action (dead band or leak of the integrator)"]
    assert without.verdict == "proved"
    assert without.error == pytest.approx(0.1 / (1.26 * 31), rel=1e-6)
    compensated = by_change["friction compensated to 30 %, while the compensation acts"]
    assert compensated.error == pytest.approx(0.3 * proved(SETTINGS).error_bound)
    assert " ".join(str(compensated).split()).endswith(" rad for ever")


def test_a_drive_without_an_integrator_has_no_reset_time_to_change():
    cures = friction_cures(MACHINE, replace(SETTINGS, tn=float("inf")), SLIP, Fs=0.1)
    assert not [cure for cure in cures if cure.change.startswith(("tn", "no"))]


def test_what_is_no_force_is_refused():
    with pytest.raises(ValueError, match="Fs must be positive, got -1"):
        friction_cures(MACHINE, SETTINGS, SLIP, Fs=-1.0)
    with pytest.raises(
        ValueError, match="friction must be in the units of the machine, rad, got m"
    ):
        friction_cures(MACHINE, SETTINGS, MaxwellSlip(1e3), Fs=0.1)
