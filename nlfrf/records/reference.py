"""Align the design that was played with the measured input: its lines, its period, and its phases
as reference.
"""

from __future__ import annotations

import numpy as np

from nlfrf._base.arguments import require_positive
from nlfrf._base.numbers import TINY, rfft_at
from nlfrf.signals.multisine import Multisine

# smallest correlation of a measured input with its design, behind any actuator
_MIN_CORRELATION = 0.3


def design_period(design: Multisine, fs: float) -> int:
    """Return the number of samples in one period of the design at the sampling frequency of a
    record [Hz].

    Raises
    ------
    ValueError
        The period is not a whole number of these samples.
    """
    n = design.n_samples / design.fs * require_positive("fs", fs)
    if abs(n - round(n)) > 1e-6 * n:
        raise ValueError(
            f"fs must make one period of the design, {design.n_samples / design.fs:g} s, a whole"
            f" number of samples, got fs = {fs:g} Hz with {n:.4f}; give n_samples, with"
            " resample=True"
        )
    return round(n)


def fill_reference(found: dict[str, np.ndarray], design: Multisine | None) -> None:
    """Add the design to the signals of a record as reference, if they have none.

    A zippered record is identified in open loop and takes no reference; its input is checked
    against the design anyway.
    """
    if design is not None and "r" not in found:
        played = reconstruct_references(design, found["u"])
        if design.design != "zippered":
            found["r"] = played


def reconstruct_references(design: Multisine, u: np.ndarray) -> np.ndarray:
    """Return (n_u, M, P, N) the design aligned with the inputs, without noise and without
    distortion by actuators.

    For each realisation of the record the row of the design that resembles it most is shifted in
    time onto the measured input. For several inputs the first one gives the shift, because a common
    shift changes nothing. Only the phases of the reference are used, so a linear actuator changes
    nothing either.

    Parameters
    ----------
    design : Multisine
        Design that was played.
    u : (n_u, M, P, N) ndarray
        Inputs as measured, cut into periods.

    Raises
    ------
    ValueError
        The design has another number of inputs, or an input resembles no row of it.
    """
    n_samples = u.shape[3]
    k = design.lines.excited
    if 2 * k[-1] >= n_samples:
        raise ValueError(
            f"design must have lines below the Nyquist line {n_samples / 2:g}, got line {k[-1]}"
        )
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
        likeness = found[:, :, 0].min(axis=1)  # of the input that resembles its row least
        best = int(np.argmax(likeness))
        if not likeness[best] > _MIN_CORRELATION:
            raise ValueError(
                f"design must be the one that was played, got a correlation of {likeness[best]:.2g}"
                f" with the input of {f'realisation {m}' if len(u) == 1 else f'experiment {m + 1}'}"
                " at best"
            )
        delay = found[best, 0, 1]
        spectrum[:, m, k] = (
            D[:, best] * np.exp(-2j * np.pi * k * delay / n_samples) * (n_samples / 2)
        )
    played = np.fft.irfft(spectrum, n_samples)
    played.flags.writeable = False
    return np.broadcast_to(played[:, :, None, :], u.shape)  # one period that stands for all of them


def _align_spectra(
    U: np.ndarray, D: np.ndarray, *, k: np.ndarray, n_samples: int
) -> tuple[float, float]:
    """Return the largest correlation of an input with a design over all shifts, and that shift
    [samples].
    """
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
