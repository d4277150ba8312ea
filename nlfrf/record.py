"""``Record``: periodic input-output data, checked when made."""

from __future__ import annotations

from typing import Any

import numpy as np

from nlfrf.checks import positive, real_array
from nlfrf.lines import LineGrid
from nlfrf.values import value


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
            if name != "y":
                refuse_constant(name, signal)
            if signal is not getattr(self, name):
                signal = signal.copy()
                signal.flags.writeable = False
                object.__setattr__(self, name, signal)
        if 2 * self.lines.excited[-1] >= u.shape[2]:
            raise ValueError(
                f"lines must lie below the Nyquist line {u.shape[2] / 2:g}, got line {self.lines.excited[-1]}"
            )

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
