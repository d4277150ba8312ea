"""Scaled inverse chi-squares and the F distributions of their errors: wider, mixed, compared.

A variance known with nu complex degrees of freedom is a scaled inverse chi-square, and the error of
a G with that variance is a scaled F(2, 2 nu).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np

from nlfrf._base.numbers import TINY, clip

#: Log of the tail probabilities at which the scaled F and the mixture have equal quantiles.
LOG_TAIL_PROBABILITIES = math.log(0.05), math.log(0.001)
_LOG_TAILS = np.array(LOG_TAIL_PROBABILITIES)[:, None]
_N_NEWTON_STEPS = 3  # further steps change no radius by 5e-4


def widened_dof(dof: np.ndarray, log_variance: np.ndarray | float) -> np.ndarray:
    """Return the degrees of freedom of an inverse chi-square whose log variance is larger by
    `log_variance`.

    The variance of the log is trigamma(nu), 1/nu + 1/(2 nu^2) up to a third of 1/(2 nu^3).

    Examples
    --------
    >>> widened_dof(np.array([6.0, 6.0]), np.array([0.0, 1.0])).round(2)
    array([6. , 1.2])
    """
    variance = (1 + 0.5 / dof) / dof + np.maximum(log_variance, 0.0)
    return np.asarray((1 + np.sqrt(1 + 2 * variance)) / (2 * variance))


def match_scaled_f(
    level: np.ndarray, dof: np.ndarray, weight: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return scale and degrees of freedom (F,) of the scaled F(2, 2 nu) that approximates a mixture
    of them (C, F).

    Both have equal quantiles at 95 % and, for all lines together, at 99.9 %: the r with sum_h w_h
    (1 + r^2 / (nu_h s_h^2))^(-nu_h) = 1 - p, by Newton's method in log r from the mean of their
    quantiles.

    Examples
    --------
    A mixture of one component is that component.

    >>> scale, dof = match_scaled_f(np.array([[2.0]]), np.array([[6.0]]), np.array([[1.0]]))
    >>> scale.round(3), dof.round(1)
    (array([2.]), array([6.]))
    """
    scale = dof * np.maximum(level, TINY)
    x = np.log(
        np.add.reduce(weight * scale * np.expm1(-_LOG_TAILS[..., None] / dof), axis=1)
    )  # (2, F): both tails
    for _ in range(_N_NEWTON_STEPS):
        over = np.exp(x)[:, None] / scale
        survival = np.exp(-dof * np.log1p(over))
        survival *= weight
        total = np.add.reduce(survival, axis=1)
        over /= over + 1
        over *= dof
        survival *= over
        rate = np.add.reduce(survival, axis=1) / total
        x += clip((np.log(total) - _LOG_TAILS) / np.maximum(rate, 1e-3), -2.0, 2.0)
    near, far = x
    ratios, dofs = _ratio_of_quantiles()
    matched = np.exp(np.interp(near - far, ratios, dofs))
    return np.exp(near) / f_quantile(matched, LOG_TAIL_PROBABILITIES[0]), matched


def f_quantile(dof: np.ndarray | float, tail: float) -> np.ndarray:
    """Return the quantile of F(2, 2 dof) that is exceeded with probability exp(tail)."""
    return np.asarray(dof * np.expm1(-tail / np.asarray(dof)))


@lru_cache(maxsize=1)
def _ratio_of_quantiles() -> tuple[np.ndarray, np.ndarray]:
    """Return a table of log(95 % quantile of F(2, 2 nu) / 99.9 % quantile), increasing, and log nu,
    from 0.2 to 1e5.
    """
    dofs = np.linspace(np.log(0.2), np.log(1e5), 800)
    quantiles = np.log([f_quantile(np.exp(dofs), tail) for tail in LOG_TAIL_PROBABILITIES])
    return quantiles[0] - quantiles[1], dofs


def log_density_of_ratio(
    nu: np.ndarray | float, dof: np.ndarray
) -> Callable[[np.ndarray], np.ndarray]:
    """Return the log density of log(s1^2 / s2^2), s1^2 / s2^2 ~ F(2 nu, 2 dof): for two estimates
    of one variance.
    """
    share = nu / dof
    constant = nu * np.log(share) - _log_beta(np.asarray(nu, dtype=float), dof)

    def log_density(log_ratio: np.ndarray) -> np.ndarray:
        """Return the log density at log ratios (..., F)."""
        over = share * np.exp(np.minimum(log_ratio, 500.0))
        return np.asarray(nu * log_ratio - (nu + dof) * np.log1p(over) + constant)

    return log_density


def _log_beta(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the log of the beta function, by Stirling's series two above each argument: within
    1e-5.
    """
    x = np.empty((3, *np.broadcast_shapes(a.shape, b.shape)))
    x[0], x[1], x[2] = a, b, a + b
    up = x + 2
    log_gamma = (
        (up - 0.5) * np.log(up)
        - up
        + 1 / (12 * up)
        - 1 / (360 * up * up * up)
        - np.log(x * (x + 1))
    )
    return np.asarray(log_gamma[0] + log_gamma[1] - log_gamma[2] + 0.5 * math.log(2 * math.pi))
