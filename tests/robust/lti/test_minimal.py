"""Matrices of transfer functions as minimal state spaces, without a foreign library."""

import control
import numpy as np
import pytest

import robust
from tests.support.sets import realised

PAIR, FAR = [1, 0.1, 1], np.poly([-1e6, -1, -1e-6])


def matrix_of(numerators, denominators, dt=0):
    return control.tf([[np.atleast_1d(one) for one in row] for row in numerators], denominators, dt)


@pytest.mark.parametrize(
    ("G", "order"),
    [
        (matrix_of([[1, 1], [1, 1]], [[[1, -1]] * 2] * 2), 1),
        (matrix_of([[1, 1], [1, 2]], [[[1, -1]] * 2] * 2), 2),
        (
            matrix_of([[1, 1e8], [1e-8, 1]], [[[1, -1]] * 2] * 2),
            1,
        ),  # channels in units of their own
        (matrix_of([[1, 1e8], [1e-8, 2]], [[[1, -1]] * 2] * 2), 2),
        (matrix_of([[1, 0], [0, 1]], [[[1, 0], [1]], [[1], [1, 0]]]), 2),
        (matrix_of([[1, 1], [1, 1]], [[[1, 0, 0]] * 2] * 2), 2),
        (
            matrix_of([[1, 1], [1, 1]], [[[1, 0, 0], [1, 0]], [[1, 0], [1, 0, 0]]]),
            4,
        ),  # of rank 2 times two
        (matrix_of([[1, [1, 0]], [2, [2, 0]]], [[PAIR] * 2] * 2), 2),
        (matrix_of([[1, [1, 0]], [2, [2, 1]]], [[PAIR] * 2] * 2), 4),
        (matrix_of([[1, 2], [3, 6]], [[FAR] * 2] * 2), 3),  # twelve decades
        (matrix_of([[1, 1], [1, 1]], [[[1, 1e6], [1, 1e-3]], [[1, 1], [1, 1e-6]]]), 4),
        (matrix_of([[1, 1], [1, 1]], [[np.poly([-8] * 4)] * 2] * 2), 4),
        (matrix_of([[[1, 2], 1], [3, [2, 1]]], [[[1, 1], [1]], [[1], [1, 1]]]), 2),
        (matrix_of([[0, 0], [0, 0]], [[[1]] * 2] * 2), 0),
        (
            matrix_of(
                [[[1, 0.1], [2, 0.2]], [[1, 0.1], [2, 0.2]]], [[[1, -1.9, 0.95]] * 2] * 2, 0.01
            ),
            2,
        ),
        (
            matrix_of([[1, 1], [1, 2]], [[[1, 0, 0, 0, 0, 0], [1, -0.9]]] * 2, 0.01),
            6,
        ),  # delays of five samples
    ],
)
def test_a_matrix_has_as_many_states_as_its_modes(G, order):
    system = realised(G)
    assert (system.nstates, system.dt) == (order, G.dt)
    for omega in np.geomspace(1e-3, 1e3, 40):
        s = np.exp(1j * omega * G.dt) if G.dt else 1j * omega
        np.testing.assert_allclose(system(s), G(s), rtol=1e-8, atol=1e-12 * np.abs(G(s)).max())


@pytest.mark.parametrize("dt", [0, 0.1])
def test_drawn_systems_have_the_order_they_were_drawn_with(dt):
    rng = np.random.default_rng(3)
    for _ in range(40):
        n, n_u, n_y = rng.integers(1, 6), rng.integers(2, 4), rng.integers(1, 4)
        A, B, C = (rng.standard_normal(shape) for shape in ((n, n), (n, n_u), (n_y, n)))
        A = 0.4 * A if dt else A * 10 ** rng.uniform(-2, 2)
        den = np.poly(A)
        num = [[np.poly(A - np.outer(b, c)) - den for b in B.T] for c in C]
        system = realised(control.tf(num, [[den] * n_u] * n_y, dt))
        assert system.nstates == n
        p = np.linalg.eigvals(A)
        np.testing.assert_allclose(
            np.sort_complex(system.poles()), np.sort_complex(p), atol=1e-6 * np.abs(p).max()
        )


def test_one_unstable_pole_counts_once_and_names_stay():
    rank_one = matrix_of([[1, 1], [1, 1]], [[[1, -1]] * 2] * 2)
    rank_one.update_names(inputs=["left", "right"], outputs=["up", "down"])
    assert realised(rank_one).input_labels == ["left", "right"]
    state_space = control.ss([[1.0]], [[1.0, 1.0]], [[1.0], [1.0]], np.zeros((2, 2)))
    assert robust.ncfsyn(rank_one).gamma_min == pytest.approx(
        robust.ncfsyn(state_space).gamma_min, rel=1e-6
    )


def test_gains_whose_squares_are_none_are_realised():
    assert realised(control.tf([1e200], [1, 1]))(0) == pytest.approx(1e200)


def test_zeros_near_a_pole_do_not_cancel_it():
    """In a fast clock zeros crowd around the poles at z = 1: the numerator is small there, and no
    pole is lost.
    """
    num = 1e-3 * np.poly([0.999, 0.9985, 0.998])
    G = matrix_of([[num, 1]], [[np.poly([1.001, 0.9, 0.8, 0.7]), [1, -0.5]]], 1e-3)
    assert np.any(np.abs(realised(G).poles() - 1.001) < 1e-9)
