"""Experiments that were played again: periods of one experiment, not experiments of their own.

The same signals give the same distortion, so that no scatter over sets tells of it. Two experiments repeat one another
where all inputs of the one are those of the other behind one delay: experiments of an orthogonal set may have the same
phases but for a constant in each input, and are no repeats.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nlfrf._base.arguments import data_warning
from nlfrf._base.numbers import power
from nlfrf.bla.mimo.channels import ChannelSpectra
from nlfrf.bla.neighbours import place_lines
from nlfrf.bla.realizations import ALIKE, aligned, group_by_phases
from nlfrf.signals.lines import LineGrid

__all__ = ["join_repeats"]


SILENT = 1e-3  # of the largest amplitude of an input: lines below it are not its own
FEWEST = 5  # lines of an input that tell its phases


def join_repeats(spectra: ChannelSpectra, per_set: int) -> ChannelSpectra:
    """The spectra with experiments that repeat one another as periods of one, where that leaves whole sets; a warning.

    A group is set to the trigger of its first member; noise is what its members and their periods differ by.
    """
    M = spectra.U.shape[1]
    groups = repeats(spectra) if per_set < M else []
    if not 0 < len(groups) < M or len(groups) % per_set:
        return spectra
    told = "; ".join(", ".join(str(m + 1) for m in group) for group, _ in groups[:4] if len(group) > 1)
    data_warning(
        f"u holds experiments that repeat one another ({told}): their distortion is the same and does not average out. "
        f"They were taken as periods of one experiment, which leaves {len(groups)} of {M}; play sets that have phases "
        "of their own, as multisine(n_inputs=, n_realizations=) does"
    )
    if spectra.dU.shape != (len(spectra.U), *spectra.dY.shape[1:]):  # of inputs that repeat exactly
        spectra = replace(spectra, dU=np.zeros((len(spectra.U), *spectra.dY.shape[1:]), dtype=complex))
    parts = [joined(spectra, group, delays) for group, delays in groups]
    free = np.array([len(group) * (1 + spectra.n_free) - 1 for group, _ in groups])
    known = float(np.mean(free > 0)) or 1.0  # one period alone tells no noise: it has that of the others
    return replace(
        spectra,
        U=np.stack([part[0] for part in parts], axis=1),
        Y=np.stack([part[1] for part in parts], axis=1),
        R=None if spectra.R is None else np.stack([part[2] for part in parts], axis=1),
        dU=of_one_length([part[3] for part in parts]) / np.sqrt(known),
        dY=of_one_length([part[4] for part in parts]) / np.sqrt(known),
        n_free=float(free.mean()),
    )


def repeats(spectra: ChannelSpectra) -> list[tuple[list[int], list[float]]]:
    """Experiments that repeat one another, by their numbers, and their delays behind the first of each [periods]."""
    known = (spectra.U if spectra.R is None else spectra.R)[..., spectra.excited]  # (n_u, M, F)
    lines, M = spectra.lines[spectra.excited], known.shape[1]
    labels = np.zeros((len(known), M), dtype=int)
    for label, U in zip(labels, known, strict=True):
        size = np.abs(U).max(axis=0)
        own = size > SILENT * size.max()
        if np.count_nonzero(own) < FEWEST:
            return [([m], [0.0]) for m in range(M)]
        for number, group in enumerate(group_by_phases(U[:, own], place_lines(LineGrid(excited=lines[own])))):
            label[group] = number
    places = place_lines(LineGrid(excited=lines))
    groups: list[tuple[list[int], list[float]]] = []
    for m in range(M):
        for members, delays in groups:
            if np.all(labels[:, m] == labels[:, members[0]]):
                product = known[:, members[0]] * known[:, m].conj()
                product /= np.sqrt(power(known[:, members[0]]) * power(known[:, m]))[:, None]  # inputs of one size
                delay, _ = aligned(np.ones(lines.size), product.sum(axis=0), places)
                turned = (product * np.exp(-2j * np.pi * lines * delay)).real.sum(axis=1)
                if np.all(turned > ALIKE):
                    members.append(m)
                    delays.append(delay)
                    break
        else:
            groups.append(([m], [0.0]))
    return groups


def joined(spectra: ChannelSpectra, group: list[int], delays: list[float]) -> tuple[np.ndarray, ...]:
    """Means U, Y, R (n, K) over the experiments of a group and the scatters dU, dY (n, D, K) of those means."""
    g, free = len(group), spectra.n_free
    turn = np.exp(2j * np.pi * np.multiply.outer(delays, spectra.lines))  # (g, K)
    known = spectra.R if spectra.R is not None else spectra.U
    U, Y, R = (one[:, group] * turn for one in (spectra.U, spectra.Y, known))
    total = max(g * (1 + free) - 1, 1)
    found = [one.mean(axis=1) for one in (U, Y, R)]
    for mean, one, scatter in ((found[0], U, spectra.dU), (found[1], Y, spectra.dY)):
        # two estimates of the covariance of the mean, weighted by their degrees of freedom g n_free and g - 1
        within = (scatter[:, group] * turn[:, None]).reshape(len(one), g * scatter.shape[2], turn.shape[1])
        between = (one - mean[:, None]) / np.sqrt(g)
        found.append(np.concatenate([within * np.sqrt(free / g), between], axis=1) / np.sqrt(total))
    return tuple(found)


def of_one_length(scatters: list[np.ndarray]) -> np.ndarray:
    """(n, M, D, K) with scatters of fewer columns filled up by zeros, which say nothing."""
    most = max(one.shape[1] for one in scatters)
    return np.stack([np.pad(one, ((0, 0), (0, most - one.shape[1]), (0, 0))) for one in scatters], axis=1)
