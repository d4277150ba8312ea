"""`identify`: from a periodic record to the best linear approximation with its variances.

One realisation: the *fast* method, which reads the distortion on lines that were not excited. Several: the *robust*
method, which reads it from the scatter between realisations (Pintelon & Schoukens, 4.3).
"""

from __future__ import annotations

import warnings

import numpy as np

from nlfrf.bla import Bla
from nlfrf.calibration import LARGEST, grid_factor, variance_ratio
from nlfrf.checks import DataWarning, integer, one_of
from nlfrf.distortion import DistortionLevels, interpolate_frf, nearest_lines, whitened_level
from nlfrf.frf import Frf, average_frf
from nlfrf.lines import LineGrid
from nlfrf.record import Record
from nlfrf.roughness import roughness
from nlfrf.spectra import Spectra, period_spectra
from nlfrf.values import value

ENOUGH = 7  # realisations whose scatter alone is worth more than a roughness that reads too high at resonances


def identify(record: Record, *, transient: str = "auto", level_from: str = "auto", n_detection: int = 6) -> Bla:
    """Best linear approximation, noise and distortion of a system from one periodic record.

    Parameters
    ----------
    record : Record
        Input and output; one realisation is enough, two periods separate noise from distortion.
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
    Bla

    Raises
    ------
    ValueError
        Lines that carry no input, no detection lines where they were asked for, too few lines for any level.

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

    >>> from nlfrf.multisine import multisine
    >>> ms = multisine(fs=128, n_samples=128, f_min=1, f_max=19, rms=3**0.5, n_realizations=200, rng=1)
    >>> u = ms.u[:, None, :]
    >>> bla = identify(Record(u=u, y=u**3, fs=128, lines=ms.lines))
    >>> float(np.abs(bla.G - 8.25).max()) < float(bla.bound(0.999).max())
    True
    """
    one_of("transient", transient, ("auto", "none", "discard", "local"))
    one_of("level_from", level_from, ("auto", "detection", "roughness"))
    n_detection = integer("n_detection", n_detection, least=3)
    spectra, treatment = period_spectra(record, transient)
    excited = spectra.on(record.lines.excited)
    refuse_unexcited(excited)
    frf = average_frf(excited)
    odd, even = (detection_lines(spectra, frf, record.lines, lines) for lines in (record.lines.odd, record.lines.even))
    source = level_source(level_from, excited, odd, record.lines, n_detection)
    if source == "detection":
        level = level_from_detection(excited, odd, frf, record.lines, n_detection)
    elif source == "roughness":
        level = level_from_roughness(excited, frf, record.lines)
    else:
        level = no_level(record.lines)
    return assembled(record, treatment, excited, frf, odd, even, source, level, n_detection)


@value
class Level:
    """Variance of one realisation's FRF by everything but its BLA, from one source.

    Fields: variance (F,); dof (F,), complex degrees of freedom; grid_factor (F,).
    """

    variance: np.ndarray
    dof: np.ndarray
    grid_factor: np.ndarray


@value
class Detection:
    """Output on detection lines, the linear answer taken off.

    Fields: lines (O,); G (O,) the FRF interpolated there; Yc (M, O) = Y - G U; noise (M, O), its variance by noise.
    """

    lines: np.ndarray
    G: np.ndarray
    Yc: np.ndarray
    noise: np.ndarray


def refuse_unexcited(excited: Spectra) -> None:
    """Refuse lines that carry no input: there G would be 0 / 0."""
    amplitude = np.abs(excited.U)
    silent = np.any(amplitude <= 1e-9 * amplitude.max(), axis=0)
    if silent.any():
        k = int(excited.lines[np.argmax(silent)])
        raise ValueError(f"lines must be excited by the input, got line {k} with no input on it")


def detection_lines(spectra: Spectra, frf: Frf, grid: LineGrid, lines: np.ndarray) -> Detection:
    """Y - G U on detection lines: a real actuator, or a loop, puts some input there too."""
    there = spectra.on(lines)
    G = interpolate_frf(frf.G, grid.excited, lines)
    noise = there.var_Y + np.abs(G) ** 2 * there.var_U - 2 * np.real(G.conj() * there.cov_YU)
    return Detection(lines=lines, G=G, Yc=there.Y - G * there.U, noise=np.maximum(noise, 0.0))


def level_source(level_from: str, excited: Spectra, odd: Detection, grid: LineGrid, n_detection: int) -> str:
    """Which source the level is taken from, with a warning where detection lines are passed over."""
    if level_from == "roughness":
        return "roughness"
    enough = odd.lines.size >= n_detection
    if level_from == "detection":
        if not enough:
            raise ValueError(
                f"lines must hold at least n_detection = {n_detection} odd detection lines for "
                f'level_from="detection", got {odd.lines.size} on this {grid.kind} grid'
            )
        return "detection"
    if enough and calibrates(excited, odd, grid, n_detection):
        return "detection"
    if excited.U.shape[0] >= ENOUGH:
        return "realizations"
    warnings.warn(why_roughness(grid, odd.lines.size, n_detection), DataWarning, stacklevel=3)
    return "roughness"


def calibrates(excited: Spectra, odd: Detection, grid: LineGrid, n_detection: int) -> bool:
    """Whether odd detection lines tell the level within a known factor on this grid."""
    kind = grid.kind
    if kind in ("special-odd", "random-odd"):
        return True
    if kind != "custom" or np.any(grid.excited % 2 == 0):
        return False
    window = nearest_lines(grid.excited, odd.lines, n_detection)
    ratio = variance_ratio(rms(excited.U), grid.excited, odd.lines, window)
    return bool(np.mean(ratio <= LARGEST) >= 0.95)


def why_roughness(grid: LineGrid, n_odd: int, n_detection: int) -> str:
    """The warning that goes with a level from the roughness."""
    kind = grid.kind
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
    return (
        f"{reason}; the level was taken from the roughness of the FRF, which reads too high where the FRF bends within "
        "a few lines. A special-odd or random-odd multisine gives a level that can be calibrated."
    )


def level_from_detection(excited: Spectra, odd: Detection, frf: Frf, grid: LineGrid, n_detection: int) -> Level:
    """From the odd lines that were not excited; noise is left in, as it covers better than noise added apart."""
    window = nearest_lines(grid.excited, odd.lines, n_detection)
    total = whitened_level(np.mean(np.abs(odd.Yc) ** 2, axis=0), odd.G, frf.G, window)
    noise = whitened_level(np.nan_to_num(odd.noise.mean(axis=0)), odd.G, frf.G, window)
    factor = grid_factor(rms(excited.U), rms(excited.Y), grid.excited, odd.lines, window)
    variance = np.maximum(factor * total - (factor - 1) * noise, total) / rms(excited.U) ** 2
    dof = np.full(grid.excited.size, window.shape[1] * excited.U.shape[0])
    return Level(variance=variance, dof=dof, grid_factor=factor)


def level_from_roughness(excited: Spectra, frf: Frf, grid: LineGrid) -> Level:
    """From the roughness of each realisation's FRF over the excited lines."""
    variance, dof = roughness(frf.each, np.abs(excited.U), grid.excited)
    return Level(variance=variance.mean(axis=0), dof=dof.sum(axis=0), grid_factor=np.ones(grid.excited.size))


def no_level(grid: LineGrid) -> Level:
    """None beside the scatter over realisations: it weighs nothing."""
    zeros = np.zeros(grid.excited.size)
    return Level(variance=zeros, dof=zeros, grid_factor=np.ones(grid.excited.size))


def rms(x: np.ndarray) -> np.ndarray:
    """Root mean square modulus over realisations."""
    return np.asarray(np.sqrt(np.mean(np.abs(x) ** 2, axis=0)))


def assembled(
    record: Record,
    treatment: str,
    excited: Spectra,
    frf: Frf,
    odd: Detection,
    even: Detection,
    source: str,
    level: Level,
    n_detection: int,
) -> Bla:
    """The `Bla` from its parts; with M >= 2 the scatter over realisations, pooled with the level for the bound."""
    grid, n = record.lines, record.n_realizations
    n_periods = record.n_periods - (treatment == "discard")
    factor = level.grid_factor
    if n == 1:
        var_total = var_bound = level.variance
        dof = level.dof
    else:
        var_total = frf.var_total
        dof = n - 1 + level.dof
        var_bound = ((n - 1) * var_total + level.dof * level.variance / n) / dof
        source = source if source == "realizations" else f"realizations and {source}"
        factor = np.ones(grid.excited.size)
    if n_periods > 1:
        var_total, var_bound = np.maximum(var_total, 0.0), np.maximum(var_bound, 0.0)
        var_distortion = n * np.maximum(var_total - frf.var_noise, 0.0)
    else:
        var_distortion = n * var_total
    var_even = np.full(grid.excited.size, np.nan)
    if even.lines.size:
        window = nearest_lines(grid.excited, even.lines, n_detection)
        power = np.mean(np.abs(even.Yc) ** 2, axis=0)
        var_even = whitened_level(power, even.G, frf.G, window) / rms(excited.U) ** 2
    return Bla(
        f=grid.excited * record.f0,
        G=frf.G,
        lines=grid,
        grid=grid.kind,
        fs=record.fs,
        n_samples=record.n_samples,
        n_realizations=n,
        n_periods=n_periods,
        transient=treatment,
        level_source=source,
        var_noise=frf.var_noise,
        var_total=var_total,
        var_distortion=var_distortion,
        var_even=var_even,
        dof=dof.astype(float),
        grid_factor=factor,
        levels=DistortionLevels(
            f_excited=grid.excited * record.f0,
            f_odd=odd.lines * record.f0,
            f_even=even.lines * record.f0,
            excited=excited.Y,
            odd=odd.Yc,
            even=even.Yc,
            noise_excited=np.sqrt(excited.var_Y.mean(axis=0)),
            noise_odd=np.sqrt(odd.noise.mean(axis=0)),
            noise_even=np.sqrt(even.noise.mean(axis=0)),
        ),
        var_bound=var_bound,
    )
