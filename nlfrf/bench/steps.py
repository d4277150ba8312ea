"""How long an integration step may be: stable, and fine enough for the resonance."""

from __future__ import annotations

import warnings
from collections.abc import Callable

import numpy as np

from nlfrf.shared.arguments import DataWarning

__all__ = ["REAL_LIMIT", "longest_step", "refuse_long_step", "step_refusal", "warn_coarse"]


#: |h lambda| on the negative real axis up to which the fourth-order Runge-Kutta step is stable.
REAL_LIMIT = 2.785
#: Relative error at the resonance of the stuck rig above which a step is called coarse.
COARSE = 0.01


def longest_step(pole: complex) -> float:
    """Longest step [s] with which the Runge-Kutta method keeps a mode with this pole from growing."""
    if abs(pole) == 0 or pole.real > 0:
        return np.inf
    direction = pole / abs(pole)

    def growth(length: float) -> float:
        q = length * direction
        return abs(1 + q + q**2 / 2 + q**3 / 6 + q**4 / 24)

    low, high = 0.0, 4.0  # along every ray into the left half plane growth passes 1 once before 4
    for _ in range(25):
        middle = (low + high) / 2
        low, high = (middle, high) if growth(middle) <= 1 + 1e-12 else (low, middle)
    return low / abs(pole)


def refuse_long_step(longest: float, fs: float, oversampling: int) -> None:
    """Refuse a step with which the rig is unstable even before it slides."""
    if 1 / (fs * oversampling) > longest:
        raise ValueError(
            f"oversampling must be at least {int(np.ceil(1 / (fs * longest)))} for a stable integration step "
            f"of at most {longest:.3g} s at fs = {fs:g} Hz, got {oversampling}"
        )


def step_refusal(fs: float, oversampling: int, stable: Callable[[int], bool]) -> ValueError:
    """The refusal of a step that turned out too long in sliding, with one that was tried and would do."""
    enough, finer = "more than", oversampling
    for finer in (oversampling * 2**i for i in range(1, 10)):
        if stable(finer):
            enough = "about"
            break
    return ValueError(
        f"oversampling must be {enough} {finer} for a stable integration step in sliding "
        f"({1 / (fs * finer):.3g} s at fs = {fs:g} Hz), got {oversampling}"
    )


def warn_coarse(poles: np.ndarray, fs: float, oversampling: int) -> None:
    """Warn where the step moves a pole of the stuck rig by more than 1 % of its damping: the resonance is wrong."""
    swinging = poles[(poles.imag > 0) & (poles.real != 0)]
    if not swinging.size:
        return
    # a Runge-Kutta step of fourth order is off by (h p)^5 / 120
    shift = np.max(np.abs(swinging / swinging.real) * (np.abs(swinging) / (fs * oversampling)) ** 4 / 120)
    if shift > COARSE:
        enough = int(np.ceil(oversampling * (shift / COARSE) ** 0.25))
        warnings.warn(
            f"the integration step is coarse: the resonance of the stuck rig comes out wrong by {100 * shift:.2g} %. "
            f"Take an oversampling of {enough}, or state the accuracy",
            DataWarning,
            stacklevel=3,
        )
