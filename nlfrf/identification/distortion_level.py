"""The variance of one realisation's FRF about the BLA, from detection lines or from the roughness of the FRF."""

from __future__ import annotations

import numpy as np

from nlfrf.excitation.lines import LineGrid, local_mean
from nlfrf.identification.calibration import LARGEST, grid_factor, variance_ratio
from nlfrf.identification.detection_lines import Answer, detected_power
from nlfrf.identification.frf import Frf
from nlfrf.identification.localfit import LEAST, NOISE_LINES, LocalFit, fit_locally, smooth_locally
from nlfrf.identification.spectra import Spectra
from nlfrf.shared.arguments import data_warning
from nlfrf.shared.leastsquares import mean_power, rms, squared
from nlfrf.shared.values import value

__all__ = ["Level", "choose_source", "fit_each", "level_from_detection", "pool_levels", "read_level", "smooth_frf"]


SIDE = 9  # lines over which a level is held against the scatter
DECIDED = 3.0  # log-likelihood by which one way of reading the lines beats the other: 20 to 1
FEW = 2.0  # lines: over the number of lines the variance by which one realisation's distortion is not normal
DOUBT = 0.06  # variance of the logarithm of a level about the scatter it stands for: 1.1 dB, as calibrations are good
MANY = 20  # lines over which roughness shows most of the distortion
ENOUGH = 7  # realisations whose scatter alone is worth more than a roughness that may read too high


@value(copy=False)
class Level:
    """Variance of one realisation's FRF by everything but its BLA, from one source.

    Fields
    ------
    variance : (F,) ndarray
        At each excited line, averaged over realisations, noise included.
    cautious : (F,) ndarray
        The largest that the same lines can be read as: the distortion may arise before a resonance or behind it.
    dof : (F,) ndarray
        Complex degrees of freedom behind it.
    grid_factor : (F,) ndarray
        The calibration that was applied.
    even : (F,) ndarray
        The variance that the even lines tell, with its noise left in: an upper limit where there is nothing but noise.
        nan without them.
    """

    variance: np.ndarray
    cautious: np.ndarray
    dof: np.ndarray
    grid_factor: np.ndarray
    even: np.ndarray


def read_level(source: str, excited: Spectra, answer: Answer, fit: LocalFit | None, grid: LineGrid) -> Level:
    """The level of distortion from the source that was chosen; beside scatter over realisations none, of no weight."""
    if source == "detection":
        return level_from_detection(excited, answer, grid)
    even = even_variance(excited, answer)
    if fit is None:
        nothing = np.zeros(even.size)
        return Level(variance=nothing, cautious=nothing, dof=nothing, grid_factor=np.ones(even.size), even=even)
    return level_from_roughness(fit, even)


def level_from_detection(excited: Spectra, answer: Answer, grid: LineGrid) -> Level:
    """From the odd lines that were not excited, scaled by what the grid makes of a cubic."""
    U, where = excited.amplitude, excited.where
    factor = grid_factor(U, rms(excited.Y), excited.lines, grid.odd, where.near_odd)
    factors = np.ones((where.near_detection.shape[1], factor.size))
    factors[:2] = factor
    variance, n_used, likelihood = read_detected(U, answer, where.excited, where.near_detection, factors)
    # of two readings the larger, but where the powers around decide: a line stands in as many windows as these have
    decided = local_mean(likelihood[0] - likelihood[1], SIDE) * SIDE * excited.U.shape[0] / n_used[0]
    larger = np.maximum(variance[0], variance[1])
    even = variance[2] if grid.even.size else np.full(factor.size, np.nan)
    return Level(
        variance=variance[0],
        cautious=np.where(decided > DECIDED, variance[0], np.where(decided < -DECIDED, variance[1], larger)),
        dof=n_used[0] * excited.U.shape[0],
        grid_factor=factor,
        even=even,
    )


def pool_levels(frf: Frf, level: Level, n: int) -> tuple[np.ndarray, np.ndarray]:
    """The variance behind the bound (F,) and its complex degrees of freedom: scatter over n realisations, and level.

    A level is worth what its calibration is. Where it reads something else than the scatter, over nine lines, or by
    far too little on one, it has no say.
    """
    few = 1 + FEW / frf.G.size
    if n == 1:
        return few * level.cautious, level.dof
    if not level.dof.any():
        return frf.var_total, np.full(frf.G.size, n - 1.0)
    scatter = n * frf.var_total
    tiny = np.finfo(float).tiny
    ratio = (scatter + tiny) / (few * level.cautious + tiny)
    alone, around = np.maximum(np.log(ratio), 0.0), np.log(local_mean(ratio, SIDE))
    chance = 1 / (n - 1) + 1 / level.dof
    doubt = DOUBT + np.maximum(alone**2 - 4 * chance, 0.0) + np.maximum(around**2 - 4 * chance / SIDE, 0.0)
    dof_level = 1 / (1 / level.dof + doubt)
    dof = n - 1 + dof_level
    return ((n - 1) * frf.var_total + dof_level * few * level.cautious / n) / dof, dof


def even_variance(excited: Spectra, answer: Answer) -> np.ndarray:
    """(F,) what the even lines say where the odd ones are not read."""
    where = excited.where
    if not where.even.size:
        return np.full(excited.lines.size, np.nan)
    return read_detected(excited.amplitude, answer, where.excited, where.near_even, np.ones((1, 1)))[0][0]


def read_detected(
    U: np.ndarray, answer: Answer, here: np.ndarray, windows: np.ndarray, factors: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Variances (k, F) of one realisation's FRF for inputs of amplitude U, by k readings; lines used; likelihoods.

    Windows are (n, k, F).
    """
    known = not np.isnan(answer.noise[0])
    noise = local_mean(answer.noise, NOISE_LINES) if known else np.zeros(answer.noise.size)
    power, gain = mean_power(answer.Yc), squared(answer.G)
    follows = np.arange(windows.shape[1])[:, None] != 1
    distortion, ratio, n_used, likelihood = detected_power(power, noise, gain, gain[here], windows, follows)
    return ratio * (factors * distortion + noise[here]) / U**2, n_used, likelihood


def smooth_frf(frf: Frf, excited: Spectra, rough: bool) -> tuple[np.ndarray, LocalFit | None]:
    """(F,) an FRF to take the linear answer off with; and the fit of each realisation where its roughness counts."""
    if rough:
        fit = fit_each(frf, excited)
        return fit.G.mean(axis=0), fit
    if excited.lines.size < LEAST or excited.U.shape[0] >= ENOUGH:
        return frf.G, None
    return smooth_locally(frf.G[None], excited.amplitude[None], excited.where)[0], None  # it whitens more evenly


def fit_each(frf: Frf, excited: Spectra) -> LocalFit:
    """Each realisation's FRF, fitted over the excited lines: what remains is its roughness."""
    known = np.isfinite(frf.noise).all()
    return fit_locally(frf.each, np.abs(excited.U), excited.where, frf.noise if known else None)


def level_from_roughness(fit: LocalFit, even: np.ndarray) -> Level:
    """From the roughness of each realisation's FRF over the excited lines."""
    variance, ones = fit.variance.mean(axis=0), np.ones(even.size)
    return Level(variance=variance, cautious=variance, dof=fit.dof.sum(axis=0), grid_factor=ones, even=even)


def choose_source(level_from: str, excited: Spectra, grid: LineGrid, n_detection: int) -> str:
    """Which source the level is taken from, with a warning where detection lines are passed over."""
    if level_from == "detection" and grid.odd.size < n_detection:
        raise ValueError(
            f"lines must hold at least n_detection = {n_detection} odd detection lines for "
            f'level_from="detection", got {grid.odd.size} on this {grid.kind} grid'
        )
    if level_from != "auto":
        return level_from
    if calibrates(excited, grid, n_detection):
        return "detection"
    if excited.U.shape[0] >= ENOUGH:
        return "realizations"
    data_warning(why_roughness(grid, n_detection))
    return "roughness"


def calibrates(excited: Spectra, grid: LineGrid, n_detection: int) -> bool:
    """Whether odd detection lines tell the level within a known factor on this grid."""
    kind = grid.kind
    if grid.odd.size < n_detection or kind in ("full", "odd", "odd-odd"):
        return False
    if kind in ("special-odd", "random-odd"):
        return True
    if np.any(grid.excited % 2 == 0):
        return False
    ratio = variance_ratio(excited.amplitude, grid.excited, grid.odd, excited.where.near_odd)
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
    few = f"; on {grid.excited.size} lines it may read too low as well" if grid.excited.size < MANY else ""
    return (
        f"{reason}; the level was taken from the roughness of the FRF, which reads too high where the FRF bends within "
        f"a few lines{few}. A special-odd or random-odd multisine gives a level that can be calibrated."
    )
