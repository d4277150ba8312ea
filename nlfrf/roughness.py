"""The distortion level from the roughness of the FRF over the excited lines.

Random phases make the stochastic distortion rough over frequency where the FRF itself is smooth, so the residual
of a local fit shows it (Pintelon & Schoukens, 7.2). It needs no detection lines. The fit is a polynomial, or a
rational function where that explains the FRF much better (a resonance a few lines wide, a steep slope); what
neither can follow is read as distortion, so the level may be too high there, not too low.
"""

from __future__ import annotations

import numpy as np

from nlfrf.distortion import nearest_lines
from nlfrf.transient import least_squares, power

ORDER = 2
WIDTH = 9
EARNED = 0.25  # the denominator has to earn its place: noise alone would be fitted by it now and then
LEAST = ORDER + 3  # lines that leave two degrees of freedom


def roughness(G: np.ndarray, weight: np.ndarray, excited: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Variance of one FRF about a local fit.

    Parameters
    ----------
    G : (M, F) complex ndarray
        FRF of each realisation.
    weight : (M, F) ndarray
        |U|: the variance of G is taken as a smooth variance at the output over |U|^2.
    excited : (F,) int ndarray
        Excited lines.

    Returns
    -------
    variance : (M, F) ndarray
        Variance of each realisation's G at each line.
    dof : (M, F) ndarray
        Complex degrees of freedom behind it.

    Raises
    ------
    ValueError
        Fewer than five excited lines.
    """
    if excited.size < LEAST:
        raise ValueError(f"lines must hold at least {LEAST} excited lines for the roughness, got {excited.size}")
    window = nearest_lines(excited, excited, WIDTH)
    offset = (excited[window] - excited[:, None]).astype(float)
    offset /= np.abs(offset).max(axis=1, keepdims=True)
    w = weight[:, window]
    data = w * G[:, window]
    polynomial = w[..., None] * offset[..., None] ** np.arange(ORDER + 1)
    residual = power(least_squares(polynomial, data)[1])
    dof = np.full(residual.shape, window.shape[1] - (ORDER + 1))
    n_rational = 2 * ORDER + 1
    if window.shape[1] >= n_rational + 3:
        # (1 + a1 r + a2 r^2) G = b0 + b1 r + b2 r^2: its residual is weighted by the denominator, that is by 1/|G|
        # across a resonance, where the distortion follows |G|
        denominator = -(offset[..., None] ** np.arange(1, ORDER + 1)) * data[..., None]
        rational = power(least_squares(np.concatenate([polynomial, denominator], axis=-1), data)[1])
        better = rational < EARNED * residual
        residual = np.where(better, rational, residual)
        dof = np.where(better, window.shape[1] - n_rational, dof)
    return residual / weight**2, dof
