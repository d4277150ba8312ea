"""The variance of one realisation's FRF about the BLA: one statistical model of stochastic nonlinear distortion.

The guide derives it on one page (docs/guide/distortion.md). On an odd line j the distortion Y_S is complex normal with

    E|Y_S(j)|^2 = lambda g(j) c(j),        log lambda locally linear over frequency.

Six hypotheses, equal before the data. Its *place*: g = |G|^2 (before the dynamics) or 1 (behind them). Its *law*: c is
what a cubic of the input makes of line j, what a cubic of the output makes of it, or 1 (saturation, jump, friction).
The data are the powers on the nearest detection lines, the roughness of the FRF over its excited lines (Pintelon &
Schoukens, 7.2.2), and the scatter over realisations. Each is a scaled chi-square. So the posterior of the variance is
a mixture of scaled inverse chi-squares, and the error of G over it one of scaled F(2, 2 nu).

Functions work on arrays whose last axis is that of the excited lines, (F,). Hypotheses (H,) stand along the first axis,
the lines of a window (n,) along the second.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np

from nlfrf._base.arguments import data_warning
from nlfrf._base.numbers import TINY, mean_power, rms
from nlfrf._base.values import value
from nlfrf.bla.calibration import FEW, LARGEST, cubic_variance, variance_ratio
from nlfrf.bla.frf import Frf
from nlfrf.bla.localfit import LEAST, LocalFit, fit_locally, is_flat
from nlfrf.bla.neighbours import KEPT, Places
from nlfrf.bla.residual import NonlinearResidual
from nlfrf.bla.spectra import Spectra
from nlfrf.signals.lines import LineGrid

__all__ = [
    "DistortionVariance",
    "choose_source",
    "estimate_distortion_variance",
    "fit_each",
    "match_scaled_f",
    "smooth_frf",
    "variance_from_detection_lines",
]


#: Variance of the log of a calibration c about the truth: 1.1 dB, as measured over the plants of benchmarks/plants.py.
CALIBRATION_LOG_VARIANCE = 0.06
#: The level is log-linear in a coordinate in which the prior of its slope is standard normal: lambda may change as
#: f^+-1 (a hysteresis has f^-1 to f^-2) and by 5 % a line. Below four lines the logarithm of frequency is cut off: a
#: level does not grow without end towards zero frequency. Halving either changes the loss by less than 0.5 %.
SLOPE_PER_LOG_FREQUENCY, SLOPE_PER_LINE, LOWEST_LINES = 1.0, 0.05, 4.0
EVIDENCE_LINES = 9  # excited lines around each whose likelihoods weigh the hypotheses; 7 to 13 lose as much
#: Roughness is distortion, or G bends within its window: equal before the data. A bend shows anything from the level to
#: e^7 above it, with equal density in dB. Half or twice that range changes the loss by 0.5 %.
BEND_RANGE = 7.0
ROUGHNESS_EVIDENCE = 2.0  # independent roughnesses in nine neighbouring windows, which overlap
#: One realisation in five cases has a level that is not that of the scatter, by a log-variance of 2 (6 dB): the weight
#: with which scatter over realisations stands by itself.
UNRELATED, UNRELATED_LOG_VARIANCE = 0.2, 2.0
LEAST_COUNT = 0.1  # of the mean of a cubic's counts over a window: other orders fill the lines that a cubic leaves
#: What the cubic of an output makes of the excited line at three times a light resonance, over its mean on the window.
#: Of an input it is `LARGEST`, as a special-odd grid reaches 3 (4.77 dB) in a narrow band.
HARMONIC = 12.0
COARSEST_SHAPE = 30.0  # of a roughness window over its own line: beyond it lines far below others tell nothing
STEPS = 2  # of scoring; a third changes the radius by 0.2 % in the median, by 6 % on one line of a hundred
ENOUGH = 7  # realisations whose scatter tells more than the roughness, which may read too high
MANY = 20  # lines over which roughness shows most of the distortion
TAILS = (math.log(0.05), math.log(0.001))  # where the scaled F that stands for the mixture has its quantiles
STEPS_OF_TAILS = 3, 2  # of Newton's method; more change no radius by 1e-4


@value(copy=False)
class DistortionVariance:
    """Variance of one realisation's FRF by everything but its BLA.

    Fields
    ------
    variance : (F,) ndarray
        Its expectation at each excited line, noise included, averaged over realisations.
    var_bound, dof : (F,) ndarray
        The scaled F(2, 2 dof) of |G - G_BLA|^2 / var_bound, G the mean over realisations: its 95 and 99.9 % quantiles
        are those of the mixture.
    grid_factor : (F,) ndarray
        c at the excited line over its mean on the detection lines, averaged over the hypotheses.
    even : (F,) ndarray
        The variance that the even lines show, noise included; nan without them.
    detected : (F,) ndarray
        The variance that the odd detection lines show by themselves, noise included; nan without them.
    """

    variance: np.ndarray
    var_bound: np.ndarray
    dof: np.ndarray
    grid_factor: np.ndarray
    even: np.ndarray
    detected: np.ndarray

    def at_least(self, power: np.ndarray) -> DistortionVariance:
        """The same with a variance of at least some power (F,)."""
        if not power.any():
            return self
        variance, var_bound = np.maximum(self.variance, power), np.maximum(self.var_bound, power)
        return replace(self, variance=variance, var_bound=var_bound)


@value(copy=False)
class Windows:
    """The coordinates of a grid for the log-linear fit, and its normal equations, which no record changes.

    Fields
    ------
    x : (n, F) ndarray
        Position of each detection line of a window from its excited line, in standard deviations of the slope.
    x_rough : (F,) ndarray
        Mean position of the excited lines of a roughness window.
    x_sum : (F,) ndarray
        Sum of x over the window.
    common : float
        Weight of the calibration error that the lines of a window share.
    information : (3, F) ndarray
        The matrix of the normal equations: level, level and slope, slope with its prior.
    covariance : (3, F) ndarray
        Its inverse.
    dof : (F,) ndarray
        Degrees of freedom of the level.
    n_distinct : (F,) ndarray
        Detection lines in the windows of nine neighbouring excited lines, over the length of one window.
    """

    x: np.ndarray
    x_rough: np.ndarray
    x_sum: np.ndarray
    common: float
    information: np.ndarray
    covariance: np.ndarray
    dof: np.ndarray
    n_distinct: np.ndarray


def estimate_distortion_variance(
    source: str, excited: Spectra, residual: NonlinearResidual, frf: Frf, fit: LocalFit | None, coherent: float
) -> DistortionVariance:
    """Estimate the variance of the FRF and the distribution of its error.

    Parameters
    ----------
    source : str
        "detection", "roughness" or "realizations", see `choose_source`.
    excited : Spectra
        On the excited lines.
    residual : NonlinearResidual
        What the linear model leaves of the output on all lines.
    frf : Frf
    fit : LocalFit or None
        Of each realisation, for the roughness; None where it is not used.
    coherent : float
        Distortion that is one gain on all lines, over what scatters about it (`crest_correction`): no data show it.
    """
    M, even = len(excited.U), even_variance(excited, residual)
    ones, detected = np.ones(even.size), np.full(even.size, np.nan)
    if source == "detection":
        log_level, dof, log_weight, factors, detected = from_detection_lines(excited, residual, fit)
    elif fit is not None:
        log_level, dof = from_roughness(excited.where, fit)
        log_weight, factors = np.zeros(log_level.shape), ones[None]
    else:
        return DistortionVariance(
            variance=np.zeros(even.size),
            var_bound=(1 + coherent) * frf.var_total,
            dof=np.full(even.size, M - 1.0),
            grid_factor=ones,
            even=even,
            detected=detected,
        )
    if M > 1:
        log_level, dof, log_weight = update_by_scatter(
            log_level, dof, log_weight, len(factors), M * frf.var_total, M - 1
        )
    weight, level = normalized(log_weight), np.exp(log_level)
    var_bound, dof = match_scaled_f(level, dof, weight)
    by_hypothesis = np.add.reduce(weight.reshape(-1, len(factors), even.size))
    return DistortionVariance(
        variance=np.add.reduce(weight * level),
        var_bound=(1 + coherent) * var_bound / M,
        dof=dof,
        grid_factor=np.add.reduce(by_hypothesis * factors),
        even=even,
        detected=detected,
    )


def variance_from_detection_lines(excited: Spectra, residual: NonlinearResidual) -> np.ndarray:
    """(F,) expected variance of one realisation's FRF by its detection lines alone, noise included."""
    return from_detection_lines(excited, residual, None)[-1]


def normalized(log_weight: np.ndarray) -> np.ndarray:
    """Weights of sum one over the first axis."""
    weight = np.exp(log_weight - np.maximum.reduce(log_weight))
    return np.asarray(weight / np.add.reduce(weight))


def from_detection_lines(
    excited: Spectra, residual: NonlinearResidual, fit: LocalFit | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Log level, degrees of freedom and log weight (C, F) of every component; c (H, F); and the expected variance (F,).

    Components are the hypotheses, with the roughness as distortion and then as a bend of G.
    """
    where, M = excited.where, len(excited.U)
    windows = windows_of(where, M)
    before, relative, factors, prior = hypotheses(excited, residual.uneven)
    near, here = where.near_detection[:, 0], where.excited
    gain = residual.gain.take(near) / residual.gain.take(here)
    shape = np.where(before[:, None, None], gain, 1.0) * relative
    # expected |Y_S|^2 on the excited lines but for a constant: how a roughness window spreads
    spread = np.where(before[:, None], residual.gain.take(here), 1.0) * np.ones(factors.shape)
    power = mean_power(residual.Y).take(near) + TINY
    noise = residual.noise_known()
    if noise is None:
        shape /= factors[:, None]
    else:
        total = expected_total(power, noise.take(near), shape, factors, noise.take(here))
        shape, spread = total
    square = excited.amplitude**2
    log_level, slope, likelihood = fit_log_level(power / (shape * square), np.log(shape), windows, M)
    evidence = mean_around(likelihood, EVIDENCE_LINES) * windows.n_distinct + prior[:, None]
    zeros = np.zeros(log_level.shape)
    detected = np.asarray(np.add.reduce(normalized(evidence) * np.exp(log_level)))
    if fit is None:
        return log_level, windows.dof + zeros, evidence, factors, detected
    # the roughness, as a datum of nu complex degrees of freedom at x_rough
    x, nu = windows.x_rough, np.add.reduce(fit.dof)
    var_level, cov_slope, var_slope = windows.covariance
    rough = np.add.reduce(fit.variance) / M + TINY
    spread = spread / square
    window = np.maximum(
        np.add.reduce(spread.take(where.near_excited.T, axis=1), axis=1) / len(where.near_excited.T), TINY
    )
    over = np.clip(window / np.maximum(spread, TINY), 1.0, COARSEST_SHAPE)
    ratio = np.log(rough / over) - log_level - slope * x
    var_here, cov_here = var_level + 2 * x * cov_slope + x * x * var_slope, var_level + x * cov_slope
    as_distortion = log_density_of_ratio(ratio, nu, 1 / var_here)
    as_bend = np.minimum(nu * ratio, 0.0) - math.log(BEND_RANGE)
    both = mean_around(np.stack([as_distortion, as_bend]), EVIDENCE_LINES) * ROUGHNESS_EVIDENCE
    gain = cov_here / (var_here + 1 / nu)
    pooled = log_level + np.log(np.maximum(1 + gain * np.expm1(np.minimum(ratio, 50.0)), LEAST_COUNT**2))
    # by the line count alone two chi-squares are pooled; what the slope leaves open comes on top
    by_count = 1 / (windows.information[0] + nu)
    dof = widened_dof(1 / by_count, var_level - gain * cov_here - by_count)
    return (
        np.concatenate([pooled, log_level]),
        np.concatenate([dof + zeros, windows.dof + zeros]),
        (evidence + both).reshape(-1, log_level.shape[1]),
        factors,
        detected,
    )


def hypotheses(excited: Spectra, uneven: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Whether each of H hypotheses is before the dynamics; its c on the windows (H, n, F) and here (H, F); log priors.

    c is over its mean on the window. Where |G| is even over the band, places and drives are one.
    """
    where = excited.where
    of_input = flat_counts(where) if is_flat(excited.amplitude) else cubic_counts(excited.amplitude, where, LARGEST)
    laws = [of_input]
    if uneven:
        laws.append(cubic_counts(rms(excited.Y), where, HARMONIC))
    n_laws = len(laws) + 1
    relative, factors = np.ones((n_laws, *of_input[0].shape)), np.ones((n_laws, excited.lines.size))
    for i, (on_window, here) in enumerate(laws):
        relative[i], factors[i] = on_window, here
    if not uneven:
        return ~BEFORE[:n_laws], relative, factors, EVEN_PRIOR
    return BEFORE, np.concatenate([relative, relative]), np.concatenate([factors, factors]), NO_PRIOR


BEFORE = np.array([True, True, True, False, False, False])
NO_PRIOR, EVEN_PRIOR = np.zeros(6), np.log([2 / 3, 1 / 3])  # the laws of input and output are one where |G| is even


def cubic_counts(drive: np.ndarray, where: Places, highest: float) -> tuple[np.ndarray, np.ndarray]:
    """c of the cubic of a drive (F,) on the windows (n, F) and on the excited lines (F,), over its mean on the window.

    The latter from 1/3 to `highest`; 3 where the lines of a window hold no combination at all.
    """
    lines, near = where.lines[where.excited], where.near_odd.T
    counts = cubic_variance(drive, lines, np.concatenate([lines, where.detection]))
    on_window = counts[lines.size :].take(near)
    mean = np.add.reduce(on_window) / len(near)
    here = counts[: lines.size]
    # the convolutions are exact to rounding of the largest count; below that a count is noise
    unknown = mean <= 1e-9 * counts.max()
    if unknown.any():
        mean, here = np.where(unknown, 1.0, mean), np.where(unknown, LARGEST, here)
        on_window = np.where(unknown, 1.0, on_window)
    return np.maximum(on_window / mean, LEAST_COUNT), np.minimum(np.maximum(here / mean, 1 / LARGEST), highest)


@lru_cache(maxsize=KEPT)
def flat_counts(where: Places) -> tuple[np.ndarray, np.ndarray]:
    """`cubic_counts` of a flat input, which depend on the grid alone."""
    relative, factors = cubic_counts(np.ones(where.excited.size), where, LARGEST)
    relative.flags.writeable = factors.flags.writeable = False
    return relative, factors


LEAST_POWER = 1e-10  # of the largest expected one in a window


def expected_total(
    power: np.ndarray, noise: np.ndarray, shape: np.ndarray, factors: np.ndarray, noise_here: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Expected power by distortion and noise on the lines of a window (H, n, F) over that at its line, and that (H, F).

    The noise is known from the periods. The distortion d in q_j = d a_j + n_j by maximum likelihood, scoring on
    exponentially distributed powers (n, F); the first step weighs as without noise.
    """
    excess, floor = power - noise, noise + TINY
    d = np.maximum(np.add.reduce(excess / shape, axis=1) / len(power), 0.0)
    for _ in range(STEPS):
        expected = d[:, None] * shape
        expected += floor
        # relative to the largest, as powers of rounding underflow in the square, and some are exactly zero
        expected = np.maximum(expected / np.maximum.reduce(expected, axis=1)[:, None], LEAST_POWER)
        weighted = shape / (expected * expected)
        d = np.maximum(np.add.reduce(weighted * excess, axis=1) / np.add.reduce(weighted * shape, axis=1), 0.0)
    expected = d[:, None] * shape
    expected += floor
    total = d * factors + noise_here + TINY
    return expected / total[:, None], total


def fit_log_level(
    y: np.ndarray, log_shape: np.ndarray, windows: Windows, M: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Log level at each line, its slope and the log likelihood of the window (H, F), of whitened powers y (H, n, F).

    Gamma likelihood of M degrees of freedom a line, log-linear mean, standard normal prior of the slope, a calibration
    error common to the window: scoring, whose information matrix does not depend on the data.
    """
    x, n = windows.x, len(windows.x)
    one, cross, two = windows.information
    determinant = one * two - cross * cross
    common, x_sum = windows.common, windows.x_sum
    mean = np.add.reduce(y, axis=1) / n
    level, slope = np.log(mean), np.zeros(mean.shape)
    rest = y / mean[:, None]
    for step in range(STEPS):
        if step:
            rest = y * np.exp(-(level[:, None] + slope[:, None] * x))
        rest -= 1
        sum_rest = np.add.reduce(rest, axis=1)
        by_level = (M - common * n) * sum_rest
        by_slope = M * np.add.reduce(rest * x, axis=1) - common * x_sum * sum_rest - slope
        # steps of at most 1.5: a single line far above the others would throw the first one
        level += np.clip((two * by_level - cross * by_slope) / determinant, -1.5, 1.5)
        slope += np.clip((one * by_slope - cross * by_level) / determinant, -1.5, 1.5)
    expected = level[:, None] + slope[:, None] * x
    relative = np.add.reduce(y * np.exp(-expected), axis=1)
    likelihood = -M * (np.add.reduce(log_shape + expected, axis=1) + relative)
    return level, slope, likelihood - slope * slope / 2 + common / 2 * (relative - n) ** 2


def from_roughness(where: Places, fit: LocalFit) -> tuple[np.ndarray, np.ndarray]:
    """Log level and its degrees of freedom (1, F) from the roughness alone.

    At the ends of the band windows lie to one side of their lines: the slope over three windows side by side, with its
    prior, takes the level there.
    """
    M = len(fit.variance)
    rough, nu = np.add.reduce(fit.variance) / M + TINY, np.add.reduce(fit.dof).astype(float)
    if rough.size < FEW:  # one window, or two that overlap, tell no slope
        return np.log(rough)[None], nu[None]
    x, F = rough_positions(where), rough.size
    width = where.near_excited.shape[1]
    k = np.arange(F)
    three = np.clip(k + width * np.array([[-1], [0], [1]]), 0, F - 1)
    at = x[1].take(three) - x[1] + x[0].take(three)  # positions of their centres from this line
    logs = np.log(rough).take(three)
    centre, mean = np.add.reduce(at) / 3, np.add.reduce(logs) / 3
    precision = nu * np.add.reduce((at - centre) ** 2) + 1.0
    slope = nu * np.add.reduce((at - centre) * (logs - mean)) / precision
    return (np.log(rough) - slope * x[0])[None], widened_dof(nu, x[0] ** 2 / precision)[None]


def update_by_scatter(
    log_level: np.ndarray, dof: np.ndarray, log_weight: np.ndarray, n_hypotheses: int, scatter: np.ndarray, nu: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Update the components (C, F) by the scatter over realisations (F,), of nu complex degrees of freedom.

    One component more for each hypothesis: a level that tells little about the scatter.
    """
    alone = np.logaddexp.reduce(log_weight.reshape(-1, n_hypotheses, scatter.size))  # whatever the roughness is
    level = np.concatenate([log_level, log_level[-n_hypotheses:]])
    dof = np.concatenate([dof, widened_dof(dof[-n_hypotheses:], UNRELATED_LOG_VARIANCE)])
    weight = np.concatenate([log_weight + math.log(1 - UNRELATED), alone + math.log(UNRELATED)])
    ratio = np.minimum(np.log(scatter + TINY) - level, 500.0)
    n_lines = min(EVIDENCE_LINES, scatter.size)
    weight = weight + n_lines * mean_around(log_density_of_ratio(ratio, float(nu), dof), EVIDENCE_LINES)
    return level + np.log((dof + nu * np.exp(ratio)) / (dof + nu)), dof + nu, weight


def widened_dof(dof: np.ndarray, log_variance: np.ndarray | float) -> np.ndarray:
    """Degrees of freedom of an inverse chi-square whose log has some variance more.

    The variance of the log is trigamma(nu), 1/nu + 1/(2 nu^2) but for a third of 1/(2 nu^3).

    Examples
    --------
    >>> widened_dof(np.array([6.0, 6.0]), np.array([0.0, 1.0])).round(2)
    array([6. , 1.2])
    """
    variance = (1 + 0.5 / dof) / dof + np.maximum(log_variance, 0.0)
    return np.asarray((1 + np.sqrt(1 + 2 * variance)) / (2 * variance))


def match_scaled_f(level: np.ndarray, dof: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Scale and degrees of freedom (F,) of the scaled F(2, 2 nu) that stands for a mixture of them (C, F).

    Both have the same quantiles at 95 % and, as all lines together ask for, at 99.9 %: the r with
    sum_h w_h (1 + r^2 / (nu_h s_h^2))^(-nu_h) = 1 - p, by Newton's method in log r from the mean of their quantiles.

    Examples
    --------
    A mixture of one component is that component.

    >>> scale, dof = match_scaled_f(np.array([[2.0]]), np.array([[6.0]]), np.array([[1.0]]))
    >>> scale.round(3), dof.round(1)
    (array([2.]), array([6.]))
    """
    scale = dof * np.maximum(level, TINY)
    x = np.log(np.add.reduce(weight * scale * np.expm1(-TAILS[0] / dof)))
    quantiles = np.empty((2, x.size))
    for into, tail, steps in zip(quantiles, TAILS, STEPS_OF_TAILS, strict=True):
        for _ in range(steps):
            over = np.exp(x) / scale
            survival = weight * np.exp(-dof * np.log1p(over))
            total = np.add.reduce(survival)
            rate = np.add.reduce(survival * dof * over / (1 + over)) / total
            x = x + np.clip((np.log(total) - tail) / np.maximum(rate, 1e-3), -2.0, 2.0)
        into[:] = x
        x = x + np.log(f_quantile(6.0, TAILS[1]) / f_quantile(6.0, TAILS[0]))
    ratios, dofs = ratio_of_quantiles()
    matched = np.exp(np.interp(quantiles[0] - quantiles[1], ratios, dofs))
    return np.exp(quantiles[0]) / f_quantile(matched, TAILS[0]), matched


def f_quantile(dof: np.ndarray | float, tail: float) -> np.ndarray:
    """Quantile of F(2, 2 dof) at the log of one less its probability."""
    return np.asarray(dof * np.expm1(-tail / np.asarray(dof)))


@lru_cache(maxsize=1)
def ratio_of_quantiles() -> tuple[np.ndarray, np.ndarray]:
    """Log of the 95 % quantile of F(2, 2 nu) over that at 99.9 %, increasing, and log nu, from 0.2 to 1e5."""
    dofs = np.linspace(np.log(0.2), np.log(1e5), 800)
    quantiles = np.log([f_quantile(np.exp(dofs), tail) for tail in TAILS])
    return quantiles[0] - quantiles[1], dofs


def log_density_of_ratio(log_ratio: np.ndarray, nu: np.ndarray | float, dof: np.ndarray) -> np.ndarray:
    """Log density of the log of s1^2 / s2^2 ~ F(2 nu, 2 dof): two estimates of one variance."""
    share = nu / dof
    return np.asarray(
        nu * (log_ratio + np.log(share))
        - (nu + dof) * np.log1p(share * np.exp(np.minimum(log_ratio, 500.0)))
        - log_beta(np.asarray(nu, dtype=float), dof)
    )


def log_beta(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Log of the beta function, by Stirling's series two above each argument: within 1e-5."""

    def log_gamma(x: np.ndarray) -> np.ndarray:
        up = x + 2
        return np.asarray((up - 0.5) * np.log(up) - up + 1 / (12 * up) - 1 / (360 * up**3) - np.log(x * (x + 1)))

    return np.asarray(log_gamma(a) + log_gamma(b) - log_gamma(a + b) + 0.5 * math.log(2 * math.pi))


@lru_cache(maxsize=KEPT)
def windows_of(where: Places, M: int) -> Windows:
    """The coordinates and normal equations of a grid, for M realisations."""
    lines = where.lines[where.excited].astype(float)
    near = where.near_odd.T
    n, F = near.shape
    x = position(where.detection[near].astype(float), lines)
    # the calibration error is a normal effect common to the window: Woodbury's identity takes it out of the weights
    common = CALIBRATION_LOG_VARIANCE * M * M / (1 + CALIBRATION_LOG_VARIANCE * n * M)
    x_sum = x.sum(axis=0)
    information = np.array(
        [
            np.full(F, n * M - common * n * n),
            (M - common * n) * x_sum,
            M * (x * x).sum(axis=0) - common * x_sum * x_sum + 1.0,
        ]
    )
    one, cross, two = information
    covariance = np.array([two, -cross, one]) / (one * two - cross * cross)
    around = np.clip(np.arange(F) - EVIDENCE_LINES // 2, 0, max(F - EVIDENCE_LINES, 0))
    distinct = np.array([np.unique(near[:, first : first + EVIDENCE_LINES]).size / n for first in around])
    windows = Windows(
        x=x,
        x_rough=rough_positions(where)[0],
        x_sum=x_sum,
        common=common,
        information=information,
        covariance=covariance,
        dof=widened_dof(one, covariance[0] - 1 / one),
        n_distinct=distinct,
    )
    for array in (x, x_sum, information, covariance, distinct):
        array.flags.writeable = False
    return windows


@lru_cache(maxsize=KEPT)
def rough_positions(where: Places) -> np.ndarray:
    """(2, F) mean position of a roughness window from its line; and the position of each line from the first."""
    lines = where.lines[where.excited].astype(float)
    around = position(lines[where.near_excited.T], lines)
    positions = np.array([around.mean(axis=0), position(lines, lines[:1])])
    positions.flags.writeable = False
    return positions


def position(at: np.ndarray, line: np.ndarray) -> np.ndarray:
    """How far lines lie from others, in standard deviations of the change of the log level."""
    by_frequency = SLOPE_PER_LOG_FREQUENCY * np.log((at + LOWEST_LINES) / (line + LOWEST_LINES))
    by_line = SLOPE_PER_LINE * (at - line)
    return np.asarray(np.copysign(np.hypot(by_frequency, by_line), at - line))


def mean_around(x: np.ndarray, n: int) -> np.ndarray:
    """Mean over the n neighbours of each entry along the last axis; at the ends over the first n, or the last."""
    size = x.shape[-1]
    n = min(n, size)
    sums = np.zeros((*x.shape[:-1], size + 1))
    np.add.accumulate(x, axis=-1, out=sums[..., 1:])
    means = (sums[..., n:] - sums[..., :-n]) / n
    return means.take(np.arange(-(n // 2), size - n // 2), axis=-1, mode="clip")


def even_variance(excited: Spectra, residual: NonlinearResidual) -> np.ndarray:
    """(F,) what the even lines show, as a variance of one realisation's FRF; nan without them.

    It counts as before the dynamics, with no factor.
    """
    where = excited.where
    if not where.even.size:
        return np.full(excited.lines.size, np.nan)
    near, here = where.near_even[:, 0], where.excited
    power = mean_power(residual.Y).take(near)
    shape = (residual.gain.take(near) / residual.gain.take(here))[None]
    noise = residual.noise_known()
    if noise is not None:
        shape = expected_total(power + TINY, noise.take(near), shape, np.ones((1, here.size)), noise.take(here))[0]
    return np.asarray(np.add.reduce(power / shape[0]) / len(near) / excited.amplitude**2)


def smooth_frf(frf: Frf, excited: Spectra, is_source: bool) -> tuple[np.ndarray, LocalFit | None]:
    """(F,) an FRF to take the linear part off with; and the fit of each realisation where its roughness counts."""
    if not is_source and (excited.lines.size < LEAST or len(excited.U) >= ENOUGH):
        return frf.G, None
    fit = fit_each(frf, excited)
    return np.add.reduce(fit.G) / len(fit.G), fit


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
