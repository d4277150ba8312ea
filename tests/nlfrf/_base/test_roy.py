"""Roy's largest root: published quantiles, Hotelling and F as special cases, and the law by
drawing.
"""

import numpy as np
import pytest

from nlfrf._base.numbers import roy_quantile

#: 95 % quantiles of sigma_max^2 for (n_y, n_u, dof), computed independently by the lead of this
#: project's design paper.
QUANTILES = {
    (1, 1, 6): 3.885294,
    (2, 1, 12): 6.145545,
    (2, 2, 12): 9.391049,
    (2, 2, 24): 8.006232,
    (3, 3, 18): 14.987111,
    (2, 2, np.inf): 6.899868,
    (6, 6, 36): 31.922007,
}


@pytest.mark.parametrize("shape", QUANTILES, ids=str)
def test_quantiles(shape):
    assert abs(roy_quantile(0.95, *shape) - QUANTILES[shape]) < 1e-6


@pytest.mark.parametrize("dof", [2.5, 6, 40])
def test_one_entry_is_fisher(dof):
    assert roy_quantile(0.95, 1, 1, dof) == pytest.approx(dof * (0.05 ** (-1 / dof) - 1), rel=1e-9)


def test_one_output_of_known_variance_is_the_gamma_law():
    from scipy.stats import gamma

    assert roy_quantile(0.9, 1, 4, np.inf) == pytest.approx(gamma(4).ppf(0.9), rel=1e-9)


def test_large_dof_tends_to_a_known_covariance():
    assert roy_quantile(0.95, 3, 2, 1e5) == pytest.approx(
        roy_quantile(0.95, 3, 2, np.inf), rel=1e-3
    )


@pytest.mark.parametrize(("n_y", "n_u", "dof"), [(2, 2, 12), (3, 2, 9), (2, 3, 8)])
def test_the_law_by_drawing(n_y, n_u, dof):
    rng, n = np.random.default_rng(0), 20000
    D, S = (rng.normal(size=(n, n_y, m)) + 1j * rng.normal(size=(n, n_y, m)) for m in (n_u, dof))
    root = np.linalg.cholesky(S @ np.swapaxes(S, 1, 2).conj() / dof)
    inside = np.linalg.norm(np.linalg.solve(root, D), 2, (1, 2)) ** 2 < roy_quantile(
        0.95, n_y, n_u, dof
    )
    assert abs(inside.mean() - 0.95) < 4 * (0.95 * 0.05 / n) ** 0.5


def test_refusal_and_range():
    with pytest.raises(
        ValueError, match="dof must be more than n_y - 1 = 2 for a bound on the whole matrix, got 2"
    ):
        roy_quantile(0.95, 3, 3, 2.0)
    assert roy_quantile(1e-9, 2, 2, 12) > 1e-6
    assert roy_quantile(1 - 1e-6, 2, 2, 12) < 1e6
