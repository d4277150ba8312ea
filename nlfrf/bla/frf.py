"""The frequency response matrix from all experiments, its covariance due to noise and in total, and
checks of its phases.

    G = Y Z^H (U Z^H)^-1,  Z: references, or the inputs of each set        (Pintelon & Schoukens, 2nd ed., 2.7, 4.3.1)

The phase of a smooth FRF changes by nearly the same angle from line to line at equal distances, for
any delay. If an output is divided by the input of another realisation, the phase changes at random.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from nlfrf._base.arguments import data_warning
from nlfrf._base.numbers import TINY, power, squared_modulus
from nlfrf.bla.calibration import FEW_LINES
from nlfrf.bla.covariance import adjoint, diagonal, inverse, product, sum_outer_products
from nlfrf.bla.line_index import LineIndex
from nlfrf.bla.local_models import LocalFit, leave_one_out_residual
from nlfrf.bla.realizations import pair_equal_steps
from nlfrf.bla.spectra import Spectra, residual_scatter

#: Roughness over the level and over |G|^2 above which, on most lines, u and y do not belong
#: together.
_MAX_ROUGHNESS_OVER_LEVEL, MAX_ROUGHNESS_OVER_GAIN = 2.5, 0.03
#: The same for one output of several experiments: exchanged experiments give 0.3 and more. A
#: correct matrix that bends within a few lines has up to 0.3; an experiment that differs from the
#: others is found before.
MAX_MATRIX_ROUGHNESS_OVER_GAIN = 0.2
_N_SPARE_LINES = 2  # added to half of the lines, because a few lines are rough by chance
_MIN_STEP_PAIRS = 4  # pairs of equal steps that suffice to compare phases
#: Power over that of chance for an outlier line: over the level; over the scatter of its
#: neighbours, which one regular line in 4e5 exceeds; and that of a local fit from which outliers
#: are looked for.
_OUTLIER_OVER_LEVEL, _OUTLIER_OVER_SCATTER, _OUTLIER_CANDIDATE = 25.0, 60.0, 5.0
#: A free mass bends as 1/omega^2 below its third line, which no parabola follows; omega^2 G is
#: smooth there.
_INTEGRATORS = (0, 1, 2)
#: Second line over the first, above which the neighbours do not judge the first: its value would be
#: extrapolated, and the corner of a viscous friction below it turns G by more (the belt preset in
#: motion: 1.5 and 4.5 Hz).
_MAX_FIRST_RATIO = 1.5
_MAINS_FREQUENCIES = 50.0, 60.0  # [Hz]
OUTPUT_ROUNDING = 1e-13  # share of the whole output below which a deviation on a line is rounding
_MAX_CHANCE_SIGMAS = 3.0  # standard deviations up to which phases agree by chance
_CHANCE_MATCH_PROBABILITY = (
    1e-6  # probability that by chance an output follows any input, or changes its sign
)
# pairs of equal steps from which an output that follows no input is warned of
_MIN_WARNING_STEP_PAIRS = 30
_MIN_RELATIVE_SCATTER = 0.5  # least scatter of one realisation with random phases, over |G|^2
_MAX_RELATIVE_NOISE = 0.1  # noise over |G|^2 above which noise may be the cause


class FrmEstimate(NamedTuple):
    """Frequency response matrix on the excited lines, 1 x 1 for one input and one output.

    With W = Z^H (U Z^H)^-1 for instruments Z a residual V = Y - G U of the experiments moves G by
    dG = V W. So Cov(vec G) = conj(gamma) kron C_V with gamma = W^H W and C_V the covariance of ONE
    experiment's residual, noise on the inputs and feedback included.
    """

    # (n_y, n_u, F) complex the matrix: the mean over sets, or with a reference the least-squares
    # solution over all of them
    G: np.ndarray
    G_each: np.ndarray  # (R, n_y, n_u, F) complex the matrix of each set, Y U^-1
    gamma: (
        np.ndarray
    )  # (n_u, n_u, F) factor from the covariance of one experiment's residual to Cov(vec G)
    gamma_each: np.ndarray  # (R, n_u, n_u, F) the same for each set
    # (R, n_y, F) variance of the residual of each set's experiments by noise; nan for one period
    noise_each: np.ndarray
    # (n_y, n_y, F) covariance of one experiment's residual by noise; nan for one period
    cov_noise: np.ndarray
    # (n_y, n_y, F) total covariance of one experiment's residual, from the scatter over sets; nan
    # for one set
    cov_scatter: np.ndarray
    gamma_of_set: np.ndarray  # (n_u, F) diagonal of R times gamma
    # (F,) covariance for `gamma` over the mean power of residuals: below one if inputs differ from
    # set to set, because a set of small inputs has a larger share in gamma
    level_scale: np.ndarray | float = 1.0


def estimate_frm(excited: Spectra) -> FrmEstimate:
    """Estimate the matrix over all sets, its gamma, and the covariances from the scatter over
    periods and sets.

    References, if given, are the instruments, each over its size: noise on the inputs then leaves
    no bias, in open and in closed loop. Without references sets are averaged: one least-squares fit
    over all of them would underestimate the noise on the inputs (Pintelon & Schoukens, 2.7, 3.7 and
    4.3.1).
    """
    n_u, n_y = len(excited.U), len(excited.Y)
    U, Y = _split_into_sets(excited.U, n_u), _split_into_sets(excited.Y, n_u)
    R = len(U)
    W = inverse(U)
    each, gamma_each = product(Y, W), product(adjoint(W), W)
    scatter, share = residual_scatter(each, excited), None
    noise_each = (
        np.add.reduce(
            squared_modulus(scatter.reshape(n_y, R, -1, scatter.shape[-1])), axis=2
        ).swapaxes(0, 1)
        / n_u
    )
    if excited.R is None:
        G = np.add.reduce(each) / R
        gamma = np.add.reduce(gamma_each) / R**2
        of_set = R * diagonal(gamma)
        if R > 1:  # the share of a set in the error of G is that of its gamma
            share = np.add.reduce(np.sqrt(diagonal(gamma_each) / of_set), axis=1)[:, None] / n_u
    else:
        Z = _split_into_sets(excited.R, n_u)
        Z = adjoint(Z / np.sqrt(np.add.reduce(squared_modulus(Z), axis=2, keepdims=True) / n_u))
        inverted = inverse(np.add.reduce(product(U, Z)))
        G = product(np.add.reduce(product(Y, Z)), inverted)
        W = product(Z, inverted)
        gamma = np.add.reduce(product(adjoint(W), W))
        of_set = R * diagonal(gamma)
        scatter = residual_scatter(G, excited)
    cov_noise = cov_scatter = np.full((n_y, n_y, G.shape[-1]), np.nan)
    if excited.dY.shape[2]:
        by_set = scatter.reshape(n_y, R, -1, scatter.shape[-1])
        cov_noise = sum_outer_products(by_set if share is None else by_set * share) / (R * n_u)
    else:
        noise_each = np.full(noise_each.shape, np.nan)
    scale: np.ndarray | float = 1.0
    if R > 1:
        V = np.swapaxes(Y - product(G, U), 0, 1)
        cov_scatter = sum_outer_products(V if share is None else V * share) / (n_u * (R - 1))
        power_U = diagonal(inverse(np.add.reduce(product(U, adjoint(U))) / R))
        scale = np.add.reduce(power_U / of_set) / n_u
    return FrmEstimate(
        G=G,
        G_each=each,
        gamma=gamma,
        gamma_each=gamma_each,
        noise_each=noise_each,
        cov_noise=cov_noise,
        cov_scatter=cov_scatter,
        gamma_of_set=of_set,
        level_scale=scale,
    )


def _split_into_sets(X: np.ndarray, n_u: int) -> np.ndarray:
    """Reshape (n, R n_u, F) to (R, n, n_u, F): channels x experiments of each set."""
    return X.reshape(len(X), -1, n_u, X.shape[-1]).swapaxes(0, 1)


def warn_of_rough_frf(
    rough: np.ndarray,
    level: np.ndarray,
    *,
    size: np.ndarray,
    what: str = "G",
    share: float = MAX_ROUGHNESS_OVER_GAIN,
) -> bool:
    """Warn of an FRF that varies from line to line by more than its distortion explains.

    Parameters
    ----------
    rough, level, size : (F,) ndarray
        Variance of an FRF about its neighbours; its variance from the detection lines; |G|^2.
    what : str
        Name of the FRF.
    share : float
        Roughness over |G|^2 above which it cannot be a bend of a smooth FRF.

    Returns
    -------
    bool
        True if it warned.
    """
    jumps = (rough > _MAX_ROUGHNESS_OVER_LEVEL * level) & (rough > share * size)
    is_rough = np.count_nonzero(jumps) > jumps.size / 2 + _N_SPARE_LINES
    if is_rough:
        of_size, above = (float(np.median(rough / np.maximum(one, TINY))) for one in (size, level))
        data_warning(
            f"{what} changes from line to line by {100 * of_size**0.5:.0f} % of its size,"
            f" {10 * np.log10(above):.0f} dB more than distortion and noise explain. Do u and y"
            " belong to the same runs, in the same order, with one trigger and one sign? If"
            " they do, G itself changes within a few lines: record a longer period"
        )
    return bool(is_rough)


def warn_of_outlier_lines(
    G: np.ndarray,
    fitted: np.ndarray,
    *,
    level: np.ndarray,
    index: LineIndex,
    f: np.ndarray,
    gamma: np.ndarray,
    what: str = "G",
) -> np.ndarray:
    """Warn of single lines that differ from their neighbours by more than distortion and noise
    explain.

    Two causes look alike: a disturbance that is periodic in the period, as mains hum nearly is, and
    a resonance narrower than the line spacing. The disturbance averages out over realisations, but
    the detection lines of one realisation do not show it.

    Parameters
    ----------
    G, fitted : (n_u, F) complex ndarray
        FRFs of one output in one realisation, and their local fit.
    level : (F,) ndarray
        Variance of the FRFs, over gamma.
    index : LineIndex
    f : (F,) ndarray
        Frequencies [Hz].
    gamma : (n_u, F) ndarray
        Factor on `level` for the FRF of each input.
    what : str
        Name of the FRFs.

    Returns
    -------
    (F,) ndarray
        Squared deviation of outlier lines, over gamma; zeros elsewhere.
    """
    if (
        f.size < FEW_LINES
        or not (
            np.add.reduce(squared_modulus(G - fitted) / gamma) > _OUTLIER_CANDIDATE * len(G) * level
        ).any()
    ):
        return np.zeros(f.size)
    outlier_power = np.full(f.size, np.inf)
    for order in _INTEGRATORS:
        slope = f**order
        deviation, scatter, spread = leave_one_out_residual(G * slope, index)
        scatter = np.mean(scatter / slope**2 / gamma, axis=0)
        by_chance = np.maximum(_OUTLIER_OVER_SCATTER * scatter, _OUTLIER_OVER_LEVEL * level)
        deviation_power = np.mean(squared_modulus(deviation / slope) / gamma, axis=0)
        found = np.where(deviation_power > spread * by_chance, deviation_power, 0.0)
        outlier_power = np.minimum(outlier_power, found)
    if f[1] > _MAX_FIRST_RATIO * f[0]:
        outlier_power[0] = 0.0
    out = np.flatnonzero(outlier_power)
    if not out.size:
        return outlier_power
    listed = ", ".join(f"{f[k]:g}" for k in out[:6]) + (", ..." if out.size > 6 else "")
    worst = int(out[np.argmax(outlier_power[out] / level[out])])
    half = (f[1:] - f[:-1]).min() / 2
    hum = next(
        (
            m
            for m in _MAINS_FREQUENCIES
            if all(round(f[k] / m) and abs(f[k] - round(f[k] / m) * m) < half for k in out)
        ),
        None,
    )
    if hum:
        mains = f", as the hum of mains of {hum:g} Hz does"
    else:
        mains = ""
    ratio = np.sqrt(outlier_power[worst] / level[worst])
    data_warning(
        f"{what} differs from its neighbours at {listed} Hz, at {f[worst]:g} Hz by {ratio:.0f}"
        f" times its scatter{mains}. The cause is a disturbance that repeats in every period, or"
        " a resonance narrower than the line spacing. The bound there contains the value that"
        " the neighbours predict. Record several realisations, or another period"
    )
    return outlier_power


def check_outputs_follow_input(
    frm: FrmEstimate, excited: Spectra, *, fit: LocalFit | None, outputs: Sequence[str]
) -> bool:
    """Refuse outputs that follow the input of another realisation, or its negative; warn of one
    that follows none.

    Their distortion and scatter would be those of random phases. Without detection lines no other
    check finds this.

    Parameters
    ----------
    frm : FrmEstimate
    excited : Spectra
        Spectra on the excited lines, for one input.
    fit : LocalFit or None
        Local fit of each realisation, if known.
    outputs : sequence of str
        Names of the outputs.

    Returns
    -------
    bool
        True if it warned.

    Raises
    ------
    ValueError
        An output follows the input of another realisation instead of its own, or its sign differs
        between realisations.
    """
    n, steps, has_warned = len(frm.G_each), pair_equal_steps(excited.index), False
    gamma = frm.gamma_of_set[0]
    for j, (name, each) in enumerate(zip(outputs, frm.G_each[:, :, 0].swapaxes(0, 1), strict=True)):
        if n > 1:
            spread = (n - 1) * frm.cov_scatter[j, j].real * gamma
        else:
            spread = None
        if n == 1 and fit is not None:
            spread = fit.variance[0, j, 0]
        if spread is not None and np.add.reduce(spread) <= _MIN_RELATIVE_SCATTER * power(
            frm.G[j, 0]
        ):
            continue  # an output that follows another input would scatter more
        noise = (
            frm.noise_each[:, j]
            * frm.gamma_each[:, 0, 0].real
            / np.maximum(squared_modulus(each), TINY)
        )
        has_warned |= _check_follows(
            name, excited.Y[j], input_name="u", U=excited.U[0], noise=noise, steps=steps
        )
    return has_warned


def check_input_follows_reference(excited: Spectra) -> None:
    """Refuse a single input that follows the reference of another realisation; warn if it follows
    none.
    """
    if excited.R is not None and len(excited.U) == 1:
        scatter = np.add.reduce(squared_modulus(excited.dU[0]), axis=1)
        noise = (scatter if excited.dU.shape[2] else np.nan) / np.maximum(excited.power_U[0], TINY)
        _check_follows(
            "u",
            excited.U[0],
            input_name="r",
            U=excited.R[0],
            noise=noise,
            steps=pair_equal_steps(excited.index),
        )


def _check_follows(
    output_name: str,
    Y: np.ndarray,
    *,
    input_name: str,
    U: np.ndarray,
    noise: np.ndarray,
    steps: np.ndarray,
) -> bool:
    """Check that Y (M, F) of each realisation follows its own U.

    Raises if it follows another realisation's; warns, and returns True, if it follows none. `noise`
    (M, F) is the variance of Y / U by noise over its squared modulus, nan if unknown.
    """
    n, n_steps = len(Y), steps.shape[1]
    if n_steps < _MIN_STEP_PAIRS:
        return False
    chance = 1 / np.sqrt(2 * n_steps)
    each = _unit_phasors(Y) * _unit_phasors(U).conj()
    alone = (
        np.add.reduce(_second_phase_differences(each, steps).real, axis=1)
        < _MAX_CHANCE_SIGMAS * chance * n_steps
    )
    if not alone.any():
        _require_same_sign(output_name, each)
        return False
    common = (
        _second_phase_differences(_unit_phasors(Y), steps)
        @ _second_phase_differences(_unit_phasors(U), steps).conj().T
    ).real / n_steps
    sure = _chance_sigmas(n * n) * chance
    pairs = [(m, int(common[m].argmax())) for m in np.flatnonzero(alone) if common[m].max() > sure]
    if pairs:
        who = ", ".join(
            f"that of realisation {m} follows {input_name} of realisation {other}"
            for m, other in pairs[:4]
        )
        raise ValueError(
            f"{output_name} must follow the {input_name} of its own realisation, got"
            f" {who}{', ...' if len(pairs) > 4 else ''}, by the phases of all lines: are the files"
            " of both in the same order?"
        )
    quiet = ~(np.median(noise, axis=1) > _MAX_RELATIVE_NOISE)  # or the noise is unknown
    mismatched = np.flatnonzero(alone & quiet)
    warns = mismatched.size > 0 and n_steps >= _MIN_WARNING_STEP_PAIRS
    if warns:
        who = ", ".join(map(str, mismatched[:6])) + (", ..." if mismatched.size > 6 else "")
        data_warning(
            f"{output_name} does not follow {input_name} in realisation {who}: from line to line"
            " its phase is random. Is it from another run, or only noise and distortion?"
        )
    return warns


def _require_same_sign(output_name: str, phases: np.ndarray) -> None:
    """Refuse a realisation whose phases (M, F) have another sign than those of the others."""
    n, n_lines = phases.shape
    # agreement with the others
    agree = np.add.reduce((phases * np.add.reduce(phases).conj()).real, axis=1) - n_lines
    turned = np.flatnonzero(agree < -_chance_sigmas(n) * np.sqrt((n - 1) * n_lines / 2))
    if n > 1 and turned.size:
        if n == 2:
            which = "it differs between realisations 0 and 1"
        else:
            which = f"it changes in realisation {', '.join(map(str, turned))}"
        raise ValueError(
            f"{output_name} must have the same sign in all realisations, got: {which}. Was it"
            " rewired, or is it late by half a period?"
        )


def _chance_sigmas(n: int) -> float:
    """Return the sigmas that the largest of n means of random phases exceeds with
    `_CHANCE_MATCH_PROBABILITY`.

    An upper bound: such means have lighter tails than a normal distribution.
    """
    return float(np.sqrt(2 * np.log(n / _CHANCE_MATCH_PROBABILITY)))


def _unit_phasors(x: np.ndarray) -> np.ndarray:
    """Return x / |x|; zero where x is zero."""
    return np.asarray(x / np.maximum(np.abs(x), TINY))


def _second_phase_differences(phases: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Return (M, n) second differences of the phase of unit phasors (M, F), over pairs of equal
    steps between lines.
    """
    step = phases[:, 1:] * phases[:, :-1].conj()
    return np.asarray(step.take(steps[0], axis=1) * step.take(steps[1], axis=1).conj())
