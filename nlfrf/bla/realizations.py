"""Merge realisations with the same phases; find unequal amplitude spectra and low crest factors.

If the same signal is played again, the distortion is the same, so this is not a new realisation but
further periods of the same one. It is recognised by its phases. For lines a < b and c < d with b -
a = d - c the sum phi_b - phi_a - phi_d + phi_c does not depend on the delay. So equal phases are
found without a search over delays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from nlfrf._base.arguments import data_warning
from nlfrf._base.numbers import fast_length, power, squared_modulus
from nlfrf.bla.line_index import N_CACHED_GRIDS, LineIndex, index_lines
from nlfrf.bla.spectra import Spectra
from nlfrf.signals.crest import expected_peaks, is_improbable
from nlfrf.signals.lines import LineGrid, chance_correlation

_N_BAND_PARTS = 8  # parts of the band, over which the input power of realisations is compared
_MAX_LEVEL_DIFFERENCE = (
    2.0  # [dB] largest difference between realisations, if the level does not scatter
)
_MAX_LEVEL_SIGMAS = 5.0  # the same in standard deviations, if it scatters
#: Probability that independent phases pass for equal ones, in a whole experiment.
_FALSE_MATCH_PROBABILITY = 1e-9
#: Least share of the power of a noisy input in common with another one with equal phases.
_MIN_SHARED_POWER = 0.5
# least amplitude of its own lines for an input of a zippered record, over the largest
_MIN_OWN_AMPLITUDE = 1e-3
_MIN_PHASE_LINES = 4  # fewest lines with which phases can be compared
_MIN_CREST_LINES = 6  # fewest lines whose sum has peaks as of a normal distribution
#: Number of pairs of equal steps that suffice to find equal phases at any delay, so that none has
#: to be tried.
_ENOUGH_STEP_PAIRS = 30
# realisations with which all others are compared; a set of files played again is no larger
_MAX_REFERENCES = 100


def warn_of_low_crest(
    u: np.ndarray, amplitude: np.ndarray, *, lines: np.ndarray, name: str = "u"
) -> np.ndarray:
    """Warn of inputs (M, N) whose crest factor is lower than that of random phases: optimised, or
    clipped.

    Returns
    -------
    (M,) ndarray
        Expected number of peaks of random phases above the crest of the input, one on average;
        zeros for too few lines.
    """
    if amplitude.size < _MIN_CREST_LINES:
        return np.zeros(len(u))
    middle = np.add.reduce(u, axis=1) / u.shape[1]
    peak = np.maximum(u.max(axis=1) - middle, middle - u.min(axis=1))
    crest = peak / np.sqrt(power(amplitude) / 2)
    peaks = expected_peaks(crest, lines, amplitude=amplitude, n_samples=u.shape[1])
    if is_improbable(peaks):
        data_warning(
            f"{name} must have random phases for an estimate of distortion, got a crest factor"
            f" of {crest.mean():.2f}, which random phases with its spectrum reach once in 100000"
            " experiments. If the phases were chosen for low peaks, or the input was clipped,"
            " BLA and bound hold for that signal only: the 95 % bound may hold half the time."
            " Play random phases, or the best of a few draws (reduce_crest without a target)"
        )
    return peaks


def join_repeats(
    spectra: Spectra, excited: Spectra, kind: str, first_number: int
) -> tuple[Spectra, list[int]]:
    """Merge experiments that repeat one another into further periods of the first, with a warning.

    Two experiments repeat one another if all inputs of one are those of the other after one common
    delay. Experiments of an orthogonal set may have equal phases up to a constant in each input;
    these are no repeats. A group is shifted to the trigger of its first member; its noise is the
    scatter over members and periods. If no whole sets would remain, all experiments are kept.

    Returns
    -------
    The spectra, and the number of the first experiment of each group.
    """
    n = excited.U.shape[1]
    if excited.experiments_per_set < n:
        groups = _find_repeats(excited)
    else:
        groups = []
    if not 0 < len(groups) < n or len(groups) % excited.experiments_per_set:
        return spectra, list(range(n))
    listed = "; ".join(
        ", ".join(str(m + first_number) for m in group) for group, _ in groups[:4] if len(group) > 1
    )
    data_warning(
        f"u holds {kind}s with the same phases ({listed}). They repeat one another, so their"
        f" distortion does not average out. They count as periods of one {kind}, which leaves M"
        f" = {len(groups)} of {n}. Play {kind}s with different phases, as from"
        f" multisine(n_realizations={n // excited.experiments_per_set})"
    )
    P, sizes = spectra.n_periods, [len(group) for group, _ in groups]
    parts, scatters = map(
        list, zip(*(_merge_group(spectra, *group) for group in groups), strict=True)
    )
    if P == 1:
        scatters = _fill_unknown_scatters(scatters, sizes)
    U, Y, R = (np.stack(x, axis=1) for x in zip(*parts, strict=True))
    dU, dY = (_pad_scatters(x) for x in zip(*scatters, strict=True))
    periods = P * n // len(groups)
    joined = replace(
        spectra, U=U, Y=Y, R=None if spectra.R is None else R, dU=dU, dY=dY, n_periods=periods
    )
    return joined, [group[0] for group, _ in groups]


def _fill_unknown_scatters(
    scatters: list[list[np.ndarray]], sizes: list[int]
) -> list[list[np.ndarray]]:
    """Return the scatters of groups with one period each; a single group gets the scatter of the
    other groups.
    """
    merged = [m for m, g in enumerate(sizes) if g > 1]
    others = [
        np.concatenate([scatters[t][k] * np.sqrt(sizes[t] / len(merged)) for t in merged], axis=1)
        for k in (0, 1)
    ]
    return [others if g == 1 else own for own, g in zip(scatters, sizes, strict=True)]


def _merge_group(
    spectra: Spectra, group: list[int], delays: list[float]
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Return the mean U, Y and excitation (n, K) of experiments that repeat one another, and the
    scatters of U and Y.

    Two estimates of the covariance of the mean, within and between experiments, are weighted by
    their degrees of freedom g (P - 1) and g - 1.
    """
    P, g, D = spectra.n_periods, len(group), max(spectra.dU.shape[2], spectra.dY.shape[2])
    turn = np.exp(2j * np.pi * np.multiply.outer(delays, spectra.lines))
    turned = [x[:, group] * turn for x in (spectra.U, spectra.Y, spectra.excitation)]
    means, scatters = [x.mean(axis=1) for x in turned], []
    for x, mean, dx in zip(turned, means, (spectra.dU, spectra.dY), strict=False):
        within = np.broadcast_to(dx[:, group], (len(x), g, D if dx.shape[2] else 0, turn.shape[1]))
        within = (within * turn[:, None]).reshape(len(x), -1, turn.shape[1]) * np.sqrt((P - 1) / g)
        both = np.concatenate([within, (x - mean[:, None]) / np.sqrt(g)], axis=1)
        scatters.append(both / np.sqrt(max(g * P - 1, 1)))
    return means, scatters


def _pad_scatters(scatters: Sequence[np.ndarray]) -> np.ndarray:
    """Stack scatters (n, D, K) to (n, M, D, K), padded with zeros, which add no variance."""
    most = max(one.shape[1] for one in scatters)
    return np.stack(
        [np.pad(one, ((0, 0), (0, most - one.shape[1]), (0, 0))) for one in scatters], axis=1
    )


def _find_repeats(excited: Spectra) -> list[tuple[list[int], list[float]]]:
    """Group the experiments that repeat one another: their numbers, and their delays against the
    first [periods].
    """
    excitation, lines, M = excited.excitation, excited.lines, excited.U.shape[1]
    labels = np.zeros((len(excitation), M), dtype=int)
    for of_input, U in zip(labels, excitation, strict=True):
        index = excited.index
        if excited.is_zippered:
            size = np.abs(U).max(axis=0)
            own = size > _MIN_OWN_AMPLITUDE * size.max()
            if np.count_nonzero(own) <= _MIN_PHASE_LINES:
                return [([m], [0.0]) for m in range(M)]
            U, index = U[:, own], index_lines(LineGrid(excited=lines[own]))
        for number, group in enumerate(_group_by_phases(U, index)):
            of_input[group] = number
    by_label: dict[tuple[int, ...], list[tuple[list[int], list[float]]]] = {}
    for m, label in enumerate(map(tuple, labels.T.tolist())):
        for members, delays in by_label.setdefault(label, []):
            products = _normalized_products(excitation[:, m], excitation[:, members[0]])
            delay, _ = _estimate_delay(np.add.reduce(products) / len(products), lines)
            turned = (products * np.exp(-2j * np.pi * lines * delay)).real.sum(axis=1)
            if np.all(turned > _MIN_SHARED_POWER):
                members.append(m)
                delays.append(delay)
                break
        else:
            by_label[label].append(([m], [0.0]))
    return sorted(group for groups in by_label.values() for group in groups)


def _normalized_products(U: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return U* times another spectrum (..., F), per line, over the norms of both."""
    return np.asarray(other * U.conj() / np.sqrt(power(U) * power(other))[..., None])


def _group_by_phases(U: np.ndarray, index: LineIndex) -> list[list[int]]:
    """Group the realisations (M, F) that have equal phases up to a delay, as lists of their
    numbers.
    """
    n, n_lines = U.shape
    steps = pair_equal_steps(index)
    same = np.zeros((n, min(n, _MAX_REFERENCES)), dtype=bool)
    if steps.shape[1] < _ENOUGH_STEP_PAIRS:
        same = _match_phases(U, squared_modulus(U @ U[:_MAX_REFERENCES].conj().T), 1)
    if 2 * steps.shape[1] >= n_lines:
        i, j = steps
        root = np.sqrt(np.abs(U))
        weighted = U / (
            root * np.sqrt(root)
        )  # so that a product of four is weighted by the amplitude of the lines
        step = weighted[:, 1:] * weighted[:, :-1].conj()
        turned = step.take(i, axis=1) * step.take(j, axis=1).conj()
        same = same | _match_phases(
            turned, squared_modulus(turned @ turned[:_MAX_REFERENCES].conj().T), 1
        )
    elif n <= _MAX_REFERENCES:  # few equal steps between lines: every delay is tried
        n_delays = fast_length(8 * int(index.lines[-1]))
        products, most = np.zeros((n, n_delays), dtype=complex), np.zeros((n, n))
        for m in range(n):
            products[:, index.lines[index.excited]] = U[m].conj() * U
            most[m] = squared_modulus(np.fft.fft(products)).max(axis=-1)
        same = same | _match_phases(U, most, 4 * n_delays)
    if np.count_nonzero(same) <= min(n, _MAX_REFERENCES):  # each realisation equals itself only
        return [[m] for m in range(n)]
    groups: list[list[int]] = []
    lines = index.lines[index.excited]
    for m in range(n):
        for group in groups:
            if (
                group[0] < _MAX_REFERENCES
                and same[m, group[0]]
                and _estimate_delay(_normalized_products(U[m], U[group[0]]), lines)[1]
                > _MIN_SHARED_POWER
            ):
                group.append(m)
                break
        else:
            groups.append([m])
    return groups


@lru_cache(maxsize=N_CACHED_GRIDS)
def pair_equal_steps(index: LineIndex) -> np.ndarray:
    """Return (2, n) pairs i, j of excited lines, by their index, with equal distances to the next
    line.
    """
    steps = np.diff(index.lines[index.excited])
    order = np.lexsort((np.arange(steps.size), steps))
    return np.array([order[:-1], order[1:]])[:, np.diff(steps[order]) == 0]


def _match_phases(x: np.ndarray, product_power: np.ndarray, n_delays: int) -> np.ndarray:
    """Return (M, m) bool, the rows of x (M, n) that correlate with the first m rows beyond chance.

    `product_power` (M, m) holds the squared moduli of their inner products. `_estimate_delay` then
    decides whether they agree fully or in part.
    """
    if x.shape[1] < _MIN_PHASE_LINES:
        return np.eye(*product_power.shape, dtype=bool)
    size = power(x)
    whole = size[:, None] * size[: product_power.shape[1]]
    chance = _FALSE_MATCH_PROBABILITY / (product_power.size * n_delays)
    like = product_power > chance_correlation(chance, x.shape[1]) * whole
    if np.count_nonzero(like) <= product_power.shape[1]:
        return np.asarray(like)  # each row matches itself only
    # equivalent number of lines with weight
    n = float(np.median(size**2 / np.add.reduce(squared_modulus(squared_modulus(x)), axis=1)))
    if n < _MIN_PHASE_LINES:
        return np.eye(*product_power.shape, dtype=bool)
    return np.asarray(product_power > chance_correlation(chance, n) * whole)


def _estimate_delay(product: np.ndarray, lines: np.ndarray) -> tuple[float, float]:
    """Estimate the delay against a signal with the same phases [periods], and the correlation at
    this delay.

    `product` (F,) is that of `_normalized_products`.
    """
    correlation_at_zero = float(product.sum().real)
    fine = fast_length(8 * int(lines[-1]))
    spectrum = np.zeros(fine, dtype=complex)
    spectrum[lines] = product
    delay = float(np.argmax(np.fft.fft(spectrum).real)) / fine
    for _ in range(3):  # Newton steps from the grid of delays to the maximum
        now = product * np.exp(-2j * np.pi * lines * delay)
        slope, curvature = np.sum(lines * now.imag), np.sum(lines**2 * now.real)
        delay += slope / (2 * np.pi * max(curvature, 1e-300))
    shared = float(np.sum(product * np.exp(-2j * np.pi * lines * delay)).real)
    # a delay that explains no more than zero delay is noise
    if 1 - correlation_at_zero < 2 * (1 - shared) + 1e-9:
        return 0.0, correlation_at_zero
    return delay, shared


def require_equal_spectra(
    powers: np.ndarray, kind: str = "realisation", first_number: int = 0
) -> None:
    """Refuse realisations with another amplitude spectrum, by their powers (M, F): their BLA is
    another one.

    A measured force scatters from line to line and from realisation to realisation if the shaker is
    weak, most at a resonance. So the limit is at least `_MAX_LEVEL_SIGMAS` standard deviations of
    the mean over a part of the band.
    """
    if (
        np.maximum.reduce(powers) <= 10 ** (_MAX_LEVEL_DIFFERENCE / 10) * np.minimum.reduce(powers)
    ).all():
        return  # no line differs by more
    first = np.arange(0, powers.shape[1], max(1, powers.shape[1] // _N_BAND_PARTS))
    level = 10 * np.log10(powers)
    level -= level[:1] if len(level) == 2 else np.median(level, axis=0)
    jumps = np.zeros((1, level.shape[1]))
    jumps[0, 1:] = (
        np.mean(np.diff(level, axis=1) ** 2, axis=0) / 2
    )  # scatter jumps, another spectrum does not
    difference = np.abs(_mean_over_band_parts(level, first))
    scatter = _mean_over_band_parts(jumps, first)
    n_lines = np.diff(np.append(first, [powers.shape[1], 2 * powers.shape[1]]))
    beyond = difference / np.maximum(
        _MAX_LEVEL_DIFFERENCE,
        _MAX_LEVEL_SIGMAS * np.sqrt(np.maximum(scatter, np.mean(jumps)) / n_lines),
    )
    worst, part = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
    if beyond[worst, part] > 1:
        raise ValueError(
            f"u must have the same amplitude spectrum in every {kind}, got {kind}"
            f" {first_number + worst} up to {difference[worst, part]:.1f} dB from the others"
        )


def _mean_over_band_parts(x: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Return means over parts of the last axis, each from its first index on, and over all of
    it.
    """
    size = x.shape[-1]
    means = np.add.reduceat(x, first, axis=-1) / np.diff(np.append(first, size))
    return np.concatenate([means, x.mean(axis=-1, keepdims=True)], axis=-1)
