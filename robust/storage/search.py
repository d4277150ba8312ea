"""Slacks and intervals tried one after another, until a storage function is judged to prove its inequality."""

from __future__ import annotations

import numpy as np

from robust.storage.bernstein import in_coordinates, judge, judge_constant, storage_function
from robust.storage.form import Dissipation
from robust.storage.riccati import proposed_storage

__all__ = ["METHOD", "certified_dissipation"]

METHOD = "periodic Riccati equation, Bernstein"
SLACKS = 0.1 * 0.25 ** np.arange(4, 14)
INTERVALS = (8, 32, 128)
FINEST = 512
NEAR = 1e-3  # a failure so small that the finest intervals are worth their time


def certified_dissipation(form: Dissipation, quick: bool = False) -> str:
    """Empty if a storage function was found and judged to prove the inequality; else what failed last."""
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
                return ""
            continue
        for n_intervals in INTERVALS:
            failure, worst = judge(judged, storage_function(judged.form, P, slack, n_intervals))
            if not failure:
                return ""
            if np.isinf(worst) and n_intervals > INTERVALS[0]:  # no solution of this slack: finer will not help
                break
        nearest = min(nearest, (worst, slack, P), key=lambda found: found[0])
    worst, slack, P = nearest
    return judge(judged, storage_function(judged.form, P, slack, FINEST))[0] if worst < NEAR and not quick else failure
