"""A second opinion on the distortion level, from the same record: detection lines against the roughness of the FRF."""

from __future__ import annotations

import numpy as np

from nlfrf._base.arguments import integer, of_kind, one_of, ratio_unit
from nlfrf._base.numbers import EPS, TINY, mean_power, rms
from nlfrf._base.values import value
from nlfrf.bla.detection_lines import nonlinear_answer, told_law
from nlfrf.bla.distortion_level import fit_each, level_from_detection
from nlfrf.bla.frf import average_frf
from nlfrf.bla.neighbours import place_lines
from nlfrf.bla.realizations import check_realizations
from nlfrf.bla.spectra import TREATMENTS, period_spectra
from nlfrf.records.record import Record

__all__ = ["DISAGREE", "SecondOpinion", "second_opinion"]


DISAGREE = 6.0  # dB


@value
class SecondOpinion:
    """Two levels of the same distortion, as variances of one realisation's FRF, and where they part.

    Fields
    ------
    f : (F,) ndarray
        Excited frequencies [Hz].
    detection : (F,) ndarray
        Variance read on the odd detection lines, calibrated; nan where the grid has too few of them.
    roughness : (F,) ndarray
        Variance read from the roughness of the FRF over the excited lines.
    difference : (F,) ndarray
        Roughness over detection [dB], averaged over the nine lines around each.
    unit : str
        Unit of G, where the record says it.
    law : str
        What the phases of the odd detection lines tell of the law behind them; empty where they tell none.

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
        """(F,) bool: where the two differ by more than 6 dB."""
        return np.abs(self.difference) > DISAGREE

    def __str__(self) -> str:
        """Whether they agree, and what it usually means where they do not."""
        if not np.isfinite(self.difference).any():
            return "second opinion: this grid has too few odd detection lines to compare the roughness of the FRF with"
        median = np.median(self.difference)
        said = [f"second opinion: roughness over detection lines {median:+.1f} dB in the median"]
        for wrong, meaning in (
            (
                self.difference > DISAGREE,
                "the FRF bends within a few lines there (a finer resolution would tell), or the detection lines are "
                "blind to this distortion",
            ),
            (
                self.difference < -DISAGREE,
                "energy stands on detection lines that is no distortion of this input: a disturbance, a transient, or "
                "a multisine that was not the one assumed; or the calibration is at its cautious end (factor 3)",
            ),
        ):
            if wrong.any():
                more = "above" if self.difference[wrong][0] > 0 else "below"
                said.append(f"  more than 6 dB {more} at {spans(self.f, wrong)}: {meaning}")
        if len(said) == 1:
            said[0] += "; within 6 dB of each other at every line"
        if self.law:
            said.append(f"  {self.law}")
        return "\n".join(said)


def second_opinion(record: Record, *, transient: str = "auto", n_detection: int = 6) -> SecondOpinion:
    """Read the distortion level of a record twice, by means that fail for different reasons.

    Parameters
    ----------
    record : Record
    transient, n_detection
        As of `identify`.

    Returns
    -------
    SecondOpinion

    Raises
    ------
    ValueError
        As of `identify`; fewer than five excited lines.

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
    of_kind("record", record, Record)
    one_of("transient", transient, TREATMENTS)
    n_detection = integer("n_detection", n_detection, least=3)
    grid = record.lines
    where = place_lines(grid, n_detection)
    spectra, treatment = period_spectra(record, where, transient)
    spectra, excited, *_ = check_realizations(spectra, record, record.n_periods - (treatment == "discard"))
    frf = average_frf(excited)
    fit = fit_each(frf, excited)
    rough = fit.variance.mean(axis=0)
    detected, said = np.full(rough.size, np.nan), ""
    if grid.odd.size >= n_detection:
        answer = nonlinear_answer(spectra, fit.G.mean(axis=0))
        law = told_law(excited, answer)
        detected = level_from_detection(excited, answer, None, law=law).variance
        said = law.said(answer.uneven, record.n_periods < 2)
    window = where.near_excited
    # rounding is no disagreement, neither that of the FRF nor, where it is next to nothing, that of the output
    rounding = EPS**2 * mean_power(spectra.Y).sum() / rms(excited.U) ** 2
    floor = TINY + 1e-24 * rms(frf.each) ** 2 + rounding
    difference = 10 * np.log10((rough + floor)[window].mean(axis=1) / (detected + floor)[window].mean(axis=1))
    return SecondOpinion(
        f=grid.excited * record.f0,
        detection=detected,
        roughness=rough,
        difference=difference,
        unit=ratio_unit(record.y_unit, record.u_unit),
        law=said,
    )


def spans(f: np.ndarray, where: np.ndarray) -> str:
    """Frequencies where something holds, as a few ranges."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], where, [False]]).astype(int)))
    pairs = [(f[a], f[b - 1]) for a, b in edges.reshape(-1, 2)]
    shown = [f"{a:g} Hz" if a == b else f"{a:g} to {b:g} Hz" for a, b in pairs[:4]]
    return ", ".join(shown) + (f" and {len(pairs) - 4} more" if len(pairs) > 4 else "")
