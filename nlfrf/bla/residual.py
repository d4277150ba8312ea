"""The nonlinear residual: the outputs of all experiments minus their linear part, on excited and
detection lines.

    Y_residual = Y - G U        (Pintelon & Schoukens, 2nd ed., 3.4 and 4.3: Y_s, the stochastic nonlinear contribution)

G U is subtracted on detection lines, too: a real actuator, or a loop, puts input power there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from nlfrf._base.numbers import EPS, SMALL_NORM, TINY, squared_modulus
from nlfrf.bla.line_index import SMOOTHING_LINES, LineIndex
from nlfrf.bla.local_models import NOISE_SMOOTHING_LINES
from nlfrf.bla.spectra import Spectra, residual_scatter
from nlfrf.signals.lines import local_mean

#: Largest over smallest |G|^2, as means over neighbouring lines, above which the place of the
#: distortion matters.
_MIN_GAIN_VARIATION = 1.5
_CLEAR_GAIN_VARIATION = 2.0  # the same for single lines, which scatter in one realisation


class NonlinearResidual(NamedTuple):
    """The outputs of all experiments minus their linear part."""

    # (n_y, n_u, K) complex the matrix, locally fitted and interpolated to all lines, excited and
    # not
    G: np.ndarray
    # (n_y, K) mean square of each output over the excitation power, for the matrix as measured and
    # equal power on all lines: sum_i |G_ji|^2 a_i^2, interpolated. A local fit smears a light mode,
    # and its level with it; in a loop U dips at a resonance, and distortion does not.
    gain: np.ndarray
    # True if `gain` changes over the band, so that source and place of the distortion matter
    gain_varies: tuple[bool, ...]
    Y: np.ndarray  # (n_y, M, K) complex Y - G U, also on detection lines
    noise: (
        np.ndarray
    )  # (n_y, K) variance of Y by noise, averaged over experiments; nan for one period

    def smoothed_noise(self, output: int) -> np.ndarray | None:
        """Return the (K,) noise variance of an output, averaged over neighbouring lines; None if
        unknown or zero.
        """
        noise = self.noise[output]
        if np.isnan(noise[0]) or not noise.any():
            return None
        return local_mean(noise, NOISE_SMOOTHING_LINES)


def _gain_varies(gain: np.ndarray) -> bool:
    """Return whether |G|^2 (F,) changes over the band by more than scatter."""
    ratio = gain.max() / max(gain.min(), TINY)
    if ratio > _CLEAR_GAIN_VARIATION or ratio <= _MIN_GAIN_VARIATION:
        return bool(ratio > _CLEAR_GAIN_VARIATION)
    smoothed = local_mean(gain, SMOOTHING_LINES)
    return bool(smoothed.max() > _MIN_GAIN_VARIATION * smoothed.min())


def nonlinear_residual(
    spectra: Spectra, excited: Spectra, *, measured: np.ndarray, smooth: np.ndarray
) -> NonlinearResidual:
    """Return the outputs minus their linear part, from a measured and a smoothed matrix (n_y, n_u,
    F).
    """
    index = spectra.index
    G = _interpolate_frf(smooth, index)
    a = np.add.reduce(excited.mean_power_U, axis=1) / excited.lines.size
    of_smooth = np.vecmat(a, squared_modulus(smooth))
    if smooth is measured:
        gain = np.vecmat(a, squared_modulus(G))
    else:  # a local fit smears a light mode, and its level with it
        gain = _interpolate_gain(np.vecmat(a, squared_modulus(measured)), index)
    scatter = residual_scatter(G, spectra)
    noise = np.add.reduce(squared_modulus(scatter), axis=(1, 2)) / (
        scatter.shape[1] if scatter.shape[2] else np.nan
    )
    if len(spectra.U) == 1:
        linear = G * spectra.U
    else:
        linear = np.einsum("jik,imk->jmk", G, spectra.U)
    return NonlinearResidual(
        G=G,
        gain=gain,
        # of the smoothed matrix: one realisation scatters more than a static gain changes
        gain_varies=tuple(map(_gain_varies, of_smooth)),
        Y=spectra.Y - linear,
        noise=noise,
    )


def _interpolate_gain(gain: np.ndarray, index: LineIndex) -> np.ndarray:
    """Interpolate |G|^2 (..., F) to all lines, linear in log magnitude; constant beyond the
    ends.
    """
    floor = np.maximum(EPS**2 * gain.max(axis=-1, keepdims=True), SMALL_NORM**2)
    return np.asarray(np.exp(_interpolate_to_lines(np.log(np.maximum(gain, floor)), index)))


def _interpolate_frf(G: np.ndarray, index: LineIndex) -> np.ndarray:
    """Interpolate G (..., F) to all lines, linear in log magnitude and in phase; constant beyond
    the ends.
    """
    magnitude = np.abs(G)
    # an output without linear part has G = 0; a floor at rounding can still be squared and divided
    # by
    floor = np.maximum(EPS * magnitude.max(axis=-1, keepdims=True), SMALL_NORM)
    logarithm = np.empty(G.shape, dtype=complex)
    np.log(np.maximum(magnitude, floor), out=logarithm.real)
    np.arctan2(G.imag, G.real, out=logarithm.imag)
    return np.exp(_interpolate_to_lines(logarithm, index))


def _interpolate_to_lines(x: np.ndarray, index: LineIndex) -> np.ndarray:
    """Interpolate x (..., F) to all lines, linear between the excited ones; its imaginary part is
    an angle.
    """
    rise = np.zeros(x.shape, dtype=x.dtype)
    np.subtract(x[..., 1:], x[..., :-1], out=rise[..., :-1])
    if x.dtype == complex:
        turns = rise.imag / (2 * np.pi)
        rise.imag -= 2 * np.pi * np.rint(turns, out=turns)  # the phase takes the shorter way round
    return np.asarray(
        x.take(index.excited_below, axis=-1)
        + index.interpolation_weight * rise.take(index.excited_below, axis=-1)
    )
