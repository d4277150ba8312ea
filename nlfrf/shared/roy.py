"""Roy's largest root: the exact law of the largest singular value of a matrix of estimates over its own scatter.

Z = C^-1/2 dG Gamma^-1/2, with C = S/L estimated from L complex degrees of freedom. The largest root t of
det(H - t (H + S)) = 0, H = Z's own square, has the law of the largest eigenvalue of a Jacobi ensemble:

    P(sigma_max^2 <= x) = det [ integral_0^t p_i p_j w ],  i, j < s,  w = th^a (1 - th)^b,  t = x / (L + x)

with s = min(n_y, n_u), a = |n_u - n_y|, b = L - n_y and p_i orthonormal on [0, 1] under w; for L = inf the weight is
that of Laguerre. One input: Hotelling. (Khatri 1964; C. G. Khatri, Ann. Math. Statist. 35, p. 1807.)
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

__all__ = ["roy_probability", "roy_quantile"]


N_NODES = 200


def roy_probability(x: float, n_y: int, n_u: int, dof: float) -> float:
    """P(sigma_max^2 <= x) for an (n_y, n_u) matrix over a covariance of `dof` complex degrees of freedom.

    >>> round(roy_probability(9.391049, 2, 2, 12.0), 6)
    0.95
    """
    from scipy.special import eval_genlaguerre, eval_jacobi, gammaln

    s, a = min(n_y, n_u), abs(n_u - n_y)
    nodes, weights = nodes_and_weights()
    i = np.arange(s)[:, None]
    if np.isinf(dof):
        theta = x * nodes
        log_norm = gammaln(i + a + 1) - gammaln(i + 1)
        p = eval_genlaguerre(i, a, theta) * np.exp(a * np.log(theta) / 2 - theta / 2 - log_norm / 2)
        gram = (p * weights * x) @ p.T
    else:
        b = dof - n_y
        t = x / (dof + x)
        theta = t * nodes
        # of the Jacobi polynomials P_i^(b, a)(2 theta - 1) on [0, 1]
        log_norm = gammaln(i + a + 1) + gammaln(i + b + 1) - gammaln(i + 1) - gammaln(i + a + b + 1)
        log_norm = log_norm - np.log(2 * i + a + b + 1)
        half = (a * np.log(theta) + b * np.log1p(-theta) - log_norm) / 2
        p = eval_jacobi(i, b, a, 2 * theta - 1) * np.exp(half)
        gram = (p * weights * t) @ p.T
    return float(np.clip(np.linalg.det(gram), 0.0, 1.0))


@lru_cache(maxsize=1)
def nodes_and_weights() -> tuple[np.ndarray, np.ndarray]:
    """Gauss-Legendre on [0, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(N_NODES)
    return (nodes + 1) / 2, weights / 2


@lru_cache(maxsize=512)
def roy_quantile(p: float, n_y: int, n_u: int, dof: float) -> float:
    """The squared singular value that is not exceeded with probability p; needs dof > n_y - 1, not a whole number.

    >>> round(roy_quantile(0.95, 1, 1, 6.0), 6)       # F(2, 12)
    3.885294
    """
    from scipy.optimize import brentq

    if not dof > n_y - 1:
        raise ValueError(f"dof must be more than n_y - 1 = {n_y - 1} for a bound on the whole matrix, got {dof:g}")
    high = 4.0 * (n_y + n_u)
    while roy_probability(high, n_y, n_u, dof) < p:
        high *= 2
        if high > 1e12:
            raise ValueError(f"dof must be larger for a bound at probability {p:g}, got {dof:g} for {n_y} outputs")
    return float(brentq(lambda x: roy_probability(x, n_y, n_u, dof) - p, 1e-9, high, xtol=1e-12, rtol=1e-13))
