"""Singular values and relative gains: published numbers, their laws, bounds attacked from inside
the set.
"""

from collections import namedtuple

import numpy as np
import pytest

import nlfrf

#: Distillation column of Skogestad & Postlethwaite at steady state: gains, singular values,
#: relative gain.
COLUMN = np.array([[87.8, -86.4], [108.2, -109.6]])
BAND = {"fs": 256, "n_samples": 512, "f_min": 1, "f_max": 100}


def measured(gains, *, noise, rng):
    n_y, n_u = gains.shape
    ms = nlfrf.multisine("random-odd", **BAND, n_inputs=n_u, rng=1)
    u = np.repeat(ms.u.reshape(n_u, -1, 1, ms.u.shape[-1]), 2, axis=2)
    scatter = noise * np.random.default_rng(rng).standard_normal((n_y, *u.shape[1:]))
    y = np.einsum("ji,imps->jmps", gains, u) + scatter
    return nlfrf.identify(nlfrf.Record(u=u, y=y, fs=256, lines=ms.lines), transient="none")


def test_the_distillation_column():
    assert nlfrf.bla.rga(COLUMN)[0, 0] == pytest.approx(35.07, abs=0.005)
    sigma = nlfrf.bla.singular_values(measured(COLUMN, noise=1e-6, rng=0))[0]
    assert sigma[:, 0] == pytest.approx([197.2, 1.39], rel=2e-3)


def test_the_laws_of_relative_gains():
    rng = np.random.default_rng(0)
    G = rng.standard_normal((3, 3, 5)) + 1j * rng.standard_normal((3, 3, 5))
    gains = nlfrf.bla.rga(G)
    for axis in (0, 1):
        np.testing.assert_allclose(gains.sum(axis=axis), 1)
    D1, D2 = np.diag([2.0, 0.1, 30.0]), np.diag([5.0, 1.0, 0.3])
    np.testing.assert_allclose(
        nlfrf.bla.rga(np.einsum("ij,jkf,kl->ilf", D1, G, D2)), gains
    )  # no units
    np.testing.assert_allclose(
        nlfrf.bla.rga(np.tril(np.ones((3, 3)))), np.eye(3), atol=1e-12
    )  # triangular: one way only
    tall = nlfrf.bla.rga(G[:, :2])
    np.testing.assert_allclose(tall.sum(axis=0), 1)  # columns, where outputs are more than inputs
    # a relative change of an element by minus one over it makes the matrix singular
    at, j, i = G[:, :, 0].copy(), 1, 2
    at[j, i] *= 1 - 1 / gains[j, i, 0]
    assert abs(np.linalg.det(at)) < 1e-12
    with pytest.raises(
        ValueError,
        match=r"G must be finite, of axes \(n_y, n_u\) or \(n_y, n_u, F\), got shape \(3,\)",
    ):
        nlfrf.bla.rga(np.ones(3))
    with pytest.raises(ValueError, match=r"got shape \(1, 1\) of <U1"):
        nlfrf.bla.rga([["a"]])


@pytest.mark.parametrize("shape", [(2, 2), (3, 2), (2, 3), (3, 3)])
def test_no_plant_of_the_set_has_singular_values_outside(shape):
    rng = np.random.default_rng(3)
    gains = rng.standard_normal(shape) * np.geomspace(1, 0.02, shape[1])
    frm = measured(gains, noise=0.02, rng=4)
    found = namedtuple("Found", "sigma low high")(*nlfrf.bla.singular_values(frm))
    left, right = (np.moveaxis(part, 2, 0) for part in frm.block())
    G = np.moveaxis(frm.G, 2, 0)
    U, _, Vh = np.linalg.svd(G, full_matrices=False)
    closest = np.zeros((2, *found.sigma.shape))
    for n in range(150):
        Delta = rng.standard_normal((len(G), *shape)) + 1j * rng.standard_normal((len(G), *shape))
        if n < 4:  # along one direction of the matrix, up and down
            Delta = (
                (1 - 2 * (n % 2))
                * np.linalg.inv(left)
                @ U[:, :, [n // 2]]
                @ Vh[:, [n // 2]]
                @ np.linalg.inv(right)
            )
        X, _, Yh = np.linalg.svd(Delta, full_matrices=False)
        Delta = X @ Yh if n % 2 else X[:, :, :1] @ Yh[:, :1]
        sigma = np.linalg.svd(G + left @ Delta @ right, compute_uv=False).T
        assert np.all(sigma >= found.low * (1 - 1e-9))
        assert np.all(sigma <= found.high * (1 + 1e-9))
        used = (
            (found.sigma - sigma) / (found.sigma - found.low),
            (sigma - found.sigma) / (found.high - found.sigma),
        )
        closest = np.maximum(closest, used)
    assert closest.mean(axis=2).min() > 0.5  # and they are no wider than twice what is needed


@pytest.mark.parametrize(
    ("n", "off"), [(15, 0.05), pytest.param(60, 0.025, marks=pytest.mark.attack)]
)
def test_bounds_hold_the_truth_as_often_as_they_say(n, off):
    sigma = np.linalg.svd(COLUMN, compute_uv=False)[:, None]
    gains = nlfrf.bla.rga(COLUMN)[:, :, None]
    of_gains, of_sigma = [], []
    for e in range(n):
        frm = measured(COLUMN, noise=0.03, rng=e)
        _, low, high = nlfrf.bla.singular_values(frm)
        of_sigma.append(np.mean(np.all((low < sigma) & (sigma < high), axis=0)))
        of_gains.append(
            np.mean(np.abs(nlfrf.bla.rga(frm.matrix) - gains) < nlfrf.bla.rga_radius(frm), axis=2)
        )
    assert np.mean(of_sigma) > 0.93  # a set that holds the matrix holds them
    assert np.all(np.abs(np.mean(of_gains, axis=0) - 0.95) < off)


@pytest.mark.parametrize(
    "gains", [[[3, 1], [1, -1], [1, 0.5]], [[3, 1, 0.4], [1, -1, 2]], [[1], [0.3]]]
)
def test_bounds_hold_relative_gains_of_matrices_that_are_not_square(gains):
    """The inverse then moves with the conjugate of the error too, and of one input the element is a
    real number.
    """
    gains, held = np.array(gains, float), []
    for e in range(25):
        frm = measured(gains, noise=0.03, rng=e)
        off = np.abs(nlfrf.bla.rga(frm.matrix) - nlfrf.bla.rga(gains)[:, :, None])
        held.append(np.mean(off < nlfrf.bla.rga_radius(frm), axis=2))
    held = np.mean(held, axis=0)
    assert held.min() > 0.92
    assert held.mean() < 0.995


def test_a_weak_direction_that_was_not_measured_has_no_lower_bound():
    frm = measured(np.array([[1.0, 1.0], [1.0, 1.0]]), noise=0.05, rng=2)
    assert np.mean(nlfrf.bla.singular_values(frm)[1][1] == 0) > 0.9
