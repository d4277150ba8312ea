"""``Record``: periodic input-output data, checked when made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from nlfrf._base.arguments import HOLDS, of_kind, one_of, positive, real_array, shown
from nlfrf._base.numbers import is_constant
from nlfrf._base.values import Sketch, value
from nlfrf.signals.lines import LineGrid

__all__ = ["SAME_CLOCK", "Record", "join_records", "joined", "refuse_constant"]


SAME_CLOCK = 1e-6  # how far sampling frequencies may be apart that were found in one clock


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
    hold : str
        How u runs between its samples: "zoh" where u is the command of a converter that holds it (the FRF then has
        the hold in it), "band-limited" where u was measured behind the hold, through an anti-aliasing filter as y was;
        "unknown" where nobody said.
    u_name, y_name, u_unit, y_unit : str
        Names of the channels and their units; empty where they are not known.

    Raises
    ------
    ValueError
        Shapes that differ or are not (M, P, N), numbers that are not finite, an input that is constant, lines
        at or above Nyquist.

    Examples
    --------
    >>> from nlfrf.signals.multisine import multisine
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
    hold: str = "unknown"
    u_name: str = ""
    y_name: str = ""
    u_unit: str = ""
    y_unit: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "fs", positive("fs", self.fs))
        one_of("hold", self.hold, HOLDS)
        of_kind("lines", self.lines, LineGrid)
        shape: tuple[int, ...] = ()
        for name in ("u", "y", "r"):
            signal = getattr(self, name)
            if signal is None and name == "r":
                continue
            signal = real_array(name, signal, ndim=3)
            shape = shape or signal.shape
            if signal.shape != shape:
                raise ValueError(f"{name} must have the shape of u, {shape}, got {signal.shape}")
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
        if 2 * highest >= shape[2]:
            raise ValueError(f"lines must lie below the Nyquist line {shape[2] / 2:g}, got line {highest}")

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

    def _sketch_(self) -> Sketch:
        """Input and output of the first realisation over their peaks, for a notebook."""
        t = np.arange(self.u[0].size) / self.fs
        curves = [
            (name, t, signal[0].ravel() / np.abs(signal[0]).max()) for name, signal in (("u", self.u), ("y", self.y))
        ]
        return Sketch("s", "of its peak", curves)


def refuse_constant(name: str, signal: np.ndarray) -> None:
    """Refuse a realisation that never moves: there is nothing to identify from it."""
    for m, one in enumerate(signal):
        if is_constant(one):
            raise ValueError(
                f"{name} must vary, got the constant {one.flat[0]:g} in realisation {m}. Is it the right channel?"
            )


def join_records(records: Sequence[Record]) -> Record:
    """Records of one experiment as one record: each brings its realisations.

    Parameters
    ----------
    records : list of Record
        Runs of one experiment that were recorded one by one: the same period, sampling frequency and lines, and phases
        of their own. Runs of the same phases are repeats, which `identify` recognises.

    Returns
    -------
    Record
        (M, P, N) with the realisations of all of them, and as many periods as all of them have.

    Raises
    ------
    ValueError
        No record, or records of other lines, another period or sampling frequency, some with a reference and some
        without.

    References
    ----------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., 4.3 (the robust method).

    Examples
    --------
    >>> from nlfrf.signals.multisine import multisine
    >>> ms = multisine(fs=100, n_samples=100, f_min=1, f_max=20, n_realizations=2, rng=1)
    >>> runs = [Record(u=u[None, None], y=2 * u[None, None], fs=100, lines=ms.lines) for u in ms.u]
    >>> join_records(runs).n_realizations
    2
    """
    if not isinstance(records, Sequence) or not records or not all(isinstance(one, Record) for one in records):
        raise ValueError(f"records must be a list of one or more Record, got {shown(records)}")
    return joined(records, axis=0)


def joined(records: Sequence[Any], axis: int, *same: str) -> Any:
    """Records of one kind as one, along the axis of their realisations; what else must be the same, by name."""
    first, *others = records
    for m, one in enumerate(others, start=1):
        for name, here, there in (
            *((name, getattr(one, name), getattr(first, name)) for name in ("n_samples", "fs", "hold", *same)),
            ("lines", one.lines.excited.tolist(), first.lines.excited.tolist()),
        ):
            if here != there and not (name == "fs" and abs(one.fs / first.fs - 1) < SAME_CLOCK):
                raise ValueError(
                    f"records must be of one experiment, with the same {name}, got {shown(here)} in record {m} and "
                    f"{shown(there)} in record 0"
                )
    with_r = [one.r is not None for one in records]
    if any(with_r) and not all(with_r):
        raise ValueError("records must all have a reference or none of them, got some with and some without")
    n_periods = min(one.n_periods for one in records)
    signals: dict[str, Any] = {
        name: np.concatenate([getattr(one, name)[..., :n_periods, :] for one in records], axis=axis)
        for name in ("u", "y", *(["r"] if all(with_r) else []))
    }
    return replace(first, **signals)
