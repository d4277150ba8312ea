"""`identify`: from a periodic record to the best linear approximation with its variances.

One realisation: the *fast* method, which reads the distortion on lines that were not excited. Several: the *robust*
method, which reads it from the scatter between realisations (Pintelon & Schoukens, 4.3).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from nlfrf._base.arguments import short_form
from nlfrf._base.numbers import power, squared_modulus
from nlfrf.bla.bla import Bla, DistortionLevels
from nlfrf.bla.calibration import read_peaks
from nlfrf.bla.distortion import DistortionVariance, choose_source, estimate_distortion_variance, smooth_frf
from nlfrf.bla.frf import (
    ROUNDING,
    Frf,
    average_frf,
    refuse_another_reference,
    refuse_mispaired,
    warn_of_jumps,
    warn_of_lines_apart,
)
from nlfrf.bla.neighbours import place_lines
from nlfrf.bla.realizations import check_realizations
from nlfrf.bla.residual import NonlinearResidual, nonlinear_residual
from nlfrf.bla.spectra import Spectra, dft, period_spectra
from nlfrf.records.record import Record

__all__ = ["identify_single"]


def identify_single(record: Any, transient: str, level_from: str, n_detection: int) -> Bla | list[Bla]:
    """`identify` for a record of one input and one output, or a list of them, whose outputs share the input."""
    if isinstance(record, Record):
        return identify_one(record, None, transient, level_from, n_detection)
    if not isinstance(record, Sequence) or not all(isinstance(one, Record) for one in record):
        raise ValueError(
            f"record must be a Record or a list of them, got {short_form(record)}; see record_from_samples"
        )
    known: list[tuple[Record, np.ndarray]] = []
    blas = []
    for one in record:
        U = next((U for other, U in known if other.u is one.u and other.lines is one.lines), None)
        if U is None:
            U = dft(one.u, place_lines(one.lines, n_detection).lines)
            known.append((one, U))
        blas.append(identify_one(one, U, transient, level_from, n_detection))
    return blas


def identify_one(record: Record, U: np.ndarray | None, transient: str, level_from: str, n_detection: int) -> Bla:
    """`identify` for one record, with the spectra of its input where they are known."""
    spectra, treatment = period_spectra(record, place_lines(record.lines, n_detection), transient, U)
    n_periods = record.n_periods - (treatment == "discard")
    spectra, excited, n_periods, low = check_realizations(spectra, record, n_periods)
    refuse_another_reference(excited)
    frf = average_frf(excited)
    source = choose_source(level_from, excited, record.lines, n_detection)
    smooth, fit = smooth_frf(frf, excited, source == "roughness")
    strange = refuse_mispaired(frf, excited, None if fit is None else fit.variance[0])
    residual = nonlinear_residual(spectra, frf.G, smooth)
    typical, coherent = read_peaks(excited.U, excited.lines, low)
    # chosen phases leave more of the distortion to one gain on all lines, and that is not rough
    rough = None if low and source == "detection" else fit
    distortion = estimate_distortion_variance(source, excited, residual, frf, rough, coherent)
    if source == "detection" and fit is not None and not strange:
        n, level = len(excited.U), distortion.detected
        warn_of_jumps(np.add.reduce(fit.variance) / n**2, level / n, squared_modulus(frf.G))
        if n == 1:
            rounding = ROUNDING**2 * power(spectra.Y[0]) / excited.power_U[0]
            f = record.lines.excited * record.f0
            apart = warn_of_lines_apart(frf.each, fit.G, level + rounding, excited.where, f)
            distortion = distortion.at_least(apart)
    return assemble_bla(record, treatment, n_periods, source, excited, frf, residual, distortion, typical)


def assemble_bla(
    record: Record,
    treatment: str,
    n_periods: int,
    source: str,
    excited: Spectra,
    frf: Frf,
    residual: NonlinearResidual,
    distortion: DistortionVariance,
    typical: float,
) -> Bla:
    """The `Bla` of what was found."""
    grid, n = record.lines, excited.U.shape[0]
    var_total = distortion.variance if n == 1 else frf.var_total
    if n > 1 and source != "realizations":
        source = f"realizations and {source}"
    return Bla(
        lines=grid,
        fs=record.fs,
        n_samples=record.n_samples,
        f=grid.excited * record.f0,
        n_realizations=n,
        n_periods=n_periods,
        G=frf.G,
        grid=grid.kind,
        transient=treatment,
        level_source=source,
        var_noise=frf.var_noise,
        var_total=var_total,
        # without periods to tell them apart, noise counts as distortion
        var_distortion=n * np.maximum(var_total - np.where(np.isnan(frf.var_noise), 0.0, frf.var_noise), 0.0),
        var_even=distortion.even,
        dof=distortion.dof,
        grid_factor=distortion.grid_factor if n == 1 else np.ones(grid.excited.size),
        levels=output_levels(record, excited, residual),
        var_bound=distortion.var_bound,
        typical=typical,
        hold=record.hold,
        u_name=record.u_name,
        y_name=record.y_name,
        u_unit=record.u_unit,
        y_unit=record.y_unit,
    )


def output_levels(record: Record, excited: Spectra, residual: NonlinearResidual) -> DistortionLevels:
    """What the output holds on each kind of line."""
    grid, where = record.lines, excited.where
    noise = np.sqrt(residual.noise)
    return DistortionLevels(
        f_excited=grid.excited * record.f0,
        f_odd=grid.odd * record.f0,
        f_even=grid.even * record.f0,
        excited=excited.Y,
        odd=residual.Y.take(where.odd, axis=1),
        even=residual.Y.take(where.even, axis=1),
        noise_excited=np.sqrt(np.add.reduce(excited.var_Y) / len(excited.var_Y)),
        noise_odd=noise.take(where.odd),
        noise_even=noise.take(where.even),
    )
