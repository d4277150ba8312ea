"""The design that was played, laid under what was measured: its lines, its period and its phases as reference."""

from __future__ import annotations

import numpy as np

from nlfrf.excitation.multisine import Multisine
from nlfrf.shared.arguments import positive
from nlfrf.shared.transforms import rfft_at
from nlfrf.shared.wording import shown

__all__ = ["played_period", "played_reference"]


ALIKE = 0.3  # correlation with the design that what was played has at least, whatever the actuator did to it


def played_period(design: Multisine, fs: float) -> int:
    """Samples in one period of the design at the sampling frequency of a record [Hz].

    Raises
    ------
    ValueError
        Not a design, or a period that is not a whole number of those samples.
    """
    if not isinstance(design, Multisine):
        raise ValueError(f"design must be a Multisine, got {shown(design)}")
    n = design.n_samples / design.fs * positive("fs", fs)
    if abs(n - round(n)) > 1e-6 * n:
        raise ValueError(
            f"fs must make one period of the design, {design.n_samples / design.fs:g} s, a whole number of samples, "
            f"got fs = {fs:g} Hz with {n:.4f}; give n_samples, with resample=True"
        )
    return round(n)


def played_reference(design: Multisine, u: np.ndarray) -> np.ndarray:
    """(M, P, N) what was played, where it stands in the input: without noise, without what the actuator adds.

    For each realisation of the record the row of the design that it looks like, moved in time until it lies under the
    measured input. What a linear actuator does to it changes nothing: only its phases are used.

    Parameters
    ----------
    design : Multisine
        What was played.
    u : (M, P, N) ndarray
        Input as measured, cut into periods.

    Raises
    ------
    ValueError
        An input that looks like no row of the design.
    """
    n_samples = u.shape[2]
    k = design.lines.excited
    if 2 * k[-1] >= n_samples:
        raise ValueError(f"design must have lines below the Nyquist line {n_samples / 2:g}, got line {k[-1]}")
    U = rfft_at(u.mean(axis=1), k)
    D = design.amplitude * np.exp(1j * design.phase)
    rows = []
    for m, one in enumerate(U):
        likeness, delay = zip(*(alignment(one, row, k, n_samples) for row in D), strict=True)
        best = int(np.argmax(likeness))
        if not likeness[best] > ALIKE:
            raise ValueError(
                f"design must be what was played, got a correlation of {likeness[best]:.2g} with the input of "
                f"realisation {m} at best"
            )
        spectrum = np.zeros(n_samples // 2 + 1, dtype=complex)
        spectrum[k] = D[best] * np.exp(-2j * np.pi * k * delay[best] / n_samples) * (n_samples / 2)
        rows.append(np.fft.irfft(spectrum, n_samples))
    played = np.array(rows)
    played.flags.writeable = False
    return np.broadcast_to(played[:, None, :], u.shape)  # one period that stands for all of them


def alignment(U: np.ndarray, D: np.ndarray, k: np.ndarray, n_samples: int) -> tuple[float, float]:
    """The largest correlation of an input with a design over all shifts, and that shift [samples]."""
    cross = np.zeros(n_samples // 2 + 1, dtype=complex)
    cross[k] = U * D.conj()
    correlation = np.fft.irfft(cross, n_samples) * (n_samples / 2)
    delay = float(np.argmax(correlation))
    energy = np.sqrt(np.sum(np.abs(U) ** 2) * np.sum(np.abs(D) ** 2))
    likeness = float(correlation[int(delay)] / max(energy, np.finfo(float).tiny))
    slope = 2 * np.pi * k / n_samples
    for _ in range(3):  # between the samples, by the slope of the phase
        turned = cross[k] * np.exp(1j * slope * delay)
        delay -= float(np.sum(slope * turned.imag) / np.sum(slope**2 * np.abs(turned)))
    return likeness, delay
