"""The variance of one realisation's FRF about the BLA, from detection lines or from the roughness of the FRF."""

from __future__ import annotations

import numpy as np

from nlfrf.excitation.lines import LineGrid, local_mean
from nlfrf.identification.calibration import LARGEST, grid_factor, variance_ratio
from nlfrf.identification.detection_lines import detected_power, interpolate_frf
from nlfrf.identification.frf import Frf, ratio_variance
from nlfrf.identification.leastsquares import squared
from nlfrf.identification.localfit import LEAST, NOISE_LINES, LocalFit, fit_locally
from nlfrf.identification.neighbours import detection_windows, layout, nearest
from nlfrf.identification.spectra import Spectra, residual_variance
from nlfrf.shared.values import value

__all__ = [
    "ENOUGH",
    "calibrates",
    "even_variance",
    "fit_each",
    "level_from_detection",
    "level_from_roughness",
    "mean_power",
    "no_level",
    "nonlinear_answer",
    "rms",
    "why_roughness",
]


ENOUGH = 7  # realisations whose scatter alone is worth more than a roughness that may read too high


@value(copy=False)
class Level:
    """Variance of one realisation's FRF by everything but its BLA, from one source.

    Fields
    ------
    variance : (F,) ndarray
        At each excited line, averaged over realisations, noise included.
    dof : (F,) ndarray
        Complex degrees of freedom behind it.
    grid_factor : (F,) ndarray
        The calibration that was applied.
    """

    variance: np.ndarray
    dof: np.ndarray
    grid_factor: np.ndarray


@value(copy=False)
class Answer:
    """The output of an experiment with its linear part taken off.

    Fields
    ------
    G : (K,) complex ndarray
        The FRF, locally fitted and interpolated to all lines, excited and not.
    Yc : (M, K) complex ndarray
        Y - G U: a real actuator, or a loop, puts some input on detection lines too.
    noise : (K,) ndarray
        Variance of Yc by noise, averaged over realisations; nan for one period.
    """

    G: np.ndarray
    Yc: np.ndarray
    noise: np.ndarray


def nonlinear_answer(
    spectra: Spectra, frf: Frf, excited: Spectra, grid: LineGrid, fit: LocalFit | None = None
) -> Answer:
    """What is left of the output when the answer of the BLA, fitted locally (`fit_each` or here), is taken off."""
    smooth = frf.G
    if fit is not None:
        smooth = fit.G.mean(axis=0)
    elif excited.lines.size >= LEAST and excited.U.shape[0] < ENOUGH:  # with less scatter G whitens more evenly
        smooth = fit_locally(frf.G[None], rms(excited.U)[None], grid).G[0]
    G = interpolate_frf(smooth, excited.lines, spectra.lines)
    noise = residual_variance(G, spectra)
    return Answer(G=G, Yc=spectra.Y - G * spectra.U, noise=np.add.reduce(noise) / len(noise))


def level_from_detection(
    excited: Spectra, answer: Answer, grid: LineGrid, n_detection: int
) -> tuple[Level, np.ndarray]:
    """From the odd lines that were not excited, scaled by what the grid makes of a cubic; and what the even ones say.

    The second, (F,), has its noise left in: it is an upper limit where there is nothing but noise.
    """
    U = rms(excited.U)
    factor = grid_factor(U, rms(excited.Y), excited.lines, grid.odd, nearest(grid, "odd", n_detection))
    kinds = ("odd", "even") if grid.even.size else ("odd",)
    factors = np.ones((len(kinds), factor.size))
    factors[0] = factor
    variance, n_used = detected(U, answer, grid, kinds, factors, n_detection)
    even = variance[1] if grid.even.size else np.full(factor.size, np.nan)
    return Level(variance=variance[0], dof=n_used[0] * excited.U.shape[0], grid_factor=factor), even


def even_variance(excited: Spectra, answer: Answer, grid: LineGrid, n_detection: int) -> np.ndarray:
    """(F,) what the even lines say where the odd ones are not read."""
    if not grid.even.size:
        return np.full(excited.lines.size, np.nan)
    return detected(rms(excited.U), answer, grid, ("even",), np.ones((1, 1)), n_detection)[0][0]


def detected(
    U: np.ndarray, answer: Answer, grid: LineGrid, kinds: tuple[str, ...], factors: np.ndarray, n_detection: int
) -> tuple[np.ndarray, np.ndarray]:
    """Variances (k, F) of one realisation's FRF, with inputs of amplitude U, that k kinds of lines tell; lines used."""
    known = not np.isnan(answer.noise[0])
    noise = local_mean(answer.noise, NOISE_LINES) if known else np.zeros(answer.noise.size)
    power, gain = mean_power(answer.Yc), squared(answer.G)
    here, window = layout(grid).excited, detection_windows(grid, kinds, n_detection)
    distortion, ratio, n_used = detected_power(power, noise, gain, gain[here], window)
    return ratio * (factors * distortion + noise[here]) / U**2, n_used


def fit_each(excited: Spectra, frf: Frf, grid: LineGrid) -> LocalFit:
    """Each realisation's FRF, fitted over the excited lines: what remains is its roughness."""
    noise = ratio_variance(frf.each, excited)
    known = np.isfinite(noise).all()
    return fit_locally(frf.each, np.abs(excited.U), grid, noise if known else None)


def level_from_roughness(fit: LocalFit) -> Level:
    """From the roughness of each realisation's FRF over the excited lines."""
    return Level(variance=fit.variance.mean(axis=0), dof=fit.dof.sum(axis=0), grid_factor=np.ones(fit.G.shape[1]))


def no_level(n_lines: int) -> Level:
    """None beside the scatter over realisations: it weighs nothing."""
    return Level(variance=np.zeros(n_lines), dof=np.zeros(n_lines), grid_factor=np.ones(n_lines))


def calibrates(excited: Spectra, grid: LineGrid, n_detection: int) -> bool:
    """Whether odd detection lines tell the level within a known factor on this grid."""
    kind = grid.kind
    if grid.odd.size < n_detection or kind in ("full", "odd", "odd-odd"):
        return False
    if kind in ("special-odd", "random-odd"):
        return True
    if np.any(grid.excited % 2 == 0):
        return False
    ratio = variance_ratio(rms(excited.U), grid.excited, grid.odd, nearest(grid, "odd", n_detection))
    return bool(np.mean(ratio <= LARGEST) >= 0.95)


def why_roughness(grid: LineGrid, n_detection: int) -> str:
    """The warning that goes with a level from the roughness."""
    kind, n_odd = grid.kind, grid.odd.size
    if kind == "odd-odd":
        reason = (
            "the odd detection lines of an odd-odd grid under-read the distortion, without limit around a resonance"
        )
    elif n_odd == 0:
        reason = f"the {kind} grid of this record has no odd detection lines"
    elif n_odd < n_detection:
        reason = f"the grid of this record has {n_odd} odd detection lines, fewer than n_detection = {n_detection}"
    else:
        reason = f"the detection lines of this {kind} grid do not calibrate"
    return (
        f"{reason}; the level was taken from the roughness of the FRF, which reads too high where the FRF bends within "
        "a few lines. A special-odd or random-odd multisine gives a level that can be calibrated."
    )


def mean_power(x: np.ndarray) -> np.ndarray:
    """Mean squared modulus over realisations."""
    return np.asarray(np.add.reduce(squared(x), axis=0) / x.shape[0])


def rms(x: np.ndarray) -> np.ndarray:
    """Root mean square modulus over realisations."""
    return np.sqrt(mean_power(x))
