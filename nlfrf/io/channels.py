"""The named channels of a measurement file: streams, their units, clocks and rates."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import field
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np

from nlfrf._base.arguments import data_warning, join_names, one_line, require_positive
from nlfrf._base.own_process import Contents
from nlfrf._base.values import value
from nlfrf.io.moments import require_same_moments
from nlfrf.io.readers.clock import (
    MIN_DURATION,
    RATE_NAME,
    STEP_NAME,
    UNIT_SUFFIX,
    hertz_per_unit,
    is_time_name,
    sampling_frequency,
    seconds_per_unit,
    split_clock_name,
    unit_in_name,
)
from nlfrf.io.readers.layout import make_unique
from nlfrf.io.readers.names import parse_name, parse_unit, suits
from nlfrf.records.record import SignalLabels

# [Hz] a clock without a unit below these may not be, or hardly is, in seconds
_SLOW = 100.0
_UNLIKELY = 2.0
_DRIVE_RATE = 20.0  # [Hz] up to here a variable without a unit may be in milliseconds, as in drives
#: Possible units of a step without a unit, and the factor on its frequency in seconds.
_UNSTATED_UNITS = {
    "these are seconds": 1.0,
    "they are milliseconds": 1e3,
    "they are microseconds": 1e6,
}
# largest relative difference between a given sampling frequency and that of the file
_MAX_TIME_DIFFERENCE = 1e-3
_SECONDS_PER_DAY = 86400.0  # [s]
_DATE_RANGES = ((3e4, 6e4), (7e5, 8e5))  # the present, in days of spreadsheets and of MATLAB
_MAX_RATE = 1e6  # [Hz] above this a clock in this range is more likely in days
_MAX_COLUMNS = 64  # most columns of a matrix of signals
OTHER_WAY = "arrays of any origin go to record_from_samples(u, y, fs=...)"


@value
class Channels:
    """Contents of a file: arrays by name."""

    path: str  # path of the file
    # numeric arrays and texts. Members of structs are ``struct.member``, columns of matrices
    # ``matrix.2``. The start of a channel [s] is ``channel.start``: readers give it in the unit
    # that `units` states, and by ``channel.moment`` [s] the moment at which it began to count.
    arrays: Mapping[str, np.ndarray]
    units: Mapping[str, str] = field(
        default_factory=dict
    )  # units that the file states apart from the names
    # sampling frequency [Hz] or name of the time channel, as the file states it for a channel, or
    # for all by ""
    clocks: Mapping[str, float | str] = field(default_factory=dict)
    notes: Mapping[str, str] = field(
        default_factory=dict
    )  # reasons why an entry of the file is no signal

    def full_name(self, name: str) -> str:
        """Return the full name of a channel: "input" finds "input (V)" and "run.input", if it is
        unique.
        """
        if (name := one_line(name)) in self.arrays:
            return name
        for short in (
            lambda known: UNIT_SUFFIX.sub("", known),
            lambda known: UNIT_SUFFIX.sub("", known).rsplit(".", 1)[-1],
        ):
            found = [known for known in self.arrays if short(known) == name]
            if len(found) == 1:
                return found[0]
        return name

    @property
    def signals(self) -> list[str]:
        """Names of possible streams of samples, in the order of the file."""
        return [
            name
            for name, array in self.arrays.items()
            if array.dtype.kind in "fiub" and array.size > 1
        ]

    def signal(self, parameter: str, name: str) -> np.ndarray:
        """Return one stream of samples; a refusal lists the available names."""
        full, file = self.full_name(name), Path(self.path).name
        array = self.arrays.get(full)
        if array is None or array.dtype.kind not in "fiub" or array.size < 2:
            raise ValueError(
                f"{parameter} must name a signal of {file!r}, {self.describe_signals(name)}"
            )
        if array.ndim > 1 and self.text("schema"):
            return _to_stream(array)  # a file of this package: the caller knows the axes
        array = np.squeeze(array)
        if array.ndim != 1:
            inside = [known for known in self.signals if known.startswith(f"{full}.")]
            raise ValueError(
                f"{parameter} must name one stream of samples, got {name!r} with shape"
                f" {array.shape}; "
                + (f"its columns are {', '.join(inside)}" if inside else OTHER_WAY)
            )
        if full in self.notes:
            raise ValueError(
                f"{parameter} must hold numbers, but {name!r} of {file!r} {self.notes[full]}"
            )
        if twins := [
            known
            for known in self.signals
            if known.startswith(f"{full}.") and known[len(full) + 1 :].isdigit()
        ]:
            data_warning(
                f"{file!r} has {full!r} beside {' and '.join(map(repr, twins))}, numbered because"
                f" their names are equal: {parameter} is {full!r}, the first of them"
            )
        return _to_stream(array)

    def describe_signals(self, name: str) -> str:
        """Describe the available signals for a name that is none, with the reasons."""
        listed = ", ".join(sorted(self.signals)) or "none"
        if name in self.notes:
            named = [name]
        elif self.full_name(name) in self.arrays:
            named = []
        else:
            named = list(self.notes)[:3]
        noted = [f"{one!r} {self.notes[one]}" for one in named]
        return "; ".join(
            [f"one of {listed}", f"got {name!r}", *noted, *([] if self.signals else [OTHER_WAY])]
        )

    def labels(self, u: str, y: str) -> SignalLabels:
        """Return the names of input and output without units, and their units, in brackets or
        stated elsewhere.
        """
        full_u, full_y = self.full_name(u), self.full_name(y)
        return {
            "u_name": "" if full_u == "u" else self.bare_name(full_u),
            "u_unit": self.unit(full_u),
            "y_name": "" if full_y == "y" else self.bare_name(full_y),
            "y_unit": self.unit(full_y),
        }

    def unit(self, full: str) -> str:
        """Return the unit of a channel that the file states, else that in its full name; empty if
        there is none.
        """
        return self.units.get(full) or unit_in_name(full) or self.stated_unit(full)

    def stated_unit(self, full: str) -> str:
        """Return the unit that the file states apart from a name: for the channel, or in another
        variable.

        Such variables are `fs_unit` for `fs`, and `TimeUnit` or `FrequencyUnit` in the same struct.
        """
        if full in self.units:
            return self.units[full]
        home, dot, key = full.rpartition(".")
        if is_time_name(key) or STEP_NAME.fullmatch(split_clock_name(key)[0]):
            kind = "time"
        else:
            kind = parse_name(key).quantity
        for word in (
            key,
            *{"time": ("time", "Time"), "frequency": ("frequency", "Frequency", "")}.get(kind, ()),
        ):
            for joint in ("_unit", "_units", "Unit", "Units", "unit", "units", " unit"):
                unit = self.text(f"{home}{dot}{word}{joint}")
                if unit and (word or suits("frequency", parse_unit(unit))):
                    return unit.replace("TimeUnit", self.text(f"{home}{dot}TimeUnit") or "s")
        return ""

    def bare_name(self, full: str) -> str:
        """Return the full name of a channel without its unit; brackets around anything else belong
        to the name.
        """
        if unit_in_name(full) == self.unit(full):
            return UNIT_SUFFIX.sub("", full)
        return full

    def text(self, name: str) -> str:
        """Return the text of this name, empty if there is none."""
        array = self.arrays.get(name)
        if array is None or array.dtype.kind not in "US" or array.size != 1:
            return ""
        item = array.reshape(-1)[0]
        return one_line(item.decode(errors="replace") if isinstance(item, bytes) else str(item))

    def sampling_frequency(self, given: float | None = None, names: tuple[str, ...] = ()) -> float:
        """Return the sampling frequency [Hz]: the given one, or that of these channels, the file,
        or its time channel.

        A given one is compared with that of the file.
        """
        file = Path(self.path).name
        clocks = {
            self.full_name(name): self.clocks.get(self.full_name(name), self.clocks.get(""))
            for name in names
        }
        clock = self.common_clock(clocks)
        if given is None and not clock.fs > 0:
            units = [
                f": it counts in {unit!r}"
                for name in clocks
                if (unit := self.units.get(f"{name}.start"))
            ]
            why = clock.why or f"{file!r} has neither fs nor a time channel{(units or [''])[0]}"
            raise ValueError(f"fs must be given: {why}")
        if given is None and clock.doubt:
            data_warning(clock.doubt)
        if given is None:
            fs = clock.fs
        else:
            fs = require_positive("fs", given)
        axes = {name: axis for name in clocks if (axis := self.moments_of(name)) is not None}
        if axes:
            require_same_moments(file, axes, fs)
        if clock.fs > 0 and not clock.doubt and abs(fs / clock.fs - 1) > _MAX_TIME_DIFFERENCE:
            data_warning(
                f"fs was given as {fs:g} Hz, but {clock.where} of {file!r} gives {clock.fs:g} Hz;"
                " the given one is used"
            )
        return fs

    def common_clock(self, clocks: Mapping[str, float | str | None]) -> _Clock:
        """Return the clock of channels, as stated for each, else found near them; refuse channels
        that differ.
        """
        stated = [*clocks.items()] or [("", self.clocks.get(""))]
        found = {
            name: self.stated_clock(name, clock) for name, clock in stated if clock is not None
        }
        found = found or {"": self.neighbouring_clock(tuple(clocks))}
        rates = [clock.fs for clock in found.values() if clock.fs > 0]
        if rates and max(rates) > min(rates) * (1 + _MAX_TIME_DIFFERENCE):
            listing = ", ".join(f"{name!r} at {clock.fs:g} Hz" for name, clock in found.items())
            raise ValueError(
                f"u and y must be sampled together, but {Path(self.path).name!r} has {listing}."
                " Resample them to one sampling frequency, and give them to record_from_samples"
            )
        return next((clock for clock in found.values() if clock.why), next(iter(found.values())))

    def stated_clock(self, name: str, stated: float | str) -> _Clock:
        """Return the clock that the file states for a channel, or for all by "": a frequency, or a
        time channel.
        """
        if isinstance(stated, str):
            return self.clock_of_time(stated)
        if name:
            where = f"the rate stated for {name!r}"
        else:
            where = "the stated rate"
        if 0 < stated <= _SLOW and self.units.get(f"{name}.start") == "":
            return _doubtful_clock(
                stated, where, f"the sampling time of {name!r} names no unit and is", _DRIVE_RATE
            )
        return _Clock(float(stated), where)

    def neighbouring_clock(self, names: tuple[str, ...]) -> _Clock:
        """Return the clock of channels from a variable, else from a time channel; the two have to
        agree.
        """
        file, variables = Path(self.path).name, self.variable_clocks(next(iter(names), ""))
        n = {self.arrays[name].size: name for name in names if name in self.arrays}
        if len(n) == 1:
            time = self.nearest_time_channel(next(iter(n.values())))
        else:
            time = self.time
        if time:
            by_time = self.clock_of_time(time)
        else:
            by_time = _Clock()
        if not variables and self.time and not time:
            sizes = " and ".join(f"{name!r} has {size}" for size, name in n.items())
            return _Clock(
                why=(
                    f"the time channel {self.time!r} has {self.arrays[self.time].size} samples, and"
                    f" {sizes}"
                )
            )
        if not variables:
            return by_time
        best, time_fs = variables[0], 0.0 if by_time.doubt else by_time.fs
        for one in variables:
            if one.rank == best.rank and one.fs > best.fs * (1 + _MAX_TIME_DIFFERENCE):
                return _Clock(
                    why=(
                        f"{file!r} has {best.fs:g} Hz by {best.name!r} and {one.fs:g} Hz by"
                        f" {one.name!r}"
                    )
                )
        if best.is_doubtful and _agrees_in_some_unit(best.fs, time_fs):
            return by_time
        if time_fs > 0 and abs(best.fs / time_fs - 1) > _MAX_TIME_DIFFERENCE:
            by_both = (
                f"{best.fs:g} Hz by {best.name!r} of {file!r} and {time_fs:g} Hz by {by_time.where}"
            )
            return _Clock(
                best.fs,
                best.name,
                doubt=f"fs is {by_both}; the first is used, give fs if it is wrong",
            )
        if best.is_doubtful:
            return _doubtful_clock(
                best.fs,
                best.name,
                f"the sampling time {best.name!r} names no unit and is",
                _DRIVE_RATE,
            )
        return _Clock(best.fs, best.name)

    def moments_of(self, name: str) -> float | np.ndarray | None:
        """Return the time of each sample of a channel, or its start [s]; None if it has neither."""
        stated = self.clocks.get(name)
        if isinstance(stated, float):
            return float(self.arrays.get(f"{name}.start", 0.0))
        return self.seconds(name)

    def seconds(self, name: str) -> np.ndarray | None:
        """Return the time of each sample of a channel [s], None without a time channel of known
        unit.
        """
        time = self.time_of(self.full_name(name))
        if time:
            second = self.second_of(time)
        else:
            second = None
        if second is None:
            return None
        return second * np.ravel(self.arrays[time]).astype(float, copy=False)

    def time_of(self, full: str) -> str:
        """Return the time channel of a channel, stated or near it; empty if it has none, or another
        clock.
        """
        stated = self.clocks.get(full, self.clocks.get("", self.nearest_time_channel(full)))
        if isinstance(stated, str):
            return stated
        return ""

    def nearest_time_channel(self, full: str) -> str:
        """Return a time channel as long as a channel, preferably in the same struct; empty if there
        is none.
        """
        n, home = self.arrays.get(full, np.zeros(0)).size, full.rpartition(".")[0]
        as_long = [time for time in self.times if self.arrays[time].size == n]
        return min(as_long, key=lambda time: time.rpartition(".")[0] != home, default="")

    @property
    def times(self) -> list[str]:
        """Names of the time channels, those with a valid clock first."""
        found = [
            name for name in self.signals if is_time_name(name) and _may_run(self.arrays[name])
        ]
        if len(found) < 2:
            return found
        return sorted(
            found,
            key=lambda name: (
                not (self.second_of(name) and sampling_frequency(np.ravel(self.arrays[name])))
            ),
        )

    @property
    def time(self) -> str:
        """Name of the first time channel, empty if there is none."""
        return next(iter(self.times), "")

    def second_of(self, time: str) -> float | None:
        """Return the unit of a time channel [s], None if unknown."""
        return seconds_per_unit(self.unit(time))

    def variable_clocks(self, channel: str) -> list[_ScalarClock]:
        """Return the clocks of variables fs, Ts and the like, those in the struct of a channel
        first, then the slowest.

        A doubtful one is left out if another one agrees with it in some unit.
        """
        found = list(self.scalar_clocks([channel.rpartition(".")[0], ""]))
        sure = [one for one in found if not one.is_doubtful]
        return sorted(
            one
            for one in found
            if one in sure or not any(_agrees_in_some_unit(one.fs, two.fs) for two in sure)
        )

    def scalar_clocks(self, homes: list[str]) -> Iterator[_ScalarClock]:
        """Yield every variable with a sampling frequency or time; `homes` are the structs that rank
        first.
        """
        for name, array in self.arrays.items():
            key, unit = split_clock_name(UNIT_SUFFIX.sub("", name).rsplit(".", 1)[-1])
            is_step = STEP_NAME.fullmatch(key) is not None
            is_rate = RATE_NAME.fullmatch(key) is not None
            if is_step or is_rate:
                number = _constant_of(array)
            else:
                number = None
            unit = unit or self.unit(name)
            if number is None or (
                array.size > 1 and is_step and not unit and number >= MIN_DURATION
            ):
                continue
            scale = (seconds_per_unit if is_step else hertz_per_unit)(unit)
            number *= scale or 0.0
            if 0 < number < np.inf:
                home = name.rpartition(".")[0]
                if home in homes:
                    rank = homes.index(home)
                else:
                    rank = 2
                if is_rate:
                    fs = number
                else:
                    fs = float(f"{1 / number:.12g}")
                yield _ScalarClock(rank, fs, is_step and not unit and fs <= _SLOW, name)

    def clock_of_time(self, time: str) -> _Clock:
        """Return the clock of a time channel."""
        unit, second, where = self.unit(time), self.second_of(time), f"the time channel {time!r}"
        if second is None:
            return _Clock(why=f"the unit of {where} is not known")
        t = np.ravel(self.arrays[time])
        fs = sampling_frequency(t if second == 1.0 else second * t)
        if not fs > 0:
            return _Clock(why=f"{where} {_backward_steps(t)}")
        if not unit and fs > _MAX_RATE and any(low < t[0] < high for low, high in _DATE_RANGES):
            readings = (
                f"{fs:g} Hz if these are seconds, {fs / _SECONDS_PER_DAY:g} Hz if they are days"
            )
            return _Clock(
                why=(
                    f"{where} names no unit, begins at {t[0]:.9g} and steps by {1 / fs:.3g}:"
                    f" {readings}"
                )
            )
        if unit or fs > _SLOW:
            return _Clock(fs, where)
        return _doubtful_clock(fs, where, f"{where} names no unit and steps by", _UNLIKELY)


class _Clock(NamedTuple):
    """A sampling frequency [Hz] and its source; the reason if it is unknown (0); the reason for a
    doubt.
    """

    fs: float = 0.0
    where: str = ""
    why: str = ""
    doubt: str = ""


class _ScalarClock(NamedTuple):
    """A sampling frequency [Hz] from a variable; rank of its place; True if its unit is in doubt;
    its name.
    """

    rank: int
    fs: float
    is_doubtful: bool
    name: str


def _agrees_in_some_unit(fs: float, known: float) -> bool:
    """Return whether a step without a unit agrees with a known sampling frequency; `fs` is for
    seconds.
    """
    return any(
        abs(factor * fs - known) <= _MAX_TIME_DIFFERENCE * known
        for factor in _UNSTATED_UNITS.values()
    )


def _doubtful_clock(fs: float, where: str, step: str, unlikely: float) -> _Clock:
    """Return the clock for a step without a unit: in doubt, or unknown if it is no faster than
    `unlikely`.

    A slow clock in seconds may be a fast one in milliseconds or microseconds.
    """
    readings = join_names(
        [f"{factor * fs:g} Hz if {unit}" for unit, factor in _UNSTATED_UNITS.items()]
    )
    if fs <= unlikely:
        return _Clock(why=f"{step} {1 / fs:g}: {readings}")
    return _Clock(
        fs,
        where,
        doubt=f"{step} {1 / fs:g}: {readings}; seconds are taken, give fs if they are not",
    )


def _may_run(array: np.ndarray) -> bool:
    """Return whether a stream can be a time axis; a parameter repeated in every row cannot."""
    return array.dtype.kind in "fiu" and array.size > 1 and _constant_of(array) is None


def _constant_of(array: np.ndarray) -> float | None:
    """Return the number of a single value, or of a constant stream; None for anything else."""
    if array.dtype.kind not in "fiu" or not array.size:
        return None
    first = array.reshape(-1)[0]
    if array.size == 1 or bool(np.all(array == first)):
        return float(first)
    return None


def _backward_steps(t: np.ndarray) -> str:
    """Describe the place where a time channel does not run forward."""
    steps = np.diff(t.astype(float))
    if not np.any(steps < 0):
        return "does not run forward"
    at = int(np.nanargmin(steps))
    return f"runs backwards at sample {at + 1}, from {t[at]:.9g} to {t[at + 1]:.9g}"


def _to_stream(array: np.ndarray) -> np.ndarray:
    """Return an array as contiguous float64 and read-only, without a copy if it is already."""
    stream = np.ascontiguousarray(array, dtype=float)
    stream.flags.writeable = False
    return stream


OnePath: TypeAlias = str | os.PathLike[str]


def clean_names(
    arrays: Mapping[str, np.ndarray],
    units: Mapping[str, str],
    *,
    clocks: Mapping[str, float | str],
    notes: Mapping[str, str],
) -> Contents:
    """Return channels with unique names, and names, units and notes of one line each without
    control characters.

    Empty units are dropped, except that of a start: then its unit is in doubt.
    """
    texts = [clock for clock in clocks.values() if isinstance(clock, str)]
    names = [name for name in dict.fromkeys([*arrays, *units, *clocks, *notes, *texts]) if name]
    # names that are equal after the cleaning are numbered, too
    named = {"": ""} | dict(zip(names, make_unique(list(map(one_line, names))), strict=True))
    return (
        {named[name]: array for name, array in arrays.items()},
        {
            named[name]: one_line(unit)
            for name, unit in units.items()
            if unit or name.endswith(".start")
        },
        {
            named[name]: named[clock] if isinstance(clock, str) else clock
            for name, clock in clocks.items()
        },
        {named[name]: one_line(note) for name, note in notes.items()},
    )


def abscissas_in_seconds(
    arrays: Mapping[str, np.ndarray], units: Mapping[str, str], clocks: Mapping[str, float | str]
) -> tuple[dict[str, np.ndarray], dict[str, float | str]]:
    """Return steps and starts of waveforms in seconds, by the unit of ``name.start``; 0 Hz if it is
    unknown.
    """
    scaled, rates = dict(arrays), dict(clocks)
    for name, clock in clocks.items():
        if not isinstance(clock, str):
            unit = units.get(f"{name}.start", "")
            second = seconds_per_unit(unit) or 1 / (hertz_per_unit(unit) or np.inf)
            rates[name] = clock / second if second else 0.0
            if f"{name}.start" in arrays:
                scaled[f"{name}.start"] = second * arrays[f"{name}.start"] + arrays.get(
                    f"{name}.moment", 0.0
                )
    return scaled, rates


def split_columns(
    arrays: Mapping[str, np.ndarray], clocks: Mapping[str, float | str]
) -> tuple[dict[str, np.ndarray], dict[str, float | str]]:
    """Add each column of a matrix as a channel of its own; a first column that rises evenly is
    their time.
    """
    more, clocks = dict(arrays), dict(clocks)
    for name, array in arrays.items():
        if array.ndim != 2 or array.dtype.kind not in "fiu":
            continue
        rows = array if array.shape[0] < array.shape[1] else array.T
        if not 1 < len(rows) <= _MAX_COLUMNS or rows.shape[1] < 4 * len(rows):
            continue
        for i, row in enumerate(rows):
            more[f"{name}.{i + 1}"] = row
            if name in clocks:
                clocks[f"{name}.{i + 1}"] = clocks[name]
            elif _is_time_axis(rows[0]) and i:
                clocks[f"{name}.{i + 1}"] = f"{name}.1"
    return more, clocks


def _is_time_axis(t: np.ndarray) -> bool:
    """Return whether a stream is a time axis: it rises by even steps."""
    steps = np.diff(np.asarray(t, dtype=float))
    return bool(
        steps.size
        and steps.min() > 0.5 * np.median(steps) > 0
        and np.ptp(steps) < 0.1 * np.median(steps)
    )
