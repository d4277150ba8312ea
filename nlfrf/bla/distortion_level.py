"""The variance of one realisation's FRF about the BLA, from detection lines or from the roughness of the FRF."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from nlfrf._base.arguments import data_warning
from nlfrf._base.numbers import TINY, mean_power, rms
from nlfrf._base.values import value
from nlfrf.bla.calibration import COMMON, FEW, HIGHEST, LARGEST, read_grid, variance_ratio
from nlfrf.bla.detection_lines import UNTOLD, Answer, Law, detected_power
from nlfrf.bla.frf import Frf
from nlfrf.bla.localfit import LEAST, NOISE_LINES, LocalFit, fit_locally, is_flat
from nlfrf.bla.neighbours import KEPT, Places
from nlfrf.bla.spectra import Spectra
from nlfrf.signals.lines import LineGrid, local_mean

__all__ = [
    "Level",
    "choose_source",
    "doubt_at_ends",
    "fit_each",
    "level_from_detection",
    "pool_levels",
    "read_level",
    "smooth_frf",
    "widened",
]


SIDE = 9  # lines over which a level is held against the scatter
#: The readings of detection lines: driven by the input (0) or the output (1), and whether they follow |G|. The last
#: one of odd lines fades with frequency; behind it the even lines, which are read as following.
DRIVE = np.array([0, 1, 0, 1, 0, 0])
FOLLOWS = np.array([True, True, False, False, False, True])
WINDOW = np.array([0, 0, 0, 0, 0, 1])  # of odd lines; of even ones
PLACES, FADES, EVEN = 4, 4, 5  # how many differ by drive and place; the one that fades, the even lines
EVERY, ANYWHERE = np.arange(6), np.array([2, FADES, EVEN])  # where |G| is even all drives and places are one
FADING = 1.5  # power of the frequency: a hysteresis has from 1 to 2
RARE = 4.0  # one of this many places is what it counts as where the lines do not decide: a level rarely fades
BENT = 3.0  # how far a roughness above a reading speaks against it: beyond that it is G that bends
DOUBT = 0.06  # variance of the logarithm of a level about the scatter it stands for: 1.1 dB, as calibrations are good
MANY = 20  # lines over which roughness shows most of the distortion
TAIL = 0.05  # of a bound at 95 %
ENOUGH = 7  # realisations whose scatter alone is worth more than a roughness that may read too high


@value(copy=False)
class Level:
    """Variance of one realisation's FRF by everything but its BLA, from one source.

    Fields
    ------
    variance : (F,) ndarray
        At each excited line, averaged over realisations, noise included.
    cautious : (F,) ndarray
        What a bound takes: what the lines read where the distortion may arise before a resonance or behind it, held
        against the roughness.
    dof : (F,) ndarray
        Complex degrees of freedom behind it.
    grid_factor : (F,) ndarray
        The calibration that was applied.
    even : (F,) ndarray
        The variance that the even lines tell, with its noise left in: an upper limit where there is nothing but noise.
        nan without them.
    doubt : (F,) ndarray
        Variance of the logarithm of the level beyond that of its degrees of freedom, at the ends of the band.
    """

    variance: np.ndarray
    cautious: np.ndarray
    dof: np.ndarray
    grid_factor: np.ndarray
    even: np.ndarray
    doubt: np.ndarray | float = 0.0

    def at_least(self, power: np.ndarray) -> Level:
        """The same with a variance of at least some power (F,)."""
        if not power.any():
            return self
        return replace(self, variance=np.maximum(self.variance, power), cautious=np.maximum(self.cautious, power))


def read_level(source: str, excited: Spectra, answer: Answer, fit: LocalFit | None, low: bool, law: Law) -> Level:
    """The level of distortion from the source that was chosen; beside scatter over realisations none, of no weight."""
    if source == "detection":
        return level_from_detection(excited, answer, fit, low, law)
    even = even_variance(excited, answer)
    ones = np.ones(even.size)
    if fit is None:
        nothing = np.zeros(even.size)
        return Level(variance=nothing, cautious=nothing, dof=nothing, grid_factor=ones, even=even)
    variance, dof = fit.variance.mean(axis=0), fit.dof.sum(axis=0)
    doubt = doubt_at_ends(variance, dof, answer.gain.take(excited.where.excited), excited.where, False)
    return Level(variance=variance, cautious=variance, dof=dof, grid_factor=ones, even=even, doubt=doubt)


def doubt_at_ends(
    level: np.ndarray, dof: np.ndarray, gain: np.ndarray, where: Places, detection: bool
) -> np.ndarray | float:
    """(F,) variance of the logarithm of a level on the lines of which its windows do not tell; none of few lines.

    Those at the ends of the band lie to one side of their lines, by up to half their width. How far a level changes
    over that is taken from how it changes over the band: evenly over its lines, or over the logarithm of frequency,
    whichever is more, each by the mean square between windows that share no line, less what chance makes of it. |G|^2
    is taken off where that leaves less.
    """
    if gain.size < FEW:
        return 0.0
    aside, weight, of_chance = one_sided(where, detection)
    both = np.empty((2, gain.size))
    both[0] = level
    np.divide(level, gain, out=both[1])
    np.log(np.maximum(both, TINY), out=both)
    change = both[:, SIDE:] - both[:, :-SIDE]
    change *= change
    told = np.minimum.reduce(change @ weight) - 2 * gain.size / np.add.reduce(dof) * of_chance  # (2,)
    if told[0] <= 0 and told[1] <= 0:
        return 0.0
    aside = aside * told[:, None]
    return np.asarray(np.maximum(np.maximum(aside[0], aside[1]), 0.0))


@lru_cache(maxsize=KEPT)
def one_sided(where: Places, detection: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """How far the windows at the ends stand aside of their lines (2, F): in windows, and in logarithm of frequency.

    The weights (F - 9, 2) with which squared changes over nine lines tell the change by either; and their sums (2,).
    """
    lines = where.lines[where.excited].astype(float)
    seen = where.detection[where.near_odd] if detection else lines[where.near_excited]
    window = SIDE * (lines[-1] - lines[0]) / (lines.size - 1)
    aside = np.abs([(seen.mean(axis=1) - lines) / window, np.log(seen).mean(axis=1) - np.log(lines)])
    aside[:, SIDE // 2 : -(SIDE // 2)] = 0.0
    apart = np.log(lines[SIDE:] / lines[:-SIDE])
    weight = np.stack([np.full(apart.size, 1 / apart.size), apart / (apart @ apart)], axis=1)
    of_chance = weight.sum(axis=0)
    for array in (aside, weight, of_chance):
        array.flags.writeable = False
    return aside, weight, of_chance


def widened(dof: np.ndarray, doubt: np.ndarray | float) -> np.ndarray:
    """(F,) what a variance is multiplied by so that it holds at 95 % where its logarithm is in doubt.

    It counts as one of fewer degrees of freedom, at least one. The degrees of freedom stay as they are: their tails,
    which all lines together ask for, are far beyond those of such a doubt.
    """
    fewer = np.maximum(dof / (1 + dof * doubt), np.minimum(dof, 1.0))
    return np.asarray(fewer * (TAIL ** (-1 / fewer) - 1) / (dof * (TAIL ** (-1 / dof) - 1)))


def level_from_detection(
    excited: Spectra, answer: Answer, fit: LocalFit | None, low: bool = False, law: Law = UNTOLD
) -> Level:
    """From the odd lines that were not excited, scaled by what the grid makes of a cubic.

    The input may drive it or the output, and what it makes may follow |G| or not, or fade with frequency as the memory
    of a hysteresis does. Each of these readings says how the power is spread over the detection lines, and how rough G
    then is: they weigh as likely as they make the lines around. Of the share that the phases say is a cubic's, only the
    reading counts that they tell. Where |G| is even, drive and place make no difference, and those readings are one.

    Roughness reads too high, if anything: where detection lines say more, and no scatter is there, both say as much.
    Not of low peaks (`are_low`), which leave more of the distortion to one gain on all lines, and that is not rough.
    """
    where, n_realizations = excited.where, excited.U.shape[0]
    readings, profiles, factors = read_drives(excited, answer.uneven)
    n_odd = np.count_nonzero(readings != EVEN)
    variance, n_used, likelihood = read_detected(excited, answer, where.near_detection, readings, factors, profiles)
    even = variance[n_odd] if where.even.size else np.full(variance.shape[1], np.nan)
    variance = variance[:n_odd]
    # a line stands in as many windows as these have
    evidence = likelihood[:n_odd] * (n_realizations / n_used[0])
    if fit is not None:
        rough = np.minimum((n_realizations * fit.variance[0] + TINY) / (variance + TINY), BENT)
        evidence += (np.log(rough) - rough) * (fit.dof[0] / where.near_excited.shape[1])
    evidence = mean_around(evidence, SIDE) * min(SIDE, where.excited.size)
    evidence[-1] -= np.log(RARE * PLACES / (n_odd - 1))
    weight = np.exp(evidence - evidence.max(axis=0))
    weight /= np.add.reduce(weight)
    # at 95 % the root mean square is what the quantile of such a mixture asks for
    cautious = np.sqrt(np.add.reduce(weight * variance * variance))
    if law.share:
        told = law.reading if answer.uneven else 0
        cautious += law.share * (variance[told] - cautious)
        weight *= 1 - law.share
        weight[told] += law.share
    dof = n_used[0] * n_realizations
    if fit is not None and n_realizations == 1 and not low:
        cautious = np.minimum(cautious, np.sqrt(cautious * fit.variance[0]))
    return Level(
        variance=np.add.reduce(weight * variance),
        cautious=cautious,
        dof=dof,
        grid_factor=np.add.reduce(weight * factors[:n_odd]),
        even=even,
        doubt=(1 - law.share) * doubt_at_ends(cautious, dof, answer.gain.take(where.excited), where, True),
    )


def read_drives(excited: Spectra, uneven: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`readings_of` a record: where |G| is even the output drives what the input does."""
    if uneven:
        return readings_of(np.array([excited.amplitude, rms(excited.Y)]), excited.where)
    if is_flat(excited.amplitude):
        return readings_of_flat(excited.where)
    return readings_of(excited.amplitude[None], excited.where)


def readings_of(drives: np.ndarray, where: Places) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The readings (k,) by the spectra (d, F) that may drive, with their profiles (n, k, F) and factors (k, F)."""
    readings = EVERY if len(drives) > 1 else ANYWHERE
    if not where.even.size:
        readings = readings[:-1]
    lines = where.lines[where.excited]
    profile, factor = read_grid(drives, lines, where.detection, where.near_odd, HIGHEST[: len(drives)])
    profiles, factors = profile.take(DRIVE[readings], axis=1), factor.take(DRIVE[readings], axis=0)
    profiles[:, readings == FADES] *= fading(where)[:, None]
    profiles[:, readings == EVEN], factors[readings == EVEN] = 1.0, 1.0
    return readings, profiles, factors


@lru_cache(maxsize=KEPT)
def readings_of_flat(where: Places) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The same of one flat spectrum, which the grid alone tells."""
    readings, profiles, factors = readings_of(np.ones((1, where.excited.size)), where)
    profiles.flags.writeable = factors.flags.writeable = False
    return readings, profiles, factors


@lru_cache(maxsize=KEPT)
def fading(where: Places) -> np.ndarray:
    """(n, F) how much stronger than at the excited line a level that fades is on the lines of its window."""
    lines = where.lines[where.excited]
    return np.asarray((lines / where.detection[where.near_odd.T]) ** FADING)


def mean_around(x: np.ndarray, n: int) -> np.ndarray:
    """Mean over the n neighbours of each entry along the last axis; at the ends over the first n, or the last."""
    size = x.shape[-1]
    n = min(n, size)
    sums = np.zeros((*x.shape[:-1], size + 1))
    np.add.accumulate(x, axis=-1, out=sums[..., 1:])
    means = (sums[..., n:] - sums[..., :-n]) / n
    return means.take(np.arange(-(n // 2), size - n // 2), axis=-1, mode="clip")


def pool_levels(frf: Frf, level: Level, n: int, common: float) -> tuple[np.ndarray, np.ndarray]:
    """The variance behind the bound (F,) and its complex degrees of freedom: scatter over n realisations, and level.

    A level is worth what its calibration is. Where it reads something else than the scatter, over nine lines, or by
    far too little on one, it has no say.
    """
    if n == 1:
        variance = (1 + common) * level.cautious
        if isinstance(level.doubt, np.ndarray):
            variance = variance * widened(level.dof, level.doubt)
        return variance, level.dof
    usual = 1 + COMMON / frf.G.size  # as far as the scatter shows it
    beyond = (1 + common) / usual
    if not level.dof.any():
        return beyond * frf.var_total, np.full(frf.G.size, n - 1.0)
    scatter = n * frf.var_total
    ratio = np.maximum((scatter + TINY) / (usual * level.cautious + TINY), TINY)
    alone, around = np.maximum(np.log(ratio), 0.0), np.log(np.maximum(local_mean(ratio, SIDE), TINY))
    spread = 1 / (n - 1) + 1 / level.dof
    doubt = (
        DOUBT + level.doubt + np.maximum(alone**2 - 4 * spread, 0.0) + np.maximum(around**2 - 4 * spread / SIDE, 0.0)
    )
    dof_level = 1 / (1 / level.dof + doubt)
    dof = n - 1 + dof_level
    return beyond * ((n - 1) * frf.var_total + dof_level * usual * level.cautious / n) / dof, dof


def even_variance(excited: Spectra, answer: Answer) -> np.ndarray:
    """(F,) what the even lines say where the odd ones are not read."""
    where = excited.where
    if not where.even.size:
        return np.full(excited.lines.size, np.nan)
    return read_detected(excited, answer, where.near_even, EVERY[EVEN:])[0][0]


def read_detected(
    excited: Spectra,
    answer: Answer,
    windows: np.ndarray,
    readings: np.ndarray,
    factors: np.ndarray | float = 1.0,
    profiles: np.ndarray | float = 1.0,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Variances (k, F) of one realisation's FRF by k readings of the windows (n, w, F); lines used; likelihoods."""
    here, follows, window = excited.where.excited, FOLLOWS[readings], WINDOW[readings]
    known = not np.isnan(answer.noise[0])
    noise = local_mean(answer.noise, NOISE_LINES) if known else np.zeros(answer.noise.size)
    distortion, ratio, n_used, likelihood = detected_power(
        mean_power(answer.Yc),
        noise,
        answer.gain,
        answer.gain.take(here),
        windows,
        window - window[0],
        follows,
        profiles,
    )
    return ratio * (factors * distortion + noise[here]) / excited.amplitude**2, n_used, likelihood


def smooth_frf(frf: Frf, excited: Spectra, rough: bool) -> tuple[np.ndarray, LocalFit | None]:
    """(F,) an FRF to take the linear answer off with; and the fit of each realisation where its roughness counts."""
    if rough:
        fit = fit_each(frf, excited)
        return fit.G.mean(axis=0), fit
    if excited.lines.size < LEAST or excited.U.shape[0] >= ENOUGH:
        return frf.G, None
    fit = fit_locally(frf.G[None], excited.amplitude[None], excited.where)
    return fit.G[0], fit  # less scatter: it whitens more evenly


def fit_each(frf: Frf, excited: Spectra) -> LocalFit:
    """Each realisation's FRF, fitted over the excited lines: what remains is its roughness."""
    known = np.isfinite(frf.noise).all()
    return fit_locally(frf.each, np.abs(excited.U), excited.where, frf.noise if known else None)


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
    ratio = variance_ratio(excited.amplitude, grid.excited, excited.where.detection, excited.where.near_odd)
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
