"""Cut a record from streams of samples, as a measurement file contains them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from nlfrf._base.arguments import (
    channel_names,
    data_warning,
    keep_warnings,
    require_integer,
    require_kind,
    require_positive,
    require_real_array,
)
from nlfrf._base.numbers import has_equal_periods, iterate_blocks, squared_modulus, streams_equal
from nlfrf.records.direction import SignalLines, describe_played, find_signal_lines
from nlfrf.records.excited_lines import (
    detect_lines,
    grid_level_jump,
    line_powers,
    lines_from_powers,
)
from nlfrf.records.period import (
    describe_no_repetition,
    detect_period,
    detect_repetition,
    is_repeated,
)
from nlfrf.records.record import Record, SignalLabels, require_varying
from nlfrf.records.reference import design_period, fill_reference, reconstruct_references
from nlfrf.records.screening.gaps import find_slips
from nlfrf.records.screening.input import (
    SEVERE_POWER,
    PeriodAlignment,
    hold_factor,
    repeated_share,
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

# share of its power that does not repeat, beyond which a signal is not periodic
_MAX_PERIOD_DIFFERENCE = 0.25
# rounds in which outputs are put onto the clock of the input and examined again
_MAX_CORRECTIONS = 3
# above this share of the inputs on lines of the first, the first has the lines of all
_SHARED_SHARE = 0.5
Streams = dict[str, list[np.ndarray]]
#: Samples as they are given: one stream, or one for each realisation or experiment.
Samples: TypeAlias = "np.ndarray | Sequence[np.ndarray]"


@keep_warnings
def record_from_samples(
    u: np.ndarray | Sequence[np.ndarray],
    y: np.ndarray | Sequence[np.ndarray],
    *,
    fs: float,
    n_samples: int | None = None,
    lines: LineGrid | None = None,
    r: np.ndarray | Sequence[np.ndarray] | None = None,
    n_discard: int = 0,
    resample: bool = False,
    design: Multisine | None = None,
    hold: str | None = None,
    inputs: Sequence[str] = (),
    outputs: Sequence[str] = (),
) -> Record:
    """Make a record from streams of samples: cut them into whole periods, and search every channel
    for faults.

    Use this for samples in memory; `load_record` does the same for a file.

    Parameters
    ----------
    u, y : (n,) or (n_channels, n) ndarray, or a list of M of them
        Inputs and outputs, sampled at the same times. A list holds one array per realisation of the
        random phases, or per experiment. For one channel also (n_samples, P): one period per
        column.
    fs : float
        Sampling frequency [Hz].
    n_samples : int, optional
        Samples in one period; by default found from the first input.
    lines : LineGrid, optional
        Excited lines and detection lines (not excited); by default found from `r`, or from all
        inputs if `r` is not given.
    r : (n,) or (n_u, n) ndarray, or a list of M of them, optional
        References without noise, as in `Record`.
    n_discard : int
        Number of periods to leave out at the start, because of the transient.
    resample : bool
        Find the start of each period from the repetition of the input, and interpolate between
        samples. Use this for a period that is not a whole number of samples, for a drifting clock,
        and for lost or repeated samples. The sampling frequency of the record is then n_samples
        divided by the length of a period.
    design : Multisine, optional
        Design that was played. Its lines and its period are used, and its signal is the reference.
        Noise on the measured inputs and distortion by the actuators then cause no error. A
        "zippered" design, in which each line excites one input, gives no reference, and is for open
        loop only. Give the experiments in the order of the design.
    hold : str, optional
        Inputs between their samples, "zoh" or "band-limited"; see `Record`. By default the hold of
        the design.
    inputs, outputs : sequence of str
        Names of the channels.

    Returns
    -------
    Record
        Record with all periods that are whole in every stream, without the first `n_discard`.

    Raises
    ------
    ValueError
        Streams have different lengths or are shorter than one period; the input does not have the
        given period; the period is not a whole number of samples; the clock drifts; samples are
        lost; or the input is not that of the design. The message states the numbers and the remedy.

    Warns
    -----
    DataWarning
        Faults that do not prevent a result: small timing errors of periods; a clipped or constant
        part of a signal; outliers of an output; hammer hits instead of a multisine. Other warnings
        state a change that was made: samples without excitation at the ends are left out; a
        position that jumps back after each turn is made continuous; a first period is left out if
        it differs from the others for a reason other than a transient.

    Examples
    --------
    >>> from nlfrf.signals.multisine import multisine
    >>> u = np.tile(multisine(fs=100, n_samples=100, f_min=1, f_max=20, rng=1).u[0], 3)
    >>> record = record_from_samples(u, 2 * u, fs=100, n_samples=100, n_discard=1)
    >>> record.u.shape, record.lines.excited.tolist()
    ((1, 2, 100), [1, 3, 9, 11, 17, 19])

    Two inputs and two outputs, in two experiments:

    >>> ms = multisine(fs=100, n_samples=100, f_min=1, f_max=20, n_inputs=2, rng=1)
    >>> u = [np.tile(ms.u[:, m], 3) for m in range(2)]
    >>> record_from_samples(u, [2 * one for one in u], fs=100, n_samples=100, n_discard=1).u.shape
    (2, 2, 2, 100)
    """
    if design is not None:
        require_kind("design", design, Multisine)
    signals: dict[str, Samples] = {"u": u, "y": y}
    if r is not None:
        signals["r"] = r
    if all(
        isinstance(x, np.ndarray) and x.ndim == 2 and x.shape[0] > x.shape[1]
        for x in signals.values()
    ):
        n_samples = len(signals["u"]) if n_samples is None else n_samples  # periods side by side
        signals = {name: np.ravel(np.asarray(x).T) for name, x in signals.items()}
        u, y, r = signals["u"], signals["y"], signals.get("r")
    options = Cutting(n_samples, lines, n_discard, resample, design, hold)
    several = design is not None and not design.is_single
    if inputs or outputs or several or any(map(_has_channels, signals.values())):
        return _record_of_channels(signals, fs, options=options, inputs=inputs, outputs=outputs)
    (record,) = records_from_streams(u, {"": y}, r=r, fs=fs, options=options)
    return record


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


def _has_channels(signal: Samples) -> bool:
    """Return whether streams have an axis of channels; the first entry of a list decides."""
    if isinstance(signal, list | tuple) and signal:
        first = signal[0]
    else:
        first = signal
    return np.ndim(first) == 2


def _record_of_channels(
    signals: dict[str, Samples],
    fs: float,
    *,
    options: Cutting,
    inputs: Sequence[str],
    outputs: Sequence[str],
) -> Record:
    """Return `record_from_samples` for several inputs or outputs, or for channels that have
    names.
    """
    design = options.design
    if design is not None:
        options = options._replace(
            n_samples=design_period(design, fs) if options.n_samples is None else options.n_samples,
            lines=design.lines if options.lines is None else options.lines,
            hold=design.hold if options.hold is None else options.hold,
        )
    streams = {name: _split_experiments(name, signal) for name, signal in signals.items()}
    for name, signal in streams.items():
        lengths, wanted = ([one.shape[1] for one in some] for some in (signal, streams["u"]))
        if lengths != wanted:
            raise ValueError(
                f"{name} must have the experiments and samples of u, {wanted}, got {lengths}"
            )
    inputs, outputs = (
        channel_names(name, given, len(streams[of][0]))
        for name, given, of in (("inputs", inputs, "u"), ("outputs", outputs, "y"))
    )
    known = "r" if "r" in streams else "u"
    names = {"u": inputs, "y": outputs, "r": inputs}
    lines = options.lines
    found, fs = _cut_together(streams, known, names=names, fs=fs, options=options)
    if lines is None:
        every = [detect_lines(channel) for channel in found[known]]
        lines = LineGrid(excited=np.unique(np.concatenate([grid.excited for grid in every])))
    fill_reference(found, design)
    hold = "unknown" if options.hold is None else options.hold
    return Record(
        u=found["u"],
        y=found["y"],
        r=found.get("r"),
        fs=fs,
        lines=lines,
        hold=hold,
        inputs=inputs,
        outputs=outputs,
    )


def _cut_together(
    streams: Streams, known: str, *, names: dict[str, tuple[str, ...]], fs: float, options: Cutting
) -> tuple[dict[str, np.ndarray], float]:
    """Cut every signal (channels, M, P, N) at the periods of the known signals; return them with
    their fs.

    All channels are cut at once: a period lost in one channel is lost in all.
    """
    channels = {
        _channel_label(name, i, names[name]): [one[i] for one in signal]
        for name, signal in streams.items()
        for i in range(len(signal[0]))
    }
    summed = [_sum_with_all_lines(one) for one in streams[known]]
    options = options._replace(design=None, hold=None)
    cut = records_from_streams(summed, channels, r=None, fs=fs, options=options, named=True)
    rows = iter(cut)
    found = {
        name: np.stack([next(rows).y for _ in range(len(signal[0]))])
        for name, signal in streams.items()
    }
    return found, cut[0].fs


def _channel_label(name: str, i: int, names: tuple[str, ...]) -> str:
    """Return the label of a channel for messages: "y2", or "y2 (position)" where it has a name."""
    if i < len(names):
        return f"{name}{i + 1} ({names[i]})"
    return f"{name}{i + 1}"


def _sum_with_all_lines(channels: np.ndarray) -> np.ndarray:
    """Return one signal (n,) with the lines of all channels: the first, or the sum if each has
    lines of its own.
    """
    power = squared_modulus(np.fft.rfft(channels - channels.mean(axis=1, keepdims=True), axis=1))
    size = np.add.reduce(power, axis=1)
    share = power[size > 0] / size[size > 0, None]
    if len(share) < len(channels) or np.minimum(share, share[0]).sum(axis=1).min() > _SHARED_SHARE:
        return np.asarray(channels[0])
    return np.asarray((1 / np.sqrt(size)) @ channels)


def _split_experiments(name: str, signal: Samples) -> list[np.ndarray]:
    """Return the streams (n_channels, n) of each experiment."""
    if isinstance(signal, list | tuple) and np.ndim(signal[0] if len(signal) else 0):
        many = list(signal)
    else:
        many = [signal]
    arrays = [
        require_real_array(
            f"{name}[{m}]" if len(many) > 1 else name, one, ndim=2 if np.ndim(one) != 1 else 1
        )
        for m, one in enumerate(many)
    ]
    arrays = [one if one.ndim == 2 else one[None] for one in arrays]
    for one in arrays:
        if one.shape[0] > one.shape[1]:
            raise ValueError(
                f"{name} must be (channels, samples), got shape {one.shape}: transpose it"
            )
    if not arrays or len({one.shape[0] for one in arrays}) != 1:
        raise ValueError(
            f"{name} must have the same channels in every experiment, got"
            f" {[one.shape for one in arrays]}"
        )
    return arrays


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
        for name, signal in _check_streams(u, outputs, r=r, named=named).items()
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
        with _add_swap_hint(streams, pairs):
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


def _screen_outputs(streams: Streams, *, n_samples: int, fs: float) -> bool:
    """Warn of the outliers of every output in every realisation; return whether there are any."""
    pairs = [
        (name, u, y)
        for name in _output_names(streams)
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
    for name in _output_names(cut):
        for u, y in zip(cut["u"], cut[name], strict=True):
            good[find_outliers(y.ravel(), u.ravel(), n_samples)[0] // n_samples] = False
    if good.all() or 2 * np.count_nonzero(good) < n_periods:
        return cut
    return {name: signal[:, good] for name, signal in cut.items()}


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
    _warn_of_other_rates(kept, fs)
    with _add_swap_hint(kept, labels):
        tracks = _track_inputs(kept[known], n_samples, resample)
    n_periods = min(one.size for one in kept["u"]) // n_samples

    def cut_into_periods(signal: list[np.ndarray]) -> np.ndarray:
        return _cut_stream(signal, tracks, n_periods=n_periods, n_samples=n_samples)

    # the streams are kept if they may be cut once more
    cut = {
        name: cut_into_periods(kept[name] if resample else kept.pop(name)) for name in list(kept)
    }
    with _add_swap_hint(
        {name: [one.ravel() for one in signal[:1]] for name, signal in cut.items()}, labels
    ):
        _check_period(cut[known], stream, fs)
    _warn_of_swapped(cut, labels)
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
                f"{_output_label(known, m, streams[known])} is silent for {' and '.join(found)} the"
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
    for name in _output_names(cut):
        for m, where in enumerate(tracks):
            lag = align_output(cut["u"][m], cut[name][m], lines.excited)
            described_label = _output_label(name, m, tracks)
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


def _output_label(name: str, m: int, tracks: Sequence[object]) -> str:
    """Return the label of a signal in messages, with its realisation m if there are several."""
    if len(tracks) == 1:
        return name
    return f"{name}, realisation {m}"


def _output_names(signals: Iterable[str]) -> list[str]:
    return [name for name in signals if name not in ("u", "r")]


def _require_equal_gaps(streams: Streams, tracks: list[PeriodAlignment | None]) -> None:
    """Apply `_require_gap` to every output that is cut at the periods of its input."""
    for m, where in enumerate(tracks):
        if where is not None:
            for name in _output_names(streams):
                _require_gap(_output_label(name, m, tracks), streams[name][m], where)


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


def _check_streams(
    u: Samples, outputs: Mapping[str, Samples], *, r: Samples | None, named: bool
) -> Streams:
    """Return the streams of each signal, one per realisation, after a check that they belong
    together.

    Messages call an output y unless outputs are named.
    """
    streams = {"u": _to_streams("u", u)}
    for output, y in outputs.items():
        if named:
            name = output
        elif len(outputs) > 1:
            name = f"y {output!r}"
        else:
            name = "y"
        streams[name] = _to_streams(name, y)
    if r is not None:
        streams["r"] = _to_streams("r", r)
    for name, signal in streams.items():
        if len(signal) != len(streams["u"]):
            raise ValueError(
                f"{name} must hold as many realisations as u, {len(streams['u'])}, got"
                f" {len(signal)}"
            )
        for m, (one, u_one) in enumerate(zip(signal, streams["u"], strict=True)):
            if one.size != u_one.size:
                if len(signal) == 1:
                    which = ""
                else:
                    which = f" in realisation {m}"
                raise ValueError(
                    f"{name} must be as long as u, {u_one.size} samples{which}, got {one.size}"
                )
    for name, signal in streams.items():
        for one in signal:
            require_varying(name, one[np.newaxis])
    return streams


def _warn_of_other_rates(streams: Streams, fs: float) -> None:
    """Warn of an output that was sampled more slowly than the input, and held."""
    for name in _output_names(streams):
        n = hold_factor(streams[name][0])
        if n > 1 and n != hold_factor(streams["u"][0]):
            nth = {2: "2nd", 3: "3rd"}.get(n, f"{n}th")
            data_warning(
                f"{name} changes at every {nth} sample only: it was sampled at {fs / n:g} Hz and"
                " held. G includes this hold and its aliases; record u and y at one rate"
            )
        elif share := repeated_share(streams[name][0], streams["u"][0]):
            data_warning(
                f"{name} repeats its last value at {100 * share:.2g} % of the samples and goes on"
                " by full steps: its sensor is slower than the record. G includes the delay of"
                " this sensor and its aliases; record u and y at one rate"
            )


def _warn_of_swapped(cut: dict[str, np.ndarray], labels: Mapping[str, SignalLabels]) -> None:
    """Warn of an output that is the multisine, or repeats to the last digit, while the input is not
    or does not.
    """
    if "r" in cut or not labels:
        return
    message = [
        f"{name} repeats exactly and u does not: are they swapped? u is what was played"
        for name in _output_names(cut)
        if cut["u"].shape[1] > 1
        and has_equal_periods(cut[name])
        and not has_equal_periods(cut["u"])
    ]
    message.append(_describe_swap(cut, lambda signal: find_signal_lines(signal[:1, -2:]), labels))
    if any(message):
        data_warning("; ".join(filter(None, message)))


@contextmanager
def _add_swap_hint(streams: Streams, labels: Mapping[str, SignalLabels]) -> Iterator[None]:
    """Add to a refusal of the input the hint that the multisine is found in an output, if it is."""
    try:
        yield
    except ValueError as error:
        if not (found := _describe_swap(streams, _lines_of_first_period, labels)):
            raise
        raise ValueError(f"{found}; otherwise {error}") from None


def _lines_of_first_period(signal: Sequence[np.ndarray]) -> SignalLines | None:
    """Return the lines of the first period of a signal, whose period is detected; None if it has
    none.

    Lost samples make the detected period shorter by a fraction. Of the two nearest whole periods
    the one with the more even lines is taken.
    """
    try:
        n = int(detect_period(signal[0]))
    except ValueError:
        return None
    both = (find_signal_lines(signal[0][np.newaxis, np.newaxis, :k]) for k in (n, n + 1))
    return min(filter(None, both), key=lambda one: one.spread, default=None)


def _describe_swap(
    signals: Mapping[str, Any],
    lines_of: Callable[[Any], SignalLines | None],
    labels: Mapping[str, SignalLabels],
) -> str:
    """Describe swapped signals: the lines show that an output was played and the input was not;
    else an empty text.

    Parameters
    ----------
    signals : mapping of str to a signal
        Input and outputs; with a reference the text is empty.
    lines_of : callable
        Lines of a signal, None if it has none.
    labels : mapping of str to mapping
        Names of input and output, for each output.
    """
    if "r" in signals or not labels:
        return ""
    u = lines_of(signals["u"])
    for name, label in zip(_output_names(signals), labels.values(), strict=True):
        u_name, y_name = (
            f" ({label[key]})" if label.get(key) else "" for key in ("u_name", "y_name")
        )
        if found := "" if u and u.is_clean else describe_played(lines_of(signals[name]), u):
            return (
                f"the multisine is found in y{y_name}, {found}, and not in u{u_name}: are input and"
                " output swapped? u is what was played; in a closed loop name its reference, r"
            )
    return ""


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


def _to_streams(name: str, signal: Samples) -> list[np.ndarray]:
    """Return one-dimensional streams, one per realisation."""
    if isinstance(signal, list | tuple) and signal and np.ndim(signal[0]) > 0:
        many = list(signal)
    else:
        many = [signal]
    if many[0] is signal and np.ndim(signal) != 1:
        shape = np.shape(signal)
        raise ValueError(
            f"{name} must be one stream of samples, or a list of them, got shape {shape}"
        )
    return [
        require_real_array(f"{name}[{m}]" if len(many) > 1 else name, one, ndim=1)
        for m, one in enumerate(many)
    ]


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
