"""Singular values and relative gain array of a measured matrix, with their bounds.

    G = U diag(sigma) V^H,    RGA(G) = G times G^-T, element by element        (SP 3.3 and 3.4)

Singular values are bounded over the whole set of `Bla.block`, because an SVD of the estimate alone hides a weak
direction that the data do not show. The RGA has bounds to first order in the covariance.
"""

from __future__ import annotations

from statistics import NormalDist
from typing import overload

import numpy as np
from numpy.typing import ArrayLike

from nlfrf._base.arguments import require_kind
from nlfrf._base.values import value
from nlfrf.bla.bla import Bla


@value
class SingularValues:
    """Singular values of a measured matrix, largest first, with lower and upper bounds.

    Fields
    ------
    f : (F,) ndarray
        Excited frequencies [Hz].
    sigma : (n, F) ndarray
        Singular values of G, n the smaller number of channels.
    low, high : (n, F) ndarray
        Bounds that hold for every matrix of the set of `Bla.block`; low is zero where the set holds a matrix of lower
        rank, or may.
    confidence : float
        Probability that the matrix of a line, and so all its singular values, lies between them.

    References
    ----------
    SP 3.3 (directions of a matrix and their gains).

    Examples
    --------
    >>> found = SingularValues(
    ...     f=np.array([1.0, 2.0]), sigma=np.array([[2.0, 3.0], [0.5, 0.1]]), low=np.array([[1.9, 2.8], [0.4, 0.0]]),
    ...     high=np.array([[2.1, 3.2], [0.6, 0.3]]), confidence=0.95)
    >>> print(str(found)[:89])
    2 singular values on 2 lines; largest 3, smallest 0.1, condition at most 30 at 2 Hz; on 1
    """

    f: np.ndarray
    sigma: np.ndarray
    low: np.ndarray
    high: np.ndarray
    confidence: float

    def __str__(self) -> str:
        """Describe the result in a few lines."""
        with np.errstate(divide="ignore", invalid="ignore"):
            condition = np.nan_to_num(self.sigma[0] / self.sigma[-1], nan=np.inf, posinf=np.inf)
        k = int(condition.argmax())
        lost = int(np.count_nonzero(self.low[-1] == 0))
        text = (
            f"{len(self.sigma)} singular values on {self.f.size} lines; largest {self.sigma[0].max():.4g}, smallest "
            f"{self.sigma[-1].min():.4g}, condition at most {condition[k]:.4g} at {self.f[k]:g} Hz"
        )
        if lost:
            text += f"; on {lost} lines the set may hold a matrix of lower rank: the weakest direction is not measured"
        return text


@value
class RelativeGains:
    """The relative gain array of a measured matrix, with radii.

    Fields
    ------
    f : (F,) ndarray
        Excited frequencies [Hz].
    inputs, outputs : tuple of str
        Names of the channels.
    gains : (n_y, n_u, F) complex ndarray
        Rows and columns add up to one where the matrix is square.
    radius : (n_y, n_u, F) ndarray
        Of the disc about each that holds it with `confidence`, or more where the matrix is not square; to first order
        in the covariance of G.
    confidence : float
        Probability, an element and a line at a time.

    References
    ----------
    Bristol 1966; SP 3.4.

    Examples
    --------
    >>> one = np.ones((1, 1, 2))
    >>> print(RelativeGains(f=np.array([1.0, 2.0]), inputs=("u",), outputs=("y",), gains=one, radius=0 * one,
    ...     confidence=0.95))
    relative gains of 1 outputs by 1 inputs on 2 lines
      y by u: 1 to 1 (at 1 Hz, 95 % within 0)
    """

    f: np.ndarray
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    gains: np.ndarray
    radius: np.ndarray
    confidence: float

    def __str__(self) -> str:
        """Return the elements where they are largest and least, in a few lines."""
        size = np.abs(self.gains)
        rows = [f"relative gains of {len(self.outputs)} outputs by {len(self.inputs)} inputs on {self.f.size} lines"]
        for (j, out), (i, name) in ((a, b) for a in enumerate(self.outputs) for b in enumerate(self.inputs)):
            k = int(size[j, i].argmax())
            rows.append(
                f"  {out} by {name}: {size[j, i].min():.3g} to {size[j, i, k]:.3g} (at {self.f[k]:g} Hz, "
                f"{100 * self.confidence:g} % within {self.radius[j, i, k]:.2g})"
            )
        return "\n".join(rows)


def singular_values(
    frm: Bla, confidence: float = 0.95, *, of: str = "bla", simultaneous: bool = False
) -> SingularValues:
    """Return the singular values of a measured matrix, bounded over the set that holds the matrix.

    Parameters
    ----------
    frm : Bla
        What was identified.
    confidence, of, simultaneous
        As in `Bla.block`.

    Returns
    -------
    SingularValues
        With G = U diag(sigma) V^H and G + E, E = left Delta right, every sigma_i of G + E lies between sigma_i
        (1 - |S^-a U_i^H left| |right V_i S^(a-1)|), with the first i directions and the best of a = 0, 1/2, 1, and
        sigma_i plus the smaller of |left| |right V_i'| and |U_i'^H left| |right|, with the directions from i on.

    Raises
    ------
    ValueError
        A confidence that is no probability, too few degrees of freedom for a bound on the whole matrix.

    References
    ----------
    SP 3.3, A.3.4 (Weyl); R. A. Horn & C. R. Johnson, *Topics in Matrix Analysis*, 1991, 3.3 (interlacing).

    Examples
    --------
    >>> import nlfrf
    >>> ms = nlfrf.multisine(fs=256, n_samples=256, f_min=1, f_max=100, n_inputs=2, rng=1)
    >>> u = np.repeat(ms.u[:, :, None], 2, axis=2)
    >>> y = np.stack([3 * u[0] + 0.1 * u[0] ** 3, 0.5 * u[1]])
    >>> frm = nlfrf.identify(nlfrf.Record(u=u, y=y, fs=256, lines=ms.lines))
    >>> found = nlfrf.bla.singular_values(frm, simultaneous=True)
    >>> bool(np.all((found.low[0] < 3.3) & (3.3 < found.high[0])))          # 3 and the gain of the cube, 0.3
    True
    """
    require_kind("frm", frm, Bla)
    left, right = (np.moveaxis(part, 2, 0) for part in frm.block(confidence, of=of, simultaneous=simultaneous))
    U, sigma, Vh = np.linalg.svd(np.moveaxis(frm.matrix, 2, 0))  # all directions, those without a gain too
    out, into = np.swapaxes(U, 1, 2).conj() @ left, right @ np.swapaxes(Vh, 1, 2).conj()  # of each direction
    low, high = np.empty_like(sigma), np.empty_like(sigma)
    with np.errstate(divide="ignore", invalid="ignore"):
        for i in range(sigma.shape[1]):
            first, rest = slice(0, i + 1), slice(i, None)
            moved = [
                largest_singular_values(out[:, first] / sigma[:, first, None] ** a)
                * largest_singular_values(into[:, :, first] / sigma[:, None, first] ** (1 - a))
                for a in (0.0, 0.5, 1.0)
            ]
            low[:, i] = sigma[:, i] * np.maximum(1 - np.nan_to_num(np.min(moved, axis=0), nan=np.inf), 0.0)
            high[:, i] = sigma[:, i] + np.minimum(
                largest_singular_values(left) * largest_singular_values(into[:, :, rest]),
                largest_singular_values(out[:, rest]) * largest_singular_values(right),
            )
    low = np.where(sigma > 0, low, 0.0)
    return SingularValues(f=frm.f, sigma=sigma.T, low=low.T, high=high.T, confidence=float(confidence))


@overload
def rga(G: Bla, confidence: float = ...) -> RelativeGains: ...


@overload
def rga(G: ArrayLike, confidence: float = ...) -> np.ndarray: ...


def rga(G: ArrayLike | Bla, confidence: float = 0.95) -> np.ndarray | RelativeGains:
    """Relative gain array: how much a channel's gain changes when all other loops are closed tightly.

    Parameters
    ----------
    G : (n_y, n_u) or (n_y, n_u, F) array, or Bla
        Gains at one frequency, at several, or what was identified.
    confidence : float
        Of a Bla: probability of the discs.

    Returns
    -------
    array of the shape of G, or RelativeGains
        G times the transpose of its (pseudo-)inverse, element by element. Pairings of elements near one keep loops out
        of one another's way; large elements mean a matrix that a small relative error, one over the element, makes
        singular.

    Raises
    ------
    ValueError
        An array that is not finite, or of another number of axes.

    References
    ----------
    Bristol, *On a new measure of interaction for multivariable process control*, IEEE Trans. Automatic Control 11,
    1966; SP 3.4 and A.4.

    Examples
    --------
    The distillation column of SP at steady state: 35.1 and -34.1.

    >>> np.round(rga([[87.8, -86.4], [108.2, -109.6]]), 1)
    array([[ 35.1, -34.1],
           [-34.1,  35.1]])
    """
    if isinstance(G, Bla):
        return RelativeGains(
            f=G.f,
            inputs=G.inputs,
            outputs=G.outputs,
            gains=rga(G.G),
            radius=rga_radius(G, confidence),
            confidence=float(confidence),
        )
    G = np.asarray(G)
    if G.dtype.kind not in "fciu" or G.ndim not in (2, 3) or not np.isfinite(G).all():
        raise ValueError(f"G must be finite, of axes (n_y, n_u) or (n_y, n_u, F), got shape {G.shape} of {G.dtype}")
    stacked = np.moveaxis(G.reshape(*G.shape[:2], -1), 2, 0)
    gains = stacked * np.swapaxes(np.linalg.pinv(stacked), 1, 2)
    return np.moveaxis(gains, 0, 2).reshape(G.shape)


def rga_radius(frm: Bla, confidence: float) -> np.ndarray:
    """Return (n_y, n_u, F) radii of the elements, from d(G_ji H_ij) = dG_ji H_ij + G_ji dH_ij, H = pinv(G).

    dH = -H dG H + H H^H dG^H (1 - G H) + (1 - H G) dG^H H^H H. The terms in dG^H are zero for a square matrix. For any
    other an error may lie along a line, and the quantile is that of a real number, the larger one.
    """
    G = np.moveaxis(frm.matrix, 2, 0)
    H = np.linalg.pinv(G)
    C, gamma = np.moveaxis(frm.cov_bound, 2, 0), np.moveaxis(frm.gamma, 2, 0)
    n_y, n_u = G.shape[1:]
    adjoint = np.swapaxes(H, 1, 2).conj()
    left_null, right_null = np.eye(n_y) - G @ H, np.eye(n_u) - H @ G

    def variance_of_sum(slope: np.ndarray) -> np.ndarray:
        """Return the (F,) variance of the sum of slope (F, n_y, n_u) times dG: E dG_kl dG*_mn = C_km gamma*_ln."""
        return np.asarray(np.einsum("fkl,fkm,fln,fmn->f", slope, C, gamma.conj(), slope.conj(), optimize=True).real)

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
    quantile = frm.bound(confidence) ** 2 / frm.var_bound  # the same for every entry
    scale = quantile.reshape(frm.matrix.shape)
    if n_y != n_u:
        real = NormalDist().inv_cdf((1 + confidence) / 2) ** 2
        scale = scale * max(1.0, real / -float(np.log1p(-confidence)))
    return np.sqrt(scale * np.moveaxis(variance, 0, 2))


def largest_singular_values(matrices: np.ndarray) -> np.ndarray:
    """Return the (F,) largest singular value of each matrix; inf where it holds an infinite number."""
    finite = np.isfinite(matrices).all(axis=(1, 2))
    size = np.linalg.norm(np.where(finite[:, None, None], matrices, 0.0), 2, (1, 2))
    return np.where(finite, size, np.inf)
