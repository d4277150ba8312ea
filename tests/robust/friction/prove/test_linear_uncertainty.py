"""Friction and an LTI error of the linear part at once: a small-gain oracle, and never more than what is true."""

import itertools

import control
import numpy as np
import pytest

from robust import friction_plant, prove_friction
from robust.friction import any_bristle, any_maxwell_slip, friction_frequency_test
from robust.friction.proof.linear_uncertainty import find_multipliers, uncertain_rows
from robust.friction.proof.multipliers import multiplier_terms
from tests.support.friction_loops import ORACLES, RIG, T, oracle_loop, pd, pid
from tests.support.printed import unwrapped

SLIP = any_maxwell_slip(64e3, 1.05)


def test_the_rows_of_the_friction_are_those_of_the_proof():
    """At p = 0, and by hand at one frequency for the whole form."""
    omega, rates = np.geomspace(1, 1e3, 7), np.array([20.0, 300.0])
    M = np.exp(1j * omega / 100) / 50
    table, q = uncertain_rows(M, omega, rates=rates, K0=64e3, rho=1.3, error=np.full(7, 500.0))
    assert np.allclose(table[..., 0, 0].real, multiplier_terms(M, omega, rates=rates, K0=64e3, rho=1.3))
    f, p, i = 0.3 - 0.2j, 0.1 + 0.5j, 3
    s, a = 1j * omega[i], rates[1]
    v, fh = M[i] * (f - p), a / (a + s) * f
    by_hand = ((f - fh / 1.3).conjugate() * v).real - abs(s * fh) ** 2 / (1.3 * a * 64e3)
    z = np.array([f, p])
    assert (z.conj() @ table[i, 2] @ z).real == pytest.approx(by_hand)
    assert (z.conj() @ q[i] @ z).real == pytest.approx(abs(500 * v / s) ** 2 - abs(p) ** 2)


def test_a_small_gain_alone():
    """One frequency, friction all but absent: weights exist exactly where |q/p| < 1 around the loop."""
    M, omega, rates = np.array([-0.02 + 0.0j]), np.array([100.0]), np.array([100.0])
    edge = omega[0] / abs(M[0])  # [N/m] at which |error M/jw| = 1
    for share, exists in ((0.95, True), (1.05, False)):
        table, q = uncertain_rows(M, omega, rates=rates, K0=64e3, rho=1.3, error=np.array([share * edge]))
        assert find_multipliers(table, q) is exists


@pytest.mark.parametrize("name", ["P1", "P2", "P3", "P4"])
def test_what_holds_is_true_at_the_corners(name):
    """Where the test holds, the loop with each extreme mass and spring is refuted by no spring, and mostly proved."""
    (Kp, Ki, Kd, delay), _, _ = ORACLES[name]
    K, off = pid(Kp, Ki, Kd), {"mass": 0.01, "stiffness": 800.0}
    assert friction_frequency_test(RIG, K, SLIP, delay=delay, **off).holds
    for m, k in itertools.product((-0.01, 0.01), (-800.0, 800.0)):
        assert prove_friction(friction_plant(1 + m, 80e3 + k, 0.4), K, SLIP, delay=delay).verdict == "proved"


def test_an_error_that_takes_the_spring_away_is_not_passed():
    loop = oracle_loop("P1")
    assert loop.growth() < 0
    found = friction_frequency_test(RIG, pd(20e3, 60.0), SLIP, mass=0.0, stiffness=110e3)
    assert not found.holds
    assert np.isnan(found.margin)
    assert "not a proof" in unwrapped(found)
    unstable = control.StateSpace([[1.0]], [[1.0]], [[4e5 * T]], [[0.0]], T)
    assert not friction_frequency_test(RIG, unstable, SLIP, mass=1e-6, stiffness=1e-3).holds


def test_the_margin_holds():
    found = friction_frequency_test(RIG, pd(20e3, 60.0), SLIP, mass=0.02, stiffness=800.0, margin=True)
    assert 1.5 <= found.margin <= 16
    more = {"mass": 0.02 * found.margin, "stiffness": 800.0 * found.margin}
    assert friction_frequency_test(RIG, pd(20e3, 60.0), SLIP, **more).holds


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: friction_frequency_test(3.0, 1.0, SLIP, mass=0.1, stiffness=1.0), "machine must be a friction_plant"),
        (lambda: friction_frequency_test(RIG, 1.0, any_bristle(1.0), mass=0.1, stiffness=1.0), "friction must be any_"),
        (lambda: friction_frequency_test(RIG, 1.0, SLIP, mass=-0.1, stiffness=1.0), "mass must be zero or positive"),
        (lambda: friction_frequency_test(RIG, 1.0, SLIP, mass=0.0, stiffness=0.0), "must not both be zero"),
    ],
)
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()
