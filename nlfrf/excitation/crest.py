"""Lower crest factors at an unchanged amplitude spectrum."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nlfrf.excitation.multisine import Multisine, Rng
from nlfrf.shared.arguments import integer, positive

__all__ = ["reduce_crest"]


def reduce_crest(
    ms: Multisine, *, target: float = 1.7, n_iterations: int = 2000, oversampling: int = 4, rng: Rng = None
) -> Multisine:
    """Choose phases that keep the peaks of a multisine low; its amplitude spectrum stays as it is.

    A lower crest factor puts more power under the same actuator limit. The signal is clipped in time and its
    amplitude spectrum put back in frequency, in turn, with the clipping level lowered as it succeeds.

    The phases are no longer random: use it where the plant is nearly linear or where realisations are averaged with
    care; the theory of the distortion level is for random phases.

    Parameters
    ----------
    ms : Multisine
    target : float
        Crest factor at which a realisation is good enough.
    n_iterations : int
        Clipping steps at the most, for each realisation.
    oversampling : int
        Peaks are judged on a grid this much finer than the samples.
    rng : numpy Generator, int or None
        Source of fresh starting phases where one start does not reach the target.

    Returns
    -------
    Multisine
        Each realisation with the lowest crest factor that was found, never above the one it had.

    Raises
    ------
    ValueError
        A target that is not positive, iterations or oversampling below one.

    References
    ----------
    E. Van der Ouderaa, J. Schoukens, J. Renneboog, "Peak factor minimization using a time-frequency domain swapping
    algorithm", IEEE Trans. Instrum. Meas. 37 (1988), 145-147.

    Examples
    --------
    >>> from nlfrf.excitation.multisine import multisine
    >>> ms = multisine("full", fs=1024, n_samples=1024, f_min=1, f_max=100, rng=1)
    >>> better = reduce_crest(ms, rng=1)
    >>> bool(better.crest_factor[0] < 1.7 < ms.crest_factor[0])
    True
    """
    target = positive("target", target)
    n_iterations = integer("n_iterations", n_iterations, least=1)
    n_fine = integer("oversampling", oversampling, least=1) * ms.n_samples
    rng = np.random.default_rng(rng)
    phases = [reduced(ms, phase, target, n_iterations, n_fine, rng) for phase in ms.phase]
    return replace(ms, phase=np.array(phases))


def reduced(
    ms: Multisine, phase: np.ndarray, target: float, n_iterations: int, n_fine: int, rng: np.random.Generator
) -> np.ndarray:
    """The best phases of one realisation: from its own, from Schroeder's, then from fresh random ones."""
    best, lowest, done = phase, crest(ms, phase, n_fine), 0
    starts = [phase, schroeder(ms.amplitude)]
    while done < n_iterations and lowest > target:
        start = starts.pop(0) if starts else rng.uniform(0, 2 * np.pi, phase.size)
        steps = min(500, n_iterations - done)
        found, its_crest = swapped(ms, start, steps, n_fine, target)
        done += steps
        if its_crest < lowest:
            best, lowest = found, its_crest
    return best


def swapped(ms: Multisine, phase: np.ndarray, n_steps: int, n_fine: int, target: float) -> tuple[np.ndarray, float]:
    """Clip in time, restore the amplitudes in frequency, n_steps times; the best phases on the way."""
    lines, half = ms.lines.excited, n_fine / 2
    best, lowest = phase, np.inf
    for i in range(n_steps):
        spectrum = np.zeros(n_fine // 2 + 1, dtype=complex)
        spectrum[lines] = ms.amplitude * np.exp(1j * phase) * half
        u = np.fft.irfft(spectrum, n_fine)
        its_crest = float(np.abs(u).max()) / ms.rms
        if its_crest < lowest:
            best, lowest = phase, its_crest
            if lowest <= target:
                break
        # clip less and less of the peak: from 75 % of it towards 97 %
        level = (0.75 + 0.22 * i / n_steps) * np.abs(u).max()
        phase = np.angle(np.fft.rfft(np.clip(u, -level, level))[lines])
    return best, lowest


def crest(ms: Multisine, phase: np.ndarray, n_fine: int) -> float:
    """Crest factor on the finer grid."""
    return float(np.abs(replace(ms, phase=phase[None]).sampled(n_fine)).max()) / ms.rms


def schroeder(amplitude: np.ndarray) -> np.ndarray:
    """Schroeder's phases: low crest factors for flat, dense spectra (IEEE Trans. Inf. Theory 16, 1970)."""
    share = amplitude**2 / np.sum(amplitude**2)
    before = np.cumsum(share) - share
    return np.asarray(-2 * np.pi * np.cumsum(before))
