"""Find samples that were lost or repeated inside a period: before this gap the period is shifted
against the next one.

With a short gap, or one near an end, the period looks like one with a little noise. But all samples
after the gap are early or late, which makes the FRF wrong.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from nlfrf._base.numbers import TINY, power, rfft, rfft_at, squared_modulus

# least reduction of the difference of two periods by a shift, in variances of the noise
_MIN_LOG_LIKELIHOOD = 50.0
# least log likelihood ratio of an uneven difference for which shifts are tried
_UNEVEN_LOG_LIKELIHOOD = 10.0
_N_PARTS = 64  # places in a period at which this is tested
_MAX_REST = 1e-3  # largest share of the difference before the gap that a shift may leave
_WHOLE_TOLERANCE = (
    0.2  # of a quarter's step against a whole shift: a spike needs none, a transient any
)
_ROUNDING_POWER = 1e-9  # share of the power of y below which a difference is rounding
_MIN_SAMPLES = 16  # samples that suffice for the variance of noise
# rank of two modes (more would explain gaps); samples in a Hankel matrix
TRANSIENT_RANK = 4
_HANKEL_SAMPLES = 256
_MAX_SHORT_SHIFT = 8  # samples of the gaps that are tried everywhere
_SHORT_SHIFTS = [sign * k for k in range(1, _MAX_SHORT_SHIFT + 1) for sign in (-1, 1)]
# least share of the explained difference in each quarter; a spike has it all in one
_SPIKE_SHARE = 0.01
_MIN_PERIODS = 4  # best shifts for the part before the first gap that are tried
_N_LIKELIEST = 3  # longer shifts that are tried, with their neighbours
# places of a long period between which two gaps are looked for; samples used at each
_FINE = 1 << 13
_PLACE = 32


def find_slips(y: np.ndarray, last: int) -> np.ndarray:
    """Return (P,) the delay behind a gap inside each period [samples], negative if early; 0 without
    a gap.

    In the last period the part behind the gap is compared with the period before.

    Parameters
    ----------
    y : (P, N) ndarray
        Periods of one output.
    last : int
        Last excited line: noise that looks like a gap has these lines.

    Examples
    --------
    >>> y = np.random.default_rng(1).standard_normal((1, 100)).repeat(3, axis=0).ravel()
    >>> find_slips(np.delete(np.append(y, y[0]), 130).reshape(3, 100), 50)
    array([ 0., -1.,  0.])
    """
    difference = [_cumulative_power(one - following) for one, following in pairwise(y)]
    noise = _least_noise(difference, y[-1])
    found = np.zeros(len(y))
    for j, up_to in enumerate(difference):
        found[j] = _slip_length(y[j], y[j + 1], difference=up_to, noise=noise, last=last)
    if not found[-2]:
        backwards = difference[-1][-1] - difference[-1][::-1]
        found[-1] = _slip_length(
            y[-1, ::-1], y[-2, ::-1], difference=backwards, noise=noise, last=last
        )
    return _drop_contradicted_slips(y, found, last)


def _drop_contradicted_slips(y: np.ndarray, gaps: np.ndarray, last: int) -> np.ndarray:
    """Return (P,) gaps, without those that the neighbouring periods contradict.

    Behind a gap of k lost samples every later period is k samples early. Friction and backlash also
    delay a part of a period against the next one, but the periods before and after are in place. A
    gap before the first whole period, or behind the last one, cannot be compared and stays.
    """
    whole = np.flatnonzero(gaps == 0)
    if whole.size < 2 or whole.size == gaps.size:
        return gaps
    lines = np.arange(1, min(last, (y.shape[1] - 1) // 2) + 1)
    spectra = [rfft_at(y[j], lines) for j in whole]
    steps = np.array(
        [
            _period_delay(one, later, lines=lines, n_samples=y.shape[1])
            for one, later in pairwise(spectra)
        ]
    )
    difference = np.diff(whole)
    if (difference == 1).any():
        pace = float(np.median(steps[difference == 1]))
    else:
        pace = 0.0
    kept = gaps.copy()
    for first, end, step in zip(whole[:-1], whole[1:], steps - pace * difference, strict=True):
        total = gaps[first:end].sum()
        if total and abs(step - total) >= abs(step):
            kept[first:end] = 0.0
    return kept


def _period_delay(
    one: np.ndarray, later: np.ndarray, *, lines: np.ndarray, n_samples: int
) -> float:
    """Return the delay of a period against another [samples] from their spectra (F,)."""
    cross, slope = later * one.conj(), 2 * np.pi * lines / n_samples
    weight = float(np.sum(slope**2 * np.abs(cross)))
    delay = float(likeliest_lag(cross, lines, n_samples))
    for _ in range(3):
        delay -= float(np.sum(slope * (cross * np.exp(1j * slope * delay)).imag)) / max(
            weight, TINY
        )
    return delay


def likeliest_lag(cross: np.ndarray, lines: np.ndarray, n_samples: int) -> int:
    """Return the shift of a period against another, at most an eighth of it [samples], from their
    cross spectrum.
    """
    spectrum = np.zeros(n_samples // 2 + 1, dtype=complex)
    spectrum[lines] = cross
    correlation = np.fft.irfft(spectrum, n_samples)
    reach = max(2, n_samples // 8)
    late, early = int(np.argmax(correlation[:reach])), int(np.argmax(correlation[-reach:]))
    if correlation[late] >= correlation[early - reach]:
        return late
    return early - reach


def find_corrupted_periods(
    y: np.ndarray, last: int, gaps: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return (P,) bool the periods with several gaps inside, and (P,) all gaps including theirs.

    A part between two gaps that compensate each other is shifted; all that follows is in place. If
    only two periods differ, both are returned.

    Parameters
    ----------
    y : (P, N) ndarray
        Periods of one signal.
    last : int
        Last excited line.
    gaps : (P,) ndarray
        Result of `find_slips`: a gap found there explains the difference of two periods.

    Examples
    --------
    >>> y = np.random.default_rng(1).standard_normal((1, 400)).repeat(4, axis=0).ravel()
    >>> y[920:1080] = y[921:1081]
    >>> find_corrupted_periods(y.reshape(4, 400), 200, np.zeros(4))[0]
    array([False, False,  True, False])
    """
    difference = [_cumulative_power(one - following) for one, following in pairwise(y)]
    noise = _least_noise(difference, y[-1])
    mismatched = np.zeros(len(y) + 1, dtype=bool)
    corrupted = np.zeros(len(y), dtype=bool)
    total = gaps.copy()
    for j, up_to in enumerate(difference):
        if gaps[j] or gaps[j + 1]:
            continue
        found, shift = _has_slip_pair(y[j], y[j + 1], difference=up_to, noise=noise, last=last)
        if found and shift:  # the part before both gaps is shifted in the next period
            corrupted[j], total[j] = True, shift
        elif found:
            mismatched[j + 1] = True  # one of the two periods: nothing is lost
        else:
            backwards = up_to[-1] - up_to[::-1]
            found, shift = _has_slip_pair(
                y[j + 1, ::-1], y[j, ::-1], difference=backwards, noise=noise, last=last
            )
            if found:
                corrupted[j + 1], total[j + 1] = True, shift
    if len(y) == 2:
        return corrupted | mismatched[1], total
    corrupted |= mismatched[1:] & mismatched[:-1]
    corrupted[0] |= mismatched[1] and not (mismatched[2] or corrupted[1])
    corrupted[-1] |= mismatched[-2] and not (mismatched[-3] or corrupted[-2])
    return corrupted, total


def _least_noise(difference: list[np.ndarray], y: np.ndarray) -> float:
    """Return the mean power of the difference of two periods in the quarter of the period where it
    is least.

    `difference` holds `_cumulative_power` (N + 1,) of each pair; the lower limit is the rounding of
    y (N,).
    """
    n = y.size
    quarter = min(float(np.diff(up_to[np.arange(5) * n // 4]).min()) for up_to in difference)
    return max(4 * quarter, _ROUNDING_POWER * float(power(y))) / n


def _has_slip_pair(
    one: np.ndarray, following: np.ndarray, *, difference: np.ndarray, noise: float, last: int
) -> tuple[bool, int]:
    """Return whether an inner part of a period is shifted in the next one, and the shift of the
    part before it.
    """
    n = one.size
    blur = max(n / (2 * last), 1.0)
    if not _is_uneven(difference, max(_ROUNDING_POWER * float(power(following)) / n, TINY), blur):
        return False, 0
    tried = [0, *_SHORT_SHIFTS, *_candidate_lags(one, following, last)]
    # a long period is examined at _FINE places, with some samples at each
    stride = max(1, n // _FINE)
    size, edge = min(stride, _PLACE), -(-_MAX_SHORT_SHIFT // stride)  # as in `_slip_length`
    at = np.arange(0, n - stride + 1, stride)[:, None] + np.arange(size)

    def from_there(x: np.ndarray, shift: int) -> np.ndarray:
        """Return the cumulative power of the difference of x and the next period, shifted, at the
        places.
        """
        return np.append(0.0, np.add.accumulate(power(x - following[(at + shift) % n])))

    here = one[at]
    left = np.array([from_there(here, shift) for shift in tried])
    difference = left[0]

    def explained(shift: int, begin: int, end: int) -> bool:
        """Return whether a shift explains the whole difference there."""
        begin, end = begin + edge, end - edge
        if (end - begin) * size < _MIN_SAMPLES:
            return False
        whole, rest = difference[end] - difference[begin], left[shift, end] - left[shift, begin]
        if whole - rest < _MIN_LOG_LIKELIHOOD * blur * noise:
            return False
        parts = begin + np.arange(5) * (end - begin) // 4
        step = from_there(following[at], tried[shift])
        by_parts = np.diff(difference[parts] - left[shift, parts])
        matches = rest <= max(_MAX_REST * whole, 2 * (end - begin) * size * noise)
        matches &= by_parts.min() > _SPIKE_SHARE * by_parts.sum()
        if not (
            matches
            and _confirms_shift(parts, difference, left=left[shift], step=step, noise=noise * blur)
        ):
            return False
        noise_there = one[begin * stride : end * stride]
        noise_there = noise_there - np.roll(following, -tried[shift])[begin * stride : end * stride]
        return bool(
            whole - rest
            > _MIN_LOG_LIKELIHOOD
            * _correlation_length(noise_there)
            * power(noise_there)
            / noise_there.size
        )

    # one shift up to the first gap, another up to the second: the pair with the least rest
    slip_gain = (difference - left[1:]).max(axis=1)
    for before in ([0], (np.argsort(slip_gain)[-_MIN_PERIODS:] + 1).tolist()):
        least = np.inf, 0, 0, 0, 0
        for i in before:
            from_first = np.minimum.accumulate(left[i] - left[1:], axis=1)
            for j, rest in enumerate(from_first + left[1:] - difference, 1):
                end = int(np.argmin(rest))
                if rest[end] < least[0]:
                    least = (
                        float(rest[end]),
                        i,
                        j,
                        int(np.argmin((left[i] - left[j])[: end + 1])),
                        end,
                    )
        _, i, j, begin, end = least
        behind = min(end + edge, difference.size - 1)
        if begin < edge or difference[-1] - difference[behind] > 2 * at.size * noise:
            continue
        if explained(j, begin, end) and (i == 0 or explained(i, 0, begin)):
            ends = begin * stride, behind * stride
            parts = zip((i, j, 0), np.split(np.arange(n), ends), strict=True)
            left_of_gaps = one - np.concatenate(
                [np.roll(following, -tried[k])[some] for k, some in parts]
            )
            return not _is_free_response(
                one - following, left_of_gaps, begin=ends[0], gap=ends[1]
            ), tried[i]
    return False, 0


def _candidate_lags(one: np.ndarray, following: np.ndarray, last: int) -> list[int]:
    """Return the likeliest longer shifts between parts of two periods, from the phases of all
    lines.
    """
    n = one.size
    cross = rfft(one).conj() * rfft(following)
    cross[0], cross[last + 1 :] = 0.0, 0.0
    reach = max(2, n // 8)
    lag_correlation = np.fft.irfft(cross / np.maximum(np.abs(cross), TINY), n)
    lag_correlation = np.concatenate([lag_correlation[-reach:], lag_correlation[: reach + 1]])
    lag_correlation[max(reach - _MAX_SHORT_SHIFT, 0) : reach + _MAX_SHORT_SHIFT + 1] = -np.inf
    found: set[int] = set()
    for _ in range(_N_LIKELIEST):
        best = int(lag_correlation.argmax())
        found |= {best - reach + offset for offset in (-1, 0, 1)}
        lag_correlation[max(best - _MAX_SHORT_SHIFT, 0) : best + _MAX_SHORT_SHIFT + 1] = -np.inf
    return sorted(found)


def _confirms_shift(
    parts: np.ndarray, difference: np.ndarray, *, left: np.ndarray, step: np.ndarray, noise: float
) -> bool:
    """Return whether each part of a signal is explained by the whole shift and by nothing less.

    Arguments are `_cumulative_power`: of the difference before and after the shift, and of the step
    that it makes.
    """
    before, after, size = (np.diff(x[parts]) for x in (difference, left, step))
    return bool(
        (
            np.abs(before - after - size) < 2 * _WHOLE_TOLERANCE * size + 6 * np.sqrt(noise * size)
        ).all()
    )


def _slip_length(
    one: np.ndarray, following: np.ndarray, *, difference: np.ndarray, noise: float, last: int
) -> int:
    """Return the shift of the first part of a period against the next one [samples]; 0 if there is
    none.

    The remainder must match unshifted, within noise. A transient matches at no shift, so it is not
    mistaken for a gap. `difference` is the `_cumulative_power` of the difference of both.
    """
    n = one.size
    blur = max(n / (2 * last), 1.0)  # samples per independent one
    if not _is_uneven(difference, max(_ROUNDING_POWER * float(power(following)) / n, TINY), blur):
        return 0
    found, most = 0, 0.0
    for shift in _candidate_shifts(one, following, difference):
        there = np.roll(following, -shift)
        left, step = _cumulative_power(one - there), _cumulative_power(there - following)
        gap = int(np.argmax(difference - left))
        # samples inserted at the gap match nowhere, and a spike can be shifted past it
        end = max(gap - _MAX_SHORT_SHIFT, 0)
        explained, behind = difference[end] - left[end], difference[-1] - difference[gap]
        if n - gap > _MIN_SAMPLES * blur:
            least = min(noise, behind / (n - gap))
        else:
            least = noise
        sure = _MIN_LOG_LIKELIHOOD * blur * max((left[end] + behind) / n, least)
        if min(explained, left[-1] - left[gap] - behind) < sure or left[end] > max(
            _MAX_REST * difference[end], 2 * end * least
        ):
            continue
        # behind a gap each quarter of the part needs the whole shift
        if explained > most and _confirms_shift(
            np.arange(5) * end // 4, difference, left=left, step=step, noise=noise * blur
        ):
            rest = (one - there)[:end]
            remainder = one - np.where(np.arange(n) < gap, there, following)
            if explained > _MIN_LOG_LIKELIHOOD * _correlation_length(rest) * power(
                rest
            ) / end and not _is_free_response(one - following, remainder, begin=0, gap=gap):
                found, most = shift, explained
    return found


def _is_free_response(difference: np.ndarray, left: np.ndarray, *, begin: int, gap: int) -> bool:
    """Return whether damped modes explain the difference of two periods (N,) as well as a gap,
    which leaves `left`.

    A free response of n modes has a Hankel matrix of rank 2 n. The difference before a gap has no
    low rank, because it ends abruptly. So equally many samples before the gap, from `begin` on, and
    behind it are used.
    """
    reach = min(gap - begin, difference.size - gap)
    if 2 * reach < _MIN_SAMPLES:
        return True  # too few samples to decide
    some = slice(gap - reach, gap + reach)
    modes = np.linalg.svd(_hankel(difference[some]), compute_uv=False)
    return bool(power(modes[TRANSIENT_RANK:]) <= power(_hankel(left[some]).ravel()))


def modal_share(difference: np.ndarray, noise: float = 0.0, *, rank: int = TRANSIENT_RANK) -> float:
    """Return the share of the power of a difference of periods (N,) about its mean that damped
    modes explain.

    Noise of variance `noise` counts as explained.
    """
    matrix = _hankel(difference - difference.mean())
    modes, noise = np.linalg.svd(matrix, compute_uv=False), noise * matrix.size
    return float(1 - (power(modes[rank:]) - noise) / max(float(power(modes)), TINY))


def _hankel(x: np.ndarray) -> np.ndarray:
    """Return the Hankel matrix of a signal (n,), as square as it can be, of at most _HANKEL_SAMPLES
    samples.
    """
    x = x[:: -(-x.size // _HANKEL_SAMPLES)]
    return sliding_window_view(x, x.size // 2)


def _correlation_length(noise: np.ndarray) -> float:
    """Return the correlation length [samples]: the number of samples per independent estimate of
    the noise power.

    It is the sum of the squared autocorrelation of noise (n,), at least 1. The power of noise from
    a resonance varies from place to place like that of white noise with hundreds of times fewer
    samples.
    """
    spectrum = squared_modulus(rfft(noise))[1:]
    total = float(spectrum.sum())
    # white noise gives 2, because each line of a periodogram has a chi-square distribution of its
    # own
    if total > 0:
        return max(float(spectrum.size * power(spectrum) / total**2 - 1), 1.0)
    return 1.0


def _cumulative_power(x: np.ndarray) -> np.ndarray:
    """Return (N + 1,) energy of x (N,) up to each sample."""
    return np.append(0.0, np.add.accumulate(x * x))


def _is_uneven(difference: np.ndarray, floor: float, blur: float) -> bool:
    """Return whether two variances, before and behind some sample, explain a difference far better
    than one.
    """
    n = difference.size - 1
    parts = min(_N_PARTS, n)
    at = np.arange(1, parts) * n // parts
    before, whole = np.maximum(difference[at] / at, floor), max(difference[-1] / n, floor)
    behind = np.maximum((difference[-1] - difference[at]) / (n - at), floor)
    gain = n * np.log(whole) - at * np.log(before) - (n - at) * np.log(behind)
    return bool(gain.max() > 2 * _UNEVEN_LOG_LIKELIHOOD * blur)


def _candidate_shifts(one: np.ndarray, following: np.ndarray, difference: np.ndarray) -> list[int]:
    """Return the shifts to try: the best fit of the samples up to half of the difference, and all
    short ones.
    """
    n = one.size
    half = int(np.searchsorted(difference, difference[-1] / 2))
    size = _cumulative_power(np.tile(following, 2))
    together = np.fft.irfft(np.fft.rfft(one[:half], n).conj() * np.fft.rfft(following), n)
    likeliest = int(np.argmin((size[half : half + n] - size[:n]) - 2 * together))
    likeliest -= n if likeliest > n // 2 else 0
    if abs(likeliest) <= _MAX_SHORT_SHIFT or abs(likeliest) > n // 8:
        return _SHORT_SHIFTS
    return [likeliest, *_SHORT_SHIFTS]
