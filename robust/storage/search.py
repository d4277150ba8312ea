"""Slacks and intervals tried one after another, until a storage function is judged to prove its inequality."""

from __future__ import annotations

import numpy as np

from nlfrf.shared.values import value
from robust.storage.bernstein import Judged, Storage, in_coordinates, judge, judge_constant, storage_function
from robust.storage.form import Dissipation
from robust.storage.riccati import proposed_storage

__all__ = ["METHOD", "Energy", "certified_dissipation"]

METHOD = "periodic Riccati equation, Bernstein"
SLACKS = 0.1 * 0.25 ** np.arange(4, 14)
INTERVALS = (8, 32, 128)
FINEST = 512
NEAR = 1e-3  # a failure so small that the finest intervals are worth their time


@value(copy=False)
class Energy:
    """A stored energy that was judged to prove its inequality: coordinates z = V z~ and P in them.

    Fields
    ------
    V : (n, n) ndarray
    P : (I, 4, n, n) ndarray
        Bernstein coefficients on each interval; (1, 1, n, n) where nothing is sampled.
    counts : (S,) integer ndarray
        Intervals in each span.
    stored : (n + E, n + E) ndarray
        What is stored besides, in these coordinates.
    """

    V: np.ndarray
    P: np.ndarray
    counts: np.ndarray
    stored: np.ndarray


def certified_dissipation(form: Dissipation, quick: bool = False) -> tuple[str, Energy | None]:
    """Empty and the energy, if a storage function was judged to prove the inequality; else what failed last."""
    judged = in_coordinates(form)
    failure = "no storage function was found"
    nearest = NEAR, 0.0, np.zeros(0)
    for slack in SLACKS:
        P = proposed_storage(judged.form, slack)
        if P is None:
            continue
        if not form.spans.size:
            failure = judge_constant(judged, P)
            if not failure:
                counts = np.zeros(0, dtype=int)
                return "", Energy(V=judged.V, P=P[None, None], counts=counts, stored=judged.form.stored)
            continue
        for n_intervals in INTERVALS:
            storage = storage_function(judged.form, P, slack, n_intervals)
            failure, worst = judge(judged, storage)
            if not failure:
                return "", energy_of(judged, storage)
            if np.isinf(worst) and n_intervals > INTERVALS[0]:  # no solution of this slack: finer will not help
                break
        nearest = min(nearest, (worst, slack, P), key=lambda found: found[0])
    worst, slack, P = nearest
    if worst < NEAR and not quick:
        storage = storage_function(judged.form, P, slack, FINEST)
        failure = judge(judged, storage)[0]
        if not failure:
            return "", energy_of(judged, storage)
    return failure, None


def energy_of(judged: Judged, storage: Storage) -> Energy:
    """What is kept of a storage function, symmetric to the bit."""
    P = storage.coefficients
    counts = np.diff(np.append(storage.first, P.shape[0]))
    P = (P + np.swapaxes(P, -1, -2)) / 2
    return Energy(V=judged.V, P=P, counts=counts, stored=judged.form.stored)
