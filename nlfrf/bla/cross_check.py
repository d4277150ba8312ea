"""Two estimates of the distortion variance of one record: from detection lines, and from the
roughness of the FRF, which is its scatter between neighbouring lines.

Pintelon & Schoukens, 2nd ed., 4.3 and 7.2.2. The two estimates fail for different reasons.
Detection lines need a steady record, and a grid for which their ratio to the excited lines is
known. Roughness needs an FRF that is smooth over a few lines. The phases on the detection lines
show the order of the nonlinearity: a cubic of the input gives them the phases of the cubed input.
"""

from __future__ import annotations

import numpy as np

from nlfrf._base.arguments import (
    ratio_unit,
    require_choice,
    require_integer,
    require_kind,
    require_one_channel,
)
from nlfrf._base.numbers import (
    BLOCK_ENTRIES,
    EPS,
    TINY,
    fast_length,
    mean_power,
    power,
    rms,
    squared_modulus,
)
from nlfrf._base.values import value
from nlfrf.bla.distortion import fit_sets, variance_from_detection_lines
from nlfrf.bla.experiment_checks import check_experiments
from nlfrf.bla.frf import estimate_frm
from nlfrf.bla.line_index import SMOOTHING_LINES, index_lines
from nlfrf.bla.residual import NonlinearResidual, nonlinear_residual
from nlfrf.bla.spectra import TREATMENTS, Spectra, period_spectra
from nlfrf.records.record import Record
from nlfrf.signals.lines import chance_correlation, local_mean

DISAGREEMENT_DB = 6.0  # [dB]
_MIN_DETECTION_LINES = 4

_MIN_RELATIVE_LEVEL = 1e-12  # share of the largest power below which a power is rounding
_FALSE_ALARM_PROBABILITY = 1e-3  # probability that phases agree by chance
_MIN_SIGNAL_SHARE = 0.7  # least share of the power on detection lines above the noise
_MIN_POWER_LAW_COHERENCE = (
    0.6  # least coherence with a power of the source; below it the law is flatter
)
_SAMPLES_PER_CYCLE = 6  # samples per cycle of the last line, so that fifth powers alias beyond it
_SOURCE_TEXTS = (
    "the input, before the dynamics",
    "the output, fed back as by a spring",
    "the input, in parallel with the dynamics",
    "the output, behind the dynamics as by a sensor",
)
# remainder of the cube over that of the fifth power, below which the law is a cubic
_MAX_CUBIC_REMAINDER_RATIO = 0.35
_MIN_FIFTH_COHERENCE = 0.8  # least coherence with a fifth power for a law that is no cubic


@value
class SecondOpinion:
    """Two estimates of the distortion of one record, as variances of the FRF of one realisation.

    Fields
    ------
    f : (F,) ndarray
        Excited frequencies [Hz].
    detection : (F,) ndarray
        Variance from the odd detection lines (lines without excitation), corrected for the grid;
        nan if the grid has too few.
    roughness : (F,) ndarray
        Variance from the scatter of the FRF between neighbouring excited lines.
    difference : (F,) ndarray
        Ratio of `roughness` to `detection` [dB], averaged over nine neighbouring lines.
    unit : str
        Unit of G, if the record states one.
    law : str
        Order of the nonlinearity, in words, found from the phases on the odd detection lines; empty
        if unknown.

    References
    ----------
    Pintelon & Schoukens, 2nd ed., 4.3 (detection lines); 7.2.2 (local polynomials).

    Examples
    --------
    >>> import nlfrf
    >>> ms = nlfrf.multisine(fs=128, n_samples=128, f_min=1, f_max=40, rng=1)
    >>> record = nlfrf.Record(u=ms.u[None], y=2 * ms.u[None] + 0.1 * ms.u[None] ** 3, fs=128, lines=ms.lines)
    >>> opinion = nlfrf.second_opinion(record)
    >>> bool(np.all(opinion.roughness > 0)), opinion.disagree.shape == opinion.f.shape
    (True, True)
    """

    f: np.ndarray
    detection: np.ndarray
    roughness: np.ndarray
    difference: np.ndarray
    unit: str = ""
    law: str = ""

    @property
    def disagree(self) -> np.ndarray:
        """(F,) bool: lines on which the two estimates differ by more than 6 dB."""
        return np.abs(self.difference) > DISAGREEMENT_DB

    def __str__(self) -> str:
        """Describe the agreement of the two, and the usual reasons for a difference."""
        if not np.isfinite(self.difference).any():
            return (
                "second opinion: no comparison, because this grid has too few odd detection lines"
            )
        median = np.median(self.difference)
        rows = [
            (
                f"second opinion: the variance from roughness is {median:+.1f} dB relative to that from"
                " detection lines, in the median"
            )
        ]
        for wrong, meaning in (
            (
                self.difference > DISAGREEMENT_DB,
                (
                    "the FRF itself changes within a few lines there (a longer period would"
                    " show it), or this distortion is not on the detection lines"
                ),
            ),
            (
                self.difference < -DISAGREEMENT_DB,
                (
                    "the detection lines contain other power than distortion of this input: a"
                    " disturbance, a transient, or a multisine other than the assumed one; or"
                    " the factor from detection to excited lines, at most 3, is too large here"
                ),
            ),
        ):
            if wrong.any():
                more = "more" if self.difference[wrong][0] > 0 else "less"
                rows.append(
                    f"  roughness gives over 6 dB {more} at"
                    f" {_format_frequency_ranges(self.f, wrong)}: {meaning}"
                )
        if len(rows) == 1:
            rows[0] += "; they differ by less than 6 dB on every line"
        if self.law:
            rows.append(f"  {self.law}")
        return "\n".join(rows)


def second_opinion(
    record: Record, *, transient: str = "auto", n_detection: int = 6
) -> SecondOpinion:
    """Estimate the distortion of a record by two methods that fail for different reasons.

    One method uses the detection lines (lines without excitation). The other uses the scatter of
    the frequency response (FRF) between neighbouring lines. Use this if a bound looks too wide or
    too narrow: the printed result names the lines on which the estimates differ, and the usual
    reasons.

    Parameters
    ----------
    record : Record
    transient, n_detection
        As in `identify`.

    Returns
    -------
    SecondOpinion

    Raises
    ------
    ValueError
        As in `identify`; also if the record has several inputs or outputs, or fewer than five
        excited lines.

    References
    ----------
    Pintelon & Schoukens, 2nd ed., 4.3 (detection lines); 7.2.2 (local polynomials).

    Examples
    --------
    >>> from nlfrf.signals.multisine import multisine
    >>> u = multisine(fs=1024, n_samples=1024, f_min=1, f_max=200, rng=1)
    >>> opinion = second_opinion(Record(u=u.u[None], y=u.u[None] ** 3, fs=1024, lines=u.lines))
    >>> bool(abs(np.median(opinion.difference)) < 3)
    True
    """
    require_kind("record", record, Record)
    require_one_channel(
        "record",
        record,
        ": for several channels identify weighs detection lines and roughness itself",
    )
    require_choice("transient", transient, TREATMENTS)
    n_detection = require_integer("n_detection", n_detection, least=3)
    grid = record.lines
    index = index_lines(grid, n_detection)
    spectra, _ = period_spectra(record, index, transient=transient)
    spectra, excited, _ = check_experiments(record, spectra)
    frm = estimate_frm(excited)
    fit, gamma = fit_sets(frm, excited), frm.gamma_of_set[0]
    rough = fit.variance.mean(axis=0)[0, 0]
    detected, law = np.full(rough.size, np.nan), ""
    if grid.odd.size >= n_detection:
        residual = nonlinear_residual(spectra, excited, measured=frm.G, smooth=fit.G.mean(axis=0))
        detected = variance_from_detection_lines(excited, residual, frm) * gamma
        law = _detect_nonlinearity(excited, residual).describe(
            residual.gain_varies[0], record.n_periods < 2
        )
    window = index.excited_windows
    # rounding of the FRF, or of a very small output, is no disagreement
    rounding = EPS**2 * mean_power(spectra.Y[0]).sum() / rms(excited.U[0]) ** 2
    floor = TINY + 1e-24 * rms(frm.G_each[:, 0, 0]) ** 2 + rounding
    difference = 10 * np.log10(
        (rough + floor)[window].mean(axis=1) / (detected + floor)[window].mean(axis=1)
    )
    return SecondOpinion(
        f=grid.excited * record.f0,
        detection=detected,
        roughness=rough,
        difference=difference,
        unit=ratio_unit(record.y_unit, record.u_unit),
        law=law,
    )


@value(copy=False)
class _NonlinearityOrder:
    """Order of the nonlinearity, by the phases of the odd detection lines."""

    # 3: a cubic. 5: may be a fifth power. 1: flatter than any power: saturation, jump or memory. 0:
    # unknown.
    order: int = 0
    coherence: float = 0.0  # squared coherence of these lines with the cube of their source
    # source and place: the input (0, 2) or the output (1, 3), before the dynamics (0, 1) or behind
    # them
    hypothesis: int = 0

    def describe(self, gain_varies: bool, one_period: bool) -> str:
        """Describe the order, and its source if |G| varies over the band; empty if the order is
        unknown.
        """
        if self.order == 3:
            if gain_varies:
                what = _SOURCE_TEXTS[self.hypothesis]
            else:
                what = "its drive"
            return (
                f"the odd distortion is cubic: {100 * self.coherence:.0f} % of it is coherent with"
                f" the cube of {what}"
            )
        otherwise = ", or noise hides its order" if one_period else ""
        return {
            5: "the odd distortion fits a fifth power as well as a cube",
            1: (
                "the odd distortion fits no power law: the machine saturates, jumps or has a"
                f" memory{otherwise}"
            ),
        }.get(self.order, "")


_UNKNOWN_ORDER = _NonlinearityOrder()


def _detect_nonlinearity(excited: Spectra, residual: NonlinearResidual) -> _NonlinearityOrder:
    """Find the power of the input, or of the output, whose phases match those of the odd detection
    lines.

    The lines are scaled to one power, so that only phases count, over all lines and realisations.
    The squared coherence is corrected for chance and for noise.

    Parameters
    ----------
    excited : Spectra
        Spectra on the excited lines.
    residual : NonlinearResidual
    """
    index = excited.index
    U = excited.U[
        0, : max(1, BLOCK_ENTRIES // (_SAMPLES_PER_CYCLE * int(index.lines[-1])))
    ]  # for long periods few realisations suffice
    Y = residual.Y[0, : len(U)].take(index.odd, axis=1)
    n = Y.size
    if index.odd.size < _MIN_DETECTION_LINES or not Y.any():
        return _UNKNOWN_ORDER
    candidates = np.empty(
        (2, 2, 2, *Y.shape), dtype=complex
    )  # by G or behind it; input, output; cube, fifth power
    G = residual.G[0, 0]
    candidates[1] = _odd_powers_on_lines(
        index.lines[index.odd], [U, G.take(index.excited) * U], excited.lines
    )
    np.multiply(G.take(index.odd), candidates[1], out=candidates[0])
    level = _smooth_power(mean_power(Y))
    noise = local_mean(np.nan_to_num(residual.noise[0].take(index.odd)), SMOOTHING_LINES)
    signal_share = np.maximum(1 - noise / level, 0.0)  # weight of a line: its share above the noise
    share = float(signal_share.mean())
    if share < _MIN_SIGNAL_SHARE:
        return _UNKNOWN_ORDER
    y = Y / np.sqrt(level)
    levels = _smooth_power(np.add.reduce(squared_modulus(candidates), axis=-2))
    x = candidates * np.sqrt(signal_share / levels)[..., None, :]
    common = squared_modulus(np.add.reduce(np.vecdot(x, y), axis=-1))
    common /= np.add.reduce(power(x), axis=-1) * power(y).sum() + TINY
    if common.max() < chance_correlation(_FALSE_ALARM_PROBABILITY, n):
        return _UNKNOWN_ORDER
    common = np.clip((common * n - 1) / (n - 1) / share, 0.0, 1.0)
    cubes, fifths = common[..., 0].ravel(), common[..., 1].ravel()
    reading = int(cubes.argmax())
    cube, fifth = float(cubes[reading]), float(fifths.max())
    if max(cube, fifth) < _MIN_POWER_LAW_COHERENCE:
        order = 1
    elif 1 - cube < _MAX_CUBIC_REMAINDER_RATIO * (1 - fifth):
        order = 3
    else:
        order = 5 if fifth > _MIN_FIFTH_COHERENCE else 0
    return _NonlinearityOrder(order=order, coherence=cube, hypothesis=reading)


def _smooth_power(power: np.ndarray) -> np.ndarray:
    """Return the mean power (..., K) over the lines around each, floored above the rounding of
    running sums.
    """
    return (
        np.maximum(
            local_mean(power, SMOOTHING_LINES),
            _MIN_RELATIVE_LEVEL * power.max(axis=-1, keepdims=True),
        )
        + TINY
    )


def _odd_powers_on_lines(
    lines: np.ndarray, sources: list[np.ndarray], excited: np.ndarray
) -> np.ndarray:
    """Return (sources, 2, M, K) third and fifth powers of multisines of amplitudes (M, F), on
    `lines`.
    """
    last = int(max(excited[-1], lines[-1]))
    n = 2 * fast_length(
        _SAMPLES_PER_CYCLE // 2 * last + 1
    )  # higher terms alias onto lines beyond the last one
    spectrum = np.zeros((len(sources), *sources[0].shape[:-1], n // 2 + 1), dtype=complex)
    for one, drive in zip(spectrum, sources, strict=True):
        one[:, excited] = drive / np.sqrt(power(drive).sum() + TINY)
    x = np.fft.irfft(spectrum, n, norm="forward")
    square = x * x
    both = np.stack([x * square, x * square * square], axis=1)
    return np.fft.rfft(both).take(lines, axis=-1)


def _format_frequency_ranges(f: np.ndarray, mask: np.ndarray) -> str:
    """Format the frequencies of a mask as a few ranges."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    pairs = [(f[a], f[b - 1]) for a, b in edges.reshape(-1, 2)]
    shown = [f"{a:g} Hz" if a == b else f"{a:g} to {b:g} Hz" for a, b in pairs[:4]]
    return ", ".join(shown) + (f" and {len(pairs) - 4} more" if len(pairs) > 4 else "")
