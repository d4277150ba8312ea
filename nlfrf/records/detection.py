"""Finding, in a measured input, the period and the lines that were excited.

Real inputs are coloured, noisy, and carry energy on lines that were not meant to be excited (an amplifier or a
current loop distorts). So a line is never compared with the largest of all lines, only with its own noise and
with its neighbourhood.
"""

from __future__ import annotations

import numpy as np

from nlfrf.excitation.lines import LineGrid, local_mean
from nlfrf.records.regular_grids import played_lines
from nlfrf.shared.leastsquares import mean_power
from nlfrf.shared.transforms import fast_length, rfft

__all__ = ["detect_lines", "detect_period", "refuse_wrong_lines"]


DROP = 15.0  # an excited line stands at most this far [dB] under its excited neighbours
DECAY = 1.25  # how fast the neighbourhood's level may fall from line to line [dB]
CARRIED = 0.5  # share of the input's power that its lines carry at least
FAR_BELOW = 1e-4  # power under the median of all lines from which a line is looked at again
SIGNIFICANT = 20.0  # power over the variance by noise that an excited line needs at least


def detect_lines(u: np.ndarray) -> LineGrid:
    """The lines on which a periodic input was excited.

    Parameters
    ----------
    u : (M, P, N) ndarray
        Input: realisations of one grid x periods x samples.

    Raises
    ------
    ValueError
        No line stands out of the noise.
    """
    spectrum = rfft(u)[..., 1 : (u.shape[2] + 1) // 2]  # neither mean nor Nyquist
    mean = spectrum.mean(axis=1)
    power = np.mean(np.abs(mean) ** 2, axis=0)
    if u.shape[1] > 1:
        noise = np.mean(np.var(spectrum, axis=1, ddof=1), axis=0) / u.shape[1]
        noise = local_mean(noise, 21)
    else:
        noise = np.full(power.size, noise_floor(power))
    noise = np.maximum(noise, 1e-20 * power.max() / SIGNIFICANT)
    candidate = power > SIGNIFICANT * noise
    if not candidate.any():
        raise ValueError("u must hold lines that stand out of its noise, got none; is n_samples its period?")
    level = 10 * np.log10(np.maximum(power, 1e-300))
    candidate &= level > neighbourhood(np.where(candidate, level, -np.inf)) - DROP
    excited = connected(candidate, level) + 1
    excited = completed(excited, power[: excited[-1]] > 2 * noise[: excited[-1]])
    return LineGrid(excited=played_lines(power, excited))


def refuse_wrong_lines(u: np.ndarray, grid: LineGrid, U: np.ndarray) -> None:
    """Refuse a grid that is not the one in the input, with the lines that are excited.

    Off the excitation G is one rounding error, or one piece of noise, over another.

    Parameters
    ----------
    u : (M, P, N) ndarray
        Input, or reference.
    grid : LineGrid
        The lines that somebody said.
    U : (M, F) complex ndarray
        Its amplitudes, 2/N rfft, on the excited lines of that grid.
    """
    power = mean_power(U)
    carried = power.sum() / 2
    last = u[:, -1]  # one period is enough, and the last one is settled
    means = np.add.reduce(last, axis=1) / u.shape[2]
    total = float(np.add.reduce(np.vecdot(last, last))) / last.size - float(np.vdot(means, means)) / means.size
    if power.min() >= FAR_BELOW * power.max() and carried > CARRIED * total:
        return
    weak = power < FAR_BELOW * np.median(power)
    if not weak.any() and carried > CARRIED * total:
        return
    try:
        found = detect_lines(u).excited
    except ValueError:  # nothing stands out of the noise, on these lines or any others
        return
    missed, more = (np.setdiff1d(*pair, assume_unique=True) for pair in ((grid.excited, found), (found, grid.excited)))
    elsewhere = carried < CARRIED * total and more.size > 0
    if missed.size and (elsewhere or np.isin(grid.excited[weak], missed).any()):
        said = ", ".join(map(str, found[:6].tolist())) + (f", ... {found[-1]}" if found.size > 6 else "")
        raise ValueError(
            f"lines must be excited by the input, got line {missed[0]} with no input on it, the first of {missed.size} "
            f"among {grid.excited.size}; in the record {found.size} lines are: {said}"
        )


def completed(excited: np.ndarray, present: np.ndarray) -> np.ndarray:
    """The regular grid of which at most a tenth is missing, where the missing lines do carry input.

    Lines in a narrow notch of the amplitude spectrum, or near the noise, are found by their place in the grid.
    """
    band = np.arange(excited[0], excited[-1] + 1)
    patterns = [band, band[band % 2 == excited[0] % 2]]
    patterns += [band[(band - excited[0]) % 4 == 0]]
    patterns += [band[np.isin((band - shift) % 8, (1, 3))] for shift in (0, 2, 4, 6)]
    for pattern in sorted(patterns, key=np.size):
        missing = np.setdiff1d(pattern, excited, assume_unique=True)
        if pattern.size - missing.size == excited.size and missing.size <= 0.1 * pattern.size:
            return np.union1d(excited, missing[present[missing - 1]])
    return excited


def noise_floor(power: np.ndarray) -> float:
    """The level of white noise in the power of a single period; zero where no part of it looks like noise.

    The power of noise is exponentially distributed, so its quartiles are 0.288 and 1.386 times its mean, and it
    jumps from line to line, by 4.8 dB in the median, where a designed spectrum is smooth.
    """
    floors = []
    for block in np.array_split(power, 16):
        if block.size >= 8 and np.median(np.abs(np.diff(10 * np.log10(np.maximum(block, 1e-300))))) > 2.5:
            floors.append(float(np.quantile(block, 0.25)) / 0.288)
    return min(floors, default=0.0)


def neighbourhood(level: np.ndarray) -> np.ndarray:
    """Upper envelope of the levels that falls by at most DECAY a line on either side of a peak."""
    ramp = DECAY * np.arange(level.size)
    forward = np.maximum.accumulate(level + ramp) - ramp
    backward = np.maximum.accumulate((level - ramp)[::-1])[::-1] + ramp
    return np.maximum(forward, backward)


def connected(candidate: np.ndarray, level: np.ndarray) -> np.ndarray:
    """Candidates that can be reached from the strongest line without falling by more than DROP at a step.

    This ends the band where only harmonics and distortion of the input follow, at whatever level.
    """
    index = np.flatnonzero(candidate)
    strongest = int(np.argmax(level[index]))
    kept = [int(index[strongest])]
    for side in (index[strongest + 1 :], index[:strongest][::-1]):
        previous = last = level[index[strongest]]
        for k, here in zip(side.tolist(), level[side].tolist(), strict=True):
            if here > max(previous, last) - DROP:
                kept.append(k)
                previous, last = last, here
    return np.sort(np.array(kept))


def detect_period(u: np.ndarray) -> float:
    """The period of a signal in samples, not rounded, from its autocorrelation.

    Parameters
    ----------
    u : (n,) ndarray
        At least two periods.

    Raises
    ------
    ValueError
        The signal does not repeat within its length.
    """
    u = u - u.mean()
    n = u.size
    n_padded = fast_length(2 * n)
    correlation = np.fft.irfft(np.abs(np.fft.rfft(u, n_padded)) ** 2, n_padded)[: n // 2 + 1]
    # normalised by the energy of the two overlapping pieces, so that a repetition gives 1 at any lag
    energy = np.concatenate(([0.0], np.cumsum(u**2)))
    lag = np.arange(correlation.size)
    overlap = np.sqrt(energy[n - lag] * (energy[-1] - energy[lag]))
    rho = correlation / np.maximum(overlap, np.finfo(float).tiny)
    negative = np.flatnonzero(rho < 0)  # past the main lobe around lag 0
    if negative.size:
        rho[: negative[0]] = 0.0
        if rho.max() > 0.5:
            top = tops(rho)
            best = top.max()
            peak = int(np.argmax(top > best - 0.1 * (1 - best) - 0.02))
            reach = slice(peak, min(peak + max(3, peak // 100), rho.size))
            peak += int(np.argmax(top[reach]))
            return peak + vertex(rho, peak)
    raise ValueError(f"u must repeat at least once within its {n} samples for its period to be found; give n_samples")


def tops(rho: np.ndarray) -> np.ndarray:
    """The same, with each peak as high as the parabola through it: one between two samples is no lower than others."""
    left, middle, right = rho[:-2], rho[1:-1], rho[2:]
    peak = (middle > 0) & (middle >= left) & (middle > right)
    raised = rho.copy()
    left, middle, right = left[peak], middle[peak], right[peak]
    raised[1:-1][peak] += (left - right) ** 2 / (8 * (2 * middle - left - right))
    return raised


def vertex(rho: np.ndarray, peak: int) -> float:
    """Offset of the top of the parabola through a peak and its neighbours."""
    if not 0 < peak < rho.size - 1:
        return 0.0
    left, top, right = rho[peak - 1 : peak + 2]
    curvature = left - 2 * top + right
    return float(0.5 * (left - right) / curvature) if curvature < 0 else 0.0
