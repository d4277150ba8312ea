"""How much stiffer, or stickier, a friction may be and still be proved: by bisection."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from robust.friction_proof.certify import certify_maxwell_slip
from robust.friction_proof.loop import SlidingLoop
from robust.friction_proof.springs import unstable_spring

__all__ = ["proved_limits"]

WITHIN = 1.02  # ratio of the two ends where a bisection stops
LARGEST = 64.0  # times what was asked


def proved_limits(
    loop: SlidingLoop, K0: float, rho: float, bristle_time: float, reference: float
) -> tuple[float, float]:
    """Largest K0 at this rho, and largest rho at this K0, that a proof was found for; both are proved as they stand."""

    def stiffness_proved(ratio: float) -> bool:
        if unstable_spring(loop, ratio * K0) is not None:
            return False
        return certify_maxwell_slip(loop, ratio * K0, rho, bristle_time, reference, quick=True).certificate.holds

    def stiction_proved(ratio: float) -> bool:
        return certify_maxwell_slip(loop, K0, ratio * rho, bristle_time, reference, quick=True).certificate.holds

    return K0 * largest(stiffness_proved), rho * largest(stiction_proved)


def largest(holds: Callable[[float], bool]) -> float:
    """Largest ratio from one on that holds, as a bisection finds it; at most `LARGEST`."""
    low = 1.0
    high = 2.0
    while high <= LARGEST and holds(high):
        low, high = high, 2 * high
    if high > LARGEST:
        return low
    while high / low > WITHIN:
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low
