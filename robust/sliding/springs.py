"""Refutation: a friction of the class that never slips is a spring, and a spring can make the loop unstable."""

from __future__ import annotations

import numpy as np

from robust.sliding.loop import SlidingLoop

__all__ = ["unstable_spring"]

#: A pole this close to the boundary is on neither side.
BEYOND = 1e-9


def unstable_spring(loop: SlidingLoop, K0: float, damper: float = 0.0) -> tuple[float, complex] | None:
    """A stiffness [N/m] in [0, K0] with which the loop is unstable, and its pole; the most unstable one found.

    With each stiffness but zero goes a damper [Ns/m], that of a bristle. None where none was found: of the 60 tried
    and the refinement around the worst of them.
    """
    beyond = BEYOND * (1.0 if loop.T else np.abs(loop.poles()).max())
    if loop.growth() > beyond:
        return 0.0, worst_pole(loop, 0.0)
    if not K0:
        return None
    kappas = np.unique(np.concatenate([np.linspace(0, K0, 31)[1:], np.geomspace(1e-3 * K0, K0, 30)]))
    growth = np.array([loop.growth(kappa, damper) for kappa in kappas])
    i = int(np.argmax(growth))
    low, high = kappas[max(i - 1, 0)], kappas[min(i + 1, kappas.size - 1)]
    for kappa in np.linspace(low, high, 9)[1:-1]:
        found = loop.growth(kappa, damper)
        if found > growth[i]:
            kappas[i], growth[i] = kappa, found
    return (float(kappas[i]), worst_pole(loop, float(kappas[i]), damper)) if growth[i] > beyond else None


def worst_pole(loop: SlidingLoop, kappa: float, damper: float = 0.0) -> complex:
    """The pole furthest out."""
    poles = loop.poles(kappa, damper)
    return complex(poles[np.argmax(np.abs(poles) if loop.T else poles.real)])
