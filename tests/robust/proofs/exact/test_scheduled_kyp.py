"""The claim of a schedule: what is wrong in it is not proved, and the moves of P lie in their
hull.
"""

from dataclasses import replace
from itertools import pairwise

import control
import numpy as np
import pytest
from flint import ctx
from scipy.integrate import solve_ivp

from robust import prove_schedule
from robust.models import LpvModel
from robust.proofs.exact.polynomial_matrices import PolynomialMatrix
from robust.proofs.exact.scheduled_kyp import moved_polynomials
from robust.proofs.exact.trajectories import Trajectory, grows


@pytest.fixture(scope="module")
def proof():
    """The certificate of a sampled loop with a delay and a set."""
    systems = [control.ss([[0, 1], [-k, -4.0]], [[0], [1]], [[1, 0]], 0) for k in (30.0, 50.0)]
    weight = control.ss([], [], [], 0.5, 0.01)
    plant = LpvModel.from_points(systems, at=[0, 1], weight=weight)
    proof = prove_schedule(
        plant, control.ss([], [], [], 10.0, 0.01), rate=0.5, delay=0.01, limit=False
    )
    assert proof.holds
    return proof.certificate


def test_the_claim_is_proved_again(proof):
    assert proof.verify().verified


def test_a_wrong_claim_is_not_proved(proof):
    claim = proof.claim
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
        assert not proof.again(replace(claim, **change)).verified, change


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


@pytest.fixture(scope="module")
def still():
    """A claim on a continuous loop without a controller."""
    lag = LpvModel.from_points([control.ss(-k, 1, 1, 0) for k in (1.0, 1.2)], at=[0, 1])
    return prove_schedule(lag, 0.0, rate=1.0, limit=False).certificate.claim


def grows_with(claim, A, **trajectory):
    """Whether x' = A(theta) x grows."""
    d, n = A.shape[:2]
    plant = {"A": A, "B": np.zeros((d, n, 1)), "C": np.zeros((d, 1, n)), "D": np.zeros((d, 1, 1))}
    return grows(replace(claim, plant=replace(claim.plant, **plant)), Trajectory(**trajectory))


@pytest.mark.parametrize("held", [False, True])
def test_growth_of_a_scalar_is_that_of_its_mean(still, held):
    """x' = (a + b theta) x: exp(a T + b mean T), to and fro in a line or held at both ends."""
    for excess in (1e-13, -1e-13):
        A = np.array([-0.75 + excess, 3.0]).reshape(2, 1, 1)
        theta = np.array([-0.5, 1.0])
        assert grows_with(still, A, theta=theta, step=2.0, held=held) is (excess > 0)


def test_growth_of_matrices_is_that_of_many_short_steps(still):
    """The spectral radius of a period, integrated in floating point; vertices on the way change
    nothing.
    """
    A, step = np.random.default_rng(1).normal(size=(3, 3, 3)), 0.7
    vertices, period = np.array([-0.8, 0.6, 0.1]), np.eye(3)
    for start, end in pairwise([*vertices, vertices[0]]):

        def flow(t, x, start=start, end=end):
            theta = start + (end - start) * t / step
            return (np.tensordot(theta ** np.arange(3), A, 1) @ x.reshape(3, 3)).ravel()

        period = (
            solve_ivp(flow, (0, step), period.ravel(), method="DOP853", rtol=1e-13, atol=1e-13)
            .y[:, -1]
            .reshape(3, 3)
        )
    rate = np.log(np.abs(np.linalg.eigvals(period)).max()) / (3 * step)
    parts = np.interp(np.arange(21) / 7, np.arange(4), [*vertices, vertices[0]])
    for excess in (1e-10, -1e-10):
        moved = A - (rate - excess) * np.multiply.outer([1, 0, 0], np.eye(3))
        assert grows_with(still, moved, theta=vertices, step=step) is (excess > 0)
        assert grows_with(still, moved, theta=parts, step=step / 7) is (excess > 0)


def test_a_trajectory_outside_the_claim_does_not_count(proof):
    claim = proof.claim
    growing = Trajectory(theta=np.array([-40.0, 40.0]), step=0.01, held=True)
    assert not grows(claim, growing)
    assert not grows(claim, Trajectory(theta=np.array([-1.0, 1.0]), step=0.01, held=True))
