"""The log level of distortion on the windows of a grid: locally linear over frequency.

The position of a line is measured in standard deviations of the change of the level, so that the
prior of its slope is standard normal. Coordinates and normal equations depend on the grid alone.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from nlfrf._base.numbers import TINY, clip
from nlfrf._base.values import value
from nlfrf.bla.calibration import FEW_LINES
from nlfrf.bla.line_index import N_CACHED_GRIDS, LineIndex
from nlfrf.bla.scaled_f import log_density_of_ratio, widened_dof

#: Variance of the log of a calibration c about the truth: 1.1 dB, as measured over the plants of
#: benchmarks/plants.py.
_CALIBRATION_LOG_VARIANCE = 0.06
#: The level is log-linear in a coordinate in which the prior of its slope is standard normal:
#: lambda may change as f^+-1 (a hysteresis has f^-1 to f^-2) and by 5 % a line. Below four lines
#: the logarithm of frequency is cut off: a level does not grow without end towards zero frequency.
#: Halving either changes the loss by less than 0.5 %.
_SLOPE_PER_LOG_FREQUENCY, _SLOPE_PER_LINE, _LOWEST_LINES = 1.0, 0.05, 4.0
# neighbouring excited lines whose likelihoods weigh the hypotheses; 7 to 13 give the same loss
EVIDENCE_LINES = 9
# a third step changes the radius by 0.2 % in the median, and by 6 % on one line in a hundred
_N_SCORING_STEPS = 2
_MIN_RELATIVE_POWER = 1e-10  # share of the largest expected power in a window


@value(copy=False)
class _WindowCoordinates:
    """Coordinates of a grid for the log-linear fit, and its normal equations, which depend on the
    grid alone.
    """

    # (n, F) position of each detection line of a window from its excited line, in standard
    # deviations of the slope
    x: np.ndarray
    x_rough: np.ndarray  # (F,) mean position of the excited lines of a roughness window
    # common, x_common: (F,) weight of the calibration error common to a window; the same times the
    # sum of x over the window
    common: float
    x_common: np.ndarray
    n_lines: float  # weight of the lines of a window for the level, as a number of lines
    covariance: (
        np.ndarray
    )  # (3, F) inverse of the normal equations: level, level with slope, slope with its prior
    dof: np.ndarray  # (F,) degrees of freedom of the level
    # (F,) detection lines in the windows of nine neighbouring excited lines, over the length of one
    # window
    n_distinct: np.ndarray


def expected_total(
    power: np.ndarray,
    noise: np.ndarray,
    *,
    shape: np.ndarray,
    factors: np.ndarray,
    noise_here: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the expected power on the lines of a window (H, n, F) over that at its excited line,
    and that (H, F).

    The noise is known from the periods. The distortion d in q_j = d a_j + n_j is found by maximum
    likelihood, with scoring for exponentially distributed powers (n, F). The first step has the
    weights of the case without noise.
    """
    excess, floor = power - noise, noise + TINY
    d = np.maximum(np.add.reduce(excess / shape, axis=1) / len(power), 0.0)
    for _ in range(_N_SCORING_STEPS):
        expected = d[:, None] * shape
        expected += floor
        # relative to the largest: squares of rounding errors underflow, and some powers are exactly
        # zero
        expected = np.maximum(
            expected / np.maximum.reduce(expected, axis=1)[:, None], _MIN_RELATIVE_POWER
        )
        weighted = shape / (expected * expected)
        d = np.maximum(
            np.add.reduce(weighted * excess, axis=1) / np.add.reduce(weighted * shape, axis=1), 0.0
        )
    expected = d[:, None] * shape
    expected += floor
    total = d * factors + noise_here + TINY
    return expected / total[:, None], total


def fit_log_level(
    y: np.ndarray, log_shape: np.ndarray, *, windows: _WindowCoordinates, M: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fit the log level at each line, its slope and the log likelihood (H, F) to whitened powers y
    (H, n, F).

    The likelihood is gamma with M degrees of freedom per line and a log-linear mean. The slope has
    a standard normal prior; a calibration error is common to the window. Scoring has an information
    matrix independent of the data.
    """
    x, n = windows.x, len(windows.x)
    var_level, cov_slope, var_slope = windows.covariance
    common = windows.common
    mean = np.add.reduce(y, axis=1) / n
    # the first step starts from the mean and zero slope: its residuals sum to zero
    by_slope = M * np.add.reduce((y / mean[:, None] - 1) * x, axis=1)
    # steps of at most 1.5: a single line far above the others would spoil the first one
    level = np.log(mean) + clip(cov_slope * by_slope, -1.5, 1.5)
    slope = clip(var_slope * by_slope, -1.5, 1.5)
    for _ in range(1, _N_SCORING_STEPS):
        rest = slope[:, None] * x
        rest += level[:, None]
        np.exp(np.negative(rest, out=rest), out=rest)
        rest *= y
        rest -= 1
        sum_rest = np.add.reduce(rest, axis=1)
        by_level = (M - common * n) * sum_rest
        by_slope = (
            M * np.add.reduce(np.multiply(rest, x, out=rest), axis=1)
            - windows.x_common * sum_rest
            - slope
        )
        level += clip(var_level * by_level + cov_slope * by_slope, -1.5, 1.5)
        slope += clip(cov_slope * by_level + var_slope * by_slope, -1.5, 1.5)
    expected = slope[:, None] * x
    expected += level[:, None]
    log_shape += expected
    np.exp(np.negative(expected, out=expected), out=expected)
    relative = np.add.reduce(np.multiply(y, expected, out=expected), axis=1)
    likelihood = -M * (np.add.reduce(log_shape, axis=1) + relative)
    return level, slope, likelihood - slope * slope / 2 + common / 2 * (relative - n) ** 2


def level_from_roughness(
    index: LineIndex, rough: np.ndarray, *, nu: np.ndarray, log_gamma: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the log level and its degrees of freedom (1, F) from the roughness (F,) alone, with nu
    degrees of freedom.

    The level of G, gamma times that of the residual, has a small slope. At the ends of the band
    windows are one-sided: the slope over three neighbouring windows, with its prior, extrapolates
    the level.
    """
    rough = rough + TINY
    if rough.size < FEW_LINES:  # one window, or two that overlap, do not show a slope
        return np.log(rough)[None], nu[None]
    x, F = _roughness_positions(index), rough.size
    width = index.excited_windows.shape[1]
    k = np.arange(F)
    three = np.clip(k + width * np.array([[-1], [0], [1]]), 0, F - 1)
    at = x[1].take(three) - x[1] + x[0].take(three)  # positions of their centres from this line
    logs = (np.log(rough) + log_gamma).take(three)
    centre, mean = np.add.reduce(at) / 3, np.add.reduce(logs) / 3
    precision = nu * np.add.reduce((at - centre) ** 2) + 1.0
    slope = nu * np.add.reduce((at - centre) * (logs - mean)) / precision
    return (np.log(rough) - slope * x[0])[None], widened_dof(nu, x[0] ** 2 / precision)[None]


@lru_cache(maxsize=N_CACHED_GRIDS)
def window_coordinates(index: LineIndex, M: int) -> _WindowCoordinates:
    """Return the coordinates and normal equations of a grid, for M realisations."""
    lines = index.lines[index.excited].astype(float)
    near = index.odd_windows.T
    n, F = near.shape
    x = _slope_coordinate(index.detection[near].astype(float), lines)
    # the calibration error is a normal effect common to the window: Woodbury's identity includes it
    # in the weights
    common = _CALIBRATION_LOG_VARIANCE * M * M / (1 + _CALIBRATION_LOG_VARIANCE * n * M)
    x_sum = x.sum(axis=0)
    one = np.full(F, n * M - common * n * n)
    cross, two = (M - common * n) * x_sum, M * (x * x).sum(axis=0) - common * x_sum * x_sum + 1.0
    covariance = np.array([two, -cross, one]) / (one * two - cross * cross)
    several = min(EVIDENCE_LINES, F)
    around = np.sort(
        near.T[_centred_windows(F, several)[:, None] + np.arange(several)].reshape(F, -1), axis=1
    )
    distinct = (1 + np.count_nonzero(around[:, 1:] != around[:, :-1], axis=1)) / n
    return _WindowCoordinates(
        x=x,
        x_rough=_roughness_positions(index)[0],
        common=common,
        x_common=common * x_sum,
        n_lines=n * M - common * n * n,
        covariance=covariance,
        dof=widened_dof(one, covariance[0] - 1 / one),
        n_distinct=distinct,
    )


@lru_cache(maxsize=N_CACHED_GRIDS)
def roughness_update(
    index: LineIndex, M: int, dof_rough: bytes
) -> tuple[Callable[[np.ndarray], np.ndarray], np.ndarray, np.ndarray]:
    """Return the data-independent part of an update by roughnesses with degrees of freedom (F,),
    given as bytes.

    Returns
    -------
    density : callable
        Log density of the log ratio of the roughness to the level that detection lines predict for
        it.
    gain : (F,) ndarray
        Share of their difference that is added to the level.
    dof : (F,) ndarray
        Degrees of freedom of the updated level.
    """
    nu, windows = np.frombuffer(dof_rough), window_coordinates(index, M)
    x, (var_level, cov_slope, var_slope) = windows.x_rough, windows.covariance
    var_here = var_level + 2 * x * cov_slope + x * x * var_slope
    cov_here = var_level + x * cov_slope
    gain = cov_here / (var_here + 1 / nu)
    # two chi-squares pool by their line counts; the uncertainty of the slope is added
    by_count = 1 / (windows.n_lines + nu)
    return (
        log_density_of_ratio(nu, 1 / var_here),
        gain,
        widened_dof(1 / by_count, var_level - gain * cov_here - by_count),
    )


@lru_cache(maxsize=N_CACHED_GRIDS)
def _roughness_positions(index: LineIndex) -> np.ndarray:
    """Return (2, F) coordinates: mean of a roughness window from its line, and each line from the
    first one.
    """
    lines = index.lines[index.excited].astype(float)
    around = _slope_coordinate(lines[index.excited_windows.T], lines)
    positions = np.array([around.mean(axis=0), _slope_coordinate(lines, lines[:1])])
    positions.flags.writeable = False
    return positions


def _slope_coordinate(at: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Return the signed distance between lines, in standard deviations of the change of the log
    level.
    """
    by_frequency = _SLOPE_PER_LOG_FREQUENCY * np.log((at + _LOWEST_LINES) / (line + _LOWEST_LINES))
    by_line = _SLOPE_PER_LINE * (at - line)
    return np.asarray(np.copysign(np.hypot(by_frequency, by_line), at - line))


def windowed_mean(x: np.ndarray, n: int) -> np.ndarray:
    """Return the mean over n neighbours of each entry along the last axis; at the ends over the
    first or last n.
    """
    size = x.shape[-1]
    n = min(n, size)
    sums = np.zeros((*x.shape[:-1], size + 1))
    np.add.accumulate(x, axis=-1, out=sums[..., 1:])
    means = (sums[..., n:] - sums[..., :-n]) / n
    return means.take(_centred_windows(size, n), axis=-1)


@lru_cache(maxsize=N_CACHED_GRIDS)
def _centred_windows(size: int, n: int) -> np.ndarray:
    """Return for each of `size` entries the first index of the window of n entries most nearly
    centred on it.
    """
    return np.clip(np.arange(size) - n // 2, 0, size - n)
