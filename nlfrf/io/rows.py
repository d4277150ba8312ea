"""Rows of a file that do not form one record: rows that a logger lost, parts of it, signals that
alternate.

Behind a lost row every sample is one place early. Periods that are cut by counting are then all
misplaced. Cut by their times, all periods except the one with the gap are valid.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeAlias

import numpy as np

from nlfrf._base.arguments import (
    as_list,
    data_warning,
    format_small_count,
    join_names,
    require_integer,
)
from nlfrf._base.numbers import all_finite
from nlfrf._base.values import value
from nlfrf.io.channels import Channels
from nlfrf.io.uneven_clock import UnevenClock, find_uneven_clock
from nlfrf.records.period import detect_period, is_repeated
from nlfrf.records.periods import Cutting
from nlfrf.records.record import SAME_CLOCK
from nlfrf.records.reference import design_period


@value(in_sentences=True)
class _LostRows:
    """Places of the rows of a file on an even clock."""

    place: np.ndarray  # (n,) sample number of each row, counted from the first one
    moments: np.ndarray  # (n,) time of each row [s]
    fs: float  # sampling frequency [Hz]

    def filled(self, stream: np.ndarray) -> np.ndarray:
        """Return a stream with lost rows interpolated linearly: only good enough to find its
        period.
        """
        return np.asarray(np.interp(np.arange(self.place[-1] + 1), self.place, stream))

    def whole_periods(self, n_samples: int) -> np.ndarray:
        """Return the numbers of the periods, from 0, in which no row is lost."""
        count = np.bincount(self.place // n_samples, minlength=1)
        return np.flatnonzero(count == n_samples)

    def kept(self, stream: np.ndarray, n_samples: int, n_discard: int) -> np.ndarray:
        """Return the whole periods of streams (..., n), one behind the other, without the first
        `n_discard`.
        """
        period = self.place // n_samples
        whole = self.whole_periods(n_samples)
        kept = np.ascontiguousarray(stream[..., np.isin(period, whole[whole >= n_discard])])
        kept.flags.writeable = False
        return kept

    def __str__(self) -> str:
        steps = np.diff(self.place)
        jumps = np.flatnonzero(steps > 1)
        descriptions = [
            f"time jumps by {format_small_count(int(steps[j]), 'sample')} at"
            f" {self.moments[j] + 1 / self.fs:.9g} s:"
            f" {format_small_count(int(steps[j]) - 1, 'sample')} lost"
            for j in jumps[:_MAX_NAMED]
        ]
        more = jumps.size - _MAX_NAMED
        return "; ".join(
            descriptions + [f"and {format_small_count(more, 'such jump')} more"] * (more > 0)
        )

    def describe(self, n_samples: int) -> str:
        """Describe the lost rows and list the whole periods; without a period (0) the rows alone.

        >>> place = np.delete(np.arange(30), 14)
        >>> _LostRows(place=place, moments=place / 10, fs=10.0).describe(10)
        'time jumps by two samples at 1.4 s: one sample lost; periods 1 and 3 are whole'
        """
        if not n_samples:
            return str(self)
        whole = [str(j + 1) for j in self.whole_periods(n_samples)]
        if not whole:
            return f"{self}; no period is whole"
        if len(whole) == 1:
            named = f"period {whole[0]} is"
        else:
            named = f"periods {join_names(whole)} are"
        return f"{self}; {named} whole"


def find_lost_rows(seconds: np.ndarray | None, fs: float) -> _LostRows | None:
    """Find the lost rows in a time column; None if there are none, or if the column does not show
    them.

    Parameters
    ----------
    seconds : (n,) ndarray, optional
        The time of each row [s].
    fs : float
        Sampling frequency [Hz].

    Returns
    -------
    LostRows or None
        None if the steps are no whole numbers of samples, as for times noted by a computer, or if
        more rows are lost than exist.
    """
    if seconds is None or not fs > 0 or seconds.size < 2:
        return None
    steps = np.diff(seconds) * fs
    whole = np.round(steps)
    if (
        not np.isfinite(steps).all()
        or whole.min() < 1
        or whole.max() == 1
        or np.count_nonzero(whole > 1) > _MAX_LOST_SHARE * steps.size
        or np.abs(steps - whole).max() > _MAX_UNEVENNESS
    ):
        return None
    place = np.concatenate([[0], np.cumsum(whole)])
    if place[-1] < 2 * seconds.size:
        return _LostRows(place=place.astype(int), moments=seconds, fs=fs)
    return None


def arrange_rows(
    files: list[Channels],
    channels: Sequence[object],
    *,
    options: Cutting,
    fs: float | None,
    windows: tuple[Seconds, Seconds],
) -> tuple[list[Channels], Cutting]:
    """Return measurement files whose channels are streams of rows, one per realisation, and the
    cutting options.
    """
    # other types are refused later
    names = [name for some in channels for name in as_list(some) if isinstance(name, str)]
    if not names or any(file.text("schema") for file in files):
        return files, options
    files = [merge_alternating_rows(file, names) for file in files]
    files, n = map(list, zip(*(unfold_periods(file, names) for file in files), strict=True))
    if options.n_samples is None and n[0]:
        options = options._replace(n_samples=n[0])
    return _cut_windows(files, *windows, name=names[0], fs=fs), options


def unfold_periods(file: Channels, names: Sequence[str]) -> tuple[Channels, int]:
    """Return a file with its matrices of periods, (n, P) or (P, n), as streams, and n; the file and
    0 if it has none.

    The first channel shows whether its columns repeat each other; matrices with its shape are
    treated alike.
    """
    if names:
        full = file.full_name(names[0])
    else:
        full = ""
    matrix = file.arrays.get(full, np.zeros(0))
    if (
        matrix.ndim != 2
        or matrix.dtype.kind not in "fiu"
        or not 4 < 4 * min(matrix.shape) <= max(matrix.shape)
    ):
        return file, 0
    n_periods, n = sorted(matrix.shape)
    arrays = {
        name: np.ravel(x if x.shape[0] == n_periods else x.T) if x.shape == matrix.shape else x
        for name, x in file.arrays.items()
        if not any(
            name.startswith(f"{other}.") and file.arrays[other].shape == matrix.shape
            for other in file.arrays
        )
    }
    if not is_repeated(arrays[full].astype(float), n):
        return file, 0
    for name in file.times:
        if file.arrays[name].size == n:
            t = np.ravel(file.arrays[name]).astype(float)
            arrays[name] = (
                t + np.arange(n_periods)[:, None] * (t[-1] - t[0]) * n / (n - 1)
            ).ravel()
    return replace(file, arrays=arrays), n


def merge_alternating_rows(file: Channels, names: Sequence[str]) -> Channels:
    """Return a file with alternating channels merged, one row each; the file itself if they do not
    alternate.
    """
    full = [file.full_name(name) for name in names]
    known = {
        name: file.arrays[name]
        for name in full
        if name in file.arrays and file.arrays[name].dtype.kind == "f"
    }
    if (
        len(known) < 2
        or len({array.shape for array in known.values()}) > 1
        or next(iter(known.values())).ndim != 1
    ):
        return file
    if np.logical_and.reduce([np.isfinite(array[:_HEAD_ROWS]) for array in known.values()]).any():
        return file
    rows = {name: np.flatnonzero(np.isfinite(array)) for name, array in known.items()}
    n = min(map(np.size, rows.values()))
    turns = np.array([held[:n] for held in rows.values()])
    if (
        n < 4
        or max(map(np.size, rows.values())) > n + 1
        or np.any(turns.max(axis=0)[:-1] >= turns.min(axis=0)[1:])
    ):
        return file
    merged = {name: known[name][held] for name, held in zip(known, turns, strict=True)}
    late = ""
    if (seconds := file.seconds(full[0])) is not None:
        t = seconds[turns]
        shift = float(np.median(t[1:] - t[0]) / np.median(np.diff(t[0])))
        if shift:
            late = f"; {full[1]} is {shift:.3g} samples later than {full[0]}, and G includes this delay"
        else:
            late = ""
        time = file.time_of(full[0])
        merged[time] = file.arrays[time][turns[0]]
    data_warning(
        f"the channels of {Path(file.path).name!r} alternate, one row each: {n} pairs were"
        f" merged{late}"
    )
    return replace(file, arrays={**file.arrays, **merged})


def _cut_windows(
    files: Sequence[Channels], start: Seconds, stop: Seconds, *, name: str, fs: float | None
) -> list[Channels]:
    """Return the parts of files from each start to its stop, in seconds from the first row; one
    realisation each.
    """
    starts, stops = ([] if one is None else np.atleast_1d(one).tolist() for one in (start, stop))
    starts, stops = starts or [0.0] * len(stops), stops or [np.inf] * len(starts)
    if len(starts) != len(stops):
        raise ValueError(f"start must have one stop for each, got {len(starts)} and {len(stops)}")
    parts = []
    for file in files if starts else ():
        n, t = file.signal("u", name).size, file.seconds(name)
        if t is None:
            t = np.arange(n) / file.sampling_frequency(fs, (name,))
        else:
            t = t - t[0]
        for first, end in zip(starts, stops, strict=True):
            rows = np.flatnonzero((t >= first - 1e-9 * t[-1]) & (t < end - 1e-9 * t[-1]))
            if rows.size < 4:
                raise ValueError(
                    f"start and stop must be inside {Path(file.path).name!r}, from 0 to {t[-1]:g}"
                    f" s, got {first:g} to {end:g} s with {format_small_count(rows.size, 'sample')}"
                )
            part = slice(rows[0], rows[-1] + 1)
            arrays = {key: x[part] if x.shape[:1] == (n,) else x for key, x in file.arrays.items()}
            parts.append(replace(file, arrays=arrays))
    return parts or list(files)


def find_rows_off(seconds: np.ndarray | None, fs: float) -> _LostRows | UnevenClock | None:
    """Return the lost rows of a time column, or its uneven clock; None if all rows are on an even
    clock.
    """
    return find_lost_rows(seconds, fs) or find_uneven_clock(seconds, fs)


def align_rows(
    files: Sequence[Channels],
    names: Sequence[str],
    groups: Sequence[Group],
    *,
    fs: float | None,
    options: Cutting,
) -> tuple[float, Cutting]:
    """Bring the streams of files onto one even clock, in place; return its rate [Hz] and the
    cutting options.

    Parameters
    ----------
    files : sequence of Channels
        Files.
    names : sequence of str
        Their channels; the time column of the first one is used.
    groups : sequence of Group
        Streams of these channels, input or reference first.
    fs : float, optional
        Sampling frequency as given [Hz].
    options : Cutting
        Cutting options.

    Raises
    ------
    ValueError
        Several clocks; unequal time steps without `resample` or `fs`; a file without a whole
        period.
    """
    clocks = [file.sampling_frequency(fs, tuple(names)) for file in files]
    if max(clocks) > min(clocks) * (1 + SAME_CLOCK):
        raise ValueError(
            f"path must be files with one sampling frequency, got {min(clocks):g} to"
            f" {max(clocks):g} Hz"
        )
    clock = clocks[0]
    lost: list[_LostRows | None] = []
    for m, file in enumerate(files):
        rows = find_rows_off(_trim_missing(groups, m, file.seconds(names[0])), clock)
        lost.append(rows if isinstance(rows, _LostRows) else None)
        if not isinstance(rows, UnevenClock):
            continue
        described = f"{Path(file.path).name!r}: {rows.describe()}"
        if options.resample:
            for _, streams in groups:
                streams[m] = rows.filled(streams[m])
            clock = rows.fs
            data_warning(
                f"{described}; its rows were interpolated to equal steps at {clock:g} Hz by a"
                " cubic spline"
            )
        elif fs is not None:
            data_warning(f"{described}; the given fs is used as if the steps were equal")
        else:
            raise ValueError(
                f"the time steps must be equal, but {described}; resample=True interpolates the"
                " rows to equal steps"
            )
    if not any(lost) or options.resample:  # resample finds the periods in the input
        return clock, options
    return clock, _keep_whole_periods(
        lost, groups, fs=clock, options=options, paths=[file.path for file in files]
    )


def _trim_missing(groups: Sequence[Group], m: int, seconds: np.ndarray | None) -> np.ndarray | None:
    """Cut the rows at both ends of a file where a channel has no number; return the times of the
    others.

    None if streams differ in length from each other, which is refused later, or from the time
    column.
    """
    sizes = {streams[m].shape[-1] for _, streams in groups}
    if len(sizes) > 1:
        return None
    if not (seconds is not None and seconds.size in sizes):
        seconds = None
    if all(all_finite(streams[m]) for _, streams in groups):
        return seconds
    finite = [np.isfinite(np.atleast_2d(streams[m])).all(axis=0) for _, streams in groups]
    held = np.logical_and.reduce(finite)
    if held.any():
        first, last = np.flatnonzero(held)[[0, -1]]
    else:
        first, last = 0, held.size - 1
    kept = slice(first, last + 1)
    n_cut = held.size - held[kept].size
    if not held[kept].all():
        worst = min(range(len(groups)), key=lambda i: finite[i].sum())
        bad = np.flatnonzero(~finite[worst])
        raise ValueError(
            f"{groups[worst][0]} must be finite, got {bad.size} nan or infinite numbers, the first"
            f" at {bad[0]}; if a channel has a slower clock than the other, its cells are empty:"
            " record both at one rate, or fill the gaps and give the arrays to"
            " record_from_samples(u, y, fs=...)"
        )
    if n_cut > _MAX_FRAYED_SHARE * held.size:
        data_warning(
            f"{n_cut} of {held.size} rows at the ends of the file have no number in every channel;"
            " they are left out"
        )
    for _, streams in groups:
        streams[m] = streams[m][..., kept]
    if seconds is None:
        return None
    return seconds[kept]


def _keep_whole_periods(
    lost: Sequence[_LostRows | None],
    groups: Sequence[Group],
    *,
    fs: float,
    options: Cutting,
    paths: Sequence[str],
) -> Cutting:
    """Remove from streams, in place, the periods with lost rows; return the cutting options for the
    rest.

    Parameters
    ----------
    lost : sequence of LostRows or None
        Lost rows of each file.
    groups : sequence of Group
        Streams, input or reference first.
    fs : float
        Sampling frequency [Hz].
    options : Cutting
        Cutting options.
    paths : sequence of str
        Paths of the files.

    Raises
    ------
    ValueError
        A file has no whole period.
    """
    n_samples = options.n_samples
    if n_samples is None and options.design is not None:
        n_samples = design_period(options.design, fs)
    elif n_samples is None:
        excitation = groups[0][1][0].reshape(-1, groups[0][1][0].shape[-1])[0]
        found = detect_period(excitation if lost[0] is None else lost[0].filled(excitation))
        n_samples = round(found)
        if abs(found - n_samples) > _WHOLE_TOLERANCE:
            return options  # refused later, when it is searched again
    n_samples = require_integer("n_samples", n_samples, least=4)
    n_discard = require_integer("n_discard", options.n_discard, least=0)
    for m, rows in enumerate(lost):
        if rows is not None:
            descriptions = f"{Path(paths[m]).name!r}: {rows.describe(n_samples)}"
            if not np.any(rows.whole_periods(n_samples) >= n_discard):
                raise ValueError(
                    f"u and y must hold a whole period of n_samples = {n_samples} samples after "
                    f"n_discard = {n_discard}, got {descriptions}; measure again, "
                    "or let resample=True look for periods"
                )
            data_warning(f"{descriptions}, and kept; the others are left out")
        for _, streams in groups:
            cut = n_discard * n_samples
            streams[m] = (
                streams[m][..., cut:]
                if rows is None
                else rows.kept(streams[m], n_samples, n_discard)
            )
    return options._replace(n_samples=n_samples, n_discard=0)


# [samples] a step further from a whole number shows a clock with jitter, not a lost row
_MAX_UNEVENNESS = 0.25
_WHOLE_TOLERANCE = 0.1  # [samples] largest distance of a period from a whole number
_MAX_NAMED = 3  # jumps that a message lists
_MAX_LOST_SHARE = 0.05  # share of the rows with a jump of time above which the rate varies
_HEAD_ROWS = 64  # rows that show whether signals alternate
_MAX_FRAYED_SHARE = (
    0.01  # share of rows at the ends of a file that may lack a channel without a warning
)
Seconds = float | Sequence[float] | None
#: Name of a parameter and the streams (..., n) of its signal, one per file.
Group: TypeAlias = tuple[str, list[np.ndarray]]
