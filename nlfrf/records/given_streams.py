"""The streams of a record as given: their shapes and rates, and a hint if input and output look
swapped.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, TypeAlias

import numpy as np

from nlfrf._base.arguments import data_warning, require_real_array
from nlfrf._base.numbers import has_equal_periods
from nlfrf.records.direction import SignalLines, describe_played, find_signal_lines
from nlfrf.records.period import detect_period
from nlfrf.records.record import SignalLabels, require_varying
from nlfrf.records.screening.input import hold_factor, repeated_share

#: Samples as they are given: one stream, or one for each realisation or experiment.
Samples: TypeAlias = "np.ndarray | Sequence[np.ndarray]"
Streams = dict[str, list[np.ndarray]]


def list_runs(signal: Samples) -> list[Samples]:
    """Return the arrays of several experiments, or the array of one, as a list."""
    if isinstance(signal, list | tuple) and np.ndim(signal[0] if signal else 0):
        return list(signal)
    return [signal]


def _to_streams(name: str, signal: Samples) -> list[np.ndarray]:
    """Return one-dimensional streams, one per realisation."""
    many = list_runs(signal)
    if many[0] is signal and np.ndim(signal) != 1:
        shape = np.shape(signal)
        raise ValueError(
            f"{name} must be one stream of samples, or a list of them, got shape {shape}"
        )
    return [
        require_real_array(f"{name}[{m}]" if len(many) > 1 else name, one, ndim=1)
        for m, one in enumerate(many)
    ]


def output_label(name: str, m: int, tracks: Sequence[object]) -> str:
    """Return the label of a signal in messages, with its realisation m if there are several."""
    if len(tracks) == 1:
        return name
    return f"{name}, realisation {m}"


def output_names(signals: Iterable[str]) -> list[str]:
    return [name for name in signals if name not in ("u", "r")]


def check_streams(
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


def warn_of_other_rates(streams: Streams, fs: float) -> None:
    """Warn of an output that was sampled more slowly than the input, and held."""
    for name in output_names(streams):
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


def warn_of_swapped(cut: dict[str, np.ndarray], labels: Mapping[str, SignalLabels]) -> None:
    """Warn of an output that is the multisine, or repeats to the last digit, while the input is not
    or does not.
    """
    if "r" in cut or not labels:
        return
    message = [
        f"{name} repeats exactly and u does not: are they swapped? u is what was played"
        for name in output_names(cut)
        if cut["u"].shape[1] > 1
        and has_equal_periods(cut[name])
        and not has_equal_periods(cut["u"])
    ]
    message.append(_describe_swap(cut, lambda signal: find_signal_lines(signal[:1, -2:]), labels))
    if any(message):
        data_warning("; ".join(filter(None, message)))


@contextmanager
def add_swap_hint(streams: Streams, labels: Mapping[str, SignalLabels]) -> Iterator[None]:
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
    for name, label in zip(output_names(signals), labels.values(), strict=True):
        u_name, y_name = (
            f" ({label[key]})" if label.get(key) else "" for key in ("u_name", "y_name")
        )
        if found := "" if u and u.is_clean else describe_played(lines_of(signals[name]), u):
            return (
                f"the multisine is found in y{y_name}, {found}, and not in u{u_name}: are input and"
                " output swapped? u is what was played; in a closed loop name its reference, r"
            )
    return ""
