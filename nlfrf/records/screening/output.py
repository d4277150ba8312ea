"""Faults of the output relative to the input: lost samples, another clock, a changed sign, and
drifts over the periods.

In a valid record the phase of Y/U on the excited lines is the same in every period. A change of
this phase that is proportional to frequency is a delay. If the delay jumps by whole samples,
samples of y were lost or repeated. If it increases linearly, the clock of y differs from that of u.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from nlfrf._base.numbers import BLOCK_ENTRIES, TINY, power, rfft_at, streams_equal
from nlfrf._base.values import value
from nlfrf.records.screening.decimation import common_smooth_step, decimate
from nlfrf.records.screening.drifts import (
    ALONE,
    FEW,
    NEGLIGIBLE,
    describe_gain_drift,
    describe_offset_drift,
    fit_line,
)
from nlfrf.records.screening.gaps import (
    TRANSIENT_RANK,
    find_corrupted_periods,
    find_slips,
    likeliest_lag,
    modal_share,
)
from nlfrf.records.screening.input import (
    MAX_LINES,
    SEVERE_POWER,
    describe_slips,
    interpolate_bandlimited,
)
from nlfrf.records.screening.transients import (
    N_POLYNOMIAL,
    WINDOW_LINES,
    is_transient,
    smooth_basis,
)
from nlfrf.signals.lines import chance_correlation

#: Thresholds, all tuned on `benchmarks.bench_screening`. Two damped modes explain 0.5 to 0.9 of a
#: gap and 0.1 of noise; four explain less than 0.95 of a start from rest in one of 300 random
#: records. A difference below a multiple of the noise is noise. Then for the difference of two
#: periods: the power of its second half over the first, for modes that beat; of the first half over
#: the second; and of both over the noise.
_MODAL_SHARE = 0.9
_SETTLING_SHARE = 0.95
_MIN_OVER_NOISE = 3.0
_MAX_BEAT = 2.0
_MIN_DECAY = 1.1
_MIN_EXCESS = 1.2
_SIGMAS = 6.0  # standard deviations above which a fault is believed
# share of the nonrepeating power that a delay must explain before a record is refused for it
_MIN_EXPLAINED = 0.5
_VISIBLE_POWER = 1e-6  # share of the power of y out of place above which a delay is reported
_MAX_CLOCK_ERROR = (
    1e-4  # largest relative difference of two clocks; a larger one is samples lost or repeated
)
# largest relative difference of the gain of a period from that of the others
_MAX_LEVEL_CHANGE = 0.25
# share of the power of a period that does not repeat, above which the period is examined
_MAX_UNEXPLAINED = 1e-3
_FALSE_ALARM = 1e-3  # probability that noise passes for a late or early period
_OPPOSITE_CORRELATION = (
    0.9  # correlation of two periods beyond which one is the other with its sign changed
)


@value(copy=False)
class _OutputAlignment:
    """Alignment of an output with the input, period by period."""

    n_samples: int  # samples in one period
    delay: (
        np.ndarray
    )  # (P,) delay of y minus that of u in each period, zero for the first sound period [samples]
    # (P,) whole samples of this delay, caused by samples of y that were lost (negative) or repeated
    jumps: np.ndarray
    # (P,) periods that repeat the others up to a delay and a gain, without a gap inside
    sound: np.ndarray
    corrupted: np.ndarray  # (P,) periods of which a part is shifted against the others
    noise: float  # standard deviation of the delays by noise [samples]
    misplaced: float  # share of the power of y that the delays turn into apparent distortion
    explained: float  # share of the nonrepeating power that the delays explain
    gain: np.ndarray  # (P,) gain of each period over that of the last one
    gain_noise: float  # standard deviation of `gain` by noise
    offset: np.ndarray  # (P,) mean of y over each period, in rms of y about its mean
    # periods at the start that differ from the others, but not by a transient; they are left out
    n_unsettled: int = 0

    @property
    def broken(self) -> bool:
        """True if a period after the first valid one does not repeat the others, or y has a gap
        before it.

        Periods before the first sound one may be in transient. Behind a gap all sound periods are
        shifted against the input; a corrupted period is shifted in part.
        """
        first = int(np.argmax(self.sound))
        return (
            bool(self.corrupted.any())
            or not self.sound[first:].all()
            or bool(self.jumps[0] != self.jumps[first])
        )

    @property
    def clock(self) -> float:
        """Delay of y against u per period because of its clock [samples]; zero if not
        significant.
        """
        at = np.flatnonzero(self.sound)
        if at.size < 2:
            return 0.0
        pace, bend = fit_line(at, (self.delay - self.jumps)[at])
        spread = float(np.sqrt(np.sum((at - at.mean()) ** 2)))
        straight = at.size < FEW or bend < 0.3 * abs(pace) * np.ptp(at)
        likely = (
            self.explained > (ALONE if at.size < FEW else 0.1)
            or abs(pace) * spread > 3 * _SIGMAS * self.noise
        )
        if abs(pace) * spread > _SIGMAS * self.noise and straight and likely:
            return pace
        return 0.0

    @property
    def fault(self) -> str:
        """Description of a fault of timing or sign of y, with numbers and cure; empty without a
        fault.
        """
        turned = np.flatnonzero(self.turns)
        if turned.size:
            return (
                f"y changes its sign before period {', '.join(str(j + 2) for j in turned[:6])}; was"
                " it rewired?"
            )
        gaps = np.diff(self.jumps)
        if gaps.any():
            found = ", ".join(
                f"{abs(n):g} {'repeated' if n > 0 else 'lost'} before period {j + 2}"
                for j, n in describe_slips(gaps)
            )
            return (
                f"samples of y were lost or repeated, but not of u ({found}); resample=True"
                " cuts y where it repeats"
            )
        if self.broken:
            bad = ", ".join(str(j + 1) for j in np.flatnonzero(~self.sound)[:6])
            return (
                f"y does not repeat in period {bad} of {self.sound.size}; resample=True leaves"
                " that period out"
            )
        if self.clock and self.misplaced > _VISIBLE_POWER and self.outweighs_noise:
            ppm = 1e6 * self.clock / self.n_samples
            return (
                f"the clock of y differs from that of u by {ppm:.3g} ppm ({self.clock:+.3g}"
                " samples a period); resample=True corrects this"
            )
        return ""

    @property
    def outweighs_noise(self) -> bool:
        """True if the power misplaced by the delays exceeds the noise in the mean of the
        periods.
        """
        return bool(self.explained * np.count_nonzero(self.sound) > 1 - self.explained)

    @property
    def turns(self) -> np.ndarray:
        """(P - 1,) bool, sign changes of y from one period to the next."""
        return (self.gain[1:] < 0) != (self.gain[:-1] < 0)

    @property
    def severe(self) -> bool:
        """True if the fault would count as distortion, above the noise."""
        return (
            (self.misplaced > SEVERE_POWER and self.explained > _MIN_EXPLAINED)
            or self.broken
            or bool(self.turns.any())
        )

    @property
    def start(self) -> str:
        """Description of a possible fault before the first settled period; empty if it may be a
        transient.
        """
        if not self.n_unsettled:
            return ""
        if self.n_unsettled == 1:
            which = "period 1 differs"
        else:
            which = f"periods 1 to {self.n_unsettled} differ"
        return (
            f"{which} from the others by more than noise or a linear transient, and is left"
            " out. A nonlinear machine that starts from rest does this. But if samples of y"
            " were lost in it, all later periods are shifted against u: then measure again"
        )

    @property
    def drift(self) -> str:
        """Description of a drift over the record, with numbers and cure; empty without a drift."""
        at = np.flatnonzero(self.sound)
        changed = describe_gain_drift(
            at, self.gain[at], noise=_SIGMAS * self.gain_noise, explained=self.explained
        )
        if changed or at.size < FEW:
            return changed
        return describe_offset_drift(self.offset[at])


def align_output(u: np.ndarray, y: np.ndarray, lines: np.ndarray) -> _OutputAlignment:
    """Align the periods of an output with those of its input.

    Periods in transient are left aside: a transient has its own phase and gain on every line.

    Parameters
    ----------
    u, y : (P, N) ndarray
        Periods of one realisation, at least two.
    lines : (F,) int ndarray
        Excited lines.
    """
    n_samples = y.shape[1]
    if n_samples > BLOCK_ENTRIES:
        step = common_smooth_step([u[0], y[0]], n_samples)
    else:
        step = 1
    u, y = decimate(u, step), decimate(y, step)
    lines = lines[2 * lines < y.shape[1]]
    gaps = find_slips(y, int(lines[-1]))
    corrupted, gaps = find_corrupted_periods(y, int(lines[-1]), gaps)
    if corrupted.all():
        return replace(_unknown_alignment(len(y), n_samples), sound=~corrupted, corrupted=corrupted)
    gaps *= step
    lag = _align_decimated(u, y, lines=lines, step=step, gaps=gaps, corrupted=corrupted)
    if lag.fault or lag.drift:
        first = _first_settled_period(y, int(lines[-1]), (gaps != 0) | corrupted)
        if first > len(y) - 2:
            return _unknown_alignment(len(y), n_samples)
        if first:
            return _prepend_transient_periods(
                _align_decimated(
                    u[first:],
                    y[first:],
                    lines=lines,
                    step=step,
                    gaps=gaps[first:],
                    corrupted=corrupted[first:],
                ),
                first,
            )
    first = int(np.argmax(lag.sound))
    begins = y[max(first - 1, 0)] - y[max(first, 1)]
    differs = power(begins) > NEGLIGIBLE**2 * power(y[-1])
    if (
        len(y) > 2
        and differs
        and not (lag.fault or lag.drift or _is_modal(np.diff(y, axis=0), max(first - 1, 0)))
    ):
        lag = replace(lag, n_unsettled=max(first, 1))
    # a gap before all sound periods shifts the rest
    gaps[first:] = 0.0
    if gaps.any():
        return replace(lag, jumps=lag.jumps + np.append(0.0, np.add.accumulate(gaps))[:-1])
    return lag


def _first_settled_period(y: np.ndarray, last: int, broken: np.ndarray) -> int:
    """Return the first of the periods (P, N) that differs from the next by no transient on the
    lines up to `last`.

    A transient decays. A difference that grows within a period, as behind a gap, is none; periods
    with a gap, `broken` (P,), count as settled. Two modes that beat may grow for half a period. A
    transient that rings on few lines is not smooth from line to line, but has few damped modes.
    """
    Y = rfft_at(y, np.arange(1, last + 1))[:, None]
    noise = min(map(power, np.diff(y, axis=0))) * (len(y) > 2)
    for j, (one, following) in enumerate(itertools.pairwise(y)):
        early, late = map(power, np.array_split(one - following, 2))
        if broken[j : j + 2].any() or not (
            (late < _MAX_BEAT * early and is_transient(Y[j], Y[j + 1]))
            or (
                _MIN_DECAY * late < early
                and early + late > _MIN_EXCESS * noise
                and modal_share(one - following, noise / one.size) > _MODAL_SHARE
            )
        ):
            return j
    return len(y) - 1


def _is_modal(differences: np.ndarray, j: int) -> bool:
    """Return whether row j of the differences of periods (P - 1, N) is noise or a few damped modes.

    The noise is the smallest difference of two periods. Modes with a weak cubic spring need rank 8.
    """
    noise = min(map(power, differences))
    return bool(
        power(differences[j]) < _MIN_OVER_NOISE * noise
        or modal_share(differences[j], noise / differences.shape[1], rank=2 * TRANSIENT_RANK)
        > _SETTLING_SHARE
    )


def _unknown_alignment(n_periods: int, n_samples: int) -> _OutputAlignment:
    """Return the alignment of periods that show no fault."""
    zeros, ones = np.zeros(n_periods), np.ones(n_periods)
    return _OutputAlignment(
        n_samples=n_samples,
        delay=zeros,
        jumps=zeros,
        sound=ones > 0,
        corrupted=zeros > 0,
        noise=np.inf,
        misplaced=0.0,
        explained=0.0,
        gain=ones,
        gain_noise=np.inf,
        offset=zeros,
    )


def _prepend_transient_periods(lag: _OutputAlignment, n: int) -> _OutputAlignment:
    """Put n periods before those of an alignment, without delay and counted as valid."""

    def after(x: np.ndarray, before: float | bool) -> np.ndarray:
        return np.insert(x, 0, np.full(n, before))

    return replace(
        lag,
        delay=after(lag.delay, 0.0),
        jumps=after(lag.jumps, lag.jumps[0]),
        sound=after(lag.sound, True),
        corrupted=after(lag.corrupted, False),
        gain=after(lag.gain, lag.gain[0]),
        offset=after(lag.offset, lag.offset[0]),
    )


def _align_decimated(
    u: np.ndarray,
    y: np.ndarray,
    *,
    lines: np.ndarray,
    step: int,
    gaps: np.ndarray,
    corrupted: np.ndarray,
) -> _OutputAlignment:
    """Return `align_output` for signals decimated by `step`, with gaps and corrupted periods
    (P,).
    """
    n_samples = step * y.shape[1]
    if lines.size > MAX_LINES:
        lines = np.sort(np.random.default_rng(0).choice(lines, MAX_LINES, replace=False))
    input_side, output = _align_periods(u, lines), _align_periods(y, lines)
    whole = (gaps == 0) & ~corrupted
    # a gap was found because both of its sides repeat
    answers = (
        gaps.any()
        or np.count_nonzero(whole) < 2
        or np.mean(_follows_input(output, lines, n_samples=y.shape[1], whole=whole)) > 0.5
    )
    if not answers or np.count_nonzero(output.placed) <= len(y) / 2:
        return _unknown_alignment(len(y), n_samples)
    delay = step * (output.delay - input_side.delay)
    delay = _forward_filled(delay, output.placed)
    slope = 2 * np.pi * lines / n_samples
    weight = np.abs(output.mean) ** 2
    total = float(weight.sum())
    lever = float(np.sum(slope**2 * weight))
    typical = float(np.median(output.rest))
    noise, gain_noise = (
        _alignment_noise_std(weight * by, by, noise_variance=typical / lines.size, n_periods=len(y))
        for by in (slope**2, np.ones(lines.size))
    )
    sound = output.rest < max(_MAX_UNEXPLAINED * total, 10 * typical)
    size = np.abs(output.gain)
    sound &= np.abs(size / np.median(size) - 1) < _MAX_LEVEL_CHANGE + _SIGMAS * gain_noise
    if len(y) == 2:
        sound = np.ones(2, dtype=bool)
    if whole.any():
        sound &= whole
    sound, jumps = _slips_between_periods(delay, sound, noise=noise, n_samples=n_samples)
    shift = delay[sound] - delay[sound].mean()
    Y = output.spectra[sound]
    before = float(np.sum(np.abs(Y - Y.mean(axis=0)) ** 2))
    return _OutputAlignment(
        n_samples=n_samples,
        delay=delay - delay[np.argmax(sound)],
        jumps=jumps,
        sound=sound,
        corrupted=corrupted,
        noise=noise,
        misplaced=float(np.mean(shift**2)) * lever / total,
        explained=1 - float(np.sum(output.rest[sound])) / before if before > 0 else 0.0,
        gain=output.gain / np.where(input_side.gain != 0, input_side.gain, np.inf),
        gain_noise=gain_noise,
        offset=y.mean(axis=1) / (float(np.std(y[-1])) or np.inf),
    )


def _alignment_noise_std(
    observed: np.ndarray, weight: np.ndarray, *, noise_variance: float, n_periods: int
) -> float:
    """Return the standard deviation by noise of the delay, or gain, of a period; lines (F,) have
    power `observed`.

    The noise in the mean of the periods carries no information and is subtracted.
    """
    signal_power = observed.sum() - noise_variance / n_periods * weight.sum()
    if signal_power > 0:
        return float(np.sqrt(noise_variance / 2 * observed.sum()) / signal_power)
    return np.inf


def _forward_filled(delay: np.ndarray, placed: np.ndarray) -> np.ndarray:
    """Return the delays; an unknown one is that of the period before, or the first known one."""
    at = np.flatnonzero(placed)
    return delay[at][np.maximum(np.searchsorted(at, np.arange(delay.size), side="right") - 1, 0)]


def _slips_between_periods(
    delay: np.ndarray, sound: np.ndarray, *, noise: float, n_samples: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the periods without a gap inside, and the offset of each in whole samples."""
    at = np.flatnonzero(sound)
    nothing = np.zeros(delay.size)
    if at.size < 2 or _SIGMAS * noise > 0.5:
        return sound, nothing
    pace = float(np.median(np.diff(delay[at]) / np.diff(at)))
    if abs(pace) > _MAX_CLOCK_ERROR * n_samples:
        pace = 0.0
    left = delay - pace * np.arange(delay.size)
    difference = left[at] - left[at, None]
    agree = np.abs(difference - np.round(difference)) < max(0.1, _SIGMAS * noise)
    most = at[
        np.argmax(np.count_nonzero(agree, axis=1))
    ]  # most agree with it; the first may have a gap inside
    left -= left[most]
    whole = np.round(left)
    if not whole[at].any():
        return sound, nothing
    sound = sound & (np.abs(left - whole) < max(0.1, _SIGMAS * noise))
    return sound, (
        _forward_filled(whole - whole[np.argmax(sound)], sound) if sound.any() else nothing
    )


def resample_to_input_clock(
    y: np.ndarray, lag: _OutputAlignment, periods: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the stream y (n,) on the clock of the input, and a mask of the periods that are
    measured throughout.

    Parameters
    ----------
    y : (n,) ndarray
        Output as recorded.
    lag : _OutputAlignment
        Alignment of its periods with those of the input.
    periods : (P,) int ndarray
        Indices of these periods in the stream.
    """
    turns = np.arange(y.size) / lag.n_samples
    at = np.arange(y.size) + lag.clock * turns  # one trigger started both clocks
    row = np.clip(
        np.searchsorted(periods, turns.astype(int), side="right") - 1, 0, periods.size - 1
    )
    at += lag.jumps[row]
    first = int(np.argmax(lag.sound))
    good = (lag.sound | (np.arange(periods.size) < first)) & ~lag.corrupted
    step = np.diff(lag.jumps, append=lag.jumps[-1]) != 0
    good &= ~(
        step & np.append(good[1:], True)
    )  # the gap lies in the period before, too short to be found in it
    inside = (at[0 :: lag.n_samples] > -0.5)[periods]
    last = np.minimum((periods + 1) * lag.n_samples, y.size) - 1
    return interpolate_bandlimited(y, at), good & inside & (at[last] < y.size - 0.5)


@value(copy=False)
class _AlignedPeriods:
    """Periods laid over each other: delay [samples] and gain (P,) of each, rest (P,), their mean
    (F,), spectra (P, F).

    `placed` (P,): periods that have more in common with the others than white noise.
    """

    delay: np.ndarray
    gain: np.ndarray
    rest: np.ndarray
    placed: np.ndarray
    mean: np.ndarray
    spectra: np.ndarray


def _align_periods(x: np.ndarray, lines: np.ndarray) -> _AlignedPeriods:
    """Return the periods x (P, N) laid over the last one on the lines (F,), then over their
    mean.
    """
    n_samples = x.shape[1]
    repeats = all(streams_equal(x[-1], one) for one in x[:-1])
    X = np.array([rfft_at(one, lines) * (2 / n_samples) for one in (x[-1:] if repeats else x)])
    if repeats:
        X = np.repeat(X, len(x), axis=0)
    slope = 2 * np.pi * lines / n_samples
    reference = X[-1]
    # of either sign: a period with its sign changed looks late on every line
    sign = np.where(
        (X @ reference.conj()).real < -_OPPOSITE_CORRELATION * np.sqrt(power(X) * power(reference)),
        -1.0,
        1.0,
    )
    X = X * sign[:, None]
    delay = np.zeros(len(x))
    if not repeats:
        delay += [likeliest_lag(one * reference.conj(), lines, n_samples) for one in X]
    for step in range(6):
        if step == 3:  # the mean has less noise
            reference = np.mean(X * np.exp(1j * slope * delay[:, None]), axis=0)
        turned = X * np.exp(1j * slope * delay[:, None]) * reference.conj()
        delay -= np.sum(slope * turned.imag, axis=1) / np.sum(slope**2 * np.abs(reference) ** 2)
    turned = X * np.exp(1j * slope * delay[:, None])
    size = np.sum(np.abs(reference) ** 2)
    gain = np.sum(turned * reference.conj(), axis=1).real / size
    rest = np.sum(np.abs(turned - gain[:, None] * reference) ** 2, axis=1)
    others = reference - turned / len(x)  # without the period itself
    shared = np.abs(np.sum(turned * others.conj(), axis=1)) ** 2
    if lines.size > 1:
        least = chance_correlation(_FALSE_ALARM / n_samples, lines.size)
    else:
        least = 0.0
    placed = shared >= least * power(turned) * power(others)
    return _AlignedPeriods(
        delay=delay,
        gain=sign * gain / gain[-1],
        rest=rest,
        placed=placed,
        mean=reference,
        spectra=X,
    )


def _follows_input(
    output: _AlignedPeriods, lines: np.ndarray, *, n_samples: int, whole: np.ndarray
) -> np.ndarray:
    """Return whether each period without a gap has more in common with the others than noise of any
    colour.
    """
    delay = output.delay[whole]
    X = output.spectra[whole] * np.exp(2j * np.pi / n_samples * delay[:, None] * lines)
    # a delay was searched at all places, or none was needed
    return _periods_share_a_signal(
        X, _FALSE_ALARM / np.where(np.abs(delay - np.median(delay)) < 1, 1, n_samples)
    )


def _periods_share_a_signal(X: np.ndarray, chance: np.ndarray) -> np.ndarray:
    """Return (P,) whether each period has more in common with the others than noise, with false
    alarms at `chance`.

    For noise of any colour each line is weighted by its power over that of its neighbours, or over
    their noise: either many lines contribute little or a few contribute much. A drift leaks into
    all lines and is smooth over them, while the response to random phases is rough. So the smooth
    part is removed.

    Parameters
    ----------
    X : (P, F) complex ndarray
        Periods laid over each other, on the excited lines.
    chance : (P,) ndarray
        Probability that noise passes, for each period.
    """
    n_periods, n_lines = X.shape
    if n_lines < 2:
        return np.ones(n_periods, dtype=bool)
    size = min(WINDOW_LINES, n_lines)
    windows = X[:, : n_lines // size * size].reshape(n_periods, -1, size)
    free = 1.0
    if size == WINDOW_LINES:
        smooth = smooth_basis()
        windows = windows - (windows @ smooth) @ smooth.T
        free -= N_POLYNOMIAL / WINDOW_LINES
    total = np.maximum(np.mean(np.abs(windows) ** 2, axis=(0, 2)), TINY)
    noise = np.mean(np.abs(windows - windows.mean(axis=0)) ** 2, axis=(0, 2))
    placed = np.zeros(n_periods, dtype=bool)
    noise = np.maximum(noise, 1e-12 * total)
    for scale in (total, np.sqrt(total * noise), noise):
        one = (windows / np.sqrt(scale)[:, None]).reshape(n_periods, -1)
        cross = one * (one.mean(axis=0) - one / n_periods).conj()  # without the period itself
        weight = np.abs(cross)
        whole = weight.sum(axis=1) ** 2
        # the equivalent number of lines with equal power
        n = free * whole / np.maximum(power(weight), TINY)
        least = np.array(
            [
                chance_correlation(p, lines)
                for p, lines in zip(chance, np.maximum(n, 1 + 1e-9), strict=True)
            ]
        )
        placed |= np.abs(cross.sum(axis=1)) ** 2 >= least * whole
    return placed
