"""Bounded friction: machines faster than their clock in closed form, the stability boundary, what
is refused.
"""

import re

import control
import numpy as np
import pytest

from benchmarks.bench_friction_attack import bang_bang, fast_machine, hunted, stopping_kick
from robust import friction_plant, prove_friction
from robust.friction import Bounded, MaxwellSlip
from tests.support.friction_loops import T

BOUNDED = Bounded(1.0)
STILL = control.StateSpace([], [], [], [[0.0]], T)


@pytest.mark.attack(every=2)
@pytest.mark.parametrize("swings", [2e-3, 2e-2, 0.3, 3.0, 20.0, 32.0])
def test_a_mode_hunts_as_in_closed_form_whatever_the_clock(swings):
    """coth(pi zeta/(2 sqrt(1 - zeta^2)))/k; it was 1/k at 32 swings a sample, and took long at few
    swings a sample.
    """
    zeta = 0.01
    machine, k = fast_machine(swings, zeta)
    K = control.StateSpace([], [], [], [[1e-9 * k]], 0.01)
    right = bang_bang(zeta) / k
    assert right <= prove_friction(machine, K, BOUNDED).error_bound <= 1.006 * right


def test_a_bang_bang_friction_stays_within_the_bound():
    machine, k = fast_machine(10.0, 0.05)
    K = control.StateSpace([], [], [], [[1e-3 * k]], 0.01)
    proof = prove_friction(machine, K, BOUNDED)
    reached = hunted(machine, K, 40)
    assert 0.97 * proof.error_bound < reached <= proof.error_bound


@pytest.mark.parametrize("swings", [0.2, 3.3, 20.2])
def test_a_sure_kick_is_sure_and_little_more(swings):
    """Less than the least kick that no |f| <= 1 N stops, from the exact effect of a force on the
    unstable mode.
    """
    machine, k = fast_machine(swings, 0.05 if swings < 5 else 0.02)
    K = control.StateSpace([], [], [], [[-1.3 * k]], 0.01)
    kick = prove_friction(machine, K, MaxwellSlip(k), Fs=1.0).kick_sure
    least = stopping_kick(machine, K, 4096)
    assert 0.9999 * least <= kick <= 1.01 * least


@pytest.mark.parametrize(
    ("numbers", "K"),
    [
        ((1.0, 1e4, 0.0), 0.0),
        ((1.0, 1e4, 0.0), STILL),
        ((1.0, 0.0, 0.0), STILL),
        ((1.0, 0.0, 5.0), 0.0),
    ],
)
def test_at_the_stability_boundary_nothing_is_proved(numbers, K):
    """f = -sign(v) pumps an undamped spring without end; a constant f pushes a free mass away."""
    proof = prove_friction(friction_plant(*numbers), K, BOUNDED)
    assert proof.verdict != "proved"
    assert np.isinf(proof.error_bound)


def test_a_free_mass_without_control_is_answered():
    """Its poles are all zero: a period of no length ended in a traceback."""
    assert prove_friction(friction_plant(1.0, 0.0, 0.0), 0.0, BOUNDED).verdict != "proved"


def test_what_takes_too_long_to_follow_is_not_decided():
    machine, k = fast_machine(1e4, 0.01)
    proof = prove_friction(machine, control.StateSpace([], [], [], [[1e-9 * k]], 0.01), BOUNDED)
    assert (proof.verdict, "too far apart" in proof.reason) == ("not decided", True)
    proof = prove_friction(friction_plant(1.0, 1e4, 1e-4), STILL, BOUNDED)
    assert (proof.verdict, "too far apart" in proof.reason) == ("not decided", True)


def test_a_pole_beside_one_is_told_from_it():
    machine = friction_plant(control.ss([[0, 1], [-1e4, 5e-4]], [[0], [1]], [[1, 0]], 0))
    proof = prove_friction(machine, STILL, MaxwellSlip(1e3))
    assert proof.verdict == "refuted"
    assert "|z| = 1.00000025" in proof.reason


def test_a_gain_is_no_machine():
    with pytest.raises(
        ValueError, match="mass must be a dynamic model from force to position, got a gain"
    ):
        friction_plant(control.StateSpace([], [], [], [[0.0]]))


def test_a_machine_that_turns_speaks_of_rad_and_newton_metres():
    machine = friction_plant(0.01, 800.0, 0.4, position_unit="rad")
    friction = MaxwellSlip(640.0, position_unit="rad")
    said = str(prove_friction(machine, 10.0, friction, Fs=0.1))
    assert "kNm/rad" in said
    assert "Nm s/rad" in said
    assert not re.search(r"kN/m|\bkg\b(?! m\^2)|Ns/m|\d m\b|\bN\b", said)
    with pytest.raises(
        ValueError, match="friction must be in the units of the machine, rad, got m"
    ):
        prove_friction(machine, 10.0, MaxwellSlip(640.0))
    with pytest.raises(ValueError, match='position_unit must be "m" or "rad", got \'deg\''):
        Bounded(1.0, position_unit="deg")
