"""The design that was played, laid under what was measured: its lines, its period and its phases as reference."""

from __future__ import annotations

import numpy as np

from nlfrf._base.arguments import require_positive
from nlfrf._base.numbers import TINY, rfft_at
from nlfrf.signals.multisine import Multisine

_MIN_CORRELATION = 0.3  # correlation with the design that what was played has at least, whatever the actuator did to it


def design_period(design: Multisine, fs: float) -> int:
    """Samples in one period of the design at the sampling frequency of a record [Hz].

    Raises
    ------
    ValueError
        A period that is not a whole number of those samples.
    """
    n = design.n_samples / design.fs * require_positive("fs", fs)
    if abs(n - round(n)) > 1e-6 * n:
        raise ValueError(
            f"fs must make one period of the design, {design.n_samples / design.fs:g} s, a whole number of samples, "
            f"got fs = {fs:g} Hz with {n:.4f}; give n_samples, with resample=True"
        )
    return round(n)


def fill_reference(found: dict[str, np.ndarray], design: Multisine | None) -> None:
    """Put what was played into the signals of a record as their references, where there are none and they may be.

    A zippered record is identified in open loop and takes none; that it shows the design is looked at all the same.
    """
    if design is not None and "r" not in found:
        played = reconstruct_references(design, found["u"])
        if design.design != "zippered":
            found["r"] = played


def reconstruct_references(design: Multisine, u: np.ndarray) -> np.ndarray:
    """Return (n_u, M, P, N) the design as played, aligned with the inputs.

    Without noise and without what actuators add.

    For each realisation of the record the row of the design that it looks like, moved in time until it lies under the
    measured input; of several inputs under the first, as a shift that all share changes nothing. What a linear actuator
    does to it changes nothing either: only its phases are used.

    Parameters
    ----------
    design : Multisine
        What was played.
    u : (n_u, M, P, N) ndarray
        Inputs as measured, cut into periods.

    Raises
    ------
    ValueError
        A design of other inputs, an input that looks like no row of the design.
    """
    n_samples = u.shape[3]
    k = design.lines.excited
    if 2 * k[-1] >= n_samples:
        raise ValueError(f"design must have lines below the Nyquist line {n_samples / 2:g}, got line {k[-1]}")
    D = design.spectrum.reshape(design.n_inputs, -1, k.size)
    if len(D) != len(u):
        raise ValueError(f"design must have the inputs of the record, {len(u)}, got {len(D)}")
    U = rfft_at(u.mean(axis=2), k)
    spectrum = np.zeros((*U.shape[:2], n_samples // 2 + 1), dtype=complex)
    for m in range(U.shape[1]):
        found = np.array(
            [
                [
                    _align_spectra(mine, drawn, k=k, n_samples=n_samples)
                    for mine, drawn in zip(U[:, m], D[:, e], strict=True)
                ]
                for e in range(D.shape[1])
            ]
        )
        likeness = found[:, :, 0].min(axis=1)  # of the input that looks least like its row
        best = int(np.argmax(likeness))
        if not likeness[best] > _MIN_CORRELATION:
            raise ValueError(
                f"design must be what was played, got a correlation of {likeness[best]:.2g} with the input of "
                f"{f'realisation {m}' if len(u) == 1 else f'experiment {m + 1}'} at best"
            )
        delay = found[best, 0, 1]
        spectrum[:, m, k] = D[:, best] * np.exp(-2j * np.pi * k * delay / n_samples) * (n_samples / 2)
    played = np.fft.irfft(spectrum, n_samples)
    played.flags.writeable = False
    return np.broadcast_to(played[:, :, None, :], u.shape)  # one period that stands for all of them


def _align_spectra(U: np.ndarray, D: np.ndarray, *, k: np.ndarray, n_samples: int) -> tuple[float, float]:
    """Return the largest correlation of an input with a design over all shifts, and that shift [samples]."""
    cross = np.zeros(n_samples // 2 + 1, dtype=complex)
    cross[k] = U * D.conj()
    correlation = np.fft.irfft(cross, n_samples) * (n_samples / 2)
    delay = float(np.argmax(correlation))
    energy = np.sqrt(np.sum(np.abs(U) ** 2) * np.sum(np.abs(D) ** 2))
    likeness = float(correlation[int(delay)] / max(energy, TINY))
    slope = 2 * np.pi * k / n_samples
    for _ in range(3):  # between the samples, by the slope of the phase
        turned = cross[k] * np.exp(1j * slope * delay)
        delay -= float(np.sum(slope * turned.imag) / np.sum(slope**2 * np.abs(turned)))
    return likeness, delay
