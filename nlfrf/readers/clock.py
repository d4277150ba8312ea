"""Clocks: names of time channels and of sampling frequencies, and the frequency of a time axis."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from nlfrf.shared.transforms import BLOCK, all_finite, blocks

__all__ = ["RATES", "STEPS", "UNIT", "frequency_of", "is_time", "seconds_of", "unit_of"]


UNIT = re.compile(r"\s*[\[(]([^\])]*)[\])]\s*$")
SECONDS = {
    **dict.fromkeys(("", "s", "sec", "secs", "second", "seconds", "sekunden"), 1.0),
    **dict.fromkeys(("ms", "msec", "millis", "millisecond", "milliseconds"), 1e-3),
    **dict.fromkeys(("us", "µs", "μs", "usec", "micros", "microsecond", "microseconds"), 1e-6),
    **dict.fromkeys(("ns", "nsec", "nanosecond", "nanoseconds"), 1e-9),
    **dict.fromkeys(("min", "minutes"), 60.0),
    **dict.fromkeys(("h", "hours"), 3600.0),
}
TIMES = r"t|time|tout|zeit|temps|tempo|tiempo|tijd|timestamps?|time stamp|x[._ ]data|x[._ -]?axis|x_value"
#: A time channel, with its unit behind an underscore where it is written so: "t", "time_ms", "Elapsed time".
TIME = re.compile(rf"(?:(?:elapsed|relative|rel|absolute|abs|sample|utc)[ _])?(?:{TIMES})(?:[ _]([a-zµμ]+))?", re.I)
RATES = ("fs", "samplerate", "samplingrate", "samplefrequency", "samplingfrequency", "fsample")
STEPS = ("ts", "dt", "deltat", "sampletime", "samplingtime", "tsample", "increment", "deltax")
ROUGH = 2e-4  # how far a time axis of uneven steps may be from a clock of three digits that is believed instead


def is_time(name: str) -> bool:
    """Whether a channel is called like a time: "t", "time [ms]", "run.time_ms", "Zeit (s)".

    >>> [is_time(name) for name in ("t", "run.Time_ms", "Elapsed Time (s)", "time_constant", "output")]
    [True, True, True, False, False]
    """
    for short in (UNIT.sub("", name), UNIT.sub("", name).rsplit(".", 1)[-1]):
        found = TIME.fullmatch(short.strip())
        if found and (found[1] is None or found[1].lower() in SECONDS):
            return True
    return False


def unit_of(name: str) -> str | None:
    """The unit in a name, in brackets or, of a time, behind an underscore; None where there is none."""
    bracket = UNIT.search(name)
    if bracket:
        return bracket[1].strip()
    found = TIME.fullmatch(name.rsplit(".", 1)[-1].strip())
    return found[1] if found and found[1] and is_time(name) else None


def seconds_of(unit: str) -> float | None:
    """What a unit of time is in seconds, None where it is not known."""
    return SECONDS.get(unit.strip().lower())


def frequency_of(t: np.ndarray) -> float:
    """The sampling frequency of a time axis, which may be printed coarsely, jitter or have gaps; 0 where it has none.

    Clocks are set in round numbers: of all that the axis allows, the one with the fewest digits.

    >>> frequency_of(np.round(np.arange(20_000) / 16384, 6))
    16384.0
    """
    t = t.astype(float, copy=False)
    t = t if all_finite(t) else t[np.isfinite(t)]
    if t.size < 2:
        return 0.0
    sample = np.arange(0, t.size - 1, max(1, t.size // BLOCK))
    usual = float(np.median(t[sample + 1] - t[sample]))
    least, n_gaps = np.inf, 0
    for steps in steps_of(t):
        least, n_gaps = min(least, float(steps.min())), n_gaps + int(np.count_nonzero(steps > 1.5 * usual))
    # else it is only printed coarsely
    most = 1.5 * usual if least > 0.5 * usual and n_gaps < 0.1 * (t.size - 1) else np.inf
    n, span, highest, squares = 0, 0.0, -np.inf, 0.0
    for steps in steps_of(t):
        steps = steps if most == np.inf else steps[steps <= most]
        n, span, squares = n + steps.size, span + float(steps.sum()), squares + float(np.sum((steps - usual) ** 2))
        highest = max(highest, float(steps.max(initial=-np.inf)))
    if not 0 < span < np.inf:
        return 0.0
    fs, tolerance = n / span, max((highest - least) / span, 1e-12)
    spread = np.sqrt(max(squares / n - (span / n - usual) ** 2, 0.0))
    rough = ROUGH if spread > 1e-6 / fs else 0.0
    for n in range(1, 18):
        rounded = float(f"{fs:.{n}g}")
        if abs(rounded / fs - 1) <= max(tolerance, rough if n <= 3 else 0.0):
            break
    return rounded


def steps_of(t: np.ndarray) -> Iterator[np.ndarray]:
    """The steps of a time axis, a block at a time."""
    for some in blocks(t.size - 1):
        yield np.diff(t[some.start : some.stop + 1])
