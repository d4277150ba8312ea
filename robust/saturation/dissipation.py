"""The dissipation inequality of a friction of a class and an actuator that saturates, in states that come to rest.

To the inequality of the friction comes, with y the state less where it rests, u - h = asked'y - w and weights theta,

    theta_0 w (share asked'y - w) + sum theta_j w (asked'y - w - u_j)

at every sample, or in the flow with w as one input more: what an actuator never makes negative.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robust.saturation.loop import CutLoop
from robust.storage.form import Block, Dissipation

__all__ = ["saturated"]


def saturated(form: Dissipation, cut: CutLoop, share: float, sector: float, given: np.ndarray) -> Dissipation:
    """The inequality with its actuator; form : that of the friction, whose first states are those of the cut loop."""
    n = form.A.shape[0]
    asked, enters = (np.pad(row, (0, n - row.size)) for row in (cut.asked, cut.enters))
    seen = (share * sector + given.sum()) / 2 * asked
    seen[cut.filters] -= given / 2
    weight = float(sector + given.sum())
    if cut.loop.T:
        return replace(form, block=Block(enters=enters, seen=seen, weight=weight))
    m = form.B.shape[1]
    R = np.zeros((m + 1, m + 1))
    R[:m, :m], R[m, m] = form.R, -weight
    return replace(
        form,
        B=np.column_stack([form.B, -enters]),
        B_error=np.column_stack([form.B_error, np.zeros(n)]),
        N=np.column_stack([form.N, seen]),
        R=R,
    )
