"""Time columns whose steps vary by more than jitter: two rates, the steps of a solver, rows of other events.

Rows belong to an even clock as long as their times stay near one straight line over the rows, whatever each of them
jitters: moments that a computer noted late, or printed coarsely, come back to it. Where they do not come back, the mean
step is the clock of no row.
"""

from __future__ import annotations

import numpy as np

from nlfrf._base.arguments import format_count
from nlfrf._base.numbers import iterate_blocks
from nlfrf._base.values import value

N_ROWS, N_PARTS = 4096, 64  # rows that show whether the clock wanders, in so many parts of the record
MAX_WANDER = 0.5  # of a sample: further from the line for good, rows are not those of an even clock
MIN_SLOPE = 1e-3  # change of rate from part to part: quartz clocks differ, and drift, by a tenth of it at most
ODD_STEP, WINDOW = 0.25, 8  # of a sample: a step that may move all later rows; rows on either side that show whether
MAX_ODD_SHARE = 0.3  # of the steps: with more the rate is what varies
MAX_NAMED = 3  # places that a message names


@value(in_sentences=True)
class UnevenClock:
    """A time column that no even clock has written.

    Fields
    ------
    seconds : (n,) ndarray
        Time of each row [s].
    fs : float
        Sampling frequency of the usual steps [Hz].
    rows : (k,) ndarray of int
        Rows from which on the time leaves the line of the rows before.
    """

    seconds: np.ndarray
    fs: float
    rows: np.ndarray

    def filled(self, stream: np.ndarray) -> np.ndarray:
        """Return streams (..., n) at the usual rate, by a cubic spline through their rows; of equal times the last."""
        from scipy.interpolate import CubicSpline

        finite = np.isfinite(self.seconds) & np.isfinite(stream).reshape(-1, self.seconds.size).all(axis=0)
        t, x = self.seconds[finite], stream[..., finite]
        later = np.append(np.diff(np.maximum.accumulate(t)) > 0, True)
        grid = np.arange(int((t[-1] - t[0]) * self.fs + 1e-6) + 1) / self.fs
        filled = CubicSpline(t[later] - t[0], x[..., later], axis=-1)(grid)
        filled.flags.writeable = False
        return np.asarray(filled)

    def describe(self, n_samples: int = 0) -> str:
        """Describe how the steps vary, and where.

        >>> t = np.arange(1000) / 100
        >>> found = find_uneven_clock(np.insert(t, 501, 5.004), 100.0)
        >>> found.describe()
        'the steps of the time column vary from 0.004 to 0.01 s, usually 0.01 s: no even clock from 5.004 s on'
        """
        steps = np.diff(self.seconds)
        places = ", ".join(f"{self.seconds[row]:.9g}" for row in self.rows[:MAX_NAMED])
        more = f" and {format_count(self.rows.size - MAX_NAMED, 'place')} more" * (self.rows.size > MAX_NAMED)
        return (
            f"the steps of the time column vary from {steps.min():.4g} to {steps.max():.4g} s, usually "
            f"{1 / self.fs:.6g} s: no even clock from {places} s{more} on"
        )


def find_uneven_clock(seconds: np.ndarray | None, fs: float) -> UnevenClock | None:
    """Return where a time column leaves an even clock for good; None where it does not, or has no usual step.

    Parameters
    ----------
    seconds : (n,) ndarray, optional
        The time of each row [s].
    fs : float
        Sampling frequency by its mean step [Hz].
    """
    if seconds is None or seconds.size < 4 * WINDOW or not fs > 0 or not np.isfinite(seconds).all():
        return None
    n = seconds.size
    step = float(np.polyfit(ends := np.linspace(0, n - 1, min(n, N_ROWS)).astype(int), seconds[ends], 1)[0])
    if not step > 0:
        return None

    def offset(rows: np.ndarray) -> np.ndarray:
        return np.asarray((seconds[rows] - seconds[0]) / step - rows)

    odd, n_moving = [], 1
    for some in iterate_blocks(n - 1):
        steps = np.diff(seconds[some.start : some.stop + 1])
        n_moving += int(np.count_nonzero(steps))
        odd.append(np.flatnonzero(np.abs(steps / step - 1) > ODD_STEP) + some.start + 1)
    candidates = np.concatenate(odd)
    leaving = np.zeros(0, dtype=int)
    if candidates.size < MAX_ODD_SHARE * n:
        inside = candidates[(candidates >= WINDOW) & (candidates <= n - WINDOW)]
        sides = offset(inside[:, None] + np.arange(-WINDOW, WINDOW)).reshape(-1, 2, WINDOW)
        shift = np.abs(np.diff(np.median(sides, axis=2), axis=1)[:, 0])
        leaving = inside[shift > np.maximum(MAX_WANDER, np.ptp(sides, axis=2).max(axis=1))]
        leaving = leaving[np.diff(leaving, prepend=-n) > WINDOW]
    if not leaving.size:  # of times that are printed coarsely several are in each part
        size = min(n, max(N_ROWS // N_PARTS, WINDOW * (n // n_moving + 1)))
        starts = np.linspace(0, n - size, N_PARTS).astype(int)
        places = offset(starts[:, None] + np.arange(size))
        middle, scatter = np.median(places, axis=1), float(np.median(np.ptp(places, axis=1)))
        change = np.abs(np.diff(middle)) > MIN_SLOPE * np.diff(starts)
        if np.ptp(middle) > max(MAX_WANDER, scatter) and change.any():
            leaving = starts[1:][change][:1]
    if not leaving.size:
        return None
    steps = np.diff(seconds)
    usual = float(np.median(steps[steps > 0]))
    usual = float(np.mean(steps[np.abs(steps - usual) < ODD_STEP * usual]))
    return UnevenClock(seconds=seconds, fs=float(f"{1 / usual:.6g}"), rows=leaving)
