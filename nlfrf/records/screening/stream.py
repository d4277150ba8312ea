"""Faults of one signal before it is cut into periods: a position that jumps back after each turn,
silence, outliers, hammer hits.
"""

from __future__ import annotations

import numpy as np

from nlfrf._base.arguments import data_warning, format_count
from nlfrf._base.numbers import clipped_share

# ---- Positions that wrap: they jump by a whole turn while the machine moves a little.

_TURNS, _COUNTER_BITS = (
    (1.0, 2 * np.pi, 360.0),
    range(8, 33),
)  # of encoders, and of counters with whole numbers
#: In turns or shares: smallest span of a position; largest step, because above a half its direction
#: is unknown; number of parts of the span; share of samples in the first and last part that shows
#: that a position passes the ends, and its largest ratio to the share in the next two parts;
#: smallest share of each part, over the mean, while a position turns on and on; and step above
#: which most jumps occur by chance, not at an end.
_MIN_SPAN = 0.9
_MAX_STEP = 0.45
_PARTS = 20
_MIN_EDGE = 0.03
_MAX_PILE = 3.0
_MIN_EVEN = 0.6
_MAX_CROSSING = 0.25
#: Largest step of a slow position, in turns: no raw step then lies between it and one turn minus
#: it.
_MAX_SLOW = 0.3
#: Steps on either side of a jump that are as large as the jump minus a whole turn; share of jumps
#: for which this must hold; share of samples at the largest and smallest value, above which the
#: signal is a switch or has a limit.
_NEIGHBOURS, _MIN_SMOOTH, _MAX_STANDSTILL = 3, 0.9, 0.2


def _find_turn(low: float, high: float, whole: bool) -> float:
    """Return the turn that a position from low to high spans: of an angle, or of a counter if
    whole; else 0.
    """
    for turn in (*_TURNS, *(2.0**bits for bits in _COUNTER_BITS if whole)):
        starts = [
            start
            for start in (0.0, -turn / 2)
            if start - 1e-6 * turn <= low and high <= start + turn * (1 + 1e-6)
        ]
        if starts and _MIN_SPAN * turn < high - low:
            return turn
    return 0.0


def unwrap_position(name: str, x: np.ndarray) -> np.ndarray:
    """Return a signal (n,) without the jumps by a whole turn of a position that wraps, and warn of
    them.

    Raises
    ------
    ValueError
        The position turns so fast that its direction is unknown.
    """
    low, high = float(x.min()), float(x.max())
    whole = high - low > _MIN_SPAN * 2 ** _COUNTER_BITS[0] and np.array_equal(x, np.round(x))
    if not (turn := _find_turn(low, high, whole)):
        return x
    steps = np.diff(x)
    jumps = np.flatnonzero(np.abs(steps) > turn / 2)
    if not jumps.size:
        return x
    steps -= turn * np.round(steps / turn)
    size = np.abs(steps)
    # a step taken in the wrong direction differs from its neighbours by a whole turn
    fast = size.max() > _MAX_STEP * turn and np.abs(np.diff(steps)).max(initial=0.0) > turn / 2
    share = np.histogram(x, _PARTS, (low, high))[0] / x.size
    ends = share[[0, -1]].sum()
    stands = np.mean((x == low) | (x == high)) > _MAX_STANDSTILL or clipped_share(x) > 0
    if (
        fast
        and not stands
        and _MIN_EDGE < ends < _MAX_PILE * share[[1, -2]].sum()
        and jumps.size > x.size / 100
    ):
        found = (
            f"{jumps.size} jumps by a whole turn of {turn:g}, and other steps up to"
            f" {size.max():.3g}"
        )
        if share.min() > _MIN_EVEN / _PARTS:
            raise ValueError(
                f"{name} must move by less than half a turn from sample to sample to be unwrapped,"
                f" got {found}. Record it unwrapped, or sample faster"
            )
        data_warning(
            f"{name} has {found}. It is left unchanged; if it is a position that wraps, record it"
            " unwrapped"
        )
    around = jumps[:, None] + np.delete(np.arange(-_NEIGHBOURS, _NEIGHBOURS + 1), _NEIGHBOURS)
    left, quantum, others = size[jumps], size[size > 0].min(initial=turn), np.delete(size, jumps)
    # a slow position has no step of about half a turn, and its steps at jumps are as large as all
    # others
    slow = (
        size.max() <= _MAX_SLOW * turn and np.median(left) <= 2 * np.quantile(others, 0.9) + quantum
    )
    size[jumps] = 0.0
    smooth = np.count_nonzero(left <= 2 * size.take(around, mode="clip").max(axis=1) + quantum)
    # a signal that spans a turn by chance has its largest steps far from the ends
    by_chance = ends < _MIN_EDGE and np.count_nonzero(left > _MAX_CROSSING * turn) > jumps.size / 2
    if fast or not (slow or smooth > _MIN_SMOOTH * jumps.size) or by_chance or stands:
        return x
    data_warning(
        f"{name} wraps at a turn of {turn:.6g}: {format_count(jumps.size, 'jump')} by a whole turn,"
        f" the first at sample {jumps[0] + 1}. They were removed; record the position unwrapped if"
        " this is no angle and no counter"
    )
    return np.unwrap(x, period=turn)


# ---- Silence before and behind the excitation.

#: Shortest silence as a part of a period; its largest noise over the level; peak to peak over the
#: level, for random phases; noise multiple above which a sample belongs to the excitation; share of
#: such samples one period later.
_QUIET_PART, _QUIET, _PEAK_TO_PEAK, _QUIET_SIGMAS, _MIN_AWAY = 8, 0.1, 8.0, 6.0, 0.1


def excited_span(u: np.ndarray, n_samples: int) -> slice:
    """Return the samples of an excitation (n,) with period n_samples, without the silence before
    and behind it.

    Examples
    --------
    >>> u = np.tile(np.random.default_rng(1).standard_normal(100), 3)
    >>> excited_span(np.concatenate([np.zeros(130), u, np.zeros(70)]), 100)
    slice(130, 430, None)
    """
    return slice(_leading_silence(u, n_samples), u.size - _leading_silence(u[::-1], n_samples))


def _leading_silence(u: np.ndarray, n_samples: int) -> int:
    """Return the number of silent samples before an excitation; 0 if its periods contain such
    silence.
    """
    quiet = u[: max(n_samples // _QUIET_PART, 4)]
    level, noise = float(np.ptp(u)) / _PEAK_TO_PEAK, float(np.std(quiet))
    if u.size < 2 * n_samples or noise > _QUIET * level:
        return 0
    least = _QUIET_SIGMAS * noise + 1e-9 * level
    away = np.abs(u - quiet.mean()) > least
    begin = int(np.argmax(away))
    if (
        begin < quiet.size
        or np.mean(away[max(n_samples, begin) :][: min(begin, n_samples)]) < _MIN_AWAY
    ):
        return 0
    # samples that are as small one period later may belong to the excitation
    differs = (
        np.abs(u[n_samples : n_samples + begin] - u[:begin][: u.size - n_samples]) > 2**0.5 * least
    )
    if differs.any():
        return int(differs.size - np.argmax(differs[::-1]))
    return begin


# ---- Outliers: samples far outside all others, which repeat in no other period.

#: Samples that suffice for the median; share of samples that are certainly no outliers; smallest
#: distance of an outlier over that of these samples, and over that of all other samples; largest
#: share of outliers.
_SAMPLES_FOR_LEVEL = 1 << 16
_BODY = 0.9
_MIN_OVER_BODY = 4.0
_OUTLIER_RATIO = 2.0
_MAX_OUTLIERS = 0.05
#: A peak in more than this share of the periods belongs to the signal.
_MOST_PERIODS = 0.7


def find_outliers(y: np.ndarray, u: np.ndarray, n_samples: int) -> tuple[np.ndarray, float]:
    """Return the places of the outliers of an output y (n,), and the largest distance of other
    samples from the median.

    If the input u (n,) has pulses, there are no outliers: pulses make peaks of y.

    >>> y = np.tile(np.sin(np.arange(100)), 3)
    >>> y[120] = 9.0
    >>> find_outliers(y, np.tile(np.cos(np.arange(100)), 3), 100)[0]
    array([120])
    """
    none = np.zeros(0, dtype=int)
    some = y[:: -(-y.size // _SAMPLES_FOR_LEVEL)]
    middle = float(np.median(some))
    body = float(np.quantile(np.abs(some - middle), _BODY))
    if not 0 < _MIN_OVER_BODY * body < max(
        float(y.max()) - middle, middle - float(y.min())
    ) or _has_pulses(u):
        return none, np.inf
    distance = np.abs(y - middle)
    beyond = np.sort(np.append(distance[distance > body], body))
    k = int(np.argmax(beyond[1:] / beyond[:-1]))
    outliers = np.flatnonzero(distance > beyond[k])
    times = np.unique(outliers % n_samples, return_counts=True)[
        1
    ]  # how often each sample of the period is an outlier
    repeated = times[times > max(1, _MOST_PERIODS * (y.size // n_samples))].sum()
    few = outliers.size < _MAX_OUTLIERS * y.size and repeated <= outliers.size / 2
    if few and beyond[k + 1] > _OUTLIER_RATIO * beyond[k]:
        return outliers, float(beyond[k])
    return none, np.inf


def warn_of_outliers(name: str, y: np.ndarray, *, u: np.ndarray, n_samples: int, fs: float) -> bool:
    """Warn of outliers of an output y (n,) whose input u has no pulses; return whether it has
    some.
    """
    outliers, largest = find_outliers(y, u, n_samples)
    if outliers.size:
        first, values = int(outliers[0]), np.unique(y[outliers])
        if outliers.size > values.size == 1:
            same = f"all of {values[0]:g}, as a mark of no value, "
        else:
            same = ""
        data_warning(
            f"{name} has {format_count(outliers.size, 'outlier')}, {same}the first of"
            f" {y[first]:.6g} at sample {first} ({first / fs:.6g} s): no other sample is further"
            f" than {largest:.3g} from the median. A spike adds the same error to all lines. Its"
            " period is left out if at least half of the periods have none; else correct the file"
        )
    return bool(outliers.size)


# ---- Hits of a hammer: short pulses that repeat neither in time nor in height.

#: Peak to peak over the rms (5 to 8 for a multisine); largest share of samples in pulses; share of
#: the highest sample above which a sample is in a pulse; differences of pulses of a generator in
#: samples and as a share of the height.
_HIT_CREST, _HIT_SHARE, _HIT_HEIGHT, _SAME_TIME, _SAME_HEIGHT = 10.0, 0.03, 0.3, 2, 0.1


def _has_pulses(u: np.ndarray) -> bool:
    """Return whether a signal (n,) has higher peaks than one with random phases."""
    return bool(
        np.ptp(u) ** 2 > _HIT_CREST**2 * (np.vdot(u, u) / u.size - (np.add.reduce(u) / u.size) ** 2)
    )


def warn_of_hits(name: str, u: np.ndarray) -> None:
    """Warn of an excitation (n,) of short pulses that do not repeat in time and height."""
    if not _has_pulses(u):
        return
    height = np.abs(u - np.median(u))
    high = np.flatnonzero(height > _HIT_HEIGHT * height.max())
    first = np.flatnonzero(np.diff(high, prepend=-u.size) > _HIT_SHARE * u.size / high.size)
    at, size = high[first], np.maximum.reduceat(height[high], first)
    repeats = any(  # m pulses per period
        np.ptp(at[m:] - at[:-m]) <= _SAME_TIME
        and np.abs(size[m:] / size[:-m] - 1).max() < _SAME_HEIGHT
        for m in range(1, at.size // 2 + 1)
    )
    if high.size == 1 and np.median(height) > 0:
        data_warning(
            f"{name} has a pulse of one sample that does not repeat, an outlier of {u[at[0]]:.6g}"
            f" at sample {at[0]}: it adds the same error to all lines; correct the file, or leave"
            " its period out"
        )
    if at.size > 1 and high.size < _HIT_SHARE * u.size and not repeats:
        data_warning(
            f"{name} looks like {at.size} hits of a hammer: pulses in"
            f" {100 * high.size / u.size:.2g} % of the samples that repeat neither in time nor in"
            " height. They have no period, and do not separate distortion from noise. Play a"
            " periodic multisine, or give the FRF of the hits to bla_from_frf"
        )
