"""Variance of the FRF of one realisation about the BLA, by a statistical model of the distortion.

docs/guide/distortion.md derives the model. On an odd line j the distortion Y_S is complex normal
with

    E|Y_S(j)|^2 = lambda g(j) c(j),        log lambda locally linear over frequency.

There are six hypotheses of equal prior weight, from two places and three laws of the nonlinearity.
*Place*: before the dynamics, g = |G|^2; or behind them, g = 1. *Law*: c is the power on line j of a
cubic of the input, or of a cubic of the output, or c = 1 (saturation, jump, friction). The data are
the powers on the nearest detection lines, the scatter of the FRF between excited lines (roughness;
Pintelon & Schoukens, 7.2.2), and the scatter over realisations. Each is a scaled chi-square
variable. So the posterior of the variance is a mixture of scaled inverse chi-squares, and the error
of G has a mixture of scaled F(2, 2 nu) distributions.

Functions work on arrays whose last axis is that of the excited lines, (F,). Hypotheses (H,) are on
the first axis, the lines of a window (n,) on the second.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from nlfrf._base.arguments import data_warning
from nlfrf._base.numbers import TINY, clip, mean_power, rms
from nlfrf.bla.calibration import MAX_SPECIAL_ODD_RATIO, cubic_variance, variance_ratio
from nlfrf.bla.covariance import diagonal, inverse, sum_outer_products, to_correlation
from nlfrf.bla.frf import FrmEstimate
from nlfrf.bla.line_index import N_CACHED_GRIDS, LineIndex
from nlfrf.bla.local_models import MIN_FIT_LINES, LocalFit, fit_locally, is_flat
from nlfrf.bla.log_level import (
    EVIDENCE_LINES,
    expected_total,
    fit_log_level,
    level_from_roughness,
    roughness_update,
    window_coordinates,
    windowed_mean,
)
from nlfrf.bla.residual import NonlinearResidual
from nlfrf.bla.scaled_f import (
    LOG_TAIL_PROBABILITIES,
    f_quantile,
    log_density_of_ratio,
    match_scaled_f,
    widened_dof,
)
from nlfrf.bla.spectra import Spectra
from nlfrf.signals.lines import LineGrid

#: Roughness is distortion, or G bends within its window: equal prior weights. A bend gives any
#: roughness from the level to e^7 above it, with equal density in dB. Half or twice that range
#: changes the loss by 0.5 %.
_BEND_RANGE = 7.0
# number of independent roughnesses in nine neighbouring, overlapping windows
_ROUGHNESS_EVIDENCE = 2.0
#: In one case of five the level from detection lines differs from the scatter by a log-variance of
#: 2 (6 dB): the weight of scatter over realisations by itself.
_UNRELATED, _UNRELATED_LOG_VARIANCE = 0.2, 2.0
#: Least count over the mean of a cubic's counts on a window: other orders fill the lines that a
#: cubic leaves empty.
_MIN_RELATIVE_COUNT = 0.1
#: Largest count for the cubic of an output, over its mean on the window: at the excited line at
#: three times a light resonance. For an input it is `MAX_SPECIAL_ODD_RATIO`: a special-odd grid
#: reaches 3 (4.77 dB) in a narrow band.
_MAX_OUTPUT_RATIO = 12.0
# largest mean over a roughness window by its own line: lines far below carry no information
_MAX_WINDOW_SHAPE = 30.0
# realisations whose scatter is better than the roughness, which may be too high
_ENOUGH_REALIZATIONS = 7
_ENOUGH_ROUGHNESS_LINES = 20  # lines on which roughness contains most of the distortion
#: A factor common to all outputs costs a level degrees of freedom. The law of the matrix gets this
#: share of them back: 0.3 to 0.6 by simulation of two to six outputs, with log-variances of the
#: factor of 0.06 and 0.15.
_COMMON_ERROR = 0.5


class DistortionVariance(NamedTuple):
    """Covariance of the residual of one experiment by everything but the BLA; `FrmEstimate.gamma`
    multiplies it.
    """

    cov: np.ndarray  # (n_y, n_y, F) expectation at each excited line, noise included
    # cov_bound, dof: (n_y, n_y, F) or (F,) on its diagonal the scale of the scaled F(2, 2 dof) for
    # the error of each output's row. Its 95 % quantile, and for one output also that at 99.9 %, are
    # those of the mixture.
    cov_bound: np.ndarray
    dof: np.ndarray
    # (F,) c at the excited line over its mean on the detection lines, averaged over hypotheses and
    # outputs
    grid_factor: np.ndarray
    # (n_y, n_y, F) covariance on the even lines, noise included; nan without them
    cov_even: np.ndarray
    # (n_y, F) variance from the odd detection lines alone, noise included; nan without them
    detected: np.ndarray

    def with_minimum(self, power: np.ndarray) -> DistortionVariance:
        """Return the covariances with each diagonal raised to at least `power` (n_y, F)."""
        if not power.any():
            return self
        cov, cov_bound = self.cov.copy(), self.cov_bound.copy()
        for one in (cov, cov_bound):
            for j, least in enumerate(power):
                one[j, j] = np.maximum(one[j, j].real, least)
        return self._replace(cov=cov, cov_bound=cov_bound)


class _OutputVariance(NamedTuple):
    """Distortion of one output, as variances (F,)."""

    # variance, var_bound, dof, grid_factor, detected: (F,) as in `DistortionVariance`
    variance: np.ndarray
    var_bound: np.ndarray
    dof: np.ndarray
    grid_factor: np.ndarray
    detected: np.ndarray
    # (F,) probability that the roughness is distortion; otherwise G bends
    rough_is_distortion: np.ndarray


class _OutputData(NamedTuple):
    """The data of one output."""

    power: np.ndarray  # (K,) mean |Y - G U|^2 over experiments, on all lines
    Y: np.ndarray  # (M, F) complex the output on the excited lines
    # gain, noise: (K,) as in `NonlinearResidual`; the noise averaged over neighbouring lines, or
    # None
    gain: np.ndarray
    noise: np.ndarray | None
    gain_varies: bool  # whether the gain changes over the band
    # rough, dof_rough: (F,) roughness of its FRFs as a variance of the residual, and its complex
    # degrees of freedom
    rough: np.ndarray | None
    dof_rough: np.ndarray | None
    scatter: np.ndarray  # (F,) variance of the residual from the scatter over sets


def estimate_distortion_variance(
    source: str,
    excited: Spectra,
    *,
    residual: NonlinearResidual,
    frm: FrmEstimate,
    fit: LocalFit | None,
    coherent: float,
    n_independent: int,
) -> DistortionVariance:
    """Estimate the covariance of the residual of one experiment, and the distribution of the error
    that it causes.

    The model holds for the row of each output. The correlation of the rows comes from the same
    data: detection lines, roughness as far as it is distortion, scatter over sets, weighted by
    their degrees of freedom.

    Parameters
    ----------
    source : str
        "detection", "roughness" or "realizations", see `choose_source`.
    excited : Spectra
        Spectra on the excited lines.
    residual : NonlinearResidual
        Nonlinear residual on all lines.
    frm : FrmEstimate
    fit : LocalFit or None
        Local fit of each set, for the roughness; None if unused.
    coherent : float
        Distortion that is one gain on all lines, over the scatter about it (`crest_correction`): no
        data show it.
    n_independent : int
        Number of experiments with their own phases, whose detection lines count.
    """
    n_y, R = len(residual.Y), len(frm.G_each)
    nu = excited.experiments_per_set * (R - 1)
    rows = [
        _collect_output_data(j, excited, residual=residual, frm=frm, fit=fit) for j in range(n_y)
    ]
    found = [
        _estimate_output_variance(source, excited, row=row, frm=frm, M=n_independent, nu=nu)
        for row in rows
    ]
    even = np.array([_variance_on_even_lines(excited.index, row) * frm.level_scale for row in rows])
    dof, scale = found[0].dof, np.array([one.var_bound for one in found])
    rho: np.ndarray | float = 1.0
    rho_even: np.ndarray | float = 1.0
    if n_y > 1:
        rho, count = _pool_correlations(
            source,
            excited.index,
            residual=residual,
            frm=frm,
            fit=fit,
            found=found,
            M=n_independent,
            nu=nu,
        )
        if excited.index.even.size:
            rho_even = _correlation_on_lines(excited.index.even_windows[:, 0], residual)
        else:
            rho_even = 1.0
        dof, scale = _pool_dof(found, count)
    return DistortionVariance(
        cov=_scale_correlation(np.array([one.variance for one in found]), rho),
        cov_bound=(1 + coherent) * _scale_correlation(scale, rho),
        dof=dof,
        grid_factor=np.add.reduce([one.grid_factor for one in found]) / n_y,
        cov_even=_scale_correlation(even, rho_even),
        detected=np.array([one.detected for one in found]),
    )


def _collect_output_data(
    j: int, excited: Spectra, *, residual: NonlinearResidual, frm: FrmEstimate, fit: LocalFit | None
) -> _OutputData:
    rough = dof_rough = None
    if fit is not None:
        n = fit.variance[:, j, :, 0].size
        rough = np.add.reduce(fit.variance[:, j] / frm.gamma_of_set, axis=(0, 1)) / n
        dof_rough = np.add.reduce(fit.dof[:, j], axis=(0, 1))
    return _OutputData(
        power=mean_power(residual.Y[j]),
        Y=excited.Y[j],
        gain=residual.gain[j],
        noise=residual.smoothed_noise(j),
        gain_varies=residual.gain_varies[j],
        rough=rough,
        dof_rough=dof_rough,
        scatter=frm.cov_scatter[j, j].real,
    )


def _estimate_output_variance(
    source: str, excited: Spectra, *, row: _OutputData, frm: FrmEstimate, M: int, nu: int
) -> _OutputVariance:
    """Estimate the variance of an output, from M independent experiments and a scatter of nu
    degrees of freedom.
    """
    F = excited.lines.size
    ones, detected = np.ones(F), np.full(F, np.nan)
    if source == "detection":
        log_level, dof, log_weight, factors, detected = _level_from_detection_lines(
            excited, row, level_scale=frm.level_scale, M=M
        )
    elif row.rough is not None and row.dof_rough is not None:
        log_gamma = np.add.reduce(np.log(frm.gamma_of_set)) / len(frm.gamma)
        log_level, dof = level_from_roughness(
            excited.index, row.rough, nu=row.dof_rough, log_gamma=log_gamma
        )
        log_weight, factors = np.zeros(log_level.shape), ones[None]
    else:
        return _OutputVariance(
            variance=row.scatter,
            var_bound=row.scatter,
            dof=np.full(F, float(nu)),
            grid_factor=ones,
            detected=detected,
            rough_is_distortion=0 * ones,
        )
    n_as_distortion = len(log_level) - len(factors)
    if nu:
        log_level, dof, log_weight = update_by_scatter(
            log_level,
            dof,
            log_weight=log_weight,
            n_hypotheses=len(factors),
            scatter=row.scatter,
            nu=nu,
        )
    weight, level = _normalize_weights(log_weight), np.exp(log_level)
    var_bound, dof = match_scaled_f(level, dof, weight)
    by_hypothesis = np.add.reduce(weight.reshape(-1, len(factors), F))
    return _OutputVariance(
        variance=row.scatter if nu else np.add.reduce(weight * level),
        var_bound=var_bound,
        dof=dof,
        grid_factor=np.add.reduce(by_hypothesis * factors),
        detected=detected,
        rough_is_distortion=(
            np.add.reduce(weight[:n_as_distortion]) if source == "detection" else ones
        ),
    )


def variance_from_detection_lines(
    excited: Spectra, residual: NonlinearResidual, frm: FrmEstimate
) -> np.ndarray:
    """Return the (F,) expected variance of the first output's residual from detection lines alone,
    noise included.
    """
    row = _collect_output_data(0, excited, residual=residual, frm=frm, fit=None)
    return _level_from_detection_lines(
        excited, row, level_scale=frm.level_scale, M=excited.U.shape[1]
    )[-1]


def _scale_correlation(variance: np.ndarray, rho: np.ndarray | float) -> np.ndarray:
    """Return the (n, n, F) covariance with variances (n, F) and a correlation (n, n, F)."""
    if len(variance) == 1:
        return variance[None]
    size = np.sqrt(variance)
    return np.asarray(size[:, None] * size * rho)


def _pool_correlations(
    source: str,
    index: LineIndex,
    *,
    residual: NonlinearResidual,
    frm: FrmEstimate,
    fit: LocalFit | None,
    found: list[_OutputVariance],
    M: int,
    nu: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the correlation (n_y, n_y, F) of the outputs, and its complex degrees of freedom (F,).

    It averages the correlations on detection lines, of the roughness and of the scatter, weighted
    by their degrees of freedom.
    """
    parts: list[tuple[np.ndarray, np.ndarray | float]] = []
    if source == "detection":
        near = index.detection_windows[:, 0]
        parts.append((_correlation_on_lines(near, residual), float(M * len(near))))
    if fit is not None and fit.residual is not None:
        share = np.add.reduce([one.rough_is_distortion for one in found]) / len(found)
        parts.append(
            (
                _correlation_of_roughness(fit.residual, frm),
                share * np.add.reduce(fit.dof[:, 0], axis=(0, 1)),
            )
        )
    if nu:
        parts.append((to_correlation(frm.cov_scatter)[0], float(nu)))
    total = np.add.reduce([np.zeros(index.excited.size) + n for _, n in parts])
    return np.asarray(np.add.reduce([rho * n for rho, n in parts]) / total), total


def _correlation_on_lines(near: np.ndarray, residual: NonlinearResidual) -> np.ndarray:
    """Return the (n_y, n_y, F) correlation of the residuals on windows of lines (n, F), each line
    over its gain.
    """
    x = residual.Y.take(near, axis=-1) / np.sqrt(residual.gain.take(near, axis=-1) + TINY)[:, None]
    return to_correlation(sum_outer_products(x))[0]


def _correlation_of_roughness(rest: np.ndarray, frm: FrmEstimate) -> np.ndarray:
    """Return the (n_y, n_y, F) correlation e N^-1 e^H of the residuals e of local fits, N that of
    inputs in gamma.
    """
    inverted = inverse(to_correlation(frm.gamma_each)[0])
    weighted = np.einsum("rjifn,rilf->rjlfn", rest, inverted)
    return to_correlation(np.einsum("rjlfn,rklfn->jkf", weighted, rest.conj()))[0]


def _pool_dof(found: list[_OutputVariance], count: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return degrees of freedom (F,) for all rows, and scales (n_y, F) that keep the 95 % quantile
    of each row.

    The calibration error is one factor for all outputs. It widens the distribution of the matrix as
    that of an entry, and less than the same loss of degrees of freedom would.
    """
    n_y = len(found)
    own = n_y / np.add.reduce([1 / one.dof for one in found])
    dof = own + _COMMON_ERROR * np.maximum(count - own, 0.0)
    return dof, np.array(
        [one.var_bound * f_quantile(one.dof, LOG_TAIL_PROBABILITIES[0]) for one in found]
    ) / f_quantile(dof, LOG_TAIL_PROBABILITIES[0])


def _normalize_weights(log_weight: np.ndarray) -> np.ndarray:
    """Return weights with sum one over the first axis."""
    weight = np.exp(log_weight - np.maximum.reduce(log_weight))
    return np.asarray(weight / np.add.reduce(weight))


def _level_from_detection_lines(
    excited: Spectra, row: _OutputData, *, level_scale: np.ndarray | float, M: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Fit the log level under every hypothesis to the detection lines, and update it by the
    roughness if known.

    The components are the H hypotheses, with the roughness as distortion and then, if C = 2 H, as a
    bend of G.

    Returns
    -------
    log_level, dof, log_weight : (C, F) ndarray
        Log variance, degrees of freedom and log weight of each component.
    factors : (H, F) ndarray
        c at the excited line over its mean on the window.
    detected : (F,) ndarray
        Expected variance from the detection lines alone.
    """
    index = excited.index
    windows = window_coordinates(index, M)
    before, relative, factors, prior = _list_hypotheses(excited, row)
    near, here = index.detection_windows[:, 0], index.excited
    gain = row.gain.take(near) / row.gain.take(here)
    shape = np.where(before[:, None, None], gain, 1.0) * relative
    power = row.power.take(near) + TINY
    if row.noise is None:
        shape /= factors[:, None]
    else:
        shape, total = expected_total(
            power,
            row.noise.take(near),
            shape=shape,
            factors=factors,
            noise_here=row.noise.take(here),
        )
    log_level, slope, likelihood = fit_log_level(
        power * level_scale / shape, np.log(shape), windows=windows, M=M
    )
    evidence = windowed_mean(likelihood, EVIDENCE_LINES) * windows.n_distinct + prior[:, None]
    zeros = np.zeros(log_level.shape)
    detected = np.asarray(np.add.reduce(_normalize_weights(evidence) * np.exp(log_level)))
    if row.rough is None or row.dof_rough is None:
        return log_level, windows.dof + zeros, evidence, factors, detected
    density, share, dof = roughness_update(index, M, row.dof_rough.tobytes())
    nu, rough = row.dof_rough, row.rough + TINY
    # one level over the whole window: estimated levels of its lines would scatter with the data
    # they are compared with
    over = _mean_over_window(np.where(before[:, None], row.gain.take(here), 1.0), excited)
    if row.noise is not None:
        noise = row.noise.take(here)
        over = over + noise / total * (_mean_over_window(noise, excited) - over)
    over = clip(over, 1.0, _MAX_WINDOW_SHAPE)
    ratio = np.log(rough / over) - log_level - slope * windows.x_rough
    both = np.empty((2, *ratio.shape))
    both[0] = density(ratio)  # as distortion
    np.subtract(np.minimum(nu * ratio, 0.0), math.log(_BEND_RANGE), out=both[1])  # as a bend
    both = windowed_mean(both, EVIDENCE_LINES) * _ROUGHNESS_EVIDENCE
    pooled = np.maximum(1 + share * np.expm1(np.minimum(ratio, 50.0)), _MIN_RELATIVE_COUNT**2)
    return (
        np.concatenate([log_level + np.log(pooled), log_level]),
        np.concatenate([dof + zeros, windows.dof + zeros]),
        (evidence + both).reshape(-1, log_level.shape[1]),
        factors,
        detected,
    )


def _mean_over_window(variance: np.ndarray, excited: Spectra) -> np.ndarray:
    """Return the mean of a variance of Y (..., F) over |U|^2 on each roughness window, over its
    value at the line.
    """
    of_frf = np.maximum(variance / excited.amplitude**2, TINY)
    windows = excited.index.excited_windows.T
    return np.asarray(
        np.add.reduce(of_frf.take(windows, axis=-1), axis=-2) / (len(windows) * of_frf)
    )


def _list_hypotheses(
    excited: Spectra, row: _OutputData
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the H hypotheses of place and law; if |G| is constant over the band, places and
    sources coincide.

    Returns
    -------
    before_dynamics : (H,) bool ndarray
        True if the distortion passes through the dynamics.
    on_window : (H, n, F) ndarray
        c on the lines of each window, over its mean there.
    factors : (H, F) ndarray
        c at the excited line over that mean.
    log_prior : (H,) ndarray
        Log prior probability.
    """
    index = excited.index
    # rms over inputs: a cube of one input and a product of several have its c, within 0.3 dB
    amplitude = excited.amplitude
    flat = is_flat(amplitude)  # its counts depend on the grid alone and are cached
    laws = [
        (
            _flat_input_cubic_counts(index)
            if flat
            else cubic_count_ratios(amplitude, index, MAX_SPECIAL_ODD_RATIO)
        )
    ]
    if row.gain_varies:
        laws.append(cubic_count_ratios(rms(row.Y), index, _MAX_OUTPUT_RATIO))
    n_laws = len(laws) + 1  # and c = 1, whose entries stay one
    relative, factors = np.ones((n_laws, *laws[0][0].shape)), np.ones((n_laws, excited.lines.size))
    for i, (on_window, here) in enumerate(laws):
        relative[i], factors[i] = on_window, here
    if not row.gain_varies:
        # a constant |G| has one place, here behind the dynamics: g = 1
        return ~_BEFORE_DYNAMICS[:n_laws], relative, factors, _CONSTANT_GAIN_LOG_PRIOR
    return (
        _BEFORE_DYNAMICS,
        np.concatenate([relative, relative]),
        np.concatenate([factors, factors]),
        _EQUAL_LOG_PRIOR,
    )


_BEFORE_DYNAMICS = np.array([True, True, True, False, False, False])
#: If |G| is constant over the band, the cubic of the input and that of the output are one law,
#: which gets the weight of both.
_EQUAL_LOG_PRIOR, _CONSTANT_GAIN_LOG_PRIOR = np.zeros(6), np.log([2 / 3, 1 / 3])


def cubic_count_ratios(
    amplitude: np.ndarray, index: LineIndex, highest: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return c for the cubic of a source (F,) on windows (n, F) and at excited lines (F,), over its
    mean on the window.

    The ratio at excited lines is between 1/3 and `highest`, and 3 if the lines of a window get no
    combination.
    """
    lines, near = index.lines[index.excited], index.odd_windows.T
    counts = cubic_variance(amplitude, lines, np.concatenate([lines, index.detection]))
    on_window = counts[lines.size :].take(near)
    mean = np.add.reduce(on_window) / len(near)
    here = counts[: lines.size]
    # the convolutions are exact to rounding of the largest count; below that a count is noise
    unknown = mean <= 1e-9 * counts.max()
    if unknown.any():
        mean, here = np.where(unknown, 1.0, mean), np.where(unknown, MAX_SPECIAL_ODD_RATIO, here)
        on_window = np.where(unknown, 1.0, on_window)
    return np.maximum(on_window / mean, _MIN_RELATIVE_COUNT), np.minimum(
        np.maximum(here / mean, 1 / MAX_SPECIAL_ODD_RATIO), highest
    )


@lru_cache(maxsize=N_CACHED_GRIDS)
def _flat_input_cubic_counts(index: LineIndex) -> tuple[np.ndarray, np.ndarray]:
    """Return `cubic_count_ratios` of a flat input, which depend on the grid alone."""
    relative, factors = cubic_count_ratios(
        np.ones(index.excited.size), index, MAX_SPECIAL_ODD_RATIO
    )
    relative.flags.writeable = factors.flags.writeable = False
    return relative, factors


def update_by_scatter(
    log_level: np.ndarray,
    dof: np.ndarray,
    *,
    log_weight: np.ndarray,
    n_hypotheses: int,
    scatter: np.ndarray,
    nu: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Update the components (C, F) by the scatter over realisations (F,), with nu complex degrees
    of freedom.

    Each hypothesis gets one more component: a level hardly related to the scatter.
    """
    alone = np.logaddexp.reduce(
        log_weight.reshape(-1, n_hypotheses, scatter.size)
    )  # whatever the roughness is
    level = np.concatenate([log_level, log_level[-n_hypotheses:]])
    dof = np.concatenate([dof, widened_dof(dof[-n_hypotheses:], _UNRELATED_LOG_VARIANCE)])
    weight = np.concatenate([log_weight + math.log(1 - _UNRELATED), alone + math.log(_UNRELATED)])
    ratio = np.minimum(np.log(scatter + TINY) - level, 500.0)
    n_lines = min(EVIDENCE_LINES, scatter.size)
    weight = weight + n_lines * windowed_mean(
        log_density_of_ratio(float(nu), dof)(ratio), EVIDENCE_LINES
    )
    return level + np.log((dof + nu * np.exp(ratio)) / (dof + nu)), dof + nu, weight


def _variance_on_even_lines(index: LineIndex, row: _OutputData) -> np.ndarray:
    """Return the (F,) variance of the residual from the even lines; nan without them.

    The distortion is assumed before the dynamics, without a factor.
    """
    if not index.even.size:
        return np.full(index.excited.size, np.nan)
    near, here = index.even_windows[:, 0], index.excited
    power = row.power.take(near)
    shape = (row.gain.take(near) / row.gain.take(here))[None]
    if row.noise is not None:
        ones = np.ones((1, here.size))
        shape = expected_total(
            power + TINY,
            row.noise.take(near),
            shape=shape,
            factors=ones,
            noise_here=row.noise.take(here),
        )[0]
    return np.asarray(np.add.reduce(power / shape[0]) / len(near))


def smooth_frm(
    frm: FrmEstimate, excited: Spectra, is_source: bool
) -> tuple[np.ndarray, LocalFit | None]:
    """Return a smoothed matrix (n_y, n_u, F), and the local fit of each set if its roughness is
    needed.
    """
    if not is_source and (
        excited.lines.size < MIN_FIT_LINES or len(frm.G_each) >= _ENOUGH_REALIZATIONS
    ):
        return frm.G, None
    fit = fit_sets(frm, excited)
    return np.add.reduce(fit.G) / len(fit.G), fit


def fit_sets(frm: FrmEstimate, excited: Spectra) -> LocalFit:
    """Fit the matrix of each set locally over the excited lines; the residual is its roughness."""
    gamma = diagonal(frm.gamma_each)[:, None]
    if np.isfinite(frm.noise_each).all():
        noise = frm.noise_each[:, :, None] * gamma
    else:
        noise = None
    return fit_locally(frm.G_each, 1 / np.sqrt(gamma), index=excited.index, noise=noise)


def choose_source(level_from: str, excited: Spectra, *, grid: LineGrid, n_detection: int) -> str:
    """Choose the source of the distortion variance, and warn if detection lines are not used."""
    if level_from == "detection" and grid.odd.size < n_detection:
        raise ValueError(
            f"lines must hold at least n_detection = {n_detection} odd detection lines for "
            f'level_from="detection", got {grid.odd.size} on this {grid.kind} grid'
        )
    if level_from != "auto":
        return level_from
    if _can_calibrate(excited, grid, n_detection):
        return "detection"
    if excited.U.shape[1] // excited.experiments_per_set >= _ENOUGH_REALIZATIONS:
        return "realizations"
    data_warning(_describe_roughness_choice(grid, n_detection))
    return "roughness"


def _can_calibrate(excited: Spectra, grid: LineGrid, n_detection: int) -> bool:
    """Return whether odd detection lines of this grid give the distortion variance within a known
    factor.
    """
    kind = grid.kind
    if grid.odd.size < n_detection or kind in ("full", "odd", "odd-odd"):
        return False
    if kind in ("special-odd", "random-odd"):
        return True
    if np.any(grid.excited % 2 == 0):
        return False
    ratio = variance_ratio(
        excited.amplitude,
        grid.excited,
        detection=excited.index.detection,
        window=excited.index.odd_windows,
    )
    return bool(np.mean(ratio <= MAX_SPECIAL_ODD_RATIO) >= 0.95)


def _describe_roughness_choice(grid: LineGrid, n_detection: int) -> str:
    """Return the warning that explains why the distortion variance comes from the roughness."""
    kind, n_odd = grid.kind, grid.odd.size
    if kind == "odd-odd":
        reason = (
            "the odd detection lines of an odd-odd grid have less distortion than the excited lines,"
            " at a resonance by any factor"
        )
    elif n_odd == 0:
        reason = f"the {kind} grid of this record has no odd detection lines"
    elif n_odd < n_detection:
        reason = (
            f"the grid of this record has {n_odd} odd detection lines, fewer than n_detection ="
            f" {n_detection}"
        )
    else:
        reason = (
            "the factor from the distortion on detection lines to that on excited lines is unknown"
            f" for this {kind} grid"
        )
    if grid.excited.size < _ENOUGH_ROUGHNESS_LINES:
        few = f"; on {grid.excited.size} lines it may be too low as well"
    else:
        few = ""
    return (
        f"{reason}. So the distortion is estimated from the roughness of the FRF, which is its"
        " scatter between neighbouring lines. The estimate is too high if the FRF itself"
        f" changes within a few lines{few}. Use a special-odd or random-odd multisine to measure"
        " the distortion on detection lines"
    )
