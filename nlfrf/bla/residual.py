"""The output of an experiment with its linear part taken off, on excited and on detection lines."""

from __future__ import annotations

import numpy as np

from nlfrf._base.numbers import EPS, SMALL_NORM, squared_modulus
from nlfrf._base.values import value
from nlfrf.bla.frf import residual_variance
from nlfrf.bla.localfit import NOISE_LINES
from nlfrf.bla.neighbours import Places
from nlfrf.bla.spectra import Spectra
from nlfrf.signals.lines import local_mean

__all__ = ["NonlinearResidual", "is_uneven", "nonlinear_residual"]


UNEVEN = 1.5  # largest over least |G|^2, of means over the lines around, from which the place of distortion matters
JAGGED = 2.0  # the same line by line, as one realisation scatters
AROUND = 9  # lines over which |G|^2 is averaged


@value(copy=False)
class NonlinearResidual:
    """The output of an experiment with its linear part taken off.

    Fields
    ------
    G : (K,) complex ndarray
        The FRF, locally fitted and interpolated to all lines, excited and not.
    gain : (K,) ndarray
        |G|^2 as measured, interpolated: a local fit smears a light mode, and takes its level with it.
    uneven : bool
        Whether it changes over the band, so that it matters what drives the distortion, and where.
    Y : (M, K) complex ndarray
        Y - G U: a real actuator, or a loop, puts some input on detection lines too.
    noise : (K,) ndarray
        Variance of Y by noise, averaged over realisations; nan for one period.
    """

    G: np.ndarray
    gain: np.ndarray
    uneven: bool
    Y: np.ndarray
    noise: np.ndarray

    def noise_known(self) -> np.ndarray | None:
        """(K,) the noise averaged over neighbouring lines; None where it is not known, or there is none."""
        if np.isnan(self.noise[0]) or not self.noise.any():
            return None
        return local_mean(self.noise, NOISE_LINES)


def is_uneven(gain: np.ndarray) -> bool:
    """Whether |G|^2 (F,) changes over the band, by more than scatter."""
    if gain.max() > JAGGED * gain.min():
        return True
    around = local_mean(gain, AROUND)
    return bool(around.max() > UNEVEN * around.min())


def nonlinear_residual(spectra: Spectra, measured: np.ndarray, smooth: np.ndarray) -> NonlinearResidual:
    """What the linear model leaves of the output, by an FRF (F,) as measured and one that is smoothed."""
    where = spectra.where
    G = interpolate_frf(smooth, where)
    noise = residual_variance(G, spectra)
    gain = squared_modulus(G) if smooth is measured else interpolate_gain(squared_modulus(measured), where)
    return NonlinearResidual(
        G=G,
        gain=gain,
        uneven=is_uneven(squared_modulus(smooth)),  # one realisation scatters more than a static gain changes
        Y=spectra.Y - G * spectra.U,
        noise=np.add.reduce(noise) / len(noise),
    )


def interpolate_gain(gain: np.ndarray, where: Places) -> np.ndarray:
    """|G|^2 between its lines, linear in log magnitude; held at the ends."""
    logarithm = np.log(np.maximum(gain, max(EPS**2 * gain.max(), SMALL_NORM**2)))
    rise = np.zeros(gain.size)
    np.subtract(logarithm[1:], logarithm[:-1], out=rise[:-1])
    return np.asarray(np.exp(logarithm.take(where.below) + where.share * rise.take(where.below)))


def interpolate_frf(G: np.ndarray, where: Places) -> np.ndarray:
    """G between its lines, linear in log magnitude and in phase; held at the ends."""
    magnitude = np.abs(G)
    # an output without any linear part has G = 0; a floor at rounding can still be squared and divided by
    floor = max(EPS * magnitude.max(), SMALL_NORM)
    logarithm, rise = np.empty(G.size, dtype=complex), np.zeros(G.size, dtype=complex)
    np.log(np.maximum(magnitude, floor), out=logarithm.real)
    np.arctan2(G.imag, G.real, out=logarithm.imag)
    np.subtract(logarithm[1:], logarithm[:-1], out=rise[:-1])
    turns = rise.imag / (2 * np.pi)
    rise.imag -= 2 * np.pi * np.rint(turns, out=turns)  # phase goes the shorter way round
    return np.exp(logarithm.take(where.below) + where.share * rise.take(where.below))
