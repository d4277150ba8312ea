"""Clocks: names of time channels and of sampling frequencies, the sampling frequency of a time
axis.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from nlfrf._base.numbers import BLOCK_ENTRIES, all_finite, iterate_blocks
from nlfrf.io.readers.names import TURN, parse_bracket, parse_unit, suits

#: A unit in brackets behind a name. Whole numbers are an index, `setpoint[0]`, `DCOM(1,2)`; "ratio
#: [1]" has a unit. The length is limited, and blanks are tried from their first one only: names of
#: many brackets or blanks took minutes.
UNIT_SUFFIX = re.compile(
    r"(?<!\s)(?:\s+(?=\[1\])|\s*(?![\[(]\s*\d[\d,;:\s]*[\])]))[\[(]([^\])]{0,200}+)[\])]\s*$"
)
NUMBER_SUFFIX = re.compile(r"\.\d+$")  # number that distinguishes channels with one name
#: A rate in samples a second, as "kS/s", "Sa/s", "MSPS", "samples per second".
_RATE_UNIT = re.compile(r"([kMGm]?)\s*(?:s(?:a|amples?)?(?:/| per )s(?:ec|econd)?|sps)", re.I)
_TIME_WORDS = (
    r"t|time|tout|(?:uhr)?zeit|zeitstempel|temps|tempo|tiempo|tijd|timestamps?|time stamp|date["
    r" _]?time|date|datum|"
    r"x[._ ]data|x[._ -]?axis|x_value"
)
#: A time channel, possibly with its unit behind an underscore: "t", "time_ms", "Elapsed time".
_TIME_NAME = re.compile(
    rf"(?:(?:elapsed|relative|rel|absolute|abs|sample|utc)[ _])?(?:{_TIME_WORDS})(?:["
    r" _]([a-zµμ]+))?",
    re.I,
)
#: Names of a sampling frequency and of a sampling time, as variables and in a preamble.
RATE_WORDS = r"sampl(?:e[drs]?|ing)?[ _]?(?:rate|freq\w*)|abtastrate|fs|f[ _]?sample"
STEP_WORDS = (
    r"sampl(?:e[drs]?|ing)?[ _]?(?:time[ _]?)?(?:interval|time|period)|t[ _]?sample|cycle[ _]?time|"
    r"abtastzeit|zykluszeit|delta[ _]?[tx]|[tx][ _]?incr?(?:ement)?|dt|ts"
)
RATE_NAME, STEP_NAME = re.compile(RATE_WORDS, re.I), re.compile(rf"{STEP_WORDS}|increment", re.I)
# share of a step by which a time axis may run backwards, as times noted by a computer do
_MAX_BACKWARD_STEP = 0.5
#: Largest median deviation of the steps from the usual one, relative to it. A clock with a jitter
#: of a tenth of a step (rms) has 0.095; an angle that is the sum of the magnitudes of a multisine
#: has 0.48.
_MAX_UNEVEN_STEP = 0.25
MIN_DURATION = 1.0  # [s] above which a "sampling time" may be the duration of the record
#: Largest relative difference of a time axis with unequal steps from a clock with three digits,
#: which replaces it.
_CLOCK_TOLERANCE = 2e-4


def is_time_name(name: str) -> bool:
    """Return whether a channel has the name of a time: "t", "time [ms]", "run.time_ms", "Zeit (s)".

    >>> [is_time_name(name) for name in ("t", "run.Time_ms", "Elapsed Time (s)", "time_constant", "output")]
    [True, True, True, False, False]
    """
    for short in (UNIT_SUFFIX.sub("", name), UNIT_SUFFIX.sub("", name).rsplit(".", 1)[-1]):
        found = _TIME_NAME.fullmatch(short.strip(" _"))
        if found and (found[1] is None or seconds_per_unit(found[1])):
            return True
    return False


def unit_in_name(name: str) -> str | None:
    """Return the unit in a name, in brackets or, for a time, behind an underscore; None if there is
    none.

    >>> [unit_in_name(name) for name in ("force [N]", "U(mV)", "V(in)", "speed (ref)", "I(R1)", "time (ticks)", "t_ms")]
    ['N', 'mV', None, None, None, 'ticks', 'ms']
    """
    name = NUMBER_SUFFIX.sub("", name)
    if bracket := UNIT_SUFFIX.search(name):
        is_unit = parse_bracket(name[: bracket.start(1) - 1], bracket[1]) is not None
        if is_unit or is_time_name(name):
            return bracket[1].strip()
        return None
    found = _TIME_NAME.fullmatch(name.rsplit(".", 1)[-1].strip())
    if found and found[1] and is_time_name(name):
        return found[1]
    return None


def split_clock_name(name: str) -> tuple[str, str]:
    """Split the name of a sampling time or frequency into its key, for `STEP_NAME` and `RATE_NAME`,
    and its unit.

    >>> [split_clock_name(name) for name in ("Sampling_Time_us", "Ts", "fs_kHz", "offset_s")]
    [('samplingtime', 'us'), ('ts', ''), ('fs', 'kHz'), ('offset', 's')]
    """
    head, _, unit = name.strip().rpartition("_")
    known = head and (seconds_per_unit(unit) is not None or hertz_per_unit(unit) is not None)
    if known:
        key, unit = head, unit
    else:
        key, unit = name, ""
    return key.replace("_", "").replace(" ", "").lower(), unit


def seconds_per_unit(unit: str) -> float | None:
    """Return the seconds in a unit of time, 1 without a unit; None if it is unknown."""
    if suits("time", parse_unit(unit)):
        found = parse_unit(unit)
    else:
        found = parse_unit(unit.lower())
    if found and suits("time", found):
        return found.factor
    if unit.strip():
        return None
    return 1.0


def hertz_per_unit(unit: str) -> float | None:
    """Return the hertz in a unit of a sampling frequency; None if it is unknown, or mHz, which may
    mean MHz.

    >>> [hertz_per_unit(unit) for unit in ("kHz", "MS/s", "", "samples/s", "N", "mHz")]
    [1000.0, 1000000.0, 1.0, 1.0, None, None]
    """
    found = parse_unit(_RATE_UNIT.sub(r"\1Hz", unit.strip()))
    if found is None or unit.strip().startswith("m"):
        if unit.strip():
            return None
        return 1.0
    if not suits("frequency", found) and found.powers != (("s", -1),):
        return None
    return float(f"{found.factor / (TURN if found.powers[0][0] == 'rad' else 1.0):.12g}")


def sampling_frequency(t: np.ndarray) -> float:
    """Return the sampling frequency of a time axis, which may be rounded, jitter or have gaps; 0 if
    it has none.

    An axis that runs backwards is no clock: it has two runs in a row, or is another quantity named
    t. Clocks have round numbers: of all frequencies that the axis allows, the one with the fewest
    digits is returned.

    >>> sampling_frequency(np.round(np.arange(20_000) / 16384, 6))
    16384.0
    """
    t = t.astype(float, copy=False)
    if not all_finite(t):
        t = t[np.isfinite(t)]
    if t.size < 2:
        return 0.0
    sample = np.arange(0, t.size - 1, max(1, t.size // BLOCK_ENTRIES))
    usual = float(np.median(t[sample + 1] - t[sample]))
    least, n_gaps = np.inf, 0
    for steps in _iterate_steps(t):
        least = min(least, float(steps.min()))
        n_gaps = n_gaps + int(np.count_nonzero(steps > 1.5 * usual))
    if least < -_MAX_BACKWARD_STEP * usual or usual < 0:
        return 0.0
    # otherwise the times are only printed coarsely
    if least > 0.5 * usual and n_gaps < 0.1 * (t.size - 1):
        most = 1.5 * usual
    else:
        most = np.inf
    n, span, highest, squares = 0, 0.0, -np.inf, 0.0
    for steps in _iterate_steps(t):
        if most != np.inf:
            steps = steps[steps <= most]
        n = n + steps.size
        span = span + float(steps.sum())
        squares = squares + float(np.sum((steps - usual) ** 2))
        highest = max(highest, float(steps.max(initial=-np.inf)))
    if not 0 < span < np.inf:
        return 0.0
    fs, tolerance = n / span, max((highest - least) / span, 1e-12)
    spread = np.sqrt(max(squares / n - (span / n - usual) ** 2, 0.0))
    rough = _CLOCK_TOLERANCE if spread > 1e-6 / fs else 0.0
    for n in range(1, 18):
        rounded = float(f"{fs:.{n}g}")
        if abs(rounded / fs - 1) <= max(tolerance, rough if n <= 3 else 0.0):
            break
    return rounded


def is_rising(stream: np.ndarray) -> bool:
    """Return whether a stream runs forward by mostly even steps, as times and counters do; nan is
    ignored.

    >>> is_rising(np.array([0.0, 0.1, 0.2, 0.5, 0.6])), is_rising(np.array([0.0, 0.2, 0.1])), is_rising(np.zeros(9))
    (True, False, False)
    """
    if any(np.any(steps < 0) for steps in _iterate_steps(stream)):
        return False
    steps = np.diff(stream[:BLOCK_ENTRIES])
    steps = steps[np.isfinite(steps)]
    if steps.size:
        usual = float(np.median(steps))
    else:
        usual = 0.0
    return usual > 0 and float(np.median(np.abs(steps - usual))) < _MAX_UNEVEN_STEP * usual


def _iterate_steps(t: np.ndarray) -> Iterator[np.ndarray]:
    """Yield the steps of a time axis in blocks."""
    for some in iterate_blocks(t.size - 1):
        yield np.diff(t[some.start : some.stop + 1])
