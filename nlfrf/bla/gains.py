"""Singular values and relative gain array of a measured matrix, with their bounds.

    G = U diag(sigma) V^H,    RGA(G) = G times G^-T, element by element        (SP 3.3 and 3.4)

The bounds of the singular values hold for every matrix of the set `Bla.block`. The bounds of the
relative gain array (RGA) are of first order in the covariance.
"""

from __future__ import annotations

from statistics import NormalDist

import numpy as np
from numpy.typing import ArrayLike

from nlfrf._base.arguments import require_kind
from nlfrf.bla.bla import Bla


def singular_values(
    frm: Bla, confidence: float = 0.95, *, of: str = "bla", simultaneous: bool = False
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the singular values of a measured matrix, largest first, with their bounds.

    Use this to see whether the record determines the gain of the plant in its weakest direction. If
    it does not, the lower bound of the smallest singular value is zero.

    Parameters
    ----------
    frm : Bla
        Identified matrix.
    confidence, of, simultaneous
        As in `Bla.block`.

    Returns
    -------
    sigma : (n, F) ndarray
        Singular values of G on the excited lines [unit of y over unit of u]; n is the smaller of
        n_y and n_u.
    low, high : (n, F) ndarray
        Lower and upper bounds of the singular values of every matrix in the set `Bla.block`. On a
        line all of them hold together with probability `confidence`. If the lower bound of the
        smallest singular value is zero, the true matrix may have a lower rank.

    Raises
    ------
    ValueError
        The confidence is not between 0 and 1, or the degrees of freedom are too few for a bound on
        the whole matrix.

    References
    ----------
    SP 3.3, A.3.4 (Weyl); R. A. Horn & C. R. Johnson, *Topics in Matrix Analysis*, 1991, 3.3
    (interlacing).

    Examples
    --------
    >>> import nlfrf
    >>> ms = nlfrf.multisine(fs=256, n_samples=256, f_min=1, f_max=100, n_inputs=2, rng=1)
    >>> u = np.repeat(ms.u[:, :, None], 2, axis=2)
    >>> y = np.stack([3 * u[0] + 0.1 * u[0] ** 3, 0.5 * u[1]])
    >>> frm = nlfrf.identify(nlfrf.Record(u=u, y=y, fs=256, lines=ms.lines))
    >>> sigma, low, high = nlfrf.bla.singular_values(frm, simultaneous=True)
    >>> bool(np.all((low[0] < 3.3) & (3.3 < high[0])))          # 3 and the gain of the cube, 0.3
    True
    """
    # For G + left Delta right: sigma_i falls to sigma_i (1 - |S^-a U_i^H left| |right V_i S^(a-1)|) at
    # least, with S = diag(sigma), U_i, V_i the first i directions and the best a of 0, 1/2, 1; it rises
    # by the smaller of |left| |right V_i'| and |U_i'^H left| |right|, U_i', V_i' the directions from i on.
    require_kind("frm", frm, Bla)
    left, right = (
        np.moveaxis(part, 2, 0) for part in frm.block(confidence, of=of, simultaneous=simultaneous)
    )
    U, sigma, Vh = np.linalg.svd(
        np.moveaxis(frm.matrix, 2, 0)
    )  # all directions, also those without gain
    # of each direction
    out = np.swapaxes(U, 1, 2).conj() @ left
    into = right @ np.swapaxes(Vh, 1, 2).conj()
    low, high = np.empty_like(sigma), np.empty_like(sigma)
    with np.errstate(divide="ignore", invalid="ignore"):
        for i in range(sigma.shape[1]):
            first, rest = slice(0, i + 1), slice(i, None)
            moved = [
                _largest_singular_values(out[:, first] / sigma[:, first, None] ** a)
                * _largest_singular_values(into[:, :, first] / sigma[:, None, first] ** (1 - a))
                for a in (0.0, 0.5, 1.0)
            ]
            low[:, i] = sigma[:, i] * np.maximum(
                1 - np.nan_to_num(np.min(moved, axis=0), nan=np.inf), 0.0
            )
            high[:, i] = sigma[:, i] + np.minimum(
                _largest_singular_values(left) * _largest_singular_values(into[:, :, rest]),
                _largest_singular_values(out[:, rest]) * _largest_singular_values(right),
            )
    low = np.where(sigma > 0, low, 0.0)
    return sigma.T, low.T, high.T


def rga(G: ArrayLike) -> np.ndarray:
    """Return the relative gain array (RGA): the gain of each channel with all other loops open,
    over its gain with all other loops closed tightly.

    Use this to choose which output to pair with which input.

    Parameters
    ----------
    G : (n_y, n_u) or (n_y, n_u, F) array
        Gains at one frequency or at several; for a measured plant `Bla.matrix`.

    Returns
    -------
    array of the shape of G
        G times the transpose of its (pseudo-)inverse, element by element. Pair outputs and inputs
        whose element is near 1: their loops interact little. With a large element lambda, a
        relative error of 1/lambda in that entry of G makes G singular. `rga_radius` gives the
        uncertainty of the elements.

    Raises
    ------
    ValueError
        The array is not finite, or does not have two or three axes.

    References
    ----------
    Bristol, *On a new measure of interaction for multivariable process control*, IEEE Trans.
    Automatic Control 11, 1966; SP 3.4 and A.4.

    Examples
    --------
    A distillation column at steady state (SP 3.4): the elements are 35.1 and -34.1.

    >>> np.round(rga([[87.8, -86.4], [108.2, -109.6]]), 1)
    array([[ 35.1, -34.1],
           [-34.1,  35.1]])
    """
    G = np.asarray(G)
    if G.dtype.kind not in "fciu" or G.ndim not in (2, 3) or not np.isfinite(G).all():
        raise ValueError(
            f"G must be finite, of axes (n_y, n_u) or (n_y, n_u, F), got shape {G.shape} of"
            f" {G.dtype}"
        )
    stacked = np.moveaxis(G.reshape(*G.shape[:2], -1), 2, 0)
    gains = stacked * np.swapaxes(np.linalg.pinv(stacked), 1, 2)
    return np.moveaxis(gains, 0, 2).reshape(G.shape)


def rga_radius(frm: Bla, confidence: float = 0.95) -> np.ndarray:
    """Return the uncertainty of the relative gains of a measured matrix, as radii of discs in the
    complex plane.

    Parameters
    ----------
    frm : Bla
        Identified matrix.
    confidence : float
        Probability with which the disc of one element on one line contains the true value. For a
        matrix that is not square the actual probability is at least this.

    Returns
    -------
    (n_y, n_u, F) ndarray
        Radii, to first order in the covariance of G.

    Raises
    ------
    ValueError
        The confidence is not between 0 and 1.

    References
    ----------
    G. H. Golub & V. Pereyra, *The differentiation of pseudo-inverses*, SIAM J. Numerical Analysis
    10, 1973.

    Examples
    --------
    >>> import nlfrf
    >>> ms = nlfrf.multisine(fs=256, n_samples=256, f_min=1, f_max=100, n_inputs=2, rng=1)
    >>> u = np.repeat(ms.u[:, :, None], 2, axis=2)
    >>> bla = nlfrf.identify(nlfrf.Record(u=u, y=np.stack([2 * u[0] + u[1], u[0] - u[1]]), fs=256, lines=ms.lines))
    >>> round(float(np.abs(nlfrf.bla.rga(bla.matrix)[0, 0] - 2 / 3).max()), 6), bool(rga_radius(bla).max() < 1e-6)
    (0.0, True)
    """
    # d(G_ji H_ij) = dG_ji H_ij + G_ji dH_ij, H = pinv(G), with
    # dH = -H dG H + H H^H dG^H (1 - G H) + (1 - H G) dG^H H^H H. The terms in dG^H vanish for a square
    # matrix. Otherwise the error may lie along a line in the complex plane, so the quantile of a real
    # number, which is larger, is used.
    require_kind("frm", frm, Bla)
    G = np.moveaxis(frm.matrix, 2, 0)
    H = np.linalg.pinv(G)
    C, gamma = np.moveaxis(frm.cov.bound, 2, 0), np.moveaxis(frm.cov.gamma, 2, 0)
    n_y, n_u = G.shape[1:]
    adjoint = np.swapaxes(H, 1, 2).conj()
    left_null, right_null = np.eye(n_y) - G @ H, np.eye(n_u) - H @ G

    def variance_of_sum(slope: np.ndarray) -> np.ndarray:
        """Return the (F,) variance of the sum of slope (F, n_y, n_u) times dG:

        E dG_kl dG*_mn = C_km gamma*_ln.
        """
        return np.asarray(
            np.einsum(
                "fkl,fkm,fln,fmn->f", slope, C, gamma.conj(), slope.conj(), optimize=True
            ).real
        )

    variance = np.empty(G.shape)
    for j, i in np.ndindex(n_y, n_u):
        # derivatives of the element by dG[k, l] and by its conjugate: (F, n_y, n_u)
        slope = -np.einsum("fk,fl->fkl", H[:, i], H[:, :, j])
        slope_conj = np.einsum("fk,fl->fkl", left_null[:, :, j], (H @ adjoint)[:, i])
        slope_conj += np.einsum("fk,fl->fkl", (adjoint @ H)[:, :, j], right_null[:, i])
        slope, slope_conj = (G[:, j, i, None, None] * part for part in (slope, slope_conj))
        slope[:, j, i] += H[:, i, j]
        conjugate = variance_of_sum(slope_conj.conj()) if n_y != n_u else 0.0
        variance[:, j, i] = variance_of_sum(slope) + conjugate
    quantile = frm.bound(confidence) ** 2 / frm.var_bound  # equal for all entries
    scale = quantile.reshape(frm.matrix.shape)
    if n_y != n_u:
        real = NormalDist().inv_cdf((1 + confidence) / 2) ** 2
        scale = scale * max(1.0, real / -float(np.log1p(-confidence)))
    return np.sqrt(scale * np.moveaxis(variance, 0, 2))


def _largest_singular_values(matrices: np.ndarray) -> np.ndarray:
    """Return the (F,) largest singular value of each matrix; inf if it has an infinite entry."""
    finite = np.isfinite(matrices).all(axis=(1, 2))
    size = np.linalg.norm(np.where(finite[:, None, None], matrices, 0.0), 2, (1, 2))
    return np.where(finite, size, np.inf)
