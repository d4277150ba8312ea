"""`identify`: from a periodic record to the best linear approximation with its variances.

One realisation: the *fast* method, which reads the distortion on lines that were not excited. Several: the *robust*
method, which reads it from the scatter between realisations (Pintelon & Schoukens, 4.3).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import overload

import numpy as np

from nlfrf._base.arguments import integer, one_of, shown
from nlfrf._base.numbers import power, squared
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
from nlfrf.bla.spectra import TREATMENTS, Spectra, dft, period_spectra
from nlfrf.records.record import Record

__all__ = ["identify"]


@overload
def identify(record: Record, *, transient: str = ..., level_from: str = ..., n_detection: int = ...) -> Bla: ...


@overload
def identify(
    record: Sequence[Record], *, transient: str = ..., level_from: str = ..., n_detection: int = ...
) -> list[Bla]: ...


def identify(
    record: Record | Sequence[Record], *, transient: str = "auto", level_from: str = "auto", n_detection: int = 6
) -> Bla | list[Bla]:
    """Best linear approximation, noise and distortion of a system from one periodic record.

    Parameters
    ----------
    record : Record, or a list of them
        Input and output; one realisation is enough, two periods separate noise from distortion. Several outputs of one
        experiment, as `load_record` gives them, share the analysis of the input.
    transient : str
        "none": the record is taken as steady. "discard": the first period is left out. "local": the transient is
        fitted between the harmonics and taken off, at excited and at detection lines. "auto": nothing where the
        periods agree but for noise, discard where that leaves periods that agree, else local.
    level_from : str
        "detection": from the odd lines that were not excited. "roughness": from the roughness of the FRF over the
        excited lines. "auto": detection lines where the grid lets them be calibrated (special-odd, random-odd and
        some custom grids), else roughness, with a warning.
    n_detection : int
        Odd detection lines averaged for one level.

    Returns
    -------
    Bla, or a list of them for a list of records

    Raises
    ------
    ValueError
        Lines that carry no input, realisations whose input spectra do not belong together, or whose output follows the
        input of another one or has another sign, no detection lines where they were asked for, too few lines for any
        level.

    Warns
    -----
    DataWarning
        The grid has no detection lines that can be calibrated, and the level comes from the roughness. Realisations
        that have the phases of another one: they count as periods of it. Peaks of the input that are lower than random
        phases have them. An output that follows no input at hand. Lines of a single realisation that stand out of their
        neighbours, as hum of the mains makes them.

    References
    ----------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., 4.3.

    Examples
    --------
    A static cubic: the BLA on these six lines of amplitude 1 is 8.25, but one realisation scatters about it.

    >>> from nlfrf.signals.multisine import multisine
    >>> ms = multisine(fs=128, n_samples=128, f_min=1, f_max=19, rms=3**0.5, n_realizations=200, rng=1)
    >>> u = ms.u[:, None, :]
    >>> bla = identify(Record(u=u, y=u**3, fs=128, lines=ms.lines))
    >>> float(np.abs(bla.G - 8.25).max()) < float(bla.bound(0.999).max())
    True
    """
    one_of("transient", transient, TREATMENTS)
    one_of("level_from", level_from, ("auto", "detection", "roughness"))
    n_detection = integer("n_detection", n_detection, least=3)
    if isinstance(record, Record):
        return identify_one(record, None, transient, level_from, n_detection)
    if not isinstance(record, Sequence) or not all(isinstance(one, Record) for one in record):
        raise ValueError(f"record must be a Record or a list of them, got {shown(record)}; see record_from_samples")
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
        warn_of_jumps(np.add.reduce(fit.variance) / n**2, level / n, squared(frf.G))
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
