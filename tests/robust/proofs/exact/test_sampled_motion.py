"""One sample of a plant that moves: the exponential within its bound, every motion within L, R and
eps.
"""

import numpy as np
import pytest
from flint import ctx
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from robust.proofs.exact.sampled_motion import sample_plant

DT = 2e-3
A = np.array(
    [
        [[0, 0, 1, 0], [0, 0, 0, 1], [-9e4, 9e4, -30, 10], [4e4, -4e4, 5, -15]],
        [[0] * 4, [0] * 4, [-3e4, 3e4, 0, 0], [1.4e4, -1.4e4, 0, 0]],
        [[0] * 4, [0] * 4, [2e3, 0, 0, 0], [0, 0, 0, 3.0]],
    ],
    dtype=float,
)
B = np.array([[[0], [0], [2.0], [0]], [[0], [0], [0.5], [0]], [[0]] * 4], dtype=float)


def augmented(theta):
    powers = theta ** np.arange(3)
    return np.block([[np.tensordot(powers, A, 1), np.tensordot(powers, B, 1)], [np.zeros((1, 5))]])


def sampled(rate, dt=DT):
    with ctx.workprec(256):
        return sample_plant(A, B, dt=dt, rate=rate)


def in_units(found, X):
    return X / found.units[:4, None] * found.units


@pytest.mark.parametrize(("dt", "bound"), [(DT, 1e-10), (10 * DT, 1e-8)])
def test_the_exponential_is_within_its_bound(dt, bound):
    found = sampled(0.0, dt)
    coefficients = found.F.to_array()
    errors = []
    for theta in np.linspace(-1, 1, 41):
        exact = in_units(found, expm(augmented(theta) * dt)[:4])
        errors.append(
            np.linalg.norm(
                np.tensordot(theta ** np.arange(len(coefficients)), coefficients, 1) - exact, 2
            )
        )
    assert max(errors) < found.eps + 1e-11  # and what expm itself loses
    assert found.eps < bound


def test_every_motion_within_a_sample_is_covered_and_not_by_much():
    rate, rng = 40.0, np.random.default_rng(0)
    found = sampled(rate)
    coefficients = found.F.to_array()
    sizes = []
    for _ in range(40):
        start, slope = rng.uniform(-0.9, 0.9), rng.choice([-rate, rate]) * rng.choice([1.0, 0.3])
        turns = rng.choice([0, 3])  # straight, or to and fro within the sample

        def theta(t, start=start, slope=slope, turns=turns):
            return start + slope * (
                t if not turns else DT / turns * np.abs((turns * t / DT + 1) % 2 - 1)
            )

        def flow(t, X, theta=theta):
            return (augmented(theta(t)) @ X.reshape(5, 5)).ravel()

        X = solve_ivp(flow, (0, DT), np.eye(5).ravel(), rtol=1e-11, atol=1e-13, max_step=DT / 50).y[
            :, -1
        ]
        held = np.tensordot(start ** np.arange(len(coefficients)), coefficients, 1)
        moved = in_units(found, X.reshape(5, 5)[:4]) - held
        # moved = L operator R + e
        operator = np.linalg.pinv(found.L) @ moved @ np.linalg.pinv(found.R)
        assert np.linalg.norm(moved - found.L @ operator @ found.R, 2) < found.eps + 1e-9
        sizes.append(np.linalg.norm(operator, 2))
    assert 0.5 < max(sizes) < 1


def test_a_motion_that_is_too_fast_has_no_bound():
    assert sampled(1e6) is None
