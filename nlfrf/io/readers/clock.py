"""Clocks: names of time channels and of sampling frequencies, what texts say of them, the frequency of a time axis."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from nlfrf._base.numbers import BLOCK_ENTRIES, all_finite, iterate_blocks
from nlfrf.io.readers.layout import UNIT_CELL

__all__ = [
    "LONG",
    "RATES",
    "STEPS",
    "UNIT",
    "clock_name",
    "frequency_of",
    "hertz_of",
    "is_time",
    "seconds_of",
    "told_clock",
    "unit_of",
]


#: A unit in brackets behind a name. Whole numbers are an index, `setpoint[0]`, `DCOM(1,2)`; but "ratio [1]" is a unit.
UNIT = re.compile(r"(?:\s+(?=\[1\])|\s*(?![\[(]\s*\d[\d,;:\s]*[\])]))[\[(]([^\])]*)[\])]\s*$")
SECONDS = {
    **dict.fromkeys(("", "s", "sec", "secs", "second", "seconds", "sekunden"), 1.0),
    **dict.fromkeys(("ms", "msec", "millis", "millisecond", "milliseconds"), 1e-3),
    **dict.fromkeys(("us", "µs", "μs", "usec", "micros", "microsecond", "microseconds"), 1e-6),
    **dict.fromkeys(("ns", "nsec", "nanosecond", "nanoseconds"), 1e-9),
    **dict.fromkeys(("min", "minutes"), 60.0),
    **dict.fromkeys(("h", "hours"), 3600.0),
}
PREFIXES = {"": 1.0, "k": 1e3, "m": 1e6, "g": 1e9}  # of rates, where nobody means a thousandth
RATE = re.compile(r"([kmg]?)(?:hz|sps|sa?(?:mples?)?/s(?:ec|econd)?|samples? per sec(?:ond)?)|1/s|s\^-1|", re.I)
TIMES = r"t|time|tout|zeit|temps|tempo|tiempo|tijd|timestamps?|time stamp|x[._ ]data|x[._ -]?axis|x_value"
#: A time channel, with its unit behind an underscore where it is written so: "t", "time_ms", "Elapsed time".
TIME = re.compile(rf"(?:(?:elapsed|relative|rel|absolute|abs|sample|utc)[ _])?(?:{TIMES})(?:[ _]([a-zµμ]+))?", re.I)
RATES = ("fs", "samplerate", "samplingrate", "samplefrequency", "samplingfrequency", "fsample")
STEPS = ("ts", "dt", "deltat", "sampletime", "samplingtime", "tsample", "increment", "deltax")
#: What a line above a table says of the clock: "Sample rate: 2 kHz", "Sampling interval,0.001".
CLOCK = re.compile(
    r"(?P<rate>sampl\w*[ _]?(?:rate|freq\w*)|\bfs|abtastrate)"
    r"|(?P<step>sampl\w*[ _]?(?:interval|time|period)|cycle[ _]?time|abtastzeit|zykluszeit|delta[ _]?[tx]|\bdt)",
    re.I,
)
#: The number behind it, grouped by blanks or marks or not, and what follows: its unit, or another cell.
VALUE = re.compile(
    r"[^\w.]*?(?P<number>[-+]?(?=\.?\d)(?:\d{1,3}(?:[ '’\u00a0\u202f]\d{3})+(?!\d)|\d)?[\d.,]*(?:e[+-]?\d+)?)"
    r"(?P<gap>[\s,;\"'|]*)(?P<unit>1/s|s\^-1|[^\W\d][\w/]*(?: per sec(?:ond)?)?)?",
    re.I,
)
BACK = 0.5  # of a step that a time axis may run backwards, as moments that a computer noted do
LONG = 1.0  # seconds from which a "sampling time" may be how long was sampled
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


def clock_name(name: str) -> tuple[str, str]:
    """The name of a sampling time or frequency as `STEPS` and `RATES` spell it, and a unit behind an underscore.

    >>> clock_name("Sampling_Time_us"), clock_name("Ts"), clock_name("fs_kHz"), clock_name("offset_s")
    (('samplingtime', 'us'), ('ts', ''), ('fs', 'kHz'), ('offset', 's'))
    """
    head, _, unit = name.strip().rpartition("_")
    known = head and (seconds_of(unit) is not None or hertz_of(unit) is not None)
    key, unit = (head, unit) if known else (name, "")
    return key.replace("_", "").replace(" ", "").lower(), unit


def seconds_of(unit: str) -> float | None:
    """What a unit of time is in seconds, None where it is not known."""
    return SECONDS.get(unit.strip().lower())


def hertz_of(unit: str) -> float | None:
    """What a unit of a sampling frequency is in Hz, None where it is not known.

    >>> [hertz_of(unit) for unit in ("kHz", "MS/s", "", "samples/s", "N")]
    [1000.0, 1000000.0, 1.0, 1.0, None]
    """
    found = RATE.fullmatch(unit.strip())
    return None if found is None else PREFIXES[(found[1] or "").lower()]


def told_clock(lines: tuple[str, ...], delimiter: str = ",", decimal: str = ".") -> float:
    """The sampling frequency [Hz] that the lines above a table tell, 0 where they tell none, or in a unit not known.

    >>> told_clock(("Device: A1", "Sample rate: 2 kHz")), told_clock(("dt [s],0.001",)), told_clock(("Notes",))
    (2000.0, 1000.0, 0.0)
    >>> [told_clock((f"Sample rate: {said}",)) for said in ("2 MHz", "100 kS/s", "1 000 Hz", "51,200 Hz", "100 N")]
    [2000000.0, 100000.0, 1000.0, 0.0, 0.0]

    A sampling time of seconds may be how long was sampled.

    >>> [told_clock((said,)) for said in ("Sampling time: 1 ms", "Sampling time: 10 s", "Sampling interval: 10 s")]
    [1000.0, 0.0, 0.1]
    """
    for line in lines:
        said = CLOCK.search(line)
        value = VALUE.match(re.sub(r"^\s*[\[(]([^\])]*)[\])](.*)", r"\2 \1", line[said.end() :])) if said else None
        if said is None or value is None:
            continue
        unit = value["unit"] or ""
        scale = (hertz_of if said["rate"] else seconds_of)(unit)
        if scale is None and value["gap"].strip() and not UNIT_CELL.fullmatch(unit):
            scale = 1.0  # a word in a cell of its own
        number = spelled(value["number"], delimiter, decimal) * (scale or 0.0)
        if said["step"] and said["step"].lower().endswith(("time", "zeit")) and number >= LONG:
            continue
        if 0 < number < np.inf:
            return number if said["rate"] else float(f"{1 / number:.12g}")
    return 0.0


def spelled(text: str, delimiter: str, decimal: str) -> float:
    """A number as people write it, 0 where it is none or may be read in two ways: 51,200 may be 51200 or 51.2.

    >>> [spelled(text, ";", ".") for text in ("1'000", "1.000,5", "2,5", "51,200", "0,001", "1000,")]
    [1000.0, 1000.5, 2.5, 0.0, 0.001, 1000.0]
    >>> spelled("1000,1000", ",", "."), spelled("1000,2000", ",", ".")
    (1000.0, 0.0)
    """
    text = re.sub(r"[ '’\u00a0\u202f]", "", text).rstrip(",")
    if delimiter == "," and "," in text:  # cells, one a channel
        text = text.split(",")[0] if len(set(text.split(","))) == 1 else ""
    marks = sorted({".", ","} & set(text), key=text.rfind)
    if len(marks) == 2:
        text = text.replace(marks[0], "").replace(marks[1], ".")
    elif marks and text.count(marks[0]) > 1:
        text = text.replace(marks[0], "")
    elif marks:
        whole, _, rest = text.partition(marks[0])
        known = marks[0] == decimal or len(rest) != 3 or whole.lstrip("+-") in ("", "0")
        text = f"{whole}.{rest}" if known else ""
    try:
        return float(text)
    except ValueError:
        return 0.0


def frequency_of(t: np.ndarray) -> float:
    """The sampling frequency of a time axis, which may be printed coarsely, jitter or have gaps; 0 where it has none.

    What runs backwards anywhere is no clock: two runs one behind the other, or another quantity that is called t.

    Clocks are set in round numbers: of all that the axis allows, the one with the fewest digits.

    >>> frequency_of(np.round(np.arange(20_000) / 16384, 6))
    16384.0
    """
    t = t.astype(float, copy=False)
    t = t if all_finite(t) else t[np.isfinite(t)]
    if t.size < 2:
        return 0.0
    sample = np.arange(0, t.size - 1, max(1, t.size // BLOCK_ENTRIES))
    usual = float(np.median(t[sample + 1] - t[sample]))
    least, n_gaps = np.inf, 0
    for steps in steps_of(t):
        least, n_gaps = min(least, float(steps.min())), n_gaps + int(np.count_nonzero(steps > 1.5 * usual))
    if least < -BACK * usual or usual < 0:
        return 0.0
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
    for some in iterate_blocks(t.size - 1):
        yield np.diff(t[some.start : some.stop + 1])
