"""Friction with stiction settles within a bound: its lemma, what is below it, an attack, and the
certificate.
"""

from dataclasses import replace

import control
import numpy as np
import pytest

from benchmarks.settling import (
    FS,
    Axis,
    attack,
    cascade,
    draw_axis,
    draw_law,
    hunting,
    settling_proof,
)
from robust import friction_plant, prove_friction, save
from robust.friction import Bounded, MaxwellSlip
from robust.io import verify_certificate

T = 1 / 4000
MACHINE = friction_plant(10.0, 0.0)
AXIS = Axis(mass=10.0, K=cascade(10.0, 50.0, T, 0.25, 10.0), T=T, K0=2e6, stiction=1.5)
SLOW = 2 * np.pi * 10.0  # rad/s
HUNTS = Axis(
    mass=10.0, K=cascade(10.0, 10.0, 1e-3, 0.3, 4.0), T=1e-3, K0=80 * SLOW**2, stiction=3.0
)


@pytest.fixture(scope="module")
def proof():
    return settling_proof(AXIS)


def largest_rest(W, rho):
    """Largest difference between sliders of W/rho to W and constant sliders of their mean."""
    return (W - W / rho) / 2


def test_the_rest_beside_constant_sliders_is_bounded():
    """f with sliders drawn anew whenever they stick, and that drop on the way; g with constant
    ones.
    """
    rng, W, rho, step = np.random.default_rng(1), 1.0, 1.7, 1e-3
    worst, f, g, limit = 0.0, 0.0, 0.0, W
    mean, bound = (W + W / rho) / 2, largest_rest(W, rho)
    direction = 1.0
    for _ in range(200_000):
        direction = -direction if rng.random() < 1e-3 else direction
        if abs(f) < limit:
            f += step * direction
            if abs(f) >= limit:  # breaks away, and may fall at once
                f = np.sign(f) * rng.uniform(W / rho, abs(f))
                limit = abs(f)
        elif np.sign(f) != direction:
            limit = rng.choice([W, W / rho, rng.uniform(W / rho, W)])
            f, limit = f + step * direction, max(limit, abs(f))
        else:
            limit = rng.uniform(max(W / rho, limit - 0.01), min(W, limit + 0.01))
            f = np.sign(f) * limit
        g = float(np.clip(g + step * direction, -mean, mean))
        worst = max(worst, abs(f - g))
    assert 0.9 * bound < worst <= bound + 2 * step


def test_no_bound_is_below_that_of_a_spring_of_the_class(proof):
    """Beside any rest a spring of the class is a friction without stiction: the bound covers its
    convolution.
    """
    rest = largest_rest(FS, AXIS.stiction)
    for stiffness in (0.0, AXIS.K0 / 3, AXIS.K0):
        held = prove_friction(friction_plant(10.0, stiffness), AXIS.K, Bounded(1.0), delay=T)
        assert proof.settling_error > 0.99 * rest * held.error_bound


def test_it_is_below_the_bound_of_any_friction_and_scales_with_the_force(proof):
    assert proof.verdict == "settles"
    assert proof.settling_error < 0.5 * proof.error_bound
    assert f"Settles within {proof.settling_error:.3g} m of rest from every state" in str(proof)
    assert "of at most 20 N" in proof.claim
    assert "rest not decided: " in str(proof)
    half = prove_friction(MACHINE, AXIS.K, MaxwellSlip(2e6, 1.5), delay=T, Fs=FS / 2)
    assert half.settling_error == pytest.approx(proof.settling_error / 2, rel=1e-6)


def test_friction_that_is_chosen_to_hunt_stays_inside():
    proof = settling_proof(HUNTS)
    reached, moves = attack(np.random.default_rng(5), HUNTS, 16)
    assert moves.any()
    assert (
        0.05 * proof.settling_error < reached[moves].max() <= reached.max() <= proof.settling_error
    )


def test_the_certificate_is_verified_and_what_was_changed_is_not(proof, tmp_path):
    assert proof.certificate.verify().verified
    save(proof, tmp_path / "settles.json")
    assert verify_certificate(tmp_path / "settles.json", K=AXIS.K).verified
    claim, verify = proof.certificate.claim, proof.certificate.again
    own = claim.settling
    for changed, failed in (
        (replace(own, error=0.99 * own.error), "the energy allows more"),
        (replace(own, Fs=1.01 * own.Fs), "the energy allows more"),
        (replace(own, decay=2 * claim.ports[0].rates.max()), "a filter is slower than the decay"),
        (replace(own, decay=-1.0), "decay or Fs is not positive"),
    ):
        found = verify(replace(claim, settling=changed))
        assert not found.verified
        assert failed in dict(found.failed).values()
    (port,) = claim.ports
    assert not verify(replace(claim, ports=(replace(port, K0=3 * port.K0),))).verified
    assert not verify(replace(claim, ports=(replace(port, free=1.0),))).verified
    assert "it does not" in dict(verify(replace(claim, P=1.5 * claim.P)).failed).values()
    with pytest.raises(ValueError, match="decay must be finite"):
        replace(claim, settling=replace(own, decay=np.nan))


@pytest.mark.attack
def test_a_continuous_controller_and_a_part_of_a_sample():
    friction = MaxwellSlip(2e6, 2.0)
    late = prove_friction(MACHINE, AXIS.K, friction, delay=0.4 * T, Fs=FS)
    assert late.certificate.claim.counts.size == 2
    assert late.certificate.verify().verified
    K = control.ss(control.tf([3140.0, 3140.0 * 110, 3140.0 * 78 * 31.4], [1e-4, 1, 0]))
    held = prove_friction(MACHINE, K, friction, Fs=FS)
    assert held.certificate.claim.P.shape[:2] == (1, 1)
    assert held.certificate.verify().verified
    assert held.settling_error < 0.7 * held.error_bound


def test_without_integral_action_the_rest_is_in_the_bound():
    """An integrator that forgets 0.1 % a sample holds the mass up to Fs (1 + 1/rho)/2 over the
    stiffness of the controller away; a spring of the class keeps it still.
    """
    poles, modes = np.linalg.eig(AXIS.K.A)
    poles[np.argmin(np.abs(poles - 1))] = 0.999
    A = (modes * poles @ np.linalg.inv(modes)).real
    K = control.StateSpace(A, AXIS.K.B, AXIS.K.C, AXIS.K.D, T)
    held = FS * (1 + 1 / 3) / 2 / float(K(1.0).real)
    found = prove_friction(MACHINE, K, MaxwellSlip(2e6, 3.0), delay=T, Fs=FS)
    assert found.verdict == "settles"
    assert held < found.settling_error < found.error_bound
    assert found.certificate.verify().verified
    claim = found.certificate.claim
    without = replace(claim.settling, error=claim.settling.error - held)
    assert not found.certificate.again(replace(claim, settling=without)).verified


def test_a_class_without_the_theorem_has_the_bound_of_any_friction():
    friction = MaxwellSlip(2e6, 1.5, bristle_time=1e-4)
    proof = prove_friction(MACHINE, AXIS.K, friction, delay=T, Fs=FS)
    assert proof.verdict == "settles"
    assert proof.settling_error == proof.error_bound
    assert "Settles within" in proof.claim


def test_drawn_axes_and_laws_run():
    rng = np.random.default_rng(3)
    axis = draw_axis(rng)
    assert hunting(rng, AXIS, draw_law(rng, AXIS))[0] >= 0
    assert axis.stiction > 1
