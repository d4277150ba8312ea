"""Polynomial matrices in balls: products, Bernstein coefficients, definiteness up to the edge."""

import numpy as np
import pytest

from robust.proofs.exact.polynomial_matrices import PolynomialMatrix, stacked

rng = np.random.default_rng(71)


def value(polynomial, theta):
    return np.tensordot(theta ** np.arange(len(polynomial.parts)), polynomial.to_array(), 1)


def test_products_sums_and_stacks_are_those_of_the_values():
    P = PolynomialMatrix.of(rng.normal(size=(3, 2, 4)))
    Q = PolynomialMatrix.of(rng.normal(size=(2, 4, 3)))
    for theta in (-1.0, 0.3):
        assert np.allclose(value(P * Q, theta), value(P, theta) @ value(Q, theta))
        assert np.allclose(value(P + P.scaled(2.0), theta), 3 * value(P, theta))
        assert np.allclose(
            value(stacked([P, Q.transpose()]), theta),
            np.vstack([value(P, theta), value(Q, theta).T]),
        )


@pytest.mark.parametrize(("edge", "holds"), [(1 + 1e-9, True), (1.0, False), (1 - 1e-9, False)])
def test_definite_only_above_the_edge(edge, holds):
    """edge - theta^2 touches zero at both ends for edge = 1; (theta - 1/4)^2 + edge - 1 in the
    middle.
    """
    ends = PolynomialMatrix.of(np.array([edge, 0.0, -1.0]).reshape(3, 1, 1))
    middle = PolynomialMatrix.of(np.array([0.0625 + edge - 1, -0.5, 1.0]).reshape(3, 1, 1))
    assert ends.is_positive_definite() is holds
    assert middle.is_positive_definite() is holds


def test_a_definite_matrix_that_is_nearly_singular_everywhere():
    root = PolynomialMatrix.of(rng.normal(size=(4, 3, 5)))
    singular = root.transpose() * root
    assert not singular.is_positive_definite()
    assert (singular + PolynomialMatrix.of(1e-3 * np.eye(5)[None])).is_positive_definite()
