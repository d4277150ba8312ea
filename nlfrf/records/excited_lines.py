"""Find the excited lines of a measured input.

Measured inputs are coloured and noisy, and the distortion of an amplifier or a current loop has
power on lines that were not excited. So a line is compared with its own noise and its neighbours,
and not with the largest line.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from nlfrf._base.numbers import (
    BLOCK_ENTRIES,
    iterate_blocks,
    mean_power,
    rfft,
    squared_modulus,
    streams_equal,
)
from nlfrf.signals.lines import LineGrid, local_mean, recognise_kind

# ---- Regular grids among lines that the actuator distorts.
#
# Distortion by an actuator (saturation, dead zone, amplifier) scatters from line to line as noise
# does; a designed spectrum is smooth. So lines on a regular grid (every line, every odd one, 4k+1,
# 8k+1 with 8k+3) that are smooth were played, and lines with a jumping level were not.

# [dB] median step from line to line: noise has 4.8, a spectrum distorted by 20 % has 1.6
_ROUGH_LEVEL = 2.5
_ACTUATOR_DROP = 6.0  # [dB] smallest distance of distortion below the neighbouring lines
_MIN_SHARE = 0.75  # smallest share of the power on the lines that were played
_EDGE_LINES = 8  # grid lines that are compared on either side of the end of the band
_EXTENSION_LINES = 4 * _EDGE_LINES  # lines beyond the band
_MAX_SHARE = 0.95  # share of the grid lines that must stand out of the noise
_MIN_LINES = 12  # fewest lines that separate a smooth level from a jumping one


def _excited_lines_on_grid(power: np.ndarray, found: np.ndarray, total: float) -> np.ndarray:
    """Return the lines found, without those that are distortion of the actuator.

    Parameters
    ----------
    power : (K,) ndarray
        Power of the lines 1 to K: all lines, or enough of them beyond those found to show the end
        of the band.
    found : (F,) int ndarray
        Lines that stand out of the noise.
    total : float
        Power of all lines.
    """
    level = 10 * np.log10(np.maximum(power, 1e-300))
    for pattern in _regular_grids(level, found):
        if pattern.size < _MIN_LINES:
            continue
        first, last = _smooth_band(level[pattern - 1])
        played = pattern[first:last]
        if (
            played.size < _MIN_LINES
            or power[played - 1].sum() < _MIN_SHARE * total
            or _level_roughness(level[played - 1]) > _ROUGH_LEVEL
        ):
            continue
        if (
            np.isin(played, found, assume_unique=True).mean() < _MAX_SHARE
            or recognise_kind(played) == "custom"
        ):
            continue
        others = np.setdiff1d(np.arange(played[0], played[-1]), played, assume_unique=True)
        above = np.arange(
            played[-1] + 1, min(level.size, played[-1] + _EXTENSION_LINES) + 1
        )  # the band, or what is there
        if _stands_out(level, played, others) and _stands_out(level, played, above):
            return played
    return found


def _regular_grids(level: np.ndarray, found: np.ndarray) -> list[np.ndarray]:
    """Return the lines on each regular grid, from the first to the last line found; sparse grids
    first.
    """
    inside = np.arange(found[0], found[-1] + 1)
    special = [inside[np.isin((inside - shift) % 8, (1, 3))] for shift in (0, 2, 4, 6)]
    sparse = [inside[inside % 4 == k] for k in (1, 3)]
    odd = inside[inside % 2 == 1]
    top = sliding_window_view(np.pad(level[odd - 1], 4, mode="edge"), 9).max(axis=1)
    return [*special, *sparse, odd, odd[level[odd - 1] > top - _ACTUATOR_DROP - 2.0], inside]


def _level_roughness(level: np.ndarray) -> float:
    """Return the median step of a level from line to line [dB]."""
    if level.size > 1:
        return float(np.median(np.abs(np.diff(level))))
    return 0.0


def _smooth_band(level: np.ndarray) -> tuple[int, int]:
    """Return begin and end of the smooth stretch of a level around its strongest line."""
    strongest = int(np.argmax(np.convolve(level, np.ones(5) / 5, "same")[2:-2])) + 2
    last = _band_edge(level[strongest:]) + strongest
    first = strongest + 1 - _band_edge(level[strongest::-1])
    return first, last


def _band_edge(level: np.ndarray) -> int:
    """Return the number of lines in the first stretch, which ends at a fall after which the level
    jumps.
    """
    highest = np.full(level.size, -np.inf)  # of the lines before each
    for back in range(1, min(_EDGE_LINES, level.size - 1) + 1):
        np.maximum(highest[back:], level[:-back], out=highest[back:])
    for k in (np.flatnonzero(level[1:] <= highest[1:] - _ACTUATOR_DROP) + 1).tolist():
        before, after = level[max(0, k - _EDGE_LINES) : k], level[k : k + _EDGE_LINES]
        if max(level[k], float(np.median(after))) > np.median(before) - _ACTUATOR_DROP:
            continue
        if (
            after.size < 4
            or _level_roughness(after) > 0.6 * _ROUGH_LEVEL
            or after.max() < before.min() - _ACTUATOR_DROP
        ):
            return k
    return level.size


def _stands_out(level: np.ndarray, played: np.ndarray, others: np.ndarray) -> bool:
    """Return whether nearly all other lines are clearly below the nearest played lines."""
    if others.size == 0:
        return True
    nearest = played[np.clip(np.searchsorted(played, others), 0, played.size - 1)]
    under = level[nearest - 1] - level[others - 1]
    return bool(
        np.median(under) > 2 * _ACTUATOR_DROP
        or (
            np.median(under) > _ACTUATOR_DROP and _level_roughness(level[others - 1]) > _ROUGH_LEVEL
        )
    )


def grid_level_jump(power: np.ndarray, grid: LineGrid) -> float:
    """Return the median step [dB] of the level of a grid, from the powers (K,) of the lines 1 to K;
    0 if smooth.
    """
    if grid.excited.size < _MIN_LINES:
        return 0.0
    jump = _level_roughness(10 * np.log10(np.maximum(power[grid.excited - 1], 1e-300)))
    if jump > _ROUGH_LEVEL:
        return jump
    return 0.0


_MAX_STEP = 15.0  # [dB] largest distance of an excited line below its excited neighbours
_ENVELOPE_DECAY = 1.25  # [dB per line] fastest fall of the envelope of the neighbourhood
_MIN_CARRIED_SHARE = 0.5  # smallest share of the power of the input on its lines
_NEGLIGIBLE_POWER = 1e-4  # a line below this share of the median power is tested again
SIGNIFICANCE = 20.0  # smallest power of an excited line over its variance by noise


def detect_lines(u: np.ndarray) -> LineGrid:
    """Return the lines that excite a periodic input.

    Parameters
    ----------
    u : (M, P, N) ndarray
        Input: realisations with one grid x periods x samples.

    Raises
    ------
    ValueError
        No line stands out of the noise.
    """
    return lines_from_powers(*line_powers(u))


def line_powers(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (K,) power of the mean over periods, for all lines but mean and Nyquist, and its
    variance by noise.
    """
    n_periods = u.shape[1]
    inside = slice(1, (u.shape[2] + 1) // 2)
    if u.shape[2] > BLOCK_ENTRIES and n_periods > 1:
        pairs = [_line_powers_of_halves(one) for one in u]
        power, noise = (
            np.add.reduce(some)[inside] / len(pairs) for some in zip(*pairs, strict=True)
        )
    else:
        spectrum = rfft(u)[..., inside]
        power = mean_power(spectrum.mean(axis=1))
        if n_periods > 1:
            noise = np.mean(np.var(spectrum, axis=1, ddof=1), axis=0) / n_periods
        else:
            noise = power
    return power, (
        local_mean(noise, 21) if n_periods > 1 else np.full(power.size, _white_noise_level(power))
    )


def _line_powers_of_halves(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return `line_powers` for long periods u (P, N) from the means of even and odd periods: two
    transforms in all.
    """
    n = len(u)
    if all(streams_equal(u[0], one) for one in u[1:]):
        power = squared_modulus(rfft(u[0]))
        return power, np.zeros(power.size)
    one, other = (
        rfft(np.add.reduce(some) / len(some) if len(some) > 1 else some[0])
        for some in (u[::2], u[1::2])
    )
    share = len(u[::2]) / n
    power, noise = np.empty(one.size), np.empty(one.size)
    for some in iterate_blocks(one.size):
        power[some] = squared_modulus(share * one[some] + (1 - share) * other[some])
        noise[some] = squared_modulus(one[some] - other[some]) * (share * (1 - share))
    return power, noise


def lines_from_powers(power: np.ndarray, noise: np.ndarray) -> LineGrid:
    """Return `detect_lines` for the powers (K,) of the lines 1 to K and their noise."""
    noise = np.maximum(noise, 1e-20 * power.max() / SIGNIFICANCE)
    lines = np.flatnonzero(power > SIGNIFICANCE * noise) + 1
    if not lines.size:
        raise ValueError("u must have lines above its noise, got none: is n_samples its period?")
    level = 10 * np.log10(np.maximum(power[lines - 1], 1e-300))
    near = level > _upper_envelope(level, lines) - _MAX_STEP
    excited = _connected_lines(level[near], lines[near])
    excited = _complete_grid(excited, power[: excited[-1]] > 2 * noise[: excited[-1]])
    return LineGrid(
        excited=_excited_lines_on_grid(
            power[: excited[-1] + _EXTENSION_LINES], excited, float(power.sum())
        )
    )


def check_lines(u: np.ndarray, lines: np.ndarray, power: np.ndarray) -> None:
    """Refuse a grid with lines that the input does not excite, and name the excited lines.

    On a line without input G is a quotient of two rounding errors, or of two noises.

    Parameters
    ----------
    u : (M, P, N) ndarray
        Input, or reference.
    lines : (F,) int ndarray
        The excited lines as given.
    power : (F,) ndarray
        Mean square of the input amplitudes on these lines over realisations, 2/N rfft.
    """
    carried = power.sum() / 2
    last = u[:, -1]  # one period suffices, and the last one has settled
    total = float(np.add.reduce(np.vecdot(last, last))) / last.size
    if power.min() >= _NEGLIGIBLE_POWER * power.max() and carried > _MIN_CARRIED_SHARE * total:
        return  # even with the mean counted
    total -= float(np.mean(last.mean(axis=1) ** 2))
    weak = power < _NEGLIGIBLE_POWER * np.median(power)
    if not weak.any() and carried > _MIN_CARRIED_SHARE * total:
        return
    try:
        found = detect_lines(u).excited
    except ValueError:  # no line stands out of the noise
        return
    missed = np.setdiff1d(lines, found, assume_unique=True)
    more = np.setdiff1d(found, lines, assume_unique=True)
    elsewhere = carried < _MIN_CARRIED_SHARE * total and more.size > 0
    if missed.size and (elsewhere or np.isin(lines[weak], missed).any()):
        listing = ", ".join(map(str, found[:6].tolist())) + (
            f", ... {found[-1]}" if found.size > 6 else ""
        )
        raise ValueError(
            f"lines must be excited by the input, got line {missed[0]} with no input on it, the"
            f" first of {missed.size} among {lines.size}; in the record {found.size} lines are:"
            f" {listing}"
        )


def _complete_grid(excited: np.ndarray, present: np.ndarray) -> np.ndarray:
    """Return the regular grid of which at most a tenth is missing, if the missing lines do carry
    input.

    So lines in a narrow notch of the amplitude spectrum, or near the noise, are found from the
    grid.
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


def _white_noise_level(power: np.ndarray) -> float:
    """Return the level of white noise in the power of a single period; zero if no part of it looks
    like noise.

    The power of noise is exponentially distributed, so its quartiles are 0.288 and 1.386 times its
    mean. It jumps from line to line by 4.8 dB in the median, while a designed spectrum is smooth.
    """
    floors = []
    for block in np.array_split(power, 16):
        if (
            block.size >= 8
            and np.median(np.abs(np.diff(10 * np.log10(np.maximum(block, 1e-300))))) > 2.5
        ):
            floors.append(float(np.quantile(block, 0.25)) / 0.288)
    return min(floors, default=0.0)


def _upper_envelope(level: np.ndarray, lines: np.ndarray) -> np.ndarray:
    """Return the upper envelope of the levels of lines; it falls by at most _ENVELOPE_DECAY a line
    beside a peak.
    """
    ramp = _ENVELOPE_DECAY * lines
    forward = np.maximum.accumulate(level + ramp) - ramp
    backward = np.maximum.accumulate((level - ramp)[::-1])[::-1] + ramp
    return np.maximum(forward, backward)


def _connected_lines(level: np.ndarray, lines: np.ndarray) -> np.ndarray:
    """Return the lines reached from the strongest line by steps down of at most _MAX_STEP.

    The band ends where only harmonics and distortion of the input follow, at whatever level.
    """
    strongest = int(np.argmax(level))
    kept = [int(lines[strongest])]
    for side in (slice(strongest + 1, None), slice(strongest)):
        step = -1 if side.start is None else 1
        previous = last = level[strongest]
        for k, here in zip(lines[side][::step].tolist(), level[side][::step].tolist(), strict=True):
            if here > max(previous, last) - _MAX_STEP:
                kept.append(k)
                previous, last = last, here
    return np.sort(np.array(kept))
