"""The FRF averaged over realisations, with its variance by noise and in total."""

from __future__ import annotations

import numpy as np

from nlfrf.identification.spectra import Spectra
from nlfrf.shared.arguments import data_warning
from nlfrf.shared.leastsquares import squared
from nlfrf.shared.values import value

__all__ = ["Frf", "average_frf", "residual_variance", "warn_of_jumps"]


#: Roughness over the level and over |G|^2 past which u and y do not belong together, where most lines have it.
JUMPING, SHARE = 2.5, 0.03
SPARE = 2  # lines more than the half: few lines are rough by chance


@value(copy=False)
class Frf:
    """Averaged FRF on some lines.

    Fields
    ------
    each : (M, F) complex ndarray
        Y / U of each realisation.
    noise : (M, F) ndarray
        Variance of each by noise, to first order; nan for one period.
    G : (F,) complex ndarray
        Their average: the mean, or the ratio of averages where a reference was given.
    var_noise : (F,) ndarray
        Variance of G by noise; nan for one period.
    var_total : (F,) ndarray
        Variance of G by noise and distortion, from the scatter over realisations; nan for M = 1.
    """

    each: np.ndarray
    noise: np.ndarray
    G: np.ndarray
    var_noise: np.ndarray
    var_total: np.ndarray


def average_frf(spectra: Spectra) -> Frf:
    """FRF on the lines of the spectra; see Pintelon & Schoukens, 4.3.1.

    With a reference the spectra are turned by its phase and averaged before they are divided: noise on the input
    then leaves no bias, in open and in closed loop.
    """
    n = spectra.U.shape[0]
    each = spectra.Y / spectra.U
    noise = residual_variance(each, spectra) / spectra.power_U
    if spectra.R is None:
        G = np.add.reduce(each, axis=0) / n
        var_noise = np.add.reduce(noise) / n**2
        var_total = np.add.reduce(squared(each - G)) / (n * (n - 1)) if n > 1 else np.full(G.shape, np.nan)
        return Frf(each=each, noise=noise, G=G, var_noise=var_noise, var_total=var_total)
    turn = spectra.R.conj() / np.abs(spectra.R)
    U, Y = (spectra.U * turn).mean(axis=0), (spectra.Y * turn).mean(axis=0)
    G = Y / U
    # E|dY - G dU|^2 / |U|^2, by noise and over realisations
    var_noise = np.add.reduce(residual_variance(G, spectra)) / n**2 / squared(U)
    var_total = np.full(G.shape, np.nan)
    if n > 1:
        deviation = (spectra.Y - G * spectra.U) * turn
        var_total = np.add.reduce(squared(deviation)) / (n * (n - 1)) / squared(U)
    return Frf(each=each, noise=noise, G=G, var_noise=var_noise, var_total=var_total)


def residual_variance(G: np.ndarray, spectra: Spectra) -> np.ndarray:
    """(M, K) variance of Y - G U by noise, E|dY - G dU|^2."""
    if not spectra.var_U.any():  # an input that repeats exactly
        return spectra.var_Y
    variance = spectra.var_Y + squared(G) * spectra.var_U - 2 * (G.conj() * spectra.cov_YU).real
    return np.maximum(variance, 0.0)


def warn_of_jumps(
    rough: np.ndarray, level: np.ndarray, size: np.ndarray, what: str = "G", share: float = SHARE
) -> bool:
    """Warn where an FRF jumps from line to line by more than its distortion can make it.

    Parameters
    ----------
    rough, level, size : (F,) ndarray
        Variance of an FRF about its neighbours, the one that detection lines tell, and |G|^2.
    what : str
        What the FRF is called.
    share : float
        Roughness over |G|^2 past which it is no bend.
    """
    jumps = (rough > JUMPING * level) & (rough > share * size)
    strange = np.count_nonzero(jumps) > jumps.size / 2 + SPARE
    if strange:
        tiny = np.finfo(float).tiny
        of_size, above = (float(np.median(rough / np.maximum(one, tiny))) for one in (size, level))
        data_warning(
            f"{what} jumps from line to line by {100 * of_size**0.5:.0f} % of its size, {10 * np.log10(above):.0f} dB "
            "more than its detection lines tell of distortion and noise: do u and y belong to the same runs, in the "
            "same order, with one trigger and one sign? If they do it bends within a few lines: record a longer period"
        )
    return bool(strange)
