"""Faults found in signals before they are cut into periods, sample by sample, for a picture."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from contextlib import suppress
from enum import Enum
from typing import NamedTuple

import numpy as np

from nlfrf._base.arguments import format_count
from nlfrf._base.values import value
from nlfrf.records.excited_lines import detect_lines
from nlfrf.records.screening.input import track_input
from nlfrf.records.screening.output import align_output
from nlfrf.records.screening.stream import excited_span, find_outliers, unwrap_position


class Fault(Enum):
    """Kind of a span of samples that is no period of the record, or a period unlike the others."""

    SILENCE = "silence, left out"
    REST = "no whole period, left out"
    LOST = "samples lost or repeated"
    DIFFERENT = "period differs from the others"


class _FaultySpan(NamedTuple):
    """Samples first to end - 1 of a record, with the kind and the extent of their fault."""

    fault: Fault
    first: int
    end: int
    extent: str


@value
class ScreenedStreams:
    """Streams of samples as they were recorded, with the faults found by screening."""

    labels: tuple[str, ...]  # name and unit of each stream
    samples: np.ndarray  # (C, n) the streams, positions unwrapped; nan at lost rows
    fs: float  # sampling frequency [Hz]; nan if unknown
    period: float  # period of the excitation [samples], 0 if the excitation does not repeat
    starts: np.ndarray  # (P,) first samples of the whole periods
    spans: tuple[_FaultySpan, ...]  # spans that are no period, or a period unlike the others
    outliers: tuple[np.ndarray, ...]  # (k,) samples of each stream that are far outside all others


def screen_streams(
    streams: Sequence[np.ndarray],
    labels: Sequence[str],
    *,
    n_inputs: int,
    fs: float,
    period: float,
    place: np.ndarray | None = None,
) -> ScreenedStreams:
    """Look for the faults of streams that were sampled together, and keep their places.

    Parameters
    ----------
    streams : sequence of (n,) ndarray
        Inputs first; the first of them shows the periods.
    labels : sequence of str
        Name and unit of each.
    n_inputs : int
        Inputs and references among the streams.
    fs : float
        Sampling frequency [Hz].
    period : float
        Period of the first stream [samples], 0 if it does not repeat.
    place : (n,) int ndarray, optional
        Sample number of each row, if a time column shows that rows are lost.

    Examples
    --------
    >>> u = np.tile(np.random.default_rng(1).standard_normal(100), 3)
    >>> u = np.concatenate([np.zeros(130), u, np.zeros(70)])
    >>> found = screen_streams([u], ["u"], n_inputs=1, fs=100.0, period=100.0)
    >>> found.starts.tolist(), [(span.fault.name, span.first, span.end) for span in found.spans]
    ([130, 230, 330], [('SILENCE', 0, 130), ('SILENCE', 430, 500)])
    """
    if place is None:
        rows = np.arange(streams[0].size)
    else:
        rows = place
    n = int(rows[-1]) + 1
    smooth = [
        np.interp(np.arange(n), rows, _unwrap_silently(x)) for x in streams
    ]  # lost rows are interpolated
    whole = round(period)
    outliers = [
        find_outliers(x, x if k < n_inputs else smooth[0], whole or n)[0]
        for k, x in enumerate(smooth)
    ]
    steps = np.diff(rows)
    spans = [
        _FaultySpan(
            Fault.LOST,
            int(rows[j]) + 1,
            int(rows[j + 1]),
            format_count(int(steps[j]) - 1, "sample"),
        )
        for j in np.flatnonzero(steps > 1)
    ]
    starts = np.zeros(0, dtype=int)
    if whole:
        excited = excited_span(smooth[0], whole)
        kept = [x[excited] for x in smooth]
        if place is None:
            starts, slips = _find_slipped_periods(kept, n_inputs, period)
        else:
            starts, slips = _evenly(kept[0], period), []
        starts = starts + excited.start
        if starts.size:
            last = int(starts[-1]) + whole
        else:
            last = excited.stop
        spans += [
            span._replace(first=span.first + excited.start, end=span.end + excited.start)
            for span in slips
        ]
        spans += [
            _FaultySpan(fault, first, end, format_count(end - first, "sample"))
            for fault, first, end in (
                (Fault.SILENCE, 0, excited.start),
                (Fault.REST, last, excited.stop),
                (Fault.SILENCE, excited.stop, n),
            )
            if end > first
        ]
    missing = np.setdiff1d(np.arange(n), rows)
    for x in smooth:
        x[missing] = np.nan
    return ScreenedStreams(
        labels=tuple(labels),
        samples=np.array(smooth),
        fs=fs,
        period=period,
        starts=starts,
        spans=tuple(spans),
        outliers=tuple(outliers),
    )


def _unwrap_silently(x: np.ndarray) -> np.ndarray:
    """Return a stream (n,) without the jumps of a position that wraps; unchanged if its direction
    is unknown.
    """
    with warnings.catch_warnings(), suppress(ValueError):
        warnings.simplefilter("ignore")
        return unwrap_position("", x)
    return x


def _evenly(x: np.ndarray, period: float) -> np.ndarray:
    """Return the first samples of whole periods of a stream (n,), one after the other."""
    return np.round(np.arange(int(x.size / period + 1e-9)) * period).astype(int)


def _find_slipped_periods(
    streams: Sequence[np.ndarray], n_inputs: int, period: float
) -> tuple[np.ndarray, list[_FaultySpan]]:
    """Return the first samples of whole periods, and the spans with lost samples or with a period
    unlike the others.

    The outputs are examined only if the input has lost nothing: else they share its gap, or have no
    reference.
    """
    n = round(period)
    if streams[0].size < 2 * n:
        return _evenly(streams[0], period), []
    where = track_input(streams[0], n)
    pace = where.period if where.sound.any() else period
    starts = np.round(np.arange(where.sound.size) * pace + where.jumps).astype(int)
    inside = (starts >= 0) & (starts + n <= streams[0].size)
    slips, differs = where.jumps, ~where.sound
    if not slips.any() and not differs.any():
        with suppress(ValueError):  # an input without lines
            u, *others = (
                x[: slips.size * n].reshape(-1, n) for x in (streams[0], *streams[n_inputs:])
            )
            for lag in (align_output(u, y, detect_lines(u[None]).excited) for y in others):
                slips = slips + lag.jumps
                differs = (
                    differs
                    | lag.corrupted
                    | ~lag.sound & (np.arange(len(u)) >= np.argmax(lag.sound))
                )
    steps = np.diff(slips, append=slips[-1])
    spans = []
    for j in np.flatnonzero(inside & (differs | (steps != 0))).tolist():
        lost = Fault.LOST, _describe_slip(float(steps[j]), j)
        if steps[j]:
            fault, extent = lost
        else:
            fault, extent = Fault.DIFFERENT, f"period {j + 1}"
        spans.append(_FaultySpan(fault, int(starts[j]), int(starts[j]) + n, extent))
    return starts[inside], spans


def _describe_slip(step: float, period: int) -> str:
    """Describe the lost or repeated samples of a period, counted from zero.

    >>> _describe_slip(-3.0, 1)
    '3 samples lost in period 2'
    """
    return (
        f"{format_count(round(abs(step)), 'sample')} {'lost' if step < 0 else 'repeated'} in period"
        f" {period + 1}"
    )
