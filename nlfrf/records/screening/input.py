"""Faults of a record before it is cut: a period that is not a whole number of samples, a drifting
clock, lost samples, clipping, constant channels.

Each fault would count as distortion. In a valid record period j begins exactly j n_samples after
the first one. The delay from this place shows the fault. A delay that increases linearly means a
wrong or fractional period. If it is curved over j, the clock drifts. If it jumps by whole samples,
samples were lost or repeated. If the record is cut at these delays, between the samples if
necessary, all three are repaired.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from nlfrf._base.arguments import data_warning
from nlfrf._base.numbers import (
    BLOCK_ENTRIES,
    clipped_share,
    iterate_blocks,
    rfft,
    rfft_at,
    squared_modulus,
    streams_equal,
)
from nlfrf._base.values import value
from nlfrf.records.screening.decimation import common_smooth_step, decimate
from nlfrf.records.screening.gaps import find_corrupted_periods, find_slips, likeliest_lag

# share of the input power that misplaced periods may turn into apparent distortion before refusal
SEVERE_POWER = 1e-4
_VISIBLE_POWER = 1e-7  # the same share below which the delays are no fault
_HALF_WIDTH = 24  # samples on either side that the band-limited interpolation uses
MAX_LINES = 1 << 14  # lines that suffice for the delays
_FEW_PERIODS = 8  # number of steps up to which one or two jumps would shift the median
_CLIPPED_SHARE = 2e-3  # share of samples at the extremes, in runs, above which a signal is clipped
# samples that are tested for a hold; fewest changes among them
_PART = 1 << 16
_FEWEST_CHANGES = 100
#: Thresholds for an output that repeats its last value because its sensor is slow. The share of new
#: samples behind a repetition; repetitions over steps of one quantum, about one for rounding; the
#: share of the runs of repetitions behind which y goes on in its direction; the smaller step beside
#: a run over the rms of steps. 600 slow sensors have at least 0.10 and 0.38; of 120 outputs with
#: play the median has 0.09 and 0.27 (`benchmarks.records_as_found`).
_MIN_HELD, _MAX_ROUNDED, _MIN_ONWARD, _MIN_STEP = 0.02, 4.0, 0.1, 0.36
# penalty for an even delay of one sample per period that explains no more than none
_STANDSTILL_SHARE = 0.02
_DRIFT_ORDER = 3  # order of the polynomial that a drifting clock follows over the record
_ROUNDING = 1e-12  # distance from a sample, in samples, below which it is that sample
_KAISER_BETA = 9.0  # shape of the Kaiser window of the interpolation: error below 1e-5 up to 0.4 fs
_SINC_OFFSETS = np.arange(
    -_HALF_WIDTH + 1, _HALF_WIDTH + 1
)  # offsets of the samples that the interpolation uses
_WINDOW_ORDER = 7  # order of the polynomials for the window between two samples: exact to rounding


@value
class PeriodAlignment:
    """Place of each period of a stream."""

    n_samples: int  # the period that was assumed [samples]
    # (P,) delay of each period against j n_samples, zero for the first one that is not empty
    # [samples]
    delay: np.ndarray
    sound: np.ndarray  # (P,) periods that repeat the others up to this delay, without a gap inside
    gaps: np.ndarray  # (P,) samples lost (negative) or repeated inside each period
    noise: float  # standard deviation of the delays by noise [samples]
    misplaced: float  # share of the input's power that the delays turn into apparent distortion
    # share of the power of a typical period that does not repeat the first one at any delay
    unexplained: float

    @property
    def jumps(self) -> np.ndarray:
        """(P,) offset of each period by lost (negative) or repeated samples before it [samples]."""
        j = np.flatnonzero(self.sound)
        if j.size < 2:
            return np.zeros(self.sound.size)
        known = np.add.reduceat(self.gaps, j)[:-1]
        steps, intervals = np.diff(self.delay[j]) - known, np.diff(j)
        whole = known + np.round(steps - _common_step_length(steps, intervals) * intervals)
        sums = np.concatenate([[0.0], np.cumsum(whole)])
        return np.asarray(
            sums[np.maximum(np.searchsorted(j, np.arange(self.sound.size), side="right") - 1, 0)]
        )

    @property
    def pace(self) -> np.ndarray:
        """(2,) straight line through the delays without jumps: slope in samples per period, and
        value at the first.
        """
        j = np.flatnonzero(self.sound)
        if not j.size:
            raise ValueError(
                f"n_samples must be the period of the input, got {self.n_samples}: no period is"
                " without a fault"
            )
        smooth = (self.delay - self.jumps)[j]
        if j.size > 1:
            return np.polyfit(j, smooth, 1)
        return np.array([0.0, smooth[0]])

    @property
    def period(self) -> float:
        """Mean period of the input between jumps [samples]."""
        return self.n_samples + float(self.pace[0])

    @property
    def is_whole(self) -> bool:
        """True if this period is a whole number of samples, within noise."""
        return abs(self.period - round(self.period)) < max(0.002, 3 * self.noise)

    @property
    def spacing(self) -> float:
        """Samples of the stream per sample of a period cut into n_samples (`resegment`)."""
        return (round(self.period) if self.is_whole else self.period) / self.n_samples

    @property
    def drifts(self) -> bool:
        """True if the delays without jumps leave a straight line."""
        return self.bend > max(0.02, 5 * self.noise)

    @property
    def bend(self) -> float:
        """Largest departure of the sound periods from the straight line, without jumps
        [samples].
        """
        even = np.polyval(self.pace, np.arange(self.delay.size))
        return float(np.abs((self.delay - self.jumps - even)[self.sound]).max())

    @property
    def fault(self) -> str:
        """Description of the fault, with numbers and cure; empty without a fault."""
        steps = np.diff(self.jumps)
        if steps.any():
            found = ", ".join(
                f"{abs(n):g} {'repeated' if n > 0 else 'lost'} before period {j + 2}"
                for j, n in describe_slips(steps)
            )
            return (
                f"samples were lost or repeated ({found}); resample=True cuts the periods where"
                " the input itself repeats"
            )
        if not self.sound.all():
            bad = ", ".join(str(j + 1) for j in np.flatnonzero(~self.sound)[:6])
            return (
                f"the input does not repeat in period {bad} of {self.sound.size}; resample=True"
                " leaves that period out"
            )
        if self.misplaced < _VISIBLE_POWER or np.abs(self.delay).max() < 5 * self.noise:
            return ""
        if self.drifts:
            return (
                f"the clock drifts: the periods begin up to {self.bend:.3g} samples away from"
                " equal distances; resample=True corrects this"
            )
        if self.is_whole:
            whole = round(self.period)
            if whole != self.n_samples:
                return f"the input repeats every {whole} samples; give n_samples={whole}"
            return ""
        return (
            f"the input repeats every {self.period:.4f} samples, not a whole number;"
            " resample=True cuts periods of this length"
        )


def _common_step_length(steps: np.ndarray, intervals: np.ndarray) -> float:
    """Return the delay per period of most steps, each over `intervals` periods: all but those with
    a whole jump.
    """
    if steps.size > _FEW_PERIODS:
        return float(np.median(steps / intervals))
    paces = np.append(steps / intervals, 0.0)
    left = steps - paces[:, None] * intervals
    jumps = np.round(left)
    costs = np.abs(left - jumps).sum(axis=1) + _STANDSTILL_SHARE * np.abs(paces)
    return float(paces[np.lexsort((costs, np.count_nonzero(jumps, axis=1)))[0]])


def describe_slips(steps: np.ndarray) -> list[tuple[int, float]]:
    """Return period and size of the first four jumps."""
    return [(int(j), float(steps[j])) for j in np.flatnonzero(steps)[:4]]


def track_input(u: np.ndarray, n_samples: int) -> PeriodAlignment:
    """Follow the periods of an input (n,) that is at least two periods long.

    Parameters
    ----------
    u : (n,) ndarray
        Input, or reference.
    n_samples : int
        Its nominal period; gaps may amount to an eighth of it.
    """
    n_periods = u.size // n_samples
    periods = u[: n_periods * n_samples].reshape(n_periods, n_samples)
    if all(
        streams_equal(periods[0], period) for period in periods[1:]
    ):  # as a generator plays them
        return _are_in_place(n_samples, np.ones(n_periods, dtype=bool))
    if n_samples > BLOCK_ENTRIES:
        step = common_smooth_step([u], n_samples)
    else:
        step = 1
    found = _track_cut_periods(decimate(periods, step))
    return replace(
        found,
        n_samples=n_samples,
        delay=step * found.delay,
        gaps=step * found.gaps,
        noise=step * found.noise,
    )


def _are_in_place(n_samples: int, sound: np.ndarray) -> PeriodAlignment:
    """Return the alignment of periods (P,) without delays, of which `sound` are valid."""
    nothing = np.zeros(sound.size)
    return PeriodAlignment(
        n_samples=n_samples,
        delay=nothing,
        sound=sound,
        gaps=nothing,
        noise=0.0,
        misplaced=0.0,
        unexplained=0.0,
    )


def _track_cut_periods(periods: np.ndarray) -> PeriodAlignment:
    """Return `track_input` for evenly cut periods (P, N), transformed one at a time."""
    n_samples = periods.shape[1]
    power = np.array([np.vdot(one, one) - np.add.reduce(one) ** 2 / n_samples for one in periods])
    steady = power > 0.9 * np.median(power)  # neither empty nor half empty
    first = int(np.argmax(steady))
    weight = squared_modulus(rfft(periods[first]))
    weight[0] = 0.0
    weight[weight < 1e-6 * weight.max()] = 0.0
    weight[max(2, int(0.45 * n_samples)) :] = 0.0  # a period of four samples has one line
    used = np.flatnonzero(weight)  # the lines with power: all following arrays have these lines
    if used.size > MAX_LINES:
        used = np.sort(np.argpartition(weight, -MAX_LINES)[-MAX_LINES:])
    weight = weight[used]
    # Phases over the lines tell a delay, which is linear in frequency, from samples that are lost
    # inside a period, which is not.
    spectra = np.array([rfft_at(one, used) for one in periods])
    gaps = find_slips(periods, int(used[-1]))
    corrupted, gaps = find_corrupted_periods(periods, int(used[-1]), gaps)
    whole_inside = (gaps == 0) & ~corrupted
    if corrupted.all():
        return _are_in_place(n_samples, whole_inside)
    if not whole_inside[first]:
        first = int(np.argmax(steady & whole_inside))
    reference = spectra[first]
    whole = -np.array([likeliest_lag(one * reference.conj(), used, n_samples) for one in spectra])
    cross, slope = spectra * reference.conj(), 2 * np.pi * used / n_samples
    # x_j(t) = x_0(t + d): phase of the cross spectrum + slope d; Gauss-Newton on the phase, from
    # the whole shift
    delay = whole.astype(float)
    for _ in range(4):
        turned = cross * np.exp(-1j * slope * delay[:, None])
        delay += np.sum(slope * turned.imag, axis=1) / np.sum(slope**2 * weight)
    turned = spectra * np.exp(-1j * slope * delay[:, None])
    rest = np.sum(np.abs(turned - reference) ** 2, axis=1) / np.sum(weight)
    delay = -delay  # a late period has a positive delay
    whole_ones = np.delete(rest, first)[np.delete(whole_inside, first)]
    if whole_ones.size:
        typical = float(np.median(whole_ones))
    else:
        typical = 0.0
    sound = (rest < max(1e-3, 10 * typical)) & whole_inside
    noise = float(
        np.sqrt(typical / 2 * np.sum(weight) / np.sum(slope**2 * weight) / max(1, used.size))
    )
    shift = delay[sound] - delay[sound].mean()
    misplaced = float(np.mean(np.sum(slope**2 * weight) * shift**2) / np.sum(weight))
    return PeriodAlignment(
        n_samples=n_samples,
        delay=delay - delay[first],
        sound=sound,
        gaps=gaps,
        noise=noise,
        misplaced=misplaced,
        unexplained=typical,
    )


def resegment(x: np.ndarray, where: PeriodAlignment) -> tuple[np.ndarray, np.ndarray]:
    """Return the sound periods (P, N) of a stream, each cut at its place between the samples, and
    their indices.

    Parameters
    ----------
    x : (n,) ndarray
        Input, output or reference, sampled together.
    where : Track
        Alignment of the input.

    Raises
    ------
    ValueError
        No whole sound period.
    """
    n, n_periods = where.n_samples, where.delay.size
    if not where.sound.any():
        raise ValueError(
            f"u must hold at least one whole period of {n} samples without a fault, got none:"
            f" {where.fault}"
        )
    j = np.arange(n_periods)
    curve = where.pace  # a straight line has less noise than single delays
    if where.drifts:
        sound = where.sound
        # a delay is an average over its period, so it belongs to the middle
        middle, smooth = j[sound] + 0.5, (where.delay - where.jumps)[sound]
        curve = np.polyfit(middle, smooth, min(_DRIFT_ORDER, middle.size - 1))
    rows, kept = [], []
    for period in j[where.sound]:
        jumps = period + 1 < n_periods and where.jumps[period + 1] != where.jumps[period]
        if (
            jumps and where.sound[period + 1]
        ):  # the gap lies in this period, too short to be found in it
            continue
        tau = period + np.arange(n) / n
        at = n * tau + np.polyval(curve, tau) + where.jumps[period]
        if at[0] > -0.5 and at[-1] < x.size - 0.5:
            rows.append(interpolate_bandlimited(x, at))
            kept.append(period)
    if not rows:
        raise ValueError(
            f"u must hold at least one whole period of {n} samples without a fault, got none"
        )
    return np.array(rows), np.array(kept)


def interpolate_bandlimited(x: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return values of a band-limited signal between its samples, by a windowed sinc.

    >>> x = np.sin(0.7 * np.arange(200))
    >>> bool(abs(interpolate_bandlimited(x, np.array([100.3]))[0] - np.sin(0.7 * 100.3)) < 1e-5)
    True
    """
    windows, values = _kaiser_windows(), np.empty(at.size)
    for some in iterate_blocks(at.size, _SINC_OFFSETS.size):
        first = np.floor(at[some]).astype(int)
        beyond = np.maximum(at[some] - first, _ROUNDING)
        kernel = np.vander(2 * beyond - 1, _WINDOW_ORDER + 1) @ windows
        kernel /= beyond[:, None] - _SINC_OFFSETS
        values[some] = np.vecdot(
            x.take(first[:, None] + _SINC_OFFSETS, mode="clip"), kernel
        ) / np.add.reduce(kernel, axis=1)
    return values


@lru_cache(maxsize=1)
def _kaiser_windows() -> np.ndarray:
    """Return (8, 48) polynomials in the place between two samples, from -1 to 1, for the window at
    each sample around.

    They include the sign of the sine of the sinc, whose absolute value is the same for all samples.
    """
    from scipy.special import i0

    nodes = np.cos(np.pi * (np.arange(_WINDOW_ORDER + 1) + 0.5) / (_WINDOW_ORDER + 1))
    away = ((nodes[:, None] + 1) / 2 - _SINC_OFFSETS) / _HALF_WIDTH
    sign = np.where(_SINC_OFFSETS % 2, -1.0, 1.0)
    windows = np.linalg.solve(np.vander(nodes), sign * i0(_KAISER_BETA * np.sqrt(1 - away**2)))
    windows.flags.writeable = False
    return windows


def _longest_constant_run(x: np.ndarray) -> tuple[int, int]:
    """Return begin and length of the longest run of equal samples."""
    begin, length, edge = 0, 0, 0  # of the longest run so far; begin of the current run
    for some in iterate_blocks(x.size):
        follows = x[some.start + 1 : some.stop + 1]
        changed = follows != x[some][: follows.size]
        if some.stop == x.size:
            ends = [x.size]
        else:
            ends = []
        if length > 0 and edge == some.start and changed.all():  # no run
            edge = some.start + changed.size
            continue
        edges = np.concatenate([[edge], np.flatnonzero(changed) + some.start + 1, ends]).astype(int)
        edge = int(edges[-1])
        lengths = np.diff(edges)
        if lengths.size and lengths.max() > length:
            begin, length = int(edges[np.argmax(lengths)]), int(lengths.max())
    return begin, length


def hold_factor(x: np.ndarray) -> int:
    """Return the number n of samples for which a stream holds each value, if it changes at every
    n-th only; else 1.
    """
    part = x[:_PART]
    at = np.flatnonzero(part[1:] != part[:-1])
    if at.size > _FEWEST_CHANGES:
        n = int(np.gcd.reduce(at - at[0]))
    else:
        n = 1
    if n > 1 and at.size * n > part.size / 2:
        return n
    return 1


def repeated_share(y: np.ndarray, u: np.ndarray) -> float:
    """Return the share of samples at which an output y (n,) of a slow sensor repeats its last
    value; 0 for any other y.

    Rounding repeats values, too, but makes about as many steps of one quantum, or y goes on by one
    quantum. A clipped signal, or one with a dead zone, repeats at few values. A signal with play
    goes on in the other direction.

    >>> t = np.arange(4000)
    >>> y = np.sin(0.3 * t) + np.sin(0.11 * t)
    >>> round(repeated_share(y[t * 3 // 10 * 10 // 3], t), 2), repeated_share(np.round(y, 2), t)
    (0.7, 0.0)
    """
    y, u = y[:_PART], u[:_PART]
    steps = np.diff(y)
    still = steps == 0
    # first steps of runs of repetitions or of moves
    edges = np.flatnonzero(still[1:] != still[:-1]) + 1
    behind = edges[~still[edges]]
    held = y[behind]  # the step into it is the last one before the repetitions
    free = (held != y.max()) & (held != y.min()) & (u[behind] != u[behind - 1])
    if np.count_nonzero(free) < max(_FEWEST_CHANGES / 2, _MIN_HELD * y.size, behind.size / 2):
        return 0.0
    size = np.abs(steps)
    quantum = float(size.min(initial=np.inf, where=~still))
    into = np.maximum.accumulate(np.where(still, 0, np.arange(steps.size)))[behind - 1]
    full = np.minimum(size[into], size[behind]).mean() > _MIN_STEP * np.sqrt(
        np.mean(size[~still] ** 2)
    )
    onward = (
        np.mean(steps[into] * steps[behind] > 0) > _MIN_ONWARD
        and np.mean(held == np.median(held)) < 0.5
    )
    rounded = np.count_nonzero(still) < _MAX_ROUNDED * np.count_nonzero(
        size[~still] < 1.5 * quantum
    )
    if full and onward and not rounded and np.median(size[behind]) > 2.5 * quantum:
        return float(np.mean(still))
    return 0.0


def warn_about_channel(name: str, signal: np.ndarray, n_samples: int) -> None:
    """Warn of a signal that is clipped or that stands still: both would count as distortion."""
    begin, length = _longest_constant_run(signal)
    if length > 2:
        share = clipped_share(signal)
    else:
        share = 0.0
    if share > _CLIPPED_SHARE:
        data_warning(
            f"{name} seems clipped: {100 * share:.2g} % of its samples are in runs at its"
            " largest or smallest value. Lower the amplitude, or widen the measuring range"
        )
    if length > n_samples // 4:
        data_warning(
            f"{name} is constant for {length} samples from sample {begin} on,"
            f" {length / n_samples:.2g} times the period. Was the channel connected?"
        )
