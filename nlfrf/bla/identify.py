"""`identify`: from a periodic record of any number of channels to its best linear approximation.

With one realisation of the random phases the distortion is measured on lines without excitation
(the *fast* method). With several realisations it is their scatter (the *robust* method; Pintelon &
Schoukens, 2nd ed., 4.3). For n_u inputs a realisation is a set of n_u experiments. Arrays in this
module are (n_y, n_u, F) for matrices and (n, M, K) for spectra of n channels, M experiments and K
lines.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import overload

import numpy as np

from nlfrf._base.arguments import (
    as_list,
    data_warning,
    keep_warnings,
    require_choice,
    require_integer,
    short_form,
)
from nlfrf._base.numbers import power, squared_modulus
from nlfrf.bla.bla import Bla, Covariances, DistortionLevels, Experiment
from nlfrf.bla.channel_mismatch import warn_of_mismatch
from nlfrf.bla.covariance import psd_difference
from nlfrf.bla.distortion import (
    DistortionVariance,
    choose_source,
    estimate_distortion_variance,
    smooth_frm,
)
from nlfrf.bla.experiment_checks import (
    check_experiments,
    count_independent_experiments,
    warn_of_noisy_experiment,
)
from nlfrf.bla.frf import (
    MAX_MATRIX_ROUGHNESS_OVER_GAIN,
    MAX_ROUGHNESS_OVER_GAIN,
    OUTPUT_ROUNDING,
    FrmEstimate,
    check_input_follows_reference,
    check_outputs_follow_input,
    estimate_frm,
    warn_of_outlier_lines,
    warn_of_rough_frf,
)
from nlfrf.bla.line_index import WINDOW_LINES, index_lines
from nlfrf.bla.local_models import LocalFit
from nlfrf.bla.residual import NonlinearResidual, nonlinear_residual
from nlfrf.bla.spectra import TREATMENTS, Spectra, channel_dft, period_spectra
from nlfrf.bla.zippered import bound_interpolated_columns, estimate_zippered_frm
from nlfrf.records.record import Record


@overload
def identify(
    record: Record, *, transient: str = ..., level_from: str = ..., n_detection: int = ...
) -> Bla: ...


@overload
def identify(
    record: Sequence[Record], *, transient: str = ..., level_from: str = ..., n_detection: int = ...
) -> list[Bla]: ...


def identify(
    record: Record | Sequence[Record],
    *,
    transient: str = "auto",
    level_from: str = "auto",
    n_detection: int = 6,
) -> Bla | list[Bla]:
    """Estimate the best linear approximation of a system, with its noise and distortion, from a
    periodic record.

    Make the record with `load_record`, `record_from_samples` or `Record`. For control design, give
    the result to `robust.fit_nominal` and `robust.uncertainty`.

    Parameters
    ----------
    record : Record, or a list of them
        Inputs and outputs. One realisation of the random phases is enough for one input. n_u inputs
        need n_u experiments, or one experiment in which each line excites one input only
        ("zippered"). Two periods are needed to separate noise from distortion. A list holds one
        record per output of the same experiment; the analysis of the input is then done once.
    transient : str
        "none": the record is in steady state. "discard": the first period is left out. "local": the
        spectrum of the transient is fitted between the lines and subtracted. "auto": "none" if the
        periods agree within noise; else "discard" if the remaining periods agree; else "local".
    level_from : str
        Source of the distortion variance. "detection": the output on odd lines without excitation
        (detection lines). "roughness": the scatter of the FRF between neighbouring excited lines.
        "auto": "detection" if the ratio of the distortion on excited lines to that on detection
        lines is known for the grid, as for the grids "special-odd" and "random-odd" of `multisine`;
        else "roughness", with a warning.
    n_detection : int
        Number of odd detection lines averaged for the variance on one excited line.

    Returns
    -------
    Bla, or a list of them for a list of records

    Raises
    ------
    ValueError
        An excited line has no input; realisations have unequal amplitude spectra; the experiments
        do not separate the inputs; `level_from` is "detection" and the grid has no detection lines;
        or the lines are too few for any estimate of the distortion.

    Warns
    -----
    DataWarning
        The ratio of the distortion on excited lines to that on detection lines is unknown for the
        grid, so "roughness" is used. For several inputs also: inputs have equal phases or are
        nearly linearly dependent; an experiment is much noisier than the others, or one of its
        channels has another gain or delay; the record has one period only.

    References
    ----------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., 2.7, 3.7
    and 4.3.

    Examples
    --------
    y = u^3 with six lines of amplitude 1. The BLA is 8.25; the FRF of one realisation differs from
    it by distortion.

    >>> from nlfrf.signals.multisine import multisine
    >>> ms = multisine(fs=128, n_samples=128, f_min=1, f_max=19, rms=3**0.5, n_realizations=200, rng=1)
    >>> u = ms.u[:, None, :]
    >>> bla = identify(Record(u=u, y=u**3, fs=128, lines=ms.lines))
    >>> float(np.abs(bla.G - 8.25).max()) < float(bla.bound(0.999).max())
    True
    """
    require_choice("transient", transient, TREATMENTS)
    require_choice("level_from", level_from, ("auto", "detection", "roughness"))
    n_detection = require_integer("n_detection", n_detection, least=3)
    if isinstance(record, Record):
        return _identify_record(
            record, None, transient=transient, level_from=level_from, n_detection=n_detection
        )
    records: list[Record] = as_list(record)
    if not all(isinstance(one, Record) for one in records):
        raise ValueError(
            f"record must be a Record or a list of them, got {short_form(record)}; see"
            " record_from_samples"
        )
    known: list[tuple[Record, np.ndarray]] = []
    blas = []
    for one in records:
        U = next((U for other, U in known if other.u is one.u and other.lines is one.lines), None)
        if U is None:
            U = channel_dft(one.u, index_lines(one.lines, n_detection).lines)
            known.append((one, U))
        blas.append(
            _identify_record(
                one, U, transient=transient, level_from=level_from, n_detection=n_detection
            )
        )
    return blas


@keep_warnings
def _identify_record(
    record: Record, U: np.ndarray | None, *, transient: str, level_from: str, n_detection: int
) -> Bla:
    """Identify one record; U are the spectra of its inputs, if known already."""
    spectra, treatment = period_spectra(
        record, index_lines(record.lines, n_detection), transient=transient, U=U
    )
    spectra, excited, crest = check_experiments(record, spectra)
    check_input_follows_reference(excited)
    zippered = excited.is_zippered
    if zippered:
        frm, between = estimate_zippered_frm(excited)
    else:
        frm, between = estimate_frm(excited), None
    if spectra.n_periods < 2 and not record.is_single:
        data_warning(
            "one period does not separate noise from distortion, so noise counts as"
            " distortion. Record two periods"
        )
    source = choose_source(level_from, excited, grid=record.lines, n_detection=n_detection)
    if zippered and source == "roughness":
        raise ValueError(
            "lines must be random-odd for a zippered record (each line excites one input), got"
            f" a {record.lines.kind} grid: the distortion can be estimated from detection lines"
            " only"
        )
    smooth, fit = smooth_frm(frm, excited, source == "roughness")
    mispaired = record.n_inputs == 1 and check_outputs_follow_input(
        frm, excited, fit=fit, outputs=record.outputs
    )
    residual = nonlinear_residual(spectra, excited, measured=frm.G, smooth=smooth)
    # with optimised phases more of the distortion is one gain on all lines, which is not rough
    rough = None if zippered or (crest.has_low_crest and source == "detection") else fit
    distortion = estimate_distortion_variance(
        source,
        excited,
        residual=residual,
        frm=frm,
        fit=rough,
        coherent=crest.coherent_share,
        n_independent=count_independent_experiments(excited),
    )
    if source == "detection" and not mispaired:
        if record.is_single:
            distortion = _examine_entry(record, excited, frm=frm, fit=fit, distortion=distortion)
        else:
            distortion = _examine_matrix(
                record, excited, frm=frm, fit=fit, residual=residual, distortion=distortion
            )
    if not record.is_single:
        warn_of_noisy_experiment(excited, distortion.cov)
    if between is not None:
        gamma, cov = bound_interpolated_columns(
            between, frm.gamma, cov=distortion.cov_bound, n_sets=len(frm.G_each)
        )
        frm, distortion = frm._replace(gamma=gamma), distortion._replace(cov_bound=cov)
    return _assemble_bla(
        record,
        treatment,
        source=source,
        excited=excited,
        frm=frm,
        residual=residual,
        distortion=distortion,
        typical=crest.distortion_ratio,
    )


def _examine_entry(
    record: Record,
    excited: Spectra,
    *,
    frm: FrmEstimate,
    fit: LocalFit | None,
    distortion: DistortionVariance,
) -> DistortionVariance:
    """Warn of a rough FRF, and raise the distortion variance on its outlier lines."""
    if fit is None or excited.is_zippered:
        return distortion
    labels = ["G"]
    _warn_of_rough_outputs(
        labels, frm=frm, fit=fit, distortion=distortion, share=MAX_ROUGHNESS_OVER_GAIN
    )
    return _add_outlier_power(record, excited, labels, frm=frm, fit=fit, distortion=distortion)


def _examine_matrix(
    record: Record,
    excited: Spectra,
    *,
    frm: FrmEstimate,
    fit: LocalFit | None,
    residual: NonlinearResidual,
    distortion: DistortionVariance,
) -> DistortionVariance:
    """Warn of a channel that differs in one experiment, else of a rough FRF; raise the distortion
    variance on outlier lines if there is neither.
    """
    zippered = excited.is_zippered
    if excited.lines.size <= 2 * WINDOW_LINES:  # on fewer lines a bend looks like any fault
        return distortion
    # share of a line in its own fit
    if fit is None:
        own = 1.0
    else:
        own = 1 - float(np.mean(fit.dof)) / WINDOW_LINES
    # zippered: a difference between experiments does not jump
    if zippered:
        left = 1.0
    else:
        left = 1 - own * record.n_inputs / excited.U.shape[1]
    if left > 0 and warn_of_mismatch(
        record, excited, residual=residual, level=distortion.detected, retained=left
    ):
        return distortion
    if fit is None or zippered:
        return distortion
    labels = [f"G of {name}" for name in record.outputs]
    if _warn_of_rough_outputs(
        labels, frm=frm, fit=fit, distortion=distortion, share=MAX_MATRIX_ROUGHNESS_OVER_GAIN
    ):
        return distortion
    return _add_outlier_power(record, excited, labels, frm=frm, fit=fit, distortion=distortion)


def _warn_of_rough_outputs(
    labels: list[str],
    *,
    frm: FrmEstimate,
    fit: LocalFit,
    distortion: DistortionVariance,
    share: float,
) -> bool:
    """Warn of the first output whose FRF is rough, and return whether there is one."""
    R, gamma = len(frm.G_each), frm.gamma_of_set
    rough = np.add.reduce(fit.variance / gamma, axis=(0, 2)) / (R * len(gamma))  # (n_y, F)
    size = np.add.reduce(squared_modulus(frm.G) / gamma, axis=1) / len(gamma)
    return any(
        warn_of_rough_frf(
            rough[j] / R, distortion.detected[j] / R, size=size[j], what=what, share=share
        )
        for j, what in enumerate(labels)
    )


def _add_outlier_power(
    record: Record,
    excited: Spectra,
    labels: list[str],
    *,
    frm: FrmEstimate,
    fit: LocalFit,
    distortion: DistortionVariance,
) -> DistortionVariance:
    """Raise the distortion variance on outlier lines of a single set to their squared deviation."""
    if len(frm.G_each) > 1:
        return distortion
    outlier_power = np.zeros((record.n_outputs, excited.lines.size))
    for j, what in enumerate(labels):
        level = distortion.detected[j] + OUTPUT_ROUNDING**2 * power(excited.Y[j]).max()
        f = record.lines.excited * record.f0
        outlier_power[j] = warn_of_outlier_lines(
            frm.G_each[0, j],
            fit.G[0, j],
            level=level,
            index=excited.index,
            f=f,
            gamma=frm.gamma_of_set,
            what=what,
        )
    return distortion.with_minimum(outlier_power)


def _assemble_bla(
    record: Record,
    treatment: str,
    *,
    source: str,
    excited: Spectra,
    frm: FrmEstimate,
    residual: NonlinearResidual,
    distortion: DistortionVariance,
    typical: float,
) -> Bla:
    """Assemble the `Bla`; for one input and one output gamma is one, and covariances are variances
    of G.
    """
    grid, R = record.lines, len(frm.G_each)
    total = distortion.cov if R == 1 else frm.cov_scatter
    # for one period noise counts as distortion
    if excited.dY.shape[2]:
        cov_distortion = psd_difference(total, frm.cov_noise)
    else:
        cov_distortion = total
    covariances = [frm.cov_noise, total, cov_distortion, distortion.cov_even, distortion.cov_bound]
    gamma = frm.gamma
    if record.is_single:
        size, gamma = gamma.real, np.ones(gamma.shape)
        covariances = [part * size for part in covariances]
    noise, total, cov_distortion, even, bound = covariances
    cov = Covariances(
        gamma=gamma, noise=noise, total=total, distortion=cov_distortion, even=even, bound=bound
    )
    return Bla(
        f=grid.excited * record.f0,
        G=frm.G,
        lines=grid,
        fs=record.fs,
        experiment=Experiment(
            grid=grid.kind,
            design="zippered" if excited.is_zippered else "orthogonal",
            n_samples=record.n_samples,
            n_realizations=R,
            n_periods=excited.n_periods,
            n_experiments=excited.U.shape[1],
            transient=treatment,
        ),
        hold=record.hold,
        cov=cov,
        dof=distortion.dof,
        level_source=source if R == 1 or source == "realizations" else f"realizations and {source}",
        grid_factor=distortion.grid_factor if R == 1 else np.ones(grid.excited.size),
        levels=_output_levels(record, excited, residual),
        typical=typical,
        inputs=record.inputs,
        outputs=record.outputs,
        input_units=record.input_units,
        output_units=record.output_units,
    )


def _output_levels(
    record: Record, excited: Spectra, residual: NonlinearResidual
) -> tuple[DistortionLevels, ...]:
    """Return the amplitudes of every output on each kind of line."""
    grid, index, f0 = record.lines, excited.index, record.f0
    noise = np.sqrt(residual.noise)
    if excited.dY.shape[2]:
        n = excited.dY.shape[1]
    else:
        n = np.nan
    noise_excited = np.sqrt(np.add.reduce(squared_modulus(excited.dY), axis=(1, 2)) / n)
    return tuple(
        DistortionLevels(
            f_excited=grid.excited * f0,
            f_odd=grid.odd * f0,
            f_even=grid.even * f0,
            excited=Y,
            odd=rest.take(index.odd, axis=1),
            even=rest.take(index.even, axis=1),
            noise_excited=of_output,
            noise_odd=of_rest.take(index.odd),
            noise_even=of_rest.take(index.even),
        )
        for Y, rest, of_output, of_rest in zip(
            excited.Y, residual.Y, noise_excited, noise, strict=True
        )
    )
