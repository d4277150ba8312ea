"""Every passive friction: sharp resonances of the controller, springs on a fine grid, delays,
hidden states.
"""

import control
import numpy as np
import pytest

from benchmarks.bench_friction_attack import (
    continuous_resonance,
    fine_need,
    passive_attack,
    sampled_resonance,
)
from robust import friction_plant, prove_friction
from robust.friction import Bounded, Passive
from tests.support.friction_loops import RIG, T, growth, pd, sliding_loop

PASSIVE = Passive()


def needed(proof):
    """[Ns/m] as the reason says it."""
    return float(proof.reason.split(" Ns/m are needed")[0].split()[-1])


def test_a_sharp_resonance_is_seen():
    """Pole radius 1 - 1e-4 at 150 Hz:

    17.35 Ns/m by Colgate and Schenkel, 10 are there, and a spring is unstable.
    """
    angle = 0.94319
    K = sampled_resonance(100.0, 10**0.5, 1 - 1e-4, angle)
    machine = friction_plant(1.0, 0.0, 10.0)
    proof = prove_friction(machine, K, PASSIVE)
    assert proof.verdict == "not decided"
    assert needed(proof) == pytest.approx(fine_need(K), rel=1e-3)
    assert 17 < needed(proof) < 18
    loop = sliding_loop(machine, K)
    stiffness = (angle / T) ** 2 * np.linspace(0.995, 1.005, 201)
    assert max(growth(loop, k) for k in stiffness) > 1e-5
    enough = prove_friction(friction_plant(1.0, 0.0, 1.01 * needed(proof)), K, PASSIVE)
    assert enough.verdict == "proved"
    assert needed(enough) == pytest.approx(needed(proof), rel=1e-3)


def test_a_light_mode_of_a_continuous_controller_is_seen():
    """zeta = 1e-4 at 300 rad/s: a spring of 72 kN/m puts a pole at +0.0085."""
    machine = friction_plant(1.0, 1e4, 5.0)
    K = continuous_resonance(2e3 * 0.9486833, np.radians(60), 300.0, 1e-4)
    assert growth(sliding_loop(machine, K), 72028.234) == pytest.approx(0.00852, abs=1e-4)
    proof = prove_friction(machine, K, PASSIVE)
    assert proof.verdict == "not decided"
    assert "Ns/m are missing" in proof.reason


def test_no_spring_breaks_what_is_proved():
    """A seeded part of the attack of the benchmark."""
    verdicts, broken = passive_attack(40, np.random.default_rng(3))
    assert verdicts["proved"] >= 5
    assert verdicts["not decided"] >= 5
    assert broken == []


def test_a_delay_needs_more_damping():
    """A wall of K = 20 kN/m: K T/2 = 10 Ns/m without a delay, with one sample of it 3 K T/2 =
    30.
    """
    wall = pd(20e3, 0.0)
    for samples, least in ((0, 10.0), (1, 30.0)):
        too_little, enough = (
            prove_friction(friction_plant(1.0, 80e3, c), wall, PASSIVE, delay=samples * T)
            for c in (0.99 * least, 1.01 * least)
        )
        assert too_little.verdict != "proved"
        assert enough.verdict == "proved"
        assert needed(enough) == pytest.approx(least, rel=1e-3)
    proof = prove_friction(friction_plant(1.0, 80e3, 99.0), wall, PASSIVE, delay=0.5 * T)
    assert (proof.verdict, "whole samples only" in proof.reason) == ("not decided", True)


def test_a_model_in_other_coordinates_is_the_machine():
    """The damping is read from the model, not from one entry of it."""
    turn = np.array([[1.0, 0.0], [3.0, 2.0]])
    A, B, C = np.array([[0, 1], [-80e3, -10.2]]), np.array([[0.0], [1.0]]), np.array([[1.0, 0.0]])
    turned = control.ss(turn @ A @ np.linalg.inv(turn), turn @ B, C @ np.linalg.inv(turn), 0)
    proof = prove_friction(friction_plant(turned), pd(20e3, 0.0), PASSIVE)
    assert proof.verdict == "proved"
    assert "c = 10.2 Ns/m" in proof.reason


@pytest.mark.parametrize("friction", [PASSIVE, Bounded(1.0)])
def test_a_hidden_integrator_that_the_position_drives_is_kept(friction):
    K = pd(100.0, 1.0)
    A = np.block([[K.A, np.zeros((1, 1))], [np.zeros((1, 1)), np.eye(1)]])
    hidden = control.StateSpace(A, np.vstack([K.B, [[1.0]]]), np.hstack([K.C, [[0.0]]]), K.D, T)
    machine = friction_plant(1.0, 80e3, 20.0)
    assert prove_friction(machine, K, friction).verdict == "proved"
    assert prove_friction(machine, hidden, friction).verdict == "not decided"


def test_what_may_drift_is_not_decided():
    """A pole at zero ended in a singular matrix."""
    proof = prove_friction(friction_plant(1.0, 0.0, 5.0), 0.0, PASSIVE)
    assert (proof.verdict, "not strictly stable" in proof.reason) == ("not decided", True)
    integral = control.ss(control.tf([1e3, 1e4], [1, 0]))
    proof = prove_friction(RIG, integral, PASSIVE)
    assert (proof.verdict, "no damping is enough" in proof.reason) == ("not decided", True)


def test_of_a_continuous_loop_the_damping_that_is_left_is_told():
    proof = prove_friction(friction_plant(1.0, 80e3, 5.0), 1e3, PASSIVE)
    assert proof.verdict == "proved"
    assert "at least 5 Ns/m of damping is left" in proof.reason
