"""Faults of one signal before it is cut into periods: a position that wraps, silence, outliers, hits of a hammer."""

from __future__ import annotations

import numpy as np

from nlfrf._base.arguments import data_warning, format_count

__all__ = ["excited_span", "unwrap_position", "warn_of_hits", "warn_of_outliers"]


# ---- A position that starts again at every turn jumps by a whole turn where it moves by little.

TURNS = (1.0, 2 * np.pi, 360.0)  # one turn of an encoder, in turns, radians and degrees
COUNTER_BITS = range(8, 33)  # of a counter, whose numbers are whole
MIN_SPAN = 0.9  # of a turn that a position takes before its jumps are looked at
MAX_STEP = 1 / 3  # of a turn from sample to sample, above which its direction is not known
NEIGHBOURS = 3  # steps on either side of a jump that are as large as what a whole turn leaves of it
PARTS = 20  # of a turn, each of which a position passes that turns on and on
MAX_PILE = 3.0  # times as many samples in the outer parts as beside them: a position stays nowhere, what saturates does


def unwrap_position(name: str, x: np.ndarray) -> np.ndarray:
    """Return a signal (n,) without the jumps by a whole turn of a position that wraps, and warn of them.

    Raises
    ------
    ValueError
        A position that turns so fast that its direction is not known.
    """
    low, high = float(x.min()), float(x.max())
    counters = [2.0**bits for bits in COUNTER_BITS] if high - low > MIN_SPAN * 2**8 and is_whole(x) else []
    for turn in (*TURNS, *counters):
        edge = 1e-6 * turn
        if MIN_SPAN * turn < high - low and any(s - edge <= low and high <= s + turn + edge for s in (0, -turn / 2)):
            break
    else:
        return x
    steps = np.diff(x)
    jumps = np.flatnonzero(np.abs(steps) > turn / 2)
    steps -= turn * np.round(steps / turn)
    if not jumps.size:
        return x
    filled = np.histogram(x, PARTS, (low, high))[0]
    passes = filled.min() > 0.2 * filled.mean() and filled[[0, -1]].sum() < MAX_PILE * filled[[1, -2]].sum()
    if np.abs(steps).max() > MAX_STEP * turn:
        if passes and jumps.size > x.size / 100:
            raise ValueError(
                f"{name} must move by less than a third of a turn of {turn:g} from sample to sample to be unwrapped, got "
                f"{jumps.size} jumps and steps up to {np.abs(steps).max():.3g}. Record it unwrapped, or sample faster"
            )
        return x
    around = jumps[:, None] + np.delete(np.arange(-NEIGHBOURS, NEIGHBOURS + 1), NEIGHBOURS)
    others = steps.copy()
    others[jumps] = 0.0
    largest = np.abs(others.take(around, mode="clip")).max(axis=1)
    stands = np.mean((x == low) | (x == high)) > 2 / PARTS  # as a switch, or what saturates
    if stands or np.mean(np.abs(steps[jumps]) <= 2 * largest) < MIN_SPAN:
        return x
    data_warning(
        f"{name} wraps at a turn of {turn:.6g}: {format_count(jumps.size, 'jump')} by a whole turn, the first at sample "
        f"{jumps[0] + 1}. They were taken out; record the position unwrapped where this is not an angle or a counter"
    )
    return np.append(x[0], x[0] + np.add.accumulate(steps))


def is_whole(x: np.ndarray) -> bool:
    """Return whether all of a signal are whole numbers."""
    return bool(np.array_equal(x, np.round(x)))


# ---- Silence before the excitation, and behind it.

QUIET_PART = 8  # of a period, that is silent at least
QUIET = 0.1  # of the level of the excitation: what is louder is no silence
PEAK_TO_PEAK = 8.0  # over the rms, of random phases
QUIET_SIGMAS = 6.0  # of the noise in the silence, from which a sample belongs to the excitation
MIN_AWAY = 0.1  # of the samples one period on are so: else the signal is silent there in every period


def excited_span(u: np.ndarray, n_samples: int) -> slice:
    """Return which samples of an excitation (n,) of so long a period stand between silence before it and behind it.

    Examples
    --------
    >>> u = np.tile(np.random.default_rng(1).standard_normal(100), 3)
    >>> excited_span(np.concatenate([np.zeros(130), u, np.zeros(70)]), 100)
    slice(130, 430, None)
    """
    return slice(leading_silence(u, n_samples), u.size - leading_silence(u[::-1], n_samples))


def leading_silence(u: np.ndarray, n_samples: int) -> int:
    """Return how many samples are silent before an excitation; 0 where that is usual in a period of it."""
    quiet = u[: max(n_samples // QUIET_PART, 4)]
    level, noise = float(np.ptp(u)) / PEAK_TO_PEAK, float(np.std(quiet))
    if u.size < 2 * n_samples or noise > QUIET * level:
        return 0
    least = QUIET_SIGMAS * noise + 1e-9 * level
    away = np.abs(u - quiet.mean()) > least
    begin = int(np.argmax(away))
    later = max(n_samples, begin)
    if begin < quiet.size or np.mean(away[later : later + min(begin, n_samples)]) < MIN_AWAY:
        return 0
    # what is as small one period later may as well belong to it
    differs = np.abs(u[n_samples : n_samples + begin] - u[:begin][: u.size - n_samples]) > 2**0.5 * least
    return int(differs.size - np.argmax(differs[::-1])) if differs.any() else begin


# ---- Samples that stand far out of all others, and repeat in no other period.

SAMPLES_FOR_LEVEL = 1 << 16
BODY, MIN_OVER_BODY = 0.9, 4.0  # share of the samples that are no outliers for sure, and how far beyond them these are
OUTLIER_RATIO = 2.0  # to the largest of all others
MAX_OUTLIERS = 0.05  # of all samples


def find_outliers(y: np.ndarray, n_samples: int) -> tuple[np.ndarray, float]:
    """Return the places of the outliers of a signal (n,), and the largest distance of the others from its median."""
    some = y[:: -(-y.size // SAMPLES_FOR_LEVEL)]
    middle = float(np.median(some))
    body = float(np.quantile(np.abs(some - middle), BODY))
    none = np.array([], dtype=int), 0.0
    if max(float(y.max()) - middle, middle - float(y.min())) <= MIN_OVER_BODY * body or body == 0:
        return none
    distance = np.abs(y - middle)
    beyond = np.sort(distance[distance > body])
    ratios = beyond[1:] / beyond[:-1]
    k = int(np.argmax(ratios))
    outliers = np.flatnonzero(distance >= beyond[k + 1])
    periods = outliers[:, None] + n_samples * np.array([-1, 1])
    repeated = np.isin(periods, outliers).any(axis=1)
    if ratios[k] < OUTLIER_RATIO or outliers.size > MAX_OUTLIERS * y.size or repeated.mean() > 0.5:
        return none
    return outliers, float(beyond[k])


def warn_of_outliers(name: str, y: np.ndarray, *, u: np.ndarray, n_samples: int, fs: float) -> None:
    """Warn of outliers of an output y (n,) that its input u has not."""
    places, largest = find_outliers(y, n_samples)
    if places.size and not find_outliers(u, n_samples)[0].size:
        first, values = int(places[0]), np.unique(y[places])
        same = f"all of {values[0]:g}, as a mark of no value, " if places.size > values.size == 1 else ""
        data_warning(
            f"{name} has {format_count(places.size, 'outlier')}, {same}the first of {y[first]:.6g} at sample {first} "
            f"({first / fs:.6g} s): no other sample is further than {largest:.3g} from the median. A spike "
            "adds the same error to all lines; mend the file, or leave that period out"
        )


# ---- Hits of a hammer: short pulses that neither time nor height repeat.

HIT_CREST = 10.0  # from the lowest to the highest sample over the rms: of a multisine 5 to 8
HIT_SHARE, HIT_HEIGHT = 0.03, 0.3  # of the samples that pulses take, and of the highest above which they do
SAME_TIME, SAME_HEIGHT = 2, 0.1  # samples, and share, by which pulses of a generator may differ


def warn_of_hits(name: str, u: np.ndarray) -> None:
    """Warn of an excitation (n,) of short pulses that do not repeat in time and height."""
    middle = np.add.reduce(u) / u.size
    variance = max(float(np.vdot(u, u)) / u.size - middle**2, 0.0)
    if np.ptp(u) < HIT_CREST * variance**0.5:
        return
    height = np.abs(u - middle)
    high = np.flatnonzero(height > HIT_HEIGHT * height.max())
    first = np.flatnonzero(np.diff(high, prepend=-u.size) > HIT_SHARE * u.size / high.size)
    at, size = high[first], np.maximum.reduceat(height[high], first)
    if at.size < 2 or high.size > HIT_SHARE * u.size:
        return
    for m in range(1, at.size // 2 + 1):  # pulses in a period
        if np.ptp(at[m:] - at[:-m]) <= SAME_TIME and np.abs(size[m:] / size[:-m] - 1).max() < SAME_HEIGHT:
            return
    data_warning(
        f"{name} looks like {at.size} hits of a hammer: pulses in {100 * high.size / u.size:.2g} % of the samples that "
        "repeat neither in time nor in height. They are no periods, and do not separate distortion from noise. Play a "
        "periodic multisine, or give the FRF of the hits to bla_from_frf"
    )
