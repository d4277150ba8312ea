"""Cut a record from streams of samples, as a measurement file contains them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nlfrf._base.arguments import channel_names, keep_warnings, require_kind, require_real_array
from nlfrf._base.numbers import squared_modulus
from nlfrf.records.excited_lines import detect_lines
from nlfrf.records.given_streams import Samples, Streams, list_runs
from nlfrf.records.periods import Cutting, records_from_streams
from nlfrf.records.record import Record
from nlfrf.records.reference import design_period, fill_reference
from nlfrf.signals.lines import LineGrid
from nlfrf.signals.multisine import Multisine

# above this share of the inputs on lines of the first, the first has the lines of all
_SHARED_SHARE = 0.5


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


def _has_channels(signal: Samples) -> bool:
    """Return whether streams have an axis of channels; the first one decides."""
    return np.ndim(list_runs(signal)[0]) == 2


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
    many = list_runs(signal)
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
