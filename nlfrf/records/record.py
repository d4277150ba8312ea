"""``Record``: periodic input-output data, checked when made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, TypedDict

import numpy as np

from nlfrf._base.arguments import (
    HOLDS,
    as_names,
    channel_names,
    format_count,
    keep_warnings,
    one_line,
    require_choice,
    require_kind,
    require_list,
    require_positive,
    require_real_array,
    short_form,
)
from nlfrf._base.numbers import is_constant
from nlfrf._base.values import ArrayField, value
from nlfrf.signals.lines import LineGrid, describe_band

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

# largest relative difference of two sampling frequencies estimated from one clock
SAME_CLOCK = 1e-6


class SignalLabels(TypedDict, total=False):
    """Names and units of one input and one output."""

    u_name: str
    y_name: str
    u_unit: str
    y_unit: str


class Channels:
    """Names and units of inputs and outputs."""

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    input_units: tuple[str, ...]
    output_units: tuple[str, ...]

    def _name_channels(
        self,
        n: tuple[int, int],
        names: Sequence[str | Sequence[str]],
        units: Sequence[str | Sequence[str]],
    ) -> None:
        """Set the four fields for (n_u, n_y) channels; names that are not given become u, y, or u1,
        u2, ...
        """
        for k, (side, letter) in enumerate((("input", "u"), ("output", "y"))):
            given = channel_names(f"{side}s", names[k], n[k])
            self.__dict__[f"{side}s"] = given or tuple(
                f"{letter}{i + 1}" if n[k] > 1 else letter for i in range(n[k])
            )
            self.__dict__[f"{side}_units"] = _channel_units(f"{side}_units", units[k], n[k])

    @property
    def n_inputs(self) -> int:
        """Number of inputs n_u."""
        return len(self.inputs)

    @property
    def n_outputs(self) -> int:
        """Number of outputs n_y."""
        return len(self.outputs)

    @property
    def is_single(self) -> bool:
        """True for one input and one output, whose arrays have no axes of channels."""
        return self.n_inputs == self.n_outputs == 1

    @property
    def u_name(self) -> str:
        """Name of the only input; empty if unknown, or for several inputs."""
        return _given_name(self.inputs, "u")

    @property
    def y_name(self) -> str:
        """Name of the only output; empty if unknown, or for several outputs."""
        return _given_name(self.outputs, "y")

    @property
    def u_unit(self) -> str:
        """Unit of the only input; empty if unknown, or for several inputs."""
        if self.n_inputs == 1:
            return self.input_units[0]
        return ""

    @property
    def y_unit(self) -> str:
        """Unit of the only output; empty if unknown, or for several outputs."""
        if self.n_outputs == 1:
            return self.output_units[0]
        return ""


@value
class Record(Channels):
    """Whole periods of the inputs and outputs of an experiment, for any number of channels.

    Give the record to `identify`. Call `Record` if your arrays are already cut into periods.
    Otherwise use `load_record` for a file, or `record_from_samples` for samples. Both also search
    the signals for faults.

    Parameters
    ----------
    u : (M, P, N) or (n_u, M, P, N) ndarray
        Inputs, in their own units: M realisations of the random phases (for several inputs: M
        experiments), P periods, N samples in one period.
    y : (M, P, N) or (n_y, M, P, N) ndarray
        Outputs, in their own units.
    fs : float
        Sampling frequency [Hz].
    lines : LineGrid
        Excited lines and detection lines (not excited), the same for all inputs.
    r : (M, P, N) or (n_u, M, P, N) ndarray, optional
        References without noise: the signals added to a closed loop, or the commands behind noisy
        inputs.
    hold : str
        Inputs between their samples. "zoh": the inputs are commands of converters that hold each
        sample; the FRF then includes this hold. "band-limited": the inputs were measured after the
        converter, through the same anti-aliasing filters as the outputs. "unknown" otherwise.
    inputs, outputs : sequence of str
        Names of the channels. By default u and y, or u1, u2, ... and y1, y2, ...
    input_units, output_units : sequence of str
        Units of the channels; an empty text for an unknown unit.
    u_name, y_name, u_unit, y_unit : str
        Name and unit of the input and the output, if there is only one of each.
    warnings : sequence of str
        Text of each `DataWarning` issued while the record was made.

    Raises
    ------
    ValueError
        Shapes do not fit each other, a number is not finite, an input or output is constant, or a
        line is at or above the Nyquist frequency.

    Notes
    -----
    With one input and one output every array has the axes (M, P, N), even if it was given with an
    axis of channels.

    Examples
    --------
    >>> from nlfrf.signals.multisine import multisine
    >>> ms = multisine(fs=100, n_samples=100, f_min=1, f_max=20, rng=1)
    >>> record = Record(u=ms.u[None], y=2 * ms.u[None], fs=100, lines=ms.lines)
    >>> record.n_realizations, record.n_periods, record.n_samples, record.f0
    (1, 1, 100, 1.0)
    >>> print(replace(record, input_units=("N",)))
    record of 1 realisation x 1 period x 100 samples at 100 Hz (1 s a period), hold unknown
      6 lines excited from 1 to 19 Hz
      input u: rms 1 N
      output y: rms 2

    Two inputs and two outputs, in two experiments:

    >>> ms = multisine(fs=100, n_samples=100, f_min=1, f_max=20, n_inputs=2, rng=1)
    >>> u = ms.u[:, :, None]
    >>> record = Record(u=u, y=u[::-1], fs=100, lines=ms.lines, outputs=("x", "y"))
    >>> record.n_inputs, record.n_outputs, record.n_experiments, record.n_periods
    (2, 2, 2, 1)
    """

    u: np.ndarray
    y: np.ndarray
    fs: float
    lines: LineGrid
    r: ArrayField
    hold: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    input_units: tuple[str, ...]
    output_units: tuple[str, ...]
    warnings: tuple[str, ...]

    def __init__(
        self,
        *,
        u: ArrayLike,
        y: ArrayLike,
        fs: float,
        lines: LineGrid,
        r: ArrayLike | None = None,
        hold: str = "unknown",
        inputs: Sequence[str] = (),
        outputs: Sequence[str] = (),
        input_units: Sequence[str] = (),
        output_units: Sequence[str] = (),
        u_name: str = "",
        y_name: str = "",
        u_unit: str = "",
        y_unit: str = "",
        warnings: Sequence[str] = (),
    ) -> None:
        require_choice("hold", hold, HOLDS)
        require_kind("lines", lines, LineGrid)
        fs = require_positive("fs", fs)
        signals = _to_one_layout({"u": u, "y": y} | ({} if r is None else {"r": r}))
        highest = max(int(kind[-1]) for kind in (lines.excited, lines.odd, lines.even) if kind.size)
        n_samples = signals["u"].shape[-1]
        if 2 * highest >= n_samples:
            raise ValueError(
                f"lines must lie below the Nyquist line {n_samples / 2:g}, got line {highest}"
            )
        n_u, n_y = (1 if signals[name].ndim == 3 else len(signals[name]) for name in "uy")
        # fields of a value are frozen: an assignment would be refused
        self.__dict__.update(
            signals, fs=fs, lines=lines, hold=hold, r=signals.get("r"), warnings=tuple(warnings)
        )
        self._name_channels(
            (n_u, n_y),
            (u_name or inputs, y_name or outputs),
            (u_unit or input_units, y_unit or output_units),
        )
        self.__post_init__()  # of the decorator: makes the arrays read-only

    def __post_init__(self) -> None:
        for name, channels in (("u", self.inputs), ("y", self.outputs), ("r", self.inputs)):
            signal = getattr(self, name)
            if signal is not None:
                require_varying(name, signal, channels)

    @property
    def n_realizations(self) -> int:
        """Number of realisations M (draws of the random phases). For several inputs n_u experiments
        are one realisation.
        """
        return self.u.shape[-3]

    @property
    def n_experiments(self) -> int:
        """Number of experiments M."""
        return self.u.shape[-3]

    def describe_runs(self) -> str:
        """Return the number of experiments as text; for one input and one output they are realisations."""
        return format_count(self.n_experiments, "realisation" if self.is_single else "experiment")

    def describe_extent(self) -> str:
        """Return experiments, periods, samples, lines and hold on one line."""
        periods = format_count(self.n_periods, "period")
        band = describe_band(self.lines.excited * self.f0)
        return f"{self.describe_runs()} x {periods} x {self.n_samples} samples, {band}, hold {self.hold}"

    @property
    def n_periods(self) -> int:
        """Number of periods P of each realisation."""
        return self.u.shape[-2]

    @property
    def n_samples(self) -> int:
        """Number of samples N in one period."""
        return self.u.shape[-1]

    @property
    def f0(self) -> float:
        """Frequency resolution fs / N [Hz]."""
        return self.fs / self.n_samples

    def __str__(self) -> str:
        f = self.lines.excited[[0, -1]] * self.f0
        rows = [
            (
                f"record of {self.describe_runs()} x {format_count(self.n_periods, 'period')} x {self.n_samples}"
                f" samples at {self.fs:g} Hz ({self.n_samples / self.fs:g} s a period), hold"
                f" {self.hold}"
            ),
            f"{self.lines.excited.size} lines excited from {f[0]:g} to {f[1]:g} Hz",
        ]
        for what, names, units, signal in (
            ("input", self.inputs, self.input_units, self.u),
            ("output", self.outputs, self.output_units, self.y),
        ):
            for name, unit, one in zip(names, units, signal.reshape(len(names), -1), strict=True):
                rows.append(
                    f"{what} {one_line(name)}: rms {np.std(one):.4g} {one_line(unit)}".rstrip()
                )
        return "\n  ".join(rows)


def _to_one_layout(signals: Mapping[str, ArrayLike]) -> dict[str, np.ndarray]:
    """Return the signals as float arrays:

    (M, P, N) for one input and one output, else (channels, M, P, N).
    """
    several = any(np.ndim(signal) == 4 for signal in signals.values())
    arrays = {
        name: require_real_array(name, one, ndim=4 if np.ndim(one) == 4 else 3)
        for name, one in signals.items()
    }
    if several:
        arrays = {name: one if one.ndim == 4 else one[None] for name, one in arrays.items()}
        if len(arrays["u"]) == len(arrays["y"]) == 1:
            arrays, several = {name: one[0] for name, one in arrays.items()}, False
    shape = arrays["u"].shape
    for name, signal in arrays.items():
        whole = not several or name == "r"  # compare the channels, too
        if signal.shape[-3:] != shape[-3:] or (whole and signal.shape != shape):
            of_u = "the shape of u" if whole else "the experiments, periods and samples of u"
            raise ValueError(
                f"{name} must have {of_u}, {shape if whole else shape[1:]}, got {signal.shape}"
            )
        if min(signal.shape[:-1]) < 1 or signal.shape[-1] < 4:
            least = "1 channel, 1 experiment" if several else "1 realisation"
            raise ValueError(
                f"{name} must hold at least {least}, 1 period and 4 samples, got shape"
                f" {signal.shape}"
            )
    return arrays


def _given_name(names: tuple[str, ...], letter: str) -> str:
    """Return the name of a single channel; empty if it is the default one."""
    if len(names) == 1 and names[0] != letter:
        return names[0]
    return ""


def _channel_units(name: str, given: str | Sequence[str], n: int) -> tuple[str, ...]:
    """Return the unit of each channel, empty if unknown."""
    units = as_names(given)
    if units and (len(units) != n or not all(isinstance(one, str) for one in units)):
        raise ValueError(f"{name} must be {n} texts, one per channel, got {given!r}")
    return units or ("",) * n


def require_varying(name: str, signal: np.ndarray, channels: Sequence[str] = ()) -> None:
    """Refuse a constant signal, from which nothing can be identified.

    One signal (M, P, N) must vary in every realisation, several (channels, M, P, N) each in at
    least one experiment.
    """
    for m, one in enumerate(signal):
        if is_constant(one.reshape(-1, one.shape[-1])):
            where = f"{name} must vary, got the constant {one.flat[0]:g} in realisation {m}"
            if signal.ndim == 4:
                where = (
                    f"{name} must vary in every channel, got the constant {one.flat[0]:g} in"
                    f" {channels[m]}"
                )
            raise ValueError(f"{where}. Is it the right channel?")


@keep_warnings
def join_records(records: Sequence[Record]) -> Record:
    """Join records of one machine into one record with the realisations (draws of the random
    phases) of all.

    Use this if the realisations of an experiment, or the experiments for several inputs, were
    recorded one by one.

    Parameters
    ----------
    records : list of Record
        Records with equal period, sampling frequency and lines, and with different phases. Records
        with equal phases are repeats of one realisation; `identify` recognises and averages them.

    Returns
    -------
    Record
        Record with all realisations. It has as many periods as the shortest of the records.

    Raises
    ------
    ValueError
        The list is empty; the records differ in lines, channels, period or sampling frequency; or
        only some have a reference.

    References
    ----------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., 4.3 (the
    robust method).

    Examples
    --------
    >>> from nlfrf.signals.multisine import multisine
    >>> ms = multisine(fs=100, n_samples=100, f_min=1, f_max=20, n_realizations=2, rng=1)
    >>> runs = [Record(u=u[None, None], y=2 * u[None, None], fs=100, lines=ms.lines) for u in ms.u]
    >>> join_records(runs).n_realizations
    2
    """
    first, *others = require_list("records", records, Record)
    same = (
        "n_samples",
        "fs",
        "hold",
        "n_inputs",
        "n_outputs",
        *(() if first.is_single else ("inputs", "outputs")),
    )
    for m, one in enumerate(others, start=1):
        for name, here, there in (
            *((name, getattr(one, name), getattr(first, name)) for name in same),
            ("lines", one.lines.excited.tolist(), first.lines.excited.tolist()),
        ):
            if here != there and not (name == "fs" and abs(one.fs / first.fs - 1) < SAME_CLOCK):
                raise ValueError(
                    f"records must be of one experiment, with the same {name}, got"
                    f" {short_form(here)} in record {m} and {short_form(there)} in record 0"
                )
    with_r = [one.r is not None for one in records]
    if any(with_r) and not all(with_r):
        raise ValueError(
            "records must all have a reference or none of them, got some with and some without"
        )
    n_periods = min(one.n_periods for one in records)
    u, y = (
        np.concatenate([getattr(one, name)[..., :n_periods, :] for one in records], axis=-3)
        for name in "uy"
    )
    if all(with_r):
        r = np.concatenate([one.r[..., :n_periods, :] for one in records], axis=-3)
    else:
        r = first.r
    return replace(first, u=u, y=y, r=r)
