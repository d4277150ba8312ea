"""The realisations of an experiment: excited, of one excitation, and each with phases of its own.

The same file played again is no new realisation: its distortion is the same, and no scatter tells of it. What repeats
is seen in the phases alone: for lines a < b and c < d with b - a = d - c the sum phi_b - phi_a - phi_d + phi_c does not
change with a delay, nor with a constant phase, so that the same phases are found whatever the trigger.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from nlfrf._base.arguments import data_warning
from nlfrf._base.numbers import fast_length, power, rms, squared_modulus
from nlfrf.bla.neighbours import KEPT, Places
from nlfrf.bla.spectra import Spectra
from nlfrf.records.excited_lines import check_lines
from nlfrf.records.record import Record
from nlfrf.signals.crest import expected_peaks, have_low_crest, is_improbable
from nlfrf.signals.lines import chance_correlation

__all__ = [
    "ALIKE",
    "aligned",
    "check_realizations",
    "equal_steps",
    "group_by_phases",
    "refuse_strangers",
    "warn_of_low_peaks",
]


N_PARTS = 8  # of the band, over which the input power of realisations is compared
STRANGE = 2.0  # how far it may be apart [dB] in realisations that belong together, if it does not scatter
SIGMAS = 5.0  # how many times its scatter it may be apart
BY_CHANCE = 1e-9  # probability with which independent phases may pass for the same ones, in a whole experiment
ALIKE = 0.5  # share of its power that a noisy input has in common with another one of the same phases, at least
LOST, MANY = 4.0, 0.1  # power over that of its noise below which an input is lost, and the share of lines that may be
FEWEST = 4  # lines that can tell phases apart
FEWEST_SUMMED = 6  # lines whose sum has peaks as of a normal distribution
PLENTY = 30  # pairs of equal steps that tell the same phases whatever the delay: none has to be tried as it is
MOST = 100  # realisations against which all others are held; a set of files that is played again is no larger


def check_realizations(spectra: Spectra, record: Record, n_periods: int) -> tuple[Spectra, Spectra, int, bool]:
    """Realisations that can be averaged: with input on the lines said, of one excitation, each with its own phases.

    Parameters
    ----------
    spectra : Spectra
    record : Record
        Of which they are: what was played, the reference where there is one, tells by its peaks of phases that were
        chosen.
    n_periods : int
        Periods behind the spectra.

    Returns
    -------
    The spectra, with realisations that repeat another one as periods of it, the same on the excited lines alone, the
    periods behind each, and whether peaks are lower than usual.

    Warns
    -----
    DataWarning
        Realisations with the phases of another one; a reference whose lines the input does not have; peaks that are
        lower than random phases have them.
    """
    excited = spectra.on_excited()
    played = record.u if record.r is None else record.r
    amplitude = excited.amplitude if excited.R is None else rms(excited.R)
    check_lines(played, excited.lines, amplitude * amplitude)
    refuse_unexcited(excited)
    n = excited.U.shape[0]
    distinct: Any = slice(None)
    if n > 1:
        refuse_strangers(excited.power_U if excited.R is None else squared_modulus(excited.R))
        spectra, groups = join_repeats(spectra, n_periods, excited)
        if len(groups) < n:
            warn_of_repeats(groups, n)
            distinct, n_periods = [group[0] for group in groups], n_periods * n // len(groups)
    if excited.R is not None:
        warn_of_lost_input(excited, excited.R)
    peaks = warn_of_low_peaks(played[distinct, 0], amplitude, excited.lines)
    excited = excited if isinstance(distinct, slice) else spectra.on_excited()
    return spectra, excited, n_periods, have_low_crest(peaks)


def warn_of_lost_input(excited: Spectra, R: np.ndarray) -> None:
    """Warn of lines of a reference R on which the input, over all realisations, is no more than its noise."""
    U = np.add.reduce(excited.U * (R.conj() / np.abs(R)))
    lost = np.count_nonzero(squared_modulus(U) < LOST * np.add.reduce(np.broadcast_to(excited.var_U, excited.U.shape)))
    if lost > MANY * U.size:
        data_warning(
            f"u is not above its noise on {lost} of the {U.size} lines of r: is r what was played in this record? Off "
            "the excitation G is one piece of noise over another"
        )


def warn_of_repeats(groups: list[list[int]], n: int) -> None:
    """Warn of realisations that were joined, by their numbers."""
    told = "; ".join(", ".join(map(str, group)) for group in groups[:4] if len(group) > 1)
    data_warning(
        f"u holds realisations with the same phases ({told}): they repeat one another, so their distortion does not "
        f"average out. They were taken as periods of one realisation, which leaves M = {len(groups)} of {n}; "
        f"play others, as of multisine(n_realizations={n})"
    )


def warn_of_low_peaks(u: np.ndarray, amplitude: np.ndarray, lines: np.ndarray, name: str = "u") -> np.ndarray:
    """Warn of inputs (M, N) whose peaks are lower than random phases have them: they were chosen, or clipped.

    Returns
    -------
    (M,) ndarray
        How many peaks above its own random phases would have, on average one; zeros where lines are too few to tell.
    """
    if amplitude.size < FEWEST_SUMMED:
        return np.zeros(len(u))
    middle = np.add.reduce(u, axis=1) / u.shape[1]
    peak = np.maximum(u.max(axis=1) - middle, middle - u.min(axis=1))
    crest = peak / np.sqrt(power(amplitude) / 2)
    peaks = expected_peaks(crest, lines, amplitude, u.shape[1])
    if is_improbable(peaks):
        data_warning(
            f"{name} must have random phases for its distortion to be told: its crest factor is {crest.mean():.2f}, "
            "lower than random phases of its spectrum have it but once in 100000 experiments. Where the phases were "
            "chosen for low peaks, or the input was clipped, the BLA and its bound are those of that signal: the 95 % "
            "bound may hold half the time; play random phases, or the best of a few draws (reduce_crest without a "
            "target)"
        )
    return peaks


def join_repeats(spectra: Spectra, n_periods: int, excited: Spectra) -> tuple[Spectra, list[list[int]]]:
    """Realisations of the same phases as periods of one, and which were joined.

    A group is set to the trigger of its first member; noise is what its members and their periods differ by.
    """
    known = excited.U if excited.R is None else excited.R
    groups = group_by_phases(known, excited.where)
    if len(groups) == len(known):
        return spectra, groups
    parts = [join(spectra, group, known, n_periods) for group in groups]
    joined: dict[str, Any] = {name: np.stack([part[name] for part in parts]) for name in parts[0]}
    for name in ("var_U", "var_Y", "cov_YU"):  # one period alone tells no noise: it has that of the others
        each = joined[name] * (n_periods * np.array([len(group) for group in groups]))[:, None]
        one = np.isnan(each.real).all(axis=1)
        joined[name][one] = each[~one].mean(axis=0) / n_periods
    return replace(spectra, **joined), groups


def group_by_phases(U: np.ndarray, where: Places) -> list[list[int]]:
    """Which realisations (M, F) have the same phases but for a delay, as lists of their numbers."""
    n, n_lines = U.shape
    steps = equal_steps(where)
    same: Any = False
    if steps.shape[1] < PLENTY:
        same = alike(U, squared_modulus(U @ U[:MOST].conj().T), 1)
    if 2 * steps.shape[1] >= n_lines:
        i, j = steps
        root = np.sqrt(np.abs(U))
        even = U / (root * np.sqrt(root))  # so that the product of four weighs the lines by their amplitude
        step = even[:, 1:] * even[:, :-1].conj()
        turned = step.take(i, axis=1) * step.take(j, axis=1).conj()
        same = same | alike(turned, squared_modulus(turned @ turned[:MOST].conj().T), 1)
    elif n <= MOST:  # few lines are equally far apart: every delay is tried
        n_delays = fast_length(8 * int(where.lines[-1]))
        products, most = np.zeros((n, n_delays), dtype=complex), np.zeros((n, n))
        for m in range(n):
            products[:, where.lines[where.excited]] = U[m].conj() * U
            most[m] = squared_modulus(np.fft.fft(products)).max(axis=-1)
        same = same | alike(U, most, 4 * n_delays)
    if np.count_nonzero(same) <= min(n, MOST):  # each with itself
        return [[m] for m in range(n)]
    groups: list[list[int]] = []
    for m in range(n):
        for group in groups:
            if group[0] < MOST and same[m, group[0]] and aligned(U[m], U[group[0]], where)[1] > ALIKE:
                group.append(m)
                break
        else:
            groups.append([m])
    return groups


@lru_cache(maxsize=KEPT)
def equal_steps(where: Places) -> np.ndarray:
    """(2, n) excited lines i and j, by their order, of which the next ones are equally far."""
    steps = np.diff(where.lines[where.excited])
    order = np.lexsort((np.arange(steps.size), steps))
    return np.array([order[:-1], order[1:]])[:, np.diff(steps[order]) == 0]


def alike(x: np.ndarray, common: np.ndarray, n_delays: int) -> np.ndarray:
    """(M, m) bool: whether rows of x (M, n) agree with the first m more than chance has it, by their products squared.

    Whether what they have in common is the whole of them is left to `aligned`.
    """
    if x.shape[1] < FEWEST:
        return np.eye(*common.shape, dtype=bool)
    size = power(x)
    whole = size[:, None] * size[: common.shape[1]]
    chance = BY_CHANCE / (common.size * n_delays)
    like = common > chance_correlation(chance, x.shape[1]) * whole
    if np.count_nonzero(like) <= common.shape[1]:
        return np.asarray(like)  # no more than n lines weigh something: each is like itself alone
    n = float(
        np.median(size**2 / np.add.reduce(squared_modulus(squared_modulus(x)), axis=1))
    )  # lines that weigh something
    if n < FEWEST:
        return np.eye(*common.shape, dtype=bool)
    return np.asarray(common > chance_correlation(chance, n) * whole)


def aligned(U: np.ndarray, other: np.ndarray, where: Places) -> tuple[float, float]:
    """The delay of U (F,) behind one of the same phases [periods], and the share of its power then in common."""
    lines = where.lines[where.excited]
    product = other * U.conj()
    whole = np.sqrt(power(U) * power(other))
    at_once = float(product.sum().real / whole)
    fine = fast_length(8 * int(lines[-1]))
    spectrum = np.zeros(fine, dtype=complex)
    spectrum[lines] = product
    delay = float(np.argmax(np.fft.fft(spectrum).real)) / fine
    for _ in range(3):  # from the grid of delays to the maximum itself
        now = product * np.exp(-2j * np.pi * lines * delay)
        slope, curvature = np.sum(lines * now.imag), np.sum(lines**2 * now.real)
        delay += slope / (2 * np.pi * max(curvature, 1e-300))
    shared = float(np.sum(product * np.exp(-2j * np.pi * lines * delay)).real / whole)
    # a delay that explains nothing more is noise
    return (0.0, at_once) if 1 - at_once < 2 * (1 - shared) + 1e-9 else (delay, shared)


def join(spectra: Spectra, group: list[int], known: np.ndarray, n_periods: int) -> dict[str, np.ndarray]:
    """Means (K,) over the realisations of a group, and the variances of those means by noise."""
    U, Y = spectra.U[group], spectra.Y[group]
    R = None if spectra.R is None else spectra.R[group]
    for i, m in enumerate(group[1:], 1):
        delay, _ = aligned(known[m], known[group[0]], spectra.where)
        if delay:
            turn = np.exp(2j * np.pi * spectra.lines * delay)
            U[i], Y[i] = U[i] * turn, Y[i] * turn
            if R is not None:
                R[i] = R[i] * turn
    n = n_periods * len(group)
    means = {"U": U.mean(axis=0), "Y": Y.mean(axis=0)}
    if R is not None:
        means["R"] = R.mean(axis=0)
    dU, dY = U - means["U"], Y - means["Y"]
    # sums of squares within the realisations, of n_periods each, and between them
    within = n_periods * (n_periods - 1)
    sums = {
        name: np.nan_to_num(getattr(spectra, name)[group]).sum(axis=0) * within + n_periods * between.sum(axis=0)
        for name, between in (
            ("var_U", squared_modulus(dU)),
            ("var_Y", squared_modulus(dY)),
            ("cov_YU", dY * dU.conj()),
        )
    }
    unknown = np.nan if n == 1 else 1.0
    return means | {name: total * unknown / max(n * (n - 1), 1) for name, total in sums.items()}


def refuse_unexcited(excited: Spectra) -> None:
    """Refuse lines that carry no input, where G would be 0 / 0, or no reference, whose phase would be chance."""
    for name, spectrum in (("input", excited.U), ("reference", excited.R)):
        if spectrum is None:
            continue
        power = excited.power_U if spectrum is excited.U else squared_modulus(spectrum)
        faintest = 1e-18 * power.max()
        if power.min() <= faintest:
            silent = (power <= faintest).any(axis=0)
            k = int(excited.lines[np.argmax(silent)])
            raise ValueError(f"lines must be excited by the {name}, got line {k} with no {name} on it")


def refuse_strangers(known: np.ndarray, kind: str = "realisation", first_number: int = 0) -> None:
    """Refuse realisations of another amplitude spectrum, by their powers (M, F): their BLA is another one.

    A measured force scatters from line to line and from realisation to realisation where the shaker gives way, at a
    resonance above all: the limit is as wide as the mean over a part of the band then scatters.
    """
    if (np.maximum.reduce(known) <= 10 ** (STRANGE / 10) * np.minimum.reduce(known)).all():
        return  # not even a line is so far apart
    first = np.arange(0, known.shape[1], max(1, known.shape[1] // N_PARTS))
    level = 10 * np.log10(known)
    level -= level[:1] if len(level) == 2 else np.median(level, axis=0)
    jumps = np.zeros((1, level.shape[1]))
    jumps[0, 1:] = np.mean(np.diff(level, axis=1) ** 2, axis=0) / 2  # scatter has them, another spectrum has none
    apart, scatter = np.abs(over_parts(level, first)), over_parts(jumps, first)
    n_lines = np.diff(np.append(first, [known.shape[1], 2 * known.shape[1]]))
    beyond = apart / np.maximum(STRANGE, SIGMAS * np.sqrt(np.maximum(scatter, np.mean(jumps)) / n_lines))
    worst, part = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
    if beyond[worst, part] > 1:
        raise ValueError(
            f"u must have the same amplitude spectrum in every {kind}, got {kind} {first_number + worst} up to "
            f"{apart[worst, part]:.1f} dB apart from the others"
        )


def over_parts(x: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Means over parts of the last axis, each from its first index on, and over all of it."""
    size = x.shape[-1]
    means = np.add.reduceat(x, first, axis=-1) / np.diff(np.append(first, size))
    return np.concatenate([means, x.mean(axis=-1, keepdims=True)], axis=-1)
