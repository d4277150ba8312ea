"""Streams cut into periods: where they begin, their lines, and what the output shows beside the
input.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from nlfrf._base.arguments import data_warning, require_integer, require_kind, require_positive
from nlfrf._base.numbers import iterate_blocks, streams_equal
from nlfrf.records.excited_lines import grid_level_jump, line_powers, lines_from_powers
from nlfrf.records.given_streams import (
    Samples,
    Streams,
    add_swap_hint,
    check_streams,
    output_label,
    output_names,
    warn_of_other_rates,
    warn_of_swapped,
)
from nlfrf.records.period import (
    describe_no_repetition,
    detect_period,
    detect_repetition,
    is_repeated,
)
from nlfrf.records.record import Record, SignalLabels
from nlfrf.records.reference import design_period, reconstruct_references
from nlfrf.records.screening.gaps import find_slips
from nlfrf.records.screening.input import (
    SEVERE_POWER,
    PeriodAlignment,
    resegment,
    track_input,
    warn_about_channel,
)
from nlfrf.records.screening.output import align_output, resample_to_input_clock
from nlfrf.records.screening.stream import (
    excited_span,
    find_outliers,
    unwrap_position,
    warn_of_hits,
    warn_of_outliers,
)
from nlfrf.signals.lines import LineGrid
from nlfrf.signals.multisine import Multisine


class Cutting(NamedTuple):
    """Options for cutting samples into periods; the names are arguments of
    `record_from_samples`.
    """

    n_samples: int | None = None
    lines: LineGrid | None = None
    n_discard: int = 0
    resample: bool = False
    design: Multisine | None = None
    hold: str | None = None


# share of its power that does not repeat, beyond which a signal is not periodic
_MAX_PERIOD_DIFFERENCE = 0.25
# rounds in which outputs are put onto the clock of the input and examined again
_MAX_CORRECTIONS = 3


def _cut_periods(
    kept: Streams,
    known: str,
    *,
    n_samples: int,
    fs: float,
    options: Cutting,
    labels: Mapping[str, SignalLabels],
) -> tuple[dict[str, np.ndarray], LineGrid, float]:
    """Cut streams into periods (M, P, N); return them with their lines and sampling frequency.

    `known` names the input or the reference. A fault of a channel is refused, warned of or, with
    `resample`, cured.
    """
    resample = options.resample
    _cut_silence(kept, known, n_samples=n_samples)
    stream = kept[known][0]
    for name, signal in kept.items():
        for one in signal:
            warn_about_channel(name, one, n_samples)
    warn_of_other_rates(kept, fs)
    with add_swap_hint(kept, labels):
        tracks = _track_inputs(kept[known], n_samples, resample)
    n_periods = min(one.size for one in kept["u"]) // n_samples

    def cut_into_periods(signal: list[np.ndarray]) -> np.ndarray:
        return _cut_stream(signal, tracks, n_periods=n_periods, n_samples=n_samples)

    # the streams are kept if they may be cut once more
    cut = {
        name: cut_into_periods(kept[name] if resample else kept.pop(name)) for name in list(kept)
    }
    with add_swap_hint(
        {name: [one.ravel() for one in signal[:1]] for name, signal in cut.items()}, labels
    ):
        _check_period(cut[known], stream, fs)
    warn_of_swapped(cut, labels)
    if options.lines is None:
        lines = _lines_of_periods(cut[known], options)
    else:
        lines = options.lines
    _require_equal_gaps(kept, tracks)
    for _ in range(_MAX_CORRECTIONS):  # a gap in one period hides that the clock of y is off, too
        if not _examine_outputs(kept, cut, tracks=tracks, lines=lines, resample=resample):
            break
        cut = {name: cut_into_periods(signal) for name, signal in kept.items()}
    else:  # a fault that no cure removed is refused
        _examine_outputs(kept, cut, tracks=tracks, lines=lines, resample=False)
    if resample and n_periods > 1 and cut["u"].shape[1] == 1:
        data_warning(
            f"resample leaves one period of {n_periods}: the others hold lost or repeated"
            " samples. One period does not separate noise from distortion, so noise counts as"
            " distortion in the bound. Measure again, or leave resample out if a time column"
            " shows the lost rows"
        )
    if resample and all(tracks):  # so that the input repeats at f0
        fs /= float(np.mean([where.spacing for where in tracks if where]))
    return cut, lines, fs


def _lines_of_periods(periods: np.ndarray, options: Cutting) -> LineGrid:
    """Return the lines of the design, or those found in an input or reference (M, P, N)."""
    if options.design is not None:
        return options.design.lines
    lines = _recognise_grid(periods)
    _, n_periods, n_samples = periods.shape
    if options.n_samples is None and n_periods == 2 and lines.kind == "custom":
        data_warning(
            f"the period of {n_samples} samples was found from a single repetition, and its"
            " lines form no known grid. If samples were lost within it, it is too short. Give"
            " the design that was played, or n_samples"
        )
    return lines


def _cut_silence(streams: Streams, known: str, *, n_samples: int) -> None:
    """Cut, in place, the silence before and after the excitation, the signal `known`, and warn of
    it.
    """
    for m, excitation in enumerate(streams[known]):
        some = excited_span(excitation, n_samples)
        found = [
            f"{n} samples ({n / n_samples:.2g} periods) {where}"
            for n, where in ((some.start, "before"), (excitation.size - some.stop, "after"))
            if n
        ]
        if found:
            data_warning(
                f"{output_label(known, m, streams[known])} is silent for {' and '.join(found)} the"
                " excitation: they are left out"
            )
            for signal in streams.values():
                signal[m] = signal[m][some]


def _track_inputs(
    excitation: list[np.ndarray], n_samples: int, resample: bool
) -> list[PeriodAlignment | None]:
    """Return the period alignment of each realisation; None if it is cut evenly.

    Refuse or cure faults.
    """
    tracks = [track_input(one, n_samples) for one in excitation if one.size >= 2 * n_samples]
    tracks = [found for found in tracks if found.unexplained < _MAX_PERIOD_DIFFERENCE]
    if resample and len(tracks) == len(excitation):
        return list(tracks)
    for where in tracks:
        _require_period_alignment(where)
    return [None] * len(excitation)


def _cut_stream(
    streams: list[np.ndarray],
    tracks: list[PeriodAlignment | None],
    *,
    n_periods: int,
    n_samples: int,
) -> np.ndarray:
    """Return a signal (M, P, N) cut at its tracked periods, or evenly; P is the smallest number of
    a realisation.
    """
    rows = [
        (
            one[: n_periods * n_samples].reshape(n_periods, n_samples)
            if where is None
            else resegment(one, where)[0]
        )
        for one, where in zip(streams, tracks, strict=True)
    ]
    least = min(len(periods) for periods in rows)
    if len(rows) == 1:
        return rows[0][np.newaxis, :least]
    cut = np.stack([periods[:least] for periods in rows])
    cut.flags.writeable = False
    return cut


def _examine_outputs(
    streams: Streams,
    cut: dict[str, np.ndarray],
    *,
    tracks: list[PeriodAlignment | None],
    lines: LineGrid,
    resample: bool,
) -> bool:
    """Look for faults of the outputs against the input: refuse them, warn of them, or cure them in
    the streams.

    Periods at the start that differ from the others, but not by a transient, are left out of `cut`.
    """
    if cut["u"].shape[1] < 2:
        return False
    cured, drifts, n_unsettled = False, [], 0
    for name in output_names(cut):
        for m, where in enumerate(tracks):
            lag = align_output(cut["u"][m], cut[name][m], lines.excited)
            described_label = output_label(name, m, tracks)
            if lag.fault and resample and where is not None:
                periods = resegment(streams["u"][m], where)[1][: len(lag.sound)]
                streams[name][m], good = resample_to_input_clock(streams[name][m], lag, periods)
                sound = where.sound.copy()
                sound[periods[~good]] = False
                if not sound.any():
                    raise ValueError(
                        f"{described_label} must hold a period without a fault, got none:"
                        f" {lag.fault}"
                    )
                tracks[m] = replace(where, sound=sound)
                cured = True
                continue
            if lag.fault and lag.severe:
                raise ValueError(
                    f"{described_label} must stay in step with u from period to period, got:"
                    f" {lag.fault}"
                )
            if lag.fault:
                data_warning(
                    f"{lag.fault}; otherwise {100 * lag.misplaced:.2g} % of the power of"
                    f" {described_label} is out of place"
                )
            drifts += [
                f"{described_label}: {message}" for message in (lag.start, lag.drift) if message
            ]
            n_unsettled = max(n_unsettled, lag.n_unsettled)
    if not cured:  # after a cure all outputs are examined again
        for drift in drifts:
            data_warning(drift)
        cut |= {name: signal[:, n_unsettled:] for name, signal in cut.items()}
    return cured


def _require_equal_gaps(streams: Streams, tracks: list[PeriodAlignment | None]) -> None:
    """Apply `_require_gap` to every output that is cut at the periods of its input."""
    for m, where in enumerate(tracks):
        if where is not None:
            for name in output_names(streams):
                _require_gap(output_label(name, m, tracks), streams[name][m], where)


def _require_gap(name: str, y: np.ndarray, where: PeriodAlignment) -> None:
    """Refuse an output without the gap of its input before all sound periods: the delay after it is
    unknown.
    """
    first = int(np.argmax(where.sound))
    lost = where.gaps[:first].sum()
    if not lost:
        return
    periods = y[: (first + 1) * where.n_samples].reshape(first + 1, where.n_samples)
    found = find_slips(periods, where.n_samples // 2)[:first].sum()
    if found != lost:
        of_u, of_y = (
            f"{abs(n):g} samples {'lost' if n < 0 else 'repeated'}" if n else "none"
            for n in (lost, found)
        )
        raise ValueError(
            f"{name} must have the same lost or repeated samples as u before period {first + 1}"
            f" ({of_u}), got {of_y}. The delay of this output is unknown from there on: measure"
            " again"
        )


def _recognise_grid(periodic: np.ndarray) -> LineGrid:
    """Return the lines of an input or reference; warn if they look like distortion of an
    actuator.
    """
    power, noise = line_powers(periodic)
    grid = lines_from_powers(power, noise)
    jump = grid_level_jump(power, grid)
    if jump:
        data_warning(
            f"the amplitudes of the {grid.excited.size} lines that were found in the input"
            f" differ by {jump:.1f} dB from line to line, as if some were distortion of an"
            " actuator. Give the design that was played, or lines"
        )
    return grid


def _require_period_alignment(where: PeriodAlignment) -> None:
    """Refuse misplaced periods that would count as distortion; warn of smaller misplacements."""
    fault = where.fault
    if fault and (where.misplaced > SEVERE_POWER or not where.sound.all()):
        raise ValueError(
            f"n_samples must be the period of the input, got {where.n_samples}: {fault}"
        )
    if fault:
        data_warning(
            f"{fault}; otherwise {100 * where.misplaced:.2g} % of the input's power is out of place"
        )


def _rounded_period(u: np.ndarray, resample: bool) -> int:
    """Return the period of the input, rounded to samples; `track_input` then finds whether it is
    whole.
    """
    period = detect_period(u[excited_span(u, u.size // 16)])
    if abs(period - round(period)) > 0.1 and not resample:
        raise ValueError(
            f"n_samples must be given: the period of u seems to be {period:.2f} samples, not a"
            " whole number; resample=True cuts it on that period"
            if is_repeated(u, period)
            else describe_no_repetition(u.size)
        )
    return round(period)


def _check_period(u: np.ndarray, stream: np.ndarray, fs: float) -> None:
    """Refuse periods that do not repeat each other: the period, or the signal, is wrong."""
    _, n_periods, n_samples = u.shape
    if n_periods < 2:
        return
    lost, whole = 0.0, 0.0
    for one in u:
        if all(streams_equal(one[0], period) for period in one[1:]):
            continue
        middle = one.mean()
        for some in iterate_blocks(n_samples, n_periods):
            mean = np.add.reduce(one[:, some]) / n_periods
            lost += sum(float(np.sum((period - mean) ** 2)) for period in one[:, some])
            whole += n_periods * float(np.sum((mean - middle) ** 2))
    if lost > _MAX_PERIOD_DIFFERENCE * (whole + lost):
        unexplained = lost / (whole + lost)
        try:
            period = detect_repetition(stream)
            found = f"its autocorrelation points to {period:.1f}"
            if abs(period / fs - n_samples) < 0.1:
                found += f"; a period counts samples: {n_samples} s at {fs:g} Hz are {period:.0f}"
        except ValueError as error:
            found = f"it does not seem to repeat at all; {error}"
        raise ValueError(
            f"n_samples must be the period of the input, got {u.shape[2]}: "
            f"{100 * unexplained:.0f} % of its power does not repeat from period to period; {found}"
        )


def _screen_outputs(streams: Streams, *, n_samples: int, fs: float) -> bool:
    """Warn of the outliers of every output in every realisation; return whether there are any."""
    pairs = [
        (name, u, y)
        for name in output_names(streams)
        for u, y in zip(streams["u"], streams[name], strict=True)
    ]
    return (
        sum(warn_of_outliers(name, y, u=u, n_samples=n_samples, fs=fs) for name, u, y in pairs) > 0
    )


def _leave_out_outliers(cut: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Leave out the periods (M, P, N) in which an output has outliers, if at least half of all
    periods remain.
    """
    _, n_periods, n_samples = cut["u"].shape
    good = np.ones(n_periods, dtype=bool)
    for name in output_names(cut):
        for u, y in zip(cut["u"], cut[name], strict=True):
            good[find_outliers(y.ravel(), u.ravel(), n_samples)[0] // n_samples] = False
    if good.all() or 2 * np.count_nonzero(good) < n_periods:
        return cut
    return {name: signal[:, good] for name, signal in cut.items()}


def records_from_streams(
    u: Samples,
    outputs: Mapping[str, Samples],
    *,
    r: Samples | None,
    fs: float,
    options: Cutting,
    labels: Mapping[str, SignalLabels] | None = None,
    named: bool = False,
) -> list[Record]:
    """Return `record_from_samples` for several named outputs: one record each, with the same input,
    and its labels.

    Read-only streams of one realisation go into the record without a copy.
    """
    n_samples, lines, n_discard, resample, design, hold = options
    fs, n_discard = require_positive("fs", fs), require_integer("n_discard", n_discard, least=0)
    for name, given, kind in (("design", design, Multisine), ("lines", lines, LineGrid)):
        if given is not None:
            require_kind(name, given, kind)
    streams = {
        name: [unwrap_position(name, one) for one in signal]
        for name, signal in check_streams(u, outputs, r=r, named=named).items()
    }
    labels = {name: (labels or {}).get(name, {}) for name in outputs}
    # an output may be emptier between the lines than a sum of inputs
    if named:
        pairs = {}
    else:
        pairs = labels
    del u, outputs, r  # long streams are held once
    known = "r" if "r" in streams else "u"
    for one in streams[known]:
        warn_of_hits(known, one[excited_span(one, one.size // 16)])
    if n_samples is None and design is not None:
        n_samples = design_period(design, fs)
    elif n_samples is None:
        with add_swap_hint(streams, pairs):
            n_samples = _rounded_period(streams[known][0], resample)
    n_samples = require_integer("n_samples", n_samples, least=4)
    has_outliers = _screen_outputs(streams, n_samples=n_samples, fs=fs)
    if (n := min(one.size for one in streams[known])) < (n_discard + 1) * n_samples:
        raise ValueError(
            f"u and y must hold at least one period of n_samples = {n_samples} samples after"
            f" n_discard = {n_discard}, got {n} samples, which is {n / n_samples:.2f} periods"
        )
    kept = {
        name: [one[n_discard * n_samples :] for one in signal] for name, signal in streams.items()
    }
    del streams
    cut, lines, fs = _cut_periods(
        kept, known, n_samples=n_samples, fs=fs, options=options, labels=pairs
    )
    if has_outliers:
        cut = _leave_out_outliers(cut)
    if design is not None:
        cut.setdefault("r", reconstruct_references(design, cut["u"][None])[0])
        if hold is None:
            hold = design.hold
    u, r = cut.pop("u"), cut.pop("r", None)
    (y, label), *others = zip(cut.values(), labels.values(), strict=True)
    first = Record(
        u=u, y=y, r=r, fs=fs, lines=lines, hold="unknown" if hold is None else hold, **label
    )
    return [first, *(replace(first, y=y, **label) for y, label in others)]  # type: ignore[misc]  # its constructor takes them
