"""The claim of a schedule: what is wrong in it is not proved, and the moves of P lie in their
hull.
"""

from dataclasses import replace
from itertools import pairwise

import control
import numpy as np
import pytest
from flint import ctx

from robust import prove_schedule
from robust.models import LpvModel
from robust.proofs.exact.polynomial_matrices import PolynomialMatrix
from robust.proofs.exact.scheduled_kyp import decide_schedule, moved_polynomials, verify_schedule
from robust.proofs.exact.trajectories import Trajectory, grows, transition


@pytest.fixture(scope="module")
def claim():
    """Return the proved claim of a sampled loop with a delay and a set."""
    systems = [control.ss([[0, 1], [-k, -4.0]], [[0], [1]], [[1, 0]], 0) for k in (30.0, 50.0)]
    weight = control.ss([], [], [], 0.5, 0.01)
    plant = LpvModel.from_points(systems, at=[0, 1], weight=weight)
    proof = prove_schedule(
        plant, control.ss([], [], [], 10.0, 0.01), rate=0.5, delay=0.01, limit=False
    )
    assert proof.holds
    return proof.certificate.claim


def test_the_claim_is_proved_again(claim):
    assert decide_schedule(claim).holds
    assert verify_schedule(claim).verified


def test_a_wrong_claim_is_not_proved(claim):
    for change in (
        {"P": -claim.P},
        {"P": claim.P + np.triu(np.ones(claim.P.shape[1:]), 1)},
        {"P": claim.P[:, :-1, :-1]},
        {"scalings": -claim.scalings},
        {"scalings": claim.scalings[:-1]},
        {"S": claim.S * np.linspace(1, 30, len(claim.S))},
        {"rate": 1000 * claim.rate},
        {"weight": replace(claim.weight, D=20 * claim.weight.D)},
    ):
        assert not decide_schedule(replace(claim, **change)).holds, change


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_moves_of_p_lie_in_the_hull(degree):
    """For every direction the largest move is one of the hull."""
    rng, s = np.random.default_rng(degree), 0.13
    P = rng.normal(size=(degree + 1, 4, 4))

    def at(array, theta):
        return np.tensordot(theta ** np.arange(len(array)), array, 1)

    with ctx.workprec(256):
        hull = [each.to_array() for each in moved_polynomials(PolynomialMatrix.of(P), s)]
        anywhere = [each.to_array() for each in moved_polynomials(PolynomialMatrix.of(P), np.inf)]
    for theta in (-0.7, 0.0, 0.9):
        for x in rng.normal(size=(20, 4)):
            found = [x @ at(P, theta + v) @ x for v in np.linspace(-s, s, 31)]
            ends = [x @ at(each, theta) @ x for each in hull]
            assert min(ends) - 1e-12 <= min(found) <= max(found) <= max(ends) + 1e-12
            jumps = [x @ at(each, theta) @ x for each in anywhere]
            assert min(jumps) - 1e-12 <= x @ at(P, -theta) @ x <= max(jumps) + 1e-12


def test_transition_of_a_moving_parameter():
    """x' = (a + b theta) x with theta linear: exp(a T + b mean T); and the product of many short
    steps.
    """
    with ctx.workprec(256):
        scalar = transition(
            PolynomialMatrix.of(np.array([-1.0, 3.0]).reshape(2, 1, 1)), -0.5, 1.0, 2.0
        )
        A = np.random.default_rng(1).normal(size=(3, 3, 3))
        whole = transition(PolynomialMatrix.of(A), -0.8, 0.6, 0.7)
        ends = np.linspace(-0.8, 0.6, 8)
        parts = [transition(PolynomialMatrix.of(A), a, b, 0.1) for a, b in pairwise(ends)]
    assert abs(float(scalar[0, 0]) - np.exp(-2.0 + 3.0 * 0.25 * 2.0)) < 1e-13
    product = np.eye(3)
    for part in parts:
        product = np.array([[float(part[i, j]) for j in range(3)] for i in range(3)]) @ product
    assert np.allclose(
        product, [[float(whole[i, j]) for j in range(3)] for i in range(3)], rtol=1e-12, atol=1e-13
    )


def test_a_trajectory_outside_the_claim_does_not_count(claim):
    growing = Trajectory(theta=np.array([-40.0, 40.0]), step=0.01, held=True)
    assert not grows(claim, growing)
    assert not grows(claim, Trajectory(theta=np.array([-1.0, 1.0]), step=0.01, held=True))
