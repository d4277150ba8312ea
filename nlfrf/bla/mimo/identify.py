"""`identify`: from a periodic record, of one input and one output or of several, to its best linear approximation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, overload

import numpy as np

from nlfrf._base.arguments import data_warning, require_choice, require_integer
from nlfrf._base.numbers import power
from nlfrf.bla.bla import Bla, DistortionLevels, excess
from nlfrf.bla.frf import ROUNDING, warn_of_jumps, warn_of_lines_apart
from nlfrf.bla.identify import identify_single
from nlfrf.bla.mimo.channels import ChannelSpectra, channel_spectra
from nlfrf.bla.mimo.conditions import (
    calibrated,
    check_experiments,
    independent_experiments,
    is_zippered,
    read_inputs,
    warn_of_loud,
)
from nlfrf.bla.mimo.local_matrix import LEAST, WIDTH, LocalMatrix, fit_matrix
from nlfrf.bla.mimo.matrix_frf import MatrixFrf, matrix_frf
from nlfrf.bla.mimo.matrix_level import MatrixLevel, level_from_fit, level_from_lines, linear_part
from nlfrf.bla.mimo.repeats import join_repeats
from nlfrf.bla.mimo.unequal import warn_of_unequal
from nlfrf.bla.mimo.zippered import spread_between, zippered_frf
from nlfrf.bla.neighbours import place_lines
from nlfrf.bla.spectra import TREATMENTS
from nlfrf.records.record import Record
from nlfrf.signals.lines import LineGrid

__all__ = ["identify"]


ENOUGH = 7  # sets whose scatter alone is worth more than a roughness that may read too high
#: Roughness of a row over its size where outputs of other experiments were taken, 0.3 and more; a sound matrix that
#: bends within a few lines has up to 0.3, and one experiment that differs from the others is told before.
MIXED = 0.2


@overload
def identify(record: Record, *, transient: str = ..., level_from: str = ..., n_detection: int = ...) -> Bla: ...


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
    """Best linear approximation, noise and distortion of a system from one periodic record.

    Parameters
    ----------
    record : Record, or a list of them
        Inputs and outputs; one realisation is enough, of several inputs one set of as many experiments as inputs. Two
        periods separate noise from distortion. A list: several outputs of one experiment, which share the analysis of
        the input.
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
        Lines that carry no input, realisations whose input spectra do not belong together, experiments that do not tell
        the inputs apart, no detection lines where they were asked for, too few lines for any level.

    Warns
    -----
    DataWarning
        The grid has no detection lines that can be calibrated, and the level comes from the roughness. Of several
        inputs: phases that are copies of each other, inputs that are nearly dependent, one experiment much noisier
        than the others, or with a channel of another gain or delay, one period only.

    References
    ----------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., 2.7, 3.7 and 4.3.

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
    require_choice("transient", transient, TREATMENTS)
    require_choice("level_from", level_from, ("auto", "detection", "roughness"))
    n_detection = require_integer("n_detection", n_detection, least=3)
    if isinstance(record, Sequence) and any(isinstance(one, Record) and not one.is_single for one in record):
        return [identify(one, transient=transient, level_from=level_from, n_detection=n_detection) for one in record]
    if not isinstance(record, Record) or record.is_single:
        return identify_single(record, transient, level_from, n_detection)
    return identify_matrix(record, transient, level_from, n_detection)


def identify_matrix(record: Record, transient: str, level_from: str, n_detection: int) -> Bla:
    """`identify` for several channels."""
    grid = record.lines
    spectra, treatment = channel_spectra(record, transient)
    zippered = is_zippered(spectra)
    spectra = join_repeats(spectra, 1 if zippered else record.n_inputs)
    n_periods = (record.n_periods - (treatment == "discard")) * record.n_experiments // spectra.U.shape[1]
    typical = read_inputs(record, spectra)
    check_experiments(record, spectra)
    frf, between = zippered_frf(spectra) if zippered else (matrix_frf(spectra), None)
    R, per_set = len(frf.each), 1 if zippered else record.n_inputs
    source = choose_source(level_from, grid, n_detection, R, n_periods)
    if zippered and source == "roughness":
        raise ValueError(
            "lines must hold detection lines that calibrate for a zippered record, as random-odd has them, "
            f"got a {grid.kind} grid: between its own lines a column is fitted, and says nothing of its roughness"
        )
    fit = None if grid.excited.size < LEAST or R >= ENOUGH else fit_matrix(frf.G, grid, frf.gamma)
    part = linear_part(spectra, frf.G if fit is None else fit.G)
    independent = independent_experiments(spectra)
    level = {
        "detection": lambda: level_from_lines(spectra, grid, part, "odd", n_detection, independent),
        "roughness": lambda: level_from_fit(frf, grid),
        "realizations": lambda: nothing(frf),
    }[source]()
    if source == "detection" and grid.excited.size > 2 * WIDTH:  # of fewer a bend looks like anything
        level = looked_over(record, spectra, frf, fit, part, level)
    even = np.full_like(level.cov, np.nan)
    if grid.even.size:
        even = level_from_lines(spectra, grid, part, "even", n_detection, independent).cov
    total = level.cov if R == 1 else frf.cov_scatter
    warn_of_loud(spectra, total)
    dof = level.dof + per_set * (R - 1)
    pooled = level.cov if R == 1 else (per_set * (R - 1) * total + level.dof * level.cov) / dof
    gamma, pooled = (frf.gamma, pooled) if between is None else spread_between(between, frf.gamma, pooled, R)
    return Bla(
        f=grid.excited * record.f0,
        G=frf.G,
        inputs=record.inputs,
        outputs=record.outputs,
        lines=grid,
        grid=grid.kind,
        design="zippered" if zippered else "orthogonal",
        fs=record.fs,
        n_samples=record.n_samples,
        n_realizations=R,
        n_experiments=spectra.U.shape[1],
        n_periods=n_periods,
        transient=treatment,
        level_source=source if R == 1 or source == "realizations" else f"realizations and {source}",
        gamma=gamma,
        cov_noise=frf.cov_noise,
        cov_total=total,
        cov_distortion=excess(total, np.nan_to_num(frf.cov_noise)),
        cov_even=even,
        cov_bound=pooled,
        dof=dof,
        grid_factor=level.factor,
        levels=distortion_levels(record, spectra, part),
        typical=typical,
        hold=record.hold,
    )


def looked_over(
    record: Record,
    spectra: ChannelSpectra,
    frf: MatrixFrf,
    fit: LocalMatrix | None,
    part: tuple[np.ndarray, np.ndarray, np.ndarray],
    level: MatrixLevel,
) -> MatrixLevel:
    """The level, with what single lines of one set stand out by.

    Warns of a channel that differs in one experiment, or where there is none of an output of other experiments.
    """
    zippered = is_zippered(spectra)
    own = 1.0 if fit is None else 1 - float(np.mean(fit.dof)) / WIDTH  # of a line in its own fit
    n_sets = spectra.U.shape[1] / record.n_inputs
    left = 1.0 if zippered else 1 - own / n_sets  # zippered: what experiments differ by does not jump
    strange = left > 0 and warn_of_unequal(record, spectra, part, level, left)
    if strange or fit is None or zippered or warn_of_jumping_outputs(record, frf, fit, level) or len(frf.each) > 1:
        return level
    return with_lines_apart(record, spectra, frf, fit, level)


def with_lines_apart(
    record: Record, spectra: ChannelSpectra, frf: MatrixFrf, fit: LocalMatrix, level: MatrixLevel
) -> MatrixLevel:
    """The level of one set, with what single lines stand out by, as they do where the mains hum."""
    grid, cov = record.lines, level.cov.copy()
    gamma = np.einsum("iik->ik", frf.gamma).real
    where, f = place_lines(grid), grid.excited * record.f0
    for j, name in enumerate(record.outputs):
        own, rounding = cov[j, j].real, ROUNDING**2 * float(power(spectra.Y[j]).max())
        apart = warn_of_lines_apart(frf.G[j], fit.G[j], own + rounding, where, f, gamma, f"G of {name}")
        cov[j, j] = np.maximum(own, apart)
    return replace(level, cov=cov)


def warn_of_jumping_outputs(record: Record, frf: MatrixFrf, fit: LocalMatrix, level: MatrixLevel) -> bool:
    """Warn of the first output whose row jumps from line to line: it belongs to other inputs."""
    gamma = np.einsum("iik->ik", frf.gamma).real
    rough = np.sum(np.abs(fit.residual) ** 2, axis=3).transpose(1, 2, 0) / fit.dof  # (n_y, n_u, F)
    for j, name in enumerate(record.outputs):
        size = np.abs(frf.G[j]) ** 2 / gamma
        if warn_of_jumps(
            np.mean(rough[j] / gamma, axis=0), level.cov[j, j].real, size.mean(axis=0), f"G of {name}", MIXED
        ):
            return True
    return False


def nothing(frf: MatrixFrf) -> MatrixLevel:
    """No level beside the scatter over sets: it weighs nothing."""
    F = frf.G.shape[2]
    return MatrixLevel(cov=np.zeros_like(frf.cov_scatter), dof=np.zeros(F), factor=np.ones(F))


def choose_source(level_from: str, grid: LineGrid, n_detection: int, R: int, n_periods: int) -> str:
    """Which source the level is taken from, with a warning where detection lines are passed over."""
    if level_from == "detection" and grid.odd.size < n_detection:
        raise ValueError(
            f"lines must hold at least n_detection = {n_detection} odd detection lines for "
            f'level_from="detection", got {grid.odd.size} on this {grid.kind} grid'
        )
    if n_periods < 2:
        data_warning("one period does not tell noise from distortion: noise counts as distortion; record two")
    if level_from != "auto":
        return level_from
    if calibrated(grid, n_detection):
        return "detection"
    if R >= ENOUGH:
        return "realizations"
    data_warning(
        f"the detection lines of this {grid.kind} grid do not calibrate; the level was taken from the roughness of the "
        "matrix, which reads too high where it bends within a few lines"
    )
    return "roughness"


def distortion_levels(record: Record, spectra: ChannelSpectra, part: Any) -> tuple[DistortionLevels, ...]:
    """What every output holds on each kind of line."""
    grid, f0 = record.lines, record.f0
    Yc, noise, _ = part
    std = np.sqrt(noise) if spectra.dY.shape[2] else np.full_like(noise, np.nan)
    where = {"excited": spectra.excited, "odd": spectra.odd, "even": spectra.even}
    return tuple(
        DistortionLevels(
            f_excited=grid.excited * f0,
            f_odd=grid.odd * f0,
            f_even=grid.even * f0,
            excited=spectra.Y[j][:, spectra.excited],
            odd=Yc[j][:, spectra.odd],
            even=Yc[j][:, spectra.even],
            **{f"noise_{kind}": std[j][at] for kind, at in where.items()},
        )
        for j in range(record.n_outputs)
    )
