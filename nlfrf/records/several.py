"""``MultiRecord``: periodic data of several inputs or outputs, with a channel axis in front."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from nlfrf._base.arguments import HOLDS, channel_names, of_kind, one_of, positive, real_array
from nlfrf._base.numbers import squared
from nlfrf._base.values import value
from nlfrf.records.excited_lines import detect_lines
from nlfrf.records.reference import Design, fill_reference, played_period
from nlfrf.records.samples import records_from_streams
from nlfrf.signals.lines import LineGrid
from nlfrf.signals.multisine import Multisine
from nlfrf.signals.orthogonal import OrthogonalMultisine

__all__ = ["MultiRecord", "multirecord_from_samples"]


SHARED = 0.5  # of the power of inputs that stands on lines of the first one, from which it has the lines of all


@value
class MultiRecord:
    """Whole periods of several inputs and outputs, one axis more than in a `Record`: the channels, in front.

    A type of its own, so that what is made for one input and one output refuses it instead of guessing.

    Parameters
    ----------
    u : (n_u, M, P, N) ndarray
        Inputs: channels x experiments x periods x samples of one period.
    y : (n_y, M, P, N) ndarray
        Outputs.
    fs : float
        Sampling frequency [Hz].
    lines : LineGrid
        Excited and detection lines, the same for all inputs.
    r : (n_u, M, P, N) ndarray, optional
        References, known without noise: for closed loop or noisy inputs.
    inputs, outputs : tuple of str
        Names of the channels; u1, u2, ... and y1, y2, ... where none are given.
    hold : str
        How all inputs run between their samples, as in `Record`: "zoh", "band-limited" or "unknown".

    Raises
    ------
    ValueError
        Shapes that do not fit, numbers that are not finite, a channel without any signal, lines at or above Nyquist.

    Examples
    --------
    >>> from nlfrf.signals.multisine import multisine
    >>> ms = multisine(fs=100, n_samples=100, f_min=1, f_max=20, n_inputs=2, rng=1)
    >>> u = ms.u[:, :, None]
    >>> record = MultiRecord(u=u, y=u[::-1], fs=100, lines=ms.lines)
    >>> record.n_inputs, record.n_outputs, record.n_experiments, record.n_periods
    (2, 2, 2, 1)
    """

    u: Any
    y: Any
    fs: float
    lines: LineGrid
    r: Any = None
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    hold: str = "unknown"

    def __post_init__(self) -> None:
        one_of("hold", self.hold, HOLDS)
        of_kind("lines", self.lines, LineGrid)
        object.__setattr__(self, "fs", positive("fs", self.fs))
        shape = np.shape(self.u)
        for name in ("u", "y", "r"):
            signal = getattr(self, name)
            if signal is None and name == "r":
                continue
            signal = real_array(name, signal, ndim=4)
            if signal.shape[1:] != shape[1:] or (name == "r" and signal.shape != shape):
                rest = "the shape of u" if name == "r" else "the experiments, periods and samples of u"
                raise ValueError(f"{name} must have {rest}, {shape if name == 'r' else shape[1:]}, got {signal.shape}")
            if min(signal.shape[:3]) < 1 or signal.shape[3] < 4:
                raise ValueError(
                    f"{name} must hold at least 1 channel, 1 experiment, 1 period and 4 samples, got {signal.shape}"
                )
            self._keep(name, signal)
        for name, default, n in (("inputs", "u", shape[0]), ("outputs", "y", self.y.shape[0])):
            names = channel_names(name, getattr(self, name), n) or tuple(f"{default}{i + 1}" for i in range(n))
            object.__setattr__(self, name, names)
        self._refuse_dead()
        grid = self.lines
        highest = max(int(kind[-1]) for kind in (grid.excited, grid.odd, grid.even) if kind.size)
        if 2 * highest >= shape[3]:
            raise ValueError(f"lines must lie below the Nyquist line {shape[3] / 2:g}, got line {highest}")

    def _keep(self, name: str, signal: np.ndarray) -> None:
        """Keep a signal as a float array that nobody else can write."""
        if signal is not getattr(self, name):
            signal = signal.copy()
            signal.flags.writeable = False
            object.__setattr__(self, name, signal)

    def _refuse_dead(self) -> None:
        """Refuse a channel that never moves, by its name."""
        for signal, names in ((self.u, self.inputs), (self.y, self.outputs), (self.r, self.inputs)):
            if signal is None:
                continue
            for channel, name in zip(signal, names, strict=True):
                if np.ptp(channel) == 0:
                    kind = "y" if signal is self.y else "u" if signal is self.u else "r"
                    raise ValueError(
                        f"{kind} must vary in every channel, got the constant {channel.flat[0]:g} in {name}. "
                        "Is it the right channel?"
                    )

    @property
    def n_inputs(self) -> int:
        """Inputs n_u."""
        return self.u.shape[0]

    @property
    def n_outputs(self) -> int:
        """Outputs n_y."""
        return self.y.shape[0]

    @property
    def n_experiments(self) -> int:
        """Experiments M."""
        return self.u.shape[1]

    @property
    def n_periods(self) -> int:
        """Periods P of each experiment."""
        return self.u.shape[2]

    @property
    def n_samples(self) -> int:
        """Samples N in one period."""
        return self.u.shape[3]

    @property
    def f0(self) -> float:
        """Frequency resolution fs / N [Hz]."""
        return self.fs / self.n_samples


def multirecord_from_samples(
    u: np.ndarray | Sequence[np.ndarray],
    y: np.ndarray | Sequence[np.ndarray],
    *,
    fs: float,
    n_samples: int | None = None,
    lines: LineGrid | None = None,
    r: np.ndarray | Sequence[np.ndarray] | None = None,
    n_discard: int = 0,
    resample: bool = False,
    inputs: Sequence[str] = (),
    outputs: Sequence[str] = (),
    design: Design | None = None,
    hold: str | None = None,
) -> MultiRecord:
    """Cut streams of several channels into whole periods; the faults of every channel are looked for.

    Parameters
    ----------
    u, y : (n_channels, n) ndarray, or a list of M of them
        Inputs and outputs, sampled together; a list holds one array per experiment.
    fs : float
        Sampling frequency [Hz].
    n_samples : int, optional
        Samples in one period; found from the first input when not given.
    lines : LineGrid, optional
        Excited and detection lines; found from all inputs (from `r` where given) when not given.
    r : (n_u, n) ndarray, or a list of M of them, optional
        References.
    n_discard : int
        Periods to leave out at the start, where the transient is.
    resample : bool
        Cut the periods of all channels where the inputs together show that they stand, and bring each onto their clock;
        see `record_from_samples`.
    inputs, outputs : sequence of str
        Names of the channels.
    design : OrthogonalMultisine, optional
        What was played: its period and lines are taken and not looked for, and where no `r` is given its phases are
        the references, but for a zippered one, which is for open loop. The inputs must show it, behind any trigger; the
        experiments of a set lie side by side.
    hold : str, optional
        How all inputs run between their samples, see `MultiRecord`; from the design, or unknown, when not given.

    Returns
    -------
    MultiRecord

    Raises
    ------
    ValueError
        Channels or experiments of different lengths, a design that was not played, and whatever `record_from_samples`
        refuses in a channel.

    Examples
    --------
    >>> from nlfrf.signals.multisine import multisine
    >>> ms = multisine(fs=100, n_samples=100, f_min=1, f_max=20, n_inputs=2, rng=1)
    >>> u = [np.tile(ms.u[:, m], 3) for m in range(2)]
    >>> record = multirecord_from_samples(u, [2 * one for one in u], fs=100, n_samples=100, n_discard=1)
    >>> record.u.shape, record.lines.excited.tolist()
    ((2, 2, 2, 100), [1, 3, 9, 11, 17, 19])
    """
    if design is not None:
        of_kind("design", design, OrthogonalMultisine, Multisine)
        n_samples = played_period(design, fs) if n_samples is None else n_samples
        lines = design.lines if lines is None else lines
        hold = design.hold if hold is None else hold
    streams = {"u": experiments("u", u), "y": experiments("y", y)}
    if r is not None:
        streams["r"] = experiments("r", r)
    for name, signal in streams.items():
        lengths, wanted = ([one.shape[1] for one in some] for some in (signal, streams["u"]))
        if lengths != wanted:
            raise ValueError(f"{name} must have the experiments and samples of u, {wanted}, got {lengths}")
    known = "r" if r is not None else "u"
    names = {"u": tuple(inputs), "y": tuple(outputs), "r": tuple(inputs)}
    cut: dict[str, Any] = {"fs": fs, "n_samples": n_samples, "lines": lines, "n_discard": n_discard}
    found, fs = cut_together(streams, known, names, cut | {"resample": resample})
    if lines is None:
        every = [detect_lines(channel) for channel in found[known]]
        lines = LineGrid(excited=np.unique(np.concatenate([grid.excited for grid in every])))
    fill_reference(found, design)
    found |= {"inputs": inputs, "outputs": outputs}  # which the record makes tuples of
    return MultiRecord(**found, fs=fs, lines=lines, hold="unknown" if hold is None else hold)


def cut_together(
    streams: dict[str, list[np.ndarray]], known: str, names: dict[str, tuple[str, ...]], asked: dict[str, Any]
) -> tuple[dict[str, Any], float]:
    """Every signal (channels, M, P, N) cut where the known ones show that the periods stand, and what fs is by them.

    All channels at once: a period that one of them lost is lost to all.
    """
    channels = {
        called(name, i, names[name]): [one[i] for one in signal]
        for name, signal in streams.items()
        for i in range(len(signal[0]))
    }
    beside = [with_all_lines(one) for one in streams[known]]
    cut = records_from_streams(beside, channels, r=None, design=None, hold=None, named=True, **asked)
    rows = iter(cut)
    found = {name: np.stack([next(rows).y for _ in range(len(signal[0]))]) for name, signal in streams.items()}
    return found, cut[0].fs


def called(name: str, i: int, names: tuple[str, ...]) -> str:
    """A channel in messages: "y2", or "y2 (position)" where it has a name."""
    return f"{name}{i + 1} ({names[i]})" if i < len(names) else f"{name}{i + 1}"


def with_all_lines(channels: np.ndarray) -> np.ndarray:
    """(n,) one signal with the lines of all channels: the first, or where each has lines of its own their sum."""
    power = squared(np.fft.rfft(channels - channels.mean(axis=1, keepdims=True), axis=1))
    size = np.add.reduce(power, axis=1)
    share = power[size > 0] / size[size > 0, None]
    if len(share) < len(channels) or np.minimum(share, share[0]).sum(axis=1).min() > SHARED:
        return np.asarray(channels[0])
    return np.asarray((1 / np.sqrt(size)) @ channels)


def experiments(name: str, signal: Any) -> list[np.ndarray]:
    """The streams (n_channels, n) of each experiment."""
    many = list(signal) if isinstance(signal, (list, tuple)) else [signal]
    arrays = [real_array(f"{name}[{m}]" if len(many) > 1 else name, one, ndim=2) for m, one in enumerate(many)]
    if not arrays or len({one.shape[0] for one in arrays}) != 1:
        raise ValueError(f"{name} must have the same channels in every experiment, got {[one.shape for one in arrays]}")
    return arrays
