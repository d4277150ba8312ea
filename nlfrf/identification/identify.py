"""`identify`: from a periodic record to the best linear approximation with its variances.

One realisation: the *fast* method, which reads the distortion on lines that were not excited. Several: the *robust*
method, which reads it from the scatter between realisations (Pintelon & Schoukens, 4.3).
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import overload

import numpy as np

from nlfrf.excitation.lines import LineGrid
from nlfrf.identification.bla import Bla, DistortionLevels
from nlfrf.identification.distortion_level import (
    ENOUGH,
    calibrates,
    even_variance,
    fit_each,
    level_from_detection,
    level_from_roughness,
    no_level,
    nonlinear_answer,
    why_roughness,
)
from nlfrf.identification.frf import average_frf
from nlfrf.identification.leastsquares import squared
from nlfrf.identification.neighbours import layout
from nlfrf.identification.spectra import Spectra, dft, period_spectra
from nlfrf.records.record import Record
from nlfrf.shared.arguments import DataWarning, integer, one_of

__all__ = ["identify"]


N_PARTS = 8  # of the band, over which the input power of realisations is compared
STRANGE = 2.0  # how far it may be apart [dB] in realisations that belong together


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
        Lines that carry no input, realisations whose input spectra do not belong together, no detection lines where
        they were asked for, too few lines for any level.

    Warns
    -----
    DataWarning
        The grid has no detection lines that can be calibrated, and the level comes from the roughness.

    References
    ----------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., 4.3.

    Examples
    --------
    A static cubic: the BLA on these six lines of amplitude 1 is 8.25, but one realisation scatters about it.

    >>> from nlfrf.excitation.multisine import multisine
    >>> ms = multisine(fs=128, n_samples=128, f_min=1, f_max=19, rms=3**0.5, n_realizations=200, rng=1)
    >>> u = ms.u[:, None, :]
    >>> bla = identify(Record(u=u, y=u**3, fs=128, lines=ms.lines))
    >>> float(np.abs(bla.G - 8.25).max()) < float(bla.bound(0.999).max())
    True
    """
    one_of("transient", transient, ("auto", "none", "discard", "local"))
    one_of("level_from", level_from, ("auto", "detection", "roughness"))
    n_detection = integer("n_detection", n_detection, least=3)
    if isinstance(record, Record):
        return identified(record, None, transient, level_from, n_detection)
    known: list[tuple[Record, np.ndarray]] = []
    blas = []
    for one in record:
        U = next((U for other, U in known if other.u is one.u and other.lines is one.lines), None)
        if U is None:
            U = dft(one.u, layout(one.lines).lines)
            known.append((one, U))
        blas.append(identified(one, U, transient, level_from, n_detection))
    return blas


def identified(record: Record, U: np.ndarray | None, transient: str, level_from: str, n_detection: int) -> Bla:
    """`identify` for one record, with the spectra of its input where they are known."""
    spectra, treatment = period_spectra(record, transient, U)
    grid, n = record.lines, record.n_realizations
    where = layout(grid)
    excited = spectra.at(where.excited)
    refuse_unexcited(excited)
    if n > 1:
        refuse_strangers(excited)
    frf = average_frf(excited)
    source = level_source(level_from, excited, grid, n_detection)
    fit = fit_each(excited, frf, grid) if source == "roughness" else None
    answer = nonlinear_answer(spectra, frf, excited, grid, fit)
    if source == "detection":
        level, var_even = level_from_detection(excited, answer, grid, n_detection)
    else:
        level = no_level(grid.excited.size) if fit is None else level_from_roughness(fit)
        var_even = even_variance(excited, answer, grid, n_detection)
    if n == 1:
        var_total = var_bound = level.variance
        dof = level.dof
    else:
        var_total = frf.var_total
        dof = n - 1 + level.dof
        var_bound = ((n - 1) * var_total + level.dof * level.variance / n) / dof
        source = source if source == "realizations" else f"realizations and {source}"
    var_noise = frf.var_noise
    return Bla(
        f=grid.excited * record.f0,
        G=frf.G,
        lines=grid,
        grid=grid.kind,
        fs=record.fs,
        n_samples=record.n_samples,
        n_realizations=n,
        n_periods=record.n_periods - (treatment == "discard"),
        transient=treatment,
        level_source=source,
        var_noise=var_noise,
        var_total=var_total,
        # without periods to tell them apart, noise counts as distortion
        var_distortion=n * np.maximum(var_total - np.nan_to_num(var_noise), 0.0),
        var_even=var_even,
        dof=dof.astype(float),
        grid_factor=level.grid_factor if n == 1 else np.ones(grid.excited.size),
        levels=DistortionLevels(
            f_excited=grid.excited * record.f0,
            f_odd=grid.odd * record.f0,
            f_even=grid.even * record.f0,
            excited=excited.Y,
            odd=answer.Yc[:, where.odd],
            even=answer.Yc[:, where.even],
            noise_excited=np.sqrt(np.add.reduce(excited.var_Y) / n),
            noise_odd=np.sqrt(answer.noise[where.odd]),
            noise_even=np.sqrt(answer.noise[where.even]),
        ),
        var_bound=var_bound,
    )


def refuse_unexcited(excited: Spectra) -> None:
    """Refuse lines that carry no input, where G would be 0 / 0, or no reference, whose phase would be chance."""
    for name, spectrum in (("input", excited.U), ("reference", excited.R)):
        if spectrum is None:
            continue
        power = squared(spectrum)
        silent = (power <= 1e-18 * power.max()).any(axis=0)
        if silent.any():
            k = int(excited.lines[np.argmax(silent)])
            raise ValueError(f"lines must be excited by the {name}, got line {k} with no {name} on it")


def refuse_strangers(excited: Spectra) -> None:
    """Refuse realisations of another amplitude spectrum: their BLA is another one."""
    known = excited.U if excited.R is None else excited.R
    n_lines = known.shape[1]
    power = np.add.reduceat(squared(known), np.arange(0, n_lines, max(1, n_lines // N_PARTS)), axis=1)
    middle = np.sort(power, axis=0)[power.shape[0] // 2]
    apart = np.abs(10 * np.log10(power / middle)).max(axis=1)
    worst = int(np.argmax(apart))
    if apart[worst] > STRANGE:
        raise ValueError(
            f"u must have the same amplitude spectrum in every realisation, got realisation {worst} up to "
            f"{apart[worst]:.1f} dB apart from the others"
        )


def level_source(level_from: str, excited: Spectra, grid: LineGrid, n_detection: int) -> str:
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
    warnings.warn(why_roughness(grid, n_detection), DataWarning, stacklevel=4)
    return "roughness"
