"""Rows that a logger lost, as the time column of its file shows them, and the periods that are whole all the same.

Behind a lost row every sample stands one early. Cut by counting, all later periods are out of place; cut by their
times, all periods but the one with the hole are as good as before.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from nlfrf.files.stored_records import Asked
from nlfrf.records.period import detect_period
from nlfrf.records.reference import played_period
from nlfrf.shared.arguments import data_warning, integer
from nlfrf.shared.transforms import all_finite
from nlfrf.shared.values import value
from nlfrf.shared.wording import in_words, listed

__all__ = ["LostRows", "find_lost_rows", "keep_whole_periods"]

UNEVEN = 0.25  # of a sample: a step further from a whole number of samples shows a clock that jitters, not a lost row
WHOLE = 0.1  # of a sample: a period further from a whole number of samples is none
NAMED = 3  # jumps that a message names


@value
class LostRows:
    """Where the rows of a file stand on an even clock.

    Fields
    ------
    place : (n,) ndarray of int
        The sample that each row is, counted from the first one.
    moments : (n,) ndarray
        Its time [s].
    fs : float
        Sampling frequency [Hz].
    """

    place: np.ndarray
    moments: np.ndarray
    fs: float

    @property
    def n_places(self) -> int:
        """Samples from the first row to the last, lost ones included."""
        return int(self.place[-1]) + 1

    def filled(self, stream: np.ndarray) -> np.ndarray:
        """(n_places,) a stream with straight lines over what is lost: good enough to find its period, no more."""
        return np.asarray(np.interp(np.arange(self.n_places), self.place, stream))

    def whole_periods(self, n_samples: int) -> np.ndarray:
        """Numbers of the periods, from 0, in which no row is lost."""
        count = np.bincount(self.place // n_samples, minlength=1)
        return np.flatnonzero(count == n_samples)

    def kept(self, stream: np.ndarray, n_samples: int, n_discard: int) -> np.ndarray:
        """The whole periods of streams (..., n), one behind the other, but for the first `n_discard` of the record."""
        period = self.place // n_samples
        whole = self.whole_periods(n_samples)
        kept = np.ascontiguousarray(stream[..., np.isin(period, whole[whole >= n_discard])])
        kept.flags.writeable = False
        return kept

    def __str__(self) -> str:
        steps = np.diff(self.place)
        jumps = np.flatnonzero(steps > 1)
        said = [
            f"time jumps by {in_words(int(steps[j]), 'sample')} at {self.moments[j] + 1 / self.fs:.9g} s: "
            f"{in_words(int(steps[j]) - 1, 'sample')} lost"
            for j in jumps[:NAMED]
        ]
        more = jumps.size - NAMED
        return "; ".join(said + [f"and {in_words(more, 'such jump')} more"] * (more > 0))

    def describe(self, n_samples: int) -> str:
        """The same, with the periods that are whole.

        >>> place = np.delete(np.arange(30), 14)
        >>> LostRows(place=place, moments=place / 10, fs=10.0).describe(10)
        'time jumps by two samples at 1.4 s: one sample lost; periods 1 and 3 are whole'
        """
        whole = [str(j + 1) for j in self.whole_periods(n_samples)]
        if not whole:
            return f"{self}; no period is whole"
        named = f"period {whole[0]} is" if len(whole) == 1 else f"periods {listed(whole)} are"
        return f"{self}; {named} whole"


def find_lost_rows(seconds: np.ndarray | None, fs: float) -> LostRows | None:
    """Read from a time column which rows are lost; None where none is, or where the column does not show it.

    Parameters
    ----------
    seconds : (n,) ndarray, optional
        The time of each row [s].
    fs : float
        Sampling frequency [Hz].

    Returns
    -------
    LostRows or None
        None of a column whose steps are no whole numbers of samples, as moments that a computer noted, and where more
        is lost than is there.
    """
    if seconds is None or not fs > 0 or seconds.size < 2:
        return None
    steps = np.diff(seconds) * fs
    whole = np.round(steps)
    if not np.isfinite(steps).all() or whole.min() < 1 or whole.max() == 1 or np.abs(steps - whole).max() > UNEVEN:
        return None
    place = np.concatenate([[0], np.cumsum(whole)])
    return LostRows(place=place.astype(int), moments=seconds, fs=fs) if place[-1] < 2 * seconds.size else None


def keep_whole_periods(
    times: Sequence[np.ndarray | None],
    groups: Sequence[list[np.ndarray]],
    excitation: np.ndarray,
    fs: float,
    asked: Asked,
    paths: Sequence[str],
) -> Asked:
    """Leave out of streams, in place, the periods in which a time column shows that rows are lost.

    `resample` looks where the input shows that the periods stand, and is left alone.

    Parameters
    ----------
    times : sequence of (n,) ndarray or None
        Time of each row [s], of each file.
    groups : sequence of list of (..., n) ndarray
        The streams of each signal, of each file.
    excitation : (n,) ndarray
        Input or reference of the first file.
    fs : float
        Sampling frequency [Hz].
    asked : Asked
        How they are to be cut.
    paths : sequence of str
        The files.

    Returns
    -------
    Asked
        How what is left is to be cut.

    Raises
    ------
    ValueError
        A file in which no period is whole.
    """
    lost = [find_lost_rows(seconds, fs) for seconds in times]
    if not any(lost) or asked.resample:
        return asked
    sizes = {stream.shape[-1] for group in groups for stream in group[:1]}
    if len(sizes) > 1 or not all(all_finite(stream) for group in groups for stream in group):
        return asked  # refused, or cut at its ends, where the streams are held against each other
    n_samples = asked.n_samples
    if n_samples is None and asked.design is not None:
        n_samples = played_period(asked.design, fs)
    elif n_samples is None:
        found = detect_period(excitation if lost[0] is None else lost[0].filled(excitation))
        n_samples = round(found)
        if abs(found - n_samples) > WHOLE:
            return asked  # refused where it is looked for again
    n_samples, n_discard = integer("n_samples", n_samples, least=4), integer("n_discard", asked.n_discard, least=0)
    for m, rows in enumerate(lost):
        if rows is not None:
            said = f"{Path(paths[m]).name!r}: {rows.describe(n_samples)}"
            if not np.any(rows.whole_periods(n_samples) >= n_discard):
                raise ValueError(
                    f"u and y must hold a whole period of n_samples = {n_samples} samples after "
                    f"n_discard = {n_discard}, got {said}; measure again, "
                    "or let resample=True look for periods"
                )
            data_warning(f"{said}, and kept; the others are left out")
        for group in groups:
            cut = n_discard * n_samples
            group[m] = group[m][..., cut:] if rows is None else rows.kept(group[m], n_samples, n_discard)
    return asked._replace(n_samples=n_samples, n_discard=0)
