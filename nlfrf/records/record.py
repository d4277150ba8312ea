"""``Record``: periodic input-output data, checked when made."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

from nlfrf.excitation.lines import LineGrid
from nlfrf.records.detection import detect_lines, detect_period
from nlfrf.records.faults import SEVERE, Track, clipped, longest_standstill, recut, track
from nlfrf.shared.arguments import DataWarning, integer, positive, real_array
from nlfrf.shared.values import value

__all__ = ["Record", "record_from_samples"]


REPEATS = 0.25  # share of its power that may not repeat before a signal no longer counts as periodic
CLIPPED = 2e-3  # share of samples at the extremes, in runs, past which a signal counts as clipped


@value
class Record:
    """Whole periods of input and output in steady state or after a short transient.

    Parameters
    ----------
    u, y : (M, P, N) ndarray
        Input and output: realisations x periods x samples of one period, in their own units.
    fs : float
        Sampling frequency [Hz].
    lines : LineGrid
        Excited and detection lines.
    r : (M, P, N) ndarray, optional
        Reference signal, known without noise: for closed loop or a noisy input.

    Raises
    ------
    ValueError
        Shapes that differ or are not (M, P, N), numbers that are not finite, an input that is constant, lines
        at or above Nyquist.

    Examples
    --------
    >>> from nlfrf.excitation.multisine import multisine
    >>> ms = multisine(fs=100, n_samples=100, f_min=1, f_max=20, rng=1)
    >>> record = Record(u=ms.u[None], y=2 * ms.u[None], fs=100, lines=ms.lines)
    >>> record.n_realizations, record.n_periods, record.n_samples, record.f0
    (1, 1, 100, 1.0)
    """

    u: Any
    y: Any
    fs: float
    lines: LineGrid
    r: Any = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "fs", positive("fs", self.fs))
        u = real_array("u", self.u, ndim=3)
        for name in ("u", "y", "r"):
            signal = getattr(self, name)
            if signal is None and name == "r":
                continue
            signal = real_array(name, signal, ndim=3)
            if signal.shape != u.shape:
                raise ValueError(f"{name} must have the shape of u, {u.shape}, got {signal.shape}")
            if signal.shape[0] < 1 or signal.shape[1] < 1 or signal.shape[2] < 4:
                raise ValueError(
                    f"{name} must hold at least 1 realisation, 1 period and 4 samples, got shape {signal.shape}"
                )
            refuse_constant(name, signal)
            if signal is not getattr(self, name):
                signal = signal.copy()
                signal.flags.writeable = False
                object.__setattr__(self, name, signal)
        grid = self.lines
        highest = max(int(kind[-1]) for kind in (grid.excited, grid.odd, grid.even) if kind.size)
        if 2 * highest >= u.shape[2]:
            raise ValueError(f"lines must lie below the Nyquist line {u.shape[2] / 2:g}, got line {highest}")

    @property
    def n_realizations(self) -> int:
        """Realisations M."""
        return self.u.shape[0]

    @property
    def n_periods(self) -> int:
        """Periods P of each realisation."""
        return self.u.shape[1]

    @property
    def n_samples(self) -> int:
        """Samples N in one period."""
        return self.u.shape[2]

    @property
    def f0(self) -> float:
        """Frequency resolution fs / N [Hz]."""
        return self.fs / self.n_samples


def refuse_constant(name: str, signal: np.ndarray) -> None:
    """Refuse a realisation that never moves: there is nothing to identify from it."""
    spread = np.ptp(signal.reshape(signal.shape[0], -1), axis=1)
    if np.any(spread == 0):
        m = int(np.argmin(spread))
        raise ValueError(
            f"{name} must vary, got the constant {signal[m].flat[0]:g} in realisation {m}. Is it the right channel?"
        )


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
) -> Record:
    """Cut streams of samples into whole periods.

    Parameters
    ----------
    u, y : (n,) ndarray, or a list of M of them
        Input and output, sampled together; a list holds one stream per realisation.
    fs : float
        Sampling frequency [Hz].
    n_samples : int, optional
        Samples in one period; found from the input when not given.
    lines : LineGrid, optional
        Excited and detection lines; found from the input (from `r` where given) when not given.
    r : (n,) ndarray, or a list of M of them, optional
        Reference.
    n_discard : int
        Periods to leave out at the start, where the transient is.
    resample : bool
        Cut the periods where the input shows that they stand, between the samples where need be: the cure for a
        period that is not a whole number of samples, a drifting clock, and lost or repeated samples. The record's fs
        is then n_samples in each of those periods.

    Returns
    -------
    Record
        As many whole periods as every stream holds after the discarded ones.

    Raises
    ------
    ValueError
        Streams of different lengths, fewer samples than one period, a period that the input does not have or
        that is not whole, a drifting clock, lost samples; the message has the numbers and the cure.

    Warns
    -----
    DataWarning
        Periods that are slightly out of place, a clipped signal, a signal that stands still.

    Examples
    --------
    >>> from nlfrf.excitation.multisine import multisine
    >>> u = np.tile(multisine(fs=100, n_samples=100, f_min=1, f_max=20, rng=1).u[0], 3)
    >>> record = record_from_samples(u, 2 * u, fs=100, n_samples=100, n_discard=1)
    >>> record.u.shape, record.lines.excited.tolist()
    ((1, 2, 100), [1, 3, 9, 11, 17, 19])
    """
    fs = positive("fs", fs)
    n_discard = integer("n_discard", n_discard, least=0)
    streams = {"u": as_streams("u", u), "y": as_streams("y", y)}
    if r is not None:
        streams["r"] = as_streams("r", r)
    for name, signal in streams.items():
        if len(signal) != len(streams["u"]):
            raise ValueError(f"{name} must hold as many realisations as u, {len(streams['u'])}, got {len(signal)}")
        for m, (one, u_one) in enumerate(zip(signal, streams["u"], strict=True)):
            if one.size != u_one.size:
                which = "" if len(signal) == 1 else f" in realisation {m}"
                raise ValueError(f"{name} must be as long as u, {u_one.size} samples{which}, got {one.size}")
    excitation = streams.get("r", streams["u"])
    for one in excitation:
        refuse_constant("r" if r is not None else "u", one[np.newaxis])
    if n_samples is None:
        n_samples = whole_period(excitation[0], resample)
    n_samples = integer("n_samples", n_samples, least=4)
    shortest = min(one.size for one in excitation)
    n_periods = shortest // n_samples - n_discard
    if n_periods < 1:
        raise ValueError(
            f"u and y must hold at least one period of n_samples = {n_samples} samples after n_discard = {n_discard}, "
            f"got {shortest} samples, which is {shortest / n_samples:.2f} periods"
        )
    for name, signal in streams.items():
        for one in signal:
            warn_about_channel(name, one, n_samples)
    begin = n_discard * n_samples
    tracks = [track(one[begin:], n_samples) for one in excitation if one.size - begin >= 2 * n_samples]
    tracks = [found for found in tracks if found.unexplained < REPEATS]
    if resample and len(tracks) == len(excitation):
        cut = {
            name: stacked([recut(one[begin:], where) for one, where in zip(signal, tracks, strict=True)])
            for name, signal in streams.items()
        }
        fs /= float(np.mean([where.spacing for where in tracks]))  # so that f0 is what the input repeats at
    else:
        for where in tracks:
            refuse_fault(where)
        kept = slice(begin, begin + n_periods * n_samples)
        cut = {
            name: np.stack([one[kept].reshape(n_periods, n_samples) for one in signal])
            for name, signal in streams.items()
        }
    periodic = cut.get("r", cut["u"])
    refuse_wrong_period(periodic, excitation[0])
    return Record(**cut, fs=fs, lines=detect_lines(periodic) if lines is None else lines)


def stacked(cut: list[np.ndarray]) -> np.ndarray:
    """(M, P, N) as many periods of each realisation as all of them have."""
    n_periods = min(len(periods) for periods in cut)
    return np.stack([periods[:n_periods] for periods in cut])


def refuse_fault(where: Track) -> None:
    """Refuse periods out of place where that would read as distortion, and warn where it just might."""
    fault = where.fault
    if fault and (where.misplaced > SEVERE or not where.sound.all()):
        raise ValueError(f"n_samples must be the period of the input, got {where.n_samples}: {fault}")
    if fault:
        warnings.warn(
            f"{fault}; as it is, {100 * where.misplaced:.2g} % of the input's power is out of place",
            DataWarning,
            stacklevel=4,
        )


def warn_about_channel(name: str, signal: np.ndarray, n_samples: int) -> None:
    """Warn of a signal that is clipped or that stands still: both would read as distortion."""
    share = clipped(signal)
    if share > CLIPPED:
        warnings.warn(
            f"{name} seems clipped: {100 * share:.2g} % of its samples stand at its largest or smallest value in runs; "
            "lower the level or widen the range",
            DataWarning,
            stacklevel=4,
        )
    begin, length = longest_standstill(signal)
    if length > n_samples // 4:
        warnings.warn(
            f"{name} stands still for {length} samples from sample {begin}, {length / n_samples:.2g} periods; "
            "was the channel alive?",
            DataWarning,
            stacklevel=4,
        )


def as_streams(name: str, signal: Any) -> list[np.ndarray]:
    """One-dimensional streams, one per realisation."""
    if isinstance(signal, (list, tuple)) and signal and np.ndim(signal[0]) > 0:
        return [real_array(f"{name}[{m}]", one, ndim=1) for m, one in enumerate(signal)]
    array = np.asarray(signal)
    if array.ndim != 1:
        raise ValueError(f"{name} must be one stream of samples, or a list of them, got shape {array.shape}")
    return [real_array(name, array, ndim=1)]


def whole_period(u: np.ndarray, resample: bool) -> int:
    """The period of the input, rounded to samples: whether it is whole is found by following the periods."""
    period = detect_period(u)
    if abs(period - round(period)) > 0.1 and not resample:
        raise ValueError(
            f"n_samples must be given: the period of u seems to be {period:.2f} samples, not a whole number; "
            "resample=True cuts it on that period"
        )
    return round(period)


def refuse_wrong_period(u: np.ndarray, stream: np.ndarray) -> None:
    """Refuse periods that do not repeat each other: the period, or the signal, is not what was said."""
    if u.shape[1] < 2:
        return
    centred = u - u.mean(axis=(1, 2), keepdims=True)
    unexplained = np.sum((centred - centred.mean(axis=1, keepdims=True)) ** 2) / np.sum(centred**2)
    if unexplained > REPEATS:
        try:
            found = f"its autocorrelation points to {detect_period(stream):.1f}"
        except ValueError:
            found = "it does not seem to repeat at all"
        raise ValueError(
            f"n_samples must be the period of the input, got {u.shape[2]}: "
            f"{100 * unexplained:.0f} % of its power does not repeat from period to period; {found}"
        )
