"""Time columns with unequal steps: two rates, the steps of a solver, rows of other events.

The steps count as equal as long as the times stay near one straight line over the row number.
Single late or coarsely rounded times return to this line. If the times leave it for good, the steps
are unequal.
"""

from __future__ import annotations

import numpy as np

from nlfrf._base.arguments import format_count
from nlfrf._base.values import value

# parts of a record that show whether the clock wanders, and rows in each
_N_PARTS = 64
_PART_ROWS = 64
_DRIFT_ORDER = 3  # order of the polynomial by which two quartz clocks may drift apart
_MAX_WANDER = 0.5  # [samples] permanent distance above which rows do not belong to an even clock
_USUAL_STEP = 0.25  # largest relative difference of a usual step from the median
_MAX_NAMED = 3  # places that a message lists


@value(in_sentences=True)
class UnevenClock:
    """A time column that does not come from an even clock."""

    seconds: np.ndarray  # (n,) time of each row [s]
    fs: float  # sampling frequency of the usual steps [Hz]
    rows: np.ndarray  # (k,) rows at which the steps begin to differ from the usual ones

    def filled(self, stream: np.ndarray) -> np.ndarray:
        """Return streams (..., n) at the usual rate, by a cubic spline through their rows; the last
        of equal times.
        """
        from scipy.interpolate import CubicSpline

        finite = np.isfinite(self.seconds) & np.isfinite(stream).reshape(-1, self.seconds.size).all(
            axis=0
        )
        t, x = self.seconds[finite], stream[..., finite]
        later = np.append(np.diff(np.maximum.accumulate(t)) > 0, True)
        grid = np.arange(int((t[-1] - t[0]) * self.fs + 1e-6) + 1) / self.fs
        filled = CubicSpline(t[later] - t[0], x[..., later], axis=-1)(grid)
        filled.flags.writeable = False
        return np.asarray(filled)

    def describe(self, n_samples: int = 0) -> str:
        """Describe the unequal steps and their places.

        >>> t = np.arange(1000) / 100
        >>> found = find_uneven_clock(np.insert(t, 501, 5.004), 100.0)
        >>> found.describe()
        'the steps of the time column vary from 0.004 to 0.01 s, usually 0.01 s: they are unequal from 5.004 s on'
        """
        steps = np.diff(self.seconds)
        places = ", ".join(f"{self.seconds[row]:.9g}" for row in self.rows[:_MAX_NAMED])
        more = f" and {format_count(self.rows.size - _MAX_NAMED, 'place')} more" * (
            self.rows.size > _MAX_NAMED
        )
        return (
            f"the steps of the time column vary from {steps.min():.4g} to {steps.max():.4g} s,"
            f" usually {1 / self.fs:.6g} s: they are unequal from {places} s{more} on"
        )


def find_uneven_clock(seconds: np.ndarray | None, fs: float) -> UnevenClock | None:
    """Return the places where a time column leaves an even clock for good; None if it does not.

    Parameters
    ----------
    seconds : (n,) ndarray, optional
        Time of each row [s].
    fs : float
        Sampling frequency by its mean step [Hz]; 0 or nan without one.
    """
    if seconds is None or seconds.size < _N_PARTS or not fs > 0 or not np.isfinite(seconds).all():
        return None
    n = seconds.size
    # if printed coarsely
    n_equal = n // (1 + int(np.count_nonzero(seconds[1:] != seconds[:-1]))) + 1
    size = min(n // 2, max(_PART_ROWS, 8 * n_equal))
    starts = np.linspace(0, n - size, _N_PARTS).astype(int)
    rows = starts[:, None] + np.arange(size)
    places = (seconds[rows] - seconds[0]) * fs - rows
    middle, scatter = np.median(places, axis=1), float(np.median(np.ptp(places, axis=1)))
    drift = np.polynomial.Polynomial.fit(starts, middle, _DRIFT_ORDER)
    wander = middle - drift(starts)
    if np.ptp(wander) <= max(_MAX_WANDER, scatter):
        return None
    steps = np.diff(seconds)
    usual = float(np.median(steps[steps > 0]))
    usual = float(np.mean(steps[np.abs(steps - usual) < _USUAL_STEP * usual]))
    odd = np.flatnonzero(np.abs(steps - usual) > _USUAL_STEP * usual) + 1
    if odd.size:
        odd = odd[np.diff(odd, prepend=-1) > 1]
    else:
        odd = starts[[np.argmax(np.abs(np.diff(wander)))]]
    return UnevenClock(seconds=seconds, fs=float(f"{1 / usual:.6g}"), rows=odd)
